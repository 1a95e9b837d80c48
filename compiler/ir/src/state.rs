//! What is in force while an operation runs: the sum of the state operations before it.

use crate::{Axes, FeedMode, Op, Override, PathMode, Plane, Pose, Turn, Units};

/// How motion follows a spindle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sync {
    /// Spindle.
    pub spindle: i32,
    /// mm per revolution.
    pub per_rev: f64,
    /// Speed only, not position (G95).
    pub velocity: bool,
}

/// One spindle.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Spindle {
    /// rpm, or mm/s of surface speed.
    pub speed: f64,
    /// rpm limit when the speed is a surface speed.
    pub surface: Option<f64>,
    /// Direction.
    pub turn: Turn,
}

/// The state in force.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct State {
    /// Length unit of the program (values are mm).
    pub units: Units,
    /// Working plane.
    pub plane: Plane,
    /// Feed mode.
    pub feed_mode: FeedMode,
    /// Spindle that feed per revolution refers to.
    pub feed_spindle: i32,
    /// Feed: mm/s, mm/rev, 1/s.
    pub feed: f64,
    /// Feed of rotary moves: rad/s, rad/rev, 1/s.
    pub feed_angular: f64,
    /// Path control.
    pub path: PathMode,
    /// Tolerance for merging short lines, mm.
    pub merge_tolerance: f64,
    /// Synchronised motion.
    pub sync: Option<Sync>,
    /// Spindles 0 … 7.
    pub spindles: [Spindle; 8],
    /// Mist is on.
    pub mist: bool,
    /// Flood is on.
    pub flood: bool,
    /// Last T.
    pub prepared: i32,
    /// Tool in the spindle; -1: none named yet.
    pub tool: i32,
    /// Tool offset, mm and rad.
    pub tool_offset: Axes,
    /// Number of the work offset, 1 = G54.
    pub work: u8,
    /// Work offset.
    pub work_offset: Axes,
    /// G92/G52 offset.
    pub local_offset: Axes,
    /// Rotation of the work frame about Z, rad.
    pub rotation: f64,
    /// Feed override is free.
    pub feed_override: bool,
    /// Speed override is free, spindles as bits.
    pub speed_override: u8,
    /// Adaptive feed.
    pub adaptive: bool,
    /// Feed hold.
    pub feed_hold: bool,
    turned: [f64; 2],
}

impl Default for State {
    fn default() -> State {
        State {
            units: Units::Mm,
            plane: Plane::Xy,
            feed_mode: FeedMode::PerTime,
            feed_spindle: 0,
            feed: 0.0,
            feed_angular: 0.0,
            path: PathMode::ExactPath,
            merge_tolerance: 0.0,
            sync: None,
            spindles: [Spindle::default(); 8],
            mist: false,
            flood: false,
            prepared: -1,
            tool: -1,
            tool_offset: [0.0; 9],
            work: 1,
            work_offset: [0.0; 9],
            local_offset: [0.0; 9],
            rotation: 0.0,
            feed_override: true,
            speed_override: 0xff,
            adaptive: false,
            feed_hold: true,
            turned: [1.0, 0.0],
        }
    }
}

impl State {
    /// Work frame → machine frame: add the local offset, turn about Z, add work offset and tool offset.
    pub fn machine(&self, p: &Axes) -> Axes {
        let mut m = *p;
        for (v, d) in m.iter_mut().zip(&self.local_offset) {
            *v += d;
        }
        let [c, s] = self.turned;
        (m[0], m[1]) = (m[0] * c - m[1] * s, m[0] * s + m[1] * c);
        for (i, v) in m.iter_mut().enumerate() {
            *v += self.work_offset[i] + self.tool_offset[i];
        }
        m
    }

    /// Machine frame → work frame.
    pub fn work_frame(&self, m: &Axes) -> Axes {
        let mut p = *m;
        for (i, v) in p.iter_mut().enumerate() {
            *v -= self.work_offset[i] + self.tool_offset[i];
        }
        let [c, s] = self.turned;
        (p[0], p[1]) = (p[0] * c + p[1] * s, p[1] * c - p[0] * s);
        for (v, d) in p.iter_mut().zip(&self.local_offset) {
            *v -= d;
        }
        p
    }

    /// The direction of a work-frame vector in the machine frame.
    pub fn machine_direction(&self, v: [f64; 3]) -> [f64; 3] {
        let [c, s] = self.turned;
        [v[0] * c - v[1] * s, v[0] * s + v[1] * c, v[2]]
    }

    /// The spindle of this number (a number out of range: the first).
    pub fn spindle(&self, number: i32) -> &Spindle {
        usize::try_from(number).ok().and_then(|n| self.spindles.get(n)).unwrap_or(&self.spindles[0])
    }

