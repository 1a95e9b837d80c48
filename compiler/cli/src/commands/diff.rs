//! `gcc-robot diff` and `gcc-robot verify`

use std::path::Path;

use gr_ir::Source;
use gr_ir::diff::{Aspect, Diff, Spot, Tolerance, diff};
use gr_spec::Dialect;
use serde_json::json;

use super::check::show;
use crate::emit::{Goal, build};
use crate::exit::Exit;
use crate::options::{DiffArgs, Global, LintArgs, SetupArgs, UnitArg, VerifyArgs};
use crate::pipeline::{Motion, load, motion, motion_of};
use crate::progress::Progress;
use crate::render::{MessageFormat, Renderer};
use crate::setup::{Station, station};
use crate::sources::Sources;

pub fn run(global: &Global, args: &DiffArgs) -> Exit {
    let mut renderer = global.renderer(true);
    let Some(mut station) = prepare(&args.setup, &mut renderer) else { return renderer.failed() };
    let progress = Progress::new(global.quiet, "comparing");
    let first = read(&args.a, &station);
    if let Some(name) = &args.second_dialect {
        match Dialect::find(name) {
            Some(d) => station.dialect = Some(d),
            None => {
                eprintln!("there is no dialect {name}; known: {}", super::explain::dialects());
                return Exit::Usage;
            }
        }
    }
    let second = read(&args.b, &station);
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
    let tolerance = Tolerance { length: args.tolerance, rate: args.rate, limit: args.limit, work_frame: args.work_frame, ..Tolerance::default() };
    let result = diff(&a.program, &b.program, &tolerance);
    drop(progress);
    tell(global, &result, &a.sources, &b.sources)
}

fn prepare(setup: &SetupArgs, renderer: &mut Renderer) -> Option<Station> {
    let mut sources = Sources::default();
    let found = station(setup, &LintArgs::default(), Path::new("."), &mut sources, renderer);
    if found.is_none() {
        renderer.finish(false);
    }
    found
}

fn read(path: &Path, station: &Station) -> Result<Motion, super::check::Checked> {
    Ok(motion(&load(path, station)?, None)?.0)
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
    let Some(station) = prepare(&args.setup, &mut renderer) else { return renderer.failed() };
    if let Some(machine) = station.machine.as_ref().filter(|m| gr_robot::along::is_planned(m)) {
        return on_robot(global, args, &station, machine, &mut renderer);
    }
    if args.output.is_some() {
        eprintln!("-o goes with --machine and a robot: without one there is no table of points to write");
        return Exit::Usage;
    }
    let goal = Goal { target: "rs274ngc", options: &args.options, machine: None, from_line: None, file: None };
    let made = load(&args.file, &station).and_then(|unit| {
        let a = motion(&unit, station.machine.as_ref())?.0;
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
    let b = motion_of("<translation>", text, &setup);
    let tolerance = Tolerance { length: allowed(args), rate: 1e-3, ..Tolerance::default() };
    let mut result = diff(&a.program, &b.program, &tolerance);
    if args.options.to.as_deref() == Some("grbl") {
        // grbl has no tool changes: they are stops with a remark.
        let before = result.differences.len();
        result.differences.retain(|d| !matches!(d.aspect, Aspect::Tool | Aspect::Event));
        result.count -= before - result.differences.len();
    }
    tell(global, &result, &a.sources, &b.sources)
}

/// What matters to the joint values.
const ROBOT_OPTIONS: [&str; 6] = ["--approach", "--reconfigure", "--arc-tolerance", "--job", "--compensate", "--reference"];

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

/// One unit of the last decimal that is written. With straight pieces for arcs, their tolerance too; with arcs, what
/// rounding of both ends and the centre makes of them at most: half a unit in each coordinate moves the centre by 0.71
/// units and each radius by 1.42, and a helix has its own half in depth.
fn allowed(args: &VerifyArgs) -> f64 {
    let o = &args.options;
    let inch = o.units == Some(UnitArg::Inch);
    let fanuc = o.to.as_deref().is_some_and(|t| !t.starts_with("linuxcnc"));
    let decimals = o.decimals.unwrap_or(4 + usize::from(inch) - usize::from(fanuc)) as i32;
    let unit = 10_f64.powi(-decimals) * if inch { 25.4 } else { 1.0 };
    let pieces = o.arcs == Some(crate::emit::ArcsArg::Lines) || o.plane == Some(crate::emit::PlaneArg::Xy);
    let curve = if pieces { o.arc_tolerance.unwrap_or(0.001) } else { 1.25 * unit };
    (unit + curve).max(1e-6)
}
