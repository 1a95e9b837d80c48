//! Time, length and extent of a program. Times are without acceleration unless the machine's limits are known
//! ([`Rates::dynamics`], [`Clock`]); sums are integers (ns, nm), so that the parts of a program add up to the whole in
//! any order.

use crate::geometry::{Extent, Length, length};
use crate::timing::{Clock, Dynamics};
use crate::{FeedMode, Marker, Op, Program, Source, State, Turn, View};

/// What the program does not say.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rates {
    /// Rapid rate, mm/s.
    pub rapid: f64,
    /// Rapid rate of rotary axes, rad/s.
    pub rapid_angular: f64,
    /// A tool change, s.
    pub tool_change: f64,
    /// What the machine can do, where it is known: rapids and feeds then take the time that the machine takes.
    pub dynamics: Option<Dynamics>,
}

impl Default for Rates {
    /// 6 m/min, 60°/s, tool change in no time.
    fn default() -> Rates {
        Rates { rapid: 100.0, rapid_angular: std::f64::consts::FRAC_PI_3, tool_change: 0.0, dynamics: None }
    }
}

/// Integer sums.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Totals {
    /// Operations.
    pub operations: u64,
    /// Rapids, taps and feed moves, probes.
    pub moves: u64,
    /// Time in rapids, ns.
    pub rapid_ns: u64,
    /// Time at feed, ns.
    pub feed_ns: u64,
    /// Time in dwells and tool changes, ns.
    pub wait_ns: u64,
    /// Way in rapids, nm.
    pub rapid_nm: u64,
    /// Way at feed, nm.
    pub feed_nm: u64,
    /// Moves at feed whose time is unknown because feed or spindle speed is 0: counted without time.
    pub untimed: u64,
}

impl Totals {
    /// All time, ns.
    pub fn ns(&self) -> u64 {
        self.rapid_ns.saturating_add(self.feed_ns).saturating_add(self.wait_ns)
    }
    /// All time, s.
    pub fn seconds(&self) -> f64 {
        self.ns() as f64 / 1e9
    }
    /// Adds another part.
    pub fn add(&mut self, other: &Totals) {
        self.operations += other.operations;
        self.moves += other.moves;
        self.rapid_ns = self.rapid_ns.saturating_add(other.rapid_ns);
        self.feed_ns = self.feed_ns.saturating_add(other.feed_ns);
        self.wait_ns = self.wait_ns.saturating_add(other.wait_ns);
        self.rapid_nm = self.rapid_nm.saturating_add(other.rapid_nm);
        self.feed_nm = self.feed_nm.saturating_add(other.feed_nm);
        self.untimed += other.untimed;
    }
}

/// A value in units of 1e-9, rounded; what is no number or negative counts 0.
pub(crate) fn nano(value: f64) -> u64 {
    // Casts from f64 saturate, and NaN gives 0.
    libm::round(value * 1e9) as u64
}

/// Speed of a feed move, mm/s (or rad/s).
pub(crate) fn speed(state: &State, view: &View<'_, '_>, angular: bool) -> f64 {
    if let Some(sync) = state.sync.filter(|s| !s.velocity) {
        return sync.per_rev * rpm(state, sync.spindle, view) / 60.0;
    }
    let feed = if angular { state.feed_angular } else { state.feed };
    match state.feed_mode {
        FeedMode::PerRev => feed * rpm(state, state.feed_spindle, view) / 60.0,
        _ => feed,
    }
}

fn rpm(state: &State, spindle: i32, view: &View<'_, '_>) -> f64 {
    let s = state.spindle(spindle);
    match s.surface {
        None => s.speed.abs(),
        Some(limit) => {
            let radius = ((view.start.axes[0] + view.end.axes[0]) / 2.0).abs();
            (s.speed.abs() * 60.0 / (std::f64::consts::TAU * radius)).min(limit.abs())
        }
    }
}

/// What one operation adds, taken alone: without acceleration. Programs are timed by a [`Clock`].
pub fn measure(view: &View<'_, '_>, rates: &Rates) -> Totals {
    let mut t = Totals { operations: 1, ..Totals::default() };
    match view.op {
        Op::Dwell(s) => t.wait_ns = nano(s),
        Op::ToolChange(_) => t.wait_ns = nano(rates.tool_change),
        Op::Rapid => {
            t.moves = 1;
            match length(&view.op, view.start, view.end) {
                Length::Linear(mm) => (t.rapid_ns, t.rapid_nm) = (nano(mm / rates.rapid), mm_to_nm(mm)),
                Length::Angular(rad) => t.rapid_ns = nano(rad / rates.rapid_angular),
            }
        }
        op if op.feeds() || matches!(op, Op::Probe(_) | Op::RigidTap { .. }) => {
            t.moves = 1;
            feed_move(view, &mut t);
        }
        _ => {}
    }
    t
}

fn mm_to_nm(mm: f64) -> u64 {
    libm::round(mm * 1e6) as u64
}

