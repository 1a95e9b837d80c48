//! Outline, folding, selection.

use gr_gcode::{Form, Keyword};
use gr_text::Span;

use super::doc::{Doc, LineOf};
use super::names::{self, label_text};
use crate::{Fold, Item, ItemKind};

/// Entries of an outline: more would be of no use to anybody and slow editors down.
pub const MOST_ITEMS: usize = 2_000;

/// Subroutines, tools and operations of a program: tools hold their operations.
pub fn outline(doc: Doc<'_>) -> Vec<Item> {
    let subs = names::subs(doc);
    let turret = doc.dialect.id == "fanuc-turn";
    let end_of = |line: u32| doc.line(line).map_or(doc.len(), |l| l.span().end);
    let mut items: Vec<Item> = subs
        .iter()
        .map(|s| Item {
            kind: ItemKind::Sub,
            name: label_text(&s.label),
            detail: String::new(),
            range: Span::new(doc.line(s.first).map_or(0, |l| l.span().start), end_of(s.last)),
            span: s.span,
            children: Vec::new(),
        })
        .collect();
    let mut left = MOST_ITEMS.saturating_sub(items.len());
    let mut main: Vec<Item> = Vec::new();
    for (c, chunk) in doc.file.chunks.iter().enumerate() {
        if left == 0 {
            break;
        }
        let bytes = chunk.text.as_bytes();
        let telling = memchr::memchr2(b'(', b';', bytes).is_some() || memchr::memchr2(b'M', b'm', bytes).is_some();
        let telling = telling || turret && memchr::memchr2(b'T', b't', bytes).is_some();
        if !telling {
            continue;
        }
        let first = doc.file.first_lines[c];
        for line in doc.lines(first..first + chunk.scan.lines.len() as u32) {
            let Some(item) = entry(&line, turret) else { continue };
            let inside = subs.iter().position(|s| (s.first..=s.last).contains(&line.line) && s.last > s.first);
            match inside {
                Some(s) if item.kind == ItemKind::Operation => items[s].children.push(item),
                _ => main.push(item),
            }
            left -= 1;
            if left == 0 {
                break;
            }
        }
    }
    for sub in items.iter_mut() {
        let end = sub.range.end + 1;
        stretch(&mut sub.children, end);
    }
    items.extend(nested(doc, main));
    items.sort_by_key(|i| (i.range.start, std::cmp::Reverse(i.range.end)));
    items
}

/// Operations go below the tool change before them, those right before a change below that one; a tool lasts until the
/// next, an operation too.
fn nested(doc: Doc<'_>, flat: Vec<Item>) -> Vec<Item> {
    let mut out: Vec<Item> = Vec::new();
    for mut item in flat {
        let before = match out.last_mut() {
            Some(last) if last.kind == ItemKind::Tool => &mut last.children,
            _ => &mut out,
        };
        if item.kind != ItemKind::Tool {
            before.push(item);
            continue;
        }
        let heads = announcing(doc, before, &item);
        let heads = before.split_off(before.len() - heads);
        if let Some(first) = heads.first() {
            item.range.start = first.range.start;
        }
        item.children = heads;
        out.push(item);
    }
    stretch(&mut out, doc.len());
    for tool in &mut out {
        let end = tool.range.end + 1;
        stretch(&mut tool.children, end);
    }
    out
}

/// How many of the last operations speak of the tool change that follows: comments on lines right below each other, with
/// nothing between them and the change but spindle and coolant.
fn announcing(doc: Doc<'_>, before: &[Item], change: &Item) -> usize {
    const MOST_LINES: u32 = 20;
    let line = |item: &Item| doc.line_at(item.span.start).map_or(0, |l| l.line);
    let own = |i: &&Item| i.kind == ItemKind::Operation;
    let Some(last) = before.last().filter(own).map(line) else { return 0 };
    let other = |l: LineOf<'_>| l.words().iter().any(|w| w.form != Form::Comment && !matches!(w.letter, b'm' | b't' | b's' | b'n'));
    let to = line(change);
    if to.saturating_sub(last) > MOST_LINES || doc.lines(last..to).any(other) {
        return 0;
    }
    before.iter().rev().zip(0u32..).take_while(|(i, n)| own(i) && line(i) + n == last).count()
}

