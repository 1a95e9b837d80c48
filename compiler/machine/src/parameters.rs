//! The geometry of a machine as a list of named numbers, and the machine with other numbers: what a tolerance, an
//! identification or a sensitivity speaks of.

use crate::kinematics::{Control, Kinematics, KinematicsError, Pose, Solution, Violation};
use crate::math::{Frame, V3, add, cross, norm, scale};
use crate::{Carrier, Chain, JointKind, Machine, Opw, ParallelWrist, Planar3r, Scara, Serial, Tricept, TwoLegs};

/// A number of the geometry.
#[derive(Clone, PartialEq, Debug)]
pub struct Parameter {
    /// Its name in machine files and reports: `a2`, `ls1x`, `J3.zero`.
    pub name: String,
    /// Its nominal value, mm or rad.
    pub nominal: f64,
    /// A length or an angle.
    pub kind: ParameterKind,
}

/// What a parameter measures.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ParameterKind {
    /// mm
    Length,
    /// rad
    Angle,
}

use ParameterKind::{Angle, Length};

/// Names of the twelve lengths of [`TwoLegs`], in the order of [`Machine::parameters`].
const TWO_LEGS: [&str; 12] =
    ["ls1x", "ls1y", "ls1z", "ls2x", "ls2y", "ls2z", "lu1x", "lu1y", "lu1z", "lu2x", "lu2y", "lu2z"];

