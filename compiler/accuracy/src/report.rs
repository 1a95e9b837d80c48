//! Errors along a program, operation by operation.

mod mill;

pub use mill::report_of_words;
pub(crate) use mill::turns_apart;

use crate::error::{Budget, Errors, Sensitivity};
use crate::material::{Bore, Cut, Material};
use gr_ir::{Marker, Op, Program, Source, State, Turn, View};
use gr_machine::{Chain, Control, Kind, Kinematics, Machine};
use gr_machine::math::{Frame, V3, add, about, cross, dot, norm, rotate, scale, sub, turn_of};
use gr_robot::{Action, RobotProgram, Target};
use std::collections::{BTreeMap, HashMap};

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
    /// Lips of a drill; none = two.
    pub lips: Option<f64>,
    /// Half of a drill's point angle, rad.
    pub point: Option<f64>,
    /// Diameter of the hole that a drill makes wider, mm.
    pub before: Option<f64>,
}

impl CutData {
    /// These, and where they say nothing the other's.
    pub fn or(self, other: CutData) -> CutData {
        CutData {
            diameter: self.diameter.or(other.diameter),
            teeth: self.teeth.or(other.teeth),
            depth: self.depth.or(other.depth),
            width: self.width.or(other.width),
            lips: self.lips.or(other.lips),
            point: self.point.or(other.point),
            before: self.before.or(other.before),
        }
    }
    /// A tool does not cut wider than it is.
    pub fn too_wide(&self) -> bool {
        matches!((self.width, self.diameter), (Some(w), Some(d)) if w > d * (1.0 + 1e-9))
    }
    /// What is not known for this kind of work.
    pub fn missing(&self, work: Work) -> Vec<Lack> {
        let of_tool = |what| Lack { what, of_tool: true };
        let of_cut = |what| Lack { what, of_tool: false };
        let mill = [
            (self.diameter, of_tool("the diameter of the tool (`--diameter`)")),
            (self.teeth, of_tool("its number of teeth (`--teeth`)")),
            (self.depth, of_cut("the depth of cut (`--depth`)")),
            (self.width, of_cut("the width of cut (`--width`)")),
        ];
        let drill = [
            (self.diameter, of_tool("the diameter of the drill (`--diameter`)")),
            (self.point, of_tool("the point angle of the drill (`--point`)")),
        ];
        let all = match work {
            Work::Mill => &mill[..],
            Work::Drill => &drill[..],
            Work::Other | Work::Turn => &[],
        };
        all.iter().filter(|(v, _)| v.is_none()).map(|(_, n)| *n).collect()
    }
}

/// A number that a force law needs and nobody says.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Lack {
    /// Its name, and the option that says it.
    pub what: &'static str,
    /// It belongs to the tool, and else to the cut.
    pub of_tool: bool,
}

/// How a tool takes the material away, as far as a force law goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Work {
    /// Across its axis, with teeth at its side.
    #[default]
    Mill,
    /// Along its axis, with lips at its end: G73 G81 G82 G83, and the drilling of STEP-NC.
    Drill,
    /// Tapping, threading, boring, reaming, countersinking: no law here.
    Other,
    /// Turning: the part turns, and the force is along its cut. No law here.
    Turn,
}

impl Work {
    /// By a canned cycle's number times ten.
    fn of_cycle(code: i32) -> Work {
        if matches!(code, 730 | 810 | 820 | 830) { Work::Drill } else { Work::Other }
    }

    /// A move that is locked to the spindle's angle cuts a thread, whatever is around it.
    fn of_move(self, view: &View<'_, '_>) -> Work {
        let locked = matches!(view.op, Op::RigidTap { .. }) || view.state.sync.is_some_and(|s| !s.velocity);
        if locked { Work::Other } else { self }
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
    /// What it does all the time, where that is known; else each place says.
    pub work: Option<Work>,
    /// Its part turns, as on a lathe: what else would be milling is turning.
    pub turned: bool,
    /// Where its first cut is.
    pub first: Source,
}

impl Operation {
    /// The work at a place where the tool would do this, if it were the tool that turned.
    fn of_part(&self, work: Work) -> Work {
        if self.turned && work == Work::Mill { Work::Turn } else { work }
    }
}

/// The operations of a program, and which one each place of the source belongs to.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Operations {
    /// In order.
    pub list: Vec<Operation>,
    /// The kinds of work of each.
    works: Vec<Vec<Work>>,
    places: HashMap<Source, Place>,
}

