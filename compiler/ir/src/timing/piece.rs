//! What the controller plans with: one stretch of the path, in the machine frame, with the limits that its axes set.

use super::Dynamics;
use crate::geometry::{ArcShape, cross, dot, norm, sub};
use crate::op::{Arc, ArcPlane};
use crate::{Axes, Op, State};

/// A direction or a point of X Y Z.
pub(super) type V3 = [f64; 3];

pub(super) fn along(p: V3, d: V3, t: f64) -> V3 {
    std::array::from_fn(|i| p[i] + d[i] * t)
}
pub(super) fn unit(v: V3) -> V3 {
    let l = norm(v);
    if l > 0.0 { v.map(|c| c / l) } else { [0.0; 3] }
}

/// What the path looks like.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// A straight line of X Y Z alone: its direction.
    Line(V3),
    /// An arc or helix of X Y Z alone.
    Round(ArcShape),
    /// Anything else: it is joined to nothing. The directions are for judging corners.
    Other(V3),
}

/// One stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub shape: Shape,
    /// mm, or rad when only rotary axes move.
    pub length: f64,
    /// Length before corners were rounded.
    pub nominal: f64,
    /// What is asked for.
    pub asked: f64,
    /// What the axes allow.
    pub most: f64,
    /// What the axes allow along the path.
    pub acceleration: f64,
    /// A traverse.
    pub rapid: bool,
    /// Follows a spindle's angle.
    pub bound: bool,
    /// Corner tolerance; 0 = none given.
    pub tolerance: f64,
    /// How it ends as far as the program says.
    pub end: End,
    /// Speed at the corner after it, as far as it is only a kink.
    pub kink: f64,
    /// Shares of the acceleration that the corners before and after need.
    pub kinked: [f64; 2],
    /// Begins while the one before is still braking.
    pub overlaps: bool,
    /// First and number of the entries that share its time.
    pub shares: (usize, usize),
}

/// How a piece ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum End {
    /// Stands still.
    Stop,
    /// G61: stands still unless the next one goes on in the same direction.
    Exact,
    /// The next one begins while this one brakes.
    Overlap,
    /// Goes on without standing still.
    Through,
}

impl Piece {
    /// What may be expected of it when the operator turns the feed up to `factor`.
    pub fn wanted(&self, factor: f64) -> f64 {
        if self.bound { self.most } else { (self.asked * factor).min(self.most) }
    }

    /// Acceleration that is left beside what corners need. Pieces that overlap share it between them.
    pub fn overall(&self) -> f64 {
        let left = self.acceleration * (1.0 - self.kinked[0].max(self.kinked[1]));
        if self.overlaps || self.end == End::Overlap { left * 0.5 } else { left }
    }

    /// Direction at its start and at its end.
    pub fn tangents(&self) -> [V3; 2] {
        match &self.shape {
            Shape::Line(d) | Shape::Other(d) => [*d, *d],
            Shape::Round(a) => [tangent(a, 0.0), tangent(a, 1.0)],
        }
    }

    /// Nothing is passed faster than a piece per cycle.
    pub fn clamp(&mut self, cycle: f64) {
        self.most = self.most.min(self.length / cycle);
    }
}

/// Direction of travel at a share of an arc.
pub(super) fn tangent(a: &ArcShape, share: f64) -> V3 {
    let (s, c) = libm::sincos(a.angle + a.sweep * share);
    let sweep = a.sweep.abs().max(1e-12);
    let r = a.radius + (a.end_radius - a.radius) * share;
    let (sign, out, rise) = (a.sweep.signum() * r, (a.end_radius - a.radius) / sweep, a.rise / sweep);
    unit(std::array::from_fn(|i| {
        sign * (c * a.v[i] - s * a.u[i]) + out * (c * a.u[i] + s * a.v[i]) + rise * a.normal[i]
    }))
}

/// Radius of the path's curvature where it is bent most.
pub(super) fn bend(a: &ArcShape) -> f64 {
    let sweep = a.sweep.abs().max(1e-12);
    let (out, rise) = ((a.end_radius - a.radius) / sweep, a.rise);
    let square = a.radius * a.radius + out * out;
    let flat = square * libm::sqrt(square) / (square + out * out);
    flat + rise * rise / (sweep * sweep) / flat.max(1e-12)
}

/// The arc without a part of its start and its end, rad.
pub(super) fn trim(a: &ArcShape, start: f64, end: f64) -> ArcShape {
    let sweep = a.sweep.abs().max(1e-12);
    let (first, last) = (start / sweep, 1.0 - end / sweep);
    let radius = |share: f64| a.radius + (a.end_radius - a.radius) * share;
    ArcShape {
        center: along(a.center, a.normal, a.rise * first),
        radius: radius(first),
        end_radius: radius(last),
        angle: a.angle + a.sweep * first,
        sweep: a.sweep * (last - first),
        rise: a.rise * (last - first),
        ..*a
    }
}

/// Makes pieces from ends in the machine frame.
pub(super) struct Maker<'a> {
    pub dynamics: &'a Dynamics,
}

