//! Operations one after another.

use super::write::Writer;
use super::{Emitted, Language, Options};
use crate::sources::{SYSTEMS, Words, stores_reference};
use gr_ir::Sources;
use gr_ir::{Axes, FeedMode, Marker, Note, Op, Override, Plane, Program, Source, State, Stop, Turn, Units, View};
use gr_text::{Code, Diagnostic, FileId, Findings, code};

/// Decimals of compensated contours at least.
const CONTOUR_PLACES: usize = 7;
/// Findings reported at most.
const MOST_FAULTS: usize = 100;

/// Writes a program. Errors are at the source lines that the language can't express.
pub fn emit(program: &Program, options: &Options, sources: &dyn Sources) -> Result<Emitted, Vec<Diagnostic>> {
    if let Some(mistake) = options.mistakes() {
        let (file, span) = sources.place(Source::default());
        return Err(vec![Diagnostic::new(code::EMIT_BAD_OPTION, file, span, &[mistake])]);
    }
    let contours = options.control_compensates.then(|| super::beside::contours(program));
    let program = contours.as_ref().map_or(program, |c| &c.program);
    let mut emitter = Emitter::new(program, options, sources);
    if let Some((source, code)) = stores_reference(program, sources) {
        emitter.own_reference = true;
        emitter.say(code::EMIT_REFERENCE_NOT_STORED, source, &[code.into()]);
    }
    for (source, why) in contours.iter().flat_map(|c| &c.left) {
        emitter.say(code::EMIT_NOT_COMPENSATED, *source, std::slice::from_ref(why));
    }
    emitter.run(program);
    if emitter.found.failed() {
        Err(emitter.found.into_list())
    } else {
        Ok(Emitted { text: emitter.w.text, lines: emitter.w.lines, notes: emitter.found.into_list() })
    }
}

pub(super) struct Emitter<'a> {
    pub program: &'a Program,
    pub w: Writer,
    pub options: &'a Options,
    pub sources: &'a dyn Sources,
    pub found: Findings,
    /// Where the written program has the axes, in the frame of the moment.
    pub at: Axes,
    /// The axis was given by a word since the frame moved.
    pub anchored: [bool; 9],
    /// The axis stands where a probe stopped, which only the machine knows. By how much the simulation has it there from where the IR
    /// has it: the target.
    pub loose: [Option<f64>; 9],
    /// Lines whose value only the machine knows.
    pub unforeseen: std::collections::BTreeSet<(FileId, u32)>,
    /// The shift in force comes from G92, not from G52.
    pub shifted_by_place: bool,
    /// The operation whose S is written with G96 or G97 already.
    pub speed_said: Option<usize>,
    /// The machine went to change the tool at a place of its own: the next move names all its axes.
    pub displaced: bool,
    /// Words of the canned cycle in force, while `motion` says that there is one.
    pub cycle: Option<super::cycles::Modal>,
    /// The state whose frame `at` is in.
    pub frame: State,
    /// Active G0 or G1, as far as a word can be left out.
    pub motion: Option<u8>,
    pub plane: Plane,
    pub feed: String,
    pub feed_mode: FeedMode,
    /// Work offsets and rotations as the written program leaves them.
    pub offsets: [Axes; 10],
    pub rotations: [f64; 10],
    pub tools: Vec<(i32, Axes)>,
    /// G28.1 or G30.1 somewhere: the stored reference is the program's own.
    pub own_reference: bool,
    /// The length unit changed while a tool offset was active. The control keeps such an offset's number in the
    /// old unit, so its G28 and G30 end beside the reference from here on, and those of the written program,
    /// which has one unit only, would not.
    pub adrift: bool,
    units: Units,
    words_of: Option<(Source, Words)>,
    last_fault: Option<(Source, Code)>,
    /// Operations before this one were written already, together with an earlier one.
    pub done_until: usize,
    /// The axis across the working plane: cycles move it by R and not by its own letter.
    pub across: usize,
    /// Inside a pass of a canned cycle, whose words may be of an earlier block.
    pub cycling: bool,
    /// An arc is being written, whose R is a radius.
    pub rounding: bool,
    /// The work offset in force was said.
    pub said_system: bool,
    /// The program has named a way to follow the path: G61, G61.1, G64.
    pub said_path: bool,
    /// The way to follow the path that only the machine knows is kept by M70, to come back with M72; and with it what
    /// feeds meant then.
    pub kept_path: Option<FeedMode>,
    last_source: Option<Source>,
}

