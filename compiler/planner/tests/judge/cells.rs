//! One part for each feature, by strategy and approach.

use super::cases::*;
use super::part::Part;

pub type Make = Box<dyn Fn(&str, &str) -> Case>;

/// Each feature, and whether its strategy says anything.
pub fn features() -> Vec<(&'static str, bool, Make)> {
    let one = |f: fn(&str, &str) -> Case| -> Make { Box::new(f) };
    let finish = "BOTTOM_AND_SIDE_FINISH_MILLING";
    let u = |lean: f64, radius: f64| move |p: &mut Part| {
        let (w, r) = (p.length(10.0), p.length(radius));
        format!("SQUARE_U_PROFILE($,#{w},#{r},{lean:?},#{r},{lean:?})")
    };
    let with = |c: Case, s: &str| -> Case {
        // Sections have their own helper: the strategy is put in afterwards.
        let mut c = c;
        c.name = format!("{} {s}", c.name);
        c
    };
    vec![
        ("planar face", true, one(|s, _| face(s, 16.0, 0.0))),
        ("closed pocket, rectangular", true, one(|s, a| rectangular_pocket(s, a, 6.0, Some(4.0)))),
        ("closed pocket, circular", true, one(|s, a| circular_pocket(s, a, 7.0))),
        ("closed pocket, n-gon", true, one(|s, a| ngon_pocket(s, a, 6.0, false))),
        ("closed pocket, general profile", true, one(|s, a| general_pocket(s, a, 5.0))),
        ("closed pocket with bosses, one lower than its rim", true, one(|s, a| pocket_with_bosses(s, a, 5.0, 2.0, 0.0))),
        ("closed pocket with sloping walls, finished", true, one(|s, a| sloped_pocket(s, a, 6.0, 10.0, "BOTTOM_AND_SIDE_FINISH_MILLING"))),
        ("closed pocket, radius at its floor, ball", true, one(|s, _| rounded_pocket(s, 6.0, 3.0, 3.0))),
        ("closed pocket, floor part of a ball", false, one(|_, _| ball_floor("BALL_ENDMILL", 6.0, 3.0))),
        ("closed pocket, through", false, one(|_, _| through_pocket(6.0))),
        ("open pocket", true, one(|s, a| open_pocket(s, a, 7.0))),
        ("slot, open ends", false, one(|s, a| slot(s, a, 5.0, 12.0, "OPEN_SLOT_END_TYPE()"))),
        ("slot, radiused ends", true, one(|s, a| slot(s, a, 5.0, 12.0, "RADIUSED_SLOT_END_TYPE()"))),
        ("slot, flat ends with corner radii", true, one(|s, a| slot(s, a, 5.0, 12.0, "FLAT_SLOT_END_TYPE(@,@)"))),
        ("slot, Woodruff ends, finished", false, one(|_, _| woodruff("ENDMILL", 5.0, 0.0, 9.0, 12.0))),
        ("slot along an arc", true, one(|s, _| curved_slot(s, 4.0, 7.0, false, "RADIUSED_SLOT_END_TYPE()"))),
        ("slot round a circle (loop end)", false, one(|s, _| curved_slot(s, 4.0, 7.0, true, ""))),
        ("slot, square U with leaning walls, finished", false, Box::new(move |s, _| with(section_slot("leaning U", "ENDMILL", 6.0, 0.0, finish, 5.0, u(20.0, 0.0), |_, _| 0.0), s))),
        ("slot, square U with radii, ball", false, Box::new(move |s, _| with(section_slot("radii", "BALL_ENDMILL", 4.0, 2.0, finish, 5.0, u(10.0, 3.0), |_, _| 0.0), s))),
        ("slot, rounded U, ball", false, Box::new(move |s, _| with(section_slot("rounded U", "BALL_ENDMILL", 6.0, 3.0, finish, 7.0, |p| { let w = p.length(10.0); format!("ROUNDED_U_PROFILE($,#{w})") }, |_, _| 0.0), s))),
        ("slot, V, ball", false, Box::new(move |s, _| with(section_slot("V", "BALL_ENDMILL", 4.0, 2.0, finish, 5.0, |p| { let r = p.length(0.0); format!("VEE_PROFILE($,#{r},90.,45.)") }, |_, _| 0.0), s))),
        ("slot, partial circular, ball", false, Box::new(move |s, _| with(section_slot("circular", "BALL_ENDMILL", 6.0, 3.0, finish, 4.0, |p| { let r = p.length(10.0); format!("PARTIAL_CIRCULAR_PROFILE($,#{r},180.)") }, |_, _| 0.0), s))),
        ("slot, general section, flat", false, Box::new(move |s, _| with(section_slot("general", "ENDMILL", 3.0, 0.0, finish, 5.0, |p| { let c = p.polyline(&[(-8.0, 5.0), (-5.0, 2.0), (-5.0, 0.0), (4.0, 0.0), (7.0, 5.0)]); format!("GENERAL_PROFILE($,#{c})") }, |_, _| 0.0), s))),
        ("step", true, one(|s, _| step(s, 8.0, 0.0))),
        ("step with a leaning wall", true, one(|s, _| step(s, 8.0, 15.0))),
        ("round hole, milled", true, one(|s, a| milled_hole(s, a, 8.0, "FLAT_HOLE_BOTTOM()", None))),
        ("round hole, milled, tapered", true, one(|s, a| milled_hole(s, a, 8.0, "FLAT_HOLE_BOTTOM()", Some(20.0)))),
        ("round hole, milled, conical bottom", false, one(|_, _| cone_floor("BALL_ENDMILL", 6.0, 3.0, 59.0))),
        ("boss, bottom and side", true, one(|s, _| outside(s, "BOSS", "BOTTOM_AND_SIDE_ROUGH_MILLING", 8.0))),
        ("boss, side", false, one(|_, _| outside("CONTOUR_PARALLEL($,.T.,$,$)", "BOSS", "SIDE_FINISH_MILLING", 8.0))),
        ("general outside profile, bottom and side", true, one(|s, _| outside(s, "GENERAL_OUTSIDE_PROFILE", "BOTTOM_AND_SIDE_ROUGH_MILLING", 8.0))),
        ("general outside profile, side", false, one(|_, _| outside("CONTOUR_PARALLEL($,.T.,$,$)", "GENERAL_OUTSIDE_PROFILE", "SIDE_ROUGH_MILLING", 8.0))),
    ]
}
