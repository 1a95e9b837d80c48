//! A G-code file as features read it: lines and words with places in the whole file.

use gr_gcode::{Chunk, File, Form, Word};
use gr_spec::Dialect;
use gr_text::Span;

/// A file and the dialect it was scanned with.
#[derive(Clone, Copy)]
pub struct Doc<'a> {
    /// Text and tables.
    pub file: &'a File,
    /// Its language.
    pub dialect: &'static Dialect,
}

/// A line with everything needed to read it.
#[derive(Clone, Copy)]
pub struct LineOf<'a> {
    /// The chunk it is in.
    pub chunk: &'a Chunk,
    /// First byte of the chunk.
    pub base: u32,
    /// Its number in the file.
    pub line: u32,
    /// Its number in the chunk.
    pub at: u32,
}

impl<'a> LineOf<'a> {
    /// Its bytes in the file, without line end.
    pub fn span(&self) -> Span {
        self.chunk.scan.line_span(&self.chunk.text, self.at).shifted(self.base)
    }
    /// Its text without line end.
    pub fn text(&self) -> &'a str {
        let span = self.chunk.scan.line_span(&self.chunk.text, self.at);
        self.chunk.text.get(span.range()).unwrap_or("")
    }
    /// Its words.
    pub fn words(&self) -> &'a [Word] {
        self.chunk.scan.words(self.at)
    }
    /// Bytes of a word in the file.
    pub fn span_of(&self, word: &Word) -> Span {
        self.chunk.scan.word_span(&self.chunk.text, self.at, word).shifted(self.base)
    }
    /// Bytes of a word in the file, blanks behind it left out.
    pub fn tight(&self, word: &Word) -> Span {
        let span = self.span_of(word);
        let text = self.slice(span);
        Span::new(span.start, span.start + text.trim_end().len() as u32)
    }
    /// Text of bytes of the file that lie in this chunk.
    pub fn slice(&self, span: Span) -> &'a str {
        let at = |v: u32| v.saturating_sub(self.base) as usize;
        self.chunk.text.get(at(span.start)..at(span.end)).unwrap_or("")
    }
    /// The word around a byte of the file, or the one that ends there.
    pub fn word_at(&self, offset: u32) -> Option<&'a Word> {
        let span = |w: &Word| self.tight(w);
        let holds = |w: &&Word| span(w).start <= offset && offset < span(w).end;
        let ends = |w: &&Word| span(w).end == offset;
        self.words().iter().find(holds).or_else(|| self.words().iter().find(ends))
    }
    /// A literal word.
    pub fn literal(&self, letter: u8) -> Option<&'a Word> {
        self.words().iter().find(|w| w.letter == letter && w.form == Form::Literal)
    }
    /// Any word with this letter.
    pub fn word(&self, letter: u8) -> Option<&'a Word> {
        self.words().iter().find(|w| w.letter == letter && matches!(w.form, Form::Literal | Form::Expr))
    }
    /// Whether it has this code: letter and ten times the number.
    pub fn has_code(&self, letter: u8, tenths: i64) -> bool {
        self.words().iter().any(|w| w.letter == letter && w.form == Form::Literal && (w.value * 10.0).round() as i64 == tenths)
    }
}

impl<'a> Doc<'a> {
    /// A line.
    pub fn line(&self, line: u32) -> Option<LineOf<'a>> {
        let (c, at) = self.file.locate(line)?;
        Some(LineOf { chunk: &self.file.chunks[c], base: self.file.starts[c], line, at })
    }
    /// Number of lines.
    pub fn count(&self) -> u32 {
        self.file.line_count()
    }
    /// Lines of a range, in order.
    pub fn lines(&self, range: std::ops::Range<u32>) -> impl Iterator<Item = LineOf<'a>> + use<'a> {
        let doc = *self;
        (range.start..range.end.min(self.count())).filter_map(move |l| doc.line(l))
    }
    /// Length in bytes.
    pub fn len(&self) -> u32 {
        self.file.starts.last().copied().unwrap_or(0)
    }
    /// Whether there is no text.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The line that holds a byte; none behind the last line break, where a line is only about to begin.
    pub fn line_at(&self, offset: u32) -> Option<LineOf<'a>> {
        let c = self.file.starts.partition_point(|s| *s <= offset).checked_sub(1)?;
        let c = c.min(self.file.chunks.len().checked_sub(1)?);
        let chunk = &self.file.chunks[c];
        if offset >= self.len() && chunk.text.ends_with(['\n', '\r']) {
            return None;
        }
        let inside = offset - self.file.starts[c];
        let at = chunk.scan.lines.partition_point(|l| l.start <= inside).checked_sub(1)? as u32;
        Some(LineOf { chunk, base: self.file.starts[c], line: self.file.first_lines[c] + at, at })
    }
    /// The whole text.
    pub fn text(&self) -> String {
        self.file.chunks.iter().map(|c| &*c.text).collect()
    }
}

/// `G`, 5.1 → `G5.1`
pub fn code_name(letter: u8, value: f64) -> String {
    let letter = letter.to_ascii_uppercase() as char;
    let tenths = (value * 10.0).round();
    if tenths % 10.0 == 0.0 { format!("{letter}{}", tenths / 10.0) } else { format!("{letter}{:.1}", tenths / 10.0) }
}

pub use gr_text::figures::{duration, number};
