//! Features and paths that a height field cannot judge: undercuts, threads, back boring, contact paths, and what the
//! planner honours of strategies and tools.

mod judge;

use gr_ir::{Op, Turn};
use gr_planner::{Options, Planned, plan};
use gr_text::{Diagnostic, FileId, Severity, code};
use judge::cases::{BLOCK, TOP};
use judge::part::{Mill, Part};
use judge::special::{back, tee, thread};

fn planned(p: &Part) -> (Planned, Vec<Diagnostic>) {
    let (planned, out) = plan(p.text().as_bytes(), FileId(0), &Options::default());
    let errors: Vec<_> = out.iter().filter(|d| d.severity == Severity::Error).collect();
    assert!(errors.is_empty(), "{errors:#?}\n{}", p.text());
    (planned.expect("a program"), out)
}

fn refused(p: &Part) -> Vec<Diagnostic> {
    let (planned, out) = plan(p.text().as_bytes(), FileId(0), &Options::default());
    assert!(planned.is_none(), "{out:#?}");
    out.into_iter().filter(|d| d.severity == Severity::Error).collect()
}

fn text(p: &Planned) -> String {
    gr_ir::text::print(&p.program, false)
}

const OPEN: &str = "OPEN_SLOT_END_TYPE()";
const ROUND: &str = "RADIUSED_SLOT_END_TYPE()";

#[test]
fn t_slots_are_cut_from_their_open_end() {
    let (p, _) = planned(&tee([OPEN, ROUND], 16.0, 4.0));
    let mut tool = 0;
    for s in p.program.steps() {
        if let Op::ToolChange(n) = s.op {
            tool = n;
        }
        let (a, b) = (s.start.xyz(), s.end.xyz());
        if tool == 2 && s.op.moves() && a[2].min(b[2]) < TOP {
            // Down and up only outside the part: the cutter is wider than the neck.
            let upright = (a[2] - b[2]).abs() > 1e-9;
            assert!(!upright || b[0] <= -8.0, "{s:?}");
            // In the bar only at feed.
            assert!(upright || !matches!(s.op, Op::Rapid), "{s:?}");
        }
    }
    insta::assert_snapshot!(text(&p));
    assert!(refused(&tee([ROUND, ROUND], 16.0, 4.0)).iter().any(|d| d.message.contains("open end")));
    assert!(refused(&tee([OPEN, OPEN], 18.0, 4.0)).iter().any(|d| d.message.contains("16 mm wide")));
    assert!(refused(&tee([OPEN, OPEN], 16.0, 5.0)).iter().any(|d| d.message.contains("4 mm high")));
    // A lower cutter takes the bar on several levels.
    let (low, _) = planned(&tee([OPEN, OPEN], 12.0, 2.0));
    let floors: std::collections::BTreeSet<i64> =
        low.program.steps().filter(|s| matches!(s.op, Op::Linear)).map(|s| (s.end.axes[2] * 1000.0).round() as i64).collect();
    assert!(floors.contains(&4000) && floors.contains(&2000), "{floors:?}");
}

/// A hole 12 mm deep by a strategy: feed, mm/s, and spindle speed, rpm, with the height where each stretch ends; what is told.
fn drilled_by(strategy: &str) -> (Vec<[f64; 3]>, Vec<String>) {
    let mut p = Part::new(BLOCK);
    let tool = p.tool("ENDMILL", 8.0, 0.0, None);
    let s = p.add(format!("DRILLING_TYPE_STRATEGY({strategy})"));
    let (t, f) = (p.technology(), p.functions());
    let op = p.add(format!("DRILLING($,$,'op',5.,$,#{tool},#{t},#{f},$,8.,$,$,$,#{s})"));
    let (size, bottom) = (p.length(8.0), p.add("FLAT_HOLE_BOTTOM()".into()));
    p.machine("ROUND_HOLE", &[op], [30.0, 20.0, TOP], Some(8.0), &format!(",#{size},$,#{bottom}"));
    let (planned, out) = plan(p.text().as_bytes(), FileId(0), &Options::default());
    let told = out.iter().filter(|d| !["E0440", "E0488"].contains(&d.code.def().code)).map(|d| format!("{} {}", d.code.def().code, d.message));
    let mut stretches = Vec::new();
    if let Some(planned) = planned {
        let mut c = planned.program.cursor();
        while let Some(v) = c.next() {
            if v.op == Op::Linear {
                stretches.push([v.state.feed, v.state.spindles[0].speed, TOP - v.end.axes[2]]);
            }
        }
    }
    (stretches, told.collect())
}

/// Full feed is 10 mm/s, full speed 1200 rpm.
#[test]
fn reduced_stretches_of_holes() {
    let none: Vec<String> = Vec::new();
    let of = |strategy: &str| drilled_by(strategy);
    // reduced cut, reduced feed and depth at the start, then at the end.
    assert_eq!(of("$,$,$,$,$,$"), (vec![[10.0, 1200.0, 8.0]], none.clone()));
    assert_eq!(of("0.75,0.5,2.,0.5,0.25,3."), (vec![[5.0, 900.0, 2.0], [10.0, 1200.0, 5.0], [2.5, 600.0, 8.0]], none.clone()));
    // Each alone.
    assert_eq!(of("0.75,$,2.,$,$,$"), (vec![[10.0, 900.0, 2.0], [10.0, 1200.0, 8.0]], none.clone()));
    assert_eq!(of("$,0.5,2.,$,$,$"), (vec![[5.0, 1200.0, 2.0], [10.0, 1200.0, 8.0]], none.clone()));
    assert_eq!(of("$,$,$,0.5,$,3."), (vec![[10.0, 1200.0, 5.0], [10.0, 600.0, 8.0]], none.clone()));
    // As long as the hole, and longer.
    for length in ["8.", "20."] {
        assert_eq!(of(&format!("0.75,0.5,{length},$,$,$")), (vec![[5.0, 900.0, 8.0]], none.clone()));
        assert_eq!(of(&format!("$,$,$,0.75,0.5,{length}")), (vec![[5.0, 900.0, 8.0]], none.clone()));
    }
    // They meet, or overlap: the lower of the two, and that is told.
    assert_eq!(of("0.75,0.5,5.,0.5,0.25,3."), (vec![[5.0, 900.0, 5.0], [2.5, 600.0, 8.0]], none.clone()));
    assert_eq!(of("0.75,0.5,5.,0.75,0.5,5."), (vec![[5.0, 900.0, 3.0], [5.0, 900.0, 5.0], [5.0, 900.0, 8.0]], none));
    let (stretches, told) = of("0.5,0.5,5.,0.75,0.25,6.");
    assert_eq!(stretches, [[5.0, 600.0, 2.0], [2.5, 600.0, 5.0], [2.5, 900.0, 8.0]]);
    assert!(told.len() == 1 && told[0].contains("from 2 to 5 mm the lower feed and speed of the two hold"), "{told:?}");
    // What reduces nothing, and what would stand still.
    for (strategy, wanted) in [("$,$,2.,$,$,$", "neither feed nor speed"), ("0.5,$,0.,$,$,$", "a stretch of 0 mm")] {
        let (stretches, told) = of(strategy);
        assert_eq!(stretches, [[10.0, 1200.0, 8.0]]);
        assert!(told.len() == 1 && told[0].starts_with("E0489") && told[0].contains(wanted), "{told:?}");
    }
    for strategy in ["$,0.,2.,$,$,$", "0.,$,2.,$,$,$", "$,$,$,$,0.,2.", "$,$,$,-0.5,$,2.", "$,0.5,-2.,$,$,$"] {
        let (stretches, told) = of(strategy);
        assert!(stretches.is_empty() && told.len() == 1 && told[0].starts_with("E0443"), "{strategy}: {told:?}");
    }
}

