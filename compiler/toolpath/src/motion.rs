//! From flat passes to moves: levels, approaches, links, retracts.

use crate::geom::Seg;
use crate::{Error, Link, P2, Pass, Path2, RESOLUTION, Region, positive};
use core::f64::consts::{FRAC_PI_2, PI, TAU};

/// A point in the feature's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct P3 {
    /// mm
    pub x: f64,
    /// mm
    pub y: f64,
    /// mm
    pub z: f64,
}

impl P3 {
    /// The point (x, y, z).
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }
    /// Over or under a point of the plane.
    pub const fn over(p: P2, z: f64) -> Self {
        Self { x: p.x, y: p.y, z }
    }
    /// Its place in the plane.
    pub const fn flat(self) -> P2 {
        P2::new(self.x, self.y)
    }
}

/// What a move is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tag {
    /// To the start of a pass, from the clearance plane down.
    Approach,
    /// Cutting.
    Cut,
    /// Between passes, at depth.
    Link,
    /// Up to the clearance plane.
    Retract,
}

/// Shape of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// As fast as the machine can, in a straight line.
    Rapid,
    /// Straight at feed.
    Line,
    /// Circular about the tool axis at feed; z changes evenly if the ends differ (helix).
    Arc {
        /// Centre in the plane.
        centre: P2,
        /// Angle turned through, positive counterclockwise; may exceed a full turn in a helix.
        sweep: f64,
    },
}

/// One move; it starts where the one before ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Where it ends.
    pub to: P3,
    /// Shape.
    pub kind: Kind,
    /// Purpose.
    pub tag: Tag,
}

/// Heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Depth {
    /// Top of the material.
    pub top: f64,
    /// Bottom of the last level.
    pub bottom: f64,
    /// Largest axial depth of cut.
    pub step: f64,
    /// Rapids go at this height.
    pub clearance: f64,
    /// Rapid down to this height, feed below it.
    pub safe: f64,
    /// Thickness of a last, separate level at the bottom (0: none).
    pub finish: f64,
}

impl Depth {
    /// Clearance 5 mm above the top, feed from 1 mm above.
    pub fn new(top: f64, bottom: f64, step: f64) -> Self {
        Self { top, bottom, step, clearance: top + 5.0, safe: top + 1.0, finish: 0.0 }
    }
}

/// The way down to a pass (or, mirrored, up from it).
#[derive(Clone, Debug, PartialEq)]
pub enum Approach {
    /// Along the tool axis.
    Plunge,
    /// Down along the pass itself at this angle from the plane, rad.
    Ramp {
        /// rad
        angle: f64,
    },
    /// Down a helix that ends tangentially in the pass's start.
    Helix {
        /// Of the tool centre's way, mm.
        radius: f64,
        /// From the plane, rad.
        angle: f64,
    },
    /// To and fro along the pass's first `width` mm.
    ZigZag {
        /// From the plane, rad.
        angle: f64,
        /// mm
        width: f64,
    },
    /// Straight, slanting in the direction of the pass.
    AirAngle {
        /// From the plane, rad.
        angle: f64,
        /// Length of the slanting way, mm.
        length: f64,
    },
    /// A quarter circle in the plane of the pass, tangential to it, on the side where there is room.
    AirTangent {
        /// mm
        radius: f64,
    },
    /// Along these points, relative to the first point of the pass.
    AlongPath(Vec<P3>),
}

/// How passes begin and end.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Way down.
    pub approach: Approach,
    /// Way up (only `Plunge`, `AirAngle`, `AirTangent` and `AlongPath` mean something).
    pub retract: Approach,
    /// Work level by level (true) or each pass to full depth.
    pub by_level: bool,
}

impl Default for Entry {
    fn default() -> Self {
        Self { approach: Approach::Plunge, retract: Approach::Plunge, by_level: true }
    }
}

/// Heights of the levels, top to bottom, evenly spaced, none deeper than the step.
pub fn levels(depth: &Depth) -> Result<Vec<f64>, Error> {
    let heights = [depth.top, depth.bottom, depth.clearance, depth.safe];
    if heights.iter().any(|h| !h.is_finite()) {
        return Err(Error::NotFinite);
    }
    let step = positive(depth.step, "axial depth")?;
    let finish = crate::not_negative(depth.finish, "finishing depth")?;
    let whole = depth.top - depth.bottom;
    if whole < 0.0 {
        return Err(Error::Parameter("depth"));
    }
    if depth.safe < depth.top || depth.clearance < depth.safe {
        return Err(Error::Parameter("clearance"));
    }
    let rough = (whole - finish).max(0.0);
    let n = (rough / step - 1e-9).ceil().max(0.0);
    if n > 20_000.0 {
        return Err(Error::TooManyPasses);
    }
    let mut out: Vec<f64> = (1..n as usize).map(|i| depth.top - rough * i as f64 / n).collect();
    if n > 0.0 {
        out.push(depth.top - rough);
    }
    if finish > 1e-9 || out.is_empty() {
        out.push(depth.bottom);
    }
    Ok(out)
}

