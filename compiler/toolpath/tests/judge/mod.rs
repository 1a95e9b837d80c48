//! The judge: a height field that a tool is moved through, point by point. It shares no code with the offsetter: it
//! flattens curves on its own and knows only distances between points and short chords.
#![allow(dead_code)]

use gr_toolpath::{Kind, Move, P2, P3, Path2, Region};

pub struct Judge {
    pub h: f64,
    nx: usize,
    ny: usize,
    x0: f64,
    y0: f64,
    z: Vec<f64>,
    /// Distance to the region's edge, positive inside.
    pub sd: Vec<f64>,
}

#[derive(Debug, Default)]
pub struct Verdict {
    /// Deepest intrusion beyond the allowance, mm.
    pub gouge: f64,
    /// Where.
    pub gouge_at: Option<P2>,
    /// Reachable points that were not cut.
    pub missed: usize,
    pub missed_at: Option<P2>,
    /// Rapids through material.
    pub crashes: usize,
    pub crash_at: Option<P3>,
}

/// Corners of a curve, arcs as short chords.
pub fn flatten(path: &Path2) -> Vec<(f64, f64)> {
    let v = path.vertices();
    let mut out = Vec::new();
    for i in 0..v.len() {
        let (a, b) = (v[i], v[(i + 1) % v.len()]);
        out.push((a.p.x, a.p.y));
        if a.bulge == 0.0 {
            continue;
        }
        let sweep = 4.0 * a.bulge.atan();
        let chord = (b.p.x - a.p.x).hypot(b.p.y - a.p.y);
        let r = chord / (2.0 * (sweep / 2.0).sin().abs());
        let heading = (b.p.y - a.p.y).atan2(b.p.x - a.p.x) - sweep / 2.0;
        let side = sweep.signum();
        let (cx, cy) = (a.p.x - r * side * heading.sin(), a.p.y + r * side * heading.cos());
        let from = (a.p.y - cy).atan2(a.p.x - cx);
        // Chords leave the arc by at most 0.0002 mm.
        let n = (sweep.abs() / (1.6e-3 / r).sqrt().min(0.5)).ceil() as usize;
        for k in 1..n {
            let t = from + sweep * k as f64 / n as f64;
            out.push((cx + r * t.cos(), cy + r * t.sin()));
        }
    }
    out
}

fn chord_distance(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (ux, uy) = (b.0 - a.0, b.1 - a.1);
    let n = ux * ux + uy * uy;
    let t = if n > 0.0 { (((p.0 - a.0) * ux + (p.1 - a.1) * uy) / n).clamp(0.0, 1.0) } else { 0.0 };
    (p.0 - a.0 - t * ux).hypot(p.1 - a.1 - t * uy)
}

/// Where a horizontal line crosses a polygon, left to right.
fn crossings(y: f64, poly: &[(f64, f64)]) -> Vec<f64> {
    let mut xs = Vec::new();
    for i in 0..poly.len() {
        let (a, b) = (poly[i], poly[(i + 1) % poly.len()]);
        if (a.1 > y) != (b.1 > y) {
            xs.push(a.0 + (b.0 - a.0) * (y - a.1) / (b.1 - a.1));
        }
    }
    xs.sort_by(f64::total_cmp);
    xs
}

