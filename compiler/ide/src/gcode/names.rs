//! Names of a G-code file: subroutines, blocks of control flow, parameters, line numbers. Where each is defined, set
//! and used, and what renaming changes.

use std::ops::Range;

use gr_gcode::{Form, Keyword, Label, Parameter, Symbols, Word};
use gr_text::Span;

use super::doc::{Doc, LineOf};
use crate::{Edit, Occurrence, Role};

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
                    found.push(Sub { label: s.what.label.clone(), first: line, last: line, span });
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
                let span = parameter_span(&of, s.span.shifted(base));
                found.push((Name::Parameter(s.what.clone()), Occurrence { span, role }, line));
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

/// The name or number of `#<name>`, `#12` or `#12=…`.
fn parameter_span(line: &LineOf<'_>, span: Span) -> Span {
    let text = line.slice(span);
    // The name follows the sign at once; a value may hold others.
    let open = text.find(|c: char| c != '#' && c != ' ' && c != '\t').filter(|at| text[*at..].starts_with('<'));
    if let Some(open) = open {
        let close = text[open..].find('>').map_or(text.len(), |c| open + c);
        return Span::new(span.start + open as u32 + 1, span.start + close as u32);
    }
    let lead = text.bytes().take_while(|b| !b.is_ascii_digit()).count();
    let digits = text.bytes().skip(lead).take_while(u8::is_ascii_digit).count();
    Span::new(span.start + lead as u32, span.start + (lead + digits) as u32)
}

/// N words, tools, `M98 P`.
fn plain_words(doc: Doc<'_>, lines: Range<u32>, found: &mut Vec<(Name, Occurrence, u32)>) {
    for line in doc.lines(lines) {
        let calls = line.has_code(b'm', 980);
        let jumps = line.has_code(b'm', 990);
        for w in line.words().iter().filter(|w| w.form == Form::Literal) {
            let name = match w.letter {
                b'n' => (Name::Line(w.value as i64), Role::Definition),
                b't' => (Name::Tool(w.value as i64), Role::Read),
                b'p' if calls => {
                    let (number, span) = called(doc, &line, w);
                    found.push((Name::Sub(Label::Number(number)), Occurrence { span, role: Role::Read }, line.line));
                    continue;
                }
                b'p' if jumps => (Name::Line(w.value as i64), Role::Read),
                _ => continue,
            };
            let span = line.tight(w);
            let text = line.slice(span);
            let lead = 1 + text[1..].len() as u32 - text[1..].trim_start().len() as u32;
            found.push((name.0, Occurrence { span: Span::new(span.start + lead, span.end), role: name.1 }, line.line));
        }
    }
}

