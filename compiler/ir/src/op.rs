//! The operations of the motion IR and what they are made of. Plain data; how it is stored is `store`'s.

use crate::{Axes, FileId, FrameId, Plane, Units};

/// Where the tool is, in the work frame: X Y Z (mm) A B C (rad) U V W (mm), and for programs made from
/// features rather than axis words, the tool's axis and the spin about it.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pose {
    /// X Y Z A B C U V W: mm and rad, rotary words as programmed (no wrap).
    pub axes: Axes,
    /// Unit vector from tip to shank, where the program states one.
    pub tool_axis: Option<[f64; 3]>,
    /// Rotation about the tool axis, rad, where it matters.
    pub spin: Option<f64>,
}

impl Pose {
    /// The pose with these axis values and nothing else.
    pub fn at(axes: Axes) -> Pose {
        Pose { axes, tool_axis: None, spin: None }
    }
    /// X Y Z.
    pub fn xyz(&self) -> [f64; 3] {
        [self.axes[0], self.axes[1], self.axes[2]]
    }
}

/// Where an operation comes from.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Source {
    /// File.
    pub file: FileId,
    /// Line, from 0.
    pub line: u32,
    /// The calls and loop passes that led there.
    pub frame: FrameId,
}

/// The plane an arc lies in (its normal gives the sense of positive turns).
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ArcPlane {
    /// A plane of the work frame.
    Work(Plane),
    /// Any plane: its unit normal.
    Free([f64; 3]),
}

/// A circular arc or helix from the start pose to the end pose; axes outside the plane go along linearly.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Arc {
    /// Plane.
    pub plane: ArcPlane,
    /// Centre. In a work plane the coordinate along the normal is that of the start.
    pub center: [f64; 3],
    /// Turns begun: > 0 counter-clockwise seen against the normal, < 0 clockwise; ±1 is at most one full turn.
    pub turns: i32,
}

/// What the feed means.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[repr(u8)]
pub enum FeedMode {
    /// G94: per time.
    #[default]
    PerTime = 0,
    /// G95: per revolution of a spindle.
    PerRev = 1,
    /// G93: the move takes 1 / feed.
    Inverse = 2,
}

/// How the path is followed.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum PathMode {
    /// G61.1.
    ExactStop,
    /// G61.
    #[default]
    ExactPath,
    /// G64 with a tolerance in mm; 0 = none given.
    Blend(f64),
}

/// What a spindle does.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[repr(i8)]
pub enum Turn {
    /// M5.
    #[default]
    Stop = 0,
    /// M3.
    Cw = 1,
    /// M4.
    Ccw = -1,
}

/// A switch of the operator's panel that a program may lock.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Override {
    /// M48 M49 M50.
    Feed,
    /// M48 M49 M51, spindle.
    Speed(i32),
    /// M52.
    Adaptive,
    /// M53.
    FeedHold,
}

/// Words for people.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum Note {
    /// A comment.
    Comment,
    /// Shown to the operator.
    Message,
    /// Written to the log.
    Log,
    /// The log's name, from its start.
    LogOpen,
    /// The log's name, at its end.
    LogAppend,
}

/// Why the machine waits for the operator.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum Stop {
    /// M0.
    Program,
    /// M1.
    Optional,
    /// M60.
    Pallet,
}

/// Kinds of stretches that belong together.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum Marker {
    /// All work of one tool.
    Tool,
    /// One pass of a canned cycle; its number is the G-code times ten.
    Cycle,
    /// A workingstep of a STEP-NC program.
    Workingstep,
    /// A manufacturing feature.
    Feature,
    /// A tolerance that holds for the stretch.
    Tolerance,
    /// Passes beside a wall; its number is 41 with the wall on the right of the way, 42 on the left, its text the
    /// radius of the tool, mm.
    Contour,
}

