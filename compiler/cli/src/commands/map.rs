//! `gcc-robot map --machine usp/2ups-prp --quantity kinematic-x --plane z=0 -o map.png`

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use gr_accuracy::map::{self, DOUBT, Map, Plane, Probe, Quantity, Request, turns_part};
use gr_accuracy::outline::outline;
use gr_accuracy::picture::Picture;
use gr_accuracy::{Budget, BudgetOptions, closed_form};
use gr_machine::math::{Frame, euler, product};
use gr_machine::{Chain, JointKind, Machine, ParameterKind};
use gr_text::code;

use super::accuracy::{Beside, misfit, referenced, soft, triple, unsaid};
use crate::exit::Exit;
use crate::options::{Global, MapArgs};
use crate::progress::Progress;
use crate::sources::{Sources, about_file};

pub fn run(global: &Global, args: &MapArgs) -> Exit {
    let mut sources = Sources::default();
    let (machine, doubts) = match super::machine::doubted(&args.machine, &mut sources) {
        Ok(found) => found,
        Err(found) => {
            let mut renderer = global.renderer(true);
            found.iter().for_each(|d| renderer.show(&sources, d));
            renderer.finish(false);
            return renderer.failed();
        }
    };
    let refuse = |what: &str, why: &str| {
        super::refuse(global, Path::new(&args.machine), code::ACCURACY_BAD_OPTION, &[what.to_string(), why.to_string()])
    };
    if let Some((what, why)) = misfit(&machine, args.reference, args.grade) {
        return refuse(&what, &why);
    }
    let machine = referenced(machine, args.reference);
    if let Chain::Incomplete { missing, .. } = &machine.chain {
        return refuse(&machine.id, &format!("it is a template; its file must still say {}", missing.join(", ")));
    }
    let Some(plane) = plane(&args.plane) else {
        return refuse("--plane", "one of x, y and z, and where: z=0");
    };
    let budget = Budget::new(&machine, BudgetOptions { grade: args.grade, usp2009: args.reference.is_some() });
    let made = if args.quantity == "sensitivity" {
        bars(global, &machine, plane, args)
    } else {
        area(global, args, &machine, plane, &budget)
    };
    let Made { text, files, left_out } = match made {
        Ok(made) => made,
        Err((what, why)) => return refuse(&what, &why),
    };
    let mut renderer = global.renderer(true);
    doubts.iter().for_each(|d| renderer.show(&sources, d));
    let file = sources.add(&args.machine, "");
    left_out.iter().for_each(|args| renderer.show(&sources, &about_file(code::ACCURACY_NO_DATA, file, args)));
    let exit = super::write(&mut renderer, &mut sources, Path::new(&args.machine), &files);
    renderer.finish(false);
    if exit != Exit::Ok {
        return exit;
    }
    super::print(&text)
}

/// What a request comes to.
#[derive(Default)]
struct Made {
    text: String,
    files: Vec<(PathBuf, Vec<u8>)>,
    /// What is not in it, and why.
    left_out: Vec<[String; 2]>,
}

type Refused = (String, String);

/// Lines of a picture: broken behind spaces and commas where they would be too long.
fn wrapped(text: &str) -> Vec<String> {
    const LONG: usize = 72;
    let mut out = vec![String::new()];
    // The letters of pictures have no such quotes.
    for word in text.replace('`', "").split_inclusive([' ', ',']) {
        let line = out.len() - 1;
        if !out[line].is_empty() && out[line].chars().count() + word.trim_end().chars().count() > LONG {
            out.push(String::new());
        }
        let line = out.len() - 1;
        out[line].push_str(word);
    }
    out
}

/// What is left out, as a picture and a table carry it.
fn without([what, why]: &[String; 2]) -> String {
    match why.strip_prefix("nothing is said of ") {
        Some(names) => format!("left out: {what}, {names}"),
        None => format!("left out: {what}"),
    }
}

fn plane(text: &str) -> Option<Plane> {
    let (axis, at) = text.split_once('=')?;
    let axis = ["x", "y", "z"].iter().position(|a| a.eq_ignore_ascii_case(axis.trim()))?;
    Some(Plane { axis, at: at.trim().parse().ok().filter(|v: &f64| v.is_finite())? })
}

