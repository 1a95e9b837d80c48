//! Set-points for a joint controller: position, velocity and acceleration of every joint at a fixed rate. The tool
//! keeps to the path exactly; along it the speed rises and falls with limited acceleration, and with limited jerk when
//! a smoothing time is given (F. R. A. de Oliveira, UFMG 2008, figures 3-1 and 3-2: the step of speed that a
//! trajectory asks for, and what a controller makes of it).
//!
//! The path is parted into moves, each with the time it takes at the programmed feed; the law says how fast that time
//! runs, from 0 (rest) to 1 (feed). Averaging the law over the smoothing time turns its ramps of speed into S-curves
//! and leaves the path as it is. Where the path itself goes over from a line into an arc, the acceleration across it
//! still begins at once.

use std::fmt::Write as _;

use gr_ir::{Source, Sources};
use gr_machine::JointKind;
use gr_machine::math::{Frame, norm, sub, turn_of};
use gr_text::{Diagnostic, code};

use crate::follow::{nearer, unwrap};
use crate::gather::{ArcPiece, Gathered, Move, Way};
use crate::joints::TooMany;
use crate::path::{Mount, Path};
use crate::solver::{Branches, Joints, Limits, Solver};
use crate::program::{ON_THE_SPOT, turned_on_the_spot};
use crate::{Action, MAX_JOINTS, RobotProgram, Target, Zone};

/// What can be chosen.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SetpointOptions {
    /// Time between two set-points, s.
    pub interval: f64,
    /// Time in which acceleration builds up, s; 0 = at once.
    pub smoothing: f64,
    /// Set-points at most.
    pub most: usize,
}

impl Default for SetpointOptions {
    fn default() -> SetpointOptions {
        SetpointOptions { interval: 0.004, smoothing: 0.0, most: 3_000_000 }
    }
}

/// A set-point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Setpoint {
    /// Joint values, rad or mm.
    pub position: [f64; MAX_JOINTS],
    /// Per second.
    pub velocity: [f64; MAX_JOINTS],
    /// Per second².
    pub acceleration: [f64; MAX_JOINTS],
}

/// Something that is no motion: the machine stands still for it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Event {
    /// The set-point at which it is due.
    pub row: usize,
    /// Its step in the program.
    pub step: usize,
}

/// Why there are no set-points.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Fault {
    /// More than allowed.
    TooMany(TooMany),
    /// A joint gains speed faster than it can, however slowly it goes: rad/s² or mm/s².
    Acceleration {
        /// Which.
        joint: usize,
        /// Asked for.
        value: f64,
        /// Allowed.
        limit: f64,
        /// Where.
        source: Option<Source>,
    },
}

impl Fault {
    /// As a finding.
    pub fn finding(&self, machine: &gr_machine::Machine, sources: &dyn Sources) -> Diagnostic {
        let (code, source, args) = match self {
            Fault::TooMany(many) => (code::ROBOT_TOO_MANY_POINTS, many.source, vec![many.most.to_string()]),
            Fault::Acceleration { joint, value, limit, source } => {
                let joint = &machine.joints[*joint];
                let shown = |v: f64| format!("{}/s²", joint.show(v));
                (code::ROBOT_ACCELERATION, *source, vec![joint.name.clone(), shown(*value), shown(*limit)])
            }
        };
        let (file, span) = sources.place(source.unwrap_or_default());
        Diagnostic::new(code, file, span, &args)
    }
}

/// Cuts that don't reach their feed.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Unreached {
    /// How many.
    pub cuts: usize,
    /// Of so many.
    pub of: usize,
    /// The slowest: the share of its feed that it reaches, and where.
    pub least: Option<(f64, Source)>,
}

/// A stream of set-points.
#[derive(Clone, PartialEq, Debug)]
pub struct Setpoints {
    /// Time between two, s.
    pub interval: f64,
    /// Joints.
    pub joints: usize,
    /// The set-points, the start first.
    pub rows: Vec<Setpoint>,
    /// What else is done, in order.
    pub events: Vec<Event>,
    /// Cuts that don't get up to their feed, because a joint can't gain speed fast enough or not go as fast.
    pub unreached: Unreached,
    kinds: Vec<JointKind>,
    names: Vec<String>,
}

