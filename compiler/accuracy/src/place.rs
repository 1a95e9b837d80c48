//! Where on the machine a part is best put.

use crate::clearance::{Lattice, border};
use crate::error::{Budget, Errors};
use crate::map::Probe;
use gr_machine::Chain;
use gr_machine::math::{M3, V3, add, dot, sub};

/// A place for the part and what it is worth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Found {
    /// Origin of the part in the base, mm.
    pub position: V3,
    /// How far the part may be moved any way, mm: at every place up to there all its points are within reach.
    pub margin: f64,
    /// The places that were looked at for the margin are so far apart, mm: a hole in the reach that is narrower is not seen.
    pub apart: f64,
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
    fn fits(&self, at: V3) -> bool {
        self.points.iter().all(|p| self.probe.reaches(add(at, *p)))
    }
}

/// Paths that the flange makes in the same direction, whatever the tools' lengths: what is free about one is so for all.
struct Group<'a> {
    probe: &'a Probe<'a>,
    /// From the tool point to the flange with the tool of that probe.
    offset: V3,
    /// Places of the flange, from the part's origin; first those that tell most.
    points: Vec<V3>,
    lattice: Lattice,
    /// Distance of each node from what is out of reach, mm.
    free: Vec<f32>,
}

/// Nodes over the work space and about the path: so many as take about a second; a search at each of them takes longer.
fn nodes(probe: &Probe<'_>) -> usize {
    if matches!(probe.machine().chain, Chain::Serial(_)) { 8_000 } else { 150_000 }
}

impl Group<'_> {
    fn of<'a>(parts: &'a [Part<'_>], progress: &dyn Fn(usize, usize)) -> Vec<Group<'a>> {
        let mut turns: Vec<(M3, &'a Probe<'a>, V3, Vec<V3>)> = Vec::new();
        for part in parts {
            let flange = part.probe.flange([0.0; 3]);
            let points = part.points.iter().map(|p| add(*p, flange.position));
            match turns.iter_mut().find(|t| t.0 == flange.turn) {
                Some(t) => t.3.extend(points),
                None => turns.push((flange.turn, &part.probe, flange.position, points.collect())),
            }
        }
        let count = turns.len();
        let one = |(i, (_, probe, offset, points)): (usize, (M3, &'a Probe<'a>, V3, Vec<V3>))| {
            let reaches = |f: V3| probe.reaches(sub(f, offset));
            let lattice = Lattice::new(probe.extent(), nodes(probe), &reaches, &|done, of| progress(i * of + done, count * of));
            let (mut first, free) = (telling(&points), lattice.free());
            first.extend(points);
            Group { probe, offset, points: first, lattice, free }
        };
        turns.into_iter().enumerate().map(one).collect()
    }

    /// How far the part may be moved any way from there, and how finely that was looked at, mm.
    fn margin(&self, at: V3, about: f64) -> (f64, f64) {
        let points: Vec<V3> = self.points.iter().map(|p| add(at, *p)).collect();
        let most = about + 2.0 * self.lattice.step();
        let most = self.probe.extent().map(|(low, high)| if high > low { most } else { 0.0 });
        border(&points, most, nodes(self.probe), &|f| self.probe.reaches(sub(f, self.offset)))
    }
}

/// Whether all points are within reach when the part's origin is there.
fn fits(parts: &[Part<'_>], at: V3) -> bool {
    parts.iter().all(|part| part.fits(at))
}

fn error<'a>(parts: &[Part<'_>], budget: &Budget, points: impl Iterator<Item = &'a [V3]>, at: V3) -> Option<f64> {
    if budget.joints.is_none() && budget.geometry.is_none() {
        return None;
    }
    let mut most = 0.0f64;
    for (part, points) in parts.iter().zip(points) {
        for p in points {
            let s = part.probe.sensitivity(add(at, *p), budget.geometry.is_some())?;
            most = most.max(Errors::new(&s, budget, None).sum());
        }
    }
    Some(most)
}

/// So many points of a part are looked at first, and for the error along the search.
const FIRST: usize = 60;

/// The points that stand out along the axes and across them, and some of the rest.
fn telling(points: &[V3]) -> Vec<V3> {
    let mut out: Vec<V3> = points.iter().step_by(points.len().div_ceil(FIRST).max(1)).copied().collect();
    for way in 0..27 {
        let u = [way % 3, way / 3 % 3, way / 9].map(|v| f64::from(v) - 1.0);
        out.extend(points.iter().max_by(|a, b| dot(**a, u).total_cmp(&dot(**b, u))));
    }
    out
}

/// Places along each side of the search's grid.
const GRID: usize = 24;

/// The best place so far.
#[derive(Clone, Copy)]
struct Best {
    worth: f64,
    at: V3,
    /// About how far it is free any way, mm.
    free: f64,
}

