//! Shapes of moves: arcs and helices resolved, NURBS points, exact boxes, points within a tolerance.

use crate::op::{Arc, ArcPlane, Pose};
use crate::state::plane_axes;
use crate::{Axes, Op};
use std::f64::consts::{PI, TAU};

/// Below this angle (rad) an arc back to its start is a full circle.
const MIN_ANGLE: f64 = 1e-12;
/// No curve is cut into more pieces than this.
const MAX_PIECES: f64 = 1e6;

/// An arc with everything known.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ArcShape {
    /// Centre, at the height of the start.
    pub center: [f64; 3],
    /// Unit vectors of the plane; `v` is a quarter turn after `u`.
    pub u: [f64; 3],
    /// See `u`.
    pub v: [f64; 3],
    /// Unit normal.
    pub normal: [f64; 3],
    /// Radius at the start.
    pub radius: f64,
    /// Radius at the end (the controller allows a small difference).
    pub end_radius: f64,
    /// Angle of the start from `u`, rad.
    pub angle: f64,
    /// Angle travelled, rad; < 0 clockwise.
    pub sweep: f64,
    /// Travel along the normal.
    pub rise: f64,
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
pub(crate) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
pub(crate) fn norm(a: [f64; 3]) -> f64 {
    libm::sqrt(dot(a, a))
}
fn unit(i: usize) -> [f64; 3] {
    let mut v = [0.0; 3];
    v[i] = 1.0;
    v
}

impl ArcShape {
    /// Resolves an arc between two poses.
    pub fn new(arc: &Arc, start: &Pose, end: &Pose) -> ArcShape {
        let (from, to) = (start.xyz(), end.xyz());
        let (u, v, normal, center) = match arc.plane {
            ArcPlane::Work(plane) => {
                let (first, second, third) = plane_axes(plane);
                let mut center = arc.center;
                center[third] = from[third];
                (unit(first), unit(second), unit(third), center)
            }
            ArcPlane::Free(normal) => free_basis(arc.center, normal, from),
        };
        let (a, b) = (sub(from, center), sub(to, center));
        let (a, b2, rise) = ((dot(a, u), dot(a, v)), (dot(b, u), dot(b, v)), dot(sub(to, from), normal));
        let angle = libm::atan2(a.1, a.0);
        let sweep = sweep(angle, libm::atan2(b2.1, b2.0), arc.turns);
        let (radius, end_radius) = (libm::hypot(a.0, a.1), libm::hypot(b2.0, b2.1));
        ArcShape { center, u, v, normal, radius, end_radius, angle, sweep, rise }
    }

    /// Length of the path.
    pub fn length(&self) -> f64 {
        libm::hypot(self.sweep * (self.radius + self.end_radius) / 2.0, self.rise)
    }

    /// The point at a share (0 … 1) of the way.
    pub fn point(&self, share: f64) -> [f64; 3] {
        let (s, c) = libm::sincos(self.angle + self.sweep * share);
        let r = self.radius + (self.end_radius - self.radius) * share;
        std::array::from_fn(|i| {
            self.center[i] + r * (c * self.u[i] + s * self.v[i]) + self.rise * share * self.normal[i]
        })
    }

    /// Into how many chords the arc must be cut so that none is farther than `tolerance` from it.
    pub fn pieces(&self, tolerance: f64) -> usize {
        let radius = self.radius.max(self.end_radius);
        let ratio = (1.0 - tolerance / radius).clamp(-1.0, 1.0);
        let step = (2.0 * libm::acos(ratio)).clamp(1e-6, PI / 2.0);
        let pieces = libm::ceil(self.sweep.abs() / step).clamp(1.0, MAX_PIECES);
        // Clamped above, and NaN casts to 0.
        (pieces as usize).max(1)
    }

    /// Shares of the way where a coordinate is extreme.
    fn extremes(&self, i: usize) -> [Option<f64>; 4] {
        let turn = self.sweep.signum();
        let amplitude = self.radius * libm::hypot(self.u[i], self.v[i]);
        let slope = if self.sweep == 0.0 { 0.0 } else { self.rise * self.normal[i] / self.sweep };
        if amplitude == 0.0 || slope.abs() > amplitude || self.sweep == 0.0 {
            return [None; 4];
        }
        // d/dt (u cos t + v sin t) = |uv| cos(t + phase)
        let phase = libm::atan2(self.u[i], self.v[i]);
        let half = libm::acos(-slope / amplitude);
        let mut found = [None; 4];
        for (k, root) in [-phase + half, -phase - half].into_iter().enumerate() {
            // The first time the root comes up after the start, and the last time before the end.
            let first = wrap(turn * (root - self.angle));
            let span = self.sweep.abs();
            if first <= span {
                let last = first + libm::floor((span - first) / TAU) * TAU;
                found[2 * k] = Some(first / span);
                found[2 * k + 1] = Some(last / span);
            }
        }
        found
    }
}

