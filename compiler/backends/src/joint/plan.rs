use crate::sweep::{Sweep, between};
use gr_ir::{FeedMode, Op, Pose, Program, Source, State};
use gr_machine::{JointKind, Kinematics, KinematicsError, Machine, Orientation, Solution};
use gr_text::{Diagnostic, FileId, Span, code};

/// How numbers are brought to the chosen decimals.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Rounding {
    /// To the nearest.
    Nearest,
    /// Toward zero, as the UFMG 2008 program did.
    Truncate,
}

/// What can be chosen.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Options {
    /// Greatest time between two points, s.
    pub interval: f64,
    /// Decimals written.
    pub decimals: usize,
    /// Decimal comma instead of point.
    pub comma: bool,
    /// How numbers are cut to them.
    pub rounding: Rounding,
    /// Greatest speed of every joint, rad/s or mm/s, besides the machine's own limits.
    pub joint_speed: Option<f64>,
    /// Reproduce the UFMG 2008 program: its number of points and its Δt in every F, the first configuration of
    /// the arm always, no check of limits and speeds.
    pub reference: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            interval: 0.025,
            decimals: 3,
            comma: false,
            rounding: Rounding::Nearest,
            joint_speed: None,
            reference: false,
        }
    }
}

impl Options {
    /// `--reference ufmg2008`: the settings under which the thesis's figures were made.
    pub fn ufmg2008() -> Options {
        Options { decimals: 2, comma: true, rounding: Rounding::Truncate, reference: true, ..Options::default() }
    }
}

/// A point of the path, in space and in joints.
#[derive(Clone, PartialEq, Debug)]
pub struct JointPoint {
    /// When the machine is there, s from the start.
    pub time: f64,
    /// X Y Z (mm) A B C (rad), machine frame.
    pub pose: [f64; 6],
    /// Joint values, mm or rad.
    pub joints: Vec<f64>,
    /// √(Σ Δθ²)/Δt of the way here, in degrees (and mm) per second; 0 for the start.
    pub speed: f64,
    /// Where it comes from; none for the start.
    pub source: Option<Source>,
}

/// A program in joint space.
#[derive(Clone, PartialEq, Debug)]
pub struct JointProgram {
    /// Points, the start first.
    pub points: Vec<JointPoint>,
    /// Word of each joint.
    pub words: Vec<char>,
    /// Kind of each joint.
    pub kinds: Vec<JointKind>,
    pub(super) options: Options,
}

/// Speed of a joint move when no limit is known, rad/s or mm/s.
const CALM: f64 = std::f64::consts::FRAC_PI_2;
/// Most points of one program.
const MOST_POINTS: usize = 10_000_000;
/// Findings reported at most.
const MOST_FAULTS: usize = 100;

/// Plans the joint positions of a program. `place` gives the file and bytes of a source line, for messages.
pub fn compile(
    program: &Program,
    machine: &Machine,
    options: &Options,
    place: &dyn Fn(Source) -> (FileId, Span),
) -> Result<JointProgram, Vec<Diagnostic>> {
    let kinematics = machine.kinematics();
    let kinds: Vec<JointKind> = machine.joints.iter().map(|j| j.kind).collect();
    let letters = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];
    let words = machine.joints.iter().zip(letters).map(|(j, l)| j.word.unwrap_or(l)).collect();
    let out = JointProgram { points: Vec::new(), words, kinds, options: *options };
    let mut plan = Plan {
        machine,
        kinematics: &*kinematics,
        options,
        place,
        out,
        faults: Vec::new(),
        faulty_line: None,
        branch: 0,
    };
    plan.start(program);
    plan.run(program);
    if plan.faults.is_empty() { Ok(plan.out) } else { Err(plan.faults) }
}

struct Plan<'a> {
    machine: &'a Machine,
    kinematics: &'a dyn Kinematics,
    options: &'a Options,
    place: &'a dyn Fn(Source) -> (FileId, Span),
    out: JointProgram,
    faults: Vec<Diagnostic>,
    faulty_line: Option<(FileId, u32)>,
    branch: u8,
}

/// The next point of a path and the time it takes to get there.
struct Aim {
    pose: [f64; 6],
    time: f64,
    /// A joint move: any configuration will do.
    free: bool,
    feed: f64,
}

fn six(pose: &Pose) -> [f64; 6] {
    let a = &pose.axes;
    [a[0], a[1], a[2], a[3], a[4], a[5]]
}

