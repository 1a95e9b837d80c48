//! Names over files: definition, references, rename, highlights, linked editing, call hierarchy.

use std::collections::HashMap;
use std::path::PathBuf;

use gr_gcode::{Label, Parameter};
use gr_ide::gcode::{self, names};
use gr_ide::{Role, p21};
use gr_text::Span;
use names::Name;
use serde_json::json;
use tower_lsp::ls_types as lsp;

use super::{Answer, Failure, doc, exchange_doc};
use crate::documents::{Kind, View};
use crate::text::Text;

/// `100` or `name`, as a file is called.
pub(super) fn file_name(label: &Label) -> String {
    match label {
        Label::Number(n) => n.to_string(),
        // A name is no way through folders.
        Label::Named(n) if n.contains(['/', '\\']) || n.contains("..") => String::new(),
        Label::Named(n) => n.to_string(),
        Label::Dynamic => String::new(),
    }
}

/// A subroutine file beside the program: where programs keep them when no search path is named.
pub(super) fn beside(view: &View, name: &str) -> Option<PathBuf> {
    let path = view.path.parent()?.join(format!("{name}.ngc"));
    let inside = view.workspace.holds(&path) || view.workspace.folders().is_empty() && path.is_file();
    (inside && !name.is_empty()).then_some(path)
}

fn location(uri: &lsp::Uri, file: &gr_gcode::File, span: Span, view: &View) -> lsp::Location {
    let text: String = file.chunks.iter().map(|c| &*c.text).collect();
    lsp::Location { uri: uri.clone(), range: Text::new(&text).range(span, view.columns) }
}

/// Larger exchange files are not parsed to follow a reference, bytes.
const BIG_EXCHANGE: u32 = 8_000_000;

/// The statement of the `#id` under the cursor, found without reading the file as a whole.
fn quick_definition(view: &View, at: lsp::Position) -> Option<Span> {
    let (line, start) = view.text.line(at.line);
    let column = (view.offset(at) - start) as usize;
    let hash = line.get(..line.len().min(column + 1))?.rfind('#')?;
    let digits = line[hash + 1..].bytes().take_while(u8::is_ascii_digit).count();
    if digits == 0 || column > hash + 1 + digits {
        return None;
    }
    let id: u64 = line[hash + 1..hash + 1 + digits].parse().ok()?;
    let found = view.text.instance(id)?;
    Some(Span::new(found, found + 1 + digits as u32))
}

/// Where the name under the cursor is defined.
pub fn definition(mut view: View, at: lsp::Position) -> Answer<Vec<lsp::Location>> {
    let offset = view.offset(at);
    if matches!(view.kind, Kind::Exchange) {
        let own = |span: Span| lsp::Location { uri: view.uri.clone(), range: view.range(span) };
        if view.text.len() > BIG_EXCHANGE {
            return Ok(quick_definition(&view, at).map(own).into_iter().collect());
        }
        let exchange = view.exchange();
        let doc = exchange_doc(&exchange);
        let found = p21::names::name_at(doc, offset).and_then(|(id, _)| p21::names::definition(doc, id));
        return Ok(found.map(own).into_iter().collect());
    }
    let Some(tables) = view.program()? else { return Ok(Vec::new()) };
    let doc = doc(&tables);
    let Some((name, _)) = names::name_at(doc, offset) else { return Ok(Vec::new()) };
    let line = doc.line_at(offset).map(|l| l.line);
    let found = names::definitions(doc, &name, line);
    if !found.is_empty() {
        return Ok(found.into_iter().map(|s| lsp::Location { uri: view.uri.clone(), range: view.range(s) }).collect());
    }
    Ok(match &name {
        Name::Sub(label) => sub_elsewhere(&view, label, tables.1).map(|(uri, file, span)| location(&uri, &file, span, &view)).into_iter().collect(),
        Name::Tool(number) => tool_row(&view, *number).into_iter().collect(),
        _ => Vec::new(),
    })
}

type Found = (lsp::Uri, std::sync::Arc<gr_gcode::File>, Span);

