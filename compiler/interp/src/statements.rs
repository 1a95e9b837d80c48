//! Lines that control flow can come to: an index of them, and statements that are opened and never closed.

use std::sync::Arc;

use gr_canon::{FileId, FrameId, Sink};
use gr_gcode::{Form, Keyword, LineKind, Scan, Word};
use gr_spec::code;
use gr_text::Span;
use rustc_hash::FxHashMap;

use crate::{Fault, Interp};

/// Lines of a file that skipping must look at, and block numbers.
#[derive(Debug, Default)]
pub(crate) struct FileIndex {
    pub(crate) lines: Vec<u32>,
    /// First lines of the programs (`O1000`), ascending.
    programs: Vec<u32>,
    /// The same by their numbers.
    numbered_programs: FxHashMap<Box<str>, Vec<u32>>,
    /// The first block of each number, in each program.
    numbers: FxHashMap<(usize, i64), u32>,
}

impl FileIndex {
    /// The program that a line stands in: 0 before the first one begins.
    fn program(&self, line: u32) -> usize {
        self.programs.partition_point(|first| *first <= line)
    }
    /// The block of a number in the program that `line` stands in: every program has block numbers of its own.
    pub(crate) fn numbered(&self, number: i64, line: u32) -> Option<u32> {
        self.numbers.get(&(self.program(line), number)).copied()
    }
    /// The first line of the program of a number: the next one behind `line`, else the first of the file.
    pub(crate) fn subprogram(&self, number: &str, line: u32) -> Option<u32> {
        let all = self.numbered_programs.get(number)?;
        all.iter().find(|l| **l > line).or(all.first()).copied()
    }
    /// Whether two lines stand in one program.
    pub(crate) fn in_one_program(&self, a: u32, b: u32) -> bool {
        self.program(a) == self.program(b)
    }
}

pub(crate) fn op_name(keyword: Keyword) -> &'static str {
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

pub(crate) fn first_real(words: &[Word]) -> Option<&Word> {
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
    /// As the controller compares it.
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

/// In lower case, without blanks and without zeros in front of a number.
fn plain_label(text: &str) -> Box<str> {
    let label: String = text.chars().filter(|c| !matches!(c, ' ' | '\t')).map(|c| c.to_ascii_lowercase()).collect();
    let number = !label.is_empty() && label.bytes().all(|b| b.is_ascii_digit());
    let rest = label.trim_start_matches('0');
    if number && !rest.is_empty() { rest.into() } else { label.into() }
}

/// The statement on a line of a chunk.
pub fn statement(scan: &Scan, text: &str, line: u32) -> Option<Statement> {
    let word = first_real(scan.words(line)).filter(|w| w.form == Form::Control && w.letter == b'o')?;
    let control = scan.controls.get(word.index())?;
    let start = scan.lines.get(line as usize)?.start;
    let span = Span::new(control.span.start.saturating_sub(start), control.span.end.saturating_sub(start));
    let label = plain_label(text.get(control.label_span.range()).unwrap_or(""));
    Some(Statement { keyword: control.keyword, label, line, span })
}

/// What the statements of a file open and never close.
pub fn unclosed(statements: impl IntoIterator<Item = Statement>, file: FileId, main: bool) -> Vec<crate::Finding> {
    let mut open = Open::default();
    for s in statements {
        match s.keyword {
            Keyword::If | Keyword::Repeat => open.push(s),
            // A file that is called may leave its `endsub` away and end with M2.
            Keyword::Sub if main => open.push(s),
            Keyword::While if open.closed_by(Keyword::Do, &s.label) => {}
            Keyword::While | Keyword::Do => open.push(s),
            Keyword::Endsub => _ = open.closed_by(Keyword::Sub, &s.label),
            Keyword::Endif => _ = open.closed_by(Keyword::If, &s.label),
            Keyword::Endwhile => _ = open.closed_by(Keyword::While, &s.label),
            Keyword::Endrepeat => _ = open.closed_by(Keyword::Repeat, &s.label),
            _ => {}
        }
    }
    let finding = |s: Statement| {
        let fault = Fault::own(code::FLOW_UNCLOSED).arg(format!("{} {}", s.label, op_name(s.keyword)));
        crate::Finding { file, line: s.line, frame: FrameId::MAIN, fault, span: Some(s.span), text: "".into() }
    };
    open.statements.into_iter().flatten().map(finding).collect()
}

/// Statements that wait for their end. A computed label (`o#1`, `o[…]`) may be any.
#[derive(Default)]
struct Open {
    /// None: closed.
    statements: Vec<Option<Statement>>,
    /// Places in `statements` by keyword and label, and by keyword: all of them, those with computed labels. They may
    /// be closed by now.
    labelled: FxHashMap<(Keyword, Box<str>), Vec<usize>>,
    all: FxHashMap<Keyword, Vec<usize>>,
    computed: FxHashMap<Keyword, Vec<usize>>,
}

impl Open {
    fn push(&mut self, s: Statement) {
        let at = self.statements.len();
        self.labelled.entry((s.keyword, s.label.clone())).or_default().push(at);
        self.all.entry(s.keyword).or_default().push(at);
        if is_computed(&s.label) {
            self.computed.entry(s.keyword).or_default().push(at);
        }
        self.statements.push(Some(s));
    }

    /// Closes the innermost statement that the label fits: by its text, else by being computed.
    fn closed_by(&mut self, keyword: Keyword, label: &str) -> bool {
        let Open { statements, labelled, all, computed } = self;
        let mut last = |places: Option<&mut Vec<usize>>| {
            let places = places?;
            while let Some(at) = places.pop() {
                if statements[at].take().is_some() {
                    return Some(at);
                }
            }
            None
        };
        last(labelled.get_mut(&(keyword, label.into())))
            .or_else(|| last(if is_computed(label) { all.get_mut(&keyword) } else { computed.get_mut(&keyword) }))
            .is_some()
    }
}

fn is_computed(label: &str) -> bool {
    label.contains(['#', '[']) && !label.contains('<')
}

impl<S: Sink> Interp<'_, S> {
    /// The index of a file, made when it is first needed.
    pub(crate) fn index(&mut self, id: FileId) -> Arc<FileIndex> {
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
                if scan.begins_program(l as u32) {
                    index.programs.push(at);
                    if let Some(s) = statement(scan, &chunk.text, l as u32) {
                        index.numbered_programs.entry(s.label).or_default().push(at);
                    }
                }
                if let Some(n) = words.first().filter(|w| w.letter == b'n' && w.form == Form::Literal) {
                    index.numbers.entry((index.programs.len(), n.value as i64)).or_insert(at);
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
}