/// What happens at a place of the source.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Place {
    operation: usize,
    /// Turns per minute, above zero clockwise as the spindle sees it (M3), below it the other way (M4).
    turns: f64,
    work: Work,
}

/// Turns per minute with the sense of the turn; 0 where it stands still or a surface speed decides.
fn turns(state: &State) -> f64 {
    let s = state.spindle(0);
    match s.turn {
        _ if s.surface.is_some() => 0.0,
        Turn::Stop => 0.0,
        Turn::Cw => s.speed.abs(),
        Turn::Ccw => -s.speed.abs(),
    }
}

impl Operations {
    /// By workingsteps and tools.
    pub fn new(program: &Program) -> Operations {
        let mut out = Operations::default();
        let mut step: Option<(i32, String)> = None;
        let mut tool = (0u32, String::new());
        let mut cursor = program.cursor();
        let mut open = None;
        let mut work = Work::Mill;
        while let Some(view) = cursor.next() {
            match view.op {
                Op::Begin { marker: Marker::Cycle, code, .. } => work = Work::of_cycle(code),
                Op::Close(Marker::Cycle) => work = Work::Mill,
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
            if view.op.cuts() {
                let work = work.of_move(&view);
                let at = *open.get_or_insert_with(|| {
                    let name = match &step {
                        Some((id, name)) if name.is_empty() => format!("#{id}"),
                        Some((id, name)) => format!("#{id} {name}"),
                        None if tool.1.is_empty() => format!("T{}", tool.0),
                        None => format!("T{} {}", tool.0, tool.1),
                    };
                    let workingstep = step.as_ref().map_or(0, |s| s.0);
                    out.list.push(Operation { name, tool: tool.0, workingstep, first: view.source, ..Operation::default() });
                    out.works.push(Vec::new());
                    out.list.len() - 1
                });
                if let Some(works) = out.works.get_mut(at).filter(|w| !w.contains(&work)) {
                    works.push(work);
                }
                out.places.insert(view.source, Place { operation: at, turns: turns(view.state), work });
            }
        }
        out
    }

    /// Kinds of work that an operation has.
    pub fn works(&self, operation: usize) -> Vec<Work> {
        let Some(o) = self.list.get(operation) else { return Vec::new() };
        match o.work {
            Some(work) => vec![o.of_part(work)],
            None => self.works.get(operation).map_or(Vec::new(), |all| all.iter().map(|w| o.of_part(*w)).collect()),
        }
    }
}

/// The largest error of an operation and where it is.
#[derive(Clone, PartialEq, Debug)]
pub struct Worst {
    /// Source line.
    pub source: Source,
    /// Tool point in the base, mm.
    pub point: V3,
    /// Joints there, mm or rad.
    pub joints: Vec<f64>,
    /// Tool point and turn of the tool on the flange.
    pub tool: Frame,
    /// What moves the tool point at the program's zero, where errors by the geometry count from there.
    pub zero: Option<std::rc::Rc<Sensitivity>>,
    /// Errors there.
    pub errors: Errors,
    /// Thickness of the chip there, mm, where the deflection is by one that the force law was not measured for.
    pub beyond_law: Option<f64>,
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

/// Why the force at a place is not known, besides data that the whole operation lacks.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Unforced {
    /// A mill is fed along its axis.
    Axial,
    /// A drill is fed another way than along its axis.
    Across,
    /// There is no law of such work here.
    NoLaw,
    /// There is no law of turning here.
    Turned,
    /// No turns per minute are known.
    NoSpeed,
    /// Only rotary axes move: the tool turns about its point, which stays where it is on the part.
    Turning,
    /// The width of cut is more than the tool.
    TooWide,
}

/// A line whose deflection is by a chip that the force law was not measured for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BeyondLaw {
    /// The line.
    pub source: Source,
    /// Thickness of the chip, mm.
    pub chip: f64,
    /// The largest deflection of the line by such a chip, mm.
    pub deflection: f64,
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
    /// Lines whose chip is thinner or thicker than the force law was measured for, by file and line.
    pub beyond_law: BTreeMap<(u32, u32), BeyondLaw>,
    /// Places whose force is not known: the first of each kind, and why.
    pub unforced: Vec<(Source, Unforced)>,
    /// How far at most the measured deviations of the machine put the tool point off, mm, and where: what compensation takes
    /// away, and no part of the errors.
    pub measured: Option<(f64, Source)>,
}

