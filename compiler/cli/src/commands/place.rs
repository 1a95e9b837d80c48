//! `gcc-robot place part.ngc --machine usp/2ups-prp`

use std::path::Path;

use gr_accuracy::map::Probe;
use gr_accuracy::place::{Aim, place, rectangle};
use gr_accuracy::{Budget, BudgetOptions};
use gr_machine::Machine;
use gr_text::code;
use serde_json::json;

use super::accuracy::referenced;
use super::check::show;
use crate::exit::Exit;
use crate::options::{Global, LintArgs, PlaceAim, PlaceArgs, TableFormat};
use crate::pipeline::{load, motion};
use crate::progress::Progress;
use crate::setup::station;
use crate::sources::Sources;

/// At most so many points of a path are looked at; the corners of its box are always among them.
const POINTS: usize = 400;

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
    let points = path(&motion.program);
    let probe = Probe::downward(&machine);
    let aim = if args.aim == PlaceAim::Error { Aim::Error } else { Aim::Margin };
    let found = place(&probe, &budget, &points, aim, &|done, of| progress.tell(|| format!("places: {done} of {of} layers")));
    drop(progress);
    let Some(found) = found else {
        return super::refuse(global, file, code::PLACE_DOES_NOT_FIT, &[machine.id.clone()]);
    };
    let [x, y, z] = found.position.map(|v| (v * 1e3).round() / 1e3 + 0.0);
    let error = found.error.map(|e| e * 1e3);
    super::print(&match args.format {
        TableFormat::Json => {
            format!("{:#}\n", json!({ "machine": machine.id, "position": [x, y, z], "margin": found.margin, "error_um": error }))
        }
        TableFormat::Csv => {
            format!("x mm,y mm,z mm,margin mm,error um\n{x},{y},{z},{:.3},{}\n", found.margin, error.map_or(String::new(), |e| format!("{e:.3}")))
        }
        TableFormat::Text => {
            let error = match error {
                Some(e) => format!("largest error of the path there: {e:.1} µm (kinematic + geometric, longest of each)\n"),
                None => "its machine file has no accuracy data: only reach was looked at\n".to_string(),
            };
            format!(
                "part's origin at X {x} Y {y} Z {z} mm in the base of {} (--part {x},{y},{z})\nfree to move {:.1} mm any way along X, Y and Z\n{error}",
                machine.id, found.margin
            )
        }
    })
}

/// Ends of the moves, thinned out, and the corners of the box they lie in.
fn path(program: &gr_ir::Program) -> Vec<[f64; 3]> {
    let mut all = Vec::new();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if view.op.feeds() {
            let p = view.end.xyz();
            (0..3).for_each(|i| (low[i], high[i]) = (low[i].min(p[i]), high[i].max(p[i])));
            all.push(p);
        }
    }
    if all.is_empty() {
        return vec![[0.0; 3]];
    }
    let step = all.len().div_ceil(POINTS);
    let mut out: Vec<[f64; 3]> = all.into_iter().step_by(step).collect();
    out.extend((0..8).map(|c| [0, 1, 2].map(|i| if c >> i & 1 == 0 { low[i] } else { high[i] })));
    out
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
    let Some((x0, x1, half)) = rectangle(&Probe::downward(machine), &heights) else {
        return super::refuse(global, Path::new(&machine.id), code::PLACE_DOES_NOT_FIT, &[machine.id.clone()]);
    };
    super::print(&match args.format {
        TableFormat::Json => format!("{:#}\n", json!({ "machine": machine.id, "heights": [low, high], "x": [x0, x1], "y": [-half, half] })),
        TableFormat::Csv => format!("x from,x to,y from,y to,z from,z to\n{x0},{x1},{},{half},{low},{high}\n", -half),
        TableFormat::Text => format!("largest rectangle in reach of {} from Z {low} to {high} mm, symmetric about Y 0:\nX {x0} to {x1}, Y {} to {half} mm\n", machine.id, -half),
    })
}
