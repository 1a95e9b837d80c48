//! Joint positions and set-points: tolerance, times and limits are proven by forward kinematics.

use gr_ir::{FileId, Texts};
use gr_machine::Machine;
use gr_machine::math::{norm, sub};
use gr_robot::joints::{Event, JointOptions, JointPoint, gcode, joint_path};
use gr_robot::setpoints::{Fault, SetpointOptions, setpoints};
use gr_robot::{Action, Options, RobotProgram, plan};

fn cell() -> Machine {
    gr_machine::parse(FileId(0), include_str!("../../../docs/examples/irb2400-cell.toml")).unwrap()
}

fn planned(text: &str) -> RobotProgram {
    let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    let program = gr_driver::lower("part.ngc", text.into(), &setup, None).program;
    plan(&program, &cell(), &Texts::new([(FileId(0), text)]), &Options { own_words: true, ..Options::default() }).unwrap().program
}

const PART: &str = "G64 P0.05\nT1 M6\nS8000 M3\nG0 X10 Y10 Z30\nG1 Z2 F600\nG1 X110 F1200\nG2 X110 Y50 J20\nG3 X60 Y50 I-25\nG1 X10 Y10 Z1\nG0 Z30\nM30\n";

/// The tool between two positions, all joints moving evenly.
fn between(program: &RobotProgram, a: &JointPoint, b: &JointPoint, share: f64) -> [f64; 3] {
    let q: Vec<f64> = (0..6).map(|i| a.joints[i] + (b.joints[i] - a.joints[i]) * share).collect();
    program.machine.kinematics().forward_frame(&q).unwrap().then(&program.tools[0].frame).position
}

#[test]
fn the_tolerance_holds() {
    let program = planned(PART);
    let tolerance = 0.01;
    let path = joint_path(&program, &JointOptions { tolerance, ..JointOptions::default() }).unwrap();
    // The real path of each line of the program, finely.
    let fine = joint_path(&program, &JointOptions { tolerance: 1e-5, ..JointOptions::default() }).unwrap();
    let cuts = |p: &gr_robot::joints::JointPath| p.points().filter(|p| !p.rapid).cloned().collect::<Vec<_>>();
    let (coarse, real) = (cuts(&path), cuts(&fine));
    assert!(coarse.len() < real.len() / 5 && coarse.len() > 10, "{} {}", coarse.len(), real.len());
    let real: Vec<[f64; 3]> = real.iter().map(|p| p.tool.position).collect();
    let mut worst = 0.0f64;
    for pair in coarse.windows(2) {
        for k in 0..16 {
            let at = between(&program, &pair[0], &pair[1], f64::from(k) / 16.0);
            let near = real.windows(2).map(|w| to_segment(at, w[0], w[1])).fold(f64::INFINITY, f64::min);
            worst = worst.max(near);
        }
    }
    assert!(worst <= tolerance, "{worst}");
    assert!(worst > tolerance / 10.0, "{worst}");
}

fn to_segment(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let (ab, ap) = (sub(b, a), sub(p, a));
    let length = norm(ab);
    let share = if length > 0.0 { (0..3).map(|i| ap[i] * ab[i]).sum::<f64>() / (length * length) } else { 0.0 };
    let share = share.clamp(0.0, 1.0);
    norm([0, 1, 2].map(|i| ap[i] - ab[i] * share))
}

#[test]
fn times_add_up() {
    let program = planned(PART);
    let path = joint_path(&program, &JointOptions::default()).unwrap();
    let (text, sources, _) = gcode(&program, &path, 6, &gr_ir::NoSources);
    assert_eq!(text.lines().count(), sources.len());
    insta::assert_snapshot!("joint_gcode", text.lines().take(30).collect::<Vec<_>>().join("\n"));
    // Of every line of the program: Σ 1/F = length / F.
    let mut lengths: std::collections::BTreeMap<u32, f64> = std::collections::BTreeMap::new();
    let mut at = program.home.position;
    for s in &program.steps {
        let to = |t: u32| program.targets[t as usize].position;
        let Some((t, length, speed, cut)) = (match s.action {
            Action::Joint { to: t, .. } => Some((t, 0.0, 1.0, false)),
            Action::Linear { to: t, speed, rapid, .. } => Some((t, norm(sub(to(t), at)), speed, !rapid)),
            Action::Arc { to: t, center, angle, speed, .. } => Some((t, norm(sub(to(t), center)) * angle, speed, true)),
            _ => None,
        }) else {
            continue;
        };
        if let (Some(s), true) = (s.source, cut) {
            *lengths.entry(s.line).or_default() += length / speed;
        }
        at = to(t);
    }
    let mut found: std::collections::BTreeMap<u32, f64> = std::collections::BTreeMap::new();
    let mut words = text.lines().filter(|l| l.starts_with("G1 ")).map(|l| l.rsplit_once('F').unwrap().1.parse::<f64>().unwrap());
    for (n, event) in path.events.iter().filter(|e| matches!(e, Event::Point(_))).enumerate() {
        let Event::Point(p) = event else { continue };
        if n > 0 && p.seconds <= 0.0 {
            continue;
        }
        let seconds = 60.0 / words.next().unwrap();
        if let (Some(s), false) = (p.source, p.rapid) {
            *found.entry(s.line).or_default() += seconds;
        }
    }
    assert_eq!(lengths.len(), found.len());
    for (line, seconds) in &lengths {
        assert!((seconds - found[line]).abs() <= 1e-9 * seconds.max(1.0), "line {line}: {seconds} {}", found[line]);
    }
}

