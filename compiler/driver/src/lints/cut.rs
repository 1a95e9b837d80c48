//! What every feed move is asked.

use gr_canon::At;

use super::{Lints, coolant, feed, spindle, stock, tool, units};

/// A feed move; a move straight up is a retract and cuts nothing.
#[inline]
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>, end: [f64; 3]) {
    units::check(lints, at);
    let from = lints.position;
    stock::cut(lints, from, end);
    let straight_up = end[0] == from[0] && end[1] == from[1] && end[2] >= from[2];
    if !straight_up {
        spindle::check(lints, at);
        tool::check(lints, at);
        coolant::check(lints, at);
        feed::check(lints, at);
    }
}
