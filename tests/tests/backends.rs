//! Written programs move the machine as their sources do, judged by LinuxCNC in full double precision.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use gr_tests::full::{distance, path};
use gr_tests::oracle::{gcc_robot, root, score};
use gr_tests::process::run;

/// The corpus' tools in millimeters.
const TOOLS: &str = "T1 P1 Z50 D6\nT2 P2 Z40 D3\nT3 P3 Z60 D10\nT4 P4 Z80 D5\nT5 P5 X-10 Z-20 D1.6 I95 J155 Q2\nT6 P6 X-5 Z-30 D0.8 I5 J65 Q6\nT7 P7 X2 Y3 Z4 D0.5\nT20 P8 Z25 D12\nT99999 P9 Z12 D25\n";

/// Programs whose motion this oracle shows as moves (splines come out as chords, probing depends on the machine), and
/// which need nothing but themselves.
const PROGRAMS: &[&str] = &["arcs", "modes", "compensation-mill", "cycles-sticky", "loops", "subs-numbered", "subs-named", "subs-fanuc", "numbers", "lathe-roughing"];

fn build(source: &Path, to: &Path, more: &[&str]) -> Result<(), String> {
    let out = run(
        Command::new(gcc_robot())
            .args(["build", "--target", "rs274ngc", "--tools"])
            .arg(to.with_file_name("tools.tbl"))
            .args(more)
            .arg("-o")
            .arg(to)
            .arg(source),
        Duration::from_secs(60),
    )
    .map_err(|e| e.to_string())?;
    if out.status == Some(0) { Ok(()) } else { Err(format!("{} {}", out.how(), out.errors())) }
}

/// Whether they were compared; without the oracle they are not.
fn compare(dir: &Path, source: &Path, more: &[&str], tolerance: f64) -> Result<bool, String> {
    let tools = dir.join("tools.tbl");
    std::fs::write(&tools, TOOLS).map_err(|e| e.to_string())?;
    let Some(before) = path(source, Some(&tools)) else { return Ok(false) };
    if before.end.trim_end() != "ok" && !before.end.ends_with("ok") {
        return Err(format!("the oracle refuses the source: {}", before.end));
    }
    let written = dir.join("written.ngc");
    build(source, &written, more)?;
    let Some(after) = path(&written, Some(&tools)) else { return Ok(false) };
    if !after.end.ends_with("ok") {
        return Err(format!("LinuxCNC refuses what was written: {}", after.end));
    }
    let far = distance(&before.moves, &after.moves)?;
    if far <= tolerance { Ok(true) } else { Err(format!("{far} mm away")) }
}

fn check(what: &str, more: &[&str], tolerance: f64) {
    let mut files: Vec<PathBuf> =
        PROGRAMS.iter().map(|p| root().join("tests/corpus/accepted").join(format!("{p}.ngc"))).collect();
    files.push(root().join("tests/golden/unb2013/figF-2_capability-part.ngc"));
    let (mut wrong, mut equal) = (Vec::new(), 0);
    for file in &files {
        let dir = tempfile::tempdir().expect("a temporary folder");
        match compare(dir.path(), file, more, tolerance) {
            Ok(compared) => equal += usize::from(compared),
            Err(why) => wrong.push(format!("{}: {why}", file.file_name().unwrap_or_default().display())),
        }
    }
    let line = format!("{what}: {equal} of {} programs equal in motion", files.len());
    if equal + wrong.len() > 0 {
        score(what, &line);
    }
    assert!(wrong.is_empty(), "{line}\n{}", wrong.join("\n"));
}

#[test]
fn written_for_linuxcnc_with_nine_decimals() {
    check("rs274ngc, 9 decimals", &["--to", "linuxcnc", "--decimals", "9"], 1e-6);
}

#[test]
fn written_for_linuxcnc_with_four_decimals() {
    check("rs274ngc, 4 decimals", &["--to", "linuxcnc", "--decimals", "4"], 1e-4);
}

#[test]
fn written_in_inches() {
    check("rs274ngc in inches, 9 decimals", &["--to", "linuxcnc", "--decimals", "9", "--units", "inch"], 1e-6);
}
