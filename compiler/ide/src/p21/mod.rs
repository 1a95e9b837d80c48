//! STEP-NC in Part 21 files (ISO 14649). Places are bytes of the text.

pub mod actions;
pub mod complete;
pub mod hints;
pub mod hover;
pub mod lenses;
pub mod names;
pub mod outline;
pub mod page;
#[cfg(test)]
mod tests;

use gr_p21::{Exchange, Kind, Value};
use gr_step::{Attribute, Entity, Model, Node, Type};
use gr_text::Span;

/// A text and its tables.
#[derive(Clone, Copy)]
pub struct Doc<'a> {
    /// Bytes.
    pub text: &'a [u8],
    /// Tables.
    pub file: &'a Exchange,
    /// In which units speeds and angles are.
    pub units: Units,
}

/// Units of speeds and angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Units {
    /// m/s, 1/s, degrees: as the standard says.
    #[default]
    Iso,
    /// m/min, rpm, mm per revolution, radians: as STEP Modeler writes them.
    StepModeler,
    /// The numbers fit to neither, and nobody says which is meant: both are told.
    Open,
}

impl Units {
    /// The readings to be told.
    fn readings(self) -> &'static [Units] {
        match self {
            Units::Iso => &[Units::Iso],
            Units::StepModeler => &[Units::StepModeler],
            Units::Open => &[Units::Iso, Units::StepModeler],
        }
    }
}

impl<'a> Doc<'a> {
    /// Number of the statement around a byte.
    pub fn instance_at(&self, offset: u32) -> Option<u32> {
        let at = self.file.instances.partition_point(|i| i.start <= offset).checked_sub(1)?;
        (offset < self.file.instances[at].end).then_some(at as u32)
    }
    /// Text of some bytes.
    pub fn slice(&self, span: Span) -> std::borrow::Cow<'a, str> {
        String::from_utf8_lossy(self.text.get(span.range()).unwrap_or_default())
    }
    /// The `#12` at the head of a statement; none for header entities.
    pub fn id_span(&self, n: u32) -> Option<Span> {
        let start = self.file.instances.get(n as usize)?.start;
        let rest = self.text.get(start as usize..)?;
        if rest.first() != Some(&b'#') {
            return None;
        }
        let digits = rest[1..].iter().take_while(|b| b.is_ascii_digit()).count() as u32;
        Some(Span::new(start, start + 1 + digits))
    }
    /// The value around a byte of a statement: top-level place, and the innermost value.
    pub fn value_at(&self, n: u32, offset: u32) -> Option<(usize, Value)> {
        let mut place = None;
        for (i, values) in self.file.parameters(n).enumerate() {
            let inside = values.iter().rfind(|v| v.start <= offset);
            if let Some(v) = inside {
                place = Some((i, *v));
            } else {
                break;
            }
        }
        let (i, v) = place?;
        let token = !matches!(v.kind(), Kind::List | Kind::Typed);
        (!token || offset <= v.start + v.len()).then_some((i, v))
    }
    /// The top-level parameter that is being written at a byte: counted by commas.
    pub fn parameter_at(&self, n: u32, offset: u32) -> Option<usize> {
        let i = self.file.instances.get(n as usize)?;
        let text = self.text.get(i.start as usize..(offset.min(i.end)) as usize)?;
        commas(text)
    }
}

/// How many parameters are behind the first open parenthesis of a statement; none before it or after its end.
pub fn commas(text: &[u8]) -> Option<usize> {
    let (mut depth, mut count, mut string, mut opened) = (0i32, 0, false, false);
    for b in text {
        match b {
            b'\'' => string = !string,
            _ if string => {}
            b'(' => {
                depth += 1;
                opened = true;
            }
            b')' => depth -= 1,
            b',' if depth == 1 => count += 1,
            _ => {}
        }
    }
    (opened && depth > 0).then_some(count)
}

/// Unit of an attribute by its type: ISO 14649-10, clause on measures: mm, degree, s, m/s, 1/s.
pub fn unit(attribute: &Attribute, units: Units) -> &'static str {
    let ty = attribute.written;
    let has = |part: &str| ty.contains(part);
    let of = |iso, modeler, open| match units {
        Units::Iso => iso,
        Units::StepModeler => modeler,
        Units::Open => open,
    };
    if has("rot_speed_measure") {
        of("1/s", "rpm", "1/s or rpm")
    } else if has("speed_measure") && attribute.name == "feedrate" {
        of("m/s", "mm per revolution", "m/s or mm per revolution")
    } else if has("speed_measure") {
        of("m/s", "m/min", "m/s or m/min")
    } else if has("plane_angle_measure") {
        of("degrees", "radians", "degrees or radians")
    } else if has("length_measure") {
        "mm"
    } else if has("time_measure") {
        "s"
    } else if has("pressure_measure") {
        "Pa"
    } else {
        ""
    }
}

/// `WORKPLAN` → `workplan`, `PLANE_MILLING` → `plane milling`.
pub fn words(keyword: &str) -> String {
    keyword.to_lowercase().replace('_', " ")
}

static MEANINGS: &str = include_str!("../../../../spec/lsp/entities.tsv");

/// What an entity is, in a sentence; empty where the table has none.
pub fn meaning(keyword: &str) -> &'static str {
    let row = MEANINGS.lines().find_map(|l| l.split_once('\t').filter(|(k, _)| *k == keyword));
    row.map_or("", |(_, text)| text)
}

/// The attribute that stands at a place of an instance.
pub fn attribute<'m>(node: Node<'m>, place: usize) -> Option<&'static Attribute> {
    if node.complex() {
        return None;
    }
    let entity: &'static Entity = node.entity()?;
    entity.attributes().get(place)
}

/// Its name, in quotes, as far as it has one: `'WS ROUGH'`.
pub fn name_of(node: Node<'_>) -> String {
    ["its_id", "id", "name", "standard_identifier"].iter().map(|a| node.string(a).into_owned()).find(|n| !n.trim().is_empty()).unwrap_or_default()
}

/// One line about an instance: `#12 workplan 'MAIN'`.
pub fn short(node: Node<'_>) -> String {
    let name = name_of(node);
    let name = if name.is_empty() { String::new() } else { format!(" '{name}'") };
    format!("#{} {}{name}", node.id(), words(node.keyword()))
}

/// Whether an instance may stand where a type is wanted.
pub fn fits(node: Node<'_>, ty: &Type) -> bool {
    let schema = gr_step::schema();
    let any = |names: &[gr_step::Name]| names.iter().any(|n| node.is_a(schema.text_of(*n)));
    match ty {
        Type::Instance(names) => any(names),
        Type::Select { instances, .. } => any(instances),
        Type::Aggregate { of, .. } => fits(node, of),
        Type::Any => true,
        _ => false,
    }
}

/// A model of the document.
pub fn model<'a>(doc: Doc<'a>) -> Model<'a> {
    Model::new(doc.text, doc.file)
}
