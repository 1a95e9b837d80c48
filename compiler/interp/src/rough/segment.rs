//! One piece of a contour: where it ends, how it meets its neighbours, how the tool climbs and dives along it.

use super::points::{QUARTER, Zx, min_max};

pub(super) const TOLERANCE: f64 = 1e-6;
/// Shorter segments are dropped.
pub(super) const SHORT: f64 = 1e-3;

/// A move that comes out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cut {
    /// Rapid to where a finishing pass begins.
    Approach(Zx),
    Rapid(Zx),
    Line(Zx),
    /// Counter-clockwise?, centre, end.
    Arc(bool, Zx, Zx),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    Line,
    Arc { ccw: bool, centre: Zx },
}

/// What a corner word asks for; it becomes a segment once both neighbours are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Corner {
    No,
    Fillet,
    Chamfer,
}

/// One piece of a contour.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment {
    pub(super) start: Zx,
    pub(super) end: Zx,
    pub(super) shape: Shape,
    pub(super) corner: Corner,
    /// Size of a fillet or chamfer that is not made yet.
    pub(super) finish: f64,
}

/// Why a contour can't be machined.
pub(super) type Trouble<T = ()> = Result<T, String>;

impl Segment {
    pub(crate) fn line(start: Zx, end: Zx) -> Segment {
        Segment { start, end, shape: Shape::Line, corner: Corner::No, finish: 0.0 }
    }
    pub(crate) fn arc(ccw: bool, start: Zx, centre: Zx, end: Zx) -> Segment {
        Segment { start, end, shape: Shape::Arc { ccw, centre }, corner: Corner::No, finish: 0.0 }
    }
    pub(crate) fn fillet(radius: f64, at: Zx) -> Segment {
        Segment { corner: Corner::Fillet, finish: radius, ..Segment::arc(false, at, at, at) }
    }
    pub(crate) fn chamfer(size: f64, at: Zx) -> Segment {
        Segment { corner: Corner::Chamfer, finish: size, ..Segment::line(at, at) }
    }
    /// A copy that is only its shape.
    pub(super) fn plain(&self) -> Segment {
        Segment { corner: Corner::No, ..*self }
    }

    pub(super) fn map(&mut self, f: impl Fn(Zx) -> Zx, mirrors: bool) {
        self.start = f(self.start);
        self.end = f(self.end);
        if let Shape::Arc { ccw, centre } = &mut self.shape {
            *ccw ^= mirrors;
            *centre = f(*centre);
        }
    }

    pub(super) fn draw(&self) -> Cut {
        match self.shape {
            Shape::Line => Cut::Line(self.end),
            Shape::Arc { ccw, centre } => Cut::Arc(ccw, centre, self.end),
        }
    }

    /// How small it has become.
    pub(super) fn size(&self) -> f64 {
        let length = (self.start - self.end).len();
        match self.shape {
            Shape::Line => length,
            Shape::Arc { centre, .. } => min_max(length, (self.start - centre).len()).0,
        }
    }

    pub(super) fn vanished(&self) -> bool {
        self.size() < SHORT
    }

    pub(super) fn monotonic(&self) -> bool {
        let dz = (self.end - self.start).z;
        match self.shape {
            Shape::Line => dz <= 1e-3,
            Shape::Arc { .. } if self.finish != 0.0 => true,
            Shape::Arc { ccw, centre } => {
                let (entry, exit) = ((self.start - centre).x, (self.end - centre).x);
                let above = if ccw { entry >= -1e-3 && exit >= -1e-3 } else { entry <= 1e-3 && exit <= 1e-3 };
                above && dz <= -1e-3
            }
        }
    }

    /// Moves the segment sideways.
    pub(super) fn offset(&mut self, distance: f64) {
        match self.shape {
            Shape::Line => {
                let back = self.start - self.end;
                let d = (QUARTER.scaled(distance) * back).over(back.len());
                self.start = self.start + d;
                self.end = self.end + d;
            }
            Shape::Arc { ccw, centre } => {
                let r = (self.start - centre).len();
                let f = (r + if ccw { distance } else { -distance }) / r;
                self.start = (self.start - centre).scaled(f) + centre;
                self.end = (self.end - centre).scaled(f) + centre;
            }
        }
    }

    /// Z where the segment crosses a level of X.
    pub(super) fn crossings(&self, x: f64) -> Vec<f64> {
        match self.shape {
            Shape::Line => self.line_crossings(x),
            Shape::Arc { ccw, centre } => self.arc_crossings(x, ccw, centre),
        }
    }

