//! An area to be machined: an outline with islands. Islands may touch or cross the outline and each other; what counts
//! is what is inside the outline and outside every island.

use crate::geom::{Bounds, P2};
use crate::{Error, Path2};

/// Outline (counterclockwise) and islands (clockwise): the free side is on the left of every curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    outer: Path2,
    holes: Vec<Path2>,
}

impl Region {
    /// From closed curves of any direction, each free of self-intersections.
    pub fn new(outer: Path2, holes: Vec<Path2>) -> Result<Self, Error> {
        let outer = checked(&outer)?.oriented(true);
        let holes = holes.iter().map(|h| Ok(checked(h)?.oriented(false))).collect::<Result<_, Error>>()?;
        Ok(Self { outer, holes })
    }
    /// Without the checks, for curves that come from the offsetter.
    pub(crate) fn trusted(outer: Path2, holes: Vec<Path2>) -> Self {
        Self { outer, holes }
    }
    /// The outline, counterclockwise.
    pub fn outer(&self) -> &Path2 {
        &self.outer
    }
    /// The islands, clockwise.
    pub fn holes(&self) -> &[Path2] {
        &self.holes
    }
    /// Outline, then islands.
    pub fn loops(&self) -> impl Iterator<Item = &Path2> {
        core::iter::once(&self.outer).chain(&self.holes)
    }
    /// Is `p` inside the outline and outside every island?
    pub fn contains(&self, p: P2) -> bool {
        self.outer.contains(p) && !self.holes.iter().any(|h| h.contains(p))
    }
    /// Distance from the nearest curve.
    pub fn dist(&self, p: P2) -> f64 {
        self.loops().map(|l| l.dist(p)).fold(f64::INFINITY, f64::min)
    }
    /// May a tool of this radius stand at `p` (to within `tol`)?
    pub fn fits(&self, p: P2, radius: f64, tol: f64) -> bool {
        self.contains(p) && self.dist(p) >= radius - tol
    }
    /// Area; islands must not overlap each other or the outline for this to be exact.
    pub fn area(&self) -> f64 {
        self.loops().map(Path2::area).sum()
    }
    /// Its box.
    pub fn bounds(&self) -> Bounds {
        self.outer.bounds()
    }
    /// Turned about the origin.
    pub fn rotated(&self, angle: f64) -> Self {
        Self { outer: self.outer.rotated(angle), holes: self.holes.iter().map(|h| h.rotated(angle)).collect() }
    }
    /// Moved by `d`.
    pub fn moved(&self, d: P2) -> Self {
        Self { outer: self.outer.moved(d), holes: self.holes.iter().map(|h| h.moved(d)).collect() }
    }
}

fn checked(path: &Path2) -> Result<&Path2, Error> {
    if !path.is_closed() {
        return Err(Error::NotClosed);
    }
    if path.area().abs() < 1e-9 {
        return Err(Error::NoArea);
    }
    match path.self_intersection() {
        Some(p) => Err(Error::SelfIntersecting(p)),
        None => Ok(path),
    }
}
