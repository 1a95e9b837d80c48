//! Adept V+.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, between, frame, numbers, without_remark, zyz};
use std::collections::BTreeMap;

/// Reads a program.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let text = &super::main_file(files, ".v2")?.1;
    let mut s = State::new();
    let mut frames = BTreeMap::new();
    let mut skip = false;
    for raw in text.lines() {
        let line = without_remark(raw, ";");
        let fault = || raw.to_string();
        if skip {
            skip = line != "END";
            continue;
        }
        let trans = || frame(&numbers(between(line, "TRANS(", ")")?), zyz);
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        match word {
            "" | ".PROGRAM" | ".END" | "TYPE" | "PAUSE" | "TIMER" => {}
            // The move before ends in a stop.
            "BREAK" => {
                if let Some(Event::Linear(_, _, zone)) = s.events.last_mut() {
                    *zone = None;
                }
            }
            "SPEED" if rest.contains("MMPS") => s.speed = numbers(rest)[0],
            "SPEED" => {}
            "MOVE" => s.joint(numbers(between(rest, "#PPOINT(", ")").ok_or_else(fault)?)),
            "MOVES" => {
                if let Some((name, _)) = rest.split_once(':') {
                    s.frame = Some(*frames.get(name).ok_or_else(fault)?);
                }
                s.zone = Some(0.0);
                let place = s.place(trans().ok_or_else(fault)?, Configuration::Same);
                s.linear(place);
            }
            "TOOL" => s.tool = Some(trans().ok_or_else(fault)?),
            "SET" => {
                frames.insert(rest.split(' ').next().unwrap_or("").to_string(), trans().ok_or_else(fault)?);
            }
            "SIGNAL" => s.set(signal(rest), f64::from(u8::from(!rest.starts_with('-')))),
            "AIO.OUT" => s.set(signal(rest), *numbers(rest).get(1).ok_or_else(fault)?),
            "WAIT" => s.events.push(Event::Wait(signal(rest), !rest.contains("SIG(-"))),
            "IF" => skip = true,
            "DELAY" => s.events.push(Event::Dwell(numbers(rest)[0])),
            "CALL" => s.events.push(Event::Call(rest.split('(').next().unwrap_or("").into(), numbers(rest).first().copied())),
            _ => return Err(fault()),
        }
    }
    Ok(s.events)
}
