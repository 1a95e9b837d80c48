//! The trajectory generator of S. N. Rea Minango, *Aplicação em robótica do padrão STEP-NC na geração de
//! trajetórias de usinagem*, Universidade Federal de Santa Catarina, 2016: a list of points per workingstep,
//! spaced by the tool diameter, that its published rows and counts fix. It works in millimetres of overlap,
//! begins with a layer at depth 0, makes circles of forty chords, ignores allowances and setups, and starts and
//! ends every workingstep at one point of the security plane: all of that is repeated here.

use gr_ir::{Builder, Marker, Op, Program, Source};
use gr_text::{Diagnostic, FileId, LineIndex, code};

use crate::frame::{Frame, scale};
use crate::process::*;

const NAME: &str = "ufsc2016";
/// A circle is this many chords.
const SIDES: u32 = 40;
/// Lengths below this are none.
const TINY: f64 = 1e-9;
/// More points than this are a mistake.
const MOST: usize = 5_000_000;

/// A point of the trajectory, in the frame of the part.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Point {
    /// Workingstep.
    pub step: u64,
    /// Position, mm.
    pub at: [f64; 3],
    /// Unit vector from the shank to the tip.
    pub axis: [f64; 3],
    /// What the point is for.
    pub kind: Kind,
}

/// What points are for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// On the security plane.
    Security,
    /// Above the material.
    Air,
    /// Cutting.
    Cut,
}

type P = [f64; 2];

/// A pass: where it begins and where it goes.
struct Pass {
    start: P,
    points: Vec<P>,
}

/// Points of all executed workingsteps.
///
/// # Errors
/// What the system had no rule for.
pub fn points(process: &Process, file: FileId) -> Result<Vec<Point>, Vec<Diagnostic>> {
    let mut out = Vec::new();
    let mut faults = Vec::new();
    for step in process.steps() {
        if let Err(what) = workingstep(step, &mut out) {
            faults.push(Diagnostic::new(code::REFERENCE_REFUSED, file, step.origin.span, &[NAME.to_string(), what]));
        }
    }
    if faults.is_empty() { Ok(out) } else { Err(faults) }
}

/// The points as motion: one operation each, rapid where nothing is cut. Tools are changed as the system did,
/// with every workingstep that needs another one; spindle and coolant it left to the robot.
pub fn program(points: &[Point], process: &Process, lines: &LineIndex, file: FileId, name: &str) -> Program {
    let mut b = Builder::new();
    b.file(file, name);
    b.push(Op::Units(gr_ir::Units::Mm), Source { file, ..Source::default() });
    let mut tool = None;
    for step in process.steps() {
        let source = Source { file, line: lines.position(step.origin.span.start).0, ..Source::default() };
        let code = i32::try_from(step.origin.id).unwrap_or(i32::MAX);
        b.push(Op::Begin { marker: Marker::Workingstep, code, text: &step.name }, source);
        if tool.replace(step.operation.tool.number) != Some(step.operation.tool.number) {
            let number = i32::try_from(step.operation.tool.number).unwrap_or(i32::MAX);
            for op in [Op::ToolPrepare(number), Op::ToolChangeStart, Op::ToolChange(number)] {
                b.push(op, source);
            }
        }
        if let Some(feed) = step.operation.technology.feed {
            b.push(Op::Feed { linear: feed, angular: feed.to_radians() }, source);
        }
        for p in points.iter().filter(|p| p.step == step.origin.id) {
            let mut pose = *b.pose();
            pose.axes[..3].copy_from_slice(&p.at.map(|c| c + 0.0));
            pose.tool_axis = Some(scale(p.axis, -1.0).map(|c| c + 0.0));
            b.push_to(if p.kind == Kind::Cut { Op::Linear } else { Op::Rapid }, &pose, source);
        }
        b.push(Op::Close(Marker::Workingstep), source);
    }
    b.push(Op::End, Source { file, ..Source::default() });
    b.finish()
}

