//! Areas emptied level by level: pockets, steps, milled holes, planes, and what is round about a boss or a profile.
//! Walls that lean and floors with a radius have another outline on every level, so that no level reaches into the
//! wall below it; islands begin at their own tops.

use gr_toolpath as tp;
use gr_toolpath::{P2, Path2, Region};

use super::{Done, Job, Moves, RUN_OUT, path, words};
use crate::emit::Emit;
use crate::process::*;

/// More levels for one wall than this are a mistake.
const MOST_WALLS: usize = 5_000;
/// Less radius than this, mm, is none.
const HAIR: f64 = 1e-5;

/// A floor that is not flat: on every level it leaves a disk, which shrinks on the way down.
#[derive(Clone, Copy)]
enum Floor {
    Flat,
    /// Inside of a ball: its centre, how far that lies below the feature's top, its radius.
    Ball(P2, f64, f64),
    /// From a depth on, beginning with a radius: half its angle, rad.
    Cone(f64, f64, f64),
}

impl Floor {
    /// Radius of what is left for a tool with this edge whose tip is at a depth: its widest part may go so far from
    /// the middle. None: nothing; infinite: the floor is further down.
    fn disk(self, y: f64, edge: f64) -> Option<f64> {
        match self {
            Floor::Flat => Some(f64::INFINITY),
            Floor::Ball(_, centre, radius) => {
                let (r, h) = (radius - edge, y - edge - centre);
                let below = if h <= 0.0 { r } else { libm::sqrt((r * r - h * h).max(0.0)) };
                (r > 0.0 && h < r).then_some(below + edge)
            }
            Floor::Cone(from, radius, half) => {
                let t = libm::tan(half);
                let left = radius - (y - from) * t + edge * (1.0 + t - 1.0 / libm::cos(half));
                (left > 0.0).then(|| if y < from { f64::INFINITY } else { left.min(radius) })
            }
        }
    }
    /// How high material stays at a wall that is upright and so far from the floor's middle.
    fn corner(self, wall: f64, edge: f64) -> f64 {
        let side = |a: f64, b: f64| libm::sqrt((a * a - b * b).max(0.0));
        match self {
            Floor::Flat => edge,
            // It ends below the top of the feature, inside the wall.
            Floor::Ball(_, centre, ball) if wall >= ball || centre + side(ball, wall) <= 0.0 => 0.0,
            Floor::Ball(_, _, ball) => side(ball, wall) - side(ball - edge, wall - edge),
            Floor::Cone(_, _, half) => edge * libm::tan(half / 2.0),
        }
    }
    fn middle(self) -> P2 {
        match self {
            Floor::Ball(c, ..) => c,
            _ => P2::default(),
        }
    }
    /// How deep the tip of a tool gets.
    fn deepest(self, radius: f64, edge: f64) -> Option<f64> {
        match self {
            Floor::Flat => None,
            Floor::Ball(_, centre, ball) => {
                let (r, flat) = (ball - edge, radius - edge);
                (r > flat).then(|| libm::sqrt(r * r - flat * flat) + edge + centre)
            }
            Floor::Cone(from, wide, half) => {
                let t = libm::tan(half);
                (wide >= radius).then(|| from + ((wide - radius) / t + edge * (1.0 + 1.0 / t - 1.0 / libm::sin(half))).max(0.0))
            }
        }
    }
}

/// What is to be emptied.
struct Area {
    /// At the top.
    outline: Region,
    islands: Vec<Island>,
    /// Draft of the outer wall, rad.
    slope: f64,
    /// Radius between wall and floor that the tool does not make itself.
    fillet: f64,
    /// Down to where walls lean and fillets end.
    depth: f64,
    /// What a rounded edge gains on a wall that leans.
    gain: f64,
    /// Levels without islands begin inside the outline.
    open: bool,
    /// What of the outline only lets the tool pass open sides.
    air: Vec<Region>,
    floor: Floor,
    /// The edge of the tool that goes down to the floor, and what it may leave between two rings on it.
    edge: f64,
    ring: f64,
}

struct Island {
    path: Path2,
    top: f64,
    slope: f64,
    gain: f64,
}

