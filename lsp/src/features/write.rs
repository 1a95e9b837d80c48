//! Writing: completion, signatures, formatting.

use gr_gcode::FormatOptions;
use gr_ide::gcode::complete::Around;
use gr_ide::gcode::names;
use gr_ide::{Completion, Edit, Signature, config, gcode, p21};
use gr_text::Span;
use tower_lsp::ls_types as lsp;

use super::{Answer, doc, exchange_doc, text_edits};
use crate::documents::{Kind, View};
use crate::protocol::{completion_kind, markdown};

/// What can be written next; `snippets`: the client knows fields to fill in.
pub fn completion(mut view: View, at: lsp::Position, snippets: bool) -> Answer<lsp::CompletionList> {
    let offset = view.offset(at);
    let found = match view.kind {
        Kind::Gcode(..) => gcode_completion(&mut view, offset)?,
        Kind::Exchange => p21::complete::complete(exchange_doc(&view.exchange()), offset),
        Kind::Config(schema) => config::complete(schema, &view.text.to_string(), offset),
        Kind::Tools => config::tools::complete(&view.text.to_string(), offset),
        Kind::Ini => config::linuxcnc::ini_complete(&view.text.to_string(), offset),
        Kind::Vars | Kind::Other => Vec::new(),
    };
    // A list that was cut must be asked for again when more is typed.
    let is_incomplete = found.len() >= 200;
    let plain = |c: Completion| if c.snippet && !snippets { Completion { insert: without_fields(&c.insert), snippet: false, ..c } } else { c };
    let items = found.into_iter().map(plain).enumerate().map(|(n, c)| item(&view, n, c)).collect();
    Ok(lsp::CompletionList { is_incomplete, items, ..lsp::CompletionList::default() })
}

/// A snippet as text: `X${1:10}` → `X10`; `$0` and `${1}` are nothing, `\$` is a dollar sign.
fn without_fields(snippet: &str) -> String {
    let mut out = String::new();
    let mut rest = snippet.chars().peekable();
    while let Some(c) = rest.next() {
        match c {
            '\\' => out.extend(rest.next()),
            '$' if rest.next_if_eq(&'{').is_some() => {
                while rest.next_if(char::is_ascii_digit).is_some() {}
                rest.next_if_eq(&':');
            }
            '$' => while rest.next_if(char::is_ascii_digit).is_some() {},
            '}' => {}
            c => out.push(c),
        }
    }
    out
}

fn gcode_completion(view: &mut View, offset: u32) -> Answer<Vec<Completion>> {
    let Some((session, file, dialect)) = view.session() else { return Ok(Vec::new()) };
    let tables = (session.file(file)?, dialect);
    let here = doc(&tables).line_at(offset).map(|l| l.line);
    let line = here.unwrap_or_else(|| doc(&tables).count().saturating_sub(1));
    let state = if dialect.family == gr_spec::Family::Ufmg2008 { None } else { session.state_at(file, line)? };
    view.release();
    let subs = other_subs(view, dialect);
    let setup = view.station.setup_for(dialect);
    let around = Around {
        modal: state.as_ref().map(|s| if here.is_some() { &s.before } else { &s.after }),
        setup: Some(&setup).filter(|_| dialect.family != gr_spec::Family::Ufmg2008),
        tools: Some((&setup.tools, setup.machine_units)),
        subs: &subs,
    };
    Ok(gcode::complete::complete(doc(&tables), offset, around))
}

/// Subroutines of other files of the workspace.
fn other_subs(view: &View, dialect: &'static gr_spec::Dialect) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for (path, _, file) in view.other_programs() {
        let place = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let subs = names::subs(gcode::Doc { file: &file, dialect });
        // Only the subroutine that a file is named after is found from outside.
        let named = path.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let subs: Vec<_> = subs.into_iter().filter(|s| super::names::file_name(&s.label) == named).collect();
        found.extend(subs.iter().map(|s| (names::label_text(&s.label), place.clone())));
        if found.len() > 500 {
            break;
        }
    }
    found
}

fn item(view: &View, n: usize, c: Completion) -> lsp::CompletionItem {
    // Editors compare this with the text that is replaced, and that may begin with a bracket or a quote.
    let quoted = c.insert.starts_with(|first: char| first.is_ascii_punctuation() && !c.label.starts_with(first));
    let filter = if quoted { without_fields(&c.insert) } else { c.label.clone() };
    lsp::CompletionItem {
        kind: Some(completion_kind(c.kind)),
        detail: (!c.detail.is_empty()).then_some(c.detail),
        documentation: (!c.documentation.is_empty()).then(|| lsp::Documentation::MarkupContent(markdown(c.documentation))),
        sort_text: Some(format!("{}{n:05}", c.rank)),
        filter_text: Some(filter),
        insert_text_format: Some(if c.snippet { lsp::InsertTextFormat::SNIPPET } else { lsp::InsertTextFormat::PLAIN_TEXT }),
        text_edit: Some(lsp::CompletionTextEdit::Edit(lsp::TextEdit { range: view.range(c.replace), new_text: c.insert })),
        label: c.label,
        ..lsp::CompletionItem::default()
    }
}

