//! The error of the tool point at one place of the machine: by joints, by geometry, by force.

use crate::grade;
use crate::words::unplaced;
use gr_machine::math::{V3, add, cross, dot, norm, scale, sub};
use gr_machine::{Chain, KinematicsError, Machine, ParameterKind, TwoLegs, differential, parameter_columns};

/// How far each joint and each number of the geometry may be off, mm or rad.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Budget {
    /// Of the joints, plus or minus; none = the machine file doesn't say.
    pub joints: Option<Vec<f64>>,
    /// Of the geometry, plus or minus, in the order of `Machine::parameters`; none = the file says nothing of it.
    pub geometry: Option<Vec<f64>>,
    /// Deviations of the geometry with their signs, in place of the worst pattern of `geometry`.
    pub known: Option<Vec<f64>>,
    /// What the file does not say and no grade covers: names of joints and parameters, taken as exact.
    pub unsaid: Vec<String>,
}

/// Where the budget comes from besides the machine file.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct BudgetOptions {
    /// A grade of ISO 286-1 in place of the file's.
    pub grade: Option<u8>,
    /// Tolerances by the formula of Gojtan 2009.
    pub usp2009: bool,
}

impl Budget {
    /// What the machine file and the options say.
    pub fn new(machine: &Machine, options: BudgetOptions) -> Budget {
        let file = machine.cell.accuracy.as_ref();
        let mut unsaid = Vec::new();
        let joints = file.filter(|a| a.joints.iter().any(Option::is_some)).map(|a| {
            let mut one = |(i, e): (usize, &Option<f64>)| {
                if e.is_none() {
                    unsaid.push(machine.joints.get(i).map_or(String::new(), |j| j.name.clone()));
                }
                e.unwrap_or(0.0)
            };
            a.joints.iter().enumerate().map(&mut one).collect()
        });
        let grade = options.grade.or(file.and_then(|a| a.grade));
        let single = file.map(|a| &a.parameters);
        let says = grade.is_some() || single.is_some_and(|p| !p.is_empty());
        let by_grade = if options.usp2009 { grade::tolerance_usp2009 } else { grade::tolerance };
        let joints_unsaid = unsaid.len();
        let mut said_of_any = false;
        let geometry = says.then(|| {
            let mut out = Vec::new();
            for p in machine.parameters() {
                let said = single.and_then(|s| s.get(&p.name).copied());
                let graded = || {
                    let lengths = p.kind == ParameterKind::Length && !p.name.ends_with(".zero");
                    grade.filter(|_| lengths).and_then(|g| by_grade(p.nominal, g)).map(|width| width / 2.0)
                };
                let tolerance = said.or_else(graded);
                // Zeros of joints belong to the error of the joint.
                if tolerance.is_none() && !p.name.ends_with(".zero") {
                    unsaid.push(p.name.clone());
                }
                said_of_any |= tolerance.is_some();
                out.push(tolerance.unwrap_or(0.0));
            }
            out
        });
        if !said_of_any {
            // A grade says nothing of a machine whose numbers are all angles.
            unsaid.truncate(joints_unsaid);
            return Budget { joints, geometry: None, known: None, unsaid };
        }
        Budget { joints, geometry, known: None, unsaid }
    }

    /// With deviations of the geometry that are known, in the order of `Machine::parameters`: they go before tolerances.
    pub fn with_known(self, machine: &Machine, deviations: Option<Vec<f64>>) -> Budget {
        let Some(known) = deviations else { return self };
        let joint = |name: &String| machine.joints.iter().any(|j| j.name == *name);
        let unsaid = self.unsaid.into_iter().filter(joint).collect();
        Budget { joints: self.joints, geometry: None, known: Some(known), unsaid }
    }

    /// Whether anything is known of the geometry's error.
    pub fn tells_geometry(&self) -> bool {
        self.geometry.is_some() || self.known.is_some()
    }

    /// Whether anything is known of joints or geometry.
    pub fn tells_any(&self) -> bool {
        self.joints.is_some() || self.tells_geometry()
    }
}

/// What moves the tool point at one place: mm per unit of each joint and of each number of the geometry, and the
/// stiffness of each joint.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Sensitivity {
    /// By the joints, mm per mm or rad.
    pub joints: Vec<V3>,
    /// By the geometry, mm per mm or rad.
    pub geometry: Vec<V3>,
    /// Of the joints, N/mm or N·mm/rad; none where the machine file has no member for a joint.
    pub stiffness: Vec<Option<f64>>,
}

