//! Clearing strategies: which way the tool goes to empty a region, in the plane.

use crate::geom::{Bounds, Seg, TOL};
use crate::offset::{difference, dilate, erode};
use crate::{Error, Link, P2, Pass, Path2, Region, Role, positive};

/// More levels or lines than this are a mistake.
const MANY: f64 = 20_000.0;

/// So much less than its radius may be tried of a tool that fits exactly, mm.
pub const HAIR: f64 = 5e-5;

/// How an area is emptied (ISO 14649-11).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strategy {
    /// Parallel to the walls and islands, level by level.
    ContourParallel,
    /// The same levels, joined into a spiral.
    ContourSpiral,
    /// Parallel lines, all in the direction of the angle (rad from +x).
    Unidirectional(f64),
    /// Parallel lines, to and fro.
    Bidirectional(f64),
    /// To and fro, then once along the walls.
    BidirectionalContour(f64),
    /// Once along the walls, then to and fro.
    ContourBidirectional(f64),
    /// Along the middle line: for slots and grooves not much wider than the tool.
    CentreMilling,
}

/// Where the cutting edge meets the material, spindle clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutMode {
    /// The material is on the right of the tool's way.
    Climb,
    /// The material is on the left.
    Conventional,
}

/// Sense of travel along an outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rotation {
    /// Counterclockwise.
    Ccw,
    /// Clockwise.
    Cw,
}

/// Which level of a contour-parallel path comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// From the middle to the walls.
    InsideOut,
    /// From the walls to the middle.
    OutsideIn,
}

/// What [`clear`] is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Clear {
    /// Tool radius, mm.
    pub radius: f64,
    /// How far from its axis the tool leaves a clean floor, mm: its radius, or less with a rounded edge.
    pub clean: f64,
    /// Distance between passes, mm: tool diameter × (1 − overlap). At most the diameter.
    pub stepover: f64,
    /// Left on every wall, mm.
    pub allowance: f64,
    /// Way of clearing.
    pub strategy: Strategy,
    /// Climb or conventional, if asked for (climb otherwise).
    pub cut_mode: Option<CutMode>,
    /// Sense of travel along the outline, if asked for. With a cut mode it decides the order of levels.
    pub rotation: Option<Rotation>,
    /// Order of levels; decided by cut mode and rotation if `None`.
    pub order: Option<Order>,
    /// To and fro strategies step to the left of the feed direction if true (the standard's `.LEFT.`).
    pub step_left: bool,
    /// Where to begin, as near as possible.
    pub start: Option<P2>,
    /// Uni- and bidirectional only: follow the walls once at the end, so that nothing is left between line ends.
    pub finish_walls: bool,
}

impl Clear {
    /// Climb milling without allowance, complete.
    pub fn new(radius: f64, stepover: f64, strategy: Strategy) -> Self {
        Self {
            radius,
            clean: radius,
            stepover,
            allowance: 0.0,
            strategy,
            cut_mode: None,
            rotation: None,
            order: None,
            step_left: true,
            start: None,
            finish_walls: true,
        }
    }
}

/// A cleared region.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleared {
    /// Passes in cutting order.
    pub passes: Vec<Pass>,
    /// Where this tool may stand: the region narrowed by radius and allowance.
    pub room: Vec<Region>,
}

/// Empties a region.
///
/// Everything a tool of this radius can reach inside the allowance is cut and nothing else, except that plain uni- and
/// bidirectional paths without `finish_walls` leave cusps at the line ends.
pub fn clear(region: &Region, what: &Clear) -> Result<Cleared, Error> {
    let job = Job::new(region, what)?;
    let mut passes = match what.strategy {
        Strategy::ContourParallel => job.levels(false)?,
        Strategy::ContourSpiral => job.levels(true)?,
        Strategy::CentreMilling => job.centre()?,
        Strategy::Unidirectional(angle) => job.lines(angle, true, if what.finish_walls { Walls::Last } else { Walls::No })?,
        Strategy::Bidirectional(angle) => job.lines(angle, false, if what.finish_walls { Walls::Last } else { Walls::No })?,
        Strategy::BidirectionalContour(angle) => job.lines(angle, false, Walls::Last)?,
        Strategy::ContourBidirectional(angle) => job.lines(angle, false, Walls::First)?,
    };
    if let Some(first) = passes.first_mut() {
        first.link = Link::Retract;
    }
    Ok(Cleared { passes, room: job.room })
}