/// The form of what is being written.
pub fn signature(mut view: View, at: lsp::Position) -> Answer<Option<lsp::SignatureHelp>> {
    let offset = view.offset(at);
    let found = match view.kind {
        Kind::Gcode(..) => {
            let Some((session, file, dialect)) = view.session() else { return Ok(None) };
            let tables = (session.file(file)?, dialect);
            let line = doc(&tables).line_at(offset).map_or(0, |l| l.line);
            let state = if dialect.family == gr_spec::Family::Ufmg2008 { None } else { session.state_at(file, line)? };
            view.release();
            gcode::complete::signature(doc(&tables), offset, state.as_ref().map(|s| &s.before))
        }
        Kind::Exchange => p21::complete::signature(exchange_doc(&view.exchange()), offset),
        _ => None,
    };
    Ok(found.map(|s| help(&view, s)))
}

fn help(view: &View, s: Signature) -> lsp::SignatureHelp {
    // Offsets into the label are counted as the client counts columns.
    let units = |at: u32| {
        let before = s.label.get(..at as usize).unwrap_or("");
        if view.columns == crate::text::Columns::Utf8 { before.len() as u32 } else { before.encode_utf16().count() as u32 }
    };
    let parameters = s
        .parameters
        .iter()
        .map(|(range, text)| lsp::ParameterInformation {
            label: lsp::ParameterLabel::LabelOffsets([units(range.start), units(range.end)]),
            documentation: (!text.is_empty()).then(|| lsp::Documentation::MarkupContent(markdown(text.clone()))),
        })
        .collect();
    let information = lsp::SignatureInformation {
        label: s.label.clone(),
        documentation: (!s.documentation.is_empty()).then(|| lsp::Documentation::MarkupContent(markdown(s.documentation.clone()))),
        parameters: Some(parameters),
        active_parameter: s.active,
    };
    lsp::SignatureHelp { signatures: vec![information], active_signature: Some(0), active_parameter: s.active }
}

/// Formats the document, or some of its lines.
pub fn format(mut view: View, lines: Option<lsp::Range>, options: &lsp::FormattingOptions) -> Answer<Vec<lsp::TextEdit>> {
    let edits = match view.kind {
        Kind::Gcode(..) => {
            let Some(tables) = view.program()? else { return Ok(Vec::new()) };
            let range = lines.map_or(0..u32::MAX, |r| {
                // A selection that ends at the start of a line does not mean that line.
                let end = if r.end.character == 0 && r.end.line > r.start.line { r.end.line } else { r.end.line.saturating_add(1) };
                r.start.line..end
            });
            gcode::format::edits(doc(&tables), &format_options(options), range)
        }
        Kind::Exchange => {
            let exchange = view.exchange();
            let new = gr_p21::format(exchange.text.as_bytes());
            let span = lines.map(|r| Span::new(view.offset(r.start), view.offset(r.end)));
            exchange_edits(&exchange.text, &String::from_utf8_lossy(&new), span)
        }
        _ => Vec::new(),
    };
    Ok(text_edits(&view, edits))
}

fn format_options(options: &lsp::FormattingOptions) -> FormatOptions {
    FormatOptions { indent: options.tab_size.min(16) as usize, ..FormatOptions::default() }
}

/// What differs, as one edit; of a part, the statements in it.
fn exchange_edits(old: &str, new: &str, part: Option<Span>) -> Vec<Edit> {
    if old == new {
        return Vec::new();
    }
    if let Some(part) = part {
        // Statements keep their order: those that begin in the part are put in place one by one.
        let (a, b) = (gr_p21::parse(old.as_bytes()), gr_p21::parse(new.as_bytes()));
        if a.instances.len() != b.instances.len() {
            return Vec::new();
        }
        let inside = a.instances.iter().zip(&b.instances).filter(|(i, _)| part.start <= i.start && i.start < part.end.max(part.start + 1));
        return inside
            .filter_map(|(i, j)| {
                let (before, after) = (old.get(i.start as usize..i.end as usize)?, new.get(j.start as usize..j.end as usize)?);
                (before != after).then(|| Edit { span: Span::new(i.start, i.end), text: after.to_string() })
            })
            .collect();
    }
    vec![Edit { span: Span::new(0, old.len() as u32), text: new.to_string() }]
}

/// After a line end was typed: the line before is formatted, and goes on with the next N number where lines have one.
pub fn on_type(mut view: View, at: lsp::Position, typed: &str, options: &lsp::FormattingOptions) -> Answer<Vec<lsp::TextEdit>> {
    let Some(tables) = view.program()? else { return Ok(Vec::new()) };
    let doc = doc(&tables);
    if typed != "\n" || at.line == 0 || doc.len() > 4_000_000 {
        return Ok(Vec::new());
    }
    let mut edits = gcode::format::edits(doc, &format_options(options), at.line - 1..at.line);
    edits.extend(next_number(doc, at.line));
    Ok(text_edits(&view, edits))
}

/// The N word of a new line: the one before, and the step between the last two.
fn next_number(doc: gcode::Doc<'_>, line: u32) -> Option<Edit> {
    let new = doc.line(line).map(|l| (l.text().trim().is_empty(), l.span()));
    let (empty, span) = new.unwrap_or((true, Span::new(doc.len(), doc.len())));
    if !empty {
        return None;
    }
    let number = |l: u32| doc.line(l)?.literal(b'n').map(|w| w.value as i64);
    let last = number(line.checked_sub(1)?)?;
    let before = (0..line.saturating_sub(1)).rev().take(50).find_map(number);
    let step = before.map_or(10, |b| (last - b).clamp(1, 1_000));
    Some(Edit { span, text: format!("N{} ", last + step) })
}

#[cfg(test)]
mod tests {
    use super::without_fields;

    #[test]
    fn snippets_as_text() {
        assert_eq!(without_fields("G83 X${1:0} R${2} Q$3 \\$5$0"), "G83 X0 R Q $5");
    }
}
