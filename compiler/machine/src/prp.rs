use crate::kinematics::{Control, Kinematics, KinematicsError, Pose, Solution, Violation, checked};
use crate::math::{V3, dot, norm, rot_z, solve};

mod errors;

/// Parallel machine 2UPS+PRP: two legs between base and platform, a driven column that carries a turning telescopic
/// arm (E. E. R. Gojtan, EPUSP 2009, chapter 5). Joints: the two leg lengths and the height of the column. The tool
/// can be put anywhere in x y z; its turn about z follows from the position.
#[derive(Clone, PartialEq, Debug)]
pub struct TwoLegs {
    /// Geometry and limits.
    pub shape: TwoLegsShape,
}

/// What the spherical joints' cones are measured from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SphericalAxis {
    /// From a direction fixed in the platform.
    Platform,
    /// From a direction fixed in the base, as the thesis' program has it.
    Base,
}

/// Geometry and limits of a 2UPS+PRP machine, mm and rad.
#[derive(Clone, PartialEq, Debug)]
pub struct TwoLegsShape {
    /// Centres of the universal joints on the base.
    pub base: [V3; 2],
    /// Centres of the spherical joints on the platform.
    pub platform: [V3; 2],
    /// Least and greatest length of the arm.
    pub arm: (f64, f64),
    /// Least and greatest yaw.
    pub yaw: (f64, f64),
    /// Least and greatest length of each leg.
    pub legs: [(f64, f64); 2],
    /// Least and greatest height of the column.
    pub column: (f64, f64),
    /// Greatest angle of the universal joints, either way about both axes.
    pub universal: f64,
    /// Greatest angle of the spherical joints from their middle direction.
    pub spherical: f64,
    /// What that direction belongs to.
    pub spherical_axis: SphericalAxis,
    /// Arm length, yaw and height at which the middle direction was set.
    pub reference: V3,
}

impl TwoLegs {
    /// The vector along a leg, from base to platform.
    fn leg(&self, i: usize, [arm, yaw, height]: V3) -> V3 {
        let (s, c) = libm::sincos(yaw);
        let (p, u) = (self.shape.platform[i], self.shape.base[i]);
        [(p[0] + arm) * c - p[1] * s - u[0], (p[0] + arm) * s + p[1] * c - u[1], p[2] + height - u[2]]
    }

    /// The column with the arm, then the legs.
    pub(crate) fn figure(&self, flange: &crate::math::Frame) -> Vec<Vec<V3>> {
        let [x, y, z] = flange.position;
        let at = [libm::hypot(x, y), libm::atan2(y, x), z];
        let mut out = vec![vec![[0.0; 3], [0.0, 0.0, z], flange.position]];
        out.extend((0..2).map(|i| {
            let (foot, leg) = (self.shape.base[i], self.leg(i, at));
            vec![foot, [0, 1, 2].map(|k| foot[k] + leg[k]), flange.position]
        }));
        out
    }

    /// Leg lengths and height from arm length, yaw and height.
    pub fn lengths(&self, at: V3) -> V3 {
        [norm(self.leg(0, at)), norm(self.leg(1, at)), at[2]]
    }

    /// Half the change of the squared leg lengths by yaw and by arm length.
    fn slopes(&self, i: usize, [arm, yaw, _]: V3) -> [f64; 2] {
        let (s, c) = libm::sincos(yaw);
        let (p, u) = (self.shape.platform[i], self.shape.base[i]);
        let r = p[0] + arm;
        [c * (u[0] * p[1] - u[1] * r) + s * (u[0] * r + u[1] * p[1]), r - u[0] * c - u[1] * s]
    }

    /// Determinant of the thesis' matrix J_p, mm³ per rad: 0 at a singularity.
    pub fn determinant(&self, at: V3) -> f64 {
        let (a, b) = (self.slopes(0, at), self.slopes(1, at));
        a[0] * b[1] - a[1] * b[0]
    }

    /// The same without scale: per unit of leg travel and of movement of the tool across and along the arm.
    pub fn singularity(&self, at: V3) -> f64 {
        let h = self.lengths(at);
        self.determinant(at) / (h[0] * h[1] * at[0]).max(f64::MIN_POSITIVE)
    }

