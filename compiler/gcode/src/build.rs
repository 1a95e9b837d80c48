//! The growing tables, and the way from a parsed line into them.

use std::collections::HashMap;

use gr_spec::{Family, code, rs274};
use gr_text::Span;

use crate::alien::{self, Alien};
use crate::fast::{ABSOLUTE_LIMIT, Rules, once_bit};
use crate::grammar::{self, Block, Expr, Flaw, Item, Kind, Name, Problem};
use crate::lex::{self, CommentFault, Token};
use crate::model::*;

/// Deepest nesting of brackets, signs and `#`, operators in a row counted too: the grammar and whatever walks over an
/// expression recurse that far. No line that LinuxCNC reads is long enough for more.
pub(crate) const MAX_DEPTH: usize = 256;

/// [`Scan`] under construction.
#[derive(Default)]
pub(crate) struct Tables {
    pub lines: Vec<Line>,
    pub words: Vec<Word>,
    nodes: Vec<Node>,
    node_spans: Vec<Span>,
    settings: Vec<Setting>,
    controls: Vec<Control>,
    args: Vec<ExprId>,
    names: Vec<Box<str>>,
    name_ids: HashMap<Box<str>, u32>,
    faults: Vec<Fault>,
    line: lex::Line,
    /// Words seen in the current block.
    seen: u32,
}

impl Tables {
    /// Estimates by the density of CAM output, so that most texts need no second allocation.
    pub fn with_room_for(bytes: usize) -> Tables {
        Tables {
            lines: Vec::with_capacity(bytes / 24 + 1),
            words: Vec::with_capacity(bytes / 6 + 4),
            ..Tables::default()
        }
    }

    pub fn finish(self) -> Scan {
        Scan {
            lines: self.lines.into(),
            words: self.words.into(),
            nodes: self.nodes.into(),
            node_spans: self.node_spans.into(),
            settings: self.settings.into(),
            controls: self.controls.into(),
            args: self.args.into(),
            names: self.names.into(),
            faults: self.faults.into(),
        }
    }

    /// Reads the line at `at` by the grammar; gives the first byte of the next line.
    #[cold]
    pub fn structured_line(&mut self, text: &str, at: usize, rules: &Rules) -> usize {
        let bytes = text.as_bytes();
        let end = memchr::memchr2(b'\n', b'\r', &bytes[at..]).map_or(bytes.len(), |n| at + n);
        let next = match bytes.get(end) {
            None => end,
            Some(b'\r') if bytes.get(end + 1) == Some(&b'\n') => end + 2,
            Some(_) => end + 1,
        };
        let first_word = self.words.len();
        let first_fault = self.faults.len();
        self.lines.push(Line {
            start: at as u32,
            first_word: first_word as u32,
            kind: LineKind::Blank,
            deleted: false,
            faulty: false,
        });
        if next - at > rules.longest {
            let most = if rules.limit == 0 { ABSOLUTE_LIMIT } else { rules.longest };
            let args = [(next - at).to_string(), most.to_string()];
            self.fault(Span::new(at as u32, end as u32), code::TEXT_LINE_TOO_LONG, rs274::COMMAND_TOO_LONG, &args);
        }
        if next - at > ABSOLUTE_LIMIT {
            self.word(Span::new(at as u32, end as u32), b'?', Form::Bad, 0.0);
        } else {
            self.read_line(text, at, end, rules);
        }
        let kind = kind_of(&self.words[first_word..]);
        if let Some(line) = self.lines.last_mut() {
            line.kind = kind;
            line.faulty = self.faults.len() > first_fault;
        }
        next
    }

    fn read_line(&mut self, text: &str, start: usize, end: usize, rules: &Rules) {
        let nul = memchr::memchr(0, &text.as_bytes()[start..end]).map(|n| start + n);
        let stop = nul.unwrap_or(end);
        let mut line = std::mem::take(&mut self.line);
        match line.read(text, start, stop, rules) {
            Some(CommentFault::Nested(at)) => self.fault(at, code::COMMENT_NESTED, rs274::NESTED_COMMENT, &[]),
            Some(CommentFault::Unclosed(at)) => self.fault(at, code::COMMENT_UNCLOSED, rs274::UNCLOSED_COMMENT, &[]),
            None => {}
        }
        self.read_tokens(&line, text, rules);
        self.line = line;
        if let Some(nul) = nul {
            let rest = Span::new(nul as u32, end as u32);
            self.word(rest, b';', Form::Comment, 0.0);
            self.fault(Span::new(rest.start, rest.start + 1), code::TEXT_NUL_BYTE, rs274::SILENT, &[]);
        }
    }

