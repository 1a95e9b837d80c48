//! Programs planned for machines of the library and for the cell of the examples.

use gr_ir::{FileId, Texts};
use gr_machine::{Machine, builtin};
use gr_robot::{Action, Options, Planned, plan};
use gr_text::Diagnostic;

fn cell() -> Machine {
    let text = include_str!("../../../docs/examples/irb2400-cell.toml");
    gr_machine::parse(FileId(0), text).expect("the example is good")
}

fn motion(text: &str) -> gr_ir::Program {
    let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    gr_driver::lower("part.ngc", text.into(), &setup, None).program
}

fn planned(text: &str, machine: &Machine) -> Result<Planned, Vec<Diagnostic>> {
    let texts = Texts::new([(FileId(0), text)]);
    plan(&motion(text), machine, &texts, &Options::default())
}

fn messages(found: &[Diagnostic], text: &str) -> String {
    let line = |d: &Diagnostic| {
        let at = d.primary().1.start as usize;
        let n = text.get(..at).map_or(0, |t| t.matches('\n').count()) + 1;
        format!("{} line {n}: {}\n", d.code.def().code, d.message)
    };
    found.iter().map(line).collect()
}

/// A program as one line per step, joints in degrees.
fn told(p: &Planned) -> String {
    let mut out = String::new();
    let joints = |i: u32| {
        let t = &p.program.targets[i as usize];
        let q: Vec<String> = p.program.machine.joints.iter().zip(t.joints).map(|(j, v)| if j.kind == gr_machine::JointKind::Revolute { format!("{:.2}", v.to_degrees()) } else { format!("{v:.3}") }).collect();
        format!("{:?} [{}] b{}", t.position.map(|v| (v * 1e3).round() / 1e3 + 0.0), q.join(" "), t.branch)
    };
    for s in &p.program.steps {
        let line = s.source.map_or("   -".into(), |s| format!("{:4}", s.line + 1));
        let what = match &s.action {
            Action::Joint { to, speed, zone } => format!("joint {} at {speed} {zone:?}", joints(*to)),
            Action::Linear { to, speed, zone, rapid } => format!("{} {} at {speed:.3} {zone:?}", if *rapid { "rapid" } else { "line" }, joints(*to)),
            Action::Arc { to, angle, speed, zone, .. } => format!("arc {:.1}° {} at {speed:.3} {zone:?}", angle.to_degrees(), joints(*to)),
            other => format!("{other:?}"),
        };
        out += &format!("{line} {what}\n");
    }
    out
}

/// A rail moves the part the other way, a positioner turns it; both stand in every target.
#[test]
fn rails_and_positioners_stand_where_the_file_says() {
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG1 Z0 F600\nX40\nM30\n";
    let file = include_str!("../../../docs/examples/irb2400-cell.toml");
    let machine = |part: &str, more: &str| {
        let text = file.replace("position = [0, 0, 50]", part) + more;
        gr_machine::parse(FileId(0), &text).unwrap_or_else(|e| panic!("{}", messages(&e, &text)))
    };
    let joints = |m: &Machine| planned(text, m).unwrap_or_else(|e| panic!("{}", messages(&e, text))).program.targets;
    let plain = joints(&machine("position = [100, -50, 50]", ""));
    let rail = "\n[[external]]\nname = \"E1\"\ntype = \"prismatic\"\ncarries = \"machine\"\naxis = [1, 0, 0]\nmin = 0\nmax = 3000\nposition = 700\n";
    let table = "\n[[external]]\nname = \"E2\"\ntype = \"revolute\"\ncarries = \"part\"\npoint = [1600, 0, 0]\nposition = 180\n";
    let moved = joints(&machine("position = [800, -50, 50]", rail));
    // Half a turn about X 1600 of the part that stood at 1600, 50 from the base, and turned by half a turn itself.
    let both = joints(&machine("position = [700, 250, 50]\nrotation = [0, 0, 180]", &format!("{rail}{table}")));
    assert_eq!(plain.len(), moved.len());
    for ((p, m), b) in plain.iter().zip(&moved).zip(&both) {
        assert!((0..6).all(|i| (p.joints[i] - m.joints[i]).abs() < 1e-9), "{p:?} {m:?}");
        assert!((m.joints[6] - 700.0).abs() < 1e-12 && (b.joints[6] - 700.0).abs() < 1e-12);
        assert!((b.joints[7] - std::f64::consts::PI).abs() < 1e-12);
    }
    let beyond = file.to_string() + &rail.replace("700", "7000");
    let found = gr_machine::parse(FileId(0), &beyond).expect_err("beyond its travel");
    assert!(found[0].message.contains("outside of the limits"), "{found:?}");
}

#[test]
fn the_example_part() {
    let text = include_str!("../../../docs/examples/bracket.ngc");
    let p = planned(text, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, text)));
    insta::assert_snapshot!("bracket", told(&p));
    insta::assert_snapshot!("bracket_summary", format!("{}{:#?}", messages(&p.warnings, text), p.summary));
}

/// Forward kinematics of every target lead back to its pose: in the frame and with the tool in force, the way home too, where
/// the last tool is not the last that came new.
#[test]
fn joints_lead_to_poses() {
    lead_to_poses(include_str!("../../../docs/examples/bracket.ngc"), 61);
    lead_to_poses("G21 G90\nT1 M6\nG0 X10 Y10 Z20\nG1 Z0 F600\nG0 Z20\nT2 M6\nG0 X40 Y10\nG1 Z0\nG0 Z20\nT1 M6\nG0 X20 Y10\nG1 Z0\nG0 Z20\nM30\n", 8);
}

fn lead_to_poses(text: &str, least: usize) {
    let p = planned(text, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, text))).program;
    let k = p.machine.kinematics();
    let (mut tool, mut frame) = (0usize, 0usize);
    let mut seen = 0;
    for s in &p.steps {
        let to = match s.action {
            Action::UseTool(t) => {
                tool = usize::from(t);
                continue;
            }
            Action::UseFrame(f) => {
                frame = usize::from(f);
                continue;
            }
            Action::Joint { to, .. } | Action::Linear { to, .. } | Action::Arc { to, .. } => to,
            _ => continue,
        };
        let t = &p.targets[to as usize];
        let at = p.frames[frame].frame.inverse().then(&k.forward_frame(&t.joints[..6]).unwrap()).then(&p.tools[tool].frame);
        let miss = (0..3).map(|i| (at.position[i] - t.position[i]).abs()).fold(0.0, f64::max);
        assert!(miss < 1e-9, "{miss} at {t:?}");
        let [w, x, y, z] = t.quaternion;
        let axis = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
        let turn = (0..3).map(|i| (at.turn[i][2] - axis[i]).abs()).fold(0.0, f64::max);
        assert!(turn < 1e-12, "{turn}");
        assert!(p.machine.outside(&t.joints[..6]).is_empty());
        seen += 1;
    }
    assert!(seen >= least, "{seen}");
}

fn faults(text: &str, machine: &Machine) -> String {
    match planned(text, machine) {
        Ok(p) => format!("planned\n{}", messages(&p.warnings, text)),
        Err(e) => messages(&e, text),
    }
}

#[test]
fn what_goes_wrong() {
    let cell = cell();
    let mut out = String::new();
    let rows = [
        ("out of reach", "T1 M6\nG0 X0 Y0 Z20\nG1 X3000 F500\nG1 X0\nG1 Y5000\nM30\n"),
        ("unknown tool", "T7 M6\nG0 X0 Y0 Z20\nM30\n"),
        ("no meaning", "T1 M6\nG0 X0 Y0 Z20\nM3 S5000\nG33 Z0 K1\nM30\n"),
        ("rotary", "T1 M6\nG0 X0 Y0 Z20\nG1 X50 A20 F600\nM30\n"),
        ("joint speed", "T1 M6\nG0 X0 Y0 Z20\nG1 X400 F900000\nM30\n"),
        ("spindle speed", "T1 M6\nS30000 M3\nG0 X0 Y0 Z20\nM30\n"),
        ("run time", "T1 M6\nG0 X0 Y0 Z20\nM66 P0 L3 Q1\nG1 X#5399 F100\nM30\n"),
        ("outputs", "T1 M6\nM62 P3\nM64 P1\nG0 X0 Y0 Z20\nM30\n"),
    ];
    for (name, text) in rows {
        out += &format!("{name}:\n{}", faults(text, &cell));
    }
    insta::assert_snapshot!("what_goes_wrong", out);
}

