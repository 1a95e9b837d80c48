//! No G43 between a tool change and the first cut.

use gr_canon::At;
use gr_spec::code;

use super::{Flags, Lints};

pub(super) fn changed(lints: &mut Lints<'_>) {
    lints.flags.set(Flags::LENGTH_OPEN, true);
    lints.tool = lints.selected;
    lints.flags.set(Flags::DRY_TOLD, false);
}

#[inline]
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>) {
    if lints.flags.has(Flags::LENGTH_OPEN) {
        lints.flags.set(Flags::LENGTH_OPEN, false);
        let tool = lints.tool.to_string();
        lints.report(code::TOOL_NO_LENGTH_OFFSET, at, None, &[tool]);
    }
}
