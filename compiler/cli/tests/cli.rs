//! The command as its users see it: run on files, output, exit status.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

fn command(args: &[&str]) -> Command {
    let mut c = Command::new(env!("CARGO_BIN_EXE_gcc-robot"));
    c.args(args).current_dir(fixtures()).env_remove("NO_COLOR").env_remove("GCC_ROBOT_LINUXCNC").stdin(Stdio::null());
    c
}

fn run(args: &[&str]) -> Output {
    command(args).output().unwrap()
}

fn in_folder(folder: &Path, args: &[&str]) -> Output {
    command(args).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Exit status, standard output and standard error in one text.
fn whole(o: &Output) -> String {
    format!("exit {}\n--- out\n{}--- err\n{}", o.status.code().unwrap(), text(&o.stdout), text(&o.stderr))
}

fn code(o: &Output) -> i32 {
    o.status.code().unwrap()
}

/// Tool tables, machine files and settings are stored files: a pipe that nobody writes to, or a terminal, is not waited for. A program
/// may come from one.
#[cfg(unix)]
#[test]
fn what_a_program_is_set_up_with_comes_from_no_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let pipe = pipe.to_str().unwrap();
    std::fs::write(folder.path().join("part.ngc"), "G21 G90\nG0 X1\nM2\n").unwrap();
    std::fs::write(folder.path().join("mill.ini"), format!("[EMCIO]\nTOOL_TABLE = {pipe}\n")).unwrap();
    for option in ["--tools", "--ini", "--vars", "--machine"] {
        let mut child = command(&["check", "part.ngc", option, pipe]).current_dir(folder.path()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let begun = std::time::Instant::now();
        while child.try_wait().unwrap().is_none() {
            assert!(begun.elapsed().as_secs() < 30 || child.kill().is_err(), "{option} waits for a pipe");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let told = whole(&child.wait_with_output().unwrap());
        assert!(told.contains("E0821") && told.contains("it is a pipe or a device"), "{option}: {told}");
    }
    // A table that the INI file names is left out where there is no such file.
    assert_eq!(code(&in_folder(folder.path(), &["check", "part.ngc", "--ini", "mill.ini"])), 0);
    // The program itself.
    let mut child = command(&["check", "/dev/stdin"]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), b"G21 G90\nG0 X1\nM2\n").unwrap();
    assert_eq!(code(&child.wait_with_output().unwrap()), 0);
}

#[test]
fn check_for_people() {
    insta::assert_snapshot!(whole(&run(&["check", "faulty.ngc"])));
    insta::assert_snapshot!("call_trace", whole(&run(&["check", "loop.ngc"])));
    insta::assert_snapshot!("all_good", whole(&run(&["check", "part.ngc"])));
    assert!(text(&run(&["check", "faulty.ngc", "--color", "always"]).stderr).contains("\x1b["));
    assert!(!text(&run(&["check", "faulty.ngc"]).stderr).contains('\x1b'));
}

#[test]
fn check_for_machines() {
    for format in ["short", "json", "github"] {
        let o = run(&["check", "faulty.ngc", "part.ngc", "--message-format", format]);
        insta::assert_snapshot!(format, whole(&o));
    }
    let o = run(&["check", "faulty.ngc", "part.ngc", "--message-format", "json"]);
    assert!(text(&o.stdout).lines().all(|l| serde_json::from_str::<serde_json::Value>(l).is_ok()));
    let o = run(&["check", "faulty.ngc", "--message-format", "sarif"]);
    let log: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap();
    assert_eq!(log["version"], "2.1.0");
    let run = &log["runs"][0];
    let rules: Vec<_> = run["tool"]["driver"]["rules"].as_array().unwrap().iter().map(|r| &r["id"]).collect();
    for result in run["results"].as_array().unwrap() {
        assert!(rules.contains(&&result["ruleId"]));
        assert!(result["locations"][0]["physicalLocation"]["region"]["startLine"].as_u64().unwrap() > 0);
    }
    for rule in run["tool"]["driver"]["rules"].as_array().unwrap() {
        assert!(!rule["shortDescription"]["text"].as_str().unwrap().contains('{'), "{rule}");
    }
}

#[test]
fn check_folders_and_jobs() {
    let one = run(&["check", ".", "--message-format", "json", "-j", "1"]);
    let many = run(&["check", ".", "--message-format", "json", "-j", "8"]);
    assert_eq!(text(&one.stdout), text(&many.stdout), "the number of threads changes nothing");
    assert_eq!(code(&one), 1);
    let empty = tempfile::tempdir().unwrap();
    assert_eq!(code(&run(&["check", empty.path().to_str().unwrap()])), 1);
    assert_eq!(code(&in_folder(empty.path(), &["check"])), 2, "nothing to check");
}

#[test]
fn lints_can_be_set() {
    let folder = tempfile::tempdir().unwrap();
    let program = "G21 G90 G94 F100\nS1000 M3\nG1 X1\nM5\nG1 X2\nM2\n";
    std::fs::write(folder.path().join("a.ngc"), program).unwrap();
    let check = |more: &[&str]| code(&in_folder(folder.path(), &[&["check", "a.ngc"], more].concat()));
    assert_eq!(check(&[]), 0);
    assert_eq!(check(&["--strict"]), 1);
    assert_eq!(check(&["--deny", "spindle/stopped"]), 1);
    assert_eq!(check(&["--strict", "--allow", "E0280"]), 0);
    assert_eq!(check(&["--allow", "no/such"]), 2);
    assert_eq!(check(&["--allow", "arc/radius-mismatch"]), 2, "an error is no lint");
    std::fs::write(folder.path().join("gcc-robot.toml"), "schema = 1\n[lints]\nstrict = true\n").unwrap();
    assert_eq!(check(&[]), 1);
}

#[test]
fn files_that_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("empty.ngc"), "").unwrap();
    std::fs::write(at.join("binary.ngc"), (0..=255).cycle().take(5000).collect::<Vec<u8>>()).unwrap();
    std::fs::write(at.join("utf16.ngc"), b"\xFF\xFEG\x002\x001\x00\n\x00M\x002\x00\n\x00").unwrap();
    std::fs::write(at.join("cr.ngc"), "G21\rG90\rM2\r").unwrap();
    std::fs::create_dir(at.join("folder.ngc")).unwrap();
    assert_eq!(code(&in_folder(at, &["check", "missing.ngc"])), 3);
    assert_eq!(code(&in_folder(at, &["build", "folder.ngc"])), 3);
    assert_eq!(code(&in_folder(at, &["check", "empty.ngc"])), 1);
    let o = in_folder(at, &["check", "binary.ngc", "--message-format", "short"]);
    assert!(code(&o) == 3 && text(&o.stderr).matches("error[").count() == 1 && text(&o.stderr).contains("E0841"));
    // LinuxCNC knows no UTF-16.
    assert_eq!(code(&in_folder(at, &["check", "utf16.ngc"])), 1);
    assert_eq!(code(&in_folder(at, &["check", "utf16.ngc", "--dialect", "fanuc-mill"])), 0);
    assert_eq!(code(&in_folder(at, &["check", "cr.ngc"])), 0);
    let huge = std::fs::File::create(at.join("huge.ngc")).unwrap();
    huge.set_len(3 << 30).unwrap();
    let o = in_folder(at, &["check", "huge.ngc", "--message-format", "short"]);
    assert_eq!(code(&o), 3);
    assert!(text(&o.stderr).contains("E0823"));
}

