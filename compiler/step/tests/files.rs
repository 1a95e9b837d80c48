//! Whole files: the damaged listing and its repair, fragments, probes, other schemas.

mod examples;

use examples::{data, diagnostics};
use gr_text::{Diagnostic, FileId, LineIndex, Severity, code};
use std::collections::BTreeMap;

/// Statements by their first word (`#17`), one per line.
fn statements(text: &str) -> BTreeMap<String, String> {
    let lines = text.lines().filter(|l| l.starts_with('#'));
    lines.filter_map(|l| l.split_once('=').map(|(id, _)| (id.to_string(), l.to_string()))).collect()
}

fn dense(s: &str) -> String {
    s.chars().filter(|c| !c.is_whitespace()).collect()
}

/// Messages by the statement they are in; those outside of instances under their line's first word.
fn by_statement(text: &str, all: &[Diagnostic]) -> BTreeMap<String, Vec<Diagnostic>> {
    let lines = LineIndex::new(text.as_bytes());
    let mut out: BTreeMap<String, Vec<Diagnostic>> = BTreeMap::new();
    for d in all {
        let line = lines.position(d.primary().1.start).0 as usize;
        let words = text.lines().nth(line).unwrap_or("");
        let key = words.split(['=', ':', ' ']).next().unwrap_or("").to_string();
        out.entry(key).or_default().push(d.clone());
    }
    out
}

