//! The grammar of a line with structure, in chumsky.
//!
//! It decides on the next token alone and never goes back past a value, so that the fault it reports is the
//! first one a reader from left to right meets. A fault ends the value it is in; the words after it are read.

use chumsky::error::{Error, LabelError};
use chumsky::input::InputRef;
use chumsky::prelude::*;
use chumsky::util::MaybeRef;
use gr_spec::Family;

use crate::fast::is_word_letter;
use crate::lex::Token;
use crate::model::{Binary, Keyword, Unary};

type Tokens<'t> = &'t [Token];
type Extra = extra::Err<Flaw>;
/// Range of token indices.
pub(crate) type Range = SimpleSpan<usize>;
type Ref<'t, 'p> = InputRef<'t, 'p, Tokens<'t>, Extra>;
type Boxed<'t, O> = chumsky::Boxed<'t, 't, Tokens<'t>, O, Extra>;

/// What is wrong, and where.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Flaw {
    pub at: Range,
    pub what: Problem,
}

/// Kinds of faults the grammar finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Problem {
    /// Something else was expected; every such place has a better name, so this one is a last resort.
    Unexpected,
    BadCharacter,
    NoValue,
    /// The whole run is the number as the controller would try to read it.
    NotANumber { trailing: bool },
    UnclosedExpression,
    UnknownOperation,
    UnknownOperationName(u8),
    UnknownWord(u8),
    UnknownUnary,
    NoBracketAfterFunction(&'static str),
    AtanSlash,
    AtanBracket,
    OpenName,
    NoEqualSign,
    ExistsParameter,
    ExistsBracket,
    UnknownKeyword,
    AfterOWord,
    NoCondition(&'static str),
    TooManyArguments,
    BadLineNumber,
    Macro(&'static str, &'static str),
}

impl<'t> Error<'t, Tokens<'t>> for Flaw {
    fn merge(self, other: Self) -> Self {
        if self.what == Problem::Unexpected { other } else { self }
    }
}

impl<'t, L> LabelError<'t, Tokens<'t>, L> for Flaw {
    fn expected_found<E: IntoIterator<Item = L>>(_: E, _: Option<MaybeRef<'t, Token>>, at: Range) -> Self {
        Flaw { at, what: Problem::Unexpected }
    }
}

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Expr {
    pub kind: Kind,
    pub at: Range,
}

/// Kinds of values; names are token indices.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Number(f64),
    Param(Box<Expr>),
    Named(usize),
    Unary(Unary, Box<Expr>),
    Atan(Box<Expr>, Box<Expr>),
    ExistsNamed(usize),
    ExistsParam(Box<Expr>),
    Binary(Binary, Box<Expr>, Box<Expr>),
    Bad,
}

/// What a parameter or a label is called.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Name {
    Number(Expr),
    Named(usize),
}

/// A part of a line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Item {
    Word { letter: u8, value: Expr, at: Range },
    Setting { target: Name, value: Expr, at: Range },
    Comment { at: Range },
    BadComment { at: Range },
    Bad { letter: u8, at: Range },
    Control { keyword: Keyword, label: Option<Name>, label_at: Range, args: Vec<Expr>, comments: Vec<Range>, at: Range },
}

/// A whole line.
#[derive(Clone, Debug, PartialEq, Default)]
pub(crate) struct Block {
    pub deleted: bool,
    pub items: Vec<Item>,
}

/// What the grammar knows besides the tokens.
#[derive(Clone, Copy)]
struct Ctx<'t> {
    family: Family,
    /// For each token whether a blank stands before it: means nothing, but tells where a damaged word may end.
    gaps: &'t [bool],
}

impl<'t> Ctx<'t> {
    fn gap_before(self, inp: &mut Ref<'t, '_>) -> bool {
        let here = inp.cursor();
        let index = inp.span_since(&here).start;
        self.gaps.get(index).copied().unwrap_or(false)
    }
}

/// Reads a line's tokens. There is always a result.
pub(crate) fn parse(tokens: &[Token], gaps: &[bool], family: Family) -> (Block, Vec<Flaw>) {
    let (block, flaws) = line(Ctx { family, gaps }).parse(tokens).into_output_errors();
    (block.unwrap_or_default(), flaws)
}

