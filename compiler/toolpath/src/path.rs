//! Curves made of lines and arcs, open or closed, with exact length, area, bounds and position tests. They are plain
//! data: no offsetting (see `offset`) and no idea of a tool.

use crate::geom::{Bounds, P2, Seg, TOL, Vertex};
use crate::Error;
use core::f64::consts::PI;

/// A connected curve of lines and arcs.
#[derive(Clone, Debug, PartialEq)]
pub struct Path2 {
    pub(crate) segs: Vec<Seg>,
    pub(crate) closed: bool,
}

/// Coordinates beyond this are refused.
const LIMIT: f64 = 1e7;

impl Path2 {
    /// From corners in bulge form. Of an open curve the last bulge means nothing.
    pub fn from_vertices(vertices: &[Vertex], closed: bool) -> Result<Self, Error> {
        if vertices.iter().any(|v| !v.p.finite() || !v.bulge.is_finite()) {
            return Err(Error::NotFinite);
        }
        let n = vertices.len();
        let count = if closed { n } else { n.saturating_sub(1) };
        let segs = (0..count).map(|i| {
            let (v, w) = (vertices[i], vertices[(i + 1) % n]);
            Seg::from_bulge(v.p, w.p, v.bulge)
        });
        Self::from_segs(segs, closed)
    }

    /// From straight corners.
    pub fn polyline(points: &[P2], closed: bool) -> Result<Self, Error> {
        let vertices: Vec<_> = points.iter().map(|&p| Vertex { p, bulge: 0.0 }).collect();
        Self::from_vertices(&vertices, closed)
    }

    /// From segments that follow each other. Gaps up to 1 µm are closed, segments without length left out, arcs of
    /// more than half a turn split.
    pub fn from_segs(segs: impl IntoIterator<Item = Seg>, closed: bool) -> Result<Self, Error> {
        let mut out: Vec<Seg> = Vec::new();
        for seg in segs {
            check(&seg)?;
            if seg.a().dist(seg.b()) <= TOL && seg.len() <= 2.0 * TOL {
                continue;
            }
            let seg = match out.last() {
                Some(last) => join(last.b(), seg)?,
                None => seg,
            };
            push_split(&mut out, seg);
        }
        let (Some(first), Some(last)) = (out.first(), out.last()) else { return Err(Error::Empty) };
        if closed {
            let (start, end) = (first.a(), last.b());
            if start.dist(end) > 1e-3 {
                out.push(Seg::Line { a: end, b: start });
            } else if let Some(last) = out.last_mut() {
                *last = with_end(*last, start);
            }
        }
        Ok(Self { segs: out, closed })
    }

    /// A full circle, counterclockwise from its rightmost point.
    pub fn circle(centre: P2, radius: f64) -> Result<Self, Error> {
        let r = crate::positive(radius, "radius")?;
        let a = centre + P2::new(r, 0.0);
        let b = centre - P2::new(r, 0.0);
        Self::from_segs(
            [Seg::Arc { a, b, c: centre, sweep: PI }, Seg::Arc { a: b, b: a, c: centre, sweep: PI }],
            true,
        )
    }

