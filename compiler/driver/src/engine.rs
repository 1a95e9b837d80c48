//! The interpreter as the queries use it: one chunk, or the program from a chunk on.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use gr_canon::{At, Call, CallFrame, Discard, FileId, FrameId, Mark, Sink};
use gr_gcode::{Chunk, File, Form, LineKind};
use gr_interp::{Files, Finding, Interp, Modal, Params, State, run_lines};
use gr_spec::code;

use crate::Options;
use crate::carried::{Carried, Home};
use crate::db::{ChunkText, Db, Document, shape};
use crate::layout::{Layout, Starts, first_percent};
use crate::library::{Came, Library};
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
            && (Arc::ptr_eq(&self.state, &other.state) || self.state.same_tools(&other.state))
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

impl Environment {
    /// The same without some parameters.
    pub(crate) fn without(&self, parameters: &[gr_gcode::Parameter]) -> Environment {
        let mut params = self.params.clone();
        parameters.iter().for_each(|p| params.forget(p));
        Environment { params }
    }
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
    fn give_way(&mut self) {
        self.inner.give_way();
    }
}

/// State before the first block of a program that begins with `%` or not.
pub(crate) fn start(options: &Options, percent: bool) -> (Boundary, Environment) {
    let text = if percent { "%\n" } else { "(x)\n" };
    let mut files = Single::new(crate::disk::file_of("", &text.into(), 1, options.setup.dialect));
    let mut interp = Interp::new(&mut files, &options.setup, Discard);
    interp.init();
    // It can't fail: the text has a line.
    let _ = interp.open(FileId(0));
    let state = interp.state();
    let params = interp.params().clone();
    (Boundary::new(state, Flags::at_start(&options.setup), percent), Environment { params })
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
        impure: env.is_none() && touched,
    }
}

/// Whether a block has M2 or M30.
pub(crate) fn ends_program(words: &[gr_gcode::Word]) -> bool {
    words.iter().any(|w| w.letter == b'm' && w.form == Form::Literal && (w.value == 2.0 || w.value == 30.0))
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

fn percent_line(chunk: &Chunk, from: u32) -> u32 {
    let lines = chunk.scan.lines.iter().enumerate().skip(from as usize);
    lines.filter(|(_, l)| l.kind == LineKind::Percent).map(|(i, _)| i as u32).next().unwrap_or(0)
}

pub(crate) fn of_finding(f: &Finding, options: &Options) -> Option<Found> {
    let code = f.fault.code;
    let severity = match options.rules.severity(code) {
        // What the controller refuses is an error, whatever its row says of its milder form.
        _ if f.fault.rs.is_some() => gr_text::Severity::Error,
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

/// What a stretch with control flow gave. Lines are those of the file when it was run.
pub(crate) struct FlowOutcome {
    pub(crate) boundary: Boundary,
    pub(crate) environment: Environment,
    pub(crate) carried: Carried,
    /// The first line behind it; none = the program ended.
    pub(crate) next: Option<u32>,
    /// The chunks that execution came to.
    pub(crate) came: Box<[Came]>,
    pub(crate) found: Vec<Found>,
    pub(crate) frames: Vec<(FrameId, CallFrame)>,
    pub(crate) summary: Summary,
    pub(crate) end: Option<End>,
    /// What is opened and never closed in the other files that were opened.
    pub(crate) unclosed: Vec<(FileId, Vec<Found>)>,
}

/// Where a run with control flow begins: at a line of the main program, outside of calls and loops.
#[derive(Clone, Copy)]
pub(crate) struct Stretch<'a> {
    pub(crate) db: &'a dyn Db,
    pub(crate) document: Document,
    /// It begins with this chunk.
    pub(crate) chunk: ChunkText,
    pub(crate) entry: &'a Boundary,
    pub(crate) env: &'a Environment,
    pub(crate) carried: &'a Carried,
}

impl<'a> Stretch<'a> {
    /// Where a line of the main file is, as labels are remembered.
    fn place_of(&self, starts: &Starts, line: u32) -> Option<Home> {
        let (chunk, first) = starts.holding(line)?;
        let statements = &shape(self.db, chunk, self.document.run(self.db)).statements;
        let statement = statements.binary_search_by_key(&(line - first), |s| s.line).ok();
        Some(statement.map_or(Home::Line(chunk, line - first), |n| Home::Statement(chunk, n as u32)))
    }
    /// The files it may need.
    pub(crate) fn library(&self) -> Library<'a> {
        let starts = self.db.present().get(self.document.id(self.db));
        Library::knowing(self.db, self.document, starts, self.chunk, self.carried)
    }
    /// State before it.
    pub(crate) fn modal(&self) -> &'a Modal {
        self.entry.modal()
    }
    /// A run from there on.
    pub(crate) fn resume<'b, S: Sink>(&self, library: &'b mut Library<'a>, sink: S) -> Interp<'b, S>
    where
        'a: 'b,
    {
        let main = FileId(self.document.id(self.db));
        let percent = self.entry.modal().percent != 0;
        let shift = if percent { first_percent(self.db, self.document).unwrap_or(0) } else { 0 };
        let line = library.starts().of(self.chunk).unwrap_or(0);
        let mut state = (*self.entry.state).clone();
        // From lines of the chunk to lines of the file.
        state.queue.count_lines_from(line.wrapping_neg());
        state.queue.move_to(main);
        let from = if self.entry.opening { line.max(shift + 1) } else { line };
        let setup = &self.document.run(self.db).options(self.db).setup;
        let before = (state, self.env.params.clone(), &self.carried.carry);
        Interp::carry_on(library, setup, sink, before, main, (from, shift as i32))
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
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        self.inner.mark(at, mark);
    }
    fn give_way(&mut self) {
        self.db.unwind_if_revision_cancelled();
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        if self.frames.len() < MOST_FRAMES {
            self.frames.push((id, frame.clone()));
        }
    }
}

