//! Structures of a plan, patterns, and what is told about plans that cannot be carried out.

use gr_ir::{Op, Stop};
use gr_planner::process::Element;
use gr_planner::{Options, Process, Units, plan, process};
use gr_text::{Diagnostic, FileId, Severity, code};

const HOLE: &str = include_str!("../../../tests/golden/unb2013/example-a_conical-hole.p21");

fn modeler() -> Options {
    Options { units: Some(Units::StepModeler), ..Options::default() }
}

/// The hole's file with another main workplan and further instances.
fn with(elements: &str, more: &str) -> String {
    HOLE.replace("#60=WORKPLAN('Main workplan',(#59),$,$,$);", &format!("#60=WORKPLAN('Main workplan',({elements}),$,#10,$);\n{more}"))
}

fn read(text: &str) -> (Process, Vec<Diagnostic>) {
    let (process, _, out) = process(text.as_bytes(), FileId(0), Some(Units::StepModeler));
    (process.expect("a process"), out)
}

fn ids(process: &Process) -> Vec<u64> {
    process.steps().iter().map(|s| s.origin.id).collect()
}

fn codes(out: &[Diagnostic]) -> Vec<gr_text::Code> {
    out.iter().filter(|d| d.severity == Severity::Error).map(|d| d.code).collect()
}

#[test]
fn conditions_are_decided() {
    let more = "#70=NC_VARIABLE('count',2.);\n#71=NC_CONSTANT('two',2.);\n#72=COMPARISON_EQUAL(#70,#71);\n#73=IF_STATEMENT('if',#72,#58,#47);\n";
    let (p, out) = read(&with("#73", more));
    assert_eq!((ids(&p), codes(&out)), (vec![58], vec![]));
    let (p, _) = read(&with("#73", &more.replace("'count',2.", "'count',3.")));
    assert_eq!(ids(&p), [47]);
    let unknown = more.replace("'count',2.", "'count',$");
    let (_, out) = read(&with("#73", &unknown));
    assert_eq!(codes(&out), [code::PLAN_RUN_TIME_DECISION]);
    assert!(out.iter().any(|d| d.message.contains("variable 'count'")));
}

#[test]
fn loops_run_and_end() {
    let more = "#70=NC_VARIABLE('i',0.);\n#71=NC_CONSTANT('one',1.);\n#72=COMPARISON_LESS(#70,#71);\n#74=ASSIGNMENT('a',#70,#71);\n#75=WORKPLAN('body',(#47,#74),$,$,$);\n#73=WHILE_STATEMENT('while',#72,#75);\n";
    let (p, out) = read(&with("#73", more));
    assert_eq!((ids(&p), codes(&out)), (vec![47], vec![]));
    let endless = more.replace("(#47,#74)", "(#47)");
    let (_, out) = read(&with("#73", &endless));
    assert_eq!(codes(&out), [code::PLAN_TOO_MUCH]);
}

#[test]
fn structures_with_a_rule() {
    let (p, out) = read(&with("#73", "#73=SELECTIVE('one of',(#58,#47));\n"));
    assert_eq!(ids(&p), [58]);
    assert!(p.orphans.is_empty() && out.iter().any(|d| d.code == code::PLAN_TAKES_TURNS));
    let (p, out) = read(&with("#73", "#73=PARALLEL('both',(#58,#47));\n"));
    assert_eq!(ids(&p), [58, 47]);
    assert!(out.iter().any(|d| d.code == code::PLAN_TAKES_TURNS));
    let (p, out) = read(&with("#73", "#73=NON_SEQUENTIAL('any order',(#58,#47));\n"));
    assert_eq!(ids(&p), [58, 47]);
    assert!(!out.iter().any(|d| d.code == code::PLAN_TAKES_TURNS));
}

#[test]
fn a_plan_that_contains_itself() {
    let (_, out) = read(&with("#47,#73", "#73=WORKPLAN('round',(#58,#60),$,$,$);\n"));
    assert_eq!(codes(&out), [code::PLAN_GOES_ROUND]);
}

