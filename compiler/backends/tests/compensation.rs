//! Contours that LinuxCNC compensates make the motion of the plan: read again by our interpreter with the tool in its
//! table, and where LinuxCNC is installed, by the real one.

mod reader;

use gr_backends::Texts;
use gr_backends::rs274ngc::{Options, emit};
use gr_canon::{Axes, FileId};
use gr_interp::{Setup, Tool};
use gr_ir::{Arc as Round, ArcPlane, Builder, Marker, Op, Plane, Pose, Program, Source};
use gr_spec::Dialect;
use proptest::prelude::*;

fn run(text: &str, diameter: f64) -> Result<Program, String> {
    let dialect = Dialect::linuxcnc();
    let mut setup = Setup { dialect, ..Setup::default() };
    let tool = |number: i32, diameter: f64| Tool { number, pocket: number, diameter, ..Tool::default() };
    setup.tools.rows = vec![tool(0, 0.0), tool(1, diameter)];
    reader::read(text, &setup)
}

/// A stretch of a pass, from where the one before ends, in its direction.
#[derive(Clone, Copy, Debug)]
enum Way {
    Line(f64),
    /// Radius, angle; to the left.
    Left(f64, f64),
    /// Likewise to the right, by this much larger than the tool: 0 goes round an outside corner.
    Right(f64, f64),
    /// A sharp corner to the left.
    Corner(f64),
    /// Up or down.
    Z(f64),
}

struct Pen {
    b: Builder,
    at: [f64; 3],
    heading: f64,
    /// Left-handed: everything mirrored.
    mirror: f64,
    lines: u32,
}

impl Pen {
    fn pose(&self) -> Pose {
        let mut axes: Axes = [0.0; 9];
        axes[..3].copy_from_slice(&self.at);
        axes[1] *= self.mirror;
        Pose::at(axes)
    }
    fn go(&mut self, op: Op<'_>, to: [f64; 3]) {
        self.at = to;
        let pose = self.pose();
        self.lines += 1;
        self.b.push_to(op, &pose, Source { line: self.lines, ..Source::default() });
    }
    fn arc(&mut self, radius: f64, angle: f64) {
        let side = angle.signum();
        let [x, y, z] = self.at;
        let (cx, cy) = (x - radius * side * self.heading.sin(), y + radius * side * self.heading.cos());
        self.heading += angle;
        let end = [cx + radius * side * self.heading.sin(), cy - radius * side * self.heading.cos(), z];
        let turns = if side * self.mirror > 0.0 { 1 } else { -1 };
        let arc = Round { plane: ArcPlane::Work(Plane::Xy), center: [cx, cy * self.mirror, z], turns };
        self.go(Op::Arc(arc), end);
    }
    fn way(&mut self, way: Way, radius: f64) {
        let [x, y, z] = self.at;
        match way {
            Way::Line(l) => self.go(Op::Linear, [x + l * self.heading.cos(), y + l * self.heading.sin(), z]),
            Way::Left(r, a) => self.arc(r, a),
            Way::Right(r, a) => self.arc(radius + r, -a),
            Way::Corner(a) => self.heading += a,
            Way::Z(dz) => self.go(Op::Linear, [x, y, z + dz]),
        }
    }
}

fn plan(ways: &[Way], radius: f64, left: bool) -> Program {
    let mut b = Builder::new();
    let s = Source::default();
    b.push(Op::Begin { marker: Marker::Workingstep, code: 7, text: "wall" }, s);
    for op in [Op::ToolPrepare(1), Op::ToolChangeStart, Op::ToolChange(1)] {
        b.push(op, s);
    }
    let mut pen = Pen { b, at: [3.0, 4.0, 20.0], heading: 0.3, mirror: if left { 1.0 } else { -1.0 }, lines: 0 };
    pen.go(Op::Rapid, [3.0, 4.0, 20.0]);
    let text = format!("{radius:?}");
    pen.b.push(Op::Begin { marker: Marker::Contour, code: if left { 41 } else { 42 }, text: &text }, s);
    for level in [-1.0, -2.0] {
        pen.heading = 0.3;
        pen.go(Op::Rapid, [10.0, 20.0, if level == -1.0 { 20.0 } else { 5.0 }]);
        pen.go(Op::Rapid, [10.0, 20.0, 1.0]);
        pen.b.push(Op::SpindleSpeed { spindle: 0, speed: 1000.0 }, s);
        pen.b.push(Op::SpindleTurn { spindle: 0, turn: gr_ir::Turn::Cw }, s);
        pen.b.push(Op::Feed { linear: 5.0, angular: 1.0 }, s);
        pen.go(Op::Linear, [10.0, 20.0, level]);
        ways.iter().for_each(|w| pen.way(*w, radius));
        let [x, y, _] = pen.at;
        pen.go(Op::Rapid, [x, y, 5.0]);
    }
    pen.b.push(Op::Close(Marker::Contour), s);
    pen.go(Op::Rapid, [0.0, 0.0, 20.0]);
    pen.b.push(Op::Close(Marker::Workingstep), s);
    pen.b.push(Op::End, s);
    pen.b.finish()
}

fn written(p: &Program) -> (String, Vec<String>) {
    let options = Options { control_compensates: true, ..Options::default() };
    let e = emit(p, &options, &Texts::new([(FileId(0), "")])).unwrap_or_else(|e| panic!("{e:?}"));
    (e.text, e.notes.iter().map(|d| format!("{}: {}", d.code.def().slug, d.message)).collect())
}

