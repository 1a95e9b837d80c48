//! Findings for people: the source line with what is wrong marked in it, notes, help.

use std::collections::BTreeMap;
use std::io::Write;

use ariadne::{Color, Config, IndexType, Report, ReportKind, Source};
use gr_text::{Diagnostic, FileId, Label, Severity};

use crate::sources::{Positions, Sources, floor};

/// Longer lines are cut down to the stretch around their labels.
const WIDTH: usize = 120;
/// Bytes kept on each side of a label of a long line.
const MARGIN: usize = 60;
/// Labels further from the first one than this many lines are told in words.
const REACH: u32 = 2000;
/// Frames of a call trace that are told.
const FRAMES: usize = 8;

pub fn write(out: &mut Vec<u8>, sources: &Sources, positions: &mut Positions, d: &Diagnostic, color: bool) {
    let mut notes = d.notes.clone();
    let mut excerpts: BTreeMap<FileId, Excerpt> = BTreeMap::new();
    let mut labels = Vec::new();
    let first_line = d.labels.first().map_or(0, |l| positions.of(sources, l.file, l.span.start).0);
    for label in &d.labels {
        let (line, column) = positions.of(sources, label.file, label.span.start);
        let near = label.file == d.primary().0 && line.abs_diff(first_line) < REACH;
        if near || excerpts.is_empty() || label.file != d.primary().0 {
            excerpts.entry(label.file).or_default().want(line - 1, label);
            labels.push(label);
        } else {
            notes.push(format!("{}:{line}:{column}: {}", sources.name(label.file), label.text));
        }
    }
    trace(&mut notes, sources, positions, d);
    for (file, excerpt) in &mut excerpts {
        excerpt.build(sources, positions, *file);
    }
    let primary = d.labels.first().filter(|l| sources.get(l.file).is_some_and(|f| !f.text.is_empty()));
    if primary.is_none() {
        return plain(out, d, &notes, color);
    }
    report(out, sources, &excerpts, &labels, &notes, d, color);
    out.push(b'\n');
}

fn report(
    out: &mut Vec<u8>,
    sources: &Sources,
    excerpts: &BTreeMap<FileId, Excerpt>,
    labels: &[&Label],
    notes: &[String],
    d: &Diagnostic,
    color: bool,
) {
    let paint = color_of(d.severity);
    let kind = ReportKind::Custom(super::word(d.severity), paint);
    let place = |l: &Label| {
        let range = excerpts.get(&l.file).map_or(0..0, |e| e.range(l));
        (sources.name(l.file).to_string(), range)
    };
    let config = Config::new().with_index_type(IndexType::Byte).with_color(color).with_tab_width(4);
    let mut builder = Report::build(kind, labels.first().map_or((String::new(), 0..0), |l| place(l)))
        .with_config(config)
        .with_code(d.code.def().code)
        .with_message(printable(&d.message));
    // ariadne draws labels of a file in one piece when they come in the order of their lines.
    let mut sorted: Vec<(usize, &&Label)> = labels.iter().enumerate().collect();
    let primary_file = d.primary().0;
    sorted.sort_by_key(|(_, l)| (l.file != primary_file, l.file, l.span.start));
    for (i, label) in sorted {
        let mut shown = ariadne::Label::new(place(label)).with_color(if i == 0 { paint } else { Color::Blue });
        if !label.text.is_empty() {
            shown = shown.with_message(printable(&label.text));
        } else if i == 0 {
            // Without a word ariadne marks the place by color only.
            shown = shown.with_message("here");
        }
        builder.add_label(shown);
    }
    for note in notes {
        builder.add_note(printable(note));
    }
    if let Some(help) = &d.help {
        builder.add_help(printable(help));
    }
    // Of several readings none is the one; what the help says already is not said again.
    if let [fix] = d.fixes.as_slice()
        && !d.help.as_ref().is_some_and(|h| h.contains(&fix.title))
    {
        builder.add_help(printable(&fix.title));
    }
    let files = excerpts.iter().map(|(f, e)| {
        let source = Source::from(e.text.clone()).with_display_line_offset(e.first as usize);
        (sources.name(*f).to_string(), source)
    });
    let mut text = Vec::new();
    let _ = builder.finish().write(Files(files.collect()), &mut text);
    let offsets: Vec<(String, u32)> = excerpts.iter().map(|(f, e)| (format!("─[ {}:", sources.name(*f)), e.first)).collect();
    out.extend_from_slice(renumbered(&String::from_utf8_lossy(&text), &offsets, color).as_bytes());
}