    pub(super) fn line_crossings(&self, x: f64) -> Vec<f64> {
        let (low, high) = min_max(self.start.x, self.end.x);
        if low > x + TOLERANCE || high < x - TOLERANCE {
            return Vec::new();
        }
        if (self.start - self.end).x.abs() < TOLERANCE {
            return vec![self.start.z, self.end.z];
        }
        let along = (x - self.start.x) / (self.end.x - self.start.x);
        vec![along * (self.end.z - self.start.z) + self.start.z]
    }

    pub(super) fn arc_crossings(&self, x: f64, ccw: bool, centre: Zx) -> Vec<f64> {
        let r = (self.start - centre).len();
        let s = -(x - r - centre.x) * (x + r - centre.x);
        if s < -TOLERANCE {
            return Vec::new();
        }
        let s = if s < 0.0 { 0.0 } else { s }.sqrt();
        let on = |p: Zx| {
            let after = ((self.start - centre).mirror() * (p - centre)).x;
            let before = ((self.end - centre).mirror() * (p - centre)).x;
            if ccw {
                after >= -TOLERANCE && before <= TOLERANCE
            } else {
                after <= TOLERANCE && before >= -TOLERANCE
            }
        };
        [centre.z + s, centre.z - s].into_iter().filter(|z| on(Zx::new(*z, x))).collect()
    }

    /// Cuts or prolongs both segments to their crossing.
    pub(super) fn join(&mut self, next: &mut Segment) -> Trouble {
        match (self.shape, next.shape) {
            (Shape::Line, Shape::Line) => join_lines(self, next),
            (Shape::Arc { centre, .. }, Shape::Line) => {
                if (next.start - self.end).len() >= TOLERANCE {
                    let p = line_circle(next.start, next.end, self.end, centre, next.start);
                    (self.end, next.start) = (p, p);
                }
                Ok(())
            }
            (Shape::Line, Shape::Arc { centre, .. }) => {
                if (next.start - self.end).len() >= TOLERANCE {
                    let p = line_circle(self.start, self.end, next.end, centre, next.start);
                    (self.end, next.start) = (p, p);
                }
                Ok(())
            }
            (Shape::Arc { centre: first, .. }, Shape::Arc { centre, .. }) => {
                join_arcs(self, first, next, centre);
                Ok(())
            }
        }
    }

    /// Follows the contour upwards from `at`; true when it does not rise here.
    pub(super) fn climb(&self, at: &mut Zx, out: &mut Vec<Cut>) -> Trouble<bool> {
        let Shape::Arc { ccw, centre } = self.shape else {
            if self.end.x + TOLERANCE < self.start.x {
                return Ok(true);
            }
            if (*at - self.start).len() > TOLERANCE {
                return Err("How did we get here?".into());
            }
            out.push(Cut::Line(self.end));
            *at = self.end;
            return Ok(false);
        };
        if ccw {
            if at.z < centre.z {
                return Ok(true);
            }
            self.climb_to_top(at, centre, out);
            return Ok(true);
        }
        if at.z > centre.z {
            return Ok(true);
        }
        if (*at - self.end).len() > 1e-3 {
            out.push(Cut::Arc(ccw, centre, self.end));
        }
        *at = self.end;
        Ok(false)
    }

    /// Counter-clockwise arc: up to its end, or to its top if that comes first.
    pub(super) fn climb_to_top(&self, at: &mut Zx, centre: Zx, out: &mut Vec<Cut>) {
        let mut end = self.end;
        if end.z < centre.z {
            end = Zx::new(centre.z, centre.x + (self.start - centre).len());
        }
        if (*at - end).len() > 1e-3 {
            out.push(Cut::Arc(true, centre, end));
        }
        *at = end;
    }