/// Each lasts to the end of the line before the next; `end` is where what follows the last one begins.
fn stretch(items: &mut [Item], end: u32) {
    let mut next = end;
    for item in items.iter_mut().rev() {
        item.range.end = item.range.end.max(next.saturating_sub(1));
        next = item.range.start;
    }
}

/// `turret`: T alone changes the tool, and has its offset in its last two digits; 00 there switches the offset off.
fn entry(line: &LineOf<'_>, turret: bool) -> Option<Item> {
    let words = line.words();
    let tool = line.literal(b't').filter(|t| turret && t.value >= 100.0 && t.value % 100.0 != 0.0);
    if line.has_code(b'm', 60) || tool.is_some() {
        let change = tool.or_else(|| words.iter().find(|w| w.letter == b'm' && w.value == 6.0))?;
        let name = match (tool, line.literal(b't')) {
            (Some(t), _) => format!("T{:04}", t.value),
            (None, Some(t)) => format!("T{}", t.value),
            (None, None) => "tool change".to_string(),
        };
        let detail = words.iter().find(|w| w.form == Form::Comment).map_or(String::new(), |w| comment(line.slice(line.tight(w))));
        let span = line.tight(change);
        return Some(Item { kind: ItemKind::Tool, name, detail, range: line.span(), span, children: Vec::new() });
    }
    let word = words.first().filter(|w| w.form == Form::Comment && words.len() == 1)?;
    let span = line.tight(word);
    let name = comment(line.slice(span));
    let active = name.split_once(',').is_some_and(|(head, _)| gr_spec::comments().iter().any(|c| c.name.eq_ignore_ascii_case(head.trim())));
    if name.is_empty() || active || name.starts_with('%') {
        return None;
    }
    Some(Item { kind: ItemKind::Operation, name, detail: String::new(), range: line.span(), span, children: Vec::new() })
}

fn comment(text: &str) -> String {
    text.trim_matches(['(', ')', ';', ' ', '-', '*', '=', '\t']).to_string()
}

/// Blocks of O-words and macro loops, tools, runs of comments.
pub fn folds(doc: Doc<'_>) -> Vec<Fold> {
    let mut found = Vec::new();
    let mut open: Vec<(u32, Keyword, String)> = Vec::new();
    for (c, chunk) in doc.file.chunks.iter().enumerate().filter(|(_, c)| !c.scan.controls.is_empty()) {
        let first = doc.file.first_lines[c];
        for s in gr_gcode::symbols(&chunk.text, &chunk.scan).statements {
            let (line, label) = (s.line + first, label_text(&s.what.label));
            match s.what.keyword {
                Keyword::Sub | Keyword::If | Keyword::Repeat | Keyword::Do | Keyword::MacroWhile | Keyword::MacroDo => open.push((line, s.what.keyword, label)),
                // The `while` that ends a `do` carries its label.
                Keyword::While if !open.iter().any(|o| o.1 == Keyword::Do && o.2 == label) => open.push((line, Keyword::While, label)),
                Keyword::Endsub | Keyword::Endif | Keyword::Endrepeat | Keyword::Endwhile | Keyword::While | Keyword::MacroEnd => {
                    let at = open.iter().rposition(|o| o.2 == label);
                    if let Some((start, ..)) = at.map(|at| open.remove(at)).filter(|o| o.0 < line) {
                        found.push(Fold { first: start, last: line, comment: false });
                    }
                }
                _ => {}
            }
            if found.len() >= MOST_ITEMS {
                return found;
            }
        }
    }
    for item in outline(doc).iter().filter(|i| i.kind == ItemKind::Tool) {
        let line = |at: u32| doc.line_at(at).map_or(0, |l| l.line);
        let (first, last) = (line(item.range.start), line(item.range.end));
        if last > first {
            found.push(Fold { first, last, comment: false });
        }
    }
    comments(doc, &mut found);
    found.sort_by_key(|f| (f.first, std::cmp::Reverse(f.last)));
    found.dedup();
    found
}

