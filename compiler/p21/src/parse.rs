//! Text → flat tables, with recovery at the next statement.

mod sections;

use gr_spec::{Code, code};
use gr_text::Span;
use rustc_hash::FxHashMap;

use crate::index::{begins_instance, ends_value, first_on_line, first_statement, skip_blank};
use crate::lex::{self, DIGIT, LOWER, UPPER, is, peek, run};
use crate::model::{Exchange, Fault, Ids, Instance, Kind, Value};

/// Deeper lists are refused; real files have a depth of four.
const DEPTH: usize = 10_000;

/// Reads a whole file.
pub fn parse(text: &[u8]) -> Exchange {
    let mut p = Parser::<true>::new(text);
    p.out.instances.reserve(text.len() / 88 + 4);
    p.out.values.reserve(text.len() / 18 + 16);
    p.file();
    p.finish()
}

/// Says what is wrong in a file, as [`parse`] would, and keeps nothing else: no tables, no memory.
pub fn check_syntax(text: &[u8]) -> Vec<Fault> {
    let mut p = Parser::<false>::new(text);
    p.file();
    if !p.sorted {
        // Ids out of order: whether one stands twice takes a list of them.
        return parse(text).faults;
    }
    p.out.faults.sort_by_key(|f| f.span.start);
    p.foreign();
    p.out.faults
}

/// The first line of a text that is no exchange file, and what the text seems to be.
#[cold]
fn looks_like(text: &[u8]) -> (Span, &'static str) {
    let start = text.iter().position(|b| *b > b' ').unwrap_or(text.len());
    let line = &text[start..text[start..].iter().take(80).position(|b| *b < b' ').map_or(text.len().min(start + 80), |n| start + n)];
    let span = Span::new(start as u32, (start + line.len()) as u32);
    let what = match line {
        [] => "it is empty",
        [b'<', ..] => "it looks like XML, and the XML form of STEP (Part 28) is not read",
        _ if text[start..].split(|b| *b < b' ').filter(|l| !l.is_empty()).take(20).any(is_block) => "it looks like G-code",
        _ => "it has no `ISO-10303-21;`, no section and no instance",
    };
    (span, what)
}

/// Entities of the header: no type of a value is named like one.
fn is_header_entity(word: &[u8]) -> bool {
    let all: [&[u8]; 7] =
        [b"FILE_DESCRIPTION", b"FILE_NAME", b"FILE_SCHEMA", b"FILE_POPULATION", b"SCHEMA_POPULATION", b"SECTION_LANGUAGE", b"SECTION_CONTEXT"];
    all.contains(&word)
}

/// Whether a line is a G or M word with whatever follows.
fn is_block(line: &[u8]) -> bool {
    let words = line.split(|b| *b == b' ').filter(|w| !w.is_empty());
    let code = |w: &[u8]| matches!(w, [b'G' | b'g' | b'M' | b'm', b'0'..=b'9', ..]);
    words.take(2).any(code)
}

/// `KEEP`: fills the tables; without it only faults are collected.
struct Parser<'t, const KEEP: bool> {
    text: &'t [u8],
    at: usize,
    out: Exchange,
    names: FxHashMap<Box<[u8]>, u32>,
    /// Names of anchors.
    anchors: rustc_hash::FxHashSet<Box<[u8]>>,
    /// Keywords seen lately: first eight bytes, length, number. Spares the hash table.
    recent: [(u64, usize, u32); 64],
    open: Vec<u32>,
    last_id: u64,
    sorted: bool,
    /// The current statement has had its message.
    spoiled: bool,
    section: Option<usize>,
    /// Something was met that only exchange files have.
    exchange: bool,
    stage: Stage,
    /// It begins with `ISO-10303-21;`.
    magic: bool,
    /// Its HEADER was met, or its lack told.
    headed: bool,
    /// Instances may stand here.
    instances: bool,
    /// Statements outside of sections have had their message.
    loose: bool,
    /// A message says already that the end is missing.
    cut: bool,
    doubt: Option<Doubt>,
}

/// How far a file has come.
#[derive(Clone, Copy, PartialEq)]
enum Stage {
    /// Nothing is read.
    Start,
    Inside,
    /// `END-ISO-10303-21;` is read.
    Ended,
}

/// The first string of a statement that runs over a line's end and the start of another statement: it may lack
/// its apostrophe and have taken another's. What was there before it.
struct Doubt {
    start: usize,
    values: usize,
    faults: usize,
    spoiled: bool,
}

