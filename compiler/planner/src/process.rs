//! The process model: what a STEP-NC file says is to be machined, as plain data. Lengths are mm, angles rad,
//! times s, feeds mm/s, spindle speeds rpm. Everything knows which instance it came from. Making paths of it
//! is not here.

mod geometry;

use crate::frame::Frame;
use gr_text::Span;

pub use geometry::arc_center;

/// Where something comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Origin {
    /// Instance number.
    pub id: u64,
    /// Its statement.
    pub span: Span,
}

/// How numbers of technology are read.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Units {
    /// m/s, 1/s, degrees: as the standard says.
    #[default]
    Iso,
    /// m/min, rpm (or rpm/100), mm/rev, radians: as STEP Modeler writes them.
    StepModeler,
}

/// How the overlap of two passes is written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Overlap {
    /// Share of the tool's diameter, 0 to 1: ISO 14649.
    Ratio,
    /// Percent of it: the printed example of ISO 14649-11.
    Percent,
    /// Millimetres: STEP Modeler.
    Millimetres,
}

/// A project.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Process {
    /// Its name.
    pub name: String,
    /// How technology was read.
    pub units: Units,
    /// Workpieces of the project.
    pub workpieces: Vec<Workpiece>,
    /// What is executed, in order.
    pub elements: Vec<Element>,
    /// Workingsteps that no workplan reaches.
    pub orphans: Vec<Origin>,
    /// Variables with their values before the first executable.
    pub variables: Vec<(String, Option<f64>)>,
}

/// A workpiece.
#[derive(Clone, PartialEq, Debug)]
pub struct Workpiece {
    /// Instance.
    pub origin: Origin,
    /// Name.
    pub name: String,
    /// Material.
    pub material: String,
    /// Instance that says it.
    pub material_at: Option<Origin>,
    /// Global tolerance as written, mm.
    pub tolerance: Option<f64>,
    /// Raw block: where its corner lies, and its size.
    pub block: Option<(Frame, [f64; 3])>,
}

/// The tolerance that is kept for a global tolerance as written, mm.
pub fn kept_tolerance(written: f64) -> f64 {
    // Some programs write micrometres: a millimetre is no tolerance of a milled part.
    let t = if written >= 1.0 { written / 1000.0 } else { written };
    if t > 0.0 { t.clamp(0.001, 0.5) } else { 0.05 }
}

/// One thing to execute.
#[derive(Clone, PartialEq, Debug)]
pub enum Element {
    /// A nested workplan.
    Plan(Plan),
    /// A machining workingstep.
    Step(Box<Workingstep>),
    /// A rapid movement.
    Rapid(Box<Rapid>),
    /// A function of the control.
    Function(Function),
    /// Touch probing of the workpiece.
    Probe(Box<Probe>),
}

/// A workplan.
#[derive(Clone, PartialEq, Debug)]
pub struct Plan {
    /// Instance.
    pub origin: Origin,
    /// Name.
    pub name: String,
    /// Setup it is done in.
    pub setup: Option<Setup>,
    /// Elements, in order.
    pub elements: Vec<Element>,
}

/// A clamping of the part.
#[derive(Clone, PartialEq, Debug)]
pub struct Setup {
    /// Instance.
    pub origin: Origin,
    /// Name.
    pub name: String,
    /// Its place on the machine, if stated.
    pub frame: Option<Frame>,
    /// Height of its security plane.
    pub security: Option<f64>,
    /// Placement of each workpiece in it.
    pub workpieces: Vec<(u64, Frame)>,
}

/// A point and a normal.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Plane {
    /// A point of it.
    pub point: [f64; 3],
    /// Its normal.
    pub normal: [f64; 3],
}

/// One operation on one feature.
#[derive(Clone, PartialEq, Debug)]
pub struct Workingstep {
    /// Instance.
    pub origin: Origin,
    /// Name.
    pub name: String,
    /// Plane above which rapids are safe, in the frame of the setup.
    pub security: Plane,
    /// Feature.
    pub feature: Feature,
    /// Operation.
    pub operation: Operation,
    /// Top of the raw part in the setup, if known.
    pub stock_top: Option<f64>,
    /// Lowest and highest corner of the raw part in the setup, if known.
    pub stock: Option<[[f64; 3]; 2]>,
}

