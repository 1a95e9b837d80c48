//! Cutting a text at line ends.

/// Cuts `text` into pieces of `lines_per_chunk` whole lines (LF, CRLF and lone CR end a line); the last may be
/// shorter. No piece is empty, and together they are the text.
pub fn split_chunks(text: &str, lines_per_chunk: usize) -> Vec<&str> {
    let bytes = text.as_bytes();
    let mut chunks = Vec::with_capacity(bytes.len() / (24 * lines_per_chunk.max(1)) + 1);
    let (mut start, mut lines) = (0, 0);
    for at in memchr::memchr2_iter(b'\n', b'\r', bytes) {
        if bytes[at] == b'\r' && bytes.get(at + 1) == Some(&b'\n') {
            continue;
        }
        lines += 1;
        if lines >= lines_per_chunk {
            chunks.push(&text[start..=at]);
            (start, lines) = (at + 1, 0);
        }
    }
    if start < text.len() {
        chunks.push(&text[start..]);
    }
    chunks
}
