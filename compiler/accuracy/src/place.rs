//! Where on the machine a part is best put. What a program asks of the reach is a matter of [`Arm`] and [`Mill`]; here is the
//! search: places on a grid, the most promising first, each refined.

mod arm;
mod mill;

pub use arm::{Arm, Part, around};
pub use mill::Mill;

use crate::error::Budget;
use crate::map::{Probe, halton};
use gr_machine::math::{V3, dot};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A place for the part and what it is worth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Found {
    /// Origin of the part in the base, mm.
    pub position: V3,
    /// How far the part may be moved any way, mm: at every place up to there all its points are within reach.
    pub margin: f64,
    /// The places that were looked at for the margin are so far apart, mm: a hole in the reach that is narrower is not seen;
    /// 0 = the margin is exact.
    pub apart: f64,
    /// The greatest error of the cuts (rule sum), mm, at the points that are looked at; none = the machine file has no accuracy
    /// data. A report says it along the whole path.
    pub error: Option<f64>,
    /// Distances of the grid that the search began on, mm, and from how many of its best places it went on.
    pub looked: (V3, usize),
}

/// What is best.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Aim {
    /// The largest margin.
    Margin,
    /// The smallest error.
    Error,
}

/// How many points of a part are looked at.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Look {
    /// One or a few, for a bound.
    Glance,
    /// Those that tell most.
    Some,
    /// Every one.
    All,
}

/// What a program asks of the reach of a machine, for every place of the part's origin.
pub trait Reach: Sync {
    /// Where the origin can be at most: least and greatest X, Y and Z; none when it fits nowhere.
    fn room(&self) -> Option<[(f64, f64); 3]>;
    /// About how far the part is free there, mm, by the points looked at; none when that is no more than `least`.
    fn free(&self, at: V3, look: Look, least: f64) -> Option<f64>;
    /// Whether all is within reach there.
    fn fits(&self, at: V3) -> bool;
    /// How far the part may be moved any way from a place that fits, and how finely that was looked at, mm; it is about `about`.
    fn margin(&self, at: V3, about: f64) -> (f64, f64);
    /// From how many of the best places of a grid a search for the least error goes on: as many as take some seconds.
    fn starts(&self) -> usize;
    /// Whether [`Reach::free`] is exact, and no more in the middle between two places than the less of theirs.
    fn exact(&self) -> bool;
    /// The greatest error there, mm, of the points looked at; none when one is out of reach or it is more than `most`.
    fn error(&self, budget: &Budget, at: V3, look: Look, most: f64) -> Option<f64>;
}

/// So many points of a part are looked at first, and for the error along the search.
const FIRST: usize = 60;

/// Indices of the points that stand out along the axes and across them, and of some of the rest.
fn telling(count: usize, point: impl Fn(usize) -> V3) -> Vec<usize> {
    let mut out: Vec<usize> = (0..count).step_by(count.div_ceil(FIRST).max(1)).collect();
    for way in 0..27 {
        let u = [way % 3, way / 3 % 3, way / 9].map(|v| f64::from(v) - 1.0);
        out.extend((0..count).max_by(|a, b| dot(point(*a), u).total_cmp(&dot(point(*b), u))));
    }
    out
}

/// Places along each side of the search's grid.
const GRID: usize = 24;

/// A place of the grid and what it is worth: exactly, or at most.
#[derive(Clone, Copy, PartialEq)]
struct Candidate {
    worth: f64,
    node: usize,
    exact: bool,
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Candidate) -> Ordering {
        self.worth.total_cmp(&other.worth).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Candidate) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// A place that is worth something.
#[derive(Clone, Copy)]
struct Best {
    worth: f64,
    at: V3,
    /// About how far it is free any way, mm.
    free: f64,
}

/// Rounds of the search for the least error, at most, and the step at which it ends, mm.
const ROUNDS: usize = 90;
const FINE: f64 = 0.02;
/// From a place that was refused so much of the way back.
const BACK: f64 = 0.3;

/// Ways along the axes, edges and diagonals of a cube, and for a round some others.
fn ways(round: Option<usize>) -> impl Iterator<Item = V3> {
    const OTHERS: usize = 12;
    let cube = (0..27).map(|n| [n % 3, n / 3 % 3, n / 9].map(|v| f64::from(v) - 1.0));
    let first = round.map_or(0, |r| u32::try_from(r * OTHERS + 1).unwrap_or(1));
    let others = (first..first + if round.is_some() { OTHERS as u32 } else { 0 }).map(|n| [2, 3, 5].map(|base| 2.0 * halton(n, base) - 1.0));
    cube.chain(others)
}

struct Search<'a> {
    reach: &'a dyn Reach,
    budget: &'a Budget,
    by_error: bool,
    room: [(f64, f64); 3],
}

/// Errors nearer to each other than this are one, mm.
const SAME_ERROR: f64 = 1e-6;