/// Runs the program on until it is outside of calls and loops at the start of a chunk again, or to its end.
pub(crate) fn flow(stretch: &Stretch<'_>) -> FlowOutcome {
    let Stretch { db, document, chunk, entry, .. } = *stretch;
    let options: &Options = document.run(db).options(db);
    let main = FileId(document.id(db));
    let mut library = stretch.library();
    let starts = library.starts().clone();
    let line = starts.of(chunk).unwrap_or(0);
    let watch = Watch { inner: entry.lints(options), db, frames: Vec::new(), calls: 0 };
    let mut interp = stretch.resume(&mut library, watch);
    // Behind a chunk that was run, or at the start of one that was: nothing that salsa need know.
    let why = interp.run_until(&|l| l > line && starts.begins(l));
    let next = if why.is_none() { Some(interp.next_line()) } else { None };
    let (mut state, environment) = (interp.state(), Environment { params: interp.params().clone() });
    let carried = stretch.carried.after(interp.carry(), interp.met(), main, &|line| stretch.place_of(&starts, line));
    let main_line = interp.main_line();
    let mut findings = interp.take_findings();
    let others: Vec<FileId> = interp.opened_files().iter().copied().filter(|f| *f != main).collect();
    let of_findings = |findings: &[Finding]| findings.iter().filter_map(|f| of_finding(f, options)).collect::<Vec<Found>>();
    let unclosed = others.iter().map(|id| (*id, of_findings(&interp.unclosed_of(*id)))).collect();
    let Watch { inner: lints, frames, .. } = interp.into_sink();
    // Whether the end of the file is a mistake depends on the dialect and on what the file is: see `finish`.
    let early = why == Some(gr_interp::End::Fault) && findings.pop_if(|f| f.fault.code == code::PROGRAM_ENDS_EARLY).is_some();
    let fault_line = findings.last().filter(|f| f.file == main).map_or(main_line, |f| f.line);
    let end = match why {
        None => None,
        Some(gr_interp::End::Fault) if early => None,
        Some(gr_interp::End::Fault) => End::of(gr_interp::End::Fault, fault_line),
        Some(why) => End::of(why, main_line),
    };
    let mut found = of_findings(&findings);
    state.queue.move_to(FileId::default());
    let boundary = Boundary::behind(state, &lints, false, next.unwrap_or(0));
    found.extend(lints.found);
    let frames = needed(frames, &found);
    let summary = lints.summary;
    let came = library.came_to();
    FlowOutcome { boundary, environment, carried, next, came, found, frames, summary, end, unclosed }
}

/// The frames that findings were made in, and those around them.
fn needed(frames: Vec<(FrameId, CallFrame)>, found: &[Found]) -> Vec<(FrameId, CallFrame)> {
    let mut wanted: std::collections::BTreeSet<FrameId> = found.iter().map(|f| f.place.frame).collect();
    // A frame comes after the one around it.
    let mut kept: Vec<_> = frames
        .into_iter()
        .rev()
        .filter(|(id, frame)| {
            let keep = wanted.contains(id);
            if keep {
                wanted.insert(frame.parent);
            }
            keep
        })
        .collect();
    kept.reverse();
    kept
}

/// What is known when every chunk was looked at.
pub(crate) struct Finish<'a> {
    pub(crate) layout: &'a Layout,
    pub(crate) main: FileId,
    pub(crate) options: &'a Options,
    pub(crate) modal: &'a Modal,
    pub(crate) end: Option<End>,
}

/// What can be said only about a whole file: its end, and its labels.
pub(crate) fn finish(context: &Finish<'_>) -> Vec<Found> {
    let mut found = Vec::new();
    let Finish { layout, main, options, modal, end } = context;
    let place = |line| Where { file: *main, line, frame: FrameId::MAIN };
    let last_line = layout.starts.last().map_or(0, |lines| lines.saturating_sub(1));
    match end {
        Some(end) if !end.stopped && !end.program => found.extend(left_on(modal, place(end.line), &options.rules)),
        Some(_) => {}
        None => {
            found.extend(left_on(modal, place(last_line), &options.rules));
            // A file of a subroutine that others call needs none.
            if !(layout.only_subs && layout.own_sub) {
                found.extend(no_end(options, layout.only_subs, place(last_line)));
            }
        }
    }
    found.extend(layout.labels.iter().cloned());
    if let Some(line) = layout.lone_return.filter(|_| joins_lines(options.setup.dialect))
        && let Some(severity) = options.rules.severity(code::TEXT_LONE_RETURN)
    {
        let (code, place) = (code::TEXT_LONE_RETURN, place(line));
        found.push(Found { code, severity, place, letter: None, span: None, args: Vec::new(), from: From::Lint });
    }
    found
}

/// Whether the control reads on over a carriage return alone.
pub(crate) fn joins_lines(dialect: &gr_spec::Dialect) -> bool {
    dialect.family == gr_spec::Family::Linuxcnc
}

/// The file ended without M2, M30 or `%`: what is only a library of subroutines need not be whole.
fn no_end(options: &Options, only_subs: bool, place: Where) -> Option<Found> {
    let strict = options.setup.dialect.needs_end && !only_subs;
    let code = if strict { code::PROGRAM_ENDS_EARLY } else { code::PROGRAM_END_MISSING };
    let severity = match options.rules.severity(code) {
        None if strict => code.def().severity,
        severity => severity?,
    };
    Some(Found { code, severity, place, letter: None, span: None, args: Vec::new(), from: From::Lint })
}
