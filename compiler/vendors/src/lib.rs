//! Robot programs in the languages of their makers. One file per language, each implementing [`Language`]; the
//! readers in [`read`] turn emitted text back into motion and share nothing with the emitters.
//!
//! | module | job |
//! |---|---|
//! | `walk` | one walk over a robot program for all languages: what is next, findings |
//! | `orient` | how makers write a turn, as mathematics |
//! | `posture` | how an arm stands, by geometry |
//! | `name`, `number` | names and numbers as text |
//! | `probe` | what the operator reads at a probe move |
//! | `marks` | which step of the program a line is written for |
//! | `parts` | programs cut to what a controller takes |
//! | one file per language | its text |

mod delmia;
mod denso;
mod fanuc;
mod inform;
mod kawasaki;
mod krl;
mod marks;
mod melfa;
mod nachi;
mod name;
mod number;
mod orient;
mod parts;
mod pdl2;
mod plain;
mod posture;
mod probe;
mod rapid;
pub mod read;
mod spel;
mod urscript;
mod val3;
mod vplus;
mod walk;

use gr_ir::Sources;
use gr_robot::RobotProgram;
use gr_text::Diagnostic;

/// A file of the result.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct OutputFile {
    /// Name without a folder, or with the folder the language asks for.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
    /// The step of the program (index into its steps) that each line is written for; none for lines of the file's own.
    pub steps: Vec<Option<u32>>,
}

impl OutputFile {
    /// `text` has its lines marked: see `marks`.
    fn new(name: String, text: String) -> OutputFile {
        let (text, steps) = marks::taken(&text);
        OutputFile { name, bytes: text.into_bytes(), steps }
    }
}

/// Decimals that positions may have.
pub const DECIMALS: std::ops::RangeInclusive<usize> = 3..=6;

/// What the user chose.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Options {
    /// Decimals of positions, one of [`DECIMALS`]; none = what the language is used to.
    pub decimals: Option<usize>,
    /// Accept forms whose meaning on the controller is not confirmed.
    pub allow_unverified: bool,
}

/// What came of it: files in the order they are to be put in place, the index file last, and findings.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Output {
    /// Files; none when a finding is an error.
    pub files: Vec<OutputFile>,
    /// Findings; with an error among them nothing may be written.
    pub findings: Vec<Diagnostic>,
}

/// A robot language.
pub trait Language: Sync {
    /// Its name as `--target` takes it.
    fn id(&self) -> &'static str;
    /// Writes a program; `sources` gives places for findings and source lines for comments.
    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output;
}

/// All languages, in the order of the table of targets.
pub fn languages() -> &'static [&'static dyn Language] {
    &[
        &rapid::Rapid,
        &krl::Krl,
        &fanuc::Fanuc,
        &urscript::UrScript,
        &inform::Inform,
        &val3::Val3,
        &delmia::Delmia,
        &vplus::VPlus,
        &kawasaki::Kawasaki,
        &pdl2::Pdl2,
        &denso::Denso,
        &melfa::Melfa,
        &spel::Spel,
        &nachi::Nachi,
    ]
}

/// The language of a target.
pub fn language(id: &str) -> Option<&'static dyn Language> {
    languages().iter().copied().find(|l| l.id() == id)
}
