//! The drilling family: centre drilling, drilling, counter sinking, multistep drilling, boring, reaming,
//! tapping.

use gr_ir::{Op, Stop, Sync, Turn};
use gr_text::code;

use crate::emit::Emit;
use crate::frame::Frame;
use crate::process::*;

/// Above the bottom of the last peck, rapids end here, mm: as far as in LinuxCNC's own cycles (0.01 inch).
const ABOVE_LAST_PECK: f64 = 0.254;
/// Drills break through by this much, mm.
const BREAK_THROUGH: f64 = 1.0;
/// Room between a stepped-aside back-boring edge and its hole, mm.
const ASIDE: f64 = 0.2;
/// More pecks than this are a mistake.
const MOST_PECKS: f64 = 10_000.0;

/// What a hole is to the operation.
struct Job<'a> {
    step: &'a Workingstep,
    d: &'a Drilling,
    frame: Frame,
    depth: f64,
    retract: f64,
    feed: f64,
}

/// Drills every copy of a hole.
pub(crate) fn drill(e: &mut Emit<'_>, step: &Workingstep, d: &Drilling, feature: &Feature, security: f64) {
    let keyword = step.operation.keyword.as_str();
    if keyword == "THREAD_DRILLING" {
        return crate::mill::thread::drill(e, step, d, feature, security);
    }
    if !suits(e, step, d, feature) || keyword == "TAPPING" && !crate::mill::thread::suits(e, step, feature) {
        return;
    }
    let Some(depth) = depth(e, step, d, feature) else { return };
    let Some(feed) = step.operation.technology.feed else { return };
    let aside = if keyword == "BACK_BORING" {
        let Some(aside) = aside(e, step, d, feature) else { return };
        aside
    } else {
        [0.0; 2]
    };
    checks(e, step, d, feature, depth);
    for frame in &feature.copies {
        let top = frame.origin[2].max(frame.point([0.0, 0.0, 0.0])[2]);
        let usual = if frame.upright() { (security - top).max(0.0) } else { 5.0 };
        let retract = step.operation.retract.filter(|r| *r > 0.0).unwrap_or(usual);
        crate::mill::retract_is_above(e, &step.operation, retract);
        let job = Job { step, d, frame: *frame, depth, retract, feed };
        e.travel(job.at(retract), frame.z, security);
        e.technology(&step.operation.technology, step.operation.functions);
        match keyword {
            "TAPPING" => tap(e, &job),
            "MULTISTEP_DRILLING" => multistep(e, &job),
            "BACK_BORING" => back(e, &job, aside),
            _ => once(e, &job),
        }
    }
}

impl Job<'_> {
    /// On the axis, at a height over the feature.
    fn at(&self, z: f64) -> [f64; 3] {
        self.frame.point([0.0, 0.0, z])
    }
}

/// Whether the tool does this kind of work at all.
fn suits(e: &mut Emit<'_>, step: &Workingstep, d: &Drilling, feature: &Feature) -> bool {
    let (o, tool) = (&step.operation, &step.operation.tool);
    let is = |kinds: &[&str]| kinds.iter().any(|k| tool.kind.contains(k));
    let taps = tool.kind.contains("TAP") && !tool.kind.contains("TAPERED_END") && !tool.kind.contains("TAPERED_REAMER");
    let drills = matches!(o.keyword.as_str(), "DRILLING" | "MULTISTEP_DRILLING" | "CENTER_DRILLING");
    let cone = (o.keyword == "COUNTER_SINKING").then(|| other_cone(tool, feature)).flatten();
    let mut at = step.origin;
    let why = if let Some((words, false)) = cone {
        at = e.attribute(tool.origin, &TIP);
        format!("{words}: it would cut into its wall")
    } else if tool.no_retract && (!d.stop_at_bottom || d.test_cut.is_some()) && o.keyword != "BACK_BORING" {
        at = e.attribute(tool.origin, &["its_tool_body.retract_movement_forbidden", "retract_movement_forbidden"]);
        "its tool may not be drawn back while it turns, and the operation does not stop the spindle at the bottom".to_string()
    } else if o.keyword == "TAPPING" && !taps && !is(&["USER"]) {
        format!("a {} cuts no thread", tool.kind)
    } else if drills && (taps || tool.is_disc() || is(&["DOVETAIL", "THREAD_MILL", "BORING"])) {
        format!("a {} does not drill", tool.kind)
    } else {
        if drills && tool.is_hollow() {
            e.say(code::STEP_FACEMILL_PLUNGE, o.origin, &[&format!("T{} {}", tool.number, tool.kind), &format!("#{} {}", o.origin.id, o.keyword)]);
        }
        return true;
    };
    e.say(code::PLAN_CANNOT_CUT, at, &[&format!("#{} {}", feature.origin.id, feature.keyword), &why]);
    false
}

