//! Motion → STEP-NC → motion.

use gr_ir::{Arc, ArcPlane, Builder, Marker, Op, PathMode, Plane, Pose, Program, Source, Stop, Turn};
use gr_planner::stepnc::{Described, Options, write};
use gr_planner::{Options as PlanOptions, plan};
use gr_text::{FileId, Severity, code};
use proptest::prelude::*;

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::at([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
}

struct Build(Builder);

impl Build {
    fn new() -> Build {
        Build(Builder::new())
    }
    fn push(&mut self, op: Op<'_>) {
        self.0.push(op, Source::default());
    }
    fn to(&mut self, op: Op<'_>, x: f64, y: f64, z: f64) {
        self.0.push_to(op, &at(x, y, z), Source::default());
    }
    fn tool(&mut self, n: i32) {
        for op in [Op::ToolPrepare(n), Op::ToolChangeStart, Op::ToolChange(n), Op::ToolOffset { offset: [0.0; 9], number: None }] {
            self.push(op);
        }
    }
    fn spindle(&mut self, rpm: f64, turn: Turn) {
        self.push(Op::SpindleSpeed { spindle: 0, speed: rpm });
        self.push(Op::SpindleTurn { spindle: 0, turn });
    }
    fn feed(&mut self, f: f64) {
        self.push(Op::Feed { linear: f, angular: 0.0 });
    }
}

/// What must survive: each move with what holds for it, and stops.
#[derive(Debug, PartialEq, Clone)]
enum Seen {
    Move { rapid: bool, arc: Option<([f64; 3], bool)>, end: [f64; 3], feed: f64, speed: f64, turn: Turn, flood: bool, mist: bool, tool: i32 },
    Dwell(f64),
    Stop(Stop),
}

fn seen(program: &Program) -> Vec<Seen> {
    let mut out = Vec::new();
    let mut c = program.cursor();
    // The way to the first place of a tool is the reader's own: it may start the spindle when it is there.
    let mut own_way = true;
    while let Some(v) = c.next() {
        own_way = (own_way || matches!(v.op, Op::ToolChange(_))) && !v.op.feeds();
        match v.op {
            Op::Stop(s) => out.push(Seen::Stop(s)),
            Op::Dwell(s) => out.push(Seen::Dwell(s)),
            op if op.moves() && v.start.xyz() != v.end.xyz() => {
                let arc = match op {
                    Op::Arc(a) => Some((a.center, a.turns > 0)),
                    _ => None,
                };
                let s = v.state;
                let rapid = op == Op::Rapid;
                let (turn, speed) = if own_way { (Turn::Stop, 0.0) } else { (s.spindles[0].turn, s.spindles[0].speed) };
                out.push(Seen::Move {
                    rapid,
                    arc,
                    end: v.end.xyz(),
                    feed: if rapid { 0.0 } else { s.feed },
                    speed: if turn == Turn::Stop { 0.0 } else { speed },
                    turn,
                    flood: s.flood && !own_way,
                    mist: s.mist && !own_way,
                    tool: s.tool.max(0),
                });
            }
            _ => {}
        }
    }
    out
}

fn close(a: &Seen, b: &Seen) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * (1.0 + a.abs() * 1e-6);
    match (a, b) {
        (
            Seen::Move { rapid, arc, end, feed, speed, turn, flood, mist, .. },
            Seen::Move { rapid: r, arc: ar, end: e, feed: f, speed: s, turn: t, flood: fl, mist: m, .. },
        ) => {
            let arcs = match (arc, ar) {
                (Some((c, ccw)), Some((d, dcw))) => ccw == dcw && near(c[0], d[0]) && near(c[1], d[1]),
                (None, None) => true,
                _ => false,
            };
            arcs && rapid == r && (0..3).all(|i| near(end[i], e[i])) && near(*feed, *f) && near(*speed, *s) && (turn, flood, mist) == (t, fl, m)
        }
        _ => a == b,
    }
}