/// Feed moves: ends, and of arcs centers and ways round.
fn fed(p: &Program) -> Vec<([f64; 3], Option<([f64; 2], i32)>)> {
    let arc = |op: &Op<'_>| if let Op::Arc(a) = op { Some(([a.center[0], a.center[1]], a.turns)) } else { None };
    let still = |s: &gr_ir::Step<'_>| matches!(s.op, Op::Linear) && s.start.axes == s.end.axes;
    p.steps().filter(|s| s.op.feeds() && !still(s)).map(|s| (s.end.xyz(), arc(&s.op))).collect()
}

fn near(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 3e-5)
}

fn same(p: &Program, text: &str, radius: f64) {
    let again = run(text, 2.0 * radius).unwrap_or_else(|e| panic!("{e}"));
    let (a, b) = (fed(p), fed(&again));
    let equal = a.len() == b.len()
        && a.iter().zip(&b).all(|(a, b)| {
            let arcs = match (a.1, b.1) {
                (Some(a), Some(b)) => near(&a.0, &b.0) && a.1 == b.1,
                (None, None) => true,
                _ => false,
            };
            near(&a.0, &b.0) && arcs
        });
    assert!(equal, "{a:#?}\n{b:#?}\n{text}");
    // Rapids below the height over everything go straight down and up.
    let low = |s: &gr_ir::Step<'_>| s.op == Op::Rapid && s.start.axes != [0.0; 9] && s.start.axes[2].min(s.end.axes[2]) < 5.0;
    for s in again.steps().filter(low) {
        assert!((0..2).all(|i| (s.start.axes[i] - s.end.axes[i]).abs() < 3e-5), "{s:?}\n{text}");
    }
    assert_eq!(text.matches("G40\n").count(), 2, "{text}");
}

const MIXED: [Way; 13] = [
    Way::Line(6.0),
    Way::Left(2.0, 1.0),
    Way::Z(-0.25),
    Way::Line(10.0),
    Way::Corner(1.5),
    Way::Line(9.0),
    Way::Right(0.0, 1.2),
    Way::Line(8.0),
    Way::Right(4.0, 0.7),
    Way::Corner(0.8),
    Way::Line(5.0),
    Way::Corner(0.4),
    Way::Left(6.0, 0.9),
];

#[test]
fn contours_of_every_kind() {
    for left in [true, false] {
        let p = plan(&MIXED, 3.0, left);
        let (text, notes) = written(&p);
        assert_eq!(notes, [""; 0], "{text}");
        same(&p, &text, 3.0);
        if left {
            insta::assert_snapshot!(text);
        }
    }
}

#[test]
fn a_smaller_tool_comes_nearer_to_the_wall() {
    let p = plan(&[Way::Line(30.0), Way::Corner(1.5), Way::Line(20.0)], 3.0, true);
    let (text, _) = written(&p);
    let worn = run(&text, 5.8).expect("runs");
    // The wall is on the right: a worn tool goes 0.1 mm to the right of the plan's way.
    let (a, b) = (fed(&p), fed(&worn));
    let heading = 0.3f64;
    let off = [b[0].0[0] - a[0].0[0], b[0].0[1] - a[0].0[1]];
    let aside = -off[0] * heading.sin() + off[1] * heading.cos();
    assert!((aside + 0.1).abs() < 1e-4, "{off:?}");
}

#[test]
fn what_the_control_would_do_another_way_stays_a_path() {
    let why = |ways: &[Way]| {
        let p = plan(ways, 3.0, true);
        let (text, notes) = written(&p);
        assert!(!text.contains("G41"), "{text}");
        let again = run(&text, 6.0).expect("runs");
        assert_eq!(fed(&p).len(), fed(&again).len());
        notes.join("\n")
    };
    let l = Way::Line(10.0);
    insta::assert_snapshot!([
        why(&[l, Way::Corner(-1.0), l]),
        why(&[l, Way::Corner(std::f64::consts::PI), l]),
        why(&[l, Way::Corner(0.03), l]),
        why(&[l, Way::Right(-1.0, 1.0), l]),
        why(&[l, Way::Corner(1.0), Way::Z(-1.0), l]),
        why(&[Way::Right(0.0, 1.0), l]),
        why(&[l, Way::Right(0.0, 0.01), l]),
    ]
    .join("\n"));
}

fn way() -> impl Strategy<Value = Way> {
    prop_oneof![
        4 => (0.5..20.0).prop_map(Way::Line),
        2 => (0.5..8.0, 0.1..2.5).prop_map(|(r, a)| Way::Left(r, a)),
        1 => (0.5..8.0, 0.1..2.5).prop_map(|(r, a)| Way::Right(r, a)),
        1 => (0.1..2.5).prop_map(|a| Way::Right(0.0, a)),
        1 => (0.1..2.0).prop_map(Way::Corner),
        1 => (-0.5..0.5).prop_map(Way::Z),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn whatever_is_compensated_moves_the_same(ways in prop::collection::vec(way(), 1..12), radius in 0.5..6.0, left in any::<bool>()) {
        prop_assume!(ways.iter().any(|w| !matches!(w, Way::Corner(_) | Way::Z(_))));
        let p = plan(&ways, radius, left);
        let (text, notes) = written(&p);
        if notes.is_empty() {
            same(&p, &text, radius);
        } else {
            prop_assert!(!text.contains("G41"));
        }
    }
}