impl Machine {
    /// The numbers its geometry is made of: those of the kinematics, then the zero of every joint.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut out = Vec::new();
        let mut push = |name: &str, nominal: f64, kind| out.push(Parameter { name: name.to_string(), nominal, kind });
        let mut list = |names: &[&str], values: &[f64]| names.iter().zip(values).for_each(|(n, v)| push(n, *v, Length));
        match &self.chain {
            Chain::Planar3r(l) => list(&["l1", "l2", "l3"], l),
            Chain::Scara(k) => list(&["l1", "l2", "height"], &k.lengths()),
            Chain::Opw(k) => list(&["a1", "a2", "b", "c1", "c2", "c3", "c4"], &k.lengths()),
            Chain::ParallelWrist(k) => list(&["d1", "a2", "a3", "d4", "d5", "d6"], &k.lengths()),
            Chain::TwoLegs(k) => {
                let values: Vec<f64> = k.shape.platform.iter().chain(&k.shape.base).flatten().copied().collect();
                list(&TWO_LEGS, &values);
                // The thesis has no more parameters: zeros of the joints are its joint errors.
                return out;
            }
            Chain::Tricept(k) => {
                let s = &k.shape;
                let names = ["base_radius", "platform_radius", "wrist_offset", "flange_offset"];
                list(&names, &[s.base_radius, s.platform_radius, s.wrist_offset, s.flange_offset]);
            }
            Chain::Cartesian => {
                let sliding = self.joints.iter().take_while(|j| j.kind == JointKind::Prismatic).count();
                for (name, axes) in [("square-xy", 2), ("square-xz", 3), ("square-yz", 3)] {
                    if sliding >= axes {
                        push(name, 0.0, Angle);
                    }
                }
            }
            Chain::FiveAxis(k) => {
                push("pivot", k.pivot(), Length);
                for (i, r) in k.rotary().iter().enumerate() {
                    if r.on == Carrier::Table {
                        for (axis, v) in ["x", "y", "z"].iter().zip(r.point) {
                            push(&format!("rotary{}.{axis}", i + 1), v, Length);
                        }
                    }
                    for side in ["a", "b"] {
                        push(&format!("rotary{}.tilt-{side}", i + 1), 0.0, Angle);
                    }
                }
            }
            Chain::Serial(k) => {
                for (j, link) in self.joints.iter().zip(k.links()) {
                    for (axis, v) in ["x", "y", "z"].iter().zip(link.origin.position) {
                        push(&format!("{}.{axis}", j.name), v, Length);
                    }
                    for axis in ["a", "b", "c"] {
                        push(&format!("{}.{axis}", j.name), 0.0, Angle);
                    }
                }
            }
            Chain::Incomplete { .. } => return out,
        }
        for j in &self.joints {
            let kind = if j.kind == JointKind::Revolute { Angle } else { Length };
            push(&format!("{}.zero", j.name), 0.0, kind);
        }
        out
    }

    /// The kinematics with deviations (mm, rad) of the [`Machine::parameters`], in their order; missing ones are 0.
    pub fn deviated(&self, deviations: &[f64]) -> Box<dyn Kinematics> {
        let mut rest = deviations.iter().copied();
        let mut next = || rest.next().unwrap_or(0.0);
        let inner: Box<dyn Kinematics> = match &self.chain {
            Chain::Planar3r(l) => Box::new(Planar3r::new(l.map(|v| v + next()))),
            Chain::Scara(k) => {
                let [l1, l2, height] = k.lengths().map(|v| v + next());
                Box::new(Scara::new([l1, l2], height))
            }
            Chain::Opw(k) => Box::new(Opw::new(k.lengths().map(|v| v + next()), k.offsets(), k.signs())),
            Chain::ParallelWrist(k) => Box::new(ParallelWrist::new(k.lengths().map(|v| v + next()))),
            Chain::TwoLegs(k) => {
                let mut shape = k.shape.clone();
                for point in shape.platform.iter_mut().chain(&mut shape.base) {
                    *point = point.map(|v| v + next());
                }
                return Box::new(TwoLegs { shape });
            }
            Chain::Tricept(k) => {
                let mut shape = k.shape;
                for v in [
                    &mut shape.base_radius,
                    &mut shape.platform_radius,
                    &mut shape.wrist_offset,
                    &mut shape.flange_offset,
                ] {
                    *v += next();
                }
                Box::new(Tricept { shape, reference: k.reference })
            }
            Chain::Cartesian => {
                let sliding = self.joints.iter().take_while(|j| j.kind == JointKind::Prismatic).count();
                let mut skew = [0.0; 3];
                for (s, axes) in skew.iter_mut().zip([2, 3, 3]) {
                    if sliding >= axes {
                        *s = next();
                    }
                }
                Box::new(Skewed { inner: self.kinematics(), skew })
            }
            Chain::FiveAxis(k) => {
                let mut rotary = k.rotary();
                let pivot = k.pivot() + next();
                for r in &mut rotary {
                    if r.on == Carrier::Table {
                        r.point = r.point.map(|v| v + next());
                    }
                    r.axis = tilted(r.axis, next(), next());
                }
                Box::new(crate::FiveAxis::new(rotary, pivot))
            }
            Chain::Serial(k) => {
                let links = k.links().iter().map(|l| {
                    let shift = [next(), next(), next()];
                    let turn = [next(), next(), next()];
                    let moved = Frame { position: add(l.origin.position, shift), turn: l.origin.turn };
                    crate::Link { origin: moved.then(&Frame::new([0.0; 3], turn)), ..l.clone() }
                });
                Box::new(Serial::new(links.collect(), *k.tip()))
            }
            Chain::Incomplete { .. } => return self.kinematics(),
        };
        let zeros = self.joints.iter().map(|_| next()).collect();
        Box::new(Shifted { inner, zeros })
    }
}

/// A direction leaned by two small turns about the directions square to it.
fn tilted(axis: V3, a: f64, b: f64) -> V3 {
    let helper = if axis[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let u = cross(helper, axis);
    let u = scale(u, 1.0 / norm(u));
    let v = cross(axis, u);
    let leaned = add(axis, add(scale(u, a), scale(v, b)));
    scale(leaned, 1.0 / norm(leaned))
}

/// Joints whose zero is not where it should be: the machine stands at value + zero.
struct Shifted {
    inner: Box<dyn Kinematics>,
    zeros: Vec<f64>,
}

impl Shifted {
    fn shifted(&self, joints: &[f64], sign: f64) -> Vec<f64> {
        joints.iter().zip(&self.zeros).map(|(q, z)| q + sign * z).collect()
    }
}

impl Kinematics for Shifted {
    fn joint_count(&self) -> usize {
        self.inner.joint_count()
    }
    fn control(&self) -> Control {
        self.inner.control()
    }
    fn forward(&self, joints: &[f64]) -> Result<Pose, KinematicsError> {
        self.inner.forward(&self.shifted(joints, 1.0))
    }
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        self.inner.forward_frame(&self.shifted(joints, 1.0))
    }
    fn inverse(&self, pose: &Pose) -> Result<Vec<Solution>, KinematicsError> {
        let mut all = self.inner.inverse(pose)?;
        all.iter_mut().for_each(|s| s.joints = self.shifted(&s.joints, -1.0));
        Ok(all)
    }
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        let mut all = self.inner.inverse_frame(frame)?;
        all.iter_mut().for_each(|s| s.joints = self.shifted(&s.joints, -1.0));
        Ok(all)
    }
    fn violations(&self, joints: &[f64]) -> Vec<Violation> {
        self.inner.violations(&self.shifted(joints, 1.0))
    }
}

