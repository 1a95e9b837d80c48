//! `gcc-robot place part.ngc --machine usp/2ups-prp`

use std::path::Path;

use gr_accuracy::map::Probe;
use gr_accuracy::place::{Aim, Part, Rectangle, place, rectangle};
use gr_accuracy::{Budget, BudgetOptions};
use gr_ir::geometry;
use gr_machine::Machine;
use gr_machine::math::{Frame, add, norm, rotate, scale, sub};
use gr_text::{Diagnostic, FileId, Span, code};
use serde_json::json;

use super::accuracy::{misfit, referenced, tool_points, unsaid};
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
    let turn = machine.cell.part_in_base().turn;
    let aim = if args.aim == PlaceAim::Error { Aim::Error } else { Aim::Margin };
    let tell = |done: usize, of: usize| progress.tell(|| format!("places: {done} of {of} layers"));
    // Where rapids are out of reach everywhere, the place goes by the cuts, and the rapids are told.
    let found = place(&parts(&motion.program, &machine, true), &budget, aim, &tell)
        .or_else(|| place(&parts(&motion.program, &machine, false), &budget, aim, &tell));
    let Some(found) = found else {
        drop(progress);
        return super::refuse(global, file, code::PLACE_DOES_NOT_FIT, &[machine.id.clone()]);
    };
    let [x, y, z] = found.position.map(|v| (v * 1e3).round() / 1e3 + 0.0);
    let faults = refused(&motion, &machine, Frame { turn, position: [x, y, z] });
    drop(progress);
    let whole = faults.is_empty();
    // A machine without any data is looked at for reach alone, which the result says; one with some lacks the rest.
    let parts_of_error = [("kinematic", budget.joints.is_some()), ("geometric", budget.geometry.is_some())];
    let parts_of_error: Vec<&str> = parts_of_error.into_iter().filter(|(_, known)| *known).map(|(n, _)| n).collect();
    let mut faults = faults;
    if !parts_of_error.is_empty() {
        let top = |args: [String; 2]| Diagnostic::new(code::ACCURACY_NO_DATA, FileId(0), Span::default(), &args);
        faults.extend(unsaid(&machine, &budget).into_iter().map(top));
    }
    let top = |args: [String; 2]| Diagnostic::new(code::ACCURACY_NO_DATA, FileId(0), Span::default(), &args);
    faults.extend(super::map::limitless(&machine).map(top));
    show(&mut renderer, &Checked { sources: motion.sources, found: faults, ..Checked::nothing() });
    renderer.finish(false);
    let error = found.error.map(|e| e * 1e3);
    let printed = super::print(&match args.format {
        TableFormat::Json => {
            format!("{:#}\n", json!({ "machine": machine.id, "position": [x, y, z], "margin": found.margin, "margin_looked_at_every": found.apart, "error_um": error, "error_of": parts_of_error, "whole_program": whole }))
        }
        TableFormat::Csv => {
            format!("x mm,y mm,z mm,margin mm,error um\n{x},{y},{z},{:.3},{}\n", found.margin, error.map_or(String::new(), |e| format!("{e:.3}")))
        }
        TableFormat::Text => {
            let error = match error {
                Some(e) => format!("largest error of the path there: {e:.1} µm ({}, the longest; without deflection)\n", parts_of_error.join(" + ")),
                None => "its machine file has no accuracy data: only reach was looked at\n".to_string(),
            };
            let whole = if whole { "every move of the program can be made there, rapids too\n" } else { "not every move of the program can be made there\n" };
            format!(
                "part's origin at X {x} Y {y} Z {z} mm in the base of {} (--part {x},{y},{z})\nfree to move {:.1} mm any way: every point of the path stays within reach (looked at every {:.1} mm)\n{error}{whole}",
                machine.id, found.margin, found.apart
            )
        }
    });
    if whole { printed } else { Exit::Findings }
}

/// What keeps the program from being made there: its plan is the one that a build would take.
fn refused(motion: &Motion, machine: &Machine, part: Frame) -> Vec<Diagnostic> {
    let mut put = machine.clone();
    (put.cell.table, put.cell.part) = (Frame::IDENTITY, part);
    let say = |code, args: &[String]| Diagnostic::new(code, FileId(0), Span::default(), args);
    tool_points(&mut Vec::new(), &mut put, &motion.program, &say);
    let texts = gr_ir::Texts::new(motion.sources.iter().map(|(id, f)| (id, &*f.text)));
    gr_robot::plan(&motion.program, &put, &texts, &gr_robot::Options::default()).err().unwrap_or_default()
}

/// The path of each tool, from the part's origin in the directions of the base; of rapids their ends.
fn parts<'m>(program: &gr_ir::Program, machine: &'m Machine, rapids: bool) -> Vec<Part<'m>> {
    let turn = machine.cell.part_in_base().turn;
    let mut out: Vec<(Frame, Vec<[f64; 3]>)> = Vec::new();
    let mut known = std::collections::HashSet::new();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if !view.op.feeds() && !(rapids && view.op.moves()) {
            continue;
        }
        let tool = tool(machine, view.state);
        let n = out.iter().position(|(t, _)| *t == tool).unwrap_or_else(|| {
            out.push((tool, Vec::new()));
            out.len() - 1
        });
        let work = gr_accuracy::work_shift(view.state);
        let mut push = |p: [f64; 3]| {
            let p = rotate(&turn, work.apply(p));
            if known.insert((n, p.map(|v| (v / SAME).round() as i64))) {
                out[n].1.push(p);
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
        out.push((Frame::IDENTITY, vec![[0.0; 3]]));
    }
    let part = |(tool, points)| Part { probe: Probe::downward(machine).with_tool(tool, &turn), points };
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
    let Some(Rectangle { x: (x0, x1), middle, half }) = rectangle(&Probe::downward(machine), &heights) else {
        return super::refuse(global, Path::new(&machine.id), code::PLACE_DOES_NOT_FIT, &[machine.id.clone()]);
    };
    let (y0, y1) = (middle - half, middle + half);
    super::print(&match args.format {
        TableFormat::Json => format!("{:#}\n", json!({ "machine": machine.id, "heights": [low, high], "x": [x0, x1], "y": [y0, y1] })),
        TableFormat::Csv => format!("x from,x to,y from,y to,z from,z to\n{x0},{x1},{y0},{y1},{low},{high}\n"),
        TableFormat::Text => format!("largest rectangle in reach of {} from Z {low} to {high} mm, symmetric about Y {middle}:\nX {x0} to {x1}, Y {y0} to {y1} mm\n", machine.id),
    })
}
