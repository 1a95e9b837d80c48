//! Feature × strategy × approach: what becomes motion, each cell judged, as a table in the documentation, one line of
//! a snapshot per cell. Sections of slots are judged in `swept.rs`; `examples/cells.rs` draws them.

mod judge;

use std::fmt::Write as _;

use gr_ir::Op;
use gr_planner::{Options, Planned, plan};
use gr_text::{FileId, Severity};
use judge::cases::*;
use judge::cells::features;

const DOCS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/stepnc.md");

const NAMES: [&str; 8] = ["not given", "unidirectional", "bidirectional", "contour parallel", "bidirectional contour", "contour bidirectional", "contour spiral", "centre milling"];
const WAYS: [&str; 7] = ["not given", "plunge along the axis", "plunge ramp", "plunge helix", "plunge zigzag", "approach at an angle", "approach on an arc"];

/// Planned, and judged unless its surface is elsewhere.
fn planned_well(c: &Case) -> Result<Planned, String> {
    let p = planned(c)?;
    // Helpers of sections are called here without their surface.
    if (c.surface)(30.0, 20.0, 0.0) != 0.0 {
        good(c);
    }
    Ok(p)
}

fn planned(c: &Case) -> Result<Planned, String> {
    let (planned, out) = plan(c.part.text().as_bytes(), FileId(0), &Options::default());
    planned.ok_or_else(|| out.iter().filter(|d| d.severity == Severity::Error).map(|d| d.message.clone()).collect::<Vec<_>>().join("; "))
}

