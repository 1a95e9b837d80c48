//! A part on a machine whose reach is known place by place: an arm, a parallel machine. The tool's turn is one for a tool.

use super::{Look, Reach, telling};
use crate::clearance::{Lattice, border};
use crate::error::{Budget, Errors};
use crate::map::Probe;
use gr_machine::Chain;
use gr_machine::math::{M3, V3, add, sub};

/// What one tool does of a program.
pub struct Part<'a> {
    /// The machine with that tool.
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

/// What the tools of a program do, and the reach about it.
pub struct Arm<'a> {
    parts: Vec<Part<'a>>,
    groups: Vec<Group>,
    /// Of each part the points that tell most.
    few: Vec<Vec<usize>>,
    /// The longest side of the reach, mm.
    most: f64,
}

/// Nodes over the work space and about the path: so many as take about a second; a search at each of them takes longer.
fn nodes(probe: &Probe<'_>) -> usize {
    if matches!(probe.machine().chain, Chain::Serial(_)) { 8_000 } else { 150_000 }
}

impl<'a> Arm<'a> {
    /// Looks at the reach; `progress` hears how many layers of how many are done.
    pub fn new(parts: Vec<Part<'a>>, progress: &dyn Fn(usize, usize)) -> Arm<'a> {
        let mut turns: Vec<(M3, usize, V3, Vec<V3>)> = Vec::new();
        for (n, part) in parts.iter().enumerate() {
            let flange = part.probe.flange([0.0; 3]);
            let points = part.points.iter().map(|p| add(*p, flange.position));
            match turns.iter_mut().find(|t| t.0 == flange.turn) {
                Some(t) => t.3.extend(points),
                None => turns.push((flange.turn, n, flange.position, points.collect())),
            }
        }
        let count = turns.len();
        let one = |(i, (_, part, offset, points)): (usize, (M3, usize, V3, Vec<V3>))| {
            let probe = &parts[part].probe;
            let reaches = |f: V3| probe.reaches(sub(f, offset));
            let lattice =
                Lattice::new(probe.extent(), nodes(probe), &reaches, &|done, of| progress(i * of + done, count * of));
            let free = lattice.free();
            let mut first: Vec<V3> = telling(points.len(), |i| points[i]).into_iter().map(|i| points[i]).collect();
            let tell = first.len();
            first.extend(points);
            Group { part, offset, points: first, first: tell, lattice, free }
        };
        let groups = turns.into_iter().enumerate().map(one).collect();
        let few = parts.iter().map(|p| telling(p.cuts.min(p.points.len()), |i| p.points[i])).collect();
        let most =
            parts.first().map_or(0.0, |p| p.probe.extent().iter().map(|(low, high)| high - low).fold(0.0, f64::max));
        Arm { parts, groups, few, most }
    }

    /// At about how many places the reach is looked at for such parts.
    pub fn looks(parts: &[Part<'_>]) -> usize {
        let mut turns: Vec<M3> = Vec::new();
        for turn in parts.iter().map(|p| p.probe.flange([0.0; 3]).turn) {
            if !turns.contains(&turn) {
                turns.push(turn);
            }
        }
        // The whole reach, and once more finely about the path.
        turns.len() * 2 * parts.first().map_or(0, |p| nodes(&p.probe))
    }

    fn probe(&self, group: &Group) -> &Probe<'a> {
        &self.parts[group.part].probe
    }
}

impl Reach for Arm<'_> {
    fn room(&self) -> Option<[(f64, f64); 3]> {
        let extent = self.parts.first()?.probe.extent();
        Some([0, 1, 2].map(|i| {
            let points = self.groups.iter().flat_map(|g| &g.points);
            let ends = points.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[i]), b.max(p[i])));
            let (low, high) = (extent[i].0 - ends.0, extent[i].1 - ends.1);
            if low <= high { (low, high) } else { ((low + high) / 2.0, (low + high) / 2.0) }
        }))
    }

    fn free(&self, at: V3, look: Look, least: f64) -> Option<f64> {
        let mut out = self.most;
        for group in &self.groups {
            let count = if look == Look::All { group.points.len() } else { group.first };
            for p in &group.points[..count] {
                out = out.min(group.lattice.between(&group.free, add(at, *p)));
                if out <= least {
                    return None;
                }
            }
        }
        Some(out)
    }

    fn fits(&self, at: V3) -> bool {
        self.parts.iter().all(|part| part.points.iter().all(|p| part.probe.reaches(add(at, *p))))
    }

    fn margin(&self, at: V3, about: f64) -> (f64, f64) {
        let one = |group: &Group| {
            let probe = self.probe(group);
            let points: Vec<V3> = group.points.iter().map(|p| add(at, *p)).collect();
            let most = about + 2.0 * group.lattice.step();
            let most = probe.extent().map(|(low, high)| if high > low { most } else { 0.0 });
            border(&points, most, nodes(probe), &|f| probe.reaches(sub(f, group.offset)))
        };
        self.groups
            .iter()
            .map(one)
            .fold((f64::INFINITY, 0.0f64), |(m, a), (margin, apart)| (m.min(margin), a.max(apart)))
    }

    fn exact(&self) -> bool {
        false
    }

    fn error(&self, budget: &Budget, at: V3, look: Look, most: f64) -> Option<f64> {
        if !budget.tells_any() {
            return None;
        }
        let mut out = 0.0f64;
        for (part, few) in self.parts.iter().zip(&self.few) {
            let count = match look {
                Look::Glance => few.len().min(1),
                Look::Some => few.len(),
                Look::All => part.cuts.min(part.points.len()),
            };
            for n in 0..count {
                let p = if look == Look::All { part.points[n] } else { part.points[few[n]] };
                let s = part.probe.sensitivity(add(at, p), budget.tells_geometry())?;
                out = out.max(Errors::new(&s, budget, None).sum());
                if out > most {
                    return None;
                }
            }
        }
        Some(out)
    }
}
