//! Small fixed-size mathematics of poses: vectors, turns, frames and a dense solver. Lengths in mm, angles in rad.

/// A vector.
pub type V3 = [f64; 3];
/// A matrix, rows first.
pub type M3 = [[f64; 3]; 3];

/// Sum of two vectors.
pub fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
/// Difference of two vectors.
pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
/// A vector times a number.
pub fn scale(a: V3, s: f64) -> V3 {
    [a[0] * s, a[1] * s, a[2] * s]
}
/// Scalar product.
pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
/// Vector product.
pub fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
/// Length.
pub fn norm(a: V3) -> f64 {
    libm::sqrt(dot(a, a))
}

/// Position and turn of one frame in another.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Frame {
    /// Turn; its columns are the axes of the frame.
    pub turn: M3,
    /// Origin of the frame, mm.
    pub position: V3,
}

impl Default for Frame {
    fn default() -> Frame {
        Frame::IDENTITY
    }
}

impl Frame {
    /// The same frame.
    pub const IDENTITY: Frame = Frame { turn: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], position: [0.0; 3] };

    /// Shifted only.
    pub fn shift(position: V3) -> Frame {
        Frame { position, ..Frame::IDENTITY }
    }
    /// Turned only.
    pub fn turned(turn: M3) -> Frame {
        Frame { turn, position: [0.0; 3] }
    }
    /// Shifted, then turned about the fixed X, Y and Z, rad.
    pub fn new(position: V3, rotation: V3) -> Frame {
        Frame { turn: euler(rotation), position }
    }
    /// Axis 0 X, 1 Y, 2 Z.
    pub fn axis(&self, i: usize) -> V3 {
        [self.turn[0][i], self.turn[1][i], self.turn[2][i]]
    }
    /// This frame, then the other in it.
    pub fn then(&self, other: &Frame) -> Frame {
        Frame { turn: product(&self.turn, &other.turn), position: self.apply(other.position) }
    }
    /// A point of this frame in the outer one.
    pub fn apply(&self, p: V3) -> V3 {
        add(rotate(&self.turn, p), self.position)
    }
    /// The outer frame seen from this one.
    pub fn inverse(&self) -> Frame {
        let turn = transpose(&self.turn);
        Frame { turn, position: scale(rotate(&turn, self.position), -1.0) }
    }
    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.position.iter().chain(self.turn.iter().flatten()).all(|v| v.is_finite())
    }
    /// Shift and turn (rotation vector, rad) that lead from this frame to another, in the outer frame.
    pub fn error_to(&self, aim: &Frame) -> ([f64; 3], [f64; 3]) {
        let turn = product(&aim.turn, &transpose(&self.turn));
        (sub(aim.position, self.position), rotation_vector(&turn))
    }
}

