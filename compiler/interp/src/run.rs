//! The run: reading line after line, the two streams out, errors, limits.

use std::sync::Arc;

use gr_canon::{At, Call, CallFrame, FileId, FrameId, Mark, Sink};
use gr_gcode::{Chunk, File, LineKind, Scan, Word};
use gr_spec::{Rs274, code, rs274};
use gr_text::Span;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::block::Block;
use crate::control::{CallKind, FileIndex, Label, Level, Loop, Offset, Skip, Symbols};
use crate::io::Comment;
use crate::queue::Queue;
use crate::remap::{Config, Remapped};
use crate::state::State;
use crate::world::World;
use crate::{Fault, Modal, Params, Res, Setup, ToolTable};

/// Where the interpreter gets files from.
pub trait Files {
    /// A file that was given out before.
    fn file(&self, id: FileId) -> &File;
    /// The file of an external subroutine, found along [`crate::subroutine_paths`].
    fn find_sub(&mut self, name: &str) -> Option<FileId>;
    /// The chunk that holds a line, the line's number in it, and the number of its first line. A program without
    /// control flow is read through this alone, so that it need not be in memory as a whole.
    fn chunk(&self, id: FileId, line: u32) -> Option<(Chunk, u32, u32)> {
        let file = self.file(id);
        let (c, l) = file.locate(line)?;
        Some((file.chunks[c].clone(), l, file.first_lines[c]))
    }
    /// The first line from `line` on that skipping must look at ([`is_stop`]), when it is known without the whole
    /// file; `u32::MAX` past the last one.
    fn next_control(&self, _id: FileId, _line: u32) -> Option<u32> {
        None
    }
    /// Nothing read of this file so far holds control flow or damage.
    fn is_plain(&self, _id: FileId) -> bool {
        false
    }
}

/// No files at all: for a chunk without calls, and for single lines.
#[derive(Default)]
pub struct NoFiles(File);

impl Files for NoFiles {
    fn file(&self, _id: FileId) -> &File {
        &self.0
    }
    fn find_sub(&mut self, _name: &str) -> Option<FileId> {
        None
    }
}

/// Where a call comes from.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Place {
    /// File.
    pub file: FileId,
    /// Line from 0.
    pub line: u32,
    /// How execution came there.
    pub frame: FrameId,
}

/// A fault or doubt, with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// File.
    pub file: FileId,
    /// Line from 0; relative to the chunk when a chunk was run alone.
    pub line: u32,
    /// How execution came there.
    pub frame: FrameId,
    /// What.
    pub fault: Box<Fault>,
    /// The narrowest place known, relative to the start of the line.
    pub span: Option<Span>,
    /// Text of the line that the controller read last, as the real `rs274` shows it.
    pub text: Box<str>,
}

/// Why a run ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// M2, M30, or M99 of the main program.
    Program,
    /// A closing `%`.
    Percent,
    /// A fault stopped it.
    Fault,
    /// The chunk's last line.
    Chunk,
}

/// What came of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Why it ended.
    pub end: End,
    /// Faults and doubts in the order they were met.
    pub findings: Vec<Finding>,
    /// Damaged lines of the files read that were never executed.
    pub damaged: Vec<(FileId, u32)>,
    /// Blocks executed.
    pub blocks: u64,
    /// Canonical calls.
    pub calls: u64,
    /// Files that were opened, in order.
    pub files: Vec<FileId>,
}

impl Outcome {
    /// Whether the controller would have accepted the program.
    pub fn ok(&self) -> bool {
        self.end != End::Fault && self.findings.iter().all(|f| f.fault.rs.is_none())
    }
}

/// What running one chunk gave.
#[derive(Clone, Debug)]
pub struct ChunkExit {
    /// State after it.
    pub state: State,
    /// Parameters after it.
    pub params: Params,
    /// Numbered parameters that it read, with the values they had.
    pub reads: Vec<(u32, f64)>,
    /// Numbered parameters that it set, in order.
    pub writes: Vec<(u32, f64)>,
    /// It read or set named parameters, or did something else that the state does not hold.
    pub open_ended: bool,
    /// Faults and doubts.
    pub findings: Vec<Finding>,
    /// How it ended.
    pub end: End,
    /// Blocks executed.
    pub blocks: u64,
    /// Canonical calls.
    pub calls: u64,
}

