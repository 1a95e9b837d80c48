//! Correcting a program for deviations of the geometry that are known.

use gr_machine::math::{Frame, V3, add, norm, sub};
use gr_machine::{KinematicsError, Machine};

/// The place to command, so that a machine with these deviations (in the order of `Machine::parameters`) puts its
/// tool on the aim. The control computes joints by the nominal geometry. Repeated until nothing is left over; the
/// turn of the tool is commanded as it is.
pub fn compensated(machine: &Machine, deviations: &[f64], aim: &Frame, near: &[f64]) -> Result<Frame, KinematicsError> {
    let nominal = machine.kinematics();
    let real = machine.deviated(deviations);
    let mut command = *aim;
    for _ in 0..12 {
        let left = sub(aim.position, real_place(&*nominal, &*real, &command, near)?);
        command.position = add(command.position, left);
        if norm(left) < 1e-12 * norm(aim.position).max(1.0) {
            break;
        }
    }
    Ok(command)
}

/// Where the tool of the real machine is when the control sends it to `command`.
pub fn real_place(
    nominal: &dyn gr_machine::Kinematics,
    real: &dyn gr_machine::Kinematics,
    command: &Frame,
    near: &[f64],
) -> Result<V3, KinematicsError> {
    let far = |q: &Vec<f64>| q.iter().zip(near).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    let joints = nominal.inverse_frame(command)?.into_iter().map(|s| s.joints);
    let joints = joints.min_by(|a, b| far(a).total_cmp(&far(b))).ok_or(KinematicsError::NoAssembly)?;
    Ok(real.forward_frame(&joints)?.position)
}

/// The deviations a machine file's `[as_built]` says, in the order of `Machine::parameters`; none = only the nominal
/// geometry is known.
pub fn deviations(machine: &Machine) -> Option<Vec<f64>> {
    let known = machine.cell.as_built.as_ref()?;
    Some(machine.parameters().iter().map(|p| known.deviations.get(&p.name).copied().unwrap_or(0.0)).collect())
}
