//! Robots from the command line: build, check, verify, import.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn run(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gcc-robot")).args(args).current_dir(root()).output().expect("the command runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

const PART: &str = "docs/examples/bracket.ngc";
const CELL: &str = "docs/examples/irb2400-cell.toml";

#[test]
fn rapid_of_the_example() {
    let folder = tempfile::tempdir().unwrap();
    let out = format!("{}/", folder.path().display());
    let made = run(&["build", PART, "--machine", CELL, "--target", "rapid", "-o", &out]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    insta::assert_snapshot!("rapid_summary", text(&made.stderr));
    let mut names: Vec<String> = std::fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    let main = names.iter().find(|n| n.ends_with(".mod")).unwrap_or_else(|| panic!("{names:?}"));
    let program = std::fs::read_to_string(folder.path().join(main)).unwrap();
    assert_eq!(program.matches("MoveC ").count(), 10, "arcs stay arcs");
    assert!(names.iter().any(|n| n.ends_with(".pgf")), "{names:?}");
}

#[test]
fn nothing_is_written_with_errors() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("far.ngc");
    std::fs::write(&source, "T1 M6\nG0 X0 Y0 Z20\nG1 X5000 F500\nM30\n").unwrap();
    let out = folder.path().join("out.mod");
    let made = run(&["build", source.to_str().unwrap(), "--machine", CELL, "--target", "rapid", "-o", out.to_str().unwrap()]);
    assert_eq!(made.status.code(), Some(1));
    assert!(!out.exists());
    let checked = run(&["check", source.to_str().unwrap(), "--machine", CELL, "--message-format", "short"]);
    assert_eq!(checked.status.code(), Some(1));
    assert!(text(&checked.stdout).contains("far.ngc:3:") || text(&checked.stderr).contains("far.ngc:3:"), "{}{}", text(&checked.stdout), text(&checked.stderr));
}

/// What an output of the cell cannot say is told or said otherwise: switches that are on and off, numbers of outputs.
#[test]
fn rows_of_outputs() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let cell = std::fs::read_to_string(root().join(CELL)).unwrap();
    let rows = "[io.M50]\nsignal = \"doOvr\"\n[io.M53]\nsignal = \"doHold\"\nvalue = 0\n[io.M62]\nsignal = \"doAny\"\n[io.M63P2]\nsignal = \"doTwo\"\nvalue = 0\nwait = \"diTwo\"\n[io.M68]\nsignal = \"aoAny\"\n[io.M68P3]\nsignal = \"aoThree\"\n";
    let cell = put("cell.toml", &format!("{cell}\n{rows}"));
    let of = |words: &str| {
        let part = put("part.ngc", &format!("G21 G90 T1 M6\nG0 X0 Y0 Z20\n{words}\nG1 X5 F600\nM30\n"));
        let out = folder.path().join("part.mod");
        _ = std::fs::remove_file(&out);
        let made = run(&["build", &part, "--machine", &cell, "--target", "rapid", "-o", out.to_str().unwrap(), "-q", "--message-format", "short"]);
        let set = |l: &&str| l.trim_start().starts_with("Set") || l.contains("diTwo");
        let program = std::fs::read_to_string(&out).unwrap_or_default();
        let sets: Vec<String> = program.lines().filter(set).filter_map(|l| l.split('!').next()).map(|l| l.trim().to_string()).filter(|l| l.contains("Ovr") || l.contains("Hold") || l.contains("Any") || l.contains("Two") || l.contains("Three")).collect();
        if made.status.success() { sets.join(" ") } else { text(&made.stderr).lines().filter(|l| l.contains("error[")).collect::<Vec<_>>().join(" ") }
    };
    assert_eq!(of("M49\nG1 X1 F600\nM48"), "SetDO doOvr,0; SetDO doOvr,1;");
    assert_eq!(of("M53 P0\nG1 X1 F600\nM53 P1"), "SetDO doHold,1; SetDO doHold,0;");
    assert_eq!(of("M62 P2\nG1 X1 F600\nM63 P2\nM68 E3 Q2.5"), "SetDO doTwo,1; SetDO doTwo,0; WaitDI diTwo,1; SetAO aoThree,2.5;");
    for word in ["M62 P1", "M68 E1 Q2"] {
        let told = of(word);
        assert!(told.contains("E0523") && told.contains(&format!("the number of {word}")), "{word}: {told}");
    }
}

#[test]
fn joint_targets() {
    for (target, beside) in [("joint-gcode", ["-cartesian.csv", "-joint.csv"]), ("setpoints", [".bin", ".bin"])] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("part.txt");
        let made = run(&["build", PART, "--machine", CELL, "--target", target, "-o", out.to_str().unwrap()]);
        assert!(made.status.success(), "{}", text(&made.stderr));
        let read = |end: &str| std::fs::read(folder.path().join(format!("part{end}"))).unwrap_or_else(|e| panic!("{end}: {e}"));
        let program = text(&read(".txt"));
        if target == "setpoints" {
            let rows: Vec<&str> = program.lines().skip(1).collect();
            // A head of 28 bytes; then six angles, six speeds, six accelerations as f64.
            let bytes = read(beside[0]);
            assert_eq!((bytes.len(), &bytes[..4]), (28 + rows.len() * 144, &b"GRSP"[..]));
            let home: Vec<&str> = rows[0].split(',').skip(1).step_by(3).collect();
            assert_eq!(home, ["0.000000", "-20.000000", "20.000000", "0.000000", "60.000000", "0.000000"]);
            for (i, degrees) in [0.0, -20.0, 20.0, 0.0, 60.0, 0.0f64].into_iter().enumerate() {
                let at = 28 + 8 * i;
                let first = f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
                assert!((first - degrees.to_radians()).abs() < 1e-12, "J{}: {first}", i + 1);
            }
            continue;
        }
        let [space, joints] = beside.map(|end| text(&read(end)));
        assert_eq!(space.lines().next(), Some("t,X,Y,Z,A,B,C"));
        assert_eq!(joints.lines().take(2).collect::<Vec<_>>(), ["t,J1,J2,J3,J4,J5,J6", "0,0,-20,20,0,60,0"]);
        assert_eq!(space.lines().count(), joints.lines().count());
        // Each row of the table is a move of the program, its joints in the words of LinuxCNC.
        let moves: Vec<String> = program.lines().filter_map(|l| Some(l.strip_prefix("G1 ")?.split_once(" F")?.0.to_string())).collect();
        let rows: Vec<String> = joints
            .lines()
            .skip(1)
            .map(|l| l.split(',').skip(1).zip("XYZABC".chars()).map(|(v, w)| format!("{w}{v}")).collect::<Vec<_>>().join(" "))
            .collect();
        assert!(rows.len() > 300 && moves == rows, "{} moves, {} rows", moves.len(), rows.len());
    }
}

#[test]
fn verify_reports() {
    let folder = tempfile::tempdir().unwrap();
    let made = run(&["verify", PART, "--machine", CELL, "-o", folder.path().to_str().unwrap()]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let table = text(&made.stdout);
    assert!(table.contains("points on example/irb2400-cell; error = target − reached, µm"), "{table}");
    for axis in ["X", "Y", "Z"] {
        let row = table.lines().find(|l| l.starts_with(&format!("{axis} "))).unwrap_or_else(|| panic!("{table}"));
        let [mean, upper, lower] = row.split_whitespace().skip(1).map(|v| v.parse::<f64>().unwrap()).collect::<Vec<_>>()[..] else { panic!("{row}") };
        assert!(lower <= mean && mean <= upper && upper.abs() < 1e-6 && lower.abs() < 1e-6, "{row}");
    }
    for end in ["errors.csv", "errors.svg", "joints.svg", "speeds.svg"] {
        assert!(folder.path().join(format!("bracket-{end}")).is_file(), "{end}");
    }
}

/// One direction of the spindle at a time: whichever way it turned before, or not at all.
#[test]
fn a_spindle_turns_one_way() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("s.ngc");
    let made = |spindle: &str| {
        std::fs::write(&source, format!("G21 G90 G54\nT1 M6\n{spindle}\nG0 X30 Y30 Z10\nG1 X40 F500\nM5\nM2\n")).unwrap();
        let o = run(&["build", source.to_str().unwrap(), "--machine", CELL, "--target", "rapid"]);
        assert!(o.status.success(), "{}", text(&o.stderr));
        text(&o.stdout).matches("SetDO doSpindleCw,1").count()
    };
    assert_eq!([made("S5000 M4"), made("S5000 M3"), made("S5000 M3\nM5\nM4")], [0, 1, 1]);
}

/// A job gives the second half of a program to another clamping.
#[test]
fn setups_of_a_job() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("two.ngc");
    std::fs::write(&source, "T1 M6\nG0 X0 Y0 Z20\nG1 Z0 F500\nX50\nG0 Z30\nG0 X0 Y0 Z20\nG1 Z0\nX50\nM30\n").unwrap();
    let job = folder.path().join("job.toml");
    std::fs::write(&job, "[[setup]]\nname = \"top\"\nfrom_line = 1\n[[setup]]\nname = \"turned\"\nfrom_line = 6\nposition = [0, 100, 0]\nrotation = [0, 0, 90]\n").unwrap();
    let args = |job: &str| run(&["build", source.to_str().unwrap(), "--machine", CELL, "--target", "rapid", "--job", job]);
    let made = args(job.to_str().unwrap());
    assert!(made.status.success(), "{}", text(&made.stderr));
    assert!(text(&made.stdout).contains("setup turned"), "{}", text(&made.stdout));
    std::fs::write(&job, "[[setup]]\nname = \"top\"\n").unwrap();
    let bad = args(job.to_str().unwrap());
    assert_eq!(bad.status.code(), Some(1));
    assert!(text(&bad.stderr).contains("needs `from_line` or `workingsteps`"), "{}", text(&bad.stderr));
}

/// A restart in a later setup needs none of those that are done; one that comes after it must still begin.
#[test]
fn a_restart_in_a_later_setup() {
    let folder = tempfile::tempdir().unwrap();
    let (source, job) = (folder.path().join("two.ngc"), folder.path().join("job.toml"));
    std::fs::write(&source, "G21 G90 G54\nT1 M6\nG43 H1\nG0 X10 Y20 Z20\nG1 Z0 F600\nG0 Z20\nG54 G0 X0 Y0 Z20\nG1 Z5 F700\nG0 Z20\nM5\nM2\n").unwrap();
    let told = |more: &str, line: &str| {
        std::fs::write(&job, format!("[[setup]]\nname = \"a\"\nfrom_line = 1\n[[setup]]\nname = \"b\"\nfrom_line = 7\n{more}")).unwrap();
        let o = run(&["build", source.to_str().unwrap(), "--machine", CELL, "--target", "rapid", "--job", job.to_str().unwrap(), "--from-line", line]);
        (o.status.success(), text(&o.stderr))
    };
    for line in ["5", "7", "8", "9", "10"] {
        for place in ["", "position = [0, 50, 0]\n"] {
            let (made, told) = told(place, line);
            assert!(made, "{line}: {told}");
        }
    }
    // The way to the line is of its setup too: nothing is clamped anew behind it.
    std::fs::write(&job, "[[setup]]\nname = \"a\"\nfrom_line = 1\n[[setup]]\nname = \"b\"\nfrom_line = 7\n").unwrap();
    let made = run(&["build", source.to_str().unwrap(), "--machine", CELL, "--target", "rapid", "--job", job.to_str().unwrap(), "--from-line", "9"]);
    assert!(made.status.success() && !text(&made.stdout).contains("setup b"), "{}", text(&made.stdout));
    let (made, told) = told("[[setup]]\nname = \"c\"\nfrom_line = 11\n", "7");
    assert!(!made && told.contains("E0551") && told.contains("`c` never begins"), "{told}");
}

/// `check` asks the robot with the same setups as `build`.
#[test]
fn check_takes_a_job() {
    let folder = tempfile::tempdir().unwrap();
    let (source, job) = (folder.path().join("two.ngc"), folder.path().join("job.toml"));
    std::fs::write(&source, "T1 M6\nG43 H1\nG0 X0 Y0 Z20\nG1 Z0 F500\nX50\nG0 Z30\nG0 X0 Y0 Z20\nG1 Z0\nX50\nM30\n").unwrap();
    let check = |place: &str, more: &[&str]| {
        std::fs::write(&job, format!("[[setup]]\nname = \"top\"\nfrom_line = 1\n[[setup]]\nname = \"far\"\nfrom_line = 7\nposition = {place}\n")).unwrap();
        let args = ["check", source.to_str().unwrap(), "--message-format", "short", "--job", job.to_str().unwrap()];
        let made = run(&[&args[..], more].concat());
        (made.status.code(), text(&made.stderr) + &text(&made.stdout))
    };
    let near = check("[0, 50, 0]", &["--machine", CELL]);
    assert_eq!(near.0, Some(0), "{}", near.1);
    let far = check("[0, 5000, 0]", &["--machine", CELL]);
    assert!(far.0 == Some(1) && far.1.contains("E0504"), "{}", far.1);
    let bad = check("[0, 50]", &["--machine", CELL]);
    assert!(bad.0 == Some(1) && bad.1.contains("job.toml") && bad.1.contains("E055"), "{}", bad.1);
    let alone = check("[0, 50, 0]", &[]);
    assert!(alone.0 == Some(2) && alone.1.contains("--job needs --machine"), "{:?}", alone);
}

