//! `gcc-robot place part.ngc --machine usp/2ups-prp`

use std::path::Path;

use gr_accuracy::map::{Probe, turns_part};
use gr_accuracy::place::{Aim, Arm, Found, Mill, Part, Reach, Rectangle, around, place, rectangle};
use gr_accuracy::report::{Operations, report, report_of_words};
use gr_accuracy::{Budget, BudgetOptions, closed_form, put_down};
use gr_ir::{Pose, Sources as _, geometry};
use gr_machine::{Chain, Machine};
use gr_machine::math::{Frame, M3, V3, add, norm, product, rotate, rotation_vector, scale, sub, transpose};
use gr_robot::Turns;
use gr_text::{Diagnostic, FileId, Severity, Span, code};
use serde_json::json;

use super::accuracy::{beyond, misfit, referenced, tool_points, unsaid};
use super::check::{Checked, show};
use crate::exit::Exit;
use crate::options::{Global, LintArgs, PlaceAim, PlaceArgs, TableFormat};
use crate::pipeline::{Motion, load, motion};
use crate::progress::Progress;
use crate::setup::{beside, station};
use crate::sources::Sources;

/// The path is looked at this often, mm: reach is not convex, so the ends of a move don't speak for what lies between.
const APART: f64 = 5.0;
/// Points nearer to each other than this are one, mm.
const SAME: f64 = 0.5;
/// A tool that turns is looked at this often, rad.
const TURN: f64 = std::f64::consts::PI / 90.0;

