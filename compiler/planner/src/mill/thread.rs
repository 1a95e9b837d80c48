//! Threads by a thread mill, or by a tool that drills and threads: a helix up or down the flank, begun and ended on half circles that touch it.

use std::f64::consts::PI;

use gr_text::code;

use super::RUN_OUT;
use crate::emit::Emit;
use crate::process::*;

/// How deep an outer ISO metric thread is, in pitches: its minor diameter is d - 1.22687 P (ISO 724, ISO 68-1).
const OUTER_DEPTH: f64 = 1.22687 / 2.0;
/// More turns than this are a mistake.
const MOST_TURNS: f64 = 10_000.0;

/// Two pitches are one to this share of them: threads per inch are written as rounded millimetres too.
const SAME_PITCH: f64 = 2e-3;

/// Whether a tool that makes a thread is made for this one: its hand and its size, where it has them in it, and its pitch.
pub(crate) fn suits(e: &mut Emit<'_>, step: &Workingstep, feature: &Feature) -> bool {
    let Shape::Thread { major, pitch, right, inner, .. } = &feature.shape else { return true };
    let (o, tool) = (&step.operation, &step.operation.tool);
    let (short, hand) = (gr_step::short, |right: bool| if right { "right-handed" } else { "left-handed" });
    let slack = 2.0 * feature.tolerance.unwrap_or(0.0).max(0.05) + 1e-9;
    let other_pitch = tool.pitch.zip(*pitch).filter(|(a, b)| (a - b).abs() > SAME_PITCH * b);
    let tap = o.keyword == "TAPPING";
    let size = [(tool.thread_size, "thread_size"), (Some(tool.diameter).filter(|_| tap), "its_tool_body.dimension.diameter")];
    let other_size = size.into_iter().find_map(|(s, at)| s.filter(|s| (s - major).abs() > slack).map(|s| (s, at)));
    let (at, why) = if let Some((own, of)) = other_pitch {
        (e.attribute(tool.origin, &["thread_pitch"]), format!("the pitch of its tool is {} mm, that of the thread {} mm", short(own), short(of)))
    } else if let Some((own, at)) = other_size {
        (e.attribute(tool.origin, &[at, "effective_cutting_diameter"]), format!("it is a thread of {} mm, its tool makes one of {} mm", short(*major), short(own)))
    } else if tap && !inner {
        (e.attribute(feature.origin, &["inner_or_outer_thread"]), "a tap cuts inner threads, this is an outer one".into())
    } else if let Some(own) = tool.right_handed.filter(|own| tap && own != right) {
        let at = e.attribute(tool.origin, &["its_tool_body.hand_of_cut", "hand_of_cut"]);
        (at, format!("the thread is {}, its tap {}", hand(*right), hand(own)))
    } else if tap && tool.right_handed.is_none() && o.technology.clockwise != *right {
        let way = if o.technology.clockwise { "clockwise" } else { "counter-clockwise" };
        (e.attribute(o.technology.origin, &["spindle"]), format!("the thread is {}, the spindle turns {way}", hand(*right)))
    } else {
        return true;
    };
    e.say(code::PLAN_CANNOT_CUT, at, &[&format!("#{} {}", feature.origin.id, feature.keyword), &why]);
    false
}

/// A tool that cuts its thread from the top on, where the thread begins below it.
pub(crate) fn from_the_top(e: &mut Emit<'_>, step: &Workingstep, feature: &Feature, start: f64) {
    if start > 0.0 {
        let at = e.attribute(feature.origin, &["partial_profile.placement"]);
        let (what, of) = (format!("#{} {}", step.operation.origin.id, step.operation.keyword), format!("#{} {}", feature.origin.id, feature.keyword));
        e.say(code::PLAN_BEYOND_FEATURE, at, &[&what, &of, &format!("its thread begins {} mm below the top, the tool cuts it from the top on", gr_step::short(start))]);
    }
}

/// A tool that is wider than the hole it goes down into.
fn too_wide(e: &mut Emit<'_>, step: &Workingstep, feature: &Feature, bore: f64) -> bool {
    let tool = &step.operation.tool;
    let wide = tool.diameter > bore + 1e-9;
    if wide {
        let at = e.attribute(tool.origin, &["its_tool_body.dimension.diameter", "effective_cutting_diameter"]);
        let of = format!("the hole of #{} {}", feature.origin.id, feature.keyword);
        e.say(code::PLAN_TOOL_WIDER_THAN_FEATURE, at, &[&format!("T{} '{}'", tool.number, tool.name), &tool.diameter.to_string(), &of, &gr_step::short(bore)]);
    }
    wide
}