    /// Whether any spindle turns.
    pub fn turning(&self) -> bool {
        self.spindles.iter().any(|s| s.turn != Turn::Stop)
    }

    /// Whether an operation moves the frame positions are written in.
    pub(crate) fn moves_frame(op: &Op<'_>) -> bool {
        matches!(op, Op::ToolOffset { .. } | Op::WorkOffset(..) | Op::LocalOffset(_) | Op::Rotation(_))
    }

    /// Takes over what the operation sets. When it moves the frame, the pose is written anew: the machine
    /// stands still, its coordinates change.
    pub fn apply(&mut self, op: &Op<'_>, pose: &mut Pose) {
        if State::moves_frame(op) {
            let before = *self;
            self.set(op);
            self.rewrite(&before, pose);
        } else {
            self.set(op);
        }
    }

    fn rewrite(&self, before: &State, pose: &mut Pose) {
        let there = self.work_frame(&before.machine(&pose.axes));
        let same = |i: usize| {
            self.tool_offset[i] == before.tool_offset[i]
                && self.work_offset[i] == before.work_offset[i]
                && self.local_offset[i] == before.local_offset[i]
        };
        let plain = self.turned == before.turned && self.turned == [1.0, 0.0];
        let xy_same = same(0) && same(1) && self.turned == before.turned;
        for (i, v) in there.into_iter().enumerate() {
            // An axis whose offsets did not change keeps its value to the last bit.
            let keep = if i < 2 && !plain { xy_same } else { same(i) };
            if !keep {
                pose.axes[i] = v;
            }
        }
    }

    fn spindle_mut(&mut self, number: i32) -> &mut Spindle {
        let n = usize::try_from(number).unwrap_or(0).min(7);
        &mut self.spindles[n]
    }

    fn set(&mut self, op: &Op<'_>) {
        match *op {
            Op::Units(u) => self.units = u,
            Op::Plane(p) => self.plane = p,
            Op::FeedMode { spindle, mode } => (self.feed_spindle, self.feed_mode) = (spindle, mode),
            Op::Feed { linear, angular } => (self.feed, self.feed_angular) = (linear, angular),
            Op::PathMode(p) => self.path = p,
            Op::MergeTolerance(t) => self.merge_tolerance = t,
            Op::SyncStart(s) => self.sync = Some(s),
            Op::SyncStop => self.sync = None,
            Op::SpindleMode { spindle, surface } => self.spindle_mut(spindle).surface = surface,
            Op::SpindleSpeed { spindle, speed } => self.spindle_mut(spindle).speed = speed,
            Op::SpindleTurn { spindle, turn } => self.spindle_mut(spindle).turn = turn,
            Op::SpindleOrient { spindle, .. } => self.spindle_mut(spindle).turn = Turn::Stop,
            Op::Mist(on) => self.mist = on,
            Op::Flood(on) => self.flood = on,
            Op::ToolPrepare(t) => self.prepared = t,
            Op::ToolChange(_) => self.tool = self.prepared,
            Op::ToolNumber(t) => self.tool = t,
            Op::ToolOffset { offset, .. } => self.tool_offset = offset,
            Op::WorkOffset(n, o) => (self.work, self.work_offset) = (n, o),
            Op::LocalOffset(o) => self.local_offset = o,
            Op::Rotation(r) => {
                self.rotation = r;
                self.turned = [libm::cos(r), libm::sin(r)];
            }
            Op::Override(which, on) => self.set_override(which, on),
            Op::End => self.end(),
            _ => {}
        }
    }

    fn set_override(&mut self, which: Override, on: bool) {
        match which {
            Override::Feed => self.feed_override = on,
            Override::Adaptive => self.adaptive = on,
            Override::FeedHold => self.feed_hold = on,
            Override::Speed(n) => {
                let bit = 1u8 << n.clamp(0, 7);
                self.speed_override = if on { self.speed_override | bit } else { self.speed_override & !bit };
            }
        }
    }

    fn end(&mut self) {
        for spindle in &mut self.spindles {
            spindle.turn = Turn::Stop;
        }
        (self.mist, self.flood) = (false, false);
    }
}

/// The axes of a plane: first, second, and the one along its normal (indices into X Y Z). The planes of
/// U V W are taken as those of X Y Z.
pub fn plane_axes(plane: Plane) -> (usize, usize, usize) {
    match plane {
        Plane::Xy | Plane::Uv => (0, 1, 2),
        Plane::Xz | Plane::Uw => (2, 0, 1),
        Plane::Yz | Plane::Vw => (1, 2, 0),
    }
}
