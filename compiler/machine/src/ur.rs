use crate::kinematics::{Kinematics, KinematicsError, Solution, checked};
use crate::math::{Frame, V3, add, cross, dot, norm, scale, sub};
use crate::opw::turn;

/// Six-joint arm whose second, third and fourth axes are parallel and whose wrist is offset (Universal Robots and
/// arms built like them), in closed form with all eight solutions. Lengths are the Denavit–Hartenberg values
/// d1 a2 a3 d4 d5 d6; the twists are 90°, 0, 0, 90°, −90°, 0.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ParallelWrist {
    lengths: [f64; 6],
}

const EDGE: f64 = 1e-12;
const POLE: f64 = 1e-10;

impl ParallelWrist {
    /// With d1 a2 a3 d4 d5 d6, mm.
    pub fn new(lengths: [f64; 6]) -> ParallelWrist {
        ParallelWrist { lengths }
    }
    /// d1 a2 a3 d4 d5 d6, mm.
    pub fn lengths(&self) -> [f64; 6] {
        self.lengths
    }

    fn wrists(&self, frame: &Frame, shoulder: u8, q1: f64, out: &mut Vec<Solution>) {
        let [d1, _, _, d4, d5, d6] = self.lengths;
        let (s1, k1) = libm::sincos(q1);
        // The common direction of the three parallel axes, and the plane they move the arm in.
        let (n, along) = ([s1, -k1, 0.0], [k1, s1, 0.0]);
        let (x6, y6, z6) = (frame.axis(0), frame.axis(1), frame.axis(2));
        let lean = libm::hypot(dot(x6, n), dot(y6, n));
        let pole = lean <= POLE;
        for flip in 0..if pole { 1 } else { 2u8 } {
            let h = if flip == 0 { lean } else { -lean };
            // With the fifth joint at 0 or 180° the sixth is free; it stays at 0.
            let (k6, s6) = if pole { (1.0, 0.0) } else { (dot(x6, n) / h, -dot(y6, n) / h) };
            let q5 = libm::atan2(if pole { 0.0 } else { h }, dot(z6, n));
            let y5 = add(scale(x6, s6), scale(y6, k6));
            let (sum_s, sum_k) = (-dot(y5, along), y5[2]);
            let sum = libm::atan2(sum_s, sum_k);
            let p5 = sub(frame.position, scale(z6, d6));
            let p3 = sub(add(p5, scale(y5, d5)), scale(n, d4));
            let plane = (dot(p3, along), p3[2] - d1);
            self.elbows(shoulder * 4 + flip, [q1, sum, q5, libm::atan2(s6, k6)], plane, pole, out);
        }
    }

    fn elbows(&self, branch: u8, [q1, sum, q5, q6]: [f64; 4], (x, z): (f64, f64), pole: bool, out: &mut Vec<Solution>) {
        let [_, a2, a3, ..] = self.lengths;
        let cos = (x * x + z * z - a2 * a2 - a3 * a3) / (2.0 * a2 * a3);
        if !(cos.abs() <= 1.0 + EDGE) {
            return;
        }
        let cos = cos.clamp(-1.0, 1.0);
        let bend = libm::sqrt((1.0 - cos) * (1.0 + cos));
        for elbow in 0..2u8 {
            let sin = if elbow == 0 { bend } else { -bend };
            let (vx, vz) = (a2 + a3 * cos, a3 * sin);
            if vx * vx + vz * vz < 1e-18 {
                continue;
            }
            let q2 = libm::atan2(vx * z - vz * x, vx * x + vz * z);
            let q3 = libm::atan2(sin, cos);
            let joints = [q1, q2, q3, sum - q2 - q3, q5, q6].map(turn).to_vec();
            if joints.iter().all(|q| q.is_finite()) {
                out.push(Solution { joints, branch: branch + elbow * 2, singular: pole || bend <= 1e-6 });
            }
        }
    }

