//! Poses along the moves of the motion IR: all axes, not only the circle.

use gr_ir::geometry::ArcShape;
use gr_ir::{Arc, Pose};

/// An arc worked out: poses at any share of its way, all axes included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// The circle.
    pub shape: ArcShape,
    start: Pose,
    end: Pose,
}

impl Sweep {
    /// Works out an arc.
    pub fn new(start: &Pose, end: &Pose, arc: &Arc) -> Sweep {
        Sweep { shape: ArcShape::new(arc, start, end), start: *start, end: *end }
    }

    /// Angle turned through, rad; > 0 counter-clockwise seen against the normal.
    pub fn angle(&self) -> f64 {
        self.shape.sweep
    }

    /// Radius difference between start and end, mm.
    pub fn mismatch(&self) -> f64 {
        (self.shape.radius - self.shape.end_radius).abs()
    }

    /// The pose at a share 0 … 1 of the way; the ends are exact.
    pub fn at(&self, share: f64) -> Pose {
        if share <= 0.0 {
            return self.start;
        }
        if share >= 1.0 {
            return self.end;
        }
        let mut pose = between(&self.start, &self.end, share);
        pose.axes[..3].copy_from_slice(&self.shape.point(share));
        pose
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
    use gr_ir::{ArcPlane, Plane};

    fn pose(x: f64, y: f64, z: f64) -> Pose {
        Pose::at([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    fn degrees(start: Pose, end: Pose, center: [f64; 3], turns: i32) -> f64 {
        let arc = Arc { plane: ArcPlane::Work(Plane::Xy), center, turns };
        (Sweep::new(&start, &end, &arc).angle().to_degrees() * 1e9).round() / 1e9
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
