//! G-code → STEP-NC → G-code: what the machine does must be the same, wherever it stood before.

use super::{Folder, code, err};

/// Random numbers that are the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self, below: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % below
    }
    /// A coordinate with three decimals.
    fn place(&mut self, low: i64, high: i64) -> f64 {
        (low * 1000 + self.next(((high - low) * 1000) as u64) as i64) as f64 / 1000.0
    }
}

/// A program: an unknown start, rapids, cuts, arcs, stops and tool changes.
fn program(r: &mut Random) -> String {
    let first = 1 + r.next(2);
    let mut out = format!("G21 G17 G90 G94 G54\nT{first} M6\n");
    let (x, y, z) = (r.place(-2, 3).trunc(), r.place(-50, 50), r.place(5, 40));
    let length = format!("G43 H{first}");
    let start = match r.next(6) {
        0 => format!("{length}\nG0 X{x} Y{y}\nG0 Z{z}\n"),
        1 => format!("{length}\nG0 Z{z}\nG0 X{x} Y{y}\n"),
        2 => format!("{length}\nG0 X{x}\nG0 Y{y}\nZ{z}\n"),
        3 => format!("{length}\nG0 X{x} Y{y} Z{z}\n"),
        4 => format!("G0 X{x} Y{y}\n{length}\nG0 Z{z}\n"),
        _ => format!("G0 {length} Z{z}\nG0 Y{y}\nX{x}\n"),
    };
    out += &start;
    out += &format!("S{} M3\nG1 Z-1 F{}\n", 500 + r.next(5000), 50 + r.next(900));
    for _ in 0..5 + r.next(15) {
        let (x, y, z) = (r.place(-50, 50), r.place(-50, 50), r.place(-10, 50));
        match r.next(10) {
            0 | 1 => out += &format!("G0 X{x} Y{y} Z{z}\n"),
            2..=4 => out += &format!("G1 X{x} Y{y} Z{z} F{}\n", 1 + r.next(3000)),
            5 => out += &format!("G{} X{x} Y{y} R{}\n", 2 + r.next(2), 200 + r.next(300)),
            6 => out += &format!("G3 I{} J{}\n", r.place(1, 9), r.place(-5, 5)),
            7 => out += ["M0\n", "M1\n", "G4 P0.75\n", "M8\n", "M7\n", "M9\n", "(MSG, look)\n"][r.next(7) as usize],
            8 => out += &format!("S{}\n", 100 + r.next(4000)),
            _ => {
                let t = 1 + r.next(2);
                out += &format!("G0 Z60\nM5\nT{t} M6\nG43 H{t}\nS900 M3\nG0 X{x} Y{y}\n");
                out += &format!("G0 Z{}\n", z.abs() + 1.0);
            }
        }
    }
    out + "G0 Z60\nM5\nM9\n" + ["M2\n", "M30\n"][r.next(2) as usize]
}

/// A move as the words say it.
#[derive(Debug, PartialEq, Clone)]
struct Move {
    code: u32,
    from: [Option<f64>; 3],
    to: [Option<f64>; 3],
    /// Radius, or centre from the start.
    arc: [f64; 3],
    feed: f64,
}

/// A reader of its own for the few words that these programs have.
fn moves(text: &str) -> Vec<Move> {
    let (mut code, mut at, mut feed, mut out) = (0, [None; 3], 0.0, Vec::new());
    for line in text.lines().filter(|l| !l.starts_with(['(', '%', ';'])) {
        let line = line.split('(').next().unwrap_or_default();
        let starts: Vec<usize> = line.char_indices().filter(|(_, c)| c.is_ascii_alphabetic()).map(|(i, _)| i).collect();
        let word = |k: usize| {
            let end = starts.get(k + 1).copied().unwrap_or(line.len());
            (line.as_bytes()[starts[k]], line[starts[k] + 1..end].trim().parse::<f64>().unwrap())
        };
        let words: Vec<(u8, f64)> = (0..starts.len()).map(word).collect();
        let dwells = words.contains(&(b'G', 4.0));
        let (mut to, mut arc, mut moved) = (at, [0.0; 3], false);
        for (letter, value) in words {
            match letter {
                b'G' if value <= 3.0 => code = value as u32,
                b'F' => feed = value,
                b'X' | b'Y' | b'Z' => {
                    to[usize::from(letter - b'X')] = Some(value);
                    moved = true;
                }
                b'I' | b'J' => {
                    arc[usize::from(letter - b'I')] = value;
                    moved = true;
                }
                b'R' => arc[2] = value,
                _ => {}
            }
        }
        if moved && !dwells {
            out.push(Move { code, from: at, to, arc, feed });
            at = to;
        }
    }
    out
}

