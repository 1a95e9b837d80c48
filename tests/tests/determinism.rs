//! The same program gives the same bytes: in every target, every time; a check with one worker or several says the same.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use gr_tests::oracle::{gcc_robot, root};
use gr_tests::process::{Ended, run};

fn robot(dir: &Path, args: &[&str]) -> Ended {
    let out = run(Command::new(gcc_robot()).args(args).current_dir(dir), Duration::from_secs(120)).expect("it starts");
    assert!(!out.timed_out, "{args:?} ran into the time limit");
    out
}

/// Programs of the corpus that need no INI file, in a folder of their own.
fn programs(dir: &Path) -> Vec<String> {
    let from = root().join("tests/corpus/accepted");
    let mut names: Vec<String> = std::fs::read_dir(&from)
        .expect("the corpus is there")
        .filter_map(|e| Some(e.ok()?.file_name().to_str()?.to_string()))
        .filter(|n| n.ends_with(".ngc") && !from.join(n).with_extension("ini").is_file())
        .collect();
    names.sort();
    for name in &names {
        std::fs::copy(from.join(name), dir.join(name)).expect("writable");
    }
    names
}

/// Every file of a folder and of those in it, in order of names.
fn files(dir: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(dir).into_iter().flatten().filter_map(Result::ok) {
        let name = PathBuf::from(entry.file_name());
        if entry.path().is_dir() {
            all.extend(files(&entry.path()).into_iter().map(|(inner, bytes)| (name.join(inner), bytes)));
        } else {
            all.push((name, std::fs::read(entry.path()).expect("readable")));
        }
    }
    all.sort();
    all
}

#[test]
fn every_target_twice() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let names = programs(dir.path());
    let mut made = 0;
    for name in names.iter().step_by(4) {
        for target in ["canon", "motion", "rs274ngc", "json", "csv", "svg", "png", "html", "sheet", "sheet-json", "sheet-html"] {
            let once = || robot(dir.path(), &["build", "--target", target, name]);
            let (a, b) = (once(), once());
            made += usize::from(a.status == Some(0));
            assert_eq!((a.status, a.errors()), (b.status, b.errors()), "{name} {target}");
            assert!(a.stdout == b.stdout, "{name} {target}: other bytes the second time");
        }
    }
    assert!(made > 100, "only {made} results");
}

#[test]
fn many_files_and_workers() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let mut names = programs(dir.path());
    // A mistake keeps everything from being written.
    names.retain(|n| robot(dir.path(), &["check", n]).status == Some(0));
    assert!(names.len() > 20);
    let build = |out: &str| {
        let mut args = vec!["build", "--target", "canon", "-o", out];
        args.extend(names.iter().map(String::as_str));
        let ended = robot(dir.path(), &args);
        assert_eq!(ended.status, Some(0), "{}", ended.errors());
        files(&dir.path().join(out))
    };
    let (one, two) = (build("one/"), build("two/"));
    assert_eq!(one.len(), names.len());
    assert!(one == two, "other bytes the second time");
    let check = |jobs: &str| {
        let ended = robot(dir.path(), &["check", "--message-format", "short", "-j", jobs, "."]);
        (ended.status, ended.output(), ended.errors())
    };
    assert_eq!(check("1"), check("2"));
    assert_eq!(check("2"), check("4"));
}

/// Robot programs and what is made of STEP-NC files: twice, into two folders.
#[test]
fn robots_and_process_plans_twice() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let examples = root().join("docs/examples");
    for name in ["bracket.ngc", "irb2400-cell.toml", "tools.tbl", "stepnc/case-study.p21"] {
        let from = examples.join(name);
        std::fs::copy(&from, dir.path().join(from.file_name().expect("a name"))).expect("writable");
    }
    let twice = |args: &[&str]| {
        let made: Vec<_> = ["one", "two"]
            .into_iter()
            .map(|out| {
                let folder = format!("{out}-{}/", args.join("-").replace(['/', '.'], "_"));
                let ended = robot(dir.path(), &[args, &["-o", &folder]].concat());
                (ended.status, ended.errors().replace(&folder, "OUT/"), files(&dir.path().join(&folder)))
            })
            .collect();
        assert!(made[0] == made[1], "{args:?}: other bytes the second time");
        !made[0].2.is_empty()
    };
    let languages = ["rapid", "krl", "fanuc-ls", "urscript", "inform", "val3", "vplus", "kawasaki-as", "pdl2", "delmia-xml", "melfa", "spel", "nachi", "denso-pac"];
    // Not every language has numbers on outputs, names of signals, routines with a number, stops that an operator ends.
    let cell = std::fs::read_to_string(dir.path().join("irb2400-cell.toml")).expect("the cell");
    let plain = cell.split("[io.").next().expect("what is before its signals");
    std::fs::write(dir.path().join("plain.toml"), plain).expect("writable");
    std::fs::write(dir.path().join("bare.ngc"), "G21 G90 G17 G54\nG0 X10 Y10 Z20\nG1 Z0 F500\nG2 X50 Y10 I20 J5\nG0 Z20\nM2\n").expect("writable");
    let ways = [("bracket.ngc", "irb2400-cell.toml"), ("bracket.ngc", "plain.toml"), ("bare.ngc", "plain.toml")];
    for language in languages {
        let made = ways.map(|(program, cell)| twice(&["build", program, "--machine", cell, "--allow-unverified", "--target", language]));
        assert!(made.contains(&true), "{language} made nothing");
    }
    assert!(twice(&["build", "bracket.ngc", "--machine", "irb2400-cell.toml", "--target", "setpoints"]));
    for target in ["rs274ngc", "canon", "motion", "plan", "plan-json", "svg", "sheet", "sheet-html", "json", "csv"] {
        assert!(twice(&["build", "case-study.p21", "--target", target]), "{target}");
    }
    assert!(twice(&["build", "bracket.ngc", "--target", "stepnc", "--tools", "tools.tbl"]));
}

/// What is told of a file does not depend on the files beside it, nor on their order.
#[test]
fn order_of_files() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    for (name, text) in [("a/x.ngc", "G21\nG1 X1\nM2\n"), ("b/y.ngc", "G21 G90\nG2 X1 I3 J0 F100\nM2\n"), ("b/z.ngc", "G21 G90\nG0 X1\nM2\n")] {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        std::fs::write(path, text).expect("writable");
    }
    let check = |args: &[&str]| {
        let ended = robot(dir.path(), &[&["check", "--message-format", "json"], args].concat());
        let mut lines: Vec<String> = ended.output().lines().map(str::to_string).collect();
        lines.sort();
        (ended.status, lines)
    };
    let first = check(&["-j", "1", "a", "b"]);
    assert_eq!(first.0, Some(1));
    for args in [&["-j", "1", "b", "a"][..], &["-j", "8", "a", "b"], &["-j", "8", "b/z.ngc", "b/y.ngc", "a"]] {
        assert_eq!(check(args), first, "{args:?}");
    }
}
