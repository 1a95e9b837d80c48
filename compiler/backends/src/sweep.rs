//! The circle under an arc or helix of the motion IR: radii, angle, and points on it.

use gr_ir::{Arc, ArcPlane, Plane, Pose};

/// An arc worked out: points at any share of its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    center: [f64; 3],
    first: [f64; 3],
    second: [f64; 3],
    normal: [f64; 3],
    /// Radius at the start, mm.
    pub start_radius: f64,
    /// Radius at the end, mm.
    pub end_radius: f64,
    /// Angle turned through, rad; > 0 counter-clockwise seen against the normal.
    pub angle: f64,
    /// Way along the normal, mm.
    pub rise: f64,
    start: Pose,
    end: Pose,
}

/// A cross B.
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `v` without its part along the unit vector `n`.
fn flat(v: [f64; 3], n: [f64; 3]) -> [f64; 3] {
    let along = dot(v, n);
    [v[0] - along * n[0], v[1] - along * n[1], v[2] - along * n[2]]
}

/// The unit normal of a plane.
pub fn normal(plane: ArcPlane) -> [f64; 3] {
    match plane {
        ArcPlane::Free(n) => n,
        ArcPlane::Work(Plane::Xy | Plane::Uv) => [0.0, 0.0, 1.0],
        ArcPlane::Work(Plane::Xz | Plane::Uw) => [0.0, 1.0, 0.0],
        ArcPlane::Work(Plane::Yz | Plane::Vw) => [1.0, 0.0, 0.0],
    }
}

impl Sweep {
    /// Works out an arc. An end in the start's direction is a full turn.
    pub fn new(start: &Pose, end: &Pose, arc: &Arc) -> Sweep {
        let n = normal(arc.plane);
        let (from, to) = (flat(minus(start.xyz(), arc.center), n), flat(minus(end.xyz(), arc.center), n));
        let (r0, r1) = (libm::sqrt(dot(from, from)), libm::sqrt(dot(to, to)));
        let first = if r0 > 0.0 { from.map(|v| v / r0) } else { [0.0; 3] };
        let second = cross(n, first);
        let mut angle = libm::atan2(dot(to, second), dot(to, first));
        let turn = 2.0 * std::f64::consts::PI;
        // Rounding must not make a full circle of nothing, nor nothing of a full circle.
        let close = if r0 > 0.0 { 1e-12_f64.max(1e-9 / r0) } else { 1e-12 };
        if arc.turns > 0 {
            if angle <= close {
                angle += turn;
            }
            angle += turn * f64::from(arc.turns - 1);
        } else {
            if angle >= -close {
                angle -= turn;
            }
            angle -= turn * f64::from(-(arc.turns.min(-1)) - 1);
        }
        let rise = dot(minus(end.xyz(), start.xyz()), n);
        let center = arc.center;
        Sweep { center, first, second, normal: n, start_radius: r0, end_radius: r1, angle, rise, start: *start, end: *end }
    }

    /// Length of the way, mm (of the mean radius where the two differ).
    pub fn length(&self) -> f64 {
        let circle = self.angle.abs() * 0.5 * (self.start_radius + self.end_radius);
        libm::hypot(circle, self.rise)
    }

    /// The pose at a share 0 … 1 of the way; the ends are exact.
    pub fn at(&self, share: f64) -> Pose {
        if share <= 0.0 {
            return self.start;
        }
        if share >= 1.0 {
            return self.end;
        }
        let radius = self.start_radius + (self.end_radius - self.start_radius) * share;
        let (sin, cos) = libm::sincos(self.angle * share);
        let height = dot(minus(self.start.xyz(), self.center), self.normal) + self.rise * share;
        let mut pose = between(&self.start, &self.end, share);
        for i in 0..3 {
            pose.axes[i] = self.center[i]
                + radius * (cos * self.first[i] + sin * self.second[i])
                + height * self.normal[i];
        }
        pose
    }

    /// How many straight pieces stay within `tolerance` of the arc.
    pub fn pieces(&self, tolerance: f64) -> usize {
        let radius = self.start_radius.max(self.end_radius);
        let share = 1.0 - (tolerance / radius).clamp(1e-9, 1.0);
        let step = 2.0 * libm::acos(share);
        libm::ceil(self.angle.abs() / step.max(1e-5)).clamp(1.0, 1e7) as usize
    }
}

/// The pose at a share of a straight way: every axis in proportion.
pub fn between(start: &Pose, end: &Pose, share: f64) -> Pose {
    let mut pose = *end;
    for (v, s) in pose.axes.iter_mut().zip(&start.axes) {
        *v = s + (*v - s) * share;
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: f64, y: f64, z: f64) -> Pose {
        Pose::at([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    fn degrees(start: Pose, end: Pose, center: [f64; 3], turns: i32) -> f64 {
        let arc = Arc { plane: ArcPlane::Work(Plane::Xy), center, turns };
        (Sweep::new(&start, &end, &arc).angle.to_degrees() * 1e9).round() / 1e9
    }

    #[test]
    fn angles() {
        let (a, b) = (pose(0.0, 0.0, 0.0), pose(50.0, 50.0, 0.0));
        assert_eq!(degrees(a, b, [50.0, 0.0, 0.0], -1), -90.0);
        assert_eq!(degrees(a, b, [50.0, 0.0, 0.0], 1), 270.0);
        assert_eq!(degrees(a, b, [50.0, 0.0, 0.0], 2), 630.0);
        assert_eq!(degrees(a, a, [50.0, 0.0, 0.0], 1), 360.0);
        assert_eq!(degrees(a, a, [50.0, 0.0, 0.0], -3), -1080.0);
    }

    #[test]
    fn points_of_a_helix() {
        let arc = Arc { plane: ArcPlane::Work(Plane::Xy), center: [0.0; 3], turns: 1 };
        let sweep = Sweep::new(&pose(10.0, 0.0, 0.0), &pose(0.0, 10.0, 6.0), &arc);
        let p = sweep.at(1.0 / 3.0).xyz();
        assert!((p[0] - 10.0 * (30.0_f64).to_radians().cos()).abs() < 1e-12);
        assert!((p[1] - 5.0).abs() < 1e-12 && (p[2] - 2.0).abs() < 1e-12);
    }
}
