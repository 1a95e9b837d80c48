//! A judge of restarts that shares no code with them: every line of every program here is started from, and a model of
//! the stock, cut as far as the program had come, says whether a rapid of the approach meets material. Where the machine
//! stands by then nobody knows. What is in force and what follows must be the program's own.

mod reader;

use std::collections::HashSet;

use gr_backends::rs274ngc::{Options, emit};
use gr_backends::{Texts, from_line};
use gr_canon::{Axes, FileId};
use gr_interp::{Setup, Tool};
use gr_ir::{Op, Program, State};

/// What comes to the tool from where.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Kind {
    /// Cuts from above, Z.
    Mill,
    /// Cuts from outside, X.
    Outside,
    /// Cuts from within, X.
    Bore,
    /// Cuts anywhere: there is no stock to speak of.
    Anything,
}

const CELL: f64 = 0.5;
const DUST: f64 = 1e-6;

/// Places are cells of what the tool goes along (mill: X and Y; lathe: Z); the depth is how far in it is free.
struct Stock {
    kind: Kind,
    /// Everything is free up to here: rapids of the program cross there.
    clear: f64,
    cells: std::collections::HashMap<(i64, i64), f64>,
}

impl Stock {
    fn new(kind: Kind, program: &Program) -> Stock {
        let mut stock = Stock { kind, clear: f64::NEG_INFINITY, cells: Default::default() };
        let mut clear = f64::INFINITY;
        for (_, from, to) in moves(program).filter(|m| m.0 == Op::Rapid) {
            let (a, b) = (stock.split(&from), stock.split(&to));
            if a.0 != b.0 {
                clear = clear.min(a.1.min(b.1));
            }
        }
        stock.clear = if kind == Kind::Anything { f64::NEG_INFINITY } else { clear };
        stock
    }

    /// Where along, and how far out; greater is farther from the material.
    fn split(&self, p: &Axes) -> ([f64; 2], f64) {
        match self.kind {
            Kind::Mill | Kind::Anything => ([p[0], p[1]], p[2]),
            Kind::Outside => ([p[2], 0.0], p[0]),
            Kind::Bore => ([p[2], 0.0], -p[0]),
        }
    }

    fn along(&self, from: &Axes, to: &Axes) -> impl Iterator<Item = ((i64, i64), f64)> + use<> {
        let ((a, out_a), (b, out_b)) = (self.split(from), self.split(to));
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        let n = (length / CELL * 3.0).ceil().clamp(1.0, 4000.0);
        (0..=n as usize).map(move |k| {
            let t = k as f64 / n;
            let at = |i: usize| ((a[i] + (b[i] - a[i]) * t) / CELL).round() as i64;
            ((at(0), at(1)), out_a + (out_b - out_a) * t)
        })
    }

    fn cut(&mut self, from: &Axes, to: &Axes) {
        for (cell, out) in self.along(from, to).collect::<Vec<_>>() {
            let free = self.cells.entry(cell).or_insert(f64::INFINITY);
            *free = free.min(out);
        }
    }

    /// Whether a rapid meets what was not cut.
    fn meets(&self, from: &Axes, to: &Axes) -> Option<f64> {
        let near = |cell: (i64, i64)| {
            let cells = (-1..=1).flat_map(|i| (-1..=1).map(move |j| (cell.0 + i, cell.1 + j)));
            cells.filter_map(|c| self.cells.get(&c)).copied().fold(f64::INFINITY, f64::min)
        };
        self.along(from, to).find(|(cell, out)| *out < self.clear - DUST && *out < near(*cell) - DUST).map(|(_, out)| out)
    }
}

/// The moves in the frame of the machine: what they are, from where and to where, arcs as chords.
fn moves(program: &Program) -> impl Iterator<Item = (Op<'_>, Axes, Axes)> {
    let mut out = Vec::new();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if view.op.moves() {
            let [from, to] = [view.start, view.end].map(|p| view.state.machine(&p.axes));
            out.push((view.op, from, to));
        }
    }
    out.into_iter()
}

