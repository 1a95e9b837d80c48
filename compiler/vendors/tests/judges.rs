//! Judges that are not ours: Python reads URScript (as Python, after a plain respelling) and every XML file, and the
//! `robomath` module of PyPI's `robodk` 6.0.2 says what the angles of each maker mean.
//!
//! Needs `python3` with `pip`; installs `robodk` into a folder of the build when it is missing. Without them the tests
//! are left out, but not where `CI` is set.

mod common;
use common::*;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Runs a Python program with text as its input; none = there is no Python.
fn python(program: &str, input: &str) -> Option<String> {
    let site = site();
    let child = Command::new("python3")
        .arg("-c")
        .arg(program)
        .env("PYTHONPATH", &site)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let Ok(mut child) = child else { return missing("python3") };
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let out = child.wait_with_output().unwrap();
    assert!(out.status.success(), "{}\n{}", String::from_utf8_lossy(&out.stderr), input);
    Some(String::from_utf8(out.stdout).unwrap())
}

fn missing(what: &str) -> Option<String> {
    assert!(std::env::var_os("CI").is_none(), "{what} is missing");
    eprintln!("left out: {what} is missing");
    None
}

fn site() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("python-robodk-6.0.2")
}

/// Whether `robomath` can be imported; installs it where it is missing.
fn robodk() -> bool {
    let there = |site: &PathBuf| site.join("robodk").join("robomath.py").is_file();
    if !there(&site()) {
        let _ = Command::new("python3")
            .args(["-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check", "robodk==6.0.2", "--target"])
            .arg(site())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
    }
    there(&site()) || missing("robodk 6.0.2").is_some()
}

#[test]
fn python_reads_urscript() {
    let (_, home, _) = robot_of("urscript");
    let mut b = Builder::new(machine("universal-robots/ur5"), home);
    b.add(&Move::Other(gr_robot::Action::WaitInput { name: "DI[2]".into(), on: true, timeout: Some(2.0) }));
    b.add(&Move::Other(gr_robot::Action::Pause { optional: false }));
    for p in [sample("urscript"), b.program] {
        let script = texts(&emit("urscript", &p)).pop().unwrap().1;
        // Poses are a type of their own (`p[...]`), and blocks end with `end`.
        let program = "import sys, ast, re\ntext = sys.stdin.read()\nout = []\n\
                       for line in text.splitlines():\n    if line.strip() != 'end': out.append(re.sub(r'\\bp\\[', '[', line))\n\
                       tree = ast.parse('\\n'.join(out))\n\
                       calls = [n.func.id for n in ast.walk(tree) if isinstance(n, ast.Call)]\n\
                       print(' '.join(sorted(set(calls))))";
        if let Some(names) = python(program, &script) {
            assert!(names.contains("movej"), "{names}");
        }
    }
}

#[test]
fn an_xml_parser_reads_every_xml_file() {
    for target in ["rapid", "val3", "delmia-xml"] {
        let mut p = sample(target);
        p.tools[0].name = "a<b>&\"c\"".into();
        for (name, text) in texts(&emit(target, &p)) {
            if [".pgf", ".pjx", ".dtx", ".pgx", ".xml"].iter().any(|e| name.ends_with(e)) {
                python("import sys, xml.dom.minidom\nxml.dom.minidom.parseString(sys.stdin.buffer.read())", &text);
            }
        }
    }
}

/// Poses as each language writes them, turned into a matrix by `robomath`, equal the pose that was meant.
#[test]
fn robomath_agrees_with_every_convention() {
    use gr_machine::math::euler;
    if !robodk() {
        return;
    }
    let turns = [[3.1, 0.2, 0.5], [-2.9, -0.4, 2.0], [2.8, 0.6, -1.0], [-3.0, 0.05, -2.7], [3.14, -0.3, 1.5]];
    let mut input = String::new();
    for (target, read) in [
        ("rapid", "quaternion_2_pose(v[3:7])"),
        ("krl", "KUKA_2_Pose(v[:6])"),
        ("fanuc-ls", "Fanuc_2_Pose(v[:6])"),
        ("inform", "Motoman_2_Pose(v[:6])"),
        ("val3", "Staubli_2_Pose(v[:6])"),
        ("kawasaki-as", "Adept_2_Pose(v[:6])"),
        ("pdl2", "Comau_2_Pose(v[:6])"),
        ("nachi", "nachi(v, m)"),
        ("urscript", "UR_2_Pose([1000*v[0],1000*v[1],1000*v[2]]+v[3:6])"),
    ] {
        for turn in turns {
            let m = euler(turn);
            let written = numbers_of(target, quaternion(&m));
            let matrix: Vec<String> = m.iter().flatten().map(|v| format!("{v:.12}")).collect();
            input += &format!("{target}|{read}|{}|{}\n", written.iter().map(f64::to_string).collect::<Vec<_>>().join(","), matrix.join(","));
        }
    }
    let program = "import sys\nfrom robodk.robomath import *\n\
        def nachi(v, m):\n    p = Mat([m[0:3]+[v[0]], m[3:6]+[v[1]], m[6:9]+[v[2]], [0,0,0,1]])\n    \
        assert max(abs(a - b) for a, b in zip(Pose_2_Nachi(p), v)) < 1e-3\n    return p\n\
        n = 0\n\
        for row in sys.stdin:\n    target, read, v, m = row.strip().split('|')\n    v = [float(x) for x in v.split(',')]\n    \
        m = [float(x) for x in m.split(',')]\n    p = eval(read)\n    \
        off = max(abs(p[i, j] - m[3*i+j]) for i in range(3) for j in range(3))\n    \
        assert off < 2e-5, (row, off)\n    n += 1\nprint(n)";
    if let Some(n) = python(program, &input) {
        assert_eq!(n.trim(), "45");
    }
}

