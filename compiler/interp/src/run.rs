use std::sync::Arc;

use gr_canon::{At, Axes, Call, FileId, FrameId, Mark, Sink};
use gr_gcode::{File, Scan};

use crate::queue::Queue;
use crate::{Block, Modal, Params, Setup, ToolTable};

/// Where the interpreter gets files from.
pub trait Files {
    /// A file that was given out before.
    fn file(&self, id: FileId) -> &File;
    /// The file of an external subroutine, found along [`crate::subroutine_paths`].
    fn find_sub(&mut self, name: &str) -> Option<FileId>;
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

/// The line read last; its text is what `At::now` shows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reading {
    pub text: Arc<str>,
    pub scan: Arc<Scan>,
    pub start: u32,
    pub end: u32,
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
    pub(crate) place: Place,
    pub(crate) reading: Reading,
    #[allow(dead_code)]
    pub(crate) files: &'a mut dyn Files,
    pub(crate) calls: u64,
}

impl<S: Sink> Interp<'_, S> {
    /// Sends a call of the current block.
    #[inline]
    pub(crate) fn emit(&mut self, call: Call) {
        self.emit_at(self.place, &call);
    }
    /// Sends a call that an earlier block asked for.
    #[inline]
    pub(crate) fn emit_at(&mut self, place: Place, call: &Call) {
        self.calls += 1;
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
    /// End point of the block's axis words in program units and the active frame.
    pub(crate) fn find_ends(&mut self) -> crate::Res<Axes> {
        Ok(self.m.current)
    }
}
