//! Which codes and words a dialect has: every dialect but LinuxCNC's own is a closed list, and a code that LinuxCNC has beside it
//! is refused rather than carried out with LinuxCNC's meaning.

use std::sync::LazyLock;

use gr_canon::Sink;
use gr_spec::{Dialect, Family, code, rs274};

use crate::block::Group;
use crate::{Fault, Interp, Res};

/// The codes and letters of one dialect as bits: G-codes times ten, M-codes.
pub(crate) struct Closed {
    g: [u64; 16],
    m: [u64; 4],
    /// Bit `letter - 'a'`.
    letters: u32,
}

static LISTS: LazyLock<Vec<(&'static str, Closed)>> = LazyLock::new(|| {
    let closed = |d: &&Dialect| d.family != Family::Linuxcnc;
    Dialect::all().iter().filter(closed).map(|d| (d.id, Closed::of(d))).collect()
});

/// The list of a dialect; none for LinuxCNC's, where the interpreter's own tables are the list.
pub(crate) fn list_of(dialect: &Dialect) -> Option<&'static Closed> {
    LISTS.iter().find(|(id, _)| *id == dialect.id).map(|(_, list)| list)
}

fn put(bits: &mut [u64], n: usize) {
    if let Some(word) = bits.get_mut(n / 64) {
        *word |= 1 << (n % 64);
    }
}

fn bit(letter: u8) -> u32 {
    if letter.is_ascii_lowercase() { 1 << (letter - b'a') } else { 0 }
}

fn has(bits: &[u64], n: i32) -> bool {
    usize::try_from(n).ok().and_then(|n| Some(bits.get(n / 64)? >> (n % 64) & 1 == 1)).unwrap_or(false)
}

impl Closed {
    fn of(dialect: &Dialect) -> Closed {
        let letter = |w: &gr_spec::WordDef| bit(w.letter.to_ascii_lowercase() as u8);
        let mut list = Closed { g: [0; 16], m: [0; 4], letters: dialect.words.iter().map(letter).fold(0, |a, b| a | b) };
        for row in dialect.codes {
            let Some(number) = row.code.get(1..).and_then(|n| n.parse::<f64>().ok()) else { continue };
            match row.code.as_bytes()[0] {
                b'G' => put(&mut list.g, (number * 10.0 + 0.5) as usize),
                _ => put(&mut list.m, number as usize),
            }
        }
        list
    }
}

const OTHER_CODE: &str =
    "write it with codes of this control (docs/dialects.md has them all), or choose the dialect the program was written for";

impl<S: Sink> Interp<'_, S> {
    /// What another control has and this one does not.
    pub(crate) fn not_in_dialect(&self, what: &str, instead: &str) -> Box<Fault> {
        Fault::new(code::SYNTAX_NOT_IN_DIALECT, rs274::SILENT).arg(what).arg(self.setup.dialect.id).arg(instead)
    }

    /// A G-code (times ten) that LinuxCNC knows must be in the dialect's own list.
    #[inline]
    pub(crate) fn check_listed_g(&self, n: i32) -> Res {
        match self.closed {
            Some(list) if !has(&list.g, n) && crate::read::g_group(n) >= 0 => {
                Err(self.not_in_dialect(&crate::check::code_name(n as i16), OTHER_CODE).at(b'g'))
            }
            _ => Ok(()),
        }
    }

    /// grbl's words are a closed list too; the rows of the others hold every letter.
    #[inline]
    pub(crate) fn check_listed_letter(&self, letter: u8) -> Res {
        match self.closed {
            Some(list) if self.setup.dialect.family == Family::Grbl && list.letters & bit(letter) == 0 => {
                Err(self.not_in_dialect(&format!("word {}", char::from(letter.to_ascii_uppercase())), OTHER_CODE).at(letter))
            }
            _ => Ok(()),
        }
    }

    /// Words that grbl has, with codes that do not take them: it refuses what a block leaves unused.
    pub(crate) fn grbl_words(&self) -> Res {
        let b = &self.block;
        let motion = if b.g(Group::Motion) == -1 { self.m.motion } else { i32::from(b.g(Group::Motion)) as _ };
        let refused = match b.g(Group::NonModal) {
            100 if b.has(b'r') => Some(("R with G10", b'r')),
            100 if !matches!(b.get(b'l'), None | Some(2.0 | 20.0)) => Some(("G10 with an L other than 2 and 20", b'l')),
            100 if b.get(b'p').is_some_and(|p| !(0.0..=6.0).contains(&p)) => Some(("G10 with a P above 6", b'p')),
            100 if b.get(b'l').is_some() && !self.has_axes() => {
                return Err(Fault::new(code::WORD_MISSING, rs274::SILENT).arg("G10").arg("X, Y or Z").at(b'g'));
            }
            -1 if matches!(motion, 20 | 30) && b.has(b'p') => Some(("P with an arc", b'p')),
            _ if b.g(Group::ToolLength) == 431 && (b.has(b'x') || b.has(b'y')) => Some(("G43.1 with an axis other than Z", b'g')),
            _ if b.get(b't').is_some_and(|t| t > 255.0) => Some(("T above 255", b't')),
            _ if b.g(Group::ToolLength) == 431 && !b.has(b'z') => {
                return Err(Fault::new(code::WORD_MISSING, rs274::SILENT).arg("G43.1").arg("Z").at(b'g'));
            }
            // Its greatest number of a line.
            _ if self.line_number().is_some_and(|n| n > 10_000_000.0) => Some(("N above 10000000", b'n')),
            _ => None,
        };
        refused.map_or(Ok(()), |(what, letter)| Err(self.not_in_dialect(what, OTHER_CODE).at(letter)))
    }

    /// N of the present line.
    fn line_number(&self) -> Option<f64> {
        let reading = &self.reading;
        let known = (reading.line as usize) < reading.scan.lines.len();
        let words = if known { reading.scan.words(reading.line) } else { &[] };
        words.iter().find(|w| w.letter == b'n').map(|w| w.value)
    }

    /// The same for an M-code.
    #[inline]
    pub(crate) fn check_listed_m(&self, n: i32) -> Res {
        match self.closed {
            Some(list) if !has(&list.m, n) && (crate::read::m_group(n) >= 0 || n == 98) => {
                Err(self.not_in_dialect(&format!("M{n}"), OTHER_CODE).at(b'm'))
            }
            _ => Ok(()),
        }
    }
}
