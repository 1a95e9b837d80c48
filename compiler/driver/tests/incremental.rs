//! Incremental = from scratch: whatever the chunk size and the order of edits, the answers are those of a fresh
//! session over the same text.

use gr_driver::{Cancelled, Check, Options, Session};
use gr_interp::Setup;
use gr_text::Diagnostic;
use proptest::prelude::*;

fn options(chunk: usize) -> Options {
    let mut options = Options::new(Setup::default());
    options.chunk_lines = Some(chunk);
    // Endless loops are found soon.
    (options.setup.budgets.passes, options.setup.budgets.blocks) = (100, 3000);
    options
}

fn scratch(text: &str, chunk: usize) -> Check {
    let mut session = Session::new();
    let file = session.open("part.ngc", text, options(chunk));
    session.check(file)
}

/// The check that remembers nothing.
fn once(text: &str, chunk: usize) -> Check {
    gr_driver::check_once("part.ngc", text, options(chunk)).check
}

/// What people see: easier to read in a failure than the whole structure.
fn shown(text: &str, all: &[Diagnostic]) -> Vec<String> {
    let line = |at: u32| text[..at as usize].matches('\n').count() + 1;
    all.iter()
        .map(|d| {
            let span = d.primary().1;
            format!("{}:{}..{} {:?} {:?} {} {:?} {:?}", line(span.start), span.start, span.end, d.severity, d.code, d.message, d.notes, d.trace)
        })
        .collect()
}

fn line() -> impl Strategy<Value = String> {
    let plain = prop_oneof![
        Just("G0 X1 Y2"),
        Just("G1 X3 F100"),
        Just("X4 Y-1"),
        Just("G2 X1 Y1 I1"),
        Just("G3 X0 Y0 R5"),
        Just("G91"),
        Just("G90"),
        Just("G20"),
        Just("G21"),
        Just("G18"),
        Just("G17"),
        Just("Z-3"),
        Just("G0 Z-5"),
        Just("G0 Z5"),
        Just("S1000 M3"),
        Just("M5"),
        Just("M8"),
        Just("G95 F100"),
        Just("G94"),
        Just("G93"),
        Just("G64 P0.001"),
        Just("G81 X1 Z-1 R1"),
        Just("G80"),
        Just("G41.1 D1"),
        Just("G40"),
        Just("G92 X1"),
        Just("G54"),
        Just("G55"),
        Just("G10 L2 P2 X5"),
        Just("G43.1 Z1"),
        Just("G28.1"),
        Just("G28"),
    ];
    let odd = prop_oneof![
        Just("(a comment)"),
        Just("; note"),
        Just("(unclosed"),
        Just("G1 X"),
        Just("X[1+"),
        Just("G99999"),
        Just("M2"),
        Just("%"),
        Just(""),
        Just("  "),
        Just("N10 G1 X1"),
        Just("(debug,#1)"),
        Just("G1 X#1"),
        Just("#1=5"),
        Just("#1=[#1+1]"),
        Just("#100=3"),
        Just("#100=[#100+1]"),
        Just("G1 X#100"),
        Just("#[100]=4"),
        Just("#101=2"),
        Just("#<width>=EXISTS[#<depth>]"),
        Just("#<depth>=2"),
        Just("G1 Z#<depth>"),
        Just("é\u{1F600}"),
        Just("/G0 X9"),
    ];
    let control = prop_oneof![
        Just("o1 if [#1 GT 2]"),
        Just("o1 else"),
        Just("o1 endif"),
        Just("o2 repeat [2]"),
        Just("o2 endrepeat"),
        Just("o3 sub"),
        Just("o3 endsub"),
        Just("o3 call [1]"),
        Just("o4 while [#1 LT 3]"),
        Just("o4 endwhile"),
        Just("M98 P3"),
    ];
    prop_oneof![8 => plain, 3 => odd, 1 => control].prop_map(str::to_string)
}