/// The velocity of a point `lever` away from where a column holds.
pub(crate) fn at_lever(column: &[f64; 6], lever: V3) -> V3 {
    let [x, y, z, a, b, c] = *column;
    add([x, y, z], cross([a, b, c], lever))
}

/// Takes away what rotary axes would move that are nobody knows where. The columns are of the joints, or end with those of their zeros.
pub(crate) fn blank(machine: &Machine, columns: &mut [[f64; 6]]) {
    let first = columns.len().saturating_sub(machine.joints.len());
    let of_joints = columns[first..].iter_mut().enumerate();
    of_joints.filter(|(joint, _)| unplaced(machine, *joint)).for_each(|(_, c)| *c = [0.0; 6]);
}

impl Sensitivity {
    /// At joint values, for a tool point `lever` from the flange (base directions, mm).
    pub fn new(machine: &Machine, joints: &[f64], lever: V3) -> Result<Sensitivity, KinematicsError> {
        let mut columns = differential::velocity(machine, joints)?;
        let mut parameters = parameter_columns(machine, joints)?;
        blank(machine, &mut columns);
        blank(machine, &mut parameters);
        let stiff = machine.cell.stiffness.as_ref();
        Ok(Sensitivity {
            joints: columns.iter().map(|c| at_lever(c, lever)).collect(),
            geometry: parameters.iter().map(|c| at_lever(c, lever)).collect(),
            stiffness: joints.iter().enumerate().map(|(i, q)| stiff.and_then(|s| s.joint(i, *q))).collect(),
        })
    }

    /// The same for a two-leg machine whose place is known, for a tool point `lever` from the platform; none at a singularity.
    pub fn of_two_legs(machine: &Machine, legs: &TwoLegs, at: V3, lever: V3) -> Option<Sensitivity> {
        let cut = |c: &[f64; 6]| at_lever(c, lever);
        let stiff = machine.cell.stiffness.as_ref();
        let lengths = legs.lengths(at);
        Some(Sensitivity {
            joints: legs.joint_columns_at(at)?.iter().map(cut).collect(),
            geometry: legs.parameter_columns_at(at)?.iter().map(cut).collect(),
            stiffness: lengths.iter().enumerate().map(|(i, q)| stiff.and_then(|s| s.joint(i, *q))).collect(),
        })
    }

    /// With the geometry's part counted from a place where the machine was told that it is right: a zero that was touched.
    #[must_use]
    pub fn since(mut self, zero: &Sensitivity) -> Sensitivity {
        self.geometry.iter_mut().zip(&zero.geometry).for_each(|(c, z)| *c = sub(*c, *z));
        self
    }

    /// Compliance of the tool point, mm/N; none where the stiffness of a joint that carries the force is not known.
    /// The virtual work of a force on the tool equals that of the joints' springs.
    pub fn compliance(&self) -> Option<[[f64; 3]; 3]> {
        let mut out = [[0.0; 3]; 3];
        for (column, k) in self.joints.iter().zip(&self.stiffness) {
            let k = (*k)?;
            for (row, a) in out.iter_mut().zip(column) {
                row.iter_mut().zip(column).for_each(|(cell, b)| *cell += a * b / k);
            }
        }
        Some(out)
    }

    /// How far a force, N, moves the tool point, mm.
    pub fn deflection(&self, force: V3) -> Option<V3> {
        Some(self.compliance()?.map(|row| dot(row, force)))
    }
}

/// The error that independent causes of known size make together.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Spread {
    /// The worst pattern of signs, by axis, mm.
    pub worst: V3,
    /// Root of the sum of squares, by axis, mm.
    pub rss: V3,
    /// The longest error vector of any pattern of signs, mm.
    pub longest: f64,
    /// Root of the sum of squares of the lengths, mm.
    pub typical: f64,
}

impl Spread {
    /// By causes that each move the tool point by `columns` times `sizes`.
    pub fn new(columns: &[V3], sizes: &[f64]) -> Spread {
        let moves: Vec<V3> = columns.iter().zip(sizes).map(|(c, s)| scale(*c, *s)).filter(|v| *v != [0.0; 3]).collect();
        let mut out = Spread { longest: longest(&moves), ..Spread::default() };
        for v in &moves {
            for axis in 0..3 {
                out.worst[axis] += v[axis].abs();
                out.rss[axis] += v[axis] * v[axis];
            }
        }
        out.typical = libm::sqrt(out.rss.iter().sum());
        out.rss = out.rss.map(libm::sqrt);
        out
    }