/// Which parameters were read and written.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    reads: Vec<(u32, f64)>,
    read: FxHashSet<u32>,
    written: FxHashSet<u32>,
    writes: Vec<(u32, f64)>,
    pub named: bool,
    before: Params,
}

impl Log {
    pub fn read(&mut self, index: u32) {
        if !self.written.contains(&index) && self.read.insert(index) {
            self.reads.push((index, self.before.get(index)));
        }
    }
    pub fn write(&mut self, index: u32, value: f64) {
        self.written.insert(index);
        self.writes.push((index, value));
    }
}

/// The line read last; its text is what `At::now` shows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reading {
    pub text: Arc<str>,
    pub scan: Arc<Scan>,
    pub line: u32,
    /// First byte of the line, for places in it.
    pub begin: u32,
    /// The text that `At::now` shows; usually the line.
    pub start: u32,
    pub end: u32,
}

/// What comes after the present line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Flow {
    Next,
    Jump,
    End(End),
}

/// Files the run has opened.
#[derive(Default)]
pub(crate) struct Opened {
    pub order: Vec<FileId>,
    pub index: FxHashMap<FileId, Arc<FileIndex>>,
    /// Damaged lines that were executed.
    pub damaged_met: FxHashSet<(FileId, u32)>,
}

/// A run of the interpreter.
pub struct Interp<'a, S: Sink> {
    pub(crate) m: Modal,
    pub(crate) block: Block,
    pub(crate) queue: Queue,
    pub(crate) setup: &'a Setup,
    pub(crate) params: Params,
    pub(crate) sink: S,
    pub(crate) tools: Arc<ToolTable>,
    pub(crate) world: World,
    /// The machine's own table; the interpreter's follows after a tool change.
    pub(crate) world_tools: Arc<ToolTable>,
    pub(crate) config: Arc<Config>,
    pub(crate) place: Place,
    pub(crate) reading: Reading,
    pub(crate) files: &'a mut dyn Files,
    pub(crate) opened: Opened,
    // What a block reads besides words.
    pub(crate) comment: Option<Comment>,
    pub(crate) settings: Vec<(crate::read::Slot, f64)>,
    // Control flow.
    pub(crate) next: u32,
    pub(crate) shift: i32,
    pub(crate) flow: Flow,
    pub(crate) symbols: Symbols,
    pub(crate) skip: Option<Skip>,
    pub(crate) defining_sub: bool,
    pub(crate) sub_name: Option<u32>,
    /// The main program goes on behind a call: the controller then lets a stray `return` pass.
    pub(crate) came_back: bool,
    /// An error inside a call was met: no call counts as come back from any more.
    pub(crate) main_unnamed: bool,
    pub(crate) executed_if: bool,
    pub(crate) doing_break: bool,
    pub(crate) doing_continue: bool,
    pub(crate) test_value: f64,
    pub(crate) return_value: f64,
    pub(crate) value_returned: bool,
    pub(crate) offsets: FxHashMap<Label, Offset>,
    pub(crate) levels: Vec<Level>,
    pub(crate) loops: Vec<Loop>,
    pub(crate) remaps: Vec<Remapped>,
    pub(crate) m98: bool,
    /// A contour is being read: U and W are words there on every machine.
    pub(crate) in_contour: bool,
    // Totals.
    pub(crate) frames: u32,
    pub(crate) blocks: u64,
    pub(crate) emitted: u64,
    /// `emitted` before the block.
    pub(crate) begun: u64,
    /// Totals when the main program last came on by itself: budgets count from there.
    pub(crate) spent: (u64, u64),
    /// Control flow of the main program was met on lines before this one only.
    pub(crate) frontier: u32,
    pub(crate) findings: Vec<Finding>,
    pub(crate) log: Option<Box<Log>>,
}

impl<'a, S: Sink> Interp<'a, S> {
    /// A run that has not begun.
    pub fn new(files: &'a mut dyn Files, setup: &'a Setup, sink: S) -> Self {
        let state = State::start(setup);
        let mut params = Params::default();
        for (index, value) in &setup.params {
            params.set(*index, *value);
        }
        let tools = Arc::new(setup.tools.clone());
        Self::with(files, setup, sink, state, params, tools)
    }

