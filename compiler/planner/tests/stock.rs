//! What the planner does about material that is still there: rapids go over it, and cuts beyond a feature are told.

#[path = "judge/part.rs"]
#[allow(dead_code)]
mod part;

use gr_ir::geometry::ArcShape;
use gr_ir::{Op, Program};
use gr_planner::{Options, Planned, plan};
use gr_text::{Code, Diagnostic, FileId, Severity, code};
use part::{Mill, Part};

const BLOCK: [f64; 3] = [60.0, 40.0, 12.0];

fn planned(p: &Part) -> (Planned, Vec<Diagnostic>) {
    let (planned, out) = plan(p.text().as_bytes(), FileId(0), &Options::default());
    let errors: Vec<_> = out.iter().filter(|d| d.severity == Severity::Error).collect();
    assert!(errors.is_empty(), "{errors:#?}\n{}", p.text());
    (planned.expect("a program"), out)
}

fn says(p: &Part, code: Code, words: &str) {
    let (_, out) = planned(p);
    assert!(out.iter().any(|d| d.code == code && d.message.contains(words)), "{words}: {out:#?}");
}

/// Through-holes of 5 mm, each drilled.
fn drilled(places: &[[f64; 2]]) -> Part {
    let mut p = Part::new(BLOCK);
    let drill = p.tool("TWIST_DRILL", 5.0, 0.0, Some(59.0));
    let op = p.drill("DRILLING", drill, None, "");
    let size = p.length(5.0);
    let bottom = p.add("THROUGH_BOTTOM_CONDITION()".into());
    for [x, y] in places {
        p.machine("ROUND_HOLE", &[op], [*x, *y, 12.0], Some(12.0), &format!(",#{size},$,#{bottom}"));
    }
    p
}

fn silent(p: &Part, code: Code) {
    let (_, out) = planned(p);
    assert!(out.iter().all(|d| d.code != code), "{out:#?}");
}

/// Points of the block, a millimetre apart, with the height that is left over each; a plain check of its own.
struct Left {
    tops: Vec<f64>,
    tool: f64,
}

impl Left {
    fn cells() -> impl Iterator<Item = (usize, [f64; 2])> {
        (0..60 * 40).map(|i| (i, [(i % 60) as f64 + 0.5, (i / 60) as f64 + 0.5]))
    }
    /// Deepest place of a rapid in the material, mm.
    fn run(program: &Program, diameter: f64) -> f64 {
        let mut left = Left { tops: vec![BLOCK[2]; 60 * 40], tool: diameter / 2.0 };
        let mut worst = 0.0f64;
        // The first move begins anywhere.
        for s in program.steps().filter(|s| s.op.moves()).skip(1) {
            let (a, b) = (s.start.xyz(), s.end.xyz());
            let points: Vec<[f64; 3]> = match s.op {
                Op::Arc(arc) => {
                    let shape = ArcShape::new(&arc, &s.start, &s.end);
                    (0..=200).map(|k| shape.point(f64::from(k) / 200.0)).collect()
                }
                _ => (0..=200).map(|k| std::array::from_fn(|i| a[i] + (b[i] - a[i]) * f64::from(k) / 200.0)).collect(),
            };
            for p in points {
                worst = worst.max(left.at(p, matches!(s.op, Op::Rapid)));
            }
        }
        worst
    }
    fn at(&mut self, p: [f64; 3], rapid: bool) -> f64 {
        let mut into = 0.0f64;
        for (i, c) in Left::cells() {
            let d = (c[0] - p[0]).hypot(c[1] - p[1]);
            if rapid && d < self.tool - 0.6 {
                into = into.max(self.tops[i] - p[2]);
            } else if !rapid && d <= self.tool {
                self.tops[i] = self.tops[i].min(p[2]);
            }
        }
        into
    }
}

fn pocket(at: [f64; 3], retract: &str, bosses: impl Fn(&mut Part) -> String) -> Part {
    let mut p = Part::new(BLOCK);
    let tool = p.tool("ENDMILL", 6.0, 0.0, None);
    let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 2.0, 3.0));
    let (w, l) = (p.length(36.0), p.length(20.0));
    let profile = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{l},#{w})"));
    let bottom = p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into());
    let bosses = bosses(&mut p);
    p.machine("CLOSED_POCKET", &[op], at, Some(5.0), &format!(",({bosses}),$,#{bottom},$,$,#{profile}"));
    p.retract(retract)
}

