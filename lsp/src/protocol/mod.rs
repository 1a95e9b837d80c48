//! Shapes of the protocol: diagnostics, and data of the features as the client takes it.

pub mod custom;

use std::borrow::Cow;

use gr_ide::{ActionKind, CompletionKind, Item, ItemKind, TokenKind};
use gr_text::{Diagnostic, FileId, Label, Severity, Span};
use serde_json::json;
use tower_lsp::ls_types as lsp;

use crate::text::{Columns, Text};

/// Where a place of a finding is, in any file.
pub type Locate<'a> = dyn Fn((FileId, Span)) -> Option<lsp::Location> + 'a;

/// A finding as it is shown in a document: where it is, or where the document calls the file that it is in. None: it
/// has nothing to do with the document.
pub fn in_document(d: &Diagnostic, own: FileId) -> Option<Cow<'_, Diagnostic>> {
    if d.primary().0 == own {
        return Some(Cow::Borrowed(d));
    }
    // The innermost call comes first: the first one in this document is the one that leads out of it.
    let call = d.trace.iter().find(|f| f.file == own)?;
    let mut shown = d.clone();
    let there = shown.message.clone();
    shown.message = format!("{}: {there}", call.name);
    shown.fixes.clear();
    if let Some(label) = shown.labels.first_mut() {
        label.text = there;
    }
    shown.labels.insert(0, Label { file: own, span: call.span, text: String::new() });
    Some(Cow::Owned(shown))
}

/// A finding as the protocol has it.
pub fn diagnostic(d: &Diagnostic, text: &Text, columns: Columns, locate: &Locate<'_>) -> lsp::Diagnostic {
    let (_, span) = d.primary();
    let mut message = d.message.clone();
    for note in &d.notes {
        message.push_str(&format!("\nNote: {note}"));
    }
    if let Some(help) = &d.help {
        message.push_str(&format!("\nHelp: {help}"));
    }
    let labels = d.labels.iter().skip(1).filter(|l| !l.text.is_empty()).map(|l| ((l.file, l.span), l.text.clone()));
    let trace = d.trace.iter().map(|f| ((f.file, f.span), format!("called here: {}", f.name)));
    let related: Vec<lsp::DiagnosticRelatedInformation> =
        labels.chain(trace).filter_map(|(at, message)| Some(lsp::DiagnosticRelatedInformation { location: locate(at)?, message })).collect();
    let def = d.code.def();
    lsp::Diagnostic {
        range: text.range(visible(span, text), columns),
        severity: Some(match d.severity {
            Severity::Error => lsp::DiagnosticSeverity::ERROR,
            Severity::Warning => lsp::DiagnosticSeverity::WARNING,
            Severity::Hint => lsp::DiagnosticSeverity::HINT,
        }),
        code: Some(lsp::NumberOrString::String(def.code.to_string())),
        source: Some("gcc-robot".into()),
        message,
        related_information: (!related.is_empty()).then_some(related),
        tags: (d.code == gr_spec::code::LINE_NEVER_RUN).then(|| vec![lsp::DiagnosticTag::UNNECESSARY]),
        data: Some(json!({ "slug": def.slug, "fixes": d.fixes.len() })),
        ..lsp::Diagnostic::default()
    }
}

/// A place without width would not be seen: the character before or behind it is taken in.
fn visible(span: Span, text: &Text) -> Span {
    if span.end > span.start {
        return span;
    }
    let behind = text.slice(Span::new(span.start, span.start + 4));
    match behind.chars().next().filter(|c| !matches!(c, '\n' | '\r')) {
        Some(c) => Span::new(span.start, span.start + c.len_utf8() as u32),
        None => span,
    }
}

