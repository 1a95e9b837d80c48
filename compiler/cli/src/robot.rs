//! Programs for robots: planned for a machine, written in its maker's language, checked, verified.

use std::path::Path;

use clap::Args;
use gr_accuracy::compensate::{self, Correction};
use gr_ir::Sources;
use gr_machine::math::norm;
use gr_machine::{Kind, Machine};
use gr_robot::{Options, Planned, Workingstep, plan};
use gr_text::Diagnostic;
use gr_text::figures::{duration, number};

use crate::emit::{Artifact, Goal};
use crate::commands::check::Checked;
use crate::pipeline::Motion;

/// Options of robot programs.
#[derive(Args, Debug, Clone, Default)]
pub struct RobotOptions {
    /// Robots: height above the first and last point at which the tool comes and leaves; 0 = none [default: 50]
    #[arg(long, value_name = "MM")]
    pub approach: Option<f64>,
    /// Robots: where a cut can't be done in one configuration, lift the tool by this much and change it there
    #[arg(long, value_name = "MM", num_args = 0..=1, default_missing_value = "50", require_equals = true)]
    pub reconfigure: Option<f64>,
    /// Robots: write forms whose meaning on the controller is not confirmed, too
    #[arg(long)]
    pub allow_unverified: bool,
    /// Job file, which gives parts of the program to setups with their own placement of the part
    #[arg(long, value_name = "FILE")]
    pub job: Option<std::path::PathBuf>,
    /// Correct every point for the deviations in `[as_built]` of the machine file
    #[arg(long)]
    pub compensate: bool,
    /// setpoints: time in which acceleration builds up, s; 0 = at once [default: 0]
    #[arg(long, value_name = "S")]
    pub smoothing: Option<f64>,
}

/// What came of a build for a robot.
pub struct Made {
    pub artifacts: Vec<Artifact>,
    pub notes: Vec<Diagnostic>,
    pub summary: String,
}

/// Whether a target is a robot's language.
pub fn is_language(target: &str) -> bool {
    gr_vendors::language(target).is_some()
}

/// The options of a plan.
pub fn options(motion: &Motion, goal: &Goal<'_>, name: &str) -> Result<Options, String> {
    let (o, default) = (&goal.options.robot, Options::default());
    let good = |v: f64| v.is_finite() && v >= 0.0;
    if !o.approach.is_none_or(good) || !o.reconfigure.is_none_or(good) {
        return Err("--approach and --reconfigure are lengths in mm, 0 or more".into());
    }
    let tolerance = goal.options.arc_tolerance.unwrap_or(default.tolerance);
    if !(tolerance > 0.0) {
        return Err("--arc-tolerance must be above zero".into());
    }
    let setups = motion.setups.clone();
    let approach = o.approach.unwrap_or(default.approach);
    Ok(Options { name: name.to_string(), tolerance, approach, reconfigure: o.reconfigure, setups, no_tool_table: motion.no_tool_table, ..default })
}

/// Reads the job file that the options name into the motion it is for. What is wrong comes back; it points into the
/// motion's files.
pub fn take_job(motion: &mut Motion, goal: &Goal<'_>) -> Result<(), Vec<Diagnostic>> {
    match (&goal.options.robot.job, goal.machine) {
        (Some(path), Some(machine)) => take_job_of(motion, path, machine),
        _ => Ok(()),
    }
}