    /// A run that goes on at a line of the main program, outside of subroutines and loops. `shift` is the line of
    /// the opening `%`, 0 without one.
    pub fn resume(
        files: &'a mut dyn Files,
        setup: &'a Setup,
        sink: S,
        (state, params): (State, Params),
        main: FileId,
        (line, shift): (u32, i32),
    ) -> Self {
        let tools = Arc::new(setup.tools.clone());
        let mut run = Self::with(files, setup, sink, state, params, tools);
        run.place = Place { file: main, line, frame: FrameId::MAIN };
        run.note_file(main);
        (run.next, run.shift, run.frontier) = (line, shift, line);
        run
    }

    fn with(
        files: &'a mut dyn Files,
        setup: &'a Setup,
        sink: S,
        state: State,
        params: Params,
        tools: Arc<ToolTable>,
    ) -> Self {
        let State { modal, queue, world, saved, tools: own, world_tools } = state;
        let mut main = Level::new(0);
        main.saved_valid = saved.is_some();
        main.saved = saved;
        Interp {
            m: modal,
            block: Block::default(),
            queue,
            setup,
            params,
            sink,
            tools: own.unwrap_or_else(|| tools.clone()),
            world,
            world_tools: world_tools.unwrap_or(tools),
            config: Arc::new(Config::new(setup)),
            place: Place::default(),
            reading: Reading::default(),
            files,
            opened: Opened::default(),
            comment: None,
            settings: Vec::new(),
            next: 0,
            shift: 0,
            flow: Flow::Next,
            symbols: Symbols::default(),
            skip: None,
            defining_sub: false,
            sub_name: None,
            came_back: false,
            main_unnamed: false,
            executed_if: false,
            doing_break: false,
            doing_continue: false,
            test_value: 0.0,
            return_value: 0.0,
            value_returned: false,
            offsets: FxHashMap::default(),
            levels: vec![main],
            loops: Vec::new(),
            remaps: Vec::new(),
            m98: false,
            in_contour: false,
            frames: 0,
            blocks: 0,
            emitted: 0,
            begun: 0,
            spent: (0, 0),
            frontier: 0,
            findings: Vec::new(),
            log: None,
        }
    }

    /// Call depth: 0 in the main program.
    pub(crate) fn level(&self) -> usize {
        self.levels.len() - 1
    }

    /// The controller's line number: from 1, the line being executed.
    pub(crate) fn sequence(&self) -> i32 {
        self.next as i32 - self.shift
    }

    /// Sends a call of the current block.
    #[inline]
    pub(crate) fn emit(&mut self, call: Call) {
        self.emit_at(self.place, &call);
    }
    /// Sends a call that an earlier block asked for.
    #[inline]
    pub(crate) fn emit_at(&mut self, place: Place, call: &Call) {
        self.emitted += 1;
        self.world.hear(call);
        let now = &self.reading.text.as_bytes()[self.reading.start as usize..self.reading.end as usize];
        self.sink.call(&At { file: place.file, line: place.line, frame: place.frame, now }, call);
    }
    /// Sends a call, behind the moves that cutter compensation still holds back.
    pub(crate) fn emit_queued(&mut self, call: Call) {
        if self.queue.is_empty() { self.emit(call) } else { self.queue.push(call, self.place) }
    }
    /// Marks the stream.
    pub(crate) fn mark(&mut self, mark: &Mark) {
        let now = &self.reading.text.as_bytes()[self.reading.start as usize..self.reading.end as usize];
        let p = self.place;
        self.sink.mark(&At { file: p.file, line: p.line, frame: p.frame, now }, mark);
    }
    /// A remark of the interpreter itself, which `rs274` prints.
    pub(crate) fn remark(&mut self, text: &str) {
        self.emit_queued(Call::Comment(text.into()));
    }
    /// A new node of the call tree becomes current.
    pub(crate) fn enter_frame(&mut self, name: &str, parent: FrameId, pass: u32) {
        self.frames += 1;
        let id = FrameId(self.frames);
        let frame = CallFrame { parent, file: self.place.file, line: self.place.line, name: name.into(), pass };
        self.sink.frame(id, &frame);
        self.place.frame = id;
    }

