//! Facing: parallel lines over a plane that begin and end outside it.

use crate::clear::chords;
use crate::geom::{Bounds, Seg};
use crate::offset::grow;
use crate::{Error, Link, P2, Pass, Path2, Region, Role, positive};

/// What [`face`] is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// Tool radius, mm.
    pub radius: f64,
    /// Distance between lines, mm, at most the diameter; made smaller so that the lines divide the width evenly.
    pub stepover: f64,
    /// Direction of the (first) line, rad from +x.
    pub angle: f64,
    /// To and fro (true) or all in one direction.
    pub bidirectional: bool,
    /// The next line is on the left.
    pub step_left: bool,
    /// How far the tool's circle leaves the face at line ends, mm. Negative: the line ends that much before.
    pub overrun: f64,
}

impl Face {
    /// To and fro along x, tool wholly off the face at both ends.
    pub fn new(radius: f64, stepover: f64) -> Self {
        Self { radius, stepover, angle: 0.0, bidirectional: true, step_left: true, overrun: 1.0 }
    }
}

/// Lines over a closed outline, kept off these bosses (they may reach over the outline).
///
/// The first line takes one step of the face's edge and every further line one step more; a face no wider than the
/// tool is taken by one line over its middle.
pub fn face(outline: &Path2, bosses: &[Path2], what: &Face) -> Result<Vec<Pass>, Error> {
    let r = positive(what.radius, "tool radius")?;
    let step = positive(what.stepover, "stepover")?;
    if step > 2.0 * r + 1e-9 {
        return Err(Error::Parameter("stepover"));
    }
    if !what.angle.is_finite() || !what.overrun.is_finite() {
        return Err(Error::NotFinite);
    }
    let whole = Region::new(outline.rotated(-what.angle), Vec::new())?;
    let solid: Vec<Path2> = bosses.iter().map(|b| b.rotated(-what.angle)).collect();
    let keep_off = if solid.is_empty() { Vec::new() } else { grow(&solid, r)? };
    let b = whole.bounds();
    let height = b.size().y;
    if height / step > 20_000.0 {
        return Err(Error::TooManyPasses);
    }
    let n = (height / step - 1e-9).ceil().max(1.0);
    let pitch = height / n;
    let mut passes: Vec<Pass> = Vec::new();
    let mut forward = true;
    for i in 0..n as usize {
        let taken = pitch * (i as f64 + 1.0);
        let y = match (n > 1.0, what.step_left) {
            (false, _) => (b.min.y + b.max.y) * 0.5,
            (true, true) => b.min.y + taken - r,
            (true, false) => b.max.y - taken + r,
        };
        let Some((x0, x1)) = reach(whole.outer(), y, r) else { continue };
        let beyond = r + what.overrun;
        let mut pieces = off(&keep_off, y, x0 - beyond, x1 + beyond);
        if !forward {
            pieces.reverse();
        }
        for (x0, x1) in pieces {
            let (a, z) = (P2::new(x0, y), P2::new(x1, y));
            let ends = if forward { [a, z] } else { [z, a] };
            let Ok(path) = Path2::polyline(&ends, false) else { continue };
            let link = way(passes.last(), path.start(), what.bidirectional && bosses.is_empty(), 2.5 * step);
            passes.push(Pass { path, role: Role::Clear, link });
        }
        forward = forward != what.bidirectional;
    }
    // Along the bosses once, so that nothing stays between line ends.
    for part in &keep_off {
        for l in part.loops().filter(|l| l.dist_to(whole.outer()) < r || whole.contains(l.start())) {
            passes.push(Pass { path: l.reversed(), role: Role::Wall, link: Link::Retract });
        }
    }
    if passes.is_empty() {
        return Err(Error::Empty);
    }
    Ok(passes
        .into_iter()
        .map(|p| {
            let link = match p.link {
                Link::Stay(way) => Link::Stay(way.rotated(what.angle)),
                Link::Retract => Link::Retract,
            };
            Pass { path: p.path.rotated(what.angle), role: p.role, link }
        })
        .collect())
}

fn way(last: Option<&Pass>, start: P2, stay: bool, short: f64) -> Link {
    let from = last.map(|l| l.path.end()).filter(|p| stay && p.dist(start) <= short);
    from.and_then(|p| Path2::polyline(&[p, start], false).ok()).map_or(Link::Retract, Link::Stay)
}

/// Leftmost and rightmost point of the outline within reach of the line at height `y`.
fn reach(outline: &Path2, y: f64, r: f64) -> Option<(f64, f64)> {
    let (lo, hi) = (y - r, y + r);
    let mut range: Option<(f64, f64)> = None;
    let mut add = |x: f64| range = Some(range.map_or((x, x), |(a, b)| (a.min(x), b.max(x))));
    for s in outline.segs() {
        let b: Bounds = s.bounds();
        if b.min.y > hi || b.max.y < lo {
            continue;
        }
        if b.min.y >= lo && b.max.y <= hi {
            add(b.min.x);
            add(b.max.x);
            continue;
        }
        // Clip by sampling the ends of the strip exactly and arcs by their box.
        match *s {
            Seg::Line { a, b } => {
                for t in [0.0, 1.0, (lo - a.y) / (b.y - a.y), (hi - a.y) / (b.y - a.y)] {
                    let y = a.y + (b.y - a.y) * t;
                    if (0.0..=1.0).contains(&t) && y >= lo - 1e-9 && y <= hi + 1e-9 {
                        add(a.x + (b.x - a.x) * t);
                    }
                }
            }
            Seg::Arc { .. } => {
                add(b.min.x);
                add(b.max.x);
            }
        }
    }
    range
}

/// The pieces of a line that are outside these areas.
fn off(areas: &[Region], y: f64, x0: f64, x1: f64) -> Vec<(f64, f64)> {
    let mut taken: Vec<(f64, f64)> = areas
        .iter()
        .filter(|a| a.bounds().min.y < y && y < a.bounds().max.y)
        .flat_map(|a| chords(a, y, &a.bounds()))
        .map(|(a, b)| (a.x, b.x))
        .collect();
    taken.sort_by(|l, r| l.0.total_cmp(&r.0));
    let mut out = Vec::new();
    let mut from = x0;
    for (a, b) in taken {
        if a > from {
            out.push((from, a.min(x1)));
        }
        from = from.max(b);
    }
    out.push((from, x1));
    out.retain(|(a, b)| b - a > 1e-3);
    out
}