#[test]
fn a_feature_under_uncut_material_is_entered_at_feed() {
    for z in [12.0, 8.0, 5.5] {
        for retract in ["5.", "1.", "2."] {
            let p = pocket([30.0, 20.0, z], retract, |_| String::new());
            let (p, _) = planned(&p);
            let worst = Left::run(&p.program, 6.0);
            assert!(worst < 1e-6, "Z{z} {retract}: a rapid {worst} mm in the block");
        }
    }
    let mut p = Part::new(BLOCK);
    let drill = p.tool("TWIST_DRILL", 6.0, 0.0, Some(59.0));
    let op = p.drill("DRILLING", drill, None, "");
    let size = p.length(6.0);
    let bottom = p.add("THROUGH_BOTTOM_CONDITION()".into());
    p.machine("ROUND_HOLE", &[op], [30.0, 20.0, 8.0], Some(8.0), &format!(",#{size},$,#{bottom}"));
    let (p, _) = planned(&p.retract("2."));
    assert!(Left::run(&p.program, 6.0) < 1e-6);
}

#[test]
fn rapids_pass_over_a_boss_that_stands_above_its_pocket() {
    let boss = |p: &mut Part| {
        let place = p.place([30.0, 20.0, 12.0]);
        let d = p.length(8.0);
        let circle = p.add(format!("CIRCULAR_CLOSED_PROFILE(#{place},#{d})"));
        let deep = p.place([0.0, 0.0, -9.0]);
        let plane = p.add(format!("PLANE('depth',#{deep})"));
        format!("#{}", p.add(format!("BOSS('boss',$,(),#{place},#{plane},#{circle},$)")))
    };
    let p = pocket([30.0, 20.0, 8.0], "2.", boss);
    let (p, _) = planned(&p);
    let worst = Left::run(&p.program, 6.0);
    assert!(worst < 1e-6, "a rapid {worst} mm in the block");
}

/// The block in cells of 0.4 mm, and tools by their numbers: how deep a rapid goes into what is left.
fn deepest_rapid(p: &Planned, block: [f64; 3]) -> (f64, [f64; 3]) {
    const CELL: f64 = 0.4;
    let n = [0, 1].map(|i| (block[i] / CELL) as usize);
    let mut tops = vec![block[2]; n[0] * n[1]];
    let mut worst = (0.0f64, [0.0; 3]);
    let (mut radius, mut begun) = (0.0, false);
    for s in p.program.steps() {
        if let Op::ToolPrepare(number) = s.op {
            radius = p.tools.iter().find(|t| i64::from(t.number) == i64::from(number)).map_or(0.0, |t| t.diameter / 2.0);
        }
        // The first move begins anywhere.
        if !s.op.moves() || !std::mem::replace(&mut begun, true) {
            continue;
        }
        let (a, b) = (s.start.xyz(), s.end.xyz());
        let far = (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
        let shape = if let Op::Arc(arc) = s.op { Some(ArcShape::new(&arc, &s.start, &s.end)) } else { None };
        let count = (shape.as_ref().map_or(far, ArcShape::length) / 0.2).ceil().max(1.0) as usize;
        for k in 0..=count {
            let share = k as f64 / count as f64;
            let q = shape.as_ref().map_or_else(|| [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * share), |s| s.point(share));
            let range = |i: usize| {
                let low = ((q[i] - radius) / CELL).floor().clamp(0.0, n[i] as f64) as usize;
                low..((q[i] + radius) / CELL).ceil().clamp(0.0, n[i] as f64) as usize
            };
            for y in range(1) {
                for x in range(0) {
                    let d = ((x as f64 + 0.5) * CELL - q[0]).hypot((y as f64 + 0.5) * CELL - q[1]);
                    let top = &mut tops[y * n[0] + x];
                    if s.op == Op::Rapid && d < radius - 0.25 && *top - q[2] > worst.0 {
                        worst = (*top - q[2], q);
                    } else if s.op.feeds() && d <= radius {
                        *top = top.min(q[2]);
                    }
                }
            }
        }
    }
    worst
}

/// Features that lie under uncut material, with a retract plane lower than it.
#[test]
fn rapids_pass_beside_no_material() {
    let block = [80.0, 50.0, 20.0];
    let strategies = ["CENTER_MILLING($,$)", "UNIDIRECTIONAL($,$,$,$,$)", "BIDIRECTIONAL($,$,$,$,$)", "CONTOUR_PARALLEL($,$,$,$)", "CONTOUR_SPIRAL($,$,$,$)"];
    for strategy in strategies {
        let mut p = Part::new(block);
        let tool = p.tool("ENDMILL", 10.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 2.5, 6.0).strategy(strategy));
        let size = p.length(20.0);
        let circle = p.add(format!("CIRCULAR_CLOSED_PROFILE($,#{size})"));
        p.machine("BOSS", &[op], [40.0, 25.0, 14.0], Some(4.0), &format!(",#{circle},0."));
        let (made, _) = planned(&p.retract("1."));
        let (deep, at) = deepest_rapid(&made, block);
        assert!(deep < 1e-6, "boss, {strategy}: a rapid {deep} mm in the block at {at:?}");

        let mut p = Part::new(block);
        let (rough, finish) = (p.tool("ENDMILL", 10.0, 0.0, None), p.tool("ENDMILL", 6.0, 0.0, None));
        let first = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", rough, 2.5, 6.0).strategy(strategy).leave(0.5, 0.0));
        let second = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", finish, 2.5, 3.0).strategy(strategy));
        let (w, l, r) = (p.length(36.0), p.length(24.0), p.length(3.0));
        let profile = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{l},#{w})"));
        let bottom = p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into());
        p.machine("CLOSED_POCKET", &[first, second], [40.0, 25.0, 14.0], Some(4.0), &format!(",(),$,#{bottom},$,#{r},#{profile}"));
        let (made, _) = planned(&p.retract("1."));
        let (deep, at) = deepest_rapid(&made, block);
        assert!(deep < 1e-6, "pocket, {strategy}: a rapid {deep} mm in the block at {at:?}");
    }
}