/// A rapid movement.
#[derive(Clone, PartialEq, Debug)]
pub struct Rapid {
    /// Instance.
    pub origin: Origin,
    /// Name.
    pub name: String,
    /// Security plane.
    pub security: Plane,
    /// Path; empty for RETURN_HOME without one.
    pub toolpaths: Vec<Toolpath>,
    /// RETURN_HOME.
    pub home: bool,
}

/// Touch probing.
#[derive(Clone, PartialEq, Debug)]
pub struct Probe {
    /// Instance.
    pub origin: Origin,
    /// Name.
    pub name: String,
    /// Security plane.
    pub security: Plane,
    /// Where it starts.
    pub start: [f64; 3],
    /// Unit direction.
    pub direction: [f64; 3],
    /// How far the surface is expected.
    pub distance: f64,
    /// Variable that takes the result.
    pub variable: String,
    /// The probe.
    pub tool: Option<Tool>,
}

/// A function of the control.
#[derive(Clone, PartialEq, Debug)]
pub struct Function {
    /// Instance.
    pub origin: Origin,
    /// Name.
    pub name: String,
    /// What it does.
    pub kind: FunctionKind,
}

/// What a function does.
#[derive(Clone, PartialEq, Debug)]
pub enum FunctionKind {
    /// Words for the operator.
    Message(String),
    /// Stops if the operator wants.
    OptionalStop,
    /// Stops.
    ProgramStop,
    /// Changes the pallet.
    ExchangePallet,
    /// Puts a tool into the spindle.
    LoadTool(Tool),
    /// Takes it out.
    UnloadTool,
}

/// A manufacturing feature in the frame of its setup.
#[derive(Clone, PartialEq, Debug)]
pub struct Feature {
    /// Instance.
    pub origin: Origin,
    /// Entity.
    pub keyword: String,
    /// Name.
    pub name: String,
    /// Placement in the setup.
    pub frame: Frame,
    /// Placement as written, relative to the workpiece.
    pub placement: Frame,
    /// Depth below the placement (positive into the material).
    pub depth: f64,
    /// Shape.
    pub shape: Shape,
    /// Where it is repeated: placements in the setup. Without a pattern, just `frame`.
    pub copies: Vec<Frame>,
    /// The least plus-or-minus tolerance that its own lengths are written with, mm; half the band where it is on one side.
    pub tolerance: Option<f64>,
    /// A fit that one of its lengths is written with and that can't be read as a band.
    pub fit: Option<Origin>,
}

/// Shapes.
#[derive(Clone, PartialEq, Debug)]
pub enum Shape {
    /// A plane to be cut flat.
    Face {
        /// Along the course of travel.
        length: f64,
        /// Direction of the course in the feature frame.
        direction: [f64; 2],
        /// Across it.
        width: f64,
        /// Direction across, in the feature frame.
        across: [f64; 2],
        /// Boundary where it is not the rectangle of the two.
        boundary: Option<Contour>,
        /// What stays.
        bosses: Vec<Boss>,
    },
    /// A closed pocket.
    Pocket {
        /// Boundary at the top.
        boundary: Closed,
        /// What stays.
        bosses: Vec<Boss>,
        /// Draft of the walls, rad.
        slope: f64,
        /// Bottom.
        bottom: PocketBottom,
        /// Radius between wall and bottom.
        planar_radius: Option<f64>,
        /// Radius between walls.
        orthogonal_radius: Option<f64>,
    },
    /// An open pocket.
    OpenPocket {
        /// Its walls, open.
        boundary: Contour,
        /// What stays.
        bosses: Vec<Boss>,
        /// Draft of the walls, rad.
        slope: f64,
        /// Bottom.
        bottom: PocketBottom,
        /// Radius between wall and bottom.
        planar_radius: Option<f64>,
        /// Radius between walls.
        orthogonal_radius: Option<f64>,
    },
    /// A slot.
    Slot {
        /// Where the section goes.
        path: Travel,
        /// Section.
        section: Section,
        /// Ends, in the order of the path.
        ends: Vec<SlotEnd>,
    },
    /// A step.
    Step {
        /// Where its edge begins, in the feature frame.
        start: [f64; 2],
        /// Length along its edge.
        length: f64,
        /// Direction of the edge in the feature frame.
        direction: [f64; 2],
        /// Angle of the wall against vertical, rad.
        wall: f64,
        /// Radius between wall and floor.
        radius: f64,
        /// What stays.
        bosses: Vec<Boss>,
    },
    /// A round hole.
    Hole {
        /// At the top.
        diameter: f64,
        /// At the bottom, where it is another.
        final_diameter: Option<f64>,
        /// Bottom.
        bottom: HoleBottom,
    },
    /// Material outside a contour is cut.
    Outside {
        /// Contour.
        boundary: Contour,
        /// Of an open contour: whether the tool is on its left; none: the file does not say.
        left: Option<bool>,
    },
    /// A boss of its own.
    Boss(Boss),
    /// Its geometry is the tool path.
    Toolpath,
    /// A thread.
    Thread {
        /// Major diameter.
        major: f64,
        /// Pitch.
        pitch: Option<f64>,
        /// Right-handed.
        right: bool,
        /// Inside.
        inner: bool,
        /// How far below its placement it begins.
        start: f64,
        /// Length.
        length: f64,
        /// Diameter of the hole that an inner one is cut in: of the hole it is applied to, else its minor diameter.
        bore: Option<f64>,
    },
    /// Elements of a compound feature.
    Compound(Vec<Feature>),
    /// Anything else.
    Other,
}