#[test]
fn build_targets() {
    for target in ["canon", "motion", "rs274ngc", "csv", "sheet"] {
        insta::assert_snapshot!(format!("build_{target}"), whole(&run(&["build", "part.ngc", "--target", target])));
    }
    for target in ["json", "svg", "png", "html", "sheet-json", "sheet-html"] {
        let o = run(&["build", "part.ngc", "--target", target]);
        assert!(code(&o) == 0 && o.stdout.len() > 100, "{target}: {}", text(&o.stderr));
    }
    let twice = || run(&["build", "part.ngc", "--target", "png"]).stdout;
    assert_eq!(twice(), twice());
    assert_eq!(code(&run(&["build", "part.ngc", "--target", "nothing"])), 2);
}

#[test]
fn build_writes_all_or_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["part.ngc", "faulty.ngc"] {
        std::fs::copy(fixtures().join(name), at.join(name)).unwrap();
    }
    assert_eq!(code(&in_folder(at, &["build", "part.ngc", "faulty.ngc", "-o", "out/"])), 1);
    assert!(!at.join("out").exists());
    assert_eq!(code(&in_folder(at, &["build", "part.ngc", "-o", "part.ngc"])), 1, "never over the source");
    assert_eq!(std::fs::read(at.join("part.ngc")).unwrap(), std::fs::read(fixtures().join("part.ngc")).unwrap());
    let o = in_folder(at, &["build", "part.ngc", "-o", "out/x.ngc", "--depfile", "out/x.d"]);
    assert_eq!(code(&o), 0, "{}", text(&o.stderr));
    assert_eq!(std::fs::read_to_string(at.join("out/x.d")).unwrap(), "out/x.ngc: \\\n  part.ngc\n\npart.ngc:\n");
    assert_eq!(std::fs::read_dir(at.join("out")).unwrap().count(), 2, "no temporary files stay");
    assert_eq!(code(&in_folder(at, &["diff", "part.ngc", "out/x.ngc", "--tolerance", "0.0001"])), 0);
}

#[test]
fn a_project() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    assert_eq!(code(&in_folder(at, &["init"])), 0);
    assert_eq!(code(&in_folder(at, &["init"])), 3, "an existing file stays");
    std::fs::copy(fixtures().join("part.ngc"), at.join("part.ngc")).unwrap();
    let o = in_folder(at, &["build"]);
    assert_eq!(code(&o), 0, "{}", text(&o.stderr));
    assert!(at.join("build/part.ngc").is_file());
    // make and ninja know the files by the names that they have from the project's folder.
    assert_eq!(code(&in_folder(at, &["build", "--depfile", "d.d"])), 0);
    let rule = std::fs::read_to_string(at.join("d.d")).unwrap();
    assert!(rule.starts_with("build/part.ngc: \\\n  part.ngc"), "{rule}");
    std::fs::write(at.join("gcc-robot.toml"), "schema = 1\n[project]\nsorces = []\n").unwrap();
    insta::assert_snapshot!(whole(&in_folder(at, &["check"])).replace(&*at.to_string_lossy(), "FOLDER"));
}

/// What a project names and there is not: told where the project names it, by `check` and `build`.
#[test]
fn a_project_with_wrong_names() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("a.ngc"), "G21 G90\nG0 X1\nM2\n").unwrap();
    for (text, place, code_of) in [
        ("[project]\ndialect = \"foo\"\n", "3:11", "E0834"),
        ("[[dialects]]\nfiles = \"*\"\ndialect = \"foo\"\n", "4:11", "E0834"),
        ("[project]\ntools = \"no.tbl\"\n", "3:9", "E0820"),
        ("[project]\nini = \"no.ini\"\n", "3:7", "E0820"),
        ("[project]\nmachine = \"no/such\"\n", "3:11", "E0820"),
        ("[lints]\nallow = [\"no/such\"]\n", "3:10", "E0804"),
        ("[[targets]]\ntarget = \"rs275\"\n", "3:10", "E0846"),
        ("[[targets]]\ntarget = \"rs274ngc\"\ndecimal = 3\n", "4:11", "E0847"),
        ("[project]\nmaschine = 3\n", "3:1", "E0831"),
    ] {
        std::fs::write(at.join("gcc-robot.toml"), format!("schema = 1\n{text}")).unwrap();
        for command in [&["check", "a.ngc"][..], &["build"]] {
            let o = in_folder(at, &[command, &["--message-format", "short"]].concat());
            let told = text_of_first(&o);
            // A file that is not there ends with 3, what is written wrongly with 1.
            assert_eq!(code(&o), if code_of == "E0820" { 3 } else { 1 }, "{text}: {}", whole(&o));
            assert!(told.contains(&format!("gcc-robot.toml:{place}: error[{code_of}]")), "{text}: {told}");
        }
    }
    std::fs::remove_file(at.join("gcc-robot.toml")).unwrap();
    let job = in_folder(at, &["build", "a.ngc", "--target", "inform", "--machine", "abb/irb140", "--job", "no.toml"]);
    assert!(whole(&job).contains("there is no file no.toml"), "{}", whole(&job));
}

