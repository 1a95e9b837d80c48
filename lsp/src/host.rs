//! What the server asks of the command it is part of: project files, machines, plans and targets. One way to read
//! them, shared with `gcc-robot build`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gr_driver::{Level, Options};
use gr_interp::Setup;
use gr_spec::{Code, Dialect};
use gr_text::{Diagnostic, Severity};

pub use gr_ide::p21::Units as StepUnits;

use crate::settings::Settings;

/// The dialect of a file, by its name and text.
pub type DialectOf = Arc<dyn Fn(&Path, &str) -> &'static Dialect + Send + Sync>;

/// What programs below a folder are run with.
#[derive(Clone)]
pub struct Station {
    /// Tools, parameters, INI file; the dialect depends on the file.
    pub setup: Setup,
    /// Warnings count as errors.
    pub strict: bool,
    /// Lints that are not mentioned, mentioned although off by default, errors.
    pub allow: Vec<Code>,
    #[allow(missing_docs, reason = "see allow")]
    pub warn: Vec<Code>,
    #[allow(missing_docs, reason = "see allow")]
    pub deny: Vec<Code>,
    /// The dialect of a file, by its name and text.
    pub dialect_of: DialectOf,
    /// Machine.
    pub machine: Option<Arc<gr_machine::Machine>>,
    /// Units of STEP-NC files; none = by the program that wrote them.
    pub step_units: Option<StepUnits>,
    /// Raw part of programs that state none: smallest and largest X Y Z, mm.
    pub stock: Option<[[f64; 3]; 2]>,
    /// Files it was made of: when they change it is made anew.
    pub files: Vec<PathBuf>,
    /// What is wrong with those files: the file, its text, the finding.
    pub found: Vec<(PathBuf, String, Diagnostic)>,
    /// What is wrong with what the settings name: no file says it.
    pub said: Vec<String>,
    /// The command's own.
    pub own: Option<Arc<dyn std::any::Any + Send + Sync>>,
}

impl Default for Station {
    fn default() -> Station {
        Station {
            setup: Setup::default(),
            strict: false,
            allow: Vec::new(),
            warn: Vec::new(),
            deny: Vec::new(),
            dialect_of: Arc::new(|_, _| Dialect::linuxcnc()),
            machine: None,
            step_units: None,
            stock: None,
            files: Vec::new(),
            found: Vec::new(),
            said: Vec::new(),
            own: None,
        }
    }
}

impl Station {
    /// Options of a run.
    pub fn options(&self, dialect: &'static Dialect) -> Options {
        let mut options = Options::new(self.setup_for(dialect));
        self.warn.iter().for_each(|c| options.rules.set(*c, Level::Warning));
        self.deny.iter().for_each(|c| options.rules.set(*c, Level::Error));
        self.allow.iter().for_each(|c| options.rules.set(*c, Level::Off));
        options
    }
    /// The setup of a file in this dialect.
    pub fn setup_for(&self, dialect: &'static Dialect) -> Setup {
        let mut setup = self.setup.clone();
        setup.dialect = dialect;
        setup.version = if dialect.id == "linuxcnc-2.10" { gr_canon::Version::V2_10 } else { gr_canon::Version::V2_9 };
        setup
    }
    /// A finding as options and project want it; none = not mentioned.
    pub fn harden(&self, mut d: Diagnostic) -> Option<Diagnostic> {
        if d.code.def().lint {
            if self.allow.contains(&d.code) {
                return None;
            }
            if self.deny.contains(&d.code) {
                d.severity = Severity::Error;
            } else if self.warn.contains(&d.code) && d.severity == Severity::Hint {
                d.severity = Severity::Warning;
            }
        }
        if self.strict && d.severity == Severity::Warning {
            d.severity = Severity::Error;
        }
        Some(d)
    }
}

/// A target to be made.
pub struct OutputJob<'a> {
    /// Path of the program.
    pub path: &'a Path,
    /// Its text.
    pub text: gr_text::Text,
    /// Settings of the client.
    pub settings: &'a Settings,
    /// What it is run with.
    pub station: &'a Station,
    /// Target id.
    pub target: &'a str,
    /// Options of `gcc-robot build`: name and value, without dashes.
    pub options: Vec<(String, String)>,
    /// Machine; none = as configured.
    pub machine: Option<&'a str>,
}

/// One file of an output.
pub struct MadeFile {
    /// Suggested name.
    pub name: String,
    /// Contents.
    pub bytes: Vec<u8>,
    /// Source line of each line of text, from 0; `u32::MAX` = none.
    pub lines: Vec<u32>,
}

/// An output: files, and what was found on the way (places are in the program).
pub struct Made {
    /// Files; none when there are errors.
    pub files: Vec<MadeFile>,
    /// Findings.
    pub found: Vec<Diagnostic>,
}

/// See the module.
pub trait Host: Send + Sync {
    /// What a program is run with.
    fn station(&self, path: &Path, settings: &Settings) -> Station;
    /// Findings in a `gcc-robot.toml`.
    fn check_project(&self, path: &Path, text: &str) -> Vec<Diagnostic>;
    /// Everything that is to be said about a STEP-NC file.
    fn check_exchange(&self, path: &Path, text: &str, station: &Station) -> Vec<Diagnostic>;
    /// The motion of a STEP-NC file, and its raw part's box in mm.
    fn plan(&self, path: &Path, text: &str, station: &Station) -> Option<Plan>;
    /// Whether the speeds of a STEP-NC file contradict each other in the units of the standard, so that a build asks which
    /// units are meant.
    fn units_are_open(&self, _text: &str) -> bool {
        false
    }
    /// Whether nobody says what control a `.gcode` file is for.
    fn undeclared(&self, path: &Path, text: &str, settings: &Settings) -> bool;
    /// Makes a target. `Err`: the request can't be met.
    fn output(&self, job: &OutputJob<'_>) -> Result<Made, String>;
}

/// A planned STEP-NC file.
pub struct Plan {
    /// Motion.
    pub program: gr_ir::Program,
    /// Raw part: smallest and largest X Y Z, mm.
    pub stock: Option<[[f64; 3]; 2]>,
    /// Its tools.
    pub tools: Vec<gr_backends::sheet::ToolRow>,
}

/// No project files, machines or targets: for tests of the server alone.
pub struct Plain;

impl Host for Plain {
    fn station(&self, _: &Path, settings: &Settings) -> Station {
        let dialect = settings.dialect.as_deref().and_then(Dialect::find);
        let dialect_of: DialectOf = Arc::new(move |path, _| {
            let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
            let by_extension = || Dialect::all().iter().find(|d| d.extensions.contains(&extension.as_str()));
            dialect.or_else(by_extension).unwrap_or_else(Dialect::linuxcnc)
        });
        let mut station = Station { dialect_of, ..Station::default() };
        station.setup.tools = gr_interp::assumed_tools();
        station.setup.block_delete = settings.block_delete;
        station
    }
    fn check_project(&self, _: &Path, _: &str) -> Vec<Diagnostic> {
        Vec::new()
    }
    fn check_exchange(&self, _: &Path, text: &str, _: &Station) -> Vec<Diagnostic> {
        gr_step::diagnostics(text, gr_text::FileId(0))
    }
    fn plan(&self, _: &Path, _: &str, _: &Station) -> Option<Plan> {
        None
    }
    fn undeclared(&self, _: &Path, _: &str, _: &Settings) -> bool {
        false
    }
    fn output(&self, _: &OutputJob<'_>) -> Result<Made, String> {
        Err("this server makes no targets".into())
    }
}
