//! The pages of targets: the command of each is run in a folder with the page's files, and what it writes is compared.
//! `UPDATE_DOCS=1` writes what comes out into the page.

use std::path::{Path, PathBuf};
use std::process::Command;

fn pages() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/targets")
}

/// The first fenced block of a kind: what stands behind the kind, and the text.
fn block<'t>(page: &'t str, kind: &str) -> Option<(&'t str, &'t str)> {
    let open = format!("```{kind}");
    let from = page.find(&open)? + open.len();
    let (head, rest) = page[from..].split_once('\n')?;
    Some((head.trim(), &rest[..rest.find("```")?]))
}

/// The words of the page's command.
fn command(page: &str) -> Vec<&str> {
    let from = page.find("`gcc-robot build ").expect("a command") + 1;
    page[from..].split('`').next().expect("its end").split_whitespace().skip(1).collect()
}

/// The lines that the page shows of a file: `name 5-20`, the file in the folder that the command names.
fn shown(folder: &Path, words: &[&str], what: &str) -> String {
    let (name, range) = what.split_once(' ').expect("file and lines");
    let (first, last) = range.split_once('-').expect("from-to");
    let out = words.iter().skip_while(|w| **w != "-o").nth(1).filter(|o| o.ends_with('/')).unwrap_or(&"");
    let file = folder.join(out).join(name);
    let written = std::fs::read(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let skip = first.parse::<usize>().expect("a line") - 1;
    let count = last.parse::<usize>().map_or(usize::MAX, |l| l - skip);
    let text = String::from_utf8(written).expect("UTF-8").replace('\r', "");
    text.lines().skip(skip).take(count).map(|l| format!("{}\n", l.trim_end())).collect()
}

/// What stands behind a key of a schema, in words.
fn kind(schema: &serde_json::Value) -> String {
    let list = |key: &str| schema[key].as_array().map(|a| a.iter().map(|v| format!("`{}`", v.as_str().unwrap_or("?"))).collect::<Vec<_>>().join(", "));
    if let Some(values) = list("enum") {
        return values;
    }
    if let Some(forms) = schema["anyOf"].as_array() {
        return forms.iter().map(kind).collect::<Vec<_>>().join(", or ");
    }
    let least = [("minimum", "at least "), ("exclusiveMinimum", "above "), ("maximum", "at most ")];
    let bounds: Vec<String> = least.iter().filter_map(|(key, word)| Some(format!("{word}{}", schema[*key].as_f64()?))).collect();
    let with = |what: &str| if bounds.is_empty() { what.to_string() } else { format!("{what} {}", bounds.join(", ")) };
    match schema["type"].as_str() {
        Some("number") => with("number"),
        Some("integer") => with("whole number"),
        Some("boolean") => "true or false".into(),
        Some("array") => {
            let of = if schema["items"]["type"] == "array" { format!("lists of {}", kind(&schema["items"])) } else { format!("{}s", kind(&schema["items"])) };
            match schema["minItems"].as_u64().filter(|n| schema["maxItems"].as_u64() == Some(*n)) {
                Some(n) => format!("{n} {of}"),
                None => of,
            }
        }
        Some("string") => schema["pattern"].as_str().map_or("text".into(), |p| format!("text `{}…`", p.trim_matches(['^', '.', '+']))),
        _ => schema["const"].to_string(),
    }
}

/// The table that a key of a schema opens: one of its kind, or several.
fn table_of(schema: &serde_json::Value) -> Option<(&serde_json::Value, bool)> {
    match schema["type"].as_str() {
        Some("object") => Some((schema, false)),
        Some("array") if schema["items"]["type"] == "object" => Some((&schema["items"], true)),
        _ => None,
    }
}

/// Tables of the keys of a machine file, as its schema has them.
fn keys(schema: &serde_json::Value, whole: &serde_json::Value, name: &str, out: &mut String) {
    let (mut rows, mut below) = (String::new(), Vec::new());
    // Words of a dialect have tables of one form.
    let pattern = schema["patternProperties"].as_object().and_then(|p| p.values().next());
    if let Some(one) = pattern {
        return keys(one, whole, name, out);
    }
    // In a file that extends another, that one may have them.
    let needed = |key: &str| [schema, whole].iter().any(|s| s["required"].as_array().is_some_and(|r| r.iter().any(|k| k == key)));
    for (key, of) in schema["properties"].as_object().expect("keys") {
        let what = of["description"].as_str().expect("a description");
        if let Some((table, several)) = table_of(of) {
            // The reference mode's tables are those of the file.
            if !name.starts_with("[reference") {
                let whole = &whole["properties"][key];
                below.push((key, what, table, if several { &whole["items"] } else { whole }, several));
                continue;
            }
            rows.push_str(&format!("| `{key}` | as in the file | {what} |\n"));
            continue;
        }
        rows.push_str(&format!("| `{key}` | {}{} | {what} |\n", kind(of).replace('|', "\\|"), if needed(key) { ", **needed**" } else { "" }));
    }
    if !rows.is_empty() {
        out.push_str(&format!("| key | value | |\n|---|---|---|\n{rows}"));
    }
    for (key, what, table, whole, several) in below {
        let inner = name.trim_matches(['[', ']']);
        let path = if inner.is_empty() { key.clone() } else { format!("{inner}.{key}") };
        let path = if several { format!("[[{path}]]") } else { format!("[{path}]") };
        let words = if table["patternProperties"].is_object() { format!("[{key}.M3]") } else { path };
        out.push_str(&format!("\n**`{words}`** {what}\n\n"));
        keys(table, whole, &words, out);
    }
}

#[test]
fn keys_of_machine_files() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let schema: serde_json::Value = serde_json::from_str(include_str!("../../../spec/machines/machine.schema.json")).unwrap();
    let (page, mut now) = (root.join("docs/machines.md"), String::from("\n"));
    keys(&schema, &serde_json::json!({ "properties": schema["anyOf"][1]["properties"] }), "", &mut now);
    let text = std::fs::read_to_string(&page).unwrap().replace('\r', "");
    let (head, rest) = text.split_once("<!-- keys -->\n").expect("the mark");
    let (old, tail) = rest.split_once("<!-- end of keys -->").expect("the other mark");
    if std::env::var_os("UPDATE_DOCS").is_some() && old != now {
        std::fs::write(&page, format!("{head}<!-- keys -->\n{now}<!-- end of keys -->{tail}")).unwrap();
    } else {
        assert!(old == now, "UPDATE_DOCS=1 brings docs/machines.md up to date:\n{now}");
    }
}

