//! `#n`: where it is defined, who refers to it, renaming, and the tree of references.

use gr_p21::Kind;
use gr_text::Span;

use super::Doc;
use crate::{Edit, Occurrence, Role};

/// The id at a byte and its place.
pub fn name_at(doc: Doc<'_>, offset: u32) -> Option<(u64, Span)> {
    let n = doc.instance_at(offset)?;
    if let Some(span) = doc.id_span(n)
        && offset <= span.end
    {
        return Some((doc.file.instances[n as usize].id, span));
    }
    let (_, value) = doc.value_at(n, offset)?;
    let id = doc.file.reference(doc.text, value)?;
    Some((id, Span::new(value.start, value.start + value.len())))
}

/// The statement of an id.
pub fn definition(doc: Doc<'_>, id: u64) -> Option<Span> {
    doc.id_span(doc.file.find(id)?)
}

/// Where an id occurs.
pub fn occurrences(doc: Doc<'_>, id: u64) -> Vec<Occurrence> {
    let mut found: Vec<Occurrence> = definition(doc, id).map(|span| Occurrence { span, role: Role::Definition }).into_iter().collect();
    let refs = doc.file.values.iter().filter(|v| v.kind() == Kind::Reference && doc.file.reference(doc.text, **v) == Some(id));
    found.extend(refs.map(|v| Occurrence { span: Span::new(v.start, v.start + v.len()), role: Role::Read }));
    found.sort_by_key(|o| o.span);
    found
}

/// Statements that refer to an id, at most `most`.
pub fn users(doc: Doc<'_>, id: u64, most: usize) -> Vec<u32> {
    let mut found = Vec::new();
    for (n, i) in doc.file.instances.iter().enumerate() {
        let values = &doc.file.values[i.first_value as usize..(i.first_value + i.value_count) as usize];
        if values.iter().any(|v| v.kind() == Kind::Reference && doc.file.reference(doc.text, *v) == Some(id)) {
            found.push(n as u32);
            if found.len() >= most {
                break;
            }
        }
    }
    found
}

/// Edits that give an instance another number. `Err` says why not.
pub fn rename(doc: Doc<'_>, id: u64, new: &str) -> Result<Vec<Edit>, String> {
    let number = new.trim().trim_start_matches('#');
    let new: u64 = number.parse().ok().filter(|n| *n > 0).ok_or("an instance is named by # and a whole number above 0")?;
    if new == id {
        return Ok(Vec::new());
    }
    if doc.file.find(new).is_some() {
        return Err(format!("#{new} is taken"));
    }
    Ok(occurrences(doc, id).into_iter().map(|o| Edit { span: o.span, text: format!("#{new}") }).collect())
}

/// References of a statement: where, and to what.
pub fn references_of(doc: Doc<'_>, n: u32) -> Vec<(Span, u64)> {
    let values = doc.file.values_of(n).iter().filter(|v| v.kind() == Kind::Reference);
    values.filter_map(|v| Some((Span::new(v.start, v.start + v.len()), doc.file.reference(doc.text, *v)?))).collect()
}
