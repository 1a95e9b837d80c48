//! Normalised G-code: a program without subroutines, loops, parameters, canned cycles, compensation and polar
//! words that moves the machine exactly as the source does, for LinuxCNC, a Fanuc machining centre or grbl.
//!
//! What the program says about the machine's own data stays symbolic: work offsets are selected, not replaced
//! by numbers; tool lengths are G43 H; G28 and G53 remain what they are, except where the program stores the
//! reference itself or changes the length unit under an active tool offset: there G28 is the moves it is. What the language can't say is an error
//! at the source line.
//!
//! | module | job |
//! |---|---|
//! | `write` | lines, words, numbers |
//! | `emit` | operations one after another |
//! | `moves` | moves: which words, which numbers |
//! | `arcs` | arcs whose rounded numbers still make a circle |
//! | `cycles` | drilling as canned cycles |
//! | `beside` | contours for the radius compensation of the control |
//! | `settings` | everything that does not move |

mod arcs;
mod beside;
mod cycles;
mod emit;
mod moves;
mod settings;
mod write;

pub use emit::emit;

use gr_ir::{Axes, Units};
use gr_text::Diagnostic;

/// The language that is written.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Language {
    /// LinuxCNC.
    #[default]
    Linuxcnc,
    /// Fanuc machining centre.
    FanucMill,
    /// grbl 1.1.
    Grbl,
}

impl Language {
    /// Of a dialect's id or alias; none for dialects that can't be written.
    pub fn of_dialect(name: &str) -> Option<Language> {
        Some(match gr_spec::Dialect::find(name)?.id {
            "linuxcnc-2.9" | "linuxcnc-2.10" => Language::Linuxcnc,
            "fanuc-mill" => Language::FanucMill,
            "grbl" => Language::Grbl,
            _ => return None,
        })
    }
    /// For people.
    pub fn title(self) -> &'static str {
        match self {
            Language::Linuxcnc => "LinuxCNC",
            Language::FanucMill => "a Fanuc machining centre",
            Language::Grbl => "grbl",
        }
    }
}

/// How arcs are written.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Arcs {
    /// I J K from the start point.
    #[default]
    Ijk,
    /// I J K as absolute position (LinuxCNC only).
    IjkAbsolute,
    /// R; where R would be vague, the arc is divided.
    R,
    /// Straight pieces within the arc tolerance.
    Lines,
}

/// Where the tool is changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ChangeAt {
    /// At the top of the Z axis of the machine: G53 G0 Z0.
    G53,
    /// At the machine's second reference point.
    G30,
    /// At the origin of G55, from 5 mm above it.
    G55,
}

/// What can be chosen.
#[derive(Clone, PartialEq, Debug)]
pub struct Options {
    /// Language.
    pub language: Language,
    /// Length unit.
    pub units: Units,
    /// Decimals of coordinates; none = 4 (mm), 5 (inch), and one less where the control is not LinuxCNC.
    pub decimals: Option<usize>,
    /// Arcs.
    pub arcs: Arcs,
    /// Arcs outside the XY plane become straight pieces.
    pub only_xy_arcs: bool,
    /// Greatest distance of straight pieces from the curve they stand for, mm.
    pub arc_tolerance: f64,
    /// First N number and step; none = no N words.
    pub numbers: Option<(u32, u32)>,
    /// Write words that have not changed too.
    pub repeat_words: bool,
    /// Write comments.
    pub comments: bool,
    /// Write drilling as canned cycles where the control does exactly the same.
    pub cycles: bool,
    /// Pecks as canned cycles too: the control is LinuxCNC 2.9, whose distance from the last peck is known.
    pub pecks: bool,
    /// Passes beside a wall as contours that the control compensates (G41, G42) where that is the same motion.
    pub control_compensates: bool,
    /// Where tools are changed; none = where the program has the tool.
    pub change_at: Option<ChangeAt>,
    /// Remarks at the top of the program.
    pub remarks: Vec<String>,
    /// Program number and name, for the controls that want one.
    pub name: String,
    /// Work offsets that are stored in the control (1 = G54), mm and rad: values that a program only selects.
    pub stored_offsets: [Axes; 10],
    /// Rotations stored with them, rad.
    pub stored_rotations: [f64; 10],
    /// The control's parameters are known: where nothing is stored, zero is.
    pub stored_known: bool,
    /// The control wakes up in diameter mode (G7).
    pub diameters: bool,
    /// Tool numbers with their offsets, mm: an offset that is a tool's is written as G43 H.
    pub tools: Vec<(i32, Axes)>,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            language: Language::Linuxcnc,
            units: Units::Mm,
            decimals: None,
            arcs: Arcs::Ijk,
            only_xy_arcs: false,
            arc_tolerance: 0.001,
            numbers: None,
            repeat_words: false,
            comments: true,
            cycles: false,
            pecks: true,
            control_compensates: false,
            change_at: None,
            remarks: Vec::new(),
            name: String::new(),
            stored_offsets: [[0.0; 9]; 10],
            stored_rotations: [0.0; 10],
            stored_known: false,
            diameters: false,
            tools: Vec::new(),
        }
    }
}

impl Options {
    /// Decimals of coordinates.
    pub fn places(&self) -> usize {
        let usual = if self.units == Units::Inch { 5 } else { 4 };
        let usual = if self.language == Language::Linuxcnc { usual } else { usual - 1 };
        self.decimals.unwrap_or(usual).min(12)
    }
    /// What does not go together.
    fn mistakes(&self) -> Option<String> {
        if self.arcs == Arcs::IjkAbsolute && self.language != Language::Linuxcnc {
            return Some(format!("{} has no absolute arc centres", self.language.title()));
        }
        if self.change_at.is_some() && self.language != Language::Linuxcnc {
            return Some("a place for tool changes can be chosen for LinuxCNC only".into());
        }
        if self.control_compensates && self.language != Language::Linuxcnc {
            return Some("how a control enters a compensated contour is known of LinuxCNC only".into());
        }
        if self.control_compensates && self.arcs == Arcs::Lines {
            return Some("an arc in straight pieces is no contour to compensate".into());
        }
        if !(self.arc_tolerance > 0.0) {
            return Some("the arc tolerance must be above zero".into());
        }
        None
    }
}

/// A written program.
#[derive(Clone, PartialEq, Debug)]
pub struct Emitted {
    /// Its text.
    pub text: String,
    /// Line of the main source file that each line comes from, from 0; `u32::MAX` = none.
    pub lines: Vec<u32>,
    /// Hints and warnings.
    pub notes: Vec<Diagnostic>,
}

