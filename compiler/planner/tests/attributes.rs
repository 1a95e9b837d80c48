//! Every attribute of every entity that becomes motion is honoured or told: changed alone, it changes the motion or
//! what is said about the file. The few that may do neither are listed with the reason.

mod judge;

use std::collections::{BTreeMap, BTreeSet};

use gr_planner::{Options, plan};
use gr_text::FileId;
use judge::cases::*;
use judge::part::{Mill, Part};
use judge::special;

/// Attributes without an effect, and why that is right: of an entity, of what an attribute refers to, or (`*`) of any.
const SILENT: &[(&str, &str, &str)] = &[
    ("*", "name", "a name of geometry"),
    ("*", "its_id", "a name; those of workingsteps and features stand in the program"),
    ("*", "parameter_name", "a name"),
    ("*", "number_of_teeth", "a feed per tooth needs it; where the feed is given it says nothing"),
    ("*", "previous_diameter", "the standard gives it for information only; back boring needs it"),
    ("*", "its_tool_direction", "two axes at a time: nothing here moves in three"),
    ("PLUS_MINUS_VALUE", "upper_limit", "the nominal size is cut"),
    ("PLUS_MINUS_VALUE", "lower_limit", "the nominal size is cut"),
    ("PLUS_MINUS_VALUE", "significant_digits", "the nominal size is cut"),
    ("CUTTING_COMPONENT", "expected_tool_life", "the shop's, not the program's"),
    ("BLOCK.position", "axis", "only what is open to the sides reaches as far as the block"),
    ("BLOCK.position", "ref_direction", "only what is open to the sides reaches as far as the block"),
    ("PLANE.position", "ref_direction", "a plane turned about its own normal is the same plane"),
    ("GENERAL_OUTSIDE_PROFILE.profile_swept_shape", "placement", "the depth says where it ends"),
    ("CONICAL_HOLE_BOTTOM", "tip_radius", "a tool with a larger edge does not get there"),
    ("CONTOUR_PARALLEL", "allow_multiple_passes", "several passes are made anyway"),
    ("MILLING_TECHNOLOGY", "synchronize_spindle_with_feed", "a tap always goes in step with its spindle"),
    ("CENTER_DRILL.?", "tool_tip_half_angle", "its depth of cut counts to the tip"),
    ("TAP.dimension", "tool_tip_half_angle", "its depth of cut counts to the tip"),
    ("TAPERED_REAMER.dimension", "tool_tip_half_angle", "its depth of cut counts to the tip"),
    ("TAPERED_REAMER.dimension", "tool_circumference_angle", "it goes to its depth whatever its shape"),
    ("BLOCK.position", "…", "only what is open to the sides reaches as far as the block"),
    ("BOSS.depth", "…", "a boss inside a feature stands on that feature's floor"),
    ("COUNTERSUNK_HOLE.feature_placement", "ref_direction", "it is round"),
    ("DEFINED_THREAD.feature_placement", "ref_direction", "it is round"),
    ("PARTIAL_AREA_DEFINITION.placement", "ref_direction", "it is round"),
    ("SPECIFICATION", "…", "a name of a document"),
    ("*", "number_of_effective_teeth", "a feed per tooth needs it; where the feed is given it says nothing"),
    ("BLOCK", "x", "only what is open to the sides reaches as far as the block"),
    ("BLOCK", "y", "only what is open to the sides reaches as far as the block"),
    ("BLOCK", "z", "only what is open to the sides reaches as far as the block"),
];

/// One statement: number, keyword, arguments as written.
#[derive(Clone)]
struct Row {
    id: usize,
    keyword: String,
    values: Vec<String>,
}

fn split(list: &str) -> Vec<String> {
    let (mut out, mut depth, mut quoted, mut at) = (vec![String::new()], 0, false, 0);
    for c in list.chars() {
        match c {
            '\'' => quoted = !quoted,
            '(' if !quoted => depth += 1,
            ')' if !quoted => depth -= 1,
            ',' if !quoted && depth == 0 => {
                out.push(String::new());
                at += 1;
                continue;
            }
            _ => {}
        }
        out[at].push(c);
    }
    out
}