fn text() -> impl Strategy<Value = String> {
    let ends = prop_oneof![6 => Just("\n"), 1 => Just("\r\n"), 1 => Just("\r")];
    proptest::collection::vec((line(), ends), 0..40)
        .prop_map(|lines| lines.into_iter().map(|(l, e)| l + e).collect::<String>())
}

/// Programs as people write them: subroutines at the top or behind the end, loops and calls in the middle, with plain
/// stretches between them, and here and there something wrong.
fn structured() -> impl Strategy<Value = String> {
    let stretch = || proptest::collection::vec(line(), 0..6).prop_map(|l| l.join("\n") + "\n");
    let body = stretch().prop_map(|s| s.replace("M2\n", "").replace("%\n", "")).boxed();
    let sub = (101u32..104, body.clone(), any::<bool>()).prop_map(|(n, b, value)| {
        format!("o{n} sub\n{b}o{n} endsub{}\n", if value { " [#1+1]" } else { "" })
    });
    let block = prop_oneof![
        3 => stretch(),
        2 => (101u32..105, 0u32..4).prop_map(|(n, v)| format!("o{n} call [{v}]\n")),
        1 => (201u32..204, 0u32..4, body.clone()).prop_map(|(n, k, b)| format!("o{n} repeat [{k}]\n{b}o{n} endrepeat\n")),
        1 => (301u32..304, body.clone()).prop_map(|(n, b)| format!("#7=0\no{n} while [#7 LT 3]\n#7=[#7+1]\n{b}o{n} endwhile\n")),
        1 => (301u32..304, body.clone()).prop_map(|(n, b)| format!("#7=0\no{n} do\n#7=[#7+1]\n{b}o{n} while [#7 LT 2]\n")),
        1 => (401u32..404, 0u32..2, body.clone(), body.clone())
            .prop_map(|(n, c, a, b)| format!("o{n} if [{c}]\n{a}o{n} else\n{b}o{n} endif\n")),
        1 => (301u32..304, body.clone()).prop_map(|(n, b)| format!("o{n} while [1]\n{b}o401 if [1]\no{n} break\no401 endif\no{n} endwhile\n")),
        1 => (501u32..503, 0u32..3).prop_map(|(n, l)| format!("M98 P{n} L{l}\n")),
        1 => Just("G1 X#<_value> Y#<_call_level>\n".to_string()),
        1 => Just("G1 X[#<_line> MOD 3] F[#<_line> MOD 2]\n".to_string()),
        1 => Just("#<_global>=3\n".to_string()),
        1 => Just("G1 Z#<_global>\n".to_string()),
        1 => Just("G41.1 D1\nG1 X20 Y5\n".to_string()),
    ];
    let fanuc = (501u32..503, body).prop_map(|(n, b)| format!("O{n}\n{b}M99\n"));
    let end = prop_oneof![4 => Just("M2\n"), 1 => Just("%\n"), 1 => Just("")];
    let subs = proptest::collection::vec(sub, 0..3);
    let blocks = proptest::collection::vec(block, 0..10);
    let fanuc = proptest::collection::vec(fanuc, 0..3);
    (any::<bool>(), subs, blocks, end, fanuc, any::<bool>()).prop_map(
        |(percent, subs, blocks, end, fanuc, feeds)| {
            let text = format!("{}{}F100\n{}{end}{}", if percent { "%\n" } else { "" }, subs.concat(), blocks.concat(), fanuc.concat());
            if feeds { text.replace('\n', "\r\n") } else { text }
        },
    )
}

#[derive(Clone, Debug)]
struct Edit {
    at: usize,
    len: usize,
    new: String,
}