impl Judge {
    pub fn new(region: &Region, margin: f64, h: f64) -> Self {
        let polys: Vec<_> = std::iter::once(region.outer()).chain(region.holes()).map(flatten).collect();
        let b = region.bounds();
        // Off the corners of the drawing.
        let (x0, y0) = (b.min.x - margin + h * 0.37, b.min.y - margin + h * 0.41);
        let nx = ((b.max.x + margin - x0) / h) as usize + 1;
        let ny = ((b.max.y + margin - y0) / h) as usize + 1;
        let mut near = vec![f64::INFINITY; nx * ny];
        // Exact distances in a band about the edges, by walking along them.
        let band = margin.max(1.0) + 14.0 * h;
        for poly in &polys {
            for i in 0..poly.len() {
                let (a, b) = (poly[i], poly[(i + 1) % poly.len()]);
                let ix = |x: f64| ((x - x0) / h).clamp(0.0, nx as f64 - 1.0) as usize;
                let iy = |y: f64| ((y - y0) / h).clamp(0.0, ny as f64 - 1.0) as usize;
                for j in iy(a.1.min(b.1) - band)..=iy(a.1.max(b.1) + band) {
                    for k in ix(a.0.min(b.0) - band)..=ix(a.0.max(b.0) + band) {
                        let p = (x0 + k as f64 * h, y0 + j as f64 * h);
                        let d = chord_distance(p, a, b);
                        let cell = &mut near[j * nx + k];
                        *cell = cell.min(d);
                    }
                }
            }
        }
        let mut sd = near;
        for j in 0..ny {
            let rows: Vec<_> = polys.iter().map(|q| crossings(y0 + j as f64 * h, q)).collect();
            for k in 0..nx {
                let x = x0 + k as f64 * h;
                let within = |xs: &Vec<f64>| xs.partition_point(|c| *c < x) % 2 == 1;
                let inside = within(&rows[0]) && !rows[1..].iter().any(within);
                let d = sd[j * nx + k].min(1e6);
                sd[j * nx + k] = if inside { d } else { -d };
            }
        }
        Self { h, nx, ny, x0, y0, z: vec![0.0; nx * ny], sd }
    }

    fn at(&self, i: usize) -> P2 {
        P2::new(self.x0 + (i % self.nx) as f64 * self.h, self.y0 + (i / self.nx) as f64 * self.h)
    }

    fn capsule(&mut self, a: (f64, f64), b: (f64, f64), r: f64, mut f: impl FnMut(&mut f64)) {
        let lim = |v: f64, n: usize| v.clamp(0.0, n as f64 - 1.0) as usize;
        let (jx0, jx1) = (
            lim((a.0.min(b.0) - r - self.x0) / self.h, self.nx),
            lim((a.0.max(b.0) + r - self.x0) / self.h + 1.0, self.nx),
        );
        let (jy0, jy1) = (
            lim((a.1.min(b.1) - r - self.y0) / self.h, self.ny),
            lim((a.1.max(b.1) + r - self.y0) / self.h + 1.0, self.ny),
        );
        for j in jy0..=jy1 {
            for k in jx0..=jx1 {
                let p = (self.x0 + k as f64 * self.h, self.y0 + j as f64 * self.h);
                if chord_distance(p, a, b) <= r {
                    f(&mut self.z[j * self.nx + k]);
                }
            }
        }
    }

    /// Runs the moves and judges: the floor must be at `bottom`, walls `allowance` away from the region's edge.
    pub fn run(&mut self, moves: &[Move], r: f64, bottom: f64, allowance: f64, cover: bool) -> Verdict {
        let mut v = Verdict::default();
        let mut at: Option<P3> = None;
        for m in moves {
            let Some(from) = at else {
                at = Some(m.to);
                continue;
            };
            for (a, b, z0, z1) in chop(from, m, r) {
                if m.kind == Kind::Rapid {
                    let z = z0.min(z1);
                    let mut hit = 0;
                    self.capsule(a, b, r - 0.02, |cell| hit += usize::from(*cell > z + 1e-6));
                    if hit > 0 {
                        v.crashes += 1;
                        v.crash_at = v.crash_at.or(Some(P3::new(a.0, a.1, z)));
                    }
                } else {
                    let z = z0.max(z1);
                    self.capsule(a, b, r, |cell| *cell = cell.min(z));
                }
            }
            at = Some(m.to);
        }
        let room: Vec<bool> = self.sd.iter().map(|&d| d >= r + allowance).collect();
        let reach = r - 0.75 * self.h;
        for i in 0..self.z.len() {
            if self.z[i] < -1e-9 && allowance - self.sd[i] > v.gouge {
                v.gouge = allowance - self.sd[i];
                v.gouge_at = Some(self.at(i));
            }
            if cover && self.z[i] > bottom + 1e-6 && self.sd[i] > allowance && self.room_near(&room, i, reach) {
                v.missed += 1;
                v.missed_at = v.missed_at.or(Some(self.at(i)));
            }
        }
        v
    }

