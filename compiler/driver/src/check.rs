//! From findings to diagnostics: whole-file byte positions, labels, the way execution took, one message for one
//! mistake.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use gr_canon::{CallFrame, FrameId};
use gr_gcode::{Chunk, File, Form, Scan};
use gr_spec::{Code, Severity, code};
use gr_text::{Diagnostic, FileId, Fix, Frame, Span};

use crate::db::{Database, Db, Document, scanned, shape};
use crate::layout::{Layout, bytes, layout};
use crate::library::sub_file;
use crate::engine::End;
use crate::lints::Found;
use crate::timeline::{Group, Story, timeline, timeline_to, told_once};

/// What a check gives.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Check {
    /// In file order.
    pub diagnostics: Vec<Diagnostic>,
    /// Those that are not listed: beyond the limit of [`MOST_OF_A_KIND`] for each code.
    pub unlisted: Unlisted,
}

/// Number of diagnostics of each kind that are not listed.
pub type Unlisted = BTreeMap<(Code, Severity), usize>;

impl Check {
    /// Number of diagnostics of a severity, listed or not.
    pub fn count(&self, severity: Severity) -> usize {
        let unlisted: usize = self.unlisted.iter().filter(|((_, s), _)| *s == severity).map(|(_, n)| n).sum();
        unlisted + self.diagnostics.iter().filter(|d| d.severity == severity).count()
    }
}

/// Diagnostics of one code that are listed.
pub const MOST_OF_A_KIND: usize = 1000;

/// Chunks of a file that is worth more than one thread.
const MANY: usize = 64;

/// Scans a file that was not looked at yet in two threads: nothing else of a check can be done beside anything.
fn scan_all(db: &Database, document: Document) {
    let (chunks, run) = (document.chunks(db), document.run(db));
    let new = db.present().get(document.id(db)).is_empty();
    if !new || chunks.len() < MANY || db.recent().is_some() {
        return;
    }
    let (front, back) = chunks.split_at(chunks.len() / 2);
    let other = db.clone();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let work = std::panic::AssertUnwindSafe(|| back.iter().for_each(|c| _ = shape(&other, *c, run)));
            // Cancelled: this thread's caller is going to be, too.
            let _ = salsa::Cancelled::catch(work);
        });
        front.iter().for_each(|c| _ = shape(db, *c, run));
    });
}

/// Everything that is to be said about a file.
pub(crate) fn check(db: &Database, document: Document) -> Check {
    scan_all(db, document);
    if let Some(diagnostics) = crate::ufmg::check(db, document) {
        return Check { diagnostics, unlisted: Unlisted::new() };
    }
    Assembly::new(db, document, &timeline(db, document).story).finish(None)
}

/// The same for a document that is looked at once.
pub(crate) fn check_once(db: &Database, document: Document) -> Check {
    if db.recent().is_none() || crate::ufmg::speaks(db, document) {
        return check(db, document);
    }
    Assembly::new(db, document, &told_once(db, document)).finish(None)
}

/// What tells one diagnostic from another: the same finding in every pass of a loop is one.
pub(crate) type Key = (FileId, u32, Code, Option<u8>, Option<(u32, u32)>);

/// The key of a finding of a group.
pub(crate) fn key(found: &Found, group: &Group, main: FileId) -> Key {
    let own = group.frames.is_none() || found.place.file == main;
    let file = if own { main } else { found.place.file };
    let line = found.place.line.wrapping_add(group.first_line);
    (file, line, found.code, found.letter, found.span.map(|s| (s.start, s.end)))
}

/// What is to be said about some lines, as far as the blocks up to their end tell it.
pub(crate) fn check_range(db: &Database, document: Document, lines: Range<u32>) -> Vec<Diagnostic> {
    if let Some(mut found) = crate::ufmg::check(db, document) {
        let line = |span: Span| line_of(db, document, span.start);
        found.retain(|d| lines.contains(&line(d.primary().1)));
        return found;
    }
    scan_all(db, document);
    let last = lines.end.saturating_sub(1).max(lines.start);
    Assembly::new(db, document, &timeline_to(db, document, last).story).finish(Some(lines)).diagnostics
}

/// The line of a byte of a file.
fn line_of(db: &Database, document: Document, offset: u32) -> u32 {
    let mut text = String::new();
    for chunk in document.chunks(db).iter() {
        text.push_str(chunk.text(db));
    }
    gr_text::LineIndex::new(text.as_bytes()).position(offset).0
}

