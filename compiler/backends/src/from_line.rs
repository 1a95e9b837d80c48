//! A program from a line on: what was in force there is set again, the tool goes to the place over a safe
//! height, and the rest follows. The result is motion IR like any other, so every back end can write it.

mod approach;
mod heights;
mod known;

pub(crate) use approach::is_lathe;

use std::collections::BTreeMap;

use crate::sources::{SYSTEMS, Words, sets_here};
use gr_ir::Sources;
use heights::{Heights, UPRIGHT};
use known::{Known, Said, says};
use gr_ir::{Axes, Builder, FrameId, Marker, Note, Op, Override, PathMode, Pose, Program, Source, State, Turn, Units};
use gr_text::{Diagnostic, FileId, code};

/// Line number of operations that no source line asked for.
pub const INSERTED: u32 = u32::MAX;

/// Heights that differ by less, mm, are the same.
const SAME_HEIGHT: f64 = 1e-6;

/// What can be chosen.
#[derive(Clone, Copy, Default)]
pub struct Options<'a> {
    /// Height of the approach in the work frame in force, mm, along the tool where that is tilted; none = the highest point of the
    /// program.
    pub safe_z: Option<f64>,
    /// Axes whose numbers rest on what no file names. The tool is brought there only where the program cuts before it
    /// names them.
    pub unsure: [bool; 9],
    /// A file names the work offsets and reference points of the machine: where G28, G30 and G53 go is known.
    pub stored: bool,
    /// How high and how far out the approach goes, where that has been found before; goes before `safe_z`.
    pub room: Option<Room>,
    /// Direction from the tool point to the spindle in the work frame, where a machine is known; else it is Z.
    pub tool: Option<&'a ToolDirection<'a>>,
    /// Where a length is in force, numbers are places of the tip of the tool that is carried, as a machine file has it: not of what the
    /// length makes of them.
    pub tips: bool,
    /// Where rotary axes turn alone, the slides stay that stand at a place of the machine, and the tool point doesn't: a mill's.
    pub slides: bool,
}

type V3 = [f64; 3];

/// Direction of a tool that stands upright.
const UP: V3 = [0.0, 0.0, 1.0];

/// Direction from the tool point to the spindle in the work frame; none where the machine can't tell it.
pub type ToolDirection<'a> = dyn Fn(&Pose, &State) -> Option<V3> + 'a;

/// How high and how far out an approach goes, in the work frame in force, mm; heights go along the tool where it is tilted.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Room {
    /// Above the part, spindle and all.
    pub safe: f64,
    /// As low as the program's own rapids go sideways, if any do.
    pub lowest: Option<f64>,
    /// Outside of the part on a lathe: the greatest X.
    pub out: f64,
}

/// A program that begins later, and what there is to say about it.
#[derive(Clone, PartialEq, Debug)]
pub struct Restart {
    /// The program.
    pub program: Program,
    /// Warnings.
    pub notes: Vec<Diagnostic>,
    /// Where the program has brought the tool, axis by axis in the work frame in force, mm and rad, as far as that is a place for it to go
    /// to. None: it stays where it is.
    pub goal: [Option<f64>; 9],
    /// Where the program itself first sends each axis in the work frame; none: nowhere by a word of its own.
    pub named: [Option<f64>; 9],
    /// By how much G92 has shifted the axes it named, mm and rad: numbers that come from where the tool stood.
    pub shifted: [Option<f64>; 9],
    /// By how much G10 L20 has changed the axes it named of work offsets, by their number: the same.
    pub kept: BTreeMap<u8, [Option<f64>; 9]>,
    /// Offsets that it sets before it begins, axis by axis, mm and rad: G92 (0), work offsets by their number, the tool's (10).
    pub offsets: BTreeMap<u8, Axes>,
    /// How high and how far out it is brought there.
    pub room: Room,
}