fn rows(text: &str) -> Vec<Row> {
    let of = |line: &str| {
        let (id, rest) = line.strip_prefix('#')?.split_once('=')?;
        let (keyword, rest) = rest.split_once('(')?;
        let values = split(rest.strip_suffix(");")?);
        Some(Row { id: id.parse().ok()?, keyword: keyword.into(), values })
    };
    text.lines().filter_map(of).collect()
}

fn write(text: &str, row: &Row, more: &str) -> String {
    let head = format!("#{}=", row.id);
    let line = format!("{head}{}({});", row.keyword, row.values.join(","));
    let all: Vec<String> = text.lines().map(|l| if l.starts_with(&head) { format!("{line}{more}") } else { l.into() }).collect();
    all.join("\n")
}

/// Name and type of each attribute in the order of the file.
type Attributes = Vec<(String, String)>;

/// Those of each entity, of each edition that has one of this name.
fn attributes() -> BTreeMap<String, Vec<Attributes>> {
    let spec = include_str!("../../../spec/step/entities.tsv");
    let mut out: BTreeMap<String, Vec<Attributes>> = BTreeMap::new();
    for r in spec.lines().filter(|l| !l.starts_with('#')).map(|l| l.split('\t').collect::<Vec<_>>()) {
        let list = r[5].split(';').filter_map(|a| a.trim().split_once(':'));
        let list = list.map(|(n, t)| (n.trim_end_matches('?').to_string(), t.trim().to_string())).collect();
        out.entry(r[2].to_string()).or_default().push(list);
    }
    out
}

/// The attributes of a statement: of the edition that has as many.
fn of<'a>(spec: &'a BTreeMap<String, Vec<Attributes>>, row: &Row) -> Option<&'a Attributes> {
    let all = spec.get(&row.keyword)?;
    all.iter().find(|l| l.len() == row.values.len()).or(all.first())
}

/// Numbers that are other enough, one by one, for a change that shows only in steps or as a limit.
fn others(value: &str, kind: &str, fresh: usize) -> Vec<(String, String)> {
    // Of a list of numbers each.
    let list: Option<Vec<f64>> = value.strip_prefix('(').and_then(|v| v.strip_suffix(')')).and_then(|v| v.split(',').map(|n| n.parse().ok()).collect());
    if let Some(list) = list {
        let with = |i: usize, v: f64| {
            let all: Vec<String> = list.iter().enumerate().map(|(k, old)| format!("{:?}", if k == i { v } else { *old })).collect();
            (format!("({})", all.join(",")), String::new())
        };
        return (0..list.len()).flat_map(|i| [with(i, list[i] + 0.375), with(i, -list[i] - 1.0)]).collect();
    }
    let mut out: Vec<_> = other(value, kind, fresh).into_iter().collect();
    if let Ok(v) = value.parse::<f64>()
        && kind != "INTEGER"
    {
        let more = if v == 0.0 { [1.0, 5.0, -1.0] } else { [0.4 * v, 0.01 * v, 3.0 * v] };
        out.extend(more.map(|v| (format!("{v:?}"), String::new())));
    }
    out
}

