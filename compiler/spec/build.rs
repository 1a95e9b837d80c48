//! Turns the tables of the top-level `spec/` folder into static Rust data, so that reading them costs
//! nothing at start-up and a mistake in a table is a build error.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn main() {
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets this")).join("../../spec");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets this"));
    println!("cargo:rerun-if-changed=build.rs");
    let mut code = String::new();
    diagnostics(&root.join("diagnostics"), &mut code);
    rs274(&root.join("rs274"), &mut code);
    dialects(&root.join("dialects"), &mut code);
    targets(&root.join("targets"), &mut code);
    ini(&root.join("ini"), &mut code);
    std::fs::write(out.join("tables.rs"), code).expect("OUT_DIR is writable");
}

fn tables(dir: &Path) -> Vec<(PathBuf, toml::Table)> {
    println!("cargo:rerun-if-changed={}", dir.display());
    let mut files: Vec<PathBuf> = std::fs::read_dir(dir)
        .unwrap_or_else(|e| panic!("{}: {e}", dir.display()))
        .map(|f| f.expect("readable folder").path())
        .filter(|p| p.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    files
        .into_iter()
        .map(|p| {
            println!("cargo:rerun-if-changed={}", p.display());
            let text = std::fs::read_to_string(&p).unwrap_or_else(|e| panic!("{}: {e}", p.display()));
            let table = text.parse::<toml::Table>().unwrap_or_else(|e| panic!("{}: {e}", p.display()));
            (p, table)
        })
        .collect()
}

/// `arc/radius-mismatch` → `ARC_RADIUS_MISMATCH`.
fn constant(slug: &str) -> String {
    slug.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_uppercase() } else { '_' }).collect()
}

fn field<'a>(t: &'a toml::Table, key: &str, at: &str) -> &'a str {
    t.get(key).and_then(|v| v.as_str()).unwrap_or_else(|| panic!("{at}: `{key}` is missing"))
}

fn optional(t: &toml::Table, key: &str) -> String {
    match t.get(key).and_then(|v| v.as_str()) {
        Some(s) => format!("Some({:?})", s.trim_matches('\n')),
        None => "None".into(),
    }
}

fn diagnostics(dir: &Path, code: &mut String) {
    let mut rows = Vec::new();
    for (path, table) in tables(dir) {
        let at = path.display().to_string();
        for row in table.get("diagnostic").and_then(|v| v.as_array()).into_iter().flatten() {
            let row = row.as_table().unwrap_or_else(|| panic!("{at}: [[diagnostic]] is a table"));
            rows.push((field(row, "code", &at).to_string(), at.clone(), row.clone()));
        }
    }
    rows.sort_by(|a, b| a.0.cmp(&b.0));
    for pair in rows.windows(2) {
        assert!(pair[0].0 != pair[1].0, "{} is used twice: {} and {}", pair[0].0, pair[0].1, pair[1].1);
    }
    let mut slugs = std::collections::BTreeSet::new();
    writeln!(code, "pub(crate) static DIAGNOSTICS: &[crate::DiagnosticDef] = &[").expect("string");
    for (id, at, row) in &rows {
        let at = format!("{at}: {id}");
        let slug = field(row, "slug", &at);
        assert!(slugs.insert(constant(slug)), "{at}: slug {slug} is used twice");
        let severity = match field(row, "severity", &at) {
            "error" => "Error",
            "warning" => "Warning",
            "hint" => "Hint",
            other => panic!("{at}: severity {other}"),
        };
        writeln!(
            code,
            "crate::DiagnosticDef {{ code: {id:?}, slug: {slug:?}, severity: crate::Severity::{severity}, lint: {}, message: {:?}, explanation: {:?}, fix: {}, dialect: {}, tools: {}, options: {}, bad: {}, good: {} }},",
            row.get("lint").and_then(|v| v.as_bool()).unwrap_or(false),
            field(row, "message", &at),
            field(row, "explanation", &at).trim(),
            optional(row, "fix"),
            optional(row, "dialect"),
            optional(row, "tools"),
            optional(row, "options"),
            optional(row, "bad"),
            optional(row, "good"),
        )
        .expect("string");
    }
    writeln!(code, "];\n/// One constant per row of `spec/diagnostics`, named after its slug.\npub mod code {{").expect("string");
    for (i, (id, _, row)) in rows.iter().enumerate() {
        let slug = field(row, "slug", id);
        writeln!(
            code,
            "/// {id} `{slug}`\npub const {}: crate::Code = crate::Code({i});",
            constant(slug)
        )
        .expect("string");
    }
    writeln!(code, "}}").expect("string");
}