/// A jump of a joint's speed smaller than this share of its greatest is rounding.
const NO_JUMP: f64 = 1e-6;
/// A joint without an acceleration in the machine file reaches its speed in this time, s.
const RISE: f64 = 0.25;
/// A joint that is still too fast at this share of its acceleration jumps.
const SLOWEST: f64 = 0.005;
/// Up to this share of a limit it is kept.
const NEARLY: f64 = 1.0 + 1e-6;
/// A cut that gets up to this share of its feed has reached it.
const REACHED: f64 = 0.999;

/// A move as joints over its own time.
struct Piece {
    seconds: f64,
    from: Joints,
    to: Joints,
    /// Configurations at both ends.
    branches: [u8; 2],
    /// None: all joints evenly.
    path: Option<(Path, Mount)>,
    stop: bool,
    /// A rapid of the program; its corner, mm, and its straight length, mm.
    rapid: bool,
    corner: f64,
    length: f64,
    source: Option<Source>,
    /// Greatest rate, and greatest change of rate per second.
    rate: f64,
    change: f64,
    /// Joint velocities at its ends at rate 1.
    ends: [Joints; 2],
}

/// A stretch of the law with constant change of rate.
#[derive(Clone, Copy)]
struct Ramp {
    /// Start, s.
    at: f64,
    seconds: f64,
    /// Own time of the program at the start, rate there, change of rate.
    time: f64,
    rate: f64,
    change: f64,
    /// Integral of the own time up to the start.
    sum: f64,
}

/// Makes the set-points of a program.
pub fn setpoints(program: &RobotProgram, options: &SetpointOptions) -> Result<Setpoints, Fault> {
    let mut made = Maker::new(program, options);
    made.pieces();
    let mut pace = Pace::full(made.list.len());
    loop {
        let mut out = made.stream(&pace).map_err(Fault::TooMany)?;
        let over = made.over(&out.rows, &pace);
        if over.pieces.iter().chain(&over.corners).all(|(share, _)| *share <= NEARLY) {
            out.unreached = made.unreached(&pace);
            return Ok(out);
        }
        let slower = |share: f64| share.min(4.0) * 1.02;
        for (corner, (share, _)) in pace.corners.iter_mut().zip(over.corners).filter(|(_, (share, _))| *share > NEARLY) {
            *corner /= slower(share);
        }
        for (k, (share, joint)) in over.pieces.into_iter().enumerate().filter(|(_, (share, _))| *share > NEARLY) {
            if pace.pieces[k] < SLOWEST {
                let limit = made.acceleration[joint];
                let source = made.list[k..].iter().find_map(|p| p.source);
                return Err(Fault::Acceleration { joint, value: share * limit, limit, source });
            }
            pace.pieces[k] /= slower(share);
        }
    }
}

/// How much slower it goes than the joints allow piece by piece, as shares of their accelerations: a tight spot slows what runs
/// through it and nothing else.
struct Pace {
    pieces: Vec<f64>,
    /// Where each piece begins, and the end.
    corners: Vec<f64>,
}

impl Pace {
    fn full(pieces: usize) -> Pace {
        Pace { pieces: vec![1.0; pieces], corners: vec![1.0; pieces + 1] }
    }
}

/// Greatest share of an acceleration limit, and of which joint.
struct Over {
    pieces: Vec<(f64, usize)>,
    /// Where the machine goes over from the piece before without a stop.
    corners: Vec<(f64, usize)>,
}

/// Time at feed and of rapids with the accelerations of the machine file, s; none where it has none. Moves begin and end as
/// in set-points, but with all of a joint's acceleration, and corners are passed within their zone.
pub(crate) fn paced(program: &RobotProgram) -> Option<[f64; 2]> {
    let joints = &program.machine.joints;
    joints.iter().any(|j| j.acceleration.is_some()).then_some(())?;
    let options = SetpointOptions { interval: 0.0, smoothing: 0.0, most: 0 };
    let mut made = Maker::new(program, &options);
    for (a, j) in made.acceleration.iter_mut().zip(joints) {
        *a = j.acceleration.unwrap_or(f64::INFINITY);
    }
    (made.speed, made.share, made.rounds) = (crate::plan::speeds(&program.machine), 1.0, true);
    made.pieces();
    let join = made.joins(&Pace::full(made.list.len()));
    let mut out = [0.0; 2];
    for (k, p) in made.list.iter().enumerate() {
        let leg = made.leg(k, &join, 1.0);
        out[usize::from(p.rapid)] += leg.up + leg.run.max(0.0) / leg.peak + leg.down;
    }
    Some(out)
}

