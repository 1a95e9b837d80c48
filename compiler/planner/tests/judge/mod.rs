//! The judge: a height field over the raw block that the tools of a program are moved through, point by point. It
//! knows nothing of the planner's geometry: what is to stay is a function that the test writes down itself.
#![allow(dead_code)]

pub mod cases;
pub mod cells;
pub mod part;
pub mod special;

use std::collections::BTreeMap;

use gr_ir::geometry::ArcShape;
use gr_ir::{Marker, Op};
use gr_planner::Planned;
use gr_planner::process::OperationKind;

pub type Poly = Vec<(f64, f64)>;

/// Height of the finished surface at a point; `grow` (may be negative) widens what is taken away.
pub type Surface<'a> = dyn Fn(f64, f64, f64) -> f64 + 'a;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Deepest cut below what may be cut, mm, and where.
    pub gouge: f64,
    pub gouge_at: [f64; 3],
    /// Rapids through material.
    pub crashes: usize,
    pub crash_at: [f64; 3],
    /// Area that some tool reaches and none cut, mm², and where, and how high it still is.
    pub missed: f64,
    pub missed_at: [f64; 3],
    /// Runs at feed that took nothing away.
    pub air: usize,
    /// All runs at feed.
    pub runs: usize,
    /// Area that no tool of the plan reaches, mm².
    pub unreachable: f64,
}

/// How deep what the tool leaves is above its tip, at a distance from its axis.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub r: f64,
    pub edge: f64,
    pub cone: Option<f64>,
    pub side: f64,
    pub bottom: f64,
}

impl Shape {
    fn over(&self, d: f64) -> f64 {
        if let Some(half) = self.cone {
            return d / half.tan();
        }
        let e = d - (self.r - self.edge);
        if e <= 0.0 { 0.0 } else { self.edge - (self.edge * self.edge - e * e).max(0.0).sqrt() }
    }
}

pub struct Judge {
    pub h: f64,
    nx: usize,
    ny: usize,
    x0: f64,
    y0: f64,
    pub z: Vec<f64>,
    block: [f64; 3],
    /// Heights at which floors lie, where walls are upright: 2½D work puts a tool on no others. Empty: any.
    pub floors: Vec<f64>,
    /// Radius at the foot of the walls: a tool whose own edge is smaller goes up it, others stand on floors only.
    pub round: f64,
}

const AIR: f64 = -1e9;
/// Depth in which nothing is said of chords, steps of z and the like.
const SLACK: f64 = 0.02;

impl Judge {
    /// A field over part of a block: lower left and upper right corner, and how fine it is.
    pub fn new(block: [f64; 3], low: [f64; 2], high: [f64; 2], h: f64) -> Judge {
        let (x0, y0) = (low[0] + 0.37 * h, low[1] + 0.41 * h);
        let (nx, ny) = (((high[0] - x0) / h) as usize + 1, ((high[1] - y0) / h) as usize + 1);
        let mut j = Judge { h, nx, ny, x0, y0, z: vec![AIR; nx * ny], block, floors: Vec::new(), round: 0.0 };
        for i in 0..nx * ny {
            let (x, y) = j.at(i);
            if x >= 0.0 && y >= 0.0 && x <= block[0] && y <= block[1] {
                j.z[i] = block[2];
            }
        }
        j
    }
    pub fn at(&self, i: usize) -> (f64, f64) {
        (self.x0 + (i % self.nx) as f64 * self.h, self.y0 + (i / self.nx) as f64 * self.h)
    }
    fn columns(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        range((low - self.x0) / self.h, (high - self.x0) / self.h, self.nx)
    }
    fn rows(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        range((low - self.y0) / self.h, (high - self.y0) / self.h, self.ny)
    }

