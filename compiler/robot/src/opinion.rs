//! What a machine has to say about a program when nothing is made of it: for `check` and for editors, which so say the
//! same. A robot is planned; the planar arm, which has a way of its own, is asked point by point; a machine tool has to have
//! the axes. Limits of a machine tool's axes are the interpreter's matter.

use gr_backends::joint;
use gr_ir::{Program, Source, Sources};
use gr_machine::{Chain, Kind, Machine};
use gr_text::{Diagnostic, Severity, code};

use crate::{Options, plan};

const LETTERS: &str = "XYZABCUVW";

/// Axes that a machine tool has; none for a robot, whose joints are not axes of the program.
fn axes(machine: &Machine) -> Option<[bool; 9]> {
    if machine.kind == Kind::Robot {
        return None;
    }
    let mut has = [false; 9];
    for j in &machine.joints {
        let letter = j.word.or_else(|| j.name.chars().next())?.to_ascii_uppercase();
        has[LETTERS.find(letter)?] = true;
    }
    Some(has)
}

/// The first move of each axis that the machine doesn't have.
pub fn missing_axes(program: &Program, machine: &Machine, texts: &dyn Sources) -> Vec<Diagnostic> {
    let Some(mut has) = axes(machine).filter(|has| has.contains(&false)) else { return Vec::new() };
    let mut found = Vec::new();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if !view.op.moves() {
            continue;
        }
        for (i, letter) in LETTERS.chars().enumerate() {
            if view.start.axes[i] != view.end.axes[i] && !std::mem::replace(&mut has[i], true) {
                let (file, span) = texts.place(view.source);
                found.push(Diagnostic::new(code::MACHINE_NO_AXIS, file, span, &[letter.to_string(), machine.id.clone()]));
            }
        }
    }
    found
}

/// Whether a machine has anything to say about a program beside what its limits say.
pub fn has_a_say(machine: &Machine) -> bool {
    machine.kind == Kind::Robot || axes(machine).is_some_and(|has| has.contains(&false))
}

/// What any machine has to say about a program.
pub fn opinion(program: &Program, machine: &Machine, texts: &dyn Sources, options: &Options) -> Vec<Diagnostic> {
    if machine.kind != Kind::Robot {
        return missing_axes(program, machine, texts);
    }
    if matches!(machine.chain, Chain::Planar3r(_)) {
        return by_point(program, machine, texts);
    }
    match plan(program, machine, texts, options) {
        Ok(planned) => planned.warnings,
        Err(found) => found,
    }
}

fn by_point(program: &Program, machine: &Machine, texts: &dyn Sources) -> Vec<Diagnostic> {
    let found = match planar(program, machine, &joint::Options::default(), texts) {
        Ok((_, warnings)) => warnings,
        Err(found) => found,
    };
    // What joint G-code can't say is no matter of the arm.
    found.into_iter().filter(|d| d.code.def().code.starts_with("E05")).collect()
}

/// The joint positions of a planar arm, and warnings.
pub fn planar(program: &Program, machine: &Machine, options: &joint::Options, texts: &dyn Sources) -> Result<(joint::JointProgram, Vec<Diagnostic>), Vec<Diagnostic>> {
    let place = |s: Source| texts.place(s);
    let mut found = crate::gather::places::unnamed_of_planar(program, machine, texts);
    match joint::compile(program, machine, options, &place) {
        Ok(made) if !found.iter().any(|d| d.severity == Severity::Error) => Ok((made, found)),
        Ok(_) => Err(found),
        Err(more) => {
            found.extend(more);
            Err(found)
        }
    }
}
