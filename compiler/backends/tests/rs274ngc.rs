//! Written programs move as their sources do: read again by our interpreter, and where LinuxCNC is installed, by
//! the real one.

mod reader;

use gr_backends::rs274ngc::{Arcs, Language, Options, emit};
use gr_backends::{Texts, from_line};
use gr_canon::{Axes, FileId, Units};
use gr_interp::{Setup, Tool};
use gr_ir::diff::{Aspect, Tolerance, diff};
use gr_ir::Program;
use gr_spec::Dialect;

fn setup(dialect: &'static Dialect) -> Setup {
    let tool = |number: i32, z: f64| {
        let mut offset: Axes = [0.0; 9];
        offset[2] = z;
        Tool { number, pocket: number, offset, diameter: 6.0, ..Tool::default() }
    };
    let mut setup = Setup { dialect, ..Setup::default() };
    setup.tools.rows = vec![tool(0, 0.0), tool(1, 50.0), tool(2, 62.5), tool(3, 0.0)];
    setup
}

fn tools() -> Vec<(i32, Axes)> {
    let setup = setup(Dialect::linuxcnc());
    setup.tools.rows.iter().skip(1).map(|t| (t.number, t.offset)).collect()
}

fn run_as(text: &str, dialect: &str) -> Result<Program, String> {
    let dialect = Dialect::find(dialect).expect("a dialect");
    let setup = setup(dialect);
    reader::read(text, &setup)
}

fn run(text: &str) -> Program {
    run_as(text, "linuxcnc").unwrap_or_else(|e| panic!("{e}"))
}

fn options(language: Language) -> Options {
    Options { language, tools: tools(), ..Options::default() }
}

fn write(text: &str, options: &Options) -> String {
    let program = run(text);
    match emit(&program, options, &Texts::new([(FileId(0), text)])) {
        Ok(e) => e.text,
        Err(e) => panic!("{e:?}\n{text}"),
    }
}

fn errors(text: &str, language: Language) -> Vec<(&'static str, String)> {
    let program = run(text);
    let texts = Texts::new([(FileId(0), text)]);
    let found = emit(&program, &options(language), &texts).expect_err("not expressible");
    found.iter().map(|d| (d.code.def().slug, text[d.primary().1.range()].to_string())).collect()
}

/// The program written with these options, read again, moves like the source.
fn same(text: &str, options: &Options, length: f64) {
    let written = write(text, options);
    let dialect = match options.language {
        Language::Linuxcnc => "linuxcnc",
        Language::FanucMill => "fanuc-mill",
        Language::Grbl => "grbl",
    };
    let again = run_as(&written, dialect).unwrap_or_else(|e| panic!("{e}\n--- from\n{text}"));
    let tolerance = Tolerance { length, angle: length, rate: 2e-3, ..Tolerance::default() };
    let found = diff(&run(text), &again, &tolerance);
    // Rounding changes the length of a short program by more than the total time allows for.
    // LinuxCNC's cycles follow the exact path; elsewhere that is the cycle's own affair.
    let other = options.language != Language::Linuxcnc;
    let bad = found.differences.iter().any(|d| d.aspect != Aspect::Time && !(other && d.aspect == Aspect::Control));
    assert!(!bad, "{:#?}\n{text}\n--- written\n{written}", found.differences);
}

/// How far apart the ways may be: what the last decimal rounds, and never less than a millionth of a millimetre.
fn unit(o: &Options) -> f64 {
    let mm = if o.units == Units::Inch { 25.4 } else { 1.0 };
    // A point half way along an arc has the rounding of both ends and of the radius in it.
    (1.8 * mm * 10f64.powi(-(o.places() as i32))).max(1e-6)
}

const PLAIN: &str = "\
G21 G17 G90
(first contour)
G54
M3 S1200
M8
G0 X0 Y0 Z5
G1 Z-1.25 F100
X40
G3 X50 Y10 I0 J10
G2 X60 Y20 R10
G1 Y40.12345 F250.5
X0
Y0
G0 Z5
M9
M5
M2
";

