//! `gcc-robot place part.ngc --machine usp/2ups-prp`

use std::path::Path;

use gr_accuracy::map::Probe;
use gr_accuracy::place::{Aim, Arm, Found, Mill, Part, Reach, Rectangle, place, rectangle};
use gr_accuracy::report::{Operations, report, report_of_words};
use gr_accuracy::{Budget, BudgetOptions, closed_form, put_down};
use gr_ir::{Sources as _, geometry};
use gr_machine::{Chain, Machine};
use gr_machine::math::{Frame, V3, add, norm, rotate, scale, sub};
use gr_text::{Diagnostic, FileId, Severity, Span, code};
use serde_json::json;

use super::accuracy::{beyond, misfit, referenced, tool_points, unsaid};
use super::check::{Checked, show};
use crate::exit::Exit;
use crate::options::{Global, LintArgs, PlaceAim, PlaceArgs, TableFormat};
use crate::pipeline::{Motion, load, motion};
use crate::progress::Progress;
use crate::setup::station;
use crate::sources::Sources;

/// The path is looked at this often, mm: reach is not convex, so the ends of a move don't speak for what lies between.
const APART: f64 = 5.0;
/// Points nearer to each other than this are one, mm.
const SAME: f64 = 0.5;

pub fn run(global: &Global, args: &PlaceArgs) -> Exit {
    let mut renderer = global.renderer(true);
    let mut sources = Sources::default();
    let name = args.file.clone().unwrap_or_else(|| "place".into());
    let Some(station) = station(&args.setup, &LintArgs::default(), Path::new("."), &mut sources, &mut renderer) else {
        renderer.finish(false);
        return Exit::Findings;
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
        return largest(global, args, &machine);
    };
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
    super::print(&match args.format {
        TableFormat::Json => {
            format!("{:#}\n", json!({ "machine": machine.id, "position": [x, y, z], "margin": found.margin, "margin_looked_at_every": found.apart, "error_um": error, "error_of": parts_of_error }))
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
            format!(
                "part's origin at X {x} Y {y} Z {z} mm in the base of {} (--part {x},{y},{z})\nfree to move {:.1} mm any way: every point of the path stays within reach ({how})\n{error}every move of the program can be made there, rapids too\n",
                machine.id, found.margin
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
        if let Some(mill) = Mill::new(self.machine, program, true) {
            let turned: Vec<Diagnostic> = mill.turned.iter().filter_map(limits).collect();
            if !turned.is_empty() {
                return Err(turned);
            }
            return self.best(&mill, 1, &mut |_| true).map_err(|_| {
                // Where rapids are out of reach everywhere: which, when the cuts fit.
                let Some(cuts) = Mill::new(self.machine, program, false) else { return vec![nowhere()] };
                let Ok(found) = self.best(&cuts, 1, &mut |_| true) else { return vec![nowhere()] };
                let mut out: Vec<Diagnostic> = mill.outside(program, found.position).iter().filter_map(limits).collect();
                out.push(near(nowhere(), found.position, "its cuts fit"));
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
        match self.best(&self.arm(true), tries, &mut planned) {
            Ok(found) => Ok(found),
            Err(Some(at)) => {
                faults.push(near(nowhere(), at, &format!("the best of {number} places that were planned")));
                Err(faults)
            }
            Err(None) => {
                let Ok(found) = self.best(&self.arm(false), 1, &mut |_| true) else { return Err(vec![nowhere()]) };
                let mut out = refused(self.motion, self.machine, found.position);
                out.push(near(nowhere(), found.position, "its cuts fit"));
                Err(out)
            }
        }
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
        let report = match report_of_words(program, &put, &operations, self.budget, None, &tell) {
            Some(report) => report,
            None => {
                let texts = gr_ir::Texts::new(self.motion.sources.iter().map(|(id, f)| (id, &*f.text)));
                let planned = gr_robot::plan(program, &put, &texts, &gr_robot::Options::default()).ok()?;
                report(&planned.program, &operations, self.budget, None, &tell)
            }
        };
        report.rows.iter().filter_map(|r| r.worst.as_ref()).map(|w| w.errors.sum()).reduce(f64::max)
    }

    fn arm(&self, rapids: bool) -> Arm<'_> {
        let parts = parts(&self.motion.program, self.machine, rapids);
        if let Some(first) = parts.first().filter(|_| rapids && !self.quiet && !closed_form(self.machine)) {
            first.probe.extent();
            super::map::estimate(Arm::looks(&parts), |count| first.probe.sample_reach(count));
        }
        Arm::new(parts, &|done, of| self.progress.tell(|| format!("reach: {done} of {of} layers")))
    }

    fn best(&self, reach: &dyn Reach, tries: usize, allowed: &mut dyn FnMut(V3) -> bool) -> Result<Found, Option<V3>> {
        let tell = |done: usize, of: usize| self.progress.tell(|| format!("places: {done} of {of} parts of the grid"));
        place(reach, self.budget, self.aim, tries, allowed, &tell)
    }
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

/// What one tool does: its frame, points of its cuts, ends of its rapids.
type Way = (Frame, Vec<V3>, Vec<V3>);

/// The path of each tool, from the part's origin in the directions of the base; of rapids their ends.
fn parts<'m>(program: &gr_ir::Program, machine: &'m Machine, rapids: bool) -> Vec<Part<'m>> {
    let turn = machine.cell.part_in_base().turn;
    let mut out: Vec<Way> = Vec::new();
    let mut known = std::collections::HashSet::new();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if !view.op.feeds() && !(rapids && view.op.moves()) {
            continue;
        }
        let tool = tool(machine, view.state);
        let n = out.iter().position(|(t, ..)| *t == tool).unwrap_or_else(|| {
            out.push((tool, Vec::new(), Vec::new()));
            out.len() - 1
        });
        let work = gr_accuracy::work_shift(view.state);
        let cuts = view.op.feeds();
        let mut push = |p: V3| {
            let p = rotate(&turn, work.apply(p));
            if known.insert((n, cuts, p.map(|v| (v / SAME).round() as i64))) {
                if cuts { out[n].1.push(p) } else { out[n].2.push(p) }
            }
        };
        if !view.op.feeds() {
            push(view.end.xyz());
            continue;
        }
        let mut from = view.start.xyz();
        push(from);
        geometry::flatten(&view.op, view.start, view.end, SAME / 10.0, |axes| {
            let to = [axes[0], axes[1], axes[2]];
            let way = sub(to, from);
            let pieces = (norm(way) / APART).ceil().clamp(1.0, 1e5) as usize;
            (1..=pieces).for_each(|i| push(add(from, scale(way, i as f64 / pieces as f64))));
            from = to;
        });
    }
    if out.is_empty() {
        out.push((Frame::IDENTITY, Vec::new(), vec![[0.0; 3]]));
    }
    let part = |(tool, mut points, ends): Way| {
        let cuts = points.len();
        points.extend(ends);
        Part { probe: Probe::downward(machine).with_tool(tool, &turn), points, cuts }
    };
    out.into_iter().map(part).collect()
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
    let probe = Probe::downward(machine);
    let Some(Rectangle { x: (x0, x1), middle, half }) = rectangle(&probe, &heights) else {
        let (least, most) = probe.extent()[2];
        let why = format!("no rectangle is within reach from there to there; the tool gets to Z {least:.1} to {most:.1} mm at most");
        return super::refuse(global, Path::new(&machine.id), code::ACCURACY_BAD_OPTION, &[format!("--heights {}", args.heights), why]);
    };
    let (y0, y1) = (middle - half, middle + half);
    super::print(&match args.format {
        TableFormat::Json => format!("{:#}\n", json!({ "machine": machine.id, "heights": [low, high], "x": [x0, x1], "y": [y0, y1] })),
        TableFormat::Csv => format!("x from,x to,y from,y to,z from,z to\n{x0},{x1},{y0},{y1},{low},{high}\n"),
        TableFormat::Text => format!("largest rectangle in reach of {} from Z {low} to {high} mm, symmetric about Y {middle}:\nX {x0} to {x1}, Y {y0} to {y1} mm\n", machine.id),
    })
}
