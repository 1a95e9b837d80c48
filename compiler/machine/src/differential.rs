//! Velocities and how near a singularity they are, for any machine.

use crate::kinematics::{Kinematics, KinematicsError};
use crate::math::{eigenvalues, rotation_vector, scale, sub, transpose, product};

/// Velocity of the tool (mm, then rad) per unit of each joint, by central differences: one column per joint.
pub fn jacobian(machine: &dyn Kinematics, joints: &[f64]) -> Result<Vec<[f64; 6]>, KinematicsError> {
    let column = |i: usize| {
        // Lengths are some hundred mm, angles some rad: both steps keep about ten digits.
        let h = 1e-5 * joints[i].abs().max(1.0);
        let (mut p, mut q) = (joints.to_vec(), joints.to_vec());
        (p[i], q[i]) = (joints[i] + h, joints[i] - h);
        let (p, q, h) = (machine.forward_frame(&p)?, machine.forward_frame(&q)?, h * 2.0);
        let v = scale(sub(p.position, q.position), 1.0 / h);
        let w = scale(rotation_vector(&product(&p.turn, &transpose(&q.turn))), 1.0 / h);
        Ok([v[0], v[1], v[2], w[0], w[1], w[2]])
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