fn setup() -> Setup {
    let tool = |number: i32, z: f64| {
        let mut offset: Axes = [0.0; 9];
        offset[2] = z;
        Tool { number, pocket: number, offset, diameter: 6.0, ..Tool::default() }
    };
    let mut setup = Setup::default();
    setup.tools.rows = vec![tool(0, 0.0), tool(1, 50.0), tool(2, 62.5), tool(3, 0.0)];
    setup
}

/// What is in force, but for what nobody can restore or need not: a tool that was never named, a surface mode of a
/// spindle that has no speed.
fn in_force(state: &State) -> State {
    let mut s = *state;
    s.tool = s.tool.max(0);
    s.prepared = if s.prepared == s.tool { 0 } else { s.prepared.max(0) };
    for spindle in &mut s.spindles {
        if spindle.speed == 0.0 {
            spindle.surface = None;
        }
    }
    s
}

/// Starts from every line; says how many were possible.
fn judge(name: &str, text: &str, kind: Kind, setup: &Setup) -> usize {
    let program = reader::read(text, setup).unwrap_or_else(|e| panic!("{name}: {e}"));
    let texts = Texts::new([(FileId(0), text)]);
    let top = moves(&program).filter(|m| m.1[2] != m.2[2]).map(|m| m.1[2].max(m.2[2])).fold(f64::NEG_INFINITY, f64::max);
    let mut possible = 0;
    for line in 1..=text.lines().count() as u32 {
        let options = from_line::Options { safe_z: None, ..from_line::Options::default() };
        let Ok(restart) = from_line::from_line(&program, FileId(0), line, &options, &texts) else {
            continue;
        };
        possible += 1;
        let at = format!("{name}, line {line}");
        let new = &restart.program;
        let inserted = new.steps().filter(|s| s.source.line == from_line::INSERTED).map(|s| s.index + 1).last().unwrap_or(0);
        let index = program.len() - (new.len() - inserted);

        // What follows is the program's own.
        for (a, b) in program.steps().skip(index).zip(new.steps().skip(inserted)) {
            assert_eq!((a.op, a.source), (b.op, b.source), "{at}: another operation");
        }
        // And so is what it finds.
        assert_eq!(in_force(new.cursor_at(inserted).state()), in_force(program.cursor_at(index).state()), "{at}: what is in force");

        let mut stock = Stock::new(kind, &program);
        let mut cursor = program.cursor();
        while let Some(view) = cursor.next().filter(|v| v.index < index) {
            if view.op.moves() {
                let [from, to] = [view.start, view.end].map(|p| view.state.machine(&p.axes));
                stock.cut(&from, &to);
            }
        }
        // Where the program cut before it said a height, a restart has none to go to either.
        let high = top.is_finite() && (matches!(kind, Kind::Outside | Kind::Bore) || program.steps().take(index).any(|s| s.op.moves() && s.start.axes[2] != s.end.axes[2]));
        check_approach(&at, new, inserted, kind, &stock, if high { top } else { f64::NAN });
        let tools = setup.tools.rows.iter().skip(1).map(|t| (t.number, t.offset)).collect();
        let written = emit(new, &Options { tools, ..Options::default() }, &texts);
        let written = written.unwrap_or_else(|e| panic!("{at}: {e:?}")).text;
        reader::read(&written, setup).unwrap_or_else(|e| panic!("{at}: {e}\n--- of\n{text}"));
    }
    possible
}