/// Moves of these passes on every level. `region` and `radius` say where the tool may be: approaches keep inside, or
/// fall back to a ramp along the pass (plunge for the ones through the air), which always is. `None`: anywhere
/// (facing, outside profiles).
///
/// The first move is a rapid at clearance height to the first approach; the last ends at clearance height.
pub fn motion(passes: &[Pass], depth: &Depth, entry: &Entry, region: Option<&Region>, radius: f64) -> Result<Vec<Move>, Error> {
    if !radius.is_finite() {
        return Err(Error::NotFinite);
    }
    check(&entry.approach)?;
    check(&entry.retract)?;
    let heights = levels(depth)?;
    if passes.len().saturating_mul(heights.len()) > 2_000_000 {
        return Err(Error::TooManyPasses);
    }
    let mut w = Writer { moves: Vec::new(), at: None, depth, entry, region, radius };
    if entry.by_level {
        let mut above = depth.top;
        for &z in &heights {
            w.level(passes, above, z)?;
            above = z;
        }
    } else {
        for group in groups(passes) {
            let mut above = depth.top;
            for &z in &heights {
                w.level(group, above, z)?;
                above = z;
            }
        }
    }
    Ok(w.moves)
}

/// Passes that hang together at depth.
fn groups(passes: &[Pass]) -> impl Iterator<Item = &[Pass]> {
    passes.chunk_by(|_, next| next.link != Link::Retract)
}

/// Whether no two points of it are further apart than a circle of [`RESOLUTION`] is wide.
fn is_point(path: &Path2) -> bool {
    let size = path.bounds().size();
    size.x.max(size.y) < 2.0 * RESOLUTION
}

fn check(a: &Approach) -> Result<(), Error> {
    let angle = |a: f64| {
        if !a.is_finite() {
            return Err(Error::NotFinite);
        }
        if a < 1e-3 || a > FRAC_PI_2 { Err(Error::Parameter("angle")) } else { Ok(()) }
    };
    match a {
        Approach::Plunge => Ok(()),
        Approach::Ramp { angle: a } => angle(*a),
        Approach::Helix { radius, angle: a } => positive(*radius, "helix radius").and_then(|_| angle(*a)),
        Approach::ZigZag { angle: a, width } => positive(*width, "zigzag width").and_then(|_| angle(*a)),
        Approach::AirAngle { angle: a, length } => positive(*length, "travel length").and_then(|_| angle(*a)),
        Approach::AirTangent { radius } => positive(*radius, "approach radius").map(|_| ()),
        Approach::AlongPath(points) => {
            let fine = points.iter().all(|p| p.x.is_finite() && p.y.is_finite() && p.z.is_finite());
            if fine { Ok(()) } else { Err(Error::NotFinite) }
        }
    }
}

struct Writer<'a> {
    moves: Vec<Move>,
    /// Where the tool is; `None` before the first move.
    at: Option<P3>,
    depth: &'a Depth,
    entry: &'a Entry,
    region: Option<&'a Region>,
    radius: f64,
}

