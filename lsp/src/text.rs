//! The text of an open document in pieces of whole lines: an edit copies a piece, a snapshot copies none.
//!
//! Lines end with LF, CRLF or a lone CR, as the protocol has it. Positions outside of the text are taken back to its
//! nearest place.

use std::sync::{Arc, OnceLock};

use gr_text::Span;
use tower_lsp::ls_types::{Position, Range};

/// How the client counts columns.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Columns {
    /// Bytes.
    Utf8,
    /// UTF-16 code units.
    #[default]
    Utf16,
}

/// Bytes in a piece, about.
const PIECE: usize = 16 * 1024;

#[derive(Debug)]
struct Piece {
    text: gr_text::Text,
    /// Line ends.
    lines: u32,
    /// Of an exchange file: ids and bytes of the instances that begin here, ascending; made when first asked for.
    instances: OnceLock<Box<[(u64, u32)]>>,
}

/// A text.
#[derive(Clone, Debug, Default)]
pub struct Text {
    /// All but the last end with LF.
    pieces: Vec<Arc<Piece>>,
    /// First byte and first line of each piece, and the sums.
    starts: Vec<(u32, u32)>,
}

fn line_ends(text: &str) -> u32 {
    let bytes = text.as_bytes();
    let ends = memchr::memchr2_iter(b'\n', b'\r', bytes);
    ends.filter(|at| bytes[*at] == b'\n' || bytes.get(at + 1) != Some(&b'\n')).count() as u32
}

/// Cuts behind line feeds.
fn split(text: &gr_text::Text) -> Vec<Arc<Piece>> {
    let mut pieces = Vec::with_capacity(text.len() / PIECE + 1);
    let mut start = 0;
    while start < text.len() {
        let next = text.as_bytes().get(start + PIECE..).and_then(|rest| memchr::memchr(b'\n', rest));
        let end = next.map_or(text.len(), |n| start + PIECE + n + 1);
        let part = text.part(start..end);
        pieces.push(Arc::new(Piece { lines: line_ends(&part), text: part, instances: OnceLock::new() }));
        start = end;
    }
    pieces
}