/// Linear axes that don't stand square. Each number is the angle between the two axes' positive ends less 90°, as a square and an
/// indicator show it: above zero Y leans away from X by the first, Z away from X and Y by the others.
struct Skewed {
    inner: Box<dyn Kinematics>,
    skew: [f64; 3],
}

impl Skewed {
    fn skewed(&self, [x, y, z]: V3) -> V3 {
        let [xy, xz, yz] = self.skew;
        [x - xy * y - xz * z, y - yz * z, z]
    }
    fn straightened(&self, [x, y, z]: V3) -> V3 {
        let [xy, xz, yz] = self.skew;
        let y = y + yz * z;
        [x + xy * y + xz * z, y, z]
    }
}

impl Kinematics for Skewed {
    fn joint_count(&self) -> usize {
        self.inner.joint_count()
    }
    fn control(&self) -> Control {
        self.inner.control()
    }
    fn forward(&self, joints: &[f64]) -> Result<Pose, KinematicsError> {
        let pose = self.inner.forward(joints)?;
        Ok(Pose { position: self.skewed(pose.position), ..pose })
    }
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        let frame = self.inner.forward_frame(joints)?;
        Ok(Frame { position: self.skewed(frame.position), ..frame })
    }
    fn inverse(&self, pose: &Pose) -> Result<Vec<Solution>, KinematicsError> {
        self.inner.inverse(&Pose { position: self.straightened(pose.position), ..*pose })
    }
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        self.inner.inverse_frame(&Frame { position: self.straightened(frame.position), ..*frame })
    }
    fn violations(&self, joints: &[f64]) -> Vec<Violation> {
        self.inner.violations(joints)
    }
}

/// Movement of the tool (mm, then rad) per unit of each of the [`Machine::parameters`] with the joints held, one
/// column each; exact for [`TwoLegs`] and for chains whose lengths don't turn the tool, by central differences elsewhere.
pub fn parameter_columns(machine: &Machine, joints: &[f64]) -> Result<Vec<[f64; 6]>, KinematicsError> {
    if let Chain::TwoLegs(k) = &machine.chain {
        let &[h1, h2, h3] = crate::kinematics::checked(joints, 3)? else { return Err(KinematicsError::NotFinite) };
        return k.parameter_columns([h1, h2, h3]).ok_or(KinematicsError::Singular);
    }
    if let Some(lengths) = by_unit_lengths(&machine.chain, joints) {
        let mut out = lengths?;
        // A joint whose zero is off stands where its value would be greater by so much.
        out.extend(crate::differential::velocity(machine, joints)?);
        return Ok(out);
    }
    let parameters = machine.parameters();
    if let Chain::Tricept(_) = machine.chain {
        return by_inverse(machine, &parameters, joints);
    }
    let mut deviations = vec![0.0; parameters.len()];
    let mut out = Vec::with_capacity(parameters.len());
    for (i, p) in parameters.iter().enumerate() {
        let h = if p.kind == Length { 1e-4 * p.nominal.abs().max(10.0) } else { 1e-6 };
        deviations[i] = h;
        let plus = machine.deviated(&deviations).forward_frame(joints)?;
        deviations[i] = -h;
        let minus = machine.deviated(&deviations).forward_frame(joints)?;
        deviations[i] = 0.0;
        out.push(crate::differential::rate(&plus, &minus, 2.0 * h));
    }
    Ok(out)
}

