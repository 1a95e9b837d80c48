//! Small programs: what they must print, the same through the real `rs274` where it is installed, and chunk by
//! chunk as through the whole.

use std::sync::Arc;

use gr_canon::{At, Call, CallFrame, FileId, FrameId, Printer, Sink, Units, Version};
use gr_gcode::{Chunk, File};
use gr_interp::{Budgets, End, Files, Interp, Outcome, Params, Setup, State, read_tools, run_chunk};
use gr_spec::{Dialect, code};
use gr_tests::oracle::{Job, reference};
use proptest::prelude::*;

const TOOLS: &str = "T1 P1 Z1.5 D0.25\nT2 P2 Z1 D0.5\nT9 P3 X0.1 Z0.2 D0.1 Q9\n";

#[derive(Default)]
struct Memory(Vec<(String, File)>);

fn chunk(text: &str, dialect: &'static Dialect) -> Chunk {
    Chunk { text: gr_text::Text::from(text), scan: Arc::new(gr_gcode::scan(text, dialect)) }
}

impl Memory {
    fn add(mut self, name: &str, text: &str, setup: &Setup, lines: usize) -> Self {
        let chunks = gr_gcode::split_chunks(text, lines).into_iter().map(|t| chunk(t, setup.dialect)).collect();
        self.0.push((name.to_string(), File::new(name, chunks)));
        self
    }
}

impl Files for Memory {
    fn file(&self, id: FileId) -> &File {
        &self.0[id.0 as usize].1
    }
    fn find_sub(&mut self, name: &str) -> Option<FileId> {
        let name = format!("{name}.ngc");
        self.0.iter().position(|(n, _)| *n == name).map(|i| FileId(i as u32))
    }
}

fn setup() -> Setup {
    Setup {
        machine_units: Units::Inch,
        tools: read_tools(TOOLS, FileId(0)).0,
        user_m_codes: false,
        uvw: false,
        startup_code: false,
        ..Setup::default()
    }
}

fn run_with(setup: &Setup, text: &str, lines: usize) -> (String, Outcome) {
    let mut files = Memory::default().add("main.ngc", text, setup, lines);
    let mut printed = Vec::new();
    let mut printer = Printer::new(&mut printed, Version::V2_9);
    let outcome = Interp::new(&mut files, setup, &mut printer).run(FileId(0));
    printer.flush();
    drop(printer);
    (String::from_utf8(printed).expect("the printer writes text"), outcome)
}

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

fn run_fanuc(id: &str, text: &str) -> (Vec<String>, Outcome) {
    let dialect = Dialect::find(id).expect("a dialect of the tables");
    let setup = Setup { dialect, uvw: true, ..setup() };
    let (out, outcome) = run_with(&setup, text, 100);
    let calls = out.lines().skip(6).map(|l| l.split_once("N..... ").map_or(l, |(_, call)| call).to_string()).collect();
    (calls, outcome)
}

#[test]
fn every_code_of_the_fanuc_lists_is_known() {
    for id in ["fanuc-mill", "fanuc-turn"] {
        let mut refused = Vec::new();
        for row in Dialect::find(id).expect("a dialect").codes {
            for words in ["", " P1", " X1. Y2. R1. Z-1. P1 Q1. K2 F100."] {
                let (_, outcome) = run_fanuc(id, &format!("G21 F100. S100\nG1 X0.\n{}{words}\nM30\n", row.code));
                for finding in &outcome.findings {
                    assert_ne!(finding.fault.code, code::CODE_UNKNOWN, "{id}: {}{words}", row.code);
                    if finding.fault.code == code::CODE_NOT_CARRIED_OUT && words.is_empty() {
                        assert_eq!(finding.fault.args[0], row.code, "{id}");
                        refused.push(row.code);
                    }
                }
            }
        }
        for code in ["G27", "G34", "G51"] {
            assert_eq!(refused.contains(&code), Dialect::find(id).unwrap().code(code).is_some(), "{id}: {code}");
        }
        for code in ["G0", "G1", "G2", "G4", "G28", "G54", "M3", "M30", "M98"] {
            assert!(!refused.contains(&code), "{id}: {code}");
        }
    }
    // What the control does not have either stays unknown.
    for (id, text) in [("fanuc-turn", "G86.1 X1.\nM30\n"), ("fanuc-mill", "G21 M777\nM30\n"), ("fanuc-mill", "G77\nM30\n")] {
        let (_, outcome) = run_fanuc(id, text);
        assert_eq!(outcome.findings[0].fault.code, code::CODE_UNKNOWN, "{text}");
    }
}

