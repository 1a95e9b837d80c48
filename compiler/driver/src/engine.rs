//! The interpreter as the queries use it: one chunk, or the program from a chunk on.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use gr_canon::{At, Call, CallFrame, Discard, FileId, FrameId, Mark, Sink};
use gr_gcode::{Chunk, File, Form, LineKind};
use gr_interp::{Files, Finding, Interp, Modal, Params, State, run_lines};
use gr_spec::{Severity, code};

use crate::Options;
use crate::db::{Db, Outline, Shape};
use crate::lints::{Flags, Found, From, Lints, Seen, Summary, Where, left_on};

/// State between two chunks: the interpreter's, and what lints remember.
#[derive(Clone, Debug)]
pub(crate) struct Boundary {
    state: Arc<State>,
    pub(crate) flags: Flags,
    /// The opening `%` is still to come.
    opening: bool,
    key: Box<[u8]>,
    /// What the stream has said, when it differs from the state: calls are held back, or were dropped by an error.
    seen: Option<Box<Seen>>,
}

impl Boundary {
    fn new(mut state: State, flags: Flags, opening: bool) -> Boundary {
        // The N number of the last block is of no use to the next one.
        state.modal.n_number = -1;
        let key = state.key_bytes().into();
        Boundary { state: Arc::new(state), flags, opening, key, seen: None }
    }
    /// Behind a chunk of `lines` lines.
    fn behind(mut state: State, lints: &Lints<'_>, opening: bool, lines: u32) -> Boundary {
        let seen = lints.seen();
        let seen = (seen != Lints::new(lints.rules, &state.modal, lints.flags).seen()).then(|| Box::new(seen));
        state.queue.count_lines_from(lines);
        Boundary { seen, ..Boundary::new(state, lints.flags, opening) }
    }
    /// The lints as they go on from here.
    fn lints<'a>(&self, options: &'a Options) -> Lints<'a> {
        let mut lints = Lints::new(&options.rules, &self.state.modal, self.flags);
        if let Some(seen) = &self.seen {
            lints.resume(seen);
        }
        lints
    }
    pub(crate) fn modal(&self) -> &Modal {
        &self.state.modal
    }
}

impl PartialEq for Boundary {
    fn eq(&self, other: &Boundary) -> bool {
        self.flags == other.flags
            && self.opening == other.opening
            && self.key == other.key
            && self.state.queue == other.state.queue
            && self.seen == other.seen
    }
}

impl Eq for Boundary {}

impl Hash for Boundary {
    fn hash<H: Hasher>(&self, h: &mut H) {
        // Position, feed and spindle come first in the key; a part of it tells most states apart.
        let mut hasher = rustc_hash::FxHasher::default();
        self.key.hash(&mut hasher);
        h.write_u64(hasher.finish());
        self.flags.hash(h);
    }
}

/// Parameters between two chunks.
#[derive(Clone, Debug)]
pub(crate) struct Environment {
    params: Params,
}

impl PartialEq for Environment {
    fn eq(&self, other: &Environment) -> bool {
        self.params == other.params
    }
}

impl Eq for Environment {}

impl Hash for Environment {
    fn hash<H: Hasher>(&self, h: &mut H) {
        h.write_u64(self.params.content_hash());
    }
}

/// How a program ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct End {
    /// Line of the block.
    pub(crate) line: u32,
    /// A fault stopped it.
    pub(crate) stopped: bool,
    /// It was M2 or M30.
    pub(crate) program: bool,
}

impl End {
    pub(crate) fn shifted(self, by: u32) -> End {
        End { line: self.line + by, ..self }
    }
    fn of(end: gr_interp::End, line: u32) -> Option<End> {
        Some(match end {
            gr_interp::End::Chunk => return None,
            gr_interp::End::Fault => End { line, stopped: true, program: false },
            gr_interp::End::Program => End { line, stopped: false, program: true },
            gr_interp::End::Percent => End { line, stopped: false, program: false },
        })
    }
}