    /// Its segments.
    pub fn segs(&self) -> &[Seg] {
        &self.segs
    }
    /// Does it end where it starts?
    pub fn is_closed(&self) -> bool {
        self.closed
    }
    /// First point.
    pub fn start(&self) -> P2 {
        self.segs.first().map_or(P2::default(), Seg::a)
    }
    /// Last point.
    pub fn end(&self) -> P2 {
        self.segs.last().map_or(P2::default(), Seg::b)
    }
    /// In bulge form; an open curve ends with a vertex of bulge 0.
    pub fn vertices(&self) -> Vec<Vertex> {
        let mut out: Vec<_> = self.segs.iter().map(|s| Vertex { p: s.a(), bulge: s.bulge() }).collect();
        if !self.closed {
            out.push(Vertex { p: self.end(), bulge: 0.0 });
        }
        out
    }
    /// Length along it.
    pub fn length(&self) -> f64 {
        self.segs.iter().map(Seg::len).sum()
    }
    /// Enclosed area, positive if counterclockwise; an open curve is closed by a line.
    pub fn area(&self) -> f64 {
        // About the first point, so that parts far from the origin keep their digits.
        let o = self.start();
        let twice: f64 = self.segs.iter().map(|s| s.map(|p| p - o, false).area2()).sum();
        twice * 0.5
    }
    /// Is it counterclockwise?
    pub fn is_ccw(&self) -> bool {
        self.area() > 0.0
    }
    /// Its box.
    pub fn bounds(&self) -> Bounds {
        let first = Bounds::of(self.start(), self.start());
        self.segs.iter().fold(first, |b, s| b.union(s.bounds()))
    }
    /// How often it turns about `p`, counterclockwise.
    pub fn winding(&self, p: P2) -> i32 {
        self.segs.iter().map(|s| s.winding(p)).sum()
    }
    /// Is `p` inside the closed curve (whatever its direction)?
    pub fn contains(&self, p: P2) -> bool {
        self.closed && self.winding(p) != 0
    }
    /// Distance of `p` from the curve.
    pub fn dist(&self, p: P2) -> f64 {
        self.segs.iter().map(|s| s.dist(p)).fold(f64::INFINITY, f64::min)
    }
    /// Shortest distance from the corners of one curve to the other.
    pub(crate) fn dist_to(&self, other: &Self) -> f64 {
        self.segs.iter().map(|s| other.dist(s.a())).fold(f64::INFINITY, f64::min)
    }
    /// Run backwards.
    pub fn reversed(&self) -> Self {
        Self { segs: self.segs.iter().rev().map(Seg::reversed).collect(), closed: self.closed }
    }
    /// Counterclockwise (or clockwise) version of a closed curve.
    pub fn oriented(&self, ccw: bool) -> Self {
        if self.is_ccw() == ccw { self.clone() } else { self.reversed() }
    }
    /// Moved by `d`.
    pub fn moved(&self, d: P2) -> Self {
        self.map(|p| p + d, false)
    }
    /// Turned about the origin.
    pub fn rotated(&self, angle: f64) -> Self {
        self.map(|p| p.rotated(angle), false)
    }
    /// Turned about the origin, then moved.
    pub fn placed(&self, origin: P2, angle: f64) -> Self {
        self.map(|p| p.rotated(angle) + origin, false)
    }
    /// Larger by the factor (> 0) about the origin.
    pub fn scaled(&self, k: f64) -> Self {
        self.map(|p| p * k, false)
    }
    /// Mirrored at the x axis (y changes sign).
    pub fn mirrored(&self) -> Self {
        self.map(|p| P2::new(p.x, -p.y), true)
    }
    fn map(&self, f: impl Fn(P2) -> P2 + Copy, mirrored: bool) -> Self {
        Self { segs: self.segs.iter().map(|s| s.map(f, mirrored)).collect(), closed: self.closed }
    }
    /// Segment and place on it (0…1) nearest to `p`.
    pub fn nearest(&self, p: P2) -> (usize, f64) {
        let mut best = (0, 0.0, f64::INFINITY);
        for (i, s) in self.segs.iter().enumerate() {
            let t = s.nearest(p);
            let d = s.at(t).dist(p);
            if d < best.2 - 1e-12 {
                best = (i, t, d);
            }
        }
        (best.0, best.1)
    }
    /// A closed curve that starts at this place of this segment (an open one is returned as it is).
    pub fn starting_at(&self, index: usize, t: f64) -> Self {
        if !self.closed || index >= self.segs.len() || !t.is_finite() {
            return self.clone();
        }
        let s = self.segs[index];
        let n = self.segs.len();
        let mut segs = Vec::with_capacity(n + 1);
        let len = s.len();
        let (head, tail) = (t * len > TOL, (1.0 - t) * len > TOL);
        if head && tail {
            let (before, mut after) = (s.part(0.0, t), s.part(t, 1.0));
            after = with_start(after, before.b());
            segs.push(after);
            segs.extend(self.segs[index + 1..].iter().chain(&self.segs[..index]));
            segs.push(before);
        } else {
            let first = if head { (index + 1) % n } else { index };
            segs.extend(self.segs[first..].iter().chain(&self.segs[..first]));
        }
        Self { segs, closed: true }
    }
    /// A closed curve that starts at its point nearest to `p`.
    pub fn starting_near(&self, p: P2) -> Self {
        let (i, t) = self.nearest(p);
        self.starting_at(i, t)
    }
    /// Place (segment, 0…1) at this length from the start.
    pub fn at_length(&self, length: f64) -> (usize, f64) {
        let mut rest = length.max(0.0);
        for (i, s) in self.segs.iter().enumerate() {
            let l = s.len();
            if rest <= l && l > 0.0 {
                return (i, rest / l);
            }
            rest -= l;
        }
        (self.segs.len().saturating_sub(1), 1.0)
    }
    /// The point at this length from the start.
    pub fn point_at(&self, length: f64) -> P2 {
        let (i, t) = self.at_length(length);
        self.segs.get(i).map_or(P2::default(), |s| s.at(t))
    }
    /// Length from the start to this place.
    pub fn length_to(&self, index: usize, t: f64) -> f64 {
        let before: f64 = self.segs.iter().take(index).map(Seg::len).sum();
        before + self.segs.get(index).map_or(0.0, |s| s.len() * t)
    }
    /// The open part between two lengths from the start; `None` if it has no length.
    pub fn part(&self, from: f64, to: f64) -> Option<Self> {
        let mut segs = Vec::new();
        let mut done = 0.0;
        for s in &self.segs {
            let l = s.len();
            let (f, t) = ((from - done).max(0.0), (to - done).min(l));
            if t - f > TOL {
                let whole = f <= TOL && l - t <= TOL;
                segs.push(if whole { *s } else { s.part(f / l, t / l) });
            }
            done += l;
        }
        (!segs.is_empty()).then_some(Self { segs, closed: false })
    }
    /// The same curve as an open one that ends where it starts.
    pub fn opened(&self) -> Self {
        Self { segs: self.segs.clone(), closed: false }
    }
    /// Direction at the start.
    pub fn start_tangent(&self) -> P2 {
        self.segs.first().map_or(P2::new(1.0, 0.0), |s| s.tangent(0.0))
    }
    /// Direction at the end.
    pub fn end_tangent(&self) -> P2 {
        self.segs.last().map_or(P2::new(1.0, 0.0), |s| s.tangent(1.0))
    }
    /// Points on it no further apart than `step`, ends included.
    pub fn sampled(&self, step: f64) -> Vec<P2> {
        let mut out = vec![self.start()];
        for s in &self.segs {
            let n = (s.len() / step.max(1e-3)).ceil().clamp(1.0, 1e5) as usize;
            out.extend((1..=n).map(|i| s.at(i as f64 / n as f64)));
        }
        out
    }
    /// Follows `next`, which starts where this ends (a small gap is bridged by a line).
    pub fn then(&self, next: &Self) -> Self {
        let mut segs = self.segs.clone();
        if self.end().dist(next.start()) > TOL {
            segs.push(Seg::Line { a: self.end(), b: next.start() });
        }
        segs.extend(next.segs.iter().copied());
        Self { segs, closed: false }
    }
    /// First point where the curve crosses or touches itself.
    pub fn self_intersection(&self) -> Option<P2> {
        let n = self.segs.len();
        let boxes: Vec<_> = self.segs.iter().map(|s| s.bounds().grown(TOL)).collect();
        let mut hits = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                if !boxes[i].overlaps(&boxes[j]) {
                    continue;
                }
                hits.clear();
                crate::offset::intersections(&self.segs[i], &self.segs[j], &mut hits);
                let joint = |p: P2| {
                    let next = j == i + 1 && p.dist(self.segs[i].b()) < 1e-5;
                    let wrap = self.closed && i == 0 && j == n - 1 && p.dist(self.segs[i].a()) < 1e-5;
                    next || wrap
                };
                if let Some(p) = hits.iter().copied().find(|&p| !joint(p)) {
                    return Some(p);
                }
            }
        }
        None
    }
}

