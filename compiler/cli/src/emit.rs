//! Targets: motion and canonical calls become files.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use gr_backends::plot::trace::{Trace, TraceOptions};
use gr_backends::from_line::Restart;
use gr_backends::rs274ngc;
use gr_backends::{Texts, joint};
use gr_canon::{Printer, Units};
use gr_ir::{Pose, Program, Source, State};
use gr_machine::Machine;
use gr_planner::Tool;
use gr_robot::along::is_planned;
use gr_text::{Diagnostic, FileId, code};

use crate::options::UnitArg;
use crate::commands::check::Checked;
use crate::elsewhere;
use crate::output::Pending;
use crate::pipeline::{Begun, Motion, Unit, motion, run};
use crate::sources::Sources;

/// Options of targets; `gcc-robot target show` says which target heeds which.
#[derive(Args, Debug, Clone, Default)]
#[command(next_help_heading = "Options of targets")]
pub struct TargetOptions {
    /// rs274ngc: language that is written: linuxcnc, fanuc-mill or grbl
    #[arg(long, value_name = "DIALECT")]
    pub to: Option<String>,
    /// rs274ngc: length unit that is written
    #[arg(long, value_enum, value_name = "UNIT")]
    pub units: Option<UnitArg>,
    /// Decimals of written numbers
    #[arg(long, value_name = "N", value_parser = crate::options::up_to::<15>)]
    pub decimals: Option<usize>,
    /// rs274ngc: how arcs are written
    #[arg(long, value_enum, value_name = "FORM")]
    pub arcs: Option<ArcsArg>,
    /// rs274ngc: planes that arcs may lie in; others become straight pieces
    #[arg(long, value_enum, value_name = "PLANES")]
    pub plane: Option<PlaneArg>,
    /// Greatest distance of straight pieces from a curve, mm
    #[arg(long, value_name = "MM")]
    pub arc_tolerance: Option<f64>,
    /// rs274ngc: number lines: first number and step
    #[arg(long, value_name = "FIRST[,STEP]", num_args = 0..=1, default_missing_value = "10,10", require_equals = true)]
    pub line_numbers: Option<String>,
    /// rs274ngc: write words that have not changed too
    #[arg(long)]
    pub repeat_words: bool,
    /// rs274ngc: leave out comments
    #[arg(long)]
    pub no_comments: bool,
    /// rs274ngc: write holes as canned cycles (G73, G74, G81 to G86, G89) where they do exactly the same
    #[arg(long)]
    pub cycles: bool,
    /// rs274ngc: who keeps the tool beside a wall that a plan finishes: the path, or the control (G41, G42 with D)
    /// [default: path]
    #[arg(long, value_enum, value_name = "BY")]
    pub cutter_compensation: Option<CompensationArg>,
    /// rs274ngc: where tools are changed [default: above the part, where the program has the tool]
    #[arg(long, value_enum, value_name = "PLACE")]
    pub tool_change_at: Option<ChangeAt>,
    /// stepnc: leave out what STEP-NC cannot say, with a warning each
    #[arg(long)]
    pub lossy: bool,
    /// joint-gcode: greatest time between two points, s
    #[arg(long, value_name = "S")]
    pub interval: Option<f64>,
    /// joint-gcode: decimal comma
    #[arg(long)]
    pub decimal_comma: bool,
    /// joint-gcode: how numbers are cut to their decimals
    #[arg(long, value_enum, value_name = "HOW")]
    pub round: Option<RoundArg>,
    /// joint-gcode: greatest speed of every joint, degrees (mm) per second
    #[arg(long, value_name = "SPEED")]
    pub joint_speed: Option<f64>,
    /// Reproduce a published system
    #[arg(long, value_enum, value_name = "SYSTEM")]
    pub reference: Option<Reference>,
    /// unb2013: its settings file arqConf.txt [default: the greatest values it allows]
    #[arg(long, value_name = "FILE")]
    pub reference_config: Option<PathBuf>,
    #[command(flatten)]
    pub robot: crate::robot::RobotOptions,
}

/// Who keeps the tool beside a wall.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum CompensationArg {
    /// The path is that of the tool's center
    Path,
    /// The control, from the diameter in its tool table
    Control,
}

