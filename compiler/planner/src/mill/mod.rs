//! 2½D milling: planes, pockets, slots, steps, profiles, bosses and milled holes, by way of the plane geometry of
//! `gr_toolpath`. What all of them share is here; [`area`] empties what has an outline, [`slot`] follows a section,
//! [`section`] is the plane geometry of that section,
//! [`thread`] goes round in a helix.

pub(crate) mod area;
mod section;
mod slot;
pub(crate) mod thread;

use gr_ir::{Marker, Op};
use gr_text::code;
use gr_toolpath as tp;
use gr_toolpath::{P2, Path2, Vertex};

use crate::emit::Emit;
use crate::frame::Frame;
use crate::process::*;

/// Run-out over open ends and edges beyond the tool's own radius, mm.
const RUN_OUT: f64 = 1.0;
/// Milled through-holes and pockets go this much below, mm.
const BREAK_THROUGH: f64 = 0.5;
/// More levels than this are a mistake.
const MOST_LEVELS: f64 = 20_000.0;
/// Slope down the first pass where the file does not say how to enter, rad.
const USUAL_RAMP: f64 = 3.0 * std::f64::consts::PI / 180.0;

type Done<T> = Result<T, String>;
/// Levels with the moves of each.
type Moves = Vec<tp::Move>;

/// What a workingstep is planned with.
pub(crate) struct Given {
    /// Height for rapids.
    pub security: f64,
    /// Greatest distance of a stair or a scallop from the true surface, mm.
    pub tolerance: f64,
    /// It is the one that says what no tool of the plan reaches in its feature.
    pub tells: bool,
    /// How overlaps are written.
    pub overlap: Overlap,
    /// Greatest axial depth of the machine.
    pub axial_depth: Option<f64>,
}

#[derive(Clone, Copy)]
struct Job<'a> {
    step: &'a Workingstep,
    m: &'a Milling,
    feature: &'a Feature,
    radius: f64,
    /// Edge radius of the tool, at most its radius.
    edge: f64,
    /// How far from its axis it leaves a clean floor, within the tolerance.
    clean: f64,
    /// Distance between passes.
    by: f64,
    /// The same where the floor need not be clean.
    coarse: f64,
    axial: f64,
    depth: f64,
    bottom: f64,
    retract: f64,
    tolerance: f64,
    tells: bool,
    /// Never all three axes at once.
    two_axes: bool,
}

pub(crate) fn mill(e: &mut Emit<'_>, step: &Workingstep, m: &Milling, feature: &Feature, given: &Given) {
    if let Shape::Thread { .. } = feature.shape {
        if step.operation.two_axes() {
            let why = "its tool direction TWO_AXES: a thread is milled on a helix, with three axes at once";
            return e.say(code::PLAN_CANNOT_CUT, step.origin, &[&format!("#{} {}", feature.origin.id, feature.keyword), why]);
        }
        return thread::mill(e, step, m, feature, given.security);
    }
    let tool = &step.operation.tool;
    if !(tool.mills() || tool.is_disc() && matches!(feature.shape, Shape::Slot { .. })) {
        let (what, why) = (format!("#{} {}", feature.origin.id, feature.keyword), format!("a {} does not mill it", tool.kind));
        return e.say(code::PLAN_CANNOT_CUT, step.origin, &[&what, &why]);
    }
    if !slot::suits(e, step, feature) {
        return;
    }
    let Some(job) = job(e, step, m, feature, given) else { return };
    let moves = match job.moves(e) {
        Ok(moves) => moves,
        Err(_) if m.allowance_side > 0.0 && job.has_room_without_allowance(e) => {
            let must = format!("less: with it there is no room for the tool of {} mm in #{} {}", step.operation.tool.diameter, feature.origin.id, feature.keyword);
            return bad_size(e, step, "allowance_side", m.allowance_side, &must);
        }
        Err(why) if why.is_empty() => {
            let what = format!("{} with {}", feature.keyword, step.operation.keyword);
            return e.say(code::PLAN_NOT_LOWERED, feature.origin, &[&what, ""]);
        }
        Err(why) => {
            let what = format!("#{} {}", feature.origin.id, feature.keyword);
            return e.say(code::PLAN_CANNOT_CUT, step.origin, &[&what, &why]);
        }
    };
    job.check_approach(e, &moves);
    job.unused(e, &moves);
    let beside = job.beside_a_wall();
    for frame in &feature.copies {
        if let Some(code) = beside {
            e.mark(Marker::Contour, code, &format!("{:?}", step.operation.tool.diameter / 2.0));
        }
        write(e, step, frame, &moves, given.security);
        if beside.is_some() {
            e.push(Op::Close(Marker::Contour));
        }
    }
}

