//! A Part 21 file read as ISO 14649: instances by name, attributes by name, values by kind. Nothing is copied
//! out of the file; a [`Node`] and a [`Val`] are places in its tables. What a value is missing or of another
//! kind than asked for reads as `None`: the checks have said so already.

use std::borrow::Cow;

use gr_p21::{Exchange, Kind, Value};
use gr_text::Span;

use crate::schema::{Entity, Schema, schema};

/// Other spellings that public files use, and what the standard has. Accepted with a warning.
pub(crate) static ALIASES: &[(&str, &str)] = &[
    ("BIDIRECTIONAL_MILLING", "BIDIRECTIONAL"),
    ("UNIDIRECTIONAL_MILLING", "UNIDIRECTIONAL"),
    ("CENTER_DRILL", "CENTERDRILL"),
    ("TOOL_DIMENSION", "MILLING_TOOL_DIMENSION"),
    ("NGON_CLOSED_PROFILE", "NGON_PROFILE"),
    ("WOORDRUFF_KEYSEAT_MILL", "WOODRUFF_KEYSEAT_MILL"),
    ("WEEEK_OF_YEAR_AND_DAY_DATE", "WEEK_OF_YEAR_AND_DAY_DATE"),
];

/// What a keyword of the file is: rows of the table (one per edition), and the standard's name when the file
/// uses another.
#[derive(Clone, Debug)]
pub(crate) struct Known {
    pub rows: Vec<u16>,
    pub alias: Option<&'static str>,
}

pub(crate) fn resolve(schema: &Schema, keyword: &str) -> Known {
    let alias = ALIASES.iter().find(|(a, _)| *a == keyword).map(|(_, b)| *b);
    let rows = schema.find(alias.unwrap_or(keyword)).iter().map(|e| e.0).collect();
    Known { rows, alias }
}

/// A file and what its keywords mean.
pub struct Model<'a> {
    text: &'a [u8],
    file: &'a Exchange,
    schema: &'static Schema,
    known: Vec<Known>,
}

/// An instance.
#[derive(Clone, Copy)]
pub struct Node<'m> {
    model: &'m Model<'m>,
    n: u32,
}

/// A value: an attribute, or a member of one.
#[derive(Clone, Copy)]
pub struct Val<'m> {
    model: &'m Model<'m>,
    /// The value and, behind it, its members.
    values: &'m [Value],
}

impl<'a> Model<'a> {
    /// Reads `file`, which was parsed from `text`.
    pub fn new(text: &'a [u8], file: &'a Exchange) -> Model<'a> {
        let schema = schema();
        let known = file.keywords.iter().map(|k| resolve(schema, k)).collect();
        Model { text, file, schema, known }
    }
    /// The file's text.
    pub fn text(&self) -> &'a [u8] {
        self.text
    }
    /// The tables it is read from.
    pub fn file(&self) -> &'a Exchange {
        self.file
    }
    /// The instance of an id.
    pub fn get(&self, id: u64) -> Option<Node<'_>> {
        let n = self.file.find(id)?;
        (self.text.get(self.file.instances[n as usize].start as usize) == Some(&b'#')).then_some(Node { model: self, n })
    }
    /// The instance with this number in the tables.
    pub fn at(&self, n: u32) -> Option<Node<'_>> {
        ((n as usize) < self.file.instances.len()).then_some(Node { model: self, n })
    }
    /// All instances in file order; header entities are not among them.
    pub fn instances(&self) -> impl Iterator<Item = Node<'_>> {
        let data = |n: &u32| self.text.get(self.file.instances[*n as usize].start as usize) == Some(&b'#');
        (0..self.file.instances.len() as u32).filter(data).map(|n| Node { model: self, n })
    }
    /// Instances that are a `kind`, subtypes included. `kind` in lower case.
    pub fn all(&self, kind: &str) -> impl Iterator<Item = Node<'_>> {
        let fits: Vec<bool> = self.known.iter().map(|k| self.known_is_a(k, kind)).collect();
        self.instances().filter(move |i| fits.get(i.instance().keyword as usize) == Some(&true))
    }
    /// A header entity.
    pub fn header(&self, keyword: &str) -> Option<Node<'_>> {
        let wanted = self.file.keywords.iter().position(|k| **k == *keyword)? as u32;
        let n = self.file.instances.iter().position(|i| i.keyword == wanted && self.text.get(i.start as usize) != Some(&b'#'))?;
        Some(Node { model: self, n: n as u32 })
    }
    fn known_is_a(&self, known: &Known, kind: &str) -> bool {
        self.schema.name(kind).is_some_and(|kind| known.rows.iter().any(|r| self.schema.entities[*r as usize].is_a().contains(&kind)))
    }
}

