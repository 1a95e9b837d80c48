//! Random process plans of one feature with one or two operations: none panics, none gouges, none sends a rapid
//! through material, and everything is cut that some tool of the plan reaches. A plan that cannot be carried out is
//! refused with an error that names what is wrong.

mod judge;

use gr_text::{Severity, code};
use judge::cases::{APPROACHES, BLOCK, Case, STRATEGIES, TOP, judge as judged};
use judge::part::{Mill, Part, r};
use judge::{Poly, circle, inside, rectangle};
use proptest::prelude::*;

#[derive(Clone, Debug)]
struct Op {
    finish: bool,
    side_only: bool,
    d: f64,
    rounded: f64,
    strategy: usize,
    approach: usize,
    retract: usize,
    axial: f64,
    radial: f64,
    leave: (f64, f64),
}

#[derive(Clone, Debug)]
struct Plan {
    kind: u8,
    size: [f64; 5],
    turn: f64,
    at: (f64, f64),
    depth: f64,
    corners: Vec<(f64, f64)>,
    ops: Vec<Op>,
}

fn op() -> impl Strategy<Value = Op> {
    let kinds = (any::<bool>(), prop::bool::weighted(0.15), 2.0..9.0f64, prop_oneof![3 => Just(0.0), 1 => Just(1.0), 1 => 0.1..0.9f64]);
    let ways = (0..STRATEGIES.len(), 0..APPROACHES.len(), prop_oneof![Just(1usize), Just(5), Just(6)]);
    let sizes = (0.7..4.0f64, 0.15..0.95f64, prop_oneof![Just((0.0, 0.0)), (0.05..0.6f64, 0.05..0.6f64)]);
    (kinds, ways, sizes).prop_map(|((finish, side_only, d, rounded), (strategy, approach, retract), (axial, radial, leave))| Op {
        finish,
        side_only,
        d,
        rounded,
        strategy,
        approach,
        retract,
        axial,
        radial,
        leave,
    })
}

fn plan() -> impl Strategy<Value = Plan> {
    let place = (0..12u8, prop::array::uniform5(0.0..1.0f64), prop_oneof![Just(0.0), -3.0..3.0f64], (-4.0..4.0f64, -3.0..3.0f64), 1.5..6.0f64);
    let corners = prop::collection::vec((0.45..1.0f64, 0.3..1.0f64), 3..8);
    (place, corners, prop::collection::vec(op(), 1..3)).prop_map(|((kind, size, turn, at, depth), corners, ops)| Plan { kind, size, turn, at, depth, corners, ops })
}

const PLANAR: &str = "PLANAR_POCKET_BOTTOM_CONDITION()";

/// Tools and operations; `plain`: no rounded edges and no allowances.
fn operations(p: &mut Part, all: &[Op], plain: bool, keyword: Option<&'static str>) -> (Vec<usize>, bool, f64) {
    let mut ids = Vec::new();
    let (mut cover, mut most) = (false, 1.0f64);
    for o in all {
        let edge = if plain { 0.0 } else { o.rounded * o.d / 2.0 };
        let kind = if edge == 0.0 { "ENDMILL" } else if o.rounded == 1.0 { "BALL_ENDMILL" } else { "BULLNOSE_ENDMILL" };
        let t = p.tool(kind, o.d, edge, None);
        let side_only = o.side_only && keyword.is_none();
        let name = match keyword {
            Some(k) => k,
            None if side_only => if o.finish { "SIDE_FINISH_MILLING" } else { "SIDE_ROUGH_MILLING" },
            None if o.finish => "BOTTOM_AND_SIDE_FINISH_MILLING",
            None => "BOTTOM_AND_SIDE_ROUGH_MILLING",
        };
        let leave = if plain { (0.0, 0.0) } else { o.leave };
        let m = Mill::new(name, t, o.axial, o.radial * o.d)
            .strategy(STRATEGIES[o.strategy])
            .approach(APPROACHES[o.approach])
            .retract(APPROACHES[o.retract])
            .leave(leave.0, if side_only { 0.0 } else { leave.1 });
        ids.push(p.mill(&m));
        cover |= !side_only;
        most = most.max(o.d / 2.0);
    }
    (ids, cover && !all.iter().any(|o| o.side_only), most)
}