fn round_trip(program: &Program) -> (Vec<Seen>, Vec<Seen>, String) {
    let options = Options { name: "part".into(), tools: vec![Described::mill(1, 10.0, 0.0), Described::mill(2, 6.0, 0.0)], ..Options::default() };
    let (text, notes) = write(program, &options).expect("written");
    assert!(notes.is_empty(), "{notes:?}");
    let (planned, out) = plan(text.as_bytes(), FileId(0), &PlanOptions::default());
    let errors: Vec<_> = out.iter().filter(|d| d.severity == Severity::Error).collect();
    assert!(errors.is_empty(), "{errors:#?}\n{text}");
    let (mut a, mut b) = (seen(program), seen(&planned.expect("a program").program));
    // Until X, Y and Z have been named nobody knows where the machine stands: the ways there may differ.
    let (mut at, mut known, mut begin) = ([0.0; 3], [false; 3], 0);
    for s in &a {
        let Seen::Move { rapid: true, end, .. } = s else { break };
        if known == [true; 3] {
            break;
        }
        known = std::array::from_fn(|i| known[i] || at[i] != end[i]);
        (at, begin) = (*end, begin + 1);
    }
    let there = b.iter().take_while(|s| matches!(s, Seen::Move { rapid: true, .. })).position(|s| matches!(s, Seen::Move { end, .. } if *end == at));
    if begin > 0 && known == [true; 3] {
        a.drain(..begin);
        b.drain(..=there.unwrap_or_else(|| panic!("{at:?} is not reached\n{text}")));
    } else {
        let way = |s: &Vec<Seen>| s.iter().take_while(|s| matches!(s, Seen::Move { rapid: true, .. })).count();
        let (n, m) = (way(&a), way(&b));
        a.drain(..n);
        b.drain(..m);
    }
    (a, b, text)
}

fn part() -> Program {
    let mut b = Build::new();
    b.tool(1);
    b.to(Op::Rapid, 0.0, 0.0, 50.0);
    b.spindle(1200.0, Turn::Cw);
    b.push(Op::Flood(true));
    b.to(Op::Rapid, 10.0, 10.0, 50.0);
    b.to(Op::Rapid, 10.0, 10.0, 2.0);
    b.feed(3.3333333333333335);
    b.to(Op::Linear, 10.0, 10.0, -2.0);
    b.feed(10.0);
    b.to(Op::Linear, 30.0, 10.0, -2.0);
    let arc = |x, y, turns| Op::Arc(Arc { plane: ArcPlane::Work(Plane::Xy), center: [x, y, -2.0], turns });
    b.to(arc(30.0, 20.0, 1), 40.0, 20.0, -2.0);
    b.to(arc(30.0, 20.0, -1), 30.0, 10.0, -2.0);
    b.push(Op::Dwell(0.5));
    b.push(Op::Stop(Stop::Program));
    b.to(Op::Linear, 30.0, 5.0, -2.0);
    b.to(Op::Rapid, 30.0, 5.0, 50.0);
    b.push(Op::Flood(false));
    b.push(Op::SpindleTurn { spindle: 0, turn: Turn::Stop });
    b.tool(2);
    b.spindle(900.0, Turn::Ccw);
    b.push(Op::Mist(true));
    b.to(Op::Rapid, 0.0, 0.0, 50.0);
    b.to(Op::Linear, 0.0, 0.0, -1.0);
    b.push(Op::Stop(Stop::Optional));
    b.to(Op::Rapid, 0.0, 0.0, 50.0);
    b.push(Op::End);
    b.0.finish()
}

#[test]
fn there_and_back() {
    let (a, b, text) = round_trip(&part());
    assert_eq!(a.len(), b.len(), "{a:#?}\n{b:#?}");
    for (x, y) in a.iter().zip(&b) {
        assert!(close(x, y), "{x:?}\n{y:?}");
    }
    insta::assert_snapshot!(text);
}

#[test]
fn the_written_file_keeps_to_the_schema() {
    let options = Options::default();
    let (text, _) = write(&part(), &options).expect("written");
    let exchange = gr_p21::parse(text.as_bytes());
    assert!(exchange.faults.is_empty(), "{:?}", exchange.faults);
    let faults = gr_step::check(text.as_bytes(), &exchange);
    assert!(faults.is_empty(), "{faults:?}\n{text}");
}