/// Of programs that are named, project and subroutines are looked for from where the program lies, as the editor does.
#[test]
fn programs_are_run_as_where_they_lie() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let write = |name: &str, text: &str| {
        std::fs::create_dir_all(at.join(name).parent().unwrap()).unwrap();
        std::fs::write(at.join(name), text).unwrap();
    };
    write("q/shop.ngc", "G21 G90 F100\no<pocket> call\nM2\n");
    write("q/pocket.ngc", "o<pocket> sub\nG1 X7\no<pocket> endsub\n");
    // A file of the same name where the command runs is another one.
    write("pocket.ngc", "o<pocket> sub\nG1 X[1/0]\no<pocket> endsub\n");
    let absolute = at.join("q/shop.ngc").display().to_string();
    for program in ["q/shop.ngc", "./q/../q/shop.ngc", &absolute] {
        let o = in_folder(at, &["check", program]);
        assert_eq!(code(&o), 0, "{program}: {}", whole(&o));
        let o = in_folder(at, &["build", program, "--target", "canon"]);
        assert!(code(&o) == 0 && text(&o.stdout).contains("STRAIGHT_FEED(7.0000"), "{program}: {}", whole(&o));
    }
    let o = in_folder(at, &["diff", "q/shop.ngc", &absolute]);
    assert_eq!(code(&o), 0, "{}", whole(&o));
    let o = in_folder(at, &["preview", "q/shop.ngc", "-o", "q.svg"]);
    assert_eq!(code(&o), 0, "{}", whole(&o));
    assert_eq!(code(&in_folder(&at.join("q"), &["check", "shop.ngc"])), 0);

    let cut = "G21 G90 G17 F300\nT1 M6\nG43 H1\nG0 X0 Y0 Z5\nG1 Z-1\nM2\n";
    for (part, length) in [("a", "50"), ("b", "60")] {
        write(&format!("{part}/part.ngc"), cut);
        write(&format!("{part}/t.tbl"), &format!("T1 P1 D10 Z{length}\n"));
        write(&format!("{part}/gcc-robot.toml"), "schema = 1\n[project]\ntools = \"t.tbl\"\nsources = [\"*.ngc\"]\n[[targets]]\ntarget = \"canon\"\noutput = \"{name}.canon\"\n");
        let o = in_folder(at, &["build", &format!("{part}/part.ngc"), "--target", "canon"]);
        assert!(text(&o.stdout).contains(&format!("USE_TOOL_LENGTH_OFFSET(0.0000 0.0000 {length}.0000")), "{}", whole(&o));
    }
    // Each by its own project, in one command too.
    let o = in_folder(at, &["build", "a/part.ngc", "q/shop.ngc", "--target", "canon", "-o", "out/"]);
    assert_eq!(code(&o), 0, "{}", whole(&o));
    assert!(std::fs::read_to_string(at.join("out/part.canon")).unwrap().contains("50.0000"));
    let o = in_folder(at, &["diff", "a/part.ngc", "b/part.ngc"]);
    assert_eq!(code(&o), 1, "{}", whole(&o));
}

/// Programs of a Fanuc control are files of the names that it gives them, and open with `%`.
#[test]
fn fanuc_subprograms_are_files_of_their_number() {
    for name in ["O2000.nc", "O2000.NC", "O2000", "2000.nc", "2000.ngc", "o2000.nc"] {
        for head in ["", "%\n", "\n%\n"] {
            let folder = tempfile::tempdir().unwrap();
            let at = folder.path();
            std::fs::write(at.join(name), format!("{head}O2000\nG1 X77. F100.\nM99\n%\n")).unwrap();
            std::fs::write(at.join("O1234.nc"), "%\nO1234\nG21 G90 G54\nM98 P2000\nG65 P2000\nM30\n%\n").unwrap();
            let o = in_folder(at, &["build", "O1234.nc", "--dialect", "fanuc-mill", "--target", "canon"]);
            assert!(code(&o) == 0 && text(&o.stdout).matches("77.0000").count() >= 1, "{name} {head:?}: {}", whole(&o));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("O0012.nc"), "%\nO0012\nG1 X77. F100.\nM99\n%\n").unwrap();
    std::fs::write(at.join("a.nc"), "%\nO1\nG21 G90 G54\nM98 P12\nM30\n%\n").unwrap();
    let o = in_folder(at, &["check", "a.nc", "--dialect", "fanuc-mill"]);
    assert_eq!(code(&o), 0, "{}", whole(&o));
}

/// Names in a project file are relative to it, wherever the command runs.
#[test]
fn names_in_a_project_are_relative_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir_all(at.join("cell/parts")).unwrap();
    let cell = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/irb2400-cell.toml");
    std::fs::copy(cell, at.join("cell/cell.toml")).unwrap();
    std::fs::write(at.join("cell/parts/a.ngc"), "G21 G90 G17 G54\nT1 M6\nS12000 M3\nG0 X10 Y0 Z5\nG1 X20 F600\nM2\n").unwrap();
    for machine in ["cell.toml", "./cell.toml"] {
        let project = format!("schema = 1\n[project]\nsources = [\"parts/*.ngc\"]\nmachine = \"{machine}\"\n[[targets]]\ntarget = \"rapid\"\noutput = \"{{name}}.mod\"\n");
        std::fs::write(at.join("cell/gcc-robot.toml"), project).unwrap();
        for (from, words) in [(".", &["build", "--project", "cell"][..]), ("cell", &["build"]), ("cell/parts", &["build"]), (".", &["check", "cell/parts/a.ngc"]), ("cell/parts", &["check"])] {
            let o = in_folder(&at.join(from), words);
            assert_eq!(code(&o), 0, "{machine} {from} {words:?}: {}", whole(&o));
        }
        assert!(at.join("cell/a.mod").is_file());
    }
}

