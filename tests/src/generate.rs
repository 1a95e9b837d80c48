//! Seeded generators of big programs: the same text everywhere, for benchmarks and memory tests.

use std::fmt::Write;

/// A small generator of pseudo-random numbers (splitmix64).
pub struct Random(u64);

impl Random {
    /// Starts from `seed`.
    pub fn new(seed: u64) -> Random {
        Random(seed)
    }
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    /// `0..n`
    pub fn below(&mut self, n: u64) -> u64 {
        ((u128::from(self.bits()) * u128::from(n)) >> 64) as u64
    }
}

/// Coordinates are counted in 0.1 µm, so that the text is exact.
const MM: i64 = 10_000;
const SIDE: i64 = 300 * MM;

struct Walk {
    random: Random,
    out: String,
    x: i64,
    y: i64,
}

/// `lines` lines of `G1 X Y Z`: a random walk of at most 1 mm a step in a square of 300 mm.
pub fn big(lines: usize) -> String {
    let mut walk = Walk::new(lines);
    for _ in walk.header()..lines.saturating_sub(2) {
        walk.step();
        let z = -(walk.random.below(5 * MM as u64 + 1) as i64);
        walk.out.push_str("G1 ");
        walk.point();
        number(&mut walk.out, " Z", z);
        walk.out.push('\n');
    }
    walk.finish()
}

/// `lines` lines as a CAM system writes them: modal lines, N numbers, comments, feeds, rapids, a tenth of arcs.
pub fn mixed(lines: usize) -> String {
    let mut walk = Walk::new(lines);
    let mut motion = "";
    for n in walk.header()..lines.saturating_sub(2) {
        if walk.random.below(20) == 0 {
            let _ = write!(walk.out, "N{} ", n % 99_999);
        }
        match walk.random.below(100) {
            0..=1 => {
                let _ = write!(walk.out, "(pass {n})");
            }
            2..=6 => {
                walk.step();
                walk.word(&mut motion, "G0 ");
                walk.point();
                walk.out.push_str(" Z5.0000");
            }
            7..=16 => walk.arc(&mut motion),
            kind => {
                walk.step();
                let z = -(walk.random.below(5 * MM as u64 + 1) as i64);
                walk.word(&mut motion, "G1 ");
                walk.point();
                number(&mut walk.out, " Z", z);
                if kind < 22 {
                    let feed = 600 + 100 * walk.random.below(20);
                    let _ = write!(walk.out, " F{feed}");
                }
            }
        }
        walk.out.push('\n');
    }
    walk.finish()
}

impl Walk {
    fn new(lines: usize) -> Walk {
        Walk { random: Random::new(274), out: String::with_capacity(lines * 34), x: 0, y: 0 }
    }
    /// Writes the header; returns its number of lines.
    fn header(&mut self) -> usize {
        let header = "G21 G17 G90 G94\nS8000 M3\nG0 X0 Y0 Z5\nF1500\nG1 Z0\n";
        self.out.push_str(header);
        header.lines().count()
    }
    fn finish(mut self) -> String {
        self.out.push_str("M5\nM2\n");
        self.out
    }
    fn word(&mut self, motion: &mut &'static str, wanted: &'static str) {
        if *motion != wanted {
            self.out.push_str(wanted);
            *motion = wanted;
        }
    }
    fn step(&mut self) {
        let dx = self.random.below(2 * MM as u64 + 1) as i64 - MM;
        let dy = self.random.below(2 * MM as u64 + 1) as i64 - MM;
        self.x = reflect(self.x + dx);
        self.y = reflect(self.y + dy);
    }
    fn point(&mut self) {
        number(&mut self.out, "X", self.x);
        number(&mut self.out, " Y", self.y);
    }
    /// A quarter turn about a centre on the same height: exact in decimal.
    fn arc(&mut self, motion: &mut &'static str) {
        let r = MM / 10 + self.random.below(MM as u64) as i64;
        let i = if self.x + 2 * r > SIDE { -r } else { r };
        let up = self.y + r <= SIDE;
        let clockwise = (i > 0) == up;
        *motion = "";
        self.out.push_str(if clockwise { "G2 " } else { "G3 " });
        self.x += i;
        self.y += if up { r } else { -r };
        self.point();
        number(&mut self.out, " I", i);
        self.out.push_str(" J0");
    }
}

fn reflect(v: i64) -> i64 {
    if v < 0 {
        -v
    } else if v > SIDE {
        2 * SIDE - v
    } else {
        v
    }
}

fn number(out: &mut String, letter: &str, v: i64) {
    let sign = if v < 0 { "-" } else { "" };
    let v = v.unsigned_abs();
    let _ = write!(out, "{letter}{sign}{}.{:04}", v / MM as u64, v % MM as u64);
}

#[cfg(test)]
mod tests {
    use super::{big, mixed};

    #[test]
    fn line_counts_and_repeatability() {
        for make in [big, mixed] {
            let text = make(1000);
            assert_eq!(text.lines().count(), 1000);
            assert_eq!(text, make(1000));
            assert!(text.ends_with("M5\nM2\n"));
        }
    }
}