#[test]
fn functions_of_the_control() {
    let more = "#70=DISPLAY_MESSAGE('m','turn the part');\n#71=PROGRAM_STOP('s');\n#72=OPTIONAL_STOP('o');\n";
    let text = with("#47,#70,#71,#72,#58", more);
    let (planned, out) = plan(text.as_bytes(), FileId(0), &modeler());
    assert_eq!(codes(&out), []);
    let planned = planned.expect("a program");
    let stops: Vec<Stop> = planned.program.steps().filter_map(|s| if let Op::Stop(k) = s.op { Some(k) } else { None }).collect();
    assert_eq!(stops, [Stop::Program, Stop::Optional]);
    assert!(planned.program.steps().any(|s| matches!(s.op, Op::Note(gr_ir::Note::Message, "turn the part"))));
    let kinds = planned.process.elements.iter().map(|e| matches!(e, Element::Plan(_))).collect::<Vec<_>>();
    assert_eq!(kinds, [true]);
}

#[test]
fn patterns_repeat_their_feature() {
    // The hole's own placement is in the frame of each place of the pattern.
    let base = with("#73", "#73=MACHINING_WORKINGSTEP('many',#15,#90,#48,$);\n#91=CARTESIAN_POINT('',(0.,0.,0.));\n#92=AXIS2_PLACEMENT_3D('',#91,$,$);\n#93=DIRECTION('',(0.,1.,0.));\n")
        .replace("'',(100.0,75.0,30.0)", "'',(10.0,0.0,30.0)");
    let row = format!("#90=RECTANGULAR_PATTERN('p',#2,(#48),#92,#34,#94,#93,2,3,#95,$,(),(#96));\n#94=TOLERANCED_LENGTH_MEASURE(20.,#45);\n#95=TOLERANCED_LENGTH_MEASURE(30.,#45);\n#96=RECTANGULAR_OMIT(2,2);\n");
    let (p, out) = read(&base.replace("#91=", &format!("{row}#91=")));
    assert_eq!(codes(&out), []);
    let places: Vec<[f64; 3]> = p.steps()[0].feature.copies.iter().map(|f| f.origin).collect();
    let flat: Vec<(f64, f64)> = places.iter().map(|p| (p[0], p[1])).collect();
    assert_eq!(flat, [(10.0, 0.0), (10.0, 20.0), (10.0, 40.0), (-20.0, 0.0), (-20.0, 40.0)]);
    let circle = "#90=CIRCULAR_PATTERN('c',#2,(#48),#92,#34,1.5707963267948966,4,(),(),$,0.);\n";
    let (p, out) = read(&base.replace("#91=", &format!("{circle}#91=")));
    assert_eq!(codes(&out), []);
    let copies = &p.steps()[0].feature.copies;
    assert_eq!(copies.len(), 4);
    assert!((copies[1].origin[0]).abs() < 1e-9 && (copies[1].origin[1] - 10.0).abs() < 1e-9);
    let (planned, _) = plan(base.replace("#91=", &format!("{circle}#91=")).as_bytes(), FileId(0), &modeler());
    let bottoms = planned.expect("a program").program.steps().filter(|s| s.op == Op::Linear && s.end.axes[2] < 20.0).count();
    assert_eq!(bottoms, 4);
}

/// What a pattern says about elements that it does not have, or twice.
#[test]
fn patterns_that_contradict_themselves_are_told() {
    let base = with("#73", "#73=MACHINING_WORKINGSTEP('many',#15,#90,#48,$);\n#91=CARTESIAN_POINT('',(0.,0.,0.));\n#92=AXIS2_PLACEMENT_3D('',#91,$,$);\n#93=DIRECTION('',(0.,1.,0.));\n#94=TOLERANCED_LENGTH_MEASURE(20.,#45);\n#95=TOLERANCED_LENGTH_MEASURE(30.,#45);\n")
        .replace("'',(100.0,75.0,30.0)", "'',(10.0,0.0,30.0)");
    let told = |rows: &str| -> Vec<String> {
        let (_, _, out) = process(base.replace("#91=", &format!("{rows}#91=")).as_bytes(), FileId(0), Some(Units::StepModeler));
        let wanted = [code::PLAN_BAD_SIZE, code::PLAN_TAKES_TURNS, code::PLAN_ELEMENTS_OVERLAP];
        out.iter().filter(|d| wanted.contains(&d.code)).map(|d| format!("{} {}", d.code.def().code, d.message)).collect()
    };
    let rectangle = |moved: &str, gone: &str, more: &str| told(&format!("#90=RECTANGULAR_PATTERN('p',#2,(#48),#92,#34,#94,#93,2,3,#95,$,({moved}),({gone}));\n{more}"));
    let circle = |angle: &str, moved: &str, gone: &str, more: &str| told(&format!("#90=CIRCULAR_PATTERN('c',#2,(#48),#92,#34,{angle},4,({moved}),({gone}),$,0.);\n{more}"));
    let quarter = "1.5707963267948966";
    insta::assert_snapshot!(
        [
            rectangle("", "#96", "#96=RECTANGULAR_OMIT(2,3);\n"),
            rectangle("", "#96", "#96=RECTANGULAR_OMIT(9,1);\n"),
            rectangle("", "#96", "#96=RECTANGULAR_OMIT(2,0);\n"),
            rectangle("#96", "", "#96=RECTANGULAR_OFFSET(#93,2.,3,1);\n"),
            rectangle("#96", "#97", "#96=RECTANGULAR_OFFSET(#93,2.,2,1);\n#97=RECTANGULAR_OMIT(2,1);\n"),
            rectangle("#96,#97", "", "#96=RECTANGULAR_OFFSET(#93,2.,2,1);\n#97=RECTANGULAR_OFFSET(#93,4.,2,1);\n"),
            circle(quarter, "", "#96", "#96=CIRCULAR_OMIT(4);\n"),
            circle(quarter, "", "#96", "#96=CIRCULAR_OMIT(0);\n"),
            circle(quarter, "#96", "", "#96=CIRCULAR_OFFSET(0.1,5);\n"),
            circle(quarter, "#96", "#97", "#96=CIRCULAR_OFFSET(0.1,3);\n#97=CIRCULAR_OMIT(3);\n"),
            // A third of a turn, four times: the last on the first. A tenth of a radian: 1 mm from one to the next.
            circle("2.0943951023931953", "", "", ""),
            circle("0.1", "", "", ""),
        ]
        .map(|all| format!("{all:#?}"))
        .join("\n")
    );
}

