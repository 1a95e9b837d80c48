//! What editors ask about stretches of lines: the blocks as execution comes to them for the first time, with the
//! state around them, the motion they make and the values of parameters. Nothing here is remembered; a run begins at
//! the nearest state that is known.

use std::ops::Range;
use std::sync::Arc;

use gr_canon::{At, Axes, Call, CallFrame, FileId, FrameId, Mark, Sink};
use gr_gcode::{File, Parameter};
use gr_interp::{Interp, Modal};
use gr_ir::{Lowering, Pose, Program};

use crate::db::{Database, Document, shape};
use crate::layout::layout;
use crate::library::whole;
use crate::timeline::{nearest, timeline_to, timeline_with_all_to};

/// A block as execution comes to it for the first time.
#[derive(Clone, Debug)]
pub struct Traced {
    /// Its line, from 0.
    pub line: u32,
    /// Modes and position before it.
    pub before: Modal,
    /// … after it; the same as before when the block is wrong.
    pub after: Modal,
    /// What it makes the machine do.
    pub program: Program,
    /// Values before the block, in the order they were asked for; none = not set.
    pub values: Vec<Option<f64>>,
    /// Values after it.
    pub values_after: Vec<Option<f64>>,
    /// A canned cycle made the moves.
    pub cycle: bool,
}

/// Calls of one block that are kept.
const MOST_CALLS: usize = 10_000;
/// Blocks that are run on while cutter compensation holds moves back.
const MOST_HELD: u32 = 64;

/// Traces blocks: see [`crate::Session::trace`].
pub(crate) fn trace(db: &Database, document: Document, lines: &Range<u32>, wanted: &[Parameter], budget: u32) -> Vec<Traced> {
    run(db, document, lines, wanted, budget).unwrap_or_default()
}

fn run(db: &Database, document: Document, lines: &Range<u32>, wanted: &[Parameter], budget: u32) -> Option<Vec<Traced>> {
    let last = lines.end.saturating_sub(1);
    // The state between chunks may lack what nothing reads but who asks.
    let unread = crate::layout::unread(db, document);
    let lacking = wanted.iter().any(|p| unread.contains(p));
    let timeline = if lacking { timeline_with_all_to(db, document, last) } else { timeline_to(db, document, last) };
    let starts = &layout(db, document).starts;
    let count = *starts.last()?;
    if lines.start >= count || lines.is_empty() {
        return None;
    }
    let lines = lines.start..lines.end.min(count);
    let at = starts.partition_point(|s| *s <= lines.start).checked_sub(1)?;
    let stretch = nearest(db, document, timeline, at)?;
    let chunks = document.chunks(db);
    let straight = chunks.iter().all(|c| !shape(db, *c, document.run(db)).control);
    let main = FileId(document.id(db));
    let mut library = stretch.library();
    let watch = Watch::new(main, lines.clone(), stretch.modal().plane());
    let mut interp = stretch.resume(&mut library, watch);
    let mut seen: Vec<Option<(Modal, Modal, Vec<Option<f64>>, Vec<Option<f64>>)>> = vec![None; lines.len()];
    let (mut left, mut held) = (lines.len(), 0);
    for step in 0..budget {
        if step % 4096 == 0 {
            salsa::Database::unwind_if_revision_cancelled(db);
        }
        let line = interp.next_line();
        let here = lines.contains(&line) && interp.comes_to(main, line);
        let fresh = here && seen[(line - lines.start) as usize].is_none();
        if here {
            interp.sink().visit(line);
        }
        let before = fresh.then(|| (*interp.modal(), values(&mut interp, wanted)));
        let end = interp.step_block();
        if let Some((before, values_before)) = before {
            let after = *interp.modal();
            let values_after = values(&mut interp, wanted);
            seen[(line - lines.start) as usize] = Some((before, after, values_before, values_after));
            left -= 1;
        }
        let passed = left == 0 || (straight && line >= lines.end);
        held += u32::from(passed);
        if end.is_some() || (passed && (interp.modal().comp_side == 0 || held > MOST_HELD)) {
            break;
        }
    }
    let watch = interp.into_sink();
    let found = seen.into_iter().zip(watch.lines).enumerate().filter_map(|(i, (seen, taken))| {
        let (before, after, values, values_after) = seen?;
        let cycle = taken.cycle;
        Some(Traced { line: lines.start + i as u32, before, after, program: motion(&before, taken), values, values_after, cycle })
    });
    Some(found.collect())
}