/// A subroutine in a file of its own: on the search path, beside the program, or anywhere in the workspace.
fn sub_elsewhere(view: &View, label: &Label, dialect: &'static gr_spec::Dialect) -> Option<Found> {
    let name = file_name(label);
    let setup = view.station.setup_for(dialect);
    let paths = gr_interp::subroutine_paths(&setup, &name).into_iter().chain(beside(view, &name));
    let in_file = |uri: lsp::Uri, file: std::sync::Arc<gr_gcode::File>| {
        let doc = gcode::Doc { file: &file, dialect };
        let span = names::definitions(doc, &Name::Sub(label.clone()), None).first().copied()?;
        Some((uri, file, span))
    };
    for path in paths.filter(|p| p.is_file() && !view.workspace.strays(p)) {
        if let Some(found) = view.file_at(&path).and_then(|(uri, file)| in_file(uri, file)) {
            return Some(found);
        }
    }
    view.other_programs().into_iter().find_map(|(_, uri, file)| in_file(uri, file))
}

/// The line of a tool in the tool table.
fn tool_row(view: &View, number: i64) -> Option<lsp::Location> {
    let path = view.station.files.iter().find(|p| p.extension().is_some_and(|e| e == "tbl"))?;
    let text = match view.others.iter().find(|o| o.path == *path) {
        Some(open) => open.text.to_string(),
        None => gr_text::decode(std::fs::read(path).ok()?).text,
    };
    let item = gr_ide::config::tools::outline(&text).into_iter().find(|i| i.name == format!("T{number}"))?;
    Some(lsp::Location { uri: lsp::Uri::from_file_path(path)?, range: Text::new(&text).range(item.span, view.columns) })
}

/// Everywhere that the name under the cursor stands.
pub fn references(mut view: View, at: lsp::Position, declaration: bool) -> Answer<Vec<lsp::Location>> {
    let offset = view.offset(at);
    let mut found = Vec::new();
    for (uri, spans, text) in everywhere(&mut view, offset)?.1 {
        let text = text.as_ref().unwrap_or(&view.text);
        let wanted = spans.into_iter().filter(|o| declaration || o.role != Role::Definition);
        found.extend(wanted.map(|o| lsp::Location { uri: uri.clone(), range: text.range(o.span, view.columns) }));
    }
    Ok(found)
}

/// What stands under the cursor.
enum Target {
    None,
    Instance(u64),
    Name(Name, Option<u32>),
}

type PerFile = Vec<(lsp::Uri, Vec<gr_ide::Occurrence>, Option<Text>)>;

fn everywhere(view: &mut View, offset: u32) -> Answer<(Target, PerFile)> {
    let uri = view.uri.clone();
    if matches!(view.kind, Kind::Exchange) {
        let exchange = view.exchange();
        let doc = exchange_doc(&exchange);
        let Some((id, _)) = p21::names::name_at(doc, offset) else { return Ok((Target::None, Vec::new())) };
        return Ok((Target::Instance(id), vec![(uri, p21::names::occurrences(doc, id), None)]));
    }
    let Some(tables) = view.program()? else { return Ok((Target::None, Vec::new())) };
    let doc = doc(&tables);
    let Some((name, _)) = names::name_at(doc, offset) else { return Ok((Target::None, Vec::new())) };
    let line = doc.line_at(offset).map(|l| l.line);
    let mut found = vec![(uri, names::occurrences(doc, &name, line), None)];
    // Subroutines are known to all files; so are global names, but each program starts with none of them.
    let shared = matches!(name, Name::Sub(_));
    if shared {
        for (_, uri, file) in view.other_programs() {
            let spans = names::occurrences(gcode::Doc { file: &file, dialect: tables.1 }, &name, None);
            if !spans.is_empty() {
                let text: String = file.chunks.iter().map(|c| &*c.text).collect();
                found.push((uri, spans, Some(Text::new(&text))));
            }
        }
    }
    Ok((Target::Name(name, line), found))
}