/// Where tools have the angle of their tip.
const TIP: [&str; 2] = ["its_tool_body.dimension.tool_tip_half_angle", "point_angle"];

/// A cone that is not that of the tool: what they are, and whether the tool leaves stock in it, not too little.
fn other_cone(tool: &Tool, feature: &Feature) -> Option<(String, bool)> {
    let Shape::Hole { diameter, final_diameter: Some(low), .. } = feature.shape else { return None };
    let (deep, angle) = (feature.depth, tool.tip_angle?);
    if !(low < diameter && deep > 0.0) {
        return None;
    }
    // As wide at the mouth as the cone, it is this wide at the cone's foot.
    let foot = diameter - 2.0 * deep * libm::tan(angle);
    let slack = 2.0 * feature.tolerance.unwrap_or(0.0).max(0.05);
    let short = gr_step::short;
    if tool.diameter < diameter - slack {
        return Some((format!("its cone is {} mm wide at its mouth, the tool {} mm", short(diameter), short(tool.diameter)), true));
    }
    let own = libm::atan2((diameter - low) / 2.0, deep).to_degrees();
    let words = format!("its cone goes from {} to {} mm over {} mm, {} degrees to its axis, that of the tool {}", short(diameter), short(low), short(deep), short(own), short(angle.to_degrees()));
    ((foot - low).abs() > slack).then_some((words, foot < low))
}

fn depth(e: &mut Emit<'_>, step: &Workingstep, d: &Drilling, feature: &Feature) -> Option<f64> {
    let tool = &step.operation.tool;
    let tip = Some(tip(tool)).filter(|t| *t > 0.0);
    let hole = match &feature.shape {
        Shape::Hole { diameter, bottom, .. } => Some((*diameter, *bottom)),
        _ => None,
    };
    // Counted to the tip, as files have it.
    let given = d.depth.or(match step.operation.keyword.as_str() {
        "CENTER_DRILLING" => None,
        "COUNTER_SINKING" => hole.and_then(|(w, _)| tool.sinks(w)),
        "TAPPING" => Some(match feature.shape {
            Shape::Thread { start, length, .. } if length > 0.0 => (start + length).min(feature.depth),
            _ => feature.depth,
        }),
        "REAMING" | "BORING" | "BACK_BORING" => Some(feature.depth),
        _ => Some(match hole {
            Some((_, HoleBottom::Through)) => {
                feature.depth + tip.unwrap_or(0.0) + step.operation.overcut.unwrap_or(BREAK_THROUGH)
            }
            Some((_, HoleBottom::Conical(..))) => feature.depth + tip.unwrap_or(0.0),
            _ => feature.depth,
        }),
    });
    match given {
        Some(v) if v.is_finite() && v > 0.0 && v < 1e6 => Some(v),
        Some(v) => {
            e.say(code::PLAN_BAD_SIZE, step.operation.origin, &[&step.operation.keyword, "cutting_depth", &v.to_string(), "above zero"]);
            None
        }
        None => {
            e.say(code::PLAN_MISSING_VALUE, step.operation.origin, &[&step.operation.keyword, "cutting_depth", "it does not follow from the feature"]);
            None
        }
    }
}

