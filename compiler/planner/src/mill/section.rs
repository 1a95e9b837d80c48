//! Sections of slots as curves: `u` across, to the left of the course of travel, `v` up from the top of the slot. A
//! tool of any edge radius fits where the centre of its rounding keeps off the curve by that radius.

use gr_toolpath as tp;
use gr_toolpath::{P2, Path2, Seg, Vertex};

use super::{Done, path, words};
use crate::process::*;

/// A section with room for one tool.
pub(super) struct Cut {
    /// Where the centre of the edge's rounding may be: on this curve and above it.
    centres: Path2,
    /// From the tool's axis to that centre.
    flat: f64,
    edge: f64,
    depth: f64,
    /// The walls stand upright and the floor is flat.
    pub steady: bool,
}

/// The curve of a section, with the top of the part so far on both sides of it.
pub(super) fn curve(section: &Section, depth: f64, land: f64) -> Done<Path2> {
    match section {
        Section::SquareU { width, radius, angle } => square(*width, *radius, *angle, depth, land),
        Section::RoundedU { width } => round(width / 2.0, depth, land),
        Section::Circular { radius, .. } => round(*radius, depth, land),
        Section::Vee { radius, angle, tilt } => vee(*radius, *angle, *tilt, depth, land),
        Section::Tee { width, .. } => square(*width, [0.0; 2], [0.0; 2], depth, land),
        Section::General(contour) => general(contour, depth, land),
    }
}

/// How far from its middle a circle about a centre at this height meets the top.
fn chord(radius: f64, height: f64) -> f64 {
    libm::sqrt((radius * radius - height * height).max(0.0))
}

fn square(width: f64, radius: [f64; 2], angle: [f64; 2], depth: f64, land: f64) -> Done<Path2> {
    let good = |a: f64| (0.0..1.5).contains(&a);
    if !good(angle[0]) || !good(angle[1]) {
        return Err("a section whose walls lean inwards or lie flat".into());
    }
    let h = width / 2.0;
    // From the floor up the wall at +u, and out on the top.
    let half = |i: usize| {
        let (r, a) = (radius[i].max(0.0), angle[i]);
        let (s, c) = (libm::sin(a), libm::cos(a));
        let t = r * libm::tan((std::f64::consts::FRAC_PI_2 - a) / 2.0);
        let mut out = Vec::new();
        if t > 0.0 && t * c > depth - 1e-6 {
            // The rounding itself goes through the top.
            let x = h - t + chord(r, r - depth);
            out.extend([Vertex::arc(h - t, -depth, libm::tan(libm::acos(1.0 - depth / r) / 4.0)), Vertex::line(x, 0.0)]);
        } else {
            if t > 0.0 {
                out.push(Vertex::arc(h - t, -depth, libm::tan((std::f64::consts::FRAC_PI_2 - a) / 4.0)));
            }
            out.extend([Vertex::line(h + s * t, -depth + c * t), Vertex::line(h + depth * s / c, 0.0)]);
        }
        let end = out[out.len() - 1].p;
        out.push(Vertex::line(end.x + land, 0.0));
        (t, out)
    };
    // The second wall is at -u, the first at +u.
    let ((t0, right), (t1, left)) = (half(0), half(1));
    if t0 + t1 > width + 1e-9 {
        return Err("a section whose radii do not fit its width".into());
    }
    let bulges = left.iter().map(|v| v.bulge).rev().skip(1).chain([0.0]);
    let mut out: Vec<Vertex> = left.iter().rev().zip(bulges).map(|(v, b)| Vertex::arc(-v.p.x, v.p.y, b)).collect();
    out.extend(right);
    Path2::from_vertices(&out, false).map_err(words)
}

fn round(radius: f64, depth: f64, land: f64) -> Done<Path2> {
    let centre = radius - depth;
    let (x, y) = if centre < 0.0 { (radius, centre) } else { (chord(radius, centre), 0.0) };
    let sweep = if centre < 0.0 { std::f64::consts::PI } else { 2.0 * libm::acos(centre / radius) };
    let mut out = vec![Vertex::line(-x - land, 0.0)];
    if centre < 0.0 {
        out.push(Vertex::line(-x, 0.0));
    }
    out.extend([Vertex::arc(-x, y, libm::tan(sweep / 4.0)), Vertex::line(x, y)]);
    if centre < 0.0 {
        out.push(Vertex::line(x, 0.0));
    }
    out.push(Vertex::line(x + land, 0.0));
    Path2::from_vertices(&out, false).map_err(words)
}