impl Area {
    /// How far the outer wall at a depth stands in from the outline at the top.
    fn lean(&self, y: f64) -> f64 {
        let over = y - (self.depth - self.fillet);
        let round = if self.fillet > 0.0 && over > 0.0 { self.fillet - libm::sqrt((self.fillet * self.fillet - over * over).max(0.0)) } else { 0.0 };
        if self.slope == 0.0 { round } else { y.min(self.depth) * libm::tan(self.slope) - self.gain + round }
    }
    fn steady(&self) -> bool {
        self.slope == 0.0 && self.fillet == 0.0 && matches!(self.floor, Floor::Flat) && self.islands.iter().all(|i| i.slope == 0.0)
    }
    /// What is free at a depth.
    fn at(&self, y: f64) -> Done<Vec<Region>> {
        let by = self.lean(y);
        let whole = if by > 1e-9 {
            tp::erode(&self.outline, by).map_err(words)?
        } else if by < -1e-9 {
            tp::grow(std::slice::from_ref(self.outline.outer()), -by).map_err(words)?
        } else {
            vec![self.outline.clone()]
        };
        let whole = self.on_floor(whole, y)?;
        let mut solid = Vec::new();
        for i in self.islands.iter().filter(|i| i.top < y - 1e-9) {
            let by = (y - i.top) * libm::tan(i.slope) - i.gain;
            if by > 1e-9 {
                let grown = tp::grow(std::slice::from_ref(&i.path), by).map_err(words)?;
                solid.extend(grown.iter().map(|r| r.outer().clone()));
            } else {
                solid.push(i.path.clone());
            }
        }
        whole.into_iter().map(|r| Region::new(r.outer().clone(), solid.clone()).map_err(words)).collect()
    }
    /// What the floor leaves of an outline at a depth.
    fn on_floor(&self, whole: Vec<Region>, y: f64) -> Done<Vec<Region>> {
        let Some(disk) = self.floor.disk(y, self.edge) else { return Ok(Vec::new()) };
        if disk >= self.furthest() - 1e-6 {
            return Ok(whole);
        }
        let disk = Path2::circle(self.floor.middle(), disk).map_err(words)?;
        let mut out = Vec::new();
        for r in &whole {
            out.extend(tp::common(r, &disk).map_err(words)?);
        }
        Ok(out)
    }
    /// Of the outline, from the middle of the floor.
    fn furthest(&self) -> f64 {
        let (b, m) = (self.outline.bounds(), self.floor.middle());
        let round = self.outline.outer().segs().iter().all(|s| s.radius().is_some_and(|r| (r - (s.at(0.5) - m).norm()).abs() < 1e-6));
        if round {
            return b.size().x / 2.0;
        }
        [b.min, b.max, P2::new(b.min.x, b.max.y), P2::new(b.max.x, b.min.y)].into_iter().map(|c| c.dist(m)).fold(0.0, f64::max)
    }
    /// Depths between which the outline stays the same: tops of islands.
    fn breaks(&self, bottom: f64) -> Vec<f64> {
        let mut out: Vec<f64> = self.islands.iter().map(|i| i.top).filter(|t| *t > 1e-6 && *t < bottom - 1e-6).collect();
        out.push(bottom);
        out.sort_by(f64::total_cmp);
        out.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
        out
    }
    /// Depths for the wall alone between two levels: no stair further from the wall than the tolerance.
    fn walls(&self, above: f64, y: f64, tolerance: f64) -> Done<Vec<f64>> {
        let slope = self.islands.iter().map(|i| i.slope).fold(0.0, f64::max);
        let far = self.furthest();
        let disk = |y: f64| self.floor.disk(y, self.edge).unwrap_or(0.0).min(far);
        let aside = |a: f64, b: f64| (self.lean(b) - self.lean(a)).abs().max((b - a) * libm::tan(slope)).max(disk(a) - disk(b));
        let flat = matches!(self.floor, Floor::Flat);
        // Where the floor is nearly flat stairs are low, and rings are as near to each other as the tool needs.
        let fine = |a: f64, b: f64| aside(a, b) <= tolerance || b - a <= tolerance && (flat || aside(a, b) <= self.ring);
        let mut out = Vec::new();
        let mut at = above;
        while !fine(at, y) {
            let (mut low, mut high) = (at, y);
            for _ in 0..40 {
                let mid = (low + high) / 2.0;
                if fine(at, mid) { low = mid } else { high = mid }
            }
            at = if flat { low.max(at + tolerance) } else { low.max(at + tolerance * 1e-3) };
            if at < y - 1e-6 {
                out.push(at);
            }
            if out.len() > MOST_WALLS {
                return Err("its walls lean so much that they need too many levels".into());
            }
        }
        Ok(out)
    }
}

/// How deep the tip of a tool gets on a floor that is not flat, and how deep that floor is; in the frame of the feature.
pub(super) fn floor_depth(feature: &Feature, radius: f64, edge: f64, leave: f64) -> Option<(Option<f64>, f64)> {
    let (floor, depth) = floor(feature, leave)?;
    Some((floor.deepest(radius, edge), depth))
}

/// The floor where it is not flat, less by what is to stay on it, and its own depth.
fn floor(feature: &Feature, leave: f64) -> Option<(Floor, f64)> {
    match &feature.shape {
        Shape::Pocket { bottom: PocketBottom::Ball(c, r), .. } | Shape::OpenPocket { bottom: PocketBottom::Ball(c, r), .. } => {
            Some((Floor::Ball(P2::new(c[0], c[1]), -c[2], r - leave), r - c[2]))
        }
        Shape::Hole { diameter, final_diameter, bottom: HoleBottom::Conical(angle, _) } => {
            let (half, wide) = (half_angle(*angle), final_diameter.unwrap_or(*diameter) / 2.0);
            Some((Floor::Cone(feature.depth - leave, wide, half), feature.depth + wide / libm::tan(half)))
        }
        // As wide as the hole it is the rounding of its foot.
        Shape::Hole { diameter, final_diameter, bottom: HoleBottom::Spherical(r) } if *r > final_diameter.unwrap_or(*diameter) / 2.0 + 1e-6 => {
            Some((Floor::Ball(P2::default(), feature.depth - r, r - leave), feature.depth))
        }
        _ => None,
    }
}

/// The angle of a cone against its axis: the standard says only that it is the angle of the tip. From a right angle on
/// it can only be the whole one.
pub(crate) fn half_angle(angle: f64) -> f64 {
    if angle < std::f64::consts::FRAC_PI_2 - 1e-9 { angle } else { angle / 2.0 }
}

/// An outline whose inner corners have at least this radius.
fn rounded(sharp: Path2, radius: f64) -> Done<Path2> {
    let region = Region::new(sharp.clone(), Vec::new()).map_err(words)?;
    let most = corners(region.outer(), radius);
    // As wide as twice the radius is room enough.
    for r in [radius, radius - HAIR] {
        if !(r > 0.0) {
            continue;
        }
        let inner = tp::erode(&region, r).map_err(words)?;
        let [inner] = inner.as_slice() else { continue };
        let grown = tp::grow(std::slice::from_ref(inner.outer()), r).map_err(words)?;
        let [grown] = grown.as_slice() else { continue };
        let lost = region.area() - grown.area();
        // What is round enough stays as it was written.
        if lost <= 1e-6 * radius {
            return Ok(sharp);
        }
        if lost <= most {
            return Ok(grown.outer().clone());
        }
    }
    Err(no_room(radius))
}

/// The same of an open line, for corners on its left, or with a negative radius on its right.
fn rounded_open(sharp: &Path2, radius: f64) -> Done<Path2> {
    let around = |line: &Path2| {
        let back = tp::Seg::Line { a: line.end(), b: line.start() };
        tp::Path2::from_segs(line.segs().iter().copied().chain([back]), true).map(|p| p.area().abs())
    };
    let inner = tp::offset_open(sharp, radius).map_err(words)?;
    let line = tp::offset_open(&inner, -radius).map_err(words)?;
    let moved = line.start().dist(sharp.start()).max(line.end().dist(sharp.end()));
    let left = if radius > 0.0 { sharp.clone() } else { sharp.mirrored() };
    let lost = around(sharp).map_err(words)? - around(&line).map_err(words)?;
    if moved > 1e-6 || lost > corners(&left, radius.abs()) {
        return Err(no_room(radius.abs()));
    }
    Ok(if lost <= 1e-6 * radius.abs() { sharp.clone() } else { line })
}