/// The program that P of an M98 names, and its digits.
fn called(doc: Doc<'_>, line: &LineOf<'_>, p: &Word) -> (i64, Span) {
    let span = line.tight(p);
    let text = line.slice(span);
    let lead = 1 + text[1..].len() as u32 - text[1..].trim_start().len() as u32;
    let whole = Span::new(span.start + lead, span.end);
    if doc.dialect.family != gr_spec::Family::Fanuc {
        return (p.value as i64, whole);
    }
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
    let (from, to) = match (name, line) {
        (Name::Block(_, from, to), _) => (*from, *to),
        (Name::Parameter(p), Some(line)) if is_local(p) => scope(&subs, line, doc.count()),
        _ => (0, doc.count()),
    };
    let words = matches!(name, Name::Line(_) | Name::Tool(_) | Name::Sub(Label::Number(_)));
    let mut found = if words { all(doc, from..to, &subs) } else { all_but_words(doc, from..to, &subs) };
    let local = matches!(name, Name::Parameter(p) if is_local(p)) && line.is_some();
    found.retain(|(n, _, at)| n == name && (!local || scope(&subs, *at, doc.count()) == (from, to)));
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
                let span = parameter_span(&of, s.span.shifted(base));
                found.push((Name::Parameter(s.what.clone()), Occurrence { span, role }, s.line + first));
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

/// Where a name is defined; for parameters, the last setting before a line, or the first one.
pub fn definitions(doc: Doc<'_>, name: &Name, line: Option<u32>) -> Vec<Span> {
    let found = occurrences(doc, name, line);
    if matches!(name, Name::Parameter(_)) {
        let writes: Vec<Span> = found.iter().filter(|o| o.role == Role::Write).map(|o| o.span).collect();
        let limit = line.and_then(|l| doc.line(l)).map_or(u32::MAX, |l| l.span().start);
        let before = writes.iter().rev().find(|s| s.start < limit);
        return before.or(writes.first()).copied().into_iter().collect();
    }
    found.iter().filter(|o| o.role == Role::Definition).map(|o| o.span).collect()
}

/// Whether a name can be renamed, and to this. `Err` says why not.
pub fn check_new_name(name: &Name, new: &str) -> Result<String, String> {
    let new = new.trim();
    let number = |low: u64, high: u64, what: &str| match new.parse::<u64>() {
        Ok(n) if (low..=high).contains(&n) => Ok(n.to_string()),
        _ => Err(format!("{what} is a whole number from {low} to {high}")),
    };
    match name {
        Name::Parameter(Parameter::Number(_)) => number(1, 5602, "a numbered parameter"),
        Name::Line(_) => number(0, 999_999_999, "a line number"),
        Name::Tool(_) => number(0, 999_999, "a tool"),
        Name::Sub(Label::Number(_)) | Name::Block(Label::Number(_), ..) => number(0, 999_999_999, "this label"),
        Name::Sub(Label::Dynamic) | Name::Block(Label::Dynamic, ..) => Err("a computed label can't be renamed".into()),
        Name::Parameter(Parameter::Named(old)) => {
            if gr_spec::parameter(old).is_some() {
                return Err(format!("#<{old}> is the controller's own"));
            }
            plain_name(new)
        }
        Name::Sub(Label::Named(_)) | Name::Block(Label::Named(_), ..) => plain_name(new),
    }
}

fn plain_name(new: &str) -> Result<String, String> {
    let inside = new.trim_start_matches(['#', 'o', 'O']).strip_prefix('<').and_then(|n| n.strip_suffix('>')).unwrap_or(new);
    let good = !inside.is_empty() && inside.chars().all(|c| c.is_ascii_graphic() && !matches!(c, '<' | '>' | '#' | '(' | ')' | ';' | '[' | ']'));
    if good { Ok(inside.to_string()) } else { Err("a name has letters, digits and _".into()) }
}

/// Edits that rename a name in one file. `new` was checked.
pub fn rename(doc: Doc<'_>, name: &Name, line: Option<u32>, new: &str) -> Vec<Edit> {
    occurrences(doc, name, line).into_iter().map(|o| Edit { span: o.span, text: new.to_string() }).collect()
}

/// Whether a name of this kind stands already under the new name in the file.
pub fn is_taken(doc: Doc<'_>, name: &Name, line: Option<u32>, new: &str) -> bool {
    let lower: Box<str> = new.to_lowercase().into();
    let digits = new.parse::<i64>().ok();
    let other = match name {
        Name::Sub(Label::Named(_)) => Name::Sub(Label::Named(lower)),
        Name::Block(Label::Named(_), a, b) => Name::Block(Label::Named(lower), *a, *b),
        Name::Parameter(Parameter::Named(_)) => Name::Parameter(Parameter::Named(lower)),
        Name::Sub(_) => Name::Sub(Label::Number(digits.unwrap_or(-1))),
        Name::Block(_, a, b) => Name::Block(Label::Number(digits.unwrap_or(-1)), *a, *b),
        Name::Parameter(_) => Name::Parameter(Parameter::Number(digits.unwrap_or(0) as u32)),
        Name::Line(_) => Name::Line(digits.unwrap_or(-1)),
        Name::Tool(_) => return false,
    };
    other != *name && !occurrences(doc, &other, line).is_empty()
}

/// Labels that are edited together: those of the same branch, loop or subroutine in this file.
pub fn linked(doc: Doc<'_>, offset: u32) -> Vec<Span> {
    match name_at(doc, offset) {
        Some((name @ (Name::Block(..) | Name::Sub(_)), _)) => occurrences(doc, &name, None).into_iter().map(|o| o.span).collect(),
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
    for chunk in doc.file.chunks.iter().enumerate().filter(|(_, c)| memchr::memmem::find(c.text.as_bytes(), b"98").is_some()) {
        let first = doc.file.first_lines[chunk.0];
        for line in doc.lines(first..first + chunk.1.scan.lines.len() as u32).filter(|l| l.has_code(b'm', 980)) {
            if let Some(p) = line.literal(b'p') {
                let (number, span) = called(doc, &line, p);
                take(Label::Number(number), span, line.line);
            }
        }
    }
    found.sort_by_key(|c| c.span);
    found
}

/// The last setting of a parameter before a line: its line.
pub fn last_write(doc: Doc<'_>, p: &Parameter, line: u32) -> Option<u32> {
    let at = definitions(doc, &Name::Parameter(p.clone()), Some(line)).first()?.start;
    let found = doc.line_at(at)?.line;
    (found < line).then_some(found)
}
