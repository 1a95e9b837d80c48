//! LinuxCNC 2.9's own interpreter tests, from Debian's source package. They are GPL: fetched into `target/` when
//! the tests run, never part of this repository. The machine's package configuration is not touched: a copy of its
//! source lists with `deb-src` in place of `deb` is used beside it.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::oracle::{gcc_robot, kept, root};
use crate::process::{Ended, run};

/// One test may take this long; the real `rs274` needs at most 2 s.
const LIMIT: Duration = Duration::from_secs(60);

/// The frozen list of `tests/linuxcnc-tests.toml`.
pub struct List {
    /// Folders that count.
    pub tests: Vec<String>,
    /// Folders that do not, with the reason.
    pub excluded: Vec<(String, String)>,
}

/// Reads the list.
pub fn list() -> List {
    let text = std::fs::read_to_string(root().join("tests/linuxcnc-tests.toml")).expect("the list is there");
    let table: toml::Table = text.parse().expect("the list is valid TOML");
    let strings = |v: &toml::Value| v.as_str().unwrap_or_default().to_string();
    let array = |key: &str| table.get(key).and_then(|v| v.as_array()).cloned().unwrap_or_default();
    List {
        tests: array("tests").iter().map(strings).collect(),
        excluded: array("excluded").iter().map(|r| (strings(&r["name"]), strings(&r["reason"]))).collect(),
    }
}

fn sh(dir: &Path, script: &str) -> Result<(), String> {
    let ended = run(Command::new("bash").arg("-ec").arg(script).current_dir(dir), Duration::from_secs(600))
        .map_err(|e| e.to_string())?;
    if ended.status == Some(0) { Ok(()) } else { Err(format!("{}: {}", ended.how(), ended.errors())) }
}

/// Fetches the sources once; the folder that holds `tests/`.
pub fn sources() -> Result<PathBuf, String> {
    let dir = kept("linuxcnc-source");
    let done = dir.join("unpacked");
    if !done.is_file() {
        sh(
            &dir,
            r#"
rm -rf parts lists src; mkdir -p parts lists/partial src
for f in /etc/apt/sources.list.d/*.sources; do
  [ -e "$f" ] && sed 's/^Types:.*/Types: deb-src/' "$f" >parts/"$(basename "$f")"
done
cat /etc/apt/sources.list /etc/apt/sources.list.d/*.list 2>/dev/null | sed -n 's/^deb /deb-src /p' >parts/lists.list || true
A="-q -o Dir::Etc::sourcelist=/dev/null -o Dir::Etc::sourceparts=$PWD/parts -o Dir::State::lists=$PWD/lists -o APT::Sandbox::User="
apt-get $A update >apt.log 2>&1
apt-get $A source --download-only linuxcnc >>apt.log 2>&1
tar -xJf linuxcnc_*.orig.tar.xz -C src --wildcards --strip-components=1 '*/tests/*'
test -d src/tests
touch unpacked
"#,
        )?;
    }
    Ok(dir.join("src"))
}

/// Runs one test folder with `rs274` (ours when `ours`, else the one that is installed).
pub fn run_test(sources: &Path, name: &str, ours: bool) -> Result<(), String> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let dir = scratch.path();
    let tests = dir.join("tests");
    sh(dir, &format!("mkdir -p tests/{name} bin home; cp -r {0}/tests/{name}/. tests/{name}/", sources.display()))?;
    let mut path = std::env::var_os("PATH").unwrap_or_default();
    if ours {
        let wrapper = dir.join("bin/rs274");
        std::fs::write(&wrapper, format!("#!/bin/sh\nexec {} rs274 \"$@\"\n", gcc_robot().display())).map_err(|e| e.to_string())?;
        sh(dir, "chmod +x bin/rs274")?;
        let mut paths = vec![dir.join("bin")];
        paths.extend(std::env::split_paths(&path));
        path = std::env::join_paths(paths).map_err(|e| e.to_string())?;
    }
    let here = tests.join(name);
    let script = if here.join("test.sh").is_file() { "exec bash test.sh" } else { "exec ./test" };
    let ended = run(
        Command::new("bash")
            .args(["-c", script])
            .current_dir(&here)
            .env("PATH", path)
            .env("HOME", dir.join("home"))
            .env("LC_ALL", "C")
            .env("LIBDIR", "/usr/lib")
            .env("SYSTEM_BUILD", "1"),
        LIMIT,
    )
    .map_err(|e| e.to_string())?;
    judge(&here, &ended)
}

fn judge(dir: &Path, ended: &Ended) -> Result<(), String> {
    if ended.timed_out {
        return Err("time-out".into());
    }
    let expected = dir.join("expected");
    if !expected.is_file() {
        return if ended.status == Some(0) { Ok(()) } else { Err(format!("{}\n{}", ended.how(), ended.output())) };
    }
    let expected = std::fs::read(expected).map_err(|e| e.to_string())?;
    if expected == ended.stdout {
        return Ok(());
    }
    let (a, b) = (String::from_utf8_lossy(&expected).into_owned(), ended.output());
    let at = a.lines().zip(b.lines()).position(|(a, b)| a != b).unwrap_or(a.lines().count().min(b.lines().count()));
    let line = |s: &str| s.lines().nth(at).unwrap_or("(nothing)").to_string();
    Err(format!(
        "line {} of {}\n  expected {}\n  got      {}\n  {}",
        at + 1,
        a.lines().count(),
        line(&a),
        line(&b),
        ended.errors().lines().take(3).collect::<Vec<_>>().join(" | ")
    ))
}
