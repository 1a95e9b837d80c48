//! One JSON object per line. Lines and columns count from 1, columns in characters; bytes from 0 in the
//! decoded (UTF-8) text.

use std::io::Write;

use gr_text::{Diagnostic, FileId, Span};
use serde_json::{Value, json};

use super::Tally;
use crate::sources::{Positions, Sources};

pub fn write(out: &mut Vec<u8>, sources: &Sources, positions: &mut Positions, d: &Diagnostic) {
    let def = d.code.def();
    let mut place = |file: FileId, span: Span| {
        let (line, column) = positions.of(sources, file, span.start);
        let (end_line, end_column) = positions.of(sources, file, span.end);
        json!({
            "file": sources.name(file),
            "line": line, "column": column, "endLine": end_line, "endColumn": end_column,
            "start": span.start, "end": span.end,
        })
    };
    let mut labels = Vec::new();
    for (i, l) in d.labels.iter().enumerate() {
        labels.push(with(place(l.file, l.span), &[("primary", json!(i == 0)), ("text", json!(l.text))]));
    }
    let mut fixes = Vec::new();
    for fix in &d.fixes {
        let edits: Vec<Value> = fix.edits.iter().map(|(f, s, new)| with(place(*f, *s), &[("replacement", json!(new))])).collect();
        fixes.push(json!({ "title": fix.title, "edits": edits }));
    }
    let trace: Vec<Value> = d.trace.iter().map(|f| with(place(f.file, f.span), &[("name", json!(f.name))])).collect();
    let value = json!({
        "type": "diagnostic",
        "code": def.code, "slug": def.slug, "severity": super::word(d.severity), "lint": def.lint,
        "message": d.message, "labels": labels, "notes": d.notes, "help": d.help, "fixes": fixes, "trace": trace,
    });
    let _ = writeln!(out, "{value}");
}

fn with(mut object: Value, more: &[(&str, Value)]) -> Value {
    for (key, value) in more {
        object[*key] = value.clone();
    }
    object
}

pub fn summary(out: &mut Vec<u8>, tally: &Tally) {
    let value = json!({
        "type": "summary",
        "files": tally.files, "errors": tally.errors, "warnings": tally.warnings, "hints": tally.hints,
    });
    let _ = writeln!(out, "{value}");
}
