//! Parts for the judge: one feature each, with what is to stay written down once more as a function.

use super::part::{Mill, Part, r};
use super::{Judge, Poly, Verdict, circle, inside, rectangle};
use gr_planner::{Options, Planned, plan};
use gr_text::{Diagnostic, FileId, Severity};

pub struct Case {
    pub name: String,
    pub part: Part,
    pub block: [f64; 3],
    pub low: [f64; 2],
    pub high: [f64; 2],
    pub h: f64,
    pub floor: f64,
    pub tolerance: f64,
    pub surface: Box<dyn Fn(f64, f64, f64) -> f64>,
    pub cover: bool,
    pub floors: Vec<f64>,
    pub round: f64,
}

pub const BLOCK: [f64; 3] = [60.0, 40.0, 12.0];

pub const STRATEGIES: [&str; 8] = [
    "$",
    "UNIDIRECTIONAL($,$,$,$)",
    "BIDIRECTIONAL($,$,$,.LEFT.,$)",
    "CONTOUR_PARALLEL($,$,.CCW.,.CLIMB.)",
    "BIDIRECTIONAL_CONTOUR($,$,$,.RIGHT.,.CW.,.CONVENTIONAL.)",
    "CONTOUR_BIDIRECTIONAL($,$,$,.LEFT.,.CCW.,.CLIMB.)",
    "CONTOUR_SPIRAL($,$,.CW.,.CONVENTIONAL.)",
    "CENTER_MILLING($,$)",
];

pub const APPROACHES: [&str; 7] = [
    "$",
    "PLUNGE_TOOLAXIS($)",
    "PLUNGE_RAMP($,6.)",
    "PLUNGE_HELIX($,2.,4.)",
    "PLUNGE_ZIGZAG($,8.,5.)",
    "AP_RETRACT_ANGLE($,30.,4.)",
    "AP_RETRACT_TANGENT($,2.)",
];

pub fn case(name: &str, part: Part, tool_r: f64, floor: f64, surface: impl Fn(f64, f64, f64) -> f64 + 'static) -> Case {
    Case {
        name: name.into(),
        part,
        block: BLOCK,
        low: [-tool_r * 2.0 - 2.0, -tool_r * 2.0 - 2.0],
        high: [BLOCK[0] + tool_r * 2.0 + 2.0, BLOCK[1] + tool_r * 2.0 + 2.0],
        h: (tool_r / 5.5).clamp(0.25, 0.6),
        floor,
        tolerance: 0.011,
        surface: Box::new(surface),
        cover: true,
        floors: Vec::new(),
        round: 0.0,
    }
}

pub struct Judged {
    pub planned: Option<Planned>,
    pub verdict: Verdict,
    pub out: Vec<Diagnostic>,
}

impl Judged {
    pub fn errors(&self) -> Vec<String> {
        self.out.iter().filter(|d| d.severity == Severity::Error).map(|d| d.message.clone()).collect()
    }
}

pub fn judge(c: &Case) -> Judged {
    let text = c.part.text();
    let exchange = gr_p21::parse(text.as_bytes());
    assert!(exchange.faults.is_empty(), "{}: {:?}\n{text}", c.name, exchange.faults);
    let (planned, out) = plan(text.as_bytes(), FileId(0), &Options::default());
    let verdict = planned.as_ref().map_or_else(Verdict::default, |p| {
        let mut j = Judge::new(c.block, c.low, c.high, c.h);
        j.floors = c.floors.clone();
        j.round = c.round;
        j.run(p, &c.surface, c.floor, c.tolerance, c.cover)
    });
    Judged { planned, verdict, out }
}

/// Planned, and nothing wrong with it.
pub fn good(c: &Case) -> Judged {
    let j = judge(c);
    assert!(j.planned.is_some(), "{}: {:?}", c.name, j.errors());
    let v = &j.verdict;
    assert!(v.gouge < 0.03 + c.tolerance, "{}: {v:?}", c.name);
    assert_eq!(v.crashes, 0, "{}: {v:?}", c.name);
    assert!(v.missed == 0.0, "{}: {v:?}", c.name);
    j
}

pub const TOP: f64 = 12.0;

/// What is inside a polygon is cut to a floor.
pub fn inside_of(poly: Poly, floor: f64) -> impl Fn(f64, f64, f64) -> f64 {
    move |x, y, grow| if inside(&poly, x, y) + grow > 0.0 { floor } else { TOP }
}

