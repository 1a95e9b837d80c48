//! What a tool can't reach: inner corners sharper than its radius, necks narrower than its diameter.

use crate::geom::Seg;
use crate::clear::places;
use crate::offset::{difference, dilate};
use crate::{Error, P2, Path2, Region, positive};

/// Spots are found this much narrower than they are, so that walls shared with the clean area don't count.
const HAIR: f64 = 1e-4;

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

/// What a tool of this radius leaves in a region, largest first. Spots below 1e-4 mm² are left out, and those in the
/// air: the part of the region that lets the tool pass where there is nothing to be cut.
pub fn residuals(region: &Region, air: &[Region], radius: f64) -> Result<Vec<Residual>, Error> {
    let r = positive(radius, "tool radius")?;
    let mut out: Vec<Residual> = spots(region, air, r)?.iter().map(|s| described(region, air, s, r)).collect();
    out.retain(|s| s.area > 1e-4);
    out.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.at.x.total_cmp(&b.at.x)).then(a.at.y.total_cmp(&b.at.y)));
    Ok(out)
}

fn spots(region: &Region, air: &[Region], r: f64) -> Result<Vec<Region>, Error> {
    let whole = core::slice::from_ref(region);
    let room = places(region, r)?;
    if room.is_empty() && air.is_empty() {
        return Ok(vec![region.clone()]);
    }
    let mut reached = if room.is_empty() { Vec::new() } else { dilate(&room, r)? };
    reached.extend_from_slice(air);
    difference(whole, &reached, HAIR)
}

fn described(region: &Region, air: &[Region], spot: &Region, r: f64) -> Residual {
    let area = spot.area() + HAIR * spot.loops().map(Path2::length).sum::<f64>();
    let near = spot.bounds().grown(4.0 * HAIR);
    let inside = |p: P2| near.dist(p) <= 0.0 && (spot.contains(p) || spot.dist(p) < 20.0 * HAIR);
    let mut at = None;
    let mut needs = r;
    for l in region.loops() {
        let segs = l.segs();
        for (i, s) in segs.iter().enumerate() {
            let next = &segs[(i + 1) % segs.len()];
            // Corners the free side is inside of.
            if s.tangent(1.0).cross(next.tangent(0.0)) > 1e-6 && inside(s.b()) {
                at = Some(s.b());
                needs = 0.0;
            }
            if let (Seg::Arc { sweep, .. }, Some(own)) = (s, s.radius()) {
                if *sweep > 0.0 && own < r && own < needs && inside(s.at(0.5)) {
                    at = Some(s.at(0.5));
                    needs = own;
                }
            }
        }
    }
    let at = at.unwrap_or_else(|| middle(spot));
    if needs >= r {
        needs = neck(region, air, spot, r);
    }
    Residual { at, area, needs_radius: needs }
}

fn middle(spot: &Region) -> P2 {
    let b = spot.bounds();
    let centre = b.min.lerp(b.max, 0.5);
    if spot.contains(centre) { centre } else { spot.outer().segs().first().map_or(centre, |s| s.at(0.5)) }
}

/// The tool that just passes: found by halving.
fn neck(region: &Region, air: &[Region], spot: &Region, r: f64) -> f64 {
    let (mut lo, mut hi) = (0.0, r);
    for _ in 0..16 {
        let mid = (lo + hi) * 0.5;
        let stays = spots(region, air, mid.max(1e-5)).is_ok_and(|left| {
            left.iter().any(|s| s.bounds().overlaps(&spot.bounds()) && s.area() > 1e-6)
        });
        if stays { hi = mid } else { lo = mid }
    }
    lo
}
