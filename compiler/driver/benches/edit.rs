//! How long an edit takes until fresh diagnostics are there, and how much memory a session holds.
//!
//! `cargo bench -p gr-driver --bench edit` prints medians and 99th percentiles of processor time beside their budgets;
//! `-- calls 1000000` runs only what has both words in its name.

#[allow(dead_code, unused_imports, reason = "shared with the test crate")]
#[path = "../../../tests/src/generate.rs"]
mod generate;

use std::time::Duration;

use generate::Random;
use gr_driver::{Options, Session};
use gr_interp::Setup;
use gr_text::FileId;

fn ms(d: Duration) -> f64 {
    d.as_secs_f64() * 1e3
}

/// Time that this thread has spent on a processor: other programs on the machine don't count.
struct Instant(Duration);

impl Instant {
    fn now() -> Instant {
        let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Instant(Duration::new(t.tv_sec.unsigned_abs(), t.tv_nsec as u32))
    }
    fn elapsed(&self) -> Duration {
        Instant::now().0.saturating_sub(self.0)
    }
}

/// Resident memory in MB, now.
fn resident() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmRSS:")).unwrap_or("");
    line.split_whitespace().nth(1).and_then(|v| v.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

struct Bench {
    session: Session,
    file: FileId,
    text: String,
    random: Random,
}

impl Bench {
    fn open(name: &str, text: String, before: f64) -> Bench {
        let mut session = Session::new();
        let start = Instant::now();
        let file = session.open("bench.ngc", &text, Options::new(Setup::default()));
        let opened = start.elapsed();
        let check = session.check(file);
        println!(
            "{name}: open {:.0} ms, open + check {:.0} ms, {} diagnostics, {:.0} MB resident without the client's copy",
            ms(opened),
            ms(start.elapsed()),
            check.diagnostics.len(),
            resident() - before - text.len() as f64 / 1e6,
        );
        for d in check.diagnostics.iter().take(3) {
            println!("  {:?} at byte {}: {}", d.code, d.primary().1.start, d.message);
        }
        Bench { session, file, text, random: Random::new(7) }
    }

    /// Byte range of the line that holds a random byte.
    fn line(&mut self) -> (usize, usize) {
        let at = (self.text.len() / 4) + self.random.below(self.text.len() as u64 / 2) as usize;
        let start = self.text[..at].rfind('\n').map_or(0, |i| i + 1);
        let end = self.text[at..].find('\n').map_or(self.text.len(), |i| at + i);
        (start, end)
    }

    fn edit(&mut self, from: usize, to: usize, new: &str) -> Duration {
        let start = Instant::now();
        self.session.edit(self.file, from as u32..to as u32, new);
        std::hint::black_box(self.session.check(self.file));
        start.elapsed()
    }

    /// Makes an edit, then undoes it; both are measured.
    fn rounds(&mut self, name: &str, budget: (f64, f64), rounds: usize, edit: impl Fn(&str) -> Option<(usize, usize, String)>) {
        let mut times = Vec::new();
        while times.len() < rounds {
            let (start, end) = self.line();
            let Some((from, to, new)) = edit(&self.text[start..end]) else { continue };
            let (from, to) = (start + from, start + to);
            let old = self.text[from..to].to_string();
            times.push(self.edit(from, to, &new));
            times.push(self.edit(from, from + new.len(), &old));
        }
        report(name, &mut times, budget);
    }
}

fn report(name: &str, times: &mut [Duration], (median, p99): (f64, f64)) {
    times.sort();
    let (m, p) = (ms(times[times.len() / 2]), ms(times[times.len() * 99 / 100]));
    let verdict = if m <= median && p <= p99 { "ok" } else { "MISSED" };
    println!("  {name:34} median {m:8.3} ms (≤ {median})   p99 {p:8.3} ms (≤ {p99})   {verdict}");
}

fn digit(line: &str) -> Option<(usize, usize, String)> {
    let at = line.rfind("X").filter(|_| !line.starts_with('('))?;
    let digit = line[at..].find('.')? + at + 3;
    let old = *line.as_bytes().get(digit)?;
    old.is_ascii_digit().then(|| (digit, digit + 1, if old == b'5' { "6" } else { "5" }.to_string()))
}

fn never_converging(bench: &mut Bench, lines: u32, scale: f64) {
    let at = bench.text.find("G0 X0").expect("the header has it");
    let (mut visible, mut whole) = (Vec::new(), Vec::new());
    for round in 0..20 {
        // Each round leaves every later chunk in a state that was never there before.
        let (to, new) = (if round == 0 { at } else { at + 12 }, format!("G91 G0 X.{round:02}\n"));
        let start = Instant::now();
        bench.session.edit(bench.file, at as u32..to as u32, &new);
        std::hint::black_box(bench.session.check_range(bench.file, 0..2000.min(lines)));
        visible.push(start.elapsed());
        let start = Instant::now();
        std::hint::black_box(bench.session.check(bench.file));
        whole.push(start.elapsed());
    }
    report("G91 at the top, visible lines", &mut visible, (25.0, 25.0));
    report("G91 at the top, whole file", &mut whole, (150.0 * scale, 150.0 * scale));
}

/// A subroutine at the top that is called, a loop, and then plain lines.
fn sub_and_loop(lines: usize) -> String {
    let drill = "o100 sub\nG0 X#1 Y#2\nG1 Z-1\nG0 Z5\no100 endsub\n";
    let rows = "#100=0\no101 while [#100 LT 10]\no100 call [#100] [5]\n#100=[#100+1]\no101 endwhile\n";
    let plain = generate::big(lines.saturating_sub(10));
    let (header, moves) = plain.split_at(plain.find("G1 X").unwrap_or(0));
    format!("{drill}{header}{rows}{moves}")
}

/// A call of a subroutine at the top every hundred lines.
fn calls(lines: usize) -> String {
    let plain = generate::big(lines - lines / 100 - 3);
    let mut text = String::with_capacity(plain.len() + lines);
    text.push_str("o100 sub\nG1 Z-1\no100 endsub\n");
    for (n, line) in plain.lines().enumerate() {
        text.push_str(line);
        text.push_str(if n % 100 == 99 { "\no100 call\n" } else { "\n" });
    }
    text
}

/// A branch with a label of its own in every hundred lines: labels are met and never forgotten.
fn branches(lines: usize) -> String {
    let plain = generate::big(lines - lines / 50 - 3);
    let mut text = String::with_capacity(plain.len() + lines);
    for (n, line) in plain.lines().enumerate() {
        text.push_str(line);
        text.push('\n');
        if n % 100 == 99 {
            text.push_str(&format!("o{n} if [1]\nM8\no{n} endif\n"));
        }
    }
    text
}

fn main() {
    for (lines, budget) in [(100_000, (0.5, 5.0)), (1_000_000, (3.0, 20.0))] {
        let kinds: [(&str, fn(usize) -> String); 5] = [
            ("big", generate::big),
            ("mixed", generate::mixed),
            ("sub and loop", sub_and_loop),
            ("calls everywhere", calls),
            ("branches everywhere", branches),
        ];
        for (kind, make) in kinds {
            let name = format!("{kind}, {lines} lines");
            if !std::env::args().skip(1).filter(|a| !a.starts_with('-')).all(|wanted| name.contains(&wanted)) {
                continue;
            }
            let text = make(lines);
            let before = resident() - text.len() as f64 / 1e6;
            let mut bench = Bench::open(&name, text, before);
            let rounds = if lines > 500_000 { 400 } else { 1000 };
            bench.rounds("one digit", budget, rounds, digit);
            bench.rounds("a feed word", budget, rounds, |l| l.contains('X').then(|| (l.len(), l.len(), " F777".to_string())));
            bench.rounds("a comment line", budget, rounds, |_| Some((0, 0, "(note)\n".to_string())));
            bench.rounds("an unused parameter", budget, rounds / 4, |_| Some((0, 0, "#900=1\n".to_string())));
            bench.rounds("a line less", budget, rounds / 4, |l| Some((0, l.len() + 1, String::new())));
            never_converging(&mut bench, lines as u32, lines as f64 / 1e6);
            println!("  {} executed; {:.0} MB resident afterwards", executed(&bench.session), resident() - before);
        }
    }
}

fn executed(session: &Session) -> String {
    let e = session.executed();
    format!("{} scans, {} steps, {} flows, {} timelines", e.scans, e.steps, e.flows, e.timelines)
}