const STRUCTURED: &str = "\
G21 G90 G17
#31=10
o100 sub
G1 X[#31*2] F[#32]
Y#31
X0
Y0
o100 endsub
#32=300
G0 X0 Y0 Z2
o101 while [#31 LT 13]
o100 call
#31=[#31+1]
o101 endwhile
G81 X10 Y10 Z-3 R1 F80
X20
G98 G83 X30 Z-9 R2 Q3
G80
G0 X0 Y0 Z10
G91
G1 X1 Y1
X1 Y1
G90
G0 @10 ^30
G1 @10 ^60 F100
M2
";

const COMPENSATED: &str = "\
G21 G90 G17 F200
G0 X-10 Y-10 Z0
G42 D1 G1 X0 Y0
X50
Y30
G2 X40 Y40 I-10 J0
G1 X0
Y0
G40 X-10 Y-10
M2
";

const TOOLS: &str = "\
G21 G90
T1 M6
G43 H1
S1000 M3
G0 Z10
X10 Y10
G1 Z-2 F100
G53 G0 Z0
T2 M6
G43 H2
G0 X20 Y20
Z5
G1 Z-1
G49
G28 Z20
M30
";

/// Work offsets that are set while another is in force, named where the simulation has the value already, or never used.
const STORED: &str = "\
G21 G90 G54
G0 X1 Y2 Z3
G10 L20 P2 X50 Z[2+3]
G10 L2 P3 X0 Y[1+1]
G10 L2 P1 X0
G55 G0 X3 Y4 Z5
G92 X9
G10 L20 P3 X1 Y1
G56 G0 X1 Y1
G10 L2 P6 Z0
M2
";

const OFFSETS: &str = "\
G21 G90 G17
G10 L2 P2 X10 Y20 Z-5
G55
G0 X1 Y1 Z1
G1 X5 F100
G92 X0 Y0
G1 X3 Y3
G92.1
G1 X1
G52 X2
X1
G52 X0
G54
G0 X0 Y0 Z3
M2
";

const ODD: &str = "\
G20 G90 G17
G0 X1 Y1 Z.1
G4 P1.5
G64 P0.001
G18
G2 X2 Z0.1 I0.5 K0 F12
G19
G3 Y2 Z0.1 J0.5 K0
G17
G2 X2 Y2 I1 J1
G3 X2 Y2 Z-1 I.5 J0 P3
G61
G1 X1.23456
M0
M1
M2
";

const EVENTS: &str = "\
G21 G90 G17
M3 S500
M7
M8
G1 X1 F100
M9
M62 P1
M64 P2
G1 X2
M67 E1 Q2.5
M65 P2
M50 P0
M52 P1
(MSG,look here)
M19 R45 Q3
M4 S300
G33 Z-5 K1.5
G0 Z5
G33.1 Z-5 K1
G95 F0.1
G1 X5
G94 F100
G5 X20 Y0 I3 J3 P-3 Q3
G5.2 X22 Y3 P2 L4
X25 Y5 P1
X27 Y1 P1
G5.3
G5.1 X30 Y0 I2 J3
G1 A10 B5
G1 A20 F45
G38.2 Z-10 F50
M30
";

#[test]
fn snapshots() {
    let all = [
        ("plain", PLAIN),
        ("structured", STRUCTURED),
        ("compensated", COMPENSATED),
        ("tools", TOOLS),
        ("offsets", OFFSETS),
        ("stored", STORED),
        ("odd", ODD),
    ];
    for (name, text) in all {
        for (to, language) in
            [("linuxcnc", Language::Linuxcnc), ("fanuc", Language::FanucMill), ("grbl", Language::Grbl)]
        {
            let program = run(text);
            let out = match emit(&program, &options(language), &Texts::new([(FileId(0), text)])) {
                Ok(e) => {
                    e.text + &e.notes.iter().map(|d| format!("{:?}: {}\n", d.severity, d.message)).collect::<String>()
                }
                Err(e) => e.iter().map(|d| format!("{:?}: {}\n", d.code, d.message)).collect(),
            };
            insta::assert_snapshot!(format!("{name}_{to}"), out);
        }
    }
    insta::assert_snapshot!("events_linuxcnc", write(EVENTS, &options(Language::Linuxcnc)));
    let many = Options {
        units: Units::Inch,
        decimals: Some(3),
        arcs: Arcs::R,
        numbers: Some((10, 10)),
        repeat_words: true,
        comments: false,
        ..options(Language::Linuxcnc)
    };
    insta::assert_snapshot!("plain_options", write(PLAIN, &many));
}

#[test]
fn every_program_moves_the_same() {
    for text in [PLAIN, STRUCTURED, COMPENSATED, TOOLS, OFFSETS, STORED, ODD, EVENTS] {
        for units in [Units::Mm, Units::Inch] {
            for decimals in [None, Some(3), Some(8)] {
                for arcs in [Arcs::Ijk, Arcs::IjkAbsolute, Arcs::R] {
                    let o = Options { units, decimals, arcs, ..options(Language::Linuxcnc) };
                    same(text, &o, unit(&o));
                }
            }
        }
    }
}

#[test]
fn other_languages_move_the_same() {
    let both = [Language::Grbl, Language::FanucMill];
    let all = [PLAIN, STRUCTURED, COMPENSATED, OFFSETS].into_iter().flat_map(|t| both.map(|l| (t, l)));
    // grbl stops for the operator instead of changing a tool.
    for (text, language) in all.chain([(TOOLS, Language::FanucMill)]) {
        for arcs in [Arcs::Ijk, Arcs::R] {
            let o = Options { arcs, ..options(language) };
            same(text, &o, unit(&o));
        }
    }
}

#[test]
fn arcs_as_lines() {
    let o = Options { arcs: Arcs::Lines, arc_tolerance: 0.01, decimals: Some(6), ..options(Language::Linuxcnc) };
    let written = write(PLAIN, &o);
    assert!(!written.contains("G2 ") && !written.contains("G3 "));
    same(PLAIN, &o, 0.011);
}

#[test]
fn nothing_is_dropped_silently() {
    assert_eq!(errors("G21 G90\nM64 P1\nM2\n", Language::Grbl), [("emit/not-expressible", "M64 P1".to_string())]);
    // However many hints come first.
    let many = format!("G21 G90\n{}M64 P1\nM2\n", "(MSG, look)\nG4 P0.1\n".repeat(150));
    assert_eq!(errors(&many, Language::Grbl).last(), Some(&("emit/not-expressible", "M64 P1".to_string())));
    assert_eq!(errors("G21 G90 F100\nG1 A10\nM2\n", Language::Grbl), [("emit/not-expressible", "G1 A10".to_string())]);
    assert_eq!(errors("G21 G90 M3 S100\nG33 Z-3 K1\nM2\n", Language::Grbl)[0].1, "G33 Z-3 K1");
    assert_eq!(errors("G21 G90 M3 S100\nG95 F1\nG1 X1\nM2\n", Language::Grbl)[0].1, "G1 X1");
    assert_eq!(errors("G21 G90 F100\nG38.2 Z-1\nM2\n", Language::FanucMill)[0].1, "G38.2 Z-1");
}

#[test]
fn machine_positions_stay_machine_positions() {
    let written = write(TOOLS, &options(Language::Linuxcnc));
    assert!(written.contains("G53 G0 Z0\n"), "{written}");
    assert!(written.contains("G28 Z20\n"), "{written}");
    assert!(written.contains("G43 H2\n"), "{written}");
}

#[test]
fn rounding_does_not_add_up() {
    // A thousand steps of a third: each word comes from the absolute position.
    let text = "G21 G90 G0 X0 Y0 Z0\no1 repeat [1000]\nG91 G1 X[1/3] F100\no1 endrepeat\nM2\n";
    let o = Options { decimals: Some(3), ..options(Language::Linuxcnc) };
    let written = write(text, &o);
    assert!(written.contains("X333.333\n"), "{}", &written[written.len() - 200..]);
    same(text, &o, 0.0006);
}

#[test]
fn coarse_arcs_still_make_circles() {
    let text = "G21 G90 G17 F100\nG0 X0.1234 Y0.5678 Z0\nG3 X10.7777 Y3.3333 R7.123\nG2 X12.3456 Y2.3456 R50.5\nM2\n";
    for decimals in [1, 2, 3] {
        for arcs in [Arcs::Ijk, Arcs::R] {
            for language in [Language::Linuxcnc, Language::Grbl] {
                let o = Options { decimals: Some(decimals), arcs, ..options(language) };
                same(text, &o, unit(&o));
            }
        }
    }
}

/// LinuxCNC takes no arcs of less than 0.00127 mm: rounding makes one of these.
#[test]
fn arcs_of_no_radius_are_straight() {
    let text = "G21 G90 G17 F100\nG0 X30 Y20 Z0\nG3 X30 Y20 Z-1 I-0.0013\nG3 X29.9972 Y20 I-0.0014\nM2\n";
    for units in [Units::Mm, Units::Inch] {
        for decimals in [None, Some(3), Some(6)] {
            run(&write(text, &Options { decimals, units, ..options(Language::Linuxcnc) }));
        }
    }
}

/// A steep helix of a radius below the last decimal keeps a radius.
#[test]
fn tiny_helices_keep_a_radius() {
    let text = "G21 G90 G17 F100\nG0 X-9.788977180 Y40.482441757 Z0.99345\nG2 X-9.787694826 Y40.479298881 Z-0.93635 I0.019647319 J0.006183437\nM2\n";
    for decimals in [1, 2, 3] {
        let written = write(text, &Options { decimals: Some(decimals), ..options(Language::Linuxcnc) });
        assert!(!written.contains("I0 J0"), "{written}");
        run(&written);
    }
}

/// Outputs stay as they were, and in feed per revolution the last of the way down is at feed too.
#[test]
fn a_restart_restores_outputs_and_feeds_down() {
    let text = "G21 G90\nM3 S100\nM64 P2\nM67 E0 Q3\nG0 X0 Y0 Z5\nG95 F0.1\nG1 Z-4 F2\nG1 X10 F2\nG1 X20 F2\nG0 Z5\nM5\nM2\n";
    let texts = Texts::new([(FileId(0), text)]);
    let restart = from_line::from_line(&run(text), FileId(0), 9, &from_line::Options { safe_z: Some(5.0), ..from_line::Options::default() }, &texts).expect("a start");
    let written = emit(&restart.program, &options(Language::Linuxcnc), &texts).expect("written").text;
    assert!(written.contains("M64 P2\n") && written.contains("M68 E0 Q3\n"), "{written}");
    // No rapid goes lower than those of the program.
    assert!(!written.contains("Z-2") && written.contains("G1 Z-4"), "{written}");
}

#[test]
fn starts_from_a_line() {
    let from = |text: &str, line: u32| {
        let program = run(text);
        let texts = Texts::new([(FileId(0), text)]);
        let o = from_line::Options { safe_z: Some(25.0), ..from_line::Options::default() };
        from_line::from_line(&program, FileId(0), line, &o, &texts).map(|r| {
            let slugs: Vec<_> = r.notes.iter().map(|d| d.code.def().slug).collect();
            (emit(&r.program, &options(Language::Linuxcnc), &texts).expect("written").text, slugs)
        })
    };
    let slug = |r: Result<_, Vec<gr_text::Diagnostic>>| -> &'static str {
        r.map(|_: (String, Vec<&str>)| ()).expect_err("no start")[0].code.def().slug
    };
    let (text, notes) = from(PLAIN, 11).unwrap();
    assert!(notes.is_empty());
    insta::assert_snapshot!("from_line_plain", text);
    run(&text);
    insta::assert_snapshot!("from_line_tools", from(TOOLS, 13).unwrap().0);
    insta::assert_snapshot!("from_line_offsets", from(OFFSETS, 7).unwrap().0);
    insta::assert_snapshot!("from_line_stored", from(STORED, 7).unwrap().0);
    assert_eq!(slug(from(COMPENSATED, 5)), "from-line/inside-compensation");
    assert!(from(COMPENSATED, 3).is_ok());
    let shifted = "G21 G90\nG0 X0 Y0 Z5\nG92 X10\nG92.2\nG0 X5\nX6\nG92.3\nG0 X7\nX8\nM2\n";
    assert_eq!(slug(from(shifted, 6)), "from-line/shift-put-away");
    assert!(from(shifted, 3).is_ok() && from(shifted, 9).is_ok());
    assert_eq!(slug(from(PLAIN, 99)), "from-line/nothing-left");
    assert_eq!(from(STRUCTURED, 4).unwrap().1, ["from-line/inside-loop"]);
}

/// Until a block has said how high the tool is, its height is only what a simulation begins with: nothing goes there.
#[test]
fn a_restart_goes_down_to_no_height_that_nobody_named() {
    let text = "G21 G90 G17 G49\nT1 M6\nG43.1 Z50\nG54\nS3000 M3\nG0 X5 Y6\nX7\nG0 Z5\nG1 Z-1 F100\nX20\nM5\nM2\n";
    let texts = Texts::new([(FileId(0), text)]);
    for line in 4..=10 {
        let o = from_line::Options { safe_z: Some(25.0), ..from_line::Options::default() };
        let restart = from_line::from_line(&run(text), FileId(0), line, &o, &texts).expect("a start");
        let mut lowest = f64::INFINITY;
        let mut cursor = restart.program.cursor();
        while let Some(view) = cursor.next() {
            if view.op.moves() {
                lowest = lowest.min(view.end.axes[2]);
            }
        }
        assert_eq!(lowest, -1.0, "from line {line}");
    }
}

/// Without a feed in force the last piece of the way down is still fed, and what was in force is set again.
#[test]
fn a_restart_feeds_down_where_no_feed_is_in_force() {
    for (mode, feed) in [("G95 F.1", ""), ("G93", " F2")] {
        let text = format!("G21 G90 G94\nM3 S100\nG0 X0 Y0 Z5\n{mode}\nG1 Z-4{feed}\nG94\nG1 X10 F100\nX20\nG0 Z5\nX3\nG94\nG1 X4 F60\nM5\nM2\n");
        let texts = Texts::new([(FileId(0), text.as_str())]);
        let o = from_line::Options { safe_z: Some(25.0), ..from_line::Options::default() };
        let restart = from_line::from_line(&run(&text), FileId(0), 7, &o, &texts).expect("a start");
        let mut down = Vec::new();
        let mut cursor = restart.program.cursor();
        while let Some(view) = cursor.next() {
            if view.op.moves() && view.start.axes[2] > view.end.axes[2] && view.end.axes[2] < 25.0 {
                down.push((view.op == gr_ir::Op::Rapid, view.end.axes[2], view.state.feed * 60.0));
            }
        }
        assert_eq!(down.iter().map(|d| (d.0, d.1)).collect::<Vec<_>>(), [(true, 5.0), (false, -4.0)], "{mode}");
        assert!((down[1].2 - 100.0).abs() < 1e-9, "{down:?}");
        // At a height that the program itself went to by a rapid, one is enough.
        let restart = from_line::from_line(&run(&text), FileId(0), 12, &o, &texts).expect("a start");
        let written = emit(&restart.program, &options(Language::Linuxcnc), &texts).expect("written").text;
        assert!(!written.contains("F100"), "{written}");
    }
}

/// Places of the machine (G28, G30, G53) are numbers of the simulation: an approach goes to none of them.
#[test]
fn a_restart_goes_to_no_place_of_the_machine() {
    let text = "G21 G90 G17 G40 G49\nG28 G91 Z0\nG90\nT1 M6\nG43 H1\nS3000 M3\nG0 X10 Y10\nG0 Z5\nG1 Z-1 F100\nX20\nG53 G0 Z-7\nM5\nT2 M6\nG28\nG0 X3\nG1 Z-1 F50\nM2\n";
    let texts = Texts::new([(FileId(0), text)]);
    let o = from_line::Options { safe_z: Some(100.0), ..from_line::Options::default() };
    let approach = |line: u32| {
        let restart = from_line::from_line(&run(text), FileId(0), line, &o, &texts).expect("a start");
        let written = emit(&restart.program, &options(Language::Linuxcnc), &texts).expect("written").text;
        let ways = written.lines().skip_while(|l| !l.starts_with("G0")).filter(|l| l.contains(['X', 'Y', 'Z']));
        ways.map(|l| l.trim_start_matches("G0 ")).collect::<Vec<_>>().join(" / ")
    };
    // Nobody has said anything: up, and then as the program goes on. Before the change to a tool 50 long the spindle goes higher.
    for (line, height) in [(4, "Z150"), (6, "Z100"), (8, "Z100")] {
        assert!(approach(line).starts_with(&format!("{height} / X10 Y10 / Z5 / G1 Z-1")), "{line}: {}", approach(line));
    }
    // Behind G53 the height is the machine's again; X and Y are the program's.
    assert!(approach(12).starts_with("Z100 / X20 Y10"), "{}", approach(12));
    assert!(!approach(12).contains("Z-7"), "{}", approach(12));
    // Behind a G28 of all axes nothing is known, and Y is named by nobody before the cut.
    let error = from_line::from_line(&run(text), FileId(0), 15, &o, &texts).expect_err("no start");
    assert_eq!(error[0].code.def().slug, "from-line/place-of-machine");
    assert!(error[0].message.contains(" in Y,"), "{}", error[0].message);
    // Beside a place that only the machine knows nothing goes down, whether the cut goes on or is done.
    let beside = "G21 G90 G54 F100\nS1000 M3\nG0 X0 Y0 Z20\nG53 G0 Y14.5\nG0 X5\nG1 Z-1\nX30\nG0 Z20\nX40 Y7\nZ5\nG1 Z-1\nY9\nM2\n";
    let texts = Texts::new([(FileId(0), beside)]);
    for (line, ways) in [(6, None), (7, None), (8, Some("Z100 / X30 / Z20 / X40 Y7")), (9, Some("Z100 / X30 / X40 Y7 / Z5")), (12, Some("Z100 / X40 Y7 / Z20 / G1 Z-1"))] {
        match (from_line::from_line(&run(beside), FileId(0), line, &o, &texts), ways) {
            (Ok(restart), Some(ways)) => {
                let written = emit(&restart.program, &options(Language::Linuxcnc), &texts).expect("written").text;
                let moves = written.lines().skip_while(|l| !l.starts_with("G0")).filter(|l| l.contains(['X', 'Y', 'Z']));
                let found = moves.map(|l| l.trim_start_matches("G0 ")).collect::<Vec<_>>().join(" / ");
                assert!(found.starts_with(ways), "{line}: {found}");
            }
            (Err(told), None) => assert!(told[0].message.contains(" in Y,"), "{line}: {}", told[0].message),
            (other, _) => panic!("{line}: {other:?}"),
        }
    }
}

/// On a lathe the tool comes from outside, in a bore from the front, and goes in by feed.
#[test]
fn a_restart_on_a_lathe_comes_from_outside() {
    let head = "G21 G90 G18 G8 G95\nT1 M6\nM3 S500\n";
    let groove = format!("{head}G0 X40 Z5\nG0 X32 Z-20\nG1 X25 F.08\nG4 P.5\nG0 X32\nX40 Z5\nM5\nM2\n");
    let bore = format!("{head}G0 X8 Z5\nG1 X10 F.1\nG1 Z-20\nG4 P.5\nX11\nG0 X8\nZ5\nM5\nM2\n");
    let ways = |text: &str, line: u32| {
        let texts = Texts::new([(FileId(0), text)]);
        let o = from_line::Options { safe_z: Some(5.0), ..from_line::Options::default() };
        let restart = from_line::from_line(&run(text), FileId(0), line, &o, &texts).expect("a start");
        let mut out = Vec::new();
        let mut cursor = restart.program.cursor();
        while let Some(view) = cursor.next() {
            if view.op.moves() && view.source.line == from_line::INSERTED {
                out.push((view.op == gr_ir::Op::Rapid, view.end.axes[0], view.end.axes[2]));
            }
        }
        out
    };
    let found = ways(&groove, 7);
    assert_eq!(found.iter().skip(1).copied().collect::<Vec<_>>(), [(true, 40.0, -20.0), (true, 32.0, -20.0), (false, 25.0, -20.0)], "{found:?}");
    let found = ways(&bore, 7);
    assert_eq!(found.iter().skip(1).copied().collect::<Vec<_>>(), [(true, 8.0, 5.0), (true, 8.0, -20.0), (false, 10.0, -20.0)], "{found:?}");
}

/// The safe height is that of the tool, also where its length is not in force yet.
#[test]
fn a_safe_height_is_that_of_the_tool() {
    let text = "G21 G90\nT1 M6\nG0 X10 Y10\nG43.1 Z150\nG0 Z50\nG1 Z-1 F100\nM2\n";
    let texts = Texts::new([(FileId(0), text)]);
    let o = from_line::Options { safe_z: Some(100.0), ..from_line::Options::default() };
    let restart = from_line::from_line(&run(text), FileId(0), 3, &o, &texts).expect("a start");
    let first = restart.program.steps().find(|s| s.op.moves()).expect("a move");
    assert_eq!(first.end.axes[2], 250.0);
}

/// G28 without a way-point has no way-point in any language, whatever the simulation takes for its place.
#[test]
fn a_reference_move_without_a_way_point_has_none() {
    for (line, written) in [("G28 G91 Z0\nG90", "G91 G28 Z0\nG90\n"), ("G28 X5 Z0", "G28 X5 Z0\n"), ("G91\nG28 X0 Y0\nG90", "G91 G28 X0 Y0\nG90\n")] {
        let text = format!("G21 G90\n{line}\nG0 X10 Y10\nZ5\nM2\n");
        let texts = Texts::new([(FileId(0), text.as_str())]);
        let emitted = emit(&run(&text), &options(Language::Linuxcnc), &texts).expect("written").text;
        assert!(emitted.contains(written), "{line}: {emitted}");
    }
}

/// Behind a G33 the tool stands in its thread: no other move brings it there. Behind the way out it does not.
#[test]
fn no_start_in_a_thread() {
    let text = "G21 G90\nM3 S100\nG0 X0 Y10 Z5\nG33 Z-25 K1\nG4 P1\nG33 Z5 K1\nG0 X9\nG1 Z-1 F100\nM2\n";
    let texts = Texts::new([(FileId(0), text)]);
    let o = from_line::Options { safe_z: Some(25.0), ..from_line::Options::default() };
    let found = from_line::from_line(&run(text), FileId(0), 5, &o, &texts).map(|_| ()).expect_err("no start");
    assert_eq!(found[0].code.def().slug, "from-line/inside-cycle");
    assert!(from_line::from_line(&run(text), FileId(0), 8, &o, &texts).is_ok());
    assert!(from_line::from_line(&run(text), FileId(0), 4, &o, &texts).is_ok());
}

/// A line of a loop that moves nothing begins where the loop goes on, not behind it.
#[test]
fn a_restart_in_a_loop_stays_in_it() {
    let text = "G21 G90 F100\n#1=0\nG0 X0 Y0 Z5\no1 while [#1 lt 3]\n#1=[#1+1]\nG1 X#1\no1 endwhile\nG0 X9\nM2\n";
    let texts = Texts::new([(FileId(0), text)]);
    let o = from_line::Options { safe_z: Some(5.0), ..from_line::Options::default() };
    let restart = from_line::from_line(&run(text), FileId(0), 5, &o, &texts).expect("a start");
    let ends: Vec<f64> = restart.program.steps().filter(|s| s.op == gr_ir::Op::Linear).map(|s| s.end.axes[0]).collect();
    assert_eq!(ends, [1.0, 2.0, 3.0]);
    assert_eq!(restart.notes.iter().map(|d| d.code.def().slug).collect::<Vec<_>>(), ["from-line/inside-loop"]);
}

/// What the machine does of itself before a tool change is a place of the machine, in the program and for a restart.
#[test]
fn moves_before_a_tool_change_are_the_machines() {
    let text = "G21 G90\nT1 M6\nG0 X20 Y0 Z5\nT2 M6\nG0 X5 Y5\nZ3\nM2\n";
    let ini = gr_interp::read_ini("[EMCIO]\nTOOL_CHANGE_QUILL_UP=1\n", FileId(1), None, None).0;
    let setup = gr_interp::Setup { ini, tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    let program = reader::read(text, &setup).expect("it runs");
    let texts = Texts::new([(FileId(0), text)]);
    let written = emit(&program, &options(Language::Linuxcnc), &texts).expect("written").text;
    assert!(written.contains("G53 G0 Z0"), "{written}");
    let o = from_line::Options { safe_z: Some(50.0), ..from_line::Options::default() };
    let restart = from_line::from_line(&program, FileId(0), 5, &o, &texts).expect("a start");
    let lowest = restart.program.steps().filter(|s| s.op.moves()).map(|s| s.end.axes[2]).fold(f64::INFINITY, f64::min);
    assert_eq!(lowest, 3.0);
}

/// grbl: an axis that it lacks has no word, and its reference move is none of the others'.
#[test]
fn grbl_has_no_words_for_other_axes() {
    let text = "G21 G90\nG0 X5 Z7 A0\nG0 X1\nM2\n";
    let texts = Texts::new([(FileId(0), text)]);
    let written = emit(&run(text), &options(Language::Grbl), &texts).expect("written").text;
    assert!(!written.contains('A'), "{written}");
    assert!(!errors("G21 G90\nG0 X5\nG28 A0\nG0 X1\nM2\n", Language::Grbl).is_empty());
}

/// A cycle whose moves are of a line of their own: nothing of ours writes one, but a motion file may.
#[test]
fn no_start_inside_a_cycle() {
    let text = "motion 1\nfile 0 \"a.ngc\"\nunits mm @0:1\nreset @0:1\nfeed 2 angular=1 @0:1\nrapid x=1 y=1 z=5 @0:2\nbegin cycle code=810 \"\" @0:3\nrapid z=1 @0:4\nlinear z=-3 @0:4\nclose cycle @0:3\nend @0:6\n";
    let program = gr_ir::text::parse(text).expect("motion");
    let texts = Texts::new([(FileId(0), "G21\n\n\n\n\nM2\n")]);
    let o = from_line::Options { safe_z: Some(25.0), ..from_line::Options::default() };
    let found = from_line::from_line(&program, FileId(0), 4, &o, &texts).map(|_| ()).expect_err("no start");
    assert_eq!(found[0].code.def().slug, "from-line/inside-cycle");
}

#[test]
fn a_restart_keeps_a_length_that_no_table_knows() {
    for asked in ["G43 H3", "G43"] {
        let text = format!("G21 G90 G17\nT3 M6\n{asked}\nS1000 M3\nF100\nG0 X0 Y0 Z5\nG1 Z-1\nG1 X10\nM5\nM2\n");
        let texts = Texts::new([(FileId(0), text.as_str())]);
        let restart = from_line::from_line(&run(&text), FileId(0), 8, &from_line::Options::default(), &texts).expect("a start");
        let o = Options { tools: Vec::new(), ..options(Language::Linuxcnc) };
        let written = emit(&restart.program, &o, &texts).expect("written").text;
        assert!(written.contains(&format!("{asked}\n")) && !written.contains("G49"), "{written}");
    }
}

#[test]
fn rows_of_the_registry() {
    let mut tried = 0;
    for row in gr_spec::Code::all().map(gr_spec::Code::def) {
        if row.options != Some("build --target rs274ngc --to grbl") {
            continue;
        }
        let found = |text: &str| -> Vec<&'static str> {
            let program = run(text);
            let out = emit(&program, &options(Language::Grbl), &Texts::new([(FileId(0), text)]));
            let found = match out {
                Ok(e) => e.notes,
                Err(e) => e,
            };
            found.iter().map(|d| d.code.def().code).collect()
        };
        assert_eq!(found(row.bad.expect("an example")), [row.code]);
        assert!(found(row.good.expect("an example")).is_empty(), "{}", row.code);
        tried += 1;
    }
    assert_eq!(tried, 2);
}

#[test]
fn an_unmeasured_tool_keeps_its_offset_word() {
    let written = write("G21 G90\nT3 M6\nG43 H3\nG0 Z5\nG49\nM2\n", &options(Language::Linuxcnc));
    assert!(written.contains("G43 H3\n") && written.contains("G49\n"), "{written}");
}

#[test]
fn after_a_probe_only_named_axes_are_written() {
    let text = "G21 G90 F100\nG0 X0 Y0 Z10\nG38.2 Z-10\nG0 X5\nG0 Z20\nM2\n";
    let written = write(text, &options(Language::Linuxcnc));
    assert!(written.contains("G38.2 Z-10 F100\nG0 X5\nZ20\n"), "{written}");
}

/// On a Fanuc control G43 and G49 without a Z move the axis by the length, and G52 and G92 are two shifts that add up.
#[test]
fn lengths_and_shifts_of_a_fanuc_control() {
    let text = "G21 G90\nT1 M6\nG49\nG0 X1 Y1\nG43 H1\nX2\nZ50\nG1 Z1 F100\nG0 Z40\nG49\nG91 G28 Z0\nG90\nT2 M6\nG43 H2 Z50\nG92 X7\nG1 Z2\nG92.1\nG0 Z50\nX3\nG49\nG53 G0 Z0\nM30\n";
    let written = write(text, &options(Language::FanucMill));
    for part in ["G49\nG0 X1. Y1.\nG0 X2.\nG43 Z50. H1\nG1 Z1. F100.", "G0 Z40.\nG91 G28 Z0.\nG90\n", "M6\nG43 G0 Z50. H2\nG92 X7.\nG1 Z2.\nG92 X2.\nG0 Z50.\nX3.\nG49 G53 G0 Z0.\nM30"] {
        assert!(written.contains(part), "{part}\n---\n{written}");
    }
    same(text, &options(Language::FanucMill), 1e-3);
    let text = "G21 G90 F100\nT1 M6\nG43 H1 G0 Z50\nG1 Z1\nG0 Z40\nG49\nM30\n";
    let notes = emit(&run(text), &options(Language::FanucMill), &Texts::new([(FileId(0), text)])).expect("written").notes;
    assert_eq!(notes.iter().map(|d| d.code.def().slug).collect::<Vec<_>>(), ["emit/dropped-note"]);
    let shifted = errors("G21 G90 F100\nT1 M6\nG0 Z9\nG43 H1\nG92 Z10\nG0 Z50\nM30\n", Language::FanucMill);
    assert_eq!(shifted, [("emit/not-expressible", "G92 Z10".to_string())]);
    assert_eq!(errors("G21 G90 F100\nT1 M6\nG43 H1\nG2 X2 I1 Z-1\nM30\n", Language::FanucMill)[0].0, "emit/not-expressible");
}

/// G96 wants its S in its block, whatever feed stands there.
#[test]
fn surface_speed_and_feed_in_one_block() {
    for feed in ["G95 F.2", "G94 F100", "F100", "G93 F2"] {
        let text = format!("G21 G18 G90 F50\nG0 X50 Z2\nG96 D2500 S180 M3 {feed}\nG1 Z-5 F3\nG94 G97 S500 F90\nG1 Z-7\nM5\nM30\n");
        same(&text, &options(Language::Linuxcnc), 1e-3);
        assert!(write(&text, &options(Language::Linuxcnc)).contains("G96 D2500 S180\n"));
    }
}

/// A speed in the block of a move stays there for grbl: a laser under M3 would stop at a block without motion, and burn.
#[test]
fn grbl_has_speeds_in_the_block_of_a_move() {
    let text = "G21 G90\nM3 S0\nG0 X5 Y5\nG1 F3000\nX5.1 S200\nX5.2 S190\nX5.3 S0 F2000\nG0 X9 S7\nS50\nG2 X11 I1 S60 F100\nG1 X11 S9\nM5\nM2\n";
    same(text, &options(Language::Grbl), 1e-3);
    let written = write(text, &options(Language::Grbl));
    let lines: Vec<&str> = written.lines().skip_while(|l| *l != "M3").collect();
    assert_eq!(lines, ["M3", "G0 X5 Y5", "G1 X5.1 F3000 S200", "X5.2 S190", "X5.3 F2000 S0", "G0 X9 S7", "S50", "G2 X11 Y5 I1 J0 F100 S60", "S9", "G1 X11", "M5", "M2"]);
}

/// Steps from where a probe stopped are steps, and what the place is called is what the source says, whatever the simulation
/// takes it for: the probe touches twice, and the height counts from a variable thickness, here and in another work offset.
#[test]
fn a_probe_stops_where_the_machine_knows() {
    let text = "G21 G90 F100\n#<t>=1.5\nG0 X0 Y0 Z10\nG38.2 Z-10\nG91 G0 Z1\nG38.2 Z-2 F10\nG90\nG10 L20 P1 Z[#<t>+1]\nG10 L20 P2 Z#<t>\n\
                G0 Z5\nG38.2 X20\nG38.3 Y9\nG92 X[-#<t>] Y0\nG91 G1 X2 Z-1\nG38.3 Z-4\nG90 G1 X3 Z2 F100\nM2\n";
    let written = write(text, &options(Language::Linuxcnc));
    let expected = "G38.2 Z-10 F100\nG91 G0 Z1\nG90\nG91 G38.2 Z-2 F10\nG90\nG10 L20 P1 Z2.5\nG10 L20 P2 Z1.5\nG0 Z5\nG38.2 X20\nG38.3 Y9\n\
                    G92 X-1.5 Y0\nG1 X0.5 Z4\nG38.3 Z0\nG1 X3 Z2 F100\nM2\n";
    assert!(written.ends_with(expected), "{written}");
    for language in [Language::Linuxcnc, Language::Grbl] {
        same(&text.replace("#<t>=1.5\n", "").replace("[#<t>+1]", "2.5").replace("[-#<t>]", "-1.5").replace("#<t>", "1.5"), &options(language), 1e-3);
    }
}

#[test]
fn home_after_a_change_of_units_under_a_tool_offset() {
    let text = "G21\nG43.1 Z12\nG0 Z100\nG20\nG0 X1\nG28\nM2\n";
    let o = options(Language::Linuxcnc);
    same(text, &o, unit(&o));
    let written = write(text, &o);
    assert!(written.contains("G53 G0 X0 Y0 Z") && !written.contains("G28"), "{written}");
    for end in ["G28 Z4", "G30 X1 Z2", "G49\nG28 Z1", "G28 X1\nG28 Z2", "G21\nG28"] {
        same(&text.replace("G28", end), &o, unit(&o));
    }
    // The control's own reference stays its own where nothing is in doubt.
    assert!(write("G21\nG0 Z100\nG20\nG43.1 Z1\nG28 Z4\nM2\n", &o).contains("G28 Z"));
}

mod oracle {
    use super::*;
    use gr_tests::oracle::{Job, reference};

    fn canon(text: &str) -> Option<Vec<String>> {
        // rs274 is an inch machine.
        let inch = |mm: f64| mm / 25.4;
        let row = |n: i32, z: f64| format!("T{n} P{n} Z{:.12} D{:.12}\n", inch(z), inch(6.0));
        let tools = row(1, 50.0) + &row(2, 62.5) + &row(3, 0.0);
        let out = Job { tools: Some(tools), ..Job::new(text) }.reference(&reference()?);
        assert!(out.ok(), "{}\n{text}", out.ended.errors());
        let moves = ["STRAIGHT_", "ARC_FEED", "NURBS", "RIGID_TAP", "DWELL"];
        let call = |l: &str| l.splitn(3, ' ').nth(2).unwrap_or("").trim().replace("-0.0000", "0.0000");
        let calls = out.canon.lines().map(|l| call(l.trim_start()));
        Some(calls.filter(|c| moves.iter().any(|m| c.starts_with(m))).collect())
    }

    #[test]
    fn rs274_moves_the_same() {
        let o = Options { decimals: Some(9), ..options(Language::Linuxcnc) };
        for text in [PLAIN, STRUCTURED, COMPENSATED, TOOLS, OFFSETS, STORED] {
            let written = write(text, &o);
            let (Some(a), Some(b)) = (canon(text), canon(&written)) else {
                return;
            };
            assert_eq!(a, b, "{text}\n--- written\n{written}");
        }
        // What rs274 takes without a word of complaint.
        for text in [ODD, EVENTS] {
            canon(&write(text, &options(Language::Linuxcnc)));
        }
    }
}

/// What the programs of the corpus have that can't be written: all of it.
const REFUSED: &[&str] = &[];

/// Every program of the corpus, or of the folder `GCC_ROBOT_CORPUS`, that our interpreter takes without further files.
#[test]
fn corpus() {
    let own = std::env::var_os("GCC_ROBOT_CORPUS").is_none();
    let folder = std::env::var_os("GCC_ROBOT_CORPUS").map(std::path::PathBuf::from);
    let mut folders = vec![folder.unwrap_or_else(|| gr_tests::oracle::root().join("tests/corpus/accepted"))];
    let (mut tried, mut bad) = (0, 0);
    let mut refused = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            if path.extension().is_none_or(|e| e != "ngc") {
                continue;
            }
            let Ok(text) = std::fs::read_to_string(&path) else {
                continue;
            };
            let Ok(program) = run_as(&text, "linuxcnc") else {
                continue;
            };
            let o = Options { decimals: Some(8), ..options(Language::Linuxcnc) };
            tried += 1;
            let written = match emit(&program, &o, &Texts::new([(FileId(0), text.as_str())])) {
                Ok(e) => e.text,
                Err(e) => {
                    println!("{}: {:?} {}", path.display(), e[0].code, e[0].message);
                    refused.push(path.file_stem().unwrap_or_default().to_string_lossy().into_owned());
                    continue;
                }
            };
            let tolerance = Tolerance { length: 1e-6, angle: 1e-6, rate: 1e-3, limit: 3, ..Tolerance::default() };
            match run_as(&written, "linuxcnc") {
                Ok(again) => {
                    let found = diff(&program, &again, &tolerance);
                    if !found.is_empty() {
                        bad += 1;
                        let all: Vec<_> = found.differences.iter().map(|d| (&d.message, d.a, d.b)).collect();
                        println!("{}: {all:?}", path.display());
                    }
                }
                Err(e) => {
                    bad += 1;
                    println!("{}: {}", path.display(), &e[..e.len().min(300)]);
                }
            }
        }
    }
    println!("{tried} programs, {bad} differ");
    assert_eq!(bad, 0);
    if own {
        refused.sort();
        assert_eq!(refused, REFUSED);
        assert!(tried > 40, "{tried} programs");
    }
}