impl Text {
    /// A text, whose bytes it shares.
    pub fn new(text: impl Into<gr_text::Text>) -> Text {
        let mut out = Text { pieces: split(&text.into()), starts: Vec::new() };
        out.sum();
        out
    }
    fn sum(&mut self) {
        self.starts.clear();
        let (mut byte, mut line) = (0, 0);
        for p in &self.pieces {
            self.starts.push((byte, line));
            byte += p.text.len() as u32;
            line += p.lines;
        }
        self.starts.push((byte, line));
    }
    /// Bytes.
    pub fn len(&self) -> u32 {
        self.starts.last().map_or(0, |s| s.0)
    }
    /// Lines; a text that ends with a line end has an empty one behind it.
    pub fn lines(&self) -> u32 {
        self.starts.last().map_or(0, |s| s.1) + 1
    }
    /// The piece that holds a byte; of the end, the last one.
    fn piece_of(&self, byte: u32) -> Option<usize> {
        let n = self.starts.partition_point(|s| s.0 <= byte).saturating_sub(1);
        (!self.pieces.is_empty()).then(|| n.min(self.pieces.len() - 1))
    }
    /// Replaces some bytes.
    pub fn edit(&mut self, range: std::ops::Range<u32>, new: &str) {
        let end = range.end.min(self.len());
        let start = range.start.min(end);
        let (Some(first), Some(mut last)) = (self.piece_of(start), self.piece_of(end)) else {
            *self = Text::new(new);
            return;
        };
        let (head, tail) = (&self.pieces[first].text, &self.pieces[last].text);
        let cut = floor(head, (start - self.starts[first].0) as usize);
        let resume = floor(tail, (end - self.starts[last].0) as usize);
        let mut text = String::with_capacity(cut + new.len() + tail.len() - resume);
        text.push_str(&head[..cut]);
        text.push_str(new);
        text.push_str(&tail[resume..]);
        // A piece ends with LF unless it is the last: an open line takes in what follows.
        while !text.ends_with('\n') && last + 1 < self.pieces.len() {
            last += 1;
            text.push_str(&self.pieces[last].text);
        }
        self.pieces.splice(first..=last, split(&text.into()));
        self.sum();
    }
    /// First byte of a line; past the end, the length.
    pub fn line_start(&self, line: u32) -> u32 {
        let n = self.starts.partition_point(|s| s.1 < line).saturating_sub(1);
        let Some(piece) = self.pieces.get(n) else { return self.len() };
        let (byte, mut at) = self.starts[n];
        if at >= line {
            return byte;
        }
        let bytes = piece.text.as_bytes();
        for end in memchr::memchr2_iter(b'\n', b'\r', bytes) {
            if bytes[end] == b'\n' || bytes.get(end + 1) != Some(&b'\n') {
                at += 1;
                if at == line {
                    return byte + end as u32 + 1;
                }
            }
        }
        self.len()
    }
    /// Text of a line without its end, and its first byte.
    pub fn line(&self, line: u32) -> (String, u32) {
        let start = self.line_start(line);
        let end = if line + 1 >= self.lines() { self.len() } else { self.line_start(line + 1) };
        let text = self.slice(Span::new(start, end));
        (text.trim_end_matches(['\n', '\r']).to_string(), start)
    }
    /// Byte of a position.
    pub fn offset(&self, p: Position, columns: Columns) -> u32 {
        if p.line >= self.lines() {
            return self.len();
        }
        let (line, start) = self.line(p.line);
        if columns == Columns::Utf8 {
            return start + floor(&line, p.character as usize) as u32;
        }
        let mut units = 0;
        for (at, c) in line.char_indices() {
            if units >= p.character {
                return start + at as u32;
            }
            units += c.len_utf16() as u32;
        }
        start + line.len() as u32
    }
    /// Position of a byte.
    pub fn position(&self, offset: u32, columns: Columns) -> Position {
        let offset = offset.min(self.len());
        let Some(n) = self.piece_of(offset) else { return Position::default() };
        let (byte, first) = self.starts[n];
        let text = &self.pieces[n].text;
        let inside = floor(text, (offset - byte) as usize);
        let bytes = text.as_bytes();
        let (mut line, mut start) = (first, 0);
        for end in memchr::memchr2_iter(b'\n', b'\r', &bytes[..inside]) {
            if bytes[end] == b'\n' || bytes.get(end + 1) != Some(&b'\n') {
                line += 1;
                start = end + 1;
            }
        }
        let before = &text[start..inside];
        let character = if columns == Columns::Utf8 || before.is_ascii() { before.len() as u32 } else { before.encode_utf16().count() as u32 };
        Position { line, character }
    }
    /// Range of some bytes.
    pub fn range(&self, span: Span, columns: Columns) -> Range {
        Range { start: self.position(span.start, columns), end: self.position(span.end.max(span.start), columns) }
    }
    /// Some bytes of it.
    pub fn slice(&self, span: Span) -> String {
        let end = span.end.min(self.len());
        let start = span.start.min(end);
        let (Some(first), Some(last)) = (self.piece_of(start), self.piece_of(end)) else { return String::new() };
        let mut out = String::with_capacity((end - start) as usize);
        for n in first..=last {
            let (byte, text) = (self.starts[n].0, &self.pieces[n].text);
            let from = floor(text, start.saturating_sub(byte) as usize);
            let to = floor(text, (end - byte) as usize);
            out.push_str(&text[from.min(to)..to]);
        }
        out
    }
    /// Byte of the `#` of an instance of an exchange file. Pieces that an edit left alone are not looked at again, so
    /// that this is quick in files of any size; a statement whose beginning is hidden in a string or comment over
    /// several lines may be missed.
    pub fn instance(&self, id: u64) -> Option<u32> {
        self.pieces.iter().zip(&self.starts).find_map(|(p, (start, _))| {
            let list = p.instances.get_or_init(|| {
                let mut all: Vec<(u64, u32)> = gr_p21::index(p.text.as_bytes()).entries.iter().map(|e| (e.id, e.start)).collect();
                all.sort_unstable();
                all.into()
            });
            list.binary_search_by_key(&id, |e| e.0).ok().map(|n| start + list[n].1)
        })
    }
    /// Pieces in order, with the first byte of each.
    pub fn pieces(&self) -> impl Iterator<Item = (u32, &str)> {
        self.pieces.iter().zip(&self.starts).map(|(p, s)| (s.0, &*p.text))
    }
}

