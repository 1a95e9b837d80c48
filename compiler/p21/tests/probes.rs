//! The probe files: each feature of the three editions, and one fault per file at its exact place.

use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/probes")
}

/// Files of the index, with `line:column:code` of what is wrong in each.
fn index() -> Vec<(PathBuf, Vec<String>)> {
    let text = std::fs::read_to_string(folder().join("INDEX.tsv")).expect("the index");
    let rows = text.lines().filter(|l| !l.starts_with('#'));
    rows.map(|l| {
        let (file, faults) = l.split_once('\t').expect("two columns");
        let faults = if faults == "ok" { vec![] } else { faults.split(' ').map(str::to_string).collect() };
        (folder().join(file), faults)
    })
    .collect()
}

fn found(text: &[u8]) -> Vec<String> {
    let parsed = gr_p21::parse(text);
    let lines = gr_text::LineIndex::new(text);
    let place = |at: u32| {
        let (line, column) = lines.position(at);
        format!("{}:{}", line + 1, column + 1)
    };
    let mut all: Vec<(u32, String)> =
        parsed.faults.iter().map(|f| (f.span.start, format!("{}:{}", place(f.span.start), f.code.def().code))).collect();
    for (n, _) in parsed.dangling(text) {
        let at = parsed.values[n].start;
        all.push((at, format!("{}:E0306", place(at))));
    }
    all.sort();
    all.into_iter().map(|(_, s)| s).collect()
}

#[test]
fn enough_of_them() {
    let index = index();
    assert!(index.len() >= 42, "{}", index.len());
    assert!(index.iter().filter(|(_, f)| f.is_empty()).count() >= 21);
}

#[test]
fn each_fault_at_its_place() {
    let mut wrong = Vec::new();
    for (path, faults) in index() {
        let text = std::fs::read(&path).expect("a probe");
        // What the schema says (E04) is another crate's.
        let expected: Vec<String> = faults.into_iter().filter(|f| f.contains(":E03")).collect();
        let found = found(&text);
        if found != expected {
            wrong.push(format!("{}: expected {expected:?}, found {found:?}", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn reading_and_checking_agree() {
    for (path, _) in index() {
        let text = std::fs::read(&path).expect("a probe");
        assert_eq!(gr_p21::check_syntax(&text), gr_p21::parse(&text).faults, "{}", path.display());
    }
}

#[test]
fn index_and_parse_agree_on_valid_files() {
    for (path, _) in index().into_iter().filter(|(_, f)| f.is_empty()) {
        let text = std::fs::read(&path).expect("a probe");
        let by_index: Vec<u64> = gr_p21::index(&text).entries.iter().map(|e| e.id).collect();
        let parsed = gr_p21::parse(&text);
        let by_parse: Vec<u64> = parsed.instances.iter().filter(|i| text[i.start as usize] == b'#').map(|i| i.id).collect();
        assert_eq!(by_index, by_parse, "{}", path.display());
    }
}

#[test]
fn healthy_neighbors_of_a_fault_stay() {
    let text = std::fs::read(folder().join("68-five-faults.p21")).expect("a probe");
    let parsed = gr_p21::parse(&text);
    for id in [2, 4, 6, 8, 10, 11] {
        let n = parsed.find(id).unwrap_or_else(|| panic!("#{id} is lost"));
        assert!(!parsed.instances[n as usize].damaged, "#{id}");
    }
}

#[test]
fn any_prefix_and_any_byte_is_survived() {
    let text = std::fs::read(folder().join("02-process-plan.p21")).expect("a probe");
    for n in 0..text.len() {
        gr_p21::check_syntax(&text[..n]);
        gr_p21::format(&text[..n]);
        let mut broken = text.clone();
        broken[n] = b"'\"(;/#.$\0\xFF"[n % 10];
        let parsed = gr_p21::parse(&broken);
        for v in &parsed.values {
            let _ = (parsed.real(&broken, *v), parsed.string(&broken, *v), parsed.reference(&broken, *v), parsed.enumeration(&broken, *v));
        }
        gr_p21::index(&broken);
        gr_p21::format(&broken);
        let _ = gr_p21::renumber(&broken);
    }
}
