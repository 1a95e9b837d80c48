//! What a stretch with control flow is entered and left with, so that it does not matter how many lines stand above:
//! labels by chunk, and the way from lines of then to lines of now.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use gr_canon::{CallFrame, FileId, FrameId};
use gr_interp::{Carry, LabelAt, LabelName, Met};
use rustc_hash::FxHashMap;

use crate::db::ChunkText;
use crate::engine::End;
use crate::layout::Starts;
use crate::library::Came;
use crate::lints::{Found, Summary, Where};

/// What control flow has left behind. Labels of the main file stand in their chunks.
///
/// A program may have as many labels as lines, and most stretches add few: labels stand in layers that are shared, each
/// more than twice as big as the next.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub(crate) struct Carried {
    pub(crate) carry: Carry,
    layers: Vec<Arc<Layer>>,
    /// Files that labels point into, ascending.
    files: Box<[FileId]>,
}

#[derive(Debug, Default)]
struct Layer {
    labels: FxHashMap<LabelName, Label>,
    hash: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
struct Label {
    /// In the main file: as if it were on line 0.
    at: LabelAt,
    /// Where it is in the main file.
    home: Option<Home>,
}

/// A place in the main file that edits of other lines leave as it is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) enum Home {
    /// The chunk and its statement.
    Statement(ChunkText, u32),
    /// The chunk and its line.
    Line(ChunkText, u32),
}

impl PartialEq for Layer {
    fn eq(&self, other: &Layer) -> bool {
        std::ptr::eq(self, other) || (self.hash == other.hash && self.labels == other.labels)
    }
}

impl Eq for Layer {}

impl Hash for Layer {
    fn hash<H: Hasher>(&self, h: &mut H) {
        h.write_u64(self.hash);
    }
}

impl Layer {
    fn new(labels: FxHashMap<LabelName, Label>) -> Layer {
        let one = |entry: (&LabelName, &Label)| {
            let mut hasher = rustc_hash::FxHasher::default();
            entry.hash(&mut hasher);
            hasher.finish()
        };
        // The order of the entries must not matter.
        let hash = labels.iter().map(one).fold(0, u64::wrapping_add);
        Layer { labels, hash }
    }
}

impl Carried {
    /// What a run that began with this leaves behind. Lines of `met` are those of the file.
    pub(crate) fn after(&self, carry: Carry, met: Met, main: FileId, place: &dyn Fn(u32) -> Option<Home>) -> Carried {
        let before = if met.forgot { Carried::default() } else { self.clone() };
        let Carried { mut layers, files, .. } = before;
        let mut files = files.into_vec();
        let mut added = FxHashMap::default();
        for (name, at) in met.labels {
            let home = if at.file() == main { place(at.line()) } else { None };
            added.insert(name, Label { at: home.map_or(at, |_| at.on_line(0)), home });
            if let Err(place) = files.binary_search(&at.file()) {
                files.insert(place, at.file());
            }
        }
        while let Some(last) = layers.pop_if(|last| last.labels.len() <= 2 * added.len()) {
            for (name, label) in &last.labels {
                added.entry(name.clone()).or_insert(*label);
            }
        }
        if !added.is_empty() {
            layers.push(Arc::new(Layer::new(added)));
        }
        Carried { carry, layers, files: files.into() }
    }
    /// Where a label is.
    pub(crate) fn label(&self, name: &LabelName) -> Option<(LabelAt, Option<Home>)> {
        let label = self.layers.iter().rev().find_map(|layer| layer.labels.get(name))?;
        Some((label.at, label.home))
    }
    /// Files that labels point into.
    pub(crate) fn files(&self) -> &[FileId] {
        &self.files
    }
    /// An error makes the controller forget all labels.
    pub(crate) fn without_labels(&self) -> Carried {
        Carried { carry: self.carry.clone(), ..Carried::default() }
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