pub(super) fn mill(e: &mut Emit<'_>, step: &Workingstep, m: &Milling, feature: &Feature, security: f64) {
    let Shape::Thread { major, pitch, right, inner, start, length, bore } = &feature.shape else { return };
    let o = &step.operation;
    let Some(pitch) = o.tool.pitch.or(*pitch).filter(|p| *p > 0.0) else {
        let why = "the thread says neither threads per inch nor is the tool's pitch known";
        return e.say(code::PLAN_MISSING_VALUE, feature.origin, &[&feature.keyword, "number_of_threads", why]);
    };
    let name = format!("#{} {}", feature.origin.id, feature.keyword);
    let cannot = |e: &mut Emit<'_>, why: &str| e.say(code::PLAN_CANNOT_CUT, step.origin, &[&name, why]);
    if !o.tool.kind.contains("THREAD") {
        return cannot(e, "a thread is milled by a thread mill");
    }
    let r = o.tool.diameter / 2.0;
    let radius = if *inner { major / 2.0 - r - m.allowance_side } else { major / 2.0 - OUTER_DEPTH * pitch + r + m.allowance_side };
    let long = match (*length > 0.0, feature.depth > 0.0) {
        (true, true) => length.min(feature.depth - start),
        (true, false) => *length,
        _ => feature.depth - start,
    };
    if !suits(e, step, feature) || *inner && too_wide(e, step, feature, bore.unwrap_or(major - pitch)) {
        return;
    }
    if *inner && radius <= 1e-3 {
        return cannot(e, &format!("its tool of {} mm is no smaller than the thread", o.tool.diameter));
    }
    if !(long > 0.0) || long / pitch > MOST_TURNS || o.technology.feed.is_none() {
        return cannot(e, "its length is none, or takes too many turns");
    }
    // A comb as long as the thread cuts it in one turn, a single row in as many as there are pitches.
    let turns = if o.tool.cutting_length.is_some_and(|l| l >= long) { 1.0 } else { (long / pitch - 1e-9).ceil() };
    // The tool climbs out of a blind hole; climb milling goes round with the spindle's sense reversed.
    let climb = m.strategy.as_ref().and_then(|s| s.climb).unwrap_or(true) == o.technology.clockwise;
    let ccw = climb == *inner;
    let up = ccw == *right;
    let low = -start - long;
    let (from, to) = if up { (low, low + pitch * turns) } else { (low + pitch * turns, low) };
    let way = if up { 1.0 } else { -1.0 };
    let sense = if ccw { 1.0 } else { -1.0 };
    let retract = o.retract.filter(|r| *r > 0.0).unwrap_or(RUN_OUT);
    super::retract_is_above(e, o, retract);
    let without_effect = |e: &mut Emit<'_>, given: bool, what: &str| {
        if given {
            e.say(code::PLAN_NO_EFFECT, o.origin, &[what, &format!("#{} {}", o.origin.id, o.keyword), "a thread is cut in one go along its helix"]);
        }
    };
    without_effect(e, o.start.is_some(), "start_point");
    without_effect(e, o.overcut.is_some(), "overcut_length");
    without_effect(e, m.radial.is_some(), "radial_cutting_depth");
    without_effect(e, m.axial.is_some(), "axial_cutting_depth");
    without_effect(e, m.approach != Approach::None, "approach");
    without_effect(e, m.retract != Approach::None, "retract");
    // Half a circle in: from the axis of a hole, from outside a stud.
    let lead = if *inner { radius / 2.0 } else { r + RUN_OUT };
    let away = if *inner { 0.0 } else { radius + 2.0 * lead };
    // Out with the pitch; in with it only from above, so that nothing is cut below the thread.
    let rise = way * pitch / 4.0;
    let first = if up { 0.0 } else { rise };
    for frame in &feature.copies {
        let at = |x: f64, z: f64| frame.point([x, 0.0, z]);
        e.travel(at(away, retract), frame.z, security);
        e.technology(&o.technology, o.functions);
        // Down the axis of the hole, or beside the stud: nothing is cut there.
        e.line(at(away, from - first));
        let sweep = if *inner { sense * PI } else { -sense * PI };
        let middle = (radius + away) / 2.0;
        e.arc(at(middle, from - first), frame.z, at(radius, from), sweep);
        let mut z = from;
        for k in 1..=turns as usize {
            let next = from + (to - from) * k as f64 / turns;
            e.arc(at(0.0, z), frame.z, at(radius, next), sense * 2.0 * PI);
            z = next;
        }
        e.arc(at(middle, to), frame.z, at(away, to + rise), sweep);
        e.line(at(away, retract.max(to + rise)));
    }
}