impl Shape {
    /// It has no bottom.
    pub fn is_through(&self) -> bool {
        match self {
            Shape::Hole { bottom, .. } => *bottom == HoleBottom::Through,
            Shape::Pocket { bottom, .. } | Shape::OpenPocket { bottom, .. } => *bottom == PocketBottom::Through,
            _ => false,
        }
    }
}

/// A closed profile.
#[derive(Clone, PartialEq, Debug)]
pub enum Closed {
    /// Length along x, width along y.
    Rectangle {
        /// Where its centre lies.
        frame: Frame,
        /// Along x.
        length: f64,
        /// Along y.
        width: f64,
    },
    /// A circle.
    Circle {
        /// Where its centre lies.
        frame: Frame,
        /// Diameter.
        diameter: f64,
    },
    /// A regular polygon.
    Ngon {
        /// Where its centre lies.
        frame: Frame,
        /// Diameter.
        diameter: f64,
        /// Sides.
        sides: u32,
        /// The diameter is measured across flats.
        across_flats: bool,
    },
    /// A curve.
    General(Contour),
}

/// A line of straight pieces and arcs. `bulge` is the tangent of a quarter of the arc's angle from this
/// vertex to the next, positive counter-clockwise.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Contour {
    /// x, y, bulge.
    pub points: Vec<[f64; 3]>,
    /// The last vertex goes on to the first.
    pub closed: bool,
}

/// What stays inside a pocket or on a face.
#[derive(Clone, PartialEq, Debug)]
pub struct Boss {
    /// Instance.
    pub origin: Origin,
    /// Boundary in the frame of the feature.
    pub boundary: Contour,
    /// How far its top lies below the feature's placement; ≤ 0 at or above.
    pub top: f64,
    /// Draft, rad.
    pub slope: f64,
}

/// Bottoms of pockets.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum PocketBottom {
    /// None.
    Through,
    /// Flat.
    Planar,
    /// Part of a ball, free space inside it: its centre in the feature frame, and its radius.
    Ball([f64; 3], f64),
    /// General: its name.
    Other(&'static str),
}

/// Where a section goes.
#[derive(Clone, PartialEq, Debug)]
pub enum Travel {
    /// Straight.
    Line {
        /// Start in the feature frame.
        start: [f64; 2],
        /// Unit direction.
        direction: [f64; 2],
        /// Length.
        length: f64,
    },
    /// Any plane curve in the feature frame.
    Curve(Contour),
}

/// Sections of slots.
#[derive(Clone, PartialEq, Debug)]
pub enum Section {
    /// Flat bottom with two walls: width at the bottom.
    SquareU {
        /// At the bottom.
        width: f64,
        /// Radii between walls and bottom, first at +x of the profile.
        radius: [f64; 2],
        /// Angles of the walls against vertical, rad, likewise.
        angle: [f64; 2],
    },
    /// Half-round bottom.
    RoundedU {
        /// Width.
        width: f64,
    },
    /// V.
    Vee {
        /// Radius at the tip.
        radius: f64,
        /// Angle between the walls, rad.
        angle: f64,
        /// Angle between the x axis of the profile and its first side, rad.
        tilt: f64,
    },
    /// T.
    Tee {
        /// Of the upper part.
        width: f64,
        /// Of the lower part.
        bar_width: f64,
        /// Of the lower part.
        bar_depth: f64,
        /// Of the corners of the lower part.
        radius: f64,
        /// Chamfers at the open end, and between the two parts: their widths, 0 where there is none, and angles, rad.
        chamfer: [[f64; 2]; 2],
        /// The profile.
        origin: Origin,
    },
    /// Part of a circle.
    Circular {
        /// Radius.
        radius: f64,
        /// Angle, rad.
        sweep: f64,
    },
    /// Any curve: x across, y up.
    General(Contour),
}