/// A vector turned.
pub fn rotate(m: &M3, v: V3) -> V3 {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}
/// Product of two matrices.
pub fn product(a: &M3, b: &M3) -> M3 {
    let mut out = [[0.0; 3]; 3];
    for (row, line) in out.iter_mut().zip(a) {
        for (k, slot) in row.iter_mut().enumerate() {
            *slot = line[0] * b[0][k] + line[1] * b[1][k] + line[2] * b[2][k];
        }
    }
    out
}
/// Rows and columns exchanged.
pub fn transpose(m: &M3) -> M3 {
    [[m[0][0], m[1][0], m[2][0]], [m[0][1], m[1][1], m[2][1]], [m[0][2], m[1][2], m[2][2]]]
}
/// Turn about X.
pub fn rot_x(angle: f64) -> M3 {
    let (s, c) = libm::sincos(angle);
    [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
}
/// Turn about Y.
pub fn rot_y(angle: f64) -> M3 {
    let (s, c) = libm::sincos(angle);
    [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
}
/// Turn about Z.
pub fn rot_z(angle: f64) -> M3 {
    let (s, c) = libm::sincos(angle);
    [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
}
/// Turn about a unit vector.
pub fn about(u: V3, angle: f64) -> M3 {
    let (s, c) = libm::sincos(angle);
    let g = 1.0 - c;
    [
        [c + u[0] * u[0] * g, u[0] * u[1] * g - u[2] * s, u[0] * u[2] * g + u[1] * s],
        [u[1] * u[0] * g + u[2] * s, c + u[1] * u[1] * g, u[1] * u[2] * g - u[0] * s],
        [u[2] * u[0] * g - u[1] * s, u[2] * u[1] * g + u[0] * s, c + u[2] * u[2] * g],
    ]
}
/// Turns about the fixed X, then Y, then Z: the meaning of `abc-euler-xyz`.
pub fn euler([a, b, c]: V3) -> M3 {
    product(&rot_z(c), &product(&rot_y(b), &rot_x(a)))
}
/// The turns about the fixed X, Y and Z of a matrix. C is found from what A leaves over, so that the three together
/// stay exact where B comes near ±90°, where A and C alone are not determined.
pub fn euler_of(m: &M3) -> V3 {
    let lean = libm::hypot(m[2][1], m[2][2]);
    let a = if lean < 1e-13 { 0.0 } else { libm::atan2(m[2][1], m[2][2]) };
    let (sa, ca) = libm::sincos(a);
    let b = libm::atan2(-m[2][0], m[2][1] * sa + m[2][2] * ca);
    let c = libm::atan2(sa * m[0][2] - ca * m[0][1], ca * m[1][1] - sa * m[1][2]);
    [a, b, c]
}
/// Axis times angle of a turn, the angle in 0 … π.
pub fn rotation_vector(m: &M3) -> V3 {
    let v = [(m[2][1] - m[1][2]) / 2.0, (m[0][2] - m[2][0]) / 2.0, (m[1][0] - m[0][1]) / 2.0];
    let (s, c) = (norm(v), (m[0][0] + m[1][1] + m[2][2] - 1.0) / 2.0);
    let angle = libm::atan2(s, c);
    if s > 1e-8 || c > 0.0 {
        return if s > 1e-12 { scale(v, angle / s) } else { v };
    }
    // Half a turn: the axis is the longest column of (R + 1) / 2.
    let column = |k: usize| {
        let unit = |i: usize| f64::from(u8::from(i == k));
        [(m[0][k] + unit(0)) / 2.0, (m[1][k] + unit(1)) / 2.0, (m[2][k] + unit(2)) / 2.0]
    };
    let best = (0..3).map(column).max_by(|p, q| norm(*p).total_cmp(&norm(*q))).unwrap_or([1.0, 0.0, 0.0]);
    scale(best, angle / norm(best).max(f64::MIN_POSITIVE))
}

/// Matrix of a unit quaternion, scalar first.
pub fn turn_of([w, x, y, z]: [f64; 4]) -> M3 {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// A turn as unit quaternion, scalar first and never negative.
pub fn quaternion_of(m: &M3) -> [f64; 4] {
    let t = m[0][0] + m[1][1] + m[2][2];
    let q = if t > 0.0 {
        let s = libm::sqrt(t + 1.0) * 2.0;
        [s / 4.0, (m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s]
    } else if m[0][0] >= m[1][1] && m[0][0] >= m[2][2] {
        let s = libm::sqrt(1.0 + m[0][0] - m[1][1] - m[2][2]) * 2.0;
        [(m[2][1] - m[1][2]) / s, s / 4.0, (m[0][1] + m[1][0]) / s, (m[0][2] + m[2][0]) / s]
    } else if m[1][1] >= m[2][2] {
        let s = libm::sqrt(1.0 + m[1][1] - m[0][0] - m[2][2]) * 2.0;
        [(m[0][2] - m[2][0]) / s, (m[0][1] + m[1][0]) / s, s / 4.0, (m[1][2] + m[2][1]) / s]
    } else {
        let s = libm::sqrt(1.0 + m[2][2] - m[0][0] - m[1][1]) * 2.0;
        [(m[1][0] - m[0][1]) / s, (m[0][2] + m[2][0]) / s, (m[1][2] + m[2][1]) / s, s / 4.0]
    };
    let l = libm::sqrt(q.iter().map(|v| v * v).sum());
    // The first part that is not 0 is positive: one turn has one quaternion.
    let negative = q.iter().find(|v| v.abs() > 1e-12).is_some_and(|v| *v < 0.0);
    let sign = if negative { -1.0 } else { 1.0 };
    q.map(|v| v / l * sign + 0.0)
}

/// Solves a dense linear system with row exchange; none when it is singular.
pub fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    for i in 0..n {
        let pivot = (i..n).max_by(|p, q| a[*p][i].abs().total_cmp(&a[*q][i].abs()))?;
        if a[pivot][i].abs() < 1e-300 || !a[pivot][i].is_finite() {
            return None;
        }
        a.swap(i, pivot);
        b.swap(i, pivot);
        for r in i + 1..n {
            let f = a[r][i] / a[i][i];
            for k in i..n {
                a[r][k] -= f * a[i][k];
            }
            b[r] -= f * b[i];
        }
    }
    for i in (0..n).rev() {
        let rest: f64 = (i + 1..n).map(|k| a[i][k] * b[k]).sum();
        b[i] = (b[i] - rest) / a[i][i];
    }
    b.iter().all(|v| v.is_finite()).then_some(b)
}

/// Eigenvalues of a symmetric matrix, by Jacobi's turns, smallest first.
pub fn eigenvalues(mut a: Vec<Vec<f64>>) -> Vec<f64> {
    let n = a.len();
    for _ in 0..64 {
        let off: f64 = (0..n).flat_map(|i| (0..i).map(move |k| (i, k))).map(|(i, k)| a[i][k] * a[i][k]).sum();
        let size: f64 = a.iter().flatten().map(|v| v * v).sum();
        if !(off > size * 1e-32) {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                jacobi_turn(&mut a, p, q);
            }
        }
    }
    let mut out: Vec<f64> = (0..n).map(|i| a[i][i]).collect();
    out.sort_by(f64::total_cmp);
    out
}

/// One turn of Jacobi's method, which makes the element `p`, `q` of a symmetric matrix zero; columns behind its size stay.
pub(crate) fn jacobi_turn<R: AsMut<[f64]>>(a: &mut [R], p: usize, q: usize) {
    let n = a.len();
    let [pp, pq] = [p, q].map(|k| a[p].as_mut()[k]);
    if pq == 0.0 {
        return;
    }
    let theta = (a[q].as_mut()[q] - pp) / (2.0 * pq);
    let t = theta.signum() / (theta.abs() + libm::sqrt(theta * theta + 1.0));
    let c = 1.0 / libm::sqrt(t * t + 1.0);
    let s = t * c;
    for row in a.iter_mut().map(AsMut::as_mut) {
        let (x, y) = (row[p], row[q]);
        (row[p], row[q]) = (c * x - s * y, s * x + c * y);
    }
    for k in 0..n {
        let (x, y) = (a[p].as_mut()[k], a[q].as_mut()[k]);
        a[p].as_mut()[k] = c * x - s * y;
        a[q].as_mut()[k] = s * x + c * y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn eigenvalues_of_a_known_matrix() {
        let found = eigenvalues(vec![vec![2.0, 1.0], vec![1.0, 2.0]]);
        assert!((found[0] - 1.0).abs() < 1e-12 && (found[1] - 3.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn euler_angles_give_their_matrix(a in -3.1f64..3.1, b in prop_oneof![-3.1f64..3.1, Just(std::f64::consts::FRAC_PI_2), Just(1.5707963)], c in -3.1f64..3.1) {
            let m = euler([a, b, c]);
            let back = euler(euler_of(&m));
            for (p, q) in m.iter().flatten().zip(back.iter().flatten()) {
                prop_assert!((p - q).abs() < 1e-12, "{m:?} {back:?}");
            }
        }

        #[test]
        fn quaternions_give_their_matrix_back(angles in prop::array::uniform3(prop_oneof![-3.1f64..3.1, Just(std::f64::consts::PI), Just(std::f64::consts::FRAC_PI_2), Just(1e-9)])) {
            let m = euler(angles);
            let q = quaternion_of(&m);
            prop_assert!(q[0] > -1e-12);
            for (p, r) in m.iter().flatten().zip(turn_of(q).iter().flatten()) {
                prop_assert!((p - r).abs() < 1e-9);
            }
        }

        #[test]
        fn rotation_vectors_give_their_turn(v in prop::array::uniform3(-1.0f64..1.0), angle in prop_oneof![0.0f64..3.14, Just(std::f64::consts::PI), Just(1e-10)]) {
            prop_assume!(norm(v) > 0.1);
            let u = scale(v, 1.0 / norm(v));
            let m = about(u, angle);
            let w = rotation_vector(&m);
            let l = norm(w);
            prop_assert!((l - angle).abs() < 1e-7);
            if l > 1e-9 {
                let back = about(scale(w, 1.0 / l), l);
                for (p, q) in m.iter().flatten().zip(back.iter().flatten()) {
                    prop_assert!((p - q).abs() < 1e-7);
                }
            }
        }

        #[test]
        fn systems_are_solved(a in prop::collection::vec(prop::collection::vec(-9.0f64..9.0, 4), 4), x in prop::collection::vec(-9.0f64..9.0, 4)) {
            let b: Vec<f64> = a.iter().map(|r| r.iter().zip(&x).map(|(p, q)| p * q).sum()).collect();
            if let Some(found) = solve(a.clone(), b.clone()) {
                let size: f64 = found.iter().map(|v| v.abs()).sum::<f64>().max(1.0);
                for (row, want) in a.iter().zip(&b) {
                    let got: f64 = row.iter().zip(&found).map(|(p, q)| p * q).sum();
                    prop_assert!((got - want).abs() < 1e-9 * size);
                }
            }
        }
    }
}