fn take_job_of(motion: &mut Motion, path: &Path, machine: &Machine) -> Result<(), Vec<Diagnostic>> {
    let name = path.display().to_string();
    let text = match crate::sources::read_setup(path) {
        Ok(decoded) => decoded.text,
        Err((code, args)) => {
            let file = motion.sources.add(name, "");
            return Err(vec![crate::sources::about_file(code, file, &args)]);
        }
    };
    motion.subs.push(path.to_path_buf());
    let file = motion.sources.add(name, text.clone());
    let clampings = gr_machine::parse_job(file, &text)?;
    let mut found: Vec<Diagnostic> =
        misfits(&clampings, motion).into_iter().map(|(span, what)| Diagnostic::new(gr_text::code::JOB_BAD_VALUE, file, span, &[what])).collect();
    let (misnamed, help) = misnamed(&clampings, motion);
    let misnamed = misnamed.into_iter().map(|(span, what)| Diagnostic { help: help.clone(), ..Diagnostic::new(gr_text::code::JOB_BAD_VALUE, file, span, &[what]) });
    found.extend(misnamed);
    if !found.is_empty() {
        return Err(found);
    }
    let line = |at: u32| text.get(..at as usize).map_or(0, |t| t.matches('\n').count()) as u32;
    let setup = |c: gr_machine::Clamping| gr_robot::Setup {
        place: gr_ir::Source { file, line: line(c.from_line.map_or(c.place.start, |(_, span)| span.start)), ..gr_ir::Source::default() },
        part: c.part(&machine.cell.part).map(|part| machine.cell.carried(machine.cell.table.then(&part))),
        name: c.name,
        from_line: c.from_line.map(|(l, _)| l - 1),
        workingsteps: c.workingsteps.into_iter().map(|(w, _)| w).collect(),
    };
    motion.setups = clampings.into_iter().map(setup).collect();
    Ok(())
}

/// Lines that the program doesn't have.
fn misfits(clampings: &[gr_machine::Clamping], motion: &Motion) -> Vec<(gr_text::Span, String)> {
    let lines = motion.sources.get(gr_text::FileId(0)).map_or(0, |f| f.text.lines().count());
    let planned = motion.program.steps().any(|s| Workingstep::begun_by(&s.op).is_some());
    let mut out = Vec::new();
    for c in clampings {
        match c.from_line {
            Some((_, span)) if planned => {
                out.push((span, format!("a STEP-NC program has no order of lines: name the `workingsteps` of setup `{}`", c.name)));
            }
            Some((line, span)) if line as usize > lines => out.push((span, format!("line {line} is beyond the end of the program, which has {lines} lines"))),
            _ => {}
        }
    }
    out
}

/// Workingsteps that the program doesn't have, or that two setups would make; and what helps.
fn misnamed(clampings: &[gr_machine::Clamping], motion: &Motion) -> (Vec<(gr_text::Span, String)>, Option<String>) {
    let mut steps: Vec<Workingstep> = Vec::new();
    for step in motion.program.steps().filter_map(|s| Workingstep::begun_by(&s.op)) {
        if !steps.contains(&step) {
            steps.push(step);
        }
    }
    // Instance names to whoever asked with one, and where names don't tell.
    let list = |instances: bool| {
        let mut all: Vec<&str> = Vec::new();
        for s in &steps {
            let shown = if instances || s.name.is_empty() { &s.instance } else { &s.name };
            if !all.contains(&shown.as_str()) {
                all.push(shown);
            }
        }
        all.iter().take(20).copied().collect::<Vec<_>>().join(", ") + if all.len() > 20 { " …" } else { "" }
    };
    let mut out = Vec::new();
    let mut before: Vec<(&str, &str)> = Vec::new();
    for c in clampings {
        for (called, span) in &c.workingsteps {
            let meant: Vec<&Workingstep> = steps.iter().filter(|s| s.is_called(called)).collect();
            if meant.is_empty() {
                let hint = if steps.is_empty() { "G-code has none: use `from_line`".to_string() } else { format!("it has {}", list(called.starts_with('#'))) };
                out.push((*span, format!("the program has no workingstep `{called}`; {hint}")));
            }
            // The same word twice is told by who reads the file.
            let again = before.iter().find(|(other, _)| meant.iter().any(|s| s.is_called(other)));
            if let Some((other, setup)) = again {
                let whose = if *setup == c.name { "here".to_string() } else { format!("in setup `{setup}`") };
                out.push((*span, format!("workingstep `{called}` stands {whose} too, as `{other}`")));
            }
            before.push((called, &c.name));
        }
    }
    let help = (!steps.is_empty()).then(|| gr_machine::WORKINGSTEP_NAMES.to_string());
    (out, help)
}