/// The rapids put in: none before it is known where the tool is, none through stock.
fn check_approach(at: &str, new: &Program, inserted: usize, kind: Kind, stock: &Stock, top: f64) {
    let mut known: HashSet<usize> = HashSet::new();
    let stands = !new.steps().take(inserted).any(|s| s.op.moves());
    let mut cursor = new.cursor();
    while let Some(view) = cursor.next().filter(|v| v.index < inserted) {
        match view.op {
            // Until it is over its place the spindle stands still and may stand in the part.
            Op::SpindleTurn { .. } | Op::Flood(true) | Op::Mist(true) => {
                assert!(!known.is_empty() || stands, "{at}: the spindle starts where it stood");
            }
            op if op.moves() => {
                let [from, to] = [view.start, view.end].map(|p| view.state.machine(&p.axes));
                let moved: HashSet<usize> = (0..3).filter(|i| from[*i] != to[*i]).collect();
                if op == Op::Rapid {
                    let (first, safe) = match kind {
                        Kind::Mill => (2, to[2] >= top - 1.0 || to[2] >= stock.clear - DUST),
                        Kind::Outside => (0, to[0] >= stock.clear - DUST),
                        Kind::Bore => (2, true),
                        Kind::Anything => (2, true),
                    };
                    // A program without heights has none to go to.
                    if known.is_empty() && top.is_finite() && kind != Kind::Anything {
                        assert_eq!(moved, HashSet::from([first]), "{at}: the way out is not alone");
                        assert!(safe, "{at}: the way out ends at {to:?}");
                    } else if moved.iter().all(|i| known.contains(i)) {
                        assert_eq!(stock.meets(&from, &to), None, "{at}: a rapid from {from:?} to {to:?} meets stock");
                    } else {
                        // From a place that nobody knows: only what it arrives at can be judged.
                        assert_eq!(stock.meets(&to, &to), None, "{at}: a rapid to {to:?} ends in stock");
                    }
                }
                known.extend(moved);
            }
            _ => {}
        }
    }
}