/// Drilling and threading with one tool: straight down its axis, or already on the helix, and out on the helix.
pub(crate) fn drill(e: &mut Emit<'_>, step: &Workingstep, d: &Drilling, feature: &Feature, security: f64) {
    let o = &step.operation;
    let name = format!("#{} {}", feature.origin.id, feature.keyword);
    let cannot = |e: &mut Emit<'_>, why: &str| e.say(code::PLAN_CANNOT_CUT, step.origin, &[&name, why]);
    let Shape::Thread { major, pitch, right, inner: true, start, length, bore } = &feature.shape else {
        return cannot(e, "thread drilling makes an inner thread; this is none");
    };
    let Some(pitch) = o.tool.pitch.or(*pitch).filter(|p| *p > 0.0) else {
        let why = "the thread says neither threads per inch nor is the tool's pitch known";
        return e.say(code::PLAN_MISSING_VALUE, feature.origin, &[&feature.keyword, "number_of_threads", why]);
    };
    let r = o.tool.diameter / 2.0;
    let radius = major / 2.0 - r;
    if !suits(e, step, feature) || too_wide(e, step, feature, bore.unwrap_or(major - pitch) + 2.0 * feature.tolerance.unwrap_or(0.0).max(0.05)) {
        return;
    }
    from_the_top(e, step, feature, *start);
    let thread = if *length > 0.0 { start + length } else { feature.depth };
    let long = d.depth.unwrap_or(thread);
    if radius <= 1e-3 {
        return cannot(e, &format!("its tool of {} mm is no smaller than the thread", o.tool.diameter));
    }
    if !(long > 0.0) || long / pitch > MOST_TURNS || o.technology.feed.is_none() {
        return cannot(e, "its length is none, or takes too many turns");
    }
    let tip = o.tool.tip_angle.map(|a| r / libm::tan(a)).filter(|t| t.is_finite() && *t > 0.0).unwrap_or(0.0);
    let all = (long / pitch - 1e-9).ceil();
    let turns = if o.tool.cutting_length.is_some_and(|l| l >= long) && !d.helical { 1.0 } else { all };
    // Upwards counter-clockwise is right-handed.
    let sense = if *right { 1.0 } else { -1.0 };
    let retract = o.retract.filter(|r| *r > 0.0).unwrap_or(RUN_OUT);
    super::retract_is_above(e, o, retract);
    let (bottom, rise) = (-long - tip, pitch / 4.0);
    for frame in &feature.copies {
        let at = |x: f64, z: f64| frame.point([x, 0.0, z]);
        e.travel(at(0.0, retract), frame.z, security);
        e.technology(&o.technology, o.functions);
        let mut z = bottom;
        if d.helical {
            z = bottom + pitch * turns;
            e.line(at(0.0, z));
            e.arc(at(radius / 2.0, z), frame.z, at(radius, z), sense * PI);
            for _ in 0..turns as usize {
                e.arc(at(0.0, z), frame.z, at(radius, z - pitch), -sense * 2.0 * PI);
                z -= pitch;
            }
        } else {
            e.line(at(0.0, bottom));
        }
        if d.dwell > 0.0 {
            e.push(gr_ir::Op::Dwell(d.dwell));
        }
        if !d.helical {
            e.arc(at(radius / 2.0, z), frame.z, at(radius, z + rise), sense * PI);
            z += rise;
        }
        for _ in 0..turns as usize {
            e.arc(at(0.0, z), frame.z, at(radius, z + pitch), sense * 2.0 * PI);
            z += pitch;
        }
        e.arc(at(radius / 2.0, z), frame.z, at(0.0, z + rise), sense * PI);
        e.line(at(0.0, retract.max(z + rise)));
    }
}
