//! How exactly a machine is made and how stiff it is: what its file says in `[accuracy]`, `[stiffness]` and
//! `[as_built]`. Nothing is assumed: what the file doesn't say is absent here, and whoever needs it must say so.

use std::collections::BTreeMap;

/// How far joints and geometry may be off.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Accuracy {
    /// Error of each joint, ± mm or rad; none = not said.
    pub joints: Vec<Option<f64>>,
    /// Grade of ISO 286-1 that every length of the geometry is made to.
    pub grade: Option<u8>,
    /// Tolerances of single parameters, ± mm or rad, by name; they go before the grade.
    pub parameters: BTreeMap<String, f64>,
    /// Where the numbers come from.
    pub source: String,
}

/// Deviations of the geometry that have been measured or identified.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct AsBuilt {
    /// Actual minus nominal, mm or rad, by name of the parameter.
    pub deviations: BTreeMap<String, f64>,
    /// Where the numbers come from.
    pub source: String,
}

/// What yields between the base and the tool, joint by joint.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Stiffness {
    /// Springs in series, in the order of the file.
    pub members: Vec<Member>,
    /// Where the numbers come from.
    pub source: String,
}

/// A spring that acts along or about a joint.
#[derive(Clone, PartialEq, Debug)]
pub struct Member {
    /// Index of the joint.
    pub joint: usize,
    /// For people: `rod`, `nut`, `gear`.
    pub name: String,
    /// How stiff.
    pub spring: Spring,
}

/// Stiffness in N/mm for a sliding joint, N·mm/rad for a turning one.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Spring {
    /// The same everywhere.
    Constant(f64),
    /// A bar: modulus (N/mm²) times area (mm²), and its length, mm.
    Bar(f64, f64),
    /// A screw whose free length is the joint value less this, mm: modulus times area, and the difference.
    Screw(f64, f64),
    /// A screw held at both ends, its nut at the joint value: modulus times area, and the places of the ends, mm.
    Held(f64, (f64, f64)),
}

impl Spring {
    /// Its stiffness at a joint value; none where it has no length left.
    pub fn at(&self, value: f64) -> Option<f64> {
        let k = match *self {
            Spring::Constant(k) => k,
            Spring::Bar(ea, length) => ea / length,
            Spring::Screw(ea, shorter) => ea / (value - shorter),
            Spring::Held(ea, (low, high)) => ea / (value - low) + ea / (high - value),
        };
        (k > 0.0 && k.is_finite()).then_some(k)
    }
}

impl Stiffness {
    /// Stiffness of a joint at a value: its members in series; none when it has no members or one has no length left.
    pub fn joint(&self, joint: usize, value: f64) -> Option<f64> {
        let mut yields = None;
        for m in self.members.iter().filter(|m| m.joint == joint) {
            *yields.get_or_insert(0.0) += 1.0 / m.spring.at(value)?;
        }
        yields.map(|y| 1.0 / y)
    }
}