/// The statement can't be read on.
struct Lost;

impl<'t, const KEEP: bool> Parser<'t, KEEP> {
    fn new(text: &'t [u8]) -> Self {
        Parser {
        text,
        at: 0,
        out: Exchange::default(),
        names: FxHashMap::default(),
        anchors: rustc_hash::FxHashSet::default(),
        recent: [(0, 0, u32::MAX); 64],
        open: Vec::new(),
        last_id: 0,
        sorted: true,
        spoiled: false,
        section: None,
        exchange: false,
        stage: Stage::Start,
        magic: false,
        headed: false,
        instances: false,
        loose: false,
        cut: false,
        doubt: None,
        }
    }

    fn finish(mut self) -> Exchange {
        self.out.cut = self.section.is_some();
        self.close_section(self.text.len());
        if !self.sorted {
            self.map_ids();
        }
        self.out.faults.sort_by_key(|f| f.span.start);
        self.foreign();
        self.out.instances.shrink_to_fit();
        self.out.values.shrink_to_fit();
        self.out
    }

    /// A file that has nothing of an exchange file gets one message, not one per line.
    fn foreign(&mut self) {
        if self.exchange {
            return;
        }
        let (span, what) = looks_like(self.text);
        self.out = Exchange::default();
        self.out.faults.push(Fault { code: code::P21_NOT_AN_EXCHANGE_FILE, span, args: vec![what.into()], related: None });
    }

    fn map_ids(&mut self) {
        let mut map = FxHashMap::default();
        map.reserve(self.out.instances.len());
        for i in 0..self.out.instances.len() {
            let instance = self.out.instances[i];
            if instance.id == 0 && self.text.get(instance.start as usize) != Some(&b'#') {
                continue;
            }
            match map.entry(instance.id) {
                std::collections::hash_map::Entry::Vacant(v) => {
                    v.insert(i as u32);
                }
                std::collections::hash_map::Entry::Occupied(first) => {
                    let head = |n: u32| {
                        let start = self.out.instances[n as usize].start;
                        Span::new(start, run(self.text, start as usize + 1, DIGIT) as u32)
                    };
                    self.out.faults.push(Fault {
                        code: code::P21_DUPLICATE_ID,
                        span: head(i as u32),
                        args: vec![instance.id.to_string()],
                        related: Some((head(*first.get()), "first used here")),
                    });
                }
            }
        }
        self.out.ids = Ids::Map(map);
    }

    fn byte(&self) -> u8 {
        self.text.get(self.at).copied().unwrap_or(0)
    }

    fn blank(&mut self) {
        if self.at < self.text.len() && (self.text[self.at] <= b' ' || matches!(self.text[self.at], b'/' | b'\\')) {
            self.blank_slow();
        }
    }

    #[cold]
    #[inline(never)]
    fn unclosed_comment(&mut self, at: usize) {
        self.fault(code::P21_UNTERMINATED_COMMENT, at, at + 2, vec![]);
        self.cut = true;
    }

    fn blank_slow(&mut self) {
        let from = self.at;
        self.at = skip_blank(self.text, self.at);
        if self.at == self.text.len() {
            // Either the end, or a comment that never closes.
            let mut at = from;
            while at < self.text.len() {
                match lex::comment(self.text, at) {
                    Some(Some(end)) => at = end,
                    Some(None) => return self.unclosed_comment(at),
                    None => at += 1,
                }
            }
        }
    }

    #[cold]
    #[inline(never)]
    fn fault(&mut self, code: Code, start: usize, end: usize, args: Vec<String>) {
        if !self.spoiled {
            self.out.faults.push(Fault { code, span: Span::new(start as u32, end as u32), args, related: None });
            self.spoiled = true;
        }
    }

    #[cold]
    #[inline(never)]
    fn unexpected(&mut self, expected: &str) -> Lost {
        let at = self.at;
        if at >= self.text.len() {
            self.fault(code::P21_ENDS_EARLY, at, at, vec![expected.into()]);
            self.cut = true;
        } else {
            let end = self.shown_end(at);
            let found = String::from_utf8_lossy(&self.text[at..end]).into_owned();
            self.fault(code::P21_UNEXPECTED, at, end, vec![found, expected.into()]);
        }
        Lost
    }