    fn read_tokens(&mut self, line: &lex::Line, text: &str, rules: &Rules) {
        if line.closed == "%" {
            self.word(line.span(0, 1), b'%', Form::Comment, 0.0);
            return;
        }
        let whole = line.span(0, line.tokens.len());
        if depth(&line.tokens) > MAX_DEPTH {
            self.word(whole, b'?', Form::Bad, 0.0);
            self.fault(whole, code::EXPRESSION_TOO_DEEP, rs274::SILENT, &[MAX_DEPTH.to_string()]);
            return;
        }
        if rules.family == Family::Grbl && line.closed.starts_with('$') {
            self.word(whole, b'?', Form::Bad, 0.0);
            self.not_in_dialect(whole, rules, &alien::DOLLAR);
            return;
        }
        let (block, flaws) = grammar::parse(&line.tokens, &line.gaps(), rules.family);
        if let Some(last) = self.lines.last_mut() {
            last.deleted = block.deleted;
        }
        let own = self.faults.len();
        self.block(line, text, &block, rules);
        let silenced: Vec<Span> = self.faults[own..].iter().map(|f| f.span).collect();
        for flaw in &flaws {
            let span = line.span(flaw.at.start, flaw.at.end);
            // Within a word that may not stand here at all, its value does not matter.
            if silenced.iter().any(|s| s.start < span.start && span.end <= s.end) {
                continue;
            }
            match alien::flaw(flaw.what, rules.family) {
                Some(what) => self.not_in_dialect(span, rules, &what),
                None => self.flaw(line, text, &Flaw { what: alien::plainly(flaw.what, rules.family), ..flaw.clone() }, span),
            }
        }
        self.faults[own..].sort_by_key(|f| (f.span.start, f.code == code::WORD_REPEATED));
        if matches!(block.items.iter().find(|i| !is_line_number(i)), Some(Item::Control { .. } | Item::Bad { letter: b'o', .. })) {
            // What follows a damaged statement is not worth a fault of its own.
            self.faults.truncate(own + 1);
        }
    }

    fn fault(&mut self, span: Span, code: gr_spec::Code, rs: gr_spec::Rs274, args: &[String]) {
        let line = self.lines.len() as u32 - 1;
        self.faults.push(Fault { line, span, code, rs, args: args.into() });
    }

    fn word(&mut self, span: Span, letter: u8, form: Form, value: f64) {
        let len = (span.end - span.start).min(0xffff) as u16;
        self.words.push(Word { value, start: span.start, len, letter, form });
    }

    fn block(&mut self, line: &lex::Line, text: &str, block: &Block, rules: &Rules) {
        self.seen = 0;
        for item in &block.items {
            self.item(line, text, item, rules);
        }
    }

