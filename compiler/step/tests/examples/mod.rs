//! Files made from the base part and a few statements.

use std::path::{Path, PathBuf};

use gr_text::{Diagnostic, FileId, Severity};

pub fn data(name: &str) -> String {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    std::fs::read_to_string(path).expect("test data")
}

fn id(line: &str) -> Option<&str> {
    line.strip_prefix('#').and_then(|l| l.split_once('=')).map(|(id, _)| id)
}

/// `statements` join those of the base part; one with a number the base has replaces its statement.
pub fn file(statements: &str) -> String {
    let statements = statements.trim();
    if statements.starts_with("ISO-10303-21") {
        return statements.to_string();
    }
    let new: Vec<&str> = statements.lines().collect();
    let base = data("base.p21");
    let known: Vec<&str> = base.lines().filter_map(id).collect();
    let mut out = String::new();
    for line in base.lines() {
        let found = new.iter().find(|n| id(line).is_some() && id(n) == id(line));
        if line == "ENDSEC;" && out.contains("DATA;") {
            for n in new.iter().filter(|n| id(n).is_none_or(|i| !known.contains(&i))) {
                out += n;
                out.push('\n');
            }
        }
        out += found.unwrap_or(&line);
        out.push('\n');
    }
    out
}

#[allow(dead_code)]
pub fn diagnostics(text: &str) -> Vec<Diagnostic> {
    gr_step::diagnostics(text, FileId(0))
}

/// Codes that a file raises; hints that are not asked for don't count.
#[allow(dead_code)]
pub fn codes(text: &str, asked: &str) -> Vec<String> {
    let counts = |d: &&Diagnostic| d.severity != Severity::Hint || d.code.def().code == asked;
    diagnostics(text).iter().filter(counts).map(|d| d.code.def().code.to_string()).collect()
}
