//! Tokens. Each function starts at a token's first byte and returns one past its last; ignored bytes
//! (below 0x20) inside a token are passed over.

/// Byte classes.
pub(crate) const DIGIT: u8 = 1;
pub(crate) const UPPER: u8 = 2;
pub(crate) const LOWER: u8 = 4;
const BLANK: u8 = 8;

static CLASS: [u8; 256] = classes();

const fn classes() -> [u8; 256] {
    let mut t = [0; 256];
    let mut i = 0;
    while i < 256 {
        t[i] = match i as u8 {
            b'0'..=b'9' => DIGIT,
            b'A'..=b'Z' | b'_' => UPPER,
            b'a'..=b'z' => LOWER,
            0..=0x1F => BLANK,
            _ => 0,
        };
        i += 1;
    }
    t
}

#[inline(always)]
pub(crate) fn is(byte: u8, class: u8) -> bool {
    CLASS[byte as usize] & class != 0
}

/// Passes over bytes of `class`; returns one past the last of them.
#[inline(always)]
pub(crate) fn run(text: &[u8], mut at: usize, class: u8) -> usize {
    while at < text.len() && is(text[at], class) {
        at += 1;
    }
    if at < text.len() && text[at] < 0x20 { run_broken(text, at, class) } else { at }
}

/// A token may go on behind ignored bytes.
#[cold]
fn run_broken(text: &[u8], at: usize, class: u8) -> usize {
    let mut end = at;
    let mut p = at;
    while p < text.len() {
        if is(text[p], class) {
            end = p + 1;
        } else if text[p] >= 0x20 {
            break;
        }
        p += 1;
    }
    end
}

/// The next byte that is not ignored, and where it is.
#[inline(always)]
pub(crate) fn peek(text: &[u8], mut at: usize) -> (u8, usize) {
    while at < text.len() {
        if text[at] >= 0x20 {
            return (text[at], at);
        }
        at += 1;
    }
    (0, at)
}

/// A comment that opens at `at`: one past it, or `Some(None)` where it never closes. Ignored bytes may stand between the two
/// bytes of either end: a line may break anywhere.
pub(crate) fn comment(text: &[u8], at: usize) -> Option<Option<usize>> {
    let (star, open) = peek(text, at + 1);
    if text.get(at) != Some(&b'/') || star != b'*' {
        return None;
    }
    let mut from = open + 1;
    while let Some(n) = memchr::memchr(b'*', text.get(from..).unwrap_or(&[])) {
        let (slash, close) = peek(text, from + n + 1);
        if slash == b'/' {
            return Some(Some(close + 1));
        }
        from += n + 1;
    }
    Some(None)
}

/// What a number is, and one past it; `None` where the text is not a number.
#[inline(always)]
pub(crate) fn number(text: &[u8], start: usize) -> Option<(bool, usize)> {
    let mut at = start;
    if matches!(text[at], b'+' | b'-') {
        at = peek(text, at + 1).1;
    }
    let digits = run(text, at, DIGIT);
    if digits == at {
        return None;
    }
    let (next, p) = peek(text, digits);
    if next != b'.' {
        return Some((false, digits));
    }
    at = run(text, p + 1, DIGIT);
    let (next, p) = peek(text, at);
    if next == b'E' {
        let (sign, q) = peek(text, p + 1);
        let q = if matches!(sign, b'+' | b'-') { peek(text, q + 1).1 } else { q };
        let end = run(text, q, DIGIT);
        return (end > q).then_some((true, end));
    }
    Some((true, at))
}

/// One past the closing quote of a string that opens at `start`; `None` when it never closes.
#[inline(always)]
pub(crate) fn string(text: &[u8], start: usize) -> Option<usize> {
    let mut at = start + 1;
    loop {
        // Most strings are short: a few bytes by hand beat a call.
        let mut n = 0;
        let rest = &text[at..];
        while n < 16 && n < rest.len() && rest[n] != b'\'' {
            n += 1;
        }
        if n == 16 || n == rest.len() {
            n += memchr::memchr(b'\'', &rest[n..])?;
        }
        let close = at + n;
        let (next, p) = peek(text, close + 1);
        if next != b'\'' {
            return Some(close + 1);
        }
        at = p + 1;
    }
}
