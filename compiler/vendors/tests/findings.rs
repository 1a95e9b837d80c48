//! What can't be written is said, at its line, and nothing is written then.

mod common;
use common::*;
use gr_ir::Texts;
use gr_machine::Signal;
use gr_robot::{Action, Zone};
use gr_text::{FileId, Severity};
use gr_vendors::{Options, Output};

fn one(target: &str, m: Action) -> Output {
    let (id, home, _) = robot_of(target);
    let mut b = Builder::new(machine(id), home);
    b.add(&Move::Other(m));
    run(target, &b, true)
}

fn run(target: &str, b: &Builder, allow_unverified: bool) -> Output {
    let sources = Texts::new([(FileId(0), "T1\nG54\nthe line\nanother\n")]);
    gr_vendors::language(target).unwrap().emit(&b.program, &sources, &Options { allow_unverified, decimals: None })
}

fn signal_of(word: &str, value: Option<f64>, signal: Signal) -> Action {
    Action::Signal { word: word.into(), value, signal }
}

/// The findings as text, with their place; checks that an error stops everything.
fn told(output: &Output) -> String {
    let errors = output.findings.iter().any(|f| f.severity == Severity::Error);
    assert_eq!(errors, output.files.is_empty());
    output.findings.iter().map(|f| format!("{:?} {} at {:?}: {}\n", f.severity, f.code.def().code, f.primary().1, f.message)).collect()
}

#[test]
fn every_finding() {
    let mut all = String::new();
    let mut note = |what: &str, output: Output| all += &format!("{what}\n{}\n", told(&output));
    let (id, home, _) = robot_of("vplus");
    note("E0620 unverified", run("vplus", &Builder::new(machine(id), home), false));
    note("E0621 a signal without a number", one("krl", signal_of("M3", None, signal("doSpindle"))));
    note("E0621 a signal that is no name", one("rapid", signal_of("M3", None, signal("do spindle"))));
    note("E0622 nothing to switch", one("rapid", signal_of("M8", None, Signal::default())));
    let mut b = Builder::new(gr_machine::builtin("kuka/kr16-2").unwrap(), robot_of("krl").1);
    b.add(&Move::Other(signal_of("S", Some(9000.0), signal("AO[1]"))));
    note("E0623 speed of an unknown spindle", run("krl", &b, true));
    note("E0623 too fast", one("urscript", signal_of("S", Some(30000.0), signal("AO[1]"))));
    let line = |speed: f64, zone: Option<f64>| Move::Line { shift: [5.0, 0.0, 0.0], turn: [0.0; 3], speed, zone };
    let moved = |target: &str, m: Move| {
        let (id, home, _) = robot_of(target);
        let mut b = Builder::new(machine(id), home);
        assert!(b.add(&m));
        run(target, &b, true)
    };
    note("E0624 rounded feed", moved("inform", line(1000.0 / 60.0, None)));
    note("E0624 in the unit that rounds least", moved("fanuc-ls", line(33.37, None)));
    note("E0625 too slow", moved("fanuc-ls", line(0.01, None)));
    note("E0625 no speed", moved("rapid", line(0.0, None)));
    note("E0626 a helix", moved("rapid", Move::Helix { radius: 5.0, angle: 90.0, rise: 2.0, speed: 10.0 }));
    let (id, home, _) = robot_of("urscript");
    let mut b = Builder::new(machine(id), home);
    for i in 0..2600 {
        b.add(&Move::Line { shift: [if i % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0], turn: [0.0; 3], speed: 10.0, zone: None });
    }
    note("E0627 a long script", run("urscript", &b, true));
    let (id, home, _) = robot_of("kawasaki-as");
    let mut b = Builder::new(machine(id), home);
    for i in 0..200 {
        b.add(&Move::Line { shift: [if i % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0], turn: [0.0; 3], speed: 10.0, zone: None });
    }
    b.program.machine.cell.controller.lines = Some(100);
    note("E0635 longer than the machine file allows", run("kawasaki-as", &b, true));
    b.program.machine.cell.controller.lines = None;
    b.program.machine.cell.controller.bytes = Some(5000);
    note("E0635 bytes", run("kawasaki-as", &b, true));
    let (id, home, _) = robot_of("rapid");
    let mut b = Builder::new(machine(id), home);
    b.program.name = "module".into();
    b.program.tools[0].name = "Fräser größer als alle anderen Fräser".into();
    note("E0628 names", run("rapid", &b, true));
    let mut b = Builder::new(machine(id), home);
    assert!(b.add(&line(10.0, None)));
    b.program.targets[0].position[1] = f64::NAN;
    note("E0629 no number", run("rapid", &b, true));
    note("E0630 another kind of machine", run("rapid", &Builder::new(machine("adept/one"), robot_of("vplus").1), true));
    note("E0631 a whole turn and more", {
        let mut b = Builder::new(machine("kuka/kr16-2"), &[10.0, -80.0, 85.0, 349.0, 60.0, -30.0]);
        assert!(b.add(&Move::Joint { by: [1.0, 1.0, 1.0, 0.5, 1.0, 1.0], share: 0.1 }));
        b.program.targets[0].joints[3] = 6.4;
        run("krl", &b, true)
    });
    note("E0632 no such thing", one("val3", Action::Pause { optional: false }));
    note("E0633 letters", one("rapid", Action::Message("Fräser wechseln".into())));
    note("E0634 optional stop", one("rapid", Action::Pause { optional: true }));
    note("E0637 corners", moved("inform", line(10.0, Some(0.5))));
    note("E0640 a rail", run("rapid", &on_rail(None), true));
    note("E0641 an axis that the language has no word for", run("inform", &on_turntable("inform", 20.0), true));
    insta::assert_snapshot!(all);
    for code in 620..=637 {
        assert!(all.contains(&format!(" E0{code} at")), "E0{code} is never raised");
    }
}