    /// By causes whose sizes and signs are known: one movement.
    pub fn known(columns: &[V3], sizes: &[f64]) -> Spread {
        let moved = columns.iter().zip(sizes).fold([0.0; 3], |sum, (c, s)| add(sum, scale(*c, *s)));
        let each = moved.map(f64::abs);
        Spread { worst: each, rss: each, longest: norm(moved), typical: norm(moved) }
    }
}

/// Up to so many causes in space the longest sum is found for certain.
const CERTAIN: usize = 24;
/// Sine under which vectors are parallel or in a plane, squared.
const LEVEL: f64 = 1e-24;

/// The greatest length of a sum of vectors with free signs. With very many vectors a sum that no single change of sign and
/// no turn towards it makes longer, found from many directions.
fn longest(moves: &[V3]) -> f64 {
    if moves.iter().all(|v| v[2] == 0.0) {
        return longest_flat(moves);
    }
    if moves.len() > CERTAIN {
        return moves.iter().map(|d| climbed(moves, *d)).fold(0.0, f64::max);
    }
    let mut list = [[0.0; 3]; CERTAIN];
    let list = merged(moves, &mut list);
    let mut best = list.iter().map(|v| dot(*v, *v)).fold(0.0, f64::max);
    for i in 0..list.len() {
        (0..i).for_each(|j| best = best.max(longest_about(list, i, j)));
    }
    libm::sqrt(best)
}

fn sign(v: f64) -> f64 {
    if v < 0.0 { -1.0 } else { 1.0 }
}

/// Parallel vectors as one: in the longest sum they go the same way.
fn merged<'a>(moves: &[V3], list: &'a mut [V3; CERTAIN]) -> &'a [V3] {
    let mut count = 0;
    for v in moves {
        let same = |u: &&mut V3| {
            let across = cross(**u, *v);
            dot(across, across) <= LEVEL * dot(**u, **u) * dot(*v, *v)
        };
        match list[..count].iter_mut().find(same) {
            Some(u) => *u = add(*u, scale(*v, sign(dot(*u, *v)))),
            None => {
                list[count] = *v;
                count += 1;
            }
        }
    }
    &list[..count]
}

/// The square of the longest sum whose signs follow a direction next to the one square to two of the vectors. The longest
/// sum is one of these: the directions that lead to the same signs fill a cone, and each of its edges is square to two.
fn longest_about(list: &[V3], i: usize, j: usize) -> f64 {
    let normal = cross(list[i], list[j]);
    let level = LEVEL * dot(normal, normal);
    let (mut across, mut free) = ([0.0; 3], 1u32 << i | 1 << j);
    for (k, v) in list.iter().enumerate().filter(|(k, _)| *k != i && *k != j) {
        let side = dot(*v, normal);
        if side * side <= level * dot(*v, *v) {
            free |= 1 << k;
        } else {
            across = add(across, scale(*v, sign(side)));
        }
    }
    let ends = |a: V3, b: V3| {
        let (to, fro) = (add(a, b), sub(a, b));
        [add(across, to), sub(across, to), add(across, fro), sub(across, fro)].iter().map(|v| dot(*v, *v)).fold(0.0, f64::max)
    };
    if free.count_ones() == 2 {
        return ends(list[i], list[j]);
    }
    // More of them lie in that plane: there it is as in `longest_flat`.
    let in_plane = || (0..list.len()).filter(|k| free >> k & 1 == 1);
    let with = |g: usize| {
        let along = cross(normal, list[g]);
        let rest = in_plane().filter(|k| *k != g).fold([0.0; 3], |s, k| add(s, scale(list[k], sign(dot(list[k], along)))));
        ends(list[g], rest)
    };
    in_plane().map(with).fold(0.0, f64::max)
}

/// The same for vectors across Z: the corners of the polygon that all sums fill are those where the signs follow a
/// direction square to one of the vectors.
fn longest_flat(moves: &[V3]) -> f64 {
    let mut best = 0.0f64;
    for d in moves {
        // Those along the direction's vector itself may go either way.
        let (mut across, mut along) = ([0.0; 2], [0.0; 2]);
        for v in moves {
            let side = d[0] * v[1] - d[1] * v[0];
            let sum = if side == 0.0 { &mut along } else { &mut across };
            let sign = if side == 0.0 { d[0] * v[0] + d[1] * v[1] } else { side };
            let sign = if sign < 0.0 { -1.0 } else { 1.0 };
            *sum = [sum[0] + sign * v[0], sum[1] + sign * v[1]];
        }
        for s in [1.0, -1.0] {
            best = best.max(libm::hypot(across[0] + s * along[0], across[1] + s * along[1]));
        }
    }
    best
}

