//! The way of the tool to where a program begins later: up, over the place and down; on a lathe from outside, in a bore
//! from the front. Rapids go no lower than the program's own, the rest is fed.

use gr_ir::{FeedMode, Op, Plane, Pose, Program, State, Turn};

use super::{Restore, Room, UPRIGHT, V3, axes_used};

/// How far before the place rapid ends and feed begins, mm.
const CLEARANCE: f64 = 2.0;

/// What an approach goes by.
pub(super) struct Approach<'a> {
    pub program: &'a Program,
    /// The first operation that follows.
    pub index: usize,
    /// What is in force there.
    pub state: &'a State,
    pub goal: Pose,
    /// Axes that go there; of the others nobody knows where they are.
    pub approached: [bool; 9],
    /// It goes no further down than the safe height.
    pub stays_up: bool,
    /// Direction from the tool point to the spindle, where that isn't Z.
    pub tilt: Option<V3>,
    /// How high and how far out.
    pub room: &'a Room,
}

/// Places of an approach, one after the other.
struct Ways {
    at: Pose,
    approached: [bool; 9],
    places: Vec<Pose>,
    /// Before which of them the spindle starts: over the place, and not where the tool stood.
    start: usize,
}

impl Ways {
    fn go(&mut self, axes: impl IntoIterator<Item = usize>, to: impl Fn(usize) -> f64) {
        for i in axes.into_iter().filter(|i| self.approached[*i]) {
            self.at.axes[i] = to(i);
        }
        self.places.push(self.at);
    }
}

impl Approach<'_> {
    /// Writes the moves behind what is restored; `start` restores spindles and coolant on the way.
    pub fn make(&self, restore: &mut Restore, start: impl Fn(&mut Restore)) {
        let mut ways = Ways { at: *restore.out.pose(), approached: self.approached, places: Vec::new(), start: 0 };
        if self.approached[0] && is_lathe(self.program) {
            self.turning(&mut ways);
        } else if let Some(up) = self.tilt {
            self.along(&mut ways, up);
        } else {
            self.from_above(&mut ways);
        }
        for (i, place) in ways.places.iter().enumerate() {
            if i == ways.start {
                start(restore);
            }
            if place != restore.out.pose() {
                restore.out.push_to(Op::Rapid, place, restore.source);
            }
        }
        let mut end = *restore.out.pose();
        (0..9).filter(|i| self.approached[*i]).for_each(|i| end.axes[i] = self.goal.axes[i]);
        if end != *restore.out.pose() && !self.stays_up {
            self.go_in(restore, &end);
        }
    }

    fn from_above(&self, ways: &mut Ways) {
        let (height, safe) = (self.goal.axes[2], self.room.safe);
        ways.go([2], |_| safe);
        ways.go((0..9).filter(|i| *i != 2), |i| self.goal.axes[i]);
        ways.start = ways.places.len();
        let rapids = self.room.lowest.unwrap_or(safe);
        ways.go([2], |_| if height < safe { (height + CLEARANCE).max(rapids).min(safe) } else { safe });
    }

    /// Beside a tilted tool the rotary axes turn first, where the machine stands.
    fn along(&self, ways: &mut Ways, up: V3) {
        let height: f64 = (0..3).map(|i| self.goal.axes[i] * up[i]).sum();
        let safe = self.room.safe;
        let over = |to: f64| move |i: usize| self.goal.axes[i] + up[i] * (to - height);
        ways.go(3..9, |i| self.goal.axes[i]);
        if self.stays_up || (0..3).any(|i| !self.approached[i] && up[i].abs() > UPRIGHT) {
            // The program says that height itself before it cuts; up there it goes on.
            ways.start = ways.places.len();
            return ways.go(0..3, |i| self.goal.axes[i]);
        }
        ways.go(0..3, over(safe));
        ways.start = ways.places.len();
        let rapids = self.room.lowest.unwrap_or(safe);
        ways.go(0..3, over((height + CLEARANCE).max(rapids).min(safe)));
    }

    fn turning(&self, ways: &mut Ways) {
        let goal = |i: usize| self.goal.axes[i];
        let rapid = last_rapid(self.program, self.index);
        let radius = rapid.map_or(goal(0), |p| p.axes[0]);
        let beside = (1..9).filter(|i| *i != 2);
        if is_bore(self.program, self.index) {
            // From the front, at the radius where the program goes by rapid.
            ways.go([2], |_| self.room.safe);
            ways.go([0], |_| radius.min(goal(0) - CLEARANCE));
            ways.go(beside, goal);
            ways.start = ways.places.len();
            ways.go([2], goal);
            return;
        }
        // From outside: along Z where no stock is, then in as the program came.
        let out = self.room.out.max(radius);
        let there = rapid.is_some_and(|p| p.axes == self.goal.axes);
        ways.go([0], |_| out);
        ways.go(beside, goal);
        ways.go([2], goal);
        ways.start = ways.places.len();
        ways.go([0], |i| if there { goal(i) } else { radius.max(goal(i) + CLEARANCE) });
    }

    /// The last piece: at the feed in force, by rapid where the program was by rapid, else at a feed that it has elsewhere.
    fn go_in(&self, restore: &mut Restore, end: &Pose) {
        let s = self.state;
        let turns = s.spindles.iter().any(|s| s.turn != Turn::Stop && s.speed != 0.0);
        if s.feed > 0.0 && (s.feed_mode == FeedMode::PerTime || s.feed_mode == FeedMode::PerRev && turns) {
            return restore.out.push_to(Op::Linear, end, restore.source);
        }
        if last_rapid(self.program, self.index).is_some_and(|p| p.axes == self.goal.axes) {
            return restore.out.push_to(Op::Rapid, end, restore.source);
        }
        restore.push(Op::FeedMode { spindle: s.feed_spindle, mode: FeedMode::PerTime });
        restore.push(Op::Feed { linear: feed_elsewhere(self.program, self.index), angular: s.feed_angular });
        restore.out.push_to(Op::Linear, end, restore.source);
        restore.push(Op::FeedMode { spindle: s.feed_spindle, mode: s.feed_mode });
        restore.push(Op::Feed { linear: s.feed, angular: s.feed_angular });
    }
}

