//! STEP-NC files: which they are, what there is to say about one, and their way to motion: by the planner, or by
//! one of the published systems that it repeats.

use std::path::{Path, PathBuf};

use gr_interp::{ToolTable, read_tools};
use gr_planner::reference::{ufsc2016, unb2013};
use gr_planner::{Loaded, Process, Tool, Units, table};
use gr_text::{Diagnostic, FileId, LineIndex, Severity, Text, code};

use crate::commands::check::Checked;
use crate::pipeline::{Motion, Unit};
use crate::setup::{Levels, Station};
use crate::sources::{Sources, read};
use crate::tools;

/// The only file of a run.
const FILE: FileId = FileId(0);
/// Endings of exchange files.
pub const EXTENSIONS: [&str; 4] = ["p21", "stpnc", "stp", "step"];

/// Whether a file is an exchange file: it says so in its first line, or has one of its endings.
pub fn is_exchange(path: &Path, text: &str) -> bool {
    let start = text.trim_start_matches(|c: char| c <= ' ' || c == '\u{FEFF}');
    let dense: String = start.chars().filter(|c| *c > ' ').take(12).collect();
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    dense.eq_ignore_ascii_case("ISO-10303-21") || EXTENSIONS.iter().any(|e| e.eq_ignore_ascii_case(ending))
}

/// Bytes of a file in which its schema is looked for.
const HEADER: usize = 8192;

/// Whether a file found in a folder is a STEP-NC program. `.stp` and `.step` are mostly shapes from CAD.
pub fn is_program(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match ending.as_str() {
        "p21" | "stpnc" => true,
        "stp" | "step" => {
            use std::io::Read as _;
            let mut head = Vec::new();
            let opened = std::fs::File::open(path).and_then(|f| f.take(HEADER as u64).read_to_end(&mut head));
            let text = String::from_utf8_lossy(&head);
            let schemas = ["MACHINING_SCHEMA", "MILLING_SCHEMA", "TURNING_SCHEMA", "COMBINED_SCHEMA", "INTEGRATED_CNC_SCHEMA"];
            opened.is_ok() && text.trim_start().starts_with("ISO-10303-21") && schemas.iter().any(|s| text.contains(s))
        }
        _ => false,
    }
}

/// What a file says, as far as commands show it.
pub struct Plan {
    /// Tools, under their numbers in the program.
    pub tools: Vec<Tool>,
    /// The numbers are the program's own: a tool table goes with it.
    pub own_table: bool,
    /// Lowest and highest corner of the raw part in the first setup, mm, where the file says it.
    pub stock: Option<[[f64; 3]; 2]>,
}

/// What is wrong with a text that is no exchange file at all, whatever its name says.
pub fn not_one(text: &str) -> Option<Diagnostic> {
    let faults = gr_p21::check_syntax(text.as_bytes());
    let fault = faults.into_iter().find(|f| f.code == code::P21_NOT_AN_EXCHANGE_FILE)?;
    Some(Diagnostic::new(fault.code, FILE, fault.span, &fault.args))
}

/// Everything there is to say about a file.
pub fn check(name: &str, text: &Text, path: &Path, station: &Station) -> Checked {
    let unit = Unit::new(path, text.into(), gr_text::Encoding::Utf8, station);
    let (_, found) = plan(&unit);
    with_source(name, &unit, found)
}

/// The same with what the machine has to say, where the file itself is good.
pub fn check_on(machine: &gr_machine::Machine, name: &str, text: &Text, path: &Path, station: &Station) -> Checked {
    let unit = Unit::new(path, text.into(), gr_text::Encoding::Utf8, station);
    match motion(&unit) {
        Ok((motion, checked)) => {
            let mut checked = with_source(name, &unit, checked.found);
            crate::robot::ask(motion, machine, station.job.as_deref(), &mut checked);
            checked
        }
        Err(checked) => with_source(name, &unit, checked.found),
    }
}

fn with_source(name: &str, unit: &Unit, found: Vec<Diagnostic>) -> Checked {
    let mut sources = Sources::default();
    sources.add(name, unit.text.clone());
    Checked { sources, found, ..Checked::nothing() }
}

/// Lints as options and project want them.
fn kept(d: &mut Diagnostic, levels: &Levels) -> bool {
    if d.code.def().lint {
        if levels.allow.contains(&d.code) {
            return false;
        }
        if levels.deny.contains(&d.code) {
            d.severity = Severity::Error;
        } else if levels.warn.contains(&d.code) && d.severity == Severity::Hint {
            d.severity = Severity::Warning;
        }
    }
    levels.harden(d);
    true
}

fn bad(found: &[Diagnostic]) -> bool {
    found.iter().any(|d| d.severity == Severity::Error)
}

