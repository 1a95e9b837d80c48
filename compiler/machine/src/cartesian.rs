use crate::kinematics::{Kinematics, KinematicsError, Pose, Solution, checked};
use crate::JointKind;

/// One joint per axis, in the order X Y Z A B C U V W. A pose has no U V W: they are 0.
#[derive(Clone, PartialEq, Debug)]
pub struct Cartesian {
    joints: Vec<JointKind>,
}

impl Cartesian {
    /// With these joints, at most nine.
    pub fn new(joints: Vec<JointKind>) -> Cartesian {
        Cartesian { joints }
    }
}

const WORDS: [char; 6] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// How far a tool may be turned about an axis that isn't there, by rounding, rad: a part that is clamped turned gives no whole zeros.
const LEAN: f64 = 1e-9;

impl Kinematics for Cartesian {
    fn joint_count(&self) -> usize {
        self.joints.len()
    }

    fn forward(&self, joints: &[f64]) -> Result<Pose, KinematicsError> {
        let mut all = [0.0; 6];
        for (slot, value) in all.iter_mut().zip(checked(joints, self.joints.len())?) {
            *slot = *value;
        }
        Ok(Pose::from_coordinates(all))
    }

    fn inverse(&self, pose: &Pose) -> Result<Vec<Solution>, KinematicsError> {
        let all = pose.coordinates();
        if all.iter().any(|v| !v.is_finite()) {
            return Err(KinematicsError::NotFinite);
        }
        // A tool that points along Z turns about itself without three axes.
        let turned = |i: usize| all[i].abs() > LEAN;
        let spins = self.joints.len() == 3 && !turned(3) && !turned(4);
        if let Some(i) = (self.joints.len()..6).find(|i| turned(*i) && !(spins && *i == 5)) {
            return Err(KinematicsError::OutOfPlane { word: WORDS[i], value: all[i] });
        }
        let joints = (0..self.joints.len()).map(|i| all.get(i).copied().unwrap_or(0.0)).collect();
        Ok(vec![Solution { joints, branch: 0, singular: false }])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_joints() {
        let k = Cartesian::new(vec![JointKind::Prismatic; 3]);
        let pose = k.forward(&[1.0, 2.0, 3.0]).unwrap();
        assert_eq!(pose.position, [1.0, 2.0, 3.0]);
        assert_eq!(k.inverse(&pose).unwrap()[0].joints, [1.0, 2.0, 3.0]);
        let turned = Pose { rotation: [0.0, 0.1, 0.0], ..pose };
        assert_eq!(k.inverse(&turned), Err(KinematicsError::OutOfPlane { word: 'B', value: 0.1 }));
        let spun = Pose { rotation: [0.0, 0.0, 0.5], ..pose };
        assert_eq!(k.inverse(&spun).unwrap()[0].joints, [1.0, 2.0, 3.0]);
        let rounded = Pose { rotation: [-1e-16, 3e-16, 0.5], ..pose };
        assert_eq!(k.inverse(&rounded).unwrap()[0].joints, [1.0, 2.0, 3.0]);
        assert!(k.forward(&[1.0]).is_err());
    }
}
