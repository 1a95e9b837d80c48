//! 2½D milling: planes, pockets, slots, steps, outside profiles and milled holes, by way of the plane geometry
//! of `gr_toolpath`. Walls that lean and bottoms with a radius are cut level by level, each level with its own
//! outline, so that no level reaches into the wall below it.

use gr_text::code;
use gr_toolpath as tp;
use gr_toolpath::{P2, Path2, Region, Vertex};

use crate::emit::Emit;
use crate::frame::Frame;
use crate::process::*;

/// Run-out over open ends and edges beyond the tool's own radius, mm.
const RUN_OUT: f64 = 1.0;
/// Milled through-holes and pockets go this much below, mm.
const BREAK_THROUGH: f64 = 0.5;
/// More levels than this are a mistake.
const MOST_LEVELS: f64 = 20_000.0;

type Done<T> = Result<T, String>;

struct Job<'a> {
    step: &'a Workingstep,
    m: &'a Milling,
    feature: &'a Feature,
    radius: f64,
    /// Distance between passes.
    by: f64,
    axial: f64,
    depth: f64,
    bottom: f64,
    retract: f64,
}

/// Levels with the moves of each.
type Moves = Vec<tp::Move>;

pub(crate) fn mill(e: &mut Emit<'_>, step: &Workingstep, m: &Milling, feature: &Feature, security: f64, tolerance: f64) {
    let Some(job) = job(e, step, m, feature, security) else { return };
    let planned = match &feature.shape {
        Shape::Face { .. } => job.face(),
        Shape::Pocket { .. } | Shape::OpenPocket { .. } | Shape::Hole { .. } => job.area(e),
        Shape::Slot { path, section, ends } => job.slot(path, section, ends, tolerance),
        Shape::Step { start, length, direction, wall, .. } => job.step_feature(*start, *length, *direction, *wall),
        Shape::Outside { boundary } => job.outside(boundary),
        Shape::Toolpath => Err("a tool path feature needs an explicit tool path".into()),
        _ => Err(String::new()),
    };
    let moves = match planned {
        Ok(moves) => moves,
        Err(why) if why.is_empty() => {
            let what = format!("{} with {}", feature.keyword, step.operation.keyword);
            return e.say(code::PLAN_NOT_LOWERED, feature.origin, &[&what, ""]);
        }
        Err(why) => {
            let what = format!("#{} {}", feature.origin.id, feature.keyword);
            return e.say(code::PLAN_CANNOT_CUT, step.origin, &[&what, &why]);
        }
    };
    for frame in &feature.copies {
        write(e, step, frame, &moves, security);
    }
}

fn job<'a>(e: &mut Emit<'_>, step: &'a Workingstep, m: &'a Milling, feature: &'a Feature, security: f64) -> Option<Job<'a>> {
    let o = &step.operation;
    let radius = o.tool.diameter / 2.0;
    let through = matches!(
        feature.shape,
        Shape::Hole { bottom: HoleBottom::Through, .. }
            | Shape::Pocket { bottom: PocketBottom::Through, .. }
            | Shape::OpenPocket { bottom: PocketBottom::Through, .. }
    );
    let depth = feature.depth;
    if !(depth > 0.0) {
        e.say(code::PLAN_BAD_SIZE, feature.origin, &[&feature.keyword, "depth", &depth.to_string(), "above zero"]);
        return None;
    }
    let bottom = if through { depth + o.overcut.unwrap_or(BREAK_THROUGH) } else { depth - m.allowance_bottom };
    let axial = match m.axial {
        Some(a) if a > 0.0 => a,
        None => depth,
        Some(a) => {
            e.say(code::PLAN_BAD_SIZE, o.origin, &[&o.keyword, "axial_cutting_depth", &a.to_string(), "above zero"]);
            return None;
        }
    };
    if bottom / axial > MOST_LEVELS {
        e.say(code::PLAN_TOO_MUCH, o.origin, &[&o.keyword, &MOST_LEVELS.to_string(), "levels"]);
        return None;
    }
    if let Some(l) = o.tool.cutting_length.filter(|l| bottom > *l + 1e-6) {
        let name = format!("T{} '{}'", o.tool.number, o.tool.name);
        e.say(code::PLAN_DEEPER_THAN_EDGE, o.origin, &[&o.keyword, &bottom.to_string(), &name, &l.to_string()]);
    }
    let by = stepover(e, step, m)?;
    let top = feature.frame.origin[2];
    let usual = if feature.frame.upright() { (security - top).max(1.0) } else { 5.0 };
    let retract = o.retract.filter(|r| *r > 0.0).unwrap_or(usual);
    o.technology.feed?;
    Some(Job { step, m, feature, radius, by, axial, depth, bottom, retract })
}

