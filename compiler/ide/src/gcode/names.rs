//! Names of a G-code file: subroutines, blocks of control flow, parameters, line numbers. Where each is defined, set
//! and used, and what renaming changes.

use std::ops::Range;

use gr_gcode::{Form, Keyword, Label, Parameter, Symbols, Word};
use gr_text::Span;

use super::doc::{Doc, LineOf};
use crate::{Occurrence, Role};

/// Something that has a name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Name {
    /// A subroutine: the same in all files.
    Sub(Label),
    /// A branch or loop, inside of the subroutine (or main program) with these lines.
    Block(Label, u32, u32),
    /// A parameter.
    Parameter(Parameter),
    /// A line number.
    Line(i64),
    /// A tool number.
    Tool(i64),
}

/// A subroutine.
#[derive(Clone, Debug, PartialEq)]
pub struct Sub {
    /// Its label.
    pub label: Label,
    /// Its first line.
    pub first: u32,
    /// Its last line.
    pub last: u32,
    /// The label's bytes.
    pub span: Span,
    /// A program by its O number, the first of its file: mostly the main program.
    pub heads_file: bool,
}

/// The word of a keyword.
pub fn keyword(k: Keyword) -> &'static str {
    if k == Keyword::Program { "program" } else { k.name() }
}

/// `o100`, `o<name>`.
pub fn label_text(label: &Label) -> String {
    match label {
        Label::Number(n) => format!("o{n}"),
        Label::Named(n) => format!("o<{n}>"),
        Label::Dynamic => "o[…]".into(),
    }
}

fn of_sub(k: Keyword) -> bool {
    matches!(k, Keyword::Sub | Keyword::Endsub | Keyword::Call | Keyword::Return | Keyword::Program)
}

