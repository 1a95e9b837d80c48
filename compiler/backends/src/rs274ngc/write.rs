//! Lines, words and numbers.

use super::{Language, Options};
use gr_ir::Units;

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
        }
    }

    /// A line without number.
    pub fn bare(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
        self.lines.push(self.source);
    }

    /// A block.
    pub fn block(&mut self, words: &str) {
        if let Some((n, step)) = self.numbers {
            self.text.push_str(&format!("N{n} "));
            // Five digits are what every control takes.
            self.numbers = Some((if n + step > 99_999 { step } else { n + step }, step));
        }
        self.bare(words);
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
        let mut text = format!("{value:.places$}");
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
        let text = self.number(if rotary { value.to_degrees() } else { value / self.unit }, places);
        let said = text.parse::<f64>().unwrap_or(0.0);
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
