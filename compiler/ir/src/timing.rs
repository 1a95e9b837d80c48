//! How long a program takes on a machine whose axes have limits: the law of motion of LinuxCNC's trajectory planner
//! (feeds, speeds and accelerations of axes, exact stop and exact path, blends within a tolerance, short lines merged,
//! look-ahead). It is a calculation, not a run of the controller: speeds are planned per piece of path and times summed,
//! so that it is exact to a few servo cycles for lines, arcs and stops, and to a few percent for rounded corners.
//! Spindle and operator take no time; nor does what the controller does between moves that wait for each other.
//!
//! Sources: LinuxCNC User Concepts (trajectory control), INI configuration (`[TRAJ]`, `[AXIS_*]`), and the observed
//! behaviour of version 2.9; the tests compare with the controller itself.

mod corner;
mod piece;
mod profile;
mod spline;

use crate::geometry::{ArcShape, Length, length};
use crate::measure::{Rates, Totals, measure, nano, speed};
use crate::{ArcPlane, Axes, FeedMode, Op, PathMode, Plane, Program, State, View};
use corner::{Overlap, join};
use piece::{End, Maker, NORMAL, Piece, Shape, bend, drains, off_line};
use profile::{Leg, times};
use spline::stretches;
use std::f64::consts::TAU;

/// What the axes of a machine can do, and how its controller plans.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Dynamics {
    /// Greatest speeds of X Y Z A B C U V W, mm/s and rad/s; infinite where unknown.
    pub velocity: Axes,
    /// Greatest accelerations, mm/s² and rad/s²; infinite where unknown.
    pub acceleration: Axes,
    /// Greatest speed of the tool tip, mm/s.
    pub tip: f64,
    /// Servo cycle, s.
    pub cycle: f64,
    /// The most that the operator can turn the feed up to; corners are planned for it.
    pub overrides: f64,
    /// Corners are rounded by arcs (`ARC_BLEND_ENABLE`).
    pub arcs: bool,
    /// Pieces looked ahead (`ARC_BLEND_OPTIMIZATION_DEPTH`).
    pub look_ahead: usize,
    /// A rest shorter than this, in cycles, is passed together with the rounded corner (`ARC_BLEND_GAP_CYCLES`).
    pub gap: f64,
    /// Pieces that take less than this, s, are passed at an even change of speed (1 / `ARC_BLEND_RAMP_FREQ`).
    pub ramp: f64,
    /// Share of the acceleration that a small kink in the path may take (`ARC_BLEND_KINK_RATIO`).
    pub kink: f64,
}

impl Default for Dynamics {
    /// No limits; LinuxCNC's defaults for the rest.
    fn default() -> Dynamics {
        Dynamics {
            velocity: [f64::INFINITY; 9],
            acceleration: [f64::INFINITY; 9],
            tip: f64::INFINITY,
            cycle: 0.001,
            overrides: 1.0,
            arcs: true,
            look_ahead: 50,
            gap: 4.0,
            ramp: 0.01,
            kink: 0.1,
        }
    }
}

impl Dynamics {
    /// Whether any speed is known.
    pub fn has_speeds(&self) -> bool {
        self.velocity.iter().any(|v| v.is_finite())
    }
    /// Whether there is enough to plan with: speed and acceleration of X, Y and Z.
    pub fn known(&self) -> bool {
        let good = |v: f64| v.is_finite() && v > 0.0;
        (0..3).all(|i| good(self.velocity[i]) && good(self.acceleration[i])) && self.cycle > 0.0
    }
}

/// The times of a program's operations.
pub struct Clock {
    rates: Rates,
    /// Seconds of every operation's motion, where limits of the machine are known.
    seconds: Vec<f64>,
}

impl Clock {
    /// Times a program.
    pub fn new(program: &Program, rates: &Rates) -> Clock {
        let seconds = match &rates.dynamics {
            Some(dynamics) if dynamics.known() => Planner::new(dynamics, program.len()).run(program),
            Some(dynamics) if dynamics.has_speeds() => alone(program, dynamics, rates),
            _ => Vec::new(),
        };
        Clock { rates: *rates, seconds }
    }

