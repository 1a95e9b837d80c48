//! Columns: one byte of kind per operation, one byte of line distance, a bit mask of changed axes and
//! their values packed behind each other. What did not change is not stored. Every 512 operations a
//! checkpoint holds the full state, so that reading can begin anywhere.

use crate::op::{Arc, ArcPlane, Pose, Source};
use crate::{Axes, FileId, FrameId, Op, State};

mod code;

/// Operations between two checkpoints.
const STRIDE: usize = 512;
/// Line distance that says: the source stands in `jumps`.
const JUMP: i8 = i8::MIN;

/// One call or one pass of a loop, as stored.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Frame {
    /// Whose.
    pub id: FrameId,
    /// From where.
    pub parent: FrameId,
    /// File of the calling block.
    pub file: FileId,
    /// Its line, from 0.
    pub line: u32,
    /// Name: index into [`Frames::names`].
    name: u32,
    /// Pass of a loop, from 1; 0 for a call.
    pub pass: u32,
}

/// The tree of calls and loop passes.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Frames {
    rows: Vec<Frame>,
    names: Vec<Box<str>>,
}

impl Frames {
    /// Adds a node.
    pub fn add(&mut self, id: FrameId, frame: &gr_canon::CallFrame) {
        let name = self.name_index(&frame.name);
        let row = Frame { id, parent: frame.parent, file: frame.file, line: frame.line, name, pass: frame.pass };
        match self.rows.last() {
            Some(last) if last.id >= id => match self.rows.binary_search_by_key(&id, |r| r.id) {
                Ok(i) => self.rows[i] = row,
                Err(i) => self.rows.insert(i, row),
            },
            _ => self.rows.push(row),
        }
    }
    fn name_index(&mut self, name: &str) -> u32 {
        // Passes of one loop come one after the other: look from the end.
        let known = self.names.iter().rposition(|n| &**n == name);
        let at = known.unwrap_or_else(|| {
            self.names.push(name.into());
            self.names.len() - 1
        });
        u32::try_from(at).unwrap_or(u32::MAX)
    }
    /// A node.
    pub fn get(&self, id: FrameId) -> Option<&Frame> {
        self.rows.binary_search_by_key(&id, |r| r.id).ok().map(|i| &self.rows[i])
    }
    /// Its name.
    pub fn name(&self, frame: &Frame) -> &str {
        self.names.get(frame.name as usize).map_or("", |n| n)
    }
    /// All nodes by id.
    pub fn iter(&self) -> impl Iterator<Item = &Frame> {
        self.rows.iter()
    }
    fn bytes(&self) -> usize {
        self.rows.capacity() * size_of::<Frame>() + self.names.iter().map(|n| n.len() + 16).sum::<usize>()
    }
}

/// Where reading stands in each column.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
struct Place {
    op: usize,
    mask: usize,
    value: usize,
    int: usize,
    text: usize,
    jump: usize,
}

#[derive(Clone, PartialEq, Debug)]
struct Checkpoint {
    place: Place,
    pose: Pose,
    state: State,
    source: Source,
}

/// A program as motion.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Program {
    /// Names of files, by id.
    pub files: Vec<(FileId, String)>,
    /// Calls and loop passes.
    pub frames: Frames,
    kinds: Vec<u8>,
    lines: Vec<i8>,
    masks: Vec<u16>,
    values: Vec<f64>,
    ints: Vec<i32>,
    text: String,
    jumps: Vec<Source>,
    checkpoints: Vec<Checkpoint>,
    start: Pose,
    start_state: State,
}