fn line<'t>(ctx: Ctx<'t>) -> Boxed<'t, Block> {
    let value = value(ctx).boxed();
    let slash = deleted(ctx).or_not().map(|slash| slash.is_some());
    let number = line_number(ctx).or_not();
    let rest = choice((o_word(value.clone(), ctx), items(value, ctx))).boxed();
    slash
        .then(number)
        .then(rest)
        .map(|((deleted, number), rest)| Block { deleted, items: number.into_iter().chain(rest).collect() })
        .boxed()
}

fn mark<'t>(byte: u8) -> impl Parser<'t, Tokens<'t>, Token, Extra> + Clone {
    just(Token::Mark(byte))
}

fn deleted<'t>(ctx: Ctx<'t>) -> Boxed<'t, ()> {
    let level = custom(move |inp: &mut Ref<'t, '_>| match inp.peek() {
        Some(Token::Number { value, whole: true }) if ctx.family == Family::Fanuc && (1.0..=9.0).contains(&value) => {
            inp.skip();
            Ok(())
        }
        _ => Err(unexpected(inp)),
    });
    mark(b'/').then(level.or_not()).ignored().boxed()
}

/// Nothing the user sees: another way of reading has to be tried.
fn unexpected<'t>(inp: &mut Ref<'t, '_>) -> Flaw {
    fail(inp, 0, Problem::Unexpected)
}

/// A fault at the next `length` tokens.
fn fail<'t>(inp: &mut Ref<'t, '_>, length: usize, what: Problem) -> Flaw {
    let here = inp.save();
    let from = inp.cursor();
    for _ in 0..length {
        inp.skip();
    }
    let at = inp.span_since(&from);
    inp.rewind(here);
    Flaw { at, what }
}

/// The next token but `n`.
fn ahead<'t>(inp: &mut Ref<'t, '_>, n: usize) -> Option<Token> {
    let here = inp.save();
    for _ in 0..n {
        inp.skip();
    }
    let token = inp.peek();
    inp.rewind(here);
    token
}

/// Whether the next letters are these.
fn spells<'t>(inp: &mut Ref<'t, '_>, word: &str) -> bool {
    let here = inp.save();
    let all = word.bytes().all(|letter| inp.next() == Some(Token::Letter(letter)));
    inp.rewind(here);
    all
}

fn skip<'t>(inp: &mut Ref<'t, '_>, n: usize) {
    for _ in 0..n {
        inp.skip();
    }
}

/// How many letters stand together, without blanks between them.
fn letters<'t>(inp: &mut Ref<'t, '_>, ctx: Ctx<'t>) -> usize {
    let here = inp.save();
    let mut n = 0;
    while let Some(Token::Letter(b'a'..=b'z')) = inp.peek()
        && (n == 0 || !ctx.gap_before(inp))
    {
        inp.skip();
        n += 1;
    }
    inp.rewind(here);
    n
}

// ---- values ----

const FUNCTIONS: [(&str, Unary); 12] = [
    ("abs", Unary::Abs),
    ("acos", Unary::Acos),
    ("asin", Unary::Asin),
    ("cos", Unary::Cos),
    ("exp", Unary::Exp),
    ("fix", Unary::Fix),
    ("fup", Unary::Fup),
    ("ln", Unary::Ln),
    ("round", Unary::Round),
    ("sin", Unary::Sin),
    ("sqrt", Unary::Sqrt),
    ("tan", Unary::Tan),
];

fn value<'t>(ctx: Ctx<'t>) -> impl Parser<'t, Tokens<'t>, Expr, Extra> + Clone {
    recursive(move |value| {
        let value = value.boxed();
        let expression = expression(value.clone(), ctx).boxed();
        let negative = prefix(b'-').ignore_then(value.clone()).map(|v| Kind::Unary(Unary::Negate, Box::new(v)));
        let positive = prefix(b'+').ignore_then(value.clone()).map(|v| v.kind);
        let bracketed = expression.clone().map(|v| v.kind);
        let named = choice((name().map(Kind::Named), value.clone().map(|v| Kind::Param(Box::new(v)))));
        let parameter = mark(b'#').ignore_then(named);
        choice((
            literal().map(Kind::Number),
            bracketed,
            parameter,
            negative,
            positive,
            function().then(expression.clone()).map(|(f, v)| Kind::Unary(f, Box::new(v))),
            atan(expression),
            exists(value),
            no_value(ctx),
        ))
        .map_with(|kind, e| Expr { kind, at: e.span() })
        .boxed()
    })
}

