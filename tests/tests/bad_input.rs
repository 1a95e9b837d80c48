//! Files that are no good programs: a clear error or the right result, never a crash, never half a result.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use gr_tests::oracle::{Job, Verdict, differ, gcc_robot, reference};
use gr_tests::process::{Ended, run};

const LIMIT: Duration = Duration::from_secs(60);

fn robot(dir: &Path, args: &[&str]) -> Ended {
    let out = run(Command::new(gcc_robot()).args(args).current_dir(dir), LIMIT).expect("it starts");
    let errors = out.errors();
    assert!(!out.timed_out, "{args:?} ran into the time limit");
    assert!(out.status.is_some(), "{args:?} {}: {errors}", out.how());
    assert!(out.status != Some(101) && !errors.contains("panicked"), "{args:?} panicked: {errors}");
    out
}

/// Runs `check` and `build` on a file of these bytes. After an error nothing is left behind.
fn both(bytes: &[u8]) -> (Ended, Ended) {
    let dir = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(dir.path().join("part.ngc"), bytes).expect("writable");
    let check = robot(dir.path(), &["check", "part.ngc"]);
    let build = robot(dir.path(), &["build", "--target", "canon", "-o", "part.canon", "part.ngc"]);
    let left: Vec<_> = std::fs::read_dir(dir.path()).expect("readable").filter_map(|e| Some(e.ok()?.file_name())).collect();
    let written = dir.path().join("part.canon").is_file();
    assert_eq!(written, build.status == Some(0), "{left:?}: {}", build.errors());
    assert_eq!(left.len(), 1 + usize::from(written), "{left:?}");
    (check, build)
}

/// Codes of findings, each once, in order.
fn codes(out: &Ended) -> Vec<String> {
    let text = out.errors() + &out.output();
    let mut found = Vec::new();
    for (i, _) in text.match_indices("[E") {
        let code = text.get(i + 1..i + 6).unwrap_or_default();
        if gr_spec::Code::find(code).is_some() && !found.contains(&code.to_string()) {
            found.push(code.to_string());
        }
    }
    found
}

fn is_error(code: &str) -> bool {
    gr_spec::Code::find(code).is_some_and(|c| c.def().severity == gr_spec::Severity::Error)
}

/// These bytes raise these codes and no others; an error among them ends both commands, without one both go through.
fn gives(bytes: &[u8], expected: &[&str]) {
    let (check, build) = both(bytes);
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(80)]).into_owned();
    assert_eq!(codes(&check), expected, "{head}");
    // 3: a file that can't be had or is none.
    let status = Some(if expected == ["E0841"] { 3 } else { i32::from(expected.iter().any(|c| is_error(c))) });
    assert_eq!((check.status, build.status), (status, status), "{head}: {}", build.errors());
    // Hints are for check alone.
    let errors: Vec<String> = codes(&build).into_iter().filter(|c| is_error(c)).collect();
    assert_eq!(errors, expected.iter().copied().filter(|c| is_error(c)).collect::<Vec<_>>(), "{head}");
}

fn is_built(bytes: &[u8]) {
    let (check, build) = both(bytes);
    assert_eq!(check.status, Some(0), "{}{}", check.errors(), check.output());
    assert_eq!(build.status, Some(0), "{}{}", build.errors(), build.output());
}

/// The control refuses the file for its byte order mark, and both commands say so.
fn is_refused(bytes: &[u8]) {
    for ended in <[Ended; 2]>::from(both(bytes)) {
        assert_eq!(ended.status, Some(1), "{}{}", ended.errors(), ended.output());
        assert!((ended.errors() + &ended.output()).contains("E0105"), "{}", ended.output());
    }
}

const GOOD: &str = "G21 G90 G17 G94\nM3 S1000\nF100\nG1 X10 Y5\nG2 X20 Y5 I5 J0\nM5\nM2\n";

/// Both interpreters, as bytes.
fn agrees(bytes: Vec<u8>) {
    let Some(rs274) = reference() else { return };
    let verdict = differ(&Job::new(bytes.clone()), &rs274);
    assert!(!matches!(verdict, Verdict::Differs(_)), "{verdict:?} on {}", String::from_utf8_lossy(&bytes));
}