/// The rate along one piece: up from that of its start to the peak, on, and down to that of its end.
struct Leg {
    change: f64,
    start: f64,
    peak: f64,
    /// Real time of both slopes, s, and own time between them.
    up: f64,
    run: f64,
    down: f64,
}

struct Maker<'a> {
    program: &'a RobotProgram,
    options: &'a SetpointOptions,
    solver: Solver,
    limits: Limits,
    speed: Joints,
    acceleration: Joints,
    /// Of a joint's acceleration, along the path and across it each.
    share: f64,
    /// Corners are cut within their zones.
    rounds: bool,
    list: Vec<Piece>,
    /// Waits: before which piece, s.
    waits: Vec<(usize, f64)>,
    /// What else is done: before which piece, after which part of the wait there, which step.
    events: Vec<(usize, f64, usize)>,
    source: Option<Source>,
}

impl<'a> Maker<'a> {
    fn new(program: &'a RobotProgram, options: &'a SetpointOptions) -> Maker<'a> {
        let (mut speed, mut acceleration) = ([1.0; MAX_JOINTS], [1.0; MAX_JOINTS]);
        for (i, j) in program.machine.joints.iter().enumerate() {
            speed[i] = j.top_speed();
            acceleration[i] = j.acceleration.unwrap_or(speed[i] / RISE);
        }
        Maker {
            program,
            options,
            solver: Solver::new(&program.machine),
            limits: Limits::new(&program.machine),
            speed,
            acceleration,
            share: 0.5,
            rounds: false,
            list: Vec::new(),
            waits: Vec::new(),
            events: Vec::new(),
            source: None,
        }
    }

    fn pieces(&mut self) {
        let mut g = Gathered {
            items: Vec::new(),
            turns: Vec::new(),
            arcs: Vec::new(),
            tools: self.program.tools.clone(),
            frames: self.program.frames.clone(),
            wait_seconds: 0.0,
            curves: crate::Curves::default(),
            by_direction: false,
        };
        let (mut tool, mut frame) = (0u16, 0u16);
        let mut here = self.program.home;
        for (i, step) in self.program.steps.iter().enumerate() {
            self.source = step.source;
            match &step.action {
                Action::UseTool(t) => {
                    if let [Some(old), Some(new)] = [tool, *t].map(|t| g.tools.get(usize::from(t))) {
                        here = here.retooled(&old.frame, &new.frame);
                    }
                    tool = *t;
                }
                Action::UseFrame(f) => {
                    let (old, new) = (g.frames[usize::from(frame)].frame, g.frames[usize::from(*f)].frame);
                    here = here.reframed(&old, &new);
                    frame = *f;
                }
                Action::Joint { to, speed, zone } => {
                    let to = self.program.targets[*to as usize];
                    let times = (0..self.solver.count).map(|i| (to.joints[i] - here.joints[i]).abs() / self.speed[i]);
                    let seconds = times.fold(0.0, f64::max) / speed;
                    self.add(&here, &to, seconds, None, *zone, true);
                    here = to;
                }
                Action::Linear { to, speed, zone, rapid } => {
                    here = self.cut(&mut g, here, *to, None, *speed, (*zone, *rapid), (tool, frame));
                }
                Action::Probe { to, speed, .. } => here = self.cut(&mut g, here, *to, None, *speed, (Zone::Stop, false), (tool, frame)),
                Action::Arc { via, to, center, normal, angle, speed, zone } => {
                    let via = self.program.targets[*via as usize].position;
                    let arc = ArcPiece { center: *center, normal: *normal, via, angle: *angle };
                    here = self.cut(&mut g, here, *to, Some(arc), *speed, (*zone, false), (tool, frame));
                }
                Action::Dwell(s) => self.wait(*s),
                Action::ChangeTool { .. } | Action::Signal { .. } | Action::WaitInput { .. } => self.event(i),
                Action::Message(_) | Action::Pause { .. } => self.event(i),
                // A comment says nothing to a machine.
                Action::Comment(_) | Action::End => {}
            }
        }
    }

    fn wait(&mut self, seconds: f64) {
        if let Some(last) = self.list.last_mut() {
            last.stop = true;
        }
        self.waits.push((self.list.len(), seconds));
    }

    /// Stands still long enough for one set-point in it: that is where it is done.
    fn event(&mut self, step: usize) {
        let k = self.list.len();
        let waited = self.waited(k);
        self.events.push((k, waited, step));
        self.wait(2.0 * self.options.interval);
    }

    /// How long the machine waits before a piece, s.
    fn waited(&self, k: usize) -> f64 {
        let first = self.waits.partition_point(|w| w.0 < k);
        self.waits[first..].iter().take_while(|w| w.0 == k).map(|w| w.1).sum()
    }

    #[allow(clippy::too_many_arguments)]
    fn cut(&mut self, g: &mut Gathered, here: Target, to: u32, arc: Option<ArcPiece>, speed: f64, (zone, rapid): (Zone, bool), (tool, frame): (u16, u16)) -> Target {
        let to = self.program.targets[to as usize];
        g.turns = vec![turn_of(here.quaternion), turn_of(to.quaternion)];
        g.arcs.clear();
        g.arcs.extend(arc);
        let m = Move {
            way: if arc.is_some() { Way::Arc(0) } else { Way::Line },
            position: to.position,
            turn: u32::from(here.quaternion != to.quaternion),
            frame,
            tool,
            speed,
            zone,
            length: 0.0,
            rapid,
            free: false,
            ours: false,
            probe: None,
            source: None,
        };
        let path = Path::new(g, &self.solver, &Frame { turn: g.turns[0], position: here.position }, &m);
        // The parts of one motion that turns the tool of a mill go by one clock: their rotary axes go evenly. How fast its other axes
        // can follow, the rate says.
        let turns = self.program.machine.kind == gr_machine::Kind::Mill && here.quaternion != to.quaternion;
        let counts = |i: &usize| !turns || self.limits.turns[*i];
        let times = (0..self.solver.count).filter(counts).map(|i| (to.joints[i] - here.joints[i]).abs() / self.speed[i]);
        let least = times.fold(0.0, f64::max);
        let turned = turned_on_the_spot(&self.program.machine, &here.joints, &to.joints);
        let asked = if path.length > ON_THE_SPOT { path.length } else { turned };
        let seconds = (asked / speed).max(least);
        let mount = Mount::new(g, &m, 0.0);
        self.add(&here, &to, seconds, Some((path, mount)), zone, rapid);
        to
    }

    fn add(&mut self, from: &Target, to: &Target, seconds: f64, path: Option<(Path, Mount)>, zone: Zone, rapid: bool) {
        if !(seconds > 1e-9) {
            return;
        }
        let mut piece = Piece {
            seconds,
            from: from.joints,
            to: to.joints,
            branches: [from.branch, to.branch],
            path,
            stop: zone == Zone::Stop,
            rapid,
            corner: if let Zone::Blend(r) = zone { r } else { 0.0 },
            length: norm(sub(to.position, from.position)),
            source: self.source,
            rate: 1.0,
            change: f64::INFINITY,
            ends: [[0.0; MAX_JOINTS]; 2],
        };
        self.bound(&mut piece);
        self.list.push(piece);
    }

    /// Joints at a share of a piece.
    fn at(&self, p: &Piece, share: f64) -> Joints {
        let mut even = p.from;
        (0..self.solver.count).for_each(|i| even[i] += (p.to[i] - p.from[i]) * share);
        let Some((path, mount)) = &p.path else { return even };
        if share <= 0.0 {
            return p.from;
        }
        if share >= 1.0 {
            return p.to;
        }
        let flange = mount.flange(&path.at(share));
        let mut q = even;
        let mut all = Branches::NONE;
        if self.solver.searches() {
            q = self.solver.near(&flange, &even).unwrap_or(even);
            unwrap(&mut q, &even, &self.limits.turns, self.solver.count);
        } else if self.solver.all(&flange, &mut all).is_ok() {
            let meets = all.good.trailing_zeros() as u8 & 7;
            let pair = if p.branches.iter().any(|b| all.has(*b)) { p.branches } else { [meets; 2] };
            q = nearer(&self.solver, &self.limits, &all, pair, &even).map_or(even, |f| f.0);
        }
        q
    }

    /// How fast a piece may run, from its joints' speeds and accelerations.
    fn bound(&self, p: &mut Piece) {
        let looks = p.path.as_ref().map_or(1, |(path, _)| path.looks().clamp(8, 256));
        let n = looks as f64;
        let all: Vec<Joints> = (0..=looks).map(|k| self.at(p, k as f64 / n)).collect();
        let h = p.seconds / n;
        for i in 0..self.solver.count {
            for k in 0..looks {
                let v = (all[k + 1][i] - all[k][i]).abs() / h;
                if v > 0.0 {
                    p.rate = p.rate.min(self.speed[i] / v);
                    p.change = p.change.min(self.share * self.acceleration[i] / v);
                }
                if k > 0 {
                    let a = (all[k + 1][i] - 2.0 * all[k][i] + all[k - 1][i]).abs() / (h * h);
                    if a > 0.0 {
                        p.rate = p.rate.min(libm::sqrt(self.share * self.acceleration[i] / a));
                    }
                }
            }
        }
        let small = 1e-4;
        let [a, b, c, d] = [small, 2.0 * small, 1.0 - 2.0 * small, 1.0 - small].map(|share| self.at(p, share));
        // Of three values each, so that what only bends there is no jump.
        for i in 0..self.solver.count {
            p.ends[0][i] = (4.0 * a[i] - 3.0 * p.from[i] - b[i]) / (2.0 * small * p.seconds);
            p.ends[1][i] = (3.0 * p.to[i] - 4.0 * d[i] + c[i]) / (2.0 * small * p.seconds);
        }
    }

    /// Greatest rate at which one piece may go over into the next.
    fn junction(&self, a: &Piece, b: &Piece) -> f64 {
        if a.stop {
            return 0.0;
        }
        if self.rounds {
            return self.rounded(a, b);
        }
        // A corner of the path is as sharp as it is, however smooth the law: what the joints jump by must be small
        // against what they may change between two set-points.
        let step = self.options.interval * (self.options.interval / self.options.smoothing.max(self.options.interval));
        let mut rate = a.rate.min(b.rate);
        for i in 0..self.solver.count {
            let jump = (a.ends[1][i] - b.ends[0][i]).abs();
            if jump > 0.0 {
                rate = rate.min(0.5 * self.acceleration[i] * step / jump);
            }
        }
        if rate < 0.02 { 0.0 } else { rate }
    }

    /// The same where the corner is cut within its zone: joints have the time that the way there and back takes.
    fn rounded(&self, a: &Piece, b: &Piece) -> f64 {
        let time = a.corner * (a.seconds / a.length.max(ON_THE_SPOT) + b.seconds / b.length.max(ON_THE_SPOT));
        let mut rate = a.rate.min(b.rate);
        for i in 0..self.solver.count {
            let jump = (a.ends[1][i] - b.ends[0][i]).abs();
            if jump > NO_JUMP * self.speed[i] {
                rate = rate.min(libm::sqrt(self.acceleration[i] * time / jump));
            }
        }
        rate
    }

    /// Rates at which pieces go over into each other, the first and the last from and to rest.
    fn joins(&self, pace: &Pace) -> Vec<f64> {
        let n = self.list.len();
        let mut join = vec![0.0; n + 1];
        for k in 1..n {
            let waits = self.waits.binary_search_by_key(&k, |w| w.0).is_ok();
            let slower = pace.corners[k] * pace.pieces[k - 1].min(pace.pieces[k]);
            let rate = self.junction(&self.list[k - 1], &self.list[k]) * libm::sqrt(slower);
            join[k] = if waits || pace.corners[k] < SLOWEST { 0.0 } else { rate };
        }
        let gain = |k: usize| 2.0 * self.list[k].change * pace.pieces[k] * self.list[k].seconds;
        for k in 0..n {
            join[k + 1] = join[k + 1].min(libm::sqrt(join[k] * join[k] + gain(k)));
        }
        for k in (0..n).rev() {
            join[k] = join[k].min(libm::sqrt(join[k + 1] * join[k + 1] + gain(k)));
        }
        join
    }

    fn leg(&self, k: usize, join: &[f64], slower: f64) -> Leg {
        let p = &self.list[k];
        let (a, top) = (p.change * slower, p.rate * libm::sqrt(slower.min(1.0)));
        let (v0, v1) = (join[k], join[k + 1]);
        let peak = libm::sqrt(((v0 * v0 + v1 * v1) / 2.0 + a * p.seconds).max(0.0)).min(top.max(v0).max(v1));
        let (up, down) = ((peak - v0) / a, (peak - v1) / a);
        let run = p.seconds - (peak + v0) / 2.0 * up - (peak + v1) / 2.0 * down;
        Leg { change: a, start: v0, peak, up, run, down }
    }

    /// The law: ramps of the rate over real time; and when each piece before which the machine stands is waited for.
    fn law(&self, pace: &Pace) -> (Vec<Ramp>, Vec<f64>) {
        let n = self.list.len();
        let join = self.joins(pace);
        let mut law = Law { ramps: Vec::new(), at: 0.0, time: 0.0, sum: 0.0 };
        let mut done = 0.0;
        let mut reached = Vec::with_capacity(n + 1);
        for k in 0..n {
            reached.push(law.at);
            let waited = self.waited(k);
            let settle = if join[k] == 0.0 { self.options.smoothing } else { 0.0 };
            law.ramp(waited + settle, 0.0, 0.0);
            let leg = self.leg(k, &join, pace.pieces[k]);
            law.ramp(leg.up, leg.start, leg.change);
            if leg.run > 0.0 {
                law.ramp(leg.run / leg.peak, leg.peak, 0.0);
            }
            law.ramp(leg.down, leg.peak, -leg.change);
            // Rounding must not add up.
            done += self.list[k].seconds;
            law.time = done;
        }
        reached.push(law.at);
        let waited = self.waited(n);
        law.ramp(waited + self.options.smoothing + self.options.interval, 0.0, 0.0);
        (law.ramps, reached)
    }

    /// Cuts that don't reach their feed.
    fn unreached(&self, pace: &Pace) -> Unreached {
        let join = self.joins(pace);
        let mut out = Unreached::default();
        for (k, p) in self.list.iter().enumerate().filter(|(_, p)| p.path.is_some() && !p.rapid) {
            let peak = self.leg(k, &join, pace.pieces[k]).peak;
            out.of += 1;
            let Some(source) = p.source.filter(|_| peak < REACHED) else { continue };
            out.cuts += 1;
            if out.least.is_none_or(|(least, _)| peak < least) {
                out.least = Some((peak, source));
            }
        }
        out
    }

    /// When each piece begins, in its own time.
    fn starts(&self) -> Vec<f64> {
        let mut next = 0.0;
        let start = |p: &Piece| {
            let at = next;
            next += p.seconds;
            at
        };
        self.list.iter().map(start).collect()
    }

    fn stream(&self, pace: &Pace) -> Result<Setpoints, TooMany> {
        let (law, reached) = self.law(pace);
        let total = law.last().map_or(0.0, |r| r.at + r.seconds);
        let dt = self.options.interval;
        let count = libm::ceil(total / dt);
        if !(count < self.options.most as f64) {
            return Err(TooMany { most: self.options.most, source: self.source });
        }
        let starts = self.starts();
        let eps = dt / 4.0;
        let mut rows = Vec::with_capacity(count as usize + 1);
        for k in 0..=count as usize {
            let t = k as f64 * dt;
            let [a, b, c] = [t - eps, t, t + eps].map(|t| self.position(&law, &starts, t));
            let mut row = Setpoint { position: b, velocity: [0.0; MAX_JOINTS], acceleration: [0.0; MAX_JOINTS] };
            for i in 0..self.solver.count {
                row.velocity[i] = (c[i] - a[i]) / (2.0 * eps);
                row.acceleration[i] = (c[i] - 2.0 * b[i] + a[i]) / (eps * eps);
            }
            rows.push(row);
        }
        let names = self.program.machine.joints.iter().map(|j| j.name.clone()).collect();
        let kinds = self.program.machine.joints.iter().map(|j| j.kind).collect();
        // Smoothed, the machine comes to rest so much later.
        let due = |(piece, waited, step): &(usize, f64, usize)| {
            let t = reached.get(*piece).map_or(total, |t| t + self.options.smoothing + waited);
            Event { row: (libm::ceil(t / dt + 0.25).max(0.0) as usize).min(rows.len() - 1), step: *step }
        };
        let events = self.events.iter().map(due).collect();
        Ok(Setpoints { interval: dt, joints: self.solver.count, rows, events, unreached: Unreached::default(), kinds, names })
    }

    /// Joints at a real time.
    fn position(&self, law: &[Ramp], starts: &[f64], t: f64) -> Joints {
        let width = self.options.smoothing;
        let time = if width > 0.0 { (integral(law, t) - integral(law, t - width)) / width } else { own_time(law, t) };
        let Some(k) = starts.partition_point(|s| *s <= time).checked_sub(1) else { return self.program.home.joints };
        let p = &self.list[k];
        self.at(p, ((time - starts[k]) / p.seconds).clamp(0.0, 1.0))
    }

    /// Where accelerations are over their limits; speeds keep theirs by the rate. A jump may fall between two set-points: their second
    /// difference has it.
    fn over(&self, rows: &[Setpoint], pace: &Pace) -> Over {
        let dt = self.options.interval;
        let n = self.list.len();
        let mut over = Over { pieces: vec![(0.0, 0); n], corners: vec![(0.0, 0); n + 1] };
        let (law, _) = self.law(pace);
        let (starts, join) = (self.starts(), self.joins(pace));
        let piece = |t: f64| starts.partition_point(|s| *s <= own_time(&law, t.max(0.0))).clamp(1, n.max(1)) - 1;
        for (k, row) in rows.iter().enumerate() {
            let share = |i: usize| {
                let at = |k: usize| rows.get(k).map_or(row.position[i], |r| r.position[i]);
                let between = (at(k + 1) - 2.0 * row.position[i] + at(k.saturating_sub(1))) / (dt * dt);
                row.acceleration[i].abs().max(between.abs()) / self.acceleration[i]
            };
            let most = (0..self.solver.count).map(|i| (share(i), i)).fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a });
            if most.0 > NEARLY && n > 0 {
                // What runs there; smoothed, what has run before counts too.
                let t = k as f64 * dt;
                let (first, last) = (piece(t - dt - self.options.smoothing), piece(t + dt));
                let raise = |slot: &mut (f64, usize)| *slot = if most.0 > slot.0 { most } else { *slot };
                if (first + 1..=last).any(|c| join[c] > 0.0) {
                    over.corners[first + 1..=last].iter_mut().for_each(raise);
                } else {
                    over.pieces[first..=last].iter_mut().for_each(raise);
                }
            }
        }
        over
    }
}

