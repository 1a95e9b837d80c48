//! Tools and features that do not fit each other, and attributes that contradict each other: told at the attribute.

mod judge;

use gr_planner::{Options, Planned, plan};
use gr_text::{Diagnostic, FileId, Severity};
use judge::cases::*;
use judge::part::{Mill, Part};
use judge::special::*;

fn planned(text: &str) -> (Option<Planned>, Vec<Diagnostic>) {
    let (p, mut out) = plan(text.as_bytes(), FileId(0), &Options::default());
    out.retain(|d| d.severity != Severity::Hint);
    (p, out)
}

/// What is said: code, the text it points at, and a part of the message.
fn told(p: &Part, code: &str, at: &str, words: &str) {
    let text = p.text();
    let (planned, out) = planned(&text);
    let found = out.iter().find(|d| d.code.def().code == code && d.message.contains(words));
    let found = found.unwrap_or_else(|| panic!("no {code} {words}: {out:#?}"));
    assert_eq!(text[found.primary().1.range()].trim(), at, "{out:#?}");
    assert_eq!(planned.is_none(), out.iter().any(|d| d.severity == Severity::Error), "{out:#?}");
    assert_eq!(out.len(), 1, "{out:#?}");
}

fn good(p: &Part) -> Planned {
    let (planned, out) = planned(&p.text());
    assert!(out.is_empty(), "{out:#?}");
    planned.expect("a plan")
}

#[test]
fn a_countersink_has_the_angle_of_its_cone() {
    for tool in ["COUNTERSINK", "second edition"] {
        for taper in ["ANGLE_TAPER(45.)", "DIAMETER_TAPER(@)"] {
            good(&sunk(tool, 45.0, taper));
        }
    }
    told(&sunk("COUNTERSINK", 30.0, "ANGLE_TAPER(45.)"), "E0444", "30.0", "45 degrees to its axis, that of the tool 30");
    told(&sunk("second edition", 30.0, "ANGLE_TAPER(45.)"), "E0444", "60.0", "that of the tool 30");
    told(&sunk("COUNTERSINK", 60.0, "ANGLE_TAPER(45.)"), "E0442", "60.0", "that of the tool 60");
    told(&sunk("COUNTERSINK", 45.0, "ANGLE_TAPER(20.)"), "E0442", "45.0", "20 degrees to its axis");
    told(&sunk("COUNTERSINK", 45.0, "ANGLE_TAPER(60.)"), "E0444", "45.0", "60 degrees to its axis");
}

#[test]
fn a_flat_nose_of_a_countersink_counts() {
    let deepest = |nose: &str| {
        let text = sunk("second edition", 45.0, "ANGLE_TAPER(45.)").text().replace(",90.0,$,40.)", &format!(",90.0,{nose},40.)"));
        let p = planned(&text).0.expect("a plan");
        let mut tool = 0;
        let ends = p.program.steps().filter_map(|s| {
            if let gr_ir::Op::ToolChange(n) = s.op {
                tool = n;
            }
            (tool == 2 && s.op.moves()).then_some(s.end.axes[2])
        });
        ends.fold(f64::INFINITY, f64::min)
    };
    assert!((deepest("$") - (TOP - 6.0)).abs() < 1e-9 && (deepest("2.") - (TOP - 5.0)).abs() < 1e-9);
}

#[test]
fn threads_keep_to_their_hand_size_and_pitch() {
    let (tap, mill) = ("TAP(@,2,.RIGHT.,.F.,$)", "THREAD_MILL(@,2,.RIGHT.,.F.,$)");
    for tool in [tap, mill, "TAPPING_CUTTING_TOOL"] {
        for hand in ["RIGHT", "right hand", "Right-handed", "RH"] {
            good(&defined_thread(tool, hand, "2.", 0.0));
        }
        for hand in ["LINKS", "xyz", "", "left or right"] {
            told(&defined_thread(tool, hand, "2.", 0.0), "E0443", &format!("'{hand}'"), "it must be 'right' or 'left'");
        }
        told(&defined_thread(tool, "RIGHT", "-2.", 0.0), "E0443", "-2.", "its_parameter_value");
        told(&defined_thread(tool, "RIGHT", "0.", 0.0), "E0443", "0.", "its_parameter_value");
    }
    for hand in ["LH", "L", "LEFT"] {
        good(&defined_thread(mill, hand, "2.", 0.0));
        good(&defined_thread("TAP(@,2,.LEFT.,.F.,$)", hand, "2.", 0.0));
    }
    told(&defined_thread(tap, "LH", "2.", 0.0), "E0444", ".RIGHT.", "the thread is left-handed, its tap right-handed");
    told(&defined_thread("TAP(@,2,.LEFT.,.F.,$)", "RIGHT", "2.", 0.0), "E0444", ".LEFT.", "its tap left-handed");
    told(&defined_thread("TAP(@,2,$,.F.,$)", "LEFT", "2.", 0.0), "E0444", "-20.", "the spindle turns clockwise");
    told(&defined_thread("TAPPING_CUTTING_TOOL", "RIGHT", "1.5", 0.0), "E0444", "2.", "the pitch of its tool is 2 mm, that of the thread 1.5 mm");
    for d in [8.0, 14.5, 20.0] {
        told(&thread_by(tap, d, "RIGHT", "2.", 0.0, true), "E0444", &format!("{d:?}"), "it is a thread of 16 mm");
    }
    for d in [14.5, 15.0, 15.9] {
        told(&thread_by(mill, d, "RIGHT", "2.", 0.0, true), "E0441", &format!("{d:?}"), "does not fit the hole of");
    }
    told(&thread_by(tap, 16.0, "RIGHT", "2.", 0.0, false), "E0444", ".F.", "a tap cuts inner threads");
}