/// What a chunk gave.
pub(crate) struct StepOutcome {
    pub(crate) boundary: Boundary,
    pub(crate) environment: Option<Environment>,
    pub(crate) found: Vec<Found>,
    pub(crate) summary: Summary,
    pub(crate) end: Option<End>,
    /// An M2 or M30 that did not end the program because its block has a mistake.
    pub(crate) tried: Option<End>,
    /// Parameters were touched although none were given: the step has to be done again with them.
    pub(crate) impure: bool,
}

/// Remembers which line spoke last.
struct LastLine<S> {
    inner: S,
    line: u32,
}

impl<S: Sink> Sink for LastLine<S> {
    #[inline]
    fn call(&mut self, at: &At<'_>, call: &Call) {
        self.line = at.line;
        self.inner.call(at, call);
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        self.inner.frame(id, frame);
    }
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        self.inner.mark(at, mark);
    }
    fn print(&mut self, text: &str) {
        self.inner.print(text);
    }
}

/// State before the first block of a program that begins with `%` or not.
pub(crate) fn start(options: &Options, percent: bool) -> (Boundary, Environment) {
    let text = if percent { "%\n" } else { "(x)\n" };
    let mut files = Single::new(crate::disk::file_of("", text, 1, options.setup.dialect));
    let mut interp = Interp::new(&mut files, &options.setup, Discard);
    interp.init();
    // It can't fail: the text has a line.
    let _ = interp.open(FileId(0));
    let state = interp.state();
    let params = interp.params().clone();
    (Boundary::new(state, Flags::default(), percent), Environment { params })
}

/// One file that calls nothing.
struct Single(File);

impl Single {
    fn new(file: File) -> Single {
        Single(file)
    }
}

impl Files for Single {
    fn file(&self, _id: FileId) -> &File {
        &self.0
    }
    fn find_sub(&mut self, _name: &str) -> Option<FileId> {
        None
    }
}

/// First line to run in a chunk, and whether the opening `%` is still to come after it.
fn opened(chunk: &Chunk) -> (u32, bool) {
    match chunk.scan.lines.iter().position(|l| l.kind == LineKind::Percent) {
        Some(line) => (line as u32 + 1, false),
        None => (chunk.scan.lines.len() as u32, true),
    }
}

/// Interprets a chunk that has no control flow.
pub(crate) fn step(chunk: &Chunk, entry: &Boundary, env: Option<&Environment>, options: &Options) -> StepOutcome {
    let (first, opening) = if entry.opening { opened(chunk) } else { (0, false) };
    let mut lints = LastLine { inner: entry.lints(options), line: 0 };
    let nothing = Params::default();
    let params = env.map_or(&nothing, |e| &e.params);
    let lines = first..chunk.scan.lines.len() as u32;
    let exit = run_lines(chunk, lines, &entry.state, params, &options.setup, &mut lints);
    let touched = exit.open_ended || !exit.reads.is_empty() || !exit.writes.is_empty();
    let mut found: Vec<Found> = exit.findings.iter().filter_map(|f| of_finding(f, options)).collect();
    let fault_line = exit.findings.last().map_or(0, |f| f.line);
    let line = match exit.end {
        gr_interp::End::Fault => fault_line,
        gr_interp::End::Percent => percent_line(chunk, first),
        _ => lints.line,
    };
    let boundary = Boundary::behind(exit.state, &lints.inner, opening, chunk.scan.lines.len() as u32);
    found.extend(lints.inner.found);
    found.sort_by_key(|f| f.place.line);
    StepOutcome {
        boundary,
        environment: env.filter(|_| touched).map(|_| Environment { params: exit.params }),
        found,
        summary: lints.inner.summary,
        end: End::of(exit.end, line),
        tried: {
            let at = exit.findings.iter().filter(|f| f.fault.rs.is_some()).map(|f| f.line);
            at.filter(|l| ends_program(&chunk.scan, *l)).map(|line| End { line, stopped: true, program: true }).next()
        },
        impure: env.is_none() && touched,
    }
}