/// From the radial depth and the overlap: the smaller of the two.
fn stepover(e: &mut Emit<'_>, step: &Workingstep, m: &Milling) -> Option<f64> {
    let d = step.operation.tool.diameter;
    let mut by = m.radial.filter(|r| *r > 0.0).unwrap_or(d).min(d * 0.9);
    if let Some((s, o)) = m.strategy.as_ref().and_then(|s| Some((s, s.overlap?))) {
        // More than one is no ratio: millimetres, as STEP Modeler writes, or percent, as the standard's example.
        let millimetres = (o - 0.2 * d).abs() < 1e-6;
        let ratio = if o > 0.0 && o < 1.0 && !millimetres {
            o
        } else if o == 0.0 {
            0.0
        } else if millimetres {
            e.say(code::PLAN_OVERLAP_NOT_A_RATIO, s.origin, &[&o.to_string(), &format!("{o} mm, 0.2 of the tool's diameter")]);
            0.2
        } else {
            e.say(code::PLAN_OVERLAP_NOT_A_RATIO, s.origin, &[&o.to_string(), &format!("{o} percent")]);
            o / 100.0
        };
        if !(0.0..1.0).contains(&ratio) {
            e.say(code::PLAN_BAD_SIZE, s.origin, &[&s.keyword, "overlap", &o.to_string(), "a ratio of 0 to 1"]);
            return None;
        }
        by = by.min(d * (1.0 - ratio));
    }
    if by < d * 1e-3 {
        e.say(code::PLAN_BAD_SIZE, step.operation.origin, &[&step.operation.keyword, "radial_cutting_depth", &by.to_string(), "more than a thousandth of the tool"]);
        return None;
    }
    Some(by)
}

fn words(error: tp::Error) -> String {
    error.to_string()
}

/// A contour as a path.
fn path(c: &Contour) -> Done<Path2> {
    let v: Vec<Vertex> = c.points.iter().map(|p| Vertex::arc(p[0], p[1], p[2])).collect();
    Path2::from_vertices(&v, c.closed).map_err(words)
}