    /// Runs a program from its first line: prologue, all blocks, epilogue.
    pub fn run(&mut self, main: FileId) -> Outcome {
        self.init();
        let end = match self.open(main) {
            Ok(()) => self.run_open(),
            Err(fault) => {
                self.found(fault);
                return self.outcome(End::Fault);
            }
        };
        // Closing the file and leaving both reset the controller.
        self.reset();
        self.reset();
        self.outcome(end)
    }

    /// What the controller says before it opens a program.
    pub fn init(&mut self) {
        self.start_modal();
        self.emit(Call::UseLengthUnits(self.m.units()));
        self.emit(Call::SetG5xOffset(self.m.origin_index as u8, self.m.origin));
        self.emit(Call::SetG92Offset(self.m.g92));
        self.emit(Call::SetXyRotation(self.m.rotation));
        self.emit(Call::SetFeedReferenceXyz);
        self.fanuc_power_up();
        self.run_startup();
    }

    /// Runs [RS274NGC]RS274NGC_STARTUP_CODE.
    fn run_startup(&mut self) {
        let Some(code) = self.setup.ini.get("rs274ngc", "rs274ngc_startup_code").filter(|_| self.setup.startup_code) else {
            return;
        };
        let text = format!("{}\n", code.trim());
        let scan = Arc::new(gr_gcode::scan(&text, self.setup.dialect));
        let _ = self.mdi(&Chunk { text: text.into(), scan });
        self.reading = Reading::default();
        self.flow = Flow::Next;
    }

    /// Opens the main program: the file's first line decides about `%`.
    pub fn open(&mut self, main: FileId) -> Res {
        self.place = Place { file: main, line: 0, frame: FrameId::MAIN };
        self.note_file(main);
        let mut line = 0;
        let mut kind = None;
        while let Some((chunk, l, first)) = self.files.chunk(main, line) {
            let scan = &chunk.scan;
            let lines = l..scan.lines.len() as u32;
            let text = |l| chunk.text[scan.line_span(&chunk.text, l).range()].trim();
            let found = lines.into_iter().find(|l| !text(*l).is_empty());
            if let Some(fault) = found.and_then(|l| self.too_long(scan, l)) {
                // The controller can't even open it.
                self.place.line = first + found.unwrap_or(l);
                self.read_alone(&chunk, found.unwrap_or(l));
                return Err(fault);
            }
            if let Some(l) = found {
                kind = Some(scan.lines[l as usize].kind);
                line = first + l;
                break;
            }
            line = first + scan.lines.len() as u32;
        }
        match kind {
            None => return Err(Fault::new(code::PROGRAM_ENDS_EARLY, rs274::RT_NO_PERCENT)),
            Some(LineKind::Percent) => {
                self.m.percent = 1;
                self.next = line + 1;
                self.shift = line as i32;
            }
            Some(_) => {
                self.m.percent = 0;
                self.next = 0;
                self.shift = 0;
            }
        }
        self.reset();
        Ok(())
    }

    fn too_long(&self, scan: &Scan, line: u32) -> Option<Box<Fault>> {
        scan.faults_of(line).iter().find(|f| f.rs == rs274::COMMAND_TOO_LONG).map(convert_fault)
    }

    /// A line that is not executed becomes the line read last.
    fn read_alone(&mut self, chunk: &Chunk, line: u32) {
        let span = chunk.scan.line_span(&chunk.text, line);
        (self.reading.text, self.reading.scan) = (chunk.text.clone(), chunk.scan.clone());
        (self.reading.line, self.reading.begin) = (line, span.start);
        (self.reading.start, self.reading.end) = (span.start, span.end);
    }

    /// Resets the controller as it does when a file is opened or closed.
    pub fn reset(&mut self) {
        self.reading.end = self.reading.start;
        self.emit(Call::OnReset);
        self.unwind();
    }

    pub(crate) fn note_file(&mut self, file: FileId) {
        if !self.opened.order.contains(&file) {
            self.opened.order.push(file);
        }
    }

    /// Runs from the present line to the end.
    pub fn run_open(&mut self) -> End {
        loop {
            let end = self.run_piece(u64::MAX);
            if let Some(end) = end {
                return end;
            }
        }
    }

    /// Reads and executes the next block. `None`: there is more.
    pub fn step_block(&mut self) -> Option<End> {
        self.run_piece(1)
    }