/// A boss as high as the block in a pocket that lies lower, its corner close to the ways between the passes.
#[test]
fn rapids_pass_no_corner_of_a_boss() {
    let block = [60.0, 40.0, 16.0];
    for strategy in ["$", "CONTOUR_PARALLEL($,$,$,$)", "UNIDIRECTIONAL($,$,$,$,$)"] {
        let mut p = Part::new(block);
        let tool = p.tool("ENDMILL", 6.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 2.5, 3.6).strategy(strategy));
        let (a, w, l) = (p.length(8.0), p.length(50.0), p.length(30.0));
        let square = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{a},#{a})"));
        let (place, deep) = (p.place([30.0, 20.0, 16.0]), p.place([0.0, 0.0, -9.0]));
        let plane = p.add(format!("PLANE('depth',#{deep})"));
        let boss = p.add(format!("BOSS('boss',$,(),#{place},#{plane},#{square},$)"));
        let profile = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{l},#{w})"));
        let bottom = p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into());
        p.machine("CLOSED_POCKET", &[op], [30.0, 20.0, 12.0], Some(5.0), &format!(",(#{boss}),$,#{bottom},$,$,#{profile}"));
        let (made, _) = planned(&p.retract("2."));
        let (deep, at) = deepest_rapid(&made, block);
        assert!(deep < 1e-6, "{strategy}: a rapid {deep} mm in the block at {at:?}");
    }
}

