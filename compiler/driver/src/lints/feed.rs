//! A feed per minute left in force as a feed per revolution.

use gr_canon::At;
use gr_spec::code;

use super::{Flags, Lints};

/// More than any cutting tool bears in one revolution, mm.
const MOST: f64 = 10.0;

#[inline]
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>) {
    if lints.feed_per_revolution && !lints.thread && lints.feed * lints.unit() > MOST && !lints.flags.has(Flags::REVOLUTION_TOLD) {
        lints.flags.set(Flags::REVOLUTION_TOLD, true);
        let feed = format!("F{}", lints.feed);
        lints.report(code::FEED_PER_REVOLUTION_TOO_LARGE, at, None, &[feed]);
    }
}