/// ariadne numbers the lines of an excerpt from 1: puts the real numbers in, and widens the margin for them.
fn renumbered(text: &str, offsets: &[(String, u32)], color: bool) -> String {
    let plain: Vec<String> = text.lines().map(without_colors).collect();
    let margin = |line: &str| line.split_once('│').map(|(m, _)| m.trim().to_string()).and_then(|m| m.parse::<u32>().ok());
    let mut offset = 0;
    let mut numbers = Vec::new();
    for line in &plain {
        if let Some((_, first)) = offsets.iter().find(|(head, _)| line.contains(head)) {
            offset = *first;
        }
        numbers.push(margin(line).map(|n| (n, n + offset)));
    }
    let digits = |n: u32| n.to_string().len();
    let old = numbers.iter().flatten().map(|(n, _)| digits(*n)).max().unwrap_or(1);
    let extra = numbers.iter().flatten().map(|(_, n)| digits(*n)).max().unwrap_or(1).saturating_sub(old);
    let mut out = String::with_capacity(text.len() + 64);
    for (i, (colored, plain)) in text.lines().zip(&plain).enumerate() {
        let line = if color { colored } else { plain };
        match numbers[i] {
            _ if i == 0 => out.push_str(line),
            Some((n, real)) => {
                // The number is the first one outside of a color code; blanks in front of it give way.
                let at = line.find(&format!("{n} ")).unwrap_or(0);
                let width = (digits(n) + extra).saturating_sub(digits(real));
                let narrow = digits(real).saturating_sub(digits(n) + extra);
                let head = &line[..at];
                out.push_str(head.strip_suffix(&" ".repeat(narrow)).unwrap_or(head));
                out.push_str(&" ".repeat(width));
                out.push_str(&real.to_string());
                out.push_str(&line[at + digits(n)..]);
            }
            None => {
                let fill = if plain.starts_with('─') { "─" } else { " " };
                out.push_str(&fill.repeat(extra));
                out.push_str(line);
            }
        }
        while out.ends_with(' ') {
            out.pop();
        }
        out.push('\n');
    }
    out
}

/// The line without terminal color codes.
fn without_colors(line: &str) -> String {
    let mut out = String::with_capacity(line.len());
    let mut rest = line;
    while let Some((before, after)) = rest.split_once("\x1b[") {
        out.push_str(before);
        rest = after.split_once('m').map_or("", |(_, r)| r);
    }
    out.push_str(rest);
    out
}

/// A finding without a place in a text.
fn plain(out: &mut Vec<u8>, d: &Diagnostic, notes: &[String], color: bool) {
    let word = super::word(d.severity);
    let code = d.code.def().code;
    let _ = if color {
        let number = if d.severity == Severity::Error { 31 } else { 33 };
        writeln!(out, "\x1b[{number}m[{code}] {word}:\x1b[0m {}", printable(&d.message))
    } else {
        writeln!(out, "[{code}] {word}: {}", printable(&d.message))
    };
    for note in notes {
        let _ = writeln!(out, "  Note: {}", printable(note));
    }
    if let Some(help) = &d.help {
        let _ = writeln!(out, "  Help: {}", printable(help));
    }
    out.push(b'\n');
}

fn trace(notes: &mut Vec<String>, sources: &Sources, positions: &mut Positions, d: &Diagnostic) {
    for (i, frame) in d.trace.iter().enumerate() {
        if d.trace.len() > FRAMES && i >= FRAMES / 2 && i + FRAMES / 2 < d.trace.len() {
            if i == FRAMES / 2 {
                notes.push(format!("… {} more levels …", d.trace.len() - FRAMES));
            }
            continue;
        }
        let (line, _) = positions.of(sources, frame.file, frame.span.start);
        notes.push(format!("in {}, from {}:{line}", frame.name, sources.name(frame.file)));
    }
}

fn color_of(severity: Severity) -> Color {
    match severity {
        Severity::Error => Color::Red,
        Severity::Warning => Color::Yellow,
        Severity::Hint => Color::Cyan,
    }
}

struct Files(BTreeMap<String, Source<String>>);

impl ariadne::Cache<String> for Files {
    type Storage = String;
    fn fetch(&mut self, id: &String) -> Result<&Source<String>, impl std::fmt::Debug> {
        self.0.get(id).ok_or("no such file")
    }
    fn display<'a>(&self, id: &'a String) -> Option<impl std::fmt::Display + 'a> {
        Some(id)
    }
}

/// The lines of a file that a finding needs; lines between them are empty, so that numbers are right.
#[derive(Default)]
struct Excerpt {
    /// Labelled lines (from 0) and the bytes of them that the labels need, relative to the file.
    wanted: BTreeMap<u32, (u32, u32)>,
    first: u32,
    text: String,
    /// For each wanted line: its first byte in the file that is shown, its place in `text`, its length there.
    shown: Vec<(usize, usize, usize)>,
}

impl Excerpt {
    fn want(&mut self, line: u32, label: &Label) {
        let (start, end) = (label.span.start, label.span.end.max(label.span.start));
        let entry = self.wanted.entry(line).or_insert((start, end));
        *entry = (entry.0.min(start), entry.1.max(end));
    }