struct Assembly<'a> {
    db: &'a dyn Db,
    document: Document,
    id: FileId,
    layout: &'a Layout,
    /// First byte of each chunk.
    bytes: OnceCell<Vec<u32>>,
    story: &'a Story,
    seen: BTreeMap<Key, usize>,
    /// Lines of this file with a diagnostic.
    told: BTreeSet<u32>,
    per_code: BTreeMap<Code, usize>,
    out: Vec<Diagnostic>,
    passes: Vec<usize>,
    unlisted: Unlisted,
}

impl<'a> Assembly<'a> {
    fn new(db: &'a dyn Db, document: Document, story: &'a Story) -> Self {
        let id = FileId(document.id(db));
        Assembly {
            db,
            document,
            id,
            layout: layout(db, document),
            bytes: OnceCell::new(),
            story,
            seen: BTreeMap::new(),
            told: BTreeSet::new(),
            per_code: BTreeMap::new(),
            out: Vec::new(),
            passes: Vec::new(),
            unlisted: story.unlisted.clone(),
        }
    }

    fn finish(mut self, lines: Option<Range<u32>>) -> Check {
        let story = self.story;
        for group in &story.groups {
            for found in group.found.iter() {
                self.add(found, group, lines.as_ref());
            }
        }
        self.never_run(lines.as_ref());
        for (d, passes) in self.out.iter_mut().zip(&self.passes) {
            if *passes > 1 {
                d.notes.push(format!("found in {passes} passes; the first is shown"));
            }
        }
        self.out.sort_by_key(|d| (d.primary().0, d.primary().1.start, d.severity, d.code));
        Check { diagnostics: self.out, unlisted: self.unlisted }
    }

    fn add(&mut self, found: &Found, group: &Group, lines: Option<&Range<u32>>) {
        let key = key(found, group, self.id);
        let (file, line) = (key.0, key.1);
        let own = file == self.id;
        if let Some(lines) = lines
            && (!own || !lines.contains(&line))
        {
            return;
        }
        if let Some(at) = self.seen.get(&key) {
            self.passes[*at] += 1;
            return;
        }
        if self.is_full(found.code, found.severity) {
            return;
        }
        let mut d = match self.source(file, line) {
            Some(source) => source.diagnostic(found, file),
            None => Diagnostic::new(found.code, file, Span::default(), &found.args),
        };
        d.severity = found.severity;
        if let Some(frames) = &group.frames {
            d.trace = self.trace(found.place.frame, frames);
        }
        if own {
            self.told.insert(line);
        }
        self.seen.insert(key, self.out.len());
        self.out.push(d);
        self.passes.push(1);
    }

    /// Counts a diagnostic; true: there is no room for it in the list.
    fn is_full(&mut self, code: Code, severity: Severity) -> bool {
        let count = self.per_code.entry(code).or_default();
        *count += 1;
        let full = *count > MOST_OF_A_KIND;
        if full {
            *self.unlisted.entry((code, severity)).or_default() += 1;
        }
        full
    }

    fn first_byte(&self, chunk: usize) -> u32 {
        self.bytes.get_or_init(|| bytes(self.db, self.document))[chunk]
    }

    /// The chunk a line is in.
    fn source(&self, file: FileId, line: u32) -> Option<Source> {
        if file != self.id {
            let contents = sub_file(self.db, self.document.run(self.db), file)?;
            let (chunk, line) = contents.locate(line)?;
            return Some(Source::of(&contents, chunk, line));
        }
        let starts = &self.layout.starts;
        let last = starts.len().checked_sub(2)?;
        let at = starts.partition_point(|s| *s <= line).saturating_sub(1).min(last);
        let chunk = *self.document.chunks(self.db).get(at)?;
        let run = self.document.run(self.db);
        let text = chunk.text(self.db).clone();
        let scan = scanned(self.db, chunk, run);
        Some(Source { chunk: Chunk { text, scan }, start: self.first_byte(at), line: line - starts[at] })
    }

