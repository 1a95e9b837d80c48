//! Control flow: O-words, calls, loops, M98/M99, macro statements.
//!
//! The controller has no parser for structure: it executes the words of loops and branches as they come, keeps a
//! table of the labels it met, and *skips* forward until a line with the right label turns up. This is done
//! here just the same, except that skipping goes from one control line to the next through an index.

use std::sync::Arc;

use gr_canon::{FileId, FrameId, Sink, Version};
use gr_gcode::{Control, Form, Keyword, LineKind, OLabel, Scan, Word};
use gr_spec::{Rs274, code, rs274};
use gr_text::Span;
use rustc_hash::FxHashMap;

use crate::eval::{not_whole, to_int, whole};
use crate::run::{Flow, Place};
use crate::state::SavedModes;
use crate::{Fault, Interp, Res};

/// Number of subroutine parameters.
pub(crate) const ARGS: usize = 30;
/// Call levels, the main program counted.
const LEVELS: usize = 10;

/// Names as numbers.
#[derive(Default)]
pub(crate) struct Symbols {
    map: FxHashMap<Box<str>, u32>,
    names: Vec<Box<str>>,
    numbers: FxHashMap<i32, u32>,
}

impl Symbols {
    pub fn of(&mut self, name: &str) -> u32 {
        if let Some(id) = self.map.get(name) {
            return *id;
        }
        let id = self.names.len() as u32;
        self.names.push(name.into());
        self.map.insert(name.into(), id);
        id
    }
    /// A name that is a number: loops ask for the same ones all the time.
    pub fn of_number(&mut self, number: i32) -> u32 {
        if let Some(id) = self.numbers.get(&number) {
            return *id;
        }
        let id = self.of(&number.to_string());
        self.numbers.insert(number, id);
        id
    }
    pub fn name(&self, id: u32) -> &str {
        self.names.get(id as usize).map_or("", |n| n)
    }
}

/// Labels of subroutines and calls.
const GLOBAL: u32 = u32::MAX;
/// Labels of loops and branches in the main program.
const MAIN: u32 = u32::MAX - 1;

/// A label: the subroutine it belongs to, and its name.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Label {
    pub scope: u32,
    pub name: u32,
}

impl Label {
    /// It belongs to a subroutine, not to the main program or to all.
    pub fn is_subroutine_scope(&self) -> bool {
        self.scope < MAIN
    }
}

/// Where a label was met first.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Offset {
    keyword: Keyword,
    file: FileId,
    line: u32,
    /// The controller's line number of the line before.
    sequence: i32,
    shift: i32,
    repeats: i32,
}

impl Offset {
    pub fn file(&self) -> FileId {
        self.file
    }
    pub fn line_mut(&mut self) -> &mut u32 {
        &mut self.line
    }
    /// With the controller's line number counted from the line.
    pub fn relative(self) -> Offset {
        Offset { sequence: self.sequence.wrapping_sub(self.line as i32), ..self }
    }
    /// Back from [`Offset::relative`].
    pub fn absolute(self) -> Offset {
        Offset { sequence: self.sequence.wrapping_add(self.line as i32), ..self }
    }
}

/// Skipping to a label.
#[derive(Clone, Debug)]
pub(crate) struct Skip {
    pub label: Label,
    /// To the start of a subroutine.
    pub to_sub: bool,
    /// Line number where it began.
    pub start: i32,
    /// The block that began it.
    pub from: Option<Place>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum CallKind {
    None,
    Oword,
    M98,
    Remap,
}

/// Where a call comes back to.
#[derive(Clone, Debug)]
pub(crate) struct Return {
    pub place: Place,
    pub next: u32,
    pub shift: i32,
    /// Its parameters #1 … #30 come back too.
    pub params: bool,
    loops: usize,
}

/// One level of the call stack.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    pub sub: u32,
    pub kind: CallKind,
    /// Set while a call from this level is going on.
    pub ret: Option<Return>,
    /// #1 … #30 before the last call with arguments from this level. They stay: after an error the controller takes
    /// them back even when they are not those of the call that failed.
    pub kept: Option<Box<[f64; ARGS]>>,
    pub m98_left: i32,
    pub saved: Option<Box<SavedModes>>,
    pub saved_valid: bool,
    pub restore: bool,
}

impl Level {
    pub fn new(sub: u32) -> Level {
        Level { sub, kind: CallKind::None, ret: None, kept: None, m98_left: -1, saved: None, saved_valid: false, restore: false }
    }
}

/// A loop that is going on.
#[derive(Clone, Debug)]
pub(crate) struct Loop {
    label: Label,
    level: usize,
    parent: FrameId,
    pass: u64,
}

/// Lines of a file that skipping must look at, and block numbers.
#[derive(Debug, Default)]
pub(crate) struct FileIndex {
    lines: Vec<u32>,
    numbers: FxHashMap<i64, u32>,
}

/// Which of M98 and M99 a line is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Fanuc {
    M98,
    M99,
}

fn op_name(keyword: Keyword) -> &'static str {
    match keyword {
        Keyword::Sub => "sub",
        Keyword::Endsub => "endsub",
        Keyword::Call => "call",
        Keyword::Do => "do",
        Keyword::While => "while",
        Keyword::If => "if",
        Keyword::Elseif => "elseif",
        Keyword::Else => "else",
        Keyword::Endif => "endif",
        Keyword::Break => "break",
        Keyword::Continue => "continue",
        Keyword::Endwhile => "endwhile",
        Keyword::Return => "return",
        Keyword::Repeat => "repeat",
        Keyword::Endrepeat => "endrepeat",
        _ => "",
    }
}