/// Errors have room of their own: however many warnings come first, no program goes out that has one.
#[test]
fn warnings_hide_no_error() {
    let mut text = String::from("T1 M6\nG0 X0 Y0 Z20\n");
    for i in 0..250 {
        text += &format!("M{} P{}\n", 62 + i / 64, i % 64);
    }
    let warned = planned(&text, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, &text))).warnings;
    assert_eq!(warned.iter().filter(|d| d.code == gr_text::code::ROBOT_BY_HAND).count(), 200);
    assert_eq!(warned.last().unwrap().notes, ["not listed: 50 more warnings or hints"]);
    text += "G1 X400 F900000\nM30\n";
    let found = planned(&text, &cell()).expect_err("a joint is too fast");
    assert!(found.iter().any(|d| d.code == gr_text::code::ROBOT_JOINT_SPEED), "{}", messages(&found, &text));
}

#[test]
fn other_machines() {
    let mut out = String::new();
    let flat = "G0 X50 Y50 Z0 F100\nG1 X60 Y60 C-60 F500\nM30\n";
    out += &format!("planar:\n{}", faults(flat, &builtin("ufmg/plano-3r").unwrap()));
    let line = "G0 X850 Y0 Z0\nG1 X900 Y100 Z50 F500\nM30\n";
    out += &format!("2UPS+PRP:\n{}", faults(line, &builtin("usp/2ups-prp").unwrap()));
    let far = "G0 X850 Y0 Z0\nG1 X1500 Y0 F500\nG1 X850\nG1 X10 Y0\nG1 X850\nG1 X900 C20\nM30\n";
    out += &format!("2UPS+PRP, faults:\n{}", faults(far, &builtin("usp/2ups-prp").unwrap()));
    let lean = "G0 X10 Y10 Z300\nG1 X20 A30 F500\nM30\n";
    let scara = gr_machine::parse(FileId(0), "format = 1\nid = \"shop/scara\"\nextends = \"adept/one\"\n[frames.table]\nposition = [300, 300, 745]\n").unwrap();
    out += &format!("scara:\n{}", faults(lean, &scara));
    out += &format!("mill:\n{}", faults("G0 X10 Y10 Z50\nG1 X20 F500\nG2 X40 I10\nM30\n", &builtin("generic/mill3").unwrap()));
    out += &format!("five axes:\n{}", faults("G0 X10 Y10 Z50\nG1 X20 A10 C20 F500\nM30\n", &builtin("generic/mill5-ac-table").unwrap()));
    insta::assert_snapshot!("other_machines", out);
}

/// Round the base by 340°: the sixth joint turns as far. From the turn nearest to home it would run into its limit on
/// the way; the start must be a whole turn away from there.
#[test]
fn the_nearest_start_can_be_the_wrong_one() {
    let text = "format = 1\nid = \"shop/round\"\nextends = \"abb/irb2400\"\n[home]\njoints = [0, 0, 0, 0, 30, 0]\n[[joint]]\nname = \"J6\"\nmin = -380\nmax = 300\n";
    let machine = gr_machine::parse(FileId(0), text).unwrap();
    let (s, c) = 170f64.to_radians().sin_cos();
    let mut starts = Vec::new();
    for way in ["G3", "G2"] {
        let (from, to) = if way == "G3" { (-1.0, 1.0) } else { (1.0, -1.0) };
        let program = format!("G0 X{:.6} Y{:.6} Z700\n{way} X{:.6} Y{:.6} I{:.6} J{:.6} F3000\nM30\n", 900.0 * c, from * 900.0 * s, 900.0 * c, to * 900.0 * s, -900.0 * c, -from * 900.0 * s);
        let p = planned(&program, &machine).unwrap_or_else(|e| panic!("{}", messages(&e, &program)));
        let arc = p.program.steps.iter().position(|s| matches!(s.action, Action::Arc { .. })).unwrap();
        let first = p.program.steps[..arc].iter().rev().find_map(|s| match s.action {
            Action::Joint { to, .. } | Action::Linear { to, .. } => Some(p.program.targets[to as usize].joints[5]),
            _ => None,
        });
        let last = p.program.steps.iter().rev().find_map(|s| if let Action::Arc { to, .. } = s.action { Some(p.program.targets[to as usize].joints[5]) } else { None });
        let (first, last) = (first.unwrap().to_degrees(), last.unwrap().to_degrees());
        assert!(((last - first).abs() - 340.0).abs() < 1.0, "{first} {last}");
        assert!(first.min(last) >= -380.0 && first.max(last) <= 300.0);
        starts.push((first, last));
    }
    // One of the two senses begins where going on from the nearest turn would end beyond 300°.
    let nearest = |v: f64| v - 360.0 * (v / 360.0).round();
    assert!(starts.iter().any(|(a, b)| (nearest(*a) - a).abs() > 1.0 && nearest(*a) + (b - a) > 300.0), "{starts:?}");
}

/// A line across the hollow of the parallel machine's work space: both ends are good, the middle is too near the column.
#[test]
fn a_line_leaves_the_work_space() {
    let machine = builtin("usp/2ups-prp").unwrap();
    let k = machine.kinematics();
    let good = |x: f64, y: f64, z: f64| {
        let pose = gr_machine::Pose { position: [x, y, z], rotation: [0.0; 3] };
        k.inverse(&pose).is_ok_and(|all| all.iter().any(|s| machine.outside(&s.joints).is_empty() && k.violations(&s.joints).is_empty()))
    };
    let mut found = None;
    for z in (0..=640).step_by(20).map(f64::from) {
        for yaw in (10..34).map(|d| f64::from(d).to_radians()) {
            for arm in (606..760).step_by(4).map(f64::from) {
                let (x, y) = (arm * yaw.cos(), arm * yaw.sin());
                if found.is_none() && good(x, y, z) && good(x, -y, z) && !good(x, 0.0, z) {
                    found = Some((x, y, z));
                }
            }
        }
    }
    let (x, y, z) = found.expect("there is such a line");
    let text = format!("G0 X{x:.3} Y{y:.3} Z{z}\nG1 Y{:.3} F600\nM30\n", -y);
    let told = faults(&text, &machine);
    assert!(told.starts_with("E0530 line 2: both ends of this move can be reached, but at "), "{told}");
    insta::assert_snapshot!("leaves_the_work_space", told);
}

/// A joint limit in the middle of a line whose ends are both good: the place is told. So is that of a condition.
#[test]
fn a_joint_leaves_its_range_on_the_way() {
    let legs = builtin("usp/2ups-prp").unwrap();
    let told = faults("G0 X640 Y-40 Z0\nG1 X708 Y-460 F3000\nM2\n", &legs);
    assert!(told.starts_with("E0530 line 2: both ends of this move can be reached, but at X 64") && told.contains("joint h2 would have to go to 847.9"), "{told}");
    // One whose end is beyond is told as such.
    let told = faults("G0 X640 Y-40 Z0\nG1 X680 Y-290 F3000\nM2\n", &legs);
    assert!(told.starts_with("E0507 line 2: joint h2 would have to go to"), "{told}");
    let told = faults("G0 X800 Y0 Z600\nG1 X810 Y50 F3000\nM2\n", &legs);
    assert!(told.starts_with("E0531 line 2: the point X 805.000 Y 25.000 Z 600.000 breaks the condition `spherical-1`"), "{told}");
    let mill = builtin("generic/mill3").unwrap();
    let told = faults("G0 X395 Y-10 Z-50\nG3 Y10 J10 F500\nM2\n", &mill);
    assert!(told.starts_with("E0530 line 2: ") && told.contains("at X 400.") && told.contains("joint X would have to go to 400."), "{told}");
}

