//! Correction of a program as motion. The control works out the joints from corrected words with its nominal geometry,
//! and the real machine's tool point is on the programmed path.
//!
//! Rotary words stay as they are: on a mill they are what the program means, so the tool point is corrected and the lean
//! of the tool is told. On a mill the program's zero was found by touching the part with this very machine: corrections
//! count from there, and at the zero itself there is none.

use super::{Correction, Corrector, halved};
use crate::words::{Asked, Slides, Words, as_far_as_known, frame, rotary, slid, started, tool};
use gr_ir::{Axes, Builder, FeedMode, Op, Pose, Program, Source, Sources, State, geometry};
use gr_machine::math::{Frame, V3, add, rotate, sub, transpose};
use gr_machine::{Kinematics, KinematicsError, Machine};
use gr_robot::{By, Coordinates};

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
    sources: &dyn Sources,
) -> Result<CompensatedMotion, (Source, String)> {
    let words = Words::of(machine).map_err(|why| (Source::default(), why))?;
    let corrector = Corrector::new(machine, deviations);
    let mut out = Builder::from_state(*program.start(), *program.start_state());
    out.names_of(program);
    let mut run = Run { machine, corrector, words, zero: None, fixed: [false; 3], out, corrections: Vec::new(), arcs: 0 };
    let mut cursor = program.cursor();
    let mut coordinates = matches!(run.words, Words::Joints(_)).then(|| Coordinates::new(program));
    while let Some(view) = cursor.next() {
        if let Some(coordinates) = &mut coordinates {
            run.fixed = coordinates.step(program, &view, sources).map(|by| by == By::Machine);
        }
        run.step(&view, tolerance).map_err(|e| (view.source, format!("the corrected point can't be reached: {e}")))?;
    }
    Ok(CompensatedMotion { program: run.out.finish(), corrections: run.corrections, arcs: run.arcs })
}

/// What the correction at the program's zero depends on.
type ZeroKey = (Frame, Frame, [f64; 3]);

struct Run<'a> {
    machine: &'a Machine,
    corrector: Corrector,
    words: Words,
    zero: Option<(ZeroKey, V3)>,
    /// Coordinates at places of the machine: there is nothing to correct.
    fixed: [bool; 3],
    out: Builder,
    corrections: Vec<Correction>,
    arcs: usize,
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
        let frame = frame(self.machine, state);
        let mut out = *pose;
        let turned = rotate(&transpose(&frame.turn), by);
        let turned = [0, 1, 2].map(|i| if self.fixed[i] { 0.0 } else { turned[i] });
        let by = rotate(&frame.turn, turned);
        let moved = add(pose.xyz(), turned);
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
        let key = (frame(self.machine, state), tool(self.machine, state), rotary(&[0.0; 9], state));
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
        let asked = Asked::new(self.machine, axes, state);
        match &self.words {
            Words::Joints(Slides { sliding, turning }) => self.by_joints(&asked, sliding, turning),
            Words::Point => self.by_point(&asked),
        }
    }

    fn by_joints(&self, asked: &Asked, sliding: &[usize; 3], turning: &[(usize, usize)]) -> Result<(V3, f64), KinematicsError> {
        let joints = as_far_as_known(self.machine, &started(self.machine, asked, sliding, turning), turning);
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
}

fn mixed(from: &Axes, to: &Axes, t: f64) -> Axes {
    std::array::from_fn(|i| from[i] + (to[i] - from[i]) * t)
}