    /// Whether `what` stands at `at`, ignored bytes left out.
    fn reads(&self, mut at: usize, what: &[u8]) -> bool {
        what.iter().all(|w| {
            let (b, p) = peek(self.text, at);
            at = p + 1;
            b == *w
        })
    }

    /// How much of what stands at `at` a message shows.
    fn shown_end(&self, at: usize) -> usize {
        let b = self.text[at];
        let class = match b {
            b'#' => DIGIT,
            _ if is(b, DIGIT | UPPER | LOWER) => DIGIT | UPPER | LOWER,
            _ => 0,
        };
        let mut end = at + 1;
        while class > 0 && end < self.text.len() && is(self.text[end], class) {
            end += 1;
        }
        while end < self.text.len() && self.text[end] & 0xC0 == 0x80 {
            end += 1;
        }
        end
    }

    fn file(&mut self) {
        if self.text.starts_with(b"\xEF\xBB\xBF") {
            self.at = 3;
        }
        loop {
            self.spoiled = false;
            self.doubt = None;
            self.blank();
            if self.at >= self.text.len() {
                return self.ending();
            }
            let from = self.at;
            if self.stage != Stage::Inside {
                self.border();
                if self.at >= self.text.len() {
                    return;
                }
            }
            let lost = match self.byte() {
                b'#' => {
                    if !self.instances {
                        self.misplaced();
                    }
                    self.instance().is_err()
                }
                b'@' | b'<' => self.anchor().is_err(),
                b if is(b, UPPER | LOWER) || b == b'!' => self.word().is_err(),
                b'0'..=b'9' => self.bare_instance().is_err(),
                b';' => {
                    self.unexpected("a statement: the last one has its `;`");
                    self.at += 1;
                    false
                }
                _ => {
                    self.unexpected("an instance (#n=…;) or a section keyword");
                    !self.skip_to_instance()
                }
            };
            if lost {
                self.recover(from);
                self.cut |= self.at >= self.text.len();
            }
        }
    }

    /// What can't stand before an instance: the instance itself is whole.
    #[cold]
    #[inline(never)]
    fn skip_to_instance(&mut self) -> bool {
        let here = &self.text[self.at..];
        let Some(n) = memchr::memchr3(b'#', b';', b'\n', here) else { return false };
        let found = here[n] == b'#' && self.instances && self.starts_statement(self.at + n, false);
        if found {
            self.at += n;
        }
        found
    }

    /// Resumes at the next statement after a fault.
    #[cold]
    #[inline(never)]
    fn recover(&mut self, from: usize) {
        if self.at > from && self.next_begins(self.at) {
            return;
        }
        let mut at = self.at.max(from + 1).min(self.text.len());
        let end = loop {
            let Some(n) = memchr::memchr3(b';', b'\n', b'\r', &self.text[at..]) else { break self.text.len() };
            at += n;
            let next = skip_blank(self.text, at + 1);
            let starts = next >= self.text.len() || self.starts_statement(next, self.text[at] == b';');
            if starts {
                break if self.text[at] == b';' { at + 1 } else { next };
            }
            at += 1;
        };
        self.at = end.max(from + 1).min(self.text.len());
    }

    fn starts_statement(&self, at: usize, after_semicolon: bool) -> bool {
        match self.text[at] {
            b'#' => {
                let digits = run(self.text, at + 1, DIGIT);
                digits > at + 1 && self.text.get(skip_blank(self.text, digits)) == Some(&b'=')
            }
            b if is(b, UPPER | LOWER) => {
                let word = &self.text[at..run(self.text, at, UPPER | LOWER | DIGIT)];
                // Among instances any other word is a part of the damaged statement.
                matches!(word, b"ENDSEC" | b"DATA" | b"HEADER" | b"END") || after_semicolon && self.section_name() != Some("DATA")
            }
            b'@' | b'<' => after_semicolon,
            _ => false,
        }
    }

    /// Whether another statement begins at `at`, the first on its line.
    fn next_begins(&self, at: usize) -> bool {
        let begins = match self.text.get(at) {
            None => false,
            Some(b'#') => begins_instance(self.text, at),
            Some(_) => self.starts_statement(at, false) || self.starts_header_entity(at),
        };
        begins && first_on_line(self.text, at)
    }

