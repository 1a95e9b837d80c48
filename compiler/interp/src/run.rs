//! The run: files in, line after line, the two streams out.

use std::sync::Arc;

use gr_canon::{At, Call, CallFrame, FileId, FrameId, Mark, Sink};
use gr_gcode::{Chunk, File, LineKind, Scan};
use gr_spec::{code, rs274};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::block::Block;
use crate::calls::{CallKind, Level};
use crate::control::{Loop, Skip};
use crate::findings::{Finding, Outcome, convert_fault};
use crate::io::Comment;
use crate::labels::{LabelAt, LabelName, LabelTable, Symbols};
use crate::queue::Queue;
use crate::remap::{Config, Remapped};
use crate::state::State;
use crate::statements::FileIndex;
use crate::world::World;
use crate::{Fault, Modal, Params, Res, Setup, Tools};

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
    /// Where a label was met in an earlier run of the same program that this one goes on behind.
    fn earlier_label(&self, _name: &LabelName) -> Option<LabelAt> {
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

/// The line read last; its text is what `At::now` shows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reading {
    pub text: gr_text::Text,
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
    pub(crate) tools: Tools,
    pub(crate) world: World,
    /// The machine's own table; the interpreter's follows after a tool change.
    pub(crate) world_tools: Tools,
    pub(crate) config: Arc<Config>,
    /// The codes that the dialect has, when it is a closed list.
    pub(crate) closed: Option<&'static crate::closed::Closed>,
    pub(crate) place: Place,
    /// What the next finding is about, when that is not the present line.
    pub(crate) blamed: Option<Place>,
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
    /// A name without a value was read in a subroutine that is only read.
    pub(crate) unset_read: bool,
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
    pub(crate) labels: LabelTable,
    pub(crate) levels: Vec<Level>,
    pub(crate) loops: Vec<Loop>,
    pub(crate) remaps: Vec<Remapped>,
    pub(crate) m98: bool,
    /// Fanuc: macros that movements call (G66), the last one first in turn.
    pub(crate) modal_macros: Vec<crate::macro_call::ModalMacro>,
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
    /// Loops that were over and begun anew by another end, since then.
    pub(crate) restarts: u32,
    /// Control flow of the main program was met on lines before this one only.
    pub(crate) frontier: u32,
    pub(crate) findings: Vec<Finding>,
    pub(crate) log: Option<Box<crate::chunk::Log>>,
}

impl<'a, S: Sink> Interp<'a, S> {
    /// A run that has not begun.
    pub fn new(files: &'a mut dyn Files, setup: &'a Setup, sink: S) -> Self {
        let state = State::start(setup);
        let mut params = Params::default();
        for (index, value) in &setup.params {
            params.set(*index, *value);
        }
        Self::with(files, setup, sink, state, params)
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
        let mut run = Self::with(files, setup, sink, state, params);
        run.place = Place { file: main, line, frame: FrameId::MAIN };
        run.note_file(main);
        (run.next, run.shift, run.frontier) = (line, shift, line);
        run
    }

    pub(crate) fn with(
        files: &'a mut dyn Files,
        setup: &'a Setup,
        sink: S,
        state: State,
        params: Params,
    ) -> Self {
        let State { modal, queue, world, saved, tools, world_tools } = state;
        let (tools, world_tools) = match (tools, world_tools) {
            (Some(own), Some(world)) => (own, world),
            (own, world) => {
                let start = Tools::new(&setup.tools);
                (own.unwrap_or_else(|| start.clone()), world.unwrap_or(start))
            }
        };
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
            tools,
            world,
            world_tools,
            config: Arc::new(Config::new(setup)),
            closed: crate::closed::list_of(setup.dialect),
            place: Place::default(),
            blamed: None,
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
            unset_read: false,
            sub_name: None,
            came_back: false,
            main_unnamed: false,
            executed_if: false,
            doing_break: false,
            doing_continue: false,
            test_value: 0.0,
            return_value: 0.0,
            value_returned: false,
            labels: LabelTable::default(),
            levels: vec![main],
            loops: Vec::new(),
            remaps: Vec::new(),
            m98: false,
            modal_macros: Vec::new(),
            in_contour: false,
            frames: 0,
            blocks: 0,
            emitted: 0,
            begun: 0,
            spent: (0, 0),
            restarts: 0,
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
        self.start_where_it_stands();
        self.power_up();
        self.run_startup();
    }

    /// What the control says of itself when it is switched on, where that is not as with LinuxCNC.
    fn power_up(&mut self) {
        if crate::fanuc::is_lathe(self.setup.dialect) {
            self.emit(Call::SelectPlane(gr_canon::Plane::Xz));
            self.emit(Call::SetFeedMode(0, 1));
        }
        if self.setup.dialect.family == gr_spec::Family::Grbl {
            self.m.motion = 0;
        }
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
    pub(crate) fn read_alone(&mut self, chunk: &Chunk, line: u32) {
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

    /// Stands in for `rs274`.
    pub(crate) fn is_rs274(&self) -> bool {
        !self.setup.startup_code
    }

    /// Stands in for `rs274`: told to go on after an error, it does so with whatever the controller is left with.
    pub(crate) fn stands_in(&self) -> bool {
        self.setup.keep_going && self.is_rs274()
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
                self.take_back_variables(level);
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
        self.modal_macros.clear();
        (self.sub_name, self.came_back) = (None, false);
        self.defining_sub = false;
        self.skip = None;
        self.labels.forget();
        self.loops.clear();
        self.queue.clear();
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
    pub fn tools(&self) -> &Tools {
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

    /// Executes a line typed in by hand. Calls of subroutines run to their end; `rs274` only begins them, and takes the
    /// next lines typed in for theirs.
    pub fn mdi(&mut self, chunk: &Chunk) -> Result<Option<End>, Finding> {
        self.reading.text = chunk.text.clone();
        self.reading.scan = chunk.scan.clone();
        self.flow = Flow::Next;
        let base = self.level();
        let before = self.findings.len();
        let result = if chunk.scan.lines.is_empty() { Ok(()) } else { self.line(&chunk.scan, &chunk.text, 0) };
        if let Err(fault) = result {
            let at = self.findings.len();
            self.fails(fault);
            return Err(self.findings.remove(at));
        }
        while !self.is_rs274() && self.level() > base && !matches!(self.flow, Flow::End(_)) {
            if let Some(end) = self.run_piece(1) {
                // Doubts are no reason to stop.
                let wrong = self.findings[before..].iter().position(|f| f.fault.rs.is_some());
                return wrong.map_or(Ok(Some(end)), |at| Err(self.findings.remove(before + at)));
            }
        }
        Ok(match self.flow {
            Flow::End(end) => Some(end),
            _ => None,
        })
    }
}