/// Lets a program begin at `line` (from 1) of `file`.
pub fn from_line(
    program: &Program,
    file: FileId,
    line: u32,
    options: &Options<'_>,
    sources: &dyn Sources,
) -> Result<Restart, Vec<Diagnostic>> {
    let target = line.saturating_sub(1);
    let place = sources.place(Source { file, line: target, ..Source::default() });
    let Some(found) = find(program, file, target) else {
        return Err(vec![Diagnostic::new(code::FROM_LINE_NOTHING_LEFT, place.0, place.1, &[line.to_string()])]);
    };
    let mut notes = Vec::new();
    let fault = |code| Err(vec![Diagnostic::new(code, place.0, place.1, &[])]);
    if compensated(program, found.index, target, sources) {
        return fault(code::FROM_LINE_INSIDE_COMPENSATION);
    }
    let cursor = program.cursor_at(found.index);
    if inside_cycle(program, found.index) || cursor.state().sync.is_some() || threaded(program, found.index) {
        return fault(code::FROM_LINE_INSIDE_CYCLE);
    }
    if put_away(program, found.index, sources) {
        return fault(code::FROM_LINE_SHIFT_PUT_AWAY);
    }
    let asks = |w: Words| w.names_axes() || w.has(b'm') || w.has(b't') || w.has(b's');
    let skipped = Words::at(sources, file, target).is_some_and(asks);
    if let Some(at) = found.begins_at.filter(|_| skipped) {
        notes.push(Diagnostic::new(code::FROM_LINE_NOT_EXECUTED, place.0, place.1, &[line.to_string(), (at + 1).to_string()]));
    }
    if let Some(way) = found.repeated {
        notes.push(Diagnostic::new(code::FROM_LINE_INSIDE_LOOP, place.0, place.1, &[way]));
    }
    let (state, mut pose) = (*cursor.state(), *cursor.pose());
    // A program made from features says how the tool stands: as it goes on there, and not as the setup before has left it.
    let next = options.tool.and_then(|_| program.steps().skip(found.index).find(|s| s.op.moves()));
    (pose.tool_axis, pose.spin) = next.map_or((None, None), |s| (s.end.tool_axis, s.end.spin));
    let lathe = approach::is_lathe(program);
    let tilt = options.tool.filter(|_| !lathe).and_then(|tool| tool(&pose, &state)).filter(|up| up[2] < 1.0 - UPRIGHT);
    let up = tilt.unwrap_or(UP);
    let tool = options.tool.filter(|_| options.slides);
    let said = Said { program, sources, used: &axes_used(program), lathe, stored: options.stored, tool };
    let known = Known::of(&said, found.index, tilt, &options.unsure);
    if !known.lost.is_empty() {
        return Err(vec![Diagnostic::new(code::FROM_LINE_PLACE_OF_MACHINE, place.0, place.1, &[known.lost.join(" ")])]);
    }
    let length = length_to_come(program, found.index, &state, sources);
    let heights = Heights { program, state: &state, begins: &pose, tilt, sources };
    let own = if tilt.is_none() || known.height { heights.of(&pose, &state) } else { f64::NEG_INFINITY };
    // How far below the height that is written the tip is, where a length is in force that is not the tool's, or none.
    let holds = options.tips && state.tool_offset[2] != 0.0;
    let carried = if holds { Some(state.tool_offset[2]) } else { carried(program, found.index, &state, sources) };
    let longest = carried.into_iter().chain(longest_to_come(program, found.index, sources)).reduce(f64::max);
    let below = longest.map(|length| length - state.tool_offset[2]);
    let safe = match (options.room, options.safe_z) {
        (Some(room), _) => room.safe,
        // What is asked for is the height of the tool; where its length is not in force yet, the spindle goes higher.
        (None, Some(z)) => z + length.or(below).unwrap_or(0.0).max(0.0),
        (None, None) => {
            let top = heights.top().unwrap_or(own);
            // No tip comes lower than the highest of any tool, whatever length is in force for the one that is carried.
            let tip = heights.highest_tip().filter(|_| tilt.is_none() && !lathe);
            let top = tip.zip(below).map_or(top, |(tip, below)| top.max(tip + below));
            if tilt.is_none() || (0..3).any(|i| known.goes[i] && up[i].abs() > UPRIGHT || known.lifted[i]) {
                notes.push(Diagnostic::new(code::FROM_LINE_NO_SAFE_HEIGHT, place.0, place.1, &[heights.show(top)]));
            }
            top
        }
    };
    if let Some(way) = lifted_before_change(program, found.index, sources) {
        notes.push(Diagnostic::new(code::FROM_LINE_TOOL_CHANGE, place.0, place.1, &[state.tool.to_string(), way.into()]));
    }
    let still = (0..3).all(|i| !known.goes[i] && !known.lifted[i]);
    if tilt.is_some() && still && known.goes[3..6].contains(&true) {
        notes.push(Diagnostic::new(code::FROM_LINE_FROM_WHERE_IT_STANDS, place.0, place.1, &[]));
    }
    if length == Some(0.0) {
        notes.push(Diagnostic::new(code::FROM_LINE_BARE_SPINDLE, place.0, place.1, &[state.tool.to_string()]));
    }
    let found_room = || Room { safe: safe.max(own), lowest: heights.lowest_crossing(), out: approach::outmost(program, &state) };
    let room = options.room.unwrap_or_else(found_room);
    if let Some(lowest) = room.lowest.filter(|lowest| room.safe < lowest - SAME_HEIGHT) {
        notes.push(Diagnostic::new(code::FROM_LINE_LOW_HEIGHT, place.0, place.1, &[room.safe, lowest].map(|h| heights.show(h))));
    }
    let kept = kept_here(program, found.index, sources);
    if let Some((_, source)) = kept.values().next() {
        let (file, span) = sources.place(*source);
        notes.push(Diagnostic::new(code::FROM_LINE_OFFSET_KEPT, file, span, &[]));
    }
    let height: f64 = (0..3).map(|i| up[i] * pose.axes[i]).sum();
    let rise = room.safe - height;
    let lift = std::array::from_fn(|i| known.lifted[i].then(|| if known.height { rise * up[i] } else { rise / up[i] }));
    let from = From { index: found.index, line, known: known.goes, lift, late: known.late, up, lathe, tilt };
    let restart = build(program, &from, &state, &pose, &room, sources);
    let goal = std::array::from_fn(|i| (known.goes[i] || tilt.is_some() && known.sure[i]).then_some(pose.axes[i]));
    let (shifted, kept) = (shifted(program, found.index, sources), set_from_here(program, found.index, sources));
    let offsets = offsets(&restart);
    Ok(Restart { program: restart, notes, goal, named: known.named, shifted, kept, offsets, room })
}

