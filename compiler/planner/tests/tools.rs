//! Tools that do not do what their operation asks for.

mod judge;

use gr_planner::{Options, plan};
use gr_text::FileId;
use judge::cases::{BLOCK, TOP};
use judge::part::{Mill, Part};

/// A hole by an operation with a tool of a kind; what is said.
fn said(operation: &str, kind: &str) -> Vec<String> {
    said_of(operation, kind, 8.0)
}

fn said_of(operation: &str, kind: &str, wide: f64) -> Vec<String> {
    let text = hole(operation, kind, wide);
    let (_, out) = plan(text.as_bytes(), FileId(0), &Options::default());
    let all = out.into_iter().chain(gr_step::diagnostics(&text, FileId(0)));
    let told = all.filter(|d| ["E0432", "E0441", "E0444", "E0449", "E0471"].contains(&d.code.def().code));
    told.map(|d| format!("{} {}", d.code.def().code, d.message)).collect()
}

/// A hole of this width by an operation with a tool of 8 mm.
fn hole(operation: &str, kind: &str, wide: f64) -> String {
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
    p.text()
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

/// M8 in its core hole of 6.8 mm cuts a thread; in one of 5 mm it breaks.
#[test]
fn a_tap_is_wider_than_its_core_hole() {
    assert_eq!(said_of("TAPPING", "TAP", 6.8), Vec::<String>::new());
    let told = said_of("TAPPING", "TAP", 5.0);
    assert!(told.len() == 2 && told[0].starts_with("E0441 ") && told[1].starts_with("E0432 the tool of 8 mm doesn't fit into this ROUND_HOLE of 5 mm"), "{told:?}");
}

/// Straight down into material a mill without edges at its middle rubs; beside the part or above it it does not.
#[test]
fn face_mills_plunge_in_the_air_alone() {
    let told = |feature: &str, kind: &str, approach: &str| -> usize {
        let mut p = Part::new(BLOCK);
        let tool = p.tool(kind, 20.0, 0.0, None);
        let bottom = if feature == "PLANAR_FACE" { "PLANE_ROUGH_MILLING" } else { "BOTTOM_AND_SIDE_ROUGH_MILLING" };
        let op = p.mill(&Mill::new(bottom, tool, 2.0, 8.0).strategy("BIDIRECTIONAL($,$,$,.LEFT.,$)").approach(approach));
        if feature == "PLANAR_FACE" {
            let (length, across, width) = (p.length(BLOCK[0]), p.direction([1.0, 0.0, 0.0]), p.number(BLOCK[1]));
            let (course, profile) = (p.add(format!("LINEAR_PATH($,#{length},#{across})")), p.add(format!("LINEAR_PROFILE($,#{width})")));
            p.machine(feature, &[op], [0.0, 0.0, TOP], Some(2.0), &format!(",#{course},#{profile},$,()"));
        } else {
            let (size, flat) = (p.length(20.0), p.add("FLAT_HOLE_BOTTOM()".into()));
            p.machine(feature, &[op], [30.0, 20.0, TOP], Some(3.0), &format!(",#{size},$,#{flat}"));
        }
        let (_, out) = plan(p.text().as_bytes(), FileId(0), &Options::default());
        assert!(out.iter().all(|d| d.severity != gr_text::Severity::Error), "{out:#?}");
        out.iter().filter(|d| d.code == gr_text::code::STEP_FACEMILL_PLUNGE).count()
    };
    assert_eq!(told("PLANAR_FACE", "FACEMILL", "PLUNGE_TOOLAXIS($)"), 0);
    // As wide as its hole it has no other way down.
    assert_eq!(told("ROUND_HOLE", "FACEMILL", "$"), 1);
    // Nothing in the file says that an end mill does not cut at its centre.
    assert_eq!(told("ROUND_HOLE", "ENDMILL", "PLUNGE_TOOLAXIS($)"), 0);
}
