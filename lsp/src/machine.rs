//! The chosen machine along a program: joint values of the plan that a build would make.

use gr_backends::plot::Trace;
use gr_backends::plot::trace::{JUMP, TraceMachine};
use gr_machine::Machine;
use gr_robot::Planned;
use gr_robot::along::{PathPoint, Stand, nearest};
use gr_text::{Diagnostic, Severity};

/// Why there is no plan, in one sentence.
pub fn reason(found: &[Diagnostic]) -> String {
    found.iter().find(|d| d.severity == Severity::Error).map_or("it can't be planned".into(), |d| d.message.clone())
}

/// The machine for a picture of a path. `planned`: the plan, or why there is none; none for machines whose joint values
/// follow from each place alone.
pub fn along(machine: &Machine, planned: Option<Result<&Planned, String>>, trace: &Trace) -> TraceMachine {
    let points: Vec<PathPoint> = (0..trace.positions.len())
        .map(|i| PathPoint { place: trace.positions[i], source: trace.sources[i], joined: trace.kinds[i] != JUMP })
        .collect();
    let (stands, work, note): (Vec<Option<Stand>>, _, String) = match planned {
        Some(Err(why)) => return TraceMachine::new(machine, why),
        Some(Ok(planned)) => match gr_robot::along::along(planned, &points) {
            Err(_) => return TraceMachine::new(machine, "the path has too many joint positions to be shown".into()),
            Ok(stands) => {
                let first = planned.program.frames.first().map(|f| f.frame);
                (stands, first.unwrap_or_else(|| machine.cell.part_in_base()), String::new())
            }
        },
        None => (nearest(machine, &points), machine.cell.part_in_base(), "of several solutions the nearest".into()),
    };
    let count = machine.joints.len();
    let stand = |i: usize| stands.get(i).copied().flatten().map(|s| (s.joints[..count.min(s.joints.len())].to_vec(), s.tip));
    TraceMachine::new(machine, note).along(machine, &work, points.len(), &stand)
}

/// `J1 12.4°`
pub fn show(machine: &Machine, joints: &[f64]) -> Vec<String> {
    machine.joints.iter().zip(joints).map(|(j, v)| format!("{} {}", j.name, j.show(*v))).collect()
}