fn workingstep(step: &Workingstep, out: &mut Vec<Point>) -> Result<(), String> {
    // Setups are ignored: points are in the frame of the part.
    let frame = step.feature.placement;
    let h = step.operation.retract.ok_or("an operation without a retract plane")?;
    let mut w = Writer { out, step: step.origin.id, frame, security: step.security.point };
    match &step.operation.kind {
        OperationKind::Drill(d) => {
            let depth = d.depth.unwrap_or(step.feature.depth);
            w.security();
            drill(&mut w, depth, d, h);
            w.security();
            Ok(())
        }
        OperationKind::Mill(m) => {
            let passes = passes(step, m)?;
            let axial = m.axial.filter(|a| *a > TINY).ok_or("an operation without an axial depth")?;
            let depths = layers(step.feature.depth, axial)?;
            let all: usize = passes.iter().map(|p| p.points.len() + 3).sum();
            if all.saturating_mul(depths.len()) > MOST {
                return Err("so many points".into());
            }
            w.security();
            for z in depths {
                for p in &passes {
                    w.add(p.start, h - z, Kind::Air);
                    w.add(p.start, -z, Kind::Cut);
                    let mut end = p.start;
                    for q in &p.points {
                        w.add(*q, -z, Kind::Cut);
                        end = *q;
                    }
                    w.add(end, h - z, Kind::Air);
                }
            }
            w.add(passes[0].start, h, Kind::Air);
            w.security();
            Ok(())
        }
        OperationKind::Other => Err(step.operation.keyword.clone()),
    }
}

struct Writer<'a> {
    out: &'a mut Vec<Point>,
    step: u64,
    frame: Frame,
    security: [f64; 3],
}

impl Writer<'_> {
    fn security(&mut self) {
        let (step, at, axis) = (self.step, self.security, scale(self.frame.z, -1.0));
        self.out.push(Point { step, at, axis, kind: Kind::Security });
    }
    fn add(&mut self, p: P, z: f64, kind: Kind) {
        let at = self.frame.point([p[0], p[1], z]);
        self.out.push(Point { step: self.step, at, axis: scale(self.frame.z, -1.0), kind });
    }
}

/// Down and up; with stretches at start and end, pecks at their limits.
fn drill(w: &mut Writer<'_>, depth: f64, d: &Drilling, h: f64) {
    let mut pecks = Vec::new();
    pecks.extend(d.first.map(|f| f.length));
    pecks.extend(d.last.map(|l| depth - l.length));
    pecks.push(depth);
    w.add([0.0; 2], h, Kind::Air);
    w.add([0.0; 2], 0.0, Kind::Cut);
    for z in pecks {
        w.add([0.0; 2], -z, Kind::Cut);
        w.add([0.0; 2], 0.0, Kind::Cut);
    }
    w.add([0.0; 2], h, Kind::Air);
    w.add([0.0; 2], h, Kind::Air);
}

/// 0, a, 2a … and the full depth.
fn layers(depth: f64, axial: f64) -> Result<Vec<f64>, String> {
    if depth / axial > 100_000.0 {
        return Err("so many layers".into());
    }
    let mut out = Vec::new();
    let mut k = 0.0;
    while k * axial < depth - TINY {
        out.push(k * axial);
        k += 1.0;
    }
    out.push(depth);
    Ok(out)
}

