use crate::math::{Frame, euler_of};

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
    /// As a frame.
    pub fn frame(&self) -> Frame {
        Frame::new(self.position, self.rotation)
    }
    /// From a frame; the turns are those nearest to zero.
    pub fn from_frame(frame: &Frame) -> Pose {
        Pose { position: frame.position, rotation: euler_of(&frame.turn) }
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
    /// The joint values fit more than one assembly of a parallel machine within its limits.
    Ambiguous {
        /// Assemblies.
        count: usize,
    },
    /// The parts of the machine can't be put together with these joint values.
    NoAssembly,
    /// The tool can't take this direction, whatever the joints do.
    Direction,
    /// The numerical search found no joint values; what is left over at the best it found.
    NotFound {
        /// Distance, mm.
        distance: f64,
        /// Angle, rad.
        angle: f64,
    },
    /// The machine file is a template; these keys are missing.
    Incomplete(Vec<String>),
}

impl std::fmt::Display for KinematicsError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            KinematicsError::OutOfReach { distance, reach: (least, f64::INFINITY) } => {
                let (far, least) = (crate::short(*distance), crate::short(*least));
                write!(f, "the wrist would be {far} mm from the base, the arm can't come nearer than {least} mm")
            }
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
            KinematicsError::Ambiguous { count } => {
                write!(f, "{count} positions of the tool fit these joint values within the limits")
            }
            KinematicsError::NoAssembly => write!(f, "no position of the tool fits these joint values"),
            KinematicsError::Direction => write!(f, "the tool can't be turned into this direction"),
            KinematicsError::NotFound { distance, angle } => write!(
                f,
                "no joint values were found; the nearest leave {} mm and {}°",
                crate::short(*distance),
                crate::short(angle.to_degrees())
            ),
            KinematicsError::Incomplete(keys) => {
                write!(f, "the machine is a template; its file must still say {}", keys.join(", "))
            }
        }
    }
}

impl std::error::Error for KinematicsError {}

/// Relates joint values and tool pose. Implementations never return a value that is not finite. Each gives `forward` or
/// `forward_frame`, and `inverse` or `inverse_frame`: of each pair the other follows.
pub trait Kinematics: Send + Sync {
    /// Number of joints.
    fn joint_count(&self) -> usize;
    /// Where the tool is.
    fn forward(&self, joints: &[f64]) -> Result<Pose, KinematicsError> {
        Ok(Pose::from_frame(&self.forward_frame(joints)?))
    }
    /// All joint values that put the tool there, ordered by branch; at least one.
    fn inverse(&self, pose: &Pose) -> Result<Vec<Solution>, KinematicsError> {
        self.inverse_frame(&pose.frame())
    }
    /// Where the tool is, as a frame.
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        Ok(self.forward(joints)?.frame())
    }
    /// As [`Kinematics::inverse`], for a frame.
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        self.inverse(&Pose::from_frame(frame))
    }
    /// Conditions of the mechanism that these joint values break, besides the limits of the joints themselves.
    fn violations(&self, _joints: &[f64]) -> Vec<Violation> {
        Vec::new()
    }
    /// Which turns the machine controls: all, only the direction of the tool's own axis (a spindle on a five-axis
    /// machine), or none.
    fn control(&self) -> Control {
        Control::Full
    }
}

/// How much of the tool's direction the joints decide.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Control {
    /// All of it.
    Full,
    /// The tool axis; the turn about it follows by itself.
    Axis,
    /// None; the direction follows from the position.
    Position,
}

/// A condition of the mechanism that does not hold.
#[derive(Clone, PartialEq, Debug)]
pub struct Violation {
    /// Stable name: `leg-1-short`, `spherical-2` …
    pub name: &'static str,
    /// For people: what it is that goes too far.
    pub what: String,
    /// Its value, mm or rad.
    pub value: f64,
    /// Its limit, mm or rad.
    pub limit: f64,
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