/// How far a back-boring tool steps aside to pass the hole it works behind, and which way.
fn aside(e: &mut Emit<'_>, step: &Workingstep, d: &Drilling, feature: &Feature) -> Option<[f64; 2]> {
    let (o, t) = (&step.operation, &step.operation.tool);
    let missing = |e: &mut Emit<'_>, what: &str, why: &str| e.say(code::PLAN_MISSING_VALUE, o.origin, &[&o.keyword, what, why]);
    let Some(hole) = d.previous else {
        missing(e, "previous_diameter", "the tool has to pass the hole it works behind");
        return None;
    };
    if d.depth.is_none() {
        missing(e, "cutting_depth", "it says how far back the tool bores");
        return None;
    }
    let Some(edge) = t.orientation.filter(|o| o[0] != 0.0 || o[1] != 0.0) else {
        missing(e, "its_tool.direction_for_spindle_orientation", "the tool has to step aside, away from where its edge points");
        return None;
    };
    let by = (t.diameter - hole) / 2.0 + ASIDE;
    let room = hole / 2.0 - by - t.bar.unwrap_or(0.0) / 2.0;
    if by < ASIDE || room < 0.0 {
        let what = format!("#{} {}", feature.origin.id, feature.keyword);
        let why = format!("a tool of {} mm stepped aside by {by} mm does not pass a hole of {hole} mm", t.diameter);
        e.say(code::PLAN_CANNOT_CUT, step.origin, &[&what, &why]);
        return None;
    }
    let rule = "its depth counts from the far side of the part towards the spindle; the oriented edge points as the tool says, seen in the machine";
    e.say(code::PLAN_TAKES_TURNS, o.origin, &[&o.keyword, rule]);
    let n = libm::hypot(edge[0], edge[1]);
    Some([-edge[0] / n * by, -edge[1] / n * by])
}

/// Through the hole stepped aside with the spindle oriented, back to the middle behind it, up at feed, and out again.
fn back(e: &mut Emit<'_>, job: &Job<'_>, aside: [f64; 2]) {
    let o = &job.step.operation;
    let far = job.step.feature.depth;
    let below = far + BREAK_THROUGH + o.tool.cutting_length.unwrap_or(0.0).min(job.depth);
    let over = |z: f64| crate::frame::add(job.at(z), [aside[0], aside[1], 0.0]);
    let way = if o.technology.clockwise { Turn::Cw } else { Turn::Ccw };
    let orient = |e: &mut Emit<'_>| {
        e.turn(Turn::Stop);
        e.push(Op::SpindleOrient { spindle: 0, angle: 0.0, direction: 0 });
    };
    orient(e);
    e.rapid_as_written(over(job.retract));
    e.rapid_as_written(over(-below));
    e.feed(job.feed);
    e.line(job.at(-below));
    e.turn(way);
    e.line(job.at(-(far - job.depth)));
    if job.d.dwell > 0.0 {
        e.push(Op::Dwell(job.d.dwell));
    }
    e.line(job.at(-below));
    orient(e);
    e.line(over(-below));
    e.rapid_as_written(over(job.retract));
    e.rapid_as_written(job.at(job.retract));
    e.turn(way);
}

