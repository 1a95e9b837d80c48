//! ABB RAPID.

use super::{Configuration, Event, Fault, File, Place, between, numbers, without_remark};
use gr_machine::math::Frame;
use std::collections::BTreeMap;

struct Module {
    frames: BTreeMap<String, Frame>,
    speeds: BTreeMap<String, f64>,
    zones: BTreeMap<String, f64>,
    /// Lines of each routine.
    routines: BTreeMap<String, Vec<String>>,
    /// The routine that searches with what it is given.
    search: Option<String>,
}

/// A search whose data are arguments: to an edge of the input, with a stiff stop; between them the place it finds.
const SEARCH: [&str; 2] = ["SearchL\\Stop,input\\Flanks,", ",goal,speed,tool\\WObj:=frame;"];

/// Reads the modules of a program; it starts in `main`.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let index = super::main_file(files, ".pgf")?;
    let mut all = Module { frames: BTreeMap::new(), speeds: BTreeMap::new(), zones: BTreeMap::new(), routines: BTreeMap::new(), search: None };
    for part in index.1.split("<Module>").skip(1) {
        let name = part.split("</Module>").next().unwrap_or("").trim();
        let file = super::named(files, name).ok_or_else(|| format!("{name} is missing"))?;
        declare(&mut all, &file.1)?;
    }
    let mut events = Vec::new();
    run(&all, "main", &mut events, 0)?;
    Ok(events)
}

fn declare(all: &mut Module, text: &str) -> Result<(), Fault> {
    let mut routine: Option<String> = None;
    for raw in text.lines() {
        let line = without_remark(raw, "!");
        if let Some(rest) = line.strip_prefix("PROC ") {
            let name = rest.split('(').next().unwrap_or("").to_string();
            all.routines.insert(name.clone(), Vec::new());
            routine = Some(name);
        } else if line == "ENDPROC" {
            routine = None;
        } else if line.starts_with(SEARCH[0]) && line.ends_with(SEARCH[1]) {
            all.search.clone_from(&routine);
        } else if let Some(name) = &routine {
            if let Some(lines) = all.routines.get_mut(name).filter(|_| !line.is_empty()) {
                lines.push(line.to_string());
            }
        } else if let Some((left, right)) = line.split_once(":=") {
            let name = left.rsplit(' ').next().unwrap_or("").to_string();
            let v = numbers(right);
            if left.contains("tooldata") || left.contains("wobjdata") {
                all.frames.insert(name, pose(&v).ok_or(raw)?);
            } else if left.contains("speeddata") {
                all.speeds.insert(name, *v.first().ok_or(raw)?);
            } else if left.contains("zonedata") {
                all.zones.insert(name, *v.first().ok_or(raw)?);
            }
        }
    }
    Ok(())
}