fn quad(corners: [P2; 4]) -> Done<Region> {
    Region::new(Path2::polyline(&corners, true).map_err(words)?, Vec::new()).map_err(words)
}

fn no_room(radius: f64) -> String {
    format!("its orthogonal_radius of {radius} mm, for which its outline has no room")
}

/// The most that rounding takes off corners to the left of a line: more means that a neck has gone with them.
fn corners(line: &Path2, radius: f64) -> f64 {
    // Curves drawn as chords turn by little, and each such corner shares its room with the next.
    let off = |turn: f64, r2: f64| r2 * (libm::tan((turn / 2.0).min(1.5)) - turn / 2.0) * if turn < 0.4 { 4.0 } else { 1.05 };
    let segs = line.segs();
    let next = segs.iter().skip(1).chain(segs.first().filter(|_| line.is_closed()));
    let turns = segs.iter().zip(next).map(|(a, b)| {
        let (a, b) = (a.tangent(1.0), b.tangent(0.0));
        off(libm::atan2(a.cross(b), a.dot(b)).max(0.0), radius * radius)
    });
    let arcs = segs.iter().filter_map(|s| {
        let r = s.radius().filter(|r| *r < radius && s.bulge() > 0.0)?;
        Some(off(4.0 * libm::atan(s.bulge()), radius * radius - r * r))
    });
    turns.sum::<f64>() + arcs.sum::<f64>() + 1e-3 * line.length()
}