/// Points count where programs aren't split, an arc as two; a number that a routine can't take is told.
#[test]
fn points_and_numbers_of_routines() {
    let codes = |out: &Output| out.findings.iter().filter(|f| f.severity == Severity::Error).map(|f| f.message.clone()).collect::<Vec<_>>();
    for target in ["kawasaki-as", "denso-pac", "melfa", "pdl2", "spel", "nachi", "vplus"] {
        let (id, home, _) = robot_of(target);
        let mut b = Builder::new(machine(id), home);
        for i in 0..18 {
            assert!(b.add(&Move::Line { shift: [if i % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0], turn: [0.0; 3], speed: 10.0, zone: None }));
        }
        // Home, the lines, and home again.
        let points = 1 + b.program.targets.len() as u64;
        b.program.machine.cell.controller.points = Some(points);
        assert_eq!(codes(&run(target, &b, true)), [] as [String; 0], "{target}");
        b.program.machine.cell.controller.points = Some(15);
        let told = codes(&run(target, &b, true));
        assert!(told.len() == 1 && told[0].starts_with("the program has more points; the controller takes 15"), "{target}: {told:?}");
    }
    let routine = |target: &str, value: Option<f64>| {
        let call = Signal { routine: Some("20".into()), signal: None, ..signal("x") };
        codes(&one(target, signal_of("S", value, call)))
    };
    for target in ["nachi", "delmia-xml"] {
        assert!(routine(target, None).is_empty(), "{target}");
        let told = routine(target, Some(3000.0));
        assert!(told.len() == 1 && told[0].ends_with("a number for a routine"), "{target}: {told:?}");
    }
}

/// An arm at 700 on its rail.
fn on_rail(coupled: Option<bool>) -> Builder {
    let (id, home, _) = robot_of("rapid");
    let mut b = Builder::new(machine(id), home);
    let joint = gr_machine::Joint {
        name: "E1".into(),
        kind: gr_machine::JointKind::Prismatic,
        ..b.program.machine.joints[0].clone()
    };
    let rail = gr_machine::External {
        joint,
        carries_machine: true,
        axis: [1.0, 0.0, 0.0],
        point: [0.0; 3],
        position: 700.0,
        coupled,
    };
    b.program.machine.cell.external.push(rail);
    for t in b.program.targets.iter_mut().chain([&mut b.program.home]) {
        t.joints[6] = 700.0;
    }
    b
}

