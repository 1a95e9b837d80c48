//! Does a file keep to the schema: known keywords, number and type of attributes, references of the right kind.

use gr_p21::{Exchange, Fault, Kind, Value};
use gr_spec::{Code, code};
use gr_text::Span;

use crate::model::{Known, keyword_span, resolve, typed_keyword, value_span};
use crate::schema::{Attribute, Entity, Schema, Type, schema};

/// How the table writes an attribute that a subtype derives.
const DERIVED: &str = "*derived*";

/// What complex instances of exporters are made of (ISO 10303-41, -43) though ISO 14649 has no use for it, with the
/// attributes of its own.
static OTHER_PARTS: &[(&str, &[&str])] = &[
    ("NAMED_UNIT", &["dimensions"]),
    ("SI_UNIT", &["prefix", "name"]),
    ("CONVERSION_BASED_UNIT", &["name", "conversion_factor"]),
    ("CONTEXT_DEPENDENT_UNIT", &["name"]),
    ("LENGTH_UNIT", &[]),
    ("PLANE_ANGLE_UNIT", &[]),
    ("SOLID_ANGLE_UNIT", &[]),
    ("MASS_UNIT", &[]),
    ("TIME_UNIT", &[]),
    ("AREA_UNIT", &[]),
    ("VOLUME_UNIT", &[]),
    ("RATIO_UNIT", &[]),
    ("THERMODYNAMIC_TEMPERATURE_UNIT", &[]),
    ("GLOBAL_UNIT_ASSIGNED_CONTEXT", &["units"]),
    ("GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT", &["uncertainty"]),
    ("PARAMETRIC_REPRESENTATION_CONTEXT", &[]),
    ("MEASURE_WITH_UNIT", &["value_component", "unit_component"]),
    ("LENGTH_MEASURE_WITH_UNIT", &[]),
    ("PLANE_ANGLE_MEASURE_WITH_UNIT", &[]),
    ("UNCERTAINTY_MEASURE_WITH_UNIT", &["name", "description"]),
    ("MEASURE_REPRESENTATION_ITEM", &[]),
    ("REPRESENTATION_RELATIONSHIP", &["name", "description", "rep_1", "rep_2"]),
    ("REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION", &["transformation_operator"]),
    ("SHAPE_REPRESENTATION_RELATIONSHIP", &[]),
];

/// Kinds of which an instance may be several subtypes at once.
static COMBINED: &[&str] = &["b_spline_curve", "b_spline_surface", "representation_context", "address"];

/// One part of a complex instance.
struct Part<'v> {
    keyword: String,
    /// Its keyword.
    span: Span,
    values: &'v [Value],
    rows: Vec<u16>,
    /// Attributes of a part that is not ISO 14649's.
    other: Option<&'static [&'static str]>,
}