struct Search<'a> {
    parts: &'a [Part<'a>],
    budget: &'a Budget,
    groups: Vec<Group<'a>>,
    /// Of each part, for its error; none = the margin counts.
    few: Option<Vec<Vec<V3>>>,
    /// The longest side of the reach, mm.
    most: f64,
    best: Option<Best>,
}

impl Search<'_> {
    /// About how far the part is free there; none when that is no more than `least`.
    fn free(&self, at: V3, least: f64) -> Option<f64> {
        let mut out = self.most;
        for group in &self.groups {
            for p in &group.points {
                out = out.min(group.lattice.between(&group.free, add(at, *p)));
                if out <= least {
                    return None;
                }
            }
        }
        Some(out)
    }

    fn consider(&mut self, at: V3) {
        let least = if self.few.is_some() { 0.0 } else { self.best.map_or(0.0, |b| b.worth) };
        let Some(free) = self.free(at, least) else { return };
        let worth = match &self.few {
            None => free,
            Some(few) => match error(self.parts, self.budget, few.iter().map(Vec::as_slice), at) {
                Some(e) => -e,
                None => return,
            },
        };
        if self.best.is_none_or(|b| worth > b.worth + 1e-9) && fits(self.parts, at) {
            self.best = Some(Best { worth, at, free });
        }
    }

    /// Places about the best one, nearer and nearer to it.
    fn refine(&mut self, mut step: V3) {
        for _ in 0..24 {
            let Some(around) = self.best else { return };
            for way in 0..27 {
                let by = [way % 3, way / 3 % 3, way / 9].map(|v| f64::from(v) - 1.0);
                self.consider([0, 1, 2].map(|i| around.at[i] + by[i] * step[i]));
            }
            if self.best.is_none_or(|b| b.at == around.at) {
                step = step.map(|s| s / 2.0);
            }
        }
    }
}

/// Where the part's origin may be so that its box is within that of the reach: least and greatest.
fn room(parts: &[Part<'_>], groups: &[Group<'_>]) -> Option<[(f64, f64); 3]> {
    let extent = parts.first()?.probe.extent();
    Some([0, 1, 2].map(|i| {
        let ends = groups.iter().flat_map(|g| &g.points).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[i]), b.max(p[i])));
        let (low, high) = (extent[i].0 - ends.0, extent[i].1 - ends.1);
        if low <= high { (low, high) } else { ((low + high) / 2.0, (low + high) / 2.0) }
    }))
}

/// The best place of a part: looked for on a grid of the work space, by the distance of its points from what is out of
/// reach, then refined; there every point is looked at. None when the part fits nowhere on the grid.
pub fn place(parts: &[Part<'_>], budget: &Budget, aim: Aim, progress: &dyn Fn(usize, usize)) -> Option<Found> {
    let groups = Group::of(parts, &|done, of| progress(done * GRID, of * GRID * 2));
    let room = room(parts, &groups)?;
    let by_error = aim == Aim::Error && (budget.joints.is_some() || budget.geometry.is_some());
    let few = by_error.then(|| parts.iter().map(|p| telling(&p.points)).collect());
    let most = parts.first()?.probe.extent().iter().map(|(low, high)| high - low).fold(0.0, f64::max);
    let mut search = Search { parts, budget, groups, few, most, best: None };
    let at = |n: [usize; 3]| [0, 1, 2].map(|i| room[i].0 + (room[i].1 - room[i].0) * (n[i] as f64 + 0.5) / GRID as f64);
    for n in 0..GRID {
        (0..GRID * GRID).for_each(|m| search.consider(at([n, m / GRID, m % GRID])));
        progress(GRID + n + 1, GRID * 2);
    }
    if search.best.is_none() {
        // Where it only just fits, the lattice is too coarse.
        let mut all = (0..GRID * GRID * GRID).map(|m| at([m / GRID / GRID, m / GRID % GRID, m % GRID]));
        let worth = if by_error { f64::NEG_INFINITY } else { 0.0 };
        search.best = all.find(|at| fits(parts, *at)).map(|at| Best { worth, at, free: 0.0 });
    }
    search.refine(room.map(|(a, b)| (b - a) / GRID as f64 / 2.0));
    let best = search.best?;
    let margins: Vec<(f64, f64)> = search.groups.iter().map(|g| g.margin(best.at, best.free)).collect();
    let (margin, apart) = margins.into_iter().fold((f64::INFINITY, 0.0f64), |(m, a), (margin, apart)| (m.min(margin), a.max(apart)));
    // Never more than there is, the place being told to 0.001 mm too.
    let margin = (libm::floor((margin - 1e-3) * 10.0) / 10.0).max(0.0);
    Some(Found { position: best.at, margin, apart, error: error(parts, budget, parts.iter().map(|p| p.points.as_slice()), best.at) })
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