#[test]
fn no_counterpart_is_an_error_or_a_listed_loss() {
    let mut b = Build::new();
    b.to(Op::Rapid, 1.0, 0.0, 5.0);
    b.to(Op::Probe(0), 0.0, 0.0, 1.0);
    b.push(Op::DigitalOut { index: 1, on: true, synced: true });
    b.push(Op::RigidTap { bottom: [0.0; 3], scale: 1.0 });
    let program = b.0.finish();
    let faults = write(&program, &Options::default()).expect_err("refused");
    assert_eq!(faults.len(), 3);
    assert!(faults.iter().all(|d| d.code == code::STEPNC_NO_COUNTERPART));
    let (_, notes) = write(&program, &Options { lossy: true, ..Options::default() }).expect("written");
    assert_eq!(notes.len(), 3);
    assert!(notes.iter().all(|d| d.code == code::STEPNC_LEFT_OUT && d.severity == Severity::Warning));
}

#[test]
fn workingsteps_keep_their_names() {
    let mut b = Build::new();
    b.tool(1);
    b.spindle(100.0, Turn::Cw);
    b.feed(1.0);
    b.push(Op::Begin { marker: Marker::Workingstep, code: 7, text: "it's a pocket" });
    b.to(Op::Rapid, 1.0, 2.0, 3.0);
    b.to(Op::Linear, 1.0, 2.0, 0.0);
    b.push(Op::Close(Marker::Workingstep));
    let (text, _) = write(&b.0.finish(), &Options::default()).expect("written");
    assert!(text.contains("MACHINING_WORKINGSTEP('it''s a pocket'"), "{text}");
}

proptest! {
    #[test]
    fn any_moves_there_and_back(moves in prop::collection::vec((0..6u8, -100.0..100.0f64, -100.0..100.0f64, -20.0..50.0f64), 1..40)) {
        let mut b = Build::new();
        b.tool(1);
        b.to(Op::Rapid, 0.5, 0.25, 50.0);
        b.spindle(1000.0, Turn::Cw);
        b.feed(5.0);
        for (kind, x, y, z) in moves {
            match kind {
                0 => b.to(Op::Rapid, x, y, z),
                1 | 2 => b.to(Op::Linear, x, y, z),
                3 => b.feed(1.0 + x.abs()),
                4 => b.push(Op::Flood(x > 0.0)),
                _ => b.push(Op::Dwell(1.0 + y.abs())),
            }
        }
        let program = b.0.finish();
        let (a, b, text) = round_trip(&program);
        prop_assert_eq!(a.len(), b.len(), "{}", text);
        for (x, y) in a.iter().zip(&b) {
            prop_assert!(close(x, y), "{:?}\n{:?}\n{}", x, y, text);
        }
    }
}

/// A tool without a diameter is told once, at its first move.
/// How a control rounds corners is no part of a process plan: told once, at the program's own word.
#[test]
fn path_modes_are_told() {
    let told = |modes: &[PathMode], planned: bool| -> Vec<String> {
        let mut b = Build::new();
        b.tool(1);
        b.feed(5.0);
        for mode in modes {
            b.push(Op::PathMode(*mode));
        }
        b.to(Op::Rapid, 1.0, 1.0, 5.0);
        b.to(Op::Linear, 10.0, 1.0, 5.0);
        b.push(Op::End);
        let options = Options { tools: vec![Described::mill(1, 10.0, 0.0)], planned, ..Options::default() };
        let (_, notes) = write(&b.0.finish(), &options).expect("written");
        assert!(notes.iter().all(|d| d.code == code::STEPNC_NO_PATH_MODE));
        notes.iter().map(|d| format!("{:?} {}", d.severity, d.message)).collect()
    };
    let no = "is not in the STEP-NC file: ISO 14649 has no path modes";
    assert_eq!(told(&[], false), Vec::<String>::new());
    assert_eq!(told(&[PathMode::Blend(0.05), PathMode::ExactPath], false), [format!("Warning rounding corners by up to 0.05 mm (G64 P) {no}")]);
    assert_eq!(told(&[PathMode::ExactPath], false), [format!("Warning exact corners (G61) {no}")]);
    assert_eq!(told(&[PathMode::ExactStop], false), [format!("Warning stopping at every corner (G61.1) {no}")]);
    assert_eq!(told(&[PathMode::Blend(0.0)], false), [format!("Warning rounding corners (G64) {no}")]);
    assert_eq!(told(&[PathMode::Blend(0.01)], true), Vec::<String>::new());
}

