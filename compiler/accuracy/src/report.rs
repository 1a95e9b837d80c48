//! Errors along a program, operation by operation.

use crate::error::{Budget, Errors, Sensitivity};
use crate::material::{Cut, Material};
use gr_ir::{Marker, Op, Program, Source};
use gr_machine::{Kinematics, Machine};
use gr_machine::math::{Frame, V3, add, about, cross, dot, norm, rotate, scale, sub, turn_of};
use gr_robot::{Action, RobotProgram, Target};
use std::collections::HashMap;

/// What a tool does to the material in an operation; what is not known is none.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct CutData {
    /// Diameter of the tool, mm.
    pub diameter: Option<f64>,
    /// Teeth.
    pub teeth: Option<f64>,
    /// Depth along the tool axis, mm.
    pub depth: Option<f64>,
    /// Width across it, mm.
    pub width: Option<f64>,
}

impl CutData {
    /// These, and where they say nothing the other's.
    pub fn or(self, other: CutData) -> CutData {
        CutData {
            diameter: self.diameter.or(other.diameter),
            teeth: self.teeth.or(other.teeth),
            depth: self.depth.or(other.depth),
            width: self.width.or(other.width),
        }
    }
    /// Names of what is not known.
    pub fn missing(&self) -> Vec<&'static str> {
        let all = [
            (self.diameter, "the diameter of the tool"),
            (self.teeth, "its number of teeth"),
            (self.depth, "the depth of cut"),
            (self.width, "the width of cut"),
        ];
        all.into_iter().filter(|(v, _)| v.is_none()).map(|(_, n)| n).collect()
    }
}

/// A stretch of the program that people call one operation: a workingstep, or what one tool does.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Operation {
    /// Name.
    pub name: String,
    /// Number of its tool; 0 = none.
    pub tool: u32,
    /// Id of the workingstep it is, or 0.
    pub workingstep: i32,
    /// What it may be off, mm.
    pub tolerance: Option<f64>,
    /// How it cuts.
    pub cut: CutData,
}

/// The operations of a program, and which one each place of the source belongs to.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Operations {
    /// In order.
    pub list: Vec<Operation>,
    places: HashMap<Source, (usize, f64)>,
}

impl Operations {
    /// By workingsteps and tools.
    pub fn new(program: &Program) -> Operations {
        let mut out = Operations::default();
        let mut step: Option<(i32, String)> = None;
        let mut tool = (0u32, String::new());
        let mut cursor = program.cursor();
        let mut open = None;
        while let Some(view) = cursor.next() {
            match view.op {
                Op::Begin { marker: Marker::Workingstep, code, text } => {
                    step = Some((code, text.to_string()));
                    open = None;
                }
                Op::Close(Marker::Workingstep) => {
                    step = None;
                    open = None;
                }
                Op::Begin { marker: Marker::Tool, code, text } => {
                    tool = (u32::try_from(code).unwrap_or(0), text.to_string());
                    open = None;
                }
                _ => {}
            }
            let loaded = u32::try_from(view.state.tool).unwrap_or(0);
            if loaded != tool.0 {
                tool = (loaded, String::new());
                open = None;
            }
            if view.op.feeds() {
                let at = *open.get_or_insert_with(|| {
                    let name = match &step {
                        Some((id, name)) if name.is_empty() => format!("#{id}"),
                        Some((id, name)) => format!("#{id} {name}"),
                        None if tool.1.is_empty() => format!("T{}", tool.0),
                        None => format!("T{} {}", tool.0, tool.1),
                    };
                    let workingstep = step.as_ref().map_or(0, |s| s.0);
                    out.list.push(Operation { name, tool: tool.0, workingstep, ..Operation::default() });
                    out.list.len() - 1
                });
                out.places.insert(view.source, (at, view.state.spindle(0).speed.abs()));
            }
        }
        out
    }
}

/// The largest error of an operation and where it is.
#[derive(Clone, PartialEq, Debug)]
pub struct Worst {
    /// Source line.
    pub source: Source,
    /// Tool point in the base, mm.
    pub point: V3,
    /// Errors there.
    pub errors: Errors,
    /// What makes most of it: names of joints and numbers of the geometry, and how far each alone moves the tool point,
    /// mm, the greatest first.
    pub causes: Vec<(String, f64)>,
}

/// A stretch of the program whose every place that was looked at is over the tolerance.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Stretch {
    /// Its first place.
    pub first: Source,
    /// Its last place.
    pub last: Source,
    /// Where the sum is largest.
    pub worst: Source,
    /// The sum there, mm.
    pub sum: f64,
    /// Root of squares there, mm.
    pub rss: f64,
}

