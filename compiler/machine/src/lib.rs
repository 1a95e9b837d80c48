//! Machine descriptions and kinematics.
//!
//! A machine file (TOML, lengths in mm, angles in degrees) says which joints a machine has, what they can do and
//! how they carry the tool; a [`Machine`] is the same in mm, rad and s. [`Kinematics`] relates joints and tool
//! pose. This crate plans no motion and knows no G-code.
//!
//! | module | job |
//! |---|---|
//! | `job` | job files: the clampings of a part |
//! | `keys` | which keys a machine file may hold; the JSON Schema made from them |
//! | `tree` | TOML with the place of every value; `extends` |
//! | `schema` | from keys to a machine: checks and their diagnostics |
//! | `library` | the machines that come with the program |
//! | `kinematics` | the trait, poses, errors |
//! | `planar`, `cartesian`, `scara`, `opw`, `ur`, `five_axis`, `prp`, `tricept`, `serial` | one kind of kinematics each |
//! | `cell` | tools, frames, signals: what surrounds the joints |
//! | `figure` | a machine as lines, for pictures |
//! | `differential` | Jacobian, manipulability, condition |
//! | `parameters` | the geometry as named numbers, and the machine with other numbers |
//! | `quality` | accuracy, stiffness, identified geometry, as the file says them |
//! | `mobility` | degrees of freedom of a mechanism from its structure |
//! | `identify` | OPW lengths of a chain of joint frames |
//! | `urdf` | machine files made from URDF |
//! | `math` | vectors and frames |

// `!(x <= limit)` is meant: a value that is not a number must fail the test. Matrices are walked by index.
#![allow(clippy::neg_cmp_op_on_partial_ord, clippy::needless_range_loop)]

mod angle;
mod cartesian;
mod cell;
pub mod differential;
mod doubts;
mod figure;
mod five_axis;
mod identify;
mod job;
mod keys;
mod kinematics;
mod library;
pub mod math;
mod mobility;
mod opw;
mod parameters;
mod planar;
mod prp;
mod quality;
mod scara;
mod schema;
mod serial;
mod tree;
mod tricept;
mod ur;
mod urdf;

pub use cartesian::Cartesian;
pub use cell::{Cell, Controller, Coupling, External, Rapid, Signal, Spindle, ToolData, Zones, signal_number};
pub use doubts::doubts;
pub use five_axis::{Carrier, FiveAxis, Rotary};
pub use identify::{Fit, identify};
pub use job::{Clamping, WORKINGSTEP_NAMES, parse_job};
pub use keys::{job_schema, json_schema};
pub use kinematics::{Control, Kinematics, KinematicsError, Pose, Solution, Violation};
pub use library::{as_published, builtin, is_path, list, reference, source, suggestion};
pub use mobility::{Mobility, mobility};
pub use opw::{Eight, Opw};
pub use parameters::{Parameter, ParameterKind, parameter_columns};
pub use planar::Planar3r;
pub use prp::{SphericalAxis, TwoLegs, TwoLegsShape};
pub use quality::{Accuracy, AsBuilt, Member, Spring, Stiffness};
pub use scara::Scara;
pub use schema::{ID_FORM, MOST_JOINTS, good_id, parse, parse_reference};
pub use serial::{DhRow, Link, Serial};
pub use tricept::{Tricept, TriceptShape};
pub use ur::ParallelWrist;
pub use urdf::{Import, import_urdf};

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
    /// Greatest acceleration, mm/s² or rad/s².
    pub acceleration: Option<f64>,
}

