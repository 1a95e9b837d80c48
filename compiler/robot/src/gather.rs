//! First pass: operations of the motion IR become moves in work frames and actions of the cell, in order. No joint
//! values yet. Frames, tools, tool directions, speeds, signals and the words a robot has no meaning for are settled
//! here.

mod lag;
pub(crate) mod places;
pub(crate) mod probing;
mod setups;
mod signals;

use gr_ir::geometry::ArcShape;
use gr_ir::{FeedMode, Marker, Note, Op, PathMode, Pose, Program, Source, Sources, State, Stop, Turn, View};
use gr_machine::math::{Frame, M3, add, dot, norm, product, rot_z, rotation_vector, scale, sub, transpose};
use gr_machine::{Chain, Control, Kind, Machine, Rapid};
use gr_text::{Code, Diagnostic, Severity, code};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use gr_backends::from_line::INSERTED;
use gr_backends::sources::Words as Letters;

use crate::cell::Cells;
use crate::settle::{Increments, leads_to, main_line};
use crate::turns::Turns;
use crate::{Action, Curves, Options, Step, Tool, WorkFrame, Workingstep, Zone};

/// How a move goes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Way {
    Joint,
    Line,
    /// Index into [`Gathered::arcs`].
    Arc(u32),
}

/// An arc of at most half a turn, in its work frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct ArcPiece {
    pub center: [f64; 3],
    pub normal: [f64; 3],
    pub via: [f64; 3],
    pub angle: f64,
}

/// A move to a place in a work frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Move {
    pub way: Way,
    pub position: [f64; 3],
    /// Index into [`Gathered::turns`].
    pub turn: u32,
    pub frame: u16,
    pub tool: u16,
    /// mm/s, or share of the joint speed.
    pub speed: f64,
    pub zone: Zone,
    pub length: f64,
    pub rapid: bool,
    /// The tool may turn about its own axis as the arm likes.
    pub free: bool,
    /// Approach or retract: may be left out.
    pub ours: bool,
    /// Ends where the probe switches.
    pub probe: Option<Contact>,
    pub source: Option<Source>,
}

/// How a probe move ends.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Contact {
    /// State of the input that ends it.
    pub on: bool,
    /// Without it the program stops.
    pub must: bool,
}

pub(crate) enum Item {
    Move(Move),
    Do(Step),
}

pub(crate) struct Gathered {
    pub items: Vec<Item>,
    pub turns: Vec<M3>,
    pub arcs: Vec<ArcPiece>,
    pub tools: Vec<Tool>,
    pub frames: Vec<WorkFrame>,
    pub wait_seconds: f64,
    /// Curves that became straight pieces.
    pub curves: Curves,
    /// The program says how the tool points, not where rotary axes stand.
    pub by_direction: bool,
}

/// Collects findings, one per line and code.
pub(crate) struct Findings<'a> {
    sources: &'a dyn Sources,
    list: gr_text::Findings,
    seen: BTreeSet<(Code, u32, u32)>,
    /// Words and tools that something was said about.
    told: BTreeSet<(Code, String)>,
}

/// Errors told at most, and as many warnings.
const MOST: usize = 200;

impl<'a> Findings<'a> {
    pub fn new(sources: &'a dyn Sources) -> Findings<'a> {
        Findings { sources, list: gr_text::Findings::new(MOST), seen: BTreeSet::new(), told: BTreeSet::new() }
    }
    pub fn say(&mut self, code: Code, source: Option<Source>, args: &[String]) {
        let source = source.unwrap_or_default();
        let key = (code, source.file.0, source.line);
        if !self.seen.contains(&key) && self.list.admits(code) {
            self.seen.insert(key);
            let (file, span) = self.sources.place(source);
            self.list.add(Diagnostic::new(code, file, span, args));
        }
    }
    /// As an error, whatever the code is.
    pub fn fail(&mut self, code: Code, source: Source, args: &[String]) {
        let (file, span) = self.sources.place(source);
        self.list.add(Diagnostic { severity: Severity::Error, ..Diagnostic::new(code, file, span, args) });
    }
    /// Once per program.
    pub fn once(&mut self, code: Code, source: Option<Source>, args: &[String]) {
        if !self.list.has(code) {
            self.say(code, source, args);
        }
    }
    /// Once for each of its first argument.
    pub fn once_each(&mut self, code: Code, source: Option<Source>, args: &[String]) {
        let about = args.first().cloned().unwrap_or_default();
        if self.told.insert((code, about)) {
            self.say(code, source, args);
        }
    }
    /// An empty list about the same sources, that says nothing more with this code about these lines, each a file and a line.
    pub fn apart(&self, code: Code, lines: impl Iterator<Item = (u32, u32)>) -> Findings<'a> {
        Findings { seen: lines.map(|(file, line)| (code, file, line)).collect(), ..Findings::new(self.sources) }
    }
    /// Errors that were found apart.
    pub fn adopt_errors(&mut self, mut other: Findings<'_>) {
        for found in other.take().into_iter().filter(|d| d.severity == Severity::Error) {
            self.list.add(found);
        }
    }
    pub fn bad(&self) -> bool {
        self.list.failed()
    }
    /// Errors so far.
    pub fn errors(&self) -> usize {
        self.list.errors()
    }
    pub fn take(&mut self) -> Vec<Diagnostic> {
        std::mem::replace(&mut self.list, gr_text::Findings::new(MOST)).into_list()
    }
}

/// Below this a radius counts as reached and a way as none, mm.
const TINY: f64 = 1e-9;
/// Places nearer than this are one, mm.
const NEAR: f64 = 1e-6;
/// Largest corner where a program has G64 without a tolerance and the machine file no zone, mm.
const CORNER: f64 = 0.5;
/// A change of tool direction is cut so that no piece turns further, rad.
pub(crate) const TURN_STEP: f64 = 5.0 * PI / 180.0;