/// Makes a robot program.
pub fn build(motion: &Motion, goal: &Goal<'_>, texts: &dyn Sources, name: &str) -> Result<Result<Made, Vec<Diagnostic>>, String> {
    let Some(language) = gr_vendors::language(goal.target) else {
        return Err(format!("the target {} can't be made by this version", goal.target));
    };
    let machine = robot(goal)?;
    if let Some(n) = goal.options.decimals.filter(|n| !gr_vendors::DECIMALS.contains(n)) {
        return Err(format!("--decimals {n}: robot programs are written with {} to {}", gr_vendors::DECIMALS.start(), gr_vendors::DECIMALS.end()));
    }
    // The files take their name from where they go.
    let name = goal.file.filter(|f| f.extension().is_some()).map_or_else(|| name.to_string(), crate::emit::stem);
    let mut options = options(motion, goal, &name)?;
    // Cutting curves into lines, correcting these: together within the tolerance.
    options.tolerance *= if goal.options.robot.compensate { 0.5 } else { 1.0 };
    let planned = plan(&motion.program, &machine, texts, &options).and_then(|p| compensated(p, goal, texts, options.tolerance));
    let (planned, corrected) = match planned {
        Ok(planned) => planned,
        Err(found) => return Ok(Err(found)),
    };
    let choice = gr_vendors::Options { decimals: goal.options.decimals, allow_unverified: goal.options.robot.allow_unverified };
    let output = language.emit(&planned.program, texts, &choice);
    let mut summary = summary(&planned);
    let mut notes = planned.warnings.clone();
    notes.extend(output.findings);
    if notes.iter().any(|d| d.severity == gr_text::Severity::Error) {
        return Ok(Err(notes));
    }
    let several = output.files.len() > 1;
    let source = |n: &Option<u32>| planned.program.steps.get((*n)? as usize)?.source;
    let artifact = |f: gr_vendors::OutputFile| {
        let lines = crate::emit::main_lines(&motion.program, f.steps.iter().map(source));
        // A program alone has the name of its file, unless the language takes no such name.
        let own = Path::new(&f.name).file_stem().is_some_and(|s| !s.to_string_lossy().to_uppercase().starts_with(&name.to_uppercase()));
        Artifact { name: (several || own).then_some(f.name), lines, ..Artifact::new("", f.bytes) }
    };
    let mut artifacts: Vec<Artifact> = output.files.into_iter().map(artifact).collect();
    if let Some(c) = corrected {
        summary += &c.summary;
        artifacts.push(Artifact { name: several.then(|| format!("{name}-corrections.csv")), ..c.table });
    }
    Ok(Ok(Made { artifacts, notes, summary }))
}

/// What was corrected.
pub struct Corrected {
    /// Every correction, as a table.
    pub table: Artifact,
    /// The greatest ones, for people.
    pub summary: String,
}

