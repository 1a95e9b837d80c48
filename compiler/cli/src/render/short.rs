//! `part.ngc:2:4: error[E0203]: message`, one line each.

use std::io::Write;

use gr_text::Diagnostic;

use crate::sources::{Positions, Sources};

pub fn write(out: &mut Vec<u8>, sources: &Sources, positions: &mut Positions, d: &Diagnostic) {
    let (file, span) = d.primary();
    let (line, column) = positions.of(sources, file, span.start);
    let place = match sources.name(file) {
        "" => String::new(),
        name if sources.get(file).is_some_and(|f| f.text.is_empty()) => format!("{name}: "),
        name => format!("{name}:{line}:{column}: "),
    };
    let message = d.message.replace('\n', " ");
    let _ = writeln!(out, "{place}{}[{}]: {message}", super::word(d.severity), d.code.def().code);
}
