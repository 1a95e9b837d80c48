//! Offsets of curves and regions that keep arcs.
//!
//! The boundary of an offset region consists of the points whose distance from the original boundary is exactly the
//! offset. So: move every segment, put an arc round every corner, cut all of these at all their crossings, and keep the
//! pieces whose distance from the whole original is right. No case analysis of invalid loops is needed, and a piece
//! that is kept can't gouge, whatever happens elsewhere. A room exactly as wide as the tool yields a curve that runs
//! out and back on the same line, which is what the tool has to do.

use crate::geom::{Bounds, P2, Seg, TOL};
use crate::path::{with_end, with_start};
use crate::stitch;
use crate::{Error, Path2, Region};

/// How much nearer than the offset a kept piece may be.
const SLACK: f64 = 2e-7;

/// Where two segments meet: crossings, touching points, and ends of one that lie on the other.
pub(crate) fn intersections(s: &Seg, t: &Seg, out: &mut Vec<P2>) {
    let near = |p: P2| s.dist(p) <= TOL && t.dist(p) <= TOL;
    let keep = |p: P2, out: &mut Vec<P2>| {
        if near(p) && !out.iter().any(|q| q.dist(p) <= TOL) {
            out.push(p);
        }
    };
    for p in [s.a(), s.b(), t.a(), t.b()] {
        keep(p, out);
    }
    let mut found = [P2::default(); 2];
    let n = match (*s, *t) {
        (Seg::Line { a, b }, Seg::Line { a: c, b: d }) => line_line(a, b, c, d, &mut found),
        (Seg::Line { a, b }, Seg::Arc { a: e, c, .. }) | (Seg::Arc { a: e, c, .. }, Seg::Line { a, b }) => {
            line_circle(a, b, c, e.dist(c), &mut found)
        }
        (Seg::Arc { a, c, .. }, Seg::Arc { a: e, c: d, .. }) => circle_circle(c, a.dist(c), d, e.dist(d), &mut found),
    };
    for &p in &found[..n] {
        keep(p, out);
    }
}

fn line_line(a: P2, b: P2, c: P2, d: P2, out: &mut [P2; 2]) -> usize {
    let (u, v) = (b - a, d - c);
    let det = u.cross(v);
    if det.abs() <= 1e-12 * u.norm() * v.norm() {
        return 0;
    }
    out[0] = a + u * ((c - a).cross(v) / det);
    1
}

fn line_circle(a: P2, b: P2, c: P2, r: f64, out: &mut [P2; 2]) -> usize {
    let u = (b - a).unit();
    let foot = a + u * (c - a).dot(u);
    let h = foot.dist(c);
    if h > r + TOL {
        return 0;
    }
    let half = ((r - h) * (r + h)).max(0.0).sqrt();
    *out = [foot - u * half, foot + u * half];
    2
}

fn circle_circle(c: P2, r: f64, d: P2, q: f64, out: &mut [P2; 2]) -> usize {
    let gap = c.dist(d);
    if gap < 1e-9 || gap > r + q + TOL || gap < (r - q).abs() - TOL {
        return 0;
    }
    let u = (d - c).unit();
    let along = (gap * gap + r * r - q * q) / (2.0 * gap);
    let half = ((r - along) * (r + along)).max(0.0).sqrt();
    let foot = c + u * along;
    *out = [foot - u.left() * half, foot + u.left() * half];
    2
}

/// The original boundary, for distance questions.
struct Field {
    segs: Vec<(Bounds, Seg)>,
}

impl Field {
    fn new<'a>(paths: impl IntoIterator<Item = &'a Path2>) -> Self {
        let segs = paths.into_iter().flat_map(|p| p.segs()).map(|s| (s.bounds(), *s)).collect();
        Self { segs }
    }
    fn nearer_than(&self, p: P2, d: f64) -> bool {
        self.segs.iter().any(|(b, s)| b.dist(p) < d && s.dist(p) < d)
    }
}