/// One operation. For motion the end pose stands beside it (see [`crate::View`]).
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Op<'a> {
    /// Rapid to the end pose.
    Rapid,
    /// Feed in a straight line to the end pose.
    Linear,
    /// Feed along an arc or helix to the end pose.
    Arc(Arc),
    /// Feed along a NURBS in the XY plane to the end pose.
    Nurbs {
        /// Degree + 1.
        order: u32,
        /// Control points: x, y (mm), weight; one after the other.
        points: &'a [f64],
    },
    /// Probe towards the end pose; where it stops is known only at run time.
    Probe(u8),
    /// G33.1 to a point and back.
    RigidTap {
        /// Bottom.
        bottom: [f64; 3],
        /// Factor on the way back.
        scale: f64,
    },
    /// Wait, s.
    Dwell(f64),
    /// Motion follows the spindle.
    SyncStart(Sync),
    /// Motion is free again.
    SyncStop,
    /// The probe is looked at (true) or not.
    ProbeMode(bool),

    /// The program's length unit (for people and back ends: values here are mm always).
    Units(Units),
    /// Working plane.
    Plane(Plane),
    /// What feeds mean from here on; the spindle counts for [`FeedMode::PerRev`].
    FeedMode {
        /// Spindle.
        spindle: i32,
        /// Mode.
        mode: FeedMode,
    },
    /// Feed: mm/s, mm/rev or 1/s as the feed mode says.
    Feed {
        /// Of the tool point.
        linear: f64,
        /// Of rotary axes when only they move: rad/s, rad/rev or 1/s.
        angular: f64,
    },
    /// The feed is that of X Y Z.
    FeedReferenceXyz,
    /// Path control.
    PathMode(PathMode),
    /// Tolerance for merging short lines, mm.
    MergeTolerance(f64),
    /// Which planner blends moves: the trapezoidal one, or the smooth one with how sharp it may corner (0.1 … 1).
    Planner(Option<f64>),

    /// G96/G97: with a limit in rpm the speed is a surface speed, without one it is in rpm.
    SpindleMode {
        /// Spindle.
        spindle: i32,
        /// rpm limit of constant surface speed.
        surface: Option<f64>,
    },
    /// rpm, or mm/s of surface speed.
    SpindleSpeed {
        /// Spindle.
        spindle: i32,
        /// Speed.
        speed: f64,
    },
    /// M3 M4 M5.
    SpindleTurn {
        /// Spindle.
        spindle: i32,
        /// Direction.
        turn: Turn,
    },
    /// M19.
    SpindleOrient {
        /// Spindle.
        spindle: i32,
        /// rad.
        angle: f64,
        /// 0 shortest, 1 clockwise, 2 counter-clockwise.
        direction: i32,
    },
    /// Wait until it is oriented, at most this long, s.
    SpindleWait {
        /// Spindle.
        spindle: i32,
        /// s.
        timeout: f64,
    },
    /// M7, M9.
    Mist(bool),
    /// M8, M9.
    Flood(bool),

    /// T.
    ToolPrepare(i32),
    /// M6 begins.
    ToolChangeStart,
    /// M6: the prepared tool comes from this pocket.
    ToolChange(i32),
    /// M61: this tool is in the spindle.
    ToolNumber(i32),
    /// The tool table was written anew.
    ToolReload,
    /// One row of the tool table.
    ToolEntry {
        /// Pocket.
        pocket: i32,
        /// Tool.
        tool: i32,
        /// Offset.
        offset: Axes,
        /// Diameter, mm.
        diameter: f64,
        /// rad.
        front: f64,
        /// rad.
        back: f64,
        /// Lathe tool orientation 0 … 9.
        orientation: i32,
    },
    /// G43 and its like.
    ToolOffset {
        /// Offset.
        offset: Axes,
        /// The number that asks for it (H), if one does.
        number: Option<u32>,
    },
    /// Work offset: 1 = G54 … 9 = G59.3.
    WorkOffset(u8, Axes),
    /// G10: a work offset that is not in force is stored for later.
    StoredOffset {
        /// 1 = G54 … 9 = G59.3.
        number: u8,
        /// Its values from now on.
        offset: Axes,
        /// Its rotation about Z, rad.
        rotation: f64,
    },
    /// G92, G52.
    LocalOffset(Axes),
    /// Rotation of the work frame about Z, rad.
    Rotation(f64),

    /// A panel switch is free (true) or locked.
    Override(Override, bool),
    /// Digital output.
    DigitalOut {
        /// Number.
        index: i32,
        /// Level.
        on: bool,
        /// With the next motion (M62, M63) rather than at once (M64, M65).
        synced: bool,
    },
    /// Analog output.
    AnalogOut {
        /// Number.
        index: i32,
        /// Value.
        value: f64,
        /// With the next motion (M67) rather than at once (M68).
        synced: bool,
    },
    /// M66: its result is known only at run time.
    InputWait {
        /// Number.
        index: i32,
        /// Digital or analog.
        digital: bool,
        /// 0 at once, 1 rise, 2 fall, 3 high, 4 low.
        wait: i32,
        /// s.
        timeout: f64,
    },
    /// Values from here on depend on this, which is known only at run time.
    RunTime(&'a str),
    /// Words.
    Note(Note, &'a str),
    /// (LOGCLOSE).
    LogClose,
    /// M100 … M199.
    UserM {
        /// Its number.
        code: i32,
        /// P.
        p: f64,
        /// Q.
        q: f64,
    },
    /// Wait for the operator.
    Stop(Stop),
    /// Queued motion is complete.
    Finish,
    /// Interpreter reset.
    Reset,
    /// Unlock (true: lock) a rotary axis for indexing: 3 = A, 4 = B, 5 = C.
    IndexerLock(u8, bool),
    /// End of program.
    End,

    /// A stretch begins.
    Begin {
        /// Kind.
        marker: Marker,
        /// Number (cycle code, tool, id).
        code: i32,
        /// Name or value.
        text: &'a str,
    },
    /// The innermost stretch of this kind ends.
    Close(Marker),
}

impl Op<'_> {
    /// Whether the tool may move: these have an end pose of their own.
    pub fn moves(&self) -> bool {
        matches!(self, Op::Rapid | Op::Linear | Op::Arc(_) | Op::Nurbs { .. } | Op::Probe(_))
    }
    /// Whether it cuts: moves at feed.
    pub fn feeds(&self) -> bool {
        matches!(self, Op::Linear | Op::Arc(_) | Op::Nurbs { .. })
    }
    /// Whether it takes material away: moves at feed, or taps.
    pub fn cuts(&self) -> bool {
        self.feeds() || matches!(self, Op::RigidTap { .. })
    }
}

use crate::Sync;