/// The feed that E0508 tells fits, and hardly more would: joint speeds by positions six thousand times along the line.
#[test]
fn the_feed_that_is_told_fits() {
    use gr_robot::joints::{JointOptions, joint_path};
    let machine = cell();
    let program = |f: f64| format!("G21 G90\nT1 M6\nG0 X399.754 Y344.881 Z-287.353\nG1 X601.171 Y251.210 Z-232.390 F{f:.1}\nM2\n");
    let told = planned(&program(900_000.0), &machine).expect_err("J3 is too fast");
    let speed = told.iter().find(|d| d.code == gr_text::code::ROBOT_JOINT_SPEED).expect("E0508");
    let help = speed.help.clone().expect("the feed that fits");
    let fits: f64 = help.split_whitespace().find_map(|w| w.parse().ok()).unwrap_or_else(|| panic!("{help}"));
    let fine = planned(&program(fits), &machine).unwrap_or_else(|e| panic!("{}", messages(&e, &program(fits))));
    let length = (201.417f64.powi(2) + 93.671f64.powi(2) + 54.963f64.powi(2)).sqrt();
    let path = joint_path(&fine.program, &JointOptions { interval: Some(length / (fits / 60.0) / 6000.0), ..JointOptions::default() }).unwrap();
    let points: Vec<_> = path.points().collect();
    let cuts = points.windows(2).filter(|w| !w[1].rapid);
    let peak = cuts.flat_map(|w| (0..6).map(move |i| (w[1].joints[i] - w[0].joints[i]).abs() / w[1].seconds));
    let limit = machine.joints[2].speed.unwrap();
    let peak = peak.fold(0.0, f64::max);
    assert!(peak <= limit && peak > 0.997 * limit, "{} of {}", peak.to_degrees(), limit.to_degrees());
}

/// Blocks that become many pieces, and blocks that are run again: after one reading of the messages the program can be done, and
/// with a twentieth more it can't.
#[test]
fn the_feed_that_is_told_fits_all_pieces() {
    let file = "format = 1\nid = \"shop/slow\"\nextends = \"abb/irb2400\"\norientation = \"abc-euler-xyz\"\n[frames.part]\nposition = [1000, -200, 900]\n\
        [spindle]\nposition = [0, 0, 110]\nrotation = [0, 80, 0]\n[[tool]]\nnumber = 1\nname = \"m\"\nposition = [0, 0, 85]\n[home]\njoints = [0, -20, 20, 0, 60, 0]\n";
    let mut machine = gr_machine::parse(FileId(0), file).expect("a good machine file");
    machine.joints.iter_mut().for_each(|j| j.speed = Some(12f64.to_radians()));
    let cuts = [
        ("G1 X160 Y60 Z-10 A12 B8", 4253.0),
        ("G3 X100 Y150 Z-6 I40 J0", 0.0),
        ("G5 I20 J30 P-10 Q-30 X160 Y120", 0.0),
        ("O100 REPEAT [2]\nG1 X160 Y60\nG1 X40 Y240\nO100 ENDREPEAT\nG1 X200", 0.0),
    ];
    for (cut, expected) in cuts {
        let lines: Vec<&str> = cut.lines().collect();
        let program = |feeds: &[f64]| {
            let with = |(line, f): (&&str, &f64)| if line.starts_with('O') { (*line).to_string() } else { format!("{line} F{f:.1}") };
            let body: Vec<String> = lines.iter().zip(feeds).map(with).collect();
            format!("G21 G90 G54\nT1 M6\nG0 X100 Y150 Z50\nG1 Z0 F300\n{}\nG0 Z100\nM2\n", body.join("\n"))
        };
        let mut feeds = vec![60_000.0; lines.len()];
        let text = program(&feeds);
        for d in planned(&text, &machine).expect_err("too fast") {
            assert_eq!(d.code, gr_text::code::ROBOT_JOINT_SPEED, "{cut}: {}", d.message);
            let line = text[..d.primary().1.start as usize].matches('\n').count() - 4;
            let help = d.help.clone().expect("the feed that fits");
            feeds[line] = help.split_whitespace().find_map(|w| w.parse().ok()).unwrap_or_else(|| panic!("{help}"));
        }
        assert!(expected == 0.0 || (feeds[0] / expected - 1.0).abs() < 0.005, "{cut}: {feeds:?}");
        planned(&program(&feeds), &machine).unwrap_or_else(|e| panic!("{cut}: {feeds:?}\n{}", messages(&e, &program(&feeds))));
        let more: Vec<f64> = feeds.iter().map(|f| f * 1.05).collect();
        assert!(planned(&program(&more), &machine).is_err(), "{cut}: {more:?}");
    }
}

/// A tool beside the axis of the platform goes round with it: no place of it is worked out.
#[test]
fn a_tool_beside_the_platform() {
    let tool = |position: &str| {
        let text = format!("format = 1\nid = \"shop/legs\"\nextends = \"usp/2ups-prp\"\n[[tool]]\nnumber = 1\nname = \"mill\"\nposition = {position}\n");
        gr_machine::parse(FileId(0), &text).expect("a good machine file")
    };
    let text = "G21 G90\nT1 M6\nG43.1 Z60\nG0 X800 Y0 Z0\nG1 X810 F600\nM30\n";
    let told = faults(text, &tool("[10, 0, 60]"));
    assert!(told.starts_with("E0523 line 4: a tool beside the axis of a platform that turns with its place (`mill`) can't be done"), "{told}");
    assert!(faults(text, &tool("[0, 0, 60]")).starts_with("planned"), "{}", faults(text, &tool("[0, 0, 60]")));
}

/// Each condition of the parallel machine by its name.
#[test]
fn conditions_by_name() {
    let machine = gr_machine::reference("usp/2ups-prp").unwrap();
    let mut names = std::collections::BTreeSet::new();
    for x in (200..1500).step_by(25) {
        for y in (-900..=900).step_by(50) {
            for z in [-700, -400, 0, 400, 700] {
                let pose = gr_machine::Pose { position: [x, y, z].map(f64::from), rotation: [0.0; 3] };
                let k = machine.kinematics();
                for s in k.inverse(&pose).unwrap_or_default() {
                    names.extend(k.violations(&s.joints).into_iter().map(|v| v.name));
                }
            }
        }
    }
    insta::assert_snapshot!("conditions", names.into_iter().collect::<Vec<_>>().join("\n"));
}

/// The sixth joint has no 340° in one go where the cut needs them: an error, or a lift half way where the arm changes.
#[test]
fn a_change_on_request() {
    let text = "format = 1\nid = \"shop/round\"\nextends = \"abb/irb2400\"\n[home]\njoints = [0, 0, 0, 0, 30, 0]\n[[joint]]\nname = \"J6\"\nmin = -185\nmax = 165\n";
    let machine = gr_machine::parse(FileId(0), text).unwrap();
    let (s, c) = 170f64.to_radians().sin_cos();
    let program = format!("G0 X{0:.6} Y{1:.6} Z700\nG3 X{0:.6} Y{2:.6} I{3:.6} J{4:.6} F3000\nM30\n", 900.0 * c, -900.0 * s, 900.0 * s, -900.0 * c, 900.0 * s);
    let told = faults(&program, &machine);
    assert!(told.contains("E0520 line 2: the arm can't do the moves from line 1 to here in one configuration: joint J6"), "{told}");
    let texts = Texts::new([(FileId(0), program.as_str())]);
    let options = Options { reconfigure: Some(40.0), ..Options::default() };
    let p = plan(&motion(&program), &machine, &texts, &options).unwrap_or_else(|e| panic!("{}", messages(&e, &program)));
    insta::assert_snapshot!("a_change_on_request", self::told(&p));
}

