//! What a machine file may say by mistake: values that are allowed and yet look like another unit. Not what is wrong
//! with it; that is `schema`.

use crate::tree::{self, Node};
use gr_text::{Diagnostic, FileId, Span, code};

/// What is doubtful in a machine file that can be read; nothing for one that can't.
pub fn doubts(file: FileId, text: &str) -> Vec<Diagnostic> {
    let Ok(root) = tree::read(text) else { return Vec::new() };
    let joints = ["joint", "external"].into_iter().flat_map(|key| root.get(key).map_or(&[][..], Node::list));
    joints.filter_map(|j| limits_in_radians(file, j)).collect()
}

/// A full turn each way, in radians, and a little more.
const MOST: f64 = 6.3;

/// Limits of a turning joint that are a round number of degrees if they are taken as radians.
fn limits_in_radians(file: FileId, joint: &Node) -> Option<Diagnostic> {
    if joint.get("type").and_then(Node::text) != Some("revolute") {
        return None;
    }
    let given: Vec<&Node> = ["min", "max"].into_iter().filter_map(|key| joint.get(key)).collect();
    let values: Vec<f64> = given.iter().filter_map(|n| n.number()).collect();
    if values.iter().any(|v| v.abs() > MOST) {
        return None;
    }
    let (node, value) = given.into_iter().zip(values).find(|(_, v)| is_radians(*v))?;
    let clip = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
    let args = [joint.string("name").unwrap_or_default(), format!("{value}"), format!("{:.0}", value.to_degrees())];
    Some(Diagnostic::new(code::MACHINE_RADIANS, file, Span::new(clip(node.span.start), clip(node.span.end)), &args))
}

/// Near a multiple of 5° as radians, and no quarter of a degree as it stands.
fn is_radians(v: f64) -> bool {
    let degrees = v.to_degrees();
    let near = |v: f64, step: f64, slack: f64| (v - libm::round(v / step) * step).abs() <= slack;
    v != 0.0 && near(degrees, 5.0, 0.11) && !near(v, 0.25, 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(limits: &str) -> usize {
        let text = format!("[[joint]]\nname = \"J1\"\ntype = \"revolute\"\n{limits}\n");
        doubts(FileId(0), &text).len()
    }

    #[test]
    fn radians_are_told() {
        for limits in ["min = -3.14\nmax = 3.14", "min = -3.14159265\nmax = 3.14159265", "min = -1.571", "max = 6.2832", "min = -2.618\nmax = 0"] {
            assert_eq!(told(limits), 1, "{limits}");
        }
        // Degrees, small ones too; a limit far off is no radian; a slide has none.
        for limits in ["min = -180\nmax = 180", "min = -3\nmax = 3", "min = -3.14\nmax = 170", "min = -2.5\nmax = 5", "min = -1\nmax = 1.5", ""] {
            assert_eq!(told(limits), 0, "{limits}");
        }
        let slide = "[[joint]]\nname = \"X\"\ntype = \"prismatic\"\nmin = -3.14\nmax = 3.14\n";
        assert!(doubts(FileId(0), slide).is_empty());
        assert!(crate::list().all(|id| doubts(FileId(0), crate::source(id).unwrap_or_default()).is_empty()));
    }
}
