//! Canonical machining calls: what an interpretation of a program yields, in program units and frame.
//!
//! The set follows the canonical machining functions of RS274/NGC (NIST IR 6556) as LinuxCNC 2.9 has
//! them. Two consumers read the same stream: [`print`] writes it as text, the motion IR is lowered from it.

mod number;
mod print;

pub use gr_text::FileId;
pub use number::{fixed_units, push_fixed, push_int};
pub use print::{Printer, Version};

/// X Y Z A B C U V W, in this order, everywhere.
pub type Axes = [f64; 9];

/// Length units of the program.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[repr(u8)]
pub enum Units {
    /// G20.
    Inch = 1,
    /// G21.
    #[default]
    Mm = 2,
}

/// Working plane.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[repr(u8)]
pub enum Plane {
    /// G17.
    #[default]
    Xy = 1,
    /// G19.
    Yz = 2,
    /// G18.
    Xz = 3,
    /// G17.1.
    Uv = 4,
    /// G19.1.
    Vw = 5,
    /// G18.1.
    Uw = 6,
}

impl Plane {
    /// Its G-code.
    pub fn code(self) -> &'static str {
        match self {
            Plane::Xy => "G17",
            Plane::Xz => "G18",
            Plane::Yz => "G19",
            Plane::Uv => "G17.1",
            Plane::Uw => "G18.1",
            Plane::Vw => "G19.1",
        }
    }
}

/// How the controller follows the path.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum PathMode {
    /// G61.1: stop at every end point.
    ExactStop,
    /// G61.
    #[default]
    ExactPath,
    /// G64, with its tolerance in program units (0 = none).
    Continuous(f64),
}

/// By how much the probe of the stand-alone `rs274` stops before its target, mm.
pub const PROBE_STOPS_SHORT: f64 = 0.254;