pub fn op(p: &mut Part, keyword: &'static str, d: f64, strategy: &str, approach: &str) -> Mill {
    let t = p.tool("ENDMILL", d, 0.0, None);
    Mill::new(keyword, t, 2.5, 0.6 * d).strategy(strategy).approach(approach)
}

pub fn closed(p: &mut Part, depth: f64, profile: &str, boss: &str, slope: Option<f64>, bottom: &str, planar: Option<f64>, corner: Option<f64>, ops: &[usize], at: [f64; 2]) {
    let profile = p.add(profile.into());
    let bottom = p.add(bottom.into());
    let slope = slope.map_or("$".into(), r);
    let planar = planar.map_or("$".into(), |v| format!("#{}", p.length(v)));
    let corner = corner.map_or("$".into(), |v| format!("#{}", p.length(v)));
    p.machine("CLOSED_POCKET", ops, [at[0], at[1], TOP], Some(depth), &format!(",({boss}),{slope},#{bottom},{planar},{corner},#{profile}"));
}

pub fn rectangle_profile(p: &mut Part, l: f64, w: f64) -> String {
    let (w, l) = (p.length(w), p.length(l));
    format!("RECTANGULAR_CLOSED_PROFILE($,#{w},#{l})")
}

pub fn circle_profile(p: &mut Part, d: f64) -> String {
    let d = p.length(d);
    format!("CIRCULAR_CLOSED_PROFILE($,#{d})")
}

/// A boss inside a feature: its place in the part, how far its top lies below the feature.
pub fn boss(p: &mut Part, at: [f64; 3], profile: &str, depth: f64, slope: f64) -> String {
    let profile = p.add(profile.into());
    let id = p.feature("BOSS", &[], at, Some(depth), &format!(",#{profile},{}", r(slope)));
    format!("#{id}")
}

const PLANAR: &str = "PLANAR_POCKET_BOTTOM_CONDITION()";

pub fn rectangular_pocket(strategy: &str, approach: &str, d: f64, corner: Option<f64>) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_ROUGH_MILLING", d, strategy, approach);
    let o = p.mill(&m);
    let profile = rectangle_profile(&mut p, 40.0, 24.0);
    closed(&mut p, 5.0, &profile, "", None, PLANAR, None, corner, &[o], [30.0, 20.0]);
    let poly = rectangle(30.0, 20.0, 40.0, 24.0, corner.unwrap_or(0.0));
    case("rectangular pocket", p, d / 2.0, 7.0, inside_of(poly, 7.0))
}

pub fn circular_pocket(strategy: &str, approach: &str, d: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_FINISH_MILLING", d, strategy, approach);
    let o = p.mill(&m);
    let profile = circle_profile(&mut p, 28.0);
    closed(&mut p, 4.0, &profile, "", None, PLANAR, None, None, &[o], [30.0, 20.0]);
    case("circular pocket", p, d / 2.0, 8.0, inside_of(circle(30.0, 20.0, 14.0), 8.0))
}

pub fn ngon_pocket(strategy: &str, approach: &str, d: f64, flats: bool) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_ROUGH_MILLING", d, strategy, approach);
    let o = p.mill(&m);
    let size = p.length(30.0);
    let profile = format!("NGON_PROFILE($,#{size},6,.{}.)", if flats { "T" } else { "F" });
    closed(&mut p, 4.0, &profile, "", None, PLANAR, None, None, &[o], [30.0, 20.0]);
    let big = if flats { 15.0 / 30f64.to_radians().cos() } else { 15.0 };
    let poly = (0..6).map(|i| f64::from(i * 60).to_radians()).map(|t| (30.0 + big * t.cos(), 20.0 + big * t.sin())).collect();
    case("hexagonal pocket", p, d / 2.0, 8.0, inside_of(poly, 8.0))
}

