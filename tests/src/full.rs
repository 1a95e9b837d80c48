//! The second oracle: what LinuxCNC makes of a program in full double precision (`tests/oracle/canon_full.py`), as
//! moves in machine coordinates, so that two programs can be compared as motion.

use std::path::Path;
use std::process::Command;

use crate::oracle::{LIMIT, missing, root};
use crate::process::run;

/// One move, millimeters and degrees, machine coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Move {
    /// `rapid`, `feed`, `arc`, `probe`, `tap`.
    pub kind: String,
    /// End point X Y Z A B C.
    pub end: [f64; 6],
    /// Center in the plane, turns, plane.
    pub arc: Option<([f64; 3], i64, i64)>,
    /// Source line.
    pub line: i64,
}

/// Frame in force.
#[derive(Default)]
struct Frame {
    origin: [f64; 9],
    shift: [f64; 9],
    length: [f64; 9],
    rotation: f64,
    plane: i64,
}

impl Frame {
    fn machine(&self, p: [f64; 6]) -> [f64; 6] {
        let mut q = p;
        for i in 0..6 {
            q[i] += self.shift[i];
        }
        let (s, c) = self.rotation.to_radians().sin_cos();
        let (x, y) = (q[0], q[1]);
        q[0] = x * c - y * s;
        q[1] = x * s + y * c;
        for i in 0..6 {
            q[i] += self.origin[i] + self.length[i];
        }
        q
    }
}

/// The path of a program: moves, and whether the controller accepted it to its end.
pub struct Path9 {
    /// Moves that move something.
    pub moves: Vec<Move>,
    /// Message of the end; `ok`.
    pub end: String,
}

/// Runs a program; none when the module is missing (see [`missing`]).
pub fn path(program: &Path, tools_mm: Option<&Path>) -> Option<Path9> {
    let home = tempfile::tempdir().ok()?;
    let mut command = Command::new("/usr/bin/python3");
    command.arg(root().join("tests/oracle/canon_full.py")).arg(program).env("HOME", home.path()).env("LC_ALL", "C");
    if let Some(tools) = tools_mm {
        command.arg(tools);
    }
    let Ok(out) = run(&mut command, LIMIT) else {
        missing("/usr/bin/python3 (Debian package python3)");
        return None;
    };
    if out.errors().contains("No module named 'gcode'") {
        missing("Python module gcode (Debian package linuxcnc-uspace)");
        return None;
    }
    Some(parse(&out.output()))
}

fn parse(text: &str) -> Path9 {
    let mut frame = Frame { plane: 1, ..Frame::default() };
    let mut moves: Vec<Move> = Vec::new();
    let mut at: Option<[f64; 6]> = None;
    let mut end = String::from("no end");
    for text in text.lines() {
        let mut words = text.split(' ');
        let (first, name) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        if first == "end" {
            end = words.skip(1).collect::<Vec<_>>().join(" ");
            continue;
        }
        let n: Vec<f64> = words.map(|w| w.trim_matches('\'').parse().unwrap_or(f64::NAN)).collect();
        let nine = || std::array::from_fn::<f64, 9, _>(|i| n.get(i).copied().unwrap_or(0.0));
        let line = first.parse().unwrap_or(0);
        match name {
            "origin" => frame.origin = nine(),
            "shift" => frame.shift = nine(),
            "length" => frame.length = nine(),
            "rotation" => frame.rotation = n.first().copied().unwrap_or(0.0),
            "plane" => frame.plane = n.first().copied().unwrap_or(1.0) as i64,
            "rapid" | "feed" | "probe" | "tap" => {
                let p = nine();
                let mut q = [p[0], p[1], p[2], p[3], p[4], p[5]];
                if name == "tap" {
                    q[3] = 0.0;
                }
                let q = frame.machine(q);
                let moved = at.is_none_or(|a| a.iter().zip(&q).any(|(a, b)| (a - b).abs() > 1e-9));
                if moved || name == "tap" {
                    moves.push(Move { kind: name.into(), end: q, arc: None, line });
                }
                at = Some(q);
            }
            "arc" if n.len() >= 9 => {
                // (first, second; third) axes by plane: XY, YZ, ZX.
                let [a, b, c] = match frame.plane {
                    2 => [1, 2, 0],
                    3 => [2, 0, 1],
                    _ => [0, 1, 2],
                };
                let (mut to, mut center) = ([0.0; 6], [0.0; 6]);
                (to[a], to[b], to[c]) = (n[0], n[1], n[5]);
                (to[3], to[4], to[5]) = (n[6], n[7], n[8]);
                (center[a], center[b], center[c]) = (n[2], n[3], n[5]);
                let (q, m) = (frame.machine(to), frame.machine(center));
                moves.push(Move { kind: "arc".into(), end: q, arc: Some(([m[0], m[1], m[2]], n[4] as i64, frame.plane)), line });
                at = Some(q);
            }
            _ => {}
        }
    }
    Path9 { moves, end }
}

/// Greatest distance between two paths move by move, or what makes them incomparable.
pub fn distance(a: &[Move], b: &[Move]) -> Result<f64, String> {
    let mut most: f64 = 0.0;
    for i in 0..a.len().max(b.len()) {
        let (Some(x), Some(y)) = (a.get(i), b.get(i)) else {
            return Err(format!("{} moves against {}; first extra {:?}", a.len(), b.len(), a.get(i).or(b.get(i))));
        };
        let turns = |m: &Move| m.arc.map(|(_, turns, plane)| (turns, plane));
        if x.kind != y.kind || turns(x) != turns(y) {
            return Err(format!("move {i}: {x:?} against {y:?}"));
        }
        let mut far = x.end.iter().zip(&y.end).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
        if let (Some((p, ..)), Some((q, ..))) = (x.arc, y.arc) {
            far = p.iter().zip(&q).map(|(p, q)| (p - q).abs()).fold(far, f64::max);
        }
        if far > 0.1 {
            return Err(format!("move {i} is {far} mm away: {x:?} against {y:?}"));
        }
        most = most.max(far);
    }
    Ok(most)
}
