//! Correcting a program for deviations of the geometry that are known. A robot's program is corrected target by
//! target, position and turn; [`motion`] does it before any control's words are made, for mills and for machines
//! whose tool turns as it will.

use gr_machine::math::{
    Frame, V3, about, add, cross, dot, norm, product, quaternion_of, rotate, rotation_vector, scale, sub, transpose, turn_of,
};
use gr_machine::{Control, Kinematics, KinematicsError, Machine};
use gr_robot::{Action, RobotProgram, Step, Target, Zone};

mod motion;
pub use motion::{CompensatedMotion, motion};

/// A machine whose geometry is known to differ from what its control computes with.
pub struct Corrector {
    nominal: Box<dyn Kinematics>,
    real: Box<dyn Kinematics>,
}

/// The deviations a machine file's `[as_built]` says, in the order of `Machine::parameters`; none = only the nominal
/// geometry is known.
pub fn deviations(machine: &Machine) -> Option<Vec<f64>> {
    let known = machine.cell.as_built.as_ref()?;
    Some(machine.parameters().iter().map(|p| known.deviations.get(&p.name).copied().unwrap_or(0.0)).collect())
}

impl Corrector {
    /// With deviations in the order of `Machine::parameters`, mm or rad.
    pub fn new(machine: &Machine, deviations: &[f64]) -> Corrector {
        Corrector { nominal: machine.kinematics(), real: machine.deviated(deviations) }
    }

    /// Joint values the control makes of a flange, the nearest to some.
    fn joints(&self, command: &Frame, near: &[f64]) -> Result<Vec<f64>, KinematicsError> {
        let far = |q: &Vec<f64>| q.iter().zip(near).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let all = self.nominal.inverse_frame(command)?.into_iter().map(|s| s.joints);
        all.min_by(|a, b| far(a).total_cmp(&far(b))).ok_or(KinematicsError::NoAssembly)
    }

    /// Where the tool point of the real machine is when the control sends the flange to `command`.
    pub fn real_place(&self, command: &Frame, tool: &Frame, near: &[f64]) -> Result<V3, KinematicsError> {
        let joints = self.joints(command, near)?;
        Ok(self.real.forward_frame(&joints)?.then(tool).position)
    }

    /// The flange to command, so that the real machine's is where `aim` is, and the joint values the control makes of
    /// it. A machine that can't turn its tool at will, or not this way, puts the tool point there and no more.
    pub fn command(&self, aim: &Frame, tool: &Frame, near: &[f64]) -> Result<(Frame, Vec<f64>), KinematicsError> {
        if self.nominal.control() == Control::Full
            && let Ok(found) = self.whole(aim, near)
        {
            return Ok(found);
        }
        let wanted = aim.then(tool).position;
        let mut command = *aim;
        for _ in 0..STEPS {
            let left = sub(wanted, self.real_place(&command, tool, near)?);
            command.position = add(command.position, left);
            if norm(left) < 1e-12 * norm(wanted).max(1.0) {
                break;
            }
        }
        let joints = self.joints(&command, near)?;
        Ok((command, joints))
    }

    /// Position and turn together.
    fn whole(&self, aim: &Frame, near: &[f64]) -> Result<(Frame, Vec<f64>), KinematicsError> {
        let mut command = *aim;
        for _ in 0..STEPS {
            let (shift, turn) = self.real.forward_frame(&self.joints(&command, near)?)?.error_to(aim);
            command.position = add(command.position, shift);
            let angle = norm(turn);
            if angle > 1e-13 {
                command.turn = product(&about(scale(turn, 1.0 / angle), angle), &command.turn);
            }
            if norm(shift) < 1e-12 * norm(aim.position).max(1.0) && angle < 1e-13 {
                break;
            }
        }
        let joints = self.joints(&command, near)?;
        Ok((command, joints))
    }

    /// By what angle the tool axis of the real machine leans from that of `aim`, rad.
    fn lean(&self, joints: &[f64], aim: &Frame, tool: &Frame) -> f64 {
        let axis = |f: &Frame| f.then(tool).axis(2);
        self.real.forward_frame(joints).map_or(0.0, |real| angle(axis(&real), axis(aim)))
    }
}

/// Corrections are repeated at most so often; each time next to nothing is left of what was.
const STEPS: usize = 12;

fn angle(a: V3, b: V3) -> f64 {
    libm::atan2(norm(cross(a, b)), dot(a, b))
}

/// What was done to one target.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Correction {
    /// Line of the source, from 0; none = a move of our own.
    pub line: Option<u32>,
    /// Tool point in the base that is wanted, mm.
    pub aim: V3,
    /// How far from there it is commanded, mm.
    pub by: V3,
    /// By what angle the tool is commanded to turn besides, rad.
    pub turn: f64,
    /// By what angle the tool's axis still leans, rad.
    pub left: f64,
}

