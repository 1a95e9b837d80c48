//! Epson SPEL+.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, between, fixed, frame, numbers, without_remark};
use gr_machine::math::Frame;
use std::collections::BTreeMap;

/// Reads a program.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let text = &super::main_file(files, ".prg")?.1;
    let mut s = State::new();
    let mut locals: BTreeMap<u32, Frame> = BTreeMap::new();
    let mut tools: BTreeMap<u32, Frame> = BTreeMap::new();
    for raw in text.lines() {
        let line = without_remark(raw, "'");
        let fault = || raw.to_string();
        // X Y Z U V W: turns about Z, Y, X; a local frame behind a stroke.
        let points: Vec<(Frame, u32)> = line
            .split("XY(")
            .skip(1)
            .filter_map(|p| {
                let (inside, rest) = p.split_once(')')?;
                let local = rest.strip_prefix('/').map_or(0.0, |r| numbers(r)[0]);
                Some((frame(&numbers(inside), |u, v, w| fixed(w, v, u))?, local as u32))
            })
            .collect();
        let pose = |i: usize| points.get(i).copied().ok_or_else(fault);
        s.zone = line.ends_with(" CP").then_some(0.0);
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        match word {
            "" | "Function" | "Fend" | "Motor" | "Speed" | "Print" | "Pause" | "If" => {}
            "Go" => s.joint(numbers(between(rest, "AglToPls(", ")").ok_or_else(fault)?)),
            "SpeedS" => s.speed = numbers(rest)[0],
            "Move" => {
                let (pose, local) = pose(0)?;
                s.frame = locals.get(&local).copied();
                let place = s.place(pose, Configuration::Same);
                s.linear(place);
            }
            "Arc3" => {
                let ((via, local), (to, _)) = (pose(0)?, pose(1)?);
                s.frame = locals.get(&local).copied();
                let (via, to) = (s.place(via, Configuration::Same), s.place(to, Configuration::Same));
                s.arc(via, to);
            }
            "TLSet" => drop(tools.insert(numbers(rest)[0] as u32, pose(0)?.0)),
            "Tool" => s.tool = tools.get(&(numbers(rest)[0] as u32)).copied(),
            "Local" => drop(locals.insert(numbers(rest)[0] as u32, pose(0)?.0)),
            "On" | "Off" => s.set(signal(rest), f64::from(u8::from(word == "On"))),
            "Wait" if rest.starts_with("Sw(") => s.events.push(Event::Wait(signal(rest), rest.contains("= On"))),
            "Wait" => s.events.push(Event::Dwell(numbers(rest)[0])),
            "Call" => s.events.push(Event::Call(rest.split('(').next().unwrap_or("").into(), numbers(rest).first().copied())),
            _ => return Err(fault()),
        }
    }
    Ok(s.events)
}
