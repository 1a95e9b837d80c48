//! Machine descriptions and kinematics.
//!
//! A machine file (TOML, lengths in mm, angles in degrees) says which joints a machine has, what they can do and
//! how they carry the tool; a [`Machine`] is the same in mm, rad and s. [`Kinematics`] relates joints and tool
//! pose. This crate plans no motion and knows no G-code.
//!
//! | module | job |
//! |---|---|
//! | `schema` | the file format, its checks and their diagnostics |
//! | `library` | the machines that come with the program |
//! | `kinematics` | the trait, poses, errors |
//! | `planar` | planar arm with three turning joints |
//! | `cartesian` | one prismatic joint per axis |

mod cartesian;
mod kinematics;
mod library;
mod planar;
mod schema;

pub use cartesian::Cartesian;
pub use kinematics::{Kinematics, KinematicsError, Pose, Solution};
pub use library::{builtin, is_path, list, source};
pub use planar::Planar3r;
pub use schema::parse;

/// What sort of machine it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// Milling machine, router.
    Mill,
    /// Turning machine.
    Lathe,
    /// Robot arm.
    Robot,
}

/// How a joint moves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum JointKind {
    /// Turns; values in rad.
    Revolute,
    /// Slides; values in mm.
    Prismatic,
}

/// One joint. Values in mm or rad, speeds in mm/s or rad/s.
#[derive(Clone, PartialEq, Debug)]
pub struct Joint {
    /// For people: `shoulder`, `X`.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Its word in joint-space G-code.
    pub word: Option<char>,
    /// Lower limit.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
    /// Greatest speed when cutting.
    pub speed: Option<f64>,
    /// Speed of a rapid move; none = `speed`.
    pub rapid: Option<f64>,
}

impl Joint {
    /// Whether a value lies within the limits, with a little room for rounding.
    pub fn allows(&self, value: f64) -> bool {
        const ROOM: f64 = 1e-9;
        self.min.is_none_or(|m| value >= m - ROOM) && self.max.is_none_or(|m| value <= m + ROOM)
    }
    /// A value as people read it: `12.5 mm`, `30°`.
    pub fn show(&self, value: f64) -> String {
        match self.kind {
            JointKind::Revolute => format!("{}°", short(value.to_degrees())),
            JointKind::Prismatic => format!("{} mm", short(value)),
        }
    }
}

/// A number with at most four decimals and no needless zeros.
fn short(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// What the words A B C mean on a robot.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Orientation {
    /// The tool keeps its direction; A B C are errors.
    Fixed,
    /// Turns about the fixed X, Y, Z.
    AbcEulerXyz,
}

/// How the joints carry the tool.
#[derive(Clone, PartialEq, Debug)]
pub enum Chain {
    /// One joint per axis, in the order X Y Z A B C U V W.
    Cartesian,
    /// Three turning joints in the XY plane: upper arm, forearm, tool (mm).
    Planar3r([f64; 3]),
}

/// A machine, in mm, rad and s.
#[derive(Clone, PartialEq, Debug)]
pub struct Machine {
    /// `maker/model`
    pub id: String,
    /// For people.
    pub title: String,
    /// Sort.
    pub kind: Kind,
    /// Where the numbers come from.
    pub source: String,
    /// What A B C mean; none = not said.
    pub orientation: Option<Orientation>,
    /// How the joints carry the tool.
    pub chain: Chain,
    /// Joints, from the base to the tool.
    pub joints: Vec<Joint>,
    /// Where a program starts.
    pub start: Pose,
    /// The same in joint values; none = whatever solution comes first.
    pub start_joints: Option<Vec<f64>>,
}

impl Machine {
    /// Its kinematics.
    pub fn kinematics(&self) -> Box<dyn Kinematics> {
        match &self.chain {
            Chain::Cartesian => Box::new(Cartesian::new(self.joints.iter().map(|j| j.kind).collect())),
            Chain::Planar3r(links) => Box::new(Planar3r::new(*links)),
        }
    }
    /// Travel limits of the axes X Y Z A B C U V W, for a machine whose joints are its axes.
    pub fn travel(&self) -> Option<[(Option<f64>, Option<f64>); 9]> {
        let Chain::Cartesian = self.chain else { return None };
        let mut out = [(None, None); 9];
        for (slot, joint) in out.iter_mut().zip(&self.joints) {
            *slot = (joint.min, joint.max);
        }
        Some(out)
    }
    /// Greatest cutting speed and rapid speed of the axes, for a machine whose joints are its axes.
    pub fn speeds(&self) -> Option<[(Option<f64>, Option<f64>); 9]> {
        let Chain::Cartesian = self.chain else { return None };
        let mut out = [(None, None); 9];
        for (slot, joint) in out.iter_mut().zip(&self.joints) {
            *slot = (joint.speed, joint.rapid.or(joint.speed));
        }
        Some(out)
    }
    /// The machine as a table for people (`machine show`).
    pub fn describe(&self) -> String {
        let mut out = format!("{}\n{}\n", self.id, self.title);
        if !self.source.is_empty() {
            out += &format!("source: {}\n", self.source);
        }
        out += &match &self.chain {
            Chain::Cartesian => "kinematics: one joint per axis\n".to_string(),
            Chain::Planar3r(l) => {
                format!("kinematics: planar arm, links {}, {}, {} mm\n", short(l[0]), short(l[1]), short(l[2]))
            }
        };
        let p = &self.start;
        out += &format!(
            "start: X {} Y {} Z {} mm, A {} B {} C {}°\n",
            short(p.position[0]),
            short(p.position[1]),
            short(p.position[2]),
            short(p.rotation[0].to_degrees()),
            short(p.rotation[1].to_degrees()),
            short(p.rotation[2].to_degrees()),
        );
        for (i, j) in self.joints.iter().enumerate() {
            let limit = |v: Option<f64>| v.map_or("no limit".to_string(), |v| j.show(v));
            let speed = |v: Option<f64>| v.map_or("no limit".to_string(), |v| format!("{}/s", j.show(v)));
            out += &format!(
                "joint {} {}: from {} to {}, speed {}, rapid {}\n",
                i + 1,
                j.name,
                limit(j.min),
                limit(j.max),
                speed(j.speed),
                speed(j.rapid.or(j.speed)),
            );
        }
        out
    }
}
