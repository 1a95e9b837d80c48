use crate::kinematics::{Kinematics, KinematicsError, Solution, checked};
use crate::math::{Frame, product, rot_x, rot_z};
use crate::opw::turn;

/// Four-joint arm: two parallel turning joints, a vertical stroke and a turning wrist; the tool points down.
/// Joints q1 q2 d q4: x y of the two links, z = height − d, direction Rz(q1 + q2)·Rx(180°)·Rz(q4).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Scara {
    links: [f64; 2],
    height: f64,
}

impl Scara {
    /// With the two links and the height of the tool at stroke 0, mm.
    pub fn new(links: [f64; 2], height: f64) -> Scara {
        Scara { links, height }
    }
    /// The two links and the height of the tool at stroke 0, mm.
    pub fn lengths(&self) -> [f64; 3] {
        [self.links[0], self.links[1], self.height]
    }
}

/// How far the tool axis may lean from straight down, by rounding.
const LEAN: f64 = 1e-9;

impl Kinematics for Scara {
    fn joint_count(&self) -> usize {
        4
    }
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        let q = checked(joints, 4)?;
        let [l1, l2] = self.links;
        let ((s1, k1), (s2, k2)) = (libm::sincos(q[0]), libm::sincos(q[0] + q[1]));
        let turn = product(&rot_z(q[0] + q[1]), &product(&rot_x(std::f64::consts::PI), &rot_z(q[3])));
        Ok(Frame { turn, position: [l1 * k1 + l2 * k2, l1 * s1 + l2 * s2, self.height - q[2]] })
    }
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        if !frame.is_finite() {
            return Err(KinematicsError::NotFinite);
        }
        if frame.turn[0][2].abs() > LEAN || frame.turn[1][2].abs() > LEAN || frame.turn[2][2] > 0.0 {
            return Err(KinematicsError::Direction);
        }
        let [x, y, z] = frame.position;
        let [l1, l2] = self.links;
        let distance = libm::hypot(x, y);
        let cos = (x * x + y * y - l1 * l1 - l2 * l2) / (2.0 * l1 * l2);
        if !(cos.abs() <= 1.0 + 1e-12) {
            return Err(KinematicsError::OutOfReach { distance, reach: ((l1 - l2).abs(), l1 + l2) });
        }
        if distance <= 1e-9 {
            return Err(KinematicsError::Singular);
        }
        let cos = cos.clamp(-1.0, 1.0);
        let bend = libm::sqrt((1.0 - cos) * (1.0 + cos));
        // Rz(s)·Rx(180°)·Rz(q4) has the first column (cos(s − q4), sin(s − q4), 0).
        let heading = libm::atan2(frame.turn[1][0], frame.turn[0][0]);
        let solution = |branch: u8, sin: f64| {
            let (vx, vy) = (l1 + l2 * cos, l2 * sin);
            let (q1, q2) = (libm::atan2(vx * y - vy * x, vx * x + vy * y), libm::atan2(sin, cos));
            let joints = vec![q1, q2, self.height - z, turn(q1 + q2 - heading)];
            Solution { joints, branch, singular: bend <= 1e-6 }
        };
        Ok(if bend == 0.0 { vec![solution(0, 0.0)] } else { vec![solution(0, bend), solution(1, -bend)] })
    }
}
