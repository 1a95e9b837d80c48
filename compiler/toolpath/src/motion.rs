//! From flat passes to moves: levels, approaches, links, retracts.

use crate::{Error, P2, Pass, Region};

/// A point in the feature's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct P3 {
    /// mm
    pub x: f64,
    /// mm
    pub y: f64,
    /// mm
    pub z: f64,
}

impl P3 {
    /// The point (x, y, z).
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }
    /// Over or under a point of the plane.
    pub const fn over(p: P2, z: f64) -> Self {
        Self { x: p.x, y: p.y, z }
    }
    /// Its place in the plane.
    pub const fn flat(self) -> P2 {
        P2::new(self.x, self.y)
    }
}

/// What a move is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tag {
    /// To the start of a pass, from the clearance plane down.
    Approach,
    /// Cutting.
    Cut,
    /// Between passes, at depth.
    Link,
    /// Up to the clearance plane.
    Retract,
}

/// Shape of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// As fast as the machine can, in a straight line.
    Rapid,
    /// Straight at feed.
    Line,
    /// Circular about the tool axis at feed; z changes evenly if the ends differ (helix).
    Arc {
        /// Centre in the plane.
        centre: P2,
        /// Angle turned through, positive counterclockwise; may exceed a full turn in a helix.
        sweep: f64,
    },
}

/// One move; it starts where the one before ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Where it ends.
    pub to: P3,
    /// Shape.
    pub kind: Kind,
    /// Purpose.
    pub tag: Tag,
}

/// Heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Depth {
    /// Top of the material.
    pub top: f64,
    /// Bottom of the last level.
    pub bottom: f64,
    /// Largest axial depth of cut.
    pub step: f64,
    /// Rapids go at this height.
    pub clearance: f64,
    /// Rapid down to this height, feed below it.
    pub safe: f64,
    /// Thickness of a last, separate level at the bottom (0: none).
    pub finish: f64,
}

impl Depth {
    /// Clearance 5 mm above the top, feed from 1 mm above.
    pub fn new(top: f64, bottom: f64, step: f64) -> Self {
        Self { top, bottom, step, clearance: top + 5.0, safe: top + 1.0, finish: 0.0 }
    }
}

/// The way down to a pass (or, mirrored, up from it).
#[derive(Clone, Debug, PartialEq)]
pub enum Approach {
    /// Along the tool axis.
    Plunge,
    /// Down along the pass itself at this angle from the plane, rad.
    Ramp {
        /// rad
        angle: f64,
    },
    /// Down a helix that ends tangentially in the pass's start.
    Helix {
        /// Of the tool centre's way, mm.
        radius: f64,
        /// From the plane, rad.
        angle: f64,
    },
    /// To and fro along the pass's first `width` mm.
    ZigZag {
        /// From the plane, rad.
        angle: f64,
        /// mm
        width: f64,
    },
    /// Straight, slanting in the direction of the pass.
    AirAngle {
        /// From the plane, rad.
        angle: f64,
        /// Length of the slanting way, mm.
        length: f64,
    },
    /// A quarter circle in the plane that contains the pass's direction and the tool axis, here as a tangential line
    /// from a quarter circle beside the path.
    AirTangent {
        /// mm
        radius: f64,
    },
    /// Along these points, relative to the first point of the pass.
    AlongPath(Vec<P3>),
}

/// How passes begin and end.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Way down.
    pub approach: Approach,
    /// Way up (only `Plunge`, `AirAngle`, `AirTangent` and `AlongPath` mean something).
    pub retract: Approach,
    /// Work level by level (true) or each pass to full depth.
    pub by_level: bool,
}

impl Default for Entry {
    fn default() -> Self {
        Self { approach: Approach::Plunge, retract: Approach::Plunge, by_level: true }
    }
}

/// Heights of the levels, top to bottom, evenly spaced, none deeper than the step.
pub fn levels(depth: &Depth) -> Result<Vec<f64>, Error> {
    let _ = depth;
    Err(Error::Numerical)
}

/// Moves of these passes on every level. `region` and `radius` say where the tool may be: approaches keep inside, or
/// fall back to a ramp along the pass, which always is. `None`: anywhere (facing, outside profiles).
///
/// The first move is a rapid at clearance height to the first approach; the last ends at clearance height.
pub fn motion(passes: &[Pass], depth: &Depth, entry: &Entry, region: Option<&Region>, radius: f64) -> Result<Vec<Move>, Error> {
    let _ = (passes, depth, entry, region, radius);
    Err(Error::Numerical)
}
