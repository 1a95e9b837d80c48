//! Explicit tool paths of turning operations.

use gr_planner::{Options, Units, plan};
use gr_text::{Diagnostic, FileId, Severity};

const HEAD: &str = "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('shaft'),'2;1');\nFILE_NAME('p','2026-01-01T00:00:00',(''),(''),'','','');\n\
FILE_SCHEMA(('MACHINING_SCHEMA','TURNING_SCHEMA'));\nENDSEC;\nDATA;\n";

/// A shaft: two cuts along it, the second on an arc.
fn shaft(step: &str, speed: &str, technology: &str, path: &str) -> String {
    format!(
        "{HEAD}#1=PROJECT('shaft',#36,(#5),$,$,$);
#2=CARTESIAN_POINT('',(0.,0.,0.));
#3=AXIS2_PLACEMENT_3D('',#2,$,$);
#4=RIGHT_CIRCULAR_CYLINDER('raw',#3,80.,25.);
#5=WORKPIECE('part',$,0.01,$,$,#4,());
#6=CARTESIAN_POINT('',(0.,0.,32.));
#7=AXIS2_PLACEMENT_3D('',#6,$,$);
#8=PLANE('security',#7);
#9=CUTTING_EDGE_PROPERTIES($,$,$,10.,95.,$,80.,(),$,$);
#10=GENERAL_TURNING_TOOL('PCLNR',100.,25.,$,$,$,#9,.RIGHT.);
#11={speed};
#12=TURNING_TECHNOLOGY({technology});
#13=TURNING_MACHINE_FUNCTIONS(.T.,$,$,(),$,$,$,(),$,$,$);
#14=CARTESIAN_POINT('',(20.,0.,2.));
#15=CARTESIAN_POINT('',(20.,0.,-30.));
#16=CARTESIAN_POINT('',(25.,0.,-35.));
#17=POLYLINE('',(#14,#15));
#18=CUTTER_LOCATION_TRAJECTORY(.T.,.TRAJECTORY_PATH.,$,$,$,$,#17,$,$);
#19=TOOLPATH_LIST((#18,#40));
#20=CONTOURING_ROUGH({path},$,'op',5.,$,#10,#12,#13,$,$,$,0.5);
#21=AXIS2_PLACEMENT_3D('',#2,$,$);
#22=PLUS_MINUS_VALUE(0.05,0.05,3);
#23=TOLERANCED_LENGTH_MEASURE(40.,#22);
#27=OUTER_DIAMETER('od',#5,(#20),#21,#23,#23,$);
#28=OUTER_DIAMETER('od2',#5,(),#21,#23,#23,$);
#35={step};
#36=WORKPLAN('main',(#35),$,$,$);
#40=CUTTER_LOCATION_TRAJECTORY(.T.,.TRAJECTORY_PATH.,$,$,$,$,#41,$,$);
#41=TRIMMED_CURVE('',#42,(#15),(#16),.F.,.CARTESIAN.);
#42=CIRCLE('',#43,5.);
#43=AXIS2_PLACEMENT_3D('',#44,#45,#46);
#44=CARTESIAN_POINT('',(25.,0.,-30.));
#45=DIRECTION('',(0.,1.,0.));
#46=DIRECTION('',(-1.,0.,0.));
ENDSEC;
END-ISO-10303-21;
"
    )
}

const MACHINING: &str = "MACHINING_WORKINGSTEP('ws1',#8,#27,#20,$)";
const TURNING: &str = "TURNING_WORKINGSTEP('ws1',#8,(#27,#28),#20,$)";
const PER_REV: &str = "$,.TCP.,#11,0.2,.F.,.F.,.F.,$";

fn run(text: &str, units: Option<Units>) -> (Option<String>, Vec<Diagnostic>) {
    let (planned, out) = plan(text.as_bytes(), FileId(0), &Options { units, ..Options::default() });
    (planned.map(|p| gr_ir::text::print(&p.program, false)), out)
}

fn errors(out: &[Diagnostic]) -> Vec<String> {
    out.iter().filter(|d| d.severity == Severity::Error).map(|d| format!("{} {}", d.code.def().code, d.message)).collect()
}

#[test]
fn tool_paths_of_both_workingsteps() {
    let (text, out) = run(&shaft(MACHINING, "CONST_SPINDLE_SPEED(-20.)", PER_REV, "#19"), None);
    let text = text.unwrap_or_else(|| panic!("{out:#?}"));
    insta::assert_snapshot!(text);
    let (other, _) = run(&shaft(TURNING, "CONST_SPINDLE_SPEED(-20.)", PER_REV, "#19"), None);
    assert_eq!(other, Some(text));
}

#[test]
fn constant_cutting_speed() {
    let (text, out) = run(&shaft(TURNING, "CONST_CUTTING_SPEED(3.,50.)", PER_REV, "#19"), None);
    insta::assert_snapshot!(text.unwrap_or_else(|| panic!("{out:#?}")));
}

#[test]
fn feed_per_time() {
    let (text, out) = run(&shaft(TURNING, "CONST_SPINDLE_SPEED(-20.)", "0.004,.TCP.,#11,$,.F.,.F.,.F.,$", "#19"), None);
    let text = text.unwrap_or_else(|| panic!("{out:#?}"));
    assert!(!text.contains("per-rev") && text.contains("feed 4"), "{text}");
}

#[test]
fn speeds_in_two_readings() {
    let file = shaft(TURNING, "CONST_SPINDLE_SPEED(500.)", PER_REV, "#19");
    let (none, out) = run(&file, None);
    assert!(none.is_none());
    assert_eq!(errors(&out), ["E0485 two readings of these numbers: 30000.0 rpm as the standard says, 500.0 rpm as STEP Modeler writes"]);
    let (program, out) = run(&file, Some(Units::StepModeler));
    assert!(program.is_some_and(|p| p.contains("spindle-turn 0 ccw")));
    assert!(out.iter().any(|d| d.code.def().code == "E0426" && d.message.contains("M4")), "{out:#?}");
}

#[test]
fn without_a_path_the_path_is_missed() {
    let (none, out) = run(&shaft(TURNING, "CONST_SPINDLE_SPEED(-20.)", PER_REV, "$"), None);
    assert!(none.is_none());
    assert_eq!(errors(&out), ["E0482 #20 CONTOURING_ROUGH 'op' is not turned into motion without an explicit tool path"]);
}