    fn item(&mut self, line: &lex::Line, text: &str, item: &Item, rules: &Rules) {
        let span = |at: &grammar::Range| line.span(at.start, at.end);
        if let Some((what, at)) = alien::item(item, rules.family) {
            let letter = if matches!(item, Item::Setting { .. }) { b'#' } else { b'o' };
            let whole = match item {
                Item::Setting { at, .. } | Item::Control { at, .. } => at,
                _ => &at,
            };
            self.word(span(whole), letter, Form::Bad, 0.0);
            return self.not_in_dialect(span(&at), rules, &what);
        }
        match item {
            Item::Comment { at } => {
                let first = text.as_bytes()[span(at).start as usize];
                if line.tokens[at.start] == Token::Semicolon && rules.family == Family::Fanuc {
                    self.seen = 0;
                }
                self.word(span(at), first, Form::Comment, 0.0);
            }
            Item::BadComment { at } => self.word(span(at), b'(', Form::Bad, 0.0),
            Item::Bad { letter, at } => self.word(span(at), *letter, Form::Bad, 0.0),
            Item::Word { letter, value, at } => self.letter_word(line, *letter, value, span(at), rules),
            Item::Setting { target, value, at } => {
                let target = match target {
                    Name::Number(number) => Target::Number(self.expr(line, number)),
                    Name::Named(token) => Target::Named(self.name(line, *token)),
                };
                let value = self.expr(line, value);
                let index = Word::pack(self.settings.len());
                self.settings.push(Setting { target, value, span: span(at) });
                self.word(span(at), b'#', Form::Setting, index);
            }
            Item::Control { keyword, label, label_at, args, comments, at } => {
                let label = match label {
                    Some(Name::Number(number)) => OLabel::Number(self.expr(line, number)),
                    Some(Name::Named(token)) => OLabel::Named(self.name(line, *token)),
                    None => OLabel::None,
                };
                let args: Vec<ExprId> = args.iter().map(|arg| self.expr(line, arg)).collect();
                let first_arg = self.args.len() as u32;
                let arg_count = args.len() as u32;
                self.args.extend(args);
                let (span, label_span) = (span(at), span(label_at));
                let index = Word::pack(self.controls.len());
                self.controls.push(Control { keyword: *keyword, label, first_arg, arg_count, span, label_span });
                self.word(span, b'o', Form::Control, index);
                for comment in comments {
                    self.word(line.span(comment.start, comment.end), b'(', Form::Comment, 0.0);
                }
            }
        }
    }

    fn letter_word(&mut self, line: &lex::Line, letter: u8, value: &Expr, span: Span, rules: &Rules) {
        let bit = once_bit(letter, rules.family);
        if letter != b'n' && self.seen & bit != 0 {
            let (rs, ours) = repeated_names(letter);
            self.word(span, letter, Form::Bad, 0.0);
            self.fault(span, code::WORD_REPEATED, rs274::MULTIPLE_WORDS, &[rs, ours]);
            return;
        }
        // A P or Q at or below -1 looks to the controller as if there were none yet; what an expression
        // gives, only the interpreter knows.
        let counts = !matches!(letter, b'p' | b'q') || matches!(value.kind, Kind::Number(v) if v > -1.0);
        if letter != b'n' && counts && value.kind != Kind::Bad {
            self.seen |= bit;
        }
        match value.kind {
            Kind::Number(number) if line.tokens[value.at.start] != Token::Mark(b'[') => {
                self.word(span, letter, Form::Literal, number);
            }
            Kind::Bad => self.word(span, letter, Form::Bad, 0.0),
            _ => {
                if let Some((what, at)) = alien::value(value, rules.family) {
                    self.word(span, letter, Form::Bad, 0.0);
                    let at = if alien::plain_only(rules.family) { span } else { line.span(at.start, at.end) };
                    return self.not_in_dialect(at, rules, &what);
                }
                let id = self.expr(line, value);
                self.word(span, letter, Form::Expr, Word::pack(id.0 as usize));
            }
        }
    }

    fn not_in_dialect(&mut self, span: Span, rules: &Rules, what: &Alien) {
        let args = [what.what, rules.dialect, what.instead].map(str::to_string);
        self.fault(span, code::SYNTAX_NOT_IN_DIALECT, rs274::SILENT, &args);
    }

    fn name(&mut self, line: &lex::Line, token: usize) -> u32 {
        // The name of a label that is not closed goes on to the end of the line.
        let open = line.tokens.get(token) == Some(&Token::OpenName);
        let to = if open { line.tokens.len() } else { token + 1 };
        let name = line.text(token, to).trim_start_matches('<').trim_end_matches('>');
        if let Some(id) = self.name_ids.get(name) {
            return *id;
        }
        let id = self.names.len() as u32;
        self.names.push(name.into());
        self.name_ids.insert(name.into(), id);
        id
    }

