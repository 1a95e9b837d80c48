//! Points and vectors of the turning plane.

/// A point or vector: Z, X.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(crate) struct Zx {
    pub z: f64,
    pub x: f64,
}

/// A quarter turn.
pub(super) const QUARTER: Zx = Zx { z: 0.0, x: 1.0 };

impl Zx {
    pub(crate) fn new(z: f64, x: f64) -> Zx {
        Zx { z, x }
    }
    pub(super) fn len(self) -> f64 {
        length(self.z, self.x)
    }
    pub(super) fn square(self) -> f64 {
        self.z * self.z + self.x * self.x
    }
    pub(super) fn mirror(self) -> Zx {
        Zx::new(self.z, -self.x)
    }
    pub(super) fn scaled(self, f: f64) -> Zx {
        Zx::new(self.z * f, self.x * f)
    }
    pub(super) fn over(self, f: f64) -> Zx {
        Zx::new(self.z / f, self.x / f)
    }
    /// Undoes the turn (and scale) of `b`: Smith's division of complex numbers (1962), whose rounding decides
    /// whether a pass that runs along the axis counts as level.
    pub(super) fn unturned(self, b: Zx) -> Zx {
        if b.z.abs() < b.x.abs() {
            let ratio = b.z / b.x;
            let d = b.z * ratio + b.x;
            return Zx::new((self.z * ratio + self.x) / d, (self.x * ratio - self.z) / d);
        }
        let ratio = b.x / b.z;
        let d = b.x * ratio + b.z;
        if ratio.abs() > f64::MIN_POSITIVE {
            return Zx::new((self.x * ratio + self.z) / d, (self.x - self.z * ratio) / d);
        }
        Zx::new((self.z + b.x * (self.x / b.z)) / d, (self.x - b.x * (self.z / b.z)) / d)
    }
    pub(super) fn middle(self, b: Zx) -> Zx {
        (self + b).over(2.0)
    }
}

/// Hypotenuse with one correction step, rounded right in all but rare cases (Borges, "An improved algorithm for
/// hypot(a,b)", 2019).
pub(super) fn length(a: f64, b: f64) -> f64 {
    let (small, large) = min_max(a.abs(), b.abs());
    if large == 0.0 || small <= large * (f64::EPSILON / 2.0) || !large.is_finite() {
        return large + small;
    }
    let h = (large * large + small * small).sqrt();
    let (t1, t2) = if h <= 2.0 * small {
        let delta = h - small;
        (large * (2.0 * delta - large), (delta - 2.0 * (large - small)) * delta)
    } else {
        let delta = h - large;
        (2.0 * delta * (large - 2.0 * small), (4.0 * delta - small) * small + delta * delta)
    };
    h - (t1 + t2) / (2.0 * h)
}

impl std::ops::Add for Zx {
    type Output = Zx;
    fn add(self, b: Zx) -> Zx {
        Zx::new(self.z + b.z, self.x + b.x)
    }
}
impl std::ops::Sub for Zx {
    type Output = Zx;
    fn sub(self, b: Zx) -> Zx {
        Zx::new(self.z - b.z, self.x - b.x)
    }
}
impl std::ops::Neg for Zx {
    type Output = Zx;
    fn neg(self) -> Zx {
        Zx::new(-self.z, -self.x)
    }
}
/// Turns (and scales), as complex numbers do.
impl std::ops::Mul for Zx {
    type Output = Zx;
    fn mul(self, b: Zx) -> Zx {
        Zx::new(self.z * b.z - self.x * b.x, self.z * b.x + self.x * b.z)
    }
}

pub(super) fn min_max(a: f64, b: f64) -> (f64, f64) {
    if b < a { (b, a) } else { (a, b) }
}
