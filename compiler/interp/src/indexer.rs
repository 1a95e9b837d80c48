//! Rotary axes that lock (`LOCKING_INDEXER_JOINT` in the INI file): they turn alone, by G0, at an exact stop. (LinuxCNC 2.9
//! documentation, INI configuration, AXIS_(A-W) section; beside `rs274`.)

use gr_canon::{Axes, Call, PathMode, Sink};
use gr_spec::{Rs274, code, rs274};

use crate::{Fault, Interp, Res};

const LETTERS: [u8; 3] = *b"abc";

fn refused(rs: Rs274, letter: u8, why: &str) -> Box<Fault> {
    let axis = char::from(letter.to_ascii_uppercase());
    Fault::new(code::AXIS_INDEXER, rs).arg(axis).arg(why).at(letter)
}

impl<S: Sink> Interp<'_, S> {
    /// A motion with a word for such an axis; false: there is none.
    #[cold]
    pub(crate) fn index_motion(&mut self, motion: i16) -> Res<bool> {
        let locks = |i: usize| self.config.indexers[i].is_some() && self.block.has(LETTERS[i]);
        let named: Vec<usize> = (0..3).filter(|i| locks(*i)).collect();
        let Some(first) = named.first() else { return Ok(false) };
        if motion != 0 {
            return Err(refused(rs274::INDEXER_G0, LETTERS[*first], "is moved by G0 alone"));
        }
        let others = |i: &usize| self.block.has_any(b"xyzuvw") || (0..3).any(|k| k != *i && self.block.has(LETTERS[k]));
        if let Some(i) = named.iter().find(|i| others(i)) {
            return Err(refused(rs274::INDEXER_ALONE, LETTERS[*i], "is moved without any other axis"));
        }
        self.m.cycle_il_set = 0;
        let (axis, end) = (first + 3, self.find_ends()?);
        if end.iter().zip(&self.m.current).enumerate().any(|(i, (to, from))| i != axis && to != from) {
            return Err(refused(rs274::INDEXER_BUG, LETTERS[*first], "is moved without any other axis"));
        }
        self.index_axis(axis, end[axis]);
        Ok(true)
    }

    /// Such axes go first where a move of all axes follows.
    pub(crate) fn index_before(&mut self, to: &Axes) {
        let indexers = self.config.indexers;
        for i in (3..6).filter(|i| indexers[i - 3].is_some()) {
            if to[i] != self.m.current[i] {
                self.index_axis(i, to[i]);
            }
        }
    }

    fn index_axis(&mut self, axis: usize, to: f64) {
        let (path, tolerances) = (self.world.path, [self.world.tolerance, self.world.naivecam]);
        if path != 0 {
            self.emit(Call::SetMotionControlMode(PathMode::ExactPath));
        }
        self.m.current[axis] = to;
        self.emit(Call::StraightTraverse(self.m.current));
        if path != 0 {
            self.restore_path_mode(path, tolerances);
        }
    }
}