    /// Every way the machine can be put together with these joint values: arm length, yaw and height, sorted by
    /// arm length, greatest first; arms of negative length are left out.
    pub fn assemblies(&self, joints: V3) -> Vec<V3> {
        let size = joints[0].abs().max(joints[1].abs()).max(1e-9);
        let mut found: Vec<V3> = Vec::new();
        for root in real_roots(&self.sextic(joints, size)) {
            let arm = root * size;
            if let Some(at) = self.with_arm(arm, joints).and_then(|at| self.polished(at, joints))
                && at[0] > 0.0
                && !found.iter().any(|f| (f[0] - at[0]).abs() < 1e-6 * size && (f[1] - at[1]).abs() < 1e-6)
            {
                found.push(at);
            }
        }
        found.sort_by(|p, q| q[0].total_cmp(&p[0]));
        found
    }

    /// For each leg a·cos yaw + b·sin yaw = c, where a, b and c are polynomials of the arm length (lowest power
    /// first); all lengths divided by `size`.
    fn lines(&self, joints: V3, size: f64) -> [[Vec<f64>; 3]; 2] {
        [0, 1].map(|i| {
            let (p, u) = (self.shape.platform[i].map(|v| v / size), self.shape.base[i].map(|v| v / size));
            let (h, z) = (joints[i] / size, p[2] + joints[2] / size - u[2]);
            [
                vec![-2.0 * (p[0] * u[0] + p[1] * u[1]), -2.0 * u[0]],
                vec![2.0 * (p[1] * u[0] - p[0] * u[1]), -2.0 * u[1]],
                vec![
                    h * h - p[0] * p[0] - p[1] * p[1] - z * z - u[0] * u[0] - u[1] * u[1],
                    -2.0 * p[0],
                    -1.0,
                ],
            ]
        })
    }

    fn sextic(&self, joints: V3, size: f64) -> Vec<f64> {
        let [[a1, b1, c1], [a2, b2, c2]] = self.lines(joints, size);
        let minus = |p: &[f64], q: &[f64]| -> Vec<f64> {
            (0..p.len().max(q.len())).map(|i| p.get(i).unwrap_or(&0.0) - q.get(i).unwrap_or(&0.0)).collect()
        };
        let whole = minus(&times(&a1, &b2), &times(&a2, &b1));
        let cos = minus(&times(&c1, &b2), &times(&c2, &b1));
        let sin = minus(&times(&a1, &c2), &times(&a2, &c1));
        let negative: Vec<f64> = times(&sin, &sin).iter().map(|v| -v).collect();
        minus(&minus(&times(&cos, &cos), &negative), &times(&whole, &whole))
    }

    fn with_arm(&self, arm: f64, joints: V3) -> Option<V3> {
        let at = |poly: &[f64]| poly.iter().rev().fold(0.0, |sum, c| sum * arm + c);
        let [[a1, b1, c1], [a2, b2, c2]] = self.lines(joints, 1.0).map(|l| l.map(|p| at(&p)));
        let whole = a1 * b2 - a2 * b1;
        let scale = libm::hypot(a1, b1) * libm::hypot(a2, b2);
        (whole.abs() > 1e-9 * scale)
            .then(|| [arm, libm::atan2((a1 * c2 - a2 * c1) / whole, (c1 * b2 - c2 * b1) / whole), joints[2]])
    }

    /// Newton's steps on the leg lengths; none when they lead nowhere.
    fn polished(&self, mut at: V3, joints: V3) -> Option<V3> {
        for _ in 0..40 {
            let h = self.lengths(at);
            let (e1, e2) = (joints[0] - h[0], joints[1] - h[1]);
            if e1.abs().max(e2.abs()) <= 1e-13 * joints[0].abs().max(joints[1].abs()) {
                break;
            }
            let (a, b) = (self.slopes(0, at), self.slopes(1, at));
            let step = solve(vec![a.to_vec(), b.to_vec()], vec![h[0] * e1, h[1] * e2])?;
            at[1] += step[0].clamp(-0.5, 0.5);
            at[0] += step[1];
        }
        let h = self.lengths(at);
        let fits = (0..2).all(|i| (h[i] - joints[i]).abs() <= 1e-9 * joints[i].abs().max(1e-9));
        at[1] = crate::opw::turn(at[1]);
        (fits && at.iter().all(|v| v.is_finite())).then_some(at)
    }

