//! From a source file to motion: read, run and check, in one go where nothing is wrong.

use std::path::{Path, PathBuf};

use gr_canon::Sink;
use gr_driver::{Loaded, Options, Rules};
use gr_interp::Setup;
use gr_ir::Program;
use gr_spec::Family;
use gr_text::{Diagnostic, Encoding, FileId, Severity, Text, code};

use crate::commands::check::{Checked, byte_order_mark, unreadable};
use crate::exchange::Plan;
use crate::setup::{Levels, Station, is_for_a_printer};
use crate::sources::{Sources, read_program};

/// A source file.
pub struct Unit {
    /// As the user named it.
    pub path: PathBuf,
    /// Its text.
    pub text: Text,
    /// How it was spelled.
    pub encoding: Encoding,
    /// A finding about its byte order mark.
    pub mark: Option<Diagnostic>,
    /// What it is run with.
    pub setup: Setup,
    /// How severe lints are.
    pub lints: Levels,
    /// A STEP-NC file.
    pub exchange: bool,
    /// How its technology is read; none: as the standard says.
    pub step_units: Option<gr_planner::Units>,
    /// How its overlaps are read; none: as its units say.
    pub step_overlap: Option<gr_planner::Overlap>,
    /// Raw part, if the project states one: smallest and largest X Y Z, mm.
    pub stock: Option<[[f64; 3]; 2]>,
    /// Name of the machine's tool table; none: every tool exists.
    pub tools: Option<String>,
    /// Greatest axial depth of cut that the machine stands, mm.
    pub axial_depth: Option<f64>,
}

impl Unit {
    /// A text, as the options and the project want it run.
    pub fn new(path: &Path, text: Text, encoding: Encoding, station: &Station) -> Unit {
        Unit {
            setup: station.setup_for(path, &text),
            mark: byte_order_mark(encoding, path, &text, station),
            exchange: crate::exchange::is_exchange(path, &text),
            path: path.to_path_buf(),
            text,
            encoding,
            lints: station.lints.clone(),
            step_units: station.step_units,
            step_overlap: station.step_overlap,
            stock: station.stock,
            tools: station.tools.as_ref().map(|p| p.display().to_string()),
            axial_depth: station.machine.as_ref().and_then(|m| m.cell.axial_depth),
        }
    }
    /// Millimetres per unit of the machine's tool table.
    pub fn unit_mm(&self) -> f64 {
        if self.setup.machine_units == gr_canon::Units::Inch { 25.4 } else { 1.0 }
    }
    /// Its name in messages.
    pub fn name(&self) -> String {
        self.path.display().to_string()
    }
    fn options(&self) -> Options {
        let mut options = Options::new(self.setup.clone());
        self.lints.put_into(&mut options.rules);
        options
    }
    fn rules(&self) -> Rules {
        self.options().rules
    }
    /// With what is to be said of the bytes that the text was read from.
    fn told(&self, checked: Checked) -> Checked {
        match self.mark.clone() {
            Some(mark) => checked.headed_by(mark, &self.name(), &self.text),
            None => checked,
        }
    }
    /// Everything that is to be said about it. `Err` when there are errors.
    fn check(&self) -> Result<Checked, Checked> {
        let checked = self.told(Checked::of(&self.name(), &self.text, self.options(), &self.lints));
        let bad = checked.more.errors > 0 || checked.found.iter().any(|d| d.severity == Severity::Error);
        if bad { Err(checked) } else { Ok(checked) }
    }
}

/// Reads a file.
pub fn load(path: &Path, station: &Station) -> Result<Unit, Checked> {
    let name = path.display().to_string();
    let decoded = read_program(path).map_err(|(code, args)| unreadable(&name, code, &args))?;
    let unit = Unit::new(path, decoded.text.into(), decoded.encoding, station);
    if !unit.exchange && station.undeclared(path, &unit.text) {
        let why = if is_for_a_printer(&unit.text) { ": it looks like a program for a 3D printer" } else { "" };
        let mut checked = unreadable(&name, code::FILE_UNKNOWN_CONTROL, &[name.clone(), why.to_string()]);
        checked.unreadable = false;
        return Err(checked);
    }
    if unit.mark.as_ref().is_some_and(|d| d.severity == Severity::Error) {
        return Err(unit.told(Checked::nothing()));
    }
    Ok(unit)
}

/// Runs a program into a sink as `rs274` does, which knows no startup code, and checks it. `Err` holds the findings when there are errors; otherwise they are
/// warnings.
pub fn run<S: Sink>(unit: &Unit, sink: S) -> Result<(S, Loaded, Checked), Checked> {
    let setup = Setup { startup_code: false, ..unit.setup.clone() };
    let streamed = gr_driver::stream(&unit.name(), unit.text.clone(), &setup, Some(&unit.rules()), sink);
    let sought = || streamed.files.subs().chain(streamed.files.missing()).cloned().collect();
    let checked = if streamed.clean { unit.told(Checked::nothing()) } else { unit.check().map_err(|c| Checked { sought: sought(), ..c })? };
    Ok((streamed.sink, streamed.files, checked))
}

