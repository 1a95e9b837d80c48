//! Comments that do something: MSG, DEBUG, PRINT, LOG and their like, ABORT.

use gr_canon::{Call, Sink};
use gr_gcode::{Scan, Word};
use gr_spec::{code, rs274};

use crate::{Fault, Interp, Res};

/// Place of a comment's text (without its parentheses) in the text of the chunk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Comment {
    start: u32,
    end: u32,
}

impl Comment {
    pub fn of(scan: &Scan, text: &str, line: u32, word: &Word) -> Comment {
        let span = scan.word_span(text, line, word);
        let end = if text.as_bytes().get(span.end as usize - 1) == Some(&b')') { span.end - 1 } else { span.end };
        Comment { start: span.start + 1, end: end.max(span.start + 1) }
    }
}

/// Longest number that fits into an expanded comment.
const VALUE_LENGTH: usize = 30;

fn after<'a>(text: &'a str, word: &str) -> Option<&'a str> {
    let head = text.get(..word.len())?;
    head.eq_ignore_ascii_case(word).then(|| &text[word.len()..])
}

impl<S: Sink> Interp<'_, S> {
    /// The comment of the block takes effect.
    pub(crate) fn convert_comment(&mut self) -> Res {
        let Some(c) = self.comment else { return Ok(()) };
        let whole = self.reading.text.clone();
        let Some(text) = whole.get(c.start as usize..c.end as usize) else { return Ok(()) };
        let text = text.trim_start_matches([' ', '\t', '\x0b', '\x0c']);
        if text.is_empty() && c.start == c.end {
            return Ok(());
        }
        if let Some(rest) = after(text, "msg,") {
            self.emit(Call::Message(rest.into()));
        } else if let Some(rest) = after(text, "debug,") {
            let text = self.expand(rest);
            if self.params.get(5599) > 0.0 {
                self.emit(Call::Message(text.into()));
            }
        } else if let Some(rest) = after(text, "print,") {
            let text = self.expand(rest);
            self.sink.print(&text);
        } else if let Some(rest) = after(text, "log,") {
            let text = self.expand(rest);
            self.emit(Call::Log(text.into()));
        } else if let Some(rest) = after(text, "logopen,") {
            self.emit(Call::LogOpen(rest.into()));
        } else if let Some(rest) = after(text, "logappend,") {
            self.emit(Call::LogAppend(rest.into()));
        } else if let Some(rest) = after(text, "abort,") {
            let text = self.expand(rest);
            return Err(Fault::new(code::PROGRAM_ABORT, rs274::RT_ABORT).arg(text).at(b'('));
        } else if text.eq_ignore_ascii_case("logclose") {
            self.emit(Call::LogClose);
        } else {
            if ["py,", "pyrun,", "pyreload"].iter().any(|word| after(text, word).is_some()) {
                self.warn(Fault::own(code::COMMENT_PYTHON).at(b'('));
            }
            self.emit_queued(Call::Comment(text.into()));
        }
        Ok(())
    }

    /// Puts parameter values into a text. A damaged parameter ends it, as on the controller.
    fn expand(&mut self, text: &str) -> String {
        let mut out = String::with_capacity(text.len() + 16);
        let mut digits = 6;
        let mut rest = text;
        while let Some(c) = rest.chars().next() {
            match c {
                '%' => rest = format_letter(&rest[1..], &mut digits, &mut out),
                '#' => match self.expand_parameter(&rest[1..], digits, &mut out) {
                    Some(next) => rest = next,
                    None => break,
                },
                c => {
                    out.push(c);
                    rest = &rest[c.len_utf8()..];
                }
            }
        }
        out
    }

    fn expand_parameter<'t>(&mut self, text: &'t str, digits: usize, out: &mut String) -> Option<&'t str> {
        let first = *text.as_bytes().first()?;
        let (value, rest) = if first.is_ascii_digit() {
            let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
            let number = text[..end].parse::<i64>().unwrap_or(-1);
            let known = (0..i64::from(crate::params::MAX)).contains(&number);
            (known.then(|| self.shown_parameter(number as i32)), &text[end..])
        } else if first == b'<' {
            let end = text.find('>')?;
            if text[..end].contains(')') {
                return None;
            }
            let name: String = text[1..end].chars().filter(|c| !c.is_ascii_whitespace()).collect();
            (self.find_named(&name.to_lowercase()), &text[end + 1..])
        } else {
            out.push('#');
            return Some(text);
        };
        let shown = value.map(|v| if v.abs() < 0.0001 { 0.0 } else { v }).map(|v| format!("{v:.digits$}"));
        out.push_str(&shown.filter(|s| s.len() < VALUE_LENGTH).unwrap_or_else(|| "######".into()));
        Some(rest)
    }

    fn shown_parameter(&mut self, index: i32) -> f64 {
        if (5420..=5428).contains(&index) {
            return self.m.current[(index - 5420) as usize];
        }
        if (5021..=5029).contains(&index) && self.setup.version == gr_canon::Version::V2_10 {
            return self.machine_position()[(index - 5021) as usize];
        }
        if let Some(log) = &mut self.log {
            log.read(index as u32);
        }
        self.params.get(index as u32)
    }
}

/// `%d`, `%f`, `%.3f`; anything else stands for itself.
fn format_letter<'t>(text: &'t str, digits: &mut usize, out: &mut String) -> &'t str {
    let b = text.as_bytes();
    match b.first() {
        Some(b'd') => {
            *digits = 0;
            &text[1..]
        }
        Some(b'f') => {
            *digits = 4;
            &text[1..]
        }
        Some(b'.') => match (b.get(1), b.get(2)) {
            (Some(d), Some(b'f')) if d.is_ascii_digit() => {
                *digits = usize::from(d - b'0');
                &text[3..]
            }
            _ => {
                out.push('.');
                &text[1..]
            }
        },
        _ => {
            out.push('%');
            text
        }
    }
}
