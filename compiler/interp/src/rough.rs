//! G70, G71, G72: finishing and roughing of a turned contour that stands in a subroutine.
//!
//! A point is (Z, X). The contour is turned and mirrored until the stock lies above it and the cut runs towards
//! smaller Z; the moves found there are turned back before they are made. Facing (G72) is roughing of the
//! contour turned by a quarter.

use gr_canon::{Plane, Sink, Version};
use gr_spec::{code, rs274};

use crate::arc::general;
use crate::{Fault, Interp, Res};

const TOLERANCE: f64 = 1e-6;
/// Shorter segments are dropped.
const SHORT: f64 = 1e-3;

/// A point or vector: Z, X.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(crate) struct Zx {
    pub z: f64,
    pub x: f64,
}

/// A quarter turn.
const QUARTER: Zx = Zx { z: 0.0, x: 1.0 };

impl Zx {
    pub(crate) fn new(z: f64, x: f64) -> Zx {
        Zx { z, x }
    }
    fn len(self) -> f64 {
        length(self.z, self.x)
    }
    fn square(self) -> f64 {
        self.z * self.z + self.x * self.x
    }
    fn mirror(self) -> Zx {
        Zx::new(self.z, -self.x)
    }
    fn scaled(self, f: f64) -> Zx {
        Zx::new(self.z * f, self.x * f)
    }
    fn over(self, f: f64) -> Zx {
        Zx::new(self.z / f, self.x / f)
    }
    /// Undoes the turn (and scale) of `b`: Smith's division of complex numbers (1962), whose rounding decides
    /// whether a pass that runs along the axis counts as level.
    fn unturned(self, b: Zx) -> Zx {
        if b.z.abs() < b.x.abs() {
            let ratio = b.z / b.x;
            let d = b.z * ratio + b.x;
            return Zx::new((self.z * ratio + self.x) / d, (self.x * ratio - self.z) / d);
        }
        let ratio = b.x / b.z;
        let d = b.x * ratio + b.z;
        if ratio.abs() > f64::MIN_POSITIVE {
            return Zx::new((self.x * ratio + self.z) / d, (self.x - self.z * ratio) / d);
        }
        Zx::new((self.z + b.x * (self.x / b.z)) / d, (self.x - b.x * (self.z / b.z)) / d)
    }
    fn middle(self, b: Zx) -> Zx {
        (self + b).over(2.0)
    }
}

/// Hypotenuse with one correction step, rounded right in all but rare cases (Borges, "An improved algorithm for
/// hypot(a,b)", 2019).
fn length(a: f64, b: f64) -> f64 {
    let (small, large) = min_max(a.abs(), b.abs());
    if large == 0.0 || small <= large * (f64::EPSILON / 2.0) || !large.is_finite() {
        return large + small;
    }
    let h = (large * large + small * small).sqrt();
    let (t1, t2) = if h <= 2.0 * small {
        let delta = h - small;
        (large * (2.0 * delta - large), (delta - 2.0 * (large - small)) * delta)
    } else {
        let delta = h - large;
        (2.0 * delta * (large - 2.0 * small), (4.0 * delta - small) * small + delta * delta)
    };
    h - (t1 + t2) / (2.0 * h)
}

impl std::ops::Add for Zx {
    type Output = Zx;
    fn add(self, b: Zx) -> Zx {
        Zx::new(self.z + b.z, self.x + b.x)
    }
}
impl std::ops::Sub for Zx {
    type Output = Zx;
    fn sub(self, b: Zx) -> Zx {
        Zx::new(self.z - b.z, self.x - b.x)
    }
}
impl std::ops::Neg for Zx {
    type Output = Zx;
    fn neg(self) -> Zx {
        Zx::new(-self.z, -self.x)
    }
}
/// Turns (and scales), as complex numbers do.
impl std::ops::Mul for Zx {
    type Output = Zx;
    fn mul(self, b: Zx) -> Zx {
        Zx::new(self.z * b.z - self.x * b.x, self.z * b.x + self.x * b.z)
    }
}

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
enum Shape {
    Line,
    Arc { ccw: bool, centre: Zx },
}

/// What a corner word asks for; it becomes a segment once both neighbours are known.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Corner {
    No,
    Fillet,
    Chamfer,
}

