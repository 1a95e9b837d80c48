//! The byte-level path for plain lines: letters with literal numbers, comments, `/` and N.
//!
//! It accepts faultless lines only and gives up on everything else; the grammar then has the line to itself.
//! What it accepts, the grammar reads to the same words (a test demands it).

use gr_spec::{Dialect, Family};

use crate::model::{Form, Line, LineKind, Word};
use crate::number::decimal;

/// What a byte may begin at the place of a word.
mod class {
    pub const BAD: u8 = 0;
    pub const BLANK: u8 = 1;
    pub const LF: u8 = 2;
    pub const CR: u8 = 3;
    pub const PAREN: u8 = 4;
    pub const SEMICOLON: u8 = 5;
    pub const SLASH: u8 = 6;
    pub const NUMBER: u8 = 7;
    // Greater values are the word's lower-case letter.
}

/// The rules of a dialect, worked out once per scan.
pub(crate) struct Rules {
    classes: [u8; 256],
    /// Bit of a lower-case letter in the set of words seen; none for those that may occur twice.
    once: [u32; 128],
    /// Longest line, with its line end, in bytes.
    pub longest: usize,
    pub comma: bool,
    pub family: Family,
    /// Name of the dialect, for findings.
    pub dialect: &'static str,
    pub limit: u32,
}

impl Rules {
    pub fn new(dialect: &Dialect) -> Rules {
        let mut classes = [class::BAD; 256];
        for letter in (b'a'..=b'z').chain([b'@', b'^', b'$']) {
            if is_word_letter(letter, dialect.family) {
                classes[usize::from(letter)] = letter;
                classes[usize::from(letter.to_ascii_uppercase())] = letter;
            }
        }
        for (byte, class) in [
            (b' ', class::BLANK),
            (b'\t', class::BLANK),
            (b'\n', class::LF),
            (b'\r', class::CR),
            (b'(', class::PAREN),
            (b'/', class::SLASH),
            (b'n', class::NUMBER),
            (b'N', class::NUMBER),
        ] {
            classes[usize::from(byte)] = class;
        }
        if dialect.family != Family::Fanuc {
            classes[usize::from(b';')] = class::SEMICOLON;
        }
        let mut once = [0; 128];
        for letter in (b'a'..=b'z').chain([b'$']) {
            once[usize::from(letter)] = once_bit(letter, dialect.family);
        }
        // LinuxCNC takes a full buffer for a line that did not fit, and its buffer holds the line end too.
        let longest = if dialect.line_limit == 0 { ABSOLUTE_LIMIT } else { (dialect.line_limit as usize).saturating_sub(2) };
        Rules {
            classes,
            once,
            longest: longest.min(ABSOLUTE_LIMIT),
            comma: dialect.decimal_comma,
            family: dialect.family,
            dialect: dialect.id,
            limit: dialect.line_limit,
        }
    }
}

/// No dialect reads a longer line: the length of a word must fit its field.
pub(crate) const ABSOLUTE_LIMIT: usize = 65_534;

/// Letters that take a value at the place of a word. N and O are none: they have their own places.
pub(crate) fn is_word_letter(letter: u8, family: Family) -> bool {
    match letter {
        b'a'..=b'z' => letter != b'n' && letter != b'o',
        b'@' | b'^' | b'$' => family == Family::Linuxcnc,
        _ => false,
    }
}

/// The bit of a letter that may occur once in a block.
pub(crate) fn once_bit(letter: u8, family: Family) -> u32 {
    match letter {
        b'g' | b'm' => 0,
        // Macro calls (G65) take several sets of I, J, K.
        b'i' | b'j' | b'k' if family == Family::Fanuc => 0,
        b'a'..=b'z' => 1 << (letter - b'a'),
        b'$' => 1 << 26,
        _ => 0,
    }
}

/// Reads the line at `start`; gives the first byte of the next line, or nothing (and leaves `words` as it
/// was) when the line is not plain or has a fault.
#[inline]
pub(crate) fn plain_line(bytes: &[u8], start: usize, rules: &Rules, words: &mut Vec<Word>) -> Option<(Line, usize)> {
    let first_word = words.len();
    let mut line = Line {
        start: start as u32,
        first_word: first_word as u32,
        kind: LineKind::Blank,
        deleted: false,
        faulty: false,
    };
    match words_of_line(bytes, start, rules, words, &mut line) {
        Some(next) if next - start <= rules.longest => Some((line, next)),
        _ => {
            words.truncate(first_word);
            None
        }
    }
}

