//! Universal Robots URScript.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, Place, after, between, numbers, without_remark};
use gr_machine::math::{Frame, about, norm, scale};

/// Reads scripts that are run one after the other.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    super::main_file(files, ".script")?;
    let mut s = State::new();
    // Poses are in the base.
    s.frame = Some(Frame::IDENTITY);
    for (_, text) in files.iter().filter(|f| f.0.ends_with(".script")) {
        script(&mut s, text)?;
    }
    Ok(s.events)
}

fn script(s: &mut State, text: &str) -> Result<(), Fault> {
    let mut depth = 0;
    // Inside of a thread; just behind a probe move.
    let (mut thread, mut probed) = (false, false);
    for raw in text.lines() {
        let line = without_remark(raw, "#");
        let fault = || raw.to_string();
        if thread {
            if line.starts_with("movel(") {
                s.speed = after(line, ",v=").ok_or_else(fault)? * 1000.0;
                let goal = line.split("p[").nth(1).and_then(pose).ok_or_else(fault)?;
                let place = s.place(goal, Configuration::Same);
                s.events.push(Event::Probe(place, s.speed, String::new(), false, false));
            }
            thread = line != "end";
            continue;
        }
        if line.starts_with("thread ") {
            thread = true;
            continue;
        }
        if line.starts_with("global ") || line.contains(" = run ") {
            continue;
        }
        // The thread's move ends where this loop does.
        if let Some(condition) = line.strip_prefix("while probed_") {
            let Some(Event::Probe(_, _, input, on, _)) = s.events.last_mut() else { return Err(fault()) };
            (*input, *on) = (signal(between(condition, "in(", ")").ok_or_else(fault)?), condition.contains("not "));
            (depth, probed) = (depth + 1, true);
            continue;
        }
        if let (true, 0, Some(condition)) = (probed, depth, line.strip_prefix("if ")) {
            let input = between(condition, "in(", ")").map(signal);
            if let (Some(asked), Some(Event::Probe(_, _, input, on, must))) = (input, s.events.last_mut()) {
                *must = asked == *input && condition.contains("not ") == *on;
                probed = false;
            }
        } else if depth == 0 && !line.is_empty() {
            probed &= line == "end";
        }
        if line.starts_with("while ") || line.starts_with("if ") {
            depth += 1;
            if line.starts_with("while ") {
                s.events.push(Event::Wait(signal(between(line, "in(", ")").ok_or_else(fault)?), line.contains("not ")));
            }
            continue;
        }
        if depth > 0 {
            depth -= u32::from(line == "end");
            continue;
        }
        let Some((name, rest)) = line.split_once('(') else { continue };
        step(s, name, rest).ok_or_else(fault)?;
    }
    // The call of the script itself.
    s.events.pop();
    Ok(())
}

/// Meters and rotation vector.
fn pose(text: &str) -> Option<Frame> {
    let v = numbers(text);
    let [x, y, z, a, b, c] = *v.get(..6)? else { return None };
    let angle = norm([a, b, c]);
    let turn = if angle > 0.0 { about(scale([a, b, c], 1.0 / angle), angle) } else { Frame::IDENTITY.turn };
    Some(Frame { turn, position: [x * 1000.0, y * 1000.0, z * 1000.0] })
}

fn step(s: &mut State, name: &str, rest: &str) -> Option<()> {
    let poses: Vec<&str> = rest.split("p[").skip(1).filter_map(|p| p.split(']').next()).collect();
    let speed = || Some(after(rest, ",v=")? * 1000.0);
    match name {
        "movej" => {
            let joints = between(rest, ",[", "]").or_else(|| between(rest, "[", "]"))?;
            let joints: Vec<f64> = numbers(joints).iter().map(|v| v.to_degrees()).collect();
            match poses.first() {
                Some(p) => {
                    let place = s.place(pose(p)?, Configuration::Near(joints));
                    s.events.push(Event::Joint(place));
                }
                None => s.joint(joints),
            }
        }
        "movel" => {
            s.speed = speed()?;
            s.zone = after(rest, ",r=").map(|r| r * 1000.0).filter(|r| *r > 0.0);
            let place = s.place(pose(poses.first()?)?, Configuration::Same);
            s.linear(place);
        }
        "movec" => {
            s.speed = speed()?;
            s.zone = None;
            let place = |p: &str| -> Option<Place> { Some(s.place(pose(p)?, Configuration::Same)) };
            let (via, to) = (place(poses.first()?)?, place(poses.get(1)?)?);
            s.arc(via, to);
        }
        "set_tcp" => s.tool = Some(pose(poses.first()?)?),
        "set_standard_digital_out" => s.set(signal(rest), f64::from(u8::from(rest.contains("True")))),
        "set_standard_analog_out" => s.set(signal(rest), *numbers(rest).get(1)?),
        "sleep" => s.events.push(Event::Dwell(numbers(rest)[0])),
        "textmsg" | "popup" | "set_payload" => {}
        name if name.starts_with("def ") => {}
        name => s.events.push(Event::Call(name.into(), numbers(rest).first().copied())),
    }
    Some(())
}