impl<'a> Emitter<'a> {
    fn new(program: &'a Program, options: &'a Options, sources: &'a dyn Sources) -> Emitter<'a> {
        let state = *program.start_state();
        Emitter {
            program,
            w: Writer::new(options),
            options,
            sources,
            found: Findings::new(MOST_FAULTS),
            at: program.start().axes,
            anchored: [false; 9],
            loose: [None; 9],
            speed_said: None,
            shifted_by_place: false,
            unforeseen: std::collections::BTreeSet::new(),
            displaced: false,
            cycle: None,
            frame: state,
            motion: None,
            plane: state.plane,
            feed: String::new(),
            feed_mode: FeedMode::PerTime,
            offsets: options.stored_offsets,
            rotations: options.stored_rotations,
            tools: options.tools.clone(),
            own_reference: false,
            adrift: false,
            units: state.units,
            words_of: None,
            last_fault: None,
            done_until: 0,
            across: 2,
            cycling: false,
            rounding: false,
            said_system: false,
            said_path: false,
            kept_path: None,
            last_source: None,
        }
    }

    pub fn say(&mut self, code: Code, source: Source, args: &[String]) {
        if self.last_fault.replace((source, code)) == Some((source, code)) || !self.found.admits(code) {
            return;
        }
        let (file, span) = self.sources.place(source);
        self.found.add(Diagnostic::new(code, file, span, args));
    }

    /// The language has no way to say it.
    pub fn cannot(&mut self, what: &str, source: Source) {
        self.say(code::EMIT_NOT_EXPRESSIBLE, source, &[what.into(), self.options.language.title().into()]);
    }

    /// Written as a comment: no effect on the machine.
    pub fn as_comment(&mut self, what: &str, source: Source) {
        self.say(code::EMIT_DROPPED_NOTE, source, &[what.into(), self.options.language.title().into()]);
        self.w.comment(what);
    }

    pub fn linuxcnc(&self) -> bool {
        self.options.language == Language::Linuxcnc
    }

    /// Words of the source line.
    pub fn words(&mut self, source: Source) -> Option<Words> {
        if let Some((s, w)) = self.words_of
            && s == source
        {
            return Some(w);
        }
        let words = Words::at(self.sources, source.file, source.line)?;
        self.words_of = Some((source, words));
        Some(words)
    }

    /// Line of the main file: of a block elsewhere, the line that called it.
    fn main_line(&self, source: Source) -> u32 {
        if source.file == FileId(0) {
            return source.line;
        }
        self.program.call_stack(source).find(|f| f.file == FileId(0)).map_or(u32::MAX, |f| f.line)
    }

    fn run(&mut self, program: &Program) {
        let skip = prologue(program, self.linuxcnc());
        let epilogue = epilogue(program);
        let ends = program.steps().any(|s| s.op == Op::End);
        self.header(ends);
        let mut cursor = program.cursor();
        while let Some(view) = cursor.next() {
            let index = view.index;
            self.w.source = self.main_line(view.source);
            if let Op::Units(units) = view.op {
                self.adrift |= units != self.units && self.frame.tool_offset != [0.0; 9];
                self.units = units;
            }
            self.across = across(view.state.plane);
            match view.op {
                Op::Begin { marker: Marker::Cycle, .. } => self.cycling = true,
                Op::Close(Marker::Cycle) => self.cycling = false,
                _ => {}
            }
            if index >= skip && !self.said_system {
                self.say_system(&view);
            }
            if index < skip || index < self.done_until || (epilogue.start..epilogue.end).contains(&index) {
                self.follow_silently(&view);
            } else if let Op::End = view.op {
                self.end(index);
                break;
            } else {
                self.op(&view);
            }
        }
        self.footer(ends);
    }

    /// A work offset that the source selects is selected here too, also where the simulation has it already: the control
    /// may not.
    fn say_system(&mut self, view: &View<'_, '_>) {
        const MOST_LINES: u32 = 1000;
        let source = view.source;
        let last = self.last_source.replace(source);
        // G10 changes the one in force, and selects none.
        if matches!(view.op, Op::WorkOffset(..)) && !self.words(source).is_some_and(|w| w.g(100) && !SYSTEMS[1..].iter().any(|g| w.g(*g))) {
            self.said_system = true;
            return;
        }
        let Some(code) = SYSTEMS.get(usize::from(view.state.work)).copied().filter(|c| *c > 0) else {
            return;
        };
        // A line that selects what is in force asks for no operation: it lies between two that do.
        let from = match last {
            Some(l) if l == source => return,
            Some(l) if l.file == source.file && l.frame == source.frame && l.line < source.line => l.line + 1,
            None if source.line < MOST_LINES && source.file == FileId(0) => 0,
            _ => source.line,
        };
        let lines = from.max(source.line.saturating_sub(MOST_LINES))..=source.line;
        let words: Vec<Words> = lines.filter_map(|l| Words::at(self.sources, source.file, l)).collect();
        let jumps = words.iter().rev().skip(1).any(|w| w.has(b'o'));
        let own = words.last().is_some_and(|w| w.g(code));
        if own || !jumps && words.iter().any(|w| w.g(code)) {
            self.said_system = true;
            self.w.block(super::settings::OFFSETS[usize::from(view.state.work)]);
        }
    }

    /// Leaves out a tool length that no move of Z carries.
    fn drop_length(&mut self) {
        if let Some((held, source)) = self.w.release() {
            self.as_comment(&format!("{held} without a move of Z"), source);
        }
    }

    fn end(&mut self, index: usize) {
        self.drop_length();
        let before = index.checked_sub(1).and_then(|i| self.program.get(i)).map(|s| s.op);
        let pallet = matches!(before, Some(Op::Stop(Stop::Pallet)));
        self.w.block(if pallet { "M30" } else { "M2" });
    }

    /// The operation after this index.
    pub fn op_after(&self, index: usize) -> Option<Op<'a>> {
        self.program.get(index + 1).map(|s| s.op)
    }

