//! The inverse kinematics of S. N. Rea Minango, *Aplicação em robótica do padrão STEP-NC na geração de trajetórias de
//! usinagem*, UFSC 2016, section 3.5: damped least squares with respect for the joint limits, point after point, each
//! from the joint values of the one before. It repeats the numbers of that publication; everything else here solves
//! in closed form.
//!
//! Three things differ from its printed equations, because its printed results need them: equation 18 is applied as
//! (JᵀJ + D²)⁻¹Jᵀe, the tests look at the greatest component instead of the norm, and D² holds the squares of λ.

use std::collections::BTreeSet;

use gr_ir::{Program, Source};
use gr_machine::math::{Frame, M3, norm, product, rot_x, rot_y, rot_z, rotate, rotation_vector, solve, transpose};
use gr_machine::{Chain, KinematicsError, Machine, differential};

use crate::settle::{main_line, setup_at};
use crate::{Setup, Workingstep};

/// Constants of the solver.
#[derive(Clone, PartialEq, Debug)]
pub struct Damped {
    /// Errors of position, mm, and of turn, rad, at which it stops.
    pub stop: (f64, f64),
    /// Factor and power of the damping near joint limits (equation 19).
    pub damping: (f64, i32),
    /// Steps per point.
    pub steps: u32,
    /// Joint values to start from; none = the middles of the joints' ranges.
    pub start: Option<Vec<f64>>,
}

impl Default for Damped {
    /// Those of the publication.
    fn default() -> Damped {
        Damped { stop: (1e-4, 1e-4), damping: (0.5, 8), steps: 100, start: None }
    }
}

/// One point solved.
#[derive(Clone, PartialEq, Debug)]
pub struct Found {
    /// Joint values, rad or mm.
    pub joints: Vec<f64>,
    /// Steps taken.
    pub steps: u32,
    /// What is left over: wanted minus reached, mm.
    pub error: [f64; 3],
}

/// A point that no start leads to.
#[derive(Clone, PartialEq, Debug)]
pub struct Lost {
    /// Its number, from 0.
    pub point: usize,
    /// Why.
    pub why: KinematicsError,
}

/// The tool pointing along a direction of the base, with the turn about it that the publication's run must have had:
/// printed rows tell the face, the spin only decides the configuration that is found.
pub fn tool_turn(direction: [f64; 3], six_axes: bool) -> M3 {
    use std::f64::consts::{FRAC_PI_2, PI};
    let d = direction.map(libm::round);
    let spin = if six_axes { [PI, PI, 0.0] } else { [0.0; 3] };
    if d[1] == 1.0 {
        product(&rot_y(spin[1]), &rot_x(-FRAC_PI_2))
    } else if d[0] == 1.0 {
        product(&rot_x(spin[2]), &rot_y(FRAC_PI_2))
    } else {
        product(&rot_z(spin[0]), &rot_x(PI))
    }
}

/// Solves point after point.
pub fn follow(machine: &Machine, points: &[Frame], settings: &Damped) -> Result<Vec<Found>, Lost> {
    let limits = limits(machine);
    let seeds = seeds(&limits);
    let mut out: Vec<Found> = Vec::with_capacity(points.len());
    for (point, aim) in points.iter().enumerate() {
        let near = out.last().map(|f| f.joints.clone()).or_else(|| settings.start.clone()).unwrap_or_else(|| seeds[0].clone());
        let mut found = search(machine, aim, near, &limits, settings);
        for seed in seeds.iter() {
            if found.is_ok() {
                break;
            }
            found = search(machine, aim, seed.clone(), &limits, settings);
        }
        out.push(found.map_err(|why| Lost { point, why })?);
    }
    Ok(out)
}

fn limits(machine: &Machine) -> Vec<(f64, f64)> {
    machine.joints.iter().map(|j| (j.min.unwrap_or(-std::f64::consts::PI), j.max.unwrap_or(std::f64::consts::PI))).collect()
}

/// Starts: the middle, then all greatest, all least, the middles of either half.
fn seeds(limits: &[(f64, f64)]) -> [Vec<f64>; 5] {
    let each = |f: fn(&(f64, f64)) -> f64| limits.iter().map(f).collect::<Vec<f64>>();
    [each(|l| (l.0 + l.1) / 2.0), each(|l| l.1), each(|l| l.0), each(|l| l.1 / 2.0), each(|l| l.0 / 2.0)]
}

fn greatest(v: [f64; 3]) -> f64 {
    v.into_iter().fold(0.0, |m, c| m.max(c.abs()))
}

