use crate::kinematics::{Kinematics, KinematicsError, Solution, checked};
use crate::math::{Frame, V3};

/// Six-joint arm with a spherical wrist and an ortho-parallel base, in closed form with all eight solutions.
///
/// Seven lengths describe it (M. Brandstötter, A. Angerer, M. Hofbaur, *An analytical solution of the inverse
/// kinematics problem of industrial serial manipulators with an ortho-parallel basis and a spherical wrist*, 2014):
/// a1 a2 b c1 c2 c3 c4. With all model angles 0 the arm points straight up;
/// model angle = joint value · sign − offset.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Opw {
    lengths: [f64; 7],
    offsets: [f64; 6],
    signs: [f64; 6],
}

/// All answers at once, without a heap: branch `i` is good when bit `i` of a mask is set.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Eight {
    /// Joint values by branch: 4 = arm reaching over backwards, 2 = second elbow, 1 = wrist flipped.
    pub joints: [[f64; 6]; 8],
    /// Branches that exist.
    pub good: u8,
    /// Branches where two meet, or where a joint is free and a value has been chosen for it.
    pub singular: u8,
}

/// The sine below which two axes count as one line.
const POLE: f64 = 1e-12;
/// How far a cosine may pass 1 by rounding.
const EDGE: f64 = 1e-12;

impl Opw {
    /// With lengths a1 a2 b c1 c2 c3 c4 in mm, offsets in rad and signs ±1.
    pub fn new(lengths: [f64; 7], offsets: [f64; 6], signs: [f64; 6]) -> Opw {
        Opw { lengths, offsets, signs }
    }

    /// a1 a2 b c1 c2 c3 c4, mm.
    pub fn lengths(&self) -> [f64; 7] {
        self.lengths
    }
    /// Offsets, rad.
    pub fn offsets(&self) -> [f64; 6] {
        self.offsets
    }
    /// Signs, ±1.
    pub fn signs(&self) -> [f64; 6] {
        self.signs
    }

    /// Where the flange is.
    pub fn flange(&self, joints: &[f64; 6]) -> Frame {
        let [a1, a2, b, c1, c2, c3, c4] = self.lengths;
        let q = |i: usize| libm::sincos(joints[i] * self.signs[i] - self.offsets[i]);
        let ((s1, k1), (s2, k2), (s3, k3)) = (q(0), q(1), q(2));
        let ((s4, k4), (s5, k5), (s6, k6)) = (q(3), q(4), q(5));
        let (s23, k23) = (s2 * k3 + k2 * s3, k2 * k3 - s2 * s3);
        // Wrist in the frame of the forearm, then the forearm in the base.
        let w = [
            [k4 * k5 * k6 - s4 * s6, -k4 * k5 * s6 - s4 * k6, k4 * s5],
            [s4 * k5 * k6 + k4 * s6, -s4 * k5 * s6 + k4 * k6, s4 * s5],
            [-s5 * k6, s5 * s6, k5],
        ];
        let mut turn = [[0.0; 3]; 3];
        for i in 0..3 {
            let (x, y, z) = (w[0][i], w[1][i], w[2][i]);
            let out = k23 * x + s23 * z;
            turn[0][i] = k1 * out - s1 * y;
            turn[1][i] = s1 * out + k1 * y;
            turn[2][i] = k23 * z - s23 * x;
        }
        let out = a1 + c2 * s2 + a2 * k23 + c3 * s23;
        let up = c1 + c2 * k2 - a2 * s23 + c3 * k23;
        let position = [
            k1 * out - s1 * b + c4 * turn[0][2],
            s1 * out + k1 * b + c4 * turn[1][2],
            up + c4 * turn[2][2],
        ];
        Frame { turn, position }
    }

    /// Movement of the flange per mm of each length: it doesn't turn by them.
    pub(crate) fn by_lengths(&self, joints: &[f64; 6]) -> [V3; 7] {
        let q = |i: usize| libm::sincos(joints[i] * self.signs[i] - self.offsets[i]);
        let ((s1, k1), (s2, k2), (s3, k3)) = (q(0), q(1), q(2));
        let (s23, k23) = (s2 * k3 + k2 * s3, k2 * k3 - s2 * s3);
        let at = |out: f64, up: f64| [k1 * out, s1 * out, up];
        let upright = [0.0, 0.0, 1.0];
        [at(1.0, 0.0), at(k23, -s23), [-s1, k1, 0.0], upright, at(s2, k2), at(s23, k23), self.flange(joints).axis(2)]
    }