impl Maker<'_> {
    /// A straight move; nothing when it goes nowhere.
    pub fn line(&self, from: &Axes, to: &Axes) -> Option<Piece> {
        let d: Axes = std::array::from_fn(|i| if (to[i] - from[i]).abs() < 1e-8 { 0.0 } else { to[i] - from[i] });
        let [xyz, abc, uvw] = [0, 3, 6].map(|i| norm([d[i], d[i + 1], d[i + 2]]));
        let length = [xyz, uvw, abc].into_iter().find(|l| *l > 0.0)?;
        let slowest = |limit: &Axes| (0..9).map(|i| d[i].abs() / limit[i]).fold(0.0, f64::max);
        let most = length / slowest(&self.dynamics.velocity);
        let plain = uvw == 0.0 && abc == 0.0;
        let direction = unit([d[0], d[1], d[2]]);
        let shape = if plain { Shape::Line(direction) } else { Shape::Other(direction) };
        let tip = if xyz > 0.0 || uvw > 0.0 { self.dynamics.tip } else { f64::INFINITY };
        self.piece(shape, length, most.min(tip), length / slowest(&self.dynamics.acceleration))
    }

    /// An arc of a program, in the work frame of `state`.
    pub fn arc(&self, arc: &Arc, shape: &ArcShape, from: &Axes, to: &Axes, state: &State) -> Option<Piece> {
        let place = |p: V3| {
            let m = state.machine(&[p[0], p[1], p[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            [m[0], m[1], m[2]]
        };
        let turn = |v: V3| state.machine_direction(v);
        let shape = ArcShape { center: place(shape.center), u: turn(shape.u), v: turn(shape.v), normal: turn(shape.normal), ..*shape };
        let smallest = |limit: &Axes| match arc.plane {
            ArcPlane::Work(plane) if state.rotation == 0.0 || plane == crate::Plane::Xy => {
                let (first, second, _) = crate::state::plane_axes(plane);
                limit[first].min(limit[second])
            }
            _ => limit[0].min(limit[1]).min(limit[2]),
        };
        let (speed, acceleration) = (smallest(&self.dynamics.velocity), smallest(&self.dynamics.acceleration));
        let (radius, sweep) = (shape.radius.min(shape.end_radius), shape.sweep.abs());
        let spiral = shape.end_radius - shape.radius;
        let flat = libm::hypot(radius * sweep, spiral);
        let total = libm::hypot(flat, shape.rise);
        let curve = libm::hypot(radius, spiral / sweep.max(1e-12));
        let in_plane = speed.min(libm::sqrt(acceleration * NORMAL * curve));
        let others = |limit: &Axes| (0..9).map(|i| (to[i] - from[i]).abs() / limit[i]).fold(0.0, f64::max);
        let most = total / (flat / in_plane).max(others(&self.dynamics.velocity));
        let acceleration = total / (flat / acceleration).max(others(&self.dynamics.acceleration));
        let plain = (3..9).all(|i| to[i] == from[i]);
        let kind = if plain { Shape::Round(shape) } else { Shape::Other(tangent(&shape, 1.0)) };
        self.piece(kind, shape.length(), most.min(self.dynamics.tip), acceleration)
    }

    fn piece(&self, shape: Shape, length: f64, most: f64, acceleration: f64) -> Option<Piece> {
        let good = length > 1e-12 && length.is_finite() && most > 0.0 && acceleration > 0.0;
        let piece = Piece {
            shape,
            length,
            nominal: length,
            asked: most,
            most,
            acceleration,
            rapid: false,
            bound: false,
            tolerance: 0.0,
            end: End::Stop,
            kink: f64::INFINITY,
            kinked: [0.0; 2],
            overlaps: false,
            shares: (0, 0),
        };
        good.then_some(piece)
    }
}

/// Share of the acceleration that may go across the path in a curve, √3/2; the other half goes along it.
pub(super) const NORMAL: f64 = 0.866_025_403_784_438_6;

/// The least acceleration (or speed) that a circle in this plane needs of the axes.
pub(super) fn in_plane(normal: V3, limit: &Axes) -> f64 {
    let share = |i: usize| libm::sqrt((1.0 - normal[i] * normal[i]).max(0.0)).max(1e-12);
    (0..3).map(|i| limit[i] / share(i)).fold(f64::INFINITY, f64::min)
}

/// Angle between two directions, rad.
pub(super) fn between(a: V3, b: V3) -> f64 {
    libm::atan2(norm(cross(a, b)), dot(a, b))
}

/// How far a point is from the line between two others.
pub(super) fn off_line(p: V3, a: V3, b: V3) -> f64 {
    let (d, r) = (sub(b, a), sub(p, a));
    let share = (dot(d, r) / dot(d, d)).clamp(0.0, 1.0);
    norm(sub(r, d.map(|v| v * share)))
}

/// Whether an operation waits until all motion is done.
pub(super) fn drains(op: &Op<'_>) -> bool {
    use crate::{Note, Override};
    match op {
        Op::Dwell(_) | Op::Probe(_) | Op::ProbeMode(_) | Op::RigidTap { .. } | Op::ToolChangeStart | Op::ToolChange(_) => true,
        Op::SpindleSpeed { .. } | Op::SpindleTurn { .. } | Op::SpindleOrient { .. } | Op::SpindleWait { .. } => true,
        Op::Mist(_) | Op::Flood(_) | Op::ToolReload | Op::ToolOffset { .. } | Op::ToolEntry { .. } => true,
        Op::WorkOffset(..) | Op::LocalOffset(_) | Op::Rotation(_) | Op::Override(Override::Adaptive, _) => true,
        Op::DigitalOut { synced, .. } | Op::AnalogOut { synced, .. } => !synced,
        Op::InputWait { .. } | Op::UserM { .. } | Op::Stop(_) | Op::IndexerLock(..) | Op::Note(Note::Message, _) | Op::End => true,
        _ => false,
    }
}