fn edit() -> impl Strategy<Value = Edit> {
    let new = prop_oneof![
        3 => text().prop_map(|t| t.chars().take(60).collect()),
        2 => line(),
        2 => Just(String::new()),
        2 => prop_oneof![Just("\n"), Just("\r"), Just("("), Just("1"), Just("G91"), Just("o"), Just("M2\n")].prop_map(str::to_string),
    ];
    (0usize..1000, prop_oneof![3 => Just(0usize), 3 => 0usize..4, 1 => 0usize..200], new)
        .prop_map(|(at, len, new)| Edit { at, len, new })
}

fn apply(text: &mut String, edit: &Edit) -> std::ops::Range<u32> {
    let boundary = |mut at: usize| {
        at = at.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let from = boundary(edit.at * (text.len() + 1) / 1000);
    let to = boundary(from + edit.len).max(from);
    text.replace_range(from..to, &edit.new);
    from as u32..to as u32
}

fn assert_same(text: &str, got: &Check, expected: &Check, what: &str) {
    let (got_lines, expected_lines) = (shown(text, &got.diagnostics), shown(text, &expected.diagnostics));
    let extra: Vec<_> = got_lines.iter().filter(|l| !expected_lines.contains(l)).collect();
    let missing: Vec<_> = expected_lines.iter().filter(|l| !got_lines.contains(l)).collect();
    assert!(got_lines == expected_lines, "{what}: too much {extra:#?}, missing {missing:#?} in\n{text}");
    assert!(got == expected, "{what}: labels, help or fixes differ\n{text}");
}

fn edits_leave_no_trace(text: String, edits: &[Edit], chunk: usize) {
    let mut expected = text;
    let mut session = Session::new();
    let file = session.open("part.ngc", &expected, options(chunk));
    for edit in edits {
        let range = apply(&mut expected, edit);
        session.edit(file, range, &edit.new);
        assert_eq!(session.text(file).as_deref(), Some(expected.as_str()));
        assert_same(&expected, &session.check(file), &scratch(&expected, 256), "edits");
    }
}

/// A file of Fanuc programs that jump, loop and call each other, each with block numbers of its own.
fn fanuc() -> impl Strategy<Value = String> {
    let line = || {
        prop_oneof![
            3 => line().prop_map(|l| if l.contains(['o', '%']) { "G0 X1.".to_string() } else { l }),
            3 => (1u32..6, line()).prop_map(|(n, l)| if l.contains(['o', '%', 'N']) { format!("N{n}0") } else { format!("N{n}0 {l}") }),
            2 => (1u32..6).prop_map(|n| format!("GOTO {n}0")),
            2 => (1u32..6, 1u32..5).prop_map(|(n, k)| format!("IF [#1 LT {k}] GOTO {n}0")),
            1 => Just("#1=#1+1".to_string()),
            1 => (0u32..4).prop_map(|k| format!("IF [#1 EQ {k}] THEN #2=#1")),
            1 => (1u32..4, 1u32..3).prop_map(|(k, n)| format!("WHILE [#1 LT {k}] DO {n}\n#1=#1+1\nEND {n}")),
            1 => prop_oneof![Just("WHILE [#1 LT 2] DO 1"), Just("END 1"), Just("DO 2"), Just("END 2")].prop_map(str::to_string),
            2 => (1u32..5, 1u32..4).prop_map(|(n, l)| format!("M98 P{n} L{l}")),
            1 => (1u32..5, 1u32..4).prop_map(|(n, a)| format!("G65 P{n} A{a}.")),
            1 => (0u32..6).prop_map(|n| if n == 0 { "M99".to_string() } else { format!("M99 P{n}0") }),
        ]
    };
    let body = proptest::collection::vec(line(), 0..12);
    let end = prop_oneof![3 => Just("M30"), 3 => Just("M99"), 1 => Just("")];
    let program = (1u32..5, body, end).prop_map(|(n, body, end)| format!("O{n}\n{}\n{end}\n", body.join("\n")));
    (any::<bool>(), proptest::collection::vec(program, 1..4)).prop_map(|(percent, all)| if percent { format!("%\n{}%\n", all.concat()) } else { all.concat() })
}

fn fanuc_edit() -> impl Strategy<Value = Edit> {
    let jump = prop_oneof![Just("GOTO 10\n"), Just("N20 "), Just("O3\n"), Just("O"), Just("0"), Just("M99\n"), Just("END 1\n"), Just("IF [#1 LT 2] GOTO 30\n")];
    (edit(), proptest::option::of(jump)).prop_map(|(e, jump)| Edit { new: jump.map_or(e.new, str::to_string), ..e })
}

fn fanuc_options(chunk: usize) -> Options {
    let mut options = options(chunk);
    options.setup.dialect = gr_spec::Dialect::find("fanuc-mill").expect("a dialect");
    options
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), ..ProptestConfig::default() })]

    #[test]
    fn fanuc_programs_leave_no_trace_either(text in fanuc(), edits in proptest::collection::vec(fanuc_edit(), 0..4), chunk in 1usize..9) {
        let fresh = |text: &str, chunk: usize| {
            let mut session = Session::new();
            let file = session.open("part.nc", text, fanuc_options(chunk));
            session.check(file)
        };
        let mut session = Session::new();
        let file = session.open("part.nc", &text, fanuc_options(chunk));
        let mut now = text;
        assert_same(&now, &session.check(file), &fresh(&now, 256), "chunks");
        for edit in &edits {
            let range = apply(&mut now, edit);
            session.edit(file, range, &edit.new);
                assert_same(&now, &session.check(file), &fresh(&now, 256), "edits");
        }
        assert_same(&now, &gr_driver::check_once("part.nc", now.as_str(), fanuc_options(chunk)).check, &fresh(&now, 256), "once");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), ..ProptestConfig::default() })]

    #[test]
    fn chunk_size_is_invisible(text in text(), chunk in 1usize..9) {
        let expected = scratch(&text, 256);
        assert_same(&text, &scratch(&text, chunk), &expected, "chunks");
        assert_same(&text, &once(&text, chunk), &expected, "once");
    }

    #[test]
    fn edits_are_invisible(text in text(), edits in proptest::collection::vec(edit(), 1..8), chunk in prop_oneof![1usize..9, Just(256)]) {
        edits_leave_no_trace(text, &edits, chunk);
    }

    #[test]
    fn chunk_size_is_invisible_in_structured_programs(text in structured(), chunk in 1usize..9) {
        let expected = scratch(&text, 256);
        assert_same(&text, &scratch(&text, chunk), &expected, "chunks");
        assert_same(&text, &once(&text, chunk), &expected, "once");
    }

    #[test]
    fn edits_are_invisible_in_structured_programs(text in structured(), edits in proptest::collection::vec(edit(), 1..8), chunk in 1usize..9) {
        edits_leave_no_trace(text, &edits, chunk);
    }

    #[test]
    fn a_range_is_a_part_of_the_whole(text in text(), chunk in 1usize..9, from in 0u32..40, len in 1u32..10) {
        let mut session = Session::new();
        let file = session.open("part.ngc", &text, options(chunk));
        // Nothing that only the rest of the file can tell may be in it.
        let whole = session.check(file).diagnostics;
        for d in session.check_range(file, from..from + len) {
            let line = text[..d.primary().1.start as usize].matches('\n').count() as u32;
            prop_assert!(text.contains('\r') || (from..=from + len).contains(&line));
            prop_assert!(whole.iter().any(|w| w.code == d.code && w.primary() == d.primary()), "{:?} is not in {:?}", d, whole);
        }
    }
}