pub(crate) struct Gather<'a> {
    machine: &'a Machine,
    options: &'a Options,
    pub findings: Findings<'a>,
    pub out: Gathered,
    cells: Cells,
    turns: Turns<'a>,
    control: Control,
    planar: bool,
    /// Coordinates that the program has said.
    seen: [bool; 3],
    /// A rapid that waits for the coordinates not yet said.
    waiting: bool,
    frame: Option<u16>,
    tool: Option<u16>,
    /// Where the tool stands, in the base.
    at: Option<Frame>,
    /// Where it would stand with the tool that came since, had the changer left the machine where it was.
    at_change: Option<Frame>,
    /// A mill that has not moved yet.
    starts: bool,
    /// A tool was changed since the last move.
    exchanged: bool,
    /// The program had a rapid since the last move.
    rapids: bool,
    /// The last move was a probe's.
    probed: Option<probing::Probed>,
    /// The tool offset moved the program's coordinates while the tool stood still.
    offset: bool,
    /// Of these directions.
    shifted: [bool; 3],
    /// That was told.
    offset_told: bool,
    /// Directions in which the program believes the tool at a place because of its words.
    said: [bool; 3],
    /// The operation belongs to the way to a restart, and not to its line.
    inserted: bool,
    /// The program begins later than at its first line.
    restarted: bool,
    /// Made from features: every move says all.
    planned: bool,
    /// The operation cuts or names Z: a length counts. Across, that of the tool before may still be in force.
    goes_along: bool,
    /// Whether lines go by increments.
    increments: Increments,
    /// What the frame in force is placed by.
    placed: Option<Frame>,
    path_said: bool,
    ended: bool,
    source: Source,
    clamped: Option<usize>,
    /// The line of the main program that led here.
    main_line: u32,
    /// Clampings after the first, and setups that were begun.
    clampings: Vec<Clamped>,
    begun: BTreeSet<usize>,
    /// Frames of the machine file that do not count in a setup, because it has a place of its own.
    overruled: BTreeMap<usize, BTreeSet<&'static str>>,
    /// The part was clamped anew: the tool comes from above again.
    anew: bool,
    /// What is gathered now is a cut.
    cutting: bool,
    /// The canned cycle that is running, G-code times ten.
    cycle: Option<i32>,
    /// The first of what the end of the program does by itself: all it does where nothing moves any more.
    closes: usize,
    workingstep: Option<Workingstep>,
    /// The pallet was exchanged just now: the stop that follows is that of M60.
    pallet: bool,
    /// Whether the program stores a reference point of its own, once that was asked.
    stores: Option<bool>,
    /// Switches of the panel that the program has set.
    switches: BTreeMap<&'static str, bool>,
    /// Frames and tools by what they are.
    frame_numbers: BTreeMap<(&'static str, [[u64; 12]; 2]), u16>,
    /// What each is placed by.
    frame_places: Vec<Frame>,
    /// Frames of each name.
    named: BTreeMap<&'static str, u32>,
    tool_numbers: BTreeMap<(u32, String, [u64; 12]), u16>,
}