/// Runs of comments, drills by the thousand and frames without end: time grows with the program only.
#[test]
fn long_programs() {
    let comments = format!("G64 P0.1\nT1 M6\nG0 X0 Y0 Z20\nG1 X50 F600\n{}G1 X60\nM30\n", "(nothing)\n".repeat(200_000));
    planned(&comments, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, &comments)));
    let mut holes = String::from("T1 M6\nG0 X0 Y0 Z20\nG1 X1 F3000\n");
    (0..10_000).for_each(|i| holes += &format!("G0 X{} Y{}\n", i % 50, i / 50 % 50));
    planned(&(holes + "M30\n"), &cell()).unwrap();
}

#[test]
fn more_frames_than_a_program_holds() {
    let mut text = String::from("T1 M6\nG0 X1 Y1 Z20\n");
    (0..70_000).for_each(|i| text += &format!("G10 L2 P1 X{:.3}\nG0 X{:.3}\n", f64::from(i) / 1000.0, f64::from(i % 10) / 10.0));
    text += "M30\n";
    let told = faults(&text, &builtin("generic/mill3").unwrap());
    assert!(told.contains("more than 65536 work frames"), "{}", &told[..told.len().min(300)]);
}

/// A panel's switches, a second spindle, an angle that is waited for.
#[test]
fn what_a_robot_does_not_do() {
    // Outputs that are on or off only.
    let mut cell = cell();
    cell.cell.io.remove("S");
    let on = gr_machine::Signal { signal: Some("doOrient".into()), value: Some(1.0), ..gr_machine::Signal::default() };
    cell.cell.io.insert("M19".into(), on.clone());
    cell.cell.io.insert("M101".into(), on);
    let mut out = String::new();
    let rows = ["M3 S8000\nS9000\nS9000 M4", "M19 R90", "M101 P3", "M49", "M50 P0\nM50 P1\nM50 P0", "M52 P1", "M48", "M19 R90 Q2", "M60", "M101 P3 Q4", "M101", "M66 P3 L3 Q2", "M66 P3 L0", "M66 E3 L0", "M67 E1 Q0.5"];
    for row in rows {
        let text = format!("T1 M6\nG0 X0 Y0 Z20\n{row}\nG1 X50 F600\nM30\n");
        out += &format!("{}: {}", row.replace('\n', " "), faults(&text, &cell));
    }
    insta::assert_snapshot!("what_a_robot_does_not_do", out);
}

/// Where the parallel machine's joints are within their limits but the mechanism is not.
#[test]
fn a_point_breaks_a_condition() {
    let machine = builtin("usp/2ups-prp").unwrap();
    let k = machine.kinematics();
    let broken = |x: f64, y: f64, z: f64| {
        let pose = gr_machine::Pose { position: [x, y, z], rotation: [0.0; 3] };
        k.inverse(&pose).is_ok_and(|all| {
            all.iter().any(|s| machine.outside(&s.joints).is_empty()) && all.iter().all(|s| !k.violations(&s.joints).is_empty())
        })
    };
    let grid = (0..=640).step_by(40).flat_map(|z| (0..1400).step_by(20).flat_map(move |x| (-600..=600).step_by(100).map(move |y| [x, y, z].map(f64::from))));
    let all: Vec<[f64; 3]> = grid.filter(|p| broken(p[0], p[1], p[2])).collect();
    let told: Vec<String> = all.iter().take(20).map(|[x, y, z]| faults(&format!("G0 X{x} Y{y} Z{z}\nG1 X{x} Y{y} Z{} F500\nM30\n", z + 1.0), &machine)).collect();
    let named = told.iter().find(|t| t.starts_with("E0531 line 1: the point X ") && t.contains(" breaks the condition `"));
    assert!(named.is_some(), "{} places: {told:?}", all.len());
}

/// Further and further out, the last place that the arm reaches is next to its stretched position.
#[test]
fn close_to_singular_is_told() {
    let text = "format = 1\nid = \"shop/far\"\nextends = \"abb/irb2400\"\n[home]\njoints = [0, 0, 0, 0, 30, 0]\n[[joint]]\nname = \"J3\"\nmin = -170\nmax = 170\n";
    let machine = gr_machine::parse(FileId(0), text).unwrap();
    let program = |x: f64| format!("G0 X{x:.4} Y0 Z700\nG1 Z699 F500\nM30\n");
    let (mut good, mut bad) = (900.0, 4000.0);
    for _ in 0..14 {
        let x = (good + bad) / 2.0;
        if planned(&program(x), &machine).is_ok() { good = x } else { bad = x }
    }
    let told = faults(&program(good), &machine);
    assert!(told.contains("E0527") && told.contains("comes close to a singular position: the arm is stretched but for "), "{told}");
}

/// The tool's way from line to line: no motion but the program's own.
fn own_moves(text: &str, machine: &Machine) -> Vec<(u32, bool, [f64; 3])> {
    let p = planned(text, machine).unwrap_or_else(|e| panic!("{}", messages(&e, text))).program;
    let mut out = Vec::new();
    for s in &p.steps {
        let (to, rapid) = match s.action {
            Action::Joint { to, .. } => (to, true),
            Action::Linear { to, rapid, .. } => (to, rapid),
            Action::Arc { to, .. } => (to, false),
            _ => continue,
        };
        if let Some(source) = s.source {
            out.push((source.line + 1, rapid, p.targets[to as usize].position.map(|v| (v * 1e6).round() / 1e6 + 0.0)));
        }
    }
    out
}

/// LinuxCNC moves nothing at G43 and G49: neither does the robot, whatever the offset does to the coordinates.
#[test]
fn a_tool_offset_moves_nothing() {
    let cell = cell();
    let off = "T1 M6 G43.1 Z85\nG0 X10 Y10 Z25\nG1 Z0 F600\nG1 X20\nG49\nG1 X30\nG2 X40 I5\nG0 X50\nG0 Z20\nM2\n";
    assert_eq!(own_moves(off, &cell), [
        (2, true, [10.0, 10.0, 25.0]),
        (3, false, [10.0, 10.0, 0.0]),
        (4, false, [20.0, 10.0, 0.0]),
        (6, false, [30.0, 10.0, 0.0]),
        (7, false, [40.0, 10.0, 0.0]),
        (8, true, [50.0, 10.0, 0.0]),
        (9, true, [50.0, 10.0, 20.0]),
    ]);
    let on = "T1 M6\nG0 X10 Y10 Z25\nG43.1 Z85\nG1 X20 F600\nG1 Z5\nG1 X30\nM2\n";
    assert_eq!(own_moves(on, &cell), [
        (2, true, [10.0, 10.0, 25.0]),
        (4, false, [20.0, 10.0, 25.0]),
        (5, false, [20.0, 10.0, 5.0]),
        (6, false, [30.0, 10.0, 5.0]),
    ]);
    // A rapid to a place while the offset is new, then G92 and another work offset on top of it.
    let more = "T1 M6 G43.1 Z85\nG0 X10 Y10 Z25\nG49\nG0 X20\nG92 X0\nG10 L2 P2 X5 Y5 Z1 R30\nG55\nG1 X50 Y0 F600\nM2\n";
    let z = own_moves(more, &cell).iter().map(|m| m.2[2]).collect::<Vec<_>>();
    assert_eq!(z, [25.0, 25.0, 24.0], "the same height, seen from G55");
    // A tool that the machine file doesn't have is as long as the offset: it goes on where it stands, in one go.
    let wear = "T9 M6 G43.1 Z85\nG0 X10 Y10 Z25\nG1 Z0 F600\nG43.1 Z84\nG1 X20\nG1 Z0\nM2\n";
    assert_eq!(own_moves(wear, &cell)[2..], [(5, false, [20.0, 10.0, 1.0]), (6, false, [20.0, 10.0, 0.0])]);
    let mut out = String::new();
    for (name, text) in [
        ("off", off),
        ("on", on),
        ("an arc that would be bent", "T1 M6 G43.1 Z85\nG0 X10 Y10 Z25\nG49\nG18 G2 X20 Z110 I5 F600\nM2\n"),
        ("another tool, no rapid", "T1 M6\nG0 X10 Y10 Z25\nG1 X20 F600\nT2 M6\nG1 X30\nM2\n"),
    ] {
        out += &format!("{name}:\n{}", faults(text, &cell));
    }
    insta::assert_snapshot!("tool_offsets", out);
}

