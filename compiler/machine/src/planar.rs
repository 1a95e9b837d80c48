use crate::kinematics::{Kinematics, KinematicsError, Pose, Solution, checked};

/// Planar arm with three turning joints: base at the origin, upper arm, forearm and tool in the XY plane. The
/// direction of the tool is C, measured from X.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Planar3r {
    links: [f64; 3],
}

impl Planar3r {
    /// With these lengths of upper arm, forearm and tool, mm, all above zero.
    pub fn new(links: [f64; 3]) -> Planar3r {
        Planar3r { links }
    }

    /// Joint values with the elbow bent by an angle of this sine and cosine.
    fn bent(&self, wrist: [f64; 2], phi: f64, sin: f64, cos: f64) -> Vec<f64> {
        let [l1, l2, _] = self.links;
        let (k1, k2) = (l1 + l2 * cos, l2 * sin);
        let elbow = libm::atan2(sin, cos);
        let shoulder = libm::atan2(wrist[1], wrist[0]) - libm::atan2(k2, k1);
        vec![shoulder, elbow, phi - shoulder - elbow]
    }
}

/// How far the cosine of the elbow may pass 1 by rounding, and how close to 1 counts as stretched or folded.
const EDGE: f64 = 1e-12;

impl Kinematics for Planar3r {
    fn joint_count(&self) -> usize {
        3
    }

    fn forward(&self, joints: &[f64]) -> Result<Pose, KinematicsError> {
        let mut pose = Pose::default();
        let mut direction = 0.0;
        for (angle, length) in checked(joints, 3)?.iter().zip(self.links) {
            direction += angle;
            pose.position[0] += length * libm::cos(direction);
            pose.position[1] += length * libm::sin(direction);
        }
        pose.rotation[2] = direction;
        Ok(pose)
    }

    fn inverse(&self, pose: &Pose) -> Result<Vec<Solution>, KinematicsError> {
        let [x, y, z, a, b, phi] = pose.coordinates();
        if [x, y, z, a, b, phi].iter().any(|v| !v.is_finite()) {
            return Err(KinematicsError::NotFinite);
        }
        for (word, value) in [('Z', z), ('A', a), ('B', b)] {
            if value != 0.0 {
                return Err(KinematicsError::OutOfPlane { word, value });
            }
        }
        let [l1, l2, tool] = self.links;
        let wrist = [x - tool * libm::cos(phi), y - tool * libm::sin(phi)];
        let distance = libm::hypot(wrist[0], wrist[1]);
        let cos = (wrist[0] * wrist[0] + wrist[1] * wrist[1] - l1 * l1 - l2 * l2) / (2.0 * l1 * l2);
        // Far coordinates overflow; the comparison is written so that a value that is no number fails it.
        if !(cos.abs() <= 1.0 + EDGE) {
            return Err(KinematicsError::OutOfReach { distance, reach: ((l1 - l2).abs(), l1 + l2) });
        }
        if distance <= 1e-9 {
            return Err(KinematicsError::Singular);
        }
        let cos = cos.clamp(-1.0, 1.0);
        let sin = libm::sqrt(1.0 - cos * cos);
        let singular = cos.abs() >= 1.0 - EDGE;
        let solution = |branch, sin| Solution { joints: self.bent(wrist, phi, sin, cos), branch, singular };
        Ok(if sin == 0.0 { vec![solution(0, 0.0)] } else { vec![solution(0, -sin), solution(1, sin)] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn degrees(joints: &[f64]) -> Vec<f64> {
        joints.iter().map(|j| (j.to_degrees() * 100.0).trunc() / 100.0).collect()
    }

    fn pose(x: f64, y: f64, c: f64) -> Pose {
        Pose { position: [x, y, 0.0], rotation: [0.0, 0.0, c.to_radians()] }
    }

    #[test]
    fn numbers_of_the_thesis() {
        let arm = Planar3r::new([100.0; 3]);
        assert_eq!(degrees(&arm.inverse(&pose(50.0, 50.0, -60.0)).unwrap()[0].joints), [136.92, -93.84, -103.07]);
        assert_eq!(degrees(&arm.inverse(&pose(120.0, 120.0, -10.0)).unwrap()[0].joints), [127.05, -91.91, -45.13]);
    }

    #[test]
    fn errors_are_values() {
        let arm = Planar3r::new([100.0; 3]);
        assert!(matches!(arm.inverse(&pose(400.0, 0.0, 0.0)), Err(KinematicsError::OutOfReach { .. })));
        assert_eq!(arm.inverse(&pose(0.0, -100.0, -90.0)), Err(KinematicsError::Singular));
        assert_eq!(arm.inverse(&pose(f64::NAN, 0.0, 0.0)), Err(KinematicsError::NotFinite));
        assert!(matches!(arm.inverse(&pose(1e300, 0.0, 0.0)), Err(KinematicsError::OutOfReach { .. })));
        let raised = Pose { position: [50.0, 50.0, 5.0], ..Pose::default() };
        assert_eq!(arm.inverse(&raised), Err(KinematicsError::OutOfPlane { word: 'Z', value: 5.0 }));
        let unequal = Planar3r::new([100.0, 60.0, 50.0]);
        assert!(matches!(unequal.inverse(&pose(50.0, 10.0, 0.0)), Err(KinematicsError::OutOfReach { .. })));
    }

    #[test]
    fn stretched_arm_has_one_solution() {
        let arm = Planar3r::new([100.0; 3]);
        let all = arm.inverse(&pose(300.0, 0.0, 0.0)).unwrap();
        assert_eq!(all.len(), 1);
        assert!(all[0].singular);
    }

    proptest! {
        #[test]
        fn every_branch_leads_to_the_pose(
            joints in prop::array::uniform3(-3.1f64..3.1),
            links in prop::array::uniform3(1.0f64..500.0),
        ) {
            let arm = Planar3r::new(links);
            let pose = arm.forward(&joints).unwrap();
            match arm.inverse(&pose) {
                Ok(all) => for s in all {
                    let back = arm.forward(&s.joints).unwrap();
                    for (p, q) in pose.coordinates().iter().zip(back.coordinates()) {
                        prop_assert!((p - q).abs() < 1e-6, "{pose:?} {back:?}");
                    }
                },
                Err(e) => prop_assert!(e == KinematicsError::Singular, "{e:?}"),
            }
        }

        #[test]
        fn never_not_a_number(x in any::<f64>(), y in any::<f64>(), c in any::<f64>()) {
            let arm = Planar3r::new([100.0; 3]);
            if let Ok(all) = arm.inverse(&Pose { position: [x, y, 0.0], rotation: [0.0, 0.0, c] }) {
                prop_assert!(all.iter().all(|s| s.joints.iter().all(|j| j.is_finite())));
            }
        }
    }
}