/// Position and quaternion.
fn pose(v: &[f64]) -> Option<Frame> {
    let [x, y, z, a, b, c, d] = *v.get(..7)? else { return None };
    let norm = (a * a + b * b + c * c + d * d).sqrt();
    if (norm - 1.0).abs() > 1e-6 {
        return None;
    }
    // Columns are the images of the axes under q·v·q*.
    let turn = [
        [a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
        [2.0 * (b * c + a * d), a * a - b * b + c * c - d * d, 2.0 * (c * d - a * b)],
        [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ];
    Some(Frame { turn, position: [x, y, z] })
}

/// A robtarget at the head of a text, and what follows it.
fn target(text: &str) -> Option<(&str, &str)> {
    let mut depth = 0;
    for (i, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Some((&text[..=i], &text[i + 1..]));
        }
    }
    None
}

fn run(all: &Module, routine: &str, events: &mut Vec<Event>, depth: u32) -> Result<(), Fault> {
    let lines = all.routines.get(routine).ok_or_else(|| format!("no routine {routine}"))?;
    for line in lines {
        let fault = || format!("{routine}: {line}");
        let body = line.strip_suffix(';').ok_or_else(fault)?;
        let (word, rest) = body.split_once(' ').unwrap_or((body, ""));
        match word {
            "MoveAbsJ" => {
                let (t, _) = target(rest).ok_or_else(fault)?;
                events.push(Event::Joint(Place::of_joints(numbers(t).into_iter().take(6).collect())));
            }
            "MoveJ" | "MoveL" | "MoveC" => {
                let (first, rest) = target(rest).ok_or_else(fault)?;
                let rest = rest.strip_prefix(',').ok_or_else(fault)?;
                let (second, rest) = if word == "MoveC" { target(rest).ok_or_else(fault)? } else { ("", rest) };
                let fields: Vec<&str> = rest.trim_start_matches(',').split(',').collect();
                let [speed, zone, ends] = fields.as_slice() else { return Err(fault()) };
                let (tool, frame) = ends.split_once("\\WObj:=").ok_or_else(fault)?;
                let place = |t: &str| place(all, t, tool, frame).ok_or_else(fault);
                let (speed, own) = speed.split_once("\\V:=").map_or((*speed, None), |(s, v)| (s, Some(v)));
                let told = *all.speeds.get(speed).ok_or_else(fault)?;
                let speed = own.map_or(Ok(told), str::parse).map_err(|_| fault())?;
                let zone = if *zone == "fine" { None } else { Some(*all.zones.get(*zone).ok_or_else(fault)?) };
                events.push(match word {
                    "MoveJ" => Event::Joint(place(first)?),
                    "MoveL" => Event::Linear(place(first)?, speed, zone),
                    _ => Event::Arc(place(first)?, place(second)?, speed, zone),
                });
            }
            "SetDO" | "SetAO" | "SetGO" => {
                let (name, value) = rest.split_once(',').ok_or_else(fault)?;
                events.push(Event::Set(name.into(), value.parse().map_err(|_| fault())?));
            }
            "WaitDI" => {
                let (name, value) = rest.split_once(',').ok_or_else(fault)?;
                events.push(Event::Wait(name.into(), value.starts_with('1')));
            }
            "WaitTime\\InPos,0" => events.push(Event::Dwell(0.0)),
            w if w.starts_with("WaitTime\\InPos,") => events.push(Event::Dwell(numbers(between(line, ",", ";").ok_or_else(fault)?)[0])),
            name if all.search.as_deref() == Some(name) => {
                let fields: Vec<&str> = rest.splitn(4, ',').collect();
                let [input, before, must, rest] = fields.as_slice() else { return Err(fault()) };
                let (goal, rest) = target(rest).ok_or_else(fault)?;
                let [speed, tool, frame] = *rest.trim_start_matches(',').split(',').collect::<Vec<_>>() else { return Err(fault()) };
                let place = place(all, goal, tool, frame).ok_or_else(fault)?;
                let speed = *all.speeds.get(speed).ok_or_else(fault)?;
                events.push(Event::Probe(place, speed, input.to_string(), *before == "0", *must == "TRUE"));
            }
            "TPWrite" | "Stop" | "ConfJ\\On" | "ConfL\\Off" | "SingArea\\Wrist" => {}
            name if rest.is_empty() && all.routines.contains_key(name) && depth < 4 => run(all, name, events, depth + 1)?,
            name if name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') => {
                events.push(Event::Call(name.into(), numbers(rest).first().copied()));
            }
            _ => return Err(fault()),
        }
    }
    Ok(())
}

fn place(all: &Module, text: &str, tool: &str, frame: &str) -> Option<Place> {
    let v = numbers(text);
    let pose = pose(&v)?;
    let quadrants = [*v.get(7)? as i32, *v.get(8)? as i32, *v.get(9)? as i32];
    let configuration = Configuration::Quadrants(quadrants, *v.get(10)? as u8);
    Some(Place::of_pose(pose, configuration, Some(*all.frames.get(tool)?), Some(*all.frames.get(frame)?)))
}
