//! Moves beyond the travel limits of the INI file.

use gr_canon::{At, Axes, Plane, Units};
use gr_interp::Ini;
use gr_spec::code;

use super::{Flags, Lints};

/// Limits of the axes in mm and degrees; infinite where the INI file says nothing.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Limits {
    low: Axes,
    high: Axes,
    any: bool,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits { low: [f64::NEG_INFINITY; 9], high: [f64::INFINITY; 9], any: false }
    }
}

const NAMES: [&str; 9] = ["X", "Y", "Z", "A", "B", "C", "U", "V", "W"];

fn is_rotary(axis: usize) -> bool {
    (3..6).contains(&axis)
}

impl Limits {
    /// Reads `[AXIS_X] MIN_LIMIT`, `MAX_LIMIT` and so on.
    pub(crate) fn of(ini: &Ini) -> Limits {
        let unit = if ini.machine_units() == Some(Units::Inch) { 25.4 } else { 1.0 };
        let mut limits = Limits::default();
        for (i, name) in NAMES.iter().enumerate() {
            let section = format!("AXIS_{name}");
            let unit = if is_rotary(i) { 1.0 } else { unit };
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
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>, end: &Axes) {
    if lints.rules.limits.any {
        let point = machine(lints, end);
        compare(lints, at, &point, &point);
    }
}

/// The end point of a move of X, Y and Z alone.
pub(super) fn check_xyz(lints: &mut Lints<'_>, at: &At<'_>, end: [f64; 3]) {
    if lints.rules.limits.any {
        let point = machine(lints, &with(end, &[0.0; 6]));
        compare(lints, at, &point[..3], &point[..3]);
    }
}

fn with([x, y, z]: [f64; 3], rest: &[f64; 6]) -> Axes {
    let [a, b, c, u, v, w] = *rest;
    [x, y, z, a, b, c, u, v, w]
}

/// End point and far sides of an arc.
pub(super) fn check_arc(lints: &mut Lints<'_>, at: &At<'_>, end: [f64; 3], rest: &[f64; 6], centre: [f64; 2], rotation: i32) {
    if !lints.rules.limits.any {
        return;
    }
    // A turned frame shows its extremes elsewhere: then only the end point is compared.
    let (low, high) = if lints.rotation == 0.0 { extremes(lints, end, centre, rotation) } else { (end, end) };
    let (low, high) = (machine(lints, &with(low, rest)), machine(lints, &with(high, rest)));
    compare(lints, at, &low, &high);
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

/// Program frame and units to machine frame in mm and degrees.
fn machine(lints: &Lints<'_>, p: &Axes) -> Axes {
    let mut q: Axes = std::array::from_fn(|i| p[i] + lints.g92[i]);
    if lints.rotation != 0.0 {
        let (sin, cos) = libm::sincos(lints.rotation.to_radians());
        (q[0], q[1]) = (q[0] * cos - q[1] * sin, q[0] * sin + q[1] * cos);
    }
    std::array::from_fn(|i| (q[i] + lints.origin[i] + lints.tool_offset[i]) * if is_rotary(i) { 1.0 } else { lints.unit() })
}

fn compare(lints: &mut Lints<'_>, at: &At<'_>, low: &[f64], high: &[f64]) {
    let limits = lints.rules.limits;
    for i in 0..low.len() {
        let unit = if is_rotary(i) { "°" } else { " mm" };
        let sides = [(low[i] < limits.low[i] - SLACK, low[i], limits.low[i]), (high[i] > limits.high[i] + SLACK, high[i], limits.high[i])];
        for (side, (beyond, value, limit)) in sides.into_iter().enumerate() {
            let bit = Flags::BEYOND << (2 * i + side);
            if beyond && !lints.flags.has(bit) {
                let letter = NAMES[i].as_bytes()[0].to_ascii_lowercase();
                let args = [NAMES[i].to_string(), format!("{}{unit}", round(value)), format!("{}{unit}", round(limit))];
                lints.report(code::TRAVEL_BEYOND_LIMIT, at, Some(letter), &args);
            }
            lints.flags.set(bit, beyond);
        }
    }
}

fn round(v: f64) -> f64 {
    (v * 1e4).round() / 1e4
}