fn vee(radius: f64, angle: f64, tilt: f64, depth: f64, land: f64) -> Done<Path2> {
    let square = std::f64::consts::FRAC_PI_2;
    // The tilt is the angle of the first side from the x axis. Nought would lay that side flat: programs write it
    // for a V that stands upright.
    let (first, second) = if tilt == 0.0 { (angle / 2.0, angle / 2.0) } else { (square - tilt, tilt + angle - square) };
    if !(angle > 0.0) || !(0.0..1.5).contains(&first) || !(0.0..1.5).contains(&second) {
        return Err("a V one of whose walls leans inwards or lies flat".into());
    }
    let c = P2::new(0.0, radius - depth);
    let low = |a: f64, side: f64| c + P2::new(side * libm::cos(a), -libm::sin(a)) * radius;
    let (p, q) = (low(second, -1.0), low(first, 1.0));
    match (p.y < -1e-6, q.y < -1e-6) {
        (true, true) => {}
        (false, false) => return round(radius, depth, land),
        _ => return Err("a V with a radius that reaches its top on one side".into()),
    }
    let top = |p: P2, a: f64, side: f64| p.x - side * p.y * libm::tan(a);
    let (x, z) = (top(p, second, -1.0), top(q, first, 1.0));
    let bulge = if radius > 0.0 { libm::tan((std::f64::consts::PI - first - second) / 4.0) } else { 0.0 };
    let mut out = vec![Vertex::line(x - land, 0.0), Vertex::line(x, 0.0), Vertex { p, bulge }];
    if radius > 0.0 {
        out.push(Vertex { p: q, bulge: 0.0 });
    }
    out.extend([Vertex::line(z, 0.0), Vertex::line(z + land, 0.0)]);
    Path2::from_vertices(&out, false).map_err(words)
}

fn general(contour: &Contour, depth: f64, land: f64) -> Done<Path2> {
    if contour.closed {
        return Err("a section that is closed".into());
    }
    let mut line = path(contour)?;
    let low = line.bounds().min.y;
    line = line.moved(P2::new(0.0, -depth - low));
    if line.start().x > line.end().x {
        line = line.reversed();
    }
    let (a, b) = (line.start(), line.end());
    let samples = line.sampled(((b.x - a.x).abs() / 500.0).max(1e-3));
    if samples.windows(2).any(|w| w[1].x < w[0].x - 1e-6) {
        return Err("a section with an undercut".into());
    }
    if a.y < -1e-6 || b.y < -1e-6 {
        return Err("a section that does not reach the top of the slot".into());
    }
    // On the top of the part, or straight up where the section goes on above it.
    let on = |p: P2, side: f64| if p.y > 1e-6 { P2::new(p.x, p.y + land) } else { P2::new(p.x + side * land, p.y) };
    let first = Seg::Line { a: on(a, -1.0), b: a };
    let last = Seg::Line { a: b, b: on(b, 1.0) };
    Path2::from_segs(std::iter::once(first).chain(line.segs().iter().copied()).chain([last]), false).map_err(words)
}

impl Cut {
    /// The section `curve`, `depth` mm deep, for a tool of this radius and edge radius, mm.
    pub fn new(curve: &Path2, depth: f64, radius: f64, edge: f64) -> Done<Cut> {
        let exact = Cut::of(curve, depth, radius, edge);
        let reached = exact.as_ref().map_or(0.0, Cut::deepest);
        // The centre of a ball as wide as the section has one line to go down, which rounding may lose: a hair less shows it.
        if edge > tp::HAIR && reached < depth {
            let freer = Cut::of(curve, depth, radius, edge - tp::HAIR).map(|c| Cut { edge, flat: radius - edge, ..c });
            if freer.as_ref().is_ok_and(|c| c.deepest() > reached + tp::RESOLUTION) {
                return freer;
            }
        }
        exact
    }

    fn of(curve: &Path2, depth: f64, radius: f64, edge: f64) -> Done<Cut> {
        let centres = if edge > 0.0 { tp::offset_open(curve, edge).map_err(|_| "the tool does not fit its section".to_string())? } else { curve.clone() };
        let upright = |s: &Seg| match s {
            Seg::Line { a, b } => (a.x - b.x).abs() < 1e-9 || (a.y - b.y).abs() < 1e-9,
            Seg::Arc { .. } => false,
        };
        let steady = curve.segs().iter().all(upright);
        Ok(Cut { centres, flat: radius - edge, edge, depth, steady })
    }