/// Points along the cuts, a fixed number of each, with their feeds; turns are cut in two on the way.
fn cuts(text: &str) -> Vec<([f64; 3], [f64; 3], f64)> {
    let known = |p: [Option<f64>; 3]| p.map(|v| v.expect("a cut between places that are known"));
    let mut out: Vec<([f64; 3], [f64; 3], f64)> = Vec::new();
    for m in moves(text).into_iter().filter(|m| m.code > 0) {
        let (a, b) = (known(m.from), known(m.to));
        if m.code == 1 {
            if a != b {
                out.push((a, b, m.feed));
            }
            continue;
        }
        let centre = if m.arc[2] > 0.0 { by_radius(a, b, m.arc[2], m.code == 3) } else { [a[0] + m.arc[0], a[1] + m.arc[1]] };
        let angle = |p: [f64; 3]| (p[1] - centre[1]).atan2(p[0] - centre[0]);
        let turn = std::f64::consts::TAU;
        let mut sweep = if m.code == 3 { angle(b) - angle(a) } else { angle(a) - angle(b) }.rem_euclid(turn);
        if sweep < 1e-9 || sweep > turn - 1e-9 {
            sweep = turn;
        }
        let radius = (a[0] - centre[0]).hypot(a[1] - centre[1]);
        // By their lengths and middles: a full turn may be written as two halves.
        let side = if m.code == 3 { 1.0 } else { -1.0 };
        let at = |share: f64| {
            let t = angle(a) + side * sweep * share;
            [centre[0] + radius * t.cos(), centre[1] + radius * t.sin(), a[2] + (b[2] - a[2]) * share]
        };
        let pieces = ((sweep / turn * 360.0).round() as usize).max(1);
        let mut last = a;
        for k in 1..=pieces {
            let p = at(k as f64 / pieces as f64);
            out.push((last, p, m.feed));
            last = p;
        }
    }
    out
}

fn by_radius(a: [f64; 3], b: [f64; 3], r: f64, left: bool) -> [f64; 2] {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let half = dx.hypot(dy) / 2.0;
    let h = (r * r - half * half).max(0.0).sqrt() / (2.0 * half);
    let s = if left { 1.0 } else { -1.0 };
    [(a[0] + b[0]) / 2.0 - s * dy * h, (a[1] + b[1]) / 2.0 + s * dx * h]
}

/// Length and time of a way, and how far apart two ways of equal length are.
fn same_way(a: &[([f64; 3], [f64; 3], f64)], b: &[([f64; 3], [f64; 3], f64)]) -> Result<(), String> {
    let length = |s: &([f64; 3], [f64; 3], f64)| (0..3).map(|i| (s.0[i] - s.1[i]).powi(2)).sum::<f64>().sqrt();
    let total = |all: &[([f64; 3], [f64; 3], f64)]| (all.iter().map(length).sum::<f64>(), all.iter().map(|s| length(s) / s.2).sum::<f64>());
    let ((la, ta), (lb, tb)) = (total(a), total(b));
    if (la - lb).abs() > 1e-2 || (ta - tb).abs() > 1e-4 * ta {
        return Err(format!("cuts {la} mm in {ta} min, back {lb} mm in {tb} min"));
    }
    // The point at every half millimetre of both.
    let points = |all: &[([f64; 3], [f64; 3], f64)]| {
        let (mut out, mut passed, mut next) = (Vec::new(), 0.0, 0.0);
        for s in all {
            let l = length(s);
            while next <= passed + l {
                let share = if l > 0.0 { (next - passed) / l } else { 0.0 };
                out.push([0, 1, 2].map(|i| s.0[i] + (s.1[i] - s.0[i]) * share));
                next += 0.5;
            }
            passed += l;
        }
        out
    };
    let far = points(a).iter().zip(&points(b)).map(|(p, q)| (0..3).map(|i| (p[i] - q[i]).abs()).fold(0.0, f64::max)).fold(0.0, f64::max);
    if far > 5e-3 { Err(format!("the ways are {far} mm apart")) } else { Ok(()) }
}

