use crate::kinematics::{Kinematics, KinematicsError, Solution, checked};
use crate::math::{Frame, V3, add, cross, dot, norm, product, rot_x, rot_y, rot_z, scale, solve, sub};
use crate::opw::turn;

/// Hybrid machine: a platform on three driven legs and a central tube that hangs in a universal joint and can only
/// slide along itself, with a three-axis wrist below. Joints: three leg lengths, three wrist angles.
///
/// The centre of the universal joint is the origin, the base circle lies in the plane z = 0 and the tube points
/// down (−z). The universal joint turns about X, then about the turned Y; tube and platform are one rigid body.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Tricept {
    /// Dimensions.
    pub shape: TriceptShape,
    /// Leg points by the equations 37–39 of the source instead of the rigid platform.
    pub reference: bool,
}

/// Dimensions of a Tricept, mm.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TriceptShape {
    /// Radius of the circle of the base joints.
    pub base_radius: f64,
    /// Radius of the circle of the platform joints.
    pub platform_radius: f64,
    /// From the platform to the centre of the wrist.
    pub wrist_offset: f64,
    /// From the centre of the wrist to the flange.
    pub flange_offset: f64,
    /// Direction of the first base joint from X, rad; the others follow at 120°.
    pub first: f64,
}

impl Tricept {
    fn base(&self, i: usize) -> V3 {
        let (s, c) = libm::sincos(self.shape.first + i as f64 * (2.0 * std::f64::consts::PI / 3.0));
        [self.shape.base_radius * c, self.shape.base_radius * s, 0.0]
    }

    /// Turn of tube and platform, from the two angles of the universal joint.
    fn platform(a: f64, b: f64) -> crate::math::M3 {
        product(&rot_x(a), &rot_y(b))
    }

    /// Leg lengths from the angles of the universal joint and the length of the tube.
    pub fn legs(&self, [a, b, tube]: V3) -> V3 {
        let turn = Tricept::platform(a, b);
        let frame = Frame { turn, position: scale([turn[0][2], turn[1][2], turn[2][2]], -tube) };
        [0, 1, 2].map(|i| {
            let base = self.base(i);
            let ratio = self.shape.platform_radius / self.shape.base_radius;
            let joint = if self.reference {
                let u = scale(frame.axis(2), -1.0);
                let across = sub(base, scale(u, dot(base, u)));
                add(frame.position, scale(across, self.shape.platform_radius / norm(across).max(f64::MIN_POSITIVE)))
            } else {
                frame.apply(scale(base, ratio))
            };
            norm(sub(joint, base))
        })
    }

    /// Every way the platform can hang with these leg lengths, tilted by less than 90°: angles of the universal
    /// joint and tube length, the least tilted first. Found by Newton's steps from many starts.
    pub fn assemblies(&self, legs: V3) -> Vec<V3> {
        let long = legs.iter().sum::<f64>() / 3.0;
        let mut found: Vec<V3> = Vec::new();
        for k in 0..75 {
            let (i, j, l) = (k % 5, k / 5 % 5, k / 25);
            let start = [(i as f64 - 2.0) * 0.5, (j as f64 - 2.0) * 0.5, long * (0.5 + 0.4 * l as f64)];
            if let Some(at) = self.descend(start, legs)
                && !found.iter().any(|f| (0..3).all(|n| (f[n] - at[n]).abs() < 1e-6 * if n == 2 { long } else { 1.0 }))
            {
                found.push(at);
            }
        }
        let tilt = |at: &V3| libm::cos(at[0]) * libm::cos(at[1]);
        found.sort_by(|p, q| tilt(q).total_cmp(&tilt(p)));
        found
    }

    fn descend(&self, mut at: V3, legs: V3) -> Option<V3> {
        const H: f64 = 1e-6;
        let size = legs.iter().fold(1e-9f64, |m, l| m.max(l.abs()));
        for _ in 0..60 {
            let now = self.legs(at);
            let error: Vec<f64> = (0..3).map(|i| legs[i] - now[i]).collect();
            let worst = error.iter().fold(0.0f64, |m, e| m.max(e.abs()));
            if worst <= 4e-15 * size {
                break;
            }
            let mut slope = vec![vec![0.0; 3]; 3];
            for k in 0..3 {
                let h = if k == 2 { H * size } else { H };
                let (mut p, mut q) = (at, at);
                (p[k], q[k]) = (p[k] + h, q[k] - h);
                let (p, q) = (self.legs(p), self.legs(q));
                (0..3).for_each(|i| slope[i][k] = (p[i] - q[i]) / (2.0 * h));
            }
            let step = solve(slope, error)?;
            let most = (step[0].abs().max(step[1].abs()) / 0.5).max(step[2].abs() / (0.5 * size)).max(1.0);
            (0..3).for_each(|k| at[k] += step[k] / most);
        }
        let now = self.legs(at);
        let good = (0..3).all(|i| (legs[i] - now[i]).abs() <= 1e-11 * size)
            && at[2] > 0.0
            && at[0].abs() < std::f64::consts::FRAC_PI_2
            && at[1].abs() < std::f64::consts::FRAC_PI_2;
        good.then_some(at)
    }

