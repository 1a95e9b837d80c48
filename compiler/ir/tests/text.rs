//! The text form: print → parse is exact, for any program.

use gr_canon::CallFrame;
use gr_ir::text::{parse, print};
use gr_ir::*;
use proptest::prelude::*;

/// Boxed: dozens of them in one strategy would not fit on the stack of a test.
fn number() -> BoxedStrategy<f64> {
    prop_oneof![
        4 => -1000.0..1000.0f64,
        1 => any::<f64>().prop_filter("finite", |v| v.is_finite()),
        1 => Just(0.0),
        1 => Just(-0.0),
        1 => (-100i32..100).prop_map(f64::from),
    ]
    .boxed()
}

fn axes() -> impl Strategy<Value = Axes> {
    prop::array::uniform9(number())
}

fn plane() -> impl Strategy<Value = Plane> {
    prop::sample::select(vec![Plane::Xy, Plane::Yz, Plane::Xz, Plane::Uv, Plane::Vw, Plane::Uw])
}

fn marker() -> impl Strategy<Value = Marker> {
    prop::sample::select(vec![Marker::Tool, Marker::Cycle, Marker::Workingstep, Marker::Feature, Marker::Tolerance, Marker::Contour])
}

fn three() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(number())
}

/// Operations with their texts and points leaked: tests may.
fn op() -> impl Strategy<Value = Op<'static>> {
    let text = || any::<String>().prop_map(|s| -> &'static str { s.leak() });
    let int = || -9i32..99;
    let arc = (three(), three(), plane(), any::<bool>(), -3i32..4).prop_map(|(center, n, plane, free, turns)| {
        let plane = if free { ArcPlane::Free(n) } else { ArcPlane::Work(plane) };
        Op::Arc(Arc { plane, center, turns })
    });
    let motion = prop_oneof![
        Just(Op::Rapid),
        Just(Op::Linear),
        arc,
        (2u32..5, prop::collection::vec(three(), 0..6))
            .prop_map(|(order, p)| { Op::Nurbs { order, points: p.concat().leak() } }),
        any::<u8>().prop_map(Op::Probe),
        (three(), number()).prop_map(|(bottom, scale)| Op::RigidTap { bottom, scale }),
        number().prop_map(Op::Dwell),
        (int(), number(), any::<bool>())
            .prop_map(|(spindle, per_rev, velocity)| { Op::SyncStart(Sync { spindle, per_rev, velocity }) }),
    ];
    let frames = prop_oneof![
        (axes(), proptest::option::of(0u32..100)).prop_map(|(offset, number)| Op::ToolOffset { offset, number }),
        (1u8..10, axes()).prop_map(|(n, a)| Op::WorkOffset(n, a)),
        (1u8..10, axes(), number()).prop_map(|(number, offset, rotation)| Op::StoredOffset { number, offset, rotation }),
        axes().prop_map(Op::LocalOffset),
        number().prop_map(Op::Rotation),
        (int(), int(), axes(), three(), 0i32..10).prop_map(|(pocket, tool, offset, v, orientation)| {
            Op::ToolEntry { pocket, tool, offset, diameter: v[0], front: v[1], back: v[2], orientation }
        }),
    ];
    let modes = prop_oneof![
        any::<bool>().prop_map(Op::ProbeMode),
        prop::sample::select(vec![Units::Inch, Units::Mm]).prop_map(Op::Units),
        plane().prop_map(Op::Plane),
        (int(), prop::sample::select(vec![FeedMode::PerTime, FeedMode::PerRev, FeedMode::Inverse]))
            .prop_map(|(spindle, mode)| Op::FeedMode { spindle, mode }),
        (number(), number()).prop_map(|(linear, angular)| Op::Feed { linear, angular }),
        prop::sample::select(vec![Op::PathMode(PathMode::ExactStop), Op::PathMode(PathMode::ExactPath)]),
        number().prop_map(|t| Op::PathMode(PathMode::Blend(t))),
        number().prop_map(Op::MergeTolerance),
        prop::option::of(number()).prop_map(Op::Planner),
        (int(), prop::option::of(number())).prop_map(|(spindle, surface)| Op::SpindleMode { spindle, surface }),
        (int(), number()).prop_map(|(spindle, speed)| Op::SpindleSpeed { spindle, speed }),
        (int(), prop::sample::select(vec![Turn::Cw, Turn::Ccw, Turn::Stop]))
            .prop_map(|(spindle, turn)| Op::SpindleTurn { spindle, turn }),
        (int(), number(), int()).prop_map(|(spindle, angle, direction)| Op::SpindleOrient {
            spindle,
            angle,
            direction
        }),
        (int(), number()).prop_map(|(spindle, timeout)| Op::SpindleWait { spindle, timeout }),
    ];
    let rest = prop_oneof![
        prop::sample::select(vec![
            Op::SyncStop,
            Op::FeedReferenceXyz,
            Op::Mist(true),
            Op::Flood(false),
            Op::ToolChangeStart,
            Op::ToolReload,
            Op::Override(Override::Feed, false),
            Op::Override(Override::Adaptive, true),
            Op::Override(Override::FeedHold, true),
            Op::Override(Override::Speed(3), false),
            Op::LogClose,
            Op::Stop(Stop::Program),
            Op::Stop(Stop::Optional),
            Op::Stop(Stop::Pallet),
            Op::Finish,
            Op::Reset,
            Op::End,
            Op::IndexerLock(4, true),
        ]),
        int().prop_map(Op::ToolPrepare),
        int().prop_map(Op::ToolChange),
        int().prop_map(Op::ToolNumber),
        (int(), any::<bool>(), any::<bool>()).prop_map(|(index, on, synced)| Op::DigitalOut { index, on, synced }),
        (int(), number(), any::<bool>()).prop_map(|(index, value, synced)| Op::AnalogOut { index, value, synced }),
        (int(), any::<bool>(), int(), number())
            .prop_map(|(index, digital, wait, timeout)| { Op::InputWait { index, digital, wait, timeout } }),
        text().prop_map(Op::RunTime),
        (prop::sample::select(vec![Note::Comment, Note::Message, Note::Log, Note::LogOpen, Note::LogAppend]), text())
            .prop_map(|(n, t)| Op::Note(n, t)),
        (int(), number(), number()).prop_map(|(code, p, q)| Op::UserM { code, p, q }),
        (marker(), int(), text()).prop_map(|(marker, code, text)| Op::Begin { marker, code, text }),
        marker().prop_map(Op::Close),
    ];
    prop_oneof![4 => motion, 1 => frames, 2 => modes, 2 => rest]
}

