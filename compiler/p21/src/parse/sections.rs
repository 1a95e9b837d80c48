//! The frame of a file: its first and last statement, sections, header entities, anchors.

use gr_spec::code;
use gr_text::Span;

use super::{Lost, Parser, Stage};
use crate::index::{first_on_line, skip_blank};
use crate::lex::{self, DIGIT, LOWER, UPPER, is, peek, run};
use crate::model::{Kind, Section};

impl<const KEEP: bool> Parser<'_, KEEP> {
    /// Points also at where the open section begins.
    #[cold]
    pub(super) fn point_at_section(&mut self) {
        let Some(open) = self.section else { return };
        let start = self.out.sections[open].span.start;
        let end = start + self.out.sections[open].name.len() as u32;
        if let Some(f) = self.out.faults.last_mut() {
            f.related = Some((Span::new(start, end), "this section is still open"));
        }
    }

    pub(super) fn section_name(&self) -> Option<&'static str> {
        self.section.map(|s| self.out.sections[s].name)
    }

    /// The first and the last statement of a file.
    #[cold]
    #[inline(never)]
    pub(super) fn border(&mut self) {
        match self.stage {
            Stage::Start => {
                self.stage = Stage::Inside;
                self.magic = self.reads(self.at, b"ISO-10303-21");
                if !self.magic {
                    self.unexpected("`ISO-10303-21;`");
                    self.loose = true;
                    self.instances = true;
                }
            }
            Stage::Ended if self.section.is_none() && !self.reads(self.at, b"SIGNATURE") => {
                // It belongs to no file: nothing of it is read.
                self.unexpected("the end of the file");
                self.at = self.text.len();
                self.cut = true;
            }
            _ => {}
        }
    }

    /// An instance where none may stand: told once.
    #[cold]
    #[inline(never)]
    pub(super) fn misplaced(&mut self) {
        self.instances = true;
        match self.section_name() {
            Some(_) => drop(self.unexpected("a header entity, or `ENDSEC;`")),
            None => {
                self.unexpected("`DATA;`");
                self.loose = true;
            }
        }
    }

    /// What the end of the text leaves open.
    #[cold]
    #[inline(never)]
    pub(super) fn ending(&mut self) {
        if self.cut {
            return;
        }
        if self.section.is_some() {
            self.unexpected("`ENDSEC;`");
            self.point_at_section();
        } else if self.magic && self.stage == Stage::Inside {
            self.unexpected("`END-ISO-10303-21;`");
        }
    }

    /// `<name>=value;` in ANCHOR, `@1=<uri>;` in REFERENCE.
    pub(super) fn anchor(&mut self) -> Result<(), Lost> {
        let start = self.at;
        let n = self.begin(0, start);
        let mut body = || -> Result<(), Lost> {
            self.resource()?;
            let name = &self.text[start..self.at];
            if self.section_name() == Some("ANCHOR") && !self.anchors.insert(name.into()) {
                let written = String::from_utf8_lossy(name).into_owned();
                self.fault(code::P21_UNEXPECTED, start, self.at, vec![written, "a name that no other anchor has".into()]);
            }
            self.blank();
            if self.byte() != b'=' {
                return Err(self.unexpected("`=`"));
            }
            self.at += 1;
            self.item()?;
            while {
                self.blank();
                self.byte() == b'{'
            } {
                self.tag()?;
            }
            if matches!(self.byte(), b'<' | b'@') && first_on_line(self.text, self.at) {
                let end = self.text[..self.at].trim_ascii_end().len();
                self.fault(code::P21_MISSING_SEMICOLON, end, end, vec!["the next statement begins".into(), ";".into()]);
                return Ok(());
            }
            self.semicolon()
        };
        let result = body();
        self.end(n, result.is_err());
        result
    }

    /// A value on its own: that of an anchor, or of its tag.
    fn item(&mut self) -> Result<(), Lost> {
        self.blank();
        let start = self.at;
        match self.byte() {
            b'(' => {
                self.open_list(Kind::List, start)?;
                self.at += 1;
                return self.list();
            }
            b'#' => {
                let digits = peek(self.text, start + 1).1;
                let end = run(self.text, digits, DIGIT);
                if end == digits {
                    return self.constant(start);
                }
                self.push(Kind::Reference, start, end);
            }
            b'0'..=b'9' | b'+' | b'-' => match lex::number(self.text, start) {
                Some((real, end)) if !self.text.get(end).is_some_and(|b| is(*b, UPPER | LOWER | DIGIT) || *b == b'.') => {
                    self.push(if real { Kind::Real } else { Kind::Integer }, start, end);
                }
                _ => self.bad_number(start),
            },
            b'\'' => return self.string(start),
            b'$' => self.push(Kind::Unset, start, start + 1),
            b'.' => return self.enumeration(start),
            b'"' => return self.binary(start),
            b'<' | b'@' => return self.resource(),
            _ => return Err(self.unexpected("a value")),
        }
        Ok(())
    }

    /// `{name:value}`
    fn tag(&mut self) -> Result<(), Lost> {
        self.at += 1;
        self.blank();
        let end = run(self.text, self.at, UPPER | LOWER | DIGIT);
        if end == self.at {
            return Err(self.unexpected("the name of a tag"));
        }
        self.at = end;
        self.blank();
        if self.byte() != b':' {
            return Err(self.unexpected("`:`"));
        }
        self.at += 1;
        self.item()?;
        self.blank();
        if self.byte() != b'}' {
            return Err(self.unexpected("`}`"));
        }
        self.at += 1;
        Ok(())
    }

    /// The section keyword that a word with a slip of the pen can only mean here; told once.
    fn slip(&mut self, word: &[u8], end: usize) -> &'static str {
        let next = peek(self.text, skip_blank(self.text, end)).0;
        let meant: &[&'static str] = match self.section_name() {
            Some(_) => &["ENDSEC"],
            None if self.headed => &["DATA", "ANCHOR", "REFERENCE"],
            None => &["HEADER"],
        };
        let near = |m: &&&'static str| near(m.as_bytes(), word);
        let Some(name) = meant.iter().find(near).filter(|_| next == b';' && self.stage == Stage::Inside && !self.loose) else { return "" };
        self.unexpected(&format!("`{name};`"));
        name
    }

    pub(super) fn close_section(&mut self, end: usize) {
        if let Some(s) = self.section.take() {
            let count = self.out.instances.len() as u32;
            let section = &mut self.out.sections[s];
            section.span.end = end as u32;
            section.instances.end = count;
        }
        self.instances = self.loose;
    }

    /// A section keyword or `ENDSEC` in small letters.
    pub(super) fn capitals(&mut self, start: usize, end: usize) {
        if self.text[start..end].iter().any(|b| is(*b, LOWER)) {
            let word = String::from_utf8_lossy(&self.text[start..end]).into_owned();
            self.fault(code::P21_LOWER_CASE, start, end, vec![word.clone(), word.to_ascii_uppercase()]);
        }
    }

    /// Where a section or the file ends and another section is still open.
    pub(super) fn still_open(&mut self, start: usize, end: usize) {
        let Some(what) = self.section_name() else { return };
        self.fault(code::P21_MISSING_ENDSEC, start, end, vec![what.into()]);
        self.point_at_section();
        self.close_section(start);
    }

    /// One past a word outside of instances. A line's end is not part of it where the line is a section's keyword
    /// that lacks its semicolon.
    pub(super) fn word_end(&self, start: usize) -> usize {
        let line = start + self.text[start..].iter().position(|b| !is(*b, UPPER | LOWER | DIGIT)).unwrap_or(self.text.len() - start);
        let known = matches!(&self.text[start..line], b"HEADER" | b"DATA" | b"ANCHOR" | b"REFERENCE" | b"SIGNATURE" | b"ENDSEC");
        if known { line } else { run(self.text, start, UPPER | LOWER | DIGIT) }
    }

    pub(super) fn word(&mut self) -> Result<(), Lost> {
        let start = self.at;
        let end = self.word_end(start);
        let mut clean: Vec<u8> = self.text[start..end].iter().filter(|b| **b >= 0x20).map(u8::to_ascii_uppercase).collect();
        if !matches!(&clean[..], b"HEADER" | b"DATA" | b"ANCHOR" | b"REFERENCE" | b"SIGNATURE" | b"ISO" | b"END" | b"ENDSEC") {
            let slip = self.slip(&clean, end);
            if !slip.is_empty() {
                clean = slip.into();
            }
        }
        let name = match &clean[..] {
            b"HEADER" => "HEADER",
            b"DATA" => "DATA",
            b"ANCHOR" => "ANCHOR",
            b"REFERENCE" => "REFERENCE",
            b"SIGNATURE" => "SIGNATURE",
            b"ISO" | b"END" => {
                let end = memchr::memchr(b';', &self.text[start..]).map_or(self.text.len(), |n| start + n).min(start + 64);
                let line: Vec<u8> = self.text[start..end].iter().copied().filter(|b| *b > 0x20).collect();
                let right = line.starts_with(b"END-ISO-10303-21");
                let slip = !right && clean == b"END" && line.starts_with(b"END-ISO") && self.stage == Stage::Inside;
                if slip {
                    self.unexpected("`END-ISO-10303-21;`");
                }
                let last = right || slip;
                if last || line.starts_with(b"ISO-10303-21") {
                    self.exchange = true;
                    if last && self.stage == Stage::Inside {
                        self.still_open(start, end);
                        self.stage = Stage::Ended;
                    }
                    self.at = if slip { end } else { start + self.text[start..end].iter().rposition(|b| *b == b'1').map_or(0, |n| n + 1) };
                    return self.semicolon();
                }
                ""
            }
            b"ENDSEC" => {
                if self.section.is_none() && !self.loose {
                    self.unexpected("a section keyword or `END-ISO-10303-21;`");
                }
                self.capitals(start, end);
                self.at = end;
                let result = self.semicolon();
                self.close_section(self.at);
                return result;
            }
            _ => "",
        };
        let (next, _) = peek(self.text, skip_blank(self.text, end));
        if name.is_empty() || (name == "DATA" && !matches!(next, b';' | b'(' | b':' | b'#')) {
            return self.header_entity();
        }
        if self.section.is_some() {
            self.still_open(start, end);
            self.spoiled = false;
        }
        if name != "HEADER" && name != "SIGNATURE" && !self.headed && self.magic {
            self.unexpected("`HEADER;`");
        }
        if name == "HEADER" && self.headed && self.magic {
            self.unexpected("`DATA;`: the file has a HEADER");
        }
        self.capitals(start, end);
        self.headed = true;
        self.instances = name != "HEADER";
        self.exchange = true;
        self.section = Some(self.out.sections.len());
        let count = self.out.instances.len() as u32;
        self.out.sections.push(Section { name, span: Span::new(start as u32, start as u32), instances: count..count });
        self.at = end;
        if next == b'(' {
            self.blank();
            self.at += 1;
            let n = self.begin(0, start);
            if KEEP {
                self.out.instances[n].keyword = self.keyword(start, end);
            }
            let result = self.list().map_err(|lost| self.reopen(lost));
            self.end(n, result.is_err());
            result?;
        }
        if name != "SIGNATURE" || next == b';' {
            self.semicolon()?;
        }
        if name == "SIGNATURE" {
            // Encoded bytes up to the end of the section.
            match memchr::memmem::find(&self.text[self.at..], b"ENDSEC") {
                Some(n) => self.at += n,
                None => self.at = self.text.len(),
            }
        }
        Ok(())
    }

    pub(super) fn header_entity(&mut self) -> Result<(), Lost> {
        let start = self.at;
        let word = run(self.text, start + usize::from(self.byte() == b'!'), UPPER | LOWER | DIGIT);
        self.exchange |= self.text[start..].starts_with(b"FILE_");
        if peek(self.text, skip_blank(self.text, word)).0 != b'(' {
            return Err(self.unexpected("an instance (#n=…;) or a section keyword"));
        }
        match self.section_name() {
            Some("HEADER") => {}
            Some(_) => return Err(self.unexpected("an instance (#n=…;) or `ENDSEC;`")),
            None if self.loose => {}
            None if self.headed => return Err(self.unexpected("a section keyword or `END-ISO-10303-21;`")),
            None => {
                self.unexpected("`HEADER;`");
                (self.headed, self.loose) = (true, true);
            }
        }
        let (s, e) = self.name("a section keyword or a header entity")?;
        self.blank();
        if self.byte() != b'(' {
            return Err(self.unexpected("`(`"));
        }
        self.at += 1;
        let n = self.begin(0, start);
        if KEEP {
            self.out.instances[n].keyword = self.keyword(s, e);
        }
        let body = self.list();
        let body = body.and_then(|()| self.semicolon()).map_err(|lost| self.reopen(lost));
        self.end(n, body.is_err());
        body
    }
}

/// Whether a word is a keyword with one letter wrong, missing, too many, or two that changed places.
fn near(keyword: &[u8], word: &[u8]) -> bool {
    let same = keyword.iter().zip(word).take_while(|(a, b)| a == b).count();
    let (a, b) = (&keyword[same..], &word[same..]);
    match (a, b) {
        ([], [_]) | ([_], []) => true,
        ([_, a @ ..], [_, b @ ..]) if a == b => true,
        ([_, a @ ..], b) if a == b => true,
        (a, [_, b @ ..]) if a == b => true,
        ([p, q, a @ ..], [r, s, b @ ..]) => p == s && q == r && a == b,
        _ => false,
    }
}
