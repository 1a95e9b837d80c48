//! Mitsubishi MELFA-BASIC.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, fixed, frame, numbers, without_remark};
use gr_machine::math::Frame;
use std::collections::BTreeMap;

/// Reads a program.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let text = &super::main_file(files, ".prg")?.1;
    let mut s = State::new();
    let (mut poses, mut joints): (BTreeMap<&str, Frame>, BTreeMap<&str, Vec<f64>>) = (BTreeMap::new(), BTreeMap::new());
    for line in text.lines() {
        if let Some((name, values)) = line.split_once("=(") {
            match name.chars().next() {
                Some('P') => poses.extend(frame(&numbers(values), fixed).map(|f| (name, f))),
                _ => drop(joints.insert(name, numbers(values))),
            }
        }
    }
    for raw in text.lines().take_while(|l| *l != "End") {
        let line = without_remark(raw, "'");
        let fault = || raw.to_string();
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        let place = |s: &State, n: &str| poses.get(n).map(|f| s.place(*f, Configuration::Same)).ok_or_else(fault);
        match word {
            "" | "JOvrd" | "Hlt" => {}
            "Mov" => s.joint(joints.get(rest).cloned().ok_or_else(fault)?),
            "Mvs" => {
                let place = place(&s, rest)?;
                s.linear(place);
            }
            "Mvr" => {
                let names: Vec<&str> = rest.split(',').collect();
                let [_, via, to] = names.as_slice() else { return Err(fault()) };
                let (via, to) = (place(&s, via)?, place(&s, to)?);
                s.arc(via, to);
            }
            "Spd" => s.speed = numbers(rest)[0],
            "Cnt" => s.zone = numbers(rest).get(1).copied(),
            "Tool" => s.tool = Some(frame(&numbers(rest), fixed).ok_or_else(fault)?),
            "Base" => s.frame = Some(frame(&numbers(rest), fixed).ok_or_else(fault)?.inverse()),
            "Wait" => s.events.push(Event::Wait(signal(rest), rest.ends_with("=1"))),
            "Dly" => s.events.push(Event::Dwell(numbers(rest)[0])),
            "CallP" => {
                let name = super::between(rest, "\"", "\"").ok_or_else(fault)?;
                s.events.push(Event::Call(name.into(), rest.rsplit_once(',').and_then(|v| v.1.parse().ok())));
            }
            w if w.starts_with("M_Out(") => s.set(signal(w), f64::from(u8::from(w.ends_with("=1")))),
            _ => return Err(fault()),
        }
    }
    Ok(s.events)
}