/// The frames of a control that counts the rail are those of the base at 0, others those of the base as it stands; the program
/// says which.
#[test]
fn frames_on_a_rail() {
    let line = |coupled, wanted: &str| {
        let out = run("rapid", &on_rail(coupled), true);
        let text = out.files.iter().map(|f| String::from_utf8_lossy(&f.bytes).to_string()).collect::<String>();
        text.lines().find(|l| l.contains(wanted)).unwrap_or_else(|| panic!("{text}")).trim().to_string()
    };
    let x = |coupled| {
        let line = line(coupled, "wobjdata G54");
        line.split("[[")
            .nth(1)
            .and_then(|t| t.split(',').next())
            .and_then(|n| n.parse::<f64>().ok())
            .unwrap_or_else(|| panic!("{line}"))
    };
    assert!((x(Some(true)) - x(Some(false)) - 700.0).abs() < 1e-9 && x(None) == x(Some(false)));
    assert_eq!(
        line(Some(true), "E1 carries"),
        "! E1 carries the robot and is at 700 mm. Work frames: from the base at 0; the control must count E1 in poses"
    );
    assert!(line(None, "E1 carries").ends_with("must not count E1 in poses"));
    assert!(run("rapid", &on_rail(Some(false)), true).findings.iter().all(|f| f.code.def().code != "E0640"));
}

/// A part on a turntable that stands at so many degrees.
fn on_turntable(target: &str, at: f64) -> Builder {
    let (id, home, _) = robot_of(target);
    let file = format!(
        "format = 1\nid = \"shop/turned\"\nextends = \"{id}\"\n[[external]]\nname = \"E1\"\ntype = \"revolute\"\ncarries = \"part\"\nmin = -180\nmax = 180\nposition = {at}\n"
    );
    let machine = gr_machine::parse(gr_text::FileId(0), &file).unwrap_or_else(|e| panic!("{e:?}"));
    let mut b = Builder::new(machine, home);
    assert!(b.add(&Move::Line { shift: [10.0, 0.0, 0.0], turn: [0.0; 3], speed: 10.0, zone: None }));
    b
}

/// Languages without external axes say where these have to stand, in the program and beside it; at 0 too. The others have the value.
#[test]
fn external_axes_that_stand_are_told() {
    for (target, at, place) in [("urscript", 20.0, "20°"), ("inform", 20.0, "20°"), ("inform", 0.0, "0°"), ("kawasaki-as", 20.0, "20°")] {
        let out = run(target, &on_turntable(target, at), true);
        let told: Vec<&str> = out.findings.iter().filter(|f| f.code.def().code == "E0641").map(|f| f.message.as_str()).collect();
        let [message] = told.as_slice() else { panic!("{target}: {told:?}") };
        assert!(message.starts_with(&format!("`E1` must stand at {place} before the program starts")), "{message}");
        let text = out.files.iter().map(|f| String::from_utf8_lossy(&f.bytes).into_owned()).collect::<String>();
        assert!(text.contains("E1 carries the part: it must") && text.contains(&format!("stand at {at} degrees")), "{target}: {text}");
    }
    assert!(run("rapid", &on_turntable("rapid", 20.0), true).findings.iter().all(|f| f.code.def().code != "E0641"));
}

/// Names of instructions, functions and data types of RAPID are renamed like reserved words.
#[test]
fn names_that_rapid_has_itself() {
    let (id, home, _) = robot_of("rapid");
    let mut b = Builder::new(machine(id), home);
    b.program.name = "Load".into();
    b.program.tools[0].name = "MoveL".into();
    b.program.tools[1].name = "offs".into();
    let found = run("rapid", &b, true).findings;
    let told: Vec<_> = found.iter().filter(|f| f.code.def().code == "E0628").map(|f| f.message.as_str()).collect();
    assert_eq!(told.len(), 3, "{told:?}");
    assert!(told[0].contains("Load_2") && told[1].contains("MoveL_2") && told[2].contains("offs_2"), "{told:?}");
}