/// Where [`Restart::offsets`] has the tool's offset.
const TOOL: u8 = 10;

/// Offsets that a restart sets before its first source line; work offsets that the machine has kept are not among them.
fn offsets(restart: &Program) -> BTreeMap<u8, Axes> {
    let Some(last) = restart.steps().filter(|s| s.source.line == INSERTED).last() else { return BTreeMap::new() };
    let said = restart.steps().take(last.index).filter(|s| s.source.line != INSERTED);
    let stored = said.filter_map(|s| match s.op {
        Op::StoredOffset { number, offset, .. } => Some((number, offset)),
        _ => None,
    });
    let state = *restart.cursor_at(last.index).state();
    stored.chain([(0, state.local_offset), (TOOL, state.tool_offset)]).collect()
}

/// By how much G10 L20 has changed the axes it named of work offsets.
fn set_from_here(program: &Program, index: usize, sources: &dyn Sources) -> BTreeMap<u8, [Option<f64>; 9]> {
    let mut out: BTreeMap<u8, [Option<f64>; 9]> = BTreeMap::new();
    for step in own(program, index) {
        let (number, offset) = match step.op {
            Op::WorkOffset(number, offset) | Op::StoredOffset { number, offset, .. } if sets_here(sources, step.source) => (number, offset),
            _ => continue,
        };
        let cursor = program.cursor_at(step.index);
        // Of one that is not in force the whole counts: nobody knows what it was.
        let before = if number == cursor.state().work { cursor.state().work_offset } else { [0.0; 9] };
        let by: Axes = std::array::from_fn(|i| offset[i] - before[i]);
        let Some(words) = Words::at(sources, step.source.file, step.source.line) else { continue };
        let sum = out.entry(number).or_default();
        (0..9).filter(|i| words.has(AXIS_LETTERS[*i])).for_each(|i| sum[i] = Some(sum[i].unwrap_or(0.0) + by[i]));
    }
    out
}

/// By how much G92 has shifted the axes it named, as far as that is still in force.
fn shifted(program: &Program, index: usize, sources: &dyn Sources) -> [Option<f64>; 9] {
    let mut out = [None; 9];
    for step in own(program, index) {
        let Op::LocalOffset(offset) = step.op else { continue };
        let Some(words) = Words::at(sources, step.source.file, step.source.line) else { continue };
        if [921, 922].into_iter().any(|g| words.g(g)) {
            out = [None; 9];
        }
        for i in (0..9).filter(|i| words.has(AXIS_LETTERS[*i])) {
            out[i] = words.g(920).then_some(offset[i]);
        }
    }
    out
}

/// What the program itself does before an operation.
fn own(program: &Program, index: usize) -> impl Iterator<Item = gr_ir::Step<'_>> {
    program.steps().take(index).skip(crate::begins(program))
}

struct Found {
    index: usize,
    /// How often, in words, when it is more than once.
    repeated: Option<String>,
    /// The line, from 0, where it begins when the one asked for does nothing.
    begins_at: Option<u32>,
}

