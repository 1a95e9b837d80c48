//! Random programs, nearly all of them valid: what a step means is chosen by proptest, what it says is written here
//! with the modes and position that hold at that place, so that arcs close and cycles go down. The few that are
//! refused test verdict and message.

use std::fmt::Write;

use proptest::prelude::*;

/// One thing that a program does. Numbers are small integers that the writer scales.
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "the writer says what each means")]
pub enum Step {
    Line { rapid: bool, modal: bool, d: [i16; 3], axes: u8, feed: Option<u16> },
    Arc { ccw: bool, radius: u8, start: u16, sweep: u16, helix: Option<i8>, turns: u8, form: u8 },
    Full { ccw: bool, radius: u8 },
    Units(bool),
    Distance(bool),
    Plane(u8),
    Path(u8),
    FeedMode(u8),
    Cycle { code: u8, depth: u8, clear: u8, points: Vec<(i8, i8)>, repeats: u8, back: bool },
    System { number: u8, x: i8, y: i8, z: i8, turn: i8, twenty: bool },
    Shift { kind: u8, x: i8, y: i8, z: i8 },
    Length(u8),
    Tool(u8),
    Contour { left: bool, dynamic: bool, tool: u8, moves: Vec<(u8, i16, u8)> },
    Spindle(u8),
    Switch(u8),
    Dwell(u8),
    Polar { r: u8, a: i16, modal: bool },
    Spline { i: i8, j: i8, p: i8, q: i8, x: i8, y: i8, again: bool },
    Nurbs { points: Vec<(i8, i8, u8)>, order: u8 },
    Home { second: bool, store: bool, x: Option<i8>, z: Option<i8> },
    Machine { rapid: bool, x: i8, y: i8 },
    Probe { kind: u8, d: i8 },
    Save(Vec<Step>),
    Assign { number: u8, expression: Expr },
    Show(Expr),
    Use { expression: Expr },
    While { times: u8, body: Vec<Step>, leave: bool },
    Repeat { times: u8, body: Vec<Step>, skip: bool },
    If { condition: Expr, yes: Vec<Step>, no: Vec<Step> },
    Sub { arguments: Vec<Expr>, body: Vec<Step>, value: bool },
    Rotary { a: i16, b: i16, c: i16 },
    Diameter(Vec<Step>),
    Comment(u8),
    Deleted(i8),
    Stop(bool),
    Thread { kind: u8, depth: u8, pitch: u8 },
    Data { kind: u8, tool: u8, offsets: Vec<(u8, i8)>, radius: Option<u8>, angles: Option<(i8, i8)>, orientation: Option<u8>, apply: u8 },
}

/// An expression.
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "the writer says what each means")]
pub enum Expr {
    Number(i32, u8),
    Parameter(u8),
    Named(u8),
    Unary(u8, Box<Expr>),
    Binary(u8, Box<Expr>, Box<Expr>),
    Atan(Box<Expr>, Box<Expr>),
}

fn expression() -> impl Strategy<Value = Expr> {
    let leaf = prop_oneof![
        (-5000..5000_i32, 0..4_u8).prop_map(|(n, d)| Expr::Number(n, d)),
        (0..6_u8).prop_map(Expr::Parameter),
        (0..NAMES.len() as u8).prop_map(Expr::Named),
    ];
    leaf.prop_recursive(3, 8, 2, |inner| {
        prop_oneof![
            2 => (0..9_u8, inner.clone()).prop_map(|(f, e)| Expr::Unary(f, Box::new(e))),
            4 => (0..14_u8, inner.clone(), inner.clone()).prop_map(|(o, a, b)| Expr::Binary(o, Box::new(a), Box::new(b))),
            1 => (inner.clone(), inner).prop_map(|(a, b)| Expr::Atan(Box::new(a), Box::new(b))),
        ]
    })
}

/// Predefined parameters whose value does not depend on the version.
const NAMES: &[&str] = &[
    "_x", "_y", "_z", "_feed", "_rpm", "_plane", "_metric", "_absolute", "_motion_mode", "_ccomp", "_coord_system",
    "_current_tool", "_selected_tool", "_spindle_on", "_flood", "_retract_old_z", "_units_per_rev", "_call_level", "_line", "_abs_x",
    "_abs_y", "_abs_z", "_a", "_tool_offset", "_value", "_ijk_absolute_mode", "_spindle_css_mode", "_incremental", "_mist",
];

fn small() -> impl Strategy<Value = i8> {
    -60..60_i8
}