/// An L with a rounded inner corner, as a composite of lines and an arc.
pub fn general_pocket(strategy: &str, approach: &str, d: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_ROUGH_MILLING", d, strategy, approach);
    let o = p.mill(&m);
    let line = p.polyline(&[(-20.0, -12.0), (20.0, -12.0), (20.0, 0.0), (4.0, 0.0)]);
    let c = p.turned([4.0, 4.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
    let circle = p.add(format!("CIRCLE('',#{c},4.)"));
    let (a, b) = (p.point([4.0, 0.0, 0.0]), p.point([0.0, 4.0, 0.0]));
    let arc = p.add(format!("TRIMMED_CURVE('',#{circle},(#{a}),(#{b}),.F.,.CARTESIAN.)"));
    let rest = p.polyline(&[(0.0, 4.0), (0.0, 14.0), (-20.0, 14.0), (-20.0, -12.0)]);
    let parts: Vec<String> = [line, arc, rest].iter().map(|c| format!("#{}", p.add(format!("COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#{c})")))).collect();
    let curve = p.add(format!("COMPOSITE_CURVE('',({}),.F.)", parts.join(",")));
    closed(&mut p, 4.0, &format!("GENERAL_CLOSED_PROFILE($,#{curve})"), "", None, PLANAR, None, None, &[o], [30.0, 20.0]);
    let mut poly = vec![(10.0, 8.0), (50.0, 8.0), (50.0, 20.0)];
    // The arc bends outwards, into the corner that stays.
    poly.extend((0..=90).map(|k| (270.0 - f64::from(k)).to_radians()).map(|t| (34.0 + 4.0 * t.cos(), 24.0 + 4.0 * t.sin())));
    poly.extend([(30.0, 34.0), (10.0, 34.0)]);
    case("general pocket", p, d / 2.0, 8.0, inside_of(poly, 8.0))
}

pub fn pocket_with_bosses(strategy: &str, approach: &str, d: f64, low: f64, slope: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let t = p.tool("ENDMILL", d, 0.0, None);
    let m = Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", t, 2.5, 0.6 * d).strategy(strategy).approach(approach);
    let o = p.mill(&m);
    let profile = rectangle_profile(&mut p, 46.0, 30.0);
    let round = circle_profile(&mut p, 8.0);
    let square = rectangle_profile(&mut p, 10.0, 8.0);
    let a = boss(&mut p, [20.0, 20.0, TOP], &round, 5.0, slope);
    let b = boss(&mut p, [40.0, 22.0, TOP - low], &square, 5.0 - low, 0.0);
    closed(&mut p, 5.0, &profile, &format!("{a},{b}"), None, PLANAR, None, None, &[o], [30.0, 20.0]);
    let outer = rectangle(30.0, 20.0, 46.0, 30.0, 0.0);
    let (c, q) = (circle(20.0, 20.0, 4.0), rectangle(40.0, 22.0, 10.0, 8.0, 0.0));
    let tan = slope.to_radians().tan();
    case("pocket with bosses", p, d / 2.0, 7.0, move |x, y, grow| {
        if inside(&outer, x, y) + grow <= 0.0 {
            return TOP;
        }
        let out = -inside(&c, x, y) + grow;
        let cone = if out <= 0.0 { TOP } else if tan > 0.0 { (TOP - out / tan).max(7.0) } else { 7.0 };
        let block = if -inside(&q, x, y) + grow <= 0.0 { TOP - low } else { 7.0 };
        cone.max(block)
    })
}

pub fn sloped_pocket(strategy: &str, approach: &str, d: f64, slope: f64, keyword: &'static str) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, keyword, d, strategy, approach);
    let o = p.mill(&m);
    let profile = rectangle_profile(&mut p, 40.0, 26.0);
    closed(&mut p, 5.0, &profile, "", Some(slope), PLANAR, None, None, &[o], [30.0, 20.0]);
    let outer = rectangle(30.0, 20.0, 40.0, 26.0, 0.0);
    let tan = slope.to_radians().tan();
    let mut c = case("pocket with sloping walls", p, d / 2.0, 7.0, move |x, y, grow| {
        let d = inside(&outer, x, y) + grow;
        if d <= 0.0 { TOP } else { (TOP - d / tan).max(7.0) }
    });
    c.tolerance = 0.03;
    c.cover = keyword.contains("FINISH");
    c
}

/// Walls that meet the floor in a radius, cut by a tool with an edge radius.
pub fn rounded_pocket(strategy: &str, d: f64, edge: f64, radius: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let kind = if edge * 2.0 >= d { "BALL_ENDMILL" } else { "BULLNOSE_ENDMILL" };
    let t = p.tool(kind, d, edge, None);
    let m = Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", t, 2.5, 0.5 * d).strategy(strategy);
    let o = p.mill(&m);
    let profile = rectangle_profile(&mut p, 40.0, 26.0);
    closed(&mut p, 5.0, &profile, "", None, PLANAR, Some(radius), Some(5.0), &[o], [30.0, 20.0]);
    let outer = rectangle(30.0, 20.0, 40.0, 26.0, 5.0);
    let mut c = case(&format!("pocket with a radius at its floor {d} {edge} {radius} {strategy}"), p, d / 2.0, 7.0, move |x, y, grow| {
        let d = inside(&outer, x, y) + grow;
        if d <= 0.0 {
            TOP
        } else if d < radius {
            7.0 + radius - (radius * radius - (radius - d) * (radius - d)).sqrt()
        } else {
            7.0
        }
    });
    c.tolerance = 0.03;
    c
}

pub fn through_pocket(d: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_ROUGH_MILLING", d, "$", "$");
    let o = p.mill(&m);
    let profile = rectangle_profile(&mut p, 30.0, 20.0);
    closed(&mut p, 12.0, &profile, "", None, "THROUGH_POCKET_BOTTOM_CONDITION()", None, Some(4.0), &[o], [30.0, 20.0]);
    case("through pocket", p, d / 2.0, -1.0, inside_of(rectangle(30.0, 20.0, 30.0, 20.0, 4.0), -0.5))
}

pub fn face(strategy: &str, d: f64, angle: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let t = p.tool("FACEMILL", d, 0.0, None);
    let m = Mill::new("PLANE_FINISH_MILLING", t, 1.0, 0.0).strategy(strategy);
    let o = p.mill(&m);
    let (s, c) = angle.to_radians().sin_cos();
    let along = p.direction([c, s, 0.0]);
    let across = p.turned([0.0; 3], [0.0, 0.0, 1.0], [-s, c, 0.0]);
    let path = p.length(60.0);
    let path = p.add(format!("LINEAR_PATH($,#{path},#{along})"));
    let width = p.number(40.0);
    let width = p.add(format!("LINEAR_PROFILE(#{across},#{width})"));
    let _ = angle;
    p.machine("PLANAR_FACE", &[o], [0.0, 0.0, TOP], Some(1.5), &format!(",#{path},#{width},$,()"));
    case("planar face", p, d / 2.0, 10.5, |_, _, _| 10.5)
}

/// A face with a round boss on it.
pub fn face_with_boss(strategy: &str, approach: &str, retract: &str, d: f64, at: [f64; 2]) -> Case {
    let mut p = Part::new(BLOCK);
    let t = p.tool("ENDMILL", d, 0.0, None);
    let m = Mill::new("PLANE_ROUGH_MILLING", t, 3.0, 0.6 * d).strategy(strategy).approach(approach).retract(retract);
    let o = p.mill(&m);
    let round = circle_profile(&mut p, 10.0);
    let boss = boss(&mut p, [at[0], at[1], TOP], &round, 3.0, 0.0);
    let path = p.length(60.0);
    let along = p.direction([1.0, 0.0, 0.0]);
    let path = p.add(format!("LINEAR_PATH($,#{path},#{along})"));
    let width = p.number(40.0);
    let width = p.add(format!("LINEAR_PROFILE($,#{width})"));
    p.machine("PLANAR_FACE", &[o], [0.0, 0.0, TOP], Some(3.0), &format!(",#{path},#{width},$,({boss})"));
    let stays = circle(at[0], at[1], 5.0);
    case("face with a boss", p, d / 2.0, 9.0, move |x, y, grow| if inside(&stays, x, y) - grow < 0.0 { 9.0 } else { TOP })
}

pub fn step(strategy: &str, d: f64, tilt: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_FINISH_MILLING", d, strategy, "$");
    let o = p.mill(&m);
    let along = p.direction([1.0, 0.0, 0.0]);
    let l = p.length(60.0);
    let path = p.add(format!("LINEAR_PATH($,#{l},#{along})"));
    let wall = if tilt == 0.0 {
        "$".to_string()
    } else {
        let zero = p.length(0.0);
        format!("#{}", p.add(format!("VEE_PROFILE($,#{zero},90.,{})", r(tilt))))
    };
    p.machine("STEP", &[o], [0.0, 26.0, TOP], Some(4.0), &format!(",#{path},{wall},()"));
    let tan = tilt.to_radians().tan();
    let mut c = case("step", p, d / 2.0, 8.0, move |_, y, grow| {
        let d = y - 26.0 + grow;
        if d <= 0.0 { TOP } else if tan > 0.0 { (TOP - d / tan).max(8.0) } else { 8.0 }
    });
    c.tolerance = if tilt == 0.0 { 0.011 } else { 0.03 };
    c
}

/// A straight slot with ends of this kind; what is beyond open ends is air or the rest of the raw part.
pub fn slot(strategy: &str, approach: &str, d: f64, width: f64, end: &str) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_ROUGH_MILLING", d, strategy, approach);
    let o = p.mill(&m);
    let open = end == "OPEN_SLOT_END_TYPE()";
    let (x0, l) = if open { (0.0, 60.0) } else { (10.0, 40.0) };
    let along = p.direction([1.0, 0.0, 0.0]);
    let length = p.length(l);
    let path = p.add(format!("LINEAR_PATH($,#{length},#{along})"));
    let (w, zero) = (p.length(width), p.length(0.0));
    let section = p.add(format!("SQUARE_U_PROFILE($,#{w},#{zero},0.,#{zero},0.)"));
    let corner = p.length(2.5);
    let end = end.replace("@", &format!("#{corner}"));
    let ends = [p.add(end.clone()), p.add(end.clone())];
    p.machine("SLOT", &[o], [x0, 20.0, TOP], Some(4.0), &format!(",#{path},#{section},(#{},#{})", ends[0], ends[1]));
    let h = width / 2.0;
    let poly = if open {
        rectangle(30.0, 20.0, 200.0, width, 0.0)
    } else if end.contains("RADIUSED") {
        let mut out: Poly = (0..=180).map(|k| (f64::from(k) - 90.0).to_radians()).map(|t| (50.0 + h * t.cos(), 20.0 + h * t.sin())).collect();
        out.extend((0..=180).map(|k| (f64::from(k) + 90.0).to_radians()).map(|t| (10.0 + h * t.cos(), 20.0 + h * t.sin())));
        out
    } else {
        rectangle(30.0, 20.0, 40.0, width, if end.contains("FLAT") { 2.5f64.min(h) } else { 0.0 })
    };
    case("slot", p, d / 2.0, 8.0, inside_of(poly, 8.0))
}

/// A slot along an arc or round a circle.
pub fn curved_slot(strategy: &str, d: f64, width: f64, whole: bool, end: &str) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_ROUGH_MILLING", d, strategy, "$");
    let o = p.mill(&m);
    let radius = p.length(12.0);
    let path = p.add(if whole { format!("COMPLETE_CIRCULAR_PATH($,#{radius})") } else { format!("PARTIAL_CIRCULAR_PATH($,#{radius},150.)") });
    let (w, zero) = (p.length(width), p.length(0.0));
    let section = p.add(format!("SQUARE_U_PROFILE($,#{w},#{zero},0.,#{zero},0.)"));
    let ends = if whole { format!("#{}", p.add("LOOP_SLOT_END_TYPE()".into())) } else { format!("#{},#{}", p.add(end.into()), p.add(end.into())) };
    p.machine("SLOT", &[o], [30.0, 20.0, TOP], Some(4.0), &format!(",#{path},#{section},({ends})"));
    let h = width / 2.0;
    case("curved slot", p, d / 2.0, 8.0, move |x, y, grow| {
        let (x, y) = (x - 30.0, y - 20.0);
        let t = y.atan2(x).to_degrees();
        let out = (x.hypot(y) - 12.0).abs();
        let d = if whole || (0.0..=150.0).contains(&t) {
            out
        } else {
            let e = 150f64.to_radians();
            (x - 12.0).hypot(y).min((x - 12.0 * e.cos()).hypot(y - 12.0 * e.sin()))
        };
        if d < h + grow { 8.0 } else { TOP }
    })
}