fn rs274(dir: &Path, code: &mut String) {
    let mut rows = std::collections::BTreeMap::new();
    for (path, table) in tables(dir) {
        for (key, text) in table {
            let text = text.as_str().unwrap_or_else(|| panic!("{}: {key} is a string", path.display())).to_string();
            assert!(rows.insert(key.clone(), text).is_none(), "{}: {key} is used twice", path.display());
        }
    }
    writeln!(code, "pub(crate) static RS274: &[&str] = &[").expect("string");
    for text in rows.values() {
        writeln!(code, "{text:?},").expect("string");
    }
    writeln!(code, "];\n/// The message texts of LinuxCNC's `rs274`, used by `gcc-robot rs274` alone.\npub mod rs274 {{").expect("string");
    for (i, (key, text)) in rows.iter().enumerate() {
        let shown = if text.is_empty() { "No text.".to_string() } else { text.replace('\n', " ") };
        writeln!(code, "/// {shown}\npub const {}: crate::Rs274 = crate::Rs274({i});", constant(key)).expect("string");
    }
    writeln!(code, "}}").expect("string");
}

fn list(t: &toml::Table, key: &str) -> String {
    let items = t.get(key).and_then(|v| v.as_array()).into_iter().flatten();
    let items: Vec<String> = items.map(|v| format!("{:?}", v.as_str().unwrap_or_default())).collect();
    format!("&[{}]", items.join(", "))
}

fn rows<'a>(t: &'a toml::Table, key: &str) -> impl Iterator<Item = &'a toml::Table> {
    t.get(key).and_then(|v| v.as_array()).into_iter().flatten().filter_map(|v| v.as_table())
}

fn or_empty<'a>(t: &'a toml::Table, key: &str) -> &'a str {
    t.get(key).and_then(|v| v.as_str()).unwrap_or("").trim()
}

fn flag(t: &toml::Table, key: &str) -> bool {
    t.get(key).and_then(|v| v.as_bool()).unwrap_or(false)
}

/// A later version of a dialect names its elder in `extends`: it takes over the elder's rows, replaces those with
/// the same `key` in place, adds new ones at the end and leaves out those named in `without`.
fn inherit(child: &toml::Table, elder: &toml::Table, list: &str, key: &str) -> toml::Value {
    let name = |t: &toml::Table| t.get(key).and_then(|v| v.as_str()).unwrap_or_default().to_string();
    let without: Vec<&str> =
        child.get("without").and_then(|v| v.as_array()).into_iter().flatten().filter_map(|v| v.as_str()).collect();
    let mut merged: Vec<toml::Table> =
        rows(elder, list).filter(|r| !without.contains(&name(r).as_str())).cloned().collect();
    for row in rows(child, list) {
        match merged.iter_mut().find(|r| name(r) == name(row)) {
            Some(old) => *old = row.clone(),
            None => merged.push(row.clone()),
        }
    }
    toml::Value::Array(merged.into_iter().map(toml::Value::Table).collect())
}

fn dialect_tables(dir: &Path) -> Vec<(PathBuf, toml::Table)> {
    let all = tables(dir);
    all.iter()
        .filter(|(_, t)| t.contains_key("id"))
        .map(|(path, t)| {
            let at = path.display().to_string();
            let mut t = t.clone();
            if let Some(elder) = t.get("extends").and_then(|v| v.as_str()) {
                let elder = &all
                    .iter()
                    .find(|(_, e)| e.get("id").and_then(|v| v.as_str()) == Some(elder))
                    .unwrap_or_else(|| panic!("{at}: extends {elder}, which is not there"))
                    .1;
                for (list, key) in [("word", "letter"), ("code", "code"), ("fact", "key")] {
                    let merged = inherit(&t, elder, list, key);
                    t.insert(list.to_string(), merged);
                }
            }
            (path.clone(), t)
        })
        .collect()
}