/// An action in words, and what the machine file has for it.
fn told(action: &Action) -> (String, String) {
    let row = |s: &gr_machine::Signal, value: Option<f64>| match (&s.routine, &s.signal) {
        (Some(routine), _) => routine.clone(),
        (_, Some(signal)) => value.map_or(signal.clone(), |v| format!("{signal} = {v}")),
        _ => String::new(),
    };
    match action {
        // What the program says goes before what the machine file says.
        Action::Signal { word, value, signal } if matches!(word.code.as_str(), "S" | "M67" | "M68") => (word.to_string(), row(signal, *value)),
        Action::Signal { word, signal, .. } => (word.to_string(), row(signal, signal.value)),
        Action::ChangeTool { number, by } => (format!("T{number} M6"), by.as_ref().map_or(String::new(), |s| row(s, Some(f64::from(*number))))),
        Action::WaitInput { name, on, timeout } => {
            let most = timeout.map_or(String::new(), |t| format!(", at most {t} s"));
            (format!("wait until it is {}{most}", if *on { "on" } else { "off" }), name.clone())
        }
        Action::Message(text) => (format!("message: {}", text.trim()), String::new()),
        Action::Pause { optional } => ((if *optional { "M1" } else { "M0" }).to_string(), String::new()),
        _ => (String::new(), String::new()),
    }
}