/// Statements of SPEL+ and PAC are no names of programs, nor of routines.
#[test]
fn names_that_are_statements() {
    for (target, words) in [("spel", ["tool", "local", "Speed", "Arc3"]), ("denso-pac", ["speed", "set", "ChangeTool", "move"])] {
        for word in words {
            let (id, home, _) = robot_of(target);
            let mut b = Builder::new(machine(id), home);
            b.program.name = word.into();
            let out = run(target, &b, true);
            let other = format!("{}_2", if target == "spel" { word.to_string() } else { word.to_lowercase() });
            assert!(out.findings.iter().any(|f| f.code.def().code == "E0628" && f.message.contains(&other)), "{target} {word}: {}", told(&out));
            assert!(String::from_utf8_lossy(&out.files[0].bytes).contains(&other));
            let called = |name: &str| one(target, signal_of("M6", None, Signal { routine: Some(name.into()), ..Signal::default() }));
            assert!(told(&called(word)).contains("E0621") && told(&called(word)).contains("it is a word of the language"), "{target} {word}: {}", told(&called(word)));
            assert!(!told(&called("SPSPEED")).contains("E0621"), "{target}");
        }
    }
}

/// Errors have room of their own beside any number of warnings.
#[test]
fn warnings_hide_no_error() {
    let (id, home, _) = robot_of("inform");
    let mut b = Builder::new(machine(id), home);
    for i in 0..3000 {
        let shift = [if i % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0];
        b.add(&Move::Line { shift, turn: [0.0; 3], speed: 10.0 + 0.0123 * f64::from(i), zone: None });
    }
    assert_eq!(run("inform", &b, true).findings.iter().find(|f| f.severity == Severity::Error), None);
    b.add(&Move::Other(signal_of("M8", None, Signal::default())));
    let output = run("inform", &b, true);
    assert!(output.files.is_empty());
    assert_eq!(output.findings.iter().filter(|f| f.severity != Severity::Error).count(), 1000);
    assert!(output.findings.iter().any(|f| f.code.def().code == "E0622"));
}

#[test]
fn damaged_programs_do_not_panic() {
    for target in TARGETS {
        let mut p = sample(target);
        p.steps.insert(2, p.steps[4].clone());
        p.steps.insert(0, gr_robot::Step { action: Action::Linear { to: 9999, speed: 1.0, zone: Zone::Stop, rapid: false }, source: None });
        assert!(emit(target, &p).files.is_empty(), "{target}");
        let mut p = sample(target);
        p.steps.insert(0, gr_robot::Step { action: Action::UseTool(77), source: None });
        p.steps.insert(0, gr_robot::Step { action: Action::UseFrame(77), source: None });
        emit(target, &p);
        let mut p = sample(target);
        for t in &mut p.targets {
            t.joints = [f64::INFINITY; gr_robot::MAX_JOINTS];
        }
        assert!(emit(target, &p).files.is_empty(), "{target}");
        let mut p = sample(target);
        p.tools.clear();
        p.frames.clear();
        emit(target, &p);
    }
}

/// An analog output keeps its value, whatever the row of the machine file says a digital one would be.
#[test]
fn an_analog_output_stays_analog() {
    let word = gr_robot::Word::numbered("M67", 'E', 1).with('Q', 0.5);
    let action = Action::Signal { word, value: Some(0.5), signal: Signal { value: Some(1.0), ..signal("aoFlow") } };
    let output = one("rapid", action);
    let text = String::from_utf8(output.files[0].bytes.clone()).unwrap();
    assert!(text.contains("SetAO aoFlow,0.5;"), "{text}");
}

