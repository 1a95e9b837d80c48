//! A pen that writes programs: it knows plane, units and distance mode, so that one description of a path gives
//! the right words under each of them.

use std::fmt::Write;

/// What a program is written under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Modes {
    /// 17, 18 or 19.
    pub plane: u8,
    /// G20 instead of G21.
    pub inch: bool,
    /// G91 instead of G90.
    pub incremental: bool,
    /// 40, 41 or 42; 411 and 421 for G41.1 and G42.1.
    pub comp: u16,
}

impl Modes {
    /// Every combination: 3 planes, 2 units, 2 distance modes, 5 kinds of compensation.
    pub fn all() -> impl Iterator<Item = Modes> {
        [17, 18, 19].into_iter().flat_map(|plane| {
            [false, true].into_iter().flat_map(move |inch| {
                [false, true].into_iter().flat_map(move |incremental| {
                    [40, 41, 42, 411, 421].into_iter().map(move |comp| Modes { plane, inch, incremental, comp })
                })
            })
        })
    }
    /// `G17 G21 G90 G40`
    pub fn name(&self) -> String {
        format!("G{}-G{}-G{}-G{}", self.plane, if self.inch { 20 } else { 21 }, if self.incremental { 91 } else { 90 }, self.comp)
    }
}

/// Writes a program. Lengths are given in millimeters; positions as distances along the plane's first and second
/// axis and its normal.
#[derive(Clone, Debug)]
pub struct Pen {
    /// Modes in force.
    pub modes: Modes,
    /// The program so far.
    pub text: String,
    /// Position in ten-thousandths of the unit: first, second, normal axis.
    at: [i64; 3],
}

/// Ten-thousandths.
fn number(v: i64) -> String {
    let sign = if v < 0 { "-" } else { "" };
    let (whole, part) = (v.unsigned_abs() / 10_000, v.unsigned_abs() % 10_000);
    if part == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{part:04}").trim_end_matches('0').to_string() }
}

impl Pen {
    /// Begins a program: modes, tool, feed, spindle, a rapid to the start.
    pub fn new(modes: Modes) -> Pen {
        let mut pen = Pen { modes, text: String::new(), at: [0; 3] };
        let inch = if modes.inch { 20 } else { 21 };
        let _ = writeln!(pen.text, "G{} G{inch} G90 G94 G40 G49 G80 G54", modes.plane);
        pen.line("T1 M6 G43 H1");
        let feed = pen.len(600.0);
        pen.line(&format!("F{feed} S1200 M3"));
        let [x, y, z] = pen.letters();
        let up = pen.len(5.0);
        pen.line(&format!("G0 {x}0 {y}0 {z}{up}"));
        pen.at[2] = pen.units(5.0);
        if modes.incremental {
            pen.line("G91");
        }
        pen
    }
    /// Adds a line.
    pub fn line(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }
    /// First axis, second axis, normal.
    pub fn letters(&self) -> [char; 3] {
        match self.modes.plane {
            18 => ['Z', 'X', 'Y'],
            19 => ['Y', 'Z', 'X'],
            _ => ['X', 'Y', 'Z'],
        }
    }
    /// Letters of the center for the first and second axis.
    pub fn center_letters(&self) -> [char; 2] {
        match self.modes.plane {
            18 => ['K', 'I'],
            19 => ['J', 'K'],
            _ => ['I', 'J'],
        }
    }
    fn units(&self, mm: f64) -> i64 {
        (mm * 10_000.0 / if self.modes.inch { 25.4 } else { 1.0 }).round() as i64
    }
    /// A length of so many millimeters, as the program writes it.
    pub fn len(&self, mm: f64) -> String {
        number(self.units(mm))
    }
    /// Axis words that move by `d` millimeters; none: no word.
    pub fn by(&mut self, d: [Option<f64>; 3]) -> String {
        let mut out = String::new();
        for (i, letter) in self.letters().into_iter().enumerate() {
            let Some(mm) = d[i] else { continue };
            let step = self.units(mm);
            self.at[i] += step;
            let _ = write!(out, " {letter}{}", number(if self.modes.incremental { step } else { self.at[i] }));
        }
        out
    }
    /// A move in the plane.
    pub fn go(&mut self, code: &str, first: f64, second: f64) {
        let words = self.by([Some(first), Some(second), None]);
        self.line(&format!("{code}{words}"));
    }
    /// A move along the normal.
    pub fn lift(&mut self, code: &str, normal: f64) {
        let words = self.by([None, None, Some(normal)]);
        self.line(&format!("{code}{words}"));
    }
    /// An arc with its center `(ci, cj)` from the start.
    pub fn arc(&mut self, code: &str, first: f64, second: f64, normal: Option<f64>, center: [f64; 2], more: &str) {
        let words = self.by([Some(first), Some(second), normal]);
        let [i, j] = self.center_letters();
        let (ci, cj) = (self.len(center[0]), self.len(center[1]));
        self.line(&format!("{code}{words} {i}{ci} {j}{cj}{more}"));
    }
    /// Switches compensation on with the entry move it needs (nothing for 40).
    pub fn compensate(&mut self) {
        let d = self.len(4.0);
        match self.modes.comp {
            40 => return,
            41 => self.line("G41 D1"),
            42 => self.line("G42 D1"),
            411 => self.line(&format!("G41.1 D{d}")),
            _ => self.line(&format!("G42.1 D{d}")),
        }
        self.go("G1", 10.0, 0.0);
        self.go("G1", 10.0, 0.0);
    }
    /// Switches it off again and ends the program.
    pub fn end(mut self) -> String {
        if self.modes.comp != 40 {
            self.line("G40");
            self.go("G1", 10.0, 10.0);
        }
        self.line("M2");
        self.text
    }
}