struct Law {
    ramps: Vec<Ramp>,
    at: f64,
    time: f64,
    sum: f64,
}

impl Law {
    fn ramp(&mut self, seconds: f64, rate: f64, change: f64) {
        if !(seconds > 0.0) {
            return;
        }
        let ramp = Ramp { at: self.at, seconds, time: self.time, rate, change, sum: self.sum };
        self.at += seconds;
        self.sum = ramp.integral(seconds);
        self.time = ramp.time(seconds);
        self.ramps.push(ramp);
    }
}

impl Ramp {
    fn time(&self, s: f64) -> f64 {
        self.time + s * (self.rate + s * self.change / 2.0)
    }
    fn integral(&self, s: f64) -> f64 {
        self.sum + s * (self.time + s * (self.rate / 2.0 + s * self.change / 6.0))
    }
}

fn ramp_at(law: &[Ramp], t: f64) -> Option<&Ramp> {
    law.get(law.partition_point(|r| r.at <= t).saturating_sub(1))
}

fn own_time(law: &[Ramp], t: f64) -> f64 {
    ramp_at(law, t).map_or(0.0, |r| r.time((t - r.at).clamp(0.0, r.seconds)))
}

fn integral(law: &[Ramp], t: f64) -> f64 {
    let Some(r) = ramp_at(law, t).filter(|_| t > 0.0) else { return 0.0 };
    let inside = (t - r.at).clamp(0.0, r.seconds);
    // After the end it stands still.
    r.integral(inside) + (t - r.at - inside).max(0.0) * r.time(inside)
}

