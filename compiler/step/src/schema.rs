//! Entities, attributes and types, resolved from the tables.

use std::sync::OnceLock;

use rustc_hash::FxHashMap;

/// Index into [`Schema::entities`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct EntityId(pub u16);

/// Which text of a part an entity row follows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Edition {
    /// `10`, `11`, `12`, `111`, `121`, `10303`.
    pub part: &'static str,
    /// `T1-2002`, `IS-2005` …
    pub text: &'static str,
}

/// One entity in one edition.
#[derive(Debug)]
pub struct Entity {
    /// Capitals, as in files.
    pub keyword: &'static str,
    /// Where the row comes from.
    pub edition: Edition,
    /// Has no instances of its own.
    pub is_abstract: bool,
    /// Direct supertypes as the table has them.
    above: &'static str,
    /// Attributes as the table has them: most files need a few entities only, so that these are read when asked for.
    written: &'static str,
    read: OnceLock<Vec<Attribute>>,
    /// WHERE rules as the table has them.
    pub rules: &'static str,
    kinds: OnceLock<Vec<Name>>,
}

impl Entity {
    /// Direct supertypes, in lower case.
    pub fn supertypes(&self) -> impl Iterator<Item = &'static str> + use<> {
        list(self.above)
    }
    /// Everything it is, itself included.
    pub fn is_a(&self) -> &[Name] {
        self.kinds.get_or_init(|| schema().kinds(self))
    }
    /// In Part 21 order, inherited ones first.
    pub fn attributes(&self) -> &[Attribute] {
        self.read.get_or_init(|| {
            let schema = schema();
            self.written.split("; ").filter(|a| !a.is_empty()).map(|a| schema.attribute(a)).collect()
        })
    }
}

/// A lower-case name, by number.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct Name(pub u16);

/// One attribute.
#[derive(Debug)]
pub struct Attribute {
    /// Name in the standard.
    pub name: &'static str,
    /// What it takes.
    pub ty: Type,
    /// Its type as the table writes it.
    pub written: &'static str,
    /// `$` is allowed.
    pub optional: bool,
}