fn area(global: &Global, args: &MapArgs, machine: &Machine, plane: Plane, budget: &Budget) -> Result<Made, Refused> {
    let wanted = if args.quantity == "reach" { "workspace" } else { &args.quantity };
    let Some((_, quantity)) = Quantity::NAMES.into_iter().find(|(n, _)| *n == wanted) else {
        let all: Vec<&str> = Quantity::NAMES.iter().map(|(n, _)| *n).collect();
        return Err(("--quantity".into(), format!("known are {} and sensitivity", all.join(", "))));
    };
    let lacks = |what: &str, key: &str| Err((format!("--quantity {}", args.quantity), format!("the file of {} says nothing of {what}: {key}", machine.id)));
    let (joints, geometry, stiffness) = quantity.needs();
    if joints && budget.joints.is_none() {
        return lacks("the error of its joints", "`joints` in `[accuracy]`");
    }
    let deviations = match &args.deviations {
        None => None,
        Some(text) => Some(deviations(text, machine).map_err(|why| ("--deviations".to_string(), why))?),
    };
    let budget = &budget.clone().with_known(machine, deviations);
    if geometry && !budget.tells_geometry() {
        let lengths = machine.parameters().iter().any(|p| p.kind == ParameterKind::Length && !p.name.ends_with(".zero"));
        return match lengths {
            true => lacks("the tolerances of its geometry", "`grade` or `parameter` in `[accuracy]`, or `--it`"),
            false => lacks("the tolerances of its geometry, which is angles only and has no grade", "`parameter` in `[accuracy]`"),
        };
    }
    let soft = soft(machine);
    if let (true, Some(joint)) = (stiffness, soft.first()) {
        return lacks(&format!("the stiffness of {joint}"), "`[stiffness]`");
    }
    let force = match &args.force {
        Some(text) => triple(text).ok_or(("--force".to_string(), "three numbers are wanted: -100,0,0".to_string()))?,
        None if matches!(quantity, Quantity::Elastic(_)) => {
            return Err(("--quantity elastic".into(), "a deflection needs a force: `--force -100,0,0`".into()));
        }
        None => [0.0; 3],
    };
    let signs = match &args.signs {
        None => None,
        Some(text) => Some(signs(text, machine.joints.len()).ok_or((
            "--signs".to_string(),
            format!("one + or - for each of the {} joints", machine.joints.len()),
        ))?),
    };
    let heeds = |option: &str, given: bool, fits: bool, whom: &str| {
        if given && !fits { Err((option.to_string(), format!("it is for {whom}, not for {}", args.quantity))) } else { Ok(()) }
    };
    let by_joints = matches!(quantity, Quantity::Kinematic(_));
    let total = matches!(quantity, Quantity::Total | Quantity::TotalRss);
    let by_force = matches!(quantity, Quantity::Elastic(_)) || total;
    let by_grade = matches!(quantity, Quantity::Geometric(_)) || total;
    heeds("--deviations", args.deviations.is_some(), by_grade, "errors by the geometry and the total")?;
    heeds("--signs", args.signs.is_some(), by_joints, "errors by the joints")?;
    heeds("--force", args.force.is_some(), by_force, "deflections and the total")?;
    heeds("--it", args.grade.is_some(), by_grade, "errors by the geometry and the total")?;
    graded(args.grade, args.deviations.as_deref())?;
    let held = Held::new(machine, args.tool, args.tool_length, args.tool_turn.as_deref())?;
    let probe = held.probe(machine)?.touched(zero(machine, args)?);
    let size = size(&probe, machine, args, 400)?;
    // The publication counts nodes on the border too.
    let window = args.reference.map(|_| {
        let (extent, (a, b)) = (probe.extent(), plane.axes());
        [extent[a], extent[b]]
    });
    let request = Request { quantity, plane, size, window, force, signs };
    // Of the volume.
    let quick = closed_form(machine) || matches!(machine.chain, Chain::FiveAxis(_));
    let (layers, nodes) = if quick { (68, 120) } else { (16, 24) };
    let progress = Progress::new(global.quiet, format!("map of {}", machine.id));
    // A search of its own on some machines, which the estimate must not count for each place.
    probe.extent();
    if !closed_form(machine) && !global.quiet {
        let more = if quantity == Quantity::Workspace { layers * nodes * nodes } else { 0 };
        estimate(size.0 * size.1 + more, |count| {
            map::sample(&probe, budget, &request, count);
        });
    }
    let tell = std::sync::Mutex::new(&progress);
    let map = map::map(&probe, budget, &request, &|done, of| {
        if let Ok(p) = tell.try_lock() {
            p.tell(|| format!("map of {}: row {done} of {of}", machine.id));
        }
    });
    let mut left_out = left_out(quantity, machine, budget, force);
    left_out.extend(limitless(machine));
    let infinite = quantity == Quantity::Condition && map.lost > 0;
    let singular = match map.summary() {
        None => infinite,
        Some(s) => quantity == Quantity::Singularity && s.greatest.0 == 0.0,
    };
    if infinite && !singular {
        left_out.push([format!("the condition number at {} places within reach", map.lost), "they are singular: it has no finite value there".to_string()]);
    }
    if map.lost > 0 && !infinite {
        let why = "a member of `[stiffness]` has no length left there: look at its `shorter_by` or `between`".to_string();
        left_out.push([format!("the deflection at {} places within reach", map.lost), why]);
    }
    let elastic = map.elastic && (!total || soft.is_empty());
    let map = Map { elastic, ..map };
    let mut what = quantity.words();
    if total {
        what += if elastic { " of joints, geometry and deflection" } else { " of joints and geometry" };
    }
    if total && !elastic && force != [0.0; 3] {
        left_out.push(["the deflection".into(), format!("the file of {} has no `[stiffness]` of {}", machine.id, soft.join(", "))]);
    }
    let with = if args.reference.is_some() { String::new() } else { format!(", {}", held.words(&probe)) };
    let title = format!("{}: {what}, {} = {} mm{with}", machine.id, ["X", "Y", "Z"][plane.axis], plane.at);
    let mut text = told(&map, machine, &what, &with);
    let flat = probe.extent().iter().any(|(low, high)| high - low < 1e-6);
    if quantity == Quantity::Workspace && !flat {
        let tell = |done: usize, of: usize| progress.tell(|| format!("volume of {}: layer {done} of {of}", machine.id));
        let volume = map::volume(&probe, layers, nodes, &tell) / 1e6;
        let _ = writeln!(text, "volume {volume:.1} dm³ (by {layers} layers of {nodes} × {nodes} nodes)");
    }
    drop(progress);
    let mut notes: Vec<String> = held.notes(&probe);
    notes.extend(framed(machine));
    if geometry && probe.counts_from_zero() {
        notes.push(format!("geometry: {}", counted(machine, args)?));
    }
    if singular {
        let count = if infinite { map.lost } else { map.summary().map_or(0, |s| s.nodes) };
        notes.push(format!("singular at all {count} nodes within reach: the condition number has no finite value"));
        if probe.leans() && args.tool_turn.is_none() {
            notes.push("so it is by build: with the tool upright an axis turns it about itself; `--tool-turn` leans it".to_string());
        }
    }
    let of_places = notes.len();
    if map.elastic && by_force {
        notes.push(format!("force X {} Y {} Z {} N", force[0], force[1], force[2]));
    }
    if let Some(text) = &args.deviations {
        notes.push(format!("deviations: {text}"));
    }
    if let Some(signs) = &args.signs {
        notes.push(format!("signs of the joint errors: {signs}"));
    }
    if map.elastic {
        notes.push(DOUBT.to_string());
    }
    notes.iter().for_each(|n| text += &format!("{n}\n"));
    let without: Vec<String> = left_out.iter().map(without).collect();
    notes.extend(without.iter().cloned());
    if map.summary().is_none() && !infinite {
        let _ = writeln!(text, "nothing of this plane is within reach; {}", reach_along(&probe, plane.axis));
    }
    // Lines of a picture are short.
    let lines: Vec<String> = notes.iter().flat_map(|n| n.split("; ")).flat_map(wrapped).collect();
    let picture = Picture::map(&map, &title, &lines);
    let without: Vec<String> = notes[..of_places].iter().cloned().chain(without).collect();
    Ok(Made { text, files: files(&args.output, &picture, || map.csv(&without))?, left_out })
}

