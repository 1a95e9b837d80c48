//! `gcc-robot check`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use gr_driver::{Once, Options};
use gr_text::{Code, Diagnostic, FileId, Severity, Span, Text, code};

use crate::exchange;
use crate::exit::Exit;
use crate::options::{CheckArgs, Global};
use crate::progress::Progress;
use crate::render::{Renderer, Tally};
use crate::setup::{Levels, Station, Stations, is_program, station};
use crate::sources::{Sources, read_program, walk};

/// What came of one file.
pub struct Checked {
    /// Files that the findings point into.
    pub sources: Sources,
    /// The findings.
    pub found: Vec<Diagnostic>,
    /// Findings that are not listed.
    pub more: Tally,
    /// It could not be read at all.
    pub unreadable: bool,
    /// Where there are errors: files of subroutines that belong to the program, and those that it looked for.
    pub sought: Vec<PathBuf>,
}

impl Checked {
    /// Nothing was found.
    pub fn nothing() -> Checked {
        Checked { sources: Sources::default(), found: Vec::new(), more: Tally::default(), unreadable: false, sought: Vec::new() }
    }
    /// What is to be said about a G-code program.
    pub fn of(name: &str, text: &Text, options: Options, lints: &Levels) -> Checked {
        let once = gr_driver::check_once(name, text, options);
        let mut found = once.check.diagnostics.clone();
        found.iter_mut().for_each(|d| lints.harden(d));
        Checked { sources: used(&once, &found), found, more: lints.tally(&once.check.unlisted), ..Checked::nothing() }
    }
    /// The same behind a finding about the start of the file.
    pub fn headed_by(mut self, first: Diagnostic, name: &str, text: &Text) -> Checked {
        if self.sources.get(FileId(0)).is_none() {
            self.sources.add(name, text);
        }
        self.found.insert(0, first);
        self
    }
}

pub fn run(global: &Global, args: &CheckArgs) -> Exit {
    let mut renderer = global.renderer(false);
    let mut sources = Sources::default();
    let (files, stations, mut exit) = match programs(args, &mut sources, &mut renderer) {
        Named::Programs(files, stations, exit) => (files, stations, exit),
        Named::Faulty => {
            renderer.finish(!global.quiet);
            return renderer.failed();
        }
        Named::Nothing => {
            eprintln!("name the programs to check, or add sources to gcc-robot.toml");
            return Exit::Usage;
        }
    };
    if args.job.is_some() && stations.iter().any(|s| s.machine.is_none()) {
        eprintln!("--job needs --machine: it places parts on one");
        return Exit::Usage;
    }
    renderer.tally.files = files.len();
    let jobs = args.jobs.or_else(|| std::thread::available_parallelism().ok()).map_or(1, std::num::NonZero::get);
    let mut held = Vec::new();
    let progress = Progress::new(global.quiet, "checking");
    each(&files, &stations, jobs, |n, checked| {
        progress.tell(|| format!("checked {} of {} files", n + 1, files.len()));
        // Findings and progress must not meet on one line.
        if std::io::IsTerminal::is_terminal(&std::io::stderr()) {
            held.push(checked);
            return;
        }
        show(&mut renderer, &checked);
        if checked.unreadable {
            exit = Exit::Io;
        }
    });
    drop(progress);
    for checked in held {
        show(&mut renderer, &checked);
        if checked.unreadable {
            exit = Exit::Io;
        }
    }
    renderer.finish(!global.quiet);
    if renderer.tally.errors > 0 { exit.max(Exit::Findings) } else { exit }
}

/// Shows the findings of a file.
pub fn show(renderer: &mut Renderer, checked: &Checked) {
    renderer.forget();
    checked.found.iter().for_each(|d| renderer.show(&checked.sources, d));
    renderer.pass_over(&checked.more);
    renderer.flush();
}

/// What the command line names.
enum Named {
    /// Programs, and what they are run with.
    Programs(Vec<PathBuf>, Stations, Exit),
    /// What they are run with is wrong.
    Faulty,
    /// Nothing at all.
    Nothing,
}

/// The programs that paths name: files, and what lies in folders; or else those of the project.
fn programs(args: &CheckArgs, sources: &mut Sources, renderer: &mut Renderer) -> Named {
    if args.paths.is_empty() {
        return sources_of_project(args, sources, renderer);
    }
    let mut exit = Exit::Ok;
    let mut files = Vec::new();
    let dialect = args.setup.dialect.as_deref().and_then(gr_spec::Dialect::find);
    let mut empty = Vec::new();
    for path in &args.paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let before = files.len();
        let closed = walk(path, &is_program(dialect), &mut files);
        if !closed.is_empty() {
            super::unreadable(&closed, sources, renderer);
            exit = Exit::Io;
        } else if files.len() == before {
            empty.push(path);
        }
    }
    let Some(mut stations) = Stations::of(&args.setup, &args.lints, &files, sources, renderer) else { return Named::Faulty };
    stations.iter_mut().for_each(|s| s.take_job(args.job.as_deref()));
    empty.into_iter().for_each(|path| nothing(path.display().to_string(), sources, renderer));
    Named::Programs(files, stations, exit)
}

fn sources_of_project(args: &CheckArgs, sources: &mut Sources, renderer: &mut Renderer) -> Named {
    let Some(mut station) = station(&args.setup, &args.lints, Path::new("."), sources, renderer) else { return Named::Faulty };
    let Some(project) = &station.project else { return Named::Nothing };
    let mut exit = Exit::Ok;
    let (files, closed) = project.files(&project.file.project.sources);
    if !closed.is_empty() {
        super::unreadable(&closed, sources, renderer);
        exit = Exit::Io;
    } else if files.is_empty() {
        nothing(project.path.display().to_string(), sources, renderer);
    }
    station.take_job(args.job.as_deref());
    let stations = Stations::one(station, files.len());
    Named::Programs(files, stations, exit)
}

