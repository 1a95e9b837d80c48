//! Machinist's lints: no false alarms on ordinary programs, and the finer points of single rules.

#[allow(dead_code, unused_imports, reason = "shared with the test crate")]
#[path = "../../../tests/src/generate.rs"]
mod generate;

use gr_driver::{Options, Session};
use gr_interp::Setup;

fn found(text: &str) -> Vec<String> {
    let mut session = Session::new();
    let file = session.open("part.ngc", text, Options::new(Setup::default()));
    let line = |at: u32| text[..at as usize].matches('\n').count() + 1;
    session.check(file).diagnostics.iter().map(|d| format!("{}: {}", line(d.primary().1.start), d.code.def().slug)).collect()
}

#[test]
fn generated_programs_are_clean() {
    assert_eq!(found(&generate::big(20_000)), Vec::<String>::new());
    assert_eq!(found(&generate::mixed(20_000)), Vec::<String>::new());
}

#[test]
fn a_program_without_spindle_is_left_alone() {
    assert_eq!(found("G21 F100\nG1 X10\nM2\n"), Vec::<String>::new());
    // … unless it is started further down.
    assert_eq!(found("G21 F100\nG1 X10\nM3 S100\nG1 X20\nM5\nM2\n"), ["2: spindle/stopped"]);
}

#[test]
fn a_stopped_spindle_is_told_once_until_it_starts() {
    let text = "G21 F100\nM3 S100\nG1 X1\nM5\nG1 X2\nG1 X3\nM3\nG1 X4\nM5\nG1 X5\nG0 Z5\nM2\n";
    assert_eq!(found(text), ["5: spindle/stopped", "10: spindle/stopped"]);
}

#[test]
fn retracting_with_a_stopped_spindle_is_fine() {
    assert_eq!(found("G21 F100\nM3 S100\nG1 X1\nM5\nG1 Z5\nM2\n"), Vec::<String>::new());
}

#[test]
fn pecking_and_clearing_passes_are_no_dives() {
    let drill = "G21 F100\nM3 S100\nG0 X5 Y5 Z5\nG83 X5 Y5 Z-10 R2 Q2\nX10\nG80\nG0 Z5\nM5\nM2\n";
    assert_eq!(found(drill), Vec::<String>::new());
    // A second pass that begins where the first began.
    let passes = "G21 F100\nM3 S100\nG0 X0 Y0 Z5\nG0 Z-2\nG1 X20\nY20\nX0\nY0\nG0 Z5\nG0 Z-4\nG1 X20\nY20\nG0 Z5\nM5\nM2\n";
    assert_eq!(found(passes), Vec::<String>::new());
}

#[test]
fn a_dive_in_another_work_frame_compares_with_nothing() {
    let text = "G21 F100\nM3 S100\nG1 Z-1\nX20\nY20\nG0 Z5\nG55\nG0 X10 Y10\nG0 Z-3\nG0 Z5\nM5\nM2\n";
    let same = text.replace("G55\n", "");
    assert_eq!(found(text).iter().filter(|f| f.contains("rapid")).count(), 1, "both frames are at the same place");
    assert_eq!(found(&same), ["8: rapid/into-stock"]);
}

/// What was cut before the part turned lies on another side.
#[test]
fn a_dive_beside_another_side_of_the_part_is_none() {
    let text = "G21 F100\nM3 S100\nG1 Z-3\nX20\nY20\nG0 Z50\nG0 A-90\nG0 X0 Y90 Z-20\nG0 Y42\nG1 Y30\nG0 Y60\nG0 X10 Z-35\nG0 Y90\nM5\nM2\n";
    assert_eq!(found(&text.replace("G0 A-90\n", "")).len(), 2);
    assert_eq!(found(&text.replace("A-90", "C-90")), ["12: rapid/into-stock"]);
    // Beside a tilted tool Z is not the depth.
    assert_eq!(found(text), Vec::<String>::new());
}

#[test]
fn spindle_on_at_m2_is_a_hint_and_m5_on_the_same_line_counts() {
    assert_eq!(found("G21\nM3 S100\nG0 X1\nM2\n"), ["4: end/spindle-on"]);
    assert_eq!(found("G21\nM3 S100\nG0 X1\nM5 M2\n"), Vec::<String>::new());
}

#[test]
fn errors_have_a_trace_and_loops_tell_once() {
    let text = "G21 F100\no1 sub\nG2 X[#1] Y0 I1\no1 endsub\no2 repeat [3]\no1 call [7]\no2 endrepeat\nM2\n";
    let mut session = Session::new();
    let file = session.open("part.ngc", text, Options::new(Setup::default()));
    let check = session.check(file);
    let d = &check.diagnostics[0];
    assert_eq!(d.code.def().slug, "arc/radius-mismatch");
    assert!(!d.trace.is_empty(), "{d:#?}");
    assert!(d.labels.len() > 1, "{d:#?}");
}

