//! What may be asked about the source text of a program: the place of a line and its text.

use crate::Source;
use gr_text::{FileId, Span};

/// Gives source lines.
pub trait Sources {
    /// The bytes of a line, for messages.
    fn place(&self, source: Source) -> (FileId, Span);
    /// The text of a line (from 0); none where there is no such line or no text.
    fn line(&self, file: FileId, line: u32) -> Option<&str>;
    /// Whether U V W H of the text are increments of X Y Z C (a lathe's G-code system A).
    fn increments(&self) -> bool {
        false
    }
    /// Whether H and D of the text number offsets that hold until the next ones, of which 0 is none (a Fanuc mill).
    fn offset_numbers(&self) -> bool {
        false
    }
}

/// No text at hand.
pub struct NoSources;

impl Sources for NoSources {
    fn place(&self, source: Source) -> (FileId, Span) {
        (source.file, Span::default())
    }
    fn line(&self, _file: FileId, _line: u32) -> Option<&str> {
        None
    }
}

/// Whole texts by file number.
pub struct Texts<'a> {
    files: Vec<(FileId, &'a str, gr_text::LineIndex)>,
    words: bool,
    increments: bool,
    offset_numbers: bool,
}

impl<'a> Texts<'a> {
    /// Indexes the lines of some files.
    pub fn new(files: impl IntoIterator<Item = (FileId, &'a str)>) -> Texts<'a> {
        let files = files.into_iter().map(|(id, t)| (id, t, gr_text::LineIndex::new(t.as_bytes())));
        Texts { files: files.collect(), words: true, increments: false, offset_numbers: false }
    }
    /// Of instances of a STEP-NC file: their lines have places and no words.
    pub fn instances(self) -> Texts<'a> {
        Texts { words: false, ..self }
    }
    /// Of a lathe whose U V W H are increments, if so.
    pub fn with_increments(self, increments: bool) -> Texts<'a> {
        Texts { increments, ..self }
    }
    /// Of a Fanuc mill, whose H and D hold, if so.
    pub fn with_offset_numbers(self, offset_numbers: bool) -> Texts<'a> {
        Texts { offset_numbers, ..self }
    }
    fn span(&self, file: FileId, line: u32) -> Option<(&'a str, Span)> {
        let (_, text, index) = self.files.iter().find(|f| f.0 == file)?;
        let line = line as usize;
        if line >= index.count() {
            return None;
        }
        let (start, end) = (index.start(line), index.start(line.checked_add(1)?));
        let body = text.get(start as usize..end as usize)?.trim_end_matches(['\r', '\n']);
        Some((body, Span::new(start, start + body.len() as u32)))
    }
}

impl Sources for Texts<'_> {
    fn place(&self, source: Source) -> (FileId, Span) {
        (source.file, self.span(source.file, source.line).map(|s| s.1).unwrap_or_default())
    }
    fn line(&self, file: FileId, line: u32) -> Option<&str> {
        self.span(file, line).filter(|_| self.words).map(|s| s.0)
    }
    fn increments(&self) -> bool {
        self.increments
    }
    fn offset_numbers(&self) -> bool {
        self.offset_numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_texts() {
        let texts = Texts::new([(FileId(3), "G0 X1\r\nG1 X2")]);
        assert_eq!(texts.line(FileId(3), 1), Some("G1 X2"));
        assert_eq!(texts.line(FileId(3), 2), None);
        let at = Source { file: FileId(3), line: 0, ..Source::default() };
        assert_eq!(texts.place(at), (FileId(3), Span::new(0, 5)));
    }
}