#[test]
fn a_thread_begins_where_its_area_says() {
    let lowest = |p: &Part| good(p).program.steps().filter(|s| s.op.moves()).map(|s| s.end.axes[2]).fold(f64::INFINITY, f64::min);
    let mill = "THREAD_MILL(@,2,.RIGHT.,.F.,$)";
    let (a, b) = (lowest(&defined_thread(mill, "RIGHT", "2.", 0.0)), lowest(&defined_thread(mill, "RIGHT", "2.", 3.0)));
    assert!((a - (TOP - 8.0)).abs() < 1e-9 && (b - (TOP - 11.0)).abs() < 1e-9, "{a} {b}");
    let p = defined_thread("TAP(@,2,.RIGHT.,.F.,$)", "RIGHT", "2.", 3.0);
    let (planned, out) = planned(&p.text());
    assert!(planned.is_some() && out.len() == 1 && out[0].code.def().code == "E0447", "{out:#?}");
    assert!(out[0].message.contains("its thread begins 3 mm below the top"), "{out:#?}");
    // Above the thread there is nothing to cut it in.
    let (planned, out) = self::planned(&defined_thread(mill, "RIGHT", "2.", -4.0).text());
    assert!(planned.is_none() && out.len() == 1 && out[0].message.contains("4 mm above the thread"), "{out:#?}");
}

#[test]
fn a_disc_is_no_higher_than_the_bar_of_its_slot() {
    for tool in ["T_SLOT_MILL", "second edition"] {
        good(&tee_of(tool, 4.0, [0.0; 3]));
        good(&tee_of(tool, 2.0, [0.0; 3]));
        told(&tee_of(tool, 9.0, [0.0; 3]), "E0444", "9.0", "its bar is 4 mm high, the disc of its tool 9 mm");
    }
    good(&tee(["OPEN_SLOT_END_TYPE()"; 2], 14.0, 4.0));
    told(&tee_of("T_SLOT_MILL", 4.0, [0.5, 0.0, 0.0]), "E0447", &corner(0.5), "the corners of its bar have a radius of 0.5 mm");
    let (planned, out) = planned(&tee_of("T_SLOT_MILL", 4.0, [0.0, 0.5, 0.75]).text());
    let said: Vec<&str> = out.iter().map(|d| d.code.def().code).collect();
    assert!(planned.is_some() && said == ["E0442"; 2], "{out:#?}");
    assert!(out[0].message.contains("at its open end, 0.5 mm wide at 45 degrees") && out[1].message.contains("between its neck and its bar, 0.75 mm"), "{out:#?}");
}

#[test]
fn a_side_mill_is_as_high_as_it_is_wide() {
    let with = |wide: &str| {
        let text = slot("$", "$", 5.0, 12.0, "OPEN_SLOT_END_TYPE()").part.text();
        let body = text.lines().find(|l| l.contains("=ENDMILL(")).unwrap_or_default().to_string();
        let side = body.replace("=ENDMILL(", "=SIDE_MILL(").replace(");", &format!(",{wide});"));
        planned(&text.replace(&body, &side).replace(",$,80.,", ",$,$,")).1
    };
    assert!(with("5.").is_empty(), "{:#?}", with("5."));
    let said = with("3.");
    assert!(said.len() == 1 && said[0].code.def().code == "E0440" && said[0].message.contains("is 3 mm long"), "{said:#?}");
}

/// The reference to the radius of [`tee_of`].
fn corner(radius: f64) -> String {
    let text = tee_of("T_SLOT_MILL", 4.0, [radius, 0.0, 0.0]).text();
    let row = text.lines().find(|l| l.contains("TEE_PROFILE")).unwrap_or_default();
    row.split(',').nth(5).unwrap_or_default().into()
}

#[test]
fn an_arc_is_as_high_as_its_slot_is_deep() {
    let slot = |sweep: &'static str, depth: f64| {
        let section = move |p: &mut Part| {
            let r = p.length(3.0);
            format!("PARTIAL_CIRCULAR_PROFILE($,#{r},{sweep})")
        };
        section_slot("arc", "BALL_ENDMILL", 5.0, 2.5, "BOTTOM_AND_SIDE_FINISH_MILLING", depth, section, |_, _| 0.0).part
    };
    for sweep in ["141.0576", "160.", "180."] {
        good(&slot(sweep, 2.0));
    }
    told(&slot("60.", 2.0), "E0443", "60.", "it is 0.4019 mm high, the slot 2 mm deep");
    told(&slot("0.", 2.0), "E0443", "0.", "above 0 and below 360");
    told(&slot("220.", 3.5), "E0443", "220.", "lean inwards");
}

