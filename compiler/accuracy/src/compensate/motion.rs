//! Correction of a program as motion. The control works out the joints from corrected words with its nominal geometry,
//! and the real machine's tool point is on the programmed path.
//!
//! Rotary words stay as they are: on a mill they are what the program means, so the tool point is corrected and the lean
//! of the tool is told. On a mill the program's zero was found by touching the part with this very machine: corrections
//! count from there, and at the zero itself there is none.

use super::{Correction, Corrector, halved};
use gr_ir::{Axes, Builder, FeedMode, Op, Pose, Program, Source, State, geometry};
use gr_machine::math::{Frame, V3, add, norm, rot_z, rotate, solve, sub, transpose};
use gr_machine::{Chain, Control, JointKind, Kind, Kinematics, KinematicsError, Machine};

/// A corrected program.
#[derive(Clone, PartialEq, Debug)]
pub struct CompensatedMotion {
    /// The program.
    pub program: Program,
    /// Corrections, move by move.
    pub corrections: Vec<Correction>,
    /// Arcs and curves that are straight pieces now.
    pub arcs: usize,
}

/// Corrects every point of a program; moves are cut so that the path between them is within `tolerance`, mm, too. On
/// an error, what could not be corrected and why.
pub fn motion(
    program: &Program,
    machine: &Machine,
    deviations: &[f64],
    tolerance: f64,
) -> Result<CompensatedMotion, (Source, String)> {
    let words = Words::of(machine).map_err(|why| (Source::default(), why))?;
    let corrector = Corrector::new(machine, deviations);
    let mut out = Builder::from_state(*program.start(), *program.start_state());
    out.names_of(program);
    let mut run = Run { machine, corrector, words, zero: None, out, corrections: Vec::new(), arcs: 0 };
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        run.step(&view, tolerance).map_err(|e| (view.source, format!("the corrected point can't be reached: {e}")))?;
    }
    Ok(CompensatedMotion { program: run.out.finish(), corrections: run.corrections, arcs: run.arcs })
}

/// How the words of a program put the tool where it is.
enum Words {
    /// Rotary words are rotary joints; these are the joints that slide, and joint and word of each that turns.
    Joints { sliding: [usize; 3], turning: Vec<(usize, usize)> },
    /// X Y Z alone.
    Point,
}

impl Words {
    fn of(machine: &Machine) -> Result<Words, String> {
        if matches!(machine.chain, Chain::Cartesian | Chain::FiveAxis(_)) {
            let word = |i: usize| {
                let letter = machine.joints[i].word.map_or("XYZABCUVW".as_bytes().get(i).copied(), |c| u8::try_from(c).ok());
                letter.and_then(|l| b"XYZABCUVW".iter().position(|w| *w == l.to_ascii_uppercase()))
            };
            let of_kind = |kind| (0..machine.joints.len()).filter(move |i| machine.joints[*i].kind == kind);
            let sliding: Vec<usize> = of_kind(JointKind::Prismatic).filter(|i| word(*i).is_some_and(|w| w < 3)).collect();
            let turning = of_kind(JointKind::Revolute).filter_map(|i| Some((i, word(i)?))).collect();
            let sliding = sliding.try_into().map_err(|_| "its machine has no X, Y and Z that slide".to_string())?;
            return Ok(Words::Joints { sliding, turning });
        }
        if machine.kinematics().control() == Control::Position {
            return Ok(Words::Point);
        }
        Err("which configuration the joints take is not in this target; a robot's own language or joint-gcode has it".into())
    }
}

/// What the correction at the program's zero depends on.
type ZeroKey = (Frame, Frame, [f64; 3]);

struct Run<'a> {
    machine: &'a Machine,
    corrector: Corrector,
    words: Words,
    zero: Option<(ZeroKey, V3)>,
    out: Builder,
    corrections: Vec<Correction>,
    arcs: usize,
}

/// A point as the program has it.
struct Asked {
    tip: V3,
    tool: Frame,
    rotary: [f64; 3],
}

