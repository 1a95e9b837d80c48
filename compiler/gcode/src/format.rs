//! The formatter: blanks, case and indentation of a program, and nothing else. What the program says stays:
//! reading the result gives the same words, values and comments.
//! Formatting twice is formatting once. Lines with faults are left as they are.

use gr_spec::{Dialect, Family};

use crate::fast::Rules;
use crate::model::*;

/// Case of letters outside comments and names.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Case {
    /// As written.
    Keep,
    /// `G1`, `SIN`
    #[default]
    Upper,
    /// `g1`, `sin`
    Lower,
}

/// Zeros in front of numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum LeadingZeros {
    /// As written.
    #[default]
    Keep,
    /// `G01` becomes `G1`, `X007.5` becomes `X7.5`.
    Strip,
    /// `G1` becomes `G01`; G and M words only.
    Pad,
}

/// What [`format`] does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FormatOptions {
    /// Case of words, functions and operators.
    pub case: Case,
    /// Case of O-words and their keywords (`o100 while`).
    pub o_word_case: Case,
    /// A blank between words and around operators.
    pub spaces: bool,
    /// Blanks per level of nesting of O-words and macro loops; 0 = no indentation.
    pub indent: usize,
    /// Zeros in front of numbers.
    pub leading_zeros: LeadingZeros,
}

impl Default for FormatOptions {
    fn default() -> Self {
        FormatOptions {
            case: Case::Upper,
            o_word_case: Case::Lower,
            spaces: true,
            indent: 2,
            leading_zeros: LeadingZeros::Keep,
        }
    }
}

/// Formats a whole program that was scanned with `dialect`.
pub fn format(text: &str, scan: &Scan, dialect: &'static Dialect, options: &FormatOptions) -> String {
    let mut formatter = Formatter {
        text,
        scan,
        options,
        rules: Rules::new(dialect),
        open: Vec::new(),
        out: String::with_capacity(text.len() + text.len() / 8),
    };
    for line in 0..scan.lines.len() as u32 {
        formatter.line(line);
    }
    formatter.out
}

struct Formatter<'a> {
    text: &'a str,
    scan: &'a Scan,
    options: &'a FormatOptions,
    rules: Rules,
    /// Open blocks: a `do` waits for its `while`.
    open: Vec<(Keyword, String)>,
    out: String,
}