/// One piece of a contour.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment {
    start: Zx,
    end: Zx,
    shape: Shape,
    corner: Corner,
    /// Size of a fillet or chamfer that is not made yet.
    finish: f64,
}

/// Why a contour can't be machined.
type Trouble<T = ()> = Result<T, String>;

fn min_max(a: f64, b: f64) -> (f64, f64) {
    if b < a { (b, a) } else { (a, b) }
}

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
    fn plain(&self) -> Segment {
        Segment { corner: Corner::No, ..*self }
    }

    fn map(&mut self, f: impl Fn(Zx) -> Zx, mirrors: bool) {
        self.start = f(self.start);
        self.end = f(self.end);
        if let Shape::Arc { ccw, centre } = &mut self.shape {
            *ccw ^= mirrors;
            *centre = f(*centre);
        }
    }

    fn draw(&self) -> Cut {
        match self.shape {
            Shape::Line => Cut::Line(self.end),
            Shape::Arc { ccw, centre } => Cut::Arc(ccw, centre, self.end),
        }
    }

    /// How small it has become.
    fn size(&self) -> f64 {
        let length = (self.start - self.end).len();
        match self.shape {
            Shape::Line => length,
            Shape::Arc { centre, .. } => min_max(length, (self.start - centre).len()).0,
        }
    }

    fn vanished(&self) -> bool {
        self.size() < SHORT
    }

    fn monotonic(&self) -> bool {
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
    fn offset(&mut self, distance: f64) {
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
    fn crossings(&self, x: f64) -> Vec<f64> {
        match self.shape {
            Shape::Line => self.line_crossings(x),
            Shape::Arc { ccw, centre } => self.arc_crossings(x, ccw, centre),
        }
    }

    fn line_crossings(&self, x: f64) -> Vec<f64> {
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

    fn arc_crossings(&self, x: f64, ccw: bool, centre: Zx) -> Vec<f64> {
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
    fn join(&mut self, next: &mut Segment) -> Trouble {
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
    fn climb(&self, at: &mut Zx, out: &mut Vec<Cut>) -> Trouble<bool> {
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
    fn climb_to_top(&self, at: &mut Zx, centre: Zx, out: &mut Vec<Cut>) {
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
    fn climb_only(&self, at: &mut Zx, out: &mut Vec<Cut>) {
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
    fn dive(&self, at: &mut Zx, x: f64, out: &mut Vec<Cut>, fast: bool) -> Trouble<bool> {
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

    fn dive_line(&self, at: &mut Zx, x: f64, out: &mut Vec<Cut>, fast: bool) -> Trouble<bool> {
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

fn join_lines(first: &mut Segment, next: &mut Segment) -> Trouble {
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
fn line_circle(a: Zx, b: Zx, on: Zx, centre: Zx, near: Zx) -> Zx {
    let turn = (a - b).mirror().over((a - b).len());
    let pe = (on - b) * turn;
    let pc = (centre - b) * turn;
    let s = (pc - pe).square() - pc.x * pc.x;
    let s = if s < 0.0 { 0.0 } else { s.sqrt() };
    let p1 = Zx::new(pc.z + s, 0.0).unturned(turn) + b;
    let p2 = Zx::new(pc.z - s, 0.0).unturned(turn) + b;
    if (near - p1).len() < (near - p2).len() { p1 } else { p2 }
}

fn join_arcs(first: &mut Segment, first_centre: Zx, next: &mut Segment, centre: Zx) {
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

/// A contour under way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contour {
    pub segments: Vec<Segment>,
    /// 1: Z mirrored, 2: X mirrored, 4: turned.
    turned: u8,
    /// Segments that turned round when the contour was moved, as the real `rs274` tells them.
    notes: Vec<String>,
}

/// Words of G71, G72.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Roughing {
    /// 0 G71, 1 G71.1 (no pockets), 2 G71.2 (pockets last).
    pub kind: u8,
    pub start: Zx,
    /// Allowance along X and Z.
    pub shift: Zx,
    /// Distance to the contour, cut per pass, retract.
    pub distance: f64,
    pub step: f64,
    pub retract: f64,
    pub facing: bool,
    /// Most moves.
    pub limit: usize,
    /// Goes on to the next piece of the contour when a level has nothing to cut, as 2.10 does.
    pub leaves: bool,
}

impl Contour {
    fn ends(&self) -> Trouble<(&Segment, &Segment)> {
        self.segments.first().zip(self.segments.last()).ok_or_else(|| "Not monotonic".into())
    }

    /// Corner words lose their meaning in a copy.
    fn copy(&self) -> Contour {
        let segments = self.segments.iter().map(Segment::plain).collect();
        Contour { segments, turned: self.turned, notes: Vec::new() }
    }

    fn turn(&mut self) {
        self.segments.iter_mut().for_each(|s| s.map(|p| -p * QUARTER, false));
        self.turned ^= 4;
    }

    /// Mirrors the contour so that it falls in Z and X rises behind it.
    fn face(&mut self) -> Trouble {
        let (first, last) = self.ends()?;
        let (up, back) = ((first.end - last.end).x > 0.0, (first.end - last.end).z < 0.0);
        if up {
            self.segments.iter_mut().for_each(|s| s.map(Zx::mirror, true));
            self.turned ^= 2;
        }
        if back {
            self.segments.iter_mut().for_each(|s| s.map(|p| -p.mirror(), true));
            self.turned ^= 1;
        }
        Ok(())
    }

    /// A cut as it is in the program's frame.
    fn restored(&self, cut: Cut) -> Cut {
        let back = |p: Zx| match self.turned {
            1 => -p.mirror(),
            2 => p.mirror(),
            3 => -p,
            4 => QUARTER * p,
            5 => (QUARTER * p).mirror(),
            6 => -(QUARTER * p).mirror(),
            7 => -QUARTER * p,
            _ => p,
        };
        let mirrored = matches!(self.turned, 1 | 2 | 5 | 6);
        match cut {
            Cut::Approach(p) => Cut::Approach(back(p)),
            Cut::Rapid(p) => Cut::Rapid(back(p)),
            Cut::Line(p) => Cut::Line(back(p)),
            Cut::Arc(ccw, c, p) => Cut::Arc(ccw ^ mirrored, back(c), back(p)),
        }
    }

    fn check_monotonic(&mut self) -> Trouble {
        if let Some(first) = self.segments.first_mut()
            && (first.end - first.start).z > 0.0
        {
            first.start.z = first.end.z;
        }
        if self.segments.iter().all(Segment::monotonic) { Ok(()) } else { Err("Not monotonic".into()) }
    }

    /// Makes fillets and chamfers.
    fn finish_corners(&mut self) -> Trouble {
        for i in 1..self.segments.len().saturating_sub(1) {
            if let [before, corner, after] = &mut self.segments[i - 1..=i + 1]
                && corner.corner != Corner::No
            {
                finish_corner(before, corner, after)?;
            }
        }
        self.segments.retain(|s| !s.vanished());
        Ok(())
    }

    /// Moves the contour sideways by `distance`, in small steps so that short pieces vanish cleanly. The first
    /// segment is the approach and stays.
    fn add_distance(&mut self, distance: f64) -> Trouble {
        let (first, last) = self.ends()?;
        let side = (first.end - first.start).unturned(last.start - first.start).x;
        let distance = if side < 0.0 { -distance } else { distance };
        let mut approach = self.segments.remove(0);
        let mut done = 0.0;
        let mut rounds = 0;
        while done != distance {
            rounds += 1;
            if rounds > 100_000 || self.segments.is_empty() {
                return Err("Not monotonic".into());
            }
            let mut step = self.segments.iter().fold(1e9, |m: f64, s| min_max(m, s.size() / 2.0).0);
            step = min_max(step, (distance - done).abs()).0;
            if distance < 0.0 {
                step = -step;
            }
            self.offset_all(step, distance);
            self.trim()?;
            done += step;
        }
        for i in 1..self.segments.len() {
            let middle = self.segments[i - 1].end.middle(self.segments[i].start);
            self.segments[i - 1].end = middle;
            self.segments[i].start = middle;
        }
        approach.end = self.segments.first().ok_or("Not monotonic")?.start;
        self.segments.insert(0, approach);
        Ok(())
    }

    fn offset_all(&mut self, step: f64, distance: f64) {
        self.segments.iter_mut().for_each(|s| s.offset(step));
        self.segments.retain(|s| !s.vanished());
        let mut i = 0;
        while i + 1 < self.segments.len() {
            let (a, b) = (self.segments[i], self.segments[i + 1]);
            if (a.end - b.start).z > 1e-2 {
                let (mut before, mut after) = (a.plain(), b.plain());
                before.offset(-step);
                after.offset(-step);
                let centre = before.end.middle(after.start);
                self.segments.insert(i + 1, Segment::arc(distance > 0.0, a.end, centre, b.start));
                i += 1;
            }
            i += 1;
        }
    }

    /// Cuts neighbours to their crossings and drops what turned round or vanished.
    fn trim(&mut self) -> Trouble {
        let mut i = 0;
        while i + 1 < self.segments.len() {
            if !self.segments[i].monotonic() {
                if i == 0 {
                    return Err("Not monotonic".into());
                }
                let back = self.segments[i].start - self.segments[i].end;
                self.notes.push(format!("Oops ({},{})", general(back.z, 6), general(back.x, 6)));
                let smaller = self.segments[i].size() < self.segments[i - 1].size();
                self.segments.remove(if smaller { i } else { i - 1 });
                i = 0;
            }
            if i + 1 >= self.segments.len() {
                break;
            }
            if self.segments[i].vanished() {
                self.segments.remove(i);
                i = 0;
            } else if let [a, b] = &mut self.segments[i..=i + 1] {
                a.join(b)?;
            }
            i += 1;
        }
        Ok(())
    }

    /// 2.10: a contour that ends in the stock is led out of it, straight to the level of the start point.
    fn close(&mut self, cycle: i16, start: Zx) {
        let Some((first, last)) = self.segments.first().zip(self.segments.last()) else { return };
        let (front, back, end) = (first.end - first.start, last.end - last.start, last.end);
        let out = match cycle {
            71 if back.z != 0.0 && front.x * (start.x - end.x) < 0.0 => Zx::new(end.z, start.x),
            72 if back.x != 0.0 && front.z * (start.z - end.z) < 0.0 => Zx::new(start.z, end.x),
            _ => return,
        };
        self.segments.push(Segment::line(end, out));
    }

    /// G70: along the contour, `passes` times, from distance `far` to `near`.
    pub(crate) fn finish(&mut self, start: Zx, far: f64, near: f64, passes: f64, out: &mut Vec<Cut>) -> Trouble {
        self.segments.first_mut().ok_or("Not monotonic")?.start = start;
        let mut trial = self.copy();
        trial.segments.remove(0);
        trial.face()?;
        if !trial.segments.iter().all(Segment::monotonic) {
            trial.turn();
            trial.face()?;
        }
        trial.check_monotonic()?;
        if trial.turned & 4 != 0 {
            self.turn();
        }
        self.face()?;
        self.finish_corners()?;
        self.check_monotonic()?;
        let mut pass = passes as i32;
        while pass > 0 {
            let distance = f64::from(pass - 1) * (far - near) / passes + near;
            let mut path = self.copy();
            let moved = path.add_distance(distance);
            self.notes.append(&mut path.notes);
            moved?;
            let first = path.segments[0];
            out.push(self.restored(Cut::Approach(first.start)));
            out.push(self.restored(Cut::Rapid(first.end)));
            out.extend(path.segments[1..].iter().map(|s| self.restored(s.draw())));
            pass -= 1;
        }
        Ok(())
    }

    /// More cuts than any sound job has: every level once through every pocket. The real controller goes round
    /// for ever on some unsound contours.
    fn most_cuts(&self, begin: Zx, step: f64) -> usize {
        let (low, high) = self.segments.iter().fold((begin.x, begin.x), |(low, high), s| {
            let radius = match s.shape {
                Shape::Line => 0.0,
                Shape::Arc { .. } => s.size(),
            };
            let (a, b) = min_max(s.start.x, s.end.x);
            (min_max(low, a - radius).0, min_max(high, b + radius).1)
        });
        let levels = ((high - low) / step).min(1e9) as usize;
        64 + 16 * (levels + 2) * (self.segments.len() + 2)
    }

    /// G71, G72: removes the stock between the start point and the contour.
    pub(crate) fn rough(&mut self, job: &Roughing, out: &mut Vec<Cut>) -> Trouble {
        self.segments.first_mut().ok_or("Not monotonic")?.start = job.start;
        if job.facing {
            self.turn();
        }
        self.face()?;
        self.finish_corners()?;
        self.check_monotonic()?;
        self.add_distance(job.distance)?;
        self.segments.iter_mut().for_each(|s| s.map(|p| p + job.shift, false));
        let (first, last) = self.ends()?;
        let (begin, end) = (first.start, last.end);
        let mut cuts = vec![Cut::Rapid(begin)];
        if end.x < begin.x {
            self.segments.push(Segment::line(end, Zx::new(end.z, begin.x)));
        }
        let step = if job.step < 2.0 * TOLERANCE { 2.0 * TOLERANCE } else { job.step };
        let mut pockets = Pockets {
            segments: &self.segments,
            step,
            escape: Zx::new(job.retract, job.retract),
            starts: vec![begin],
            limit: self.most_cuts(begin, step).min(job.limit),
            leaves: job.leaves,
        };
        let done = pockets.cut(job.kind, begin, &mut cuts);
        out.extend(cuts.into_iter().map(|c| self.restored(c)));
        done
    }
}

fn finish_corner(before: &mut Segment, corner: &mut Segment, after: &mut Segment) -> Trouble {
    let apart = |p: &Segment, n: &Segment| (p.end - n.start).z > 1e-2;
    let moved = |finish: f64| {
        let (mut p, mut n) = (before.plain(), after.plain());
        p.offset(finish);
        n.offset(finish);
        (p, n)
    };
    let (mut p, mut n) = moved(corner.finish);
    if apart(&p, &n) {
        corner.finish = -corner.finish;
        (p, n) = moved(corner.finish);
    }
    if apart(&p, &n) {
        let at = before.end;
        return Err(format!("Corner finish failed at ({},{})", general(at.z, 6), general(at.x, 6)));
    }
    p.join(&mut n)?;
    let centre = p.end.middle(n.start);
    p.offset(-corner.finish);
    n.offset(-corner.finish);
    (before.end, corner.start) = (p.end, p.end);
    (after.start, corner.end) = (n.start, n.start);
    if corner.corner == Corner::Fillet {
        let ccw = (corner.start - centre).x > 0.0 || (corner.end - centre).x > 0.0;
        corner.shape = Shape::Arc { ccw, centre };
        corner.finish = 0.0;
    }
    Ok(())
}

/// Level by level down the contour.
struct Pockets<'a> {
    segments: &'a [Segment],
    step: f64,
    /// Retract of one pass, diagonal.
    escape: Zx,
    starts: Vec<Zx>,
    limit: usize,
    leaves: bool,
}

impl Pockets<'_> {
    fn cut(&mut self, kind: u8, from: Zx, out: &mut Vec<Cut>) -> Trouble {
        let (mut kind, mut at, mut i) = (kind, from, 0);
        loop {
            let top = self.starts.last().copied().unwrap_or(from);
            if kind == 2 {
                while i < self.segments.len() && !self.segments[i].dive(&mut at, -1e9, out, i == 0)? {
                    i += 1;
                }
                kind = 3;
            }
            if !self.levels(kind, top.x, &mut at, &mut i, out)? {
                return Ok(());
            }
        }
    }

    /// Passes until the contour rises; false at its end.
    fn levels(&mut self, kind: u8, top: f64, at: &mut Zx, i: &mut usize, out: &mut Vec<Cut>) -> Trouble<bool> {
        let mut x = top;
        let mut idle = 0_usize;
        while *i < self.segments.len() {
            idle += 1;
            if out.len() > self.limit || idle > self.limit {
                return Err("too many passes".into());
            }
            if x - TOLERANCE > at.x {
                let gap = ((x - TOLERANCE - at.x) / self.step).floor().max(0.0);
                if gap > self.limit as f64 {
                    return Err("too many passes".into());
                }
                while x - TOLERANCE > at.x {
                    x -= self.step;
                }
            }
            if self.segments[*i].dive(at, x, out, *i == 0)? {
                return self.rise(kind, at, i, out);
            }
            if (at.x - x).abs() > TOLERANCE {
                *i += 1;
                continue;
            }
            self.pass(&mut x, *at, i, out);
        }
        Ok(false)
    }

    /// Up the contour to where it falls again; true when there is a further pocket.
    fn rise(&mut self, kind: u8, at: &mut Zx, i: &mut usize, out: &mut Vec<Cut>) -> Trouble<bool> {
        if kind == 1 {
            self.segments[*i..].iter().for_each(|s| s.climb_only(at, out));
            return Ok(false);
        }
        while *i < self.segments.len() {
            if self.segments[*i].climb(at, out)? {
                if kind == 3 {
                    let above = self.starts.last().is_some_and(|s| at.x > s.x);
                    if above && self.starts.len() > 1 {
                        self.starts.pop();
                    }
                    if self.starts.len() == 1 {
                        self.starts.push(*at);
                    }
                }
                return Ok(true);
            }
            *i += 1;
        }
        Ok(false)
    }

    /// One pass along Z to the contour and back.
    fn pass(&self, x: &mut f64, at: Zx, i: &mut usize, out: &mut Vec<Cut>) {
            for (k, segment) in self.segments.iter().enumerate().skip(*i) {
            let is = segment.crossings(at.x);
            let (Some(front), Some(back)) = (is.first(), is.last()) else {
                continue;
            };
            let goal = if k == *i { *back } else { *front };
            let distance = (goal - at.z).abs();
            if goal - TOLERANCE > at.z {
                continue;
            }
            if distance < TOLERANCE {
                if k == *i {
                    continue;
                }
                if (at - segment.start).len() < TOLERANCE {
                    *i = k;
                } else {
                    *x -= self.step;
                }
                return;
            }
            out.push(Cut::Line(Zx::new(goal, at.x)));
            let scale = distance / 2.0 / self.escape.z;
            let escape = self.escape.scaled(if scale < 1.0 { scale } else { 1.0 });
            out.push(Cut::Rapid(Zx::new(goal, at.x) + escape));
            out.push(Cut::Rapid(at - escape.mirror()));
            out.push(if *i == 0 { Cut::Rapid(at) } else { Cut::Line(at) });
            *x -= self.step;
            return;
        }
        // Nothing is left to cut at this level: 2.9 tries again for ever.
        if self.leaves {
            *i += 1;
        }
    }
}

/// The moves of a contour subroutine, read but not made.
pub(crate) struct Reader {
    contour: Contour,
    at: Zx,
    incremental: bool,
    ijk_absolute: bool,
}

fn refuse(text: gr_spec::Rs274, why: &str) -> Box<Fault> {
    let fault = Fault::new(code::ROUGH_CONTOUR, text).arg(why);
    match why {
        "Not monotonic" => fault.named("it does not rise or fall all the way".into()),
        _ => fault,
    }
}

impl Reader {
    /// Takes the words of one block of the subroutine.
    pub(crate) fn block<S: Sink>(&mut self, interp: &mut Interp<'_, S>) -> Res {
        let end = self.end(interp)?;
        let b = &interp.block;
        let motion = b.g(crate::Group::Motion);
        if motion != -1 {
            interp.m.motion = i32::from(motion);
        }
        if end == self.at {
            return Ok(());
        }
        let start = self.at;
        match interp.m.motion {
            0 | 10 => self.contour.segments.push(Segment::line(start, end)),
            20 | 30 => {
                let ccw = interp.m.motion == 30;
                let centre = self.centre(b, end, ccw)?;
                self.contour.segments.push(Segment::arc(ccw, start, centre, end));
            }
            _ => {}
        }
        if matches!(interp.m.motion, 0 | 10 | 20 | 30) {
            self.corner(b, end)?;
        }
        interp.m.current[0] = end.x;
        interp.m.current[2] = end.z;
        self.at = end;
        Ok(())
    }

    fn end<S: Sink>(&self, interp: &Interp<'_, S>) -> Res<Zx> {
        let b = &interp.block;
        let mut end = if self.incremental { Zx::default() } else { self.at };
        if let Some(u) = b.get(b'u') {
            if self.incremental {
                return Err(refuse(rs274::ROUGH_U_INCREMENTAL, "U in G91"));
            }
            if b.has(b'x') {
                return Err(refuse(rs274::ROUGH_U_AND_X, "U and X in one block"));
            }
            end.x += if interp.m.lathe_diameter != 0 { u / 2.0 } else { u };
        } else if let Some(x) = b.get(b'x') {
            end.x = x;
        }
        if let Some(w) = b.get(b'w') {
            if self.incremental {
                return Err(refuse(rs274::ROUGH_W_INCREMENTAL, "W in G91"));
            }
            if b.has(b'z') {
                return Err(refuse(rs274::ROUGH_W_AND_Z, "W and Z in one block"));
            }
            end.z += w;
        } else if let Some(z) = b.get(b'z') {
            end.z = z;
        }
        Ok(if self.incremental { end + self.at } else { end })
    }

    fn centre(&self, b: &crate::Block, end: Zx, ccw: bool) -> Res<Zx> {
        let given = b.has_any(b"ik");
        if let Some(r) = b.get(b'r') {
            if given {
                return Err(refuse(rs274::ROUGH_R_AND_IK, "R together with I or K"));
            }
            let chord = end - self.at;
            let f = ((r * r - chord.square() / 4.0) / chord.square()).sqrt();
            let aside = QUARTER.scaled(f) * chord;
            let middle = self.at.middle(end);
            return Ok(if ccw { middle + aside } else { middle - aside });
        }
        if !given {
            return Err(refuse(rs274::ROUGH_NO_IK, "an arc needs R, or I and K"));
        }
        let offset = Zx::new(b.or_zero(b'k'), b.or_zero(b'i'));
        Ok(if self.ijk_absolute { offset } else { offset + self.at })
    }

    fn corner(&mut self, b: &crate::Block, end: Zx) -> Res {
        let (a, c) = (b.get(b'a'), b.get(b'c'));
        if a.is_some() && c.is_some() {
            return Err(refuse(rs274::ROUGH_A_AND_C, "A and C on one corner"));
        }
        if let Some(radius) = a {
            self.contour.segments.push(Segment::fillet(radius, end));
        }
        if let Some(size) = c {
            self.contour.segments.push(Segment::chamfer(size, end));
        }
        Ok(())
    }
}

impl<S: Sink> Interp<'_, S> {
    /// G70, G71, G71.1, G71.2, G72, G72.1, G72.2.
    pub(crate) fn convert_roughing(&mut self, g: i16) -> Res {
        let Some(q) = self.block.get(b'q') else {
            return Err(refuse(rs274::ROUGH_NO_Q, "Q, the number of the contour subroutine, is missing"));
        };
        let (cycle, kind) = (g / 10, g % 10);
        let wrong = |text, why: &str| Err(refuse(text, why).arg(cycle).arg(kind));
        if self.m.comp_side != 0 && cycle != 70 {
            return wrong(rs274::ROUGH_COMP, "cutter compensation is on");
        }
        if self.m.plane() != Plane::Xz {
            return wrong(rs274::ROUGH_PLANE, "the plane is not G18");
        }
        let saved = (self.m.incremental, self.m.ijk_absolute);
        (self.m.incremental, self.m.ijk_absolute) = (0, 1);
        let done = self.rough_contour(cycle, kind as u8, q, saved);
        (self.m.incremental, self.m.ijk_absolute) = saved;
        done
    }

    fn rough_contour(&mut self, cycle: i16, kind: u8, q: f64, saved: (u8, u8)) -> Res {
        let words = self.block.clone();
        let start = self.rough_start(saved.0 != 0);
        let before = [self.m.current[0], self.m.current[2]];
        self.rapid_to_contour()?;
        let mut reader = Reader {
            contour: Contour::default(),
            at: start,
            incremental: saved.0 != 0,
            ijk_absolute: saved.1 != 0,
        };
        self.read_contour(q, &mut reader)?;
        if reader.contour.segments.len() <= 1 {
            return Ok(());
        }
        if self.setup.version == Version::V2_10 {
            [self.m.current[0], self.m.current[2]] = before;
            reader.contour.close(cycle, start);
        }
        let mut cuts = Vec::new();
        let done = self.rough_cuts(cycle, kind, &words, start, &mut reader.contour, &mut cuts)?;
        for note in &reader.contour.notes {
            self.sink.print(note);
        }
        self.block.clear();
        for cut in cuts {
            self.make_cut(cut)?;
        }
        done.map_err(|why| refuse(rs274::ROUGH_GEOMETRY, &why))
    }

    /// The rapid before a pass. 2.10 makes it without cutter compensation, which then enters at the contour.
    fn rapid_to_contour(&mut self) -> Res {
        if self.setup.version == Version::V2_9 {
            return self.convert_straight(0);
        }
        let side = std::mem::replace(&mut self.m.comp_side, 0);
        let done = self.convert_straight(0);
        self.m.comp_side = side;
        done
    }

    /// Where the block's X and Z lead.
    fn rough_start(&self, incremental: bool) -> Zx {
        let at = |letter: u8, current: f64| match self.block.get(letter) {
            Some(v) if incremental => current + v,
            Some(v) => v,
            None => current,
        };
        Zx::new(at(b'z', self.m.current[2]), at(b'x', self.m.current[0]))
    }

    fn rough_cuts(
        &self,
        cycle: i16,
        kind: u8,
        words: &crate::Block,
        start: Zx,
        contour: &mut Contour,
        cuts: &mut Vec<Cut>,
    ) -> Res<Trouble> {
        let word = |letter: u8, default: f64| words.get(letter).unwrap_or(default);
        let step = word(b'i', 1.0);
        if step <= 0.0 {
            return Err(refuse(rs274::ROUGH_I, "I must be greater than zero"));
        }
        if cycle == 70 {
            return Ok(contour.finish(start, word(b'd', 0.0), word(b'e', 0.0), word(b'p', 1.0), cuts));
        }
        let job = Roughing {
            kind,
            start,
            shift: Zx::new(word(b'w', 0.0), word(b'u', 0.0)),
            distance: word(b'd', 0.0),
            step,
            retract: word(b'r', 0.5),
            facing: cycle == 72,
            limit: usize::try_from(self.setup.budgets.passes).unwrap_or(usize::MAX),
            leaves: self.setup.version == Version::V2_10,
        };
        Ok(contour.rough(&job, cuts))
    }

    fn make_cut(&mut self, cut: Cut) -> Res {
        let end = match cut {
            Cut::Approach(p) | Cut::Rapid(p) | Cut::Line(p) | Cut::Arc(_, _, p) => p,
        };
        self.block.set(b'x', end.x);
        self.block.set(b'z', end.z);
        match cut {
            Cut::Approach(_) => self.rapid_to_contour(),
            Cut::Rapid(_) => self.convert_straight(0),
            Cut::Line(_) => self.convert_straight(10),
            Cut::Arc(ccw, centre, _) => {
                self.block.set(b'i', centre.x);
                self.block.set(b'k', centre.z);
                let same = |a: f64, b: f64| (a - b).abs() < 0.0001;
                if same(self.m.current[2], end.z) && same(self.m.current[0], end.x) {
                    return Ok(());
                }
                self.convert_arc(if ccw { 30 } else { 20 })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shaft() -> Contour {
        let p = |z: f64, x: f64| Zx::new(z, x);
        Contour {
            segments: vec![
                Segment::line(p(1.0, 10.0), p(0.0, 4.0)),
                Segment::line(p(0.0, 4.0), p(-10.0, 4.0)),
                Segment::line(p(-10.0, 4.0), p(-12.0, 10.0)),
            ],
            ..Contour::default()
        }
    }

    fn job() -> Roughing {
        Roughing {
            kind: 0,
            start: Zx::new(1.0, 10.0),
            shift: Zx::default(),
            distance: 0.0,
            step: 2.0,
            retract: 0.5,
            facing: false,
            limit: 10_000,
            leaves: false,
        }
    }

    #[test]
    fn roughing_never_goes_below_the_contour() {
        let mut cuts = Vec::new();
        shaft().rough(&job(), &mut cuts).expect("a plain shaft");
        assert!(cuts.len() > 8);
        let ends = cuts.iter().map(|c| match c {
            Cut::Approach(p) | Cut::Rapid(p) | Cut::Line(p) | Cut::Arc(_, _, p) => *p,
        });
        assert!(ends.into_iter().all(|p| p.x >= 4.0 - 1e-9));
    }

    #[test]
    fn passes_are_limited() {
        let mut cuts = Vec::new();
        let tiny = Roughing { step: 1e-9, limit: 50, ..job() };
        assert!(shaft().rough(&tiny, &mut cuts).is_err());
    }

    #[test]
    fn finishing_follows_the_contour_at_a_distance() {
        let mut cuts = Vec::new();
        shaft().finish(Zx::new(1.0, 10.0), 0.5, 0.0, 2.0, &mut cuts).expect("a plain shaft");
        assert_eq!(cuts.iter().filter(|c| matches!(c, Cut::Approach(_) | Cut::Rapid(_))).count(), 4);
    }
}
