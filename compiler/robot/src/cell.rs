//! What the words M3 M5 S M8 M62 … become: outputs, routines and waits of the machine file, or a request to the
//! operator.

use gr_ir::Turn;
use gr_machine::{Machine, Signal};

use crate::{Action, Word};

/// What a word becomes.
pub(crate) struct Made {
    pub actions: Vec<Action>,
    /// A word the machine file says nothing about.
    pub by_hand: Option<String>,
}

impl Made {
    const NOTHING: Made = Made { actions: Vec::new(), by_hand: None };
}

pub(crate) struct Cells {
    io: std::collections::BTreeMap<String, Signal>,
    limits: (Option<f64>, Option<f64>),
    by_hand: bool,
    own_words: bool,
    turning: Turn,
    coolant: bool,
    mist: bool,
    flood: bool,
    speed: f64,
    /// Speed that the operator was asked to set.
    told: f64,
}

impl Cells {
    pub fn new(machine: &Machine, own_words: bool) -> Cells {
        let spindle = machine.cell.spindle.as_ref();
        Cells {
            io: machine.cell.io.clone(),
            limits: spindle.map_or((None, None), |s| s.speed),
            by_hand: spindle.is_some_and(|s| !s.controlled),
            own_words,
            turning: Turn::Stop,
            coolant: false,
            mist: false,
            flood: false,
            speed: 0.0,
            told: 0.0,
        }
    }

    pub fn signal(&self, word: &str) -> Option<Signal> {
        self.io.get(word).cloned()
    }

    /// What is wrong with a speed.
    pub fn spindle_limit(&self, speed: f64) -> Option<String> {
        let (min, max) = self.limits;
        match (min.filter(|m| speed < *m), max.filter(|m| speed > *m)) {
            (Some(m), _) => Some(format!("its least speed is {m}")),
            (_, Some(m)) => Some(format!("its greatest speed is {m}")),
            _ => None,
        }
    }

    /// The output or routine of a word, then its wait.
    pub fn word(&self, word: Word, value: Option<f64>) -> Made {
        match self.row(&word) {
            Some(signal) => Made { actions: steps(word, value, signal), by_hand: None },
            None if self.own_words => {
                Made { actions: vec![Action::Signal { word, value, signal: Signal::default() }], by_hand: None }
            }
            None => by_hand(&word),
        }
    }

    /// What the machine file says about a word: a row for its own number comes first.
    pub fn row(&self, word: &Word) -> Option<Signal> {
        self.io.get(&word.key()).or_else(|| self.io.get(&word.code)).cloned()
    }

    /// The controller knows the program's words itself.
    pub fn own_words(&self) -> bool {
        self.own_words
    }

    fn spindle(&self, turn: Turn, speed: f64) -> Made {
        let word = Word::new(turn_word(turn));
        let runs = turn != Turn::Stop;
        let word = if runs && speed > 0.0 { word.with('S', speed) } else { word };
        if self.by_hand { by_hand(&word) } else { self.word(word, runs.then_some(speed)) }
    }

    /// Starts and stops the spindle; an output that is on or off leaves the speed to the operator.
    fn turned(&mut self, turn: Turn, speed: f64) -> Made {
        let made = self.spindle(turn, speed);
        let output = self.io.get(turn_word(turn)).is_some_and(|s| s.routine.is_none());
        let unsaid = turn != Turn::Stop && output && !self.by_hand && !self.own_words && !self.io.contains_key("S");
        if !unsaid || speed == self.told {
            return made;
        }
        self.told = speed;
        let mut asked = by_hand(&Word::new("S").with('S', speed));
        asked.actions.extend(made.actions);
        asked
    }

    pub fn speed(&mut self, speed: f64, turning: Turn) -> Made {
        let same = self.speed == speed;
        self.speed = speed;
        if same {
            return Made::NOTHING;
        }
        if !self.by_hand && self.io.contains_key("S") {
            let mut made = self.word(Word::new("S").with('S', speed), Some(speed));
            if turning != Turn::Stop {
                made.actions.extend(self.io.get(turn_word(turning)).and_then(wait));
            }
            return made;
        }
        // Without an output of its own the speed goes with the word that starts the spindle.
        if turning == Turn::Stop { Made::NOTHING } else { self.turned(turning, speed) }
    }

    pub fn turn(&mut self, turn: Turn, speed: f64) -> Made {
        if self.turning == turn && turn == Turn::Stop {
            return Made::NOTHING;
        }
        // A standing spindle has nothing on that would have to be let go.
        let off = if self.turning == Turn::Stop { None } else { self.left_on(turn_word(self.turning), turn_word(turn)) };
        self.turning = turn;
        let mut made = self.turned(turn, speed);
        made.actions.splice(0..0, off);
        made
    }

    /// Switches off the output of a word that another word takes over from, where that one has another output.
    fn left_on(&self, old: &str, new: &str) -> Option<Action> {
        let output = |word: &str| self.io.get(word).filter(|s| s.routine.is_none());
        let on = output(old).filter(|s| old != new && s.signal.is_some() && !self.own_words)?;
        if output(new).is_some_and(|s| s.signal == on.signal) {
            return None;
        }
        let signal = off(on.clone());
        Some(Action::Signal { word: Word::new(new), value: signal.value, signal })
    }

    pub fn coolant(&mut self, word: &str, on: bool, any: bool) -> Made {
        if on {
            self.coolant = true;
            self.mist |= word == "M7";
            self.flood |= word == "M8";
            return self.word(word.into(), None);
        }
        // M9 comes as two switches; one word does both.
        if any || !self.coolant {
            return Made::NOTHING;
        }
        let off = [("M7", self.mist), ("M8", self.flood)].into_iter().filter(|(_, on)| *on).filter_map(|(w, _)| self.left_on(w, "M9"));
        let off: Vec<Action> = off.collect();
        (self.coolant, self.mist, self.flood) = (false, false, false);
        let mut made = self.word("M9".into(), None);
        made.actions.extend(off);
        made
    }

