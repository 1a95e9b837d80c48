//! The text of an open file as a row of chunks of whole lines.
//!
//! Knows lengths and line counts, not texts: those live in salsa inputs, which the caller names by `T`.
//! Every chunk but the last ends with a line feed, so that no chunk border can fall into a CRLF pair, a
//! word or a comment: G-code has no token that spans lines.

use std::ops::Range;

use gr_text::Text;

/// Chunk size in lines for a file with this many lines.
pub(crate) fn chunk_lines(lines: usize) -> usize {
    if lines < 200_000 { 256 } else { 1024 }
}

/// One chunk as the store knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece<T> {
    /// Whose text it is.
    pub(crate) input: T,
    /// Bytes.
    pub(crate) len: u32,
    /// Line feeds.
    pub(crate) feeds: u32,
}

/// The chunks of a file in order; never empty.
#[derive(Clone, Debug)]
pub(crate) struct Store<T> {
    /// Chunks in order.
    pub(crate) pieces: Vec<Piece<T>>,
    /// Inputs that are not in use.
    pub(crate) free: Vec<T>,
    /// Chunk size aimed at, in lines.
    pub(crate) k: usize,
}

/// What the store needs from the owner of the texts.
pub(crate) trait Texts<T> {
    /// Text of an input.
    fn get(&self, input: T) -> Text;
    /// New text for an input.
    fn set(&mut self, input: T, text: Text);
    /// A new input.
    fn create(&mut self, text: Text) -> T;
}

impl<T: Copy> Store<T> {
    /// Splits `text` into chunks of about `k` lines.
    pub(crate) fn new(text: &Text, k: usize, texts: &mut impl Texts<T>) -> Store<T> {
        let mut pieces = Vec::new();
        for part in split(text, k) {
            let (len, feeds) = (part.len() as u32, feeds(&part));
            pieces.push(Piece { input: texts.create(part), len, feeds });
        }
        Store { pieces, free: Vec::new(), k }
    }

    /// Bytes in all.
    pub(crate) fn len(&self) -> u32 {
        self.pieces.iter().map(|p| p.len).sum()
    }

    /// Chunk that holds byte `at` (the last one for the end of the text) and its first byte.
    pub(crate) fn find(&self, at: u32) -> (usize, u32) {
        let mut start = 0;
        for (i, p) in self.pieces.iter().enumerate() {
            if at < start + p.len || i + 1 == self.pieces.len() {
                return (i, start);
            }
            start += p.len;
        }
        (0, 0)
    }

    /// Replaces the bytes `range` by `new`. Returns whether the list of chunks changed (not only texts).
    pub(crate) fn edit(&mut self, range: Range<u32>, new: &str, texts: &mut impl Texts<T>) -> bool {
        let len = self.len();
        let (from, to) = (range.start.min(len), range.end.clamp(range.start.min(len), len));
        let (mut first, base) = self.find(from);
        let (mut last, last_base) = self.find(to);
        let head = texts.get(self.pieces[first].input);
        let tail = texts.get(self.pieces[last].input);
        let cut = floor_boundary(&head, (from - base) as usize);
        let resume = ceil_boundary(&tail, (to - last_base) as usize);
        let mut text = String::with_capacity(cut + new.len() + tail.len() - resume);
        text.push_str(&head[..cut]);
        text.push_str(new);
        text.push_str(&tail[resume..]);
        self.absorb(&mut text, &mut first, &mut last, texts);
        self.replace(first..last + 1, &text.into(), texts)
    }

    /// Takes in neighbours while the text is too small or its last line is open.
    fn absorb(&self, text: &mut String, first: &mut usize, last: &mut usize, texts: &impl Texts<T>) {
        loop {
            let open = !text.is_empty() && !text.ends_with('\n');
            let small = (feeds(text) as usize) < self.k / 2 || text.is_empty();
            if *last + 1 < self.pieces.len() && (open || small) {
                *last += 1;
                text.push_str(&texts.get(self.pieces[*last].input));
            } else if *first > 0 && small {
                *first -= 1;
                text.insert_str(0, &texts.get(self.pieces[*first].input));
            } else {
                return;
            }
        }
    }

