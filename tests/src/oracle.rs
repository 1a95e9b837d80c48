//! The real `rs274` of LinuxCNC 2.9 (Debian package `linuxcnc-uspace`) beside `gcc-robot rs274`: the same
//! program through both, each call with a home folder of its own (2.9 keeps the tool table in a file there, so
//! two runs that share it disturb each other), and a comparison line by line.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::Duration;

use crate::process::{Ended, run};

/// One run may take this long. The slowest shipped program needs 1 s.
pub const LIMIT: Duration = Duration::from_secs(60);

/// How long the real one is watched where it is known never to end; the budgets end ours in less.
const ENDLESS: Duration = Duration::from_secs(15);

/// Top of the source tree.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("the tests stand in the source tree")
}

/// A folder under `target/` for what tests keep from run to run.
pub fn kept(name: &str) -> PathBuf {
    let dir = target().join("test-data").join(name);
    std::fs::create_dir_all(&dir).expect("target is writable");
    dir
}

/// The target folder this test was built into, profile included: `target/ci`.
fn profile_dir() -> PathBuf {
    let exe = std::env::current_exe().expect("a test knows its file");
    exe.parent().and_then(Path::parent).expect("tests lie in target/PROFILE/deps").to_path_buf()
}

fn target() -> PathBuf {
    profile_dir().parent().map(Path::to_path_buf).unwrap_or_else(|| root().join("target"))
}

/// A missing component is a failure where everything must be there, and a note elsewhere.
pub fn missing(what: &str) -> bool {
    assert!(std::env::var_os("CI").is_none(), "{what} is missing");
    eprintln!("skipped: {what} is missing");
    false
}

/// The real `rs274`, or none (see [`missing`]).
pub fn reference() -> Option<PathBuf> {
    let found = std::env::var_os("PATH")
        .into_iter()
        .flat_map(|p| std::env::split_paths(&p).collect::<Vec<_>>())
        .map(|d| d.join("rs274"))
        .find(|p| p.is_file());
    if found.is_none() {
        missing("rs274 (Debian package linuxcnc-uspace)");
    }
    found
}

/// Our binary: `GCC_ROBOT_BIN`, or built with the profile this test was built with.
pub fn gcc_robot() -> &'static Path {
    static BIN: OnceLock<PathBuf> = OnceLock::new();
    BIN.get_or_init(|| {
        if let Some(bin) = std::env::var_os("GCC_ROBOT_BIN") {
            return PathBuf::from(bin);
        }
        let dir = profile_dir();
        let profile = match dir.file_name().and_then(|n| n.to_str()) {
            Some("debug") | None => "dev".to_string(),
            Some(other) => other.to_string(),
        };
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let status = Command::new(cargo)
            .current_dir(root())
            .args(["build", "--quiet", "-p", "gcc-robot", "--profile", &profile])
            .status()
            .expect("cargo runs");
        assert!(status.success(), "gcc-robot does not build");
        dir.join("gcc-robot")
    })
}

/// One program to run.
#[derive(Clone, Debug, Default)]
pub struct Job {
    /// Its text.
    pub program: Vec<u8>,
    /// Tool table, in inches (`rs274` 2.9 is an inch machine).
    pub tools: Option<String>,
    /// Parameter file.
    pub params: Option<String>,
    /// INI file.
    pub ini: Option<String>,
    /// Other files of the folder: name, text.
    pub files: Vec<(String, Vec<u8>)>,
    /// Further options.
    pub options: Vec<String>,
    /// The real one never ends on it; ours must, with an error.
    pub endless: bool,
}

/// What a run gave.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The output file.
    pub canon: String,
    /// The parameter file afterwards.
    pub params: String,
    /// How it ended.
    pub ended: Ended,
}

impl Outcome {
    /// Accepted.
    pub fn ok(&self) -> bool {
        self.ended.status == Some(0)
    }
}

impl Job {
    /// A program with the tool table of the corpus.
    pub fn new(program: impl Into<Vec<u8>>) -> Job {
        Job { program: program.into(), tools: Some(TOOLS.into()), ..Job::default() }
    }

