//! Moves beyond the travel limits of the INI file.

use gr_canon::{At, Plane, Units};
use gr_interp::Ini;
use gr_spec::code;

use super::{Flags, Lints};

/// Limits of X, Y and Z in mm; infinite where the INI file says nothing.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Limits {
    low: [f64; 3],
    high: [f64; 3],
    any: bool,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits { low: [f64::NEG_INFINITY; 3], high: [f64::INFINITY; 3], any: false }
    }
}

const NAMES: [&str; 3] = ["X", "Y", "Z"];

impl Limits {
    /// Reads `[AXIS_X] MIN_LIMIT`, `MAX_LIMIT` and so on.
    pub(crate) fn of(ini: &Ini) -> Limits {
        let unit = if ini.machine_units() == Some(Units::Inch) { 25.4 } else { 1.0 };
        let mut limits = Limits::default();
        for (i, name) in NAMES.iter().enumerate() {
            let section = format!("AXIS_{name}");
            if let Some(v) = ini.number(&section, "MIN_LIMIT") {
                (limits.low[i], limits.any) = (v * unit, true);
            }
            if let Some(v) = ini.number(&section, "MAX_LIMIT") {
                (limits.high[i], limits.any) = (v * unit, true);
            }
        }
        limits
    }
}

/// Rounding of a unit conversion is not a crash.
const SLACK: f64 = 1e-6;

/// The end point of a move.
#[inline]
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>, end: [f64; 3]) {
    if lints.rules.limits.any {
        let point = machine(lints, end);
        compare(lints, at, point, point);
    }
}

/// End point and far sides of an arc.
pub(super) fn check_arc(lints: &mut Lints<'_>, at: &At<'_>, end: [f64; 3], centre: [f64; 2], rotation: i32) {
    if !lints.rules.limits.any {
        return;
    }
    // A turned frame shows its extremes elsewhere: then only the end point is compared.
    let (low, high) = if lints.rotation == 0.0 { extremes(lints, end, centre, rotation) } else { (end, end) };
    let (low, high) = (machine(lints, low), machine(lints, high));
    compare(lints, at, low, high);
}

/// Lowest and highest coordinates along an arc.
fn extremes(lints: &Lints<'_>, end: [f64; 3], centre: [f64; 2], rotation: i32) -> ([f64; 3], [f64; 3]) {
    let from = lints.position;
    let (first, second) = match lints.plane {
        Plane::Yz | Plane::Vw => (1, 2),
        Plane::Xz | Plane::Uw => (2, 0),
        Plane::Xy | Plane::Uv => (0, 1),
    };
    let mut low = [0, 1, 2].map(|i: usize| from[i].min(end[i]));
    let mut high = [0, 1, 2].map(|i: usize| from[i].max(end[i]));
    let angle = |p: [f64; 3]| libm::atan2(p[second] - centre[1], p[first] - centre[0]);
    let radius = libm::hypot(end[first] - centre[0], end[second] - centre[1]);
    let turn = std::f64::consts::TAU;
    let (a, b) = if rotation >= 0 { (angle(from), angle(end)) } else { (angle(end), angle(from)) };
    let sweep = if rotation.abs() > 1 || (b - a).abs() < 1e-9 { turn } else { (b - a).rem_euclid(turn) };
    for (quarter, (axis, sign)) in [(first, 1.0), (second, 1.0), (first, -1.0), (second, -1.0)].into_iter().enumerate() {
        let at = quarter as f64 * std::f64::consts::FRAC_PI_2;
        if (at - a).rem_euclid(turn) <= sweep {
            let c = if axis == first { centre[0] } else { centre[1] };
            low[axis] = low[axis].min(c + sign * radius);
            high[axis] = high[axis].max(c + sign * radius);
        }
    }
    (low, high)
}

/// Program frame and units to machine frame in mm.
fn machine(lints: &Lints<'_>, p: [f64; 3]) -> [f64; 3] {
    let mut q = [0, 1, 2].map(|i: usize| p[i] + lints.g92[i]);
    if lints.rotation != 0.0 {
        let (sin, cos) = libm::sincos(lints.rotation.to_radians());
        q = [q[0] * cos - q[1] * sin, q[0] * sin + q[1] * cos, q[2]];
    }
    [0, 1, 2].map(|i: usize| (q[i] + lints.origin[i] + lints.tool_offset[i]) * lints.unit())
}

fn compare(lints: &mut Lints<'_>, at: &At<'_>, low: [f64; 3], high: [f64; 3]) {
    let limits = lints.rules.limits;
    for i in 0..3 {
        let sides = [(low[i] < limits.low[i] - SLACK, low[i], limits.low[i]), (high[i] > limits.high[i] + SLACK, high[i], limits.high[i])];
        for (side, (beyond, value, limit)) in sides.into_iter().enumerate() {
            let bit = Flags::BEYOND << (2 * i + side);
            if beyond && !lints.flags.has(bit) {
                let letter = NAMES[i].as_bytes()[0].to_ascii_lowercase();
                let args = [NAMES[i].to_string(), format!("{} mm", round(value)), format!("{} mm", round(limit))];
                lints.report(code::TRAVEL_BEYOND_LIMIT, at, Some(letter), &args);
            }
            lints.flags.set(bit, beyond);
        }
    }
}

fn round(v: f64) -> f64 {
    (v * 1e4).round() / 1e4
}
