//! Times our parser and the whole compiler beside public peers, on one generated file, in one run.

use std::process::{Command, Stdio};

use gcode::core::{BlockVisitor, CommandVisitor, ControlFlow, Diagnostics, HasDiagnostics, ProgramVisitor, Span, Value};

const RUNS: usize = 5;

fn cpu(who: libc::c_int) -> f64 {
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    unsafe { libc::getrusage(who, &mut usage) };
    let seconds = |t: libc::timeval| t.tv_sec as f64 + t.tv_usec as f64 * 1e-6;
    seconds(usage.ru_utime) + seconds(usage.ru_stime)
}

fn median(mut work: impl FnMut(), who: libc::c_int) -> f64 {
    work();
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let from = cpu(who);
            work();
            cpu(who) - from
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2]
}

/// Makes the compiler believe that a result is used.
fn keep<T>(value: T) {
    std::hint::black_box(value);
}

/// A visitor of the `gcode` 0.7 core that counts words.
#[derive(Default)]
struct Count {
    words: usize,
    ignored: Ignored,
}

#[derive(Default)]
struct Ignored;
impl Diagnostics for Ignored {}

struct Block<'a>(&'a mut Count);
struct Code<'a>(&'a mut Count);

impl HasDiagnostics for Count {
    fn diagnostics(&mut self) -> &mut dyn Diagnostics {
        &mut self.ignored
    }
}
impl HasDiagnostics for Block<'_> {
    fn diagnostics(&mut self) -> &mut dyn Diagnostics {
        &mut self.0.ignored
    }
}
impl HasDiagnostics for Code<'_> {
    fn diagnostics(&mut self) -> &mut dyn Diagnostics {
        &mut self.0.ignored
    }
}
impl ProgramVisitor for Count {
    fn start_block(&mut self) -> ControlFlow<impl BlockVisitor + '_> {
        ControlFlow::Continue(Block(self))
    }
}
impl BlockVisitor for Block<'_> {
    fn word_address(&mut self, _: char, _: Value<'_>, _: Span) {
        self.0.words += 1;
    }
    fn start_general_code(&mut self, _: gcode::core::Number) -> ControlFlow<impl CommandVisitor + '_> {
        self.0.words += 1;
        ControlFlow::Continue(Code(self.0))
    }
}
impl CommandVisitor for Code<'_> {
    fn argument(&mut self, _: char, _: Value<'_>, _: Span) {
        self.0.words += 1;
    }
}

fn main() {
    let text = gr_tests::generate::big(1_000_000);
    let mb = text.len() as f64 / 1e6;
    println!("1 000 000 lines, {mb:.1} MB; CPU seconds, median of {RUNS}");
    let mut rows: Vec<(&str, f64)> = Vec::new();
    let dialect = gr_spec::Dialect::linuxcnc();
    rows.push((
        "gcc-robot: scan, whole text (lossless tables)",
        median(|| keep(gr_gcode::scan(&text, dialect)), libc::RUSAGE_SELF),
    ));
    rows.push((
        "gcc-robot: scan in chunks of 1024 lines",
        median(
            || {
                for chunk in gr_gcode::split_chunks(&text, 1024) {
                    std::hint::black_box(gr_gcode::scan(chunk, dialect));
                }
            },
            libc::RUSAGE_SELF,
        ),
    ));
    rows.push((
        "gcode 0.7.0 core (visitor, no tree)",
        median(
            || {
                let mut count = Count::default();
                gcode::core::parse(&text, &mut count);
                assert!(std::hint::black_box(count.words) > 2_000_000);
            },
            libc::RUSAGE_SELF,
        ),
    ));
    rows.push(("gcode 0.7.0 parse (tree)", median(|| keep(gcode::parse(&text).is_ok()), libc::RUSAGE_SELF)));
    rows.push(("gcode 0.6.1 (iterator)", median(|| keep(gcode_06::parse(&text).count()), libc::RUSAGE_SELF)));
    rows.push((
        "g-code 0.6.0 (tree with spans)",
        median(|| keep(g_code::parse::file_parser(&text).is_ok()), libc::RUSAGE_SELF),
    ));
    let ours = rows[0].1;
    for (name, s) in &rows {
        println!("{name:50} {s:8.3} s {:8.0} MB/s {:6.1} x", mb / s, s / ours);
    }
    whole_programs(&text, mb);
}

fn whole_programs(text: &str, mb: f64) {
    let dir = std::env::temp_dir().join(format!("gr-peers-{}", std::process::id()));
    std::fs::create_dir_all(&dir).expect("temporary folder");
    let program = dir.join("big.ngc");
    std::fs::write(&program, text).expect("writable");
    let ours = std::env::var("GCC_ROBOT").unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/release/gcc-robot").into());
    let run = |exe: &str, first: &[&str]| {
        let status = Command::new(exe)
            .args(first)
            .arg("-g")
            .arg(&program)
            .arg(dir.join("out.canon"))
            .env("HOME", &dir)
            .env("LC_ALL", "C")
            .current_dir(&dir)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        assert!(status.is_ok_and(|s| s.success()), "{exe} failed");
    };
    println!("source → canonical output, whole process");
    let a = median(|| run(&ours, &["rs274"]), libc::RUSAGE_CHILDREN);
    println!("{:50} {a:8.3} s {:8.0} MB/s", "gcc-robot rs274", mb / a);
    if Command::new("rs274").arg("-?").stderr(Stdio::null()).stdout(Stdio::null()).status().is_ok() {
        let b = median(|| run("rs274", &[]), libc::RUSAGE_CHILDREN);
        println!("{:50} {b:8.3} s {:8.1} MB/s {:6.1} x", "rs274 (LinuxCNC)", mb / b, b / a);
    }
    let _ = std::fs::remove_dir_all(&dir);
}