mod property {
    use super::*;
    use proptest::prelude::*;

    fn block() -> impl Strategy<Value = String> {
        let n = || (-50_000i32..50_000).prop_map(|v| format!("{}", f64::from(v) / 997.0));
        prop_oneof![
            4 => (n(), n(), n()).prop_map(|(x, y, z)| format!("G1 X{x} Y{y} Z{z}")),
            2 => n().prop_map(|x| format!("G0 X{x}")),
            1 => n().prop_map(|x| format!("G1 Z{x} F{}", 100.0)),
            2 => (1i32..5000, any::<bool>(), n()).prop_map(|(r, cw, z)| {
                let r = f64::from(r) / 83.0;
                format!("G91 G{} X{r} Y{r} Z{z} I{r} J0\nG90", if cw { 2 } else { 3 })
            }),
            1 => (1i32..5000, any::<bool>(), 1..4).prop_map(|(r, cw, p)| {
                format!("G{} I{} J{} P{p}", if cw { 2 } else { 3 }, f64::from(r) / 83.0, f64::from(r) / 31.0)
            }),
            // Offsets as tables have them: to three decimals.
            1 => (-4000i32..4000, -4000i32..4000).prop_map(|(x, y)| format!("G10 L2 P2 X{} Y{}\nG55", f64::from(x) / 8.0, f64::from(y) / 8.0)),
            1 => (n(), n()).prop_map(|(x, y)| format!("G92 X{x} Y{y}")),
            1 => (1i32..3000).prop_map(|r| {
                let r = f64::from(r) / 83.0;
                format!("G18 G91 G2 X{r} Z{r} I{r} K0\nG17 G90")
            }),
            1 => Just("G54".to_string()),
            // With a changed unit these leave the control in error about its place until the next absolute move:
            // an arc from there is no arc.
            1 => n().prop_map(|z| format!("G43.1 Z{z}\nG0 X1 Y2 Z3")),
            1 => Just("G49\nG0 X1 Y2 Z3".to_string()),
            1 => Just("G20\nG0 X1 Y2 Z3".to_string()),
            1 => Just("G21\nG0 X1 Y2 Z3".to_string()),
            1 => Just("G28".to_string()),
            1 => n().prop_map(|z| format!("G28 Z{z}")),
            1 => (n(), n()).prop_map(|(x, y)| format!("G30 X{x} Y{y}")),
        ]
    }

