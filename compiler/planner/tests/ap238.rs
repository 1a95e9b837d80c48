//! AP238: the subset that becomes motion, and one clear refusal for the rest.

use gr_planner::{Options, plan};
use gr_text::{FileId, Severity, code};

const CONTOUR: &str = include_str!("data/ap238-contour.stpnc");

fn faults(text: &str) -> Vec<(gr_text::Code, String)> {
    let (planned, out) = plan(text.as_bytes(), FileId(0), &Options::default());
    assert!(planned.is_none());
    out.into_iter().filter(|d| d.severity == Severity::Error).map(|d| (d.code, d.message)).collect()
}

#[test]
fn tool_paths_become_motion() {
    let (planned, out) = plan(CONTOUR.as_bytes(), FileId(0), &Options::default());
    assert!(out.is_empty(), "{out:#?}");
    let planned = planned.expect("a program");
    assert_eq!(planned.tools.len(), 1);
    assert_eq!((planned.tools[0].name.as_str(), planned.tools[0].diameter), ("7", 8.0));
    insta::assert_snapshot!(gr_ir::text::print(&planned.program, false));
}

#[test]
fn inches_are_read() {
    let inch = CONTOUR.replace(
        "(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.))",
        "(CONVERSION_BASED_UNIT('inch',#901) LENGTH_UNIT() NAMED_UNIT(#903))",
    );
    let more = "#901=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#902);\n#902=(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.));\n#903=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\nENDSEC;\nEND-ISO";
    let text = inch.replacen("ENDSEC;\nEND-ISO", more, 1);
    let (planned, out) = plan(text.as_bytes(), FileId(0), &Options::default());
    let planned = planned.unwrap_or_else(|| panic!("{out:#?}"));
    let far = planned.program.steps().map(|s| s.end.axes[0]).fold(0.0, f64::max);
    assert!((far - 40.0 * 25.4).abs() < 1e-9, "{far}");
    let feeds: Vec<f64> = planned.program.steps().filter_map(|s| if let gr_ir::Op::Feed { linear, .. } = s.op { Some(linear) } else { None }).collect();
    assert!((feeds[0] - 300.0 * 25.4 / 60.0).abs() < 1e-9, "{feeds:?}");
}

#[test]
fn what_is_not_lowered_is_refused_once_by_name() {
    let found = faults(&CONTOUR.replacen("=POLYLINE(", "=B_SPLINE_CURVE_WITH_KNOTS(", 1));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].0 == code::PLAN_NOT_LOWERED && found[0].1.contains("'path 1'") && found[0].1.contains("POLYLINE"), "{found:?}");
    let other = faults(&CONTOUR.replacen("'path 2','cutter location trajectory'", "'path 2','cutter contact trajectory'", 1));
    assert!(other.len() == 1 && other[0].1.contains("cutter contact trajectory"), "{other:?}");
    let none = faults(&CONTOUR.replace("=MACHINING_TOOLPATH(", "=SOMETHING("));
    assert!(none.len() == 1 && none[0].1.contains("MACHINING_TOOLPATH"), "{none:?}");
    let empty = faults(&CONTOUR.replace("=MACHINING_WORKPLAN(", "=SOMETHING("));
    assert!(empty.len() == 1 && empty[0].0 == code::PLAN_NO_PROJECT, "{empty:?}");
}

#[test]
fn product_models_are_named() {
    for (schema, what) in [("AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF", "AP242"), ("CONFIG_CONTROL_DESIGN", "CONFIG_CONTROL_DESIGN")] {
        let text = format!("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('{schema}'));\nENDSEC;\nDATA;\n#1=CARTESIAN_POINT('',(0.,0.,0.));\nENDSEC;\nEND-ISO-10303-21;\n");
        let found = faults(&text);
        assert!(found.len() == 1 && found[0].1.contains(what), "{found:?}");
    }
}
