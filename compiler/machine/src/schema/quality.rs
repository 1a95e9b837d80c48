//! `[accuracy]`, `[stiffness]` and `[as_built]` of a machine file.

use super::Check;
use crate::keys::suggestion;
use crate::quality::{Accuracy, AsBuilt, Member, Spring, Stiffness};
use crate::tree::Node;
use crate::{JointKind, Machine, Parameter, ParameterKind};
use std::collections::BTreeMap;

impl Check {
    pub(super) fn quality(&mut self, raw: &Node, machine: &mut Machine) {
        let parameters = machine.parameters();
        machine.cell.accuracy = raw.get("accuracy").map(|t| self.accuracy(t, machine, &parameters));
        machine.cell.stiffness = raw.get("stiffness").map(|t| self.stiffness(t, machine));
        machine.cell.as_built = raw.get("as_built").map(|t| AsBuilt {
            deviations: self.by_parameter(t, "deviation", &parameters),
            source: t.string("source").unwrap_or_default(),
        });
    }

    fn accuracy(&mut self, table: &Node, machine: &Machine, parameters: &[Parameter]) -> Accuracy {
        let mut joints = vec![None; machine.joints.len()];
        if let Some(given) = table.get("joints") {
            let values = given.numbers();
            if values.len() != joints.len() {
                self.value(&given.span, format!("{} joint errors for {} joints", values.len(), joints.len()));
            }
            for ((slot, v), j) in joints.iter_mut().zip(values).zip(&machine.joints) {
                if v < 0.0 {
                    self.value(&given.span, format!("the error of joint `{}` is a plus-or-minus value: not below zero", j.name));
                }
                *slot = Some(if j.kind == JointKind::Revolute { v.to_radians() } else { v });
            }
        }
        let tolerances = self.by_parameter(table, "tolerance", parameters);
        Accuracy {
            joints,
            grade: table.value_of("grade").map(|v| v as u8),
            parameters: tolerances,
            source: table.string("source").unwrap_or_default(),
        }
    }

    /// Values by name of a parameter of the geometry, in mm and rad.
    fn by_parameter(&mut self, table: &Node, key: &str, parameters: &[Parameter]) -> BTreeMap<String, f64> {
        let mut out = BTreeMap::new();
        for item in table.get("parameter").map_or(&[][..], Node::list) {
            let (Some(name), Some(value)) = (item.get("name"), item.value_of(key)) else { continue };
            let text = name.text().unwrap_or_default();
            let Some(p) = parameters.iter().find(|p| p.name == text) else {
                let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
                let hint = match suggestion(text, &names) {
                    Some(s) => format!("did you mean `{s}`?"),
                    None => format!("this machine has {}", names.join(", ")),
                };
                self.value(&name.span, format!("there is no parameter `{text}`; {hint}"));
                continue;
            };
            let value = if p.kind == ParameterKind::Angle { value.to_radians() } else { value };
            if out.insert(text.to_string(), value).is_some() {
                self.value(&name.span, format!("`{text}` is given twice"));
            }
        }
        out
    }

    fn stiffness(&mut self, table: &Node, machine: &Machine) -> Stiffness {
        let modulus = table.value_of("modulus");
        let mut members = Vec::new();
        for m in table.get("member").map_or(&[][..], Node::list) {
            let Some(name) = m.get("joint") else { continue };
            let text = name.text().unwrap_or_default();
            let Some(joint) = machine.joints.iter().position(|j| j.name == text) else {
                let names: Vec<&str> = machine.joints.iter().map(|j| j.name.as_str()).collect();
                let hint = suggestion(text, &names).map_or(String::new(), |s| format!("; did you mean `{s}`?"));
                self.value(&name.span, format!("there is no joint `{text}`{hint}"));
                continue;
            };
            if let Some(spring) = self.spring(m, modulus) {
                members.push(Member { joint, name: m.string("name").unwrap_or_default(), spring });
            }
        }
        Stiffness { members, source: table.string("source").unwrap_or_default() }
    }

    fn spring(&mut self, m: &Node, modulus: Option<f64>) -> Option<Spring> {
        const FORMS: [&str; 4] = ["stiffness", "length", "shorter_by", "between"];
        let given: Vec<&str> = FORMS.into_iter().filter(|k| m.get(k).is_some()).collect();
        let [form] = given[..] else {
            self.value(&m.span, "a member has exactly one of `stiffness`, `length`, `shorter_by` and `between`");
            return None;
        };
        if form == "stiffness" {
            return Some(Spring::Constant(m.value_of(form)?));
        }
        let (Some(modulus), Some(outer)) = (modulus.filter(|e| *e > 0.0), m.value_of("outer")) else {
            self.value(&m.span, "a bar or screw needs `outer`, and `modulus` in `[stiffness]`");
            return None;
        };
        let inner = m.value_of("inner").unwrap_or(0.0);
        if !(outer > inner && inner >= 0.0) {
            self.value(&m.span, "`outer` must be greater than `inner`");
            return None;
        }
        let ea = modulus * std::f64::consts::PI / 4.0 * (outer * outer - inner * inner);
        Some(match form {
            "length" => Spring::Bar(ea, m.value_of(form)?),
            "shorter_by" => Spring::Screw(ea, m.value_of(form)?),
            _ => {
                let [low, high] = m.array::<2>(form)?;
                if !(low < high) {
                    self.value(&m.span, "`between` is the lower and the upper end");
                    return None;
                }
                Spring::Held(ea, (low, high))
            }
        })
    }
}