    /// Runs to the end of a chunk or to a jump.
    pub(crate) fn run_open_piece(&mut self) -> Option<End> {
        self.run_piece(u64::MAX)
    }

    fn load(&self, file: FileId, line: u32) -> Option<(Chunk, u32, u32)> {
        self.files.chunk(file, line)
    }

    /// Runs at most `limit` lines of the chunk that holds the next line.
    fn run_piece(&mut self, limit: u64) -> Option<End> {
        let from = match &self.skip {
            Some(_) => self.next_control(self.next),
            None => self.next,
        };
        let Some((chunk, mut line, first)) = self.load(self.place.file, from) else {
            return self.end_of_file();
        };
        self.reading.text = chunk.text.clone();
        self.reading.scan = chunk.scan.clone();
        self.flow = Flow::Next;
        let mut left = limit;
        let count = chunk.scan.lines.len() as u32;
        while line < count && left > 0 {
            left -= 1;
            self.next = first + line + 1;
            self.place.line = first + line;
            if let Err(fault) = self.line(&chunk.scan, &chunk.text, line) {
                if self.fails(fault) {
                    return Some(End::Fault);
                }
                return None;
            }
            match self.flow {
                Flow::Next => {}
                Flow::Jump => return None,
                Flow::End(end) => return Some(end),
            }
            if self.skip.is_some() {
                return None;
            }
            line += 1;
        }
        None
    }

    /// Handles a fault; whether the run ends.
    pub(crate) fn fails(&mut self, fault: Box<Fault>) -> bool {
        let own = fault.rs.is_none();
        self.found(fault);
        // What the block was about to set is not set.
        self.settings.clear();
        self.unwind();
        own || !self.setup.keep_going || self.findings.len() >= 100
    }

    /// Takes down a finding of the present block.
    pub(crate) fn found(&mut self, fault: Box<Fault>) {
        let reading = &self.reading;
        let start = reading.begin;
        let known = (reading.line as usize) < reading.scan.lines.len();
        let span = match (fault.span, fault.letter) {
            (Some(span), _) => Some(span),
            (None, Some(letter)) if known => reading
                .scan
                .words(reading.line)
                .iter()
                .find(|w| w.letter == letter)
                .map(|w| reading.scan.word_span(&reading.text, reading.line, w)),
            _ => None,
        };
        let span = span.map(|s| Span::new(s.start.saturating_sub(start), s.end.saturating_sub(start)));
        let p = self.place;
        let text = self.line_text();
        let text = text.char_indices().nth(254).map_or(text, |(i, _)| &text[..i]);
        let text = text.split('\0').next().unwrap_or(text);
        // Blanks at the end of a line are not read; a call that the controller made up keeps its own, and a line that is
        // too long is not looked at.
        let whole = fault.code == code::REMAP_WORDS || fault.code == code::TEXT_LINE_TOO_LONG;
        let text = if whole { text } else { text.trim_end() }.into();
        self.findings.push(Finding { file: p.file, line: p.line, frame: p.frame, fault, span, text });
    }

    /// The file ends too early. Told to go on, the controller does so behind the call that it was in.
    fn end_of_file(&mut self) -> Option<End> {
        let fault = self.end_fault();
        let called = self.level() > 0;
        self.found(fault);
        self.unwind();
        let goes_on = called && self.setup.keep_going && self.findings.len() < 100;
        (!goes_on).then_some(End::Fault)
    }

    /// What is wrong when a file ends.
    pub(crate) fn end_fault(&mut self) -> Box<Fault> {
        self.show_last_line();
        match &self.skip {
            Some(skip) if skip.to_sub => {
                let name = self.symbols.name(skip.label.name).to_string();
                let path = self.files.file(self.place.file).path.to_string();
                let start = skip.start;
                if let Some(place) = skip.from {
                    self.place = place;
                }
                Fault::new(code::SUB_NOT_FOUND, rs274::RT_O_EOF_SEEKING).arg(path).arg(&name).arg(start).named(name)
            }
            _ if self.m.percent != 0 => Fault::new(code::PROGRAM_ENDS_EARLY, rs274::RT_NO_PERCENT),
            _ => Fault::new(code::PROGRAM_ENDS_EARLY, rs274::RT_NO_PERCENT_OR_END),
        }
    }

