//! `gcc-robot diff` and `gcc-robot verify`

use std::path::{Path, PathBuf};

use gr_ir::Source;
use gr_ir::diff::{Aspect, Diff, Spot, Tolerance, diff};
use gr_spec::Dialect;
use serde_json::json;

use super::check::show;
use crate::emit::{Goal, build};
use crate::exit::Exit;
use crate::options::{DiffArgs, Global, LintArgs, SetupArgs, VerifyArgs};
use crate::pipeline::{Motion, Unit, load, motion, motion_of};
use crate::progress::Progress;
use crate::render::{MessageFormat, Renderer};
use crate::setup::{Station, Stations};
use crate::sources::Sources;

pub fn run(global: &Global, args: &DiffArgs) -> Exit {
    let mut renderer = global.renderer(true);
    let both = [args.a.clone(), args.b.clone()];
    let Some(mut stations) = prepare(&args.setup, &both, &mut renderer) else { return renderer.failed() };
    let progress = Progress::new(global.quiet, "comparing");
    let first = stations.get(0).map(|s| read(&args.a, s));
    if let Some(name) = &args.second_dialect {
        match Dialect::find(name) {
            Some(d) => stations.iter_mut().for_each(|s| s.dialect = Some(d)),
            None => {
                eprintln!("there is no dialect {name}; known: {}", super::explain::dialects());
                return Exit::Usage;
            }
        }
    }
    let second = stations.get(1).map(|s| read(&args.b, s));
    let (Some(first), Some(second)) = (first, second) else { return Exit::Usage };
    let (a, b) = match (first, second) {
        (Ok(a), Ok(b)) => (a, b),
        (a, b) => {
            drop(progress);
            let mut exit = Exit::Findings;
            for checked in a.err().into_iter().chain(b.err()) {
                show(&mut renderer, &checked);
                exit = if checked.unreadable { Exit::Io } else { exit };
            }
            renderer.finish(false);
            return exit;
        }
    };
    let tolerance = Tolerance { rate: args.rate, limit: args.limit, work_frame: args.work_frame, ..Tolerance::within(args.tolerance) };
    let mut result = diff(&a.motion.program, &b.motion.program, &tolerance);
    if a.unit.setup.dialect.id != b.unit.setup.dialect.id || a.unit.exchange != b.unit.exchange {
        // Each control has its own way to begin with, and a plan none.
        forget(&mut result, &[Aspect::Control]);
    }
    if !args.work_frame && !a.unit.exchange && !b.unit.exchange && !result.differs(Aspect::Path) {
        result = crate::elsewhere::compared(result, (&a.unit, &a.motion), &b.unit, &tolerance);
    }
    drop(progress);
    tell(global, &result, &a.motion.sources, &b.motion.sources)
}

/// Leaves these differences out.
fn forget(result: &mut Diff, aspects: &[Aspect]) {
    let before = result.differences.len();
    result.differences.retain(|d| !aspects.contains(&d.aspect));
    result.count -= before - result.differences.len();
}

fn prepare(setup: &SetupArgs, programs: &[PathBuf], renderer: &mut Renderer) -> Option<Stations> {
    let mut sources = Sources::default();
    let found = Stations::of(setup, &LintArgs::default(), programs, &mut sources, renderer);
    if found.is_none() {
        renderer.finish(false);
    }
    found
}

/// A program and its motion.
struct Side {
    unit: Unit,
    motion: Motion,
}

fn read(path: &Path, station: &Station) -> Result<Side, super::check::Checked> {
    let unit = load(path, station)?;
    let motion = motion(&unit, None)?.0;
    Ok(Side { unit, motion })
}

/// Prints what differs.
fn tell(global: &Global, result: &Diff, a: &Sources, b: &Sources) -> Exit {
    let text = if global.message_format == MessageFormat::Json { as_json(result, a, b) } else { as_text(result, a, b) };
    let printed = super::print(&text);
    if result.is_empty() { printed } else { printed.max(Exit::Findings) }
}