/// An open slot with a section: `half` is half its width at a height over the part's bottom, or the height at a
/// distance from the middle.
pub fn section_slot(name: &str, kind: &str, d: f64, edge: f64, keyword: &'static str, depth: f64, section: impl Fn(&mut Part) -> String, height: impl Fn(f64, f64) -> f64 + 'static) -> Case {
    let mut p = Part::new(BLOCK);
    let t = p.tool(kind, d, edge, None);
    let m = Mill::new(keyword, t, 1.0, 0.5 * d);
    let o = p.mill(&m);
    let along = p.direction([1.0, 0.0, 0.0]);
    let length = p.length(60.0);
    let path = p.add(format!("LINEAR_PATH($,#{length},#{along})"));
    let text = section(&mut p);
    let section = p.add(text);
    let ends = [p.add("OPEN_SLOT_END_TYPE()".into()), p.add("OPEN_SLOT_END_TYPE()".into())];
    p.machine("SLOT", &[o], [0.0, 20.0, TOP], Some(depth), &format!(",#{path},#{section},(#{},#{})", ends[0], ends[1]));
    let mut c = case(name, p, d / 2.0, TOP - depth, move |_, y, grow| height(y - 20.0, grow));
    c.tolerance = 0.04;
    c
}

/// A slot whose ends rise on arcs that are tangent to its floor.
pub fn woodruff(kind: &str, d: f64, edge: f64, width: f64, radius: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let t = p.tool(kind, d, edge, None);
    let o = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", t, 2.0, 0.5 * d));
    let along = p.direction([1.0, 0.0, 0.0]);
    let length = p.length(24.0);
    let path = p.add(format!("LINEAR_PATH($,#{length},#{along})"));
    let (w, zero) = (p.length(width), p.length(0.0));
    let section = p.add(format!("SQUARE_U_PROFILE($,#{w},#{zero},0.,#{zero},0.)"));
    let r = p.length(radius);
    let ends = [0, 1].map(|_| p.add(format!("WOODRUFF_SLOT_END_TYPE(#{r})")));
    p.machine("SLOT", &[o], [18.0, 20.0, TOP], Some(4.0), &format!(",#{path},#{section},(#{},#{})", ends[0], ends[1]));
    let mut c = case("slot with Woodruff ends", p, d / 2.0, TOP - 4.0, move |x, y, grow| {
        let (s, r) = ((x - 30.0).abs() - 12.0, radius + grow);
        if (y - 20.0).abs() - grow > width / 2.0 || s > r {
            TOP
        } else if s <= 0.0 {
            TOP - 4.0
        } else {
            (TOP - 4.0 + radius - (r * r - s * s).sqrt()).clamp(TOP - 4.0, TOP)
        }
    });
    c.tolerance = 0.04;
    // Near the top a round edge is narrower than its slot: the judge would let it go aside there.
    c.cover = edge == 0.0;
    c
}