fn text_of_first(o: &Output) -> String {
    text(&o.stderr).lines().next().unwrap_or_default().to_string()
}

#[test]
fn reference_ufmg2008() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("a.g"), "G00 X50 Y50 C-60\nG01 X60 Y50 C-60 F10\n").unwrap();
    let o = in_folder(at, &["build", "a.g", "--target", "joint-gcode", "--reference", "ufmg2008", "-o", "b.g"]);
    assert_eq!(code(&o), 0, "{}", text(&o.stderr));
    let [program, space, joints] = ["b.g", "b-cartesian.csv", "b-joint.csv"].map(|name| std::fs::read_to_string(at.join(name)).unwrap());
    let first = |text: &str, n: usize| text.lines().take(n).collect::<Vec<_>>().join("|");
    assert_eq!(first(&program, 2), "G01 X90 Y-90 Z-90 F0|G01 X136,92 Y-93,84 Z-103,07 F1954,42");
    assert_eq!(first(&space, 3), "t;X;Y;Z;A;B;C|0;100;0;0;0;0;-90|0,025;50;50;0;0;0;-60");
    assert_eq!(first(&joints, 3), "t;J1;J2;J3|0;90;-90;-90|0,025;136,92;-93,84;-103,07");
    assert_eq!((space.lines().count(), joints.lines().count()), (program.lines().count() + 1, program.lines().count() + 1));
    // In a folder the joints have the name that the interface gives them.
    let o = in_folder(at, &["build", "a.g", "--target", "joint-gcode", "--reference", "ufmg2008", "-o", "out/"]);
    let mut names: Vec<String> = std::fs::read_dir(at.join("out")).unwrap().map(|f| f.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    assert_eq!((code(&o), names.join("|").as_str()), (0, "a - juntas-cartesian.csv|a - juntas-joint.csv|a - juntas.g"), "{}", whole(&o));
    // What it writes it reads: the first line, with F0, is where it begins.
    let o = in_folder(at, &["check", "b.g"]);
    assert_eq!(code(&o), 0, "{}", whole(&o));
    let o = in_folder(at, &["build", "b.g", "--target", "motion"]);
    assert!(code(&o) == 0 && text(&o.stdout).contains("rapid x=90 y=-90 z=-90 @0:1"), "{}", whole(&o));
    for (program, good) in [("G00 X5 F0\nG01 X5 F0\n", true), ("G00 X5 F0\nG01 X6 F0\n", false), ("G01 X5 F0\nG01 X6\n", false), ("G02 X5 I3 J0 K0 F0\n", false)] {
        std::fs::write(at.join("c.g"), program).unwrap();
        let o = in_folder(at, &["check", "c.g"]);
        assert_eq!((code(&o) == 0, text(&o.stderr).contains("E0239")), (good, !good), "{program}{}", whole(&o));
    }
}

/// Words that a program in the coordinates of the arm leaves out keep their values, also in what is made of it; what it moves later than at
/// once depends on where the machine stands.
#[test]
fn programs_of_the_arm_become_others() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (program, told) in [("G0 X110 Y40\nG1 X100 Y50 F20\n", false), ("G1 X120 Y20 C-80 F20\nG2 X100 Y20 I110 J20 K0\n", false), ("G0 X110\nG1 Y40 F20\n", true)] {
        std::fs::write(at.join("a.g"), program).unwrap();
        for words in [&["build", "a.g"][..], &["build", "a.g", "--to", "fanuc-mill"], &["build", "a.g", "--to", "grbl"], &["verify", "a.g"], &["verify", "a.g", "--machine", "ufmg/plano-3r"]] {
            if program.contains('C') && words.contains(&"grbl") {
                continue;
            }
            let o = in_folder(at, words);
            assert_eq!((code(&o), text(&o.stderr).contains("E0607")), (0, told), "{program} {words:?}: {}", whole(&o));
        }
    }
}

#[test]
fn other_commands() {
    insta::assert_snapshot!("explain", whole(&run(&["explain", "E0203"])));
    insta::assert_snapshot!("explain_code", whole(&run(&["explain", "g04"])));
    assert_eq!(code(&run(&["explain", "nonsense"])), 2);
    assert!(text(&run(&["explain", "--list"]).stdout).lines().count() > 100);
    assert!(text(&run(&["target", "list"]).stdout).contains("rs274ngc"));
    assert_eq!(code(&run(&["target", "show", "rs274ngc"])), 0);
    assert!(text(&run(&["machine", "list"]).stdout).contains("generic/mill3"));
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(run(&["completions", shell]).stdout.len() > 1000);
    }
    assert_eq!(code(&run(&["no-such-command"])), 2);
    assert_eq!(code(&run(&["--version"])), 0);
    insta::assert_snapshot!("diff", whole(&run(&["diff", "part.ngc", "other.ngc"])));
    // A length that only the machine knows can't be said in grbl's language; with the tool table it can.
    assert_eq!(code(&run(&["verify", "part.ngc", "--to", "grbl"])), 1);
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("tool.tbl");
    std::fs::write(&table, "T1 P1 Z50 D10\n").unwrap();
    assert_eq!(code(&run(&["verify", "part.ngc", "--to", "grbl", "--tools", &table.display().to_string()])), 0);
}