/// What a map or a rectangle without a program is of: a tool of the machine file, else the nose of its spindle or the flange.
pub struct Held<'a> {
    /// Its name; none without a tool.
    tool: Option<String>,
    /// Its point on the flange.
    frame: Frame,
    /// How it is turned, as the user wrote it.
    turn: Option<&'a str>,
    /// The machine has a spindle of its own on the flange.
    spindle: bool,
    /// The machine file has tools.
    tools: bool,
}

impl<'a> Held<'a> {
    /// By the options `--tool`, `--tool-length` and `--tool-turn`.
    pub fn new(machine: &Machine, tool: Option<u32>, length: Option<f64>, turn: Option<&'a str>) -> Result<Held<'a>, Refused> {
        let cell = &machine.cell;
        let (tool, frame) = match (tool, length) {
            (Some(n), _) => match cell.tools.get(&n) {
                Some(t) => (Some(format!("tool {n} ({})", t.name)), cell.tool_frame(n)),
                None => {
                    let list: Vec<String> = cell.tools.keys().map(u32::to_string).collect();
                    let has = if list.is_empty() { "no `[[tool]]`".to_string() } else { format!("the tools {}", list.join(", ")) };
                    return Err((format!("--tool {n}"), format!("the file of {} has {has}; `--tool-length` says the length of another", machine.id)));
                }
            },
            (None, Some(length)) if length.is_finite() && length.abs() <= LONGEST => {
                (Some(format!("a tool of {length} mm")), machine.tool_of_length(length))
            }
            (None, Some(length)) => return Err(("--tool-length".into(), format!("no tool is {length} mm long"))),
            (None, None) => (None, cell.tool_frame(u32::MAX)),
        };
        Ok(Held { tool, frame, turn, spindle: cell.spindle.is_some(), tools: !cell.tools.is_empty() })
    }

    /// The machine with it, turned as asked: straight down on arms, upright on mills, elsewhere as at the start.
    pub fn probe<'m>(&self, machine: &'m Machine) -> Result<Probe<'m>, Refused> {
        let probe = Probe::downward(machine).holding(self.frame);
        let Some(text) = self.turn else { return Ok(probe) };
        let why = |why: &str| Err(("--tool-turn".to_string(), why.to_string()));
        let Some(words) = triple(text).filter(|w| w.iter().all(|v| v.abs() <= 360.0)) else {
            return why("three angles in degrees are wanted, A,B,C: -30,0,45");
        };
        if !probe.turns_as_asked() {
            return why(&format!("{} has no joint that turns its tool as one likes", machine.id));
        }
        let turn = product(&euler(words.map(f64::to_radians)), &gr_robot::Turns::new(machine).still());
        Ok(probe.held(self.frame, turn))
    }

    /// What it is, in words.
    fn thing(&self, probe: &Probe<'_>) -> String {
        match &self.tool {
            Some(tool) => tool.clone(),
            None if self.spindle || probe.leans() => "the spindle's nose".into(),
            None => "the flange".into(),
        }
    }

    /// What it is and how it stands.
    pub fn words(&self, probe: &Probe<'_>) -> String {
        match (&self.tool, self.turn) {
            (tool, _) if !probe.turns_as_asked() => tool.clone().unwrap_or_else(|| "without a tool".into()),
            (_, Some(text)) => format!("{} turned by A,B,C {text}°", self.thing(probe)),
            _ => format!("{} {}", self.thing(probe), direction(probe)),
        }
    }

    /// How it stands in a map or a rectangle, where the machine can turn it, and which of its ways to stand an arm takes; what a tool
    /// that is not there would change.
    pub fn notes(&self, probe: &Probe<'_>) -> Vec<String> {
        let mut out = Vec::new();
        if probe.turns_as_asked() {
            out.push(format!("{}, at every place (`--tool-turn`)", self.words(probe)));
            if !probe.leans() {
                out.push("where the arm can stand in several ways: the one nearest to its start".to_string());
            }
        }
        if self.tool.is_none() && self.tools {
            out.push("without a tool (`--tool`): its length is not in it".to_string());
        }
        out
    }
}