    /// What one operation adds: [`measure`], with the time that the machine takes.
    pub fn measure(&self, view: &View<'_, '_>) -> Totals {
        let mut t = measure(view, &self.rates);
        if t.moves == 0 || t.untimed > 0 || matches!(view.op, Op::RigidTap { .. }) {
            return t;
        }
        if let Some(seconds) = self.seconds.get(view.index) {
            let ns = nano(*seconds);
            if view.op == Op::Rapid { t.rapid_ns = ns } else { t.feed_ns = ns }
        }
        t
    }
}

/// Where accelerations are unknown every move is timed alone, by the speeds of the axes.
fn alone(program: &Program, dynamics: &Dynamics, rates: &Rates) -> Vec<f64> {
    let mut seconds = vec![0.0; program.len()];
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        let t = measure(&view, rates);
        let (asked, mut least) = ((t.rapid_ns + t.feed_ns) as f64 / 1e9, 0.0);
        if view.op.moves() {
            stretches(&view, |part| {
                let known = shaped(part, dynamics).filter(|p| p.most.is_finite());
                least += known.map_or(0.0, |p| p.length / p.most);
            });
        }
        seconds[view.index] = if view.op == Op::Rapid && least > 0.0 { least } else { asked.max(least) };
    }
    seconds
}

/// A move of the planner with the limits of the axes.
fn shaped(view: &View<'_, '_>, dynamics: &Dynamics) -> Option<Piece> {
    let maker = Maker { dynamics };
    let (from, to) = (view.state.machine(&view.start.axes), view.state.machine(&view.end.axes));
    match &view.op {
        Op::Arc(arc) => maker.arc(arc, &ArcShape::new(arc, view.start, view.end), &from, &to, view.state),
        _ => maker.line(&from, &to),
    }
}

/// Length of a move, mm or rad.
fn way(view: &View<'_, '_>) -> f64 {
    match length(&view.op, view.start, view.end) {
        Length::Linear(mm) => mm,
        Length::Angular(rad) => rad,
    }
}

/// Short lines that are being merged into one.
struct Chain {
    from: Axes,
    ends: Vec<Axes>,
    /// The feed that they were programmed with, and the speed that it means.
    feed: f64,
    asked: f64,
    /// First of the entries that share its time.
    shares: usize,
}

/// Chains are not made longer than this.
const MOST_MERGED: usize = 100;

impl Chain {
    /// Whether a line to `to` can take the place of all of them.
    fn takes(&self, to: &Axes, tolerance: f64) -> bool {
        let xyz = |a: &Axes| [a[0], a[1], a[2]];
        let (from, end) = (xyz(&self.from), xyz(to));
        let last = self.ends.last().unwrap_or(&self.from);
        self.ends.len() <= MOST_MERGED
            && (3..9).all(|i| to[i] == last[i])
            && from != end
            && self.ends.iter().all(|p| off_line(xyz(p), from, end) <= tolerance)
    }
}

struct Planner<'a> {
    dynamics: &'a Dynamics,
    seconds: Vec<f64>,
    legs: Vec<Leg>,
    /// Operations, and weights of their shares.
    shares: Vec<(usize, f64)>,
    last: Option<Piece>,
    /// The piece before the last, its leg and its speed, where the last one begins while it brakes.
    braking: Option<(Piece, usize, f64)>,
    chain: Option<Chain>,
    path: PathMode,
    /// Motion follows a spindle's angle.
    bound: bool,
    /// Tolerance within which short lines are merged.
    merge: f64,
}