    /// Where the tool's axis may be when its tip is at a depth: stretches across.
    pub fn across(&self, y: f64) -> Vec<(f64, f64)> {
        let v = self.edge - y + 1e-7;
        let mut at: Vec<f64> = Vec::new();
        for s in self.centres.segs() {
            match *s {
                Seg::Line { a, b } => {
                    if (a.y > v) != (b.y > v) {
                        at.push(a.x + (b.x - a.x) * ((v - a.y) / (b.y - a.y)));
                    }
                }
                Seg::Arc { a, b, c, .. } => {
                    let r = a.dist(c);
                    let h = v - c.y;
                    if h.abs() >= r {
                        continue;
                    }
                    let half = libm::sqrt(r * r - h * h);
                    let ends = (a.y > v) != (b.y > v);
                    let mut hits: Vec<f64> = [c.x - half, c.x + half].into_iter().filter(|x| s.dist(P2::new(*x, v)) < 1e-7).collect();
                    // Both or one, as its ends say.
                    if ends && hits.len() == 2 {
                        let near = |x: f64| P2::new(x, v).dist(a).min(P2::new(x, v).dist(b));
                        hits.sort_by(|l, r| near(*r).total_cmp(&near(*l)));
                        hits.truncate(1);
                    }
                    if ends || hits.len() == 2 {
                        at.extend(hits);
                    }
                }
            }
        }
        at.sort_by(f64::total_cmp);
        let pairs = at.chunks_exact(2).map(|c| (c[0] + self.flat, c[1] - self.flat));
        pairs.filter(|(a, b)| b - a > -1e-6).map(|(a, b)| if b - a < tp::RESOLUTION { ((a + b) / 2.0, (a + b) / 2.0) } else { (a, b) }).collect()
    }

    /// How deep the tip gets.
    pub fn deepest(&self) -> f64 {
        let fits = |y: f64| !self.across(y).is_empty();
        if fits(self.depth) {
            return self.depth;
        }
        let least = 1e-4f64.min(self.depth);
        if !fits(least) {
            return 0.0;
        }
        let (mut low, mut high) = (least, self.depth);
        for _ in 0..60 {
            let mid = (low + high) / 2.0;
            if fits(mid) { low = mid } else { high = mid }
        }
        low
    }

    /// How far the walls move in between two depths.
    pub fn moves_in(&self, y: f64, z: f64) -> f64 {
        match (self.across(y).as_slice(), self.across(z).as_slice()) {
            ([a], [b]) => (b.0 - a.0).abs().max((a.1 - b.1).abs()),
            _ => f64::INFINITY,
        }
    }

    /// Places of a ball, from wall to wall: offset to the left of the course and depth of its tip. No scallop is
    /// higher than the tolerance.
    pub fn places(&self, tolerance: f64) -> Done<Vec<(f64, f64)>> {
        let r = self.edge;
        let straight = 2.0 * libm::sqrt((2.0 * r * tolerance - tolerance * tolerance).max(1e-12));
        let mut out: Vec<(f64, f64)> = Vec::new();
        for s in self.centres.segs() {
            // Not round the edge to the top of the part.
            if s.at(0.5).y - s.tangent(0.5).left().y * r > -1e-6 {
                continue;
            }
            let step = match *s {
                Seg::Arc { a, c, sweep, .. } if sweep > 0.0 => {
                    let inner = a.dist(c);
                    libm::sqrt(8.0 * r * tolerance * inner / (inner + r)).max(1e-4)
                }
                _ => straight,
            };
            let n = (s.len() / step).ceil().max(1.0);
            if n > 100_000.0 || out.len() > 20_000 {
                return Err("a section that needs too many passes".into());
            }
            for k in 0..=n as usize {
                let t = k as f64 / n;
                let p = s.at(t);
                let contact = p.y - s.tangent(t).left().y * r;
                let tip = r - p.y;
                if contact <= 1e-6 && tip > 1e-6 {
                    out.push((p.x, tip));
                }
            }
        }
        out.dedup_by(|a, b| (a.0 - b.0).abs() < tp::RESOLUTION && (a.1 - b.1).abs() < tp::RESOLUTION);
        Ok(out)
    }
}