impl Writer<'_> {
    fn go(&mut self, to: P3, kind: Kind, tag: Tag) {
        let still = self.at.is_some_and(|p| p.flat().dist(to.flat()) < 1e-9 && (p.z - to.z).abs() < 1e-9);
        if still && !matches!(kind, Kind::Arc { .. }) {
            return;
        }
        self.moves.push(Move { to, kind, tag });
        self.at = Some(to);
    }
    fn rapid_over(&mut self, p: P2) {
        self.go(P3::over(p, self.depth.clearance), Kind::Rapid, Tag::Approach);
    }
    fn line(&mut self, p: P2, z: f64, tag: Tag) {
        self.go(P3::over(p, z), Kind::Line, tag);
    }
    /// Along a path while the height goes evenly from `z0` to `z1`. What is smaller than any machine goes is a point, and
    /// the chord stands for an arc of so small a radius: controls refuse those.
    fn trace(&mut self, path: &Path2, z0: f64, z1: f64, tag: Tag) {
        if path.segs().is_empty() {
            return;
        }
        if is_point(path) {
            return self.line(path.end(), z1, tag);
        }
        let total = path.length().max(1e-12);
        let mut done = 0.0;
        let n = path.segs().len();
        for (i, s) in path.segs().iter().enumerate() {
            done += s.len();
            let z = if i + 1 == n { z1 } else { z0 + (z1 - z0) * (done / total) };
            let kind = match *s {
                Seg::Arc { a, c, sweep, .. } if a.dist(c) >= RESOLUTION => Kind::Arc { centre: c, sweep },
                _ => Kind::Line,
            };
            self.go(P3::over(s.b(), z), kind, tag);
        }
    }
    fn holds(&self, p: P2) -> bool {
        self.region.is_none_or(|r| r.fits(p, self.radius, 1e-4))
    }
    fn holds_path(&self, path: &Path2) -> bool {
        self.region.is_none() || path.sampled(0.1).into_iter().all(|p| self.holds(p))
    }

    fn level(&mut self, passes: &[Pass], above: f64, z: f64) -> Result<(), Error> {
        for (i, pass) in passes.iter().enumerate() {
            match (&pass.link, i) {
                (Link::Stay(way), 1..) => self.trace(way, z, z, Tag::Link),
                _ => {
                    if i > 0 {
                        self.retract(&passes[i - 1], z);
                    }
                    self.approach(&pass.path, above, z)?;
                }
            }
            self.trace(&pass.path, z, z, Tag::Cut);
        }
        if let Some(last) = passes.last() {
            self.retract(last, z);
        }
        Ok(())
    }

    /// Rapid down to just above what the level before left. The tool has been at this place on that level.
    fn down_to(&mut self, p: P2, above: f64) -> f64 {
        let z = (above + self.depth.safe - self.depth.top).min(self.depth.clearance);
        self.rapid_over(p);
        self.go(P3::over(p, z), Kind::Rapid, Tag::Approach);
        z
    }

    fn plunge(&mut self, p: P2, above: f64, z: f64) {
        self.down_to(p, above);
        self.line(p, z, Tag::Approach);
    }

    fn approach(&mut self, path: &Path2, above: f64, z: f64) -> Result<(), Error> {
        let p = path.start();
        match &self.entry.approach {
            Approach::Plunge => self.plunge(p, above, z),
            Approach::Ramp { angle } => self.ramp(path, above, z, *angle, f64::INFINITY)?,
            Approach::ZigZag { angle, width } => self.ramp(path, above, z, *angle, *width)?,
            Approach::Helix { radius, angle } => self.helix(path, above, z, *radius, *angle)?,
            Approach::AirAngle { angle, length } => {
                let back = p - path.start_tangent() * (length * libm::cos(*angle));
                let high = z + length * libm::sin(*angle);
                let way = Path2::polyline(&[back, p], false);
                if way.is_ok_and(|w| self.holds_path(&w)) {
                    self.rapid_over(back);
                    let start = high.max(self.depth.safe).min(self.depth.clearance);
                    self.go(P3::over(back, start), Kind::Rapid, Tag::Approach);
                    self.line(back, high, Tag::Approach);
                    self.line(p, z, Tag::Approach);
                } else {
                    self.plunge(p, above, z);
                }
            }
            Approach::AirTangent { radius } => match self.quarter(p, path.start_tangent(), *radius, true) {
                Some(arc) => {
                    self.rapid_over(arc.start());
                    self.go(P3::over(arc.start(), self.depth.safe), Kind::Rapid, Tag::Approach);
                    self.line(arc.start(), z, Tag::Approach);
                    self.trace(&arc, z, z, Tag::Approach);
                }
                None => self.plunge(p, above, z),
            },
            Approach::AlongPath(points) => self.along(points, p, z),
        }
        Ok(())
    }

    fn along(&mut self, points: &[P3], p: P2, z: f64) {
        if let Some(first) = points.first() {
            self.rapid_over(p + first.flat());
            let top = (z + first.z).max(self.depth.safe).min(self.depth.clearance);
            self.go(P3::over(p + first.flat(), top), Kind::Rapid, Tag::Approach);
        } else {
            self.rapid_over(p);
        }
        for q in points {
            self.line(p + q.flat(), z + q.z, Tag::Approach);
        }
        self.line(p, z, Tag::Approach);
    }

    /// A quarter circle that ends (or begins) at `p` in direction `t`.
    fn quarter(&self, p: P2, t: P2, radius: f64, into: bool) -> Option<Path2> {
        for k in [1.0, 0.5, 0.25] {
            for side in [1.0, -1.0] {
                let r = radius * k;
                let c = p + t.left() * (r * side);
                let far = if into { c - t * r } else { c + t * r };
                let (a, b) = if into { (far, p) } else { (p, far) };
                let arc = Path2::from_segs([Seg::Arc { a, b, c, sweep: FRAC_PI_2 * side }], false).ok()?;
                if self.holds_path(&arc) {
                    return Some(arc);
                }
            }
        }
        None
    }

    /// Down along the first part of the pass, to and fro, back at its start when the depth is reached. A closed pass
    /// too short for one way is run round and round.
    fn ramp(&mut self, path: &Path2, above: f64, z: f64, angle: f64, width: f64) -> Result<(), Error> {
        let p = path.start();
        let top = self.down_to(p, above);
        let fall = (top - z).max(0.0);
        let need = fall / libm::tan(angle);
        let length = path.length();
        if need < 1e-6 {
            self.line(p, z, Tag::Approach);
            return Ok(());
        }
        // A pass no longer than a fraction of the tool is no slope: turn round beside it instead.
        if length < 0.5 * self.radius && need > 4.0 * length {
            if let Some((centre, r, side)) = self.room_for_helix(path, 0.5 * self.radius) {
                return self.helix_about(path, above, z, angle, centre, r, side);
            }
        }
        if is_point(path) {
            self.line(p, z, Tag::Approach);
            return Ok(());
        }
        let round = path.is_closed() && need > length * 0.5 && width >= length;
        let window = length.min(width).min(need * 0.5).max(1e-3);
        let legs = if round { (need / length).ceil() } else { 2.0 * (need / window * 0.5).ceil() };
        if legs > 20_000.0 {
            // No way to go to and fro on: the tool axis is all that is left.
            return Ok(self.line(p, z, Tag::Approach));
        }
        let there = if round { Some(path.opened()) } else { path.part(0.0, window) };
        let Some(there) = there else { return Ok(self.line(p, z, Tag::Approach)) };
        let back = there.reversed();
        for i in 0..legs as usize {
            let (z0, z1) = (top - fall * i as f64 / legs, top - fall * (i as f64 + 1.0) / legs);
            let leg = if round || i % 2 == 0 { &there } else { &back };
            self.trace(leg, z0, z1, Tag::Approach);
        }
        Ok(())
    }

    /// Where a helix beside the start of a path has room: centre, radius, side.
    fn room_for_helix(&self, path: &Path2, radius: f64) -> Option<(P2, f64, f64)> {
        let (p, t) = (path.start(), path.start_tangent());
        for k in [1.0, 0.75, 0.5, 0.35, 0.25] {
            for side in [1.0, -1.0] {
                let r = radius * k;
                let c = p + t.left() * (r * side);
                if self.region.is_none_or(|g| g.contains(c) && g.dist(c) >= self.radius + r - 1e-6) {
                    return Some((c, r, side));
                }
            }
        }
        None
    }

    /// Down a helix beside the path, one flat turn at the bottom, out of it tangentially.
    fn helix(&mut self, path: &Path2, above: f64, z: f64, radius: f64, angle: f64) -> Result<(), Error> {
        match self.room_for_helix(path, radius) {
            Some((centre, r, side)) => self.helix_about(path, above, z, angle, centre, r, side),
            None => self.ramp(path, above, z, angle, f64::INFINITY),
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn helix_about(&mut self, path: &Path2, above: f64, z: f64, angle: f64, centre: P2, r: f64, side: f64) -> Result<(), Error> {
        let p = path.start();
        let top = self.down_to(p, above);
        let turns = ((top - z).max(0.0) / (TAU * r * libm::tan(angle))).ceil();
        if turns > 20_000.0 {
            return Err(Error::Parameter("angle"));
        }
        for i in 0..turns as usize {
            let z1 = top - (top - z) * (i as f64 + 1.0) / turns;
            self.turn(centre, p, side, 0.5 * (z1 + self.at.map_or(top, |a| a.z)), z1);
        }
        self.turn(centre, p, side, z, z);
        Ok(())
    }

    /// A full turn in two halves.
    fn turn(&mut self, centre: P2, p: P2, side: f64, half: f64, end: f64) {
        let kind = Kind::Arc { centre, sweep: PI * side };
        self.go(P3::over(centre * 2.0 - p, half), kind, Tag::Approach);
        self.go(P3::over(p, end), kind, Tag::Approach);
    }

    fn retract(&mut self, pass: &Pass, z: f64) {
        let (p, t) = (pass.path.end(), pass.path.end_tangent());
        let mut from = p;
        match &self.entry.retract {
            Approach::AirAngle { angle, length } => {
                let ahead = p + t * (length * libm::cos(*angle));
                if Path2::polyline(&[p, ahead], false).is_ok_and(|w| self.holds_path(&w)) {
                    self.line(ahead, z + length * libm::sin(*angle), Tag::Retract);
                    from = ahead;
                }
            }
            Approach::AirTangent { radius } => {
                if let Some(arc) = self.quarter(p, t, *radius, false) {
                    self.trace(&arc, z, z, Tag::Retract);
                    from = arc.end();
                }
            }
            Approach::AlongPath(points) => {
                for q in points {
                    from = p + q.flat();
                    self.line(from, z + q.z, Tag::Retract);
                }
            }
            _ => {}
        }
        let top = self.at.map_or(self.depth.clearance, |a| a.z.max(self.depth.clearance));
        self.go(P3::over(from, top), Kind::Rapid, Tag::Retract);
    }
}