/// The numbers of the first straight move of a program that goes to (100, 50, 5) with a turn.
fn numbers_of(target: &str, q: [f64; 4]) -> Vec<f64> {
    use gr_robot::{Action, Zone};
    let (id, home, _) = robot_of(target);
    let mut b = Builder::new(machine(id), home);
    assert!(b.add(&Move::Line { shift: [5.0, 0.0, 0.0], turn: [0.0; 3], speed: 10.0, zone: None }));
    b.program.targets[0].position = [100.0, 50.0, 5.0];
    b.program.targets[0].quaternion = q;
    b.program.frames[0].frame = gr_machine::math::Frame::IDENTITY;
    b.program.steps.retain(|s| matches!(s.action, Action::Linear { .. } | Action::UseFrame(_) | Action::UseTool(_)));
    assert!(b.program.steps.iter().any(|s| matches!(s.action, Action::Linear { zone: Zone::Stop, .. })));
    let all: String = texts(&emit(target, &b.program)).iter().map(|f| f.1.clone()).collect();
    let mark = match target {
        "rapid" => "MoveL ",
        "krl" => "LIN {",
        "fanuc-ls" => "P[2]{",
        "inform" => "C00001=",
        "val3" => "type=\"pointRx\"",
        "kawasaki-as" => "LMOVE ",
        "pdl2" => "LINEAR TO ",
        "nachi" => "M1X,L,",
        _ => "movel(",
    };
    let at = all.find(mark).unwrap_or_else(|| panic!("{target}\n{all}")) + mark.len();
    let head: String = match target {
        // Behind the configuration, or behind the key of the value.
        "fanuc-ls" => all[at..].split_once("\tX =").unwrap().1.into(),
        "val3" => all[at..].split_once("key=\"0\"").unwrap().1.into(),
        _ => all[at..].into(),
    };
    head.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-')).filter_map(|t| t.parse().ok()).take(7).collect()
}

/// A long URScript program becomes scripts that are run one after the other: each keeps to the limits, stops at its end and
/// looks at its beginning whether the tool is where the one before left it.
#[test]
fn urscript_in_parts() {
    let (id, home, _) = robot_of("urscript");
    let mut b = Builder::new(machine(id), home);
    for i in 0..200 {
        b.add(&Move::Line { shift: [if i % 2 == 0 { 5.0 } else { -5.0 }, 0.0, 0.1], turn: [0.0; 3], speed: 10.0, zone: Some(1.0) });
    }
    b.program.machine.cell.controller.lines = Some(60);
    let files = texts(&emit("urscript", &b.program));
    assert!(files.len() > 3, "{}", files.len());
    let pose = |line: &str| line.split_once("p[").unwrap().1.split(']').next().unwrap().to_string();
    for (i, (name, text)) in files.iter().enumerate() {
        assert!(name.ends_with(&format!("_{:03}.script", i + 1)), "{name}");
        assert!(text.lines().count() <= 60, "{name}: {}", text.lines().count());
        let last = text.lines().rfind(|l| l.contains("move")).unwrap();
        assert!(last.contains("r=0)") || last.contains("movej"), "{last}");
        assert_eq!(text.lines().filter(|l| l.contains("movel(") && l.contains("r=0)")).count(), 1, "{name} stops at its end alone");
        if i > 0 {
            let before = files[i - 1].1.lines().rfind(|l| l.contains("movel(")).unwrap();
            let guard = text.lines().find(|l| l.contains("point_dist(")).unwrap();
            assert_eq!(pose(guard.split_once("pose(),").unwrap().1), pose(before), "{name}");
            assert!(text.find("set_tcp(").unwrap() < text.find("point_dist(").unwrap());
        }
    }
    insta::assert_snapshot!("urscript_part", files[1].1.lines().take(10).collect::<Vec<_>>().join("\n"));
}
