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

/// A tight spot slows what runs through it and nothing else.
#[test]
fn setpoints_keep_the_feed_elsewhere() {
    // The corner at X40 is tight at both feeds; the slow line that follows is none.
    let program = planned("T1 M6\nG0 X10 Y10 Z0\nG1 X40 F6000\nG1 Y40 F12000\nG1 X80 F900\nG1 Y40.3 F12000\nG0 Z30\nM30\n");
    let made = setpoints(&program, &SetpointOptions::default()).unwrap();
    let frame = program.frames[0].frame.inverse();
    let kinematics = program.machine.kinematics();
    let tip = |q: &[f64; gr_robot::MAX_JOINTS]| frame.apply(kinematics.forward_frame(&q[..6]).unwrap().then(&program.tools[0].frame).position);
    let places: Vec<[f64; 3]> = made.rows.iter().map(|r| tip(&r.position)).collect();
    let slow = places.windows(2).filter(|w| w.iter().all(|p| (p[1] - 40.0).abs() < 1e-3 && p[0] > 50.0 && p[0] < 70.0));
    let speeds: Vec<f64> = slow.map(|w| (w[1][0] - w[0][0]) / made.interval).collect();
    assert!(speeds.len() > 100 && speeds.iter().all(|v| (v - 15.0).abs() < 0.01), "{} {:?}", speeds.len(), speeds.first());
    let unreached = made.unreached;
    assert!((unreached.cuts, unreached.of) == (1, 4) && unreached.least.is_some_and(|(share, s)| share < 0.9 && s.line == 5), "{unreached:?}");
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

/// Distance of the tool from a curve with all joints moving evenly from position to position, as a joint program is run;
/// `curve` gives the nearest point of the curve to a point in the work frame.
fn worst(program: &RobotProgram, line: u32, tolerance: f64, curve: &dyn Fn([f64; 3]) -> [f64; 3]) -> f64 {
    let path = joint_path(program, &JointOptions { tolerance, ..JointOptions::default() }).unwrap();
    let points: Vec<&JointPoint> = path.points().collect();
    let back = program.frames[0].frame.inverse();
    let mut worst = 0.0f64;
    for pair in points.windows(2).filter(|w| !w[1].rapid && w[1].source.is_some_and(|s| s.line + 1 == line)) {
        for k in 0..=16 {
            let at = back.apply(between(program, pair[0], pair[1], f64::from(k) / 16.0));
            worst = worst.max(norm(sub(at, curve(at))));
        }
    }
    worst
}

/// Lines, arcs, helices and splines: cutting the curve and moving the joints evenly share one tolerance.
#[test]
fn one_tolerance_for_all() {
    for tolerance in [0.1, 0.01, 0.001] {
        let half = |text: &str| {
            let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
            let program = gr_driver::lower("part.ngc", text.into(), &setup, None).program;
            let options = Options { own_words: true, tolerance: tolerance / 2.0, ..Options::default() };
            plan(&program, &cell(), &Texts::new([(FileId(0), text)]), &options).unwrap().program
        };
        let good = |name: &str, worst: f64| assert!(worst <= tolerance && worst > tolerance / 20.0, "{name}: {worst} for {tolerance}");
        let line = half("T1 M6\nG0 X0 Y0 Z20\nG1 X300 Y80 Z5 F3000\nM2\n");
        let ends = ([0.0, 0.0, 20.0], [300.0, 80.0, 5.0]);
        good("line", worst(&line, 3, tolerance, &|p| {
            let d = sub(ends.1, ends.0);
            let share = (0..3).map(|i| (p[i] - ends.0[i]) * d[i]).sum::<f64>() / (norm(d) * norm(d));
            [0, 1, 2].map(|i| ends.0[i] + d[i] * share)
        }));
        for (radius, rise) in [(30.0, -5.0), (150.0, -5.0), (100.0, 0.0), (60.0, 80.0)] {
            let text = format!("T1 M6\nG0 X{} Y100 Z20\nG3 X{} Y100 I-{radius} J0 Z{} F3000\nM2\n", 100.0 + radius, 100.0 + radius, 20.0 + rise);
            let found = worst(&half(&text), 3, tolerance, &|p| {
                let angle = (p[1] - 100.0).atan2(p[0] - 100.0);
                let turned = |a: f64| [100.0 + radius * a.cos(), 100.0 + radius * a.sin(), 20.0 + rise * a / std::f64::consts::TAU];
                // The way round begins at angle 0; near it both ends are tried.
                let all = [angle, angle + std::f64::consts::TAU].map(|a| a.clamp(0.0, std::f64::consts::TAU)).map(turned);
                if norm(sub(p, all[0])) < norm(sub(p, all[1])) { all[0] } else { all[1] }
            });
            good(&format!("radius {radius}, rise {rise}"), found);
        }
        let spline = half("T1 M6\nG0 X0 Y0 Z5\nG5 I40 J90 P-30 Q-90 X200 Y60 F3000\nM2\n");
        let ends = [[0.0, 0.0], [40.0, 90.0], [170.0, -30.0], [200.0, 60.0]];
        let bezier = |t: f64| {
            let w = [(1.0 - t).powi(3), 3.0 * t * (1.0 - t) * (1.0 - t), 3.0 * t * t * (1.0 - t), t.powi(3)];
            [(0..4).map(|i| w[i] * ends[i][0]).sum::<f64>(), (0..4).map(|i| w[i] * ends[i][1]).sum(), 5.0]
        };
        let found = worst(&spline, 3, tolerance, &|p| {
            let far = |t: f64| norm(sub(p, bezier(t)));
            let coarse = (0..=400).map(|k| f64::from(k) / 400.0).min_by(|a, b| far(*a).total_cmp(&far(*b))).unwrap();
            let (mut low, mut high) = ((coarse - 0.0025).max(0.0), (coarse + 0.0025).min(1.0));
            for _ in 0..60 {
                let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if far(a) < far(b) { high = b } else { low = a }
            }
            bezier((low + high) / 2.0)
        });
        good("spline", found);
    }
}

const MILLS: [(&str, [char; 2]); 4] =
    [("generic/mill5-ac-table", ['A', 'C']), ("generic/mill5-bc-table", ['B', 'C']), ("generic/mill5-cb-head", ['B', 'C']), ("generic/mill5-b-head-c-table", ['B', 'C'])];

fn milled(text: &str, id: &str) -> RobotProgram {
    let machine = gr_machine::builtin(id).unwrap();
    let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    let program = gr_driver::lower("part.ngc", text.into(), &setup, None).program;
    let texts = Texts::new([(FileId(0), text)]);
    let told = |e: Vec<gr_text::Diagnostic>| e.iter().map(|d| format!("{} {}\n", d.code.def().code, d.message)).collect::<String>();
    plan(&program, &machine, &texts, &Options { own_words: true, tolerance: 0.005, ..Options::default() }).unwrap_or_else(|e| panic!("{id}: {}", told(e))).program
}

/// Words of a line of a joint program, by letter.
fn words(line: &str) -> std::collections::BTreeMap<char, f64> {
    line.split(' ').skip(1).map(|w| (w.chars().next().unwrap(), w[1..].parse().unwrap())).collect()
}

/// A tilt through zero: the rotary axes go as the program says, the tool stays where it was, in all four mills.
#[test]
fn a_tilt_goes_through_zero() {
    for (id, [tilt, turn]) in MILLS {
        let text = format!("T1 M6 G43.1 Z50\nG0 X10 Y10 Z-50 {tilt}20 {turn}0\nG1 Z-60 F500\nG1 {tilt}-20 F500\nG1 X20 {tilt}10 {turn}90\nG1 {tilt}0 {turn}0\nG1 {turn}45 F1000\nG0 {turn}300\nG0 Z-30\nM2\n");
        let program = milled(&text, id);
        let path = joint_path(&program, &JointOptions::default()).unwrap();
        let at = |letter: char| program.machine.joints.iter().position(|j| j.word == Some(letter)).unwrap();
        let ends: std::collections::BTreeMap<u32, [f64; 2]> = path.points().filter_map(|p| Some((p.source?.line + 1, [tilt, turn].map(|l| p.joints[at(l)].to_degrees())))).collect();
        let expected = [(2, [20.0, 0.0]), (3, [20.0, 0.0]), (4, [-20.0, 0.0]), (5, [10.0, 90.0]), (6, [0.0, 0.0]), (7, [0.0, 45.0]), (8, [0.0, 300.0]), (9, [0.0, 300.0])];
        for (line, [a, b]) in expected {
            let got = ends[&line];
            assert!((got[0] - a).abs() < 1e-6 && (got[1] - b).abs() < 1e-6, "{id}, line {line}: {got:?}");
        }
        // The tool stays on the part where only the rotary axes move, and no joint jumps.
        let points: Vec<&JointPoint> = path.points().filter(|p| p.source.is_some()).collect();
        for pair in points.windows(2) {
            let line = pair[1].source.unwrap().line + 1;
            for k in 0..=8 {
                let share = f64::from(k) / 8.0;
                let q: Vec<f64> = (0..5).map(|i| pair[0].joints[i] + (pair[1].joints[i] - pair[0].joints[i]) * share).collect();
                let tip = program.machine.kinematics().forward_frame(&q).unwrap().then(&program.tools[0].frame).position;
                if line == 4 {
                    assert!(norm(sub(tip, [10.0, 10.0, -60.0])) <= 0.01, "{id}: {tip:?}");
                }
            }
            assert!((0..5).all(|i| (pair[0].joints[i] - pair[1].joints[i]).abs() < if i < 3 { 60.0 } else { 0.6 }), "{id}, line {line}: {pair:?}");
        }
        // 40° at 500°/min, 45° at 1000°/min.
        let seconds = |line: u32| path.points().filter(|p| p.source.is_some_and(|s| s.line + 1 == line)).map(|p| p.seconds).sum::<f64>();
        assert!((seconds(4) - 40.0 / 500.0 * 60.0).abs() < 1e-9 && (seconds(7) - 45.0 / 1000.0 * 60.0).abs() < 1e-9, "{id}: {} {}", seconds(4), seconds(7));
    }
}

/// A cut in which the tool turns is one motion: set-points don't stand still in it, however far it turns.
#[test]
fn setpoints_turn_without_a_stop() {
    for (id, [tilt, turn]) in MILLS {
        for (cut, seconds) in [(format!("G1 X-50 {tilt}-31 F1000"), 6.0), (format!("G1 {turn}90 F1800"), 3.0), (format!("G1 X60 {turn}180 F200"), 3.0)] {
            let text = format!("T1 M6 G43.1 Z50\nG0 X50 Y0 Z0 {tilt}-1 {turn}0\n{cut}\nM2\n");
            let program = milled(&text, id);
            let made = setpoints(&program, &SetpointOptions::default()).unwrap();
            let joint = program.machine.joints.iter().position(|j| j.word == Some(if cut.contains(turn) { turn } else { tilt })).unwrap();
            let [first, last]: [f64; 2] = if cut.contains(tilt) { [-1.0, -31.0] } else { [0.0, if cut.contains("90") { 90.0 } else { 180.0 }] };
            // Behind the run-up and before the run-down it goes as fast as the feed asks for.
            let share = |k: usize| (made.rows[k].position[joint].to_degrees() - first) / (last - first);
            let speeds: Vec<f64> = (0..made.rows.len()).filter(|k| (0.15..0.85).contains(&share(*k))).map(|k| made.rows[k].velocity[joint].to_degrees() / (last - first)).collect();
            assert!(speeds.len() as f64 * made.interval > 0.69 * seconds, "{id} {cut}: {}", speeds.len());
            assert!(speeds.iter().all(|v| (v * seconds - 1.0).abs() < 1e-3), "{id} {cut}: {:?}", speeds.iter().map(|v| v * seconds).fold((9.0f64, 0.0f64), |(a, b), v| (a.min(v), b.max(v))));
        }
    }
}

/// With the tool upright the rotary axis that its direction leaves free goes as evenly as the program says.
#[test]
fn a_free_axis_goes_evenly() {
    for (id, [_, turn]) in MILLS {
        let program = milled(&format!("G0 X0 Y0 Z-50 {turn}0\nG1 X100 {turn}35 F9000\nM2\n"), id);
        let path = joint_path(&program, &JointOptions::default()).unwrap();
        let at = program.machine.joints.iter().position(|j| j.word == Some(turn)).unwrap();
        let points: Vec<&JointPoint> = path.points().collect();
        let cut = points.windows(2).filter(|w| !w[1].rapid);
        let speeds: Vec<f64> = cut.map(|w| (w[1].joints[at] - w[0].joints[at]).to_degrees() / w[1].seconds).collect();
        assert!(speeds.len() > 3 && speeds.iter().all(|v| (v - 52.5).abs() < 1e-6), "{id}: {speeds:?}");
    }
}

/// On a part that is clamped tilted a round cutter needs its direction only: which way it is turned about its own axis is nobody's matter.
#[test]
fn a_tilted_part_needs_the_tools_direction_only() {
    for (id, [tilt, turn]) in MILLS {
        for rotation in ["[0, 20, 0]", "[20, 0, 0]", "[10, -15, 40]"] {
            let file = format!("format = 1\nid = \"shop/m\"\ntitle = \"m\"\nextends = \"{id}\"\n[frames.table]\nposition = [10, -20, -30]\nrotation = {rotation}\n");
            let machine = gr_machine::parse(FileId(0), &file).unwrap();
            let text = format!("T1 M6 G43.1 Z50\nG0 X5 Y0 Z10 {tilt}0 {turn}0\nG1 X10 F300\nG1 Y10 {tilt}10 {turn}30 F500\nG0 Z20\nM2\n");
            let program = gr_driver::lower("part.ngc", text.as_str().into(), &gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() }, None).program;
            let made = plan(&program, &machine, &Texts::new([(FileId(0), text.as_str())]), &Options { own_words: true, ..Options::default() });
            let made = made.unwrap_or_else(|e| panic!("{id} {rotation}: {:?}", e.iter().map(|d| &d.message).collect::<Vec<_>>())).program;
            let path = joint_path(&made, &JointOptions::default()).unwrap();
            let straight = gr_machine::builtin(id).unwrap();
            let place = machine.cell.part_in_base();
            for (line, words, tip) in [(2, [0.0, 0.0], [10.0, 0.0, 10.0]), (3, [10.0, 30.0], [10.0, 10.0, 10.0])] {
                let at = path.points().filter(|p| p.source.is_some_and(|s| s.line == line)).last().unwrap();
                let flange = machine.kinematics().forward_frame(&at.joints[..5]).unwrap();
                let mut joints = [0.0; 5];
                for (letter, word) in [tilt, turn].iter().zip(words) {
                    joints[straight.joints.iter().position(|j| j.word == Some(*letter)).unwrap()] = f64::to_radians(word);
                }
                let says = gr_machine::math::rotate(&place.turn, straight.kinematics().forward_frame(&joints).unwrap().axis(2));
                let real = flange.then(&made.tools[0].frame).position;
                assert!(norm(sub(flange.axis(2), says)) < 1e-9, "{id} {rotation} line {line}: {:?} {says:?}", flange.axis(2));
                assert!(norm(sub(real, place.apply(tip))) < 1e-6, "{id} {rotation} line {line}: {real:?}");
            }
        }
    }
}