/// Symbols of the chunks that may have any, with the first line and byte of each chunk.
fn tables(doc: Doc<'_>) -> impl Iterator<Item = (Symbols, u32, u32)> + use<'_> {
    doc.file.chunks.iter().zip(doc.file.first_lines.iter().zip(&doc.file.starts)).filter_map(|(c, (line, byte))| {
        let scan = &c.scan;
        let some = !scan.nodes.is_empty() || !scan.settings.is_empty() || !scan.controls.is_empty() || memchr::memchr(b'#', c.text.as_bytes()).is_some();
        some.then(|| (gr_gcode::symbols(&c.text, scan), *line, *byte))
    })
}

/// Subroutines of a file in order.
pub fn subs(doc: Doc<'_>) -> Vec<Sub> {
    let mut found: Vec<Sub> = Vec::new();
    let mut open = None;
    for (c, chunk) in doc.file.chunks.iter().enumerate().filter(|(_, c)| !c.scan.controls.is_empty()) {
        let (first, base) = (doc.file.first_lines[c], doc.file.starts[c]);
        let symbols = gr_gcode::symbols(&chunk.text, &chunk.scan);
        for s in &symbols.statements {
            let line = s.line + first;
            match s.what.keyword {
                Keyword::Sub | Keyword::Program => {
                    if let Some(last) = open.take().and_then(|i: usize| found.get_mut(i)).filter(|_| s.what.keyword == Keyword::Program) {
                        last.last = line.saturating_sub(1);
                    }
                    let span = label_span(doc, line, s.span.shifted(base));
                    let heads_file = found.is_empty() && s.what.keyword == Keyword::Program;
                    found.push(Sub { label: s.what.label.clone(), first: line, last: line, span, heads_file });
                    open = Some(found.len() - 1);
                    if s.what.keyword == Keyword::Program {
                        found[open.unwrap_or(0)].last = doc.count().saturating_sub(1);
                    }
                }
                Keyword::Endsub => {
                    if let Some(sub) = open.take().and_then(|i| found.get_mut(i)) {
                        sub.last = line;
                    }
                }
                _ => {}
            }
        }
    }
    found
}

/// Bytes of the label (without `o` and angle brackets) of the statement with this span.
fn label_span(doc: Doc<'_>, line: u32, statement: Span) -> Span {
    let Some(line) = doc.line(line) else { return statement };
    let control = line.chunk.scan.controls.iter().find(|c| c.span.shifted(line.base) == statement);
    control.map_or(statement, |c| inner(&line, c.label_span.shifted(line.base)))
}

/// The name inside of `<…>`, or the number.
fn inner(line: &LineOf<'_>, span: Span) -> Span {
    let text = line.slice(span);
    let lead = text.len() - text.trim_start_matches(['o', 'O', '<', ' ', '\t', '#']).len();
    let tail = text.len() - text.trim_end_matches(['>', ' ', '\t']).len();
    if lead + tail >= text.len() { span } else { Span::new(span.start + lead as u32, span.end - tail as u32) }
}

/// The lines of the subroutine that holds a line; of the main program, the whole file.
fn scope(subs: &[Sub], line: u32, count: u32) -> (u32, u32) {
    let sub = subs.iter().find(|s| (s.first..=s.last).contains(&line) && s.last > s.first);
    sub.map_or((0, count), |s| (s.first, s.last + 1))
}

/// `M99 P` of a subprogram: block `n` that it names is one of the program that called it.
fn returns(doc: Doc<'_>, subs: &[Sub], line: u32, n: i64) -> bool {
    let called = || subs.iter().any(|s| !s.heads_file && (s.first..=s.last).contains(&line));
    let is = |w: &Word| w.value as i64 == n;
    doc.line(line).is_some_and(|l| l.has_code(b'm', 990) && l.literal(b'p').is_some_and(is) && !l.literal(b'n').is_some_and(is)) && called()
}

/// Names and where they stand, on some lines.
fn all(doc: Doc<'_>, lines: Range<u32>, subs: &[Sub]) -> Vec<(Name, Occurrence, u32)> {
    let mut found = Vec::new();
    let count = doc.count();
    for (symbols, first, base) in tables(doc) {
        let fits = |line: u32| lines.contains(&(line + first));
        for s in symbols.statements.iter().filter(|s| fits(s.line)) {
            let line = s.line + first;
            statement(doc, s.what.keyword, &s.what.label, line, s.span.shifted(base), subs, count, &mut found);
        }
        for (list, role) in [(&symbols.reads, Role::Read), (&symbols.writes, Role::Write)] {
            for s in list.iter().filter(|s| fits(s.line)) {
                let line = s.line + first;
                let Some(of) = doc.line(line) else { continue };
                found.extend(parameter(&of, &s.what, s.span.shifted(base), role));
            }
        }
    }
    plain_words(doc, lines, &mut found);
    found.sort_by_key(|(_, o, _)| o.span);
    found
}

#[expect(clippy::too_many_arguments, reason = "one place that takes a statement apart")]
fn statement(
    doc: Doc<'_>,
    keyword: Keyword,
    label: &Label,
    line: u32,
    span: Span,
    subs: &[Sub],
    count: u32,
    found: &mut Vec<(Name, Occurrence, u32)>,
) {
    let macro_jump = matches!(keyword, Keyword::MacroGoto | Keyword::MacroIfGoto);
    if let (true, Label::Number(n)) = (macro_jump, label) {
        if let Some(place) = last_number(doc, line, span) {
            found.push((Name::Line(*n), Occurrence { span: place, role: Role::Read }, line));
        }
        return;
    }
    if *label == Label::Dynamic || matches!(keyword, Keyword::MacroIfThen) {
        return;
    }
    let macro_block = matches!(keyword, Keyword::MacroWhile | Keyword::MacroDo | Keyword::MacroEnd);
    let place = if macro_block { last_number(doc, line, span) } else { Some(label_span(doc, line, span)) };
    let Some(place) = place else { return };
    let role = match keyword {
        Keyword::Sub | Keyword::Program | Keyword::If | Keyword::Do | Keyword::Repeat | Keyword::MacroDo | Keyword::MacroWhile => Role::Definition,
        _ => Role::Read,
    };
    let name = if of_sub(keyword) {
        Name::Sub(label.clone())
    } else {
        let (from, to) = scope(subs, line, count);
        Name::Block(label.clone(), from, to)
    };
    found.push((name, Occurrence { span: place, role }, line));
}

/// The number at the end of a macro statement.
fn last_number(doc: Doc<'_>, line: u32, statement: Span) -> Option<Span> {
    let line = doc.line(line)?;
    let text = line.slice(statement).trim_end();
    let digits = text.bytes().rev().take_while(u8::is_ascii_digit).count() as u32;
    let end = statement.start + text.len() as u32;
    (digits > 0).then(|| Span::new(end - digits, end))
}

fn parameter(line: &LineOf<'_>, what: &Parameter, span: Span, role: Role) -> Option<(Name, Occurrence, u32)> {
    let span = parameter_span(line, span).filter(|s| !is_remark(line, *s))?;
    Some((Name::Parameter(what.clone()), Occurrence { span, role }, line.line))
}

/// The name or number of the first `#<name>`, `#12` or `#12=…` of some bytes.
fn parameter_span(line: &LineOf<'_>, span: Span) -> Option<Span> {
    let text = line.slice(span);
    let sign = text.find('#')?;
    let rest = text[sign + 1..].trim_start_matches([' ', '\t']);
    let start = text.len() - rest.len();
    let (start, length) = match rest.strip_prefix('<') {
        Some(name) => (start + 1, name.find('>')?),
        None => (start, rest.bytes().take_while(u8::is_ascii_digit).count()),
    };
    (length > 0).then(|| Span::new(span.start + start as u32, span.start + (start + length) as u32))
}

/// Whether bytes of a line are no program: a comment that prints no parameters.
fn is_remark(line: &LineOf<'_>, span: Span) -> bool {
    let holds = |w: &&gr_gcode::Word| w.form == Form::Comment && line.span_of(w).start <= span.start && span.start < line.span_of(w).end;
    let Some(word) = line.words().iter().find(holds) else { return false };
    let text: String = line.slice(line.span_of(word)).trim_start_matches(['(', ';']).chars().filter(|c| !c.is_whitespace()).take(6).collect();
    !["debug,", "print,", "log,"].iter().any(|word| text.to_ascii_lowercase().starts_with(word))
}

/// N words, tools, `M98 P`, `G65 P`, contours of lathe cycles.
fn plain_words(doc: Doc<'_>, lines: Range<u32>, found: &mut Vec<(Name, Occurrence, u32)>) {
    for line in doc.lines(lines) {
        let named = NamedBy::of(&line, doc.dialect);
        for w in line.words().iter().filter(|w| w.form == Form::Literal) {
            let name = match w.letter {
                b'n' => (Name::Line(w.value as i64), Role::Definition),
                // T0101 of a lathe is tool 1 with offset 1.
                b't' if doc.dialect.id == "fanuc-turn" && w.value >= 100.0 => (Name::Tool(w.value as i64 / 100), Role::Read),
                b't' => (Name::Tool(w.value as i64), Role::Read),
                b'p' if named.calls => {
                    let (number, span) = called(doc, &line, w);
                    found.push((Name::Sub(Label::Number(number)), Occurrence { span, role: Role::Read }, line.line));
                    continue;
                }
                b'q' if named.profile => (Name::Sub(Label::Number(w.value as i64)), Role::Read),
                b'p' if named.jumps => (Name::Line(w.value as i64), Role::Read),
                b'p' | b'q' if named.contour => (Name::Line(w.value as i64), Role::Read),
                _ => continue,
            };
            found.push((name.0, Occurrence { span: number_of(&line, w), role: name.1 }, line.line));
        }
    }
}

/// The digits of a word.
fn number_of(line: &LineOf<'_>, w: &gr_gcode::Word) -> Span {
    let span = line.tight(w);
    let text = line.slice(span);
    let lead = 1 + text[1..].len() as u32 - text[1..].trim_start().len() as u32;
    Span::new(span.start + lead, span.end)
}

/// What numbers of plain words name.
struct NamedBy {
    /// `M98 P1000`, `G65 P1000`, `G66 P1000`: a subroutine.
    calls: bool,
    /// `M99 P10`: a line.
    jumps: bool,
    /// `G71 P10 Q20` of lathes: lines.
    contour: bool,
    /// `G71 Q100` of LinuxCNC: a subroutine.
    profile: bool,
}

impl NamedBy {
    fn of(line: &LineOf<'_>, dialect: &gr_spec::Dialect) -> NamedBy {
        let cycle = |from: f64, to: f64| line.words().iter().any(|w| w.letter == b'g' && w.form == Form::Literal && (from..=to).contains(&w.value));
        let fanuc = dialect.family == gr_spec::Family::Fanuc;
        NamedBy {
            calls: line.has_code(b'm', 980) || fanuc && (line.has_code(b'g', 650) || line.has_code(b'g', 660)),
            jumps: line.has_code(b'm', 990),
            contour: dialect.id == "fanuc-turn" && cycle(70.0, 73.0),
            profile: dialect.family == gr_spec::Family::Linuxcnc && cycle(70.0, 72.9),
        }
    }
}

/// The program that P of an M98 names, and its digits.
fn called(doc: Doc<'_>, line: &LineOf<'_>, p: &Word) -> (i64, Span) {
    let whole = number_of(line, p);
    if doc.dialect.family != gr_spec::Family::Fanuc || !line.has_code(b'm', 980) {
        return (p.value as i64, whole);
    }
    let (span, text) = (whole, line.slice(whole));
    let (number, repeats) = gr_gcode::fanuc_call(p.value as i64, line.literal(b'l').is_some());
    let digits = text.bytes().rev().take_while(u8::is_ascii_digit).count() as u32;
    let number_only = repeats.is_some() && digits > 4;
    (number, if number_only { Span::new(span.end - 4, span.end) } else { whole })
}

/// What the name at a byte is, and its bytes.
pub fn name_at(doc: Doc<'_>, offset: u32) -> Option<(Name, Span)> {
    let line = doc.line_at(offset)?;
    let subs = if line.chunk.scan.controls.is_empty() { Vec::new() } else { subs(doc) };
    let one = one_line(doc, &line, &subs);
    let touches = |o: &Occurrence| o.span.start <= offset && offset <= o.span.end;
    let found = one.iter().find(|(_, o)| touches(o)).or_else(|| {
        // The sign, the letter and the brackets around it belong to it.
        one.iter().find(|(n, o)| {
            let around = if matches!(n, Name::Parameter(Parameter::Named(_)) | Name::Sub(Label::Named(_)) | Name::Block(Label::Named(_), ..)) { 2 } else { 1 };
            o.span.start.saturating_sub(around) <= offset && offset <= o.span.end
        })
    })?;
    Some((found.0.clone(), found.1.span))
}

/// Names of one line.
fn one_line(doc: Doc<'_>, line: &LineOf<'_>, subs: &[Sub]) -> Vec<(Name, Occurrence)> {
    // Only the line's own text is looked at: a scan of it alone gives the same tables.
    let text = line.text();
    let scan = gr_gcode::scan(text, doc.dialect);
    let file = gr_gcode::File::new("", vec![gr_gcode::Chunk { text: text.into(), scan: std::sync::Arc::new(scan) }]);
    let alone = Doc { file: &file, dialect: doc.dialect };
    let start = line.span().start;
    let (from, to) = scope(subs, line.line, doc.count());
    all(alone, 0..1, &[])
        .into_iter()
        .map(|(name, o, _)| {
            let name = if let Name::Block(label, ..) = name { Name::Block(label, from, to) } else { name };
            (name, Occurrence { span: o.span.shifted(start), role: o.role })
        })
        .collect()
}

/// Where a name occurs in a file. `line` is where it was asked for: local names stay within their subroutine.
pub fn occurrences(doc: Doc<'_>, name: &Name, line: Option<u32>) -> Vec<Occurrence> {
    let subs = subs(doc);
    let local = match name {
        Name::Parameter(p) => is_local(p),
        // Each program of a Fanuc control has block numbers of its own.
        Name::Line(n) => doc.dialect.family == gr_spec::Family::Fanuc && !line.is_some_and(|l| returns(doc, &subs, l, *n)),
        _ => false,
    };
    let (from, to) = match (name, line) {
        (Name::Block(_, from, to), _) => (*from, *to),
        (_, Some(line)) if local => scope(&subs, line, doc.count()),
        _ => (0, doc.count()),
    };
    let words = matches!(name, Name::Line(_) | Name::Tool(_) | Name::Sub(Label::Number(_)));
    let mut found = if words { all(doc, from..to, &subs) } else { all_but_words(doc, from..to, &subs) };
    found.retain(|(n, _, at)| n == name && (!local || line.is_none() || scope(&subs, *at, doc.count()) == (from, to)));
    if let (true, Name::Line(n)) = (local, name) {
        found.retain(|(_, o, at)| o.role != Role::Read || !returns(doc, &subs, *at, *n));
    }
    found.into_iter().map(|(_, o, _)| o).collect()
}

fn all_but_words(doc: Doc<'_>, lines: Range<u32>, subs: &[Sub]) -> Vec<(Name, Occurrence, u32)> {
    let count = doc.count();
    let mut found = Vec::new();
    for (symbols, first, base) in tables(doc) {
        let fits = |line: u32| lines.contains(&(line + first));
        for s in symbols.statements.iter().filter(|s| fits(s.line)) {
            statement(doc, s.what.keyword, &s.what.label, s.line + first, s.span.shifted(base), subs, count, &mut found);
        }
        for (list, role) in [(&symbols.reads, Role::Read), (&symbols.writes, Role::Write)] {
            for s in list.iter().filter(|s| fits(s.line)) {
                let Some(of) = doc.line(s.line + first) else { continue };
                found.extend(parameter(&of, &s.what, s.span.shifted(base), role));
            }
        }
    }
    found.sort_by_key(|(_, o, _)| o.span);
    found
}

/// `#1` … `#30` and names without `_` belong to the subroutine they stand in.
pub fn is_local(p: &Parameter) -> bool {
    match p {
        Parameter::Number(n) => (1..=30).contains(n),
        Parameter::Named(n) => !n.starts_with('_'),
    }
}

/// Where a name is defined; for parameters, the setting that the value at a line comes from, or all that it may come from.
pub fn definitions(doc: Doc<'_>, name: &Name, line: Option<u32>) -> Vec<Span> {
    if let Name::Parameter(p) = name {
        let all = writes(doc, name, line);
        let last = line.and_then(|line| last_write(doc, p, line)).filter(|w| w.certain);
        let on = |w: LastWrite| all.iter().rev().find(|s| doc.line_at(s.start).is_some_and(|l| l.line == w.line)).copied();
        return match last.and_then(on) {
            Some(span) => vec![span],
            None => all,
        };
    }
    let found = occurrences(doc, name, line);
    found.iter().filter(|o| o.role == Role::Definition).map(|o| o.span).collect()
}

/// Why a name can't have another one at all.
pub fn fixed(name: &Name) -> Option<String> {
    match name {
        Name::Parameter(Parameter::Number(n)) if !is_free(*n) => Some(format!("#{n} is the controller's own")),
        Name::Parameter(Parameter::Named(n)) if is_predefined(n) => Some(format!("#<{n}> is the controller's own")),
        Name::Sub(Label::Dynamic) | Name::Block(Label::Dynamic, ..) => Some("a computed label can't be renamed".into()),
        Name::Tool(_) => Some("a tool's number stands in the tool table".into()),
        _ => None,
    }
}

/// Numbered parameters that programs may use as they like: those behind them mean something to the controller.
fn is_free(n: u32) -> bool {
    (1..=5000).contains(&n)
}

/// Known to the controller: `#<_x>`, `#<_ini[…]…>`, `#<_hal[…]>`.
fn is_predefined(name: &str) -> bool {
    let bare: String = name.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_lowercase();
    bare.starts_with("_ini[") || bare.starts_with("_hal[") || gr_spec::parameter(&bare).is_some_and(|d| !d.name.is_empty())
}

/// Whether a name can be renamed, and to this. `Err` says why not.
pub fn check_new_name(name: &Name, new: &str) -> Result<String, String> {
    if let Some(why) = fixed(name) {
        return Err(why);
    }
    let new = new.trim();
    let number = |text: &str, low: u64, high: u64, what: &str| match text.parse::<u64>() {
        Ok(n) if (low..=high).contains(&n) => Ok(n.to_string()),
        _ => Err(format!("{what} is a whole number from {low} to {high}")),
    };
    match name {
        Name::Parameter(Parameter::Number(n)) => {
            let bare = new.trim_start_matches('#');
            if is_local(&Parameter::Number(*n)) { number(bare, 1, 30, "a parameter of this subroutine alone") } else { number(bare, 31, 5000, "a numbered parameter for all subroutines") }
        }
        Name::Line(_) => number(new.trim_start_matches(['N', 'n']), 0, 999_999_999, "a line number"),
        Name::Sub(Label::Number(_)) | Name::Block(Label::Number(_), ..) => number(new.trim_start_matches(['O', 'o']), 0, 999_999_999, "this label"),
        Name::Parameter(Parameter::Named(old)) => {
            let new = plain_name(new)?;
            if is_predefined(&new) {
                return Err(format!("#<{new}> is the controller's own"));
            }
            match (old.starts_with('_'), new.starts_with('_')) {
                (true, false) => Err("the name of a parameter for all subroutines begins with _".into()),
                (false, true) => Err("a name that begins with _ would be the same in all subroutines".into()),
                _ => Ok(new),
            }
        }
        Name::Sub(_) | Name::Block(..) => plain_name(new),
        Name::Tool(_) => Err("a tool's number stands in the tool table".into()),
    }
}

/// What speaks against a new name in one of the files it concerns. `line`: where it was asked for, in that file alone.
pub fn objection(doc: Doc<'_>, name: &Name, line: Option<u32>) -> Option<String> {
    let numbered = matches!(name, Name::Parameter(Parameter::Number(_)));
    let label = matches!(name, Name::Sub(Label::Number(_)) | Name::Block(Label::Number(_), ..));
    for (symbols, first, _) in tables(doc) {
        if numbered && (symbols.reads_dynamic || symbols.writes_dynamic) {
            return Some("a parameter whose number is computed may be this one".into());
        }
        let computed = |s: &&gr_gcode::Symbol<gr_gcode::Statement>| {
            let jump = matches!(s.what.keyword, Keyword::MacroGoto | Keyword::MacroIfGoto);
            s.what.label == Label::Dynamic && if jump { matches!(name, Name::Line(_)) } else { label && s.what.keyword != Keyword::MacroIfThen }
        };
        if let Some(s) = symbols.statements.iter().find(computed) {
            return Some(format!("the number computed in line {} may be this one", s.line + first + 1));
        }
    }
    let computed_call = || doc.lines(0..doc.count()).find(|l| {
        let named = NamedBy::of(l, doc.dialect);
        let by_value = |letter| l.words().iter().any(|w| w.letter == letter && w.form == Form::Expr);
        named.calls && by_value(b'p') && label || (named.jumps && by_value(b'p') || named.contour && (by_value(b'p') || by_value(b'q'))) && matches!(name, Name::Line(_))
    });
    if label || matches!(name, Name::Line(_)) {
        if let Some(l) = computed_call() {
            return Some(format!("the number computed in line {} may be this one", l.line + 1));
        }
    }
    if let Name::Line(number) = name
        && doc.dialect.family == gr_spec::Family::Fanuc
    {
        let subs = subs(doc);
        let mut all = all(doc, 0..doc.count(), &subs).into_iter();
        let back = all.find(|(n, o, at)| n == name && o.role == Role::Read && returns(doc, &subs, *at, *number));
        if let Some((.., at)) = back {
            return Some(format!("M99 in line {} may jump to it", at + 1));
        }
    }
    match (name, line) {
        (Name::Parameter(p @ Parameter::Number(_)), Some(line)) if is_local(p) => argument(doc, name, line),
        _ => None,
    }
}

/// Numbered parameters up to 30 are what a subroutine is called with.
fn argument(doc: Doc<'_>, name: &Name, line: u32) -> Option<String> {
    let fanuc = doc.dialect.family == gr_spec::Family::Fanuc;
    if fanuc && !calls(doc).is_empty() {
        return Some("subprograms may use the same parameter".into());
    }
    let inside = subs(doc).iter().any(|s| (s.first..=s.last).contains(&line));
    let first = occurrences(doc, name, Some(line)).into_iter().next()?;
    (inside && first.role == Role::Read).then(|| "it is what the subroutine is called with".to_string())
}

fn plain_name(new: &str) -> Result<String, String> {
    let inside = new.trim_start_matches(['#', 'o', 'O']).strip_prefix('<').and_then(|n| n.strip_suffix('>')).unwrap_or(new);
    let good = !inside.is_empty() && inside.chars().all(|c| c.is_ascii_graphic() && !matches!(c, '<' | '>' | '#' | '(' | ')' | ';' | '[' | ']'));
    if good { Ok(inside.to_string()) } else { Err("a name has letters, digits and _".into()) }
}

/// How a new name is written where the old one stands: O0002 of a Fanuc control keeps its four digits, and in `M98 P20002` it
/// has to.
pub fn spelled(name: &Name, dialect: &gr_spec::Dialect, old: Span, new: &str) -> String {
    let padded = dialect.family == gr_spec::Family::Fanuc && matches!(name, Name::Sub(Label::Number(_)));
    let width = if padded { old.range().len().min(4) } else { 0 };
    format!("{new:0>width$}")
}

/// The name of the same kind with other letters or digits.
pub fn renamed(name: &Name, new: &str) -> Name {
    let lower: Box<str> = new.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_lowercase().into();
    let digits = new.parse::<i64>().ok();
    match name {
        Name::Sub(Label::Named(_)) => Name::Sub(Label::Named(lower)),
        Name::Block(Label::Named(_), a, b) => Name::Block(Label::Named(lower), *a, *b),
        Name::Parameter(Parameter::Named(_)) => Name::Parameter(Parameter::Named(lower)),
        Name::Sub(_) => Name::Sub(Label::Number(digits.unwrap_or(-1))),
        Name::Block(_, a, b) => Name::Block(Label::Number(digits.unwrap_or(-1)), *a, *b),
        Name::Parameter(_) => Name::Parameter(Parameter::Number(digits.unwrap_or(0) as u32)),
        Name::Line(_) => Name::Line(digits.unwrap_or(-1)),
        Name::Tool(_) => Name::Tool(digits.unwrap_or(-1)),
    }
}

/// Whether a name of this kind stands already under the new name in the file.
pub fn is_taken(doc: Doc<'_>, name: &Name, line: Option<u32>, new: &str) -> bool {
    let other = renamed(name, new);
    if other == *name {
        return false;
    }
    // Labels of subroutines, branches and loops are told apart by the word behind them alone.
    let label = match &other {
        Name::Sub(label) | Name::Block(label, ..) => Some(label),
        _ => None,
    };
    let labelled = label.is_some_and(|label| tables(doc).any(|(t, ..)| t.statements.iter().any(|s| s.what.label == *label && !is_macro(s.what.keyword))));
    labelled && matches!(name, Name::Sub(_)) || (labelled && subs(doc).iter().any(|s| Some(&s.label) == label)) || !occurrences(doc, &other, line).is_empty()
}

fn is_macro(k: Keyword) -> bool {
    matches!(k, Keyword::MacroIfGoto | Keyword::MacroIfThen | Keyword::MacroGoto | Keyword::MacroWhile | Keyword::MacroDo | Keyword::MacroEnd)
}

/// Labels that are edited together: those of the same branch, loop or subroutine in this file that are spelled as the
/// one at the cursor is.
pub fn linked(doc: Doc<'_>, offset: u32) -> Vec<Span> {
    let text = |s: Span| {
        let line = doc.line_at(s.start)?;
        let start = line.span().start;
        line.text().get((s.start - start) as usize..(s.end - start) as usize)
    };
    match name_at(doc, offset) {
        Some((name @ (Name::Block(..) | Name::Sub(_)), _)) => {
            let all: Vec<Span> = occurrences(doc, &name, None).into_iter().map(|o| o.span).collect();
            // At the `o` before a number the editor has nothing of the name to change.
            let here = all.iter().find(|s| s.start <= offset && offset <= s.end).and_then(|s| text(*s));
            all.into_iter().filter(|s| here.is_some() && text(*s) == here).collect()
        }
        _ => Vec::new(),
    }
}

/// A call of a subroutine.
#[derive(Clone, Debug, PartialEq)]
pub struct CallSite {
    /// What is called.
    pub label: Label,
    /// The label's bytes.
    pub span: Span,
    /// Line.
    pub line: u32,
    /// Index of the calling subroutine in [`subs`]; none = the main program.
    pub from: Option<usize>,
}

/// All calls of a file.
pub fn calls(doc: Doc<'_>) -> Vec<CallSite> {
    let subs = subs(doc);
    let mut found = Vec::new();
    let mut take = |label: Label, span: Span, line: u32| {
        let from = subs.iter().position(|s| (s.first..=s.last).contains(&line) && s.last > s.first);
        found.push(CallSite { label, span, line, from });
    };
    for (c, chunk) in doc.file.chunks.iter().enumerate().filter(|(_, c)| !c.scan.controls.is_empty()) {
        let (first, base) = (doc.file.first_lines[c], doc.file.starts[c]);
        for s in gr_gcode::symbols(&chunk.text, &chunk.scan).statements {
            if s.what.keyword == Keyword::Call && s.what.label != Label::Dynamic {
                let line = s.line + first;
                take(s.what.label, label_span(doc, line, s.span.shifted(base)), line);
            }
        }
    }
    let numbers: &[&[u8]] = if doc.dialect.family == gr_spec::Family::Fanuc { &[b"98", b"65", b"66"] } else { &[b"98", b"7"] };
    let some = |text: &str| numbers.iter().any(|n| memchr::memmem::find(text.as_bytes(), n).is_some());
    for chunk in doc.file.chunks.iter().enumerate().filter(|(_, c)| some(&c.text)) {
        let first = doc.file.first_lines[chunk.0];
        for line in doc.lines(first..first + chunk.1.scan.lines.len() as u32) {
            let named = NamedBy::of(&line, doc.dialect);
            let letter = match (named.calls, named.profile) {
                (true, _) => b'p',
                (_, true) => b'q',
                _ => continue,
            };
            if let Some(w) = line.literal(letter) {
                let (number, span) = if letter == b'p' { called(doc, &line, w) } else { (w.value as i64, number_of(&line, w)) };
                take(Label::Number(number), span, line.line);
            }
        }
    }
    found.sort_by_key(|c| c.span);
    found
}

/// Whether a file calls subroutines whose number is computed.
pub fn calls_by_value(doc: Doc<'_>) -> bool {
    let computed = tables(doc).any(|(t, ..)| t.statements.iter().any(|s| s.what.keyword == Keyword::Call && s.what.label == Label::Dynamic));
    let by_value = |l: &LineOf<'_>| l.words().iter().any(|w| w.letter == b'p' && w.form == Form::Expr) && NamedBy::of(l, doc.dialect).calls;
    computed || doc.file.chunks.iter().any(|c| !c.scan.nodes.is_empty()) && doc.lines(0..doc.count()).any(|l| by_value(&l))
}

/// A setting that the value of a parameter may come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastWrite {
    /// Its line.
    pub line: u32,
    /// The program runs straight through: it is this one. Else it is the only setting of the program, and it is this one
    /// when it is carried out and the value is still the one it gave.
    pub certain: bool,
}

