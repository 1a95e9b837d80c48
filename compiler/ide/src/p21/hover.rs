//! What stands under the cursor, explained.

use gr_p21::Kind;
use gr_step::{Node, Type};
use gr_text::Span;

use super::{Doc, Units, attribute, meaning, short, unit, words};
use crate::Hover;
use crate::gcode::doc::number;

/// Rows of a table that are shown.
const MOST_ROWS: usize = 40;

/// Explains what stands at a byte.
pub fn hover(doc: Doc<'_>, offset: u32) -> Option<Hover> {
    let n = doc.instance_at(offset)?;
    let model = super::model(doc);
    let node = model.at(n)?;
    if doc.id_span(n).is_some_and(|s| offset < s.end) || contains(node.keyword_span(), offset) {
        let span = if contains(node.keyword_span(), offset) { node.keyword_span() } else { doc.id_span(n)? };
        return Some(Hover { span, text: entity(doc, node) });
    }
    let (place, value) = doc.value_at(n, offset)?;
    let end = if matches!(value.kind(), Kind::List | Kind::Typed) { value.start + 1 } else { value.start + value.len() };
    let span = Span::new(value.start, end);
    if offset > end {
        return None;
    }
    let real = doc.file.real(doc.text, value);
    let mut text = attribute(node, place).map_or(String::new(), |a| about(doc, node, a, real));
    if let Some(target) = doc.file.reference(doc.text, value) {
        let found = model.get(target).map_or(format!("**#{target}**: the file has no such instance."), |t| entity(doc, t));
        if !text.is_empty() {
            text.push_str("\n\n---\n\n");
        }
        text.push_str(&found);
    }
    (!text.is_empty()).then_some(Hover { span, text })
}

fn contains(span: Span, at: u32) -> bool {
    span.start <= at && at < span.end
}

/// An attribute with its value here.
fn about(doc: Doc<'_>, node: Node<'_>, a: &'static gr_step::Attribute, value: Option<f64>) -> String {
    let optional = if a.optional { ", optional" } else { "" };
    let mut text = format!("**{}** of {}: {}{optional}", a.name, words(node.keyword()), a.written);
    if let Some(value) = value {
        text.push_str(&format!("\n\n{}", in_units(doc, node, a, value)));
    }
    if let Type::Enumeration(names) = &a.ty {
        let names: Vec<String> = names.iter().map(|n| format!("`.{}.`", n.to_uppercase())).collect();
        text.push_str(&format!("\n\nOne of {}", names.join(" ")));
    }
    text
}

/// A value with its unit, and in the one that machinists use; in every reading of it.
fn in_units(doc: Doc<'_>, node: Node<'_>, a: &gr_step::Attribute, value: f64) -> String {
    let read: Vec<String> = doc.units.readings().iter().map(|u| in_unit(*u, node, a, value)).collect();
    match read.as_slice() {
        [iso, modeler] if iso != modeler => format!(
            "- {iso}, as the standard says\n- {modeler}, as STEP Modeler writes\n\nNothing in the file says which: `step-units` in gcc-robot.toml does."
        ),
        [one, ..] => one.clone(),
        [] => String::new(),
    }
}

fn in_unit(units: Units, node: Node<'_>, a: &gr_step::Attribute, value: f64) -> String {
    let turn = if value < 0.0 && node.is_a("milling_technology") { ", clockwise as M3: negative is the usual direction of cutting" } else { "" };
    match unit(a, units) {
        "1/s" => format!("{} 1/s = {} rpm{turn}", number(value, 6), number(value.abs() * 60.0, 2)),
        "rpm" => format!("{} rpm{turn}", number(value.abs(), 2)),
        "m/s" => format!("{} m/s = {} mm/min = {} m/min", number(value, 6), number(value * 60_000.0, 2), number(value * 60.0, 3)),
        "" => number(value, 6),
        unit => format!("{} {unit}", number(value, 6)),
    }
}

/// An instance: what it is, its attributes with values, who uses it.
fn entity(doc: Doc<'_>, node: Node<'_>) -> String {
    let mut text = format!("**{}**", short(node));
    let what = meaning(node.keyword());
    if !what.is_empty() {
        text.push_str(&format!("\n\n{what}"));
    }
    let Some(row) = node.entity() else {
        return format!("{text}\n\nISO 14649 has no entity {}.", node.keyword());
    };
    if !node.complex() && !row.attributes().is_empty() {
        text.push_str("\n\n| attribute | value | |\n|---|---|---|\n");
        for (a, v) in row.attributes().iter().zip(node.parameters()).take(MOST_ROWS) {
            text.push_str(&format!("| {} | {} | {} |\n", a.name, value(v), unit(a, doc.units)));
        }
    }
    let users = super::names::users(doc, node.id(), 200);
    let many = if users.len() == 200 { "200 or more" } else { &users.len().to_string() };
    let supers: Vec<String> = row.supertypes().map(words).collect();
    let kind = if supers.is_empty() { String::new() } else { format!("a kind of {}; ", supers.join(", ")) };
    let part = if row.edition.part == "10303" { "ISO 10303 resources".into() } else { format!("ISO 14649-{}", row.edition.part) };
    text.push_str(&format!("\n{kind}used by {many}; *{part} ({})*", row.edition.text));
    text
}

/// A value as text, references one level resolved.
fn value(v: gr_step::Val<'_>) -> String {
    let escape = |t: &str| t.replace('|', "\\|");
    match v.kind() {
        Kind::List => {
            let items: Vec<String> = v.items().take(6).map(value).collect();
            let more = v.items().count().saturating_sub(6);
            let tail = if more > 0 { format!(", … {more} more") } else { String::new() };
            format!("({}{tail})", items.join(", "))
        }
        Kind::Typed => v.typed().map_or(String::new(), |(k, inside)| format!("{k}({})", value(inside))),
        Kind::Reference => v.node().map_or_else(|| format!("{} (missing)", v.text()), |n| escape(&reference(n))),
        Kind::Unset => "not given".into(),
        _ => escape(&v.text()),
    }
}

/// An instance in a few words: points and directions with their numbers.
fn reference(n: Node<'_>) -> String {
    let inside = n.attr("coordinates").or_else(|| n.attr("direction_ratios"));
    if let Some(list) = inside {
        let numbers: Vec<String> = list.items().filter_map(|v| v.real()).map(|v| number(v, 4)).collect();
        return format!("#{} ({})", n.id(), numbers.join(", "));
    }
    if let Some(size) = n.real("theoretical_size") {
        return format!("#{} {} mm", n.id(), number(size, 4));
    }
    short(n)
}