    /// A statement that lost its end: the next one begins at `next`, where reading goes on.
    #[cold]
    #[inline(never)]
    fn cut_short(&mut self, next: usize) -> Lost {
        let before = self.text[..next].trim_ascii_end();
        let close = ")".repeat(self.open.len() + 1);
        let why = format!("`{close}` is missing too, and the next statement begins");
        // A comma promises a value that nobody knows.
        let mend = if before.ends_with(b",") { String::new() } else { close + ";" };
        self.fault(code::P21_MISSING_SEMICOLON, before.len(), before.len(), vec![why, mend]);
        self.at = next;
        Lost
    }

    fn keyword(&mut self, start: usize, end: usize) -> u32 {
        if !KEEP {
            return 0;
        }
        let word = &self.text[start..end];
        let mut head = [0; 8];
        let n = word.len().min(8);
        head[..n].copy_from_slice(&word[..n]);
        let tail = if word.len() > 8 { u64::from(word[word.len() - 1]) << 8 | u64::from(word[word.len() - 4]) } else { 0 };
        let head = u64::from_le_bytes(head);
        let slot = ((head ^ tail ^ word.len() as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 58) as usize;
        let (h, len, name) = self.recent[slot];
        if h == head && len == word.len() && name != u32::MAX && self.out.keywords[name as usize].as_bytes() == word {
            return name;
        }
        let clean: Vec<u8> = word.iter().filter(|b| **b >= 0x20).map(u8::to_ascii_uppercase).collect();
        // A blank inside was reported; an underscore was meant.
        let clean: Vec<u8> = clean.split(|b| *b == b' ').filter(|w| !w.is_empty()).collect::<Vec<_>>().join(&b'_');
        let name = match self.names.get(&clean[..]) {
            Some(n) => *n,
            None => {
                let n = self.out.keywords.len() as u32;
                self.out.keywords.push(String::from_utf8_lossy(&clean).into());
                self.names.insert(clean.into(), n);
                n
            }
        };
        self.recent[slot] = (head, word.len(), name);
        name
    }

    /// A keyword: `NAME`, `!NAME`. Returns its end.
    #[inline(always)]
    fn name(&mut self, expected: &str) -> Result<(usize, usize), Lost> {
        let start = self.at;
        let first = if self.byte() == b'!' { peek(self.text, start + 1).1 } else { start };
        if first >= self.text.len() || !is(self.text[first], UPPER | LOWER) {
            return Err(self.unexpected(expected));
        }
        let end = run(self.text, first, UPPER | DIGIT);
        if self.text.get(end).is_some_and(|b| is(*b, LOWER)) {
            let end = run(self.text, first, UPPER | LOWER | DIGIT);
            let word = String::from_utf8_lossy(&self.text[start..end]).into_owned();
            self.fault(code::P21_LOWER_CASE, start, end, vec![word.clone(), word.to_ascii_uppercase()]);
            self.at = end;
            return Ok((start, end));
        }
        self.at = end;
        Ok((start, end))
    }

    fn instance(&mut self) -> Result<(), Lost> {
        let start = self.at;
        self.numbered(start, peek(self.text, start + 1).1)
    }

    /// `31=A(…);`: the `#` is missing. One message; the instance is read.
    #[cold]
    #[inline(never)]
    fn bare_instance(&mut self) -> Result<(), Lost> {
        let start = self.at;
        let digits = run(self.text, start, DIGIT);
        let lost = self.unexpected("an instance (#n=…;) or a section keyword");
        if !self.instances || self.text.get(skip_blank(self.text, digits)) != Some(&b'=') {
            return Err(lost);
        }
        self.numbered(start, start)
    }

    /// `#31A(…);` or `#31:A(…);`: one message, and whether the instance can be read on.
    #[cold]
    #[inline(never)]
    fn without_equals(&mut self) -> Result<(), Lost> {
        let lost = self.unexpected("`=`");
        if self.byte() == b':' {
            self.at += 1;
            self.blank();
        }
        let entity = is(self.byte(), UPPER | LOWER) && self.text.get(skip_blank(self.text, run(self.text, self.at, UPPER | LOWER | DIGIT))) == Some(&b'(');
        if entity || self.byte() == b'(' { Ok(()) } else { Err(lost) }
    }

    fn numbered(&mut self, start: usize, digits: usize) -> Result<(), Lost> {
        let end = run(self.text, digits, DIGIT);
        if end == digits {
            self.at = digits;
            return Err(self.unexpected("the number of an instance"));
        }
        let mut id = 0u64;
        for b in &self.text[digits..end] {
            if *b >= b'0' {
                id = id.wrapping_mul(10).wrapping_add(u64::from(*b - b'0'));
            }
        }
        self.at = end;
        self.blank();
        if self.byte() == b'=' {
            self.at += 1;
        } else {
            self.without_equals()?;
        }
        self.blank();
        if id <= self.last_id {
            self.sorted = false;
            if id == 0 {
                self.fault(code::P21_UNEXPECTED, start, end, vec!["#0".into(), "a number above 0".into()]);
            }
        }
        self.last_id = id;
        self.exchange |= is(self.byte(), UPPER | LOWER) || matches!(self.byte(), b'(' | b'!');
        let n = self.begin(id, start);
        let body = self.body(n).map_err(|lost| self.reopen(lost));
        self.end(n, body.is_err());
        body
    }

    #[inline(always)]
    fn begin(&mut self, id: u64, start: usize) -> usize {
        if id == 0 && self.last_id > 0 {
            // A later section's own parameters stand between the ids.
            self.sorted = false;
        }
        if !KEEP {
            return 0;
        }
        let nameless = self.keyword(start, start);
        self.out.instances.push(Instance {
            id,
            start: start as u32,
            end: start as u32,
            keyword: nameless,
            first_value: self.out.values.len() as u32,
            value_count: 0,
            complex: false,
            damaged: false,
        });
        self.out.instances.len() - 1
    }

    #[inline(always)]
    fn end(&mut self, n: usize, damaged: bool) {
        if !KEEP {
            self.open.clear();
            return;
        }
        for open in self.open.drain(..) {
            // Lists that a fault cut short: what was read so far stays readable.
            let inside = self.out.values.len() as u32 - open - 1;
            let v = &mut self.out.values[open as usize];
            *v = Value::new(v.kind(), v.start, inside);
        }
        let i = &mut self.out.instances[n];
        i.value_count = self.out.values.len() as u32 - i.first_value;
        i.end = self.at as u32;
        i.damaged = damaged;
    }

    fn body(&mut self, n: usize) -> Result<(), Lost> {
        if self.byte() == b'(' {
            if KEEP {
                self.out.instances[n].complex = true;
            }
            self.at += 1;
            let mut first = true;
            loop {
                self.blank();
                if self.byte() == b')' && !first {
                    self.at += 1;
                    break;
                }
                let (s, e) = self.name(if first { "a keyword" } else { "a keyword of this complex instance, or `)`" })?;
                let k = self.keyword(s, e);
                if first {
                    if KEEP {
                        self.out.instances[n].keyword = k;
                    }
                    first = false;
                }
                self.blank();
                if self.byte() != b'(' {
                    return Err(self.unexpected("`(`"));
                }
                self.at += 1;
                self.open_list(Kind::Typed, s)?;
                self.list()?;
            }
        } else if self.byte() == b'<' {
            self.resource()?;
        } else {
            let (s, e) = self.name("an entity keyword, or `(`")?;
            self.blank();
            let e = if self.byte() == b'(' { e } else { self.joined_keyword(s, e) };
            if KEEP {
                self.out.instances[n].keyword = self.keyword(s, e);
            }
            if self.byte() != b'(' {
                return Err(self.unexpected("`(`"));
            }
            self.at += 1;
            self.list()?;
        }
        self.semicolon()
    }

    /// `MILLING TOOL DIMENSION(`: a blank where an underscore was meant. One message; the name is put together.
    #[cold]
    #[inline(never)]
    fn joined_keyword(&mut self, start: usize, end: usize) -> usize {
        let mut last = end;
        loop {
            let at = skip_blank(self.text, last);
            if at >= self.text.len() || !is(self.text[at], UPPER | LOWER) {
                break;
            }
            last = run(self.text, at, UPPER | LOWER | DIGIT);
        }
        let at = skip_blank(self.text, last);
        if last > end && self.text.get(at) == Some(&b'(') {
            let written = String::from_utf8_lossy(&self.text[start..last]).into_owned();
            let meant: Vec<&str> = written.split_whitespace().collect();
            self.fault(code::P21_BLANK_IN_KEYWORD, start, last, vec![written.clone(), meant.join("_")]);
            self.at = at;
            return last;
        }
        end
    }

    fn starts_header_entity(&self, at: usize) -> bool {
        self.section_name() == Some("HEADER") && is(self.text[at], UPPER) && self.text.get(skip_blank(self.text, run(self.text, at, UPPER))) == Some(&b'(')
    }

    fn semicolon(&mut self) -> Result<(), Lost> {
        let after = self.at;
        self.blank();
        match self.byte() {
            b';' => {
                self.at += 1;
                Ok(())
            }
            b':' => {
                self.fault(code::P21_MISSING_SEMICOLON, self.at, self.at + 1, vec!["`:` stands in its place".into(), ";".into()]);
                self.at += 1;
                self.blank();
                if self.byte() == b';' {
                    self.at += 1;
                }
                Ok(())
            }
            _ if self.at < self.text.len() && (self.starts_statement(self.at, false) || self.starts_header_entity(self.at)) => {
                self.fault(code::P21_MISSING_SEMICOLON, after, after, vec!["the next statement begins".into(), ";".into()]);
                Ok(())
            }
            _ => Err(self.unexpected("`;`")),
        }
    }

    #[inline(always)]
    fn open_list(&mut self, kind: Kind, start: usize) -> Result<(), Lost> {
        if self.open.len() >= DEPTH {
            self.fault(code::P21_TOO_DEEP, start, start + 1, vec![DEPTH.to_string()]);
            return Err(Lost);
        }
        self.open.push(self.out.values.len() as u32);
        if KEEP {
            self.out.values.push(Value::new(kind, start as u32, 0));
        }
        Ok(())
    }

    fn close_list(&mut self) {
        if let Some(open) = self.open.pop()
            && KEEP
        {
            let inside = self.out.values.len() as u32 - open - 1;
            let v = &mut self.out.values[open as usize];
            *v = Value::new(v.kind(), v.start, inside);
        }
    }

    /// Parameters up to the `)` that closes what was open when it began. `self.at` is behind the `(`.
    fn list(&mut self) -> Result<(), Lost> {
        let floor = self.open.len();
        // An entity's own parameter list is not a value, so it leaves nothing open.
        let own = floor == 0;
        let floor = if own { 0 } else { floor - 1 };
        self.blank();
        if self.byte() == b')' {
            self.at += 1;
            if !own {
                self.close_list();
            }
            if self.open.len() <= floor {
                return Ok(());
            }
        }
        loop {
            // One value.
            self.blank();
            let start = self.at;
            match self.byte() {
                b'#' => {
                    let digits = peek(self.text, start + 1).1;
                    let end = run(self.text, digits, DIGIT);
                    if end == digits {
                        self.constant(start)?;
                    } else {
                        self.push(Kind::Reference, start, end);
                    }
                }
                b'0'..=b'9' | b'+' | b'-' => match lex::number(self.text, start) {
                    Some((real, end)) if !self.text.get(end).is_some_and(|b| is(*b, UPPER | LOWER | DIGIT) || *b == b'.') => {
                        self.push(if real { Kind::Real } else { Kind::Integer }, start, end);
                    }
                    _ => self.bad_number(start),
                },
                b'\'' => self.string(start)?,
                b'$' => self.push(Kind::Unset, start, start + 1),
                b'*' => self.push(Kind::Derived, start, start + 1),
                b'.' => self.enumeration(start)?,
                b'(' => {
                    self.open_list(Kind::List, start)?;
                    self.at += 1;
                    self.blank();
                    if self.byte() != b')' {
                        continue;
                    }
                }
                b'"' => self.binary(start)?,
                b'<' | b'@' => self.resource()?,
                b',' | b')' => {
                    let before = if self.byte() == b',' { "`,`" } else { "`)`" };
                    self.fault(code::P21_EMPTY_PARAMETER, start, start + 1, vec![before.into()]);
                    self.push(Kind::Bad, start, start);
                }
                b if is(b, UPPER | LOWER) || b == b'!' => {
                    let word = run(self.text, start + 1, UPPER | LOWER | DIGIT);
                    if self.text.get(skip_blank(self.text, word)) != Some(&b'(') {
                        if self.next_begins(start) {
                            return Err(self.cut_short(start));
                        }
                        let written = String::from_utf8_lossy(&self.text[start..word]).into_owned();
                        let number = ["NAN", "INF", "INFINITY"].iter().any(|n| written.eq_ignore_ascii_case(n));
                        let code = if number { code::P21_BAD_NUMBER } else { code::P21_BARE_WORD };
                        self.fault(code, start, word, vec![written]);
                        self.push(Kind::Bad, start, word);
                    } else if self.section_name() == Some("HEADER") && first_on_line(self.text, start) && is_header_entity(&self.text[start..word]) {
                        return Err(self.cut_short(start));
                    } else {
                        let (s, _) = self.name("a value")?;
                        self.blank();
                        if self.byte() != b'(' {
                            return Err(self.unexpected("`(`"));
                        }
                        self.open_list(Kind::Typed, s)?;
                        self.at += 1;
                        self.blank();
                        if self.byte() != b')' {
                            continue;
                        }
                    }
                }
                _ => return Err(self.unexpected("a value")),
            }
            // What follows it.
            loop {
                self.blank();
                match self.byte() {
                    b',' => {
                        self.at += 1;
                        break;
                    }
                    b')' => {
                        self.at += 1;
                        if self.open.len() <= floor + usize::from(!own) {
                            if !own {
                                self.close_list();
                            }
                            return Ok(());
                        }
                        self.close_list();
                    }
                    _ => return Err(self.no_separator(start)),
                }
            }
        }
    }

    /// Something else than `,` or `)` follows a value. A string that ends in a comma, with a word behind it,
    /// lacks its own apostrophe and took the next one's.
    #[cold]
    #[inline(never)]
    fn no_separator(&mut self, value: usize) -> Lost {
        if self.next_begins(self.at) {
            return self.cut_short(self.at);
        }
        if self.byte() == b'=' && self.next_begins(value) {
            // What was read as a reference is the name of the next instance.
            if KEEP {
                self.out.values.pop();
            }
            return self.cut_short(value);
        }
        let inside = self.text.get(value + 1..self.at).unwrap_or(&[]).trim_ascii_end();
        let took = inside.strip_suffix(b"'").is_some_and(|s| matches!(s.trim_ascii_end().last(), Some(b',' | b'(')));
        if took && self.text[value] == b'\'' && self.at < self.text.len() {
            self.fault(code::P21_UNTERMINATED_STRING, value, value + 1, vec![]);
            return Lost;
        }
        self.unexpected("`,` or `)`")
    }

    #[inline(always)]
    fn push(&mut self, kind: Kind, start: usize, end: usize) {
        if KEEP {
            self.out.values.push(Value::new(kind, start as u32, (end - start) as u32));
        }
        self.at = end;
    }

    #[cold]
    #[inline(never)]
    fn bad_number(&mut self, start: usize) {
        let mut end = start + 1;
        while end < self.text.len() && (is(self.text[end], DIGIT | UPPER | LOWER) || matches!(self.text[end], b'.' | b'+' | b'-')) {
            end += 1;
        }
        let written = String::from_utf8_lossy(&self.text[start..end]).into_owned();
        self.fault(code::P21_BAD_NUMBER, start, end, vec![written]);
        self.push(Kind::Bad, start, end);
    }

    #[inline(always)]
    fn string(&mut self, start: usize) -> Result<(), Lost> {
        match lex::string(self.text, start) {
            Some(end) if end - start < 7 || first_statement(&self.text[start + 1..end]).is_none() || self.closes(start, end) => {
                if let Err((at, what)) = crate::text::check(&self.text[start + 1..end - 1]) {
                    let from = start + 1 + at;
                    self.fault(code::P21_BAD_ESCAPE, from, (from + 1).min(end), vec![what.into()]);
                }
                self.push(Kind::String, start, end);
                Ok(())
            }
            _ => {
                self.fault(code::P21_UNTERMINATED_STRING, start, start + 1, vec![]);
                self.at = start + 1;
                Err(Lost)
            }
        }
    }

    /// A string that holds the start of a statement is kept where a value may end behind it.
    #[cold]
    #[inline(never)]
    fn closes(&mut self, start: usize, end: usize) -> bool {
        if !ends_value(self.text, end) {
            return false;
        }
        let lines = memchr::memchr2(b'\n', b'\r', &self.text[start..end]).is_some();
        if lines && self.doubt.is_none() {
            let (values, faults) = (self.out.values.len(), self.out.faults.len());
            self.doubt = Some(Doubt { start, values, faults, spoiled: self.spoiled });
        }
        true
    }

    /// A statement that makes no sense with such a string closed: the string never was.
    #[cold]
    #[inline(never)]
    fn reopen(&mut self, lost: Lost) -> Lost {
        if let Some(d) = self.doubt.take() {
            self.out.faults.truncate(d.faults);
            self.out.values.truncate(d.values);
            self.open.retain(|open| (*open as usize) < d.values);
            self.spoiled = d.spoiled;
            self.fault(code::P21_UNTERMINATED_STRING, d.start, d.start + 1, vec![]);
            self.at = d.start + 1;
        }
        lost
    }

    /// `#NAME`: a constant of the schema, edition 3.
    #[cold]
    #[inline(never)]
    fn constant(&mut self, start: usize) -> Result<(), Lost> {
        let name = peek(self.text, start + 1).1;
        if name < self.text.len() && is(self.text[name], UPPER) {
            let end = run(self.text, name, UPPER | DIGIT);
            self.push(Kind::Resource, start, end);
            return Ok(());
        }
        self.at = name;
        Err(self.unexpected("the number of an instance"))
    }

    #[inline(always)]
    fn enumeration(&mut self, start: usize) -> Result<(), Lost> {
        let first = peek(self.text, start + 1).1;
        let end = run(self.text, first, UPPER | DIGIT);
        let (dot, p) = peek(self.text, end);
        if end > first && dot == b'.' && !is(self.text[first], DIGIT) {
            self.push(Kind::Enumeration, start, p + 1);
            return Ok(());
        }
        self.bad_enumeration(start)
    }

    #[cold]
    #[inline(never)]
    fn bad_enumeration(&mut self, start: usize) -> Result<(), Lost> {
        let end = run(self.text, start + 1, UPPER | LOWER | DIGIT);
        let close = usize::from(self.text.get(end) == Some(&b'.'));
        let written = String::from_utf8_lossy(&self.text[start..end + close]).into_owned();
        if end > start + 1 && is(self.text[start + 1], DIGIT) {
            self.fault(code::P21_BAD_NUMBER, start, end + close, vec![written]);
        } else if close == 1 && end > start + 1 {
            self.fault(code::P21_LOWER_CASE, start, end + 1, vec![written.clone(), written.to_ascii_uppercase()]);
            self.push(Kind::Enumeration, start, end + 1);
            return Ok(());
        } else {
            self.fault(code::P21_BAD_ENUMERATION, start, end, vec![written]);
        }
        self.push(Kind::Bad, start, end + close);
        Ok(())
    }

    fn binary(&mut self, start: usize) -> Result<(), Lost> {
        let mut at = start + 1;
        while at < self.text.len() && (self.text[at].is_ascii_hexdigit() && !self.text[at].is_ascii_lowercase() || self.text[at] < 0x20) {
            at += 1;
        }
        let digits = self.text[start + 1..at].iter().filter(|b| **b >= 0x20).count();
        let first = self.text[start + 1..at].iter().find(|b| **b >= 0x20);
        if self.text.get(at) == Some(&b'"') && digits > 0 && matches!(first, Some(b'0'..=b'3')) {
            self.push(Kind::Binary, start, at + 1);
            return Ok(());
        }
        if self.text.get(at) == Some(&b'"') {
            self.fault(code::P21_BAD_BINARY, start, at + 1, vec![]);
            self.push(Kind::Bad, start, at + 1);
            return Ok(());
        }
        let word = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b' ' | b'_' | b'-' | b'.');
        let inside = self.text[start + 1..].iter().take_while(|b| word(b)).count();
        if inside > 0 && self.text.get(start + 1 + inside) == Some(&b'"') {
            self.fault(code::P21_BAD_BINARY, start, start + inside + 2, vec![]);
            self.push(Kind::Bad, start, start + inside + 2);
            return Ok(());
        }
        // Two apostrophes read as one quotation mark, as scanned listings have it.
        self.fault(code::P21_STRAY_QUOTE, start, start + 1, vec![]);
        self.push(Kind::Bad, start, start + 1);
        Ok(())
    }

    /// `<uri>`, `@name`.
    fn resource(&mut self) -> Result<(), Lost> {
        let start = self.at;
        let end = if self.byte() == b'<' {
            match memchr::memchr2(b'>', b';', &self.text[start..]) {
                Some(n) if self.text[start + n] == b'>' => start + n + 1,
                _ => return Err(self.unexpected("a resource <…> that closes")),
            }
        } else {
            let end = run(self.text, start + 1, DIGIT | UPPER | LOWER);
            if end == start + 1 {
                return Err(self.unexpected("a value"));
            }
            end
        };
        self.push(Kind::Resource, start, end);
        Ok(())
    }

}
