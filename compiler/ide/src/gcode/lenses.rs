//! Remarks above lines: time, way and travel of tools and subroutines, and how often these are called.

use std::collections::BTreeMap;
use std::rc::Rc;

use gr_ir::geometry::Extent;
use gr_ir::measure::{Rates, Report, Totals};
use gr_ir::timing::Clock;
use gr_ir::{FileId, FrameId, Program};

use super::doc::{Doc, duration, number};
use super::names::{self, label_text};
use crate::Lens;

/// Lenses of a program that was run. `calls_elsewhere`: calls of a label in other files.
pub fn lenses(doc: Doc<'_>, program: Option<(&Program, FileId, &Report, &Rates)>, calls_elsewhere: &dyn Fn(&str) -> usize) -> Vec<Lens> {
    let mut found = Vec::new();
    if let Some((program, main, report, rates)) = program {
        if report.totals.moves > 0 {
            found.push(Lens { line: 0, text: format!("program: {}", sums(&report.totals, &report.cut)) });
        }
        for t in report.tools.iter().filter(|t| t.changes > 0 && t.tool > 0 && t.first.file == main) {
            let changes = if t.changes > 1 { format!(", {} times", t.changes) } else { String::new() };
            found.push(Lens { line: t.first.line, text: format!("T{}: {}{changes}", t.tool, sums(&t.totals, &t.cut)) });
        }
        let by_sub = per_sub(program, rates);
        for s in names::subs(doc) {
            let name = label_text(&s.label);
            if let Some((runs, totals, cut)) = by_sub.get(&name) {
                found.push(Lens { line: s.first, text: format!("run {runs} times: {}", sums(totals, cut)) });
            }
        }
    }
    let calls = names::calls(doc);
    for s in names::subs(doc) {
        let name = label_text(&s.label);
        let own = calls.iter().filter(|c| c.label == s.label).count();
        let n = own + calls_elsewhere(&name);
        // Nobody calls a main program.
        if n > 0 || !s.heads_file {
            found.push(Lens { line: s.first, text: if n == 1 { "1 call".into() } else { format!("{n} calls") } });
        }
    }
    found.sort_by_key(|l| l.line);
    found
}

fn sums(t: &Totals, cut: &Extent) -> String {
    let mut parts = vec![duration(t.seconds())];
    if t.feed_nm > 0 {
        parts.push(format!("{} mm at feed", number(t.feed_nm as f64 / 1e6, 0)));
    }
    if t.rapid_nm > 0 {
        parts.push(format!("{} mm rapid", number(t.rapid_nm as f64 / 1e6, 0)));
    }
    if !cut.is_empty() {
        let axis = |i: usize, a: char| format!("{a} {} … {}", number(cut.min[i], 2), number(cut.max[i], 2));
        parts.push(format!("{}, {}, {}", axis(0, 'X'), axis(1, 'Y'), axis(2, 'Z')));
    }
    if t.untimed > 0 {
        parts.push(format!("{} moves without feed not counted", t.untimed));
    }
    parts.join(", ")
}

/// What each subroutine comes to, all its runs together, called ones inside it included.
fn per_sub(program: &Program, rates: &Rates) -> BTreeMap<String, (usize, Totals, Extent)> {
    let mut out: BTreeMap<String, (usize, Totals, Extent)> = BTreeMap::new();
    // Names of the subroutines on the way to a frame.
    let mut chains: BTreeMap<FrameId, Rc<Vec<String>>> = BTreeMap::new();
    for frame in program.frames.iter() {
        let mut chain = chains.get(&frame.parent).cloned().unwrap_or_default();
        if frame.pass == 0 {
            let name = sub_name(program.frames.name(frame));
            out.entry(name.clone()).or_default().0 += 1;
            if !chain.contains(&name) {
                Rc::make_mut(&mut chain).push(name);
            }
        }
        chains.insert(frame.id, chain);
    }
    if chains.is_empty() {
        return out;
    }
    let clock = Clock::new(program, rates);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        let Some(chain) = chains.get(&view.source.frame).filter(|c| !c.is_empty()) else { continue };
        let t = clock.measure(&view);
        for name in chain.iter() {
            if let Some((_, totals, cut)) = out.get_mut(name) {
                totals.add(&t);
                if view.op.feeds() {
                    cut.add_move(&view.op, view.start, view.end);
                }
            }
        }
    }
    out
}

/// `sub name` or `sub 100` as a label.
fn sub_name(name: &str) -> String {
    let bare = name.strip_prefix("sub ").unwrap_or(name).trim_start_matches(['o', 'O']).trim_matches(['<', '>']);
    if bare.bytes().all(|b| b.is_ascii_digit()) { format!("o{bare}") } else { format!("o<{bare}>") }
}