fn checks(e: &mut Emit<'_>, step: &Workingstep, d: &Drilling, feature: &Feature, depth: f64) {
    let tool = &step.operation.tool;
    let name = format!("T{} '{}'", tool.number, tool.name);
    if let Some(l) = tool.cutting_length.filter(|l| depth > *l + 1e-6) {
        e.say(code::PLAN_DEEPER_THAN_EDGE, step.operation.origin, &[&step.operation.keyword, &depth.to_string(), &name, &l.to_string()]);
    }
    let through = matches!(feature.shape, Shape::Hole { bottom: HoleBottom::Through, .. });
    let drills = matches!(step.operation.keyword.as_str(), "DRILLING" | "MULTISTEP_DRILLING");
    if step.operation.overcut.is_some() && !(through && drills && d.depth.is_none()) {
        let of = format!("#{} {}", step.operation.origin.id, step.operation.keyword);
        e.say(code::PLAN_NO_EFFECT, step.operation.origin, &["overcut_length", &of, "the depth of the cut is given, or is that of the feature"]);
    }
    beyond(e, step, feature, depth);
    let [start, end] = stretches(d, depth);
    if let (Some(first), Some(last)) = (d.first, d.last)
        && start > end
        && (first.feed, first.speed) != (last.feed, last.speed)
    {
        let rule = format!("its reduced stretches at start and end overlap in a cut of {depth} mm: from {end} to {start} mm the lower feed and speed of the two hold");
        e.say(code::PLAN_TAKES_TURNS, Origin { span: last.span, ..step.operation.origin }, &[&format!("#{} {}", step.operation.origin.id, step.operation.keyword), &rule]);
    }
    if let Shape::Hole { diameter, .. } = feature.shape {
        let whole = !matches!(step.operation.keyword.as_str(), "CENTER_DRILLING" | "COUNTER_SINKING");
        // A thread goes into the wall of its core hole.
        let threads = matches!(step.operation.keyword.as_str(), "TAPPING" | "THREAD_DRILLING");
        let room = if threads { diameter * gr_step::THREAD_OVER_CORE } else { diameter };
        if whole && tool.diameter > room + 0.05 {
            e.say(code::PLAN_TOOL_WIDER_THAN_FEATURE, step.operation.origin, &[&name, &tool.diameter.to_string(), &feature.keyword, &diameter.to_string()]);
        }
        let slack = 2.0 * feature.tolerance.unwrap_or(0.0).max(0.05);
        if step.operation.keyword == "TAPPING" && tool.kind == "TAP" && tool.diameter + slack < diameter {
            let what = format!("#{} {}", step.operation.origin.id, step.operation.keyword);
            let why = format!("its tap of {} mm is narrower than the hole of {diameter} mm", tool.diameter);
            e.say(code::PLAN_AIR, step.operation.origin, &[&what, &why]);
        }
    }
}

/// An operation that goes deeper or opens its hole wider than the feature says.
fn beyond(e: &mut Emit<'_>, step: &Workingstep, feature: &Feature, depth: f64) {
    let (o, tool) = (&step.operation, &step.operation.tool);
    let slack = feature.tolerance.unwrap_or(0.0).max(0.05);
    let point = tip(tool);
    let deepest = match &feature.shape {
        // The point of a countersink is in the hole below its cone.
        Shape::Hole { diameter, final_diameter: Some(low), .. } if o.keyword == "COUNTER_SINKING" && tool.tip_angle.is_some() => {
            let wide = if low < diameter { *diameter } else { *low };
            tool.sinks(wide).unwrap_or(0.0).max(feature.depth)
        }
        Shape::Hole { bottom: HoleBottom::Through, .. } => feature.depth + point + o.overcut.unwrap_or(0.0).max(BREAK_THROUGH),
        Shape::Hole { diameter, bottom: HoleBottom::Conical(angle, _), .. } => feature.depth + diameter / 2.0 / libm::tan(crate::mill::area::half_angle(*angle)).max(1e-3),
        Shape::Hole { .. } | Shape::Thread { .. } => feature.depth,
        _ => return,
    };
    let (what, of) = (format!("#{} {}", o.origin.id, o.keyword), format!("#{} {}", feature.origin.id, feature.keyword));
    if depth > deepest + slack {
        e.say(code::PLAN_BEYOND_FEATURE, o.origin, &[&what, &of, &format!("{:.4} mm deep, {:.4} mm deeper than it", depth, depth - deepest)]);
    }
    let opens = matches!(o.keyword.as_str(), "CENTER_DRILLING" | "COUNTER_SINKING");
    if let (Shape::Hole { diameter, final_diameter, .. }, Some(wide), true) = (&feature.shape, tool.opens(depth), opens) {
        let most = final_diameter.map_or(*diameter, |f| f.max(*diameter));
        if wide.is_finite() && wide > most + 2.0 * slack {
            e.say(code::PLAN_BEYOND_FEATURE, o.origin, &[&what, &of, &format!("it opens a hole of {most:.4} mm to {wide:.4} mm")]);
        }
    }
}