/// Longer than any tool, mm.
const LONGEST: f64 = 10_000.0;

/// Which way a tool points that the machine can turn.
fn direction(probe: &Probe<'_>) -> String {
    if let Some(angle) = probe.planar_angle() {
        return format!("turned as at the start: C {:.1}°", angle.to_degrees());
    }
    let straight = if probe.leans() { "upright" } else { "straight down" };
    let lean = probe.lean().to_degrees();
    if lean < 0.05 { straight.to_string() } else { format!("leaning {lean:.1}° from {straight}") }
}

/// The zero of a machine tool that errors by the geometry count from: the base's where none is given.
fn zero(machine: &Machine, args: &MapArgs) -> Result<[f64; 3], Refused> {
    let Some(text) = &args.zero else { return Ok([0.0; 3]) };
    if !Probe::downward(machine).touched([0.0; 3]).counts_from_zero() {
        return Err(("--zero".to_string(), format!("a part is touched on machine tools; {} is none", machine.id)));
    }
    triple(text).ok_or_else(|| ("--zero".to_string(), "three numbers are wanted, such as 100,50,0".to_string()))
}

/// Where errors by the geometry count from.
fn counted(machine: &Machine, args: &MapArgs) -> Result<String, Refused> {
    let [x, y, z] = zero(machine, args)?;
    Ok(format!("counted from X {x} Y {y} Z {z} mm in the base, as if the part were touched there (`--zero`)"))
}

