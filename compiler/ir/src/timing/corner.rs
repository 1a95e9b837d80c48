//! How two pieces meet: the machine stands still between them, goes through because they nearly continue each other,
//! rounds the corner with an arc within the tolerance, or lets the second begin while the first is braking.

use super::Dynamics;
use super::piece::{End, NORMAL, Piece, Shape, V3, between, in_plane, tangent, trim, unit};
use crate::geometry::{ArcShape, cross, dot, norm, sub};
use std::f64::consts::{FRAC_PI_2, PI};

/// Angles below this are none, rad.
const NO_ANGLE: f64 = 1e-6;
/// Where the path turns back within this, rad, the machine stands still.
const SHARP: f64 = PI / 90.0;

/// The arc that rounds a corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounding {
    pub length: f64,
    pub asked: f64,
    pub most: f64,
    pub acceleration: f64,
    /// What was left of the piece before is so short that it is passed in one go with the arc.
    pub swallows: bool,
}

/// Settles how `a` ends and `b` begins; gives the arc between them if there is one.
pub(super) fn join(a: &mut Piece, b: &mut Piece, dynamics: &Dynamics) -> Option<Rounding> {
    if a.rapid != b.rapid || (b.bound && !a.bound) {
        a.end = End::Stop;
    }
    let plain = |p: &Piece| !matches!(p.shape, Shape::Other(_));
    if !dynamics.arcs || !plain(a) || !plain(b) || a.end == End::Stop {
        return None;
    }
    let (t1, t2) = (a.tangents()[1], b.tangents()[0]);
    let back: V3 = std::array::from_fn(|i| t1[i] + t2[i]);
    if dot(back, back) < SHARP * SHARP {
        a.end = End::Stop;
        return None;
    }
    if goes_through(a, b, sub(t2, t1), dynamics) || a.end == End::Exact {
        return None;
    }
    choose(a, b, dynamics)
}

/// A change of direction within one cycle is a jolt. Where it is a small share of what the axes can do, or for the
/// speed at which it is, the corner is passed as it is.
fn goes_through(a: &mut Piece, b: &mut Piece, turn: V3, dynamics: &Dynamics) -> bool {
    let speed = a.wanted(dynamics.overrides).min(b.wanted(dynamics.overrides));
    let jolt = speed / dynamics.cycle + b.acceleration;
    let mut share = (0..3).map(|i| (turn[i] * jolt / dynamics.acceleration[i]).abs()).fold(0.0, f64::max);
    if matches!(a.shape, Shape::Round(_)) || matches!(b.shape, Shape::Round(_)) {
        share /= 0.5;
    }
    let most = dynamics.kink.clamp(0.001, std::f64::consts::FRAC_1_SQRT_2);
    let through = share < most;
    a.kink = if through { speed } else { speed * most / share };
    a.kinked[1] = a.kinked[1].max(share.min(most));
    b.kinked[0] = b.kinked[0].max(share.min(most));
    if through {
        a.end = End::Through;
    }
    through
}

/// The fastest of the three ways.
fn choose(a: &mut Piece, b: &mut Piece, dynamics: &Dynamics) -> Option<Rounding> {
    let both = Overlap::of(a, b, [a.wanted(dynamics.overrides), b.wanted(dynamics.overrides)], [0.5, 0.5]);
    // Pieces that overlap share their acceleration, and are slower elsewhere too: their corner counts half.
    let (overlap, kink) = (both.along / 2.0, a.kink);
    let round = Corner::new(a, b, dynamics).and_then(|c| c.round());
    let arc = round.as_ref().map_or(0.0, |r| r.speed);
    if arc > overlap && arc > kink {
        let round = round?;
        unkink(a, b);
        (a.end, b.overlaps) = (End::Through, false);
        return Some(round.apply(a, b, dynamics));
    }
    if overlap >= kink {
        unkink(a, b);
        (a.end, b.overlaps) = (End::Overlap, true);
    } else {
        (a.end, b.overlaps) = (End::Through, false);
    }
    None
}

fn unkink(a: &mut Piece, b: &mut Piece) {
    a.kink = f64::INFINITY;
    (a.kinked[1], b.kinked[0]) = (0.0, 0.0);
}