impl Program {
    /// Number of operations.
    pub fn len(&self) -> usize {
        self.kinds.len()
    }
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }
    /// The pose before the first operation.
    pub fn start(&self) -> &Pose {
        &self.start
    }
    /// The state before the first operation.
    pub fn start_state(&self) -> &State {
        &self.start_state
    }
    /// Reads from the beginning.
    pub fn cursor(&self) -> Cursor<'_> {
        Cursor {
            program: self,
            at: Place::default(),
            start: self.start,
            end: self.start,
            state: self.start_state,
            source: Source::default(),
        }
    }
    /// Reads from an operation on (from the end, if there are fewer).
    pub fn cursor_at(&self, index: usize) -> Cursor<'_> {
        let mut cursor = self.cursor();
        let index = index.min(self.len());
        if let Some(c) = (index / STRIDE).checked_sub(1).and_then(|i| self.checkpoints.get(i)) {
            cursor.at = c.place;
            (cursor.start, cursor.end) = (c.pose, c.pose);
            (cursor.state, cursor.source) = (c.state, c.source);
        }
        while cursor.at.op < index && cursor.advance().is_some() {}
        cursor
    }
    /// One operation.
    pub fn get(&self, index: usize) -> Option<Step<'_>> {
        let mut cursor = self.cursor_at(index);
        cursor.step()
    }
    /// All operations with their poses and sources, without the state.
    pub fn steps(&self) -> impl Iterator<Item = Step<'_>> {
        let mut cursor = self.cursor();
        std::iter::from_fn(move || cursor.step())
    }
    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        self.kinds.capacity()
            + self.lines.capacity()
            + self.masks.capacity() * 2
            + self.values.capacity() * 8
            + self.ints.capacity() * 4
            + self.text.capacity()
            + self.jumps.capacity() * size_of::<Source>()
            + self.checkpoints.capacity() * size_of::<Checkpoint>()
            + self.frames.bytes()
            + size_of::<Program>()
    }
    /// The name of a file.
    pub fn file_name(&self, file: FileId) -> Option<&str> {
        self.files.iter().find(|(id, _)| *id == file).map(|(_, n)| n.as_str())
    }
    /// The frames from a place's own outward.
    pub fn call_stack(&self, source: Source) -> impl Iterator<Item = &Frame> {
        let mut next = self.frames.get(source.frame);
        std::iter::from_fn(move || {
            let frame = next?;
            next = if frame.parent < frame.id { self.frames.get(frame.parent) } else { None };
            Some(frame)
        })
    }
    /// Adds the operations of another program that begins where this one stops.
    pub fn append(&mut self, other: &Program) {
        let mut builder = Builder::resume(std::mem::take(self));
        let mut cursor = other.cursor();
        while let Some(view) = cursor.next() {
            builder.push_to(view.op, view.end, view.source);
        }
        *self = builder.finish();
        for frame in other.frames.iter() {
            let name = other.frames.name(frame).into();
            let (parent, file, line, pass) = (frame.parent, frame.file, frame.line, frame.pass);
            self.frames.add(frame.id, &gr_canon::CallFrame { parent, file, line, name, pass });
        }
    }
}

/// One operation with what surrounds it.
#[derive(Debug)]
pub struct View<'c, 'p> {
    /// Its number, from 0.
    pub index: usize,
    /// The operation.
    pub op: Op<'p>,
    /// Pose before (in the frame before).
    pub start: &'c Pose,
    /// Pose after (in the frame after).
    pub end: &'c Pose,
    /// State in force, this operation included.
    pub state: &'c State,
    /// Where it comes from.
    pub source: Source,
}

/// One operation with its poses, by value.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Step<'p> {
    /// Its number, from 0.
    pub index: usize,
    /// The operation.
    pub op: Op<'p>,
    /// Pose before.
    pub start: Pose,
    /// Pose after.
    pub end: Pose,
    /// Where it comes from.
    pub source: Source,
}

/// Reads a program in order. `next` lends, so it is no `Iterator`: `while let Some(view) = cursor.next()`.
#[derive(Clone, Debug)]
pub struct Cursor<'p> {
    program: &'p Program,
    at: Place,
    start: Pose,
    end: Pose,
    state: State,
    source: Source,
}