/// What a rounded edge cannot reach at the foot of a wall is told; where the foot is as round, nothing is.
#[test]
fn feet_of_walls_are_told() {
    let ball = |feature: &str| {
        let mut p = Part::new([60.0, 50.0, 20.0]);
        let tool = p.tool("BALL_ENDMILL", 6.0, 3.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", tool, 2.5, 1.0));
        let round = |p: &mut Part, d: f64| {
            let d = p.length(d);
            p.add(format!("CIRCULAR_CLOSED_PROFILE($,#{d})"))
        };
        match feature {
            "BOSS" => {
                let c = round(&mut p, 20.0);
                p.machine("BOSS", &[op], [30.0, 25.0, 20.0], Some(5.0), &format!(",#{c},0."));
            }
            "PROFILE" => {
                let c = round(&mut p, 30.0);
                p.machine("GENERAL_OUTSIDE_PROFILE", &[op], [30.0, 25.0, 20.0], Some(5.0), &format!(",#{c}"));
            }
            "FLOOR" | "BOWL" => {
                // A floor of 20 mm radius in a pocket of 30 mm, and one that ends inside of the pocket.
                let (c, depth) = (round(&mut p, 30.0), if feature == "BOWL" { 4.0 } else { 8.0 });
                let centre = p.point([0.0, 0.0, 20.0 - depth]);
                let r = p.length(20.0);
                let bottom = p.add(format!("RADIUSED_POCKET_BOTTOM_CONDITION(#{centre},#{r})"));
                p.machine("CLOSED_POCKET", &[op], [30.0, 25.0, 20.0], Some(depth), &format!(",(),$,#{bottom},$,$,#{c}"));
            }
            _ => {
                let d = p.length(16.0);
                let r = p.length(8.0);
                let bottom = p.add(format!("SPHERICAL_HOLE_BOTTOM(#{r})"));
                p.machine("ROUND_HOLE", &[op], [30.0, 25.0, 20.0], Some(12.0), &format!(",#{d},$,#{bottom}"));
            }
        }
        p
    };
    says(&ball("BOSS"), code::PLAN_UNREACHABLE_CORNER, "a radius of 3 mm all along the foot");
    silent(&ball("HOLE"), code::PLAN_UNREACHABLE_CORNER);
    // √(20² - 15²) - √(17² - 12²)
    says(&ball("FLOOR"), code::PLAN_UNREACHABLE_CORNER, "up to 1.1872 mm all along the foot of its walls, where they meet its floor");
    silent(&ball("BOWL"), code::PLAN_UNREACHABLE_CORNER);
}

/// A tool path of the file keeps its rapids, and is told of those that go through the block.
#[test]
fn rapids_of_the_file_through_the_block_are_told() {
    let part = |z: f64| {
        let mut p = Part::new(BLOCK);
        let tool = p.tool("ENDMILL", 6.0, 0.0, None);
        let (t, f) = (p.technology(), p.functions());
        let points: Vec<String> = [[10.0, 10.0, 20.0], [10.0, 10.0, z], [50.0, 30.0, z]].iter().map(|q| format!("#{}", p.point(*q))).collect();
        let line = p.add(format!("POLYLINE('',({}))", points.join(",")));
        let path = p.add(format!("CUTTER_LOCATION_TRAJECTORY(.T.,.APPROACH.,SPEED_NAME(.RAPID.),$,$,.T.,#{line},$,$)"));
        let list = p.add(format!("TOOLPATH_LIST((#{path}))"));
        let op = p.add(format!("FREEFORM_OPERATION(#{list},$,'op',$,$,#{tool},#{t},#{f},$,$,$,$)"));
        p.machine("TOOLPATH_FEATURE", &[op], [0.0; 3], Some(0.0), "");
        p
    };
    says(&part(3.0), code::PLAN_RAPID_THROUGH_STOCK, "reaches up to Z12.000");
    silent(&part(12.5), code::PLAN_RAPID_THROUGH_STOCK);
}

fn slot(x: [f64; 2], ends: [&str; 2], first: bool) -> Part {
    let mut p = Part::new(BLOCK);
    let tool = p.tool("ENDMILL", 10.0, 0.0, None);
    let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 4.0, 8.0));
    if first {
        // A pocket that the slot opens into at both ends.
        let wide = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 4.0, 8.0));
        for at in [x[0] - 8.0, x[1] + 8.0] {
            let (w, l) = (p.length(16.0), p.length(20.0));
            let profile = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{l},#{w})"));
            let bottom = p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into());
            let f = p.feature("CLOSED_POCKET", &[wide], [at, 20.0, 12.0], Some(4.0), &format!(",(),$,#{bottom},$,$,#{profile}"));
            p.step(f, wide);
        }
    }
    let along = p.direction([1.0, 0.0, 0.0]);
    let length = p.length(x[1] - x[0]);
    let path = p.add(format!("LINEAR_PATH($,#{length},#{along})"));
    let w = p.length(10.0);
    let section = p.add(format!("SQUARE_U_PROFILE($,#{w},$,0.,$,0.)"));
    let ends = ends.map(|e| p.add(e.into()));
    p.machine("SLOT", &[op], [x[0], 20.0, 12.0], Some(4.0), &format!(",#{path},#{section},(#{},#{})", ends[0], ends[1]));
    p
}

const OPEN: &str = "OPEN_SLOT_END_TYPE()";
const ROUND: &str = "RADIUSED_SLOT_END_TYPE()";