impl Job<'_> {
    fn strategy(&self) -> Done<tp::Strategy> {
        let Some(s) = &self.m.strategy else { return Ok(tp::Strategy::ContourParallel) };
        let angle = s.feed.map_or(0.0, |f| libm::atan2(f[1], f[0]));
        Ok(match s.keyword.as_str() {
            "UNIDIRECTIONAL" => tp::Strategy::Unidirectional(angle),
            "BIDIRECTIONAL" => tp::Strategy::Bidirectional(angle),
            "BIDIRECTIONAL_CONTOUR" => tp::Strategy::BidirectionalContour(angle),
            "CONTOUR_BIDIRECTIONAL" => tp::Strategy::ContourBidirectional(angle),
            "CONTOUR_PARALLEL" => tp::Strategy::ContourParallel,
            "CONTOUR_SPIRAL" => tp::Strategy::ContourSpiral,
            "CENTER_MILLING" => tp::Strategy::CentreMilling,
            "EXPLICIT_STRATEGY" => return Err("an explicit strategy needs an explicit tool path".into()),
            other => return Err(format!("strategy {other}")),
        })
    }
    fn cut_mode(&self) -> Option<tp::CutMode> {
        let climb = self.m.strategy.as_ref()?.climb?;
        // A spindle that turns the other way changes the sides.
        let climb = climb == self.step.operation.technology.clockwise;
        Some(if climb { tp::CutMode::Climb } else { tp::CutMode::Conventional })
    }
    fn clearing(&self) -> Done<tp::Clear> {
        let mut c = tp::Clear::new(self.radius, self.by, self.strategy()?);
        c.allowance = self.m.allowance_side;
        c.cut_mode = self.cut_mode();
        if let Some(s) = &self.m.strategy {
            c.rotation = s.ccw.map(|ccw| if ccw { tp::Rotation::Ccw } else { tp::Rotation::Cw });
            c.step_left = s.step_left.unwrap_or(true);
        }
        // A start point at the origin is what programs write that have none.
        c.start = self.step.operation.start.filter(|p| *p != [0.0; 3]).map(|p| P2::new(p[0], p[1]));
        Ok(c)
    }
    fn heights(&self, top: f64, bottom: f64) -> tp::Depth {
        let safe = RUN_OUT.min(self.retract);
        tp::Depth { top: -top, bottom: -bottom, step: self.axial, clearance: self.retract, safe, finish: 0.0 }
    }
    fn entry(&self, open: bool) -> Done<tp::Entry> {
        let to = |a: &Approach, way_in: bool| -> Done<tp::Approach> {
            Ok(match a {
                // Into a closed area a cutter that may not cut at its centre goes down slowly on a slope.
                Approach::None if way_in && !open => tp::Approach::Ramp { angle: 3f64.to_radians() },
                Approach::None | Approach::Axis => tp::Approach::Plunge,
                Approach::Ramp(angle) => tp::Approach::Ramp { angle: *angle },
                Approach::Helix(radius, angle) => tp::Approach::Helix { radius: *radius, angle: *angle },
                Approach::Zigzag(angle, width) => tp::Approach::ZigZag { angle: *angle, width: *width },
                Approach::Angle(angle, length) => tp::Approach::AirAngle { angle: *angle, length: *length },
                Approach::Tangent(radius) => tp::Approach::AirTangent { radius: *radius },
                Approach::Along(paths) => tp::Approach::AlongPath(along(paths)?),
            })
        };
        let retract = match &self.m.retract {
            Approach::Ramp(_) | Approach::Helix(..) | Approach::Zigzag(..) => tp::Approach::Plunge,
            other => to(other, false)?,
        };
        Ok(tp::Entry { approach: to(&self.m.approach, true)?, retract, by_level: true })
    }

    fn face(&self) -> Done<Moves> {
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
        let bosses: Done<Vec<Path2>> = bosses.iter().map(|b| path(&b.boundary)).collect();
        let mut what = tp::Face::new(self.radius, self.by);
        let feed = self.m.strategy.as_ref().and_then(|s| s.feed).unwrap_or(*direction);
        what.angle = libm::atan2(feed[1], feed[0]);
        what.overrun = self.step.operation.overcut.unwrap_or(RUN_OUT);
        if let Some(s) = &self.m.strategy {
            what.bidirectional = s.keyword != "UNIDIRECTIONAL";
            what.step_left = s.step_left.unwrap_or(true);
        }
        let passes = tp::face(&outline, &bosses?, &what).map_err(words)?;
        tp::motion(&passes, &self.heights(0.0, self.bottom), &self.entry(true)?, None, self.radius).map_err(words)
    }

    /// The outline at the top with its islands.
    fn region(&self) -> Done<Region> {
        let (outer, bosses, corner) = match &self.feature.shape {
            Shape::Pocket { boundary, bosses, orthogonal_radius, .. } => {
                (path(&boundary.contour().ok_or("its profile has no size")?)?, bosses.as_slice(), *orthogonal_radius)
            }
            Shape::Hole { diameter, .. } => (Path2::circle(P2::default(), diameter / 2.0).map_err(words)?, &[][..], None),
            Shape::OpenPocket { .. } => return Err(String::new()),
            _ => return Err(String::new()),
        };
        let outer = match (corner, &self.feature.shape) {
            (Some(r), Shape::Pocket { boundary: Closed::Rectangle { frame, length, width }, .. })
                if r > 0.0 && r <= length.min(*width) / 2.0 =>
            {
                let turn = libm::atan2(frame.x[1], frame.x[0]);
                tp::profile::rectangle(*length, *width, r)
                    .map_err(words)?
                    .rotated(turn)
                    .moved(P2::new(frame.origin[0], frame.origin[1]))
            }
            _ => outer,
        };
        let inside: Vec<&Boss> = bosses.iter().filter(|b| b.top < self.depth - 1e-9).collect();
        if let Some(low) = inside.iter().find(|b| b.top > 1e-6) {
            return Err(format!("boss #{} is lower than the pocket's rim", low.origin.id));
        }
        if inside.iter().any(|b| b.slope != 0.0) {
            return Err("a boss with sloping walls".into());
        }
        let holes: Done<Vec<Path2>> = inside.iter().map(|b| path(&b.boundary)).collect();
        Region::new(outer, holes?).map_err(words)
    }

    /// How far the wall at a depth stands in from the outline at the top.
    fn lean(&self, y: f64) -> Done<f64> {
        let (slope, fillet) = match &self.feature.shape {
            Shape::Pocket { slope, planar_radius, bottom, .. } => {
                if let PocketBottom::Other(what) = bottom {
                    return Err(format!("a pocket with a {what} bottom"));
                }
                (*slope, planar_radius.unwrap_or(0.0))
            }
            Shape::Hole { diameter, final_diameter, bottom } => {
                let taper = final_diameter.map_or(0.0, |f| libm::atan((diameter - f) / 2.0 / self.depth));
                let fillet = match bottom {
                    HoleBottom::Radiused(r) => *r,
                    HoleBottom::Spherical(_) | HoleBottom::Conical(..) => return Err("a milled hole with this bottom".into()),
                    _ => 0.0,
                };
                (taper, fillet)
            }
            _ => (0.0, 0.0),
        };
        // A cutter with the radius of the fillet makes it itself.
        let fillet = if self.step.operation.tool.edge_radius + 1e-9 >= fillet { 0.0 } else { fillet };
        let over = y - (self.depth - fillet);
        let round = if fillet > 0.0 && over > 0.0 { fillet - libm::sqrt((fillet * fillet - over * over).max(0.0)) } else { 0.0 };
        Ok(y.min(self.depth) * libm::tan(slope) + round)
    }

    fn area(&self, e: &mut Emit<'_>) -> Done<Moves> {
        let region = self.region()?;
        let straight = self.lean(self.bottom)? == 0.0 && self.lean(self.depth * 0.999)? == 0.0;
        let entry = self.entry(false)?;
        self.rest(e, &region);
        if straight {
            let passes = self.passes(&region)?;
            return tp::motion(&passes, &self.heights(0.0, self.bottom), &entry, Some(&region), self.radius).map_err(words);
        }
        let mut moves = Vec::new();
        let levels = (self.bottom / self.axial - 1e-9).ceil().max(1.0);
        let mut above = 0.0;
        for k in 1..=levels as usize {
            let y = self.bottom * k as f64 / levels;
            let by = self.lean(y)?;
            let parts = if by > 0.0 { tp::erode(&region, by).map_err(words)? } else { vec![region.clone()] };
            for part in &parts {
                let passes = match self.passes(part) {
                    Ok(p) => p,
                    Err(why) if k == 1 => return Err(why),
                    Err(_) => continue,
                };
                let mut h = self.heights(above, y);
                h.step = h.step.max(y - above);
                moves.extend(tp::motion(&passes, &h, &entry, Some(part), self.radius).map_err(words)?);
            }
            above = y;
        }
        Ok(moves)
    }

    fn passes(&self, region: &Region) -> Done<Vec<tp::Pass>> {
        if !self.m.bottom || self.m.finish && !self.m.bottom {
            let mut what = tp::Contour::new(self.radius);
            what.allowance = self.m.allowance_side;
            what.cut_mode = self.cut_mode().unwrap_or(tp::CutMode::Climb);
            let lead = (self.radius / 2.0).max(0.1);
            (what.lead_in, what.lead_out) = (tp::Lead::Arc(lead), tp::Lead::Arc(lead));
            return tp::contour_closed(region, &what).map_err(words);
        }
        Ok(tp::clear(region, &self.clearing()?).map_err(words)?.passes)
    }

    /// What the tool cannot reach is said, with its place.
    fn rest(&self, e: &mut Emit<'_>, region: &Region) {
        // A tool of exactly the size of a corner or a hole reaches all of it.
        let Ok(all) = tp::residuals(region, self.radius - 1e-6) else { return };
        let total: f64 = all.iter().map(|r| r.area).sum();
        let Some(worst) = all.first().filter(|_| self.m.allowance_side == 0.0) else { return };
        let tool = format!("T{}", self.step.operation.tool.number);
        let what = format!("#{} {}", self.feature.origin.id, self.feature.keyword);
        let at = self.feature.frame.point([worst.at.x, worst.at.y, 0.0]);
        let text = format!("{} spots, {total:.4} mm² in all, the largest at X{:.4} Y{:.4} with {:.4} mm²", all.len(), at[0], at[1], worst.area);
        e.say(code::PLAN_UNREACHABLE_CORNER, self.step.operation.origin, &[&tool, &format!("{:.4}", self.radius), &what, &text]);
    }

    fn slot(&self, travel: &Travel, section: &Section, ends: &[SlotEnd], tolerance: f64) -> Done<Moves> {
        let shape = Cross::of(section, self.depth)?;
        let line = match travel {
            Travel::Line { start, direction, length } => {
                let [a, b] = [*start, [start[0] + direction[0] * length, start[1] + direction[1] * length]];
                Contour { points: vec![[a[0], a[1], 0.0], [b[0], b[1], 0.0]], closed: false }
            }
            Travel::Curve(c) => c.clone(),
        };
        let closed = line.closed || ends.contains(&SlotEnd::Loop);
        if let Some(SlotEnd::Woodruff(_)) = ends.iter().find(|e| matches!(e, SlotEnd::Woodruff(_))) {
            return Err("a slot with a Woodruff end".into());
        }
        let line = path(&line)?;
        let ball = self.step.operation.tool.edge_radius + 1e-9 >= self.radius;
        let ways: Vec<(f64, f64)> = if ball && shape.rounded() {
            shape.ball(self.radius, tolerance)?
        } else {
            Vec::new()
        };
        if !ways.is_empty() {
            return self.along_section(&line, ends, closed, ways);
        }
        let mut moves = Vec::new();
        let floor = if shape.rounded() { shape.lowest(self.radius).min(self.bottom) } else { self.bottom };
        if !(floor > 0.0) {
            return Err(format!("its section has no room for a tool of {} mm", 2.0 * self.radius));
        }
        let levels = (floor / self.axial - 1e-9).ceil().max(1.0);
        let steady = shape.half(0.0) == shape.half(floor);
        let mut above = 0.0;
        let count = if steady { 1 } else { levels as usize };
        for k in 1..=count {
            let y = if steady { floor } else { floor * k as f64 / levels };
            let width = 2.0 * (shape.half(y) - self.m.allowance_side);
            let passes = self.slot_passes(&line, width, ends, closed)?;
            let mut h = self.heights(above, y);
            if !steady {
                h.step = h.step.max(y - above);
            }
            let open = ends.contains(&SlotEnd::Open);
            moves.extend(tp::motion(&passes, &h, &self.entry(open)?, None, self.radius).map_err(words)?);
            above = y;
        }
        Ok(moves)
    }

    /// The slot's middle line from where the tool starts to where it stops.
    fn ended(&self, line: &Path2, ends: &[SlotEnd], closed: bool) -> Done<Path2> {
        if closed {
            return Ok(line.clone());
        }
        let end = |i: usize| match ends.get(i).or(ends.first()) {
            None | Some(SlotEnd::Open) => self.radius + RUN_OUT,
            Some(SlotEnd::Flat(..)) => -self.radius,
            _ => 0.0,
        };
        lengthened(line, end(0), end(1))
    }

    fn slot_passes(&self, line: &Path2, width: f64, ends: &[SlotEnd], closed: bool) -> Done<Vec<tp::Pass>> {
        if width < 2.0 * self.radius - 1e-6 {
            return Err(format!("it is {width:.4} mm wide, the tool {} mm", 2.0 * self.radius));
        }
        if !closed && width > 2.0 * self.radius + 1e-5 && !(ends.is_empty() || ends.iter().all(|e| *e == SlotEnd::Open)) {
            return self.blind_slot(line, width, ends);
        }
        let mut what = tp::Contour::new(self.radius);
        what.stepover = self.by;
        what.cut_mode = self.cut_mode().unwrap_or(tp::CutMode::Climb);
        tp::slot(&self.ended(line, ends, closed)?, width, &what).map_err(words)
    }

    /// A slot with a closed end, wider than its tool: an area.
    fn blind_slot(&self, line: &Path2, width: f64, ends: &[SlotEnd]) -> Done<Vec<tp::Pass>> {
        let (a, b) = (line.start(), line.end());
        if line.segs().len() != 1 || (line.length() - a.dist(b)).abs() > 1e-6 {
            return Err("a curved slot with a closed end, wider than its tool".into());
        }
        let u = (b - a).unit();
        let (h, out) = (width / 2.0, 2.0 * self.radius + RUN_OUT);
        let end = |i: usize| *ends.get(i).or(ends.first()).unwrap_or(&SlotEnd::Open);
        let reach = |e: SlotEnd| if e == SlotEnd::Open { out } else { 0.0 };
        let bulge = |e: SlotEnd| if e == SlotEnd::Radiused { 1.0 } else { 0.0 };
        let (p, q) = (a - u * reach(end(0)), b + u * reach(end(1)));
        let n = u.left() * h;
        let corner = |c: P2, bulge: f64| Vertex { p: c, bulge };
        let outline = [corner(p - n, 0.0), corner(q - n, bulge(end(1))), corner(q + n, 0.0), corner(p + n, bulge(end(0)))];
        let region = Region::new(Path2::from_vertices(&outline, true).map_err(words)?, Vec::new()).map_err(words)?;
        Ok(tp::clear(&region, &self.clearing()?).map_err(words)?.passes)
    }

    /// Along the middle line, once for each place of the tool in the section: offset and height of its tip.
    fn along_section(&self, line: &Path2, ends: &[SlotEnd], closed: bool, ways: Vec<(f64, f64)>) -> Done<Moves> {
        let middle = self.ended(line, ends, closed)?;
        let mut moves = Vec::new();
        let entry = self.entry(ends.is_empty() || ends.contains(&SlotEnd::Open))?;
        for (i, (x, z)) in ways.iter().enumerate() {
            let way = if x.abs() < 1e-9 {
                middle.clone()
            } else {
                tp::offset_open(&middle, *x).map_err(words)?
            };
            let way = if i % 2 == 1 { way.reversed() } else { way };
            let pass = tp::Pass { path: way, role: tp::Role::Wall, link: tp::Link::Retract };
            let mut h = self.heights(0.0, *z);
            h.step = z.max(1e-3);
            moves.extend(tp::motion(&[pass], &h, &entry, None, self.radius).map_err(words)?);
        }
        Ok(moves)
    }

    /// From the edge to the nearer side of the raw part: how wide a step is does not stand in the feature.
    fn step_feature(&self, start: [f64; 2], length: f64, direction: [f64; 2], wall: f64) -> Done<Moves> {
        if wall != 0.0 {
            return Err("a step with a wall that leans".into());
        }
        let [low, high] = self.step.stock.ok_or("its width follows from a raw block, and the workpiece has none")?;
        let (u, v) = (P2::new(direction[0], direction[1]), P2::new(-direction[1], direction[0]));
        let a = P2::new(start[0], start[1]);
        let (mut left, mut right) = (0.0f64, 0.0f64);
        for corner in 0..8 {
            let p = std::array::from_fn(|i| if corner >> i & 1 == 1 { high[i] } else { low[i] });
            let q = self.feature.frame.inverse_point(p);
            let s = (P2::new(q[0], q[1]) - a).dot(v);
            (left, right) = (left.max(s), right.max(-s));
        }
        let out = 2.0 * self.radius + RUN_OUT;
        let (side, width) = match (left > 1e-6, right > 1e-6) {
            (true, true) if left <= right => (v, left),
            (true, false) => (v, left),
            (_, true) => (v * -1.0, right),
            (false, false) => return Err("its edge does not lie on the raw part".into()),
        };
        let (p, q) = (a - u * out, a + u * (length + out));
        let far = side * (width + out);
        let outline = Path2::polyline(&[p, q, q + far, p + far], true).map_err(words)?;
        let region = Region::new(outline, Vec::new()).map_err(words)?;
        let passes = tp::clear(&region, &self.clearing()?).map_err(words)?.passes;
        tp::motion(&passes, &self.heights(0.0, self.bottom), &self.entry(true)?, Some(&region), self.radius).map_err(words)
    }

    fn outside(&self, boundary: &Contour) -> Done<Moves> {
        let line = path(boundary)?;
        let mut what = tp::Contour::new(self.radius);
        what.allowance = self.m.allowance_side;
        what.cut_mode = self.cut_mode().unwrap_or(tp::CutMode::Climb);
        (what.lead_in, what.lead_out) = (tp::Lead::Arc(self.radius), tp::Lead::Arc(self.radius));
        let side = if !line.is_closed() || line.is_ccw() { tp::Side::Right } else { tp::Side::Left };
        let passes = tp::contour(&line, side, &what).map_err(words)?;
        tp::motion(&passes, &self.heights(0.0, self.bottom), &self.entry(true)?, None, self.radius).map_err(words)
    }
}