/// The name that would be renamed.
pub fn prepare_rename(mut view: View, at: lsp::Position) -> Answer<Option<lsp::PrepareRenameResponse>> {
    let offset = view.offset(at);
    let span = if matches!(view.kind, Kind::Exchange) {
        p21::names::name_at(exchange_doc(&view.exchange()), offset).map(|f| f.1)
    } else {
        let Some(tables) = view.program()? else { return Ok(None) };
        let found = names::name_at(doc(&tables), offset);
        if let Some((Name::Parameter(Parameter::Named(n)), _)) = &found
            && gr_spec::parameter(n).is_some_and(|d| !d.name.is_empty())
        {
            return Err(Failure::Refused(format!("#<{n}> is the controller's own")));
        }
        found.filter(|(n, _)| !matches!(n, Name::Tool(_))).map(|f| f.1)
    };
    Ok(span.map(|s| lsp::PrepareRenameResponse::RangeWithPlaceholder { range: view.range(s), placeholder: view.text.slice(s) }))
}

/// Renames in all files.
pub fn rename(mut view: View, at: lsp::Position, new: &str) -> Answer<Option<lsp::WorkspaceEdit>> {
    let offset = view.offset(at);
    let (target, files) = everywhere(&mut view, offset)?;
    let new = match &target {
        Target::None => return Ok(None),
        Target::Instance(id) => {
            let exchange = view.exchange();
            p21::names::rename(exchange_doc(&exchange), *id, new).map_err(Failure::Refused)?;
            format!("#{}", new.trim().trim_start_matches('#'))
        }
        Target::Name(name, line) => {
            let checked = names::check_new_name(name, new).map_err(Failure::Refused)?;
            let Kind::Gcode(_, dialect) = view.kind else { return Ok(None) };
            let file = gr_driver::scan_file("", &view.text.to_string(), dialect);
            if names::is_taken(gcode::Doc { file: &file, dialect }, name, *line, &checked) {
                return Err(Failure::Refused(format!("{checked} is taken already")));
            }
            checked
        }
    };
    let mut changes = HashMap::new();
    for (uri, spans, text) in files {
        let text = text.as_ref().unwrap_or(&view.text);
        let edits = spans.into_iter().map(|o| lsp::TextEdit { range: text.range(o.span, view.columns), new_text: new.clone() }).collect();
        changes.insert(uri, edits);
    }
    Ok(Some(lsp::WorkspaceEdit { changes: Some(changes), ..lsp::WorkspaceEdit::default() }))
}

/// Where the name under the cursor stands in this document.
pub fn highlights(mut view: View, at: lsp::Position) -> Answer<Vec<lsp::DocumentHighlight>> {
    let offset = view.offset(at);
    let found = if matches!(view.kind, Kind::Exchange) {
        let exchange = view.exchange();
        let doc = exchange_doc(&exchange);
        p21::names::name_at(doc, offset).map(|(id, _)| p21::names::occurrences(doc, id))
    } else {
        let Some(tables) = view.program()? else { return Ok(Vec::new()) };
        let doc = doc(&tables);
        names::name_at(doc, offset).map(|(name, _)| names::occurrences(doc, &name, doc.line_at(offset).map(|l| l.line)))
    };
    let highlight = |o: gr_ide::Occurrence| lsp::DocumentHighlight {
        range: view.range(o.span),
        kind: Some(if o.role == Role::Read { lsp::DocumentHighlightKind::READ } else { lsp::DocumentHighlightKind::WRITE }),
    };
    Ok(found.into_iter().flatten().map(highlight).collect())
}

/// Labels that are edited together.
pub fn linked(mut view: View, at: lsp::Position) -> Answer<Option<lsp::LinkedEditingRanges>> {
    let offset = view.offset(at);
    let Some(tables) = view.program()? else { return Ok(None) };
    let spans = names::linked(doc(&tables), offset);
    let ranges: Vec<lsp::Range> = spans.into_iter().map(|s| view.range(s)).collect();
    Ok((ranges.len() > 1).then_some(lsp::LinkedEditingRanges { ranges, word_pattern: Some("[A-Za-z0-9_.-]+".into()) }))
}

// Call hierarchy: subroutines and their calls; instances and their references.

fn item(view: &View, uri: &lsp::Uri, name: &str, detail: &str, range: lsp::Range, selection: lsp::Range, kind: lsp::SymbolKind) -> lsp::CallHierarchyItem {
    let _ = view;
    lsp::CallHierarchyItem {
        name: name.into(),
        kind,
        tags: None,
        detail: (!detail.is_empty()).then(|| detail.to_string()),
        uri: uri.clone(),
        range,
        selection_range: selection,
        data: Some(json!({ "name": name })),
    }
}