/// `12`, `-.5`
fn literal<'t>() -> impl Parser<'t, Tokens<'t>, f64, Extra> + Clone {
    custom(|inp: &mut Ref<'t, '_>| {
        let sign = match inp.peek() {
            Some(Token::Mark(sign @ (b'-' | b'+'))) => Some(sign),
            _ => None,
        };
        let signs = usize::from(sign.is_some());
        match ahead(inp, signs) {
            Some(Token::Number { value, .. }) => {
                skip(inp, signs + 1);
                Ok(if sign == Some(b'-') { -value } else { value })
            }
            Some(Token::Malformed { trailing }) => Err(fail(inp, signs + 1, Problem::NotANumber { trailing })),
            None if signs == 1 => Err(fail(inp, 1, Problem::NotANumber { trailing: false })),
            _ => Err(unexpected(inp)),
        }
    })
}

/// A sign in front of something that is not a literal number.
fn prefix<'t>(sign: u8) -> impl Parser<'t, Tokens<'t>, (), Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        let number = matches!(ahead(inp, 1), None | Some(Token::Number { .. } | Token::Malformed { .. }));
        if inp.peek() != Some(Token::Mark(sign)) || number {
            return Err(unexpected(inp));
        }
        inp.skip();
        Ok(())
    })
}

/// `<name>`: the token's index.
fn name<'t>() -> impl Parser<'t, Tokens<'t>, usize, Extra> + Clone {
    custom(|inp: &mut Ref<'t, '_>| {
        let from = inp.cursor();
        match inp.peek() {
            Some(Token::Name) => {
                inp.skip();
                Ok(inp.span_since(&from).start)
            }
            Some(Token::OpenName) => {
                let here = inp.save();
                let mut length = 0;
                while inp.next().is_some() {
                    length += 1;
                }
                inp.rewind(here);
                Err(fail(inp, length, Problem::OpenName))
            }
            _ => Err(unexpected(inp)),
        }
    })
}

/// `value op value …` without brackets. Behind an operator a value has to come: its fault is the one to tell.
fn chain<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> impl Parser<'t, Tokens<'t>, Expr, Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        let first = inp.parse(&value)?;
        let mut rest = Vec::new();
        while let Ok((operator, length)) = find_operator(inp, ctx) {
            skip(inp, length);
            rest.push((operator, inp.parse(&value)?));
        }
        Ok(climb(first, rest, ctx.family))
    })
}

/// `[ value op value … ]`
fn expression<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> impl Parser<'t, Tokens<'t>, Expr, Extra> + Clone {
    mark(b'[')
        .ignore_then(chain(value, ctx))
        .then_ignore(close(ctx))
}

fn find_operator<'t>(inp: &mut Ref<'t, '_>, ctx: Ctx<'t>) -> Result<(Binary, usize), Flaw> {
    let star = ahead(inp, 1) == Some(Token::Mark(b'*'));
    match inp.peek() {
        Some(Token::Mark(b'+')) => return Ok((Binary::Plus, 1)),
        Some(Token::Mark(b'-')) => return Ok((Binary::Minus, 1)),
        Some(Token::Mark(b'/')) => return Ok((Binary::Divide, 1)),
        Some(Token::Mark(b'*')) if star => return Ok((Binary::Power, 2)),
        Some(Token::Mark(b'*')) => return Ok((Binary::Times, 1)),
        Some(Token::Letter(b'a'..=b'z')) => {}
        None => return Err(fail(inp, 0, Problem::UnclosedExpression)),
        Some(_) => return Err(fail(inp, 1, Problem::UnknownOperation)),
    }
    const NAMES: [(&str, Binary); 11] = [
        ("and", Binary::And),
        ("mod", Binary::Modulo),
        ("or", Binary::Or),
        ("xor", Binary::Xor),
        ("eq", Binary::Eq),
        ("ne", Binary::Ne),
        ("ge", Binary::Ge),
        ("gt", Binary::Gt),
        ("le", Binary::Le),
        ("lt", Binary::Lt),
        ("**", Binary::Power),
    ];
    if let Some((name, operator)) = NAMES.iter().find(|(name, _)| spells(inp, name)) {
        return Ok((*operator, name.len()));
    }
    let length = letters(inp, ctx);
    Err(match inp.peek() {
        Some(Token::Letter(first @ (b'a' | b'm' | b'o' | b'x' | b'e' | b'n' | b'g' | b'l'))) => {
            fail(inp, length, Problem::UnknownOperationName(first))
        }
        _ => fail(inp, length, Problem::UnknownOperation),
    })
}