#[test]
fn damaged_listing_one_message_each() {
    let (damaged, repaired) = (data("three-faces-damaged.p21"), data("three-faces.p21"));
    let (a, b) = (statements(&damaged), statements(&repaired));
    assert_eq!((a.len(), b.len()), (732, 732), "a statement is swallowed");
    let all = diagnostics(&damaged);
    let found = by_statement(&damaged, &all);
    let (mut blanks, mut harmed) = (0, 0);
    let mut wrong = Vec::new();
    // White space is content within keywords, which have none; elsewhere only inside of strings.
    for (id, line) in &a {
        let messages = found.get(id).map_or(&[][..], |v| v);
        if *line == b[id] {
            if let Some(d) = messages.iter().find(|d| d.severity == Severity::Error) {
                wrong.push(format!("{id} is healthy: {}", d.message));
            }
            continue;
        }
        let keyword = |l: &str| l.split(['=', '(']).nth(1).unwrap_or("").to_string();
        if dense(line) == dense(&b[id]) && keyword(line) == keyword(&b[id]) {
            blanks += 1;
            if !messages.is_empty() {
                wrong.push(format!("{id} differs by blanks only: {:?}", messages.iter().map(|d| &d.message).collect::<Vec<_>>()));
            }
        } else {
            harmed += 1;
            let warning = id == "#53" || id == "#153";
            let expected = if warning { Severity::Warning } else { Severity::Error };
            if messages.len() != 1 || messages[0].severity != expected {
                wrong.push(format!("{id}: {:?}: {line}", messages.iter().map(|d| &d.message).collect::<Vec<_>>()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!((blanks, harmed), (31, 139));
    let colons: Vec<_> = all.iter().filter(|d| d.code == gr_spec::code::P21_MISSING_SEMICOLON).collect();
    let outside = colons.iter().filter(|d| !damaged[..d.primary().1.start as usize].rsplit('\n').next().unwrap_or("").starts_with('#'));
    assert_eq!(outside.count(), 3, "ENDSEC: DATA: and ENDSEC:");
}

#[test]
fn repaired_listing_is_read_whole() {
    let text = data("three-faces.p21");
    let all = diagnostics(&text);
    assert!(all.iter().all(|d| d.severity != Severity::Error), "{:#?}", all.iter().find(|d| d.severity == Severity::Error));
    let orphans = all.iter().filter(|d| d.code == gr_spec::code::STEP_ORPHAN_WORKINGSTEP).count();
    assert_eq!(orphans, 14);
}

/// Any instance that lost its `);` is one error more, and the edit that is offered makes the file what it was.
#[test]
fn a_lost_end_is_one_error() {
    let text = data("base.p21");
    let errors = |text: &str| -> Vec<Diagnostic> { diagnostics(text).into_iter().filter(|d| d.severity == Severity::Error).collect() };
    let before = errors(&text);
    let lines: Vec<&str> = text.lines().collect();
    let ends = |l: &str| l.starts_with('#') && l.ends_with(");") && !l.contains("/*");
    for (n, line) in lines.iter().enumerate().filter(|(_, l)| ends(l)) {
        let damaged: String = lines.iter().enumerate().map(|(k, l)| if k == n { format!("{}\n", &line[..line.len() - 2]) } else { format!("{l}\n") }).collect();
        let found = errors(&damaged);
        assert_eq!(found.len(), before.len() + 1, "{line}\n{found:#?}");
        let lost = found.iter().find(|d| d.code == code::P21_MISSING_SEMICOLON).unwrap_or_else(|| panic!("{line}\n{found:#?}"));
        let (_, span, with) = &lost.fixes[0].edits[0];
        let mut mended = damaged.clone();
        mended.replace_range(span.range(), with);
        assert_eq!(mended.trim_end(), text.trim_end(), "{line}");
    }
}

#[test]
fn every_prefix_of_a_plan_is_survived() {
    let text = data("slot-square-u.p21");
    for n in (0..text.len()).filter(|n| text.is_char_boundary(*n)) {
        diagnostics(&text[..n]);
    }
}

#[test]
fn fragments_get_located_errors() {
    let text = data("test-program.p21");
    let all = diagnostics(&text);
    let lines = LineIndex::new(text.as_bytes());
    let at: Vec<u32> = all.iter().filter(|d| d.severity == Severity::Error).map(|d| lines.position(d.primary().1.start).0 + 1).collect();
    assert!(at.len() > 30, "{}", at.len());
    for line in [6, 7, 8, 9, 10, 12, 25, 26, 30, 40, 44, 45] {
        assert!(at.contains(&line), "nothing about line {line}");
    }
}

#[test]
fn wrapped_at_any_column_it_says_the_same() {
    let text = data("slot-square-u.p21");
    let body = &text[text.find("DATA;").expect("data")..];
    let head = &text[..text.find("DATA;").expect("data")];
    let messages = |t: &str| diagnostics(t).into_iter().map(|d| (d.code, d.message, d.notes)).collect::<Vec<_>>();
    let whole = messages(&text);
    let flat = body.replace('\n', "");
    for width in [41, 44, 7] {
        let lines: Vec<String> = flat.as_bytes().chunks(width).map(|c| String::from_utf8_lossy(c).into_owned()).collect();
        assert_eq!(messages(&format!("{head}{}\n", lines.join("\n"))), whole, "{width}");
    }
}

#[test]
fn probes_with_the_schema() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../p21/tests/probes");
    let index = std::fs::read_to_string(folder.join("INDEX.tsv")).expect("index");
    let mut wrong = Vec::new();
    for row in index.lines().filter(|l| !l.starts_with('#')) {
        let (name, faults) = row.split_once('\t').expect("columns");
        let bytes = std::fs::read(folder.join(name)).expect("probe");
        let text = gr_text::decode(bytes).text;
        let lines = LineIndex::new(text.as_bytes());
        let found: Vec<String> = diagnostics(&text)
            .iter()
            // A probe is a few statements, not a plan.
            .filter(|d| d.severity != Severity::Hint)
            .map(|d| {
                let (l, c) = lines.position(d.primary().1.start);
                format!("{}:{}:{}", l + 1, c + 1, d.code.def().code)
            })
            .collect();
        let expected = if faults == "ok" { String::new() } else { faults.to_string() };
        if found.join(" ") != expected {
            wrong.push(format!("{name}: expected {expected}, found {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn other_schemas_get_one_message() {
    for (schema, code) in [("AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }", "E0418"), ("INTEGRATED_CNC_SCHEMA", "E0419"), ("IFC4", "E0418"), ("FOO", "E0420")] {
        let text = format!("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('{schema}'));\nENDSEC;\nDATA;\n#1=SOMETHING_ELSE('',#2);\n#2=SOMETHING_MORE('');\nENDSEC;\nEND-ISO-10303-21;\n");
        let found: Vec<&str> = diagnostics(&text).iter().map(|d| d.code.def().code).collect();
        assert_eq!(found, [code], "{schema}");
    }
}

#[test]
fn products_of_other_schemas_are_named() {
    let head = "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n";
    let mut text = head.to_string();
    for (n, name) in ["frame", "bolt", "plate", "", "jig"].iter().enumerate() {
        let n = 10 * (n + 1);
        text += &format!("#{n}=PRODUCT('p{n}','{name}','',());\n#{}=PRODUCT_DEFINITION_FORMATION('','',#{n});\n", n + 1);
        text += &format!("#{}=PRODUCT_DEFINITION('','',#{},#99);\n", n + 2, n + 1);
    }
    text += "#99=PRODUCT_DEFINITION_CONTEXT('',$,'');\n";
    for (n, (whole, part)) in [(12, 22), (12, 32), (12, 22), (32, 42), (32, 100)].iter().enumerate() {
        text += &format!("#{}=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#{whole},#{part},$);\n", 101 + n);
    }
    text += "#100=PRODUCT_DEFINITION('','',$,#99);\nENDSEC;\nEND-ISO-10303-21;\n";
    let said = diagnostics(&text);
    assert_eq!(said.len(), 1, "{said:#?}");
    assert_eq!(said[0].notes, ["assembly 'frame' (p10) of 2 × 'bolt' (p20), 'plate' (p30)", "assembly 'plate' (p30) of 'p40'", "product 'jig' (p50)"]);
}

#[test]
fn a_circle_of_plans_is_found_and_left() {
    let text = examples::file("#2=WORKPLAN('a',(#10,#100),$,$,$);\n#100=WORKPLAN('b',(#101),$,$,$);\n#101=WORKPLAN('c',(#2),$,$,$);");
    let found = diagnostics(&text);
    let cycle: Vec<_> = found.iter().filter(|d| d.code == gr_spec::code::STEP_CYCLE).collect();
    assert_eq!(cycle.len(), 1);
    assert!(cycle[0].message.contains("#2 → #100 → #101 → #2"), "{}", cycle[0].message);
}

#[test]
fn any_byte_may_be_wrong() {
    for name in ["slot-square-u.p21", "base.p21", "test-program.p21"] {
        let text = data(name);
        for n in 0..text.len() {
            let mut bytes = text.clone().into_bytes();
            bytes[n] = b"'\"(;/#.$)=,0A \n"[n % 15];
            let Ok(broken) = String::from_utf8(bytes) else { continue };
            for d in diagnostics(&broken) {
                for l in &d.labels {
                    assert!(l.span.start <= l.span.end && l.span.end as usize <= broken.len(), "{name} {n}: {d:?}");
                }
            }
        }
    }
}

#[test]
fn one_wrong_byte_in_a_statement_loses_no_other() {
    let text = data("base.p21");
    let whole = gr_p21::parse(text.as_bytes());
    let count = whole.instances.len();
    for n in text.find("DATA;").expect("data") + 6..text.rfind("ENDSEC").expect("end") {
        // Bytes that separate statements may join two of them.
        if text.as_bytes()[n] < b' ' || matches!(text.as_bytes()[n], b'#' | b';' | b'=') || text[..n].ends_with('#') {
            continue;
        }
        let mut bytes = text.clone().into_bytes();
        bytes[n] = b"'\"(?.$)"[n % 7];
        let broken = gr_p21::parse(&bytes);
        let here = whole.instances.iter().position(|i| i.start as usize <= n && n < i.end as usize);
        for (k, i) in whole.instances.iter().enumerate().filter(|(k, i)| Some(*k) != here && i.id > 0) {
            let found = broken.find(i.id).unwrap_or_else(|| panic!("#{} is lost by byte {n}", i.id));
            assert!(!broken.instances[found as usize].damaged, "#{} is damaged by byte {n} ({k} of {count})", i.id);
        }
    }
}

/// A file that was cut off in its data: what it refers to behind the cut is no mistake of its own.
#[test]
fn a_cut_file_is_told_once() {
    let text = include_str!("../../../docs/examples/stepnc/case-study.p21");
    let data = text.find("DATA;").expect("data") + 6;
    let end = text.rfind("ENDSEC;").expect("an end");
    for at in (data..end).step_by(53).filter(|at| text.is_char_boundary(*at)) {
        let found = gr_step::diagnostics(&text[..at], FileId(0));
        let errors: Vec<_> = found.iter().filter(|d| d.severity == Severity::Error).collect();
        assert!(!errors.is_empty(), "cut at {at}");
        assert!(errors.iter().all(|d| d.code != code::P21_DANGLING_REFERENCE), "cut at {at}: {errors:#?}");
    }
}

/// An instance whose name is damaged is missed elsewhere: still one message.
#[test]
fn a_lost_name_is_one_message() {
    let healthy = include_str!("../../../docs/examples/stepnc/case-study.p21");
    for head in ["#0=", "#-18=", "#4=", "// #18=", "#=", "# 18x=", "#18@=", "#18\"="] {
        let text = healthy.replacen("#18=MILLING", &format!("{head}MILLING"), 1);
        assert_ne!(text, healthy);
        let all: Vec<Diagnostic> = diagnostics(&text).into_iter().filter(|d| d.severity == Severity::Error).collect();
        let places: Vec<_> = all.iter().map(|d| (d.code.def().code, d.message.clone())).collect();
        assert_eq!(all.len(), 1, "{head}: {places:?}");
        let line = LineIndex::new(text.as_bytes()).position(all[0].primary().1.start).0;
        assert_eq!(line, text[..text.find(&format!("{head}MILLING")).unwrap_or(0)].matches('\n').count() as u32, "{head}");
    }
    // Without such a name each reference is told.
    let text = healthy.replacen("#18=MILLING", "#999018=MILLING", 1);
    assert!(diagnostics(&text).iter().any(|d| d.code == code::P21_DANGLING_REFERENCE));
}

/// What rests on a damaged statement has no message of its own.
#[test]
fn what_refers_to_a_damaged_statement_is_silent() {
    let healthy = include_str!("../../../docs/examples/stepnc/case-study.p21");
    for (from, to) in [
        ("DIRECTION('right',(1.,0.,0.))", "DIRECTION('right',(1.,,0.,0.))"),
        ("DIRECTION('right',(1.,0.,0.))", "DIRECTION('right',(1. 0.,0.))"),
        ("DIRECTION('right',(1.,0.,0.))", "DIRECTION('right',(1.;,0.,0.))"),
        ("CARTESIAN_POINT('',(0.,105.,0.))", "CARTESIAN_POINT('',(0.,105.,0,0))"),
        ("SLOT('slot A',#11,", "SLOT('slot A',,#11,"),
        ("SLOT('slot B',#11,", "SLOT('slot B',,#11,"),
    ] {
        let text = healthy.replacen(from, to, 1);
        assert_ne!(text, healthy);
        let all: Vec<Diagnostic> = diagnostics(&text);
        let before = diagnostics(healthy).len();
        let places: Vec<_> = all.iter().map(|d| (d.code.def().code, d.message.clone())).collect();
        assert_eq!(all.len(), before + 1, "{to}: {places:?}");
        let at = all.iter().find(|d| d.severity == Severity::Error).expect("an error").primary().1.start as usize;
        let begin = text.find(to).unwrap_or(0);
        assert!((begin..begin + to.len()).contains(&at), "{to}: {places:?}");
    }
}

/// A comment that ends later than was meant: one message, which points at it.
#[test]
fn instances_inside_a_comment_are_told_once() {
    let healthy = include_str!("../../../docs/examples/stepnc/case-study.p21");
    let text = healthy.replacen("#18=MILLING", "/* #18=MILLING", 1).replacen("#26=MILLING", "*/ #26=MILLING", 1);
    let all: Vec<Diagnostic> = diagnostics(&text).into_iter().filter(|d| d.severity == Severity::Error).collect();
    assert_eq!(all.len(), 1, "{all:?}");
    let comment = all[0].labels.iter().find(|l| l.text.contains("comment")).expect("a label");
    assert_eq!(comment.span.start as usize, text.find("/* #18").unwrap_or(0));
}

/// A check that nobody waits for any more ends between its layers; one that goes through says what any other does.
#[test]
fn a_check_can_be_cut_short() {
    let text = include_str!("../../../docs/examples/stepnc/mistakes.p21");
    let exchange = gr_p21::parse(text.as_bytes());
    let file = gr_text::FileId(0);
    let asked = std::cell::Cell::new(0);
    let run = |times: u32| {
        asked.set(0);
        let wanted = || asked.replace(asked.get() + 1) < times;
        gr_step::diagnostics_while(text.as_bytes(), &exchange, file, &wanted)
    };
    let whole = run(u32::MAX);
    assert_eq!(whole, Some(gr_step::diagnostics_of(text.as_bytes(), &exchange, file)));
    let layers = asked.get();
    assert!(layers >= 4, "{layers}");
    for times in 0..layers {
        assert_eq!(run(times), None, "{times}");
    }
}

/// An angle in radians is one that may be meant: a plunge of 241 degrees is none.
#[test]
fn an_angle_in_radians_could_be_meant() {
    let told = |instance: &str| {
        let text = format!("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','2026-01-01T00:00:00',(''),(''),'','','');\nFILE_SCHEMA(('MACHINING_SCHEMA'));\nENDSEC;\nDATA;\n#1={instance};\nENDSEC;\nEND-ISO-10303-21;\n");
        diagnostics(&text).iter().any(|d| d.code == code::STEP_RADIANS)
    };
    assert!(!told("PLUNGE_RAMP($,4.213461147531602)") && told("PLUNGE_RAMP($,0.213461147531602)"));
    assert!(!told("AP_RETRACT_ANGLE($,5.241234567,3.)") && !told("PLUNGE_HELIX($,2.,1.6123456)"));
    assert!(!told("MILLING_TOOL_DIMENSION(20.,2.5235987755982988,$,70.,$,$,$)") && told("MILLING_TOOL_DIMENSION(20.,0.5235987755982988,$,70.,$,$,$)"));
    assert!(told("CONICAL_HOLE_BOTTOM(2.0943951023931953,$)") && !told("CONICAL_HOLE_BOTTOM(4.71238898038469,$)"));
}
