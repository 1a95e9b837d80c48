//! Cutting dry. Off unless asked for.

use gr_canon::At;
use gr_spec::code;

use super::{Flags, Lints};

#[inline]
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>) {
    if !lints.flags.has(Flags::DRY_TOLD) && lints.turning != 0 && !lints.mist && !lints.flood {
        lints.flags.set(Flags::DRY_TOLD, true);
        lints.report(code::COOLANT_NONE, at, None, &[]);
    }
}
