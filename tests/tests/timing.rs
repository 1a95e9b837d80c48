//! Predicted times beside the real controller's: it runs the programs on a simulated machine and its servo cycles are
//! counted, so that the load of the computer does not matter.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::process::Command;
use std::time::Duration;

use gr_tests::controller::Controller;
use gr_tests::oracle::{gcc_robot, root, score};
use gr_tests::process::run;

/// Lines, arcs, exact stop: within 1 % or five cycles.
const PLAIN: &[(&str, &str)] = &[
    ("line-g61", "G61\nG1 X60 F3000"),
    ("line-g64", "G64 P0.01\nG1 X60 F3000"),
    ("line-diagonal", "G61\nG1 X40 Y30 Z-12 F6000"),
    ("line-short", "G61\nG1 X3 Y1 F6000"),
    ("lines-g61.1", "G61.1\nG1 X20 F3000\nG1 Y20\nG1 X19\nG1 X18.5\nG1 X0 Y0\nG1 Z-7"),
    ("lines-g61", "G61\nG1 X30 F3000\nG1 Y30\nG1 X0\nG1 Y0"),
    ("slow", "G61\nG1 X4 F100\nG1 Y3"),
    ("circle-g61", "G61\nG2 X0 Y0 I10 J0 F3000"),
    ("circle-g64", "G64\nG2 X0 Y0 I10 J0 F3000"),
    ("circle-fast", "G61\nG2 X0 Y0 I2 J0 F6000"),
    ("arc-xz", "G61 G18\nG3 X20 Z0 I10 K0 F2500"),
    ("helix", "G61\nG2 X0 Y0 Z-9 I8 J0 P3 F3000"),
    ("arcs-g61", "G61\nG2 X10 Y10 I10 J0 F3000\nG3 X20 Y20 I0 J10\nG1 X40"),
    ("rapids-g61", "G61\nG0 X50 Y20\nG0 Z-20\nG0 X0 Y0\nG0 Z0"),
    ("rapid-and-feed", "G61\nG0 X20\nG1 Y20 F2400\nG0 X0\nG1 Y0\nG0 Z-5\nG1 Z0 F600"),
    ("dwell-free", "G61.1\nG1 X10 F1200\nG2 X20 Y10 I0 J10\nG1 Y20\nG3 X10 Y30 I-10 J0\nG0 X0 Y0"),
];

/// Blended corners and trains of short segments: within 3 %.
const BLENDED: &[(&str, &str)] = &[
    ("corner-g64", "G64\nG1 X40 F3000\nG1 Y40"),
    ("corner-p0.01", "G64 P0.01\nG1 X40 F3000\nG1 Y40"),
    ("corner-p0.1", "G64 P0.1\nG1 X40 F3000\nG1 Y40"),
    ("corner-p1", "G64 P1\nG1 X40 F3000\nG1 Y40"),
    ("corner-45", "G64 P0.2\nG1 X30 F3000\nG1 X50 Y20\nG1 X80"),
    ("corner-135", "G64 P0.2\nG1 X30 F3000\nG1 X10 Y20\nG1 X40"),
    ("zigzag", "G64 P0.1\nG1 X10 Y5 F3000\nX20 Y0\nX30 Y5\nX40 Y0\nX50 Y5\nX60 Y0\nX70 Y5\nX80 Y0"),
    ("back", "G64 P0.1\nG1 X30 F3000\nX0\nY20\nY0"),
    ("slot", "G64 P0.05\nG1 X30 F3000\nG3 X30 Y12 I0 J6\nG1 X0\nG3 X0 Y0 I0 J-6"),
    ("line-arc", "G64 P0.2\nG1 X20 F3000\nG2 X30 Y10 I10 J0\nG1 X50"),
    ("line-arc-out", "G64 P0.2\nG1 X20 F3000\nG3 X20 Y20 I-4 J10\nG1 X0"),
    ("arc-arc", "G64 P0.1\nG2 X12 Y0 I6 J0 F3000\nG2 X24 Y0 I6 J0\nG2 X36 Y0 I6 J0"),
    ("trochoid", "G64 P0.01\nG1 Y-3 F3000\nX0.8\nG3 X0.8 Y3 I0 J3\nG3 X0.8 Y-3 I0 J-3 Z-0.05\nG1 X1.6\nG3 X1.6 Y3 I0 J3\nG3 X1.6 Y-3 I0 J-3\nG1 X2.4"),
    ("helices", "G64 P0.02\nG1 Y10 F2000\nG3 X-10 Y20 I-10 J0 Z-4\nG2 X-20 Y10 I0 J-10 Z-8\nG1 X-30"),
    ("rapids-g64", "G64 P0.1\nG0 X40\nG0 Y30\nG0 X0 Y0 Z-10"),
    ("rapids-free", "G64\nG0 X40\nG0 Y30\nG0 Z-10"),
    ("pocket", "G64 P0.02\nG1 Z-2 F600\nG1 X30 F2400\nY20\nX0\nY4\nX26\nY16\nX4\nY8\nX22\nY12\nX8\nG0 Z5"),
];