/// A round pocket whose floor is part of a ball.
pub fn ball_floor(kind: &str, d: f64, edge: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let t = p.tool(kind, d, edge, None);
    let o = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", t, 1.0, 0.5 * d));
    let profile = circle_profile(&mut p, 18.0);
    let (centre, r) = (p.point([0.0, 0.0, 17.0]), p.length(20.0));
    closed(&mut p, 3.0, &profile, "", None, &format!("RADIUSED_POCKET_BOTTOM_CONDITION(#{centre},#{r})"), None, None, &[o], [30.0, 20.0]);
    let mut c = case("pocket with a ball floor", p, d / 2.0, TOP - 3.0, move |x, y, grow| {
        let s = (x - 30.0).hypot(y - 20.0);
        let r = 20.0 + grow;
        if s > 9.0 + grow { TOP } else { (TOP + 17.0 - (r * r - s * s).sqrt()).min(TOP) }
    });
    c.tolerance = 0.03;
    c
}

/// A hole whose bottom is a cone, milled.
pub fn cone_floor(kind: &str, d: f64, edge: f64, angle: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let t = p.tool(kind, d, edge, None);
    let o = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", t, 1.0, 0.5 * d));
    let (size, b) = (p.length(16.0), p.add(format!("CONICAL_HOLE_BOTTOM({angle:?},$)")));
    p.machine("ROUND_HOLE", &[o], [30.0, 20.0, TOP], Some(3.0), &format!(",#{size},$,#{b}"));
    let half = (if angle < 90.0 { angle } else { angle / 2.0 }).to_radians();
    let mut c = case("hole with a conical bottom", p, d / 2.0, TOP - 3.0 - 8.0 / half.tan(), move |x, y, grow| {
        let s = (x - 30.0).hypot(y - 20.0);
        if s > 8.0 + grow { TOP } else { (TOP - 3.0 - (8.0 - s) / half.tan() - grow / half.sin()).min(TOP - 3.0) }
    });
    c.tolerance = 0.03;
    c
}