/// Frames of the cell are elsewhere: a cut that begins there without a rapid is an error.
#[test]
fn a_cut_does_not_begin_elsewhere() {
    let file = include_str!("../../../docs/examples/irb2400-cell.toml");
    let more = "\n[[frame]]\nname = \"G54\"\nposition = [900, -100, 450]\n[[frame]]\nname = \"G55\"\nposition = [900, 200, 450]\n";
    let text = file.to_string() + more;
    let cell = gr_machine::parse(FileId(0), &text).unwrap_or_else(|e| panic!("{}", messages(&e, &text)));
    let bad = "T1 M6\nG0 X10 Y10 Z25\nG1 Z20 F600\nG55\nG1 X50\nM2\n";
    let told = faults(bad, &cell);
    assert!(told.starts_with("E0556 line 5"), "{told}");
    let good = "T1 M6\nG0 X10 Y10 Z25\nG1 Z20 F600\nG55\nG0 X10 Y10\nG1 X50\nM2\n";
    assert_eq!(own_moves(good, &cell)[2..], [(5, true, [10.0, 10.0, 20.0]), (6, false, [50.0, 10.0, 20.0])]);
}

/// A work frame turned about Z turns no tool: LinuxCNC has no axis for it.
#[test]
fn a_turned_work_frame_turns_no_tool() {
    for spindle in ["rotation = [0, 45, 0]", "rotation = [0, 0, 0]"] {
        let file = include_str!("../../../docs/examples/irb2400-cell.toml").replace("rotation = [0, 45, 0]", spindle);
        let cell = gr_machine::parse(FileId(0), &file).unwrap();
        let text = "T1 M6\nG0 X10 Y10 Z25\nG1 Z2 F1000\nG1 X100 Y10\nG10 L2 P2 X5 Y5 Z0 R30\nG55\nG0 Z30\nG0 X50 Y0\nG1 Z2\nG1 X60\nM2\n";
        let p = planned(text, &cell).unwrap_or_else(|e| panic!("{}", messages(&e, text))).program;
        let frames: Vec<_> = p.frames.iter().map(|f| f.frame).collect();
        let mut frame = 0;
        let mut before = None;
        for s in &p.steps {
            match s.action {
                Action::UseFrame(f) => frame = usize::from(f),
                Action::Linear { to, .. } => {
                    let turn = gr_machine::math::product(&frames[frame].turn, &gr_machine::math::turn_of(p.targets[to as usize].quaternion));
                    let last = before.replace(turn).unwrap_or(turn);
                    let turned = (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(|(i, j)| (last[i][j] - turn[i][j]).abs()).fold(0.0, f64::max);
                    assert!(turned < 1e-9 || s.source.is_some_and(|l| l.line + 1 == 9), "{turned} {s:?}");
                }
                _ => {}
            }
        }
    }
}

#[test]
fn probe_moves() {
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG38.2 Z-5 F120\nG0 Z5\nG38.3 X40 F60\nG1 X20 Y20 F600\nG38.5 Z9\nM30\n";
    insta::assert_snapshot!(told(&planned(text, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, text)))));
    // Without a row, and as joint positions.
    let mut bare = cell();
    bare.cell.io.remove("G38");
    assert_eq!(faults(text, &bare), "E0557 line 5: the machine file doesn't say which input the probe switches\n");
    let texts = Texts::new([(FileId(0), text)]);
    let found = plan(&motion(text), &cell(), &texts, &Options { own_words: true, probing: false, ..Options::default() }).expect_err("no joint positions");
    assert!(messages(&found, text).starts_with("E0523 line 5: a probe move in joint positions"), "{found:?}");
}

/// What depends on the place where a probe stopped is told at its line; what doesn't, is not.
#[test]
fn nothing_rests_on_where_a_probe_stopped() {
    let head = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG1 Z15 F600\nG38.2 Z-5 F120\n";
    let tail = "\nG0 X10 Y10 Z20\nM30\n";
    for bad in [
        "G0 X20", "G1 X20 F600", "G91 G0 Z5\nG90", "G91 G1 X5\nG90", "G2 X20 I5 F600", "G10 L20 P1 Z0", "G92 Z0", "G10 L20 P2 Z0", "#1=#5063", "#1=#5422", "#1=#<_z>",
        "#1=#<_abs_z>", "G93 G1 Z5 F10\nG94", "G38.3 X20 F60", "G28.1", "G28", "G28 X5", "G10 L10 P1 Z0", "G5.2 X20 Y0 P1 L3\nX30 Y10\nX40 Y0\nG5.3", "G10 L2 P1 R10\nG1 Z5 X20 F600", "G81 X20 Z0 R5 F600",
    ] {
        let text = format!("{head}{bad}{tail}");
        let found = planned(&text, &cell()).map(|p| told(&p)).map_err(|e| messages(&e, &text));
        let told = found.expect_err(bad);
        assert!(told.contains("E0533 line 7") || told.contains("E0533 line 8"), "{bad}: {told}");
    }
    for good in ["G0 Z5\nG1 X20", "G1 Z5 F600\nG2 X20 I5", "G38.3 Z-9 F60", "G1 X20 Y20 Z5 F600", "G53 G0 Z1000\nG0 Z5", "G28 Z5", "G10 L2 P2 X5", "G4 P1\nM8\nG0 Z-5", "#1=#5420", "G43 H1\nG0 Z5", "M3 S5000\nG0 Z5"] {
        let text = format!("{head}{good}{tail}");
        if let Err(e) = planned(&text, &cell()) {
            let told = messages(&e, &text);
            assert!(!told.contains("E0533"), "{good}: {told}");
        }
    }
}

/// Places of a machine tool, and what rests on coordinates that nothing has named.
#[test]
fn places_that_a_robot_cannot_know() {
    let told_of = |head: &str, block: &str| {
        let text = format!("{head}{block}\nG0 X10 Y10 Z40\nM30\n");
        planned(&text, &cell()).map_or_else(|e| messages(&e, &text), |p| messages(&p.warnings, &text))
    };
    let named = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\n";
    for (block, word) in [("G28", "G28"), ("G91 G28 Z0\nG90", "G28"), ("G30 Z0", "G30"), ("G53 G0 Z0", "G53"), ("G53 G1 X0 F100", "G53")] {
        assert_eq!(told_of(named, block), format!("E0558 line 5: {word} leads to a place of a machine tool, which a robot doesn't have\n"), "{block}");
    }
    // Without a tool length it would be the program's zero point: a warning. Else an error.
    let (bare, long) = ("G21 G90\nT1 M6\n", "G21 G90\nT1 M6\nG43.1 Z85\n");
    for (block, axes, zero, number) in [
        ("G1 X10 Y10 Z5 F100", "X Y Z", "X0 Y0 Z0", "X0 Y0 Z-85"),
        ("G0 Z20\nG1 X10 F100", "X Y", "X0 Y0", "X0 Y0"),
        ("G91 G0 X10 Y10 Z20\nG90", "X Y Z", "X0 Y0 Z0", "X0 Y0 Z-85"),
        ("G0 X10 Y10\nG2 X20 I5 F100", "Z", "Z0", "Z-85"),
        ("G92 X5 Z5", "X Z", "X0 Z0", "X0 Z-85"),
        ("G10 L20 P1 Z5", "Z", "Z0", "Z-85"),
    ] {
        let line = |head: &str| head.matches('\n').count() + 1 + usize::from(block.starts_with("G0 "));
        let wanted = |head: &str, place: &str| {
            format!(
                "E0559 line {}: no coordinate of the work frame before this says where the tool is in {axes}: it would be at {place}\n",
                line(head)
            )
        };
        assert_eq!(told_of(bare, block), wanted(bare, zero), "{block}");
        let told = told_of(long, block);
        assert!(told.contains(&wanted(long, number)), "{block}: {told}");
        let text = format!("{long}{block}\nG0 X10 Y10 Z40\nM30\n");
        assert_eq!(planned(&text, &cell()).is_err(), number.contains("-85"), "{block}");
    }
    for good in ["G0 X0 Y0 Z20\nG1 Z0 F100", "G0 Z20\nG0 X0 Y0\nG91 G1 Z-20 F100\nG90", "G10 L2 P1 X5", "G92.1", "G0 X10 Y10 Z20\nG92 X0"] {
        assert_eq!(told_of("G21 G90\nT1 M6\nG43 H1\n", good), "", "{good}");
    }
}