fn along(paths: &[Toolpath]) -> Done<Vec<tp::P3>> {
    let mut out = Vec::new();
    for p in paths {
        let PathKind::Location { curve, .. } = &p.path else { return Err("an approach path of this kind".into()) };
        for q in std::iter::once(curve.start).chain(curve.pieces.iter().map(Piece::end)) {
            out.push(tp::P3::new(q[0], q[1], q[2]));
        }
    }
    Ok(out)
}

/// An open path with straight pieces added at its ends, or shortened there (first and last piece straight).
fn lengthened(line: &Path2, first: f64, last: f64) -> Done<Path2> {
    let mut v = line.vertices();
    let n = v.len();
    if n < 2 {
        return Err("a slot without length".into());
    }
    let tangent = |a: Vertex, b: Vertex, at_start: bool| {
        let chord = (b.p - a.p).unit();
        let turn = 2.0 * libm::atan(a.bulge);
        chord.rotated(if at_start { -turn } else { turn })
    };
    let (u, w) = (tangent(v[0], v[1], true), tangent(v[n - 2], v[n - 1], false));
    let (a, b) = (v[0].p - u * first, v[n - 1].p + w * last);
    if first < 0.0 && v[0].bulge != 0.0 || last < 0.0 && v[n - 2].bulge != 0.0 {
        return Err("a flat end on an arc".into());
    }
    if (first < 0.0 || last < 0.0) && n == 2 && v[0].p.dist(v[1].p) + first + last < 1e-9 {
        return Err("a slot shorter than its tool is wide".into());
    }
    if v[n - 2].bulge == 0.0 {
        v[n - 1].p = b;
    } else if last > 0.0 {
        v.push(Vertex { p: b, bulge: 0.0 });
    }
    if v[0].bulge == 0.0 {
        v[0].p = a;
    } else if first > 0.0 {
        v.insert(0, Vertex { p: a, bulge: 0.0 });
    }
    Path2::from_vertices(&v, false).map_err(words)
}