/// What an attribute takes.
#[derive(Clone, Debug, PartialEq)]
pub enum Type {
    /// REAL and measures; integers without a point are accepted where the standard has REAL.
    Real,
    /// INTEGER.
    Integer,
    /// STRING.
    String,
    /// `.T.` `.F.`
    Boolean,
    /// `.T.` `.F.` `.U.`
    Logical,
    /// One of these names.
    Enumeration(Vec<&'static str>),
    /// An instance that is one of these.
    Instance(Vec<Name>),
    /// An instance, or a typed value (`PARAMETER_VALUE(1.)`) of one of these types.
    Select {
        /// Instances.
        instances: Vec<Name>,
        /// Keywords of typed values and what is inside.
        values: Vec<(&'static str, Type)>,
    },
    /// LIST, SET, BAG, ARRAY with bounds.
    Aggregate {
        /// Fewest members.
        low: u32,
        /// Most members.
        high: u32,
        /// Their type.
        of: Box<Type>,
        /// SET: no member twice.
        unique: bool,
    },
    /// The table does not say.
    Any,
}

/// All tables.
#[derive(Debug)]
pub struct Schema {
    /// Rows in table order.
    pub entities: Vec<Entity>,
    by_keyword: FxHashMap<&'static str, Vec<EntityId>>,
    names: FxHashMap<&'static str, Name>,
    texts: Vec<&'static str>,
    /// Defined types, enumerations and selects.
    types: FxHashMap<&'static str, &'static str>,
}

static ENTITIES: &str = include_str!("../../../spec/step/entities.tsv");
static TYPES: &str = include_str!("../../../spec/step/types.tsv");

/// The resolved tables; made at the first call.
pub fn schema() -> &'static Schema {
    static SCHEMA: OnceLock<Schema> = OnceLock::new();
    SCHEMA.get_or_init(Schema::load)
}

impl Schema {
    /// All editions of an entity, the usual one first.
    pub fn find(&self, keyword: &str) -> &[EntityId] {
        self.by_keyword.get(keyword).map_or(&[], |v| v.as_slice())
    }
    /// A row.
    pub fn entity(&self, id: EntityId) -> &Entity {
        &self.entities[id.0 as usize]
    }
    /// Number of a name, if any entity has it.
    pub fn name(&self, lower: &str) -> Option<Name> {
        self.names.get(lower).copied()
    }
    /// A name's letters.
    pub fn text_of(&self, name: Name) -> &'static str {
        self.texts.get(name.0 as usize).copied().unwrap_or("")
    }
    /// Whether some edition of `keyword` is a `supertype`.
    pub fn is_a(&self, keyword: &str, supertype: &str) -> bool {
        let Some(name) = self.name(&supertype.to_ascii_lowercase()) else { return false };
        self.find(keyword).iter().any(|e| self.entity(*e).is_a().contains(&name))
    }
    /// Keywords closest to a misspelt one.
    pub fn suggest(&self, keyword: &str) -> Option<&'static str> {
        let mut best = (usize::MAX, None);
        for e in self.entities.iter().filter(|e| !e.is_abstract) {
            let d = distance(keyword.as_bytes(), e.keyword.as_bytes(), best.0);
            if d < best.0 {
                best = (d, Some(e.keyword));
            }
        }
        best.1.filter(|_| best.0 <= 1 + keyword.len() / 4)
    }

    fn load() -> Schema {
        let rows = ENTITIES.lines().filter(|l| !l.starts_with('#') && !l.is_empty()).map(|l| {
            let mut columns = l.splitn(7, '\t');
            std::array::from_fn::<&'static str, 7, _>(|_| columns.next().unwrap_or(""))
        });
        let rows: Vec<[&'static str; 7]> = rows.collect();
        let types: FxHashMap<&'static str, &'static str> =
            TYPES.lines().filter(|l| !l.starts_with('#')).filter_map(|l| l.split_once('\t')).collect();
        let keywords: Vec<&str> = rows.iter().map(|r| r[2]).collect();
        let lower: &'static str = Box::leak(keywords.join("\n").to_ascii_lowercase().into_boxed_str());
        let mut names: FxHashMap<&'static str, Name> = FxHashMap::default();
        let mut texts = Vec::new();
        let mut by_keyword: FxHashMap<&'static str, Vec<EntityId>> = FxHashMap::default();
        let mut entities = Vec::with_capacity(rows.len());
        for ([part, text, keyword, kind, above, written, rules], name) in rows.into_iter().zip(lower.split('\n')) {
            names.entry(name).or_insert_with(|| {
                texts.push(name);
                Name(texts.len() as u16 - 1)
            });
            by_keyword.entry(keyword).or_default().push(EntityId(entities.len() as u16));
            let edition = Edition { part, text };
            let is_abstract = kind == "A";
            entities.push(Entity { keyword, edition, is_abstract, above, written, read: OnceLock::new(), rules, kinds: OnceLock::new() });
        }
        Schema { entities, by_keyword, names, texts, types }
    }

    /// What an entity is: its own supertypes, and what any edition of those is.
    fn kinds(&self, entity: &Entity) -> Vec<Name> {
        let mut is_a: Vec<Name> = self.name(&entity.keyword.to_ascii_lowercase()).into_iter().collect();
        let mut todo: Vec<&'static str> = entity.supertypes().collect();
        while let Some(n) = todo.pop() {
            if let Some(name) = self.name(n).filter(|name| !is_a.contains(name)) {
                is_a.push(name);
                todo.extend(self.find(&n.to_ascii_uppercase()).iter().flat_map(|up| self.entity(*up).supertypes()));
            }
        }
        is_a
    }

    fn attribute(&self, text: &'static str) -> Attribute {
        let (name, written) = text.split_once(':').unwrap_or((text, ""));
        let written = written.trim();
        Attribute {
            name: name.trim_end_matches('?'),
            optional: name.ends_with('?'),
            ty: self.ty(written, 0),
            written,
        }
    }

    fn ty(&self, written: &'static str, depth: u32) -> Type {
        let w = written.trim();
        if depth > 12 {
            return Type::Any;
        }
        for kind in ["LIST", "SET", "BAG", "ARRAY"] {
            let Some(rest) = w.strip_prefix(kind) else { continue };
            let rest = rest.trim_start();
            let (low, high, of) = match rest.strip_prefix('[').and_then(|r| r.split_once(']')) {
                Some((bounds, of)) => {
                    let (low, high) = bounds.split_once(':').unwrap_or((bounds, "?"));
                    (low.trim().parse().unwrap_or(0), high.trim().parse().unwrap_or(u32::MAX), of)
                }
                None => (0, u32::MAX, rest),
            };
            let of = of.trim_start();
            let of = of.strip_prefix("OF").or(of.strip_prefix("of")).unwrap_or(of).trim_start();
            let of = of.strip_prefix("UNIQUE").unwrap_or(of);
            return Type::Aggregate { low, high, of: Box::new(self.ty(of, depth + 1)), unique: kind == "SET" };
        }
        if let Some(rest) = w.strip_prefix("ENUMERATION OF") {
            return Type::Enumeration(inner(rest));
        }
        if let Some(rest) = w.strip_prefix("SELECT") {
            let (mut instances, mut values) = (Vec::new(), Vec::new());
            for member in inner(rest) {
                match self.ty(member, depth + 1) {
                    Type::Instance(mut n) => instances.append(&mut n),
                    Type::Select { instances: mut i, values: mut v } => {
                        instances.append(&mut i);
                        values.append(&mut v);
                    }
                    Type::Any => {}
                    other => values.push((member, other)),
                }
            }
            return if values.is_empty() { Type::Instance(instances) } else { Type::Select { instances, values } };
        }
        match w {
            "REAL" | "NUMBER" => Type::Real,
            "INTEGER" => Type::Integer,
            "STRING" => Type::String,
            "BOOLEAN" => Type::Boolean,
            "LOGICAL" => Type::Logical,
            _ => match self.types.get(w) {
                Some(definition) => self.ty(definition, depth + 1),
                None => self.names.get(w).map_or(Type::Any, |n| Type::Instance(vec![*n])),
            },
        }
    }
}