fn plain() -> impl Strategy<Value = Step> {
    let d = || -4000..4000_i16;
    prop_oneof![
        12 => (any::<bool>(), any::<bool>(), [d(), d(), d()], 1..8_u8, prop::option::weighted(0.2, 50..3000_u16))
            .prop_map(|(rapid, modal, d, axes, feed)| Step::Line { rapid, modal, d, axes, feed }),
        8 => (any::<bool>(), 1..80_u8, 0..360_u16, 5..355_u16, prop::option::weighted(0.3, -10..10_i8), 0..3_u8, 0..4_u8)
            .prop_map(|(ccw, radius, start, sweep, helix, turns, form)| Step::Arc { ccw, radius, start, sweep, helix, turns, form }),
        1 => (any::<bool>(), 1..50_u8).prop_map(|(ccw, radius)| Step::Full { ccw, radius }),
        2 => any::<bool>().prop_map(Step::Units),
        3 => any::<bool>().prop_map(Step::Distance),
        3 => (17..20_u8).prop_map(Step::Plane),
        1 => (0..5_u8).prop_map(Step::Path),
        1 => (0..3_u8).prop_map(Step::FeedMode),
        4 => (0..10_u8, 1..30_u8, 0..10_u8, prop::collection::vec((small(), small()), 1..4), 1..4_u8, any::<bool>())
            .prop_map(|(code, depth, clear, points, repeats, back)| Step::Cycle { code, depth, clear, points, repeats, back }),
        2 => (1..10_u8, small(), small(), small(), prop_oneof![Just(0_i8), -90..90_i8], any::<bool>())
            .prop_map(|(number, x, y, z, turn, twenty)| Step::System { number, x, y, z, turn, twenty }),
        2 => (0..5_u8, small(), small(), small()).prop_map(|(kind, x, y, z)| Step::Shift { kind, x, y, z }),
        1 => (0..6_u8).prop_map(Step::Length),
        1 => (0..5_u8).prop_map(Step::Tool),
        2 => (
            0..3_u8,
            0..6_u8,
            prop::collection::vec((0..6_u8, small()), 0..4),
            prop::option::of(0..30_u8),
            prop::option::of((small(), small())),
            prop::option::of(0..10_u8),
            0..4_u8,
        )
            .prop_map(|(kind, tool, offsets, radius, angles, orientation, apply)| Step::Data { kind, tool, offsets, radius, angles, orientation, apply }),
        3 => (any::<bool>(), any::<bool>(), 1..4_u8, prop::collection::vec((0..5_u8, -150..150_i16, 8..40_u8), 1..8))
            .prop_map(|(left, dynamic, tool, moves)| Step::Contour { left, dynamic, tool, moves }),
        1 => (0..6_u8).prop_map(Step::Spindle),
        1 => (0..24_u8).prop_map(Step::Switch),
        1 => (0..50_u8).prop_map(Step::Dwell),
        1 => (1..80_u8, -360..360_i16, any::<bool>()).prop_map(|(r, a, modal)| Step::Polar { r, a, modal }),
        1 => (small(), small(), small(), small(), small(), small(), any::<bool>())
            .prop_map(|(i, j, p, q, x, y, again)| Step::Spline { i, j, p, q, x, y, again }),
        1 => (prop::collection::vec((small(), small(), 1..5_u8), 3..6), 2..4_u8).prop_map(|(points, order)| Step::Nurbs { points, order }),
        1 => (any::<bool>(), any::<bool>(), prop::option::of(small()), prop::option::of(small()))
            .prop_map(|(second, store, x, z)| Step::Home { second, store, x, z }),
        1 => (any::<bool>(), small(), small()).prop_map(|(rapid, x, y)| Step::Machine { rapid, x, y }),
        1 => (0..4_u8, small()).prop_map(|(kind, d)| Step::Probe { kind, d }),
        3 => (0..6_u8, expression()).prop_map(|(number, expression)| Step::Assign { number, expression }),
        2 => expression().prop_map(Step::Show),
        2 => expression().prop_map(|expression| Step::Use { expression }),
        1 => (-360..360_i16, -360..360_i16, -360..360_i16).prop_map(|(a, b, c)| Step::Rotary { a, b, c }),
        1 => (0..9_u8).prop_map(Step::Comment),
        1 => small().prop_map(Step::Deleted),
        1 => any::<bool>().prop_map(Step::Stop),
        1 => (0..3_u8, 1..20_u8, 1..30_u8).prop_map(|(kind, depth, pitch)| Step::Thread { kind, depth, pitch }),
    ]
}

fn steps(of: impl Strategy<Value = Step>, most: usize) -> impl Strategy<Value = Vec<Step>> {
    prop::collection::vec(of, 1..most)
}