/// Rows whose finding can be mended by an edit: each edit takes the finding away.
#[test]
fn fixes_mend_what_they_are_offered_for() {
    let mut mended = Vec::new();
    for code in gr_spec::Code::all() {
        let def = code.def();
        let (Some(bad), Some(dialect)) = (def.bad, gr_spec::Dialect::find(def.dialect.unwrap_or("linuxcnc"))) else { continue };
        let check = |text: &str| {
            let mut session = Session::new();
            let mut options = Options::new(Setup { dialect, ..Setup::default() });
            options.rules.set(code, gr_driver::Level::Warning);
            let file = session.open("part.ngc", text, options);
            session.check(file).diagnostics
        };
        let of = |found: &[gr_text::Diagnostic]| found.iter().filter(|d| d.code == code).count();
        let found = check(bad);
        for fix in found.iter().filter(|d| d.code == code).flat_map(|d| &d.fixes) {
            let mut new = bad.to_string();
            for (_, span, with) in fix.edits.iter().rev() {
                new.replace_range(span.start as usize..span.end as usize, with);
            }
            assert!(of(&check(&new)) < of(&found), "{} `{}`:\n{new}", def.code, fix.title);
            mended.push(format!("{} {}", def.code, fix.title));
        }
    }
    mended.dedup();
    insta::assert_snapshot!(mended.join("\n"));
}

/// What is written at once behind a keyword is taken away; anything else gets a line of its own.
#[test]
fn what_follows_a_keyword() {
    let mended = |block: &str| {
        let text = format!("G21 G90\no<x> sub\nG0 X1\no<x> endsub\n{block}\nM2\n");
        let mut session = Session::new();
        let file = session.open("part.ngc", &text, Options::new(Setup::default()));
        let found = session.check(file).diagnostics;
        let fix = &found.iter().find(|d| d.code == gr_text::code::OWORD_TRAILING_TEXT).unwrap_or_else(|| panic!("{found:?}")).fixes[0];
        let (_, span, new) = &fix.edits[0];
        format!("{}{new}{}", &text[..span.start as usize], &text[span.end as usize..]).lines().nth(4).map(|l| format!("{l}: {}", fix.title))
    };
    assert_eq!(mended("O<x> callsub").as_deref(), Some("O<x> call: remove `sub`"));
    assert_eq!(mended("o<x> callsub [1]").as_deref(), Some("o<x> call [1]: remove `sub`"));
    assert_eq!(mended("o<x> call G0 X2").as_deref(), Some("o<x> call : put the rest on its own line"));
}

/// A subroutine is missing at its call, wherever the search for it ends.
#[test]
fn a_missing_subroutine_is_told_at_its_call() {
    for (text, call) in [("%\nG21 G90\no<no> call [1]\nG0 X1\nM2\n%\n", 2), ("%\nG21\nM98 P77\nM2\n%\n", 2), ("G21\nM98 P77\nM2\n", 1), ("%\no<a> sub\no<no> call\no<a> endsub\nG21\no<a> call\nM2\n%\n", 2)] {
        let mut session = Session::new();
        let file = session.open("part.ngc", text, Options::new(Setup::default()));
        let found = session.check(file).diagnostics;
        let d = found.iter().find(|d| d.code == gr_text::code::SUB_NOT_FOUND).unwrap_or_else(|| panic!("{found:?}"));
        assert_eq!(text[..d.primary().1.start as usize].matches('\n').count(), call, "{text}: {d:?}");
    }
}

#[test]
fn a_file_that_is_named_after_its_subroutine_is_called_from_elsewhere() {
    let of = |name: &str, text: &str| {
        let mut session = Session::new();
        let file = session.open(name, text, Options::new(Setup::default()));
        session.check(file).diagnostics.iter().map(|d| d.code.def().slug).collect::<Vec<_>>()
    };
    let alone = "o<pocket> sub\nG21 G0 X1\no<pocket> endsub\n";
    assert_eq!(of("subs/pocket.ngc", alone), Vec::<&str>::new());
    assert_eq!(of("subs/pocket.ngc", &format!("{alone}M2\n")), Vec::<&str>::new());
    assert_eq!(of("subs/other.ngc", alone), ["program/end-missing"]);
    assert_eq!(of("subs/other.ngc", &format!("{alone}M2\n")), ["sub/unused"]);
    // What follows the subroutine is a program: it has to end, as on the control.
    assert_eq!(of("subs/pocket.ngc", &format!("{alone}G21 G0 X2\n")), ["program/ends-early"]);
    let numbered = "o1000 sub\nG21 G0 X1\no1000 endsub\nM2\n";
    assert_eq!(of("1000.ngc", numbered), Vec::<&str>::new());
}