/// Where the centre of a tool may be, if anywhere. A room exactly as wide as the tool may be lost to rounding: then a
/// hair less than the radius is tried.
pub(crate) fn places(region: &Region, d: f64) -> Result<Vec<Region>, Error> {
    let found = erode(region, d)?;
    if found.is_empty() { erode(region, (d - HAIR).max(0.0)) } else { Ok(found) }
}

/// The same, or how large a tool fits.
pub(crate) fn room(region: &Region, d: f64) -> Result<Vec<Region>, Error> {
    let found = places(region, d)?;
    if found.is_empty() { Err(Error::ToolTooLarge { fits: inradius(region)? }) } else { Ok(found) }
}

/// Radius of the largest circle that fits.
pub(crate) fn inradius(region: &Region) -> Result<f64, Error> {
    let size = region.bounds().size();
    let (mut lo, mut hi) = (0.0, size.x.min(size.y) * 0.5 + 1e-6);
    while hi - lo > 1e-5 * hi.max(1e-3) {
        let mid = (lo + hi) * 0.5;
        if erode(region, mid)?.is_empty() { hi = mid } else { lo = mid }
    }
    Ok(lo)
}

#[derive(Clone, Copy, PartialEq)]
enum Walls {
    No,
    First,
    Last,
}

struct Job<'a> {
    region: &'a Region,
    what: &'a Clear,
    /// Radius and allowance.
    inset: f64,
    clean: f64,
    step: f64,
    room: Vec<Region>,
}

/// One connected part of a level, with what lies inside it on the next.
struct Node {
    own: Vec<Path2>,
    rest: Vec<Path2>,
    area: Region,
    children: Vec<Node>,
}

impl<'a> Job<'a> {
    fn new(region: &'a Region, what: &'a Clear) -> Result<Self, Error> {
        let r = positive(what.radius, "tool radius")?;
        let step = positive(what.stepover, "stepover")?;
        if step > 2.0 * r + 1e-9 {
            return Err(Error::Parameter("stepover"));
        }
        let inset = r + crate::not_negative(what.allowance, "allowance")?;
        if what.start.is_some_and(|p| !p.x.is_finite() || !p.y.is_finite()) {
            return Err(Error::NotFinite);
        }
        let size = region.bounds().size();
        if size.x.max(size.y) / step > MANY {
            return Err(Error::TooManyPasses);
        }
        let clean = positive(what.clean, "clean radius")?.min(r);
        Ok(Self { region, what, inset, clean, step, room: room(region, inset)? })
    }

    /// Is the outline followed counterclockwise, and do the walls come last?
    fn sense(&self) -> (bool, bool) {
        let climb = self.what.cut_mode.map(|m| m == CutMode::Climb);
        match (self.what.rotation, self.what.order) {
            (Some(turn), order) => {
                let ccw = turn == Rotation::Ccw;
                let natural = climb.is_none_or(|c| c == ccw);
                (ccw, order.map_or(natural, |o| o == Order::InsideOut))
            }
            (None, order) => {
                let out = order.is_none_or(|o| o == Order::InsideOut);
                (climb.unwrap_or(true) == out, out)
            }
        }
    }

    // Contour parallel -----------------------------------------------------------------------------------------------

    fn levels(&self, spiral: bool) -> Result<Vec<Pass>, Error> {
        let roots = self.tree()?;
        self.passes_of(roots, spiral)
    }

    fn passes_of(&self, mut roots: Vec<Node>, spiral: bool) -> Result<Vec<Pass>, Error> {
        let (ccw, out) = self.sense();
        // Made from the inside out; a path from the walls in is the same one backwards.
        let forward = ccw == out;
        let mut done = Done { pen: self.what.start.filter(|_| out), passes: Vec::new(), areas: Vec::new() };
        if let Some(p) = self.what.start {
            roots.sort_by(|l, r| l.area.dist(p).total_cmp(&r.area.dist(p)));
        }
        for root in roots {
            self.visit(root, true, forward, spiral, &mut done);
        }
        if out { Ok(done.passes) } else { Ok(self.backwards(done.passes)) }
    }