/// The second piece begins when the first, braking, falls below a speed.
pub(super) struct Overlap {
    /// That speed.
    pub speed: f64,
    /// Speed along the path in between.
    pub along: f64,
}

impl Overlap {
    /// `targets`: speeds that are driven; `usable`: shares of the lengths that there are for it.
    pub fn of(a: &Piece, b: &Piece, targets: [f64; 2], usable: [f64; 2]) -> Overlap {
        let half = |p: &Piece| if matches!(p.shape, Shape::Round(_)) { p.overall() * 0.5 } else { p.overall() };
        let (pieces, acceleration) = ([a, b], [half(a), half(b)]);
        let reach: [f64; 2] =
            std::array::from_fn(|i| libm::sqrt(acceleration[i] * pieces[i].length * usable[i]).min(targets[i]));
        let longest = (a.length / reach[0]).min(b.length / reach[1]);
        let time = longest.min((reach[0] / acceleration[0]).max(reach[1] / acceleration[1]));
        let mut speed: [f64; 2] = std::array::from_fn(|i| reach[i].min(time * acceleration[i]));
        let (d1, d2) = (level(a, 1), begin(b));
        let corner = libm::acos((-dot(d1, d2)).clamp(-1.0, 1.0)) / 2.0;
        let (sin, cos) = libm::sincos(corner);
        // The path then misses the corner by a quarter of v²·cos/a.
        if a.tolerance > 0.0 && cos > 1e-3 {
            let within = 2.0 * libm::sqrt(acceleration[0] * a.tolerance / cos);
            speed = speed.map(|v| v.min(within));
        }
        Overlap { speed: speed[0], along: sin * (speed[0] + speed[1]) / 2.0 }
    }
}

/// Direction at the start or at the end of a piece; what a helix rises is left out.
fn level(p: &Piece, at: usize) -> V3 {
    match &p.shape {
        Shape::Round(arc) => tangent(&ArcShape { rise: 0.0, end_radius: arc.radius, ..*arc }, at as f64),
        _ => p.tangents()[at],
    }
}

/// Where the acceleration points at the start of a piece: on an arc also inwards.
fn begin(b: &Piece) -> V3 {
    let t = level(b, 0);
    let Shape::Round(arc) = &b.shape else { return t };
    let inwards = unit(sub(arc.center, arc.point(0.0)));
    let across = 0.25 * b.asked * b.asked / arc.radius.max(1e-12);
    unit(std::array::from_fn(|i| t[i] * b.overall() + inwards[i] * across))
}

/// One side of a corner, seen in the corner's plane.
#[derive(Clone, Copy)]
struct Side {
    /// Radius; none for a line.
    radius: Option<f64>,
    /// 1: bends to the inside of the corner, −1: to the outside.
    bend: f64,
    /// Greatest angle that may be cut off.
    most: f64,
    /// Way that may be used.
    room: f64,
}

impl Side {
    fn line(room: f64) -> Side {
        Side { radius: None, bend: 0.0, most: 0.0, room }
    }
    fn arc(a: &ArcShape, at: f64, inside: V3, share: f64, theta: f64) -> Side {
        let p = a.point(at);
        let center: V3 = std::array::from_fn(|i| a.center[i] + a.rise * at * a.normal[i]);
        let radius = norm(sub(center, p));
        let convex = dot(sub(center, p), inside) > 0.0;
        let most = (a.sweep.abs() * share).min(if convex { theta } else { FRAC_PI_2 });
        let room = if convex { libm::sin(most / 4.0) * radius } else { most * radius };
        Side { radius: Some(radius), bend: if convex { 1.0 } else { -1.0 }, most, room }
    }
    fn convex(&self) -> bool {
        self.bend > 0.0
    }
}

struct Corner {
    /// Angle by which the path turns.
    turn: f64,
    /// Half the angle between the legs, less where they bend inwards.
    theta: f64,
    sides: [Side; 2],
    tolerance: f64,
    acceleration: f64,
    goal: f64,
    asked: f64,
}

/// A corner and the arc planned for it.
struct Round {
    speed: f64,
    length: f64,
    asked: f64,
    acceleration: f64,
    cut: [f64; 2],
}