/// `--watch` builds again when a program changes, also after a mistake in it.
#[test]
fn watching() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let write = |x: &str| std::fs::write(at.join("a.ngc"), format!("G21 G90\n{x}\nM2\n")).unwrap();
    write("G0 X1");
    let mut child = command(&["build", "a.ngc", "--target", "canon", "-o", "a.canon", "--watch", "-q"])
        .current_dir(at)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let wait_for = |what: &str| {
        let until = std::time::Instant::now() + std::time::Duration::from_secs(120);
        while !std::fs::read_to_string(at.join("a.canon")).is_ok_and(|t| t.contains(what)) {
            if std::time::Instant::now() > until {
                return false;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        true
    };
    let mut seen = vec![wait_for("STRAIGHT_TRAVERSE(1.0000")];
    write("G0 X[");
    std::thread::sleep(std::time::Duration::from_millis(1500));
    // The last good result stays.
    seen.push(wait_for("STRAIGHT_TRAVERSE(1.0000"));
    write("G0 X22");
    seen.push(wait_for("STRAIGHT_TRAVERSE(22.0000"));
    let running = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(running && seen == [true, true, true], "{running} {seen:?}");
}

/// A subroutine file that is missing, goes or comes back makes another build.
#[test]
fn watching_a_subroutine() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let sub = |x: &str| std::fs::write(at.join("lib").join("ss.ngc"), format!("o<ss> sub\nG0 X{x}\no<ss> endsub\n")).unwrap();
    std::fs::create_dir(at.join("lib")).unwrap();
    std::fs::write(at.join("a.ngc"), "G21 G90\no<ss> call\nM2\n").unwrap();
    let log = std::fs::File::create(at.join("log")).unwrap();
    let mut child = command(&["build", "a.ngc", "--target", "canon", "-o", "a.canon", "--subs", "lib", "--watch"]).current_dir(at).stderr(log).spawn().unwrap();
    let wait_for = |file: &str, what: &str, times: usize| {
        let until = std::time::Instant::now() + std::time::Duration::from_secs(120);
        let there = || std::fs::read_to_string(at.join(file)).is_ok_and(|t| t.matches(what).count() >= times);
        while !there() && std::time::Instant::now() < until {
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        there()
    };
    let mut seen = vec![wait_for("log", "E0250", 1)];
    sub("1");
    seen.push(wait_for("a.canon", "STRAIGHT_TRAVERSE(1.0000", 1));
    std::fs::remove_file(at.join("lib").join("ss.ngc")).unwrap();
    seen.push(wait_for("log", "E0250", 2));
    sub("2");
    seen.push(wait_for("a.canon", "STRAIGHT_TRAVERSE(2.0000", 1));
    // One that is found sooner.
    std::fs::write(at.join("ss.ngc"), "o<ss> sub\nG0 X3\no<ss> endsub\n").unwrap();
    seen.push(wait_for("a.canon", "STRAIGHT_TRAVERSE(3.0000", 1));
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(seen, [true; 5]);
}

#[test]
fn a_folder_of_subroutines_that_is_not_there_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("a.ngc"), "G21 G90\nG0 X1\nM2\n").unwrap();
    let check = |args: &[&str]| {
        let out = in_folder(at, &[&["check", "a.ngc"], args].concat());
        (code(&out), String::from_utf8_lossy(&out.stderr).into_owned() + &String::from_utf8_lossy(&out.stdout))
    };
    let (status, text) = check(&["--subs", "lib"]);
    assert!(status != 0 && text.contains("E0820") && text.contains("lib"), "{status} {text}");
    std::fs::write(at.join("gcc-robot.toml"), "schema = 1\n[project]\nsubs = [\"lib\"]\n").unwrap();
    let (status, text) = check(&[]);
    assert!(status != 0 && text.contains("E0820") && text.contains("gcc-robot.toml:3"), "{status} {text}");
    std::fs::create_dir(at.join("lib")).unwrap();
    assert_eq!(check(&["--subs", "lib"]).0, 0);
    assert_eq!(check(&[]).0, 0);
}

/// A source that comes to a watched project is built too.
#[test]
fn watching_a_project() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let write = |name: &str| std::fs::write(at.join(name), "G21 G90\nG0 X1\nM2\n").unwrap();
    std::fs::write(at.join("gcc-robot.toml"), "schema = 1\n[project]\nsources = [\"*.ngc\"]\n[[targets]]\ntarget = \"canon\"\noutput = \"{name}.canon\"\n").unwrap();
    write("a.ngc");
    let mut child = command(&["build", "--watch", "-q"]).current_dir(at).stderr(Stdio::null()).spawn().unwrap();
    let wait_for = |name: &str| {
        let until = std::time::Instant::now() + std::time::Duration::from_secs(120);
        while !at.join(name).is_file() && std::time::Instant::now() < until {
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        at.join(name).is_file()
    };
    let first = wait_for("a.canon");
    write("b.ngc");
    let second = wait_for("b.canon");
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(first && second, "{first} {second}");
}

/// `diff` tells apart what no path of the simulation shows.
#[test]
fn differences_beside_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let base = "g21 g90\nt1 m6 g43 h1\ns1000 m3\ng0 x0 y0 z5\nm64 p1\ng1 x20 f100\ng2 x30 i5\ng38.2 z-5\nm5\nm2\n";
    std::fs::write(at.join("a.ngc"), base).unwrap();
    let mut told = String::new();
    for (from, to) in [
        (" g43 h1", ""),
        ("h1", "h2"),
        ("g21", "g21 g64 p1"),
        ("g21", "g21 m50 p0"),
        ("g2 ", "g3 "),
        ("g38.2", "g38.3"),
        ("m64", "m62"),
        ("g90", "g90 g54"),
    ] {
        std::fs::write(at.join("b.ngc"), base.replace(from, to)).unwrap();
        let o = in_folder(at, &["diff", "a.ngc", "b.ngc"]);
        told += &format!("{from:?} → {to:?}\n{}", text(&o.stdout));
        assert_eq!(code(&o), 1, "{told}");
    }
    insta::assert_snapshot!(told);
    // With the tool table, and the offsets of the machine, nothing is left open.
    std::fs::write(at.join("t.tbl"), "T1 P1 Z0\n").unwrap();
    std::fs::write(at.join("v.var"), "5161 0\n").unwrap();
    std::fs::write(at.join("b.ngc"), base.replace(" g43 h1", "")).unwrap();
    assert_eq!(code(&in_folder(at, &["diff", "a.ngc", "b.ngc", "--tools", "t.tbl", "--vars", "v.var"])), 0);
}

/// What `completions` writes, the shells can read.
#[test]
fn completions_are_read_by_their_shells() {
    let folder = tempfile::tempdir().unwrap();
    for (shell, option) in [("bash", "-n"), ("zsh", "-n"), ("fish", "--no-execute")] {
        let file = folder.path().join(shell);
        std::fs::write(&file, run(&["completions", shell]).stdout).unwrap();
        match Command::new(shell).arg(option).arg(&file).output() {
            Ok(o) => assert!(o.status.success() && o.stderr.is_empty(), "{shell}: {}", text(&o.stderr)),
            Err(e) => {
                assert!(std::env::var_os("CI").is_none(), "{shell} is missing: {e}");
                eprintln!("skipped: {shell} is missing");
            }
        }
    }
}

