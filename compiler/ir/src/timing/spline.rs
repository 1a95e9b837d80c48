//! Splines as the controller drives them: as pairs of arcs that touch each other (biarcs), by which the planner sees many
//! short moves with curvatures of their own and not one curve.

use crate::geometry::{between, nurbs_point};
use crate::op::{Arc, ArcPlane, Pose};
use crate::{Op, Plane, View};

/// Pairs of arcs for every control point, at even steps of the parameter.
const PAIRS: usize = 4;
/// The direction of the curve is that between two points so far before and behind, in knot spans.
const BESIDE: f64 = 1e-5;
/// A triangle of start, end and direction with less than a quarter of this, mm², makes a line of an arc.
const FLAT: f64 = 1e-6;
/// An arc that turns by less than this, rad, is lost in rounding.
const NO_TURN: f64 = 1e-9;

type Point = [f64; 2];

/// Gives the moves of the planner that a move of the program is: those of a spline, or the move itself.
pub(super) fn stretches(view: &View<'_, '_>, mut to: impl FnMut(&View<'_, '_>)) {
    let Op::Nurbs { order, points } = view.op else { return to(view) };
    let count = points.len() / 3;
    let spans = (count + 1).saturating_sub(order as usize).max(1) as f64;
    let station = |share: f64| {
        let beside = [share - BESIDE / spans, share + BESIDE / spans].map(|s| nurbs_point(order, points, s));
        let [Some(before), Some(behind)] = beside else { return None };
        Some((nurbs_point(order, points, share)?, unit(minus(behind, before))))
    };
    let mut here = *view.start;
    let mut go = |op: Op<'_>, end: Pose| {
        to(&View { op, start: &here, end: &end, ..*view });
        here = end;
    };
    let (mut last, pairs) = (station(0.0), count * PAIRS);
    for i in 1..=pairs {
        let at = |i: f64| i / pairs as f64;
        let next = station(at(i as f64));
        let (Some((a, leave)), Some((b, arrive))) = (last, next) else { continue };
        let pose = |p: Point, share: f64| {
            let z = view.start.axes[2] + (view.end.axes[2] - view.start.axes[2]) * share;
            Pose::at(between(view.start, view.end, share, [p[0], p[1], z]))
        };
        let end = if i == pairs { *view.end } else { pose(b, at(i as f64)) };
        match meeting(a, leave, b, arrive) {
            Some((middle, direction)) => {
                go(round(a, leave, middle), pose(middle, at(i as f64 - 0.5)));
                go(round(middle, direction, b), end);
            }
            None => go(Op::Linear, end),
        }
        last = next;
    }
}

/// Where two arcs meet that lead from `a`, left along `leave`, to `b`, reached along `arrive`, and their direction there.
/// Of all such pairs the one whose tangents from `a` and `b` to those of the meeting point are equally long.
fn meeting(a: Point, leave: Point, b: Point, arrive: Point) -> Option<(Point, Point)> {
    // The ends of tangents of length t are 2 t apart: |way − t (leave + arrive)| = 2 t.
    let way = minus(b, a);
    let (square, forwards) = (dot(way, way), dot(way, leave) + dot(way, arrive));
    let turned = (2.0 - 2.0 * dot(leave, arrive)).max(0.0);
    let t = square / (forwards + libm::sqrt(forwards * forwards + turned * square));
    if !t.is_finite() || t <= 0.0 {
        return None;
    }
    let (first, second) = (plus(a, leave, t), plus(b, arrive, -t));
    Some((plus(first, minus(second, first), 0.5), unit(minus(second, first))))
}

/// The arc that leaves `from` along `direction` and ends in `to`.
fn round(from: Point, direction: Point, to: Point) -> Op<'static> {
    let way = minus(to, from);
    let left = 2.0 * (direction[0] * way[1] - direction[1] * way[0]);
    if left.abs() <= FLAT.max(NO_TURN * libm::sqrt(dot(way, way))) {
        return Op::Linear;
    }
    let center = plus(from, [-direction[1], direction[0]], dot(way, way) / left);
    let turns = if left > 0.0 { 1 } else { -1 };
    Op::Arc(Arc { plane: ArcPlane::Work(Plane::Xy), center: [center[0], center[1], 0.0], turns })
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}
fn plus(a: Point, d: Point, t: f64) -> Point {
    [a[0] + d[0] * t, a[1] + d[1] * t]
}
fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
fn unit(v: Point) -> Point {
    let l = libm::hypot(v[0], v[1]);
    if l > 0.0 { v.map(|c| c / l) } else { v }
}
