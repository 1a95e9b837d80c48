//! `::error file=…,line=…::message`, which GitHub's workflow runner turns into annotations.

use std::io::Write;

use gr_text::{Diagnostic, Severity};

use crate::sources::{Positions, Sources};

pub fn write(out: &mut Vec<u8>, sources: &Sources, positions: &mut Positions, d: &Diagnostic) {
    let level = match d.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Hint => "notice",
    };
    let def = d.code.def();
    let mut place = String::new();
    if let Some(label) = d.labels.first()
        && !sources.name(label.file).is_empty()
    {
        let [(line, column), (end_line, end_column)] = super::region(sources, positions, label);
        place = format!("file={},line={line},endLine={end_line}", property(sources.name(label.file)));
        // GitHub refuses columns on findings of several lines.
        if line == end_line {
            place.push_str(&format!(",col={column},endColumn={}", end_column.max(column)));
        }
        place.push(',');
    }
    let mut message = d.message.clone();
    for more in d.notes.iter().map(|n| format!("note: {n}")).chain(d.help.iter().map(|h| format!("help: {h}"))) {
        message.push('\n');
        message.push_str(&more);
    }
    let title = property(&format!("{} {}", def.code, def.slug));
    let _ = writeln!(out, "::{level} {place}title={title}::{}", data(&message));
}

fn data(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}
