//! Nachi robot language; poses are in the robot's base.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, after, between, fixed, frame, numbers};
use gr_machine::math::Frame;

/// Reads a program.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let text = &super::main_file(files, ".txt")?.1;
    let mut s = State::new();
    s.frame = Some(Frame::IDENTITY);
    for raw in text.lines() {
        let line = raw.trim();
        let fault = || raw.to_string();
        if let Some(rest) = line.strip_prefix("MOVEX A=1P,") {
            let values = numbers(between(rest, "(", ")").ok_or_else(fault)?);
            if rest.starts_with("M1J,") {
                s.joint(values);
                continue;
            }
            s.speed = after(rest, ",S=").ok_or_else(fault)?;
            let pose = frame(&values, |r, p, y| fixed(y, p, r)).ok_or_else(fault)?;
            let place = s.place(pose, Configuration::Same);
            match rest.split(',').nth(1) {
                Some("L") => s.linear(place),
                Some("C1") => s.via = Some(place),
                Some("C2") => {
                    let via = s.via.take().ok_or_else(fault)?;
                    s.arc(via, place);
                }
                _ => return Err(fault()),
            }
        } else if line.starts_with("SET[O") || line.starts_with("RESET[O") {
            s.set(signal(line), f64::from(u8::from(line.starts_with("SET"))));
        } else if line.starts_with("CALLP[") {
            s.events.push(Event::Call(signal(line), None));
        } else if line.starts_with("WAITI[") || line.starts_with("WAITJ[") {
            s.events.push(Event::Wait(signal(line), line.starts_with("WAITI")));
        } else if line.starts_with("DELAY[") {
            s.events.push(Event::Dwell(after(line, "[").ok_or_else(fault)?));
        } else if !(line.starts_with("REM") || line == "END" || line == "STOP" || line.is_empty()) {
            return Err(fault());
        }
    }
    Ok(s.events)
}
