//! Programs of other controls than LinuxCNC: what a Fanuc machining center, a Fanuc lathe and grbl make of their words.
//! There is no oracle; the moves are worked out from the manuals.

mod harness;

use gr_interp::{Outcome, Setup};
use gr_spec::{Dialect, code};

use harness::{run_with, setup};

fn run_in(id: &str, text: &str) -> (Vec<String>, Outcome) {
    let dialect = Dialect::find(id).expect("a dialect of the tables");
    let setup = Setup { dialect, uvw: true, ..setup() };
    let (out, outcome) = run_with(&setup, text, 100);
    // `  12 N20    CALL(…)`, or `N.....` without a number.
    let call = |l: &'_ str| {
        let (_, numbered) = l.trim_start().split_once(' ')?;
        Some(numbered.strip_prefix('N')?.split_once(' ')?.1.trim_start().to_string())
    };
    let calls = out.lines().skip(6).map(|l| call(l).unwrap_or_else(|| l.to_string())).collect();
    (calls, outcome)
}

#[test]
fn every_code_of_the_fanuc_lists_is_known() {
    for id in ["fanuc-mill", "fanuc-turn"] {
        let mut refused = Vec::new();
        for row in Dialect::find(id).expect("a dialect").codes {
            for words in ["", " P1", " X1. Y2. R1. Z-1. P1 Q1. K2 F100."] {
                let (_, outcome) = run_in(id, &format!("G21 F100. S100\nG1 X0.\n{}{words}\nM30\n", row.code));
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
        let (_, outcome) = run_in(id, text);
        assert_eq!(outcome.findings[0].fault.code, code::CODE_UNKNOWN, "{text}");
    }
}

#[test]
fn the_examples_of_codes_not_carried_out_and_values_unknown() {
    for code in [code::CODE_NOT_CARRIED_OUT, code::RUN_VALUE_UNKNOWN] {
        let def = code.def();
        for (text, expected) in [(def.bad, vec![code]), (def.good, vec![])] {
            let (_, outcome) = run_in(def.dialect.unwrap_or("linuxcnc"), text.expect("an example"));
            let found: Vec<_> = outcome.findings.iter().map(|f| f.fault.code).collect();
            assert_eq!(found, expected, "{text:?}");
        }
    }
}

#[test]
fn a_fanuc_mill_wakes_up_in_g0_and_repeats_with_k() {
    let text = "G21 G90\nG43 H1 Z50.\nG91 F100.\nG81 X10. Z-5. R-2. K3\nG80\nM30\n";
    let (calls, outcome) = run_in("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert!(calls.iter().any(|c| c.starts_with("STRAIGHT_TRAVERSE(0.0000, 0.0000, 50.0000")), "{calls:?}");
    assert_eq!(calls.iter().filter(|c| c.starts_with("STRAIGHT_FEED")).count(), 3);
    let (_, outcome) = run_in("fanuc-mill", &text.replace("K3", "L3"));
    assert_eq!(outcome.findings[0].fault.code, code::SYNTAX_NOT_IN_DIALECT);
    assert_eq!(outcome.findings[0].fault.args[1..], ["fanuc-mill", "write K"]);
}

/// AND, OR and XOR work on bits and MOD keeps the sign of the dividend; G52 and G92 add up; behind a hole in G99 the next one is gone to at
/// R, also in G98 (B-63944: operation commands, local coordinate system, canned cycles).
#[test]
fn a_fanuc_mill_reckons_and_shifts() {
    let text = "G21 G90 G0 X[6AND3] Y[5XOR3] Z9.\nX[4OR1] Y[-7MOD3]\nIF[[1EQ1]AND[2EQ2]] GOTO 5\nX99.\nN5 M30\n";
    assert_eq!(moves_of(&run_in("fanuc-mill", text).0), ["rapid 2 6 9", "rapid 5 -1 9"]);
    let text = "G21 G90 G0 X10. Y10. Z5.\nG92 X0. Y0.\nG52 X5. Y0.\nX1. Y1.\nG52 X0. Y0.\nX1. Y1.\nM30\n";
    let (calls, _) = run_in("fanuc-mill", text);
    let shifts: Vec<&String> = calls.iter().filter(|c| c.starts_with("SET_G92")).collect();
    assert!(shifts.iter().zip(["10.0000, 10.0000", "15.0000, 10.0000", "10.0000, 10.0000"]).all(|(c, s)| c.contains(s)), "{shifts:?}");
    let text = "G21 G90 G0 X0 Y0 Z50.\nG99 G81 X10. Z-5. R2. F100.\nG98 X20.\nG80\nM30\n";
    let expected = ["rapid 0 0 50", "rapid 10 0 50", "rapid 10 0 2", "feed 10 0 -5", "rapid 10 0 2", "rapid 20 0 2", "feed 20 0 -5", "rapid 20 0 50"];
    assert_eq!(moves_of(&run_in("fanuc-mill", text).0), expected);
}

/// grbl starts in G0.
#[test]
fn grbl_wakes_up_in_g0() {
    assert_eq!(moves_of(&run_in("grbl", "G21 G90\nX10 Y10\nG1 X5 F100\n").0), ["rapid 10 10 0", "feed 5 10 0"]);
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
    let (calls, outcome) = run_in("fanuc-turn", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert!(calls.iter().any(|c| c == "SET_FEED_MODE(0, 1)"), "{calls:?}");
    assert_eq!(
        moves_of(&calls)[..8],
        ["rapid 50 0 5", "feed 40 0 -5", "feed 30 0 -5", "feed 35 0 -5", "arc -15 45 -5 45 -1", "arc -5 55 -5 45 1", "feed 55 0 -6", "rapid 55 0 -6"]
    );
    let feeds = calls.iter().position(|c| c == "SET_FEED_RATE(100.0000)").expect("F of G98");
    assert!(calls[..feeds].iter().filter(|c| *c == "SET_FEED_MODE(0, 0)").count() == 1);
    assert!(calls.iter().any(|c| c == "STRAIGHT_FEED(55.0000, 0.0000, -6.0000, 0.0000, 0.0000, 5.0000)"), "{calls:?}");
    let (_, outcome) = run_in("fanuc-turn", "G0 X10. U5.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::WORD_REPEATED);
}

/// The same manual, machining center: coordinate system rotation (G68, G69).
#[test]
fn a_fanuc_mill_turns_coordinates() {
    let text = "G21 G90 F100.\nG68 X0. Y0. R90.\nG1 X20. Y5.\nX30.\nG91 X5.\nG90 G2 X45. I5. J0.\nG0 Z10.\nG81 X10. Y0. Z-5. R2.\nX12.\nG80\nG69\nG0 X1. Y1.\nG68 X10. Y10. R180.\nX0. Y0.\nG69\nG68 R90.\nG0 X30. Y20.\nG69\nM30\n";
    let (calls, outcome) = run_in("fanuc-mill", text);
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
        let (_, outcome) = run_in("fanuc-mill", text);
        assert_eq!(outcome.findings[0].fault.code, code::CODE_NOT_CARRIED_OUT, "{text}");
    }
    let (_, outcome) = run_in("fanuc-mill", "G68 X1. Y1.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::WORD_MISSING);
}

/// The same manual, canned cycles: K0 stores the data and drills nothing; G80 goes back to the motion of group 01.
#[test]
fn fanuc_cycles_store_and_cancel() {
    let text = "G21 G90\nG1 X1. F100.\nG81 X5. Z-5. R2. K0\nX10.\nG80\nX9.\nG81 X6. Z-5. R2.\nG80 Z50.\nM30\n";
    let (calls, outcome) = run_in("fanuc-mill", text);
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
    let (calls, outcome) = run_in("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let drilled: Vec<_> = moves_of(&calls).into_iter().filter(|m| m.starts_with("feed")).collect();
    assert_eq!(drilled, ["feed 1 2 -5", "feed 6 2 -5", "feed 11 2 -5"]);
    // From one cycle to another too, until G80.
    let (calls, outcome) =
        run_in("fanuc-mill", "G21 G90 S500 M3\nG0 Z5.\nG81 X1. Y2. Z-5. R1. F100.\nG82 X6. P500\nG80\nM30\n");
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let drilled: Vec<_> = moves_of(&calls).into_iter().filter(|m| m.starts_with("feed")).collect();
    assert_eq!(drilled, ["feed 1 2 -5", "feed 6 2 -5"]);
    let (_, outcome) =
        run_in("fanuc-mill", "G21 G90 S500 M3\nG0 Z5.\nG81 X1. Y2. Z-5. R1. F100.\nG80\nG82 X6. P500\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::CYCLE_WORD_MISSING);
}

/// The same: G86 has no P, and takes none over from another cycle.
#[test]
fn a_fanuc_cycle_that_is_cancelled_leaves_no_dwell() {
    let dwells = |text: &str| {
        let (calls, outcome) = run_in("fanuc-mill", text);
        assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
        calls.iter().filter(|c| c.starts_with("DWELL")).cloned().collect::<Vec<_>>()
    };
    let drill = "G21 G90 G0 Z50.\nS500 M3\nG82 X30. Y10. Z-5. R2. P500 F120.\n";
    let tap = "G84 X50. Y20. Z-10. R5. F500.\nG80\nM30\n";
    assert_eq!(dwells(&format!("{drill}{tap}")).len(), 2, "without G80 the dwell goes on");
    for cancel in ["G80", "G0 Z50.", "G80 X40."] {
        let found = dwells(&format!("{drill}{cancel}\n{tap}"));
        assert!(found.len() == 1 || found[1..].iter().all(|d| d.contains("0.0000")), "{cancel}: {found:?}");
    }
    // The next cycle has to say its own again.
    let (_, outcome) = run_in("fanuc-mill", &format!("{drill}G80\nG82 X5. Z-5. R2. F100.\nM30\n"));
    assert_eq!(outcome.findings[0].fault.code, code::CYCLE_WORD_MISSING);
}

#[test]
fn a_fanuc_bore_does_not_dwell() {
    let text = "G21 G90 S500 M3\nG0 Z5.\nG82 X1. Z-5. R2. P250 F100.\nG86 X2. Z-5. R2.\nG82 X3. Z-5. R2. P250\nG80\nM30\n";
    let (calls, outcome) = run_in("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert_eq!(calls.iter().filter(|c| c.starts_with("DWELL")).count(), 2);
    // G86 and M30.
    assert_eq!(calls.iter().filter(|c| c.starts_with("STOP_SPINDLE")).count(), 2);
}

#[test]
fn fanuc_dwells_are_milliseconds_or_seconds() {
    let text = "G21 G90\nG4 P500\nG04 X1.5\nF100.\nG82 X1. Z-5. R2. P250\nG80\nM30\n";
    let (calls, outcome) = run_in("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let dwells: Vec<_> = calls.iter().filter(|c| c.starts_with("DWELL")).collect();
    assert_eq!(dwells, ["DWELL(0.5000)", "DWELL(1.5000)", "DWELL(0.2500)"]);
}

/// The seconds of a lathe's dwell are no diameter.
#[test]
fn fanuc_dwells_of_a_lathe() {
    let (calls, outcome) = run_in("fanuc-turn", "G21\nG4 X1.\nG4 U1.\nG4 P1000\nM30\n");
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let dwells: Vec<_> = calls.iter().filter(|c| c.starts_with("DWELL")).collect();
    assert_eq!(dwells, ["DWELL(1.0000)"; 3]);
}

/// Machining center manual (B-63944), programmable data input: L2 origins, L10 lengths, L12 radii. The rest is refused.
#[test]
fn fanuc_data_input() {
    let text = "G21 G90 G54\nG10 L2 P1 X1.\nG10 L10 P1 R5.\nT1 M6\nG43 H1 G0 Z1.\nX0.\nM30\n";
    let (calls, outcome) = run_in("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert!(calls.iter().any(|c| c.starts_with("USE_TOOL_LENGTH_OFFSET(0.0000 0.0000 5.0000")), "{calls:?}");
    for line in ["G10 L20 P1 X1.", "G10 L11 P1 R1.", "G10 L2 P0 X1.", "G10 L2 P7 X1.", "G10 L2 P1 X1. R30.", "G91 G10 L2 P1 X1.", "G10 L1 P1 Z5."] {
        let (_, outcome) = run_in("fanuc-mill", &format!("{line}\nM30\n"));
        assert_eq!(outcome.findings[0].fault.code, code::CODE_NOT_CARRIED_OUT, "{line}");
    }
}

/// M19 of a Fanuc goes to the angle that the machine has for it; it needs no R.
#[test]
fn fanuc_m19_orients_the_spindle() {
    for id in ["fanuc-mill", "fanuc-turn"] {
        let (calls, outcome) = run_in(id, "M19\nM30\n");
        let orients = calls.iter().filter(|c| *c == "ORIENT_SPINDLE(0, 0.0000, 0)").count();
        assert_eq!((outcome.findings, orients), (Vec::new(), 1), "{id}: {calls:?}");
    }
}

/// grbl's only axis of a tool length has to be named.
#[test]
fn grbl_g43_1_needs_z() {
    for (line, found) in [("G43.1", vec![code::WORD_MISSING]), ("G43.1 Z-5", vec![])] {
        let (_, outcome) = run_in("grbl", &format!("G21 G90\n{line}\nM30\n"));
        assert_eq!(outcome.findings.iter().map(|f| f.fault.code).collect::<Vec<_>>(), found, "{line}");
    }
}

/// What LinuxCNC has and the control has not is refused, not carried out with LinuxCNC's meaning.
#[test]
fn dialects_are_closed_lists() {
    for (id, line) in [
        ("fanuc-mill", "G38.2 Z-5. F100."),
        ("fanuc-mill", "M66 P0"),
        ("fanuc-turn", "G7"),
        ("fanuc-turn", "G64"),
        ("grbl", "G81 X1 Z-1 R1"),
        ("grbl", "G33 Z-1 K1"),
        ("grbl", "M6"),
        ("grbl", "M98 P1"),
        ("grbl", "M99"),
        ("grbl", "G0 A5"),
        ("grbl", "G0 X1 W2"),
        ("grbl", "G10 L10 P1 X1"),
        ("grbl", "G10 L2 P1 R30 X1"),
        ("grbl", "G2 X1 Y1 I.5 J.5 P2 F10"),
        ("grbl", "G10 L20 P7 X0"),
        ("grbl", "G43.1 X1"),
        ("grbl", "T300"),
        ("grbl", "N10000001 G0 X1"),
    ] {
        let (_, outcome) = run_in(id, &format!("{line}\nM30\n"));
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
    let (calls, outcome) = run_in("fanuc-mill", text);
    assert!(outcome.ok(), "{:?}", outcome.findings);
    assert_eq!(moves_of(&calls), ["rapid 1 2 0", "rapid 5 2 0", "rapid 1 2 0", "rapid 3 2 -1", "rapid 0 2 -1"]);
    for (text, wanted) in [
        ("#0=1\n", code::PARAMETER_READ_ONLY),
        ("#50=1\n", code::SYNTAX_NOT_IN_DIALECT),
        ("#1=#4001\n", code::CODE_NOT_CARRIED_OUT),
        ("#3000=1\n", code::CODE_NOT_CARRIED_OUT),
    ] {
        let (_, outcome) = run_in("fanuc-mill", text);
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
    let (calls, outcome) = run_in("fanuc-mill", text);
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
        let (_, outcome) = run_in("fanuc-mill", text);
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
    let (calls, outcome) = run_in("fanuc-mill", text);
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
    let (calls, outcome) = run_in("fanuc-mill", text);
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
        let (_, outcome) = run_in("fanuc-mill", text);
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
    let (calls, outcome) = run_in("fanuc-turn", text);
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
    let (_, outcome) = run_in("fanuc-turn", "G0 G90 X1. Z1.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::CODE_SAME_GROUP);
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
        let (calls, outcome) = run_in("fanuc-mill", &format!("G21 G90\n{call}\nM30\n{subs}"));
        assert!(outcome.ok(), "{call}: {:?}", outcome.findings);
        assert_eq!(moves_of(&calls).last().map(String::as_str), Some(format!("rapid {x} 0 0").as_str()), "{call}");
    }
    let (_, outcome) = run_in("fanuc-turn", "M98 P20003\nM30\nO1\nM99\n");
    assert_eq!((outcome.findings[0].fault.code, outcome.findings[0].fault.message_args()[0].as_str()), (code::SUB_NOT_FOUND, "3"));
}

/// Fanuc lathe manual: G50 S holds surface speed control below a speed, before and after G96.
#[test]
fn a_fanuc_lathe_clamps_the_spindle() {
    for text in ["G50 S2000\nG96 S150 M3\nM30\n", "G96 S150 M3\nG50 S2000\nM30\n"] {
        let (calls, outcome) = run_in("fanuc-turn", text);
        assert!(outcome.ok(), "{text}: {:?}", outcome.findings);
        let modes: Vec<&String> = calls.iter().filter(|c| c.starts_with("SET_SPINDLE_MODE")).collect();
        assert!(modes.iter().any(|m| m.contains("2000.0000")), "{text}: {modes:?}");
        assert_eq!(calls.iter().filter(|c| c.starts_with("SET_SPINDLE_SPEED")).count(), 1, "{text}");
    }
    let (_, outcome) = run_in("fanuc-turn", "G50 X100. Z50.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::CODE_NOT_CARRIED_OUT);
}

/// A Fanuc control moves in the block of an M99, then returns.
#[test]
fn words_before_m99() {
    let (calls, outcome) = run_in("fanuc-mill", "G21 G90\nM98 P100\nG0 Y3.\nM30\nO100\nG0 X1.\nX2. M99\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    assert_eq!(moves_of(&calls), ["rapid 1 0 0", "rapid 2 0 0", "rapid 2 3 0"]);
}

/// Threading of the manuals: F is the lead, along the axis that goes furthest, and the feed from then on.
#[test]
fn threads_by_their_lead() {
    let sync = |dialect: &str, text: &str| {
        let (calls, outcome) = run_in(dialect, text);
        assert!(outcome.ok(), "{text}: {:?}", outcome.findings);
        calls.into_iter().filter(|c| c.contains("SPEED_FEED") || c.contains("SET_FEED_RATE")).collect::<Vec<_>>()
    };
    let mill = sync("fanuc-mill", "G21 G90 M3 S100\nG0 Z5.\nG33 Z-5. F1.5\nM30\n");
    assert!(mill.contains(&"START_SPEED_FEED_SYNC(1.500000,0)".into()), "{mill:?}");
    // 3 in radius and 4 in Z: 5 along the way.
    let lathe = sync("fanuc-turn", "G21 M3 S100\nG0 X20. Z0\nG32 X26. Z-4. F2.\nG32 W-4. Q0\nM30\n");
    assert!(lathe.contains(&"START_SPEED_FEED_SYNC(2.500000,0)".into()), "{lathe:?}");
    assert!(lathe.contains(&"START_SPEED_FEED_SYNC(2.000000,0)".into()), "{lathe:?}");
    assert!(lathe.contains(&"SET_FEED_RATE(2.0000)".into()), "{lathe:?}");
    for (dialect, block, expected) in [
        ("fanuc-mill", "G33 Z-5. K1.5", code::SYNTAX_NOT_IN_DIALECT),
        ("fanuc-mill", "G33 Z-5.", code::WORD_MISSING),
        ("fanuc-mill", "G2 X0 Y0 I5. F100. P3", code::SYNTAX_NOT_IN_DIALECT),
        ("fanuc-turn", "G32 Z-5. F1. Q90000", code::CODE_NOT_CARRIED_OUT),
    ] {
        let (_, outcome) = run_in(dialect, &format!("G21 M3 S100\n{block}\nM30\n"));
        assert_eq!(outcome.findings[0].fault.code, expected, "{block}");
    }
}

/// A subprogram that is nowhere is told at its call, wherever the file ends.
#[test]
fn a_missing_subprogram_is_told_at_its_call() {
    for text in ["%\nO1\nG21\nM98 P21000\nM30\n%\n", "O1\nG21\nG0 X1.\nM98 P1000\nM30\n"] {
        let (_, outcome) = run_in("fanuc-mill", text);
        assert_eq!((outcome.findings.len(), outcome.findings[0].line), (1, 3), "{text}: {:?}", outcome.findings);
    }
}

/// T0101: the turret turns while the spindle does, and offset 1 is in force; T0100 takes it back.
#[test]
fn a_lathe_changes_its_tool_with_t() {
    let (calls, outcome) = run_in("fanuc-turn", "G21 G97 S500 M3\nT0101\nG0 X20. Z5.\nT0100\nT0202\nM30\n");
    assert!(outcome.ok(), "{:?}", outcome.findings);
    let tools: Vec<&str> = calls.iter().map(String::as_str).filter(|c| ["SELECT_TOOL", "CHANGE_TOOL", "USE_TOOL", "STOP_SPINDLE"].iter().any(|k| c.starts_with(k))).collect();
    let names: Vec<&str> = tools.iter().map(|c| c.split('(').next().unwrap_or_default()).collect();
    assert_eq!(
        &names[..8],
        ["SELECT_TOOL", "CHANGE_TOOL", "USE_TOOL_LENGTH_OFFSET", "SELECT_TOOL", "USE_TOOL_LENGTH_OFFSET", "SELECT_TOOL", "CHANGE_TOOL", "USE_TOOL_LENGTH_OFFSET"],
        "{tools:?}"
    );
}

/// Block numbers are those of the program that they stand in: GOTO, IF … GOTO and END stay inside of it.
#[test]
fn fanuc_block_numbers_belong_to_their_program() {
    let main = "O0001\nG21 G90 G17\nG0 X1.\nM98 P2\nN10 G0 X7.\nN20 G0 X50.\nM30\n";
    let sub = "O0002\n#101=2\nN10 #101=#101+1\nG0 X#101\nIF [#101 LT 4] GOTO 10\nGOTO 20\nG0 X99.\nN20 G0 X60.\nM99\n";
    let (calls, outcome) = run_in("fanuc-mill", &format!("{main}{sub}"));
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    assert_eq!(moves_of(&calls), ["rapid 1 0 0", "rapid 3 0 0", "rapid 4 0 0", "rapid 60 0 0", "rapid 7 0 0", "rapid 50 0 0"]);
    // M99 P names a block of the program that called, though its own has one too.
    let (calls, outcome) = run_in("fanuc-mill", &format!("{main}O0002\nG0 X2.\nM99 P20\nN20 G0 X60.\nM99\n"));
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    assert_eq!(moves_of(&calls), ["rapid 1 0 0", "rapid 2 0 0", "rapid 50 0 0"]);
    // What only another program has is not there.
    for (body, name) in [("GOTO 20\n", "N20"), ("WHILE [1 EQ 0] DO 1\n", "DO 1"), ("END 2\n", "END 2")] {
        let main = main.replace("G0 X1.\n", "WHILE [1 EQ 0] DO 2\nEND 2\n");
        let (_, outcome) = run_in("fanuc-mill", &format!("{main}O0002\n{body}M99\nO0003\nEND 1\nM99\n"));
        let fault = &outcome.findings[0].fault;
        assert_eq!((fault.code, &fault.args[0][..]), (code::FLOW_LABEL, name));
    }
}

/// Series 0i/30i, machining center and lathe, machine coordinate system: G53 is a rapid for its block alone.
#[test]
fn a_fanuc_g53_is_a_rapid_of_its_own() {
    let text = "G21 G90 G17\nG1 X50. F100.\nG53 Z0\nX60.\nG2 X70. I5.\nG53 Y9.\nX80. I5.\nG53 G0 X1.\nX2.\nM30\n";
    let (calls, outcome) = run_in("fanuc-mill", text);
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    let moves: Vec<_> = moves_of(&calls).iter().map(|m| m.split(' ').take(2).collect::<Vec<_>>().join(" ")).collect();
    assert_eq!(moves, ["feed 50", "rapid 50", "feed 60", "arc 70", "rapid 70", "arc 80", "rapid 1", "rapid 2"], "{calls:?}");
    let (calls, outcome) = run_in("fanuc-turn", "G21 G98\nG1 X50. F100.\nG53 X20. Z0\nX60.\nM30\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    assert_eq!(moves_of(&calls), ["feed 25 0 0", "rapid 10 0 0", "feed 30 0 0"]);
    for (text, expected) in [
        ("G53 G1 Z0 F100.\n", code::MOTION_G53),
        ("G91 G53 Z0\n", code::MOTION_G53),
        ("G53\n", code::AXIS_MISSING),
        ("G0 Z5.\nG81 X1. Z-5. R2. F100.\nG53 Z0\n", code::CODE_NOT_CARRIED_OUT),
    ] {
        let (_, outcome) = run_in("fanuc-mill", &format!("G21 G90\n{text}M30\n"));
        assert_eq!(outcome.findings[0].fault.code, expected, "{text}");
    }
}

/// A code of group 01 beside a one-shot code of group 00 is in force from then on.
#[test]
fn motion_beside_a_one_shot_code() {
    let of = |id: &str, text: &str| -> Vec<String> {
        let (calls, outcome) = run_in(id, &format!("G21 F100. S100 M3\nG1 X5. Z5.\n{text}{}Z7.\nM30\n", if text.ends_with("\nG0") { " " } else { "\n" }));
        assert!(outcome.findings.is_empty(), "{id} {text} {:?}", outcome.findings);
        calls
    };
    let apart = [
        ("fanuc-mill", "G0 G91 G28 Z0.", "G91 G28 Z0.\nG0"),
        ("fanuc-mill", "G91 G28 G00 X0 Y0", "G91 G28 X0 Y0\nG0"),
        ("fanuc-mill", "G90 G0 G28 X0 Y0", "G90 G28 X0 Y0\nG0"),
        ("fanuc-mill", "G0 G30 Z0", "G30 Z0\nG0"),
        ("fanuc-mill", "G0 G52 X5.", "G52 X5.\nG0"),
        ("fanuc-mill", "G90 G0 G92 X5.", "G92 X5.\nG0"),
        ("fanuc-mill", "G0 G10 L2 P1 X5.", "G10 L2 P1 X5.\nG0"),
        ("fanuc-mill", "G90 G68 X1. Y2. R30.\nG0 X4.\nG69", "G68 X1. Y2. R30.\nG0 X4.\nG69"),
        ("fanuc-mill", "G17 G0 G68 X1. Y2. R30.\nX4.\nG69", "G68 X1. Y2. R30.\nG0 X4.\nG69"),
        ("fanuc-mill", "G18 G68 X1. Z2. R30.\nG1 X4.\nG69", "G18\nG68 X1. Z2. R30.\nG1 X4.\nG69"),
        ("fanuc-mill", "G55 G68 X1. Y2. R30.\nG1 X4.\nG69", "G55\nG68 X1. Y2. R30.\nG1 X4.\nG69"),
        ("fanuc-mill", "G15 G50 G50.1 X0 Y0\nG11", ""),
        ("fanuc-turn", "G0 G28 U0 W0", "G28 U0 W0\nG0"),
        ("fanuc-turn", "G0 G30 U0 W0", "G30 U0 W0\nG0"),
    ];
    let moves = |mut calls: Vec<String>| -> Vec<String> {
        calls.retain(|c| ["STRAIGHT", "SET_G5", "SET_G92"].iter().any(|n| c.starts_with(n)));
        calls
    };
    for (id, beside, apart) in apart {
        assert_eq!(moves(of(id, beside)), moves(of(id, apart)), "{id} {beside}");
    }
    // The other words of their blocks count.
    let (calls, outcome) = run_in("fanuc-mill", "G21 G90\nG68 X0 Y0 R90. F300. S2000\nG1 X5.\nG69 G80 X7.\nG69 G0 G28 Z0\nM30\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    assert!(calls.iter().any(|c| c == "SET_FEED_RATE(300.0000)") && calls.iter().any(|c| c.starts_with("SET_SPINDLE_SPEED(0, 2000")), "{calls:?}");
    assert!(calls.iter().any(|c| c.starts_with("STRAIGHT_FEED(7.0000, 5.0000")), "{calls:?}");
    for text in ["G91 G68 X0 Y0 R30.", "G55 G68 R30.", "G68 G43 H1 X0 Y0 R30."] {
        let (_, outcome) = run_in("fanuc-mill", &format!("G21 G90\nT1 M6\n{text}\nM30\n"));
        assert_eq!(outcome.findings.iter().map(|f| f.fault.code).collect::<Vec<_>>(), [code::CODE_NOT_CARRIED_OUT], "{text}");
    }
    let (_, outcome) = run_in("fanuc-mill", "G21 G90\nG5.1 X1. I1. J1.\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::WORD_MISSING);
    for text in ["G5.1 Q1", "G05.1 Q1 R5", "G05.1 Q2 X0 Y0 Z0", "G8 P1", "G05 P10000"] {
        let (_, outcome) = run_in("fanuc-mill", &format!("G21 G90\n{text}\nG0 X1.\nM30\n"));
        assert_eq!(outcome.findings.iter().map(|f| f.fault.code).collect::<Vec<_>>(), [code::PATH_LOOK_AHEAD], "{text}");
    }
}

/// Machining center: a tap in G18 goes along Y.
#[test]
fn taps_in_other_planes() {
    let (calls, _) = run_in("fanuc-mill", "G21 G90 G18 F500. S500 M3\nG0 Y20.\nG98 G84 X10. Z-10. Y-5. R2. P1\nG80\nM30\n");
    let moves: Vec<String> = calls.iter().filter_map(|c| c.strip_prefix("STRAIGHT_")).map(|c| c.split(", ").take(3).collect::<Vec<_>>().join(" ").replace(".0000", "")).collect();
    assert_eq!(moves[1..], ["TRAVERSE(10 20 -10", "TRAVERSE(10 2 -10", "FEED(10 -5 -10", "FEED(10 2 -10", "TRAVERSE(10 20 -10"]);
}

/// G80 where no cycle is in force leaves the motion alone.
#[test]
fn a_cycle_that_is_not_on_ends_nothing() {
    for text in ["G1 X5.\nG80\nX7.", "G1 X5.\nG80 X7.", "G81 X5. Z-2. R2.\nG80\nG1 X5.\nG80\nX7."] {
        let (calls, outcome) = run_in("fanuc-mill", &format!("G21 G90 F100. S100 M3\nG0 Z9.\n{text}\nM30\n"));
        assert!(outcome.findings.is_empty(), "{text} {:?}", outcome.findings);
        assert!(calls.iter().any(|c| c.starts_with("STRAIGHT_FEED(7.0000")), "{text} {calls:?}");
    }
}

/// Machining center, canned cycles: tapping and G89 feed back to R; the way to the initial level is a rapid.
#[test]
fn taps_come_back_to_r_by_feed() {
    for (cycle, last) in [("G98 G84", "TRAVERSE 50"), ("G99 G84", "FEED 5"), ("G98 G74", "TRAVERSE 50"), ("G98 G89", "TRAVERSE 50"), ("G99 G89", "FEED 5")] {
        let (calls, outcome) = run_in("fanuc-mill", &format!("G21 G90 F500. S500 M3\nG0 Z50.\n{}{cycle} X1. Z-10. R5. P100\nG80\nM30\n", if cycle.ends_with("74") { "M4\n" } else { "" }));
        assert!(outcome.findings.is_empty(), "{cycle} {:?}", outcome.findings);
        let moves: Vec<String> = calls.iter().filter_map(|c| c.strip_prefix("STRAIGHT_")).map(|c| format!("{} {}", c.split('(').next().unwrap(), c.split(", ").nth(2).unwrap().trim_end_matches(".0000"))).collect();
        let expected = ["FEED -10", "FEED 5", last];
        let end = if last.starts_with("FEED") { &expected[..2] } else { &expected[..] };
        assert!(moves.ends_with(&end.iter().map(|m| m.to_string()).collect::<Vec<_>>()), "{cycle} {moves:?}");
    }
}

/// Machining center, canned cycles: rotary axes turn on the way to the hole.
#[test]
fn cycles_turn_rotary_axes() {
    let (calls, outcome) = run_in("fanuc-mill", "G21 G90 F100. S100 M3\nG0 X0 Y0 Z20. A0\nG98 G81 X5. A10. Z-2. R2.\nA90.\nG91 A30. K2\nG80\nM30\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    let at = |c: &String| c.split(['(', ')', ',']).map(str::trim).collect::<Vec<_>>()[1..5].join(" ");
    let feeds: Vec<String> = calls.iter().filter(|c| c.starts_with("STRAIGHT_FEED")).map(at).collect();
    assert_eq!(feeds, ["5.0000 0.0000 -2.0000 10.0000", "5.0000 0.0000 -2.0000 90.0000", "5.0000 0.0000 -2.0000 120.0000", "5.0000 0.0000 -2.0000 150.0000"]);
    let rapids: Vec<String> = calls.iter().filter(|c| c.starts_with("STRAIGHT_TRAVERSE")).map(at).collect();
    assert_eq!(rapids[1..4], ["5.0000 0.0000 20.0000 10.0000", "5.0000 0.0000 2.0000 10.0000", "5.0000 0.0000 20.0000 10.0000"]);
    assert_eq!(rapids[4], "5.0000 0.0000 20.0000 90.0000");
}

/// C and A of a lathe without a C axis are a chamfer and the angle of a line.
#[test]
fn corners_of_a_lathe() {
    let told = |text: &str| -> Vec<gr_spec::Code> {
        let (_, outcome) = run_in("fanuc-turn", &format!("G21 G98 F100.\nG0 X10. Z2.\n{text}\nM30\n"));
        outcome.findings.iter().map(|f| f.fault.code).collect()
    };
    for text in ["G1 X20. C-0.5", "G1 Z-5. C1.", "G1 U4. C1.", "G1 X30. A135.", "G1 Z-9. A10.", "G0 C9.\nG1 X30. A135."] {
        assert_eq!(told(text), [code::CODE_NOT_CARRIED_OUT], "{text}");
    }
    for text in ["G0 C90.", "G0 X5. C90.", "G1 C30.", "G28 H0\nG1 Z-5. C360.", "G0 C0\nG1 Z-9. C720.", "G1 X5. Z5. C90."] {
        assert_eq!(told(text), [], "{text}");
    }
}

/// Subprogram: a call or a return in a block with other words comes after them, and once.
#[test]
fn words_beside_a_subprogram_call() {
    let ends = |text: &str| -> Vec<String> {
        let (calls, outcome) = run_in("fanuc-mill", &format!("G21 G90 F9.\n{text}\nM30\nO7\nG91 X1.\nG90 M99\n"));
        assert!(outcome.findings.is_empty(), "{text}{:?}", outcome.findings);
        calls.iter().filter(|c| c.starts_with("STRAIGHT")).map(|c| c[c.find('(').unwrap() + 1..].split(", ").take(2).collect::<Vec<_>>().join(" ")).collect()
    };
    let plain = ["5.0000 0.0000", "6.0000 0.0000"];
    for text in ["G0 X5.\nM98 P7", "G0 X5. M98 P7", "M98 P7 G0 X5.", "N1 M98 G0 P7 X5. (call)", "#1=7\nG0 M98 P#1 X5.", "G1 X5. M98 P0007 L1"] {
        assert_eq!(ends(text), plain, "{text}");
    }
    for text in ["G0 X5. M98 P30007", "M98 G0 X5. P7 L3"] {
        assert_eq!(ends(text), ["5.0000 0.0000", "6.0000 0.0000", "7.0000 0.0000", "8.0000 0.0000"], "{text}");
    }
    assert_eq!(ends("G10 L2 P2 X3.\nG55 M98 P7\nG0 X9."), ends("G10 L2 P2 X3.\nG55\nM98 P7\nG0 X9."));
    let (calls, _) = run_in("fanuc-mill", "G21 G90 M8 M98 P7\nM98 P7 M9 S500 M3\nM30\nO7\nG0 X1.\nM99 M8 Y2.\n");
    let order: Vec<&str> = calls.iter().filter_map(|c| c.split('(').next()).filter(|c| c.contains("FLOOD") || c.contains("TRAVERSE") || c.contains("START_SPINDLE")).collect();
    let flood_before_each_move = ["FLOOD_ON", "STRAIGHT_TRAVERSE", "FLOOD_ON", "STRAIGHT_TRAVERSE", "START_SPINDLE_CLOCKWISE", "FLOOD_OFF", "STRAIGHT_TRAVERSE", "FLOOD_ON", "STRAIGHT_TRAVERSE", "FLOOD_OFF"];
    assert_eq!(order, flood_before_each_move);
    for (text, told) in [
        ("G0 X5. M98 P7 M30", "M98 beside M30"),
        ("G66 P7\nG0 X5. M98 P7\nG67", "M98 beside a movement while G66 is in force"),
        ("G0 X5. M98", "M98"),
        ("G0 X5. M98 P9", "main.ngc"),
    ] {
        let (_, outcome) = run_in("fanuc-mill", &format!("G21 G90\n{text}\nM30\nO7\nG91 X1.\nG90 M99\n"));
        assert_eq!((outcome.findings.len(), outcome.findings[0].fault.args[0].as_str()), (1, told), "{text} {:?}", outcome.findings);
    }
}

/// Programs are in the control's memory in no order: one that stands before the program that calls it is found too.
#[test]
fn subprograms_in_any_order() {
    let ends = |text: &str| -> Vec<String> {
        let (calls, outcome) = run_in("fanuc-mill", text);
        assert!(outcome.findings.is_empty(), "{text}{:?}", outcome.findings);
        calls.iter().filter(|c| c.starts_with("STRAIGHT")).map(|c| c[c.find('(').unwrap() + 1..].split(',').next().unwrap().to_string()).collect()
    };
    let program = "%\nO1\nG21 G90\nCALL\nM30\nO1000\nG0 X1.\nM99\nO1001\nG0 X2.\nM99\nO1002\nM98 P1000\nG65 P1001 A1.\nM98 P1000\nM99\nO1003\nG66 P1000\nX9.\nG67\nM99\n%\n";
    assert_eq!(ends(&program.replace("CALL", "M98 P1002")), ["1.0000", "2.0000", "1.0000"]);
    assert_eq!(ends(&program.replace("CALL", "M98 P1002 L2\nM98 P1001")), ["1.0000", "2.0000", "1.0000", "1.0000", "2.0000", "1.0000", "2.0000"]);
    assert_eq!(ends(&program.replace("CALL", "M98 P1003")), ["9.0000", "1.0000"]);
    // M99 beside words that don't move while G66 is in force, and behind THEN.
    let left = "%\nO1\nG21 G90\nM98 P1000\nG0 X9.\nM30\nO1000\nG66 P1001\nX2.\nG67 M99\nO1001\nG0 Z1.\nG90 M99\n%\n";
    assert_eq!(ends(left), ["2.0000", "2.0000", "9.0000"]);
    let behind_then = "O1\nG21 G90\nM98 P2\nG0 X9.\nM30\nO2\nG0 X1.\nIF [1 EQ 1] THEN M99\nX2.\nM99\n";
    assert_eq!(ends(behind_then), ["1.0000", "9.0000"]);
    // M99 P in the main program goes to a block; to one above it is the program over again.
    let skipped = "O1\nG21 G90\nN5 G0 X1.\nM99 P20\nX2.\nN20 X3.\nM30\n";
    assert_eq!(ends(skipped), ["1.0000", "3.0000"]);
    let (_, outcome) = run_in("fanuc-mill", &skipped.replace("M30", "M99 P5"));
    assert_eq!(outcome.findings.iter().map(|f| f.fault.code).collect::<Vec<_>>(), [code::PROGRAM_REPEATS]);
    let counted = "O1\nG21 G90\n#1=0\nN5 #1=#1+1\nG0 X#1\nIF [#1 GE 3] GOTO 9\nM99 P5\nN9 X50.\nM30\n";
    assert_eq!(ends(counted), ["1.0000", "2.0000", "3.0000", "50.0000"]);
    let (_, outcome) = run_in("fanuc-mill", &skipped.replace("P20", "P21"));
    assert_eq!(outcome.findings.iter().map(|f| f.fault.code).collect::<Vec<_>>(), [code::FLOW_LABEL]);
    // Ten levels of them.
    let deep = |levels: usize| (1..=levels).map(|n| format!("O{n}\nG0 X{n}.\n{}\n{}\n", if n < levels { format!("M98 P{}", n + 1) } else { String::new() }, if n == 1 { "M30" } else { "M99" })).collect::<String>();
    assert_eq!(ends(&deep(11)).len(), 11);
    let (_, outcome) = run_in("fanuc-mill", &deep(12));
    assert_eq!(outcome.findings.iter().map(|f| f.fault.code).collect::<Vec<_>>(), [code::SUB_LIMIT]);
    let (_, outcome) = run_in("fanuc-mill", &program.replace("CALL", "M98 P1004"));
    assert_eq!(outcome.findings.iter().map(|f| f.fault.code).collect::<Vec<_>>(), [code::SUB_NOT_FOUND]);
}

/// Machining center, tool length offset and cutter compensation: H and D hold, number 0 is no offset, H under G43 changes the length.
#[test]
fn fanuc_offset_numbers() {
    let of = |text: &str, call: &str| -> Vec<String> {
        let (calls, outcome) = run_in("fanuc-mill", &format!("G20 G90 F9.\n{text}M30\n"));
        assert!(outcome.findings.is_empty(), "{text}{:?}", outcome.findings);
        calls.iter().filter(|c| c.starts_with(call)).map(|c| c.split(' ').nth(2).unwrap_or_default().to_string()).collect()
    };
    let lengths = |text: &str| of(text, "USE_TOOL_LENGTH_OFFSET");
    assert_eq!(lengths("T1 M6\nG43 Z5. H1\nG0 Z4. H2\nH0\nH1\nG49\nH2\nG43 Z5.\nT1 M6\nG43 Z5.\nG43 H0 Z9.\nG49\n"), [
        "1.5000,", "1.0000,", "0.0000,", "1.5000,", "0.0000,", "1.0000,", "1.0000,", "0.0000,", "0.0000,"
    ]);
    assert_eq!(lengths("T1 M6 D1 H1\nG43 Z5.\n"), ["1.5000,"]);
    let path = |text: &str| -> Vec<String> {
        let (calls, outcome) = run_in("fanuc-mill", &format!("G20 G90 F9.\nT2 M6\n{text}G1 X4.\nG40 X5.\nM30\n"));
        assert!(outcome.findings.is_empty(), "{text}{:?}", outcome.findings);
        calls.iter().filter(|c| c.starts_with("STRAIGHT_FEED")).map(|c| c.split(", ").nth(1).unwrap_or_default().to_string()).collect()
    };
    let beside = path("G41 D1 G1 X1.\n");
    assert_eq!(beside, ["0.1250", "0.1250", "0.0000"]);
    for text in ["G0 X0 D1\nG41 G1 X1.\n", "D1\nG41 G1 X1.\n", "G41 D1 G1 X1.\nG41 D1\n", "G41 D1 G1 X1.\nG41\nG98\nG99\nG61\nG64\n", "G41 D1 G1 X1.\nD1\n"] {
        assert_eq!(path(text), beside, "{text}");
    }
    assert_eq!(path("D1\nG41 D0 G1 X1.\n"), ["0.0000"; 3]);
    for (text, expected) in [
        ("G43 Z5.\n", code::WORD_MISSING),
        ("G41 G1 X5.\n", code::WORD_MISSING),
        ("D1.5\n", code::COMP_TOOL_WORD),
        ("G41 D1 G1 X5.\nX9. D2\nG40\n", code::CODE_NOT_CARRIED_OUT),
        ("G41 D1 G1 X5.\nG42 X9.\nG40\n", code::COMP_NOT_HERE),
    ] {
        let (_, outcome) = run_in("fanuc-mill", &format!("G20 G90 F9.\nT1 M6\n{text}M30\n"));
        let found: Vec<_> = outcome.findings.iter().map(|f| f.fault.code).collect();
        assert_eq!(found, [expected], "{text}");
    }
    // In LinuxCNC 0 is the tool in the spindle.
    let (calls, _) = run_in("linuxcnc", "G20 G90\nT1 M6\nG43 H0\nM2\n");
    assert!(calls.iter().any(|c| c.starts_with("USE_TOOL_LENGTH_OFFSET(0.0000 0.0000 1.5000")), "{calls:?}");
}

/// grbl 1.1 (gcode.c) and Fanuc (F is modal): the mode of feed that is in force already leaves F as it is. LinuxCNC forgets it.
#[test]
fn a_repeated_mode_of_feed_keeps_the_feed() {
    for (id, text) in [
        ("grbl", "G21 G94\nG1 X1 F300\nG90 G94\nG1 X2\nM30\n"),
        ("fanuc-mill", "G21 G94\nG1 X1. F300.\nG90 G94\nG1 X2.\nM30\n"),
        ("fanuc-turn", "G21 G99\nG97 S100 M3\nG1 X1. F.3\nG40 G97 G99\nG1 X2.\nM30\n"),
        ("fanuc-turn", "G21 G98\nG1 X1. F300.\nG98\nG1 X2.\nM30\n"),
    ] {
        let (calls, outcome) = run_in(id, text);
        assert!(outcome.findings.is_empty(), "{id}: {:?}", outcome.findings);
        assert_eq!(moves_of(&calls).len(), 2, "{id}: {calls:?}");
    }
    for (id, text) in [
        ("linuxcnc", "G21 G94\nG1 X1 F300\nG94\nG1 X2\nM2\n"),
        ("grbl", "G21 G94\nG1 X1 F300\nG93\nG94\nG1 X2\nM30\n"),
        ("fanuc-mill", "G21 G94\nG1 X1. F300.\nG95 S9 M3\nG1 X2.\nM30\n"),
    ] {
        let (_, outcome) = run_in(id, text);
        assert_eq!(outcome.findings[0].fault.code, code::FEED_MISSING, "{id}");
    }
}

/// grbl 1.1 (gcode.c): machine coordinates are places under G91 too.
#[test]
fn a_grbl_g53_is_absolute() {
    let (calls, outcome) = run_in("grbl", "G21\nG0 X5 Z3\nG91\nG53 G0 Z-2\nG0 X1 Z1\nG90\nG53 G0 X4\nM30\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    assert_eq!(moves_of(&calls), ["rapid 5 0 3", "rapid 5 0 -2", "rapid 6 0 -1", "rapid 4 0 -1"]);
}

/// P2 is the second reference point, which G30 goes to anyhow; where the others are only the machine knows.
#[test]
fn fanuc_reference_points() {
    let (with, outcome) = run_in("fanuc-mill", "G21 G91\nG30 P2 Z0\nM30\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    assert_eq!(with, run_in("fanuc-mill", "G21 G91\nG30 Z0\nM30\n").0);
    let (_, outcome) = run_in("fanuc-turn", "G21\nG30 P2 U0 W0\nM30\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    for (p, expected) in [(3, code::CODE_NOT_CARRIED_OUT), (4, code::CODE_NOT_CARRIED_OUT), (5, code::WORD_BAD_VALUE)] {
        let (_, outcome) = run_in("fanuc-mill", &format!("G21 G91\nG30 P{p} Z0\nM30\n"));
        assert_eq!(outcome.findings[0].fault.code, expected, "P{p}");
    }
}

/// G92 S of a machining center is G50 S of a lathe; with axis words it sets coordinates.
#[test]
fn a_fanuc_mill_clamps_the_spindle() {
    let (calls, outcome) = run_in("fanuc-mill", "G21 G90\nG92 S3000\nG96 S100\nM3\nG92 S2500\nM5\nM30\n");
    assert!(outcome.findings.is_empty(), "{:?}", outcome.findings);
    let limits: Vec<_> = calls.iter().filter(|c| c.starts_with("SET_SPINDLE_MODE")).cloned().collect();
    assert_eq!(limits[..2], ["SET_SPINDLE_MODE(0 3000.0000)", "SET_SPINDLE_MODE(0 2500.0000)"], "{calls:?}");
    assert!(!calls.iter().any(|c| c.starts_with("SET_SPINDLE_SPEED(0, 3000")), "{calls:?}");
    let (_, outcome) = run_in("fanuc-mill", "G21 G90\nG92 X0. S3000\nM30\n");
    assert_eq!(outcome.findings[0].fault.code, code::CODE_NOT_CARRIED_OUT);
    assert!(run_in("fanuc-mill", "G21 G90\nG92 X0.\nM30\n").1.findings.is_empty());
}

/// The words that a table lists for a code of LinuxCNC are words that the code uses.
#[test]
fn words_of_the_table_are_used() {
    let mut wrong = Vec::new();
    for id in ["linuxcnc-2.9", "linuxcnc-2.10"] {
        let dialect = Dialect::find(id).expect("a dialect");
        let version = if id == "linuxcnc-2.10" { gr_canon::Version::V2_10 } else { gr_canon::Version::V2_9 };
        for row in dialect.codes.iter() {
            for letter in row.args.iter().flat_map(|a| a.letters.chars()) {
                // A spindle goes with its speed.
                let speed = if letter == '$' { "S1 " } else { "" };
                let text = format!("G21 G90\n{} {speed}{letter}1\nM2\n", row.code);
                let (_, outcome) = run_with(&Setup { dialect, version, ..setup() }, &text, 100);
                if outcome.findings.iter().any(|f| f.fault.code == code::WORD_UNUSED) {
                    wrong.push(format!("{id}: {} {letter}", row.code));
                }
            }
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
}