/// Chains whose place is a sum of lengths times directions that the joints alone decide: the direction of a length is
/// where the tool is when that length is 1 mm and the others are 0.
fn by_unit_lengths(chain: &Chain, joints: &[f64]) -> Option<Result<Vec<[f64; 6]>, KinematicsError>> {
    let column = |arm: &dyn Kinematics| {
        let [x, y, z] = arm.forward_frame(joints)?.position;
        Ok([x, y, z, 0.0, 0.0, 0.0])
    };
    Some(match chain {
        Chain::Planar3r(_) => (0..3).map(|i| column(&Planar3r::new(one(i)))).collect(),
        Chain::Scara(_) => scara(joints, column),
        Chain::Opw(k) => {
            let q = crate::kinematics::checked(joints, 6).and_then(|q| q.try_into().map_err(|_| KinematicsError::NotFinite));
            q.map(|q| k.by_lengths(q).map(|[x, y, z]| [x, y, z, 0.0, 0.0, 0.0]).to_vec())
        }
        Chain::ParallelWrist(_) => (0..6).map(|i| column(&ParallelWrist::new(one(i)))).collect(),
        _ => return None,
    })
}

/// A list of zeros with a 1 there.
fn one<const N: usize>(at: usize) -> [f64; N] {
    std::array::from_fn(|i| if i == at { 1.0 } else { 0.0 })
}

/// The stroke of a SCARA is no length of its arm: it is taken as 0.
fn scara(
    joints: &[f64],
    column: impl Fn(&dyn Kinematics) -> Result<[f64; 6], KinematicsError>,
) -> Result<Vec<[f64; 6]>, KinematicsError> {
    let stroke = joints.get(2).copied().unwrap_or(0.0);
    let lengths: [[f64; 3]; 3] = [one(0), one(1), one(2)];
    lengths
        .into_iter()
        .map(|[l1, l2, height]| {
            let mut c = column(&Scara::new([l1, l2], height))?;
            c[2] += stroke;
            Ok(c)
        })
        .collect()
}

