//! Kawasaki AS.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, between, frame, numbers, without_remark, zyz};

/// Reads a program.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let text = &super::main_file(files, ".as")?.1;
    let mut s = State::new();
    for raw in text.lines() {
        let line = without_remark(raw, ";");
        let fault = || raw.to_string();
        let trans = || between(line, "TRANS(", ")").and_then(|t| frame(&numbers(t), zyz)).ok_or_else(fault);
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        match word {
            "" | ".PROGRAM" | ".END" | "PRINT" | "PAUSE" => {}
            "SPEED" if rest.contains("MM/S") => s.speed = numbers(rest)[0],
            "SPEED" => {}
            "ACCURACY" => s.zone = Some(numbers(rest)[0]).filter(|r| *r > 0.001),
            "JMOVE" => s.joint(numbers(between(rest, "#[", "]").ok_or_else(fault)?)),
            "LMOVE" => {
                let place = s.place(trans()?, Configuration::Same);
                s.linear(place);
            }
            "C1MOVE" => s.via = Some(s.place(trans()?, Configuration::Same)),
            "C2MOVE" => {
                let (via, to) = (s.via.take().ok_or_else(fault)?, s.place(trans()?, Configuration::Same));
                s.arc(via, to);
            }
            "TOOL" => s.tool = Some(trans()?),
            "BASE" => s.frame = Some(trans()?),
            "SIGNAL" => s.set(signal(rest), f64::from(u8::from(!rest.starts_with('-')))),
            "SWAIT" => s.events.push(Event::Wait(signal(rest), !rest.starts_with('-'))),
            "TWAIT" => s.events.push(Event::Dwell(numbers(rest)[0])),
            "CALL" => s.events.push(Event::Call(rest.split('(').next().unwrap_or("").into(), numbers(rest).first().copied())),
            _ => return Err(fault()),
        }
    }
    Ok(s.events)
}

