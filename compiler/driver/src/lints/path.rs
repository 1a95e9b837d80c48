//! G64 P so small that it is slower than G61.

use gr_canon::{At, PathMode};
use gr_spec::code;

use super::Lints;

/// Below this (mm) nothing is blended, but half of the acceleration is still kept in reserve.
const LEAST: f64 = 0.005;

pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>, mode: PathMode) {
    if let PathMode::Continuous(tolerance) = mode
        && tolerance > 0.0
        && tolerance * lints.unit() < LEAST
    {
        lints.report(code::PATH_TOLERANCE_TOO_SMALL, at, Some(b'p'), &[format!("P{tolerance}")]);
    }
}
