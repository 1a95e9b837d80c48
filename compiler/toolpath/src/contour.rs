//! Passes along walls, and along the middle of slots.

use crate::clear::{curves, inradius, room, segment_fits};
use crate::geom::{Seg, TOL};
use crate::offset::{erode, grow, offset_open};
use crate::{CutMode, Error, Link, P2, Pass, Path2, Region, Role, positive};
use core::f64::consts::FRAC_PI_2;

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

impl Contour {
    fn inset(&self) -> Result<f64, Error> {
        let r = positive(self.radius, "tool radius")?;
        let leads = [self.lead_in, self.lead_out].map(|l| match l {
            Lead::None => Ok(0.0),
            Lead::Arc(d) | Lead::Line(d) => positive(d, "lead"),
        });
        for lead in leads {
            lead?;
        }
        Ok(r + crate::not_negative(self.allowance, "allowance")?)
    }
    /// Distances from the wall's path, the furthest first, the wall itself last.
    fn steps(&self) -> Result<Vec<f64>, Error> {
        let stock = crate::not_negative(self.stock, "stock")?;
        let step = positive(self.stepover, "stepover")?;
        let n = (stock / step - 1e-9).ceil().max(1.0);
        if n > 10_000.0 {
            return Err(Error::TooManyPasses);
        }
        Ok((0..n as usize).rev().map(|i| stock * i as f64 / n).collect())
    }
    fn climb(&self) -> bool {
        self.cut_mode == CutMode::Climb
    }
}

