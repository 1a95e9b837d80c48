//! How small deviations of joints and geometry move the tool of a 2UPS+PRP machine, in closed form (E. E. R. Gojtan,
//! EPUSP 2009, equations 5.5 to 7.3; half derivatives of the squared leg lengths). The thesis takes yaw before arm
//! length; here the order is arm length, yaw, height, as in [`TwoLegs`].

use super::TwoLegs;
use crate::math::V3;

/// Yaw, arm length, height: the order of the thesis.
type Cylinder = [f64; 3];

impl TwoLegs {
    /// The thesis' J_p: rows are the two legs and the column, columns yaw, arm length and height.
    pub fn pose_matrix(&self, at: V3) -> [[f64; 3]; 3] {
        let row = |i: usize| {
            let [yaw, arm] = self.slopes(i, at);
            [yaw, arm, self.leg(i, at)[2]]
        };
        [row(0), row(1), [0.0, 0.0, 1.0]]
    }

    /// Change of yaw, arm length and height by a right-hand side of the three rows; none at a singularity.
    fn solved(&self, at: V3, b: [f64; 3]) -> Option<Cylinder> {
        let [r1, r2, _] = self.pose_matrix(at);
        let det = r1[0] * r2[1] - r1[1] * r2[0];
        let (b1, b2) = (b[0] - r1[2] * b[2], b[1] - r2[2] * b[2]);
        let out = [(b1 * r2[1] - r1[1] * b2) / det, (r1[0] * b2 - b1 * r2[0]) / det, b[2]];
        out.iter().all(|v| v.is_finite()).then_some(out)
    }

    /// Change of yaw, arm length and height by small changes of the three joints.
    pub fn by_joints(&self, at: V3, joints: [f64; 3]) -> Option<Cylinder> {
        let h = self.lengths(at);
        self.solved(at, [h[0] * joints[0], h[1] * joints[1], joints[2]])
    }

    /// Change of yaw, arm length and height per unit of each of the twelve lengths, in the order of
    /// [`crate::Machine::parameters`].
    pub fn by_parameters(&self, at: V3) -> Option<[Cylinder; 12]> {
        let (s, c) = libm::sincos(at[1]);
        let mut out = [[0.0; 3]; 12];
        for i in 0..2 {
            let v = self.leg(i, at);
            let along = [v[0] * c + v[1] * s, -v[0] * s + v[1] * c, v[2]];
            for k in 0..3 {
                let mut b = [0.0; 3];
                b[i] = -along[k];
                out[3 * i + k] = self.solved(at, b)?;
                b[i] = v[k];
                out[6 + 3 * i + k] = self.solved(at, b)?;
            }
        }
        Some(out)
    }

    /// The displacement of the tool, mm, by a change of yaw, arm length and height (equation 6.3: not linearised).
    pub fn displacement(&self, [arm, yaw, _]: V3, [turn, longer, up]: Cylinder) -> V3 {
        let (s, c) = libm::sincos(yaw);
        let (s2, c2) = libm::sincos(yaw + turn);
        [(arm + longer) * c2 - arm * c, (arm + longer) * s2 - arm * s, up]
    }

    /// The same to first order, as a velocity: mm, then rad.
    fn column(&self, [arm, yaw, _]: V3, [turn, longer, up]: Cylinder) -> [f64; 6] {
        let (s, c) = libm::sincos(yaw);
        [longer * c - arm * s * turn, longer * s + arm * c * turn, up, 0.0, 0.0, turn]
    }

    /// Arm length, yaw and height that these joint values mean.
    pub fn place(&self, joints: V3) -> Option<V3> {
        let all = self.assemblies(joints);
        all.iter().copied().find(|at| self.inside(*at)).or(all.first().copied())
    }

    /// Arm length, yaw and height of a point of the tool.
    pub fn place_of(&self, [x, y, z]: V3) -> V3 {
        [libm::hypot(x, y), libm::atan2(y, x), z]
    }

    /// Velocity of the tool (mm, then rad) per unit of each joint.
    pub fn joint_columns_at(&self, at: V3) -> Option<[[f64; 6]; 3]> {
        let mut out = [[0.0; 6]; 3];
        for (i, column) in out.iter_mut().enumerate() {
            let mut unit = [0.0; 3];
            unit[i] = 1.0;
            *column = self.column(at, self.by_joints(at, unit)?);
        }
        Some(out)
    }

    /// Movement of the tool (mm, then rad) per unit of each length.
    pub fn parameter_columns_at(&self, at: V3) -> Option<[[f64; 6]; 12]> {
        Some(self.by_parameters(at)?.map(|d| self.column(at, d)))
    }

    pub(crate) fn joint_columns(&self, joints: V3) -> Option<Vec<[f64; 6]>> {
        Some(self.joint_columns_at(self.place(joints)?)?.to_vec())
    }

    pub(crate) fn parameter_columns(&self, joints: V3) -> Option<Vec<[f64; 6]>> {
        Some(self.parameter_columns_at(self.place(joints)?)?.to_vec())
    }
}
