//! Every 2½D feature under the judge: nothing is cut that is to stay, everything is cut that some tool of the plan
//! reaches, and no rapid goes through material.

mod judge;


use judge::cases::*;

#[test]
fn pockets_by_every_strategy() {
    for s in STRATEGIES {
        for (d, corner) in [(6.0, Some(3.0)), (8.0, None)] {
            good(&rectangular_pocket(s, "$", d, corner));
        }
    }
    good(&ngon_pocket("$", "$", 6.0, true));
    good(&through_pocket(6.0));
}

#[test]
fn pockets_by_every_approach() {
    for a in APPROACHES {
        for s in ["$", "BIDIRECTIONAL($,$,$,.LEFT.,$)"] {
            good(&rectangular_pocket(s, a, 6.0, Some(4.0)));
            good(&general_pocket(s, a, 5.0));
        }
    }
}

#[test]
fn pockets_with_bosses() {
    for s in STRATEGIES {
        good(&pocket_with_bosses(s, "$", 5.0, 0.0, 0.0));
    }
    good(&pocket_with_bosses("$", "$", 5.0, 2.0, 0.0));
}

#[test]
fn faces() {
    for s in STRATEGIES {
        good(&face(s, 16.0, 0.0));
    }
}

/// No way in or out of a face goes through its bosses; one that finds no room is replaced, and that is said.
#[test]
fn ways_in_and_out_keep_off_the_bosses_of_a_face() {
    let ways = ["PLUNGE_RAMP($,6.)", "PLUNGE_HELIX($,3.,5.)", "AP_RETRACT_ANGLE($,20.,6.)", "AP_RETRACT_TANGENT($,4.)"];
    for s in ["$", "UNIDIRECTIONAL($,$,$,$)", "BIDIRECTIONAL($,$,$,.LEFT.,$)", "CONTOUR_PARALLEL($,$,.CCW.,.CLIMB.)"] {
        for way in ways {
            let j = good(&face_with_boss(s, way, "$", 6.0, [30.0, 20.0]));
            let said = j.out.iter().any(|d| d.code == gr_text::code::PLAN_APPROACH_CHANGED);
            // Straight lines that begin at the boss have no slope before them.
            assert!(said || way != ways[2] || s.starts_with("CONTOUR"), "{s} {way}");
            good(&face_with_boss(s, "$", way, 6.0, [30.0, 20.0]));
        }
    }
}

/// A boss near the edge of a face: the tool goes round it outside, whatever the strategy.
#[test]
fn behind_a_boss_near_the_edge_a_face_is_cut() {
    for s in STRATEGIES.iter().filter(|s| !s.starts_with("CENTER")) {
        let j = good(&face_with_boss(s, "$", "$", 10.0, [30.0, 6.2]));
        let left: Vec<_> = j.out.iter().filter(|d| d.code == gr_text::code::PLAN_UNREACHABLE_CORNER).collect();
        assert!(left.is_empty(), "{s}: {left:?}");
    }
}

#[test]
fn slots() {
    for end in ["OPEN_SLOT_END_TYPE()", "RADIUSED_SLOT_END_TYPE()", "FLAT_SLOT_END_TYPE(@,@)"] {
        for (d, w) in [(5.0, 12.0), (6.0, 6.0), (5.0, 7.0)] {
            for s in ["$", "CONTOUR_PARALLEL($,$,.CW.,.CONVENTIONAL.)", "BIDIRECTIONAL($,$,$,.LEFT.,$)", "CENTER_MILLING($,$)"] {
                good(&slot(s, "$", d, w, end));
            }
        }
    }
    for whole in [true, false] {
        good(&curved_slot("$", 5.0, 5.0, whole, "RADIUSED_SLOT_END_TYPE()"));
        good(&curved_slot("$", 4.0, 7.0, whole, "RADIUSED_SLOT_END_TYPE()"));
    }
}

#[test]
fn holes() {
    for bottom in ["FLAT_HOLE_BOTTOM()", "THROUGH_BOTTOM_CONDITION()"] {
        good(&milled_hole("$", "$", 8.0, bottom, None));
    }
    for bottom in ["THROUGH_BOTTOM_CONDITION()", "CONICAL_HOLE_BOTTOM(59.,$)", "FLAT_HOLE_BOTTOM()"] {
        good(&drilled(bottom, 8.0, 59.0));
    }
}

#[test]
fn outside_profiles() {
    good(&outside("$", "GENERAL_OUTSIDE_PROFILE", "BOTTOM_AND_SIDE_ROUGH_MILLING", 8.0));
}

#[test]
fn bosses() {
    for k in ["BOTTOM_AND_SIDE_ROUGH_MILLING", "BOTTOM_AND_SIDE_FINISH_MILLING", "SIDE_FINISH_MILLING"] {
        good(&outside("CONTOUR_PARALLEL($,.T.,$,$)", "BOSS", k, 8.0));
    }
    good(&outside("CONTOUR_PARALLEL($,.T.,$,$)", "GENERAL_OUTSIDE_PROFILE", "SIDE_ROUGH_MILLING", 8.0));
}