/// Programs of up to 14 steps with nested control.
pub fn programs() -> impl Strategy<Value = Vec<Step>> {
    let step = plain().prop_recursive(2, 12, 4, |inner| {
        let body = || prop::collection::vec(inner.clone(), 1..4);
        prop_oneof![
            8 => inner.clone(),
            1 => (1..4_u8, body(), any::<bool>()).prop_map(|(times, body, leave)| Step::While { times, body, leave }),
            1 => (1..4_u8, body(), any::<bool>()).prop_map(|(times, body, skip)| Step::Repeat { times, body, skip }),
            1 => (expression(), body(), body()).prop_map(|(condition, yes, no)| Step::If { condition, yes, no }),
            1 => (prop::collection::vec(expression(), 0..4), body(), any::<bool>())
                .prop_map(|(arguments, body, value)| Step::Sub { arguments, body, value }),
            1 => body().prop_map(Step::Save),
            1 => body().prop_map(Step::Diameter),
        ]
    });
    steps(step, 14)
}

struct Writer {
    text: String,
    subs: String,
    plane: u8,
    inch: bool,
    incremental: bool,
    /// Position in program units.
    at: [f64; 3],
    label: u32,
    last: &'static str,
    /// X words are diameters: an arc would not close.
    diameter: bool,
}

fn round(v: f64) -> f64 {
    (v * 1e4).round() / 1e4
}