    /// Spindle and coolant at the end of a program.
    pub fn off(&mut self) -> Made {
        let mut made = self.turn(Turn::Stop, 0.0);
        let more = self.coolant("M9", false, false);
        made.actions.extend(more.actions);
        made.by_hand = made.by_hand.or(more.by_hand);
        made
    }

    /// Spindle and coolant off while somebody works at the part, and on again as they were.
    pub fn rest(&mut self) -> (Made, Made) {
        let (turning, speed, coolants) = (self.turning, self.speed, [("M7", self.mist), ("M8", self.flood)]);
        let off = self.off();
        let mut on = if turning == Turn::Stop { Made::NOTHING } else { self.turn(turning, speed) };
        for (word, _) in coolants.into_iter().filter(|(_, was)| *was) {
            let more = self.coolant(word, true, true);
            on.actions.extend(more.actions);
            on.by_hand = on.by_hand.or(more.by_hand);
        }
        (off, on)
    }

    /// An output that a word switches on and off: what its row says is for on.
    pub fn switched(&self, word: Word, on: bool) -> Made {
        let Some(signal) = self.row(&word) else { return Made::NOTHING };
        let signal = if on { Signal { value: signal.value.or(Some(1.0)), ..signal } } else { off(signal) };
        Made { actions: steps(word, None, signal), by_hand: None }
    }

    /// M62 … M65: a row for the output's own number (`M62P3`) comes before one for all, which has to pass the number on. The word:
    /// it can't.
    pub fn digital(&self, index: i32, on: bool, synced: bool) -> Result<Made, Word> {
        let (own, other) = match (on, synced) {
            (true, true) => ("M62", "M64"),
            (true, false) => ("M64", "M62"),
            (false, true) => ("M63", "M65"),
            (false, false) => ("M65", "M63"),
        };
        let numbered = |w: &str| self.io.get(&format!("{w}P{index}")).cloned();
        let word = Word::numbered(own, 'P', index);
        if let Some(signal) = numbered(own).or_else(|| numbered(other)) {
            return Ok(Made { actions: steps(word, None, signal), by_hand: None });
        }
        let opposite = if on { ["M63", "M65"] } else { ["M62", "M64"] };
        if let Some(signal) = opposite.into_iter().find_map(numbered).filter(|s| s.signal.is_some()) {
            // The contrary of what its row says: some outputs are on at 0.
            let value = Some(signal.value.map_or(f64::from(u8::from(on)), |v| contrary(Some(v))));
            return Ok(Made { actions: steps(word, None, Signal { value, ..off(signal) }), by_hand: None });
        }
        if !self.own_words && self.row(&word).is_some_and(|s| s.routine.is_none() && s.signal.is_some()) {
            return Err(word);
        }
        Ok(self.word(word, Some(f64::from(index))))
    }

    /// M67, M68. The word: its row can't pass on the number.
    pub fn analog(&self, index: i32, value: f64, synced: bool) -> Result<Made, Word> {
        let (own, other) = if synced { ("M67", "M68") } else { ("M68", "M67") };
        let word = Word::numbered(own, 'E', index).with('Q', value);
        let other = self.io.get(&Word::numbered(other, 'E', index).key());
        if let (None, Some(signal)) = (self.io.get(&word.key()), other) {
            return Ok(Made { actions: steps(word, Some(value), signal.clone()), by_hand: None });
        }
        // Of the two numbers it is the value that is passed on.
        if !self.own_words && !self.io.contains_key(&word.key()) && self.row(&word).is_some() {
            return Err(word);
        }
        Ok(self.word(word, Some(value)))
    }

    /// Name of the input that M66 waits for.
    pub fn input(&self, index: i32) -> Option<String> {
        let row = self.io.get(&format!("M66P{index}"))?;
        row.wait.clone().or_else(|| row.signal.clone())
    }
}

fn turn_word(turn: Turn) -> &'static str {
    match turn {
        Turn::Cw => "M3",
        Turn::Ccw => "M4",
        Turn::Stop => "M5",
    }
}

/// The contrary of a row: what the row waits for doesn't come then.
fn off(row: Signal) -> Signal {
    Signal { value: Some(contrary(row.value)), wait: None, seconds: None, ..row }
}

/// What switches off an output that is on at a value; some are on at 0.
fn contrary(on: Option<f64>) -> f64 {
    if on == Some(0.0) { 1.0 } else { 0.0 }
}

/// The operator does it.
fn by_hand(word: &Word) -> Made {
    let actions = vec![Action::Message(word.to_string()), Action::Pause { optional: false }];
    Made { actions, by_hand: Some(word.key()) }
}

/// An output or routine without its wait, then the wait.
fn steps(word: Word, value: Option<f64>, signal: Signal) -> Vec<Action> {
    let after = wait(&signal);
    let plain = Signal { wait: None, seconds: None, ..signal };
    let mut out = Vec::new();
    if plain.signal.is_some() || plain.routine.is_some() {
        out.push(Action::Signal { word, value, signal: plain });
    }
    out.extend(after);
    out
}

fn wait(signal: &Signal) -> Option<Action> {
    match (&signal.wait, signal.seconds) {
        (Some(name), timeout) => Some(Action::WaitInput { name: name.clone(), on: true, timeout }),
        (None, Some(s)) if s > 0.0 => Some(Action::Dwell(s)),
        _ => None,
    }
}