/// Symbols of the protocol.
pub fn symbol_kind(kind: ItemKind) -> lsp::SymbolKind {
    match kind {
        ItemKind::Sub => lsp::SymbolKind::FUNCTION,
        ItemKind::Tool => lsp::SymbolKind::CLASS,
        ItemKind::Operation => lsp::SymbolKind::STRING,
        ItemKind::Project => lsp::SymbolKind::PACKAGE,
        ItemKind::Workplan => lsp::SymbolKind::MODULE,
        ItemKind::Workingstep => lsp::SymbolKind::METHOD,
        ItemKind::Feature => lsp::SymbolKind::INTERFACE,
        ItemKind::MachiningOperation => lsp::SymbolKind::FUNCTION,
        ItemKind::CuttingTool => lsp::SymbolKind::CONSTANT,
        ItemKind::Section => lsp::SymbolKind::NAMESPACE,
        ItemKind::Key => lsp::SymbolKind::KEY,
    }
}

/// An outline entry with everything below it.
#[allow(deprecated, reason = "the protocol's struct has a deprecated field without a default")]
pub fn symbol(item: &Item, text: &Text, columns: Columns) -> lsp::DocumentSymbol {
    let selection_range = text.range(item.span, columns);
    let range = text.range(item.range, columns);
    let range = lsp::Range { start: range.start.min(selection_range.start), end: range.end.max(selection_range.end) };
    let children: Vec<lsp::DocumentSymbol> = item.children.iter().map(|c| symbol(c, text, columns)).collect();
    lsp::DocumentSymbol {
        name: if item.name.trim().is_empty() { "…".into() } else { item.name.clone() },
        detail: (!item.detail.is_empty()).then(|| item.detail.clone()),
        kind: symbol_kind(item.kind),
        tags: None,
        deprecated: None,
        range,
        selection_range,
        children: (!children.is_empty()).then_some(children),
    }
}

/// Kinds of proposals.
pub fn completion_kind(kind: CompletionKind) -> lsp::CompletionItemKind {
    match kind {
        CompletionKind::Code | CompletionKind::Keyword => lsp::CompletionItemKind::KEYWORD,
        CompletionKind::Word => lsp::CompletionItemKind::PROPERTY,
        CompletionKind::Parameter => lsp::CompletionItemKind::VARIABLE,
        CompletionKind::Function => lsp::CompletionItemKind::FUNCTION,
        CompletionKind::Sub => lsp::CompletionItemKind::METHOD,
        CompletionKind::Tool => lsp::CompletionItemKind::CONSTANT,
        CompletionKind::Snippet => lsp::CompletionItemKind::SNIPPET,
        CompletionKind::Entity => lsp::CompletionItemKind::CLASS,
        CompletionKind::Enumeration => lsp::CompletionItemKind::ENUM_MEMBER,
        CompletionKind::Reference => lsp::CompletionItemKind::REFERENCE,
        CompletionKind::Value => lsp::CompletionItemKind::VALUE,
    }
}

/// Kinds of actions.
pub fn action_kind(kind: ActionKind) -> lsp::CodeActionKind {
    match kind {
        ActionKind::Fix => lsp::CodeActionKind::QUICKFIX,
        ActionKind::Rewrite => lsp::CodeActionKind::REFACTOR_REWRITE,
        ActionKind::Inline => lsp::CodeActionKind::REFACTOR_INLINE,
        ActionKind::Source => lsp::CodeActionKind::SOURCE,
    }
}

/// Types of tokens, in the order of the legend.
pub const TOKEN_TYPES: &[&str] =
    &["keyword", "macro", "method", "property", "number", "variable", "function", "label", "comment", "operator", "type", "string", "enumMember"];

/// Place of a kind in [`TOKEN_TYPES`].
pub fn token_type(kind: TokenKind) -> u32 {
    let name = gr_ide::TOKEN_KINDS[kind as usize];
    TOKEN_TYPES.iter().position(|t| *t == name).unwrap_or(0) as u32
}

/// Markdown.
pub fn markdown(value: String) -> lsp::MarkupContent {
    lsp::MarkupContent { kind: lsp::MarkupKind::Markdown, value }
}

#[cfg(test)]
mod tests {
    #[test]
    fn all_token_kinds_are_in_the_legend() {
        for name in gr_ide::TOKEN_KINDS {
            assert!(super::TOKEN_TYPES.contains(&name), "{name}");
        }
    }
}
