//! One fault per file, and files that are valid though unusual: what is said about each, with line, column and words.
//! `GCC_ROBOT_WRITE_PROBES=1 cargo test -p gr-step --test probes` writes what is said now; read the difference.

mod examples;

use std::fmt::Write;

use examples::{data, diagnostics, file};
use gr_text::{LineIndex, Severity};

struct Probe {
    name: String,
    body: String,
    said: String,
}

impl Probe {
    /// A probe is a whole file, or statements of a small one. The last line of a whole file has no end.
    fn text(&self) -> String {
        let body = self.body.replace("<CR>", "\r").replace("<BOM>", "\u{FEFF}").replace("<PAGE>", "\u{C}");
        if self.name.ends_with("(whole)") {
            return body.strip_suffix('\n').unwrap_or(&body).replace("<LF>", "\n");
        }
        format!(
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('probe'),'2;1');\nFILE_NAME('p','2026-01-01T00:00:00',(''),(''),'','','');\nFILE_SCHEMA(('MACHINING_SCHEMA','MILLING_SCHEMA'));\nENDSEC;\nDATA;\n{body}ENDSEC;\nEND-ISO-10303-21;\n"
        )
    }

    fn found(&self) -> String {
        let text = self.text();
        let lines = LineIndex::new(text.as_bytes());
        let mut out = String::new();
        // A probe is a few statements, not a plan.
        for d in diagnostics(&text).iter().filter(|d| d.severity != Severity::Hint) {
            let (line, column) = lines.position(d.primary().1.start);
            let kind = format!("{:?}", d.severity).to_lowercase();
            let _ = writeln!(out, "{}:{} {kind} {} {}", line + 1, column + 1, d.code.def().code, d.message);
        }
        out
    }
}

fn probes() -> (String, Vec<Probe>) {
    let text = data("probes.txt");
    let mut parts = text.split("== ");
    let head = parts.next().unwrap_or("").to_string();
    let probes = parts.map(|p| {
        let (name, rest) = p.split_once('\n').expect("a name");
        let (body, said) = rest.split_once("-- said\n").expect("what is said");
        Probe { name: name.into(), body: body.into(), said: said.into() }
    });
    (head, probes.collect())
}

#[test]
fn each_probe_says_what_the_table_has() {
    let (head, probes) = probes();
    if std::env::var_os("GCC_ROBOT_WRITE_PROBES").is_some() {
        let mut new = head;
        for p in &probes {
            let _ = write!(new, "== {}\n{}-- said\n{}", p.name, p.body, p.found());
        }
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/probes.txt");
        std::fs::write(path, new).expect("writable");
        return;
    }
    let wrong: Vec<String> = probes
        .iter()
        .filter(|p| p.found() != p.said)
        .map(|p| format!("{}:\n{}expected\n{}found\n{}", p.name, p.body, p.said, p.found()))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn valid_ones_are_silent_and_faults_are_not() {
    let (_, probes) = probes();
    let valid = |p: &&Probe| p.name.starts_with("valid");
    assert!(probes.iter().filter(valid).all(|p| p.said.is_empty()));
    assert!(probes.iter().filter(|p| !valid(p)).all(|p| !p.said.is_empty()));
    assert!(probes.len() >= 120, "{}", probes.len());
}

#[test]
fn reading_checking_and_the_index_agree() {
    for p in probes().1 {
        let text = p.text();
        let parsed = gr_p21::parse(text.as_bytes());
        assert_eq!(gr_p21::check_syntax(text.as_bytes()), parsed.faults, "{}", p.name);
        if p.name.starts_with("valid") {
            let ids: Vec<u64> = gr_p21::index(text.as_bytes()).entries.iter().map(|e| e.id).collect();
            let read: Vec<u64> =
                parsed.instances.iter().filter(|i| text.as_bytes()[i.start as usize] == b'#').map(|i| i.id).collect();
            assert_eq!(ids, read, "{}", p.name);
        }
    }
}

#[test]
fn what_is_cut_off_is_told_once() {
    let text = file("");
    let mut wrong = Vec::new();
    for n in (14..text.trim_end().len()).filter(|n| text.is_char_boundary(*n)) {
        let said = gr_p21::check_syntax(text[..n].as_bytes());
        // The last `;` may be all that is missing.
        if said.len() != 1 {
            wrong.push(format!("{n} …{:?}: {said:?}", &text[n.saturating_sub(20)..n]));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
