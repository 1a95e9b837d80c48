//! A line with structure, made ready for the grammar: blanks out, lower case, cut into tokens by logos.
//!
//! Blanks mean nothing outside comments (`G 0 1 X 1 . 5` is `G01X1.5`), and words are single letters that run
//! together with function names (`XSIN[30]`), so letters stay single tokens and the grammar joins them.

use gr_spec::Family;
use gr_text::Span;
use logos::Logos;

use crate::fast::{Rules, trimmed};
use crate::number::decimal;

/// What the grammar works on.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Token {
    /// Lower case; `@ ^ $` too.
    Letter(u8),
    /// Digits with at most one point; `whole` when it can follow an N.
    Number { value: f64, whole: bool },
    /// Digits and points that are no number.
    Malformed { trailing: bool },
    /// `+ - * / [ ] # =`
    Mark(u8),
    /// `<…>`
    Name,
    /// `<` without its `>`.
    OpenName,
    /// `(…)`
    Paren,
    /// `;…`, or the `;` of a block end.
    Semicolon,
    /// A comment with a fault, already reported.
    BadComment,
    /// Nothing of the language.
    Other,
}

#[derive(Logos, Clone, Copy, PartialEq, Debug)]
enum Lexeme {
    #[regex(r"[a-z@\^$]")]
    Letter,
    #[regex(r"[0-9.]+")]
    Digits,
    #[regex(r"[+\-*/\[\]#=]")]
    Mark,
    #[regex(r"<[^>]*>")]
    Name,
    #[token("<")]
    OpenName,
    #[regex(r"\([^()]*\)")]
    Paren,
    #[regex(r";[^\n]*", allow_greedy = true)]
    Semicolon,
    /// Stands for a damaged comment.
    #[token("\u{1}")]
    BadComment,
    /// Stands for a `;` that ends a block and hides nothing.
    #[token("\u{2}")]
    BlockEnd,
}

/// A line in tokens.
#[derive(Default)]
pub(crate) struct Line {
    /// Lower case and without blanks, comments as they are.
    pub closed: String,
    /// For each byte of `closed` its place in the text.
    map: Vec<u32>,
    /// Tokens.
    pub tokens: Vec<Token>,
    /// Bytes of `closed` of each token.
    ends: Vec<(u32, u32)>,
    /// The damaged comment, whole.
    bad_comment: Span,
    /// Where the line's last token ends.
    pub end: u32,
}

/// What closing a line may find.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum CommentFault {
    /// `(` in a comment.
    Nested(Span),
    /// No `)`.
    Unclosed(Span),
}

impl Line {
    /// Reads the line `text[start..end]`.
    pub fn read(&mut self, text: &str, start: usize, end: usize, rules: &Rules) -> Option<CommentFault> {
        let end = start + trimmed(&text.as_bytes()[start..end]);
        self.closed.clear();
        self.map.clear();
        self.tokens.clear();
        self.ends.clear();
        self.end = end as u32;
        self.bad_comment = Span::default();
        let fault = self.close(text, start, end, rules);
        self.cut(text.as_bytes());
        fault
    }

    /// Span in the text of the tokens `from..to`; of nothing, the place where token `from` would be.
    pub fn span(&self, from: usize, to: usize) -> Span {
        if from >= to {
            let at = self.ends.get(from).map_or(self.end, |(first, _)| self.map[*first as usize]);
            return Span::new(at, at);
        }
        if from + 1 == to && self.tokens[from] == Token::BadComment {
            return self.bad_comment;
        }
        let first = self.map[self.ends[from].0 as usize];
        let last = self.ends[to.min(self.ends.len()) - 1].1 as usize;
        let end = if self.tokens[to - 1] == Token::BadComment { self.bad_comment.end } else { self.map[last - 1] + 1 };
        Span::new(first, end)
    }

    /// For each token whether a blank stands before it.
    pub fn gaps(&self) -> Vec<bool> {
        let first = |n: u32| self.map[n as usize];
        self.ends.iter().map(|(start, _)| *start > 0 && first(*start) != first(start - 1) + 1).collect()
    }

