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
        for at in memchr::memchr2_iter(b'\n', b'\r', text) {
            let crlf = text[at] == b'\r' && text.get(at + 1) == Some(&b'\n');
            if !crlf {
                starts.push(at as u32 + 1);
            }
        }
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

#[cfg(test)]
mod tests {
    use super::LineIndex;

    #[test]
    fn every_kind_of_line_end() {
        let index = LineIndex::new(b"a\r\nb\rc\n");
        assert_eq!(index.count(), 4);
        assert_eq!((index.start(1), index.start(2), index.start(3), index.start(9)), (3, 5, 7, 7));
        assert_eq!(index.position(4), (1, 1));
        assert_eq!(index.position(7), (3, 0));
    }
}
