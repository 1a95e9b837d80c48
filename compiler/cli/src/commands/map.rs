//! `gcc-robot map --machine usp/2ups-prp --quantity kinematic-x --plane z=0 -o map.png`

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use gr_accuracy::map::{self, Map, Plane, Probe, Quantity, Request};
use gr_accuracy::outline::outline;
use gr_accuracy::picture::Picture;
use gr_accuracy::{Budget, BudgetOptions, closed_form};
use gr_machine::{Chain, Machine};
use gr_text::code;

use super::accuracy::{referenced, triple};
use crate::exit::Exit;
use crate::options::{Global, MapArgs};
use crate::progress::Progress;
use crate::sources::Sources;

pub fn run(global: &Global, args: &MapArgs) -> Exit {
    let mut sources = Sources::default();
    let machine = match super::machine::load(&args.machine, &mut sources) {
        Ok(m) => referenced(m, args.reference),
        Err(found) => {
            let mut renderer = global.renderer(true);
            found.iter().for_each(|d| renderer.show(&sources, d));
            renderer.finish(false);
            return Exit::Findings;
        }
    };
    let refuse = |what: &str, why: &str| {
        super::refuse(global, Path::new(&args.machine), code::ACCURACY_BAD_OPTION, &[what.to_string(), why.to_string()])
    };
    if let Chain::Incomplete { missing, .. } = &machine.chain {
        return refuse(&machine.id, &format!("it is a template; its file must still say {}", missing.join(", ")));
    }
    let Some(plane) = plane(&args.plane) else {
        return refuse("--plane", "one of x, y and z, and where: z=0");
    };
    let budget = Budget::new(&machine, BudgetOptions { grade: args.grade, usp2009: args.reference.is_some() });
    let made = if args.quantity == "sensitivity" {
        bars(&machine, plane, args)
    } else {
        area(global, args, &machine, plane, &budget)
    };
    let (text, files) = match made {
        Ok(made) => made,
        Err((what, why)) => return refuse(&what, &why),
    };
    let mut renderer = global.renderer(true);
    let exit = super::write(&mut renderer, &mut sources, Path::new(&args.machine), &files);
    renderer.finish(false);
    if exit != Exit::Ok {
        return exit;
    }
    super::print(&text)
}

