//! What can be chosen when a program is planned, and what comes of it.

use gr_ir::{Marker, Op, Source};
use gr_machine::math::Frame;
use gr_text::Diagnostic;

use crate::RobotProgram;

/// What can be chosen.
#[derive(Clone, PartialEq, Debug)]
pub struct Options {
    /// Name of the program.
    pub name: String,
    /// Greatest distance of straight pieces from a curve that is no arc of the robot's, mm.
    pub tolerance: f64,
    /// How far above its first and last point the tool comes and leaves, mm; 0 = not at all.
    pub approach: f64,
    /// Where no configuration fits a whole cut, lift the tool by this much, change, and go on, mm.
    pub reconfigure: Option<f64>,
    /// The controller knows M3, S, M8 … itself: words the machine file says nothing about stay words.
    pub own_words: bool,
    /// A move can end where an input switches, which joint positions can't say.
    pub probing: bool,
    /// Setups of a job: each with its own placement of the part. None = the cell's.
    pub setups: Vec<Setup>,
    /// There is no tool table: on a mill whose file has tools, no other has a length.
    pub no_tool_table: bool,
}

/// A clamping of the part: where it is, and for which piece of the program.
#[derive(Clone, PartialEq, Debug)]
pub struct Setup {
    /// Its name.
    pub name: String,
    /// From this line of the main program on, from 0.
    pub from_line: Option<u32>,
    /// For these workingsteps, wherever they stand: each by its name or its instance name, see [`Workingstep::is_called`].
    pub workingsteps: Vec<String>,
    /// The part's frame in the base, which then holds for every work offset; none = as the machine file has it.
    pub part: Option<Frame>,
    /// Where the job file says so.
    pub place: Source,
}

impl Setup {
    /// What is wrong where no move is made in it.
    pub fn never_begins(&self) -> String {
        format!("setup `{}` never begins: the program makes no move there", self.name)
    }
}

/// What a job file can call a workingstep.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Workingstep {
    /// Its name in the exchange file, which others may have too; may be empty.
    pub name: String,
    /// Its instance name, `#59`, which it has alone.
    pub instance: String,
}

impl Workingstep {
    /// The one that an operation begins.
    pub fn begun_by(op: &Op<'_>) -> Option<Workingstep> {
        let Op::Begin { marker: Marker::Workingstep, code, text } = op else { return None };
        Some(Workingstep { name: text.to_string(), instance: format!("#{code}") })
    }

    /// Whether a job file means it by this: its name or its instance name.
    pub fn is_called(&self, what: &str) -> bool {
        what == self.instance || what == self.name && !what.is_empty()
    }
}

impl Default for Options {
    fn default() -> Options {
        Options { name: "program".into(), tolerance: 0.01, approach: 50.0, reconfigure: None, own_words: false, probing: true, setups: Vec::new(), no_tool_table: false }
    }
}

/// A planned program and what is worth knowing about it.
#[derive(Clone, PartialEq, Debug)]
pub struct Planned {
    /// The motion.
    pub program: RobotProgram,
    /// Warnings.
    pub warnings: Vec<Diagnostic>,
    /// Figures.
    pub summary: Summary,
}

/// Figures of a planned program.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Summary {
    /// Cutting moves.
    pub cuts: usize,
    /// Arcs among them.
    pub arcs: usize,
    /// Rapids.
    pub rapids: usize,
    /// Time at feed, s.
    pub cut_seconds: f64,
    /// Time of rapids, s.
    pub rapid_seconds: f64,
    /// Both with the accelerations of the machine file.
    pub accelerates: bool,
    /// Time of dwells, s.
    pub wait_seconds: f64,
    /// Least distance of the wrist from the border of its reach, mm, and where.
    pub reach_margin: Option<(f64, Option<Source>)>,
    /// Least share of a joint's range that is left to a limit, 0 … 0.5: joint and where.
    pub limit_margin: Option<(f64, usize, Option<Source>)>,
    /// Least angle to a singular position, rad, and where; by wrist, elbow and shoulder.
    pub singularity: Option<(f64, Singularity, Option<Source>)>,
    /// Greatest share of a joint's speed limit at the programmed feeds: joint and where.
    pub joint_speed: Option<(f64, usize, Option<Source>)>,
}

/// Which axes come into line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Singularity {
    /// Fourth and sixth.
    Wrist,
    /// Arm stretched or folded.
    Elbow,
    /// Wrist over the first axis.
    Shoulder,
}

impl Singularity {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Singularity::Wrist => "the wrist is straight",
            Singularity::Elbow => "the arm is stretched",
            Singularity::Shoulder => "the wrist is over the first axis",
        }
    }
}

impl Summary {
    /// All time, s.
    pub fn seconds(&self) -> f64 {
        self.cut_seconds + self.rapid_seconds + self.wait_seconds
    }
}