impl Corrected {
    fn new(list: &[Correction], arcs: usize) -> Corrected {
        let mut table = String::from("line,x mm,y mm,z mm,dx um,dy um,dz um,turn deg,lean left deg\n");
        for c in list {
            let line = c.line.map_or(String::new(), |l| (l + 1).to_string());
            let ([x, y, z], [dx, dy, dz]) = (c.aim, c.by.map(|v| v * 1e3 + 0.0));
            let (turn, left) = (c.turn.to_degrees(), c.left.to_degrees());
            table += &format!("{line},{x:.4},{y:.4},{z:.4},{dx:.3},{dy:.3},{dz:.3},{turn:.6},{left:.6}\n");
        }
        let at = |c: &Correction| c.line.map_or(String::new(), |l| format!(" (line {})", l + 1));
        let most = |of: fn(&Correction) -> f64| list.iter().max_by(|a, b| of(a).total_cmp(&of(b))).map(|c| (of(c), at(c)));
        let mut summary = String::new();
        if let Some((mm, line)) = most(|c| norm(c.by)) {
            summary += &format!("  corrected as built: by up to {:.1} µm{line}\n", mm * 1e3);
        }
        match arcs {
            0 => {}
            1 => summary += "  1 arc became straight pieces\n",
            n => summary += &format!("  {n} arcs became straight pieces\n"),
        }
        // Less than a millionth of a degree is rounding.
        if let Some((lean, line)) = most(|c| c.left).filter(|(lean, _)| lean.to_degrees() > 1e-6) {
            summary += &format!("  not corrected: the direction of the tool, which leans by up to {:.4}°{line}\n", lean.to_degrees());
        }
        Corrected { table: Artifact::new("-corrections.csv", table.into_bytes()), summary }
    }
}

/// The deviations that a machine is corrected for.
fn deviations(machine: &Machine, texts: &dyn Sources) -> Result<Vec<f64>, Vec<Diagnostic>> {
    compensate::deviations(machine).ok_or_else(|| {
        let top = texts.place(gr_ir::Source::default());
        vec![Diagnostic::new(gr_text::code::ACCURACY_ONLY_TOLERANCES, top.0, top.1, &[machine.id.clone()])]
    })
}

fn not_corrected(source: gr_ir::Source, why: String, texts: &dyn Sources) -> Vec<Diagnostic> {
    let (file, span) = texts.place(source);
    vec![Diagnostic::new(gr_text::code::ACCURACY_BAD_OPTION, file, span, &["--compensate".to_string(), why])]
}

/// The program corrected for the machine's known geometry, where that is asked for, and what was corrected.
fn compensated(
    planned: Planned,
    goal: &Goal<'_>,
    texts: &dyn Sources,
    tolerance: f64,
) -> Result<(Planned, Option<Corrected>), Vec<Diagnostic>> {
    if !goal.options.robot.compensate {
        return Ok((planned, None));
    }
    let deviations = deviations(&planned.program.machine, texts)?;
    let made = compensate::program(&planned.program, &deviations, tolerance)
        .map_err(|(step, e)| not_corrected(step.source.unwrap_or_default(), format!("the corrected point can't be reached: {e}"), texts))?;
    let corrected = Corrected::new(&made.corrections, made.arcs);
    Ok((Planned { program: made.program, ..planned }, Some(corrected)))
}

/// Whether a target is made from a plan of the machine's joints, which is then what is corrected.
pub fn is_planned(goal: &Goal<'_>) -> bool {
    // A mill's motion is corrected before its joints are planned.
    let mill = goal.machine.is_some_and(|m| m.kind == Kind::Mill);
    is_language(goal.target) || !mill && is_for_machine(goal)
}

/// A program as motion, corrected for the machine's known geometry.
pub fn corrected(program: &gr_ir::Program, goal: &Goal<'_>, texts: &dyn Sources) -> Result<Result<(gr_ir::Program, Corrected), Vec<Diagnostic>>, String> {
    let machine = goal.machine.ok_or("--compensate needs --machine with `[as_built]`")?;
    let tolerance = goal.options.arc_tolerance.unwrap_or(Options::default().tolerance);
    if !(tolerance > 0.0) {
        return Err("--arc-tolerance must be above zero".into());
    }
    let made = deviations(machine, texts).and_then(|d| {
        compensate::motion(program, machine, &d, tolerance, texts).map_err(|(source, why)| not_corrected(source, why, texts))
    });
    Ok(made.map(|m| {
        let corrected = Corrected::new(&m.corrections, m.arcs);
        (m.program, corrected)
    }))
}