/// No file is longer than the machine file allows, whatever the lines are.
#[test]
fn parts_keep_their_length() {
    for target in ["rapid", "krl", "fanuc-ls", "inform"] {
        let (id, home, names) = robot_of(target);
        let mut b = Builder::new(machine(id), home);
        b.program.machine.cell.controller.lines = Some(40);
        b.program.machine.cell.controller.points = Some(30);
        for i in 0..40 {
            b.add(&Move::Joint { by: [0.01, 0.02, 0.03, 0.02, 0.03, 0.01], share: 0.1 + 0.01 * f64::from(i) });
            b.add(&Move::Line { shift: [1.0, 0.0, 0.0], turn: [0.0; 3], speed: 10.0 + f64::from(i), zone: None });
            b.add(&Move::Other(Action::Comment("a remark of some length, which has to be wrapped where lines are short and not otherwise".into())));
            (0..i % 7).for_each(|_| {
                b.add(&Move::Other(signal_of("M8", None, signal(names[3]))));
                b.add(&Move::Other(Action::WaitInput { name: names[2].into(), on: true, timeout: Some(2.0) }));
                b.add(&Move::Other(Action::Message("look".into())));
            });
        }
        let output = run(target, &b, true);
        assert!(output.files.len() > 3, "{target}: {:?}", output.findings);
        for file in &output.files {
            let text = String::from_utf8_lossy(&file.bytes);
            // The statements: between head and end, or between /MN and /POS, NOP and END.
            let body: Vec<&str> = match target {
                "fanuc-ls" => text.lines().skip_while(|l| *l != "/MN").skip(1).take_while(|l| *l != "/POS").filter(|l| !l.starts_with("    :")).collect(),
                "inform" => text.lines().skip_while(|l| *l != "NOP").take_while(|l| *l != "END").collect(),
                _ => text.lines().collect(),
            };
            assert!(body.len() <= 40 || file.name.ends_with(".pgf") || main_file(target, &text), "{target} {}: {} lines\n{text}", file.name, body.len());
        }
    }
}

/// The file that calls the parts.
fn main_file(target: &str, text: &str) -> bool {
    match target {
        "rapid" => text.contains("PROC main()"),
        "krl" => text.contains("INITMOV"),
        _ => text.contains("CALL"),
    }
}

/// RAPID has no share of the joint speed: the speed of the tool point that is written makes its way in the time that the joints take.
#[test]
fn joint_moves_of_rapid_take_the_time_of_their_share() {
    use gr_machine::math::{norm, sub};
    let (id, home, _) = robot_of("rapid");
    let mut b = Builder::new(machine(id), home);
    for by in [[30.0, 10.0, -20.0, 15.0, 10.0, 40.0], [-60.0, 5.0, 10.0, -30.0, 20.0, -90.0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]] {
        assert!(b.add(&Move::Joint { by, share: 0.3 }));
    }
    let out = run("rapid", &b, true);
    let text: String = out.files.iter().map(|f| String::from_utf8_lossy(&f.bytes).into_owned()).collect();
    let moves = text.lines().filter(|l| l.trim().starts_with("MoveJ "));
    let speeds: Vec<f64> = moves.map(|l| l.split("\\V:=").nth(1).and_then(|v| v.split(',').next()).and_then(|v| v.parse().ok()).unwrap_or_else(|| panic!("{l}"))).collect();
    assert_eq!(speeds.len(), 3, "{text}");
    let (kinematics, tool) = (b.program.machine.kinematics(), b.program.tools[0].frame);
    let mut from = b.program.home.joints;
    for (target, speed) in b.program.targets.iter().zip(speeds) {
        let at = |k: i32| {
            let q: Vec<f64> = (0..6).map(|i| from[i] + (target.joints[i] - from[i]) * f64::from(k) / 2000.0).collect();
            kinematics.forward_frame(&q).unwrap().then(&tool).position
        };
        let way: f64 = (1..=2000).map(|k| norm(sub(at(k), at(k - 1)))).sum();
        let joints = b.program.machine.joints.iter().enumerate();
        let seconds = joints.map(|(i, j)| (target.joints[i] - from[i]).abs() / (0.3 * j.top_rapid())).fold(0.0, f64::max);
        assert!(way > 1.0 && (way / speed - seconds).abs() < 2e-3 * seconds, "{way} mm at {speed} mm/s instead of {seconds} s");
        from = target.joints;
    }
}
