//! `gcc-robot accuracy part.p21 --machine usp/2ups-prp`

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use gr_accuracy::material::{self, Material};
use gr_accuracy::map::{DOUBT, turns_part};
use gr_accuracy::report::{BeyondLaw, CutData, Lack, Operations, Report, Row, Stretch, Unforced, Work, report, report_of_words};
use gr_accuracy::{Budget, BudgetOptions, put_down, unplaced};
use gr_ir::{Source, Sources as _};
use gr_machine::{Kind, Machine};
use gr_machine::math::{Frame, norm};
use gr_planner::process::{Element, OperationKind, Origin, Process, Workingstep};
use gr_text::{Diagnostic, FileId, Severity, Span, code};
use serde_json::json;

use super::check::{Checked, show};
use crate::emit::tool_rows;
use crate::exit::Exit;
use crate::options::{AccuracyArgs, AccuracyReference, Global, LintArgs, TableFormat};
use crate::pipeline::{Motion, Unit, load, motion};
use crate::progress::Progress;
use crate::setup::{beside, station};
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
    let Some(station) = station(&args.setup, &LintArgs::default(), beside(&args.file), &mut sources, &mut renderer) else {
        renderer.finish(false);
        return renderer.failed();
    };
    let Some(machine) = station.machine.clone() else {
        return refuse("accuracy", "it needs a machine: `--machine`, or `machine` in gcc-robot.toml");
    };
    let doubled = || super::map::graded(args.grade, args.deviations.as_deref()).err();
    if let Some((what, why)) = senseless(args).or_else(|| misfit(&machine, args.reference, args.grade)).or_else(doubled) {
        return refuse(&what, &why);
    }
    let machine = referenced(machine, args.reference);
    let known = match args.deviations.as_deref().map(|text| super::map::deviations(text, &machine)).transpose() {
        Ok(known) => known,
        Err(why) => return refuse("--deviations", &why),
    };
    let budget = Budget::new(&machine, BudgetOptions { grade: args.grade, usp2009: args.reference.is_some() }).with_known(&machine, known);
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
    let result = predict(args, &unit, &motion, &machine, &budget, part, &progress).and_then(|(text, found, of)| {
        let Some(goal) = &args.map else { return Ok(((text, Vec::new()), found)) };
        match super::map::beside(global, &machine, &budget, of.as_ref(), goal) {
            Ok(files) => Ok(((text, files), found)),
            Err((what, why)) => Err(vec![Diagnostic::new(code::ACCURACY_BAD_OPTION, FileId(0), Span::default(), &[what, why])]),
        }
    });
    drop(progress);
    show(&mut renderer, &checked);
    let (made, found) = match result {
        Ok((made, found)) => (Some(made), found),
        Err(found) => (None, found),
    };
    show(&mut renderer, &Checked { sources: motion.sources, found, ..Checked::nothing() });
    let mut exit = if made.is_some() { Exit::Ok } else { Exit::Findings };
    if let Some((text, files)) = made {
        let mut files = files;
        let printed = match &args.output {
            Some(goal) if goal != Path::new("-") => {
                files.push((goal.clone(), text.into_bytes()));
                None
            }
            _ => Some(text),
        };
        if !files.is_empty() {
            exit = super::write(&mut renderer, &mut sources, &args.file, &files);
        }
        if let (Some(text), Exit::Ok) = (printed, exit) {
            exit = super::print(&text);
        }
    }
    renderer.finish(false);
    exit
}

/// More teeth than any tool has.
const MOST_TEETH: f64 = 1000.0;

/// An option whose number no tool and no part can have.
fn senseless(args: &AccuracyArgs) -> Option<(String, String)> {
    let above_zero = [
        ("--tolerance", args.tolerance),
        ("--depth", args.depth),
        ("--width", args.width),
        ("--diameter", args.diameter),
    ];
    let wrong = |(name, v): (&str, Option<f64>)| {
        let v = v.filter(|v| !(*v > 0.0 && v.is_finite()))?;
        Some((name.to_string(), format!("a length above zero is wanted, not {v}")))
    };
    let teeth = args.teeth.filter(|t| !(*t >= 1.0 && *t <= MOST_TEETH && t.fract() == 0.0));
    let point = args.point.filter(|p| !(*p > 10.0 && *p <= 180.0));
    above_zero
        .into_iter()
        .find_map(wrong)
        .or_else(|| teeth.map(|t| ("--teeth".to_string(), format!("a tool has one tooth or more, and whole ones, not {t}"))))
        .or_else(|| {
            let wider = args.width.zip(args.diameter).filter(|(w, d)| w > d);
            wider.map(|(w, d)| ("--width".to_string(), format!("a tool of {d} mm does not cut {w} mm wide")))
        })
        .or_else(|| point.map(|p| ("--point".to_string(), format!("a point angle is between 10° and 180°, such as 118, not {p}"))))
}

