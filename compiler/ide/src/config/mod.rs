//! Files that programs are run with: machine files and `gcc-robot.toml` (by their JSON Schema), tool tables, INI and
//! parameter files.

pub mod linuxcnc;
pub mod tools;

use gr_text::Span;
use serde_json::Value;

use crate::{Completion, CompletionKind, Fold, Hover, Item, ItemKind};

/// Which kind of TOML file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Schema {
    /// A machine file.
    Machine,
    /// A job file.
    Job,
    /// The project file.
    Project,
}

impl Schema {
    /// What a file is by its name and text; none = some other TOML file.
    pub fn of(name: &str, text: &str) -> Option<Schema> {
        if name == "gcc-robot.toml" {
            return Some(Schema::Project);
        }
        let has = |start: &str| text.lines().any(|l| l.trim_start().starts_with(start));
        if name.ends_with(".toml") && has("[[setup]]") {
            return Some(Schema::Job);
        }
        (name.ends_with(".toml") && has("format") && (has("[kinematics]") || has("extends") || has("[[joint]]"))).then_some(Schema::Machine)
    }
    fn json(self) -> &'static Value {
        static MACHINE: std::sync::OnceLock<Value> = std::sync::OnceLock::new();
        static JOB: std::sync::OnceLock<Value> = std::sync::OnceLock::new();
        static PROJECT: std::sync::OnceLock<Value> = std::sync::OnceLock::new();
        let read = |text: &str| serde_json::from_str(text).unwrap_or(Value::Null);
        match self {
            Schema::Machine => MACHINE.get_or_init(|| read(&gr_machine::json_schema())),
            Schema::Job => JOB.get_or_init(|| read(&gr_machine::job_schema())),
            Schema::Project => PROJECT.get_or_init(|| read(include_str!("../../../../spec/config/gcc-robot.schema.json"))),
        }
    }
}

/// A key under the cursor: the tables around it, its name, and what is around it.
struct Place<'a> {
    /// Names of the tables, outermost first.
    path: Vec<String>,
    /// Lines of this table: from its header to the next.
    lines: (usize, usize),
    line: &'a str,
    start: u32,
    column: usize,
}

fn lines(text: &str) -> impl Iterator<Item = (u32, &str)> {
    text.split_inclusive('\n').scan(0u32, |at, l| {
        let start = *at;
        *at += l.len() as u32;
        Some((start, l.trim_end_matches(['\n', '\r'])))
    })
}

/// `[a.b]` or `[[a]]`
fn header(line: &str) -> Option<Vec<String>> {
    let line = line.trim().split('#').next()?.trim();
    let inside = line.strip_prefix('[')?.strip_suffix(']')?;
    let inside = inside.strip_prefix('[').and_then(|l| l.strip_suffix(']')).unwrap_or(inside);
    let good = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '"' | ' ' | '/');
    inside.chars().all(good).then(|| inside.split('.').map(|p| p.trim().trim_matches('"').to_string()).collect())
}

fn place(text: &str, offset: u32) -> Option<Place<'_>> {
    let (mut path, mut first, mut here) = (Vec::new(), 0, None);
    let mut last = 0;
    for (n, (start, line)) in lines(text).enumerate() {
        last = n + 1;
        let head = header(line);
        if here.is_some() {
            if head.is_some() {
                last = n;
                break;
            }
            continue;
        }
        if let Some(p) = head {
            (path, first) = (p, n + 1);
        }
        if offset <= start + line.len() as u32 {
            here = Some((start, line, (offset.saturating_sub(start)) as usize));
        }
    }
    let (start, line, column) = here.or_else(|| text.is_empty().then_some((0, "", 0))).or_else(|| Some((text.len() as u32, "", 0)))?;
    Some(Place { path, lines: (first, last), line, start, column })
}

/// The schema of a table or key, by names.
fn node<'v>(mut at: &'v Value, path: &[String]) -> Option<&'v Value> {
    for name in path {
        at = child(inner(at), name)?;
    }
    Some(inner(at))
}

/// What is asked of a table in a file that extends no other.
fn whole<'v>(root: &'v Value, path: &[String]) -> Option<&'v Value> {
    let own = root.get("anyOf")?.get(1)?;
    path.iter().try_fold(own, |at, name| {
        let at = at.get("properties")?.get(name)?;
        Some(at.get("items").unwrap_or(at))
    })
}

/// What a table holds under a name: a key of its own, or one of many alike.
fn child<'v>(table: &'v Value, name: &str) -> Option<&'v Value> {
    table.get("properties").and_then(|p| p.get(name)).or_else(|| alike(table))
}

/// What all tables are that a table holds under any name.
fn alike(table: &Value) -> Option<&Value> {
    let patterns = table.get("patternProperties").and_then(Value::as_object).and_then(|p| p.values().next());
    patterns.or_else(|| table.get("additionalProperties")).filter(|v| v.is_object())
}