impl Joint {
    /// Greatest speed; a calm one where the file gives none, rad/s or mm/s.
    pub fn top_speed(&self) -> f64 {
        self.speed.unwrap_or(match self.kind {
            JointKind::Revolute => std::f64::consts::FRAC_PI_2,
            JointKind::Prismatic => 200.0,
        })
    }
    /// Greatest speed of a rapid.
    pub fn top_rapid(&self) -> f64 {
        self.rapid.unwrap_or_else(|| self.top_speed())
    }
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
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Orientation {
    /// The tool keeps its direction; A B C are errors.
    Fixed,
    /// Turns about the fixed X, Y, Z.
    AbcEulerXyz,
    /// The rotary axes of the machine the program was written for.
    SourceMachine(String),
}

/// How the joints carry the tool.
#[derive(Clone, PartialEq, Debug)]
pub enum Chain {
    /// One joint per axis, in the order X Y Z A B C U V W.
    Cartesian,
    /// Three turning joints in the XY plane: upper arm, forearm, tool (mm).
    Planar3r([f64; 3]),
    /// Two parallel turning joints, a stroke, a wrist.
    Scara(Scara),
    /// Six joints with a spherical wrist.
    Opw(Opw),
    /// Six joints, three of them parallel, with an offset wrist.
    ParallelWrist(ParallelWrist),
    /// X Y Z and two rotary axes.
    FiveAxis(FiveAxis),
    /// Two legs and a column.
    TwoLegs(Box<TwoLegs>),
    /// Three legs, a tube and a wrist.
    Tricept(Tricept),
    /// Joints one after the other.
    Serial(Serial),
    /// A template: what its file doesn't say yet.
    Incomplete {
        /// Kind of kinematics.
        kind: String,
        /// Missing keys.
        missing: Vec<String>,
        /// Joints.
        joints: usize,
    },
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
    /// Structure of the mechanism as people write it: `2UPS+PRP`.
    pub structure: Option<String>,
    /// What surrounds the joints: tools, frames, signals, controller.
    pub cell: Cell,
    /// The machine with the `[reference]` of its file laid over it, where there is one.
    pub published: Option<Box<Machine>>,
}

/// Kinematics of a template: no values, only the names of the missing keys.
struct Template {
    joints: usize,
    missing: Vec<String>,
}

impl Kinematics for Template {
    fn joint_count(&self) -> usize {
        self.joints
    }
    fn forward(&self, _: &[f64]) -> Result<Pose, KinematicsError> {
        Err(KinematicsError::Incomplete(self.missing.clone()))
    }
    fn inverse(&self, _: &Pose) -> Result<Vec<Solution>, KinematicsError> {
        Err(KinematicsError::Incomplete(self.missing.clone()))
    }
}

impl Machine {
    /// Whether Z of the flange points away from the part: on machine tools and on machines that only place a point. On
    /// arms it points at the part.
    pub fn is_upright(&self) -> bool {
        self.kind != Kind::Robot || self.kinematics().control() == Control::Position
    }
    /// How far the point of a tool of its file stands out of the spindle, mm.
    pub fn tool_length(&self, tool: &ToolData) -> f64 {
        if self.is_upright() { -tool.frame.position[2] } else { tool.frame.position[2] }
    }
    /// Why A B C say nothing on a robot whose file gives them no meaning.
    pub fn no_rotary_words(&self) -> &'static str {
        match self.orientation {
            Some(Orientation::Fixed) => "its machine file keeps the tool's direction (`orientation = \"fixed\"`)",
            _ => "its machine file does not say what the word means",
        }
    }
    /// The tool point on the flange of a tool of which only the length is known.
    pub fn tool_of_length(&self, length: f64) -> crate::math::Frame {
        let nose = self.cell.tool_frame(u32::MAX);
        nose.then(&crate::math::Frame::shift([0.0, 0.0, if self.is_upright() { -length } else { length }]))
    }

