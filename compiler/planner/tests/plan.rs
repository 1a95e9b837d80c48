//! The default planner: what it makes of published files, and what the original systems did wrong.

use gr_ir::{Marker, Op, Program, Turn};
use gr_planner::{Options, Overlap, Planned, Units, plan};
use gr_text::{Diagnostic, FileId, Severity, code};

const SLOT: &str = include_str!("../../../tests/golden/unb2013/fig4-45_slot-square-u.p21");
const HOLE: &str = include_str!("../../../tests/golden/unb2013/example-a_conical-hole.p21");
const PART1: &str = include_str!("../../../tests/golden/ufsc2016/example1.p21");
const PART2: &str = include_str!("../../../tests/golden/ufsc2016/example2_3caras.p21");

/// As the files mean their numbers: the ones of STEP Modeler, and the standard's example with overlaps in percent.
fn options(text: &str) -> Options {
    let modeler = text.contains("ST-GENERATOR").then_some(Units::StepModeler);
    Options { units: modeler, overlap: text.contains("'example1.p21'").then_some(Overlap::Percent), ..Options::default() }
}

fn planned(text: &str) -> (Planned, Vec<Diagnostic>) {
    let (planned, out) = plan(text.as_bytes(), FileId(0), &options(text));
    let errors: Vec<_> = out.iter().filter(|d| d.severity == Severity::Error).collect();
    assert!(errors.is_empty(), "{errors:#?}");
    (planned.expect("a program"), out)
}

fn faults(text: &str) -> Vec<Diagnostic> {
    let (planned, out) = plan(text.as_bytes(), FileId(0), &options(text));
    assert!(planned.is_none(), "no program with errors: {out:#?}");
    out
}

/// Safety of any program: rapids never go down into the part, and sideways only above it.
fn safe(program: &Program, top: f64) {
    for step in program.steps() {
        let (a, b) = (step.start.xyz(), step.end.xyz());
        if matches!(step.op, Op::Rapid) && step.index > 12 {
            let sideways = (a[0] - b[0]).abs() + (a[1] - b[1]).abs() > 1e-9;
            assert!(!sideways || a[2].min(b[2]) >= top - 1e-9, "{step:?}");
        }
    }
}

fn text(program: &Program) -> String {
    gr_ir::text::print(program, false)
}

#[test]
fn conical_hole() {
    let (p, out) = planned(HOLE);
    safe(&p.program, 30.0);
    insta::assert_snapshot!(text(&p.program));
    // What the original did: feed at machine speed, rapid onto the surface, no coolant, no speed.
    assert!(out.iter().all(|d| d.code != code::PLAN_UNITS_OPEN), "the units are stated");
    let bottom = p.program.steps().filter(|s| s.op.moves()).map(|s| s.end.axes[2]).fold(f64::INFINITY, f64::min);
    assert!((bottom - (30.0 - 11.819851171331011)).abs() < 1e-9, "{bottom}");
    assert!(p.program.steps().any(|s| s.op == Op::Flood(true)));
    assert!(p.program.steps().any(|s| s.op == Op::SpindleTurn { spindle: 0, turn: Turn::Cw }));
}

/// Two readings of a file: neither is chosen, both are offered, once.
#[test]
fn open_units_are_an_error() {
    for (file, iso, modeler) in [(HOLE, "350.1 rpm, feed 10500.0", "583.6 rpm, feed 102.1"), (SLOT, "", ""), (PART2, "", "")] {
        let (planned, out) = plan(file.as_bytes(), FileId(0), &Options::default());
        let open: Vec<_> = out.iter().filter(|d| d.code == code::PLAN_UNITS_OPEN).collect();
        assert!(planned.is_none() && open.len() == 1, "{out:#?}");
        assert!(open[0].message.contains(iso) && open[0].message.contains(modeler), "{}", open[0].message);
    }
    // Values in the standard's units, and both speeds where they agree: 1.2566 m/s on 20 mm are 20 1/s.
    let both = PART1.replace("(0.04,.TCP.,$,-12.0", "(0.04,.TCP.,0.754,-12.0");
    assert!(both != PART1 && !plan(both.as_bytes(), FileId(0), &options(&both)).1.iter().any(|d| d.code == code::PLAN_UNITS_OPEN));
    let open = PART1.replace("(0.04,.TCP.,$,-12.0", "(0.04,.TCP.,45.2,-12.0");
    assert!(plan(open.as_bytes(), FileId(0), &options(&open)).1.iter().any(|d| d.code == code::PLAN_UNITS_OPEN));
}