    fn trace(&self, innermost: FrameId, frames: &Arc<[(FrameId, CallFrame)]>) -> Vec<Frame> {
        let mut trace = Vec::new();
        let mut at = innermost;
        while at != FrameId::MAIN && trace.len() < 32 {
            let Some((_, frame)) = frames.iter().find(|(id, _)| *id == at) else { break };
            let name = if frame.pass > 0 { format!("{} (pass {})", frame.name, frame.pass) } else { frame.name.to_string() };
            let span = self.source(frame.file, frame.line).map_or(Span::default(), |s| s.line_span());
            trace.push(Frame { file: frame.file, span, name });
            at = frame.parent;
        }
        trace
    }

    /// Damaged lines that execution never came to: hints, when the program ran to its end.
    fn never_run(&mut self, lines: Option<&Range<u32>>) {
        if !self.story.complete || matches!(self.story.end, Some(End { stopped: true, .. })) {
            return;
        }
        let run = self.document.run(self.db);
        if run.options(self.db).rules.severity(code::LINE_NEVER_RUN).is_none() {
            return;
        }
        for (at, chunk) in self.document.chunks(self.db).iter().enumerate() {
            if !shape(self.db, *chunk, run).damaged {
                continue;
            }
            let (first_line, start) = (self.layout.starts[at], self.first_byte(at));
            let scan = scanned(self.db, *chunk, run);
            let mut last = u32::MAX;
            for fault in scan.faults.iter() {
                let line = first_line + fault.line;
                let told = self.told.contains(&line);
                if line == last || told || lines.is_some_and(|l| !l.contains(&line)) {
                    continue;
                }
                last = line;
                let severity = code::LINE_NEVER_RUN.def().severity;
                if self.is_full(code::LINE_NEVER_RUN, severity) {
                    continue;
                }
                let d = Diagnostic::new(code::LINE_NEVER_RUN, self.id, fault.span.shifted(start), &[]);
                self.out.push(d.note(gr_spec::fill(fault.code.def().message, &fault.args)));
                self.passes.push(1);
            }
        }
    }
}

/// A line in its chunk.
struct Source {
    chunk: Chunk,
    /// First byte of the chunk in the file.
    start: u32,
    line: u32,
}