fn climbed(moves: &[V3], mut direction: V3) -> f64 {
    let mut best = 0.0;
    for _ in 0..50 {
        let towards = |v: &V3| if dot(*v, direction) < 0.0 { scale(*v, -1.0) } else { *v };
        direction = moves.iter().fold([0.0; 3], |s, v| add(s, towards(v)));
        let length = norm(direction);
        if length <= best * (1.0 + 1e-12) {
            break;
        }
        best = length;
    }
    best
}

/// The errors at one place.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Errors {
    /// By the joints; none = no data.
    pub kinematic: Option<Spread>,
    /// By the geometry; none = no data.
    pub geometric: Option<Spread>,
    /// By the cutting force, mm; none = no data or no force.
    pub elastic: Option<V3>,
}

impl Errors {
    /// At a place, with a force on the tool (N) where there is one.
    pub fn new(at: &Sensitivity, budget: &Budget, force: Option<V3>) -> Errors {
        Errors {
            kinematic: budget.joints.as_ref().map(|b| Spread::new(&at.joints, b)),
            geometric: match &budget.known {
                Some(d) => Some(Spread::known(&at.geometry, d)),
                None => budget.geometry.as_ref().map(|b| Spread::new(&at.geometry, b)),
            },
            elastic: force.and_then(|f| at.deflection(f)),
        }
    }

    /// Rule *sum*: longest kinematic + longest geometric + length of the deflection, mm.
    pub fn sum(&self) -> f64 {
        self.kinematic.map_or(0.0, |s| s.longest)
            + self.geometric.map_or(0.0, |s| s.longest)
            + self.elastic.map_or(0.0, norm)
    }

    /// Rule *root of squares*: of the typical kinematic and geometric errors and the deflection, mm.
    pub fn root_of_squares(&self) -> f64 {
        let parts = [
            self.kinematic.map_or(0.0, |s| s.typical),
            self.geometric.map_or(0.0, |s| s.typical),
            self.elastic.map_or(0.0, norm),
        ];
        libm::sqrt(parts.iter().map(|p| p * p).sum())
    }
}

/// Whether a machine's errors are in closed form, so that a map of them is quick.
pub fn closed_form(machine: &Machine) -> bool {
    matches!(
        machine.chain,
        Chain::TwoLegs(_) | Chain::Opw(_) | Chain::Scara(_) | Chain::Planar3r(_) | Chain::Cartesian
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By all patterns.
    fn all_patterns(list: &[V3]) -> f64 {
        let sum = |signs: u32| list.iter().enumerate().fold([0.0; 3], |s, (i, v)| add(s, scale(*v, if signs >> i & 1 == 1 { -1.0 } else { 1.0 })));
        (0..1u32 << list.len()).map(|n| norm(sum(n))).fold(0.0, f64::max)
    }

    proptest! {
        /// No pattern of signs makes more, and one makes as much; whole numbers, so that many are parallel or in a plane.
        #[test]
        fn longest_of_all_patterns(
            list in prop::collection::vec([-9.0..9.0f64, -9.0..9.0, -9.0..9.0], 1..10),
            whole in prop::collection::vec([-2..3i32, -2..3i32, -2..3i32], 1..10),
        ) {
            prop_assert!((longest(&list) - all_patterns(&list)).abs() < 1e-9);
            let whole: Vec<V3> = whole.into_iter().map(|v| v.map(f64::from)).filter(|v| *v != [0.0; 3]).collect();
            prop_assert!((longest(&whole) - all_patterns(&whole)).abs() < 1e-9, "{} {}", longest(&whole), all_patterns(&whole));
        }

        /// In a plane as in space: a little way out of the plane makes nearly no difference.
        #[test]
        fn flat_vectors_as_others(list in prop::collection::vec((-10.0..10.0f64, -10.0..10.0f64), 1..9)) {
            let flat: Vec<V3> = list.iter().map(|(x, y)| [*x, *y, 0.0]).collect();
            let lifted: Vec<V3> = flat.iter().map(|v| [v[0], v[1], 1e-9]).collect();
            prop_assert!((longest(&flat) - longest(&lifted)).abs() < 1e-6);
        }
    }

    #[test]
    fn parallel_vectors_add_up() {
        assert_eq!(longest(&[[3.0, 4.0, 0.0], [-6.0, -8.0, 0.0]]), 15.0);
        assert_eq!(longest(&[[3.0, 0.0, 0.0], [0.0, 4.0, 0.0]]), 5.0);
        assert_eq!(longest(&[]), 0.0);
    }
}