#[test]
fn open_ends_inside_the_part_are_told() {
    says(&slot([10.0, 50.0], [OPEN, OPEN], false), code::PLAN_OVERRUNS_PART, "ends 10.0000 mm inside");
    says(&slot([0.0, 50.0], [OPEN, OPEN], false), code::PLAN_OVERRUNS_PART, "ends 10.0000 mm inside");
    silent(&slot([0.0, 60.0], [OPEN, OPEN], false), code::PLAN_OVERRUNS_PART);
    silent(&slot([10.0, 50.0], [ROUND, ROUND], false), code::PLAN_OVERRUNS_PART);
    // Open into what an earlier workingstep has cut.
    silent(&slot([20.0, 40.0], [OPEN, OPEN], true), code::PLAN_OVERRUNS_PART);
}

fn hole(keyword: &str, tool: (&str, f64, Option<f64>), depth: Option<f64>, shape: (f64, &str)) -> Part {
    let mut p = Part::new(BLOCK);
    let t = p.tool(tool.0, tool.1, 0.0, tool.2);
    let more = match keyword {
        "BORING" => ",$,.F.,$,$,$",
        "REAMING" => ",$,.F.,$,$,$",
        _ => "",
    };
    let op = p.drill(keyword, t, depth, more);
    let size = p.length(8.0);
    let bottom = p.add(shape.1.into());
    p.machine("ROUND_HOLE", &[op], [30.0, 20.0, 12.0], Some(shape.0), &format!(",#{size},$,#{bottom}"));
    p
}

#[test]
fn cuts_beyond_a_hole_are_told() {
    let (twist, flat, through) = (("TWIST_DRILL", 8.0, Some(59.0)), "FLAT_HOLE_BOTTOM()", "THROUGH_BOTTOM_CONDITION()");
    let cone = "CONICAL_HOLE_BOTTOM(59.,$)";
    says(&hole("DRILLING", twist, Some(14.0), (10.0, flat)), code::PLAN_BEYOND_FEATURE, "4.0000 mm deeper");
    says(&hole("DRILLING", twist, Some(30.0), (12.0, through)), code::PLAN_BEYOND_FEATURE, "deeper than it");
    silent(&hole("DRILLING", twist, None, (12.0, through)), code::PLAN_BEYOND_FEATURE);
    says(&hole("DRILLING", ("TWIST_DRILL", 8.0, Some(30.0)), None, (9.0, cone)), code::PLAN_BEYOND_FEATURE, "deeper than it");
    silent(&hole("DRILLING", twist, None, (9.0, cone)), code::PLAN_BEYOND_FEATURE);
    let sink = ("COUNTERSINK", 12.0, Some(45.0));
    says(&hole("COUNTER_SINKING", sink, Some(6.0), (10.0, flat)), code::PLAN_BEYOND_FEATURE, "8.0000 mm to 12.0000 mm");
    silent(&hole("COUNTER_SINKING", sink, None, (10.0, flat)), code::PLAN_BEYOND_FEATURE);
}

#[test]
fn what_drills_leave_is_told() {
    let (flat, through, cone) = ("FLAT_HOLE_BOTTOM()", "THROUGH_BOTTOM_CONDITION()", "CONICAL_HOLE_BOTTOM(59.,$)");
    let drill = |d: f64, half: f64| ("TWIST_DRILL", d, Some(half));
    says(&hole("DRILLING", drill(7.0, 59.0), None, (12.0, through)), code::PLAN_UNREACHABLE_CORNER, "0.5000 mm all round");
    says(&hole("DRILLING", drill(8.0, 59.0), None, (9.0, flat)), code::PLAN_UNREACHABLE_CORNER, "in its floor");
    says(&hole("DRILLING", drill(8.0, 75.0), None, (8.0, cone)), code::PLAN_UNREACHABLE_CORNER, "its cone is");
    silent(&hole("DRILLING", drill(8.0, 59.0), None, (9.0, cone)), code::PLAN_UNREACHABLE_CORNER);
    silent(&hole("DRILLING", drill(8.0, 59.0), None, (12.0, through)), code::PLAN_UNREACHABLE_CORNER);
}