/// The first operation that the line asks for, itself or through a call; failing that the first of a later line.
fn find(program: &Program, file: FileId, line: u32) -> Option<Found> {
    let skip = crate::begins(program);
    let mut first: Option<usize> = None;
    let mut later: Option<(usize, u32)> = None;
    let mut again = false;
    let mut ways: Vec<Source> = Vec::new();
    for step in program.steps().skip(skip) {
        if matches!(step.op, Op::Reset | Op::Finish) {
            continue;
        }
        let own = step.source.file == file && step.source.line == line;
        let through = program.call_stack(step.source).find(|f| f.file == file && f.line == line);
        if own || through.is_some() {
            first.get_or_insert(step.index);
            let frame = if own { step.source.frame } else { through.map_or(FrameId::MAIN, |f| f.parent) };
            let way = Source { file, line, frame };
            if ways.len() < 1000 && !ways.contains(&way) {
                ways.push(way);
            }
        }
        let (at_file, at_line, pass) = here(program, step.source);
        if later.is_none() && at_file == file && at_line > line {
            later = Some((step.index, at_line));
            again = pass;
        }
    }
    let repeated = (ways.len() > 1).then(|| {
        let inner = program.call_stack(ways[0]).next();
        let name = inner.map(|f| program.frames.name(f)).filter(|n| !n.is_empty());
        let times = if ways.len() < 1000 { ways.len().to_string() } else { "many".into() };
        format!("{times} times{}", name.map_or(String::new(), |n| format!(", in {n}")))
    });
    let repeated = repeated.or_else(|| (first.is_none() && again).then(|| "in a loop".to_string()));
    let begins_at = later.filter(|_| first.is_none()).map(|(_, line)| line);
    Some(Found { index: first.or(later.map(|(index, _)| index))?, repeated, begins_at })
}

/// Where in its file an operation is run: the line of the call that leads to it, else its own. True: in a loop.
fn here(program: &Program, source: Source) -> (FileId, u32, bool) {
    let mut place = (source.file, source.line, false);
    for frame in program.call_stack(source) {
        place = if frame.pass == 0 { (frame.file, frame.line, false) } else { (place.0, place.1, true) };
    }
    place
}

/// Whether cutter compensation is on before an operation. The motion shows no trace of it, so the lines that were
/// executed are looked at.
fn compensated(program: &Program, index: usize, line: u32, sources: &dyn Sources) -> bool {
    let mut on = false;
    let mut last: Option<Source> = None;
    let mut look = |file: FileId, line: u32| {
        let Some(words) = Words::at(sources, file, line) else {
            return;
        };
        if words.g(400) {
            on = false;
        } else if [410, 420, 411, 421].into_iter().any(|g| words.g(g)) {
            on = true;
        }
    };
    for step in program.steps().take(index) {
        let source = step.source;
        if last == Some(source) {
            continue;
        }
        // Lines that asked for nothing, a lone G40 for one, lie between the two.
        let from = match last {
            Some(l) if l.file == source.file && l.frame == source.frame && l.line < source.line => l.line + 1,
            _ => source.line,
        };
        for l in from..=source.line {
            look(source.file, l);
        }
        last = Some(source);
    }
    if let Some(l) = last.filter(|l| l.line < line) {
        for between in l.line + 1..line {
            look(l.file, between);
        }
    }
    on
}

/// Whether the last move before an operation followed the spindle: the tool stands in the thread that it cut, and gets
/// there again by no other move.
fn threaded(program: &Program, index: usize) -> bool {
    let last = program.steps().take(index).filter(|s| s.op.moves() && s.start.axes != s.end.axes).last();
    last.is_some_and(|s| program.cursor_at(s.index).state().sync.is_some_and(|sync| !sync.velocity))
}

/// By which code the program brought the tool away before it changed to the one that it has at an operation: a restart
/// can't do that before it knows where the tool is.
fn lifted_before_change(program: &Program, index: usize, sources: &dyn Sources) -> Option<&'static str> {
    let mut way = None;
    let mut found = None;
    for s in program.steps().take(index) {
        match s.op {
            Op::ToolChange(_) => found = way.take(),
            op if op.feeds() => way = None,
            op if op.moves() => {
                let words = Words::at(sources, s.source.file, s.source.line);
                let code = [(280, "G28"), (300, "G30"), (530, "G53")].into_iter().find(|(g, _)| words.is_some_and(|w| w.g(*g)));
                way = code.map(|(_, name)| name).or(way);
            }
            _ => {}
        }
    }
    found
}