    /// The tube with the wrist, then the legs.
    pub(crate) fn figure(&self, flange: &Frame) -> Vec<Vec<V3>> {
        let centre = crate::figure::before(flange, self.shape.flange_offset);
        let far = norm(centre);
        let u = scale(centre, 1.0 / far.max(f64::MIN_POSITIVE));
        let turn = Tricept::platform(libm::atan2(u[1], -u[2]), libm::atan2(-u[0], libm::hypot(u[1], u[2])));
        let platform = Frame { turn, position: scale(u, far - self.shape.wrist_offset) };
        let ratio = self.shape.platform_radius / self.shape.base_radius;
        let mut out = vec![vec![[0.0; 3], platform.position, centre, flange.position]];
        out.extend((0..3).map(|i| vec![self.base(i), platform.apply(scale(self.base(i), ratio)), platform.position]));
        out
    }

    /// The frame of the wrist's first axis: its z points out along the tube.
    fn wrist(&self, [a, b, tube]: V3) -> Frame {
        let turn = product(&Tricept::platform(a, b), &rot_x(std::f64::consts::PI));
        let out = [turn[0][2], turn[1][2], turn[2][2]];
        Frame { turn, position: scale(out, tube + self.shape.wrist_offset) }
    }
}

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

impl Kinematics for Tricept {
    fn joint_count(&self) -> usize {
        6
    }
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        let q = checked(joints, 6)?;
        let all = self.assemblies([q[0], q[1], q[2]]);
        let at = match all[..] {
            [] => return Err(KinematicsError::NoAssembly),
            [at] => at,
            _ => return Err(KinematicsError::Ambiguous { count: all.len() }),
        };
        let wrist = product(&rot_z(q[3] + QUARTER), &product(&rot_y(q[4] - QUARTER), &rot_z(q[5] + 2.0 * QUARTER)));
        let here = self.wrist(at).then(&Frame::turned(wrist));
        Ok(here.then(&Frame::shift([0.0, 0.0, self.shape.flange_offset])))
    }
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        if !frame.is_finite() {
            return Err(KinematicsError::NotFinite);
        }
        let centre = sub(frame.position, scale(frame.axis(2), self.shape.flange_offset));
        let far = norm(centre);
        let tube = far - self.shape.wrist_offset;
        if !(tube > 0.0) || centre[2] >= 0.0 {
            return Err(KinematicsError::OutOfReach { distance: far, reach: (self.shape.wrist_offset, f64::INFINITY) });
        }
        let u = scale(centre, 1.0 / far);
        let at = [libm::atan2(u[1], -u[2]), libm::atan2(-u[0], libm::hypot(u[1], u[2])), tube];
        let legs = self.legs(at);
        if !far.is_finite() || legs.iter().any(|l| !l.is_finite()) {
            return Err(KinematicsError::NotFinite);
        }
        let m = product(&crate::math::transpose(&self.wrist(at).turn), &frame.turn);
        let lean = libm::hypot(m[0][2], m[1][2]);
        let pole = lean <= 1e-12;
        let (k4, s4) = if pole { (1.0, 0.0) } else { (m[0][2] / lean, m[1][2] / lean) };
        let first = libm::atan2(s4, k4);
        let last = libm::atan2(k4 * m[1][0] - s4 * m[0][0], k4 * m[1][1] - s4 * m[0][1]);
        let bend = libm::atan2(lean, m[2][2]);
        let singular = lean <= 1e-6 || ambiguous(self, at);
        let solution = |branch: u8, [a, b, c]: V3| Solution {
            joints: vec![legs[0], legs[1], legs[2], turn(a - QUARTER), turn(b + QUARTER), turn(c - 2.0 * QUARTER)],
            branch,
            singular,
        };
        Ok(vec![
            solution(0, [first, bend, last]),
            solution(1, [first + 2.0 * QUARTER, -bend, last + 2.0 * QUARTER]),
        ])
    }
}

/// Whether the legs leave the platform free: their lines of force with the tube's constraint become dependent.
fn ambiguous(machine: &Tricept, at: V3) -> bool {
    const H: f64 = 1e-6;
    let columns = [0, 1, 2].map(|k| {
        let h = if k == 2 { H * at[2] } else { H };
        let (mut p, mut q) = (at, at);
        (p[k], q[k]) = (p[k] + h, q[k] - h);
        let d = sub(machine.legs(p), machine.legs(q));
        scale(d, 1.0 / norm(d).max(f64::MIN_POSITIVE))
    });
    dot(columns[0], cross(columns[1], columns[2])).abs() < 1e-6
}