#[test]
fn even_times() {
    let program = planned(PART);
    let path = joint_path(&program, &JointOptions { interval: Some(0.02), ..JointOptions::default() }).unwrap();
    assert!(path.points().all(|p| p.seconds <= 0.02 + 1e-9));
    let few = joint_path(&program, &JointOptions { most: 20, ..JointOptions::default() });
    assert_eq!(few.unwrap_err().most, 20);
}

#[test]
fn setpoints_keep_limits() {
    // Where a line goes over into an arc acceleration across the path begins at once: jerk is looked at on lines.
    let lines = "G64 P0.05\nT1 M6\nG0 X10 Y10 Z30\nG1 Z2 F600\nG1 X110 F1200\nG1 Y60\nG0 Z30\nM30\n";
    for (smoothing, text) in [(0.0, PART), (0.0, lines), (0.05, PART), (0.05, lines)] {
        let program = planned(text);
        let made = setpoints(&program, &SetpointOptions { smoothing, ..SetpointOptions::default() }).unwrap();
        let last = made.rows.last().unwrap();
        assert!((0..6).all(|i| (last.position[i] - program.home.joints[i]).abs() < 1e-6), "{last:?}");
        let (mut fast, mut hard, mut jerk) = (0.0f64, 0.0f64, 0.0f64);
        for (k, row) in made.rows.iter().enumerate() {
            for (i, j) in program.machine.joints.iter().enumerate() {
                let limit = j.speed.unwrap();
                fast = fast.max(row.velocity[i].abs() / limit);
                hard = hard.max(row.acceleration[i].abs() / (limit / 0.25));
                if k > 0 {
                    jerk = jerk.max((row.acceleration[i] - made.rows[k - 1].acceleration[i]).abs() / made.interval / (limit / 0.25));
                }
            }
        }
        assert!(fast <= 1.0 + 1e-6 && hard <= 1.0 + 1e-6, "{smoothing}: {fast} {hard}");
        // Jerk: acceleration takes the smoothing time to build up.
        if smoothing > 0.0 && text == lines {
            assert!(jerk <= 2.5 / smoothing, "{jerk}");
        }
        let bytes = made.bytes();
        assert_eq!(&bytes[..4], b"GRSP");
        assert_eq!(bytes.len(), 28 + made.rows.len() * 6 * 24);
        assert_eq!(made.csv().lines().count(), made.rows.len() + 1);
    }
}

const WORDS: &str = "T1 M6\nM3 S8000\nM7\nM19 R90 P1 Q3\nM3 S8000\nG0 X10 Y10 Z30\nM62 P1\nM67 E1 Q0.5\nM68 E0 Q-2\nM66 P2 L3 Q5\nM66 E1 L0\nM101 P1 Q2\nM102\nM50 P0\nM53 P0\nM52 P1\nG1 Z2 F600\nM0\nM1\nM60\nG4 P1.5\n(MSG, look)\nM49\nM48\nG1 X20\nM30\n";

/// What is no motion keeps all its arguments, and LinuxCNC takes them.
#[test]
fn words_keep_their_arguments() {
    let program = planned(WORDS);
    let path = joint_path(&program, &JointOptions::default()).unwrap();
    let (text, _, found) = gcode(&program, &path, 3, &Texts::new([(FileId(0), WORDS)]));
    let words: Vec<&str> = text.lines().filter(|l| !l.starts_with("G1 ")).collect();
    insta::assert_snapshot!("own_words", words.join("\n"));
    // The example's spindle waits for an input with a name.
    let told: Vec<&str> = found.iter().map(|d| d.message.as_str()).collect();
    assert_eq!(told, ["the wait for the input `diSpindleAtSpeed` isn't written: LinuxCNC knows inputs by number only"]);
    assert_eq!(found[0].code.def().slug, "robot/input-name");
    assert!(motion_is_good(&text));
}

fn motion_is_good(text: &str) -> bool {
    let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    let program = gr_driver::lower("joints.ngc", text.into(), &setup, None).program;
    program.steps().any(|s| s.op == gr_ir::Op::End)
}