#[test]
fn empty() {
    gives(b"", &["E0252"]);
    gives(b"\n\n  \n", &["E0252"]);
    agrees(b"\n".to_vec());
}

#[test]
fn nul_bytes() {
    gives(b"G21\nG0 X1\0Y2\nM2\n", &["E0101"]);
    gives(b"\0\0\0\0", &["E0252", "E0101"]);
    agrees(b"G21\nG0 X1\0Y2\nM2\n".to_vec());
}

#[test]
fn latin_1_comment() {
    is_built(b"G21 (Schr\xE4gfl\xE4che)\nG0 X1\nM2\n");
    agrees(b"G21 (Schr\xE4gfl\xE4che)\nG0 X1\nM2\n".to_vec());
}

#[test]
fn byte_order_marks() {
    is_refused(format!("\u{feff}{GOOD}").as_bytes());
    for big in [false, true] {
        let mut bytes = if big { vec![0xFE, 0xFF] } else { vec![0xFF, 0xFE] };
        for unit in GOOD.encode_utf16() {
            bytes.extend(if big { unit.to_be_bytes() } else { unit.to_le_bytes() });
        }
        is_refused(&bytes);
    }
    for bytes in [&[0xFF, 0xFE, 0x47][..], &[0xFF, 0xFE, 0x00, 0xD8]] {
        let (check, build) = both(bytes);
        assert!(codes(&check).contains(&"E0105".to_string()), "{:?}", codes(&check));
        assert_eq!((check.status, build.status), (Some(1), Some(1)));
    }
}

#[test]
fn line_ends() {
    is_built(GOOD.replace('\n', "\r\n").as_bytes());
    agrees(GOOD.replace('\n', "\r\n").into_bytes());
    is_built(GOOD.replace('\n', "\r").as_bytes());
    is_built(GOOD.trim_end().as_bytes());
}

#[test]
fn one_line_of_10_mb() {
    gives(format!("G1 X{}\nM2\n", "1".repeat(10_000_000)).as_bytes(), &["E0102"]);
    for open in ["(", "[", "#"] {
        gives(open.repeat(10_000_000).as_bytes(), &["E0102", "E0252"]);
    }
}

#[test]
fn deep_nesting() {
    gives(format!("#1={}1{}\nM2\n", "[".repeat(100_000), "]".repeat(100_000)).as_bytes(), &["E0102"]);
    // What fits into a line is no deeper than the controller goes.
    gives(format!("#1={}1{}\nM2\n", "[".repeat(120), "]".repeat(120)).as_bytes(), &[]);
    gives(format!("G21 G0 X{}1\nM2\n", "-".repeat(200)).as_bytes(), &[]);
    gives(format!("#1={}1\nM2\n", "#".repeat(246)).as_bytes(), &["E0237"]);
    gives(format!("#1={}1{}\nM2\n", "SIN[".repeat(60), "]".repeat(60)).as_bytes(), &["E0102"]);
    gives(format!("#1={}1{}\nM2\n", "SIN[".repeat(20), "]".repeat(20)).as_bytes(), &[]);
    let mut loops = String::new();
    for i in 0..5000 {
        loops.push_str(&format!("o{i} if [1]\n"));
    }
    gives(loops.as_bytes(), &["E0255", "E0252"]);
}

#[test]
fn binary() {
    let mut x = 0x9E37_79B9_u32;
    let bytes: Vec<u8> = (0..200_000)
        .map(|_| {
            x ^= x << 13;
            x ^= x >> 17;
            x ^= x << 5;
            x as u8
        })
        .collect();
    gives(&bytes, &["E0841"]);
    gives(&std::fs::read(std::env::current_exe().expect("a test knows its file")).expect("readable")[..1_000_000], &["E0841"]);
}

#[test]
fn folders_and_missing_files() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    std::fs::create_dir(dir.path().join("part.ngc")).expect("writable");
    for (args, code) in [
        (["build", "--target", "canon", "part.ngc"].as_slice(), "E0822"),
        (&["check", "nothing.ngc"], "E0820"),
        (&["build", "--target", "canon", "nothing.ngc"], "E0820"),
    ] {
        let out = robot(dir.path(), args);
        assert_eq!((out.status, codes(&out)), (Some(3), vec![code.to_string()]), "{args:?}");
    }
}