/// Shape in the frame of the feature: height over its top (negative), at a point, widened by `grow`.
type Local = Box<dyn Fn(f64, f64, f64) -> f64>;

fn flat(poly: Poly, depth: f64) -> Local {
    Box::new(move |x, y, grow| if inside(&poly, x, y) + grow > 0.0 { -depth } else { 0.0 })
}

fn polyline(p: &mut Part, points: &Poly) -> usize {
    p.polyline(points)
}

fn build(plan: &Plan) -> Option<Case> {
    let mut p = Part::new(BLOCK);
    let [a, b, c, d, e] = plan.size;
    let (l, w) = (14.0 + 24.0 * a, 10.0 + 16.0 * b);
    let depth = plan.depth;
    let at = (30.0 + plan.at.0, 20.0 + plan.at.1);
    let mut turn = plan.turn;
    let mut tolerance = 0.012;
    let mut cover_all = true;
    let mut round = 0.0;
    let mut centre = at;
    let (ops, cover, most, local): (Vec<usize>, bool, f64, Local);
    let place_of = |p: &mut Part, at: (f64, f64), turn: f64| p.turned([at.0, at.1, TOP], [0.0, 0.0, 1.0], [turn.cos(), turn.sin(), 0.0]);
    match plan.kind {
        // Rectangle with corner radius, maybe a draft, maybe a radius at the floor.
        0 | 1 | 2 => {
            let slope = if plan.kind == 1 { 2.0 + 15.0 * c } else { 0.0 };
            let fillet = if plan.kind == 2 { 0.5 + c * (depth - 0.6).min(3.0) } else { 0.0 };
            (ops, cover, most) = operations(&mut p, &plan.ops, false, None);
            round = fillet;
            let corner = if d > 0.3 { d * l.min(w) / 2.0 } else { 0.0 };
            let (pw, pl) = (p.length(w), p.length(l));
            let profile = format!("RECTANGULAR_CLOSED_PROFILE($,#{pw},#{pl})");
            let some = |v: f64| (v > 0.0).then_some(v);
            let place = place_of(&mut p, at, turn);
            let (profile, bottom) = (p.add(profile), p.add(PLANAR.into()));
            let text = |p: &mut Part, v: Option<f64>| v.map_or("$".to_string(), |v| format!("#{}", p.length(v)));
            let (pr, or) = (text(&mut p, some(fillet)), text(&mut p, some(corner)));
            let f = p.feature_at("CLOSED_POCKET", &ops, place, Some(depth), &format!(",(),{},#{bottom},{pr},{or},#{profile}", if slope > 0.0 { r(slope) } else { "$".into() }));
            for o in &ops {
                p.step(f, *o);
            }
            let poly = rectangle(0.0, 0.0, l, w, corner);
            let tan = slope.to_radians().tan();
            if slope > 0.0 || fillet > 0.0 {
                tolerance = 0.035;
                cover_all = plan.ops.iter().all(|o| o.finish);
                // Stairs of a rounded edge on a leaning wall with a leaning-wide allowance are judged with flat tools.
                cover_all &= plan.ops.iter().all(|o| o.rounded == 0.0 || slope == 0.0);
            }
            local = Box::new(move |x, y, grow| {
                let d = inside(&poly, x, y) + grow;
                if d <= 0.0 {
                    0.0
                } else if fillet > 0.0 && d < fillet {
                    -depth + fillet - (fillet * fillet - (fillet - d) * (fillet - d)).sqrt()
                } else if tan > 0.0 {
                    (-d / tan).max(-depth)
                } else {
                    -depth
                }
            });
        }
        3 => {
            (ops, cover, most) = operations(&mut p, &plan.ops, false, None);
            let size = 12.0 + 20.0 * a;
            let s = p.length(size);
            let place = place_of(&mut p, at, turn);
            let (profile, poly) = if b < 0.4 {
                (format!("CIRCULAR_CLOSED_PROFILE($,#{s})"), circle(0.0, 0.0, size / 2.0))
            } else {
                let n = 3 + (c * 6.0) as usize;
                let big = if d < 0.5 { size / 2.0 } else { size / 2.0 / (std::f64::consts::PI / n as f64).cos() };
                let poly = (0..n).map(|i| i as f64 * std::f64::consts::TAU / n as f64).map(|t| (big * t.cos(), big * t.sin())).collect();
                (format!("NGON_PROFILE($,#{s},{n},.{}.)", if d < 0.5 { "F" } else { "T" }), poly)
            };
            let (profile, bottom) = (p.add(profile), p.add(PLANAR.into()));
            let f = p.feature_at("CLOSED_POCKET", &ops, place, Some(depth), &format!(",(),$,#{bottom},$,$,#{profile}"));
            for o in &ops {
                p.step(f, *o);
            }
            local = flat(poly, depth);
        }
        // A star-shaped outline, maybe with bosses.
        4 | 5 => {
            (ops, cover, most) = operations(&mut p, &plan.ops, false, None);
            let total: f64 = plan.corners.iter().map(|c| c.1).sum();
            let mut t = 0.0;
            let poly: Poly = plan
                .corners
                .iter()
                .map(|(far, share)| {
                    t += share / total * std::f64::consts::TAU;
                    (t.cos() * far * 17.0, t.sin() * far * 14.0)
                })
                .collect();
            let mut round = poly.clone();
            round.push(poly[0]);
            let curve = polyline(&mut p, &round);
            let place = place_of(&mut p, at, turn);
            let mut islands: Vec<(Poly, f64, f64)> = Vec::new();
            let mut names = Vec::new();
            if plan.kind == 5 {
                for (k, (x, y)) in [(4.0 * a - 2.0, 3.0 * b - 1.5), (7.0 * c - 9.0, 5.0 * d - 2.5)].into_iter().enumerate() {
                    let low = if k == 1 && e > 0.5 { depth * 0.4 } else { 0.0 };
                    let slope = if k == 0 && e > 0.3 { 6.0 } else { 0.0 };
                    let size = 2.0 + 4.0 * e;
                    let (s, co) = turn.sin_cos();
                    let world = [at.0 + x * co - y * s, at.1 + x * s + y * co, TOP - low];
                    let s = p.length(size);
                    let profile = p.add(format!("CIRCULAR_CLOSED_PROFILE($,#{s})"));
                    let id = p.feature("BOSS", &[], world, Some(depth - low), &format!(",#{profile},{}", r(slope)));
                    names.push(format!("#{id}"));
                    islands.push((circle(x, y, size / 2.0), low, slope.to_radians().tan()));
                    if slope > 0.0 {
                        tolerance = 0.035;
                        cover_all &= plan.ops.iter().all(|o| o.finish && o.rounded == 0.0);
                    }
                }
            }
            let (profile, bottom) = (p.add(format!("GENERAL_CLOSED_PROFILE($,#{curve})")), p.add(PLANAR.into()));
            let f = p.feature_at("CLOSED_POCKET", &ops, place, Some(depth), &format!(",({}),$,#{bottom},$,$,#{profile}", names.join(",")));
            for o in &ops {
                p.step(f, *o);
            }
            local = Box::new(move |x, y, grow| {
                if inside(&poly, x, y) + grow <= 0.0 {
                    return 0.0;
                }
                let mut z = -depth;
                for (island, low, tan) in &islands {
                    let out = -inside(island, x, y) + grow;
                    let own = if out <= 0.0 { -low } else if *tan > 0.0 { -low - out / tan } else { -depth };
                    z = z.max(own);
                }
                z
            });
        }
        6 => {
            (ops, cover, most) = operations(&mut p, &plan.ops, false, None);
            turn = 0.0;
            // Open at the right side of the block; walls that go apart or together.
            let (x0, x1) = (-10.0 - 8.0 * a, 30.0 - plan.at.0);
            let (lean, h) = (10.0 * (c - 0.5), 7.0 + 4.0 * b);
            let walls = vec![(x1, h + lean), (x0, h), (x0, -h), (x1, -h)];
            let curve = polyline(&mut p, &walls);
            let profile = p.add(format!("GENERAL_PROFILE($,#{curve})"));
            let bottom = p.add(PLANAR.into());
            let place = place_of(&mut p, at, 0.0);
            let f = p.feature_at("OPEN_POCKET", &ops, place, Some(depth), &format!(",(),$,#{bottom},$,$,#{profile},$"));
            for o in &ops {
                p.step(f, *o);
            }
            // Past the mouth there is air, all the way up and down.
            let poly = vec![(x1, h + lean), (x0, h), (x0, -h), (x1, -h), (x1, -200.0), (x1 + 100.0, -200.0), (x1 + 100.0, 200.0), (x1, 200.0)];
            local = flat(poly, depth);
        }
        7 | 8 => {
            let ball = plan.kind == 8;
            (ops, cover, most) = operations(&mut p, &plan.ops, !ball, Some(if ball || plan.ops[0].finish { "BOTTOM_AND_SIDE_FINISH_MILLING" } else { "BOTTOM_AND_SIDE_ROUGH_MILLING" }));
            turn = 0.0;
            let through = ball || c < 0.4;
            let width = 3.0 + 9.0 * b;
            let (x0, len) = if through { (-at.0, 60.0) } else { (-18.0, 30.0 + 6.0 * a) };
            let along = p.direction([1.0, 0.0, 0.0]);
            let length = p.length(len);
            let start = p.place([x0, 0.0, 0.0]);
            let path = p.add(format!("LINEAR_PATH(#{start},#{length},#{along})"));
            let lean = if ball { 30.0 * d } else { 0.0 };
            let radius = if ball { e * width / 4.0 } else { 0.0 };
            let (pw, pr) = (p.length(width), p.length(radius));
            let section = p.add(format!("SQUARE_U_PROFILE($,#{pw},#{pr},{lean:?},#{pr},{lean:?})"));
            let end = if through { "OPEN_SLOT_END_TYPE()".to_string() } else if d < 0.5 { "RADIUSED_SLOT_END_TYPE()".into() } else {
                let c = p.length(e * 3.0);
                format!("FLAT_SLOT_END_TYPE(#{c},#{c})")
            };
            let ends = [p.add(end.clone()), p.add(end)];
            let place = place_of(&mut p, at, 0.0);
            let f = p.feature_at("SLOT", &ops, place, Some(depth), &format!(",#{path},#{section},(#{},#{})", ends[0], ends[1]));
            for o in &ops {
                p.step(f, *o);
            }
            if ball {
                tolerance = 0.04;
                // Allowances on leaning walls are square to the wall.
                cover_all = plan.ops.iter().all(|o| o.leave == (0.0, 0.0));
                let (h, tan) = (width / 2.0, lean.to_radians().tan());
                let (sin, cos) = lean.to_radians().sin_cos();
                let cx = h + radius * tan - radius / cos;
                local = Box::new(move |_, y, grow| {
                    let s = y.abs() - grow;
                    if s <= cx.max(0.0) {
                        return -depth;
                    }
                    // On the rounding as far as its tangent point, then up the wall.
                    let z = if s < cx + radius * cos {
                        -depth + radius - (radius * radius - (s - cx) * (s - cx)).max(0.0).sqrt()
                    } else if tan > 1e-9 {
                        -depth + (s - h) / tan
                    } else {
                        0.0
                    };
                    let _ = sin;
                    z.min(0.0)
                });
            } else {
                let h = width / 2.0;
                let (rx, cap, corner) = (x0 + len, d < 0.5, (e * 3.0).min(h));
                let poly: Poly = if through {
                    rectangle(0.0, 0.0, 300.0, width, 0.0)
                } else if cap {
                    let mut out: Poly = (0..=90).map(|k| (f64::from(2 * k) - 90.0).to_radians()).map(|t| (rx + h * t.cos(), h * t.sin())).collect();
                    out.extend((0..=90).map(|k| (f64::from(2 * k) + 90.0).to_radians()).map(|t| (x0 + h * t.cos(), h * t.sin())));
                    out
                } else {
                    rectangle(x0 + len / 2.0, 0.0, len, width, corner)
                };
                local = flat(poly, depth);
            }
        }
        9 => {
            (ops, cover, most) = operations(&mut p, &plan.ops, false, None);
            turn = 0.0;
            centre = (0.0, 22.0 + 10.0 * a);
            let along = p.direction([1.0, 0.0, 0.0]);
            let length = p.length(60.0);
            let path = p.add(format!("LINEAR_PATH($,#{length},#{along})"));
            let lean = if b > 0.5 { 20.0 * c } else { 0.0 };
            let zero = p.length(0.0);
            let wall = p.add(format!("VEE_PROFILE($,#{zero},{:?},0.)", 90.0 + lean));
            let place = place_of(&mut p, centre, 0.0);
            let f = p.feature_at("STEP", &ops, place, Some(depth), &format!(",#{path},#{wall},()"));
            for o in &ops {
                p.step(f, *o);
            }
            let tan = lean.to_radians().tan();
            if lean > 0.0 {
                tolerance = 0.035;
                cover_all = plan.ops.iter().all(|o| o.finish && o.rounded == 0.0);
            }
            local = Box::new(move |_, y, grow| {
                let d = y + grow;
                if d <= 0.0 { 0.0 } else if tan > 1e-9 { (-d / tan).max(-depth) } else { -depth }
            });
        }
        10 => {
            (ops, cover, most) = operations(&mut p, &plan.ops, false, None);
            let (l, w) = (10.0 + 20.0 * a, 8.0 + 10.0 * b);
            let (pw, pl) = (p.length(w), p.length(l));
            let profile = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{pw},#{pl})"));
            let place = place_of(&mut p, at, turn);
            let slope = if c > 0.5 { 10.0 * d } else { 0.0 };
            let f = p.feature_at("BOSS", &ops, place, Some(depth), &format!(",#{profile},{}", r(slope)));
            for o in &ops {
                p.step(f, *o);
            }
            let poly = rectangle(0.0, 0.0, l, w, 0.0);
            let tan = slope.to_radians().tan();
            if slope > 0.0 {
                tolerance = 0.035;
                cover_all = plan.ops.iter().all(|o| o.finish && o.rounded == 0.0);
            }
            local = Box::new(move |x, y, grow| {
                let out = -inside(&poly, x, y) + grow;
                if out <= 0.0 { 0.0 } else if tan > 1e-9 { (-out / tan).max(-depth) } else { -depth }
            });
        }
        _ => {
            (ops, cover, most) = operations(&mut p, &plan.ops, false, None);
            let size = 6.0 + 20.0 * a;
            let last = if b > 0.6 { size * (0.5 + 0.4 * c) } else { size };
            let s = p.length(size);
            let taper = if last < size {
                let t = p.length(last);
                format!("#{}", p.add(format!("DIAMETER_TAPER(#{t})")))
            } else {
                "$".into()
            };
            let bottom = p.add("FLAT_HOLE_BOTTOM()".into());
            let place = place_of(&mut p, at, turn);
            let f = p.feature_at("ROUND_HOLE", &ops, place, Some(depth), &format!(",#{s},{taper},#{bottom}"));
            for o in &ops {
                p.step(f, *o);
            }
            let tan = (size - last) / 2.0 / depth;
            if tan > 0.0 {
                tolerance = 0.035;
                cover_all = plan.ops.iter().all(|o| o.finish && o.rounded == 0.0);
            }
            local = Box::new(move |x, y, grow| {
                let d = size / 2.0 - x.hypot(y) + grow;
                if d <= 0.0 { 0.0 } else if tan > 1e-9 { (-d / tan).max(-depth) } else { -depth }
            });
        }
    }
    let mut floors = if tolerance > 0.02 && round == 0.0 { Vec::new() } else { vec![TOP - depth] };
    if plan.kind == 5 && e > 0.5 && !floors.is_empty() {
        floors.push(TOP - depth * 0.4);
    }
    let (s, co) = turn.sin_cos();
    let surface = move |x: f64, y: f64, grow: f64| {
        let (dx, dy) = (x - centre.0, y - centre.1);
        TOP + local(dx * co + dy * s, dy * co - dx * s, grow)
    };
    let margin = 2.0 * most + 2.5;
    let least = plan.ops.iter().map(|o| o.d / 2.0).fold(f64::INFINITY, f64::min);
    Some(Case {
        name: format!("{plan:?}"),
        part: p,
        block: BLOCK,
        low: [-margin, -margin],
        high: [BLOCK[0] + margin, BLOCK[1] + margin],
        h: (least / 5.0).clamp(0.22, 0.5),
        floor: TOP - depth,
        tolerance,
        surface: Box::new(surface),
        cover: cover && cover_all,
        floors,
        round,
    })
}