    fn backwards(&self, passes: Vec<Pass>) -> Vec<Pass> {
        let mut link = Link::Retract;
        let mut out: Vec<Pass> = Vec::with_capacity(passes.len());
        for p in passes.into_iter().rev() {
            out.push(Pass { path: p.path.reversed(), role: p.role, link });
            link = match p.link {
                // Through uncut material only short ways.
                Link::Stay(way) if way.length() <= 2.5 * self.step + TOL => Link::Stay(way.reversed()),
                _ => Link::Retract,
            };
        }
        out
    }

    fn tree(&self) -> Result<Vec<Node>, Error> {
        let mut all: Vec<Vec<Region>> = vec![self.room.clone()];
        let mut k = 1.0;
        while all.last().is_some_and(|l| !l.is_empty()) {
            if k > MANY {
                return Err(Error::TooManyPasses);
            }
            all.push(erode(self.region, self.inset + k * self.step)?);
            k += 1.0;
        }
        all.pop();
        let mut deeper: Vec<Node> = Vec::new();
        for (k, level) in all.iter().enumerate().rev() {
            let left = self.left_over(k, all.get(k + 1).map_or(&[][..], |l| l))?;
            let mut nodes: Vec<Node> = level
                .iter()
                .map(|r| Node { own: curves(r), rest: Vec::new(), area: r.clone(), children: Vec::new() })
                .collect();
            for child in deeper {
                let p = child.area.outer().start();
                if let Some(home) = home_of(&mut nodes, p) {
                    home.children.push(child);
                }
            }
            for piece in left {
                let p = piece.outer().start();
                if let Some(home) = home_of(&mut nodes, p) {
                    home.rest.extend(piece.loops().cloned());
                }
            }
            deeper = nodes;
        }
        Ok(deeper)
    }

    /// What level `k` leaves inside itself that the next level does not reach either: spikes in sharp corners and
    /// middles, when the step is more than the radius. None of it is thicker than the radius, so that following its
    /// edge takes all of it.
    fn left_over(&self, k: usize, next: &[Region]) -> Result<Vec<Region>, Error> {
        let r = self.clean;
        if self.step <= r + 1e-9 {
            return Ok(Vec::new());
        }
        let inside = erode(self.region, self.inset + k as f64 * self.step + r - 1e-4)?;
        if inside.is_empty() || next.is_empty() {
            return Ok(inside);
        }
        difference(&inside, &dilate(next, r)?, 1e-4)
    }

    fn visit(&self, node: Node, wall: bool, forward: bool, spiral: bool, done: &mut Done) {
        for child in node.children {
            self.visit(child, false, forward, spiral, done);
        }
        for path in node.rest {
            self.append(if forward { path } else { path.reversed() }, Role::Rest, spiral, done);
        }
        let role = if wall { Role::Wall } else { Role::Clear };
        // The outline last: it is the nearest to the level that follows.
        let mut own = node.own;
        own.reverse();
        for path in own {
            self.append(if forward { path } else { path.reversed() }, role, spiral, done);
        }
        done.areas.push(node.area);
    }

    fn append(&self, path: Path2, role: Role, spiral: bool, done: &mut Done) {
        let Some(pen) = done.pen else {
            let path = start_at_side(&path, spiral);
            done.pen = Some(path.end());
            done.passes.push(Pass { path, role, link: Link::Retract });
            return;
        };
        if spiral && path.is_closed() {
            if let Some((path, way)) = self.spiral_step(&path, done) {
                done.pen = Some(path.end());
                done.passes.push(Pass { path, role, link: Link::Stay(way) });
                return;
            }
        }
        let path = if path.is_closed() { path.starting_near(pen) } else { nearer_end(path, pen) };
        let link = match done.passes.is_empty() {
            true => Link::Retract,
            false => self.way(pen, path.start(), &done.areas),
        };
        done.pen = Some(path.end());
        done.passes.push(Pass { path, role, link });
    }

    /// The next curve from where the last side of this one, made longer, meets it.
    fn extended(&self, path: &Path2, next: &Path2) -> Option<(Path2, Path2)> {
        let end = path.end();
        let ray = Seg::Line { a: end, b: end + path.end_tangent() * (3.0 * self.step) };
        let hit = first_hit(&ray, next).filter(|&hit| self.fits(end, hit))?;
        Some((next.starting_near(hit), Path2::polyline(&[end, hit], false).ok()?))
    }