impl Formatter<'_> {
    fn line(&mut self, line: u32) {
        let span = self.scan.line_span(self.text, line);
        let next = self.scan.lines.get(line as usize + 1).map_or(self.text.len(), |l| l.start as usize);
        let source = &self.text[span.range()];
        let ending = &self.text[span.end as usize..next];
        let depth = self.nesting(line);
        // `;py,` is a command to LinuxCNC only at the very start of a line.
        if self.scan.lines[line as usize].faulty || source.starts_with(";py,") || self.name_hides_the_rest(line) {
            self.out.push_str(source);
        } else {
            let body = self.body(line);
            let indent = if body.is_empty() { 0 } else { depth * self.options.indent };
            // An empty line would join a lone CR before it with its LF.
            let joins = body.is_empty() && ending == "\n" && self.out.ends_with('\r');
            if joins || indent + body.len() + ending.len() > self.rules.longest {
                // Better unformatted than too long for the controller.
                self.out.push_str(source);
            } else {
                self.out.extend(std::iter::repeat_n(' ', indent));
                self.out.push_str(&body);
            }
        }
        self.out.push_str(ending);
    }

    /// A `;` inside a name makes blanks count up to the end of the line.
    fn name_hides_the_rest(&self, line: u32) -> bool {
        let structured = |w: &&Word| matches!(w.form, Form::Expr | Form::Setting | Form::Control);
        self.scan.lines[line as usize].kind == LineKind::Structured
            && self.scan.words(line).iter().filter(structured).any(|w| {
                self.text[self.scan.word_span(self.text, line, w).range()].contains(';')
            })
    }

    /// Keeps the stack of open blocks; gives the level at which this line stands.
    fn nesting(&mut self, line: u32) -> usize {
        use Keyword::*;
        let control = self.scan.words(line).iter().find(|w| w.form == Form::Control);
        let Some(control) = control.map(|w| self.scan.controls[w.index()]) else { return self.open.len() };
        let label: String =
            self.text[control.label_span.range()].chars().filter(|c| !c.is_whitespace()).collect::<String>().to_lowercase();
        match control.keyword {
            Sub | Do | If | Repeat | MacroWhile | MacroDo => {
                self.open.push((control.keyword, label));
                self.open.len() - 1
            }
            While if self.open.last().is_some_and(|(k, l)| *k == Do && *l == label) => {
                self.open.pop();
                self.open.len()
            }
            While => {
                self.open.push((While, label));
                self.open.len() - 1
            }
            Else | Elseif => self.open.len().saturating_sub(1),
            Endsub | Endwhile | Endif | Endrepeat | MacroEnd => {
                self.open.pop();
                self.open.len()
            }
            _ => self.open.len(),
        }
    }

    fn body(&self, line: u32) -> String {
        let words = self.scan.words(line);
        let row = &self.scan.lines[line as usize];
        let mut out = String::new();
        let mut level = false;
        if row.deleted {
            let end = words.first().map_or(self.scan.line_span(self.text, line).end, |w| w.start);
            let prefix = &self.text[row.start as usize..end as usize];
            out.extend(prefix.chars().filter(|c| !c.is_whitespace() && *c != '\u{b}'));
            level = out.len() > 1;
        }
        let mut taken = 0;
        for word in words {
            // A comment inside a call is part of the call's text.
            if word.start < taken {
                continue;
            }
            let span = self.scan.word_span(self.text, line, word);
            taken = span.end;
            let block_end = word.letter == b';' && self.rules.family == Family::Fanuc;
            let first = out.is_empty() || (out == "/" && !level);
            let must = level && out.len() == 2;
            if (!first && self.options.spaces && !block_end) || must {
                out.push(' ');
            }
            self.word(word, &self.text[span.range()], &mut out);
        }
        out
    }

    fn word(&self, word: &Word, source: &str, out: &mut String) {
        match word.form {
            Form::Comment | Form::Bad => out.push_str(source),
            Form::Literal => self.literal(word, source, out),
            Form::Expr | Form::Setting | Form::Control => self.tokens(source, word, out),
        }
    }

    fn literal(&self, word: &Word, source: &str, out: &mut String) {
        let closed: Vec<u8> = source.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
        out.push(cased(closed[0], self.options.case));
        let number = &closed[1..];
        let signs = number.iter().take_while(|b| matches!(b, b'+' | b'-')).count();
        let digits = &number[signs..];
        let whole = digits.iter().take_while(|b| b.is_ascii_digit()).count();
        let digits = match self.options.leading_zeros {
            LeadingZeros::Strip => {
                let zeros = digits[..whole].iter().take_while(|b| **b == b'0').count();
                &digits[zeros.min(whole.saturating_sub(1))..]
            }
            _ => digits,
        };
        out.extend(number[..signs].iter().map(|b| char::from(*b)));
        if self.options.leading_zeros == LeadingZeros::Pad && whole == 1 && signs == 0 && matches!(word.letter, b'g' | b'm')
        {
            out.push('0');
        }
        out.extend(digits.iter().map(|b| char::from(*b)));
    }

    /// A word with structure: blanks out, then blanks in where they help.
    fn tokens(&self, source: &str, word: &Word, out: &mut String) {
        let o_word = word.form == Form::Control && self.rules.family == Family::Linuxcnc;
        let mut writer = Writer {
            out,
            spaces: self.options.spaces,
            case: self.options.case,
            keyword_case: if o_word { self.options.o_word_case } else { self.options.case },
            control: word.form == Form::Control,
            depth: 0,
            value_ends: false,
            atan: Vec::new(),
            after_atan: false,
        };
        let pieces = pieces(source);
        let mut i = 0;
        if let Some(Piece::Letters(letters)) = pieces.first() {
            // The word's own letter is no function; an O label follows its O at once.
            let own = if word.form == Form::Control && word_is_macro(self.scan, word) { letters.len() } else { 1 };
            let (own, rest) = letters.split_at(own.min(letters.len()));
            writer.keyword_start(own, word.form == Form::Control);
            if !rest.is_empty() {
                writer.letters(rest);
            }
            i = 1;
        }
        for piece in &pieces[i..] {
            writer.piece(piece);
        }
        // A keyword leaves a blank for what may follow.
        let end = out.trim_end_matches(' ').len();
        out.truncate(end);
    }
}

fn word_is_macro(scan: &Scan, word: &Word) -> bool {
    matches!(scan.controls[word.index()].label, OLabel::None)
}

fn cased(byte: u8, case: Case) -> char {
    char::from(match case {
        Case::Keep => byte,
        Case::Upper => byte.to_ascii_uppercase(),
        Case::Lower => byte.to_ascii_lowercase(),
    })
}

enum Piece {
    Letters(String),
    Number(String),
    Mark(u8),
    /// Name or comment, as written.
    Verbatim(String),
}