#[test]
fn walls_that_lean() {
    for s in ["$", "BIDIRECTIONAL($,$,$,.LEFT.,$)"] {
        good(&sloped_pocket(s, "$", 6.0, 10.0, "BOTTOM_AND_SIDE_FINISH_MILLING"));
        good(&sloped_pocket(s, "$", 6.0, 20.0, "BOTTOM_AND_SIDE_ROUGH_MILLING"));
    }
    good(&pocket_with_bosses("$", "$", 5.0, 2.0, 10.0));
    good(&step("$", 8.0, 15.0));
    good(&milled_hole("$", "$", 8.0, "FLAT_HOLE_BOTTOM()", Some(20.0)));
}

#[test]
fn rounded_floors() {
    for (d, edge, radius) in [(6.0, 3.0, 3.0), (8.0, 2.0, 2.0), (6.0, 0.0, 2.0), (8.0, 1.0, 2.0), (6.0, 3.0, 0.5), (12.0, 6.0, 0.5), (12.0, 6.0, 2.0)] {
        good(&rounded_pocket("$", d, edge, radius));
    }
    good(&rounded_pocket("BIDIRECTIONAL($,$,$,.LEFT.,$)", 6.0, 3.0, 3.0));
}

#[test]
fn floors_that_are_not_flat() {
    for (kind, d, e) in [("BALL_ENDMILL", 6.0, 3.0), ("ENDMILL", 6.0, 0.0), ("BULLNOSE_ENDMILL", 6.0, 1.0)] {
        good(&ball_floor(kind, d, e));
        good(&cone_floor(kind, d, e, 59.0));
        good(&cone_floor(kind, d, e, 90.0));
    }
}

#[test]
fn woodruff_ends() {
    for (kind, d, e, w, r) in [("ENDMILL", 6.0, 0.0, 6.0, 12.0), ("ENDMILL", 5.0, 0.0, 9.0, 12.0), ("BALL_ENDMILL", 6.0, 3.0, 6.0, 12.0), ("BULLNOSE_ENDMILL", 6.0, 1.0, 6.0, 3.0)] {
        good(&woodruff(kind, d, e, w, r));
    }
}

#[test]
fn sections() {
    let u = |p: &mut judge::part::Part, w: f64, r: f64, a: f64| {
        let (w, r) = (p.length(w), p.length(r));
        format!("SQUARE_U_PROFILE($,#{w},#{r},{a:?},#{r},{a:?})")
    };
    let tan = 20f64.to_radians().tan();
    let lean = move |s: f64, grow: f64| {
        let out = s.abs() - 5.0 - grow;
        if out <= 0.0 { TOP - 5.0 } else { (TOP - 5.0 + out / tan).min(TOP) }
    };
    good(&section_slot("leaning U, flat", "ENDMILL", 6.0, 0.0, "BOTTOM_AND_SIDE_FINISH_MILLING", 5.0, |p| u(p, 10.0, 0.0, 20.0), lean));
    good(&section_slot("leaning U, ball", "BALL_ENDMILL", 6.0, 3.0, "BOTTOM_AND_SIDE_FINISH_MILLING", 5.0, |p| u(p, 10.0, 0.0, 20.0), lean));
    let round = |s: f64, grow: f64| {
        let r: f64 = 5.0 + grow;
        if s.abs() >= r { TOP } else { TOP - 7.0 + 5.0 - (r * r - s * s).sqrt().min(5.0 + grow.min(0.0)) }
    };
    for (kind, d, e) in [("BALL_ENDMILL", 10.0, 5.0), ("BALL_ENDMILL", 6.0, 3.0), ("ENDMILL", 6.0, 0.0), ("BULLNOSE_ENDMILL", 6.0, 1.0)] {
        good(&section_slot("rounded U", kind, d, e, "BOTTOM_AND_SIDE_FINISH_MILLING", 7.0, |p| {
            let w = p.length(10.0);
            format!("ROUNDED_U_PROFILE($,#{w})")
        }, round));
    }
    let v = |s: f64, grow: f64| (TOP - 5.0 + (s.abs() - grow).max(0.0) / 45f64.to_radians().tan()).min(TOP);
    for (kind, d, e) in [("BALL_ENDMILL", 4.0, 2.0), ("ENDMILL", 4.0, 0.0)] {
        good(&section_slot("V", kind, d, e, "BOTTOM_AND_SIDE_FINISH_MILLING", 5.0, |p| {
            let r = p.length(0.0);
            format!("VEE_PROFILE($,#{r},90.,45.)")
        }, v));
    }
    let arc = |s: f64, grow: f64| {
        let r = 10.0 + grow;
        if s.abs() >= r { TOP } else { (TOP - 4.0 + 10.0 - (r * r - s * s).sqrt()).min(TOP) }
    };
    good(&section_slot("circular", "BALL_ENDMILL", 6.0, 3.0, "BOTTOM_AND_SIDE_FINISH_MILLING", 4.0, |p| {
        let r = p.length(10.0);
        format!("PARTIAL_CIRCULAR_PROFILE($,#{r},180.)")
    }, arc));
}
