//! Exit codes of the command (docs/cli.md).

use gr_text::{Code, code};

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

impl Exit {
    /// How a run ends because of a finding. `said`: on the command line, rather than in a file.
    pub fn of(code: Code, said: bool) -> Exit {
        match code {
            code::FILE_MISSING | code::FILE_UNREADABLE | code::FILE_DIRECTORY | code::FILE_TOO_BIG => Exit::Io,
            code::PROJECT_UNKNOWN_DIALECT | code::PROJECT_UNKNOWN_MACHINE | code::PROJECT_UNKNOWN_LINT | code::PROJECT_LINT_LEVEL | code::ACCURACY_BAD_OPTION if said => Exit::Usage,
            _ => Exit::Findings,
        }
    }
}

impl From<Exit> for std::process::ExitCode {
    fn from(e: Exit) -> Self {
        std::process::ExitCode::from(e as u8)
    }
}
