//! Velocities and how near a singularity they are, for any machine.

use crate::kinematics::{Kinematics, KinematicsError, checked};
use crate::math::{
    Frame, V3, cross, eigenvalues, product, rot_z, rotate, rotation_vector, scale, solve, sub, transpose,
};
use crate::{Chain, Machine, Opw};

/// Velocity of the tool (mm, then rad) per unit of each joint, in closed form where the machine has one.
pub fn velocity(machine: &Machine, joints: &[f64]) -> Result<Vec<[f64; 6]>, KinematicsError> {
    match &machine.chain {
        Chain::TwoLegs(k) => {
            let &[h1, h2, h3] = checked(joints, 3)? else { return Err(KinematicsError::NotFinite) };
            k.joint_columns([h1, h2, h3]).ok_or(KinematicsError::Singular)
        }
        Chain::Opw(k) => {
            let q: &[f64; 6] = checked(joints, 6)?.try_into().map_err(|_| KinematicsError::NotFinite)?;
            Ok(opw(k, q).to_vec())
        }
        Chain::Serial(k) => k.jacobian(joints),
        Chain::Tricept(_) => by_inverse(&*machine.kinematics(), joints),
        _ => jacobian(&*machine.kinematics(), joints),
    }
}

/// Velocity of the flange of an arm with a spherical wrist, per unit of each joint.
pub fn opw(arm: &Opw, joints: &[f64; 6]) -> [[f64; 6]; 6] {
    let [a1, _, _, c1, c2, _, c4] = arm.lengths();
    let flange = arm.flange(joints);
    let model = |i: usize| joints[i] * arm.signs()[i] - arm.offsets()[i];
    let base = rot_z(model(0));
    let across = [base[0][1], base[1][1], base[2][1]];
    let (s2, k2) = libm::sincos(model(1));
    let (s3, k3) = libm::sincos(model(1) + model(2));
    let (s4, k4) = libm::sincos(model(3));
    let shoulder = rotate(&base, [a1, 0.0, c1]);
    let elbow = rotate(&base, [a1 + c2 * s2, 0.0, c1 + c2 * k2]);
    let tool = flange.axis(2);
    let wrist = sub(flange.position, scale(tool, c4));
    let fore = rotate(&base, [s3, 0.0, k3]);
    let bend = rotate(&base, [-s4 * k3, k4, s4 * s3]);
    let axes: [(V3, V3); 6] = [
        ([0.0, 0.0, 1.0], [0.0; 3]),
        (across, shoulder),
        (across, elbow),
        (fore, wrist),
        (bend, wrist),
        (tool, wrist),
    ];
    let mut out = [[0.0; 6]; 6];
    for (i, (axis, point)) in axes.into_iter().enumerate() {
        let w = scale(axis, arm.signs()[i]);
        let v = cross(w, sub(flange.position, point));
        out[i] = [v[0], v[1], v[2], w[0], w[1], w[2]];
    }
    out
}

/// Velocity of the tool from the change of the joint values by small movements of the tool: for machines whose
/// inverse is in closed form and whose forward solution is a search.
fn by_inverse(machine: &dyn Kinematics, joints: &[f64]) -> Result<Vec<[f64; 6]>, KinematicsError> {
    const H: [f64; 2] = [1e-3, 1e-6];
    let here = machine.forward_frame(joints)?;
    let near = |frame: &Frame| -> Result<Vec<f64>, KinematicsError> {
        let far = |q: &Vec<f64>| q.iter().zip(joints).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let all = machine.inverse_frame(frame)?.into_iter().map(|s| s.joints);
        all.min_by(|a, b| far(a).total_cmp(&far(b))).ok_or(KinematicsError::NoAssembly)
    };
    let n = joints.len();
    let mut slope = vec![vec![0.0; 6]; n];
    for axis in 0..6 {
        let moved = |h: f64| {
            let mut unit = [0.0; 3];
            unit[axis % 3] = 1.0;
            if axis < 3 {
                Frame { position: crate::math::add(here.position, scale(unit, h)), ..here }
            } else {
                Frame { turn: product(&crate::math::about(unit, h), &here.turn), ..here }
            }
        };
        let h = H[axis / 3];
        let (plus, minus) = (near(&moved(h))?, near(&moved(-h))?);
        (0..n).for_each(|i| slope[i][axis] = (plus[i] - minus[i]) / (2.0 * h));
    }
    let mut out = Vec::with_capacity(n);
    for i in 0..n {
        let unit = (0..n).map(|k| if k == i { 1.0 } else { 0.0 }).collect();
        let v: [f64; 6] =
            solve(slope.clone(), unit).and_then(|v| v.try_into().ok()).ok_or(KinematicsError::Singular)?;
        out.push(v);
    }
    Ok(out)
}

/// Rate of change between two frames that lie `h` apart: mm, then rad.
pub(crate) fn rate(plus: &Frame, minus: &Frame, h: f64) -> [f64; 6] {
    let v = scale(sub(plus.position, minus.position), 1.0 / h);
    let w = scale(rotation_vector(&product(&plus.turn, &transpose(&minus.turn))), 1.0 / h);
    [v[0], v[1], v[2], w[0], w[1], w[2]]
}

/// Velocity of the tool (mm, then rad) per unit of each joint, by central differences: one column per joint.
pub fn jacobian(machine: &dyn Kinematics, joints: &[f64]) -> Result<Vec<[f64; 6]>, KinematicsError> {
    let column = |i: usize| {
        // Lengths are some hundred mm, angles some rad: both steps keep about ten digits.
        let h = 1e-5 * joints[i].abs().max(1.0);
        let (mut p, mut q) = (joints.to_vec(), joints.to_vec());
        (p[i], q[i]) = (joints[i] + h, joints[i] - h);
        Ok(rate(&machine.forward_frame(&p)?, &machine.forward_frame(&q)?, h * 2.0))
    };
    machine.forward_frame(joints)?;
    (0..joints.len()).map(column).collect()
}

/// Singular values of a Jacobian, greatest first; turns count `size` mm per rad.
pub fn singular_values(columns: &[[f64; 6]], size: f64) -> Vec<f64> {
    let weigh = |c: &[f64; 6]| [c[0], c[1], c[2], c[3] * size, c[4] * size, c[5] * size];
    let columns: Vec<[f64; 6]> = columns.iter().map(weigh).collect();
    let dot = |a: &[f64; 6], b: &[f64; 6]| -> f64 { a.iter().zip(b).map(|(p, q)| p * q).sum() };
    let square = columns.iter().map(|a| columns.iter().map(|b| dot(a, b)).collect()).collect();
    eigenvalues(square).into_iter().rev().take(6).map(|v| libm::sqrt(v.max(0.0))).collect()
}

/// Yoshikawa's manipulability: the product of the singular values.
pub fn manipulability(columns: &[[f64; 6]], size: f64) -> f64 {
    singular_values(columns, size).into_iter().product()
}

/// Condition number: greatest over least singular value, infinite at a singularity.
pub fn condition(columns: &[[f64; 6]], size: f64) -> f64 {
    let all = singular_values(columns, size);
    match (all.first(), all.last()) {
        (Some(most), Some(least)) if *least > most * 1e-8 => most / least,
        _ => f64::INFINITY,
    }
}