/// The same where the forward solution is a search: what the joints would have to change at the same pose, times what
/// the joints move the tool.
fn by_inverse(
    machine: &Machine,
    parameters: &[Parameter],
    joints: &[f64],
) -> Result<Vec<[f64; 6]>, KinematicsError> {
    let columns = crate::differential::velocity(machine, joints)?;
    let here = machine.kinematics().forward_frame(joints)?;
    let near = |deviations: &[f64]| -> Result<Vec<f64>, KinematicsError> {
        let far = |q: &Vec<f64>| q.iter().zip(joints).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let all = machine.deviated(deviations).inverse_frame(&here)?.into_iter().map(|s| s.joints);
        all.min_by(|a, b| far(a).total_cmp(&far(b))).ok_or(KinematicsError::NoAssembly)
    };
    let mut deviations = vec![0.0; parameters.len()];
    let mut out = Vec::with_capacity(parameters.len());
    for (i, p) in parameters.iter().enumerate() {
        let h = if p.kind == Length { 1e-4 * p.nominal.abs().max(10.0) } else { 1e-6 };
        deviations[i] = h;
        let plus = near(&deviations)?;
        deviations[i] = -h;
        let minus = near(&deviations)?;
        deviations[i] = 0.0;
        let mut moved = [0.0; 6];
        for (column, (p, m)) in columns.iter().zip(plus.iter().zip(&minus)) {
            (0..6).for_each(|k| moved[k] -= column[k] * (p - m) / (2.0 * h));
        }
        out.push(moved);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{dot, sub};

    /// The machine with one number off, mm or degrees.
    fn off(id: &str, name: &str, by: f64) -> (Machine, Box<dyn Kinematics>) {
        let m = crate::builtin(id).unwrap();
        let all = m.parameters();
        let i = all.iter().position(|p| p.name == name).unwrap();
        let mut deviations = vec![0.0; all.len()];
        deviations[i] = if all[i].kind == Angle { by.to_radians() } else { by };
        let k = m.deviated(&deviations);
        (m, k)
    }

    fn at(k: &dyn Kinematics, joints: &[f64]) -> V3 {
        k.forward_frame(joints).unwrap().position
    }

    /// +0.02 of `square-xy` is an angle of 90.02° from +X to +Y, as a square shows it; so are the other two, and each is alone.
    #[test]
    fn squareness_is_the_angle_between_the_axes() {
        for (name, pair) in [("square-xy", (0, 1)), ("square-xz", (0, 2)), ("square-yz", (1, 2))] {
            let (_, k) = off("generic/mill3", name, 0.02);
            let way = |i: usize| {
                let mut q = [0.0; 3];
                q[i] = 100.0;
                let v = sub(at(&*k, &q), at(&*k, &[0.0; 3]));
                scale(v, 1.0 / norm(v))
            };
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                let angle = libm::acos(dot(way(a), way(b))).to_degrees();
                let wanted = if (a, b) == pair { 90.02 } else { 90.0 };
                assert!((angle - wanted).abs() < 1e-6, "{name}: {a} {b} {angle}");
            }
        }
        // A slide whose zero is off by +0.01 stands 0.01 further than its scale shows.
        let (_, k) = off("generic/mill3", "X.zero", 0.01);
        assert!((at(&*k, &[5.0, 0.0, 0.0])[0] - 5.01).abs() < 1e-12);
    }

    /// Where the positive end of a rotary axis leans to, and what its point is.
    #[test]
    fn rotary_axes_lean_and_lie() {
        let lean = 0.01f64.to_radians();
        let axes = [
            ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
            ([0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
            ([0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]),
        ];
        for (axis, a, b) in axes {
            assert!(norm(sub(tilted(axis, lean, 0.0), add(axis, scale(a, lean)))) < 1e-7, "{axis:?}");
            assert!(norm(sub(tilted(axis, 0.0, lean), add(axis, scale(b, lean)))) < 1e-7, "{axis:?}");
        }
        // The axis of the table is 0.1 mm further along +Y than its file says: turned by half a turn about it, the part has moved by
        // twice that, and the tool at the same joints is so much the other way in the part.
        let (m, k) = off("generic/mill5-ac-table", "rotary2.y", 0.1);
        let q = [10.0, 20.0, -30.0, 0.0, std::f64::consts::PI];
        let moved = sub(at(&*k, &q), at(&*m.kinematics(), &q));
        assert!(norm(sub(moved, [0.0, 0.2, 0.0])) < 1e-9 || norm(sub(moved, [0.0, -0.2, 0.0])) < 1e-9, "{moved:?}");
        // A head that is longer by 0.05 has its nose so much lower.
        let (m, k) = off("generic/mill5-cb-head", "pivot", 0.05);
        let moved = sub(at(&*k, &[0.0; 5]), at(&*m.kinematics(), &[0.0; 5]));
        assert!((norm(moved) - 0.05).abs() < 1e-9 || norm(moved) < 1e-12, "{moved:?}");
    }

    /// Joints of a chain: x, y, z shift the frame of the joint in the one before, a, b, c turn it about its own X, Y and Z; a zero adds
    /// to what the joint shows.
    #[test]
    fn numbers_of_a_chain() {
        let text = "format = 1\nid = \"test/chain\"\ntitle = \"x\"\nkind = \"robot\"\nsource = \"x\"\n[kinematics]\nkind = \"origins\"\ntip = [100, 0, 0, 0, 0, 0]\n\
            [[joint]]\nname = \"J1\"\ntype = \"revolute\"\naxis = [0, 0, 1]\norigin = [0, 0, 50, 0, 0, 0]\n";
        let m = crate::parse(gr_text::FileId(0), text).unwrap();
        let moved = |name: &str, by: f64| {
            let all = m.parameters();
            let i = all.iter().position(|p| p.name == name).unwrap();
            let mut deviations = vec![0.0; all.len()];
            deviations[i] = by;
            sub(at(&*m.deviated(&deviations), &[0.0]), at(&*m.kinematics(), &[0.0]))
        };
        assert!(norm(sub(moved("J1.y", 0.1), [0.0, 0.1, 0.0])) < 1e-12);
        assert!(norm(sub(moved("J1.b", 1e-4), [0.0, 0.0, -0.01])) < 1e-6);
        assert!(norm(sub(moved("J1.c", 1e-4), [0.0, 0.01, 0.0])) < 1e-6);
        assert!(norm(sub(moved("J1.zero", 1e-4), [0.0, 0.01, 0.0])) < 1e-6);
    }
}