pub fn run(global: &Global, args: &PlaceArgs) -> Exit {
    let mut renderer = global.renderer(true);
    let mut sources = Sources::default();
    let name = args.file.clone().unwrap_or_else(|| "place".into());
    let from = args.file.as_deref().map_or(Path::new("."), beside);
    let Some(station) = station(&args.setup, &LintArgs::default(), from, &mut sources, &mut renderer) else {
        renderer.finish(false);
        return renderer.failed();
    };
    let Some(machine) = station.machine.clone() else {
        let why = "it needs a machine: `--machine`, or `machine` in gcc-robot.toml".to_string();
        return super::refuse(global, &name, code::ACCURACY_BAD_OPTION, &["place".to_string(), why]);
    };
    if let Some((what, why)) = misfit(&machine, args.reference, None) {
        return super::refuse(global, &name, code::ACCURACY_BAD_OPTION, &[what, why]);
    }
    let machine = referenced(machine, args.reference);
    if let Chain::Incomplete { missing, .. } = &machine.chain {
        let why = format!("it is a template; its file must still say {}", missing.join(", "));
        return super::refuse(global, &name, code::ACCURACY_BAD_OPTION, &[machine.id.clone(), why]);
    }
    let budget = Budget::new(&machine, BudgetOptions { grade: None, usp2009: args.reference.is_some() });
    let Some(file) = &args.file else {
        if args.aim != PlaceAim::Margin {
            let why = "a rectangle of stock is looked for by its size alone; it needs a program".to_string();
            return super::refuse(global, &name, code::ACCURACY_BAD_OPTION, &["--aim error".to_string(), why]);
        }
        return largest(global, args, &machine);
    };
    let for_stock = [("--tool-turn", args.tool_turn.is_some()), ("--tool", args.tool.is_some()), ("--tool-length", args.tool_length.is_some())];
    if let Some((option, _)) = for_stock.into_iter().find(|(_, given)| *given) {
        let why = "the program says itself which tool it has and how that is turned".to_string();
        return super::refuse(global, &name, code::ACCURACY_BAD_OPTION, &[option.to_string(), why]);
    }
    let progress = Progress::new(global.quiet, format!("placing {}", file.display()));
    let made = load(file, &station).and_then(|unit| motion(&unit, Some(&machine)).map(|(m, _)| m));
    let motion = match made {
        Ok(m) => m,
        Err(checked) => {
            drop(progress);
            show(&mut renderer, &checked);
            renderer.finish(false);
            return if checked.unreadable { Exit::Io } else { Exit::Findings };
        }
    };
    let aim = if args.aim == PlaceAim::Error { Aim::Error } else { Aim::Margin };
    let wish = Wish { motion: &motion, machine: &machine, budget: &budget, aim, quiet: global.quiet, progress: &progress };
    let found = wish.found();
    let error = found.as_ref().ok().and_then(|f| wish.error(f.position));
    drop(progress);
    let mut told = Vec::new();
    let top = |args: [String; 2]| Diagnostic::new(code::ACCURACY_NO_DATA, FileId(0), Span::default(), &args);
    let parts_of_error = [("kinematic", budget.joints.is_some()), ("geometric", budget.geometry.is_some())];
    let parts_of_error: Vec<&str> = parts_of_error.into_iter().filter(|(_, known)| *known).map(|(n, _)| n).collect();
    // A machine without any data is looked at for reach alone, which the result says; one with some lacks the rest.
    if !parts_of_error.is_empty() {
        told.extend(unsaid(&machine, &budget).into_iter().map(top));
        told.extend(super::map::measured(&machine).map(top));
    }
    told.extend(super::map::limitless(&machine).map(top));
    let say = |code, args: &[String]| Diagnostic::new(code, FileId(0), Span::default(), args);
    tool_points(&mut told, &mut machine.clone(), &motion.program, &say);
    let found = match found {
        Ok(found) => Some(found),
        Err(faults) => {
            told.splice(0..0, faults);
            None
        }
    };
    show(&mut renderer, &Checked { sources: motion.sources, found: told, ..Checked::nothing() });
    renderer.finish(false);
    let Some(found) = found else { return Exit::Findings };
    let [x, y, z] = found.position;
    let error = error.map(|e| e * 1e3);
    let error_known = error.is_some();
    super::print(&match args.format {
        TableFormat::Json => {
            format!("{:#}\n", json!({ "machine": machine.id, "position": [x, y, z], "margin": found.margin, "margin_looked_at_every": found.apart, "grid": found.looked.0, "starts": found.looked.1, "error_um": error, "error_of": parts_of_error }))
        }
        TableFormat::Csv => {
            format!("x mm,y mm,z mm,margin mm,error um\n{x},{y},{z},{:.3},{}\n", found.margin, error.map_or(String::new(), |e| format!("{e:.3}")))
        }
        TableFormat::Text => {
            let error = match error {
                Some(e) => format!("largest error of the path there: {e:.1} µm ({}, the longest; without deflection)\n", parts_of_error.join(" + ")),
                None if !parts_of_error.is_empty() => "nothing is cut: no error was looked at\n".to_string(),
                None => "its machine file has no accuracy data: only reach was looked at\n".to_string(),
            };
            let how = if found.apart > 0.0 { format!("looked at every {:.1} mm", found.apart) } else { "by the limits of its axes".to_string() };
            let ([dx, dy, dz], starts) = found.looked;
            let looked = match aim {
                Aim::Error if error_known => format!("the least error that was found: on a grid of {dx:.0} × {dy:.0} × {dz:.0} mm, then from its {starts} best places to 0.02 mm\n"),
                _ => String::new(),
            };
            format!(
                "part's origin at X {x} Y {y} Z {z} mm in the base of {}{} (--part {x},{y},{z})\nfree to move {:.1} mm any way: every point of the path stays within reach ({how})\n{error}{looked}every move of the program can be made there, rapids too\n",
                machine.id,
                if turns_part(&machine) { ", its table at zero" } else { "" },
                found.margin
            )
        }
    })
}

/// What is looked for.
struct Wish<'a> {
    motion: &'a Motion,
    machine: &'a Machine,
    budget: &'a Budget,
    aim: Aim,
    quiet: bool,
    progress: &'a Progress,
}

/// Moves that are planned for all places together: so many take some seconds.
const MOVES: usize = 300_000;