#[test]
fn format_and_renumber() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("a.ngc"), "g21g90(\u{fc}ber)\nn5 g0x1\nm2\n").unwrap();
    assert_eq!(code(&in_folder(at, &["fmt", "--check", "a.ngc"])), 1);
    assert_eq!(code(&in_folder(at, &["fmt", "."])), 0);
    assert_eq!(code(&in_folder(at, &["fmt", "--check", "."])), 0);
    assert_eq!(std::fs::read_to_string(at.join("a.ngc")).unwrap(), "G21 G90 (\u{fc}ber)\nN5 G0 X1\nM2\n");
    let o = in_folder(at, &["renumber", "a.ngc", "--all"]);
    assert_eq!(text(&o.stdout), "N10 G21 G90 (\u{fc}ber)\nN20 G0 X1\nN30 M2\n");
    std::fs::write(at.join("b.nc"), "O1\nN5 X1\nGOTO #1\nM30\n").unwrap();
    let o = in_folder(at, &["renumber", "b.nc", "--dialect", "fanuc-mill"]);
    assert_eq!(code(&o), 1);
    assert!(text(&o.stderr).contains("E0192") && o.stdout.is_empty(), "{}", text(&o.stderr));
}

#[test]
fn preview_writes_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let part = fixtures().join("part.ngc");
    for (name, head) in [("a.svg", &b"<"[..]), ("a.png", b"\x89PNG"), ("a.html", b"<")] {
        let goal = folder.path().join(name);
        let o = run(&["preview", part.to_str().unwrap(), "-o", goal.to_str().unwrap()]);
        assert_eq!(code(&o), 0, "{}", text(&o.stderr));
        assert!(std::fs::read(goal).unwrap().starts_with(head));
    }
    assert_eq!(code(&run(&["preview", "part.ngc", "-o", "/nowhere/a.bmp"])), 2);
}

/// Every diagnostic whose registry row has a program that raises it, as people see it.
#[test]
fn every_diagnostic() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut shown = String::new();
    for code in gr_spec::Code::all() {
        let def = code.def();
        // Examples of exchange files are tested with the crates that read them.
        let Some(bad) = def.bad.filter(|_| def.dialect != Some("part21")) else { continue };
        std::fs::write(at.join("bad.ngc"), bad).unwrap();
        std::fs::write(at.join("mill.ini"), "[TRAJ]\nLINEAR_UNITS = mm\n[AXIS_X]\nMIN_LIMIT = 0\nMAX_LIMIT = 800\n").unwrap();
        std::fs::write(at.join("tools.tbl"), def.tools.unwrap_or("")).unwrap();
        let mut args: Vec<&str> = def.options.unwrap_or("check").split_whitespace().collect();
        args.extend(["bad.ngc", "-q"]);
        if args[0] != "machine" {
            args.extend(["--dialect", def.dialect.unwrap_or("linuxcnc")]);
            args.extend(def.tools.map_or(vec![], |_| vec!["--tools", "tools.tbl"]));
            args.extend(if def.lint && def.options.is_none() { vec!["--warn", def.code] } else { vec![] });
        }
        let told = text(&in_folder(at, &args).stderr);
        assert!(told.contains(&format!("[{}]", def.code)), "{args:?}: {told}");
        shown.push_str(&format!("=== {} {}\n{told}", def.code, def.slug));
    }
    insta::assert_snapshot!(shown);
}

#[test]
fn files_of_an_unknown_control() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("a.gcode");
    std::fs::write(&program, "M104 S200\nG0 X1\nG1 X1 Y2 E0.2\n").unwrap();
    let o = in_folder(folder.path(), &["check", "a.gcode"]);
    assert_eq!(code(&o), 0, "{}", whole(&o));
    assert_eq!(whole(&o).matches("E0840").count(), 1, "{}", whole(&o));
    let o = in_folder(folder.path(), &["check", "--dialect", "linuxcnc", "a.gcode"]);
    assert!(code(&o) == 1 && !whole(&o).contains("E0840"), "{}", whole(&o));
    std::fs::write(&program, "; gcc-robot: dialect=linuxcnc\nG0 X1\nM2\n").unwrap();
    assert!(!whole(&in_folder(folder.path(), &["check", "a.gcode"])).contains("E0840"));
}

#[test]
fn byte_order_mark() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.ngc"), "\u{FEFF}G21 G90\nG0 X1\nM2\n").unwrap();
    // The real command refuses the file, and so does the check for that control.
    for (dialect, expected) in [("linuxcnc", 1), ("fanuc-mill", 0)] {
        let o = in_folder(folder.path(), &["check", "--dialect", dialect, "a.ngc"]);
        assert_eq!(code(&o), expected, "{}", whole(&o));
        assert!(whole(&o).contains("E0105"), "{}", whole(&o));
        // A build refuses what the check refuses.
        let o = in_folder(folder.path(), &["build", "--dialect", dialect, "a.ngc"]);
        assert_eq!((code(&o), o.stdout.is_empty()), (expected, expected == 1), "{}", whole(&o));
    }
    std::fs::write(folder.path().join("b.ngc"), b"\xFF\xFEG\x000\x00X\x001\x00\n\x00M\x002\x00\n\x00").unwrap();
    let o = in_folder(folder.path(), &["check", "b.ngc"]);
    assert!(code(&o) == 1 && whole(&o).contains("E0105"), "{}", whole(&o));
    let o = in_folder(folder.path(), &["check", "--allow", "text/byte-order-mark", "a.ngc"]);
    assert!(!whole(&o).contains("E0105"), "{}", whole(&o));
    let o = in_folder(folder.path(), &["rs274", "-g", "a.ngc"]);
    assert_eq!(code(&o), 1);
    assert!(text(&o.stderr).contains("Bad character '\\357' used\n\u{FEFF}G21 G90"), "{}", whole(&o));
}

