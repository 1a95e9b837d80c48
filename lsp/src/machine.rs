//! The chosen machine along a program: joint values of the plan that a build would make.

use gr_backends::plot::Trace;
use gr_backends::plot::trace::{Class, JUMP, TraceMachine};
use gr_machine::Machine;
use gr_machine::math::Frame;
use gr_robot::Planned;
use gr_robot::along::{PathPoint, Stand, Sweep, Walk, nearest, swept};
use gr_text::{Diagnostic, Severity};

/// Why there is no plan, in one sentence.
pub fn reason(found: &[Diagnostic]) -> String {
    found.iter().find(|d| d.severity == Severity::Error).map_or("it can't be planned".into(), |d| d.message.clone())
}

/// Puts the machine into a picture of a path, and bends its joint rapids. `planned`: the plan, or why there is none; none
/// for machines whose joint values follow from each place alone.
pub fn along(machine: &Machine, planned: Option<Result<&Planned, String>>, trace: &mut Trace) {
    trace.machine = Some(match planned {
        Some(Err(why)) => TraceMachine::new(machine, why),
        Some(Ok(planned)) => match Walk::new(planned) {
            Err(_) => TraceMachine::new(machine, "the path has too many joint positions to be shown".into()),
            Ok(walk) => {
                let work = planned.program.frames.first().map_or_else(|| machine.cell.part_in_base(), |f| f.frame);
                bend(trace, &walk.sweeps(&points(trace)), &work);
                standing(machine, &work, &walk.stands(&points(trace)), String::new())
            }
        },
        None => {
            let work = machine.cell.part_in_base();
            let straight = points(trace);
            let mut stands = nearest(machine, &straight);
            let sweeps = swept(machine, &straight, &stands);
            if !sweeps.is_empty() {
                bend(trace, &sweeps, &work);
                stands = nearest(machine, &points(trace));
            }
            standing(machine, &work, &stands, "of several solutions the nearest".into())
        }
    });
}

fn points(trace: &Trace) -> Vec<PathPoint> {
    let one = |i: usize| PathPoint {
        place: trace.positions[i],
        source: trace.sources[i],
        joined: trace.kinds[i] != JUMP,
        rapid: trace.kinds[i] == Class::Rapid as u8,
    };
    (0..trace.positions.len()).map(one).collect()
}

fn bend(trace: &mut Trace, sweeps: &[Sweep], work: &Frame) {
    let back = work.inverse();
    let places = |s: &Sweep| (s.point, s.places.iter().map(|p| back.apply(*p)).collect());
    trace.bend(&sweeps.iter().map(places).collect::<Vec<_>>());
}

fn standing(machine: &Machine, work: &Frame, stands: &[Option<Stand>], note: String) -> TraceMachine {
    let count = machine.joints.len();
    let stand = |i: usize| stands.get(i).copied().flatten().map(|s| (s.joints[..count.min(s.joints.len())].to_vec(), s.tip));
    TraceMachine::new(machine, note).along(machine, work, stands.len(), &stand)
}
/// `J1 12.4°`
pub fn show(machine: &Machine, joints: &[f64]) -> Vec<String> {
    machine.joints.iter().zip(joints).map(|(j, v)| format!("{} {}", j.name, j.show(*v))).collect()
}