/// Motion of a program, and the texts that it comes from.
pub struct Motion {
    /// The motion.
    pub program: Program,
    /// Files under the numbers that the motion uses.
    pub sources: Sources,
    /// Files pulled in.
    pub subs: Vec<PathBuf>,
    /// Files that were looked for and are not there.
    pub missing: Vec<PathBuf>,
    /// What else was found.
    pub found: Vec<Diagnostic>,
    /// The process plan that it comes from; none for G-code.
    pub plan: Option<Plan>,
    /// Setups of the job file.
    pub setups: Vec<gr_robot::Setup>,
    /// U V W of the text are increments of X Y Z: a lathe's.
    pub increments: bool,
    /// H and D of the text hold: a Fanuc mill's.
    pub offset_numbers: bool,
    /// There is no tool table.
    pub no_tool_table: bool,
    /// Where it begins instead of at its beginning.
    pub begun: Option<Begun>,
}

/// How a program was made to begin later.
#[derive(Clone, Copy)]
pub struct Begun {
    /// Line, from 1.
    pub line: u32,
    /// As in [`gr_backends::from_line::Options`].
    pub unsure: [bool; 9],
    /// How high and how far out the approach goes.
    pub room: gr_backends::from_line::Room,
}

/// Runs, lowers and checks a program.
pub fn motion(unit: &Unit, machine: Option<&gr_machine::Machine>) -> Result<(Motion, Checked), Checked> {
    if unit.exchange {
        return crate::exchange::motion(unit);
    }
    if unit.setup.dialect.family == Family::Ufmg2008 {
        let checked = unit.check()?;
        return Ok((ufmg(&unit.name(), &unit.text, unit.setup.dialect, machine), checked));
    }
    let motion = gr_driver::lower(&unit.name(), unit.text.clone(), &unit.setup, Some(&unit.rules()));
    let sought = || motion.subs.iter().chain(&motion.missing).cloned().collect();
    let checked = if motion.clean { unit.told(Checked::nothing()) } else { unit.check().map_err(|c| Checked { sought: sought(), ..c })? };
    Ok((Motion { no_tool_table: gr_interp::assumed(&unit.setup.tools), ..worded(plain(motion), &unit.setup) }, checked))
}

/// Motion of a program on another machine, unchecked.
pub fn motion_with(unit: &Unit, setup: &Setup) -> Motion {
    if setup.dialect.family == Family::Ufmg2008 {
        return ufmg(&unit.name(), &unit.text, setup.dialect, None);
    }
    worded(plain(gr_driver::lower(&unit.name(), unit.text.clone(), setup, None)), setup)
}

/// The same, with what words of the text mean that LinuxCNC reads otherwise.
fn worded(motion: Motion, setup: &Setup) -> Motion {
    Motion { increments: setup.dialect.id == "fanuc-turn", offset_numbers: setup.dialect.id == "fanuc-mill", ..motion }
}

/// Motion of a text of our own making.
pub fn motion_of(name: &str, text: String, setup: &Setup) -> Motion {
    Motion { no_tool_table: gr_interp::assumed(&setup.tools), ..plain(gr_driver::lower(name, text.into(), setup, None)) }
}

fn plain(motion: gr_driver::Motion) -> Motion {
    let mut sources = Sources::default();
    for (name, text) in motion.texts {
        sources.add(name, text);
    }
    Motion { program: motion.program, sources, subs: motion.subs, missing: motion.missing, found: Vec::new(), plan: None, setups: Vec::new(), increments: false, offset_numbers: false, no_tool_table: false, begun: None }
}

/// Motion of a program for a machine, in whatever language it is.
pub fn motion_for(name: &str, text: &str, setup: &Setup, machine: &gr_machine::Machine) -> Motion {
    if setup.dialect.family == Family::Ufmg2008 {
        return ufmg(name, text, setup.dialect, Some(machine));
    }
    worded(motion_of(name, text.to_string(), setup), setup)
}

/// The UFMG 2008 language has commands of its own and no interpreter state.
fn ufmg(name: &str, text: &str, dialect: &'static gr_spec::Dialect, machine: Option<&gr_machine::Machine>) -> Motion {
    let text: Text = text.into();
    let file = gr_driver::scan_file(name, &text, dialect);
    let (commands, mut found) = gr_backends::joint::language::read(FileId(0), &file);
    let builtin = gr_machine::builtin("ufmg/plano-3r").expect("the library has it");
    let (program, more) = gr_backends::joint::ufmg::lower(FileId(0), name, &commands, machine.unwrap_or(&builtin));
    found.extend(more);
    let mut sources = Sources::default();
    sources.add(name, text);
    Motion { program, sources, subs: Vec::new(), missing: Vec::new(), found, plan: None, setups: Vec::new(), increments: false, offset_numbers: false, no_tool_table: false, begun: None }
}