impl Corner {
    fn new(a: &Piece, b: &Piece, dynamics: &Dynamics) -> Option<Corner> {
        let (t1, t2) = (a.tangents()[1], b.tangents()[0]);
        let turn = between(t1, t2);
        let theta = (PI - turn) / 2.0;
        if turn / 2.0 < NO_ANGLE || theta < NO_ANGLE {
            return None;
        }
        let normal = unit(cross(t1, t2));
        let flat = |p: &Piece| match &p.shape {
            Shape::Round(arc) => norm(cross(arc.normal, normal)) < NO_ANGLE,
            _ => true,
        };
        if !flat(a) || !flat(b) {
            return None;
        }
        let first = match &a.shape {
            Shape::Round(arc) => Side::arc(arc, 1.0, cross(normal, t1), 2.0 / 3.0, theta),
            _ => Side::line(a.length.min(a.nominal / 2.0)),
        };
        let second = match &b.shape {
            Shape::Round(arc) => Side::arc(arc, 0.0, cross(normal, t2), 1.0 / 3.0, theta),
            _ => Side::line(b.length / 2.0),
        };
        let sides = [first, second];
        let sharpest = sides.iter().filter(|s| s.convex()).map(|s| theta - s.most / 4.0).fold(theta, f64::min);
        if sides.iter().all(|s| s.radius.is_some()) && sharpest < PI / 12.0 {
            return None;
        }
        let given = |p: &Piece| if p.tolerance == 0.0 { p.nominal * 0.25 } else { p.tolerance };
        let tolerance = given(a).min(given(b)).min(a.nominal * 0.25).min(b.nominal * 0.25);
        let goal = a.wanted(dynamics.overrides).max(b.wanted(dynamics.overrides));
        let axes = in_plane(normal, &dynamics.velocity);
        let lines = sides.iter().all(|s| s.radius.is_none());
        let goal = goal.min(if lines { axes.max(altitude(a.most, b.most, turn, sub, t1, t2)) } else { axes });
        let asked = a.wanted(1.0).max(b.wanted(1.0));
        let acceleration = in_plane(normal, &dynamics.acceleration);
        Some(Corner { turn, theta: sharpest, sides, tolerance, acceleration, goal, asked })
    }

    /// Radius and speed.
    fn plan(&self) -> Option<(f64, f64)> {
        let (sin, cos) = libm::sincos(self.theta);
        let tan = sin / cos;
        let within = cos * self.tolerance / (1.0 - sin);
        let room = self.sides[0].room.min(self.sides[1].room).min(within);
        let across = self.acceleration * NORMAL;
        let speed = libm::sqrt(across * tan * room).min(self.goal);
        // As much of the legs as an overlap of them would take.
        let along = self.acceleration * 0.5;
        let time = libm::sqrt(2.0 * along * room).min(speed) / along;
        let like = (time * speed / (PI - 2.0 * self.theta)).min(tan * room);
        let radius = (speed * speed / across).max(like);
        (radius > 1e-12 && radius * (PI - 2.0 * self.theta) > 1e-6).then_some((radius, speed))
    }

    fn round(&self) -> Option<Round> {
        let (radius, speed) = self.plan()?;
        let center = self.center(radius)?;
        let lines = self.sides.iter().all(|s| s.radius.is_none());
        if !lines && libm::hypot(center.0, center.1) - radius > self.tolerance {
            return None;
        }
        let directions = [(1.0, 0.0), (libm::cos(self.turn), libm::sin(self.turn))];
        let mut cut = [0.0; 2];
        let mut angle = self.turn;
        for (i, side) in self.sides.iter().enumerate() {
            let d = directions[i];
            let Some(r) = side.radius else {
                cut[i] = (center.0 * d.0 + center.1 * d.1).abs();
                continue;
            };
            let c = (-d.1 * side.bend * r, d.0 * side.bend * r);
            let to = (center.0 - c.0, center.1 - c.1);
            let cross = -c.0 * to.1 + c.1 * to.0;
            cut[i] = libm::atan2(cross.abs(), -c.0 * to.0 - c.1 * to.1);
            angle += side.bend * cut[i];
            if cut[i] > side.most {
                return None;
            }
        }
        let length = radius * angle;
        (angle > 0.0).then_some(Round { speed, length, asked: self.asked, acceleration: self.acceleration, cut })
    }

