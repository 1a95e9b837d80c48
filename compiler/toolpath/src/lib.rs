//! Plane geometry of milling (2½D): curves of lines and true arcs, regions with islands, offsets, clearing
//! strategies, facing, finishing passes, approaches and retracts. It knows neither files nor features: the planner
//! hands it outlines in a feature's own plane (millimetres, radians) and gets tool-centre moves back.
//!
//! A plan takes three steps:
//!
//! 1. an outline: [`profile`] makes the standard ones, [`Path2::from_vertices`] any other; a [`Region`] is an outline
//!    with islands;
//! 2. flat passes: [`clear`] (pockets, areas), [`face`] (planes with overrun), [`contour`] (walls), [`slot`] (the
//!    middle line), each a list of [`Pass`];
//! 3. moves: [`motion`] repeats the passes on every level of [`levels`] with approaches, links and retracts.
//!
//! z = 0 is wherever the caller puts it; the tool axis is +z. The spindle is taken to turn clockwise, so climb milling
//! has the material on the right of the tool's way.
//!
//! ```
//! use gr_toolpath::*;
//! let outline = profile::rectangle(100.0, 60.0, 8.0)?;
//! let boss = profile::circle(6.0)?.moved(P2::new(50.0, 30.0));
//! let region = Region::new(outline.moved(P2::new(50.0, 30.0)), vec![boss])?;
//! let plan = clear(&region, &Clear::new(5.0, 5.0, Strategy::ContourParallel))?;
//! let moves = motion(&plan.passes, &Depth::new(0.0, -10.0, 3.0), &Entry::default(), Some(&region), 5.0)?;
//! assert!(!moves.is_empty());
//! # Ok::<(), gr_toolpath::Error>(())
//! ```

mod clear;
mod contour;
mod face;
mod geom;
mod motion;
mod offset;
mod path;
pub mod profile;
mod region;
mod residual;
mod stitch;

pub use clear::{Clear, Cleared, CutMode, HAIR, Order, Rotation, Strategy, clear};
pub use contour::{Contour, Lead, Side, contour, contour_closed, largest_tool, slot};
pub use face::{Face, face};
pub use geom::{Bounds, P2, Seg, Vertex};
pub use motion::{Approach, Depth, Entry, Kind, Move, P3, Tag, levels, motion};
pub use offset::{common, erode, grow, offset_open};
pub use path::Path2;
pub use region::Region;
pub use residual::{Residual, residuals};

/// No machine follows less, mm: a path within a circle of this radius is cut as a point, an arc of less radius as its
/// chord. Controls refuse smaller arcs (LinuxCNC: below 0.00127 mm).
pub const RESOLUTION: f64 = 1.5e-3;

/// What a pass is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Clears the area.
    Clear,
    /// Runs along a wall: its tool envelope is the wall itself.
    Wall,
    /// Takes away what the regular passes leave between them.
    Rest,
}

/// How the tool gets from the end of the pass before to the start of this one.
#[derive(Clone, Debug, PartialEq)]
pub enum Link {
    /// Up to the clearance plane, over, and down again with an approach.
    Retract,
    /// At depth and at feed along this path, which starts where the pass before ends and ends where this pass starts.
    Stay(Path2),
}

/// One stretch of tool-centre path in the plane, cut without leaving the material.
#[derive(Clone, Debug, PartialEq)]
pub struct Pass {
    /// The tool centre's way, already in cutting direction.
    pub path: Path2,
    /// What it is for.
    pub role: Role,
    /// How to come here from the pass before. Always [`Link::Retract`] on the first.
    pub link: Link,
}

/// Why a path can't be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error {
    /// A coordinate, radius or parameter is NaN or infinite.
    NotFinite,
    /// A coordinate is beyond ±1e7 mm.
    TooLarge,
    /// The curve has no segment of any length.
    Empty,
    /// A closed curve was needed.
    NotClosed,
    /// The closed curve has no area.
    NoArea,
    /// The curve crosses itself near this point.
    SelfIntersecting(P2),
    /// A parameter is out of range: its name.
    Parameter(&'static str),
    /// The tool fits nowhere in the region: the largest radius that would.
    ToolTooLarge {
        /// Radius of the largest circle that fits, mm.
        fits: f64,
    },
    /// More passes or levels than anybody can mean (the step is too small for the size).
    TooManyPasses,
    /// The offset curve could not be closed (should not happen; the input is at the limit of arithmetic).
    Numerical,
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite => write!(f, "a value is not a finite number"),
            Self::TooLarge => write!(f, "a coordinate is beyond 10 km"),
            Self::Empty => write!(f, "the curve has no length"),
            Self::NotClosed => write!(f, "the curve is not closed"),
            Self::NoArea => write!(f, "the curve encloses no area"),
            Self::SelfIntersecting(p) => write!(f, "the curve crosses itself near x {:.4} y {:.4}", p.x, p.y),
            Self::Parameter(name) => write!(f, "{name} is out of range"),
            Self::ToolTooLarge { fits } => {
                write!(f, "the tool is too large: the largest radius that fits is {fits:.4} mm")
            }
            Self::TooManyPasses => write!(f, "the step is too small for the size: too many passes"),
            Self::Numerical => write!(f, "the offset curve can't be closed"),
        }
    }
}

impl std::error::Error for Error {}

/// A length that must be a positive finite number.
pub(crate) fn positive(value: f64, name: &'static str) -> Result<f64, Error> {
    if !value.is_finite() {
        return Err(Error::NotFinite);
    }
    if value <= 1e-6 { Err(Error::Parameter(name)) } else { Ok(value) }
}

/// A length that must be finite and not negative.
pub(crate) fn not_negative(value: f64, name: &'static str) -> Result<f64, Error> {
    if !value.is_finite() {
        return Err(Error::NotFinite);
    }
    if value < 0.0 { Err(Error::Parameter(name)) } else { Ok(value) }
}
