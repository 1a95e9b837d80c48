//! Contours for the radius compensation of the control: passes that follow a wall become the contour beside which
//! LinuxCNC (G41, G42) keeps the tool, so that it makes exactly the motion of the plan. This is not compensation
//! itself, that is the control's; what it would do another way stays the path of the tool's centre.
//!
//! LinuxCNC enters compensation on a straight move that is longer than the radius and ends beside its end, square to it;
//! joins moves of the same direction as they are (turns below 0.05 rad count as none); cuts inside corners to where
//! the tool touches both sides, and goes round outside corners on an arc of the tool's radius. Source: LinuxCNC
//! documentation, "Cutter compensation".

use gr_ir::geometry::ArcShape;
use gr_ir::{Arc, ArcPlane, Builder, Marker, Op, Plane, Pose, Program, Source, Step};

/// The program with contours, and what stayed as it was.
pub(super) struct Contours {
    pub program: Program,
    pub left: Vec<(Source, String)>,
}

/// Turns below this are none, rad.
const STRAIGHT: f64 = 1e-5;
/// Turns above this are corners for the control too, rad.
const CORNER: f64 = 0.06;
/// Points closer than this are one, mm.
const SAME: f64 = 1e-6;
/// Smallest radius of an arc of a contour, mm.
const SMALLEST: f64 = 1e-3;
/// Begins the way to a contour.
pub(super) const WAY_IN: i32 = 0;
/// The way in is longer than the radius by this factor, and this much, mm.
const LONGER: (f64, f64) = (1.5, 1.0);

type P = [f64; 2];
type Done<T> = Result<T, &'static str>;

fn add(a: P, b: P, by: f64) -> P {
    [a[0] + b[0] * by, a[1] + b[1] * by]
}
fn dot(a: P, b: P) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
fn cross(a: P, b: P) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}
fn distance(a: P, b: P) -> f64 {
    libm::hypot(b[0] - a[0], b[1] - a[1])
}
fn left(t: P) -> P {
    [-t[1], t[0]]
}
fn flat(pose: &Pose) -> P {
    [pose.axes[0], pose.axes[1]]
}
fn put(pose: &Pose, at: P) -> Pose {
    let mut pose = *pose;
    (pose.axes[0], pose.axes[1]) = (at[0], at[1]);
    pose
}
fn upright(s: &Step<'_>) -> bool {
    matches!(s.op, Op::Rapid | Op::Linear) && flat(&s.start) == flat(&s.end)
}
/// Fed across, in the XY plane.
fn across(s: &Step<'_>) -> bool {
    match s.op {
        Op::Linear => flat(&s.start) != flat(&s.end),
        Op::Arc(Arc { plane, .. }) => plane == ArcPlane::Work(Plane::Xy),
        _ => false,
    }
}
/// Whether some move across goes back on the one before.
fn turns_back(steps: &[Step<'_>]) -> bool {
    let heading = |s: &Step<'_>, end: bool| -> P {
        let Op::Arc(arc) = s.op else { return [s.end.axes[0] - s.start.axes[0], s.end.axes[1] - s.start.axes[1]] };
        let shape = ArcShape::new(&arc, &s.start, &s.end);
        let p = flat(if end { &s.end } else { &s.start });
        add([0.0; 2], left([p[0] - shape.center[0], p[1] - shape.center[1]]), shape.sweep.signum())
    };
    let moves: Vec<&Step<'_>> = steps.iter().skip(1).filter(|s| across(s)).collect();
    moves.windows(2).any(|w| {
        let (t, u) = (heading(w[0], true), heading(w[1], false));
        libm::atan2(cross(t, u), dot(t, u)).abs() > std::f64::consts::PI - CORNER
    })
}
/// What may stand between the moves of a contour.
fn quiet(op: &Op<'_>) -> bool {
    matches!(
        op,
        Op::Feed { .. }
            | Op::SpindleSpeed { .. }
            | Op::SpindleTurn { .. }
            | Op::Mist(_)
            | Op::Flood(_)
            | Op::Note(gr_ir::Note::Comment, _)
            | Op::Override(..)
    )
}