/// Keys that a schema asks for and a value lacks, as a validator tells them.
fn missing(schema: &serde_json::Value, value: &serde_json::Value, at: &str) -> Vec<String> {
    let asked = schema["required"].as_array().into_iter().flatten().filter_map(|k| k.as_str());
    let mut out: Vec<String> = asked.filter(|k| value.get(k).is_none()).map(|k| format!("{at}.{k}")).collect();
    let ways: Vec<Vec<String>> = schema["anyOf"].as_array().into_iter().flatten().map(|s| missing(s, value, at)).collect();
    if let Some(least) = ways.into_iter().min_by_key(Vec::len) {
        out.extend(least);
    }
    for (key, of) in schema["properties"].as_object().into_iter().flatten() {
        if let Some(v) = value.get(key) {
            out.extend(missing(of, v, &format!("{at}.{key}")));
        }
    }
    for v in value.as_array().into_iter().flatten() {
        out.extend(missing(&schema["items"], v, at));
    }
    out
}

/// The schema asks for what the reader asks for: a file that extends another says only what differs.
#[test]
fn the_schema_agrees_with_the_reader() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let schema: serde_json::Value = serde_json::from_str(include_str!("../../../spec/machines/machine.schema.json")).unwrap();
    let lacks = |text: &str| missing(&schema, &serde_json::to_value(toml::from_str::<toml::Value>(text).unwrap()).unwrap(), "");
    let reads = |text: &str| gr_machine::parse(gr_text::FileId(0), text).is_ok();
    let page = std::fs::read_to_string(root.join("docs/machines.md")).unwrap();
    let cell = block(&page, "toml").expect("the cell").1;
    assert!(cell.contains("[[joint]]") && !cell.contains("type ="), "{cell}");
    let head = "format = 1\nid = \"t/m\"\n";
    let over = |rest: &str| format!("{head}extends = \"generic/mill3\"\n{rest}");
    let file = std::fs::read_to_string(root.join("spec/machines/generic/mill3.toml")).unwrap();
    for good in [cell.to_string(), over(""), over("[[joint]]\nname = \"X\"\nmax = 600\n"), file.clone()] {
        assert!(lacks(&good).is_empty() && reads(&good), "{:?}: {good}", lacks(&good));
    }
    let untyped = file.replacen("type = \"prismatic\"\n", "", 1);
    for bad in [untyped, over("[[joint]]\nmax = 600\n"), format!("{head}title = \"t\"\n")] {
        assert!(!lacks(&bad).is_empty() && !reads(&bad), "{bad}");
    }
}