fn feed_move(view: &View<'_, '_>, t: &mut Totals) {
    let (way, speed) = match length(&view.op, view.start, view.end) {
        Length::Linear(mm) => {
            t.feed_nm = mm_to_nm(mm);
            (mm, speed(view.state, view, false))
        }
        Length::Angular(rad) => (rad, speed(view.state, view, true)),
    };
    if way == 0.0 {
        return;
    }
    let inverse = view.state.feed_mode == FeedMode::Inverse && view.state.sync.is_none();
    let seconds = if inverse { 1.0 / speed } else { way / speed };
    if seconds.is_finite() && speed > 0.0 {
        t.feed_ns = nano(seconds);
    } else {
        t.untimed = 1;
    }
}

/// Smallest and largest of a number.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Range(pub Option<(f64, f64)>);

impl Range {
    fn add(&mut self, v: f64) {
        let (low, high) = self.0.unwrap_or((v, v));
        self.0 = Some((low.min(v), high.max(v)));
    }
}

/// What one tool does.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ToolUse {
    /// Number; -1 = before any tool was named.
    pub tool: i32,
    /// How often it was changed in.
    pub changes: u32,
    /// Where first.
    pub first: Source,
    /// Sums.
    pub totals: Totals,
    /// Where it is at feed, in the work frame.
    pub cut: Extent,
    /// Spindle speeds while at feed, rpm.
    pub rpm: Range,
    /// Surface speeds while at feed, mm/s.
    pub surface: Range,
    /// Feeds, mm/s.
    pub feed: Range,
    /// Feeds, mm per revolution.
    pub feed_per_rev: Range,
    /// Feeds per minute of moves of rotary axes alone, rad/s.
    pub feed_angular: Range,
    /// The same per revolution, rad.
    pub feed_angular_per_rev: Range,
    /// Tool offsets used (Z, mm).
    pub offset_z: Range,
    /// Work offsets used, 1 = G54: bit n.
    pub work: u16,
    /// Coolant used while at feed: flood, mist.
    pub coolant: (bool, bool),
    /// Diameter from the program's own tool table rows, mm.
    pub diameter: Option<f64>,
    /// Comment at its change.
    pub note: Option<String>,
}

/// A stretch between markers.
#[derive(Clone, PartialEq, Debug)]
pub struct Stretch {
    /// Kind.
    pub marker: Marker,
    /// Number.
    pub code: i32,
    /// Name.
    pub text: String,
    /// Where it begins.
    pub source: Source,
    /// Sums.
    pub totals: Totals,
}

/// Passes of one kind of canned cycle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CycleUse {
    /// G-code times ten.
    pub code: i32,
    /// How often.
    pub passes: u64,
    /// Sums.
    pub totals: Totals,
}

/// Everything measured.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Report {
    /// Sums.
    pub totals: Totals,
    /// Feed moves, work frame of the moment.
    pub cut: Extent,
    /// All moves, work frame of the moment.
    pub all: Extent,
    /// All moves, machine frame (ends of moves and points of curves within 1 µm).
    pub machine: Extent,
    /// Tools in the order of first use.
    pub tools: Vec<ToolUse>,
    /// Work offsets used for motion: number and values.
    pub offsets: Vec<(u8, crate::Axes)>,
    /// Workingsteps, features and the like, in order.
    pub stretches: Vec<Stretch>,
    /// Canned cycles, by code.
    pub cycles: Vec<CycleUse>,
    /// Something depends on values known only at run time.
    pub run_time: bool,
}

/// Measures a program.
pub fn report(program: &Program, rates: &Rates) -> Report {
    let mut run =
        Run { known: Known::default(), out: Report::default(), tool: 0, open: Vec::new(), cycle: None, offset: None };
    run.select(program.start_state().tool, Source::default());
    let clock = Clock::new(program, rates);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        run.step(&view, &clock);
    }
    let mut out = run.out;
    out.tools.retain(|t| t.tool >= 0 || t.totals.moves > 0);
    out.cycles.sort_by_key(|c| c.code);
    out
}

/// Which coordinates of the tool the program has said. Before its first moves, and along Z after a tool offset
/// has changed, the tool stands where the operator or the changer left it: rapids from there are no part of
/// the path.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Known([bool; 3]);

impl Known {
    /// Where a move may be taken to begin: none when even its end is not known yet. Call for every operation.
    pub fn start(&mut self, view: &View<'_, '_>) -> Option<crate::Pose> {
        let (from, to) = (&view.start.axes, &view.end.axes);
        if matches!(view.op, Op::ToolOffset { .. }) {
            for i in 0..3 {
                self.0[i] &= from[i] == to[i];
            }
        }
        if !view.op.moves() {
            return Some(*view.start);
        }
        let before = self.0;
        for i in 0..3 {
            self.0[i] |= from[i] != to[i] || view.op != Op::Rapid;
        }
        if view.op != Op::Rapid {
            return Some(*view.start);
        }
        let mut start = *view.start;
        for i in 0..3 {
            if !before[i] {
                start.axes[i] = to[i];
            }
        }
        (0..3).all(|i| self.0[i] || to[i] == 0.0).then_some(start)
    }
}

struct Run {
    known: Known,
    out: Report,
    tool: usize,
    open: Vec<usize>,
    cycle: Option<usize>,
    offset: Option<(u8, crate::Axes)>,
}