#[test]
fn an_outside_profile_is_swept_down() {
    let with = |direction: [f64; 3], distance: f64| {
        let mut p = Part::new(BLOCK);
        let t = p.tool("ENDMILL", 8.0, 0.0, None);
        let o = p.mill(&Mill::new("SIDE_ROUGH_MILLING", t, 2.5, 4.8).strategy("CONTOUR_PARALLEL(0.3,.T.,$,$)"));
        let profile = rectangle_profile(&mut p, 36.0, 20.0);
        let profile = p.add(profile);
        let (down, long) = (p.direction(direction), p.length(distance));
        let path = p.add(format!("LINEAR_PATH($,#{long},#{down})"));
        p.machine("GENERAL_OUTSIDE_PROFILE", &[o], [30.0, 20.0, TOP], Some(4.0), &format!(",#{path},#{profile}"));
        p
    };
    good(&with([0.0, 0.0, -1.0], 4.0));
    let leaning = with([0.5, 0.0, -0.8], 4.0).text();
    let (p, out) = planned(&leaning);
    assert!(p.is_none() && out.len() == 1 && out[0].code.def().code == "E0482" && out[0].message.contains("leans"), "{out:#?}");
    let (p, out) = plan(with([0.0, 0.0, -1.0], 2.0).text().as_bytes(), FileId(0), &Options::default());
    let hint = out.iter().find(|d| d.code.def().code == "E0489").expect("told");
    assert!(p.is_some() && hint.message.starts_with("distance of") && hint.message.contains("it is 2 mm, the depth of the feature 4 mm"), "{out:#?}");
}

#[test]
fn a_boring_tool_that_may_not_be_drawn_back_stops_first() {
    good(&bored(".F.", ".F."));
    good(&bored(".T.", ".T."));
    told(&bored(".F.", ".T."), "E0444", ".T.", "may not be drawn back while it turns");
}

#[test]
fn a_tool_does_not_taper_the_other_way() {
    good(&tapered(5.0));
    told(&tapered(-5.0), "E0443", "-5.0", "taper_angle");
}

#[test]
fn one_bad_direction_is_one_message() {
    for (z, x, words) in [([0.0; 3], [1.0, 0.0, 0.0], "direction_ratios"), ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], "ref_direction")] {
        let mut p = Part::new(BLOCK);
        let t = p.tool("ENDMILL", 6.0, 0.0, None);
        let o = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", t, 2.5, 3.0));
        let place = p.turned([30.0, 20.0, TOP], z, x);
        let profile = rectangle_profile(&mut p, 30.0, 20.0);
        let (profile, floor) = (p.add(profile), p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into()));
        let f = p.feature_at("CLOSED_POCKET", &[o], place, Some(4.0), &format!(",(),$,#{floor},$,$,#{profile}"));
        p.step(f, o);
        // The same frame for the security plane.
        let text = p.text();
        let plane = text.lines().find(|l| l.contains("PLANE('security'")).unwrap_or_default().to_string();
        let text = text.replace(&plane, &format!("{}('security',#{place});", plane.split('(').next().unwrap_or_default()));
        let (planned, out) = planned(&text);
        assert!(planned.is_none() && out.len() == 1 && out[0].code.def().code == "E0443" && out[0].message.contains(words), "{out:#?}");
    }
}

#[test]
fn numbers_below_zero_have_one_message() {
    let part = rectangular_pocket("$", "$", 6.0, Some(4.0)).part.text();
    let one = |from: &str, to: &str, code: &str, words: &str| {
        assert!(part.contains(from), "{from}");
        let (_, out) = plan(part.replace(from, to).as_bytes(), FileId(0), &Options::default());
        let found: Vec<&Diagnostic> = out.iter().filter(|d| d.severity == Severity::Error || d.message.contains(words)).collect();
        assert!(found.len() == 1 && found[0].code.def().code == code && found[0].message.contains(words), "{out:#?}");
    };
    one("MILLING_TECHNOLOGY(0.01,", "MILLING_TECHNOLOGY(-0.01,", "E0443", "feedrate");
    one("MILLING_TECHNOLOGY(0.01,.TCP.,$,-20.,$", "MILLING_TECHNOLOGY(0.01,.TCP.,-2.,$,$", "E0443", "cutspeed");
    one("MILLING_TECHNOLOGY(0.01,.TCP.,$,-20.,$", "MILLING_TECHNOLOGY($,.TCP.,$,-20.,20.", "E0443", "feedrate_per_tooth");
    one("WORKPIECE('part',$,0.01", "WORKPIECE('part',$,-0.02", "E0443", "global_tolerance");
    one("WORKPIECE('part',$,0.01", "WORKPIECE('part',$,0.", "E0489", "global_tolerance");
    one("WORKPIECE('part',$,0.01", "WORKPIECE('part',$,0.0001", "E0489", "0.001 mm is kept");
}