/// Lines that are run more than once, or may be: of loops and subroutines.
pub fn loops(doc: Doc<'_>) -> Vec<std::ops::RangeInclusive<u32>> {
    let (mut open, mut found): (Vec<(u32, Keyword, String)>, Vec<std::ops::RangeInclusive<u32>>) = (Vec::new(), Vec::new());
    for (c, chunk) in doc.file.chunks.iter().enumerate().filter(|(_, c)| !c.scan.controls.is_empty()) {
        let first = doc.file.first_lines[c];
        for s in gr_gcode::symbols(&chunk.text, &chunk.scan).statements {
            let (line, label) = (s.line + first, label_text(&s.what.label));
            let ends = matches!(s.what.keyword, Keyword::Endsub | Keyword::Endrepeat | Keyword::Endwhile | Keyword::While | Keyword::MacroEnd);
            let begun = open.iter().rposition(|o| o.2 == label).filter(|_| ends);
            if let Some((start, ..)) = begun.map(|at| open.remove(at)) {
                found.push(start..=line);
            } else if matches!(s.what.keyword, Keyword::Sub | Keyword::Repeat | Keyword::Do | Keyword::While | Keyword::MacroWhile | Keyword::MacroDo) {
                open.push((line, s.what.keyword, label));
            }
            if found.len() >= MOST_ITEMS {
                return found;
            }
        }
    }
    found
}

/// Two or more lines of nothing but comments.
fn comments(doc: Doc<'_>, found: &mut Vec<Fold>) {
    let mut run: Option<(u32, u32)> = None;
    let mut flush = |run: Option<(u32, u32)>| {
        if let Some((first, last)) = run.filter(|(a, b)| b > a) {
            found.push(Fold { first, last, comment: true });
        }
    };
    let mut left = MOST_ITEMS;
    for (c, chunk) in doc.file.chunks.iter().enumerate() {
        if left == 0 || memchr::memchr2(b'(', b';', chunk.text.as_bytes()).is_none() {
            continue;
        }
        let first = doc.file.first_lines[c];
        for line in doc.lines(first..first + chunk.scan.lines.len() as u32) {
            let words = line.words();
            if words.is_empty() || words.iter().any(|w| w.form != Form::Comment) {
                continue;
            }
            match &mut run {
                Some((_, last)) if *last + 1 == line.line => *last = line.line,
                _ => {
                    flush(run.replace((line.line, line.line)));
                    left = left.saturating_sub(1);
                }
            }
        }
    }
    flush(run);
}

/// Number, word, block, operation or branch, tool, file: each around the one before.
pub fn selections(doc: Doc<'_>, offset: u32) -> Vec<Span> {
    let mut out = Vec::new();
    let Some(line) = doc.line_at(offset) else { return out };
    if let Some(word) = line.word_at(offset) {
        let span = line.tight(word);
        if word.form == Form::Literal && span.end > span.start + 1 && offset > span.start {
            out.push(Span::new(span.start + 1, span.end));
        }
        out.push(span);
    }
    out.push(line.span());
    let span_of = |first: u32, last: u32| {
        Span::new(doc.line(first).map_or(0, |l| l.span().start), doc.line(last).map_or(doc.len(), |l| l.span().end))
    };
    let mut around: Vec<Span> = folds(doc).iter().filter(|f| (f.first..=f.last).contains(&line.line)).map(|f| span_of(f.first, f.last)).collect();
    around.sort_by_key(|s| s.end - s.start);
    out.extend(around);
    out.push(Span::new(0, doc.len()));
    let mut last: Option<Span> = None;
    out.retain(|s| {
        let grows = last.is_none_or(|l| s.start <= l.start && l.end <= s.end && *s != l);
        if grows {
            last = Some(*s);
        }
        grows
    });
    out
}