fn dialects(dir: &Path, code: &mut String) {
    writeln!(code, "pub(crate) static DIALECTS: &[crate::Dialect] = &[").expect("string");
    for (path, t) in dialect_tables(dir) {
        let at = path.display().to_string();
        writeln!(
            code,
            "crate::Dialect {{ id: {:?}, aliases: {}, title: {:?}, family: crate::Family::{}, line_limit: {}, needs_end: {}, decimal_comma: {}, extensions: {}, words: &[",
            field(&t, "id", &at),
            list(&t, "aliases"),
            field(&t, "title", &at),
            field(&t, "family", &at),
            t.get("line_limit").and_then(|v| v.as_integer()).unwrap_or(0),
            flag(&t, "needs_end"),
            flag(&t, "decimal_comma"),
            list(&t, "extensions"),
        )
        .expect("string");
        for w in rows(&t, "word") {
            let letter = field(w, "letter", &at).chars().next().unwrap_or_else(|| panic!("{at}: empty letter"));
            writeln!(
                code,
                "crate::WordDef {{ letter: {letter:?}, title: {:?}, unit: {:?}, what: {:?} }},",
                field(w, "title", &at),
                or_empty(w, "unit"),
                or_empty(w, "what"),
            )
            .expect("string");
        }
        writeln!(code, "], codes: &[").expect("string");
        for c in rows(&t, "code") {
            let name = field(c, "code", &at);
            let at = format!("{at}: {name}");
            writeln!(code, "crate::CodeDef {{ code: {name:?}, title: {:?}, group: {:?}, args: &[", field(c, "title", &at), field(c, "group", &at)).expect("string");
            for a in rows(c, "args") {
                writeln!(
                    code,
                    "crate::ArgDef {{ letters: {:?}, required: {}, unit: {:?}, what: {:?} }},",
                    field(a, "letters", &at),
                    flag(a, "required"),
                    or_empty(a, "unit"),
                    or_empty(a, "what"),
                )
                .expect("string");
            }
            writeln!(code, "], what: {:?}, errors: {}, source: {:?} }},", or_empty(c, "what"), list(c, "errors"), or_empty(c, "source")).expect("string");
        }
        writeln!(code, "], facts: &[").expect("string");
        for f in rows(&t, "fact") {
            let key = field(f, "key", &at);
            writeln!(
                code,
                "crate::FactDef {{ key: {key:?}, title: {:?}, value: {:?}, what: {:?}, source: {:?} }},",
                field(f, "title", &at),
                field(f, "value", &at),
                field(f, "what", &at),
                field(f, "source", &at),
            )
            .expect("string");
        }
        writeln!(code, "] }},").expect("string");
    }
    writeln!(code, "];").expect("string");
    for (path, t) in tables(dir).into_iter().filter(|(_, t)| !t.contains_key("id")) {
        let at = path.display().to_string();
        match path.file_stem().and_then(|s| s.to_str()) {
            Some("groups") => groups(&t, &at, code),
            Some("parameters") => parameters(&t, &at, code),
            _ => panic!("{at}: a dialect has an `id`"),
        }
    }
}

fn groups(t: &toml::Table, at: &str, code: &mut String) {
    writeln!(code, "pub(crate) static GROUPS: &[crate::GroupDef] = &[").expect("string");
    for g in rows(t, "group") {
        let number = g.get("number").and_then(|v| v.as_integer()).unwrap_or(-1);
        let (slug, title) = (field(g, "slug", at), field(g, "title", at));
        writeln!(code, "crate::GroupDef {{ slug: {slug:?}, number: {number}, title: {title:?} }},").expect("string");
    }
    writeln!(code, "];").expect("string");
}