/// Every segment of a curve moved to the left, with arcs about the corners that turn away.
fn raw(path: &Path2, d: f64, out: &mut Vec<Seg>) {
    let segs = path.segs();
    for (i, s) in segs.iter().enumerate() {
        out.extend(s.offset_left(d));
        let next = match segs.get(i + 1) {
            Some(n) => n,
            None if path.is_closed() => &segs[0],
            None => continue,
        };
        let (t, u) = (s.tangent(1.0), next.tangent(0.0));
        let (sin, cos) = (t.cross(u), t.dot(u));
        let turned_back = cos < 0.0 && sin < 1e-9;
        if turned_back || sin * d < -TOL {
            let p = s.b();
            let sweep = if sin >= 0.0 { -core::f64::consts::PI } else { libm::atan2(sin, cos) };
            out.push(Seg::Arc { a: p + t.left() * d, b: p + u.left() * d, c: p, sweep });
        }
    }
}

/// All segments cut at all their crossings.
fn cut_apart(segs: &[Seg]) -> Vec<Seg> {
    let mut order: Vec<(Bounds, usize)> = segs.iter().enumerate().map(|(i, s)| (s.bounds().grown(TOL), i)).collect();
    order.sort_by(|l, r| l.0.min.x.total_cmp(&r.0.min.x).then(l.1.cmp(&r.1)));
    let mut cuts: Vec<Vec<(f64, P2)>> = vec![Vec::new(); segs.len()];
    let mut hits = Vec::new();
    for (k, (bi, i)) in order.iter().enumerate() {
        for (bj, j) in &order[k + 1..] {
            if bj.min.x > bi.max.x {
                break;
            }
            if !bi.overlaps(bj) {
                continue;
            }
            hits.clear();
            intersections(&segs[*i], &segs[*j], &mut hits);
            for &p in &hits {
                cuts[*i].push((segs[*i].nearest(p), p));
                cuts[*j].push((segs[*j].nearest(p), p));
            }
        }
    }
    let mut out = Vec::new();
    for (s, mut c) in segs.iter().zip(cuts) {
        c.sort_by(|l, r| l.0.total_cmp(&r.0));
        pieces(s, &c, &mut out);
    }
    out
}

fn pieces(s: &Seg, cuts: &[(f64, P2)], out: &mut Vec<Seg>) {
    let len = s.len();
    let mut from = (0.0, s.a());
    for &(t, p) in cuts.iter().chain(core::iter::once(&(1.0, s.b()))) {
        let length = (t - from.0) * len;
        if length > 1e-6 {
            let piece = match *s {
                Seg::Line { .. } => Seg::Line { a: from.1, b: p },
                _ => with_end(with_start(s.part(from.0, t), from.1), p),
            };
            out.push(piece);
            from = (t, p);
        }
    }
}

/// Curves at distance `d` on the left of all these loops, where `free` holds.
fn loops_at(loops: &[&Path2], d: f64, free: &dyn Fn(P2) -> bool) -> Result<Vec<Path2>, Error> {
    let field = Field::new(loops.iter().copied());
    let count: usize = loops.iter().map(|l| l.segs().len()).sum();
    if count > 200_000 {
        return Err(Error::TooManyPasses);
    }
    // At the limit of arithmetic a slightly different distance has the same curve without its ambiguity.
    for nudge in [0.0, 3e-7, 1e-6, -1e-6, 3e-6, 1e-5] {
        let d = d + nudge;
        let mut moved = Vec::with_capacity(2 * count);
        for l in loops {
            raw(l, d, &mut moved);
        }
        let mut kept = cut_apart(&moved);
        kept.retain(|s| {
            let p = s.at(0.5);
            !field.nearer_than(p, d - SLACK) && free(p)
        });
        let found = stitch::loops(kept);
        if found.lost < 1e-3 {
            let closed = found.loops.into_iter().filter(|l| l.iter().map(Seg::len).sum::<f64>() > 2e-5);
            return Ok(closed.map(|segs| Path2 { segs, closed: true }).collect());
        }
    }
    Err(Error::Numerical)
}

/// Outlines with the islands inside them.
fn grouped(loops: Vec<Path2>) -> Vec<Region> {
    let (holes, outers): (Vec<_>, Vec<_>) = loops.into_iter().partition(|l| l.area() < -1e-6 * l.length());
    let mut regions: Vec<(f64, Path2, Vec<Path2>)> = outers.into_iter().map(|o| (o.area(), o, Vec::new())).collect();
    regions.sort_by(|l, r| l.0.total_cmp(&r.0));
    for hole in holes {
        let p = hole.segs()[0].at(0.5);
        if let Some(home) = regions.iter_mut().find(|r| r.1.contains(p)) {
            home.2.push(hole);
        }
    }
    regions.reverse();
    regions.into_iter().map(|(_, outer, holes)| Region::trusted(outer, holes)).collect()
}

