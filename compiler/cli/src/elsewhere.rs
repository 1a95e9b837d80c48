//! What a written program does on a machine that has other values in store than the simulation took for them: work
//! offsets, the one in force, reference points, lengths and diameters of tools. Without files that say them
//! nobody knows them; source and translation are run with values that none of them can mistake for zero, and must go the
//! same way. It is a look from outside: it shares nothing with the writer but the interpreter.

use gr_ir::Source;
use gr_ir::diff::{Aspect, Diff, Tolerance, diff};
use gr_interp::{ASSUMED, Setup};
use gr_spec::{Dialect, Family};
use gr_text::{Diagnostic, code};

use crate::pipeline::{Motion, Unit, motion_of};

/// Where the translation goes another way.
pub fn differs(unit: &Unit, source: &Motion, written: &str, to: &'static Dialect, length: f64) -> Option<Diagnostic> {
    let setup = other(&unit.setup)?;
    let there = gr_driver::lower(&unit.name(), unit.text.clone(), &setup, None);
    let again = motion_of("<translation>", written.to_string(), &Setup { dialect: to, startup_code: true, ..setup });
    // Feeds and times follow from the ways; the numbers of tools are told elsewhere.
    let tolerance = Tolerance { length, rate: 1.0, limit: 50, ..Tolerance::default() };
    let found = diff(&there.program, &again.program, &tolerance);
    let first = found.differences.into_iter().find(|d| d.aspect == Aspect::Path)?;
    let place = first.a.map_or(Source::default(), |(_, s)| s);
    let (file, span) = gr_backends::Sources::place(&crate::emit::texts(source), place);
    Some(Diagnostic::new(code::EMIT_ELSEWHERE, file, span, &[missing(&unit.setup).to_string()]))
}

/// Two programs that go the same way in the simulation, compared as a machine with other values in store runs them.
pub fn compared(same: Diff, units: [&Unit; 2], tolerance: &Tolerance) -> Diff {
    let [Some(a), Some(b)] = units.map(|u| other(&u.setup)) else { return same };
    if units.iter().any(|u| u.setup.dialect.family == Family::Ufmg2008) {
        return same;
    }
    let run = |unit: &Unit, setup: &Setup| gr_driver::lower(&unit.name(), unit.text.clone(), setup, None);
    let found = diff(&run(units[0], &a).program, &run(units[1], &b).program, tolerance);
    let Some(mut first) = found.differences.into_iter().find(|d| d.aspect == Aspect::Path) else { return same };
    let what = if a.params.is_empty() { "lengths of tools" } else { "work offsets, reference points or lengths of tools" };
    first.message = format!("the ways part here where {what} are not zero; {} would say them", missing(&units[0].setup).replace('`', ""));
    let mut out = same;
    out.differences.push(first);
    out.count += 1;
    out
}

/// What no file says.
fn missing(setup: &Setup) -> &'static str {
    match (setup.params.is_empty(), assumes(setup)) {
        (true, true) => "`--vars` and `--tools`",
        (true, false) => "`--vars`",
        _ => "`--tools`",
    }
}

fn assumes(setup: &Setup) -> bool {
    setup.tools.rows.iter().skip(1).any(|t| &*t.comment == ASSUMED)
}

/// The same machine with other values in store; none where files say them all.
fn other(setup: &Setup) -> Option<Setup> {
    let (params, tools) = (setup.params.is_empty(), assumes(setup));
    if !params && !tools {
        return None;
    }
    let mut setup = setup.clone();
    if params {
        // G55 is in force, and no origin is where another is.
        setup.params.insert(5220, 2.0);
        for (k, base) in [5161u32, 5181, 5211].into_iter().chain((1..=9).map(|n| 5201 + 20 * n)).enumerate() {
            for axis in 0..9u32 {
                setup.params.insert(base + axis, 1.5 + 2.25 * k as f64 + 0.75 * f64::from(axis));
            }
        }
        setup.params.insert(5210, 1.0);
    }
    if tools {
        for tool in setup.tools.rows.iter_mut().skip(1).filter(|t| &*t.comment == ASSUMED) {
            let n = f64::from(tool.number % 100);
            tool.offset[2] = 3.5 + 0.25 * n;
            tool.diameter = 0.02 + 0.001 * n;
        }
    }
    Some(setup)
}