/// The machine of a goal, in a reference mode as its publication has it.
fn machine(goal: &Goal<'_>) -> Result<Machine, String> {
    let machine = goal.machine.ok_or_else(|| format!("the target {} needs --machine; `gcc-robot machine list` shows the ids", goal.target))?;
    let mut machine = if goal.options.reference.is_some() { gr_machine::as_published(machine) } else { machine.clone() };
    if let Some(most) = goal.options.joint_speed {
        if !(most > 0.0) {
            return Err("--joint-speed must be above zero".into());
        }
        for joint in &mut machine.joints {
            let most = if joint.kind == gr_machine::JointKind::Revolute { most.to_radians() } else { most };
            joint.rapid = Some(joint.top_rapid().min(most));
            joint.speed = Some(joint.speed.map_or(most, |own| own.min(most)));
        }
    }
    Ok(machine)
}

fn robot(goal: &Goal<'_>) -> Result<Machine, String> {
    let machine = machine(goal)?;
    if machine.kind == Kind::Robot {
        return Ok(machine);
    }
    Err(format!("the target {} is for robots; {} is none", goal.target, machine.id))
}

/// Figures of a planned program, for people.
pub fn summary(planned: &Planned) -> String {
    let s = &planned.summary;
    let line = |source: Option<gr_ir::Source>| source.map_or(String::new(), |s| format!(" (line {})", s.line + 1));
    let joint = |i: usize| planned.program.machine.joints.get(i).map_or(String::new(), |j| j.name.clone());
    let mut out = format!(
        "{}: {} cuts ({} arcs), {} rapids; {} at feed, {} rapid, {} waiting, with{}\n",
        planned.program.machine.id,
        s.cuts,
        s.arcs,
        s.rapids,
        duration(s.cut_seconds),
        duration(s.rapid_seconds),
        duration(s.wait_seconds),
        if s.accelerates { " the accelerations of the machine file" } else { "out acceleration" }
    );
    let mut more = Vec::new();
    if let Some((mm, at)) = s.reach_margin {
        more.push(format!("reach margin {} mm{}", short(mm), line(at)));
    }
    if let Some((share, i, at)) = s.limit_margin {
        more.push(format!("{} comes within {} % of its range to a limit{}", joint(i), short(share * 100.0), line(at)));
    }
    if let Some((angle, which, at)) = s.singularity {
        more.push(format!("closest singular position: {} but for {}°{}", which.words(), short(angle.to_degrees()), line(at)));
    }
    if let Some((share, i, at)) = s.joint_speed {
        more.push(format!("fastest joint at feed: {} at {} % of its speed{}", joint(i), short(share * 100.0), line(at)));
    }
    more.iter().for_each(|m| out += &format!("  {m}\n"));
    out
}

fn short(v: f64) -> String {
    number(v, 1)
}

/// What the machine has to say about a program.
pub fn opinion(motion: &Motion, machine: &Machine) -> Vec<Diagnostic> {
    let options = Options { setups: motion.setups.clone(), no_tool_table: motion.no_tool_table, ..Options::default() };
    gr_robot::opinion::opinion(&motion.program, machine, &crate::emit::texts(motion), &options)
}

/// Adds to the findings of a program, which is good, what the machine has to say, when the parts are clamped as a job file
/// has it.
pub fn ask(mut motion: Motion, machine: &Machine, job: Option<&Path>, checked: &mut Checked) {
    let taken = job.map_or(Ok(()), |path| take_job_of(&mut motion, path, machine));
    let found = taken.err().unwrap_or_else(|| opinion(&motion, machine));
    if checked.sources.get(gr_text::FileId(0)).is_none()
        && let Some(main) = motion.sources.get(gr_text::FileId(0))
    {
        checked.sources.add(main.name.clone(), main.text.clone());
    }
    let mut known = std::collections::BTreeMap::from([(gr_text::FileId(0), gr_text::FileId(0))]);
    for mut d in found {
        for label in &mut d.labels {
            label.file = *known.entry(label.file).or_insert_with(|| match motion.sources.get(label.file) {
                Some(f) => checked.sources.add(f.name.clone(), f.text.clone()),
                None => gr_text::FileId(0),
            });
        }
        checked.found.push(d);
    }
}