const POCKETS: &str = "\
G21 G90 G17 G40 G49 G54
G28 G91 Z0
G90
T1 M6
G43 H1
S3000 M3
M8
G0 X10 Y10
G0 Z60
Z5
G1 Z-2 F100
X40
Y30
G2 X30 Y40 I-10 J0
G1 X10
Y10
Z-4
X40
Y30
G0 Z20
X60 Y60
Z5
G1 Z-3
#1=0
o1 while [#1 lt 2]
#1=[#1+1]
G1 X[60+#1*4]
Y[60+#1*4]
G4 P.1
o1 endwhile
o2 if [#1 eq 7]
G1 X200 Z-10
o2 endif
G0 Z20
M9
M5
M19 R90
G28 G91 Z0
G90
T2 M6
G43 H2
M64 P1
G0 X15 Y15
Z20
S900 M3
G81 X15 Y15 Z-9 R5 F80
X35
Y35
G80
G0 Z20
G55
G0 X3 Y3
Z5
G1 Z-1
X9
G54 G0 Z30
M5
G53 G0 Z0
M65 P1
M2
";

const TURNING: &str = "\
G21 G90 G18 G8 G40
T1 M6
G96 D2500 S150 M3
G95
G0 X34 Z3
X30
G1 Z-40 F.2
X31
G0 X34 Z3
X27
G1 Z-30
X31 Z-34
G0 X34
Z-20
X28
G1 X22 F.08
G4 P.5
G0 X28
X34
G97 S600
Z3
X26
G33 Z-15 K1
G0 X34
Z3
M5
M2
";

const BORING: &str = "\
G21 G90 G18 G8 G94
T1 M6
S800 M3
G0 X8 Z5
G1 X10 F60
Z-20
X9
G0 Z5
G1 X11
Z-18
G4 P.5
X9
G0 Z5
M5
M2
";

#[test]
fn no_restart_meets_the_stock() {
    assert!(judge("pockets", POCKETS, Kind::Mill, &setup()) > 50);
    assert!(judge("turning", TURNING, Kind::Outside, &setup()) > 20);
    assert!(judge("boring", BORING, Kind::Bore, &setup()) > 12);
}

/// The shipped parts and the corpus of mills.
#[test]
fn no_restart_of_real_programs_meets_the_stock() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    for name in ["docs/examples/bracket.ngc", "docs/examples/flange.ngc", "tests/corpus/accepted/arcs.ngc", "tests/corpus/accepted/cycles-sticky.ngc",
        "tests/corpus/accepted/offsets.ngc", "tests/corpus/accepted/modal-state.ngc", "tests/corpus/accepted/spindle.ngc",
        "tests/corpus/accepted/inputs-outputs.ngc", "tests/corpus/accepted/loops.ngc",
        "tests/corpus/accepted/subs-numbered.ngc", "tests/corpus/accepted/modes.ngc",
        "tests/corpus/accepted/splines.ngc", "tests/corpus/accepted/polar.ngc", "tests/corpus/accepted/comp-arc-arc.ngc"]
    {
        let text = std::fs::read_to_string(format!("{root}/{name}")).expect("a program");
        let setup = Setup { tools: gr_interp::assumed_tools(), ..Setup::default() };
        judge(name, &text, Kind::Mill, &setup);
    }
}

proptest::proptest! {
    #![proptest_config(proptest::test_runner::Config { cases: 48, failure_persistence: None, ..Default::default() })]

    /// Programs with anything in them.
    #[test]
    fn no_restart_of_random_programs_loses_what_is_in_force(steps in gr_tests::random::programs()) {
        let text = gr_tests::random::write(&steps);
        if reader::read(&text, &setup()).is_ok() {
            judge("random", &text, Kind::Anything, &setup());
        }
    }
}

/// What a restart can't know or do is told.
#[test]
fn what_a_restart_tells() {
    let codes = |text: &str, line: u32| -> Vec<&'static str> {
        let program = reader::read(text, &setup()).expect("it runs");
        let texts = Texts::new([(FileId(0), text)]);
        let o = from_line::Options { safe_z: Some(200.0), ..from_line::Options::default() };
        let found = match from_line::from_line(&program, FileId(0), line, &o, &texts) {
            Ok(restart) => restart.notes,
            Err(found) => found,
        };
        found.iter().map(|d| d.code.def().code).collect()
    };
    // A branch that is not taken; the program lifts the tool before it changes it.
    assert_eq!(codes(POCKETS, 32), ["E0617", "E0618"]);
    assert_eq!(codes(POCKETS, 46), ["E0618"]);
    // Cut at a height of the machine.
    let text = "G21 G90 F100\nG0 X0 Y0 Z5\nG53 G0 Z-3\nG1 X10\nX20\nM2\n";
    assert_eq!(codes(text, 5), ["E0619"]);
    assert!(codes(text, 2).is_empty());
    // A rapid names X and Y before the cut, the cut does, or only one of them is named.
    let beside = |end: &str| format!("G21 G90 G54 F100\nG0 Z5\nG0 X0 Y0\nG0 Z0.5\nG1 X20\nG53 G0 X0 Y0\nM0\n{end}\nM2\n");
    assert!(codes(&beside("G0 X30 Y30\nG1 X50"), 8).is_empty());
    assert_eq!(codes(&beside("G1 X30 Y30\nX50"), 8), ["E0619"]);
    assert_eq!(codes(&beside("G0 X30\nG1 Y50"), 8), ["E0619"]);
}

/// Where the height is known and X and Y are at places of the machine, the tool goes down once a rapid has named them.
#[test]
fn goes_down_where_x_and_y_are_named() {
    let text = "G21 G90 G54 F100\nG0 Z5\nG0 X0 Y0\nG0 Z0.5\nG1 X20\nG53 G0 X0 Y0\nM0\nG0 X30\nG0 Y40\nG1 X50\nM2\n";
    let program = reader::read(text, &setup()).expect("it runs");
    let texts = Texts::new([(FileId(0), text)]);
    let o = from_line::Options { safe_z: Some(9.0), ..from_line::Options::default() };
    let restart = from_line::from_line(&program, FileId(0), 8, &o, &texts).expect("a start").program;
    let way: Vec<(bool, [f64; 3])> = restart.steps().filter(|s| s.op.moves()).map(|s| (s.op.feeds(), s.end.xyz())).collect();
    let places: Vec<[f64; 2]> = way.iter().map(|(_, [x, _, z])| [*x, *z]).collect();
    let of = |i: usize| way[i];
    assert_eq!(way.len(), 6, "{places:?}");
    assert!(of(0).1[2] == 9.0 && of(1).1[0] == 30.0 && of(1).1[2] == 9.0, "{way:?}");
    assert_eq!([of(2), of(3), of(4), of(5)], [(false, [30.0, 40.0, 9.0]), (false, [30.0, 40.0, 2.5]), (true, [30.0, 40.0, 0.5]), (true, [50.0, 40.0, 0.5])]);
}