    /// Text of the tokens `from..to` as the controller sees it.
    pub fn text(&self, from: usize, to: usize) -> &str {
        if from >= to || from >= self.ends.len() {
            return "";
        }
        &self.closed[self.ends[from].0 as usize..self.ends[to.min(self.ends.len()) - 1].1 as usize]
    }

    fn close(&mut self, text: &str, start: usize, end: usize, rules: &Rules) -> Option<CommentFault> {
        let bytes = text.as_bytes();
        let mut i = start;
        while i < end {
            match bytes[i] {
                b' ' | b'\t' | b'\r' => i += 1,
                b';' if rules.family != Family::Fanuc => {
                    self.copy(text, i, end);
                    i = end;
                }
                b';' => {
                    self.closed.push('\u{2}');
                    self.map.push(i as u32);
                    i += 1;
                }
                b'(' => match bytes[i + 1..end].iter().position(|b| matches!(b, b'(' | b')')).map(|n| i + 1 + n) {
                    Some(close) if bytes[close] == b')' => {
                        self.copy(text, i, close + 1);
                        i = close + 1;
                    }
                    found => {
                        let last = bytes[i..end].iter().rposition(|b| *b == b')').map_or(end, |n| i + n + 1);
                        self.bad_comment = Span::new(i as u32, last as u32);
                        self.closed.push('\u{1}');
                        self.map.push(i as u32);
                        // One fault is enough: what follows can't be told from comment.
                        let more = found.is_none() || bytes[last..end].contains(&b'(');
                        let rest = if more { end } else { last };
                        self.bad_comment.end = rest as u32;
                        let damaged = self.bad_comment;
                        // No further `(` is left, so this goes one level deep.
                        let _ = self.close(text, rest, end, rules);
                        self.bad_comment = damaged;
                        let whole = Span::new(i as u32, rest as u32);
                        return Some(match found {
                            Some(inner) => CommentFault::Nested(Span::new(inner as u32, inner as u32 + 1)),
                            None => CommentFault::Unclosed(whole),
                        });
                    }
                },
                b',' if rules.comma => {
                    self.closed.push('.');
                    self.map.push(i as u32);
                    i += 1;
                }
                byte if byte.is_ascii() => {
                    self.closed.push(char::from(byte.to_ascii_lowercase()));
                    self.map.push(i as u32);
                    i += 1;
                }
                _ => {
                    let length = text[i..end].chars().next().map_or(1, char::len_utf8);
                    self.copy(text, i, i + length);
                    i += length;
                }
            }
        }
        None
    }

    fn copy(&mut self, text: &str, from: usize, to: usize) {
        self.closed.push_str(&text[from..to]);
        self.map.extend(from as u32..to as u32);
    }

    fn cut(&mut self, source: &[u8]) {
        let closed = std::mem::take(&mut self.closed);
        for (lexeme, range) in Lexeme::lexer(&closed).spanned() {
            let text = &closed.as_bytes()[range.clone()];
            let at = self.map[range.start];
            let token = match lexeme {
                Ok(Lexeme::Letter) => Token::Letter(text[0]),
                Ok(Lexeme::Digits) => digits(text),
                Ok(Lexeme::Mark) => Token::Mark(text[0]),
                Ok(Lexeme::Name) => Token::Name,
                Ok(Lexeme::OpenName) => Token::OpenName,
                Ok(Lexeme::Paren) => Token::Paren,
                Ok(Lexeme::Semicolon) => Token::Semicolon,
                Ok(Lexeme::BadComment) if self.bad_comment.end > 0 && at == self.bad_comment.start => Token::BadComment,
                Ok(Lexeme::BlockEnd) if source[at as usize] == b';' => Token::Semicolon,
                Ok(Lexeme::BadComment | Lexeme::BlockEnd) | Err(()) => Token::Other,
            };
            self.tokens.push(token);
            self.ends.push((range.start as u32, range.end as u32));
        }
        self.closed = closed;
    }
}

fn digits(text: &[u8]) -> Token {
    match decimal(text, 0, false) {
        Some((value, end)) if end == text.len() => {
            let whole = text[0] != b'.' && text[end - 1] != b'.';
            Token::Number { value, whole }
        }
        Some(_) => Token::Malformed { trailing: true },
        None => Token::Malformed { trailing: false },
    }
}