fn inside_cycle(program: &Program, index: usize) -> bool {
    let mut depth = 0i32;
    for step in program.steps().take(index) {
        match step.op {
            Op::Begin { marker: Marker::Cycle, .. } => depth += 1,
            Op::Close(Marker::Cycle) => depth -= 1,
            _ => {}
        }
    }
    depth > 0
}

/// By how much the length that a later block asks for (G43), before the tool is changed again, is longer than what is in
/// force; none where no tool is in the spindle or its length is in force. 0: it is asked for, and nobody knows it.
fn length_to_come(program: &Program, index: usize, state: &State, sources: &dyn Sources) -> Option<f64> {
    if state.tool <= 0 || state.tool_offset != [0.0; 9] {
        return None;
    }
    // Of a tool that was never measured the length is 0, in force or not.
    if in_force(program, index, sources) { None } else { length_asked(program, index, sources) }
}

/// Length of the tool in the spindle, as the program has it: in force, or what it asks for before it changes the tool again.
fn carried(program: &Program, index: usize, state: &State, sources: &dyn Sources) -> Option<f64> {
    if in_force(program, index, sources) { Some(state.tool_offset[2]) } else { length_asked(program, index, sources) }
}

/// Whether the length in force is that of the tool in the spindle: it was asked for since the tool was changed.
fn in_force(program: &Program, index: usize, sources: &dyn Sources) -> bool {
    let mut in_force = false;
    for s in own(program, index) {
        match s.op {
            Op::ToolChange(_) | Op::ToolNumber(_) => in_force = false,
            Op::ToolOffset { .. } => in_force = !asks(&s, &[490], sources),
            _ => {}
        }
    }
    in_force
}

/// The greatest length that is asked for from an operation on, also of a tool that is changed for, before a move names Z.
fn longest_to_come(program: &Program, index: usize, sources: &dyn Sources) -> Option<f64> {
    let named = |s: &gr_ir::Step<'_>| s.op.moves() && says(2, &s.start, &s.end, s.source, sources) || matches!(s.op, Op::End);
    let lengths = program.steps().skip(index).take_while(|s| !named(s)).filter_map(|s| match s.op {
        Op::ToolOffset { offset, .. } if !asks(&s, &[490], sources) => Some(offset[2]),
        _ => None,
    });
    lengths.reduce(f64::max)
}

/// The greatest length that is asked for from an operation on, before the tool is changed.
fn length_asked(program: &Program, index: usize, sources: &dyn Sources) -> Option<f64> {
    let mut said = None;
    for s in program.steps().skip(index) {
        match s.op {
            Op::ToolChange(_) | Op::ToolNumber(_) | Op::End => break,
            Op::ToolOffset { offset, .. } if !asks(&s, &[490], sources) => said = Some(said.unwrap_or(0.0f64).max(offset[2])),
            _ => {}
        }
    }
    said
}

/// Where a program begins.
struct From {
    index: usize,
    line: u32,
    /// Axes that a block before has brought to a place in the work frame.
    known: [bool; 9],
    /// The tool stays at the safe height, by so much along each axis that makes it, until a block names that, mm.
    lift: [Option<f64>; 3],
    /// Axes that a block has to name before the tool goes down from there, where none names the height before it cuts.
    late: Vec<usize>,
    /// Direction from the tool point to the spindle.
    up: V3,
    lathe: bool,
    /// Direction of a tilted tool.
    tilt: Option<V3>,
}

const AXIS_LETTERS: [u8; 9] = *b"xyzabcuvw";