/// A machine that the publication is not about, or a grade that it has no formula for.
pub fn misfit(machine: &Machine, reference: Option<AccuracyReference>, grade: Option<u8>) -> Option<(String, String)> {
    reference?;
    if machine.published.is_none() || !matches!(machine.chain, gr_machine::Chain::TwoLegs(_)) {
        let why = format!("the publication is about a 2UPS+PRP machine, and the file of {} has no `[reference]` of one", machine.id);
        return Some(("--reference usp2009".into(), why));
    }
    let grade = grade.filter(|g| ![3, 5, 7].contains(g))?;
    Some((format!("--it {grade}"), "the publication has formulas for the grades 3, 5 and 7 only; leave out `--reference` or take one of them".into()))
}

/// Where a row of the report points.
fn place(motion: &Motion, source: Source) -> (FileId, Span) {
    let texts = gr_ir::Texts::new(motion.sources.iter().map(|(id, f)| (id, &*f.text)));
    texts.place(source)
}

/// What the map beside a report is of: the place of the largest error.
pub struct Beside {
    /// Tool point in the base, mm.
    pub point: [f64; 3],
    /// Joints there.
    pub joints: Vec<f64>,
    /// The tool's name, and its point on the flange.
    pub tool: (String, Frame),
    /// Line of the program.
    pub line: String,
    /// What moves the tool point at the program's zero, where errors count from there.
    pub zero: Option<gr_accuracy::Sensitivity>,
}