impl<'a> Gather<'a> {
    pub fn new(machine: &'a Machine, options: &'a Options, sources: &'a dyn Sources) -> Gather<'a> {
        let out = Gathered {
            items: Vec::new(),
            turns: Vec::new(),
            arcs: Vec::new(),
            tools: Vec::new(),
            frames: Vec::new(),
            wait_seconds: 0.0,
            curves: Curves { tolerance: options.tolerance, lines: BTreeSet::new() },
            by_direction: false,
        };
        let control = machine.kinematics().control();
        let (mill, planar) = (machine.kind == Kind::Mill, matches!(machine.chain, Chain::Planar3r(_)));
        Gather {
            machine,
            options,
            findings: Findings::new(sources),
            out,
            cells: Cells::new(machine, options.own_words),
            turns: Turns::new(machine),
            control,
            planar,
            // A mill's axes stand where they stood; what a program leaves out stays. A planar arm has no Z to be said.
            seen: [mill, mill, mill || planar],
            waiting: false,
            frame: None,
            tool: None,
            at: nose_at_home(machine),
            at_change: None,
            starts: mill,
            exchanged: false,
            rapids: false,
            probed: None,
            offset: false,
            shifted: [false; 3],
            offset_told: false,
            said: [!mill; 3],
            inserted: false,
            restarted: false,
            planned: false,
            goes_along: false,
            increments: Increments::default(),
            placed: None,
            path_said: false,
            ended: false,
            source: Source::default(),
            clamped: None,
            main_line: 0,
            clampings: Vec::new(),
            begun: BTreeSet::new(),
            overruled: BTreeMap::new(),
            anew: false,
            cutting: false,
            cycle: None,
            closes: usize::MAX,
            workingstep: None,
            pallet: false,
            stores: None,
            switches: BTreeMap::new(),
            frame_numbers: BTreeMap::new(),
            frame_places: Vec::new(),
            named: BTreeMap::new(),
            tool_numbers: BTreeMap::new(),
        }
    }

    pub fn run(&mut self, program: &Program) {
        let mut unnamed = places::Unnamed::new(program, self.machine);
        self.closes = closing(program);
        self.workingstep = crate::settle::led_to(program);
        self.planned = program.steps().any(|s| matches!(s.op, Op::Begin { marker: Marker::Workingstep, .. }));
        let mut cursor = program.cursor();
        while let Some(view) = cursor.next() {
            if self.ended || self.findings.list.full() {
                break;
            }
            self.source = leads_to(program, view.source);
            self.inserted = view.source.line == INSERTED;
            self.restarted |= self.inserted;
            // An error of its own; where the tool is afterwards nobody knows.
            self.rapids |= matches!(view.op, Op::RigidTap { .. });
            if !self.options.setups.is_empty() {
                self.main_line = main_line(program, view.source);
            }
            if !matches!(view.op, Op::Stop(_)) {
                self.pallet = false;
            }
            if self.leads_to_machine(program, &view) {
                continue;
            }
            if view.index == self.closes {
                self.retract();
            }
            self.goes_along = view.op.cuts() || self.says_height(&view);
            self.rests_on_unnamed(program, &view, &mut unnamed);
            self.op(&view);
        }
        if !self.ended {
            let (pose, state) = (*cursor.pose(), *cursor.state());
            self.end(&pose, &state);
        }
        self.setups_begin_safely();
        self.zones();
    }

    fn op(&mut self, view: &View<'_, '_>) {
        match view.op {
            Op::Rapid => self.rapid(view),
            Op::Linear | Op::Arc(_) | Op::Nurbs { .. } => self.cut(view),
            Op::Probe(kind) => self.probe(view, kind),
            Op::RigidTap { .. } => self.cannot("rigid tapping (G33.1)"),
            Op::SyncStart(s) if !s.velocity => self.cannot("a motion locked to the spindle's angle (G33, G33.1)"),
            Op::IndexerLock(..) => self.cannot("an indexing axis"),
            Op::SpindleOrient { .. } | Op::SpindleWait { .. } if self.control == Control::Position => self.yaws(view),
            Op::SpindleOrient { spindle, angle, direction } => self.orient(spindle, angle, direction),
            Op::SpindleWait { timeout, .. } => self.oriented(timeout),
            // Whoever says so knows which words are there: what rests on where it stopped has an operation of its own.
            Op::RunTime("probe") => {
                if let Some(probed) = &mut self.probed {
                    probed.loose = [false; 3];
                }
            }
            Op::RunTime(what) => self.findings.say(code::ROBOT_RUN_TIME, Some(view.source), &[what.to_string()]),
            Op::ToolOffset { .. } => self.tool_offset(view),
            Op::PathMode(_) => self.path_said = true,
            Op::Begin { marker: Marker::Cycle, code, .. } => self.cycle = Some(code),
            Op::Close(Marker::Cycle) => self.cycle = None,
            Op::End => {
                self.end(view.start, view.state);
                self.ended = true;
            }
            _ => self.action(view),
        }
    }

    /// Whether a move has a word for Z, or brings the tool home.
    fn says_height(&self, view: &View<'_, '_>) -> bool {
        let letters = || Letters::at(self.findings.sources, view.source.file, view.source.line);
        view.op.moves() && (self.planned || self.inserted || letters().is_none_or(|l| l.has(b'z') || !l.names_axes()))
    }

    /// A mill's control has the spindle's nose where G43 finds no length, whatever the machine file has of the tool.
    fn no_length(&mut self, view: &View<'_, '_>) {
        if self.machine.kind != Kind::Mill || view.state.tool_offset[2] != 0.0 {
            return;
        }
        let number = u32::try_from(view.state.tool).unwrap_or(0);
        let tools = &self.machine.cell.tools;
        let file = tools.get(&number).map(|t| self.machine.tool_length(t));
        let unknown = file.is_none() && number != 0 && !tools.is_empty() && self.options.no_tool_table;
        let file = file.unwrap_or(0.0);
        if !unknown && file.abs() <= 1e-3 || !Letters::at(self.findings.sources, view.source.file, view.source.line).is_some_and(|l| l.g(430)) {
            return;
        }
        if unknown {
            self.findings.once_each(code::ROBOT_UNKNOWN_TOOL, Some(self.source), &[number.to_string()]);
        } else {
            let args = [number.to_string(), "0.000".into(), format!("{file:.3}"), "the offset holds, as on the control".into()];
            self.findings.once_each(code::ROBOT_TOOL_LENGTH, Some(self.source), &args);
        }
    }

    /// The machine stands still, the program's coordinates change. Where the tool stands is known, or it is said anew.
    fn tool_offset(&mut self, view: &View<'_, '_>) {
        self.no_length(view);
        let same = |i: usize| view.start.axes[i] == view.end.axes[i];
        if let Some(probed) = &mut self.probed {
            (0..3).for_each(|i| probed.loose[i] |= !same(i));
            return;
        }
        if self.at.is_some() && !self.exchanged {
            if !(0..3).all(same) {
                let before = if self.offset { self.shifted } else { [false; 3] };
                self.shifted = [0, 1, 2].map(|i| before[i] || !same(i));
                (self.offset, self.offset_told) = (true, false);
            }
            return;
        }
        for i in 0..3 {
            self.seen[i] &= same(i);
        }
    }

    fn action(&mut self, view: &View<'_, '_>) {
        let state = view.state;
        match view.op {
            Op::Dwell(t) if t > 0.0 => {
                self.out.wait_seconds += t;
                self.act(Action::Dwell(t));
            }
            Op::ToolChange(_) => {
                // On a mill the tool changer brings no other place.
                self.exchanged = self.machine.kind != Kind::Mill;
                if let Some(probed) = &mut self.probed {
                    probed.loose = [true; 3];
                }
                self.change(state.tool);
            }
            // What is on is on the first spindle; the others are only told to stop.
            Op::SpindleSpeed { speed, spindle } if spindle > 0 && speed != 0.0 => self.cannot("a second spindle ($)"),
            Op::SpindleTurn { turn, spindle } if spindle > 0 && turn != Turn::Stop => self.cannot("a second spindle ($)"),
            Op::SpindleSpeed { spindle, .. } | Op::SpindleTurn { spindle, .. } if spindle > 0 => {}
            Op::SpindleSpeed { speed, spindle } => self.speed_word(state, spindle, speed),
            Op::SpindleTurn { turn, spindle } => self.turn_word(state, spindle, turn),
            Op::SpindleMode { surface: Some(_), .. } => self.cannot("constant surface speed (G96)"),
            Op::Mist(on) => self.coolant("M7", on, state),
            Op::Flood(on) => self.coolant("M8", on, state),
            Op::DigitalOut { index, on, synced } => {
                let made = self.cells.digital(index, on, synced);
                self.numbered(made);
            }
            Op::AnalogOut { index, value, synced } => {
                let made = self.cells.analog(index, value, synced);
                self.numbered(made);
            }
            Op::InputWait { index, digital, wait, timeout } => self.input(index, digital, wait, timeout),
            Op::UserM { code, p, q } => self.user(code, p, q),
            Op::Override(which, free) => self.switch(which, free),
            Op::Note(Note::Message, text) => self.act(Action::Message(text.to_string())),
            Op::Note(_, text) if text.starts_with("interpreter:") => {}
            Op::Note(_, text) => self.act(Action::Comment(text.to_string())),
            Op::Begin { marker: Marker::Contour, .. } => {}
            Op::Begin { text, .. } => {
                if let Some(step) = Workingstep::begun_by(&view.op) {
                    self.workingstep = Some(step);
                }
                if !text.is_empty() {
                    self.act(Action::Comment(text.to_string()));
                }
            }
            // The shuttle that M30 and M60 move; M60 stops the program besides.
            Op::Stop(Stop::Pallet) => self.pallet = true,
            Op::Stop(stop) => self.stop(stop),
            _ => {}
        }
    }

    fn cannot(&mut self, what: &str) {
        self.findings.say(code::ROBOT_CANNOT, Some(self.source), &[what.to_string()]);
    }
    fn act(&mut self, action: Action) {
        self.out.items.push(Item::Do(Step { action, source: Some(self.source) }));
    }
    /// Signals of a word, or what the operator must do.
    fn made(&mut self, made: crate::cell::Made) {
        if let Some(word) = made.by_hand {
            self.findings.once_each(code::ROBOT_BY_HAND, Some(self.source), &[word]);
        }
        made.actions.into_iter().for_each(|a| self.act(a));
    }

    /// The work frame in force; none when it isn't known.
    fn work(&mut self, state: &State) -> Option<u16> {
        let name = work_name(state.work);
        let setup = self.setup();
        if setup != self.clamped {
            self.clamp(setup);
        }
        let placement = setup.and_then(|i| self.options.setups[i].part);
        let places = |n: &str| self.machine.cell.frames.get(n);
        let any = (1..=9).find(|n| places(work_name(*n)).is_some());
        let placed = match (places(name), any, placement) {
            (row, _, Some(part)) => {
                if let (Some(_), Some(setup)) = (row, setup) {
                    self.overruled.entry(setup).or_default().insert(name);
                }
                part
            }
            (Some(frame), _, _) => self.machine.cell.carried(*frame),
            (None, Some(n), _) => {
                self.findings.say(code::ROBOT_UNKNOWN_FRAME, Some(self.source), &[name.into(), work_name(n).into()]);
                return None;
            }
            (None, None, None) => self.machine.cell.part_in_base(),
        };
        if self.placed.replace(placed).is_some_and(|p| p != placed) {
            // Coordinates of another place: nothing is known of the tool in them.
            self.offset = false;
        }
        let (o, l) = (&state.work_offset, &state.local_offset);
        let frame = placed
            .then(&Frame { turn: rot_z(state.rotation), position: [o[0], o[1], o[2]] })
            .then(&Frame::shift([l[0], l[1], l[2]]));
        let key = (name, [bits(&frame), bits(&placed)]);
        let index = match self.frame_numbers.get(&key) {
            Some(index) => *index,
            None => {
                let Ok(index) = u16::try_from(self.out.frames.len()) else {
                    self.cannot("more than 65536 work frames (every other G92 or G10 makes one)");
                    return None;
                };
                let more = self.named.entry(name).or_insert(0);
                *more += 1;
                let name = if *more == 1 { name.to_string() } else { format!("{name}_{more}") };
                self.out.frames.push(WorkFrame { name, frame });
                self.frame_places.push(placed);
                self.frame_numbers.insert(key, index);
                index
            }
        };
        if self.frame != Some(index) {
            if let (Some(probed), Some(old)) = (&mut self.probed, self.frame)
                && !same_turn(&self.out.frames[usize::from(old)].frame.turn, &frame.turn)
            {
                probed.loose = [true; 3];
            }
            self.act(Action::UseFrame(index));
            self.frame = Some(index);
        }
        Some(index)
    }

    /// The tool point in force.
    fn tool(&mut self, state: &State) -> Option<u16> {
        let number = u32::try_from(state.tool).unwrap_or(0);
        let length = state.tool_offset[2];
        // On a mill the spindle's nose is what moves until G43 says otherwise.
        let known = self.machine.cell.tools.get(&number).filter(|_| self.machine.kind != Kind::Mill || length != 0.0);
        let nose = self.machine.cell.tool_frame(u32::MAX);
        let (name, frame, mass) = match known {
            Some(t) => {
                let file = self.machine.tool_length(t);
                if length != 0.0 && (length - file).abs() > 1e-3 && self.goes_along {
                    let args = [number.to_string(), format!("{length:.3}"), format!("{file:.3}"), "the machine file holds".into()];
                    self.findings.once_each(code::ROBOT_TOOL_LENGTH, Some(self.source), &args);
                }
                (t.name.clone(), nose.then(&t.frame), t.mass)
            }
            None if number == 0 && length == 0.0 => ("tool0".to_string(), nose, None),
            None if length != 0.0 => {
                if state.tool_offset[0] != 0.0 || state.tool_offset[1] != 0.0 {
                    self.cannot("a tool offset in X or Y");
                    return None;
                }
                (format!("tool{number}"), self.machine.tool_of_length(length), None)
            }
            None if self.machine.kind != Kind::Robot => (format!("tool{number}"), nose, None),
            None => {
                self.findings.once_each(code::ROBOT_UNKNOWN_TOOL, Some(self.source), &[number.to_string()]);
                return None;
            }
        };
        if self.control == Control::Position && frame.position[..2].iter().any(|v| v.abs() > TINY) {
            // Its place follows from the turn, and the turn from its place: only the other way round is worked out.
            self.cannot(&format!("a tool beside the axis of a platform that turns with its place (`{name}`)"));
            return None;
        }
        let key = (number, name, bits(&frame));
        let index = match self.tool_numbers.get(&key) {
            Some(index) => *index,
            None => {
                let Ok(index) = u16::try_from(self.out.tools.len()) else {
                    self.cannot("more than 65536 tools (every other tool length makes one)");
                    return None;
                };
                self.out.tools.push(Tool { number, name: key.1.clone(), frame, mass });
                self.tool_numbers.insert(key, index);
                index
            }
        };
        if self.tool != Some(index) {
            self.act(Action::UseTool(index));
            let old = self.tool.map_or(nose, |old| self.out.tools[usize::from(old)].frame);
            self.other_point(&old, index);
            self.tool = Some(index);
        }
        Some(index)
    }

    /// Another tool point on a machine that stands still; a changer leaves it nobody knows where.
    fn other_point(&mut self, old: &Frame, new: u16) {
        let step = old.inverse().then(&self.out.tools[usize::from(new)].frame);
        // Beside the tool's axis the point depends on the turn about it, which is chosen later.
        let along = step.position[0].abs() < TINY && step.position[1].abs() < TINY && same_turn(&step.turn, &Frame::IDENTITY.turn);
        let stands = self.at.filter(|_| along).map(|at| at.then(&step));
        (self.at, self.at_change) = if self.exchanged { (None, stands) } else { (stands, None) };
    }

    /// How the tool is turned in the work frame; none when the machine file doesn't say.
    fn turn(&mut self, pose: &Pose, state: &State) -> Option<M3> {
        self.out.by_direction |= pose.tool_axis.is_some();
        match self.turns.of(pose, state) {
            Ok(turn) => Some(turn),
            Err(unread) => {
                if let Some((code, args)) = unread.told(self.machine) {
                    self.findings.once_each(code, Some(self.source), &args);
                }
                None
            }
        }
    }

    fn turn_index(&mut self, turn: M3) -> u32 {
        if self.out.turns.last() != Some(&turn) {
            self.out.turns.push(turn);
        }
        u32::try_from(self.out.turns.len() - 1).unwrap_or(u32::MAX)
    }

    /// A machine whose tool turns with its place can't do what needs a direction.
    fn yaws(&mut self, view: &View<'_, '_>) {
        let frame = self.frame.map_or(self.machine.cell.part_in_base(), |f| self.out.frames[usize::from(f)].frame);
        let k = self.machine.kinematics();
        let yaw = |p: [f64; 3]| {
            let joints = k.inverse_frame(&Frame::shift(frame.apply(p))).ok()?;
            let pose = k.forward(&joints.first()?.joints).ok()?;
            Some(format!("{:.2}°", pose.rotation[2].to_degrees()))
        };
        let show = |p: [f64; 3]| yaw(p).unwrap_or_else(|| "its place".into());
        let args = [show(view.start.xyz()), show(view.end.xyz())];
        self.findings.say(code::ROBOT_YAWS, Some(self.source), &args);
    }

    fn foreign(&mut self, view: &View<'_, '_>) -> bool {
        let moved = (6..9).any(|i| view.start.axes[i] != view.end.axes[i]);
        if moved {
            self.cannot("a move of U, V or W");
        }
        if self.control == Control::Position {
            // The way to a restart begins anywhere.
            let words = |i: usize| view.start.axes[i] != view.end.axes[i] || self.restarted && view.end.axes[i] != 0.0;
            let turned = !self.inserted && (3..6).any(words) || view.end.spin.is_some();
            let leaned = view.end.tool_axis.is_some_and(|a| a[2] < 1.0 - 1e-9);
            if turned || leaned {
                self.yaws(view);
                return true;
            }
        }
        moved
    }

    fn free(&self, tool: u16) -> bool {
        if self.machine.cell.spindle.is_none() || self.control != Control::Full || self.machine.joints.len() < 6 {
            return false;
        }
        let f = &self.out.tools[usize::from(tool)].frame;
        let on_axis = f.position[0].abs() < TINY && f.position[1].abs() < TINY && f.turn[2][2].abs() > 1.0 - 1e-12;
        !on_axis
    }

    /// A tool frame of a work frame in the base.
    fn base(&self, frame: u16, position: [f64; 3], turn: u32) -> Frame {
        self.out.frames[usize::from(frame)].frame.then(&Frame { turn: self.out.turns[turn as usize], position })
    }

    fn push(&mut self, m: Move) {
        if let (true, Some(at)) = (self.starts, self.at) {
            // A mill goes straight everywhere, from where it stands.
            let here = self.out.frames[usize::from(m.frame)].frame.inverse().then(&at);
            let turn = self.turn_index(here.turn);
            let speed = self.machine.cell.joint_share();
            let start = Move { way: Way::Joint, position: here.position, turn, speed, length: 0.0, rapid: true, source: None, zone: Zone::Stop, ..m };
            self.out.items.push(Item::Move(start));
        }
        self.starts = false;
        self.at = Some(self.base(m.frame, m.position, m.turn));
        (self.at_change, self.probed) = (None, None);
        (self.exchanged, self.rapids) = (false, false);
        self.out.items.push(Item::Move(m));
    }

    /// The tool comes to where a cut begins. Without a rapid of the program that may only be where it stands.
    fn come_to_cut(&mut self, frame: u16, tool: u16, position: [f64; 3], turn: u32) {
        let here = self.base(frame, position, turn);
        if self.at.is_some_and(|at| norm(sub(at.position, here.position)) <= NEAR && same_turn(&at.turn, &here.turn)) {
            return;
        }
        if let Some(at) = self.at.or(self.at_change).filter(|_| !self.rapids)
            && norm(sub(at.position, here.position)) > 1e-3
        {
            let stands = self.out.frames[usize::from(frame)].frame.inverse().apply(at.position);
            self.nowhere(stands, position);
        }
        self.come(frame, tool, position, turn);
    }

    /// Comes to a place by rapid; the first time from home, from above.
    fn come(&mut self, frame: u16, tool: u16, position: [f64; 3], turn: u32) {
        let first = std::mem::take(&mut self.anew) || !self.out.items.iter().any(|i| matches!(i, Item::Move(_)));
        let here = self.base(frame, position, turn);
        let length = self.at.map_or(0.0, |at| norm(sub(here.position, at.position)));
        let joint = self.machine.cell.joint_share();
        let m = Move {
            way: Way::Joint,
            position,
            turn,
            frame,
            tool,
            speed: joint,
            zone: self.zone_of_rapid(),
            length,
            rapid: true,
            free: self.free(tool),
            ours: false,
            probe: None,
            source: Some(self.source),
        };
        if first && self.comes_from_above() {
            let above = self.above(position, turn);
            self.push(Move { position: above, ours: true, source: None, zone: Zone::Stop, ..m });
            return self.push(Move { way: Way::Line, speed: self.rapid_speed(), length: self.options.approach, ..m });
        }
        // Away from what was touched it goes straight.
        let probed = self.probed.is_some();
        let linear = self.at.is_some_and(|at| same_turn(&at.turn, &here.turn) && (probed || self.straight(at.position, &here)));
        if linear {
            self.push(Move { way: Way::Line, speed: self.rapid_speed(), ..m });
        } else {
            self.push(m);
        }
    }

    /// A rapid in a line: the machine does all so, or it goes along the tool's own axis, as in a hole.
    fn straight(&self, from: [f64; 3], to: &Frame) -> bool {
        if self.machine.cell.rapid == Some(Rapid::Linear) || self.machine.kind == Kind::Mill {
            return true;
        }
        let z = to.axis(2);
        let way = sub(to.position, from);
        let length = norm(way);
        length > TINY && norm(sub(way, scale(z, dot(way, z)))) < 1e-6
    }

    fn rapid_speed(&self) -> f64 {
        self.machine.cell.line_rapid()
    }
    fn comes_from_above(&self) -> bool {
        self.options.approach > 0.0 && self.machine.kind == Kind::Robot && self.control != Control::Position && !self.planar
    }
    /// A place straight above along the tool.
    fn above(&self, position: [f64; 3], turn: u32) -> [f64; 3] {
        let m = &self.out.turns[turn as usize];
        [0, 1, 2].map(|i| position[i] - m[i][2] * self.options.approach)
    }

    fn rapid(&mut self, view: &View<'_, '_>) {
        if self.foreign(view) {
            return;
        }
        for i in 0..3 {
            self.seen[i] |= view.start.axes[i] != view.end.axes[i];
        }
        self.waiting = self.seen != [true; 3];
        self.rapids = true;
        if !self.waiting {
            self.go_to(view.start, view.end, view.state);
        }
    }

    fn go_to(&mut self, start: &Pose, end: &Pose, state: &State) {
        // What is not known of one says nothing of the others: all are asked.
        let (Some(frame), Some(tool), Some(turn)) = (self.work(state), self.tool(state), self.turn(end, state)) else { return };
        if self.turns_before_coming(start, end) {
            self.waiting = true;
            return;
        }
        let turn = self.turn_index(turn);
        if !self.leaves_probed(start, end) {
            return;
        }
        let mut to = end.xyz();
        let lag = self.lag(frame, start.xyz());
        if lag != [0.0; 3] {
            let Some((.., held)) = self.held(Op::Rapid, start, end, state, lag) else { return };
            to = held.xyz();
        }
        let words = self.words(start, end);
        if self.machine.kind == Kind::Mill && words > 0.0 && self.at.is_some() {
            let from = self.turn(start, state).map(|t| self.turn_index(t)).unwrap_or(turn);
            let length = norm(sub(to, add(start.xyz(), lag)));
            let m = Move {
                way: Way::Line,
                position: to,
                turn: from,
                frame,
                tool,
                speed: self.rapid_speed(),
                zone: self.zone_of_rapid(),
                length,
                rapid: true,
                free: false,
                ours: false,
                probe: None,
                source: Some(self.source),
            };
            let [mut start, mut end] = [*start, *end];
            for i in 0..3 {
                start.axes[i] += lag[i];
                end.axes[i] = to[i];
            }
            return self.turning(&View { index: 0, op: Op::Rapid, start: &start, end: &end, state, source: self.source }, m, words);
        }
        let here = self.base(frame, to, turn);
        if self.probed.is_some() || self.at.is_none_or(|at| norm(sub(at.position, here.position)) > TINY || !same_turn(&at.turn, &here.turn)) {
            self.come(frame, tool, to, turn);
        }
    }

    /// How far rotary words go, as LinuxCNC counts it for a feed of theirs, rad.
    fn words(&self, start: &Pose, end: &Pose) -> f64 {
        libm::sqrt((3..6).map(|i| (end.axes[i] - start.axes[i]) * (end.axes[i] - start.axes[i])).sum())
    }

    fn zone_of_rapid(&self) -> Zone {
        match self.machine.cell.zones.default {
            Some(z) if z > 0.0 => Zone::Blend(z),
            _ => Zone::Stop,
        }
    }

    fn zone(&self, state: &State) -> Zone {
        let zones = &self.machine.cell.zones;
        let size = match state.path {
            PathMode::ExactStop => 0.0,
            _ if !self.path_said => zones.default.unwrap_or(0.0),
            PathMode::ExactPath => 0.0,
            PathMode::Blend(t) if t > 0.0 => t,
            PathMode::Blend(_) => zones.default.or(zones.max).unwrap_or(CORNER),
        };
        let size = zones.max.map_or(size, |m| size.min(m));
        if size > 0.0 { Zone::Blend(size) } else { Zone::Stop }
    }

    /// Speed of the rotary axes while the tool point stands still, rad/s.
    fn turn_speed(&mut self, state: &State, words: f64) -> Option<f64> {
        match (state.sync, state.feed_mode) {
            (None, FeedMode::PerTime) if state.feed_angular > 0.0 => Some(state.feed_angular),
            (None, FeedMode::Inverse) if state.feed > 0.0 => Some(words * state.feed),
            _ => self.speed(state, 0.0),
        }
    }

    /// Speed of the tool point, mm/s.
    fn speed(&mut self, state: &State, length: f64) -> Option<f64> {
        let rpm = |spindle: i32| {
            let s = state.spindle(spindle);
            if s.surface.is_some() || s.turn == Turn::Stop { 0.0 } else { s.speed.abs() }
        };
        let speed = match (state.sync, state.feed_mode) {
            (Some(s), _) => s.per_rev * rpm(s.spindle) / 60.0,
            (None, FeedMode::Inverse) if length > 0.0 => length * state.feed,
            (None, FeedMode::PerRev) => state.feed * rpm(state.feed_spindle) / 60.0,
            _ => state.feed,
        };
        if speed > 0.0 && speed.is_finite() {
            return Some(speed);
        }
        let why = match state.feed_mode {
            FeedMode::PerRev => "feed per revolution needs a turning spindle",
            FeedMode::Inverse => "inverse time needs an F above 0 in this block",
            FeedMode::PerTime => "there is no feed",
        };
        self.findings.say(code::ROBOT_FEED, Some(self.source), &[why.to_string()]);
        None
    }

    fn cut(&mut self, view: &View<'_, '_>) {
        if self.foreign(view) {
            return;
        }
        let state = view.state;
        self.seen = [true; 3];
        self.waiting = false;
        self.cutting = true;
        let places = (self.work(state), self.tool(state));
        self.cutting = false;
        let turns = (self.turn(view.start, state), self.turn(view.end, state));
        let ((Some(frame), Some(tool)), (Some(from), Some(to))) = (places, turns) else { return };
        if !self.leaves_probed(view.start, view.end) {
            return;
        }
        let lag = self.lag(frame, view.start.xyz());
        let (op, first, last);
        let view = if lag == [0.0; 3] {
            view
        } else {
            let Some(held) = self.held(view.op, view.start, view.end, state, lag) else { return };
            (op, first, last) = held;
            &View { op, start: &first, end: &last, ..*view }
        };
        let length = match gr_ir::geometry::length(&view.op, view.start, view.end) {
            gr_ir::geometry::Length::Linear(mm) => mm,
            gr_ir::geometry::Length::Angular(_) => 0.0,
        };
        let angle = norm(rotation_vector(&product(&transpose(&from), &to)));
        let words = (3..6).fold(0.0f64, |a, i| a.max((view.end.axes[i] - view.start.axes[i]).abs()));
        if length <= TINY && words == 0.0 && angle < 1e-12 {
            return;
        }
        let on_the_spot = length <= TINY;
        let mill = self.machine.kind == Kind::Mill;
        let asked = if on_the_spot && mill { self.turn_speed(state, self.words(view.start, view.end)) } else { self.speed(state, length) };
        let Some(speed) = asked else { return };
        let start = self.turn_index(from);
        if self.probed.is_none() {
            self.come_to_cut(frame, tool, view.start.xyz(), start);
        } else if angle.max(words) > 1e-12 || !matches!(view.op, Op::Linear) || state.feed_mode == FeedMode::Inverse {
            return self.rests_on_probed();
        }
        if on_the_spot && !mill {
            self.findings.once(code::ROBOT_TURN_SPEED, Some(self.source), &[]);
        }
        let m = Move {
            way: Way::Line,
            position: view.end.xyz(),
            turn: start,
            frame,
            tool,
            speed,
            zone: self.zone(state),
            // From where the probe stopped its length is not known: no corner.
            length: if self.probed.is_some() { 0.0 } else { length },
            rapid: false,
            free: self.free(tool),
            ours: false,
            probe: None,
            source: Some(self.source),
        };
        match view.op {
            _ if angle.max(words) > 1e-12 => self.turning(view, m, angle.max(words)),
            Op::Arc(arc) => self.arc(view, ArcShape::new(&arc, view.start, view.end), m),
            Op::Nurbs { .. } => self.pieces(view, m),
            _ => self.push(m),
        }
    }

    /// A move in which the tool turns: cut so that words and directions agree within a small angle.
    fn turning(&mut self, view: &View<'_, '_>, m: Move, angle: f64) {
        if !matches!(view.op, Op::Linear | Op::Rapid) {
            self.curved();
        }
        let by_turn = libm::ceil(angle / TURN_STEP - 1e-9).clamp(1.0, 10_000.0) as usize;
        let mut points: Vec<[f64; 9]> = vec![view.start.axes];
        gr_ir::geometry::flatten(&view.op, view.start, view.end, self.options.tolerance, |p| points.push(*p));
        let each = by_turn.div_ceil(points.len() - 1).max(1);
        let total = (points.len() - 1) * each;
        let axis = |share: f64| match (view.start.tool_axis, view.end.tool_axis) {
            (Some(a), Some(b)) => {
                let v = [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * share);
                let l = norm(v);
                if l > 1e-9 { Some(scale(v, 1.0 / l)) } else { Some(b) }
            }
            (_, b) => b,
        };
        let mut done = 0;
        let within = inside(m.zone, m.length);
        for pair in points.windows(2) {
            for k in 1..=each {
                done += 1;
                let zone = if done == total { m.zone } else { within };
                let share = k as f64 / each as f64;
                let axes: [f64; 9] = std::array::from_fn(|i| pair[0][i] + (pair[1][i] - pair[0][i]) * share);
                let whole = done as f64 / total as f64;
                let pose = Pose { axes, tool_axis: axis(whole), spin: view.end.spin };
                let Some(turn) = self.turn(&pose, view.state) else { return };
                let turn = self.turn_index(turn);
                self.push(Move { position: pose.xyz(), turn, length: m.length / total as f64, zone, ..m });
            }
        }
    }

    /// This line's curve becomes straight pieces.
    fn curved(&mut self) {
        self.out.curves.lines.insert((self.source.file.0, self.source.line));
    }

    fn pieces(&mut self, view: &View<'_, '_>, m: Move) {
        self.curved();
        let mut points: Vec<[f64; 3]> = Vec::new();
        gr_ir::geometry::flatten(&view.op, view.start, view.end, self.options.tolerance, |p| points.push([p[0], p[1], p[2]]));
        let mut last = view.start.xyz();
        for p in points {
            let length = norm(sub(p, last));
            if length > TINY {
                self.push(Move { position: p, length, ..m });
                last = p;
            }
        }
    }

    fn arc(&mut self, view: &View<'_, '_>, shape: ArcShape, m: Move) {
        let mismatch = (shape.radius - shape.end_radius).abs();
        if shape.rise.abs() > TINY || mismatch > self.options.tolerance || !(shape.radius > TINY) {
            return self.pieces(view, m);
        }
        let count = libm::ceil(shape.sweep.abs() / PI - 1e-9).max(1.0) as usize;
        let angle = shape.sweep.abs() / count as f64;
        let sagitta = shape.radius * (1.0 - libm::cos(angle / 2.0));
        if sagitta < self.options.tolerance.min(1e-3) && shape.sweep.abs() < 0.5 {
            self.curved();
            return self.push(m);
        }
        let normal = if shape.sweep < 0.0 { scale(shape.normal, -1.0) } else { shape.normal };
        for k in 0..count {
            let share = |s: f64| (k as f64 + s) / count as f64;
            let position = if k + 1 == count { view.end.xyz() } else { shape.point(share(1.0)) };
            let piece = ArcPiece { center: shape.center, normal, via: shape.point(share(0.5)), angle };
            self.out.arcs.push(piece);
            let index = u32::try_from(self.out.arcs.len() - 1).unwrap_or(u32::MAX);
            let zone = if k + 1 == count { m.zone } else { through(m.zone) };
            self.push(Move { way: Way::Arc(index), position, length: m.length / count as f64, zone, ..m });
        }
    }

    /// Retract, everything off.
    fn end(&mut self, pose: &Pose, state: &State) {
        if self.waiting && (self.anew || !self.out.items.iter().any(|i| matches!(i, Item::Move(_)))) {
            // Rapids alone that left a coordinate where it was, or only turned the tool.
            self.go_to(pose, pose, state);
            self.retract();
        } else if self.closes == usize::MAX {
            self.retract();
        }
        let made = self.cells.off();
        self.made(made);
    }

    /// Straight up from where the tool is.
    fn retract(&mut self) {
        let last = self.out.items.iter().rev().find_map(|i| if let Item::Move(m) = i { Some(*m) } else { None });
        if let Some(m) = last.filter(|_| self.comes_from_above()) {
            let m = self.back_from_probed(m);
            let above = self.above(m.position, m.turn);
            let speed = self.rapid_speed();
            let length = self.options.approach;
            self.push(Move { way: Way::Line, position: above, speed, length, rapid: true, ours: true, zone: Zone::Stop, source: None, ..m });
        }
    }

    /// Zones: at most half of both neighbours, none before actions and where a cut and a rapid meet.
    fn zones(&mut self) {
        // Length of the next move, whether it is a rapid, whether all joints go together.
        let mut next = (0.0, false, false);
        for item in self.out.items.iter_mut().rev().filter(|i| !silent(i)) {
            let Item::Move(m) = item else {
                next = (0.0, false, false);
                continue;
            };
            let probe = m.probe.is_some();
            let this = if probe { (0.0, false, false) } else { (m.length, m.rapid, m.way == Way::Joint) };
            let (length, rapid, joint) = std::mem::replace(&mut next, this);
            if let Zone::Blend(size) = m.zone
                && size > 0.0
            {
                let fits = m.rapid == rapid && (m.way == Way::Joint) == joint;
                let size = size.min(m.length / 2.0).min(length / 2.0);
                m.zone = if fits && size > 1e-6 { Zone::Blend(size) } else { Zone::Stop };
            }
        }
    }
}

/// Whether two turns are one but for rounding.
pub(crate) fn same_turn(a: &M3, b: &M3) -> bool {
    a.iter().flatten().zip(b.iter().flatten()).all(|(x, y)| (x - y).abs() < 1e-9)
}

/// The first operation of the block that ends the program behind which it moves nothing: M2 and M30 stop the spindle by themselves,
/// which must not happen in the part.
fn closing(program: &Program) -> usize {
    let end = program.steps().position(|s| s.op == Op::End).and_then(|i| program.get(i));
    let Some(end) = end else { return usize::MAX };
    let before = (0..end.index).rev().map_while(|i| program.get(i).filter(|s| s.source == end.source && !s.op.moves()));
    before.last().map_or(end.index, |s| s.index)
}

/// The part was clamped anew.
struct Clamped {
    /// Items before it.
    item: usize,
    setup: Option<usize>,
    source: Source,
    /// The program cuts at once.
    cutting: bool,
}

/// A frame to be looked up by; both zeros are one.
fn bits(frame: &Frame) -> [u64; 12] {
    let mut all = frame.turn.iter().flatten().chain(&frame.position).map(|v| (v + 0.0).to_bits());
    std::array::from_fn(|_| all.next().unwrap_or_default())
}

/// What makes no stop.
fn silent(item: &Item) -> bool {
    matches!(item, Item::Do(Step { action: Action::Comment(_) | Action::UseFrame(_), .. }))
}

/// Between the halves of one arc nothing stops.
fn through(zone: Zone) -> Zone {
    match zone {
        Zone::Stop => Zone::Blend(0.1),
        z => z,
    }
}

/// Between the parts of one motion that turns the tool nothing stops either, and no corner is cut where none is asked for.
fn inside(zone: Zone, length: f64) -> Zone {
    match zone {
        Zone::Blend(_) if length > TINY => zone,
        _ => Zone::Blend(0.0),
    }
}

/// The spindle's nose of a mill that stands at home.
fn nose_at_home(machine: &Machine) -> Option<Frame> {
    let home = crate::plan::home_joints(machine).filter(|_| machine.kind == Kind::Mill)?;
    let flange = machine.kinematics().forward_frame(&home).ok()?;
    Some(flange.then(&machine.cell.tool_frame(u32::MAX)))
}

/// `G54` … `G59.3`.
pub(crate) fn work_name(number: u8) -> &'static str {
    const NAMES: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
    NAMES[usize::from(number.clamp(1, 9)) - 1]
}