impl Run<'_> {
    fn step(&mut self, view: &gr_ir::View<'_, '_>, tolerance: f64) -> Result<(), KinematicsError> {
        let (start, end, state, source) = (view.start, view.end, view.state, view.source);
        match view.op {
            Op::Rapid | Op::Probe(_) => self.go(view.op, end, state, source),
            Op::Linear => {
                let at = |t: f64| Pose { axes: mixed(&start.axes, &end.axes, t), ..*end };
                let zero = self.at_zero(state)?;
                let pieces = halved(|t| Ok(sub(self.correction(&at(t).axes, state)?.0, zero)), tolerance)?;
                let poses = (1..=pieces).map(|i| if i == pieces { *end } else { at(i as f64 / pieces as f64) }).collect();
                self.chain(poses, state, source)
            }
            Op::Arc(_) | Op::Nurbs { .. } => {
                self.arcs += 1;
                let mut poses = Vec::new();
                geometry::flatten(&view.op, start, end, tolerance, |axes| poses.push(Pose { axes: *axes, ..*end }));
                self.chain(poses, state, source)
            }
            Op::RigidTap { bottom: [x, y, z], scale } => {
                let mut deep = start.axes;
                (deep[0], deep[1], deep[2]) = (x, y, z);
                let there = self.corrected(&Pose { axes: deep, ..*start }, state, source)?;
                self.out.push(Op::RigidTap { bottom: there.xyz(), scale }, source);
                Ok(())
            }
            op => {
                self.out.push(op, source);
                Ok(())
            }
        }
    }

    fn go(&mut self, op: Op<'_>, end: &Pose, state: &State, source: Source) -> Result<(), KinematicsError> {
        let end = self.corrected(end, state, source)?;
        self.out.push_to(op, &end, source);
        Ok(())
    }

    /// Straight pieces of one move, in the time the move takes.
    fn chain(&mut self, poses: Vec<Pose>, state: &State, source: Source) -> Result<(), KinematicsError> {
        let share = poses.len() as f64;
        let timed = state.feed_mode == FeedMode::Inverse && poses.len() > 1;
        let feed = |by: f64| Op::Feed { linear: state.feed * by, angular: state.feed_angular * by };
        if timed {
            self.out.push(feed(share), source);
        }
        for pose in poses {
            self.go(Op::Linear, &pose, state, source)?;
        }
        if timed {
            self.out.push(feed(1.0), source);
        }
        Ok(())
    }

    fn corrected(&mut self, pose: &Pose, state: &State, source: Source) -> Result<Pose, KinematicsError> {
        let zero = self.at_zero(state)?;
        let (by, left) = self.correction(&pose.axes, state)?;
        let by = sub(by, zero);
        let frame = self.frame(state);
        let mut out = *pose;
        let moved = add(pose.xyz(), rotate(&transpose(&frame.turn), by));
        out.axes[..3].copy_from_slice(&moved);
        let aim = frame.apply(pose.xyz());
        self.corrections.push(Correction { line: Some(source.line), aim, by, turn: 0.0, left });
        Ok(out)
    }

    /// What is taken off every correction.
    fn at_zero(&mut self, state: &State) -> Result<V3, KinematicsError> {
        if matches!(self.words, Words::Point) {
            return Ok([0.0; 3]);
        }
        let key = (self.frame(state), self.tool(state), rotary(&[0.0; 9], state));
        if let Some((known, by)) = &self.zero
            && *known == key
        {
            return Ok(*by);
        }
        let (by, _) = self.correction(&[0.0; 9], state)?;
        self.zero = Some((key, by));
        Ok(by)
    }

    /// How far from a point the machine must be sent, base directions, and by what the tool's axis leans there, rad.
    fn correction(&self, axes: &Axes, state: &State) -> Result<(V3, f64), KinematicsError> {
        let tip = self.frame(state).apply([axes[0], axes[1], axes[2]]);
        let asked = Asked { tip, tool: self.tool(state), rotary: rotary(axes, state) };
        match &self.words {
            Words::Joints { sliding, turning } => self.by_joints(&asked, sliding, turning),
            Words::Point => self.by_point(&asked),
        }
    }

    fn by_joints(&self, asked: &Asked, sliding: &[usize; 3], turning: &[(usize, usize)]) -> Result<(V3, f64), KinematicsError> {
        let mut joints = vec![0.0; self.machine.joints.len()];
        for (joint, word) in turning {
            // Rotary words are A, B and C.
            joints[*joint] = word.checked_sub(3).and_then(|w| asked.rotary.get(w)).copied().unwrap_or(0.0);
        }
        for (joint, v) in sliding.iter().zip(asked.tip) {
            joints[*joint] = v;
        }
        let (nominal, real) = (&*self.corrector.nominal, &*self.corrector.real);
        let planned = slid(nominal, &joints, sliding, asked)?;
        let sent = slid(real, &planned, sliding, asked)?;
        let tip = |k: &dyn Kinematics, q: &[f64]| Ok::<Frame, KinematicsError>(k.forward_frame(q)?.then(&asked.tool));
        let (wanted, command, got) = (tip(nominal, &planned)?, tip(nominal, &sent)?, tip(real, &sent)?);
        Ok((sub(command.position, asked.tip), super::angle(wanted.axis(2), got.axis(2))))
    }

    fn by_point(&self, asked: &Asked) -> Result<(V3, f64), KinematicsError> {
        let mut flange = Frame::shift(asked.tip);
        // The lever of the tool turns with the machine: found by going there.
        for _ in 0..4 {
            let joints = self.corrector.joints(&flange, &[])?;
            flange.turn = self.corrector.nominal.forward_frame(&joints)?.turn;
            flange.position = sub(asked.tip, rotate(&flange.turn, asked.tool.position));
        }
        let (command, joints) = self.corrector.command(&flange, &asked.tool, &[])?;
        Ok((sub(command.position, flange.position), self.corrector.lean(&joints, &flange, &asked.tool)))
    }

    /// The work frame in the base.
    fn frame(&self, state: &State) -> Frame {
        const NAMES: [&str; 10] = ["", "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
        let cell = &self.machine.cell;
        let placed = NAMES.get(usize::from(state.work)).and_then(|n| cell.frames.get(*n)).copied();
        placed.unwrap_or_else(|| cell.part_in_base()).then(&work_shift(state))
    }

    /// The tool point on the spindle's nose: the machine file's, else a tool as long as its offset.
    fn tool(&self, state: &State) -> Frame {
        let number = u32::try_from(state.tool).unwrap_or(0);
        if self.machine.cell.tools.contains_key(&number) {
            return self.machine.cell.tool_frame(number);
        }
        let length = state.tool_offset[2];
        match self.machine.kind {
            Kind::Robot => self.machine.cell.tool_frame(number).then(&Frame::shift([0.0, 0.0, length])),
            _ => Frame::shift([0.0, 0.0, -length]),
        }
    }
}

/// Joint values that put the tool point there with the turning joints as they are.
fn slid(machine: &dyn Kinematics, joints: &[f64], sliding: &[usize; 3], asked: &Asked) -> Result<Vec<f64>, KinematicsError> {
    let tip = |q: &[f64]| Ok::<V3, KinematicsError>(machine.forward_frame(q)?.then(&asked.tool).position);
    let mut q = joints.to_vec();
    for _ in 0..super::STEPS {
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
fn rotary(axes: &Axes, state: &State) -> [f64; 3] {
    [3, 4, 5].map(|i| axes[i] + state.work_offset[i] + state.local_offset[i] + state.tool_offset[i])
}

fn mixed(from: &Axes, to: &Axes, t: f64) -> Axes {
    std::array::from_fn(|i| from[i] + (to[i] - from[i]) * t)
}
