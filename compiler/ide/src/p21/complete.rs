//! What can be written next in an exchange file.

use gr_step::{Attribute, Entity, Model, Type, schema};
use gr_text::Span;

use super::{Doc, commas, fits, meaning, name_of, words};
use crate::{Completion, CompletionKind, Signature};

/// References that are proposed.
const MOST: usize = 300;

/// The statement being written: its text up to the cursor.
fn open_statement(text: &[u8], offset: u32) -> (u32, &[u8]) {
    let before = &text[..(offset as usize).min(text.len())];
    let mut string = false;
    // From the last line that begins a statement: a damaged one before it must not matter.
    let from = before
        .iter()
        .enumerate()
        .rev()
        .take(100_000)
        .find(|(i, b)| **b == b'#' && (*i == 0 || matches!(before[..*i].iter().rfind(|b| **b > b' '), Some(b';'))))
        .map_or_else(|| before.len().saturating_sub(1_000), |(i, _)| i);
    for (i, b) in before[from..].iter().enumerate() {
        match b {
            b'\'' => string = !string,
            b';' if !string => return (offset, &before[from + i + 1..]),
            _ => {}
        }
    }
    (from as u32, &before[from..])
}

fn keyword_of(statement: &[u8]) -> String {
    let eq = statement.iter().position(|b| *b == b'=').map_or(0, |p| p + 1);
    statement[eq..].iter().filter(|b| **b > b' ').take_while(|b| b.is_ascii_alphanumeric() || **b == b'_').map(|b| b.to_ascii_uppercase() as char).collect()
}

/// What can be written at a byte.
pub fn complete(doc: Doc<'_>, offset: u32) -> Vec<Completion> {
    let (_, statement) = open_statement(doc.text, offset);
    let text = String::from_utf8_lossy(statement);
    let Some(eq) = text.find('=') else { return Vec::new() };
    let Some(place) = commas(statement) else {
        let typed: String = text[eq + 1..].trim_start().to_uppercase();
        return entities(&typed, Span::new(offset - typed.len() as u32, offset));
    };
    let keyword = keyword_of(statement);
    let rows = schema().find(&keyword);
    let mut found: Vec<Completion> = Vec::new();
    let word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '#' | '.' | '$');
    let typed: String = text.chars().rev().take_while(|c| word(*c)).collect::<Vec<_>>().into_iter().rev().collect();
    let replace = Span::new(offset - typed.len() as u32, offset);
    let own = text.trim_start_matches('#').chars().take_while(char::is_ascii_digit).collect::<String>().parse().unwrap_or(0);
    let model = super::model(doc);
    for row in rows {
        if let Some(a) = schema().entity(*row).attributes().get(place) {
            values(&model, a, &a.ty, own, replace, &mut found);
            break;
        }
    }
    let upper = typed.to_uppercase();
    found.retain(|c| c.label.to_uppercase().starts_with(&upper));
    found
}

fn item(label: String, detail: String, kind: CompletionKind, rank: u8, replace: Span) -> Completion {
    Completion { insert: label.clone(), label, snippet: false, detail, documentation: String::new(), kind, rank, replace }
}

fn values(model: &Model<'_>, a: &Attribute, ty: &Type, own: u64, replace: Span, found: &mut Vec<Completion>) {
    if a.optional && found.is_empty() {
        found.push(item("$".into(), format!("{} is not given", a.name), CompletionKind::Value, 8, replace));
    }
    match ty {
        Type::Enumeration(names) => {
            found.extend(names.iter().map(|n| item(format!(".{}.", n.to_uppercase()), a.name.into(), CompletionKind::Enumeration, 1, replace)));
        }
        Type::Boolean => found.extend([".T.", ".F."].map(|n| item(n.into(), a.name.into(), CompletionKind::Enumeration, 1, replace))),
        Type::Logical => found.extend([".T.", ".F.", ".U."].map(|n| item(n.into(), a.name.into(), CompletionKind::Enumeration, 1, replace))),
        Type::Instance(_) | Type::Select { .. } => {
            references(model, a, ty, own, replace, found);
            if let Type::Select { values, .. } = ty {
                found.extend(values.iter().map(|(k, _)| Completion {
                    insert: format!("{k}($1)"),
                    snippet: true,
                    ..item((*k).to_string(), a.name.into(), CompletionKind::Value, 3, replace)
                }));
            }
        }
        Type::Aggregate { of, .. } => values(model, a, of, own, replace, found),
        Type::Any => references(model, a, ty, own, replace, found),
        Type::Real | Type::Integer | Type::String => {}
    }
}

fn references(model: &Model<'_>, a: &Attribute, ty: &Type, own: u64, replace: Span, found: &mut Vec<Completion>) {
    for node in model.instances().filter(|n| n.id() != own && fits(*n, ty)).take(MOST) {
        let name = name_of(node);
        let detail = if name.is_empty() { words(node.keyword()) } else { format!("{} '{name}'", words(node.keyword())) };
        found.push(Completion { documentation: format!("{}: {}", a.name, a.written), ..item(format!("#{}", node.id()), detail, CompletionKind::Reference, 2, replace) });
    }
}

/// Entities with their attributes as places to fill in.
fn entities(typed: &str, replace: Span) -> Vec<Completion> {
    let mut seen = std::collections::BTreeSet::new();
    let fits = |e: &&Entity| !e.is_abstract && e.keyword.starts_with(typed);
    let mut found = Vec::new();
    for e in schema().entities.iter().filter(fits) {
        if !seen.insert(e.keyword) {
            continue;
        }
        let places: Vec<String> = e.attributes().iter().enumerate().map(|(i, a)| format!("${{{}:{}}}", i + 1, placeholder(a))).collect();
        found.push(Completion {
            label: e.keyword.into(),
            insert: format!("{}({});", e.keyword, places.join(",")),
            snippet: true,
            detail: e.supertypes().map(words).collect::<Vec<_>>().join(", "),
            documentation: meaning(e.keyword).into(),
            kind: CompletionKind::Entity,
            rank: if meaning(e.keyword).is_empty() { 2 } else { 1 },
            replace,
        });
    }
    found
}

/// What stands for an attribute until it is written.
pub fn placeholder(a: &Attribute) -> &'static str {
    if a.optional {
        // A snippet's own sign is escaped.
        return "\\$";
    }
    match a.ty {
        Type::Real => "0.",
        Type::Integer => "0",
        Type::String => "''",
        Type::Boolean | Type::Logical => ".F.",
        Type::Aggregate { .. } => "()",
        _ => "\\$",
    }
}

/// Attributes of the entity being written.
pub fn signature(doc: Doc<'_>, offset: u32) -> Option<Signature> {
    let (_, statement) = open_statement(doc.text, offset);
    let place = commas(statement)?;
    let keyword = keyword_of(statement);
    let row = schema().entity(*schema().find(&keyword).first()?);
    let mut label = format!("{keyword}(");
    let mut parameters = Vec::new();
    for (i, a) in row.attributes().iter().enumerate() {
        if i > 0 {
            label.push_str(", ");
        }
        let from = label.len() as u32;
        label.push_str(a.name);
        let optional = if a.optional { ", optional" } else { "" };
        let unit = super::unit(a, doc.units);
        let unit = if unit.is_empty() { String::new() } else { format!(", {unit}") };
        parameters.push((from..label.len() as u32, format!("{}{unit}{optional}", a.written)));
    }
    label.push(')');
    let active = (place < parameters.len()).then_some(place as u32);
    Some(Signature { label, documentation: meaning(&keyword).into(), parameters, active })
}