/// What a place is worth by its error; of places with the same the one that is more free.
fn by_error(error: f64, free: f64) -> f64 {
    const MOST_FREE: f64 = 1e5;
    SAME_ERROR * (free.min(MOST_FREE) / MOST_FREE - libm::round(error / SAME_ERROR))
}

impl Search<'_> {
    fn count(&self) -> [usize; 3] {
        self.room.map(|(low, high)| if high > low { GRID } else { 1 })
    }

    fn step(&self) -> V3 {
        self.room.map(|(low, high)| (high - low) / GRID as f64)
    }

    fn node(&self, n: usize) -> V3 {
        let [x, y, _] = self.count();
        let at = [n % x, n / x % y, n / (x * y)];
        [0, 1, 2]
            .map(|i| self.room[i].0 + (self.room[i].1 - self.room[i].0) * (at[i] as f64 + 0.5) / self.count()[i] as f64)
    }

    /// No less than what a place is worth.
    fn bound(&self, at: V3) -> Option<f64> {
        let free = self.reach.free(at, Look::Some, 0.0)?;
        if !self.by_error {
            return Some(free);
        }
        self.reach.error(self.budget, at, Look::Glance, f64::INFINITY).map(|e| by_error(e, free))
    }

    /// What a place is worth, where that is more than `least`.
    fn worth(&self, at: V3, least: f64) -> Option<Best> {
        if !self.by_error {
            let free = self.reach.free(at, Look::All, least.max(0.0))?;
            return Some(Best { worth: free, at, free });
        }
        let free = self.reach.free(at, Look::All, 0.0)?;
        let worth = by_error(self.reach.error(self.budget, at, Look::Some, -least + 2.0 * SAME_ERROR)?, free);
        (worth > least).then_some(Best { worth, at, free })
    }

    /// All places of the grid with what they are worth at most, on all cores.
    fn bounds(&self, progress: &dyn Fn(usize, usize)) -> BinaryHeap<Candidate> {
        let all: usize = self.count().iter().product();
        let threads = std::thread::available_parallelism().map_or(1, usize::from).min(16);
        let share = all.div_ceil(GRID).max(1);
        let look = |from: usize| -> Vec<Candidate> {
            let one = |node| self.bound(self.node(node)).map(|worth| Candidate { worth, node, exact: false });
            (from..(from + share).min(all)).filter_map(one).collect()
        };
        let starts: Vec<usize> = (0..all).step_by(share).collect();
        let mut out = BinaryHeap::new();
        for (n, some) in starts.chunks(threads).enumerate() {
            let found: Vec<Vec<Candidate>> = std::thread::scope(|s| {
                let running: Vec<_> = some.iter().map(|from| s.spawn(|| look(*from))).collect();
                running.into_iter().filter_map(|r| r.join().ok()).collect()
            });
            out.extend(found.into_iter().flatten());
            progress(((n + 1) * threads).min(starts.len()), starts.len());
        }
        out
    }

    /// Places about a good one, nearer and nearer to the best of them. The largest of many errors has creases along which only
    /// some ways lead down: for it other ways are tried each time, and once more the way that was good.
    fn refined(&self, from: Best) -> Best {
        let mut best = from;
        let mut step = self.step().map(|s| s / 2.0);
        for round in 0..if self.by_error { ROUNDS } else { 24 } {
            let around = best.at;
            for by in ways(if self.by_error { Some(round) } else { None }) {
                self.better(&mut best, [0, 1, 2].map(|i| around[i] + by[i] * step[i]));
            }
            if best.at == around {
                step = step.map(|s| s / 2.0);
                if self.by_error && step.iter().all(|s| *s < FINE) {
                    break;
                }
            } else if self.by_error {
                let on = [0, 1, 2].map(|i| 2.0 * best.at[i] - around[i]);
                self.better(&mut best, on);
            }
        }
        best
    }

    /// Takes a place that is worth more.
    fn better(&self, best: &mut Best, at: V3) {
        let least = best.worth + if self.by_error { 1e-14 } else { 1e-9 };
        if let Some(found) = self.worth(at, least).filter(|_| self.reach.fits(at)) {
            *best = found;
        }
    }

    /// From how many places of the grid the search goes on: the largest margin has few hills.
    fn starts(&self) -> usize {
        if self.by_error { self.reach.starts() } else { 1 }
    }

    /// The same worth in the middle of where it is that much, axis by axis: of many places that are as free the one that people
    /// would choose.
    fn centred(&self, best: Best) -> Best {
        const HALVINGS: usize = 40;
        if self.by_error || !self.reach.exact() {
            return best;
        }
        let mut out = best;
        for i in 0..3 {
            let with = |v: f64| {
                let mut at = out.at;
                at[i] = v;
                at
            };
            let as_free = |v: f64| self.reach.free(with(v), Look::All, best.worth - 1e-6).is_some();
            let end = |far: f64| {
                let (mut good, mut bad) = (out.at[i], far);
                if as_free(bad) {
                    return bad;
                }
                for _ in 0..HALVINGS {
                    let mid = (good + bad) / 2.0;
                    if as_free(mid) { good = mid } else { bad = mid }
                }
                good
            };
            let at = with((end(self.room[i].0) + end(self.room[i].1)) / 2.0);
            if let Some(free) = self.reach.free(at, Look::All, 0.0).filter(|_| self.reach.fits(at)) {
                out = Best { at, free, worth: free };
            }
        }
        out
    }
}