/// Elements are compared with their neighbours alone: many in one line, as far apart as they are wide, take no time.
#[test]
fn long_lines_of_elements() {
    let base = with("#73", "#73=MACHINING_WORKINGSTEP('many',#15,#90,#48,$);\n#91=CARTESIAN_POINT('',(0.,0.,0.));\n#92=AXIS2_PLACEMENT_3D('',#91,$,$);\n#93=DIRECTION('',(0.,1.,0.));\n");
    let line = |spacing: &str| {
        let row = format!("#90=RECTANGULAR_PATTERN('p',#2,(#48),#92,#34,#94,#93,10,10000,#95,$,(),());\n#94=TOLERANCED_LENGTH_MEASURE({spacing},#45);\n#95=TOLERANCED_LENGTH_MEASURE(12.,#45);\n");
        let (p, out) = read(&base.replace("#91=", &format!("{row}#91=")));
        (p.steps()[0].feature.copies.len(), out.iter().any(|d| d.code == code::PLAN_ELEMENTS_OVERLAP))
    };
    assert_eq!([line("10."), line("9.9")], [(100_000, false), (100_000, true)]);
}

#[test]
fn patterns_inside_patterns() {
    let base = with("#73", "#73=MACHINING_WORKINGSTEP('many',#15,#80,#48,$);\n#91=CARTESIAN_POINT('',(0.,0.,0.));\n#92=AXIS2_PLACEMENT_3D('',#91,$,$);\n#93=DIRECTION('',(0.,1.,0.));\n")
        .replace("'',(100.0,75.0,30.0)", "'',(10.0,0.0,30.0)");
    let inner = "#90=CIRCULAR_PATTERN('c',#2,(#48),#92,#34,1.5707963267948966,4,(),(),$,0.);\n#94=TOLERANCED_LENGTH_MEASURE(200.,#45);\n";
    let outer = "#80=RECTANGULAR_PATTERN('p',#2,(#48),#92,#90,#94,#93,2,1,$,$,(),());\n";
    let (p, out) = read(&base.replace("#91=", &format!("{inner}{outer}#91=")));
    assert_eq!(codes(&out), []);
    let round = |v: f64| v.round() as i64;
    let places: Vec<(i64, i64)> = p.steps()[0].feature.copies.iter().map(|f| (round(f.origin[0]), round(f.origin[1]))).collect();
    assert_eq!(places, [(10, 0), (0, 10), (-10, 0), (0, -10), (-190, 0), (-200, 10), (-210, 0), (-200, -10)]);
    let (_, out) = plan(base.replace("#91=", &format!("{inner}{}#91=", outer.replace("#90", "#80"))).as_bytes(), FileId(0), &modeler());
    assert_eq!(codes(&out), [code::PLAN_GOES_ROUND]);
}