fn build(program: &Program, from: &From, state: &State, pose: &Pose, room: &Room, sources: &dyn Sources) -> Program {
    let index = from.index;
    // A place that no program names, so that every axis of the approach moves and has its word.
    let used = axes_used(program);
    // A rotary axis that the program has named but never moves may stand elsewhere too.
    let approached: [bool; 9] = std::array::from_fn(|i| from.known[i] && (i < 6 || used[i]) || from.lift.get(i).is_some_and(Option::is_some));
    let far: Axes = std::array::from_fn(|i| if approached[i] { pose.axes[i] + 777.25 } else { pose.axes[i] });
    let named = names_system(program, index, from.line, sources);
    let mut begins = State::default();
    if !named {
        // What the program leaves to the machine is in force there.
        let mut pose = Pose::default();
        [Op::WorkOffset(state.work, state.work_offset), Op::Rotation(state.rotation)]
            .iter()
            .for_each(|op| begins.apply(op, &mut pose));
    }
    // It is said before the offsets are, which give it its number.
    let far = Pose { tool_axis: pose.tool_axis, spin: pose.spin, ..Pose::at(begins.work_frame(&state.machine(&far))) };
    let mut out = Builder::from_state(far, begins);
    out.names_of(program);
    let source = Source { line: INSERTED, ..Source::default() };
    // The line that asked for the offset knows more than the offset: of a tool that was never measured it is 0.
    let offset = own(program, index).filter_map(|s| if let Op::ToolOffset { number, .. } = s.op { Some((number, s.source)) } else { None }).last();
    let mut restore = Restore { out, source };
    restore.push(Op::Note(Note::Comment, &format!("restart at line {}", from.line)));
    restore.stored(program, index, sources);
    let shifts = own(program, index).any(|s| matches!(s.op, Op::LocalOffset(_)) && asks(&s, &[920, 921, 922, 923, 520], sources));
    restore.frame(state, named, shifts);
    restore.tool(state, offset);
    if units_under_offset(program, index) {
        // The same change again, which shows in no motion: G28 depends on it.
        let other = if state.units == Units::Mm { Units::Inch } else { Units::Mm };
        restore.push(Op::Units(other));
        restore.push(Op::Units(state.units));
    }
    // A mode that a canned cycle has left behind it is none that the program asked for: its line says so.
    let path = own(program, index).filter(|s| matches!(s.op, Op::PathMode(_))).last().map_or(source, |s| s.source);
    let path = if says_path(program, index, from.line, sources) { Some(source) } else { Some(path).filter(|_| state.path != PathMode::default()) };
    restore.modes(state, path);
    restore.outputs(program, index);
    let mut waiting = from.lift;
    let mut goal = *pose;
    waiting.iter().zip(&mut goal.axes).for_each(|(by, v)| *v += by.unwrap_or(0.0));
    let surface = program.steps().any(|s| matches!(s.op, Op::SpindleMode { surface: Some(_), .. }));
    let turned = orientations(program, index);
    let start = |restore: &mut Restore| restore.spindles(state, surface, &turned);
    if from.lathe && !from.known[2] {
        start(&mut restore);
    } else {
        approach::Approach { program, index, state, goal, approached, stays_up: from.lift != [None; 3], tilt: from.tilt, room }.make(&mut restore, start);
    }
    let mut late = from.late.clone();
    let mut rest = program.cursor_at(index);
    while let Some(view) = rest.next() {
        let mut end = *view.end;
        if view.op.moves() {
            (0..3).filter(|i| says(*i, view.start, view.end, view.source, sources)).for_each(|i| waiting[i] = None);
            let mut left = (0..3).filter(|i| waiting[*i].is_some());
            if let (Some(i), None) = (left.next(), left.next()) {
                // Beside a tilted tool the others make height too.
                let rises: f64 = (0..3).filter(|k| *k != i).map(|k| from.up[k] * (view.end.axes[k] - view.start.axes[k])).sum();
                waiting[i] = waiting[i].map(|by| by - rises / from.up[i]);
            }
        }
        // Up there, until a block says how high. What is there but for rounding is there.
        for (i, by) in (0..3).filter_map(|i| Some((i, waiting[i]?))) {
            let (here, there) = (restore.out.pose().axes[i], end.axes[i] + by);
            end.axes[i] = if (there - here).abs() < SAME_HEIGHT { here } else { there };
        }
        restore.out.push_to(view.op, &end, view.source);
        if !late.is_empty() && view.op.moves() {
            late.retain(|i| !says(*i, view.start, view.end, view.source, sources));
            if late.is_empty() && waiting != [None; 3] {
                waiting = [None; 3];
                let approached = std::array::from_fn(|i| from.up.get(i).is_some_and(|v| v.abs() > UPRIGHT));
                let down = approach::Approach { program, index: view.index, state: view.state, goal: *view.end, approached, stays_up: false, tilt: from.tilt, room };
                down.make(&mut restore, |_| ());
            }
        }
    }
    restore.out.finish()
}

/// Work offsets that were last set from where the tool stood (G10 L20): what the machine has by then, and the line that set it.
fn kept_here(program: &Program, index: usize, sources: &dyn Sources) -> BTreeMap<u8, (Op<'static>, Source)> {
    let mut kept = BTreeMap::new();
    for step in program.steps().take(index) {
        let (number, offset) = match step.op {
            Op::StoredOffset { number, offset, .. } | Op::WorkOffset(number, offset) => (number, offset),
            _ => continue,
        };
        if sets_here(sources, step.source) {
            kept.insert(number, (Op::StoredOffset { number, offset, rotation: 0.0 }, step.source));
        } else if Words::at(sources, step.source.file, step.source.line).is_some_and(|w| w.g(100)) {
            kept.remove(&number);
        }
    }
    kept
}