/// Words that `[io]` mostly has tables for.
const IO_WORDS: [&str; 9] = ["M3", "M4", "M5", "S", "M6", "M7", "M8", "M9", "G38"];

/// What the members of a list of tables look like.
fn inner(at: &Value) -> &Value {
    at.get("items").filter(|i| i.get("properties").is_some()).unwrap_or(at)
}

fn key_of(line: &str) -> Option<&str> {
    let (key, _) = line.split_once('=')?;
    Some(key.trim().trim_matches('"'))
}

/// Explains the key or table at a byte, and where the file says its numbers come from.
pub fn hover(schema: Schema, text: &str, offset: u32) -> Option<Hover> {
    let p = place(text, offset)?;
    let mut path = p.path.clone();
    let head = header(p.line).is_some();
    let (name, span) = if head {
        let lead = p.line.len() - p.line.trim_start().len();
        (path.join("."), Span::new(p.start + lead as u32, p.start + p.line.trim_end().len() as u32))
    } else {
        let key = key_of(p.line)?;
        let from = p.line.find(key)?;
        path.push(key.to_string());
        (key.to_string(), Span::new(p.start + from as u32, p.start + (from + key.len()) as u32))
    };
    if p.column > p.line.len() {
        return None;
    }
    let raw = raw_node(schema.json(), &path)?;
    let mut text_out = format!("**{name}**{}", kind_text(raw));
    if let Some(d) = raw.get("description").and_then(Value::as_str) {
        text_out.push_str(&format!("\n\n{d}"));
    }
    if let Some(choices) = choices(raw) {
        text_out.push_str(&format!("\n\nOne of {}", choices.iter().map(|c| format!("`{c}`")).collect::<Vec<_>>().join(" ")));
    }
    if schema == Schema::Machine
        && let Some(source) = source(text, p.lines)
    {
        text_out.push_str(&format!("\n\n*Source of the numbers: {source}*"));
    }
    Some(Hover { span, text: text_out })
}

/// As [`node`], but a list of tables stays what it is.
fn raw_node<'v>(root: &'v Value, path: &[String]) -> Option<&'v Value> {
    let (last, above) = path.split_last()?;
    child(node(root, above)?, last)
}

fn kind_text(v: &Value) -> String {
    let kind = v.get("type").and_then(Value::as_str).unwrap_or("");
    if kind.is_empty() { String::new() } else { format!(" ({})", if kind == "object" { "table" } else { kind }) }
}

fn choices(v: &Value) -> Option<Vec<String>> {
    let Some(list) = v.get("enum").and_then(Value::as_array) else {
        return v.get("anyOf").and_then(Value::as_array)?.iter().find_map(choices);
    };
    Some(list.iter().map(|c| c.as_str().map_or_else(|| c.to_string(), str::to_string)).collect())
}

/// `source = "…"` of the table, or of the file.
fn source(text: &str, table: (usize, usize)) -> Option<String> {
    let value = |line: &str| {
        let (key, rest) = line.split_once('=')?;
        (key.trim() == "source").then(|| rest.trim().trim_matches('"').to_string())
    };
    let own = lines(text).enumerate().filter(|(n, _)| (table.0..table.1).contains(n)).find_map(|(_, (_, l))| value(l));
    own.or_else(|| lines(text).map(|(_, l)| l).take_while(|l| header(l).is_none()).find_map(value))
}