/// `]`; anything else is a missing operator.
fn close<'t>(ctx: Ctx<'t>) -> impl Parser<'t, Tokens<'t>, (), Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| match inp.peek() {
        Some(Token::Mark(b']')) => {
            inp.skip();
            Ok(())
        }
        _ => Err(find_operator(inp, ctx).err().unwrap_or_else(|| unexpected(inp))),
    })
}

fn precedence(operator: Binary, family: Family) -> u8 {
    use Binary::*;
    match operator {
        And if family == Family::Fanuc => 5,
        Or | Xor if family == Family::Fanuc => 4,
        And | Or | Xor => 2,
        Eq | Ne | Gt | Ge | Lt | Le => 3,
        Plus | Minus => 4,
        Times | Divide | Modulo => 5,
        Power => 6,
    }
}

/// Joins values by precedence; equals from the left, `**` too.
fn climb(first: Expr, rest: Vec<(Binary, Expr)>, family: Family) -> Expr {
    let mut values = vec![first];
    let mut operators: Vec<Binary> = Vec::new();
    let join = |values: &mut Vec<Expr>, operator: Binary| {
        if let (Some(right), Some(left)) = (values.pop(), values.pop()) {
            let at = Range::from(left.at.start..right.at.end);
            values.push(Expr { kind: Kind::Binary(operator, Box::new(left), Box::new(right)), at });
        }
    };
    for (operator, value) in rest {
        while let Some(last) = operators.last().copied()
            && precedence(last, family) >= precedence(operator, family)
        {
            operators.pop();
            join(&mut values, last);
        }
        operators.push(operator);
        values.push(value);
    }
    while let Some(last) = operators.pop() {
        join(&mut values, last);
    }
    values.pop().unwrap_or(Expr { kind: Kind::Bad, at: Range::from(0..0) })
}

fn function_name<'t>(inp: &mut Ref<'t, '_>, name: &str) -> bool {
    spells(inp, name) && ahead(inp, name.len()) == Some(Token::Mark(b'['))
}

fn function<'t>() -> impl Parser<'t, Tokens<'t>, Unary, Extra> + Clone {
    custom(|inp: &mut Ref<'t, '_>| match FUNCTIONS.iter().find(|(name, _)| function_name(inp, name)) {
        Some((name, function)) => {
            skip(inp, name.len());
            Ok(*function)
        }
        None => Err(unexpected(inp)),
    })
}

fn named_function<'t>(name: &'static str) -> impl Parser<'t, Tokens<'t>, (), Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        if !function_name(inp, name) {
            return Err(unexpected(inp));
        }
        skip(inp, name.len());
        Ok(())
    })
}

/// This mark, or this problem.
fn must<'t>(byte: u8, what: Problem) -> impl Parser<'t, Tokens<'t>, (), Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        let next = inp.peek();
        if next != Some(Token::Mark(byte)) {
            return Err(fail(inp, usize::from(next.is_some()), what));
        }
        inp.skip();
        Ok(())
    })
}

/// The mark is next, but is not taken.
fn must_see<'t>(byte: u8, what: Problem) -> impl Parser<'t, Tokens<'t>, (), Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        let next = inp.peek();
        if next == Some(Token::Mark(byte)) { Ok(()) } else { Err(fail(inp, usize::from(next.is_some()), what)) }
    })
}

fn atan<'t>(expression: impl Parser<'t, Tokens<'t>, Expr, Extra> + Clone + 't) -> Boxed<'t, Kind> {
    named_function("atan")
        .ignore_then(expression.clone())
        .then_ignore(must(b'/', Problem::AtanSlash))
        .then_ignore(must_see(b'[', Problem::AtanBracket))
        .then(expression)
        .map(|(y, x)| Kind::Atan(Box::new(y), Box::new(x)))
        .boxed()
}