    fn inside(&self, at: V3) -> bool {
        const ROOM: f64 = 1e-6;
        let (arm, yaw) = (self.shape.arm, self.shape.yaw);
        at[0] >= arm.0 - ROOM && at[0] <= arm.1 + ROOM && at[1] >= yaw.0 - 1e-9 && at[1] <= yaw.1 + 1e-9
    }

    /// The conditions of the work space that arm length, yaw and height break (the sixteen of the thesis).
    pub fn broken(&self, at: V3) -> Vec<Violation> {
        let mut out = Vec::new();
        let s = &self.shape;
        let [arm, yaw, height] = at;
        range(&mut out, ["yaw-low", "yaw-high"], "the yaw of the platform", yaw, s.yaw);
        range(&mut out, ["arm-short", "arm-long"], "the arm", arm, s.arm);
        range(&mut out, ["column-low", "column-high"], "the column", height, s.column);
        for i in 0..2 {
            self.leg_conditions(i, at, &mut out);
        }
        let (value, limit) = match s.spherical_axis {
            SphericalAxis::Base => (self.determinant(at), 1e-5),
            SphericalAxis::Platform => (self.singularity(at), 1e-4),
        };
        if !(value.abs() >= limit) {
            out.push(Violation { name: "singular", what: "the legs pull in one line".into(), value, limit });
        }
        out
    }

    fn leg_conditions(&self, i: usize, at: V3, out: &mut Vec<Violation>) {
        const SHORT: [[&str; 2]; 2] = [["leg-1-short", "leg-1-long"], ["leg-2-short", "leg-2-long"]];
        const UNIVERSAL: [[&str; 2]; 2] = [["universal-1-first", "universal-1-second"], ["universal-2-first", "universal-2-second"]];
        const SPHERICAL: [&str; 2] = ["spherical-1", "spherical-2"];
        let s = &self.shape;
        let v = self.leg(i, at);
        let h = norm(v);
        let leg = i + 1;
        range(out, SHORT[i], &format!("leg {leg}"), h, s.legs[i]);
        let angles = [libm::atan(v[1] / v[0]), libm::asin((-v[2] / h).clamp(-1.0, 1.0))];
        for (name, angle) in UNIVERSAL[i].into_iter().zip(angles) {
            if !(angle.abs() <= s.universal) {
                let what = format!("the universal joint of leg {leg}");
                out.push(Violation { name, what, value: angle, limit: s.universal });
            }
        }
        let mut middle = self.leg(i, s.reference);
        if s.spherical_axis == SphericalAxis::Platform {
            middle = crate::math::rotate(&rot_z(at[1] - s.reference[1]), middle);
        }
        let cone = libm::acos((dot(v, middle) / h / norm(middle)).clamp(-1.0, 1.0));
        if !(cone <= s.spherical) {
            let what = format!("the spherical joint of leg {leg}");
            out.push(Violation { name: SPHERICAL[i], what, value: cone, limit: s.spherical });
        }
    }
}

fn range(out: &mut Vec<Violation>, names: [&'static str; 2], what: &str, value: f64, (min, max): (f64, f64)) {
    if value < min {
        out.push(Violation { name: names[0], what: what.to_string(), value, limit: min });
    }
    if value > max {
        out.push(Violation { name: names[1], what: what.to_string(), value, limit: max });
    }
}

fn times(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; p.len() + q.len() - 1];
    for (i, a) in p.iter().enumerate() {
        for (k, b) in q.iter().enumerate() {
            out[i + k] += a * b;
        }
    }
    out
}