    /// Keeps up with what a silent operation does to the frame.
    fn follow_silently(&mut self, view: &View<'_, '_>) {
        match view.op {
            Op::WorkOffset(n, offset) if usize::from(n) < 10 => self.offsets[usize::from(n)] = offset,
            Op::Rotation(r) => self.rotations[usize::from(view.state.work.min(9))] = r,
            Op::Plane(p) if view.index < self.done_until => self.plane = p,
            _ => {}
        }
        self.move_frame(view.state);
    }

    /// Writes `at` in the frame of another state; the machine stands still.
    pub fn move_frame(&mut self, state: &State) {
        let same = state.tool_offset == self.frame.tool_offset
            && state.work_offset == self.frame.work_offset
            && state.local_offset == self.frame.local_offset
            && state.rotation == self.frame.rotation;
        if !same {
            let machine = self.frame.machine(&self.at);
            self.at = state.work_frame(&machine);
            self.anchored = [false; 9];
        }
        self.frame = *state;
    }

    fn header(&mut self, ends: bool) {
        let name = self.options.name.clone();
        match self.options.language {
            Language::Linuxcnc if !ends => self.w.bare("%"),
            Language::FanucMill => {
                self.w.bare("%");
                let number: String = name.chars().filter(char::is_ascii_digit).take(4).collect();
                let number: u32 = number.parse().unwrap_or(1).max(1);
                self.w.bare(&format!("O{number:04}"));
            }
            _ => {}
        }
        if self.options.comments && !name.is_empty() {
            self.w.comment(&name);
        }
        if self.options.comments {
            let remarks = &self.options.remarks;
            remarks.iter().for_each(|r| self.w.comment(r));
        }
        let units = if self.options.units == Units::Inch { "G20" } else { "G21" };
        let plane = self.plane.code();
        let rest = match self.options.language {
            Language::Linuxcnc if self.options.arcs == super::Arcs::IjkAbsolute => "G40 G80 G90 G90.1 G94",
            Language::Linuxcnc if self.options.diameters || turns(self.program, self.sources) => {
                "G8 G40 G80 G90 G91.1 G94"
            }
            Language::Linuxcnc => "G40 G80 G90 G91.1 G94",
            Language::FanucMill => "G40 G80 G90 G94",
            Language::Grbl => "G40 G80 G90 G91.1 G94",
        };
        self.w.block(&format!("{units} {plane} {rest}"));
    }