fn first_real(words: &[Word]) -> Option<&Word> {
    if words.first().is_some_and(|w| w.letter == b'n') { words.get(1) } else { words.first() }
}

/// Whether skipping must look at a line: it may be the end of what is skipped, or an error.
pub fn is_stop(scan: &Scan, line: u32) -> bool {
    let Some(at) = scan.lines.get(line as usize) else { return false };
    let control = first_real(scan.words(line)).is_some_and(|w| {
        w.letter == b'o' || (w.letter == b'm' && w.form == Form::Literal && (w.value == 98.0 || w.value == 99.0))
    });
    control || at.kind == LineKind::Percent || at.faulty
}

/// A line that may begin or end a subroutine, a loop or a branch.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Statement {
    keyword: Keyword,
    /// As written, in lower case.
    label: Box<str>,
    /// Line.
    pub line: u32,
    /// Relative to the start of the line.
    span: Span,
}

impl Statement {
    /// The same on a line further down.
    pub fn shifted(&self, by: u32) -> Statement {
        Statement { line: self.line + by, ..self.clone() }
    }
}

/// The statement on a line of a chunk.
pub fn statement(scan: &Scan, text: &str, line: u32) -> Option<Statement> {
    let word = first_real(scan.words(line)).filter(|w| w.form == Form::Control && w.letter == b'o')?;
    let control = scan.controls.get(word.index())?;
    let start = scan.lines.get(line as usize)?.start;
    let span = Span::new(control.span.start.saturating_sub(start), control.span.end.saturating_sub(start));
    let label = text.get(control.label_span.range()).unwrap_or("").to_ascii_lowercase().into();
    Some(Statement { keyword: control.keyword, label, line, span })
}

/// What the statements of a file open and never close.
pub fn unclosed(statements: impl IntoIterator<Item = Statement>, file: FileId, main: bool) -> Vec<crate::Finding> {
    let mut open: Vec<Statement> = Vec::new();
    for s in statements {
        match s.keyword {
            Keyword::If | Keyword::Repeat => open.push(s),
            // A file that is called may leave its `endsub` away and end with M2.
            Keyword::Sub if main => open.push(s),
            Keyword::While if closes(&mut open, Keyword::Do, &s.label) => {}
            Keyword::While | Keyword::Do => open.push(s),
            Keyword::Endsub => _ = closes(&mut open, Keyword::Sub, &s.label),
            Keyword::Endif => _ = closes(&mut open, Keyword::If, &s.label),
            Keyword::Endwhile => _ = closes(&mut open, Keyword::While, &s.label),
            Keyword::Endrepeat => _ = closes(&mut open, Keyword::Repeat, &s.label),
            _ => {}
        }
    }
    let finding = |s: Statement| {
        let fault = Fault::own(code::FLOW_UNCLOSED).arg(format!("{} {}", s.label, op_name(s.keyword)));
        crate::Finding { file, line: s.line, frame: FrameId::MAIN, fault, span: Some(s.span), text: "".into() }
    };
    open.into_iter().map(finding).collect()
}

