//! Pages made from the tables. `GCC_ROBOT_WRITE_DOCS=1 cargo test -p gr-tests --test docs` writes them anew.

use std::fmt::Write;

use gr_spec::{Dialect, WordingDef};
use gr_tests::oracle::root;

/// Text in a cell of a table.
fn cell(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

fn args(code: &gr_spec::CodeDef) -> String {
    let mut words: Vec<String> = Vec::new();
    for a in code.args {
        for l in a.letters.chars() {
            words.push(if a.required { format!("**{l}**") } else { l.to_string() });
        }
    }
    words.join(" ")
}

fn dialect(out: &mut String, d: &Dialect) {
    let _ = writeln!(out, "\n## {} (`{}`)\n", d.title, d.id);
    if !d.aliases.is_empty() {
        let _ = writeln!(out, "Also called {}.\n", d.aliases.iter().map(|a| format!("`{a}`")).collect::<Vec<_>>().join(", "));
    }
    let elder = (d.id == "linuxcnc-2.10").then(Dialect::linuxcnc);
    if elder.is_some() {
        out.push_str("Everything of LinuxCNC 2.9; the rows that differ:\n\n");
    } else {
        out.push_str("| word | is | unit | |\n|---|---|---|---|\n");
        for w in d.words {
            let _ = writeln!(out, "| `{}` | {} | {} | {} |", w.letter, cell(w.title), w.unit, cell(w.what));
        }
        out.push('\n');
    }
    out.push_str("| code | is | words (bold: needed) | |\n|---|---|---|---|\n");
    for c in d.codes {
        let old = elder.and_then(|e| e.code(c.code));
        if old.is_some_and(|o| o.what == c.what && args(o) == args(c)) {
            continue;
        }
        let _ = writeln!(out, "| `{}` | {} | {} | {} |", c.code, cell(c.title), args(c), cell(c.what));
    }
    if !d.facts.is_empty() {
        out.push_str("\n| behaviour | value | |\n|---|---|---|\n");
        for f in d.facts {
            let _ = writeln!(out, "| {} | {} | {} |", cell(f.title), cell(f.value), cell(f.what));
        }
    }
    let mut sources: Vec<&str> = d.codes.iter().map(|c| c.source.split(", ").next().unwrap_or(c.source)).collect();
    sources.sort_unstable();
    sources.dedup();
    let _ = writeln!(out, "\nSources: {}.", sources.join("; "));
}

fn wording(out: &mut String, title: &str, rows: &[WordingDef]) {
    let _ = writeln!(out, "\n### {title}\n\n| form | |\n|---|---|");
    for r in rows {
        let _ = writeln!(out, "| `{}` | {} |", r.form, cell(r.what));
    }
}

fn page() -> String {
    let mut out = String::from("# Dialects\n\nMade from the tables in `spec/dialects`; do not edit by hand.\n");
    for id in ["linuxcnc-2.9", "linuxcnc-2.10", "fanuc-mill", "fanuc-turn", "grbl", "ufmg2008"] {
        dialect(&mut out, Dialect::find(id).expect("the six dialects"));
    }
    out.push_str("\n## RS274NGC: expressions, control, comments, parameters\n");
    wording(&mut out, "Functions", gr_spec::functions());
    wording(&mut out, "Operators, those that bind tightest first", gr_spec::operators());
    wording(&mut out, "Control lines", gr_spec::controls());
    wording(&mut out, "Active comments", gr_spec::comments());
    out.push_str("\n### Predefined parameters\n\n| parameter | unit | kept | |\n|---|---|---|---|\n");
    for p in gr_spec::parameters() {
        let name = match (p.name, p.first == p.last) {
            ("", true) => format!("#{}", p.first),
            ("", false) => format!("#{} … #{}", p.first, p.last),
            (name, _) => format!("#<{name}>"),
        };
        let _ = writeln!(out, "| `{name}` | {} | {} | {} |", p.unit, if p.persistent { "yes" } else { "" }, cell(p.what));
    }
    out
}

#[test]
fn the_page_of_dialects_is_up_to_date() {
    let file = root().join("docs/dialects.md");
    let page = page();
    if std::env::var_os("GCC_ROBOT_WRITE_DOCS").is_some() {
        std::fs::write(&file, &page).expect("docs/ is writable");
    }
    let kept = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(kept == page, "docs/dialects.md is stale: GCC_ROBOT_WRITE_DOCS=1 cargo test -p gr-tests --test docs");
}
