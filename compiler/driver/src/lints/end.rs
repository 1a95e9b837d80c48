//! What is still on when the program ends.

use gr_canon::At;
use gr_interp::Modal;
use gr_spec::{Code, Severity, code};

use super::{Found, Lints, Rules, Where};

/// M2 or M30. They stop the spindle here, other controllers let it turn: a hint only.
pub(super) fn program_end(lints: &mut Lints<'_>, at: &At<'_>) {
    if lints.stopped_by_end(at.line) {
        let before = lints.found.len();
        lints.report(code::END_SPINDLE_ON, at, None, &[]);
        if let Some(found) = lints.found.get_mut(before) {
            found.severity = milder(found.severity);
        }
    }
    if lints.compensation {
        lints.report(code::END_COMPENSATION_ON, at, None, &[]);
    }
}

fn milder(severity: Severity) -> Severity {
    if severity == Severity::Warning { Severity::Hint } else { severity }
}

/// The program ended by `%` or just stopped: everything stays as it is.
pub(crate) fn left_on(state: &Modal, place: Where, rules: &Rules) -> Vec<Found> {
    let found = |code: Code| {
        Some(Found { code, severity: rules.severity(code)?, place, letter: None, span: None, args: Vec::new(), from: super::From::Lint })
    };
    let turning = state.turning.iter().any(|t| *t != 0);
    let spindle = turning.then(|| found(code::END_SPINDLE_ON)).flatten();
    let compensation = (state.comp_side != 0).then(|| found(code::END_COMPENSATION_ON)).flatten();
    spindle.into_iter().chain(compensation).collect()
}
