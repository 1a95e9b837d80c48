//! Tools that do not do what their operation asks for.

mod judge;

use gr_planner::{Options, plan};
use gr_text::FileId;
use judge::cases::{BLOCK, TOP};
use judge::part::Part;

/// A hole by an operation with a tool of a kind; what is said.
fn said(operation: &str, kind: &str) -> Vec<String> {
    said_of(operation, kind, 8.0)
}

fn said_of(operation: &str, kind: &str, wide: f64) -> Vec<String> {
    let mut p = Part::new(BLOCK);
    let tool = p.tool(kind, 8.0, 0.0, None);
    let (technology, functions) = (
        p.add("MILLING_TECHNOLOGY(0.002,.TCP.,$,-10.,$,.F.,.F.,.F.,$)".into()),
        p.add("MILLING_MACHINE_FUNCTIONS(.T.,$,$,.F.,$,(),.F.,$,$,())".into()),
    );
    let more = if operation == "TAPPING" { ",.F." } else { "" };
    let op = p.add(format!("{operation}($,$,'op',5.,$,#{tool},#{technology},#{functions},$,4.,$,$,$,${more})"));
    let bore = p.add("FLAT_HOLE_BOTTOM()".into());
    let size = p.length(wide);
    p.machine("ROUND_HOLE", &[op], [30.0, 20.0, TOP], Some(6.0), &format!(",#{size},$,#{bore}"));
    let (_, out) = plan(p.text().as_bytes(), FileId(0), &Options::default());
    out.iter().filter(|d| ["E0444", "E0449", "E0471"].contains(&d.code.def().code)).map(|d| format!("{} {}", d.code.def().code, d.message)).collect()
}

#[test]
fn tools_that_do_not_suit() {
    let all = [("DRILLING", "FACEMILL"), ("DRILLING", "ENDMILL"), ("DRILLING", "TWIST_DRILL"), ("DRILLING", "DOVETAIL_MILL"), ("TAPPING", "TWIST_DRILL")];
    let text: Vec<String> = all.iter().map(|(o, k)| format!("{o} {k}: {:?}", said(o, k))).collect();
    insta::assert_snapshot!(text.join("\n"));
}

#[test]
fn a_tap_narrower_than_its_hole_cuts_nothing() {
    assert_eq!(said_of("TAPPING", "TAP", 8.1), Vec::<String>::new());
    let told = said_of("TAPPING", "TAP", 10.0);
    assert!(told.len() == 1 && told[0].contains("its tap of 8 mm is narrower than the hole of 10 mm"), "{told:?}");
}