#[test]
fn the_examples_of_codes_not_carried_out_and_values_unknown() {
    for code in [code::CODE_NOT_CARRIED_OUT, code::RUN_VALUE_UNKNOWN] {
        let def = code.def();
        for (text, expected) in [(def.bad, vec![code]), (def.good, vec![])] {
            let (_, outcome) = run_fanuc(def.dialect.unwrap_or("linuxcnc"), text.expect("an example"));
            let found: Vec<_> = outcome.findings.iter().map(|f| f.fault.code).collect();
            assert_eq!(found, expected, "{text:?}");
        }
    }
}

#[test]
fn a_fanuc_mill_wakes_up_in_g0_and_repeats_with_k() {
    let text = "G21 G90\nG43 H1 Z50.\nG91 F100.\nG81 X10. Z-5. R-2. K3\nG80\nM30\n";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert!(calls.iter().any(|c| c.starts_with("STRAIGHT_TRAVERSE(0.0000, 0.0000, 50.0000")), "{calls:?}");
    assert_eq!(calls.iter().filter(|c| c.starts_with("STRAIGHT_FEED")).count(), 3);
    let (_, outcome) = run_fanuc("fanuc-mill", &text.replace("K3", "L3"));
    assert_eq!(outcome.findings[0].fault.code, code::SYNTAX_NOT_IN_DIALECT);
    assert_eq!(outcome.findings[0].fault.args[1..], ["fanuc-mill", "write K"]);
}

fn moves_of(calls: &[String]) -> Vec<String> {
    let kinds = [("STRAIGHT_TRAVERSE(", "rapid "), ("STRAIGHT_FEED(", "feed "), ("ARC_FEED(", "arc ")];
    let numbers = |rest: &str, n: usize| {
        let all: Vec<f64> = rest.trim_end_matches(')').split(", ").filter_map(|v| v.parse().ok()).collect();
        all[..n.min(all.len())].iter().map(|v| format!("{}", v + 0.0)).collect::<Vec<_>>().join(" ")
    };
    let one = |c: &String| {
        let (rest, name) = kinds.iter().find_map(|(k, name)| Some((c.strip_prefix(k)?, *name)))?;
        Some(format!("{name}{}", numbers(rest, if name == "arc " { 5 } else { 3 })))
    };
    calls.iter().filter_map(one).collect()
}