    fn footer(&mut self, ends: bool) {
        self.drop_length();
        match self.options.language {
            Language::Linuxcnc if !ends => self.w.bare("%"),
            Language::FanucMill => {
                if !ends {
                    self.w.block("M30");
                }
                self.w.bare("%");
            }
            _ => {}
        }
    }

    fn op(&mut self, view: &View<'_, '_>) {
        let straight = matches!(view.op, Op::Rapid | Op::Linear) && view.state.sync.is_none_or(|s| s.velocity);
        if view.op.moves() && !straight && view.start.axes[2] != view.end.axes[2] && self.w.release().is_some() {
            self.cannot("a tool length (G43) that only begins in an arc or a thread along Z", view.source);
        }
        match view.op {
            Op::Rapid if self.cycle_there(view) => {}
            Op::Rapid => self.rapid(view),
            Op::Linear if self.cycle_here(view) => {}
            Op::Linear => self.linear(view),
            Op::Arc(arc) => self.arc(view, &arc),
            Op::Nurbs { order, points } => self.nurbs(view, order, points),
            Op::Probe(kind) => self.probe(view, kind),
            Op::RigidTap { bottom, scale } => self.rigid_tap(view, bottom, scale),
            Op::Dwell(seconds) => self.dwell(seconds),
            // What is read of a probe is told where it is read, and steps from where it stopped are written as steps.
            Op::RunTime("probe" | "the result of a probe" | "where the probe stopped") => {}
            // A line in a loop is told once.
            Op::RunTime(_) if !self.unforeseen.insert((view.source.file, view.source.line)) => {}
            Op::RunTime(what) => self.say(code::EMIT_RUNTIME_VALUE, view.source, &[what.into()]),
            Op::Note(note, text) => self.note(note, text, view.source),
            Op::Override(Override::Feed, false) if self.tap_here(view) => {}
            Op::Begin { marker: Marker::Contour, code, .. } if self.options.control_compensates => self.compensation(code, view.state.tool),
            Op::Close(Marker::Contour) if self.options.control_compensates => self.compensation(40, 0),
            Op::LogClose if self.linuxcnc() => self.w.bare("(LOGCLOSE)"),
            Op::LogClose => {}
            Op::Stop(stop) => self.stop(stop, view),
            _ => self.setting(view),
        }
    }

    /// Contours have finer numbers: the control makes tangents of them.
    fn compensation(&mut self, code: i32, tool: i32) {
        let places = self.options.places();
        self.w.places = if code == 40 { places } else { places.max(CONTOUR_PLACES) };
        match code {
            super::beside::WAY_IN => return,
            40 => self.w.block("G40"),
            _ => self.w.block(&format!("G{code} D{tool}")),
        }
        self.motion = None;
    }

    fn dwell(&mut self, seconds: f64) {
        let word = match self.options.language {
            // Whole milliseconds without a point; finer ones as seconds with a point.
            Language::FanucMill => {
                let ms = seconds * 1000.0;
                if (ms - libm::round(ms)).abs() < 1e-9 {
                    format!("P{}", libm::round(ms))
                } else {
                    format!("X{}", self.w.number(seconds, 6))
                }
            }
            _ => format!("P{}", self.w.number(seconds, 6)),
        };
        self.w.block(&format!("G4 {word}"));
    }