pub fn milled_hole(strategy: &str, approach: &str, d: f64, bottom: &str, taper: Option<f64>) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_FINISH_MILLING", d, strategy, approach);
    let o = p.mill(&m);
    let size = p.length(24.0);
    let taper_id = taper.map_or("$".into(), |v| {
        let l = p.length(v);
        format!("#{}", p.add(format!("DIAMETER_TAPER(#{l})")))
    });
    let through = bottom.contains("THROUGH");
    let depth = if through { 12.0 } else { 5.0 };
    let b = p.add(bottom.into());
    p.machine("ROUND_HOLE", &[o], [30.0, 20.0, TOP], Some(depth), &format!(",#{size},{taper_id},#{b}"));
    let hole = circle(30.0, 20.0, 12.0);
    let floor = if through { -0.5 } else { 7.0 };
    let tan = taper.map_or(0.0, |f| (24.0 - f) / 2.0 / depth);
    let mut c = case("milled hole", p, d / 2.0, floor - 0.6, move |x, y, grow| {
        let d = inside(&hole, x, y) + grow;
        if d <= 0.0 { TOP } else if tan > 0.0 { (TOP - d / tan).max(floor) } else { floor }
    });
    if !through {
        c.floor = 7.0;
    }
    c.tolerance = if taper.is_some() { 0.03 } else { 0.011 };
    c
}