fn predict(
    args: &AccuracyArgs,
    unit: &Unit,
    motion: &Motion,
    machine: &Machine,
    budget: &Budget,
    part: Option<Frame>,
    progress: &Progress,
) -> Result<(String, Vec<Diagnostic>, Option<Beside>), Vec<Diagnostic>> {
    let process = unit.exchange.then(|| crate::exchange::process(unit).ok().map(|(p, _, _)| p)).flatten();
    let mut operations = Operations::new(&motion.program);
    let Cutting { fits, stated } = cutting(&mut operations, args, (unit, machine), motion, process.as_ref());
    let global = process.as_ref().and_then(|p| p.workpieces.iter().find_map(|w| w.tolerance)).filter(|t| *t > 0.0);
    operations.list.iter_mut().for_each(|o| o.tolerance = args.tolerance.or(o.tolerance).or(global));
    let top = (FileId(0), Span::default());
    let say = |code, args: &[String]| Diagnostic::new(code, top.0, top.1, args);
    let workpieces = process.as_ref().map_or(&[][..], |p| &p.workpieces);
    let stated_material = workpieces.iter().find(|w| !w.material.is_empty());
    let wanted = args.material.clone().or_else(|| stated_material.map(|w| w.material.clone()));
    let found_material = wanted.as_deref().map(|name| (name, material::find(name)));
    let mut found = Vec::new();
    if args.tolerance.is_none() {
        found.extend(unread(fits));
    }
    too_wide(args, &operations)?;
    let material = match found_material {
        Some((name, None)) => {
            let known: Vec<&str> = material::materials().iter().filter_map(|m| m.names.first().map(String::as_str)).collect();
            let list = format!("known are {}", known.join(", "));
            let told = [name.to_string(), list];
            if args.material.is_some() {
                return Err(vec![say(code::ACCURACY_UNKNOWN_MATERIAL, &told)]);
            }
            // A material that only the file names leaves the deflection out, and nothing else.
            let at = stated_material.and_then(|w| w.material_at).map_or(top, |o| (FileId(0), o.span));
            let mut d = Diagnostic::new(code::ACCURACY_UNKNOWN_MATERIAL, at.0, at.1, &told);
            d.severity = Severity::Warning;
            found.push(d);
            None
        }
        Some((_, m)) => m,
        None => None,
    };
    let texts = gr_ir::Texts::new(motion.sources.iter().map(|(id, f)| (id, &*f.text)));
    let options = gr_robot::Options { name: unit.name(), ..gr_robot::Options::default() };
    // Put down there, turned as the machine file has it.
    let mut planned_on = match part {
        Some(part) => put_down(machine, Frame { turn: machine.cell.part_in_base().turn, ..part }),
        None => machine.clone(),
    };
    tool_points(&mut found, &mut planned_on, &motion.program, &say);
    found.extend(unsaid(machine, budget).into_iter().map(|args| say(code::ACCURACY_NO_DATA, &args)));
    let unsaid_at = workpieces.first().map_or(top, |w| (FileId(0), w.material_at.unwrap_or(w.origin).span));
    missing(&mut found, machine, &operations, material, (top, unsaid_at), &|n, of_tool| match stated.get(n).copied().flatten() {
        Some(s) => (FileId(0), if of_tool { s.tool } else { s.operation }.span),
        None => operations.list.get(n).map_or(top, |o| place(motion, o.first)),
    });
    let tell = |done: usize, of: usize| progress.tell(|| format!("errors at step {done} of {of}"));
    let report = match report_of_words((&motion.program, &texts), &planned_on, &operations, budget, material, &tell) {
        Some(report) => report,
        None => {
            let planned = gr_robot::plan(&motion.program, &planned_on, &texts, &options)?;
            // What switches the spindle has no part in errors.
            let kept = |d: &Diagnostic| d.code != code::ROBOT_BY_HAND;
            found.extend(planned.warnings.into_iter().filter(kept));
            report(&planned.program, &operations, budget, material, &tell)
        }
    };
    // Without a place of the part nobody knows where its zero was touched.
    let strange = gr_robot::opinion::missing_axes(&motion.program, machine, &texts);
    if !strange.is_empty() {
        return Err(strange);
    }
    let placed = args.part.is_some() || machine.cell.part_in_base() != gr_machine::math::Frame::IDENTITY;
    for (source, joint, value) in report.outside.iter().filter(|_| placed) {
        let (file, span) = place(motion, *source);
        found.extend(beyond(machine, *joint, *value, file, span));
    }
    if found.iter().any(|d| d.code == code::ROBOT_JOINT_LIMIT) {
        return Err(found);
    }
    for row in &report.rows {
        judge(&mut found, row, material, motion);
        lawless(&mut found, row, machine, motion);
        if let Some((off, source)) = row.measured.filter(|_| budget.known.is_none()) {
            let (file, span) = place(motion, source);
            let why = format!("up to {} µm in {}, here, unless the program is built with `--compensate`", um(off), row.operation.name);
            found.push(Diagnostic::new(code::ACCURACY_NO_DATA, file, span, &["the error by the measured deviations".to_string(), why]));
        }
    }
    // Down the program.
    found.sort_by_key(|d| d.labels.first().map(|l| (l.file.0, l.span.start)));
    let text = match args.format {
        TableFormat::Text => text(&report, motion, machine, material, budget, args),
        TableFormat::Json => format!("{:#}\n", as_json(&report, motion, machine, material, budget, args)),
        TableFormat::Csv => csv(&report, motion),
    };
    let worst = report.rows.iter().filter_map(|r| r.worst.as_ref().map(|w| (w, r))).max_by(|a, b| a.0.errors.sum().total_cmp(&b.0.errors.sum()));
    let beside = worst.map(|(w, r)| Beside {
        point: w.point,
        joints: w.joints.clone(),
        tool: (format!("T{}", r.operation.tool), w.tool),
        line: line_of(motion, w.source),
        zero: w.zero.as_deref().cloned(),
    });
    Ok((text, found, beside))
}

/// A joint beyond its limit.
pub fn beyond(machine: &Machine, joint: usize, value: f64, file: FileId, span: Span) -> Option<Diagnostic> {
    let j = machine.joints.get(joint)?;
    let bound = if j.max.is_some_and(|m| value > m) { j.max } else { j.min };
    let told = [j.name.clone(), j.show(value), bound.map_or(String::new(), |b| j.show(b))];
    Some(Diagnostic::new(code::ROBOT_JOINT_LIMIT, file, span, &told))
}