/// A hole of 8 mm by operations: keyword, diameter of the tool, depth of cut.
fn made(ops: &[(&str, f64, Option<f64>)], depth: f64, bottom: &str) -> Part {
    let mut p = Part::new(BLOCK);
    let ops: Vec<usize> = ops
        .iter()
        .map(|(keyword, wide, cut)| {
            let (kind, half) = if *keyword == "REAMING" { ("REAMER", None) } else { ("TWIST_DRILL", Some(59.0)) };
            let tool = p.tool(kind, *wide, 0.0, half);
            p.drill(keyword, tool, *cut, if *keyword == "REAMING" { ",$,.F.,$,$,$" } else { "" })
        })
        .collect();
    let (size, bottom) = (p.length(8.0), p.add(bottom.into()));
    p.machine("ROUND_HOLE", &ops, [30.0, 20.0, 12.0], Some(depth), &format!(",#{size},$,#{bottom}"));
    p
}

#[test]
fn drills_that_stop_short_are_told() {
    let (flat, through, cone) = ("FLAT_HOLE_BOTTOM()", "THROUGH_BOTTOM_CONDITION()", "CONICAL_HOLE_BOTTOM(59.,$)");
    let short = code::PLAN_SHORT_OF_BOTTOM;
    // The point of a drill of 8 mm with a half angle of 59 degrees is 2.4034 mm high.
    says(&made(&[("DRILLING", 8.0, Some(13.0))], 12.0, through), short, "goes 10.5966 mm deep at its full width, but");
    silent(&made(&[("DRILLING", 8.0, Some(14.4035))], 12.0, through), short);
    silent(&made(&[("DRILLING", 8.0, None)], 12.0, through), short);
    says(&made(&[("DRILLING", 8.0, Some(6.0))], 10.0, flat), short, "goes 6 mm deep, but");
    silent(&made(&[("DRILLING", 8.0, Some(10.0))], 10.0, flat), short);
    says(&made(&[("DRILLING", 8.0, Some(9.0))], 9.0, cone), short, "6.5966 mm deep at its full width");
    silent(&made(&[("DRILLING", 8.0, Some(11.41))], 9.0, cone), short);
    // Another operation gets there; a reamer behind the drill need not.
    silent(&made(&[("DRILLING", 8.0, Some(6.0)), ("DRILLING", 8.0, Some(10.0))], 10.0, flat), short);
    silent(&made(&[("DRILLING", 8.0, Some(10.0)), ("DRILLING", 8.0, Some(6.0))], 10.0, flat), short);
    silent(&made(&[("DRILLING", 7.8, Some(10.0)), ("REAMING", 8.0, Some(8.0))], 10.0, flat), short);
    silent(&made(&[("DRILLING", 7.0, Some(8.0)), ("REAMING", 8.0, Some(10.0))], 10.0, flat), short);
    // A narrower one that gets there does not make the hole.
    says(&made(&[("DRILLING", 4.0, Some(10.0)), ("DRILLING", 8.0, Some(6.0))], 10.0, flat), short, "goes 6 mm deep, but");
    says(&made(&[("CENTER_DRILLING", 8.0, Some(2.0))], 10.0, flat), short, "goes 2 mm deep, but");
    // It is told at the depth, with the one that is wanted, once.
    let p = made(&[("CENTER_DRILLING", 8.0, Some(2.0)), ("DRILLING", 8.0, Some(6.5))], 10.0, flat);
    let (_, out) = planned(&p);
    let all: Vec<&Diagnostic> = out.iter().filter(|d| d.code == short).collect();
    assert_eq!(all.len(), 1, "{all:?}");
    assert_eq!(&p.text()[all[0].labels[0].span.range()], "6.5");
    assert!(all[0].help.as_deref().is_some_and(|h| h.contains("at least 10 mm")), "{all:?}");
}