/// Height of a tool's point.
fn tip(tool: &Tool) -> f64 {
    let tip = tool.tip_angle.filter(|_| tool.is_pointed()).map_or(0.0, |a| tool.diameter / 2.0 / libm::tan(a));
    if tip.is_finite() && tip > 0.0 { tip } else { 0.0 }
}

/// What the operations on a hole leave in it. Holes that are milled too tell that themselves.
pub(crate) fn leftovers(e: &mut Emit<'_>, steps: &[(&Workingstep, &Feature)]) {
    let drills = |s: &Workingstep| matches!(s.operation.kind, OperationKind::Drill(_)) && s.operation.toolpaths.is_empty();
    // What follows from a point that no drill has is not told besides it.
    if steps.iter().all(|(s, _)| drills(s) && !s.operation.tool.is_needle()) {
        narrow_sink(e, steps);
        wide_sink(e, steps);
        short_of_bottom(e, steps);
        left_on_walls(e, steps);
    }
}

/// A cone that nothing but countersinks cut, none of them as deep as its width needs: their depth counts to the tip.
fn narrow_sink(e: &mut Emit<'_>, steps: &[(&Workingstep, &Feature)]) {
    let Some((_, feature)) = steps.first().filter(|_| steps.iter().all(|(s, _)| s.operation.keyword == "COUNTER_SINKING")) else { return };
    let Shape::Hole { diameter, final_diameter: Some(_), .. } = &feature.shape else { return };
    let slack = feature.tolerance.unwrap_or(0.0).max(0.05);
    let sinks = steps.iter().filter_map(|(s, _)| match &s.operation.kind {
        OperationKind::Drill(d) => Some((&s.operation, d, d.depth?, s.operation.tool.opens(d.depth?)?)),
        _ => None,
    });
    let widest = sinks.max_by(|a, b| a.3.total_cmp(&b.3));
    let Some((o, d, depth, wide)) = widest.filter(|(.., wide)| *wide < diameter - 2.0 * slack) else { return };
    let short = gr_step::short;
    let (what, of) = (format!("#{} {}", o.origin.id, o.keyword), format!("#{} {}", feature.origin.id, feature.keyword));
    let deep = format!("{} mm deep with its tip, where it opens a cone of {} mm", short(depth), short(wide));
    let cone = format!("a cone of {} mm that is {}", short(*diameter), short(feature.depth));
    let wanted = short((o.tool.sinks(*diameter).unwrap_or(depth) * 1e4).ceil() / 1e4);
    e.say(code::PLAN_SHORT_OF_BOTTOM, Origin { span: d.depth_span, ..o.origin }, &[&what, &deep, &of, &cone, &wanted]);
}

/// A cone that is cut by countersinks with a blunter one alone.
fn wide_sink(e: &mut Emit<'_>, steps: &[(&Workingstep, &Feature)]) {
    let mut all = steps.iter().map(|(s, f)| (s, f, Some(other_cone(&s.operation.tool, f)).filter(|_| s.operation.keyword == "COUNTER_SINKING").flatten()));
    // With a depth of its own it is told by that how wide the cone gets.
    let told = |s: &Workingstep, f: &Feature| {
        let narrow = matches!(f.shape, Shape::Hole { diameter, .. } if s.operation.tool.diameter < diameter);
        narrow && matches!(&s.operation.kind, OperationKind::Drill(d) if d.depth.is_some())
    };
    if !all.clone().all(|(s, f, cone)| matches!(cone, Some((_, true))) && !told(s, f)) {
        return;
    }
    if let Some((s, f, Some((words, _)))) = all.next_back() {
        let (tool, of) = (&s.operation.tool, format!("#{} {}", f.origin.id, f.keyword));
        let at = e.attribute(tool.origin, &TIP);
        e.say(code::PLAN_UNREACHABLE_CORNER, at, &[&format!("T{}", tool.number), &format!("{:.4}", tool.diameter / 2.0), &of, &words]);
    }
}