impl PartialEq for Node<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.n == other.n
    }
}

impl Eq for Node<'_> {}

impl std::fmt::Debug for Node<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{}={}", self.id(), self.keyword())
    }
}

impl std::fmt::Debug for Val<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text())
    }
}

impl<'m> Node<'m> {
    fn instance(self) -> &'m gr_p21::Instance {
        &self.model.file.instances[self.n as usize]
    }
    fn known(self) -> &'m Known {
        &self.model.known[self.instance().keyword as usize]
    }
    /// The model it belongs to.
    pub fn model(self) -> &'m Model<'m> {
        self.model
    }
    /// Its number in the tables.
    pub fn index(self) -> u32 {
        self.n
    }
    /// Number after `#`.
    pub fn id(self) -> u64 {
        self.instance().id
    }
    /// Keyword of the standard, also where the file has another spelling.
    pub fn keyword(self) -> &'m str {
        self.known().alias.unwrap_or_else(|| self.model.file.keyword(self.n))
    }
    /// Could not be read to its end.
    pub fn damaged(self) -> bool {
        self.instance().damaged
    }
    /// Written as `(A(…)B(…))`.
    pub fn complex(self) -> bool {
        self.instance().complex
    }
    /// The whole statement.
    pub fn span(self) -> Span {
        Span::new(self.instance().start, self.instance().end)
    }
    /// The keyword; of a complex instance the first one.
    pub fn keyword_span(self) -> Span {
        keyword_span(self.model.text, self.model.file, self.n)
    }
    /// Its row of the table: the edition whose number of attributes fits.
    pub fn entity(self) -> Option<&'static Entity> {
        let schema: &'static Schema = self.model.schema;
        let rows = &self.known().rows;
        if rows.len() > 1 && !self.complex() {
            let count = self.parameters().count();
            if let Some(row) = rows.iter().find(|r| schema.entities[**r as usize].attributes().len() == count) {
                return Some(&schema.entities[*row as usize]);
            }
        }
        rows.first().map(|r| &schema.entities[*r as usize])
    }
    /// Whether it is a `kind` or a subtype of it, in any edition. Lower case.
    pub fn is_a(self, kind: &str) -> bool {
        self.model.known_is_a(self.known(), kind)
            || self.parts().any(|(k, _)| self.model.known_is_a(&resolve(self.model.schema, &k), kind))
    }
    /// Parts of a complex instance: keyword and values.
    fn parts(self) -> impl Iterator<Item = (String, &'m [Value])> {
        let values = if self.complex() { self.model.file.values_of(self.n) } else { &[] };
        gr_p21::members(values).map(move |v| (typed_keyword(self.model.text, v[0]), &v[1..]))
    }
    /// All parameters in their order.
    pub fn parameters(self) -> impl Iterator<Item = Val<'m>> {
        gr_p21::members(self.model.file.values_of(self.n)).map(move |values| Val { model: self.model, values })
    }
    /// An attribute by its name in the standard; `None` where the entity has no such attribute, it is not
    /// written, or it is `$` or `*`.
    pub fn attr(self, name: &str) -> Option<Val<'m>> {
        self.written(name).filter(|v| v.is_set())
    }
    /// An attribute as it is written, `$` included.
    pub fn written(self, name: &str) -> Option<Val<'m>> {
        if self.complex() {
            return self.part_attr(name);
        }
        let place = self.entity()?.attributes().iter().position(|a| a.name == name)?;
        self.parameters().nth(place)
    }
    /// Parts of a complex instance have only their own attributes: the last ones of the entity.
    fn part_attr(self, name: &str) -> Option<Val<'m>> {
        for (keyword, values) in self.parts() {
            let row = resolve(self.model.schema, &keyword).rows.first().copied();
            let Some(entity) = row.map(|r| &self.model.schema.entities[r as usize]) else { continue };
            let count = gr_p21::members(values).count();
            let inherited = entity.attributes().len().saturating_sub(count);
            if let Some(place) = entity.attributes().iter().skip(inherited).position(|a| a.name == name) {
                return gr_p21::members(values).nth(place).map(|values| Val { model: self.model, values });
            }
        }
        None
    }
    /// A real attribute.
    pub fn real(self, name: &str) -> Option<f64> {
        self.attr(name)?.real()
    }
    /// A string attribute; empty where it is not given.
    pub fn string(self, name: &str) -> Cow<'m, str> {
        self.attr(name).and_then(|v| v.string()).unwrap_or_default()
    }
    /// The instance an attribute refers to.
    pub fn node(self, name: &str) -> Option<Node<'m>> {
        self.attr(name)?.node()
    }
    /// The instances a list attribute refers to.
    pub fn nodes(self, name: &str) -> Vec<Node<'m>> {
        self.attr(name).map(|v| v.items().filter_map(Val::node).collect()).unwrap_or_default()
    }
    /// Theoretical size of a toleranced length, or of a numeric parameter.
    pub fn length(self, name: &str) -> Option<f64> {
        let v = self.attr(name)?;
        match v.node() {
            Some(n) => n.real("theoretical_size").or_else(|| n.real("its_parameter_value")),
            None => v.real(),
        }
    }
    /// Every instance it refers to, lists included, in order.
    pub fn references(self) -> impl Iterator<Item = Node<'m>> {
        let values = self.model.file.values_of(self.n);
        values.iter().filter(|v| v.kind() == Kind::Reference).filter_map(move |v| {
            Val { model: self.model, values: std::slice::from_ref(v) }.node()
        })
    }
}

