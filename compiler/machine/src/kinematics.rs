/// Position and direction of the tool.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pose {
    /// X Y Z, mm.
    pub position: [f64; 3],
    /// Turns about X, Y and Z as the words A B C give them, rad; not brought into one turn.
    pub rotation: [f64; 3],
}

impl Pose {
    /// All six coordinates.
    pub fn coordinates(&self) -> [f64; 6] {
        let [x, y, z] = self.position;
        let [a, b, c] = self.rotation;
        [x, y, z, a, b, c]
    }
    /// From six coordinates.
    pub fn from_coordinates([x, y, z, a, b, c]: [f64; 6]) -> Pose {
        Pose { position: [x, y, z], rotation: [a, b, c] }
    }
}

/// One set of joint values that puts the tool where it is wanted.
#[derive(Clone, PartialEq, Debug)]
pub struct Solution {
    /// Joint values, mm or rad; angles as the formulas give them, not brought into one turn.
    pub joints: Vec<f64>,
    /// Which configuration (elbow up, down …); the same number means the same configuration everywhere.
    pub branch: u8,
    /// Two configurations meet here.
    pub singular: bool,
}

/// Why there is no answer.
#[derive(Clone, PartialEq, Debug)]
pub enum KinematicsError {
    /// Further away than the arm is long, or closer than it can fold.
    OutOfReach {
        /// Distance from the base to the wrist, mm.
        distance: f64,
        /// Least and greatest distance the arm can do, mm.
        reach: (f64, f64),
    },
    /// Joint values are not determined.
    Singular,
    /// A coordinate this machine can't change.
    OutOfPlane {
        /// Its word.
        word: char,
        /// Its value, mm or rad.
        value: f64,
    },
    /// Not the number of joint values it has joints.
    JointCount {
        /// Joints.
        wanted: usize,
        /// Values given.
        given: usize,
    },
    /// A coordinate is infinite or not a number.
    NotFinite,
}

impl std::fmt::Display for KinematicsError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            KinematicsError::OutOfReach { distance, reach: (least, most) } => write!(
                f,
                "the wrist would be {} mm from the base, the arm can do {} to {} mm",
                crate::short(*distance),
                crate::short(*least),
                crate::short(*most)
            ),
            KinematicsError::Singular => write!(f, "the wrist lies on the axis of the first joint"),
            KinematicsError::OutOfPlane { word, .. } => write!(f, "{word} can't be changed by this machine"),
            KinematicsError::JointCount { wanted, given } => write!(f, "{given} joint values for {wanted} joints"),
            KinematicsError::NotFinite => write!(f, "a coordinate is not a finite number"),
        }
    }
}

impl std::error::Error for KinematicsError {}

/// Relates joint values and tool pose. Implementations never return a value that is not finite.
pub trait Kinematics: Send + Sync {
    /// Number of joints.
    fn joint_count(&self) -> usize;
    /// Where the tool is.
    fn forward(&self, joints: &[f64]) -> Result<Pose, KinematicsError>;
    /// All joint values that put the tool there, ordered by branch; at least one.
    fn inverse(&self, pose: &Pose) -> Result<Vec<Solution>, KinematicsError>;
}

/// The joint values, after a check of their number.
pub(crate) fn checked(joints: &[f64], count: usize) -> Result<&[f64], KinematicsError> {
    if joints.len() != count {
        return Err(KinematicsError::JointCount { wanted: count, given: joints.len() });
    }
    if joints.iter().any(|j| !j.is_finite()) {
        return Err(KinematicsError::NotFinite);
    }
    Ok(joints)
}