/// Whose frame places and directions are of, where that is not the base.
pub fn framed(machine: &Machine) -> Option<String> {
    let what = "places, directions and forces: in the part's frame on the turned table, which is the base's with the rotary axes at zero";
    turns_part(machine).then(|| what.to_string())
}

/// How far the tool gets along an axis.
pub fn reach_along(probe: &Probe<'_>, axis: usize) -> String {
    let name = ["X", "Y", "Z"][axis];
    match probe.span(axis) {
        Some((low, high, apart)) => format!("the tool gets at least to {name} {low:.0} to {high:.0} mm (looked at every {apart:.0} mm)"),
        None => "no place that was looked at is".to_string(),
    }
}

/// A slide without limits reaches as far as one likes: what is drawn is only what was looked at.
pub fn limitless(machine: &Machine) -> Option<[String; 2]> {
    let slides = machine.joints.iter().filter(|j| j.kind == JointKind::Prismatic && (j.min.is_none() || j.max.is_none()));
    let names: Vec<&str> = slides.map(|j| j.name.as_str()).collect();
    let why = format!("the file of {} has no `min` or no `max` of {}: looked at as far as 500 mm each way", machine.id, names.join(", "));
    (!names.is_empty()).then(|| ["the end of the reach".to_string(), why])
}

/// What a quantity would need and the machine file or the command does not say.
fn left_out(quantity: Quantity, machine: &Machine, budget: &Budget, force: [f64; 3]) -> Vec<[String; 2]> {
    let (joints, geometry, _) = quantity.needs();
    let mut out = Vec::new();
    if joints || geometry {
        // What is needed and lacks altogether has been refused; what this quantity has no part of is not told.
        let joint = |name: &String| machine.joints.iter().any(|j| j.name == *name);
        let counts = |name: &&String| if joint(name) { joints } else { geometry };
        let budget = Budget { unsaid: budget.unsaid.iter().filter(counts).cloned().collect(), ..budget.clone() };
        out.extend(unsaid(machine, &budget).into_iter().filter(|[_, why]| why.contains("taken as exact")));
    }
    if joints && geometry && force == [0.0; 3] {
        out.push(["the deflection".into(), "no `--force` is given".into()]);
    }
    if geometry && budget.known.is_none() {
        out.extend(measured(machine));
    }
    out
}

/// Measured deviations of a machine are no part of what is predicted.
pub fn measured(machine: &Machine) -> Option<[String; 2]> {
    machine.cell.as_built.as_ref()?;
    let why = "they are no tolerances, and `build --compensate` takes them away; `--deviations` of `map` and `accuracy` says what they do".to_string();
    Some(["the error by the deviations of `[as_built]`".into(), why])
}

/// A grade says nothing where the deviations are known.
pub fn graded(grade: Option<u8>, deviations: Option<&str>) -> Result<(), Refused> {
    match (grade, deviations) {
        (Some(g), Some(_)) => Err((format!("--it {g}"), "`--deviations` says already how the geometry is; leave out one of them".into())),
        _ => Ok(()),
    }
}

