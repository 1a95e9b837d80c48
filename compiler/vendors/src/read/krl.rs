//! KUKA KRL.

use super::simple::{State, signal};
use super::{Configuration, Event, Fault, File, after, between, fixed, numbers};
use gr_machine::math::Frame;

/// Reads a `.src` with its `.dat`, and the files it calls.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let main = super::main_file(files, ".src")?;
    let data = super::named(files, &main.0.replace(".src", ".dat")).ok_or("no .dat")?;
    let home = between(&data.1, "XHOME={", "}").ok_or("no XHOME")?;
    let mut state = State::new();
    run(files, &main.1, home, &mut state, 0)?;
    Ok(state.events)
}

fn field(text: &str, name: &str) -> Option<f64> {
    text.split([',', ':', '{', '}']).map(str::trim).find_map(|f| f.strip_prefix(name)?.strip_prefix(' ')?.trim().parse().ok())
}

fn pose(text: &str) -> Option<Frame> {
    let f = |n| field(text, n);
    Some(Frame { turn: fixed(f("C")?, f("B")?, f("A")?), position: [f("X")?, f("Y")?, f("Z")?] })
}

fn axes(text: &str) -> Option<Vec<f64>> {
    (1..=6).map(|i| field(text, &format!("A{i}"))).collect()
}

/// Input and state of an interrupt, and where a probe is sent.
#[derive(Default)]
struct Search {
    input: String,
    on: bool,
    goal: Option<Frame>,
    /// The statement before was the probe's move.
    made: bool,
}

/// Whether a program moves to its argument while an interrupt looks at an input.
fn searches(text: &str) -> bool {
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let at = |line: &str| lines.iter().position(|l| *l == line);
    let wanted = ["INTERRUPT ON 20", "LIN GOAL", "WAIT SEC 0", "INTERRUPT OFF 20"].map(at);
    text.contains("(GOAL:IN)") && wanted[0].is_some() && wanted.is_sorted() && !wanted.contains(&None)
}

/// Whether a program stops the arm and leaves what it was called from.
fn hits(text: &str) -> bool {
    text.contains("BRAKE") && text.contains("RESUME")
}

fn run(files: &[File], text: &str, home: &str, s: &mut State, depth: u32) -> Result<(), Fault> {
    let mut search = Search::default();
    let mut skip = false;
    for raw in text.lines() {
        let line = raw.split(';').next().unwrap_or("").trim();
        let fault = || raw.to_string();
        if skip {
            skip = line != "ENDIF";
            continue;
        }
        let zone = line.ends_with("C_DIS").then_some(s.distance);
        if line.is_empty() || line.starts_with('&') || line.starts_with("DEF ") || line.starts_with("DECL ") || line == "END" || line == "HALT" {
        } else if line == "PTP XHOME" {
            s.joint(axes(home).ok_or_else(fault)?);
        } else if let Some(t) = line.strip_prefix("PTP ") {
            match axes(t) {
                Some(joints) => s.joint(joints),
                None => {
                    let bits = |n| field(t, n).map(|v| v as u8).ok_or_else(fault);
                    let place = s.place(pose(t).ok_or_else(fault)?, Configuration::StatusTurn(bits("S")?, bits("T")?));
                    s.events.push(Event::Joint(place));
                }
            }
        } else if let Some(t) = line.strip_prefix("LIN ") {
            s.zone = zone;
            let place = s.place(pose(t).ok_or_else(fault)?, Configuration::Same);
            s.linear(place);
        } else if let Some(t) = line.strip_prefix("CIRC ") {
            s.zone = zone;
            let (via, to) = t.split_once("},{").ok_or_else(fault)?;
            let via = s.place(pose(via).ok_or_else(fault)?, Configuration::Same);
            let to = s.place(pose(to).ok_or_else(fault)?, Configuration::Same);
            s.arc(via, to);
        } else if line.starts_with("$TOOL=") {
            s.tool = Some(pose(line).ok_or_else(fault)?);
        } else if line.starts_with("$BASE=") {
            s.frame = Some(pose(line).ok_or_else(fault)?);
        } else if line.starts_with("$VEL.CP=") {
            s.speed = after(line, "$VEL.CP=").ok_or_else(fault)? * 1000.0;
        } else if line.starts_with("$APO.CDIS=") {
            s.distance = after(line, "$APO.CDIS=").ok_or_else(fault)?;
        } else if line.starts_with("$OUT[") {
            s.set(signal(line), f64::from(u8::from(line.ends_with("TRUE"))));
        } else if line.starts_with("$ANOUT[") {
            s.set(signal(line), after(line, "]=").ok_or_else(fault)?);
        } else if line.starts_with("WAIT FOR") {
            s.events.push(Event::Wait(signal(line), line.contains("TRUE")));
        } else if let Some(t) = line.strip_prefix("WAIT SEC ") {
            s.events.push(Event::Dwell(t.parse().map_err(|_| fault())?));
        } else if let Some(t) = line.strip_prefix("INTERRUPT DECL 20 WHEN ") {
            let (condition, call) = t.split_once(" DO ").ok_or_else(fault)?;
            let file = super::named(files, &format!("{}.src", call.trim_end_matches("()"))).ok_or_else(fault)?;
            if !hits(&file.1) {
                return Err(fault());
            }
            (search.input, search.on) = (signal(condition), condition.contains("TRUE"));
        } else if line.starts_with("GOAL={") {
            search.goal = Some(pose(line).ok_or_else(fault)?);
        } else if let Some(name) = line.strip_suffix("(GOAL)") {
            let file = super::named(files, &format!("{name}.src")).ok_or_else(fault)?;
            if !searches(&file.1) {
                return Err(fault());
            }
            let place = s.place(search.goal.take().ok_or_else(fault)?, Configuration::Same);
            s.events.push(Event::Probe(place, s.speed, search.input.clone(), search.on, false));
            search.made = true;
            continue;
        } else if line.starts_with("IF ") {
            if let (true, Some(Event::Probe(.., must))) = (search.made && signal(line) == search.input, s.events.last_mut()) {
                *must = line.contains("TRUE") != search.on;
            }
            skip = true;
        } else if line.starts_with("BAS(") || line.starts_with('$') {
        } else if let Some((name, rest)) = line.split_once('(') {
            match super::named(files, &format!("{name}.src")) {
                Some(file) if depth < 3 => run(files, &file.1, home, s, depth + 1)?,
                _ => s.events.push(Event::Call(name.into(), numbers(rest).first().copied())),
            }
        } else {
            return Err(fault());
        }
        search.made = false;
    }
    Ok(())
}