impl<'m> Val<'m> {
    fn head(self) -> Value {
        self.values[0]
    }
    /// Neither `$` nor `*`.
    pub fn is_set(self) -> bool {
        !matches!(self.kind(), Kind::Unset | Kind::Derived)
    }
    /// What is written.
    pub fn kind(self) -> Kind {
        self.head().kind()
    }
    /// Its place; of lists and typed values the opening.
    pub fn span(self) -> Span {
        value_span(self.model.text, self.head())
    }
    /// Its text; empty for lists.
    pub fn text(self) -> Cow<'m, str> {
        self.model.file.raw(self.model.text, self.head()).map_or(Cow::Borrowed(""), String::from_utf8_lossy)
    }
    /// What is inside a typed value.
    fn inner(self) -> Val<'m> {
        match self.kind() {
            Kind::Typed if self.values.len() > 1 => Val { model: self.model, values: &self.values[1..] },
            _ => self,
        }
    }
    /// A number, also inside a typed value.
    pub fn real(self) -> Option<f64> {
        let v = self.inner();
        v.model.file.real(v.model.text, v.head())
    }
    /// A whole number.
    pub fn integer(self) -> Option<i64> {
        let v = self.inner();
        (v.kind() == Kind::Integer).then(|| v.text().chars().filter(|c| *c > ' ').collect::<String>().parse().ok())?
    }
    /// A string's meaning.
    pub fn string(self) -> Option<Cow<'m, str>> {
        let v = self.inner();
        v.model.file.string(v.model.text, v.head())
    }
    /// An enumeration value in capitals, without its dots.
    pub fn choice(self) -> Option<String> {
        let v = self.inner();
        v.model.file.enumeration(v.model.text, v.head())
    }
    /// `.T.` or `.F.`
    pub fn boolean(self) -> Option<bool> {
        match self.choice()?.as_str() {
            "T" => Some(true),
            "F" => Some(false),
            _ => None,
        }
    }
    /// The instance it refers to, if the file has it.
    pub fn node(self) -> Option<Node<'m>> {
        let v = self.inner();
        let id = v.model.file.reference(v.model.text, v.head())?;
        v.model.get(id)
    }
    /// Keyword and content of a typed value.
    pub fn typed(self) -> Option<(String, Val<'m>)> {
        (self.kind() == Kind::Typed && self.values.len() > 1).then(|| (typed_keyword(self.model.text, self.head()), self.inner()))
    }
    /// Members of a list; none for anything else.
    pub fn items(self) -> impl Iterator<Item = Val<'m>> {
        let inside = if self.kind() == Kind::List { &self.values[1..] } else { &[] };
        gr_p21::members(inside).map(move |values| Val { model: self.model, values })
    }
}

pub(crate) fn typed_keyword(text: &[u8], v: Value) -> String {
    let text = &text[v.start as usize..];
    let end = text.iter().position(|b| *b == b'(').unwrap_or(0);
    text[..end].iter().filter(|b| **b > b' ').map(|b| b.to_ascii_uppercase() as char).collect()
}

pub(crate) fn value_span(text: &[u8], v: Value) -> Span {
    let len = match v.kind() {
        Kind::List => 1,
        Kind::Typed => text[v.start as usize..].iter().position(|b| *b == b'(').unwrap_or(1) as u32,
        _ => v.len(),
    };
    Span::new(v.start, v.start + len)
}

pub(crate) fn keyword_span(text: &[u8], file: &Exchange, n: u32) -> Span {
    let from = file.instances[n as usize].start as usize;
    let eq = text[from..].iter().position(|b| *b == b'=').map_or(from, |p| from + p + 1);
    let start = eq + text[eq..].iter().position(|b| *b > b' ').unwrap_or(0);
    let word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_' || *b == b'!';
    let len = text[start..].iter().position(|b| !word(b)).unwrap_or(text.len() - start);
    let start = if len == 0 { from } else { start };
    Span::new(start as u32, (start + len.max(1)) as u32)
}
