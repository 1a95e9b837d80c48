//! What words a source line holds. Motion is known from the IR alone; the text tells which words stood there,
//! which matters where a number is only a simulation's: G53, G28, a word that happens to change nothing.

use gr_ir::{Note, Op, Program, Source, Sources};
use gr_text::FileId;

/// What stands in a line, as far as a look at its letters tells: expressions are skipped, not evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Words {
    /// Bit `letter - 'a'`; `@` counts as X and Y, `^` too.
    letters: u32,
    codes: u64,
    /// The axes are named by increments alone.
    incremental: bool,
}

/// How far back is looked for what a line leaves unsaid.
const MOST_LINES: u32 = 10_000;

/// Codes that [`Words`] looks for, times ten.
const CODES: [u32; 46] = [
    900, 910, 530, 280, 300, 281, 301, 400, 410, 420, 411, 421, 490, 520, 920, 921, 922, 923, 610, 611, 640, 430, 431, 432,
    70, 80, 100, 540, 550, 560, 570, 580, 590, 591, 592, 593, 700, 710, 711, 712, 720, 721, 722, 760, 650, 660,
];

/// Increments of a lathe, and the axis that each moves.
const INCREMENTS: [(u8, u8); 4] = [(b'u', b'x'), (b'v', b'y'), (b'w', b'z'), (b'h', b'c')];

impl Words {
    /// Reads a line of a program, with increments as words of their axes.
    pub fn at(sources: &dyn Sources, file: FileId, line: u32) -> Option<Words> {
        let mut words = Words::of(sources.line(file, line)?);
        if sources.increments() {
            let said = words;
            words.incremental = INCREMENTS.iter().any(|(i, _)| said.has(*i)) && !INCREMENTS.iter().any(|(_, a)| said.has(*a));
            for (increment, axis) in INCREMENTS.into_iter().filter(|(i, _)| said.has(*i)) {
                words.letters = words.letters & !bit(increment) | bit(axis);
            }
        }
        Some(words)
    }

    /// Reads a line.
    pub fn of(line: &str) -> Words {
        let mut words = Words::default();
        let bytes = line.as_bytes();
        let mut i = 0;
        while i < bytes.len() {
            match bytes[i].to_ascii_lowercase() {
                b'(' => i += bytes[i..].iter().position(|b| *b == b')').unwrap_or(bytes.len()),
                b';' => break,
                b'[' => i = close(bytes, i),
                // A parameter is a value here or the target of a setting, never an axis word.
                b'#' => i = parameter(bytes, i),
                b'@' | b'^' => words.letters |= bit(b'x') | bit(b'y'),
                l @ b'a'..=b'z' => {
                    words.letters |= bit(l);
                    if l == b'g' {
                        words.code(&bytes[i + 1..]);
                    }
                }
                _ => {}
            }
            i += 1;
        }
        words
    }

    fn code(&mut self, rest: &[u8]) {
        let mut number = String::new();
        for b in rest {
            match b {
                b'0'..=b'9' | b'.' => number.push(char::from(*b)),
                b' ' | b'\t' => {}
                _ => break,
            }
        }
        let tenths = number.parse::<f64>().map_or(0, |v| (v * 10.0).round() as u32);
        if let Some(i) = CODES.iter().position(|c| *c == tenths) {
            self.codes |= 1 << i;
        }
    }

    /// Whether a line moves by increments: it says so, or the last line before it that says G90 or G91 does.
    pub fn goes_by_increments(sources: &dyn Sources, file: FileId, line: u32) -> bool {
        if Words::at(sources, file, line).is_some_and(|w| w.incremental) {
            return true;
        }
        let said = (line.saturating_sub(MOST_LINES)..=line).rev().find_map(|l| {
            let words = Words::at(sources, file, l)?;
            (words.g(900) || words.g(910)).then(|| words.g(910))
        });
        said.unwrap_or(false)
    }