/// Splines, which the controller drives as pairs of arcs: within 1 %.
const SPLINES: &[(&str, &str)] = &[
    ("g5-g64", "G64 P0.01\nF1800\nG5 I0 J15 P0 Q-15 X20 Y10\nG5 P0 Q-15 X40 Y0\nG5 P3 Q3 X70 Y20"),
    ("g5-g61", "G61\nF1800\nG5 I0 J15 P0 Q-15 X20 Y10\nG1 X0 Y0"),
    ("g5-g61.1", "G61.1\nF1800\nG5 I0 J15 P0 Q-15 X20 Y10\nG5.1 X60 Y10 I10 J15"),
    ("g5-cusp", "G64 P0.02\nF3000\nG5 I40 J30 P40 Q30 X1 Y0\nG5 I0 J-5 P-40 Q0 X30 Y0"),
    ("g5-flat", "G64 P0.02\nF5000\nG5 I30 J1 P-30 Q0.5 X90 Y3\nG5 I30 J1 P-30 Q0.5 X0 Y0"),
    ("g5-straight", "G64 P0.02\nF3000\nG5 I10 J0 P-10 Q0 X40 Y0\nG1 Y10"),
    ("g5-inch", "G20 G64 P0.001\nF90\nG5 I0 J0.6 P0 Q-0.6 X0.8 Y0.4\nG5 P0 Q-0.6 X1.6 Y0\nG1 X0\nG21"),
    ("g5-turned", "G64 P0.05\nG10 L2 P1 R30\nF4000\nG5 I0 J15 P0 Q-15 X20 Y10\nG5 P0 Q-15 X40 Y0\nG10 L2 P1 R0"),
    ("g5.1", "G64 P0.01\nF1800\nG5.1 X60 Y10 I10 J15\nG5.1 X80 Y0 I10 J-10"),
    ("g5.2", "G64 P0.01\nF1800\nG5.2 P1 X0 Y0 L3\nX10 Y20 P1\nX30 Y20 P1\nX40 Y0 P1\nX60 Y10 P1\nG5.3"),
    ("g5.2-weights", "G64\nF3000\nG5.2 P1 X0 Y0 L4\nX10 Y20 P2\nX30 Y20 P0.5\nX40 Y0 P1\nX60 Y10 P3\nX80 Y40 P1\nX90 Y0 P1\nG5.3\nG1 X0"),
];

/// Programs that are many points.
fn trains() -> Vec<(String, String)> {
    let mut out = Vec::new();
    for (name, mode) in [("g64", "G64"), ("p0.01", "G64 P0.01"), ("q0.001", "G64 P0.01 Q0.001"), ("g61", "G61")] {
        let mut circle = format!("{mode}\nF3000\n");
        let count = if name == "g61" { 40 } else { 360 };
        for i in 1..=count {
            let a = f64::from(i).to_radians();
            let _ = writeln!(circle, "G1 X{:.5} Y{:.5}", 10.0 - 10.0 * a.cos(), 10.0 * a.sin());
        }
        out.push((format!("circle-of-chords-{name}"), circle));
    }
    for (name, mode) in [("g64", "G64"), ("p0.01", "G64 P0.01"), ("p0.01-q0", "G64 P0.01 Q0.00001")] {
        let straight: String = (1..=300).map(|i| format!("G1 X{:.3}\n", f64::from(i) * 0.1)).collect();
        out.push((format!("tenths-{name}"), format!("{mode}\nF3000\n{straight}")));
        let mut wave = format!("{mode}\nF2400\n");
        for i in 1..=160 {
            let x = f64::from(i) * 0.4;
            let _ = writeln!(wave, "G1 X{x:.3} Y{:.4} Z{:.4}", 6.0 * (x * 0.25).sin(), 0.5 * (x * 0.4).cos() - 0.5);
        }
        out.push((format!("wave-{name}"), wave));
    }
    let mut feeds = "G64 P0.02\n".to_string();
    for i in 1..=120u32 {
        let (y, feed) = (f64::from(i * i * 7 % 11) * 0.01, [300, 3000, 800, 1500][(i * i * 5 % 13 % 4) as usize]);
        let _ = writeln!(feeds, "G1 X{:.1} Y{y:.2} F{feed}", f64::from(i) * 0.5);
    }
    out.push(("feeds".into(), feeds));
    // A walk with turns of all angles and steps of all lengths, by a small linear generator.
    let (mut seed, mut at, mut walk) = (274u64, [0.0f64; 2], "G64 P0.03\nF2400\n".to_string());
    let mut next = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / f64::from(1u32 << 31)
    };
    let mut heading = 0.0f64;
    for _ in 0..80 {
        heading += (next() - 0.5) * 4.0;
        let step = 0.3 + 6.0 * next() * next();
        at = [at[0] + step * heading.cos(), at[1] + step * heading.sin()];
        let _ = writeln!(walk, "G1 X{:.3} Y{:.3}", at[0], at[1]);
    }
    out.push(("walk".into(), walk));
    out
}

