//! STEP-NC on the real controller: written programs through `rs274` and through LinuxCNC's interpreter in full
//! precision, one on the simulated machine to its end, and one in AXIS behind the filter, on a screen that is looked at.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use gr_tests::controller::{Controller, Picture, Screen};
use gr_tests::full;
use gr_tests::oracle::{Job, Verdict, differ, gcc_robot, kept, reference, root, score};
use gr_tests::process::{end, run};

/// Files that become programs for a mill with three axes, and how they mean their numbers.
const PARTS: [(&str, &[&str]); 6] = [
    ("docs/examples/stepnc/case-study.p21", &[]),
    ("tests/linuxcnc/quick.p21", &[]),
    ("tests/linuxcnc/walls.p21", &[]),
    ("tests/golden/unb2013/fig4-45_slot-square-u.p21", &["--step-units", "step-modeler"]),
    ("tests/golden/unb2013/example-a_conical-hole.p21", &["--step-units", "step-modeler"]),
    ("tests/golden/ufsc2016/example1.p21", &["--step-overlap", "percent"]),
];

fn ours(folder: &Path, args: &[&str]) -> String {
    let out = run(Command::new(gcc_robot()).args(args).current_dir(folder), Duration::from_secs(60)).expect("runs");
    assert_eq!(out.status, Some(0), "{args:?}: {}", out.errors());
    out.output()
}

/// `rs274` 2.9 is an inch machine.
fn in_inches(table: &str) -> String {
    let word = |w: &str| match w.split_at(1) {
        (l @ ("Z" | "D"), v) => format!("{l}{:.9}", v.parse::<f64>().expect("a number") / 25.4),
        _ => w.to_string(),
    };
    let line = |l: &str| l.split(';').next().unwrap_or("").split_whitespace().map(word).collect::<Vec<_>>().join(" ") + "\n";
    table.lines().map(line).collect()
}

/// Number → length.
fn lengths(table: &str) -> Vec<(i32, f64)> {
    let value = |l: &str, letter: char| l.split_whitespace().find_map(|w| w.strip_prefix(letter)?.parse::<f64>().ok());
    table.lines().filter_map(|l| Some((value(l, 'T')? as i32, value(l, 'Z')?))).collect()
}

#[test]
fn written_programs_pass_the_interpreter() {
    let Some(rs274) = reference() else { return };
    for (part, meant) in PARTS {
        let folder = tempfile::tempdir().expect("a folder");
        let source = root().join(part);
        for options in [&[][..], &["--cycles"], &["--cutter-compensation", "control"], &["--tool-change-at", "g53"], &["--tool-change-at", "g55"], &["--tool-change-at", "g30"], &["--units", "inch"]] {
            let mut args = vec!["build", "-q", source.to_str().expect("UTF-8"), "-o", "part.ngc"];
            args.extend(meant);
            args.extend(options);
            ours(folder.path(), &args);
            let program = std::fs::read(folder.path().join("part.ngc")).expect("written");
            let table = std::fs::read_to_string(folder.path().join("part.tbl")).expect("written");
            let job = Job { tools: Some(in_inches(&table)), ..Job::new(program) };
            assert_eq!(differ(&job, &rs274), Verdict::Same, "{part} {options:?}");
            let accepted = job.reference(&rs274);
            assert!(accepted.ok(), "{part} {options:?}: {}", accepted.ended.errors());
        }
        in_full_precision(part, meant, folder.path(), &source);
    }
}

/// Feeds of a run of `rs274`: the call and its numbers.
fn feeds(canon: &str) -> Vec<(String, Vec<f64>)> {
    let call = |l: &str| {
        let (head, rest) = l.split_once('(')?;
        let name = head.split_whitespace().last()?;
        let numbers = rest.trim_end().trim_end_matches(')').split(',').filter_map(|v| v.trim().parse().ok()).collect();
        name.ends_with("_FEED").then(|| (name.to_string(), numbers))
    };
    canon.lines().filter_map(call).collect()
}