    /// Points from the base to the flange: foot, shoulder, elbow, end of the forearm's crank, wrist.
    pub(crate) fn figure(&self, joints: &[f64; 6], flange: &Frame) -> Vec<V3> {
        let [a1, a2, b, c1, c2, _, c4] = self.lengths;
        let q = |i: usize| libm::sincos(joints[i] * self.signs[i] - self.offsets[i]);
        let ((s1, k1), (s2, k2), (s3, k3)) = (q(0), q(1), q(2));
        let (s23, k23) = (s2 * k3 + k2 * s3, k2 * k3 - s2 * s3);
        let at = |out: f64, up: f64| [k1 * out - s1 * b, s1 * out + k1 * b, up];
        let (out, up) = (a1 + c2 * s2, c1 + c2 * k2);
        let crank = at(out + a2 * k23, up - a2 * s23);
        vec![[0.0; 3], [0.0, 0.0, c1], at(a1, c1), at(out, up), crank, crate::figure::before(flange, c4), flange.position]
    }

    /// All joint values for a flange, in −π … π of the joint's own scale plus offset.
    pub fn solve(&self, flange: &Frame) -> Eight {
        let [a1, a2, b, c1, _, _, c4] = self.lengths;
        let mut all = Eight::default();
        let wrist = [0, 1, 2].map(|i| flange.position[i] - c4 * flange.turn[i][2]);
        let square = wrist[0] * wrist[0] + wrist[1] * wrist[1] - b * b;
        let far = libm::sqrt(wrist[0] * wrist[0] + wrist[1] * wrist[1]);
        // On the cylinder about the first axis that the shoulder offset leaves out, front and back meet.
        if !(square >= -EDGE * (far + b.abs()) * (far + b.abs())) {
            return all;
        }
        let out = libm::sqrt(square.max(0.0));
        let free = far <= 1e-9;
        for side in 0..2u8 {
            let x = if side == 0 { out } else { -out };
            // The wrist seen from the base is (x, b) turned by the first joint.
            let (k1, s1) = if free {
                (1.0, 0.0)
            } else {
                ((wrist[0] * x + wrist[1] * b) / (far * far), (wrist[1] * x - wrist[0] * b) / (far * far))
            };
            let (k1, s1) = unit(k1, s1);
            let meets = free || (b != 0.0 && out <= 1e-9 * far);
            let first = (crate::angle::atan2(s1, k1), s1, k1);
            self.elbows(&mut all, flange, side, first, (x - a1, wrist[2] - c1), (a2, meets));
        }
        all
    }

    fn elbows(&self, all: &mut Eight, flange: &Frame, side: u8, (q1, s1, k1): (f64, f64, f64), (x, z): (f64, f64), (a2, meets): (f64, bool)) {
        let (c2, c3) = (self.lengths[4], self.lengths[5]);
        let fore = a2 * a2 + c3 * c3;
        let k = libm::sqrt(fore);
        let cos = (x * x + z * z - c2 * c2 - fore) / (2.0 * c2 * k);
        if !(cos.abs() <= 1.0 + EDGE) {
            return;
        }
        let cos = cos.clamp(-1.0, 1.0);
        let sin = libm::sqrt((1.0 - cos) * (1.0 + cos));
        let stretched = sin <= 1e-6;
        for bend in 0..2u8 {
            let sin = if bend == 0 { sin } else { -sin };
            // The bend between upper arm and the line elbow–wrist, less the angle of that line on the forearm.
            let (s3, k3) = ((sin * c3 - cos * a2) / k, (cos * c3 + sin * a2) / k);
            // The wrist seen from the upper arm; turning it by the second joint gives the wrist seen from the base.
            let (vx, vz) = (a2 * k3 + c3 * s3, c2 - a2 * s3 + c3 * k3);
            let folded = vx * vx + vz * vz <= 1e-18;
            let (k2, s2) = if folded { (1.0, 0.0) } else { unit(vx * x + vz * z, vz * x - vx * z) };
            let (s23, k23) = (s2 * k3 + k2 * s3, k2 * k3 - s2 * s3);
            let arm = [q1, crate::angle::atan2(s2, k2), crate::angle::atan2(s3, k3)];
            let mark = meets || stretched || folded;
            self.wrists(all, flange, side * 4 + bend * 2, arm, [s1, k1, s23, k23], mark);
        }
    }