#[test]
fn unreadable_file() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().expect("a temporary folder");
    let file = dir.path().join("part.ngc");
    std::fs::write(&file, GOOD).expect("writable");
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o000)).expect("own file");
    // Root reads everything: then a file that nobody can read from its start stands in.
    let name = if std::fs::read(&file).is_ok() { "/proc/self/mem" } else { "part.ngc" };
    for args in [["build", "--target", "canon", "-o", "x", name].as_slice(), &["check", name]] {
        let out = robot(dir.path(), args);
        assert_eq!((out.status, codes(&out)), (Some(3), vec!["E0821".to_string()]), "{args:?}");
    }
    assert!(!dir.path().join("x").exists());
}

#[test]
fn unwritable_result() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(dir.path().join("part.ngc"), GOOD).expect("writable");
    let out = robot(dir.path(), &["build", "--target", "canon", "-o", "part.ngc/x", "part.ngc"]);
    assert_eq!((out.status, codes(&out)), (Some(3), vec!["E0824".to_string()]));
    let out = robot(dir.path(), &["build", "--target", "canon", "-o", "part.ngc", "part.ngc"]);
    assert_eq!((out.status, codes(&out)), (Some(1), vec!["E0839".to_string()]));
    assert_eq!(std::fs::read_to_string(dir.path().join("part.ngc")).expect("readable"), GOOD);
}

#[test]
fn an_error_leaves_the_old_result() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(dir.path().join("part.ngc"), "G21\nF100\nG1 X1\nG1 X[1/0]\nM2\n").expect("writable");
    std::fs::write(dir.path().join("part.canon"), "old").expect("writable");
    let out = robot(dir.path(), &["build", "--target", "canon", "-o", "part.canon", "part.ngc"]);
    assert_eq!((out.status, codes(&out)), (Some(1), vec!["E0233".to_string()]));
    assert_eq!(std::fs::read_to_string(dir.path().join("part.canon")).expect("readable"), "old");
}

#[test]
fn subs_that_are_missing_or_call_themselves() {
    gives(b"o<nowhere> call\nM2\n", &["E0250"]);
    gives(b"o77 call\nM2\n", &["E0250"]);
    gives(b"o1 sub\no1 call\no1 endsub\no1 call\nM2\n", &["E0251"]);
    gives(b"M98 P5\nM2\nO5\nM98 P5\nM99\n", &["E0251"]);
    agrees(b"o1 sub\no1 call\no1 endsub\no1 call\nM2\n".to_vec());
}

#[test]
fn numbers_out_of_range() {
    for (line, codes) in [
        ("#1=[1/0]", &["E0233"][..]),
        ("#1=[0/0]", &["E0233"]),
        ("#1=[10**400]", &["E0235"]),
        ("#1=SQRT[-1]", &["E0234"]),
        ("#1=LN[-1]", &["E0234"]),
        ("#1=[1e400]", &["E0215"]),
        ("G0 X1e400", &["E0207"]),
        ("#1=ASIN[2]", &["E0234"]),
        ("#1=EXP[99999]", &["E0235"]),
        ("#1=[[-1]**0.5]", &["E0234"]),
        ("T99999999999", &["E0243"]),
        ("M999999999999", &["E0204"]),
        ("G999999999999999999999 X1", &["E0204"]),
        ("#99999999999=1", &["E0237"]),
        ("#[1/0]=1", &["E0233"]),
        ("G4 P-1", &["E0209"]),
        ("#[-1]=1", &["E0237"]),
        ("#1=#99999999999", &["E0237"]),
        ("N99999999999999999999 G0 X1", &[]),
        ("o99999999999999999999 call", &["E0250"]),
        ("S99999999999999999999 M3", &["E0283"]),
        ("G81 X1 Z-1 R1 L99999999999", &["E0209"]),
    ] {
        let text = format!("G21\nF100\n{line}\nM2\n");
        gives(text.as_bytes(), codes);
        if !line.contains("99999999") {
            agrees(text.into_bytes());
        }
    }
    gives(format!("G21\nF100\nG1 X{}\nG1 X0\nM2\n", "9".repeat(200)).as_bytes(), &[]);
    gives(b"G21 F1\nG2 X1e9 I99999999999\nG76 P0 Z0 I0 J0 K0\nM2\n", &["E0207", "E0274"]);
}

