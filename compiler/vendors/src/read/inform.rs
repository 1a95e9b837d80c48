//! Yaskawa INFORM.

use super::simple::signal;
use super::{Configuration, Event, Fault, File, Place, after, fixed, numbers};
use std::collections::BTreeMap;

/// Reads jobs; the last one is the main job.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let main = super::main_file(files, ".JBI")?;
    let mut events = Vec::new();
    run(files, &main.1, &mut events, 0)?;
    Ok(events)
}

fn run(files: &[File], text: &str, events: &mut Vec<Event>, depth: u32) -> Result<(), Fault> {
    let (head, code) = text.split_once("//INST").ok_or("no //INST")?;
    let points = points(head)?;
    if after(head, "NPOS") != Some(points.len() as f64) {
        return Err(format!("NPOS is not {}", points.len()));
    }
    // The points of an arc in work, and the last point of a straight or joint step.
    let mut arc: Vec<Place> = Vec::new();
    let mut straight: Option<Place> = None;
    for raw in code.lines() {
        let line = raw.trim();
        let fault = || raw.to_string();
        let fields: Vec<&str> = line.split_whitespace().collect();
        let place = || fields.get(1).and_then(|n| points.get(*n)).cloned().ok_or_else(fault);
        let speed = || after(line, " V=").ok_or_else(fault);
        match *fields.first().unwrap_or(&"") {
            "MOVJ" => {
                events.push(Event::Joint(place()?));
                (straight, arc) = (Some(place()?), Vec::new());
            }
            "MOVL" => {
                let place = place()?;
                // A step to the end of an arc only parts two arcs.
                if arc.last().map(|a| &a.pose) != Some(&place.pose) {
                    events.push(Event::Linear(place.clone(), speed()?, None));
                }
                (straight, arc) = (Some(place), Vec::new());
            }
            "MOVC" => {
                arc.push(place()?);
                if let [from, via, to] = arc.as_slice() {
                    if straight.as_ref().is_some_and(|s| s.pose != from.pose) {
                        events.push(Event::Linear(from.clone(), speed()?, None));
                    }
                    events.push(Event::Arc(via.clone(), to.clone(), speed()?, None));
                    straight = None;
                }
                if arc.len() > 3 {
                    return Err(fault());
                }
            }
            "DOUT" if line.contains("OG#") => events.push(Event::Set(signal(line), numbers(fields.get(2).ok_or_else(fault)?)[0])),
            "DOUT" => events.push(Event::Set(signal(line), f64::from(u8::from(line.ends_with("ON"))))),
            "AOUT" => events.push(Event::Set(signal(line), numbers(fields.get(2).ok_or_else(fault)?)[0])),
            "WAIT" => events.push(Event::Wait(signal(line), line.contains("=ON"))),
            "TIMER" => events.push(Event::Dwell(after(line, "T=").ok_or_else(fault)?)),
            "CALL" => {
                let name = fields.get(1).and_then(|n| n.strip_prefix("JOB:")).ok_or_else(fault)?;
                match super::named(files, &format!("{name}.JBI")) {
                    Some(file) if depth < 3 => run(files, &file.1, events, depth + 1)?,
                    _ => events.push(Event::Call(name.into(), fields.get(2).and_then(|v| v.strip_prefix("ARGF")).and_then(|v| v.parse().ok()))),
                }
            }
            "" | "NOP" | "END" | "PAUSE" | "MSG" => {}
            w if w.starts_with('\'') || w.starts_with('/') => {}
            _ => return Err(fault()),
        }
    }
    Ok(())
}

fn points(head: &str) -> Result<BTreeMap<String, Place>, Fault> {
    let mut out = BTreeMap::new();
    let mut configuration = Configuration::Same;
    for line in head.lines() {
        if let Some(r) = line.strip_prefix("///RCONF ") {
            let bits: Vec<u8> = r.split(',').filter_map(|b| b.trim().parse().ok()).collect();
            let bits: [u8; 6] = bits.get(..6).and_then(|b| b.try_into().ok()).ok_or(line)?;
            configuration = Configuration::Rconf(bits);
        } else if let Some((name, values)) = line.split_once('=').filter(|_| line.starts_with('C')) {
            let pose = super::frame(&numbers(values), fixed).ok_or(line)?;
            if name != format!("C{:05}", out.len()) {
                return Err(line.to_string());
            }
            out.insert(name.to_string(), Place::of_pose(pose, configuration.clone(), None, None));
        }
    }
    Ok(out)
}