#[test]
fn folders_without_programs() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["check", "fmt"] {
        let o = in_folder(folder.path(), &[command, "."]);
        assert_eq!(code(&o), 1, "{}", whole(&o));
        assert!(whole(&o).contains("E0836"), "{}", whole(&o));
    }
}

/// An option that would do nothing is refused, not ignored.
#[test]
fn options_that_would_do_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::copy(fixtures().join("part.ngc"), at.join("part.ngc")).unwrap();
    assert_eq!(code(&in_folder(at, &["init"])), 0);
    for (line, said) in [
        ("build part.ngc --target motion --arcs r", "--arcs does nothing for the target motion"),
        ("build part.ngc --interval 1", "--interval does nothing for the target rs274ngc"),
        ("build part.ngc --target json --job x.toml", "--job does nothing"),
        ("build -o out/", "[[targets]]"),
        ("build --decimals 3", "[[targets]]"),
        ("build --from-line 3", "--from-line"),
        ("build --target krl", "no [[targets]] entry for krl"),
        ("build --target nothing", "there is no target nothing"),
        ("build part.ngc --depfile x.d", "-o FILE"),
        ("build - --watch", "standard input"),
        ("build part.ngc --target rapid --machine abb/irb2400 --decimals 2", "robot programs are written with 3 to 6"),
        ("machine import part.ngc --id Mine", "lower-case letters"),
        ("filter part.ngc --interval 1", "--interval does nothing"),
        ("verify part.ngc -o out", "-o goes with --machine"),
        ("verify part.ngc --lossy", "--lossy does nothing"),
        ("preview part.ngc --serve --width 9", "cannot be used with"),
        ("explain E0203 --list", "cannot be used with"),
    ] {
        let o = in_folder(at, &line.split(' ').collect::<Vec<_>>());
        assert_eq!(code(&o), 2, "{line}: {}", text(&o.stderr));
        assert!(text(&o.stderr).contains(said), "{line}: {}", text(&o.stderr));
    }
    assert_eq!(std::fs::read_dir(at).unwrap().count(), 2, "nothing was written");
    // Help lists no option that the command refuses.
    for (command, there, not) in [("filter", "--cycles", "--interval"), ("verify", "--job", "--lossy"), ("build", "--lossy", "--serve")] {
        let help = text(&in_folder(at, &[command, "--help"]).stdout);
        assert!(help.contains(there) && !help.contains(not), "{help}");
    }
}

#[test]
fn results_have_names_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["a", "b"] {
        std::fs::create_dir(at.join(name)).unwrap();
        std::fs::copy(fixtures().join("part.ngc"), at.join(name).join("part.ngc")).unwrap();
    }
    let o = in_folder(at, &["build", "a/part.ngc", "b/part.ngc", "-o", "out/"]);
    assert_eq!(code(&o), 2, "{}", text(&o.stderr));
    assert!(text(&o.stderr).contains("out/part.ngc: give them different names") && !at.join("out").exists());
    for line in ["build a/part.ngc -o x.ngc --depfile a/part.ngc", "build a/part.ngc -o x.ngc --depfile x.ngc"] {
        assert_ne!(code(&in_folder(at, &line.split(' ').collect::<Vec<_>>())), 0, "{line}");
        assert!(!at.join("x.ngc").exists(), "{line}");
    }
    let before = std::fs::read(at.join("a/part.ngc")).unwrap();
    let o = in_folder(at, &["accuracy", "a/part.ngc", "--machine", "generic/mill3", "-o", "a/part.ngc"]);
    assert_ne!(code(&o), 0);
    assert_eq!(std::fs::read(at.join("a/part.ngc")).unwrap(), before);
    for target in ["canon", "rs274ngc", "svg"] {
        let goal = format!("new/{target}/x");
        assert_eq!(code(&in_folder(at, &["build", "a/part.ngc", "--target", target, "-o", &goal])), 0, "{target}");
        assert!(at.join(goal).is_file());
    }
    assert_eq!(code(&in_folder(at, &["preview", "a/part.ngc", "-o", "pictures/x.svg"])), 0);
    assert_eq!(code(&in_folder(at, &["map", "--machine", "usp/2ups-prp", "--resolution", "5", "-o", "maps/x.csv"])), 0);
    assert!(at.join("maps/x.csv").is_file() && at.join("pictures/x.svg").is_file());
}

#[test]
fn machines_are_answered() {
    let o = run(&["machine", "show", "irb140"]);
    assert_eq!(code(&o), 2);
    insta::assert_snapshot!(text(&o.stderr));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mill.toml");
    std::fs::write(&file, text(&run(&["machine", "show", "generic/mill3", "--toml"]).stdout)).unwrap();
    let o = in_folder(folder.path(), &["machine", "check", "mill.toml"]);
    assert_eq!(code(&o), 0, "{}", text(&o.stderr));
    assert!(text(&o.stdout).starts_with("mill.toml: ") && text(&o.stdout).ends_with("no errors\n"), "{}", text(&o.stdout));
    assert!(in_folder(folder.path(), &["machine", "check", "mill.toml", "-q"]).stdout.is_empty());
}

#[test]
fn two_codes_of_a_group_are_both_shown() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.ngc"), "G21 G90\nF100 G1 X1 G0\nM2\n").unwrap();
    insta::assert_snapshot!(text(&in_folder(folder.path(), &["check", "a.ngc"]).stderr));
}

#[test]
fn another_dialects_words_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let program = "O1000 (gcc-robot: dialect=fanuc-mill)\nG21 G90\n#<x>=1\nO100 while [#1 LT 3]\nG38.2 Z-5. F100.\nM30\n";
    let mut told = String::new();
    for line in program.lines().skip(2).take(3) {
        let text_of = format!("O1000 (gcc-robot: dialect=fanuc-mill)\nG21 G90\n{line}\nM30\n");
        std::fs::write(folder.path().join("a.ngc"), text_of).unwrap();
        told += &text(&in_folder(folder.path(), &["check", "a.ngc", "-q"]).stderr);
    }
    insta::assert_snapshot!(told);
}

