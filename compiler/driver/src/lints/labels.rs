//! Labels of the whole file: N numbers used twice where jumps look for them, subroutines that nobody calls.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use gr_spec::{Code, Family, code};

use super::{Found, Where};
use crate::Options;
use crate::db::{Label, LabelKind, Outline, Shape};

/// The name that other programs call a file by: that of its path, without folder and ending.
pub(crate) fn called_as(path: &str) -> &str {
    Path::new(path).file_stem().and_then(|s| s.to_str()).unwrap_or("")
}

/// Whether a file of this name is where other programs look for the subroutine.
fn is_named_after(stem: &str, name: &str) -> bool {
    // Fanuc programs are often kept as O1000.nc or O0010.nc.
    let number = stem.strip_prefix(['o', 'O']).filter(|n| !n.is_empty()).and_then(|n| n.parse::<u32>().ok());
    stem.eq_ignore_ascii_case(name) || number.is_some_and(|n| n.to_string() == name)
}

/// Whether other programs find a subroutine of this file by the file's name.
pub(crate) fn holds_own_sub(shapes: &[&Shape], stem: &str) -> bool {
    shapes.iter().flat_map(|s| s.labels.iter()).any(|l| l.kind == LabelKind::Sub && is_named_after(stem, &l.name))
}

/// Looks through the labels of all chunks; `stem` as [`called_as`] gives it.
pub(crate) fn labels(shapes: &[&Shape], starts: &[u32], stem: &str, options: &Options, found: &mut Vec<Found>) {
    if shapes.iter().all(|s| s.labels.is_empty()) {
        return;
    }
    let all = || shapes.iter().zip(starts).flat_map(|(s, start)| s.labels.iter().map(move |l| (l, start + l.line)));
    let mut report = |code: Code, line: u32, letter: u8, name: &str| {
        if let Some(severity) = options.rules.severity(code) {
            let place = Where { line, ..Where::default() };
            found.push(Found { code, severity, place, letter: Some(letter), span: None, args: vec![name.to_string()], from: super::From::Lint });
        }
    };
    if options.setup.dialect.family == Family::Fanuc && shapes.iter().any(|s| s.jumps) {
        let mut seen = BTreeSet::new();
        for (label, line) in all() {
            match label.kind {
                // Every program has block numbers of its own.
                LabelKind::Program => seen.clear(),
                LabelKind::Number if !seen.insert(&label.name) => report(code::BLOCK_DUPLICATE_NUMBER, line, b'n', &label.name),
                _ => {}
            }
        }
    }
    unused_subs(all(), shapes, stem, &mut report);
}

fn unused_subs<'a>(
    all: impl Iterator<Item = (&'a Label, u32)>,
    shapes: &[&Shape],
    stem: &str,
    report: &mut impl FnMut(Code, u32, u8, &str),
) {
    let mut subs = BTreeMap::new();
    let mut calls = BTreeSet::new();
    for (label, line) in all {
        match label.kind {
            LabelKind::Sub => _ = subs.entry(&label.name).or_insert(line),
            LabelKind::Call => _ = calls.insert(&label.name),
            LabelKind::Program | LabelKind::Number => {}
        }
    }
    // A library of subroutines is called from elsewhere, and a computed label may be any.
    if shapes.iter().any(|s| s.computed) || !has_main(shapes) {
        return;
    }
    let mut unused: Vec<_> = subs.into_iter().filter(|(name, _)| !calls.contains(name) && !is_named_after(stem, name)).collect();
    unused.sort_by_key(|(_, line)| *line);
    for (name, line) in unused {
        report(code::SUB_UNUSED, line, b'o', &spelled(name));
    }
}

/// The label as the program writes it.
fn spelled(name: &str) -> String {
    let number = !name.is_empty() && name.bytes().all(|b| b.is_ascii_digit() || b == b'.');
    if number { format!("o{name}") } else { format!("o<{name}>") }
}

/// Whether there are blocks outside of subroutine definitions.
pub(crate) fn has_main(shapes: &[&Shape]) -> bool {
    let mut depth = 0;
    shapes.iter().flat_map(|s| s.outline.iter()).any(|kind| {
        match kind {
            Outline::Sub => depth += 1,
            Outline::Endsub => depth -= 1,
            Outline::Blocks => {}
        }
        depth <= 0 && *kind == Outline::Blocks
    })
}