/// Where tools are changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum ChangeAt {
    /// At the top of the machine's Z axis: G53 G0 Z0
    G53,
    /// At the machine's second reference point: G30
    G30,
    /// At the origin of G55
    G55,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum ArcsArg {
    /// I J K from the start point
    Ijk,
    /// I J K as absolute position
    IjkAbsolute,
    /// Radius
    R,
    /// Straight pieces
    Lines,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum PlaneArg {
    /// XY only
    Xy,
    /// XY, XZ and YZ
    All,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum RoundArg {
    /// To the nearest
    Nearest,
    /// Toward zero
    Truncate,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reference {
    /// The joint-space compiler for a planar arm, UFMG 2008
    Ufmg2008,
    /// The STEP-NC to RS274NGC adapter for a router, UnB 2013
    Unb2013,
    /// The STEP-NC trajectory generator for robots, UFSC 2016
    Ufsc2016,
    /// The parallel machine 2UPS+PRP, EPUSP 2009: machines as their publication has them
    Usp2009,
}

impl Reference {
    /// Whether it starts from STEP-NC.
    fn reads_exchange(self) -> bool {
        matches!(self, Reference::Unb2013 | Reference::Ufsc2016)
    }
}

/// One file of a result. The first is the main one.
pub struct Artifact {
    /// Put behind the stem of the main file's name, extension included; empty for the main file.
    pub suffix: &'static str,
    /// Contents.
    pub bytes: Vec<u8>,
    /// Line of the program that each line comes from, from 0; `u32::MAX` = none. Empty: not known.
    pub lines: Vec<u32>,
    /// A name of its own beside the main file.
    pub name: Option<String>,
}

impl Artifact {
    /// A file, or one beside it.
    pub fn new(suffix: &'static str, bytes: Vec<u8>) -> Artifact {
        Artifact { suffix, bytes, lines: Vec::new(), name: None }
    }
}

/// A result with everything that was found on the way.
#[derive(Default)]
pub struct Built {
    /// Files; none when there were errors.
    pub artifacts: Vec<Artifact>,
    /// The main file, when it was written beside its goal already.
    pub written: Option<Pending>,
    /// Findings of lowering and emitting.
    pub found: Vec<Diagnostic>,
    /// Files that the findings point into.
    pub sources: Sources,
    /// Subroutine files used.
    pub subs: Vec<PathBuf>,
    /// Subroutine files that were looked for and are not there.
    pub missing: Vec<PathBuf>,
    /// Tools of a STEP-NC file, and the tool table that its program needs, if that is its own (mm).
    pub tools: Vec<Tool>,
    /// See `tools`.
    pub table: Option<String>,
    /// Figures for people.
    pub summary: Option<String>,
}

/// What a build needs besides the program.
pub struct Goal<'a> {
    /// Target id.
    pub target: &'a str,
    /// Options of the target.
    pub options: &'a TargetOptions,
    /// Machine, if one was chosen.
    pub machine: Option<&'a Machine>,
    /// Begin at this line (from 1), with this height of approach.
    pub from_line: Option<(u32, Option<f64>)>,
    /// Where long results may be written beside, to be put in place when they are complete.
    pub file: Option<&'a Path>,
}

/// Makes a target of a program, and checks it. `Err` holds the findings when it has errors. Usage errors come back
/// as text.
pub fn build(unit: &Unit, goal: &Goal<'_>) -> Result<Result<(Built, Checked), String>, Checked> {
    if let Some(mistake) = mismatch(unit, goal) {
        return Ok(Err(mistake));
    }
    if unit.exchange {
        return of_exchange(unit, goal);
    }
    if goal.target == "canon" {
        if goal.from_line.is_some() {
            return Ok(Err("--from-line goes with targets that are made of motion, not with canon".into()));
        }
        return canon(unit, goal.file);
    }
    let (motion, checked) = motion(unit, goal.machine)?;
    Ok(of_motion(motion, unit, goal).map(|built| (built, checked)))
}

/// Options of targets that were given, by name.
pub fn given(o: &TargetOptions) -> Vec<&'static str> {
    all(o).into_iter().filter(|(_, given)| *given).map(|(name, _)| name).collect()
}

/// An option of a command that writes G-code is listed in its help if that target heeds it, or the command itself does.
pub fn hidden_unless(option: clap::Arg, own: &[&str]) -> clap::Arg {
    let heeded = gr_spec::TargetDef::find("rs274ngc").map_or(&[][..], |t| t.options);
    let name = option.get_long().map(|long| format!("--{long}")).unwrap_or_default();
    let idle = all(&TargetOptions::default()).iter().any(|(n, _)| *n == name) && !heeded.contains(&name.as_str()) && !own.contains(&name.as_str());
    if idle { option.hide(true) } else { option }
}

/// Every option of targets, and whether it was given.
fn all(o: &TargetOptions) -> [(&'static str, bool); 25] {
    let r = &o.robot;
    [
        ("--to", o.to.is_some()),
        ("--units", o.units.is_some()),
        ("--decimals", o.decimals.is_some()),
        ("--arcs", o.arcs.is_some()),
        ("--plane", o.plane.is_some()),
        ("--arc-tolerance", o.arc_tolerance.is_some()),
        ("--line-numbers", o.line_numbers.is_some()),
        ("--repeat-words", o.repeat_words),
        ("--no-comments", o.no_comments),
        ("--cycles", o.cycles),
        ("--cutter-compensation", o.cutter_compensation.is_some()),
        ("--tool-change-at", o.tool_change_at.is_some()),
        ("--lossy", o.lossy),
        ("--interval", o.interval.is_some()),
        ("--decimal-comma", o.decimal_comma),
        ("--round", o.round.is_some()),
        ("--joint-speed", o.joint_speed.is_some()),
        ("--reference", o.reference.is_some()),
        ("--reference-config", o.reference_config.is_some()),
        ("--approach", r.approach.is_some()),
        ("--reconfigure", r.reconfigure.is_some()),
        ("--allow-unverified", r.allow_unverified),
        ("--job", r.job.is_some()),
        ("--compensate", r.compensate),
        ("--smoothing", r.smoothing.is_some()),
    ]
}

/// An option that was given and does nothing for the target. Reference modes are looked at in [`mismatch`].
fn idle(unit: &Unit, goal: &Goal<'_>) -> Option<String> {
    // Canonical calls of a STEP-NC file are those of the program that is written.
    let id = if unit.exchange && goal.target == "canon" { "rs274ngc" } else { goal.target };
    let heeded = gr_spec::TargetDef::find(id)?.options;
    let reference = |o: &&str| !o.starts_with("--reference");
    let planned = id == "joint-gcode" && crate::robot::plans_joints(goal);
    // Motion is corrected before any target is made of it, by straight pieces within the tolerance.
    let corrects = |o: &&str| goal.options.robot.compensate && *o == "--arc-tolerance" && heeded.contains(&"--compensate");
    let option = given(goal.options).into_iter().filter(|o| reference(o) && !corrects(o)).find(|o| !heeded.contains(o) || (planned && *o == "--round"))?;
    Some(format!("{option} does nothing for the target {}; `gcc-robot target show {}` says what it heeds", goal.target, goal.target))
}

/// What does not go together.
fn mismatch(unit: &Unit, goal: &Goal<'_>) -> Option<String> {
    if let Some(text) = idle(unit, goal) {
        return Some(text);
    }
    let name = unit.name();
    if goal.target.starts_with("plan") && !unit.exchange {
        return Some(format!("--target {} lists the workingsteps of a STEP-NC file; {name} is G-code", goal.target));
    }
    let reference = goal.options.reference?;
    if reference != Reference::Usp2009 && reference.reads_exchange() != unit.exchange {
        let what = if unit.exchange { "a STEP-NC file" } else { "G-code" };
        return Some(format!("--reference {} does not read {what} ({name})", id_of(reference)));
    }
    if reference == Reference::Unb2013 && goal.target == "plan" {
        return None;
    }
    let other = reference != Reference::Unb2013 && goal.options.reference_config.is_some();
    other.then(|| "--reference-config belongs to --reference unb2013".into())
}

fn id_of(reference: Reference) -> String {
    reference.to_possible_value().map(|v| v.get_name().to_string()).unwrap_or_default()
}

fn of_exchange(unit: &Unit, goal: &Goal<'_>) -> Result<Result<(Built, Checked), String>, Checked> {
    if goal.target.starts_with("plan") {
        let (text, checked) = crate::exchange::list(unit, goal.target == "plan-json")?;
        let built = Built { artifacts: one(text.into_bytes()), ..Built::default() };
        return Ok(Ok((built, checked)));
    }
    if goal.options.reference == Some(Reference::Unb2013) {
        let (converted, checked) = crate::exchange::unb2013(unit, goal.options.reference_config.as_deref())?;
        return Ok(of_converted(unit, converted, goal).map(|built| (built, checked)));
    }
    let (motion, checked) = match goal.options.reference {
        Some(Reference::Ufsc2016) => crate::exchange::ufsc2016(unit)?,
        _ => motion(unit, goal.machine)?,
    };
    if goal.target != "canon" {
        return Ok(of_motion(motion, unit, goal).map(|built| (built, checked)));
    }
    // Canonical calls are those of the program that is written.
    let written = Goal { target: "rs274ngc", ..*goal };
    let made = of_motion(motion, unit, &written).map(|mut built| {
        if let Some(main) = built.artifacts.first_mut() {
            let text = String::from_utf8_lossy(&main.bytes).into_owned();
            let tools = built.table.as_deref().map(crate::exchange::tool_table);
            main.bytes = calls(unit, text, tools);
            built.artifacts.truncate(1);
        }
        (built, checked)
    });
    Ok(made)
}

/// Other targets of a program that a published system made: through the interpreter.
fn of_converted(unit: &Unit, converted: crate::exchange::Converted, goal: &Goal<'_>) -> Result<Built, String> {
    let crate::exchange::Converted { program, table, files } = converted;
    let base = Built { table: Some(table.clone()), subs: files, ..Built::default() };
    if goal.target == "rs274ngc" {
        let artifacts = vec![
            Artifact::new("", program.into_bytes()),
            Artifact::new(".tbl", table.into_bytes()),
        ];
        return Ok(Built { artifacts, ..base });
    }
    let tools = crate::exchange::tool_table(&table);
    if goal.target == "canon" {
        return Ok(Built { artifacts: one(calls(unit, program, Some(tools))), ..base });
    }
    let mut setup = unit.setup.clone();
    setup.tools = tools;
    let motion = crate::pipeline::motion_of(&format!("{} as G-code", unit.name()), program, &setup);
    let made = of_motion(motion, unit, goal)?;
    Ok(Built { table: base.table, subs: base.subs, missing: base.missing, ..made })
}

/// Canonical calls of a program of our own making.
fn calls(unit: &Unit, program: String, tools: Option<gr_interp::ToolTable>) -> Vec<u8> {
    let mut setup = unit.setup.clone();
    if let Some(tools) = tools {
        setup.tools = tools;
        setup.machine_units = Units::Mm;
    }
    let printer = Printer::new(Vec::new(), crate::setup::version_of(setup.dialect));
    gr_driver::stream(&unit.name(), program.into(), &setup, None, printer).sink.into_inner()
}

fn of_motion(mut motion: Motion, unit: &Unit, goal: &Goal<'_>) -> Result<Built, String> {
    let rests = goal.machine.filter(|_| crate::robot::is_for_machine(goal)).and_then(|m| elsewhere::rests(unit, &motion, m));
    let faulty = |motion: &Motion| motion.found.iter().any(|d| d.severity == gr_text::Severity::Error);
    // A job names the workingsteps of the whole program, also those that a restart leaves behind.
    if !faulty(&motion) && let Err(found) = crate::robot::take_job(&mut motion, goal) {
        return Ok(built(motion, Vec::new(), found));
    }
    if let Some(from) = goal.from_line {
        restart(&mut motion, unit, from, goal.machine.filter(|_| crate::robot::is_for_machine(goal)));
    }
    if faulty(&motion) {
        return Ok(built(motion, Vec::new(), Vec::new()));
    }
    if let Some(machine) = goal.machine {
        let found = gr_robot::opinion::missing_axes(&motion.program, machine, &texts(&motion));
        if !found.is_empty() {
            return Ok(built(motion, Vec::new(), found));
        }
        if let Some(rests) = rests {
            return Ok(built(motion, Vec::new(), vec![rests]));
        }
    }
    let name = stem(&unit.path);
    let mut corrected = None;
    if goal.options.robot.compensate && !crate::robot::is_planned(goal) {
        match crate::robot::corrected(&motion.program, goal, &texts(&motion))? {
            Ok((program, made)) => {
                motion.program = program;
                corrected = Some(made);
            }
            Err(found) => return Ok(built(motion, Vec::new(), found)),
        }
    }
    let planned = match goal.target {
        "joint-gcode" if crate::robot::plans_joints(goal) => Some(crate::robot::joint_gcode(&motion, goal, &texts(&motion), &name)?),
        "setpoints" => Some(crate::robot::setpoints(&motion, goal, &texts(&motion), &name)?),
        other if crate::robot::is_language(other) => Some(crate::robot::build(&motion, goal, &texts(&motion), &name)?),
        _ => None,
    };
    if let Some(made) = planned {
        return Ok(match made {
            Ok(mut m) => {
                if let Some(c) = corrected {
                    m.summary += &c.summary;
                    m.artifacts.push(c.table);
                }
                Built { summary: Some(m.summary), ..built(motion, m.artifacts, m.notes) }
            }
            Err(found) => built(motion, Vec::new(), found),
        });
    }
    let made: Result<(Vec<Artifact>, Vec<Diagnostic>), Vec<Diagnostic>> = match goal.target {
        "stepnc" => stepnc(&motion, unit, goal.options, &name),
        "motion" => Ok((one_text(&motion.program, gr_ir::text::print(&motion.program, true)), Vec::new())),
        "rs274ngc" => normalised(&motion, unit, goal.options, &name)?,
        "joint-gcode" => joints(&motion, goal)?,
        "json" => dumped(|out| gr_backends::dump::json(&motion.program, out)),
        "csv" => {
            let options = gr_backends::dump::CsvOptions { tolerance: goal.options.arc_tolerance, rates: gr_driver::rates(&unit.setup), ..Default::default() };
            dumped(|out| gr_backends::dump::csv(&motion.program, &options, out))
        }
        "svg" | "png" | "html" => {
            let trace = (goal.target == "html").then(|| traced(&motion, unit, goal.machine));
            one_picture(&motion.program, trace.as_ref(), unit, goal.target, &name)?
        }
        "sheet" | "sheet-json" | "sheet-html" => Ok((one(sheet(&motion, unit, goal, &name)), Vec::new())),
        other => return Err(format!("the target {other} can't be made by this version")),
    };
    Ok(match (made, corrected) {
        (Ok((mut artifacts, notes)), Some(c)) => {
            artifacts.push(c.table);
            Built { summary: Some(c.summary), ..built(motion, artifacts, notes) }
        }
        (Ok((artifacts, notes)), None) => built(motion, artifacts, notes),
        (Err(found), _) => built(motion, Vec::new(), found),
    })
}

fn built(motion: Motion, artifacts: Vec<Artifact>, more: Vec<Diagnostic>) -> Built {
    let mut found = motion.found;
    found.extend(more);
    let table = motion.plan.as_ref().filter(|p| p.own_table).map(|p| gr_planner::tool_table(&p.tools));
    let tools = motion.plan.map(|p| p.tools).unwrap_or_default();
    Built { artifacts, written: None, found, sources: motion.sources, subs: motion.subs, missing: motion.missing, tools, table, summary: None }
}

/// Lets the program begin later; the machine's file says where the part is and how the tool is tilted.
fn restart(motion: &mut Motion, unit: &Unit, (line, safe_z): (u32, Option<f64>), machine: Option<&Machine>) {
    let placed = machine.is_some();
    let turns = machine.map(gr_robot::Turns::new);
    let tool = |pose: &Pose, state: &State| turns.as_ref()?.up(pose, state);
    let begin = |motion: &Motion, unsure| {
        let options = gr_backends::from_line::Options { safe_z, unsure, stored: !unit.setup.params.is_empty(), room: None, tool: Some(&tool), tips: machine.is_some(), slides: machine.is_some_and(|m| m.kind == gr_machine::Kind::Mill) };
        gr_backends::from_line::from_line(&motion.program, FileId(0), line, &options, &texts(motion))
    };
    let mut unsure = [false; 9];
    let doubt = |made: &Result<Restart, _>| elsewhere::doubt(unit, motion, made.as_ref().ok()?, placed, |there| begin(there, [false; 9]).ok());
    let mut made = begin(motion, unsure);
    let mut doubted = doubt(&made);
    if let Some(first) = doubted {
        unsure = first.axes;
        made = begin(motion, unsure);
        doubted = doubt(&made);
    }
    if let Some(doubt) = doubted {
        let (file, span) = gr_backends::Sources::place(&texts(motion), Source { line: line - 1, ..Source::default() });
        motion.found.push(Diagnostic::new(code::FROM_LINE_PLACE_UNKNOWN, file, span, &doubt.told()));
        return;
    }
    match made {
        Ok(restart) => {
            motion.begun = Some(Begun { line, unsure, room: restart.room });
            motion.program = restart.program;
            motion.found.extend(restart.notes);
        }
        Err(found) => motion.found.extend(found),
    }
}

fn one_picture(program: &Program, trace: Option<&Trace>, unit: &Unit, kind: &str, name: &str) -> Result<Made, String> {
    let options = gr_backends::plot::Options { title: name.to_string(), rates: gr_driver::rates(&unit.setup), ..gr_backends::plot::Options::default() };
    Ok(Ok((one(picture(program, trace, kind, &options)?), Vec::new())))
}

/// A picture of this kind: svg, png, or html, which shows a trace.
pub fn picture(program: &Program, trace: Option<&Trace>, kind: &str, options: &gr_backends::plot::Options) -> Result<Vec<u8>, String> {
    Ok(match (kind, trace) {
        ("png", bent) => gr_backends::plot::png(program, bent, options)?,
        ("svg", bent) => gr_backends::plot::svg(program, bent, options).into_bytes(),
        ("html", Some(trace)) => gr_backends::plot::html(trace, options).into_bytes(),
        (other, _) => return Err(format!("pictures are .svg, .png or .html, not .{other}")),
    })
}

/// The path for a page: with tools, raw part and, where one was chosen, the machine.
pub fn traced(motion: &Motion, unit: &Unit, machine: Option<&Machine>) -> Trace {
    let options = TraceOptions { tools: tool_rows(motion, unit), rates: gr_driver::rates(&unit.setup), ..TraceOptions::default() };
    let mut trace = Trace::new(&motion.program, &options);
    trace.stock = motion.plan.as_ref().and_then(|p| p.stock).or(unit.stock);
    if let Some(m) = machine {
        let planned = is_planned(m).then(|| gr_robot::plan(&motion.program, m, &texts(motion), &gr_robot::Options::default()));
        let planned = planned.as_ref().map(|p| p.as_ref().map_err(|found| gr_lsp::machine::reason(found)));
        gr_lsp::machine::along(m, planned, &mut trace);
    }
    trace
}

/// The tool table for a setup sheet and a preview.
pub fn tool_rows(motion: &Motion, unit: &Unit) -> Vec<gr_backends::sheet::ToolRow> {
    if let Some(plan) = &motion.plan {
        let row = |t: &Tool| gr_backends::sheet::ToolRow {
            number: i32::try_from(t.number).unwrap_or(i32::MAX),
            diameter: t.diameter,
            comment: format!("{}, {}", crate::tools::title(t), t.name),
        };
        return plan.tools.iter().map(row).collect();
    }
    let unit_mm = unit.unit_mm();
    let row = |t: &gr_interp::Tool| gr_backends::sheet::ToolRow {
        number: t.number,
        diameter: t.diameter * unit_mm,
        comment: t.comment.to_string(),
    };
    unit.setup.tools.rows.iter().filter(|t| &*t.comment != gr_interp::ASSUMED).map(row).collect()
}

fn sheet(motion: &Motion, unit: &Unit, goal: &Goal<'_>, name: &str) -> Vec<u8> {
    let standing = |e: &gr_machine::External| {
        let turns = e.joint.kind == gr_machine::JointKind::Revolute;
        let position = if turns { e.position.to_degrees() } else { e.position };
        gr_backends::sheet::Standing { name: e.joint.name.clone(), position, turns, carries_machine: e.carries_machine }
    };
    let options = gr_backends::sheet::Options {
        title: name.to_string(),
        tools: tool_rows(motion, unit),
        rates: gr_driver::rates(&unit.setup),
        external: goal.machine.map_or(Vec::new(), |m| m.cell.external.iter().map(standing).collect()),
    };
    let sheet = gr_backends::sheet::sheet(&motion.program, &options);
    let text = match goal.target {
        "sheet-json" => sheet.json(),
        "sheet-html" => sheet.html(),
        _ => sheet.text(),
    };
    text.into_bytes()
}

/// The motion's text: a line for each operation behind a head.
fn one_text(program: &Program, text: String) -> Vec<Artifact> {
    let mut sources = Vec::new();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        sources.push(Some(view.source));
    }
    let head = text.lines().count().saturating_sub(sources.len());
    let lines = main_lines(program, std::iter::repeat_n(None, head).chain(sources));
    vec![Artifact { lines, ..Artifact::new("", text.into_bytes()) }]
}

/// Lines of the main file that lines of an output come from; of blocks of other files the line that called them.
pub fn main_lines(program: &Program, sources: impl IntoIterator<Item = Option<Source>>) -> Vec<u32> {
    let line = |source: Source| {
        if source.file == FileId(0) {
            return Some(source.line);
        }
        program.call_stack(source).find(|f| f.file == FileId(0)).map(|f| f.line)
    };
    sources.into_iter().map(|s| s.and_then(line).unwrap_or(u32::MAX)).collect()
}

fn one(bytes: Vec<u8>) -> Vec<Artifact> {
    vec![Artifact::new("", bytes)]
}

fn dumped(write: impl FnOnce(&mut dyn std::io::Write) -> std::io::Result<()>) -> Result<(Vec<Artifact>, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut bytes = Vec::new();
    write(&mut bytes).expect("memory takes everything");
    Ok((one(bytes), Vec::new()))
}

/// Name without folder and extension.
pub fn stem(path: &Path) -> String {
    path.file_stem().map_or("program".into(), |s| s.to_string_lossy().into_owned())
}

fn canon(unit: &Unit, file: Option<&Path>) -> Result<Result<(Built, Checked), String>, Checked> {
    let version = crate::setup::version_of(unit.setup.dialect);
    let latin1 = unit.encoding == gr_text::Encoding::Latin1;
    let built = |artifacts, written, files: &gr_driver::Loaded| Built {
        artifacts,
        written,
        found: Vec::new(),
        subs: files.subs().cloned().collect(),
        missing: files.missing().cloned().collect(),
        ..Built::default()
    };
    // Beside the goal while it is being made; in memory when that can't be, which then says why when it is written.
    if let Some(pending) = file.and_then(|f| Pending::new(f).ok()) {
        let (printer, files, checked) = run(unit, Printer::new(pending, version).latin1(latin1))?;
        return Ok(match printer.finish() {
            Ok(pending) => Ok((built(Vec::new(), Some(pending), &files), checked)),
            Err(e) => Err(format!("{}: {e}", file.unwrap_or(Path::new("-")).display())),
        });
    }
    let (printer, files, checked) = run(unit, Printer::new(Vec::new(), version).latin1(latin1))?;
    Ok(Ok((built(one(printer.into_inner()), None, &files), checked)))
}

type Made = Result<(Vec<Artifact>, Vec<Diagnostic>), Vec<Diagnostic>>;

fn normalised(motion: &Motion, unit: &Unit, options: &TargetOptions, name: &str) -> Result<Made, String> {
    let mut o = rs274ngc::Options { name: name.to_string(), ..rs274ngc::Options::default() };
    let to = options.to.as_deref().unwrap_or("linuxcnc");
    o.language = rs274ngc::Language::of_dialect(to)
        .ok_or_else(|| format!("G-code can't be written in dialect {to}; choose linuxcnc, fanuc-mill or grbl"))?;
    if options.units == Some(UnitArg::Inch) {
        o.units = Units::Inch;
    }
    o.decimals = options.decimals;
    o.arcs = match options.arcs {
        None | Some(ArcsArg::Ijk) => rs274ngc::Arcs::Ijk,
        Some(ArcsArg::IjkAbsolute) => rs274ngc::Arcs::IjkAbsolute,
        Some(ArcsArg::R) => rs274ngc::Arcs::R,
        Some(ArcsArg::Lines) => rs274ngc::Arcs::Lines,
    };
    o.only_xy_arcs = options.plane == Some(PlaneArg::Xy);
    o.arc_tolerance = options.arc_tolerance.unwrap_or(o.arc_tolerance);
    o.numbers = options.line_numbers.as_deref().map(line_numbers).transpose()?;
    o.repeat_words = options.repeat_words;
    o.comments = !options.no_comments;
    o.cycles = options.cycles;
    o.pecks = gr_spec::Dialect::find(to).is_none_or(|d| d.id != "linuxcnc-2.10");
    o.control_compensates = options.cutter_compensation == Some(CompensationArg::Control);
    o.change_at = options.tool_change_at.map(|p| match p {
        ChangeAt::G53 => rs274ngc::ChangeAt::G53,
        ChangeAt::G30 => rs274ngc::ChangeAt::G30,
        ChangeAt::G55 => rs274ngc::ChangeAt::G55,
    });
    stored(&mut o, unit);
    let mut table = None;
    if let Some(plan) = &motion.plan {
        planned(&mut o, plan);
        table = plan.own_table.then(|| gr_planner::tool_table(&plan.tools));
    }
    let texts = texts(motion);
    Ok(rs274ngc::emit(&motion.program, &o, &texts).and_then(|mut e| {
        e.notes.extend(state_told(motion, unit, options, &o, &e));
        if e.notes.iter().any(|d| d.severity == gr_text::Severity::Error) {
            return Err(e.notes);
        }
        let mut artifacts = vec![Artifact { lines: e.lines, ..Artifact::new("", e.text.into_bytes()) }];
        artifacts.extend(table.map(|t| Artifact::new(".tbl", t.into_bytes())));
        Ok((artifacts, e.notes))
    }))
}

/// Decimals that round nothing away.
const FINEST: usize = 9;

/// What is to be said of a translation that depends on values nobody has named.
fn state_told(motion: &Motion, unit: &Unit, options: &TargetOptions, o: &rs274ngc::Options, written: &rs274ngc::Emitted) -> Option<Diagnostic> {
    if motion.plan.is_some() || options.robot.compensate || options.tool_change_at.is_some() {
        return None;
    }
    let to = gr_spec::Dialect::find(options.to.as_deref().unwrap_or("linuxcnc"))?;
    let begins = |e: &rs274ngc::Emitted| {
        let first = motion.begun?.line - 1;
        e.lines.iter().position(|l| *l >= first && *l != u32::MAX).map(|k| k as u32)
    };
    let differs = |e: &rs274ngc::Emitted| elsewhere::differs(unit, motion, (&e.text, begins(e)), to, allowed(options).max(1e-3) + 4.0 * o.arc_tolerance);
    let found = differs(written)?;
    if found.code != code::EMIT_NOT_EQUAL || o.decimals >= Some(FINEST) {
        return Some(found);
    }
    // Where points are closer than a decimal, roundings meet; what is the same with all decimals is the same.
    let finest = rs274ngc::Options { decimals: Some(FINEST), ..o.clone() };
    match rs274ngc::emit(&motion.program, &finest, &texts(motion)) {
        Ok(finest) => differs(&finest),
        Err(_) => Some(found),
    }
}

/// One unit of the last decimal that is written. With straight pieces for arcs, their tolerance too; with arcs, what
/// rounding of both ends and the centre makes of them at most: half a unit in each coordinate moves the centre by 0.71
/// units and each radius by 1.42, and a helix has its own half in depth.
pub fn allowed(o: &TargetOptions) -> f64 {
    let inch = o.units == Some(UnitArg::Inch);
    let fanuc = o.to.as_deref().is_some_and(|t| !t.starts_with("linuxcnc"));
    let decimals = o.decimals.unwrap_or(4 + usize::from(inch) - usize::from(fanuc)) as i32;
    let unit = 10_f64.powi(-decimals) * if inch { 25.4 } else { 1.0 };
    let pieces = o.arcs == Some(ArcsArg::Lines) || o.plane == Some(PlaneArg::Xy);
    let curve = if pieces { o.arc_tolerance.unwrap_or(0.001) } else { 1.25 * unit };
    (unit + curve).max(1e-6)
}

/// Tools of a process plan: what the operator loads, and their lengths as the program's own.
fn planned(o: &mut rs274ngc::Options, plan: &crate::exchange::Plan) {
    o.tools.clear();
    for tool in &plan.tools {
        let number = i32::try_from(tool.number).unwrap_or(i32::MAX);
        let mut offset = [0.0; 9];
        offset[2] = tool.length.unwrap_or(0.0);
        o.tools.push((number, offset));
        o.remarks.push(format!("T{number}: {} {}", crate::tools::title(tool), tool.name));
    }
}

/// The motion as a process plan with explicit tool paths.
fn stepnc(motion: &Motion, unit: &Unit, options: &TargetOptions, name: &str) -> Made {
    let unit_mm = unit.unit_mm();
    let tools = match &motion.plan {
        Some(plan) => plan.tools.iter().map(crate::tools::described).collect(),
        None => {
            let rows = unit.setup.tools.rows.iter().skip(1).filter(|t| &*t.comment != gr_interp::ASSUMED);
            rows.map(|t| crate::tools::described_row(t, unit_mm)).collect()
        }
    };
    let o = gr_planner::stepnc::Options {
        name: name.to_string(),
        lossy: options.lossy,
        tools,
        tolerance: options.arc_tolerance.unwrap_or_default(),
        planned: motion.plan.is_some(),
    };
    let texts = texts(motion);
    let place = |s: Source| gr_backends::Sources::place(&texts, s);
    let mut said = gr_robot::Coordinates::new(&motion.program);
    let mut begun = false;
    let mut words = |v: &gr_ir::View<'_, '_>| {
        said.step(&motion.program, v, &texts);
        let b = said.brought();
        let mut words = gr_planner::stepnc::Words { work: b.work, machine: b.machine, hidden: b.hidden };
        if motion.plan.is_some() && v.op.moves() && !std::mem::replace(&mut begun, true) {
            // A plan's first way goes up from wherever the machine stands.
            words.work = [false, false, true];
        }
        words
    };
    gr_planner::stepnc::write_at(&motion.program, &o, &place, &mut words).map(|(text, notes)| (one(text.into_bytes()), notes))
}

/// Work offsets and tools that the control has in store, in mm and rad.
fn stored(o: &mut rs274ngc::Options, unit: &Unit) {
    let scale = if unit.setup.machine_units == Units::Inch { 25.4 } else { 1.0 };
    let axis = |i: usize, v: f64| if (3..6).contains(&i) { v.to_radians() } else { v * scale };
    let param = |n: usize| unit.setup.params.get(&(n as u32)).copied().unwrap_or(0.0);
    o.stored_known = !unit.setup.params.is_empty();
    let startup = unit
        .setup
        .ini
        .get("RS274NGC", "RS274NGC_STARTUP_CODE")
        .filter(|_| unit.setup.dialect.family == gr_spec::Family::Linuxcnc);
    o.diameters = startup.is_some_and(|code| gr_backends::Words::of(code).g(70));
    for n in 1..=9 {
        let base = 5201 + 20 * n;
        for i in 0..9 {
            o.stored_offsets[n][i] = axis(i, param(base + i));
        }
        o.stored_rotations[n] = param(base + 9).to_radians();
    }
    for tool in unit.setup.tools.rows.iter().skip(1).filter(|t| &*t.comment != gr_interp::ASSUMED) {
        let mut offset = tool.offset;
        offset.iter_mut().enumerate().for_each(|(i, v)| *v = axis(i, *v));
        o.tools.push((tool.number, offset));
    }
}

/// `FIRST[,STEP]`
fn line_numbers(text: &str) -> Result<(u32, u32), String> {
    let (first, step) = text.split_once(',').unwrap_or((text, "10"));
    let number = |t: &str| t.trim().parse::<u32>().map_err(|_| format!("--line-numbers {text}: whole numbers are needed"));
    Ok((number(first)?, number(step)?))
}

/// The lines of a program.
pub fn texts(motion: &Motion) -> Texts<'_> {
    let texts = Texts::new(motion.sources.iter().map(|(id, f)| (id, &*f.text)));
    if motion.plan.is_some() { texts.instances() } else { texts.with_increments(motion.increments).with_offset_numbers(motion.offset_numbers) }
}

