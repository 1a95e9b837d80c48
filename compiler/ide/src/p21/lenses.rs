//! Time, way and tool of every workingstep, above its statement.

use gr_ir::Marker;
use gr_ir::measure::Report;
use gr_text::{LineIndex, Span};

use super::{Doc, name_of, words};
use crate::Lens;
use crate::gcode::doc::{duration, number};

/// Lenses of a file that was planned.
pub fn lenses(doc: Doc<'_>, lines: &LineIndex, report: Option<&Report>) -> Vec<Lens> {
    let model = super::model(doc);
    let mut found = Vec::new();
    for step in model.all("machining_workingstep") {
        let line = lines.position(step.span().start).0;
        let mut parts = Vec::new();
        if let Some(report) = report {
            let own = |s: &&gr_ir::measure::Stretch| s.marker == Marker::Workingstep && u64::try_from(s.code) == Ok(step.id());
            let runs: Vec<_> = report.stretches.iter().filter(own).collect();
            let mut totals = gr_ir::measure::Totals::default();
            runs.iter().for_each(|s| totals.add(&s.totals));
            if !runs.is_empty() {
                parts.push(duration(totals.seconds()));
                parts.push(format!("{} mm at feed", number(totals.feed_nm as f64 / 1e6, 0)));
            }
        }
        if let Some(operation) = step.node("its_operation") {
            let tool = operation.node("its_tool").map(name_of).filter(|n| !n.is_empty());
            parts.push(words(operation.keyword()));
            parts.extend(tool.map(|t| format!("tool {t}")));
        }
        if let Some(feature) = step.node("its_feature") {
            parts.push(words(feature.keyword()));
        }
        found.push(Lens { line, text: parts.join(", ") });
    }
    if let Some(report) = report.filter(|r| r.totals.moves > 0) {
        for project in model.all("project") {
            let line = lines.position(project.span().start).0;
            let text = format!("whole plan: {}, {} mm at feed", duration(report.totals.seconds()), number(report.totals.feed_nm as f64 / 1e6, 0));
            found.push(Lens { line, text });
        }
    }
    found.sort_by_key(|l| l.line);
    found
}

/// Places of the values that a cursor grows over: value, list, parameters, statement, section, file.
pub fn selections(doc: Doc<'_>, offset: u32) -> Vec<Span> {
    let mut out = Vec::new();
    if let Some(n) = doc.instance_at(offset) {
        if let Some((_, v)) = doc.value_at(n, offset)
            && !matches!(v.kind(), gr_p21::Kind::List | gr_p21::Kind::Typed)
        {
            out.push(Span::new(v.start, v.start + v.len()));
        }
        let i = &doc.file.instances[n as usize];
        out.extend(brackets(doc.text, i.start, i.end, offset));
        out.push(Span::new(i.start, i.end));
    }
    out.extend(doc.file.sections.iter().map(|s| s.span).filter(|s| s.start <= offset && offset < s.end));
    out.push(Span::new(0, doc.text.len() as u32));
    out.dedup();
    out
}

/// What stands inside the parentheses around a byte, innermost first.
fn brackets(text: &[u8], from: u32, to: u32, at: u32) -> Vec<Span> {
    let (mut open, mut found, mut string) = (Vec::new(), Vec::new(), false);
    for p in from..to.min(text.len() as u32) {
        match text[p as usize] {
            b'\'' => string = !string,
            _ if string => {}
            b'(' => open.push(p + 1),
            b')' => {
                if let Some(start) = open.pop().filter(|s| *s <= at && at <= p) {
                    found.push(Span::new(start, p));
                }
            }
            _ => {}
        }
    }
    found
}
