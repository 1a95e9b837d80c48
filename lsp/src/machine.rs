//! Joint values of the chosen machine for a place of the tool.

use gr_machine::{JointKind, Machine, Pose};

/// Joint values (mm, rad) for X Y Z in the part's frame with the tool upright; the solution nearest to `near`.
pub fn joints(machine: &Machine, xyz: [f64; 3], near: Option<&[f64]>) -> Option<Vec<f64>> {
    let pose = Pose { position: xyz, ..machine.start.clone() };
    let solutions = machine.kinematics().inverse(&pose).ok()?;
    let far = |joints: &[f64]| -> f64 { near.map_or(0.0, |n| joints.iter().zip(n).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)) };
    let allowed = solutions.into_iter().map(|s| s.joints).filter(|j| machine.outside(j).is_empty());
    allowed.min_by(|a, b| far(a).total_cmp(&far(b)))
}

/// `J1 12.4°`
pub fn show(machine: &Machine, joints: &[f64]) -> Vec<String> {
    machine.joints.iter().zip(joints).map(|(j, v)| format!("{} {}", j.name, j.show(*v))).collect()
}

/// A value in degrees or mm.
pub fn in_units(kind: JointKind, value: f64) -> f64 {
    if kind == JointKind::Revolute { value.to_degrees() } else { value }
}