/// Fits that can't be read, each with the operations that it is of.
fn unread(fits: Vec<(String, Origin)>) -> Vec<Diagnostic> {
    let mut by_fit: Vec<(Origin, Vec<String>)> = Vec::new();
    for (operation, fit) in fits {
        match by_fit.iter_mut().find(|f| f.0 == fit) {
            Some(f) => f.1.push(operation),
            None => by_fit.push((fit, vec![operation])),
        }
    }
    let one = |(fit, operations): (Origin, Vec<String>)| {
        let names: Vec<&str> = operations.iter().map(String::as_str).collect();
        let why = "PLUS_MINUS_VALUE needs a limit above 0; a `grade` of LIMITS_AND_FITS is the width of the band, a length above 0 and below 1 mm; the number of a grade is not read. `--tolerance` says what is allowed";
        let what = [format!("the tolerance #{} of {}", fit.id, listed(&names)), why.to_string()];
        Diagnostic::new(code::ACCURACY_NO_DATA, FileId(0), fit.span, &what)
    };
    by_fit.into_iter().map(one).collect()
}

/// A width of cut that no mill of the program has is refused.
fn too_wide(args: &AccuracyArgs, operations: &Operations) -> Result<(), Vec<Diagnostic>> {
    let Some(width) = args.width else { return Ok(()) };
    let mills = operations.list.iter().enumerate().filter(|(i, o)| operations.works(*i).contains(&Work::Mill) && o.cut.width == Some(width));
    let widest = mills.filter_map(|(_, o)| Some((o.cut.diameter?, o.tool))).max_by(|a, b| a.0.total_cmp(&b.0));
    match widest.filter(|(d, _)| width > *d) {
        None => Ok(()),
        Some((d, tool)) => {
            let why = format!("the widest mill of the program, T{tool}, has {d} mm and does not cut {width} mm wide");
            Err(vec![Diagnostic::new(code::ACCURACY_BAD_OPTION, FileId(0), Span::default(), &["--width".to_string(), why])])
        }
    }
}

/// A tool that the machine file does not have and whose length the program never uses is looked at as if its point were
/// on the flange. Where the program uses a length, the plan is the one that a build would take.
pub fn tool_points(
    found: &mut Vec<Diagnostic>,
    machine: &mut Machine,
    program: &gr_ir::Program,
    say: &dyn Fn(gr_text::Code, &[String]) -> Diagnostic,
) {
    let mut numbers: std::collections::BTreeMap<u32, bool> = std::collections::BTreeMap::new();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if view.op.moves() {
            let number = u32::try_from(view.state.tool).unwrap_or(0);
            *numbers.entry(number).or_default() |= view.state.tool_offset[2] != 0.0;
        }
    }
    let lever = machine.kinematics().control() != gr_machine::Control::Position;
    let without = numbers.into_iter().filter(|(number, long)| !long && *number != 0).map(|(number, _)| number);
    for number in without {
        if machine.cell.tools.contains_key(&number) {
            continue;
        }
        let tool = gr_machine::ToolData { name: format!("T{number}"), frame: Frame::IDENTITY, diameter: None, mass: None };
        machine.cell.tools.insert(number, tool);
        // On a machine that only places a point, that point is the tool's.
        if lever {
            let why = format!("neither the machine file nor the program has the length of tool {number}: its point is looked at on the flange");
            found.push(say(code::ACCURACY_NO_DATA, &["the length of a tool".to_string(), why]));
        }
    }
}

/// What a machine file does not say of joints and geometry: what is left out, and why.
pub fn unsaid(machine: &Machine, budget: &Budget) -> Vec<[String; 2]> {
    let mut out = Vec::new();
    let mut none = |what: &str, why: String| out.push([what.to_string(), why]);
    let id = &machine.id;
    if budget.joints.is_none() {
        none("the error by the joints", format!("the file of {id} has no `joints` in `[accuracy]`"));
    }
    let unplaced: Vec<&str> = (0..machine.joints.len()).filter(|j| unplaced(machine, *j)).map(|j| machine.joints[j].name.as_str()).collect();
    if !unplaced.is_empty() && (budget.joints.is_some() || budget.tells_geometry()) {
        let why = format!("a `cartesian` machine's file has no key for where its axis is, so nobody knows what it moves on the part: taken as exact (`five-axis` has such keys)");
        none(&format!("the error by joint {}", unplaced.join(", ")), why);
    }
    if !budget.tells_geometry() {
        none("the error by the geometry", format!("the file of {id} has neither `parameter` nor a `grade` that fits in `[accuracy]`"));
    }
    if !budget.unsaid.is_empty() {
        none("a part of the geometry", format!("nothing is said of {}: taken as exact", budget.unsaid.join(", ")));
    }
    out
}

