/// Byte offset ↔ line and column, both counted from 0. Lines end with LF, CRLF or a lone CR.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineIndex {
    starts: Box<[u32]>,
    len: u32,
}

impl LineIndex {
    /// Indexes `text`.
    pub fn new(text: &[u8]) -> LineIndex {
        let mut starts = Vec::with_capacity(text.len() / 24 + 1);
        starts.push(0);
        starts.extend(starts_behind(text, 0));
        LineIndex { starts: starts.into(), len: text.len() as u32 }
    }
    /// Number of lines; a text that ends with a line end has an empty last line.
    pub fn count(&self) -> usize {
        self.starts.len()
    }
    /// Start of a line; past the end, the length of the text.
    pub fn start(&self, line: usize) -> u32 {
        self.starts.get(line).copied().unwrap_or(self.len)
    }
    /// Line and byte column of an offset.
    pub fn position(&self, offset: u32) -> (u32, u32) {
        let line = self.starts.partition_point(|s| *s <= offset).saturating_sub(1);
        (line as u32, offset - self.starts[line])
    }
}

/// Starts of the lines that begin behind `from`.
fn starts_behind(text: &[u8], from: u32) -> impl Iterator<Item = u32> {
    let ends = memchr::memchr2_iter(b'\n', b'\r', text.get(from as usize..).unwrap_or_default());
    let ends = ends.map(move |at| at + from as usize);
    ends.filter(|at| text[*at] != b'\r' || text.get(at + 1) != Some(&b'\n')).map(|at| at as u32 + 1)
}

/// Start of every so many lines of a text: for a few places in a text that may have more lines than an index should
/// hold. Answers are those of [`LineIndex`].
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LineMarks {
    starts: Box<[u32]>,
}

/// Lines from one mark to the next.
const MARKED: usize = 256;

impl LineMarks {
    /// Marks `text`, which is the one to ask about.
    pub fn new(text: &[u8]) -> LineMarks {
        let starts = std::iter::once(0).chain(starts_behind(text, 0)).step_by(MARKED);
        LineMarks { starts: starts.collect() }
    }
    /// Start of a line; past the end, the length of the text.
    pub fn start(&self, text: &[u8], line: usize) -> u32 {
        let len = text.len() as u32;
        let Some(mark) = self.starts.get(line / MARKED) else { return len };
        match line % MARKED {
            0 => *mark,
            more => starts_behind(text, *mark).nth(more - 1).unwrap_or(len),
        }
    }
    /// Line and byte column of an offset.
    pub fn position(&self, text: &[u8], offset: u32) -> (u32, u32) {
        let mark = self.starts.partition_point(|s| *s <= offset).saturating_sub(1);
        let (mut line, mut start) = (mark * MARKED, self.starts[mark]);
        for next in starts_behind(text, start).take_while(|next| *next <= offset) {
            (line, start) = (line + 1, next);
        }
        (line as u32, offset - start)
    }
}

#[cfg(test)]
mod tests {
    use super::{LineIndex, LineMarks, MARKED};

    #[test]
    fn marks_answer_like_an_index() {
        let text: String = (0..3 * MARKED + 7).map(|i| ["G1\r\n", "\n", "X\r", "Y1\n"][i % 4]).collect();
        for text in [text.as_str(), "", "\r", "a\r\nb"] {
            let (index, marks) = (LineIndex::new(text.as_bytes()), LineMarks::new(text.as_bytes()));
            for offset in 0..=text.len() as u32 + 2 {
                assert_eq!(marks.position(text.as_bytes(), offset), index.position(offset));
            }
            for line in 0..index.count() + 3 {
                assert_eq!(marks.start(text.as_bytes(), line), index.start(line));
            }
        }
    }

    #[test]
    fn every_kind_of_line_end() {
        let index = LineIndex::new(b"a\r\nb\rc\n");
        assert_eq!(index.count(), 4);
        assert_eq!((index.start(1), index.start(2), index.start(3), index.start(9)), (3, 5, 7, 7));
        assert_eq!(index.position(4), (1, 1));
        assert_eq!(index.position(7), (3, 0));
    }
}