#[test]
fn files_without_a_plan() {
    for text in ["", "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n#1=CARTESIAN_POINT('',(0.,0.,0.));\nENDSEC;\nEND-ISO-10303-21;\n", "\u{0}\u{1}#1="] {
        let (planned, out) = plan(text.as_bytes(), FileId(0), &modeler());
        assert!(planned.is_none());
        assert_eq!(codes(&out), [code::PLAN_NO_PROJECT]);
    }
}

#[test]
fn bad_numbers_are_told() {
    for (old, new) in [("MILLING_TOOL_DIMENSION(10.0,", "MILLING_TOOL_DIMENSION(0.0,"), ("11.819851171331011", "-1.0"), ("(0.0,0.0,-10.0)", "(0.0,0.0,10.0)")] {
        let text = HOLE.replace(old, new);
        let (planned, out) = plan(text.as_bytes(), FileId(0), &modeler());
        assert!(planned.is_none(), "{new}");
        assert!(codes(&out).contains(&code::PLAN_BAD_SIZE), "{new}: {out:#?}");
    }
}

#[test]
fn a_drill_wider_than_its_hole() {
    let text = HOLE.replace("#44=TOLERANCED_LENGTH_MEASURE(10.0,#45)", "#44=TOLERANCED_LENGTH_MEASURE(8.0,#45)");
    let (_, out) = plan(text.as_bytes(), FileId(0), &modeler());
    assert_eq!(codes(&out), [code::PLAN_TOOL_WIDER_THAN_FEATURE]);
}

#[test]
fn a_security_plane_inside_the_part_is_not_used() {
    let text = HOLE.replace("'',(0.0,0.0,55.0)", "'',(0.0,0.0,25.0)");
    let (planned, out) = plan(text.as_bytes(), FileId(0), &modeler());
    assert!(out.iter().any(|d| d.code == code::PLAN_APPROACH_CHANGED));
    let high = planned.expect("a program").program.steps().filter(|s| s.op == Op::Rapid).map(|s| s.end.axes[2]).fold(0.0, f64::max);
    assert_eq!(high, 35.0);
}

#[test]
fn multistep_drilling_pecks() {
    let text = HOLE.replace("DRILLING($,$,'Drilling',5.0,#56,#49,#54,#55,$,11.819851171331011,$,$,$,#57)", "MULTISTEP_DRILLING($,$,'Drilling',5.0,#56,#49,#54,#55,$,10.,$,0.5,$,#57,20.,4.,3.,$)")
        .replace("CENTER_MULTISTEP", "CENTER");
    let (planned, out) = plan(text.as_bytes(), FileId(0), &modeler());
    assert_eq!(codes(&out), []);
    let program = planned.expect("a program").program;
    let depths: Vec<f64> = program.steps().filter(|s| s.op == Op::Linear).map(|s| 30.0 - s.end.axes[2]).collect();
    assert_eq!(depths, [10.0, 4.0, 7.0, 10.0]);
    // Out to the retract plane between pecks, back to 0.254 mm above the bottom.
    let rapids: Vec<f64> = program.steps().filter(|s| s.op == Op::Rapid).map(|s| 30.0 - s.end.axes[2]).collect();
    let wanted = [-5.0, 3.746, -5.0, 6.746, -5.0, -25.0];
    assert!(rapids.iter().rev().zip(wanted.iter().rev()).all(|(a, b)| (a - b).abs() < 1e-9), "{rapids:?}");
    assert!(program.steps().any(|s| s.op == Op::Dwell(0.5)));
}

#[test]
fn a_step_is_cut_to_the_side_of_the_block() {
    let slot = include_str!("../../../tests/golden/unb2013/fig4-45_slot-square-u.p21");
    let text = slot
        .replace("#39=SLOT('ranhura com perfil U',#2,(#25,#71),#40,#48,#53,#57,(#68,#69));", "#39=STEP('step',#2,(#25),#40,#48,#53,$,());")
        .replace("'',(0.0,50.0,20.0)", "'',(0.0,80.0,20.0)")
        .replace("#86=WORKPLAN('workplan setup plano: XY',(#70,#85),$,#10,$)", "#86=WORKPLAN('workplan setup plano: XY',(#70),$,#10,$)");
    let (planned, out) = plan(text.as_bytes(), FileId(0), &modeler());
    assert_eq!(codes(&out), [], "{out:#?}");
    let program = planned.expect("a program").program;
    let y: Vec<f64> = program.steps().filter(|s| s.op.feeds() && s.end.axes[2] < 20.0).map(|s| s.end.axes[1]).collect();
    let (low, high) = y.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    // Tool 3 mm: its edge stays on the line Y80 and passes the side at Y100.
    assert!((low - 81.5).abs() < 1e-6 && high > 100.0, "{low} {high}");
}