    proptest! {
        #[test]
        fn written_programs_move_the_same(
            blocks in prop::collection::vec(block(), 1..25),
            inch in any::<bool>(),
            decimals in 3usize..10,
            arcs in prop_oneof![Just(Arcs::Ijk), Just(Arcs::IjkAbsolute), Just(Arcs::R)],
            repeat in any::<bool>(),
        ) {
            let text = format!("G21 G90 G17 F100\n{}\nM2\n", blocks.join("\n"));
            let units = if inch { Units::Inch } else { Units::Mm };
            let o = Options { units, decimals: Some(decimals), arcs, repeat_words: repeat, ..options(Language::Linuxcnc) };
            same(&text, &o, unit(&o));
        }
    }
}

/// A height that is named again behind a tool change is written again: lengths that are equal in the table need not be so at
/// the machine. H stays the source's, also where another tool has the same length.
#[test]
fn heights_are_said_again_behind_a_tool_length() {
    let text = "G21 G90 F100\nT1 M6\nG43 H1\nG0 X0 Y0 Z25\nT2 M6\nG43 H1\nG0 Z25\nG0 X5\nM2\n";
    let written = write(text, &options(Language::Linuxcnc));
    assert_eq!((written.matches("Z25").count(), written.matches("G43 H1").count()), (2, 2), "{written}");
    let zero = "G21 G90\nG52 X0 Y0\nG0 X1\nM2\n";
    assert!(write(zero, &options(Language::Linuxcnc)).contains("G52 X0 Y0"));
}