impl Job<'_> {
    /// What a rounded edge gains against a flat one on a wall of this slope.
    fn gain(&self, slope: f64) -> f64 {
        self.edge * (1.0 + libm::tan(slope) - 1.0 / libm::cos(slope))
    }
    /// What is left of a radius at the foot of the wall for the centre of the tool's rounding to follow.
    fn fillet(&self, radius: f64) -> f64 {
        (radius - self.edge).max(0.0)
    }
    fn slope(&self, slope: f64) -> Done<f64> {
        let taper = self.step.operation.tool.taper;
        if !(0.0..1.5).contains(&slope) {
            return Err(format!("walls that lean by {:.4} degrees", slope.to_degrees()));
        }
        if taper > slope + 1e-6 {
            return Err(format!("the tool tapers by {:.4} degrees, the wall by {:.4}", taper.to_degrees(), slope.to_degrees()));
        }
        // A tool of the wall's own taper makes it in one.
        Ok(if (taper - slope).abs() <= 1e-6 && taper > 0.0 { 0.0 } else { slope })
    }
    fn islands(&self, bosses: &[Boss]) -> Done<Vec<Island>> {
        let inside = bosses.iter().filter(|b| b.top < self.depth - 1e-9);
        inside
            .map(|b| {
                let slope = self.slope(b.slope)?;
                let gain = if slope == 0.0 { 0.0 } else { self.gain(slope) };
                Ok(Island { path: path(&b.boundary)?, top: b.top.max(0.0), slope, gain })
            })
            .collect()
    }

    fn outline(&self) -> Done<Area> {
        let plain = |outline: Path2| -> Done<Area> {
            let outline = Region::new(outline, Vec::new()).map_err(words)?;
            Ok(self.plain(outline, Vec::new(), false))
        };
        let bottom = |b: &PocketBottom, planar: Option<f64>| match b {
            PocketBottom::Other(what) => Err(format!("a pocket with a {what} bottom; it is a surface, which needs explicit tool paths")),
            PocketBottom::Ball(..) if planar.is_some_and(|r| r > 0.0) => Err("a rounded floor with a radius at its edge".into()),
            _ => Ok(()),
        };
        let mut area = match &self.feature.shape {
            Shape::Pocket { boundary, bosses, slope, bottom: floor, planar_radius, orthogonal_radius } => {
                bottom(floor, *planar_radius)?;
                let mut a = plain(self.pocket_outline(boundary, *orthogonal_radius)?)?;
                a.islands = self.islands(bosses)?;
                a.slope = self.slope(*slope)?;
                a.fillet = self.fillet(planar_radius.unwrap_or(0.0));
                a
            }
            Shape::OpenPocket { boundary, bosses, slope, bottom: floor, planar_radius, orthogonal_radius } => {
                bottom(floor, *planar_radius)?;
                let lean = self.slope(*slope)?;
                let islands = self.islands(bosses)?;
                let fillet = self.fillet(planar_radius.unwrap_or(0.0));
                let (outline, air) = self.opened(boundary, *orthogonal_radius, self.depth * libm::tan(lean) + fillet, &islands)?;
                let mut a = plain(outline)?;
                (a.islands, a.air) = (islands, vec![air]);
                (a.slope, a.open, a.fillet) = (lean, true, fillet);
                a
            }
            Shape::Step { start, length, direction, wall, radius, bosses } => {
                let lean = self.slope(*wall)?;
                let islands = self.islands(bosses)?;
                let fillet = self.fillet(*radius);
                let (outline, air) = self.step_outline(*start, *length, *direction, self.depth * libm::tan(lean) + fillet, &islands)?;
                let mut a = plain(outline)?;
                (a.islands, a.air) = (islands, air);
                (a.slope, a.open, a.fillet) = (lean, true, fillet);
                a
            }
            Shape::Hole { diameter, final_diameter, bottom } => {
                let mut a = plain(Path2::circle(P2::default(), diameter / 2.0).map_err(words)?)?;
                a.slope = self.slope(final_diameter.map_or(0.0, |f| libm::atan((diameter - f) / 2.0 / self.feature.depth)))?;
                a.fillet = match bottom {
                    HoleBottom::Radiused(r) => self.fillet(*r),
                    HoleBottom::Spherical(r) if floor(self.feature, 0.0).is_none() => self.fillet(*r),
                    HoleBottom::Conical(angle, tip) => {
                        if half_angle(*angle) < 0.05 {
                            return Err(format!("a cone of {:.4} degrees", angle.to_degrees()));
                        }
                        if tip.is_some_and(|r| r > self.edge + 1e-6) {
                            return Err("a cone with a tip radius larger than that of its tool".into());
                        }
                        0.0
                    }
                    _ => 0.0,
                };
                a
            }
            _ => return Err(String::new()),
        };
        if let Some((floor, _)) = floor(self.feature, self.m.allowance_bottom) {
            area.floor = floor;
        }
        if area.slope > 0.0 {
            area.gain = self.gain(area.slope);
        }
        if area.fillet > area.depth {
            return Err(format!("a radius of {} mm at its floor, deeper than the feature", area.fillet));
        }
        Ok(area)
    }

    fn plain(&self, outline: Region, islands: Vec<Island>, open: bool) -> Area {
        // Rings of a round edge as near as their scallops allow, of a flat one as its passes.
        let scallop = 2.0 * libm::sqrt((self.tolerance * (2.0 * self.edge - self.tolerance)).max(0.0));
        let ring = (scallop + 2.0 * (self.radius - self.edge)).min(self.coarse);
        Area { outline, islands, slope: 0.0, fillet: 0.0, depth: self.depth, gain: 0.0, open, air: Vec::new(), floor: Floor::Flat, edge: self.edge, ring }
    }

    fn pocket_outline(&self, boundary: &Closed, corner: Option<f64>) -> Done<Path2> {
        match (corner, boundary) {
            (Some(r), Closed::Rectangle { frame, length, width }) if r > 0.0 && r <= length.min(*width) / 2.0 => {
                let turn = libm::atan2(frame.x[1], frame.x[0]);
                let outline = tp::profile::rectangle(*length, *width, r).map_err(words)?;
                Ok(outline.rotated(turn).moved(P2::new(frame.origin[0], frame.origin[1])))
            }
            _ => {
                let sharp = path(&boundary.contour().ok_or("its profile has no size")?)?;
                match corner.filter(|r| *r > 0.0 && !matches!(boundary, Closed::Circle { .. })) {
                    Some(r) => rounded(sharp, r),
                    None => Ok(sharp),
                }
            }
        }
    }

    /// How far outlines go on past an open side, so that the tool's centre passes it, and the whole tool where an
    /// island stands so near to it that the tool does not fit between. `at` lies on that side, `out` is the way out.
    fn past(&self, at: P2, out: P2, lean: f64, islands: &[Island]) -> f64 {
        let reach = self.radius + self.m.allowance_side;
        let near = islands.iter().any(|i| {
            let foot = i.path.sampled(self.radius / 4.0).into_iter().map(|p| (p - at).dot(out)).fold(f64::NEG_INFINITY, f64::max);
            foot + self.depth * libm::tan(i.slope) > -2.0 * reach
        });
        lean + RUN_OUT + if near { 2.0 * reach } else { reach }
    }

    /// An open boundary closed over its mouth, out in the air far enough for the tool to pass the mouth, and that air.
    fn opened(&self, boundary: &Contour, corner: Option<f64>, lean: f64, islands: &[Island]) -> Done<(Path2, Region)> {
        let mut line = path(boundary)?;
        if line.is_closed() {
            return Err("its open boundary is closed".into());
        }
        let (a, b) = (line.start(), line.end());
        let mouth = b - a;
        if mouth.norm() < 1e-6 {
            return Err("its open boundary is closed".into());
        }
        // The pocket is on one side of the chord, the air on the other.
        let area: f64 = tp::Path2::from_segs(line.segs().iter().copied().chain([tp::Seg::Line { a: b, b: a }]), true).map_err(words)?.area();
        let out = if area > 0.0 { mouth.left() * (1.0 / mouth.norm()) } else { mouth.left() * (-1.0 / mouth.norm()) };
        if let Some(r) = corner.filter(|r| *r > 0.0) {
            line = rounded_open(&line, if area > 0.0 { r } else { -r })?;
        }
        // Walls that go apart are prolonged, so that nothing is left beside the mouth.
        let u = mouth.unit();
        let slant = |t: P2, sideways: P2| Some((t.dot(sideways), t.dot(out))).filter(|(aside, along)| *along > 0.2 && *aside > 0.0);
        let (at_a, at_b) = (slant(-line.start_tangent(), -u), slant(line.end_tangent(), u));
        // The sharp corners that they end in keep the tool off: further out the more they lean.
        let steepest = [at_a, at_b].into_iter().flatten().fold(0.0, |most: f64, (aside, _)| most.max(aside));
        let reach = self.radius + self.m.allowance_side;
        let far = self.past(a, out, lean, islands).max(reach * (1.01 + steepest) + lean);
        let prolonged = |slant: Option<(f64, f64)>, sideways: P2| slant.map_or(out, |(aside, along)| out + sideways * (aside / along));
        let (p, q) = (a + prolonged(at_a, -u) * far, b + prolonged(at_b, u) * far);
        let rest = [tp::Seg::Line { a: b, b: q }, tp::Seg::Line { a: q, b: p }, tp::Seg::Line { a: p, b: a }];
        let outline = tp::Path2::from_segs(line.segs().iter().copied().chain(rest), true).map_err(words)?;
        Ok((outline, quad([a, b, q * 2.0 - b, p * 2.0 - a])?))
    }

    /// From the edge to the nearer side of the raw part: how wide a step is does not stand in the feature.
    fn step_outline(&self, start: [f64; 2], length: f64, direction: [f64; 2], lean: f64, islands: &[Island]) -> Done<(Path2, Vec<Region>)> {
        let (u, a) = (P2::new(direction[0], direction[1]), P2::new(start[0], start[1]));
        let (side, width) = self.open_side(start, direction)?;
        let (b, edge) = (a + u * length, side * width);
        // The tool's centre goes as far as the side of the raw part.
        let (before, after) = (u * self.past(a, u * -1.0, lean, islands), u * self.past(b, u, lean, islands));
        let beside = side * self.past(a + edge, side, lean, islands);
        let (p, q) = (a - before, b + after);
        let far = edge + beside;
        let outline = Path2::polyline(&[p, q, q + far, p + far], true).map_err(words)?;
        let (wide, long) = (side * (2.0 * width + far.norm()), u * (before.norm() + after.norm()));
        let air = [[a, a + wide, a + wide - long, a - long], [b, b + long, b + wide + long, b + wide], [p + edge, q + edge, q + wide, p + wide]];
        Ok((outline, air.into_iter().map(quad).collect::<Done<_>>()?))
    }

    /// The side of a step's edge on which it is cut, and how far it is from there to the side of the raw part.
    fn open_side(&self, start: [f64; 2], direction: [f64; 2]) -> Done<(P2, f64)> {
        let [low, high] = self.step.stock.ok_or("its width follows from a raw block, and the workpiece has none")?;
        let (v, a) = (P2::new(-direction[1], direction[0]), P2::new(start[0], start[1]));
        let (mut left, mut right) = (0.0f64, 0.0f64);
        for corner in 0..8 {
            let p = std::array::from_fn(|i| if corner >> i & 1 == 1 { high[i] } else { low[i] });
            let q = self.feature.frame.inverse_point(p);
            let s = (P2::new(q[0], q[1]) - a).dot(v);
            (left, right) = (left.max(s), right.max(-s));
        }
        Ok(match (left > 1e-6, right > 1e-6) {
            (true, true) if left <= right => (v, left),
            (true, false) => (v, left),
            (_, true) => (v * -1.0, right),
            (false, false) => return Err("its edge does not lie on the raw part".into()),
        })
    }

    /// Where an open pocket or a step ends in the open, and which way is out.
    fn mouths(&self) -> Done<Vec<(P2, P2)>> {
        Ok(match &self.feature.shape {
            Shape::OpenPocket { boundary, .. } => {
                let wall = path(boundary)?;
                let (a, b) = (wall.start(), wall.end());
                let middle = (a + b) * 0.5;
                let across = (b - a).left();
                let length = across.dot(across).sqrt();
                if !(length > 1e-9) {
                    return Ok(Vec::new());
                }
                let bounds = wall.bounds();
                let inside = (bounds.min + bounds.max) * 0.5;
                let out = across * if across.dot(middle - inside) >= 0.0 { 1.0 / length } else { -1.0 / length };
                vec![(middle, out)]
            }
            Shape::Step { start, length, direction, .. } => {
                let (a, u) = (P2::new(start[0], start[1]), P2::new(direction[0], direction[1]));
                let side = self.open_side(*start, *direction)?.0 * (self.radius * 0.5);
                vec![(a + side, u * -1.0), (a + u * *length + side, u)]
            }
            _ => Vec::new(),
        })
    }

    pub(super) fn area(&self, e: &mut Emit<'_>) -> Done<Moves> {
        let area = self.outline()?;
        self.open_ends(e, &self.mouths()?);
        if !self.m.bottom && matches!(self.feature.shape, Shape::Pocket { .. } | Shape::OpenPocket { .. }) && !self.before_cut(e) {
            self.leaves(e, "its middle, which no workingstep before has cleared: it only goes round the wall");
        }
        if let (Shape::Pocket { .. }, Ok((low, high))) = (&self.feature.shape, self.stock()) {
            let f = area.outline.bounds();
            let beyond = [low.x - f.min.x, low.y - f.min.y, f.max.x - high.x, f.max.y - high.y].into_iter().fold(0.0, f64::max);
            if beyond > self.tolerance.max(1e-3) {
                let why = format!("it reaches {beyond:.4} mm beyond the raw part");
                e.say(gr_text::code::PLAN_AIR, self.step.origin, &[&self.name(), &why]);
            }
        }
        if let Shape::Pocket { bosses, .. } | Shape::OpenPocket { bosses, .. } | Shape::Step { bosses, .. } = &self.feature.shape {
            self.bosses_within(e, bosses, &area.outline)?;
        }
        let moves = self.emptied(e, &area)?;
        // A floor that is not flat leaves a disk further down: corners are those of the walls.
        let y = match (area.floor, &self.feature.shape) {
            // A rounded foot or a ball of a floor draws the outline in: corners are those above it.
            (Floor::Flat, Shape::Hole { bottom: HoleBottom::Radiused(r) | HoleBottom::Spherical(r), .. }) => (self.depth - r).max(0.0),
            (Floor::Flat, _) => self.depth.min(self.bottom),
            _ => 0.0,
        };
        // Where walls of an open pocket go on in the air, corners are not its own.
        let ends = match &self.feature.shape {
            Shape::OpenPocket { boundary, .. } => vec![path(boundary)?.start(), path(boundary)?.end()],
            _ => Vec::new(),
        };
        if let Some(region) = area.at(y)?.first() {
            self.rest(e, region, &area.air, |p| ends.iter().all(|end| p.dist(*end) > 1e-6));
        }
        if let Some((_, deep)) = floor_depth(self.feature, self.radius, self.edge, self.m.allowance_bottom)
            && self.bottom + self.m.allowance_bottom < deep - 1e-6
        {
            self.leaves(e, &format!("the last {:.4} mm above the middle of its floor, where it is too narrow", deep - self.bottom));
        }
        let asked = match &self.feature.shape {
            Shape::Pocket { planar_radius, .. } | Shape::OpenPocket { planar_radius, .. } => planar_radius.unwrap_or(0.0),
            Shape::Step { radius, .. } => *radius,
            Shape::Hole { bottom: HoleBottom::Radiused(r) | HoleBottom::Spherical(r), .. } => *r,
            _ => 0.0,
        };
        let through = self.bottom > self.depth;
        if !through && matches!(area.floor, Floor::Flat) {
            self.foot(e, asked);
        }
        // The wall that is nearest stands most upright on it.
        let high = area.floor.corner(area.outline.outer().dist(area.floor.middle()), self.edge);
        if !through && !matches!(area.floor, Floor::Flat) && high > self.tolerance {
            self.leaves(e, &format!("up to {high:.4} mm all along the foot of its walls, where they meet its floor"));
        }
        if !area.steady() && !self.m.finish {
            self.leaves(e, &format!("stairs of up to {:.4} mm on its walls; a finishing workingstep takes them", self.stairs(&area)));
        }
        Ok(moves)
    }

    /// A boss that stands nowhere in the area it is a boss of: what it should keep would be cut away.
    fn bosses_within(&self, e: &mut Emit<'_>, bosses: &[Boss], outline: &Region) -> Done<()> {
        for boss in bosses {
            let foot = path(&boss.boundary)?;
            let within = foot.sampled(self.radius / 4.0).iter().any(|p| outline.contains(*p));
            if !within && !foot.contains(outline.outer().start()) {
                let why = format!("all of it lies outside {}; the placements of both are relative to the workpiece, not that of the boss to what it stands in", self.name());
                e.say(gr_text::code::PLAN_CANNOT_CUT, boss.origin, &[&format!("#{} BOSS", boss.origin.id), &why]);
            }
        }
        Ok(())
    }

    /// What a rounded edge leaves at the foot of walls that have a radius, or none.
    pub(super) fn foot(&self, e: &mut Emit<'_>, asked: f64) {
        if self.edge > asked + 1e-6 {
            self.leaves(e, &format!("a radius of {} mm all along the foot of its walls", self.edge));
        }
    }

    /// How far the stairs of roughing stand out from the walls.
    fn stairs(&self, area: &Area) -> f64 {
        let levels = (self.bottom / self.axial - 1e-9).ceil().max(1.0);
        if !matches!(area.floor, Floor::Flat) {
            return self.bottom / levels;
        }
        let slope = area.islands.iter().map(|i| i.slope).fold(area.slope, f64::max);
        let each = self.bottom / levels;
        (each * libm::tan(slope)).max(area.lean(self.bottom) - area.lean(self.bottom - each))
    }

    /// All levels, walls that lean between them when finishing.
    fn emptied(&self, e: &mut Emit<'_>, area: &Area) -> Done<Moves> {
        let entry = self.entry(false)?;
        let inset = self.radius + self.m.allowance_side;
        let mut moves = Vec::new();
        let mut above = 0.0;
        for bottom in area.breaks(self.bottom) {
            if area.steady() {
                for part in area.at(bottom)? {
                    let passes = self.passes(&part)?;
                    moves.extend(tp::motion(&passes, &self.heights(above, bottom), &entry, Some(&part), inset).map_err(words)?);
                }
                above = bottom;
                continue;
            }
            let count = ((bottom - above) / self.axial - 1e-9).ceil().max(1.0);
            let (from, each) = (above, (bottom - above) / count);
            for k in 1..=count as usize {
                let y = if k as f64 == count { bottom } else { from + each * k as f64 };
                self.one_level(area, above, y, &entry, &mut moves)?;
                above = y;
            }
        }
        if moves.is_empty() {
            let fits = area.at(self.bottom)?.iter().filter_map(|r| tp::largest_tool(r).ok()).fold(0.0, f64::max);
            return Err(words(tp::Error::ToolTooLarge { fits }));
        }
        let _ = e;
        Ok(moves)
    }

    fn one_level(&self, area: &Area, above: f64, y: f64, entry: &tp::Entry, moves: &mut Moves) -> Done<()> {
        let inset = self.radius + self.m.allowance_side;
        for part in area.at(y)? {
            // Further down a leaning wall may leave no room: what the tool does not reach is said elsewhere.
            match self.passes(&part) {
                Ok(passes) => moves.extend(tp::motion(&passes, &self.level(above, y), entry, Some(&part), inset).map_err(words)?),
                Err(why) if moves.is_empty() => return Err(why),
                Err(_) => {}
            }
        }
        if !self.m.finish {
            return Ok(());
        }
        let mut high = above;
        for wall in area.walls(above, y, self.tolerance)? {
            for part in area.at(wall)? {
                let mut what = tp::Contour::new(self.radius);
                what.allowance = self.m.allowance_side;
                what.cut_mode = self.cut_mode().unwrap_or(tp::CutMode::Climb);
                if let Ok(passes) = tp::contour_closed(&part, &what) {
                    let down = if self.two_axes { tp::Approach::Plunge } else { tp::Approach::Ramp { angle: super::USUAL_RAMP } };
                    let entry = tp::Entry { approach: down, ..tp::Entry::default() };
                    moves.extend(tp::motion(&passes, &self.level(high, wall), &entry, Some(&part), inset).map_err(words)?);
                }
            }
            high = wall;
        }
        Ok(())
    }

    fn passes(&self, region: &Region) -> Done<Vec<tp::Pass>> {
        if !self.m.bottom {
            return tp::contour_closed(region, &self.wall()).map_err(words);
        }
        Ok(self.connected(tp::clear(region, &self.clearing()?).map_err(words)?.passes))
    }

    /// Strokes joined as the strategy says: by lifting, if it does.
    pub(super) fn connected(&self, mut passes: Vec<tp::Pass>) -> Vec<tp::Pass> {
        if self.m.strategy.as_ref().is_some_and(|s| s.connection.as_deref() == Some("LIFT_SHIFT_PLUNGE")) {
            for p in &mut passes {
                p.link = tp::Link::Retract;
            }
        }
        passes
    }

    /// One pass along a wall.
    fn wall(&self) -> tp::Contour {
        let mut what = tp::Contour::new(self.radius);
        what.allowance = self.m.allowance_side;
        what.cut_mode = self.cut_mode().unwrap_or(tp::CutMode::Climb);
        what.start = self.start();
        let lead = (self.radius / 2.0).max(0.1);
        (what.lead_in, what.lead_out) = (tp::Lead::Arc(lead), tp::Lead::Arc(lead));
        what
    }

    pub(super) fn face(&self, e: &mut Emit<'_>) -> Done<Moves> {
        let Shape::Face { length, direction, width, across, boundary, bosses } = &self.feature.shape else {
            return Err(String::new());
        };
        let outline = match boundary {
            Some(b) => path(b)?,
            None => {
                let at = |u: f64, v: f64| P2::new(direction[0] * u + across[0] * v, direction[1] * u + across[1] * v);
                let corners = [at(0.0, 0.0), at(*length, 0.0), at(*length, *width), at(0.0, *width)];
                Path2::polyline(&corners, true).map_err(words)?.oriented(true)
            }
        };
        let overrun = self.step.operation.overcut.filter(|v| *v >= 0.0).unwrap_or(RUN_OUT);
        self.inside_part(e, &outline);
        // Beside the face a boss keeps the tool off where it runs over the edge.
        let reach = tp::grow(std::slice::from_ref(&outline), 2.0 * self.radius + overrun).map_err(words)?;
        self.bosses_within(e, bosses, reach.first().ok_or("its boundary encloses nothing")?)?;
        let lines = self.m.strategy.as_ref().is_none_or(|s| matches!(s.keyword.as_str(), "UNIDIRECTIONAL" | "BIDIRECTIONAL"));
        if !lines || bosses.iter().any(|b| b.top > 1e-9 || b.slope != 0.0) {
            return self.face_as_area(e, &outline, bosses, overrun);
        }
        let solid = bosses.iter().map(|b| path(&b.boundary)).collect::<Done<Vec<_>>>()?;
        // Its lines end in the air, and it goes round bosses wherever they stand.
        let (area, air) = self.face_room(&outline, bosses, 2.0 * self.radius + RUN_OUT)?;
        if let Some(region) = area.at(self.bottom)?.first().filter(|_| !bosses.is_empty()) {
            self.rest(e, region, &[air], |_| true);
        }
        let solid = if solid.is_empty() || self.m.allowance_side == 0.0 {
            solid
        } else {
            tp::grow(&solid, self.m.allowance_side).map_err(words)?.iter().map(|r| r.outer().clone()).collect()
        };
        let mut what = tp::Face::new(self.radius, self.by);
        let feed = self.m.strategy.as_ref().and_then(|s| s.feed).unwrap_or(*direction);
        what.angle = libm::atan2(feed[1], feed[0]);
        what.overrun = overrun;
        if let Some(s) = &self.m.strategy {
            what.bidirectional = s.keyword != "UNIDIRECTIONAL";
            what.step_left = s.step_left.unwrap_or(true);
        }
        let passes = self.connected(tp::face(&outline, &solid, &what).map_err(words)?);
        // Approaches go anywhere but into bosses, whose allowance is in their outlines already.
        let clear = if solid.is_empty() {
            None
        } else {
            let around = solid.iter().map(Path2::bounds).fold(outline.bounds(), tp::Bounds::union).grown(self.room_to_enter() + overrun.max(0.0));
            Some(Region::new(rectangle(around)?, solid).map_err(words)?)
        };
        tp::motion(&passes, &self.heights(0.0, self.bottom), &self.entry(true)?, clear.as_ref(), self.radius).map_err(words)
    }

    /// A face that ends inside the raw part has its neighbourhood cut by the overrun: that is said.
    fn inside_part(&self, e: &mut Emit<'_>, outline: &Path2) {
        let (Ok((a, b)), f) = (self.stock(), outline.bounds()) else { return };
        let beyond = [f.min.x - a.x, f.min.y - a.y, b.x - f.max.x, b.y - f.max.y].into_iter().fold(0.0, f64::max);
        if beyond > 1e-3 {
            e.say(gr_text::code::PLAN_OVERRUNS_PART, self.step.origin, &[&self.name(), &format!("{beyond:.4}")]);
        }
    }

    /// A plane by a strategy that follows its edge: the tool's centre goes over all of it, and past it by the overrun.
    fn face_as_area(&self, e: &mut Emit<'_>, outline: &Path2, bosses: &[Boss], overrun: f64) -> Done<Moves> {
        // Where a boss stands so near to the edge that the tool does not fit between, its rings go round it outside.
        let mut near = false;
        for boss in bosses {
            let foot = path(&boss.boundary)?.sampled(self.radius / 4.0);
            near |= foot.iter().any(|p| !outline.contains(*p) || outline.dist(*p) < 2.0 * (self.radius + self.m.allowance_side));
        }
        let beyond = self.radius + overrun;
        let (area, air) = self.face_room(outline, bosses, if near { beyond.max(2.0 * self.radius + RUN_OUT) } else { beyond })?;
        if let Some(region) = area.at(self.bottom)?.first().filter(|_| !bosses.is_empty()) {
            self.rest(e, region, &[air], |_| true);
        }
        self.emptied(e, &area)
    }

    /// A plane with all round it as far as the tool may go, and what of that is in the air.
    fn face_room(&self, outline: &Path2, bosses: &[Boss], beyond: f64) -> Done<(Area, Region)> {
        let around = |by: f64| -> Done<Path2> {
            let grown = tp::grow(std::slice::from_ref(outline), by + self.m.allowance_side).map_err(words)?;
            Ok(grown.first().ok_or("its boundary encloses nothing")?.outer().clone())
        };
        let outer = Region::new(around(beyond)?, Vec::new()).map_err(words)?;
        let air = Region::new(around(beyond + RUN_OUT)?, vec![outline.clone()]).map_err(words)?;
        Ok((self.plain(outer, self.islands(bosses)?, true), air))
    }

    /// Round about a boss or a profile.
    pub(super) fn around(&self, e: &mut Emit<'_>) -> Done<Moves> {
        let (boundary, slope, left) = match &self.feature.shape {
            Shape::Boss(b) => (&b.boundary, self.slope(b.slope)?, None),
            Shape::Outside { boundary, left } => (boundary, 0.0, *left),
            _ => return Err(String::new()),
        };
        let line = path(boundary)?;
        // Past the underside of the raw part by the edge, nothing of it is left.
        let under = self.step.stock.map(|[low, _]| self.feature.frame.inverse_point(low)[2]);
        if under.is_none_or(|z| -self.bottom > z - self.edge + 1e-6) {
            self.foot(e, 0.0);
        }
        if !line.is_closed() {
            return self.beside(e, &line, left);
        }
        if self.m.bottom {
            // Everything as far as the sides of the raw part: the tool's centre goes as far as they do.
            let (a, b) = self.stock()?;
            let out = self.radius + self.m.allowance_side;
            let out = P2::new(out, out) * (1.0 + 1e-3);
            let (a, b) = (a - out, b + out);
            let outline = Path2::polyline(&[a, P2::new(b.x, a.y), b, P2::new(a.x, b.y)], true).map_err(words)?;
            let gain = if slope == 0.0 { 0.0 } else { self.gain(slope) };
            let islands = vec![Island { path: line.clone(), top: 0.0, slope, gain }];
            let outline = Region::new(outline, Vec::new()).map_err(words)?;
            let area = self.plain(outline, islands, true);
            let moves = self.emptied(e, &area)?;
            if let Some(region) = area.at(self.bottom)?.first() {
                self.rest(e, region, &[], |p| line.dist(p) < 2.0 * self.radius);
            }
            if slope > 0.0 && !self.m.finish {
                self.leaves(e, &format!("stairs of up to {:.4} mm on its walls; a finishing workingstep takes them", self.stairs(&area)));
            }
            return Ok(moves);
        }
        let mut what = self.wall();
        (what.lead_in, what.lead_out) = (tp::Lead::Arc(self.radius), tp::Lead::Arc(self.radius));
        what.stock = self.in_front(&line);
        what.stepover = self.by;
        let mut moves = Vec::new();
        let mut above = 0.0;
        let step = if slope > 0.0 && self.m.finish { (self.tolerance / libm::tan(slope)).min(self.axial) } else { self.axial };
        let count = if slope > 0.0 { (self.bottom / step - 1e-9).ceil().max(1.0) } else { 1.0 };
        if count > MOST_WALLS as f64 {
            return Err("its walls lean so much that they need too many levels".into());
        }
        for k in 1..=count as usize {
            let y = if k as f64 == count { self.bottom } else { self.bottom * k as f64 / count };
            let by = y * libm::tan(slope) - if slope > 0.0 { self.gain(slope) } else { 0.0 };
            let paths = if by > 1e-9 {
                tp::grow(std::slice::from_ref(&line), by).map_err(words)?.iter().map(|r| r.outer().clone()).collect()
            } else {
                vec![line.clone()]
            };
            for p in paths {
                let side = if p.is_ccw() { tp::Side::Right } else { tp::Side::Left };
                let passes = tp::contour(&p, side, &what).map_err(words)?;
                let h = if slope > 0.0 { self.level(above, y) } else { self.heights(0.0, self.bottom) };
                let far = self.room_to_enter();
                let outside = Region::new(rectangle(p.bounds().grown(far))?, vec![p.clone()]).map_err(words)?;
                let inset = self.radius + self.m.allowance_side;
                moves.extend(tp::motion(&passes, &h, &self.entry(false)?, Some(&outside), inset).map_err(words)?);
            }
            above = y;
        }
        Ok(moves)
    }

    /// Beside a wall, for its passes and ways in and out.
    fn room_to_enter(&self) -> f64 {
        let of = |a: &Approach| match a {
            Approach::Helix(r, _) | Approach::Tangent(r) => 2.0 * r,
            Approach::Angle(_, l) => *l,
            _ => 0.0,
        };
        4.0 * self.radius + self.m.allowance_side + of(&self.m.approach).max(of(&self.m.retract)) + RUN_OUT
    }

    /// The side of an open profile where the tool is. None where it comes too near to itself.
    fn free_side(&self, line: &Path2, left: bool, stock: f64) -> Option<Region> {
        let far = self.room_to_enter() + stock;
        let (a, b) = (line.start() - line.start_tangent() * far, line.end() + line.end_tangent() * far);
        let size = line.bounds().size();
        let away = (line.end() - line.start()).unit().left() * ((far + size.x + size.y) * if left { 1.0 } else { -1.0 });
        let corners = [line.end(), b, b + away, a + away, a, line.start()];
        let rest = corners.windows(2).map(|w| tp::Seg::Line { a: w[0], b: w[1] });
        let outline = Path2::from_segs(line.segs().iter().copied().chain(rest), true).ok()?;
        Region::new(outline, Vec::new()).ok()
    }

    /// Material in front of a wall for several passes, if the strategy allows them and the raw part is known.
    fn in_front(&self, line: &Path2) -> f64 {
        let several = self.m.strategy.as_ref().is_some_and(|s| s.multiple == Some(true));
        let Ok((a, b)) = self.stock() else { return 0.0 };
        let corners = [a, b, P2::new(a.x, b.y), P2::new(b.x, a.y)];
        let far = corners.iter().map(|c| line.dist(*c)).fold(0.0, f64::max);
        if several { far } else { 0.0 }
    }

    fn beside(&self, e: &mut Emit<'_>, line: &Path2, left: Option<bool>) -> Done<Moves> {
        if left.is_none() {
            let rule = "an open profile does not say on which side the material goes: the tool is on its right, seen along it";
            e.say(gr_text::code::PLAN_TAKES_TURNS, self.feature.origin, &[&self.name(), rule]);
        }
        let mut what = self.wall();
        (what.lead_in, what.lead_out) = (tp::Lead::Line(self.radius + RUN_OUT), tp::Lead::Line(self.radius + RUN_OUT));
        what.stock = self.in_front(line);
        what.stepover = self.by;
        let side = if left == Some(true) { tp::Side::Left } else { tp::Side::Right };
        let passes = tp::contour(line, side, &what).map_err(words)?;
        let free = self.free_side(line, left == Some(true), what.stock);
        let entry = if free.is_some() { self.entry(true)? } else { tp::Entry::default() };
        let inset = self.radius + self.m.allowance_side;
        tp::motion(&passes, &self.heights(0.0, self.bottom), &entry, free.as_ref(), inset).map_err(words)
    }
}

fn rectangle(b: tp::Bounds) -> Done<Path2> {
    Path2::polyline(&[b.min, P2::new(b.max.x, b.min.y), b.max, P2::new(b.min.x, b.max.y)], true).map_err(words)
}