impl Setpoints {
    fn shown(&self, i: usize, v: f64) -> f64 {
        if self.kinds.get(i) == Some(&JointKind::Revolute) { v.to_degrees() } else { v }
    }

    /// What is no motion, as a table: number of the set-point, time, line, what, and the signal or routine of the
    /// machine file for it. Before it, where external axes have to stand.
    pub fn events_csv(&self, program: &RobotProgram) -> String {
        let cell = |text: String| format!("\"{}\"", text.replace('"', "'").replace(['\n', '\r'], " "));
        let mut out = String::from("setpoint,t,line,what,signal\n");
        for e in &program.machine.cell.external {
            let _ = writeln!(out, "0,{:.6},,{},\"\"", 0.0, cell(e.stands()));
        }
        for event in &self.events {
            let Some(step) = program.steps.get(event.step) else { continue };
            let line = step.source.map_or(String::new(), |s| (s.line + 1).to_string());
            let (what, signal) = told(&step.action);
            let t = event.row as f64 * self.interval;
            let _ = writeln!(out, "{},{t:.6},{line},{},{}", event.row, cell(what), cell(signal));
        }
        out
    }

    /// What the player of the set-points has to do besides, as one warning at the first of it.
    pub fn findings(&self, program: &RobotProgram, sources: &dyn Sources) -> Vec<Diagnostic> {
        let mut kinds: Vec<String> = Vec::new();
        for step in self.events.iter().filter_map(|e| program.steps.get(e.step)) {
            let what = match &step.action {
                Action::Signal { word, .. } => word.key(),
                Action::ChangeTool { .. } => "a tool change".into(),
                Action::WaitInput { .. } => "waiting for an input".into(),
                Action::Message(_) => "a message to the operator".into(),
                _ => "a program stop".into(),
            };
            if !kinds.contains(&what) && kinds.len() < 50 {
                kinds.push(what);
            }
        }
        let Some(first) = self.events.first().and_then(|e| program.steps.get(e.step)) else { return Vec::new() };
        let (file, span) = sources.place(first.source.unwrap_or_default());
        vec![Diagnostic::new(code::ROBOT_EVENTS, file, span, &[kinds.join(", ")])]
    }