/// G92 behind another work offset names the place that was written, rounding included.
#[test]
fn g92_behind_another_work_offset_counts_from_the_written_place() {
    let text = "G21 G90 F100\nG1 X5.1594784 Y1 Z1\nG10 L2 P2 X0 Y0\nG55\nG92 X-18.3029\nG1 X0\nM2\n";
    let written = write(text, &Options { decimals: Some(3), ..options(Language::Linuxcnc) });
    assert!(written.contains("G92 X-18.3033784"), "{written}");
}

/// Cycles follow the exact path; what the machine followed before is its own affair and comes back.
#[test]
fn cycles_leave_the_path_mode_of_the_machine() {
    let text = |mode: &str| format!("G21 G90 {mode}\nG0 X0 Y0 Z5\nG81 X1 Y1 Z-3 R1 F100\nX5\nG80\nG1 Z-1 F100\nX20\nM2\n");
    insta::assert_snapshot!("path_mode_unsaid", write(&text(""), &options(Language::Linuxcnc)));
    let said = write(&text("G64 P0.01"), &options(Language::Linuxcnc));
    assert!(said.contains("G64 P0.01") && !said.contains("M70"), "{said}");
}

/// Canned cycles that are folded again make the same motion; one that would not stays spelled out.
#[test]
fn holes_as_cycles() {
    let cycles = Options { cycles: true, ..options(Language::Linuxcnc) };
    let inch = Options { units: Units::Inch, decimals: Some(6), ..cycles.clone() };
    let head = "G21 G90 G17 G94 F100 S800 M3\nG0 X0 Y0 Z20\n";
    for level in ["G98", "G99"] {
        for (cycle, kept) in [
            ("G81 Z-5 R2", "G81 Z-5 R2"),
            ("G82 Z-5 R2 P0.5", "G82 Z-5 R2 P0.5"),
            ("G83 Z-7.3 R2 Q2.5", "G83 Z-7.3 R2 Q2.5"),
            ("G83 Z-8 R2 Q2.5", "G83 Z-8 R2 Q2.5"),
            ("G73 Z-7.3 R2 Q2.5", "G73 Z-7.3 R2 Q2.5"),
            ("G84 Z-5 R2 P0.25", "G84 Z-5 R2 P0.25"),
            ("G85 Z-5 R2", "G85 Z-5 R2"),
            ("G86 Z-5 R2 P0.5", "G86 Z-5 R2 P0.5"),
            ("G89 Z-5 R2 P0.5", "G89 Z-5 R2 P0.5"),
        ] {
            let text = format!("{head}{level} {cycle} X10 Y5\nX20\nG80\nG0 Z20\nM5\nM2\n");
            same(&text, &cycles, 1e-6);
            same(&text, &inch, 1e-4);
            let written = write(&text, &cycles);
            // With G98 LinuxCNC taps up to the height it came from: no plan does that.
            let folds = !(level == "G98" && cycle.starts_with("G84"));
            assert_eq!(written.contains(&format!("{level} {kept}")), folds, "{level} {cycle}\n{written}");
        }
    }
    // A control that takes 0.1 off again and again makes one peck more, of nothing: whatever is written does that too.
    same(&format!("{head}G99 G83 X1 Z-8 R2.3 Q0.1\nG80\nM2\n"), &cycles, 1e-6);
    let other = Options { pecks: false, ..cycles };
    let written = write(&format!("{head}G99 G83 X1 Z-7.3 R2 Q2.5\nG80\nM2\n"), &other);
    assert!(!written.contains("G83"), "{written}");
}