fn search(machine: &Machine, aim: &Frame, start: Vec<f64>, limits: &[(f64, f64)], settings: &Damped) -> Result<Found, KinematicsError> {
    let kinematics = machine.kinematics();
    let mut q = start;
    for steps in 0..=settings.steps {
        let here = kinematics.forward_frame(&q)?;
        let mut shift = [0, 1, 2].map(|i| aim.position[i] - here.position[i]);
        let mut turn = rotation_vector(&product(&aim.turn, &transpose(&here.turn)));
        if greatest(shift) <= settings.stop.0 && greatest(turn) <= settings.stop.1 {
            return Ok(Found { joints: q, steps, error: shift });
        }
        if steps == settings.steps {
            return Err(KinematicsError::NotFound { distance: norm(shift), angle: norm(turn) });
        }
        // Equation 26.
        if greatest(shift) > settings.stop.0 {
            shift = shift.map(|v| v / 2.0);
        }
        if greatest(turn) > settings.stop.1 {
            turn = turn.map(|v| v / 2.0);
        }
        let e = [shift[0], shift[1], shift[2], turn[0], turn[1], turn[2]];
        let step = step(machine, &q, &e, limits, settings)?;
        for ((q, d), (min, max)) in q.iter_mut().zip(step).zip(limits) {
            *q += d;
            if *q > *max {
                *q = 0.75 * min;
            } else if *q < *min {
                *q = 0.75 * max;
            }
        }
    }
    Err(KinematicsError::Singular)
}

/// Equations 17 to 19.
fn step(machine: &Machine, q: &[f64], e: &[f64; 6], limits: &[(f64, f64)], settings: &Damped) -> Result<Vec<f64>, KinematicsError> {
    // By differences where the arm is no wrist arm: with the exact columns one of the published points ends a step earlier.
    let columns = match machine.chain {
        Chain::Opw(_) | Chain::Serial(_) => differential::velocity(machine, q)?,
        _ => differential::jacobian(&*machine.kinematics(), q)?,
    };
    let dot = |a: &[f64; 6], b: &[f64; 6]| -> f64 { a.iter().zip(b).map(|(p, q)| p * q).sum() };
    let n = columns.len();
    let mut a: Vec<Vec<f64>> = columns.iter().map(|c| columns.iter().map(|d| dot(c, d)).collect()).collect();
    for i in 0..n {
        let (min, max) = limits[i];
        let share = (2.0 * q[i] - max - min) / (max - min);
        let lambda = settings.damping.0 * libm::pow(share, f64::from(settings.damping.1));
        a[i][i] += lambda * lambda;
    }
    let b: Vec<f64> = columns.iter().map(|c| dot(c, e)).collect();
    solve(a.clone(), b.clone())
        .filter(|s| s.iter().all(|v| v.abs() < 1e3))
        .or_else(|| {
            // Exactly singular, as at the middle of the joints' ranges: a hair of damping decides.
            for (i, row) in a.iter_mut().enumerate() {
                row[i] += 1e-9 * row[i].abs().max(1.0);
            }
            solve(a, b)
        })
        .ok_or(KinematicsError::Singular)
}

/// The points of the publication in the base: position in the part, and direction of the tool there.
pub fn frames(machine: &Machine, placements: &[(std::ops::RangeInclusive<usize>, Frame)], points: &[([f64; 3], [f64; 3])]) -> Vec<Frame> {
    let six = machine.joints.len() >= 6;
    let place = |n: usize| placements.iter().find(|(r, _)| r.contains(&n)).map_or(Frame::IDENTITY, |(_, f)| *f);
    points.iter().enumerate().map(|(i, point)| aim(&place(i + 1), point, six)).collect()
}

/// A point of a placed part in the base: position in the part, and direction of the tool there.
fn aim(placed: &Frame, (position, direction): &([f64; 3], [f64; 3]), six_axes: bool) -> Frame {
    Frame { turn: tool_turn(rotate(&placed.turn, *direction), six_axes), position: placed.apply(*position) }
}

/// Where a program's moves lead to.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Aims {
    /// The tool in the base, mm, and where each comes from.
    pub points: Vec<(Frame, Source)>,
    /// Setups of the job that have a point, by their numbers.
    pub begun: BTreeSet<usize>,
}

/// The ends of a program's moves, the part placed as the machine has it, or as the setups of a job do.
pub fn aims(machine: &Machine, program: &Program, setups: &[Setup]) -> Aims {
    let (own, six) = (machine.cell.part_in_base(), machine.joints.len() >= 6);
    let mut out = Aims::default();
    let mut workingstep = None;
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        workingstep = Workingstep::begun_by(&view.op).or(workingstep);
        if !view.op.moves() {
            continue;
        }
        let setup = setup_at(setups, workingstep.as_ref(), || main_line(program, view.source));
        out.begun.extend(setup);
        let placed = setup.and_then(|i| setups[i].part).unwrap_or(own);
        let axis = view.end.tool_axis.unwrap_or([0.0, 0.0, 1.0]);
        out.points.push((aim(&placed, &(view.end.xyz(), axis.map(|v| -v)), six), view.source));
    }
    out
}