    /// Runs a planned program. `surface` is what the part looks like afterwards, `tolerance` how far walls may be off,
    /// `cover` whether all of it has to be reached.
    pub fn run(&mut self, planned: &Planned, surface: &Surface<'_>, floor: f64, tolerance: f64, cover: bool) -> Verdict {
        let mut v = Verdict::default();
        let leave: BTreeMap<i32, (f64, f64)> = planned
            .process
            .steps()
            .iter()
            .map(|s| {
                let a = match &s.operation.kind {
                    OperationKind::Mill(m) => (m.allowance_side, m.allowance_bottom),
                    _ => (0.0, 0.0),
                };
                (s.origin.id as i32, a)
            })
            .collect();
        let mut lows: BTreeMap<(u64, u64), Vec<f64>> = BTreeMap::new();
        let mut used: Vec<Shape> = Vec::new();
        let mut tool = 0usize;
        let mut shape = Shape { r: 0.0, edge: 0.0, cone: None, side: 0.0, bottom: 0.0 };
        let mut key = (0, 0);
        let (mut run, mut took) = (false, false);
        for step in planned.program.steps() {
            match step.op {
                Op::ToolChange(n) => tool = n as usize,
                Op::Begin { marker: Marker::Workingstep, code, .. } => {
                    let t = &planned.tools[tool.max(1) - 1];
                    let _ = t;
                    let (side, bottom) = leave.get(&code).copied().unwrap_or_default();
                    shape.side = side;
                    shape.bottom = bottom;
                    key = (side.to_bits(), bottom.to_bits());
                    lows.entry(key).or_insert_with(|| {
                        (0..self.z.len())
                            .map(|i| {
                                let (x, y) = self.at(i);
                                surface(x, y, tolerance - side).max(floor + bottom)
                            })
                            .collect()
                    });
                }
                Op::Begin { marker: Marker::Feature, .. } => {
                    let t = &planned.tools[tool - 1];
                    shape.r = t.diameter / 2.0;
                    shape.edge = t.edge_radius.min(shape.r);
                    shape.cone = t.tip_angle.filter(|_| t.kind.contains("DRILL") || t.kind.contains("SINK"));
                    used.push(shape);
                }
                op if op.moves() => {
                    let rapid = matches!(op, Op::Rapid);
                    if rapid {
                        if run {
                            v.runs += 1;
                            v.air += usize::from(!took);
                        }
                        (run, took) = (false, false);
                    }
                    let low = lows.get(&key);
                    let (a, b) = (step.start.xyz(), step.end.xyz());
                    // Straight up is how a tool leaves; where it was before the program nobody knows.
                    if rapid && a[0] == b[0] && a[1] == b[1] && b[2] >= a[2] {
                        continue;
                    }
                    for (a, b) in chop(&op, &step.start, &step.end, shape.r) {
                        if rapid {
                            self.rapid(a, b, shape, &mut v);
                        } else if let Some(low) = low {
                            run = true;
                            took |= self.cut(a, b, shape, low, &mut v);
                        }
                    }
                }
                _ => {}
            }
        }
        if cover {
            self.covered(surface, floor, tolerance, &used, &mut v);
        }
        v
    }

    fn rapid(&mut self, a: [f64; 3], b: [f64; 3], s: Shape, v: &mut Verdict) {
        let r = s.r - 0.02;
        for j in self.rows(a[1].min(b[1]) - r, a[1].max(b[1]) + r) {
            for k in self.columns(a[0].min(b[0]) - r, a[0].max(b[0]) + r) {
                let (x, y) = (self.x0 + k as f64 * self.h, self.y0 + j as f64 * self.h);
                let (d, z) = nearest(a, b, x, y);
                if d <= r && self.z[j * self.nx + k] > z + s.over(d) + SLACK {
                    if v.crashes == 0 {
                        v.crash_at = [x, y, z];
                    }
                    v.crashes += 1;
                }
            }
        }
    }

