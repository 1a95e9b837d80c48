//! Velocities and how near a singularity they are, for any machine.

use crate::kinematics::{Kinematics, KinematicsError, checked};
use crate::math::{
    Frame, V3, cross, eigenvalues, jacobi_turn, product, rot_z, rotate, rotation_vector, scale, solve, sub, transpose,
};
use crate::{Chain, Joint, JointKind, Machine, Opw};

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
        Chain::Planar3r(links) => {
            let &[a, b, c] = checked(joints, 3)? else { return Err(KinematicsError::NotFinite) };
            Ok(flat(&[(a, links[0]), (b, links[1]), (c, links[2])]))
        }
        Chain::Scara(k) => {
            let &[a, b, _, _] = checked(joints, 4)? else { return Err(KinematicsError::NotFinite) };
            let [l1, l2, _] = k.lengths();
            let mut out = flat(&[(a, l1), (b, l2)]);
            out.extend([[0.0, 0.0, -1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, -1.0]]);
            Ok(out)
        }
        Chain::Tricept(_) => by_inverse(&*machine.kinematics(), joints),
        _ => jacobian(&*machine.kinematics(), joints),
    }
}

/// Velocity of the end of links in the XY plane, each with its angle from the one before and its length.
fn flat(links: &[(f64, f64)]) -> Vec<[f64; 6]> {
    let mut starts = Vec::with_capacity(links.len());
    let (mut at, mut direction) = ([0.0, 0.0], 0.0);
    for (angle, length) in links {
        starts.push(at);
        direction += angle;
        let (s, c) = libm::sincos(direction);
        at = [at[0] + length * c, at[1] + length * s];
    }
    starts.into_iter().map(|[x, y]| [-(at[1] - y), at[0] - x, 0.0, 0.0, 0.0, 1.0]).collect()
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

/// Least over greatest singular value of a Jacobian, a way or a stroke of `size` mm counted as a radian: 0 where the tool
/// can't go some way that its joints suffice for, 1 where all ways are alike. Of more than twelve joints the rest is left out.
pub fn evenness(joints: &[Joint], columns: &[[f64; 6]], size: f64) -> f64 {
    const MOST: usize = 12;
    let n = columns.len().min(MOST);
    // The smaller of JᵀJ and JJᵀ: the rest of the other's eigenvalues are 0 and mean nothing.
    let small = n.min(6);
    let scaled = |c: &[f64; 6], unit: f64| [c[0] / size, c[1] / size, c[2] / size, c[3], c[4], c[5]].map(|v| v * unit);
    let unit = |i: usize| if joints.get(i).is_some_and(|j| j.kind == JointKind::Prismatic) { size } else { 1.0 };
    let mut j = [[0.0; 6]; MOST];
    j.iter_mut().zip(columns).enumerate().for_each(|(i, (to, from))| *to = scaled(from, unit(i)));
    let mut square = [[0.0; 6]; 6];
    for (a, row) in square.iter_mut().enumerate().take(small) {
        for (b, cell) in row.iter_mut().enumerate().take(small) {
            *cell = if n <= 6 { (0..6).map(|k| j[a][k] * j[b][k]).sum() } else { j[..n].iter().map(|c| c[a] * c[b]).sum() };
        }
    }
    let (least, most) = extremes(square, small);
    if most > 0.0 { libm::sqrt((least / most).max(0.0)) } else { 0.0 }
}

/// Least and greatest eigenvalue of the first rows of a symmetric matrix, by Jacobi's turns, without a heap.
fn extremes(mut a: [[f64; 6]; 6], n: usize) -> (f64, f64) {
    for _ in 0..32 {
        let off: f64 = (0..n).flat_map(|i| (0..i).map(move |k| (i, k))).map(|(i, k)| a[i][k] * a[i][k]).sum();
        let size: f64 = (0..n).map(|i| a[i][i] * a[i][i]).sum();
        if !(off > size * 1e-24) {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                jacobi_turn(&mut a[..n], p, q);
            }
        }
    }
    (0..n).map(|i| a[i][i]).fold((f64::INFINITY, 0.0), |(l, m), v| (l.min(v), m.max(v)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{builtin, math::rot_x};

    fn at(id: &str, joints: &[f64], size: f64) -> f64 {
        let m = builtin(id).unwrap();
        evenness(&m.joints, &velocity(&m, joints).unwrap(), size)
    }

    /// A stretched elbow, a straight wrist, a wrist over the first axis: none is hidden by the others.
    #[test]
    fn singular_places_are_seen() {
        assert!(at("adept/one", &[0.3, 0.0, 100.0, 0.2], 800.0) < 1e-6);
        assert!(at("adept/one", &[0.3, 1.2, 100.0, 0.2], 800.0) > 0.05);
        let arm = [0.3, -0.2, 0.4, 0.5, 0.6, 0.1];
        assert!(at("abb/irb2400", &arm, 1500.0) > 0.01);
        assert!(at("abb/irb2400", &[0.3, -0.2, 0.4, 0.5, 0.0, 0.1], 1500.0) < 1e-6);
        // Its size in other units changes nothing.
        let m = builtin("abb/irb2400").unwrap();
        let columns = velocity(&m, &arm).unwrap();
        let metres: Vec<[f64; 6]> = columns.iter().map(|c| [c[0] / 1e3, c[1] / 1e3, c[2] / 1e3, c[3], c[4], c[5]]).collect();
        assert!((evenness(&m.joints, &columns, 1500.0) - evenness(&m.joints, &metres, 1.5)).abs() < 1e-9);
    }

    #[test]
    fn even_is_one() {
        let turn = rot_x(0.4);
        let columns: Vec<[f64; 6]> = (0..3).map(|i| [turn[0][i], turn[1][i], turn[2][i], 0.0, 0.0, 0.0]).collect();
        assert!((evenness(&[], &columns, 1.0) - 1.0).abs() < 1e-12);
        assert_eq!(evenness(&[], &[], 1.0), 0.0);
    }
}