    /// Centre of a circle of this radius that touches both sides; the corner is at 0, the first side comes along x.
    fn center(&self, radius: f64) -> Option<(f64, f64)> {
        let d2 = (libm::cos(self.turn), libm::sin(self.turn));
        let n2 = (-d2.1, d2.0);
        let circle = |s: &Side, n: (f64, f64)| {
            let r = s.radius?;
            Some(((n.0 * s.bend * r, n.1 * s.bend * r), r - s.bend * radius))
        };
        match (circle(&self.sides[0], (0.0, 1.0)), circle(&self.sides[1], n2)) {
            (None, None) => Some((-radius / libm::tan(self.theta), radius)),
            (None, Some((c, d))) => nearest((0.0, radius), (1.0, 0.0), c, d),
            (Some((c, d)), None) => nearest((n2.0 * radius, n2.1 * radius), d2, c, d),
            (Some(a), Some(b)) => crossing(a, b),
        }
    }
}

/// The point of a line (through `p`, along `u`) at distance `d` from `c`, the one nearer to `p`.
fn nearest(p: (f64, f64), u: (f64, f64), c: (f64, f64), d: f64) -> Option<(f64, f64)> {
    let r = (p.0 - c.0, p.1 - c.1);
    let (b, q) = (r.0 * u.0 + r.1 * u.1, r.0 * r.0 + r.1 * r.1 - d * d);
    let root = b * b - q;
    if root < 0.0 {
        return None;
    }
    let root = libm::sqrt(root);
    let t = if (-b + root).abs() < (-b - root).abs() { -b + root } else { -b - root };
    Some((p.0 + u.0 * t, p.1 + u.1 * t))
}

/// Where two circles cross, the point nearer to 0.
fn crossing((a, ra): ((f64, f64), f64), (b, rb): ((f64, f64), f64)) -> Option<(f64, f64)> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let apart = libm::hypot(dx, dy);
    let x = (ra * ra - rb * rb + apart * apart) / (2.0 * apart);
    let y = ra * ra - x * x;
    if !(apart > 0.0 && y >= 0.0) {
        return None;
    }
    let (u, y) = ((dx / apart, dy / apart), libm::sqrt(y));
    let at = |y: f64| (a.0 + u.0 * x - u.1 * y, a.1 + u.1 * x + u.0 * y);
    let (p, q) = (at(y), at(-y));
    Some(if libm::hypot(p.0, p.1) < libm::hypot(q.0, q.1) { p } else { q })
}

/// Greatest speed between two lines whose own speeds differ: the height of the triangle of both velocities.
fn altitude(first: f64, second: f64, turn: f64, minus: fn(V3, V3) -> V3, t1: V3, t2: V3) -> f64 {
    let cos = libm::cos(turn.min(PI * 0.49));
    let (v1, v2) = (first.min(second / cos), second.min(first / cos));
    let base = norm(minus(t2.map(|c| c * v2), t1.map(|c| c * v1)));
    v1 * v2 * libm::sin(turn) / base
}

impl Round {
    /// Shortens both pieces.
    fn apply(&self, a: &mut Piece, b: &mut Piece, dynamics: &Dynamics) -> Rounding {
        let left = a.length - self.cut[0];
        let short = left / self.speed < dynamics.gap * dynamics.cycle;
        let swallows = short && matches!(a.shape, Shape::Line(_)) && !a.overlaps;
        shorten(a, 0.0, self.cut[0]);
        shorten(b, self.cut[1], 0.0);
        let length = if swallows { self.length + left.max(0.0) } else { self.length };
        let most = self.speed.min(length / dynamics.cycle);
        Rounding { length, asked: self.asked, most, acceleration: self.acceleration, swallows }
    }
}

fn shorten(p: &mut Piece, start: f64, end: f64) {
    match &mut p.shape {
        Shape::Round(arc) => {
            *arc = trim(arc, start, end);
            p.length = arc.length();
        }
        _ => p.length = (p.length - start - end).max(1e-9),
    }
}

