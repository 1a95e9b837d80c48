//! Where on the machine a part is best put.

use crate::error::{Budget, Errors};
use crate::map::Probe;
use gr_machine::math::{V3, add, dot};

/// A place for the part and what it is worth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Found {
    /// Origin of the part in the base, mm.
    pub position: V3,
    /// How far the part may be moved any way along X, Y and Z and still be within reach, mm.
    pub margin: f64,
    /// The greatest error on the part (rule sum), mm; none = the machine file has no accuracy data.
    pub error: Option<f64>,
}

/// What is best.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Aim {
    /// The largest margin.
    Margin,
    /// The smallest error.
    Error,
}

/// What one tool does of a program.
pub struct Part<'a> {
    /// The machine with that tool.
    pub probe: Probe<'a>,
    /// Points of the tool, from the part's origin in the directions of the base, mm.
    pub points: Vec<V3>,
}

impl Part<'_> {
    fn fits(&self, points: &[V3], at: V3) -> bool {
        points.iter().all(|p| self.probe.reaches(add(at, *p)))
    }
}

/// Points of several tools.
#[derive(Clone)]
struct Points(Vec<Vec<V3>>);

impl Points {
    fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }
}

/// Whether all points are within reach when the part's origin is there.
fn fits(parts: &[Part<'_>], points: &Points, at: V3) -> bool {
    parts.iter().zip(&points.0).all(|(part, points)| part.fits(points, at))
}

/// The six ways along the axes.
fn shifted(at: V3, way: usize, by: f64) -> V3 {
    let mut out = at;
    out[way / 2] += if way.is_multiple_of(2) { by } else { -by };
    out
}

/// How far the part may be moved along all six directions, mm, to this fineness.
fn margin(parts: &[Part<'_>], points: &Points, at: V3, most: f64) -> f64 {
    let good = |d: f64| (0..6).all(|i| fits(parts, points, shifted(at, i, d)));
    let (mut low, mut high) = (0.0, most);
    for _ in 0..8 {
        let mid = (low + high) / 2.0;
        if good(mid) {
            low = mid;
        } else {
            high = mid;
        }
    }
    low
}

fn error(parts: &[Part<'_>], budget: &Budget, points: &Points, at: V3) -> Option<f64> {
    if budget.joints.is_none() && budget.geometry.is_none() {
        return None;
    }
    let mut most = 0.0f64;
    for (part, points) in parts.iter().zip(&points.0) {
        for p in points {
            let s = part.probe.sensitivity(add(at, *p), budget.geometry.is_some())?;
            most = most.max(Errors::new(&s, budget, None).sum());
        }
    }
    Some(most)
}

/// So many points of a part are looked for at first, and so many more each time some of the others are out of reach.
const FIRST: usize = 60;
const MORE: usize = 40;
/// So often the search is done anew with the points that the one before had left out.
const ROUNDS: usize = 40;

/// The best place of a part: looked for on a grid of the work space, then refined. The search goes by few points; at
/// what it finds every point is looked at, and those out of reach take part in the next search. None when the part fits
/// nowhere on the grid.
pub fn place(parts: &[Part<'_>], budget: &Budget, aim: Aim, progress: &dyn Fn(usize, usize)) -> Option<Found> {
    let all = Points(parts.iter().map(|p| p.points.clone()).collect());
    let mut few = Points(all.0.iter().map(|p| telling(p)).collect());
    let mut best = None;
    for _ in 0..ROUNDS {
        let found = search(parts, budget, &few, aim, progress)?;
        let more = |at: V3| Points(parts.iter().zip(&all.0).map(|(part, p)| spread(p, |p| !part.probe.reaches(add(at, *p)))).collect());
        let mut missing = more(found.position);
        if missing.len() == 0 {
            let free = margin(parts, &all, found.position, found.margin.max(1e-3));
            best = Some(Found { margin: free, error: error(parts, budget, &all, found.position), ..found });
            // The margin that the search went by may be that of the few points only.
            if free > 0.9 * found.margin {
                break;
            }
            for i in 0..6 {
                for (to, from) in missing.0.iter_mut().zip(more(shifted(found.position, i, found.margin * 0.95)).0) {
                    to.extend(from);
                }
            }
            if missing.len() == 0 {
                break;
            }
        } else {
            best = None;
        }
        for (to, from) in few.0.iter_mut().zip(missing.0) {
            to.extend(from);
        }
    }
    best
}

/// The points that stand out along the axes and across them, and some of the rest.
fn telling(points: &[V3]) -> Vec<V3> {
    let mut out = spread(points, |_| true);
    for way in 0..27 {
        let u = [way % 3, way / 3 % 3, way / 9].map(|v| f64::from(v) - 1.0);
        out.extend(points.iter().max_by(|a, b| dot(**a, u).total_cmp(&dot(**b, u))));
    }
    out
}

/// Up to so many of the points of a kind, evenly from first to last.
fn spread(points: &[V3], of: impl Fn(&V3) -> bool) -> Vec<V3> {
    let some: Vec<&V3> = points.iter().filter(|p| of(p)).collect();
    let most = if some.len() == points.len() { FIRST } else { MORE };
    let step = some.len().div_ceil(most).max(1);
    some.into_iter().step_by(step).copied().collect()
}

fn search(parts: &[Part<'_>], budget: &Budget, points: &Points, aim: Aim, progress: &dyn Fn(usize, usize)) -> Option<Found> {
    const GRID: usize = 24;
    let probe = &parts.first()?.probe;
    let extent = probe.extent();
    let span = extent.map(|(a, b)| (b - a).max(1.0));
    let low = [0, 1, 2].map(|i| points.0.iter().flatten().map(|p| p[i]).fold(f64::INFINITY, f64::min));
    let mut best: Option<(f64, Found)> = None;
    let consider = |best: &mut Option<(f64, Found)>, at: V3| {
        if !fits(parts, points, at) {
            return;
        }
        let error = if aim == Aim::Error { error(parts, budget, points, at) } else { None };
        let most = span[0].min(span[1]).min(span[2]) / 2.0;
        let freer = |d: f64| (0..6).all(|i| fits(parts, points, shifted(at, i, d)));
        let worth = match (error, *best) {
            (Some(e), _) => -e,
            // A place that can't be moved as far as the best one is not better.
            (None, Some((w, _))) if !freer(w + 1e-9) => return,
            _ => margin(parts, points, at, most),
        };
        if best.is_none_or(|(w, _)| worth > w + 1e-9) {
            let margin = if error.is_some() { margin(parts, points, at, most) } else { worth };
            *best = Some((worth, Found { position: at, margin, error }));
        }
    };
    for n in 0..GRID {
        for m in 0..GRID * GRID {
            let at = [n, m / GRID, m % GRID];
            let at = [0, 1, 2].map(|i| extent[i].0 + span[i] * (at[i] as f64 + 0.5) / GRID as f64 - low[i]);
            consider(&mut best, at);
        }
        progress(n + 1, GRID);
    }
    let mut step = span.map(|s| s / GRID as f64 / 2.0);
    for _ in 0..7 {
        let Some((_, around)) = best else { break };
        for i in 0..6 {
            consider(&mut best, shifted(around.position, i, step[i / 2]));
        }
        step = step.map(|s| s / 2.0);
    }
    best.map(|(_, f)| f)
}

/// A rectangle of stock.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rectangle {
    /// X from and to, mm.
    pub x: (f64, f64),
    /// Y of its middle, mm.
    pub middle: f64,
    /// Half its width, mm.
    pub half: f64,
}

/// The largest rectangle, symmetric about the middle of the reach in Y, whose every point is within reach at all heights
/// given. X on a grid of 10 mm, the width to 1 mm.
pub fn rectangle(probe: &Probe<'_>, heights: &[f64]) -> Option<Rectangle> {
    const STEP: f64 = 10.0;
    const FINE: i64 = 10;
    let extent = probe.extent();
    let first = libm::floor(extent[0].0 / STEP) as i64;
    let last = libm::ceil(extent[0].1 / STEP) as i64;
    let middle = libm::round((extent[1].0 + extent[1].1) * 5.0) / 10.0 + 0.0;
    let most = (extent[1].1 - extent[1].0) / 2.0 + 1.0;
    // Half width at each X between the grid lines too: the border is not straight.
    let wide = |x: f64| -> f64 {
        let mut y = 0.0;
        let reached = |y: f64| heights.iter().all(|z| probe.reaches([x, middle + y, *z]) && probe.reaches([x, middle - y, *z]));
        while y <= most && reached(y) {
            y += 1.0;
        }
        y - 1.0
    };
    let mut best: Option<(f64, (f64, f64, f64))> = None;
    let widths: Vec<f64> = (first * FINE..=last * FINE).map(|i| wide(i as f64 * STEP / FINE as f64)).collect();
    for i in (0..widths.len()).step_by(FINE as usize) {
        let mut half = f64::INFINITY;
        for k in i..widths.len() {
            half = half.min(widths[k]);
            if half <= 0.0 {
                break;
            }
            if (k - i) % FINE as usize == 0 && k > i {
                let at = |n: usize| (first * FINE + n as i64) as f64 * STEP / FINE as f64;
                let area = (at(k) - at(i)) * half;
                if best.is_none_or(|(a, _)| area > a) {
                    best = Some((area, (at(i), at(k), half)));
                }
            }
        }
    }
    best.map(|(_, (from, to, half))| Rectangle { x: (from, to), middle, half })
}