/// Round about a profile: what is outside goes, as far as the raw part.
pub fn outside(strategy: &str, head: &str, keyword: &'static str, d: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, keyword, d, strategy, "$");
    let o = p.mill(&m);
    let profile = rectangle_profile(&mut p, 36.0, 20.0);
    let profile = p.add(profile);
    if head == "BOSS" {
        p.machine("BOSS", &[o], [30.0, 20.0, TOP], Some(4.0), &format!(",#{profile},0."));
    } else {
        let down = p.direction([0.0, 0.0, -1.0]);
        let four = p.length(4.0);
        let path = p.add(format!("LINEAR_PATH($,#{four},#{down})"));
        p.machine(head, &[o], [30.0, 20.0, TOP], Some(4.0), &format!(",#{path},#{profile}"));
    }
    let poly = rectangle(30.0, 20.0, 36.0, 20.0, 0.0);
    case("outside profile", p, d / 2.0, 8.0, move |x, y, grow| if -inside(&poly, x, y) + grow > 0.0 { 8.0 } else { TOP })
}

/// A U that is open at the right side of the block.
pub fn open_pocket(strategy: &str, approach: &str, d: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let m = op(&mut p, "BOTTOM_AND_SIDE_ROUGH_MILLING", d, strategy, approach);
    let o = p.mill(&m);
    let walls = p.polyline(&[(30.0, 12.0), (-15.0, 12.0), (-15.0, -12.0), (30.0, -12.0)]);
    let profile = p.add(format!("GENERAL_PROFILE($,#{walls})"));
    let bottom = p.add(PLANAR.into());
    p.machine("OPEN_POCKET", &[o], [30.0, 20.0, TOP], Some(4.0), &format!(",(),$,#{bottom},$,$,#{profile},$"));
    let poly = vec![(15.0, 8.0), (200.0, 8.0), (200.0, 32.0), (15.0, 32.0)];
    case("open pocket", p, d / 2.0, 8.0, inside_of(poly, 8.0))
}

pub fn drilled(bottom: &str, d: f64, half: f64) -> Case {
    let mut p = Part::new(BLOCK);
    let t = p.tool("TWIST_DRILL", d, 0.0, Some(half));
    let through = bottom.contains("THROUGH");
    let o = p.drill("DRILLING", t, None, "");
    let size = p.length(d);
    let b = p.add(bottom.into());
    let depth = if through { 12.0 } else { 6.0 };
    p.machine("ROUND_HOLE", &[o], [30.0, 20.0, TOP], Some(depth), &format!(",#{size},$,#{b}"));
    let tip = d / 2.0 / half.to_radians().tan();
    let cone = bottom.contains("CONICAL");
    let tan = half.to_radians().tan();
    let mut c = case("drilled hole", p, d / 2.0, -10.0, move |x, y, grow| {
        let out = (x - 30.0).hypot(y - 20.0);
        if out - grow >= d / 2.0 {
            TOP
        } else if through {
            -0.9 - if grow > 0.0 { 1.0 + tip } else { 0.0 }
        } else if cone {
            6.0 - tip + out / tan
        } else {
            TOP - 6.0 + out / tan
        }
    });
    c.h = 0.15;
    c.low = [20.0, 10.0];
    c.high = [40.0, 30.0];
    c
}