#[test]
fn random_programs_there_and_back() {
    let f = Folder::new();
    f.put("t.tbl", "T1 P1 D6 Z50 ;end mill\nT2 P2 D4 Z70 ;ball nose R2\n");
    let mut r = Random(7);
    for n in 0..24 {
        let source = program(&mut r);
        f.put("a.ngc", &source);
        f.ok(&["build", "-q", "a.ngc", "--tools", "t.tbl", "--target", "stepnc", "-o", "a.p21"]);
        f.ok(&["build", "-q", "a.p21", "--decimals", "9", "-o", "b.ngc"]);
        let back = f.read("b.ngc");
        let told = |why: &str| format!("program {n}: {why}\n{source}\n{back}");
        same_way(&cuts(&source), &cuts(&back)).unwrap_or_else(|why| panic!("{}", told(&why)));
        // Rapids lead to places that the source names, or are as high as all of it.
        let high = moves(&source).iter().filter_map(|m| m.to[2]).fold(0.0, f64::max);
        let named: Vec<[Option<f64>; 3]> = moves(&source).iter().map(|m| m.to).collect();
        for m in moves(&back).iter().filter(|m| m.code == 0) {
            let low = m.to[2].is_none_or(|z| z < high - 1e-6);
            let near = |q: &[Option<f64>; 3]| (0..3).all(|i| m.to[i].zip(q[i]).is_some_and(|(a, b)| (a - b).abs() < 1e-6));
            assert!(!low || named.iter().any(near), "{}", told(&format!("a rapid to {:?}", m.to)));
        }
        for word in ["M0\n", "M1\n", "M30\n", "G4 P0.75"] {
            assert_eq!(source.matches(word).count(), back.matches(word).count(), "{}", told(word));
        }
    }
}

const HEAD: &str = "G21 G17 G90 G94 G54\nT3 M6\nG43 H3\nS1000 M3\nG0 X10 Y10 Z5\nG1 Z-1 F100\nG0 Z20\n";

/// What only the machine knows, and frames and offsets that change on the way, are no part of a plan.
#[test]
fn what_a_plan_cannot_have() {
    let f = Folder::new();
    f.put("t.tbl", "T3 P3 D6 Z50 ;end mill\nT1 P1 D4 Z70 ;end mill\n");
    let mut all = String::new();
    for (name, tail) in [
        ("G53", "M5\nG53 G0 Z0\nG53 G0 X0 Y0\nM2\n"),
        ("G28", "G28\nM2\n"),
        ("G91 G28", "G91 G28 Z0\nG90\nM2\n"),
        ("G30", "G30 Z25\nM2\n"),
        ("G10 L2", "G10 L2 P1 X50\nG0 X10\nG1 Z-1\nX20\nG0 Z5\nM2\n"),
        ("G10 L20", "G10 L20 P1 X0\nG1 Z-1\nG1 X20\nG0 Z5\nM2\n"),
        ("G92", "G92 X0\nG1 Z-1\nM2\n"),
        ("G49", "G49\nG1 X20 Z-1\nM2\n"),
        ("G43.1", "G43.1 Z-7\nG1 X20 Z-1\nM2\n"),
        ("G43 of another", "G43 H1\nG1 Z-1\nG0 Z20\nM2\n"),
        ("from anywhere", "G53 G0 X0\nG1 Y3\nM2\n"),
    ] {
        f.put("a.ngc", format!("{HEAD}{tail}"));
        all += &format!("{name}:\n{}", f.refused(&["build", "a.ngc", "--tools", "t.tbl", "--target", "stepnc", "-o", "a.p21"]));
    }
    for (name, text) in [
        ("no feed", "G21 G90\nT3 M6\nG0 X1 Y2 Z3\nG0 X5\nM2\n"),
        ("no Y", "G21 G90\nT3 M6\nG0 X1 Z3\nG1 X5 F100\nX6\nM2\n"),
    ] {
        f.put("a.ngc", text);
        all += &format!("{name}:\n{}", f.refused(&["build", "a.ngc", "--tools", "t.tbl", "--target", "stepnc", "-o", "a.p21"]));
    }
    insta::assert_snapshot!("plan_cannot_have", all);
}