    /// Through the real one.
    pub fn reference(&self, rs274: &Path) -> Outcome {
        self.run(&mut Command::new(rs274))
    }

    /// Through ours.
    pub fn ours(&self) -> Outcome {
        self.run(Command::new(gcc_robot()).arg("rs274"))
    }

    fn run(&self, command: &mut Command) -> Outcome {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| dir.path().join(name);
        let write = |name: &str, bytes: &[u8]| std::fs::write(at(name), bytes).expect("writable");
        write("prog.ngc", &self.program);
        for (name, bytes) in &self.files {
            write(name, bytes);
        }
        command.current_dir(dir.path()).env("HOME", dir.path()).env("LC_ALL", "C").arg("-g");
        for (option, file, text) in
            [("-t", "tool.tbl", &self.tools), ("-v", "sim.var", &self.params), ("-i", "sim.ini", &self.ini)]
        {
            if let Some(text) = text {
                write(file, text.as_bytes());
                command.arg(option).arg(file);
            }
        }
        if self.params.is_none() {
            command.args(["-v", "sim.var"]);
        }
        command.args(&self.options).args(["prog.ngc", "out.canon"]);
        let ended = run(command, if self.endless { ENDLESS } else { LIMIT }).expect("the program starts");
        let read = |name: &str| String::from_utf8_lossy(&std::fs::read(at(name)).unwrap_or_default()).into_owned();
        Outcome { canon: read("out.canon"), params: read("sim.var"), ended }
    }
}

/// The corpus' tools, lengths in inches: mills of 6, 3, 10 and 0.5 mm, a drill, lathe tools of every orientation
/// that matters, one with offsets in all axes.
pub const TOOLS: &str = "\
T1 P1 Z+1.968504 D+0.236220 ;mill 6 mm, 50 mm long
T2 P2 Z+1.574803 D+0.118110 ;mill 3 mm
T3 P3 Z+2.362205 D+0.393701 ;mill 10 mm
T4 P4 Z+3.149606 D+0.196850 ;drill 5 mm
T5 P5 X-0.393701 Z-0.787402 D+0.062992 I+95.0 J+155.0 Q2 ;lathe, outside
T6 P6 X-0.196850 Z-1.181102 D+0.031496 I+5.0 J+65.0 Q6 ;lathe, neutral
T7 P7 X+0.1 Y+0.2 Z+0.3 A+1 B+2 C+3 U+0.4 V+0.5 W+0.6 D+0.019685 ;offsets everywhere
T20 P8 Z+1.0 D+0.5 ;pocket and number differ
T99999 P9 Z+0.5 D+1.0 ;a big number
";

/// Leaves out the running number at the start of each line and writes `-0.0000` as `0.0000`.
pub fn normalised(canon: &str) -> Vec<String> {
    canon
        .lines()
        .map(|l| {
            let l = l.trim_start();
            let l = match l.split_once(' ') {
                Some((n, rest)) if n.bytes().all(|b| b.is_ascii_digit()) => rest,
                _ => l,
            };
            without_negative_zero(l)
        })
        .collect()
}

fn without_negative_zero(line: &str) -> String {
    let mut out = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(at) = rest.find("-0.0000") {
        let tail = &rest[at + 7..];
        out.push_str(&rest[..at]);
        out.push_str(if tail.starts_with(|c: char| c.is_ascii_digit() && c != '0') { "-0.0000" } else { "0.0000" });
        rest = tail;
    }
    out.push_str(rest);
    out
}

/// How two outputs relate.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// Line by line the same.
    Same,
    /// Not the same: a description for people.
    Differs(String),
}

/// Compares two outputs in the form of [`normalised`].
pub fn compare(reference: &[String], ours: &[String]) -> Verdict {
    for i in 0..reference.len().max(ours.len()) {
        let (a, b) = (reference.get(i), ours.get(i));
        match (a, b) {
            (Some(a), Some(b)) if a == b => {}
            _ => {
                let show = |l: Option<&String>| l.map_or("(nothing)", |l| l.as_str()).to_string();
                let before = i.checked_sub(1).and_then(|i| reference.get(i)).map_or(String::new(), |l| format!("\n  after {l}"));
                return Verdict::Differs(format!(
                    "line {} of {}:{before}\n  rs274 {}\n  ours  {}",
                    i + 1,
                    reference.len(),
                    show(a),
                    show(b)
                ));
            }
        }
    }
    Verdict::Same
}