/// Checks every instance. Instances that Part 21 already calls damaged are left alone.
pub fn check(text: &[u8], file: &Exchange) -> Vec<Fault> {
    let schema = schema();
    let mut check = Check { text, file, schema, faults: Vec::new(), known: Vec::new(), bodies: None };
    check.known = file.keywords.iter().map(|k| resolve(schema, k)).collect();
    for n in 0..file.instances.len() as u32 {
        let i = &file.instances[n as usize];
        if !i.damaged && text.get(i.start as usize) == Some(&b'<') {
            check.anchor(n);
        }
        if i.damaged || text.get(i.start as usize) != Some(&b'#') {
            continue;
        }
        if i.complex { check.complex(n) } else { check.instance(n) }
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

    /// What an anchor refers to is there.
    fn anchor(&mut self, n: u32) {
        for value in self.file.values_of(n) {
            if let Some(id) = self.file.reference(self.text, *value).filter(|id| self.file.find(*id).is_none()) {
                self.fault(code::P21_DANGLING_REFERENCE, Span::new(value.start, value.start + value.len()), vec![id.to_string()]);
            }
        }
    }

    fn instance(&mut self, n: u32) {
        let i = self.file.instances[n as usize];
        let known = &self.known[i.keyword as usize];
        let alias = known.alias;
        let values = self.file.values_of(n);
        let count = gr_p21::members(values).count();
        let fits = known.rows.iter().copied().find(|r| self.schema.entities[*r as usize].attributes().len() == count);
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
        for (attribute, value) in entity.attributes().iter().zip(gr_p21::members(values)) {
            let kind = value[0].kind();
            if kind == Kind::Unset {
                if !attribute.optional && matches!(attribute.ty, Type::String) {
                    let span = self.span(value[0]);
                    self.fault(code::STEP_MISSING_NAME, span, vec![entity.keyword.into(), attribute.name.into()]);
                } else if !attribute.optional {
                    let span = self.span(value[0]);
                    self.fault(code::STEP_MISSING_VALUE, span, vec![entity.keyword.into(), attribute.name.into(), attribute.written.into()]);
                }
            } else if kind == Kind::Derived || attribute.written == DERIVED {
                self.derived(entity, attribute, value[0]);
            } else if kind != Kind::Bad {
                self.value(entity, attribute.name, attribute.written, &attribute.ty, value);
            }
        }
    }

    /// `*` where a value has to be written, or a value where `*` has to be.
    #[cold]
    fn derived(&mut self, entity: &Entity, attribute: &Attribute, v: Value) {
        let takes = match (attribute.written == DERIVED, v.kind()) {
            (true, Kind::Derived | Kind::Bad) => return,
            (true, _) => "`*`, since it is derived",
            (false, _) => attribute.written,
        };
        let args = vec![entity.keyword.into(), attribute.name.into(), takes.into(), v.kind().describe().into()];
        let span = self.span(v);
        self.fault(code::STEP_WRONG_TYPE, span, args);
    }

    /// `(A(…)B(…))`: known parts that go together, each with its own attributes. One message.
    #[cold]
    fn complex(&mut self, n: u32) {
        let parts: Vec<Part<'_>> = gr_p21::members(self.file.values_of(n)).map(|v| self.part(v)).collect();
        for p in &parts {
            let unknown = p.rows.is_empty() && p.other.is_none() && !p.keyword.starts_with('!');
            if unknown {
                let hint = self.schema.suggest(&p.keyword).map_or(String::new(), |s| format!("; did you mean {s}?"));
                self.fault(code::STEP_UNKNOWN_ENTITY, p.span, vec![p.keyword.clone(), hint]);
                return;
            }
        }
        if let Some((span, why)) = self.apart(&parts) {
            self.fault(code::STEP_COMPLEX_PARTS, span, vec![why]);
            return;
        }
        let before = self.faults.len();
        for p in &parts {
            self.own(p);
            if self.faults.len() > before {
                return;
            }
        }
    }

    fn part<'v>(&self, values: &'v [Value]) -> Part<'v> {
        let keyword = typed_keyword(self.text, values[0]);
        let rows = resolve(self.schema, &keyword).rows;
        let other = OTHER_PARTS.iter().find(|(k, _)| *k == keyword).map(|(_, own)| *own);
        Part { span: self.span(values[0]), values: &values[1..], keyword, rows, other }
    }

    /// Why parts don't go together, and the part that shows it.
    fn apart(&self, parts: &[Part<'_>]) -> Option<(Span, String)> {
        for (k, p) in parts.iter().enumerate() {
            if parts[..k].iter().any(|q| q.keyword == p.keyword) {
                return Some((p.span, format!("{} is written twice", p.keyword)));
            }
        }
        let is_a = |p: &Part<'_>, kind: &str| self.schema.is_a(&p.keyword, kind);
        let leaf = |p: &&Part<'_>| !p.rows.is_empty() && !parts.iter().any(|q| q.keyword != p.keyword && is_a(q, &p.keyword));
        let leaves: Vec<&Part<'_>> = parts.iter().filter(leaf).collect();
        for pair in leaves.windows(2) {
            let joined = COMBINED.iter().any(|kind| is_a(pair[0], kind) && is_a(pair[1], kind));
            if !joined {
                return Some((pair[1].span, format!("nothing is both {} and {}", pair[0].keyword, pair[1].keyword)));
            }
        }
        for p in parts {
            let Some(row) = p.rows.first() else { continue };
            let mut supertypes = self.schema.entities[*row as usize].supertypes();
            if let Some(up) = supertypes.find(|up| !parts.iter().any(|q| q.keyword.eq_ignore_ascii_case(up))) {
                return Some((p.span, format!("{} is there without {}", p.keyword, up.to_ascii_uppercase())));
            }
        }
        None
    }

    /// A part has only the attributes that its supertypes don't have.
    fn own(&mut self, p: &Part<'_>) {
        let count = gr_p21::members(p.values).count();
        let schema = self.schema;
        let Some(entity) = p.rows.first().map(|r| &schema.entities[*r as usize]) else {
            self.own_count(p, &p.keyword, p.other.unwrap_or(&[]), count);
            return;
        };
        let inherited: Vec<&str> = (entity.supertypes())
            .filter_map(|up| schema.find(&up.to_ascii_uppercase()).first())
            .flat_map(|up| schema.entity(*up).attributes().iter().map(|a| a.name))
            .collect();
        let own: Vec<&Attribute> = entity.attributes().iter().filter(|a| !inherited.contains(&a.name)).collect();
        let names: Vec<&str> = own.iter().map(|a| a.name).collect();
        if self.own_count(p, entity.keyword, &names, count) {
            return;
        }
        for (attribute, value) in own.into_iter().zip(gr_p21::members(p.values)) {
            match value[0].kind() {
                // Another part may derive it.
                Kind::Derived | Kind::Bad => {}
                Kind::Unset if attribute.optional => {}
                Kind::Unset => {
                    let span = self.span(value[0]);
                    self.fault(code::STEP_MISSING_VALUE, span, vec![entity.keyword.into(), attribute.name.into(), attribute.written.into()]);
                }
                _ => self.value(entity, attribute.name, attribute.written, &attribute.ty, value),
            }
        }
    }

    /// Tells when a part has not as many values as attributes of its own.
    fn own_count(&mut self, p: &Part<'_>, keyword: &str, names: &[&str], count: usize) -> bool {
        // User-defined parts are their user's.
        if names.len() == count || p.keyword.starts_with('!') {
            return false;
        }
        let listed = if names.is_empty() { "none of its own".to_string() } else { names.join(", ") };
        let args = vec![format!("{keyword} as a part"), names.len().to_string(), count.to_string(), listed];
        self.fault(code::STEP_ATTRIBUTE_COUNT, p.span, args);
        true
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
        let names: Vec<&str> = full.attributes().iter().map(|a| a.name).collect();
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
                    let before = self.faults.len();
                    let mut count = 0;
                    for member in gr_p21::members(&value[1..]) {
                        count += 1;
                        if member[0].kind() != Kind::Bad {
                            self.value(entity, name, written, of, member);
                        }
                    }
                    if (count < *low || count > *high) && self.faults.len() == before {
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
            self.fault(code::STEP_WRONG_TYPE, span, vec![entity.keyword.into(), name.into(), written.into(), v.kind().describe().into()]);
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
        if t.damaged {
            return;
        }
        let known = &self.known[t.keyword as usize];
        let is = |rows: &[u16]| rows.is_empty() || rows.iter().any(|r| self.schema.entities[*r as usize].is_a().iter().any(|n| names.contains(n)));
        let fits = if t.complex {
            gr_p21::members(self.file.values_of(target)).any(|v| is(&self.part(v).rows))
        } else {
            is(&known.rows)
        };
        if !fits {
            let span = self.span(v);
            let args = vec![entity.keyword.into(), name.into(), written.into(), id.to_string(), self.file.keyword(target).into()];
            self.fault(code::STEP_WRONG_REFERENCE, span, args);
        }
    }
}