type Files = Result<Result<Made, Vec<Diagnostic>>, String>;

/// Plans for a controller that knows the words of the program itself. Curves that become lines may take this share of the
/// tolerance; what is left of it is for the joints between two positions.
fn own_plan(motion: &Motion, goal: &Goal<'_>, texts: &dyn Sources, name: &str, share: f64) -> Result<Result<(Planned, Option<Corrected>), Vec<Diagnostic>>, String> {
    let machine = machine(goal)?;
    let all = options(motion, goal, name)?;
    let tolerance = all.tolerance * share;
    let options = Options { own_words: true, probing: goal.target == "verify", tolerance, ..all };
    let corrected = |p| if machine.kind == Kind::Mill { Ok((p, None)) } else { compensated(p, goal, texts, tolerance) };
    Ok(plan(&motion.program, &machine, texts, &options).and_then(corrected))
}

fn too_many(found: &gr_robot::joints::TooMany, texts: &dyn Sources) -> Diagnostic {
    let (file, span) = texts.place(found.source.unwrap_or_default());
    Diagnostic::new(gr_text::code::ROBOT_TOO_MANY_POINTS, file, span, &[found.most.to_string()])
}

/// Whether the target has the motion of the machine file's machine.
pub fn is_for_machine(goal: &Goal<'_>) -> bool {
    is_language(goal.target) || goal.target == "setpoints" || goal.target == "joint-gcode" && plans_joints(goal)
}

/// Whether joint-gcode goes through the planner: every robot but the planar arm, which has its own way, and mills.
pub fn plans_joints(goal: &Goal<'_>) -> bool {
    planned(goal.options, goal.machine)
}

/// The same before there is a goal.
pub fn planned(options: &crate::emit::TargetOptions, machine: Option<&Machine>) -> bool {
    let planned = |m: &Machine| gr_robot::along::is_planned(m) || m.kind == Kind::Mill;
    matches!(options.reference, None | Some(crate::emit::Reference::Usp2009)) && machine.is_some_and(planned)
}

/// Joint positions as LinuxCNC words with inverse time, and both tables.
pub fn joint_gcode(motion: &Motion, goal: &Goal<'_>, texts: &dyn Sources, name: &str) -> Files {
    use gr_robot::joints::{JointOptions, TableOptions, cartesian_csv, gcode, joint_csv, joint_path};
    let o = goal.options;
    if o.interval.is_some_and(|t| !(t > 0.0)) {
        return Err("--interval must be above zero".into());
    }
    // Cutting curves into lines, correcting these, moving the joints: together within the tolerance.
    let (share, rest) = if o.robot.compensate { (1.0 / 3.0, 2.0 / 3.0) } else { (0.5, 1.0) };
    let (planned, corrected) = match own_plan(motion, goal, texts, name, share)? {
        Ok(planned) => planned,
        Err(found) => return Ok(Err(found)),
    };
    let default = JointOptions::default();
    let choice = JointOptions {
        tolerance: o.arc_tolerance.unwrap_or(default.tolerance) * rest,
        interval: o.interval,
        ..default
    };
    let path = match joint_path(&planned.program, &choice) {
        Ok(path) => path,
        Err(e) => return Ok(Err(vec![too_many(&e, texts)])),
    };
    let table = TableOptions { decimals: o.decimals.unwrap_or(6), comma: o.decimal_comma };
    let (text, sources, mut found) = gcode(&planned.program, &path, table.decimals, texts);
    found.extend(left_standing(&planned.program.machine, "joint-gcode", texts));
    let mut artifacts = vec![
        Artifact { lines: crate::emit::main_lines(&motion.program, sources), ..Artifact::new("", text.into_bytes()) },
        Artifact::new("-cartesian.csv", cartesian_csv(&path, table).into_bytes()),
        Artifact::new("-joint.csv", joint_csv(&planned.program, &path, table).into_bytes()),
    ];
    let mut summary = summary(&planned);
    if let Some(c) = corrected {
        summary += &c.summary;
        artifacts.push(c.table);
    }
    let notes = planned.warnings.into_iter().chain(found).collect();
    Ok(Ok(Made { artifacts, summary, notes }))
}