impl Wish<'_> {
    /// The best place where the program can be made, or what stands in the way.
    fn found(&self) -> Result<Found, Vec<Diagnostic>> {
        let program = &self.motion.program;
        let tries = (MOVES / program.len().max(1)).clamp(4, 60);
        let texts = gr_ir::Texts::new(self.motion.sources.iter().map(|(id, f)| (id, &*f.text)));
        let limits = |(source, joint, value): &(gr_ir::Source, usize, f64)| {
            let (file, span) = texts.place(*source);
            beyond(self.machine, *joint, *value, file, span)
        };
        let nowhere = || Diagnostic::new(code::PLACE_DOES_NOT_FIT, FileId(0), Span::default(), std::slice::from_ref(&self.machine.id));
        if let Some(mill) = Mill::new(self.machine, (program, &texts), true) {
            let strange = gr_robot::opinion::missing_axes(program, self.machine, &texts).into_iter();
            let beyond: Vec<Diagnostic> = strange.chain(mill.beyond.iter().filter_map(limits)).collect();
            if !beyond.is_empty() {
                return Err(beyond);
            }
            let short = |mut finding: Diagnostic, mill: &Mill<'_>| {
                for (joint, needs, has) in &mill.short {
                    let name = &self.machine.joints[*joint].name;
                    finding.notes.push(format!("joint {name}: the program goes over {needs:.1} mm, the joint over {has:.1} mm"));
                }
                finding
            };
            return self.best(&mill, 1, &mut |_| true).map_err(|_| {
                // Where rapids are out of reach everywhere: which, when the cuts fit.
                let Some(cuts) = Mill::new(self.machine, (program, &texts), false) else { return vec![nowhere()] };
                let Ok(found) = self.best(&cuts, 1, &mut |_| true) else { return vec![short(nowhere(), &cuts)] };
                let mut out: Vec<Diagnostic> = mill.outside((program, &texts), found.position).iter().filter_map(limits).collect();
                out.push(short(near(nowhere(), found.position, "its cuts fit"), &mill));
                out
            });
        }
        let mut faults = Vec::new();
        let mut number = 0;
        let mut planned = |at: V3| {
            number += 1;
            self.progress.tell(|| format!("planning at place {number} of at most {tries}"));
            let found = refused(self.motion, self.machine, at);
            let whole = found.is_empty();
            if number == 1 {
                faults = found;
            }
            whole
        };
        let Some(whole) = self.arm(true) else {
            // A rotary word that the machine file doesn't read: at its line.
            return Err(refused(self.motion, self.machine, self.machine.cell.part_in_base().position));
        };
        match self.best(&whole, tries, &mut planned) {
            Ok(found) => Ok(Found { margin: self.kept(found), ..found }),
            Err(Some(at)) => {
                faults.push(near(nowhere(), at, &format!("the best of {number} places that were planned")));
                Err(faults)
            }
            Err(None) => {
                let cuts = self.arm(false).and_then(|cuts| self.best(&cuts, 1, &mut |_| true).ok());
                let (at, what) = match cuts {
                    Some(found) => (found.position, "its cuts fit".to_string()),
                    None => {
                        let (at, count, of) = whole.nearest();
                        (at, format!("{count} of {of} points of the path are within reach"))
                    }
                };
                let mut out = refused(self.motion, self.machine, at);
                out.truncate(FAULTS);
                out.push(near(too_long(nowhere(), &whole), at, &what));
                Err(out)
            }
        }
    }

    /// How far the part may be moved so that the program can still be planned at the places that are tried about the one found:
    /// all its points within reach is not all, since the arm must come from each to the next.
    fn kept(&self, found: Found) -> f64 {
        let mut left = (MOVES / self.motion.program.len().max(1)).clamp(0, 600);
        let mut margin = found.margin;
        let mut ways: Vec<usize> = (0..around(1.0).count()).collect();
        'smaller: while margin >= 0.1 {
            for k in 0..ways.len() {
                let Some(by) = around(margin).nth(ways[k]).filter(|_| left > 0) else { return margin };
                left -= 1;
                self.progress.tell(|| format!("planning about the place, {margin:.1} mm away at most"));
                if !refused(self.motion, self.machine, add(found.position, by)).is_empty() {
                    // The way that fails first next time.
                    let way = ways.remove(k);
                    ways.insert(0, way);
                    margin = (margin * 0.9 * 10.0).floor() / 10.0;
                    continue 'smaller;
                }
            }
            return margin;
        }
        0.0
    }

    /// The largest error of the program there, as `accuracy` has it.
    fn error(&self, at: V3) -> Option<f64> {
        if !self.budget.tells_any() {
            return None;
        }
        let program = &self.motion.program;
        let put = put(self.motion, self.machine, at);
        let operations = Operations::new(program);
        let tell = |done: usize, of: usize| self.progress.tell(|| format!("errors at step {done} of {of}"));
        let texts = gr_ir::Texts::new(self.motion.sources.iter().map(|(id, f)| (id, &*f.text)));
        let report = match report_of_words((program, &texts), &put, &operations, self.budget, None, &tell) {
            Some(report) => report,
            None => {
                let planned = gr_robot::plan(program, &put, &texts, &gr_robot::Options::default()).ok()?;
                report(&planned.program, &operations, self.budget, None, &tell)
            }
        };
        report.rows.iter().filter_map(|r| r.worst.as_ref()).map(|w| w.errors.sum()).reduce(f64::max)
    }

    fn arm(&self, rapids: bool) -> Option<Arm<'_>> {
        let parts = parts(&self.motion.program, self.machine, rapids)?;
        if let Some(first) = parts.first().filter(|_| rapids && !self.quiet && !closed_form(self.machine)) {
            first.probe.extent();
            super::map::estimate(Arm::looks(&parts), |count| first.probe.sample_reach(count));
        }
        Some(Arm::new(parts, &|done, of| self.progress.tell(|| format!("reach: {done} of {of} layers"))))
    }

    fn best(&self, reach: &dyn Reach, tries: usize, allowed: &mut dyn FnMut(V3) -> bool) -> Result<Found, Option<V3>> {
        let tell = |done: usize, of: usize| self.progress.tell(|| format!("places: {done} of {of} parts of the grid"));
        place(reach, self.budget, self.aim, tries, allowed, &tell)
    }
}