/// Axes of different speed and acceleration, so that each counts.
fn limits(ini: &str) -> String {
    let mut section = String::new();
    let mut out = String::new();
    for line in ini.lines() {
        if line.starts_with('[') {
            section = line.to_string();
        }
        let axis = ["_X]", "_Y]", "_Z]"].iter().zip(["_0]", "_1]", "_2]"]).position(|(a, j)| section.ends_with(a) || section.ends_with(j));
        let value = |values: [u32; 3]| axis.map(|i| values[i]);
        let new = match line.split(" =").next() {
            Some(key @ "MAX_VELOCITY") => value([100, 80, 60]).map(|v| format!("{key} = {v}")),
            Some(key @ "MAX_ACCELERATION") => value([500, 600, 400]).map(|v| format!("{key} = {v}")),
            Some(key @ "MAX_LINEAR_VELOCITY") => Some(format!("{key} = 110")),
            _ => None,
        };
        out += &new.unwrap_or_else(|| line.to_string());
        out.push('\n');
    }
    out
}

fn predicted(machine: &Controller, name: &str) -> f64 {
    let mut command = Command::new(gcc_robot());
    let program = machine.path(&format!("programs/{name}.ngc"));
    command.args(["build", "-q", "--target", "csv", "-o", "-", "--ini"]).arg(machine.path("machine.ini")).arg(&program);
    let out = run(&mut command, Duration::from_secs(60)).expect("runs");
    assert_eq!(out.status, Some(0), "{name}: {}", out.errors());
    let text = out.output();
    let row = text.lines().last().expect("a move");
    row.split(',').nth(13).and_then(|t| t.parse().ok()).expect("a time")
}

#[test]
fn times_are_those_of_the_controller() {
    let part = root().join("tests/linuxcnc/quick.p21");
    let Some(machine) = Controller::new("@FOLDER@/times.py", &part, "part.ngc") else { return };
    let own = |list: &[(&str, &str)]| list.iter().map(|(n, t)| ((*n).to_string(), (*t).to_string())).collect::<Vec<_>>();
    let (mut plain, mut blended) = (own(PLAIN), own(BLENDED));
    plain.extend(own(SPLINES));
    blended.extend(trains());
    std::fs::create_dir(machine.path("programs")).expect("writable");
    for (name, text) in plain.iter().chain(&blended) {
        let text = format!("G21 G90 G17 G94\n{text}\nM2\n");
        std::fs::write(machine.path(&format!("programs/{name}.ngc")), text).expect("writable");
    }
    let ini = std::fs::read_to_string(machine.path("machine.ini")).expect("furnished");
    std::fs::write(machine.path("machine.ini"), limits(&ini)).expect("writable");
    std::fs::write(machine.path("tool.tbl"), "").expect("writable");
    let limits: Vec<(&String, f64)> = plain.iter().map(|p| (&p.0, 0.01)).chain(blended.iter().map(|p| (&p.0, 0.03))).collect();
    let ours: BTreeMap<&str, f64> = limits.iter().map(|(n, _)| (n.as_str(), predicted(&machine, n))).collect();
    let mut real: BTreeMap<String, f64> = BTreeMap::new();
    for _ in 0..ROUNDS {
        for (name, seconds) in measure(&machine) {
            let least = real.entry(name).or_insert(seconds);
            *least = least.min(seconds);
        }
        for (name, share) in &limits {
            if fits(real[*name], ours[name.as_str()], *share) {
                let _ = std::fs::remove_file(machine.path(&format!("programs/{name}.ngc")));
            }
        }
        if std::fs::read_dir(machine.path("programs")).is_ok_and(|mut d| d.next().is_none()) {
            break;
        }
    }
    let (mut table, mut bad) = (String::from("program, LinuxCNC s, predicted s, difference %\n"), Vec::new());
    for (name, share) in limits {
        let (real, ours) = (real[name], ours[name.as_str()]);
        let _ = writeln!(table, "{name}, {real:.3}, {ours:.3}, {:+.2}", 100.0 * (ours - real) / real);
        if !fits(real, ours, share) {
            bad.push(name);
        }
    }
    score("timing", &table);
    assert!(bad.is_empty(), "{bad:?}\n{table}");
}

/// A computer with much else to do feeds the controller its blocks too late, and the controller slows down. It never
/// gets faster by that: the shortest time counts.
const ROUNDS: usize = 4;

fn fits(real: f64, ours: f64, share: f64) -> bool {
    (ours - real).abs() <= (share * real).max(0.005)
}

/// Runs what is in the folder: name and seconds.
fn measure(machine: &Controller) -> Vec<(String, f64)> {
    machine.give();
    let ended = machine.run(Duration::from_secs(400));
    let log = ended.output();
    assert!(ended.status == Some(0) && log.lines().any(|l| l == "done"), "{}: {log}\n{}", ended.how(), ended.errors());
    let text = std::fs::read_to_string(machine.path("times.txt")).expect("written");
    let row = |l: &str| l.split_once(' ').and_then(|(n, c)| Some((n.to_string(), c.parse::<f64>().ok()? / 1000.0)));
    text.lines().filter_map(row).collect()
}
