//! A part on a machine whose reach is known place by place: an arm, a parallel machine. Where the tool has few turns, what is
//! free about each way of the flange is known from the reach for that turn; where it turns along the path, from the places of
//! the part at which all of it is within reach.

use super::{Look, Reach, telling};
use crate::clearance::{Lattice, border};
use crate::error::{Budget, Errors};
use crate::map::Probe;
use gr_machine::Chain;
use gr_machine::math::{M3, V3, add, norm, scale, sub};
use std::sync::Mutex;

/// What one tool does of a program in one turn.
pub struct Part<'a> {
    /// The machine with that tool, turned so.
    pub probe: Probe<'a>,
    /// Points of the tool, from the part's origin in the directions of the base, mm; those of cuts first.
    pub points: Vec<V3>,
    /// How many of them are of cuts: errors of rapids don't count.
    pub cuts: usize,
}

/// Paths that the flange makes in the same direction, whatever the tools' lengths: what is free about one is so for all.
struct Group {
    /// The part whose machine it is.
    part: usize,
    /// From the tool point to the flange with the tool of that part.
    offset: V3,
    /// Places of the flange, from the part's origin; first those that tell most.
    points: Vec<V3>,
    /// How many tell most.
    first: usize,
    lattice: Lattice,
    /// Distance of each node from what is out of reach, mm.
    free: Vec<f32>,
}

/// Index of a part, and of a point of it.
type Point = (usize, usize);

/// The places of the part's origin at which those points that tell most are within reach.
struct Whole {
    lattice: Lattice,
    free: Vec<f32>,
    /// Those points, and what else turned out to tell.
    few: Mutex<Vec<Point>>,
}

enum About {
    Groups(Vec<Group>),
    Whole(Whole),
}

/// What the tools of a program do, and the reach about it.
pub struct Arm<'a> {
    parts: Vec<Part<'a>>,
    about: About,
    /// Points of cuts that tell most.
    few: Vec<Point>,
    /// Least and greatest coordinates of the flange, from the part's origin.
    span: [(f64, f64); 3],
    /// The longest side of the reach, mm.
    most: f64,
}

/// Up to so many turns of the flange are looked at one by one.
const TURNS: usize = 6;

/// Nodes over the work space and about the path: so many as take about a second; a search at each of them takes longer.
fn nodes(probe: &Probe<'_>) -> usize {
    if matches!(probe.machine().chain, Chain::Serial(_)) { 8_000 } else { 150_000 }
}

/// Nodes where the whole path is looked at at each: most of them are out of reach by one of the first points.
fn nodes_of_whole(probe: &Probe<'_>) -> usize {
    nodes(probe) / 8
}