fn job<'a>(e: &mut Emit<'_>, step: &'a Workingstep, m: &'a Milling, feature: &'a Feature, given: &Given) -> Option<Job<'a>> {
    let o = &step.operation;
    let radius = o.tool.diameter / 2.0;
    let edge = o.tool.edge_radius.clamp(0.0, radius);
    let through = matches!(
        feature.shape,
        Shape::Hole { bottom: HoleBottom::Through, .. }
            | Shape::Pocket { bottom: PocketBottom::Through, .. }
            | Shape::OpenPocket { bottom: PocketBottom::Through, .. }
    );
    let floor = area::floor_depth(feature, radius, edge, m.allowance_bottom);
    let depth = floor.map_or(feature.depth, |f| f.1);
    if !(depth > 0.0) {
        e.say(code::PLAN_BAD_SIZE, feature.origin, &[&feature.keyword, "depth", &depth.to_string(), "above zero"]);
        return None;
    }
    if m.allowance_side < 0.0 {
        bad_size(e, step, "allowance_side", m.allowance_side, "zero or more");
        return None;
    }
    if m.allowance_bottom < 0.0 || m.allowance_bottom >= depth {
        bad_size(e, step, "allowance_bottom", m.allowance_bottom, "between zero and the depth");
        return None;
    }
    let deepest = match floor {
        Some((Some(tip), _)) => tip,
        Some((None, _)) => {
            let (what, why) = (format!("#{} {}", feature.origin.id, feature.keyword), "the tool is too large for its floor");
            e.say(code::PLAN_CANNOT_CUT, step.origin, &[&what, why]);
            return None;
        }
        None => depth - m.allowance_bottom,
    };
    // Past the bottom by the overcut, and with a rounded edge by that too, so that the opening is as wide below.
    let bottom = if through { depth + o.overcut.filter(|v| *v > 0.0).unwrap_or(BREAK_THROUGH) + edge } else { deepest };
    let axial = match m.axial {
        Some(a) if a > 0.0 => a,
        None => depth,
        Some(a) => {
            bad_size(e, step, "axial_cutting_depth", a, "above zero");
            return None;
        }
    };
    if let Some(most) = given.axial_depth.filter(|most| axial.min(bottom) > *most + 1e-9) {
        let (what, cut) = (format!("#{} {}", o.origin.id, o.keyword), axial.min(bottom));
        e.say(code::PLAN_OVER_MACHINE_LIMIT, step.origin, &[&what, &gr_step::short(cut), &gr_step::short(most)]);
    }
    if bottom / axial > MOST_LEVELS {
        e.say(code::PLAN_TOO_MUCH, o.origin, &[&o.keyword, &MOST_LEVELS.to_string(), "levels"]);
        return None;
    }
    // A disc cuts with its height at a time, and gets as deep as it reaches; in a T-slot its levels are no higher than it.
    let disc = o.tool.is_disc();
    let tee = disc && matches!(feature.shape, Shape::Slot { section: Section::Tee { .. }, .. });
    let once = o.tool.edge().filter(|_| disc && !tee).map(|l| (axial.min(bottom), l));
    let long = if disc { o.tool.cutting_length.filter(|l| o.tool.thickness.is_some_and(|t| *l > t)) } else { o.tool.edge() };
    let reach = long.map(|l| (bottom, l));
    if let Some((cut, l)) = once.into_iter().chain(reach).find(|(cut, l)| *cut > *l + 1e-6) {
        let name = format!("T{} '{}'", o.tool.number, o.tool.name);
        e.say(code::PLAN_DEEPER_THAN_EDGE, o.origin, &[&o.keyword, &cut.to_string(), &name, &l.to_string()]);
    }
    let by = stepover(e, step, m, given.overlap)?;
    let top = feature.frame.origin[2];
    let usual = if feature.frame.upright() { (given.security - top).max(1.0) } else { 5.0 };
    let retract = o.retract.filter(|r| *r > 0.0).unwrap_or(usual);
    retract_is_above(e, o, retract);
    o.technology.feed?;
    // What a rounded edge leaves standing between two passes stays within the tolerance.
    let clean = (radius - edge + libm::sqrt(given.tolerance * (2.0 * edge - given.tolerance).max(0.0))).clamp(radius * 5e-3, radius);
    let coarse = by;
    let by = if m.bottom { by.min(2.0 * clean) } else { by };
    // A rounded edge deeper than the cut is narrower at the top of the wall than the tool: it may come nearer. A radius
    // at the foot of the wall that is no larger than the edge's own stays clear of it.
    let own = |r: f64| r <= edge;
    let upright = match &feature.shape {
        Shape::Pocket { slope, planar_radius, bosses, bottom: floor, .. } | Shape::OpenPocket { slope, planar_radius, bosses, bottom: floor, .. } => {
            !matches!(floor, PocketBottom::Ball(..)) && *slope == 0.0 && own(planar_radius.unwrap_or(0.0)) && bosses.iter().all(|b| b.slope == 0.0 && b.top <= 0.0)
        }
        Shape::Step { wall, radius, bosses, .. } => *wall == 0.0 && own(*radius) && bosses.iter().all(|b| b.slope == 0.0 && b.top <= 0.0),
        Shape::Hole { final_diameter, bottom, .. } => {
            let round = match bottom {
                HoleBottom::Flat | HoleBottom::Through => true,
                HoleBottom::Radiused(r) | HoleBottom::Spherical(r) => floor.is_none() && own(*r),
                HoleBottom::Conical(..) => false,
            };
            final_diameter.is_none() && round
        }
        Shape::Outside { .. } => true,
        Shape::Boss(b) => b.slope == 0.0,
        _ => false,
    };
    let radius = if upright && bottom < edge { radius - edge + libm::sqrt(bottom * (2.0 * edge - bottom)) } else { radius };
    Some(Job { step, m, feature, radius, edge, clean, by, coarse, axial, depth, bottom, retract, tolerance: given.tolerance, tells: given.tells, two_axes: o.two_axes() })
}

