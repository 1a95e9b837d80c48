//! Points and single segments: lines and circular arcs with everything that can be said of one alone. Nothing here
//! knows of curves made of several.

use core::f64::consts::{PI, TAU};

/// Two things nearer than this are one (mm).
pub(crate) const TOL: f64 = 1e-7;

/// A point or vector in the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct P2 {
    /// mm
    pub x: f64,
    /// mm
    pub y: f64,
}

impl P2 {
    /// The point (x, y).
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }
    /// The unit vector at this angle from +x.
    pub fn polar(angle: f64) -> Self {
        Self::new(libm::cos(angle), libm::sin(angle))
    }
    /// Scalar product.
    pub fn dot(self, o: Self) -> f64 {
        self.x * o.x + self.y * o.y
    }
    /// z of the vector product: positive if `o` is to the left.
    pub fn cross(self, o: Self) -> f64 {
        self.x * o.y - self.y * o.x
    }
    /// Length.
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }
    /// Distance.
    pub fn dist(self, o: Self) -> f64 {
        (self - o).norm()
    }
    /// A quarter turn to the left.
    pub fn left(self) -> Self {
        Self::new(-self.y, self.x)
    }
    /// Angle from +x, −π…π.
    pub fn angle(self) -> f64 {
        libm::atan2(self.y, self.x)
    }
    /// Turned about the origin.
    pub fn rotated(self, angle: f64) -> Self {
        let (s, c) = libm::sincos(angle);
        Self::new(self.x * c - self.y * s, self.x * s + self.y * c)
    }
    /// Length 1, or (1, 0) if it has none.
    pub fn unit(self) -> Self {
        let n = self.norm();
        if n > 0.0 { self * (1.0 / n) } else { Self::new(1.0, 0.0) }
    }
    /// The point between, t = 0…1.
    pub fn lerp(self, o: Self, t: f64) -> Self {
        self + (o - self) * t
    }
    pub(crate) fn finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }
}

impl core::ops::Add for P2 {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y)
    }
}
impl core::ops::Sub for P2 {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y)
    }
}
impl core::ops::Mul<f64> for P2 {
    type Output = Self;
    fn mul(self, k: f64) -> Self {
        Self::new(self.x * k, self.y * k)
    }
}
impl core::ops::Neg for P2 {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y)
    }
}

/// A corner of a curve in bulge form: the segment that starts here is a line (bulge 0) or an arc whose bulge is the
/// tangent of a quarter of its sweep, positive counterclockwise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vertex {
    /// Where.
    pub p: P2,
    /// tan(sweep / 4) of the segment that starts here.
    pub bulge: f64,
}

impl Vertex {
    /// Start of a line.
    pub const fn line(x: f64, y: f64) -> Self {
        Self { p: P2::new(x, y), bulge: 0.0 }
    }
    /// Start of an arc.
    pub const fn arc(x: f64, y: f64, bulge: f64) -> Self {
        Self { p: P2::new(x, y), bulge }
    }
}

/// An axis-parallel box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lower left.
    pub min: P2,
    /// Upper right.
    pub max: P2,
}

impl Bounds {
    pub(crate) fn of(a: P2, b: P2) -> Self {
        Self { min: P2::new(a.x.min(b.x), a.y.min(b.y)), max: P2::new(a.x.max(b.x), a.y.max(b.y)) }
    }
    /// The box of both.
    pub fn union(self, o: Self) -> Self {
        Self {
            min: P2::new(self.min.x.min(o.min.x), self.min.y.min(o.min.y)),
            max: P2::new(self.max.x.max(o.max.x), self.max.y.max(o.max.y)),
        }
    }
    pub(crate) fn add(self, p: P2) -> Self {
        self.union(Self::of(p, p))
    }
    /// Larger by `d` on every side.
    pub fn grown(self, d: f64) -> Self {
        let d = P2::new(d, d);
        Self { min: self.min - d, max: self.max + d }
    }
    pub(crate) fn overlaps(&self, o: &Self) -> bool {
        self.min.x <= o.max.x && o.min.x <= self.max.x && self.min.y <= o.max.y && o.min.y <= self.max.y
    }
    /// Distance to the box from a point outside; 0 inside.
    pub(crate) fn dist(&self, p: P2) -> f64 {
        let dx = (self.min.x - p.x).max(p.x - self.max.x).max(0.0);
        let dy = (self.min.y - p.y).max(p.y - self.max.y).max(0.0);
        (dx * dx + dy * dy).sqrt()
    }
    /// Width and height.
    pub fn size(&self) -> P2 {
        self.max - self.min
    }
}