#[inline(always)]
fn words_of_line(bytes: &[u8], start: usize, rules: &Rules, words: &mut Vec<Word>, line: &mut Line) -> Option<usize> {
    let mut i = start;
    let mut seen = 0u32;
    // Nothing but blanks so far, or a `/`: here an N may stand.
    let mut at_start = true;
    loop {
        let Some(&byte) = bytes.get(i) else { return Some(i) };
        match rules.classes[usize::from(byte)] {
            class::BLANK => i += 1,
            class::LF => return Some(i + 1),
            class::CR => return Some(i + 1 + usize::from(bytes.get(i + 1) == Some(&b'\n'))),
            class::BAD => return None,
            class::SLASH => {
                if !at_start || line.deleted {
                    return None;
                }
                line.deleted = true;
                i += 1;
            }
            class::PAREN => {
                let end = paren_end(bytes, i)?;
                words.push(comment(b'(', i, end));
                (i, at_start) = (end, false);
            }
            class::SEMICOLON => {
                let end = i + line_rest(&bytes[i..])?;
                words.push(comment(b';', i, end));
                (i, at_start) = (end, false);
            }
            class::NUMBER => {
                if !at_start {
                    return None;
                }
                let (value, end) = line_number(bytes, i + 1)?;
                words.push(literal(b'n', i, end, value));
                (i, at_start, line.kind) = (end, false, LineKind::Plain);
            }
            letter => {
                let bit = rules.once[usize::from(letter & 127)];
                if seen & bit != 0 {
                    return None;
                }
                seen |= bit;
                let (value, end) = signed(bytes, i + 1, rules.comma)?;
                words.push(literal(letter, i, end, value));
                (i, at_start, line.kind) = (end, false, LineKind::Plain);
            }
        }
    }
}

#[inline(always)]
fn literal(letter: u8, start: usize, end: usize, value: f64) -> Word {
    Word { value, start: start as u32, len: (end - start) as u16, letter, form: Form::Literal }
}

#[inline(always)]
fn comment(letter: u8, start: usize, end: usize) -> Word {
    // A comment too long for its field makes the line too long, and the line is refused.
    Word { value: 0.0, start: start as u32, len: (end - start).min(0xffff) as u16, letter, form: Form::Comment }
}

#[inline(always)]
fn skip_blanks(bytes: &[u8], mut i: usize) -> usize {
    while matches!(bytes.get(i), Some(b' ' | b'\t')) {
        i += 1;
    }
    i
}

/// `[+-] digits [. digits]`, and nothing that would carry the number on.
#[inline(always)]
fn signed(bytes: &[u8], at: usize, comma: bool) -> Option<(f64, usize)> {
    let mut i = at;
    if matches!(bytes.get(i), Some(b' ' | b'\t')) {
        i = skip_blanks(bytes, i);
    }
    let sign = *bytes.get(i)?;
    let negative = sign == b'-';
    i += usize::from(negative | (sign == b'+'));
    let (value, end) = decimal(bytes, i, comma)?;
    Some((if negative { -value } else { value }, end))
}

#[inline(always)]
fn line_number(bytes: &[u8], at: usize) -> Option<(f64, usize)> {
    let i = skip_blanks(bytes, at);
    let (value, end) = decimal(bytes, i, false)?;
    (bytes[i].is_ascii_digit() && bytes[end - 1] != b'.').then_some((value, end))
}

/// One past the `)`.
#[inline]
fn paren_end(bytes: &[u8], at: usize) -> Option<usize> {
    let inside = &bytes[at + 1..];
    let length = inside.iter().position(|b| matches!(b, b')' | b'(' | b'\n' | b'\r' | 0))?;
    (inside[length] == b')').then_some(at + length + 2)
}

/// Bytes to the line end; nothing when there is a NUL. Blanks at the end do not belong to the comment.
#[inline]
fn line_rest(bytes: &[u8]) -> Option<usize> {
    let end = memchr::memchr3(b'\n', b'\r', 0, bytes).unwrap_or(bytes.len());
    (bytes.get(end) != Some(&0)).then_some(())?;
    Some(trimmed(&bytes[..end]))
}

/// Length without what counts as blank at a line's end.
pub(crate) fn trimmed(bytes: &[u8]) -> usize {
    bytes.iter().rposition(|b| !matches!(b, b' ' | b'\t' | b'\n' | b'\r' | 0x0b | 0x0c)).map_or(0, |last| last + 1)
}