/// More cases on request: `GCC_ROBOT_CASES=20000 cargo test`.
fn cases() -> u32 {
    std::env::var("GCC_ROBOT_CASES").ok().and_then(|v| v.parse().ok()).unwrap_or(256)
}

#[test]
fn findings_beyond_the_limit_are_counted() {
    let lints = "G64 P0.0001\nG1 X1\nG1 X2\n".repeat(3000);
    let looped = "#1=0\no1 while [#1 LT 20]\n#1=[#1+1]\nG64 P0.0002\nG1 X[#1]\no1 endwhile\n".repeat(3);
    let damaged = "X[1+\n".repeat(2500);
    let text = format!("G21 G90 G17\nF100\nS100 M3\n{looped}{lints}{looped}M5\nM2\n{damaged}");
    for chunk in [7, 256] {
        let mut options = Options::new(Setup::default());
        options.chunk_lines = Some(chunk);
        let mut session = Session::new();
        let file = session.open("part.ngc", &text, options.clone());
        let whole = session.check(file);
        let counts: Vec<usize> = whole.unlisted.values().copied().collect();
        assert_eq!(counts.iter().filter(|n| **n > 1000).count(), 2, "{:?}", whole.unlisted);
        assert_eq!(gr_driver::check_once("part.ngc", &text, options).check, whole);
    }
}