/// One canonical call. Positions are in the active work frame and program units; rotary axes in degrees;
/// feeds in units per minute (or per revolution, or 1/min, as the feed mode says).
#[derive(Clone, PartialEq, Debug)]
pub enum Call {
    /// The program's length unit from here on.
    UseLengthUnits(Units),
    /// Work offset: number (1 = G54 … 9 = G59.3) and values.
    SetG5xOffset(u8, Axes),
    /// G10 of a work offset that is not in force: number, values and rotation in degrees. The real `rs274` prints a remark.
    StoreG5xOffset(u8, Axes, f64),
    /// G92/G52 offset.
    SetG92Offset(Axes),
    /// Rotation of the work frame about Z, degrees.
    SetXyRotation(f64),
    /// Feeds refer to XYZ (always, in RS274NGC).
    SetFeedReferenceXyz,
    /// Interpreter reset.
    OnReset,
    /// Working plane.
    SelectPlane(Plane),
    /// Spindle number and 0 = per minute, 1 = per revolution.
    SetFeedMode(i32, i32),
    /// Feed.
    SetFeedRate(f64),
    /// Rapid to a point.
    StraightTraverse(Axes),
    /// Feed to a point.
    StraightFeed(Axes),
    /// Arc or helix in the active plane: (first, second; third) = G17 (X, Y; Z), G18 (Z, X; Y), G19 (Y, Z; X).
    ArcFeed {
        /// End, first plane axis.
        first_end: f64,
        /// End, second plane axis.
        second_end: f64,
        /// Centre, first plane axis.
        first_axis: f64,
        /// Centre, second plane axis.
        second_axis: f64,
        /// Turns begun: > 0 counter-clockwise, < 0 clockwise.
        rotation: i32,
        /// End on the third axis.
        axis_end: f64,
        /// End of A B C U V W.
        rest: [f64; 6],
    },
    /// NURBS in its plane: control points and order.
    NurbsFeed(Box<Nurbs>),
    /// G33.1.
    RigidTap([f64; 3], f64),
    /// Motion follows the spindle: spindle, feed per revolution, velocity mode.
    StartSpeedFeedSynch(i32, f64, bool),
    /// Motion is free again.
    StopSpeedFeedSynch,
    /// Probe towards a point; kind as in LinuxCNC (bit 0: error if nothing is touched is off; bit 1: away).
    StraightProbe(Axes, u8),
    /// Probing begins.
    TurnProbeOn,
    /// Probing ends.
    TurnProbeOff,
    /// Wait, seconds.
    Dwell(f64),
    /// Path control.
    SetMotionControlMode(PathMode),
    /// Naive CAM tolerance.
    SetNaivecamTolerance(f64),
    /// LinuxCNC 2.10, G64 R: 0 trapezoidal or 1 smooth planner, and how sharp the smooth one may corner (0.1 … 1;
    /// −1 with the other).
    SetPlannerMode(i32, f64),
    /// Spindle number and 0 = constant rpm, else constant surface speed with this rpm limit. Where G97
    /// ends surface speed without a new S: the number that now counts as rpm.
    SetSpindleMode(i32, f64, Option<f64>),
    /// Spindle number, rpm (or surface speed).
    SetSpindleSpeed(i32, f64),
    /// M3.
    StartSpindleClockwise(i32),
    /// M4.
    StartSpindleCounterclockwise(i32),
    /// M5.
    StopSpindleTurning(i32),
    /// M19: spindle, angle in degrees, direction.
    OrientSpindle(i32, f64, i32),
    /// M19 Q: spindle, time limit in seconds.
    WaitSpindleOrientComplete(i32, f64),
    /// T.
    SelectTool(i32),
    /// M6 begins (2.9).
    StartChange,
    /// M6: pocket index.
    ChangeTool(i32),
    /// M61: pocket index, tool.
    ChangeToolNumber(i32, i32),
    /// Tool table reload after G10 L1 and its like.
    ReloadTooldata,
    /// G10 L1 …: pocket, tool, offsets, diameter, front angle, back angle, orientation.
    SetToolTableEntry(i32, i32, Axes, f64, f64, f64, i32),
    /// G43 and its like, and the number that asks for it (H), which is not printed.
    UseToolLengthOffset(Axes, Option<u32>),
    /// M7.
    MistOn,
    /// M9.
    MistOff,
    /// M8.
    FloodOn,
    /// M9.
    FloodOff,
    /// M48/M50.
    EnableFeedOverride,
    /// M49/M50.
    DisableFeedOverride,
    /// M48/M51, spindle.
    EnableSpeedOverride(i32),
    /// M49/M51, spindle.
    DisableSpeedOverride(i32),
    /// M52.
    EnableAdaptiveFeed,
    /// M52.
    DisableAdaptiveFeed,
    /// M53.
    EnableFeedHold,
    /// M53.
    DisableFeedHold,
    /// M62.
    SetMotionOutputBit(i32),
    /// M63.
    ClearMotionOutputBit(i32),
    /// M64.
    SetAuxOutputBit(i32),
    /// M65.
    ClearAuxOutputBit(i32),
    /// M67: index, value.
    SetMotionOutputValue(i32, f64),
    /// M68: index, value.
    SetAuxOutputValue(i32, f64),
    /// M66: index, true = digital, wait type, time limit in seconds. (The real `rs274` prints nothing for it
    /// when it does not wait.)
    WaitInput(i32, bool, i32, f64),
    /// A comment of the program or of the interpreter.
    Comment(Box<str>),
    /// (MSG,…), (DEBUG,…).
    Message(Box<str>),
    /// (LOG,…).
    Log(Box<str>),
    /// (LOGOPEN,…).
    LogOpen(Box<str>),
    /// (LOGAPPEND,…).
    LogAppend(Box<str>),
    /// (LOGCLOSE).
    LogClose,
    /// M100 … M199 with P and Q: recorded, never run.
    UserM(i32, f64, f64),
    /// M0.
    ProgramStop,
    /// M1.
    OptionalProgramStop,
    /// M30, M60.
    PalletShuttle,
    /// M2, M30.
    ProgramEnd,
    /// Queued motion is complete (printed by nobody's program but part of the interface).
    Finish,
    /// Unlock (true: lock again) a rotary axis for an indexing move (index: 3 = A, 4 = B, 5 = C).
    IndexerLock(u8, bool),
}