/// A cutting speed alone: 25 is an everyday value in m/min and no machine's in m/s on a small tool.
#[test]
fn a_cutting_speed_alone_has_two_readings() {
    let alone = |v: &str| {
        let text = PART1.replace("(0.04,.TCP.,$,-12.0", &format!("(0.04,.TCP.,{v},$"));
        assert!(text != PART1);
        let (planned, out) = plan(text.as_bytes(), FileId(0), &options(&text));
        let open: Vec<String> = out.iter().filter(|d| d.code == code::PLAN_UNITS_OPEN).map(|d| d.message.clone()).collect();
        (planned.is_some(), open)
    };
    for v in ["15.", "25.", "50.", "60."] {
        let (made, open) = alone(v);
        assert!(!made && open.len() == 1 && open[0].contains(" rpm"), "{v}: {open:?}");
    }
    for v in ["0.8", "1.8", "5.", "10."] {
        assert_eq!(alone(v), (true, Vec::new()), "{v}");
    }
}

/// An overlap is what the options say it is.
#[test]
fn overlaps() {
    let passes = |overlap| {
        let options = Options { overlap, ..Options::default() };
        plan(PART1.as_bytes(), FileId(0), &options).0.map(|p| p.program.steps().filter(|s| matches!(s.op, Op::Linear)).count())
    };
    let (percent, mm) = (passes(Some(Overlap::Percent)), passes(Some(Overlap::Millimetres)));
    assert!(percent.is_some() && mm > percent, "5 mm of 20 overlap more than 5 percent: {percent:?} {mm:?}");
    assert_eq!(passes(None), None, "no reading is chosen");
    assert_eq!(passes(Some(Overlap::Ratio)), None);
}

#[test]
fn drilling_feeds_are_those_of_the_file() {
    let (p, _) = planned(HOLE);
    // 0.175 mm/rev at 583.6 rpm, 0.245 mm/rev at 350.1 rpm.
    let feeds: Vec<f64> = p.program.steps().filter_map(|s| if let Op::Feed { linear, .. } = s.op { Some(linear * 60.0) } else { None }).collect();
    assert_eq!(feeds.len(), 2);
    assert!((feeds[0] - 0.175 * 583.568).abs() < 1e-3 && (feeds[1] - 0.245 * 350.1409).abs() < 1e-3, "{feeds:?}");
}

#[test]
fn one_tool_change_per_tool() {
    // Both steps of the slot with the same tool: the second needs no change.
    let same = SLOT.replace("#85=MACHINING_WORKINGSTEP('SquareUprofileSlot_RGH',#15,#39,#71,$)", "#85=MACHINING_WORKINGSTEP('again',#15,#39,#25,$)");
    let (p, _) = planned(&same);
    let changes = p.program.steps().filter(|s| matches!(s.op, Op::ToolChange(_))).count();
    assert_eq!(changes, 1);
}

#[test]
fn three_faces_go_round_by_the_security_plane() {
    let (p, out) = planned(PART2);
    assert!(out.iter().any(|d| d.code == code::PLAN_TILTED_TOOL));
    let steps: Vec<i32> = p
        .program
        .steps()
        .filter_map(|s| if let Op::Begin { marker: Marker::Workingstep, code, .. } = s.op { Some(code) } else { None })
        .collect();
    assert_eq!(steps.len(), 26);
    assert_eq!(&steps[..3], [59, 74, 109]);
    let turned = p.program.steps().filter(|s| s.start.tool_axis != s.end.tool_axis && s.start.tool_axis.is_some());
    for s in turned {
        assert!(s.start.axes[2] >= 225.0 && s.end.axes[2] >= 225.0, "{s:?}");
    }
    // Round holes have true arcs.
    assert!(p.program.steps().any(|s| matches!(s.op, Op::Arc(_))));
}