/// Ends of slots.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SlotEnd {
    /// Open: the tool runs out.
    Open,
    /// Half round.
    Radiused,
    /// Flat with two corner radii.
    Flat(f64, f64),
    /// Of a disc cutter.
    Woodruff(f64),
    /// The path is closed.
    Loop,
}

/// Bottoms of holes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum HoleBottom {
    /// None.
    Through,
    /// Flat.
    Flat,
    /// Flat with a radius.
    Radiused(f64),
    /// Ball.
    Spherical(f64),
    /// Cone: angle as written (rad) and tip radius.
    Conical(f64, Option<f64>),
}

/// A tool.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Tool {
    /// Instance of the tool.
    pub origin: Origin,
    /// Name.
    pub name: String,
    /// Entity of its body: FACEMILL, TWIST_DRILL …
    pub kind: String,
    /// Diameter.
    pub diameter: f64,
    /// Half angle of its tip as written, rad.
    pub tip_angle: Option<f64>,
    /// Length of its cutting edge.
    pub cutting_length: Option<f64>,
    /// Edge radius.
    pub edge_radius: f64,
    /// Half angle of a tapered body, rad; 0 for a cylinder.
    pub taper: f64,
    /// From its reference to the tip.
    pub length: Option<f64>,
    /// Teeth.
    pub teeth: Option<u32>,
    /// Right-handed, if stated.
    pub right_handed: Option<bool>,
    /// Pitch of a tap or a thread mill.
    pub pitch: Option<f64>,
    /// Size of the thread that it cuts, where it says one besides its diameter.
    pub thread_size: Option<f64>,
    /// Diameter of the flat at the tip of a countersink.
    pub nose: f64,
    /// Height of a disc.
    pub thickness: Option<f64>,
    /// It must not be drawn back turning.
    pub no_retract: bool,
    /// Where its edge points when the spindle is oriented.
    pub orientation: Option<[f64; 3]>,
    /// Diameter of what holds it, for going through a hole sideways.
    pub bar: Option<f64>,
    /// Number in the tool table, from 1.
    pub number: u32,
}

impl Tool {
    fn is_one_of(&self, kinds: &[&str]) -> bool {
        kinds.iter().any(|k| self.kind.contains(k)) && !self.kind.starts_with("TAPERED_END")
    }
    /// Its tip is a point, if it has an angle.
    pub fn is_pointed(&self) -> bool {
        self.is_one_of(&["DRILL", "COUNTERS", "SPOT", "REAMER", "TAP"])
    }
    /// It cuts below what it passes, or its shape is not known.
    pub fn undercuts(&self) -> bool {
        self.is_one_of(&["T_SLOT_MILL", "WOODRUFF", "DOVETAIL", "BORING", "SIDE_MILL", "THREAD_MILL", "USER"])
    }
    /// How wide a hole the cone of a tool opens whose tip is so deep, mm.
    pub fn opens(&self, depth: f64) -> Option<f64> {
        Some(self.diameter.min(self.nose + 2.0 * depth * libm::tan(self.tip_angle?)))
    }
    /// How deep its tip is where its cone is so wide, mm.
    pub fn sinks(&self, width: f64) -> Option<f64> {
        Some((width - self.nose) / 2.0 / libm::tan(self.tip_angle?))
    }
    /// Length of its cutting edge along its axis: of a disc its height.
    pub fn edge(&self) -> Option<f64> {
        self.thickness.filter(|_| self.is_one_of(&["T_SLOT_MILL", "WOODRUFF", "SIDE_MILL"])).or(self.cutting_length)
    }
    /// It goes into the side of a slot.
    pub fn is_disc(&self) -> bool {
        self.is_one_of(&["T_SLOT_MILL", "WOODRUFF"])
    }
    /// A drill or countersink with a point of less than 2 degrees to its axis: there is none.
    pub fn is_needle(&self) -> bool {
        self.is_one_of(&["DRILL", "COUNTERS", "SPOT"]) && self.tip_angle.is_some_and(|a| a < 2f64.to_radians())
    }
    /// It has no edges at its middle, as its kind says: of others the standard does not say it.
    pub fn is_hollow(&self) -> bool {
        self.is_one_of(&["FACEMILL", "SHOULDERMILL", "SIDE_MILL"])
    }
    /// A cylinder, cone or ball that mills with its side and its face.
    pub fn mills(&self) -> bool {
        !self.is_pointed() && !self.is_disc() && !self.is_one_of(&["BORING", "DOVETAIL", "THREAD_MILL"])
    }
}

