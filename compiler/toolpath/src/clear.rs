//! Clearing strategies: which way the tool goes to empty a region, in the plane.

use crate::{Error, P2, Pass, Region};

/// How an area is emptied (ISO 14649-11).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strategy {
    /// Parallel to the walls and islands, level by level.
    ContourParallel,
    /// The same levels, joined into a spiral.
    ContourSpiral,
    /// Parallel lines, all in the direction of the angle (rad from +x).
    Unidirectional(f64),
    /// Parallel lines, to and fro.
    Bidirectional(f64),
    /// To and fro, then once along the walls.
    BidirectionalContour(f64),
    /// Once along the walls, then to and fro.
    ContourBidirectional(f64),
    /// Along the middle line: for slots and grooves not much wider than the tool.
    CentreMilling,
}

/// Where the cutting edge meets the material, spindle clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutMode {
    /// The material is on the right of the tool's way.
    Climb,
    /// The material is on the left.
    Conventional,
}

/// Sense of travel along an outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rotation {
    /// Counterclockwise.
    Ccw,
    /// Clockwise.
    Cw,
}

/// Which level of a contour-parallel path comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// From the middle to the walls.
    InsideOut,
    /// From the walls to the middle.
    OutsideIn,
}

/// What [`clear`] is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Clear {
    /// Tool radius, mm.
    pub radius: f64,
    /// Distance between passes, mm: tool diameter × (1 − overlap). At most the diameter.
    pub stepover: f64,
    /// Left on every wall, mm.
    pub allowance: f64,
    /// Way of clearing.
    pub strategy: Strategy,
    /// Climb or conventional, if asked for (climb otherwise).
    pub cut_mode: Option<CutMode>,
    /// Sense of travel along the outline, if asked for. With a cut mode it decides the order of levels.
    pub rotation: Option<Rotation>,
    /// Order of levels; decided by cut mode and rotation if `None`.
    pub order: Option<Order>,
    /// To and fro strategies step to the left of the feed direction if true (the standard's `.LEFT.`).
    pub step_left: bool,
    /// Where to begin, as near as possible.
    pub start: Option<P2>,
    /// Uni- and bidirectional only: follow the walls once at the end, so that nothing is left between line ends.
    pub finish_walls: bool,
}

impl Clear {
    /// Climb milling without allowance, complete.
    pub fn new(radius: f64, stepover: f64, strategy: Strategy) -> Self {
        Self {
            radius,
            stepover,
            allowance: 0.0,
            strategy,
            cut_mode: None,
            rotation: None,
            order: None,
            step_left: true,
            start: None,
            finish_walls: true,
        }
    }
}

/// A cleared region.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleared {
    /// Passes in cutting order.
    pub passes: Vec<Pass>,
    /// Where this tool may stand: the region narrowed by radius and allowance.
    pub room: Vec<Region>,
}

/// Empties a region.
///
/// Everything a tool of this radius can reach inside the allowance is cut and nothing else, except that plain uni- and
/// bidirectional paths without `finish_walls` leave cusps at the line ends.
pub fn clear(region: &Region, what: &Clear) -> Result<Cleared, Error> {
    let _ = (region, what);
    Err(Error::Numerical)
}
