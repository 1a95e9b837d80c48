//! What a program makes the machine do, kept so that two versions of it can be compared: an editor offers to rename or
//! to rewrite something only when the program does the same afterwards. Not a check and not motion: findings are kept
//! as codes at lines, and nothing is timed or planned.

use std::sync::Arc;

use gr_canon::{At, Call, FileId, Sink};
use gr_interp::Setup;
use gr_spec::Code;

use crate::stream::{Loaded, Overlay, stream_of};

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deeds {
    calls: Vec<Call>,
    printed: Vec<String>,
    /// What is wrong, with file and line.
    pub faults: Vec<(Code, FileId, u32)>,
}

/// Calls that are kept of a run.
const MOST_CALLS: usize = 300_000;
/// Blocks that are run.
const MOST_BLOCKS: u64 = 3_000_000;

/// Runs a program with texts that go before those on disk. None: it is too long to be compared.
pub fn deeds(path: &str, text: Arc<str>, setup: &Setup, overlay: Overlay) -> Option<Deeds> {
    let mut setup = setup.clone();
    setup.keep_going = true;
    setup.budgets.blocks = setup.budgets.blocks.min(MOST_BLOCKS);
    setup.budgets.calls = setup.budgets.calls.min(MOST_CALLS as u64);
    let ran = stream_of(Loaded::over(path, (&*text).into(), &setup, overlay), &setup, None, Deeds::default());
    let mut deeds = ran.sink;
    if ran.outcome.blocks >= setup.budgets.blocks || deeds.calls.len() >= MOST_CALLS || ran.outcome.calls >= setup.budgets.calls {
        return None;
    }
    deeds.faults = ran.outcome.findings.iter().map(|f| (f.fault.code, f.file, f.line)).collect();
    Some(deeds)
}

impl Sink for Deeds {
    fn call(&mut self, _: &At<'_>, call: &Call) {
        // What is remarked in the text is nothing that the machine does.
        if !matches!(call, Call::Comment(_)) && self.calls.len() < MOST_CALLS {
            self.calls.push(call.clone());
        }
    }
    fn print(&mut self, text: &str) {
        if self.printed.len() < MOST_CALLS {
            self.printed.push(text.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::plain_path;

    fn of(text: &str, overlay: &[(&str, Option<&str>)]) -> Deeds {
        let overlay = overlay.iter().map(|(path, text)| (plain_path(path.as_ref()), text.map(Into::into))).collect();
        deeds("a.ngc", text.into(), &Setup::default(), overlay).expect("short")
    }

    #[test]
    fn names_and_remarks_do_not_matter() {
        assert_eq!(of("#<a>=3 (so)\nG0 X#<a>\nM2\n", &[]), of("#<b>=3 (thus)\nG0 X#<b>\nM2\n", &[]));
        assert_ne!(of("#<a>=3\nG0 X#<a>\nM2\n", &[]), of("#<a>=4\nG0 X#<a>\nM2\n", &[]));
        assert_ne!(of("G0 X1\nM2\n", &[]), of("G0 X1\nG99999\nM2\n", &[]));
    }

    #[test]
    fn texts_go_before_the_disk() {
        let sub = Some("o<deeds_p> sub\nG0 X7\no<deeds_p> endsub\n");
        let found = of("o<deeds_p> call\nM2\n", &[("deeds_p.ngc", sub)]);
        assert!(found.faults.is_empty() && found.calls.iter().any(|c| matches!(c, Call::StraightTraverse(a) if a[0] == 7.0)));
        assert!(!of("o<deeds_p> call\nM2\n", &[("deeds_p.ngc", None)]).faults.is_empty());
    }
}