    fn note(&mut self, note: Note, text: &str, source: Source) {
        match note {
            Note::Comment => {
                if self.options.comments && !text.starts_with("interpreter:") {
                    self.w.comment(text);
                }
            }
            Note::Message if self.linuxcnc() => self.active_comment("MSG,", text),
            Note::Message => self.as_comment(text, source),
            Note::Log if self.linuxcnc() => self.active_comment("LOG,", text),
            Note::LogOpen if self.linuxcnc() => self.active_comment("LOGOPEN,", text),
            Note::LogAppend if self.linuxcnc() => self.active_comment("LOGAPPEND,", text),
            Note::Log | Note::LogOpen | Note::LogAppend => self.as_comment("a log statement", source),
        }
    }

    fn active_comment(&mut self, head: &str, text: &str) {
        let one = |c| match c {
            '(' => '[',
            ')' => ']',
            c => c,
        };
        let clean: String = text.chars().filter(|c| !c.is_control()).map(one).take(200).collect();
        self.w.bare(&format!("({head}{clean})"));
    }

    fn stop(&mut self, stop: Stop, view: &View<'_, '_>) {
        let next = self.op_after(view.index);
        match (stop, next) {
            (Stop::Program, _) => self.w.block("M0"),
            (Stop::Optional, _) => self.w.block("M1"),
            // The end with pallet change is M30.
            (Stop::Pallet, Some(Op::End)) => {}
            (Stop::Pallet, Some(Op::Stop(Stop::Program))) if self.linuxcnc() => {
                self.w.block("M60");
                self.done_until = view.index + 2;
            }
            (Stop::Pallet, _) => self.cannot("a pallet change", view.source),
        }
    }
}

/// A program for a lathe: its control may stand in diameter mode (G7), and what is written has radii.
fn turns(program: &Program, sources: &dyn Sources) -> bool {
    if crate::from_line::is_lathe(program) {
        return true;
    }
    let files: std::collections::BTreeSet<_> = program.steps().map(|s| s.source.file).collect();
    let mut lines = files.into_iter().flat_map(|file| (0u32..).map_while(move |l| sources.line(file, l)));
    lines.any(|text| text.contains(['7', '8']) && (Words::of(text).g(70) || Words::of(text).g(80)))
}

fn across(plane: Plane) -> usize {
    match plane {
        Plane::Xy => 2,
        Plane::Xz => 1,
        Plane::Yz => 0,
        Plane::Uv => 8,
        Plane::Uw => 7,
        Plane::Vw => 6,
    }
}

/// How many leading operations only tell how the control starts. `same`: the program is for a control that runs the same
/// startup code itself; another is told what that code does.
fn prologue(program: &Program, same: bool) -> usize {
    let begins = crate::begins(program);
    let started = program.steps().take(begins).position(|s| s.op == Op::FeedReferenceXyz);
    if same { begins } else { started.map_or(begins, |at| at + 1) }
}

/// The operations around the end that M2 or M30 does by itself; the end itself is not among them.
fn epilogue(program: &Program) -> Epilogue {
    let Some(end) = program.steps().find(|s| s.op == Op::End) else {
        return Epilogue { start: 0, end: 0 };
    };
    let mut start = end.index;
    while start > 0 {
        let Some(step) = program.get(start - 1) else {
            break;
        };
        if step.source != end.source || !done_by_end(&step.op) {
            break;
        }
        start -= 1;
    }
    Epilogue { start, end: end.index }
}

#[derive(Clone, Copy)]
struct Epilogue {
    start: usize,
    end: usize,
}

fn done_by_end(op: &Op<'_>) -> bool {
    matches!(
        op,
        Op::WorkOffset(..)
            | Op::Rotation(_)
            | Op::LocalOffset(_)
            | Op::Plane(_)
            | Op::FeedMode { .. }
            | Op::Feed { .. }
            | Op::Override(_, true)
            | Op::SpindleTurn { turn: Turn::Stop, .. }
            | Op::SpindleMode { .. }
            | Op::Mist(false)
            | Op::Flood(false)
            | Op::Stop(Stop::Pallet)
            | Op::Note(Note::Comment, _)
            | Op::Finish
    )
}
