//! Comau PDL2.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, between, frame, numbers, without_remark, zyz};

/// Reads a program.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let text = &super::main_file(files, ".pdl")?.1;
    let mut s = State::new();
    let mut distance = 0.0;
    for raw in text.lines() {
        let line = without_remark(raw, "--");
        let fault = || raw.to_string();
        let poses: Vec<_> = line.split("POS(").skip(1).filter_map(|p| frame(&numbers(p.split('\'').next()?), zyz)).collect();
        let pose = |i: usize| poses.get(i).copied().ok_or_else(fault);
        s.zone = line.starts_with("MOVEFLY").then_some(distance);
        if line.is_empty() || ["PROGRAM", "BEGIN", "END", "WRITE", "PAUSE", "$ARM_OVR"].iter().any(|w| line.starts_with(w)) {
        } else if line.starts_with("MOVE TO {") {
            s.joint(numbers(between(line, "{", "}").ok_or_else(fault)?));
        } else if line.contains(" LINEAR TO ") {
            let place = s.place(pose(0)?, Configuration::Same);
            s.linear(place);
        } else if line.contains(" CIRCULAR TO ") {
            let (to, via) = (s.place(pose(0)?, Configuration::Same), s.place(pose(1)?, Configuration::Same));
            s.arc(via, to);
        } else if let Some((left, right)) = line.split_once(" := ") {
            match left {
                "$TOOL" => s.tool = Some(pose(0)?),
                "$UFRAME" => s.frame = Some(pose(0)?),
                "$LIN_SPD" => s.speed = numbers(right)[0] * 1000.0,
                "$FLY_DIST" => distance = numbers(right)[0],
                l if l.starts_with("$DOUT[") => s.set(signal(l), f64::from(u8::from(right == "ON"))),
                l if l.starts_with("$AOUT[") => s.set(signal(l), numbers(right)[0]),
                _ => return Err(fault()),
            }
        } else if let Some(rest) = line.strip_prefix("WAIT FOR ") {
            s.events.push(Event::Wait(signal(rest), rest.ends_with("ON")));
        } else if let Some(rest) = line.strip_prefix("DELAY ") {
            s.events.push(Event::Dwell(numbers(rest)[0] / 1000.0));
        } else {
            let (name, value) = line.split_once('(').unwrap_or((line, ""));
            s.events.push(Event::Call(name.into(), numbers(value).first().copied()));
        }
    }
    Ok(s.events)
}