/// What a workingstep does.
#[derive(Clone, PartialEq, Debug)]
pub struct Operation {
    /// Instance.
    pub origin: Origin,
    /// Entity.
    pub keyword: String,
    /// Name.
    pub name: String,
    /// Retract plane above the feature.
    pub retract: Option<f64>,
    /// Start point in the feature frame.
    pub start: Option<[f64; 3]>,
    /// Tool.
    pub tool: Tool,
    /// Technology.
    pub technology: Technology,
    /// Machine functions.
    pub functions: Functions,
    /// Overcut at open sides.
    pub overcut: Option<f64>,
    /// Explicit tool paths.
    pub toolpaths: Vec<Toolpath>,
    /// Tool direction entity, if any.
    pub direction: Option<String>,
    /// What kind of work.
    pub kind: OperationKind,
}

/// Kinds of work.
#[derive(Clone, PartialEq, Debug)]
pub enum OperationKind {
    /// Drilling family.
    Drill(Drilling),
    /// 2½D milling.
    Mill(Milling),
    /// Freeform, turning and the rest.
    Other,
}

/// Drilling family.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Drilling {
    /// Depth of cut.
    pub depth: Option<f64>,
    /// Hole before it.
    pub previous: Option<f64>,
    /// Dwell at the bottom, s.
    pub dwell: f64,
    /// Feed on the way out, as a ratio.
    pub feed_on_retract: Option<f64>,
    /// Where the depth of cut is written.
    pub depth_span: Span,
    /// Reduced feed and speed over the first stretch.
    pub first: Option<Reduced>,
    /// The same over the last stretch.
    pub last: Option<Reduced>,
    /// Pecking: first depth, step, retract distance, dwell.
    pub peck: Option<[f64; 4]>,
    /// The spindle stops at the bottom.
    pub stop_at_bottom: bool,
    /// Waiting position and depth of a test cut.
    pub test_cut: Option<(f64, Option<[f64; 3]>)>,
    /// Thread drilling goes in on the helix too.
    pub helical: bool,
    /// The chuck compensates (tapping).
    pub floating_chuck: bool,
}

/// A stretch of a hole that is made with less feed or speed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reduced {
    /// Where its length is written.
    pub span: Span,
    /// How long it is, mm; it may be longer than the hole.
    pub length: f64,
    /// Share of the feed.
    pub feed: f64,
    /// Share of the spindle speed.
    pub speed: f64,
}

/// 2½D milling.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Milling {
    /// Finishing rather than roughing.
    pub finish: bool,
    /// The bottom is cut.
    pub bottom: bool,
    /// The side is cut.
    pub side: bool,
    /// Axial depth.
    pub axial: Option<f64>,
    /// Radial depth.
    pub radial: Option<f64>,
    /// Stock on walls.
    pub allowance_side: f64,
    /// Stock on the bottom.
    pub allowance_bottom: f64,
    /// Strategy.
    pub strategy: Option<Strategy>,
    /// Way in.
    pub approach: Approach,
    /// Way out.
    pub retract: Approach,
}

/// A strategy.
#[derive(Clone, PartialEq, Debug)]
pub struct Strategy {
    /// Instance.
    pub origin: Origin,
    /// Entity.
    pub keyword: String,
    /// Overlap as written.
    pub overlap: Option<f64>,
    /// Where it is written.
    pub overlap_span: Span,
    /// Multiple passes allowed.
    pub multiple: Option<bool>,
    /// Feed direction in the feature frame.
    pub feed: Option<[f64; 2]>,
    /// Stepover to the left of the feed.
    pub step_left: Option<bool>,
    /// Contours run counter-clockwise.
    pub ccw: Option<bool>,
    /// Climb milling.
    pub climb: Option<bool>,
    /// How strokes are joined.
    pub connection: Option<String>,
}