impl<'p> Cursor<'p> {
    /// The next operation.
    #[allow(clippy::should_implement_trait)]
    #[inline]
    pub fn next(&mut self) -> Option<View<'_, 'p>> {
        let index = self.at.op;
        let op = self.advance()?;
        Some(View { index, op, start: &self.start, end: &self.end, state: &self.state, source: self.source })
    }
    /// The state after what has been read.
    pub fn state(&self) -> &State {
        &self.state
    }
    /// The pose after what has been read.
    pub fn pose(&self) -> &Pose {
        &self.end
    }
    /// How many operations have been read.
    pub fn index(&self) -> usize {
        self.at.op
    }
    fn step(&mut self) -> Option<Step<'p>> {
        let index = self.at.op;
        let op = self.advance()?;
        Some(Step { index, op, start: self.start, end: self.end, source: self.source })
    }

    #[inline]
    fn advance(&mut self) -> Option<Op<'p>> {
        let program = self.program;
        let kind = *program.kinds.get(self.at.op)?;
        let by = *program.lines.get(self.at.op)?;
        if by == JUMP {
            self.source = *program.jumps.get(self.at.jump)?;
            self.at.jump += 1;
        } else {
            self.source.line = self.source.line.wrapping_add_signed(i32::from(by));
        }
        self.start = self.end;
        self.at.op += 1;
        if kind <= code::LAST_MOVE {
            self.read_pose()?;
            if kind == code::LINEAR {
                return Some(Op::Linear);
            }
        }
        let op = self.decode(kind)?;
        if kind > code::LAST_MOVE {
            self.state.apply(&op, &mut self.end);
        }
        Some(op)
    }

    #[inline]
    fn read_pose(&mut self) -> Option<()> {
        let mask = *self.program.masks.get(self.at.mask)?;
        self.at.mask += 1;
        let mut axes = mask & 0x1ff;
        while axes != 0 {
            let axis = axes.trailing_zeros() as usize;
            self.end.axes[axis] = self.value()?;
            axes &= axes - 1;
        }
        if mask >> 9 != 0 {
            self.read_orientation(mask)?;
        }
        Some(())
    }

    fn read_orientation(&mut self, mask: u16) -> Option<()> {
        if mask & AXIS_SET != 0 {
            self.end.tool_axis = Some(self.three()?);
        } else if mask & AXIS_GONE != 0 {
            self.end.tool_axis = None;
        }
        if mask & SPIN_SET != 0 {
            self.end.spin = Some(self.value()?);
        } else if mask & SPIN_GONE != 0 {
            self.end.spin = None;
        }
        Some(())
    }

    #[inline]
    fn value(&mut self) -> Option<f64> {
        let v = *self.program.values.get(self.at.value)?;
        self.at.value += 1;
        Some(v)
    }
    fn int(&mut self) -> Option<i32> {
        let v = *self.program.ints.get(self.at.int)?;
        self.at.int += 1;
        Some(v)
    }
    fn three(&mut self) -> Option<[f64; 3]> {
        Some([self.value()?, self.value()?, self.value()?])
    }
    fn nine(&mut self) -> Option<Axes> {
        let slice = self.program.values.get(self.at.value..self.at.value + 9)?;
        self.at.value += 9;
        Axes::try_from(slice).ok()
    }
    fn slice(&mut self, count: usize) -> Option<&'p [f64]> {
        let end = self.at.value.checked_add(count)?;
        let slice = self.program.values.get(self.at.value..end)?;
        self.at.value = end;
        Some(slice)
    }
    fn str(&mut self) -> Option<&'p str> {
        let end = self.at.text.checked_add(usize::try_from(self.int()?).ok()?)?;
        let s = self.program.text.get(self.at.text..end)?;
        self.at.text = end;
        Some(s)
    }
    fn arc(&mut self, free: bool) -> Option<Arc> {
        let turns = self.int()?;
        if free {
            let center = self.three()?;
            return Some(Arc { plane: ArcPlane::Free(self.three()?), center, turns });
        }
        let plane = code::plane(self.int()?);
        let (first, second, _) = crate::state::plane_axes(plane);
        let mut center = self.start.xyz();
        center[first] = self.value()?;
        center[second] = self.value()?;
        Some(Arc { plane: ArcPlane::Work(plane), center, turns })
    }
}

const AXIS_SET: u16 = 1 << 9;
const SPIN_SET: u16 = 1 << 10;
const AXIS_GONE: u16 = 1 << 11;
const SPIN_GONE: u16 = 1 << 12;

/// Builds a program operation by operation.
#[derive(Clone, Debug, Default)]
pub struct Builder {
    program: Program,
    pose: Pose,
    state: State,
    source: Source,
}