impl Source {
    fn of(file: &File, chunk: usize, line: u32) -> Source {
        Source { chunk: file.chunks[chunk].clone(), start: file.starts[chunk], line }
    }
    fn scan(&self) -> &Scan {
        &self.chunk.scan
    }
    /// Whether the chunk has the line: the last chunk may be empty, or the finding stand behind the last line.
    fn exists(&self) -> bool {
        (self.line as usize) < self.scan().lines.len()
    }
    /// First byte of the line in the file.
    fn line_start(&self) -> u32 {
        let in_chunk = self.scan().lines.get(self.line as usize).map_or(self.chunk.text.len() as u32, |l| l.start);
        self.start + in_chunk
    }
    /// The block without blanks around it.
    fn line_span(&self) -> Span {
        if !self.exists() {
            let end = self.start + self.chunk.text.len() as u32;
            return Span::new(end, end);
        }
        let span = self.scan().line_span(&self.chunk.text, self.line);
        let text = self.chunk.text.get(span.range()).unwrap_or("");
        let before = (text.len() - text.trim_start().len()) as u32;
        let after = (text.len() - text.trim_end().len()) as u32;
        if before as usize == text.len() {
            return span.shifted(self.start);
        }
        Span::new(span.start + before, span.end - after).shifted(self.start)
    }
    fn word(&self, letter: u8) -> Option<Span> {
        if !self.exists() {
            return None;
        }
        let word = self.scan().words(self.line).iter().find(|w| w.letter == letter)?;
        let span = self.scan().word_span(&self.chunk.text, self.line, word);
        let text = self.chunk.text.get(span.range()).unwrap_or("");
        let blank = (text.len() - text.trim_end().len()) as u32;
        Some(Span::new(span.start, span.end - blank).shifted(self.start))
    }
    /// The word of a code such as `G2`, when it is written as a plain number.
    fn code_word(&self, name: &str) -> Option<Span> {
        let letter = name.bytes().next()?.to_ascii_lowercase();
        let value: f64 = name.get(1..)?.parse().ok()?;
        let words = self.scan().words(self.line);
        let word = words.iter().find(|w| w.letter == letter && w.form == Form::Literal && (w.value - value).abs() < 1e-4)?;
        Some(self.scan().word_span(&self.chunk.text, self.line, word).shifted(self.start))
    }
    /// Two codes that exclude each other: the second is one too many, and both are shown.
    fn two_codes(&self, found: &Found, file: FileId) -> Option<Diagnostic> {
        let [_, first, second] = found.args.as_slice() else { return None };
        let places = [self.code_word(first)?, self.code_word(second)?];
        let mut d = Diagnostic::new(found.code, file, places[1], &found.args);
        d.labels.first_mut()?.text = second.clone();
        Some(d.label(file, places[0], format!("{first} is of the same group")))
    }
    fn diagnostic(&self, found: &Found, file: FileId) -> Diagnostic {
        if found.code == code::CODE_SAME_GROUP
            && let Some(d) = self.two_codes(found, file)
        {
            return d;
        }
        let exact = found.span.map(|s| s.shifted(self.line_start()));
        let block = self.line_span();
        let narrow = exact.or_else(|| self.word(found.letter?)).filter(|s| *s != block);
        let mut places = remarks(found.code).iter().filter_map(|(letters, text)| Some((self.words(letters)?, *text)));
        // A finding of the whole block points at the words that matter most, when they are known.
        let (span, text) = match narrow {
            Some(span) => (span, ""),
            None => places.next().unwrap_or((block, "")),
        };
        let mut d = Diagnostic::new(found.code, file, span, &found.args);
        if let Some(label) = d.labels.first_mut() {
            label.text = text.to_string();
        }
        for (place, text) in places.filter(|(place, _)| place.end <= span.start || place.start >= span.end) {
            d = d.label(file, place, text);
        }
        let fixes = self.fix(found, span).map_or_else(|| self.readings(found, span), |one| vec![one]);
        d.fixes.extend(fixes.into_iter().map(|(title, span, text)| Fix { title, edits: vec![(file, span, text)] }));
        d
    }
    /// What puts a slip of the pen right, where there is one way only, or what the row of the registry tells first.
    fn fix(&self, found: &Found, span: Span) -> Option<(String, Span, String)> {
        let written = |s: Span| self.chunk.text.get((s.start.checked_sub(self.start)?) as usize..s.end.checked_sub(self.start)? as usize);
        let end = self.line_span().end;
        let here = Span::new(end, end);
        Some(match found.code {
            code::SYNTAX_BAD_CHARACTER if written(span)? == "," => {
                let digit = |s: Option<&str>| s.is_some_and(|s| s.bytes().all(|b| b.is_ascii_digit()));
                let between = digit(written(Span::new(span.start.checked_sub(1)?, span.start))) && digit(written(Span::new(span.end, span.end + 1)));
                (between.then(|| "write a decimal point".to_string())?, span, ".".into())
            }
            code::COMMENT_UNCLOSED => ("close the comment".into(), here, ")".into()),
            code::EXPRESSION_UNKNOWN_FUNCTION => {
                let digit = match written(span)? {
                    "O" | "o" => "0",
                    "l" | "I" => "1",
                    _ => return None,
                };
                (format!("write the digit {digit}"), span, digit.into())
            }
            code::COMMENT_NESTED if written(span)?.starts_with('(') => {
                let inside = inside_of_comment(written(Span::new(span.start, end))?)?;
                let bare: String = inside.chars().filter(|c| !matches!(c, '(' | ')')).collect();
                let title = if inside.contains(')') { "remove the inner `(` and `)`" } else { "remove the inner `(`" };
                (title.into(), Span::new(span.start, span.start + inside.len() as u32), bare)
            }
            code::SYNTAX_BAD_CHARACTER if matches!(written(span)?, "O" | "o") => {
                let before = written(Span::new(span.start.checked_sub(1)?, span.start))?;
                let count = zeros(before, written(Span::new(span.start, end))?)?;
                let digits = "0".repeat(count);
                (format!("write the digit{} {digits}", if count > 1 { "s" } else { "" }), Span::new(span.start, span.start + count as u32), digits)
            }
            code::TEXT_BYTE_ORDER_MARK if written(span)? == "\u{FEFF}" => ("remove the byte order mark".into(), span, String::new()),
            code::WORD_UNUSED => {
                let before = self.chunk.text.get(..span.start.checked_sub(self.start)? as usize)?;
                let blanks = before.len() - before.trim_end_matches([' ', '\t']).len();
                let word = written(span).filter(|w| w.len() > 1)?;
                (format!("remove {word}"), Span::new(span.start - blanks as u32, span.end), String::new())
            }
            // `callsub` is `call` with something behind it.
            code::OWORD_TRAILING_TEXT if self.runs_on(span) => {
                let rest = written(span)?;
                let more = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_alphabetic()).len();
                (format!("remove `{}`", &rest[..more]), Span::new(span.start, span.start + more as u32), String::new())
            }
            code::OWORD_TRAILING_TEXT if !written(span)?.contains(['\n', '\r']) => {
                ("put the rest on its own line".into(), Span::new(span.start, span.start), self.line_end().into())
            }
            _ => return None,
        })
    }
    /// Whether letters are written at once behind a letter.
    fn runs_on(&self, span: Span) -> bool {
        let at = span.start.checked_sub(self.start + 1).map_or(0, |at| at as usize);
        self.chunk.text.as_bytes().get(at..at + 2).is_some_and(|two| two.iter().all(u8::is_ascii_alphabetic))
    }
    /// Where the row of the registry names two ways out: both.
    fn readings(&self, found: &Found, span: Span) -> Vec<(String, Span, String)> {
        let line = self.line_start();
        let block = |code: &str, what: &str| (format!("write {code} before this block: {what}"), Span::new(line, line), format!("{code}{}", self.line_end()));
        match found.code {
            code::UNITS_NOT_STATED => vec![block("G21", "lengths are in mm"), block("G20", "lengths are in inch")],
            code::COOLANT_NONE => vec![block("M8", "flood"), block("M7", "mist")],
            code::AXIS_NO_CODE => {
                let first = b"xyzabcuvw".iter().filter_map(|l| self.word(*l)).map(|s| s.start).min();
                let at = first.filter(|at| (span.start..=span.end).contains(at));
                let write = |at: u32, code: &str, what: &str| (format!("write {code}: {what}"), Span::new(at, at), format!("{code} "));
                at.map_or_else(Vec::new, |at| vec![write(at, "G0", "a rapid"), write(at, "G1", "at the feed")])
            }
            _ => Vec::new(),
        }
    }
    /// How the line ends.
    fn line_end(&self) -> &'static str {
        let end = self.scan().line_span(&self.chunk.text, self.line).end as usize;
        if self.chunk.text.get(end..).is_some_and(|rest| rest.starts_with("\r\n")) { "\r\n" } else { "\n" }
    }
    /// From the first to the last word with one of these letters.
    fn words(&self, letters: &[u8]) -> Option<Span> {
        let spans = || letters.iter().filter_map(|l| self.word(*l));
        Some(Span::new(spans().map(|s| s.start).min()?, spans().map(|s| s.end).max()?))
    }
}

