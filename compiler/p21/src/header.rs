//! The entities of the header: the same in every schema.

use gr_spec::code;
use gr_text::Span;

use crate::model::{Exchange, Fault, Kind, Value, members};

/// What a value of the header is.
#[derive(Clone, Copy)]
enum Takes {
    Text,
    Texts,
    /// `$` or a string.
    MaybeText,
    /// `$` or a list of strings.
    MaybeTexts,
    /// Lists of lists: not looked into.
    Lists,
}

type Row = (&'static str, &'static [(&'static str, Takes)]);

/// ISO 10303-21: the three that every header has, in their order, and those of editions 2 and 3.
static ENTITIES: &[Row] = &[
    ("FILE_DESCRIPTION", &[("description", Takes::Texts), ("implementation_level", Takes::Text)]),
    (
        "FILE_NAME",
        &[
            ("name", Takes::Text),
            ("time_stamp", Takes::Text),
            ("author", Takes::Texts),
            ("organization", Takes::Texts),
            ("preprocessor_version", Takes::Text),
            ("originating_system", Takes::Text),
            ("authorization", Takes::Text),
        ],
    ),
    ("FILE_SCHEMA", &[("schema_identifiers", Takes::Texts)]),
    ("SCHEMA_POPULATION", &[("external_file_locations", Takes::Lists)]),
    (
        "FILE_POPULATION",
        &[("governing_schema", Takes::Text), ("determination_method", Takes::Text), ("governed_sections", Takes::MaybeTexts)],
    ),
    ("SECTION_LANGUAGE", &[("section", Takes::MaybeText), ("default_language", Takes::Text)]),
    ("SECTION_CONTEXT", &[("section", Takes::MaybeText), ("context_identifiers", Takes::Texts)]),
];

const LEVELS: &[&str] = &["1", "2;1", "2;2", "3;1", "3;2", "4;1", "4;2", "4;3"];

/// Compares the header with Part 21. Lack of a FILE_SCHEMA is left to those who know schemas.
pub fn check_header(text: &[u8], file: &Exchange) -> Vec<Fault> {
    let Some(section) = file.sections.iter().find(|s| s.name == "HEADER") else { return Vec::new() };
    let mut check = Check { text, file, faults: Vec::new() };
    let mut seen = [false; 3];
    // A file that was cut off says so.
    let mut unsure = file.faults.iter().any(|f| f.code == code::P21_ENDS_EARLY);
    for n in section.instances.clone() {
        let keyword = file.keyword(n);
        unsure |= file.instances[n as usize].damaged;
        if keyword.starts_with('!') || text.get(file.instances[n as usize].start as usize) == Some(&b'#') {
            continue;
        }
        let Some(place) = ENTITIES.iter().position(|(k, _)| *k == keyword) else {
            unsure = true;
            check.misplaced(n, "FILE_DESCRIPTION, FILE_NAME, FILE_SCHEMA or another entity of the header");
            continue;
        };
        if seen.get(place) == Some(&true) {
            check.misplaced(n, "it once only");
        } else if seen.iter().skip(place + 1).any(|s| *s) {
            check.misplaced(n, "the order FILE_DESCRIPTION, FILE_NAME, FILE_SCHEMA");
        } else if !file.instances[n as usize].damaged {
            check.entity(n, &ENTITIES[place]);
        }
        if let Some(s) = seen.get_mut(place) {
            *s = true;
        }
    }
    let start = section.span.start;
    let span = Span::new(start, start + section.name.len() as u32);
    // The one that is missing may be the one that can't be read.
    for (row, _) in ENTITIES.iter().take(2).zip(seen).filter(|(_, seen)| !seen && !unsure) {
        check.faults.push(Fault { code: code::P21_HEADER_MISSING, span, args: vec![row.0.into()], related: None });
    }
    check.faults
}

struct Check<'a> {
    text: &'a [u8],
    file: &'a Exchange,
    faults: Vec<Fault>,
}

impl Check<'_> {
    fn keyword_span(&self, n: u32) -> Span {
        let start = self.file.instances[n as usize].start;
        let word = self.text[start as usize..].iter().take_while(|b| b.is_ascii_alphanumeric() || **b == b'_' || **b < b' ');
        Span::new(start, start + word.count() as u32)
    }

    fn misplaced(&mut self, n: u32, expected: &str) {
        let args = vec![self.file.keyword(n).into(), expected.into()];
        let span = self.keyword_span(n);
        self.faults.push(Fault { code: code::P21_UNEXPECTED, span, args, related: None });
    }

    /// The first thing wrong with an entity of the header.
    fn entity(&mut self, n: u32, (keyword, values): &Row) {
        let written: Vec<&[Value]> = self.file.parameters(n).collect();
        if written.len() != values.len() {
            let names: Vec<&str> = values.iter().map(|v| v.0).collect();
            let args = vec![keyword.to_string(), values.len().to_string(), written.len().to_string(), names.join(", ")];
            let span = self.keyword_span(n);
            self.faults.push(Fault { code: code::P21_HEADER_COUNT, span, args, related: None });
            return;
        }
        for ((name, takes), value) in values.iter().zip(written) {
            if let Some((v, what)) = wrong(*takes, value) {
                let args = vec![keyword.to_string(), name.to_string(), what.into(), v.kind().describe().into()];
                let span = self.span(v);
                self.faults.push(Fault { code: code::P21_HEADER_TYPE, span, args, related: None });
                return;
            }
            if *name == "implementation_level" {
                self.level(value[0]);
            }
        }
    }

    fn level(&mut self, v: Value) {
        let Some(level) = self.file.string(self.text, v) else { return };
        let clean: String = level.split_whitespace().collect();
        if !LEVELS.contains(&clean.as_str()) {
            let (span, args) = (self.span(v), vec![level.into_owned()]);
            self.faults.push(Fault { code: code::P21_IMPLEMENTATION_LEVEL, span, args, related: None });
        }
    }

    fn span(&self, v: Value) -> Span {
        let start = v.start;
        let len = if matches!(v.kind(), Kind::List | Kind::Typed) { 1 } else { v.len() };
        Span::new(start, start + len)
    }
}

/// The value that is of another kind, and the kind that is wanted.
fn wrong(takes: Takes, value: &[Value]) -> Option<(Value, &'static str)> {
    let v = value[0];
    let text = |v: Value| matches!(v.kind(), Kind::String | Kind::Bad);
    let texts = || {
        if v.kind() != Kind::List {
            return Some((v, "a list of strings"));
        }
        members(&value[1..]).map(|m| m[0]).find(|m| !text(*m)).map(|m| (m, "strings"))
    };
    match takes {
        _ if v.kind() == Kind::Bad => None,
        Takes::MaybeText | Takes::MaybeTexts if v.kind() == Kind::Unset => None,
        Takes::Text | Takes::MaybeText => (!text(v)).then_some((v, "a string")),
        Takes::Texts | Takes::MaybeTexts => texts(),
        Takes::Lists => (v.kind() != Kind::List).then_some((v, "a list")),
    }
}