impl Builder {
    /// Starts empty, at the origin of everything.
    pub fn new() -> Builder {
        Builder::default()
    }
    /// Starts empty, from a pose and a state (for programs built in pieces).
    pub fn from_state(pose: Pose, state: State) -> Builder {
        let program = Program { start: pose, start_state: state, ..Program::default() };
        Builder { program, pose, state, ..Builder::default() }
    }
    /// Sets what the program starts from, keeping files and frames. Only before the first operation.
    pub(crate) fn restart(&mut self, pose: Pose, state: State) {
        (self.program.start, self.program.start_state) = (pose, state);
        (self.pose, self.state) = (pose, state);
    }
    /// Goes on with a program.
    pub fn resume(program: Program) -> Builder {
        let cursor = program.cursor_at(program.len());
        let (pose, state, source) = (cursor.end, cursor.state, cursor.source);
        Builder { program, pose, state, source }
    }
    /// The pose so far.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }
    /// The state so far.
    pub fn state(&self) -> &State {
        &self.state
    }
    /// Number of operations so far.
    pub fn len(&self) -> usize {
        self.program.len()
    }
    /// Whether there is none yet.
    pub fn is_empty(&self) -> bool {
        self.program.is_empty()
    }
    /// Names a file.
    pub fn file(&mut self, id: FileId, name: &str) {
        self.program.files.push((id, name.to_owned()));
    }
    /// Adds a node of the call tree.
    pub fn frame(&mut self, id: FrameId, frame: &gr_canon::CallFrame) {
        self.program.frames.add(id, frame);
    }
    /// Takes over the names of another program's files and its call tree.
    pub fn names_of(&mut self, other: &Program) {
        self.program.files.extend_from_slice(&other.files);
        self.program.frames = other.frames.clone();
    }
    /// The program.
    pub fn finish(mut self) -> Program {
        let p = &mut self.program;
        p.kinds.shrink_to_fit();
        p.lines.shrink_to_fit();
        p.masks.shrink_to_fit();
        p.values.shrink_to_fit();
        p.ints.shrink_to_fit();
        p.text.shrink_to_fit();
        p.jumps.shrink_to_fit();
        p.checkpoints.shrink_to_fit();
        self.program
    }

    /// Adds an operation that does not move the tool.
    pub fn push(&mut self, op: Op<'_>, source: Source) {
        let end = self.pose;
        self.push_to(op, &end, source);
    }

    /// Adds an operation. Where it does not move the tool, `end` is ignored.
    pub fn push_to(&mut self, op: Op<'_>, end: &Pose, source: Source) {
        if self.program.kinds.len().is_multiple_of(STRIDE) && !self.program.kinds.is_empty() {
            self.checkpoint();
        }
        self.trace(source);
        let kind = code::kind(&op);
        self.program.kinds.push(kind);
        if kind <= code::LAST_MOVE {
            self.write_pose(end);
            if kind == code::LINEAR {
                return;
            }
            self.encode(&op);
        } else {
            self.encode(&op);
            self.state.apply(&op, &mut self.pose);
        }
    }

    fn checkpoint(&mut self) {
        let p = &self.program;
        let place = Place {
            op: p.kinds.len(),
            mask: p.masks.len(),
            value: p.values.len(),
            int: p.ints.len(),
            text: p.text.len(),
            jump: p.jumps.len(),
        };
        let checkpoint = Checkpoint { place, pose: self.pose, state: self.state, source: self.source };
        self.program.checkpoints.push(checkpoint);
    }

    #[inline]
    fn trace(&mut self, source: Source) {
        let by = i64::from(source.line) - i64::from(self.source.line);
        let near = source.file == self.source.file && source.frame == self.source.frame;
        match i8::try_from(by) {
            Ok(by) if near && by != JUMP => self.program.lines.push(by),
            _ => {
                self.program.lines.push(JUMP);
                self.program.jumps.push(source);
            }
        }
        self.source = source;
    }

    #[inline]
    fn write_pose(&mut self, end: &Pose) {
        let mut mask = 0u16;
        for (i, (new, old)) in end.axes.iter().zip(&self.pose.axes).enumerate() {
            // Bits, not values: -0 and 0 stay apart, so text and columns say the same.
            if new.to_bits() != old.to_bits() {
                mask |= 1 << i;
                self.program.values.push(*new);
            }
        }
        if end.tool_axis != self.pose.tool_axis {
            mask |= if end.tool_axis.is_some() { AXIS_SET } else { AXIS_GONE };
            self.program.values.extend(end.tool_axis.iter().flatten());
        }
        if end.spin != self.pose.spin {
            mask |= if end.spin.is_some() { SPIN_SET } else { SPIN_GONE };
            self.program.values.extend(end.spin);
        }
        self.program.masks.push(mask);
        self.pose = *end;
    }

    fn int(&mut self, v: i32) {
        self.program.ints.push(v);
    }
    fn values(&mut self, v: &[f64]) {
        self.program.values.extend_from_slice(v);
    }
    fn str(&mut self, s: &str) {
        self.int(i32::try_from(s.len()).unwrap_or(0));
        if i32::try_from(s.len()).is_ok() {
            self.program.text.push_str(s);
        }
    }
}
