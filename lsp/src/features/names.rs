//! Names over files: definition, references, rename, highlights, linked editing, call hierarchy.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::PathBuf;

use gr_gcode::{Label, Parameter};
use gr_ide::gcode::{self, names};
use gr_ide::{Role, p21};
use gr_text::Span;
use names::Name;
use serde_json::json;
use tower_lsp::ls_types as lsp;

use super::reach::{Home, Reach};
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

/// How addresses of pages begin that the client asks for by `gccRobot/explain`.
const PAGES: &str = "gcc-robot-explain";

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

/// The page of the entity whose name is under the cursor, for clients that can show one.
fn entity_page(view: &View, at: lsp::Position) -> Option<lsp::Location> {
    let (line, start) = view.text.line(at.line);
    let (keyword, _) = p21::page::name_at(&line, (view.offset(at) - start) as usize)?;
    let uri = format!("{PAGES}:/{keyword}.md").parse().ok()?;
    Some(lsp::Location { uri, range: lsp::Range::default() })
}

/// Where the name under the cursor is defined. `pages`: the client shows pages of the standard's entities by
/// `gccRobot/explain`.
pub fn definition(mut view: View, at: lsp::Position, pages: bool) -> Answer<Vec<lsp::Location>> {
    let offset = view.offset(at);
    if matches!(view.kind, Kind::Exchange) {
        if let Some(page) = entity_page(&view, at) {
            return Ok(pages.then_some(page).into_iter().collect());
        }
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
    if let Name::Sub(label) = &name
        && let reach = Reach::with(&view, tables.clone())
        && let Home::File(home) = reach.home(label, offset)
        && let Some(sub) = reach.sub(home, label)
    {
        let file = &reach.files[home];
        return Ok(vec![location(&file.uri, &file.file, sub.span, &view)]);
    }
    let found = names::definitions(doc, &name, line);
    if !found.is_empty() {
        return Ok(found.into_iter().map(|s| lsp::Location { uri: view.uri.clone(), range: view.range(s) }).collect());
    }
    Ok(match &name {
        Name::Sub(label) => sub_elsewhere(&view, label, tables.1).map(|(uri, file, span)| location(&uri, &file, span, &view)).into_iter().collect(),
        Name::Tool(number) => tool_row(&view, *number).into_iter().collect(),
        Name::Parameter(p) if !names::is_local(p) => {
            let reach = Reach::with(&view, tables.clone());
            let written = |i: usize| names::occurrences(reach.doc(i), &name, None).into_iter().filter(|o| o.role == Role::Write).map(move |o| (i, o.span));
            reach.connected(0).into_iter().flat_map(written).map(|(i, span)| location(&reach.files[i].uri, &reach.files[i].file, span, &view)).collect()
        }
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
    let named = |path: &PathBuf| path.file_stem().is_some_and(|s| s.to_string_lossy() == *name);
    view.other_programs().into_iter().filter(|(path, ..)| named(path)).find_map(|(_, uri, file)| in_file(uri, file))
}

/// The line of a tool in the tool table.
fn tool_row(view: &View, number: i64) -> Option<lsp::Location> {
    let path = view.station.files.iter().find(|p| p.extension().is_some_and(|e| e == "tbl"))?;
    let text = match view.others.iter().find(|o| o.path == *path) {
        Some(open) => open.text.to_string(),
        None => crate::workspace::stored(path)?,
    };
    let item = gr_ide::config::tools::outline(&text).into_iter().find(|i| i.name == format!("T{number}"))?;
    Some(lsp::Location { uri: lsp::Uri::from_file_path(path)?, range: Text::new(&text).range(item.span, view.columns) })
}

/// Where programs that are run with this tool table take the tool of the row at a byte.
fn uses_of_tool(view: &View, offset: u32, declaration: bool) -> Vec<lsp::Location> {
    let rows = gr_ide::config::tools::outline(&view.text.to_string());
    let Some(row) = rows.iter().find(|r| r.range.start <= offset && offset <= r.range.end) else { return Vec::new() };
    let Some(number) = row.name.strip_prefix('T').and_then(|n| n.parse().ok()) else { return Vec::new() };
    let own = lsp::Location { uri: view.uri.clone(), range: view.range(row.span) };
    let mut found: Vec<lsp::Location> = declaration.then_some(own).into_iter().collect();
    let mut stations = BTreeMap::new();
    for (path, uri, file) in view.other_programs() {
        let folder = path.parent().map(PathBuf::from);
        let station = stations.entry(folder).or_insert_with(|| view.host.station(&path, &view.settings));
        if !station.files.contains(&view.path) {
            continue;
        }
        let head: String = file.chunks.first().map_or(String::new(), |c| c.text.to_string());
        let dialect = (station.dialect_of)(&path, &head);
        let uses = names::occurrences(gcode::Doc { file: &file, dialect }, &Name::Tool(number), None);
        found.extend(uses.into_iter().map(|o| location(&uri, &file, o.span, view)));
    }
    found
}

/// Everywhere that the name under the cursor stands.
pub fn references(mut view: View, at: lsp::Position, declaration: bool) -> Answer<Vec<lsp::Location>> {
    let offset = view.offset(at);
    let wanted = |o: &gr_ide::Occurrence| declaration || o.role != Role::Definition;
    if matches!(view.kind, Kind::Tools) {
        return Ok(uses_of_tool(&view, offset, declaration));
    }
    match everywhere(&mut view, offset)? {
        Target::None => Ok(Vec::new()),
        Target::Instance(_, spans) => {
            let own = |o: gr_ide::Occurrence| lsp::Location { uri: view.uri.clone(), range: view.range(o.span) };
            Ok(spans.into_iter().filter(wanted).map(own).collect())
        }
        Target::Name(named) => {
            let mut found = Vec::new();
            for (i, spans) in named.places {
                let (uri, text) = (&named.reach.files[i].uri, Text::new(&named.reach.text(i)));
                found.extend(spans.into_iter().filter(wanted).map(|o| lsp::Location { uri: uri.clone(), range: text.range(o.span, view.columns) }));
            }
            Ok(found)
        }
    }
}

/// What stands under the cursor.
enum Target {
    None,
    Instance(u64, Vec<gr_ide::Occurrence>),
    Name(Named),
}

/// A name of programs.
struct Named {
    name: Name,
    /// Where it was asked for.
    line: Option<u32>,
    /// Of a subroutine: where it is.
    home: Home,
    /// Where it stands, by file.
    places: Vec<(usize, Vec<gr_ide::Occurrence>)>,
    reach: Reach,
}

fn everywhere(view: &mut View, offset: u32) -> Answer<Target> {
    if matches!(view.kind, Kind::Exchange) {
        let exchange = view.exchange();
        let doc = exchange_doc(&exchange);
        let Some((id, _)) = p21::names::name_at(doc, offset) else { return Ok(Target::None) };
        return Ok(Target::Instance(id, p21::names::occurrences(doc, id)));
    }
    let Some(reach) = Reach::of(view)? else { return Ok(Target::None) };
    let doc = reach.doc(0);
    let Some((name, _)) = names::name_at(doc, offset) else { return Ok(Target::None) };
    let line = doc.line_at(offset).map(|l| l.line);
    let own = || vec![(0, names::occurrences(doc, &name, line))];
    let (home, places) = match &name {
        Name::Sub(label) => match reach.home(label, offset) {
            Home::File(home) => (Home::File(home), reach.of_sub(home, label)),
            other => (other, own()),
        },
        Name::Parameter(p) if !names::is_local(p) => {
            let of = |i: usize| (i, names::occurrences(reach.doc(i), &name, None));
            (Home::Nowhere, reach.connected(0).into_iter().map(of).filter(|f| !f.1.is_empty()).collect())
        }
        _ => (Home::Nowhere, own()),
    };
    Ok(Target::Name(Named { name, line, home, places, reach }))
}

/// The name that would be renamed.
pub fn prepare_rename(mut view: View, at: lsp::Position) -> Answer<Option<lsp::PrepareRenameResponse>> {
    let offset = view.offset(at);
    let span = if matches!(view.kind, Kind::Exchange) {
        p21::names::name_at(exchange_doc(&view.exchange()), offset).map(|f| f.1)
    } else {
        let Some(tables) = view.program()? else { return Ok(None) };
        let found = names::name_at(doc(&tables), offset);
        if let Some(why) = found.as_ref().and_then(|(name, _)| names::fixed(name)) {
            return Err(Failure::Refused(why));
        }
        found.map(|f| f.1)
    };
    let range = |s: Span| view.range(super::with(s, offset));
    Ok(span.map(|s| lsp::PrepareRenameResponse::RangeWithPlaceholder { range: range(s), placeholder: view.text.slice(s) }))
}

/// Renames in all files. `moves_files`: the client can rename a file together with what it calls.
pub fn rename(mut view: View, at: lsp::Position, new: &str, moves_files: bool) -> Answer<Option<lsp::WorkspaceEdit>> {
    let offset = view.offset(at);
    match everywhere(&mut view, offset)? {
        Target::None => Ok(None),
        Target::Instance(id, spans) => {
            let exchange = view.exchange();
            p21::names::rename(exchange_doc(&exchange), id, new).map_err(Failure::Refused)?;
            let new = format!("#{}", new.trim().trim_start_matches('#'));
            let edits = spans.into_iter().map(|o| lsp::TextEdit { range: view.range(o.span), new_text: new.clone() }).collect();
            Ok(Some(lsp::WorkspaceEdit { changes: Some(HashMap::from([(view.uri.clone(), edits)])), ..lsp::WorkspaceEdit::default() }))
        }
        Target::Name(named) => rename_name(&view, &named, new, moves_files).map_err(Failure::Refused).map(Some),
    }
}

/// Renames what can be shown to mean the same afterwards. `Err` says why it can't.
fn rename_name(view: &View, named: &Named, new: &str, moves_files: bool) -> Result<lsp::WorkspaceEdit, String> {
    let Named { name, line, places, reach, .. } = named;
    let new = names::check_new_name(name, new)?;
    if names::renamed(name, &new) == *name {
        return Err(format!("it is called {new} already"));
    }
    let inside = |i: usize| i == 0 || view.others.iter().any(|o| o.path == reach.files[i].path) || view.workspace.folders().iter().any(|f| reach.files[i].path.starts_with(f));
    let concerned: Vec<usize> = match name {
        Name::Parameter(p) if !names::is_local(p) => reach.connected(0).into_iter().collect(),
        _ => places.iter().map(|p| p.0).collect(),
    };
    for i in concerned.iter().copied() {
        if !inside(i) && places.iter().any(|p| p.0 == i) {
            return Err(format!("{} lies outside of the open folders", reach.name(i)));
        }
        let line = line.filter(|_| i == 0);
        let in_file = |why: String| if i == 0 { why } else { format!("{}: {why}", reach.name(i)) };
        if let Some(why) = names::objection(reach.doc(i), name, line) {
            return Err(in_file(why));
        }
        if names::is_taken(reach.doc(i), name, line, &new) {
            return Err(in_file(format!("{new} is taken already")));
        }
    }
    let moved = match name {
        Name::Sub(label) => sub_moves(view, named, label, &new, moves_files)?,
        Name::Parameter(p) if !names::is_local(p) => shared(view, named, p, &concerned, &new).map_or(Ok(None), Err)?,
        Name::Line(n) => jumped_to(reach, *n).map_or(Ok(None), Err)?,
        _ => None,
    };
    let edited: BTreeMap<usize, String> = places.iter().map(|(i, spans)| (*i, replaced(reach.text(*i), spans, |s| names::spelled(name, reach.dialect, s, &new)))).collect();
    reach.prove(view, &edited, moved.as_ref().map(|m| (m.0, m.1.as_path())))?;
    Ok(edit_of(view, named, &new, moved))
}

/// A text with other names in it.
fn replaced(mut text: String, spans: &[gr_ide::Occurrence], new: impl Fn(gr_text::Span) -> String) -> String {
    for o in spans.iter().rev() {
        text.replace_range(o.span.range(), &new(o.span));
    }
    text
}

/// The file that has to be called like its subroutine, and its new name. `Err`: there would be another subroutine of that
/// name, or it can't be told who calls this one.
fn sub_moves(view: &View, named: &Named, label: &Label, new: &str, moves_files: bool) -> Result<Option<(usize, PathBuf)>, String> {
    let reach = &named.reach;
    let home = match named.home {
        Home::File(home) => home,
        Home::Unclear => return Err("it depends on the way of execution which of two subroutines this is".into()),
        Home::Nowhere => return Err("no file has this subroutine".into()),
    };
    let callers: Vec<usize> = (0..reach.files.len()).filter(|i| named.places.iter().any(|p| p.0 == *i)).collect();
    let unclear = |i: &usize| reach.files[*i].calls.iter().any(|c| c.0.label == *label && (c.1 == Home::Unclear || c.1 == Home::Nowhere));
    if let Some(i) = reach.connected(home).iter().find(|i| unclear(i)) {
        return Err(format!("a call in {} may mean this subroutine or another one", reach.name(*i)));
    }
    let mentioned = |remap: &String| remap.split_whitespace().any(|w| w.to_ascii_lowercase().ends_with(&format!("={}", file_name(label))));
    if view.station.setup.ini.all("rs274ngc", "remap").iter().any(mentioned) {
        return Err("the INI file remaps a code to it".into());
    }
    let Name::Sub(other) = names::renamed(&named.name, new) else { return Ok(None) };
    if let Some(why) = reach.sub_taken(view, &callers, &other) {
        return Err(why);
    }
    let path = &reach.files[home].path;
    let named_so = path.file_stem().is_some_and(|s| s.to_string_lossy() == *file_name(label)) && path.extension().is_some_and(|e| e == "ngc");
    if !named_so {
        return Ok(None);
    }
    if !moves_files {
        return Err(format!("{} would have to be renamed too, and this editor does not do that", reach.name(home)));
    }
    Ok(Some((home, path.with_file_name(format!("{}.ngc", file_name(&other))))))
}

/// Why a parameter that all subroutines know can't have this name.
fn shared(view: &View, named: &Named, p: &Parameter, concerned: &[usize], new: &str) -> Option<String> {
    let reach = &named.reach;
    let setup = &view.station.setup;
    if !setup.ini.all("rs274ngc", "remap").is_empty() {
        return Some("codes that the INI file remaps may use it".into());
    }
    let kept = |p: &Parameter| matches!(p, Parameter::Number(n) if setup.params.contains_key(n));
    if let Name::Parameter(other) = names::renamed(&named.name, new)
        && (kept(p) || kept(&other))
    {
        return Some("the parameter file keeps it from one program to the next".into());
    }
    if let Some(i) = concerned.iter().find(|i| names::calls_by_value(reach.doc(**i))) {
        return Some(format!("a subroutine whose number {} computes may use it", reach.name(*i)));
    }
    // A program of its own that sets it before it reads it does not depend on this one.
    let relies = |i: &usize| names::occurrences(reach.doc(*i), &named.name, None).first().is_some_and(|o| o.role != Role::Write);
    let other = (0..reach.files.len()).filter(|i| !concerned.contains(i)).find(relies)?;
    Some(format!("{} reads it too, and may rely on what this program sets", reach.name(other)))
}

/// Why a line can't have another number: `M99 P` of a subprogram goes to lines of the program that calls it.
fn jumped_to(reach: &Reach, n: i64) -> Option<String> {
    let mut others = reach.connected(0).into_iter().filter(|i| *i != 0);
    let found = others.find(|i| names::occurrences(reach.doc(*i), &Name::Line(n), None).iter().any(|o| o.role == Role::Read))?;
    Some(format!("{} may jump to it", reach.name(found)))
}

/// The edit in the words of the protocol: file operations need the longer form.
fn edit_of(view: &View, named: &Named, new: &str, moved: Option<(usize, PathBuf)>) -> lsp::WorkspaceEdit {
    let edits = |i: usize, spans: &[gr_ide::Occurrence]| -> Vec<lsp::TextEdit> {
        let text = Text::new(&named.reach.text(i));
        let new_text = |o: &gr_ide::Occurrence| names::spelled(&named.name, named.reach.dialect, o.span, new);
        spans.iter().map(|o| lsp::TextEdit { range: text.range(o.span, view.columns), new_text: new_text(o) }).collect()
    };
    let of = |(i, spans): &(usize, Vec<gr_ide::Occurrence>)| (named.reach.files[*i].uri.clone(), edits(*i, spans));
    let all = named.places.iter().map(of);
    let Some((home, new_uri)) = moved.and_then(|(home, to)| Some((home, lsp::Uri::from_file_path(&to)?))) else {
        return lsp::WorkspaceEdit { changes: Some(all.collect()), ..lsp::WorkspaceEdit::default() };
    };
    let edit = |(uri, edits): (lsp::Uri, Vec<lsp::TextEdit>)| {
        let text_document = lsp::OptionalVersionedTextDocumentIdentifier { uri, version: None };
        lsp::DocumentChangeOperation::Edit(lsp::TextDocumentEdit { text_document, edits: edits.into_iter().map(lsp::OneOf::Left).collect() })
    };
    let old_uri = named.reach.files[home].uri.clone();
    let rename = lsp::ResourceOp::Rename(lsp::RenameFile { old_uri, new_uri, options: None, annotation_id: None });
    let operations = all.map(edit).chain(std::iter::once(lsp::DocumentChangeOperation::Op(rename))).collect();
    lsp::WorkspaceEdit { document_changes: Some(lsp::DocumentChanges::Operations(operations)), ..lsp::WorkspaceEdit::default() }
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
    let Some(reach) = Reach::of(&mut view)? else { return Ok(Vec::new()) };
    let doc = reach.doc(0);
    let (label, home) = match names::name_at(doc, offset) {
        Some((Name::Sub(label), _)) => {
            let home = reach.home(&label, offset);
            (Some(label), home)
        }
        _ => {
            let line = doc.line_at(offset).map_or(0, |l| l.line);
            (reach.files[0].subs.iter().find(|s| (s.first..=s.last).contains(&line)).map(|s| s.label.clone()), Home::File(0))
        }
    };
    let Some(label) = label else { return Ok(vec![main_item(&view, &view.uri, &view.text)]) };
    let Home::File(home) = home else { return Ok(Vec::new()) };
    let item = |sub: &names::Sub| sub_item(&view, &reach.files[home].uri, &reach.files[home].file, &Text::new(&reach.text(home)), sub);
    Ok(reach.sub(home, &label).map(item).into_iter().collect())
}

fn label_of(name: &str) -> Option<Label> {
    let bare = name.strip_prefix('o')?;
    if let Some(named) = bare.strip_prefix('<').and_then(|n| n.strip_suffix('>')) {
        return Some(Label::Named(named.into()));
    }
    bare.parse().ok().map(Label::Number)
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
    let (Some(label), Some(reach)) = (label_of(&of.name), Reach::of(&mut view)?) else { return Ok(Vec::new()) };
    let Some(home) = reach.find(&of.uri) else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for (i, file) in reach.files.iter().enumerate() {
        let calls: Vec<&names::CallSite> = file.calls.iter().filter(|c| c.0.label == label && c.1 == Home::File(home)).map(|c| &c.0).collect();
        if calls.is_empty() {
            continue;
        }
        let text = Text::new(&reach.text(i));
        let places: BTreeSet<Option<usize>> = calls.iter().map(|c| c.from).collect();
        for place in places {
            let from = match place.and_then(|p| file.subs.get(p)) {
                Some(sub) => sub_item(&view, &file.uri, &file.file, &text, sub),
                None => main_item(&view, &file.uri, &text),
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
    let Some(reach) = Reach::of(&mut view)? else { return Ok(Vec::new()) };
    let wanted = label_of(&of.name);
    let mut found: Vec<lsp::CallHierarchyOutgoingCall> = Vec::new();
    let Some(at) = reach.find(&of.uri) else { return Ok(found) };
    let text = Text::new(&reach.text(at));
    let from = wanted.and_then(|l| reach.files[at].subs.iter().position(|s| s.label == l));
    for (call, home) in reach.files[at].calls.iter().filter(|c| c.0.from == from) {
        let Home::File(home) = *home else { continue };
        let (range, file) = (text.range(call.span, view.columns), &reach.files[home]);
        let name = names::label_text(&call.label);
        if let Some(known) = found.iter_mut().find(|f| f.to.name == name && f.to.uri == file.uri) {
            known.from_ranges.push(range);
            continue;
        }
        if let Some(sub) = reach.sub(home, &call.label) {
            let to = sub_item(&view, &file.uri, &file.file, &Text::new(&reach.text(home)), sub);
            found.push(lsp::CallHierarchyOutgoingCall { to, from_ranges: vec![range] });
        }
    }
    Ok(found)
}

/// Labels that calls in other files name, of subroutines in this one.
pub(super) fn calls_elsewhere(view: &View, tables: &(std::sync::Arc<gr_gcode::File>, &'static gr_spec::Dialect)) -> Vec<String> {
    let reach = Reach::with(view, tables.clone());
    let calls = reach.files.iter().skip(1).flat_map(|f| &f.calls).filter(|c| c.1 == Home::File(0));
    calls.map(|c| names::label_text(&c.0.label)).collect()
}
