//! Where on the machine a part is best put.

use crate::error::{Budget, Errors};
use crate::map::Probe;
use gr_machine::math::{V3, add};

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

/// Whether all points are within reach when the part's origin is there.
fn fits(probe: &Probe<'_>, points: &[V3], at: V3) -> bool {
    points.iter().all(|p| probe.reaches(add(at, *p)))
}

/// How far the part may be moved along all six directions, mm, to this fineness.
fn margin(probe: &Probe<'_>, points: &[V3], at: V3, most: f64) -> f64 {
    let good = |d: f64| {
        (0..6).all(|i| {
            let mut q = at;
            q[i / 2] += if i % 2 == 0 { d } else { -d };
            fits(probe, points, q)
        })
    };
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

fn error(probe: &Probe<'_>, budget: &Budget, points: &[V3], at: V3) -> Option<f64> {
    if budget.joints.is_none() && budget.geometry.is_none() {
        return None;
    }
    let one = |p: &V3| {
        probe.sensitivity(add(at, *p), budget.geometry.is_some()).map(|s| Errors::new(&s, budget, None).sum())
    };
    points.iter().map(one).try_fold(0.0f64, |m, e| e.map(|e| m.max(e)))
}

/// The best place of a part that is the hull of some points (part frame, mm): looked for on a grid of the work space,
/// then refined. None when the part fits nowhere on the grid.
pub fn place(
    probe: &Probe<'_>,
    budget: &Budget,
    points: &[V3],
    aim: Aim,
    progress: &dyn Fn(usize, usize),
) -> Option<Found> {
    const GRID: usize = 24;
    let extent = probe.extent();
    let span = extent.map(|(a, b)| (b - a).max(1.0));
    let low = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).fold(f64::INFINITY, f64::min));
    let mut best: Option<(f64, Found)> = None;
    let consider = |best: &mut Option<(f64, Found)>, at: V3| {
        if !fits(probe, points, at) {
            return;
        }
        let free = margin(probe, points, at, span[0].min(span[1]).min(span[2]) / 2.0);
        let error = error(probe, budget, points, at);
        let worth = match (aim, error) {
            (Aim::Error, Some(e)) => -e,
            _ => free,
        };
        if best.is_none_or(|(w, _)| worth > w + 1e-9) {
            *best = Some((worth, Found { position: at, margin: free, error }));
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
            let mut at = around.position;
            at[i / 2] += if i % 2 == 0 { step[i / 2] } else { -step[i / 2] };
            consider(&mut best, at);
        }
        step = step.map(|s| s / 2.0);
    }
    best.map(|(_, f)| f)
}

/// The largest rectangle, symmetric about Y = 0, whose every point is within reach at all heights given: X from, X to,
/// and half its width, mm. X on a grid of 10 mm, the width to 1 mm.
pub fn rectangle(probe: &Probe<'_>, heights: &[f64]) -> Option<(f64, f64, f64)> {
    const STEP: f64 = 10.0;
    const FINE: i64 = 10;
    let extent = probe.extent();
    let first = libm::floor(extent[0].0 / STEP) as i64;
    let last = libm::ceil(extent[0].1 / STEP) as i64;
    // Half width at each X between the grid lines too: the border is not straight.
    let wide = |x: f64| -> f64 {
        let mut y = 0.0;
        while y <= extent[1].1 && heights.iter().all(|z| probe.reaches([x, y, *z]) && probe.reaches([x, -y, *z])) {
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
    best.map(|(_, r)| r)
}
