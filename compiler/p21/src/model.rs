use gr_spec::Code;
use gr_text::Span;
use rustc_hash::FxHashMap;

/// One parsed file. Spans are bytes of its text.
#[derive(Clone, Debug, Default)]
pub struct Exchange {
    /// Sections in file order.
    pub sections: Vec<Section>,
    /// Header entities and instances in file order.
    pub instances: Vec<Instance>,
    /// Parameters of all instances, in the order they are written; lists before their members.
    pub values: Vec<Value>,
    /// Keywords, upper case, without ignored bytes.
    pub keywords: Vec<Box<str>>,
    /// What is wrong, by place.
    pub faults: Vec<Fault>,
    /// The text ends within a section: what is referred to may have stood behind the end.
    pub cut: bool,
    pub(crate) ids: Ids,
}

/// A section.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// `HEADER`, `DATA`, `ANCHOR`, `REFERENCE`, `SIGNATURE`.
    pub name: &'static str,
    /// From its keyword to its `ENDSEC;`.
    pub span: Span,
    /// Its instances.
    pub instances: std::ops::Range<u32>,
}

/// A header entity (id 0) or an instance `#id=…`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Number after `#`; numbers above 2^63 keep their low bits and are told apart by their text.
    pub id: u64,
    /// First byte.
    pub start: u32,
    /// One past the `;`.
    pub end: u32,
    /// Index into `keywords`; for a complex instance, of its first part.
    pub keyword: u32,
    /// First parameter in `values`.
    pub first_value: u32,
    /// How many entries in `values`, members of lists counted.
    pub value_count: u32,
    /// `#1=(A(…)B(…))`: its values are typed lists.
    pub complex: bool,
    /// Could not be read to its end.
    pub damaged: bool,
}

/// A parameter: eight bytes, its text is in the file.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Value {
    /// First byte.
    pub start: u32,
    packed: u32,
}

/// What a parameter is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Kind {
    /// `$`
    Unset,
    /// `*`
    Derived,
    /// `12`
    Integer,
    /// `1.5E3`
    Real,
    /// `'…'`
    String,
    /// `.T.`
    Enumeration,
    /// `"0F"`
    Binary,
    /// `#12`
    Reference,
    /// `@name`, `<URI>` and other edition 3 values.
    Resource,
    /// `(…)`; the length counts its members and theirs.
    List,
    /// `KEYWORD(…)`; the length counts its members and theirs. The keyword is the text at `start`.
    Typed,
    /// Could not be read.
    Bad,
}

impl Kind {
    /// With its article, for messages.
    pub fn describe(self) -> &'static str {
        match self {
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
}

const KINDS: [Kind; 12] = [
    Kind::Unset,
    Kind::Derived,
    Kind::Integer,
    Kind::Real,
    Kind::String,
    Kind::Enumeration,
    Kind::Binary,
    Kind::Reference,
    Kind::Resource,
    Kind::List,
    Kind::Typed,
    Kind::Bad,
];

impl Value {
    /// Lengths from here on are found again in the text.
    pub(crate) const LONG: u32 = (1 << 28) - 1;

    pub(crate) fn new(kind: Kind, start: u32, len: u32) -> Value {
        Value { start, packed: (kind as u32) << 28 | len.min(Value::LONG) }
    }
    /// What it is.
    pub fn kind(self) -> Kind {
        KINDS[((self.packed >> 28) as usize).min(KINDS.len() - 1)]
    }
    /// Length in bytes; for lists and typed parameters the number of values inside.
    pub fn len(self) -> u32 {
        self.packed & Value::LONG
    }
    /// A list without members, or a token without text.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }
    /// How many entries of `values` it takes, itself included.
    pub fn width(self) -> usize {
        match self.kind() {
            Kind::List | Kind::Typed => self.len() as usize + 1,
            _ => 1,
        }
    }
}

impl std::fmt::Debug for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}@{}+{}", self.kind(), self.start, self.len())
    }
}

/// What is wrong and where.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Registry row.
    pub code: Code,
    /// Exact place.
    pub span: Span,
    /// Arguments of the message.
    pub args: Vec<String>,
    /// A second place that matters, with what it is.
    pub related: Option<(Span, &'static str)>,
}

/// Which instance an id names. Files are nearly always written in ascending order, so the usual look-up is a
/// search in a sorted column and costs no memory of its own.
#[derive(Clone, Debug)]
pub(crate) enum Ids {
    Sorted,
    Map(FxHashMap<u64, u32>),
}

impl Default for Ids {
    fn default() -> Self {
        Ids::Sorted
    }
}

impl Exchange {
    /// The instance of an id.
    pub fn find(&self, id: u64) -> Option<u32> {
        match &self.ids {
            // Header entities have no number.
            Ids::Sorted if id == 0 => None,
            Ids::Sorted => self.instances.binary_search_by_key(&id, |i| i.id).ok().map(|i| i as u32),
            Ids::Map(map) => map.get(&id).copied(),
        }
    }
    /// Parameters of an instance, lists before their members.
    pub fn values_of(&self, instance: u32) -> &[Value] {
        let i = &self.instances[instance as usize];
        &self.values[i.first_value as usize..(i.first_value + i.value_count) as usize]
    }
    /// The parameters themselves (not the members of lists), with the entries that belong to each.
    pub fn parameters(&self, instance: u32) -> impl Iterator<Item = &[Value]> {
        members(self.values_of(instance))
    }
    /// Keyword of an instance.
    pub fn keyword(&self, instance: u32) -> &str {
        &self.keywords[self.instances[instance as usize].keyword as usize]
    }
}

/// Splits a run of values into its top-level ones, each with its members.
pub fn members(mut values: &[Value]) -> impl Iterator<Item = &[Value]> {
    std::iter::from_fn(move || {
        let width = values.first()?.width().min(values.len());
        let (head, tail) = values.split_at(width);
        values = tail;
        Some(head)
    })
}