/// `check` has the part of a mill where its file or a job puts it, and the axes where rotary words turn the tool.
#[test]
fn check_knows_where_a_mill_stands() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let told = |command: &str, base: &str, place: &str, program: &str, more: &[&str]| {
        std::fs::write(path("m.toml"), format!("format = 1\nid = \"t/m\"\nextends = \"{base}\"\n{place}")).unwrap();
        std::fs::write(path("a.ngc"), format!("G21 G90 G54\nS1000 M3\n{program}\nM5\nM2\n")).unwrap();
        let made = run(&[&[command, &path("a.ngc"), "--machine", &path("m.toml"), "--message-format", "short"], more].concat());
        (made.status.code(), text(&made.stderr) + &text(&made.stdout))
    };
    let left = "[frames.table]\nposition = [-300, 0, -100]\n";
    let good = (Some(0), "no findings in 1 file\n".to_string());
    let right = "G0 X0 Y0 Z10\nG0 X600\nG1 Y20 F300";
    assert_eq!(told("check", "generic/mill3", left, right, &[]), good);
    let built = told("build", "generic/mill3", left, right, &["--target", "joint-gcode", "--strict"]);
    assert!(built.0 == Some(0) && !built.1.contains("E0285"), "{}", built.1);
    let (code, found) = told("check", "generic/mill3", left, "G0 X0 Y0 Z10\nG0 X-150\nG1 Y20 F300", &[]);
    assert!(code == Some(1) && found.contains("a.ngc:4:1: error[E0507]: joint X would have to go to"), "{found}");
    // Where nobody says where the part is, it is a warning.
    let (code, found) = told("check", "generic/mill3", "", right, &[]);
    assert!(code == Some(0) && found.contains("warning[E0285]") && !found.contains("E0507"), "{found}");
    let (code, found) = told("check", "generic/mill5-ac-table", "", "G0 X0 Y0 Z-200\nG1 A-125 C0 F300", &[]);
    assert!(code == Some(0) && found.contains("a.ngc:4:1: warning[E0507]: joint A would have to go to"), "{found}");
    let (code, found) = told("check", "generic/mill5-ac-table", "[frames.table]\nposition = [0, 0, -300]\n", "G0 X0 Y0 Z10\nG0 A-20\nG0 X500", &[]);
    assert!(code == Some(1) && found.contains("a.ngc:5:1: error[E0507]: joint X would have to go to"), "{found}");
    // What only other targets can't do is no matter of the mill's own control.
    assert_eq!(told("check", "generic/mill3", left, "G0 X0 Y0 Z10\nG1 X300 F90000\nG33.1 Z5 K1", &[]).0, Some(0));
    let job = |place: &str| std::fs::write(path("job.toml"), format!("[[setup]]\nname = \"a\"\nfrom_line = 1\nposition = {place}\n")).unwrap();
    for (place, code, more) in [("[-300, 0, -100]", 0, "no findings"), ("[-100, 0, -100]", 1, "error[E0507]: joint X would have to go to")] {
        job(place);
        let found = told("check", "generic/mill3", "", right, &["--job", &path("job.toml")]);
        assert!(found.0 == Some(code) && found.1.contains(more) && !found.1.contains("E0285"), "{place}: {}", found.1);
        let (proved, said) = told("verify", "generic/mill3", "", right, &["--job", &path("job.toml")]);
        assert!(proved == Some(code) && said.contains(if code == 0 { "the same motion" } else { more }), "{place}: {said}");
    }
    // Predicted times have the axis that really moves.
    let slow = |place: &str| told("build", "unb/router", &format!("{place}[[joint]]\nname = \"Y\"\nspeed = 2\nrapid = 2\n"), "G0 Z20\nG0 X100\nG0 Z0\nG1 X101 F100", &["--target", "sheet"]).1;
    let time = |sheet: &str| sheet.lines().find(|l| l.starts_with("Time ")).map(|l| l.split_once("rapids ").unwrap().1[..7].to_string()).unwrap_or_else(|| panic!("{sheet}"));
    let turned = slow("[frames.table]\nposition = [300, 100, 0]\nrotation = [0, 0, 90]\n");
    assert!(time(&turned).as_str() > "0:00:50" && time(&slow("")).as_str() < "0:00:40", "{turned} {}", slow(""));
    let between = slow("[frames.table]\nposition = [300, 100, 0]\nrotation = [0, 0, 40]\n");
    assert!(between.contains("Times are estimates without acceleration; rapids at 6000 mm/min."), "{between}");
}

/// No joint of an arm goes faster than `--joint-speed`: a cut that would is an error, a rapid is slower.
#[test]
fn joints_no_faster_than_asked() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.ngc");
    let build = |most: &str| run(&["build", PART, "--machine", CELL, "--target", "joint-gcode", "--message-format", "short", "--joint-speed", most, "-o", out.to_str().unwrap()]);
    let slow = build("1");
    assert!(!slow.status.success() && text(&slow.stderr).contains("error[E0508]: joint J3 would have to turn at 1.5") && !out.exists(), "{}", text(&slow.stderr));
    assert_eq!(build("0").status.code(), Some(2));
    let most = 3.0;
    let made = build("3");
    assert!(made.status.success(), "{}", text(&made.stderr));
    let table = std::fs::read_to_string(folder.path().join("a-joint.csv")).unwrap();
    let rows: Vec<Vec<f64>> = table.lines().skip(1).map(|l| l.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    let speeds = rows.windows(2).flat_map(|w| (1..7).map(move |i| (w[1][i] - w[0][i]).abs() / (w[1][0] - w[0][0])));
    let fastest = speeds.filter(|v| v.is_finite()).fold(0.0, f64::max);
    assert!(fastest > 0.99 * most && fastest < most * (1.0 + 1e-3), "{fastest}");
}

const PROBED: &str = "compiler/cli/tests/fixtures/probe.p21";

/// `check` asks the machine about STEP-NC files as well, with the setups of a job.
#[test]
fn check_asks_about_stepnc() {
    let folder = tempfile::tempdir().unwrap();
    let job = folder.path().join("job.toml");
    let check = |args: &[&str]| {
        let made = run(&[&["check", PROBED, "--message-format", "short"], args].concat());
        (made.status.code(), text(&made.stderr) + &text(&made.stdout))
    };
    let of_job = |place: &str, step: &str| {
        let setups = format!("[[setup]]\nname = \"only\"\nworkingsteps = [\"{step}\"]\nposition = {place}\n");
        std::fs::write(&job, setups).unwrap();
        check(&["--machine", CELL, "--job", job.to_str().unwrap()])
    };
    let near = check(&["--machine", CELL]);
    assert_eq!(near.0, Some(0), "{}", near.1);
    let bare = check(&["--machine", "abb/irb140"]);
    assert!(bare.0 == Some(1) && bare.1.contains("probe.p21:44:") && bare.1.contains("E0521"), "{}", bare.1);
    let placed = of_job("[0, 50, 0]", "drill the hole");
    assert_eq!(placed.0, Some(0), "{}", placed.1);
    let far = of_job("[0, 5000, 0]", "drill the hole");
    assert!(far.0 == Some(1) && far.1.contains("E0504") && far.1.contains("probe.p21:44:"), "{}", far.1);
    let unknown = of_job("[0, 50, 0]", "turn it");
    assert!(unknown.0 == Some(1) && unknown.1.contains("job.toml") && unknown.1.contains("turn it"), "{}", unknown.1);
}

/// A restart of a plan names the axes that it brings somewhere: the others stay where nobody knows they are.
#[test]
fn a_plan_from_a_line_on() {
    let part = "docs/examples/stepnc/case-study.p21";
    let made = |machine: &str, target: &str| {
        let o = run(&["build", part, "--machine", machine, "--target", target, "--from-line", "105", "-o", "-"]);
        assert!(o.status.success(), "{}", text(&o.stderr));
        text(&o.stdout)
    };
    let rapid = made(CELL, "rapid");
    let first: Vec<&str> = rapid.lines().filter(|l| l.contains("Move") && l.contains("[[") && !l.contains("MoveAbsJ")).take(2).collect();
    assert!(first.iter().all(|l| l.contains("[[-3,19.5,")), "{first:?}");
    let mill = made("generic/mill3", "joint-gcode");
    let (up, over) = (mill.lines().position(|l| l.starts_with("G0 ")).expect("a rapid"), mill.lines().filter(|l| l.starts_with("G0 ")).nth(1));
    assert!(mill.lines().nth(up).is_some_and(|l| l.contains("X0 Y0 ")) && over.is_some_and(|l| l.contains("X-3 Y19.5 ")), "{mill}");
}

/// Behind a tool change the length of the tool before is in force until G43: across that is no matter.
#[test]
fn the_length_of_the_tool_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let tool = |n: u32, length: u32| format!("[[tool]]\nnumber = {n}\nname = \"t{n}\"\nposition = [0, 0, {length}]\ndiameter = 6\n");
    let machine = format!("format = 1\nid = \"shop/mill\"\nextends = \"generic/mill3\"\n[frames.table]\nposition = [-100, -50, -300]\n{}{}", tool(1, 60), tool(2, 80));
    std::fs::write(path("m.toml"), machine).unwrap();
    std::fs::write(path("a.tbl"), "T1 P1 Z60 D6\nT2 P2 Z80 D6\n").unwrap();
    let part = |height: &str| format!("G21 G90 G54\nG53 G0 Z0\nT1 M6\nG0 X10 Y10\nG43 H1 Z15\nG1 Z-1 F200\nG0 Z15\nG53 G0 Z0\nT2 M6\nG0 X20 Y20\n{height}\nG1 Z-1\nG0 Z15\nM30\n");
    let told = |height: &str| {
        std::fs::write(path("a.ngc"), part(height)).unwrap();
        let o = run(&["build", &path("a.ngc"), "--machine", &path("m.toml"), "-t", &path("a.tbl"), "--target", "joint-gcode", "-o", "-"]);
        assert!(o.status.success(), "{}", text(&o.stderr));
        text(&o.stderr).matches("E0525").count()
    };
    assert_eq!((told("G43 Z15 H2"), told("G0 Z15")), (0, 1));
}

/// A plan that probes goes on from named places, whatever is measured.
#[test]
fn a_plan_that_probes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("probe.mod");
    let made = run(&["build", PROBED, "--machine", CELL, "--target", "rapid", "-o", out.to_str().unwrap()]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    assert!(text(&made.stderr).contains("what it measures ('top') changes no motion"), "{}", text(&made.stderr));
    let program = std::fs::read_to_string(&out).unwrap();
    let at = program.find("Probe_2 diProbe,0,TRUE,[[50,50,-5]").expect("the probe move");
    let next = program[at..].lines().nth(1).expect("a line");
    assert!(next.trim().starts_with("MoveL [[50,50,5]"), "{next}");
}

/// A program that probes is verified like any other, and refused as joint positions.
#[test]
fn probes_are_verified() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("touch.ngc");
    std::fs::write(&source, "G21 G90\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG38.2 Z-5 F120\nG0 Z20\nM30\n").unwrap();
    let call = |args: &[&str]| {
        let made = run(&[args, &[source.to_str().unwrap(), "--machine", CELL, "--message-format", "short"]].concat());
        (made.status.code(), text(&made.stderr) + &text(&made.stdout))
    };
    let (verified, checked) = (call(&["verify"]), call(&["check"]));
    assert!(verified.0 == Some(0) && verified.1.contains("6 points"), "{}", verified.1);
    assert_eq!(checked.0, Some(0), "{}", checked.1);
    for target in ["joint-gcode", "setpoints"] {
        let refused = call(&["build", "--target", target]);
        assert!(refused.0 == Some(1) && refused.1.contains("E0523"), "{}", refused.1);
    }
}

/// What a job file can't mean is told where it stands; a setup never begins in the work, and nothing is written then.
#[test]
fn setups_that_do_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let told = |program: &str, job: &str, more: &[&str]| {
        let (source, jobs, out) = (folder.path().join("part.ngc"), folder.path().join("job.toml"), folder.path().join("part.mod"));
        std::fs::write(&source, program).unwrap();
        std::fs::write(&jobs, job).unwrap();
        let mut args = vec!["build", source.to_str().unwrap(), "--machine", CELL, "--target", "rapid", "--message-format", "short"];
        args.extend(["--job", jobs.to_str().unwrap(), "-o", out.to_str().unwrap()]);
        args.extend(more);
        let made = run(&args);
        let all = text(&made.stderr) + &text(&made.stdout);
        assert_eq!(out.exists(), made.status.success(), "{all}");
        let _ = std::fs::remove_file(out);
        let own = |l: &&str| l.contains("E055") || l.contains("E0535");
        all.lines().filter(own).map(|l| l.replace(&format!("{}/", folder.path().display()), "") + "\n").collect::<String>()
    };
    let part = std::fs::read_to_string(root().join(PART)).unwrap();
    let two = |line: u32| format!("[[setup]]\nname = \"top\"\nfrom_line = 1\n[[setup]]\nname = \"turned\"\nfrom_line = {line}\nposition = [0, 50, 0]\n");
    let mut all = String::new();
    let mut row = |name: &str, found: String| all += &format!("{name}:\n{found}");
    // Inside the pocket, at its retract, at the rapid over the next place, at the one down to it, at the end.
    for line in [14, 31, 33, 34, 52, 53, 54, 900] {
        row(&format!("bracket from {line}"), told(&part, &two(line), &[]));
    }
    row("no such workingstep", told(&part, "[[setup]]\nname = \"a\"\nworkingsteps = [\"nosuch\"]\n", &[]));
    row("no approach", told(&part, &two(31), &["--approach", "0"]));
    // A rapid at depth, though above the cut that follows it.
    row("rapid in a pocket", told("T1 M6\nG0 X0 Y0 Z20\nG1 Z-3 F500\nX20\nG0 X30\nG1 Z-6\nX40\nG0 Z20\nM30\n", &two(5), &[]));
    row("after a retract at feed", told("T1 M6\nG0 X0 Y0 Z20\nG1 Z-3 F500\nX20\nZ20\nG0 X30\nG1 Z-6\nX40\nG0 Z20\nM30\n", &two(6), &[]));
    let called = "o1 sub\nG0 Z20\nG0 X0\nG1 Z-3 F500\nX20\nG0 Z20\no1 endsub\nT1 M6\nG0 X0 Y0 Z20\no1 call\nG0 Y10\no1 call\nM2\n";
    row("called again", told(called, &two(12), &[]));
    let looped = "T1 M6\nG0 X0 Y0 Z20\no1 repeat [2]\nG0 X0\nG1 Z-3 F500\nG0 Z20\nG0 X30\nG1 Z-3\nG0 Z20\no1 endrepeat\nM2\n";
    row("in a loop", told(looped, &two(7), &[]));
    insta::assert_snapshot!("setups_that_do_not_fit", all);
}

