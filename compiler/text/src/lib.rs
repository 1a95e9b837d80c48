//! Source text, spans and diagnostics: the ground every other crate stands on.
//!
//! Offsets are bytes. A [`Span`] is relative to the text it was made from (a chunk or a file); whoever
//! moves it to another frame says so.

mod decode;
mod diagnostic;
pub mod figures;
mod findings;
mod lines;
mod text;

pub use decode::{Decoded, Encoding, decode, decode_as_linuxcnc};
pub use diagnostic::{Diagnostic, Fix, Frame, Label};
pub use findings::Findings;
pub use gr_spec::{Code, Severity, code};
pub use lines::{LineIndex, LineMarks};
pub use text::Text;

/// Half-open byte range.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, PartialOrd, Ord)]
pub struct Span {
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

impl Span {
    /// The range `start..end`.
    pub fn new(start: u32, end: u32) -> Span {
        Span { start, end }
    }
    /// The same range seen from a frame in which this frame begins at `by`.
    pub fn shifted(self, by: u32) -> Span {
        Span { start: self.start + by, end: self.end + by }
    }
    /// As an index range.
    pub fn range(self) -> std::ops::Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A file of one compilation: an index into its file list.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, PartialOrd, Ord)]
pub struct FileId(pub u32);