/// A number of the operation that no path can be made with, told where it is written.
fn bad_size(e: &mut Emit<'_>, step: &Workingstep, what: &str, v: f64, must: &str) {
    let o = &step.operation;
    let at = e.attribute(o.origin, &[what]);
    e.say(code::PLAN_BAD_SIZE, at, &[&o.keyword, what, &v.to_string(), must]);
}

/// From the radial depth and the overlap: the smaller of the two.
fn stepover(e: &mut Emit<'_>, step: &Workingstep, m: &Milling, written: Overlap) -> Option<f64> {
    let d = step.operation.tool.diameter;
    let o = &step.operation;
    if let Some(r) = m.radial.filter(|r| !(*r > 0.0)) {
        bad_size(e, step, "radial_cutting_depth", r, "above zero");
        return None;
    }
    if let Some(r) = m.radial.filter(|r| *r > d + 1e-9) {
        let (a, b) = (format!("the radial depth of {r} mm"), format!("one of {:.4} mm", d * 0.9));
        e.say(code::PLAN_APPROACH_CHANGED, o.origin, &[&a, &b, &format!("the tool is {d} mm wide")]);
    }
    let mut by = m.radial.unwrap_or(d).min(d * 0.9);
    if let Some((s, o)) = m.strategy.as_ref().and_then(|s| Some((s, s.overlap?))) {
        let (ratio, must) = match written {
            Overlap::Ratio => (o, "a ratio of 0 to below 1"),
            Overlap::Percent => (o / 100.0, "a percentage of 0 to below 100"),
            Overlap::Millimetres => (o / d, "a length of 0 to below the diameter of the tool"),
        };
        if written == Overlap::Ratio && o > 1.0 {
            e.overlap(s.overlap_span, o, d);
            return None;
        }
        if !(0.0..1.0).contains(&ratio) {
            e.say(code::PLAN_BAD_SIZE, s.origin, &[&s.keyword, "overlap", &o.to_string(), must]);
            return None;
        }
        by = by.min(d * (1.0 - ratio));
    }
    if by < d * 1e-3 {
        bad_size(e, step, "radial_cutting_depth", by, "more than a thousandth of the tool");
        return None;
    }
    Some(by)
}