/// The turns of the flange, each with the parts that have it.
fn turns(parts: &[Part<'_>]) -> Vec<(M3, Vec<usize>)> {
    let mut out: Vec<(M3, Vec<usize>)> = Vec::new();
    for (n, part) in parts.iter().enumerate() {
        let turn = part.probe.flange([0.0; 3]).turn;
        match out.iter_mut().find(|t| t.0 == turn) {
            Some(t) => t.1.push(n),
            None => out.push((turn, vec![n])),
        }
    }
    out
}

/// The points that tell most of all parts.
fn telling_of(parts: &[Part<'_>], cuts: bool) -> Vec<Point> {
    let count = |p: &Part<'_>| if cuts { p.cuts.min(p.points.len()) } else { p.points.len() };
    let all: Vec<Point> = parts.iter().enumerate().flat_map(|(n, p)| (0..count(p)).map(move |k| (n, k))).collect();
    telling(all.len(), |i| parts[all[i].0].points[all[i].1]).into_iter().map(|i| all[i]).collect()
}

impl<'a> Arm<'a> {
    /// Looks at the reach; `progress` hears how many layers of how many are done.
    pub fn new(parts: Vec<Part<'a>>, progress: &dyn Fn(usize, usize)) -> Arm<'a> {
        let mut span = [(f64::INFINITY, f64::NEG_INFINITY); 3];
        for part in &parts {
            let to_flange = part.probe.flange([0.0; 3]).position;
            for p in &part.points {
                let p = add(*p, to_flange);
                (0..3).for_each(|i| span[i] = (span[i].0.min(p[i]), span[i].1.max(p[i])));
            }
        }
        let turns = turns(&parts);
        let most =
            parts.first().map_or(0.0, |p| p.probe.flange_extent().iter().map(|(low, high)| high - low).fold(0.0, f64::max));
        let few = if turns.len() <= TURNS {
            let one = |(n, p): (usize, &Part<'a>)| {
                telling(p.cuts.min(p.points.len()), |i| p.points[i]).into_iter().map(move |k| (n, k))
            };
            parts.iter().enumerate().flat_map(one).collect()
        } else {
            telling_of(&parts, true)
        };
        let about = About::Groups(Vec::new());
        let mut out = Arm { parts, about, few, span, most };
        out.about = if turns.len() <= TURNS {
            let count = turns.len();
            let one = |(i, (_, of)): (usize, (M3, Vec<usize>))| out.group(&of, &|done, all| progress(i * all + done, count * all));
            About::Groups(turns.into_iter().enumerate().map(one).collect())
        } else {
            About::Whole(out.whole(progress))
        };
        out
    }

    fn group(&self, of: &[usize], progress: &dyn Fn(usize, usize)) -> Group {
        let part = of[0];
        let probe = &self.parts[part].probe;
        let offset = probe.flange([0.0; 3]).position;
        let ways = of.iter().flat_map(|n| {
            let part = &self.parts[*n];
            let to_flange = part.probe.flange([0.0; 3]).position;
            part.points.iter().map(move |p| add(*p, to_flange))
        });
        let points: Vec<V3> = ways.collect();
        let lattice = Lattice::new(self.extent(), nodes(probe), &|f| probe.reaches(sub(f, offset)), progress);
        let free = lattice.free();
        let mut all: Vec<V3> = telling(points.len(), |i| points[i]).into_iter().map(|i| points[i]).collect();
        let first = all.len();
        all.extend(points);
        Group { part, offset, points: all, first, lattice, free }
    }

    fn whole(&self, progress: &dyn Fn(usize, usize)) -> Whole {
        let few = telling_of(&self.parts, false);
        let count = self.parts.first().map_or(0, |p| nodes_of_whole(&p.probe));
        let lattice = Lattice::new(self.room().unwrap_or_default(), count, &|at| self.reached(&few, at), progress);
        let free = lattice.free();
        Whole { lattice, free, few: Mutex::new(few) }
    }

    fn extent(&self) -> [(f64, f64); 3] {
        self.parts.first().map_or([(0.0, 0.0); 3], |p| p.probe.flange_extent())
    }

    fn reached(&self, points: &[Point], at: V3) -> bool {
        points.iter().all(|(n, k)| self.parts[*n].probe.reaches(add(at, self.parts[*n].points[*k])))
    }

    /// The first point that is out of reach there.
    fn missed(&self, at: V3) -> Option<Point> {
        let missed = |(n, part): (usize, &Part<'a>)| {
            part.points.iter().position(|p| !part.probe.reaches(add(at, *p))).map(|k| (n, k))
        };
        self.parts.iter().enumerate().find_map(missed)
    }

    /// At about how many places the reach is looked at for such parts.
    pub fn looks(parts: &[Part<'_>]) -> usize {
        let Some(first) = parts.first() else { return 0 };
        // The whole reach, and once more finely about the path.
        match turns(parts).len() {
            few if few <= TURNS => few * 2 * nodes(&first.probe),
            _ => 10 * nodes_of_whole(&first.probe),
        }
    }

    /// How far the part may be moved where the tool turns along its path: by the points that tell most, then by every point at
    /// places all around, and again with those that turn out to tell.
    fn margin_of_whole(&self, whole: &Whole, at: V3, about: f64) -> (f64, f64) {
        const TIMES: usize = 5;
        let most = self.extent().map(|(low, high)| if high > low { about + 2.0 * whole.lattice.step() } else { 0.0 });
        let count = self.parts.first().map_or(0, |p| nodes_of_whole(&p.probe) / 4);
        let mut few = whole.few.lock().map_or_else(|e| e.into_inner().clone(), |f| f.clone());
        let mut out = (0.0, 0.0);
        for _ in 0..TIMES {
            out = border(&[at], most, count, &|o| self.reached(&few, o));
            let around = || around(out.0 - 1e-3).map(|by| [0, 1, 2].map(|i| if most[i] > 0.0 { at[i] + by[i] } else { at[i] }));
            let more: Vec<Point> = around().filter_map(|o| self.missed(o)).collect();
            if more.is_empty() {
                break;
            }
            few.extend(more);
        }
        // What is left then is less than is found.
        let mut margin = out.0;
        while margin > 0.1 && around(margin - 1e-3).any(|by| self.missed(add(at, by)).is_some()) {
            margin *= 0.95;
        }
        if let Ok(mut known) = whole.few.lock() {
            *known = few;
        }
        (margin, out.1)
    }

    /// Lengths of the flange's path and of the reach along X, Y and Z, mm.
    pub fn sizes(&self) -> (V3, V3) {
        let length = |of: [(f64, f64); 3]| of.map(|(low, high)| high - low);
        (length(self.span), length(self.extent()))
    }

    /// The place of a grid at which the most of the points that tell are within reach; how many, and of how many.
    pub fn nearest(&self) -> (V3, usize, usize) {
        const EACH: usize = 12;
        let points = telling_of(&self.parts, false);
        let room = self.room().unwrap_or_default();
        let node = |n: usize| {
            let share = [n % EACH, n / EACH % EACH, n / (EACH * EACH)].map(|v| (v as f64 + 0.5) / EACH as f64);
            [0, 1, 2].map(|i| room[i].0 + (room[i].1 - room[i].0) * share[i])
        };
        let count = |at: V3| {
            let within = |(n, k): &&Point| self.parts[*n].probe.reaches(add(at, self.parts[*n].points[*k]));
            points.iter().filter(within).count()
        };
        let middle = room.map(|(low, high)| (low + high) / 2.0);
        let mut best = (middle, count(middle));
        for at in (0..EACH * EACH * EACH).map(node) {
            let c = count(at);
            if c > best.1 {
                best = (at, c);
            }
        }
        (best.0.map(|v| libm::round(v * 10.0) / 10.0 + 0.0), best.1, points.len())
    }

    fn probe(&self, group: &Group) -> &Probe<'a> {
        &self.parts[group.part].probe
    }
}

/// Ways of up to this length: along the axes, the edges and the diagonals of a cube.
pub fn around(length: f64) -> impl Iterator<Item = V3> {
    let ways = (0..27).filter(|n| *n != 13).map(|n| [n % 3, n / 3 % 3, n / 9].map(|v| f64::from(v) - 1.0));
    ways.flat_map(move |way| [1.0, 0.6].map(|share| scale(way, share * length.max(0.0) / norm(way))))
}

impl Reach for Arm<'_> {
    fn room(&self) -> Option<[(f64, f64); 3]> {
        let extent = self.parts.first()?.probe.flange_extent();
        Some([0, 1, 2].map(|i| {
            let (low, high) = (extent[i].0 - self.span[i].0, extent[i].1 - self.span[i].1);
            if low <= high { (low, high) } else { ((low + high) / 2.0, (low + high) / 2.0) }
        }))
    }

    fn free(&self, at: V3, look: Look, least: f64) -> Option<f64> {
        let mut out = self.most;
        match &self.about {
            About::Whole(whole) => {
                out = out.min(whole.lattice.between(&whole.free, at));
                if out <= least {
                    return None;
                }
            }
            About::Groups(groups) => {
                for group in groups {
                    let count = if look == Look::All { group.points.len() } else { group.first };
                    for p in &group.points[..count] {
                        out = out.min(group.lattice.between(&group.free, add(at, *p)));
                        if out <= least {
                            return None;
                        }
                    }
                }
            }
        }
        Some(out)
    }

    fn fits(&self, at: V3) -> bool {
        self.few.iter().all(|(n, k)| self.parts[*n].probe.reaches(add(at, self.parts[*n].points[*k])))
            && self.missed(at).is_none()
    }

    fn margin(&self, at: V3, about: f64) -> (f64, f64) {
        let groups = match &self.about {
            About::Whole(whole) => return self.margin_of_whole(whole, at, about),
            About::Groups(groups) => groups,
        };
        let one = |group: &Group| {
            let probe = self.probe(group);
            let points: Vec<V3> = group.points.iter().map(|p| add(at, *p)).collect();
            let most = about + 2.0 * group.lattice.step();
            let most = probe.flange_extent().map(|(low, high)| if high > low { most } else { 0.0 });
            border(&points, most, nodes(probe), &|f| probe.reaches(sub(f, group.offset)))
        };
        groups
            .iter()
            .map(one)
            .fold((f64::INFINITY, 0.0f64), |(m, a), (margin, apart)| (m.min(margin), a.max(apart)))
    }

    fn starts(&self) -> usize {
        let quick = self.parts.first().is_some_and(|p| crate::closed_form(p.probe.machine()));
        if quick { 12 } else { 2 }
    }

    fn exact(&self) -> bool {
        false
    }

    fn error(&self, budget: &Budget, at: V3, look: Look, most: f64) -> Option<f64> {
        if !budget.tells_any() {
            return None;
        }
        let mut out = 0.0f64;
        let mut look_at = |part: &Part<'_>, p: V3| {
            let s = part.probe.sensitivity(add(at, p), budget.tells_geometry())?;
            out = out.max(Errors::new(&s, budget, None).sum());
            (out <= most).then_some(())
        };
        if look == Look::All {
            for part in &self.parts {
                for p in &part.points[..part.cuts.min(part.points.len())] {
                    look_at(part, *p)?;
                }
            }
        } else {
            let count = if look == Look::Glance { self.few.len().min(1) } else { self.few.len() };
            for (n, k) in &self.few[..count] {
                look_at(&self.parts[*n], self.parts[*n].points[*k])?;
            }
        }
        Some(out)
    }
}
