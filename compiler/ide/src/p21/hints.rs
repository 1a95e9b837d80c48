//! Names of attributes before their values.

use gr_text::Span;

use super::{Doc, attribute, unit, words};
use crate::{Hint, HintKind};

/// Hints of the statements in a stretch of text.
pub fn hints(doc: Doc<'_>, span: Span) -> Vec<Hint> {
    let model = super::model(doc);
    let mut found = Vec::new();
    let first = doc.file.instances.partition_point(|i| i.end <= span.start);
    let last = doc.file.instances.partition_point(|i| i.start < span.end);
    for n in first..last {
        let Some(node) = model.at(n as u32) else { continue };
        for (place, v) in node.parameters().enumerate() {
            let Some(a) = attribute(node, place) else { continue };
            let at = v.span().start;
            if at < span.start || at >= span.end {
                continue;
            }
            let tooltip = format!("{} of {}: {}", a.name, words(node.keyword()), a.written);
            found.push(Hint { at, text: format!("{}:", a.name), kind: HintKind::Attribute, tooltip });
            let value_unit = unit(a, doc.units);
            if !value_unit.is_empty() && v.real().is_some() && v.span().end <= span.end {
                found.push(Hint { at: v.span().end, text: format!(" {value_unit}"), kind: HintKind::Type, tooltip: String::new() });
            }
        }
    }
    found
}