/// Into 0 … 2π.
fn wrap(angle: f64) -> f64 {
    let a = libm::fmod(angle, TAU);
    if a < 0.0 { a + TAU } else { a }
}

fn free_basis(center: [f64; 3], normal: [f64; 3], from: [f64; 3]) -> ([f64; 3], [f64; 3], [f64; 3], [f64; 3]) {
    let length = norm(normal);
    let n = if length > 0.0 { normal.map(|v| v / length) } else { unit(2) };
    let height = dot(sub(from, center), n);
    let center: [f64; 3] = std::array::from_fn(|i| center[i] + height * n[i]);
    let radial = sub(from, center);
    let r = norm(radial);
    let u = if r > 0.0 { radial.map(|v| v / r) } else { any_across(n) };
    (u, cross(n, u), n, center)
}

fn any_across(n: [f64; 3]) -> [f64; 3] {
    let helper = if n[0].abs() < 0.9 { unit(0) } else { unit(1) };
    let c = cross(n, helper);
    let l = norm(c);
    c.map(|v| v / l)
}

fn sweep(from: f64, to: f64, turns: i32) -> f64 {
    let full = f64::from(turns.unsigned_abs().saturating_sub(1)) * TAU;
    let mut angle = if turns < 0 { from - to } else { to - from };
    if angle < MIN_ANGLE {
        angle += TAU;
    }
    if angle < MIN_ANGLE {
        angle += TAU;
    }
    (angle + full) * if turns < 0 { -1.0 } else { 1.0 }
}

/// The point of a NURBS (clamped, uniform knots) at a share (0 … 1) of its parameter range.
pub fn nurbs_point(order: u32, points: &[f64], share: f64) -> Option<[f64; 2]> {
    let (points, _) = points.as_chunks::<3>();
    let k = (order as usize).min(points.len());
    let spans = (points.len() + 1).checked_sub(k)?;
    let t = share.clamp(0.0, 1.0) * spans as f64;
    let span = (libm::floor(t) as usize).min(spans - 1);
    de_boor(k, points, span, t, |i| (i.saturating_sub(k - 1)).min(spans) as f64)
}

/// The point of a NURBS with knots of its own, as many as points and order together, at a share of its parameter
/// range (from the last of the first `order` knots to the first of the last `order`).
pub fn knotted_point(order: u32, points: &[f64], knots: &[f64], share: f64) -> Option<[f64; 2]> {
    let (points, _) = points.as_chunks::<3>();
    let k = order as usize;
    if k == 0 || points.len() < k || knots.len() < points.len() + k {
        return None;
    }
    let (low, high) = (knots[k - 1], knots[points.len()]);
    let t = low + (high - low) * share.clamp(0.0, 1.0);
    let span = (0..=points.len() - k).rev().find(|s| knots[s + k - 1] <= t && knots[s + k - 1] < high)?;
    de_boor(k, points, span, t, |i| knots[i])
}

/// The highest order (degree + 1) of a spline that is evaluated; the interpreter refuses programs that ask for more.
pub const MAX_ORDER: usize = 64;

/// The point at parameter `t`, which lies in the span that the points from `span` on shape.
fn de_boor(k: usize, points: &[[f64; 3]], span: usize, t: f64, knot: impl Fn(usize) -> f64) -> Option<[f64; 2]> {
    if k == 0 || k > MAX_ORDER {
        return None;
    }
    let mut d = [[0.0; 3]; MAX_ORDER];
    for (j, slot) in d.iter_mut().enumerate().take(k) {
        let [x, y, w] = *points.get(span + j)?;
        *slot = [x * w, y * w, w];
    }
    for r in 1..k {
        for j in (r..k).rev() {
            let i = span + j;
            let (low, high) = (knot(i), knot(i + k - r));
            let a = if high > low { (t - low) / (high - low) } else { 0.0 };
            d[j] = std::array::from_fn(|c| (1.0 - a) * d[j - 1][c] + a * d[j][c]);
        }
    }
    let [x, y, w] = d[k - 1];
    (w != 0.0).then(|| [x / w, y / w])
}

fn nurbs_pieces(points: &[f64], tolerance: f64) -> usize {
    let (points, _) = points.as_chunks::<3>();
    let polygon: f64 = points.windows(2).map(|p| libm::hypot(p[1][0] - p[0][0], p[1][1] - p[0][1])).sum();
    // A curve of length L bent by at most its polygon: chords of √(8·tolerance·L) keep the tolerance for
    // radii from L up; four times as many cover sharper bends.
    let chord = libm::sqrt(8.0 * tolerance.max(1e-9) * polygon.max(1e-9)) / 4.0;
    let pieces = libm::ceil(polygon / chord).max(points.len() as f64 * 4.0).min(MAX_PIECES);
    (pieces as usize).max(4)
}