fn values<S: Sink>(interp: &mut Interp<'_, S>, wanted: &[Parameter]) -> Vec<Option<f64>> {
    wanted.iter().map(|p| interp.peek(p)).collect()
}

/// What one line made.
#[derive(Clone, Default)]
struct Taken {
    visits: u32,
    start: Option<Axes>,
    calls: Vec<Call>,
    cycle: bool,
}

/// Keeps the calls of first visits.
struct Watch {
    main: FileId,
    range: Range<u32>,
    lines: Vec<Taken>,
    /// Where the last move ended.
    at: Option<Axes>,
    plane: gr_canon::Plane,
}

impl Watch {
    fn new(main: FileId, range: Range<u32>, plane: gr_canon::Plane) -> Watch {
        Watch { main, lines: vec![Taken::default(); range.len()], range, at: None, plane }
    }
    fn slot(&mut self, at: &At<'_>) -> Option<&mut Taken> {
        let wanted = at.file == self.main && self.range.contains(&at.line);
        if wanted { self.lines.get_mut((at.line - self.range.start) as usize) } else { None }
    }
    fn visit(&mut self, line: u32) {
        self.lines[(line - self.range.start) as usize].visits += 1;
    }
}

impl Sink for Watch {
    fn call(&mut self, at: &At<'_>, call: &Call) {
        let start = self.at;
        if let Call::SelectPlane(plane) = call {
            self.plane = *plane;
        }
        self.at = end_of(call, start, self.plane).or(start);
        if let Some(taken) = self.slot(at)
            && taken.visits == 1
            && taken.calls.len() < MOST_CALLS
        {
            if taken.calls.is_empty() {
                taken.start = start;
            }
            taken.calls.push(call.clone());
        }
    }
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        if matches!(mark, Mark::CycleBegin(_))
            && let Some(taken) = self.slot(at)
        {
            taken.cycle = true;
        }
    }
    fn frame(&mut self, _id: FrameId, _frame: &CallFrame) {}
}

/// End of a move in all axes.
fn end_of(call: &Call, from: Option<Axes>, plane: gr_canon::Plane) -> Option<Axes> {
    match call {
        Call::StraightTraverse(a) | Call::StraightFeed(a) | Call::StraightProbe(a, _) => Some(*a),
        Call::ArcFeed { first_end, second_end, axis_end, rest, .. } => {
            let mut end = from?;
            end[3..].copy_from_slice(rest);
            let (first, second, third) = gr_ir::plane_axes(plane);
            (end[first], end[second], end[third]) = (*first_end, *second_end, *axis_end);
            Some(end)
        }
        _ => None,
    }
}

/// The calls of a block as motion.
fn motion(before: &Modal, taken: Taken) -> Program {
    let mut setting = Lowering::new();
    let at = At { file: FileId(0), line: 0, frame: FrameId::MAIN, now: b"" };
    for call in modes(before) {
        setting.call(&at, &call);
    }
    let state = *setting.builder().state();
    let inch = if before.units() == gr_canon::Units::Inch { 25.4 } else { 1.0 };
    let from = match taken.start {
        Some(start) if before.comp_side != 0 => start,
        _ => before.current,
    };
    let mut axes = from;
    for (i, v) in axes.iter_mut().enumerate() {
        *v = if (3..6).contains(&i) { v.to_radians() } else { *v * inch };
    }
    let mut lowering = Lowering::from_state(Pose::at(axes), state);
    for call in &taken.calls {
        lowering.call(&at, call);
    }
    lowering.finish()
}

/// Calls that bring about the modes that matter for length and time.
fn modes(m: &Modal) -> Vec<Call> {
    let spindle = m.active_spindle.clamp(0, 7);
    let s = spindle as usize;
    let surface = if m.css[s] != 0 { 1e30 } else { 0.0 };
    let mut calls = vec![
        Call::UseLengthUnits(m.units()),
        Call::SelectPlane(m.plane()),
        Call::SetSpindleMode(spindle, surface, None),
        Call::SetSpindleSpeed(spindle, m.speed[s]),
        Call::SetFeedMode(spindle, i32::from(m.feed_mode == 2)),
        Call::SetFeedRate(m.feed),
    ];
    match m.turning[s] {
        1 => calls.push(Call::StartSpindleClockwise(spindle)),
        2 => calls.push(Call::StartSpindleCounterclockwise(spindle)),
        _ => {}
    }
    calls
}

/// The file with its tables: text, words, control flow.
pub(crate) fn file(db: &Database, document: Document) -> Arc<File> {
    whole(db, document, document.run(db))
}
