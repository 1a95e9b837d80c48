//! `gcc-robot accuracy part.p21 --machine usp/2ups-prp`

use std::fmt::Write as _;
use std::path::Path;

use gr_accuracy::material::{self, Material};
use gr_accuracy::report::{CutData, Operations, Report, Row, report};
use gr_accuracy::{Budget, BudgetOptions};
use gr_ir::{Source, Sources as _};
use gr_machine::Machine;
use gr_machine::math::{Frame, norm};
use gr_planner::process::{Element, OperationKind, Process, Workingstep};
use gr_text::{Diagnostic, FileId, Severity, Span, code};
use serde_json::json;

use super::check::{Checked, show};
use crate::emit::tool_rows;
use crate::exit::Exit;
use crate::options::{AccuracyArgs, AccuracyReference, Global, LintArgs, TableFormat};
use crate::pipeline::{Motion, Unit, load, motion};
use crate::progress::Progress;
use crate::setup::station;
use crate::sources::Sources;

/// Three numbers with commas between them.
pub fn triple(text: &str) -> Option<[f64; 3]> {
    let all: Option<Vec<f64>> = text.split(',').map(|t| t.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    all?.try_into().ok()
}

/// The machine of a publication, where it is asked for.
pub fn referenced(machine: Machine, reference: Option<AccuracyReference>) -> Machine {
    match reference {
        Some(AccuracyReference::Usp2009) => gr_machine::as_published(&machine),
        None => machine,
    }
}

pub fn run(global: &Global, args: &AccuracyArgs) -> Exit {
    let mut renderer = global.renderer(args.output.is_none());
    let mut sources = Sources::default();
    let refuse = |what: &str, why: &str| {
        super::refuse(global, &args.file, code::ACCURACY_BAD_OPTION, &[what.to_string(), why.to_string()])
    };
    let Some(station) = station(&args.setup, &LintArgs::default(), Path::new("."), &mut sources, &mut renderer) else {
        renderer.finish(false);
        return Exit::Findings;
    };
    let Some(machine) = station.machine.clone() else {
        return refuse("accuracy", "it needs a machine: `--machine`, or `machine` in gcc-robot.toml");
    };
    let machine = referenced(machine, args.reference);
    let part = match &args.part {
        None => None,
        Some(text) => match triple(text) {
            Some(p) => Some(Frame::shift(p)),
            None => return refuse("--part", "three numbers are wanted, such as 700,-50,0"),
        },
    };
    let progress = Progress::new(global.quiet, format!("looking at {}", args.file.display()));
    let unit = load(&args.file, &station);
    let done = unit.and_then(|unit| {
        let (motion, checked) = motion(&unit, Some(&machine))?;
        Ok((unit, motion, checked))
    });
    let (unit, motion, checked) = match done {
        Ok(done) => done,
        Err(checked) => {
            drop(progress);
            show(&mut renderer, &checked);
            renderer.finish(false);
            return if checked.unreadable { Exit::Io } else { Exit::Findings };
        }
    };
    let result = predict(args, &unit, &motion, &machine, part, &progress);
    drop(progress);
    show(&mut renderer, &checked);
    let (made, found) = match result {
        Ok((made, found)) => (Some(made), found),
        Err(found) => (None, found),
    };
    show(&mut renderer, &Checked { sources: motion.sources, found, more: 0, unreadable: false });
    let mut exit = if made.is_some() { Exit::Ok } else { Exit::Findings };
    if let Some(text) = made {
        exit = match &args.output {
            None => super::print(&text),
            Some(goal) if goal == Path::new("-") => super::print(&text),
            Some(goal) => super::write(&mut renderer, &mut sources, &args.file, &[(goal.clone(), text.into_bytes())]),
        };
    }
    renderer.finish(false);
    exit
}

/// Where a row of the report points.
fn place(motion: &Motion, source: Source) -> (FileId, Span) {
    let texts = gr_ir::Texts::new(motion.sources.iter().map(|(id, f)| (id, &*f.text)));
    texts.place(source)
}

fn predict(
    args: &AccuracyArgs,
    unit: &Unit,
    motion: &Motion,
    machine: &Machine,
    part: Option<Frame>,
    progress: &Progress,
) -> Result<(String, Vec<Diagnostic>), Vec<Diagnostic>> {
    let process = unit.exchange.then(|| crate::exchange::process(unit).ok().map(|(p, _, _)| p)).flatten();
    let mut operations = Operations::new(&motion.program);
    cutting(&mut operations, args, unit, motion, process.as_ref());
    let global = process.as_ref().and_then(|p| p.workpieces.iter().find_map(|w| w.tolerance)).filter(|t| *t > 0.0);
    operations.list.iter_mut().for_each(|o| o.tolerance = args.tolerance.or(o.tolerance).or(global));
    let top = (FileId(0), Span::default());
    let say = |code, args: &[String]| Diagnostic::new(code, top.0, top.1, args);
    let wanted = args.material.clone().or_else(|| process.as_ref().and_then(|p| p.workpieces.iter().map(|w| w.material.clone()).find(|m| !m.is_empty())));
    let found_material = wanted.as_deref().map(|name| (name, material::find(name)));
    let mut found = Vec::new();
    let material = match found_material {
        Some((name, None)) => {
            let known: Vec<&str> = material::materials().iter().filter_map(|m| m.names.first().map(String::as_str)).collect();
            let list = format!("known are {}", known.join(", "));
            let mut d = say(code::ACCURACY_UNKNOWN_MATERIAL, &[name.to_string(), list]);
            if args.material.is_some() {
                return Err(vec![d]);
            }
            // A material that only the file names leaves the deflection out, and nothing else.
            d.severity = Severity::Warning;
            found.push(d);
            None
        }
        Some((_, m)) => m,
        None => None,
    };
    let texts = gr_ir::Texts::new(motion.sources.iter().map(|(id, f)| (id, &*f.text)));
    let options = gr_robot::Options { name: unit.name(), ..gr_robot::Options::default() };
    let mut planned_on = machine.clone();
    if let Some(part) = part {
        // Put down there, turned as the machine file has it.
        let turn = machine.cell.part_in_base().turn;
        (planned_on.cell.table, planned_on.cell.part) = (Frame::IDENTITY, Frame { turn, ..part });
    }
    tool_points(&mut found, &mut planned_on, &operations, &say);
    let planned = gr_robot::plan(&motion.program, &planned_on, &texts, &options)?;
    // What switches the spindle has no part in errors.
    // Nor has the length of a tool that the machine file does not have.
    let own_tools = !machine.cell.tools.is_empty();
    let kept = |d: &Diagnostic| d.code != code::ROBOT_BY_HAND && (own_tools || d.code != code::ROBOT_TOOL_LENGTH);
    found.extend(planned.warnings.into_iter().filter(kept));
    let budget = Budget::new(machine, BudgetOptions { grade: args.grade, usp2009: args.reference.is_some() });
    missing(&mut found, machine, &budget, &operations, material, &say);
    let tell = |done: usize, of: usize| progress.tell(|| format!("errors at step {done} of {of}"));
    let report = report(&planned.program, &operations, &budget, material, &tell);
    for row in &report.rows {
        judge(&mut found, row, material, motion);
    }
    let text = match args.format {
        TableFormat::Text => text(&report, motion, machine, material, &budget),
        TableFormat::Json => format!("{:#}\n", as_json(&report, motion, machine, material, &budget)),
        TableFormat::Csv => csv(&report, motion),
    };
    Ok((text, found))
}

/// A tool that the machine file does not have is looked at as if its point were on the flange.
pub fn tool_points(
    found: &mut Vec<Diagnostic>,
    machine: &mut Machine,
    operations: &Operations,
    say: &dyn Fn(gr_text::Code, &[String]) -> Diagnostic,
) {
    let numbers: std::collections::BTreeSet<u32> = operations.list.iter().map(|o| o.tool).collect();
    for number in numbers {
        if !machine.cell.tools.contains_key(&number) && number != 0 {
            let tool = gr_machine::ToolData { name: format!("T{number}"), frame: Frame::IDENTITY, diameter: None, mass: None };
            machine.cell.tools.insert(number, tool);
            // On a machine that only places a point, that point is the tool's.
            if machine.kinematics().control() == gr_machine::Control::Full {
                let why = format!("the machine file has no tool {number}: its point is looked at on the flange");
                found.push(say(code::ACCURACY_NO_DATA, &["the length of a tool".to_string(), why]));
            }
        }
    }
}

/// What is not known, told once each.
fn missing(
    found: &mut Vec<Diagnostic>,
    machine: &Machine,
    budget: &Budget,
    operations: &Operations,
    material: Option<&Material>,
    say: &dyn Fn(gr_text::Code, &[String]) -> Diagnostic,
) {
    let mut none = |what: &str, why: String| found.push(say(code::ACCURACY_NO_DATA, &[what.to_string(), why]));
    let id = &machine.id;
    if budget.joints.is_none() {
        none("the error by the joints", format!("the file of {id} has no `joints` in `[accuracy]`"));
    }
    if budget.geometry.is_none() {
        none("the error by the geometry", format!("the file of {id} has neither `grade` nor `parameter` in `[accuracy]`"));
    }
    if !budget.unsaid.is_empty() {
        none("a part of the geometry", format!("nothing is said of {}: taken as exact", budget.unsaid.join(", ")));
    }
    let stiff = machine.cell.stiffness.as_ref();
    let soft: Vec<&str> = (0..machine.joints.len())
        .filter(|i| stiff.is_none_or(|s| s.members.iter().all(|m| m.joint != *i)))
        .map(|i| machine.joints[i].name.as_str())
        .collect();
    let unknown: std::collections::BTreeSet<&str> = operations.list.iter().flat_map(|o| o.cut.missing()).collect();
    if !soft.is_empty() {
        none("the deflection", format!("the file of {id} has no `[stiffness]` of {}", soft.join(", ")));
    } else if material.is_none() {
        none("the deflection", "the material is not known: `--material`".to_string());
    } else if !unknown.is_empty() {
        let list: Vec<&str> = unknown.into_iter().collect();
        none("the deflection of some operations", format!("not known: {}", list.join(", ")));
    }
}

/// Whether anything at all is known of an error.
fn known(e: &gr_accuracy::Errors) -> bool {
    e.kinematic.is_some() || e.geometric.is_some() || e.elastic.is_some()
}

fn um(mm: f64) -> String {
    format!("{:.1}", mm * 1e3)
}

fn judge(found: &mut Vec<Diagnostic>, row: &Row, material: Option<&Material>, motion: &Motion) {
    let Some(worst) = &row.worst else { return };
    if let Some(limit) = row.operation.tolerance {
        over(found, row, limit, motion);
    }
    let (file, span) = place(motion, worst.source);
    if let (Some((least, most)), Some(m)) = (row.chip, material)
        && (least < m.range.0 || most > m.range.1)
    {
        let chip = if least < m.range.0 { least } else { most };
        let args = [row.operation.name.clone(), format!("{chip:.4}"), m.range.0.to_string(), m.range.1.to_string()];
        found.push(Diagnostic::new(code::ACCURACY_CHIP_THICKNESS, file, span, &args));
    }
}

/// So many stretches of one operation are told one by one.
const STRETCHES: usize = 10;

/// Every stretch that is over the tolerance, at its worst line; of many the worst.
fn over(found: &mut Vec<Diagnostic>, row: &Row, limit: f64, motion: &Motion) {
    let mut told: Vec<usize> = (0..row.over.len()).collect();
    told.sort_by(|a, b| row.over[*b].sum.total_cmp(&row.over[*a].sum));
    told.truncate(STRETCHES);
    told.sort_unstable();
    for (n, i) in told.iter().enumerate() {
        let s = &row.over[*i];
        let (file, span) = place(motion, s.worst);
        // As many digits as show that it is more.
        let close = um(s.sum) == um(limit);
        let show = |v: f64| if close { format!("{:.3}", v * 1e3) } else { um(v) };
        let args = [show(s.sum), row.operation.name.clone(), show(limit)];
        let mut d = Diagnostic::new(code::ACCURACY_OVER_TOLERANCE, file, span, &args);
        if s.first.line != s.last.line {
            d.notes.push(format!("over the tolerance from line {} to line {}", line_of(motion, s.first), line_of(motion, s.last)));
        }
        d.notes.push(format!("typical (root of squares): {} µm", um(s.rss)));
        if let (Some(w), true) = (&row.worst, row.worst.as_ref().is_some_and(|w| w.source == s.worst)) {
            d.notes.extend(most_of_it(&w.causes));
        }
        let more = row.over.len() - told.len();
        if more > 0 && n + 1 == told.len() {
            d.notes.push(format!("{more} more stretches of {} are over; these are the worst", row.operation.name));
        }
        found.push(d);
    }
}

/// What makes most of an error, in words.
fn most_of_it(causes: &[(String, f64)]) -> Option<String> {
    let list: Vec<String> = causes.iter().map(|(name, v)| format!("{name} {}", um(*v))).collect();
    (!list.is_empty()).then(|| format!("most of it, each alone: {} µm", list.join(", ")))
}

/// How each operation cuts: the file's word, then the tool table's, then the options'.
fn cutting(operations: &mut Operations, args: &AccuracyArgs, unit: &Unit, motion: &Motion, process: Option<&Process>) {
    let said = CutData { diameter: args.diameter, teeth: args.teeth, depth: args.depth, width: args.width };
    let tools = tool_rows(motion, unit);
    let mut steps = Vec::new();
    if let Some(p) = process {
        p.elements.iter().for_each(|e| collect(e, &mut steps));
    }
    for o in &mut operations.list {
        let step = steps.iter().find(|s| o.workingstep != 0 && i32::try_from(s.origin.id) == Ok(o.workingstep));
        let own = step.map_or(CutData::default(), |s| of_step(s));
        o.tolerance = step.and_then(|s| s.feature.tolerance);
        let row = tools.iter().find(|t| i64::from(t.number) == i64::from(o.tool) && t.diameter > 0.0);
        let table = CutData { diameter: row.map(|t| t.diameter), ..CutData::default() };
        o.cut = own.or(table).or(said);
    }
}

fn collect<'p>(element: &'p Element, out: &mut Vec<&'p Workingstep>) {
    match element {
        Element::Step(s) => out.push(s),
        Element::Plan(p) => p.elements.iter().for_each(|e| collect(e, out)),
        _ => {}
    }
}

