//! A machine as a stick figure: lines through its joints, for pictures. It says where parts are, not what they look
//! like. Mills have none: their axes are the path itself.

use crate::math::{Frame, V3, scale, sub};
use crate::{Chain, Machine};

impl Machine {
    /// Lines of the machine in its base for these joint values (mm, rad), the one from the base to the flange first;
    /// how many points each line has does not depend on the values. None: the values can't be had, or the machine has
    /// no figure.
    pub fn figure(&self, joints: &[f64]) -> Option<Vec<Vec<V3>>> {
        if joints.len() != self.joints.len() {
            return None;
        }
        let flange = self.kinematics().forward_frame(joints).ok()?;
        let lines = match &self.chain {
            Chain::Opw(k) => vec![k.figure(<&[f64; 6]>::try_from(joints).ok()?, &flange)],
            Chain::ParallelWrist(k) => vec![k.figure(joints, &flange)],
            Chain::Serial(k) => vec![k.figure(joints)],
            Chain::Scara(k) => {
                let [upper, _, height] = k.lengths();
                let (s, c) = libm::sincos(joints[0]);
                let over = |z| [flange.position[0], flange.position[1], z];
                vec![vec![[0.0; 3], [0.0, 0.0, height], [upper * c, upper * s, height], over(height), flange.position]]
            }
            Chain::Planar3r(links) => vec![planar(*links, joints)],
            Chain::Tricept(k) => k.figure(&flange),
            Chain::TwoLegs(k) => k.figure(&flange),
            Chain::Cartesian | Chain::FiveAxis(_) | Chain::Incomplete { .. } => return None,
        };
        lines.iter().flatten().flatten().all(|v| v.is_finite()).then_some(lines)
    }
}

fn planar(links: V3, joints: &[f64]) -> Vec<V3> {
    let (mut here, mut direction) = ([0.0; 3], 0.0);
    let mut out = vec![here];
    for (length, angle) in links.iter().zip(joints) {
        direction += angle;
        let (s, c) = libm::sincos(direction);
        here = [here[0] + length * c, here[1] + length * s, 0.0];
        out.push(here);
    }
    out
}

/// The point that lies before a flange by this much along its axis.
pub(crate) fn before(flange: &Frame, by: f64) -> V3 {
    sub(flange.position, scale(flange.axis(2), by))
}

#[cfg(test)]
mod tests {
    use crate::math::{norm, sub};

    #[test]
    fn figures_end_at_the_flange_and_keep_their_lengths() {
        let mut seen = 0;
        for id in crate::list() {
            let machine = crate::builtin(id).unwrap();
            let Some(start) = machine.start_joints.clone().or_else(|| machine.cell.home.clone()) else { continue };
            let Some(a) = machine.figure(&start) else { continue };
            let flange = machine.kinematics().forward_frame(&start).unwrap();
            let end = a[0].last().copied().unwrap();
            assert!(norm(sub(end, flange.position)) < 1e-6, "{id}: {end:?} {:?}", flange.position);
            seen += 1;
            let mut moved = start.clone();
            for (v, j) in moved.iter_mut().zip(&machine.joints) {
                if j.kind == crate::JointKind::Revolute && j.allows(*v + 0.1) {
                    *v += 0.1;
                }
            }
            let Some(b) = machine.figure(&moved) else { continue };
            if a.len() > 1 || machine.joints.iter().any(|j| j.kind == crate::JointKind::Prismatic) {
                continue;
            }
            // Arms are stiff: turning joints changes no distance between neighbours.
            for (p, q) in a[0].windows(2).zip(b[0].windows(2)) {
                let (was, is) = (norm(sub(p[1], p[0])), norm(sub(q[1], q[0])));
                assert!((was - is).abs() < 1e-6, "{id}: {was} {is}");
            }
        }
        assert!(seen > 20, "{seen}");
    }

    #[test]
    fn an_arm_has_its_elbow_where_its_lengths_say() {
        let arm = crate::builtin("ufmg/plano-3r").unwrap();
        let crate::Chain::Planar3r([a, b, c]) = arm.chain else { panic!() };
        let points = arm.figure(&[0.0, std::f64::consts::FRAC_PI_2, 0.0]).unwrap().remove(0);
        let expected = [[0.0, 0.0, 0.0], [a, 0.0, 0.0], [a, b, 0.0], [a, b + c, 0.0]];
        assert!(points.iter().zip(&expected).all(|(p, q)| norm(sub(*p, *q)) < 1e-9), "{points:?}");
        assert_eq!(arm.figure(&[0.0]), None);
    }
}