impl<'a> Planner<'a> {
    fn new(dynamics: &'a Dynamics, count: usize) -> Planner<'a> {
        Planner {
            dynamics,
            seconds: vec![0.0; count],
            legs: Vec::new(),
            shares: Vec::new(),
            last: None,
            braking: None,
            chain: None,
            path: PathMode::ExactPath,
            bound: false,
            merge: 0.0,
        }
    }

    fn run(mut self, program: &Program) -> Vec<f64> {
        let mut cursor = program.cursor();
        while let Some(view) = cursor.next() {
            if drains(&view.op) {
                self.drain();
            }
            if matches!(view.op, Op::PathMode(_) | Op::SyncStart(_) | Op::SyncStop) {
                self.flush();
            }
            if view.op.moves() {
                self.modes(view.state);
                self.moved(&view);
            }
            if matches!(view.op, Op::Probe(_)) {
                self.drain();
            }
        }
        self.drain();
        self.seconds
    }

    fn modes(&mut self, state: &State) {
        self.path = state.path;
        self.bound = state.sync.is_some_and(|s| !s.velocity);
        self.merge = if matches!(state.path, PathMode::Blend(_)) { state.merge_tolerance } else { 0.0 };
    }

    fn moved(&mut self, view: &View<'_, '_>) {
        if matches!(view.op, Op::Nurbs { .. }) {
            self.flush();
        }
        let asked = if view.op == Op::Rapid { f64::INFINITY } else { asked(view, way(view)) };
        stretches(view, |part| self.queue(part, asked));
    }

    /// Takes over a move of the planner.
    fn queue(&mut self, view: &View<'_, '_>, asked: f64) {
        let (from, to) = (view.state.machine(&view.start.axes), view.state.machine(&view.end.axes));
        match &view.op {
            Op::Linear => return self.chain_on(view, &from, &[to], asked),
            Op::Arc(arc) => {
                let shape = ArcShape::new(arc, view.start, view.end);
                let flat = shape.radius * (1.0 - libm::cos(shape.sweep.abs().min(TAU) / 2.0)) < self.merge;
                if flat && arc.plane == ArcPlane::Work(Plane::Xy) {
                    let p = shape.point(0.5);
                    let middle = std::array::from_fn(|i| if i < 3 { p[i] } else { (view.start.axes[i] + view.end.axes[i]) / 2.0 });
                    return self.chain_on(view, &from, &[view.state.machine(&middle), to], asked);
                }
            }
            _ => {}
        }
        let piece = shaped(view, self.dynamics);
        self.flush();
        let first = self.shares.len();
        self.shares.push((view.index, 1.0));
        if let Some(piece) = piece {
            self.add(Piece { rapid: view.op == Op::Rapid, shares: (first, 1), ..piece }, asked);
        }
    }

    /// Adds lines to the chain, or begins a new one with them.
    fn chain_on(&mut self, view: &View<'_, '_>, from: &Axes, ends: &[Axes], asked: f64) {
        let (state, way) = (view.state, way(view));
        for (i, end) in ends.iter().enumerate() {
            let goes_on = |c: &Chain| {
                self.merge > 0.0 && c.feed == state.feed && state.feed_mode == FeedMode::PerTime && c.takes(end, self.merge)
            };
            if !self.chain.as_ref().is_some_and(goes_on) {
                self.flush();
            }
            let first = self.shares.len();
            self.shares.push((view.index, way));
            let start = if i == 0 { from } else { &ends[i - 1] };
            let new = || Chain { from: *start, ends: Vec::new(), feed: state.feed, asked, shares: first };
            self.chain.get_or_insert_with(new).ends.push(*end);
        }
        let rotary = (3..9).any(|i| view.start.axes[i] != view.end.axes[i]);
        if rotary || self.merge == 0.0 {
            self.flush();
        }
    }

    /// The chain becomes one line.
    fn flush(&mut self) {
        let Some(chain) = self.chain.take() else { return };
        let piece = chain.ends.last().and_then(|to| Maker { dynamics: self.dynamics }.line(&chain.from, to));
        if let Some(piece) = piece {
            let shares = (chain.shares, self.shares.len() - chain.shares);
            self.add(Piece { shares, ..piece }, chain.asked);
        }
    }

    fn add(&mut self, mut piece: Piece, asked: f64) {
        piece.asked = asked.min(piece.most);
        piece.bound = self.bound;
        piece.clamp(self.dynamics.cycle);
        (piece.end, piece.tolerance) = match self.path {
            PathMode::ExactStop => (End::Stop, 0.0),
            PathMode::ExactPath => (End::Exact, 0.0),
            PathMode::Blend(tolerance) => (End::Overlap, tolerance),
        };
        if let Some(mut last) = self.last.take() {
            let rounding = join(&mut last, &mut piece, self.dynamics);
            let swallows = rounding.is_some_and(|r| r.swallows);
            if !swallows {
                self.close(&mut last, Some(&piece));
            }
            if let Some(r) = rounding {
                let shares = self.corner_shares(&last, &piece, swallows);
                self.legs.push(Leg {
                    length: r.length,
                    target: r.asked.min(r.most),
                    most: r.most.min(r.length / (SAMPLES * self.dynamics.cycle)),
                    acceleration: r.acceleration * 0.5,
                    end: End::Through,
                    kink: f64::INFINITY,
                    rapid: piece.rapid,
                    overlap: 0.0,
                    shares,
                });
            }
        }
        self.last = Some(piece);
    }

    /// A rounded corner belongs half to each of its moves; what it swallows belongs to its own.
    fn corner_shares(&mut self, a: &Piece, b: &Piece, swallows: bool) -> (usize, usize) {
        let (first, (from, count)) = (self.shares.len(), a.shares);
        if swallows {
            self.shares.extend_from_within(from..from + count);
        } else {
            self.shares.push((self.shares[from + count - 1].0, 1.0));
        }
        let weight: f64 = self.shares[first..].iter().map(|s| s.1).sum();
        self.shares.push((self.shares[b.shares.0].0, weight));
        (first, self.shares.len() - first)
    }

    /// A piece becomes a leg; the last one of a queue has no next.
    fn close(&mut self, piece: &mut Piece, next: Option<&Piece>) {
        let cycle = self.dynamics.cycle;
        let mut along = 1.0;
        if let Shape::Round(arc) = &piece.shape {
            along = 0.5;
            if next.is_some() {
                let (radius, total) = (bend(arc).max(1e-12), piece.overall());
                let across = piece.most * piece.most / radius;
                if across > total * NORMAL {
                    piece.most = libm::sqrt(total * NORMAL * radius);
                } else {
                    along = libm::sqrt(1.0 - across * across / (total * total));
                }
            }
        }
        let mut most = piece.most;
        if next.is_some() {
            piece.clamp(cycle);
            most = piece.most.min(piece.length / (SAMPLES * cycle));
        }
        let target = piece.asked.min(most);
        // The end of a queue may still be cut in half; what has a next one has its length.
        if let Some((before, leg, speed)) = self.braking.take().filter(|_| next.is_some()) {
            self.legs[leg].overlap = Overlap::of(&before, piece, [speed, target], [1.0, 1.0]).speed;
        }
        let mut overlap = 0.0;
        if let Some(b) = next.filter(|_| piece.end == End::Overlap) {
            overlap = Overlap::of(piece, b, [target, b.asked.min(b.most)], [1.0, 0.5]).speed;
            self.braking = Some((*piece, self.legs.len(), target));
        }
        self.legs.push(Leg {
            length: piece.length,
            target,
            most,
            acceleration: piece.overall() * along,
            end: piece.end,
            kink: piece.kink,
            rapid: piece.rapid,
            overlap,
            shares: piece.shares,
        });
    }

    /// Everything queued is driven to its end.
    fn drain(&mut self) {
        self.flush();
        if let Some(mut last) = self.last.take() {
            self.close(&mut last, None);
        }
        let (shares, seconds) = (&self.shares, &mut self.seconds);
        times(&self.legs, self.dynamics, |leg, time| {
            let entries = &shares[leg.shares.0..leg.shares.0 + leg.shares.1];
            let sum: f64 = entries.iter().map(|e| e.1).sum();
            for (operation, weight) in entries {
                seconds[*operation] += time * weight / sum;
            }
        });
        self.legs.clear();
        self.shares.clear();
    }
}

/// Cycles that a leg takes at least.
const SAMPLES: f64 = 1.02;

/// The speed that a program asks for.
fn asked(view: &View<'_, '_>, way: f64) -> f64 {
    let angular = matches!(length(&view.op, view.start, view.end), Length::Angular(_));
    let speed = speed(view.state, view, angular);
    let inverse = view.state.feed_mode == FeedMode::Inverse && view.state.sync.is_none();
    if inverse { way * speed } else { speed }
}