proptest::proptest! {
    /// A damaged file gives messages, never a panic, and no program with an error.
    #[test]
    fn damaged_files(at in 0usize..3000, len in 0usize..12, with in "[#$*()',.;0-9A-Z-]{0,6}", which in 0usize..3) {
        let files = [
            HOLE,
            include_str!("../../../tests/golden/unb2013/fig4-45_slot-square-u.p21"),
            include_str!("../../../tests/golden/ufsc2016/example1.p21"),
        ];
        let mut text = files[which].as_bytes().to_vec();
        let at = at % text.len();
        let end = (at + len).min(text.len());
        text.splice(at..end, with.bytes());
        let (planned, out) = plan(&text, FileId(0), &modeler());
        proptest::prop_assert!(planned.is_none() == (!codes(&out).is_empty()));
    }
}

#[test]
fn steps_that_no_workplan_has_are_told() {
    let (p, out) = read(&with("#58", ""));
    assert_eq!(ids(&p), [58]);
    let orphans: Vec<&Diagnostic> = out.iter().filter(|d| d.code == code::PLAN_ORPHAN_STEP).collect();
    assert_eq!(orphans.len(), 1, "{out:?}");
    assert!(orphans[0].message.contains("#47"), "{}", orphans[0].message);
}

/// One project is run; what only another lists is not said to be in no workplan.
#[test]
fn a_second_project_is_told() {
    let text = with("#58", "#80=PROJECT('second',#81,(),$,$,$);\n#81=WORKPLAN('other',(#47),$,#10,$);\n");
    let (p, out) = read(&text);
    assert_eq!((ids(&p), p.orphans.len()), (vec![58], 0));
    let told: Vec<&Diagnostic> = out.iter().filter(|d| d.code == code::PLAN_SECOND_PROJECT).collect();
    assert_eq!(told.len(), 1);
    assert!(text[told[0].labels[0].span.start as usize..].starts_with("PROJECT('second'"));
    assert!(told[0].message.starts_with("#80 PROJECT 'second' is not run: the file's plan is that of #"), "{}", told[0].message);
}

/// The point of a drill in radians, read in degrees, would be a needle that is drilled with its whole length.
#[test]
fn a_drill_with_a_point_in_radians_is_refused() {
    // Without a depth of its own, and with speeds that fit the standard's units.
    let text = HOLE.replace("11.819851171331011", "$").replace(",11.0,-3.5014087480216975,", ",$,-3.5,").replace("0.245", "0.002");
    let text = text.replace(",11.0,-5.83568124670283,", ",$,-5.8,").replace("0.175", "0.002");
    let errors = |units: Option<Units>| -> Vec<String> {
        let (_, out) = plan(text.as_bytes(), FileId(0), &Options { units, ..Options::default() });
        assert!(!out.iter().any(|d| d.code == code::PLAN_SHORT_OF_BOTTOM) || units == Some(Units::StepModeler));
        out.into_iter().filter(|d| d.severity == Severity::Error).map(|d| format!("{} {}", d.code.def().code, d.message)).collect()
    };
    let open = errors(None);
    assert!(open.len() == 1 && open[0].starts_with("E0485 ") && open[0].contains("degrees"), "{open:?}");
    let said = errors(Some(Units::Iso));
    assert!(said.len() == 2 && said.iter().all(|d| d.contains("it must be more than 2 degrees")), "{said:?}");
    assert_eq!(errors(Some(Units::StepModeler)), Vec::<String>::new());
}

/// A depth that fits the other reading of a point's angle says so.
#[test]
fn a_point_counted_from_the_face_is_offered_as_a_reading() {
    let (_, out) = plan(HOLE.as_bytes(), FileId(0), &modeler());
    let told: Vec<&Diagnostic> = out.iter().filter(|d| d.code == code::PLAN_SHORT_OF_BOTTOM).collect();
    assert!(told.len() == 1 && told[0].notes.iter().any(|n| n.contains("a drill of 70 degrees")), "{told:#?}");
    let deeper = HOLE.replace("11.819851171331011", "11.9");
    let (_, out) = plan(deeper.as_bytes(), FileId(0), &modeler());
    assert!(out.iter().filter(|d| d.code == code::PLAN_SHORT_OF_BOTTOM).all(|d| d.notes.is_empty()));
}