/// A corrected program.
#[derive(Clone, PartialEq, Debug)]
pub struct Compensated {
    /// The program.
    pub program: RobotProgram,
    /// Corrections, move by move.
    pub corrections: Vec<Correction>,
    /// Arcs that are written as straight pieces: a corrected arc is none.
    pub arcs: usize,
}

/// Moves are cut into at most so many pieces.
const PIECES: usize = 4096;

/// Corrects every target of a program; moves are cut so that the path between targets is within `tolerance`, mm, too.
/// On an error, the step that could not be corrected.
pub fn program(
    program: &RobotProgram,
    deviations: &[f64],
    tolerance: f64,
) -> Result<Compensated, (Step, KinematicsError)> {
    let corrector = Corrector::new(&program.machine, deviations);
    let mut out = Compensated { program: program.clone(), corrections: Vec::new(), arcs: 0 };
    out.program.steps.clear();
    out.program.targets.clear();
    let mut at = Place { frame: Frame::IDENTITY, tool: Frame::IDENTITY };
    let mut from = program.home;
    for step in &program.steps {
        let target = |i: u32| program.targets.get(i as usize).copied();
        let fail = |e| (step.clone(), e);
        match &step.action {
            Action::UseFrame(i) => {
                let old = std::mem::replace(&mut at.frame, program.frames.get(usize::from(*i)).map_or(Frame::IDENTITY, |f| f.frame));
                from = from.reframed(&old, &at.frame);
                out.program.steps.push(step.clone());
            }
            Action::UseTool(i) => {
                let old = std::mem::replace(&mut at.tool, program.tools.get(usize::from(*i)).map_or(Frame::IDENTITY, |t| t.frame));
                from = from.retooled(&old, &at.tool);
                out.program.steps.push(step.clone());
            }
            Action::Joint { to, speed, zone } => {
                let Some(end) = target(*to) else { continue };
                let index = push(&mut out, &corrector, &at, &end, step).map_err(fail)?;
                let action = Action::Joint { to: index, speed: *speed, zone: *zone };
                out.program.steps.push(Step { action, source: step.source });
                from = end;
            }
            Action::Probe { to, speed, input, on, must } => {
                let Some(end) = target(*to) else { continue };
                let to = push(&mut out, &corrector, &at, &end, step).map_err(fail)?;
                let action = Action::Probe { to, speed: *speed, input: input.clone(), on: *on, must: *must };
                out.program.steps.push(Step { action, source: step.source });
                from = end;
            }
            Action::Linear { to, speed, zone, rapid } => {
                let Some(end) = target(*to) else { continue };
                let pieces = if *rapid { 1 } else { straight(&corrector, &at, &from, &end, tolerance).map_err(fail)? };
                for i in 1..=pieces {
                    let t = i as f64 / pieces as f64;
                    let piece = if i == pieces { end } else { between(&from, &end, t) };
                    let index = push(&mut out, &corrector, &at, &piece, step).map_err(fail)?;
                    let zone = if i == pieces { *zone } else { Zone::Blend(tolerance) };
                    let action = Action::Linear { to: index, speed: *speed, zone, rapid: *rapid };
                    out.program.steps.push(Step { action, source: step.source });
                }
                from = end;
            }
            Action::Arc { to, center, normal, angle, speed, zone, .. } => {
                let Some(end) = target(*to) else { continue };
                out.arcs += 1;
                let spoke = sub(from.position, *center);
                let radius = norm(sub(spoke, scale(*normal, dot(spoke, *normal))));
                let sagitta = (1.0 - tolerance.min(radius) / radius.max(1e-12)).clamp(-1.0, 1.0);
                let share = 2.0 * libm::acos(sagitta);
                let pieces = (libm::ceil(angle / share.max(1e-6)).max(4.0) as usize).min(PIECES);
                for i in 1..=pieces {
                    let t = i as f64 / pieces as f64;
                    let piece = if i == pieces { end } else { on_arc(&from, &end, (*center, *normal, *angle), t) };
                    let index = push(&mut out, &corrector, &at, &piece, step).map_err(fail)?;
                    let zone = if i == pieces { *zone } else { Zone::Blend(tolerance) };
                    let action = Action::Linear { to: index, speed: *speed, zone, rapid: false };
                    out.program.steps.push(Step { action, source: step.source });
                }
                from = end;
            }
            _ => out.program.steps.push(step.clone()),
        }
    }
    Ok(out)
}

struct Place {
    frame: Frame,
    tool: Frame,
}