    /// From the inner curve to the next: its last side is extended until the next curve is met; where that is far
    /// (smooth curves), slanting over from a step before the end.
    fn spiral_step(&self, next: &Path2, done: &mut Done) -> Option<(Path2, Path2)> {
        let last = done.passes.last_mut()?;
        if !last.path.is_closed() || last.role == Role::Wall {
            return None;
        }
        if let Some((next, way)) = self.extended(&last.path, next) {
            return Some((next, way));
        }
        // With a step of at most the radius the last bit of a turn is cut by its neighbours.
        let bit = last.path.segs().last().map_or(0.0, Seg::len);
        if self.step <= self.clean + 1e-9 && bit <= 1.5 * self.step {
            let shorter = last.path.part(0.0, last.path.length() - bit);
            if let Some((shorter, found)) = shorter.and_then(|s| self.extended(&s, next).map(|f| (s, f))) {
                last.path = shorter;
                return Some(found);
            }
        }
        let length = last.path.length();
        if self.step > self.clean + 1e-9 || length < 4.0 * self.step {
            return None;
        }
        let path = next.starting_near(last.path.end());
        let shorter = last.path.part(0.0, length - self.step)?;
        if !self.fits(shorter.end(), path.start()) || shorter.end().dist(path.start()) > 2.5 * self.step {
            return None;
        }
        let way = Path2::polyline(&[shorter.end(), path.start()], false).ok()?;
        last.path = shorter;
        Some((path, way))
    }

    // Centre --------------------------------------------------------------------------------------------------------

    fn centre(&self) -> Result<Vec<Pass>, Error> {
        let mut roots = self.tree()?;
        let deepest = inradius(self.region)?;
        if deepest - self.inset > 1e-3 {
            for piece in erode(self.region, deepest - 1e-4)? {
                let p = piece.outer().start();
                if let Some(home) = home_of(&mut roots, p) {
                    let mut home = home;
                    while let Some(i) = home.children.iter().position(|c| c.area.contains(p)) {
                        home = &mut home.children[i];
                    }
                    let inner = Node { own: curves(&piece), rest: Vec::new(), area: piece, children: Vec::new() };
                    home.children.push(inner);
                }
            }
        }
        self.passes_of(roots, false)
    }

    // Lines -----------------------------------------------------------------------------------------------------------

    fn lines(&self, angle: f64, one_way: bool, walls: Walls) -> Result<Vec<Pass>, Error> {
        if !angle.is_finite() {
            return Err(Error::NotFinite);
        }
        let turned = Job {
            region: &self.region.rotated(-angle),
            what: self.what,
            inset: self.inset,
            clean: self.clean,
            step: self.step,
            room: self.room.iter().map(|r| r.rotated(-angle)).collect(),
        };
        let mut order: Vec<&Region> = turned.room.iter().collect();
        if let Some(p) = self.what.start.map(|p| p.rotated(-angle)) {
            order.sort_by(|l, r| l.outer().dist(p).total_cmp(&r.outer().dist(p)));
        }
        let mut passes = Vec::new();
        for room in order {
            if walls == Walls::First {
                turned.walls(room, &mut passes);
            }
            let size = room.bounds().size();
            if size.x > 1e-3 && size.y > 1e-3 && room.area() > 1e-6 * room.outer().length() {
                turned.lines_in(room, one_way, walls != Walls::No, &mut passes);
            } else if walls == Walls::No {
                turned.walls(room, &mut passes);
            }
            if walls == Walls::Last {
                turned.walls(room, &mut passes);
            }
        }
        Ok(passes.into_iter().map(|p| rotated(p, angle)).collect())
    }

    fn walls(&self, room: &Region, passes: &mut Vec<Pass>) {
        let ccw = match (self.what.rotation, self.what.cut_mode) {
            (Some(turn), _) => turn == Rotation::Ccw,
            (None, mode) => mode != Some(CutMode::Conventional),
        };
        for path in curves(room) {
            let path = if ccw { path } else { path.reversed() };
            let pen = passes.last().map(|p: &Pass| p.path.end());
            let path = match pen {
                Some(p) if path.is_closed() => path.starting_near(p),
                Some(p) => nearer_end(path, p),
                None => path,
            };
            let link = pen.map_or(Link::Retract, |p| self.way(p, path.start(), &[]));
            passes.push(Pass { path, role: Role::Wall, link });
        }
    }