/// A line or an arc. Both ends are stored so that neighbours share them to the bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seg {
    /// Straight.
    Line {
        /// Start.
        a: P2,
        /// End.
        b: P2,
    },
    /// Circular, less than a full turn.
    Arc {
        /// Start.
        a: P2,
        /// End.
        b: P2,
        /// Centre.
        c: P2,
        /// Angle turned through, positive counterclockwise.
        sweep: f64,
    },
}

impl Seg {
    /// Start.
    pub fn a(&self) -> P2 {
        match *self {
            Self::Line { a, .. } | Self::Arc { a, .. } => a,
        }
    }
    /// End.
    pub fn b(&self) -> P2 {
        match *self {
            Self::Line { b, .. } | Self::Arc { b, .. } => b,
        }
    }
    /// The arc from a to b with this bulge, or the line if it is (nearly) 0.
    pub fn from_bulge(a: P2, b: P2, bulge: f64) -> Self {
        if bulge.abs() < 1e-10 {
            return Self::Line { a, b };
        }
        let chord = b - a;
        // The centre lies on the chord's middle line, (1 - k²) / 4k chords to the left.
        let c = a.lerp(b, 0.5) + chord.left() * ((1.0 - bulge * bulge) / (4.0 * bulge));
        Self::Arc { a, b, c, sweep: 4.0 * libm::atan(bulge) }
    }
    /// The arc about `c` from `a` by `sweep`.
    pub fn arc_about(c: P2, a: P2, sweep: f64) -> Self {
        Self::Arc { a, b: c + (a - c).rotated(sweep), c, sweep }
    }
    /// tan(sweep / 4), 0 for a line.
    pub fn bulge(&self) -> f64 {
        match *self {
            Self::Line { .. } => 0.0,
            Self::Arc { sweep, .. } => libm::tan(sweep / 4.0),
        }
    }
    /// Radius of an arc.
    pub fn radius(&self) -> Option<f64> {
        match *self {
            Self::Line { .. } => None,
            Self::Arc { a, b, c, .. } => Some((a.dist(c) + b.dist(c)) * 0.5),
        }
    }
    /// Length along it.
    pub fn len(&self) -> f64 {
        match *self {
            Self::Line { a, b } => a.dist(b),
            Self::Arc { sweep, .. } => self.radius().unwrap_or(0.0) * sweep.abs(),
        }
    }
    /// Has it no length at all?
    pub fn is_empty(&self) -> bool {
        self.len() <= 0.0
    }
    /// Run backwards.
    pub fn reversed(&self) -> Self {
        match *self {
            Self::Line { a, b } => Self::Line { a: b, b: a },
            Self::Arc { a, b, c, sweep } => Self::Arc { a: b, b: a, c, sweep: -sweep },
        }
    }
    /// The point at t = 0…1 of its length.
    pub fn at(&self, t: f64) -> P2 {
        if t <= 0.0 {
            return self.a();
        }
        if t >= 1.0 {
            return self.b();
        }
        match *self {
            Self::Line { a, b } => a.lerp(b, t),
            Self::Arc { a, c, sweep, .. } => c + (a - c).rotated(sweep * t),
        }
    }
    /// Direction of travel (length 1) at t = 0…1.
    pub fn tangent(&self, t: f64) -> P2 {
        match *self {
            Self::Line { a, b } => (b - a).unit(),
            Self::Arc { a, c, sweep, .. } => {
                let out = (a - c).rotated(sweep * t).unit();
                if sweep > 0.0 { out.left() } else { -out.left() }
            }
        }
    }
    /// The part from t0 to t1.
    pub fn part(&self, t0: f64, t1: f64) -> Self {
        let (a, b) = (self.at(t0), self.at(t1));
        match *self {
            Self::Line { .. } => Self::Line { a, b },
            Self::Arc { c, sweep, .. } => Self::Arc { a, b, c, sweep: sweep * (t1 - t0) },
        }
    }
    /// Does the arc's angular range hold the direction from its centre to `p`? Where along it, if so.
    pub(crate) fn arc_param(a: P2, c: P2, sweep: f64, p: P2) -> f64 {
        let (u, v) = (a - c, p - c);
        let turn = libm::atan2(u.cross(v), u.dot(v)) * sweep.signum();
        let range = sweep.abs();
        // Fold into the half-open turn that is centred on the arc, so that points just before its start stay negative.
        let mid = range * 0.5;
        let mut t = turn;
        while t < mid - PI {
            t += TAU;
        }
        while t > mid + PI {
            t -= TAU;
        }
        t / range
    }
    /// Where along it (0…1, clamped) it is nearest to `p`.
    pub fn nearest(&self, p: P2) -> f64 {
        match *self {
            Self::Line { a, b } => {
                let u = b - a;
                let n = u.dot(u);
                if n > 0.0 { ((p - a).dot(u) / n).clamp(0.0, 1.0) } else { 0.0 }
            }
            Self::Arc { a, b, c, sweep } => {
                let t = Self::arc_param(a, c, sweep, p);
                if (0.0..=1.0).contains(&t) {
                    t
                } else if p.dist(a) <= p.dist(b) {
                    0.0
                } else {
                    1.0
                }
            }
        }
    }
    /// Distance from `p`.
    pub fn dist(&self, p: P2) -> f64 {
        match *self {
            Self::Line { a, b } => {
                let u = b - a;
                let n = u.dot(u);
                let t = if n > 0.0 { ((p - a).dot(u) / n).clamp(0.0, 1.0) } else { 0.0 };
                p.dist(a + u * t)
            }
            Self::Arc { a, b, c, sweep } => {
                if in_wedge(a - c, b - c, sweep, p - c) {
                    (p.dist(c) - a.dist(c)).abs()
                } else {
                    p.dist(a).min(p.dist(b))
                }
            }
        }
    }
    /// Its box.
    pub fn bounds(&self) -> Bounds {
        let mut out = Bounds::of(self.a(), self.b());
        if let Self::Arc { a, b, c, sweep } = *self {
            let r = a.dist(c);
            for axis in [P2::new(1.0, 0.0), P2::new(0.0, 1.0), P2::new(-1.0, 0.0), P2::new(0.0, -1.0)] {
                if in_wedge(a - c, b - c, sweep, axis) {
                    out = out.add(c + axis * r);
                }
            }
        }
        out
    }
    /// Twice the area between it and the origin.
    pub(crate) fn area2(&self) -> f64 {
        match *self {
            Self::Line { a, b } => a.cross(b),
            Self::Arc { a, b, sweep, .. } => {
                let r = self.radius().unwrap_or(0.0);
                a.cross(b) + r * r * (sweep - libm::sin(sweep))
            }
        }
    }
    /// Moved to the left by `d`; `None` where an arc would shrink past its centre.
    pub(crate) fn offset_left(&self, d: f64) -> Option<Self> {
        match *self {
            Self::Line { a, b } => {
                let n = (b - a).unit().left() * d;
                Some(Self::Line { a: a + n, b: b + n })
            }
            Self::Arc { a, b, c, sweep } => {
                let r = self.radius()?;
                let shrunk = r - d * sweep.signum();
                (shrunk > TOL).then(|| {
                    let k = shrunk / r;
                    Self::Arc { a: c + (a - c) * k, b: c + (b - c) * k, c, sweep }
                })
            }
        }
    }
    pub(crate) fn map(&self, f: impl Fn(P2) -> P2, mirrored: bool) -> Self {
        match *self {
            Self::Line { a, b } => Self::Line { a: f(a), b: f(b) },
            Self::Arc { a, b, c, sweep } => {
                Self::Arc { a: f(a), b: f(b), c: f(c), sweep: if mirrored { -sweep } else { sweep } }
            }
        }
    }
    /// Change of the winding number about `p` that this segment brings, boundary cases taken as moved by a hair.
    pub(crate) fn winding(&self, p: P2) -> i32 {
        let (a, b) = (self.a(), self.b());
        let side = (b - a).cross(p - a);
        let left = if side != 0.0 {
            side > 0.0
        } else if a.y != b.y {
            b.y < a.y
        } else {
            b.x > a.x
        };
        let mut n = 0;
        if a.y <= p.y && p.y < b.y && left {
            n += 1;
        } else if b.y <= p.y && p.y < a.y && !left {
            n -= 1;
        }
        if let Self::Arc { c, sweep, .. } = *self {
            let r = self.radius().unwrap_or(0.0);
            // Between chord and arc.
            if p.dist(c) < r && left != (sweep > 0.0) {
                n += if sweep > 0.0 { 1 } else { -1 };
            }
        }
        n
    }
}

/// Is direction `v` within the wedge that starts at `u0`, turns by `sweep` and ends at `u1`?
pub(crate) fn in_wedge(u0: P2, u1: P2, sweep: f64, v: P2) -> bool {
    let (s, e) = if sweep > 0.0 { (u0, u1) } else { (u1, u0) };
    let (after, before) = (s.cross(v) >= 0.0, e.cross(v) <= 0.0);
    if sweep.abs() > PI {
        return after || before;
    }
    // Nothing in a wedge of at most half a turn looks away from its middle; the opposite of a thin wedge does.
    after && before && (s + e).dot(v) >= -1e-12 * s.norm() * v.norm()
}
