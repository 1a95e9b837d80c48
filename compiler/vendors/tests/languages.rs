//! Every language: text of a realistic program as a snapshot, nothing but the files when something is wrong.

mod common;
use common::*;
use gr_ir::Texts;
use gr_text::FileId;
use gr_vendors::Options;

const SOURCE: &str = "(pocket)\nT1 M6\nG54\nG0 X0 Y0\nS12000\nM3\nM8\nG1 Z-20 F3000\nX40 F1000\nG3 X50 Y10 J10\nG3 X40 Y20 I-10\nG1 X0\nG4 P0.5\n\
G0 Z10\nM5\nT7 M6\nG43 H7\nG55\nG1 X-5 Y2 F750\nG2 Y-14 J-8\nM2\n";

#[test]
fn texts_of_a_realistic_program() {
    for target in TARGETS {
        let program = sample(target);
        let sources = Texts::new([(FileId(0), SOURCE)]);
        let options = Options { allow_unverified: true, ..Options::default() };
        let output = gr_vendors::language(target).unwrap().emit(&program, &sources, &options);
        let mut shown = String::new();
        for (name, text) in common::texts(&output) {
            assert!(!text.contains("-0.000 ") && !text.contains("NaN") && !text.contains("inf"), "{target}: {text}");
            shown += &format!("=== {name}\n{}", text.replace('\r', ""));
        }
        for f in &output.findings {
            shown += &format!("{:?} {}: {}\n", f.severity, f.code.def().code, f.message);
        }
        assert!(!output.files.is_empty(), "{target}: {shown}");
        insta::assert_snapshot!(target, shown);
    }
}

#[test]
fn the_same_program_gives_the_same_bytes() {
    for target in TARGETS {
        let program = sample(target);
        assert_eq!(emit(target, &program), emit(target, &program), "{target}");
    }
}

#[test]
fn every_language_is_in_the_table_and_the_other_way_round() {
    for l in gr_vendors::languages() {
        assert!(gr_spec::TargetDef::find(l.id()).is_some(), "{}", l.id());
        assert!(TARGETS.contains(&l.id()));
    }
    assert_eq!(gr_vendors::languages().len(), TARGETS.len());
}