fn passes(step: &Workingstep, m: &Milling) -> Result<Vec<Pass>, String> {
    let d = step.operation.tool.diameter;
    let strategy = m.strategy.as_ref().ok_or("milling without a strategy")?;
    // The overlap is millimetres here.
    let by = d - strategy.overlap.unwrap_or(0.0);
    if !(by > TINY) || !(d > TINY) {
        return Err("a step over that is not above zero".into());
    }
    let r = d / 2.0;
    let area = Area::of(&step.feature, r, by, m)?;
    let lines = |from: Option<P>| area.lines(strategy, by, d, from);
    Ok(match strategy.keyword.as_str() {
        "CONTOUR_PARALLEL" => vec![area.parallel(d)?],
        "CONTOUR_SPIRAL" => vec![area.spiral(d)?],
        "UNIDIRECTIONAL" => vec![area.one_way(strategy, by, d)?],
        "BIDIRECTIONAL" => vec![lines(None)?],
        "CONTOUR_BIDIRECTIONAL" => vec![area.single(d)?, area.published_lines(by, d)?],
        "BIDIRECTIONAL_CONTOUR" => vec![lines(None)?, area.single(d)?],
        other => return Err(format!("strategy {other}")),
    })
}

/// What the tool centre may reach: contours from the wall inwards.
struct Area {
    /// Closed, first vertex is the start.
    contours: Vec<Vec<P>>,
    /// A last point in the middle.
    centre: Option<P>,
    /// Whether lines are only limited by the contour (rather than a face).
    face: bool,
}

impl Area {
    fn of(feature: &Feature, r: f64, by: f64, m: &Milling) -> Result<Area, String> {
        let _ = m;
        match &feature.shape {
            Shape::Face { length, direction, width, across, .. } => {
                let at = |u: f64, v: f64| [direction[0] * u + across[0] * v, direction[1] * u + across[1] * v];
                let corners = vec![at(r, width - r), at(length - r, width - r), at(length - r, r), at(r, r)];
                if *length < 2.0 * r || *width < 2.0 * r {
                    return Err("a face narrower than its tool".into());
                }
                Ok(Area { contours: vec![corners], centre: None, face: true })
            }
            Shape::Pocket { boundary, .. } => match boundary {
                // Placements of profiles are ignored.
                Closed::Rectangle { length, width, .. } => Area::rectangle(*length, *width, r, by),
                Closed::Circle { diameter, .. } => Ok(Area::ngon(diameter / 2.0, SIDES, false, r, by)),
                Closed::Ngon { diameter, sides, across_flats, .. } => {
                    // Circumscribed about a circle of the diameter, or inscribed in it.
                    Ok(Area::ngon(diameter / 2.0, *sides, *across_flats, r, by))
                }
                Closed::General(c) => Area::polygon(c, r, by),
            },
            Shape::Hole { diameter, .. } => Ok(Area::ngon(diameter / 2.0, SIDES, false, r, by)),
            _ => Err(feature.keyword.clone()),
        }
    }

    /// Counter-clockwise from the lower left corner; a middle point if there is room for it.
    fn rectangle(length: f64, width: f64, r: f64, by: f64) -> Result<Area, String> {
        let (mut x, mut y) = (length / 2.0 - r, width / 2.0 - r);
        let mut contours = Vec::new();
        let mut last = 0.0;
        while x >= -TINY && y >= -TINY {
            let (a, b) = (x.max(0.0), y.max(0.0));
            contours.push(vec![[-a, -b], [a, -b], [a, b], [-a, b]]);
            last = x.min(y);
            (x, y) = (x - by, y - by);
        }
        if contours.is_empty() {
            return Err("a pocket narrower than its tool".into());
        }
        Ok(Area { contours, centre: (last > r).then_some([0.0; 2]), face: false })
    }