    fn lines_in(&self, room: &Region, one_way: bool, walls: bool, passes: &mut Vec<Pass>) {
        let left = match (one_way, self.what.cut_mode) {
            (true, Some(mode)) => mode == CutMode::Conventional,
            _ => self.what.step_left,
        };
        let mut rows = self.rows(room, walls);
        if !left {
            rows.reverse();
        }
        let mut at: Option<usize> = None;
        let mut fresh = true;
        loop {
            let pen = passes.last().map(|p| p.path.end());
            let pick = match (at, pen) {
                (Some(row), Some(p)) => self.neighbour(&rows, row, p, one_way, room),
                _ => None,
            };
            let (row, i, link) = match pick {
                Some((row, i, way)) => (row, i, Link::Stay(way)),
                None => match next_row(&rows, at, if fresh { None } else { pen }) {
                    Some((row, i)) => (row, i, Link::Retract),
                    None => break,
                },
            };
            let (a, b) = rows[row].remove(i);
            // The first line runs along the feed direction, the others from the end that is nearer.
            let flip = !one_way
                && match (&link, pen, fresh) {
                    (Link::Stay(way), ..) => way.end().dist(b) < way.end().dist(a),
                    (_, Some(p), false) => p.dist(b) < p.dist(a),
                    _ => false,
                };
            let ends = if flip { [b, a] } else { [a, b] };
            if let Ok(path) = Path2::polyline(&ends, false) {
                passes.push(Pass { path, role: Role::Clear, link });
                fresh = false;
            }
            at = Some(row);
        }
    }

    /// Pieces of parallel lines in the room, bottom to top.
    fn rows(&self, room: &Region, walls: bool) -> Vec<Vec<(P2, P2)>> {
        let b = room.bounds();
        let height = b.max.y - b.min.y;
        let count = (height / self.step - 1e-9).ceil().max(1.0);
        let pitch = height / count;
        let (from, to) = if walls { (1, count as usize) } else { (0, count as usize + 1) };
        (from..to).map(|i| chords(room, b.min.y + pitch * i as f64, &b)).collect()
    }

    /// The piece of an adjacent line that can be reached at depth.
    fn neighbour(&self, rows: &[Vec<(P2, P2)>], row: usize, pen: P2, one_way: bool, room: &Region) -> Option<(usize, usize, Path2)> {
        if one_way {
            return None;
        }
        for next in [Some(row + 1), row.checked_sub(1), Some(row)].into_iter().flatten() {
            let mut ends: Vec<(f64, usize, P2)> = Vec::new();
            for (i, &(a, b)) in rows.get(next).into_iter().flatten().enumerate() {
                ends.push((pen.dist(a), i, a));
                ends.push((pen.dist(b), i, b));
            }
            ends.sort_by(|l, r| l.0.total_cmp(&r.0).then(l.1.cmp(&r.1)));
            for (d, i, q) in ends.into_iter().take(2) {
                if d > 10.0 * self.step {
                    continue;
                }
                if let Some(way) = self.along_wall(room, pen, q, d) {
                    return Some((next, i, way));
                }
            }
        }
        None
    }

    /// Straight if that is short and free, else along the wall.
    fn along_wall(&self, room: &Region, p: P2, q: P2, d: f64) -> Option<Path2> {
        if d <= 2.5 * self.step && self.fits(p, q) {
            return Path2::polyline(&[p, q], false).ok();
        }
        for wall in room.loops() {
            if wall.dist(p) > 1e-5 || wall.dist(q) > 1e-5 {
                continue;
            }
            let ((i, t), (j, u)) = (wall.nearest(p), wall.nearest(q));
            let total = wall.length();
            let way = (wall.length_to(j, u) - wall.length_to(i, t)).rem_euclid(total);
            let path = if way <= total - way {
                wall.starting_at(i, t).part(0.0, way)
            } else {
                wall.starting_at(j, u).part(0.0, total - way).map(|w| w.reversed())
            };
            let path = path?;
            if path.length() <= 2.0 * d + self.step {
                let snapped = snap(path, p, q)?;
                return Some(snapped);
            }
        }
        None
    }

    // Ways between passes ---------------------------------------------------------------------------------------------

    fn fits(&self, p: P2, q: P2) -> bool {
        segment_fits(self.region, p, q, self.inset)
    }