/// With a frame for them, places of the machine are the tool point's in it: what isn't named stays, also when the program's
/// coordinates change under it, and increments go on from there.
#[test]
fn places_of_the_machine_in_the_frame_g53() {
    let file = include_str!("../../../docs/examples/irb2400-cell.toml").to_string();
    let file = file.replace("[frames.part]\nposition = [0, 0, 50]\n", "");
    let with = |frame: &str| gr_machine::parse(FileId(0), &(file.clone() + frame)).expect("a good cell");
    // The part is turned by a quarter turn; 200 above its zero point and 50 beside it.
    let cell = with(
        "\n[[frame]]\nname = \"G53\"\nposition = [850, -50, 650]\n[frames.part]\nposition = [0, 0, 50]\nrotation = [0, 0, 90]\n",
    );
    let last = |text: &str, line: u32| {
        let p = planned(text, &cell).unwrap_or_else(|e| panic!("{}", messages(&e, text)));
        assert_eq!(messages(&p.warnings, text), "", "{text}");
        let to = p.program.steps.iter().rev().find_map(|s| match s.action {
            Action::Linear { to, .. } | Action::Joint { to, .. } if s.source.is_some_and(|s| s.line + 1 == line) => {
                Some(to)
            }
            _ => None,
        });
        p.program.targets[to.unwrap_or_else(|| panic!("{}", told(&p))) as usize]
            .position
            .map(|v| (v * 1e6).round() / 1e6 + 0.0)
    };
    let head = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\n";
    for (block, line, place) in [
        ("G91 G28 Z0\nG90", 5, [10.0, 10.0, 200.0]),
        ("G53 G0 Z-30", 5, [10.0, 10.0, 170.0]),
        ("G53 G1 X-40 F600", 5, [10.0, 10.0, 20.0]),
        ("G53 G0 Y-20 Z0", 5, [10.0, 30.0, 200.0]),
        ("G28", 5, [50.0, 50.0, 200.0]),
        ("G91 G28 Z0\nG28 X0 Y0\nG90", 6, [50.0, 50.0, 200.0]),
        ("G53 G0 Z0\nG91 G0 X5 Z-10\nG90", 6, [15.0, 10.0, 190.0]),
        ("G53 G0 Z0\nG49\nG0 X20", 7, [20.0, 10.0, 200.0]),
        ("G53 G0 Z0\nG10 L2 P1 Z5\nG0 X20", 7, [20.0, 10.0, 195.0]),
        ("G53 G0 Z0\nG1 X20 F600", 6, [20.0, 10.0, 200.0]),
        ("G53 G0 Z0\nG0 Z5", 6, [10.0, 10.0, 5.0]),
    ] {
        // There the tool is: no move.
        let text = format!("{head}{block}\nG0 X10 Y10 Z40\nM30\n");
        let line = if block.contains("X-40") { 4 } else { line };
        assert_eq!(last(&text, line), place, "{block}");
    }
    // Before the first move the tool is at no X and Y: it comes to the first at the height of the machine's Z0.
    let text = "G21 G90\nG91 G28 Z0\nG90\nT1 M6\nG0 X10 Y20\nG43 H1 Z30\nG1 Z0 F600\nG91 G28 Z0\nG28 X0 Y0\nM30\n";
    assert_eq!(
        (last(text, 5), last(text, 6), last(text, 8), last(text, 9)),
        ([10.0, 20.0, 200.0], [10.0, 20.0, 30.0], [10.0, 20.0, 200.0], [50.0, 50.0, 200.0])
    );
    let faults = |block: &str| faults(&format!("{head}{block}\nG0 X10 Y10 Z40\nM30\n"), &cell);
    assert_eq!(
        faults("G28.1\nG28"),
        "E0523 line 6: G28 to a place that the program stores itself (G28.1) can't be done by a robot program\n"
    );
    assert_eq!(
        faults("G53 G0 Z0\nG92 Z0"),
        "E0559 line 6: no coordinate of the work frame before this says where the tool is in Z: it would be at Z200\n"
    );
    assert_eq!(faults("G53 G0 Z5000").split(':').next(), Some("E0507 line 5"));
    // A rail moves the base away from them.
    let rail = "\n[[external]]\nname = \"E1\"\ntype = \"prismatic\"\ncarries = \"machine\"\naxis = [1, 0, 0]\nmin = 0\nmax = 3000\nposition = 100\n";
    let moved = with(&format!("\n[[frame]]\nname = \"G53\"\nposition = [950, -50, 650]\n{rail}"));
    assert_eq!(moved.cell.machine_zero(), Some([850.0, -50.0, 650.0]));
}

/// In a job the part is where the setup has it; places of the machine are not.
#[test]
fn places_of_the_machine_in_a_job() {
    let file = include_str!("../../../docs/examples/irb2400-cell.toml").to_string();
    let cell = gr_machine::parse(FileId(0), &(file + "\n[[frame]]\nname = \"G53\"\nposition = [950, -50, 650]\n"))
        .expect("a good cell");
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG1 Z0 F600\nG53 G0 Z0\nM30\n";
    let part = gr_machine::math::Frame::shift([920.0, -100.0, 480.0]);
    let setup = gr_robot::Setup {
        name: "one".into(),
        from_line: Some(0),
        workingsteps: Vec::new(),
        part: Some(part),
        place: gr_ir::Source::default(),
    };
    let texts = Texts::new([(FileId(0), text)]);
    let p = plan(&motion(text), &cell, &texts, &Options { setups: vec![setup], ..Options::default() })
        .unwrap_or_else(|e| panic!("{}", messages(&e, text)));
    let up = p.program.steps.iter().find_map(|s| match s.action {
        Action::Linear { to, .. } if s.source.is_some_and(|s| s.line == 5) => {
            Some(p.program.targets[to as usize].position)
        }
        _ => None,
    });
    assert_eq!(up.map(|p| p.map(|v| (v * 1e6).round() / 1e6)), Some([10.0, 10.0, 170.0]), "{}", told(&p));
}

/// While the operator clamps the part anew nothing spins or runs; then it does again as the program had it, before the tool comes.
#[test]
fn the_spindle_stands_while_the_part_is_clamped() {
    let order = |on: &str, off: &str| {
        let text = format!("G21 G90\nT1 M6\nG43 H1\n{on}\nG0 X10 Y10 Z20\nG1 Z0 F600\nG0 Z20\n{off}\nG0 X20 Y10\nG1 Z0\nG0 Z20\nM30\n");
        let setup = |name: &str, line: u32| gr_robot::Setup {
            name: name.into(),
            from_line: Some(line),
            workingsteps: Vec::new(),
            part: Some(cell().cell.part_in_base()),
            place: gr_ir::Source::default(),
        };
        let options = Options { setups: vec![setup("one", 0), setup("two", 8)], ..Options::default() };
        let p = plan(&motion(&text), &cell(), &Texts::new([(FileId(0), text.as_str())]), &options).unwrap_or_else(|e| panic!("{}", messages(&e, &text)));
        let steps = p.program.steps.iter().skip_while(|s| s.source.is_none_or(|s| s.line < 6)).filter_map(|s| match &s.action {
            Action::Signal { word, .. } => Some(word.to_string()),
            Action::WaitInput { .. } => Some("wait".into()),
            Action::Pause { .. } => Some("stop".into()),
            Action::Joint { .. } => Some("joint".into()),
            _ => None,
        });
        steps.take_while(|s| s != "joint").collect::<Vec<_>>().join(" ")
    };
    let spindle = order("M3 S5000", "");
    assert_eq!(spindle, "M5 stop M3 S5000 wait");
    assert_eq!(order("M3 S5000 M8", ""), "M5 M9 stop M3 S5000 wait M8");
    assert_eq!(order("M3 S5000 M8", "M5 M9"), "M5 M9 stop");
    assert_eq!(order("M8", ""), "M9 stop M8");
}