    /// A regular polygon; its edges are offset, so vertices come in by more.
    fn ngon(radius: f64, sides: u32, circumscribed: bool, r: f64, by: f64) -> Area {
        let n = f64::from(sides.clamp(3, 10_000));
        let half = std::f64::consts::PI / n;
        let corner = if circumscribed { radius / libm::cos(half) } else { radius };
        let mut contours = Vec::new();
        let (mut j, mut last) = (0.0, None);
        // A circle is left out where the tool fills it; a polygon where no room is left between its edges.
        while radius - r - j * by > TINY {
            let at = corner - (r + j * by) / libm::cos(half);
            if at < -TINY {
                break;
            }
            let vertex = |k: u32| {
                let t = -std::f64::consts::FRAC_PI_2 - half + 2.0 * half * f64::from(k);
                [at * libm::cos(t), at * libm::sin(t)]
            };
            contours.push((0..sides.clamp(3, 10_000)).map(vertex).collect());
            last = Some(at);
            j += 1.0;
        }
        let centre = if contours.is_empty() { Some([0.0; 2]) } else { last.filter(|l| *l > r).map(|_| [0.0; 2]) };
        Area { contours, centre, face: false }
    }

    /// A convex polygon in the order of its vertices; contours that shrink to a line are kept once.
    fn polygon(contour: &Contour, r: f64, by: f64) -> Result<Area, String> {
        if contour.points.iter().any(|p| p[2] != 0.0) {
            return Err("a pocket with arcs".into());
        }
        let points: Vec<P> = contour.points.iter().map(|p| [p[0], p[1]]).collect();
        let mut contours = Vec::new();
        let mut j = 0.0;
        while let Some(c) = inset(&points, r + j * by) {
            contours.push(c);
            j += 1.0;
            if j > 100_000.0 {
                return Err("so many contours".into());
            }
        }
        if contours.is_empty() { Err("a pocket narrower than its tool".into()) } else { Ok(Area { contours, centre: None, face: false }) }
    }

    /// All contours, inwards.
    fn parallel(&self, d: f64) -> Result<Pass, String> {
        let Some(first) = self.contours.first() else {
            return Ok(Pass { start: self.centre.unwrap_or_default(), points: Vec::new() });
        };
        let mut points = Vec::new();
        let mut at = first[0];
        for c in &self.contours {
            for p in c.iter().copied().skip(usize::from(points.is_empty() && at == c[0])).chain([c[0]]) {
                points.extend(densify(at, p, d));
                at = p;
            }
        }
        if let Some(c) = self.centre {
            points.extend(densify(at, c, d));
        }
        Ok(Pass { start: first[0], points })
    }

    /// The outermost contour.
    fn single(&self, d: f64) -> Result<Pass, String> {
        let c = self.contours.first().ok_or("a pocket narrower than its tool")?;
        let mut points = Vec::new();
        let mut at = c[0];
        for p in c.iter().copied().skip(1).chain([c[0]]) {
            points.extend(densify(at, p, d));
            at = p;
        }
        Ok(Pass { start: c[0], points })
    }

    /// Contours joined by lengthening the last side of each towards the next.
    fn spiral(&self, d: f64) -> Result<Pass, String> {
        let first = self.contours.first().ok_or("a pocket narrower than its tool")?;
        let mut points = Vec::new();
        let mut at = first[0];
        for (i, c) in self.contours.iter().enumerate() {
            for p in c.iter().copied().skip(1) {
                points.extend(densify(at, p, d));
                at = p;
            }
            // Back towards the start, but only as far as the next contour begins.
            let target = match self.contours.get(i + 1) {
                Some(next) => nearest_on(at, c[0], next[0]),
                None => c[0],
            };
            points.extend(densify(at, target, d));
            at = target;
        }
        if let Some(c) = self.centre {
            points.extend(densify(at, c, d));
        }
        Ok(Pass { start: first[0], points })
    }