/// So much of what stands in the way at the nearest place is told.
const FAULTS: usize = 3;

/// Where the path alone is longer than the reach.
fn too_long(mut finding: Diagnostic, whole: &Arm<'_>) -> Diagnostic {
    let (path, reach) = whole.sizes();
    for i in (0..3).filter(|i| path[*i] > reach[*i] + 1e-6) {
        finding.notes.push(format!("the path goes over {:.1} mm of {}, the reach over {:.1} mm", path[i], ["X", "Y", "Z"][i], reach[i]));
    }
    finding
}

/// A finding with the place that was nearest to what is wanted.
fn near(mut finding: Diagnostic, at: V3, what: &str) -> Diagnostic {
    let [x, y, z] = at;
    finding.notes.push(format!("at X {x} Y {y} Z {z} (--part {x},{y},{z}), {what}, but not every move can be made there"));
    finding
}

/// The machine with the part there, turned as its file has it.
fn put(motion: &Motion, machine: &Machine, at: V3) -> Machine {
    let mut put = put_down(machine, Frame { position: at, ..machine.cell.part_in_base() });
    let say = |code, args: &[String]| Diagnostic::new(code, FileId(0), Span::default(), args);
    tool_points(&mut Vec::new(), &mut put, &motion.program, &say);
    put
}

/// What keeps the program from being made there: its plan is the one that a build would take.
fn refused(motion: &Motion, machine: &Machine, at: V3) -> Vec<Diagnostic> {
    let put = put(motion, machine, at);
    let texts = gr_ir::Texts::new(motion.sources.iter().map(|(id, f)| (id, &*f.text)));
    let found = gr_robot::plan(&motion.program, &put, &texts, &gr_robot::Options::default()).err().unwrap_or_default();
    found.into_iter().filter(|d| d.severity == Severity::Error).collect()
}

