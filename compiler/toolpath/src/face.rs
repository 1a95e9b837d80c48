//! Facing: parallel lines over a plane that begin and end outside it.

use crate::{Error, Pass, Path2, Region};

/// What [`face`] is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// Tool radius, mm.
    pub radius: f64,
    /// Distance between lines, mm, at most the diameter; made smaller so that the lines divide the width evenly.
    pub stepover: f64,
    /// Direction of the (first) line, rad from +x.
    pub angle: f64,
    /// To and fro (true) or all in one direction.
    pub bidirectional: bool,
    /// The next line is on the left.
    pub step_left: bool,
    /// How far the tool's circle leaves the face at line ends, mm. Negative: the line ends that much before.
    pub overrun: f64,
}

impl Face {
    /// To and fro along x, tool wholly off the face at both ends.
    pub fn new(radius: f64, stepover: f64) -> Self {
        Self { radius, stepover, angle: 0.0, bidirectional: true, step_left: true, overrun: 1.0 }
    }
}

/// Lines over a closed outline, kept off these bosses (they may reach over the outline).
pub fn face(outline: &Path2, bosses: &[Path2], what: &Face) -> Result<Vec<Pass>, Error> {
    let _ = (outline, bosses, what);
    let _: Option<Region> = None;
    Err(Error::Numerical)
}