fn exists<'t>(value: Boxed<'t, Expr>) -> Boxed<'t, Kind> {
    let argument = choice((name().map(Kind::ExistsNamed), value.map(|v| Kind::ExistsParam(Box::new(v)))));
    named_function("exists")
        .then_ignore(mark(b'['))
        .ignore_then(must(b'#', Problem::ExistsParameter))
        .ignore_then(argument)
        .then_ignore(must(b']', Problem::ExistsBracket))
        .boxed()
}

/// Nothing a value begins with: says what is wrong.
fn no_value<'t>(ctx: Ctx<'t>) -> impl Parser<'t, Tokens<'t>, Kind, Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        let length = letters(inp, ctx);
        let known = FUNCTIONS.iter().map(|(name, _)| *name).chain(["atan", "exists"]).find(|name| spells(inp, name));
        Err(match inp.peek() {
            None => fail(inp, 0, Problem::NoValue),
            // These begin a value and have told their fault already.
            Some(Token::Mark(b'[' | b'#')) => unexpected(inp),
            Some(Token::Letter(b'a'..=b'z')) if known.is_some() => {
                let name = known.unwrap_or_default();
                if ahead(inp, name.len()) == Some(Token::Mark(b'[')) {
                    unexpected(inp)
                } else {
                    fail(inp, name.len(), Problem::NoBracketAfterFunction(name))
                }
            }
            Some(Token::Letter(first @ (b'a' | b'c' | b'e' | b'f' | b'l' | b'r' | b's' | b't'))) => {
                fail(inp, length, Problem::UnknownWord(first))
            }
            Some(Token::Letter(b'a'..=b'z')) => fail(inp, length, Problem::UnknownUnary),
            Some(Token::Number { .. } | Token::Malformed { .. }) => unexpected(inp),
            Some(Token::Mark(b'+' | b'-')) => unexpected(inp),
            Some(_) => fail(inp, 0, Problem::NotANumber { trailing: false }),
        })
    })
}

// ---- items ----

/// Whether a word, setting or comment begins here. Letters of a name do not: `after_letter`.
fn item_starts<'t>(inp: &mut Ref<'t, '_>, after_letter: bool, ctx: Ctx<'t>) -> bool {
    match inp.peek() {
        None | Some(Token::Paren | Token::Semicolon | Token::BadComment) => true,
        Some(Token::Letter(letter)) if is_word_letter(letter, ctx.family) => {
            let value = matches!(
                ahead(inp, 1),
                Some(Token::Number { .. } | Token::Malformed { .. } | Token::Mark(b'[' | b'#' | b'+' | b'-'))
            );
            value && (!after_letter || ctx.gap_before(inp))
        }
        _ => false,
    }
}

/// Skips what belongs to a damaged value: to the next item outside brackets, or anywhere when a bracket is
/// never closed.
fn damage<'t>(ctx: Ctx<'t>) -> impl Parser<'t, Tokens<'t>, Expr, Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        let from = inp.cursor();
        let mut depth = 0i32;
        let mut after_letter = false;
        // A letter right where the value should be is a word of its own only when it looks like one.
        while inp.peek().is_some() {
            let closed_later = depth > 0 && closes(inp, depth);
            if !closed_later && item_starts(inp, after_letter, ctx) {
                break;
            }
            match inp.next() {
                Some(Token::Mark(b'[')) => depth += 1,
                Some(Token::Mark(b']')) => depth -= 1,
                token => {
                    after_letter = matches!(token, Some(Token::Letter(_)));
                    continue;
                }
            }
            after_letter = false;
        }
        Ok(Expr { kind: Kind::Bad, at: inp.span_since(&from) })
    })
}

/// Whether the open brackets are closed further on.
fn closes<'t>(inp: &mut Ref<'t, '_>, mut depth: i32) -> bool {
    let here = inp.save();
    while let Some(token) = inp.next() {
        match token {
            Token::Mark(b'[') => depth += 1,
            Token::Mark(b']') => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    inp.rewind(here);
    depth == 0
}

fn mended<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> Boxed<'t, Expr> {
    value.recover_with(via_parser(damage(ctx))).boxed()
}