/// What one tool does in one turn: points of its cuts, ends of its rapids.
type Way = (Frame, M3, Vec<V3>, Vec<V3>);

/// Frames and turns to be looked up by.
fn bits(tool: &Frame, turn: &M3) -> [u64; 21] {
    let mut all = tool.turn.iter().flatten().chain(&tool.position).chain(turn.iter().flatten()).map(|v| (v + 0.0).to_bits());
    std::array::from_fn(|_| all.next().unwrap_or_default())
}

/// The path of each tool in each turn that the program gives it, from the part's origin in the directions of the base; of rapids
/// their ends. None where the machine file doesn't say what a rotary word means.
fn parts<'m>(program: &gr_ir::Program, machine: &'m Machine, rapids: bool) -> Option<Vec<Part<'m>>> {
    let part = machine.cell.part_in_base().turn;
    let turns = Turns::new(machine);
    let mut out: Vec<Way> = Vec::new();
    let mut numbers = std::collections::HashMap::new();
    let mut known = std::collections::HashSet::new();
    let mut named = gr_accuracy::Named::default();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        let said = named.step(&view);
        let cuts = view.op.feeds();
        // As a build does: a rapid before all is named goes nowhere yet.
        if !cuts && !(rapids && view.op.moves() && said == [true; 3]) {
            continue;
        }
        let tool = tool(machine, view.state);
        let work = gr_accuracy::work_shift(view.state);
        let frame = product(&part, &work.turn);
        let mut push = |pose: &Pose| {
            let turn = product(&frame, &turns.of(pose, view.state).ok()?);
            let n = *numbers.entry(bits(&tool, &turn)).or_insert_with(|| {
                out.push((tool, turn, Vec::new(), Vec::new()));
                out.len() - 1
            });
            let p = rotate(&part, work.apply(pose.xyz()));
            if known.insert((n, cuts, p.map(|v| (v / SAME).round() as i64))) {
                if cuts { out[n].2.push(p) } else { out[n].3.push(p) }
            }
            Some(())
        };
        if !cuts {
            push(view.end)?;
            continue;
        }
        push(view.start)?;
        for pose in along(&view, &turns) {
            push(&pose)?;
        }
    }
    if out.is_empty() {
        out.push((Frame::IDENTITY, product(&part, &turns.still()), Vec::new(), vec![[0.0; 3]]));
    }
    let part = |(tool, turn, mut points, ends): Way| {
        let cuts = points.len();
        points.extend(ends);
        Part { probe: Probe::new(machine).held(tool, turn), points, cuts }
    };
    Some(out.into_iter().map(part).collect())
}

/// Places of a cut behind its start, near enough to each other in place and turn.
fn along(view: &gr_ir::View<'_, '_>, turns: &Turns<'_>) -> Vec<Pose> {
    let turned = match (turns.of(view.start, view.state), turns.of(view.end, view.state)) {
        (Ok(a), Ok(b)) => norm(rotation_vector(&product(&transpose(&a), &b))),
        _ => 0.0,
    };
    let words = (3..6).map(|i| (view.end.axes[i] - view.start.axes[i]).abs()).fold(turned, f64::max);
    let mut chords: Vec<gr_ir::Axes> = vec![view.start.axes];
    geometry::flatten(&view.op, view.start, view.end, SAME / 10.0, |axes| chords.push(*axes));
    let by_turn = ((words / TURN).ceil().clamp(1.0, 1e4) as usize).div_ceil((chords.len() - 1).max(1));
    let mut out = Vec::new();
    for (n, pair) in chords.windows(2).enumerate() {
        let way = norm(sub([pair[1][0], pair[1][1], pair[1][2]], [pair[0][0], pair[0][1], pair[0][2]]));
        let pieces = ((way / APART).ceil().clamp(1.0, 1e5) as usize).max(by_turn);
        for i in 1..=pieces {
            let t = i as f64 / pieces as f64;
            let axes = std::array::from_fn(|k| pair[0][k] + (pair[1][k] - pair[0][k]) * t);
            let tool_axis = between(view, (n as f64 + t) / (chords.len() - 1) as f64);
            out.push(Pose { axes, tool_axis, spin: view.end.spin });
        }
    }
    out
}