/// Adds what a later stage found, unless an earlier one said it already.
fn add(found: &mut Vec<Diagnostic>, more: Vec<Diagnostic>, levels: &Levels) {
    let orphans = found.iter().any(|d| d.code == code::STEP_ORPHAN_WORKINGSTEP);
    // The planner's words on a spindle's sign say what is done about it; those of the lint hold where it is an error.
    let sign = |d: &Diagnostic, of: gr_text::Code, all: &[Diagnostic]| all.iter().any(|o| o.code == of && o.primary() == d.primary());
    let (errors, rest) = std::mem::take(found).into_iter().partition::<Vec<_>, _>(|d| d.severity == Severity::Error);
    let more: Vec<Diagnostic> =
        more.into_iter().filter(|d| !(d.code == code::PLAN_SPINDLE_SIGN && sign(d, code::STEP_SPINDLE_SIGN, &errors))).collect();
    // A broken rule of geometry that the planner cannot do without is its error.
    let geometry = |d: &Diagnostic| d.code == code::STEP_RESOURCE_RULE && sign(d, code::PLAN_BAD_SIZE, &more);
    let kept_back = |d: &Diagnostic| d.code == code::STEP_SPINDLE_SIGN && sign(d, code::PLAN_SPINDLE_SIGN, &more) || geometry(d);
    found.extend(rest.into_iter().filter(|d| !kept_back(d)));
    found.extend(errors);
    found.extend(more.into_iter().filter(|d| !(orphans && d.code == code::PLAN_ORPHAN_STEP)));
    found.retain_mut(|d| kept(d, levels));
    // Where statements are damaged, what they refer to only seems to be left over.
    let damaged = found.iter().any(|d| d.severity == Severity::Error && d.code.def().slug.starts_with("p21/"));
    found.retain(|d| !(damaged && d.code == code::STEP_UNREFERENCED));
    // The more severe of two of a kind at one place comes first, and stays.
    let place = |d: &Diagnostic| (d.primary().1.start, d.primary().1.end);
    found.sort_by(|a, b| place(a).cmp(&place(b)).then_with(|| a.message.cmp(&b.message)).then(a.severity.cmp(&b.severity)));
    found.dedup_by(|b, a| a.code == b.code && a.message == b.message && a.primary() == b.primary());
}

/// What syntax, schema, rules and lints say, but for what the options have settled.
fn told(unit: &Unit) -> Vec<Diagnostic> {
    let mut found = gr_step::diagnostics(&unit.text, FILE);
    let modeler = unit.step_units == Some(Units::StepModeler);
    // What a number is in the standard's unit is of no interest when the project says that it is in another.
    let of_units = [code::STEP_FEED_UNIT, code::STEP_SPINDLE_UNIT, code::STEP_CUTSPEED_UNIT, code::STEP_NEGATIVE_SPINDLE];
    found.retain(|d| match d.code {
        code::STEP_OVERLAP => unit.step_overlap.is_none() && !modeler,
        other => !(modeler && of_units.contains(&other)),
    });
    found
}

/// Syntax, schema, rules and lints; the plan follows only where there are no errors.
fn syntax(unit: &Unit) -> Vec<Diagnostic> {
    let mut all = Vec::new();
    add(&mut all, told(unit), &unit.lints);
    all
}

type Read = (Option<Process>, Vec<Tool>, Vec<Diagnostic>);

/// A process with what was found; none where there is an error.
fn checked(unit: &Unit, mut found: Vec<Diagnostic>, (process, tools, more): Read) -> Result<(Process, Vec<Tool>, Checked), Checked> {
    if !bad(&found) {
        add(&mut found, more, &unit.lints);
    }
    let process = process.filter(|_| !bad(&found));
    let checked = with_source(&unit.name(), unit, found);
    match process {
        Some(process) => Ok((process, tools, checked)),
        None => Err(checked),
    }
}

/// A file that is only listed, or read as a published system read it: where its units are left open they are taken as
/// STEP Modeler's, with a warning.
fn leniently(unit: &Unit) -> Result<(Process, Vec<Tool>, Checked), Checked> {
    let text = unit.text.as_bytes();
    let mut found = told(unit);
    let mut read = gr_planner::process(text, FILE, unit.step_units);
    if let Some(open) = read.2.iter().find(|d| d.code == code::PLAN_UNITS_OPEN).cloned() {
        found.push(open);
        read = gr_planner::process(text, FILE, Some(Units::StepModeler));
    }
    for d in found.iter_mut().filter(|d| d.code == code::PLAN_UNITS_OPEN) {
        d.severity = Severity::Warning;
    }
    let mut all = Vec::new();
    add(&mut all, found, &unit.lints);
    checked(unit, all, read)
}

/// What the control calls the tools of a file.
fn loaded(unit: &Unit, tools: &[Tool]) -> (Vec<Loaded>, Vec<Diagnostic>) {
    match &unit.tools {
        Some(name) => {
            let table = tools::Table { name: name.clone(), rows: &unit.setup.tools, unit: unit.unit_mm() };
            tools::assign(tools, &table, FILE)
        }
        None => (tools::own_numbers(tools), Vec::new()),
    }
}