/// What can be written at a byte: tables, keys of the table, values.
pub fn complete(schema: Schema, text: &str, offset: u32) -> Vec<Completion> {
    let Some(p) = place(text, offset) else { return Vec::new() };
    let before = p.line.get(..p.column).unwrap_or(p.line);
    let item = |label: &str, insert: String, detail: String, documentation: String, rank: u8, typed: usize| Completion {
        label: label.into(),
        insert,
        snippet: false,
        detail,
        documentation,
        kind: CompletionKind::Keyword,
        rank,
        replace: Span::new(offset - typed as u32, offset),
    };
    if before.trim_start().starts_with('[') {
        let typed = before.trim_start().trim_start_matches('[');
        return tables(schema.json())
            .into_iter()
            .filter(|(name, ..)| name.starts_with(typed))
            .map(|(name, list, what)| {
                let brackets = before.trim_start().len() - typed.len();
                let open = if list { "[[" } else { "[" };
                let close = if list { "]]" } else { "]" };
                let mut c = item(&name, format!("{open}{name}{close}"), String::new(), what, 1, typed.len() + brackets);
                // Brackets that the editor closed by itself are replaced too.
                let behind = p.line.get(p.column..).unwrap_or("").bytes().take_while(|b| *b == b']').count();
                c.replace.end += behind as u32;
                c
            })
            .collect();
    }
    if let Some((key, typed)) = before.split_once('=') {
        let mut path = p.path.clone();
        path.push(key.trim().to_string());
        let Some(v) = raw_node(schema.json(), &path) else { return Vec::new() };
        let typed = typed.trim_start();
        // Of a list, the member that is written.
        let (typed, v) = match typed.starts_with('[') {
            true => (typed.rsplit(['[', ',']).next().unwrap_or(typed).trim_start(), v.get("items").unwrap_or(v)),
            false => (typed, v),
        };
        let quoted = typed.starts_with('"');
        let start = typed.trim_start_matches('"');
        let behind = u32::from(quoted && p.line.get(p.column..).is_some_and(|r| r.starts_with('"')));
        return values(schema, &path, v)
            .into_iter()
            .filter(|(c, _)| c.trim_matches('"').starts_with(start))
            .map(|(c, what)| {
                let mut c = item(c.trim_matches('"'), c.clone(), what, String::new(), 1, typed.len());
                c.replace.end += behind;
                c
            })
            .collect();
    }
    let typed = before.trim_start();
    let Some(table) = node(schema.json(), &p.path) else { return Vec::new() };
    let present: Vec<&str> = lines(text)
        .enumerate()
        .filter(|(n, (start, _))| (p.lines.0..p.lines.1).contains(n) && *start != p.start)
        .filter_map(|(_, (_, l))| key_of(l))
        .collect();
    let extends = lines(text).any(|(_, l)| key_of(l) == Some("extends"));
    let whole = (!extends).then(|| whole(schema.json(), &p.path)).flatten();
    let named = [Some(table), whole].into_iter().flatten().filter_map(|t| t.get("required").and_then(Value::as_array));
    let required: Vec<&str> = named.flatten().filter_map(Value::as_str).collect();
    let Some(properties) = table.get("properties").and_then(Value::as_object) else { return Vec::new() };
    let leaf = |v: &Value| inner(v).get("properties").is_none() && alike(inner(v)).is_none();
    properties
        .iter()
        .filter(|(k, v)| k.starts_with(typed) && !present.contains(&k.as_str()) && leaf(v))
        .map(|(k, v)| {
            let needed = required.contains(&k.as_str());
            let what = v.get("description").and_then(Value::as_str).unwrap_or("");
            item(k, format!("{k} = "), if needed { "needed".into() } else { kind_text(v).trim().to_string() }, what.into(), if needed { 0 } else { 1 }, typed.len())
        })
        .collect()
}

/// Tables of the schema: dotted name, whether there may be several, what they hold.
fn tables(root: &Value) -> Vec<(String, bool, String)> {
    fn walk(at: &Value, prefix: &str, depth: u32, out: &mut Vec<(String, bool, String)>) {
        let Some(properties) = at.get("properties").and_then(Value::as_object) else { return };
        for (k, v) in properties {
            let table = inner(v);
            if table.get("properties").is_none() && alike(table).is_none() {
                continue;
            }
            let name = if prefix.is_empty() { k.clone() } else { format!("{prefix}.{k}") };
            let what = v.get("description").and_then(Value::as_str).unwrap_or("").to_string();
            if table.get("patternProperties").is_some() {
                out.extend(IO_WORDS.iter().map(|w| (format!("{name}.{w}"), false, format!("What {w} does."))));
                continue;
            }
            out.push((name.clone(), v.get("items").is_some(), what));
            if depth < 4 {
                walk(table, &name, depth + 1, out);
            }
        }
    }
    let mut out = Vec::new();
    walk(root, "", 0, &mut out);
    out
}

/// Values of a key: those of the schema, and ids of what the program ships.
fn values(schema: Schema, path: &[String], v: &Value) -> Vec<(String, String)> {
    let quote = |s: &str| format!("\"{s}\"");
    if let Some(choices) = choices(v) {
        return choices.iter().map(|c| (quote(c), String::new())).collect();
    }
    if v.get("type").and_then(Value::as_str) == Some("boolean") {
        return ["true", "false"].map(|b| (b.to_string(), String::new())).to_vec();
    }
    let machines = || gr_machine::list().map(|id| (quote(id), gr_machine::builtin(id).map_or(String::new(), |m| m.title))).collect();
    match (schema, path.last().map(String::as_str)) {
        (Schema::Project, Some("machine")) | (Schema::Machine, Some("extends")) => machines(),
        (Schema::Project, Some("dialect")) => gr_spec::Dialect::all().iter().map(|d| (quote(d.id), d.title.to_string())).collect(),
        (Schema::Project, Some(list @ ("allow" | "warn" | "deny"))) => {
            let may = |d: &gr_spec::DiagnosticDef| d.lint && (list == "deny" || d.severity != gr_spec::Severity::Error);
            let all = gr_spec::Code::all().map(|c| c.def()).filter(|d| may(d));
            all.map(|d| (quote(d.slug), gr_spec::open(d.message))).collect()
        }
        (Schema::Project, Some("target")) => gr_spec::TargetDef::all().iter().map(|t| (quote(t.id), t.title.to_string())).collect(),
        _ => Vec::new(),
    }
}

