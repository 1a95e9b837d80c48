//! Robot programs in the languages of their makers. One file per language, each implementing [`Language`]; the
//! readers in `read` turn emitted text back into motion and share nothing with the emitters.

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
}

/// What the user chose.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Options {
    /// Decimals of positions; none = what the language is used to.
    pub decimals: Option<usize>,
    /// Accept forms whose meaning on the controller is not confirmed.
    pub allow_unverified: bool,
}

/// What came of it: files in the order they are to be put in place, the index file last, and findings.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Output {
    /// Files.
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