/// What a step of G10 L2 stores: of the work offset in force too, which it sets by operations of its own.
fn set_by(program: &Program, step: &gr_ir::Step<'_>, sources: &dyn Sources) -> Option<Op<'static>> {
    match step.op {
        Op::StoredOffset { number, offset, rotation } => Some(Op::StoredOffset { number, offset, rotation }),
        Op::WorkOffset(..) | Op::Rotation(_) if Words::at(sources, step.source.file, step.source.line)?.g(100) && !sets_here(sources, step.source) => {
            let cursor = program.cursor_at(step.index + 1);
            let s = cursor.state();
            Some(Op::StoredOffset { number: s.work, offset: s.work_offset, rotation: s.rotation })
        }
        _ => None,
    }
}

/// Whether the program says before a line which work offset is in force: by an operation, or by a line that selects what
/// was in force already.
fn names_system(program: &Program, index: usize, line: u32, sources: &dyn Sources) -> bool {
    let begun = crate::begins(program);
    let selected = |s: &gr_ir::Step<'_>| s.index >= begun && matches!(s.op, Op::WorkOffset(..));
    program.steps().take(index).any(|s| selected(&s))
        || (0..line).map_while(|l| Words::at(sources, FileId(0), l)).any(|w| SYSTEMS[1..].iter().any(|g| w.g(*g)))
}

/// Whether the program says before a line how the path is followed (G61, G61.1, G64): by an operation, or by a line that asks for what
/// was in force already.
fn says_path(program: &Program, index: usize, line: u32, sources: &dyn Sources) -> bool {
    const CODES: [u32; 3] = [610, 611, 640];
    own(program, index).any(|s| matches!(s.op, Op::PathMode(_)) && asks(&s, &CODES, sources))
        || (0..line.saturating_sub(1)).map_while(|l| Words::at(sources, FileId(0), l)).any(|w| CODES.iter().any(|g| w.g(*g)))
}

/// Whether the line of a step asks for one of these codes, in tenths.
fn asks(step: &gr_ir::Step<'_>, codes: &[u32], sources: &dyn Sources) -> bool {
    Words::at(sources, step.source.file, step.source.line).is_some_and(|w| codes.iter().any(|g| w.g(*g)))
}

/// Whether a shift by G92 is put away by G92.2 where the program begins, and comes back by G92.3.
fn put_away(program: &Program, index: usize, sources: &dyn Sources) -> bool {
    let shift = |s: &gr_ir::Step<'_>| matches!(s.op, Op::LocalOffset(_));
    let last = program.steps().take(index).filter(shift).last();
    last.is_some_and(|s| asks(&s, &[922], sources)) && program.steps().skip(index).filter(shift).any(|s| asks(&s, &[923], sources))
}

/// Whether the length unit changed while a tool offset was active.
fn units_under_offset(program: &Program, index: usize) -> bool {
    let mut cursor = program.cursor();
    let mut units = program.start_state().units;
    while let Some(view) = cursor.next().filter(|v| v.index < index) {
        if let Op::Units(new) = view.op {
            if new != units && view.state.tool_offset != [0.0; 9] {
                return true;
            }
            units = new;
        }
    }
    false
}

struct Restore {
    out: Builder,
    source: Source,
}

impl Restore {
    fn push(&mut self, op: Op<'_>) {
        self.out.push(op, self.source);
    }

    /// `named`: the program says which work offset is in force. `shifts`: it says how the frame is shifted, if by nothing (G92.1, G52
    /// X0). What it leaves to the machine stays with the machine.
    fn frame(&mut self, s: &State, named: bool, shifts: bool) {
        self.push(Op::Units(s.units));
        self.push(Op::Plane(s.plane));
        if named {
            self.push(Op::WorkOffset(s.work, s.work_offset));
            self.push(Op::Rotation(s.rotation));
        }
        if shifts || s.local_offset != [0.0; 9] {
            self.push(Op::LocalOffset(s.local_offset));
        }
    }

    /// Work offsets that were set before, for later too, as their lines name them. One that comes from where the tool stood
    /// stays with the machine.
    fn stored(&mut self, program: &Program, index: usize, sources: &dyn Sources) {
        let kept = kept_here(program, index, sources);
        // Of a line in a loop the last pass counts.
        let last: BTreeMap<_, _> = own(program, index).filter_map(|s| Some(((s.source.file, s.source.line), (s, set_by(program, &s, sources)?)))).collect();
        let mut last: Vec<_> = last.into_values().collect();
        last.sort_by_key(|(s, _)| s.index);
        for (step, op) in last {
            if !matches!(op, Op::StoredOffset { number, .. } if kept.contains_key(&number)) {
                self.out.push(op, step.source);
            }
        }
        for op in kept.into_values().map(|(op, _)| op) {
            self.push(op);
        }
    }

    /// `offset`: the number that asked for the tool's length, and its line; none: the program has not spoken of it.
    fn tool(&mut self, s: &State, offset: Option<(Option<u32>, Source)>) {
        if s.tool > 0 {
            self.push(Op::ToolPrepare(s.tool));
            self.push(Op::ToolChange(0));
        }
        if let Some((number, line)) = offset {
            self.out.push(Op::ToolOffset { offset: s.tool_offset, number }, line);
        }
        if s.prepared > 0 && s.prepared != s.tool {
            self.push(Op::ToolPrepare(s.prepared));
        }
    }

    /// `path`: what asks for the way the path is followed, if it is to be said.
    fn modes(&mut self, s: &State, path: Option<Source>) {
        if let Some(line) = path {
            self.out.push(Op::PathMode(s.path), line);
            self.out.push(Op::MergeTolerance(s.merge_tolerance), line);
        }
        for (which, on, usual) in [
            (Override::Feed, s.feed_override, true),
            (Override::Speed(0), s.speed_override & 1 != 0, true),
            (Override::Adaptive, s.adaptive, false),
            (Override::FeedHold, s.feed_hold, true),
        ] {
            if on != usual {
                self.push(Op::Override(which, on));
            }
        }
        self.push(Op::FeedMode { spindle: s.feed_spindle, mode: s.feed_mode });
        self.push(Op::Feed { linear: s.feed, angular: s.feed_angular });
    }

    /// `surface`: the program has surface speeds, which outlast its stop. `turned`: spindles that are held at an angle.
    fn spindles(&mut self, s: &State, surface: bool, turned: &BTreeMap<i32, Op<'static>>) {
        for (number, spindle) in (0..).zip(&s.spindles) {
            if spindle.surface.is_some() || surface && spindle.speed != 0.0 {
                self.push(Op::SpindleMode { spindle: number, surface: spindle.surface });
            }
            if spindle.speed != 0.0 {
                self.push(Op::SpindleSpeed { spindle: number, speed: spindle.speed });
            }
            if spindle.turn != Turn::Stop {
                self.push(Op::SpindleTurn { spindle: number, turn: spindle.turn });
            }
        }
        turned.values().for_each(|op| self.push(*op));
        if s.mist {
            self.push(Op::Mist(true));
        }
        if s.flood {
            self.push(Op::Flood(true));
        }
    }

    /// Outputs as the program left them, in the order of their numbers.
    fn outputs(&mut self, program: &Program, index: usize) {
        let (mut digital, mut analog) = (BTreeMap::new(), BTreeMap::new());
        for step in program.steps().take(index) {
            match step.op {
                Op::DigitalOut { index, on, .. } => drop(digital.insert(index, on)),
                Op::AnalogOut { index, value, .. } => drop(analog.insert(index, value)),
                _ => {}
            }
        }
        digital.into_iter().for_each(|(index, on)| self.push(Op::DigitalOut { index, on, synced: false }));
        analog.into_iter().for_each(|(index, value)| self.push(Op::AnalogOut { index, value, synced: false }));
    }
}

/// Spindles that an operation finds held at an angle (M19): it stays until the spindle is turned on or stopped.
fn orientations(program: &Program, index: usize) -> BTreeMap<i32, Op<'static>> {
    let mut held = BTreeMap::new();
    for step in program.steps().take(index) {
        match step.op {
            Op::SpindleOrient { spindle, angle, direction } => {
                held.insert(spindle, Op::SpindleOrient { spindle, angle, direction });
            }
            Op::SpindleTurn { spindle, .. } => drop(held.remove(&spindle)),
            Op::End => held.clear(),
            _ => {}
        }
    }
    held
}

/// Which axes ever move.
fn axes_used(program: &Program) -> [bool; 9] {
    let mut used = [false; 9];
    for step in program.steps().filter(|s| s.op.moves()) {
        for (i, u) in used.iter_mut().enumerate() {
            *u |= step.start.axes[i] != step.end.axes[i];
        }
    }
    used
}
