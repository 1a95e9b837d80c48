//! The motion of one machine, ready to be written in some language. Lengths in mm, angles in rad, time in s.

use gr_ir::Source;
use gr_machine::math::{Frame, product, quaternion_of, transpose, turn_of};
use gr_machine::{JointKind, Kind, Machine, Signal};

/// No machine here has more joints, external axes included.
pub const MAX_JOINTS: usize = gr_machine::MOST_JOINTS;

/// A point of the path: where the tool is, and the joint values that put it there.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Target {
    /// Tool point in the step's work frame, mm.
    pub position: [f64; 3],
    /// Tool frame's turn in the work frame: unit quaternion, scalar first, scalar never negative.
    pub quaternion: [f64; 4],
    /// Joint values, rad or mm, the machine's joints first, external axes after them; not yet as the controller
    /// counts them ([`Machine::controller_values`]). Unused places are zero.
    pub joints: [f64; MAX_JOINTS],
    /// The configuration, as the kinematics number it.
    pub branch: u8,
}

impl Target {
    /// The same place and turn, seen from another work frame.
    #[must_use]
    pub fn reframed(&self, old: &Frame, new: &Frame) -> Target {
        let mut out = Target { position: new.inverse().apply(old.apply(self.position)), ..*self };
        if old.turn != new.turn {
            let turn = product(&transpose(&new.turn), &product(&old.turn, &turn_of(self.quaternion)));
            out.quaternion = quaternion_of(&turn);
        }
        out
    }

    /// The same joints at the point of another tool.
    #[must_use]
    pub fn retooled(&self, old: &Frame, new: &Frame) -> Target {
        if old == new {
            return *self;
        }
        let at = Frame { turn: turn_of(self.quaternion), position: self.position }.then(&old.inverse()).then(new);
        let quaternion = if old.turn == new.turn { self.quaternion } else { quaternion_of(&at.turn) };
        Target { position: at.position, quaternion, ..*self }
    }
}

/// A tool the program uses.
#[derive(Clone, PartialEq, Debug)]
pub struct Tool {
    /// Its number in the program; 0 = none.
    pub number: u32,
    /// Its name on the controller.
    pub name: String,
    /// Tool point on the flange, spindle mounting and tool length included.
    pub frame: Frame,
    /// Mass, kg.
    pub mass: Option<f64>,
}

/// A work frame (wobj, base, user frame) the program uses.
#[derive(Clone, PartialEq, Debug)]
pub struct WorkFrame {
    /// Its name on the controller: `G54` …
    pub name: String,
    /// It in the robot's base.
    pub frame: Frame,
}

/// What happens at the end of a move.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Zone {
    /// The tool stops there (G61, G61.1, before dwells and signals).
    Stop,
    /// It may cut the corner within this many mm; at most half of both neighboring moves. 0: the next move is the rest of the same
    /// motion of the program, cut only because the tool turns in it.
    Blend(f64),
}

/// A word of the program with its arguments, as the control it was written for reads it: `M3 S8000`, `M67 E1 Q0.5`.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Word {
    /// `M3`, `S`, `M67`, `M101` …
    pub code: String,
    /// Letter and number of the output or input, for M62 to M68.
    pub index: Option<(char, i32)>,
    /// Further arguments: letter and value, in the order they are written.
    pub arguments: Vec<(char, f64)>,
}

impl Word {
    /// A word without arguments.
    pub fn new(code: impl Into<String>) -> Word {
        Word { code: code.into(), ..Word::default() }
    }
    /// A word for one output or input.
    pub fn numbered(code: &str, letter: char, index: i32) -> Word {
        Word { index: Some((letter, index)), ..Word::new(code) }
    }
    /// With one more argument.
    pub fn with(mut self, letter: char, value: f64) -> Word {
        self.arguments.push((letter, value));
        self
    }
    /// Its name in `[io]` of a machine file: `M62P3`.
    pub fn key(&self) -> String {
        self.index.map_or_else(|| self.code.clone(), |(_, i)| format!("{}P{i}", self.code))
    }
}

impl From<&str> for Word {
    fn from(code: &str) -> Word {
        Word::new(code)
    }
}

impl std::fmt::Display for Word {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // S is code and letter of its number at once.
        let bare = self.arguments.first().is_some_and(|(l, _)| self.code == l.to_string());
        if !bare {
            f.write_str(&self.code)?;
        }
        if let Some((letter, index)) = self.index {
            write!(f, " {letter}{index}")?;
        }
        for (i, (letter, value)) in self.arguments.iter().enumerate() {
            write!(f, "{}{letter}{value}", if bare && i == 0 { "" } else { " " })?;
        }
        Ok(())
    }
}