/// One row of the report.
#[derive(Clone, PartialEq, Debug)]
pub struct Row {
    /// Operation.
    pub operation: Operation,
    /// Places looked at.
    pub places: usize,
    /// Where the sum is largest.
    pub worst: Option<Worst>,
    /// Where it is over the operation's tolerance, in order.
    pub over: Vec<Stretch>,
    /// Largest kinematic, geometric and elastic error anywhere in it, mm.
    pub most: [Option<f64>; 3],
    /// Least and greatest thickness of the chip, mm.
    pub chip: Option<(f64, f64)>,
}

/// Errors along a program.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Report {
    /// Operations that cut, in order.
    pub rows: Vec<Row>,
}

/// Never further apart than this are the places looked at, mm.
const APART: f64 = 10.0;
/// Places nearer than this to one that was looked at in the same operation are left out, mm.
const NEAR: f64 = 1.0;

/// Draws up a report; `progress` hears how many steps of how many are done.
pub fn report(
    program: &RobotProgram,
    operations: &Operations,
    budget: &Budget,
    material: Option<&Material>,
    progress: &dyn Fn(usize, usize),
) -> Report {
    let kinematics = program.machine.kinematics();
    let mut walk = Walk {
        program,
        operations,
        budget,
        material,
        kinematics: &*kinematics,
        frame: Frame::IDENTITY,
        tool: Frame::IDENTITY,
        rows: operations.list.iter().map(|o| row(o.clone())).collect(),
        last: None,
        over: None,
    };
    let mut from = program.home;
    for (n, step) in program.steps.iter().enumerate() {
        if n % 4096 == 0 {
            progress(n, program.steps.len());
        }
        let target = |i: u32| program.targets.get(i as usize).copied();
        match &step.action {
            Action::UseFrame(i) => walk.frame = program.frames.get(usize::from(*i)).map_or(Frame::IDENTITY, |f| f.frame),
            Action::UseTool(i) => walk.tool = program.tools.get(usize::from(*i)).map_or(Frame::IDENTITY, |t| t.frame),
            Action::Joint { to, .. } => from = target(*to).unwrap_or(from),
            Action::Linear { to, rapid, speed, .. } => {
                let Some(end) = target(*to) else { continue };
                if let (false, Some(source)) = (*rapid, step.source) {
                    walk.line(&from, &end, *speed, source);
                }
                from = end;
            }
            Action::Arc { to, center, normal, angle, speed, .. } => {
                let Some(end) = target(*to) else { continue };
                if let Some(source) = step.source {
                    walk.arc(&from, &end, (*center, *normal, *angle), *speed, source);
                }
                from = end;
            }
            _ => {}
        }
    }
    Report { rows: walk.rows.into_iter().filter(|r| r.places > 0).collect() }
}

fn row(operation: Operation) -> Row {
    Row { operation, places: 0, worst: None, over: Vec::new(), most: [None; 3], chip: None }
}

struct Walk<'a> {
    program: &'a RobotProgram,
    operations: &'a Operations,
    budget: &'a Budget,
    material: Option<&'a Material>,
    kinematics: &'a dyn Kinematics,
    frame: Frame,
    tool: Frame,
    rows: Vec<Row>,
    last: Option<(usize, V3)>,
    /// The operation whose stretch over the tolerance is going on.
    over: Option<usize>,
}