fn cases() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(48)
}

/// Judges one plan: what came of it, or what is wrong.
fn check(plan: &Plan) -> Result<&'static str, String> {
    let Some(case) = build(plan) else { return Ok("none") };
    let j = judged(&case);
    if j.planned.is_none() {
        // Only what is no room for the tool, or what the words name.
        let known = ["too large", "no room", "wide", "flat end", "shorter", "needs too many", "does not fit", "radius of", "leave no", "lies outside"];
        for d in j.out.iter().filter(|d| d.severity == Severity::Error) {
            let allowance = d.code == code::PLAN_BAD_SIZE && d.message.contains("there is no room");
            if !allowance && (d.code != code::PLAN_CANNOT_CUT || !known.iter().any(|k| d.message.contains(k))) {
                return Err(format!("refused: {}", d.message));
            }
        }
        return Ok("refused");
    }
    let v = &j.verdict;
    if v.gouge >= 0.03 + case.tolerance {
        return Err(format!("gouge {} at {:?}", v.gouge, v.gouge_at));
    }
    if v.crashes > 0 {
        return Err(format!("crash at {:?}", v.crash_at));
    }
    // A spot of a few cells at the limit of the field's fineness is no finding.
    if v.missed > 4.0 * case.h * case.h {
        return Err(format!("missed {} mm2 of {} above {} at {:?}", v.missed, case.h, case.tolerance, v.missed_at));
    }
    Ok("good")
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, max_shrink_iters: 60, ..ProptestConfig::default() })]

    #[test]
    fn no_gouge_no_crash_nothing_missed(plan in plan()) {
        let found = check(&plan);
        prop_assert!(found.is_ok(), "{}\n{}", found.unwrap_err(), build(&plan).map(|c| c.part.text()).unwrap_or_default());
    }
}

/// A planner that refuses everything would gouge nothing: of the plans that are sound, most are planned.
#[test]
fn most_plans_are_planned() {
    use proptest::strategy::ValueTree;
    let seed = proptest::test_runner::TestRng::from_seed(proptest::test_runner::RngAlgorithm::ChaCha, &[7; 32]);
    let mut runner = proptest::test_runner::TestRunner::new_with_rng(ProptestConfig::default(), seed);
    let mut counts = std::collections::BTreeMap::new();
    for _ in 0..cases() {
        let plan = plan().new_tree(&mut runner).expect("a plan").current();
        let found = check(&plan).unwrap_or_else(|e| panic!("{e} {plan:?}"));
        *counts.entry(found).or_insert(0_u32) += 1;
    }
    let of = |name: &str| counts.get(name).copied().unwrap_or(0);
    assert!(10 * of("good") >= 6 * (of("good") + of("refused")), "{counts:?}");
}
