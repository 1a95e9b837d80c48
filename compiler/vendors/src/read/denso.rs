//! DENSO PAC, points as joint values.

use super::simple::{State, signal};
use super::{Event, Fault, File, Place, after, numbers, without_remark};

/// Reads a program.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let text = &super::main_file(files, ".pac")?.1;
    let mut s = State::new();
    for raw in text.lines() {
        let line = without_remark(raw, "'");
        let fault = || raw.to_string();
        let points: Vec<Place> = line.split("J(").skip(1).map(|p| Place::of_joints(numbers(p.split(')').next().unwrap_or("")))).collect();
        let point = |i: usize| points.get(i).cloned().ok_or_else(fault);
        s.zone = after(line, "@").filter(|r| *r > 0.0);
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        match word {
            "" | "PROGRAM" | "END" | "TAKEARM" | "GIVEARM" | "STOP" | "PRINTMSG" | "CHANGETOOL" => {}
            "SPEED" => s.speed = after(rest, "MPS(").ok_or_else(fault)?,
            "MOVE" if rest.starts_with("P,") => s.events.push(Event::Joint(point(0)?)),
            "MOVE" if rest.starts_with("L,") => s.linear(point(0)?),
            "MOVE" if rest.starts_with("C,") => s.arc(point(0)?, point(1)?),
            "SET" | "RESET" => s.set(signal(rest), f64::from(u8::from(word == "SET"))),
            "WAIT" => s.events.push(Event::Wait(signal(rest), rest.ends_with("ON"))),
            "DELAY" => s.events.push(Event::Dwell(numbers(rest)[0] / 1000.0)),
            "CALL" => s.events.push(Event::Call(rest.split('(').next().unwrap_or("").into(), numbers(rest).first().copied())),
            _ => return Err(fault()),
        }
    }
    Ok(s.events)
}