/// M2 in a cut: the tool is lifted before the spindle stops; what the program stops itself before, it stops there.
#[test]
fn the_spindle_turns_until_the_tool_is_out() {
    let order = |tail: &str| {
        let text = format!("G21 G90\nT1 M6\nG43 H1\nM3 S5000\nG0 X10 Y10 Z20\nG1 Z0 F600\n{tail}");
        let p = planned(&text, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, &text)));
        let steps = p.program.steps.iter().skip_while(|s| s.source.is_none_or(|s| s.line < 5)).filter_map(|s| match &s.action {
            Action::Linear { .. } => Some(if s.source.is_some() { "cut" } else { "lift" }),
            Action::Signal { word, .. } => Some(if word.code == "M5" { "stop" } else { "signal" }),
            _ => None,
        });
        steps.collect::<Vec<_>>().join(" ")
    };
    for tail in ["M2\n", "M30\n", "M5 M30\n", ""] {
        assert_eq!(order(tail), "cut lift stop", "{tail}");
    }
    assert_eq!(order("M5\nM30\n"), "cut stop lift");
}

/// A tapping cycle locks the overrides of itself: the warning names it, not words that nobody wrote.
#[test]
fn a_tapping_cycle_names_itself() {
    let told = |block: &str| faults(&format!("G21 G90\nT1 M6\nG43 H1\nM3 S5000\nG0 X10 Y10 Z20\n{block}\nG0 Z20\nM30\n"), &cell());
    let lock = "has no effect on a robot: its controller keeps the operator's speed override to itself\n";
    assert_eq!(told("G84 Z-5 R2 F500\nG80"), format!("planned\nE0548 line 6: the lock of feed and speed override in G84 {lock}"));
    assert_eq!(told("M50 P0"), format!("planned\nE0548 line 6: M50 P0 {lock}"));
}

/// An increment after a change of the offset goes on from where the tool stands.
#[test]
fn increments_after_a_change_of_the_offset() {
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z50\nG43.1 Z80\nG91 G0 Z-10\nX5 Z-5\nG90\nG0 X1\nG0 Z30\nM30\n";
    let mut cell = cell();
    cell.cell.tools.get_mut(&1).expect("a tool").frame.position[2] = 85.0;
    let p = planned(text, &cell).unwrap_or_else(|e| panic!("{}", messages(&e, text)));
    let places: Vec<_> = p
        .program
        .steps
        .iter()
        .filter_map(|s| match s.action {
            Action::Linear { to, .. } | Action::Joint { to, .. } => s
                .source
                .filter(|s| s.line > 3)
                .map(|_| p.program.targets[to as usize].position.map(|v| (v * 1e6).round() / 1e6)),
            _ => None,
        })
        .collect();
    assert_eq!(places, [[10.0, 10.0, 40.0], [15.0, 10.0, 35.0], [1.0, 10.0, 35.0], [1.0, 10.0, 30.0]], "{}", told(&p));
    assert!(messages(&p.warnings, text).contains("E0555 line 6"), "{}", messages(&p.warnings, text));
}

/// A program that ends with a probe goes back from there before it lifts, and never down to its height of approach.
#[test]
fn the_way_home_after_a_probe() {
    let lines = |last: &str| {
        let text = format!("G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z90\n{last}\nM30\n");
        let p = planned(&text, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, &text)));
        let place = |s: &gr_robot::Step| match s.action {
            Action::Linear { to, .. } if s.source.is_none() => Some(p.program.targets[to as usize].position.map(|v| (v * 1e6).round() / 1e6)),
            _ => None,
        };
        p.program.steps.iter().filter_map(place).collect::<Vec<_>>()
    };
    assert_eq!(lines("G38.2 Z-5 F120"), [[10.0, 10.0, 90.0], [10.0, 10.0, 140.0]]);
    assert_eq!(lines("G38.2 X30 F120"), [[10.0, 10.0, 90.0], [10.0, 10.0, 140.0]]);
    assert_eq!(lines("G38.4 Z99 F120"), [[10.0, 10.0, 99.0], [10.0, 10.0, 149.0]]);
}

/// The rapid after a probe is a line, however rapids are made.
#[test]
fn away_from_a_probe_in_a_line() {
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG64 P1\nG38.3 X40 F120\nG0 X39\nG38.3 X60\nG0 X30 Y60 Z40\nM30\n";
    let p = planned(text, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, text)));
    let after: Vec<_> = p.program.steps.iter().filter(|s| matches!(s.source.map(|s| s.line), Some(6 | 8))).map(|s| matches!(s.action, Action::Linear { rapid: true, .. })).collect();
    assert_eq!(after, [true, true], "{}", told(&p));
}

/// A joint that turns alone: up, on, down, by the sum of two ramps; cuts of a straight line the same; corners cost time.
#[test]
fn accelerations_count() {
    let file = include_str!("../../../docs/examples/irb2400-cell.toml");
    let with = |more: &str| gr_machine::parse(FileId(0), &format!("{file}{more}")).unwrap();
    let all = |a: f64| (1..=6).map(|i| format!("\n[[joint]]\nname = \"J{i}\"\nacceleration = {a}\n")).collect::<String>();
    let part = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG64 P2\nG1 Z0 F6000\nX60\nY60\nX10\nY10\nG61\nG1 X60\nY60\nG0 Z20\nM30\n";
    let times = |m: &Machine| {
        let s = planned(part, m).unwrap_or_else(|e| panic!("{}", messages(&e, part))).summary;
        (s.cut_seconds, s.rapid_seconds, s.accelerates)
    };
    let (plain, soft, hard, stiff) = (times(&cell()), times(&with(&all(100.0))), times(&with(&all(1e9))), times(&with(&all(1000.0))));
    assert!(!plain.2 && soft.2);
    assert!((hard.0 - plain.0).abs() < 1e-3 && (hard.1 - plain.1).abs() < 1e-3, "{plain:?} {hard:?}");
    assert!(plain.0 < stiff.0 && stiff.0 < soft.0 && plain.1 < stiff.1 && stiff.1 < soft.1, "{plain:?} {stiff:?} {soft:?}");
    // Rounded corners cost less than stops.
    let tight = part.replace("G64 P2", "G61");
    let stops = planned(&tight, &with(&all(100.0))).unwrap().summary.cut_seconds;
    assert!(soft.0 < stops - 0.1, "{} {stops}", soft.0);
}