#[test]
fn example_1() {
    let (p, _) = planned(PART1);
    safe(&p.program, 0.0);
    // Drilling honours the slower first 2 and last 8 mm, and goes through.
    let drill: Vec<_> = p.program.steps().filter(|s| matches!(s.op, Op::Linear) && s.end.axes[0] == 20.0 && s.end.axes[1] == 60.0).collect();
    assert_eq!(drill[0].end.axes[2], -2.0);
    assert!(drill[2].end.axes[2] < -30.0);
    let feeds: Vec<f64> = p.program.steps().filter_map(|s| if let Op::Feed { linear, .. } = s.op { Some(linear) } else { None }).collect();
    assert!(feeds.contains(&15.0) && feeds.contains(&30.0) && feeds.contains(&22.5), "{feeds:?}");
    // The stop at the reamed bottom and nothing left of allowance in the finishing of the pocket.
    let z = p.program.steps().filter(|s| s.op.feeds() && s.end.axes[0] > 50.0).map(|s| s.end.axes[2]).fold(0.0, f64::min);
    assert_eq!(z, -30.0);
}

#[test]
fn roughing_keeps_its_allowances() {
    let rough = PART1.replace(",#93,#94)", ",#93)");
    let (p, _) = planned(&rough);
    let mut inside = false;
    let mut low = 0.0f64;
    let mut x: f64 = 1e9;
    for s in p.program.steps() {
        if let Op::Begin { marker: Marker::Workingstep, text, .. } = s.op {
            inside = text.contains("ROUGH POCKET");
        }
        if inside && s.op.feeds() {
            low = low.min(s.end.axes[2]);
            x = x.min(s.end.axes[0]);
        }
    }
    assert_eq!(low, -29.5);
    // Wall at X45, radius 10, allowance 1.
    assert!((x - 56.0).abs() < 1e-6, "{x}");
}

#[test]
fn explicit_paths_of_the_published_points() {
    // Rows 1 to 9 of part 1 in the frame of the part, written as tool paths by hand.
    let list = "(0.,0.,30.),(90.,10.,15.),(90.,10.,5.),(90.,30.,5.),(90.,50.,5.),(90.,70.,5.),(90.,90.,5.),(90.,110.,5.),(75.,110.,5.)";
    let mut extra = String::new();
    let mut ids = Vec::new();
    for (i, p) in list.split("),").enumerate() {
        let id = 9001 + i;
        // The feature lies at Z5.
        let c: Vec<f64> = p.trim_matches(['(', ')']).split(',').map(|v| v.parse().expect("a number")).collect();
        extra += &format!("#{id}=CARTESIAN_POINT('',({:?},{:?},{:?}));\n", c[0], c[1], c[2] - 5.0);
        ids.push(format!("#{id}"));
    }
    let approach = format!("#9100=POLYLINE('',({}));\n#9101=CUTTER_LOCATION_TRAJECTORY(.T.,.APPROACH.,SPEED_NAME(.RAPID.),$,$,$,#9100,$,$);\n", ids[..2].join(","));
    let cut = format!("#9102=POLYLINE('',({}));\n#9103=CUTTER_LOCATION_TRAJECTORY(.T.,.CONTACT.,$,$,$,$,#9102,$,$);\n#9104=TOOLPATH_LIST((#9101,#9103));\n", ids[1..].join(","));
    let text = PART1.replace("PLANE_FINISH_MILLING($,$,", "PLANE_FINISH_MILLING(#9104,$,").replace("ENDSEC;\nEND-ISO", &format!("{extra}{approach}{cut}ENDSEC;\nEND-ISO"));
    let (p, _) = planned(&text);
    let (process, _, _) = gr_planner::process(PART1.as_bytes(), FileId(0), None);
    let points = gr_planner::reference::ufsc2016::points(&process.expect("a process"), FileId(0)).expect("points");
    let mut path = Vec::new();
    let mut inside = false;
    for s in p.program.steps() {
        match s.op {
            Op::Begin { marker: Marker::Feature, .. } => inside = path.is_empty(),
            Op::Close(Marker::Feature) => inside = false,
            Op::Rapid | Op::Linear if inside => path.push(s.end.xyz()),
            _ => {}
        }
    }
    for point in &points[1..9] {
        assert!(path.iter().any(|p| (0..3).all(|i| (p[i] - point.at[i]).abs() < 1e-9)), "{:?} in {path:?}", point.at);
    }
}