fn program(lines: usize) -> String {
    let moves: String = (0..lines).map(|i| format!("G1 X{}.5 Y{}\n", i % 97, i % 89)).collect();
    format!("G21 G90 G17\nS1000 M3\nF100\n{moves}M5\nM2\n")
}

#[test]
fn a_keystroke_scans_and_interprets_one_chunk() {
    let mut text = program(4000);
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(100));
    assert_eq!(session.check(file).diagnostics, vec![]);
    for (from, to, new) in [(".5", ".25", "coordinate"), ("Y", "F200 Y", "feed"), ("G1", "(x)\nG1", "comment line")].map(|(a, b, n)| (a, b, n)) {
        let before = session.executed();
        let at = text[20_000..].find(from).unwrap() + 20_000;
        text.replace_range(at..at + from.len(), to);
        session.edit(file, at as u32..(at + from.len()) as u32, to);
        session.check(file);
        let after = session.executed();
        assert_eq!(after.scans - before.scans, 1, "{new}");
        let steps = after.steps - before.steps;
        // A feed word changes the state of everything below; the rest converges at the next chunk.
        assert!(steps <= 2 || new == "feed", "{new}: {steps} steps");
    }
}

#[test]
fn a_line_above_moves_diagnostics_and_interprets_nothing_below() {
    let text = program(2000).replace("X50.5 Y1\n", "X50.5 Y1 G99999\n");
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(50));
    let first = session.check(file).diagnostics;
    assert!(!first.is_empty());
    let before = session.executed();
    session.edit(file, 12..12, "(one more line)\n");
    let second = session.check(file).diagnostics;
    assert!(session.executed().steps - before.steps <= 1);
    let moved: Vec<_> = first.iter().map(|d| d.primary().1.start + 16).collect();
    assert_eq!(second.iter().map(|d| d.primary().1.start).collect::<Vec<_>>(), moved);
}

/// A subroutine and a loop at the top, plain lines with a call in the middle.
fn structured_program(lines: usize) -> String {
    let moves = |from: usize| (from..from + lines / 2).map(|i| format!("G1 X{}.5 Y{}\n", i % 97, i % 89)).collect::<String>();
    let top = "G21 G90 G17\nS1000 M3\nF100\no100 sub\nG1 Z#1\nG0 Z5\no100 endsub\n";
    let rows = "#100=0\no101 while [#100 LT 10]\no100 call [-#100]\n#100=[#100+1]\no101 endwhile\n";
    format!("{top}{rows}{}o100 call [-1]\n{}M5\nM2\n", moves(0), moves(7))
}

#[test]
fn a_keystroke_in_a_plain_chunk_runs_no_control_flow() {
    let mut text = structured_program(4000);
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(100));
    assert_eq!(session.check(file).diagnostics, vec![]);
    // Before the call in the middle, and behind it.
    for from in [10_000, text.len() - 10_000] {
        let before = session.executed();
        let at = text[from..].find(".5").unwrap() + from;
        text.replace_range(at..at + 2, ".25");
        session.edit(file, at as u32..at as u32 + 2, ".25");
        session.check(file);
        let after = session.executed();
        assert_eq!((after.scans - before.scans, after.flows - before.flows), (1, 0));
        assert!(after.steps - before.steps <= 2, "{} steps", after.steps - before.steps);
    }
}