/// Errors along a program.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Report {
    /// Operations that cut, in order.
    pub rows: Vec<Row>,
    /// Joints that a program in words of the machine sends beyond their limits: each with the first place and its value.
    pub outside: Vec<(Source, usize, f64)>,
    /// The program's zero in the base, mm, the first where there are several: errors by the geometry count from there, where it was
    /// touched on the machine.
    pub touched: Option<V3>,
}

/// Never further apart than this are the places looked at, mm.
const APART: f64 = 10.0;
/// Places nearer than this to one that was looked at in the same operation are left out, mm.
const NEAR: f64 = 1.0;
/// Unless a rotary axis has turned by more than this, rad.
const LEAN: f64 = std::f64::consts::PI / 180.0;
/// Or the direction of the feed by more than this: cosine of 2°.
const SAME_WAY: f64 = 0.999_39;
/// Along an arc the feed turns by no more than this between places, rad.
const BEND: f64 = std::f64::consts::PI / 36.0;

/// Draws up a report; `progress` hears how many steps of how many are done.
pub fn report(
    program: &RobotProgram,
    operations: &Operations,
    budget: &Budget,
    material: Option<&Material>,
    progress: &dyn Fn(usize, usize),
) -> Report {
    let kinematics = program.machine.kinematics();
    let mut walk = Walk::new(&program.machine, &*kinematics, operations, budget, material);
    let mut from = program.home;
    for (n, step) in program.steps.iter().enumerate() {
        if n % 4096 == 0 {
            progress(n, program.steps.len());
        }
        let target = |i: u32| program.targets.get(i as usize).copied();
        match &step.action {
            Action::UseFrame(i) => {
                let old = std::mem::replace(&mut walk.frame, program.frames.get(usize::from(*i)).map_or(Frame::IDENTITY, |f| f.frame));
                from = from.reframed(&old, &walk.frame);
            }
            Action::UseTool(i) => {
                let old = std::mem::replace(&mut walk.tool, program.tools.get(usize::from(*i)).map_or(Frame::IDENTITY, |t| t.frame));
                from = from.retooled(&old, &walk.tool);
            }
            Action::Joint { to, .. } | Action::Probe { to, .. } => from = target(*to).unwrap_or(from),
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
    walk.finish()
}

fn row(operation: Operation) -> Row {
    Row { operation, places: 0, worst: None, over: Vec::new(), most: [None; 3], beyond_law: BTreeMap::new(), unforced: Vec::new(), measured: None }
}

/// A place that is looked at.
struct Spot {
    place: Place,
    source: Source,
    joints: Vec<f64>,
    /// Tool point in the base, mm.
    point: V3,
    /// The tool on the flange.
    tool: Frame,
    /// From the flange to its point, base directions, mm.
    lever: V3,
    /// Direction of the feed in the base; zero where it does not move.
    feed: V3,
    /// The geometry's part at the program's zero, where errors count from there.
    zero: Option<std::rc::Rc<Sensitivity>>,
    /// Direction from the tip to the spindle in the base.
    axis: V3,
    /// Speed of the tool point, mm/s.
    speed: f64,
    /// Only its turn changes here.
    turns: bool,
    /// Rotary words of a machine tool, rad.
    rotary: [f64; 3],
}

/// What was looked at last.
struct Last {
    place: Place,
    point: V3,
    rotary: [f64; 3],
    feed: V3,
    speed: f64,
}

/// What moves the tool point at the joints that were looked at last: the same place with another feed is no other.
struct Sensed {
    joints: Vec<f64>,
    lever: V3,
    zero: Option<std::rc::Rc<Sensitivity>>,
    at: Sensitivity,
    errors: Errors,
}

struct Walk<'a> {
    machine: &'a Machine,
    operations: &'a Operations,
    budget: &'a Budget,
    material: Option<&'a Material>,
    kinematics: &'a dyn Kinematics,
    /// Measured deviations of the geometry.
    measured: Option<Vec<f64>>,
    frame: Frame,
    tool: Frame,
    rows: Vec<Row>,
    last: Option<Last>,
    sensed: Option<Sensed>,
    /// The move that is looked at only turns the tool.
    turning: bool,
    /// The operation whose stretch over the tolerance is going on.
    over: Option<usize>,
    /// Joints beyond their limits.
    outside: Vec<(Source, usize, f64)>,
}

impl<'a> Walk<'a> {
    fn new(
        machine: &'a Machine,
        kinematics: &'a dyn Kinematics,
        operations: &'a Operations,
        budget: &'a Budget,
        material: Option<&'a Material>,
    ) -> Walk<'a> {
        let rows = operations.list.iter().map(|o| row(o.clone())).collect();
        let (frame, tool) = (Frame::IDENTITY, Frame::IDENTITY);
        let measured = crate::compensate::deviations(machine);
        Walk { machine, operations, budget, material, kinematics, measured, frame, tool, rows, last: None, sensed: None, turning: false, over: None, outside: Vec::new() }
    }

    fn finish(self) -> Report {
        let rows = self.rows.into_iter().filter(|r| r.places > 0).collect();
        Report { rows, outside: self.outside, touched: None }
    }

    /// What happens at a place of the source, where it is not too near to the one before and all that decides the force is as
    /// there; with the rotary words of machine tools.
    fn place(&self, source: Source, point: V3, (feed, speed): (V3, f64), rotary: [f64; 3]) -> Option<Place> {
        let mut place = *self.operations.places.get(&source)?;
        let operation = self.operations.list.get(place.operation)?;
        place.work = operation.of_part(operation.work.unwrap_or(place.work));
        let near = self.last.as_ref().is_some_and(|last| {
            let turned = last.rotary.iter().zip(rotary).any(|(a, b)| (a - b).abs() > LEAN);
            let as_fast = (last.speed - speed).abs() <= 1e-9 * speed.abs();
            let same_way = dot(last.feed, feed) > SAME_WAY;
            last.place == place && norm(sub(last.point, point)) < NEAR && !turned && as_fast && same_way
        });
        (!near || self.turning).then_some(place)
    }

    fn line(&mut self, from: &Target, end: &Target, speed: f64, source: Source) {
        let way = sub(end.position, from.position);
        let length = norm(way);
        self.turning = length < 1e-9 && from.quaternion != end.quaternion;
        let pieces = pieces(length);
        let feed = if length > 0.0 { scale(way, 1.0 / length) } else { [0.0; 3] };
        for i in 0..=pieces {
            let t = i as f64 / pieces as f64;
            let p = add(from.position, scale(way, t));
            self.look(p, from, end, t, feed, speed, source);
        }
    }

    fn arc(&mut self, from: &Target, end: &Target, (center, normal, angle): (V3, V3, f64), speed: f64, source: Source) {
        self.turning = false;
        let spoke = sub(from.position, center);
        let rise = dot(sub(end.position, from.position), normal);
        let pieces = pieces(norm(spoke) * angle).max(libm::ceil(angle / BEND).clamp(1.0, 1e4) as usize);
        for i in 0..=pieces {
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
        if t <= 0.0 {
            return Some(a.to_vec());
        }
        let guess: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + (b - a) * t).collect();
        let far = |q: &Vec<f64>| q.iter().zip(&guess).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let all = self.kinematics.inverse_frame(flange).ok()?.into_iter().map(|s| s.joints);
        all.min_by(|a, b| far(a).total_cmp(&far(b)))
    }

    #[allow(clippy::too_many_arguments)]
    fn look(&mut self, p: V3, from: &Target, end: &Target, t: f64, feed: V3, speed: f64, source: Source) {
        let here = self.frame.then(&Frame { position: p, turn: turn_of(end.quaternion) });
        let feed = rotate(&self.frame.turn, feed);
        let Some(place) = self.place(source, here.position, (feed, speed), [0.0; 3]) else { return };
        let flange = here.then(&self.tool.inverse());
        let Some(joints) = self.joints(&flange, from, end, t) else { return };
        // A machine that decides the turn of its tool itself stands otherwise than asked; the tool point is the same.
        let Ok(real) = self.kinematics.forward_frame(&joints) else { return };
        let lever = rotate(&real.turn, self.tool.position);
        let axis = self.towards_spindle(&here, &real);
        let (turns, rotary) = (self.turning, [0.0; 3]);
        self.record(&Spot { place, source, joints, point: here.position, tool: self.tool, lever, feed, zero: None, axis, speed, turns, rotary });
    }

    /// Puts what is predicted at a place into its row.
    fn record(&mut self, spot: &Spot) {
        let known = self.sensed.take().filter(|k| k.joints == spot.joints && k.lever == spot.lever && k.zero == spot.zero);
        let Some(sensed) = known.or_else(|| self.sense(spot)) else { return };
        self.put(spot, &sensed);
        self.sensed = Some(sensed);
    }

    fn sense(&self, spot: &Spot) -> Option<Sensed> {
        let at = Sensitivity::new(self.machine, &spot.joints, spot.lever).ok()?;
        let at = spot.zero.as_ref().map_or(at.clone(), |zero| at.since(zero));
        let errors = Errors::new(&at, self.budget, None);
        Some(Sensed { joints: spot.joints.clone(), lever: spot.lever, zero: spot.zero.clone(), at, errors })
    }

    fn put(&mut self, spot: &Spot, sensed: &Sensed) {
        let at = &sensed.at;
        let (source, operation) = (spot.source, spot.place.operation);
        self.last = Some(Last { place: spot.place, point: spot.point, rotary: spot.rotary, feed: spot.feed, speed: spot.speed });
        let force = match spot.place.work {
            Work::Drill => self.thrust(spot),
            Work::Mill => self.force(spot),
            Work::Other | Work::Turn => None,
        };
        let errors = Errors { elastic: force.and_then(|f| at.deflection(f.0)), ..sensed.errors };
        let unforced = if force.is_none() { self.unforced(spot) } else { None };
        let Some(row) = self.rows.get_mut(operation) else { return };
        if let Some(why) = unforced.filter(|why| row.unforced.iter().all(|(_, w)| w != why)) {
            row.unforced.push((source, why));
        }
        row.places += 1;
        if let Some(deviations) = &self.measured {
            let off = at.geometry.iter().zip(deviations).fold([0.0; 3], |sum, (c, d)| add(sum, scale(*c, *d)));
            let off = norm(off);
            if row.measured.is_none_or(|(most, _)| off > most) {
                row.measured = Some((off, source));
            }
        }
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
        let chip = force.and_then(|f| f.1).filter(|h| self.material.is_some_and(|m| *h < m.range.0 || *h > m.range.1));
        let beyond_law = chip.filter(|_| errors.elastic.is_some());
        if let (Some(chip), Some(deflection)) = (beyond_law, errors.elastic.map(norm)) {
            let line = row.beyond_law.entry((source.file.0, source.line)).or_insert(BeyondLaw { source, chip, deflection });
            if deflection > line.deflection {
                *line = BeyondLaw { source, chip, deflection };
            }
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
            let causes = causes(self.machine, at, self.budget);
            let (joints, zero) = (spot.joints.clone(), spot.zero.clone());
            row.worst = Some(Worst { source, point: spot.point, joints, tool: spot.tool, zero, errors, beyond_law, causes });
        }
    }

    /// Direction from the tip to the spindle: along Z of the frame on machine tools, against it on arms, whose frame points at
    /// the part; a machine that decides the turn of its tool itself stands as it stands.
    fn towards_spindle(&self, wanted: &Frame, real: &Frame) -> V3 {
        let machine = self.machine;
        if self.kinematics.control() == Control::Position {
            return real.turn.map(|r| r[2]);
        }
        let away = machine.kind == Kind::Robot && !matches!(machine.chain, Chain::Planar3r(_));
        wanted.turn.map(|r| if away { -r[2] } else { r[2] })
    }

    /// Why there is no force at a place, where that is not that a number of the whole operation is not known.
    fn unforced(&self, spot: &Spot) -> Option<Unforced> {
        // Without a law it is of no use to ask for a material.
        if spot.place.work == Work::Turn {
            return Some(Unforced::Turned);
        }
        self.material?;
        let cut = self.operations.list.get(spot.place.operation)?.cut;
        if !cut.missing(spot.place.work).is_empty() {
            return None;
        }
        Some(match spot.place {
            Place { work: Work::Other, .. } => Unforced::NoLaw,
            Place { turns, .. } if !(turns.abs() > 0.0) => Unforced::NoSpeed,
            Place { work: Work::Mill, .. } if cut.too_wide() => Unforced::TooWide,
            // A move of no length at all cuts nothing.
            _ if norm(spot.feed) < 0.5 => return spot.turns.then_some(Unforced::Turning),
            Place { work: Work::Drill, .. } => Unforced::Across,
            _ => Unforced::Axial,
        })
    }

    /// Thrust of a drill, and the thickness of its chip; on the way out there is none.
    fn thrust(&self, spot: &Spot) -> Option<(V3, Option<f64>)> {
        let cut = self.operations.list.get(spot.place.operation)?.cut;
        let out = dot(spot.feed, spot.axis);
        // Aslant or across its axis a drill is no drill.
        if out.abs() < SAME_WAY {
            return None;
        }
        if out > 0.0 {
            return Some(([0.0; 3], None));
        }
        let bore = Bore {
            diameter: cut.diameter?,
            before: cut.before.unwrap_or(0.0),
            lips: cut.lips.unwrap_or(LIPS),
            edge: cut.point?,
            feed: spot.speed * 60.0,
            speed: spot.place.turns.abs(),
        };
        let (thrust, chip) = bore.thrust(self.material?)?;
        Some((scale(spot.feed, -thrust), Some(chip)))
    }

    /// Force on a mill and the thickness of the chip; straight out of the material there is none.
    fn force(&self, spot: &Spot) -> Option<(V3, Option<f64>)> {
        let cut = self.operations.list.get(spot.place.operation)?.cut;
        if cut.too_wide() {
            return None;
        }
        let cut = Cut {
            diameter: cut.diameter?,
            teeth: cut.teeth?,
            feed: spot.speed * 60.0,
            speed: spot.place.turns.abs(),
            depth: cut.depth?,
            width: cut.width?,
            edge: std::f64::consts::FRAC_PI_2,
        };
        let force = cut.force(self.material?)?;
        // Seen from the other side a tool turns the other way.
        let sense = if spot.place.turns < 0.0 { -1.0 } else { 1.0 };
        match force.vector(spot.feed, scale(spot.axis, sense)) {
            Some(v) => Some((v, Some(force.chip))),
            None => (dot(spot.feed, spot.axis) > 0.0).then_some(([0.0; 3], None)),
        }
    }
}

/// Lips of a drill that nobody gives another number of: twist drills have two (ISO 5419).
const LIPS: f64 = 2.0;

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
    let sizes = budget.known.iter().chain(&budget.geometry).flatten();
    for (name, (column, size)) in parameters.zip(at.geometry.iter().zip(sizes)) {
        all.push((name, norm(*column) * size.abs()));
    }
    all.retain(|(_, v)| *v > 0.0);
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(NAMED);
    all
}

fn pieces(length: f64) -> usize {
    (libm::ceil(length / APART).max(1.0) as usize).min(10_000)
}
