//! How makers write the turn of a tool: the conventions as pure mathematics. Angles in rad.
//!
//! Where a convention has a pole only a sum or difference of two angles is determined; the one that is free is kept
//! from the point before.

use gr_machine::math::{Frame, M3, rotation_vector, transpose, turn_of};

/// Below this sine the pole is reached: 2·10⁻⁶ degrees, less than anything a program is written with.
const POLE: f64 = 4e-8;

/// Half a turn is written as 180°, not −180°.
fn half(angle: f64) -> f64 {
    if angle + std::f64::consts::PI < 1e-9 { std::f64::consts::PI } else { angle }
}

/// Turns about the fixed X, Y, Z: R = Rz(c)·Ry(b)·Rx(a); at the pole `a` is that of the point before.
pub(crate) fn fixed_xyz(m: &M3, before: [f64; 3]) -> [f64; 3] {
    let lean = libm::hypot(m[2][1], m[2][2]);
    let a = if lean < POLE { before[0] } else { libm::atan2(m[2][1], m[2][2]) };
    let (sa, ca) = libm::sincos(a);
    let b = libm::atan2(-m[2][0], m[2][1] * sa + m[2][2] * ca);
    let c = libm::atan2(sa * m[0][2] - ca * m[0][1], ca * m[1][1] - sa * m[1][2]);
    [a, b, c].map(half)
}

/// R = Rx(rx)·Ry(ry)·Rz(rz); at the pole rx is that of the point before.
pub(crate) fn moving_xyz(m: &M3, before: [f64; 3]) -> [f64; 3] {
    fixed_xyz(&transpose(m), before.map(|v| -v)).map(|v| half(-v))
}

/// R = Rz(o)·Ry(a)·Rz(t); at the pole o is that of the point before.
pub(crate) fn zyz(m: &M3, before: [f64; 3]) -> [f64; 3] {
    let lean = libm::hypot(m[0][2], m[1][2]);
    let o = if lean < POLE { before[0] } else { libm::atan2(m[1][2], m[0][2]) };
    let (s, c) = libm::sincos(o);
    let a = libm::atan2(if lean < POLE { 0.0 } else { c * m[0][2] + s * m[1][2] }, m[2][2]);
    let t = libm::atan2(c * m[1][0] - s * m[0][0], c * m[1][1] - s * m[0][1]);
    [o, a, t].map(half)
}

/// Axis times angle.
pub(crate) fn vector(m: &M3) -> [f64; 3] {
    rotation_vector(m)
}

/// A pose as a frame.
pub(crate) fn frame(position: [f64; 3], quaternion: &[f64; 4]) -> Frame {
    Frame { turn: turn_of(*quaternion), position }
}

/// Shortest turn between two unit quaternions, at a share of the way.
pub(crate) fn between(p: &[f64; 4], q: &[f64; 4], share: f64) -> [f64; 4] {
    let dot: f64 = p.iter().zip(q).map(|(a, b)| a * b).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let angle = libm::acos(dot.abs().min(1.0));
    let (u, v) = if angle < 1e-9 {
        (1.0 - share, share)
    } else {
        let s = libm::sin(angle);
        (libm::sin((1.0 - share) * angle) / s, libm::sin(share * angle) / s)
    };
    let mut out = [0.0; 4];
    for (o, (a, b)) in out.iter_mut().zip(p.iter().zip(q)) {
        *o = u * a + v * sign * b;
    }
    let length = libm::sqrt(out.iter().map(|v| v * v).sum::<f64>());
    let sign = if out[0] < 0.0 { -1.0 } else { 1.0 };
    out.map(|v| v * sign / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gr_machine::math::{product, rot_x, rot_y, rot_z};
    use proptest::prelude::*;

    fn near(a: &M3, b: &M3) -> bool {
        a.iter().flatten().zip(b.iter().flatten()).all(|(p, q)| (p - q).abs() < 3e-7)
    }

    fn turns() -> impl Strategy<Value = [f64; 3]> {
        let half = std::f64::consts::FRAC_PI_2;
        let angle = move || prop_oneof![-3.1f64..3.1, Just(0.0), Just(half), Just(-half), Just(2.0 * half), Just(1e-9)];
        [angle(), angle(), angle()]
    }

    proptest! {
        #[test]
        fn angles_give_their_matrix_back([x, y, z] in turns(), before in turns()) {
            let m = product(&rot_z(z), &product(&rot_y(y), &rot_x(x)));
            let [a, b, c] = fixed_xyz(&m, before);
            prop_assert!(near(&m, &product(&rot_z(c), &product(&rot_y(b), &rot_x(a)))));
            let [a, b, c] = moving_xyz(&m, before);
            prop_assert!(near(&m, &product(&rot_x(a), &product(&rot_y(b), &rot_z(c)))));
            let [o, a, t] = zyz(&m, before);
            prop_assert!(near(&m, &product(&rot_z(o), &product(&rot_y(a), &rot_z(t)))));
        }
    }

    #[test]
    fn the_free_angle_stays_at_a_pole() {
        // Tool straight down, turned by 30° about its axis: R = Rx(180°)·Rz(30°).
        let m = product(&rot_x(std::f64::consts::PI), &rot_z(0.5));
        let [o, a, t] = zyz(&m, [1.25, 0.0, 0.0]);
        assert_eq!(o, 1.25);
        assert!((a - std::f64::consts::PI).abs() < 1e-9);
        assert!(near(&m, &product(&rot_z(o), &product(&rot_y(a), &rot_z(t)))));
    }
}