fn list(text: &'static str) -> impl Iterator<Item = &'static str> {
    text.split(',').map(str::trim).filter(|s| !s.is_empty())
}

fn inner(text: &'static str) -> Vec<&'static str> {
    list(text.trim().trim_start_matches('(').trim_end_matches(')')).collect()
}

/// Edit distance, given up at `limit`.
pub(crate) fn distance(a: &[u8], b: &[u8], limit: usize) -> usize {
    if a.len().abs_diff(b.len()) >= limit {
        return limit;
    }
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let next = (diagonal + usize::from(x != y)).min(row[j] + 1).min(row[j + 1] + 1);
            diagonal = row[j + 1];
            row[j + 1] = next;
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::{Type, schema};

    #[test]
    fn every_type_is_known() {
        let unknown: Vec<String> = schema()
            .entities
            .iter()
            .flat_map(|e| e.attributes().iter().map(move |a| (e, a)))
            .filter(|(_, a)| a.written != "*derived*")
            .filter(|(_, a)| {
                let mut ty = &a.ty;
                while let Type::Aggregate { of, .. } = ty {
                    ty = of;
                }
                *ty == Type::Any
            })
            .map(|(e, a)| format!("{}.{}: {}", e.keyword, a.name, a.written))
            .collect();
        assert!(unknown.is_empty(), "{unknown:#?}");
    }

    #[test]
    fn supertypes() {
        assert!(schema().is_a("ROUND_HOLE", "manufacturing_feature"));
        assert!(schema().is_a("BOTTOM_AND_SIDE_ROUGH_MILLING", "MACHINING_OPERATION"));
        assert!(!schema().is_a("ROUND_HOLE", "machining_operation"));
        assert_eq!(schema().suggest("CLOSED_POKET"), Some("CLOSED_POCKET"));
    }
}