impl Plan<'_> {
    fn fault(&mut self, code: gr_text::Code, source: Source, args: &[String]) {
        // One finding per line: the first point that fails explains those after it.
        let line = Some((source.file, source.line));
        if self.faulty_line == line || self.faults.len() >= MOST_FAULTS {
            return;
        }
        self.faulty_line = line;
        let (file, span) = (self.place)(source);
        self.faults.push(Diagnostic::new(code, file, span, args));
    }

    fn start(&mut self, program: &Program) {
        let pose = six(&Pose::at(program.start_state().machine(&program.start().axes)));
        let at_start = pose == self.machine.start.coordinates();
        let joints = self.machine.start_joints.clone().filter(|_| at_start || self.options.reference);
        let found = match joints {
            Some(joints) => {
                let branches = self.kinematics.inverse(&gr_machine::Pose::from_coordinates(pose)).unwrap_or_default();
                let branch = nearest(&branches, &joints, &self.out.kinds).map_or(0, |s| s.branch);
                Ok((joints, branch))
            }
            None => self.kinematics.inverse(&self.machine.start).map(|all| (all[0].joints.clone(), all[0].branch)),
        };
        match found {
            Ok((joints, branch)) => {
                self.branch = branch;
                let pose = self.machine.start.coordinates();
                self.out.points.push(JointPoint { time: 0.0, pose, joints, speed: 0.0, source: None });
            }
            Err(e) => self.unreachable(&e, self.machine.start.coordinates(), Source::default()),
        }
    }

    fn run(&mut self, program: &Program) {
        let mut cursor = program.cursor();
        while let Some(view) = cursor.next() {
            if self.out.points.is_empty() {
                return;
            }
            let (start, end) = (six(view.start), six(view.end));
            let source = view.source;
            match view.op {
                Op::Rapid | Op::Linear | Op::Arc(_) if self.foreign_axes(view.start, view.end, source) => {}
                Op::Rapid => self.joint_move(view.state, view.end, source),
                Op::Linear | Op::Arc(_) if !self.comes_to(view.state, view.start, source) => {}
                Op::Linear => {
                    let way = distance(&start, &end);
                    let turn = turned(&start, &end);
                    let (a, b) = (*view.start, *view.end);
                    self.path(view.state, way, turn, source, &|share| between(&a, &b, share));
                }
                Op::Arc(arc) => {
                    let sweep = Sweep::new(view.start, view.end, &arc);
                    // Eq. 4.2 counts the circle; its length is that of a helix where there is one.
                    self.path(view.state, sweep.shape.length(), turned(&start, &end), source, &|share| sweep.at(share));
                }
                ref op => {
                    if let Some(what) = no_joint_form(op) {
                        self.fault(code::EMIT_NOT_EXPRESSIBLE, source, &[what.into(), "joint-space G-code".into()]);
                    }
                }
            }
        }
    }

    /// U V W have no meaning on a robot, and A B C need one.
    fn foreign_axes(&mut self, start: &Pose, end: &Pose, source: Source) -> bool {
        if (6..9).any(|i| start.axes[i] != end.axes[i]) {
            self.fault(
                code::EMIT_NOT_EXPRESSIBLE,
                source,
                &["a move of U, V or W".into(), "joint-space G-code".into()],
            );
            return true;
        }
        let turns = (3..6).find(|i| start.axes[*i] != end.axes[*i]);
        match (turns, &self.machine.orientation) {
            (Some(i), None | Some(Orientation::Fixed)) if self.machine.kind == gr_machine::Kind::Robot => {
                self.fault(code::ROBOT_ROTARY_WORDS, source, &[["A", "B", "C"][i - 3].into(), self.machine.no_rotary_words().into()]);
                true
            }
            _ => false,
        }
    }

    /// A cut that begins elsewhere than the arm stands at its start is led up to by a joint move. False when it can't be.
    fn comes_to(&mut self, state: &State, start: &Pose, source: Source) -> bool {
        let pose = six(&Pose::at(state.machine(&start.axes)));
        let stands = self.out.points.last().is_some_and(|p| p.pose.iter().zip(&pose).all(|(a, b)| (a - b).abs() < 1e-9));
        // The thesis's program has no such move: its own starts where the arm does.
        stands || self.options.reference || self.go(Aim { pose, time: self.options.interval, free: true, feed: 0.0 }, source)
    }

    /// G00: straight in joint space, so only the end counts.
    fn joint_move(&mut self, state: &State, end: &Pose, source: Source) {
        let pose = six(&Pose::at(state.machine(&end.axes)));
        self.go(Aim { pose, time: self.options.interval, free: true, feed: 0.0 }, source);
    }

    /// A path in space at the programmed feed, cut into equal steps.
    fn path(&mut self, state: &State, way: f64, turn: f64, source: Source, at: &dyn Fn(f64) -> Pose) {
        if state.feed_mode != FeedMode::PerTime || state.sync.is_some() {
            let what = "a feed per revolution or in inverse time".to_string();
            return self.fault(code::EMIT_NOT_EXPRESSIBLE, source, &[what, "joint-space G-code".into()]);
        }
        let interval = self.options.interval;
        let (time, feed) = match (way > 0.0, self.options.reference) {
            (true, _) => (way / state.feed, state.feed),
            (false, true) => (0.0, state.feed),
            (false, false) => (turn / state.feed_angular, state.feed),
        };
        if time == 0.0 && turn == 0.0 {
            return;
        }
        let steps = if self.options.reference {
            libm::trunc(time / interval) + 1.0
        } else {
            libm::ceil(time / interval * (1.0 - 1e-12)).max(1.0)
        };
        let steps = if steps.is_finite() { steps as usize } else { usize::MAX };
        if steps.saturating_add(self.out.points.len()) > MOST_POINTS {
            let what = format!("a move of {steps} points");
            return self.fault(code::EMIT_NOT_EXPRESSIBLE, source, &[what, "joint-space G-code".into()]);
        }
        let step = if self.options.reference { interval } else { time / steps as f64 };
        for k in 1..=steps {
            let pose = six(&Pose::at(state.machine(&at(k as f64 / steps as f64).axes)));
            if !self.go(Aim { pose, time: step, free: false, feed }, source) {
                return;
            }
        }
    }

    /// Adds a point; false when it can't be had.
    fn go(&mut self, aim: Aim, source: Source) -> bool {
        let all = match self.kinematics.inverse(&gr_machine::Pose::from_coordinates(aim.pose)) {
            Ok(all) => all,
            Err(e) => {
                self.unreachable(&e, aim.pose, source);
                return false;
            }
        };
        let Some((joints, branch)) = self.choose(&all, &aim, source) else {
            return false;
        };
        let Some(last) = self.out.points.last() else {
            return false;
        };
        let change: Vec<f64> = joints.iter().zip(&last.joints).map(|(new, old)| new - old).collect();
        let time = if aim.free && !self.options.reference { self.calm_time(&change) } else { aim.time };
        if !self.options.reference && !self.slow_enough(&change, time, &aim, source) {
            return false;
        }
        let squares: f64 = change.iter().zip(&self.out.kinds).map(|(d, k)| shown(*d, *k) * shown(*d, *k)).sum();
        let speed = if time > 0.0 { libm::sqrt(squares) / time } else { 0.0 };
        let time = self.out.points.last().map_or(0.0, |p| p.time) + time;
        self.branch = branch;
        self.out.points.push(JointPoint { time, pose: aim.pose, joints, speed, source: Some(source) });
        true
    }

    /// Which of the joint solutions the machine takes.
    fn choose(&mut self, all: &[Solution], aim: &Aim, source: Source) -> Option<(Vec<f64>, u8)> {
        let last = self.out.points.last()?.joints.clone();
        if self.options.reference {
            return all.first().map(|s| (s.joints.clone(), s.branch));
        }
        let wrapped: Vec<Solution> = all.iter().map(|s| self.within_limits(s, &last, aim.free)).collect();
        // Along a path the arm keeps its configuration; only a joint move may change it.
        let fits: Vec<Solution> =
            wrapped.iter().filter(|s| aim.free || s.branch == self.branch || s.singular).cloned().collect();
        let good: Vec<Solution> = fits.iter().filter(|s| self.outside(s).is_none()).cloned().collect();
        if let Some(best) = nearest(&good, &last, &self.out.kinds) {
            return Some((best.joints.clone(), if best.singular { self.branch } else { best.branch }));
        }
        let (index, value) = fits.first().and_then(|s| self.outside(s))?;
        let joint = &self.machine.joints[index];
        let limit = if joint.max.is_some_and(|m| value > m) { joint.max } else { joint.min };
        let args = [joint.name.clone(), joint.show(value), limit.map_or(String::new(), |l| joint.show(l))];
        self.fault(code::ROBOT_JOINT_LIMIT, source, &args);
        None
    }

    /// Whole turns added or taken so that each angle lies nearest to where the joint is; a joint move may also go
    /// a turn further to stay within limits, along a path that would be a jump.
    fn within_limits(&self, solution: &Solution, last: &[f64], free: bool) -> Solution {
        const TURN: f64 = 2.0 * std::f64::consts::PI;
        let mut out = solution.clone();
        for ((value, joint), old) in out.joints.iter_mut().zip(&self.machine.joints).zip(last) {
            if joint.kind == JointKind::Revolute {
                let near = *value + TURN * libm::round((old - *value) / TURN);
                let all = [near, near - TURN, near + TURN];
                *value = all.into_iter().find(|v| free && joint.allows(*v)).unwrap_or(near);
            }
        }
        out
    }

    fn outside(&self, solution: &Solution) -> Option<(usize, f64)> {
        let mut pairs = self.machine.joints.iter().zip(&solution.joints).enumerate();
        pairs.find(|(_, (j, v))| !j.allows(**v)).map(|(i, (_, v))| (i, *v))
    }

    fn limit(&self, joint: usize, rapid: bool) -> Option<f64> {
        let j = &self.machine.joints[joint];
        let own = if rapid { j.rapid.or(j.speed) } else { j.speed };
        match (own, self.options.joint_speed) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// The time a joint move takes: the slowest joint runs at its limit.
    fn calm_time(&self, change: &[f64]) -> f64 {
        let times = change.iter().enumerate().map(|(i, d)| d.abs() / self.limit(i, true).unwrap_or(CALM));
        times.fold(0.0, f64::max)
    }

    fn slow_enough(&mut self, change: &[f64], time: f64, aim: &Aim, source: Source) -> bool {
        let worst = change.iter().enumerate().filter_map(|(i, d)| {
            let limit = self.limit(i, aim.free)?;
            let speed = if time > 0.0 { d.abs() / time } else { 0.0 };
            (speed > limit * (1.0 + 1e-9)).then_some((i, speed, limit))
        });
        let worst = worst.max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)));
        let Some((i, speed, limit)) = worst else {
            return true;
        };
        let joint = &self.machine.joints[i];
        let per_second = |v: f64| format!("{}/s", joint.show(v));
        let feed = libm::floor(aim.feed * limit / speed * 100.0) / 100.0;
        let args = [joint.name.clone(), per_second(speed), per_second(limit), format!("{feed} mm/s")];
        self.fault(code::ROBOT_JOINT_SPEED, source, &args);
        false
    }

    fn unreachable(&mut self, error: &KinematicsError, pose: [f64; 6], source: Source) {
        let at = format!("X {:.3} Y {:.3}, C {:.3}°", pose[0], pose[1], pose[5].to_degrees());
        match error {
            KinematicsError::Singular => self.fault(code::ROBOT_SINGULAR, source, &[format!("{at}; {error}")]),
            KinematicsError::OutOfPlane { word, value } => {
                let value = if matches!(word, 'A' | 'B' | 'C') {
                    format!("{:.3}°", value.to_degrees())
                } else {
                    format!("{value:.3} mm")
                };
                self.fault(code::ROBOT_OUT_OF_PLANE, source, &[word.to_string(), value]);
            }
            _ => self.fault(code::ROBOT_OUT_OF_REACH, source, &[format!("{at}; {error}")]),
        }
    }
}

