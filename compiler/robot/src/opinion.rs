//! What a machine has to say about a program when nothing is made of it: for `check` and for editors, which so say the
//! same. A robot is planned; the planar arm, which has a way of its own, is asked point by point; a machine tool has to have
//! the axes. Limits of a machine tool's axes are the interpreter's matter, as long as its axes are those of the program: where the part
//! is put somewhere, or the tool is turned, the motion is planned.

use gr_backends::from_line::INSERTED;
use gr_backends::joint;
use gr_ir::{Program, Source, Sources};
use gr_machine::math::{Frame, M3};
use gr_machine::{Chain, Kind, Machine};
use gr_text::{Code, Diagnostic, Severity, code};

use crate::words::placed_by;
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
            // The way to a restart begins anywhere: what it brings to 0 may have been there.
            let stays = view.start.axes[i] == view.end.axes[i] || view.source.line == INSERTED && view.end.axes[i] == 0.0;
            if !stays && !std::mem::replace(&mut has[i], true) {
                let (file, span) = texts.place(view.source);
                found.push(Diagnostic::new(code::MACHINE_NO_AXIS, file, span, &[letter.to_string(), machine.id.clone()]));
            }
        }
    }
    found
}

/// Whether a machine has anything to say about a program beside what its limits say.
pub fn has_a_say(machine: &Machine) -> bool {
    machine.kind == Kind::Robot || is_elsewhere(machine) || axes(machine).is_some_and(|has| has.contains(&false))
}

/// Whether a mill's file says where the part is.
fn is_placed(machine: &Machine) -> bool {
    !machine.cell.frames.is_empty() || machine.cell.part_in_base() != Frame::IDENTITY
}

/// Whether a mill stands elsewhere than the coordinates of its program: its part is put somewhere, or the tool is turned.
pub fn is_elsewhere(machine: &Machine) -> bool {
    machine.kind == Kind::Mill && (is_placed(machine) || matches!(machine.chain, Chain::FiveAxis(_)))
}

/// Which axis of a mill goes along X, Y and Z of its programs, whose part may be clamped turned. None where several do.
pub fn axes_along(machine: &Machine) -> Option<[usize; 3]> {
    let places = (1..=9).map(|work| placed_by(machine, work));
    let along = |turn: &M3| {
        let one = |k: usize| (0..3).find(|i| (turn[*i][k].abs() - 1.0).abs() < 1e-9);
        Some([one(0)?, one(1)?, one(2)?])
    };
    let mut all = places.map(|p| along(&p.turn));
    let first = all.next()??;
    all.all(|a| a == Some(first)).then_some(first)
}

/// What any machine has to say about a program.
pub fn opinion(program: &Program, machine: &Machine, texts: &dyn Sources, options: &Options) -> Vec<Diagnostic> {
    if machine.kind != Kind::Robot {
        let missing = missing_axes(program, machine, texts);
        let placed = machine.kind == Kind::Mill && !options.setups.is_empty();
        return if missing.is_empty() && (placed || is_elsewhere(machine)) { of_mill(program, machine, texts, options) } else { missing };
    }
    if matches!(machine.chain, Chain::Planar3r(_)) {
        return by_point(program, machine, texts);
    }
    match plan(program, machine, texts, options) {
        Ok(planned) => planned.warnings,
        Err(found) => found,
    }
}

/// Where a mill can't go. The rest of what a plan says is no matter of its own control, which follows the program itself.
fn of_mill(program: &Program, machine: &Machine, texts: &dyn Sources, options: &Options) -> Vec<Diagnostic> {
    const PLACES: [Code; 5] =
        [code::ROBOT_OUT_OF_REACH, code::ROBOT_JOINT_LIMIT, code::ROBOT_LEAVES_WORKSPACE, code::JOB_BAD_VALUE, code::JOB_BEGINS_IN_WORK];
    let Err(mut found) = plan(program, machine, texts, &Options { own_words: true, ..options.clone() }) else { return Vec::new() };
    found.retain(|d| PLACES.contains(&d.code));
    if !is_placed(machine) && options.setups.is_empty() {
        // Nobody has said where the part is.
        found.iter_mut().filter(|d| d.severity == Severity::Error).for_each(|d| d.severity = Severity::Warning);
    }
    found
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