/// The tool comes to a new clamping from above.
#[test]
fn setups_begin_from_above() {
    let folder = tempfile::tempdir().unwrap();
    let job = folder.path().join("job.toml");
    std::fs::write(&job, "[[setup]]\nname = \"top\"\nfrom_line = 1\n[[setup]]\nname = \"turned\"\nfrom_line = 33\nposition = [0, 50, 0]\n").unwrap();
    let made = run(&["build", PART, "--machine", CELL, "--target", "rapid", "--job", job.to_str().unwrap()]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let program = text(&made.stdout);
    let lines: Vec<&str> = program.lines().collect();
    let stop = lines.iter().position(|l| l.contains("setup turned")).unwrap_or_else(|| panic!("{program}"));
    insta::assert_snapshot!("setups_begin_from_above", lines[stop - 5..stop + 9].join("\n"));
}

/// What set-points can't say stands beside them; an option that has no effect is refused.
#[test]
fn joint_targets_drop_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("part.csv");
    let made = run(&["build", PART, "--machine", CELL, "--target", "setpoints", "-o", out.to_str().unwrap()]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    assert!(text(&made.stderr).contains("E0546"), "{}", text(&made.stderr));
    let events = std::fs::read_to_string(folder.path().join("part-events.csv")).unwrap();
    assert!(events.contains("\"T2 M6\",\"ChangeTool\"") && events.contains("\"S12000\",\"aoSpindleSpeed = 12000\""), "{events}");
    let bad = run(&["build", PART, "--machine", CELL, "--target", "joint-gcode", "--round", "truncate", "-o", out.to_str().unwrap()]);
    assert_eq!(bad.status.code(), Some(2));
    assert!(text(&bad.stderr).contains("--round does nothing for the target joint-gcode"), "{}", text(&bad.stderr));
}

/// A URDF becomes a machine file that `machine check` takes; one that is none is refused in words.
#[test]
fn machine_import() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let mut urdf = String::from("<?xml version=\"1.0\"?>\n<robot name=\"made\">\n<link name=\"l0\"/>\n");
    for (i, (z, axis)) in [(0.4, "0 0 1"), (0.1, "0 1 0"), (0.5, "0 1 0"), (0.1, "1 0 0"), (0.4, "0 1 0"), (0.1, "1 0 0")].iter().enumerate() {
        let n = i + 1;
        urdf += &format!(
            "<link name=\"l{n}\"/>\n<joint name=\"j{n}\" type=\"revolute\"><parent link=\"l{i}\"/><child link=\"l{n}\"/>\
             <origin xyz=\"0 0 {z}\" rpy=\"0 0 0\"/><axis xyz=\"{axis}\"/><limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"2\"/></joint>\n"
        );
    }
    std::fs::write(path("made.urdf"), urdf + "</robot>\n").unwrap();
    let made = run(&["machine", "import", &path("made.urdf"), "--id", "shop/made", "-o", &path("made.toml")]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let checked = run(&["machine", "check", &path("made.toml")]);
    assert!(checked.status.success(), "{}{}", text(&checked.stdout), text(&checked.stderr));
    let shown = text(&run(&["machine", "show", &path("made.toml")]).stdout);
    assert!(shown.starts_with("shop/made") && shown.contains("j6"), "{shown}");
    std::fs::write(path("none.urdf"), "<robot name=\"x\"><link").unwrap();
    let refused = run(&["machine", "import", &path("none.urdf"), "--id", "shop/none", "-o", &path("none.toml")]);
    assert!(!refused.status.success() && text(&refused.stderr).contains("none.urdf"), "{}", text(&refused.stderr));
    assert!(!folder.path().join("none.toml").exists());
}

/// `--reference usp2009` for joints: legs and column of the recomputed thesis on a move along Z, and a place that only cones
/// fixed in the base forbid.
#[test]
fn joints_of_usp2009() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("cell.toml", "format = 1\nid = \"test/cell\"\nextends = \"usp/2ups-prp\"\n[frames.part]\nposition = [800, 0, 0]\n");
    write("z.ngc", "G21 G90 G94\nF600\nG0 X0 Y0 Z0\nG1 Z100\nM2\n");
    write("cone.ngc", "G21 G90 G94\nF600\nG0 X0 Y0 Z300\nG1 X-107 Y400\nM2\n");
    let build = |name: &str, more: &[&str]| {
        let (source, cell, out) = (path(name), path("cell.toml"), path("out.ngc"));
        let args = ["build", &source, "--machine", &cell, "--target", "joint-gcode", "-o", &out, "--message-format", "short"];
        run(&[&args, more].concat())
    };
    let made = build("z.ngc", &["--reference", "usp2009"]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let program = std::fs::read_to_string(path("out.ngc")).unwrap();
    let last = program.lines().filter(|l| l.starts_with("G1") && l.contains(" Z100 ")).next_back().unwrap();
    let joint = |w: &str| -> f64 { last.split(' ').find_map(|p| p.strip_prefix(w)).unwrap().parse().unwrap() };
    assert!([("X", 1049.1068), ("Y", 1049.1068), ("Z", 100.0)].iter().all(|(w, v)| (joint(w) - v).abs() < 1e-4), "{last}");
    assert!(program.contains("X1044.32992"), "the start of the move: {program}");
    // (693, 400, 300): reached with the cones in the platform, outside of the first one's with those in the base.
    assert!(build("cone.ngc", &[]).status.success());
    let refused = build("cone.ngc", &["--reference", "usp2009"]);
    assert_eq!(refused.status.code(), Some(1));
    insta::assert_snapshot!("usp2009_cone", text(&refused.stderr).replace(&format!("{}/", folder.path().display()), ""));
}

/// Two million moves for an arm, in files of the controller's size.
#[test]
#[cfg_attr(debug_assertions, ignore = "a minute without optimisation")]
fn two_million_moves() {
    moves(2_000_000);
}

/// The same, smaller.
#[test]
fn twenty_thousand_moves() {
    moves(20_000);
}

fn moves(count: usize) {
    use std::fmt::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let mut program = String::from("G21 G90 G94\nT1 M6\nG0 X0 Y0 Z20\nF1200\n");
    for i in 0..count {
        let _ = writeln!(program, "G1 X{:.3} Y{:.3} Z{:.3}", (i % 397) as f64 * 0.25, (i % 211) as f64 * 0.5, (i % 13) as f64 * 0.1);
    }
    program += "M30\n";
    let source = folder.path().join("many.ngc");
    std::fs::write(&source, program).unwrap();
    let out = format!("{}/out/", folder.path().display());
    let made = run(&["build", source.to_str().unwrap(), "--machine", CELL, "--target", "rapid", "-q", "-o", &out]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let mut cuts = 0;
    for file in std::fs::read_dir(&out).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_some_and(|e| e == "mod") {
            cuts += std::fs::read_to_string(path).unwrap().matches("MoveL ").count();
        }
    }
    // The moves, and the ways to and from the part.
    assert!(cuts >= count && cuts <= count + 10, "{cuts}");
}

/// What one word has switched on, another word that takes over switches off, whichever output it names itself.
#[test]
fn no_output_stays_on() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("m.ngc");
    std::fs::write(&part, "G21 G90 G17 G54\nT1 M6\nG43 H1\nS4000 M3\nM7\nM8\nG0 X20 Y20 Z20\nG1 Z10 F300\nM4\nG1 Z15\nM9\nM5\nM30\n").unwrap();
    let out = format!("{}/out/", folder.path().display());
    let made = run(&["build", part.to_str().unwrap(), "--machine", CELL, "--target", "rapid", "-o", &out]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let all: String = std::fs::read_dir(&out).unwrap().map(|f| std::fs::read_to_string(f.unwrap().path()).unwrap()).collect();
    for output in ["doSpindleCw", "doSpindleCcw", "doMist", "doCoolant"] {
        let last = all.lines().filter(|l| l.contains(&format!("SetDO {output},"))).next_back().unwrap_or_else(|| panic!("{output}: {all}"));
        assert!(last.contains(&format!("SetDO {output},0")), "{last}\n{all}");
    }
    let at = |what: &str| all.find(what).unwrap_or_else(|| panic!("{what}: {all}"));
    assert!(at("SetDO doSpindleCw,0") < at("SetDO doSpindleCcw,1"), "one way is off before the other is on: {all}");
}

/// Words of axes that a machine tool lacks are errors at their line, for every target and in `check`.
#[test]
fn axes_that_a_machine_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("a.ngc");
    let source = source.to_str().unwrap();
    let mut all = String::new();
    let cases = [
        ("generic/mill3", "G21 G90\nG0 X10 Y10 Z-20\nG1 A10 F300\nA20 U3\nM2\n"),
        ("unb/router", "G21 G90\nG0 X10 Y10 Z-20 C5\nM2\n"),
        ("generic/mill5-ac-table", "G21 G90\nG0 X10 Y10 Z20 A5 C0\nG1 B10 F300\nM2\n"),
    ];
    for (machine, text_in) in cases {
        std::fs::write(source, text_in).unwrap();
        for args in [&["check", source][..], &["build", source, "--target", "rs274ngc"], &["build", source, "--target", "joint-gcode"]] {
            let made = run(&[args, &["--machine", machine, "--message-format", "short"]].concat());
            let told = text(&made.stderr) + &text(&made.stdout);
            assert_eq!(made.status.code(), Some(1), "{told}");
            let own = told.lines().filter(|l| l.contains("E0553")).map(|l| l.rsplit('/').take(2).collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join("/") + "\n");
            all += &format!("{machine} {}:\n{}", args[0], own.collect::<String>());
        }
    }
    insta::assert_snapshot!("axes_that_a_machine_lacks", all);
    std::fs::write(source, "G21 G90\nG0 X10 Y10 Z-20 A0\nG1 X20 F300\nM2\n").unwrap();
    assert!(run(&["check", source, "--machine", "generic/mill3"]).status.success());
}

/// The planar arm and templates are checked and verified like the others; a tool that is missing is told once; G43 means
/// nothing to a robot.
#[test]
fn every_arm_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("a.ngc");
    let source = source.to_str().unwrap();
    let told = |command: &str, machine: &str| {
        let made = run(&[command, source, "--machine", machine, "--message-format", "short"]);
        (made.status.code(), text(&made.stderr) + &text(&made.stdout))
    };
    std::fs::write(source, "G21 G90\nG0 X150 Y50\nG1 X-150 Y50 F600\nG1 X-400\nM2\n").unwrap();
    for command in ["check", "verify"] {
        let (code, found) = told(command, "ufmg/plano-3r");
        assert!(code == Some(1) && found.contains(":4:") && found.contains("E0504"), "{found}");
        let (code, found) = told(command, "comau/tricept806");
        assert!(code == Some(1) && found.contains("E0534"), "{found}");
    }
    let made = run(&["verify", source, "--machine", "comau/tricept806", "-o", folder.path().to_str().unwrap(), "--message-format", "short"]);
    assert!(made.status.code() == Some(1) && text(&made.stderr).contains("E0534"), "{}", text(&made.stderr));
    std::fs::write(source, "G21 G90\nT1 M6\nG0 X0 Y0 Z20\nG1 Z0 F500\nX20\nG0 Z20\nM30\n").unwrap();
    let (code, found) = told("check", "abb/irb2400");
    assert_eq!((code, found.matches("E0521").count(), found.matches("E0281").count()), (Some(1), 1, 0), "{found}");
    let (_, found) = told("check", CELL);
    assert!(!found.contains("E0281"), "{found}");
}

fn text_lines(bytes: &[u8]) -> Vec<String> {
    text(bytes).lines().map(str::to_string).collect()
}