    fn room_near(&self, room: &[bool], i: usize, reach: f64) -> bool {
        let (k, j) = ((i % self.nx) as i64, (i / self.nx) as i64);
        let n = (reach / self.h) as i64;
        for dj in -n..=n {
            for dk in -n..=n {
                let (y, x) = (j + dj, k + dk);
                if x < 0 || y < 0 || x >= self.nx as i64 || y >= self.ny as i64 {
                    continue;
                }
                let d2 = ((dj * dj + dk * dk) as f64) * self.h * self.h;
                if d2 <= reach * reach && room[y as usize * self.nx + x as usize] {
                    return true;
                }
            }
        }
        false
    }

    /// Area of the region that was not cut to the bottom, mm².
    pub fn uncut(&self, bottom: f64) -> f64 {
        let n = (0..self.z.len()).filter(|&i| self.sd[i] > 0.0 && self.z[i] > bottom + 1e-6).count();
        n as f64 * self.h * self.h
    }

    /// Largest and mean width of material met by the tool's front on feed moves at depth, sampled.
    pub fn engagement(&mut self, moves: &[Move], r: f64) -> Vec<(P3, f64)> {
        let mut out = Vec::new();
        let mut at: Option<P3> = None;
        for m in moves {
            if let Some(from) = at {
                for (a, b, z0, z1) in chop(from, m, r * 0.1) {
                    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
                    let d = dx.hypot(dy);
                    if m.kind != Kind::Rapid && d > 1e-9 {
                        let (ux, uy) = (dx / d, dy / d);
                        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
                        for s in -60..=60 {
                            let t = f64::from(s) / 60.0 * 1.5;
                            let q = r - 0.12;
                            let (px, py) = (b.0 + q * (t.cos() * ux - t.sin() * uy), b.1 + q * (t.cos() * uy + t.sin() * ux));
                            let (k, j) = (((px - self.x0) / self.h).round(), ((py - self.y0) / self.h).round());
                            if k < 0.0 || j < 0.0 || k >= self.nx as f64 || j >= self.ny as f64 {
                                continue;
                            }
                            if self.z[j as usize * self.nx + k as usize] > z0.max(z1) + 1e-6 {
                                lo = lo.min(q * t.sin());
                                hi = hi.max(q * t.sin());
                            }
                        }
                        out.push((P3::new(b.0, b.1, z1), (hi - lo).max(0.0)));
                        let z = z0.max(z1);
                        self.capsule(a, b, r, |cell| *cell = cell.min(z));
                    }
                }
            }
            at = Some(m.to);
        }
        out
    }
}

/// Short straight pieces of a move.
fn chop(from: P3, m: &Move, piece: f64) -> Vec<((f64, f64), (f64, f64), f64, f64)> {
    let dz = (m.to.z - from.z).abs();
    let point = |t: f64| match m.kind {
        Kind::Arc { centre, sweep } => {
            let (x, y) = (from.x - centre.x, from.y - centre.y);
            let (s, c) = (sweep * t).sin_cos();
            (centre.x + x * c - y * s, centre.y + x * s + y * c)
        }
        _ => (from.x + (m.to.x - from.x) * t, from.y + (m.to.y - from.y) * t),
    };
    let length = match m.kind {
        Kind::Arc { centre, sweep } => {
            let r = (from.x - centre.x).hypot(from.y - centre.y);
            // Chords stay within a µm of the arc.
            return cut(point, (sweep.abs() / (8e-3 / r.max(1e-3)).sqrt()).max(r * sweep.abs() / piece).max(dz / 0.05), from.z, m.to.z);
        }
        _ => (m.to.x - from.x).hypot(m.to.y - from.y),
    };
    cut(point, (length / piece).max(dz / 0.05), from.z, m.to.z)
}

fn cut(point: impl Fn(f64) -> (f64, f64), n: f64, z0: f64, z1: f64) -> Vec<((f64, f64), (f64, f64), f64, f64)> {
    let n = n.ceil().clamp(1.0, 1e6) as usize;
    (0..n)
        .map(|i| {
            let (s, t) = (i as f64 / n as f64, (i + 1) as f64 / n as f64);
            (point(s), point(t), z0 + (z1 - z0) * s, z0 + (z1 - z0) * t)
        })
        .collect()
}
