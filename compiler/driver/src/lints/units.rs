//! Motion before G20 or G21.

use gr_canon::At;
use gr_spec::code;

use super::{Flags, Lints};

#[inline]
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>) {
    if !lints.flags.has(Flags::UNITS_DONE) {
        lints.flags.set(Flags::UNITS_DONE, true);
        lints.report(code::UNITS_NOT_STATED, at, None, &[]);
    }
}
