//! What is no motion: spindle, coolant, tool change, outputs and inputs, stops and M-codes, by the words of the cell.

use gr_ir::{Override, State, Stop, Turn};
use gr_text::code;

use super::{Gather, Item};
use crate::cell::Made;
use crate::{Action, Step, Word};

impl Gather<'_> {
    pub(super) fn word(&mut self, word: Word, value: Option<f64>) {
        let made = self.cells.word(word, value);
        self.made(made);
    }

    /// M19.
    pub(super) fn orient(&mut self, spindle: i32, angle: f64, direction: i32) {
        if spindle > 0 {
            return self.cannot("a second spindle ($)");
        }
        let degrees = libm::round(angle.to_degrees() * 1e9) / 1e9;
        let word = Word::new("M19").with('R', degrees);
        let word = if direction == 0 { word } else { word.with('P', f64::from(direction)) };
        if degrees != 0.0 && self.on_or_off(&word) {
            return self.cannot(&format!("the angle of {word} (the row `M19` of the machine file switches an output)"));
        }
        self.word(word, Some(degrees));
    }

    /// The Q of M19: the program goes on when the spindle stands there.
    pub(super) fn oriented(&mut self, timeout: f64) {
        let last = self.out.items.iter_mut().rev().find_map(|i| match i {
            Item::Do(Step { action: Action::Signal { word, .. }, .. }) if word.code == "M19" => Some(word),
            _ => None,
        });
        match (last, self.cells.own_words()) {
            (Some(word), true) => word.arguments.push(('Q', timeout)),
            // By hand the operator waits; a routine comes back when it is done.
            _ => match self.cells.row(&Word::new("M19")) {
                Some(s) if s.routine.is_none() && s.wait.is_none() && s.seconds.is_none() => {
                    self.cannot("waiting for the spindle to stand, M19 with Q (the row `M19` of the machine file has neither `wait` nor `seconds`),");
                }
                _ => {}
            },
        }
    }

    /// M100 to M199; an argument that isn't there comes as -1.
    pub(super) fn user(&mut self, code: i32, p: f64, q: f64) {
        let word = Word::new(format!("M{code}"));
        let given = |v: f64| (v != -1.0).then_some(v);
        let word = given(p).map_or(word.clone(), |p| word.with('P', p));
        let word = given(q).map_or(word.clone(), |q| word.with('Q', q));
        if !self.cells.own_words() && given(q).is_some() && self.cells.row(&word).is_some() {
            return self.cannot(&format!("the Q of {word} (a row of the machine file passes on one number)"));
        }
        if given(p).is_some() && self.on_or_off(&word) {
            return self.cannot(&format!("the number of {word} (the row `{}` of the machine file switches an output)", word.code));
        }
        self.word(word, given(p));
    }

    /// A word that becomes an output, where a number has no place.
    pub(super) fn on_or_off(&self, word: &Word) -> bool {
        !self.cells.own_words() && self.cells.row(word).is_some_and(|s| s.routine.is_none() && s.signal.is_some())
    }

    /// M62 to M68; none: the row for all of the outputs is that of one.
    pub(super) fn numbered(&mut self, made: Result<Made, Word>) {
        match made {
            Ok(made) => self.made(made),
            Err(word) => {
                let (code, own) = (&word.code, word.key());
                self.cannot(&format!("the number of {word} (the row `{code}` of the machine file can't pass it on; a row `{own}` is for this output alone)"));
            }
        }
    }

    /// M48 to M53: switches of the operator's panel, which a robot's controller keeps to itself.
    pub(super) fn switch(&mut self, which: Override, free: bool) {
        let (code, usual) = match which {
            Override::Feed => ("M50", true),
            Override::Speed(spindle) if spindle > 0 => return,
            Override::Speed(_) => ("M51", true),
            Override::Adaptive => ("M52", false),
            Override::FeedHold => ("M53", true),
        };
        let known = self.switches.insert(code, free).unwrap_or(usual);
        if known == free {
            return;
        }
        let word = Word::new(code).with('P', f64::from(u8::from(free)));
        if self.on_or_off(&word) {
            let made = self.cells.switched(word, free);
            return self.made(made);
        }
        if self.cells.own_words() && !free {
            // What its row waits for comes when it is on.
            return self.act(Action::Signal { word, value: Some(0.0), signal: gr_machine::Signal::default() });
        }
        if self.cells.own_words() || self.cells.row(&word).is_some() {
            return self.word(word, Some(f64::from(u8::from(free))));
        }
        if free != usual {
            // A tapping cycle does so by itself.
            let what = self.cycle.map_or_else(|| word.to_string(), |c| format!("the lock of feed and speed override in {}", format_args!("G{}", c / 10)));
            self.findings.once_each(code::ROBOT_OVERRIDE, Some(self.source), &[what]);
        }
    }

    /// M0, M1, M60.
    pub(super) fn stop(&mut self, stop: Stop) {
        let pallet = std::mem::take(&mut self.pallet);
        if !pallet {
            return self.act(Action::Pause { optional: stop == Stop::Optional });
        }
        let row = self.cells.row(&Word::new("M60")).is_some();
        self.word(Word::new("M60"), None);
        if row {
            self.act(Action::Pause { optional: false });
        }
    }

    pub(super) fn speed_word(&mut self, state: &State, spindle: i32, speed: f64) {
        if speed > 0.0
            && let Some(limit) = self.cells.spindle_limit(speed)
        {
            self.findings.say(code::ROBOT_SPINDLE_SPEED, Some(self.source), &[gr_text::figures::number(speed, 3), limit]);
        }
        let turning = state.spindle(spindle).turn;
        let made = self.cells.speed(speed, turning);
        self.made(made);
    }

    pub(super) fn turn_word(&mut self, state: &State, spindle: i32, turn: Turn) {
        let made = self.cells.turn(turn, state.spindle(spindle).speed);
        self.made(made);
    }

    pub(super) fn coolant(&mut self, word: &str, on: bool, state: &State) {
        let made = self.cells.coolant(word, on, state.mist || state.flood);
        self.made(made);
    }

    pub(super) fn input(&mut self, index: i32, digital: bool, wait: i32, timeout: f64) {
        let word = Word::numbered("M66", if digital { 'P' } else { 'E' }, index).with('L', f64::from(wait));
        let word = if timeout > 0.0 { word.with('Q', timeout) } else { word };
        if self.cells.own_words() {
            let value = Some(f64::from(index));
            return self.act(Action::Signal { word, value, signal: gr_machine::Signal::default() });
        }
        if wait == 0 {
            // What is read has an operation of its own where the program depends on it.
            return self.act(Action::Comment(word.to_string()));
        }
        if !digital {
            return self.cannot("waiting for an analog input");
        }
        let Some(name) = self.cells.input(index) else {
            return self.word(word, Some(f64::from(index)));
        };
        let timeout = (timeout > 0.0).then_some(timeout);
        // 1 rise, 2 fall, 3 high, 4 low.
        let states: &[bool] = match wait {
            1 => &[false, true],
            2 => &[true, false],
            3 => &[true],
            4 => &[false],
            _ => &[],
        };
        for on in states {
            self.act(Action::WaitInput { name: name.clone(), on: *on, timeout });
        }
    }

    pub(super) fn change(&mut self, tool: i32) {
        let number = u32::try_from(tool).unwrap_or(0);
        let by = self.cells.signal("M6");
        self.act(Action::ChangeTool { number, by });
    }
}
