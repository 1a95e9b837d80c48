//! `gcc-robot explain E0203 | arc/radius-mismatch | G83 | F | MILLING_TECHNOLOGY`

use gr_spec::{ArgDef, Code, CodeDef, Dialect, Severity, WordDef, open};

use crate::exit::Exit;
use crate::options::ExplainArgs;

pub fn run(args: &ExplainArgs) -> Exit {
    if args.list {
        return super::print(&list());
    }
    let name = args.name.as_deref().unwrap_or("").trim();
    let Some(dialect) = Dialect::find(&args.dialect) else {
        eprintln!("there is no dialect {}; known: {}", args.dialect, dialects());
        return Exit::Usage;
    };
    if let Some(text) = explain(name, dialect) {
        return super::print(&text);
    }
    eprintln!("nothing is known about {name} in dialect {}", dialect.id);
    let near = similar(name, dialect);
    if !near.is_empty() {
        eprintln!("similar: {}", near.join(", "));
    }
    Exit::Usage
}

/// Ids of all dialects.
pub fn dialects() -> String {
    let all: Vec<&str> = Dialect::all().iter().map(|d| d.id).collect();
    all.join(", ")
}

fn list() -> String {
    Code::all()
        .map(|c| {
            let d = c.def();
            let lint = if d.lint { "lint" } else { word(d.severity) };
            format!("{} {:<8}{:<32}{}\n", d.code, lint, d.slug, gr_spec::fill(d.message, &["…".into(), "…".into(), "…".into(), "…".into()]))
        })
        .collect()
}

fn explain(name: &str, dialect: &Dialect) -> Option<String> {
    if let Some(code) = Code::find(name) {
        return Some(diagnostic(code));
    }
    if let Some(def) = dialect.code(&normalised(name)) {
        return Some(code(def, dialect));
    }
    let mut letters = name.chars();
    match (letters.next(), letters.next()) {
        (Some(letter), None) => dialect.word(letter.to_ascii_uppercase()).map(|w| word_letter(w, dialect)),
        _ => gr_ide::p21::page::page(name),
    }
}

/// `g05.1` → `G5.1`
fn normalised(name: &str) -> String {
    let upper = name.to_ascii_uppercase();
    let Some(letter) = upper.chars().next() else { return upper };
    let number = &upper[letter.len_utf8()..];
    let short = number.trim_start_matches('0');
    let zero = if short.is_empty() || short.starts_with('.') { "0" } else { "" };
    if number.is_empty() { upper } else { format!("{letter}{zero}{short}") }
}

fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Hint => "hint",
    }
}

fn diagnostic(code: Code) -> String {
    let d = code.def();
    let kind = if d.lint { format!("{}, a lint", word(d.severity)) } else { word(d.severity).to_string() };
    let mut text = format!("{} {} ({kind})\n\n{}\n\n{}\n", d.code, d.slug, open(d.message), d.explanation);
    if let Some(fix) = d.fix {
        text.push_str(&format!("\nWhat to do: {}\n", open(fix)));
    }
    text.push_str(&examples_are_for(d));
    for (title, program) in [("This raises it:", d.bad), ("This is right:", d.good)] {
        if let Some(program) = program {
            text.push_str(&format!("\n{title}\n\n{}\n", indented(program)));
        }
    }
    text
}

/// What to know before the examples are tried.
fn examples_are_for(d: &gr_spec::DiagnosticDef) -> String {
    let mut text = String::new();
    match d.dialect {
        Some("part21") => text.push_str("The examples are statements of the DATA section of a STEP-NC file, or whole files.\n"),
        Some(dialect) => text.push_str(&format!("The examples are for --dialect {dialect}.\n")),
        None => {}
    }
    match d.options {
        Some("check") | None => {}
        Some("machine check") => text.push_str("The examples are machine files, for `gcc-robot machine check`.\n"),
        Some(options) => text.push_str(&format!("The examples are for `gcc-robot {options}`.\n")),
    }
    if let Some(tools) = d.tools {
        text.push_str(&format!("The examples need this tool table (--tools):\n\n{}\n", indented(tools)));
    }
    let examples = [d.bad, d.good].into_iter().flatten();
    if examples.clone().any(|e| e.contains(['\0', '\r'])) {
        text.push_str("The byte 0 is shown as ␀, a carriage return as ␍.\n");
    }
    if text.is_empty() || examples.count() == 0 { String::new() } else { format!("\n{text}") }
}

fn indented(program: &str) -> String {
    let lines: Vec<String> = program.split('\n').map(|l| format!("    {}", l.replace('\0', "␀").replace('\r', "␍"))).collect();
    lines.join("\n").trim_end().to_string()
}

fn code(def: &CodeDef, dialect: &Dialect) -> String {
    let mut text = format!("{} {} ({})\n\n{}\n", def.code, def.title, dialect.title, def.what);
    if def.group != "none" && !def.group.is_empty() {
        let title = gr_spec::groups().iter().find(|g| g.slug == def.group).map_or(def.group, |g| g.title);
        text.push_str(&format!("\nModal group: {title}\n"));
    }
    if !def.args.is_empty() {
        text.push_str("\nWords:\n");
        def.args.iter().for_each(|a| text.push_str(&argument(a)));
    }
    if !def.errors.is_empty() {
        text.push_str("\nIt can raise:\n");
        for code in def.errors.iter().filter_map(|e| Code::find(e)) {
            text.push_str(&format!("  {} {}\n", code.def().code, open(code.def().message)));
        }
    }
    if !def.source.is_empty() {
        text.push_str(&format!("\nSource: {}\n", def.source));
    }
    text
}

fn argument(a: &ArgDef) -> String {
    let letters: Vec<String> = a.letters.chars().map(String::from).collect();
    let need = if a.required { "needed" } else { "optional" };
    let unit = if a.unit.is_empty() { String::new() } else { format!(", {}", a.unit) };
    format!("  {:<12} {} ({need}{unit})\n", letters.join(" "), a.what)
}

fn word_letter(w: &WordDef, dialect: &Dialect) -> String {
    let unit = if w.unit.is_empty() { String::new() } else { format!("\n\nUnit: {}", w.unit) };
    format!("{} {} ({})\n\n{}{unit}\n", w.letter, w.title, dialect.title, w.what)
}

/// Names that begin alike.
fn similar(name: &str, dialect: &Dialect) -> Vec<String> {
    let name = normalised(name);
    let head: String = name.chars().take(2).collect();
    let codes = dialect.codes.iter().map(|c| c.code.to_string()).filter(|c| c.starts_with(&head));
    let slugs = Code::all().map(|c| c.def().slug.to_string()).filter(|s| name.len() > 3 && s.contains(&name.to_lowercase()));
    codes.chain(slugs).take(8).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found() {
        let linuxcnc = Dialect::linuxcnc();
        assert_eq!(normalised("g05.1"), "G5.1");
        assert_eq!(normalised("m00"), "M0");
        assert_eq!(normalised("G"), "G");
        assert!(explain("e0203", linuxcnc).unwrap().contains("arc/radius-mismatch"));
        assert!(explain("arc/radius-mismatch", linuxcnc).unwrap().starts_with("E0203"));
        assert!(explain("g083", linuxcnc).unwrap().starts_with("G83 "));
        assert!(explain("f", linuxcnc).unwrap().contains("feed"));
        assert!(explain("milling_technology", linuxcnc).unwrap().contains("`feedrate`"));
        assert!(explain("G1234", linuxcnc).is_none() && explain("", linuxcnc).is_none() && explain("é", linuxcnc).is_none());
    }
}