/// How high machine zero is in the work frame, only the machine knows.
#[test]
fn a_retract_to_the_machine_is_no_dive() {
    let text = "G21 G43.1 Z150 F100\nM3 S100\nG0 X0 Y0 Z5\nG1 Z-12\nX20\nY20\nX10 Y10\nG53 G0 Z0\nM5\nM2\n";
    assert_eq!(found(text), Vec::<String>::new());
}

#[test]
fn a_cycle_from_a_place_of_the_machine_starts_as_high_as_only_the_machine_knows() {
    let holes = |before: &str| found(&format!("G21 G90 F100\nM3 S100\nG0 X1 Y1\n{before}\nG98 G81 X5 Y5 Z-5 R2\nX9\nG80\nM5\nM2\n"));
    for before in ["G53 G0 Z0", "G28", "G91 G28 Z0\nG90", "G53 G0 Z0\nG0 X5", "G53 G0 Z0\nG0 X1\nG2 X3 I1"] {
        assert_eq!(holes(before), Vec::<String>::new(), "{before}");
    }
    for before in ["G53 G0 Z0\nG0 Z0", "G53 G0 X0", "G91 G28 X0\nG90", "G28\nG1 X0 Y0 Z0"] {
        let line = 5 + before.matches('\n').count();
        assert_eq!(holes(before), [format!("{line}: cycle/starts-below-r")], "{before}");
    }
    // The next cycle starts where the first ended.
    let two = "G21 G90 F100\nM3 S100\nG53 G0 Z0\nG99 G81 X5 Y5 Z-5 R2\nG80\nG81 X9 Z-5 R4\nG80\nM5\nM2\n";
    assert_eq!(found(two), ["6: cycle/starts-below-r"]);
}

/// Each Fanuc program of a file has block numbers of its own.
#[test]
fn block_numbers_of_two_programs_are_no_duplicates() {
    let check = |text: &str| {
        let mut session = Session::new();
        let dialect = gr_spec::Dialect::find("fanuc-mill").expect("a dialect");
        let file = session.open("part.nc", text, Options::new(Setup { dialect, ..Setup::default() }));
        let found = session.check(file).diagnostics;
        found.iter().map(|d| format!("{} {}", d.code.def().code, d.message)).collect::<Vec<_>>()
    };
    let text = "O0001\nG21 G90 G17\nN10 #1=0\nN20 IF [#1 GE 3] GOTO 50\nM98 P2\n#1=#1+1\nGOTO 20\nN50 M30\nO0002\nN10 G0 X1.\nN20 M99\n";
    assert_eq!(check(text), Vec::<String>::new());
    let found = check(&text.replace("N20 M99", "N10 M99"));
    assert!(found.len() == 1 && found[0].starts_with("E0289"), "{found:?}");
    // In the control's words, without O-words that the program doesn't have.
    let found = check(&text.replace("GOTO 50", "GOTO 60"));
    assert!(found.iter().any(|m| m.contains(" N60: no block of this program has this number")), "{found:?}");
}

fn found_with(name: &str, text: &str, setup: Setup) -> Vec<String> {
    let mut session = Session::new();
    let file = session.open(name, text, Options::new(setup));
    let line = |at: u32| text[..at as usize].matches('\n').count() + 1;
    session.check(file).diagnostics.iter().map(|d| format!("{}: {} {}", line(d.primary().1.start), d.code.def().code, d.message)).collect()
}

#[test]
fn a_length_that_is_in_force_needs_no_g43() {
    let missing = |text: &str, setup: &Setup| -> Vec<usize> {
        let text = format!("G21 G90 F100\n{text}M5\nM2\n");
        let found = found_with("part.ngc", &text, setup.clone());
        found.iter().filter(|f| f.contains("E0281")).filter_map(|f| f.split(':').next()?.parse().ok()).collect()
    };
    let assumed = Setup { tools: gr_interp::assumed_tools(), ..Setup::default() };
    let cut = "S500 M3\nG0 X0 Y0 Z5\nG1 Z-1\nG0 Z5\n";
    let after = |before: &str| missing(&format!("{before}{cut}"), &assumed).len();
    // Of a table that is only assumed the number alone is known.
    assert_eq!(after("T1 M6\n"), 1);
    assert_eq!(after("G43 H1\nT1 M6\n"), 0);
    assert_eq!(after("G43 H2\nT1 M6\n"), 1);
    for length in ["G43 H1", "G43", "G43 H5", "G43.1 Z7"] {
        assert_eq!(after(&format!("T1 M6\n{length}\n{cut}T1 M6\n")), 0, "{length}: the same tool again");
        assert_eq!(after(&format!("T1 M6\n{length}\n{cut}T2 M6\n")), 1, "{length}: another");
    }
    assert_eq!(after(&format!("T1 M6\nG43 H1\n{cut}T2 M6\nT1 M6\n")), 0);
    assert_eq!(after(&format!("T1 M6\nG43 H1\n{cut}G49\nT1 M6\n")), 1);
    assert_eq!(after("G43 H1\nT0 M6\nG49\n"), 0);
    // A table tells lengths.
    let (tools, _) = gr_interp::read_tools("T1 P1 Z0 D6\nT2 P2 D1\nT3 P3 Z5\nT4 P4 Z5\n", gr_text::FileId(0));
    let known = Setup { tools, ..Setup::default() };
    assert_eq!(missing(&format!("T1 M6\n{cut}T2 M6\n{cut}T3 M6\n{cut}G43 H3\nT4 M6\n{cut}T2 M6\n{cut}"), &known), [15, 26]);
    // The tool in the spindle is named, not the one that is made ready.
    let found = found_with("part.ngc", &format!("G21 F100\nT1 M6\nT2\n{cut}M5\nM2\n"), assumed);
    assert!(found.len() == 1 && found[0].contains("length of tool 1 "), "{found:?}");
}