    /// At depth if the way is free of walls and short, or through what is already empty.
    fn way(&self, p: P2, q: P2, empty: &[Region]) -> Link {
        let d = p.dist(q);
        if d <= 1e-6 {
            return Path2::polyline(&[p, q], false).map_or(Link::Stay(Path2 { segs: Vec::new(), closed: false }), Link::Stay);
        }
        let short = 2.5 * self.step;
        let uncut = if d <= short { 0.0 } else { uncut_length(p, q, empty, self.step * 0.25) };
        if uncut <= short && self.fits(p, q) {
            if let Ok(way) = Path2::polyline(&[p, q], false) {
                return Link::Stay(way);
            }
        }
        Link::Retract
    }
}

struct Done {
    pen: Option<P2>,
    passes: Vec<Pass>,
    areas: Vec<Region>,
}

fn uncut_length(p: P2, q: P2, empty: &[Region], step: f64) -> f64 {
    let d = p.dist(q);
    let n = (d / step).ceil().clamp(1.0, 1e4);
    let uncut = (0..n as usize).filter(|&i| {
        let at = p.lerp(q, (i as f64 + 0.5) / n);
        !empty.iter().any(|r| r.contains(at))
    });
    uncut.count() as f64 * d / n
}

/// Does the whole straight way keep at least `d` from every curve of the region?
pub(crate) fn segment_fits(region: &Region, p: P2, q: P2, d: f64) -> bool {
    let line = Seg::Line { a: p, b: q };
    let reach = Bounds::of(p, q).grown(d);
    let tol = 1e-5;
    region.contains(p.lerp(q, 0.5))
        && region.loops().flat_map(Path2::segs).all(|s| !reach.overlaps(&s.bounds()) || line_gap(&line, s) >= d - tol)
}

/// Shortest distance between a line and another segment.
fn line_gap(line: &Seg, s: &Seg) -> f64 {
    let mut hits = Vec::new();
    crate::offset::intersections(line, s, &mut hits);
    if !hits.is_empty() {
        return 0.0;
    }
    let mut gap = s.dist(line.a()).min(s.dist(line.b())).min(line.dist(s.a())).min(line.dist(s.b()));
    if let Seg::Arc { c, .. } = *s {
        gap = gap.min(s.dist(line.at(line.nearest(c))));
    }
    gap
}

fn first_hit(ray: &Seg, path: &Path2) -> Option<P2> {
    let mut hits = Vec::new();
    for s in path.segs() {
        crate::offset::intersections(ray, s, &mut hits);
    }
    hits.into_iter().filter(|p| p.dist(ray.a()) > 1e-6).min_by(|l, r| l.dist(ray.a()).total_cmp(&r.dist(ray.a())))
}

fn home_of(nodes: &mut [Node], p: P2) -> Option<&mut Node> {
    let i = nodes.iter().position(|n| n.area.contains(p)).or_else(|| {
        // A degenerate part contains nothing: the nearest one then.
        let near = nodes.iter().enumerate().min_by(|l, r| l.1.area.dist(p).total_cmp(&r.1.area.dist(p)));
        near.map(|(i, _)| i)
    })?;
    nodes.get_mut(i)
}

/// The curves of a room, the outline first. One that runs out and back on the same line is taken once.
pub(crate) fn curves(room: &Region) -> Vec<Path2> {
    room.loops().map(|l| one_way(l).unwrap_or_else(|| l.clone())).collect()
}

fn one_way(l: &Path2) -> Option<Path2> {
    let length = l.length();
    if l.area().abs() > 1e-6 * length || length < 1e-3 {
        return None;
    }
    let n = l.segs().len();
    let turns: Vec<usize> = (0..n).filter(|&i| l.segs()[i].tangent(1.0).dot(l.segs()[(i + 1) % n].tangent(0.0)) < -0.99).collect();
    let &[i, j] = turns.as_slice() else { return None };
    let half: Vec<Seg> = l.segs()[i + 1..=j].to_vec();
    let path = Path2 { segs: half, closed: false };
    ((path.length() - 0.5 * length).abs() < 1e-4).then_some(path)
}