/// The setting that the value of a parameter at a line comes from, as far as the text tells it.
pub fn last_write(doc: Doc<'_>, p: &Parameter, line: u32) -> Option<LastWrite> {
    let name = Name::Parameter(p.clone());
    if fixed(&name).is_some() {
        return None;
    }
    let computed = tables(doc).any(|(t, ..)| t.writes_dynamic);
    let places: Vec<LineOf<'_>> = writes(doc, &name, Some(line)).iter().filter_map(|s| doc.line_at(s.start)).collect();
    let skipped = places.iter().any(|l| l.chunk.scan.lines.get(l.at as usize).is_some_and(|l| l.deleted));
    if skipped || (computed && matches!(p, Parameter::Number(_))) {
        return None;
    }
    let last = places.iter().rev().map(|l| l.line).find(|l| *l < line)?;
    if is_straight(doc) {
        return Some(LastWrite { line: last, certain: true });
    }
    let own: Vec<Label> = subs(doc).into_iter().map(|s| s.label).collect();
    let elsewhere = !is_local(p) && (calls_by_value(doc) || calls(doc).iter().any(|c| !own.contains(&c.label)));
    (places.len() == 1 && !elsewhere).then_some(LastWrite { line: last, certain: false })
}

/// No branches, loops, jumps, calls.
fn is_straight(doc: Doc<'_>) -> bool {
    doc.file.chunks.iter().all(|c| c.scan.controls.is_empty()) && calls(doc).is_empty()
}

fn writes(doc: Doc<'_>, name: &Name, line: Option<u32>) -> Vec<Span> {
    occurrences(doc, name, line).iter().filter(|o| o.role == Role::Write).map(|o| o.span).collect()
}
