//! The frame of a file: its first and last statement, sections, header entities, anchors.

use gr_spec::code;
use gr_text::Span;

use super::{Lost, Parser, Stage};
use crate::index::skip_blank;
use crate::lex::{DIGIT, LOWER, UPPER, is, peek, run};
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
            self.blank();
            if self.byte() != b'=' {
                return Err(self.unexpected("`=`"));
            }
            self.at += 1;
            // The value, and tags in braces, are read as they stand.
            match memchr::memchr(b';', &self.text[self.at..]) {
                Some(n) => {
                    let (s, e) = (skip_blank(self.text, self.at), self.at + n);
                    self.push(Kind::Resource, s.min(e), e);
                    self.at = e + 1;
                    Ok(())
                }
                None => {
                    self.at = self.text.len();
                    Err(self.unexpected("`;`"))
                }
            }
        };
        let result = body();
        self.end(n, result.is_err());
        result
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
        let clean: Vec<u8> = self.text[start..end].iter().filter(|b| **b >= 0x20).map(u8::to_ascii_uppercase).collect();
        let name = match &clean[..] {
            b"HEADER" => "HEADER",
            b"DATA" => "DATA",
            b"ANCHOR" => "ANCHOR",
            b"REFERENCE" => "REFERENCE",
            b"SIGNATURE" => "SIGNATURE",
            b"ISO" | b"END" => {
                let end = memchr::memchr(b';', &self.text[start..]).map_or(self.text.len(), |n| start + n).min(start + 64);
                let line: Vec<u8> = self.text[start..end].iter().copied().filter(|b| *b > 0x20).collect();
                let last = line.starts_with(b"END-ISO-10303-21");
                if last || line.starts_with(b"ISO-10303-21") {
                    self.exchange = true;
                    if last && self.stage == Stage::Inside {
                        self.still_open(start, end);
                        self.stage = Stage::Ended;
                    }
                    self.at = start + self.text[start..end].iter().rposition(|b| *b == b'1').map_or(0, |n| n + 1);
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
        self.semicolon()?;
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