#[test]
fn a_unit_that_the_machine_starts_with_is_stated() {
    let found = |code: &str, own: bool| {
        let (ini, _) = gr_interp::read_ini(&format!("[RS274NGC]\nRS274NGC_STARTUP_CODE={code}\n"), gr_text::FileId(0), None, None);
        found_with("part.ngc", "G18\nG0 X1\nM2\n", Setup { ini, startup_code: own, ..Setup::default() }).len()
    };
    assert_eq!([found("G21 G90", true), found("G90 G20", true), found("G90", true), found("G21", false)], [0, 0, 1, 1]);
}

/// One mistake, one message: what stands in a block beside an error was meant.
#[test]
fn a_block_with_an_error_has_no_echo() {
    let found = |text: &str| found_with("part.ngc", text, Setup { tools: gr_interp::assumed_tools(), ..Setup::default() });
    for text in [
        "G21 G90 G999\nG0 X1\nM2\n",
        "G21 G90 X1..2\nG0 X1\nM2\n",
        "G21 F100\nS100 M3 G999\nG1 X1\nM3\nG1 X2\nM5\nM2\n",
        "G21 F100\nT1 M6\nG43 H1 G999\nS100 M3\nG1 X1\nM5\nM2\n",
    ] {
        let found = found(text);
        assert!(found.len() == 1 && !found[0].contains("E028"), "{text}{found:?}");
    }
    assert_eq!(found("G999 G90\nG0 X1\nM2\n").len(), 2);
}

#[test]
fn the_lead_of_a_thread_is_no_feed() {
    let found = |text: &str| {
        let dialect = gr_spec::Dialect::find("fanuc-turn").expect("a dialect");
        found_with("part.nc", text, Setup { dialect, tools: gr_interp::assumed_tools(), ..Setup::default() })
    };
    let thread = "O1\nG21 G40 G99 G18\nT0101\nG97 S500 M3\nG0 X30. Z10.\nG32 Z-30. F12.\nG0 X40.\nG1 X35. F0.2\nM5\nM30\n";
    assert_eq!(found(thread), Vec::<String>::new());
    let after = found(&thread.replace(" F0.2", ""));
    assert!(after.len() == 1 && after[0].starts_with("8: E0286"), "{after:?}");
}

#[test]
fn rotary_axes_have_limits() {
    let ini = "[TRAJ]\nLINEAR_UNITS=inch\n[AXIS_A]\nMIN_LIMIT=-90\nMAX_LIMIT=90\n[AXIS_U]\nMAX_LIMIT=1\n";
    let (ini, _) = gr_interp::read_ini(ini, gr_text::FileId(0), None, None);
    let setup = Setup { ini, machine_units: gr_canon::Units::Inch, ..Setup::default() };
    let text = "G20 G90 G17 F100\nG0 A80\nA100\nG1 A0\nG92 A-50\nG3 X1 Y0 I.5 A-30\nG1 A-40 U.9\nG1 A-41 U1.1\nM2\n";
    let beyond = |line: u32, axis: &str, to: &str, limit: &str| {
        format!("{line}: E0285 this move takes {axis} to {to}, beyond the machine's limit {limit}")
    };
    // A reads -50 where it is 0.
    let text = text.replace("A-30", "A50").replace("A-40", "A40").replace("A-41", "A39");
    let expected = [beyond(3, "A", "100°", "90°"), beyond(6, "A", "100°", "90°"), beyond(8, "U", "27.94 mm", "25.4 mm")];
    let found = found_with("part.ngc", &text, setup);
    assert!(found.iter().all(|f| expected.contains(f)) && found.len() == 3, "{found:#?}");
}