#[test]
fn threads_are_milled_in_a_helix() {
    let (p, _) = planned(&thread(true, "right hand", "CLIMB", 2.0));
    insta::assert_snapshot!(text(&p));
    // 2 mm pitch over 9 mm by a single row: five turns, right-hand, climb: counter-clockwise and up.
    let turns: Vec<_> = p.program.steps().filter_map(|s| if let Op::Arc(a) = s.op { Some((a.turns, s.end.axes[2] - s.start.axes[2], s.start.xyz())) } else { None }).collect();
    let full: Vec<_> = turns.iter().filter(|t| (t.1.abs() - 2.0).abs() < 1e-9).collect();
    assert_eq!(full.len(), 5);
    assert!(full.iter().all(|t| t.0 > 0 && t.1 > 0.0 && (t.2[0] - 34.0).abs() < 1e-9), "{full:?}");
    let rise = |p: Part| {
        let (p, _) = planned(&p);
        let s: Vec<(i32, f64)> = p.program.steps().filter_map(|s| if let Op::Arc(a) = s.op { Some((a.turns.signum(), s.end.axes[2] - s.start.axes[2])) } else { None }).collect();
        let full: Vec<_> = s.into_iter().filter(|t| (t.1.abs() - 2.0).abs() < 1e-9).collect();
        (full.len(), full[0].0, full[0].1 > 0.0)
    };
    assert_eq!(rise(thread(true, "left hand", "CLIMB", 2.0)), (5, 1, false));
    assert_eq!(rise(thread(true, "right hand", "CONVENTIONAL", 2.0)), (5, -1, false));
    assert_eq!(rise(thread(true, "right hand", "CLIMB", 12.0)), (1, 1, true));
    assert_eq!(rise(thread(false, "right hand", "CLIMB", 2.0)), (5, -1, false));
}

#[test]
fn back_boring_steps_aside_through_its_hole() {
    let (p, out) = planned(&back("10.", true));
    assert!(out.iter().any(|d| d.code == code::PLAN_TAKES_TURNS));
    insta::assert_snapshot!(text(&p));
    let mut stands = true;
    for s in p.program.steps() {
        match s.op {
            Op::SpindleTurn { turn, .. } => stands = turn == Turn::Stop,
            op if op.moves() => {
                let (a, b) = (s.start.xyz(), s.end.xyz());
                // Through the hole only stepped aside, and with the spindle standing.
                if a[2].min(b[2]) < TOP && a[2].max(b[2]) > 3.0 + 1e-9 {
                    assert!(stands && a[0] < 30.0 && b[0] < 30.0, "{s:?}");
                }
            }
            _ => {}
        }
    }
    let lowest_feed = p.program.steps().filter(|s| s.op == Op::Linear).map(|s| s.end.axes[2]).fold(f64::MAX, f64::min);
    assert!(lowest_feed < 0.0);
    assert!(refused(&back("$", true)).iter().any(|d| d.message.contains("previous_diameter")));
    assert!(refused(&back("10.", false)).iter().any(|d| d.message.contains("direction_for_spindle_orientation")));
    assert!(refused(&back("8.", true)).iter().any(|d| d.message.contains("does not pass")));
}

fn contact(kind: &str, edge: f64, normals: &str) -> Part {
    let mut p = Part::new(BLOCK);
    let tool = p.tool(kind, 10.0, edge, None);
    let points: Vec<String> = [(10.0, 10.0), (50.0, 10.0)].iter().map(|q| format!("#{}", p.point([q.0, q.1, -2.0]))).collect();
    let line = p.add(format!("POLYLINE('',({}))", points.join(",")));
    let n = p.add(normals.into());
    let ns = p.add(format!("POLYLINE('',(#{n},#{n}))"));
    let base = p.add(format!("CURVE_WITH_NORMAL_VECTOR(#{line},#{ns})"));
    let path = p.add(format!("CUTTER_CONTACT_TRAJECTORY(.T.,.CONTACT.,$,$,$,.T.,#{base},$,.SIDE.)"));
    let list = p.add(format!("TOOLPATH_LIST((#{path}))"));
    let (t, f) = (p.technology(), p.functions());
    let op = p.add(format!("FREEFORM_OPERATION(#{list},$,'op',5.,$,#{tool},#{t},#{f},$,$,$,$)"));
    p.machine("TOOLPATH_FEATURE", &[op], [0.0, 0.0, TOP], Some(0.0), "");
    p
}