/// A rotary axis goes to the angle that the program names, not to one that looks the same.
#[test]
fn a_rotary_axis_ends_at_its_limit() {
    let text = "G0 X10 Y10 Z-50\nG1 C350 F3000\nG1 C400\nM2\n";
    let setup = gr_interp::Setup::default();
    let program = gr_driver::lower("part.ngc", text.into(), &setup, None).program;
    let machine = gr_machine::builtin("generic/mill5-cb-head").unwrap();
    let found = plan(&program, &machine, &Texts::new([(FileId(0), text)]), &Options::default()).unwrap_err();
    let told: Vec<String> = found.iter().map(|d| format!("{} {}", d.code.def().code, d.message)).collect();
    assert_eq!(told, ["E0507 joint C would have to go to 400°, its limit is 360°"]);
}

/// A mill's program keeps every word that is no motion; the rest is axis words with inverse time, which LinuxCNC reads.
#[test]
fn joint_gcode_of_mills() {
    let text = "G21 G90 G94 G54\n(rough)\nT1 M6\nG43.1 Z50\nS3000 M3\nM8\nG0 X10 Y10 Z-50 A10 C0\nG1 Z-65 F500\nG4 P1\nG2 X30 I10 J0\nG1 A20 X20\nM62 P1\nM0\nM5\nM9\nG0 Z-30\nM2\n";
    let program = milled(text, "generic/mill5-ac-table");
    let path = joint_path(&program, &JointOptions::default()).unwrap();
    let (out, _, found) = gcode(&program, &path, 6, &gr_ir::NoSources);
    assert_eq!(found, []);
    assert!(motion_is_good(&out));
    insta::assert_snapshot!("mill5_joint_gcode", out.lines().filter(|l| !l.starts_with("G1 ")).collect::<Vec<_>>().join("\n"));
    // What is written leads back to the program's path: the arc of line 10, and Σ time = length / F.
    let k = program.machine.kinematics();
    let tool = program.tools[0].frame;
    let tip = |w: &std::collections::BTreeMap<char, f64>| {
        let q = [w[&'X'], w[&'Y'], w[&'Z'], w[&'A'].to_radians(), w[&'C'].to_radians()];
        k.forward_frame(&q).unwrap().then(&tool).position
    };
    let arc: Vec<_> = out.lines().skip_while(|l| !l.starts_with("G4 P1")).skip(1).take_while(|l| l.starts_with("G1")).map(words).collect();
    let round = arc.iter().take_while(|w| tip(w)[1] > 10.0 + 1e-3).count() + 1;
    for w in &arc[..round] {
        let p = tip(w);
        assert!((((p[0] - 20.0).powi(2) + (p[1] - 10.0).powi(2)).sqrt() - 10.0).abs() < 0.01 && (p[2] + 65.0).abs() < 0.01, "{p:?}");
    }
    let seconds: f64 = arc[..round].iter().map(|w| 60.0 / w[&'F']).sum();
    assert!((seconds - std::f64::consts::PI * 10.0 / 500.0 * 60.0).abs() < 1e-9, "{seconds}");
    let flat = milled("T1 M6\nS3000 M3\nG0 X10 Y10\nG0 Z50\nG1 Z5 F500\nG2 X30 I10\nG0 Z50\nM2\n", "generic/mill3");
    let path = joint_path(&flat, &JointOptions::default()).unwrap();
    insta::assert_snapshot!("mill3_joint_gcode", gcode(&flat, &path, 3, &gr_ir::NoSources).0.lines().take(16).collect::<Vec<_>>().join("\n"));
}