/// Fanuc Series 0i/30i, lathe, G-code system A (B-63944, B-64484): X and U are diameters, U W H are increments, the
/// control wakes up in G18 and G99; I of an arc is a radius.
#[test]
fn a_fanuc_lathe_has_diameters_and_increments() {
    let text = "O1\nG21\nG97 S500 M3\nG0 X100. Z5.\nG1 U-20. W-10. F0.2\nX60.\nU10.\nG2 U20. W-10. R10.\nG3 U20. W10. I0. K10.\nG98 F100.\nG1 W-1. H5.\nG28 U0. W0.\nM30\n";
    let (calls, outcome) = run_fanuc("fanuc-turn", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert!(calls.iter().any(|c| c == "SET_FEED_MODE(0, 1)"), "{calls:?}");
    assert_eq!(
        moves_of(&calls)[..8],
        ["rapid 50 0 5", "feed 40 0 -5", "feed 30 0 -5", "feed 35 0 -5", "arc -15 45 -5 45 -1", "arc -5 55 -5 45 1", "feed 55 0 -6", "rapid 55 0 -6"]
    );
    let feeds = calls.iter().position(|c| c == "SET_FEED_RATE(100.0000)").expect("F of G98");
    assert!(calls[..feeds].iter().filter(|c| *c == "SET_FEED_MODE(0, 0)").count() == 1);
    assert!(calls.iter().any(|c| c == "STRAIGHT_FEED(55.0000, 0.0000, -6.0000, 0.0000, 0.0000, 5.0000)"), "{calls:?}");
    let (_, outcome) = run_fanuc("fanuc-turn", "G0 X10. U5.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::WORD_REPEATED);
}

/// The same manual, machining center: coordinate system rotation (G68, G69).
#[test]
fn a_fanuc_mill_turns_coordinates() {
    let text = "G21 G90 F100.\nG68 X0. Y0. R90.\nG1 X20. Y5.\nX30.\nG91 X5.\nG90 G2 X45. I5. J0.\nG0 Z10.\nG81 X10. Y0. Z-5. R2.\nX12.\nG80\nG69\nG0 X1. Y1.\nG68 X10. Y10. R180.\nX0. Y0.\nG69\nG68 R90.\nG0 X30. Y20.\nG69\nM30\n";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert_eq!(
        moves_of(&calls),
        [
            "feed -5 20 0", "feed -5 30 0", "feed -5 35 0", "arc -5 45 -5 40 -1", "rapid -5 45 10", // G90 and G91, arc
            "rapid 0 10 10", "rapid 0 10 2", "feed 0 10 -5", "rapid 0 10 10", "rapid 0 12 10", "rapid 0 12 2", "feed 0 12 -5",
            "rapid 0 12 10", "rapid 1 1 10", "rapid 20 20 10", "rapid 20 30 10", // about another centre, about here
        ]
    );
    for text in ["G68 X0. Y0. R5.\nG28 X0.\nM30\n", "G68 R5.\nG18\nM30\n", "G91\nG68 R5.\nM30\n", "G68 R5.\nG55\nM30\n"] {
        let (_, outcome) = run_fanuc("fanuc-mill", text);
        assert_eq!(outcome.findings[0].fault.code, code::CODE_NOT_CARRIED_OUT, "{text}");
    }
    let (_, outcome) = run_fanuc("fanuc-mill", "G68 X1. Y1.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::WORD_MISSING);
}

/// The same manual, canned cycles: K0 stores the data and drills nothing; G80 goes back to the motion of group 01.
#[test]
fn fanuc_cycles_store_and_cancel() {
    let text = "G21 G90\nG1 X1. F100.\nG81 X5. Z-5. R2. K0\nX10.\nG80\nX9.\nG81 X6. Z-5. R2.\nG80 Z50.\nM30\n";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert_eq!(
        moves_of(&calls),
        [
            "feed 1 0 0", "rapid 1 0 2", "rapid 10 0 2", "feed 10 0 -5", "rapid 10 0 2", "feed 9 0 2", "rapid 6 0 2", "feed 6 0 -5",
            "rapid 6 0 2", "feed 6 0 50",
        ]
    );
}

/// The same, a row of holes: R and Z keep their levels when the steps between the holes are increments.
#[test]
fn fanuc_cycles_keep_their_levels() {
    let text = "G21 G90 S500 M3\nG0 Z5.\nG98 G81 X1. Y2. Z-5. R1. F100.\nG91 X5. K2\nG90 G80\nM30\n";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let drilled: Vec<_> = moves_of(&calls).into_iter().filter(|m| m.starts_with("feed")).collect();
    assert_eq!(drilled, ["feed 1 2 -5", "feed 6 2 -5", "feed 11 2 -5"]);
}

#[test]
fn fanuc_dwells_are_milliseconds_or_seconds() {
    let text = "G21 G90\nG4 P500\nG04 X1.5\nF100.\nG82 X1. Z-5. R2. P250\nG80\nM30\n";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let dwells: Vec<_> = calls.iter().filter(|c| c.starts_with("DWELL")).collect();
    assert_eq!(dwells, ["DWELL(0.5000)", "DWELL(1.5000)", "DWELL(0.2500)"]);
}

/// The seconds of a lathe's dwell are no diameter.
#[test]
fn fanuc_dwells_of_a_lathe() {
    let (calls, outcome) = run_fanuc("fanuc-turn", "G21\nG4 X1.\nG4 U1.\nG4 P1000\nM30\n");
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let dwells: Vec<_> = calls.iter().filter(|c| c.starts_with("DWELL")).collect();
    assert_eq!(dwells, ["DWELL(1.0000)"; 3]);
}

/// Machining center manual (B-63944), programmable data input: L2 origins, L10 lengths, L12 radii. The rest is refused.
#[test]
fn fanuc_data_input() {
    let text = "G21 G90 G54\nG10 L2 P1 X1.\nG10 L10 P1 R5.\nT1 M6\nG43 H1 G0 Z1.\nX0.\nM30\n";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert!(calls.iter().any(|c| c.starts_with("USE_TOOL_LENGTH_OFFSET(0.0000 0.0000 5.0000")), "{calls:?}");
    for line in ["G10 L20 P1 X1.", "G10 L11 P1 R1.", "G10 L2 P0 X1.", "G10 L2 P7 X1.", "G10 L2 P1 X1. R30.", "G91 G10 L2 P1 X1.", "G10 L1 P1 Z5."] {
        let (_, outcome) = run_fanuc("fanuc-mill", &format!("{line}\nM30\n"));
        assert_eq!(outcome.findings[0].fault.code, code::CODE_NOT_CARRIED_OUT, "{line}");
    }
}

/// What LinuxCNC has and the control has not is refused, not carried out with LinuxCNC's meaning.
#[test]
fn dialects_are_closed_lists() {
    for (id, line) in [
        ("fanuc-mill", "G38.2 Z-5. F100."),
        ("fanuc-mill", "G5.1 X1. I1. J1."),
        ("fanuc-mill", "M66 P0"),
        ("fanuc-turn", "G7"),
        ("fanuc-turn", "G64"),
        ("grbl", "G81 X1 Z-1 R1"),
        ("grbl", "G33 Z-1 K1"),
        ("grbl", "M6"),
        ("grbl", "G0 A5"),
        ("grbl", "G0 X1 W2"),
        ("grbl", "G10 L10 P1 X1"),
        ("grbl", "G10 L2 P1 R30 X1"),
        ("grbl", "G2 X1 Y1 I.5 J.5 P2 F10"),
    ] {
        let (_, outcome) = run_fanuc(id, &format!("{line}\nM30\n"));
        let fault = &outcome.findings[0].fault;
        assert_eq!((fault.code, fault.args[1].as_str()), (code::SYNTAX_NOT_IN_DIALECT, id), "{line}: {fault:?}");
    }
}

/// Fanuc Series 16i/18i (B-63684) and 0i/30i (B-64484), custom macro: undefined variable, FIX, FUP.
#[test]
fn fanuc_variables_are_vacant_until_set() {
    let text = "\
G21 G90
G0 X1. Y2.
#1=#0
G0 X5. Y#1
#2=[#1*5.]
#3=#1
IF[#1 EQ #0] THEN #101=1.
IF[#1 EQ 0] THEN #102=1.
IF[#2 EQ #0] THEN #103=1.
IF[#1 NE 0] THEN #104=1.
IF[#3 EQ #0] THEN #105=1.
IF[#1 GE 0] THEN #106=1.
G0 X#101 Y#102 Z#103
G0 X[#104+#105+#106+#1] Y-#1 Z[FIX[-1.2]+FUP[-1.2]+FUP[1.2]]
G0 X#2
M30
";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert_eq!(moves_of(&calls), ["rapid 1 2 0", "rapid 5 2 0", "rapid 1 2 0", "rapid 3 2 -1", "rapid 0 2 -1"]);
    for (text, wanted) in [
        ("#0=1\n", code::PARAMETER_READ_ONLY),
        ("#50=1\n", code::SYNTAX_NOT_IN_DIALECT),
        ("#1=#4001\n", code::CODE_NOT_CARRIED_OUT),
        ("#3000=1\n", code::CODE_NOT_CARRIED_OUT),
    ] {
        let (_, outcome) = run_fanuc("fanuc-mill", text);
        assert_eq!(outcome.findings[0].fault.code, wanted, "{text}");
    }
}

/// The same manuals: simple call (G65), local variable levels, M99 P.
#[test]
fn fanuc_macros_have_variables_of_their_own() {
    let text = "\
O1
G21 G90
#1=7.
#24=9.
#100=0
G65 P9010 L2 A1. X[#1+1.] I2. I3.
G0 X#1 Y#24
M98 P9020
G0 X#1
M98 P9030
G0 X999.
N50
G0 Z3.
M30
O9010
#100=#100+#1
G0 X#24 Y#4 Z#7
#1=100.
IF[#26 EQ #0] THEN #24=50.
G65 P9020 A4.
G0 X#1 Y#24
M99
O9020
G0 X#1
#1=[#1+1.]
M99
O9030
M99 P50
";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let macro_moves = ["rapid 8 2 3", "rapid 4 2 3", "rapid 100 50 3"];
    let again = ["rapid 8 2 3", "rapid 4 2 3", "rapid 100 50 3"];
    let after = ["rapid 7 9 3", "rapid 7 9 3", "rapid 8 9 3", "rapid 8 9 3"];
    assert_eq!(moves_of(&calls), [&macro_moves[..], &again[..], &after[..]].concat());
    for (text, wanted) in [
        ("G65 A1.\nM30\n", code::WORD_MISSING),
        ("G0 G65 P1\nM30\n", code::MACRO_MALFORMED),
        ("G65 P1 G1\nM30\n", code::MACRO_MALFORMED),
        ("G65 P1 L0\nM30\n", code::WORD_MISSING),
        ("G65 P8\nM30\n", code::SUB_NOT_FOUND),
        ("O1\nM98 P2\nM30\nO2\nG65 P2\nM99\n", code::SUB_LIMIT),
    ] {
        let (_, outcome) = run_fanuc("fanuc-mill", text);
        assert_eq!(outcome.findings[0].fault.code, wanted, "{text}: {:?}", outcome.findings);
    }
}

/// The same manuals, modal call (G66): every movement calls, in a macro that is called the G66 before; the arguments are set
/// once.
#[test]
fn fanuc_movements_call_macros() {
    let text = "\
O1
G21 G90 G40 G67
#1=5.
G66 P9110 L1 Z-20. R5.
G0 X20. Y20.
G4 X1.
F100.
X50.
M98 P7
G67
G0 X0 Y#1
M30
O7
Y80.
M99
O9110
G0 Z#18
Z#26
Z#18
#18=[#18+1.]
M99
";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let expected = [
        "rapid 20 20 0", "rapid 20 20 5", "rapid 20 20 -20", "rapid 20 20 5", //
        "rapid 50 20 5", "rapid 50 20 6", "rapid 50 20 -20", "rapid 50 20 6", //
        "rapid 50 80 6", "rapid 50 80 7", "rapid 50 80 -20", "rapid 50 80 7", //
        "rapid 0 5 7",
    ];
    assert_eq!(moves_of(&calls), expected);
    // The manual's order of two macros, one inside of the other: (1-1) (2-1) (1-2) (3-1) (2-1) (3-2) (2-1) (1-3).
    let text = "\
O1
G21 G91
G66 P9100
G0 Z1.
G66 P9200 L2
Z15.
G67
G67
Z-25.
M30
O9100
X50.
M99
O9200
Z60.
Z70.
M99
";
    let (calls, outcome) = run_fanuc("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let once = |x: f64, z: f64| [(x, z + 60.0), (x + 50.0, z + 60.0), (x + 50.0, z + 130.0), (x + 100.0, z + 130.0)];
    let mut points = vec![(0.0, 1.0), (50.0, 1.0), (50.0, 16.0)];
    points.extend(once(50.0, 16.0));
    points.extend(once(150.0, 146.0));
    points.push((250.0, 251.0));
    let expected: Vec<String> = points.iter().map(|(x, z)| format!("rapid {x} 0 {z}")).collect();
    assert_eq!(moves_of(&calls), expected);
    for (text, wanted) in [
        ("G66 A1.\nM30\n", code::WORD_MISSING),
        ("G0 Z5.\nG66 P1\nG81 X1. Z-1. R1. F100.\nM30\n", code::CODE_NOT_CARRIED_OUT),
        ("G66 P1\nG28 X1.\nM30\n", code::CODE_NOT_CARRIED_OUT),
        ("G66 P1\nG67 X1.\nM30\n", code::CODE_NOT_CARRIED_OUT),
        ("G66 P1\nG0 X1.\nM30\nO1\nG67\nM99\n", code::CODE_NOT_CARRIED_OUT),
        ("G66 P1\nG66 P1\nG66 P1\nG66 P1\nG66 P1\nM30\n", code::SUB_LIMIT),
        ("G66 P8\nG0 X1.\nM30\n", code::SUB_NOT_FOUND),
        ("G66 G65 P8\nG0 X1.\nM30\n", code::MACRO_MALFORMED),
    ] {
        let (_, outcome) = run_fanuc("fanuc-mill", text);
        assert_eq!(outcome.findings[0].fault.code, wanted, "{text}: {:?}", outcome.findings);
    }
}

/// Fanuc lathe manual, G-code system A: G90 cuts along Z, G94 along X; both come back to where they began.
#[test]
fn a_fanuc_lathe_turns_and_faces_in_cycles() {
    let text = "\
G21 G97 S500 M3
G0 X60. Z2.
G90 X50. Z-20. F0.2
X40.
U-30. W-12. R-1.
G0 X60. Z2.
G94 X20. Z-3. F0.1
Z-6. R-1.
G1 X61.
M30
";
    let (calls, outcome) = run_fanuc("fanuc-turn", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert_eq!(
        moves_of(&calls),
        [
            "rapid 30 0 2", "rapid 25 0 2", "feed 25 0 -20", "feed 30 0 -20", "rapid 30 0 2", // G90
            "rapid 20 0 2", "feed 20 0 -20", "feed 30 0 -20", "rapid 30 0 2", // X alone
            "rapid 14 0 2", "feed 15 0 -10", "feed 30 0 -10", "rapid 30 0 2", // increments and a taper
            "rapid 30 0 2", "rapid 30 0 -3", "feed 10 0 -3", "feed 10 0 2", "rapid 30 0 2", // G94
            "rapid 30 0 -7", "feed 10 0 -6", "feed 10 0 2", "rapid 30 0 2", "feed 30.5 0 2",
        ]
    );
    let (_, outcome) = run_fanuc("fanuc-turn", "G0 G90 X1. Z1.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::CODE_SAME_GROUP);
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

/// Fanuc B-64484: digits in front of the last four of P are the number of calls, unless L gives it.
#[test]
fn fanuc_repeats_in_p() {
    let subs = "O1000\nG91 G0 X1.\nM99\nO51000\nG91 G0 X100.\nM99\n";
    for (call, x) in [
        ("M98 P1000", "1"),
        ("M98 P00051000", "5"),
        ("M98 P0051000", "5"),
        ("M98 P51000", "5"),
        ("M98 P1000 L3", "3"),
        ("M98 P51000 L2", "200"),
        ("M98 P01000", "1"),
    ] {
        let (calls, outcome) = run_fanuc("fanuc-mill", &format!("G21 G90\n{call}\nM30\n{subs}"));
        assert!(outcome.ok(), "{call}: {:?}", outcome.findings);
        assert_eq!(moves_of(&calls).last().map(String::as_str), Some(format!("rapid {x} 0 0").as_str()), "{call}");
    }
    let (_, outcome) = run_fanuc("fanuc-turn", "M98 P20003\nM30\nO1\nM99\n");
    assert_eq!((outcome.findings[0].fault.code, outcome.findings[0].fault.message_args()[0].as_str()), (code::SUB_NOT_FOUND, "3"));
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

/// Fanuc lathe manual: G50 S holds surface speed control below a speed, before and after G96.
#[test]
fn a_fanuc_lathe_clamps_the_spindle() {
    for text in ["G50 S2000\nG96 S150 M3\nM30\n", "G96 S150 M3\nG50 S2000\nM30\n"] {
        let (calls, outcome) = run_fanuc("fanuc-turn", text);
        assert!(outcome.ok(), "{text}: {:?}", outcome.findings);
        let modes: Vec<&String> = calls.iter().filter(|c| c.starts_with("SET_SPINDLE_MODE")).collect();
        assert!(modes.iter().any(|m| m.contains("2000.0000")), "{text}: {modes:?}");
        assert_eq!(calls.iter().filter(|c| c.starts_with("SET_SPINDLE_SPEED")).count(), 1, "{text}");
    }
    let (_, outcome) = run_fanuc("fanuc-turn", "G50 X100. Z50.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::CODE_NOT_CARRIED_OUT);
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
    // A Fanuc control moves, then returns.
    let (calls, outcome) = run_fanuc("fanuc-mill", "G21 G90\nM98 P100\nG0 Y3.\nM30\nO100\nG0 X1.\nX2. M99\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    assert_eq!(moves_of(&calls), ["rapid 1 0 0", "rapid 2 0 0", "rapid 2 3 0"]);
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