/// Set-points for a joint controller: a table, and the same as bytes beside it.
pub fn setpoints(motion: &Motion, goal: &Goal<'_>, texts: &dyn Sources, name: &str) -> Files {
    use gr_robot::setpoints::{SetpointOptions, setpoints};
    let default = SetpointOptions::default();
    let interval = goal.options.interval.unwrap_or(default.interval);
    let smoothing = goal.options.robot.smoothing.unwrap_or(default.smoothing);
    if !(interval > 0.0 && smoothing >= 0.0 && smoothing.is_finite()) {
        return Err("--interval must be above zero, --smoothing zero or more".into());
    }
    let (planned, corrected) = match own_plan(motion, goal, texts, name, 1.0)? {
        Ok(planned) => planned,
        Err(found) => return Ok(Err(found)),
    };
    let made = match setpoints(&planned.program, &SetpointOptions { interval, smoothing, ..default }) {
        Ok(made) => made,
        Err(e) => return Ok(Err(vec![e.finding(&planned.program.machine, texts)])),
    };
    let mut artifacts = vec![Artifact::new("", made.csv().into_bytes()), Artifact::new(".bin", made.bytes())];
    if !made.events.is_empty() || !planned.program.machine.cell.external.is_empty() {
        artifacts.push(Artifact::new("-events.csv", made.events_csv(&planned.program).into_bytes()));
    }
    let seconds = made.rows.len().saturating_sub(1) as f64 * interval;
    let mut summary = format!("{}  {} set-points, {} with acceleration\n", summary(&planned), made.rows.len(), duration(seconds));
    if let Some((least, source)) = made.unreached.least {
        let (cuts, of) = (made.unreached.cuts, made.unreached.of);
        summary += &format!("  {cuts} of {of} cuts don't get up to their feed; least: {} % of it (line {})\n", short(100.0 * least), source.line + 1);
    }
    if let Some(c) = corrected {
        summary += &c.summary;
        artifacts.push(c.table);
    }
    let mut notes = planned.warnings;
    notes.extend(left_standing(&planned.program.machine, "set-point", texts));
    notes.extend(corners_kept(&planned.program, texts));
    notes.extend(made.findings(&planned.program, texts));
    Ok(Ok(Made { artifacts, summary, notes }))
}

/// Where rails and positioners have to stand, which programs of the machine's own joints don't move.
fn left_standing(machine: &Machine, programs: &str, texts: &dyn Sources) -> Vec<Diagnostic> {
    let (file, span) = texts.place(gr_ir::Source::default());
    let one = |e: &gr_machine::External| Diagnostic::new(gr_text::code::VENDOR_EXTERNAL_STANDS, file, span, &[e.joint.name.clone(), e.joint.show(e.position), programs.into()]);
    machine.cell.external.iter().map(one).collect()
}

/// Says, where the program begins to allow rounded corners, that there are none.
fn corners_kept(program: &gr_robot::RobotProgram, texts: &dyn Sources) -> Option<Diagnostic> {
    use gr_robot::{Action, Zone};
    let rounded = program.steps.iter().find(|s| match s.action {
        Action::Joint { zone, .. } | Action::Linear { zone, .. } | Action::Arc { zone, .. } => matches!(zone, Zone::Blend(size) if size > 0.0),
        _ => false,
    })?;
    let (file, span) = texts.place(rounded.source?);
    Some(Diagnostic::new(gr_text::code::SETPOINTS_CORNERS_KEPT, file, span, &[]))
}