/// An input with a number is waited for with M66, which goes on in any case: too late is a stop.
#[test]
fn waits_for_numbered_inputs() {
    let mut program = planned("T1 M6\nG0 X10 Y10 Z30\nG4 P1\nG4 P2\nG1 Z2 F600\nM30\n");
    let dwells: Vec<usize> = (0..program.steps.len()).filter(|i| matches!(program.steps[*i].action, Action::Dwell(_))).collect();
    program.steps[dwells[0]].action = Action::WaitInput { name: "DI[3]".into(), on: true, timeout: Some(2.5) };
    program.steps[dwells[1]].action = Action::WaitInput { name: "in 4".into(), on: false, timeout: None };
    let path = joint_path(&program, &JointOptions::default()).unwrap();
    let (text, _, found) = gcode(&program, &path, 3, &gr_ir::NoSources);
    assert_eq!(found, []);
    assert!(motion_is_good(&text));
    let words: Vec<&str> = text.lines().filter(|l| l.contains("M66") || l.starts_with('o') || l.contains("did not")).collect();
    insta::assert_snapshot!("numbered_waits", words.join("\n"));
}

#[test]
fn too_fine_an_interval_is_told_at_once() {
    let program = planned(PART);
    for interval in [1e-9, 1e-300] {
        let made = joint_path(&program, &JointOptions { interval: Some(interval), ..JointOptions::default() });
        assert!(made.is_err());
        assert!(matches!(setpoints(&program, &SetpointOptions { interval, ..SetpointOptions::default() }), Err(Fault::TooMany(_))));
    }
}

/// Set-points are motion alone: the rest stands in a table, and the machine stands still there.
#[test]
fn events_of_setpoints() {
    for smoothing in [0.0, 0.05] {
        let program = planned(WORDS);
        let made = setpoints(&program, &SetpointOptions { smoothing, ..SetpointOptions::default() }).unwrap();
        for event in &made.events {
            let v = made.rows[event.row].velocity.iter().fold(0.0f64, |a, v| a.max(v.abs()));
            assert!(v < 1e-9, "{v} at {event:?}");
        }
        assert!(made.events.windows(2).all(|w| w[0].row <= w[1].row));
        if smoothing > 0.0 {
            let texts = Texts::new([(FileId(0), WORDS)]);
            let told: String = made.findings(&program, &texts).iter().map(|d| format!("{}\n", d.message)).collect();
            insta::assert_snapshot!("events", format!("{}\n{told}", made.events_csv(&program)));
        }
    }
}

/// A joint that jumps keeps no acceleration however slowly it goes.
#[test]
fn a_jump_of_a_joint_is_an_error() {
    let mut program = planned(PART);
    let Some(Action::Joint { to, .. }) = program.steps.iter().map(|s| s.action.clone()).find(|a| matches!(a, Action::Joint { .. })) else { panic!() };
    program.targets[to as usize].joints[0] += 0.3;
    let Err(fault) = setpoints(&program, &SetpointOptions::default()) else { panic!("a jump goes out") };
    let finding = fault.finding(&program.machine, &Texts::new([(FileId(0), PART)]));
    assert_eq!(finding.code, gr_text::code::ROBOT_ACCELERATION);
    assert!(finding.message.starts_with("joint J1 would have to gain speed at "), "{}", finding.message);
    let at = finding.primary().1.start as usize;
    assert!(PART[at..].starts_with("G0 X10 Y10 Z30"), "{}", &PART[at..]);
}

/// A frame that turns between two cuts: the tool turns along on the way, and no joint jumps.
#[test]
fn a_turned_frame_is_no_jump() {
    let program = planned("T1 M6\nG0 X10 Y10 Z30\nG1 Z20 F600\nG1 X40\nG10 L2 P1 R10\nG1 X80\nG0 Z30\nM30\n");
    let made = setpoints(&program, &SetpointOptions::default()).unwrap_or_else(|e| panic!("{e:?}"));
    let step = |w: &[gr_robot::setpoints::Setpoint]| (0..6).map(|i| (w[1].position[i] - w[0].position[i]).abs()).fold(0.0, f64::max);
    assert!(made.rows.windows(2).map(step).fold(0.0, f64::max) < 0.02);
    let path = joint_path(&program, &JointOptions { interval: Some(0.02), ..JointOptions::default() }).unwrap();
    let points: Vec<&JointPoint> = path.points().filter(|p| !p.rapid).collect();
    let step = |w: &[&JointPoint]| (0..6).map(|i| (w[1].joints[i] - w[0].joints[i]).abs()).fold(0.0, f64::max);
    assert!(points.windows(2).map(step).fold(0.0, f64::max) < 0.02);
}