#[test]
fn runaway_programs_end() {
    gives(b"o1 while [1]\n#1=[#1+1]\no1 endwhile\nM2\n", &["E0254"]);
    gives(b"o1 while [1]\nG0 X1\nG0 X0\no1 endwhile\nM2\n", &["E0254", "E0288"]);
    gives(b"o1 repeat [1000000000]\nG4 P0\no1 endrepeat\nM2\n", &["E0254"]);
    gives(b"o1 do\no1 while [1]\nM2\n", &["E0254"]);
    // The loop ends twice: the second end begins it anew for ever.
    gives(b"o1 repeat [800]\nG4 P0\no1 endrepeat\no1 endrepeat\nM2\n", &["E0254"]);
    gives(b"o1 while [0]\no1 endwhile\no1 endwhile\nM2\n", &["E0254"]);
    gives(b"G21 F100\nG81 X1 Y1 Z-1 R1 L2000000000\nM2\n", &["E0254", "E0275"]);
}

/// Two gigabytes of nothing, which take no room on the disk: refused at once or read as the NUL bytes they are.
#[test]
fn sparse_file_of_2_gb() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let file = std::fs::File::create(dir.path().join("part.ngc")).expect("writable");
    file.set_len(2 << 30).expect("sparse files");
    drop(file);
    let out = robot(dir.path(), &["check", "part.ngc"]);
    let text = out.errors() + &out.output();
    assert_eq!((out.status, codes(&out)), (Some(3), vec!["E0823".to_string()]), "{text}");
}

#[test]
fn many_faults_are_not_too_many() {
    let text: String = (0..20_000).map(|i| format!("G1 X{i} Q\n")).collect();
    let (check, _) = both(text.as_bytes());
    assert_eq!((check.status, codes(&check)), (Some(1), vec!["E0211".to_string()]));
    assert!(check.stderr.len() + check.stdout.len() < 5_000_000, "a flood of messages");
}

/// Names that are words of a shell or have blanks and other letters in them.
#[test]
fn odd_file_names() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    for name in ["a b.ngc", "ä ß 漢.ngc", "$HOME;x.ngc", "'quote\".ngc"] {
        std::fs::write(dir.path().join(name), GOOD).expect("writable");
        assert_eq!(robot(dir.path(), &["check", name]).status, Some(0), "{name}");
    }
    std::fs::write(dir.path().join("-x.ngc"), GOOD).expect("writable");
    assert_eq!(robot(dir.path(), &["check", "--", "-x.ngc"]).status, Some(0));
}