fn sub_item(view: &View, uri: &lsp::Uri, file: &gr_gcode::File, text: &Text, sub: &names::Sub) -> lsp::CallHierarchyItem {
    let end = file.line_span(sub.last).end;
    let range = text.range(Span::new(file.line_span(sub.first).start, end), view.columns);
    let detail = uri.path().as_str().rsplit('/').next().unwrap_or("").to_string();
    item(view, uri, &names::label_text(&sub.label), &detail, range, text.range(sub.span, view.columns), lsp::SymbolKind::FUNCTION)
}

fn main_item(view: &View, uri: &lsp::Uri, text: &Text) -> lsp::CallHierarchyItem {
    let name = uri.path().as_str().rsplit('/').next().unwrap_or("program").to_string();
    let zero = lsp::Range::default();
    item(view, uri, &name, "main program", text.range(Span::new(0, text.len()), view.columns), zero, lsp::SymbolKind::FILE)
}

fn instance_item(view: &View, doc: p21::Doc<'_>, n: u32) -> Option<lsp::CallHierarchyItem> {
    let model = p21::model(doc);
    let node = model.at(n)?;
    let name = format!("#{}", node.id());
    let own = p21::name_of(node);
    let detail = if own.is_empty() { p21::words(node.keyword()) } else { format!("{} '{own}'", p21::words(node.keyword())) };
    let selection = view.range(doc.id_span(n).unwrap_or(node.span()));
    Some(item(view, &view.uri, &name, &detail, view.range(node.span()), selection, lsp::SymbolKind::OBJECT))
}

/// The subroutine or instance under the cursor.
pub fn prepare_calls(mut view: View, at: lsp::Position) -> Answer<Vec<lsp::CallHierarchyItem>> {
    let offset = view.offset(at);
    if matches!(view.kind, Kind::Exchange) {
        let exchange = view.exchange();
        let doc = exchange_doc(&exchange);
        let n = p21::names::name_at(doc, offset).and_then(|(id, _)| doc.file.find(id)).or_else(|| doc.instance_at(offset));
        return Ok(n.and_then(|n| instance_item(&view, doc, n)).into_iter().collect());
    }
    let Some(tables) = view.program()? else { return Ok(Vec::new()) };
    let doc = doc(&tables);
    let label = match names::name_at(doc, offset) {
        Some((Name::Sub(label), _)) => Some(label),
        _ => {
            let line = doc.line_at(offset).map_or(0, |l| l.line);
            names::subs(doc).into_iter().find(|s| (s.first..=s.last).contains(&line)).map(|s| s.label)
        }
    };
    let Some(label) = label else { return Ok(vec![main_item(&view, &view.uri, &view.text)]) };
    if let Some(sub) = names::subs(doc).iter().find(|s| s.label == label) {
        return Ok(vec![sub_item(&view, &view.uri, doc.file, &view.text, sub)]);
    }
    let Some((uri, file, _)) = sub_elsewhere(&view, &label, tables.1) else { return Ok(Vec::new()) };
    let other = gcode::Doc { file: &file, dialect: tables.1 };
    let text = Text::new(&other.text());
    Ok(names::subs(other).iter().find(|s| s.label == label).map(|s| sub_item(&view, &uri, &file, &text, s)).into_iter().collect())
}

fn label_of(name: &str) -> Option<Label> {
    let bare = name.strip_prefix('o')?;
    if let Some(named) = bare.strip_prefix('<').and_then(|n| n.strip_suffix('>')) {
        return Some(Label::Named(named.into()));
    }
    bare.parse().ok().map(Label::Number)
}

/// All programs that may call each other: this one first.
fn programs(view: &mut View) -> Answer<Vec<(lsp::Uri, std::sync::Arc<gr_gcode::File>)>> {
    let own = view.program()?.map(|t| (view.uri.clone(), t.0));
    let others = view.other_programs().into_iter().map(|(_, uri, file)| (uri, file));
    Ok(own.into_iter().chain(others).collect())
}