/// The part of a region at least `d` from its outline and islands: where the centre of a tool of that radius may be,
/// largest piece first. Empty if there is none.
pub fn erode(region: &Region, d: f64) -> Result<Vec<Region>, Error> {
    let d = crate::not_negative(d, "offset")?;
    if d < TOL && region.holes().is_empty() {
        return Ok(vec![region.clone()]);
    }
    let loops: Vec<&Path2> = region.loops().collect();
    Ok(grouped(loops_at(&loops, d.max(TOL), &|p| region.contains(p))?))
}

/// What a region has in common with the inside of a closed curve.
pub fn common(region: &Region, inside: &Path2) -> Result<Vec<Region>, Error> {
    if !inside.is_closed() {
        return Err(Error::NotClosed);
    }
    let inside = inside.oriented(true);
    let loops: Vec<&Path2> = region.loops().chain([&inside]).collect();
    Ok(grouped(loops_at(&loops, TOL, &|p| region.contains(p) && inside.contains(p))?))
}

/// Everything within `d` of the insides of closed curves: their union, grown with round corners.
pub fn grow(paths: &[Path2], d: f64) -> Result<Vec<Region>, Error> {
    let d = crate::positive(d, "offset")?;
    if paths.iter().any(|p| !p.is_closed()) {
        return Err(Error::NotClosed);
    }
    let turned: Vec<Path2> = paths.iter().map(|p| p.oriented(false)).collect();
    let loops: Vec<&Path2> = turned.iter().collect();
    let found = loops_at(&loops, d, &|p| !paths.iter().any(|q| q.contains(p)))?;
    Ok(grouped(found.iter().map(Path2::reversed).collect()))
}

/// What lies within `d` of these regions: the area a tool of that radius cleans when its centre goes everywhere in
/// them.
pub(crate) fn dilate(regions: &[Region], d: f64) -> Result<Vec<Region>, Error> {
    let turned: Vec<Path2> = regions.iter().flat_map(Region::loops).map(Path2::reversed).collect();
    let loops: Vec<&Path2> = turned.iter().collect();
    let found = loops_at(&loops, d, &|p| !regions.iter().any(|r| r.contains(p)))?;
    Ok(grouped(found.iter().map(Path2::reversed).collect()))
}

/// `from` without `cut`, narrowed by `d` (> 0) everywhere.
pub(crate) fn difference(from: &[Region], cut: &[Region], d: f64) -> Result<Vec<Region>, Error> {
    let turned: Vec<Path2> = cut.iter().flat_map(Region::loops).map(Path2::reversed).collect();
    let loops: Vec<&Path2> = from.iter().flat_map(Region::loops).chain(&turned).collect();
    let free = |p: P2| from.iter().any(|r| r.contains(p)) && !cut.iter().any(|r| r.contains(p));
    Ok(grouped(loops_at(&loops, d, &free)?))
}

/// An open curve moved to its left by `d` (to its right if negative), round about outer corners, cut back at inner
/// ones. The longest piece if it falls apart.
pub fn offset_open(path: &Path2, d: f64) -> Result<Path2, Error> {
    if !d.is_finite() {
        return Err(Error::NotFinite);
    }
    if path.is_closed() {
        return Err(Error::Parameter("open curve"));
    }
    if d.abs() < TOL {
        return Ok(path.clone());
    }
    if d < 0.0 {
        return Ok(offset_open(&path.reversed(), -d)?.reversed());
    }
    let field = Field::new([path]);
    let mut moved = Vec::new();
    raw(path, d, &mut moved);
    let mut kept = cut_apart(&moved);
    kept.retain(|s| !field.nearer_than(s.at(0.5), d - SLACK));
    let length = |c: &Vec<Seg>| c.iter().map(Seg::len).sum::<f64>();
    let longest = stitch::chains(kept).into_iter().max_by(|l, r| length(l).total_cmp(&length(r)));
    let segs = longest.ok_or(Error::ToolTooLarge { fits: 0.0 })?;
    Ok(Path2 { segs, closed: false })
}
