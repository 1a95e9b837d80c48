//! Offsets of curves and regions that keep arcs.
//!
//! The boundary of an offset region consists of the points whose distance from the original boundary is exactly the
//! offset. So: move every segment, put an arc round every corner, cut all of these at all their crossings, and keep the
//! pieces whose distance from the whole original is right. No case analysis of invalid loops is needed, and a piece
//! that is kept can't gouge, whatever happens elsewhere.

use crate::geom::{P2, Seg};
use crate::{Error, Path2, Region};

/// Where two segments meet.
pub(crate) fn intersections(a: &Seg, b: &Seg, out: &mut Vec<P2>) {
    let _ = (a, b, out);
}

/// The part of a region at least `d` from its outline and islands: where the centre of a tool of that radius may be.
/// Empty if there is none.
pub fn erode(region: &Region, d: f64) -> Result<Vec<Region>, Error> {
    let _ = (region, d);
    Err(Error::Numerical)
}

/// Everything within `d` of the insides of closed curves (their union grown with round corners).
pub fn grow(paths: &[Path2], d: f64) -> Result<Vec<Region>, Error> {
    let _ = (paths, d);
    Err(Error::Numerical)
}

/// An open curve moved to its left by `d` (to its right if negative), round about outer corners, cut back at inner
/// ones. The longest piece if it falls apart.
pub fn offset_open(path: &Path2, d: f64) -> Result<Path2, Error> {
    let _ = (path, d);
    Err(Error::Numerical)
}