fn base_name(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

fn structure(rs: Rs274, what: &str) -> Box<Fault> {
    Fault::new(code::SUB_STRUCTURE, rs).arg(what)
}

impl<S: Sink> Interp<'_, S> {
    /// The index of a file, made when it is first needed.
    fn index(&mut self, id: FileId) -> Arc<FileIndex> {
        if let Some(index) = self.opened.index.get(&id) {
            return index.clone();
        }
        let file = self.files.file(id);
        let mut index = FileIndex::default();
        for (c, chunk) in file.chunks.iter().enumerate() {
            let scan = &chunk.scan;
            for l in 0..scan.lines.len() {
                let at = file.first_lines[c] + l as u32;
                let words = scan.words(l as u32);
                if is_stop(scan, l as u32) {
                    index.lines.push(at);
                }
                if let Some(n) = words.first().filter(|w| w.letter == b'n' && w.form == Form::Literal) {
                    index.numbers.entry(n.value as i64).or_insert(at);
                }
            }
        }
        let index = Arc::new(index);
        self.opened.index.insert(id, index.clone());
        index
    }

    /// The next line from `line` on that skipping must look at; past the end if there is none.
    pub(crate) fn next_control(&mut self, line: u32) -> u32 {
        if let Some(found) = self.files.next_control(self.place.file, line) {
            return found;
        }
        let index = self.index(self.place.file);
        let at = index.lines.partition_point(|l| *l < line);
        index.lines.get(at).copied().unwrap_or(u32::MAX)
    }

    /// Whether the first word makes the line an M98 or M99 that works as an O-word.
    #[inline]
    pub(crate) fn fanuc_call(&self, first: Option<&Word>) -> Option<Fanuc> {
        let w = first?;
        if w.form != Form::Literal {
            return None;
        }
        match whole(w.value) {
            Some(98) => Some(Fanuc::M98),
            Some(99) if self.level() > 0 => Some(Fanuc::M99),
            _ => None,
        }
    }

    /// A line that begins with M98 or M99.
    pub(crate) fn fanuc_line(&mut self, scan: &Scan, words: &[Word], which: Fanuc) -> Res {
        self.count_control()?;
        let rest: Vec<Word> = first_real(words).map_or_else(Vec::new, |first| {
            words.iter().filter(|w| w.start > first.start).copied().collect()
        });
        if which == Fanuc::M99 {
            if self.config.no_fanuc_subs {
                return Err(structure(rs274::RT_M99_DISABLED, "M99 as end of a subroutine is switched off in the INI file"));
            }
            if self.defining_sub {
                return Err(structure(rs274::RT_M99_ENDSUB, "`o… endsub` is missing: M99 can't end an `o… sub`"));
            }
            let label = Label { scope: GLOBAL, name: self.levels[self.level()].sub };
            if self.skipping_past(label) {
                return Ok(());
            }
            self.return_value = 0.0;
            self.value_returned = false;
            if self.skip.as_ref().is_some_and(|s| s.to_sub) {
                return Ok(());
            }
            return self.convert_return(Keyword::MacroEnd, true);
        }
        if self.config.no_fanuc_subs {
            return Err(structure(rs274::RT_M98_DISABLED, "M98 is switched off in the INI file"));
        }
        let text = self.reading.text.clone();
        for w in &rest {
            self.read_word(scan, &text, w)?;
        }
        let Some(p) = self.block.get(b'p') else {
            return Err(Fault::new(code::WORD_MISSING, rs274::RT_M98_P).arg("M98").arg("P").at(b'm'));
        };
        let number = whole(p).ok_or_else(|| not_whole(p).at(b'p'))?;
        let name = self.symbols.of(&number.to_string());
        let label = Label { scope: GLOBAL, name };
        if self.skip.is_none() {
            self.m98 = true;
            let checked = self.enhance().and_then(|()| self.check());
            self.m98 = false;
            checked?;
        }
        if self.skipping_past(label) || self.skip.as_ref().is_some_and(|s| s.to_sub) || self.defining_sub {
            return Ok(());
        }
        let repeats = self.block.get(b'l').map(to_int);
        self.call(label, CallKind::M98, [0.0; ARGS], 0, repeats)
    }

    fn skipping_past(&self, label: Label) -> bool {
        self.skip.as_ref().is_some_and(|s| s.label != label)
    }

    /// The name of an O-word label.
    fn label_name(&mut self, scan: &Scan, label: OLabel) -> Res<u32> {
        match label {
            OLabel::Named(n) => Ok(self.symbols.of(scan.names.get(n as usize).map_or("", |n| n))),
            OLabel::Number(id) => {
                let value = self.eval(scan, id)?;
                let n = whole(value).ok_or_else(|| not_whole(value))?;
                Ok(self.symbols.of_number(n))
            }
            OLabel::None => Ok(self.symbols.of("")),
        }
    }

    fn local(&self, name: u32) -> Label {
        let scope = match (self.level(), self.sub_name) {
            (0, Some(sub)) if self.defining_sub => sub,
            (0, _) => MAIN,
            (level, _) => self.levels[level].sub,
        };
        Label { scope, name }
    }

    fn arg(&mut self, scan: &Scan, c: &Control, n: u32) -> Res<f64> {
        match scan.args.get((c.first_arg + n) as usize) {
            Some(id) if n < c.arg_count => self.eval(scan, *id),
            _ => Err(self.parse_fault(scan)),
        }
    }

    /// A line that begins with an O-word or a macro statement.
    pub(crate) fn control_line(&mut self, scan: &Scan, text: &str, line: u32, words: &[Word], word: &Word) -> Res {
        self.count_control()?;
        let control = match word.form {
            Form::Control => scan.controls.get(word.index()).copied(),
            _ => None,
        };
        let Some(c) = control else {
            return if self.defining_sub { Ok(()) } else { Err(self.parse_fault(scan)) };
        };
        if c.keyword == Keyword::Program && text.get(c.label_span.range()).is_some_and(|l| l.starts_with('<') && !l.ends_with('>')) {
            let mut doubt = Fault::own(code::OWORD_NAME_OPEN);
            doubt.span = Some(c.label_span);
            self.warn(doubt);
        }
        if is_macro(c.keyword) {
            return self.macro_line(scan, text, words, &c);
        }
        let name = self.label_name(scan, c.label)?;
        let faulty = scan.lines[line as usize].faulty;
        self.control(scan, &c, name, faulty).map_err(|mut f| {
            if f.span.is_none() && f.letter.is_none() {
                f.span = Some(Span::new(c.span.start, c.span.end));
            }
            f
        })
    }

    /// What the words of the line ask, read as the controller reads them, then carried out.
    fn control(&mut self, scan: &Scan, c: &Control, name: u32, faulty: bool) -> Res {
        let global = matches!(c.keyword, Keyword::Sub | Keyword::Program | Keyword::Endsub | Keyword::Call | Keyword::Return);
        let label = if global { Label { scope: GLOBAL, name } } else { self.local(name) };
        if c.keyword == Keyword::Program && self.config.no_fanuc_subs {
            return Err(structure(rs274::RT_O_DISABLED, "bare O-numbers are switched off in the INI file"));
        }
        match c.keyword {
            Keyword::Sub | Keyword::Program if self.defining_sub => {
                return Err(structure(rs274::RT_O_NESTED_SUB, "a subroutine is defined inside another one"));
            }
            Keyword::Sub | Keyword::Program => {}
            Keyword::Endsub | Keyword::Return => {
                if self.skipping_past(label) {
                    return Ok(());
                }
                // The expression may still read the value that the last call gave.
                let value = if c.arg_count > 0 { Some(self.arg(scan, c, 0)?) } else { None };
                (self.return_value, self.value_returned) = (value.unwrap_or(0.0), value.is_some());
            }
            _ if self.defining_sub => return Ok(()),
            Keyword::Call => {
                if self.skip.is_some() {
                    return Ok(());
                }
                if faulty {
                    return Err(self.parse_fault(scan));
                }
                let mut args = [0.0; ARGS];
                if c.arg_count as usize > ARGS {
                    return Err(Fault::new(code::SUB_LIMIT, rs274::RT_O_PARAMS).arg("a call takes at most thirty arguments"));
                }
                for (i, slot) in args.iter_mut().enumerate().take(c.arg_count as usize) {
                    *slot = self.arg(scan, c, i as u32)?;
                }
                return self.call(label, CallKind::Oword, args, c.arg_count, None);
            }
            Keyword::While | Keyword::Repeat | Keyword::If | Keyword::Elseif => {
                if self.skipping_past(label) {
                    return Ok(());
                }
                self.test_value = self.arg(scan, c, 0)?;
            }
            _ => {}
        }
        if self.skipping_past(label) {
            return Ok(());
        }
        if faulty && self.skip.is_none() {
            return Err(self.parse_fault(scan));
        }
        if self.skip.as_ref().is_some_and(|s| s.to_sub) && !matches!(c.keyword, Keyword::Sub | Keyword::Program) {
            return Ok(());
        }
        match c.keyword {
            Keyword::Sub | Keyword::Program => self.convert_sub(c.keyword, label),
            Keyword::Endsub | Keyword::Return => self.convert_return(c.keyword, false),
            Keyword::Do => {
                self.skip = None;
                if !self.offsets.contains_key(&label) {
                    self.save_offset(label, c.keyword)?;
                }
                self.enter_pass(label)
            }
            Keyword::While => self.convert_while(label),
            Keyword::Repeat => self.convert_repeat(label),
            Keyword::If => self.convert_if(label),
            Keyword::Elseif | Keyword::Else => self.convert_else(label, c.keyword),
            Keyword::Endif => {
                let at = self.expect_offset(label)?;
                if at.keyword != Keyword::If {
                    let name = self.full_name(label);
                    let fault = self.label_fault(rs274::RT_O_NO_ENDIF, label, "no `if` with this label");
                    let line = self.line_text().to_string();
                    return Err(with_args(fault, &[&self.sequence().to_string(), &name, op_name(at.keyword), &(at.sequence + 1).to_string(), &line]));
                }
                self.skip = None;
                self.executed_if = true;
                Ok(())
            }
            Keyword::Break | Keyword::Continue => self.convert_break(label, c.keyword),
            Keyword::Endwhile | Keyword::Endrepeat => self.convert_loop_end(label, c.keyword),
            _ => Ok(()),
        }
    }

    /// The label as the controller writes it.
    fn full_name(&self, label: Label) -> String {
        let name = self.symbols.name(label.name);
        match label.scope {
            GLOBAL => name.to_string(),
            MAIN => format!("#{name}"),
            sub => format!("{}#{name}", self.symbols.name(sub)),
        }
    }

    fn label_fault(&self, rs: Rs274, label: Label, what: &str) -> Box<Fault> {
        let name = self.symbols.name(label.name).to_string();
        Fault::new(code::FLOW_LABEL, rs).own_args(&[&name, what])
    }

    fn label_message(&self, rs: Rs274, label: Label, what: &str, found: Option<&Offset>) -> Box<Fault> {
        let mut args = vec![self.sequence().to_string(), self.line_text().to_string()];
        if let Some(at) = found {
            args.push(op_name(at.keyword).to_string());
            args.push((at.sequence + 1).to_string());
        }
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        with_args(self.label_fault(rs, label, what), &args)
    }

    fn expect_offset(&self, label: Label) -> Res<Offset> {
        self.offsets.get(&label).copied().ok_or_else(|| {
            self.label_message(rs274::RT_O_UNDEFINED_LABEL, label, "nothing begins with this label", None)
        })
    }

    fn save_offset(&mut self, label: Label, keyword: Keyword) -> Res {
        if let Some(at) = self.offsets.get(&label) {
            let name = self.full_name(label);
            let file = self.files.file(self.place.file).path.to_string();
            let other = self.files.file(at.file).path.to_string();
            let line = self.sequence().to_string();
            let same = self.sequence() - 1 == at.sequence;
            let what = if same { "the subroutine is defined where it can't be" } else { "it is defined twice" };
            let fault = self.label_fault(if same { rs274::RT_O_ILLEGAL_PLACE } else { rs274::RT_O_REDEFINED }, label, what);
            return Err(with_args(fault, &[&file, &line, &name, &other]));
        }
        let offset = Offset {
            keyword,
            file: self.place.file,
            line: self.place.line,
            sequence: self.sequence() - 1,
            shift: self.shift,
            repeats: -1,
        };
        self.offsets.insert(label, offset);
        Ok(())
    }

    fn skip_to(&mut self, label: Label) {
        self.skip = Some(Skip { label, to_sub: false, start: self.sequence(), from: Some(self.place) });
    }

    fn convert_sub(&mut self, keyword: Keyword, label: Label) -> Res {
        let kind = self.levels[self.level()].kind;
        if keyword == Keyword::Program && !matches!(kind, CallKind::M98 | CallKind::None) {
            return Err(structure(rs274::RT_O_FANUC_CALL, "a subroutine that begins with O and its number is called with M98"));
        }
        if keyword == Keyword::Sub && kind == CallKind::M98 {
            return Err(structure(rs274::RT_O_CALL_SUB, "a subroutine that begins with `o… sub` is called with `o… call`"));
        }
        if self.skip.is_some() {
            self.save_offset(label, keyword)?;
            self.skip = None;
        }
        if keyword == Keyword::Program {
            return Ok(());
        }
        if self.level() != 0 {
            let called = self.levels[self.level()].sub;
            // Only the called subroutine may begin here, says 2.10.
            if self.setup.version == Version::V2_10 && called != label.name {
                let (inner, outer) = (self.full_name(label), self.symbols.name(called).to_string());
                let fault = structure(rs274::RT_O_NESTED_CALLED, "a subroutine is defined inside another one");
                return Err(with_args(fault, &[&inner, &outer]));
            }
            return Ok(());
        }
        self.save_offset(label, keyword)?;
        self.skip_to(label);
        self.defining_sub = true;
        self.sub_name = Some(label.name);
        Ok(())
    }

    fn convert_return(&mut self, keyword: Keyword, m99: bool) -> Res {
        if self.level() == 0 && self.sub_name.is_none() && !self.came_back {
            let args = [self.sequence().to_string(), self.line_text().to_string()];
            let fault = structure(rs274::RT_O_NOT_IN_SUB_LINE, "").own_args(&["this ends a subroutine, but none has begun"]);
            return Err(with_args(fault, &[&args[0], &args[1]]));
        }
        let kind = self.levels[self.level()].kind;
        if kind == CallKind::M98 && !m99 {
            return Err(structure(rs274::RT_O_FANUC_END, "a subroutine called with M98 ends with M99"));
        }
        if kind == CallKind::Oword && m99 {
            return Err(structure(rs274::RT_O_SUB_END, "a subroutine called with `o… call` ends with `o… endsub`"));
        }
        if self.skip.is_some() && keyword == Keyword::Endsub {
            self.skip = None;
        }
        if self.level() == 0 {
            if keyword == Keyword::Endsub {
                if !self.defining_sub {
                    return Err(structure(rs274::RT_O_NOT_IN_SUB, "this ends a subroutine, but none has begun"));
                }
                self.skip = None;
                self.defining_sub = false;
                (self.sub_name, self.came_back) = (None, false);
            }
            return Ok(());
        }
        self.leave_call()
    }

    /// Back to the caller.
    fn leave_call(&mut self) -> Res {
        let level = self.level();
        let Some(left) = self.levels.pop() else { return Ok(()) };
        let Some(ret) = self.levels[level - 1].ret.take() else { return Ok(()) };
        if ret.params {
            self.take_back_params(level - 1);
        }
        self.place = ret.place;
        self.next = ret.next;
        self.shift = ret.shift;
        self.loops.truncate(ret.loops);
        self.flow = Flow::Jump;
        self.params.leave_level(level);
        let caller = self.levels[level - 1].sub;
        self.sub_name = (level > 1).then_some(caller);
        // The main program has a name too, an empty one, until an error takes it away.
        self.came_back = level == 1 && !self.main_unnamed;
        if left.restore && left.saved_valid {
            if let Some(saved) = &left.saved {
                self.restore_modes(saved)?;
            }
        }
        if left.kind == CallKind::Remap { self.remap_finished() } else { Ok(()) }
    }

    /// #1 … #30 as they were before the last call with arguments from this level, zeros if there was none.
    pub(crate) fn take_back_params(&mut self, level: usize) {
        let kept = self.levels.get(level).and_then(|l| l.kept.clone()).unwrap_or_else(|| Box::new([0.0; ARGS]));
        for (i, v) in kept.iter().enumerate() {
            self.write_param(i as u32 + 1, *v);
        }
    }

    /// Calls a subroutine.
    pub(crate) fn call(&mut self, label: Label, kind: CallKind, args: [f64; ARGS], count: u32, repeats: Option<i32>) -> Res {
        let level = self.level();
        if level + 1 >= LEVELS {
            return Err(Fault::new(code::SUB_LIMIT, rs274::RT_O_LEVELS).arg("subroutines call each other too deeply"));
        }
        if kind == CallKind::M98 && repeats == Some(0) {
            // The controller makes the new level but stays here: what follows runs inside it until M99.
            return self.call_nothing(label);
        }
        let mut next = self.next;
        if let (CallKind::M98, Some(repeats)) = (kind, repeats) {
            let here = &mut self.levels[level];
            if here.m98_left == -1 {
                here.m98_left = repeats;
            }
            here.m98_left -= 1;
            if here.m98_left > 0 {
                next = self.place.line;
            } else {
                here.m98_left = -1;
            }
        }
        let params = kind != CallKind::M98;
        if params {
            self.levels[level].kept = Some(Box::new(std::array::from_fn(|i| self.params.get(i as u32 + 1))));
            for (i, v) in args.iter().enumerate() {
                self.write_param(i as u32 + 1, *v);
            }
        }
        let ret = Return { place: self.place, next, shift: self.shift, params, loops: self.loops.len() };
        self.levels[level].ret = Some(ret);
        let mut new = Level::new(label.name);
        new.kind = kind;
        self.levels.push(new);
        if self.config.n_args {
            self.params.set_named(level + 1, "n_args", f64::from(count));
        }
        let name = self.symbols.name(label.name).to_string();
        self.enter_frame(&format!("sub {name}"), self.place.frame, 0);
        self.skip = None;
        self.go_to_sub(&name).inspect_err(|_| {
            self.levels.pop();
        })
    }

    fn call_nothing(&mut self, label: Label) -> Res {
        let level = self.level();
        let ret = Return { place: self.place, next: self.next, shift: self.shift, params: false, loops: self.loops.len() };
        self.levels[level].ret = Some(ret);
        let mut new = Level::new(label.name);
        new.kind = CallKind::M98;
        self.levels.push(new);
        Ok(())
    }

    fn go_to_sub(&mut self, name: &str) -> Res {
        let base = self.symbols.of(base_name(name));
        let label = Label { scope: GLOBAL, name: base };
        self.flow = Flow::Jump;
        if let Some(at) = self.offsets.get(&label) {
            self.place.file = at.file;
            self.next = at.line;
            self.shift = at.shift;
            return Ok(());
        }
        // Where the call stands, not inside it.
        let caller = self.level().checked_sub(1).and_then(|l| self.levels[l].ret.as_ref());
        let from = caller.map_or(self.place, |ret| ret.place);
        let mut start = self.sequence();
        if let Some(file) = self.files.find_sub(name) {
            self.note_file(file);
            self.place.file = file;
            self.next = 0;
            self.shift = 0;
            start = 0;
        } else if self.setup.version == Version::V2_10 && self.outside_main_file() {
            // 2.10 looks ahead in the main program's file only.
            let what = "the subroutine is neither known so far nor a file of its own";
            let fault = structure(rs274::RT_O_NOT_FOUND, what);
            return Err(with_args(fault, &[name, &format!("{name}.ngc")]));
        }
        self.skip = Some(Skip { label, to_sub: true, start, from: Some(from) });
        Ok(())
    }

    /// The line stands in another file than the main program's first call.
    fn outside_main_file(&self) -> bool {
        self.levels[0].ret.as_ref().is_some_and(|ret| ret.place.file != self.place.file)
    }

    fn go_back_to(&mut self, at: &Offset) {
        self.place.file = at.file;
        self.next = at.line;
        self.shift = at.shift;
        self.flow = Flow::Jump;
    }

    fn check_duplicate(&mut self, label: Label, keyword: Keyword, also: Option<Keyword>) -> Res {
        let Some(at) = self.offsets.get(&label).copied() else { return self.save_offset(label, keyword) };
        if Some(at.keyword) == also || self.sequence() == at.sequence + 1 {
            return Ok(());
        }
        let what = "it is used at two places of this subroutine";
        let (sequence, line, first) = (self.sequence().to_string(), self.line_text().to_string(), (at.sequence + 1).to_string());
        Err(if keyword == Keyword::If {
            with_args(self.label_fault(rs274::RT_O_DUPLICATE_IF, label, what), &[&sequence, &first, &line])
        } else {
            with_args(self.label_fault(rs274::RT_O_DUPLICATE, label, what), &[&sequence, &line, &first])
        })
    }

    fn convert_while(&mut self, label: Label) -> Res {
        self.check_duplicate(label, Keyword::While, Some(Keyword::Do))?;
        self.skip = None;
        let at = self.expect_offset(label)?;
        let yes = self.test_value != 0.0;
        if at.keyword == Keyword::While {
            if yes {
                return self.enter_pass(label);
            }
            self.leave_loop(label);
            self.skip_to(label);
        } else if yes && !self.doing_break {
            self.go_back_to(&at);
        } else {
            self.doing_break = false;
            self.leave_loop(label);
        }
        Ok(())
    }

    fn convert_repeat(&mut self, label: Label) -> Res {
        self.check_duplicate(label, Keyword::Repeat, None)?;
        self.skip = None;
        let count = crate::eval::nearest_int(self.test_value);
        let Some(at) = self.offsets.get_mut(&label) else { return Ok(()) };
        if at.keyword != Keyword::Repeat {
            return Ok(());
        }
        if at.repeats == -1 {
            at.repeats = count;
        }
        if at.repeats > 0 {
            at.repeats -= 1;
            return self.enter_pass(label);
        }
        at.repeats = -1;
        self.leave_loop(label);
        self.skip_to(label);
        Ok(())
    }

    fn convert_if(&mut self, label: Label) -> Res {
        self.check_duplicate(label, Keyword::If, None)?;
        self.executed_if = self.test_value != 0.0;
        if self.executed_if {
            self.skip = None;
        } else {
            self.skip_to(label);
        }
        Ok(())
    }

    fn convert_else(&mut self, label: Label, keyword: Keyword) -> Res {
        let at = self.expect_offset(label)?;
        if at.keyword != Keyword::If {
            return Err(self.label_message(rs274::RT_O_NO_IF, label, "no `if` with this label", Some(&at)));
        }
        if self.executed_if {
            self.skip_to(label);
        } else if keyword == Keyword::Elseif {
            if self.test_value != 0.0 {
                self.skip = None;
                self.executed_if = true;
            }
        } else if self.skip.is_some() {
            self.executed_if = true;
            self.skip = None;
        }
        Ok(())
    }

    fn convert_break(&mut self, label: Label, keyword: Keyword) -> Res {
        let at = self.expect_offset(label)?;
        if !matches!(at.keyword, Keyword::While | Keyword::Do) {
            return Err(self.label_message(rs274::RT_O_NO_LOOP, label, "no `while` or `do` with this label", Some(&at)));
        }
        if keyword == Keyword::Continue {
            if self.skip.is_some() {
                return Ok(());
            }
            self.doing_continue = true;
        } else {
            self.doing_break = true;
        }
        self.skip_to(label);
        Ok(())
    }

    fn convert_loop_end(&mut self, label: Label, keyword: Keyword) -> Res {
        let at = self.expect_offset(label)?;
        let partner = if keyword == Keyword::Endrepeat { Keyword::Repeat } else { Keyword::While };
        if at.keyword != partner {
            return Err(self.label_message(rs274::RT_O_NO_MATCH, label, "no loop of this kind with this label", Some(&at)));
        }
        if self.skip.is_some() {
            self.skip = None;
            if !self.doing_continue {
                self.leave_loop(label);
                return Ok(());
            }
            self.doing_continue = false;
        }
        self.go_back_to(&at);
        Ok(())
    }

    /// A pass of a loop begins.
    fn enter_pass(&mut self, label: Label) -> Res {
        let level = self.level();
        let known = self.loops.iter().rposition(|l| l.label == label && l.level == level);
        let (parent, pass) = match known {
            Some(i) => {
                self.loops.truncate(i + 1);
                self.loops[i].pass += 1;
                (self.loops[i].parent, self.loops[i].pass)
            }
            None => {
                let parent = self.place.frame;
                self.loops.push(Loop { label, level, parent, pass: 1 });
                (parent, 1)
            }
        };
        if pass > self.setup.budgets.passes {
            return Err(self.endless("this loop has run more passes than the limit allows"));
        }
        let name = ["o", self.symbols.name(label.name)].concat();
        self.enter_frame(&name, parent, pass.min(u64::from(u32::MAX)) as u32);
        Ok(())
    }

    fn leave_loop(&mut self, label: Label) {
        let level = self.level();
        if let Some(i) = self.loops.iter().rposition(|l| l.label == label && l.level == level) {
            self.place.frame = self.loops[i].parent;
            self.loops.truncate(i);
        }
    }

    pub(crate) fn endless(&self, what: &str) -> Box<Fault> {
        Fault::own(code::RUN_ENDLESS).arg(what)
    }

    /// M99 of the main program begins another pass.
    pub(crate) fn count_main_pass(&mut self) -> Res {
        let name = self.symbols.of("main program");
        self.enter_pass(Label { scope: MAIN, name })
    }

    /// At the end of the program: what was opened and never closed.
    pub(crate) fn unclosed(&mut self) {
        // Skipping at the end of a program is an error of its own; branches that ran through leave no trace in
        // the controller, so the file is searched for them.
        for id in self.opened.order.clone() {
            if !self.files.is_plain(id) {
                let found = self.unclosed_in(id);
                self.findings.extend(found);
            }
        }
    }

    pub(crate) fn unclosed_in(&mut self, id: FileId) -> Vec<crate::Finding> {
        let index = self.index(id);
        let file = self.files.file(id);
        let statements = index.lines.iter().filter_map(|line| {
            let (c, l) = file.locate(*line)?;
            Some(Statement { line: *line, ..statement(&file.chunks[c].scan, &file.chunks[c].text, l)? })
        });
        unclosed(statements, id, self.opened.order.first() == Some(&id))
    }

    // Macro B.

    fn macro_line(&mut self, scan: &Scan, text: &str, words: &[Word], c: &Control) -> Res {
        if self.skip.is_some() {
            return Ok(());
        }
        match c.keyword {
            Keyword::MacroIfGoto => {
                if self.arg(scan, c, 0)? != 0.0 {
                    let target = self.arg(scan, c, 1)?;
                    return self.go_to_number(target);
                }
                Ok(())
            }
            Keyword::MacroIfThen => {
                if self.arg(scan, c, 0)? == 0.0 {
                    return Ok(());
                }
                for w in words.iter().filter(|w| w.start >= c.span.start && w.letter != b'o') {
                    self.read_word(scan, text, w)?;
                }
                self.execute_line()
            }
            Keyword::MacroGoto => {
                let target = self.arg(scan, c, 0)?;
                self.go_to_number(target)
            }
            Keyword::MacroWhile => {
                let n = self.arg(scan, c, 1)?;
                let yes = self.arg(scan, c, 0)? != 0.0;
                let label = self.macro_label(n);
                if yes {
                    return self.enter_pass(label);
                }
                self.leave_loop(label);
                match self.find_macro(n, true)? {
                    Some(line) => {
                        self.next = line + 1;
                        self.flow = Flow::Jump;
                        Ok(())
                    }
                    None => Err(self.label_fault(rs274::SILENT, label, "no END with this number")),
                }
            }
            Keyword::MacroDo => {
                let n = self.arg(scan, c, 0)?;
                let label = self.macro_label(n);
                self.enter_pass(label)
            }
            _ => {
                let n = self.arg(scan, c, 0)?;
                let label = self.macro_label(n);
                match self.find_macro(n, false)? {
                    Some(line) => {
                        self.next = line;
                        self.flow = Flow::Jump;
                        Ok(())
                    }
                    None => Err(self.label_fault(rs274::SILENT, label, "no DO with this number")),
                }
            }
        }
    }

    fn macro_label(&mut self, n: f64) -> Label {
        let name = self.symbols.of(&format!("DO {n}"));
        self.local(name)
    }

    fn go_to_number(&mut self, target: f64) -> Res {
        let index = self.index(self.place.file);
        let Some(line) = index.numbers.get(&(target as i64)).copied() else {
            let name = self.symbols.of(&format!("N{target}"));
            return Err(self.label_fault(rs274::SILENT, Label { scope: MAIN, name }, "no block has this number"));
        };
        if line <= self.place.line {
            let name = self.symbols.of(&format!("N{target}"));
            let label = self.local(name);
            self.enter_pass(label)?;
        }
        self.next = line;
        self.flow = Flow::Jump;
        Ok(())
    }

    /// The END that belongs to a WHILE (forward), or the WHILE or DO that belongs to an END (backward).
    fn find_macro(&mut self, n: f64, forward: bool) -> Res<Option<u32>> {
        let index = self.index(self.place.file);
        let here = self.place.line;
        let at = index.lines.partition_point(|l| *l < here);
        let lines: Box<dyn Iterator<Item = u32>> = if forward {
            Box::new(index.lines[at..].to_vec().into_iter().filter(move |l| *l > here))
        } else {
            Box::new(index.lines[..at].to_vec().into_iter().rev())
        };
        for line in lines {
            let file = self.files.file(self.place.file);
            let Some((c, l)) = file.locate(line) else { continue };
            let scan = file.chunks[c].scan.clone();
            let Some(w) = first_real(scan.words(l)).filter(|w| w.form == Form::Control) else { continue };
            let Some(control) = scan.controls.get(w.index()).copied() else { continue };
            let number = match control.keyword {
                Keyword::MacroEnd if forward => 0,
                Keyword::MacroDo if !forward => 0,
                Keyword::MacroWhile if !forward => 1,
                _ => continue,
            };
            if self.arg(&scan, &control, number)? == n {
                return Ok(Some(line));
            }
        }
        Ok(None)
    }

    /// Calls a remap's subroutine; its words become named parameters of the new level.
    pub(crate) fn call_named(&mut self, name: &str, args: &[f64], by_name: &[(char, f64)]) -> Res {
        let name = self.symbols.of(name);
        let mut all = [0.0; ARGS];
        for (slot, v) in all.iter_mut().zip(args) {
            *slot = *v;
        }
        self.call(Label { scope: GLOBAL, name }, CallKind::Remap, all, args.len() as u32, None)?;
        let level = self.level();
        for (letter, value) in by_name {
            self.params.set_named(level, &letter.to_string(), *value);
        }
        Ok(())
    }

    /// Calls the subroutine of a contour and hands every block of it to `take`.
    pub(crate) fn read_contour(&mut self, number: f64, reader: &mut crate::rough::Reader) -> Res {
        let n = whole(number).ok_or_else(|| not_whole(number).at(b'q'))?;
        let name = self.symbols.of(&n.to_string());
        let base = self.level();
        self.call(Label { scope: GLOBAL, name }, CallKind::Oword, [0.0; ARGS], 0, None)?;
        let saved = (self.place, self.reading.clone());
        self.in_contour = true;
        let mut done = Ok(());
        while done.is_ok() && self.level() > base {
            done = self.contour_line(reader);
        }
        self.in_contour = false;
        done?;
        self.place = saved.0;
        // Faults belong to the block of the cycle, but the line read last stays the contour's.
        let (text, start, end) = (self.reading.text.clone(), self.reading.start, self.reading.end);
        self.reading = crate::run::Reading { text, start, end, ..saved.1 };
        Ok(())
    }

    fn contour_line(&mut self, reader: &mut crate::rough::Reader) -> Res {
        let from = if self.skip.is_some() { self.next_control(self.next) } else { self.next };
        let file = self.files.file(self.place.file);
        let Some((c, l)) = file.locate(from) else {
            return Err(self.end_fault());
        };
        let chunk = file.chunks[c].clone();
        self.next = from + 1;
        self.place.line = from;
        self.reading.line = l;
        let span = chunk.scan.line_span(&chunk.text, l);
        (self.reading.begin, self.reading.start, self.reading.end) = (span.start, span.start, span.end);
        (self.reading.text, self.reading.scan) = (chunk.text.clone(), chunk.scan.clone());
        let (scan, words) = (&chunk.scan, chunk.scan.words(l));
        if scan.lines[l as usize].deleted && self.setup.block_delete {
            return Ok(());
        }
        self.blocks += 1;
        self.check_budgets()?;
        self.block.clear();
        self.comment = None;
        self.settings.clear();
        let first = first_real(words);
        if let Some(w) = first.filter(|w| w.letter == b'o') {
            return self.control_line(scan, &chunk.text, l, words, w);
        }
        if let Some(which) = first.filter(|w| w.letter == b'm').and_then(|_| self.fanuc_call(first)) {
            return self.fanuc_line(scan, words, which);
        }
        if self.skip.is_some() {
            return Ok(());
        }
        self.read_words(scan, &chunk.text, l, words)?;
        self.enhance()?;
        self.check()?;
        self.store_settings()?;
        reader.block(self)
    }
}

fn with_args(mut fault: Box<Fault>, args: &[&str]) -> Box<Fault> {
    if fault.own_args.is_empty() {
        fault.own_args = std::mem::take(&mut fault.args);
    }
    fault.args = args.iter().map(|a| (*a).to_string()).collect();
    fault
}

fn is_macro(keyword: Keyword) -> bool {
    matches!(
        keyword,
        Keyword::MacroIfGoto
            | Keyword::MacroIfThen
            | Keyword::MacroGoto
            | Keyword::MacroWhile
            | Keyword::MacroDo
            | Keyword::MacroEnd
    )
}

/// Takes out of `open` what a statement with this label closes. A computed label (`o#1`, `o[…]`) may be any.
fn closes(open: &mut Vec<Statement>, keyword: Keyword, label: &str) -> bool {
    let computed = |l: &str| l.contains(['#', '[']) && !l.contains('<');
    let of = |o: &Statement, any: bool| o.keyword == keyword && (*o.label == *label || any && (computed(label) || computed(&o.label)));
    let Some(at) = open.iter().rposition(|o| of(o, false)).or_else(|| open.iter().rposition(|o| of(o, true))) else { return false };
    open.remove(at);
    true
}