#[test]
fn an_edit_of_a_subroutine_runs_its_callers() {
    let mut text = structured_program(4000);
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(100));
    session.check(file);
    let before = session.executed();
    let at = text.find("G0 Z5").unwrap();
    text.replace_range(at..at + 5, "G0 Z6");
    session.edit(file, at as u32..at as u32 + 5, "G0 Z6");
    assert_eq!(session.check(file), scratch(&text, 256));
    let after = session.executed();
    assert_eq!(after.scans - before.scans, 1);
    // The top with its loop, and the call in the middle.
    assert_eq!(after.flows - before.flows, 2);
}

#[test]
fn a_line_behind_a_call_leaves_the_call_alone() {
    let text = structured_program(4000);
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(100));
    session.check(file);
    let before = session.executed();
    let at = text.len() as u32 - 20_000;
    let at = at + text[at as usize..].find('\n').unwrap() as u32 + 1;
    session.edit(file, at..at, "(one more line)\n");
    session.check(file);
    let after = session.executed();
    assert_eq!(after.flows, before.flows);
    assert!(after.steps - before.steps <= 1);
}

/// A subroutine at the top and a call of it in every tenth line.
fn calls_everywhere(lines: usize) -> String {
    let block = |i: usize| if i % 10 == 9 { "o100 call\n".to_string() } else { format!("G1 X{}.5 Y{}\n", i % 97, i % 89) };
    format!("G21 G90 G17\nS1000 M3\nF100\no100 sub\nG1 Z-1\no100 endsub\n{}M5\nM2\n", (0..lines).map(block).collect::<String>())
}

#[test]
fn a_line_above_calls_leaves_them_alone() {
    let mut text = calls_everywhere(4000);
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(100));
    assert_eq!(session.check(file).diagnostics, vec![]);
    for at in [text.len() / 2, text.len() / 4, text.len() / 3] {
        let at = at + text[at..].find('\n').unwrap() + 1;
        for (old, new) in [("", "(one more line)\n"), ("(one more line)\n", "")] {
            let before = session.executed();
            text.replace_range(at..at + old.len(), new);
            session.edit(file, at as u32..(at + old.len()) as u32, new);
            assert_eq!(session.check(file), scratch(&text, 256));
            assert!(session.executed().flows - before.flows <= 1);
        }
    }
}

/// A branch with a label of its own in every tenth line.
fn labels_everywhere(lines: usize) -> String {
    let block = |i: usize| if i % 10 == 9 { format!("o{i} if [1]\nM8\no{i} endif\n") } else { format!("G1 X{}.5 Y{}\n", i % 97, i % 89) };
    format!("G21 G90 G17\nS1000 M3\nF100\n{}M5\nM9\nM2\n", (0..lines).map(block).collect::<String>())
}

#[test]
fn a_line_above_labels_leaves_those_below_alone() {
    let mut text = labels_everywhere(4000);
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(100));
    assert_eq!(session.check(file), scratch(&text, 256));
    let at = text[text.len() / 3..].find("G1 X").unwrap() + text.len() / 3;
    for (old, new) in [("", "(one more line)\n"), ("(one more line)\n", ""), ("", "G1 X\n")] {
        let before = session.executed();
        text.replace_range(at..at + old.len(), new);
        session.edit(file, at as u32..(at + old.len()) as u32, new);
        assert_eq!(session.check(file), scratch(&text, 256));
        // A mistake makes the controller forget all labels.
        assert!(session.executed().flows - before.flows <= 1 || new.ends_with("X\n"));
    }
}