    /// The file's last line becomes the line read last.
    fn show_last_line(&mut self) {
        let file = self.files.file(self.place.file);
        let count = file.line_count();
        let Some((c, l)) = file.locate(count.wrapping_sub(1)) else { return };
        let chunk = file.chunks[c].clone();
        self.place.line = count - 1;
        self.read_alone(&chunk, l);
    }

    /// Reads and executes one line.
    #[inline]
    fn line(&mut self, scan: &Scan, text: &str, line: u32) -> Res {
        let at = scan.lines[line as usize];
        let end = scan.lines.get(line as usize + 1).map_or(text.len() as u32, |l| l.start);
        self.reading.line = line;
        self.reading.begin = at.start;
        self.reading.start = at.start;
        self.reading.end = trim_end(text.as_bytes(), at.start, end);
        if self.m.probed | self.m.tool_changed | self.m.input_wanted != 0 {
            self.read_inputs();
        }
        let words = scan.words(line);
        if self.skip.is_some() || at.faulty || at.kind != LineKind::Plain {
            return self.special_line(scan, text, line, words);
        }
        if at.deleted && self.setup.block_delete {
            return Ok(());
        }
        self.block.clear();
        self.comment = None;
        let first = if words.first().is_some_and(|w| w.letter == b'n') { words.get(1) } else { words.first() };
        if first.is_some_and(|w| w.letter == b'm') {
            if let Some(which) = self.fanuc_call(first) {
                return self.fanuc_line(scan, words, which);
            }
        }
        for w in words {
            self.read_word(scan, text, w)?;
        }
        self.execute_line()
    }

    /// After the words are read: checks, settings, execution.
    #[inline]
    pub(crate) fn execute_line(&mut self) -> Res {
        let fanuc = self.is_fanuc();
        if fanuc {
            self.fanuc_words()?;
        }
        self.enhance()?;
        if fanuc && self.m.turned != 0 {
            self.turn_words()?;
        }
        self.check()?;
        self.note_remaps();
        if !self.settings.is_empty() {
            self.store_settings()?;
        }
        self.blocks += 1;
        self.check_budgets()?;
        self.begun = self.emitted;
        self.execute_block()
    }

    /// Budgets end what goes around and around. A program that comes on line by line may be as long as it likes.
    #[inline]
    pub(crate) fn check_budgets(&mut self) -> Res {
        let (blocks, calls) = (self.blocks - self.spent.0, self.emitted - self.spent.1);
        if blocks > self.setup.budgets.blocks || calls > self.setup.budgets.calls {
            return self.over_budget(blocks);
        }
        Ok(())
    }

    #[cold]
    fn over_budget(&mut self, blocks: u64) -> Res {
        if self.at_rest() && self.place.line >= self.frontier {
            self.spent = (self.blocks, self.emitted);
            return Ok(());
        }
        let what = if blocks > self.setup.budgets.blocks { "blocks" } else { "motions" };
        Err(self.endless(&format!("the program has run more {what} than the limit allows")))
    }

    /// Counts a line with control flow. Budgets begin anew on each that the main program comes to for the first time
    /// outside of calls and loops, so that it does not matter where a run began.
    pub(crate) fn count_control(&mut self) -> Res {
        if self.level() == 0 && self.place.line >= self.frontier {
            if self.at_rest() {
                self.spent = (self.blocks, self.emitted);
            }
            self.frontier = self.place.line + 1;
        }
        self.blocks += 1;
        self.check_budgets()
    }