/// Contours beside the walls of a plan.
pub(super) fn contours(program: &Program) -> Contours {
    let mut out = Builder::from_state(*program.start(), *program.start_state());
    out.names_of(program);
    let mut left = Vec::new();
    let mut section: Option<Section<'_>> = None;
    let mut work = Work::default();
    for step in program.steps() {
        match (step.op, &mut section) {
            (Op::Begin { marker: Marker::Contour, code, text }, _) => {
                let radius = text.parse().unwrap_or(0.0);
                section = Some(Section { code, radius, source: step.source, steps: Vec::new() });
                work.walls = true;
            }
            (Op::Close(Marker::Contour), _) => {
                if let Some(s) = section.take() {
                    left.extend(s.write(&mut out).map(|why| (s.source, why)));
                }
            }
            (_, Some(s)) => s.steps.push(step),
            _ => {
                left.extend(work.follow(&step));
                out.push_to(step.op, &step.end, step.source);
            }
        }
    }
    for step in section.iter().flat_map(|s| &s.steps) {
        out.push_to(step.op, &step.end, step.source);
    }
    if !work.any && !work.walls {
        left.push((Source::default(), "only the workingsteps of a plan say on which side of a path the wall is".into()));
    }
    Contours { program: out.finish(), left }
}

/// What a workingstep is about.
#[derive(Default)]
struct Work {
    /// There are workingsteps at all.
    any: bool,
    source: Source,
    walls: bool,
    mills: bool,
}

impl Work {
    /// What is to be said of a workingstep that mills and follows no wall alone.
    fn follow(&mut self, step: &Step<'_>) -> Option<(Source, String)> {
        match step.op {
            Op::Begin { marker: Marker::Workingstep, .. } => *self = Work { any: true, source: step.source, walls: false, mills: false },
            Op::Close(Marker::Workingstep) if self.mills && !self.walls => {
                return Some((self.source, "this is no single pass along a wall".into()));
            }
            _ => self.mills |= across(step),
        }
        None
    }
}

/// The passes of one workingstep beside its walls.
struct Section<'p> {
    code: i32,
    radius: f64,
    source: Source,
    steps: Vec<Step<'p>>,
}

/// One pass: its operations, and where those that move across end.
struct Pass {
    /// The rapid to its start, and the first operation behind the pass.
    range: (usize, usize),
    ends: Vec<Option<(P, Option<P>)>>,
    /// Direction of its first move, and where its contour begins.
    heading: P,
    start: P,
}