/// With losses allowed what has no counterpart is listed, and its motion is not in the file.
#[test]
fn losses_leave_no_motion() {
    let f = Folder::new();
    f.put("t.tbl", "T3 P3 D6 Z50 ;end mill\nT1 P1 D4 Z70 ;end mill\n");
    let mut all = String::new();
    for (name, tail) in [
        ("probe", "G38.2 Z-10 F50\nG1 X5 F100\nG0 Z7\nX1 Y2\nG1 Z-2\nM2\n"),
        ("machine", "G53 G0 Z0\nG0 X1 Y2\nZ3\nG1 Z-2\nM2\n"),
        ("frame", "G10 L2 P1 X50\nG1 Z-3\nX20\nM2\n"),
    ] {
        f.put("a.ngc", format!("{HEAD}{tail}"));
        let o = f.run(&["build", "a.ngc", "--tools", "t.tbl", "--target", "stepnc", "--lossy", "-o", "a.p21", "--message-format", "short"]);
        assert_eq!(code(&o), 0, "{}", err(&o));
        let told: Vec<String> = err(&o).lines().filter(|l| l.contains("E049")).map(str::to_string).collect();
        f.ok(&["build", "-q", "a.p21", "-o", "b.ngc"]);
        all += &format!("{name}:\n{}\n{}\n", told.join("\n"), f.read("b.ngc"));
    }
    insta::assert_snapshot!("losses_leave_no_motion", all);
}

/// Tools come back as the remarks of the table have them, a tool change at the end as well, and the shipped parts whole.
#[test]
fn tools_and_ends() {
    let f = Folder::new();
    let examples = super::root().join("docs/examples");
    for part in ["flange", "bracket"] {
        std::fs::copy(examples.join(format!("{part}.ngc")), f.path("a.ngc")).unwrap();
        let table = examples.join("tools.tbl").to_string_lossy().into_owned();
        f.ok(&["build", "-q", "a.ngc", "--tools", &table, "--target", "stepnc", "-o", "a.p21"]);
        f.ok(&["build", "-q", "a.p21", "--tools", &table, "-o", "b.ngc"]);
        assert!(f.read("b.ngc").trim_end().ends_with("M30"), "{part}");
    }
    f.put("t.tbl", "T3 P3 D6 Z50 ;bull nose R0.5\nT1 P1 D6.8 Z70 ;drill D6.8\nT5 P5 D4 Z30 ;ball nose R2\n");
    f.put("a.ngc", format!("{HEAD}M5\nT1 M6\nG43 H1\nS900 M3\nG0 X0 Y0\nZ2\nG1 Z-9 F80\nG0 Z20\nM5\nT5 M6\nM30\n"));
    f.ok(&["build", "-q", "a.ngc", "--tools", "t.tbl", "--target", "stepnc", "-o", "a.p21"]);
    insta::assert_snapshot!("tools_and_ends", f.read("a.p21"));
    f.ok(&["build", "-q", "a.p21", "--tools", "t.tbl", "-o", "b.ngc"]);
    insta::assert_snapshot!("tools_and_ends_back", f.read("b.ngc"));
}