fn parameters(t: &toml::Table, at: &str, code: &mut String) {
    writeln!(code, "pub(crate) static PARAMETERS: &[crate::ParameterDef] = &[").expect("string");
    let integer = |r: &toml::Table, key: &str| {
        r.get(key).and_then(|v| v.as_integer()).unwrap_or_else(|| panic!("{at}: `{key}` is missing"))
    };
    for r in rows(t, "number") {
        writeln!(
            code,
            "crate::ParameterDef {{ name: \"\", first: {}, last: {}, title: {:?}, unit: {:?}, persistent: {}, what: {:?}, source: {:?} }},",
            integer(r, "first"),
            integer(r, "last"),
            field(r, "title", at),
            field(r, "unit", at),
            flag(r, "persistent"),
            field(r, "what", at),
            field(r, "source", at),
        )
        .expect("string");
    }
    for r in rows(t, "name") {
        writeln!(
            code,
            "crate::ParameterDef {{ name: {:?}, first: 0, last: 0, title: \"\", unit: {:?}, persistent: false, what: {:?}, source: {:?} }},",
            field(r, "name", at),
            field(r, "unit", at),
            field(r, "what", at),
            field(r, "source", at),
        )
        .expect("string");
    }
    writeln!(code, "];").expect("string");
    for (list, key, table) in [
        ("function", "name", "FUNCTIONS"),
        ("operator", "symbol", "OPERATORS"),
        ("control", "word", "CONTROLS"),
        ("comment", "word", "COMMENTS"),
    ] {
        writeln!(code, "pub(crate) static {table}: &[crate::WordingDef] = &[").expect("string");
        for r in rows(t, list) {
            let name = field(r, key, at);
            let form = r.get("form").and_then(|v| v.as_str()).unwrap_or(name);
            let precedence = r.get("precedence").and_then(|v| v.as_integer()).unwrap_or(0);
            writeln!(
                code,
                "crate::WordingDef {{ name: {name:?}, form: {form:?}, precedence: {precedence}, what: {:?}, source: {:?} }},",
                field(r, "what", at),
                field(r, "source", at),
            )
            .expect("string");
        }
        writeln!(code, "];").expect("string");
    }
}

fn ini(dir: &Path, code: &mut String) {
    let mut seen = std::collections::BTreeSet::new();
    writeln!(code, "pub(crate) static INI_KEYS: &[crate::IniKey] = &[").expect("string");
    for (path, t) in tables(dir) {
        let at = path.display().to_string();
        for row in rows(&t, "key") {
            let (section, name) = (field(row, "section", &at), field(row, "name", &at));
            assert!(seen.insert((section.to_string(), name.to_string())), "{at}: [{section}] {name} stands twice");
            let kind = match field(row, "kind", &at) {
                "text" => "Text",
                "number" => "Number",
                "integer" => "Integer",
                "flag" => "Flag",
                "switch" => "Switch",
                other => panic!("{at}: kind {other}"),
            };
            let bound = |key| row.get(key).and_then(toml::Value::as_integer);
            writeln!(
                code,
                "crate::IniKey {{ section: {section:?}, name: {name:?}, kind: crate::IniKind::{kind}, least: {:?}, most: {:?}, what: {:?} }},",
                bound("least"),
                bound("most"),
                field(row, "what", &at),
            )
            .expect("string");
        }
    }
    writeln!(code, "];").expect("string");
}

fn targets(dir: &Path, code: &mut String) {
    writeln!(code, "pub(crate) static TARGETS: &[crate::TargetDef] = &[").expect("string");
    for (path, t) in tables(dir) {
        let at = path.display().to_string();
        for row in rows(&t, "target") {
            writeln!(
                code,
                "crate::TargetDef {{ id: {:?}, title: {:?}, extension: {:?}, status: {:?}, options: {}, what: {:?} }},",
                field(row, "id", &at),
                field(row, "title", &at),
                field(row, "extension", &at),
                field(row, "status", &at),
                list(row, "options"),
                or_empty(row, "what"),
            )
            .expect("string");
        }
    }
    writeln!(code, "];").expect("string");
}