/// Joints of which no stiffness is known.
pub fn soft(machine: &Machine) -> Vec<&str> {
    let stiff = machine.cell.stiffness.as_ref();
    let known = |i: usize| stiff.is_some_and(|s| s.members.iter().any(|m| m.joint == i));
    machine.joints.iter().enumerate().filter(|(i, _)| !known(*i)).map(|(_, j)| j.name.as_str()).collect()
}

/// So many places that lack a number are told one by one.
const LACKING: usize = 10;

/// Why there is no deflection: what the machine lacks at the top, the material at `unsaid_at`; what an operation lacks where its tool
/// or itself is stated, those that lack the same at the same place together.
fn missing(
    found: &mut Vec<Diagnostic>,
    machine: &Machine,
    operations: &Operations,
    material: Option<&Material>,
    (top, unsaid_at): (Place, Place),
    stated: &dyn Fn(usize, bool) -> Place,
) {
    let none = |(file, span): Place, what: &str, why: String| Diagnostic::new(code::ACCURACY_NO_DATA, file, span, &[what.to_string(), why]);
    let soft = soft(machine);
    if !soft.is_empty() {
        found.push(none(top, "the deflection", format!("the file of {} has no `[stiffness]` of {}", machine.id, soft.join(", "))));
        return;
    }
    // Of turning no material gives a force.
    let turning = |n: usize| operations.works(n).iter().all(|w| *w == Work::Turn);
    if !operations.list.is_empty() && (0..operations.list.len()).all(turning) {
        return;
    }
    if material.is_none() {
        found.push(none(unsaid_at, "the deflection", "the material is not known: `--material`".to_string()));
        return;
    }
    let mut groups: Vec<Lacking> = Vec::new();
    for (n, operation) in operations.list.iter().enumerate() {
        let lacks: BTreeSet<Lack> = operations.works(n).into_iter().flat_map(|w| operation.cut.missing(w)).collect();
        for of_tool in [true, false] {
            let lacks: Vec<&str> = lacks.iter().filter(|l| l.of_tool == of_tool).map(|l| l.what).collect();
            if lacks.is_empty() {
                continue;
            }
            let at = stated(n, of_tool);
            // In G-code nothing states them: those that lack the same are told at the first.
            let same = |g: &&mut Lacking| g.lacks == lacks && (g.at == at || operation.workingstep == 0);
            match groups.iter_mut().find(same) {
                Some(group) => group.names.push(&operation.name),
                None => groups.push(Lacking { at, lacks, names: vec![&operation.name] }),
            }
        }
    }
    let more: usize = groups.iter().skip(LACKING).map(|g| g.names.len()).sum();
    groups.truncate(LACKING);
    let last = groups.len();
    for (n, group) in groups.into_iter().enumerate() {
        let mut d = none(group.at, &format!("the deflection of {}", listed(&group.names)), format!("not known: {}", group.lacks.join(", ")));
        if more > 0 && n + 1 == last {
            d.notes.push(format!("{more} more operations lack some of it"));
        }
        found.push(d);
    }
}

/// A file and a place in it.
type Place = (FileId, Span);

/// Operations that lack the same numbers, told at one place.
struct Lacking<'a> {
    at: Place,
    lacks: Vec<&'static str>,
    names: Vec<&'a str>,
}

/// So many names are told.
const NAMED: usize = 3;

/// Names of operations; of many the first.
fn listed(names: &[&str]) -> String {
    let more = names.len().saturating_sub(NAMED);
    let more_of_them = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{more_of_them}", names[..names.len() - more].join(", "))
}

/// Whether anything at all is known of an error.
fn known(e: &gr_accuracy::Errors) -> bool {
    e.kinematic.is_some() || e.geometric.is_some() || e.elastic.is_some()
}

fn um(mm: f64) -> String {
    format!("{:.1}", mm * 1e3)
}

fn judge(found: &mut Vec<Diagnostic>, row: &Row, material: Option<&Material>, motion: &Motion) {
    if let Some(limit) = row.operation.tolerance {
        over(found, row, limit, motion);
    }
    if let Some(m) = material {
        found.extend(beyond_law(row, m, motion));
    }
}

/// So many lines of one operation are named.
const LINES: usize = 12;