/// Where the tool centre may be, for leads.
enum Room<'a> {
    Inside(&'a Region, f64),
    /// Off these closed curves.
    Outside(&'a [Path2], f64),
    /// Off this open curve.
    Beside(&'a Path2, f64),
}

impl Room<'_> {
    fn holds(&self, p: P2) -> bool {
        match *self {
            Self::Inside(region, d) => region.fits(p, d, 1e-5),
            Self::Outside(paths, d) => paths.iter().all(|q| !q.contains(p) && q.dist(p) >= d - 1e-5),
            Self::Beside(path, d) => path.dist(p) >= d - 1e-5,
        }
    }
    fn holds_path(&self, path: &Path2) -> bool {
        path.sampled(0.05).into_iter().all(|p| self.holds(p))
    }
}

/// Side milling of a region's walls from inside: the outline and every island.
pub fn contour_closed(region: &Region, what: &Contour) -> Result<Vec<Pass>, Error> {
    let inset = what.inset()?;
    let mut passes = Vec::new();
    // The wall must be reachable at all; what is in front of it may be narrower.
    room(region, inset)?;
    let steps = what.steps()?;
    for (k, d) in steps.iter().enumerate() {
        let level = if *d < TOL { room(region, inset)? } else { erode(region, inset + d)? };
        for part in &level {
            for path in curves(part) {
                let path = if what.climb() { path } else { path.reversed() };
                let place = Room::Inside(region, inset + d);
                let pass = dressed(path, what, &place, k + 1 == steps.len());
                passes.push(linked(pass, passes.last(), |p, q| segment_fits(region, p, q, inset), what));
            }
        }
    }
    Ok(passes)
}

/// Side milling along a curve: a closed one from outside (`Left` of a clockwise, `Right` of a counterclockwise one) or
/// inside, an open one on the side given. The cut mode decides the direction of travel; `On` keeps the curve's.
pub fn contour(path: &Path2, side: Side, what: &Contour) -> Result<Vec<Pass>, Error> {
    let inset = what.inset()?;
    if side == Side::On {
        let path = if path.is_closed() { what.start.map_or_else(|| path.clone(), |p| path.starting_near(p)) } else { path.clone() };
        return Ok(vec![Pass { path, role: Role::Wall, link: Link::Retract }]);
    }
    if path.is_closed() {
        if (side == Side::Left) == path.is_ccw() {
            return contour_closed(&Region::new(path.clone(), Vec::new())?, what);
        }
        return around(path, inset, what);
    }
    beside(path, side, inset, what)
}

fn around(path: &Path2, inset: f64, what: &Contour) -> Result<Vec<Pass>, Error> {
    let solid = [path.clone()];
    let mut passes: Vec<Pass> = Vec::new();
    let steps = what.steps()?;
    for (k, d) in steps.iter().enumerate() {
        for part in grow(&solid, inset + d)? {
            for curve in part.loops() {
                let curve = if what.climb() { curve.reversed() } else { curve.clone() };
                let place = Room::Outside(&solid, inset + d);
                let pass = dressed(curve, what, &place, k + 1 == steps.len());
                passes.push(linked(pass, passes.last(), |p, q| outside_fits(path, p, q, inset), what));
            }
        }
    }
    Ok(passes)
}

fn outside_fits(path: &Path2, p: P2, q: P2, d: f64) -> bool {
    let n = (p.dist(q) / 0.05).ceil().clamp(1.0, 1e4);
    (0..=n as usize).all(|i| {
        let at = p.lerp(q, i as f64 / n);
        !path.contains(at) && path.dist(at) >= d - 1e-5
    })
}

fn beside(path: &Path2, side: Side, inset: f64, what: &Contour) -> Result<Vec<Pass>, Error> {
    let sign = if side == Side::Left { 1.0 } else { -1.0 };
    let along = (side == Side::Left) == what.climb();
    let mut passes = Vec::new();
    let steps = what.steps()?;
    for (k, d) in steps.iter().enumerate() {
        let moved = offset_open(path, sign * (inset + d))?;
        let moved = if along { moved } else { moved.reversed() };
        let place = Room::Beside(path, inset + d);
        let path = dressed(moved, what, &place, k + 1 == steps.len());
        passes.push(Pass { path, role: Role::Wall, link: Link::Retract });
    }
    Ok(passes)
}

fn linked(path: Path2, last: Option<&Pass>, fits: impl Fn(P2, P2) -> bool, what: &Contour) -> Pass {
    let from = last.map(|l| l.path.end());
    let link = from.filter(|p| {
        let d = p.dist(path.start());
        d > 1e-6 && d <= 2.5 * what.stepover && fits(*p, path.start())
    });
    let way = link.and_then(|p| Path2::polyline(&[p, path.start()], false).ok());
    Pass { path, role: Role::Wall, link: way.map_or(Link::Retract, Link::Stay) }
}

/// A wall pass from its starting point, with leads where they fit. Only the last of several passes gets them.
fn dressed(path: Path2, what: &Contour, place: &Room<'_>, last: bool) -> Path2 {
    let candidates = starts(&path, what);
    let bare = candidates.first().cloned().unwrap_or(path);
    if !last || (what.lead_in == Lead::None && what.lead_out == Lead::None) {
        return bare;
    }
    for k in [1.0, 0.5, 0.25, 0.125] {
        for c in &candidates {
            let (Some(into), Some(out)) = (lead(c, what, what.lead_in, k, true, place), lead(c, what, what.lead_out, k, false, place))
            else {
                continue;
            };
            let mut whole = c.opened();
            if let Some(path) = into {
                whole = path.then(&whole);
            }
            if let Some(path) = out {
                whole = whole.then(&path);
            }
            return whole;
        }
    }
    bare
}

/// The curve begun at sensible places: where asked, in the middle of long segments.
fn starts(path: &Path2, what: &Contour) -> Vec<Path2> {
    if !path.is_closed() {
        return vec![path.clone()];
    }
    let mut out: Vec<Path2> = what.start.map(|p| path.starting_near(p)).into_iter().collect();
    let mut order: Vec<usize> = (0..path.segs().len()).collect();
    order.sort_by(|&l, &r| path.segs()[r].len().total_cmp(&path.segs()[l].len()).then(l.cmp(&r)));
    out.extend(order.into_iter().take(6).map(|i| path.starting_at(i, 0.5)));
    out
}

/// The lead, if it fits: `Some(None)` where none was asked for.
fn lead(path: &Path2, what: &Contour, kind: Lead, k: f64, into: bool, place: &Room<'_>) -> Option<Option<Path2>> {
    let (p, t) = if into { (path.start(), path.start_tangent()) } else { (path.end(), path.end_tangent()) };
    let sign = if what.climb() { 1.0 } else { -1.0 };
    let free = t.left() * sign;
    let way = match kind {
        Lead::None => return Some(None),
        Lead::Arc(r) => {
            let c = p + free * (r * k);
            let beside = if into { c - t * (r * k) } else { c + t * (r * k) };
            let (a, b) = if into { (beside, p) } else { (p, beside) };
            Seg::Arc { a, b, c, sweep: FRAC_PI_2 * sign }
        }
        Lead::Line(l) => {
            let straight = if into { -t } else { t };
            let q = p + if path.is_closed() { free } else { straight } * (l * k);
            let (a, b) = if into { (q, p) } else { (p, q) };
            Seg::Line { a, b }
        }
    };
    let way = Path2::from_segs([way], false).ok()?;
    place.holds_path(&way).then_some(Some(way))
}

/// A slot of this width along a travel path, its ends round about the path's ends: the middle line if the tool is as
/// wide as the slot, else the middle line and rings about it up to the walls. A tool wider than the slot is an error.
pub fn slot(path: &Path2, width: f64, what: &Contour) -> Result<Vec<Pass>, Error> {
    let inset = what.inset()?;
    let half = positive(width, "slot width")? * 0.5;
    if half < inset - 1e-6 {
        return Err(Error::ToolTooLarge { fits: half });
    }
    let spare = half - inset;
    let mut passes = vec![Pass { path: path.clone(), role: Role::Clear, link: Link::Retract }];
    if spare <= 1e-5 {
        passes[0].role = Role::Wall;
        return Ok(passes);
    }
    let step = positive(what.stepover, "stepover")?;
    let n = (spare / step - 1e-9).ceil().max(1.0);
    if n > 10_000.0 {
        return Err(Error::TooManyPasses);
    }
    for i in 1..=n as usize {
        let h = spare * i as f64 / n;
        let ring = crate::profile::sweep(path, h, h, crate::profile::End::Round, crate::profile::End::Round)?;
        let role = if i as f64 >= n { Role::Wall } else { Role::Clear };
        for curve in ring.loops() {
            let curve = if what.climb() { curve.clone() } else { curve.reversed() };
            let pen = passes.last().map_or(path.end(), |p| p.path.end());
            let curve = curve.starting_near(pen);
            // The next ring is one step away, through material that belongs to the slot.
            let near = pen.dist(curve.start()) <= step * 1.5 + TOL;
            let way = Path2::polyline(&[pen, curve.start()], false).ok().filter(|_| near);
            passes.push(Pass { path: curve, role, link: way.map_or(Link::Retract, Link::Stay) });
        }
    }
    Ok(passes)
}

/// Radius of the largest tool that fits into a region.
pub fn largest_tool(region: &Region) -> Result<f64, Error> {
    inradius(region)
}
