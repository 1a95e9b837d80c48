//! Fanuc's custom macro calls: G65, and G66, after which every block with a movement calls the macro until G67. The words
//! behind them are arguments, the macro has local variables of its own. Not the statements IF, WHILE and GOTO, which are
//! control flow like any other. (Fanuc Series 16i/18i, B-63684, and 0i/30i, B-64484, custom macro: simple call, modal call,
//! argument specification I and II, local variable levels.)

use gr_canon::Sink;
use gr_gcode::{Form, Scan, Word};
use gr_spec::{code, rs274};

use crate::block::Group;
use crate::calls::{ARGS, CallKind};
use crate::eval::{not_whole, whole};
use crate::labels::{GLOBAL, Label};
use crate::run::Flow;
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

/// A macro that blocks with a movement call. Its arguments are set once, by G66: what it makes of its variables is what the
/// next call finds.
#[derive(Clone, Debug)]
pub(crate) struct ModalMacro {
    program: i32,
    repeats: i32,
    locals: Locals,
}

/// A call of such a macro that is going on: which one, and how often it is still to be called.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct ModalCall {
    index: usize,
    left: i32,
}

/// Whether the line calls a macro, or has others call it.
pub(crate) fn is_macro_call(words: &[Word]) -> bool {
    words.iter().any(|w| w.letter == b'g' && w.form == Form::Literal && matches!(w.value, 65.0 | 66.0))
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

fn incomplete(name: &str) -> Box<Fault> {
    Fault::new(code::MACRO_MALFORMED, rs274::SILENT).arg(name).arg(format!("{name} P1000 L2 A1. B2."))
}

fn too_deep() -> Box<Fault> {
    Fault::new(code::SUB_LIMIT, rs274::SILENT).arg("macros call each other more than four levels deep")
}

impl<S: Sink> Interp<'_, S> {
    /// A line with G65 or G66.
    pub(crate) fn macro_call(&mut self, scan: &Scan, text: &str, line: u32, words: &[Word]) -> Res {
        self.count_control()?;
        if scan.lines[line as usize].faulty {
            return Err(self.parse_fault(scan));
        }
        let mut arguments = Arguments { locals: [0.0; COUNT], last_ijk: 0 };
        let (mut program, mut repeats, mut called) = (None, None, 0.0);
        let first = words.iter().find(|w| w.letter == b'g' && w.form == Form::Literal).map_or(0.0, |w| w.value);
        let name = if first == 66.0 { "G66" } else { "G65" };
        for w in words.iter().filter(|w| w.form != Form::Comment) {
            let place = scan.word_span(text, line, w);
            let wrong = |mut f: Box<Fault>| {
                f.span = Some(place);
                f
            };
            let value = match w.form {
                Form::Literal => w.value,
                Form::Expr => self.eval_or_vacant(scan, gr_gcode::ExprId(w.index() as u32))?,
                _ => return Err(wrong(incomplete(name))),
            };
            match w.letter {
                b'n' => {}
                b'g' if called == 0.0 && matches!(value, 65.0 | 66.0) => called = value,
                // The code stands before its words, and nothing else is done on its line.
                _ if called == 0.0 => return Err(wrong(incomplete(name))),
                b'p' => program = Some(whole(value).ok_or_else(|| wrong(not_whole(value)))?),
                b'l' => repeats = Some(whole(value).ok_or_else(|| wrong(not_whole(value)))?),
                _ if vacant::is_vacant(value) => {}
                letter if arguments.put(letter, value) => {}
                _ => return Err(wrong(incomplete(name))),
            }
        }
        let Some(program) = program else {
            return Err(Fault::new(code::WORD_MISSING, rs274::SILENT).arg(name).arg("P").at(b'g'));
        };
        if repeats.is_some_and(|l| !(1..=9999).contains(&l)) {
            return Err(Fault::new(code::WORD_MISSING, rs274::SILENT).arg(name).arg("L of 1 to 9999").at(b'l'));
        }
        if called == 65.0 {
            return self.call_macro(program, repeats, &arguments.locals);
        }
        self.only_outside(name)?;
        if self.modal_macros.len() >= DEPTH {
            return Err(too_deep());
        }
        self.modal_macros.push(ModalMacro { program, repeats: repeats.unwrap_or(1), locals: arguments.locals });
        Ok(())
    }

    /// The manuals say nothing of G66 and G67 in a macro that G66 called.
    fn only_outside(&self, name: &str) -> Res {
        match self.levels.iter().any(|l| l.modal.is_some()) {
            true => Err(self.not_carried_out(rs274::SILENT, format!("{name} in a macro that G66 called")).at(b'g')),
            false => Ok(()),
        }
    }

    /// G67: the last G66 is over.
    pub(crate) fn end_modal(&mut self) -> Res {
        if self.modal_macros.is_empty() {
            return Ok(());
        }
        self.only_outside("G67")?;
        if self.has_axes() {
            return Err(self.not_carried_out(rs274::SILENT, "G67 beside axis words".into()).at(b'g'));
        }
        self.modal_macros.pop();
        Ok(())
    }

    /// The G66 that a movement would call.
    pub(crate) fn modal_to_call(&self) -> Option<usize> {
        let called = self.levels.iter().rev().find_map(|l| l.modal);
        called.map_or(self.modal_macros.len(), |c| c.index).checked_sub(1)
    }

    /// After a block: a movement calls the macro of the last G66. Movements of that macro call the one of the G66 before.
    pub(crate) fn call_modal(&mut self) -> Res {
        let Some(index) = self.modal_to_call() else { return Ok(()) };
        if self.flow != Flow::Next || !self.has_axes() && !self.block.has(b'h') {
            return Ok(());
        }
        let special = self.block.g(Group::NonModal);
        match self.block.motion {
            // A shift of a frame, a dwell in seconds.
            -1 if matches!(special, -1 | 40 | 100 | 520 | 920) => return Ok(()),
            0 | 10 | 20 | 30 if matches!(special, -1 | 90 | 530) => {}
            _ => {
                let what = if self.block.motion > 0 { self.block.motion } else { special };
                let name = format!("G66 with {}", crate::check::code_name(what));
                return Err(self.not_carried_out(rs274::SILENT, name).at(b'g'));
            }
        }
        let left = self.modal_macros[index].repeats - 1;
        self.call_modal_at(ModalCall { index, left })
    }

    fn call_modal_at(&mut self, call: ModalCall) -> Res {
        let Some(ModalMacro { program, locals, .. }) = self.modal_macros.get(call.index).cloned() else { return Ok(()) };
        self.call_macro(program, None, &locals)?;
        if let Some(level) = self.levels.last_mut() {
            level.modal = Some(call);
        }
        Ok(())
    }

    /// A macro that G66 called is left, while its variables are still there.
    pub(crate) fn leave_modal(&mut self, call: ModalCall) {
        let locals: Locals = std::array::from_fn(|i| self.params.get(i as u32 + 1));
        if let Some(modal) = self.modal_macros.get_mut(call.index) {
            modal.locals = locals;
        }
    }

    /// Calls it again, as often as L says.
    pub(crate) fn repeat_modal(&mut self, call: ModalCall) -> Res {
        if call.left > 0 { self.call_modal_at(ModalCall { left: call.left - 1, ..call }) } else { Ok(()) }
    }

    fn call_macro(&mut self, program: i32, repeats: Option<i32>, arguments: &Locals) -> Res {
        let level = self.level();
        if self.levels.iter().filter(|l| l.locals.is_some()).count() >= DEPTH {
            return Err(too_deep());
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