fn line_number<'t>(ctx: Ctx<'t>) -> Boxed<'t, Item> {
    let number = custom(move |inp: &mut Ref<'t, '_>| {
        if let Some(Token::Number { value, whole: true }) = inp.peek() {
            inp.skip();
            return Ok(Some(value));
        }
        let sign = matches!(inp.peek(), Some(Token::Mark(b'-' | b'+')));
        let number = matches!(ahead(inp, usize::from(sign)), Some(Token::Number { .. } | Token::Malformed { .. }));
        let flaw = fail(inp, usize::from(sign) + usize::from(number), Problem::BadLineNumber);
        while !item_starts(inp, false, ctx) {
            inp.skip();
        }
        inp.emit(flaw);
        Ok(None)
    });
    just(Token::Letter(b'n'))
        .ignore_then(number)
        .map_with(|value, e| {
            let at: Range = e.span();
            match value {
                Some(value) => {
                    let number = Expr { kind: Kind::Number(value), at: Range::from(at.start + 1..at.end) };
                    Item::Word { letter: b'n', value: number, at }
                }
                None => Item::Bad { letter: b'n', at },
            }
        })
        .boxed()
}

fn items<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> Boxed<'t, Vec<Item>> {
    let item = choice((
        macro_statement(value.clone(), ctx),
        word(value.clone(), ctx),
        setting(value, ctx),
        comment(),
        junk(ctx),
    ));
    item.repeated().collect::<Vec<_>>().boxed()
}

fn word<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> Boxed<'t, Item> {
    let letter = select! { Token::Letter(letter) if is_word_letter(letter, ctx.family) => letter };
    letter
        .then(mended(value, ctx))
        .map_with(|(letter, value), e| Item::Word { letter, value, at: e.span() })
        .boxed()
}

fn target<'t>(value: Boxed<'t, Expr>) -> Boxed<'t, Name> {
    choice((name().map(Name::Named), value.map(Name::Number))).boxed()
}

fn setting<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> Boxed<'t, Item> {
    // Macro B takes an assignment's right side without brackets.
    let set = if ctx.family == Family::Fanuc { chain(value.clone(), ctx).boxed() } else { value.clone() };
    mark(b'#')
        .ignore_then(target(value.clone()))
        .then_ignore(must(b'=', Problem::NoEqualSign))
        .then(mended(set, ctx))
        .map_with(|(target, value), e| Item::Setting { target, value, at: e.span() })
        .recover_with(via_parser(
            mark(b'#').then(damage(ctx)).map_with(|_, e| Item::Bad { letter: b'#', at: e.span() }),
        ))
        .boxed()
}

fn comment<'t>() -> Boxed<'t, Item> {
    choice((
        choice((just(Token::Paren), just(Token::Semicolon))).map_with(|_, e| Item::Comment { at: e.span() }),
        just(Token::BadComment).map_with(|_, e| Item::BadComment { at: e.span() }),
    ))
    .boxed()
}

/// One or more tokens that begin nothing; one fault for all of them.
fn junk<'t>(ctx: Ctx<'t>) -> impl Parser<'t, Tokens<'t>, Item, Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        if inp.peek().is_none() {
            return Err(unexpected(inp));
        }
        let flaw = fail(inp, 1, Problem::BadCharacter);
        let from = inp.cursor();
        let mut after_letter = matches!(inp.next(), Some(Token::Letter(_)));
        while !item_starts(inp, after_letter, ctx) && inp.peek() != Some(Token::Mark(b'#')) {
            after_letter = matches!(inp.next(), Some(Token::Letter(_)));
        }
        inp.emit(flaw);
        Ok(Item::Bad { letter: b'?', at: inp.span_since(&from) })
    })
}

// ---- O-words ----

const KEYWORDS: [(&str, Keyword); 15] = [
    ("sub", Keyword::Sub),
    ("endsub", Keyword::Endsub),
    ("call", Keyword::Call),
    ("do", Keyword::Do),
    ("while", Keyword::While),
    ("repeat", Keyword::Repeat),
    ("if", Keyword::If),
    ("elseif", Keyword::Elseif),
    ("else", Keyword::Else),
    ("endif", Keyword::Endif),
    ("break", Keyword::Break),
    ("continue", Keyword::Continue),
    ("endwhile", Keyword::Endwhile),
    ("endrepeat", Keyword::Endrepeat),
    ("return", Keyword::Return),
];

/// Most arguments of a call.
const ARGUMENTS: usize = 30;