/// A setup without a place leaves the machine file's frames in force; one with a place overrules them, and says so.
#[test]
fn frames_of_the_machine_in_a_job() {
    let file = include_str!("../../../docs/examples/irb2400-cell.toml").to_string();
    let vices = "\n[[frame]]\nname = \"G54\"\nposition = [955, -155, 455]\n[[frame]]\nname = \"G55\"\nposition = [940, -40, 470]\n";
    let cell = gr_machine::parse(FileId(0), &(file + vices)).expect("a good cell");
    let text = "G21 G90 G54\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG1 Z0 F600\nG0 Z20\nG55 G0 X10 Y10 Z20\nG1 Z0\nG0 Z20\nM30\n";
    let made = |text: &str, part: Option<[f64; 3]>| {
        let setup = gr_robot::Setup {
            name: "only".into(),
            from_line: Some(0),
            workingsteps: Vec::new(),
            part: part.map(gr_machine::math::Frame::shift),
            place: gr_ir::Source::default(),
        };
        plan(&motion(text), &cell, &Texts::new([(FileId(0), text)]), &Options { setups: vec![setup], ..Options::default() })
    };
    let places = |p: &Planned| p.program.frames.iter().map(|f| (f.name.clone(), f.frame.position)).collect::<Vec<_>>();
    let p = made(text, None).unwrap_or_else(|e| panic!("{}", messages(&e, text)));
    assert_eq!(places(&p), [("G54".into(), [955.0, -155.0, 455.0]), ("G55".into(), [940.0, -40.0, 470.0])]);
    assert_eq!(messages(&p.warnings, text), "");
    // Two vices at one place.
    let e = made(text, Some([920.0, -100.0, 480.0])).expect_err("two frames fall together");
    assert_eq!(messages(&e, text), "E0560 line 1: setup `only` places the part itself: the machine file's place for G54, G55 does not count in it, so they would all be at one place\n");
    assert_eq!(e[0].severity, gr_text::Severity::Error);
    let one = text.replace("G55 ", "");
    let p = made(&one, Some([920.0, -100.0, 480.0])).unwrap_or_else(|e| panic!("{}", messages(&e, &one)));
    assert_eq!(places(&p), [("G54".into(), [920.0, -100.0, 480.0])]);
    assert_eq!(messages(&p.warnings, &one), "E0560 line 1: setup `only` places the part itself: the machine file's place for G54 does not count in it\n");
}

/// Rotary words are those of the machine that the program was written for: what it has no axis for is an error, as on itself.
#[test]
fn rotary_words_that_nobody_reads() {
    let file = include_str!("../../../docs/examples/irb2400-cell.toml");
    let cell = |orientation: &str| {
        let text = format!("orientation = \"{orientation}\"\n{file}");
        gr_machine::parse(FileId(0), &text).unwrap_or_else(|e| panic!("{}", messages(&e, &text)))
    };
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 X100 Y100 Z60\nG0 A10 C20\nG1 Z40 F600\nG1 X120 A-15 C60\nG0 Z60\nM30\n";
    let no_axis = "E0553 line 5: generic/mill5-cb-head has no A axis: this move of A can't be made\n";
    assert_eq!(faults(text, &cell("source-machine:generic/mill5-cb-head")), no_axis);
    assert_eq!(faults(&text.replace('A', "B"), &cell("source-machine:generic/mill5-cb-head")).lines().next(), Some("planned"));
    let fixed = "E0509 line 5: the robot can't follow the rotary word A: its machine file keeps the tool's direction (`orientation = \"fixed\"`)\n";
    assert_eq!(faults(text, &cell("fixed")), fixed);
    // A tool that isn't there hides nothing of it.
    let both = text.replace("T1", "T7").replace("G43 H1\n", "");
    let said = faults(&both, &cell("fixed"));
    assert!(said.contains("E0521 line 3: ") && said.contains(&fixed.replace("line 5", "line 4")), "{said}");
}

/// A joint that is too fast is told beside moves that can't be done.
#[test]
fn speeds_are_looked_at_beside_other_errors() {
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 X0 Y0 Z20\nG1 Z0 F600\nG1 X2500 F1000\nG0 Z20\nG0 X0 Y0\nG1 Z0 F600\nG1 X300 F200000\nG0 Z20\nM30\n";
    let said = faults(text, &cell());
    let codes: Vec<&str> = said.lines().filter_map(|l| l.split(':').next()).collect();
    assert_eq!(codes, ["E0507 line 6", "E0504 line 7", "E0508 line 10"], "{said}");
    let alone = faults(&text.replace("X2500", "X250"), &cell());
    assert!(alone.starts_with("E0508 line 10: "), "{alone}");
}

/// A jump is told where it is, not at the next look.
#[test]
fn a_jump_is_told_at_its_place() {
    let more = "\n[[tool]]\nnumber = 1\nname = \"t\"\nposition = [0, 0, 100]\n[[joint]]\nname = \"J2\"\nmin = -180\nmax = 180\n[[joint]]\nname = \"J3\"\nmin = -180\nmax = 180\n[[joint]]\nname = \"J5\"\nmin = -200\nmax = 200\n";
    let file = format!("format = 1\nid = \"t/over\"\nextends = \"abb/irb2400\"\n[frames.part]\nposition = [0, 0, 1500]\n{more}");
    let machine = gr_machine::parse(FileId(0), &file).unwrap_or_else(|e| panic!("{}", messages(&e, &file)));
    let said = faults("G21 G90\nT1 M6\nG0 X-300 Y0 Z20\nG1 Z0 F600\nG1 X300\nG0 Z20\nM2\n", &machine);
    assert!(said.starts_with("E0520 line 5: ") && said.contains("X 0.000 Y 0.000 Z 0.000"), "{said}");
}

/// After a change of the offset a coordinate that a move names is one also where the program believes the tool there already.
#[test]
fn a_named_coordinate_is_reached_also_where_it_is_believed() {
    let text = "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z50\nG43.1 X5 Z10\nG0 X5 Y10 Z30\nG1 Z5 F600\nM30\n";
    let p = planned(text, &cell()).unwrap_or_else(|e| panic!("{}", messages(&e, text)));
    let places = |line: u32| -> Vec<[f64; 3]> {
        let steps = p.program.steps.iter().filter(|s| s.source.is_some_and(|s| s.line + 1 == line));
        let place = |s: &gr_robot::Step| match s.action {
            Action::Linear { to, .. } | Action::Joint { to, .. } => Some(p.program.targets[to as usize].position.map(|v| (v * 1e6).round() / 1e6)),
            _ => None,
        };
        steps.filter_map(place).collect()
    };
    assert_eq!((places(6), places(7)), (vec![[5.0, 10.0, 30.0]], vec![[5.0, 10.0, 5.0]]), "{}", told(&p));
    assert!(!messages(&p.warnings, text).contains("E0555"), "{}", messages(&p.warnings, text));
}

/// The same on a five-axis mill: where its tilted tool is changed, and before its first move with a part that is clamped turned.
#[test]
fn mills_go_to_named_coordinates_after_a_tool_change() {
    let machine = |rotation: &str| {
        let tools = [75.2, 102.4].into_iter().enumerate().map(|(i, z)| format!("[[tool]]\nnumber = {}\nname = \"t{i}\"\nposition = [0, 0, {z}]\n", i + 1));
        let text = format!(
            "format = 1\nid = \"t/m\"\nextends = \"generic/mill5-ac-table\"\n[frames.part]\nposition = [10, 20, -100]\nrotation = {rotation}\n{}",
            tools.collect::<String>()
        );
        gr_machine::parse(FileId(0), &text).unwrap_or_else(|e| panic!("{}", messages(&e, &text)))
    };
    let tip = |text: &str, machine: &Machine| {
        let p = planned(text, machine).unwrap_or_else(|e| panic!("{}", messages(&e, text)));
        assert!(!messages(&p.warnings, text).contains("E0555"), "{}", messages(&p.warnings, text));
        let cut = |s: &gr_robot::Step| match s.action {
            Action::Linear { to, rapid: false, .. } => Some(p.program.targets[to as usize].position.map(|v| (v * 1e6).round() / 1e6 + 0.0)),
            _ => None,
        };
        p.program.steps.iter().filter_map(cut).collect::<Vec<_>>()
    };
    let two = "G21 G90\nT1 M6 G43 H1\nS1000 M3\nG0 X5 Y5 Z50 A-20 C30\nG1 Z0 F100\nG0 Z80\nM5\nT2 M6 G43 H2\nM3\nG0 X5 Y5 Z50\nG1 Z0 F100\nG0 Z80\nM5\nM2\n";
    assert_eq!(tip(two, &machine("[0, 0, 0]")), [[5.0, 5.0, 0.0]; 2]);
    let first = "G21 G90\nT1 M6 G43 H1\nS1000 M3\nG0 X0 Y0 Z50\nG1 Z0 F100\nG0 Z50\nM5\nM2\n";
    assert_eq!(tip(first, &machine("[0, 0, 30]")), [[0.0; 3]]);
}
