//! What a stretch with control flow is entered and left with, so that it does not matter how many lines stand above:
//! labels by chunk, and the way from lines of then to lines of now.

use gr_canon::{CallFrame, FileId, FrameId};
use gr_interp::Carry;

use crate::db::ChunkText;
use crate::engine::End;
use crate::layout::Starts;
use crate::library::Came;
use crate::lints::{Found, Summary, Where};

/// What control flow has left behind. Labels of the main file are on lines of their chunks.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub(crate) struct Carried {
    carry: Carry,
    /// The chunk of each label of the main file.
    homes: Box<[Option<ChunkText>]>,
}

impl Carried {
    /// From lines of the file.
    pub(crate) fn of(mut carry: Carry, main: FileId, starts: &Starts) -> Carried {
        let home = |line: &mut u32| {
            let (chunk, first) = starts.holding(*line)?;
            *line -= first;
            Some(chunk)
        };
        let homes = carry.lines_mut(main).map(home).collect();
        Carried { carry, homes }
    }
    /// On lines of the file.
    pub(crate) fn at(&self, main: FileId, starts: &Starts) -> Carry {
        let mut carry = self.carry.clone();
        for (line, home) in carry.lines_mut(main).zip(&self.homes) {
            *line += home.and_then(|chunk| starts.of(chunk)).unwrap_or(0);
        }
        carry
    }
    /// Files that labels point into.
    pub(crate) fn files(&self) -> impl Iterator<Item = FileId> {
        self.carry.files()
    }
    /// Chunks that labels point into.
    pub(crate) fn chunks(&self) -> impl Iterator<Item = ChunkText> {
        self.homes.iter().copied().flatten()
    }
    /// An error makes the controller forget all labels.
    pub(crate) fn without_labels(&self) -> Carried {
        let mut carry = self.carry.clone();
        carry.forget_labels();
        Carried { carry, homes: Box::default() }
    }
}

/// The way from lines as they were when a stretch was run to lines as they are now.
pub(crate) struct Moved<'a> {
    came: &'a [Came],
    starts: &'a Starts,
    main: FileId,
    /// How far the stretch's first line has moved.
    by: u32,
}

impl<'a> Moved<'a> {
    /// None: everything is where it was. `chunk` is the stretch's first one.
    pub(crate) fn new(came: &'a [Came], starts: &'a Starts, main: FileId, chunk: ChunkText) -> Option<Moved<'a>> {
        let now = |c: &Came| starts.of(c.chunk).unwrap_or(c.first);
        if came.iter().all(|c| now(c) == c.first) {
            return None;
        }
        let first = came.iter().find(|c| c.chunk == chunk);
        Some(Moved { came, starts, main, by: first.map_or(0, |c| now(c).wrapping_sub(c.first)) })
    }
    /// A line that was executed, or that cutter compensation held a move of when the stretch began.
    fn line(&self, line: u32) -> u32 {
        self.moved(line, |c| line - c.first < c.lines)
    }
    /// The first line behind the stretch.
    pub(crate) fn behind(&self, line: u32) -> u32 {
        self.moved(line, |c| line - c.first <= c.lines)
    }
    fn moved(&self, line: u32, holds: impl Fn(&Came) -> bool) -> u32 {
        let came = self.came.partition_point(|c| c.first <= line).checked_sub(1).map(|at| &self.came[at]).filter(|c| holds(c));
        let now = came.and_then(|c| Some(self.starts.of(c.chunk)? + (line - c.first)));
        now.unwrap_or_else(|| line.wrapping_add(self.by))
    }
    fn place(&self, place: Where) -> Where {
        if place.file == self.main { Where { line: self.line(place.line), ..place } } else { place }
    }
    pub(crate) fn found(&self, found: &[Found]) -> Vec<Found> {
        found.iter().map(|f| Found { place: self.place(f.place), ..f.clone() }).collect()
    }
    pub(crate) fn summary(&self, summary: &Summary) -> Summary {
        summary.clone().moved(|place| self.place(place))
    }
    pub(crate) fn frames(&self, frames: &[(FrameId, CallFrame)]) -> Vec<(FrameId, CallFrame)> {
        let moved = |f: &CallFrame| if f.file == self.main { CallFrame { line: self.line(f.line), ..f.clone() } } else { f.clone() };
        frames.iter().map(|(id, frame)| (*id, moved(frame))).collect()
    }
    pub(crate) fn end(&self, end: End) -> End {
        End { line: self.line(end.line), ..end }
    }
}