/// The operation that gets nearest to the bottom of a hole, where none of those that make it as wide as it becomes gets there.
fn short_of_bottom(e: &mut Emit<'_>, steps: &[(&Workingstep, &Feature)]) {
    let made = |keywords: &[&str]| -> Vec<(&Workingstep, &Feature, &Drilling)> {
        let drilling = |s: &'_ Workingstep| keywords.contains(&s.operation.keyword.as_str());
        steps.iter().filter(|(s, _)| drilling(s)).filter_map(|(s, f)| if let OperationKind::Drill(d) = &s.operation.kind { Some((*s, *f, d)) } else { None }).collect()
    };
    // Reamers and boring tools may stop above the bottom of what was drilled.
    let (drills, sizes) = (made(&["DRILLING", "MULTISTEP_DRILLING"]), made(&["DRILLING", "MULTISTEP_DRILLING", "BORING", "REAMING"]));
    let all = if sizes.is_empty() { made(&["CENTER_DRILLING"]) } else { sizes };
    let widest = if drills.is_empty() { &all } else { &drills }.iter().map(|(s, ..)| s.operation.tool.diameter).fold(0.0, f64::max);
    let Some((_, feature, _)) = all.first() else { return };
    let Shape::Hole { bottom, .. } = &feature.shape else { return };
    let slack = feature.tolerance.unwrap_or(0.0).max(0.05);
    // Depths of cut count to the tip; that of a hole that is through, or has a cone below it, to where it is as wide as the tool.
    let whole = matches!(bottom, HoleBottom::Through | HoleBottom::Conical(..));
    let point = |s: &Workingstep| if whole { tip(&s.operation.tool) } else { 0.0 };
    // Without a depth of its own an operation goes as deep as the hole needs.
    let reach = |s: &Workingstep, d: &Drilling| d.depth.map_or(f64::INFINITY, |v| v - point(s));
    let wide = all.iter().filter(|(s, ..)| s.operation.tool.diameter >= widest - 2.0 * slack);
    let Some((step, _, d)) = wide.max_by(|a, b| reach(a.0, a.2).total_cmp(&reach(b.0, b.2))) else { return };
    let (Some(cut), point) = (d.depth, point(step)) else { return };
    if feature.depth - (cut - point) > slack {
        let o = &step.operation;
        let (what, of) = (format!("#{} {}", o.origin.id, o.keyword), format!("#{} {}", feature.origin.id, feature.keyword));
        let deep = match gr_step::short(cut - point) {
            wide if cut > point && point > 0.0 => format!("{wide} mm deep at its full width"),
            _ if point > 0.0 => format!("{} mm deep, no further than with its point", gr_step::short(cut)),
            cut => format!("{cut} mm deep"),
        };
        let wanted = gr_step::short(((feature.depth + point) * 1e4).ceil() / 1e4);
        e.say(code::PLAN_SHORT_OF_BOTTOM, Origin { span: d.depth_span, ..o.origin }, &[&what, &deep, &of, &gr_step::short(feature.depth), &wanted]);
        // Some programs count the angle of the point from the face of the tool: then the depth is the hole's and its point.
        let (radius, half) = (o.tool.diameter / 2.0, o.tool.tip_angle.unwrap_or(0.0));
        if (cut - feature.depth - radius * libm::tan(half)).abs() < 1e-3
            && let Some(told) = e.out.last_mut().filter(|d| d.code == code::PLAN_SHORT_OF_BOTTOM && d.notes.is_empty())
        {
            let (is, meant) = (half.to_degrees(), 90.0 - half.to_degrees());
            told.notes.push(format!(
                "{} is the depth of the hole and the point of a drill of {} degrees: if its tip half angle of {} degrees was counted from the face, and not from the axis as the standard does, correct that instead",
                gr_step::short(cut), gr_step::short(meant), gr_step::short(is)
            ));
        }
    }
}