/// What has no bottom comes out at the other side of the block, where the file has one.
#[test]
fn through_features_that_end_inside_the_part_are_told() {
    let hole = |depth: f64| made(&[("DRILLING", 8.0, None)], depth, "THROUGH_BOTTOM_CONDITION()");
    says(&hole(9.0), code::PLAN_NOT_THROUGH, "ends 3 mm above the underside of the raw part (Z0)");
    silent(&hole(12.0), code::PLAN_NOT_THROUGH);
    silent(&made(&[("DRILLING", 8.0, None)], 9.0, "FLAT_HOLE_BOTTOM()"), code::PLAN_NOT_THROUGH);
    let pocket = |depth: f64| {
        let mut p = Part::new(BLOCK);
        let tool = p.tool("ENDMILL", 6.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 2.0, 3.0));
        let (w, l) = (p.length(30.0), p.length(20.0));
        let profile = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{w},#{l})"));
        let bottom = p.add("THROUGH_POCKET_BOTTOM_CONDITION()".into());
        p.machine("CLOSED_POCKET", &[op], [30.0, 20.0, 12.0], Some(depth), &format!(",(),$,#{bottom},$,$,#{profile}"));
        p
    };
    says(&pocket(11.5), code::PLAN_NOT_THROUGH, "ends 0.5 mm above");
    silent(&pocket(12.0), code::PLAN_NOT_THROUGH);
    // Without a block nobody knows; with two setups the rest may be cut from the other side.
    let plain = hole(9.0).text();
    let out = |text: &str| plan(text.as_bytes(), FileId(0), &Options::default()).1;
    let told = |text: &str| out(text).iter().any(|d| d.code == code::PLAN_NOT_THROUGH);
    assert!(told(&plain));
    let line = plain.lines().find(|l| l.contains("=WORKPIECE(")).expect("a workpiece");
    assert!(!told(&plain.replace(line, &line.replace(",$,$,#4,", ",$,$,$,"))), "{line}");
    let place = plain.lines().find(|l| l.contains("=AXIS2_PLACEMENT_3D(")).and_then(|l| l.split('=').next()).expect("a place");
    let two = |n: usize| (0..n).map(|i| format!("#{}=SETUP('s{i}',{place},$,());\n", 9000 + i)).collect::<String>();
    assert!(told(&plain.replace("ENDSEC;\nEND-ISO", &format!("{}ENDSEC;\nEND-ISO", two(1)))));
    assert!(!told(&plain.replace("ENDSEC;\nEND-ISO", &format!("{}ENDSEC;\nEND-ISO", two(2)))));
}

#[test]
fn a_retract_plane_in_the_material_is_told() {
    for r in ["0.", "-3."] {
        says(&pocket([30.0, 20.0, 12.0], r, |_| String::new()), code::PLAN_APPROACH_CHANGED, "the retract plane at");
    }
    silent(&pocket([30.0, 20.0, 12.0], "5.", |_| String::new()), code::PLAN_APPROACH_CHANGED);
}

