//! Does a file keep to the schema: known keywords, number and type of attributes, references of the right kind.

use gr_p21::{Exchange, Fault, Kind, Value};
use gr_spec::{Code, code};
use gr_text::Span;

use crate::model::{Known, keyword_span, resolve, typed_keyword, value_span};
use crate::schema::{Entity, Schema, Type, schema};

/// Checks every instance. Instances that Part 21 already calls damaged are left alone.
pub fn check(text: &[u8], file: &Exchange) -> Vec<Fault> {
    let schema = schema();
    let mut check = Check { text, file, schema, faults: Vec::new(), known: Vec::new(), bodies: None };
    check.known = file.keywords.iter().map(|k| resolve(schema, k)).collect();
    for n in 0..file.instances.len() as u32 {
        let i = &file.instances[n as usize];
        if !i.damaged && !i.complex && text.get(i.start as usize) == Some(&b'#') {
            check.instance(n);
        }
    }
    check.faults
}

struct Check<'a> {
    text: &'a [u8],
    file: &'a Exchange,
    schema: &'static Schema,
    faults: Vec<Fault>,
    known: Vec<Known>,
    bodies: Option<bool>,
}

impl Check<'_> {
    #[cold]
    fn fault(&mut self, code: Code, span: Span, args: Vec<String>) {
        self.faults.push(Fault { code, span, args, related: None });
    }

    fn keyword_span(&self, n: u32) -> Span {
        keyword_span(self.text, self.file, n)
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
        // The later edition of part 111 has four attributes, in another order: its tools tell.
        if fits.is_none() || (entity.keyword == "CUTTING_COMPONENT" && count == 4 && self.first_edition_tools()) {
            self.arity(n, entity, count);
            return;
        }
        for (attribute, value) in entity.attributes.iter().zip(gr_p21::members(values)) {
            let kind = value[0].kind();
            if kind == Kind::Unset {
                if !attribute.optional && matches!(attribute.ty, Type::String) {
                    let span = self.span(value[0]);
                    self.fault(code::STEP_MISSING_NAME, span, vec![entity.keyword.into(), attribute.name.into()]);
                } else if !attribute.optional {
                    let span = self.span(value[0]);
                    self.fault(code::STEP_MISSING_VALUE, span, vec![entity.keyword.into(), attribute.name.into(), attribute.written.into()]);
                }
            } else if kind != Kind::Derived && kind != Kind::Bad {
                self.value(entity, attribute.name, attribute.written, &attribute.ty, value);
            }
        }
    }

    /// Whether the tools are those of the first edition: a tool has a body.
    fn first_edition_tools(&mut self) -> bool {
        let file = self.file;
        *self.bodies.get_or_insert_with(|| {
            (0..file.instances.len() as u32)
                .any(|n| file.keyword(n) == "MILLING_CUTTING_TOOL" && gr_p21::members(file.values_of(n)).count() == 6)
        })
    }

    #[cold]
    fn arity(&mut self, n: u32, entity: &Entity, count: usize) {
        // The standard's own example 1 writes CUTTING_COMPONENT with four of its five attributes.
        let code = if entity.keyword == "CUTTING_COMPONENT" && count == 4 { code::STEP_SHORT_CUTTING_COMPONENT } else { code::STEP_ATTRIBUTE_COUNT };
        let full = self.schema.find(entity.keyword).first().map_or(entity, |e| self.schema.entity(*e));
        let names: Vec<&str> = full.attributes.iter().map(|a| a.name).collect();
        let args = vec![entity.keyword.into(), names.len().to_string(), count.to_string(), names.join(", ")];
        self.fault(code, self.keyword_span(n), args);
    }

    fn span(&self, v: Value) -> Span {
        value_span(self.text, v)
    }

    /// `value` holds the value and, behind it, its members.
    fn value(&mut self, entity: &Entity, name: &str, written: &str, ty: &Type, value: &[Value]) {
        let v = value[0];
        let good = match ty {
            Type::Any => true,
            Type::Real => {
                if matches!(v.kind(), Kind::Real | Kind::Integer) {
                    self.range(entity, name, written, v);
                    return;
                }
                false
            }
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
                    let keyword = typed_keyword(self.text, v);
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

    /// Numbers that no computer holds, and lengths that can't be negative.
    #[inline(always)]
    fn range(&mut self, entity: &Entity, name: &str, written: &str, v: Value) {
        let Some(raw) = self.file.raw(self.text, v) else { return };
        if (raw.len() > 30 || raw.contains(&b'E')) && !self.file.real(self.text, v).is_some_and(f64::is_finite) {
            let span = self.span(v);
            self.fault(code::STEP_NUMBER_RANGE, span, vec![entity.keyword.into(), name.into()]);
        } else if raw[0] == b'-' && written.starts_with("positive_") {
            let span = self.span(v);
            self.fault(code::STEP_NEGATIVE_LENGTH, span, vec![entity.keyword.into(), name.into(), written.into()]);
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
