//! Cutting with a stopped spindle. Programs that never use the spindle are left alone.

use gr_canon::{At, Call};
use gr_spec::code;

use super::{Flags, Lints};

#[inline]
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>) {
    if lints.turning != 0 || lints.flags.has(Flags::STOPPED_TOLD) {
        return;
    }
    if lints.flags.has(Flags::SPINDLE_USED) {
        lints.flags.set(Flags::STOPPED_TOLD, true);
        lints.report(code::SPINDLE_STOPPED, at, None, &[]);
    } else if !lints.flags.has(Flags::BARE_CUT) {
        // Whether this is a mistake is known only when the spindle is started further down.
        lints.flags.set(Flags::BARE_CUT, true);
        lints.summary.bare_cut = Some(at.into());
    }
}

pub(super) fn watch(lints: &mut Lints<'_>, at: &At<'_>, call: &Call) {
    match call {
        Call::StartSpindleClockwise(n) | Call::StartSpindleCounterclockwise(n) => {
            lints.summary.spindle_starts = true;
            lints.turning |= 1 << (*n & 7);
            lints.flags.set(Flags::SPINDLE_USED, true);
            lints.flags.set(Flags::STOPPED_TOLD, false);
        }
        Call::StopSpindleTurning(n) => {
            let which = if *n < 0 { u8::MAX } else { 1 << (*n & 7) };
            lints.last_stop = Some((at.line, lints.turning & which != 0));
            lints.turning &= !which;
        }
        Call::SetSpindleSpeed(_, speed) if *speed != 0.0 => lints.flags.set(Flags::SPINDLE_USED, true),
        _ => {}
    }
}