fn place(sources: &Sources, spot: Spot) -> String {
    spot.map_or("-".into(), |(_, s)| format!("{}:{}", sources.name(s.file), s.line + 1))
}

fn as_text(result: &Diff, a: &Sources, b: &Sources) -> String {
    let mut text = String::new();
    for d in &result.differences {
        text.push_str(&format!("{} {} {}: {}\n", word(d.aspect), place(a, d.a), place(b, d.b), d.message));
    }
    if result.count > result.differences.len() {
        text.push_str(&format!("… and {} more\n", result.count - result.differences.len()));
    }
    let (s, t) = (result.totals_a.seconds(), result.totals_b.seconds());
    let time = format!("time {s:.3} s and {t:.3} s");
    text.push_str(&match (result.count, result.resegmented) {
        (0, false) => format!("the same motion ({} moves, {time})\n", result.totals_a.moves),
        (0, true) => format!("the same path, cut into moves differently ({time}; at most {:.1e} mm apart)\n", result.deviation),
        (1, _) => format!("1 difference ({time})\n"),
        (n, _) => format!("{n} differences ({time})\n"),
    });
    text
}

fn word(aspect: Aspect) -> &'static str {
    match aspect {
        Aspect::Path => "path",
        Aspect::Tool => "tool",
        Aspect::Feed => "feed",
        Aspect::Spindle => "spindle",
        Aspect::Coolant => "coolant",
        Aspect::Event => "event",
        Aspect::Control => "control",
        Aspect::Time => "time",
    }
}

fn as_json(result: &Diff, a: &Sources, b: &Sources) -> String {
    let spot = |sources: &Sources, s: Spot| {
        s.map(|(operation, Source { file, line, .. })| json!({ "operation": operation, "file": sources.name(file), "line": line + 1 }))
    };
    let list: Vec<_> = result
        .differences
        .iter()
        .map(|d| json!({ "aspect": word(d.aspect), "a": spot(a, d.a), "b": spot(b, d.b), "message": d.message }))
        .collect();
    let value = json!({
        "equal": result.is_empty(), "count": result.count, "differences": list, "resegmented": result.resegmented,
        "deviation": result.deviation, "seconds": [result.totals_a.seconds(), result.totals_b.seconds()],
    });
    format!("{value:#}\n")
}