/// Cycles go on the exact path and give back what was before: nobody has named that.
#[test]
fn the_exact_path_of_a_cycle_is_its_own() {
    let told = |own: Option<(u32, PathMode)>, back: bool| -> String {
        let mut b = Build::new();
        b.tool(1);
        b.feed(5.0);
        b.to(Op::Linear, 1.0, 1.0, 5.0);
        let mut b = b.0;
        let mut at = |line: u32, op: Op<'_>| b.push(op, Source { line, ..Source::default() });
        if let Some((line, mode)) = own {
            at(line, Op::PathMode(mode));
        }
        if back {
            at(6, Op::PathMode(PathMode::ExactPath));
        }
        for _ in 0..2 {
            at(6, Op::Begin { marker: Marker::Cycle, code: 810, text: "" });
            at(6, Op::Dwell(1.0));
            at(6, Op::Close(Marker::Cycle));
        }
        if back {
            at(6, Op::PathMode(PathMode::Blend(0.0)));
        }
        at(7, Op::PathMode(PathMode::ExactStop));
        at(8, Op::End);
        let (_, notes) = write(&b.finish(), &Options::default()).expect("written");
        let modes: Vec<String> = notes.into_iter().filter(|d| d.code == code::STEPNC_NO_PATH_MODE).map(|d| d.message).collect();
        assert_eq!(modes.len(), 1);
        modes.concat()
    };
    assert!(told(None, true).contains("G61.1"));
    // In the block of the cycle or before it, it is the program's own.
    assert!(told(Some((6, PathMode::ExactPath)), false).contains("(G61)"));
    assert!(told(Some((5, PathMode::Blend(0.1))), true).contains("G64 P"));
}

#[test]
fn an_unknown_tool_is_told() {
    let mut b = Build::new();
    b.feed(5.0);
    b.to(Op::Rapid, 1.0, 1.0, 5.0);
    b.to(Op::Linear, 1.0, 1.0, 0.0);
    b.tool(2);
    b.to(Op::Linear, 2.0, 1.0, 0.0);
    b.to(Op::Linear, 3.0, 1.0, 0.0);
    let program = b.0.finish();
    let notes = |tools: Vec<Described>| {
        let (_, notes) = write(&program, &Options { tools, ..Options::default() }).expect("it can be written");
        notes.iter().map(|d| (d.code, d.message.split(" is not").next().unwrap_or_default().to_string())).collect::<Vec<_>>()
    };
    let told = |name: &str| (code::STEPNC_TOOL_UNKNOWN, name.to_string());
    assert_eq!(notes(Vec::new()), [told("the tool"), told("tool 2")]);
    assert_eq!(notes(vec![Described::mill(2, 0.0, 10.0)]), [told("the tool"), told("tool 2")]);
    assert_eq!(notes(vec![Described::mill(2, 6.0, 10.0)]), [told("the tool")]);
}

/// ISO 14649 has no helix: what stands for it, and how far from it, is told once.
#[test]
fn helices_in_chords_are_told() {
    let mut b = Build::new();
    b.tool(1);
    b.feed(5.0);
    b.to(Op::Rapid, 10.0, 1.0, 5.0);
    for k in 0..3 {
        let arc = Arc { plane: ArcPlane::Work(Plane::Xy), center: [0.0, 1.0, 0.0], turns: 1 };
        b.to(Op::Arc(arc), 10.0, 1.0, 4.0 - f64::from(k));
    }
    let program = b.0.finish();
    let told = |tolerance: f64| {
        let options = Options { tools: vec![Described::mill(1, 6.0, 0.0)], tolerance, ..Options::default() };
        let (_, notes) = write(&program, &options).expect("it can be written");
        notes.into_iter().filter(|d| d.code == code::STEPNC_HELIX_IN_CHORDS).map(|d| d.message).collect::<Vec<_>>()
    };
    assert_eq!(told(0.01), ["ISO 14649 has no helix: this one and 2 more are written as 213 straight pieces, no further from it than 0.01 mm"]);
    assert_eq!(told(0.0).len(), 1);
}