/// The message of a run's standard error: the line before the text of the blamed block.
pub fn message(errors: &str) -> String {
    let lines: Vec<&str> = errors
        .lines()
        .filter(|l| !l.trim().is_empty() && *l != "executing" && !l.contains("(updating variable file)"))
        .collect();
    lines.first().map_or(String::new(), |l| l.trim().to_string())
}

/// Runs a job through both and says what differs: verdict, canonical calls, message and parameter file.
pub fn differ(job: &Job, rs274: &Path) -> Verdict {
    let (a, b) = (job.reference(rs274), job.ours());
    if job.endless && !a.ended.timed_out {
        return Verdict::Differs(format!("rs274 ends after all: {}", a.ended.how()));
    }
    if a.ended.timed_out && !job.endless {
        return Verdict::Differs("rs274 ran into the time limit".into());
    }
    if job.endless {
        return if !b.ended.timed_out && !b.ok() { Verdict::Same } else { Verdict::Differs(format!("rs274 never ends, ours: {}", b.ended.how())) };
    }
    if a.ok() != b.ok() {
        return Verdict::Differs(format!("rs274: {} {}\n  ours: {} {}", a.ended.how(), message(&a.ended.errors()), b.ended.how(), b.ended.errors()));
    }
    let canon = compare(&normalised(&a.canon), &normalised(&b.canon));
    if matches!(canon, Verdict::Differs(_)) {
        return canon;
    }
    if !a.ok() && message(&a.ended.errors()) != message(&b.ended.errors()) {
        return Verdict::Differs(format!("message\n  rs274 {}\n  ours  {}", message(&a.ended.errors()), message(&b.ended.errors())));
    }
    if a.ended.stdout != b.ended.stdout {
        return Verdict::Differs(format!("standard output\n  rs274 {}\n  ours  {}", a.ended.output(), b.ended.output()));
    }
    canon
}

/// Runs many jobs on all cores; the names of those that fail, with what differs.
pub fn differ_all(jobs: &[(String, Job)], rs274: &Path) -> Vec<(String, String)> {
    let next = std::sync::atomic::AtomicUsize::new(0);
    let found = std::sync::Mutex::new(Vec::new());
    let threads = std::thread::available_parallelism().map_or(2, |n| n.get());
    gcc_robot();
    std::thread::scope(|s| {
        for _ in 0..threads {
            s.spawn(|| {
                loop {
                    let i = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    let Some((name, job)) = jobs.get(i) else { return };
                    if let Verdict::Differs(why) = differ(job, rs274) {
                        found.lock().expect("no thread panics while it holds the lock").push((name.clone(), why));
                    }
                }
            });
        }
    });
    let mut failed = found.into_inner().expect("no thread panicked");
    failed.sort();
    failed
}

/// Fails with a readable report when anything differs; prints the score.
pub fn must_agree(what: &str, jobs: &[(String, Job)]) {
    let Some(rs274) = reference() else { return };
    let start = std::time::Instant::now();
    let failed = differ_all(jobs, &rs274);
    let mut report = format!(
        "{what}: {} of {} programs as rs274, {:.1} s\n",
        jobs.len() - failed.len(),
        jobs.len(),
        start.elapsed().as_secs_f64()
    );
    score(what, &report);
    for (name, why) in failed.iter().take(40) {
        report.push_str(&format!("\n{name}: {why}\n"));
    }
    assert!(failed.is_empty(), "{report}");
    println!("{report}");
}

/// Keeps a score for the README.
pub fn score(what: &str, line: &str) {
    let file = kept("scores").join(format!("{}.txt", what.replace(|c: char| !c.is_ascii_alphanumeric(), "-")));
    let _ = std::fs::write(file, line);
}