/// How exactly the joint values of a program put the tool where it should be.
pub fn verify(unit: &crate::pipeline::Unit, machine: &Machine, args: &crate::options::VerifyArgs) -> Result<Result<gr_robot::verify::Report, String>, Checked> {
    use crate::emit::Reference;
    let name = crate::emit::stem(&unit.path);
    let published_way = args.options.reference == Some(Reference::Ufsc2016);
    let mut motion = if published_way && unit.exchange { crate::exchange::ufsc2016(unit)?.0 } else { crate::pipeline::motion(unit, None)?.0 };
    let goal = Goal { target: "verify", options: &args.options, machine: Some(machine), from_line: None, file: None };
    if let Err(found) = take_job(&mut motion, &goal) {
        return Err(Checked { sources: motion.sources, found, ..Checked::nothing() });
    }
    if published_way {
        return match published(&motion, machine) {
            Ok(made) => Ok(made),
            Err(found) => Err(Checked { sources: motion.sources, found, ..Checked::nothing() }),
        };
    }
    let texts = crate::emit::texts(&motion);
    match own_plan(&motion, &goal, &texts, &name, 1.0) {
        Err(text) => Ok(Err(text)),
        Ok(Ok((planned, _))) => Ok(Ok(gr_robot::verify::Report::of(&planned))),
        Ok(Err(found)) => {
            drop(texts);
            Err(Checked { sources: motion.sources, found, ..Checked::nothing() })
        }
    }
}

/// The run of UFSC 2016: its solver, point after point; the part clamped as the job has it.
fn published(motion: &Motion, machine: &Machine) -> Result<Result<gr_robot::verify::Report, String>, Vec<Diagnostic>> {
    use gr_robot::reference::{Damped, Found, aims, follow};
    use gr_robot::verify::{Point, Report};
    let machine = gr_machine::as_published(machine);
    let aims = aims(&machine, &motion.program, &motion.setups);
    let idle = motion.setups.iter().enumerate().filter(|(i, _)| !aims.begun.contains(i)).map(|(_, s)| s);
    let texts = crate::emit::texts(motion);
    let never = |s: &gr_robot::Setup| {
        let (file, span) = texts.place(s.place);
        Diagnostic::new(gr_text::code::JOB_BAD_VALUE, file, span, &[s.never_begins()])
    };
    let found: Vec<Diagnostic> = idle.map(never).collect();
    if !found.is_empty() {
        return Err(found);
    }
    let start = (machine.joints.len() == 6).then(|| [0.0, 0.0, 0.0, 180.0, -45.0, 0.0].map(f64::to_radians).to_vec());
    let frames: Vec<gr_machine::math::Frame> = aims.points.iter().map(|(frame, _)| *frame).collect();
    let solved = match follow(&machine, &frames, &Damped { start, ..Damped::default() }) {
        Ok(solved) => solved,
        Err(lost) => return Ok(Err(format!("point {}: {}", lost.point + 1, lost.why))),
    };
    let point = |((aim, source), f): (&(gr_machine::math::Frame, gr_ir::Source), Found)| Point {
        target: aim.position,
        reached: [0, 1, 2].map(|i| aim.position[i] - f.error[i]),
        joints: f.joints,
        seconds: None,
        source: Some(*source),
    };
    Ok(Ok(Report::new(&machine, aims.points.iter().zip(solved).map(point).collect())))
}

/// The files of a report, in a folder.
pub fn report_files(report: &gr_robot::verify::Report, folder: &std::path::Path, name: &str) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let file = |end: &str, text: String| (folder.join(format!("{name}-{end}")), text.into_bytes());
    vec![
        file("errors.csv", report.csv()),
        file("errors.svg", report.error_svg()),
        file("joints.svg", report.joints_svg()),
        file("speeds.svg", report.speeds_svg()),
    ]
}