    fn strokes(&self, strategy: &Strategy, by: f64) -> Result<Vec<[P; 2]>, String> {
        let c = self.contours.first().ok_or("a pocket narrower than its tool")?;
        let feed = match strategy.feed {
            Some(f) => f,
            None if self.face => {
                let (a, b) = (c[0], c[1]);
                [b[0] - a[0], b[1] - a[1]]
            }
            None => [1.0, 0.0],
        };
        let length = libm::hypot(feed[0], feed[1]);
        if length < TINY {
            return Err("a feed direction of no length".into());
        }
        let u = [feed[0] / length, feed[1] / length];
        // To the left of the feed, or to the right.
        let left = strategy.step_left.unwrap_or(true);
        let v = if left { [-u[1], u[0]] } else { [u[1], -u[0]] };
        let across = |p: &P| p[0] * v[0] + p[1] * v[1];
        let (low, high) = c.iter().map(across).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s), h.max(s)));
        let mut at = low;
        let mut out = Vec::new();
        while at < high - TINY {
            out.extend(stroke(c, u, v, at));
            at += by;
            if out.len() > 100_000 {
                return Err("so many lines".into());
            }
        }
        out.extend(stroke(c, u, v, high));
        Ok(out)
    }

    /// Lines to and fro.
    fn lines(&self, strategy: &Strategy, by: f64, d: f64, from: Option<P>) -> Result<Pass, String> {
        let _ = from;
        let strokes = self.strokes(strategy, by)?;
        let first = strokes.first().ok_or("an area without lines")?;
        let start = first[0];
        let mut points = Vec::new();
        let mut at = start;
        for (i, s) in strokes.iter().enumerate() {
            let [a, b] = if i % 2 == 0 { *s } else { [s[1], s[0]] };
            points.extend(densify(at, a, d));
            points.extend(densify(a, b, d));
            at = b;
        }
        Ok(Pass { start, points })
    }

    /// Lines one way; back at the same depth.
    fn one_way(&self, strategy: &Strategy, by: f64, d: f64) -> Result<Pass, String> {
        let strokes = self.strokes(strategy, by)?;
        let start = strokes.first().ok_or("an area without lines")?[0];
        let mut points = Vec::new();
        let mut at = start;
        for [a, b] in strokes {
            points.extend(densify(at, a, d));
            points.extend(densify(a, b, d));
            at = b;
        }
        Ok(Pass { start, points })
    }

    /// The lines inside the contour as published: after the second line the path jumps back, takes its next step
    /// twice and goes on the same way as the line before.
    fn published_lines(&self, by: f64, d: f64) -> Result<Pass, String> {
        let c = self.contours.first().ok_or("a pocket narrower than its tool")?;
        let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for p in c {
            for i in 0..2 {
                low[i] = low[i].min(p[i]);
                high[i] = high[i].max(p[i]);
            }
        }
        let (left, right) = (low[0], high[0]);
        let start = [left, low[1]];
        let mut points = Vec::new();
        let mut at = start;
        let mut go = |to: P, points: &mut Vec<P>, dense: bool| {
            if dense {
                points.extend(densify(at, to, d));
            } else {
                points.push(to);
            }
            at = to;
        };
        let mut y = low[1];
        let mut line = 0;
        let mut rightwards = true;
        loop {
            let (from, to) = if rightwards { (left, right) } else { (right, left) };
            go([to, y], &mut points, true);
            line += 1;
            if y >= high[1] - TINY {
                break;
            }
            let next = (y + by).min(high[1]);
            if line == 2 {
                go([from, y], &mut points, false);
                go([from, next], &mut points, false);
                go([from, next], &mut points, false);
            } else {
                go([to, next], &mut points, true);
                rightwards = !rightwards;
            }
            y = next;
            if line > 100_000 {
                return Err("so many lines".into());
            }
        }
        Ok(Pass { start, points })
    }
}

/// Where the line at distance `at` along `v` crosses the polygon: from its first to its last crossing along `u`.
fn stroke(c: &[P], u: P, v: P, at: f64) -> Option<[P; 2]> {
    let along = |p: P| p[0] * u[0] + p[1] * u[1];
    let across = |p: P| p[0] * v[0] + p[1] * v[1];
    let mut hits = Vec::new();
    for i in 0..c.len() {
        let (a, b) = (c[i], c[(i + 1) % c.len()]);
        let (x, y) = (across(a) - at, across(b) - at);
        if x.abs() < TINY {
            hits.push(along(a));
        }
        if x * y < 0.0 && x.abs() >= TINY && y.abs() >= TINY {
            let t = x / (x - y);
            hits.push(along(a) + t * (along(b) - along(a)));
        }
    }
    let low = hits.iter().copied().fold(f64::INFINITY, f64::min);
    let high = hits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let p = |s: f64| [u[0] * s + v[0] * at, u[1] * s + v[1] * at];
    (low <= high).then(|| [p(low), p(high)])
}