fn joints(motion: &Motion, goal: &Goal<'_>) -> Result<Made, String> {
    let o = goal.options;
    let mut options = if o.reference == Some(Reference::Ufmg2008) { joint::Options::ufmg2008() } else { joint::Options::default() };
    options.interval = o.interval.unwrap_or(options.interval);
    options.decimals = o.decimals.unwrap_or(options.decimals);
    options.comma |= o.decimal_comma;
    options.rounding = match o.round {
        Some(RoundArg::Nearest) => joint::Rounding::Nearest,
        Some(RoundArg::Truncate) => joint::Rounding::Truncate,
        None => options.rounding,
    };
    options.joint_speed = o.joint_speed.map(f64::to_radians).or(options.joint_speed);
    if !(options.interval > 0.0) {
        return Err("--interval must be above zero".into());
    }
    let builtin = gr_machine::builtin("ufmg/plano-3r").expect("the library has it");
    let machine = match (goal.machine, o.reference) {
        (Some(m), _) => m,
        (None, Some(Reference::Ufmg2008)) => &builtin,
        (None, _) => return Err("the target joint-gcode needs --machine; `gcc-robot machine list` shows the ids".into()),
    };
    Ok(plan(&motion.program, machine, &options, &texts(motion)))
}

fn plan(program: &Program, machine: &Machine, options: &joint::Options, texts: &dyn gr_backends::Sources) -> Made {
    let (made, warnings) = gr_robot::opinion::planar(program, machine, options, texts)?;
    let artifacts = vec![
        Artifact { lines: main_lines(program, made.sources()), ..Artifact::new("", made.gcode().into_bytes()) },
        Artifact::new("-cartesian.csv", made.cartesian_csv().into_bytes()),
        Artifact::new("-joint.csv", made.joint_csv().into_bytes()),
    ];
    Ok((artifacts, warnings))
}
