//! How the tool is turned by the words of a program: rotary words as the machine file reads them, or the axis that a
//! program made from features states.

use gr_ir::{Pose, State};
use gr_machine::math::{M3, V3, dot, euler, norm, product, rot_x, rot_z, scale, sub};
use gr_machine::{Chain, Control, Kind, Machine, Orientation};
use gr_text::{Code, code};
use std::f64::consts::PI;

/// Why a tool's direction isn't known.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Unread {
    /// The machine file doesn't say what this rotary word means, or says that there is none.
    Word(&'static str),
    /// The machine that the words are meant for, by its id, has no such axis.
    NoAxis(&'static str, String),
    /// The machine turns the tool as its place asks for; that is told elsewhere.
    Nowhere,
}

impl Unread {
    /// What is said about it.
    pub(crate) fn told(self, machine: &Machine) -> Option<(Code, Vec<String>)> {
        match self {
            Unread::Word(word) => Some((code::ROBOT_ROTARY_WORDS, vec![word.into(), machine.no_rotary_words().into()])),
            Unread::NoAxis(word, source) => Some((code::MACHINE_NO_AXIS, vec![word.into(), source])),
            Unread::Nowhere => None,
        }
    }
}

/// What a machine makes of rotary words.
pub struct Turns<'a> {
    machine: &'a Machine,
    /// The machine that the rotary words are meant for, and the places of its rotary joints.
    source: Option<(Machine, [usize; 2])>,
    control: Control,
    planar: bool,
}

impl<'a> Turns<'a> {
    /// Of a machine.
    pub fn new(machine: &'a Machine) -> Turns<'a> {
        let source = match (&machine.orientation, machine.kind) {
            (Some(Orientation::SourceMachine(id)), _) => gr_machine::builtin(id).and_then(rotary_joints),
            (_, Kind::Mill) => rotary_joints(machine.clone()),
            _ => None,
        };
        let planar = matches!(machine.chain, Chain::Planar3r(_));
        Turns { machine, source, control: machine.kinematics().control(), planar }
    }

    /// How the tool is turned without any rotary word: an arm's points straight down.
    pub fn still(&self) -> M3 {
        if self.down() { rot_x(PI) } else { euler([0.0; 3]) }
    }

    /// How the tool is turned in the work frame; else why nobody knows.
    /// G10 R and its like turn the coordinates of X and Y, not the tool.
    pub fn of(&self, pose: &Pose, state: &State) -> Result<M3, Unread> {
        let turn = self.unrotated(pose, state)?;
        let turned = state.rotation != 0.0 && pose.tool_axis.is_none();
        Ok(if turned { product(&rot_z(-state.rotation), &turn) } else { turn })
    }

    /// The direction from the tool point to the spindle in the work frame; none where it isn't known.
    pub fn up(&self, pose: &Pose, state: &State) -> Option<V3> {
        let z = self.of(pose, state).ok()?.map(|row| row[2]);
        Some(if self.down() { scale(z, -1.0) } else { z })
    }

    /// The Z of the tool's frame goes to the work: an arm's, and not a machine tool's.
    fn down(&self) -> bool {
        self.machine.kind == Kind::Robot && !self.planar && self.control != Control::Position
    }

    fn unrotated(&self, pose: &Pose, state: &State) -> Result<M3, Unread> {
        let up = self.machine.kind == Kind::Robot;
        if let Some(axis) = pose.tool_axis {
            return Ok(along(if up { scale(axis, -1.0) } else { axis }, pose.spin.unwrap_or(0.0)));
        }
        let words = rotary(pose, state);
        let some = (0..3).find(|i| words[*i] != 0.0);
        match (&self.machine.orientation, some) {
            (_, Some(_)) if self.control == Control::Position => Err(Unread::Nowhere),
            (Some(Orientation::AbcEulerXyz), _) => Ok(product(&euler(words), &self.still())),
            (_, None) if self.source.is_none() => Ok(self.still()),
            (Some(Orientation::SourceMachine(_)), _) | (None, _) if self.source.is_some() => {
                let (machine, at) = self.source.as_ref().ok_or(Unread::Nowhere)?;
                let letters = rotary_letters(machine, *at);
                // On a mill itself that is told of its axes.
                if let Some(i) = (0..3).find(|i| up && words[*i] != 0.0 && !letters.contains(i)) {
                    return Err(Unread::NoAxis(["A", "B", "C"][i], machine.id.clone()));
                }
                let mut joints = vec![0.0; machine.joints.len()];
                for (slot, word) in at.iter().zip(letters) {
                    joints[*slot] = words[word];
                }
                let turn = machine.kinematics().forward_frame(&joints).map_err(|_| Unread::Nowhere)?.turn;
                Ok(if up { product(&turn, &rot_x(PI)) } else { turn })
            }
            (_, Some(i)) => Err(Unread::Word(["A", "B", "C"][i])),
            _ => Ok(self.still()),
        }
    }
}

/// Rotary words with their offsets.
fn rotary(pose: &Pose, state: &State) -> [f64; 3] {
    [3, 4, 5].map(|i| pose.axes[i] + state.work_offset[i] + state.local_offset[i] + state.tool_offset[i])
}

/// A frame with this Z; X as near to the X of the work frame as can be, then turned about Z.
fn along(z: [f64; 3], spin: f64) -> M3 {
    let l = norm(z).max(f64::MIN_POSITIVE);
    let z = scale(z, 1.0 / l);
    let help = if z[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let x = sub(help, scale(z, dot(help, z)));
    let x = scale(x, 1.0 / norm(x).max(f64::MIN_POSITIVE));
    let y = gr_machine::math::cross(z, x);
    let turn = [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]];
    if spin == 0.0 { turn } else { product(&turn, &rot_z(spin)) }
}

/// A five-axis machine and the places of its rotary joints.
fn rotary_joints(machine: Machine) -> Option<(Machine, [usize; 2])> {
    matches!(machine.chain, Chain::FiveAxis(_)).then_some((machine, [3, 4]))
}

/// Which of the words A B C drives each rotary joint.
fn rotary_letters(machine: &Machine, at: [usize; 2]) -> [usize; 2] {
    at.map(|i| match machine.joints[i].word.or_else(|| machine.joints[i].name.chars().next()) {
        Some('A' | 'a') => 0,
        Some('B' | 'b') => 1,
        _ => 2,
    })
}