#[test]
fn a_parameter_that_nothing_reads_changes_nothing_below() {
    let mut text = calls_everywhere(4000);
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(100));
    session.check(file);
    let at = text[text.len() / 3..].find("G1 X").unwrap() + text.len() / 3;
    for (old, new, most) in [("", "#100=5\n", 1), ("5", "6", 1), ("6\n", "6\n#<width>=2\n", 1), ("", "G1 X#100\n", 1000)] {
        let from = at + text[at..].find(old).unwrap();
        let before = session.executed();
        text.replace_range(from..from + old.len(), new);
        session.edit(file, from as u32..(from + old.len()) as u32, new);
        assert_eq!(session.check(file), scratch(&text, 256));
        assert!(session.executed().flows - before.flows <= most, "{new}");
    }
}

#[test]
fn a_file_that_is_called_reads_what_its_caller_does_not() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mill.ngc"), "o<mill> sub\nG1 X[1/#100] F100\no<mill> endsub\nM2\n").unwrap();
    let path = folder.path().join("main.ngc").to_string_lossy().into_owned();
    let mut options = options(1);
    let dir = folder.path().to_string_lossy().into_owned();
    options.setup.ini.values.insert(("rs274ngc".into(), "subroutine_path".into()), vec![dir]);
    let mut session = Session::new();
    let main = session.open(&path, "G21\n#100=1\nG1 X5 F100\no<mill> call\nM2\n", options);
    assert_eq!(session.check(main).diagnostics, vec![]);
    session.edit(main, 9..10, "0");
    assert_eq!(session.check(main).diagnostics.len(), 1);
}

#[test]
fn labels_do_not_add_up() {
    // Labels are never forgotten; 20 000 of them, open at once, were once taken over from chunk to chunk.
    let open: String = (0..20_000).map(|i| format!("o{i} if [1]\n")).collect();
    let close: String = (0..20_000).rev().map(|i| format!("o{i} endif\n")).collect();
    let text = format!("G21 F100\n{open}G1 X1\n{close}M2\n");
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, Options::new(Setup::default()));
    assert_eq!(session.check(file).diagnostics, vec![]);
}

#[test]
fn findings_and_ways_below_move_with_their_lines() {
    // The fault is in a subroutine at the top; its way leads over a call far below.
    let mut text = calls_everywhere(1000).replace("G1 Z-1\n", "G1 Z-1\n#1=[1/[#2-1]]\n").replace("M5\n", "#2=1\no100 call [0] [1]\nM5\n");
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(50));
    let found = session.check(file).diagnostics;
    assert_eq!(found.len(), 1, "{found:?}");
    for at in [text.len() / 2, 0] {
        let at = text[at..].find('\n').unwrap() + at + 1;
        text.insert_str(at, "(one more line)\n");
        session.edit(file, at as u32..at as u32, "(one more line)\n");
        assert_eq!(session.check(file), scratch(&text, 256));
    }
}

#[test]
fn an_open_subroutine_file_comes_before_the_one_on_disk() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mill.ngc"), "o<mill> sub\nG1 X1 F100\no<mill> endsub\nM2\n").unwrap();
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let mut options = options(4);
    let dir = folder.path().to_string_lossy().into_owned();
    options.setup.ini.values.insert(("rs274ngc".into(), "subroutine_path".into()), vec![dir]);
    let mut session = Session::new();
    let main = session.open(&path("main.ngc"), "G21\no<mill> call\nM2\n", options.clone());
    let codes = |session: &Session| session.check(main).diagnostics.iter().map(|d| d.code.def().slug).collect::<Vec<_>>();
    assert_eq!(codes(&session), Vec::<&str>::new());
    let sub = session.open(&path("./mill.ngc"), "o<mill> sub\nG1 X1 F0\no<mill> endsub\nM2\n", options);
    assert_eq!(codes(&session), ["feed/missing"]);
    assert_eq!(session.check(main).diagnostics[0].primary().0, sub);
    let text = session.text(sub).unwrap();
    let at = text.find("F0").unwrap() as u32;
    session.edit(sub, at..at + 2, "F9");
    assert_eq!(codes(&session), Vec::<&str>::new());
    session.edit(sub, at..at + 2, "F0");
    assert_eq!(codes(&session), ["feed/missing"]);
    session.close(sub);
    assert_eq!(codes(&session), Vec::<&str>::new());
}