/// A retract plane in the material is not used, and that is said.
pub(crate) fn retract_is_above(e: &mut Emit<'_>, o: &Operation, used: f64) {
    if let Some(r) = o.retract.filter(|r| *r <= 0.0) {
        let why = "it does not lie above the feature";
        e.say(code::PLAN_APPROACH_CHANGED, o.origin, &[&format!("the retract plane at {r} mm"), &format!("one at {used} mm"), why]);
    }
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
    fn moves(&self, e: &mut Emit<'_>) -> Done<Moves> {
        match &self.feature.shape {
            Shape::Face { .. } => self.face(e),
            Shape::Pocket { .. } | Shape::OpenPocket { .. } | Shape::Hole { .. } | Shape::Step { .. } => self.area(e),
            Shape::Outside { .. } | Shape::Boss(_) => self.around(e),
            Shape::Slot { path, section, ends } => self.slot(e, path, section, ends),
            Shape::Toolpath => Err("a tool path feature needs an explicit tool path".into()),
            _ => Err(String::new()),
        }
    }
    /// Whether nothing but the stock left on walls keeps the tool out.
    fn has_room_without_allowance(&self, e: &mut Emit<'_>) -> bool {
        let m = Milling { allowance_side: 0.0, ..self.m.clone() };
        let said = e.out.len();
        let fits = Job { m: &m, ..*self }.moves(e).is_ok();
        e.out.truncate(said);
        fits
    }
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
    /// Only walls are followed: 41 where they are on the right of the way, 42 on the left.
    fn beside_a_wall(&self) -> Option<u64> {
        let walls = matches!(
            self.feature.shape,
            Shape::Pocket { .. } | Shape::OpenPocket { .. } | Shape::Hole { .. } | Shape::Step { .. } | Shape::Outside { .. } | Shape::Boss(_)
        );
        let climb = self.cut_mode().unwrap_or(tp::CutMode::Climb) == tp::CutMode::Climb;
        (walls && !self.m.bottom).then_some(if climb { 41 } else { 42 })
    }
    fn start(&self) -> Option<P2> {
        // A start point at the origin is what programs write that have none.
        self.step.operation.start.filter(|p| *p != [0.0; 3]).map(|p| P2::new(p[0], p[1]))
    }
    fn clearing(&self) -> Done<tp::Clear> {
        let mut c = tp::Clear::new(self.radius, self.by, self.strategy()?);
        c.clean = self.clean;
        c.allowance = self.m.allowance_side;
        c.cut_mode = self.cut_mode();
        if let Some(s) = &self.m.strategy {
            c.rotation = s.ccw.map(|ccw| if ccw { tp::Rotation::Ccw } else { tp::Rotation::Cw });
            c.step_left = s.step_left.unwrap_or(true);
        }
        c.start = self.start();
        Ok(c)
    }
    fn heights(&self, top: f64, bottom: f64) -> tp::Depth {
        let safe = RUN_OUT.min(self.retract);
        tp::Depth { top: -top, bottom: -bottom, step: self.axial, clearance: self.retract, safe: safe - top, finish: 0.0 }
    }
    /// One level between two heights, however thick.
    fn level(&self, top: f64, bottom: f64) -> tp::Depth {
        let step = (bottom - top).max(1e-6);
        // Where only walls are cut, nothing is known to be empty above a place further in.
        let safe = RUN_OUT.min(self.retract) - if self.m.bottom { top } else { 0.0 };
        tp::Depth { step, safe, ..self.heights(top, bottom) }
    }
    fn entry(&self, open: bool) -> Done<tp::Entry> {
        let slanting = |a: &Approach| matches!(a, Approach::Ramp(_) | Approach::Helix(..) | Approach::Zigzag(..) | Approach::Angle(..));
        if self.two_axes && (slanting(&self.m.approach) || slanting(&self.m.retract)) {
            return Err("its tool direction TWO_AXES, against the slope of its approach: that needs three axes at once".into());
        }
        let to = |a: &Approach, way_in: bool| -> Done<tp::Approach> {
            Ok(match a {
                // Into a closed area a cutter that may not cut at its centre goes down slowly on a slope.
                Approach::None if way_in && !open && !self.two_axes => tp::Approach::Ramp { angle: USUAL_RAMP },
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
    /// What is given and says nothing about this feature.
    fn unused(&self, e: &mut Emit<'_>, moves: &Moves) {
        let (o, shape) = (&self.step.operation, &self.feature.shape);
        let say = |e: &mut Emit<'_>, origin: Origin, what: &str, of: &str, why: &str| {
            e.say(code::PLAN_NO_EFFECT, origin, &[what, &format!("#{} {of}", origin.id), why]);
        };
        let face = matches!(shape, Shape::Face { .. });
        if o.overcut.is_some() && self.bottom <= self.depth && !face {
            let open = matches!(shape, Shape::Slot { .. } | Shape::OpenPocket { .. } | Shape::Step { .. } | Shape::Outside { .. });
            let why = if open { "the tool passes open sides by its radius and 1 mm" } else { "it goes neither through nor over an edge" };
            say(e, o.origin, "overcut_length", &o.keyword, why);
        }
        if self.m.allowance_bottom != 0.0 && self.bottom > self.depth {
            say(e, o.origin, "allowance_bottom", &o.keyword, "it goes through: there is no floor");
        }
        if self.start().is_some() && (face || matches!(shape, Shape::Slot { .. })) {
            say(e, o.origin, "start_point", &o.keyword, "where it begins follows from the feature");
        }
        if let Some(s) = &self.m.strategy {
            if self.m.bottom && s.multiple == Some(false) {
                say(e, s.origin, "allow_multiple_passes", &s.keyword, "as many passes are made as the area needs");
            }
            if !self.m.bottom {
                let why = "a wall is followed in the direction of its cut mode";
                if s.ccw.is_some() {
                    say(e, s.origin, "rotation_direction", &s.keyword, why);
                }
            }
        }
        let out = |arc: bool| moves.iter().any(|m| m.tag == tp::Tag::Retract && matches!(m.kind, tp::Kind::Arc { .. }) == arc && m.kind != tp::Kind::Rapid);
        let given = match self.m.retract {
            Approach::Tangent(_) => out(true),
            Approach::Angle(..) => out(false),
            Approach::Ramp(_) | Approach::Helix(..) | Approach::Zigzag(..) => false,
            _ => true,
        };
        if !given {
            let why = "there is no room for it, or it is a way in";
            e.say(code::PLAN_APPROACH_CHANGED, o.origin, &["the way out", "one along the tool axis", why]);
        }
    }
    /// A helix, an arc or a slope that found no room was replaced by a slope or a plunge: that is said.
    fn check_approach(&self, e: &mut Emit<'_>, moves: &Moves) {
        let (what, with) = match &self.m.approach {
            Approach::Helix(..) => ("the helix of the approach", "a slope along the first pass"),
            Approach::Tangent(_) => ("the arc of the approach", "a plunge along the tool axis"),
            Approach::Angle(..) => ("the slope of the approach", "a plunge along the tool axis"),
            _ => return,
        };
        let mut found = 0;
        let mut starts = 0;
        let mut before: Option<&tp::Move> = None;
        let mut asked = false;
        for m in moves {
            if m.tag == tp::Tag::Approach {
                asked |= match (&self.m.approach, m.kind) {
                    (Approach::Angle(..), tp::Kind::Line) => before.is_some_and(|b| b.to.flat().dist(m.to.flat()) > 1e-9),
                    (_, kind) => matches!(kind, tp::Kind::Arc { .. }),
                };
            } else if before.is_some_and(|b| b.tag == tp::Tag::Approach) {
                starts += 1;
                found += usize::from(asked);
                asked = false;
            }
            before = Some(m);
        }
        if found < starts {
            let places = format!("at {} of {starts} places it has no room", starts - found);
            e.say(code::PLAN_APPROACH_CHANGED, self.step.operation.origin, &[what, with, &places]);
        }
    }
    fn name(&self) -> String {
        format!("#{} {}", self.feature.origin.id, self.feature.keyword)
    }
    /// What no tool of the plan reaches.
    fn leaves(&self, e: &mut Emit<'_>, text: &str) {
        if self.tells {
            let tool = format!("T{}", self.step.operation.tool.number);
            e.say(code::PLAN_UNREACHABLE_CORNER, self.step.operation.origin, &[&tool, &format!("{:.4}", self.radius), &self.name(), text]);
        }
    }
    /// Spots of an outline the tool does not reach, but for those in the air; `of` says which belong to the feature.
    fn rest(&self, e: &mut Emit<'_>, region: &tp::Region, air: &[tp::Region], of: impl Fn(P2) -> bool) {
        if !self.tells {
            return;
        }
        // A tool of exactly the size of a corner or a hole reaches all of it. What is left on purpose is not missed.
        let inner = if self.m.allowance_side > 0.0 { tp::erode(region, self.m.allowance_side) } else { Ok(vec![region.clone()]) };
        let Ok(inner) = inner else { return };
        let mut all: Vec<tp::Residual> = Vec::new();
        for region in &inner {
            let Ok(some) = tp::residuals(region, air, self.radius - 1e-6) else { return };
            all.extend(some);
        }
        all.sort_by(|a, b| b.area.total_cmp(&a.area));
        all.retain(|r| of(r.at));
        let total: f64 = all.iter().map(|r| r.area).sum();
        let Some(worst) = all.first() else { return };
        let at = self.feature.frame.point([worst.at.x, worst.at.y, 0.0]);
        let text = format!("{} spots, {total:.4} mm² in all, the largest at X{:.4} Y{:.4} with {:.4} mm²", all.len(), at[0], at[1], worst.area);
        self.leaves(e, &text);
    }
    /// Open ends of the feature, each with the way out: where the raw part goes on at the height of the floor, the
    /// run-out cuts into it, and that is said.
    fn open_ends(&self, e: &mut Emit<'_>, ends: &[(P2, P2)]) {
        let Ok((low, high)) = self.stock() else { return };
        let mut beyond = 0.0f64;
        for (at, out) in ends {
            // How far the block goes on.
            let room = |p: f64, d: f64, low: f64, high: f64| if d > 1e-9 { (high - p) / d } else if d < -1e-9 { (low - p) / d } else { f64::INFINITY };
            let on = room(at.x, out.x, low.x, high.x).min(room(at.y, out.y, low.y, high.y));
            if !(on > 1e-3) {
                continue;
            }
            let within = on.min(self.radius) / 2.0;
            let middle = *at + *out * within;
            let stands = self.feature.copies.iter().any(|f| {
                let top = |p: [f64; 3]| e.stock.as_ref().filter(|_| f.upright()).and_then(|s| s.top([p[0], p[1]], within.max(1e-3)));
                let floor = f.point([middle.x, middle.y, -self.bottom]);
                top(floor).is_none_or(|top| top > floor[2] + self.tolerance)
            });
            if stands {
                beyond = beyond.max(on);
            }
        }
        if beyond > 0.0 {
            e.say(code::PLAN_OVERRUNS_PART, self.step.origin, &[&self.name(), &format!("{beyond:.4}")]);
        }
    }
    /// The raw part in the frame of the feature: lower left and upper right corner.
    fn stock(&self) -> Done<(P2, P2)> {
        let [low, high] = self.step.stock.ok_or("how far it reaches follows from a raw block, and the workpiece has none")?;
        let (mut a, mut b) = (P2::new(f64::INFINITY, f64::INFINITY), P2::new(f64::NEG_INFINITY, f64::NEG_INFINITY));
        for corner in 0..8 {
            let p = std::array::from_fn(|i| if corner >> i & 1 == 1 { high[i] } else { low[i] });
            let q = self.feature.frame.inverse_point(p);
            (a, b) = (P2::new(a.x.min(q[0]), a.y.min(q[1])), P2::new(b.x.max(q[0]), b.y.max(q[1])));
        }
        Ok((a, b))
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

/// Down along its axis into material, a tool that has no edges at its middle rubs there.
fn plunges(e: &mut Emit<'_>, step: &Workingstep, to: [f64; 3]) {
    let (o, Some(at)) = (&step.operation, e.at) else { return };
    let down = (to[0] - at[0]).abs() + (to[1] - at[1]).abs() < crate::emit::TINY && to[2] < at[2];
    if down && o.tool.is_hollow() && e.stands_under(to, o.tool.diameter / 4.0) {
        e.say(code::STEP_FACEMILL_PLUNGE, o.origin, &[&format!("T{} {}", o.tool.number, o.tool.kind), &format!("#{} {}", o.origin.id, o.keyword)]);
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
            tp::Kind::Line => {
                plunges(e, step, to);
                e.line(to);
            }
            tp::Kind::Arc { centre, sweep } => {
                let z = e.at.map_or(m.to.z, |at| frame.inverse_point(at)[2]);
                e.arc(frame.point([centre.x, centre.y, z]), frame.z, to, sweep);
            }
        }
    }
}