    /// Lines with structure, faults, `%`, or while skipping.
    fn special_line(&mut self, scan: &Scan, text: &str, line: u32, words: &[Word]) -> Res {
        let at = scan.lines[line as usize];
        if at.faulty {
            let fault = self.text_fault(scan, line);
            let deleted = at.deleted && self.setup.block_delete;
            if fault.is_some() || (self.skip.is_none() && !deleted) {
                self.opened.damaged_met.insert((self.place.file, self.place.line));
            }
            if let Some(fault) = fault {
                return Err(fault);
            }
        }
        if at.kind == LineKind::Percent && self.m.percent != 0 && !at.deleted {
            self.emit(Call::Finish);
            if let Some(skip) = &self.skip {
                let name = self.symbols.name(skip.label.name).to_string();
                return Err(Fault::new(code::SUB_NOT_FOUND, rs274::RT_O_EOF_SUB).arg(name));
            }
            self.flow = Flow::End(End::Percent);
            return Ok(());
        }
        if at.deleted && self.setup.block_delete {
            return Ok(());
        }
        self.block.clear();
        self.comment = None;
        self.settings.clear();
        let first = if words.first().is_some_and(|w| w.letter == b'n') { words.get(1) } else { words.first() };
        match first {
            Some(w) if w.letter == b'o' => return self.control_line(scan, text, line, words, w),
            Some(w) if w.letter == b'm' => {
                if let Some(which) = self.fanuc_call(first) {
                    return self.fanuc_line(scan, words, which);
                }
            }
            _ => {}
        }
        if self.skip.is_some() {
            return Ok(());
        }
        if at.kind == LineKind::Percent {
            return Err(self.first_fault(scan, line).unwrap_or_else(|| {
                Fault::new(code::SYNTAX_BAD_CHARACTER, rs274::BAD_CHARACTER).arg("%").arg("%")
            }));
        }
        self.read_words(scan, text, line, words)?;
        if words.is_empty() && !at.faulty {
            return Ok(());
        }
        self.execute_line()
    }

    /// A fault that the controller finds before it looks at any word.
    fn text_fault(&self, scan: &Scan, line: u32) -> Option<Box<Fault>> {
        scan.faults_of(line).iter().find(|f| before_words(f.rs)).map(convert_fault)
    }

    /// The first fault of a line.
    pub(crate) fn first_fault(&self, scan: &Scan, line: u32) -> Option<Box<Fault>> {
        scan.faults_of(line).first().map(convert_fault)
    }

    /// The fault behind a damaged piece of the present line.
    pub(crate) fn parse_fault(&self, scan: &Scan) -> Box<Fault> {
        self.first_fault(scan, self.reading.line)
            .unwrap_or_else(|| Fault::new(code::NUMBER_MALFORMED, rs274::BAD_NUMBER_FORMAT).arg("").arg(""))
    }

    /// Stands in for `rs274`: told to go on after an error, it does so with whatever the controller is left with.
    fn stands_in(&self) -> bool {
        self.setup.keep_going && !self.setup.startup_code
    }

    /// Forgets calls, loops and skipping, as after an error or at the end.
    pub(crate) fn unwind(&mut self) {
        while self.levels.len() > 1 {
            self.main_unnamed = true;
            self.levels.pop();
            let level = self.level();
            self.params.leave_level(level + 1);
            let ret = self.levels[level].ret.take();
            if let Some(ret) = ret {
                if ret.params || (self.levels[level].kind != CallKind::M98 && self.stands_in()) {
                    self.take_back_params(level);
                }
                self.place = ret.place;
                self.next = ret.next;
                self.shift = ret.shift;
                self.flow = if self.flow == Flow::Next { Flow::Jump } else { self.flow };
            }
        }
        self.place.frame = FrameId::MAIN;
        self.remaps.clear();
        (self.sub_name, self.came_back) = (None, false);
        self.defining_sub = false;
        self.skip = None;
        self.offsets.clear();
        self.loops.clear();
        self.queue.clear();
    }

    fn outcome(&mut self, end: End) -> Outcome {
        self.unclosed();
        let mut damaged = Vec::new();
        for id in &self.opened.order {
            if self.files.is_plain(*id) {
                continue;
            }
            let file = self.files.file(*id);
            for (c, chunk) in file.chunks.iter().enumerate() {
                let mut last = u32::MAX;
                for fault in &chunk.scan.faults {
                    let line = file.first_lines[c] + fault.line;
                    if line != last && !self.opened.damaged_met.contains(&(*id, line)) {
                        damaged.push((*id, line));
                    }
                    last = line;
                }
            }
        }
        Outcome {
            end,
            findings: std::mem::take(&mut self.findings),
            damaged,
            blocks: self.blocks,
            calls: self.emitted,
            files: self.opened.order.clone(),
        }
    }

