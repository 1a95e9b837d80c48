//! Stäubli VAL3.

use super::simple::State;
use super::xml::{Node, get, nodes, value};
use super::{Configuration, Event, Fault, File, between, named, numbers};
use gr_machine::math::{Frame, product, rot_x, rot_y, rot_z};
use std::collections::BTreeMap;

type Attributes = Vec<(String, String)>;

/// Reads the files of a project; frames are in the controller's world, at the height of the second joint.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let index = super::main_file(files, ".pjx")?;
    let folder = index.0.rsplit_once('/').map_or("", |p| p.0);
    let mut programs = BTreeMap::new();
    let mut data: BTreeMap<(String, usize), Attributes> = BTreeMap::new();
    for node in nodes(&index.1)? {
        let Node::Open(name, attributes, _) = node else { continue };
        let Some(file) = get(&attributes, "file") else { continue };
        let text = &named(files, &format!("{folder}/{file}")).ok_or_else(|| format!("{file} is missing"))?.1;
        match name.as_str() {
            "Program" => programs.extend(code(text)?),
            "Data" => tables(text, &mut data)?,
            _ => {}
        }
    }
    let mut state = State::new();
    run(&programs, &data, "start", &mut state, 0)?;
    Ok(state.events)
}

fn code(text: &str) -> Result<Vec<(String, String)>, Fault> {
    let mut name = String::new();
    let mut out = Vec::new();
    for node in nodes(text)? {
        match node {
            Node::Open(tag, attributes, _) if tag == "Program" => name = get(&attributes, "name").unwrap_or("").to_string(),
            Node::Text(text) => out.push((name.clone(), text)),
            _ => {}
        }
    }
    Ok(out)
}

fn tables(text: &str, data: &mut BTreeMap<(String, usize), Attributes>) -> Result<(), Fault> {
    let (mut name, mut size, mut seen) = (String::new(), 0, 0);
    for node in nodes(text)? {
        match node {
            Node::Open(tag, attributes, _) if tag == "Data" => {
                name = get(&attributes, "name").unwrap_or("").to_string();
                size = value(&attributes, "size").unwrap_or(0.0) as usize;
                seen = 0;
            }
            Node::Open(tag, attributes, _) if tag == "Value" => {
                let key = value(&attributes, "key").ok_or("a value without a key")? as usize;
                seen += 1;
                data.insert((name.clone(), key), attributes);
            }
            Node::Close(tag) if tag == "Data" && seen != size => return Err(format!("{name} has {seen} values, not {size}")),
            _ => {}
        }
    }
    Ok(())
}

/// R = Rx·Ry·Rz.
fn pose(a: &Attributes) -> Option<Frame> {
    let v = |n| value(a, n);
    let r = |n| Some(v(n)?.to_radians());
    let turn = product(&rot_x(r("rx")?), &product(&rot_y(r("ry")?), &rot_z(r("rz")?)));
    Some(Frame { turn, position: [v("x")?, v("y")?, v("z")?] })
}

fn run(
    programs: &BTreeMap<String, String>,
    data: &BTreeMap<(String, usize), Attributes>,
    name: &str,
    s: &mut State,
    depth: u32,
) -> Result<(), Fault> {
    let text = programs.get(name).ok_or_else(|| format!("no program {name}"))?;
    let mut skip = false;
    for raw in text.lines() {
        let line = raw.split("//").next().unwrap_or("").trim();
        let fault = || raw.to_string();
        if skip {
            skip = line != "endIf";
            continue;
        }
        let link = |array: &str| -> Option<String> {
            let i = numbers(between(line, &format!("{array}["), "]")?)[0] as usize;
            Some(get(data.get(&(array.to_string(), i))?, "link")?.to_string())
        };
        match line.split(['(', '[', ' ']).next().unwrap_or("") {
            "begin" | "end" | "" | "resetMotion" | "waitEndMove" | "popUpMsg" => {}
            "movej" | "movel" | "movec" => motion(data, line, s).ok_or_else(fault)?,
            "delay" => s.events.push(Event::Dwell(numbers(line)[0])),
            "dOut" => s.set(link("dOut").ok_or_else(fault)?, f64::from(u8::from(line.ends_with("true")))),
            "aioSet" => s.set(link("aOut").ok_or_else(fault)?, *numbers(line).get(1).ok_or_else(fault)?),
            "wait" => s.events.push(Event::Wait(link("dIn").ok_or_else(fault)?, line.contains("true"))),
            "if" => {
                s.events.push(Event::Wait(link("dIn").ok_or_else(fault)?, line.contains("==true")));
                skip = true;
            }
            "call" => {
                let name = between(line, "call ", "(").ok_or_else(fault)?;
                if programs.contains_key(name) && depth < 3 {
                    run(programs, data, name, s, depth + 1)?;
                } else {
                    s.events.push(Event::Call(name.into(), numbers(line).first().copied()));
                }
            }
            _ => return Err(fault()),
        }
    }
    Ok(())
}

fn motion(data: &BTreeMap<(String, usize), Attributes>, line: &str, s: &mut State) -> Option<()> {
    let inside = between(line, "(", ")")?;
    let arguments: Vec<&str> = inside.split(',').collect();
    let row = |i: usize| {
        let (name, key) = arguments.get(i)?.split_once('[')?;
        data.get(&(name.to_string(), key.trim_end_matches(']').parse().ok()?))
    };
    let last = arguments.len() - 1;
    let speed = row(last)?;
    s.speed = value(speed, "tmax")?;
    s.zone = if get(speed, "blend")? == "off" { None } else { Some(value(speed, "leave")?) };
    s.tool = data.get(&(arguments.get(last - 1)?.to_string(), 0)).and_then(pose);
    if line.starts_with("movej") {
        s.joint((1..=6).map(|i| value(row(0)?, &format!("j{i}"))).collect::<Option<_>>()?);
        return Some(());
    }
    let mut places = Vec::new();
    for i in 0..last - 1 {
        let a = row(i)?;
        let father = get(a, "fatherId")?.split('[').next()?;
        s.frame = data.get(&(father.to_string(), 0)).and_then(pose);
        places.push(s.place(pose(a)?, Configuration::Same));
    }
    let to = places.pop()?;
    match places.pop() {
        Some(via) => s.arc(via, to),
        None => s.linear(to),
    }
    Some(())
}