/// A restart leads to where it begins, and by no place that nothing has named; in a job, in the setup it belongs to.
#[test]
fn a_robot_restarts_where_the_program_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let program = "G21 G90 G54\nT1 M6\nM3 S8000\nG0 X10 Y10 Z40\nG1 Z-1 F300\nG1 X40 F1000\nG0 Z40\nG0 X20 Y20\nG1 Z-5 F100\nG0 Z60\nG0 X10 Y10\nG1 Z-2 F200\nX30\nG0 Z60\nM2\n";
    std::fs::write(path("a.ngc"), program).unwrap();
    std::fs::write(path("job.toml"), "[[setup]]\nname = \"top\"\nfrom_line = 1\n[[setup]]\nname = \"turned\"\nfrom_line = 11\nposition = [0, 50, 0]\n").unwrap();
    let made = |machine: &str, target: &str, more: &[&str]| {
        let source = path("a.ngc");
        let o = run(&[&["build", &source, "--machine", machine, "--target", target, "--from-line", "9"], more].concat());
        assert!(o.status.success() && !text(&o.stderr).contains("(line 0)"), "{}", text(&o.stderr));
        text(&o.stdout)
    };
    let points = |more: &[&str]| -> Vec<String> {
        let rapid = made(CELL, "rapid", more);
        rapid.lines().filter_map(|l| l.trim().strip_prefix("MoveL [[").or(l.trim().strip_prefix("MoveJ [["))?.split(']').next().map(str::to_string)).collect()
    };
    let way = points(&[]);
    assert_eq!(way[..2], ["20,20,110".to_string(), "20,20,60".into()], "{way:?}");
    assert_eq!(points(&["--job", &path("job.toml")])[..2], way[..2]);
    let mill = made("generic/mill3", "joint-gcode", &[]);
    let moves: Vec<&str> = mill.lines().filter(|l| l.starts_with("G0 ")).collect();
    assert_eq!(moves[..3], ["G0 X0 Y0 Z60", "G0 X20 Y20 Z60", "G0 X20 Y20 Z42"], "{mill}");
}