/// What the last of the drilling operations leaves on the walls and the floor of a hole.
fn left_on_walls(e: &mut Emit<'_>, steps: &[(&Workingstep, &Feature)]) {
    let sizes = |o: &Operation| matches!(o.keyword.as_str(), "DRILLING" | "MULTISTEP_DRILLING" | "BORING" | "REAMING");
    let Some((step, feature)) = steps.iter().rev().find(|(s, _)| sizes(&s.operation)) else { return };
    let Shape::Hole { diameter, final_diameter, bottom } = &feature.shape else { return };
    let slack = feature.tolerance.unwrap_or(0.0).max(0.05);
    let widest = steps.iter().filter(|(s, _)| sizes(&s.operation)).map(|(s, _)| s.operation.tool.diameter).fold(0.0, f64::max);
    let tool = &step.operation.tool;
    let mut left = Vec::new();
    if widest < diameter - 2.0 * slack {
        left.push(format!("{:.4} mm all round its wall", (diameter - widest) / 2.0));
    }
    if let Some(f) = final_diameter.filter(|f| (f - diameter).abs() > 2.0 * slack && tool.taper == 0.0) {
        left.push(format!("its wall goes from {diameter} to {f} mm, the tool is as wide all the way"));
    }
    let pointed = steps.iter().filter(|(s, _)| sizes(&s.operation)).map(|(s, _)| tip(&s.operation.tool)).fold(f64::INFINITY, f64::min);
    match bottom {
        HoleBottom::Through => {}
        HoleBottom::Conical(angle, _) => {
            let cone = diameter / 2.0 / libm::tan(crate::mill::area::half_angle(*angle)).max(1e-3);
            if (cone - pointed).abs() > 2.0 * slack && pointed < cone {
                left.push(format!("its cone is {cone:.4} mm deep, the point of the tool {pointed:.4} mm"));
            }
        }
        _ if pointed > slack => left.push(format!("the cone of the tool's point, {pointed:.4} mm high, in its floor")),
        _ => {}
    }
    if !left.is_empty() {
        let (name, of) = (format!("T{}", tool.number), format!("#{} {}", feature.origin.id, feature.keyword));
        e.say(code::PLAN_UNREACHABLE_CORNER, step.operation.origin, &[&name, &format!("{:.4}", tool.diameter / 2.0), &of, &left.join("; ")]);
    }
}

/// One stroke down, and out again as the operation does.
fn once(e: &mut Emit<'_>, job: &Job<'_>) {
    let (d, o) = (job.d, &job.step.operation);
    if let Some((test, waiting)) = d.test_cut {
        e.feed(job.feed);
        e.line(job.at(-test));
        e.line(job.at(job.retract));
        let wait = waiting.map_or(job.at(job.retract), |p| job.frame.point(p));
        e.rapid(wait);
        e.push(Op::Stop(Stop::Program));
        e.rapid(job.at(job.retract));
    }
    down(e, job);
    if d.dwell > 0.0 {
        e.push(Op::Dwell(d.dwell));
    }
    let fed = d.feed_on_retract.is_some() || matches!(o.keyword.as_str(), "REAMING" | "BORING") && !d.stop_at_bottom;
    if d.stop_at_bottom {
        e.turn(Turn::Stop);
    }
    if fed {
        e.feed(job.feed * d.feed_on_retract.unwrap_or(1.0));
        e.line(job.at(job.retract));
    } else {
        e.rapid(job.at(job.retract));
    }
    if d.stop_at_bottom {
        e.turn(if o.technology.clockwise { Turn::Cw } else { Turn::Ccw });
    }
    if let Some(s) = o.technology.speed {
        e.speed(s);
    }
}

/// Feed to the bottom, slower over the stretches that the strategy names. Where both hold, the lower feed and speed do.
fn down(e: &mut Emit<'_>, job: &Job<'_>) {
    let t = &job.step.operation.technology;
    let [start, end] = stretches(job.d, job.depth);
    let mut from = 0.0;
    for to in [start.min(end), start.max(end), job.depth] {
        if to <= from {
            continue;
        }
        let here = [job.d.first.filter(|_| to <= start), job.d.last.filter(|_| from >= end)];
        let least = |share: fn(Reduced) -> f64| here.into_iter().flatten().map(share).reduce(f64::min).unwrap_or(1.0);
        if let Some(s) = t.speed {
            e.speed(s * least(|r| r.speed));
        }
        e.feed(job.feed * least(|r| r.feed));
        e.line(job.at(-to));
        from = to;
    }
}