/// Ways into and out of the material.
#[derive(Clone, PartialEq, Debug, Default)]
pub enum Approach {
    /// Not stated.
    #[default]
    None,
    /// Straight along the tool axis.
    Axis,
    /// Along the path with a slope, rad.
    Ramp(f64),
    /// Helix: radius, slope rad.
    Helix(f64, f64),
    /// To and fro: slope rad, width.
    Zigzag(f64, f64),
    /// From the air, at an angle: rad, length.
    Angle(f64, f64),
    /// From the air, on a quarter circle: radius.
    Tangent(f64),
    /// Along a path of its own.
    Along(Vec<Toolpath>),
}

/// Cutting data.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Technology {
    /// Instance.
    pub origin: Origin,
    /// mm/s, or mm per revolution.
    pub feed: Option<f64>,
    /// The feed is per revolution.
    pub per_rev: bool,
    /// Constant cutting speed in the place of a spindle speed: mm/s, and the fastest the spindle may turn, rpm.
    pub surface: Option<[f64; 2]>,
    /// The feed is that of the contact point.
    pub contact_feed: bool,
    /// rpm, always positive.
    pub speed: Option<f64>,
    /// Clockwise, seen from the holder: M3.
    pub clockwise: bool,
    /// Feed and spindle are coupled.
    pub synchronised: bool,
    /// The feed override is locked.
    pub lock_feed: bool,
    /// The spindle override is locked.
    pub lock_spindle: bool,
    /// As written: feed, cutting speed, spindle, feed per tooth.
    pub written: [Option<f64>; 4],
}

/// Coolant and the like.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Functions {
    /// Flood.
    pub flood: bool,
    /// Mist.
    pub mist: bool,
}

/// One piece of an explicit tool path.
#[derive(Clone, PartialEq, Debug)]
pub struct Toolpath {
    /// Instance.
    pub origin: Origin,
    /// Approach, lift, connect, non-contact, contact, trajectory.
    pub role: String,
    /// Rapid.
    pub rapid: bool,
    /// Ratio of the operation's feed.
    pub ratio: Option<f64>,
    /// Own technology.
    pub technology: Option<Technology>,
    /// Own machine functions.
    pub functions: Option<Functions>,
    /// What it is.
    pub path: PathKind,
}

/// Kinds of explicit path.
#[derive(Clone, PartialEq, Debug)]
pub enum PathKind {
    /// The tool tip goes along a curve, with its axis if that changes.
    Location {
        /// Curve.
        curve: Curve,
        /// Tool axis: one direction per point.
        axis: Option<Curve>,
    },
    /// Waits, s.
    Feedstop(f64),
    /// Positions of the axes X, Y, Z in the setup; what is not given stays where it is.
    Axes(Vec<[Option<f64>; 3]>),
    /// By the security plane to the next piece.
    BySecurityPlane,
    /// Straight to the next piece.
    Direct,
}

/// A space curve.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Curve {
    /// First point.
    pub start: [f64; 3],
    /// Pieces, in order.
    pub pieces: Vec<Piece>,
}

/// A piece of a space curve.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Piece {
    /// Straight to a point.
    Line([f64; 3]),
    /// Along a circle.
    Arc {
        /// Centre.
        center: [f64; 3],
        /// Unit normal: counter-clockwise seen against it.
        normal: [f64; 3],
        /// End.
        end: [f64; 3],
    },
}

impl Operation {
    /// Only two axes may move at a time.
    pub fn two_axes(&self) -> bool {
        self.direction.as_deref() == Some("TWO_AXES")
    }
}

impl Process {
    /// All machining workingsteps in the order of execution.
    pub fn steps(&self) -> Vec<&Workingstep> {
        fn walk<'a>(elements: &'a [Element], out: &mut Vec<&'a Workingstep>) {
            for e in elements {
                match e {
                    Element::Plan(p) => walk(&p.elements, out),
                    Element::Step(s) => out.push(s),
                    _ => {}
                }
            }
        }
        let mut out = Vec::new();
        walk(&self.elements, &mut out);
        out
    }
}