/// On five-axis mills too the way to a restart begins where the machine stands, rotary axes as well.
#[test]
fn a_five_axis_mill_restarts() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    for (base, [tilt, turn], home) in [
        ("mill5-b-head-c-table", ["B", "C"], [0, 0]),
        ("mill5-ac-table", ["A", "C"], [10, 20]),
        ("mill5-bc-table", ["B", "C"], [-5, 40]),
        ("mill5-cb-head", ["B", "C"], [10, 0]),
    ] {
        let joints = if base == "mill5-cb-head" { [home[1], home[0]] } else { home };
        let file = format!("format = 1\nid = \"shop/m\"\ntitle = \"m\"\nextends = \"generic/{base}\"\n[home]\njoints = [30, 20, 0, {}, {}]\n", joints[0], joints[1]);
        std::fs::write(path("m.toml"), file).unwrap();
        let lines = [
            "G21 G90 G17 G54".to_string(),
            "T1 M6 G43.1 Z40".into(),
            "S1000 M3".into(),
            format!("G0 X0 Y0 Z-30 {tilt}0 {turn}0"),
            format!("G0 X0 Y0 Z-40 {tilt}10 {turn}30"),
            "G1 Z-60 F300".into(),
            "G91 G1 X10".into(),
            "G90 G0 Z-30".into(),
            format!("G0 X5 Y5 {tilt}20 {turn}40"),
            "G1 Z-60 F300".into(),
            "G1 X20".into(),
            "G0 Z-30".into(),
            "M2".into(),
        ];
        std::fs::write(path("a.ngc"), lines.join("\n")).unwrap();
        let made = |more: &[&str]| -> Vec<String> {
            let o = run(&[&["build", &path("a.ngc"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--allow", "E0281", "-q"], more].concat());
            assert!(o.status.success(), "{base} {more:?}: {}", text(&o.stderr));
            text_lines(&o.stdout).into_iter().filter(|l| l.starts_with("G0 ") || l.starts_with("G1 ")).collect()
        };
        let whole = made(&[]);
        for line in ["5", "6", "7", "8", "9", "10", "11"] {
            let part = made(&["--from-line", line, "--safe-z", "-10"]);
            // The cut of line 11 and the rapid after it are the same, and the way there is not long.
            let last = |of: &[String]| of[of.len() - 2..].to_vec();
            assert_eq!(last(&part), last(&whole), "{base} {line}");
            assert!(part.len() < 250, "{base} {line}: {}", part.len());
            // The way up names Z alone; where the tool will be tilted the rotary axes turn first.
            let home = [format!("{tilt}{}", home[0]), format!("{turn}{}", home[1])];
            let upright = home.iter().all(|word| part[0].contains(word));
            let turns = || part[0].starts_with("G0 X30 Y20 Z0 ") && part[1].starts_with("G0 X30 Y20 Z0 ");
            assert!(part[0].starts_with("G0 X30 Y20 Z") && if line == "5" { upright } else { turns() }, "{base} {line}: {part:?}");
            if line == "7" {
                let begins = part.iter().position(|l| l.starts_with("G1 ")).unwrap();
                let cuts = |of: &[String]| of.iter().filter(|l| l.starts_with("G1 ")).cloned().collect::<Vec<_>>();
                // Its own way in is a cut of the restart's; the step of the line goes on from where the program stood.
                assert!(part[begins..].iter().any(|l| *l == cuts(&whole)[1]), "{base}: {part:?}");
            }
        }
        // Named and never moved, the rotary axes go where the words say; not named they stay.
        for words in [format!(" {tilt}0 {turn}0"), String::new()] {
            std::fs::write(path("a.ngc"), format!("G21 G90 G17 G54\nG0 X0 Y0 Z-30{words}\nG1 Z-60 F300\nG1 X10\nG1 Y10\nG0 Z-30\nM2\n")).unwrap();
            let (whole, part) = (made(&[]), made(&["--from-line", "4", "--safe-z", "-10"]));
            assert_eq!(part[part.len() - 3..], whole[whole.len() - 3..], "{base} {words}");
        }
    }
    std::fs::write(path("a.ngc"), "G21 G90 G17 G54\nG0 X0 Y0 Z50 A0\nG1 Z-60 F300\nG1 X10\nG0 Z50\nM2\n").unwrap();
    let o = run(&["build", &path("a.ngc"), "--machine", "generic/mill3", "--target", "joint-gcode", "--from-line", "4", "--safe-z", "60", "-q"]);
    assert!(o.status.success(), "{}", text(&o.stderr));
}

/// Between the change to a shorter tool and its G43 the length of the one before is in force: the machine file has the tips, whose highest counts.
#[test]
fn a_restart_before_the_length_of_a_shorter_tool() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    std::fs::write(path("m.toml"), "format = 1\nid = \"shop/m\"\nextends = \"generic/mill3\"\n[frames.table]\nposition = [0, 0, -250]\n[[joint]]\nname = \"Z\"\nmin = -900\nmax = 900\n[[tool]]\nnumber = 1\nname = \"a\"\nposition = [0, 0, 40]\n[[tool]]\nnumber = 2\nname = \"b\"\nposition = [0, 0, 120]\n").unwrap();
    let program = "G21 G90 G17 G54\nG53 G0 Z0\nT2 M6\nS8000 M3\nG0 X-60 Y0\nG43 H2 Z30\nG1 Z-20 F300\nX-50\nG0 Z30\nG53 G0 Z0\nM5\nT1 M6\nS6000 M3\nG0 X0 Y0\nG43 H1 Z80\nG1 Z49 F300\nY-30\nG0 Z80\nM5\nM2\n";
    std::fs::write(path("a.ngc"), program).unwrap();
    for line in ["12", "13", "14", "15"] {
        let o = run(&["build", &path("a.ngc"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--from-line", line, "--message-format", "short", "-q"]);
        assert!(o.status.success() && text(&o.stderr).contains("Z 80.000"), "{line}: {}", text(&o.stderr));
        let ways = text_lines(&o.stdout).into_iter().take_while(|l| !l.starts_with("G1 ")).filter(|l| l.starts_with("G0 "));
        // The tip 80 above the base, 250 below the machine's zero, of a tool 40 long.
        let lowest = ways.filter_map(|l| l.split(' ').find_map(|w| w.strip_prefix('Z')).and_then(|z| z.parse::<f64>().ok())).fold(f64::INFINITY, f64::min);
        assert!(lowest >= -130.0 - 1e-6, "{line}: {lowest}");
    }
}

/// The change to a longer tool is made as high as that one needs it, also where the length in force is still another one's, or none is.
#[test]
fn a_restart_at_the_change_to_a_longer_tool() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    std::fs::write(path("m.toml"), "format = 1\nid = \"shop/m\"\nextends = \"generic/mill3\"\n[frames.table]\nposition = [0, 0, -250]\n[[joint]]\nname = \"Z\"\nmin = -900\nmax = 900\n[[tool]]\nnumber = 1\nname = \"a\"\nposition = [0, 0, 50]\n[[tool]]\nnumber = 2\nname = \"b\"\nposition = [0, 0, 120]\n").unwrap();
    std::fs::write(path("t.tbl"), "T1 P1 Z50 D10\nT2 P2 Z120 D6\n").unwrap();
    let program = "G21 G90 G17 G54\nT1 M6\nS3000 M3\nG0 X0 Y0\nG43 H1 Z80\nG1 Z-1 F300\nX50\nG0 Z80\nT2 M6\nS3000 M3\nG0 X0 Y20\nG43 H2 Z15\nG1 Z-5 F300\nG0 Z15\nM5\nM2\n";
    std::fs::write(path("a.ngc"), program).unwrap();
    // The spindle's nose as low as it comes before a cut, above the work's zero: the highest tip at 80, of a tool of 120.
    for line in ["2", "3", "4", "9", "10", "11", "12"] {
        let o = run(&["build", &path("a.ngc"), "-t", &path("t.tbl"), "--from-line", line, "--message-format", "short", "-q"]);
        assert!(o.status.success(), "{line}: {}", text(&o.stderr));
        let (mut length, mut lowest) = (0.0, f64::INFINITY);
        for row in text_lines(&o.stdout).iter().take_while(|l| !l.contains("G1 ")) {
            length = if row.contains("G43 H1") { 50.0 } else if row.contains("G43 H2") { 120.0 } else { length };
            let z = row.split(' ').find_map(|w| w.strip_prefix('Z')).and_then(|z| z.parse::<f64>().ok());
            lowest = z.map_or(lowest, |z: f64| lowest.min(z + length));
        }
        // At the change the program itself stands at 80 under the length of the shorter tool.
        let needed = if matches!(line, "2" | "3" | "4" | "9") { 130.0 } else { 135.0 };
        assert!(lowest >= needed, "{line}: {lowest} {}", text(&o.stdout));
        let o = run(&["build", &path("a.ngc"), "-t", &path("t.tbl"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--from-line", line, "--message-format", "short", "-q"]);
        assert!(o.status.success(), "{line}: {}", text(&o.stderr));
        let ways = text_lines(&o.stdout).into_iter().take_while(|l| !l.starts_with("G1 ")).filter(|l| l.starts_with("G0 "));
        let lowest = ways.filter_map(|l| l.split(' ').find_map(|w| w.strip_prefix('Z')).and_then(|z| z.parse::<f64>().ok())).fold(f64::INFINITY, f64::min);
        assert!(lowest + 250.0 >= needed, "{line}: {lowest}");
    }
}

/// In a section where the table tilts the part a restart turns the rotary axes first, where the machine stands, and comes along the tool.
#[test]
fn a_restart_comes_along_a_tilted_tool() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    std::fs::write(path("m.toml"), "format = 1\nid = \"shop/m\"\nextends = \"generic/mill5-ac-table\"\n[frames.table]\nposition = [0, 0, -150]\n[[tool]]\nnumber = 1\nname = \"em10\"\nposition = [0, 0, 60]\n").unwrap();
    // The side that looks along Y, with rapids 50 mm along the tool.
    let side = "G21 G90 G17 G54\nG53 G0 Z0\nT1 M6\nS6000 M3\nG43 H1\nG0 A-90 C0\nG0 X10 Y50\nZ-20\nG1 Y9 F300\nX30 F800\nG0 Y50\nM5\nG53 G0 Z0\nM2\n";
    std::fs::write(path("a.ngc"), side).unwrap();
    let made = |more: &[&str]| {
        let o = run(&[&["build", &path("a.ngc"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--message-format", "short", "-q"], more].concat());
        let rows = text_lines(&o.stdout).into_iter().filter(|l| l.starts_with("G0 ") || l.starts_with("G1 ")).collect::<Vec<_>>();
        (rows.iter().map(|l| l.split(" F").next().unwrap().to_string()).collect::<Vec<_>>(), text(&o.stderr))
    };
    let whole = made(&[]).0;
    let [from, to] = ["G1 X10 Y-180 Z-281 A-90 C0", "G1 X30 Y-180 Z-281 A-90 C0"];
    assert!(whole.iter().any(|l| l == from) && whole.iter().any(|l| l == to), "{whole:?}");
    let turned = |rows: &[String]| {
        let up: Vec<&String> = rows.iter().take_while(|l| l.starts_with("G0 X0 Y0 Z0 ")).collect();
        assert!(up.len() > 10 && up.last().is_some_and(|l| l.ends_with("A-90 C0")), "{rows:?}");
        rows[up.len()..].to_vec()
    };
    for (more, level, told) in [(&[][..], "Z-240", true), (&["--safe-z", "70"], "Z-220", false)] {
        let (rows, found) = made(&[&["--from-line", "10"], more].concat());
        let way = turned(&rows);
        let over = [format!("G0 X0 Y0 {level} A-90 C0"), format!("G0 X10 Y-180 {level} A-90 C0")];
        let down = ["G0 X10 Y-180 Z-279 A-90 C0", "G1 X10 Y-180 Z-281 A-90 C0", to].map(String::from);
        let expected = [&over[..], &down].concat();
        assert_eq!(way[..expected.len()], expected[..], "{more:?}");
        assert_eq!(found.contains("E0614") && found.contains("50.000 mm along the tilted tool"), told, "{found}");
    }
    // Before the section has said all, its own blocks lead there: the retract's height is that of the whole program.
    let way = turned(&made(&["--from-line", "7"]).0);
    assert!(way[0] == "G0 X10 Y-290 Z-240 A-90 C0" && whole.ends_with(&way), "{way:?} {whole:?}");
    // The height is known, and not yet what lies across: it waits up there.
    let way = turned(&made(&["--from-line", "8"]).0);
    assert!(way[0] == "G0 X0 Y0 Z-240 A-90 C0" && whole.ends_with(&way[1..]), "{way:?}");
    // Blocks that name X Y Z, cycles, and cuts that turn the part on: the tool comes along itself to where the program was.
    let head = "G21 G90 G17 G54\nT1 M6\nS6000 M3\nG43 H1\nG53 G0 Z0\n";
    for (body, lines) in [
        ("G0 A-45 C0\nG0 X40 Y30 Z80\nG1 X40 Y20 Z20 F1000\nX50 Y21 Z19\nX60 Y22 Z18\nG0 X70 Y30 Z80\n", 8..=11),
        ("G0 A-45 C0\nG0 X40 Y-40\nZ42\nG98 G81 X40 Y-40 Z7 R10 F200\nX50\nX60\nG80\nG0 Z42\n", 9..=11),
        ("G0 A-20 C0\nG0 X-40 Y-30 Z60\nG0 Z20\nG1 X-40 Y-30 Z0 A-20 C0 F1000\nX-20 Z-1 A-25 C5\nX0 Y-30 Z-2 A-30 C10\nX20 Y-30 Z-1 A-25 C15\nG0 X40 Y-30 Z60 A-20 C20\n", 9..=12),
    ] {
        std::fs::write(path("a.ngc"), format!("{head}{body}M5\nG53 G0 Z0\nM2\n")).unwrap();
        let whole = made(&[]).0;
        let cut = whole.iter().rposition(|l| l.starts_with("G1 ")).unwrap();
        for line in lines {
            let (rows, found) = made(&["--from-line", &line.to_string(), "--safe-z", "90"]);
            assert!(!found.contains("error"), "{body} {line}: {found}");
            let same = rows.iter().rev().zip(whole.iter().rev()).take_while(|(a, b)| a == b).count();
            assert!(same >= whole.len() - cut, "{body} {line}: {rows:?}");
            // From where it stands it goes up along the tool, over the place and down, the last of it by feed.
            let way = &rows[..rows.len() - same];
            let first = way.iter().position(|l| !l.starts_with("G0 X0 Y0 Z0 ")).unwrap();
            let place = whole[whole.len() - same - 1].split_once(' ').unwrap().1;
            assert!(way[first].starts_with("G0 X0 Y0 Z") && way.len() >= first + 2, "{body} {line}: {way:?}");
            // Straight down the tool, which is Z of the machine, or from where the program was.
            let beside = |row: &str| row.split(' ').skip(1).take(2).map(String::from).collect::<Vec<_>>();
            let cuts = rows[way.len()].starts_with("G1 ") && beside(way.last().unwrap()) != beside(&rows[way.len()]);
            assert!(!cuts || way.last().unwrap().ends_with(place), "{body} {line}: {way:?}");
        }
    }
    // Behind the retract, where an upright section follows whose index names X and Y: the slides stay retracted, as in the whole program.
    let next = "G53 G0 Z0\nM5\nT1 M6\nS6000 M3\nG43 H1\nG0 X3 Y2 A0 C0\nG0 Z60\nG0 Z2\nG1 Z-2 F300\nX20 F800\nG0 Z60\nM5\nG53 G0 Z0\nM2\n";
    for program in [side.replace("M5\nG53 G0 Z0\nM2\n", next), side.replace("M5\nG53 G0 Z0\nM2\n", &next.replacen("G53 G0 Z0", "G91 G28 Z0\nG90", 1))] {
        std::fs::write(path("a.ngc"), &program).unwrap();
        let behind = |rows: Vec<String>| {
            let at = rows.windows(2).rposition(|w| !w[0].ends_with(" A0 C0") && w[1].ends_with(" A0 C0")).unwrap();
            rows[at + 1..].to_vec()
        };
        let whole = behind(made(&[]).0);
        assert!(whole[0] == "G0 X3 Y2 Z0 A0 C0", "{whole:?}");
        let index = program.lines().position(|l| l.contains("A0 C0")).unwrap() + 1;
        for line in index - 4..=index {
            for more in [&[][..], &["--safe-z", "150"]] {
                let (rows, found) = made(&[&["--from-line", &line.to_string()], more].concat());
                assert!(!found.contains("error") && found.contains("E0654"), "{line}: {found}");
                assert_eq!(behind(rows), whole, "{line}");
            }
        }
    }
    // At 90° Z lies across: the tool comes down once the block has named it.
    std::fs::write(path("a.ngc"), format!("{head}G0 A-90 C0\nG0 X10 Y9\nG43 H1 Z-20\nG1 Z-25 F300\nX30\nG0 Y50\nM5\nG53 G0 Z0\nM2\n")).unwrap();
    let whole = made(&[]).0;
    let (rows, found) = made(&["--from-line", "8", "--safe-z", "90"]);
    assert!(!found.contains("error") && rows.len() > 4 && whole.ends_with(&rows[rows.len() - 4..]), "{found}{rows:?}");
    // The length of the tool before is still in force there: what counts is the tip.
    let tools = "T1 M6\nS6000 M3\nG0 G43 H2 Z100\nG53 G0 Z0\nG0 A-45 C0\nG0 X10 Y-50\nG43 H1 Z40\nG0 Z2\nG1 Z-2 F300\nX30\nG0 Z40\nM5\nM2\n";
    std::fs::write(path("a.ngc"), format!("G21 G90 G17 G54\n{tools}")).unwrap();
    std::fs::write(path("t.tbl"), "T1 P1 Z60 D10\nT2 P2 Z90 D10\n").unwrap();
    let table = path("t.tbl");
    let tops = |line: &str| {
        let found = made(&["--from-line", line, "-t", &table]).1;
        found.split("program, ").nth(1).and_then(|t| t.split(" mm along").next()).and_then(|t| t.parse::<f64>().ok()).unwrap_or_else(|| panic!("{line}: {found}"))
    };
    assert_eq!(tops("8"), tops("10"));
    // What an index has led away is where the program believes it only once it has come back.
    std::fs::write(path("a.ngc"), format!("{head}G0 X5 Y6 Z70\nG1 Z-2 F300\nG53 G0 Z0\nG0 A-60 C0\nG0 X20 Y-50\nZ50\nG1 Z1\nG0 Z50\nG53 G0 Z0\nM2\n")).unwrap();
    let whole = made(&[]).0;
    for line in ["9", "10"] {
        let rows = made(&["--from-line", line, "--safe-z", "90"]).0;
        let lowest = |l: &&String| l.starts_with("G1 ");
        assert_eq!(rows.iter().filter(lowest).collect::<Vec<_>>(), whole.iter().filter(lowest).skip(1).collect::<Vec<_>>(), "{line}: {rows:?}");
    }
}

/// Behind an index the tool comes to the part no lower than LinuxCNC's interpreter has it, however it was retracted.
#[test]
fn no_rapid_dives_behind_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let joints: String = ["X", "Y", "Z"].map(|j| format!("[[joint]]\nname = \"{j}\"\nmin = -2900\nmax = 2900\n")).concat();
    std::fs::write(path("m.toml"), format!("format = 1\nid = \"shop/m\"\nextends = \"generic/mill5-ac-table\"\n{joints}[frames.table]\nposition = [20, -10, -150]\n[[tool]]\nnumber = 1\nname = \"em10\"\nposition = [0, 0, 60]\n")).unwrap();
    let made = |body: &str| {
        std::fs::write(path("a.ngc"), format!("G21 G90 G17 G54\nT1 M6\nG43 H1\nS5000 M3\nF500\n{body}\nZ50\nG1 Z-2\nM5\nM2\n")).unwrap();
        let o = run(&["build", &path("a.ngc"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--message-format", "short", "-q"]);
        assert!(o.status.success(), "{body}: {}", text(&o.stderr));
        text_lines(&o.stdout).into_iter().filter(|l| l.starts_with("G0 ")).collect::<Vec<_>>()
    };
    let side = "G53 G0 Z0\nG0 A-45 C30\nG0 X10 Y-50 Z50\nG1 Z-2\nG0 Z50\n";
    for (before, index) in [
        ("", "G53 G0 Z0\nG53 G0 A-45 C0"),
        ("", "G53 G0 Z0 A-45 C0"),
        ("", "G0 X0 Y0\nG53 G0 Z0\nG53 G0 A-45 C0"),
        ("", "G53 G0 Z0\nG1 A-60 C20 F5000"),
        ("", "G53 G0 Z0\nG0 A-60 C20\nG53 G0 Z0"),
        (side, "G91 G28 X0 Y0 Z0\nG90\nG0 C75"),
        (side, "G91 G28 X0 Y0 Z0\nG90\nG91 G0 C45\nG90"),
    ] {
        // LinuxCNC has Z 90 there: 0 of the machine, 150 mm above the part, less the tool.
        let (rows, named) = (made(&format!("{before}{index}\nG0 X10 Y-50")), made(&format!("{before}{index}\nG0 X10 Y-50 Z90")));
        assert_eq!(rows[rows.len() - 2..], named[named.len() - 2..], "{index}");
    }
}

/// A length that comes into force under a tool that is tilted against the part leads it aside; X and Y are gone to with the rapid that
/// follows, and a cut says that it has none.
#[test]
fn a_length_under_a_tilted_tool() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let file = |base: &str| {
        let tools: String = [(1, 60), (2, 90)].map(|(n, z)| format!("[[tool]]\nnumber = {n}\nname = \"t{n}\"\nposition = [0, 0, {z}]\n")).concat();
        let joints: String = ["X", "Y", "Z"].map(|j| format!("[[joint]]\nname = \"{j}\"\nmin = -1900\nmax = 1900\n")).concat();
        format!("format = 1\nid = \"shop/m\"\nextends = \"generic/{base}\"\n{joints}[frames.table]\nposition = [0, 0, -150]\n{tools}")
    };
    for (base, tilt) in [("mill5-ac-table", "A-45 C0"), ("mill5-bc-table", "B-45 C0"), ("mill5-b-head-c-table", "B45 C0"), ("mill5-cb-head", "B45 C0")] {
        std::fs::write(path("m.toml"), file(base)).unwrap();
        let cuts = |program: &str| {
            std::fs::write(path("a.ngc"), format!("G21 G90 G17 G54\nG53 G0 Z0\nT2 M6\nS6000 M3\n{program}\nG0 Z50\nM5\nM2\n")).unwrap();
            let o = run(&["build", &path("a.ngc"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--message-format", "short", "-q"]);
            let rows = text_lines(&o.stdout).into_iter().filter(|l| l.starts_with("G1 ")).collect::<Vec<_>>();
            (rows.iter().map(|l| l.split(" F").next().unwrap().to_string()).collect::<Vec<_>>(), text(&o.stderr))
        };
        let (direct, found) = cuts(&format!("G0 {tilt}\nG43 H2 X10 Y-50 Z50\nG1 Z-2 F300\nX20"));
        assert!(found.is_empty() && direct.len() == 2, "{base}: {found}");
        for order in ["G0 X10 Y-50\nG43 Z50 H2", "G0 X10 Y-50\nG43 H2\nG0 Z50", "G43 H2\nG0 X10 Y-50\nZ50", "G0 X10 Y-50 Z60\nG43 H2\nG0 X10\nZ50", "G43 H2\nG0 X10 Y-50 Z50\nG49\nG53 G0 Z0\nX10 Y-50\nG43 H2 Z50"] {
            let (rows, found) = cuts(&format!("G0 {tilt}\n{order}\nG1 Z-2 F300\nX20"));
            let told = found.lines().filter(|l| !l.contains("E0555")).count();
            assert!(rows == direct && told == 0, "{base} {order}: {rows:?} {direct:?} {found}");
        }
        let (rows, found) = cuts(&format!("G0 {tilt}\nG0 X10 Y-50 Z60\nG43 H2\nG1 Z-2 F300\nX20"));
        assert!(rows.is_empty() && found.contains(":8:") && found.matches("error[E0556]").count() == 1, "{base}: {rows:?} {found}");
    }
}

/// Part 1 of UFSC 2016 on the IRB 140, from the command line as the page says: the rows of table 5.3, and the printed points.
#[test]
fn ufsc2016_from_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let page = std::fs::read_to_string(root().join("docs/robots.md")).unwrap();
    let cell = page.split("```toml").find(|t| t.contains("abb/irb140")).and_then(|t| t.split("```").next()).unwrap();
    let machine = folder.path().join("cell.toml");
    std::fs::write(&machine, cell).unwrap();
    let out = folder.path().join("out");
    let part = "tests/golden/ufsc2016/example1.p21";
    let made = run(&["verify", part, "--machine", machine.to_str().unwrap(), "--reference", "ufsc2016", "-o", out.to_str().unwrap()]);
    let told = text(&made.stdout) + &text(&made.stderr);
    for row in ["842 points", "X        0.001      0.088     -0.085", "Y       -0.004      0.086     -0.082", "Z        0.001      0.083     -0.085"] {
        assert!(told.contains(row), "{row}: {told}");
    }
    let printed = std::fs::read_to_string(root().join("tests/golden/ufsc2016/appC_ex1_irb140.csv")).unwrap();
    let ours = std::fs::read_to_string(out.join("example1-errors.csv")).unwrap();
    let ours: Vec<Vec<f64>> = ours.lines().skip(1).map(|l| l.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    // The start of the run isn't published.
    for row in printed.lines().skip(2) {
        let row: Vec<f64> = row.split(',').map(|v| v.parse().unwrap()).collect();
        let own = &ours[row[0] as usize - 1];
        for i in 0..3 {
            assert!((own[8 + i] - row[7 + i]).abs() < 1e-6, "{row:?}: {own:?}");
        }
    }
}

/// Part 2 on the Adept One in the three clampings of table 5.1, by a job: the row of table 5.3, and the printed points. A bad job is told.
#[test]
fn ufsc2016_in_three_clampings() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let cell = "format = 1\nid = \"shop/one\"\ntitle = \"One\"\nextends = \"adept/one\"\n[frames.table]\nposition = [300, 300, 745]\n[frames.part]\nposition = [0, 10, 0]\n";
    std::fs::write(path("cell.toml"), cell).unwrap();
    let job = three_clampings([-95.0, 0.0, 0.0]).replace("position = [0, 0,", "position = [0, 10,");
    std::fs::write(path("job.toml"), &job).unwrap();
    let made = |job: &str| {
        run(&["verify", THREE_SIDES, "--step-overlap", "percent", "--step-units", "step-modeler", "--machine", &path("cell.toml"), "--reference", "ufsc2016", "--job", &path(job), "-o", &path("out")])
    };
    for (name, content, code, word) in [
        ("missing.toml", None, "E0820", "missing.toml"),
        ("nonsense.toml", Some("nonsense".to_string()), "E0550", "nonsense.toml"),
        ("steps.toml", Some(job.replace("#615", "#616")), "E0551", "#616"),
    ] {
        content.iter().for_each(|c| std::fs::write(path(name), c).unwrap());
        let bad = made(name);
        let told = text(&bad.stdout) + &text(&bad.stderr);
        assert!(!bad.status.success() && told.contains(code) && told.contains(word), "{name}: {told}");
    }
    let made = made("job.toml");
    let told = text(&made.stdout) + &text(&made.stderr);
    for row in ["3106 points", "X        0.002      0.096     -0.097", "Y        0.003      0.097     -0.096", "Z       -0.001      0.082     -0.079"] {
        assert!(told.contains(row), "{row}: {told}");
    }
    let printed = std::fs::read_to_string(root().join("tests/golden/ufsc2016/appC_ex2_adept_one.csv")).unwrap();
    let ours = std::fs::read_to_string(folder.path().join("out/example2_3caras-errors.csv")).unwrap();
    let ours: Vec<Vec<f64>> = ours.lines().skip(1).map(|l| l.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    let rows: Vec<Vec<f64>> = printed.lines().skip(1).map(|l| l.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    let good = rows.iter().filter(|row| (0..3).all(|i| (ours[row[0] as usize - 1][8 + i] - row[7 + i]).abs() <= 1e-6)).count();
    assert!(rows.len() == 39 && good >= 35, "{good} of {}", rows.len());
}

/// Rails and positioners stand still: targets of joint values say where, in what they write and beside it.
#[test]
fn joint_targets_say_where_external_axes_stand() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let cell = |rail: f64| {
        format!(
            "format = 1\nid = \"shop/rail\"\ntitle = \"Rail\"\nextends = \"abb/irb2400\"\n[frames.part]\nposition = [{}, -100, 650]\n[home]\njoints = [0, -20, 20, 0, 60, 0]\n\
             [[external]]\nname = \"E1\"\ntype = \"prismatic\"\ncarries = \"machine\"\naxis = [1, 0, 0]\nmin = 0\nmax = 2000\nposition = {rail}\n\
             [[external]]\nname = \"E2\"\ntype = \"revolute\"\ncarries = \"part\"\naxis = [0, 0, 1]\nmin = -360\nmax = 360\nposition = 0\n",
            900.0 + rail
        )
    };
    std::fs::write(path("cell.toml"), cell(450.0)).unwrap();
    std::fs::write(path("part.ngc"), "G21 G90 G54\nG0 X0 Y0 Z20\nG1 Z0 F600\nM2\n").unwrap();
    for (target, holds) in [("joint-gcode", "part.out"), ("setpoints", "part-events.csv")] {
        let made = run(&["build", &path("part.ngc"), "--machine", &path("cell.toml"), "--target", target, "-o", &path("part.out"), "--message-format", "short"]);
        let told = text(&made.stderr);
        assert!(made.status.success(), "{told}");
        assert_eq!(told.matches("E0641").count(), 2, "{target}: {told}");
        assert!(told.contains("`E1` must stand at 450 mm") && told.contains("`E2` must stand at 0°"), "{target}: {told}");
        let written = std::fs::read_to_string(path(holds)).unwrap();
        for place in ["E1 carries the robot: it must stand at 450 mm before the start", "E2 carries the part: it must stand at 0 degrees before the start"] {
            assert_eq!(written.matches(place).count(), 1, "{target}: {written}");
        }
    }
}

/// The planar arm stands where its file says: what rests on coordinates that nothing has named is told, and a cut that begins
/// elsewhere is led up to.
#[test]
fn the_planar_arm_knows_where_it_stands() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("a.ngc");
    let source = source.to_str().unwrap();
    let made = |program: &str| {
        std::fs::write(source, format!("G21 G90 G17 F600\n{program}\nM2\n")).unwrap();
        let o = run(&["build", source, "--machine", "ufmg/plano-3r", "--target", "joint-gcode", "--interval", "1", "--message-format", "short", "-q"]);
        (text_lines(&o.stdout), text(&o.stderr))
    };
    let (named, found) = made("G0 X0 Y0\nG1 X50 Y20");
    assert_eq!(found, "");
    let (led, found) = made("G1 X50 Y20");
    assert_eq!(led, named);
    assert!(found.contains(":2:") && found.contains("E0559") && found.contains("X0"), "{found}");
    for (program, line) in [("G92 X10 Y0\nG0 X20 Y0\nG1 X40", ":2:"), ("G10 L20 P1 X10\nG0 X20 Y0", ":2:"), ("G0 Y20\nG1 X40", ":2:"), ("G91 G0 X10", ":2:")] {
        let (_, found) = made(program);
        assert!(found.contains(line) && found.matches("E0559").count() == 1, "{program}: {found}");
    }
    for program in ["G0 X50\nG1 Y20", "G0 X20 Y0\nG92 X0\nG0 X20\nG1 X40 Y0", "G92.1\nG0 X50 Y20", "G53 G0 X50\nG92 X0\nG1 X10"] {
        assert_eq!(made(program).1, "", "{program}");
    }
}

/// Nothing has named an axis of a mill: it stays where the machine stands, along the axes of the program, as LinuxCNC has it. On a
/// part that is clamped turned that can be no coordinate of it.
#[test]
fn axes_of_a_mill_that_nothing_has_named() {
    let folder = tempfile::tempdir().unwrap();
    let (source, machine) = (folder.path().join("a.ngc"), folder.path().join("m.toml"));
    let made = |base: &str, rest: &str, program: &str| {
        std::fs::write(&machine, format!("format = 1\nid = \"shop/mill\"\nextends = \"generic/{base}\"\n{rest}")).unwrap();
        std::fs::write(&source, format!("G21 G90\n{program}\nM2\n")).unwrap();
        let o = run(&["build", source.to_str().unwrap(), "--machine", machine.to_str().unwrap(), "--target", "joint-gcode", "--message-format", "short", "-q"]);
        (text_lines(&o.stdout).into_iter().filter(|l| l.starts_with("G0 ")).collect::<Vec<_>>(), text(&o.stderr))
    };
    let home = "[home]\njoints = [300, 150, -10]\n";
    // From X300 Y150 of the machine: 100 and 50 from the part's zero point.
    let (moves, found) = made("mill3", home, "G10 L2 P1 X200 Y100 R90\nG0 X10\nG0 Y5");
    assert_eq!((moves, found.as_str()), (vec!["G0 X300 Y110 Z-10".to_string(), "G0 X195 Y110 Z-10".into()], ""));
    let (moves, _) = made("mill3", home, "G10 L2 P1 X200 Y100 R45\nG0 X10");
    // Along the turned X: the way across it, (-100 + 50)/√2, stays.
    let (c, across) = (0.5f64.sqrt(), (50.0 - 100.0) * 0.5f64.sqrt());
    let place = |v: f64| format!("{}", (v * 1e6).round() / 1e6);
    assert_eq!(moves, [format!("G0 X{} Y{} Z-10", place(200.0 + c * (10.0 - across)), place(100.0 + c * (10.0 + across)))]);
    // A part that is clamped turned about the tool.
    let turned = "[frames.part]\nposition = [200, 100, -100]\nrotation = [0, 0, 90]\n";
    let (moves, found) = made("mill3", turned, "G0 X10 Y0 Z5\nG53 G0 Z0");
    assert_eq!((moves, found.as_str()), (vec!["G0 X200 Y110 Z-95".to_string(), "G0 X200 Y110 Z0".into()], ""));
    // One axis of the machine alone, whichever it is in the part; G28 of one coordinate would move the other axis.
    let (moves, found) = made("mill3", turned, "G0 X10 Y0 Z5\nG53 G0 Z0\nG53 G0 Y0");
    assert_eq!((moves.last().map(String::as_str), found.as_str()), (Some("G0 X200 Y0 Z0"), ""));
    for base in ["mill3", "mill5-ac-table"] {
        let (_, found) = made(base, turned, "G0 X10 Y0 Z5\nG53 G0 Z0\nG91 G28 Y0");
        assert!(found.contains(":4:") && found.contains("E0554") && found.matches("error").count() == 1, "{base}: {found}");
    }
    let tilted = "[frames.part]\nposition = [200, 100, -100]\nrotation = [20, 0, 0]\n";
    let (_, found) = made("mill5-ac-table", tilted, "G0 X10 Y0 Z5\nG53 G0 Z0");
    assert!(found.contains(":3:") && found.contains("E0554"), "{found}");
}

/// An axis that G53 has placed stays where a rotary axis turns, and the tool point goes up or down: no cut is meant so.
#[test]
fn no_cut_turns_under_an_axis_of_the_machine() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("a.ngc").to_str().unwrap().to_string();
    let made = |program: &str| {
        std::fs::write(&source, format!("G21 G90\nG0 X0 Y0 Z10 B10 C0\nG53 G0 Z50\n{program}\nM2\n")).unwrap();
        let o = run(&["build", &source, "--machine", "generic/mill5-b-head-c-table", "--target", "joint-gcode", "--message-format", "short", "-q"]);
        (text_lines(&o.stdout).into_iter().filter(|l| l.starts_with("G0 ")).collect::<Vec<_>>(), text(&o.stderr))
    };
    let (_, found) = made("G1 X20 F300\nG91 G1 Z-5\nG90\nG1 X0 B0");
    assert!(found.contains(":7:") && found.contains("E0559") && found.contains(" Z") && found.matches("error").count() == 1, "{found}");
    // Up there a rapid may turn, and a cut that names Z too.
    let (moves, found) = made("G0 B0\nG1 X20 Z5 B20 F300");
    assert!(found.is_empty() && moves.last().is_some_and(|l| l.contains(" Z50 B0")), "{found} {moves:?}");
}

/// After a retract to a place of the machine rotary axes are indexed with the slides where they are, and the next block that names the part's
/// coordinates leads there; a cut that goes by one that no word has named since is told.
#[test]
fn an_index_leaves_the_slides_where_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let made = |base: &str, program: &str| {
        let file = format!("format = 1\nid = \"shop/m\"\nextends = \"generic/{base}\"\n[frames.table]\nposition = [0, 0, -150]\n[[tool]]\nnumber = 1\nname = \"em10\"\nposition = [0, 0, 60]\n");
        std::fs::write(path("m.toml"), file).unwrap();
        std::fs::write(path("a.ngc"), format!("G21 G90 G17 G54\nT1 M6 G43 H1\nS6000 M3\nG0 X30 Y10 Z50\n{program}\nM5\nM2\n")).unwrap();
        let o = run(&["build", &path("a.ngc"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--message-format", "short", "-q"]);
        (text_lines(&o.stdout).into_iter().filter(|l| l.starts_with("G0 ") || l.starts_with("G1 ")).collect::<Vec<_>>(), text(&o.stderr))
    };
    let place = |line: &String| line.split(" F").next().unwrap().to_string();
    for (base, tilt, angles, y) in [("mill5-ac-table", "A", [-45, -60, -75, -90], "Y10"), ("mill5-bc-table", "B", [-45, -60, -75, -90], "Y10")] {
        for angle in angles {
            let (direct, found) = made(base, &format!("G0 X10 Y-50 Z-20 {tilt}{angle} C0\nG1 Y-9 F300\nX30"));
            assert!(found.is_empty(), "{base} {angle}: {found}");
            for retract in ["G53 G0 Z0", "G91 G28 Z0\nG90"] {
                let (moves, found) = made(base, &format!("{retract}\nG0 {tilt}{angle} C0\nG0 X10 Y-50\nZ-20\nG1 Y-9 F300\nX30"));
                assert!(found.is_empty(), "{base} {angle}: {found}");
                // All along the way up there nothing slides.
                let up: Vec<&String> = moves.iter().skip_while(|l| !l.contains(" Z0 ")).take_while(|l| l.contains(" Z0 ")).collect();
                assert!(up.len() > 1 && up.iter().all(|l| l.starts_with(&format!("G0 X30 {y} Z0 "))) && up.last().unwrap().contains(&format!(" {tilt}{angle} ")), "{base} {angle}: {up:?}");
                let cuts = |of: &[String]| of.iter().filter(|l| l.starts_with("G1 ")).map(place).collect::<Vec<_>>();
                assert_eq!(cuts(&moves), cuts(&direct), "{base} {angle}");
                // X and Y first: at the height that the retract has in the program, 90 mm over the part, as `rs274` has it.
                let (over, found) = made(base, &format!("G0 X10 Y-50 Z90 {tilt}{angle} C0"));
                assert!(found.is_empty() && moves.iter().any(|l| Some(l) == over.last()), "{base} {angle}: {found} {over:?} {moves:?}");
            }
            // With a place of the part in the same block what isn't named stays in the part.
            let (moves, found) = made(base, &format!("G53 G0 Z0\nG0 X10 Y-50 {tilt}{angle} C0\nZ-20\nG1 Y-9 F300\nX30"));
            assert!(found.is_empty() && moves.last().map(place) == direct.last().map(place), "{base} {angle}: {found}");
        }
    }
    // Back to the square table too.
    let (moves, found) = made("mill5-ac-table", "G0 X10 Y-50 Z-20 A-90 C0\nG53 G0 Z0\nG0 A0 C90");
    let up: Vec<&String> = moves.iter().skip_while(|l| !l.contains(" Z0 A-90 ")).collect();
    assert!(found.is_empty() && up.len() > 10 && up.iter().all(|l| l.starts_with("G0 X10 Y-180 Z0 ")) && up.last().unwrap().contains(" A0 C90"), "{found} {up:?}");
    for (program, line, axes) in [
        ("G53 G0 Z0\nG0 A-90\nG0 X10 Z-20\nG1 X30 F300", 8, "in Y:"),
        ("G53 G0 Z0\nG0 A-90\nG0 X10 Z-20\nG1 Y-9 F300", 8, "in Y:"),
        ("G53 G0 Z0\nG0 A-90\nG0 X10 Y-50\nG1 Y-9 F300", 8, "in Z:"),
        ("G53 G0 Z0\nG0 A-90\nG0 X10 Y-50\nG91 G1 Z-9 Y5 F300", 8, "in Z:"),
        ("G53 G0 Z0\nG0 A-90\nG38.3 Z-50 F100", 7, "in Y:"),
        ("G53 G0 Z0\nG1 A-90 F300", 6, "in Z:"),
        // The way up leads the tool aside on a part that is tilted.
        ("G0 A-45\nG53 G0 Z0\nG0 Z20\nG1 X20 F300", 8, "in Y:"),
    ] {
        let (moves, found) = made("mill5-ac-table", program);
        assert!(moves.is_empty() && found.contains(&format!(":{line}:")) && found.contains("error[E0559]") && found.contains(axes) && found.matches("error").count() == 1, "{program}: {found}");
    }
    // A feed that names all three comes to the part like a rapid.
    let [(by_feed, found), (by_rapid, _)] = ["G1 X10 Y-50 Z-20 F5000", "G0 X10 Y-50 Z-20"].map(|come| made("mill5-ac-table", &format!("G53 G0 Z0\nG0 A-45\n{come}\nG1 Y-9 F300")));
    assert!(found.is_empty() && by_feed.last().map(place) == by_rapid.last().map(place), "{found} {by_feed:?}");
    // Down from a height that is the machine's, over a place of the part.
    let (moves, found) = made("mill5-ac-table", "G53 G0 Z0\nG0 A-45\nG0 A0\nG0 X5 Y6\nG1 Z2 F300");
    assert!(found.is_empty() && moves.last().is_some_and(|l| l.starts_with("G1 X5 Y6 Z-88 A0 C0 ")), "{moves:?} {found}");
}

/// What a joint's limit is compared with is where the program's move sends it, and not where that was seen first.
#[test]
fn limits_tell_where_the_move_goes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    std::fs::write(path("m.toml"), "format = 1\nid = \"shop/m\"\nextends = \"generic/mill3\"\n[frames.table]\nposition = [0, 0, -10]\n").unwrap();
    for (block, goes) in [("G0 X500", "500"), ("G1 X700 F500", "700"), ("G0 X410", "410"), ("G0 X300\nG2 X300 Y0 I80 J0 F500", "460"), ("G0 X300\nG3 X380 Y80 I80 J0 F500", "460")] {
        std::fs::write(path("a.ngc"), format!("G21 G90 G54\nG0 X0 Y0 Z0\n{block}\nG0 X0 Y0\nM2\n")).unwrap();
        let o = run(&["build", &path("a.ngc"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--message-format", "short", "-q"]);
        let found = text(&o.stderr);
        assert!(found.contains(&format!("would have to go to {goes} mm, its limit is 400 mm")) && found.matches("E0507").count() == 1, "{block}: {found}");
    }
}

/// On a part that the machine file puts somewhere the program goes on from where the machine stands: the places of `rs274` with the same
/// place as a stored offset.
#[test]
fn a_mill_goes_on_from_where_it_stands() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let made = |rotation: u32, program: &str, more: &[&str]| {
        let table = format!("[frames.table]\nposition = [100, 50, -140]\nrotation = [0, 0, {rotation}]\n");
        std::fs::write(path("m.toml"), format!("format = 1\nid = \"t/m\"\nextends = \"generic/mill3\"\n{table}")).unwrap();
        std::fs::write(path("a.ngc"), format!("G21 G90 G54\n{program}\nM2\n")).unwrap();
        let o = run(&[&["build", &path("a.ngc"), "--machine", &path("m.toml"), "--target", "joint-gcode", "--message-format", "short", "-q"], more].concat());
        let place = |line: &str| -> Vec<f64> { line.split(' ').skip(1).take(3).map(|w| w[1..].parse().unwrap()).collect() };
        let moves: Vec<Vec<f64>> = text_lines(&o.stdout).iter().filter(|l| l.starts_with("G0 ") || l.starts_with("G1 ")).map(|l| place(l)).collect();
        (moves, text(&o.stderr))
    };
    let ends = |rotation: u32, program: &str, places: &[[f64; 3]]| {
        let (moves, found) = made(rotation, program, &[]);
        let last = &moves[moves.len().saturating_sub(places.len())..];
        let near = |(m, p): (&Vec<f64>, &[f64; 3])| m.iter().zip(p).all(|(a, b)| (a - b).abs() < 1e-3);
        assert!(last.len() == places.len() && last.iter().zip(places).all(near), "{program}: {moves:?} {found}");
    };
    // A work frame that is rotated: G53 moves the axis that it names, G28 the coordinate.
    let rotated = "G10 L2 P1 X5 Y5 R30\nG0 X10 Y20 Z20\nG53 G0 Z0\nG53 G0 X0\nG0 X10 Y20\nG91 G28 X0";
    ends(0, rotated, &[[103.6603, 77.3205, 0.0], [0.0, 77.3205, 0.0], [103.6603, 77.3205, 0.0], [-7.5657, 13.1042, 0.0]]);
    // A part that is clamped turned; the coordinate that isn't named stays where it is now.
    ends(30, "G0 X10 Y20 Z20\nG53 G0 X0\nG0 X10", &[[98.6603, 72.3205, -120.0], [0.0, 72.3205, -120.0], [73.9952, 115.0417, -120.0]]);
    // Coordinates set where the machine stands, and increments from there.
    ends(0, "G0 X10 Y20 Z20\nG53 G0 Z0\nG92 Z0\nG1 Z-5 F500", &[[110.0, 70.0, -5.0]]);
    ends(0, "G0 X10 Y20 Z20\nG53 G0 Z-10\nG10 L20 P1 X1 Z0\nG0 X3 Z-5", &[[112.0, 70.0, -15.0]]);
    ends(0, "G91 G28 Z0\nG0 X5 Z-5\nG90 G0 Y2", &[[5.0, 0.0, -5.0], [5.0, 52.0, -5.0]]);
    // A cycle rises to R and no way aside, and comes back to where the tool was.
    ends(0, "G99 G81 X5 Y6 Z-3 R150 F500", &[[0.0, 0.0, 10.0], [105.0, 56.0, 10.0], [105.0, 56.0, -143.0], [105.0, 56.0, 10.0]]);
    ends(0, "G0 X0 Y0 Z20\nG92 Z-100\nG53 G0 Z0\nG98 G81 X5 Y6 Z-130 R-125 F500", &[[105.0, 56.0, 0.0], [105.0, 56.0, -145.0], [105.0, 56.0, -150.0], [105.0, 56.0, 0.0]]);
    // As G92 has stored it, offsets come back, however often they were put away.
    let stored = "G0 X0 Y0 Z20\nG53 G0 X120 Y60\nG92 X0 Y0\n";
    for back in ["G92.3", "G92.2\nG92.2\nG0 X1 Y1\nG92.3", "G92.2\nG92.3"] {
        ends(0, &format!("{stored}{back}\nG0 X2 Y2"), &[[122.0, 62.0, -120.0]]);
    }
    // The place of a setup holds for every work offset, also for one that isn't in force.
    std::fs::write(path("at.toml"), "[[setup]]\nname = \"a\"\nfrom_line = 1\nposition = [40, 70, 0]\n").unwrap();
    let (moves, found) = made(0, "G0 X5 Y6 Z50\nG10 L20 P2 X0 Y0\nG55\nG0 X20 Y30", &["--job", &path("at.toml")]);
    assert_eq!(moves.last(), Some(&vec![165.0, 156.0, -90.0]), "{moves:?} {found}");
    // In a job too: up, and not down to Z0 of the part.
    std::fs::write(path("job.toml"), "[[setup]]\nname = \"a\"\nfrom_line = 1\n").unwrap();
    let program = "G0 X10 Y20 Z20\nG1 Z0 F500\nG53 G0 Z0\nG0 X0 Y0 Z20\nG91 G28 Z0";
    assert_eq!(made(0, program, &["--job", &path("job.toml")]), made(0, program, &[]));
    ends(0, program, &[[110.0, 70.0, 0.0], [100.0, 50.0, -120.0], [100.0, 50.0, 0.0]]);
    // What can't be told.
    let cycle = "G0 X10 Y20 Z20\nG53 G0 Z0\nG98 G81 X5 Y5 Z-3 R2 F500";
    let arc = "G0 X10 Y20 Z20\nG53 G0 X100\nG2 X100 Y10 J-5 F500";
    let reference = "G0 X10 Y20 Z20\nG28.1\nG28";
    let asked = "#1=#5422 G53 G0 Z0\n#1=#5422 G0 X0 Y0 Z20\nG0 X1 Y1 Z[#1+5]\nG1 Z[#5422-2] F500";
    let branch = "G53 G0 Z0\no1 if [#<_z> LT 5]\nG0 X0 Y0 Z20\no1 endif\nG0 X3 Y3 Z9";
    for (program, code) in [(cycle, "E0559"), (arc, "E0559"), (reference, "E0561"), (asked, "E0562"), (branch, "E0562")] {
        let (moves, found) = made(0, program, &[]);
        assert!(moves.is_empty() && found.contains(":4:") && found.contains(&format!("error[{code}]")) && found.matches("error").count() == 1, "{program}: {found}");
    }
    // What the program has named is there on any machine, and the number of a work offset is what it is.
    ends(0, "G0 X10 Y20 Z20\n#1=#5422\n#2=[540+10*[#5220-1]]\nG53 G0 Z0\nG0 G[#2/10] Z#1", &[[110.0, 70.0, 0.0], [110.0, 70.0, -120.0]]);
}

/// A file has the name of the program in it; programs of one build have different names on the controller.
#[test]
fn files_are_named_as_their_programs() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let program = "G21 G90\nT1 M6\nG0 X0 Y0 Z20\nG1 Z0 F500\nX20\nG0 Z20\nM30\n";
    for name in ["1 prog.ngc", "a b.ngc", "a_b.ngc", "bracket_left.ngc", "bracket_left2.ngc"] {
        std::fs::write(path(name), program).unwrap();
    }
    let build = |names: &[&str], target: &str| {
        let out = format!("{}/", path(target).display());
        std::fs::create_dir_all(&out).unwrap();
        let files: Vec<String> = names.iter().map(|n| path(n).display().to_string()).collect();
        let mut args = vec!["build", "--machine", CELL, "--target", target, "-o", &out];
        args.extend(files.iter().map(String::as_str));
        let made = run(&args);
        let mut found: Vec<String> = std::fs::read_dir(&out).unwrap().map(|f| f.unwrap().file_name().to_string_lossy().into_owned()).collect();
        found.sort();
        (made.status.success(), found, text(&made.stderr))
    };
    let (good, files, told) = build(&["1 prog.ngc"], "fanuc-ls");
    assert!(good && files == ["P1_PROG.LS"], "{files:?} {told}");
    let (good, files, told) = build(&["bracket_left.ngc", "bracket_left2.ngc"], "inform");
    assert!(good && files.len() == 2 && files.iter().all(|f| f.starts_with("BRAC") && f.len() == 12), "{files:?} {told}");
    let (good, files, told) = build(&["a b.ngc", "a_b.ngc"], "krl");
    assert!(!good && files.is_empty() && told.contains("E0639"), "{files:?} {told}");
}

/// A tool of a mill has its length in the machine file as in a tool table: out of the spindle, and without a table too.
#[test]
fn a_tool_of_a_mill_hangs_down() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_string()
    };
    let part = file("p.ngc", "G21 G90 G54\nT1 M6 G43 H1\nS1000 M3\nG0 X0 Y0 Z20\nG1 Z0 F100\nX10\nM5\nM2\n");
    let cut = |position: &str, table: Option<&str>| {
        let mill = file("m.toml", &format!("format = 1\nid = \"t/m\"\nextends = \"generic/mill3\"\n[frames.table]\nposition = [0, 0, -200]\n[[tool]]\nnumber = 1\nname = \"ball\"\nposition = {position}\n"));
        let table = table.map(|row| file("t.tbl", row));
        let mut args = vec!["build", &part, "--machine", &mill, "--target", "joint-gcode", "--message-format", "short"];
        args.extend(table.iter().flat_map(|t| ["-t", t.as_str()]));
        let made = run(&args);
        let (said, program) = (text(&made.stderr), text(&made.stdout));
        let z = program.lines().find(|l| l.starts_with("G1 X10")).and_then(|l| l.split('Z').nth(1)).and_then(|l| l.split(' ').next()).and_then(|z| z.parse::<f64>().ok());
        (z, said.lines().filter(|l| l.contains("[E0")).map(|l| l.split_once("[E0").map_or("", |(_, rest)| rest).to_string()).collect::<Vec<_>>())
    };
    let long = "[0, 0, 60]";
    assert_eq!(cut(long, None), (Some(-140.0), vec![]));
    assert_eq!(cut(long, Some("T1 P1 Z60 D6\n")), (Some(-140.0), vec![]));
    let (z, said) = cut(long, Some("T1 P1 Z50 D6\n"));
    assert!(z == Some(-140.0) && said[0].contains("makes tool 1 50.000 mm long, the machine file 60.000 mm; the machine file holds"), "{z:?} {said:?}");
    let (z, said) = cut(long, Some("T1 P1 D6\n"));
    assert!(z == Some(-200.0) && said.len() == 1 && said[0].contains("makes tool 1 0.000 mm long, the machine file 60.000 mm; the offset holds"), "{z:?} {said:?}");
    let other = file("o.ngc", "G21 G90 G54\nT3 M6 G43 H3\nG0 X0 Y0 Z20\nG1 Z0 F100\nM2\n");
    cut(long, None);
    let mill = std::fs::read_to_string(folder.path().join("m.toml")).unwrap();
    let of_mill = |table: Option<&str>| {
        let table = table.map(|row| file("t.tbl", row));
        let mut args = vec!["build", &other, "--machine"];
        let path = file("m.toml", &mill);
        args.extend([path.as_str(), "--message-format", "short", "--target", "joint-gcode"]);
        args.extend(table.iter().flat_map(|t| ["-t", t.as_str()]));
        text(&run(&args).stderr)
    };
    assert!(of_mill(None).contains(":2:") && of_mill(None).contains("E0521") && of_mill(None).contains("no tool 3"), "{}", of_mill(None));
    assert!(!of_mill(Some("T3 P3 D6\n")).contains("error"), "{}", of_mill(Some("T3 P3 D6\n")));
    let (z, said) = cut("[0, 0, -60]", None);
    assert!(z.is_none() && said.len() == 1 && said[0].contains("a tool of 60 mm has 60"), "{z:?} {said:?}");
}

/// A block with features on three of its sides (UFSC 2016, part 2), whose workingsteps have two names among them.
const THREE_SIDES: &str = "tests/golden/ufsc2016/example2_3caras.p21";
const SETUPS: [(&str, &[u32], [f64; 3]); 3] = [
    ("XY", &[59, 74, 109, 124, 159, 174, 209, 224, 276], [0.0, 0.0, 0.0]),
    ("XZ", &[329, 364, 379, 414, 429, 464, 479, 514, 529, 564, 579], [-90.0, 0.0, 0.0]),
    ("ZY", &[615, 630, 665, 680, 715, 730], [0.0, 90.0, 0.0]),
];

/// A job that clamps it three times, each side upward and so high above the table.
fn three_clampings(heights: [f64; 3]) -> String {
    let one = |((name, steps, rotation), height): (&(&str, &[u32], [f64; 3]), f64)| {
        let steps: Vec<String> = steps.iter().map(|s| format!("\"#{s}\"")).collect();
        format!("[[setup]]\nname = \"{name}\"\nworkingsteps = [{}]\nposition = [0, 0, {height:?}]\nrotation = {rotation:?}\n", steps.join(", "))
    };
    SETUPS.iter().zip(heights).map(one).collect()
}

/// Machines that can't turn the tool make it in three clampings, an arm can: every cut ends, and every arc bends, where the plan has it.
#[test]
fn three_sides_in_three_clampings() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let units = ["--step-overlap", "percent", "--step-units", "step-modeler"];
    let plan = run(&[&["build", THREE_SIDES, "--target", "motion"], &units[..]].concat());
    let plan = gr_ir::text::parse(&text(&plan.stdout)).unwrap_or_else(|e| panic!("{e:?}"));
    let tools: String = (1..=4).map(|n| format!("[[tool]]\nnumber = {n}\nname = \"t{n}\"\nposition = [0, 0, 70]\n")).collect();
    let machines = [
        ("adept/one", "[frames.table]\nposition = [300, 200, 745]\n".to_string(), [-215.0, -50.0, -50.0]),
        ("generic/mill3", "[[joint]]\nname = \"Z\"\nmin = -900\n[frames.table]\nposition = [0, 0, -300]\n".to_string(), [0.0; 3]),
        ("abb/irb2400", format!("[frames.table]\nposition = [850, 0, 500]\n[home]\njoints = [0, -20, 20, 0, 60, 0]\n{tools}"), [0.0; 3]),
    ];
    for (id, more, heights) in machines {
        let file = format!("format = 1\nid = \"shop/m\"\ntitle = \"m\"\nextends = \"{id}\"\n{more}");
        std::fs::write(path("m.toml"), &file).unwrap();
        std::fs::write(path("job.toml"), three_clampings(heights)).unwrap();
        let (machine, job, out) = (path("m.toml"), path("job.toml"), path("o.ngc"));
        let args = ["build", THREE_SIDES, "--machine", &machine, "--job", &job, "--target", "joint-gcode", "--message-format", "short", "-o", &out];
        let made = run(&[&args[..], &units].concat());
        assert!(made.status.success(), "{id}: {}", text(&made.stderr));
        let program = std::fs::read_to_string(&out).unwrap();
        let stops: Vec<&str> = program.lines().filter(|l| l.starts_with("(MSG, setup") || *l == "M0").collect();
        assert_eq!(stops, ["(MSG, setup XZ)", "M0", "(MSG, setup ZY)", "M0"], "{id}");

        let machine = gr_machine::parse(gr_ir::FileId(0), &file).unwrap();
        let tool = machine.tool_of_length(70.0);
        let tip = |row: &str| {
            let values = row.split(',').skip(1).zip(&machine.joints).map(|(v, j)| {
                let v: f64 = v.parse().unwrap();
                if j.kind == gr_machine::JointKind::Revolute { v.to_radians() } else { v }
            });
            machine.kinematics().forward_frame(&values.collect::<Vec<_>>()).unwrap().then(&tool).position
        };
        let table = std::fs::read_to_string(path("o-joint.csv")).unwrap();
        let way: Vec<[f64; 3]> = table.lines().skip(1).map(tip).collect();
        let apart = |a: [f64; 3], b: [f64; 3]| gr_machine::math::norm(gr_machine::math::sub(a, b));
        let (mut cursor, mut place, mut at, mut cuts, mut arcs) = (plan.cursor(), gr_machine::math::Frame::IDENTITY, 0, 0, 0);
        while let Some(view) = cursor.next() {
            if let gr_ir::Op::Begin { marker: gr_ir::Marker::Workingstep, code, .. } = view.op {
                let k = SETUPS.iter().position(|(_, steps, _)| steps.contains(&(code as u32))).unwrap();
                let turn = gr_machine::math::euler(SETUPS[k].2.map(f64::to_radians));
                place = machine.cell.table.then(&gr_machine::math::Frame { turn, position: [0.0, 0.0, heights[k]] });
            }
            if !matches!(view.op, gr_ir::Op::Linear | gr_ir::Op::Arc(_)) {
                continue;
            }
            let end = place.apply(view.end.xyz());
            let found = way[at..].iter().position(|p| apart(*p, end) < 1e-3).unwrap_or_else(|| panic!("{id}: no way to {:?} of line {}", view.end.xyz(), view.source.line + 1));
            if let gr_ir::Op::Arc(arc) = view.op {
                let middle = place.apply(gr_ir::geometry::ArcShape::new(&arc, view.start, view.end).point(0.5));
                let off = way[at..=at + found].windows(2).map(|w| beside(middle, w[0], w[1])).fold(f64::INFINITY, f64::min);
                assert!(off < 0.02, "{id}: {off} mm beside the arc of line {}", view.source.line + 1);
                arcs += 1;
            }
            at += found;
            cuts += 1;
        }
        assert_eq!((cuts, arcs), (575, 146), "{id}");
        if id != "generic/mill3" {
            continue;
        }
        // A restart has the rows of the whole program, in the setups that are left.
        let rows = |text: &str| text.lines().filter(|l| l.starts_with("G1 ")).map(String::from).collect::<Vec<_>>();
        let whole = rows(&program);
        for (line, stops) in [("126", 2), ("346", 1), ("381", 1), ("632", 0), ("700", 0)] {
            let made = run(&[&args[..], &units, &["--from-line", line]].concat());
            assert!(made.status.success(), "{line}: {}", text(&made.stderr));
            let program = std::fs::read_to_string(&out).unwrap();
            let rest = rows(&program);
            // The last of the way there may be fed.
            let own = (0..2).any(|k| whole.ends_with(&rest[k..]));
            assert!(rest.len() > 5 && rest.len() < whole.len() && own, "{line}: {} of {}", rest.len(), whole.len());
            assert_eq!(program.lines().filter(|l| l.starts_with("(MSG, setup")).count(), stops, "{line}");
        }
    }
}

/// Distance of a place from the way between two others.
fn beside(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    use gr_machine::math::{dot, norm, scale, sub};
    let (way, to) = (sub(b, a), sub(p, a));
    let share = if norm(way) > 0.0 { (dot(way, to) / dot(way, way)).clamp(0.0, 1.0) } else { 0.0 };
    norm(sub(to, scale(way, share)))
}

/// Workingsteps that share a name are told apart by their instance names; what is no such name, or is meant twice, is told.
#[test]
fn workingsteps_by_their_instance_names() {
    let folder = tempfile::tempdir().unwrap();
    let job = folder.path().join("job.toml");
    let told = |setups: &[&str]| {
        let one = |(i, steps): (usize, &&str)| format!("[[setup]]\nname = \"s{i}\"\nworkingsteps = [{steps}]\nposition = [0, 0, 0]\n");
        std::fs::write(&job, setups.iter().enumerate().map(one).collect::<String>()).unwrap();
        let made = run(&["check", THREE_SIDES, "--machine", "generic/mill3", "--step-overlap", "percent", "--step-units", "step-modeler", "--job", job.to_str().unwrap()]);
        text(&made.stderr) + &text(&made.stdout)
    };
    let help = "workingsteps that share a name are told apart by their instance names, as in \"#59\"; `--target plan` lists them";
    for (setups, what) in [
        (&["\"Pocket_RGH\"", "\"Pocket_RGH\""][..], "workingstep `Pocket_RGH` stands in setup `s0` too"),
        (&["\"Pocket_RGH\"", "\"#276\""], "workingstep `#276` stands in setup `s0` too, as `Pocket_RGH`"),
        (&["\"#329\", \"Pocket_RGH\""], "workingstep `Pocket_RGH` stands here too, as `#329`"),
        (&["\"Pocket\""], "the program has no workingstep `Pocket`; it has Plane Base Hole_RGH, Pocket_RGH"),
        // It is in the file, and in no workplan.
        (&["\"#48\""], "the program has no workingstep `#48`; it has #59, #74, #109"),
    ] {
        let all = told(setups);
        assert!(all.contains("E0551") && all.contains(what) && all.contains(help), "{setups:?}: {all}");
    }
    let good = told(&["\"Plane Base Hole_RGH\"", "\"#276\"", "\"#329\""]);
    assert!(!good.contains("E0551"), "{good}");
}
