//! The profiles of ISO 14649-10: closed ones as outlines, open ones as cross-sections or open curves, and what they
//! sweep along a travel path. Every closed profile is counterclockwise and centred on its own origin, as the standard
//! places it.

use crate::geom::{P2, Seg, Vertex};
use crate::{Error, Path2, Region, positive};
use core::f64::consts::{FRAC_PI_2, PI, TAU};

/// Rectangle about the origin, length along x, width along y, corners rounded by `corner` (0: sharp).
pub fn rectangle(length: f64, width: f64, corner: f64) -> Result<Path2, Error> {
    let (l, w) = (positive(length, "length")?, positive(width, "width")?);
    let r = crate::not_negative(corner, "corner radius")?;
    if r > l.min(w) * 0.5 + 1e-9 {
        return Err(Error::Parameter("corner radius"));
    }
    let r = r.min(l.min(w) * 0.5);
    let (x, y) = (l * 0.5, w * 0.5);
    if r < 1e-6 {
        return Path2::polyline(&[P2::new(-x, -y), P2::new(x, -y), P2::new(x, y), P2::new(-x, y)], true);
    }
    let (i, j) = (x - r, y - r);
    let line = |ax, ay, bx, by| Seg::Line { a: P2::new(ax, ay), b: P2::new(bx, by) };
    let turn = |ax, ay, bx, by, cx, cy| Seg::Arc {
        a: P2::new(ax, ay),
        b: P2::new(bx, by),
        c: P2::new(cx, cy),
        sweep: FRAC_PI_2,
    };
    Path2::from_segs(
        [
            line(-i, -y, i, -y),
            turn(i, -y, x, -j, i, -j),
            line(x, -j, x, j),
            turn(x, j, i, y, i, j),
            line(i, y, -i, y),
            turn(-i, y, -x, j, -i, j),
            line(-x, j, -x, -j),
            turn(-x, -j, -i, -y, -i, -j),
        ],
        true,
    )
}

/// Circle about the origin.
pub fn circle(radius: f64) -> Result<Path2, Error> {
    Path2::circle(P2::default(), radius)
}

/// How the diameter of a regular polygon is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ngon {
    /// The corners lie on the circle.
    Inscribed,
    /// The sides touch the circle.
    Circumscribed,
}

/// Regular polygon about the origin, first corner on +x.
pub fn ngon(diameter: f64, sides: u32, kind: Ngon) -> Result<Path2, Error> {
    let r = positive(diameter, "diameter")? * 0.5;
    if !(3..=10_000).contains(&sides) {
        return Err(Error::Parameter("number of sides"));
    }
    let n = f64::from(sides);
    let r = if kind == Ngon::Circumscribed { r / libm::cos(PI / n) } else { r };
    let points: Vec<_> = (0..sides).map(|i| P2::polar(TAU * f64::from(i) / n) * r).collect();
    Path2::polyline(&points, true)
}

/// Part of a circle about the origin as an open curve, counterclockwise from +x.
pub fn partial_circle(radius: f64, sweep: f64) -> Result<Path2, Error> {
    let r = positive(radius, "radius")?;
    if !sweep.is_finite() {
        return Err(Error::NotFinite);
    }
    if sweep.abs() <= 1e-9 || sweep.abs() >= TAU {
        return Err(Error::Parameter("sweep angle"));
    }
    Path2::from_segs([Seg::arc_about(P2::default(), P2::new(r, 0.0), sweep)], false)
}

/// Straight open profile of this length from the origin along +x.
pub fn linear(length: f64) -> Result<Path2, Error> {
    let l = positive(length, "length")?;
    Path2::polyline(&[P2::default(), P2::new(l, 0.0)], false)
}

/// A cross-section of a slot, step or groove, which tells how wide it is at every depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Section {
    /// Flat bottom of `width`; walls that lean outwards by the two angles; fillets between bottom and walls.
    SquareU {
        /// Width of the bottom before fillets, mm.
        width: f64,
        /// Lean of the first wall from the tool axis, rad.
        first_angle: f64,
        /// Lean of the second wall, rad.
        second_angle: f64,
        /// Fillet at the first wall, mm.
        first_radius: f64,
        /// Fillet at the second wall, mm.
        second_radius: f64,
    },
    /// Half circle of this diameter at the bottom, upright walls.
    RoundedU {
        /// Diameter, mm.
        width: f64,
    },
    /// Two flanks that include `angle`, rounded at the bottom.
    Vee {
        /// Included angle, rad.
        angle: f64,
        /// Rounding at the bottom, mm (0: sharp).
        radius: f64,
        /// Tilt of the middle line from the tool axis, rad.
        tilt: f64,
    },
    /// Narrow above, wide below.
    Tee {
        /// Width of the neck, mm.
        neck: f64,
        /// Width of the foot, mm.
        foot: f64,
        /// Height of the foot above the bottom, mm.
        height: f64,
    },
}

impl Section {
    /// Width to the left and right of the middle line at `height` above the bottom of a section `depth` deep;
    /// (left, right), mm.
    pub fn half_widths(&self, height: f64) -> Result<(f64, f64), Error> {
        let h = crate::not_negative(height, "height")?;
        match *self {
            Self::SquareU { width, first_angle, second_angle, first_radius, second_radius } => {
                let half = positive(width, "width")? * 0.5;
                Ok((
                    flank(half, first_angle, first_radius, h)?,
                    flank(half, second_angle, second_radius, h)?,
                ))
            }
            Self::RoundedU { width } => {
                let r = positive(width, "width")? * 0.5;
                let w = if h >= r { r } else { (r * r - (r - h) * (r - h)).max(0.0).sqrt() };
                Ok((w, w))
            }
            Self::Vee { angle, radius, tilt } => vee(angle, radius, tilt, h),
            Self::Tee { neck, foot, height } => {
                let w = if h <= height { positive(foot, "foot width")? } else { positive(neck, "neck width")? };
                Ok((w * 0.5, w * 0.5))
            }
        }
    }
}