/// One thing the machine does. Targets are indices into [`RobotProgram::targets`]; a move starts where the one before
/// it ended.
#[derive(Clone, PartialEq, Debug)]
pub enum Action {
    /// All joints start and stop together.
    Joint {
        /// Where to.
        to: u32,
        /// Share of the greatest joint speed, above 0 to 1.
        speed: f64,
        /// At its end.
        zone: Zone,
    },
    /// The tool point goes in a straight line.
    Linear {
        /// Where to.
        to: u32,
        /// Of the tool point, mm/s; of the rotary axes of a mill while the tool point stands still on the part, rad/s.
        speed: f64,
        /// At its end.
        zone: Zone,
        /// A rapid of the program, done in a line.
        rapid: bool,
    },
    /// The tool point goes round an arc of at most half a turn.
    Arc {
        /// A point in its middle.
        via: u32,
        /// Its end.
        to: u32,
        /// Its center in the work frame, mm.
        center: [f64; 3],
        /// Unit normal; the turn is positive about it.
        normal: [f64; 3],
        /// Angle turned, rad, positive.
        angle: f64,
        /// Of the tool point, mm/s.
        speed: f64,
        /// At its end.
        zone: Zone,
    },
    /// The tool point goes in a straight line until the probe's input has a state. Where it stops only the machine knows.
    Probe {
        /// Where it stops at the latest.
        to: u32,
        /// Of the tool point, mm/s.
        speed: f64,
        /// Name of the input.
        input: String,
        /// The state that ends the move; at its start the input has the other.
        on: bool,
        /// A move that comes to its end without it stops the program.
        must: bool,
    },
    /// From here on this tool (index into [`RobotProgram::tools`]) is the tool point.
    UseTool(u16),
    /// From here on targets are in this frame (index into [`RobotProgram::frames`]).
    UseFrame(u16),
    /// The tool must be changed to this number; `None` = the machine file doesn't say how: the operator does it.
    ChangeTool {
        /// Number.
        number: u32,
        /// Routine or signal.
        by: Option<Signal>,
    },
    /// A signal or routine of the cell for a word of the program (M3, M8, S …).
    Signal {
        /// The word: `M3`.
        word: Word,
        /// Number that goes with it, where there is one (S in rev/min, analog value).
        value: Option<f64>,
        /// What the machine file says it does.
        signal: Signal,
    },
    /// Wait, s.
    Dwell(f64),
    /// Wait for an input of the controller.
    WaitInput {
        /// Its name.
        name: String,
        /// Its state.
        on: bool,
        /// For at most so long, s.
        timeout: Option<f64>,
    },
    /// Shown to the operator.
    Message(String),
    /// For the reader of the program.
    Comment(String),
    /// The program waits for the operator (M0, M1, M60).
    Pause {
        /// Only when the switch is on.
        optional: bool,
    },
    /// End of the program.
    End,
}

/// An action and where it comes from; `None` = made by us (home, approach, retract).
#[derive(Clone, PartialEq, Debug)]
pub struct Step {
    /// What.
    pub action: Action,
    /// Where from.
    pub source: Option<Source>,
}

/// Where curves of the program are written as straight pieces, and how far these may be from them.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Curves {
    /// mm.
    pub tolerance: f64,
    /// File and line.
    pub lines: std::collections::BTreeSet<(u32, u32)>,
}

impl Curves {
    /// What is left of a tolerance at a line, mm.
    pub(crate) fn left(&self, tolerance: f64, source: Option<gr_ir::Source>) -> f64 {
        let cut = source.is_some_and(|s| self.lines.contains(&(s.file.0, s.line)));
        if cut { (tolerance - self.tolerance).max(0.1 * tolerance) } else { tolerance }
    }
}

/// A way of the tool point shorter than this is none, mm.
pub(crate) const ON_THE_SPOT: f64 = 1e-9;

/// How far the rotary axes of a mill go between two joint positions, as LinuxCNC counts it for a feed of theirs: the root
/// of the sum of squares, rad. 0 on other machines, whose controllers have a law of their own for it.
pub(crate) fn turned_on_the_spot(machine: &Machine, from: &[f64; MAX_JOINTS], to: &[f64; MAX_JOINTS]) -> f64 {
    if machine.kind != Kind::Mill {
        return 0.0;
    }
    let turns = machine.joints.iter().zip(from.iter().zip(to)).filter(|(j, _)| j.kind == JointKind::Revolute);
    libm::sqrt(turns.map(|(_, (a, b))| (a - b) * (a - b)).sum())
}

/// How long a joint move takes at a share of the joints' greatest speeds, accelerations not counted, s.
pub fn joint_seconds(machine: &Machine, from: &[f64; MAX_JOINTS], to: &[f64; MAX_JOINTS], share: f64) -> f64 {
    let each = machine.joints.iter().zip(from.iter().zip(to)).map(|(j, (a, b))| (a - b).abs() / (j.top_rapid() * share));
    each.fold(0.0, f64::max)
}

/// The motion of one machine.
#[derive(Clone, PartialEq, Debug)]
pub struct RobotProgram {
    /// Name, as the file it comes from; languages shorten it to what they can.
    pub name: String,
    /// The machine.
    pub machine: Machine,
    /// Tools, by [`Action::UseTool`].
    pub tools: Vec<Tool>,
    /// Frames, by [`Action::UseFrame`].
    pub frames: Vec<WorkFrame>,
    /// Points of the path.
    pub targets: Vec<Target>,
    /// Where the program starts: joint values of the home position.
    pub home: Target,
    /// What happens, in order.
    pub steps: Vec<Step>,
    /// Curves that are straight pieces here.
    pub curves: Curves,
}