/// Another setup has another origin: its first way names Z, then X and Y, even where the numbers are the same.
#[test]
fn another_setup_names_its_first_place() {
    let mut p = drilled(&[[30.0, 20.0], [10.0, 20.0]]);
    let [a, b] = [p.steps[0], p.steps[1]];
    let place = p.place([0.0; 3]);
    let plane = p.add(format!("PLANE('security',#{place})"));
    let text = p.text();
    let main = text.lines().find(|l| l.contains("=WORKPLAN('main'")).expect("a plan").to_string();
    let id = main.split('=').next().expect("an id").to_string();
    let plans = format!(
        "#9001=SETUP('one',#{place},#{plane},());
#9002=SETUP('two',#{place},#{plane},());
#9003=WORKPLAN('a',(#{a}),$,#9001,$);
#9004=WORKPLAN('b',(#{b}),$,#9002,$);
{id}=WORKPLAN('main',(#9003,#9004),$,$,$);"
    );
    let (planned, out) = plan(text.replace(&main, &plans).as_bytes(), FileId(0), &Options::default());
    let planned = planned.unwrap_or_else(|| panic!("{out:#?}"));
    let options = gr_backends::rs274ngc::Options::default();
    let text = gr_backends::rs274ngc::emit(&planned.program, &options, &gr_backends::NoSources).expect("written").text;
    let second = text.split("G55").nth(1).expect("a second setup");
    let before: Vec<&str> = second.lines().take_while(|l| !l.starts_with("G1")).filter(|l| l.contains(['X', 'Y', 'Z'])).collect();
    assert!(before[0].starts_with("G0 Z") && before[1].contains("X10") && before[1].contains("Y20"), "{second}");
}

/// Where the machine stands at the beginning nobody knows: the first way names X and Y, whatever they are.
#[test]
fn the_first_place_is_named() {
    let (p, _) = planned(&drilled(&[[0.0, 0.0]]));
    let options = gr_backends::rs274ngc::Options::default();
    let text = gr_backends::rs274ngc::emit(&p.program, &options, &gr_backends::NoSources).expect("written").text;
    let first_cut = text.lines().position(|l| l.starts_with("G1")).expect("a cut");
    let before: Vec<&str> = text.lines().take(first_cut).collect();
    assert!(before.iter().any(|l| l.contains("X0") && l.contains("Y0")), "{text}");
}

/// The corners between walls have the radius that the pocket gives them, whatever its outline is drawn as.
#[test]
fn corners_of_pockets_are_as_round_as_the_file_says() {
    // Nearest that the tool's axis comes to a corner that is drawn sharp at X48 Y30.
    let nearest = |open: bool, corner: f64| {
        let mut p = Part::new(BLOCK);
        let tool = p.tool("ENDMILL", 6.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 2.0, 3.0));
        let bottom = p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into());
        let radius = p.length(corner);
        if open {
            let walls = p.polyline(&[(-30.0, 10.0), (18.0, 10.0), (18.0, -10.0), (-30.0, -10.0)]);
            let profile = p.add(format!("GENERAL_PROFILE($,#{walls})"));
            p.machine("OPEN_POCKET", &[op], [30.0, 20.0, 12.0], Some(2.0), &format!(",(),$,#{bottom},$,#{radius},#{profile},$"));
        } else {
            let outline = p.polyline(&[(-18.0, -10.0), (18.0, -10.0), (18.0, 10.0), (-18.0, 10.0), (-18.0, -10.0)]);
            let profile = p.add(format!("GENERAL_CLOSED_PROFILE($,#{outline})"));
            p.machine("CLOSED_POCKET", &[op], [30.0, 20.0, 12.0], Some(2.0), &format!(",(),$,#{bottom},$,#{radius},#{profile}"));
        }
        let (made, out) = planned(&p);
        assert!(out.iter().all(|d| d.code != code::PLAN_UNREACHABLE_CORNER) || corner < 3.0, "{out:#?}");
        let mut least = f64::INFINITY;
        for s in made.program.steps().filter(|s| s.op.feeds()) {
            let (a, b) = (s.start.xyz(), s.end.xyz());
            for k in 0..=100 {
                let share = f64::from(k) / 100.0;
                let q = match s.op {
                    Op::Arc(arc) => ArcShape::new(&arc, &s.start, &s.end).point(share),
                    _ => std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share),
                };
                least = least.min((q[0] - 48.0).hypot(q[1] - 30.0));
            }
        }
        least
    };
    let diagonal = |r: f64| r * 2f64.sqrt() - (r - 3.0);
    for open in [false, true] {
        // A corner of 6 mm: the axis stays 3 mm inside of its arc.
        for (corner, wanted) in [(6.0, diagonal(6.0)), (4.5, diagonal(4.5)), (3.0, diagonal(3.0)), (0.5, diagonal(3.0))] {
            let least = nearest(open, corner);
            assert!((least - wanted).abs() < 2e-3, "open {open}, corner {corner}: {least}, not {wanted}");
        }
    }
}

/// A radius that takes more than the corners of an outline is refused; one that fills it from wall to wall is not.
#[test]
fn arms_of_pockets_are_not_lost_in_their_corners() {
    let arm = |corner: f64| {
        let mut p = Part::new(BLOCK);
        let tool = p.tool("ENDMILL", 4.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, 2.0, 2.0));
        let outline = p.polyline(&[(-15.0, -11.0), (15.0, -11.0), (15.0, -1.0), (-3.0, -1.0), (-3.0, 11.0), (-15.0, 11.0), (-15.0, -11.0)]);
        let profile = p.add(format!("GENERAL_CLOSED_PROFILE($,#{outline})"));
        let (bottom, radius) = (p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into()), p.length(corner));
        p.machine("CLOSED_POCKET", &[op], [30.0, 20.0, 12.0], Some(2.0), &format!(",(),$,#{bottom},$,#{radius},#{profile}"));
        let (made, out) = plan(p.text().as_bytes(), FileId(0), &Options::default());
        let most = made.map(|m| m.program.steps().filter(|s| s.op.feeds()).map(|s| s.end.axes[0]).fold(0.0, f64::max));
        (most, out.iter().any(|d| d.message.contains("for which its outline has no room")))
    };
    for corner in [2.0, 4.0, 5.0] {
        let (most, refused) = arm(corner);
        assert!(!refused && most.is_some_and(|x| (x - 43.0).abs() < 1e-4), "{corner}: {most:?}");
    }
    assert_eq!(arm(6.0), (None, true));
}