/// H of a Fanuc mill holds, H0 is no length: what is written says which length is meant, also where no table knows it.
#[test]
fn offset_numbers_of_a_fanuc_mill_are_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let program = "O1\nG21 G90 G54 G17 F100.\nT1 M6\nG0 X0 Y0\nG43 Z50. H3\nG1 Z-1.\nG0 Z40. H2\nZ30.\nT2 M6\nG43 Z20.\nG43 H0 Z200.\nG0 Z180.\nG41 D0 G1 X20.\nX30.\nG40 X0\nM30\n";
    std::fs::write(at.join("a.nc"), program).expect("writable");
    std::fs::write(at.join("t.tbl"), "T1 P1 Z100 D10\nT2 P2 Z150 D20\nT3 P3 Z120 D6\n").expect("writable");
    let mut told = String::new();
    for to in ["fanuc-mill", "linuxcnc"] {
        let mut written = Vec::new();
        for tools in [&[][..], &["-t", "t.tbl"]] {
            let mut args = vec!["build", "a.nc", "--dialect", "fanuc-mill", "--target", "rs274ngc", "--to", to];
            args.extend(tools);
            let o = in_folder(at, &args);
            assert!(o.status.success(), "{}", whole(&o));
            let text = String::from_utf8_lossy(&o.stdout).into_owned();
            written.push(text.lines().filter(|l| !l.starts_with('(')).collect::<Vec<_>>().join("\n"));
        }
        assert_eq!(written[0], written[1], "the same words with a tool table");
        told += &format!("{to}\n{}\n\n", written[0]);
    }
    insta::assert_snapshot!(told);
    // The number is a variable's, a macro's argument, or stands in another program.
    let (variable, called) = ("#1=2\nT1 M6\nG43 Z50. H#1\nM30\n", "T1 M6\nG43 Z50. H1\nM98 P2\nH3\nG0 Z9.\nM30\nO2\nG43 Z40.\nM99\n");
    let argument = "T1 M6\nG65 P2 H4\nM30\nO2\nG43 Z40. H#11\nM99\n";
    let numbers = [(variable, &["H2"][..]), (called, &["H1", "H1", "H3"]), (argument, &["H4"])];
    for (program, numbers) in numbers {
        std::fs::write(at.join("b.nc"), format!("O1\nG21 G90\n{program}")).expect("writable");
        for to in ["fanuc-mill", "linuxcnc"] {
            let o = in_folder(at, &["build", "b.nc", "--dialect", "fanuc-mill", "--target", "rs274ngc", "--to", to]);
            let written = text(&o.stdout);
            let asked: Vec<&str> = written.lines().filter(|l| l.contains("G43")).filter_map(|l| l.split(' ').find(|w| w.starts_with('H'))).collect();
            assert!(o.status.success() && asked == numbers, "{}", whole(&o));
        }
    }
    // R of L10 is a length, R of L12 a radius.
    std::fs::write(at.join("c.nc"), "O1\nG21 G90\nG10 L10 P1 R151.234\nG10 L12 P2 R3.\nT1 M6\nG43 Z5. H1\nM30\n").expect("writable");
    let o = in_folder(at, &["build", "c.nc", "--dialect", "fanuc-mill", "--target", "rs274ngc", "--to", "linuxcnc"]);
    let written = String::from_utf8_lossy(&o.stdout).into_owned();
    let entries: Vec<&str> = written.lines().filter(|l| l.starts_with("G10")).collect();
    assert!(o.status.success() && entries.contains(&"G10 L1 P1 Z151.234") && entries.contains(&"G10 L1 P2 R3"), "{}", whole(&o));
    assert!(entries.iter().all(|l| !l.starts_with("G10 L1 P1 R")), "{written}");
    let o = in_folder(at, &["build", "c.nc", "--dialect", "fanuc-mill", "--target", "rs274ngc", "--to", "fanuc-mill"]);
    let written = text(&o.stdout);
    assert!(o.status.success() && ["G10 L10 P1 R151.234", "G10 L12 P2 R3."].iter().all(|l| written.lines().any(|w| w == *l)), "{}", whole(&o));
    // A Fanuc mill has no other offsets of a tool than its length and its radius.
    std::fs::write(at.join("x.ngc"), "G10 L1 P1 X5 Z6\nM2\n").expect("writable");
    let o = in_folder(at, &["build", "x.ngc", "--target", "rs274ngc", "--to", "fanuc-mill"]);
    assert!(!o.status.success() && text(&o.stderr).contains("its length and its radius"), "{}", whole(&o));
    // A restart under G43 of a tool that nobody has measured, with G49 still to come: the length is in force.
    std::fs::write(at.join("d.nc"), "O1\nG21 G90 G54\nT3 M6\nS900 M3\nG0 X1. Y1.\nG43 Z50. H3\nG1 Z-1. F100.\nX10.\nG0 Z50.\nG49\nM30\n").expect("writable");
    for (line, bare) in [("8", false), ("5", true)] {
        let o = in_folder(at, &["build", "d.nc", "--dialect", "fanuc-mill", "--target", "rs274ngc", "--from-line", line, "--safe-z", "50"]);
        assert!(o.status.success() && text(&o.stderr).contains("E0616") == bare, "{line}: {}", whole(&o));
    }
}

/// U and W of a lathe are X and Z by increments: no axis U or W is written.
#[test]
fn increments_of_a_lathe_become_words_of_their_axes() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let program = "O1\nG21 G28 U0 W0\nT0101\nG97 S500 M3\nG0 X60. Z5.\nG1 U-4. W-5. F.2\nU0 W-3.\nG28 U0 W0\nM30\n";
    std::fs::write(at.join("turn.nc"), program).expect("writable");
    for more in [&[][..], &["--to", "fanuc-mill"], &["--repeat-words"]] {
        let mut args = vec!["build", "turn.nc", "--dialect", "fanuc-turn", "--target", "rs274ngc"];
        args.extend(more);
        let o = in_folder(at, &args);
        let text = String::from_utf8_lossy(&o.stdout).into_owned();
        assert!(o.status.success() && text.contains("G28 X"), "{}", whole(&o));
        assert!(!text.lines().any(|l| !l.starts_with('(') && l.contains(['U', 'W'])), "{text}");
    }
}