impl Section<'_> {
    /// Writes it; says why passes stay as they are.
    fn write(&self, out: &mut Builder) -> Option<String> {
        let mut why: Option<&str> = None;
        let (mut passes, mut kept) = (0, 0);
        let high = self.steps.iter().filter(|s| s.op == Op::Rapid).map(|s| s.end.axes[2]).fold(f64::NEG_INFINITY, f64::max);
        let mut i = 0;
        while i < self.steps.len() {
            let Some(first) = self.begins(i) else {
                let s = &self.steps[i];
                out.push_to(s.op, &s.end, s.source);
                i += 1;
                continue;
            };
            passes += 1;
            let (range, whole) = self.range(i, first);
            match whole.and_then(|()| self.pass(range)) {
                Ok(pass) => self.put(out, &pass, high),
                Err(reason) => {
                    (kept, why) = (kept + 1, why.or(Some(reason)));
                    self.steps[range.0..range.1].iter().for_each(|s| out.push_to(s.op, &s.end, s.source));
                }
            }
            i = range.1;
        }
        why.map(|why| if kept < passes { format!("{kept} of {passes} passes: {why}") } else { why.to_string() })
    }

    /// Whether a rapid leads to a pass: the first move across behind it.
    fn begins(&self, i: usize) -> Option<usize> {
        if self.steps[i].op != Op::Rapid {
            return None;
        }
        let rest = self.steps[i + 1..].iter().position(|s| !upright(s) && !quiet(&s.op))?;
        Some(i + 1 + rest).filter(|k| across(&self.steps[*k]))
    }

    /// A pass as far as it goes, with the way up behind it.
    fn range(&self, i: usize, first: usize) -> ((usize, usize), Done<()>) {
        let fed = |s: &Step<'_>| across(s) || upright(s) && s.op == Op::Linear;
        let behind = self.steps[first..].iter().position(|s| !fed(s) && !quiet(&s.op)).map_or(self.steps.len(), |n| first + n);
        let last = (first..behind).rev().find(|k| fed(&self.steps[*k])).unwrap_or(first);
        match self.steps.get(behind) {
            Some(s) if s.op == Op::Rapid && upright(s) && s.end.axes[2] >= s.start.axes[2] => ((i, behind + 1), Ok(())),
            Some(s) if s.op == Op::Rapid => ((i, last + 1), Ok(())),
            None => ((i, last + 1), Ok(())),
            Some(_) => ((i, last + 1), Err("it does more on its way than to move")),
        }
    }

    fn pass(&self, range: (usize, usize)) -> Done<Pass> {
        if !(self.radius > 0.0) {
            return Err("the radius of its tool is not known");
        }
        let on_left = if self.code == 42 { -1.0 } else { 1.0 };
        let steps = &self.steps[range.0..range.1];
        if turns_back(steps) {
            return Err("it goes to and fro, as a way in on a slope does");
        }
        let mut pieces = Vec::new();
        let mut level = true;
        for (k, s) in steps.iter().enumerate().skip(1) {
            if across(s) {
                pieces.push(Piece::new(s, k, on_left * self.radius, level)?);
                level = true;
            } else if upright(s) {
                level = false;
            }
        }
        let (Some(first), Some(last)) = (pieces.first(), pieces.last()) else { return Err("it goes nowhere") };
        if first.point || last.point {
            return Err("it begins or ends at a corner");
        }
        let (heading, start) = (first.headings[0], first.beside[0]);
        let mut ends = vec![None; steps.len()];
        for (n, p) in pieces.iter().enumerate() {
            let end = match pieces.get(n + 1) {
                Some(next) => p.joint(next, on_left)?,
                None => p.beside[1],
            };
            // An arc round a corner is the control's own.
            ends[p.at] = Some((end, if p.point { None } else { p.center }));
        }
        Ok(Pass { range, ends, heading, start })
    }

    fn put(&self, out: &mut Builder, pass: &Pass, high: f64) {
        let steps = &self.steps[pass.range.0..pass.range.1];
        let Some(way) = steps.first() else { return };
        let source = way.source;
        let rapid = |out: &mut Builder, pose: Pose| {
            if pose.axes != out.pose().axes {
                out.push_to(Op::Rapid, &pose, source);
            }
        };
        let at = |pose: &Pose, z: f64| {
            let mut pose = *pose;
            pose.axes[2] = z;
            pose
        };
        // The way in lies over everything, where rapids go between the passes.
        let over = at(out.pose(), high.max(out.pose().axes[2]));
        rapid(out, over);
        let high = at(&way.end, over.axes[2]);
        let back = add(pass.start, pass.heading, -(self.radius * LONGER.0 + LONGER.1));
        // The direction of the way in is where the tool stands at its end: fine numbers for it too.
        out.push(Op::Begin { marker: Marker::Contour, code: WAY_IN, text: "" }, source);
        rapid(out, put(&high, back));
        out.push(Op::Begin { marker: Marker::Contour, code: self.code, text: "" }, source);
        let start = put(&high, pass.start);
        rapid(out, start);
        rapid(out, put(&way.end, pass.start));
        let mut here = pass.start;
        for (s, end) in steps.iter().zip(&pass.ends).skip(1) {
            let op = match (s.op, end) {
                (Op::Arc(arc), Some((_, Some(c)))) => Op::Arc(Arc { center: [c[0], c[1], arc.center[2]], ..arc }),
                (Op::Arc(_), Some(_)) => continue,
                (op, _) => op,
            };
            here = end.map_or(here, |(p, _)| p);
            let pose = if s.op.moves() { put(&s.end, here) } else { *out.pose() };
            out.push_to(op, &pose, s.source);
        }
        out.push(Op::Close(Marker::Contour), source);
        // The control counts from the contour; the tool stands beside it.
        if let Some(last) = steps.iter().rfind(|s| s.op.moves()) {
            rapid(out, last.end);
        }
    }
}

/// A move across with the contour beside it.
struct Piece {
    at: usize,
    center: Option<P>,
    /// Of the move.
    ends: [P; 2],
    headings: [P; 2],
    /// Of the contour.
    beside: [P; 2],
    radius: f64,
    sweep: f64,
    /// The contour is a point: an arc round a corner.
    point: bool,
    /// Nothing goes up or down before it.
    level: bool,
}

impl Piece {
    /// `by`: how far the contour is on the right of the move.
    fn new(s: &Step<'_>, at: usize, by: f64, level: bool) -> Done<Piece> {
        let ends = [flat(&s.start), flat(&s.end)];
        let Op::Arc(arc) = s.op else {
            let length = distance(ends[0], ends[1]);
            if !(length > SAME) {
                return Err("one of its moves is too short to have a direction");
            }
            let heading = [(ends[1][0] - ends[0][0]) / length, (ends[1][1] - ends[0][1]) / length];
            let beside = ends.map(|p| add(p, left(heading), -by));
            return Ok(Piece { at, center: None, ends, headings: [heading; 2], beside, radius: 0.0, sweep: 0.0, point: false, level });
        };
        let shape = ArcShape::new(&arc, &s.start, &s.end);
        let center = [shape.center[0], shape.center[1]];
        let turn = if shape.sweep < 0.0 { -1.0 } else { 1.0 };
        if !(shape.radius > SAME) || (shape.radius - shape.end_radius).abs() > SAME || shape.sweep.abs() < STRAIGHT {
            return Err("one of its arcs is too small, or none");
        }
        let outward = ends.map(|p| [(p[0] - center[0]) / shape.radius, (p[1] - center[1]) / shape.radius]);
        let headings = outward.map(|o| add([0.0; 2], left(o), turn));
        let radius = shape.radius + turn * by;
        let point = radius.abs() <= SAME;
        if radius < SMALLEST && !point {
            return Err("it goes round an outside corner on a smaller arc than that of its tool");
        }
        let beside = if point { [center; 2] } else { outward.map(|o| add(center, o, radius)) };
        Ok(Piece { at, center: Some(center), ends, headings, beside, radius, sweep: shape.sweep, point, level })
    }