/// Cuts a faultless word; blanks outside names and comments are dropped.
fn pieces(source: &str) -> Vec<Piece> {
    let bytes = source.as_bytes();
    let mut pieces: Vec<Piece> = Vec::new();
    let mut i = 0;
    while i < bytes.len() {
        let byte = bytes[i];
        match byte {
            b' ' | b'\t' | b'\r' => i += 1,
            b'<' | b'(' => {
                let close = if byte == b'<' { '>' } else { ')' };
                let end = source[i..].find(close).map_or(source.len(), |n| i + n + 1);
                pieces.push(Piece::Verbatim(source[i..end].to_string()));
                i = end;
            }
            b'0'..=b'9' | b'.' | b',' => {
                match pieces.last_mut() {
                    Some(Piece::Number(text)) => text.push(char::from(byte)),
                    _ => pieces.push(Piece::Number(char::from(byte).to_string())),
                }
                i += 1;
            }
            b'a'..=b'z' | b'A'..=b'Z' | b'@' | b'^' | b'$' => {
                match pieces.last_mut() {
                    Some(Piece::Letters(text)) => text.push(char::from(byte)),
                    _ => pieces.push(Piece::Letters(char::from(byte).to_string())),
                }
                i += 1;
            }
            _ => {
                pieces.push(Piece::Mark(byte));
                i += 1;
            }
        }
    }
    pieces
}

struct Writer<'a> {
    out: &'a mut String,
    spaces: bool,
    case: Case,
    keyword_case: Case,
    control: bool,
    depth: usize,
    /// What was written last can stand left of an operator.
    value_ends: bool,
    /// For each open bracket whether it is ATAN's.
    atan: Vec<bool>,
    after_atan: bool,
}

impl Writer<'_> {
    fn keyword_start(&mut self, letters: &str, control: bool) {
        let case = if control { self.keyword_case } else { self.case };
        self.out.extend(letters.bytes().map(|b| cased(b, case)));
        if letters.len() > 1 {
            self.space();
        }
    }

    fn space(&mut self) {
        if self.spaces && !self.out.ends_with(' ') {
            self.out.push(' ');
        }
    }

    fn piece(&mut self, piece: &Piece) {
        let after_atan = std::mem::take(&mut self.after_atan);
        match piece {
            Piece::Letters(letters) => self.letters(letters),
            Piece::Number(digits) => {
                self.out.push_str(digits);
                self.value_ends = true;
            }
            Piece::Verbatim(text) if text.starts_with('(') => {
                self.space();
                self.out.push_str(text);
            }
            Piece::Verbatim(text) => {
                self.out.push_str(text);
                self.value_ends = true;
            }
            Piece::Mark(mark) => self.mark(*mark, after_atan),
        }
    }

    fn mark(&mut self, mark: u8, after_atan: bool) {
        match mark {
            b'[' => {
                if self.depth == 0 && self.control && self.value_ends {
                    self.space();
                }
                self.out.push('[');
                self.depth += 1;
                let atan = self.out[..self.out.len() - 1].to_ascii_lowercase().ends_with("atan");
                self.atan.push(atan && !self.value_ends);
                self.value_ends = false;
            }
            b']' => {
                self.out.push(']');
                self.depth = self.depth.saturating_sub(1);
                self.after_atan = self.atan.pop().unwrap_or(false);
                self.value_ends = true;
            }
            b'#' => self.out.push('#'),
            b'/' if after_atan => {
                self.out.push('/');
                self.value_ends = false;
            }
            b'*' if self.out.trim_end().ends_with('*') && !self.value_ends => {
                // The second half of `**`.
                while self.out.ends_with(' ') {
                    self.out.pop();
                }
                self.out.push('*');
                self.space();
            }
            _ if self.value_ends => {
                self.space();
                self.out.push(char::from(mark));
                self.space();
                self.value_ends = false;
            }
            _ => self.out.push(char::from(mark)),
        }
    }

    fn letters(&mut self, letters: &str) {
        if !self.value_ends {
            self.out.extend(letters.bytes().map(|b| cased(b, self.case)));
            return;
        }
        if self.control && self.depth == 0 {
            self.space();
            self.out.extend(letters.bytes().map(|b| cased(b, self.keyword_case)));
            // A label or target follows macro words; brackets get their own blank.
            self.space();
            return;
        }
        const OPERATORS: [&str; 10] = ["and", "mod", "or", "xor", "eq", "ne", "ge", "gt", "le", "lt"];
        let lower = letters.to_ascii_lowercase();
        let length = OPERATORS.iter().find(|o| lower.starts_with(**o)).map_or(letters.len(), |o| o.len());
        self.space();
        self.out.extend(letters[..length].bytes().map(|b| cased(b, self.case)));
        self.space();
        self.value_ends = false;
        if length < letters.len() {
            self.letters(&letters[length..]);
        }
    }
}
