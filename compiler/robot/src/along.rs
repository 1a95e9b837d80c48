//! Joint values along a path that somebody else cut into points: for pictures and hovers. The values are those of the
//! plan, read off between its own joint positions by the share of the way; nothing is solved anew.

use std::collections::HashMap;

use gr_ir::{FileId, Source};
use gr_machine::math::{Frame, norm, sub};
use gr_machine::{Chain, Kind, Machine, Pose};

use crate::joints::{JointOptions, JointPoint, TooMany, joint_path};
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

/// How the machine stands at points of the program's path; the points of a block follow each other. None for points of blocks that the plan has nothing of.
pub fn along(planned: &Planned, points: &[PathPoint]) -> Result<Vec<Option<Stand>>, TooMany> {
    let path = joint_path(&planned.program, &JointOptions { tolerance: TOLERANCE, most: MOST, ..JointOptions::default() })?;
    let (stretches, mut waiting) = stretches(path.points());
    let mut out: Vec<Option<Stand>> = Vec::with_capacity(points.len());
    let mut start = 0;
    for block in points.chunk_by(|a, b| a.source == b.source) {
        // A block that is run several times in the same frame comes back in the same order.
        let stretch = block.first().and_then(|p| waiting.get_mut(&p.source)?.next()).and_then(|n| stretches.get(n));
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
        start += block.len();
    }
    Ok(out)
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
        let (Action::Joint { to, .. } | Action::Linear { to, .. } | Action::Arc { to, .. }) = &step.action else { continue };
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