/// Whether a line has M2 or M30.
fn ends_program(scan: &gr_gcode::Scan, line: u32) -> bool {
    scan.words(line).iter().any(|w| w.letter == b'm' && w.form == Form::Literal && (w.value == 2.0 || w.value == 30.0))
}

/// State around a line of a chunk without control flow.
pub(crate) fn around(chunk: &Chunk, line: u32, entry: &Boundary, env: &Environment, options: &Options) -> Option<crate::StateAt> {
    let first = if entry.opening { opened(chunk).0 } else { 0 };
    let run = |lines, state: &State, params: &Params| run_lines(chunk, lines, state, params, &options.setup, Discard);
    let before = run(first..line.max(first), &entry.state, &env.params);
    if before.end != gr_interp::End::Chunk {
        return None;
    }
    if line < first {
        return Some(crate::StateAt { before: before.state.modal, after: before.state.modal });
    }
    let after = run(line..line + 1, &before.state, &before.params);
    Some(crate::StateAt { before: before.state.modal, after: after.state.modal })
}

/// What a run of the whole file goes on with at a chunk: state, parameters, first line.
pub(crate) fn entry_of(entry: &Boundary, env: &Environment, line: u32, shift: u32) -> (State, Params, u32) {
    let mut state = (*entry.state).clone();
    // From lines of the chunk to lines of the file.
    state.queue.count_lines_from(line.wrapping_neg());
    (state, env.params.clone(), if entry.opening { line.max(shift + 1) } else { line })
}

fn percent_line(chunk: &Chunk, from: u32) -> u32 {
    let lines = chunk.scan.lines.iter().enumerate().skip(from as usize);
    lines.filter(|(_, l)| l.kind == LineKind::Percent).map(|(i, _)| i as u32).next().unwrap_or(0)
}

fn of_finding(f: &Finding, options: &Options) -> Option<Found> {
    let code = f.fault.code;
    let severity = match options.rules.severity(code) {
        None if !code.def().lint => code.def().severity,
        severity => severity?,
    };
    Some(Found {
        code,
        severity,
        place: Where { file: f.file, line: f.line, frame: f.frame },
        letter: f.fault.letter,
        span: f.span,
        args: f.fault.message_args().to_vec(),
        from: if f.fault.rs.is_some() { From::Fault } else { From::Doubt },
    })
}

/// What the rest of a program from its first control flow on gave.
pub(crate) struct FlowOutcome {
    pub(crate) boundary: Boundary,
    pub(crate) found: Vec<Found>,
    pub(crate) frames: Vec<(FrameId, CallFrame)>,
    pub(crate) summary: Summary,
    pub(crate) end: Option<End>,
}

/// Where a run with control flow begins.
pub(crate) struct Stretch<'a> {
    pub(crate) db: &'a dyn Db,
    pub(crate) main: FileId,
    pub(crate) file: Arc<File>,
    /// First line.
    pub(crate) line: u32,
    /// Line of the opening `%`, 0 without one.
    pub(crate) shift: u32,
    pub(crate) entry: &'a Boundary,
    pub(crate) env: &'a Environment,
    pub(crate) options: &'a Options,
}

/// The files a run may need: the main one, and others as they are called.
pub(crate) struct Library<'a> {
    db: &'a dyn Db,
    options: &'a Options,
    main: FileId,
    file: Arc<File>,
    found: Vec<(FileId, Arc<File>)>,
    empty: File,
}

impl<'a> Library<'a> {
    pub(crate) fn new(db: &'a dyn Db, options: &'a Options, main: FileId, file: Arc<File>) -> Library<'a> {
        Library { db, options, main, file, found: Vec::new(), empty: File::default() }
    }
}

impl Files for Library<'_> {
    fn file(&self, id: FileId) -> &File {
        if id == self.main {
            return &self.file;
        }
        self.found.iter().find(|(i, _)| *i == id).map_or(&self.empty, |(_, f)| f)
    }
    fn find_sub(&mut self, name: &str) -> Option<FileId> {
        let candidates = gr_interp::subroutine_paths(&self.options.setup, name);
        let (id, file) = self.db.disk().find(&candidates, self.options.setup.dialect)?;
        if id != self.main && !self.found.iter().any(|(i, _)| *i == id) {
            self.found.push((id, file));
        }
        Some(id)
    }
}

