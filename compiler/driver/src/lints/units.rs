//! Motion before G20 or G21.

use gr_canon::At;
use gr_gcode::Form;
use gr_interp::Setup;
use gr_spec::code;

use super::{Flags, Lints};

/// Whether the code that the machine runs before any program, [RS274NGC]RS274NGC_STARTUP_CODE, names the unit.
pub(super) fn said_at_start(setup: &Setup) -> bool {
    let Some(code) = setup.ini.get("rs274ngc", "rs274ngc_startup_code").filter(|_| setup.startup_code) else { return false };
    let scan = gr_gcode::scan(code, setup.dialect);
    (0..scan.lines.len() as u32)
        .flat_map(|line| scan.words(line))
        .any(|w| w.letter == b'g' && w.form == Form::Literal && (w.value == 20.0 || w.value == 21.0))
}

#[inline]
pub(super) fn check(lints: &mut Lints<'_>, at: &At<'_>) {
    if !lints.flags.has(Flags::UNITS_DONE) {
        lints.flags.set(Flags::UNITS_DONE, true);
        lints.report(code::UNITS_NOT_STATED, at, None, &[]);
    }
}