#[test]
fn nothing_is_left_out_silently() {
    // A V profile without walls, a step, a slot up and down: the original wrote four blocks.
    let tee = SLOT.replace("SQUARE_U_PROFILE(#64,#58,#60,0.6202494859828215,#62,0.6202494859828215)", "TEE_PROFILE(#64,0.,0.,#58,#60,#60,#58,#60,#60)");
    let (_, out) = planned(&tee);
    for words in ["the chamfers at its open end", "the chamfers between its neck and its bar", "its bar, no workingstep has a T_SLOT_MILL"] {
        assert!(out.iter().any(|d| d.code == code::PLAN_UNREACHABLE_CORNER && d.message.contains(words)), "{out:#?}");
    }
    let no_tool = SLOT.replace("5.0,#33,#26,#31", "5.0,#33,$,#31");
    let out = faults(&no_tool);
    let missing = out.iter().find(|d| d.code == code::PLAN_MISSING_VALUE).expect("told");
    let span = missing.labels[0].span;
    assert_eq!(&no_tool[span.range()], "$");
}

#[test]
fn a_vertical_slot_is_a_slot() {
    let vertical = SLOT.replace("#56=DIRECTION('Linear Path Direction - HORIZONTAL',(1.0,0.0,0.0))", "#56=DIRECTION('',(0.0,1.0,0.0))");
    let (p, _) = planned(&vertical);
    assert!(p.program.len() > 50);
}

#[test]
fn the_v_slot_keeps_to_its_section() {
    let (p, _) = planned(SLOT);
    safe(&p.program, 20.0);
    // Half width of the true section at a depth.
    let half = |y: f64| {
        let (xc, yc, r, a) = (3.970_800_f64, 5.0, 2.0, 0.620_249_485_982_821_5_f64);
        let tangency = yc + r * a.sin();
        if y <= tangency { 5.0 + (7.0 - y) * a.tan() } else { xc + (r * r - (y - yc) * (y - yc)).max(0.0).sqrt() }
    };
    let mut tool = 0;
    let mut lowest = [0.0f64; 3];
    for s in p.program.steps() {
        if let Op::ToolChange(n) = s.op {
            tool = n as usize;
        }
        if !s.op.feeds() {
            continue;
        }
        let (out, y) = ((s.end.axes[1] - 50.0).abs(), 20.0 - s.end.axes[2]);
        lowest[tool] = lowest[tool].max(y);
        if tool == 1 && y > 0.0 {
            assert!(out + 1.5 <= half(y) + 1e-3, "face mill: {s:?}");
        }
        if tool == 2 && y > 0.0 {
            // The ball touches the section nowhere beyond the tolerance.
            for k in 0..=90 {
                let t = f64::from(k).to_radians();
                let (x, d) = (out + 2.0 * t.cos(), y - 2.0 + 2.0 * t.sin());
                assert!(d <= 0.0 || x <= half(d.min(7.0)) + 2e-3, "ball: {s:?} {x} {d}");
            }
        }
    }
    // The face mill takes the flat part of the floor, the ball all of it.
    assert!((lowest[1] - 7.0).abs() < 1e-3 && (lowest[2] - 7.0).abs() < 1e-9, "{lowest:?}");
}

/// Programs for machines with three axes refuse tilted tools, and take everything else.
#[test]
fn written_as_g_code() {
    use gr_backends::{NoSources, rs274ngc};
    for (text, upright) in [(SLOT, true), (HOLE, true), (PART1, true), (PART2, false)] {
        let (p, _) = planned(text);
        let written = rs274ngc::emit(&p.program, &rs274ngc::Options::default(), &NoSources);
        assert_eq!(written.is_ok(), upright);
        if let Ok(e) = written {
            assert!(e.text.contains("M8") && e.text.contains("M3") && e.text.trim_end().ends_with("M2"), "{}", e.text);
        }
    }
}
