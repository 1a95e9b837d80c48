//! Lowering of hand-made canonical streams.

use gr_canon::{At, Call, CallFrame, Mark, Nurbs, Sink};
use gr_ir::diff::{Aspect, Tolerance, diff};
use gr_ir::geometry::{ArcShape, Extent, flatten, nurbs_point};
use gr_ir::measure::{Rates, report};
use gr_ir::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

fn lower(calls: &[Call]) -> Program {
    let mut out = Lowering::new();
    for (line, call) in (0..).zip(calls) {
        out.call(&At { file: FileId(0), line, frame: FrameId::MAIN, now: b"" }, call);
    }
    out.finish()
}

fn at(x: f64, y: f64, z: f64) -> Axes {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn arc(first_end: f64, second_end: f64, first_axis: f64, second_axis: f64, rotation: i32, axis_end: f64) -> Call {
    Call::ArcFeed { first_end, second_end, first_axis, second_axis, rotation, axis_end, rest: [0.0; 6] }
}

fn part() -> Program {
    let mut out = Lowering::new();
    out.builder_mut().file(FileId(0), "part.ngc");
    let frame = CallFrame { parent: FrameId::MAIN, file: FileId(0), line: 20, name: "sub slot".into(), pass: 0 };
    out.frame(FrameId(1), &frame);
    let main = At { file: FileId(0), line: 0, frame: FrameId::MAIN, now: b"" };
    let calls = [
        Call::UseLengthUnits(Units::Inch),
        Call::SetG5xOffset(2, at(1.0, 2.0, -1.0)),
        Call::SetXyRotation(90.0),
        Call::SetFeedMode(0, 0),
        Call::SetFeedRate(60.0),
        Call::SelectTool(3),
        Call::StartChange,
        Call::ChangeTool(1),
        Call::UseToolLengthOffset(at(0.0, 0.0, 4.0), None),
        Call::SetSpindleMode(0, 0.0, None),
        Call::SetSpindleSpeed(0, 1200.0),
        Call::StartSpindleClockwise(0),
        Call::FloodOn,
        Call::StraightTraverse([1.0, 0.0, 1.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        Call::StraightFeed([1.0, 0.0, -0.5, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        arc(0.0, 1.0, 0.0, 0.0, 1, -0.5),
        Call::SelectPlane(Plane::Xz),
        arc(-0.5, 2.0, -0.5, 1.0, -1, 1.0),
        Call::Dwell(0.5),
        Call::Message("half \"way\"".into()),
    ];
    for (line, call) in (0..).zip(&calls) {
        out.call(&At { line, ..main }, call);
    }
    let inside = At { line: 30, frame: FrameId(1), ..main };
    out.mark(&inside, &Mark::CycleBegin(810));
    out.call(&inside, &Call::StraightFeed(at(0.0, 0.0, -1.0)));
    out.mark(&inside, &Mark::CycleEnd);
    out.call(&inside, &Call::WaitInput(3, true, 3, 1.5));
    out.mark(&inside, &Mark::RuntimeValue("#5399".into()));
    out.call(&At { line: 21, ..main }, &Call::ProgramEnd);
    out.finish()
}

#[test]
fn text_of_a_part() {
    insta::assert_snapshot!(text::print(&part(), true));
}

#[test]
fn inches_degrees_and_minutes() {
    let program = part();
    let step = program.get(13).expect("rapid");
    assert_eq!(step.op, Op::Rapid);
    assert_eq!(step.end.axes[..4], [25.4, 0.0, 25.4, FRAC_PI_2]);
    let mut cursor = program.cursor_at(5);
    let state = cursor.next().expect("state").state;
    assert_eq!((state.feed, state.feed_angular), (25.4, TAU / 360.0));
}

#[test]
fn machine_frame_as_the_controller_has_it() {
    // Local offset first, then the turn about Z, then work offset and tool offset.
    let program = lower(&[
        Call::SetG92Offset(at(1.0, 2.0, 3.0)),
        Call::SetXyRotation(90.0),
        Call::SetG5xOffset(1, at(10.0, 20.0, 30.0)),
        Call::UseToolLengthOffset(at(0.0, 0.0, 100.0), None),
        Call::StraightFeed(at(4.0, 5.0, 6.0)),
    ]);
    let mut cursor = program.cursor_at(4);
    let view = cursor.next().expect("move");
    let machine = view.state.machine(&view.end.axes);
    let expected = [10.0 - 7.0, 20.0 + 5.0, 139.0];
    for (m, e) in machine.iter().zip(expected) {
        assert!((m - e).abs() < 1e-12, "{machine:?}");
    }
    let back = view.state.work_frame(&machine);
    assert!((back[0] - 4.0).abs() < 1e-12 && (back[1] - 5.0).abs() < 1e-12);
    // The machine stood at 0 while the frame moved: its work coordinates say so.
    let start = view.state.machine(&view.start.axes);
    assert!(start.iter().all(|v| v.abs() < 1e-12), "{start:?}");
}

#[test]
fn arcs_in_each_plane() {
    for (plane, start, end_middle) in [
        (Plane::Xy, at(1.0, 0.0, 5.0), [0.0, 1.0, 5.0]),
        (Plane::Xz, at(0.0, 5.0, 1.0), [1.0, 5.0, 0.0]),
        (Plane::Yz, at(5.0, 1.0, 0.0), [5.0, 0.0, 1.0]),
    ] {
        let program = lower(&[
            Call::SelectPlane(plane),
            Call::StraightTraverse(start),
            arc(-1.0, 0.0, 0.0, 0.0, 1, 5.0),
            arc(1.0, 0.0, 0.0, 0.0, -2, 7.0),
        ]);
        let step = program.get(2).expect("arc");
        let Op::Arc(a) = step.op else { panic!("{:?}", step.op) };
        let shape = ArcShape::new(&a, &step.start, &step.end);
        let middle = shape.point(0.5);
        for i in 0..3 {
            assert!((middle[i] - end_middle[i]).abs() < 1e-12, "{plane:?} {middle:?}");
        }
        assert!((shape.sweep - PI).abs() < 1e-12);
        let step = program.get(3).expect("helix");
        let Op::Arc(a) = step.op else { panic!("{:?}", step.op) };
        let shape = ArcShape::new(&a, &step.start, &step.end);
        assert!((shape.sweep + 3.0 * PI).abs() < 1e-12);
        assert!((shape.length() - libm::hypot(3.0 * PI, 2.0)).abs() < 1e-12);
    }
}

#[test]
fn full_circle_and_its_box() {
    let program = lower(&[Call::StraightTraverse(at(3.0, 4.0, 0.0)), arc(3.0, 4.0, 0.0, 0.0, 1, -1.0)]);
    let step = program.get(1).expect("circle");
    let mut extent = Extent::default();
    extent.add_move(&step.op, &step.start, &step.end);
    assert_eq!(extent.min.map(|v| (v * 1e9).round() / 1e9), [-5.0, -5.0, -1.0]);
    assert_eq!(extent.max.map(|v| (v * 1e9).round() / 1e9), [5.0, 5.0, 0.0]);
    let mut worst = 0.0f64;
    let mut last = step.start.axes;
    flatten(&step.op, &step.start, &step.end, 0.01, |p| {
        let middle = [(last[0] + p[0]) / 2.0, (last[1] + p[1]) / 2.0];
        worst = worst.max(5.0 - libm::hypot(middle[0], middle[1]));
        last = *p;
    });
    assert!(worst <= 0.01 && worst > 0.005, "{worst}");
    assert_eq!(last, step.end.axes);
}

#[test]
fn box_of_any_arc_holds_its_points() {
    let normals = [[0.3, -0.5, 0.8], [1.0, 0.0, 0.0], [0.0, 0.6, -0.8]];
    for normal in normals {
        for turns in [-3, -1, 1, 2] {
            let start = Pose::at(at(3.0, 1.0, 0.5));
            let arc = Arc { plane: ArcPlane::Free(normal), center: [0.0, 0.5, 1.0], turns };
            // An end on the helix through the start.
            let mut shape = ArcShape::new(&arc, &start, &Pose::at(at(-1.0, 2.0, 4.0)));
            shape.end_radius = shape.radius;
            let mut end = start;
            end.axes[..3].copy_from_slice(&shape.point(1.0));
            let (mut exact, mut seen) = (Extent::default(), Extent::default());
            exact.add_move(&Op::Arc(arc), &start, &end);
            seen.add(start.xyz());
            flatten(&Op::Arc(arc), &start, &end, 1e-6, |p| seen.add([p[0], p[1], p[2]]));
            for i in 0..3 {
                let (below, above) = (seen.min[i] - exact.min[i], exact.max[i] - seen.max[i]);
                assert!((-1e-12..1e-5).contains(&below) && (-1e-12..1e-5).contains(&above), "{below} {above}");
            }
        }
    }
}

#[test]
fn nurbs_begin_and_end_at_their_outer_points() {
    let points = [0.0, 0.0, 1.0, 1.0, 2.0, 1.0, 3.0, 2.0, 1.0, 4.0, 0.0, 1.0];
    assert_eq!(nurbs_point(4, &points, 0.0), Some([0.0, 0.0]));
    assert_eq!(nurbs_point(4, &points, 1.0), Some([4.0, 0.0]));
    // Four points of order 4: a Bézier curve.
    assert_eq!(nurbs_point(4, &points, 0.5), Some([2.0, 1.5]));
    let quarter = [1.0, 0.0, 1.0, 1.0, 1.0, libm::sqrt(0.5), 0.0, 1.0, 1.0];
    let [x, y] = nurbs_point(3, &quarter, 0.3).expect("point");
    assert!((libm::hypot(x, y) - 1.0).abs() < 1e-15);
    let nurbs = Nurbs {
        plane: gr_canon::Plane::Xy,
        order: 3,
        points: vec![[1.0, 0.0, 1.0], [1.0, 1.0, libm::sqrt(0.5)], [0.0, 1.0, 1.0]],
        ..Nurbs::default()
    };
    // The same curve with its knots, as G6.2 of LinuxCNC 2.10 sends it: the last lines hold knots only.
    let mut knotted = nurbs.clone();
    knotted.points.extend([[9.0, 9.0, 1.0]; 3]);
    knotted.knots = vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
    let mut halved = knotted.clone();
    halved.points.insert(1, [1.0, libm::sqrt(0.5), 1.0]);
    halved.knots = vec![0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0];
    for curve in [nurbs, knotted] {
        let program =
            lower(&[Call::SetFeedRate(60.0), Call::StraightTraverse(at(1.0, 0.0, 0.0)), Call::NurbsFeed(Box::new(curve))]);
        let r = report(&program, &Rates::default());
        assert!((r.totals.feed_nm as f64 / 1e6 - FRAC_PI_2).abs() < 1e-4);
    }
    let program = lower(&[Call::SetFeedRate(60.0), Call::NurbsFeed(Box::new(halved))]);
    let mut end = [0.0; 2];
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        end = [view.end.axes[0], view.end.axes[1]];
    }
    assert_eq!(end, [0.0, 1.0]);
}

#[test]
fn times_and_tools() {
    let r = report(&part(), &Rates::default());
    assert_eq!(r.tools.len(), 1);
    let tool = &r.tools[0];
    assert_eq!((tool.tool, tool.changes, tool.coolant), (3, 1, (true, false)));
    assert_eq!(tool.rpm.0, Some((1200.0, 1200.0)));
    assert_eq!(r.cycles[0].passes, 1);
    assert!(r.run_time);
    assert_eq!(r.totals.wait_ns, 500_000_000);
    // 1.5 in down, a quarter of radius 1 in, half a turn of radius 1 rising 0 (Y stays), then the cycle.
    let plunge = 1.5 * 25.4;
    let quarter = FRAC_PI_2 * 25.4;
    assert!(r.totals.feed_nm as f64 / 1e6 > plunge + quarter);
    assert_eq!(r.totals.untimed, 0);
    let expected = r.totals.feed_nm as f64 / 25.4 * 1e3;
    assert!((r.totals.feed_ns as f64 - expected).abs() < 1e4, "{} {expected}", r.totals.feed_ns);
}

#[test]
fn rotary_moves_go_by_degrees() {
    let turn = |a: f64| [0.0, 0.0, 0.0, a, 0.0, 0.0, 0.0, 0.0, 0.0];
    let program = lower(&[Call::SetFeedRate(360.0), Call::StraightFeed(turn(180.0))]);
    let r = report(&program, &Rates::default());
    assert_eq!((r.totals.feed_ns, r.totals.feed_nm), (30_000_000_000, 0));
}

#[test]
fn equal_motion_in_other_blocks() {
    let whole = [
        Call::SetFeedRate(100.0),
        Call::StraightTraverse(at(1.0, 0.0, 0.0)),
        arc(1.0, 0.0, 0.0, 0.0, 1, 0.0),
        Call::StraightFeed(at(11.0, 0.0, 0.0)),
        Call::Dwell(1.0),
        Call::StraightFeed(at(11.0, 5.0, 0.0)),
    ];
    let cut = [
        Call::SetFeedRate(100.0),
        Call::StraightTraverse(at(1.0, 0.0, 0.0)),
        arc(-1.0, 0.0, 0.0, 0.0, 1, 0.0),
        arc(1.0, 0.0, 0.0, 0.0, 1, 0.0),
        Call::StraightFeed(at(4.0, 0.0, 0.0)),
        Call::StraightFeed(at(11.0, 0.0, 0.0)),
        Call::Dwell(1.0),
        Call::StraightFeed(at(11.0, 5.0, 0.0)),
    ];
    let (a, b) = (lower(&whole), lower(&cut));
    let same = diff(&a, &a, &Tolerance::default());
    assert!(same.is_empty() && !same.resegmented && same.deviation == 0.0);
    let result = diff(&a, &b, &Tolerance::default());
    assert!(result.is_empty() && result.resegmented, "{result:?}");
    let mut other = cut.clone();
    other[4] = Call::StraightFeed(at(4.0, 0.01, 0.0));
    let result = diff(&a, &lower(&other), &Tolerance::default());
    assert_eq!(result.differences[0].aspect, Aspect::Path);
    assert_eq!(result.differences[0].b.map(|b| b.1.line), Some(4));
    let loose = Tolerance { length: 0.02, ..Tolerance::default() };
    assert!(diff(&a, &lower(&other), &loose).is_empty());
}

#[test]
fn the_other_way_round_is_another_path() {
    let a = lower(&[Call::StraightTraverse(at(1.0, 0.0, 0.0)), arc(-1.0, 0.0, 0.0, 0.0, 1, 0.0)]);
    let b = lower(&[Call::StraightTraverse(at(1.0, 0.0, 0.0)), arc(-1.0, 0.0, 0.0, 0.0, -1, 0.0)]);
    assert!(diff(&a, &b, &Tolerance::default()).differs(Aspect::Path));
}

#[test]
fn feeds_tools_and_events_are_told_apart() {
    let base = [
        Call::SelectTool(1),
        Call::ChangeTool(1),
        Call::SetFeedRate(100.0),
        Call::StartSpindleClockwise(0),
        Call::StraightFeed(at(1.0, 0.0, 0.0)),
        Call::Dwell(1.0),
        Call::StraightFeed(at(2.0, 0.0, 0.0)),
    ];
    let cases = [
        (0, Call::SelectTool(2), Aspect::Tool),
        (2, Call::SetFeedRate(200.0), Aspect::Feed),
        (3, Call::StartSpindleCounterclockwise(0), Aspect::Spindle),
        (3, Call::FloodOn, Aspect::Coolant),
        (5, Call::Dwell(2.0), Aspect::Event),
        (4, Call::StraightTraverse(at(1.0, 0.0, 0.0)), Aspect::Path),
        (3, Call::SetG5xOffset(2, at(0.0, 0.0, 0.0)), Aspect::Event),
    ];
    for (index, call, aspect) in cases {
        let mut other = base.clone();
        other[index] = call.clone();
        let result = diff(&lower(&base), &lower(&other), &Tolerance::default());
        assert!(result.differs(aspect), "{call:?} {result:?}");
    }
}

/// A rapid in front of the cut must not swallow the difference; programs of rapids alone are compared too.
#[test]
fn spindles_and_coolant_behind_rapids_are_told_apart() {
    let rapid = Call::StraightTraverse(at(1.0, 0.0, 0.0));
    let cut = Call::StraightFeed(at(2.0, 0.0, 0.0));
    for (ways, told) in [(vec![rapid.clone(), cut.clone(), cut.clone()], 1), (vec![rapid.clone()], 1), (vec![], 0)] {
        let program = |spindle: Call, extra: Option<Call>| {
            let start = [Call::SetFeedRate(100.0), Call::SetSpindleSpeed(0, 500.0), spindle];
            lower(&start.into_iter().chain(extra).chain(ways.iter().cloned()).collect::<Vec<_>>())
        };
        let base = program(Call::StartSpindleClockwise(0), None);
        let left = program(Call::StartSpindleCounterclockwise(0), None);
        let wet = program(Call::StartSpindleClockwise(0), Some(Call::FloodOn));
        for (other, aspect) in [(left, Aspect::Spindle), (wet, Aspect::Coolant)] {
            let result = diff(&base, &other, &Tolerance::default());
            assert_eq!((result.count, result.differs(aspect)), (told, told == 1), "{aspect:?} {result:?}");
        }
    }
    // The spindle starts in front of the rapid or behind it: the cuts are the same.
    let (on, feed) = (Call::StartSpindleClockwise(0), Call::SetFeedRate(100.0));
    let early = lower(&[feed.clone(), on.clone(), rapid.clone(), cut.clone()]);
    let late = lower(&[feed, rapid, on, cut]);
    assert!(diff(&early, &late, &Tolerance::default()).is_empty());
}

/// What offsets leave by rounding in an axis that stands still makes no linear move of a rotary one.
#[test]
fn rounding_does_not_change_what_a_feed_is() {
    let turn = |dust: f64| {
        let mut end = at(1.0 + dust, 0.0, 0.0);
        end[3] = 90.0;
        lower(&[Call::SetFeedRate(360.0), Call::StraightTraverse(at(1.0, 0.0, 0.0)), Call::StraightFeed(end)])
    };
    let result = diff(&turn(0.0), &turn(1e-12), &Tolerance::default());
    assert!(result.is_empty(), "{result:?}");
    let result = diff(&turn(0.0), &turn(1e-3), &Tolerance { length: 1.0, ..Tolerance::default() });
    assert!(result.differs(Aspect::Feed), "{result:?}");
}

#[test]
fn a_million_moves_in_64_bytes_each() {
    let mut out = Lowering::new();
    for line in 0..1_000_000u32 {
        let t = f64::from(line);
        let here = At { file: FileId(0), line, frame: FrameId::MAIN, now: b"" };
        out.call(&here, &Call::StraightFeed(at(t * 0.01, t * 0.02 + 1.0, libm::sin(t))));
    }
    let program = out.finish();
    let each = program.bytes() as f64 / 1e6;
    println!("{each:.1} bytes per move");
    assert!(each <= 64.0, "{each}");
    assert_eq!(program.get(999_999).expect("last").source.line, 999_999);
}

#[test]
fn pieces_join_to_the_whole() {
    let calls: Vec<Call> = (0..2000)
        .map(|i| match i % 7 {
            0 => Call::SetG5xOffset(1, at(f64::from(i), 0.0, 1.0)),
            1 => Call::SetFeedRate(f64::from(i)),
            _ => Call::StraightFeed(at(f64::from(i), f64::from(i % 3), 0.0)),
        })
        .collect();
    let whole = lower(&calls);
    let mut first = lower(&calls[..700]);
    let (pose, state) = {
        let c = first.cursor_at(first.len());
        (*c.pose(), *c.state())
    };
    let mut rest = Lowering::from_state(pose, state);
    for (line, call) in (700..).zip(&calls[700..]) {
        rest.call(&At { file: FileId(0), line, frame: FrameId::MAIN, now: b"" }, call);
    }
    first.append(&rest.finish());
    assert_eq!(first, whole);
}

mod shapes {
    use super::*;
    use proptest::prelude::*;

    /// A path of lines and half circles; `cut` gives every piece a middle stop.
    fn path(corners: &[(f64, f64, bool)], cut: Option<f64>, bump: f64) -> Program {
        let mut calls = vec![Call::SetFeedRate(100.0), Call::StraightTraverse(at(0.0, 0.0, 0.0))];
        let mut here = (0.0, 0.0);
        for &(x, y, round) in corners {
            let center = ((here.0 + x) / 2.0, (here.1 + y) / 2.0);
            let side = (center.0 - (y - here.1) / 2.0, center.1 + (x - here.0) / 2.0);
            match (round, cut) {
                (true, Some(_)) => {
                    calls.push(arc(side.0, side.1, center.0, center.1, -1, 0.0));
                    calls.push(arc(x, y, center.0, center.1, -1, 0.0));
                }
                (true, None) => calls.push(arc(x, y, center.0, center.1, -1, 0.0)),
                (false, cut) => {
                    if let Some(t) = cut {
                        let there = (here.0 + (x - here.0) * t, here.1 + (y - here.1) * t);
                        calls.push(Call::StraightFeed(at(there.0, there.1, bump)));
                    }
                    calls.push(Call::StraightFeed(at(x, y, 0.0)));
                }
            }
            here = (x, y);
        }
        lower(&calls)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn cutting_moves_changes_nothing(
            corners in prop::collection::vec((-50.0..50.0f64, -50.0..50.0f64, any::<bool>()), 1..8),
            t in 0.1..0.9f64,
            bump in 0.01..1.0f64,
        ) {
            let tolerance = Tolerance { length: 1e-4, ..Tolerance::default() };
            let whole = path(&corners, None, 0.0);
            let same = diff(&whole, &path(&corners, Some(t), 0.0), &tolerance);
            prop_assert!(same.is_empty(), "{:?}", same);
            if corners.iter().any(|c| !c.2) {
                let other = diff(&whole, &path(&corners, Some(t), bump), &tolerance);
                prop_assert!(other.differs(Aspect::Path));
                let turned = diff(&path(&corners, Some(t), bump), &whole, &tolerance);
                prop_assert!(turned.differs(Aspect::Path));
            }
        }
    }
}