/// Plans a file. Without a plan there is an error among the findings.
fn plan(unit: &Unit) -> (Option<gr_planner::Planned>, Vec<Diagnostic>) {
    let mut found = syntax(unit);
    if bad(&found) {
        return (None, found);
    }
    let text = unit.text.as_bytes();
    let (_, tools, _) = gr_planner::process(text, FILE, unit.step_units);
    let (loaded, missing) = loaded(unit, &tools);
    let options = gr_planner::Options { units: unit.step_units, overlap: unit.step_overlap, name: unit.name(), tools: loaded, axial_depth: unit.axial_depth, ..Default::default() };
    let (planned, more) = gr_planner::plan(text, FILE, &options);
    add(&mut found, more, &unit.lints);
    add(&mut found, missing, &unit.lints);
    (planned.filter(|_| !bad(&found)), found)
}

/// Motion of a file by the default planner.
pub fn motion(unit: &Unit) -> Result<(Motion, Checked), Checked> {
    let (planned, found) = plan(unit);
    let checked = with_source(&unit.name(), unit, found);
    match planned {
        Some(p) => {
            let stock = p.process.steps().iter().find_map(|s| s.stock);
            let plan = Plan { tools: p.tools, own_table: unit.tools.is_none(), stock };
            Ok((moving(unit, p.program, plan), checked))
        }
        None => Err(checked),
    }
}

fn moving(unit: &Unit, program: gr_ir::Program, plan: Plan) -> Motion {
    let mut sources = Sources::default();
    sources.add(unit.name(), unit.text.clone());
    Motion { program, sources, subs: Vec::new(), missing: Vec::new(), found: Vec::new(), plan: Some(plan), setups: Vec::new(), increments: false, offset_numbers: false, no_tool_table: false, begun: None }
}

/// The process of a file, with errors of reading it only.
pub fn process(unit: &Unit) -> Result<(Process, Vec<Tool>, Checked), Checked> {
    let found = syntax(unit);
    let read = if bad(&found) { Read::default() } else { gr_planner::process(unit.text.as_bytes(), FILE, unit.step_units) };
    checked(unit, found, read)
}

/// The table of workingsteps, as text or JSON.
pub fn list(unit: &Unit, json: bool) -> Result<(String, Checked), Checked> {
    let (process, tools, checked) = leniently(unit)?;
    let text = if json { table::json(&process, &tools) } else { table::text(&process, &tools) };
    Ok((text, checked))
}

/// What the system of Brasília 2013 makes of a file: G-code with its tool table.
pub struct Converted {
    /// The program.
    pub program: String,
    /// Its tool table, mm.
    pub table: String,
    /// The settings file that was read.
    pub files: Vec<PathBuf>,
}

/// Converts as the system of Brasília 2013 did, with its settings file if there is one.
pub fn unb2013(unit: &Unit, settings: Option<&Path>) -> Result<(Converted, Checked), Checked> {
    let (process, _, mut checked) = leniently(unit)?;
    let mut config = unb2013::Config::default();
    if let Some(path) = settings {
        let name = path.display().to_string();
        let text = read(path).map_err(|(code, args)| crate::commands::check::unreadable(&name, code, &args))?.text;
        let file = checked.sources.add(name, text.clone());
        let (read, faults) = unb2013::config(&text, file);
        config = read;
        checked.found.extend(faults);
    }
    if bad(&checked.found) {
        return Err(checked);
    }
    match unb2013::convert(&process, &config, FILE, &unit.name()) {
        Ok(out) => {
            let files = settings.map(Path::to_path_buf).into_iter().collect();
            Ok((Converted { program: out.program, table: out.table, files }, checked))
        }
        Err(faults) => {
            for fault in faults {
                if !checked.found.contains(&fault) {
                    checked.found.push(fault);
                }
            }
            Err(checked)
        }
    }
}

/// Motion as the system of Florianópolis 2016 made it: its points, one move each.
pub fn ufsc2016(unit: &Unit) -> Result<(Motion, Checked), Checked> {
    let (process, tools, mut checked) = leniently(unit)?;
    match ufsc2016::points(&process, FILE) {
        Ok(points) => {
            let lines = LineIndex::new(unit.text.as_bytes());
            let program = ufsc2016::program(&points, &process, &lines, FILE, &unit.name());
            Ok((moving(unit, program, Plan { tools, own_table: true, stock: None }), checked))
        }
        Err(faults) => {
            checked.found.extend(faults);
            Err(checked)
        }
    }
}

/// A tool table of our own making, as the interpreter reads it.
pub fn tool_table(text: &str) -> ToolTable {
    read_tools(text, FileId(1)).0
}
