//! A program that is read once from top to bottom: chunks are scanned when they are wanted and then forgotten,
//! so that a big file needs little more memory than its text. As soon as something needs the file as a whole
//! (control flow, jumps back), it is scanned as a whole.

use std::cell::{OnceCell, RefCell};
use std::sync::Arc;

use gr_gcode::{Chunk, File};
use gr_spec::Dialect;
use gr_text::Text;

/// Lines in a chunk; the tables of more would leave the processor's cache and fault in new pages.
const CHUNK: usize = 1024;

/// A text that is scanned as it is read.
pub struct Lazy {
    path: Box<str>,
    text: Text,
    dialect: &'static Dialect,
    reading: RefCell<Reading>,
    whole: OnceCell<File>,
}

#[derive(Default)]
struct Reading {
    /// The chunk scanned last and its first line.
    last: Option<(Chunk, u32)>,
    /// First byte and first line behind it.
    next: (usize, u32),
    /// Something scanned so far has control flow or damage.
    structured: bool,
}

impl Lazy {
    /// Nothing is scanned yet.
    pub fn new(path: &str, text: Text, dialect: &'static Dialect) -> Lazy {
        Lazy { path: path.into(), text, dialect, reading: RefCell::default(), whole: OnceCell::new() }
    }
    /// The text.
    pub fn text(&self) -> &Text {
        &self.text
    }
    /// Its name.
    pub fn path(&self) -> &str {
        &self.path
    }
    /// The whole file, scanned now if it was not.
    pub fn file(&self) -> &File {
        self.whole.get_or_init(|| crate::disk::file_of(&self.path, &self.text, CHUNK, self.dialect))
    }
    /// Nothing scanned so far has control flow or damage.
    pub fn is_plain(&self) -> bool {
        self.whole.get().is_none() && !self.reading.borrow().structured
    }
    /// The chunk that holds a line, the line's number in it, and the number of its first line.
    pub fn chunk(&self, line: u32) -> Option<(Chunk, u32, u32)> {
        if self.whole.get().is_none()
            && let Some(found) = self.read_on(line)
        {
            return found;
        }
        let file = self.file();
        let (c, l) = file.locate(line)?;
        Some((file.chunks[c].clone(), l, file.first_lines[c]))
    }

    /// Reads on until a line is there. The outer `None`: it was there before and is forgotten.
    #[expect(clippy::option_option, reason = "forgotten and past the end are two things")]
    fn read_on(&self, line: u32) -> Option<Option<(Chunk, u32, u32)>> {
        let mut reading = self.reading.borrow_mut();
        loop {
            if let Some((chunk, first)) = &reading.last {
                let count = chunk.scan.lines.len() as u32;
                if line < *first {
                    return None;
                }
                if line < first + count {
                    return Some(Some((chunk.clone(), line - first, *first)));
                }
            }
            let (from, first) = reading.next;
            if from >= self.text.len() {
                return Some(None);
            }
            let rest = &self.text[from..];
            let end = memchr::memchr_iter(b'\n', rest.as_bytes()).nth(CHUNK - 1).map_or(rest.len(), |at| at + 1);
            let scan = gr_gcode::scan(&rest[..end], self.dialect);
            reading.structured |= !scan.controls.is_empty() || !scan.faults.is_empty();
            reading.next = (from + end, first + scan.lines.len() as u32);
            reading.last = Some((Chunk { text: self.text.part(from..from + end), scan: Arc::new(scan) }, first));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_those_of_the_whole_file() {
        let text: String = (0..10_000).map(|i| format!("G1 X{i}\r\nY1\rZ2\n")).collect();
        let lazy = Lazy::new("a", text.as_str().into(), Dialect::linuxcnc());
        let whole = crate::disk::file_of("a", &text.as_str().into(), 77, Dialect::linuxcnc());
        let span = |(chunk, l, _): (Chunk, u32, u32)| chunk.text[chunk.scan.line_span(&chunk.text, l).range()].to_string();
        for line in (0..whole.line_count()).step_by(997) {
            let expected = text[whole.line_span(line).range()].to_string();
            assert_eq!(lazy.chunk(line).map(span), Some(expected));
        }
        assert!(lazy.is_plain() && lazy.chunk(whole.line_count()).is_none());
        assert_eq!(lazy.chunk(0).map(span).as_deref(), Some("G1 X0"));
        assert!(!lazy.is_plain());
    }
}