/// Builds normalised G-code, reads it back and compares it with the source as motion.
pub fn verify(global: &Global, args: &VerifyArgs) -> Exit {
    let mut renderer = global.renderer(true);
    let Some(stations) = prepare(&args.setup, std::slice::from_ref(&args.file), &mut renderer) else { return renderer.failed() };
    let Some(station) = stations.get(0) else { return Exit::Usage };
    if let Some(machine) = station.machine.as_ref().filter(|m| gr_robot::along::is_planned(m)) {
        return on_robot(global, args, station, machine, &mut renderer);
    }
    // A template has no joint values either: what is missing in its file is told below.
    let incomplete = |m: &gr_machine::Machine| matches!(m.chain, gr_machine::Chain::Incomplete { .. });
    if args.output.is_some() && !station.machine.as_ref().is_some_and(incomplete) {
        eprintln!("-o goes with --machine and a robot: without one there is no table of points to write");
        return Exit::Usage;
    }
    // A job says where the part is: that matters to the machine, not to what is written.
    let mut options = args.options.clone();
    if station.machine.is_some() {
        options.robot.job = None;
    }
    let goal = Goal { target: "rs274ngc", options: &options, machine: None, from_line: None, file: None };
    let made = load(&args.file, station).and_then(|unit| {
        let mut a = motion(&unit, station.machine.as_ref())?.0;
        let placed = Goal { options: &args.options, machine: station.machine.as_ref(), ..goal };
        if let Err(found) = crate::robot::take_job(&mut a, &placed) {
            return Err(super::check::Checked { sources: a.sources, found, ..super::check::Checked::nothing() });
        }
        // An arm that is not planned is asked about every point all the same.
        let found = station.machine.as_ref().map_or_else(Vec::new, |m| crate::robot::opinion(&a, m));
        if found.iter().any(|d| d.severity == gr_text::Severity::Error) {
            return Err(super::check::Checked { sources: a.sources, found, ..super::check::Checked::nothing() });
        }
        Ok((build(&unit, &goal)?, unit, a))
    });
    let (built, unit, a) = match made {
        Ok((Ok((built, _)), unit, a)) => (built, unit, a),
        Ok((Err(text), ..)) => {
            eprintln!("{text}");
            return Exit::Usage;
        }
        Err(checked) => {
            show(&mut renderer, &checked);
            renderer.finish(false);
            return if checked.unreadable { Exit::Io } else { Exit::Findings };
        }
    };
    let table = built.table;
    let Some(main) = built.artifacts.into_iter().next() else {
        built.found.iter().for_each(|d| renderer.show(&built.sources, d));
        renderer.finish(false);
        return Exit::Findings;
    };
    let text = String::from_utf8_lossy(&main.bytes).into_owned();
    let mut setup = unit.setup.clone();
    setup.dialect = args.options.to.as_deref().and_then(Dialect::find).unwrap_or_else(Dialect::linuxcnc);
    if let Some(table) = &table {
        setup.tools = crate::exchange::tool_table(table);
        setup.machine_units = gr_canon::Units::Mm;
    }
    crate::elsewhere::starts_as(&unit, &a.program, &mut setup);
    let b = motion_of("<translation>", text, &setup);
    let tolerance = Tolerance { rate: 1e-3, ..Tolerance::within(crate::emit::allowed(&args.options)) };
    let mut result = diff(&a.program, &b.program, &tolerance);
    match args.options.to.as_deref() {
        // It has no tool changes: they are stops with a remark.
        Some("grbl") => forget(&mut result, &[Aspect::Tool, Aspect::Event, Aspect::Control]),
        // A plan knows nothing of the exact path that LinuxCNC's cycles follow.
        _ if unit.exchange => forget(&mut result, &[Aspect::Control]),
        // Its words for them are others; what it lacks has been told.
        Some(other) if !other.starts_with("linuxcnc") => forget(&mut result, &[Aspect::Control]),
        _ => {}
    }
    let state = built.found.into_iter().filter(|d| d.code == gr_text::code::EMIT_ELSEWHERE);
    let mut told = Exit::Ok;
    for mut finding in state {
        station.lints.harden(&mut finding);
        renderer.show(&built.sources, &finding);
        if finding.severity == gr_text::Severity::Error {
            told = Exit::Findings;
        }
    }
    renderer.finish(false);
    tell(global, &result, &a.sources, &b.sources).max(told)
}

/// What matters to the joint values.
pub const ROBOT_OPTIONS: [&str; 6] = ["--approach", "--reconfigure", "--arc-tolerance", "--job", "--compensate", "--reference"];

/// Joint values of a robot against the points they are for.
fn on_robot(global: &Global, args: &VerifyArgs, station: &Station, machine: &gr_machine::Machine, renderer: &mut Renderer) -> Exit {
    let idle = crate::emit::given(&args.options).into_iter().find(|o| !ROBOT_OPTIONS.contains(o));
    if let Some(option) = idle {
        eprintln!("{option} does nothing when the joint values of a robot are verified");
        return Exit::Usage;
    }
    let made = load(&args.file, station).and_then(|unit| crate::robot::verify(&unit, machine, args));
    let report = match made {
        Ok(Ok(report)) => report,
        Ok(Err(text)) => {
            eprintln!("{text}");
            return Exit::Findings;
        }
        Err(checked) => {
            show(renderer, &checked);
            renderer.finish(!global.quiet);
            return if checked.unreadable { Exit::Io } else { Exit::Findings };
        }
    };
    if let Some(folder) = &args.output {
        let files = crate::robot::report_files(&report, folder, &crate::emit::stem(&args.file));
        let exit = super::write(renderer, &mut Sources::default(), &args.file, &files);
        if exit != Exit::Ok {
            renderer.finish(false);
            return exit;
        }
    }
    super::print(&report.table())
}