type Made = (String, Vec<(PathBuf, Vec<u8>)>);
type Refused = (String, String);

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
    if geometry && budget.geometry.is_none() {
        return lacks("the tolerances of its geometry", "`grade` or `parameter` in `[accuracy]`, or `--it`");
    }
    let stiff = machine.cell.stiffness.as_ref();
    let soft = (0..machine.joints.len()).find(|i| stiff.is_none_or(|s| s.members.iter().all(|m| m.joint != *i)));
    if let (true, Some(i)) = (stiffness, soft) {
        return lacks(&format!("the stiffness of {}", machine.joints[i].name), "`[stiffness]`");
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
    let by_force = matches!(quantity, Quantity::Elastic(_) | Quantity::Total);
    let by_grade = matches!(quantity, Quantity::Geometric(_) | Quantity::Total);
    heeds("--signs", args.signs.is_some(), by_joints, "errors by the joints")?;
    heeds("--force", args.force.is_some(), by_force, "deflections and the total")?;
    heeds("--it", args.grade.is_some(), by_grade, "errors by the geometry and the total")?;
    let probe = Probe::downward(machine);
    let size = size(&probe, machine, args, 400)?;
    let request = Request { quantity, plane, size, window: None, force, signs, deviations: None };
    let progress = Progress::new(global.quiet, format!("map of {}", machine.id));
    if !closed_form(machine) && !global.quiet {
        estimate(&probe, budget, &request);
    }
    let tell = std::sync::Mutex::new(&progress);
    let map = map::map(&probe, budget, &request, &|done, of| {
        if let Ok(p) = tell.try_lock() {
            p.tell(|| format!("map of {}: row {done} of {of}", machine.id));
        }
    });
    let title = format!("{}: {}, {} = {} mm", machine.id, quantity.words(), ["X", "Y", "Z"][plane.axis], plane.at);
    let mut text = told(&map, machine);
    if quantity == Quantity::Workspace && closed_form(machine) {
        progress.tell(|| format!("volume of {}", machine.id));
        let _ = writeln!(text, "volume {:.1} dm³ (by layers of a grid)", map::volume(&probe, 68, 120) / 1e6);
    }
    drop(progress);
    if let Quantity::Elastic(_) | Quantity::Stiffness = quantity {
        text += "springs of the drives only; the model of its source was never confirmed by better than a factor of 2\n";
    }
    if map.summary().is_none() {
        let _ = writeln!(text, "nothing of this plane is within reach");
    }
    let picture = Picture::map(&map, &title);
    Ok((text, files(&args.output, &picture, || map.csv())?))
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

/// Says how long a map by search takes, from some places of it.
fn estimate(probe: &Probe<'_>, budget: &Budget, request: &Request) {
    const SOME: usize = 64;
    let start = std::time::Instant::now();
    map::sample(probe, budget, request, SOME);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let places = request.size.0 * request.size.1;
    let seconds = start.elapsed().as_secs_f64() / SOME as f64 * places as f64 / cores as f64;
    if seconds >= 2.0 {
        // Whoever closed standard error does not want to know.
        let _ = writeln!(std::io::stderr(), "{places} places by numerical search: about {seconds:.0} s");
    }
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

fn told(map: &Map, machine: &Machine) -> String {
    let (a, b) = map.plane.axes();
    let name = |i: usize| ["X", "Y", "Z"][i];
    let unit = match map.quantity.unit() {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    let mut out = format!("{}: {} in the plane {} = {} mm\n", machine.id, map.quantity.name(), name(map.plane.axis), map.plane.at);
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

/// One row of a bar chart: its name, and a number for each column.
type Bar = (String, Vec<f64>);

/// Mean sensitivities, the greatest first.
fn bars(machine: &Machine, plane: Plane, args: &MapArgs) -> Result<Made, Refused> {
    if args.signs.is_some() || args.force.is_some() || args.grade.is_some() {
        return Err(("--quantity sensitivity".into(), "it goes by the geometry alone: no `--signs`, `--force` or `--it`".into()));
    }
    let probe = Probe::downward(machine);
    let size = size(&probe, machine, args, 120)?;
    let published = args.reference.and_then(|_| map::mean_sensitivity_usp2009(&probe, plane, size));
    let (columns, what, mut all): (&[&str], &str, Vec<Bar>) = match published {
        Some(list) => (
            &["yaw rad/mm", "arm mm/mm"],
            "mean change of yaw and arm length per mm of each length (Gojtan 2009, eq. 7.5)",
            list.into_iter().map(|(n, v)| (n, v.to_vec())).collect(),
        ),
        None => (
            &["X", "Y", "Z", "length"],
            "mean movement of the tool point per mm or rad of each number of the geometry, mm",
            map::mean_sensitivity(&probe, plane, size).into_iter().map(|(n, v)| (n, v.to_vec())).collect(),
        ),
    };
    let last = |b: &Bar| b.1.last().copied().unwrap_or(0.0);
    // Rounding must not decide the order of what a symmetric machine has twice.
    let rounded = |b: &Bar| (last(b) * 1e9).round();
    all.sort_by(|a, b| rounded(b).total_cmp(&rounded(a)));
    let mut text = format!("{}: {what}\n{:<20}", machine.id, "");
    columns.iter().for_each(|c| text += &format!("{c:>14}"));
    for (name, values) in &all {
        let _ = write!(text, "\n{name:<20}");
        values.iter().for_each(|v| text += &format!("{v:>14.7}"));
    }
    text.push('\n');
    let rows: Vec<(String, f64)> = all.iter().map(|b| (b.0.clone(), last(b))).collect();
    let title = format!("{}: mean sensitivity, {} = {} mm", machine.id, ["X", "Y", "Z"][plane.axis], plane.at);
    let unit = if columns.len() == 2 { "arm, mm per mm" } else { "tool point, mm per mm or rad" };
    let picture = Picture::bars(&rows, &title, unit);
    let csv = || {
        let mut out = format!("parameter,{}\n", columns.join(",").to_lowercase());
        for (name, values) in &all {
            let list: Vec<String> = values.iter().map(f64::to_string).collect();
            let _ = writeln!(out, "{name},{}", list.join(","));
        }
        out
    };
    Ok((text, files(&args.output, &picture, csv)?))
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

