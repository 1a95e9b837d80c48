//! Does a file keep to the schema: known keywords, number and type of attributes, references of the right kind.

use gr_p21::{Exchange, Fault, Kind, Value};
use gr_spec::{Code, code};
use gr_text::Span;

use crate::schema::{Entity, Schema, Type, schema};

/// Other spellings that public files use, and what the standard has. Accepted with a warning.
static ALIASES: &[(&str, &str)] = &[
    ("BIDIRECTIONAL_MILLING", "BIDIRECTIONAL"),
    ("UNIDIRECTIONAL_MILLING", "UNIDIRECTIONAL"),
    ("CENTER_DRILL", "CENTERDRILL"),
    ("TOOL_DIMENSION", "MILLING_TOOL_DIMENSION"),
    ("NGON_CLOSED_PROFILE", "NGON_PROFILE"),
    ("WOORDRUFF_KEYSEAT_MILL", "WOODRUFF_KEYSEAT_MILL"),
    ("WEEEK_OF_YEAR_AND_DAY_DATE", "WEEK_OF_YEAR_AND_DAY_DATE"),
];

/// Checks every instance. Instances that Part 21 already calls damaged are left alone.
pub fn check(text: &[u8], file: &Exchange) -> Vec<Fault> {
    let schema = schema();
    let mut check = Check { text, file, schema, faults: Vec::new(), known: Vec::new() };
    check.known = file.keywords.iter().map(|k| check.resolve(k)).collect();
    for n in 0..file.instances.len() as u32 {
        let i = &file.instances[n as usize];
        if !i.damaged && !i.complex && text.get(i.start as usize) == Some(&b'#') {
            check.instance(n);
        }
    }
    check.faults
}

/// What a keyword of the file is: rows of the table, and the standard's name when the file uses another.
#[derive(Clone)]
struct Known {
    rows: Vec<u16>,
    alias: Option<&'static str>,
}

struct Check<'a> {
    text: &'a [u8],
    file: &'a Exchange,
    schema: &'static Schema,
    faults: Vec<Fault>,
    known: Vec<Known>,
}