    fn cut(&mut self, a: [f64; 3], b: [f64; 3], s: Shape, low: &[f64], v: &mut Verdict) -> bool {
        let mut took = false;
        for j in self.rows(a[1].min(b[1]) - s.r, a[1].max(b[1]) + s.r) {
            for k in self.columns(a[0].min(b[0]) - s.r, a[0].max(b[0]) + s.r) {
                let (x, y) = (self.x0 + k as f64 * self.h, self.y0 + j as f64 * self.h);
                let (d, z) = nearest(a, b, x, y);
                if d > s.r {
                    continue;
                }
                let to = z + s.over(d);
                let i = j * self.nx + k;
                if to < self.z[i] - 1e-9 {
                    took = true;
                    self.z[i] = to;
                    if low[i] - to > v.gouge {
                        v.gouge = low[i] - to;
                        v.gouge_at = [x, y, to];
                    }
                }
            }
        }
        took
    }

    /// What some tool of the plan could have cut and none did.
    fn covered(&self, surface: &Surface<'_>, floor: f64, tolerance: f64, used: &[Shape], v: &mut Verdict) {
        let mut reach = vec![f64::INFINITY; self.z.len()];
        let mut seen: Vec<Shape> = Vec::new();
        for s in used {
            if seen.iter().any(|o| o.r == s.r && o.edge == s.edge && o.side <= s.side && o.bottom <= s.bottom && o.cone == s.cone) {
                continue;
            }
            seen.push(*s);
            let goal: Vec<f64> = (0..self.z.len())
                .map(|i| {
                    let (x, y) = self.at(i);
                    // A wall begins up to a cell further out than it is drawn.
                    surface(x, y, -s.side - tolerance - 1.1 * self.h).max(floor + s.bottom)
                })
                .collect();
            let disc = self.disc(s);
            let mut stands = self.over(&goal, &disc, |tip, over, goal| tip.max(goal - over), f64::NEG_INFINITY);
            if !self.floors.is_empty() && s.edge >= self.round {
                let mut floors: Vec<f64> = self.floors.iter().map(|f| f.max(floor + s.bottom)).collect();
                floors.sort_by(f64::total_cmp);
                for tip in &mut stands {
                    *tip = floors.iter().copied().find(|f| *tip <= f + 1e-6).unwrap_or(f64::INFINITY);
                }
            }
            let left = self.over(&stands, &disc, |left, over, tip| left.min(tip + over), f64::INFINITY);
            for (r, l) in reach.iter_mut().zip(left) {
                *r = r.min(l);
            }
        }
        for i in 0..self.z.len() {
            let (x, y) = self.at(i);
            if self.z[i] <= AIR {
                continue;
            }
            let goal = surface(x, y, -tolerance).max(floor);
            if reach[i] > goal + SLACK + tolerance {
                v.unreachable += self.h * self.h;
            }
            if self.z[i] > reach[i] + SLACK + tolerance {
                if v.missed == 0.0 {
                    v.missed_at = [x, y, self.z[i] - reach[i]];
                }
                v.missed += self.h * self.h;
            }
        }
    }

    /// Cells under a tool, with the height of its surface over its tip.
    fn disc(&self, s: &Shape) -> Vec<(i64, i64, f64)> {
        let n = (s.r / self.h) as i64;
        let mut out = Vec::new();
        for j in -n..=n {
            for k in -n..=n {
                let d = ((j * j + k * k) as f64).sqrt() * self.h;
                if d <= s.r {
                    out.push((j, k, s.over(d)));
                }
            }
        }
        out
    }

    fn over(&self, field: &[f64], disc: &[(i64, i64, f64)], f: impl Fn(f64, f64, f64) -> f64, start: f64) -> Vec<f64> {
        let (nx, ny) = (self.nx as i64, self.ny as i64);
        let mut out = vec![start; field.len()];
        for j in 0..ny {
            for k in 0..nx {
                let mut best = start;
                for &(dj, dk, over) in disc {
                    let (y, x) = (j + dj, k + dk);
                    if x >= 0 && y >= 0 && x < nx && y < ny {
                        best = f(best, over, field[(y * nx + x) as usize]);
                    }
                }
                out[(j * nx + k) as usize] = best;
            }
        }
        out
    }
}