/// Keeps the call tree, and gives way when the work is cancelled.
struct Watch<'a, S> {
    inner: S,
    db: &'a dyn Db,
    frames: Vec<(FrameId, CallFrame)>,
    calls: u32,
}

/// Frames that are kept: enough for every finding that is shown.
const MOST_FRAMES: usize = 100_000;

impl<S: Sink> Sink for Watch<'_, S> {
    #[inline]
    fn call(&mut self, at: &At<'_>, call: &Call) {
        self.calls += 1;
        if self.calls % 4096 == 0 {
            self.db.unwind_if_revision_cancelled();
        }
        self.inner.call(at, call);
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        if self.frames.len() < MOST_FRAMES {
            self.frames.push((id, frame.clone()));
        }
    }
}

/// Runs the program from the start of a chunk to its end.
pub(crate) fn flow(stretch: &Stretch<'_>) -> FlowOutcome {
    let Stretch { db, main, file, line, shift, entry, env, options } = stretch;
    let mut library = Library::new(*db, options, *main, file.clone());
    let lints = entry.lints(options);
    let watch = Watch { inner: LastLine { inner: lints, line: 0 }, db: *db, frames: Vec::new(), calls: 0 };
    let mut state = (*entry.state).clone();
    // From lines of the chunk to lines of the file.
    state.queue.count_lines_from(line.wrapping_neg());
    let state = (state, env.params.clone());
    let from = if entry.opening { (*line).max(shift + 1) } else { *line };
    let mut interp = Interp::resume(&mut library, &options.setup, watch, state, *main, (from, *shift as i32));
    let why = interp.run_open();
    let state = interp.state();
    let mut findings = interp.finish(why).findings;
    let Watch { inner: LastLine { inner: lints, line: last_line }, frames, .. } = interp.into_sink();
    let early = findings.iter().any(|f| f.fault.code == code::PROGRAM_ENDS_EARLY);
    // Whether that is a mistake depends on the dialect and on what the file is: see `finish`.
    findings.retain(|f| f.fault.code != code::PROGRAM_ENDS_EARLY);
    let fault_line = findings.iter().rev().find(|f| f.fault.rs.is_some() && f.file == *main).map_or(last_line, |f| f.line);
    let mut end = match why {
        gr_interp::End::Fault if early => None,
        gr_interp::End::Fault => End::of(why, fault_line),
        gr_interp::End::Percent => End::of(why, percent_after(file, from)),
        _ => End::of(why, last_line),
    };
    if let Some(end) = end.filter(|e| !e.stopped) {
        // What stands behind the end is not looked at.
        findings.retain(|f| f.fault.code != code::FLOW_UNCLOSED || f.file != *main || f.line <= end.line);
    }
    drop_consequences(&mut findings, file, *line, *main);
    let mut found: Vec<Found> = findings.iter().filter_map(|f| of_finding(f, options)).collect();
    let unreached = if early { unreached_end(file, &findings, *main) } else { None };
    if let Some(line) = unreached {
        // The end is there: what keeps the controller from it is the mistake.
        end = Some(End { line, stopped: true, program: true });
    }
    if early {
        let last = ends(file).last();
        let before_end = |f: &&mut Found| f.code == code::FLOW_UNCLOSED && f.place.file == *main && last.is_some_and(|l| f.place.line < l);
        found.iter_mut().filter(before_end).for_each(|f| f.severity = Severity::Error);
    }
    found.extend(lints.found);
    FlowOutcome { boundary: Boundary::new(state, lints.flags, false), found, frames, summary: lints.summary, end }
}