/// A joint value in the unit that is written.
pub(super) fn shown(value: f64, kind: JointKind) -> f64 {
    match kind {
        JointKind::Revolute => value.to_degrees(),
        JointKind::Prismatic => value,
    }
}

fn distance(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    libm::sqrt((0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum())
}

fn turned(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    libm::sqrt((3..6).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum())
}

/// The solution with the smallest greatest joint change.
fn nearest<'s>(all: &'s [Solution], last: &[f64], kinds: &[JointKind]) -> Option<&'s Solution> {
    let far = |s: &Solution| {
        let changes = s.joints.iter().zip(last).zip(kinds).map(|((a, b), k)| shown((a - b).abs(), *k));
        changes.fold(0.0, f64::max)
    };
    all.iter().min_by(|a, b| far(a).total_cmp(&far(b)))
}

/// What has an effect and can't be said by joint positions alone.
fn no_joint_form(op: &Op<'_>) -> Option<&'static str> {
    Some(match op {
        Op::Nurbs { .. } => "a spline",
        Op::Probe(_) => "a probe move",
        Op::RigidTap { .. } => "rigid tapping",
        Op::Dwell(t) if *t > 0.0 => "a dwell",
        Op::SpindleTurn { turn, .. } if *turn != gr_ir::Turn::Stop => "a spindle start",
        Op::SpindleOrient { .. } => "spindle orientation",
        Op::Mist(true) | Op::Flood(true) => "coolant",
        Op::ToolChange(_) => "a tool change",
        Op::DigitalOut { .. } | Op::AnalogOut { .. } => "an output",
        Op::InputWait { .. } => "waiting for an input",
        Op::UserM { .. } => "a user-defined M-code",
        Op::Stop(gr_ir::Stop::Program | gr_ir::Stop::Pallet) => "a program stop",
        Op::IndexerLock(..) => "indexer lock",
        _ => return None,
    })
}