/// A place as it is told, in thousandths of a mm, where the part still fits so.
fn told(at: V3, reach: &dyn Reach) -> V3 {
    let round = at.map(|v| libm::round(v * 1e3) / 1e3 + 0.0);
    if reach.fits(round) { round } else { at }
}

/// Whether a place is within a step of one of them.
fn near_any(places: &[V3], at: V3, step: V3) -> bool {
    places.iter().any(|r| (0..3).all(|i| (r[i] - at[i]).abs() <= step[i] * 1.01))
}

/// The best place of a part: looked for on a grid of the work space, by the distance of its points from what is out of
/// reach or by its error, then refined; there every point is looked at. A place that is not `allowed` is left, and the search
/// goes on with the next best away from it, at most `tries` times. None that is allowed: the best of those that were not.
pub fn place(
    reach: &dyn Reach,
    budget: &Budget,
    aim: Aim,
    tries: usize,
    allowed: &mut dyn FnMut(V3) -> bool,
    progress: &dyn Fn(usize, usize),
) -> Result<Found, Option<V3>> {
    let room = reach.room().ok_or(None)?;
    let by_error = aim == Aim::Error && budget.tells_any();
    let search = Search { reach, budget, by_error, room };
    let mut heap = search.bounds(progress);
    if heap.is_empty() {
        // Where it only just fits, the search is too coarse.
        let all: usize = search.count().iter().product();
        let worth = if by_error { f64::NEG_INFINITY } else { 0.0 };
        heap.extend((0..all).find(|n| reach.fits(search.node(*n))).map(|node| Candidate { worth, node, exact: true }));
    }
    let step = search.step();
    let mut refused: Vec<V3> = Vec::new();
    // What the search went on to from the best places of the grid, and from where.
    let mut pool: Vec<(Best, V3)> = Vec::new();
    let mut looked = 0;
    // Beside a refused place of much margin there is little to find; the least error may be just beside one.
    let beside = if by_error { [1.0; 3] } else { step };
    loop {
        while (looked < search.starts() || pool.is_empty())
            && let Some(candidate) = heap.pop()
        {
            let at = search.node(candidate.node);
            if near_any(&refused, at, beside) {
                continue;
            }
            if !candidate.exact {
                let exact =
                    search.worth(at, f64::NEG_INFINITY).map(|b| Candidate { worth: b.worth, exact: true, ..candidate });
                heap.extend(exact);
                continue;
            }
            if !reach.fits(at) {
                continue;
            }
            let free = reach.free(at, Look::All, 0.0).unwrap_or(0.0);
            let here = Best { worth: candidate.worth, at, free };
            let best = Some(search.centred(search.refined(here))).filter(|b| !near_any(&refused, b.at, beside));
            pool.push((best.unwrap_or(here), at));
            looked += 1;
            progress(looked, search.starts().max(looked));
        }
        let Some(n) = (0..pool.len()).max_by(|a, b| pool[*a].0.worth.total_cmp(&pool[*b].0.worth).then(b.cmp(a))) else { break };
        let (best, from) = pool.swap_remove(n);
        let position = told(best.at, reach);
        if near_any(&refused, position, beside) {
            continue;
        }
        if allowed(position) {
            let (margin, apart) = reach.margin(position, best.free);
            // Never more than there is.
            let margin = (libm::floor((margin - 1e-3) * 10.0) / 10.0).max(0.0);
            let error = reach.error(budget, position, Look::All, f64::INFINITY);
            return Ok(Found { position, margin, apart, error, looked: (step, looked) });
        }
        refused.push(position);
        if refused.len() >= tries {
            break;
        }
        if by_error {
            // Back to where it came from: the least error tends to the border of what can be done.
            let back = [0, 1, 2].map(|i| best.at[i] + BACK * (from[i] - best.at[i]));
            pool.extend(search.worth(back, f64::NEG_INFINITY).filter(|_| reach.fits(back)).map(|b| (b, from)));
        }
    }
    Err(refused.first().copied())
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
        let reached =
            |y: f64| heights.iter().all(|z| probe.reaches([x, middle + y, *z]) && probe.reaches([x, middle - y, *z]));
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