fn range(low: f64, high: f64, n: usize) -> std::ops::Range<usize> {
    if high < 0.0 || low > n as f64 {
        return 0..0;
    }
    low.max(0.0) as usize..((high + 1.0) as usize + 1).min(n)
}

/// Distance from a piece of the tool's way, and how high its tip is there.
fn nearest(a: [f64; 3], b: [f64; 3], x: f64, y: f64) -> (f64, f64) {
    let (ux, uy) = (b[0] - a[0], b[1] - a[1]);
    let n = ux * ux + uy * uy;
    if n < 1e-18 {
        return ((x - a[0]).hypot(y - a[1]), a[2].min(b[2]));
    }
    let t = (((x - a[0]) * ux + (y - a[1]) * uy) / n).clamp(0.0, 1.0);
    ((x - a[0] - t * ux).hypot(y - a[1] - t * uy), a[2] + (b[2] - a[2]) * t)
}

fn chop(op: &Op<'_>, start: &gr_ir::Pose, end: &gr_ir::Pose, r: f64) -> Vec<([f64; 3], [f64; 3])> {
    let (a, b) = (start.xyz(), end.xyz());
    let dz = (a[2] - b[2]).abs();
    let flat = (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9;
    if let Op::Arc(arc) = op {
        let shape = ArcShape::new(arc, start, end);
        let n = shape.pieces(0.001).max((dz / 0.05) as usize).clamp(1, 100_000);
        let at = |i: usize| if i == n { b } else { shape.point(i as f64 / n as f64) };
        return (0..n).map(|i| (at(i), at(i + 1))).collect();
    }
    let n = if flat { 1 } else { ((dz / 0.05).ceil()).max((a[0] - b[0]).hypot(a[1] - b[1]) / (2.0 * r + 1.0)).clamp(1.0, 100_000.0) as usize };
    let at = |i: usize| std::array::from_fn(|c| a[c] + (b[c] - a[c]) * i as f64 / n as f64);
    (0..n).map(|i| (at(i), at(i + 1))).collect()
}

/// Signed distance to a polygon, positive inside.
pub fn inside(poly: &Poly, x: f64, y: f64) -> f64 {
    let mut d = f64::INFINITY;
    let mut odd = false;
    for i in 0..poly.len() {
        let (a, b) = (poly[i], poly[(i + 1) % poly.len()]);
        d = d.min(nearest([a.0, a.1, 0.0], [b.0, b.1, 0.0], x, y).0);
        if (a.1 > y) != (b.1 > y) && x < a.0 + (b.0 - a.0) * (y - a.1) / (b.1 - a.1) {
            odd = !odd;
        }
    }
    if odd { d } else { -d }
}

/// A circle as a polygon of many sides.
pub fn circle(x: f64, y: f64, r: f64) -> Poly {
    (0..360).map(|i| f64::from(i).to_radians()).map(|t| (x + r * t.cos(), y + r * t.sin())).collect()
}

/// An axis-parallel rectangle about a centre, corners rounded.
pub fn rectangle(x: f64, y: f64, l: f64, w: f64, corner: f64) -> Poly {
    let mut out = Vec::new();
    for (q, sx, sy) in [(0, 1.0, 1.0), (1, -1.0, 1.0), (2, -1.0, -1.0), (3, 1.0, -1.0)] {
        let c = (x + sx * (l / 2.0 - corner), y + sy * (w / 2.0 - corner));
        if corner == 0.0 {
            out.push(c);
            continue;
        }
        for k in 0..=45 {
            let t = f64::from(q * 90 + 2 * k).to_radians();
            out.push((c.0 + corner * t.cos(), c.1 + corner * t.sin()));
        }
    }
    out
}