/// Something else of the same kind, and a statement it needs.
fn other(value: &str, kind: &str, fresh: usize) -> Option<(String, String)> {
    let plain = |v: &str| Some((v.to_string(), String::new()));
    let of = |statement: &str| Some((format!("#{fresh}"), format!("\n#{fresh}={statement};")));
    if let Ok(v) = value.parse::<f64>() {
        return if kind == "INTEGER" { plain(&format!("{}", v as i64 + 1)) } else { plain(&format!("{:?}", v * 1.0625 + 0.125)) };
    }
    match value {
        ".T." => return plain(".F."),
        ".F." => return plain(".T."),
        _ => {}
    }
    if let Some(name) = value.strip_prefix('.') {
        let pairs = [
            ("LEFT.", ".RIGHT."), ("RIGHT.", ".LEFT."), ("CW.", ".CCW."), ("CCW.", ".CW."), ("CLIMB.", ".CONVENTIONAL."),
            ("CONVENTIONAL.", ".CLIMB."), ("TCP.", ".CCP."), ("CCP.", ".TCP."), ("STRAIGHTLINE.", ".DEGOUGE."),
        ];
        return pairs.iter().find(|p| p.0 == name).and_then(|p| plain(p.1));
    }
    if value.starts_with('\'') {
        return plain("'another'");
    }
    if value != "$" {
        return None;
    }
    match kind {
        "BOOLEAN" => plain(".T."),
        "INTEGER" => plain("2"),
        "identifier" | "label" | "text" => plain("'another'"),
        "rot_direction" => plain(".CW."),
        "cutmode_type" => plain(".CONVENTIONAL."),
        "left_or_right" => plain(".RIGHT."),
        "hand" | "hand_of_cut_type" => plain(".LEFT."),
        "descriptive_parameter" => of("DESCRIPTIVE_PARAMETER('p','another')"),
        "stroke_connection_strategy" => plain(".DEGOUGE."),
        "direction" => of("DIRECTION('',(0.,1.,0.))"),
        "cartesian_point" => of("CARTESIAN_POINT('',(3.,2.,1.))"),
        "toleranced_length_measure" => {
            Some((format!("#{fresh}"), format!("\n#{}=PLUS_MINUS_VALUE(0.1,0.1,3);\n#{fresh}=TOLERANCED_LENGTH_MEASURE(1.5,#{});", fresh + 1, fresh + 1)))
        }
        "axis2_placement_3d" => Some((format!("#{fresh}"), format!("\n#{}=CARTESIAN_POINT('',(1.,1.,0.));\n#{fresh}=AXIS2_PLACEMENT_3D('',#{},$,$);", fresh + 1, fresh + 1))),
        "adaptive_control" => of("ADAPTIVE_CONTROL()"),
        "approach_retract_strategy" => of("AP_RETRACT_TANGENT($,1.5)"),
        "two5d_milling_strategy" => of("BIDIRECTIONAL($,$,$,$,$)"),
        "tool_direction" => of("TWO_AXES()"),
        k if k.contains("measure") || k == "REAL" || k == "NUMBER" || k.contains("pressure") || k.contains("speed") => plain("1.5"),
        _ => None,
    }
}

/// What stands in the tool table and nowhere else. Everything else of a tool has to show in the motion or in words: that
/// the table has another diameter says nothing of a path that stays as it was.
const IN_THE_TABLE: &[&str] = &["tool_offset_length", "overall_assembly_length", "tool_functional_length"];