    /// Puts `text` in place of some chunks, re-using their inputs.
    fn replace(&mut self, old: Range<usize>, text: &Text, texts: &mut impl Texts<T>) -> bool {
        let parts = if (feeds(text) as usize) > 2 * self.k { split(text, self.k) } else { vec![text.clone()] };
        let same_count = parts.len() == old.len();
        let mut spare: Vec<T> = self.pieces[old.clone()].iter().map(|p| p.input).collect();
        spare.reverse();
        let mut fresh = Vec::with_capacity(parts.len());
        for part in parts {
            let input = match spare.pop().or_else(|| self.free.pop()) {
                Some(input) => {
                    if texts.get(input) != part {
                        texts.set(input, part.clone());
                    }
                    input
                }
                None => texts.create(part.clone()),
            };
            fresh.push(Piece { input, len: part.len() as u32, feeds: feeds(&part) });
        }
        for input in spare {
            texts.set(input, Text::default());
            self.free.push(input);
        }
        self.pieces.splice(old, fresh);
        !same_count
    }

    /// The whole text.
    pub(crate) fn text(&self, texts: &impl Texts<T>) -> String {
        let mut out = String::with_capacity(self.len() as usize);
        for p in &self.pieces {
            out.push_str(&texts.get(p.input));
        }
        out
    }
}

fn feeds(text: &str) -> u32 {
    memchr::memchr_iter(b'\n', text.as_bytes()).count() as u32
}

/// Cuts after every `k`-th line feed; at least one part.
pub(crate) fn split(text: &Text, k: usize) -> Vec<Text> {
    let mut parts = Vec::new();
    let mut start = 0;
    for (n, at) in memchr::memchr_iter(b'\n', text.as_bytes()).enumerate() {
        if (n + 1) % k.max(1) == 0 {
            parts.push(text.part(start..at + 1));
            start = at + 1;
        }
    }
    if start < text.len() || parts.is_empty() {
        parts.push(text.part(start..text.len()));
    }
    parts
}

fn floor_boundary(text: &str, mut at: usize) -> usize {
    at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

fn ceil_boundary(text: &str, mut at: usize) -> usize {
    at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at += 1;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Default)]
    struct Plain(Vec<Text>);

    impl Texts<usize> for Plain {
        fn get(&self, input: usize) -> Text {
            self.0[input].clone()
        }
        fn set(&mut self, input: usize, text: Text) {
            self.0[input] = text;
        }
        fn create(&mut self, text: Text) -> usize {
            self.0.push(text);
            self.0.len() - 1
        }
    }

    fn assert_shape(store: &Store<usize>, texts: &Plain) {
        assert!(!store.pieces.is_empty());
        for (i, p) in store.pieces.iter().enumerate() {
            let text = texts.get(p.input);
            assert_eq!((p.len, p.feeds), (text.len() as u32, feeds(&text)));
            assert!(i + 1 == store.pieces.len() || text.ends_with('\n'), "chunk {i} is open: {text:?}");
            assert!(store.pieces.len() == 1 || !text.is_empty(), "empty chunk");
            assert!(p.feeds as usize <= 2 * store.k);
        }
    }

    proptest! {
        #[test]
        fn edits_are_string_edits(
            start in "[a\r\né]{0,60}",
            k in 1usize..9,
            edits in proptest::collection::vec((0u32..80, 0u32..20, "[b\r\nü]{0,20}"), 0..12),
        ) {
            let mut texts = Plain::default();
            let mut store = Store::new(&Text::from(&start), k, &mut texts);
            let mut expected = start;
            assert_shape(&store, &texts);
            for (at, len, new) in edits {
                let from = floor_boundary(&expected, at as usize);
                let to = ceil_boundary(&expected, from + len as usize);
                expected.replace_range(from..to, &new);
                store.edit(from as u32..to as u32, &new, &mut texts);
                assert_shape(&store, &texts);
                prop_assert_eq!(&store.text(&texts), &expected);
            }
        }
    }

    #[test]
    fn inputs_are_reused() {
        let mut texts = Plain::default();
        let mut store = Store::new(&"G1\n".repeat(64).into(), 4, &mut texts);
        for _ in 0..50 {
            let len = store.len();
            store.edit(0..len, "", &mut texts);
            store.edit(0..0, &"G1\n".repeat(64), &mut texts);
        }
        assert!(texts.0.len() <= 17, "{} inputs", texts.0.len());
    }

    #[test]
    fn a_keystroke_touches_one_chunk() {
        let mut texts = Plain::default();
        let mut store = Store::new(&"G1X1\n".repeat(64).into(), 16, &mut texts);
        let before = texts.0.clone();
        assert!(!store.edit(103..104, "2", &mut texts));
        let changed = before.iter().zip(&texts.0).filter(|(a, b)| a != b).count();
        assert_eq!(changed, 1);
    }
}