/// Of a line from the second `(` of a comment on, what belongs to the comment: up to the `)` that closes the first `(`. Where
/// none does, up to the last `)` if that ends the line: what stands behind it may be meant as program.
fn inside_of_comment(rest: &str) -> Option<&str> {
    let mut depth = 1;
    for (at, c) in rest.char_indices() {
        depth += match c {
            '(' => 1,
            ')' => -1,
            _ => 0,
        };
        if depth == 0 {
            return rest.get(..at);
        }
    }
    rest.trim_end().strip_suffix(')')
}

/// How many letters O at the start of `rest` stand for digits of the number before them, rather than begin an O-word.
fn zeros(before: &str, rest: &str) -> Option<usize> {
    let count = rest.bytes().take_while(|b| matches!(b, b'o' | b'O')).count();
    let behind = rest[count..].trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    let number = before.bytes().all(|b| b.is_ascii_digit() || b == b'.');
    // A word's letter and its value, or nothing: not `o100 call`, `o<name> call`.
    let mut next = behind.trim_start().chars();
    let word = match (next.next(), next.next()) {
        (None | Some('(' | ';'), _) => true,
        (Some(letter), Some(value)) => letter.is_ascii_alphabetic() && !value.is_ascii_alphabetic(),
        _ => false,
    };
    (number && word).then_some(count)
}

/// Words that also have to do with a mistake, and what they are.
fn remarks(code: Code) -> &'static [(&'static [u8], &'static str)] {
    match code {
        code::ARC_RADIUS_MISMATCH => &[(b"ijk", "the centre, seen from the start point"), (b"xyz", "the end point")],
        code::ARC_RADIUS_TOO_SMALL => &[(b"xyz", "the end point"), (b"r", "the radius")],
        _ => &[],
    }
}
