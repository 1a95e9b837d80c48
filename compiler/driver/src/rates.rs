//! What the machine of an INI file can do, for predicted times.

use gr_interp::{Ini, Setup};
use gr_ir::Units;
use gr_ir::measure::Rates;
use gr_ir::timing::Dynamics;

/// Rates of a setup: what its INI file says of speeds and accelerations. Without those, general ones.
pub fn rates(setup: &Setup) -> Rates {
    let dynamics = dynamics(&setup.ini);
    Rates { dynamics: dynamics.has_speeds().then_some(dynamics), ..Rates::default() }
}

fn dynamics(ini: &Ini) -> Dynamics {
    let unit = if ini.machine_units() == Some(Units::Inch) { 25.4 } else { 1.0 };
    let positive = |section: &str, key: &str| ini.number(section, key).filter(|v| v.is_finite() && *v > 0.0);
    let mut d = Dynamics::default();
    for (i, name) in "XYZABCUVW".chars().enumerate() {
        let scale = if (3..6).contains(&i) { 1f64.to_radians() } else { unit };
        // Before version 2.8 the axis sections were called by number; such files have no joints apart from axes.
        let read = |key: &str| positive(&format!("AXIS_{name}"), key).or_else(|| positive(&format!("AXIS_{i}"), key));
        d.velocity[i] = read("MAX_VELOCITY").map_or(f64::INFINITY, |v| v * scale);
        d.acceleration[i] = read("MAX_ACCELERATION").map_or(f64::INFINITY, |v| v * scale);
    }
    let tip = positive("TRAJ", "MAX_LINEAR_VELOCITY").or_else(|| positive("TRAJ", "MAX_VELOCITY"));
    d.tip = tip.map_or(f64::INFINITY, |v| v * unit);
    d.cycle = positive("EMCMOT", "SERVO_PERIOD").map_or(d.cycle, |ns| ns * 1e-9);
    d.overrides = positive("DISPLAY", "MAX_FEED_OVERRIDE").unwrap_or(d.overrides);
    d.arcs = ini.number("TRAJ", "ARC_BLEND_ENABLE").is_none_or(|v| v != 0.0);
    let whole = |v: f64| v.clamp(1.0, 1e6) as usize;
    d.look_ahead = positive("TRAJ", "ARC_BLEND_OPTIMIZATION_DEPTH").map_or(d.look_ahead, whole);
    d.gap = ini.number("TRAJ", "ARC_BLEND_GAP_CYCLES").filter(|v| *v >= 0.0).unwrap_or(d.gap);
    d.ramp = positive("TRAJ", "ARC_BLEND_RAMP_FREQ").map_or(d.ramp, |hz| 1.0 / hz);
    d.kink = positive("TRAJ", "ARC_BLEND_KINK_RATIO").unwrap_or(d.kink);
    d
}