#[test]
fn visible_lines_first() {
    let text = program(20_000);
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(100));
    session.check(file);
    session.edit(file, 0..0, "G91\n");
    let before = session.executed();
    session.check_range(file, 0..500);
    let steps = session.executed().steps - before.steps;
    assert!(steps <= 7, "{steps} steps for 500 lines");
}

#[test]
fn an_edit_cancels_a_snapshot() {
    // Minutes of work within the budgets, none of it motion.
    for block in ["#3=[#3+1]", "#4=SIN[#3]"] {
        let section = |n: usize| format!("o{n} repeat [18]\no{} repeat [900000]\n{block}\no{0} endrepeat\no{n} endrepeat\n", n + 1);
        let text: String = "G21\n#3=0\n".to_string() + &(1..40).map(|i| section(2 * i)).collect::<String>() + "M2\n";
        let mut session = Session::new();
        let mut patient = options(100);
        patient.setup.budgets = gr_interp::Budgets::default();
        let file = session.open("part.ngc", &text, patient);
        let snapshot = session.snapshot();
        let worker = std::thread::spawn(move || {
            let result = snapshot.check(file);
            drop(snapshot);
            result
        });
        let begun = std::time::Instant::now();
        while session.executed().flows == 0 && begun.elapsed().as_secs() < 60 {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        session.edit(file, 0..text.len() as u32, "G21\nG0 X1\nM2\n");
        let cut_short = worker.join().expect("no panic comes out of a snapshot");
        assert_eq!(cut_short, Err(Cancelled), "{block}");
        assert_eq!(session.check(file), scratch("G21\nG0 X1\nM2\n", 1024));
    }
}

/// Found by the properties above.
#[test]
fn cases_that_once_failed() {
    let text = "/G0 X9\nS1000 M3\nG0 X1 Y2\nG64 P0.001\nG0 X1 Y2\nG20\nG2 X1 Y1 I1\nG10 L2 P2 X5\no4 endwhile\n%\nG1G95 F100\n X#1\nG99999\n(debug,#1)\n";
    for chunk in 1..9 {
        assert_same(text, &scratch(text, chunk), &scratch(text, 256), "chunks");
    }
    let mut text = text.replace("G95 F100\n", "");
    let mut session = Session::new();
    let file = session.open("part.ngc", &text, options(1));
    session.check(file);
    let range = apply(&mut text, &Edit { at: 790, len: 0, new: "G95 F100\n".to_string() });
    session.edit(file, range, "G95 F100\n");
    assert_same(&text, &session.check(file), &scratch(&text, 256), "edit");
}

#[test]
fn a_hundred_mistakes_are_enough_whatever_the_chunks() {
    let text = "G21\n".to_string() + &"G1 X1\n(fine)\n".repeat(300) + "M2\n";
    let whole = scratch(&text, 10_000);
    assert_eq!(whole.diagnostics.len(), 100);
    for chunk in [1, 3, 7, 64] {
        assert_same(&text, &scratch(&text, chunk), &whole, "many mistakes");
    }
}

#[test]
fn a_faulty_assignment_sets_nothing_later() {
    let text = "F100\no201 repeat [1]\n#<depth>=2o201 endrepeat\nG0 X1 Y2\nG1 Z#<_global>\nM2\n";
    for chunk in [1, 3, 256] {
        let found = scratch(text, chunk).diagnostics;
        assert!(found.iter().any(|d| d.message.contains("#<_global> has no value")), "{:?}", shown(text, &found));
    }
}
