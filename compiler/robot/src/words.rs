//! How the words of a program put the tool of a machine tool where it is: joints from X Y Z and rotary words, frames and
//! tools as the program's state has them. Arms are no matter of this: their configuration is chosen by `choose`.

use gr_ir::{Axes, State};
use gr_machine::math::{Frame, V3, norm, rot_z, solve, sub};
use gr_machine::{Chain, Control, JointKind, Kinematics, KinematicsError, Machine};

/// How the words of a program put the tool where it is.
pub enum Words {
    /// Rotary words are rotary joints.
    Joints(Slides),
    /// X Y Z alone.
    Point,
}

/// Joints that slide, and joint and word of each that turns.
#[derive(Clone, PartialEq, Debug)]
pub struct Slides {
    /// Those of X, Y and Z.
    pub sliding: [usize; 3],
    /// Joint and word of each that turns.
    pub turning: Vec<(usize, usize)>,
}

/// How a machine tool stands.
pub struct Stand {
    /// Values of all joints, mm and rad.
    pub joints: Vec<f64>,
    /// From the flange to the tool point, base directions, mm.
    pub lever: V3,
    /// Direction of the spindle in the base.
    pub axis: V3,
}

impl Slides {
    /// How the machine stands for the words of a program.
    pub fn stand(&self, machine: &Machine, kinematics: &dyn Kinematics, asked: &Asked) -> Option<Stand> {
        let begun = started(machine, asked, &self.sliding, &self.turning);
        let mut joints = slid(kinematics, &as_far_as_known(machine, &begun, &self.turning), &self.sliding, asked).ok()?;
        let real = kinematics.forward_frame(&joints).ok()?;
        let lever = sub(real.then(&Frame::shift(asked.tool.position)).position, real.position);
        self.turning.iter().for_each(|(joint, _)| joints[*joint] = begun[*joint]);
        Some(Stand { joints, lever, axis: real.axis(2) })
    }
}

impl Words {
    /// Of a machine; why not where its joints are no words.
    pub fn of(machine: &Machine) -> Result<Words, String> {
        if matches!(machine.chain, Chain::Cartesian | Chain::FiveAxis(_)) {
            let word = |i: usize| {
                let letter = machine.joints[i].word.map_or("XYZABCUVW".as_bytes().get(i).copied(), |c| u8::try_from(c).ok());
                letter.and_then(|l| b"XYZABCUVW".iter().position(|w| *w == l.to_ascii_uppercase()))
            };
            let of_kind = |kind| (0..machine.joints.len()).filter(move |i| machine.joints[*i].kind == kind);
            let mut sliding: Vec<usize> = of_kind(JointKind::Prismatic).filter(|i| word(*i).is_some_and(|w| w < 3)).collect();
            sliding.sort_by_key(|i| word(*i));
            let turning = of_kind(JointKind::Revolute).filter_map(|i| Some((i, word(i)?))).collect();
            let sliding = sliding.try_into().map_err(|_| "its machine has no X, Y and Z that slide".to_string())?;
            return Ok(Words::Joints(Slides { sliding, turning }));
        }
        if machine.kinematics().control() == Control::Position {
            return Ok(Words::Point);
        }
        Err("which configuration the joints take is not in this target; a robot's own language or joint-gcode has it".into())
    }
}

/// A point as the program has it.
pub struct Asked {
    /// The tool point in the base, mm.
    pub tip: V3,
    /// The tool point on the spindle's nose.
    pub tool: Frame,
    /// Rotary words with their offsets, rad.
    pub rotary: [f64; 3],
}

impl Asked {
    /// By the words of a program in a state.
    pub fn new(machine: &Machine, axes: &Axes, state: &State) -> Asked {
        Asked::with(machine, axes, state, tool(machine, state))
    }

    /// The same with another tool.
    pub fn with(machine: &Machine, axes: &Axes, state: &State, tool: Frame) -> Asked {
        let tip = frame(machine, state).apply([axes[0], axes[1], axes[2]]);
        Asked { tip, tool, rotary: rotary(axes, state) }
    }
}

/// Joint values with the rotary words in their joints, and the point in those that slide: to begin with.
pub fn started(machine: &Machine, asked: &Asked, sliding: &[usize; 3], turning: &[(usize, usize)]) -> Vec<f64> {
    let mut joints = vec![0.0; machine.joints.len()];
    for (joint, word) in turning {
        // Rotary words are A, B and C.
        joints[*joint] = word.checked_sub(3).and_then(|w| asked.rotary.get(w)).copied().unwrap_or(0.0);
    }
    for (joint, v) in sliding.iter().zip(asked.tip) {
        joints[*joint] = v;
    }
    joints
}

