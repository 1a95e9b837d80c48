//! Placements: where a feature, a workpiece or a setup lies.

/// A right-handed orthonormal frame: origin and axes seen from the frame around it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Frame {
    /// Origin, mm.
    pub origin: [f64; 3],
    /// First axis.
    pub x: [f64; 3],
    /// Second axis.
    pub y: [f64; 3],
    /// Third axis; of a feature, out of the material.
    pub z: [f64; 3],
}

impl Default for Frame {
    fn default() -> Frame {
        Frame { origin: [0.0; 3], x: [1.0, 0.0, 0.0], y: [0.0, 1.0, 0.0], z: [0.0, 0.0, 1.0] }
    }
}

/// Scalar product.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
/// Vector product.
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
/// Sum.
pub fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
/// Difference.
pub fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
/// Multiple.
pub fn scale(a: [f64; 3], s: f64) -> [f64; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}
/// Length.
pub fn norm(a: [f64; 3]) -> f64 {
    libm::sqrt(dot(a, a))
}
/// Unit vector; `None` for zero and what is no number.
pub fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let n = norm(a);
    (n.is_finite() && n > 1e-12).then(|| scale(a, 1.0 / n))
}

impl Frame {
    /// From an axis (third) and a reference direction that need not be square to it. `None` where they are
    /// zero or parallel.
    pub fn new(origin: [f64; 3], axis: [f64; 3], reference: [f64; 3]) -> Option<Frame> {
        let z = unit(axis)?;
        let x = unit(sub(reference, scale(z, dot(reference, z))))?;
        Some(Frame { origin, x, y: cross(z, x), z })
    }
    /// A frame moved without turning.
    pub fn at(origin: [f64; 3]) -> Frame {
        Frame { origin, ..Frame::default() }
    }
    /// A point of this frame, seen from the frame around it.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        add(self.origin, self.vector(p))
    }
    /// A direction of this frame, seen from the frame around it.
    pub fn vector(&self, v: [f64; 3]) -> [f64; 3] {
        let turned = add(add(scale(self.x, v[0]), scale(self.y, v[1])), scale(self.z, v[2]));
        turned.map(|c| c + 0.0)
    }
    /// A point of the frame around it, seen from this frame.
    pub fn inverse_point(&self, p: [f64; 3]) -> [f64; 3] {
        self.inverse_vector(sub(p, self.origin))
    }
    /// A direction of the frame around it, seen from this frame.
    pub fn inverse_vector(&self, d: [f64; 3]) -> [f64; 3] {
        [dot(d, self.x), dot(d, self.y), dot(d, self.z)]
    }
    /// `inner` lies in this frame: the same placement seen from around.
    pub fn place(&self, inner: &Frame) -> Frame {
        Frame {
            origin: self.point(inner.origin),
            x: self.vector(inner.x),
            y: self.vector(inner.y),
            z: self.vector(inner.z),
        }
    }
    /// Whether its third axis is the one around it: the tool stands along Z.
    pub fn upright(&self) -> bool {
        self.z[2] > 1.0 - 1e-9
    }
    /// Turned about its own third axis.
    pub fn turned(&self, angle: f64) -> Frame {
        let (s, c) = (libm::sin(angle), libm::cos(angle));
        Frame {
            origin: self.origin,
            x: add(scale(self.x, c), scale(self.y, s)),
            y: sub(scale(self.y, c), scale(self.x, s)),
            z: self.z,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn there_and_back(o in prop::array::uniform3(-1e3..1e3f64), z in prop::array::uniform3(-1.0..1.0f64),
                          x in prop::array::uniform3(-1.0..1.0f64), p in prop::array::uniform3(-1e3..1e3f64)) {
            let Some(f) = Frame::new(o, z, x) else { return Ok(()) };
            let back = f.inverse_point(f.point(p));
            for i in 0..3 {
                prop_assert!((back[i] - p[i]).abs() < 1e-6);
            }
            prop_assert!((dot(f.x, f.y)).abs() < 1e-9 && (norm(f.y) - 1.0).abs() < 1e-9);
        }
    }
}