/// The section of a slot: two walls that lean by `angle`, a radius between wall and floor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Cross {
    depth: f64,
    /// Half width at the floor's corner, walls prolonged.
    bottom: f64,
    radius: f64,
    angle: f64,
}

impl Cross {
    pub fn of(section: &Section, depth: f64) -> Done<Cross> {
        Ok(match *section {
            Section::SquareU { width, radius, angle } => {
                if (angle[0] - angle[1]).abs() > 1e-9 || (radius[0] - radius[1]).abs() > 1e-9 {
                    return Err("a section that is not symmetric".into());
                }
                Cross { depth, bottom: width / 2.0, radius: radius[0], angle: angle[0] }
            }
            Section::RoundedU { width } => Cross { depth, bottom: width / 2.0, radius: width / 2.0, angle: 0.0 },
            Section::Circular { radius, .. } => Cross { depth, bottom: radius, radius, angle: 0.0 },
            Section::Vee { radius, angle, tilt } => {
                if tilt.abs() > 1e-9 || !(angle > 0.0) {
                    return Err("a V that is tilted or has no angle".into());
                }
                let a = angle / 2.0;
                // The prolonged walls meet the floor's height this far out.
                let bottom = radius / libm::cos(a) - radius * libm::tan(a);
                Cross { depth, bottom, radius, angle: a }
            }
            Section::Tee { .. } => return Err("a T-slot".into()),
            Section::General => return Err("a slot with a general section".into()),
        })
    }
    /// Centre of the radius: out from the middle, and its depth.
    fn center(&self) -> (f64, f64) {
        let x = self.bottom + self.radius * libm::tan(self.angle) - self.radius / libm::cos(self.angle);
        (x.max(0.0), self.depth - self.radius)
    }
    /// Depth where wall and radius meet.
    fn tangency(&self) -> f64 {
        self.depth - self.radius + self.radius * libm::sin(self.angle)
    }
    /// Half the width at a depth.
    pub fn half(&self, y: f64) -> f64 {
        if y <= self.tangency() || self.radius <= 0.0 {
            return self.bottom + (self.depth - y) * libm::tan(self.angle);
        }
        let (x, c) = self.center();
        x + libm::sqrt((self.radius * self.radius - (y - c) * (y - c)).max(0.0))
    }
    fn rounded(&self) -> bool {
        self.radius > 0.0 || self.angle != 0.0
    }
    /// How deep a flat tool of this radius goes before it touches both walls.
    fn lowest(&self, r: f64) -> f64 {
        if self.half(0.0) < r {
            return 0.0;
        }
        if self.half(self.tangency()) >= r {
            // A flat tool leaves the radius to a ball.
            return if self.radius > 0.0 { self.tangency().max(0.0) } else { self.depth };
        }
        let (mut low, mut high) = (0.0, self.tangency());
        for _ in 0..60 {
            let mid = (low + high) / 2.0;
            if self.half(mid) >= r { low = mid } else { high = mid }
        }
        low
    }
    /// Places of a ball: how far out from the middle, and the depth of its tip, from the left wall's top over the floor to the right: no scallop above the tolerance.
    fn ball(&self, r: f64, tolerance: f64) -> Done<Vec<(f64, f64)>> {
        if self.radius + 1e-9 < r && self.radius > 0.0 {
            return Err(format!("a ball of {r} mm radius is larger than its radius of {} mm", self.radius));
        }
        let step = 2.0 * libm::sqrt((2.0 * r * tolerance - tolerance * tolerance).max(1e-12));
        let (cx, cy) = self.center();
        let inner = (self.radius - r).max(0.0);
        // The centre's way on the right: down the wall, round the corner, in to the middle.
        let mut side: Vec<(f64, f64)> = Vec::new();
        let (sin, cos) = (libm::sin(self.angle), libm::cos(self.angle));
        let foot = (cx + inner * cos, cy + inner * sin);
        let wall = (foot.1.max(0.0)) / cos;
        let n = (wall / step).ceil().max(1.0);
        if n > 10_000.0 {
            return Err("a section that needs too many passes".into());
        }
        for k in 0..=n as usize {
            let s = wall * (1.0 - k as f64 / n);
            side.push((foot.0 + s * sin, foot.1 - s * cos));
        }
        let sweep = std::f64::consts::FRAC_PI_2 - self.angle;
        let n = (inner * sweep / step).ceil();
        for k in 1..=n as usize {
            let t = self.angle + sweep * k as f64 / n;
            side.push((cx + inner * libm::cos(t), cy + inner * libm::sin(t)));
        }
        let n = (cx / step).ceil();
        for k in 1..=n as usize {
            side.push((cx * (1.0 - k as f64 / n), self.depth - r));
        }
        let left = side.iter().map(|p| (-p.0, p.1 + r));
        let right = side.iter().rev().map(|p| (p.0, p.1 + r));
        let mut all: Vec<(f64, f64)> = left.chain(right).collect();
        all.dedup_by(|a, b| (a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9);
        Ok(all)
    }
}

/// Moves of the feature's plane as motion of one copy.
fn write(e: &mut Emit<'_>, step: &Workingstep, frame: &Frame, moves: &[tp::Move], security: f64) {
    let Some(first) = moves.first() else { return };
    let p3 = |p: tp::P3| frame.point([p.x, p.y, p.z]);
    e.travel(p3(first.to), frame.z, security);
    e.technology(&step.operation.technology, step.operation.functions);
    for m in moves {
        let to = p3(m.to);
        match m.kind {
            tp::Kind::Rapid => e.rapid(to),
            tp::Kind::Line => e.line(to),
            tp::Kind::Arc { centre, sweep } => {
                let z = e.at.map_or(m.to.z, |at| frame.inverse_point(at)[2]);
                e.arc(frame.point([centre.x, centre.y, z]), frame.z, to, sweep);
            }
        }
    }
}