/// The validity of the force law, told once for an operation: at the place that its row is of, else where the deflection by such a chip
/// is largest; all other lines with such chips by number.
fn beyond_law(row: &Row, material: &Material, motion: &Motion) -> Option<Diagnostic> {
    let mut all: Vec<&BeyondLaw> = row.beyond_law.values().collect();
    all.sort_by(|a, b| b.deflection.total_cmp(&a.deflection));
    let worst = row.worst.as_ref().and_then(|w| Some((w.source, w.beyond_law?, norm(w.errors.elastic?))));
    let (source, chip, deflection) = worst.or_else(|| all.first().map(|b| (b.source, b.chip, b.deflection)))?;
    let thick = |h: f64| if h >= 1.0 { format!("{h:.1}") } else { format!("{h:.4}") };
    let (file, span) = place(motion, source);
    let (least, most) = material.range;
    let args = [row.operation.name.clone(), thick(chip), least.to_string(), most.to_string()];
    let mut d = Diagnostic::new(code::ACCURACY_CHIP_THICKNESS, file, span, &args);
    let whose = if worst.is_some() { "the deflection of the row" } else { "the largest deflection by such chips" };
    d.notes.push(format!("{whose}, {} µm, is from here", um(deflection)));
    all.retain(|b| (b.source.file, b.source.line) != (source.file, source.line));
    let more = all.len().saturating_sub(LINES);
    all.truncate(LINES);
    all.sort_by_key(|b| (b.source.file.0, b.source.line));
    let one = |b: &&BeyondLaw| format!("line {} ({} mm)", line_of(motion, b.source), thick(b.chip));
    let mut lines: Vec<String> = all.iter().map(one).collect();
    lines.extend((more > 0).then(|| format!("{more} more lines with less deflection")));
    if !lines.is_empty() {
        d.notes.push(format!("too thin or too thick for the law as well: {}", lines.join(", ")));
    }
    Some(d)
}

/// Places whose force no law gives, though all that is asked for is known.
fn lawless(found: &mut Vec<Diagnostic>, row: &Row, machine: &Machine, motion: &Motion) {
    if !soft(machine).is_empty() {
        return;
    }
    for (source, why) in &row.unforced {
        let why = match why {
            Unforced::Axial => "the tool is fed along its axis, and the force law is that of milling across it (a drill is known by its cycle: G73 G81 G82 G83)",
            Unforced::Turned => "the part turns, and the force law is that of milling and drilling, not of turning, whose force is along the cut of the turning part",
            Unforced::NoLaw => "the force law is that of milling and drilling, not of centre drilling, tapping, threading, boring, reaming and countersinking",
            Unforced::Across => "a drill is fed another way than along its axis, and the law of its thrust is that along it",
            Unforced::Turning => "only rotary axes move: the tool turns about its point, which stays where it is on the part, and no force law is about that",
            Unforced::TooWide => "the width of cut is more than the diameter of the tool",
            Unforced::NoSpeed => "no turns per minute are known: no S, a spindle that is stopped, or a surface speed",
        };
        let (file, span) = place(motion, *source);
        let args = [format!("the deflection of {} here and at places like this", row.operation.name), why.to_string()];
        found.push(Diagnostic::new(code::ACCURACY_NO_DATA, file, span, &args));
    }
}

/// Stretches whose worst place is the same line are one: passes of a loop. With the number of them.
fn passes(all: &[Stretch]) -> Vec<(Stretch, usize)> {
    let mut out: Vec<(Stretch, usize)> = Vec::new();
    for s in all {
        let same = |o: &&mut (Stretch, usize)| (o.0.worst.file, o.0.worst.line) == (s.worst.file, s.worst.line);
        match out.iter_mut().find(same) {
            Some((kept, count)) => {
                *count += 1;
                if s.sum > kept.sum {
                    *kept = *s;
                }
            }
            None => out.push((*s, 1)),
        }
    }
    out
}

/// So many stretches of one operation are told one by one.
const STRETCHES: usize = 10;