/// A closed curve begins in the middle of its longest segment (a spiral: at a corner, if it has one).
fn start_at_side(path: &Path2, corner: bool) -> Path2 {
    if !path.is_closed() {
        return path.clone();
    }
    let n = path.segs().len();
    let bend = |i: usize| path.segs()[(i + n - 1) % n].tangent(1.0).cross(path.segs()[i].tangent(0.0)).abs() > 0.1;
    if corner {
        if let Some(i) = (0..n).find(|&i| bend(i)) {
            return path.starting_at(i, 0.0);
        }
    }
    let longest = (0..n).max_by(|&l, &r| path.segs()[l].len().total_cmp(&path.segs()[r].len()).then(r.cmp(&l)));
    longest.map_or_else(|| path.clone(), |i| path.starting_at(i, 0.5))
}

fn nearer_end(path: Path2, p: P2) -> Path2 {
    if path.end().dist(p) < path.start().dist(p) { path.reversed() } else { path }
}

fn rotated(p: Pass, angle: f64) -> Pass {
    let link = match p.link {
        Link::Stay(way) => Link::Stay(way.rotated(angle)),
        Link::Retract => Link::Retract,
    };
    Pass { path: p.path.rotated(angle), role: p.role, link }
}

fn snap(path: Path2, p: P2, q: P2) -> Option<Path2> {
    let mut segs = path.segs;
    let first = segs.first_mut()?;
    *first = crate::path::with_start(*first, p);
    let last = segs.last_mut()?;
    *last = crate::path::with_end(*last, q);
    Some(Path2 { segs, closed: false })
}

/// The nearest piece that is left: on the first row that has any, or nearest to the pen in the rows after it.
fn next_row(rows: &[Vec<(P2, P2)>], at: Option<usize>, pen: Option<P2>) -> Option<(usize, usize)> {
    let first = rows.iter().position(|r| !r.is_empty())?;
    let row = at.map(|r| r + 1).filter(|&r| rows.get(r).is_some_and(|r| !r.is_empty())).filter(|_| pen.is_none()).unwrap_or(first);
    let near = |&(a, b): &(P2, P2)| pen.map_or(a.x, |p| p.dist(a).min(p.dist(b)));
    let i = (0..rows[row].len()).min_by(|&l, &r| near(&rows[row][l]).total_cmp(&near(&rows[row][r])))?;
    Some((row, i))
}

/// The pieces of the line at height `y` inside a region, left to right.
pub(crate) fn chords(room: &Region, y: f64, b: &Bounds) -> Vec<(P2, P2)> {
    // A hair off, so that the line never runs through a corner or along a side; further off if rounding hides a
    // crossing.
    let inside = y.clamp(b.min.y + 1e-6, (b.max.y - 1e-6).max(b.min.y + 1e-6));
    for hair in [3.3e-8, -4.7e-8, 1.9e-7, -2.3e-7] {
        let mut xs = Vec::new();
        for s in room.loops().flat_map(Path2::segs) {
            crossings(s, inside + hair, &mut xs);
        }
        if xs.len() % 2 == 0 {
            xs.sort_by(f64::total_cmp);
            let pairs = xs.chunks_exact(2).filter(|c| c[1] - c[0] > 1e-3);
            let pairs = pairs.filter(|c| room.contains(P2::new((c[0] + c[1]) * 0.5, inside + hair)));
            return pairs.map(|c| (P2::new(c[0], y), P2::new(c[1], y))).collect();
        }
    }
    Vec::new()
}

fn crossings(s: &Seg, y: f64, xs: &mut Vec<f64>) {
    match *s {
        Seg::Line { a, b } => {
            if (a.y > y) != (b.y > y) {
                xs.push(a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)));
            }
        }
        Seg::Arc { a, c, .. } => {
            let r = a.dist(c);
            let h = y - c.y;
            if h.abs() >= r {
                return;
            }
            let half = (r * r - h * h).sqrt();
            for x in [c.x - half, c.x + half] {
                if on_arc(s, P2::new(x, y)) {
                    xs.push(x);
                }
            }
        }
    }
}

/// Is a point of its circle on the arc? Decided by the side of the chord, so that neighbouring segments agree about
/// their common end.
fn on_arc(s: &Seg, p: P2) -> bool {
    let Seg::Arc { a, b, sweep, .. } = *s else { return false };
    let side = (b - a).cross(p - a);
    if sweep > 0.0 { side < 0.0 } else { side > 0.0 }
}