    /// Whether the axes are named by increments alone, as on a lathe.
    pub fn incremental(self) -> bool {
        self.incremental
    }
    /// Whether any axis is named.
    pub fn names_axes(self) -> bool {
        b"xyzabcuvw".iter().any(|l| self.has(*l))
    }
    /// Whether a letter (lower case) stands there.
    pub fn has(self, letter: u8) -> bool {
        self.letters & bit(letter) != 0
    }
    /// Whether a G-code (times ten) of the list stands there.
    pub fn g(self, tenths: u32) -> bool {
        CODES.iter().position(|c| *c == tenths).is_some_and(|i| self.codes & (1 << i) != 0)
    }
}

/// Whether a move is one that the machine makes of itself, to a place of its own, before it changes the tool (INI keys
/// TOOL_CHANGE_QUILL_UP and TOOL_CHANGE_AT_G30).
pub fn is_hidden(program: &Program, index: usize) -> bool {
    let before = (1..=2).filter_map(|n| program.get(index.checked_sub(n)?));
    before.take_while(|s| !s.op.moves()).any(|s| matches!(s.op, Op::Note(Note::Comment, "AXIS,hide")))
}

/// The number behind a letter of a source line, where it is a plain one.
pub fn number_of(sources: &dyn Sources, letter: char, source: Source) -> Option<u32> {
    let line = sources.line(source.file, source.line)?;
    let code = line.split(['(', ';']).next()?.to_ascii_lowercase();
    let rest = code.split_once(letter)?.1.trim_start();
    let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
    let after = rest[digits.len()..].chars().next();
    if after == Some('.') { None } else { digits.parse().ok() }
}

/// Whether a line sets a work offset from where the tool stands (G10 L20).
pub fn sets_here(sources: &dyn Sources, source: Source) -> bool {
    Words::at(sources, source.file, source.line).is_some_and(|w| w.g(100)) && number_of(sources, 'l', source) == Some(20)
}

/// Codes, times ten, of the work offsets by their numbers.
pub(crate) const SYSTEMS: [u32; 10] = [0, 540, 550, 560, 570, 580, 590, 591, 592, 593];

/// Where the program, or a file it calls, first stores a reference point of its own, and by which code.
pub fn stores_reference(program: &Program, sources: &dyn Sources) -> Option<(Source, &'static str)> {
    let files: std::collections::BTreeSet<_> = program.steps().map(|s| s.source.file).collect();
    let code = |text: &str| {
        let words = (text.contains("28") || text.contains("30")).then(|| Words::of(text))?;
        [(281, "G28.1"), (301, "G30.1")].into_iter().find(|(g, _)| words.g(*g)).map(|(_, code)| code)
    };
    files.into_iter().find_map(|file| {
        let mut lines = (0u32..).map_while(|line| Some((line, sources.line(file, line)?)));
        lines.find_map(|(line, text)| Some((Source { file, line, ..Source::default() }, code(text)?)))
    })
}

fn bit(letter: u8) -> u32 {
    1 << (letter - b'a')
}

/// Index of the bracket that closes the one at `i`.
fn close(bytes: &[u8], i: usize) -> usize {
    let mut depth = 0;
    for (j, b) in bytes.iter().enumerate().skip(i) {
        match b {
            b'[' => depth += 1,
            b']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return j;
        }
    }
    bytes.len()
}

fn parameter(bytes: &[u8], i: usize) -> usize {
    match bytes.get(i + 1) {
        Some(b'<') => i + bytes[i..].iter().position(|b| *b == b'>').unwrap_or(bytes.len()),
        _ => i,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_and_codes() {
        let w = Words::of("N10 g 53 G0 x[#<cat> + sin[3]] #<zeta>=3 (Y) ; A");
        assert!(w.has(b'x') && w.has(b'g') && w.g(530));
        assert!(!w.has(b'y') && !w.has(b'z') && !w.has(b'a') && !w.has(b'c') && !w.g(280));
        assert!(Words::of("G28.1").g(281) && !Words::of("G28.1").g(280));
        assert!(Words::of("@5 ^30").has(b'y'));
        assert_eq!(Words::of("x[[[").has(b'x'), true);
    }
}