/// One line of what the motion is.
fn digest(p: &Planned) -> String {
    let (mut feeds, mut rapids, mut arcs, mut length) = (0, 0, 0, 0.0);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for s in p.program.steps() {
        let (a, b) = (s.start.xyz(), s.end.xyz());
        match s.op {
            Op::Rapid => rapids += 1,
            op if op.feeds() => {
                feeds += 1;
                arcs += usize::from(matches!(op, Op::Arc(_)));
                length += (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt();
                for i in 0..3 {
                    low[i] = low[i].min(b[i]);
                    high[i] = high[i].max(b[i]);
                }
            }
            _ => {}
        }
    }
    format!(
        "{feeds} feeds ({arcs} arcs), {rapids} rapids, chords {length:.2} mm, X {:.3}..{:.3} Y {:.3}..{:.3} Z {:.3}..{:.3}",
        low[0], high[0], low[1], high[1], low[2], high[2]
    )
}

#[test]
fn every_cell() {
    let mut lines = String::new();
    let mut table = format!("| feature | {} |\n|---|{}\n", NAMES.join(" | "), "---|".repeat(NAMES.len()));
    for (name, own, make) in features() {
        let mut row = format!("| {name} |");
        for (s, strategy) in STRATEGIES.iter().zip(NAMES) {
            if !own && *s != "$" {
                row.push_str(" same |");
                continue;
            }
            match planned_well(&make(s, "$")) {
                Ok(p) => {
                    row.push_str(" yes |");
                    let _ = writeln!(lines, "{name} / {strategy}: {}", digest(&p));
                }
                Err(why) => {
                    row.push_str(" refused |");
                    let _ = writeln!(lines, "{name} / {strategy}: refused: {why}");
                }
            }
        }
        table.push_str(&row);
        table.push('\n');
    }
    let approaches = ["closed pocket, rectangular", "closed pocket, general profile", "open pocket", "slot, radiused ends", "round hole, milled"];
    let _ = write!(table, "\n| feature | {} |\n|---|{}\n", WAYS.join(" | "), "---|".repeat(WAYS.len()));
    for (name, _, make) in features().into_iter().filter(|f| approaches.contains(&f.0)) {
        let mut row = format!("| {name} |");
        for (a, way) in APPROACHES.iter().zip(WAYS) {
            match planned_well(&make("$", a)) {
                Ok(p) => {
                    row.push_str(" yes |");
                    let _ = writeln!(lines, "{name} / {way}: {}", digest(&p));
                }
                Err(why) => {
                    row.push_str(" refused |");
                    let _ = writeln!(lines, "{name} / {way}: refused: {why}");
                }
            }
        }
        table.push_str(&row);
        table.push('\n');
    }
    insta::assert_snapshot!(lines);
    in_docs("cells", &table);
}

/// What is done with those that hold curves of any kind.
const CURVES: &str = "lowered where its curves are lines, polylines, circles and composites of them; splines, Bézier curves and ellipses are refused by name";

/// What is done with each entity: lowered, or refused by name and why; what is not listed in a family is an error of
/// this test.
const ENTITIES: &[(&str, &str, &str)] = &[
    ("executables", "lowered", "WORKPLAN MACHINING_WORKINGSTEP RAPID_MOVEMENT RETURN_HOME WORKPIECE_PROBING IF_STATEMENT WHILE_STATEMENT ASSIGNMENT NON_SEQUENTIAL"),
    ("executables", "lowered, with a warning: branches one after another, the first of several alternatives", "PARALLEL SELECTIVE"),
    ("executables", "lowered", "DISPLAY_MESSAGE OPTIONAL_STOP PROGRAM_STOP LOAD_TOOL UNLOAD_TOOL"),
    ("executables", "lowered; in G-code where a program stop follows (M60) or the plan ends (M30), otherwise refused", "EXCHANGE_PALLET"),
    ("executables", "read; one channel: no effect, said so", "SET_MARK WAIT_FOR_MARK"),
    ("executables", "refused by name", "INDEX_PALLET INDEX_TABLE WORKPIECE_COMPLETE_PROBING TOOL_LENGTH_PROBING TOOL_RADIUS_PROBING"),
    ("features", "lowered", "PLANAR_FACE CLOSED_POCKET OPEN_POCKET SLOT STEP ROUND_HOLE GENERAL_OUTSIDE_PROFILE GENERAL_SHAPE_PROFILE PARTIAL_CIRCULAR_SHAPE_PROFILE CIRCULAR_CLOSED_SHAPE_PROFILE RECTANGULAR_CLOSED_SHAPE_PROFILE BOSS TOOLPATH_FEATURE COMPOUND_FEATURE COUNTERBORE_HOLE COUNTERSUNK_HOLE CIRCULAR_PATTERN RECTANGULAR_PATTERN GENERAL_PATTERN CATALOGUE_THREAD DEFINED_THREAD"),
    ("features", "refused by name", "RECTANGULAR_OPEN_SHAPE_PROFILE ROUNDED_END SPHERICAL_CAP CHAMFER EDGE_ROUND"),
    ("features", "lowered with explicit tool paths, otherwise refused by name", "REGION_PROJECTION REGION_SURFACE_LIST TOPOLOGICAL_REGION"),
    ("milling operations", "lowered", "PLANE_ROUGH_MILLING PLANE_FINISH_MILLING SIDE_ROUGH_MILLING SIDE_FINISH_MILLING BOTTOM_AND_SIDE_ROUGH_MILLING BOTTOM_AND_SIDE_FINISH_MILLING"),
    ("milling operations", "lowered with explicit tool paths, otherwise refused by name", "FREEFORM_OPERATION"),
    ("drilling operations", "lowered", "DRILLING CENTER_DRILLING COUNTER_SINKING MULTISTEP_DRILLING BORING REAMING BACK_BORING TAPPING THREAD_DRILLING"),
    ("strategies", "lowered", "UNIDIRECTIONAL BIDIRECTIONAL CONTOUR_PARALLEL BIDIRECTIONAL_CONTOUR CONTOUR_BIDIRECTIONAL CONTOUR_SPIRAL CENTER_MILLING"),
    ("strategies", "lowered with explicit tool paths, otherwise refused by name", "EXPLICIT_STRATEGY"),
    ("approaches", "lowered", "PLUNGE_TOOLAXIS PLUNGE_RAMP PLUNGE_HELIX PLUNGE_ZIGZAG AP_RETRACT_ANGLE AP_RETRACT_TANGENT ALONG_PATH"),
    ("tool paths", "lowered", "AP_LIFT_PATH_ANGLE AP_LIFT_PATH_TANGENT FEEDSTOP CONNECT_SECPLANE CONNECT_DIRECT"),
    ("tool paths", CURVES, "CUTTER_LOCATION_TRAJECTORY CUTTER_CONTACT_TRAJECTORY"),
    ("tool paths", "lowered for X, Y and Z with polylines, otherwise refused by name", "AXIS_TRAJECTORY"),
    ("travel paths", "lowered", "LINEAR_PATH COMPLETE_CIRCULAR_PATH PARTIAL_CIRCULAR_PATH"),
    ("travel paths", CURVES, "GENERAL_PATH"),
    ("open profiles", "lowered", "LINEAR_PROFILE SQUARE_U_PROFILE ROUNDED_U_PROFILE TEE_PROFILE VEE_PROFILE PARTIAL_CIRCULAR_PROFILE"),
    ("open profiles", CURVES, "GENERAL_PROFILE"),
    ("closed profiles", "lowered", "RECTANGULAR_CLOSED_PROFILE CIRCULAR_CLOSED_PROFILE NGON_PROFILE"),
    ("closed profiles", CURVES, "GENERAL_CLOSED_PROFILE"),
    ("slot ends", "lowered", "OPEN_SLOT_END_TYPE RADIUSED_SLOT_END_TYPE FLAT_SLOT_END_TYPE LOOP_SLOT_END_TYPE"),
    ("slot ends", "lowered where the section is rectangular", "WOODRUFF_SLOT_END_TYPE"),
    ("pocket bottoms", "lowered", "THROUGH_POCKET_BOTTOM_CONDITION PLANAR_POCKET_BOTTOM_CONDITION"),
    ("pocket bottoms", "lowered where the floor is hollow", "RADIUSED_POCKET_BOTTOM_CONDITION"),
    ("pocket bottoms", "lowered with explicit tool paths, otherwise refused by name: a free-form surface", "GENERAL_POCKET_BOTTOM_CONDITION"),
    ("hole bottoms", "lowered", "THROUGH_BOTTOM_CONDITION FLAT_HOLE_BOTTOM FLAT_WITH_RADIUS_HOLE_BOTTOM SPHERICAL_HOLE_BOTTOM CONICAL_HOLE_BOTTOM"),
    ("tool directions", "lowered", "TWO_AXES THREE_AXES"),
    ("tool directions", "lowered along the feature's own axis or with explicit tool paths, otherwise refused by name", "THREE_AXES_TILTED_TOOL"),
    ("tool directions", "lowered with explicit tool paths, otherwise refused by name", "FIVE_AXES_VAR_TILT_YAW FIVE_AXES_CONST_TILT_YAW"),
];

/// Roots of the families that have to be complete.
const FAMILIES: &[&str] = &[
    "executable", "two5d_manufacturing_feature", "region", "machining_operation", "two5d_milling_strategy", "approach_retract_strategy", "toolpath",
    "travel_path", "open_profile", "closed_profile", "slot_end_type", "pocket_bottom_condition", "hole_bottom_condition", "tool_direction",
];

#[test]
fn every_entity() {
    let known: std::collections::BTreeSet<&str> = ENTITIES.iter().flat_map(|e| e.2.split(' ')).collect();
    let mut missing = Vec::new();
    let spec = include_str!("../../../spec/step/entities.tsv");
    let rows: Vec<Vec<&str>> = spec.lines().filter(|l| !l.starts_with('#')).map(|l| l.split('\t').collect()).collect();
    let parents = |name: &str| -> Vec<String> {
        rows.iter().filter(|r| r[2].eq_ignore_ascii_case(name)).flat_map(|r| r[4].split(',').map(|s| s.trim().to_string())).collect()
    };
    for r in rows.iter().filter(|r| r[3] != "A" && ["10", "11"].contains(&r[0])) {
        let mut todo = vec![r[2].to_string()];
        let mut found = false;
        let mut count = 0;
        while let Some(n) = todo.pop() {
            count += 1;
            found |= FAMILIES.iter().any(|f| n.eq_ignore_ascii_case(f));
            if count < 100 {
                todo.extend(parents(&n));
            }
        }
        if found && !known.contains(r[2]) {
            missing.push(r[2]);
        }
    }
    assert!(missing.is_empty(), "not said what is done with {missing:?}");
    for name in &known {
        assert!(rows.iter().any(|r| r[2] == *name), "{name} is no entity");
    }
    let mut table = String::from("| kind | entities | |\n|---|---|---|\n");
    for (kind, what, names) in ENTITIES {
        let names: Vec<String> = names.split(' ').map(|n| format!("`{n}`")).collect();
        let _ = writeln!(table, "| {kind} | {} | {what} |", names.join(" "));
    }
    table.push_str("\nTurning (part 12), in `MACHINING_WORKINGSTEP` and `TURNING_WORKINGSTEP`: read and checked; lowered where tool paths are explicit, otherwise refused by name.\n");
    in_docs("entities", &table);
}

/// The part of the documentation between two marks is this table; with UPDATE_DOCS=1 it is written.
fn in_docs(mark: &str, table: &str) {
    let docs = std::fs::read_to_string(DOCS).expect("docs/stepnc.md");
    let (open, close) = (format!("<!-- {mark} -->\n"), format!("<!-- /{mark} -->"));
    let from = docs.find(&open).expect("the mark") + open.len();
    let to = from + docs[from..].find(&close).expect("the end mark");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(DOCS, format!("{}{table}{}", &docs[..from], &docs[to..])).expect("written");
    } else {
        assert!(docs[from..to] == *table, "docs/stepnc.md is out of date: run this test with UPDATE_DOCS=1\n{table}");
    }
}