impl Run {
    fn step(&mut self, view: &View<'_, '_>, clock: &Clock) {
        match view.op {
            Op::ToolChange(_) | Op::ToolNumber(_) => {
                self.select(view.state.tool, view.source);
                self.out.tools[self.tool].changes += 1;
            }
            Op::ToolEntry { tool, diameter, .. } => {
                if let Some(t) = self.out.tools.iter_mut().find(|t| t.tool == tool) {
                    t.diameter = Some(diameter);
                }
            }
            Op::Begin { marker, code, text } => self.begin(marker, code, text, view.source),
            Op::RunTime(_) | Op::InputWait { .. } | Op::Probe(_) => self.out.run_time = true,
            _ => {}
        }
        let t = clock.measure(view);
        self.out.totals.add(&t);
        self.out.tools[self.tool].totals.add(&t);
        for i in &self.open {
            self.out.stretches[*i].totals.add(&t);
        }
        if let Some(i) = self.cycle {
            self.out.cycles[i].totals.add(&t);
        }
        if let (Some(start), true) = (self.known.start(view), t.moves > 0) {
            self.moved(view, &start);
        }
        if let Op::Close(marker) = view.op {
            self.close(marker);
        }
    }

    fn select(&mut self, tool: i32, first: Source) {
        let found = self.out.tools.iter().position(|t| t.tool == tool);
        self.tool = found.unwrap_or_else(|| {
            self.out.tools.push(ToolUse { tool, first, ..ToolUse::default() });
            self.out.tools.len() - 1
        });
    }

    fn begin(&mut self, marker: Marker, code: i32, text: &str, source: Source) {
        if marker == Marker::Contour {
            return;
        }
        if marker != Marker::Cycle {
            self.open.push(self.out.stretches.len());
            let totals = Totals::default();
            self.out.stretches.push(Stretch { marker, code, text: text.to_owned(), source, totals });
            return;
        }
        let found = self.out.cycles.iter().position(|c| c.code == code);
        let at = found.unwrap_or_else(|| {
            self.out.cycles.push(CycleUse { code, passes: 0, totals: Totals::default() });
            self.out.cycles.len() - 1
        });
        self.out.cycles[at].passes += 1;
        self.cycle = Some(at);
    }

    fn close(&mut self, marker: Marker) {
        if marker == Marker::Cycle {
            self.cycle = None;
        } else if let Some(i) = self.open.iter().rposition(|i| self.out.stretches[*i].marker == marker) {
            self.open.remove(i);
        }
    }

    fn moved(&mut self, view: &View<'_, '_>, start: &crate::Pose) {
        let mut extent = Extent::default();
        extent.add_move(&view.op, start, view.end);
        self.out.all.join(&extent);
        self.machine_extent(view, start, &extent);
        let here = (view.state.work, view.state.work_offset);
        if self.offset != Some(here) {
            self.offset = Some(here);
            if !self.out.offsets.contains(&here) {
                self.out.offsets.push(here);
            }
        }
        let tool = &mut self.out.tools[self.tool];
        tool.work |= 1 << view.state.work.min(15);
        if view.op == Op::Rapid {
            return;
        }
        self.out.cut.join(&extent);
        tool.cut.join(&extent);
        conditions(tool, view);
    }

    fn machine_extent(&mut self, view: &View<'_, '_>, start: &crate::Pose, extent: &Extent) {
        if view.state.rotation == 0.0 {
            // Without rotation the frames differ by a shift.
            for corner in [extent.min, extent.max] {
                self.out.machine.add(shifted(view.state, corner));
            }
            return;
        }
        self.out.machine.add(shifted(view.state, start.xyz()));
        crate::geometry::flatten(&view.op, start, view.end, 1e-3, |p| {
            self.out.machine.add(shifted(view.state, [p[0], p[1], p[2]]));
        });
    }
}

fn shifted(state: &State, p: [f64; 3]) -> [f64; 3] {
    let m = state.machine(&[p[0], p[1], p[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    [m[0], m[1], m[2]]
}

fn conditions(tool: &mut ToolUse, view: &View<'_, '_>) {
    let state = view.state;
    let turns = matches!(length(&view.op, view.start, view.end), Length::Angular(_));
    match (state.feed_mode, turns) {
        (FeedMode::PerTime, false) => tool.feed.add(state.feed),
        (FeedMode::PerTime, true) => tool.feed_angular.add(state.feed_angular),
        (FeedMode::PerRev, false) => tool.feed_per_rev.add(state.feed),
        (FeedMode::PerRev, true) => tool.feed_angular_per_rev.add(state.feed_angular),
        (FeedMode::Inverse, _) => {}
    }
    for spindle in state.spindles.iter().filter(|s| s.turn != Turn::Stop) {
        match spindle.surface {
            None => tool.rpm.add(spindle.speed),
            Some(_) => tool.surface.add(spindle.speed),
        }
    }
    tool.offset_z.add(state.tool_offset[2]);
    tool.coolant.0 |= state.flood;
    tool.coolant.1 |= state.mist;
}