fn of_step(step: &Workingstep) -> CutData {
    let tool = &step.operation.tool;
    let mut cut = CutData {
        diameter: Some(tool.diameter).filter(|d| *d > 0.0),
        teeth: tool.teeth.map(f64::from),
        ..CutData::default()
    };
    if let OperationKind::Mill(m) = &step.operation.kind {
        cut.depth = m.axial;
        cut.width = m.radial.or(cut.diameter);
    }
    cut
}

const RULES: &str = "sum = longest kinematic + longest geometric + deflection; rss = root of the squares of the typical ones and the deflection";
const DOUBT: &str = "deflection: springs of the drives only; the model of its source was never confirmed by better than a factor of 2";

fn line_of(motion: &Motion, source: Source) -> String {
    let name = motion.sources.get(source.file).map_or("", |f| &f.name);
    if source.file == FileId(0) { format!("{}", source.line + 1) } else { format!("{name}:{}", source.line + 1) }
}

fn text(report: &Report, motion: &Motion, machine: &Machine, material: Option<&Material>, budget: &Budget) -> String {
    let mut out = format!("{}: predicted errors of the tool point, plus or minus, µm\n", machine.id);
    if let Some(a) = &machine.cell.accuracy {
        let _ = writeln!(out, "accuracy: {}", a.source);
    }
    if let (Some(s), Some(m)) = (&machine.cell.stiffness, material) {
        let _ = writeln!(out, "stiffness: {}\nmaterial: {}, {}", s.source, m.title, m.source);
    }
    let show = |v: Option<f64>| v.map_or("-".to_string(), um);
    let head = ["operation", "tool", "line", "kinematic", "geometric", "elastic", "sum", "rss", "tolerance", ""];
    let mut rows = vec![head.map(String::from)];
    for r in &report.rows {
        let Some(w) = &r.worst else { continue };
        let over = r.operation.tolerance.is_some_and(|t| w.errors.sum() > t);
        rows.push([
            r.operation.name.clone(),
            format!("T{}", r.operation.tool),
            line_of(motion, w.source),
            show(r.most[0]),
            show(r.most[1]),
            show(r.most[2]),
            show(known(&w.errors).then(|| w.errors.sum())),
            show(known(&w.errors).then(|| w.errors.root_of_squares())),
            show(r.operation.tolerance),
            if over { "over".into() } else { String::new() },
        ]);
    }
    let width = |i: usize| rows.iter().map(|r| r[i].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    out.push('\n');
    for r in &rows {
        let cells: Vec<String> = r
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(i, (c, w))| if i == 0 { format!("{c:<w$}") } else { format!("{c:>w$}") })
            .collect();
        let _ = writeln!(out, "{}", cells.join("  ").trim_end());
    }
    let worst = report.rows.iter().filter_map(|r| r.worst.as_ref().map(|w| (w, r))).max_by(|a, b| a.0.errors.sum().total_cmp(&b.0.errors.sum()));
    if let Some((w, r)) = worst.filter(|(w, _)| known(&w.errors)) {
        let axis = |i: usize| {
            let sum = w.errors.kinematic.map_or(0.0, |s| s.worst[i])
                + w.errors.geometric.map_or(0.0, |s| s.worst[i])
                + w.errors.elastic.map_or(0.0, |e| e[i].abs());
            um(sum)
        };
        let [x, y, z] = w.point;
        let _ = writeln!(
            out,
            "\nlargest: {} µm in {} at line {}, tool point {x:.3} {y:.3} {z:.3} in the base; X {} Y {} Z {} µm at most",
            um(w.errors.sum()),
            r.operation.name,
            line_of(motion, w.source),
            axis(0),
            axis(1),
            axis(2)
        );
        if let Some(text) = most_of_it(&w.causes) {
            let _ = writeln!(out, "{text}");
        }
    }
    let _ = writeln!(out, "{RULES}");
    if report.rows.iter().any(|r| r.most[2].is_some()) {
        let _ = writeln!(out, "{DOUBT}");
    }
    if !budget.unsaid.is_empty() {
        let _ = writeln!(out, "taken as exact: {}", budget.unsaid.join(", "));
    }
    out
}