#[test]
fn contact_paths_become_tip_paths() {
    let ends = |p: &Part| -> Vec<[f64; 3]> {
        let (p, _) = planned(p);
        p.program.steps().filter(|s| s.op == Op::Linear).map(|s| s.end.xyz()).collect()
    };
    let near = |p: [f64; 3], q: [f64; 3]| (0..3).all(|i| (p[i] - q[i]).abs() < 1e-9);
    // A wall that looks to +y: a flat tool stands its radius off, at the height of the contact.
    let at = ends(&contact("ENDMILL", 0.0, "CARTESIAN_POINT('',(0.,1.,0.))"));
    assert!(near(*at.last().expect("moves"), [50.0, 15.0, TOP - 2.0]), "{at:?}");
    // A floor under a ball: the tip is the contact.
    let at = ends(&contact("BALL_ENDMILL", 5.0, "CARTESIAN_POINT('',(0.,0.,1.))"));
    assert!(near(*at.last().expect("moves"), [50.0, 10.0, TOP - 2.0]), "{at:?}");
    // A slope of 45 degrees under a ball.
    let at = ends(&contact("BALL_ENDMILL", 5.0, "CARTESIAN_POINT('',(0.,1.,1.))"));
    let h = 5.0 * std::f64::consts::FRAC_1_SQRT_2;
    assert!(near(*at.last().expect("moves"), [50.0, 10.0 + h, TOP - 2.0 + h - 5.0]), "{at:?}");
    // The same under a bull nose: 2 mm of rounding, 3 mm of flat.
    let at = ends(&contact("BULLNOSE_ENDMILL", 2.0, "CARTESIAN_POINT('',(0.,1.,1.))"));
    let h = 2.0 * std::f64::consts::FRAC_1_SQRT_2;
    assert!(near(*at.last().expect("moves"), [50.0, 10.0 + h + 3.0, TOP - 2.0 + h - 2.0]), "{at:?}");
    let out = refused(&contact("ENDMILL", 0.0, "CARTESIAN_POINT('',(0.,0.,0.))"));
    assert!(out.iter().any(|d| d.message.contains("no direction")));
}

#[test]
fn strokes_are_joined_as_the_strategy_says() {
    let retracts = |connection: &str| {
        let c = judge::cases::face(&format!("BIDIRECTIONAL($,$,$,.LEFT.,{connection})"), 16.0, 0.0);
        let (p, _) = planned(&c.part);
        p.program.steps().filter(|s| s.op == Op::Rapid && s.end.axes[2] > s.start.axes[2]).count()
    };
    assert!(retracts(".LIFT_SHIFT_PLUNGE.") > retracts(".STRAGHTLINE.") + 2);
    let c = judge::cases::face("BIDIRECTIONAL($,$,$,.LEFT.,.LOOP_BACK.)", 16.0, 0.0);
    assert!(planned(&c.part).1.iter().any(|d| d.code == code::PLAN_NO_EFFECT && d.message.contains("stroke_connection")));
}

/// The path in the feature's frame does not depend on where the feature lies or how it is turned.
#[test]
fn tilted_features_have_the_same_path() {
    let make = |z: [f64; 3], x: [f64; 3], at: [f64; 3]| {
        let mut p = Part::new([60.0, 60.0, 60.0]);
        let t = p.tool("ENDMILL", 6.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", t, 2.0, 3.0));
        let place = p.turned(at, z, x);
        let (w, l) = (p.length(20.0), p.length(30.0));
        let profile = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{w},#{l})"));
        let bottom = p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into());
        let f = p.feature_at("CLOSED_POCKET", &[op], place, Some(4.0), &format!(",(),$,#{bottom},$,$,#{profile}"));
        p.step(f, op);
        let (planned, _) = planned(&p);
        let frame = planned.process.steps()[0].feature.frame;
        let feeds: Vec<[f64; 3]> = planned.program.steps().filter(|s| s.op.feeds()).map(|s| frame.inverse_point(s.end.xyz())).collect();
        (feeds, planned)
    };
    let (upright, _) = make([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [30.0, 30.0, 60.0]);
    let (side, p) = make([0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [30.0, 0.0, 30.0]);
    assert_eq!(upright.len(), side.len());
    for (a, b) in upright.iter().zip(&side) {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-9), "{a:?} {b:?}");
    }
    assert!(p.program.steps().filter(|s| s.op.feeds()).all(|s| s.end.tool_axis == Some([0.0, -1.0, 0.0])));
}

#[test]
fn a_face_inside_the_raw_part_is_told() {
    let c = judge::cases::face("BIDIRECTIONAL($,$,$,.LEFT.,$)", 16.0, 0.0);
    assert!(!planned(&c.part).1.iter().any(|d| d.code == code::PLAN_OVERRUNS_PART));
    let small = c.part.text().replace("NUMERIC_PARAMETER('length',40.0,'mm')", "NUMERIC_PARAMETER('length',30.0,'mm')");
    let (_, out) = plan(small.as_bytes(), FileId(0), &Options::default());
    let told = out.iter().find(|d| d.code == code::PLAN_OVERRUNS_PART).expect("told");
    assert!(told.message.contains("10.0000 mm"), "{}", told.message);
}

fn along(pieces: &[&str]) -> Part {
    let mut p = Part::new(BLOCK);
    let tool = p.tool("ENDMILL", 10.0, 0.0, None);
    let line: Vec<String> = [(10.0, 10.0), (50.0, 10.0)].iter().map(|q| format!("#{}", p.point([q.0, q.1, -2.0]))).collect();
    let line = p.add(format!("POLYLINE('',({}))", line.join(",")));
    let path = p.add(format!("CUTTER_LOCATION_TRAJECTORY(.T.,.CONTACT.,$,$,$,.T.,#{line},$,$)"));
    let (near, far) = (p.point([-10.0, 10.0, 8.0]), p.point([70.0, 10.0, 8.0]));
    let all: Vec<String> = pieces
        .iter()
        .map(|t| if t.is_empty() { format!("#{path}") } else { format!("#{}", p.add(t.replace("@near", &format!("#{near}")).replace("@far", &format!("#{far}")))) })
        .collect();
    let list = p.add(format!("TOOLPATH_LIST(({}))", all.join(",")));
    let (t, f) = (p.technology(), p.functions());
    let op = p.add(format!("FREEFORM_OPERATION(#{list},$,'op',5.,$,#{tool},#{t},#{f},$,$,$,$)"));
    p.machine("TOOLPATH_FEATURE", &[op], [0.0, 0.0, TOP], Some(0.0), "");
    p
}

/// Ends of the moves at feed, over the top of the part.
fn feeds(p: &Part) -> Vec<[f64; 3]> {
    let (p, _) = planned(p);
    p.program.steps().filter(|s| s.op.feeds()).map(|s| s.end.xyz()).map(|q| [q[0], q[1], q[2] - TOP]).collect()
}