    fn expr(&mut self, line: &lex::Line, expr: &Expr) -> ExprId {
        let node = match &expr.kind {
            Kind::Number(value) => Node::Number(*value),
            Kind::Param(number) => Node::Param(self.expr(line, number)),
            Kind::Named(token) => Node::Named(self.name(line, *token)),
            Kind::Unary(function, value) => Node::Unary(*function, self.expr(line, value)),
            Kind::Atan(y, x) => {
                let y = self.expr(line, y);
                Node::Atan(y, self.expr(line, x))
            }
            Kind::ExistsNamed(token) => Node::ExistsNamed(self.name(line, *token)),
            Kind::ExistsParam(number) => Node::ExistsParam(self.expr(line, number)),
            Kind::Binary(operator, left, right) => {
                let left = self.expr(line, left);
                Node::Binary(*operator, left, self.expr(line, right))
            }
            Kind::Bad => Node::Bad,
        };
        self.nodes.push(node);
        self.node_spans.push(line.span(expr.at.start, expr.at.end));
        ExprId(self.nodes.len() as u32 - 1)
    }

    fn flaw(&mut self, line: &lex::Line, text: &str, flaw: &Flaw, span: Span) {
        let (from, to) = (flaw.at.start, flaw.at.end);
        let seen = line.text(from, to).to_string();
        // For people: what stands there as they wrote it, or what comes next.
        let shown = match &text[span.range()] {
            "" => match line.text(from, from + 1) {
                "" => "the end of the line".to_string(),
                next => next.to_string(),
            },
            there => there.to_string(),
        };
        let letter = |l: u8| char::from(l).to_string();
        let (code, rs, args): (_, _, Vec<String>) = match flaw.what {
            Problem::Unexpected | Problem::BadCharacter => {
                let first = seen.bytes().next().unwrap_or(b'?');
                let there = shown.chars().next().map(String::from).unwrap_or_default();
                if (b' '..=b'z').contains(&first) {
                    (code::SYNTAX_BAD_CHARACTER, rs274::BAD_CHARACTER, vec![letter(first), there])
                } else {
                    (code::SYNTAX_BAD_CHARACTER, rs274::BAD_CHARACTER_CODE, vec![format!("{first:03o}"), there])
                }
            }
            Problem::NoValue => (code::WORD_NO_VALUE, rs274::NO_CHARACTERS, vec![]),
            Problem::NotANumber { trailing: true } => {
                (code::NUMBER_MALFORMED, rs274::NUMBER_TRAILING_CHARACTERS, vec![seen, shown])
            }
            Problem::NotANumber { trailing: false } => {
                (code::NUMBER_MALFORMED, rs274::NUMBER_CONVERSION_FAILED, vec![seen, shown])
            }
            Problem::UnclosedExpression => (code::EXPRESSION_UNCLOSED, rs274::UNCLOSED_EXPRESSION, vec![]),
            Problem::UnknownOperation => {
                (code::EXPRESSION_UNKNOWN_OPERATOR, rs274::UNKNOWN_OPERATION, vec![seen, shown])
            }
            Problem::UnknownOperationName(l) => {
                (code::EXPRESSION_UNKNOWN_OPERATOR, rs274::UNKNOWN_OPERATION_NAME, vec![letter(l), shown])
            }
            Problem::UnknownWord(l) => {
                (code::EXPRESSION_UNKNOWN_FUNCTION, rs274::UNKNOWN_WORD, vec![letter(l), shown])
            }
            Problem::UnknownUnary => (code::EXPRESSION_UNKNOWN_FUNCTION, rs274::UNKNOWN_UNARY, vec![seen, shown]),
            Problem::NoBracketAfterFunction(name) => (
                code::EXPRESSION_FUNCTION_WITHOUT_BRACKET,
                rs274::LEFT_BRACKET_AFTER_UNARY,
                vec![name.to_ascii_uppercase()],
            ),
            Problem::AtanSlash => (code::EXPRESSION_ATAN_ARGUMENTS, rs274::SLASH_MISSING_ATAN, vec![]),
            Problem::AtanBracket => (code::EXPRESSION_ATAN_ARGUMENTS, rs274::LEFT_BRACKET_ATAN, vec![]),
            Problem::OpenName => (code::PARAMETER_NAME_UNTERMINATED, rs274::NAME_NOT_TERMINATED, vec![]),
            Problem::NoEqualSign => (code::PARAMETER_NO_EQUAL_SIGN, rs274::EQUAL_SIGN_MISSING, vec![]),
            Problem::ExistsParameter => (code::EXPRESSION_EXISTS_ARGUMENT, rs274::EXISTS_NUMBER_SIGN, vec![]),
            Problem::ExistsBracket => (code::EXPRESSION_EXISTS_ARGUMENT, rs274::EXISTS_BRACKET, vec![]),
            Problem::UnknownKeyword => (code::OWORD_UNKNOWN_KEYWORD, rs274::UNKNOWN_O_COMMAND, vec![seen, shown]),
            Problem::AfterOWord => (code::OWORD_TRAILING_TEXT, rs274::AFTER_O_WORD, vec![]),
            Problem::NoCondition(name) => {
                (code::OWORD_NO_CONDITION, rs274::LEFT_BRACKET_AFTER_KEYWORD, vec![name.to_string()])
            }
            Problem::TooManyArguments => {
                (code::OWORD_TOO_MANY_ARGUMENTS, rs274::TOO_MANY_SUB_PARAMETERS, vec![])
            }
            Problem::BadLineNumber => (code::BLOCK_BAD_LINE_NUMBER, rs274::BAD_FORMAT_UNSIGNED_INTEGER, vec![]),
            Problem::Macro(name, form) => {
                (code::MACRO_MALFORMED, rs274::SILENT, vec![name.to_string(), form.to_string()])
            }
        };
        self.fault(span, code, rs, &args);
    }
}