/// Lengths of a machine without a tool table are not known: what the program asks for stays.
#[test]
fn tool_lengths_without_a_table() {
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 Z5\nG1 X1 F100\nG49\nM2\n";
    let written = write(text, &options(Language::Linuxcnc));
    assert!(written.contains("G43 H1") && written.contains("G49"), "{written}");
}

/// On a Fanuc control G53 is a rapid, whatever stands beside it: a feed move there is refused, or written where the work offsets are
/// known. What a Fanuc program says is written as the rapid it is.
#[test]
fn feeds_to_places_of_the_machine_become_no_rapids() {
    let text = "G21 G90 G17 G40 G49\nG0 X0 Y0 Z5\nG53 G1 Z-20 F100\nG0 Z5\nM2\n";
    let refused = errors(text, Language::FanucMill);
    assert_eq!(refused, [("emit/not-expressible", "G53 G1 Z-20 F100".to_string())]);
    let known = Options { stored_known: true, ..options(Language::FanucMill) };
    let written = write(text, &known);
    assert!(written.contains("G1 Z-20. F100.") && !written.contains("G53"), "{written}");
    let fanuc = run_as("G21 G90\nG0 X0. Y0. Z5.\nG1 X50. F100.\nG53 Z-7.\nX60.\nM30\n", "fanuc-mill").expect("it runs");
    let moves: Vec<_> = fanuc.steps().filter(|s| s.op.moves()).map(|s| s.op == gr_ir::Op::Rapid).collect();
    assert_eq!(moves, [true, false, true, false]);
}