    /// As a table: time, then position, velocity and acceleration of each joint, in degrees and mm.
    pub fn csv(&self) -> String {
        let mut out = String::from("t");
        for name in &self.names {
            let name = name.replace([',', '"', '\n'], " ");
            let _ = write!(out, ",{name},{name}/s,{name}/s2");
        }
        out.push('\n');
        for (k, row) in self.rows.iter().enumerate() {
            let _ = write!(out, "{:.6}", k as f64 * self.interval);
            for i in 0..self.joints {
                for v in [row.position[i], row.velocity[i], row.acceleration[i]] {
                    let shown = self.shown(i, v);
                    // No minus before nothing.
                    let _ = write!(out, ",{:.6}", if shown.abs() < 5e-7 { 0.0 } else { shown });
                }
            }
            out.push('\n');
        }
        out
    }

    /// As bytes, little-endian: `GRSP`, version 1 and number of joints (u32 each), interval in s (f64), number of
    /// set-points (u64); then for each set-point all positions, all velocities, all accelerations as f64, in rad
    /// and mm.
    pub fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(28 + self.rows.len() * self.joints * 24);
        out.extend(b"GRSP");
        out.extend(1u32.to_le_bytes());
        out.extend((self.joints as u32).to_le_bytes());
        out.extend(self.interval.to_le_bytes());
        out.extend((self.rows.len() as u64).to_le_bytes());
        for row in &self.rows {
            for column in [&row.position, &row.velocity, &row.acceleration] {
                column[..self.joints].iter().for_each(|v| out.extend(v.to_le_bytes()));
            }
        }
        out
    }
}
