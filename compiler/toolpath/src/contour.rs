//! Passes along walls, and along the middle of slots.

use crate::{CutMode, Error, P2, Pass, Path2, Region};

/// Which side of an open curve the tool is on, seen along the curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
    /// On the curve.
    On,
}

/// How a wall pass begins and ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lead {
    /// On the wall.
    None,
    /// By a quarter circle of this radius, tangential to the wall. Shrunk where there is no room.
    Arc(f64),
    /// By a straight line of this length, tangential to the path (open curves), or square to it (closed ones).
    Line(f64),
}

/// What the wall passes are to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Contour {
    /// Tool radius, mm.
    pub radius: f64,
    /// Left on the wall, mm.
    pub allowance: f64,
    /// Climb or conventional.
    pub cut_mode: CutMode,
    /// How the pass begins.
    pub lead_in: Lead,
    /// How it ends.
    pub lead_out: Lead,
    /// Material in front of the wall to be taken in several passes: total thickness, mm (0: one pass).
    pub stock: f64,
    /// Thickness of one of them, mm.
    pub stepover: f64,
    /// Where to begin, as near as possible.
    pub start: Option<P2>,
}

impl Contour {
    /// One climb pass without leads.
    pub fn new(radius: f64) -> Self {
        Self {
            radius,
            allowance: 0.0,
            cut_mode: CutMode::Climb,
            lead_in: Lead::None,
            lead_out: Lead::None,
            stock: 0.0,
            stepover: radius,
            start: None,
        }
    }
}

/// Side milling of a region's walls from inside: the outline and every island.
pub fn contour_closed(region: &Region, what: &Contour) -> Result<Vec<Pass>, Error> {
    let _ = (region, what);
    Err(Error::Numerical)
}

/// Side milling along a curve: a closed one from outside (`Left` of a clockwise, `Right` of a counterclockwise one) or
/// inside, an open one on the side given. The cut mode decides the direction of travel; `On` keeps the curve's.
pub fn contour(path: &Path2, side: Side, what: &Contour) -> Result<Vec<Pass>, Error> {
    let _ = (path, side, what);
    Err(Error::Numerical)
}

/// A slot along a travel path with these half widths: the middle line if the tool is as wide as the slot, else passes
/// to both sides. A tool wider than the slot is an error.
pub fn slot(path: &Path2, width: f64, what: &Contour) -> Result<Vec<Pass>, Error> {
    let _ = (path, width, what);
    Err(Error::Numerical)
}