/// Where the rotary axes of a `cartesian` machine are, its file doesn't say: they are passed on and move no tool point that is known.
pub fn unplaced(machine: &Machine, joint: usize) -> bool {
    matches!(machine.chain, Chain::Cartesian) && machine.joints.get(joint).is_some_and(|j| j.kind == JointKind::Revolute)
}

/// Joint values with the rotary axes at zero that are nobody knows where.
pub fn as_far_as_known(machine: &Machine, joints: &[f64], turning: &[(usize, usize)]) -> Vec<f64> {
    let mut out = joints.to_vec();
    for (joint, _) in turning.iter().filter(|(joint, _)| unplaced(machine, *joint)) {
        out[*joint] = 0.0;
    }
    out
}

/// Steps of the search for the sliding joints: where they slide straight, one is enough.
const STEPS: usize = 12;

/// Joint values that put the tool point there with the turning joints as they are.
pub fn slid(machine: &dyn Kinematics, joints: &[f64], sliding: &[usize; 3], asked: &Asked) -> Result<Vec<f64>, KinematicsError> {
    let tip = |q: &[f64]| Ok::<V3, KinematicsError>(machine.forward_frame(q)?.then(&asked.tool).position);
    let mut q = joints.to_vec();
    for _ in 0..STEPS {
        let here = tip(&q)?;
        let left = sub(asked.tip, here);
        if norm(left) < 1e-12 * norm(asked.tip).max(1.0) {
            break;
        }
        // The tool point goes evenly with what slides: one unit each says how.
        let mut slope = vec![vec![0.0; 3]; 3];
        for (k, joint) in sliding.iter().enumerate() {
            let mut moved = q.clone();
            moved[*joint] += 1.0;
            for (row, v) in slope.iter_mut().zip(sub(tip(&moved)?, here)) {
                row[k] = v;
            }
        }
        let step = solve(slope, left.to_vec()).ok_or(KinematicsError::Singular)?;
        for (joint, v) in sliding.iter().zip(step) {
            q[*joint] += v;
        }
    }
    Ok(q)
}

/// The work frame in the place of the part: work offset, rotation and local offset.
pub fn work_shift(state: &State) -> Frame {
    let (o, l) = (&state.work_offset, &state.local_offset);
    Frame { turn: rot_z(state.rotation), position: [o[0], o[1], o[2]] }.then(&Frame::shift([l[0], l[1], l[2]]))
}

/// Rotary words with their offsets.
pub fn rotary(axes: &Axes, state: &State) -> [f64; 3] {
    [3, 4, 5].map(|i| axes[i] + state.work_offset[i] + state.local_offset[i] + state.tool_offset[i])
}

/// Names of the frames that a machine file may have for work offsets.
const NAMES: [&str; 10] = ["", "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];

/// The machine with the part put down there in its base, whatever its file says of tables and work offsets.
pub fn put_down(machine: &Machine, part: Frame) -> Machine {
    let mut put = machine.clone();
    (put.cell.table, put.cell.part) = (Frame::IDENTITY, part);
    for name in NAMES {
        put.cell.frames.remove(name);
    }
    put
}

/// The work frame in the base.
pub fn frame(machine: &Machine, state: &State) -> Frame {
    placed(machine, state).then(&work_shift(state))
}

/// What the machine file places the work frame by, in the base.
pub(crate) fn placed(machine: &Machine, state: &State) -> Frame {
    placed_by(machine, state.work)
}

/// The same by the number of a work offset, 1 = G54.
pub fn placed_by(machine: &Machine, work: u8) -> Frame {
    let cell = &machine.cell;
    let named = NAMES.get(usize::from(work)).and_then(|n| cell.frames.get(*n)).map(|f| cell.carried(*f));
    named.unwrap_or_else(|| cell.part_in_base())
}

/// The tool point on the spindle's nose: the machine file's, else a tool as long as its offset.
pub fn tool(machine: &Machine, state: &State) -> Frame {
    let number = u32::try_from(state.tool).unwrap_or(0);
    if machine.cell.tools.contains_key(&number) {
        return machine.cell.tool_frame(number);
    }
    machine.tool_of_length(state.tool_offset[2])
}
