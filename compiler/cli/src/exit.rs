//! Exit codes of the command (docs/cli.md).

/// How a run of the command ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug, PartialOrd, Ord)]
pub enum Exit {
    /// Done.
    Ok = 0,
    /// Errors in programs or project; `diff` and `verify`: they differ; `fmt --check`: not formatted.
    Findings = 1,
    /// Wrong use of the command line.
    Usage = 2,
    /// A file could not be read or written.
    Io = 3,
}

impl From<Exit> for std::process::ExitCode {
    fn from(e: Exit) -> Self {
        std::process::ExitCode::from(e as u8)
    }
}