fn same(a: &[[f64; 3]], b: &[[f64; 3]]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(p, q)| (0..3).all(|i| (p[i] - q[i]).abs() < 1e-9))
}

#[test]
fn approach_and_lift_paths_lead_to_the_path_beside_them() {
    let angle = |role: &str, at: &str| format!("AP_LIFT_PATH_ANGLE(.T.,.{role}.,$,$,$,@{at},$,30.,4.)");
    let all = feeds(&along(&[&angle("APPROACH", "near"), "", &angle("LIFT", "far")]));
    let (c, s) = (4.0 * 30f64.to_radians().cos(), 2.0);
    let wanted = [[10.0 - c, 10.0, -2.0 + s], [10.0, 10.0, -2.0], [50.0, 10.0, -2.0], [50.0 + c, 10.0, -2.0 + s], [70.0, 10.0, 8.0]];
    assert!(same(&all, &wanted), "{all:?}");
    // On an arc: the last point before it lies on the circle, square to the way there.
    let all = feeds(&along(&["AP_LIFT_PATH_TANGENT(.T.,.APPROACH.,$,$,$,@near,$,5.)", ""]));
    let (fix, touch, centre) = ([-10.0, 8.0], [all[0][0], all[0][2]], [10.0, 3.0]);
    let d = [touch[0] - centre[0], touch[1] - centre[1]];
    assert!((d[0].hypot(d[1]) - 5.0).abs() < 1e-9 && (d[0] * (touch[0] - fix[0]) + d[1] * (touch[1] - fix[1])).abs() < 1e-9, "{all:?}");
    assert!(same(&all[1..], &[[10.0, 10.0, -2.0], [50.0, 10.0, -2.0]]), "{all:?}");
    // Without a path beside it, or from inside the circle, there is no way.
    for bad in [vec!["AP_LIFT_PATH_TANGENT(.T.,.APPROACH.,$,$,$,@near,$,50.)", ""], vec!["AP_LIFT_PATH_ANGLE(.T.,.LIFT.,$,$,$,@near,$,30.,4.)", ""]] {
        assert!(refused(&along(&bad)).iter().any(|d| d.message.contains("no way leads")), "{bad:?}");
    }
}

#[test]
fn axis_trajectories_are_coordinates_of_the_setup() {
    let axes = |names: &str, columns: &[&[f64]]| {
        let mut p = along(&[""]);
        let curves: Vec<String> = columns
            .iter()
            .map(|c| {
                let points: Vec<String> = c.iter().map(|v| format!("#{}", p.add(format!("CARTESIAN_POINT('',({v:?}))")))).collect();
                format!("#{}", p.add(format!("POLYLINE('',({}))", points.join(","))))
            })
            .collect();
        let path = p.add(format!("AXIS_TRAJECTORY(.T.,.CONTACT.,$,$,$,.T.,({names}),({}))", curves.join(",")));
        let list = p.add(format!("TOOLPATH_LIST((#{path}))"));
        let tool = p.tool("ENDMILL", 8.0, 0.0, None);
        let (t, f) = (p.technology(), p.functions());
        let op = p.add(format!("FREEFORM_OPERATION(#{list},$,'op',5.,$,#{tool},#{t},#{f},$,$,$,$)"));
        p.steps.clear();
        p.machine("TOOLPATH_FEATURE", &[op], [5.0, 5.0, TOP], Some(0.0), "");
        p
    };
    let all = feeds(&axes("'X','Y','Z'", &[&[1.0, 2.0], &[3.0, 4.0], &[10.0, 11.0]]));
    assert!(same(&all, &[[1.0, 3.0, 10.0 - TOP], [2.0, 4.0, 11.0 - TOP]]), "{all:?}");
    assert!(refused(&axes("'X','Y'", &[&[1.0, 2.0], &[3.0, 4.0]])).iter().any(|d| d.message.contains("not where it is known")));
    assert!(refused(&axes("'X','B'", &[&[1.0, 2.0], &[3.0, 4.0]])).iter().any(|d| d.message.contains("only X, Y and Z")));
    assert!(refused(&axes("'X','Y'", &[&[1.0, 2.0], &[3.0]])).iter().any(|d| d.message.contains("different numbers")));
}

#[test]
fn thread_drilling_goes_out_on_the_helix() {
    let make = |forward: &str, hand: &str| {
        let mut p = Part::new(BLOCK);
        let dim = p.add("MILLING_TOOL_DIMENSION(8.,59.,$,12.,0.,$,$)".into());
        let body = p.add(format!("TWIST_DRILL(#{dim},2,.RIGHT.,.F.,$)"));
        let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
        let tool = p.add(format!("MILLING_CUTTING_TOOL('thriller',#{body},(#{cut}),$,$,$)"));
        let op = p.drill("THREAD_DRILLING", tool, None, &format!(",{forward}"));
        let place = p.place([0.0; 3]);
        let area = p.add(format!("PARTIAL_AREA_DEFINITION(6.,#{place},$)"));
        let [fit, form, hand] = ["6H", "M", hand].map(|t| p.add(format!("DESCRIPTIVE_PARAMETER('p','{t}')")));
        let count = p.add("NUMERIC_PARAMETER('threads per inch',12.7,'1/in')".into());
        let doc = p.add("SPECIFICATION((),'ISO 724',$,$)".into());
        let f = p.feature("CATALOGUE_THREAD", &[op], [30.0, 20.0, TOP], Some(6.0), &format!(",#{area},(),.T.,$,#{fit},#{form},10.,#{count},#{hand},#{doc}"));
        p.step(f, op);
        p
    };
    let helix = |p: &Part| {
        let (p, _) = planned(p);
        let arcs = p.program.steps().filter_map(|s| if let Op::Arc(a) = s.op { Some((a.turns.signum(), s.end.axes[2] - s.start.axes[2])) } else { None });
        arcs.filter(|a| (a.1.abs() - 2.0).abs() < 1e-9).collect::<Vec<_>>()
    };
    // A right-hand thread upwards is counter-clockwise; the edge is as long as the thread: one turn.
    assert_eq!(helix(&make(".F.", "right hand")).iter().map(|a| (a.0, a.1 > 0.0)).collect::<Vec<_>>(), [(1, true)]);
    assert_eq!(helix(&make(".F.", "left hand")).iter().map(|a| (a.0, a.1 > 0.0)).collect::<Vec<_>>(), [(-1, true)]);
    let both: Vec<_> = helix(&make(".T.", "right hand")).iter().map(|a| (a.0, a.1 > 0.0)).collect();
    assert_eq!(both, [[(-1, false); 3], [(1, true); 3]].concat());
    insta::assert_snapshot!(text(&planned(&make(".F.", "right hand")).0));
}