fn nearest_on(a: P, b: P, p: P) -> P {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let l2 = dx * dx + dy * dy;
    if l2 < TINY {
        return b;
    }
    let t = (((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / l2).clamp(0.0, 1.0);
    [a[0] + t * dx, a[1] + t * dy]
}

/// Vertices of a convex polygon with every edge moved in by `d`; `None` where nothing is left. Edges that shrink
/// to nothing keep both their vertices, on the same place.
fn inset(points: &[P], d: f64) -> Option<Vec<P>> {
    let n = points.len();
    let doubled: f64 = (0..n).map(|i| points[i][0] * points[(i + 1) % n][1] - points[(i + 1) % n][0] * points[i][1]).sum();
    let side = if doubled > 0.0 { 1.0 } else { -1.0 };
    let direction = |i: usize| {
        let (a, b) = (points[i % n], points[(i + 1) % n]);
        let l = libm::hypot(b[0] - a[0], b[1] - a[1]);
        [(b[0] - a[0]) / l, (b[1] - a[1]) / l]
    };
    let mut out = Vec::with_capacity(n);
    for i in 0..n {
        let (before, after) = (direction(i + n - 1), direction(i));
        let sine = (before[0] * after[1] - before[1] * after[0]) * side;
        if !(sine > 1e-12) {
            return None;
        }
        // The bisector, scaled so that both edges move by d.
        let (m, k) = ([-before[1] * side, before[0] * side], [-after[1] * side, after[0] * side]);
        let s = d / (1.0 + m[0] * k[0] + m[1] * k[1]);
        out.push([points[i][0] + (m[0] + k[0]) * s, points[i][1] + (m[1] + k[1]) * s]);
    }
    // An edge that turned round is gone, and with it the contour.
    let ok = (0..n).all(|i| {
        let (a, b, u) = (out[i], out[(i + 1) % n], direction(i));
        (b[0] - a[0]) * u[0] + (b[1] - a[1]) * u[1] >= -TINY
    });
    ok.then_some(out)
}

/// Points after `a` up to `b`: full steps first, the remainder last.
fn densify(a: P, b: P, by: f64) -> Vec<P> {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let l = libm::hypot(dx, dy);
    if l < TINY {
        return Vec::new();
    }
    let n = (l / by + TINY).floor();
    let mut out: Vec<P> = (1..=n.min(1e6) as u32).map(|k| [a[0] + dx * (f64::from(k) * by / l), a[1] + dy * (f64::from(k) * by / l)]).collect();
    if l - n * by > TINY {
        out.push(b);
    }
    out
}

/// Placements of Table 5.1: from the frame of the part to the base of the robot.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Placement {
    /// Robot to table.
    pub table: [f64; 3],
    /// Table to part.
    pub part: [f64; 3],
    /// Rotations about X, Y, Z, degrees.
    pub rotation: [f64; 3],
}

impl Placement {
    /// A point of the part, seen from the robot's base: turned first, then moved.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        let mut q = p;
        for (axis, angle) in self.rotation.iter().enumerate() {
            let (s, c) = (libm::sin(angle.to_radians()), libm::cos(angle.to_radians()));
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            (q[i], q[j]) = (q[i] * c - q[j] * s, q[i] * s + q[j] * c);
        }
        std::array::from_fn(|i| q[i] + self.table[i] + self.part[i])
    }
}