/// Nodes along each side.
fn size(probe: &Probe<'_>, machine: &Machine, args: &MapArgs, usual: usize) -> Result<(usize, usize), Refused> {
    match (&machine.chain, args.reference, args.resolution) {
        (Chain::TwoLegs(_), Some(_), Some(_)) => {
            Err(("--resolution".into(), "the grid of the publication is 5 mm; leave out `--reference` or this".into()))
        }
        // The grid of the thesis' program: 5 mm, rounded to whole steps.
        (Chain::TwoLegs(_), Some(_), None) => {
            let e = probe.extent();
            let steps = |i: usize| ((e[i].1 - e[i].0) / 5.0 + 0.5).max(2.0) as usize;
            Ok((steps(0) + 1, steps(1) + steps(1) % 2 + 1))
        }
        (_, _, given) => {
            let n = given.map_or(usual, |n| n as usize);
            Ok((n, n))
        }
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Says how long it takes to look at so many places by search, on all cores, from some of them.
pub fn estimate(places: usize, some: impl FnOnce(usize)) {
    estimate_on(cores(), places, some);
}

fn estimate_on(cores: usize, places: usize, some: impl FnOnce(usize)) {
    const SOME: usize = 64;
    let start = std::time::Instant::now();
    some(SOME);
    let seconds = start.elapsed().as_secs_f64() / SOME as f64 * places as f64 / cores as f64;
    if seconds >= 2.0 {
        // Whoever closed standard error does not want to know.
        let _ = writeln!(std::io::stderr(), "{places} places, not in closed form: the search takes about {seconds:.0} s");
    }
}

/// Greater deviations are none that a model of small ones is about, mm and degrees.
const MOST_OFF: f64 = 100.0;
const MOST_LEAN: f64 = 10.0;

/// Deviations by name, in the order of the machine's parameters, mm and rad.
pub fn deviations(text: &str, machine: &Machine) -> Result<Vec<f64>, String> {
    let all = machine.parameters();
    let mut out = vec![0.0; all.len()];
    let mut given = vec![false; all.len()];
    for one in text.split(',').map(str::trim) {
        let (name, value) = one.split_once('=').ok_or_else(|| format!("`{one}` is no NAME=VALUE"))?;
        let value: f64 = value.trim().parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| format!("`{value}` is no number"))?;
        let Some(i) = all.iter().position(|p| p.name == name.trim()) else {
            let names: Vec<&str> = all.iter().map(|p| p.name.as_str()).collect();
            return Err(format!("there is no parameter `{name}`; this machine has {}", names.join(", ")));
        };
        if std::mem::replace(&mut given[i], true) {
            return Err(format!("`{}` is given twice", name.trim()));
        }
        let angle = all[i].kind == ParameterKind::Angle;
        if value.abs() > if angle { MOST_LEAN } else { MOST_OFF } {
            return Err(format!("`{}` is no small deviation: at most {MOST_OFF} mm or {MOST_LEAN}°", name.trim()));
        }
        out[i] = if angle { value.to_radians() } else { value };
    }
    Ok(out)
}

fn signs(text: &str, count: usize) -> Option<Vec<f64>> {
    let one = |c: char| match c {
        '+' => Some(1.0),
        '-' => Some(-1.0),
        '0' => Some(0.0),
        _ => None,
    };
    let all: Option<Vec<f64>> = text.chars().filter(|c| *c != ',').map(one).collect();
    all.filter(|s| s.len() == count)
}

fn told(map: &Map, machine: &Machine, what: &str, with: &str) -> String {
    let (a, b) = map.plane.axes();
    let name = |i: usize| ["X", "Y", "Z"][i];
    let unit = match map.quantity.unit() {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    let mut out = format!("{}: {what} in the plane {} = {} mm{with}\n", machine.id, name(map.plane.axis), map.plane.at);
    let Some(s) = map.summary() else { return out };
    let step = map.step();
    let _ = writeln!(out, "area {:.2} dm² ({} nodes of {:.3} × {:.3} mm)", s.area / 1e4, s.nodes, step[0], step[1]);
    let [x, y] = s.extent;
    let _ = writeln!(out, "reach {} {:.1} to {:.1}, {} {:.1} to {:.1} mm", name(a), x.0, x.1, name(b), y.0, y.1);
    if map.quantity != Quantity::Workspace {
        let at = |p: [f64; 2]| format!("{} {:.1} {} {:.1}", name(a), p[0], name(b), p[1]);
        let _ = writeln!(out, "least {:.4}{unit} at {}", s.least.0, at(s.least.1));
        let _ = writeln!(out, "greatest {:.4}{unit} at {}", s.greatest.0, at(s.greatest.1));
        let _ = writeln!(out, "mean {:.4}{unit}", s.mean);
    }
    for line in outline(map) {
        let points: Vec<String> = line.iter().map(|[x, y]| format!("{x:.1} {y:.1}")).collect();
        let _ = writeln!(out, "outline {} {}: {}", name(a), name(b), points.join(", "));
    }
    out
}

/// Mean sensitivities, the greatest first.
fn bars(global: &Global, machine: &Machine, plane: Plane, args: &MapArgs) -> Result<Made, Refused> {
    if args.signs.is_some() || args.force.is_some() || args.grade.is_some() || args.deviations.is_some() {
        return Err(("--quantity sensitivity".into(), "it goes by the geometry alone: no `--signs`, `--force`, `--deviations` or `--it`".into()));
    }
    let held = Held::new(machine, args.tool, args.tool_length, args.tool_turn.as_deref())?;
    let probe = held.probe(machine)?.touched(zero(machine, args)?);
    let size = size(&probe, machine, args, 120)?;
    let progress = Progress::new(global.quiet, format!("sensitivities of {}", machine.id));
    probe.extent();
    if !closed_form(machine) && !global.quiet {
        estimate_on(1, size.0 * size.1, |count| map::sample_sensitivity(&probe, plane, count));
    }
    let tell = |done: usize, of: usize| progress.tell(|| format!("sensitivities of {}: row {done} of {of}", machine.id));
    let published = args.reference.and_then(|_| map::mean_sensitivity_usp2009(&probe, plane, size));
    let (columns, what, unit, mut all): (&[&str], &str, &str, Vec<Bar>) = match published {
        Some(list) => (
            &["yaw rad/mm", "arm mm/mm"],
            "mean change of yaw and arm length per mm of each length (Gojtan 2009, eq. 7.5)",
            "arm, mm per mm",
            list.into_iter().map(|(name, v)| Bar { name, per: "mm", values: v.to_vec() }).collect(),
        ),
        None => (
            &["X", "Y", "Z", "length"],
            "mean movement of the tool point per mm or mrad of each number of the geometry, mm",
            "tool point, mm per mm or mrad",
            match map::mean_sensitivity(&probe, plane, size, &tell) {
                // A radian of a joint would hide every length; a thousandth of it moves the tool about as far as a mm.
                Some(list) => {
                    let angles: Vec<bool> = machine.parameters().iter().map(|p| p.kind == ParameterKind::Angle).collect();
                    let one = |((name, v), angle): ((String, [f64; 4]), bool)| match angle {
                        true => Bar { name, per: "mrad", values: v.map(|v| v * 1e-3).to_vec() },
                        false => Bar { name, per: "mm", values: v.to_vec() },
                    };
                    list.into_iter().zip(angles).map(one).collect()
                }
                None => {
                    let why = format!("nothing of this plane is within reach; {}", reach_along(&probe, plane.axis));
                    return Err((format!("--plane {}", args.plane), why));
                }
            },
        ),
    };
    drop(progress);
    // Rounding must not decide the order of what a symmetric machine has twice.
    let rounded = |b: &Bar| (b.last() * 1e9).round();
    all.sort_by(|a, b| rounded(b).total_cmp(&rounded(a)));
    let wide = all.iter().map(|b| b.label().chars().count() + 1).fold(20, usize::max);
    let mut text = format!("{}: {what}\n{:<wide$}", machine.id, "");
    columns.iter().for_each(|c| text += &format!("{c:>14}"));
    for bar in &all {
        let _ = write!(text, "\n{:<wide$}", bar.label());
        bar.values.iter().for_each(|v| text += &format!("{v:>14.7}"));
    }
    text.push('\n');
    let plane = format!("{} = {} mm", ["X", "Y", "Z"][plane.axis], plane.at);
    // Where the tool can be turned a note says how it is.
    let with = if args.reference.is_some() || probe.turns_as_asked() { String::new() } else { format!(", {}", held.words(&probe)) };
    let mut notes = vec![format!("mean over the places within reach in the plane {plane}{with}")];
    notes.extend(held.notes(&probe));
    notes.extend(framed(machine));
    if probe.counts_from_zero() {
        notes.push(counted(machine, args)?);
    }
    if all.iter().any(|b| b.name.ends_with(".zero")) {
        notes.push("zeros of joints: in reports and maps a part of the joint's own error".to_string());
    }
    notes.iter().for_each(|n| text += &format!("{n}\n"));
    let rows: Vec<(String, f64)> = all.iter().map(|b| (b.label(), b.last())).collect();
    let title = format!("{}: mean sensitivity, {plane}", machine.id);
    let lines: Vec<String> = notes.iter().flat_map(|n| wrapped(n)).collect();
    let picture = Picture::bars(&rows, &title, unit, &lines);
    let csv = || bars_csv(&all, columns, &notes);
    Ok(Made { text, files: files(&args.output, &picture, csv)?, ..Made::default() })
}

/// A row of a bar chart.
struct Bar {
    name: String,
    /// Unit of what is varied.
    per: &'static str,
    /// A number for each column.
    values: Vec<f64>,
}

impl Bar {
    fn label(&self) -> String {
        if self.per == "mm" { self.name.clone() } else { format!("{} ({})", self.name, self.per) }
    }
    fn last(&self) -> f64 {
        self.values.last().copied().unwrap_or(0.0)
    }
}

/// Sensitivities as a table: the unit of what is varied in each row, that of the values in the head, in its last column what must be
/// known to read it.
fn bars_csv(all: &[Bar], columns: &[&str], notes: &[String]) -> String {
    let head: Vec<String> = columns.iter().map(|c| if c.contains('/') { (*c).to_string() } else { format!("{} mm", c.to_lowercase()) }).collect();
    let notes = notes.join("; ").replace('"', "\"\"");
    let (last, first) = head.split_last().map_or((String::new(), &[][..]), |(l, f)| (l.clone(), f));
    let mut out = format!("parameter,per,{},\"{last} ({notes})\"\n", first.join(","));
    for bar in all {
        let list: Vec<String> = bar.values.iter().map(|v| gr_text::figures::number(*v, 9)).collect();
        let _ = writeln!(out, "{},{},{}", bar.name, bar.per, list.join(","));
    }
    out
}

/// The map that belongs to a report: errors by joints and geometry, those that are known, in the plane of the largest one, with the
/// tool that makes it, standing as it does there: at that place it is what the table says.
pub fn beside(global: &Global, machine: &Machine, budget: &Budget, of: Option<&Beside>, goal: &PathBuf) -> Result<Vec<(PathBuf, Vec<u8>)>, Refused> {
    let length = gr_accuracy::map::Part::Length;
    let no = |why: String| ("--map".to_string(), why);
    let (quantity, what) = match (budget.joints.is_some(), budget.tells_geometry()) {
        (true, true) => (Quantity::Total, "sum of the longest errors of joints and geometry".to_string()),
        (false, true) => (Quantity::Geometric(length), Quantity::Geometric(length).words()),
        (true, false) => (Quantity::Kinematic(length), Quantity::Kinematic(length).words()),
        _ => return Err(no(format!("the file of {} says nothing of its errors: there is nothing to draw", machine.id))),
    };
    let of = of.ok_or_else(|| no("the program cuts nothing: there is no place to draw".into()))?;
    let plane = Plane { axis: 2, at: of.point[2] };
    let probe = Probe::downward(machine).standing(of.tool.1, &of.joints).map_err(|e| no(e.to_string()))?.since(of.zero.clone());
    let request = Request { quantity, plane, size: (400, 400), window: None, force: [0.0; 3], signs: None };
    let progress = Progress::new(global.quiet, format!("map of {}", machine.id));
    probe.extent();
    if !closed_form(machine) && !global.quiet {
        estimate(400 * 400, |count| {
            map::sample(&probe, budget, &request, count);
        });
    }
    let tell = std::sync::Mutex::new(&progress);
    let map = map::map(&probe, budget, &request, &|done, of| {
        if let Ok(p) = tell.try_lock() {
            p.tell(|| format!("map of {}: row {done} of {of}", machine.id));
        }
    });
    drop(progress);
    let height = (plane.at * 1e3).round() / 1e3 + 0.0;
    if map.summary().is_none() {
        return Err(no(format!("nothing of the plane Z = {height} mm is within reach with {}", of.tool.0)));
    }
    let stands = if probe.turns_as_asked() { format!(" {}", direction(&probe)) } else { String::new() };
    let title = format!("{}: {what}, Z = {height} mm, {}{stands}", machine.id, of.tool.0);
    let mut notes: Vec<String> = unsaid(machine, budget).iter().map(without).collect();
    notes.push("left out: the deflection".to_string());
    notes.push(format!("{} as in line {}, where the error is largest, at every place", of.tool.0, of.line));
    if probe.turns_as_asked() && !probe.leans() {
        notes.push("where the arm can stand in several ways: the one nearest to how it stands there".to_string());
    }
    notes.extend(framed(machine));
    if probe.counts_from_zero() {
        notes.push("geometry: counted from the program's zero, which is touched on this machine".to_string());
    }
    if budget.known.is_some() {
        notes.push("geometry: by deviations that are given".to_string());
    }
    let lines: Vec<String> = notes.iter().flat_map(|n| wrapped(n)).collect();
    files(std::slice::from_ref(goal), &Picture::map(&map, &title, &lines), || map.csv(&notes))
}

fn files(goals: &[PathBuf], picture: &Picture, csv: impl Fn() -> String) -> Result<Vec<(PathBuf, Vec<u8>)>, Refused> {
    let mut out = Vec::new();
    for goal in goals {
        let ending = goal.extension().map_or(String::new(), |e| e.to_string_lossy().to_ascii_lowercase());
        let wrong = |e: String| (goal.display().to_string(), e);
        let bytes = match ending.as_str() {
            "png" => picture.png().map_err(wrong)?,
            "svg" => picture.svg().map_err(wrong)?.into_bytes(),
            "csv" => csv().into_bytes(),
            _ => return Err(wrong("the ending says what is written: .png, .svg or .csv".into())),
        };
        out.push((goal.clone(), bytes));
    }
    Ok(out)
}

