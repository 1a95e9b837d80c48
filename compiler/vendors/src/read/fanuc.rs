//! FANUC TP as ASCII.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, Place, after, between, fixed, numbers};
use gr_machine::math::Frame;
use std::collections::BTreeMap;

#[derive(Default)]
struct Controller {
    registers: BTreeMap<u32, [f64; 6]>,
    frames: BTreeMap<u32, Frame>,
    tools: BTreeMap<u32, Frame>,
    used: (u32, u32),
    /// Input and state of the skip condition.
    skip: Option<(String, bool)>,
    /// The last skipping move's input, and the label behind it.
    probed: Option<(String, String)>,
}

/// Reads `.LS` files; the last one is the main program.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let main = super::main_file(files, ".LS")?;
    let (mut state, mut controller) = (State::new(), Controller::default());
    run(files, &main.1, &mut state, &mut controller, 0)?;
    Ok(state.events)
}

fn run(files: &[File], text: &str, s: &mut State, c: &mut Controller, depth: u32) -> Result<(), Fault> {
    let (head, rest) = text.split_once("/MN").ok_or("no /MN")?;
    let (code, positions) = rest.split_once("/POS").ok_or("no /POS")?;
    let points: BTreeMap<u32, &str> =
        positions.split("P[").skip(1).filter_map(|p| Some((p.split(']').next()?.parse().ok()?, p.split("};").next()?))).collect();
    // A continued line has no number.
    let joined = code.replace("\r\n    :", " ").replace("\n    :", " ");
    let lines: Vec<&str> = joined.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
    if after(head, "LINE_COUNT") != Some(lines.len() as f64) {
        return Err(format!("LINE_COUNT is not {}", lines.len()));
    }
    let mut skip_to: Option<String> = None;
    for (i, raw) in lines.iter().enumerate() {
        let fault = || raw.to_string();
        let (number, line) = raw.split_once(':').ok_or_else(fault)?;
        if number.trim().parse() != Ok(i + 1) {
            return Err(fault());
        }
        let line = line.trim().strip_suffix(';').ok_or_else(fault)?.trim();
        if let Some(label) = &skip_to {
            if line == label.as_str() {
                skip_to = None;
            }
            continue;
        }
        step(files, line, s, c, &points, &mut skip_to, depth).ok_or_else(fault)?;
    }
    Ok(())
}

fn speed(term: &str) -> Option<f64> {
    let value = numbers(term).first().copied()?;
    let unit = term.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    match unit {
        "mm/sec" => Some(value),
        "cm/min" => Some(value * 10.0 / 60.0),
        "inch/min" => Some(value * 25.4 / 60.0),
        "%" => Some(value),
        _ => None,
    }
}

fn step(
    files: &[File],
    line: &str,
    s: &mut State,
    c: &mut Controller,
    points: &BTreeMap<u32, &str>,
    skip_to: &mut Option<String>,
    depth: u32,
) -> Option<()> {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    let fields: Vec<&str> = line.split_whitespace().collect();
    let point = |n: usize, c: &Controller| place(points.get(&(numbers(fields.get(n)?)[0] as u32))?, c);
    match word {
        _ if line.starts_with('!') || line.starts_with("MESSAGE[") || line == "PAUSE" => {}
        "SKIP" => c.skip = Some((signal(rest), rest.ends_with("=ON"))),
        "ABORT" => {}
        "IF" => {
            let (condition, label) = rest.split_once(",JMP ")?;
            // Asked behind a probe move it is whether the program may go on.
            if let Some((input, _)) = c.probed.take().filter(|(i, _)| *i == signal(condition))
                && let Some(Event::Probe(_, _, name, on, must)) = s.events.last_mut()
                && *name == input
                && *on == condition.ends_with("=ON")
            {
                *must = true;
            }
            *skip_to = Some(label.trim().to_string());
        }
        "L" if fields.last()?.starts_with("Skip,") => {
            s.speed = speed(fields.get(2)?)?;
            let (input, on) = c.skip.clone()?;
            let label = fields.last()?.strip_prefix("Skip,")?.to_string();
            c.probed = Some((input.clone(), label));
            s.events.push(Event::Probe(point(1, c)?, s.speed, input, on, false));
        }
        "J" => s.events.push(Event::Joint(point(1, c)?)),
        "L" | "C" => {
            let n = if word == "C" { 3 } else { 2 };
            s.speed = speed(fields.get(n)?)?;
            s.zone = match *fields.get(n + 1)? {
                "FINE" => None,
                "CNT0" => Some(0.0),
                _ => return None,
            };
            let to = point(n - 1, c)?;
            if word == "C" { s.arc(point(1, c)?, to) } else { s.linear(to) }
        }
        "WAIT" if rest.ends_with("(sec)") => s.events.push(Event::Dwell(numbers(rest)[0])),
        "WAIT" => s.events.push(Event::Wait(signal(rest), rest.contains("=ON"))),
        "JMP" => *skip_to = Some(rest.trim().to_string()),
        "CALL" => {
            let name = rest.split('(').next()?.trim();
            match super::named(files, &format!("{name}.LS")) {
                Some(file) if depth < 3 => run(files, &file.1, s, c, depth + 1).ok()?,
                _ => s.events.push(Event::Call(name.into(), between(rest, "(", ")").and_then(|v| v.parse().ok()))),
            }
        }
        _ => assign(line, s, c)?,
    }
    Some(())
}

