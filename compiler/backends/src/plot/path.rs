//! The path as points, in one frame for the whole program.

use gr_ir::geometry::{Extent, flatten};
use gr_ir::measure::{Known, Rates, Totals};
use gr_ir::timing::Clock;
use gr_ir::{Op, Pose, Program, State, View};

use super::trace::Trace;

/// What a stretch of path is drawn as.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
#[repr(u8)]
pub enum Class {
    /// Rapid.
    Rapid = 0,
    /// Straight feed move.
    Feed = 1,
    /// Arc, helix or spline.
    Curve = 2,
    /// Probe or rigid tap.
    Other = 3,
}

impl Class {
    pub(super) const ALL: [Class; 4] = [Class::Rapid, Class::Feed, Class::Curve, Class::Other];

    pub(super) fn name(self) -> &'static str {
        match self {
            Class::Rapid => "rapid",
            Class::Feed => "feed",
            Class::Curve => "arc",
            Class::Other => "probe, tap",
        }
    }
    /// Red, green, blue.
    pub(super) fn color(self) -> [u8; 3] {
        match self {
            Class::Rapid => [226, 119, 38],
            Class::Feed => [24, 92, 190],
            Class::Curve => [15, 146, 106],
            Class::Other => [158, 54, 160],
        }
    }
    pub(super) fn of(op: &Op<'_>) -> Option<Class> {
        Some(match op {
            Op::Rapid => Class::Rapid,
            Op::Linear => Class::Feed,
            Op::Arc(_) | Op::Nurbs { .. } => Class::Curve,
            Op::Probe(_) | Op::RigidTap { .. } => Class::Other,
            _ => return None,
        })
    }
}

/// More points than this are not kept: beyond it curves become their chords.
const MOST_POINTS: usize = 30_000_000;

/// Points joined by lines; one run has one class.
pub struct Path {
    /// Class and index of the first point of each run.
    pub runs: Vec<(Class, u32)>,
    /// Points of all runs, one after the other. A run begins where its first move begins.
    pub points: Vec<[f32; 3]>,
    /// Size of the path.
    pub extent: Extent,
    /// Sums.
    pub totals: Totals,
}

/// Positions in the work frame the program moves in first, without tool offsets, so that moves under other
/// offsets stand where they belong.
pub(super) struct Common {
    first: Option<State>,
    here: State,
    same: bool,
}

fn offsets(state: &State) -> ([f64; 9], [f64; 9], f64) {
    (state.work_offset, state.local_offset, state.rotation)
}

impl Common {
    pub(super) fn new() -> Common {
        Common { first: None, here: State::default(), same: true }
    }
    pub(super) fn enter(&mut self, state: &State) {
        let mut state = *state;
        state.tool_offset = [0.0; 9];
        let first = self.first.get_or_insert(state);
        self.same = offsets(first) == offsets(&state);
        self.here = state;
    }
    pub(super) fn place(&self, axes: &[f64; 9]) -> [f64; 3] {
        match &self.first {
            Some(first) if !self.same => {
                let p = first.work_frame(&self.here.machine(axes));
                [p[0], p[1], p[2]]
            }
            _ => [axes[0], axes[1], axes[2]],
        }
    }
    /// Widens `extent` by a move: curves count as they are, not as they are drawn.
    fn reach(&self, view: &View<'_, '_>, from: &Pose, extent: &mut Extent) {
        extent.add(self.place(&from.axes));
        if self.same {
            extent.add_move(&view.op, from, view.end);
        } else {
            flatten(&view.op, from, view.end, 1e-3, |p| extent.add(self.place(p)));
        }
    }
}

impl Path {
    /// Takes the points of a program.
    pub fn new(program: &Program, rapids: bool, rates: &Rates) -> Path {
        let mut path =
            Path { runs: Vec::new(), points: Vec::new(), extent: Extent::default(), totals: Totals::default() };
        let tolerance = rough_size(program) / 4000.0;
        let mut common = Common::new();
        let (mut fresh, mut known) = (true, Known::default());
        let clock = Clock::new(program, rates);
        let mut cursor = program.cursor();
        while let Some(view) = cursor.next() {
            path.totals.add(&clock.measure(&view));
            let start = known.start(&view);
            match Class::of(&view.op) {
                Some(class) => {
                    if fresh {
                        common.enter(view.state);
                    }
                    if let Some(start) = start.filter(|_| rapids || class != Class::Rapid) {
                        path.add(&view, &start, class, &common, tolerance);
                    }
                    fresh = false;
                }
                None => fresh |= moves_frame(&view.op),
            }
        }
        path
    }

    fn add(&mut self, view: &View<'_, '_>, from: &Pose, class: Class, common: &Common, tolerance: f64) {
        let start = common.place(&from.axes);
        let joined = self.runs.last().is_some_and(|r| r.0 == class) && self.points.last() == Some(&single(start));
        if !joined {
            self.runs.push((class, u32::try_from(self.points.len()).unwrap_or(u32::MAX)));
            self.points.push(single(start));
            self.extent.add(start);
        }
        common.reach(view, from, &mut self.extent);
        let op = if self.points.len() < MOST_POINTS { view.op } else { Op::Linear };
        flatten(&op, from, view.end, tolerance, |p| self.points.push(single(common.place(p))));
    }

    /// The same with rapids as a machine makes them, where it makes them differently.
    pub(super) fn bent(mut self, trace: Option<&Trace>, rapids: bool) -> Path {
        let Some(trace) = trace.filter(|t| t.bent && !t.truncated) else { return self };
        self.runs.clear();
        self.points.clear();
        for (i, p) in trace.positions.iter().enumerate() {
            let Some(class) = Class::ALL.into_iter().find(|c| *c as u8 == trace.kinds[i]) else { continue };
            if i == 0 || class == Class::Rapid && !rapids {
                continue;
            }
            let from = trace.positions[i - 1];
            if self.runs.last().is_none_or(|r| r.0 != class) || self.points.last() != Some(&from) {
                self.runs.push((class, u32::try_from(self.points.len()).unwrap_or(u32::MAX)));
                self.points.push(from);
            }
            self.points.push(*p);
            self.extent.add(p.map(f64::from));
        }
        self
    }

    /// Runs with their points.
    pub fn runs(&self) -> impl Iterator<Item = (Class, &[[f32; 3]])> {
        self.runs.iter().enumerate().map(|(i, (class, start))| {
            let end = self.runs.get(i + 1).map_or(self.points.len(), |r| r.1 as usize);
            (*class, self.points.get(*start as usize..end).unwrap_or_default())
        })
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

pub(super) fn single(p: [f64; 3]) -> [f32; 3] {
    p.map(|v| v as f32)
}

pub(super) fn moves_frame(op: &Op<'_>) -> bool {
    matches!(op, Op::WorkOffset(..) | Op::LocalOffset(_) | Op::Rotation(_))
}

/// Largest side of the box around the ends of all moves: what curves are thinned by.
pub(super) fn rough_size(program: &Program) -> f64 {
    let mut extent = Extent::default();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        match view.op {
            Op::Arc(_) => extent.add_move(&view.op, view.start, view.end),
            op if op.moves() => extent.add(view.end.xyz()),
            _ => {}
        }
    }
    let size = extent.size().into_iter().fold(0.0, f64::max);
    if size.is_finite() { size.max(1e-3) } else { 1.0 }
}