    /// Points from the base to the flange: shoulder, elbow, and the offsets of the wrist.
    pub(crate) fn figure(&self, q: &[f64], flange: &Frame) -> Vec<V3> {
        let [d1, a2, a3, d4, _, d6] = self.lengths;
        let (s1, k1) = libm::sincos(q[0]);
        let link = |angle: f64, l: f64| {
            let (s, k) = libm::sincos(angle);
            [l * k * k1, l * k * s1, l * s]
        };
        let shoulder = [0.0, 0.0, d1];
        let elbow = add(shoulder, link(q[1], a2));
        let wrist = add(elbow, link(q[1] + q[2], a3));
        let beside = add(wrist, scale([s1, -k1, 0.0], d4));
        vec![[0.0; 3], shoulder, elbow, wrist, beside, crate::figure::before(flange, d6), flange.position]
    }

    /// Whether the solution leads back to the frame; at the pole of the wrist an inexact one can turn up.
    fn holds(&self, s: &Solution, frame: &Frame) -> bool {
        let Ok(back) = self.forward_frame(&s.joints) else { return false };
        let (p, r) = back.error_to(frame);
        norm(p) < 1e-6 && norm(r) < 1e-6
    }
}

impl Kinematics for ParallelWrist {
    fn joint_count(&self) -> usize {
        6
    }
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        let q = checked(joints, 6)?;
        let [d1, a2, a3, d4, d5, d6] = self.lengths;
        let (s1, k1) = libm::sincos(q[0]);
        let (n, along, up) = ([s1, -k1, 0.0], [k1, s1, 0.0], [0.0, 0.0, 1.0]);
        let link = |angle: f64, l: f64| {
            let (s, k) = libm::sincos(angle);
            scale(add(scale(along, k), scale(up, s)), l)
        };
        let (s, k) = libm::sincos(q[1] + q[2] + q[3]);
        let x4 = add(scale(along, k), scale(up, s));
        let z4 = sub(scale(along, s), scale(up, k));
        let (s5, k5) = libm::sincos(q[4]);
        let (x5, z5) = (add(scale(x4, k5), scale(n, s5)), sub(scale(n, k5), scale(x4, s5)));
        let y5 = scale(z4, -1.0);
        let (s6, k6) = libm::sincos(q[5]);
        let x6 = add(scale(x5, k6), scale(y5, s6));
        let y6 = cross(z5, x6);
        let p3 = add([0.0, 0.0, d1], add(link(q[1], a2), link(q[1] + q[2], a3)));
        let position = add(add(p3, scale(n, d4)), add(scale(z4, d5), scale(z5, d6)));
        let row = |i: usize| [x6[i], y6[i], z5[i]];
        Ok(Frame { turn: [row(0), row(1), row(2)], position })
    }
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        if !frame.is_finite() {
            return Err(KinematicsError::NotFinite);
        }
        let [d1, a2, a3, d4, _, d6] = self.lengths;
        let p5 = sub(frame.position, scale(frame.axis(2), d6));
        let far = libm::hypot(p5[0], p5[1]);
        let least = (d4.abs() - far).max(0.0);
        let too_far = |distance| KinematicsError::OutOfReach { distance, reach: ((a2.abs() - a3.abs()).abs(), a2.abs() + a3.abs()) };
        if least > EDGE * d4.abs() {
            // Inside the cylinder about the first axis that the wrist offset leaves out.
            return Err(KinematicsError::OutOfReach { distance: far, reach: (d4.abs(), f64::INFINITY) });
        }
        let across = libm::sqrt((far * far - d4 * d4).max(0.0));
        let (heading, offset) = (libm::atan2(p5[1], p5[0]), libm::atan2(d4, across));
        let mut out = Vec::new();
        self.wrists(frame, 0, turn(heading + offset), &mut out);
        self.wrists(frame, 1, turn(heading + std::f64::consts::PI - offset), &mut out);
        out.retain(|s| self.holds(s, frame));
        let meet = across <= 1e-6 * d4.abs();
        out.iter_mut().for_each(|s| s.singular |= meet);
        out.sort_by_key(|s| s.branch);
        if out.is_empty() { Err(too_far(norm(sub(p5, [0.0, 0.0, d1])))) } else { Ok(out) }
    }
}