fn nothing(name: String, sources: &mut Sources, renderer: &mut Renderer) {
    super::complain(renderer, sources, &name, code::PROJECT_NOTHING_TO_DO, std::slice::from_ref(&name));
}

/// Checks files in parallel; results arrive in the order of the files.
fn each(files: &[PathBuf], stations: &Stations, jobs: usize, mut done: impl FnMut(usize, Checked)) {
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs.min(files.len()) {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                loop {
                    let n = next.fetch_add(1, Ordering::Relaxed);
                    let (Some(path), Some(station)) = (files.get(n), stations.get(n)) else { return };
                    if sender.send((n, check(path, station))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let mut early = BTreeMap::new();
        let mut due = 0;
        for (n, checked) in receiver {
            early.insert(n, checked);
            while let Some(checked) = early.remove(&due) {
                done(due, checked);
                due += 1;
            }
        }
    });
}

/// Checks one file.
pub fn check(path: &Path, station: &Station) -> Checked {
    let name = if path == Path::new("-") { "<stdin>".to_string() } else { path.display().to_string() };
    match read_program(path) {
        Ok(decoded) => {
            let text = decoded.text.into();
            let checked = checked(&name, path, &text, station);
            match byte_order_mark(decoded.encoding, path, &text, station) {
                Some(mark) => checked.headed_by(mark, &name, &text),
                None => checked,
            }
        }
        Err((code, args)) => unreadable(&name, code, &args),
    }
}

/// Whether a byte order mark was left out of the text of a program.
pub fn is_marked(decoded: gr_text::Encoding) -> bool {
    !matches!(decoded, gr_text::Encoding::Utf8 | gr_text::Encoding::Latin1)
}

/// The mark is not part of the text, but the control reads it.
pub fn byte_order_mark(encoding: gr_text::Encoding, path: &Path, text: &Text, station: &Station) -> Option<Diagnostic> {
    if !is_marked(encoding) || station.lints.allow.contains(&code::TEXT_BYTE_ORDER_MARK) || exchange::is_exchange(path, text) {
        return None;
    }
    let refused = !station.undeclared(path, text) && station.setup_for(path, text).dialect.family == gr_spec::Family::Linuxcnc;
    let mut d = Diagnostic::new(code::TEXT_BYTE_ORDER_MARK, FileId(0), Span::default(), &[]);
    if refused {
        d.severity = Severity::Error;
    }
    station.lints.harden(&mut d);
    Some(d)
}

/// What can be said of a program for an unknown control: nothing is an error there.
fn syntax_only(name: &str, text: &Text, station: &Station) -> Checked {
    let mut sources = Sources::default();
    let id = sources.add(name, text);
    let file = gr_driver::scan_file(name, text, gr_spec::Dialect::linuxcnc());
    let mut found = vec![crate::sources::about_file(code::FILE_UNDECLARED_DIALECT, id, &[])];
    for (chunk, start) in file.chunks.iter().zip(&file.starts) {
        found.extend(chunk.scan.faults.iter().map(|fault| {
            let mut d = Diagnostic::new(fault.code, id, fault.span.shifted(*start), &fault.args);
            d.severity = Severity::Hint;
            d
        }));
    }
    let more = Tally { hints: found.len().saturating_sub(gr_driver::MOST_OF_A_KIND), ..Tally::default() };
    found.truncate(gr_driver::MOST_OF_A_KIND);
    found.iter_mut().for_each(|d| station.lints.harden(d));
    Checked { sources, found, more, ..Checked::nothing() }
}

/// A file that could not be read.
pub fn unreadable(name: &str, code: Code, args: &[String]) -> Checked {
    let mut sources = Sources::default();
    let file = sources.add(name, "");
    let found = vec![crate::sources::about_file(code, file, args)];
    Checked { sources, found, unreadable: true, ..Checked::nothing() }
}

fn checked(name: &str, path: &Path, text: &Text, station: &Station) -> Checked {
    let machine = station.machine.as_ref().filter(|m| station.job.is_some() || gr_robot::opinion::has_a_say(m));
    if exchange::is_exchange(path, text) {
        return match machine {
            Some(machine) => exchange::check_on(machine, name, text, path, station),
            None => exchange::check(name, text, path, station),
        };
    }
    if station.undeclared(path, text) {
        return syntax_only(name, text, station);
    }
    let mut options = Options::new(station.setup_for(path, text));
    station.lints.put_into(&mut options.rules);
    let mut checked = Checked::of(name, text, options, &station.lints);
    if let Some(machine) = machine.filter(|_| checked.found.iter().all(|d| d.severity != Severity::Error)) {
        let motion = crate::pipeline::motion_for(name, text, &station.setup_for(path, text), machine);
        crate::robot::ask(motion, machine, station.job.as_deref(), &mut checked);
    }
    checked
}

/// The files that findings point into, under the numbers that the check gave them.
fn used(once: &Once, found: &[Diagnostic]) -> Sources {
    let mut used = std::collections::BTreeSet::new();
    for d in found {
        used.extend(d.labels.iter().map(|l| l.file));
        used.extend(d.trace.iter().map(|f| f.file));
        used.extend(d.fixes.iter().flat_map(|f| f.edits.iter().map(|(file, ..)| *file)));
    }
    let mut sources = Sources::default();
    for id in 0..used.last().map_or(0, |f: &FileId| f.0 + 1) {
        let id = FileId(id);
        let text = if used.contains(&id) { once.text(id).unwrap_or_default() } else { Text::default() };
        sources.add(once.path(id).unwrap_or_default(), text);
    }
    sources
}