    /// For cuts without pockets: up along the rising parts only.
    pub(super) fn climb_only(&self, at: &mut Zx, out: &mut Vec<Cut>) {
        if matches!(self.shape, Shape::Line) && self.end.x < self.start.x {
            return;
        }
        let is = self.crossings(at.x);
        let (Some(front), Some(back)) = (is.first().copied(), is.last().copied()) else {
            return;
        };
        match self.shape {
            Shape::Line => {
                at.z = front;
                out.push(Cut::Line(*at));
                out.push(Cut::Line(self.end));
                *at = self.end;
            }
            Shape::Arc { ccw: false, centre } => {
                if back > centre.z {
                    return;
                }
                at.z = back;
                out.push(Cut::Line(*at));
                if (*at - self.end).len() > 1e-3 {
                    out.push(Cut::Arc(false, centre, self.end));
                }
                *at = self.end;
            }
            Shape::Arc { ccw: true, centre } => {
                if front < centre.z {
                    return;
                }
                at.z = front;
                out.push(Cut::Line(*at));
                self.climb_to_top(at, centre, out);
            }
        }
    }

    /// Follows the contour downwards to the level `x`; true when it does not fall here.
    pub(super) fn dive(&self, at: &mut Zx, x: f64, out: &mut Vec<Cut>, fast: bool) -> Trouble<bool> {
        let Shape::Arc { ccw, centre } = self.shape else {
            return self.dive_line(at, x, out, fast);
        };
        if (*at - self.end).len() < TOLERANCE || (*at - self.end).z <= TOLERANCE {
            *at = self.end;
            return Ok(false);
        }
        let mut is = self.crossings(x);
        if is.is_empty() {
            is = self.crossings(x - TOLERANCE);
        }
        let wrong_half = if ccw { at.z - TOLERANCE > centre.z } else { at.z <= centre.z };
        if wrong_half {
            return Ok(true);
        }
        let hit = if ccw { is.last().copied().filter(|z| *z <= centre.z) } else { is.first().copied() };
        match hit {
            // Hit at the back only: the next level will do.
            Some(z) if !ccw && z < centre.z => {}
            Some(z) => {
                let end = Zx::new(z, x);
                out.push(Cut::Arc(ccw, centre, end));
                *at = end;
            }
            None => {
                out.push(Cut::Arc(ccw, centre, self.end));
                *at = self.end;
            }
        }
        Ok(false)
    }

    pub(super) fn dive_line(&self, at: &mut Zx, x: f64, out: &mut Vec<Cut>, fast: bool) -> Trouble<bool> {
        if self.start.x <= self.end.x + TOLERANCE {
            return Ok(true);
        }
        let end = if x < self.end.x {
            self.end
        } else {
            let is = self.crossings(x);
            Zx::new(*is.first().ok_or("x too large in straight dive")?, x)
        };
        out.push(if fast { Cut::Rapid(end) } else { Cut::Line(end) });
        *at = end;
        Ok(false)
    }
}

pub(super) fn join_lines(first: &mut Segment, next: &mut Segment) -> Trouble {
    let turn = (next.start - next.end).mirror().over((next.start - next.end).len());
    let ps = (first.start - next.end) * turn;
    let pe = (first.end - next.end) * turn;
    if (ps - pe).x == 0.0 {
        return Err("Cannot intersect parallel lines".into());
    }
    let f = ps.x / (ps - pe).x;
    let p = (ps + (pe - ps).scaled(f)).unturned(turn) + next.end;
    (first.end, next.start) = (p, p);
    Ok(())
}

/// Crossing of the line `a`–`b` and the circle through `on` around `centre`, the one nearer to `near`.
pub(super) fn line_circle(a: Zx, b: Zx, on: Zx, centre: Zx, near: Zx) -> Zx {
    let turn = (a - b).mirror().over((a - b).len());
    let pe = (on - b) * turn;
    let pc = (centre - b) * turn;
    let s = (pc - pe).square() - pc.x * pc.x;
    let s = if s < 0.0 { 0.0 } else { s.sqrt() };
    let p1 = Zx::new(pc.z + s, 0.0).unturned(turn) + b;
    let p2 = Zx::new(pc.z - s, 0.0).unturned(turn) + b;
    if (near - p1).len() < (near - p2).len() { p1 } else { p2 }
}

pub(super) fn join_arcs(first: &mut Segment, first_centre: Zx, next: &mut Segment, centre: Zx) {
    let a = (next.start - centre).len();
    let b = (first.start - first_centre).len();
    let c = (centre - first_centre).len();
    let cosine = (c * c + a * a - b * b) / 2.0 / a / c;
    let square = cosine * cosine;
    let square = if square > 1.0 { 1.0 } else { square };
    let turn = Zx::new(cosine, (1.0 - square).sqrt());
    let p = (turn * (first_centre - centre)).over(c).scaled(a) + centre;
    (first.end, next.start) = (p, p);
}