fn check(seg: &Seg) -> Result<(), Error> {
    let (a, b) = (seg.a(), seg.b());
    let mut size = a.x.abs().max(a.y.abs()).max(b.x.abs()).max(b.y.abs());
    let mut finite = a.finite() && b.finite();
    if let Seg::Arc { c, sweep, .. } = *seg {
        finite &= c.finite() && sweep.is_finite();
        let r = a.dist(c);
        size = size.max(r * 1e-3);
        if finite && ((r - b.dist(c)).abs() > 1e-3 || sweep.abs() > core::f64::consts::TAU) {
            return Err(Error::Parameter("arc"));
        }
    }
    if !finite {
        return Err(Error::NotFinite);
    }
    if size > LIMIT { Err(Error::TooLarge) } else { Ok(()) }
}

fn join(end: P2, seg: Seg) -> Result<Seg, Error> {
    if end.dist(seg.a()) > 1e-3 { Err(Error::Parameter("gap")) } else { Ok(with_start(seg, end)) }
}

pub(crate) fn with_start(seg: Seg, p: P2) -> Seg {
    match seg {
        Seg::Line { b, .. } => Seg::Line { a: p, b },
        Seg::Arc { b, c, sweep, .. } => Seg::Arc { a: p, b, c, sweep },
    }
}

pub(crate) fn with_end(seg: Seg, p: P2) -> Seg {
    match seg {
        Seg::Line { a, .. } => Seg::Line { a, b: p },
        Seg::Arc { a, c, sweep, .. } => Seg::Arc { a, b: p, c, sweep },
    }
}

/// Arcs of more than half a turn become two.
fn push_split(out: &mut Vec<Seg>, seg: Seg) {
    match seg {
        Seg::Arc { sweep, .. } if sweep.abs() > PI + 1e-9 => {
            let first = seg.part(0.0, 0.5);
            out.push(first);
            out.push(with_start(seg.part(0.5, 1.0), first.b()));
        }
        _ => out.push(seg),
    }
}