/// Gives the points of a move after its start, the last one the end itself, so that no chord is farther
/// than `tolerance` (mm) from the path. Nothing for operations that do not move.
pub fn flatten(op: &Op<'_>, start: &Pose, end: &Pose, tolerance: f64, mut to: impl FnMut(&Axes)) {
    let tolerance = tolerance.max(1e-9);
    match op {
        Op::Arc(arc) => {
            let shape = ArcShape::new(arc, start, end);
            let pieces = shape.pieces(tolerance);
            for i in 1..pieces {
                let share = i as f64 / pieces as f64;
                to(&between(start, end, share, shape.point(share)));
            }
            to(&end.axes);
        }
        Op::Nurbs { order, points } => {
            let pieces = nurbs_pieces(points, tolerance);
            for i in 1..pieces {
                let share = i as f64 / pieces as f64;
                if let Some([x, y]) = nurbs_point(*order, points, share) {
                    let z = start.axes[2] + (end.axes[2] - start.axes[2]) * share;
                    to(&between(start, end, share, [x, y, z]));
                }
            }
            to(&end.axes);
        }
        Op::RigidTap { bottom, .. } => {
            to(&between(start, start, 0.0, *bottom));
            to(&start.axes);
        }
        op if op.moves() => to(&end.axes),
        _ => {}
    }
}

pub(crate) fn between(start: &Pose, end: &Pose, share: f64, xyz: [f64; 3]) -> Axes {
    std::array::from_fn(|i| match xyz.get(i) {
        Some(v) => *v,
        None => start.axes[i] + (end.axes[i] - start.axes[i]) * share,
    })
}

/// Smallest and largest coordinates of X Y Z.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Extent {
    /// Smallest.
    pub min: [f64; 3],
    /// Largest.
    pub max: [f64; 3],
}

impl Default for Extent {
    fn default() -> Extent {
        Extent { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] }
    }
}

impl Extent {
    /// Whether nothing has been added.
    pub fn is_empty(&self) -> bool {
        !(0..3).any(|i| self.min[i] <= self.max[i])
    }
    /// Adds a point.
    pub fn add(&mut self, p: [f64; 3]) {
        for (i, v) in p.into_iter().enumerate() {
            self.min[i] = self.min[i].min(v);
            self.max[i] = self.max[i].max(v);
        }
    }
    /// Adds another.
    pub fn join(&mut self, other: &Extent) {
        for i in 0..3 {
            self.min[i] = self.min[i].min(other.min[i]);
            self.max[i] = self.max[i].max(other.max[i]);
        }
    }
    /// Max − min, 0 when empty.
    pub fn size(&self) -> [f64; 3] {
        std::array::from_fn(|i| (self.max[i] - self.min[i]).max(0.0))
    }
    /// Adds a move: start, end, and what lies between (arcs exactly, NURBS within 1 µm).
    pub fn add_move(&mut self, op: &Op<'_>, start: &Pose, end: &Pose) {
        match op {
            Op::Arc(arc) => {
                self.add(start.xyz());
                self.add(end.xyz());
                let shape = ArcShape::new(arc, start, end);
                for i in 0..3 {
                    for share in shape.extremes(i).into_iter().flatten() {
                        let v = shape.point(share)[i];
                        self.min[i] = self.min[i].min(v);
                        self.max[i] = self.max[i].max(v);
                    }
                }
            }
            op if op.moves() || matches!(op, Op::RigidTap { .. }) => {
                self.add(start.xyz());
                flatten(op, start, end, 1e-3, |p| self.add([p[0], p[1], p[2]]));
            }
            _ => {}
        }
    }
}

/// Length of a move: of X Y Z if they move, else of U V W (mm), else of A B C (rad).
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Length {
    /// mm.
    Linear(f64),
    /// rad.
    Angular(f64),
}

/// How far a move goes.
pub fn length(op: &Op<'_>, start: &Pose, end: &Pose) -> Length {
    match op {
        Op::Arc(arc) => {
            let shape = ArcShape::new(arc, start, end);
            Length::Linear(shape.length())
        }
        Op::Nurbs { .. } => {
            let (mut sum, mut last) = (0.0, start.xyz());
            flatten(op, start, end, 1e-4, |p| {
                let here = [p[0], p[1], p[2]];
                sum += norm(sub(here, last));
                last = here;
            });
            Length::Linear(sum)
        }
        Op::RigidTap { bottom, .. } => Length::Linear(2.0 * norm(sub(*bottom, start.xyz()))),
        op if op.moves() => straight(start, end),
        _ => Length::Linear(0.0),
    }
}

/// Beside a rotary move, mm that offsets and units leave by rounding are none.
const DUST: f64 = 1e-7;

fn straight(start: &Pose, end: &Pose) -> Length {
    let d = |i: usize| end.axes[i] - start.axes[i];
    let abc = norm([d(3), d(4), d(5)]);
    let least = if abc > 0.0 { DUST } else { 0.0 };
    let xyz = norm([d(0), d(1), d(2)]);
    if xyz > least {
        return Length::Linear(xyz);
    }
    let uvw = norm([d(6), d(7), d(8)]);
    if uvw > least {
        return Length::Linear(uvw);
    }
    if abc > 0.0 { Length::Angular(abc) } else { Length::Linear(0.0) }
}