/// A NURBS in the working plane.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Nurbs {
    /// Order (degree + 1).
    pub order: u32,
    /// Control points: the two plane coordinates and the weight.
    pub points: Vec<[f64; 3]>,
    /// Plane; 2.9 has splines in XY only. XZ means Z, then X.
    pub plane: Plane,
    /// Knots of a G6.2 curve (2.10), one for each line of the program: as many as points and order together. Empty:
    /// clamped and uniform.
    pub knots: Vec<f64>,
}

/// How execution came to a block; a node of a tree that the interpreter grows.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, PartialOrd, Ord)]
pub struct FrameId(pub u32);

impl FrameId {
    /// The main program.
    pub const MAIN: FrameId = FrameId(0);
}

/// One call or one pass of a loop.
#[derive(Clone, PartialEq, Debug)]
pub struct CallFrame {
    /// From where.
    pub parent: FrameId,
    /// File of the calling block.
    pub file: FileId,
    /// Line of the calling block, from 0.
    pub line: u32,
    /// `sub name`, or the loop's label.
    pub name: Box<str>,
    /// Pass of a loop or repeat, from 1; 0 for a call.
    pub pass: u32,
}

/// Where a call comes from.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// File.
    pub file: FileId,
    /// Line of the block that asked for it, from 0, in the file. While the interpreter runs one chunk alone
    /// (memoised steps), relative to that chunk.
    pub line: u32,
    /// How execution came to that block.
    pub frame: FrameId,
    /// Text of the block the interpreter read last: not the same as `line` when cutter compensation had to
    /// look ahead. `rs274` prints the N-number of this one.
    pub now: &'a [u8],
}

/// A stretch of the program that belongs together.
#[derive(Clone, PartialEq, Debug)]
pub enum Mark {
    /// One pass of a canned cycle begins; its G-code times ten (G83 = 830).
    CycleBegin(i32),
    /// … ends.
    CycleEnd,
    /// The next values are stand-ins for something known only at run time (M66, probe, HAL).
    RuntimeValue(Box<str>),
    /// The tool that was just changed to finds its own length in force.
    LengthInForce,
    /// A block that an error gave up had this word: `g` or `m`, and its number times ten (G43.1 = 431).
    Meant(u8, i32),
}

/// Takes the canonical stream.
pub trait Sink {
    /// One call.
    fn call(&mut self, at: &At<'_>, call: &Call);
    /// A new node of the call tree.
    fn frame(&mut self, _id: FrameId, _frame: &CallFrame) {}
    /// A marker.
    fn mark(&mut self, _at: &At<'_>, _mark: &Mark) {}
    /// Text of `(PRINT,…)`, for standard output.
    fn print(&mut self, _text: &str) {}
    /// Comes every few thousand blocks, also from loops that only compute: who watches over a run may break it off here.
    fn give_way(&mut self) {}
}

/// Drops everything (for checks and timing).
pub struct Discard;

impl Sink for Discard {
    fn call(&mut self, _at: &At<'_>, _call: &Call) {}
}

impl<S: Sink + ?Sized> Sink for &mut S {
    fn call(&mut self, at: &At<'_>, call: &Call) {
        (**self).call(at, call);
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        (**self).frame(id, frame);
    }
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        (**self).mark(at, mark);
    }
    fn print(&mut self, text: &str) {
        (**self).print(text);
    }
    fn give_way(&mut self) {
        (**self).give_way();
    }
}