/// Who calls it.
pub fn incoming(mut view: View, of: &lsp::CallHierarchyItem) -> Answer<Vec<lsp::CallHierarchyIncomingCall>> {
    if matches!(view.kind, Kind::Exchange) {
        let exchange = view.exchange();
        let doc = exchange_doc(&exchange);
        let Some(id) = of.name.trim_start_matches('#').parse::<u64>().ok() else { return Ok(Vec::new()) };
        let users = p21::names::users(doc, id, 500);
        let call = |n: &u32| {
            let ranges = p21::names::references_of(doc, *n).into_iter().filter(|(_, to)| *to == id).map(|(s, _)| view.range(s)).collect();
            Some(lsp::CallHierarchyIncomingCall { from: instance_item(&view, doc, *n)?, from_ranges: ranges })
        };
        return Ok(users.iter().filter_map(call).collect());
    }
    let (Some(label), Kind::Gcode(_, dialect)) = (label_of(&of.name), view.kind) else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for (uri, file) in programs(&mut view)? {
        let doc = gcode::Doc { file: &file, dialect };
        let calls: Vec<names::CallSite> = names::calls(doc).into_iter().filter(|c| c.label == label).collect();
        if calls.is_empty() {
            continue;
        }
        let (text, subs) = (Text::new(&doc.text()), names::subs(doc));
        let mut places: Vec<Option<usize>> = calls.iter().map(|c| c.from).collect();
        places.dedup();
        for place in places {
            let from = match place.and_then(|p| subs.get(p)) {
                Some(sub) => sub_item(&view, &uri, &file, &text, sub),
                None => main_item(&view, &uri, &text),
            };
            let ranges = calls.iter().filter(|c| c.from == place).map(|c| text.range(c.span, view.columns)).collect();
            found.push(lsp::CallHierarchyIncomingCall { from, from_ranges: ranges });
        }
    }
    Ok(found)
}

/// Whom it calls.
pub fn outgoing(mut view: View, of: &lsp::CallHierarchyItem) -> Answer<Vec<lsp::CallHierarchyOutgoingCall>> {
    if matches!(view.kind, Kind::Exchange) {
        let exchange = view.exchange();
        let doc = exchange_doc(&exchange);
        let n = of.name.trim_start_matches('#').parse::<u64>().ok().and_then(|id| doc.file.find(id));
        let Some(n) = n else { return Ok(Vec::new()) };
        let mut found: Vec<lsp::CallHierarchyOutgoingCall> = Vec::new();
        for (span, id) in p21::names::references_of(doc, n).into_iter().take(500) {
            let name = format!("#{id}");
            if let Some(known) = found.iter_mut().find(|f| f.to.name == name) {
                known.from_ranges.push(view.range(span));
            } else if let Some(to) = doc.file.find(id).and_then(|n| instance_item(&view, doc, n)) {
                found.push(lsp::CallHierarchyOutgoingCall { to, from_ranges: vec![view.range(span)] });
            }
        }
        return Ok(found);
    }
    let Kind::Gcode(_, dialect) = view.kind else { return Ok(Vec::new()) };
    let wanted = label_of(&of.name);
    let all = programs(&mut view)?;
    let mut found: Vec<lsp::CallHierarchyOutgoingCall> = Vec::new();
    let Some((uri, file)) = all.iter().find(|(uri, _)| *uri == of.uri) else { return Ok(found) };
    let doc = gcode::Doc { file, dialect };
    let (text, subs) = (Text::new(&doc.text()), names::subs(doc));
    let from = wanted.and_then(|l| subs.iter().position(|s| s.label == l));
    for call in names::calls(doc).into_iter().filter(|c| c.from == from) {
        let range = text.range(call.span, view.columns);
        let name = names::label_text(&call.label);
        if let Some(known) = found.iter_mut().find(|f| f.to.name == name) {
            known.from_ranges.push(range);
            continue;
        }
        let here = subs.iter().find(|s| s.label == call.label).map(|s| sub_item(&view, uri, file, &text, s));
        let to = here.or_else(|| {
            let (uri, file, _) = sub_elsewhere(&view, &call.label, dialect)?;
            let other = gcode::Doc { file: &file, dialect };
            let text = Text::new(&other.text());
            names::subs(other).iter().find(|s| s.label == call.label).map(|s| sub_item(&view, &uri, &file, &text, s))
        });
        if let Some(to) = to {
            found.push(lsp::CallHierarchyOutgoingCall { to, from_ranges: vec![range] });
        }
    }
    Ok(found)
}