/// A straight wrist on the way is no jump: the fifth joint changes its sign, the fourth and the sixth stay.
#[test]
fn a_wrist_goes_straight_through() {
    let file = include_str!("../../../docs/examples/irb2400-cell.toml")
        .replace("position = [900, -100, 400]", "position = [900, 0, 850]")
        .replace("rotation = [0, 45, 0]", "rotation = [0, 0, 0]")
        .replace("position = [60, 0, 110]", "position = [0, 0, 110]")
        .replace("extends =", "orientation = \"abc-euler-xyz\"\nextends =");
    let machine = gr_machine::parse(FileId(0), &file).unwrap_or_else(|e| panic!("{e:?}"));
    let text = "T1 M6\nG0 X100 Y0 Z600 B-90\nG1 Z200 F1000\nG1 Z600\nM2\n";
    let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    let motion = gr_driver::lower("part.ngc", text.into(), &setup, None).program;
    let told = |e: Vec<gr_text::Diagnostic>| e.iter().map(|d| format!("{} {}\n", d.code.def().code, d.message)).collect::<String>();
    let program = plan(&motion, &machine, &Texts::new([(FileId(0), text)]), &Options::default()).unwrap_or_else(|e| panic!("{}", told(e))).program;
    let path = joint_path(&program, &JointOptions::default()).unwrap();
    let points: Vec<&JointPoint> = path.points().collect();
    let bends: Vec<f64> = points.iter().map(|p| p.joints[4]).collect();
    assert!(bends.iter().any(|b| *b > 0.05) && bends.iter().any(|b| *b < -0.05), "{bends:?}");
    for pair in points.windows(2).filter(|w| !w[1].rapid) {
        assert!([3, 5].iter().all(|i| (pair[0].joints[*i] - pair[1].joints[*i]).abs() < 1e-6), "{pair:?}");
        for k in 0..=8 {
            let at = between(&program, pair[0], pair[1], f64::from(k) / 8.0);
            assert!(((at[0] - 1000.0).powi(2) + at[1].powi(2)).sqrt() <= 0.01, "{at:?}");
        }
    }
    // Every pose by the configuration that is told for it.
    for s in &program.steps {
        if let Action::Linear { to, .. } = s.action {
            let t = &program.targets[to as usize];
            let all = machine.kinematics().inverse_frame(&machine.kinematics().forward_frame(&t.joints[..6]).unwrap()).unwrap();
            let own = all.iter().find(|s| s.branch == t.branch).unwrap();
            assert!((own.joints[4] - t.joints[4]).abs() < 1e-6, "{own:?} {t:?}");
        }
    }
    let made = setpoints(&program, &SetpointOptions::default()).unwrap_or_else(|e| panic!("{e:?}"));
    assert!(made.rows.len() > 100);
    // Beside the plane the fourth joint really has to turn: at this feed that is an error.
    let beside = text.replace("Y0", "Y0.001");
    let motion = gr_driver::lower("part.ngc", beside.clone().into(), &setup, None).program;
    assert!(plan(&motion, &machine, &Texts::new([(FileId(0), beside.as_str())]), &Options::default()).is_err());
}

