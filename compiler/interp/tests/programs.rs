//! Small programs: what they must print, the same through the real `rs274` where it is installed, and chunk by
//! chunk as through the whole.

mod harness;

use gr_canon::{At, Call, CallFrame, FileId, FrameId, Printer, Sink, Version};
use gr_interp::{Budgets, End, Interp, Outcome, Params, Setup, State, run_chunk};
use gr_spec::{Dialect, code};
use gr_tests::oracle::{Job, reference};
use proptest::prelude::*;

use harness::{Memory, TOOLS, chunk, run_with, setup};

fn run(text: &str) -> (String, Outcome) {
    run_with(&setup(), text, 3)
}

/// The calls without numbers and prologue.
fn calls(text: &str) -> Vec<String> {
    let (out, outcome) = run(text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    out.lines().skip(6).map(|l| l.splitn(2, "N..... ").nth(1).unwrap_or(l).to_string()).collect()
}

fn fault(text: &str) -> (&'static str, u32, String) {
    let (_, outcome) = run(text);
    let f = outcome.findings.iter().find(|f| f.fault.rs.is_some()).expect("a fault");
    (f.fault.code.def().slug, f.line, f.fault.rs_text().unwrap_or_default())
}

#[test]
fn the_prologue_and_the_end() {
    let (out, outcome) = run("G21\nM2\n");
    assert!(outcome.ok());
    assert_eq!(outcome.end, End::Program);
    let expected = "    1 N..... USE_LENGTH_UNITS(CANON_UNITS_MM)
    2 N..... SET_G5X_OFFSET(1, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
    3 N..... SET_G92_OFFSET(0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
    4 N..... SET_XY_ROTATION(0.0000)
    5 N..... SET_FEED_REFERENCE(CANON_XYZ)
    6 N..... ON_RESET()
    7 N..... USE_LENGTH_UNITS(CANON_UNITS_MM)
    8 N..... SET_G5X_OFFSET(1, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
    9 N..... SET_XY_ROTATION(0.0000)
   10 N..... SET_FEED_MODE(0, 0)
   11 N..... SET_FEED_RATE(0.0000)
   12 N..... STOP_SPINDLE_TURNING(0)
   13 N..... SET_SPINDLE_MODE(0 0.0000)
   14 N..... PROGRAM_END()
   15 N..... ON_RESET()
   16 N..... ON_RESET()
";
    assert_eq!(out, expected);
}

#[test]
fn settings_take_effect_after_the_block() {
    let c = calls("#1=1\n#1=2 #2=#1 #<a>=5\nG0 X#2 Y#1 Z#<a>\nM2\n");
    assert_eq!(c[0], "STRAIGHT_TRAVERSE(1.0000, 2.0000, 5.0000, 0.0000, 0.0000, 0.0000)");
}

#[test]
fn arithmetic_of_the_controller() {
    let c = calls("(debug,%d#1)\n#1=[2**3**2] #2=[-7 MOD 3] #3=FIX[-2.8] #4=ROUND[-2.5] #5=FIX[2*SIN[30]]\n(debug,%d#1 #2 #3 #4 #5)\nM2\n");
    assert_eq!(c[0], "MESSAGE(\"0\")");
    assert_eq!(c[1], "MESSAGE(\"64 2 -3 -3 1\")");
}

#[test]
fn a_returned_value_can_be_passed_on() {
    let c = calls("o<g> sub\no<g> endsub [#1+2]\no<f> sub\no<g> call [3]\no<f> endsub [#<_value>+#<_value_returned>]\n\
                   o<h> sub\no<g> call [1]\no<h> return [#<_value>*2]\no<h> endsub\n\
                   o<f> call\n(debug,%d#<_value>)\no<h> call\n(debug,%d#<_value> #<_value_returned>)\nM2\n");
    assert_eq!(c[..2], ["MESSAGE(\"6\")", "MESSAGE(\"6 1\")"]);
}

#[test]
fn subroutines_loops_and_branches() {
    let text = "\
o<square> sub
o<square> endsub [#1*#1]
#2=0
o1 while [#2 LT 3]
  #2=[#2+1]
  o2 if [#2 EQ 2]
    o1 continue
  o2 endif
  o<square> call [#2]
  G0 X#<_value>
o1 endwhile
o3 repeat [2]
G0 Y#2
o3 endrepeat
o4 do
#2=[#2-1]
o4 while [#2 GT 0]
G0 Z#2
M2
";
    let c = calls(text);
    let x: Vec<&str> = c.iter().filter_map(|l| l.strip_prefix("STRAIGHT_TRAVERSE(")).map(|l| &l[..22]).collect();
    assert_eq!(x, ["1.0000, 0.0000, 0.0000", "9.0000, 0.0000, 0.0000", "9.0000, 3.0000, 0.0000", "9.0000, 3.0000, 0.0000", "9.0000, 3.0000, 0.0000"]);
}

#[test]
fn faults_name_line_and_text() {
    assert_eq!(fault("G21\nG1 X1\nM2\n"), ("feed/missing", 1, "Cannot do g1 with zero feed rate".into()));
    assert_eq!(fault("#1=[1/0]\nM2\n"), ("expression/division-by-zero", 0, "Attempt to divide by zero".into()));
    assert_eq!(fault("G0 X1"), ("program/ends-early", 0, "File ended with no percent sign or program end".into()));
    assert_eq!(fault("o<x> call\nM2\n").0, "sub/not-found");
    assert_eq!(fault("G68\nM2\n"), ("code/unknown", 0, "Unknown g code used".into()));
    assert_eq!(fault("T7\nM2\n").2, "Requested tool 7 not found in the tool table");
    assert_eq!(fault("M100\nM2\n").2, "Unknown m code used: M100");
}

#[test]
fn spans_are_relative_to_the_line() {
    let (_, outcome) = run("G21\nG0 X1 Y[1/0]\nM2\n");
    let span = outcome.findings[0].span.expect("a place");
    assert_eq!(&"G0 X1 Y[1/0]"[span.range()], "[1/0]");
    let (_, outcome) = run("G21\nG0 X1 R5\nM2\n");
    let span = outcome.findings[0].span.expect("a place");
    assert_eq!(&"G0 X1 R5"[span.range()], "R5");
}

#[test]
fn damaged_lines_are_hints_until_they_are_reached() {
    let (_, outcome) = run("o1 if [0]\nG1 X[\no1 endif\nM2\nG1 Y]\n");
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert_eq!(outcome.damaged, [(FileId(0), 1), (FileId(0), 4)]);
}

#[test]
fn unclosed_branches_are_told() {
    let (_, outcome) = run("o1 if [1]\nG0 X1\nM2\n");
    assert!(outcome.ok());
    assert_eq!(outcome.findings[0].fault.code, code::FLOW_UNCLOSED);
}

#[test]
fn endless_programs_end() {
    let budgets = Budgets { blocks: 10_000, passes: 100, calls: 10_000 };
    let setup = Setup { budgets, loop_on_main_m99: true, ..setup() };
    for text in ["o1 while [1]\no1 endwhile\nM2\n", "o1 do\nG4 P0\no1 while [1]\nM2\n", "G0 X1\nM99\n"] {
        let (_, outcome) = run_with(&setup, text, 2);
        assert_eq!(outcome.end, End::Fault, "{text}");
        assert_eq!(outcome.findings[0].fault.code, code::RUN_ENDLESS, "{text}");
    }
}

#[test]
fn the_order_of_a_spline_has_a_limit() {
    let text = "F100\nG5.2 P1 L65 X1 Y1\nG5.3\nM2\n";
    let (_, outcome) = run_with(&setup(), text, 2);
    assert_eq!((outcome.end, outcome.findings[0].fault.code), (End::Fault, code::RUN_ENDLESS));
}

#[test]
fn file_subroutines_and_remaps() {
    let mut setup = setup();
    setup.ini.values.insert(("rs274ngc".into(), "remap".into()), vec!["M400 modalgroup=10 argspec=Pq ngc=foo".into()]);
    let mut files = Memory::default()
        .add("main.ngc", "M400 P3 G0 Y7\no<bar> call [4]\nM2\n", &setup, 1)
        .add("foo.ngc", "o<foo> sub\nG0 X#<p>\no<foo> endsub\n", &setup, 2)
        .add("bar.ngc", "o<bar> sub\nG0 Z#1\no<bar> endsub\nM2\n", &setup, 9);
    let mut printed = Vec::new();
    let mut printer = Printer::new(&mut printed, Version::V2_9);
    let outcome = Interp::new(&mut files, &setup, &mut printer).run(FileId(0));
    printer.flush();
    drop(printer);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let out = String::from_utf8(printed).expect("text");
    let moves: Vec<&str> = out.lines().filter_map(|l| l.split("STRAIGHT_TRAVERSE(").nth(1)).map(|l| &l[..22]).collect();
    assert_eq!(moves, ["3.0000, 0.0000, 0.0000", "3.0000, 7.0000, 0.0000", "3.0000, 7.0000, 4.0000"]);
}

#[test]
fn python_parts_of_remaps_are_told_and_left_out() {
    let mut setup = setup();
    let remaps = [
        "M400 modalgroup=10 argspec=P prolog=a ngc=foo",
        "M401 modalgroup=10 python=b",
        "M6 modalgroup=6 prolog=change_prolog ngc=change epilog=change_epilog",
    ];
    setup.ini.values.insert(("rs274ngc".into(), "remap".into()), remaps.map(String::from).to_vec());
    let run = |setup: &Setup| {
        let mut files = Memory::default()
            .add("main.ngc", "M400 P3\nM401\nT1 M6\nM2\n", setup, 1)
            .add("foo.ngc", "o<foo> sub\nG0 X#<p>\no<foo> endsub\n", setup, 9)
            .add("change.ngc", "o<change> sub\nG0 Y#<selected_tool>\no<change> endsub\n", setup, 9);
        let mut printer = Printer::new(Vec::new(), Version::V2_9);
        let outcome = Interp::new(&mut files, setup, &mut printer).run(FileId(0));
        (String::from_utf8(printer.finish().expect("a vector takes everything")).expect("text"), outcome)
    };
    let (out, outcome) = run(&setup);
    assert!(outcome.findings.iter().all(|f| f.fault.code == code::REMAP_PYTHON), "{:?}", outcome.findings);
    assert_eq!(outcome.findings.len(), 3);
    let after = out.split("STRAIGHT_TRAVERSE(3.0000, 1.0000").nth(1).expect("the subroutine knows the tool");
    assert!(after.contains("CHANGE_TOOL(1)"), "{out}");
    // The real command without Python knows no such code.
    setup.without_python = false;
    assert!(!run(&setup).1.ok());
}

#[test]
fn a_value_of_the_running_machine_is_pointed_out_once() {
    let text = "G21 F50\n#3=[#5061+#5399]\nG38.3 X10\n#1=[#5061+1]\no1 repeat [5]\n#2=#5070\no1 endrepeat\nM66 P0 L0\n(debug,#5399)\n#4=[1+#5399]\nM2\n";
    let (_, outcome) = run(text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let doubts = outcome.findings.iter().filter(|f| f.fault.code == code::RUN_VALUE_UNKNOWN);
    let places: Vec<_> = doubts.map(|f| (f.line, f.fault.args[0].as_str(), f.span.map(|s| s.start))).collect();
    assert_eq!(places, [(3, "#5061", Some(4)), (5, "#5070", Some(3)), (9, "#5399", Some(6))]);
}

#[test]
fn macro_statements() {
    let Some(dialect) = Dialect::find("fanuc-mill") else { return };
    let setup = Setup { dialect, ..setup() };
    let text = "\
O1000
G21 G90
#1=0
WHILE[#1LT3]DO1
#1=#1+1
G0X#1
END1
IF[#1EQ3]GOTO20
G0Y99
N20G0Z1
M98P2000L2
M30
O2000
G0Y5
M99
";
    let (out, outcome) = run_with(&setup, text, 4);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let moves = out.lines().filter(|l| l.contains("STRAIGHT_TRAVERSE(")).count();
    assert_eq!(moves, 6, "{out}");
    assert!(!out.contains("99.0000"));
}

/// Keeps the tree of calls.
#[derive(Default)]
struct Frames {
    frames: Vec<(FrameId, CallFrame)>,
    at: Vec<(u32, FrameId)>,
}

impl Sink for Frames {
    fn call(&mut self, at: &At<'_>, call: &Call) {
        if let Call::StraightTraverse(_) = call {
            self.at.push((at.line, at.frame));
        }
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        self.frames.push((id, frame.clone()));
    }
}

#[test]
fn motion_knows_its_loop_and_call() {
    let setup = setup();
    let text = "o<s> sub\nG0 X1\no<s> endsub\no1 repeat [2]\no<s> call\no1 endrepeat\nG0 X2\nM2\n";
    let mut files = Memory::default().add("main.ngc", text, &setup, 2);
    let mut sink = Frames::default();
    let outcome = Interp::new(&mut files, &setup, &mut sink).run(FileId(0));
    assert!(outcome.ok());
    let names: Vec<(&str, u32)> = sink.frames.iter().map(|(_, f)| (&*f.name, f.pass)).collect();
    assert_eq!(names, [("o1", 1), ("sub s", 0), ("o1", 2), ("sub s", 0)]);
    assert_eq!(sink.at, [(1, FrameId(2)), (1, FrameId(4)), (6, FrameId::MAIN)]);
    assert_eq!(sink.frames[3].1.parent, FrameId(3));
}

/// Runs chunk after chunk, each from the state the one before left.
fn by_chunks(setup: &Setup, text: &str, lines: usize) -> String {
    let mut printed = Vec::new();
    let mut printer = Printer::new(&mut printed, Version::V2_9);
    let mut state = State::start(setup);
    let mut params = Params::default();
    params.set(5220, 1.0);
    params.set(5599, 1.0);
    for piece in gr_gcode::split_chunks(text, lines) {
        let exit = run_chunk(&chunk(piece, setup.dialect), &state, &params, setup, &mut printer);
        state = exit.state;
        params = exit.params;
        if exit.end != End::Chunk {
            break;
        }
    }
    printer.flush();
    drop(printer);
    String::from_utf8(printed).expect("text")
}

fn without_numbers(out: &str) -> Vec<String> {
    out.lines().map(|l| l.trim_start().split_once(' ').map_or("", |l| l.1).to_string()).collect()
}

const PIECES: &[&str] = &[
    "G1 X10 Y5 F100", "G0 X0", "X3", "G2 X10 Y0 R20", "G91", "G90", "G20", "G21", "G41.1 D1", "G1 X20", "G1 Y30", "G40",
    "G1 X-5 Y-5", "G92 X1", "G92.1", "G55", "G54", "G10 L2 P1 X1 R10", "G10 L20 P0 Y2", "T1 M6", "G43", "G49", "M3 S100",
    "G95", "G94 F50", "G93", "G1 X7 F2", "G64 P0.1", "G61", "M8", "M9", "G38.3 X5", "#1=#5061", "G0 Z#1", "G28", "G28.1",
    "(debug,#5420 #5400)", "M70", "M72", "G81 X1 Z-1 R2 F10", "X5 Y5", "G80", "G99", "G98", "@5 ^30", "G17", "G18", "M66 P1",
    "G53 G0 X1", "G52 X3", "M62 P1", "G7", "G8", "G4 P0.5", "M48", "M49", "G5 X1 Y1 I1 J1 P1 Q1", "#<_g>=4", "G0 X#<_g>",
    "G10 L1 P1 Z3", "G43 H2", "M61 Q2", "M19 R5", "G96 D100 S50", "G97", "G0 X0 Y0", "$0 M5", "M53 P1", "G30",
];

fn program() -> impl Strategy<Value = String> {
    prop::collection::vec(prop::sample::select(PIECES), 1..40).prop_map(|p| p.join("\n") + "\n")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn chunks_give_what_the_whole_gives(text in program(), lines in 1usize..6) {
        let setup = setup();
        let (whole, _) = run_with(&setup, &text, 7);
        let expected = without_numbers(&whole);
        let got = without_numbers(&by_chunks(&setup, &text, lines));
        // Prologue before, resets after.
        let expected = &expected[6..expected.len() - 2];
        prop_assert_eq!(&got[..], expected, "{}", text);
    }

    #[test]
    fn any_text_is_interpreted(text in "[ -~\\n]{0,200}") {
        run(&text);
    }

    #[test]
    fn any_words_are_interpreted(words in prop::collection::vec(("[a-z#@^$]", -5i32..200), 0..60)) {
        let text: String = words.iter().enumerate().map(|(i, (l, n))| format!("{l}{n}{}", if i % 4 == 3 { "\n" } else { " " })).collect();
        run(&text);
    }
}

fn oracle(text: &str) -> Option<(String, bool, String)> {
    let out = Job { tools: Some(TOOLS.into()), ..Job::new(text) }.reference(&reference()?);
    Some((out.canon.clone(), out.ok(), out.ended.errors()))
}

fn plain(out: &str) -> Vec<String> {
    without_numbers(out).iter().map(|l| l.replace("-0.0000", "0.0000")).collect()
}

/// Through both.
fn agree(text: &str) {
    let Some((expected, accepted, errors)) = oracle(text) else { return };
    let (got, outcome) = run(text);
    assert_eq!(plain(&got), plain(&expected), "{text}");
    assert_eq!(outcome.ok(), accepted, "{text}\n{errors}");
    if let Some(f) = outcome.findings.iter().find(|f| f.fault.rs.is_some()) {
        let said = f.fault.rs_text().unwrap_or_default();
        assert!(errors.contains(&said), "{text}\n{said}\n{errors}");
    }
}

#[test]
fn the_real_one_agrees() {
    for text in [
        "G20\nG0 X1 Y2 Z3 A4 B5 C6\nG21\nG0 X1\nM2\n",
        "T1 M6\nG43\nG0 Z0\n(debug,#5400 #5403 #<_z> #<_abs_z>)\nG43 H2\nG49\nM61 Q2\n(debug,#<_current_tool>)\nM2\n",
        "G10 L2 P1 X1 Y2 R30\nG0 X0 Y0\nG10 L20 P0 X5\nG55\nG54\nG92 X7\nG92.2\nG92.3\nG52 Y3\nG28.1\nG0 X9\nG28 Z1\nM2\n",
        "o1 sub\nM73\nG91 G20\no1 endsub\nG21 F123.46 S100\no1 call\nG0 X1\nM70\nG61\nM72\nM2\n",
        "o100 if [0]\no100 elseif [1]\nG0 X1\no100 else\nG0 X2\no100 endif\nM2\n",
        "%\nO5\nG0 X1\nM98 P7 L3\nM30\nO7\nG0 Y1\nM99\n%\n",
        "F100\nG38.2 Z-5\n(debug,#5063 #5070 #<_z>)\nG0 X1\nM2\n",
        "G93\nG1 X1 F2\nG1 Y1 F4\nM2\n",
        "#<_a>=1\no<f> sub\n#<b>=2\n(debug,#<_a> #<b> #1 #30)\no<f> return [5]\no<f> endsub\no<f> call [9]\n(debug,#<_value> #<_value_returned>)\nM2\n",
        "G0 X1 #<x>=1 #<y>=#<x>\n(debug,#<x> #<y>)\nM2\n",
        "o1 sub\no1 call\no1 endsub\no1 call\nM2\n",
        "o1 while [1]\no1 break\no1 endwhile\no2 endif\nM2\n",
        "G0 X10 Y10\nG91\nG1 F10 @5 ^30\nG90\n@20\n^45\nM2\n",
        "N10 G0 X1\nN20 (msg, hello)\nN30.5 M3 S100 M8 G4 P1\nM5 M9\nM2\n",
    ] {
        agree(text);
    }
}

#[test]
fn random_blocks_agree_with_the_real_one() {
    use proptest::strategy::ValueTree as _;
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    for _ in 0..60 {
        let text = program().new_tree(&mut runner).expect("a program").current();
        // After a spline the real one reads its position from freed memory.
        agree(&(text.replace("G5 X1 Y1 I1 J1 P1 Q1\n", "") + "M2\n"));
    }
}

/// One block that makes motion without end is a mistake at its line, not a shorter program.
#[test]
fn a_cycle_of_too_many_moves_is_endless() {
    for text in ["G21 F100\nG83 X1 Z-1000 R1 Q.0000001\nM2\n", "G21 F100\nG91 G81 X1 Z-1 R1 L2000000000\nM2\n"] {
        let (_, outcome) = run(text);
        assert_eq!(outcome.end, End::Fault, "{text}");
        let told = outcome.findings.iter().any(|f| f.fault.code == code::RUN_ENDLESS && f.line == 1);
        assert!(told, "{text}: {:?}", outcome.findings);
    }
}

/// Blocks behind a faulty move are read as they are meant: one mistake, one message.
#[test]
fn one_mistake_one_finding() {
    let setup = Setup { keep_going: true, startup_code: true, ..setup() };
    for text in [
        "G5.2 P1 L3 X1\nX2 Y3 P1\nX4 Y5 P1\nX7 Y8 P1\nG5.3\nG1 X3\n",
        "G5.2 P1 L3 X1 Y2 Q%\nX2 Y3 P1\nX4 Y5 P1\nX7 Y8 P1\nG5.3\nG1 X3\n",
        "G2 X10 Y0 I4 J0\nG2 X20 Y0 I5 J0\nG2 X30 Y0 I5 J0\n",
        "G3 X1\nX3 I1\n",
        "G91 G2 X10 Y0 I4 J0\nX10 I5\nG90 G2 X30 Y0 I5\n",
        "G5 X3 Y4 I1 P0 Q1\nX4 Y5 P1 Q1\n",
        "G81 X1 Y2\nX3\nG80\nG1 X4\n",
    ] {
        let (_, outcome) = run_with(&setup, &format!("G21 G90 G17 F100\nG0 X0 Y0\n{text}M2\n"), 100);
        let errors: Vec<_> = outcome.findings.iter().filter(|f| f.fault.rs.is_some()).collect();
        assert_eq!(errors.len(), 1, "{text}: {errors:?}");
    }
}

/// `rs274 -i` beside it: axes that lock turn alone, by G0, at an exact stop.
#[test]
fn locking_rotary_axes() {
    let (ini, found) = gr_interp::read_ini("[AXIS_A]\nLOCKING_INDEXER_JOINT = 3\n", gr_canon::FileId(0), None, None);
    assert!(found.is_empty());
    let setup = Setup { ini, ..setup() };
    let text = "g0 a10\ng61\ng91 g0 a5\ng28.1\ng90 g0 a1\nf10 g1 x1\ng28 x1 a4\nm2\n";
    let (out, outcome) = run_with(&setup, text, 100);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let calls: Vec<&str> = out.lines().skip(6).filter_map(|l| l.split_once("N..... ")).map(|(_, c)| c).filter(|c| !c.starts_with("COMMENT")).collect();
    let turn = |a: &str| format!("STRAIGHT_TRAVERSE(0.0000, 0.0000, 0.0000, {a}, 0.0000, 0.0000)");
    assert_eq!(calls[0], "SET_MOTION_CONTROL_MODE(CANON_EXACT_PATH)");
    assert_eq!(calls[1], turn("10.0000"));
    assert_eq!(calls[2..5], ["SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.000000)", "SET_NAIVECAM_TOLERANCE(0.0000)", "SET_MOTION_CONTROL_MODE(CANON_EXACT_PATH)"]);
    assert_eq!(calls[5..7], [turn("15.0000"), turn("1.0000")]);
    for (text, wanted) in [
        ("g0 a10\ng1 f1 a20\nm2\n", "Indexing axis A can only be moved with G0"),
        ("g0 a10 x1\nm2\n", "Indexing axis A can only be moved alone"),
        ("g0 a10 b1\nm2\n", "Indexing axis A can only be moved alone"),
    ] {
        let (_, outcome) = run_with(&setup, text, 100);
        let fault = &outcome.findings[0].fault;
        assert_eq!((fault.code, fault.rs_text().as_deref()), (code::AXIS_INDEXER, Some(wanted)), "{text}");
    }
}

/// Why the controller refuses to start with a REMAP, or what it only remarks (`rs274 -i`).
#[test]
fn remaps_are_checked() {
    for (line, wanted) in [
        ("M400 modalgroup=10 ngc=a", ""),
        ("M400 m=10 n=a", ""),
        ("M400 modalgroup=10 prolog=a ngc=a", ""),
        ("M400 modalgroup=99 ngc=a", "error"),
        ("M400 modalgroup=10 argspec=- ngc=a", "error"),
        ("M400 modalgroup=10", "error"),
        ("M400 modalgroup=10 ngc=a py=b", "error"),
        ("M400 modalgroup=10 ngc=", "error"),
        ("G81 modalgroup=2 ngc=a", "error"),
        ("T modalgroup=10 ngc=a", "error"),
        ("Mx modalgroup=10 ngc=a", "error"),
        ("M400 ngc=a", "warning"),
        ("M400 modalgroup=10 ngc=a foo=bar", "warning"),
        ("X5 ngc=a", "warning"),
        ("M400 modalgroup=10 ngc=a\nREMAP = m400 modalgroup=10 ngc=a", "error"),
    ] {
        let text = format!("[RS274NGC]\nREMAP = {line}\n");
        let (_, found) = gr_interp::read_ini(&text, gr_canon::FileId(0), None, None);
        let told: Vec<_> = found.iter().map(|d| d.code).collect();
        let code = match wanted {
            "error" => vec![code::INI_REMAP],
            "warning" => vec![code::INI_REMAP_DOUBT],
            _ => vec![],
        };
        assert_eq!(told, code, "{line}: {found:?}");
    }
}

/// 2.9 takes `WRAPPED_ROTARY` for a number; 2.10 knows words too.
#[test]
fn wrapped_is_a_number_in_2_9() {
    for (value, version, wraps) in [("1", Version::V2_9, true), ("TRUE", Version::V2_9, false), ("yes", Version::V2_10, true), ("0", Version::V2_10, false)] {
        let (ini, _) = gr_interp::read_ini(&format!("[AXIS_A]\nWRAPPED_ROTARY = {value}\n"), gr_canon::FileId(0), None, None);
        let (_, outcome) = run_with(&Setup { ini, version, ..setup() }, "g0 a350\na370\nm2\n", 100);
        assert_eq!(!outcome.ok(), wraps, "{value}");
    }
}

/// Blanks in labels, and zeros in front of numbers, don't count.
#[test]
fn labels_with_blanks_are_closed() {
    for text in ["o 1 0 if [1]\no10 endif\nm2\n", "o< ab>sub\no<ab>endsub\no<a b>call\nm2\n", "o01 repeat [2]\no1 endrepeat\nm2\n"] {
        let (_, outcome) = run_with(&setup(), text, 100);
        assert!(outcome.findings.is_empty(), "{text}: {:?}", outcome.findings);
    }
}

/// As `rs274` does: blocks that bring modes back take the place of the one that asked for them.
#[test]
fn m72_loses_the_rest_of_its_block() {
    for (text, moves) in [("M70\nG91\nM72 G0 X5\nG0 X6\nM2\n", 1), ("M70\nM72 G0 X5\nG0 X6\nM2\n", 2), ("M70\nG20\nM72 M8 G0 X5\nM2\n", 0)] {
        let (out, outcome) = run_with(&setup(), text, 100);
        assert!(outcome.ok(), "{:?}", outcome.findings);
        assert_eq!(out.matches("STRAIGHT_TRAVERSE").count(), moves, "{text}");
        assert!(!out.contains("FLOOD_ON"), "{text}");
        assert_eq!(outcome.findings.iter().any(|f| f.fault.code == code::MODES_REST_LOST), moves != 2, "{text}");
    }
}

/// `rs274 -v` with stored offsets: the machine stands at its zero.
#[test]
fn stored_offsets_move_the_start() {
    for (stored, text, wanted) in [
        (vec![(5222, 3.0)], "g0 x1\nm2\n", "STRAIGHT_TRAVERSE(1.0000, -76.2000, 0.0000"),
        (vec![(5220, 2.0), (5242, 3.0)], "g0 x1\nm2\n", "STRAIGHT_TRAVERSE(1.0000, -76.2000, 0.0000"),
        (vec![(5210, 1.0), (5212, 3.0)], "g0 x1\nm2\n", "STRAIGHT_TRAVERSE(1.0000, -76.2000, 0.0000"),
        (vec![(5221, 2.0)], "g91 g0 x1\nm2\n", "STRAIGHT_TRAVERSE(-49.8000, 0.0000, 0.0000"),
        (vec![(5222, 3.0)], "(debug,#5421 #<_y> #<_abs_y>)\nm2\n", "MESSAGE(\"-76.200000 -76.200000 0.000000"),
        (vec![(5222, 3.0), (5230, 90.0)], "g0 z1\nm2\n", "STRAIGHT_TRAVERSE(0.0000, -76.2000, 1.0000"),
    ] {
        let setup = Setup { params: stored.iter().copied().collect(), ..setup() };
        let (out, outcome) = run_with(&setup, text, 100);
        assert!(outcome.ok(), "{:?}", outcome.findings);
        assert!(out.contains(wanted), "{stored:?} {text}: {out}");
        let Some(rs274) = reference() else { continue };
        let lines: String = stored.iter().map(|(n, v)| format!("{n}\t{v}\n")).collect();
        let theirs = Job { params: Some(lines), ..Job::new(text) }.reference(&rs274).canon;
        assert!(theirs.replace("-0.0000", "0.0000").contains(wanted), "{stored:?} {text}: {theirs}");
    }
    // The machine itself turns with a stored rotation.
    let setup = Setup { params: [(5222, 3.0), (5230, 90.0)].into(), startup_code: true, ..setup() };
    let (out, _) = run_with(&setup, "g0 z1\nm2\n", 100);
    assert!(out.replace("-0.0000", "0.0000").contains("STRAIGHT_TRAVERSE(-76.2000, 0.0000, 1.0000"), "{out}");
}

/// As `rs274` has it: nothing but a comment beside M99 in a subroutine, and M99 first.
#[test]
fn words_beside_m99() {
    for (line, wanted) in [
        ("m99 x5", Some(code::OWORD_TRAILING_TEXT)),
        ("m99 p5", Some(code::OWORD_TRAILING_TEXT)),
        ("m99#1=2", Some(code::OWORD_TRAILING_TEXT)),
        ("x2 m99", Some(code::SUB_STRUCTURE)),
        ("(c) m99", Some(code::SUB_STRUCTURE)),
        ("m99 (c)", None),
        ("n5 m99", None),
    ] {
        let (_, outcome) = run_with(&setup(), &format!("m98 p100\nm2\no100\ng0 x1\n{line}\n"), 100);
        assert_eq!(outcome.findings.first().map(|f| f.fault.code), wanted, "{line}");
    }
}

/// What `rs274` reads of lines that it skips: the line number and the label.
#[test]
fn faults_on_skipped_lines() {
    for (line, wanted) in [
        ("n g0 x1", Some("Bad format unsigned integer")),
        ("nx", Some("Bad format unsigned integer")),
        ("n-5 o2 call", Some("Bad format unsigned integer")),
        ("g0 n", None),
        ("o2 foo", None),
        ("o2 if [1", None),
        ("o2 if 3", None),
        ("ow<x> endif", Some("Unknown word where unary operation could be")),
        ("o endif", Some("Unknown word starting with e")),
        ("o[1 if [1]", Some("Unknown operation")),
    ] {
        for (text, in_if) in [(format!("o1 sub\n{line}\no1 endsub\nm2\n"), false), (format!("o1 if [0]\n{line}\no1 endif\nm2\n"), true)] {
            let (_, outcome) = run_with(&setup(), &text, 100);
            let told = outcome.findings.iter().find_map(|f| f.fault.rs_text());
            if !in_if {
                assert_eq!(told.as_deref(), wanted, "{text}");
            }
            let Some(rs274) = reference() else { continue };
            let theirs = Job::new(text.clone()).reference(&rs274);
            assert_eq!(theirs.ok(), told.is_none(), "{text}: {told:?}, {}", theirs.ended.errors());
        }
    }
}