fn keyword<'t>(ctx: Ctx<'t>) -> impl Parser<'t, Tokens<'t>, Keyword, Extra> + Clone {
    custom(move |inp: &mut Ref<'t, '_>| {
        if let Some((word, keyword)) = KEYWORDS.iter().find(|(word, _)| spells(inp, word)) {
            skip(inp, word.len());
            return Ok(*keyword);
        }
        if matches!(inp.peek(), None | Some(Token::Paren | Token::Semicolon | Token::BadComment)) {
            return Ok(Keyword::Program);
        }
        let length = letters(inp, ctx).max(1);
        Err(fail(inp, length, Problem::UnknownKeyword))
    })
}

fn condition_name(keyword: Keyword) -> Option<&'static str> {
    match keyword {
        Keyword::While => Some("while"),
        Keyword::Repeat => Some("repeat"),
        Keyword::If => Some("if"),
        Keyword::Elseif => Some("elseif"),
        _ => None,
    }
}

type Arguments = (Vec<Expr>, Vec<Range>);

/// What follows each keyword.
fn arguments<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> Boxed<'t, (Keyword, Arguments)> {
    let only = |f: fn(Keyword) -> bool| keyword(ctx).filter(move |k| f(*k));
    let bracketed = mended(must_see(b'[', Problem::Unexpected).ignore_then(value).boxed(), ctx);
    let conditional = only(|k| condition_name(k).is_some())
        .then(see(b'[').ignore_then(bracketed.clone()).or_not())
        .validate(|(keyword, arg), e, emitter| {
            let at: Range = e.span();
            if let (None, Some(name)) = (&arg, condition_name(keyword)) {
                emitter.emit(Flaw { at: Range::from(at.end..at.end), what: Problem::NoCondition(name) });
            }
            (keyword, (arg.into_iter().collect(), Vec::new()))
        });
    let optional = only(|k| matches!(k, Keyword::Return | Keyword::Endsub))
        .then(see(b'[').ignore_then(bracketed.clone()).or_not())
        .map(|(keyword, arg)| (keyword, (arg.into_iter().collect(), Vec::new())));
    let argument = choice((
        see(b'[').ignore_then(bracketed).map(Ok),
        just(Token::Paren).map_with(|_, e| Err(e.span())),
    ));
    let call = only(|k| k == Keyword::Call)
        .then(argument.repeated().collect::<Vec<Result<Expr, Range>>>())
        .validate(|(keyword, list), e, emitter| {
            let (mut args, mut comments) = (Vec::new(), Vec::new());
            for entry in list {
                match entry {
                    Ok(arg) => args.push(arg),
                    Err(comment) => comments.push(comment),
                }
            }
            if let Some(first) = args.get(ARGUMENTS) {
                emitter.emit(Flaw { at: first.at, what: Problem::TooManyArguments });
            }
            let _: Range = e.span();
            (keyword, (args, comments))
        });
    let bare = keyword(ctx).map(|keyword| (keyword, (Vec::new(), Vec::new())));
    choice((conditional, optional, call, bare)).boxed()
}

/// The mark is next and is not taken; no fault otherwise.
fn see<'t>(byte: u8) -> impl Parser<'t, Tokens<'t>, (), Extra> + Clone {
    must_see(byte, Problem::Unexpected)
}

/// `o<name` without its `>`: the controller takes the rest of the line as the name of a bare label.
fn open_label<'t>() -> impl Parser<'t, Tokens<'t>, Item, Extra> + Clone {
    custom(|inp: &mut Ref<'t, '_>| {
        let from = inp.cursor();
        if inp.peek() != Some(Token::Letter(b'o')) || ahead(inp, 1) != Some(Token::OpenName) {
            return Err(unexpected(inp));
        }
        inp.skip();
        let label = inp.cursor();
        while inp.next().is_some() {}
        let label_at: Range = inp.span_since(&label);
        Ok(Item::Control {
            keyword: Keyword::Program,
            label: Some(Name::Named(label_at.start)),
            label_at,
            args: Vec::new(),
            comments: Vec::new(),
            at: inp.span_since(&from),
        })
    })
}

