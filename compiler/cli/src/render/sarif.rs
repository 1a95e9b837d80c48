//! One SARIF 2.1.0 log for the whole run.

use std::collections::BTreeSet;
use std::io::Write;

use gr_text::{Code, Diagnostic, Severity};
use serde_json::{Value, json};

use crate::sources::{Positions, Sources};

/// Results gathered so far.
#[derive(Default)]
pub struct Log {
    results: Vec<Value>,
    rules: BTreeSet<Code>,
}

impl Log {
    pub fn add(&mut self, sources: &Sources, positions: &mut Positions, d: &Diagnostic) {
        self.rules.insert(d.code);
        let mut location = |l: &gr_text::Label, text: &str| {
            let [(line, column), (end_line, end_column)] = super::region(sources, positions, l);
            let mut value = json!({
                "physicalLocation": {
                    "artifactLocation": { "uri": uri(sources.name(l.file)) },
                    "region": { "startLine": line, "startColumn": column, "endLine": end_line, "endColumn": end_column },
                },
            });
            if !text.is_empty() {
                value["message"] = json!({ "text": text });
            }
            value
        };
        let locations: Vec<Value> = d
            .labels
            .first()
            .filter(|l| !sources.name(l.file).is_empty())
            .map(|l| location(l, &l.text))
            .into_iter()
            .collect();
        let related: Vec<Value> = d.labels.iter().skip(1).map(|l| location(l, &l.text)).collect();
        let frames: Vec<Value> = d
            .trace
            .iter()
            .map(|f| {
                let label = gr_text::Label { file: f.file, span: f.span, text: String::new() };
                json!({ "location": location(&label, &f.name) })
            })
            .collect();
        let mut text = d.message.clone();
        for more in d.notes.iter().map(|n| format!("note: {n}")).chain(d.help.iter().map(|h| format!("help: {h}"))) {
            text.push('\n');
            text.push_str(&more);
        }
        let mut result = json!({
            "ruleId": d.code.def().code, "level": level(d.severity), "message": { "text": text }, "locations": locations,
        });
        if !related.is_empty() {
            result["relatedLocations"] = Value::Array(related);
        }
        if !frames.is_empty() {
            result["stacks"] = json!([{ "frames": frames }]);
        }
        self.results.push(result);
    }

    pub fn write(&mut self, out: &mut Vec<u8>) {
        let rules: Vec<Value> = self.rules.iter().map(|c| rule(*c)).collect();
        let log = json!({
            "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
            "version": "2.1.0",
            "runs": [{
                "tool": { "driver": {
                    "name": "gcc-robot", "version": env!("CARGO_PKG_VERSION"), "rules": rules,
                } },
                "columnKind": "unicodeCodePoints",
                "results": std::mem::take(&mut self.results),
            }],
        });
        let _ = writeln!(out, "{log:#}");
    }
}

fn rule(code: Code) -> Value {
    let def = code.def();
    let mut value = json!({
        "id": def.code, "name": def.slug,
        "shortDescription": { "text": gr_spec::open(def.message) },
        "fullDescription": { "text": def.explanation },
        "defaultConfiguration": { "level": level(def.severity) },
    });
    if let Some(fix) = def.fix {
        value["help"] = json!({ "text": fix });
    }
    value
}

fn level(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Hint => "note",
    }
}

/// A file name as a relative or absolute URI.
fn uri(name: &str) -> String {
    let mut out = String::new();
    if name.starts_with('/') {
        out.push_str("file://");
    }
    for b in name.bytes() {
        match b {
            b'\\' => out.push('/'),
            b if b.is_ascii_alphanumeric() || b"/-._~".contains(&b) => out.push(char::from(b)),
            b => out.push_str(&format!("%{b:02X}")),
        }
    }
    out
}
