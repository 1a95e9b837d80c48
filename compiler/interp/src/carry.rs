//! What control flow leaves behind in the main program, between two lines outside of calls and loops: what the last
//! call and the last condition gave, and the labels that were [met](Interp::met). Together with [`State`] and [`Params`]
//! it is all that a run needs to go on.

use gr_canon::{FileId, FrameId, Sink};

use crate::calls::ARGS;
use crate::{End, Files, Interp, Params, Setup, State};

/// What goes on behind a call or a loop, labels aside.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Carry {
    /// An `if` ran, a loop is being left by `break` or `continue`, the last call gave a value, a call has come back, an
    /// error inside a call was met.
    switches: [bool; 6],
    /// Value of the last condition and of the last call, as bits.
    values: [u64; 2],
    /// #1 … #30 before the last call, as bits: a failing M98 brings them back. None: all zero.
    kept: Option<Box<[u64; ARGS]>>,
}

impl<'a, S: Sink> Interp<'a, S> {
    /// Goes on at a line of the main program, outside of calls and loops. Labels that were met before are asked of the
    /// files. `shift` is the line of the opening `%`, 0 without one.
    pub fn carry_on(
        files: &'a mut dyn Files,
        setup: &'a Setup,
        sink: S,
        (state, params, carry): (State, Params, &Carry),
        main: FileId,
        (line, shift): (u32, i32),
    ) -> Self {
        let mut run = Self::resume(files, setup, sink, (state, params), main, (line, shift));
        run.labels.earlier = Some(rustc_hash::FxHashMap::default());
        [run.executed_if, run.doing_break, run.doing_continue, run.value_returned, run.came_back, run.main_unnamed] =
            carry.switches;
        [run.test_value, run.return_value] = carry.values.map(f64::from_bits);
        run.levels[0].kept = carry.kept.as_ref().map(|kept| Box::new(kept.map(f64::from_bits)));
        run
    }

    /// What control flow has left behind, beside [`Interp::met`].
    pub fn carry(&self) -> Carry {
        Carry {
            switches: [
                self.executed_if,
                self.doing_break,
                self.doing_continue,
                self.value_returned,
                self.came_back,
                self.main_unnamed,
            ],
            values: [self.test_value, self.return_value].map(f64::to_bits),
            kept: self.levels[0].kept.as_ref().map(|kept| Box::new(kept.map(|v| (v + 0.0).to_bits()))).filter(|k| **k != [0; ARGS]),
        }
    }

    /// Outside of calls, loops and skipping: what comes next depends on the state, the parameters and
    /// [`Interp::carry`] alone.
    pub fn at_rest(&self) -> bool {
        self.levels.len() == 1
            && self.levels[0].m98_left == -1
            && self.levels[0].ret.is_none()
            && self.skip.is_none()
            && self.loops.is_empty()
            && self.remaps.is_empty()
            && self.modal_macros.is_empty()
            && !self.defining_sub
            && self.sub_name.is_none()
            && self.place.frame == FrameId::MAIN
            && self.queue.is_of(self.place.file)
    }

    /// Runs until the run is [at rest](Interp::at_rest) before a line that `stop` knows, with no control flow behind it
    /// that was met already; or to the end.
    pub fn run_until(&mut self, stop: &dyn Fn(u32) -> bool) -> Option<End> {
        loop {
            if let Some(end) = self.run_open_piece() {
                return Some(end);
            }
            if self.next >= self.frontier && self.at_rest() && stop(self.next) {
                return None;
            }
        }
    }

    /// Whether this line is the next one to be executed, not skipped.
    pub fn comes_to(&self, file: FileId, line: u32) -> bool {
        self.skip.is_none() && self.place.file == file && self.next == line
    }
    /// The line that comes next.
    pub fn next_line(&self) -> u32 {
        self.next
    }

    /// The line of the main program that is being executed, or that the present call comes from.
    pub fn main_line(&self) -> u32 {
        self.levels.first().and_then(|l| l.ret.as_ref()).map_or(self.place.line, |ret| ret.place.line)
    }
    /// Branches and loops of a file that were opened and never closed.
    pub fn unclosed_of(&mut self, file: FileId) -> Vec<crate::Finding> {
        self.unclosed_in(file)
    }
    /// Files that were opened, in order.
    pub fn opened_files(&self) -> &[FileId] {
        &self.opened.order
    }
}
