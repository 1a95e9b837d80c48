//! Fanuc's custom macro call G65: the words behind it are arguments, the macro has local variables of its own. Not the
//! statements IF, WHILE and GOTO, which are control flow like any other. (Fanuc Series 16i/18i, B-63684, and 0i/30i,
//! B-64484, custom macro: simple call, argument specification I and II, local variable levels.)

use gr_canon::Sink;
use gr_gcode::{Form, Scan, Word};
use gr_spec::{code, rs274};

use crate::calls::{ARGS, CallKind};
use crate::eval::{not_whole, whole};
use crate::labels::{GLOBAL, Label};
use crate::{Fault, Interp, Res, vacant};

/// Number of local variables.
pub(crate) const COUNT: usize = 33;
/// #1 … #33 as the table of parameters has them.
pub(crate) type Locals = [f64; COUNT];

/// Deepest nesting of macro calls.
const DEPTH: usize = 4;

/// The variables of A … Z in order; 0: no argument. I J K are told apart by their order.
const VARIABLES: [u8; 26] =
    [1, 2, 3, 7, 8, 9, 0, 11, 4, 5, 6, 0, 13, 0, 0, 0, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26];

const FORM: &str = "G65 P1000 L2 A1. B2.";

/// Whether the line calls a macro.
pub(crate) fn is_macro_call(words: &[Word]) -> bool {
    words.iter().any(|w| w.letter == b'g' && w.form == Form::Literal && w.value == 65.0)
}

/// What a call hands over.
struct Arguments {
    locals: Locals,
    /// Variable of the last I, J or K; the next one goes further on.
    last_ijk: usize,
}

impl Arguments {
    /// Puts an argument where it belongs; false: the letter takes none, or there are too many sets of I J K.
    fn put(&mut self, letter: u8, value: f64) -> bool {
        let variable = match letter {
            b'i' | b'j' | b'k' => self.next_ijk(usize::from(letter - b'i')),
            b'a'..=b'z' => usize::from(VARIABLES[usize::from(letter - b'a')]),
            _ => 0,
        };
        let Some(slot) = variable.checked_sub(1).and_then(|i| self.locals.get_mut(i)) else { return false };
        *slot = vacant::stored(value);
        true
    }

    /// The first variable behind the last I, J, K that belongs to this one of the three.
    fn next_ijk(&mut self, which: usize) -> usize {
        let from = self.last_ijk.max(3) + 1;
        self.last_ijk = (from..from + 3).find(|n| (n - 4) % 3 == which).unwrap_or(from);
        self.last_ijk
    }
}

fn incomplete() -> Box<Fault> {
    Fault::new(code::MACRO_MALFORMED, rs274::SILENT).arg("G65").arg(FORM)
}

impl<S: Sink> Interp<'_, S> {
    /// A line with G65.
    pub(crate) fn macro_call(&mut self, scan: &Scan, text: &str, line: u32, words: &[Word]) -> Res {
        self.count_control()?;
        if scan.lines[line as usize].faulty {
            return Err(self.parse_fault(scan));
        }
        let mut arguments = Arguments { locals: [0.0; COUNT], last_ijk: 0 };
        let (mut program, mut repeats, mut called) = (None, None, false);
        for w in words.iter().filter(|w| w.form != Form::Comment) {
            let place = scan.word_span(text, line, w);
            let wrong = |mut f: Box<Fault>| {
                f.span = Some(place);
                f
            };
            let value = match w.form {
                Form::Literal => w.value,
                Form::Expr => self.eval_or_vacant(scan, gr_gcode::ExprId(w.index() as u32))?,
                _ => return Err(wrong(incomplete())),
            };
            match w.letter {
                b'n' => {}
                b'g' if !called && value == 65.0 => called = true,
                // G65 stands before its words, and nothing else is done on its line.
                _ if !called => return Err(wrong(incomplete())),
                b'p' => program = Some(whole(value).ok_or_else(|| wrong(not_whole(value)))?),
                b'l' => repeats = Some(whole(value).ok_or_else(|| wrong(not_whole(value)))?),
                _ if vacant::is_vacant(value) => {}
                letter if arguments.put(letter, value) => {}
                _ => return Err(wrong(incomplete())),
            }
        }
        let Some(program) = program else {
            return Err(Fault::new(code::WORD_MISSING, rs274::SILENT).arg("G65").arg("P").at(b'g'));
        };
        if repeats.is_some_and(|l| !(1..=9999).contains(&l)) {
            return Err(Fault::new(code::WORD_MISSING, rs274::SILENT).arg("G65").arg("L of 1 to 9999").at(b'l'));
        }
        self.call_macro(program, repeats, &arguments.locals)
    }

    fn call_macro(&mut self, program: i32, repeats: Option<i32>, arguments: &Locals) -> Res {
        let level = self.level();
        if self.levels.iter().filter(|l| l.locals.is_some()).count() >= DEPTH {
            return Err(Fault::new(code::SUB_LIMIT, rs274::SILENT).arg("macros call each other more than four levels deep"));
        }
        let kept: Locals = std::array::from_fn(|i| self.params.get(i as u32 + 1));
        for (i, value) in arguments.iter().enumerate() {
            self.write_param(i as u32 + 1, *value);
        }
        self.levels[level].locals = Some(Box::new(kept));
        let name = self.symbols.of_number(program);
        let label = Label { scope: GLOBAL, name };
        self.call(label, CallKind::Macro, [0.0; ARGS], 0, repeats).inspect_err(|_| {
            self.take_back_variables(level);
        })
    }

    /// The local variables of a level, when a macro that it called is left.
    pub(crate) fn take_back_variables(&mut self, level: usize) {
        let Some(kept) = self.levels.get_mut(level).and_then(|l| l.locals.take()) else { return };
        for (i, value) in kept.iter().enumerate() {
            self.write_param(i as u32 + 1, *value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variables(words: &[(u8, f64)]) -> Vec<(usize, f64)> {
        let mut arguments = Arguments { locals: [0.0; COUNT], last_ijk: 0 };
        for (letter, value) in words {
            assert!(arguments.put(*letter, *value), "{}", char::from(*letter));
        }
        arguments.locals.iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(i, v)| (i + 1, *v)).collect()
    }

    /// The example of the manual: D comes later than the second I, and takes #7 from it.
    #[test]
    fn arguments_of_both_kinds() {
        let words = [(b'a', 1.0), (b'b', 2.0), (b'i', -3.0), (b'i', 4.0), (b'd', 5.0)];
        assert_eq!(variables(&words), [(1, 1.0), (2, 2.0), (4, -3.0), (7, 5.0)]);
        assert_eq!(variables(&[(b'i', 1.0), (b'j', 2.0), (b'k', 3.0), (b'j', 4.0)]), [(4, 1.0), (5, 2.0), (6, 3.0), (8, 4.0)]);
        assert_eq!(variables(&[(b'k', 1.0), (b'i', 2.0), (b'z', 3.0)]), [(6, 1.0), (7, 2.0), (26, 3.0)]);
        let sets: Vec<_> = (0..10).flat_map(|_| [(b'i', 1.0), (b'j', 1.0), (b'k', 1.0)]).collect();
        assert_eq!(variables(&sets).last(), Some(&(33, 1.0)));
        let mut full = Arguments { locals: [0.0; COUNT], last_ijk: 33 };
        assert!(!full.put(b'i', 1.0) && !full.put(b'o', 1.0));
    }
}