/// How deep the first reduced stretch ends, and how deep the last one begins.
fn stretches(d: &Drilling, depth: f64) -> [f64; 2] {
    [d.first.map_or(0.0, |r| r.length.min(depth)), d.last.map_or(depth, |r| (depth - r.length).max(0.0))]
}

fn multistep(e: &mut Emit<'_>, job: &Job<'_>) {
    let [first, by, retract, dwell] = job.d.peck.unwrap_or_default();
    if !(first > 0.0 && by > 0.0 && retract.is_finite()) || job.depth / by > MOST_PECKS {
        let text = format!("first {first}, then {by}");
        return e.say(code::PLAN_BAD_SIZE, job.step.operation.origin, &["MULTISTEP_DRILLING", "depth_of_step", &text, "above zero"]);
    }
    let mut z = 0.0;
    loop {
        z = if z == 0.0 { first } else { z + by };
        let bottom = z >= job.depth - 1e-9;
        z = z.min(job.depth);
        e.feed(job.feed);
        e.line(job.at(-z));
        if bottom {
            break;
        }
        if dwell > 0.0 {
            e.push(Op::Dwell(dwell));
        }
        // Just enough to break the chip; all the way out without a distance.
        let up = if retract > 0.0 { (-z + retract).min(job.retract) } else { job.retract };
        e.rapid(job.at(up));
        let clear = (-z + ABOVE_LAST_PECK).min(up);
        if clear < up {
            e.rapid(job.at(clear));
        }
    }
    if job.d.dwell > 0.0 {
        e.push(Op::Dwell(job.d.dwell));
    }
    match job.d.feed_on_retract {
        Some(ratio) => {
            e.feed(job.feed * ratio);
            e.line(job.at(job.retract));
        }
        None => e.rapid(job.at(job.retract)),
    }
}

fn tap(e: &mut Emit<'_>, job: &Job<'_>) {
    let t = &job.step.operation.technology;
    let Some(speed) = t.speed else { return };
    let thread = match &job.step.feature.shape {
        Shape::Thread { pitch, .. } => *pitch,
        _ => None,
    };
    if let Shape::Thread { start, .. } = job.step.feature.shape {
        crate::mill::thread::from_the_top(e, job.step, &job.step.feature, start);
    }
    let pitch = job.step.operation.tool.pitch.or(thread).unwrap_or(job.feed * 60.0 / speed);
    let fed = pitch * speed / 60.0;
    if (fed - job.feed).abs() > 0.01 * fed {
        let at = e.attribute(t.origin, &["feedrate", "feedrate_per_tooth"]);
        let show = |f: f64| gr_step::short(f * 60.0);
        let why = format!("a tap goes in step with its spindle: {} mm a turn at {} rpm are {} mm/min, not {}", gr_step::short(pitch), gr_step::short(speed), show(fed), show(job.feed));
        e.say(code::PLAN_NO_EFFECT, at, &["the feed", &format!("#{} MILLING_TECHNOLOGY", t.origin.id), &why]);
    }
    if job.d.floating_chuck {
        let way = if t.clockwise { (Turn::Cw, Turn::Ccw) } else { (Turn::Ccw, Turn::Cw) };
        e.feed(fed);
        // Feed and speed belong together here: nobody may change one of them.
        let locks = (t.lock_feed, t.lock_spindle);
        e.locks(true, true);
        e.line(job.at(-job.depth));
        e.turn(Turn::Stop);
        e.turn(way.1);
        if job.d.dwell > 0.0 {
            e.push(Op::Dwell(job.d.dwell));
        }
        e.line(job.at(job.retract));
        e.turn(Turn::Stop);
        e.turn(way.0);
        e.locks(locks.0, locks.1);
        return;
    }
    e.push(Op::SyncStart(Sync { spindle: 0, per_rev: pitch, velocity: false }));
    let bottom = e.placed(job.at(-job.depth));
    e.push(Op::RigidTap { bottom, scale: 1.0 });
    e.drilled(job.at(-job.depth));
    e.push(Op::SyncStop);
}