fn o_word<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> Boxed<'t, Vec<Item>> {
    let label = target(value.clone()).map_with(|label, e| (label, e.span()));
    let statement = just(Token::Letter(b'o'))
        .ignore_then(label)
        .then(arguments(value, ctx))
        .map_with(|((label, label_at), (keyword, (args, comments))), e| Item::Control {
            keyword,
            label: Some(label),
            label_at,
            args,
            comments,
            at: e.span(),
        })
        .recover_with(via_parser(
            just(Token::Letter(b'o')).then(rest_of_line()).map_with(|_, e| Item::Bad { letter: b'o', at: e.span() }),
        ));
    choice((open_label(), statement))
        .then(choice((comment(), trailing())).repeated().collect::<Vec<_>>())
        .map(|(first, rest)| std::iter::once(first).chain(rest).collect())
        .boxed()
}

fn rest_of_line<'t>() -> impl Parser<'t, Tokens<'t>, (), Extra> + Clone {
    custom(|inp: &mut Ref<'t, '_>| {
        while !matches!(inp.peek(), None | Some(Token::Paren | Token::Semicolon | Token::BadComment)) {
            inp.skip();
        }
        Ok(())
    })
}

/// What may not stand behind an O-word.
fn trailing<'t>() -> impl Parser<'t, Tokens<'t>, Item, Extra> + Clone {
    any().filter(|t| !matches!(t, Token::Paren | Token::Semicolon | Token::BadComment)).then(rest_of_line()).validate(
        |_, e, emitter| {
            emitter.emit(Flaw { at: e.span(), what: Problem::AfterOWord });
            Item::Bad { letter: b'?', at: e.span() }
        },
    )
}

// ---- macro statements (Fanuc) ----

/// `IF […] GOTO n`, `IF […] THEN #…=…`, `WHILE […] DO n`, `DO n`, `END n`, `GOTO n`.
fn macro_statement<'t>(value: Boxed<'t, Expr>, ctx: Ctx<'t>) -> Boxed<'t, Item> {
    let word = move |text: &'static str, next: fn(Option<Token>) -> bool| {
        custom(move |inp: &mut Ref<'t, '_>| {
            if ctx.family != Family::Fanuc || !spells(inp, text) || !next(ahead(inp, text.len())) {
                return Err(unexpected(inp));
            }
            skip(inp, text.len());
            Ok(())
        })
    };
    let bracket: fn(Option<Token>) -> bool = |t| t == Some(Token::Mark(b'['));
    let anything: fn(Option<Token>) -> bool = |_| true;
    let must_say = move |text: &'static str, what: Problem| {
        custom(move |inp: &mut Ref<'t, '_>| {
            if !spells(inp, text) {
                return Err(fail(inp, 0, what));
            }
            skip(inp, text.len());
            Ok(())
        })
    };
    let if_form = "IF [condition] GOTO n";
    let branch = word("if", bracket).ignore_then(value.clone()).then(choice((
        word("goto", anything).ignore_then(value.clone()).map(|n| (Keyword::MacroIfGoto, Some(n))),
        word("then", anything).map(|()| (Keyword::MacroIfThen, None)),
        must_say("goto", Problem::Macro("IF", if_form)).map(|()| (Keyword::MacroIfGoto, None)),
    )));
    let branch = branch.map(|(condition, (keyword, n))| (keyword, std::iter::once(condition).chain(n).collect()));
    let loop_ = word("while", bracket)
        .ignore_then(value.clone())
        .then_ignore(must_say("do", Problem::Macro("WHILE", "WHILE [condition] DO n")))
        .then(value.clone())
        .map(|(condition, n)| (Keyword::MacroWhile, vec![condition, n]));
    let simple = |text, keyword| word(text, anything).ignore_then(value.clone()).map(move |n| (keyword, vec![n]));
    let statement = choice((
        branch,
        loop_,
        simple("goto", Keyword::MacroGoto),
        simple("do", Keyword::MacroDo),
        simple("end", Keyword::MacroEnd),
    ));
    let opening = choice((
        word("if", bracket),
        word("while", bracket),
        word("goto", anything),
        word("do", anything),
        word("end", anything),
    ));
    statement
        .map_with(|(keyword, args): (Keyword, Vec<Expr>), e| {
            let at: Range = e.span();
            let label_at = Range::from(at.start..at.start);
            Item::Control { keyword, label: None, label_at, args, comments: Vec::new(), at }
        })
        .recover_with(via_parser(
            opening.then(rest_of_line()).map_with(|_, e| Item::Bad { letter: b'o', at: e.span() }),
        ))
        .boxed()
}