    fn build(&mut self, sources: &Sources, positions: &mut Positions, file: FileId) {
        let Some(source) = sources.get(file) else { return };
        let text = &*source.text;
        self.first = self.wanted.keys().next().copied().unwrap_or(0);
        let mut at = self.first;
        for (line, (from, to)) in &self.wanted {
            while at < *line {
                self.text.push('\n');
                at += 1;
            }
            let start = positions.start(source, file, *line);
            let whole = text.get(start..positions.start(source, file, *line + 1)).unwrap_or("");
            let end = start + whole.trim_end_matches(['\n', '\r']).len();
            let (mut cut_start, mut cut_end) = (start, end);
            if end - start > WIDTH {
                cut_start = floor(text, (*from as usize).saturating_sub(MARGIN).max(start));
                cut_end = floor(text, (*to as usize).saturating_add(MARGIN).min(cut_start + WIDTH).min(end)).max(cut_start);
            }
            let place = self.text.len();
            let shown = printable(&text[cut_start..cut_end]);
            self.text.push_str(&shown);
            // A label may stand behind the last character.
            self.text.push(' ');
            self.shown.push((cut_start, place, shown.len()));
        }
        self.text.push('\n');
    }

    /// Place of a label in `text`; of a label over several lines, its part of the first.
    fn range(&self, label: &Label) -> std::ops::Range<usize> {
        let at = self.shown.partition_point(|(start, ..)| *start <= label.span.start as usize).saturating_sub(1);
        let Some((start, place, len)) = self.shown.get(at) else { return 0..0 };
        let into = |offset: u32| place + (offset as usize).saturating_sub(*start).min(*len);
        let from = floor(&self.text, into(label.span.start));
        let to = floor(&self.text, into(label.span.end.max(label.span.start)));
        let next = self.text[from..].chars().next().map_or(1, char::len_utf8);
        from..to.max(from + next)
    }
}

/// Text without control characters (a terminal would obey them) and other line ends, of the same length.
fn printable(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '\t' | '\n' => c,
            '\u{2028}' | '\u{2029}' => '\u{FFFD}',
            c if c.is_control() && c.len_utf8() == 1 => '?',
            c if c.is_control() => '\u{BF}',
            c => c,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gr_text::{Span, code};

    fn shown(text: &str, d: Diagnostic) -> String {
        let mut sources = Sources::default();
        sources.add("part.ngc", text);
        let mut out = Vec::new();
        write(&mut out, &sources, &mut Positions::default(), &d, false);
        String::from_utf8(out).unwrap()
    }

    fn at(start: u32, end: u32) -> Diagnostic {
        Diagnostic::new(code::ARC_RADIUS_MISMATCH, FileId(0), Span::new(start, end), &["4".into(), "6".into()])
    }

    #[test]
    fn labels_notes_and_help() {
        let text = "G21 G90 F100\nG0 X1\n\nG2 X10 Y0 I4 J0\nM2\n";
        let d = at(30, 35).label(FileId(0), Span::new(13, 18), "starts here").note("the tolerance is 0.028 mm");
        insta::assert_snapshot!(shown(text, d));
    }

    #[test]
    fn long_lines_are_cut() {
        let text = format!("G0 X1 ({})\n(é{}) G2 X1 Y2\u{1b}[31m\n", "a".repeat(50), "b".repeat(100_000));
        let start = text.rfind("X1").unwrap() as u32;
        let out = shown(&text, at(start, start + 2));
        assert!(out.len() < 1500, "{out}");
        assert!(out.contains("G2 X1 Y2?[31m"), "{out}");
    }

    #[test]
    fn any_place_is_survived() {
        let text = "a\u{2028}b\r\nü\u{85}c\0\r";
        for start in 0..16 {
            for end in 0..20 {
                let out = shown(text, at(start, end).label(FileId(0), Span::new(end, start), "é"));
                assert!(out.contains("E0203"));
            }
        }
        assert!(shown("", at(0, 5)).contains("E0203"));
    }

    #[test]
    fn line_numbers_grow() {
        let text = format!("{}G1 X2\n\n\n\nG1 X3\n", "\n".repeat(99_995));
        let at_x2 = text.find("X2").unwrap() as u32;
        let out = shown(&text, at(at_x2 + 9, at_x2 + 11).label(FileId(0), Span::new(at_x2, at_x2 + 2), "before"));
        insta::assert_snapshot!(out);
    }

    #[test]
    fn far_labels_become_notes() {
        let text = "G1\n".repeat(5000);
        let out = shown(&text, at(0, 2).label(FileId(0), Span::new(14_997, 14_999), "far away"));
        assert!(out.contains("part.ngc:5000:1: far away"), "{out}");
    }
}
