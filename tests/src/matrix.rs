//! Each code under every plane, unit, distance mode and compensation: one short program per combination. Where a
//! combination is not allowed the program is still worth running: both interpreters must refuse it, with the same
//! words.

use crate::programs::{Modes, Pen};

type Body = fn(&mut Pen);

fn cycle(pen: &mut Pen, code: &str, more: &str) {
    let [x, y, z] = pen.letters();
    let (p, q) = (pen.len(10.0), pen.len(7.5));
    let (r, depth) = if pen.modes.incremental { (pen.len(-3.0), pen.len(-8.0)) } else { (pen.len(2.0), pen.len(-6.0)) };
    pen.line(&format!("{code} {x}{p} {y}{q} {z}{depth} R{r}{more}"));
    pen.line(&format!("{x}{q} {y}{p}"));
    pen.line(&format!("{x}{p} L2"));
    pen.line("G80");
}

fn peck(pen: &mut Pen, code: &str) {
    let q = format!(" Q{}", pen.len(2.5));
    cycle(pen, code, &q);
}

/// Name and body of each program.
const BODIES: &[(&str, Body)] = &[
    ("G0", |p| {
        p.go("G0", 10.0, 5.0);
        p.go("", -3.0, 12.5);
        p.lift("G0", 3.0);
    }),
    ("G1", |p| {
        p.go("G1", 20.0, 5.0);
        p.go("", 15.0, 17.5);
        p.go("", -30.0, 22.5);
        p.lift("G1", -3.0);
        p.go("", 5.0, 20.0);
    }),
    ("G1-concave", |p| {
        p.go("G1", 30.0, 0.0);
        p.go("G1", 0.0, 30.0);
        p.go("G1", -30.0, 0.0);
        p.go("G1", 0.0, 40.0);
        p.go("G1", 30.0, 0.0);
    }),
    ("G2-center", |p| {
        p.arc("G2", 20.0, 0.0, None, [10.0, 0.0], "");
        p.arc("G2", 15.0, -15.0, None, [0.0, -15.0], "");
    }),
    ("G3-center", |p| {
        p.arc("G3", 20.0, 0.0, None, [10.0, 0.0], "");
        p.arc("G3", 15.0, 15.0, None, [0.0, 15.0], "");
    }),
    ("G2-radius", |p| {
        let r = p.len(20.0);
        let w = p.by([Some(20.0), Some(-20.0), None]);
        p.line(&format!("G2{w} R{r}"));
        let w = p.by([Some(-20.0), Some(-20.0), None]);
        p.line(&format!("G2{w} R-{r}"));
    }),
    ("G3-radius", |p| {
        let r = p.len(20.0);
        let w = p.by([Some(20.0), Some(20.0), None]);
        p.line(&format!("G3{w} R{r}"));
        let w = p.by([Some(-20.0), Some(20.0), None]);
        p.line(&format!("G3{w} R-{r}"));
    }),
    ("G2-full", |p| {
        let [i, _] = p.center_letters();
        let r = p.len(12.0);
        p.line(&format!("G2 {i}{r}"));
    }),
    ("G3-helix", |p| {
        p.arc("G3", 0.0, 20.0, Some(-4.0), [0.0, 10.0], "");
        p.arc("G3", 0.0, 20.0, Some(-4.0), [0.0, 10.0], " P3");
    }),
    ("G2-absolute-center", |p| {
        p.line("G90.1");
        let [x, y, _] = p.letters();
        let [i, j] = p.center_letters();
        let (e, c, o) = (p.len(40.0), p.len(30.0), p.len(0.0));
        if p.modes.comp == 40 {
            p.line("G90");
            p.go("G1", 20.0, 0.0);
            let s = p.len(20.0);
            p.line(&format!("G1 {x}{s} {y}{o}"));
        } else {
            p.line("G90");
        }
        p.line(&format!("G2 {x}{e} {y}{o} {i}{c} {j}{o}"));
        p.line("G91.1");
    }),
    ("G4", |p| {
        p.line("G4 P0.25");
        p.go("G1", 10.0, 0.0);
        p.line("G4 P1");
        p.go("G1", 10.0, 10.0);
    }),
    ("G5", |p| {
        let (i, j, q) = (p.len(2.0), p.len(6.0), p.len(-6.0));
        let w = p.by([Some(20.0), Some(0.0), None]);
        p.line(&format!("G5{w} I{i} J{j} P{q} Q{j}"));
        let w = p.by([Some(20.0), Some(5.0), None]);
        p.line(&format!("G5{w} P{q} Q{i}"));
    }),
    ("G5.1", |p| {
        let (i, j) = (p.len(5.0), p.len(6.0));
        let w = p.by([Some(20.0), Some(0.0), None]);
        p.line(&format!("G5.1{w} I{i} J{j}"));
        let w = p.by([Some(10.0), Some(5.0), None]);
        p.line(&format!("G5.1{w} I{i} J{j}"));
    }),
    ("G5.2", |p| {
        let w = p.by([Some(0.0), Some(10.0), None]);
        p.line(&format!("G5.2{w} P1 L3"));
        for (dx, dy) in [(10.0, 10.0), (10.0, -5.0), (10.0, 5.0)] {
            let w = p.by([Some(dx), Some(dy), None]);
            p.line(&format!("{} P2", w.trim_start()));
        }
        p.line("G5.3");
    }),
    ("G7", |p| {
        p.line("G7");
        p.go("G1", 10.0, 4.0);
        p.line("G8");
        p.go("G1", 10.0, 4.0);
    }),
    ("G10-L1", |p| {
        let (z, r) = (p.len(40.0), p.len(2.5));
        p.line(&format!("G10 L1 P2 Z{z} R{r}"));
        p.line("G10 L1 P5 I95 J155 Q3");
        p.line("G43 H2");
        p.go("G1", 10.0, 0.0);
    }),
    ("G10-L2", |p| {
        let (x, y) = (p.len(10.0), p.len(-20.0));
        p.line(&format!("G10 L2 P2 X{x} Y{y} R15"));
        p.line("G55");
        p.go("G1", 10.0, 0.0);
        p.line(&format!("G10 L2 P0 X{y} Z{x} R0"));
        p.go("G1", 10.0, 10.0);
        p.line("G54");
    }),
    ("G10-L10", |p| {
        let z = p.len(12.0);
        p.line(&format!("G10 L10 P2 Z{z}"));
        p.line("G43 H2");
        p.go("G1", 10.0, 0.0);
    }),
    ("G10-L11", |p| {
        let z = p.len(12.0);
        p.line(&format!("G10 L11 P3 Z{z} X{z}"));
        p.line("G43 H3");
        p.go("G1", 10.0, 0.0);
    }),
    ("G10-L20", |p| {
        let (x, y) = (p.len(10.0), p.len(-20.0));
        p.line(&format!("G10 L20 P1 X{x} Y{y} Z0"));
        p.go("G1", 10.0, 0.0);
        p.line(&format!("G10 L20 P3 X{y}"));
        p.line("G56");
        p.go("G1", 1.0, 1.0);
    }),
    ("G17", |p| {
        p.line("G17");
        p.line("G18");
        p.line("G19");
        p.line("G17");
    }),
    ("G17.1", |p| {
        p.line("G17.1");
        p.line("G18.1");
        p.line("G19.1");
    }),
    ("G20-G21", |p| {
        p.line("G20");
        p.line("G1 X1 Y0.5");
        p.line("G21");
        p.line("G1 X10 Y5");
    }),
    ("G28", |p| {
        p.line("G28.1");
        p.go("G0", 10.0, 10.0);
        p.line("G28");
        let w = p.by([Some(5.0), Some(5.0), None]);
        p.line(&format!("G28{w}"));
    }),
    ("G30", |p| {
        p.line("G30.1");
        p.go("G0", 10.0, 10.0);
        p.line("G30");
        let w = p.by([None, Some(5.0), Some(2.0)]);
        p.line(&format!("G30{w}"));
    }),
    ("G33", |p| {
        let k = p.len(1.5);
        let w = p.by([Some(20.0), None, None]);
        p.line(&format!("G33{w} K{k}"));
        let w = p.by([Some(2.0), Some(3.0), None]);
        p.line(&format!("{} K{k}", w.trim_start()));
    }),
    ("G33.1", |p| {
        let k = p.len(1.25);
        let w = p.by([None, None, Some(-10.0)]);
        p.line(&format!("G33.1{w} K{k}"));
        let w = p.by([None, None, Some(-2.0)]);
        p.line(&format!("G33.1{w} K{k} I1.5"));
    }),
    ("G38.2", |p| p.lift("G38.2", -10.0)),
    ("G38.3", |p| p.lift("G38.3", -10.0)),
    ("G38.4", |p| p.lift("G38.4", 10.0)),
    ("G38.5", |p| {
        p.lift("G38.5", 10.0);
        p.line("(debug, #5061 #5062 #5063 #5070)");
    }),
    ("G43", |p| {
        p.line("G43 H2");
        p.go("G1", 10.0, 0.0);
        p.line("G43 H7");
        p.go("G1", 10.0, 0.0);
        p.line("G49");
        p.go("G1", 10.0, 0.0);
    }),
    ("G43.1", |p| {
        let (x, z) = (p.len(0.5), p.len(1.5));
        p.line(&format!("G43.1 X{x} Z{z} A5"));
        p.go("G1", 10.0, 0.0);
    }),
    ("G43.2", |p| {
        p.line("G43.2 H2");
        p.go("G1", 10.0, 0.0);
    }),
    ("G52", |p| {
        let (x, z) = (p.len(5.0), p.len(1.5));
        p.line(&format!("G52 X{x} Z{z}"));
        p.go("G1", 10.0, 0.0);
        p.line("G52 X0 Y0 Z0");
        p.go("G1", 10.0, 0.0);
    }),
    ("G53", |p| {
        let (x, y) = (p.len(5.0), p.len(1.5));
        p.line(&format!("G53 G0 X{x} Y{y}"));
        p.line(&format!("G53 G1 X{y} Z{x}"));
    }),
    ("G54", |p| {
        for (i, c) in ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"].iter().enumerate() {
            p.line(&format!("G10 L2 P{} X{} Y{}", i + 1, i, 2 * i));
            p.line(c);
            p.go("G1", 10.0, 1.0);
        }
        p.line("G54");
    }),
    ("G61", |p| {
        p.line("G61");
        p.go("G1", 10.0, 0.0);
        p.line("G61.1");
        p.go("G1", 10.0, 10.0);
        let t = p.len(0.05);
        p.line("G64");
        p.go("G1", 10.0, 0.0);
        p.line(&format!("G64 P{t}"));
        p.go("G1", 10.0, 10.0);
        p.line(&format!("G64 P{t} Q{t}"));
        p.go("G1", 10.0, 0.0);
    }),
    ("G73", |p| peck(p, "G73")),
    ("G74", |p| {
        p.line("M4");
        cycle(p, "G74", " P0.5");
    }),
    ("G74-plain", |p| {
        p.line("M4");
        let [x, _, z] = p.letters();
        let (r, depth) = if p.modes.incremental { (p.len(-3.0), p.len(-8.0)) } else { (p.len(2.0), p.len(-6.0)) };
        let q = p.len(7.5);
        p.line(&format!("G74 {x}{q} {z}{depth} R{r}"));
        p.line("G80");
    }),
    ("G81", |p| cycle(p, "G81", "")),
    ("G81-G99", |p| cycle(p, "G99 G81", "")),
    ("G82", |p| cycle(p, "G82", " P0.5")),
    ("G83", |p| peck(p, "G83")),
    ("G83-G99", |p| peck(p, "G99 G83")),
    ("G84", |p| cycle(p, "G84", " P0.5")),
    ("G85", |p| cycle(p, "G85", "")),
    ("G86", |p| cycle(p, "G86", " P0.5")),
    ("G87", |p| cycle(p, "G87", " I1 J1 K1")),
    ("G88", |p| cycle(p, "G88", " P0.5")),
    ("G89", |p| cycle(p, "G89", " P0.5")),
    ("G76", |p| {
        let (pitch, i, j, k, z) = (p.len(1.5), p.len(-1.0), p.len(0.2), p.len(1.0), p.len(-20.0));
        p.line(&format!("G76 P{pitch} Z{z} I{i} J{j} K{k} Q29.5 R1.5 H2"));
        let e = p.len(2.0);
        p.line(&format!("G76 P{pitch} Z{z} I{i} J{j} K{k} L3 E{e}"));
    }),
    ("G92", |p| {
        let (x, y) = (p.len(5.0), p.len(1.5));
        p.line(&format!("G92 X{x} Y{y} Z0"));
        p.go("G1", 10.0, 1.0);
        p.line("G92.2");
        p.go("G1", 10.0, 1.0);
        p.line("G92.3");
        p.go("G1", 10.0, 1.0);
        p.line("G92.1");
        p.go("G1", 10.0, 1.0);
    }),
    ("G93", |p| {
        p.line("G93");
        let w = p.by([Some(10.0), Some(10.0), None]);
        p.line(&format!("G1{w} F2"));
        let w = p.by([Some(10.0), Some(0.0), None]);
        p.line(&format!("G1{w} F4"));
        let f = p.len(300.0);
        p.line(&format!("G94 F{f}"));
        p.go("G1", 10.0, 0.0);
    }),
    ("G95", |p| {
        let f = p.len(0.2);
        p.line(&format!("G95 F{f}"));
        p.go("G1", 10.0, 1.0);
        p.line("G94 F100");
        p.go("G1", 10.0, 1.0);
    }),
    ("G96", |p| {
        p.line("G96 D2000 S150");
        p.go("G1", 10.0, 1.0);
        p.line("G96 S100");
        p.line("G97 S1000");
        p.go("G1", 10.0, 1.0);
    }),
    ("rotary", |p| {
        let w = p.by([Some(10.0), None, None]);
        p.line(&format!("G1{w} A30 B-15 C45"));
        p.line("G1 A90");
    }),
    ("polar", |p| {
        let r = p.len(20.0);
        p.line(&format!("G1 @{r} ^30"));
        p.line("G1 ^60");
        let r = p.len(25.0);
        p.line(&format!("G1 @{r}"));
    }),
    ("M-spindle", |p| {
        p.line("M4 S900");
        p.go("G1", 10.0, 1.0);
        p.line("M5");
        p.line("M3 $0");
        p.line("M19 R90 P1 Q2");
        p.line("M3 S500");
        p.go("G1", 10.0, 1.0);
    }),
    ("M-coolant", |p| {
        p.line("M7");
        p.line("M8");
        p.go("G1", 10.0, 1.0);
        p.line("M9");
    }),
    ("M-overrides", |p| {
        for m in ["M48", "M49", "M50 P0", "M50 P1", "M50", "M51 P0", "M51 P1", "M51", "M52 P1", "M52 P0", "M53 P1", "M53 P0", "M48"] {
            p.line(m);
        }
        p.go("G1", 10.0, 1.0);
    }),
    ("M-io", |p| {
        p.line("M62 P1");
        p.line("M64 P2");
        p.go("G1", 10.0, 1.0);
        p.line("M63 P1");
        p.line("M65 P2");
        p.line("M67 E1 Q0.5");
        p.go("G1", 10.0, 1.0);
        p.line("M68 E2 Q1.5");
        p.line("M66 P0 L0");
        p.line("(debug, #5399)");
    }),
    ("M66-wait", |p| {
        p.line("M66 P1 L3 Q2");
        p.line("M66 E1 L0");
        p.go("G1", 10.0, 1.0);
    }),
    ("M-stops", |p| {
        p.line("M0");
        p.go("G1", 10.0, 1.0);
        p.line("M1");
        p.line("M60");
    }),
    ("M-tools", |p| {
        p.line("T2");
        p.line("M6");
        p.line("G43");
        p.go("G1", 10.0, 1.0);
        p.line("M61 Q3");
        p.line("T20 M6 G43");
        p.line("(debug, #5400 #5401 #5403 #5410)");
        p.go("G1", 10.0, 1.0);
    }),
    ("M70-M73", |p| {
        p.line("M70");
        p.line("G20 G91 G61 F50 S300");
        p.line("G1 X0.5");
        p.line("M72");
        p.go("G1", 10.0, 1.0);
        p.line("M70");
        p.line("M71");
    }),
    ("M30", |p| p.line("M30")),
    ("M98", |p| {
        p.line("M98 P100 L2");
        p.line("M2");
        p.line("O100");
        p.go("G1", 10.0, 1.0);
        p.line("M99");
    }),
    ("O-words", |p| {
        p.line("#1=0");
        p.line("o1 while [#1 LT 3]");
        p.go("G1", 2.0, 1.0);
        p.line("#1=[#1+1]");
        p.line("o1 endwhile");
        p.line("o2 repeat [2]");
        p.line("G91 G1 X1");
        p.line("o2 endrepeat");
        p.line("G90");
        p.line("o3 if [#1 EQ 3]");
        p.go("G1", 2.0, 1.0);
        p.line("o3 else");
        p.line("M0");
        p.line("o3 endif");
    }),
    ("parameters", |p| {
        p.line("#1=5 #2=[#1*2]");
        p.line("#<depth>=[2**3 - ATAN[1]/[1]/15]");
        p.line("G1 X[#1+1] Y#<depth>");
        p.line("(debug, #<_x> #<_y> #<_plane> #<_metric> #<_feed> #<_ccomp> #<_absolute> #5420)");
        p.line("(print, %.3f #<_rpm>)");
    }),
];

/// Name and text of every program of the matrix.
pub fn programs() -> Vec<(String, String)> {
    let mut out = Vec::new();
    for modes in Modes::all() {
        for (name, body) in BODIES {
            let mut pen = Pen::new(modes);
            pen.compensate();
            body(&mut pen);
            out.push((format!("{name}-{}", modes.name()), pen.end()));
        }
    }
    out
}