    /// Where the contour goes over into that of the next move.
    fn joint(&self, next: &Piece, on_left: f64) -> Done<P> {
        let (t, u) = (self.headings[1], next.headings[0]);
        let turn = libm::atan2(cross(t, u), dot(t, u));
        if turn.abs() < STRAIGHT {
            return self.smooth(next);
        }
        if !next.level {
            return Err("it goes up or down in a corner");
        }
        if self.point || next.point || turn.abs() < CORNER {
            return Err("it turns a little, which the control takes for straight on");
        }
        if turn * on_left < 0.0 {
            return Err("it has a sharp outside corner, which the control would round");
        }
        self.meets(next).ok_or("a corner of it has no counterpart beside")
    }

    fn smooth(&self, next: &Piece) -> Done<P> {
        if self.point && next.point {
            return Err("two arcs follow each other round one corner");
        }
        let round = if self.point { self } else { next };
        if round.point && !(CORNER..std::f64::consts::PI - CORNER).contains(&round.sweep.abs()) {
            return Err("it turns round a corner by too little or too much");
        }
        if round.point && !next.level {
            return Err("it goes up or down in a corner");
        }
        if distance(self.beside[1], next.beside[0]) > 10.0 * SAME {
            return Err("it has a gap");
        }
        Ok(if next.point { next.beside[0] } else { self.beside[1] })
    }

    /// Direction of the contour at one of its points.
    fn heading_at(&self, p: P, end: usize) -> P {
        let Some(c) = self.center else { return self.headings[end] };
        let outward = [(p[0] - c[0]) / self.radius, (p[1] - c[1]) / self.radius];
        add([0.0; 2], left(outward), self.sweep.signum())
    }

    /// The nearest place where the prolonged contours of two moves meet.
    fn meets(&self, next: &Piece) -> Option<P> {
        let corner = self.ends[1];
        let line = |p: &Piece, k: usize| (p.beside[k], p.headings[k]);
        let found = match (self.center, next.center) {
            (None, None) => {
                let ((a, t), (b, u)) = (line(self, 1), line(next, 0));
                let across = cross(t, u);
                vec![add(a, t, cross([b[0] - a[0], b[1] - a[1]], u) / across)]
            }
            (None, Some(c)) => on_line(line(self, 1), c, next.radius),
            (Some(c), None) => on_line(line(next, 0), c, self.radius),
            (Some(c), Some(d)) => on_circles((c, self.radius), (d, next.radius)),
        };
        let near = found.into_iter().filter(|p| p.iter().all(|v| v.is_finite())).min_by(|a, b| distance(*a, corner).total_cmp(&distance(*b, corner)))?;
        // Further round than half a turn the control would take another way.
        let prolonged = |p: &Piece, from: P| p.center.is_none_or(|_| distance(near, from) < 1.2 * p.radius);
        // Prolonged arcs meet at another angle than the moves: it is the one that the control looks at.
        let (t, u) = (self.heading_at(near, 1), next.heading_at(near, 0));
        let turn = libm::atan2(cross(t, u), dot(t, u)).abs();
        let corner = (CORNER..std::f64::consts::PI - CORNER).contains(&turn);
        (corner && prolonged(self, self.beside[1]) && prolonged(next, next.beside[0])).then_some(near)
    }
}

fn on_line((a, t): (P, P), center: P, radius: f64) -> Vec<P> {
    let foot = dot([center[0] - a[0], center[1] - a[1]], t);
    let near = add(a, t, foot);
    let half = radius * radius - distance(near, center) * distance(near, center);
    if half < 0.0 {
        return Vec::new();
    }
    [1.0, -1.0].map(|s| add(near, t, s * libm::sqrt(half))).to_vec()
}

fn on_circles((c, r): (P, f64), (d, s): (P, f64)) -> Vec<P> {
    let apart = distance(c, d);
    let along = (apart * apart + r * r - s * s) / (2.0 * apart);
    let half = r * r - along * along;
    if !(half >= 0.0) {
        return Vec::new();
    }
    let u = [(d[0] - c[0]) / apart, (d[1] - c[1]) / apart];
    [1.0, -1.0].map(|k| add(add(c, u, along), left(u), k * libm::sqrt(half))).to_vec()
}