impl Place {
    /// Flange of a target in the base. A machine that decides its turn itself stands as its joints say.
    fn flange(&self, corrector: &Corrector, target: &Target) -> Frame {
        let tip = self.frame.then(&Frame { position: target.position, turn: turn_of(target.quaternion) });
        let count = corrector.nominal.joint_count().min(target.joints.len());
        let asked = tip.then(&self.tool.inverse());
        match corrector.nominal.forward_frame(&target.joints[..count]) {
            Ok(real) if norm(rotation_vector(&product(&real.turn, &transpose(&asked.turn)))) > 1e-6 => {
                let lever = rotate(&real.turn, self.tool.position);
                Frame { turn: real.turn, position: sub(tip.position, lever) }
            }
            _ => asked,
        }
    }
}

fn push(
    out: &mut Compensated,
    corrector: &Corrector,
    at: &Place,
    target: &Target,
    step: &Step,
) -> Result<u32, KinematicsError> {
    let count = corrector.nominal.joint_count().min(target.joints.len());
    let aim = at.flange(corrector, target);
    let (command, joints) = corrector.command(&aim, &at.tool, &target.joints[..count])?;
    let (wanted, tip) = (aim.then(&at.tool), command.then(&at.tool));
    let by = sub(tip.position, wanted.position);
    let turn = norm(wanted.error_to(&tip).1);
    let mut corrected = *target;
    // The correction in the directions of the work frame.
    corrected.position = add(target.position, rotate(&transpose(&at.frame.turn), by));
    if turn > 1e-12 {
        corrected.quaternion = quaternion_of(&product(&transpose(&at.frame.turn), &tip.turn));
    }
    corrected.joints[..count].copy_from_slice(&joints);
    let line = step.source.map(|s| s.line);
    let left = corrector.lean(&joints, &aim, &at.tool);
    out.corrections.push(Correction { line, aim: wanted.position, by, turn, left });
    out.program.targets.push(corrected);
    Ok(u32::try_from(out.program.targets.len() - 1).unwrap_or(u32::MAX))
}

fn between(from: &Target, end: &Target, t: f64) -> Target {
    let mix = |a: f64, b: f64| a + (b - a) * t;
    let mut out = *end;
    out.position = [0, 1, 2].map(|i| mix(from.position[i], end.position[i]));
    let side = if (0..4).map(|i| from.quaternion[i] * end.quaternion[i]).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    let q = [0, 1, 2, 3].map(|i| mix(from.quaternion[i] * side, end.quaternion[i]));
    let size = libm::sqrt(q.iter().map(|v| v * v).sum());
    out.quaternion = if size > 1e-9 { q.map(|v| v / size) } else { end.quaternion };
    for (o, (a, b)) in out.joints.iter_mut().zip(from.joints.iter().zip(end.joints)) {
        *o = mix(*a, b);
    }
    out
}

fn on_arc(from: &Target, end: &Target, (center, normal, angle): (V3, V3, f64), t: f64) -> Target {
    let spoke = sub(from.position, center);
    let rise = dot(sub(end.position, from.position), normal);
    let (s, c) = libm::sincos(angle * t);
    let along = scale(normal, dot(spoke, normal) * (1.0 - c));
    let out = add(add(scale(spoke, c), scale(cross(normal, spoke), s)), along);
    Target { position: add(add(center, out), scale(normal, rise * t)), ..between(from, end, t) }
}

/// Into how many pieces a straight move must be cut, so that the correction in the middle of each is the mean of those
/// at its ends.
fn straight(corrector: &Corrector, at: &Place, from: &Target, end: &Target, tolerance: f64) -> Result<usize, KinematicsError> {
    let count = corrector.nominal.joint_count().min(end.joints.len());
    let by = |t: f64| -> Result<V3, KinematicsError> {
        let target = between(from, end, t);
        let aim = at.flange(corrector, &target);
        let command = corrector.command(&aim, &at.tool, &target.joints[..count])?.0;
        Ok(sub(command.then(&at.tool).position, aim.then(&at.tool).position))
    };
    halved(by, tolerance)
}

/// Into how many pieces a way must be cut for the correction in the middle of each to be the mean of those at its ends.
fn halved<E>(by: impl Fn(f64) -> Result<V3, E>, tolerance: f64) -> Result<usize, E> {
    let mut pieces = 1;
    while pieces < PIECES {
        let bends = |i: usize| {
            let (a, b) = (i as f64 / pieces as f64, (i + 1) as f64 / pieces as f64);
            let (p, m, q) = (by(a)?, by((a + b) / 2.0)?, by(b)?);
            Ok(norm(sub(m, scale(add(p, q), 0.5))))
        };
        let mut worst = 0.0f64;
        for i in 0..pieces {
            worst = worst.max(bends(i)?);
        }
        if worst <= tolerance / 10.0 {
            break;
        }
        pieces *= 2;
    }
    Ok(pieces)
}