/// Real roots of a polynomial, lowest power first, by Durand and Kerner's iteration.
fn real_roots(poly: &[f64]) -> Vec<f64> {
    let mut poly = poly.to_vec();
    let size = poly.iter().fold(0.0f64, |m, c| m.max(c.abs()));
    while poly.last().is_some_and(|c| c.abs() <= 1e-13 * size) {
        poly.pop();
    }
    let (Some(&lead), degree) = (poly.last(), poly.len().saturating_sub(1)) else { return Vec::new() };
    if degree == 0 || poly.iter().any(|c| !c.is_finite()) {
        return Vec::new();
    }
    poly.iter_mut().for_each(|c| *c /= lead);
    let mul = |(a, b): (f64, f64), (c, d): (f64, f64)| (a * c - b * d, a * d + b * c);
    let mut z: Vec<(f64, f64)> = Vec::with_capacity(degree);
    let mut start = (1.0, 0.0);
    for _ in 0..degree {
        z.push(start);
        start = mul(start, (0.4, 0.9));
    }
    for _ in 0..500 {
        let mut change = 0.0f64;
        for i in 0..degree {
            let value = poly.iter().rev().fold((0.0, 0.0), |sum, c| {
                let (x, y) = mul(sum, z[i]);
                (x + c, y)
            });
            let below = (0..degree).filter(|k| *k != i).fold((1.0, 0.0), |all, k| mul(all, (z[i].0 - z[k].0, z[i].1 - z[k].1)));
            let square = below.0 * below.0 + below.1 * below.1;
            if square > 0.0 {
                let step = mul(value, (below.0 / square, -below.1 / square));
                z[i] = (z[i].0 - step.0, z[i].1 - step.1);
                change = change.max(step.0.abs() + step.1.abs());
            }
        }
        if change < 1e-15 {
            break;
        }
    }
    // A double root is found with half the digits; Newton's steps on the legs sort out what is none.
    z.into_iter().filter(|(x, y)| x.is_finite() && y.abs() < 1e-5).map(|(x, _)| x).collect()
}

impl Kinematics for TwoLegs {
    fn joint_count(&self) -> usize {
        3
    }
    fn control(&self) -> Control {
        Control::Position
    }
    fn forward(&self, joints: &[f64]) -> Result<Pose, KinematicsError> {
        let q = checked(joints, 3)?;
        let all = self.assemblies([q[0], q[1], q[2]]);
        let inside: Vec<V3> = all.into_iter().filter(|at| self.inside(*at)).collect();
        match inside[..] {
            [] => Err(KinematicsError::NoAssembly),
            [[arm, yaw, z]] => {
                let (s, c) = libm::sincos(yaw);
                Ok(Pose { position: [arm * c, arm * s, z], rotation: [0.0, 0.0, yaw] })
            }
            _ => Err(KinematicsError::Ambiguous { count: inside.len() }),
        }
    }
    fn inverse(&self, pose: &Pose) -> Result<Vec<Solution>, KinematicsError> {
        let [x, y, z, a, b, _] = pose.coordinates();
        if pose.coordinates().iter().any(|v| !v.is_finite()) {
            return Err(KinematicsError::NotFinite);
        }
        for (word, value) in [('A', a), ('B', b)] {
            if value.abs() > 1e-9 {
                return Err(KinematicsError::OutOfPlane { word, value });
            }
        }
        let arm = libm::hypot(x, y);
        if arm <= 1e-9 {
            return Err(KinematicsError::Singular);
        }
        let at = [arm, libm::atan2(y, x), z];
        let h = self.lengths(at);
        if h.iter().any(|v| !v.is_finite()) {
            return Err(KinematicsError::NotFinite);
        }
        let singular = self.singularity(at).abs() < 1e-4;
        Ok(vec![Solution { joints: h.to_vec(), branch: 0, singular }])
    }
    fn violations(&self, joints: &[f64]) -> Vec<Violation> {
        let Ok(&[h1, h2, h3]) = checked(joints, 3) else { return Vec::new() };
        // Of several assemblies the one that breaks least is meant; of several that break nothing nobody knows which.
        let all: Vec<Vec<Violation>> = self.assemblies([h1, h2, h3]).into_iter().map(|at| self.broken(at)).collect();
        let inside = all.iter().filter(|v| v.is_empty()).count();
        if inside > 1 {
            let what = "the number of tool positions that fit the joint values".into();
            return vec![Violation { name: "assembly", what, value: inside as f64, limit: 1.0 }];
        }
        all.into_iter().min_by_key(Vec::len).unwrap_or_default()
    }
}