impl std::fmt::Display for Text {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.pieces.iter().try_for_each(|p| f.write_str(&p.text))
    }
}

/// The character boundary at or before `at`.
fn floor(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn naive_lines(text: &str) -> Vec<usize> {
        let b = text.as_bytes();
        let mut starts = vec![0];
        starts.extend((0..b.len()).filter(|i| b[*i] == b'\n' || (b[*i] == b'\r' && b.get(i + 1) != Some(&b'\n'))).map(|i| i + 1));
        starts
    }

    proptest! {
        #[test]
        fn edits_and_positions_are_those_of_a_string(
            start in "[a\r\né𝄞]{0,40}",
            edits in proptest::collection::vec((0u32..60, 0u32..20, "[b\r\nü𝄞]{0,12}"), 0..8),
            probe in (0u32..12, 0u32..12),
        ) {
            let mut text = Text::new(&start);
            let mut plain = start;
            for (at, len, new) in edits {
                let from = floor(&plain, at as usize);
                let to = floor(&plain, from + len as usize);
                plain.replace_range(from..to.max(from), &new);
                text.edit(from as u32..to.max(from) as u32, &new);
                prop_assert_eq!(&text.to_string(), &plain);
                prop_assert_eq!(text.lines() as usize, naive_lines(&plain).len());
            }
            for columns in [Columns::Utf8, Columns::Utf16] {
                let position = Position { line: probe.0, character: probe.1 };
                let offset = text.offset(position, columns);
                prop_assert!(plain.is_char_boundary(offset as usize));
                for (at, _) in plain.char_indices().chain([(plain.len(), ' ')]) {
                    // Inside of CRLF there is no position.
                    if at > 0 && plain.as_bytes()[at - 1] == b'\r' && plain.as_bytes().get(at) == Some(&b'\n') {
                        continue;
                    }
                    let p = text.position(at as u32, columns);
                    prop_assert_eq!(text.offset(p, columns) as usize, at);
                }
            }
        }
    }

    #[test]
    fn many_pieces() {
        let plain: String = (0..5_000).map(|i| format!("G1 X{i}\n")).collect();
        let mut text = Text::new(&plain);
        assert!(text.pieces.len() > 2);
        let at = text.line_start(4_321);
        assert_eq!(text.line(4_321).0, "G1 X4321");
        assert_eq!(text.position(at + 3, Columns::Utf16), Position { line: 4_321, character: 3 });
        text.edit(0..at, "");
        assert_eq!(text.line(0), ("G1 X4321".into(), 0));
        assert_eq!(text.instance(1), None);
        let plan: String = (1..5_000).map(|i| format!("#{i}=A(#{});\n", i + 1)).collect();
        let mut plan = Text::new(&plan);
        let at = plan.instance(4_000).expect("it is there");
        assert!(plan.slice(Span::new(at, at + 9)).starts_with("#4000=A(#"));
        plan.edit(0..0, "/* new */\n");
        assert_eq!(plan.instance(4_000), Some(at + 10));
        assert_eq!(text.offset(Position { line: 9_999_999, character: 0 }, Columns::Utf16), text.len());
    }
}