/// An error makes the controller forget all labels: that the rest of a loop or branch is then without its beginning
/// is the same mistake once more.
fn drop_consequences(findings: &mut Vec<Finding>, file: &File, from: u32, main: FileId) {
    let controls = file.chunks.iter().zip(&file.first_lines).find_map(|(chunk, first)| {
        let scan = &chunk.scan;
        let line = (0..scan.lines.len() as u32).find(|l| scan.words(*l).iter().any(|w| w.form == Form::Control))?;
        (first + line >= from).then_some(first + line)
    });
    let first_control = controls.unwrap_or(0);
    let mut after_error = false;
    findings.retain(|f| {
        let consequence = f.fault.code == code::FLOW_LABEL || f.fault.code == code::FLOW_UNCLOSED;
        let keep = !(after_error && consequence);
        after_error |= f.fault.rs.is_some() && (f.file != main || f.line >= first_control);
        keep
    });
}

/// Line of an M2 or M30 that could not end the program: something before it is not closed, or that block itself
/// has a mistake.
fn unreached_end(file: &File, findings: &[Finding], main: FileId) -> Option<u32> {
    let explains = |f: &Finding, line: u32| {
        f.file == main && if f.fault.code == code::FLOW_UNCLOSED { f.line < line } else { f.fault.rs.is_some() && f.line == line }
    };
    ends(file).find(|line| findings.iter().any(|f| explains(f, *line)))
}

/// Lines with M2 or M30.
fn ends(file: &File) -> impl Iterator<Item = u32> {
    file.chunks.iter().zip(&file.first_lines).flat_map(|(chunk, first)| {
        let scan = &chunk.scan;
        (0..scan.lines.len() as u32).filter(move |l| ends_program(scan, *l)).map(move |l| first + l)
    })
}

/// Line of the closing `%`.
fn percent_after(file: &File, from: u32) -> u32 {
    let mut first = 0;
    for chunk in &file.chunks {
        for (l, line) in chunk.scan.lines.iter().enumerate() {
            if line.kind == LineKind::Percent && first + l as u32 >= from {
                return first + l as u32;
            }
        }
        first += chunk.scan.lines.len() as u32;
    }
    first.saturating_sub(1)
}

/// What is known when every chunk was looked at.
pub(crate) struct Finish<'a> {
    pub(crate) shapes: &'a [&'a Shape],
    pub(crate) starts: &'a [(u32, u32)],
    pub(crate) options: &'a Options,
    pub(crate) modal: &'a Modal,
    pub(crate) end: Option<End>,
}

/// What can be said only about a whole file: its end, and its labels.
pub(crate) fn finish(context: &Finish<'_>) -> Vec<Found> {
    let mut found = Vec::new();
    let rules = &context.options.rules;
    let last_line = context.starts.last().map_or(0, |s| s.0).saturating_sub(1);
    match context.end {
        Some(end) if !end.stopped && !end.program => {
            found.extend(left_on(context.modal, place(end.line), rules));
        }
        Some(_) => {}
        None => {
            found.extend(left_on(context.modal, place(last_line), rules));
            found.extend(no_end(context, last_line));
        }
    }
    crate::lints::labels(context.shapes, context.starts, context.options, &mut found);
    found
}

fn place(line: u32) -> Where {
    Where { file: FileId::default(), line, frame: FrameId::MAIN }
}

/// The file ended without M2, M30 or `%`.
fn no_end(context: &Finish<'_>, line: u32) -> Option<Found> {
    let strict = context.options.setup.dialect.needs_end && !only_subs(context.shapes);
    let code = if strict { code::PROGRAM_ENDS_EARLY } else { code::PROGRAM_END_MISSING };
    let severity = match context.options.rules.severity(code) {
        None if strict => code.def().severity,
        severity => severity?,
    };
    Some(Found { code, severity, place: place(line), letter: None, span: None, args: Vec::new(), from: From::Lint })
}

/// A file of subroutines: it begins with one.
fn only_subs(shapes: &[&Shape]) -> bool {
    shapes.iter().flat_map(|s| s.outline.iter()).next() == Some(&Outline::Sub)
}