/// A mill without rotary axes cuts a side of a part that is clamped on its other side: every arc stays one, at its middle too.
#[test]
fn arcs_on_the_side_of_a_turned_part() {
    let side = |axes: [char; 3], axis: &str, plane: &str, sense: i32| {
        let ([u, v, w], back) = (axes, -sense);
        format!(
            "motion 1\nfile 0 \"a.p21\"\nunits mm @0:1\nbegin workingstep code=7 \"side\" @0:1\nfeed 10 angular=0.2 @0:1\nrapid {u}=0 {v}=0 {w}=-5 axis={axis} @0:2\n\
             linear {w}=2 @0:3\nlinear {u}=20 @0:4\nplane {plane} @0:5\narc {plane} turns={sense} center={} {v}=10 @0:5\narc {plane} turns={back} center={} {u}=18 {v}=12 @0:6\nclose workingstep @0:1\nend @0:7\n",
            if plane == "xz" { "5,20" } else { "20,5" },
            if plane == "xz" { "12,20" } else { "20,12" },
        )
    };
    for (rotation, text) in [("[-90, 0, 0]", side(['x', 'z', 'y'], "0,-1,0", "xz", -1)), ("[0, 90, 0]", side(['y', 'z', 'x'], "-1,0,0", "yz", 1))] {
        let file = format!("format = 1\nid = \"shop/m\"\ntitle = \"m\"\nextends = \"generic/mill3\"\n[[joint]]\nname = \"Z\"\nmin = -900\n[frames.part]\nposition = [115, 130, -140]\nrotation = {rotation}\n");
        let machine = gr_machine::parse(FileId(0), &file).unwrap();
        let program = gr_ir::text::parse(&text).unwrap_or_else(|e| panic!("{e:?}\n{text}"));
        let made = plan(&program, &machine, &gr_ir::NoSources, &Options { own_words: true, ..Options::default() });
        let made = made.unwrap_or_else(|e| panic!("{:?}", e.iter().map(|d| &d.message).collect::<Vec<_>>())).program;
        let ways: [Vec<[f64; 3]>; 2] = [
            joint_path(&made, &JointOptions::default()).unwrap().points().map(|p| p.tool.position).collect(),
            setpoints(&made, &SetpointOptions::default()).unwrap().rows.iter().map(|r| [r.position[0], r.position[1], r.position[2]]).collect(),
        ];
        let (mut cursor, mut arcs) = (program.cursor(), 0);
        while let Some(view) = cursor.next() {
            let gr_ir::Op::Arc(arc) = view.op else { continue };
            let shape = gr_ir::geometry::ArcShape::new(&arc, view.start, view.end);
            for share in [0.25, 0.5, 0.75] {
                let at = machine.cell.part_in_base().apply(shape.point(share));
                for way in &ways {
                    let off = way.windows(2).map(|w| to_segment(at, w[0], w[1])).fold(f64::INFINITY, f64::min);
                    assert!(off <= 0.01, "{rotation}, {share} of the arc from {:?}: {off} mm", view.start.xyz());
                }
            }
            arcs += 1;
        }
        assert_eq!(arcs, 2);
    }
}
