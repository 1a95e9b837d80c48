//! Diagnostics on their way to the reader: people, editors, machines.

mod github;
mod human;
mod json;
mod sarif;
mod short;

use std::io::Write;

use gr_text::{Diagnostic, Severity};

use crate::exit::Exit;

use crate::sources::{Positions, Sources};

/// How diagnostics are written.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum, Default)]
pub enum MessageFormat {
    /// With the source line, notes and help.
    #[default]
    Human,
    /// One line each.
    Short,
    /// One JSON object per line, and a summary.
    Json,
    /// One SARIF 2.1.0 log.
    Sarif,
    /// Annotations of GitHub's workflow logs.
    Github,
}

impl MessageFormat {
    /// Read by programs: goes to standard output.
    pub fn for_machines(self) -> bool {
        !matches!(self, MessageFormat::Human | MessageFormat::Short)
    }
}

/// How many findings of each kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Tally {
    /// Errors.
    pub errors: usize,
    /// Warnings.
    pub warnings: usize,
    /// Hints.
    pub hints: usize,
    /// Files looked at.
    pub files: usize,
}

impl Tally {
    /// Counts a finding.
    pub fn count(&mut self, severity: Severity) {
        self.add(severity, 1);
    }
    /// Counts `n` findings.
    pub fn add(&mut self, severity: Severity, n: usize) {
        match severity {
            Severity::Error => self.errors += n,
            Severity::Warning => self.warnings += n,
            Severity::Hint => self.hints += n,
        }
    }
    /// Findings of all kinds.
    pub fn sum(&self) -> usize {
        self.errors + self.warnings + self.hints
    }
    /// `2 errors and 1 warning in 3 files`.
    pub fn sentence(&self) -> String {
        let many = |n: usize, one: &str| if n == 1 { format!("1 {one}") } else { format!("{n} {one}s") };
        let kinds = [(self.errors, "error"), (self.warnings, "warning"), (self.hints, "hint")];
        let kinds: Vec<String> = kinds.iter().filter(|(n, _)| *n > 0).map(|(n, what)| many(*n, what)).collect();
        let found = match kinds.as_slice() {
            [] => "no findings".to_string(),
            [rest @ .., last] if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
            [only, ..] => only.clone(),
        };
        if self.files == 0 { found } else { format!("{found} in {}", many(self.files, "file")) }
    }
}

/// Writes diagnostics in the chosen format.
pub struct Renderer {
    format: MessageFormat,
    color: bool,
    to_stdout: bool,
    held: Vec<u8>,
    sarif: sarif::Log,
    positions: Positions,
    collected: Option<Vec<Diagnostic>>,
    /// What was written so far.
    pub tally: Tally,
    /// What a run ends with that could not begin: a file could not be read or written, or the command line is wrong.
    ends: Exit,
}

impl Renderer {
    /// `stdout_is_taken`: the result itself goes there.
    pub fn new(format: MessageFormat, color: bool, stdout_is_taken: bool) -> Renderer {
        Renderer {
            format,
            color,
            to_stdout: format.for_machines() && !stdout_is_taken,
            held: Vec::new(),
            sarif: sarif::Log::default(),
            positions: Positions::default(),
            collected: None,
            tally: Tally::default(),
            ends: Exit::Findings,
        }
    }
    /// How a run ends that could not begin.
    pub fn failed(&self) -> Exit {
        self.ends
    }
    /// Writes nothing; [`Renderer::into_collected`] gives what was found.
    pub fn collecting() -> Renderer {
        Renderer { collected: Some(Vec::new()), ..Renderer::new(MessageFormat::Short, false, true) }
    }
    /// What was shown to a renderer that writes nothing.
    pub fn into_collected(self) -> Vec<Diagnostic> {
        self.collected.unwrap_or_default()
    }
    /// One finding.
    pub fn show(&mut self, sources: &Sources, d: &Diagnostic) {
        self.tally.count(d.severity);
        // What stands in no text was said on the command line.
        let said = sources.get(d.primary().0).is_none_or(|f| f.text.is_empty());
        self.ends = self.ends.max(Exit::of(d.code, said));
        if let Some(list) = &mut self.collected {
            list.push(d.clone());
            return;
        }
        let (out, positions) = (&mut self.held, &mut self.positions);
        match self.format {
            MessageFormat::Human => human::write(out, sources, positions, d, self.color),
            MessageFormat::Short => short::write(out, sources, positions, d),
            MessageFormat::Json => json::write(out, sources, positions, d),
            MessageFormat::Github => github::write(out, sources, positions, d),
            MessageFormat::Sarif => self.sarif.add(sources, positions, d),
        }
        if self.held.len() > 1 << 16 {
            self.flush();
        }
    }
    /// Findings that are not shown.
    pub fn pass_over(&mut self, more: &Tally) {
        self.tally.errors += more.errors;
        self.tally.warnings += more.warnings;
        self.tally.hints += more.hints;
        if more.sum() > 0 {
            self.remark(&format!("… and {} more findings of these kinds", more.sum()));
        }
    }
    /// A sentence for people.
    pub fn remark(&mut self, text: &str) {
        if !self.format.for_machines() {
            let _ = writeln!(self.held, "{text}");
        }
    }
    /// Files may have changed: forget positions.
    pub fn forget(&mut self) {
        self.positions = Positions::default();
    }
    /// The end of the run: summary or closing of the log.
    pub fn finish(&mut self, summary: bool) {
        match self.format {
            MessageFormat::Human | MessageFormat::Short if summary => {
                let _ = writeln!(self.held, "{}", self.tally.sentence());
            }
            MessageFormat::Json => json::summary(&mut self.held, &self.tally),
            MessageFormat::Sarif => self.sarif.write(&mut self.held),
            _ => {}
        }
        self.flush();
    }
    /// Hands over what is gathered.
    pub fn flush(&mut self) {
        // Nowhere left to complain to.
        let _ = if self.to_stdout {
            crate::output::to_stdout(&self.held)
        } else {
            std::io::stderr().lock().write_all(&self.held)
        };
        self.held.clear();
    }
}

/// `error`, `warning`, `hint`.
fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Hint => "hint",
    }
}

/// Byte range as line and column from 1, start and end.
fn region(sources: &Sources, positions: &mut Positions, l: &gr_text::Label) -> [(u32, u32); 2] {
    [positions.of(sources, l.file, l.span.start), positions.of(sources, l.file, l.span.end.max(l.span.start))]
}