impl Check<'_> {
    fn resolve(&self, keyword: &str) -> Known {
        let alias = ALIASES.iter().find(|(a, _)| *a == keyword).map(|(_, b)| *b);
        let rows = self.schema.find(alias.unwrap_or(keyword)).iter().map(|e| e.0).collect();
        Known { rows, alias }
    }

    #[cold]
    fn fault(&mut self, code: Code, span: Span, args: Vec<String>) {
        self.faults.push(Fault { code, span, args, related: None });
    }

    fn keyword_span(&self, n: u32) -> Span {
        let i = &self.file.instances[n as usize];
        let from = i.start as usize;
        let eq = self.text[from..].iter().position(|b| *b == b'=').map_or(from, |p| from + p + 1);
        let start = eq + self.text[eq..].iter().position(|b| *b > b' ').unwrap_or(0);
        let len = self.text[start..].iter().position(|b| !b.is_ascii_alphanumeric() && *b != b'_' && *b != b'!').unwrap_or(0);
        Span::new(start as u32, (start + len) as u32)
    }

    fn instance(&mut self, n: u32) {
        let i = self.file.instances[n as usize];
        let known = &self.known[i.keyword as usize];
        let alias = known.alias;
        let values = self.file.values_of(n);
        let count = gr_p21::members(values).count();
        let fits = known.rows.iter().copied().find(|r| self.schema.entities[*r as usize].attributes.len() == count);
        let Some(row) = fits.or(known.rows.first().copied()) else {
            let keyword = self.file.keyword(n);
            if !keyword.starts_with('!') && !keyword.is_empty() {
                let hint = self.schema.suggest(keyword).map_or(String::new(), |s| format!("; did you mean {s}?"));
                self.fault(code::STEP_UNKNOWN_ENTITY, self.keyword_span(n), vec![keyword.into(), hint]);
            }
            return;
        };
        let entity = &self.schema.entities[row as usize];
        if let Some(standard) = alias {
            let span = self.keyword_span(n);
            self.fault(code::STEP_OTHER_SPELLING, span, vec![self.file.keyword(n).into(), standard.into()]);
        }
        if entity.is_abstract && entity.keyword != "ELEMENTARY_SURFACE" {
            self.fault(code::STEP_ABSTRACT_ENTITY, self.keyword_span(n), vec![entity.keyword.into()]);
        }
        if fits.is_none() {
            self.arity(n, entity, count);
            return;
        }
        for (attribute, value) in entity.attributes.iter().zip(gr_p21::members(values)) {
            let kind = value[0].kind();
            if kind == Kind::Unset {
                if !attribute.optional {
                    let span = self.span(value[0]);
                    self.fault(code::STEP_MISSING_VALUE, span, vec![entity.keyword.into(), attribute.name.into(), attribute.written.into()]);
                }
            } else if kind != Kind::Derived && kind != Kind::Bad {
                self.value(entity, attribute.name, attribute.written, &attribute.ty, value);
            }
        }
    }

    #[cold]
    fn arity(&mut self, n: u32, entity: &Entity, count: usize) {
        // The standard's own example 1 writes CUTTING_COMPONENT with four of its five attributes.
        let code = if entity.keyword == "CUTTING_COMPONENT" && count == 4 { code::STEP_SHORT_CUTTING_COMPONENT } else { code::STEP_ATTRIBUTE_COUNT };
        let names: Vec<&str> = entity.attributes.iter().map(|a| a.name).collect();
        let args = vec![entity.keyword.into(), names.len().to_string(), count.to_string(), names.join(", ")];
        self.fault(code, self.keyword_span(n), args);
    }

    fn span(&self, v: Value) -> Span {
        let len = match v.kind() {
            Kind::List => 1,
            Kind::Typed => self.text[v.start as usize..].iter().position(|b| *b == b'(').unwrap_or(1) as u32,
            _ => v.len(),
        };
        Span::new(v.start, v.start + len)
    }

    /// `value` holds the value and, behind it, its members.
    fn value(&mut self, entity: &Entity, name: &str, written: &str, ty: &Type, value: &[Value]) {
        let v = value[0];
        let good = match ty {
            Type::Any => true,
            Type::Real => matches!(v.kind(), Kind::Real | Kind::Integer),
            Type::Integer => v.kind() == Kind::Integer,
            Type::String => v.kind() == Kind::String,
            Type::Boolean => v.kind() == Kind::Enumeration && self.one_of(v, &["T", "F"]),
            Type::Logical => v.kind() == Kind::Enumeration && self.one_of(v, &["T", "F", "U"]),
            Type::Enumeration(names) => {
                if v.kind() == Kind::Enumeration && !self.one_of(v, names) {
                    let found = self.file.enumeration(self.text, v).unwrap_or_default();
                    let span = self.span(v);
                    let args = vec![found, entity.keyword.into(), name.into(), names.join(", ").to_ascii_uppercase()];
                    self.fault(code::STEP_UNKNOWN_CHOICE, span, args);
                    return;
                }
                v.kind() == Kind::Enumeration
            }
            Type::Instance(names) => {
                if v.kind() == Kind::Reference {
                    self.reference(entity, name, written, names, v);
                    return;
                }
                false
            }
            Type::Select { instances, values } => match v.kind() {
                Kind::Reference => {
                    self.reference(entity, name, written, instances, v);
                    return;
                }
                Kind::Typed => {
                    let keyword = self.typed_keyword(v);
                    match values.iter().find(|(k, _)| k.eq_ignore_ascii_case(&keyword)) {
                        Some((_, inner)) if value.len() == 2 => {
                            self.value(entity, name, written, inner, &value[1..]);
                            return;
                        }
                        _ => false,
                    }
                }
                // A select of one simple type is often written without its keyword.
                _ => values.iter().any(|(_, t)| match t {
                    Type::Real => matches!(v.kind(), Kind::Real | Kind::Integer),
                    Type::Enumeration(names) => v.kind() == Kind::Enumeration && self.one_of(v, names),
                    _ => false,
                }),
            },
            Type::Aggregate { low, high, of, .. } => {
                if v.kind() == Kind::List {
                    let mut count = 0;
                    for member in gr_p21::members(&value[1..]) {
                        count += 1;
                        if member[0].kind() != Kind::Bad {
                            self.value(entity, name, written, of, member);
                        }
                    }
                    if count < *low || count > *high {
                        let span = self.span(v);
                        self.fault(code::STEP_LIST_SIZE, span, vec![entity.keyword.into(), name.into(), written.into(), count.to_string()]);
                    }
                    return;
                }
                false
            }
        };
        if !good {
            let span = self.span(v);
            self.fault(code::STEP_WRONG_TYPE, span, vec![entity.keyword.into(), name.into(), written.into(), describe(v.kind()).into()]);
        }
    }

    fn one_of(&self, v: Value, names: &[&str]) -> bool {
        let Some(raw) = self.file.raw(self.text, v) else { return false };
        let inside = &raw[1..raw.len() - 1];
        if names.iter().any(|n| n.as_bytes().eq_ignore_ascii_case(inside)) {
            return true;
        }
        let Some(clean) = self.file.enumeration(self.text, v) else { return false };
        // Spellings of the standard and of its readers differ in two places.
        let clean = match clean.as_str() {
            "STRAIGHTLINE" => "STRAGHTLINE",
            "NONCONTACT" => "NON_CONTACT",
            other => other,
        };
        names.iter().any(|n| n.eq_ignore_ascii_case(clean))
    }

    fn typed_keyword(&self, v: Value) -> String {
        let text = &self.text[v.start as usize..];
        let end = text.iter().position(|b| *b == b'(').unwrap_or(0);
        text[..end].iter().filter(|b| **b > b' ').map(|b| *b as char).collect()
    }

    fn reference(&mut self, entity: &Entity, name: &str, written: &str, names: &[crate::schema::Name], v: Value) {
        let Some(id) = self.file.reference(self.text, v) else { return };
        let Some(target) = self.file.find(id) else {
            let span = self.span(v);
            self.fault(code::P21_DANGLING_REFERENCE, span, vec![id.to_string()]);
            return;
        };
        let t = &self.file.instances[target as usize];
        if t.complex || t.damaged {
            return;
        }
        let known = &self.known[t.keyword as usize];
        let fits = known.rows.is_empty()
            || known.rows.iter().any(|r| self.schema.entities[*r as usize].is_a.iter().any(|n| names.contains(n)));
        if !fits {
            let span = self.span(v);
            let args = vec![entity.keyword.into(), name.into(), written.into(), id.to_string(), self.file.keyword(target).into()];
            self.fault(code::STEP_WRONG_REFERENCE, span, args);
        }
    }
}

fn describe(kind: Kind) -> &'static str {
    match kind {
        Kind::Unset => "`$`",
        Kind::Derived => "`*`",
        Kind::Integer => "an integer",
        Kind::Real => "a real number",
        Kind::String => "a string",
        Kind::Enumeration => "an enumeration value",
        Kind::Binary => "a binary value",
        Kind::Reference => "a reference",
        Kind::Resource => "a resource",
        Kind::List => "a list",
        Kind::Typed => "a typed value",
        Kind::Bad => "nothing readable",
    }
}