    fn wrists(&self, all: &mut Eight, flange: &Frame, branch: u8, arm: [f64; 3], [s1, k1, s23, k23]: [f64; 4], mark: bool) {
        let r = &flange.turn;
        // The flange turned back by the arm.
        let column = |i: usize| {
            let out = k1 * r[0][i] + s1 * r[1][i];
            [k23 * out - s23 * r[2][i], k1 * r[1][i] - s1 * r[0][i], s23 * out + k23 * r[2][i]]
        };
        let (x, y, z) = (column(0), column(1), column(2));
        let lean = libm::sqrt(z[0] * z[0] + z[1] * z[1]);
        let pole = lean <= POLE;
        // With the fourth and the sixth axis in one line only their sum counts: the fourth stays at model angle 0.
        let (k4, s4) = if pole { (1.0, 0.0) } else { (z[0] / lean, z[1] / lean) };
        let q4 = crate::angle::atan2(s4, k4);
        let q5 = crate::angle::atan2(lean, z[2]);
        // The sixth joint from what the fourth leaves over: exact however small the lean is.
        let q6 = crate::angle::atan2(k4 * x[1] - s4 * x[0], k4 * y[1] - s4 * y[0]);
        for (flip, wrist) in [[q4, q5, q6], [q4 + std::f64::consts::PI, -q5, q6 + std::f64::consts::PI]].into_iter().enumerate() {
            let model = [arm[0], arm[1], arm[2], wrist[0], wrist[1], wrist[2]];
            let slot = usize::from(branch) + flip;
            if (0..6).any(|i| !model[i].is_finite()) {
                continue;
            }
            for i in 0..6 {
                all.joints[slot][i] = turn(model[i] + self.offsets[i]) * self.signs[i];
            }
            all.good |= 1 << slot;
            if mark || lean <= 1e-6 {
                all.singular |= 1 << slot;
            }
        }
    }

    fn reach(&self) -> (f64, f64) {
        let [_, a2, _, _, c2, c3, _] = self.lengths;
        let fore = libm::hypot(a2, c3);
        ((c2 - fore).abs(), c2 + fore)
    }

    fn too_far(&self, flange: &Frame) -> KinematicsError {
        let [a1, _, b, c1, _, _, c4] = self.lengths;
        let wrist = [0, 1, 2].map(|i| flange.position[i] - c4 * flange.turn[i][2]);
        let out = libm::sqrt((wrist[0] * wrist[0] + wrist[1] * wrist[1] - b * b).max(0.0)) - a1;
        KinematicsError::OutOfReach { distance: libm::hypot(out, wrist[2] - c1), reach: self.reach() }
    }
}

/// Both divided by their common length.
fn unit(x: f64, y: f64) -> (f64, f64) {
    let l = libm::sqrt(x * x + y * y);
    if l > 0.0 { (x / l, y / l) } else { (1.0, 0.0) }
}

/// An angle brought into −π … π.
pub(crate) fn turn(angle: f64) -> f64 {
    const TURN: f64 = 2.0 * std::f64::consts::PI;
    const HALF: f64 = std::f64::consts::PI;
    if angle.abs() > 3.0 * HALF {
        return angle - TURN * libm::round(angle / TURN);
    }
    // Which of the three it is can't be foreseen: no branch.
    let too_far = f64::from_bits(TURN.to_bits() & u64::from(angle.abs() > HALF).wrapping_neg());
    angle - too_far.copysign(angle)
}

impl Kinematics for Opw {
    fn joint_count(&self) -> usize {
        6
    }
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        let q: &[f64; 6] = checked(joints, 6)?.try_into().map_err(|_| KinematicsError::NotFinite)?;
        Ok(self.flange(q))
    }
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        if !frame.is_finite() {
            return Err(KinematicsError::NotFinite);
        }
        let all = self.solve(frame);
        if all.good == 0 {
            return Err(self.too_far(frame));
        }
        let solution = |i: u8| Solution {
            joints: all.joints[usize::from(i)].to_vec(),
            branch: i,
            singular: all.singular & (1 << i) != 0,
        };
        Ok((0..8).filter(|i| all.good & (1 << i) != 0).map(solution).collect())
    }
}
