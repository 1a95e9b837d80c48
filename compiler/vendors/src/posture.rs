//! How an arm with a spherical wrist stands, by geometry and not by any maker's numbers.

use gr_machine::{Chain, Machine};

/// Which of the eight ways an arm takes to a pose, but for the wrist: that is the sign of its fifth joint.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Posture {
    /// The wrist's center lies behind the first axis.
    pub behind: bool,
    /// The forearm bends forward: the wrist's center lies in front of the line through the second and third axis.
    pub forward: bool,
}

impl Posture {
    /// Of the joint values (rad); none where the arm has no spherical wrist.
    pub(crate) fn of(machine: &Machine, joints: &[f64]) -> Option<Posture> {
        let Chain::Opw(arm) = &machine.chain else { return None };
        let ([a1, a2, _, _, c2, c3, _], offsets, signs) = (arm.lengths(), arm.offsets(), arm.signs());
        let model = |i: usize| joints.get(i).copied().unwrap_or(0.0) * signs[i] - offsets[i];
        let (s2, k2) = libm::sincos(model(1));
        let (s23, k23) = libm::sincos(model(1) + model(2));
        let (out, up) = (a2 * k23 + c3 * s23, c3 * k23 - a2 * s23);
        Some(Posture { behind: a1 + c2 * s2 + out < 0.0, forward: out * k2 - up * s2 > 0.0 })
    }

    /// The elbow lies above the line from shoulder to wrist.
    pub(crate) fn up(self) -> bool {
        self.forward != self.behind
    }
}