    /// The outcome so far, for callers that step.
    pub fn finish(&mut self, end: End) -> Outcome {
        self.outcome(end)
    }
    /// Findings so far, taken out.
    pub fn take_findings(&mut self) -> Vec<Finding> {
        std::mem::take(&mut self.findings)
    }
    /// The modal state.
    pub fn modal(&self) -> &Modal {
        &self.m
    }
    /// All parameters.
    pub fn params(&self) -> &Params {
        &self.params
    }
    /// The tool table as the program left it.
    pub fn tools(&self) -> &ToolTable {
        &self.tools
    }
    /// The sink back.
    pub fn into_sink(self) -> S {
        self.sink
    }
    /// The sink.
    pub fn sink(&mut self) -> &mut S {
        &mut self.sink
    }
    /// Text of the line read last, as `rs274` shows it with an error.
    pub fn line_text(&self) -> &str {
        self.reading.text.get(self.reading.start as usize..self.reading.end as usize).unwrap_or("")
    }

    /// Executes a line typed in by hand. Calls of subroutines run to their end.
    pub fn mdi(&mut self, chunk: &Chunk) -> Result<Option<End>, Finding> {
        self.reading.text = chunk.text.clone();
        self.reading.scan = chunk.scan.clone();
        self.flow = Flow::Next;
        let base = self.level();
        let before = self.findings.len();
        let result = if chunk.scan.lines.is_empty() { Ok(()) } else { self.line(&chunk.scan, &chunk.text, 0) };
        if let Err(fault) = result {
            self.fails(fault);
            return Err(self.findings.remove(before));
        }
        while self.level() > base && !matches!(self.flow, Flow::End(_)) {
            if let Some(end) = self.run_piece(1) {
                return if self.findings.len() > before { Err(self.findings.remove(before)) } else { Ok(Some(end)) };
            }
        }
        Ok(match self.flow {
            Flow::End(end) => Some(end),
            _ => None,
        })
    }
}

/// Runs one chunk that holds no control flow from a given state. Lines of calls and findings are relative to
/// the chunk. Budgets count within the chunk.
pub fn run_chunk<S: Sink>(chunk: &Chunk, state: &State, params: &Params, setup: &Setup, sink: S) -> ChunkExit {
    let lines = 0..chunk.scan.lines.len() as u32;
    run_lines(chunk, lines, state, params, setup, sink)
}

/// Runs some lines of such a chunk.
pub fn run_lines<S: Sink>(
    chunk: &Chunk,
    lines: std::ops::Range<u32>,
    state: &State,
    params: &Params,
    setup: &Setup,
    sink: S,
) -> ChunkExit {
    let mut files = NoFiles::default();
    let tools = state.tools.clone().unwrap_or_else(|| Arc::new(setup.tools.clone()));
    let mut run = Interp::with(&mut files, setup, sink, state.clone(), params.clone(), tools);
    run.log = Some(Box::new(Log { before: params.clone(), ..Log::default() }));
    run.reading.text = chunk.text.clone();
    run.reading.scan = chunk.scan.clone();
    let mut end = End::Chunk;
    for line in lines.start..lines.end.min(chunk.scan.lines.len() as u32) {
        run.next = line + 1;
        run.place.line = line;
        if let Err(fault) = run.line(&chunk.scan, &chunk.text, line) {
            if run.fails(fault) {
                end = End::Fault;
                break;
            }
        }
        if let Flow::End(why) = run.flow {
            end = why;
            break;
        }
    }
    let log = run.log.take().unwrap_or_default();
    ChunkExit {
        end,
        reads: log.reads,
        writes: log.writes,
        open_ended: log.named,
        blocks: run.blocks,
        calls: run.emitted,
        findings: std::mem::take(&mut run.findings),
        state: run.state(),
        params: run.params,
    }
}

fn trim_end(text: &[u8], start: u32, end: u32) -> u32 {
    let mut end = end as usize;
    while end > start as usize && matches!(text.get(end - 1), Some(b'\n' | b'\r')) {
        end -= 1;
    }
    end as u32
}

fn before_words(rs: Rs274) -> bool {
    rs == rs274::UNCLOSED_COMMENT || rs == rs274::NESTED_COMMENT || rs == rs274::COMMAND_TOO_LONG
}

pub(crate) fn convert_fault(f: &gr_gcode::Fault) -> Box<Fault> {
    Box::new(Fault { code: f.code, rs: Some(f.rs), args: f.args.to_vec(), own_args: Vec::new(), letter: None, span: Some(f.span) })
}