    /// Its kinematics.
    pub fn kinematics(&self) -> Box<dyn Kinematics> {
        match &self.chain {
            Chain::Cartesian => Box::new(Cartesian::new(self.joints.iter().map(|j| j.kind).collect())),
            Chain::Planar3r(links) => Box::new(Planar3r::new(*links)),
            Chain::Scara(k) => Box::new(*k),
            Chain::Opw(k) => Box::new(*k),
            Chain::ParallelWrist(k) => Box::new(*k),
            Chain::FiveAxis(k) => Box::new(*k),
            Chain::TwoLegs(k) => Box::new((**k).clone()),
            Chain::Tricept(k) => Box::new(*k),
            Chain::Serial(k) => Box::new(k.clone()),
            Chain::Incomplete { missing, joints, .. } => Box::new(Template { joints: *joints, missing: missing.clone() }),
        }
    }
    /// Joint values as the controller counts them: the robot's own coupling of two joints applied.
    pub fn controller_values(&self, joints: &[f64]) -> Vec<f64> {
        let mut out = joints.to_vec();
        if let Some(c) = &self.cell.coupling
            && let (Some(value), Some(with)) = (joints.get(c.joint), joints.get(c.with))
        {
            out[c.joint] = value + c.factor * with;
        }
        out
    }
    /// The reverse of [`Machine::controller_values`].
    pub fn joint_values(&self, controller: &[f64]) -> Vec<f64> {
        let mut out = controller.to_vec();
        if let Some(c) = &self.cell.coupling
            && let (Some(value), Some(with)) = (controller.get(c.joint), controller.get(c.with))
        {
            out[c.joint] = value - c.factor * with;
        }
        out
    }
    /// Joints, or the value that a coupled joint has on the controller, outside their limits: index and value.
    pub fn outside(&self, joints: &[f64]) -> Vec<(usize, f64)> {
        let mut out: Vec<(usize, f64)> =
            self.joints.iter().zip(joints).enumerate().filter(|(_, (j, v))| !j.allows(**v)).map(|(i, (_, v))| (i, *v)).collect();
        if let Some(c) = &self.cell.coupling
            && let Some(joint) = self.joints.get(c.joint)
            && let Some(value) = self.controller_values(joints).get(c.joint)
        {
            let coupled = Joint { min: c.min.or(joint.min), max: c.max.or(joint.max), ..joint.clone() };
            if !coupled.allows(*value) && !out.iter().any(|(i, _)| *i == c.joint) {
                out.push((c.joint, *value));
            }
        }
        out
    }
    /// The flange that puts the point of a tool on a pose given in the part's frame.
    pub fn flange_for(&self, pose: &math::Frame, tool: &math::Frame) -> math::Frame {
        self.cell.part_in_base().then(pose).then(&tool.inverse())
    }
    /// Degrees of freedom of the mechanism, from its structure.
    pub fn mobility(&self) -> Option<Mobility> {
        self.structure.as_deref().and_then(|s| mobility(s).ok())
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
    /// Greatest accelerations of the axes, for a machine whose joints are its axes.
    pub fn accelerations(&self) -> Option<[Option<f64>; 9]> {
        let Chain::Cartesian = self.chain else { return None };
        let mut out = [None; 9];
        for (slot, joint) in out.iter_mut().zip(&self.joints) {
            *slot = joint.acceleration;
        }
        Some(out)
    }
    /// The machine as a table for people (`machine show`).
    pub fn describe(&self) -> String {
        let mut out = format!("{}\n{}\n", self.id, self.title);
        if !self.source.is_empty() {
            out += &format!("source: {}\n", self.source);
        }
        out += &format!("kinematics: {}\n", self.chain.describe());
        if let (Some(structure), Some(m)) = (&self.structure, self.mobility()) {
            out += &format!("structure: {structure}, {} degrees of freedom\n", m.freedom);
        }
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
        let names: Vec<String> = self.parameters().into_iter().map(|p| p.name).collect();
        if !names.is_empty() {
            out += &format!("geometry: {}\n", names.join(" "));
        }
        out + &self.cell.describe(&self.joints, self.is_upright())
    }
}

impl Chain {
    /// In words.
    fn describe(&self) -> String {
        let list = |v: &[f64]| v.iter().map(|l| short(*l)).collect::<Vec<_>>().join(", ");
        match self {
            Chain::Cartesian => "one joint per axis".to_string(),
            Chain::Planar3r(l) => format!("planar arm, links {} mm", list(l)),
            Chain::Scara(_) => "SCARA arm".to_string(),
            Chain::Opw(k) => format!("arm with spherical wrist, a1 a2 b c1 c2 c3 c4 = {} mm", list(&k.lengths())),
            Chain::ParallelWrist(k) => format!("arm with offset wrist, d1 a2 a3 d4 d5 d6 = {} mm", list(&k.lengths())),
            Chain::FiveAxis(_) => "three linear and two rotary axes, tool point control".to_string(),
            Chain::TwoLegs(_) => "two legs and a column with a turning arm".to_string(),
            Chain::Tricept(k) if k.reference => "three legs, tube and wrist; leg points by the source's equations".to_string(),
            Chain::Tricept(_) => "three legs, tube and wrist; rigid platform".to_string(),
            Chain::Serial(_) => "chain of joints, inverse by search".to_string(),
            Chain::Incomplete { kind, missing, .. } => format!("{kind}, a template: its file must still say {}", missing.join(", ")),
        }
    }
}