fn assign(line: &str, s: &mut State, c: &mut Controller) -> Option<()> {
    if line.starts_with("LBL[") {
        // The skip leads to the very next line.
        return c.probed.as_ref().is_none_or(|p| p.1 == line).then_some(());
    }
    let (left, right) = line.split_once('=')?;
    let index = || numbers(left);
    if left.starts_with("PR[") && right.contains("LPOS") {
        c.registers.insert(index()[0] as u32, [0.0; 6]);
    } else if left.starts_with("PR[") {
        let i = index();
        *c.registers.get_mut(&(i[0] as u32))?.get_mut(*i.get(1)? as usize - 1)? = numbers(right)[0];
    } else if left.starts_with("UFRAME[") || left.starts_with("UTOOL[") {
        let r = c.registers.get(&(numbers(right)[0] as u32))?;
        let frame = super::frame(r, fixed)?;
        if left.starts_with("UF") { c.frames.insert(index()[0] as u32, frame) } else { c.tools.insert(index()[0] as u32, frame) };
    } else if left == "UFRAME_NUM" {
        c.used.0 = right.parse().ok()?;
    } else if left == "UTOOL_NUM" {
        c.used.1 = right.parse().ok()?;
    } else if left.starts_with("DO[") {
        s.set(signal(left), f64::from(u8::from(right == "ON")));
    } else if left.starts_with("AO[") || left.starts_with("GO[") {
        s.set(signal(left), right.parse().ok()?);
    } else if left != "$WAITTMOUT" {
        return None;
    }
    Some(())
}

fn place(text: &str, c: &Controller) -> Option<Place> {
    if text.contains("J1=") {
        return Some(Place::of_joints((1..=6).map(|i| after(text, &format!("J{i}="))).collect::<Option<_>>()?));
    }
    let v = |n: &str| after(text, n);
    let used = (v("UF :")? as u32, v("UT :")? as u32);
    if used != c.used {
        return None;
    }
    let configuration = between(text, "CONFIG : '", "'")?;
    let fields: Vec<&str> = configuration.split(',').map(str::trim).collect();
    let turns = [fields.get(1)?.parse().ok()?, fields.get(2)?.parse().ok()?, fields.get(3)?.parse().ok()?];
    let letters: Vec<&str> = fields.first()?.split(' ').collect();
    let [wrist, elbow, arm] = letters.as_slice() else { return None };
    let pose = Frame { turn: fixed(v("W =")?, v("P =")?, v("R =")?), position: [v("X =")?, v("Y =")?, v("Z =")?] };
    let configuration = Configuration::Letters([*wrist == "F", *elbow == "U", *arm == "T"], turns);
    Some(Place::of_pose(pose, configuration, Some(*c.tools.get(&used.1)?), Some(*c.frames.get(&used.0)?)))
}