type Said = BTreeSet<(&'static str, String)>;

/// Motion, words, and the tool table.
fn outcome(text: &str) -> (String, Said, String) {
    let (planned, out) = plan(text.as_bytes(), FileId(0), &Options::default());
    let mut said: BTreeSet<(&'static str, String)> = out.iter().map(|d| (d.code.def().code, d.message.clone())).collect();
    // What checks of the schema say of an attribute is told too; a second number for the first unused one is not.
    said.extend(gr_step::diagnostics(text, FileId(0)).into_iter().filter(|d| d.code.def().code != "E0415").map(|d| (d.code.def().code, d.message)));
    let all = planned.map(|p| (gr_ir::text::print(&p.program, false), gr_planner::tool_table(&p.tools)));
    let (motion, table) = all.unwrap_or_default();
    (motion, said, table)
}

/// Whether another outcome is one: the name of an instance in a message is none.
fn differs(name: &str, a: &(String, Said, String), b: &(String, Said, String)) -> bool {
    a.0 != b.0 || a.1 != b.1 || IN_THE_TABLE.contains(&name) && a.2 != b.2
}

fn silent(keyword: &str, by: &str, name: &str) -> bool {
    let last = by.rsplit(' ').next().unwrap_or_default();
    // With `…` everything that the attribute refers to, or that the entity says.
    let of = |k: &str, n: &str| if n == "…" { keyword == k || by.split(' ').any(|b| b == k) } else { n == name && [keyword, last, "*"].contains(&k) };
    SILENT.iter().any(|(k, n, _)| of(k, n))
}

/// Said already to have no effect, itself or what refers to it.
fn told(said: &Said, keyword: &str, by: &str, name: &str) -> bool {
    let of = |a: &str| said.iter().any(|(c, m)| *c == "E0489" && m.starts_with(&format!("{a} of")));
    let way = keyword.starts_with("AP_RETRACT") || keyword.starts_with("PLUNGE");
    let above = || by.split(' ').filter_map(|b| b.split_once('.')).any(|b| of(b.1));
    of(name) || above() || way && said.iter().any(|(c, _)| *c == "E0493")
}

/// Entities that everything else is made of: what they say depends on what they belong to.
const PARTS: &[&str] = &["CARTESIAN_POINT", "DIRECTION", "AXIS2_PLACEMENT_3D", "PLANE", "TOLERANCED_LENGTH_MEASURE", "POLYLINE", "LINEAR_PATH"];

/// Who refers to a statement, and by what: `SLOT.course_of_travel`, and of a point the whole way, from the outside in
/// `SLOT.course_of_travel LINEAR_PATH.its_direction`.
fn user(all: &[Row], spec: &BTreeMap<String, Vec<Attributes>>, id: usize) -> String {
    let name = format!("#{id}");
    for r in all {
        for (i, v) in r.values.iter().enumerate() {
            if split(v.trim_matches(['(', ')'])).iter().any(|x| *x == name) {
                let attribute = of(spec, r).and_then(|a| a.get(i)).map_or("?", |a| a.0.as_str());
                let own = format!("{}.{attribute}", r.keyword);
                return if PARTS.contains(&r.keyword.as_str()) { format!("{} {own}", user(all, spec, r.id)).trim().into() } else { own };
            }
        }
    }
    String::new()
}

fn drills() -> Vec<Part> {
    let hole = |keyword: &str, tool: &str, depth: &str, more: &str| {
        let mut p = Part::new(BLOCK);
        let dim = p.add("MILLING_TOOL_DIMENSION(8.,59.,$,40.,0.,$,$)".into());
        let body = p.add(format!("{tool}(#{dim},2,.RIGHT.,.F.,$)"));
        let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
        let edge = p.direction([1.0, 0.0, 0.0]);
        let tool = p.add(format!("MILLING_CUTTING_TOOL('T',#{body},(#{cut}),70.,#{edge},5.)"));
        let (t, f) = (p.technology(), p.functions());
        let s = p.add("DRILLING_TYPE_STRATEGY(75.,50.,2.,60.,40.,3.)".into());
        let op = p.add(format!("{keyword}($,$,'op',5.,$,#{tool},#{t},#{f},$,{depth},$,0.5,0.8,#{s}{more})"));
        let (size, b) = (p.length(8.0), p.add("CONICAL_HOLE_BOTTOM(59.,$)".into()));
        p.machine("ROUND_HOLE", &[op], [30.0, 20.0, TOP], Some(9.0), &format!(",#{size},$,#{b}"));
        p
    };
    vec![
        hole("DRILLING", "TWIST_DRILL", "$", ""),
        hole("CENTER_DRILLING", "CENTER_DRILL", "9.", ""),
        hole("MULTISTEP_DRILLING", "TWIST_DRILL", "9.", ",2.,3.,3.,0.25"),
        hole("BORING", "TWIST_DRILL", "9.", ",.F.,2.,$"),
        hole("REAMING", "TAPERED_REAMER", "9.", ",.F.,$,$"),
        hole("TAPPING", "TAP", "9.", ",.T."),
    ]
}

fn parts() -> Vec<Part> {
    let mut out: Vec<Part> = [
        rectangular_pocket("CONTOUR_PARALLEL(0.3,.F.,.CCW.,.CLIMB.)", "PLUNGE_HELIX($,2.,4.)", 6.0, Some(4.0)),
        rectangular_pocket("BIDIRECTIONAL(0.3,.F.,$,.LEFT.,$)", "PLUNGE_ZIGZAG($,8.,5.)", 6.0, Some(4.0)),
        rectangular_pocket("UNIDIRECTIONAL(0.3,.F.,$,$)", "PLUNGE_RAMP($,6.)", 6.0, Some(4.0)),
        rectangular_pocket("CONTOUR_SPIRAL(0.3,.F.,.CW.,.CONVENTIONAL.)", "AP_RETRACT_ANGLE($,30.,4.)", 6.0, Some(4.0)),
        rectangular_pocket("BIDIRECTIONAL_CONTOUR(0.3,.F.,$,.RIGHT.,.CW.,.CONVENTIONAL.)", "AP_RETRACT_TANGENT($,2.)", 6.0, Some(4.0)),
        rectangular_pocket("CONTOUR_BIDIRECTIONAL(0.3,.F.,$,.LEFT.,.CCW.,.CLIMB.)", "PLUNGE_TOOLAXIS($)", 6.0, Some(4.0)),
        circular_pocket("$", "$", 7.0),
        ngon_pocket("$", "$", 6.0, false),
        pocket_with_bosses("$", "$", 5.0, 2.0, 10.0),
        open_pocket("$", "$", 7.0),
        ball_floor("BALL_ENDMILL", 6.0, 3.0),
        face("BIDIRECTIONAL(0.3,.F.,$,.LEFT.,$)", 16.0, 0.0),
        slot("$", "$", 5.0, 12.0, "FLAT_SLOT_END_TYPE(@,@)"),
        woodruff("ENDMILL", 5.0, 0.0, 9.0, 12.0),
        curved_slot("$", 4.0, 7.0, false, "RADIUSED_SLOT_END_TYPE()"),
        step("$", 8.0, 15.0),
        milled_hole("$", "$", 8.0, "FLAT_HOLE_BOTTOM()", Some(20.0)),
        cone_floor("BALL_ENDMILL", 6.0, 3.0, 59.0),
        outside("CONTOUR_PARALLEL(0.3,.T.,$,$)", "BOSS", "SIDE_FINISH_MILLING", 8.0),
        outside("CONTOUR_PARALLEL(0.3,.T.,$,$)", "GENERAL_OUTSIDE_PROFILE", "SIDE_ROUGH_MILLING", 8.0),
    ]
    .into_iter()
    .map(|c| c.part)
    .collect();
    out.extend(drills());
    let mut p = Part::new(BLOCK);
    let t = p.tool("BULLNOSE_ENDMILL", 6.0, 1.0, None);
    let o = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", t, 2.0, 3.0).leave(0.2, 0.1).retract("AP_RETRACT_ANGLE($,30.,4.)"));
    let profile = rectangle_profile(&mut p, 30.0, 20.0);
    closed(&mut p, 5.0, &profile, "", Some(5.0), "PLANAR_POCKET_BOTTOM_CONDITION()", Some(2.0), Some(4.0), &[o], [30.0, 20.0]);
    out.push(p);
    let section = |text: &'static str, d: f64, depth: f64| {
        let make = move |p: &mut Part| {
            let mut text = text.to_string();
            for (mark, length) in [("@a", 3.0), ("@b", 8.0)] {
                if text.contains(mark) {
                    text = text.replace(mark, &format!("#{}", p.length(length)));
                }
            }
            if text.contains("@c") {
                let curve = p.polyline(&[(-4.0, 3.0), (-2.0, 0.0), (2.0, 0.0), (4.0, 3.0)]);
                text = text.replace("@c", &format!("#{curve}"));
            }
            text
        };
        section_slot("section", if d == 2.0 { "ENDMILL" } else { "BALL_ENDMILL" }, d, if d == 2.0 { 0.0 } else { d / 2.0 }, "BOTTOM_AND_SIDE_FINISH_MILLING", depth, make, |_, _| 0.0).part
    };
    out.extend([
        section("PARTIAL_CIRCULAR_PROFILE($,@a,141.0576)", 6.0, 2.0),
        section("ROUNDED_U_PROFILE($,@b)", 6.0, 4.0),
        section("VEE_PROFILE($,@a,90.,45.)", 4.0, 4.0),
        section("GENERAL_PROFILE($,@c)", 2.0, 3.0),
        section("SQUARE_U_PROFILE($,@b,@a,5.,@a,5.)", 4.0, 4.0),
    ]);
    out.extend([special::sunk("COUNTERSINK", 45.0, "ANGLE_TAPER(45.)"), special::sunk("COUNTERSINK", 45.0, "DIAMETER_TAPER(@)"), special::sunk("second edition", 45.0, "ANGLE_TAPER(45.)")]);
    for tool in ["TAP(@,2,.RIGHT.,.F.,$)", "THREAD_MILL(@,2,.RIGHT.,.F.,$)"] {
        out.push(special::defined_thread(tool, "RIGHT", "2.", 0.0));
    }
    out.push(special::defined_thread("TAPPING_CUTTING_TOOL", "RIGHT", "2.", 0.0));
    out.push(special::thread(true, "right hand", "CLIMB", 20.0));
    out.push(special::thread(false, "left hand", "CLIMB", 20.0));
    out.extend([special::tee_of("T_SLOT_MILL", 4.0, [0.0; 3]), special::tee_of("T_SLOT_MILL", 4.0, [0.5, 0.5, 0.5]), special::tee_of("second edition", 4.0, [0.0; 3])]);
    out.extend([special::bored(".F.", ".F."), special::bored(".T.", ".F."), special::back("10.", true)]);
    out.push(special::tapered(5.0));
    out
}

#[test]
fn every_attribute_is_honoured_or_told() {
    let spec = attributes();
    let mut seen: BTreeSet<(String, String, String)> = BTreeSet::new();
    let mut silent_ones: BTreeSet<String> = BTreeSet::new();
    let mut used: BTreeSet<(String, String)> = BTreeSet::new();
    for p in parts() {
        let text = p.text();
        let before = outcome(&text);
        let all = rows(&text);
        let fresh = all.iter().map(|r| r.id).max().unwrap_or(0) + 10;
        for row in &all {
            let Some(list) = of(&spec, row) else { continue };
            let by = user(&all, &spec, row.id);
            for (i, (name, kind)) in list.iter().enumerate() {
                let Some(value) = row.values.get(i) else { continue };
                // The same attribute used by the same entity is looked at once.
                let key = (row.keyword.clone(), name.clone(), format!("{by} {}", value == "$"));
                if seen.contains(&key) {
                    continue;
                }
                let all = others(value, kind, fresh);
                if all.is_empty() || silent(&row.keyword, &by, name) || told(&before.1, &row.keyword, &by, name) {
                    continue;
                }
                seen.insert(key);
                used.insert((row.keyword.clone(), name.clone()));
                let shows = all.into_iter().any(|(new, more)| {
                    let mut changed = row.clone();
                    changed.values[i] = new;
                    differs(name, &outcome(&write(&text, &changed, &more)), &before)
                });
                if !shows {
                    silent_ones.insert(format!("{}.{name} = {value} (by {by})", row.keyword));
                }
            }
        }
    }
    assert!(silent_ones.is_empty(), "neither honoured nor told:\n{}", silent_ones.into_iter().collect::<Vec<_>>().join("\n"));
    assert!(used.len() > 100, "{}", used.len());
    // No reason for what is not silent any more.
    for (k, n, _) in SILENT.iter().filter(|s| !s.0.contains('.')) {
        assert!(*n == "…" || spec.iter().any(|(e, a)| (*k == "*" || k == e) && a.iter().flatten().any(|x| x.0 == *n)), "{k}.{n} is no attribute");
    }
}