impl Walk<'_> {
    fn line(&mut self, from: &Target, end: &Target, speed: f64, source: Source) {
        let way = sub(end.position, from.position);
        let length = norm(way);
        let pieces = pieces(length);
        let feed = if length > 0.0 { scale(way, 1.0 / length) } else { [0.0; 3] };
        for i in 1..=pieces {
            let t = i as f64 / pieces as f64;
            let p = add(from.position, scale(way, t));
            self.look(p, from, end, t, feed, speed, source);
        }
    }

    fn arc(&mut self, from: &Target, end: &Target, (center, normal, angle): (V3, V3, f64), speed: f64, source: Source) {
        let spoke = sub(from.position, center);
        let rise = dot(sub(end.position, from.position), normal);
        let pieces = pieces(norm(spoke) * angle);
        for i in 1..=pieces {
            let t = i as f64 / pieces as f64;
            let out = rotate(&about(normal, angle * t), spoke);
            let p = add(add(center, out), scale(normal, rise * t));
            let ahead = cross(normal, out);
            let feed = if norm(ahead) > 0.0 { scale(ahead, 1.0 / norm(ahead)) } else { [0.0; 3] };
            self.look(p, from, end, t, feed, speed, source);
        }
    }

    /// Joint values between two targets: those of the end itself at the end, elsewhere the nearest solution.
    fn joints(&self, flange: &Frame, from: &Target, end: &Target, t: f64) -> Option<Vec<f64>> {
        let count = self.kinematics.joint_count();
        let (a, b) = (from.joints.get(..count)?, end.joints.get(..count)?);
        if t >= 1.0 {
            return Some(b.to_vec());
        }
        let guess: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + (b - a) * t).collect();
        let far = |q: &Vec<f64>| q.iter().zip(&guess).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let all = self.kinematics.inverse_frame(flange).ok()?.into_iter().map(|s| s.joints);
        all.min_by(|a, b| far(a).total_cmp(&far(b)))
    }

    #[allow(clippy::too_many_arguments)]
    fn look(&mut self, p: V3, from: &Target, end: &Target, t: f64, feed: V3, speed: f64, source: Source) {
        let Some(&(operation, turns)) = self.operations.places.get(&source) else { return };
        let here = self.frame.then(&Frame { position: p, turn: turn_of(end.quaternion) });
        if self.last.is_some_and(|(o, q)| o == operation && norm(sub(q, here.position)) < NEAR) {
            return;
        }
        let flange = here.then(&self.tool.inverse());
        let Some(joints) = self.joints(&flange, from, end, t) else { return };
        // A machine that decides the turn of its tool itself stands otherwise than asked; the tool point is the same.
        let Ok(real) = self.kinematics.forward_frame(&joints) else { return };
        let lever = rotate(&real.turn, self.tool.position);
        let Ok(at) = Sensitivity::new(&self.program.machine, &joints, lever) else { return };
        self.last = Some((operation, here.position));
        let axis = here.turn.map(|r| -r[2]);
        let force = self.force(operation, turns, speed, rotate(&self.frame.turn, feed), axis);
        let errors = Errors::new(&at, self.budget, force.map(|f| f.0));
        let Some(row) = self.rows.get_mut(operation) else { return };
        row.places += 1;
        let parts = [
            errors.kinematic.map(|s| s.longest),
            errors.geometric.map(|s| s.longest),
            errors.elastic.map(norm),
        ];
        for (most, part) in row.most.iter_mut().zip(parts) {
            *most = match (*most, part) {
                (Some(a), Some(b)) => Some(a.max(b)),
                (a, b) => a.or(b),
            };
        }
        if let Some((_, chip)) = force {
            row.chip = Some(row.chip.map_or((chip, chip), |(a, b)| (a.min(chip), b.max(chip))));
        }
        let sum = errors.sum();
        if row.operation.tolerance.is_some_and(|t| sum > t) {
            let rss = errors.root_of_squares();
            match row.over.last_mut().filter(|_| self.over == Some(operation)) {
                Some(open) => {
                    open.last = source;
                    if sum > open.sum {
                        (open.worst, open.sum, open.rss) = (source, sum, rss);
                    }
                }
                None => row.over.push(Stretch { first: source, last: source, worst: source, sum, rss }),
            }
            self.over = Some(operation);
        } else {
            self.over = None;
        }
        if row.worst.as_ref().is_none_or(|w| sum > w.errors.sum()) {
            let causes = causes(&self.program.machine, &at, self.budget);
            row.worst = Some(Worst { source, point: here.position, errors, causes });
        }
    }

    /// Force on the tool and the thickness of the chip.
    fn force(&self, operation: usize, turns: f64, speed: f64, feed: V3, axis: V3) -> Option<(V3, f64)> {
        let cut = self.operations.list.get(operation)?.cut;
        let cut = Cut {
            diameter: cut.diameter?,
            teeth: cut.teeth?,
            feed: speed * 60.0,
            speed: turns,
            depth: cut.depth?,
            width: cut.width?,
            edge: std::f64::consts::FRAC_PI_2,
        };
        let force = cut.force(self.material?)?;
        Some((force.vector(feed, axis)?, force.chip))
    }
}

/// So many causes are named.
const NAMED: usize = 4;

/// What moves the tool point most.
fn causes(machine: &Machine, at: &Sensitivity, budget: &Budget) -> Vec<(String, f64)> {
    let mut all: Vec<(String, f64)> = Vec::new();
    let joints = machine.joints.iter().map(|j| format!("joint {}", j.name));
    for (name, (column, size)) in joints.zip(at.joints.iter().zip(budget.joints.iter().flatten())) {
        all.push((name, norm(*column) * size));
    }
    let parameters = machine.parameters().into_iter().map(|p| p.name);
    for (name, (column, size)) in parameters.zip(at.geometry.iter().zip(budget.geometry.iter().flatten())) {
        all.push((name, norm(*column) * size));
    }
    all.retain(|(_, v)| *v > 0.0);
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(NAMED);
    all
}

fn pieces(length: f64) -> usize {
    (libm::ceil(length / APART).max(1.0) as usize).min(10_000)
}