#[test]
fn tool_directions_along_the_feature_are_none_of_their_own() {
    let make = |direction: &str, approach: &str| {
        let c = judge::cases::rectangular_pocket("$", approach, 6.0, Some(4.0));
        let text = c.part.text();
        let id = 9000;
        let extra = format!("#{id}={direction};
#9001=DIRECTION('',(0.,0.,2.));
#9002=DIRECTION('',(0.,1.,1.));
");
        text.replace("MILLING($,$,'op'", &format!("MILLING($,#{id},'op'")).replacen("#1=PROJECT", &format!("{extra}#1=PROJECT"), 1)
    };
    let out = |t: String| {
        let (p, out) = plan(t.as_bytes(), FileId(0), &Options::default());
        (p, out.into_iter().filter(|d| d.severity == Severity::Error).map(|d| d.message).collect::<Vec<_>>())
    };
    assert_eq!(out(make("THREE_AXES_TILTED_TOOL(#9001)", "$")).1, [""; 0]);
    assert!(out(make("THREE_AXES_TILTED_TOOL(#9002)", "$")).1[0].contains("THREE_AXES_TILTED_TOOL"));
    // Two axes at a time: straight down, no slope.
    let (p, errors) = out(make("TWO_AXES()", "$"));
    assert_eq!(errors, [""; 0]);
    let all = |s: &gr_ir::Step<'_>| (0..3).filter(|i| (s.start.axes[*i] - s.end.axes[*i]).abs() > 1e-9).count();
    assert!(p.expect("a program").program.steps().filter(|s| s.op == Op::Linear).all(|s| all(&s) < 3));
    assert!(out(make("TWO_AXES()", "PLUNGE_RAMP($,6.)")).1[0].contains("TWO_AXES"));
}

/// A tool as wide as its hole, pocket or floor goes down and up: what is left of its rings is smaller than any control
/// follows, and LinuxCNC refuses arcs of no radius.
#[test]
fn a_tool_that_fits_exactly_writes_no_arc_without_a_radius() {
    let bottoms = ["FLAT_HOLE_BOTTOM()", "THROUGH_BOTTOM_CONDITION()", "SPHERICAL_HOLE_BOTTOM(4.)", "FLAT_WITH_RADIUS_HOLE_BOTTOM(4.)"];
    for (bottom, kind, edge) in bottoms.into_iter().flat_map(|b| [(b, "ENDMILL", 0.0), (b, "BALL_ENDMILL", 3.0)]) {
        for over in [0.0, 1e-4, 1e-3, 2e-3, 5e-3] {
            let mut p = Part::new(BLOCK);
            let tool = p.tool(kind, if edge > 0.0 { 2.0 * edge } else { 8.0 }, edge, None);
            let keyword = if edge > 0.0 { "BOTTOM_AND_SIDE_FINISH_MILLING" } else { "BOTTOM_AND_SIDE_ROUGH_MILLING" };
            let op = p.mill(&Mill::new(keyword, tool, 2.0, 3.0));
            let (size, bottom) = (p.length(8.0 + over), p.add(bottom.replace("4.", &format!("{:?}", 4.0 + over / 2.0))));
            p.machine("ROUND_HOLE", &[op], [30.0, 20.0, TOP], Some(8.0), &format!(",#{size},$,#{bottom}"));
            let (planned, out) = planned(&p);
            for s in planned.program.steps() {
                if let Op::Arc(a) = s.op {
                    let at = [s.start, s.end].map(|p| (p.axes[0] - a.center[0]).hypot(p.axes[1] - a.center[1]));
                    assert!(at.iter().all(|r| *r > 0.00127), "{at:?} {}", p.text());
                }
            }
            // Nothing but what the form of the edge leaves at the foot stays.
            assert!(out.iter().all(|d| !d.message.contains("spots")), "{out:#?}");
        }
    }
}

/// The deepest place of a program, mm.
fn lowest(p: &Part) -> f64 {
    planned(p).0.program.steps().filter(|s| s.op.moves()).map(|s| s.end.axes[2]).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_ball_that_fits_exactly_reaches_the_floor_of_a_slot() {
    for (depth, d) in [(4.0, 4.0), (3.0, 4.0), (6.0, 5.0)] {
        let mut p = Part::new(BLOCK);
        let tool = p.tool("BALL_ENDMILL", d, d / 2.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", tool, 1.0, 1.0));
        let (length, width) = (p.length(80.0), p.length(d));
        let x = p.direction([1.0, 0.0, 0.0]);
        let (path, section) = (p.add(format!("LINEAR_PATH($,#{length},#{x})")), p.add(format!("ROUNDED_U_PROFILE($,#{width})")));
        let ends = [p.add(OPEN.into()), p.add(OPEN.into())];
        p.machine("SLOT", &[op], [-10.0, 20.0, TOP], Some(depth), &format!(",#{path},#{section},(#{},#{})", ends[0], ends[1]));
        assert!((lowest(&p) - (TOP - depth)).abs() < 1e-3, "{}", lowest(&p));
        assert!(planned(&p).1.iter().all(|d| d.code != code::PLAN_UNREACHABLE_CORNER));
    }
}

#[test]
fn bottoms_of_holes_are_as_they_are_written() {
    let part = |bottom: &str| {
        let mut p = Part::new(BLOCK);
        let tool = p.tool("BALL_ENDMILL", 6.0, 3.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", tool, 2.0, 2.0));
        let (size, bottom) = (p.length(20.0), p.add(bottom.into()));
        p.machine("ROUND_HOLE", &[op], [30.0, 20.0, TOP], Some(11.0), &format!(",#{size},$,#{bottom}"));
        p
    };
    for radius in [10.0, 12.0, 30.0] {
        let p = part(&format!("SPHERICAL_HOLE_BOTTOM({radius:?})"));
        let (planned, _) = planned(&p);
        assert!((lowest(&p) - (TOP - 11.0)).abs() < 2e-2, "{}", lowest(&p));
        // The ball of the tool keeps inside that of the floor, and comes near it all the way out.
        let centre = TOP - 11.0 + radius;
        let room = |x: f64, y: f64, z: f64| radius - 3.0 - (x - 30.0).hypot(y - 20.0).hypot(z + 3.0 - centre);
        let cut: Vec<[f64; 3]> = planned.program.steps().filter(|s| s.op.moves() && s.op != Op::Rapid).map(|s| s.end.xyz()).collect();
        let foot = centre - ((radius - 3.0).powi(2) - 49.0_f64).max(0.0).sqrt();
        assert!(cut.iter().filter(|p| p[2] + 3.0 < foot).all(|p| room(p[0], p[1], p[2]) > -2e-3));
        let near = cut.iter().filter(|p| room(p[0], p[1], p[2]) < 0.02).map(|p| (p[0] - 30.0).hypot(p[1] - 20.0)).fold(0.0, f64::max);
        assert!((near - 7.0).abs() < 0.3, "{radius} {near}");
    }
    for (bottom, at, words) in [
        ("SPHERICAL_HOLE_BOTTOM(6.)", "6.", "radius of #"),
        ("FLAT_WITH_RADIUS_HOLE_BOTTOM(10.5)", "10.5", "corner_radius of #"),
    ] {
        let p = part(bottom);
        let errors = refused(&p);
        assert!(errors.len() == 1 && errors[0].code == code::PLAN_BAD_SIZE && errors[0].message.contains(words), "{errors:#?}");
        assert_eq!(&p.text()[errors[0].labels[0].span.range()], at);
    }
}

#[test]
fn a_boss_outside_its_pocket_is_refused() {
    let part = |at: [f64; 3]| {
        let mut p = Part::new(BLOCK);
        let tool = p.tool("ENDMILL", 4.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 2.0, 3.0));
        let profile = judge::cases::rectangle_profile(&mut p, 20.0, 16.0);
        let round = judge::cases::circle_profile(&mut p, 5.0);
        let boss = judge::cases::boss(&mut p, at, &round, 6.0, 0.0);
        judge::cases::closed(&mut p, 6.0, &profile, &boss, None, "PLANAR_POCKET_BOTTOM_CONDITION()", None, Some(2.0), &[op], [40.0, 20.0]);
        p
    };
    planned(&part([42.0, 20.0, TOP]));
    // Partly in the wall.
    planned(&part([31.0, 20.0, TOP]));
    let errors = refused(&part([4.0, 0.0, TOP]));
    assert!(errors.len() == 1 && errors[0].message.contains("BOSS: all of it lies outside"), "{errors:#?}");
}

/// A counterbore at a place by these operations: a hole through the block, and a wider one.
fn counterbore(p: &mut Part, operations: &[usize], at: [f64; 3]) -> usize {
    let (small, wide) = (p.length(6.0), p.length(12.0));
    let (through, flat) = (p.add("THROUGH_BOTTOM_CONDITION()".into()), p.add("FLAT_HOLE_BOTTOM()".into()));
    let a = p.feature("ROUND_HOLE", &[], [0.0; 3], Some(TOP), &format!(",#{small},$,#{through}"));
    let b = p.feature("ROUND_HOLE", &[], [0.0; 3], Some(5.0), &format!(",#{wide},$,#{flat}"));
    p.feature("COUNTERBORE_HOLE", operations, at, None, &format!(",(#{a},#{b})"))
}

#[test]
fn a_mill_belongs_to_the_elements_of_a_compound_that_no_drill_makes() {
    for d in [4.0, 8.0] {
        let mut p = Part::new(BLOCK);
        let (drill, mill) = (p.tool("TWIST_DRILL", 6.0, 0.0, Some(59.0)), p.tool("ENDMILL", d, 0.0, None));
        let ops = [p.drill("DRILLING", drill, None, ""), p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", mill, 2.0, 3.0))];
        let whole = counterbore(&mut p, &ops, [30.0, 20.0, TOP]);
        ops.iter().for_each(|o| p.step(whole, *o));
        let (planned, _) = planned(&p);
        let (mut tool, mut low) = (0, f64::INFINITY);
        for s in planned.program.steps() {
            match s.op {
                Op::ToolChange(n) => tool = n,
                op if op.moves() && tool == 2 => low = low.min(s.end.axes[2]),
                _ => {}
            }
        }
        assert!((low - (TOP - 5.0)).abs() < 1e-9, "{low}");
    }
}

/// Where holes are drilled.
fn drilled_at(p: &Part) -> Vec<[i64; 2]> {
    let down = |s: &gr_ir::Step<'_>| s.op == Op::Linear && s.end.axes[2] < s.start.axes[2];
    let mut all: Vec<[i64; 2]> = planned(p).0.program.steps().filter(down).map(|s| [0, 1].map(|i| s.end.axes[i].round() as i64)).collect();
    all.dedup();
    all
}

#[test]
fn a_pattern_repeats_a_compound_feature_with_all_its_elements() {
    let part = |pattern: &dyn Fn(&mut Part, usize) -> (&'static str, String)| {
        let mut p = Part::new(BLOCK);
        let drill = p.tool("TWIST_DRILL", 6.0, 0.0, Some(59.0));
        let op = p.drill("DRILLING", drill, None, "");
        let whole = counterbore(&mut p, &[], [10.0, 0.0, 0.0]);
        let (head, rest) = pattern(&mut p, whole);
        p.machine(head, &[op], [20.0, 20.0, TOP], None, &rest);
        p
    };
    let circle = part(&|_, w| ("CIRCULAR_PATTERN", format!(",#{w},90.,4,(),(),$,0.")));
    assert_eq!(drilled_at(&circle), [[30, 20], [20, 30], [10, 20], [20, 10]]);
    let rows = part(&|p, w| {
        let (by, along) = (p.length(15.0), p.direction([1.0, 0.0, 0.0]));
        ("RECTANGULAR_PATTERN", format!(",#{w},#{by},#{along},1,2,$,$,(),()"))
    });
    assert_eq!(drilled_at(&rows), [[30, 20], [45, 20]]);
    let general = part(&|p, w| {
        let (a, b) = (p.place([0.0; 3]), p.place([5.0, 10.0, 0.0]));
        ("GENERAL_PATTERN", format!(",#{w},(#{a},#{b})"))
    });
    assert_eq!(drilled_at(&general), [[20, 20], [25, 30]]);
}

/// A cone of 12 mm over a hole of 6 mm, sunk by 90 degrees: right to the hole's edge with its tip 6 mm deep.
#[test]
fn countersinks_are_as_deep_as_their_cone_is_wide() {
    let told = |depth: Option<f64>, bottom: &str| {
        let mut p = Part::new(BLOCK);
        let (drill, sink) = (p.tool("TWIST_DRILL", 6.0, 0.0, Some(59.0)), p.tool("COUNTERSINK", 16.0, 0.0, Some(45.0)));
        let ops = [p.drill("DRILLING", drill, None, ""), p.drill("COUNTER_SINKING", sink, depth, "")];
        let (small, wide, low) = (p.length(6.0), p.length(12.0), p.length(6.0));
        let (taper, through, own) = (p.add(format!("DIAMETER_TAPER(#{low})")), p.add("THROUGH_BOTTOM_CONDITION()".into()), p.add(bottom.into()));
        let a = p.feature("ROUND_HOLE", &[], [0.0; 3], Some(TOP), &format!(",#{small},$,#{through}"));
        let b = p.feature("ROUND_HOLE", &[], [0.0; 3], Some(3.0), &format!(",#{wide},#{taper},#{own}"));
        p.machine("COUNTERSUNK_HOLE", &ops, [30.0, 20.0, TOP], None, &format!(",(#{a},#{b})"));
        let out = planned(&p).1;
        out.iter().filter(|d| d.severity == Severity::Warning).map(|d| format!("{} {}", d.code.def().code, d.message)).collect::<Vec<_>>()
    };
    for bottom in ["FLAT_HOLE_BOTTOM()", "THROUGH_BOTTOM_CONDITION()"] {
        assert_eq!(told(None, bottom), Vec::<String>::new());
        assert_eq!(told(Some(6.0), bottom), Vec::<String>::new());
        let short = told(Some(3.0), bottom);
        assert!(short.len() == 1 && short[0].starts_with("E0453") && short[0].contains("opens a cone of 6 mm"), "{short:?}");
        let beyond = told(Some(7.0), bottom);
        assert!(!beyond.is_empty() && beyond.iter().all(|m| m.starts_with("E0447")), "{beyond:?}");
    }
}

/// A step or an open pocket along the front of a block of 80 by 60, with a boss of 8 mm that stands `gap` from it.
fn boss_at_the_edge(open: bool, gap: f64) -> Part {
    let mut p = Part::new([80.0, 60.0, 20.0]);
    let tool = p.tool("ENDMILL", 6.0, 0.0, None);
    let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 4.0, 3.0));
    let (place, at, size) = (p.place([40.0, 4.0 + gap, 20.0]), p.place([0.0, 0.0, -4.0]), p.length(8.0));
    let (plane, circle) = (p.add(format!("PLANE('',#{at})")), p.add(format!("CIRCULAR_CLOSED_PROFILE($,#{size})")));
    let boss = p.add(format!("BOSS('boss',$,(),#{place},#{plane},#{circle},$)"));
    if open {
        let wall = p.polyline(&[(70.0, 0.0), (70.0, 25.0), (10.0, 25.0), (10.0, 0.0)]);
        let (wall, floor) = (p.add(format!("GENERAL_PROFILE($,#{wall})")), p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into()));
        p.machine("OPEN_POCKET", &[op], [0.0, 0.0, 20.0], Some(4.0), &format!(",(#{boss}),$,#{floor},$,$,#{wall},$"));
    } else {
        let (length, back) = (p.length(80.0), p.direction([-1.0, 0.0, 0.0]));
        let course = p.add(format!("LINEAR_PATH($,#{length},#{back})"));
        p.machine("STEP", &[op], [80.0, 25.0, 20.0], Some(4.0), &format!(",#{course},$,(#{boss})"));
    }
    p
}

#[test]
fn a_tool_goes_round_a_boss_that_stands_near_an_open_side() {
    for open in [true, false] {
        for gap in [0.5, 1.0, 2.5] {
            let (planned, out) = planned(&boss_at_the_edge(open, gap));
            // Between boss and edge there is no room: it passes outside of the part.
            let front = planned.program.steps().filter(|s| s.op.feeds()).map(|s| s.end.xyz()[1]).fold(0.0, f64::min);
            assert!(front < gap - 3.0, "open {open}, gap {gap}: {front}");
            let left: Vec<&str> = out.iter().filter(|d| d.code == code::PLAN_UNREACHABLE_CORNER).map(|d| d.message.as_str()).collect();
            // The corners of the pocket alone.
            let corners = 2.0 * 9.0 * (1.0 - std::f64::consts::FRAC_PI_4);
            let wanted = format!("2 spots, {corners:.2}");
            assert!(if open { left.len() == 1 && left[0].contains(&wanted) } else { left.is_empty() }, "{left:?}");
        }
    }
}

/// What two bosses leave between them where a tool of this radius does not fit.
fn between(radius: f64, distance: f64, tool: f64) -> f64 {
    let half = (distance / 2.0 / (radius + tool)).acos();
    let height = ((radius + tool).powi(2) - distance * distance / 4.0).sqrt();
    distance * height - 2.0 * half * radius * radius - (std::f64::consts::PI - 2.0 * half) * tool * tool
}

/// A face of 60 by 40 with bosses; more than walls is cut where the operation says it.
fn face_with_bosses(at: &[[f64; 2]], strategy: &str, side: Option<f64>) -> Part {
    let mut p = Part::new([60.0, 40.0, 20.0]);
    let tool = p.tool("ENDMILL", 8.0, 0.0, None);
    let bosses: Vec<String> = at
        .iter()
        .map(|q| {
            let (place, low, size) = (p.place([q[0], q[1], 20.0]), p.place([0.0, 0.0, -4.0]), p.length(10.0));
            let (plane, circle) = (p.add(format!("PLANE('',#{low})")), p.add(format!("CIRCULAR_CLOSED_PROFILE($,#{size})")));
            format!("#{}", p.add(format!("BOSS('boss',$,(),#{place},#{plane},#{circle},$)")))
        })
        .collect();
    let keyword = if side.is_some() { "BOTTOM_AND_SIDE_ROUGH_MILLING" } else { "PLANE_ROUGH_MILLING" };
    let op = p.mill(&Mill::new(keyword, tool, 2.0, 5.0).strategy(strategy).leave(side.unwrap_or(0.0), 0.0));
    let (length, along, width) = (p.length(60.0), p.direction([1.0, 0.0, 0.0]), p.number(40.0));
    let (course, profile) = (p.add(format!("LINEAR_PATH($,#{length},#{along})")), p.add(format!("LINEAR_PROFILE($,#{width})")));
    p.machine("PLANAR_FACE", &[op], [0.0, 0.0, 20.0], Some(4.0), &format!(",#{course},#{profile},$,({})", bosses.join(",")));
    p
}

#[test]
fn bosses_of_a_face_are_kept_and_what_stays_between_them_is_told() {
    for strategy in ["BIDIRECTIONAL($,$,$,.LEFT.,$)", "CONTOUR_PARALLEL($,$,$,$)"] {
        let (_, out) = planned(&face_with_bosses(&[[20.0, 20.0], [35.0, 20.0]], strategy, None));
        let left: Vec<&str> = out.iter().filter(|d| d.code == code::PLAN_UNREACHABLE_CORNER).map(|d| d.message.as_str()).collect();
        let wanted = format!("1 spots, {:.3}", between(5.0, 15.0, 4.0));
        assert!(left.len() == 1 && left[0].contains(&wanted) && left[0].contains("X27.5000 Y20.0000"), "{left:?} {wanted}");
        // Far enough from each other nothing is left.
        let (_, out) = planned(&face_with_bosses(&[[20.0, 20.0], [39.0, 20.0]], strategy, None));
        assert!(!out.iter().any(|d| d.code == code::PLAN_UNREACHABLE_CORNER));
        let errors = refused(&face_with_bosses(&[[100.0, 20.0]], strategy, None));
        assert!(errors.len() == 1 && errors[0].message.contains("BOSS: all of it lies outside"), "{errors:#?}");
        // One beside the face, where the tool runs over the edge, is kept too.
        let beside = planned(&face_with_bosses(&[[66.0, 20.0]], strategy, None)).0;
        let near = beside.program.steps().filter(|s| s.op.feeds() && s.end.xyz()[2] < 19.0).map(|s| (s.end.xyz()[0] - 66.0).hypot(s.end.xyz()[1] - 20.0));
        assert!(near.fold(f64::INFINITY, f64::min) > 9.0 - 1e-3, "{strategy}");
        // What is to stay on its walls stays.
        let (planned, _) = planned(&face_with_bosses(&[[30.0, 20.0]], strategy, Some(1.0)));
        let nearest = |s: gr_ir::Step<'_>| if s.op.feeds() && s.end.xyz()[2] < 19.0 { (s.end.xyz()[0] - 30.0).hypot(s.end.xyz()[1] - 20.0) } else { f64::INFINITY };
        let nearest = planned.program.steps().map(nearest).fold(f64::INFINITY, f64::min);
        assert!((nearest - 10.0).abs() < 1e-3, "{strategy} {nearest}");
    }
}

/// What the numbers of an approach or an allowance make impossible is told where they are written.
#[test]
fn impossible_approaches_and_allowances_are_told_at_their_numbers() {
    let pocket = |approach: &str, side: f64| -> (Vec<Diagnostic>, String) {
        let mut p = Part::new(BLOCK);
        let tool = p.tool("ENDMILL", 6.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 2.0, 3.0).approach(approach).leave(side, 0.0));
        let (w, l) = (p.length(24.0), p.length(30.0));
        let (profile, bottom) = (p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{w},#{l})")), p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into()));
        p.machine("CLOSED_POCKET", &[op], [30.0, 20.0, TOP], Some(4.0), &format!(",(),$,#{bottom},$,$,#{profile}"));
        let text = p.text();
        let (made, out) = plan(text.as_bytes(), FileId(0), &Options::default());
        let errors: Vec<Diagnostic> = out.into_iter().filter(|d| d.severity == Severity::Error).collect();
        assert_eq!(made.is_none(), !errors.is_empty());
        (errors, text)
    };
    for (approach, side, at, words) in [
        ("PLUNGE_RAMP($,0.)", 0.0, "0.)", "angle of #"),
        ("PLUNGE_HELIX($,-2.,3.)", 0.0, "-2.", "radius of #"),
        ("PLUNGE_HELIX($,2.,91.)", 0.0, "91.", "0.06 to 90 degrees"),
        ("PLUNGE_ZIGZAG($,3.,0.)", 0.0, "0.)", "width of #"),
        ("AP_RETRACT_TANGENT($,0.)", 0.0, "0.)", "radius of #"),
        ("PLUNGE_RAMP($,3.)", 15.0, "15.", "with it there is no room for the tool of 6 mm"),
        ("PLUNGE_RAMP($,3.)", -0.5, "-0.5", "zero or more"),
    ] {
        let (errors, text) = pocket(approach, side);
        assert_eq!(errors.len(), 1, "{approach}: {errors:#?}");
        assert_eq!(errors[0].code, code::PLAN_BAD_SIZE, "{approach}");
        assert!(errors[0].message.contains(words), "{}", errors[0].message);
        let start = errors[0].labels[0].span.start as usize;
        assert!(text[start..].starts_with(at), "{approach}: {}", &text[start..start + 10]);
    }
    // A pocket too narrow for the tool itself is not the fault of its allowance.
    assert!(pocket("PLUNGE_RAMP($,3.)", 0.2).0.is_empty());
}

/// Walls that go apart end in sharp corners out in the air: the tool comes past the mouth all the same.
#[test]
fn nothing_is_left_at_the_mouth_of_a_pocket_that_opens() {
    let mut p = Part::new([80.0, 60.0, 20.0]);
    let tool = p.tool("ENDMILL", 8.0, 0.0, None);
    let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 4.0, 3.0));
    let wall = p.polyline(&[(68.0, 0.0), (60.0, 22.0), (20.0, 22.0), (12.0, 0.0)]);
    let (wall, floor) = (p.add(format!("GENERAL_PROFILE($,#{wall})")), p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into()));
    p.machine("OPEN_POCKET", &[op], [0.0, 0.0, 20.0], Some(4.0), &format!(",(),$,#{floor},$,$,#{wall},$"));
    let left: Vec<String> = planned(&p).1.into_iter().filter(|d| d.code == code::PLAN_UNREACHABLE_CORNER).map(|d| d.message).collect();
    assert!(left.len() == 1 && left[0].contains("2 spots"), "{left:?}");
}
