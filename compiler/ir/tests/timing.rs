//! Predicted times: closed forms, figures measured on LinuxCNC 2.9, and no nonsense on any program. The comparison with
//! the controller itself is in the tests of the workspace.

use gr_ir::measure::{Rates, report};
use gr_ir::timing::Dynamics;
use gr_ir::*;
use proptest::prelude::*;

fn at(x: f64, y: f64) -> Pose {
    Pose::at([x, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// 100 mm/s and 500 mm/s² on every axis, one millisecond.
fn machine() -> Dynamics {
    Dynamics { velocity: [100.0; 9], acceleration: [500.0; 9], overrides: 1.2, ..Dynamics::default() }
}

struct Made(Builder);

impl Made {
    fn new(path: PathMode, merge: f64) -> Made {
        let mut b = Builder::new();
        b.push(Op::Feed { linear: 50.0, angular: 1.0 }, Source::default());
        b.push(Op::PathMode(path), Source::default());
        b.push(Op::MergeTolerance(merge), Source::default());
        Made(b)
    }
    fn line(mut self, x: f64, y: f64) -> Made {
        self.0.push_to(Op::Linear, &at(x, y), Source::default());
        self
    }
    fn rapid(mut self, x: f64, y: f64) -> Made {
        self.0.push_to(Op::Rapid, &at(x, y), Source::default());
        self
    }
    fn circle(mut self, radius: f64) -> Made {
        let here = *self.0.pose();
        let center = [here.axes[0] + radius, here.axes[1], 0.0];
        self.0.push_to(Op::Arc(Arc { plane: ArcPlane::Work(Plane::Xy), center, turns: -1 }), &here, Source::default());
        self
    }
    /// Control points: x, y, weight.
    fn spline(mut self, order: u32, points: &[[f64; 3]]) -> Made {
        let [x, y, _] = points[points.len() - 1];
        self.0.push_to(Op::Nurbs { order, points: points.as_flattened() }, &at(x, y), Source::default());
        self
    }
    fn seconds(self, dynamics: Dynamics) -> f64 {
        let rates = Rates { dynamics: Some(dynamics), ..Rates::default() };
        report(&self.0.finish(), &rates).totals.seconds()
    }
}

const STOP: PathMode = PathMode::ExactStop;
const EXACT: PathMode = PathMode::ExactPath;

fn blend(tolerance: f64) -> PathMode {
    PathMode::Blend(tolerance)
}

/// Seconds that the controller took (v = 50 mm/s), by servo cycles.
#[test]
fn figures_of_the_controller() {
    let corner = |path| Made::new(path, 0.0).line(50.0, 0.0).line(50.0, 50.0).seconds(machine());
    let line = |path| Made::new(path, 0.0).line(100.0, 0.0).seconds(machine());
    let circle = |path| Made::new(path, 0.0).circle(10.0).seconds(machine());
    let train = |path, merge| {
        let tenths = (1..=500).fold(Made::new(path, merge), |m, i| m.line(f64::from(i) * 0.1, 0.0));
        tenths.seconds(machine())
    };
    let rows = [
        ("line G61", line(EXACT), 2.102),
        ("line G64 P0.01", line(blend(0.01)), 2.202),
        ("circle G61", circle(EXACT), 1.459),
        ("circle G64", circle(blend(0.0)), 1.659),
        ("corner G61", corner(EXACT), 2.225),
        ("corner G64", corner(blend(0.0)), 2.074),
        ("corner G64 P0.01", corner(blend(0.01)), 2.295),
        ("corner G64 P0.1", corner(blend(0.1)), 2.275),
        ("corner G64 P1", corner(blend(1.0)), 2.192),
        ("tenths G64", train(blend(0.0), 0.0), 1.120),
        ("tenths G64 P0.01", train(blend(0.01), 0.01), 1.153),
    ];
    for (name, ours, theirs) in rows {
        assert!((ours - theirs).abs() < 0.005, "{name}: {ours:.4} s, the controller {theirs} s");
    }
}

/// Where the feed falls, short moves are begun faster than they ask for: the machine brakes at once, not at their ends.
#[test]
fn figures_of_the_controller_for_feeds_that_change() {
    let mut made = Made::new(blend(0.01), 0.01);
    for i in 1..=80 {
        let linear = if i % 8 < 4 { 50.0 } else { 5.0 };
        made.0.push(Op::Feed { linear, angular: 1.0 }, Source::default());
        made = made.line(f64::from(i) * 0.5, if i % 2 == 1 { 0.1 } else { 0.0 });
    }
    let ours = made.seconds(machine());
    assert!((ours - 5.195).abs() < 0.005, "{ours:.4} s, the controller 5.195 s");
}

/// An arc and the line behind it overlap; the line counts with its whole length, since another move follows it.
#[test]
fn figures_of_the_controller_for_short_lines_between_arcs() {
    let place = |x: f64, y: f64, z: f64| Pose::at([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let mut made = Made::new(blend(0.01), 0.01).line(0.0, -3.0);
    for (x, z, end) in [(0.8, 0.0, -0.05), (1.6, -0.05, 0.0)] {
        let arc = Op::Arc(Arc { plane: ArcPlane::Work(Plane::Xy), center: [x, 0.0, z], turns: 1 });
        made.0.push_to(Op::Linear, &place(x, -3.0, z), Source::default());
        made.0.push_to(arc, &place(x, 3.0, z), Source::default());
        made.0.push_to(arc, &place(x, -3.0, end), Source::default());
    }
    let ours = made.line(2.4, -3.0).seconds(machine());
    assert!((ours - 2.083).abs() < 0.005, "{ours:.4} s, the controller 2.083 s");
}

/// Where a helix overlaps its neighbour, what it rises does not count as a corner.
#[test]
fn figures_of_the_controller_for_helices() {
    let mut made = Made::new(blend(0.02), 0.02);
    made.0.push(Op::Feed { linear: 2000.0 / 60.0, angular: 1.0 }, Source::default());
    let mut made = made.line(0.0, 10.0);
    let mut to = |op, x: f64, y: f64, z: f64| {
        made.0.push_to(op, &Pose::at([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), Source::default());
    };
    let quarter = |turns| Op::Arc(Arc { plane: ArcPlane::Work(Plane::Xy), center: [-10.0, 10.0, 0.0], turns });
    to(quarter(1), -10.0, 20.0, -4.0);
    to(quarter(-1), -20.0, 10.0, -8.0);
    to(Op::Linear, -30.0, 10.0, -8.0);
    let ours = made.seconds(machine());
    assert!((ours - 3.165).abs() < 0.005, "{ours:.4} s, the controller 3.165 s");
}

/// Splines are planned as the arcs that the controller makes of them: a tight end slows that end alone.
#[test]
fn figures_of_the_controller_for_splines() {
    let three = |path, merge| {
        let made = Made::new(path, merge)
            .spline(4, &[[0.0, 0.0, 1.0], [0.0, 15.0, 1.0], [20.0, -5.0, 1.0], [20.0, 10.0, 1.0]])
            .spline(4, &[[20.0, 10.0, 1.0], [20.0, 25.0, 1.0], [40.0, -15.0, 1.0], [40.0, 0.0, 1.0]])
            .spline(4, &[[40.0, 0.0, 1.0], [40.0, 15.0, 1.0], [73.0, 23.0, 1.0], [70.0, 20.0, 1.0]]);
        made.seconds(machine())
    };
    let weights = [[10.0, 20.0, 2.0], [30.0, 20.0, 0.5], [40.0, 0.0, 1.0], [60.0, 10.0, 3.0], [80.0, 40.0, 1.0], [90.0, 0.0, 1.0]];
    let weighted: Vec<[f64; 3]> = [[0.0, 0.0, 1.0]; 2].into_iter().chain(weights).collect();
    let rows = [
        ("three G5, G64 P0.01", three(blend(0.01), 0.01), 2.505),
        ("three G5, G61", three(EXACT, 0.0), 2.481),
        ("G5.2 with weights, G61", Made::new(EXACT, 0.0).spline(4, &weighted).seconds(machine()), 2.592),
    ];
    for (name, ours, theirs) in rows {
        assert!((ours - theirs).abs() < 0.005, "{name}: {ours:.4} s, the controller {theirs} s");
    }
}

#[test]
fn a_huge_spline_takes_as_long_as_it_is() {
    let far = -3.2e8;
    let time = Made::new(STOP, 0.0).line(0.0, far).spline(4, &[[0.0, far, 1.0], [0.0, 0.5, 2.0], [-0.5, 0.0, 1.0], [0.5, 0.0, 1.0]]).seconds(machine());
    assert!((time / (2.0 * 3.2e8 / 50.0) - 1.0).abs() < 1e-3, "{time}");
}

/// Without accelerations a spline takes its length / feed, or what the axes need.
#[test]
fn splines_at_the_speed_of_the_axes() {
    let mut d = Dynamics { acceleration: [f64::INFINITY; 9], ..machine() };
    let straight = |d| Made::new(EXACT, 0.0).spline(3, &[[0.0, 0.0, 1.0], [20.0, 0.0, 1.0], [40.0, 0.0, 1.0]]).seconds(d);
    assert!((straight(d) - 0.8).abs() < 1e-6, "{}", straight(d));
    d.velocity[0] = 10.0;
    assert!((straight(d) - 4.0).abs() < 1e-6, "{}", straight(d));
}

#[test]
fn stops_cost_half_a_cycle_and_the_end_two() {
    let one = Made::new(STOP, 0.0).line(20.0, 0.0).seconds(machine());
    assert!((one - (20.0 / 50.0 + 50.0 / 500.0 + 0.002)).abs() < 1e-6, "{one}");
    let two = Made::new(STOP, 0.0).line(20.0, 0.0).line(20.0, 20.0).seconds(machine());
    assert!((two - (2.0 * one - 0.0015)).abs() < 1e-6, "{two}");
}

#[test]
fn every_axis_counts() {
    let mut d = machine();
    (d.velocity[1], d.acceleration[1]) = (10.0, 100.0);
    let rapid = Made::new(EXACT, 0.0).rapid(30.0, 40.0).seconds(d);
    // 40 mm of Y at 10 mm/s, reached with 100 mm/s².
    assert!((rapid - (4.0 + 0.1 + 0.002)).abs() < 1e-6, "{rapid}");
    // Speeds alone: no ramp.
    d.acceleration = [f64::INFINITY; 9];
    let rapid = Made::new(EXACT, 0.0).rapid(30.0, 40.0).seconds(d);
    assert!((rapid - 4.0).abs() < 1e-9, "{rapid}");
    let feed = Made::new(EXACT, 0.0).line(0.0, 40.0).seconds(d);
    assert!((feed - 4.0).abs() < 1e-9, "a feed beyond the axis takes the axis' time: {feed}");
}

#[test]
fn merged_lines_share_the_time() {
    let made = Made::new(blend(0.01), 0.01).line(10.0, 0.001).line(20.0, 0.0).line(30.0, 0.0);
    let program = made.0.finish();
    let rates = Rates { dynamics: Some(machine()), ..Rates::default() };
    let clock = timing::Clock::new(&program, &rates);
    let mut cursor = program.cursor();
    let mut times = Vec::new();
    while let Some(view) = cursor.next() {
        times.extend(view.op.moves().then(|| clock.measure(&view).feed_ns));
    }
    assert!(times.iter().all(|t| t.abs_diff(times[0]) < 1000), "one line of 30 mm in three equal parts: {times:?}");
}

#[test]
fn without_limits_nothing_changes() {
    let made = || Made::new(blend(0.1), 0.0).line(10.0, 0.0).rapid(20.0, 5.0).line(0.0, 0.0);
    let plain = report(&made().0.finish(), &Rates::default()).totals;
    let unknown = Rates { dynamics: Some(Dynamics::default()), ..Rates::default() };
    assert_eq!(report(&made().0.finish(), &unknown).totals, plain);
}

/// A move of one of several sorts.
fn step() -> impl Strategy<Value = (u8, f64, f64)> {
    let number = prop_oneof![4 => -50.0..50.0f64, 1 => Just(0.0), 1 => -1e-6..1e-6f64, 1 => -1e9..1e9f64];
    (0u8..7, number.clone(), number)
}

fn path() -> impl Strategy<Value = PathMode> {
    prop_oneof![Just(STOP), Just(EXACT), Just(blend(0.0)), (1e-6..10.0f64).prop_map(blend)]
}

proptest! {
    /// No move is faster than its feed, and no time is missing or infinite.
    #[test]
    fn never_faster_than_asked(steps in prop::collection::vec(step(), 1..40), path in path(), merge in prop_oneof![Just(0.0), 1e-4..0.5f64]) {
        let mut m = Made::new(path, merge);
        let mut least = 0.0;
        for (kind, x, y) in steps {
            let from = m.0.pose().xyz();
            let way = ((x - from[0]).powi(2) + (y - from[1]).powi(2)).sqrt();
            m = match kind {
                0 => m.rapid(x, y),
                1 => { m.0.push(Op::Dwell(0.5), Source::default()); m }
                2 => m.circle(x.abs().max(1e-3)),
                6 => {
                    // Longer ones take their time to be measured.
                    let [x, y] = [x, y].map(|v| v.clamp(-60.0, 60.0));
                    let by = |x: f64, y: f64, weight: f64| [from[0] + x, from[1] + y, weight];
                    m.spline(4, &[by(0.0, 0.0, 1.0), by(y, x, 2.0), by(-x, y, 1.0), by(x, y, 1.0)])
                }
                _ => m.line(x, y),
            };
            // Corners may be cut by half of each move, and merged lines by what they leave out.
            least += match kind { 1 => 0.5, 0 | 2 | 6 => 0.0, _ if path == STOP => way / 50.0, _ => 0.0 };
        }
        let program = m.0.finish();
        let rates = Rates { dynamics: Some(machine()), ..Rates::default() };
        let totals = report(&program, &rates).totals;
        prop_assert!(totals.seconds().is_finite() && totals.ns() < u64::MAX / 4);
        prop_assert!(totals.seconds() >= least * (1.0 - 1e-9) - 1e-3, "{} s, at least {least} s", totals.seconds());
    }
}
