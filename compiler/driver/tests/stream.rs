//! A run into a sink and a check agree about what is clean.

use gr_canon::{Printer, Version};
use gr_driver::{Options, Session, lower, stream};
use gr_interp::Setup;
use proptest::prelude::*;

fn check(text: &str) -> usize {
    let mut session = Session::new();
    let file = session.open("part.ngc", text, Options::new(Setup::default()));
    session.check(file).diagnostics.len()
}

fn clean(text: &str) -> bool {
    let setup = Setup::default();
    let rules = Options::new(setup.clone()).rules;
    stream("part.ngc", text.into(), &setup, Some(&rules), gr_canon::Discard).clean
}

fn line() -> impl Strategy<Value = &'static str> {
    prop_oneof![
        Just("G0 X1 Y2 Z5"),
        Just("G1 X3 F100"),
        Just("G1 Z-2 F100"),
        Just("G0 Z-3"),
        Just("G2 X1 Y1 I1"),
        Just("M5"),
        Just("S1000 M3"),
        Just("M8"),
        Just("T1 M6"),
        Just("G43"),
        Just("G64 P0.001"),
        Just("G1 X#1"),
        Just("o1 call"),
        Just("o2 repeat [2]"),
        Just("o2 endrepeat"),
        Just("G20"),
        Just("(unclosed"),
        Just("%"),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn clean_is_what_a_check_finds_nothing_in(lines in proptest::collection::vec(line(), 0..12), end in any::<bool>()) {
        let body = lines.join("\n");
        let text = format!("G21 G90 G17\nS500 M3\no1 sub\nG1 X2 F50\no1 endsub\n{body}\nM5\n{}\n", if end { "M2" } else { "" });
        let found = check(&text);
        prop_assert!(!clean(&text) || found == 0, "{} findings in\n{}", found, text);
        let plain = format!("G21 G90 G17\nS500 M3\nG1 X2 F50\n{body}\nM5\n{}\n", if end { "M2" } else { "" });
        let found = check(&plain);
        prop_assert!(!clean(&plain) || found == 0, "{} findings in\n{}", found, plain);
    }
}

#[test]
fn good_programs_are_clean() {
    let moves: String = (0..5000).map(|i| format!("G1 X{}.5 Y{}\n", i % 97, i % 89)).collect();
    for text in [
        format!("G21 G90 G17\nS1000 M3\nF100\n{moves}M5\nM2\n"),
        format!("G21 G90 G17\nS1000 M3\nF100\no1 sub\nG1 X1\no1 endsub\no1 call\n{moves}M5\nM2\n"),
    ] {
        assert_eq!(check(&text), 0);
        assert!(clean(&text));
        assert!(!clean(&text.replace("M5\n", "")) || check(&text.replace("M5\n", "")) == 0);
    }
}

#[test]
fn the_stream_is_that_of_the_interpreter() {
    struct Whole(gr_gcode::File);
    impl gr_interp::Files for Whole {
        fn file(&self, _id: gr_canon::FileId) -> &gr_gcode::File {
            &self.0
        }
        fn find_sub(&mut self, _name: &str) -> Option<gr_canon::FileId> {
            None
        }
    }
    let text: String = (0..3000).map(|i| format!("G1 X{}.5 Y{} F{}\n", i % 97, i % 89, 100 + i % 7)).collect();
    let text = format!("o1 sub\nG2 X1 Y1 I1\no1 endsub\n{text}o1 call\nM2\n");
    let setup = Setup::default();
    let mut whole = Whole(gr_driver::scan_file("part.ngc", &text, setup.dialect));
    let mut run = gr_interp::Interp::new(&mut whole, &setup, Printer::new(Vec::new(), Version::V2_9));
    run.run(gr_canon::FileId(0));
    let expected = run.into_sink().into_inner();
    let streamed = stream("part.ngc", text.as_str().into(), &setup, None, Printer::new(Vec::new(), Version::V2_9));
    assert!(streamed.sink.into_inner() == expected);
    assert!(!streamed.clean, "nobody asked for lints");
    let motion = lower("part.ngc", text.as_str().into(), &setup, None);
    assert_eq!(motion.texts.len(), 1);
    assert!(motion.program.len() > 3000);
}