/// Every command that reads a program, on files that are none or are damaged: one clear error or a result, never a
/// crash, and nothing written beside an error.
#[test]
fn every_command_on_every_mistaken_file() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let read = |name: &str| std::fs::read(root.join("docs/examples").join(name)).expect("a shipped example");
    let plan = read("stepnc/case-study.p21");
    let cad = "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('x','',(''),(''),'','','');\n\
        FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));\nENDSEC;\nDATA;\n\
        #1=CARTESIAN_POINT('',(0.,0.,0.));\nENDSEC;\nEND-ISO-10303-21;\n";
    // With what the commands that run the program must say; none: they may succeed.
    let files: [(&str, Vec<u8>, Option<&str>); 15] = [
        ("good.ngc", GOOD.into(), None),
        ("empty.ngc", vec![], Some("E0252")),
        ("nul.ngc", b"G21\nG0 X1\0Y2\nM2\n".to_vec(), None),
        ("latin.ngc", b"G21 (Schr\xE4g)\nG0 X1\nM2\n".to_vec(), None),
        ("cr.ngc", GOOD.replace('\n', "\r").into(), None),
        ("line.ngc", format!("G1 X{}\nM2\n", "1".repeat(10_000_000)).into(), Some("E0102")),
        ("recursive.ngc", b"o1 sub\no1 call\no1 endsub\no1 call\nM2\n".to_vec(), Some("E0251")),
        ("nosub.ngc", b"o<nowhere> call\nM2\n".to_vec(), Some("E0250")),
        ("empty.p21", vec![], Some("E0319")),
        ("cut.p21", plan[..plan.len() / 2].to_vec(), Some("E03")),
        ("plan.ngc", plan, None),
        ("gcode.p21", GOOD.into(), Some("E0319")),
        ("shape.step", cad.into(), Some("E0418")),
        ("project.ngc", read("gcc-robot.toml"), Some("E0845")),
        ("cell.toml", read("irb2400-cell.toml"), Some("E0845")),
    ];
    for (name, bytes, _) in &files {
        std::fs::write(dir.path().join(name), bytes).expect("writable");
    }
    let listing = || {
        let entries = std::fs::read_dir(dir.path()).expect("readable");
        entries.filter_map(|e| Some(e.ok()?.file_name())).collect::<std::collections::BTreeSet<_>>()
    };
    let before = listing();
    for (name, bytes, wanted) in &files {
        let running = [
            vec!["check", name],
            vec!["build", name, "-o", "out.ngc"],
            vec!["build", name, "--target", "canon", "-o", "out.ngc"],
            vec!["preview", name, "-o", "out.svg"],
            vec!["filter", name],
            vec!["diff", name, "good.ngc"],
            vec!["diff", "good.ngc", name],
            vec!["verify", name],
        ];
        let only_text = [vec!["fmt", "--check", name], vec!["renumber", name, "-o", "out.ngc"]];
        for (args, runs) in running.iter().map(|a| (a, true)).chain(only_text.iter().map(|a| (a, false))) {
            let out = robot(dir.path(), args);
            let said = out.errors() + &out.output();
            if let (true, Some(wanted)) = (runs, wanted) {
                assert!(matches!(out.status, Some(1 | 3)), "{args:?}: {said}");
                assert!(said.contains(wanted), "{args:?} does not say {wanted}: {said}");
            }
            if out.status != Some(0) {
                assert_eq!(listing(), before, "{args:?} left something");
                assert!(!said.trim().is_empty(), "{args:?} says nothing");
            }
            for made in ["out.ngc", "out.tbl", "out.svg"] {
                let _ = std::fs::remove_file(dir.path().join(made));
            }
            assert_eq!(&std::fs::read(dir.path().join(name)).expect("still there"), bytes, "{args:?} changed its source");
        }
    }
}

/// A file of another kind behind an option.
#[test]
fn options_with_the_wrong_file() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(dir.path().join("part.ngc"), GOOD).expect("writable");
    std::fs::create_dir(dir.path().join("folder")).expect("writable");
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples");
    std::fs::copy(examples.join("irb2400-cell.toml"), dir.path().join("cell.toml")).expect("writable");
    for option in ["--tools", "--vars", "--ini", "--machine"] {
        for file in ["part.ngc", "folder", "nothing", "cell.toml"] {
            if (option, file) == ("--machine", "cell.toml") {
                continue;
            }
            let out = robot(dir.path(), &["build", "part.ngc", option, file, "-o", "out.ngc"]);
            let said = out.errors() + &out.output();
            assert!(out.status == Some(0) || said.contains("[E"), "{option} {file}: {said}");
            assert_eq!(dir.path().join("out.ngc").exists(), out.status == Some(0), "{option} {file}: {said}");
            let _ = std::fs::remove_file(dir.path().join("out.ngc"));
        }
    }
    for job in ["cell.toml", "part.ngc", "folder", "nothing"] {
        let out = robot(dir.path(), &["build", "part.ngc", "--machine", "cell.toml", "--target", "rapid", "--job", job, "-o", "out.mod"]);
        assert!(out.status != Some(0) && out.errors().contains(job), "{job}: {}", out.errors());
        assert!(!dir.path().join("out.mod").exists());
    }
}