/// With the tool's diameter in the table LinuxCNC makes of contours (G41, G42) the path of the tool's centre; with another
/// diameter it comes nearer to the wall.
#[test]
fn the_control_keeps_the_tool_beside_walls() {
    let Some(rs274) = reference() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let source = root().join("tests/linuxcnc/walls.p21");
    let source = source.to_str().expect("UTF-8");
    let run = |options: &[&str], worn: f64| {
        ours(folder.path(), &[&["build", "-q", source, "-o", "part.ngc"], options].concat());
        let program = std::fs::read(folder.path().join("part.ngc")).expect("written");
        let table = std::fs::read_to_string(folder.path().join("part.tbl")).expect("written").replace(" D+6.0000 ", &format!(" D+{worn} "));
        let job = Job { tools: Some(in_inches(&table)), ..Job::new(program.clone()) };
        assert_eq!(differ(&job, &rs274), Verdict::Same, "{options:?}");
        let ended = job.reference(&rs274);
        assert!(ended.ok(), "{options:?}: {}", ended.ended.errors());
        (String::from_utf8(program).expect("UTF-8"), feeds(&ended.canon))
    };
    let (path, plain) = run(&[], 6.0);
    let (contours, compensated) = run(&["--cutter-compensation", "control"], 6.0);
    assert!(!path.contains("G41") && contours.matches("G41 D1\n").count() >= 4, "{contours}");
    assert!(plain.len() > 50, "{plain:?}");
    assert_eq!(plain.len(), compensated.len());
    for (a, b) in plain.iter().zip(&compensated) {
        assert!(a.0 == b.0 && a.1.iter().zip(&b.1).all(|(a, b)| (a - b).abs() < 2e-4), "{a:?} {b:?}");
    }
    let (_, worn) = run(&["--cutter-compensation", "control"], 5.8);
    assert!(plain.iter().zip(&worn).any(|(a, b)| a.1.iter().zip(&b.1).any(|(a, b)| (a - b).abs() > 0.05)));
}

/// As a machine in millimeters with the table as it was written: every move ends where ours ends.
fn in_full_precision(part: &str, meant: &[&str], folder: &Path, source: &Path) {
    let source = source.to_str().expect("UTF-8");
    let ours = |args: &[&str]| ours(folder, &[&["build", "-q", source], meant, args].concat());
    ours(&["-o", "mm.ngc", "--decimals", "7"]);
    let Some(path) = full::path(&folder.join("mm.ngc"), Some(&folder.join("mm.tbl"))) else { return };
    assert_eq!(path.end, "ok", "{part}");
    let table = std::fs::read_to_string(folder.join("mm.tbl")).expect("written");
    let theirs: Vec<[f64; 3]> = path.moves.iter().map(|m| [m.end[0], m.end[1], m.end[2]]).collect();
    let csv = ours(&["--target", "csv"]);
    let mut at = 0;
    for p in ends(&csv, &lengths(&table)) {
        // A move of nothing has no counterpart there.
        let next = theirs[at..].iter().take(3).position(|q| (0..3).all(|i| (p[i] - q[i]).abs() < 1e-6));
        let standing = at > 0 && (0..3).all(|i| (p[i] - theirs[at - 1][i]).abs() < 1e-6);
        match next {
            Some(n) => at += n + 1,
            None => assert!(standing || p[..2] == [0.0, 0.0], "{part}: {p:?} is not among {:?}", &theirs[at..(at + 4).min(theirs.len())]),
        }
    }
    assert!(at + 1 >= theirs.len(), "{part}: {} of {} moves", at, theirs.len());
}

/// Ends of the moves of a table, in machine coordinates.
fn ends(csv: &str, lengths: &[(i32, f64)]) -> Vec<[f64; 3]> {
    let mut out = Vec::new();
    for row in csv.lines().skip(1).map(|l| l.split(',').collect::<Vec<_>>()).filter(|r| r[1] != "dwell") {
        let n = |i: usize| row[i].parse::<f64>().expect("a number");
        let tool = n(14) as i32;
        let length = lengths.iter().find(|l| l.0 == tool).map_or(0.0, |l| l.1);
        out.push([n(2), n(3), n(4) + length]);
    }
    out
}

fn distance(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let d: [f64; 3] = std::array::from_fn(|i| b[i] - a[i]);
    let length: f64 = d.iter().map(|v| v * v).sum();
    let along: f64 = (0..3).map(|i| (p[i] - a[i]) * d[i]).sum();
    let t = if length == 0.0 { 0.0 } else { (along / length).clamp(0.0, 1.0) };
    (0..3).map(|i| (p[i] - a[i] - t * d[i]).powi(2)).sum::<f64>().sqrt()
}

