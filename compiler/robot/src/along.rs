//! Joint values along a path that somebody else cut into points: for pictures and hovers. The values are those of the
//! plan, read off between its own joint positions by the share of the way; nothing is solved anew.

use std::collections::HashMap;

use gr_ir::{FileId, Source};
use gr_machine::math::{Frame, cross, norm, sub};
use gr_machine::{Chain, Kind, Machine, Pose, Rapid};

use crate::joints::{JointOptions, JointPath, JointPoint, TooMany, joint_path};
use crate::solver::{Joints, Solver};
use crate::{Action, MAX_JOINTS, Planned, RobotProgram};

/// A point of a path.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PathPoint {
    /// X Y Z, mm.
    pub place: [f32; 3],
    /// The block it belongs to.
    pub source: Source,
    /// The path leads here from the point before.
    pub joined: bool,
    /// It does so by a rapid.
    pub rapid: bool,
}

/// How the tool point goes to a point of the path in a joint rapid: not in a line.
#[derive(Clone, PartialEq, Debug)]
pub struct Sweep {
    /// The point it leads to.
    pub point: usize,
    /// Tool points between the point before and it, in the base, mm.
    pub places: Vec<[f64; 3]>,
}

/// How a machine stands at a point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Stand {
    /// Joint values, mm or rad, as [`crate::Target`] has them.
    pub joints: [f64; MAX_JOINTS],
    /// Tool point in the base, mm.
    pub tip: [f64; 3],
}

/// Whether the planner chooses the joint values of this machine; otherwise they follow from each place alone.
pub fn is_planned(machine: &Machine) -> bool {
    machine.kind == Kind::Robot && !matches!(machine.chain, Chain::Planar3r(_) | Chain::Incomplete { .. })
}

/// Distance of the tool from its path between two joint positions that are read off, mm.
const TOLERANCE: f64 = 0.05;
/// Joint positions at most.
const MOST: usize = 2_000_000;

/// A block's stretch of the plan.
struct Stretch<'p> {
    points: Vec<&'p JointPoint>,
    /// Way of the tool point to each of them.
    ways: Vec<f64>,
}

impl<'p> Stretch<'p> {
    fn add(&mut self, p: &'p JointPoint) {
        let step = self.points.last().map_or(0.0, |last| norm(sub(p.tool.position, last.tool.position)));
        self.ways.push(self.ways.last().map_or(0.0, |w| w + step));
        self.points.push(p);
    }
    fn at(&self, share: f64) -> Option<Stand> {
        let last = *self.points.last()?;
        let way = self.ways.last()? * share.clamp(0.0, 1.0);
        let n = self.ways.partition_point(|w| *w < way);
        let (Some(to), Some(from)) = (self.points.get(n), n.checked_sub(1).and_then(|n| self.points.get(n))) else {
            return Some(stand(if share >= 1.0 { last } else { self.points.first()? }));
        };
        if share >= 1.0 {
            return Some(stand(last));
        }
        let part = (way - self.ways[n - 1]) / (self.ways[n] - self.ways[n - 1]).max(f64::MIN_POSITIVE);
        let between = |a: f64, b: f64| a + (b - a) * part;
        Some(Stand {
            joints: std::array::from_fn(|i| between(from.joints[i], to.joints[i])),
            tip: std::array::from_fn(|i| between(from.tool.position[i], to.tool.position[i])),
        })
    }
}

fn stand(p: &JointPoint) -> Stand {
    Stand { joints: p.joints, tip: p.tool.position }
}

/// A plan as joint positions, to be read off.
pub struct Walk<'p> {
    planned: &'p Planned,
    path: JointPath,
}

