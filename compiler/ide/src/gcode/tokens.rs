//! Tokens for colours.

use std::ops::Range;

use gr_gcode::{Form, LineKind};
use gr_text::Span;

use super::doc::{Doc, LineOf};
use crate::{Token, TokenKind};

/// Tokens of some lines, in order.
pub fn tokens(doc: Doc<'_>, lines: Range<u32>) -> Vec<Token> {
    let mut found = Vec::new();
    for line in doc.lines(lines) {
        of_line(&line, &mut found);
    }
    found
}

fn of_line(line: &LineOf<'_>, found: &mut Vec<Token>) {
    let own = &line.chunk.scan.lines[line.at as usize];
    let skipped = if own.deleted { 2 } else { 0 };
    if own.kind == LineKind::Percent {
        found.push(Token { span: line.span(), kind: TokenKind::Keyword, modifiers: 0 });
        return;
    }
    for w in line.words() {
        let span = line.tight(w);
        match w.form {
            Form::Comment => {
                let text = line.slice(span).trim_start_matches(['(', ';', ' ']);
                let active = text.split_once(',').is_some_and(|(h, _)| gr_spec::comments().iter().any(|c| c.name.eq_ignore_ascii_case(h.trim())));
                found.push(Token { span, kind: TokenKind::Comment, modifiers: skipped | if active { 4 } else { 0 } });
            }
            Form::Bad => {}
            Form::Literal => {
                let (kind, whole) = literal(w.letter, w.value);
                if whole || span.end - span.start < 2 {
                    found.push(Token { span, kind, modifiers: skipped });
                } else {
                    found.push(Token { span: Span::new(span.start, span.start + 1), kind, modifiers: skipped });
                    found.push(Token { span: Span::new(span.start + 1, span.end), kind: TokenKind::Number, modifiers: skipped });
                }
            }
            Form::Expr => {
                let (kind, _) = literal(w.letter, 1.0);
                found.push(Token { span: Span::new(span.start, span.start + 1), kind, modifiers: skipped });
                expression(line, Span::new(span.start + 1, span.end), skipped, found);
            }
            Form::Setting | Form::Control => expression(line, span, skipped, found),
        }
    }
}

/// Kind of a word, and whether its number belongs to it.
fn literal(letter: u8, value: f64) -> (TokenKind, bool) {
    match letter {
        b'g' if matches!((value * 10.0).round() as i64, 0..=59 | 330..=389 | 730..=899) => (TokenKind::Motion, true),
        b'g' => (TokenKind::Code, true),
        b'm' => (TokenKind::Machine, true),
        b'n' | b'o' => (TokenKind::Label, true),
        b'f' | b's' => (TokenKind::Feed, false),
        b't' | b'h' | b'd' => (TokenKind::Machine, false),
        _ => (TokenKind::Axis, false),
    }
}

/// Parameters, functions, numbers, keywords and operators of a stretch of text.
fn expression(line: &LineOf<'_>, span: Span, modifiers: u8, found: &mut Vec<Token>) {
    let text = line.slice(span);
    let bytes = text.as_bytes();
    let mut at = 0;
    let mut label = matches!(bytes.first(), Some(b'o' | b'O'));
    while at < bytes.len() {
        let (kind, len) = match bytes[at] {
            b'#' if bytes.get(at + 1) == Some(&b'<') => (TokenKind::Parameter, text[at..].find('>').map_or(bytes.len() - at, |e| e + 1)),
            b'#' => (TokenKind::Parameter, 1 + bytes[at + 1..].iter().take_while(|b| b.is_ascii_digit()).count()),
            b'<' if label => (TokenKind::Label, text[at..].find('>').map_or(bytes.len() - at, |e| e + 1)),
            b'0'..=b'9' | b'.' => {
                let len = bytes[at..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
                (if label { TokenKind::Label } else { TokenKind::Number }, len)
            }
            b'=' | b'+' | b'-' | b'*' | b'/' => (TokenKind::Operator, 1),
            b if b.is_ascii_alphabetic() => {
                let len = bytes[at..].iter().take_while(|b| b.is_ascii_alphabetic()).count();
                let word = &text[at..at + len];
                let is = |list: &[gr_spec::WordingDef]| list.iter().any(|w| w.name.eq_ignore_ascii_case(word));
                let kind = if is(gr_spec::functions()) {
                    TokenKind::Function
                } else if is(gr_spec::operators()) {
                    TokenKind::Operator
                } else {
                    TokenKind::Keyword
                };
                (kind, len)
            }
            b => {
                at += if b < 0x80 { 1 } else { text[at..].chars().next().map_or(1, char::len_utf8) };
                continue;
            }
        };
        if kind == TokenKind::Label {
            label = false;
        }
        let start = span.start + at as u32;
        let set = kind == TokenKind::Parameter && at == 0 && text[at + len..].trim_start().starts_with('=');
        found.push(Token { span: Span::new(start, start + len as u32), kind, modifiers: modifiers | u8::from(set) });
        at += len.max(1);
    }
}