/// The tool's axis along a move, where the program states one.
fn between(view: &gr_ir::View<'_, '_>, share: f64) -> Option<V3> {
    let (Some(a), Some(b)) = (view.start.tool_axis, view.end.tool_axis) else { return view.end.tool_axis };
    let v = add(scale(a, 1.0 - share), scale(b, share));
    Some(if norm(v) > 1e-9 { scale(v, 1.0 / norm(v)) } else { b })
}

/// The tool point on the flange: the machine file's, else as long as the program's tool offset.
fn tool(machine: &Machine, state: &gr_ir::State) -> Frame {
    let number = u32::try_from(state.tool).unwrap_or(0);
    let known = machine.cell.tools.contains_key(&number);
    if known { machine.cell.tool_frame(number) } else { machine.tool_of_length(state.tool_offset[2]) }
}

/// mm.
const MOST_HEIGHT: f64 = 100_000.0;

fn largest(global: &Global, args: &PlaceArgs, machine: &Machine) -> Exit {
    let ends: Option<Vec<f64>> = args.heights.split(',').map(|t| t.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let Some(ends) = ends.filter(|e| e.len() == 1 || e.len() == 2) else {
        let why = "one height, or the lowest and the highest: -240,240".to_string();
        return super::refuse(global, Path::new("place"), code::ACCURACY_BAD_OPTION, &["--heights".to_string(), why]);
    };
    if ends.iter().any(|z| z.abs() > MOST_HEIGHT) {
        let why = format!("heights beyond {MOST_HEIGHT} mm are out of every machine's reach");
        return super::refuse(global, Path::new("place"), code::ACCURACY_BAD_OPTION, &["--heights".to_string(), why]);
    }
    let (low, high) = (ends[0], *ends.last().unwrap_or(&ends[0]));
    let layers = ((high - low).abs() / 20.0).ceil() as usize;
    let heights: Vec<f64> = (0..=layers).map(|i| low + (high - low) * i as f64 / layers.max(1) as f64).collect();
    let held = super::map::Held::new(machine, args.tool, args.tool_length, args.tool_turn.as_deref());
    let (held, probe) = match held.and_then(|held| held.probe(machine).map(|probe| (held, probe))) {
        Ok(both) => both,
        Err((what, why)) => return super::refuse(global, Path::new("place"), code::ACCURACY_BAD_OPTION, &[what, why]),
    };
    let held = held.words(&probe);
    let Some(Rectangle { x: (x0, x1), middle, half }) = rectangle(&probe, &heights) else {
        let why = format!("no rectangle is within reach from there to there; {}", super::map::reach_along(&probe, 2));
        return super::refuse(global, Path::new(&machine.id), code::ACCURACY_BAD_OPTION, &[format!("--heights {}", args.heights), why]);
    };
    let (y0, y1) = (middle - half, middle + half);
    super::print(&match args.format {
        TableFormat::Json => format!("{:#}\n", json!({ "machine": machine.id, "heights": [low, high], "x": [x0, x1], "y": [y0, y1], "tool": held })),
        TableFormat::Csv => format!("x from,x to,y from,y to,z from,z to\n{x0},{x1},{y0},{y1},{low},{high}\n"),
        TableFormat::Text => {
            format!("largest rectangle in reach of {} from Z {low} to {high} mm, symmetric about Y {middle}:\nX {x0} to {x1}, Y {y0} to {y1} mm\n{held}, at every place\n", machine.id)
        }
    })
}