/// Half width at height `h` of a wall that leans by `angle` from a bottom `half` wide, with a fillet.
fn flank(half: f64, angle: f64, radius: f64, h: f64) -> Result<f64, Error> {
    let r = crate::not_negative(radius, "radius")?;
    if !angle.is_finite() {
        return Err(Error::NotFinite);
    }
    if !(0.0..FRAC_PI_2).contains(&angle) {
        return Err(Error::Parameter("wall angle"));
    }
    let straight = half + h * libm::tan(angle);
    // The fillet touches the bottom and the wall: its centre is r above the bottom.
    let centre = half - r * libm::tan((FRAC_PI_2 - angle) * 0.5);
    let touch = r * (1.0 - libm::sin(angle));
    if h >= touch || r == 0.0 {
        return Ok(straight);
    }
    Ok((centre + (r * r - (r - h) * (r - h)).max(0.0).sqrt()).max(0.0))
}

fn vee(angle: f64, radius: f64, tilt: f64, h: f64) -> Result<(f64, f64), Error> {
    let r = crate::not_negative(radius, "radius")?;
    if !angle.is_finite() || !tilt.is_finite() {
        return Err(Error::NotFinite);
    }
    if angle <= 1e-6 || angle >= PI || tilt.abs() + angle * 0.5 >= FRAC_PI_2 {
        return Err(Error::Parameter("profile angle"));
    }
    let half = angle * 0.5;
    // The rounding's lowest point is the bottom; the sharp corner lies below it.
    let below = r / libm::sin(half) - r;
    let side = |lean: f64| {
        let touch = r * (1.0 - libm::sin(lean));
        if h < touch { (r * r - (r - h) * (r - h)).max(0.0).sqrt() } else { (h + below) * libm::tan(lean) }
    };
    Ok((side(half - tilt), side(half + tilt)))
}

/// How a slot ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Half circle beyond the end of the travel path.
    Round,
    /// Straight across at the end of the travel path.
    Flat,
}

/// A travel path as an open or closed curve: straight along +x.
pub fn travel_linear(distance: f64) -> Result<Path2, Error> {
    linear(distance)
}

/// A circular travel path about `centre` from `start`; ±2π gives the complete circle (closed).
pub fn travel_circular(centre: P2, start: P2, sweep: f64) -> Result<Path2, Error> {
    if !centre.finite() || !start.finite() || !sweep.is_finite() {
        return Err(Error::NotFinite);
    }
    positive(centre.dist(start), "radius")?;
    if sweep.abs() <= 1e-9 || sweep.abs() > TAU + 1e-9 {
        return Err(Error::Parameter("sweep angle"));
    }
    if sweep.abs() >= TAU - 1e-9 {
        let half = Seg::arc_about(centre, start, PI * sweep.signum());
        let back = Seg::Arc { a: half.b(), b: start, c: centre, sweep: PI * sweep.signum() };
        return Path2::from_segs([half, back], true);
    }
    Path2::from_segs([Seg::arc_about(centre, start, sweep)], false)
}

/// The area a section sweeps in the plane along a travel path, `left` and `right` of it. The path must not come nearer
/// to itself than it is wide.
pub fn sweep(path: &Path2, left: f64, right: f64, start: End, end: End) -> Result<Region, Error> {
    let (l, r) = (positive(left, "width")?, positive(right, "width")?);
    if path.is_closed() {
        return sweep_closed(path, l, r);
    }
    if (start == End::Round || end == End::Round) && (l - r).abs() > 1e-9 {
        return Err(Error::Parameter("end of an uneven slot"));
    }
    let right_side = crate::offset_open(path, -r)?;
    let left_side = crate::offset_open(path, l)?.reversed();
    let mut segs = right_side.segs().to_vec();
    cap(&mut segs, left_side.start(), path.end(), end);
    segs.extend(left_side.segs().iter().copied());
    cap(&mut segs, right_side.start(), path.start(), start);
    Region::new(Path2::from_segs(segs, true)?, Vec::new())
}

fn cap(segs: &mut Vec<Seg>, to: P2, about: P2, end: End) {
    let Some(from) = segs.last().map(Seg::b) else { return };
    segs.push(match end {
        End::Round => Seg::Arc { a: from, b: to, c: about, sweep: PI },
        End::Flat => Seg::Line { a: from, b: to },
    });
}

fn sweep_closed(path: &Path2, left: f64, right: f64) -> Result<Region, Error> {
    let ccw = path.is_ccw();
    let (inside, outside) = if ccw { (left, right) } else { (right, left) };
    let mut outer = crate::grow(core::slice::from_ref(path), outside)?;
    if outer.len() != 1 {
        return Err(Error::Parameter("width"));
    }
    let ring = Region::new(path.clone(), Vec::new())?;
    let holes = crate::erode(&ring, inside)?.iter().map(|r| r.outer().reversed()).collect();
    Region::new(outer.remove(0).outer().clone(), holes)
}

/// A closed profile from points and bulges, as the standard's composite curves give it.
pub fn general(vertices: &[Vertex], closed: bool) -> Result<Path2, Error> {
    Path2::from_vertices(vertices, closed)
}
