//! What a dialect's own syntax does not have: a control reads one closed language, and what belongs to another is
//! refused by name, with what to write instead. Not the codes: those are the interpreter's.

use gr_spec::Family;

use crate::grammar::{Expr, Item, Kind, Name, Problem, Range};
use crate::model::{Binary, Keyword};

/// Something of another language.
pub(crate) struct Alien {
    /// As it fits into "dialect … has no …".
    pub what: &'static str,
    /// What to do about it.
    pub instead: &'static str,
}

const PLAIN_WORDS: &str = "replace it by plain words, or choose the dialect of the control that will run the program";

pub(crate) const DOLLAR: Alien = Alien {
    what: "`$` commands in programs",
    instead: "send it to the controller by hand, and take it out of the program",
};
const PARAMETERS: Alien = Alien { what: "parameters", instead: PLAIN_WORDS };
const EXPRESSIONS: Alien = Alien { what: "expressions", instead: PLAIN_WORDS };
const CONTROL: Alien = Alien { what: "control statements", instead: PLAIN_WORDS };

const NAMED: Alien = Alien {
    what: "named parameters",
    instead: "use a number: #1 to #33 within one program, #100 to #199 or #500 to #999 for all programs",
};
const EXISTS: Alien = Alien { what: "function EXISTS", instead: "compare with the vacant variable: [#1 NE #0]" };
const POWER: Alien = Alien { what: "operator `**`", instead: "multiply, or write EXP[b*LN[a]] for a to the power of b" };
const O_NAME: Alien = Alien { what: "named O-words", instead: "give the program a number: O1000" };
const O_SUB: Alien = Alien { what: "`O… sub`", instead: "begin the subprogram with its number alone (O100) and end it with M99" };
const O_CALL: Alien = Alien { what: "`O… call`", instead: "call the subprogram by M98 P100, or with arguments by G65 P100 A1. B2." };
const O_LOOP: Alien = Alien { what: "`O… while` loops", instead: "write WHILE [condition] DO 1 … END 1" };
const O_REPEAT: Alien = Alien { what: "`O… repeat`", instead: "count in a variable: WHILE [#1 LT 5] DO 1 … END 1" };
const O_IF: Alien = Alien { what: "`O… if`", instead: "write IF [condition] GOTO 10, or IF [condition] THEN #1=2" };
const O_BREAK: Alien = Alien { what: "`O… break` and `O… continue`", instead: "leave the loop by GOTO, with a block number behind it" };
const O_OTHER: Alien = Alien { what: "words of this kind behind a program number", instead: "write the program number alone: O1000" };

/// Dialects without parameters and expressions.
pub(crate) fn plain_only(family: Family) -> bool {
    matches!(family, Family::Grbl | Family::Ufmg2008)
}

/// What in a setting or a statement does not belong to the dialect, and where.
pub(crate) fn item(item: &Item, family: Family) -> Option<(Alien, Range)> {
    if family == Family::Linuxcnc {
        return None;
    }
    match item {
        Item::Setting { at, .. } if plain_only(family) => Some((PARAMETERS, *at)),
        Item::Control { at, .. } if plain_only(family) => Some((CONTROL, *at)),
        Item::Setting { target: Name::Named(_), at, .. } => Some((NAMED, *at)),
        Item::Setting { target: Name::Number(number), value, .. } => in_macro(number).or_else(|| in_macro(value)),
        Item::Control { keyword, label, args, at, .. } => {
            let word = match label {
                Some(Name::Named(_)) => Some(O_NAME),
                _ => o_word(*keyword),
            };
            word.map(|w| (w, *at)).or_else(|| args.iter().find_map(in_macro))
        }
        _ => None,
    }
}

/// What in a word's value does not belong to the dialect, and where.
pub(crate) fn value(value: &Expr, family: Family) -> Option<(Alien, Range)> {
    match family {
        Family::Linuxcnc => None,
        Family::Fanuc => in_macro(value),
        _ if has_parameter(value) => Some((PARAMETERS, value.at)),
        _ => Some((EXPRESSIONS, value.at)),
    }
}

/// Faults of LinuxCNC's statements that a macro dialect does not have at all.
pub(crate) fn flaw(what: Problem, family: Family) -> Option<Alien> {
    if family != Family::Fanuc {
        return None;
    }
    Some(match what {
        Problem::NoCondition("while") => O_LOOP,
        Problem::NoCondition("repeat") => O_REPEAT,
        Problem::NoCondition(_) => O_IF,
        Problem::TooManyArguments => O_CALL,
        Problem::UnknownKeyword => O_OTHER,
        Problem::ExistsParameter | Problem::ExistsBracket => EXISTS,
        _ => return None,
    })
}

/// A fault as the dialect sees it: where there are no functions, a letter behind a word means that its value is missing.
pub(crate) fn plainly(what: Problem, family: Family) -> Problem {
    match what {
        Problem::UnknownWord(_) | Problem::UnknownUnary | Problem::NoBracketAfterFunction(_) if plain_only(family) => Problem::NoValue,
        other => other,
    }
}

fn o_word(keyword: Keyword) -> Option<Alien> {
    Some(match keyword {
        Keyword::Sub | Keyword::Endsub | Keyword::Return => O_SUB,
        Keyword::Call => O_CALL,
        Keyword::Do | Keyword::While | Keyword::Endwhile => O_LOOP,
        Keyword::Repeat | Keyword::Endrepeat => O_REPEAT,
        Keyword::If | Keyword::Elseif | Keyword::Else | Keyword::Endif => O_IF,
        Keyword::Break | Keyword::Continue => O_BREAK,
        _ => return None,
    })
}

fn in_macro(value: &Expr) -> Option<(Alien, Range)> {
    let own = match &value.kind {
        Kind::Named(_) => Some(NAMED),
        Kind::ExistsNamed(_) | Kind::ExistsParam(_) => Some(EXISTS),
        Kind::Binary(Binary::Power, ..) => Some(POWER),
        _ => None,
    };
    own.map(|a| (a, value.at)).or_else(|| parts(value).into_iter().flatten().find_map(in_macro))
}

fn has_parameter(value: &Expr) -> bool {
    let own = matches!(value.kind, Kind::Named(_) | Kind::Param(_) | Kind::ExistsNamed(_) | Kind::ExistsParam(_));
    own || parts(value).into_iter().flatten().any(has_parameter)
}

/// The values that a value is made of.
fn parts(value: &Expr) -> [Option<&Expr>; 2] {
    match &value.kind {
        Kind::Param(a) | Kind::Unary(_, a) | Kind::ExistsParam(a) => [Some(a), None],
        Kind::Atan(a, b) | Kind::Binary(_, a, b) => [Some(a), Some(b)],
        _ => [None, None],
    }
}