/// Every stretch that is over the tolerance, at its worst line; of many the worst.
fn over(found: &mut Vec<Diagnostic>, row: &Row, limit: f64, motion: &Motion) {
    let all = passes(&row.over);
    let mut told: Vec<usize> = (0..all.len()).collect();
    told.sort_by(|a, b| all[*b].0.sum.total_cmp(&all[*a].0.sum));
    told.truncate(STRETCHES);
    told.sort_unstable();
    for (n, i) in told.iter().enumerate() {
        let (s, count) = &all[*i];
        let (file, span) = place(motion, s.worst);
        // As many digits as show that it is more.
        let close = um(s.sum) == um(limit);
        let show = |v: f64| if close { format!("{:.3}", v * 1e3) } else { um(v) };
        let args = [show(s.sum), row.operation.name.clone(), show(limit)];
        let mut d = Diagnostic::new(code::ACCURACY_OVER_TOLERANCE, file, span, &args);
        if s.first.line != s.last.line {
            d.notes.push(format!("over the tolerance from line {} to line {}", line_of(motion, s.first), line_of(motion, s.last)));
        }
        if *count > 1 {
            d.notes.push(format!("{count} passes are over it here; this is the worst"));
        }
        d.notes.push(format!("typical (root of squares): {} µm", um(s.rss)));
        if let (Some(w), true) = (&row.worst, row.worst.as_ref().is_some_and(|w| w.source == s.worst)) {
            d.notes.extend(most_of_it(&w.causes));
        }
        let more = all.len() - told.len();
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

/// Instances of a STEP-NC file that say how an operation cuts.
#[derive(Clone, Copy)]
struct Stated {
    tool: Origin,
    operation: Origin,
}

/// What else a file says of its operations.
struct Cutting {
    /// Operations whose feature has a fit that can't be read, and its instance.
    fits: Vec<(String, Origin)>,
    /// Where each operation is stated.
    stated: Vec<Option<Stated>>,
}

/// How each operation cuts: the file's word, then the tool table's, the machine file's, the options'.
fn cutting(
    operations: &mut Operations,
    args: &AccuracyArgs,
    (unit, machine): (&Unit, &Machine),
    motion: &Motion,
    process: Option<&Process>,
) -> Cutting {
    let said = CutData {
        diameter: args.diameter,
        teeth: args.teeth,
        depth: args.depth,
        width: args.width,
        point: args.point.map(|p| p.to_radians() / 2.0),
        ..CutData::default()
    };
    let tools = tool_rows(motion, unit);
    let turning_dialect = unit.setup.dialect.id == "fanuc-turn";
    let (mut steps, mut fits, mut stated) = (Vec::new(), Vec::new(), Vec::new());
    if let Some(p) = process {
        p.elements.iter().for_each(|e| collect(e, &mut steps));
    }
    for o in &mut operations.list {
        let step = steps.iter().find(|s| o.workingstep != 0 && i32::try_from(s.origin.id) == Ok(o.workingstep));
        let own = step.map_or(CutData::default(), |s| of_step(s));
        o.tolerance = step.and_then(|s| s.feature.tolerance);
        fits.extend(step.and_then(|s| s.feature.fit).map(|fit| (o.name.clone(), fit)));
        let row = tools.iter().find(|t| i64::from(t.number) == i64::from(o.tool) && t.diameter > 0.0);
        let of_machine = machine.cell.tools.get(&o.tool).and_then(|t| t.diameter);
        let table = CutData { diameter: row.map(|t| t.diameter).or(of_machine), ..CutData::default() };
        o.work = step.map(|s| work_of(s));
        o.turned = machine.kind == Kind::Lathe || turning_dialect || step.is_some_and(|s| turns(&s.operation.keyword));
        o.cut = own.or(table).or(said);
        stated.push(step.map(|s| Stated { tool: s.operation.tool.origin, operation: s.operation.origin }));
    }
    Cutting { fits, stated }
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
    match &step.operation.kind {
        OperationKind::Mill(m) => {
            cut.depth = m.axial;
            cut.width = m.radial;
        }
        OperationKind::Drill(d) => {
            cut.lips = cut.teeth;
            cut.point = tool.tip_angle.filter(|a| *a > 0.1 && *a <= std::f64::consts::FRAC_PI_2);
            cut.before = d.previous.filter(|d| *d > 0.0);
        }
        OperationKind::Other => {}
    }
    cut
}

/// Whether an operation of ISO 14649 is one of turning (part 12).
fn turns(keyword: &str) -> bool {
    const TURNING: [&str; 6] = ["CONTOURING", "FACING", "GROOVING", "CUTTING_IN", "THREADING", "KNURLING"];
    TURNING.iter().any(|t| keyword.starts_with(t))
}

fn work_of(step: &Workingstep) -> Work {
    match &step.operation.kind {
        OperationKind::Mill(_) => Work::Mill,
        OperationKind::Drill(_) if matches!(step.operation.keyword.as_str(), "DRILLING" | "MULTISTEP_DRILLING") => Work::Drill,
        OperationKind::Drill(_) => Work::Other,
        OperationKind::Other => Work::Mill,
    }
}

const RULES: &str = "sum = longest kinematic + longest geometric + deflection; rss = root of the squares of the typical ones and the deflection";

/// Whose frame places and directions are of where a table turns the part.
const ON_TABLE: &str = "in the part's frame on the turned table";

/// How errors by the geometry count on a machine tool.
const TOUCHED: &str = "counted from the program's zero, which is touched on this machine";

fn line_of(motion: &Motion, source: Source) -> String {
    let name = motion.sources.get(source.file).map_or("", |f| &f.name);
    if source.file == FileId(0) { format!("{}", source.line + 1) } else { format!("{name}:{}", source.line + 1) }
}

fn text(report: &Report, motion: &Motion, machine: &Machine, material: Option<&Material>, budget: &Budget, args: &AccuracyArgs) -> String {
    let mut out = format!("{}: predicted errors of the tool point, plus or minus, µm\n", machine.id);
    if let Some(a) = &machine.cell.accuracy {
        let _ = writeln!(out, "accuracy: {}", a.source);
    }
    if let Some(text) = &args.deviations {
        let _ = writeln!(out, "geometry: by the deviations {text}");
    }
    if budget.joints.is_some() {
        let _ = writeln!(out, "joints: the error of each with that of its zero");
    }
    if report.touched.is_some() && budget.tells_geometry() {
        let _ = writeln!(out, "geometry: {TOUCHED}");
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
            show(w.errors.kinematic.map(|s| s.longest)),
            show(w.errors.geometric.map(|s| s.longest)),
            show(w.errors.elastic.map(norm)),
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
            "\nlargest: {} µm in {} at line {}, tool point {x:.3} {y:.3} {z:.3} {}; X {} Y {} Z {} µm at most",
            um(w.errors.sum()),
            r.operation.name,
            line_of(motion, w.source),
            if turns_part(machine) { ON_TABLE } else { "in the base" },
            axis(0),
            axis(1),
            axis(2)
        );
        if let Some(text) = most_of_it(&w.causes) {
            let _ = writeln!(out, "{text}");
        }
    }
    let _ = writeln!(out, "each row: where the sum is largest in the operation\n{RULES}");
    if report.rows.iter().any(|r| r.most[2].is_some()) {
        let _ = writeln!(out, "{DOUBT}");
    }
    if !budget.unsaid.is_empty() {
        let _ = writeln!(out, "taken as exact: {}", budget.unsaid.join(", "));
    }
    out
}

fn as_json(
    report: &Report,
    motion: &Motion,
    machine: &Machine,
    material: Option<&Material>,
    budget: &Budget,
    args: &AccuracyArgs,
) -> serde_json::Value {
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
                    "joints": w.joints,
                    "kinematic": w.errors.kinematic.map(spread),
                    "geometric": w.errors.geometric.map(spread),
                    "elastic": w.errors.elastic,
                    "sum": known(&w.errors).then(|| w.errors.sum()),
                    "rss": known(&w.errors).then(|| w.errors.root_of_squares()),
                    "causes": w.causes.iter().map(|(name, v)| json!({ "name": name, "moves": v })).collect::<Vec<_>>(),
                })
            });
            let over: Vec<_> = r.over.iter().map(|s| json!({ "from": s.first.line + 1, "to": s.last.line + 1, "line": s.worst.line + 1, "sum": s.sum, "rss": s.rss })).collect();
            let unforced: Vec<_> = r.unforced.iter().map(|(s, _)| s.line + 1).collect();
            json!({
                "operation": r.operation.name, "tool": r.operation.tool, "places": r.places,
                "tolerance": r.operation.tolerance, "most": r.most, "worst": worst, "over": over, "force_unknown": unforced, "measured": r.measured.map(|m| m.0),
            })
        })
        .collect();
    json!({
        "machine": machine.id, "unit": "mm", "rules": RULES, "doubt": DOUBT,
        "accuracy_source": machine.cell.accuracy.as_ref().map(|a| a.source.clone()),
        "stiffness_source": machine.cell.stiffness.as_ref().map(|s| s.source.clone()),
        "frame": if turns_part(machine) { ON_TABLE } else { "in the base" },
        "geometry_from_zero": report.touched.is_some(),
        "material": material.map(|m| m.id.clone()), "deviations": args.deviations, "taken_as_exact": budget.unsaid, "operations": rows,
    })
}

fn csv(report: &Report, motion: &Motion) -> String {
    let mut out = String::from(
        "operation,tool,line,kinematic mm,geometric mm,elastic mm (to a factor of 2 at best),sum mm,rss mm,tolerance mm\n",
    );
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