/// Turning: the first cut is in the plane of X and Z, and nothing ever moves in Y.
pub(crate) fn is_lathe(program: &Program) -> bool {
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if view.op.feeds() {
            return view.state.plane == Plane::Xz && !axes_used(program)[1];
        }
    }
    false
}

/// Turning from within: with the tool of an operation, half way into the part, rapids go at smaller radii than cuts.
fn is_bore(program: &Program, index: usize) -> bool {
    let change = |s: &gr_ir::Step<'_>| matches!(s.op, Op::ToolChange(_) | Op::ToolNumber(_));
    let from = program.steps().take(index).filter(change).last().map_or(0, |s| s.index + 1);
    let to = program.steps().skip(index).find(change).map_or(program.len(), |s| s.index);
    let moves = || program.steps().skip(from).take(to - from).filter(|s| s.op.moves());
    let heights = moves().filter(|s| s.op.feeds()).flat_map(|s| [s.start.axes[2], s.end.axes[2]]);
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
    let half = (low + high) / 2.0;
    // Mean radius where moves cross that height.
    let mean = |feeds: bool| {
        let crosses = |s: &gr_ir::Step<'_>| s.op.feeds() == feeds && (s.start.axes[2] - half) * (s.end.axes[2] - half) < 0.0;
        let (n, sum) = moves().filter(crosses).fold((0.0, 0.0), |(n, sum), s| (n + 1.0, sum + s.start.axes[0] + s.end.axes[0]));
        (n > 0.0).then(|| sum / n)
    };
    matches!((mean(false), mean(true)), (Some(rapids), Some(cuts)) if rapids < cuts)
}

/// Where the last rapid before an operation ended: the program says that nothing is there.
fn last_rapid(program: &Program, index: usize) -> Option<Pose> {
    program.steps().take(index).filter(|s| s.op == Op::Rapid && s.start.axes != s.end.axes).last().map(|s| s.end)
}

/// The greatest X of the whole program, in the work frame of a state.
pub(super) fn outmost(program: &Program, state: &State) -> f64 {
    let zero = state.machine(&[0.0; 9])[0];
    let mut most = f64::NEG_INFINITY;
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if view.op.moves() {
            most = most.max(view.state.machine(&view.end.axes)[0] - zero);
        }
    }
    most
}

/// Feed of an approach in programs that never say one per minute, mm/s.
const SLOW: f64 = 100.0 / 60.0;

/// The first feed per minute behind an operation, else the last before it.
fn feed_elsewhere(program: &Program, index: usize) -> f64 {
    let mut cursor = program.cursor();
    let mut found = None;
    while let Some(view) = cursor.next() {
        if view.op.feeds() && view.state.feed_mode == FeedMode::PerTime && view.state.feed > 0.0 {
            found = Some(view.state.feed);
            if view.index >= index {
                break;
            }
        }
    }
    found.unwrap_or(SLOW)
}