fn is_line_number(item: &Item) -> bool {
    matches!(item, Item::Word { letter: b'n', .. } | Item::Bad { letter: b'n', .. })
}

/// How the controller's message and ours name a repeated word.
fn repeated_names(letter: u8) -> (String, String) {
    let upper = char::from(letter.to_ascii_uppercase()).to_string();
    let theirs = match letter {
        b'$' => "spindle choice ($)".to_string(),
        b'u' | b'v' | b'w' => upper.clone(),
        _ => char::from(letter).to_string(),
    };
    (theirs, upper)
}

fn kind_of(words: &[Word]) -> LineKind {
    let mut kind = LineKind::Blank;
    for word in words {
        match word.form {
            Form::Comment if word.letter == b'%' => return LineKind::Percent,
            Form::Comment => {}
            Form::Literal => kind = LineKind::Plain,
            _ => return LineKind::Structured,
        }
    }
    kind
}

/// One bracket level, or what stands outside of brackets.
#[derive(Clone, Copy, Default)]
struct Nest {
    /// Signs and `#` in front of the next value.
    prefixes: usize,
    /// Values so far: one operator less stands between them.
    values: usize,
    deepest: usize,
}

impl Nest {
    fn value(&mut self, depth: usize) {
        self.deepest = self.deepest.max(self.prefixes + depth);
        self.values += 1;
        self.prefixes = 0;
    }
    fn depth(&self) -> usize {
        self.deepest.max(self.prefixes) + self.values.saturating_sub(1)
    }
}

/// An upper bound for how deep the tree of a line's expressions is.
fn depth(tokens: &[Token]) -> usize {
    let mut deepest = 0;
    let mut open: Vec<Nest> = Vec::new();
    let mut here = Nest::default();
    let is_letter = |i: usize| matches!(tokens.get(i), Some(Token::Letter(_)));
    for (i, token) in tokens.iter().enumerate() {
        match token {
            Token::Mark(b'[') => open.push(std::mem::take(&mut here)),
            Token::Mark(b']') => {
                let inner = here.depth() + 1;
                here = open.pop().unwrap_or_default();
                here.value(inner);
            }
            Token::Mark(b'#' | b'-' | b'+') => here.prefixes += 1,
            // A word begins, or the right side of an assignment. Operators with names have more letters than one.
            Token::Letter(_) if open.is_empty() && !is_letter(i + 1) && (i == 0 || !is_letter(i - 1)) => {
                deepest = deepest.max(here.depth());
                here = Nest::default();
            }
            Token::Mark(b'=') if open.is_empty() => {
                deepest = deepest.max(here.depth());
                here = Nest::default();
            }
            Token::Letter(_) | Token::Mark(_) => {}
            _ => here.value(0),
        }
    }
    while let Some(outer) = open.pop() {
        let inner = here.depth() + 1;
        here = outer;
        here.value(inner);
    }
    deepest.max(here.depth())
}
