//! What `gcc-robot check` says: the expected diagnostic on each one-fault program, and nothing but lints on every
//! program that the real `rs274` accepts.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use gr_tests::oracle::{Job, TOOLS, gcc_robot, reference, root, score};
use gr_tests::process::run;

/// Diagnostic codes (with severity) that `check` reports, in order.
fn check(file: &Path, more: &[&str]) -> Vec<(String, String)> {
    let out = run(
        Command::new(gcc_robot())
            .arg("check")
            .args(["--message-format", "json"])
            .args(more)
            .arg(file)
            .current_dir(file.parent().expect("a folder")),
        Duration::from_secs(60),
    )
    .expect("it starts");
    assert!(!out.timed_out, "{} ran into the time limit", file.display());
    let text = out.output();
    let mut found = Vec::new();
    assert!(text.contains("\"summary\""), "{} has no summary: {text}{}", file.display(), out.errors());
    // One JSON object per line.
    for part in text.lines().filter(|l| l.contains("\"type\":\"diagnostic\"")) {
        let value = |key: &str| {
            let at = part.find(&format!("\"{key}\""))? + key.len() + 2;
            let rest = part[at..].trim_start_matches([':', ' ']);
            Some(rest.strip_prefix('"')?.split('"').next()?.to_string())
        };
        if let (Some(code), Some(severity)) = (value("code"), value("severity"))
            && code.starts_with('E')
        {
            found.push((code, severity));
        }
    }
    found
}

fn table() -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), TOOLS).expect("writable");
    file
}

fn programs(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(root().join("tests/corpus").join(folder))
        .expect("the corpus is there")
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "ngc"))
        .collect();
    files.sort();
    files
}

#[test]
fn each_fault_has_its_diagnostic() {
    let tools = table();
    let tools = tools.path().display().to_string();
    let (mut wrong, mut all) = (Vec::new(), 0);
    for file in programs("errors") {
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        let head = text.lines().next().unwrap_or_default();
        let expected = head.strip_prefix("; expect ").unwrap_or_else(|| panic!("{} begins with `{head}`", file.display()));
        // A fault can make further lines wrong; those are listed behind `also`, each as often as it is told.
        let mut codes: Vec<&str> = expected.split([' ', ';', ':']).filter(|w| gr_spec::Code::find(w).is_some_and(|c| c.def().code == *w)).collect();
        all += 1;
        let found = check(&file, &["--tools", &tools, "--machine-units", "inch"]);
        let mut told: Vec<&str> = found.iter().map(|(c, _)| c.as_str()).filter(|c| codes.contains(c) || !is_lint(c)).collect();
        codes.sort_unstable();
        told.sort_unstable();
        if told != codes {
            wrong.push(format!("{}: expected {expected}, got {found:?}", file.file_stem().unwrap_or_default().display()));
        }
    }
    let line = format!("one-fault programs whose fault is named: {} of {all}", all - wrong.len());
    score("diagnostics", &line);
    assert!(wrong.is_empty(), "{line}\n{}", wrong.join("\n"));
}

/// Each fault as people see it, one snapshot for each family of faults (`arc-…`, `comp-…`).
#[test]
fn each_fault_as_people_see_it() {
    let tools = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(tools.path().join("tool.tbl"), TOOLS).expect("writable");
    let mut families = std::collections::BTreeMap::<String, String>::new();
    for file in programs("errors") {
        let name = file.file_name().and_then(|n| n.to_str()).expect("plain names").to_string();
        std::fs::copy(&file, tools.path().join(&name)).expect("writable");
        let out = run(
            Command::new(gcc_robot())
                .args(["check", "--color", "never", "--tools", "tool.tbl", "--machine-units", "inch", &name])
                .current_dir(tools.path()),
            Duration::from_secs(60),
        )
        .expect("it starts");
        assert!(!out.timed_out, "{name} ran into the time limit");
        let family = name.split(['-', '.']).next().unwrap_or_default().to_string();
        let text = families.entry(family).or_default();
        text.push_str(&format!("──── {name}: {}\n{}{}\n", out.how(), out.output(), out.errors()));
    }
    let mut settings = insta::Settings::clone_current();
    settings.set_prepend_module_to_snapshot(false);
    settings.set_snapshot_path("../corpus/errors/snapshots");
    settings.bind(|| {
        for (family, text) in &families {
            insta::assert_snapshot!(family.as_str(), text);
        }
    });
}

/// Subroutine files that programs with an INI file may call.
fn subs() -> Vec<(String, Vec<u8>)> {
    let files = programs("subs").into_iter();
    files.map(|f| (f.file_name().unwrap_or_default().to_string_lossy().into_owned(), std::fs::read(&f).expect("readable"))).collect()
}

fn is_lint(code: &str) -> bool {
    // A probe that goes nowhere: rs274 is silent, we warn on purpose, and one shipped program has it.
    code == "E0256" || gr_spec::Code::find(code).is_some_and(|c| c.def().lint)
}

/// A false alarm is an error on a program the real one accepts, or a warning that is not in the table of lints.
/// Where rs274 is silent by mistake we warn on purpose; those programs lie in `errors/`.
#[test]
fn no_false_alarm() {
    let Some(rs274) = reference() else { return };
    let tools = table();
    let tools = tools.path().display().to_string();
    let mut files = programs("accepted");
    let listed = Command::new("dpkg").args(["-L", "linuxcnc-uspace"]).output();
    let listed = listed.map(|o| String::from_utf8_lossy(&o.stdout).into_owned()).unwrap_or_default();
    files.extend(listed.lines().filter(|l| l.ends_with(".ngc")).map(PathBuf::from));
    let folder = root().join("tests/corpus/subs").display().to_string();
    let (mut alarms, mut accepted, mut with_ini) = (Vec::new(), 0, 0);
    for file in files {
        let Ok(bytes) = std::fs::read(&file) else { continue };
        let mut job = Job::new(bytes);
        let ini = file.with_extension("ini").display().to_string();
        job.ini = std::fs::read_to_string(&ini).ok();
        if job.ini.is_some() {
            job.files = subs();
        }
        if !job.reference(&rs274).ok() {
            continue;
        }
        accepted += 1;
        let mut more = vec!["--tools", &tools, "--machine-units", "inch"];
        if job.ini.is_some() {
            with_ini += 1;
            more.extend(["-i", &ini, "--subs", &folder]);
        }
        let found = check(&file, &more);
        let bad: Vec<_> = found.iter().filter(|(c, s)| s != "hint" && !is_lint(c)).collect();
        if !bad.is_empty() {
            alarms.push(format!("{}: {bad:?}", file.display()));
        }
    }
    let line = format!("false alarms on {accepted} accepted programs: {}", alarms.len());
    score("false-alarms", &line);
    println!("{line}");
    assert!(alarms.is_empty(), "{line}\n{}", alarms.join("\n"));
    assert!(with_ini >= 5, "programs with an INI file: {with_ini}");
}
