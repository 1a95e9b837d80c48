//! Lines, words and numbers.

use super::{Language, Options};
use gr_ir::{Source, Units};

/// The text so far and how numbers look.
pub(super) struct Writer {
    pub text: String,
    /// Source line that is being written, and that of each line so far; `u32::MAX` = none.
    pub source: u32,
    pub lines: Vec<u32>,
    /// mm per length unit.
    pub unit: f64,
    pub places: usize,
    language: Language,
    numbers: Option<(u32, u32)>,
    line: String,
    /// G43 with its H, or G49, that waits for a block with a Z: without one the axis moves by the length on a Fanuc control.
    held: Option<(String, Source)>,
    /// The spindle's speed that goes with the next block.
    pub speed: Option<String>,
    /// The program has asked for a length.
    lengthened: bool,
}

impl Writer {
    pub fn new(options: &Options) -> Writer {
        let unit = if options.units == Units::Inch { 25.4 } else { 1.0 };
        Writer {
            text: String::new(),
            source: u32::MAX,
            lines: Vec::new(),
            unit,
            places: options.places(),
            language: options.language,
            numbers: options.numbers,
            line: String::new(),
            held: None,
            speed: None,
            lengthened: false,
        }
    }

    /// A line without number.
    pub fn bare(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
        self.lines.push(self.source);
    }

    /// Keeps G43 or G49 for the next block that moves Z. One that takes no length away needs no such block.
    pub fn hold(&mut self, block: &str, source: Source) {
        if block == "G49" && !self.lengthened {
            return self.block(block);
        }
        self.lengthened |= block != "G49";
        self.held = Some((block.to_string(), source));
    }

    /// What is still kept, and where it was asked for.
    pub fn release(&mut self) -> Option<(String, Source)> {
        self.held.take()
    }

    /// A block.
    pub fn block(&mut self, words: &str) {
        let with = self.with_held(words).or_else(|| Some(format!("{words} S{}", self.speed.take()?)));
        let words = with.as_deref().unwrap_or(words);
        if let Some((n, step)) = self.numbers {
            self.text.push_str(&format!("N{n} "));
            // Five digits are what every control takes.
            self.numbers = Some((if n + step > 99_999 { step } else { n + step }, step));
        }
        self.bare(words);
    }

    /// A block together with the length that is kept for it, where it is the one that moves Z.
    fn with_held(&mut self, words: &str) -> Option<String> {
        let (held, _) = self.held.as_ref()?;
        let any = |of: &[&str]| words.split(' ').any(|w| of.contains(&w));
        let moves = words.split(' ').any(|w| w.starts_with('Z')) && !any(&["G10", "G92", "G52", "G04", "G4"]);
        // A place of the machine takes no length; on the way home from where it stands (G91 G28 Z0) the axis would move by it.
        let takes = !any(&["G53", "G28", "G30"]) || held == "G49" && !any(&["G91"]);
        let (held, _) = self.held.take_if(|_| moves && takes)?;
        Some(held.split_once(' ').map_or(format!("{held} {words}"), |(code, h)| format!("{code} {words} {h}")))
    }

    /// Begins a block to which words are added.
    pub fn begin(&mut self) {
        self.line.clear();
    }
    pub fn add(&mut self, word: &str) {
        if !self.line.is_empty() {
            self.line.push(' ');
        }
        self.line.push_str(word);
    }
    pub fn end(&mut self) {
        let line = std::mem::take(&mut self.line);
        self.block(&line);
        self.line = line;
    }

    /// A number with at most so many decimals.
    pub fn number(&self, value: f64, places: usize) -> String {
        self.spelled(match gr_canon::fixed_units(value, places) {
            Some(units) => decimal(units, places, value.is_sign_negative()),
            None => format!("{value:.places$}"),
        })
    }

    /// A decimal without zeros at its end, as the language wants it.
    fn spelled(&self, mut text: String) -> String {
        if text.contains('.') {
            text.truncate(text.trim_end_matches('0').len());
        }
        if text == "-0." || text == "-0" {
            text.remove(0);
        }
        match self.language {
            // Without a point these controls count in the smallest increment.
            Language::FanucMill => {
                if !text.contains('.') {
                    text.push('.');
                }
            }
            _ => {
                if text.ends_with('.') {
                    text.pop();
                }
            }
        }
        text
    }

    /// The text of an axis value (mm or rad) and the value that the text really says.
    pub fn axis(&self, axis: usize, value: f64) -> (String, f64) {
        self.axis_fine(axis, value, self.places)
    }

    pub fn axis_fine(&self, axis: usize, value: f64, places: usize) -> (String, f64) {
        let rotary = (3..6).contains(&axis);
        let wanted = if rotary { value.to_degrees() } else { value / self.unit };
        let (text, said) = match gr_canon::fixed_units(wanted, places) {
            // Both are exact, so that the quotient is what the text reads back as.
            Some(units) if units < 1 << 53 => {
                let negative = wanted.is_sign_negative() && units != 0;
                let size = units as f64 / 10_u64.pow(places as u32) as f64;
                (self.spelled(decimal(units, places, negative)), if negative { -size } else { size })
            }
            _ => {
                let text = self.number(wanted, places);
                let said = text.parse::<f64>().unwrap_or(0.0);
                (text, said)
            }
        };
        (text, if rotary { said * (std::f64::consts::PI / 180.0) } else { said * self.unit })
    }

    /// A length (mm).
    pub fn length(&self, value: f64, places: usize) -> (String, f64) {
        self.axis_fine(0, value, places)
    }

    /// Smallest step of a length, mm.
    pub fn step(&self) -> f64 {
        self.unit * libm::pow(10.0, -(self.places as f64))
    }

    /// A comment, within what the control takes.
    pub fn comment(&mut self, text: &str) {
        let clean: String = text.chars().map(|c| self.comment_char(c)).collect();
        let mut rest = clean.trim();
        while !rest.is_empty() {
            let mut cut = rest.len().min(if self.language == Language::Linuxcnc { 200 } else { 60 });
            while !rest.is_char_boundary(cut) {
                cut -= 1;
            }
            self.bare(&format!("({})", rest[..cut].trim()));
            rest = rest[cut..].trim_start();
        }
    }

    fn comment_char(&self, c: char) -> char {
        match (c, self.language) {
            ('(', _) => '[',
            (')', _) => ']',
            (c, _) if c.is_control() => ' ',
            (c, Language::Linuxcnc) => c,
            (c, _) if !c.is_ascii() => '?',
            (c, Language::FanucMill) => c.to_ascii_uppercase(),
            (c, Language::Grbl) => c,
        }
    }
}

/// Word letters of the axes.
pub(super) const AXES: [char; 9] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];

/// A number given in units of its last decimal.
fn decimal(mut units: u64, places: usize, negative: bool) -> String {
    let mut text = [b'0'; 24];
    let mut at = text.len();
    let mut left = places;
    loop {
        at -= 1;
        text[at] = b'0' + (units % 10) as u8;
        units /= 10;
        if left > 0 {
            left -= 1;
            if left == 0 {
                at -= 1;
                text[at] = b'.';
            }
            continue;
        }
        if units == 0 {
            break;
        }
    }
    if negative {
        at -= 1;
        text[at] = b'-';
    }
    std::str::from_utf8(&text[at..]).unwrap_or_default().to_string()
}