/// The simulated machine follows our motion: at no millisecond is a joint further from our path than the corner
/// tolerance that the program asks for, and no corner of the path is left out.
#[test]
fn the_machine_follows_the_motion() {
    let part = root().join("tests/linuxcnc/quick.p21");
    let Some(machine) = Controller::new("@FOLDER@/drive.py", &part, "part.ngc") else { return };
    assert_eq!(machine.filter().status, Some(0));
    let ended = machine.run(Duration::from_secs(300));
    let log = ended.output();
    assert!(ended.status == Some(0) && log.lines().any(|l| l == "done"), "{}: {log}\n{}", ended.how(), ended.errors());
    let text = std::fs::read_to_string(machine.path("samples.txt")).expect("recorded");
    let samples: Vec<[f64; 3]> = text
        .lines()
        .filter_map(|l| {
            let mut n = l.split_whitespace().map_while(|v| v.parse::<f64>().ok());
            Some([n.next()?, n.next()?, n.next()?])
        })
        .collect();
    let folder = tempfile::tempdir().expect("a folder");
    let csv = ours(folder.path(), &["build", "-q", part.to_str().expect("UTF-8"), "--target", "csv", "--arc-tolerance", "0.0005"]);
    let table = std::fs::read_to_string(machine.path("tool.tbl")).expect("written");
    let mut path = vec![[0.0; 3]];
    path.extend(ends(&csv, &lengths(&table)));
    let program = std::fs::read_to_string(machine.path("part.ngc")).expect("written");
    let blend: f64 = program.lines().find_map(|l| l.strip_prefix("G64 P")?.parse().ok()).expect("a corner tolerance");
    let moving: Vec<[f64; 3]> = samples.iter().copied().enumerate().filter(|(i, s)| *i == 0 || samples[i - 1] != *s).map(|(_, s)| s).collect();
    let to_path = |s: [f64; 3]| path.windows(2).map(|w| distance(s, w[0], w[1])).fold(f64::INFINITY, f64::min);
    let worst = moving.iter().map(|s| to_path(*s)).fold(0.0, f64::max);
    // The machine makes 0.04 mm in a millisecond at this feed; corners of rapids are passed faster.
    let to_samples = |p: [f64; 3]| moving.windows(2).map(|w| distance(p, w[0], w[1])).fold(f64::INFINITY, f64::min);
    let missed = path.iter().map(|p| to_samples(*p)).fold(0.0, f64::max);
    score("simulator", &format!("simulator: {} ms, joints at most {worst:.4} mm off our path, corners passed within {missed:.4} mm (G64 P{blend})", samples.len()));
    assert!(moving.len() > 2000 && samples.len() < 60_000, "{} samples", samples.len());
    assert!(worst < blend + 0.0015, "{worst} mm off the path");
    assert!(missed < blend + 0.0015, "a corner is missed by {missed} mm");
}

/// AXIS opens the shipped part through the filter, runs it, and the viewer marks the workingstep that is running.
#[test]
fn axis_opens_and_follows_a_part() {
    let Some(screen) = Screen::new(1500, 800) else { return };
    let part = root().join("docs/examples/stepnc/case-study.p21");
    let Some(machine) = Controller::new("axis", &part, "part.p21") else { return };
    assert_eq!(machine.filter().status, Some(0));
    let mut axis = machine.start(&screen.display);
    let state = machine.wait_for("state.txt", 300, |t| t.starts_with('6'));
    let marked = |p: &Picture| p.count([0xFF, 0xE0, 0x8A]) > 2000;
    // AXIS draws feed moves white on black.
    let drawn = |p: &Picture| p.count([0, 0, 0]) > 20_000 && p.count([255, 255, 255]) > 20_000;
    let picture = screen.picture_when(|p| state.is_err() || marked(p) && drawn(p));
    let shot: PathBuf = kept("screens").join("axis.ppm");
    std::fs::write(&shot, picture.ppm()).expect("target is writable");
    drop(screen);
    // Without its screen AXIS ends, and the controller with it.
    end(&mut axis, Duration::from_secs(60));
    let state = state.unwrap_or_else(|e| panic!("{e}"));
    let lines: Vec<&str> = state.lines().collect();
    assert!(lines[1].ends_with("/part.p21"), "{state}");
    assert_eq!(lines[2..], ["STEP-NC Program", "52"], "the first workingstep of the plan is running");
    assert!(marked(&picture), "the statement is marked: {}", shot.display());
    assert!(drawn(&picture), "{}", shot.display());
}