fn show(v: f64) -> String {
    let v = round(v);
    let text = format!("{v:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

impl Writer {
    fn line(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }
    /// A length in program units from tenths of a millimeter.
    fn len(&self, tenths: f64) -> f64 {
        round(tenths / if self.inch { 254.0 } else { 10.0 })
    }
    fn indices(&self) -> [usize; 3] {
        match self.plane {
            18 => [2, 0, 1],
            19 => [1, 2, 0],
            _ => [0, 1, 2],
        }
    }
    /// Words that move by `d` program units.
    fn by(&mut self, d: [Option<f64>; 3]) -> String {
        let mut out = String::new();
        for (i, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            let Some(d) = d[i] else { continue };
            let to = round(self.at[i] + round(d));
            let _ = write!(out, " {letter}{}", show(if self.incremental { round(d) } else { to }));
            self.at[i] = to;
        }
        out
    }
    fn in_plane(&mut self, first: f64, second: f64, normal: Option<f64>) -> String {
        let [a, b, n] = self.indices();
        let mut d = [None; 3];
        d[a] = Some(first);
        d[b] = Some(second);
        d[n] = normal;
        self.by(d)
    }
    /// Back to a known place: after anything that moves the frame or the position in ways the writer does not follow.
    fn settle(&mut self) {
        self.at = [self.len(0.0), self.len(0.0), self.len(50.0)];
        let mode = if self.incremental { " G91" } else { "" };
        let z = show(self.at[2]);
        self.line(&format!("G90 G0 X0 Y0 Z{z}"));
        if !mode.is_empty() {
            self.line("G91");
        }
        self.last = "";
    }
    fn center(&self, ci: f64, cj: f64) -> String {
        let [a, b, _] = self.indices();
        format!(" {}{} {}{}", ['I', 'J', 'K'][a], show(ci), ['I', 'J', 'K'][b], show(cj))
    }
    fn arc(&mut self, ccw: bool, radius: f64, start: f64, sweep: f64, helix: Option<f64>, turns: u8, form: u8) {
        if self.diameter {
            let words = self.in_plane(radius, radius, None);
            self.line(&format!("G1{words}"));
            return;
        }
        let code = if ccw { "G3" } else { "G2" };
        let (s, e) = (start.to_radians(), (start + if ccw { sweep } else { -sweep }).to_radians());
        let (ci, cj) = (-radius * s.cos(), -radius * s.sin());
        let (dx, dy) = (ci + radius * e.cos(), cj + radius * e.sin());
        let [a, b, _] = self.indices();
        let from = [self.at[a], self.at[b]];
        let words = self.in_plane(dx, dy, helix);
        let more = if turns > 0 && form < 3 && form != 1 { format!(" P{}", turns) } else { String::new() };
        match form {
            1 => {
                // A little longer than the distance needs, and away from 180 degrees, where R is badly defined.
                let r = if sweep > 180.0 { -radius } else { radius };
                self.line(&format!("{code}{words} R{}", show(r)));
            }
            2 => {
                let center = self.center(round(from[0] + ci), round(from[1] + cj));
                self.line("G90.1");
                self.line(&format!("{code}{words}{center}{more}"));
                self.line("G91.1");
            }
            _ => {
                let center = self.center(round(ci), round(cj));
                self.line(&format!("{code}{words}{center}{more}"));
            }
        }
        self.last = "";
    }
    fn label(&mut self) -> u32 {
        self.label += 1;
        self.label
    }
    fn block(&mut self, steps: &[Step]) {
        for step in steps {
            self.step(step);
        }
    }
    /// A body that may run any number of times: the writer does not know where it ends.
    fn body(&mut self, steps: &[Step]) {
        let (plane, inch, incremental) = (self.plane, self.inch, self.incremental);
        self.settle();
        self.block(steps);
        self.plane = plane;
        self.inch = inch;
        self.incremental = incremental;
        self.modes();
        self.settle();
    }
    fn modes(&mut self) {
        let (plane, units, mode) = (self.plane, if self.inch { 20 } else { 21 }, if self.incremental { 91 } else { 90 });
        let feed = show(self.len(6000.0));
        self.line(&format!("G{plane} G{units} G{mode} G94 F{feed}"));
    }

    fn step(&mut self, step: &Step) {
        match step {
            Step::Line { rapid, modal, d, axes, feed } => {
                let code = if *rapid { "G0" } else { "G1" };
                let d = [0, 1, 2].map(|i| (axes & (1 << i) != 0).then(|| self.len(f64::from(d[i]) / 10.0)));
                let words = self.by(d);
                let head = if *modal && self.last == code { "" } else { code };
                let feed = feed.map_or(String::new(), |f| format!(" F{f}"));
                self.line(format!("{head}{words}{feed}").trim());
                self.last = code;
            }
            Step::Arc { ccw, radius, start, sweep, helix, turns, form } => {
                let radius = self.len(f64::from(*radius) * 5.0);
                let sweep = f64::from(*sweep);
                let form = if *form == 1 && ((sweep - 180.0).abs() < 10.0 || sweep > 340.0) { 0 } else { *form };
                let helix = helix.map(|h| self.len(f64::from(h) * 3.0));
                self.arc(*ccw, radius, f64::from(*start), sweep, helix, *turns, form);
            }
            Step::Full { ccw, radius } => {
                let r = self.len(f64::from(*radius) * 5.0);
                let center = self.center(r, 0.0);
                self.line(&format!("G{}{center}", if *ccw { 3 } else { 2 }));
                self.last = "";
            }
            Step::Units(inch) => {
                self.inch = *inch;
                self.line(if *inch { "G20" } else { "G21" });
                let feed = show(self.len(6000.0));
                self.line(&format!("G94 F{feed}"));
                self.settle();
            }
            Step::Distance(incremental) => {
                self.incremental = *incremental;
                self.line(if *incremental { "G91" } else { "G90" });
            }
            Step::Plane(p) => {
                self.plane = *p;
                self.line(&format!("G{p}"));
            }
            Step::Path(k) => {
                let t = show(self.len(1.0));
                self.line(&match k {
                    0 => "G61".to_string(),
                    1 => "G61.1".into(),
                    2 => "G64".into(),
                    3 => format!("G64 P{t}"),
                    _ => format!("G64 P{t} Q{t}"),
                });
            }
            Step::FeedMode(k) => {
                let per_rev = show(self.len(2.0));
                let feed = show(self.len(6000.0));
                match k {
                    0 => {
                        self.line("G93");
                        let words = self.by([Some(self.len(50.0)), None, None]);
                        self.line(&format!("G1{words} F3"));
                        self.line(&format!("G94 F{feed}"));
                    }
                    1 => {
                        self.line(&format!("G95 F{per_rev}"));
                        let words = self.by([Some(self.len(50.0)), Some(self.len(20.0)), None]);
                        self.line(&format!("G1{words}"));
                        self.line(&format!("G94 F{feed}"));
                    }
                    _ => self.line(&format!("G94 F{feed}")),
                }
                self.last = "";
            }
            Step::Cycle { code, depth, clear, points, repeats, back } => self.cycle(*code, *depth, *clear, points, *repeats, *back),
            Step::System { number, x, y, z, turn, twenty } => {
                let words = format!("X{} Y{} Z{}", show(self.len(f64::from(*x))), show(self.len(f64::from(*y))), show(self.len(f64::from(*z))));
                if *twenty {
                    self.line(&format!("G10 L20 P{number} {words}"));
                } else {
                    let r = if *turn == 0 { String::new() } else { format!(" R{turn}") };
                    self.line(&format!("G10 L2 P{number} {words}{r}"));
                }
                const NAMES: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
                self.line(NAMES[usize::from(number - 1)]);
                self.settle();
            }
            Step::Shift { kind, x, y, z } => {
                let words = format!("X{} Y{} Z{}", show(self.len(f64::from(*x))), show(self.len(f64::from(*y))), show(self.len(f64::from(*z))));
                self.line(&match kind {
                    0 => format!("G92 {words}"),
                    1 => "G92.1".into(),
                    2 => "G92.2".into(),
                    3 => "G92.3".into(),
                    _ => format!("G52 {words}"),
                });
                self.settle();
            }
            Step::Length(k) => {
                let z = show(self.len(50.0));
                self.line(&match k {
                    0 => "G49".to_string(),
                    1 => "G43".into(),
                    2 => "G43 H2".into(),
                    3 => "G43 H7".into(),
                    4 => format!("G43.1 Z{z}"),
                    _ => "G43.2 H3".into(),
                });
                self.settle();
            }
            Step::Tool(k) => {
                self.line(match k {
                    0 => "T2 M6",
                    1 => "T3\nM6\nG43",
                    2 => "M61 Q1",
                    3 => "T20 M6 G43",
                    _ => "T1 M6",
                });
                self.line("S1000 M3");
                self.settle();
            }
            Step::Contour { left, dynamic, tool, moves } => self.contour(*left, *dynamic, *tool, moves),
            Step::Spindle(k) => self.line(["M3", "M4", "M5\nM3", "S500", "G96 D2000 S100\nG97 S1000", "M19 R45 P1\nM3"][usize::from(*k)]),
            Step::Switch(k) => {
                const WHAT: [&str; 24] = [
                    "M7", "M8", "M9", "M48", "M49", "M50 P0", "M50", "M51 P0", "M51 P1", "M52 P1", "M53 P0", "M53", "M62 P1", "M63 P2",
                    "M64 P3", "M65 P3", "M66 P1 L0", "M66 P2 L3 Q1", "M67 E1 Q1.25", "M68 E2 Q[1/4]", "M7 M49", "M66 E1 L0", "M48 M9", "M64 P1",
                ];
                self.line(WHAT[usize::from(*k)]);
            }
            Step::Dwell(k) => self.line(&format!("G4 P{}", f64::from(*k) / 20.0)),
            Step::Polar { r, a, modal } => {
                self.line("G17 G90");
                let r = show(self.len(f64::from(*r) * 10.0));
                self.line(&format!("G1 @{r} ^{a}"));
                if *modal {
                    self.line(&format!("^{}", a + 15));
                    self.line(&format!("@{r}"));
                }
                self.modes();
                self.settle();
            }
            Step::Spline { i, j, p, q, x, y, again } => {
                self.line("G17");
                let l = |v: &i8, w: &Writer| show(w.len(f64::from(*v)));
                let (i, j, p, q) = (l(i, self), l(j, self), l(p, self), l(q, self));
                let words = self.by([Some(self.len(f64::from(*x))), Some(self.len(f64::from(*y))), None]);
                self.line(&format!("G5{words} I{i} J{j} P{p} Q{q}"));
                if *again {
                    let words = self.by([Some(self.len(100.0)), Some(0.0), None]);
                    self.line(&format!("G5{words} P{q} Q{p}"));
                    let words = self.by([Some(self.len(100.0)), Some(0.0), None]);
                    self.line(&format!("G5.1{words} I{} J{}", show(self.len(30.0)), show(self.len(30.0))));
                }
                self.modes();
                self.last = "";
            }
            Step::Nurbs { points, order } => {
                self.line("G17 G90");
                let save = self.incremental;
                self.incremental = false;
                for (n, (x, y, weight)) in points.iter().enumerate() {
                    let head = if n == 0 { "G5.2" } else { "" };
                    let tail = if n == 0 { format!(" L{order}") } else { String::new() };
                    let (x, y) = (show(self.len(f64::from(*x))), show(self.len(f64::from(*y))));
                    self.line(&format!("{head} X{x} Y{y} P{weight}{tail}"));
                }
                self.line("G5.3");
                self.incremental = save;
                self.modes();
                self.settle();
            }
            Step::Home { second, store, x, z } => {
                let code = if *second { "G30" } else { "G28" };
                if *store {
                    self.line(&format!("{code}.1"));
                }
                let mut words = String::new();
                for (letter, v) in [('X', x), ('Z', z)] {
                    if let Some(v) = v {
                        let _ = write!(words, " {letter}{}", show(self.len(f64::from(*v))));
                    }
                }
                self.line(&format!("{code}{words}"));
                self.settle();
            }
            Step::Machine { rapid, x, y } => {
                let (x, y) = (show(self.len(f64::from(*x))), show(self.len(f64::from(*y))));
                self.line("G90");
                self.line(&format!("G53 G{} X{x} Y{y}", u8::from(!rapid)));
                self.modes();
                self.settle();
            }
            Step::Probe { kind, d } => {
                let d = if *d == 0 { 1.0 } else { f64::from(*d) };
                let words = self.by([None, Some(self.len(d)), Some(self.len(-20.0))]);
                self.line(&format!("G38.{}{words}", kind + 2));
                self.line("(debug,#5061 #5062 #5063 #5064 #5070)");
                self.settle();
            }
            Step::Save(body) => {
                self.line("M70");
                self.body(body);
                self.line("M72");
                self.modes();
                self.settle();
            }
            Step::Assign { number, expression } => {
                let e = self.expression(expression);
                if number % 2 == 0 {
                    self.line(&format!("#{}={e}", 31 + number));
                } else {
                    self.line(&format!("#<v{number}>={e} #<_g{number}>=[{e} + 1]"));
                }
            }
            Step::Show(expression) => {
                let e = self.expression(expression);
                self.line(&format!("#40={e}"));
                self.line("(debug,value #40 and #31 #<v1>)");
                self.line("(print,%.3f#40 %d#33)");
                self.line("(log,value #40)");
            }
            Step::Use { expression } => {
                let e = self.expression(expression);
                // Kept small, so that positions stay printable.
                self.line(&format!("#41={e}"));
                self.line("o9 if [ABS[#41] GT 500]");
                self.line("#41=[#41 MOD 500]");
                self.line("o9 endif");
                self.text = self.text.replace("o9 ", &format!("o{} ", self.label + 5000));
                self.label += 1;
                self.line("G90 G1 X#41 Y[#41/2] Z[5-#41/100]");
                self.modes();
                self.settle();
            }
            Step::While { times, body, leave } => {
                let o = self.label();
                let n = 100 + o;
                self.line(&format!("#{n}=0"));
                self.line(&format!("o{o} while [#{n} LT {times}]"));
                self.line(&format!("#{n}=[#{n}+1]"));
                if *leave {
                    let i = self.label();
                    self.line(&format!("o{i} if [#{n} EQ 2]"));
                    self.line(&format!("o{o} break"));
                    self.line(&format!("o{i} endif"));
                }
                self.body(body);
                self.line(&format!("o{o} endwhile"));
                self.settle();
            }
            Step::Repeat { times, body, skip } => {
                let o = self.label();
                let n = 200 + o;
                // No `continue` in the do loop: inside a repeat it makes rs274 (and us) go round for ever.
                let (begin, end) = if *skip {
                    (format!("#{n}=0\no{o} do\n#{n}=[#{n}+1]"), format!("M0\no{o} while [#{n} LT {times}]"))
                } else {
                    (format!("o{o} repeat [{times}]"), format!("o{o} endrepeat"))
                };
                self.line(&begin);
                self.body(body);
                self.line(&end);
                self.settle();
            }
            Step::If { condition, yes, no } => {
                let o = self.label();
                let e = self.expression(condition);
                self.line(&format!("o{o} if [{e} GT 10]"));
                self.body(yes);
                self.line(&format!("o{o} elseif [{e} LT -10]"));
                self.line("(between)");
                self.line(&format!("o{o} else"));
                self.body(no);
                self.line(&format!("o{o} endif"));
                self.settle();
            }
            Step::Sub { arguments, body, value } => {
                let o = self.label();
                let main = std::mem::take(&mut self.text);
                self.line(&format!("o{o} sub"));
                self.line("(debug,arguments #1 #2 #3)");
                self.body(body);
                self.line(&format!("o{o} endsub{}", if *value { " [#1+1]" } else { "" }));
                let sub = std::mem::replace(&mut self.text, main);
                self.subs.push_str(&sub);
                let mut call = format!("o{o} call");
                for a in arguments {
                    let _ = write!(call, " [{}]", self.expression(a));
                }
                self.line(&call);
                self.line("(debug,returned #<_value> #<_value_returned>)");
                self.modes();
                self.settle();
            }
            Step::Data { kind, tool, offsets, radius, angles, orientation, apply } => {
                let tool = [1, 2, 3, 5, 7, 20][usize::from(*tool)];
                let mut words = String::new();
                let mut seen = 0;
                for (axis, v) in offsets {
                    if seen & (1 << axis) != 0 {
                        continue;
                    }
                    seen |= 1 << axis;
                    let v = if *axis < 3 { show(self.len(f64::from(*v))) } else { v.to_string() };
                    let _ = write!(words, " {}{v}", char::from(b"XYZABC"[usize::from(*axis)]));
                }
                if let Some(r) = radius {
                    let _ = write!(words, " R{}", show(self.len(f64::from(*r) / 4.0)));
                }
                if let Some((i, j)) = angles {
                    let _ = write!(words, " I{i} J{j}");
                }
                if let Some(q) = orientation {
                    let _ = write!(words, " Q{q}");
                }
                self.line(&format!("G10 L{} P{tool}{words}", [1, 10, 11][usize::from(*kind)]));
                match apply {
                    0 => {}
                    1 => self.line(&format!("G43 H{tool}")),
                    2 => self.line(&format!("T{tool} M6 G43")),
                    _ => self.line(&format!("G43.2 H{tool}")),
                }
                self.line("(debug,#5400 #5401 #5402 #5403 #5404 #5410 #5411 #5412 #5413)");
                self.settle();
            }
            Step::Rotary { a, b, c } => {
                let words = self.by([Some(self.len(10.0)), None, None]);
                self.line(&format!("G1{words} A{a} B{b} C{c}"));
                self.line("G0 A0 B0 C0");
                self.last = "";
            }
            Step::Diameter(body) => {
                self.line("G7");
                let outer = std::mem::replace(&mut self.diameter, true);
                self.body(body);
                self.diameter = outer;
                self.line("G8");
                self.settle();
            }
            Step::Comment(k) => self.line(
                [
                    "(a comment)", "; another", "(MSG, hello there)", "N100 (numbered)", "G1 F500 (after) (two)", "( )", "  ", "(LOG, text)", "n20 g4 p .5",
                ][usize::from(*k)],
            ),
            Step::Deleted(x) => {
                let x = show(self.len(f64::from(*x)));
                self.line(&format!("/ G90 G0 X{x}"));
                self.modes();
                self.settle();
            }
            Step::Stop(optional) => self.line(if *optional { "M1" } else { "M0" }),
            Step::Thread { kind, depth, pitch } => {
                let (k, d) = (show(self.len(f64::from(*pitch))), self.len(-f64::from(*depth) * 10.0));
                match kind {
                    0 => {
                        let words = self.by([None, None, Some(d)]);
                        self.line(&format!("G33{words} K{k}"));
                    }
                    1 => {
                        let words = self.by([None, None, Some(d)]);
                        self.line(&format!("G33.1{words} K{k}"));
                    }
                    _ => {
                        self.line("G18 G90");
                        let (z, i, j, k2) = (show(d), show(self.len(-10.0)), show(self.len(2.0)), show(self.len(10.0)));
                        self.line(&format!("G76 P{k} Z{z} I{i} J{j} K{k2} R1.5 Q29.5 H1"));
                        self.modes();
                    }
                }
                self.settle();
            }
        }
    }

    fn cycle(&mut self, code: u8, depth: u8, clear: u8, points: &[(i8, i8)], repeats: u8, back: bool) {
        self.settle();
        const CODES: [u8; 10] = [81, 82, 83, 73, 84, 85, 86, 89, 88, 74];
        let code = CODES[usize::from(code)];
        let (r, bottom) = (self.len(f64::from(clear)), self.len(-f64::from(depth) * 5.0));
        let letters = ['X', 'Y', 'Z'];
        let [a, b, n] = self.indices();
        let more = match code {
            82 | 86 | 88 | 89 => " P0.5".to_string(),
            83 | 73 => format!(" Q{}", show(self.len(f64::from(depth) * 2.0 + 1.0))),
            _ => String::new(),
        };
        if code == 74 {
            self.line("M4");
        }
        let (r, bottom) = if self.incremental { (r - self.at[n], bottom - r) } else { (r, bottom) };
        for (i, (x, y)) in points.iter().enumerate() {
            let (x, y) = (show(self.len(f64::from(*x) * 3.0)), show(self.len(f64::from(*y) * 3.0)));
            let head = if i == 0 { format!("G{} G{code} ", if back { 98 } else { 99 }) } else { String::new() };
            let tail = if i == 0 { format!(" {}{} R{}{more}", letters[n], show(bottom), show(r)) } else { String::new() };
            let times = if repeats > 1 && code != 74 { format!(" L{repeats}") } else { String::new() };
            self.line(&format!("{head}{}{x} {}{y}{tail}{times}", letters[a], letters[b]));
        }
        self.line("G80");
        if code == 74 || code == 84 {
            self.line("M3");
        }
        self.settle();
    }

    fn contour(&mut self, left: bool, dynamic: bool, tool: u8, moves: &[(u8, i16, u8)]) {
        if self.plane == 19 {
            self.plane = 17;
            self.line("G17");
        }
        self.settle();
        self.line(&match (dynamic, left) {
            (false, true) => format!("G41 D{tool}"),
            (false, false) => format!("G42 D{tool}"),
            (true, true) => format!("G41.1 D{}", show(self.len(f64::from(tool) * 15.0))),
            (true, false) => format!("G42.1 D{}", show(self.len(f64::from(tool) * 15.0))),
        });
        let entry = self.len(200.0);
        let words = self.in_plane(entry, 0.0, None);
        self.line(&format!("G1{words}"));
        let words = self.in_plane(entry, 0.0, None);
        self.line(&format!("G1{words}"));
        let mut heading: f64 = 0.0;
        for (kind, turn, length) in moves {
            heading += f64::from(*turn);
            let l = self.len(f64::from(*length) * 10.0);
            match kind {
                0 | 1 => {
                    // An arc that leaves in the direction of the heading.
                    let ccw = *kind == 0;
                    let start = heading + if ccw { -90.0 } else { 90.0 };
                    let sweep = 40.0 + f64::from(*length) * 3.0;
                    self.arc(ccw, l, start, sweep, None, 0, 0);
                    heading += if ccw { sweep } else { -sweep };
                }
                2 => {
                    let words = self.in_plane(l * heading.to_radians().cos(), l * heading.to_radians().sin(), Some(self.len(-2.0)));
                    self.line(&format!("G1{words}"));
                }
                3 => {
                    let words = self.in_plane(l * heading.to_radians().cos(), l * heading.to_radians().sin(), None);
                    self.line(&format!("G0{words}"));
                }
                _ => {
                    let words = self.in_plane(l * heading.to_radians().cos(), l * heading.to_radians().sin(), None);
                    self.line(&format!("G1{words}"));
                    self.line("(between)");
                }
            }
        }
        self.line("G40");
        self.settle();
    }

    fn expression(&self, e: &Expr) -> String {
        match e {
            Expr::Number(n, decimals) => {
                let v = f64::from(*n) / 10_f64.powi(i32::from(*decimals));
                if v < 0.0 { format!("[{}]", show(v)) } else { show(v) }
            }
            Expr::Parameter(n) => format!("#{}", 31 + n),
            Expr::Named(n) => format!("#<{}>", NAMES[usize::from(*n)]),
            Expr::Unary(f, e) => {
                const F: [&str; 9] = ["ABS", "SIN", "COS", "FIX", "FUP", "ROUND", "TAN", "SQRT[ABS", "EXISTS"];
                let inner = self.expression(e);
                match F[usize::from(*f)] {
                    "SQRT[ABS" => format!("SQRT[ABS[{inner}]]"),
                    "EXISTS" => "EXISTS[#<v1>]".into(),
                    name => format!("{name}[{inner}]"),
                }
            }
            Expr::Binary(o, a, b) => {
                const O: [&str; 14] = ["+", "-", "*", "/", "MOD", "EQ", "NE", "GT", "GE", "LT", "LE", "AND", "OR", "XOR"];
                let (a, b, o) = (self.expression(a), self.expression(b), O[usize::from(*o)]);
                if o == "/" || o == "MOD" {
                    // Never by zero.
                    format!("[{a} {o} [ABS[{b}] + 1]]")
                } else {
                    format!("[{a} {o} {b}]")
                }
            }
            Expr::Atan(a, b) => format!("ATAN[{}]/[{}]", self.expression(a), self.expression(b)),
        }
    }
}

/// A tool table with offsets in several axes, diameters, angles and orientations, inches; the same for the same number.
pub fn tools(seed: u32) -> String {
    let mut state = seed | 1;
    let mut next = |n: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % n
    };
    let mut out = String::new();
    for (pocket, tool) in [1, 2, 3, 5, 7, 20].into_iter().enumerate() {
        let _ = write!(out, "T{tool} P{}", pocket + 1);
        for axis in "XYZABCUVW".chars() {
            if axis == 'Z' || next(4) == 0 {
                let _ = write!(out, " {axis}{:+.4}", (f64::from(next(40_000)) - 20_000.0) / 10_000.0);
            }
        }
        let _ = write!(out, " D{:.4}", f64::from(next(4000)) / 10_000.0);
        if next(3) == 0 {
            let _ = write!(out, " I{} J{} Q{}", next(180), next(180), next(10));
        }
        out.push('\n');
    }
    out
}

/// The program of these steps.
pub fn write(steps: &[Step]) -> String {
    let mut w = Writer { text: String::new(), subs: String::new(), plane: 17, inch: false, incremental: false, at: [0.0; 3], label: 0, last: "", diameter: false };
    w.block(steps);
    let head = "G17 G21 G90 G94 G40 G49 G80 G54\nT1 M6 G43\nF600 S1000 M3\n#31=1 #32=2.5 #33=-3 #34=0.125 #35=100 #36=0\n#<v1>=7 #<v3>=1 #<_g1>=0\nG0 X0 Y0 Z5\n";
    format!("{head}{}{}M2\n", w.subs, w.text)
}
