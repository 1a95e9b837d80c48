//! Everything that knows the shapes of the protocol: positions, diagnostics, edits.

pub mod custom;

use gr_text::{Diagnostic, Severity, Span};
use tower_lsp::ls_types as lsp;

/// Lines of a text, and columns as the client counts them.
pub struct Lines<'t> {
    text: &'t str,
    starts: Vec<u32>,
    utf8: bool,
}

impl<'t> Lines<'t> {
    pub fn new(text: &'t str, utf8: bool) -> Lines<'t> {
        let mut starts = vec![0];
        let bytes = text.as_bytes();
        for (i, b) in bytes.iter().enumerate() {
            if *b == b'\n' || (*b == b'\r' && bytes.get(i + 1) != Some(&b'\n')) {
                starts.push(i as u32 + 1);
            }
        }
        Lines { text, starts, utf8 }
    }
    /// Text of a line without its end, and its first byte.
    pub fn line(&self, line: u32) -> (&'t str, u32) {
        let start = self.start(line);
        let end = self.start(line + 1);
        (self.text[start as usize..end as usize].trim_end_matches(['\n', '\r']), start)
    }
    fn start(&self, line: u32) -> u32 {
        self.starts.get(line as usize).copied().unwrap_or(self.text.len() as u32)
    }
    /// Byte of a position; positions past the end of a line or of the text are taken back to it.
    pub fn offset(&self, p: lsp::Position) -> u32 {
        let (line, start) = self.line(p.line);
        if self.utf8 {
            let mut at = (p.character as usize).min(line.len());
            while !line.is_char_boundary(at) {
                at -= 1;
            }
            return start + at as u32;
        }
        let mut units = 0;
        for (at, c) in line.char_indices() {
            if units >= p.character {
                return start + at as u32;
            }
            units += c.len_utf16() as u32;
        }
        start + line.len() as u32
    }
    pub fn position(&self, offset: u32) -> lsp::Position {
        let line = self.starts.partition_point(|s| *s <= offset).saturating_sub(1);
        let start = self.starts[line];
        let before = self.text.get(start as usize..offset as usize).unwrap_or("");
        let character = if self.utf8 { before.len() as u32 } else { before.chars().map(|c| c.len_utf16() as u32).sum() };
        lsp::Position { line: line as u32, character }
    }
    pub fn range(&self, span: Span) -> lsp::Range {
        lsp::Range { start: self.position(span.start), end: self.position(span.end) }
    }
}

/// A finding as the protocol has it. Only places in the file itself are pointed at.
pub fn diagnostic(d: &Diagnostic, lines: &Lines<'_>, uri: &lsp::Uri) -> lsp::Diagnostic {
    let (file, span) = d.primary();
    let mut message = d.message.clone();
    for note in &d.notes {
        message.push_str(&format!("\nNote: {note}"));
    }
    if let Some(help) = &d.help {
        message.push_str(&format!("\nHelp: {help}"));
    }
    let related = d.labels.iter().skip(1).filter(|l| l.file == file && !l.text.is_empty()).map(|l| {
        lsp::DiagnosticRelatedInformation {
            location: lsp::Location { uri: uri.clone(), range: lines.range(l.span) },
            message: l.text.clone(),
        }
    });
    let related: Vec<_> = related.collect();
    lsp::Diagnostic {
        range: lines.range(span),
        severity: Some(match d.severity {
            Severity::Error => lsp::DiagnosticSeverity::ERROR,
            Severity::Warning => lsp::DiagnosticSeverity::WARNING,
            Severity::Hint => lsp::DiagnosticSeverity::HINT,
        }),
        code: Some(lsp::NumberOrString::String(d.code.def().code.to_string())),
        source: Some("gcc-robot".into()),
        message,
        related_information: (!related.is_empty()).then_some(related),
        ..lsp::Diagnostic::default()
    }
}
