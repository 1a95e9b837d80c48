//! Formatting as edits of lines: the formatter never adds or removes one.

use std::ops::Range;

use gr_gcode::FormatOptions;

use super::doc::Doc;
use crate::Edit;

/// Edits that format some lines.
pub fn edits(doc: Doc<'_>, options: &FormatOptions, lines: Range<u32>) -> Vec<Edit> {
    let text = doc.text();
    let scan = gr_gcode::scan(&text, doc.dialect);
    let new = gr_gcode::format(&text, &scan, doc.dialect, options);
    let formatted = gr_gcode::scan(&new, doc.dialect);
    if formatted.lines.len() != scan.lines.len() {
        return Vec::new();
    }
    let mut found = Vec::new();
    for line in lines.start..lines.end.min(scan.lines.len() as u32) {
        let (old_span, new_span) = (scan.line_span(&text, line), formatted.line_span(&new, line));
        let (before, after) = (&text[old_span.range()], &new[new_span.range()]);
        if before != after {
            found.push(Edit { span: old_span, text: after.to_string() });
        }
    }
    found
}