/// The cell of the page on machine files makes a program for the shipped part.
#[test]
fn the_cell_of_the_page_builds_the_shipped_part() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = std::fs::read_to_string(root.join("docs/machines.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cell.toml"), block(&page, "toml").expect("the cell").1).unwrap();
    let from = page.find("`gcc-robot build docs/examples/bracket.ngc").expect("the command") + 1;
    let words = page[from..].split('`').next().expect("its end").split_whitespace().skip(1);
    let words = words.map(|w| if w == "docs/examples/bracket.ngc" { root.join(w).display().to_string() } else { w.to_string() });
    let made = Command::new(env!("CARGO_BIN_EXE_gcc-robot")).args(words).current_dir(folder.path()).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    assert!(folder.path().join("out/bracket.mod").is_file());
}

#[test]
fn every_robot_language_has_a_page() {
    for language in gr_vendors::languages() {
        assert!(pages().join(format!("{}.md", language.id())).is_file(), "{}", language.id());
    }
}

#[test]
fn examples_of_the_pages() {
    let mut wrong = Vec::new();
    let mut all: Vec<PathBuf> = std::fs::read_dir(pages()).unwrap().map(|f| f.unwrap().path()).collect();
    all.sort();
    for page in all {
        let text = std::fs::read_to_string(&page).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for (kind, name) in [("toml", "cell.toml"), ("gcode", "part.ngc")] {
            if let Some((_, body)) = block(&text, kind) {
                std::fs::write(folder.path().join(name), body).unwrap();
            }
        }
        let words = command(&text);
        let made = Command::new(env!("CARGO_BIN_EXE_gcc-robot")).args(&words).current_dir(folder.path()).output().unwrap();
        assert!(made.status.success(), "{}: {}", page.display(), String::from_utf8_lossy(&made.stderr));
        let (what, now) = block(&text, "text").expect("what it writes");
        let wanted = shown(folder.path(), &words, what);
        if now == wanted {
            continue;
        }
        if std::env::var_os("UPDATE_DOCS").is_some() {
            let at = text.find(&format!("```text {what}\n")).unwrap() + what.len() + 9;
            std::fs::write(&page, format!("{}{wanted}{}", &text[..at], &text[at + now.len()..])).unwrap();
        } else {
            wrong.push(format!("{}:\n{wanted}", page.display()));
        }
    }
    assert!(wrong.is_empty(), "UPDATE_DOCS=1 brings these up to date:\n{}", wrong.join("\n"));
}