fn as_json(report: &Report, motion: &Motion, machine: &Machine, material: Option<&Material>, budget: &Budget) -> serde_json::Value {
    let rows: Vec<_> = report
        .rows
        .iter()
        .map(|r| {
            let worst = r.worst.as_ref().map(|w| {
                let spread = |s: gr_accuracy::Spread| json!({ "worst": s.worst, "rss": s.rss, "longest": s.longest, "typical": s.typical });
                json!({
                    "file": motion.sources.get(w.source.file).map(|f| f.name.clone()),
                    "line": w.source.line + 1,
                    "point": w.point,
                    "kinematic": w.errors.kinematic.map(spread),
                    "geometric": w.errors.geometric.map(spread),
                    "elastic": w.errors.elastic,
                    "sum": known(&w.errors).then(|| w.errors.sum()),
                    "rss": known(&w.errors).then(|| w.errors.root_of_squares()),
                    "causes": w.causes.iter().map(|(name, v)| json!({ "name": name, "moves": v })).collect::<Vec<_>>(),
                })
            });
            let over: Vec<_> = r.over.iter().map(|s| json!({ "from": s.first.line + 1, "to": s.last.line + 1, "line": s.worst.line + 1, "sum": s.sum, "rss": s.rss })).collect();
            json!({
                "operation": r.operation.name, "tool": r.operation.tool, "places": r.places,
                "tolerance": r.operation.tolerance, "most": r.most, "worst": worst, "over": over,
            })
        })
        .collect();
    json!({
        "machine": machine.id, "unit": "mm", "rules": RULES, "doubt": DOUBT,
        "accuracy_source": machine.cell.accuracy.as_ref().map(|a| a.source.clone()),
        "stiffness_source": machine.cell.stiffness.as_ref().map(|s| s.source.clone()),
        "material": material.map(|m| m.id.clone()), "taken_as_exact": budget.unsaid, "operations": rows,
    })
}

fn csv(report: &Report, motion: &Motion) -> String {
    let mut out = String::from("operation,tool,line,kinematic mm,geometric mm,elastic mm,sum mm,rss mm,tolerance mm\n");
    let show = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:.9}"));
    for r in &report.rows {
        let Some(w) = &r.worst else { continue };
        let name = r.operation.name.replace('"', "\"\"");
        let _ = writeln!(
            out,
            "\"{name}\",{},{},{},{},{},{},{},{}",
            r.operation.tool,
            line_of(motion, w.source),
            show(w.errors.kinematic.map(|s| s.longest)),
            show(w.errors.geometric.map(|s| s.longest)),
            show(w.errors.elastic.map(norm)),
            show(known(&w.errors).then(|| w.errors.sum())),
            show(known(&w.errors).then(|| w.errors.root_of_squares())),
            show(r.operation.tolerance)
        );
    }
    out
}