fn pose() -> impl Strategy<Value = Pose> {
    (axes(), any::<[bool; 9]>(), prop::option::weighted(0.2, three()), prop::option::weighted(0.1, number())).prop_map(
        |(mut axes, keep, tool_axis, spin)| {
            for (v, keep) in axes.iter_mut().zip(keep) {
                if keep {
                    *v = 1.5;
                }
            }
            Pose { axes, tool_axis, spin }
        },
    )
}

fn source() -> impl Strategy<Value = Source> {
    (0u32..3, prop_oneof![0u32..400, any::<u32>()], 0u32..3).prop_map(|(file, line, frame)| Source {
        file: FileId(file),
        line,
        frame: FrameId(frame),
    })
}

fn build(ops: &[(Op<'static>, Pose, Source)]) -> Program {
    let mut builder = Builder::new();
    builder.file(FileId(0), "part \"1\".ngc");
    let frame = CallFrame { parent: FrameId(0), file: FileId(0), line: 7, name: "sub hole".into(), pass: 0 };
    builder.frame(FrameId(1), &frame);
    builder.frame(FrameId(2), &CallFrame { parent: FrameId(1), pass: 3, ..frame });
    for (op, pose, source) in ops {
        builder.push_to(*op, pose, *source);
    }
    builder.finish()
}

fn same_bits(a: &Pose, b: &Pose) -> bool {
    a == b && a.axes.iter().zip(&b.axes).all(|(x, y)| x.to_bits() == y.to_bits())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn text_round_trip(ops in prop::collection::vec((op(), pose(), source()), 0..60)) {
        let program = build(&ops);
        let text = print(&program, true);
        let again = parse(&text).map_err(|e| TestCaseError::fail(format!("{e}\n{text}")))?;
        // NaN can come out of sums of huge offsets; then text still says everything.
        prop_assert_eq!(&print(&again, true), &text);
        if !text.contains("NaN") {
            prop_assert_eq!(&again, &program);
        }
    }

    #[test]
    fn columns_keep_everything(ops in prop::collection::vec((op(), pose(), source()), 1..40), times in 1usize..60) {
        let ops = ops.repeat(times);
        let program = build(&ops);
        prop_assert_eq!(program.len(), ops.len());
        let mut cursor = program.cursor();
        for (op, pose, source) in &ops {
            let view = cursor.next().expect("as many as pushed");
            prop_assert_eq!(view.source, *source);
            if op.moves() {
                let same = same_bits(view.end, pose);
                prop_assert!(same);
            }
            match (op, view.op) {
                // Along the normal the centre is the start's; bits may be NaN.
                (Op::Arc(a), Op::Arc(b)) => prop_assert_eq!(a.turns, b.turns),
                (a, b) => prop_assert_eq!(*a, b),
            }
        }
        prop_assert!(cursor.next().is_none());
    }

    #[test]
    fn reading_from_anywhere(ops in prop::collection::vec((op(), pose(), source()), 1..30), at in 0usize..3000) {
        let program = build(&ops.repeat(100));
        let mut straight = program.cursor();
        for _ in 0..at.min(program.len()) {
            straight.next();
        }
        let mut jumped = program.cursor_at(at);
        prop_assert_eq!(format!("{:?}", straight.next()), format!("{:?}", jumped.next()));
    }
}

#[test]
fn errors_name_the_line() {
    let cases = [
        ("", "line 1: the text begins with `motion 1`"),
        ("motion 1\nrapid q=1", "line 2: `rapid` has no field `q`"),
        ("motion 1\n\n; note\nfly x=1", "line 4: unknown operation `fly`"),
        ("motion 1\nrapid x=abc", "line 2: `abc` is not a number that fits here"),
        ("motion 1\ncomment \"open", "line 2: the text has no closing quote"),
        ("motion 1\narc xy center=1,2 x=3", "line 2: `arc` needs `turns=`"),
        ("motion 1\nmist maybe", "line 2: `maybe` stands where one of on, off belongs"),
        ("motion 1\nrapid x=1 @0:0", "line 2: lines count from 1"),
    ];
    for (text, message) in cases {
        assert_eq!(parse(text).expect_err(text).to_string(), message);
    }
}
