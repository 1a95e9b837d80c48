//! STEP-NC files among the sources: which they are, and what there is to say about one.

use std::path::Path;

use gr_text::{Diagnostic, Severity};

use super::check::Checked;
use crate::setup::Levels;
use crate::sources::Sources;

/// Whether a file is an exchange file: it says so in its first line, or has one of its endings and begins like one.
pub fn is_exchange(path: &Path, text: &str) -> bool {
    let start = text.trim_start_matches(|c: char| c <= ' ' || c == '\u{FEFF}');
    let dense: String = start.chars().take(64).filter(|c| *c > ' ').collect();
    if dense.starts_with("ISO-10303-21") {
        return true;
    }
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match ending.as_str() {
        "p21" | "stpnc" => true,
        "stp" | "step" => dense.starts_with("HEADER") || dense.starts_with("DATA;") || dense.starts_with("/*"),
        _ => false,
    }
}

/// Part 21, schema, rules and lints of a file.
pub fn check(name: &str, text: &str, levels: &Levels) -> Checked {
    let mut sources = Sources::default();
    let file = sources.add(name, text);
    let mut found = gr_step::diagnostics(text, file);
    found.retain_mut(|d| kept(d, levels));
    Checked { sources, found, more: 0, unreadable: false }
}

/// Lints as options and project want them.
fn kept(d: &mut Diagnostic, levels: &Levels) -> bool {
    if d.code.def().lint {
        if levels.allow.contains(&d.code) {
            return false;
        }
        if levels.deny.contains(&d.code) {
            d.severity = Severity::Error;
        } else if levels.warn.contains(&d.code) && d.severity == Severity::Hint {
            d.severity = Severity::Warning;
        }
    }
    levels.harden(d);
    true
}