/// Tables of the file.
pub fn outline(text: &str) -> Vec<Item> {
    let heads: Vec<(u32, &str, Vec<String>)> = lines(text).filter_map(|(s, l)| Some((s, l, header(l)?))).collect();
    let mut items = Vec::new();
    for (i, (start, line, path)) in heads.iter().enumerate() {
        let end = heads.get(i + 1).map_or(text.len() as u32, |h| h.0);
        let body = text.get(*start as usize..end as usize).unwrap_or("");
        let name = body.lines().skip(1).find_map(|l| {
            let (k, v) = l.split_once('=')?;
            matches!(k.trim(), "name" | "target" | "files").then(|| v.trim().trim_matches('"').to_string())
        });
        let trimmed = body.trim_end().len() as u32;
        items.push(Item {
            kind: ItemKind::Section,
            name: path.join("."),
            detail: name.unwrap_or_default(),
            range: Span::new(*start, *start + trimmed.max(line.len() as u32)),
            span: Span::new(*start, *start + line.trim_end().len() as u32),
            children: Vec::new(),
        });
    }
    items
}

/// Tables.
pub fn folds(text: &str) -> Vec<Fold> {
    let mut found: Vec<Fold> = Vec::new();
    let mut open: Option<(u32, u32)> = None;
    for (n, (_, line)) in lines(text).enumerate() {
        let n = n as u32;
        if header(line).is_some() {
            found.extend(open.filter(|(a, b)| b > a).map(|(first, last)| Fold { first, last, comment: false }));
            open = Some((n, n));
        } else if !line.trim().is_empty()
            && let Some((_, last)) = &mut open
        {
            *last = n;
        }
    }
    found.extend(open.filter(|(a, b)| b > a).map(|(first, last)| Fold { first, last, comment: false }));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "format = 1\nsource = \"a book\"\n\n[kinematics]\nkind = \"dh\"\n\n[[joint]]\nname = \"X\"\n\n";

    fn labels(text: &str, at: usize) -> Vec<String> {
        complete(Schema::Machine, text, at as u32).into_iter().map(|c| c.label).collect()
    }

    #[test]
    fn keys_values_tables() {
        assert_eq!(Schema::of("m.toml", TEXT), Some(Schema::Machine));
        assert_eq!(Schema::of("gcc-robot.toml", ""), Some(Schema::Project));
        assert_eq!(Schema::of("Cargo.toml", "[package]\n"), None);
        let h = hover(Schema::Machine, TEXT, TEXT.find("kind").unwrap() as u32 + 1);
        assert!(h.is_none_or(|h| h.text.contains("a book")));
        let joint = labels(TEXT, TEXT.len() - 1);
        assert!(joint.contains(&"type".to_string()) && !joint.contains(&"name".to_string()), "{joint:?}");
        let text = TEXT.replace("\"dh\"", "\"");
        let kinds = labels(&text, text.find("kind = \"").unwrap() + 8);
        assert!(kinds.contains(&"scara".to_string()), "{kinds:?}");
        let text = format!("{TEXT}orientation = \"").replace("[[joint]]\nname = \"X\"\n\n", "").replace("[kinematics]\nkind = \"dh\"\n\n", "");
        assert_eq!(labels(&text, text.len()), ["fixed", "abc-euler-xyz"]);
        let text = format!("{TEXT}[io.M");
        assert!(labels(&text, text.len()).contains(&"io.M8".to_string()));
        let text = format!("{TEXT}[io.M3]\nsi");
        assert_eq!(labels(&text, text.len()), ["signal"]);
        assert!(hover(Schema::Machine, &text, text.len() as u32 - 7).is_some());
        let text = "schema = 1\n[lints]\nallow = [\"spindle/stopped\", \"feed/";
        let lints: Vec<String> = complete(Schema::Project, text, text.len() as u32).into_iter().map(|c| c.label).collect();
        assert!(!lints.is_empty() && lints.iter().all(|l| l.starts_with("feed/")), "{lints:?}");
        let text = format!("{TEXT}[fr");
        assert!(labels(&text, text.len()).contains(&"frames".to_string()));
        assert_eq!(outline(TEXT).iter().map(|i| (i.name.as_str(), i.detail.as_str())).collect::<Vec<_>>(), [("kinematics", ""), ("joint", "X")]);
        assert_eq!(folds(TEXT).len(), 2);
    }
}