impl<'p> Walk<'p> {
    /// Cuts the plan into joint positions.
    pub fn new(planned: &'p Planned) -> Result<Walk<'p>, TooMany> {
        let path = joint_path(&planned.program, &JointOptions { tolerance: TOLERANCE, most: MOST, ..JointOptions::default() })?;
        Ok(Walk { planned, path })
    }

    /// How the machine stands at points of the program's path; the points of a block follow each other. None for points
    /// of blocks that the plan has nothing of.
    pub fn stands(&self, points: &[PathPoint]) -> Vec<Option<Stand>> {
        let mut out: Vec<Option<Stand>> = Vec::with_capacity(points.len());
        self.blocks(points, |start, block, stretch| {
            let ways = ways(points, start, block.len());
            let whole = ways.last().copied().unwrap_or(0.0);
            match stretch {
                Some(s) => out.extend(ways.iter().map(|w| s.at(if whole > 0.0 { w / whole } else { 1.0 }))),
                // While it waits the machine stays where it is.
                None => {
                    let last = out.last().copied().flatten();
                    out.extend(ways.iter().map(|w| last.filter(|_| *w == 0.0)));
                }
            }
        });
        out
    }

    /// The ways of the tool point in the plan's joint rapids.
    pub fn sweeps(&self, points: &[PathPoint]) -> Vec<Sweep> {
        let mut out = Vec::new();
        let machine = &self.planned.program.machine;
        if !sweeps(machine) {
            return out;
        }
        let solver = Solver::new(machine);
        let forward = |q: &Joints| solver.forward(q);
        self.blocks(points, |start, block, stretch| {
            let mut ends = block.iter().enumerate().filter(|(_, p)| p.joined);
            let (Some((n, end)), None) = (ends.next(), ends.next()) else { return };
            let Some(s) = stretch.filter(|s| end.rapid && s.points.iter().skip(1).all(|p| p.rapid)) else { return };
            let mut places = Vec::new();
            for pair in s.points.windows(2) {
                if pair[0].joints == pair[1].joints {
                    continue;
                }
                places.extend(between(&forward, &pair[0].joints, &pair[1].joints, pair[1].tool.position, solver.count));
                places.push(pair[1].tool.position);
            }
            places.pop();
            let ends = s.points.first().zip(s.points.last());
            if ends.is_some_and(|(a, b)| places.iter().any(|p| beside(*p, a.tool.position, b.tool.position) > TOLERANCE)) {
                out.push(Sweep { point: start + n, places });
            }
        });
        out
    }

    /// Each block of the path with its stretch of the plan. A block that is run several times in the same frame comes
    /// back in the same order.
    fn blocks(&self, points: &[PathPoint], mut each: impl FnMut(usize, &[PathPoint], Option<&Stretch<'_>>)) {
        let (stretches, mut waiting) = stretches(self.path.points());
        let mut start = 0;
        for block in points.chunk_by(|a, b| a.source == b.source) {
            let stretch = block.first().and_then(|p| waiting.get_mut(&p.source)?.next()).and_then(|n| stretches.get(n));
            each(start, block, stretch);
            start += block.len();
        }
    }
}

/// Whether the rapids of a machine are joint rapids.
fn sweeps(machine: &Machine) -> bool {
    machine.kind == Kind::Robot && machine.cell.rapid != Some(Rapid::Linear)
}

/// Pieces of one joint rapid at most.
const MOST_PIECES: usize = 32;

/// Tool points on the way between two joint positions, near enough to be joined by lines; `tip`: the tool point at the
/// second.
fn between(forward: &dyn Fn(&Joints) -> Option<Frame>, a: &Joints, b: &Joints, tip: [f64; 3], count: usize) -> Vec<[f64; 3]> {
    let Some(held) = forward(b).map(|f| f.inverse().apply(tip)) else { return Vec::new() };
    let at = |share: f64| {
        let mut q = *a;
        (0..count).for_each(|i| q[i] += (b[i] - a[i]) * share);
        forward(&q).map(|f| f.apply(held))
    };
    let Some(all) = (0..=MOST_PIECES).map(|k| at(k as f64 / MOST_PIECES as f64)).collect::<Option<Vec<_>>>() else { return Vec::new() };
    let mut step = MOST_PIECES;
    let off = |from: usize, to: usize| (from + 1..to).map(|k| beside(all[k], all[from], all[to])).fold(0.0, f64::max);
    while step > 1 && (0..MOST_PIECES).step_by(step).any(|k| off(k, k + step) > TOLERANCE) {
        step /= 2;
    }
    (step..MOST_PIECES).step_by(step).map(|k| all[k]).collect()
}

/// Way from the point before the block to each of its points.
fn ways(points: &[PathPoint], start: usize, count: usize) -> Vec<f64> {
    let place = |i: usize| points[i].place.map(f64::from);
    let mut way = 0.0;
    (start..start + count)
        .map(|i| {
            if i > 0 && points[i].joined {
                way += norm(sub(place(i), place(i - 1)));
            }
            way
        })
        .collect()
}

type Waiting = HashMap<Source, std::vec::IntoIter<usize>>;

/// The plan cut by blocks; moves of the planner's own lie between them.
fn stretches<'p>(points: impl Iterator<Item = &'p JointPoint>) -> (Vec<Stretch<'p>>, Waiting) {
    let mut all: Vec<Stretch<'p>> = Vec::new();
    let mut by_source: HashMap<Source, Vec<usize>> = HashMap::new();
    let mut before: Option<&JointPoint> = None;
    let mut here = None;
    for p in points {
        if let Some(source) = p.source {
            if here != Some(source) {
                here = Some(source);
                let mut fresh = Stretch { points: Vec::new(), ways: Vec::new() };
                before.into_iter().for_each(|b| fresh.add(b));
                by_source.entry(source).or_default().push(all.len());
                all.push(fresh);
            }
            if let Some(stretch) = all.last_mut() {
                stretch.add(p);
            }
        }
        before = Some(p);
    }
    (all, by_source.into_iter().map(|(s, list)| (s, list.into_iter())).collect())
}

/// Joint values at the end of a line when execution comes there for the first time; none when the line moves nothing.
pub fn at_line(program: &RobotProgram, file: FileId, line: u32) -> Option<[f64; MAX_JOINTS]> {
    let mut found = None;
    for step in &program.steps {
        let here = step.source.is_some_and(|s| s.file == file && s.line == line);
        let (Action::Joint { to, .. } | Action::Linear { to, .. } | Action::Arc { to, .. } | Action::Probe { to, .. }) = &step.action else { continue };
        match (here, step.source) {
            (true, _) => found = program.targets.get(*to as usize).map(|t| t.joints),
            // Moves of the planner's own may stand in between.
            (false, Some(_)) if found.is_some() => break,
            _ => {}
        }
    }
    found
}

/// As [`along`], for machines whose joint values follow from each place alone: of several solutions within the limits
/// the one next to that of the point before. Places are X Y Z in the part's frame, the tool as at the start.
pub fn nearest(machine: &Machine, points: &[PathPoint]) -> Vec<Option<Stand>> {
    let kinematics = machine.kinematics();
    let part = if matches!(machine.chain, Chain::Cartesian) { Frame::IDENTITY } else { machine.cell.part_in_base() };
    let mut last: Option<Vec<f64>> = machine.start_joints.clone();
    let one = |p: &PathPoint| {
        let tip = part.apply(p.place.map(f64::from));
        let solutions = kinematics.inverse(&Pose { position: tip, ..machine.start }).ok()?;
        let far = |q: &[f64]| last.as_deref().map_or(0.0, |n| q.iter().zip(n).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
        let allowed = solutions.into_iter().map(|s| s.joints).filter(|q| machine.outside(q).is_empty());
        let joints = allowed.min_by(|a, b| far(a).total_cmp(&far(b)))?;
        let mut padded = [0.0; MAX_JOINTS];
        padded.iter_mut().zip(&joints).for_each(|(slot, v)| *slot = *v);
        last = Some(joints);
        Some(Stand { joints: padded, tip })
    };
    points.iter().map(one).collect()
}

/// Distance of a place from the line between two others.
fn beside(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let (line, to) = (sub(b, a), sub(p, a));
    let way = norm(line);
    if way > 1e-9 { norm(cross(line, to)) / way } else { norm(to) }
}

/// As [`Walk::sweeps`], for machines whose joint values follow from each place alone: how they `stand` at the points.
pub fn swept(machine: &Machine, points: &[PathPoint], stands: &[Option<Stand>]) -> Vec<Sweep> {
    if !sweeps(machine) {
        return Vec::new();
    }
    let (kinematics, count) = (machine.kinematics(), machine.joints.len().min(MAX_JOINTS));
    let forward = |q: &Joints| kinematics.forward(&q[..count]).ok().map(|p| Frame::shift(p.position));
    let one = |i: usize| {
        let (a, b) = (stands[i - 1]?, stands[i]?);
        let places = between(&forward, &a.joints, &b.joints, b.tip, count);
        (!places.is_empty()).then_some(Sweep { point: i, places })
    };
    (1..points.len().min(stands.len())).filter(|i| points[*i].joined && points[*i].rapid).filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(way: f64, joint: f64, source: Option<Source>) -> JointPoint {
        let mut joints = [0.0; MAX_JOINTS];
        joints[0] = joint;
        JointPoint { joints, tool: Frame::shift([way, 0.0, 0.0]), seconds: 1.0, rapid: false, stop: true, source }
    }

    #[test]
    fn stretches_are_read_off_by_their_share() {
        let line = |line| Some(Source { line, ..Source::default() });
        let list = [point(0.0, 0.0, None), point(10.0, 1.0, line(1)), point(30.0, 2.0, line(1)), point(30.0, 5.0, None), point(40.0, 6.0, line(2)), point(50.0, 7.0, line(1))];
        let (all, mut waiting) = stretches(list.iter());
        let first = &all[waiting.get_mut(&line(1).unwrap()).unwrap().next().unwrap()];
        let joint = |s: &Stretch<'_>, share| s.at(share).unwrap().joints[0];
        assert_eq!([joint(first, 0.0), joint(first, 1.0 / 6.0), joint(first, 2.0 / 3.0), joint(first, 1.0)], [0.0, 0.5, 1.5, 2.0]);
        // After a change of configuration the next block begins where the machine stands now.
        let second = &all[waiting.get_mut(&line(2).unwrap()).unwrap().next().unwrap()];
        assert_eq!([joint(second, 0.0), joint(second, 1.0)], [5.0, 6.0]);
        let again = &all[waiting.get_mut(&line(1).unwrap()).unwrap().next().unwrap()];
        assert_eq!(joint(again, 1.0), 7.0);
        assert!(waiting.get_mut(&line(1).unwrap()).unwrap().next().is_none());
    }
}
