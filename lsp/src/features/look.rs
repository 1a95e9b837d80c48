//! Reading: hover, hints, symbols, folding, selection, tokens, lenses, links.

use std::sync::Arc;

use gr_driver::Traced;
use gr_gcode::Parameter;
use gr_ide::gcode::hints::Ran;
use gr_ide::gcode::hover::{Facts, Run};
use gr_ide::gcode::names;
use gr_ide::{Hint, HintKind, Item, Lens, Token, config, gcode, p21};
use gr_ir::Source;
use gr_robot::along::PathPoint;
use gr_text::Span;
use tower_lsp::ls_types as lsp;

use super::{Answer, MOST_BLOCKS, MOST_BLOCKS_VISIBLE, doc, exchange_doc, exchange_in_units};
use crate::documents::{Kind, Motion, Pace, View};
use crate::protocol::{TOKEN_TYPES, markdown, symbol, symbol_kind, token_type};
use crate::text::Text;

/// What stands under the cursor.
pub fn hover(mut view: View, at: lsp::Position) -> Answer<Option<lsp::Hover>> {
    let offset = view.offset(at);
    let found = match view.kind {
        Kind::Gcode(..) => gcode_hover(&mut view, offset)?,
        Kind::Exchange => p21::hover::hover(exchange_in_units(&view, &view.exchange()), offset),
        Kind::Config(schema) => config::hover(schema, &view.text.to_string(), offset),
        Kind::Tools => config::tools::hover(&view.text.to_string(), offset, view.station.setup.machine_units),
        Kind::Ini => config::linuxcnc::ini_hover(&view.text.to_string(), offset),
        Kind::Vars => config::linuxcnc::vars_hover(&view.text.to_string(), offset),
        Kind::Other => None,
    };
    Ok(found.map(|h| lsp::Hover { contents: lsp::HoverContents::Markup(markdown(h.text)), range: Some(view.range(super::with(h.span, offset))) }))
}

/// One block as it is run, with the values of some parameters.
pub(super) fn trace_line(view: &View, line: u32, wanted: &[Parameter]) -> Answer<Option<Traced>> {
    let Some((session, file, dialect)) = view.session() else { return Ok(None) };
    if dialect.family == gr_spec::Family::Ufmg2008 {
        return Ok(None);
    }
    let Some(mut traced) = session.trace(file, line..line + 1, wanted, MOST_BLOCKS)?.into_iter().next() else { return Ok(None) };
    // A call's block is over when its subroutine is: the state then is that of before the next line.
    let tables = (session.file(file)?, dialect);
    let doc = doc(&tables);
    let may_call = |l: gcode::doc::LineOf<'_>| l.has_code(b'm', 980) || l.has_code(b'g', 650) || l.words().iter().any(|w| w.form == gr_gcode::Form::Control);
    if doc.line(line).is_some_and(may_call)
        && names::calls(doc).iter().any(|c| c.line == line)
        && let Some(next) = session.state_at(file, line + 1)?
    {
        traced.after = next.before;
    }
    Ok(Some(traced))
}

fn gcode_hover(view: &mut View, offset: u32) -> Answer<Option<gr_ide::Hover>> {
    let Some((session, file, dialect)) = view.session() else { return Ok(None) };
    let tables = (session.file(file)?, dialect);
    let doc = doc(&tables);
    let parameter = gcode::hover::parameter_at(doc, offset);
    let wanted: Vec<Parameter> = parameter.iter().cloned().collect();
    let Some(line) = doc.line_at(offset) else { return Ok(None) };
    let traced = trace_line(view, line.line, &wanted)?;
    let moves = traced.as_ref().is_some_and(|t| t.program.steps().any(|s| s.op.moves()));
    let motion = if moves && view.station.machine.is_some() { view.motion()? } else { None };
    let written = match parameter.as_ref().and_then(|p| names::last_write(doc, p, line.line)) {
        Some(w) if w.certain => Some(w.line),
        // The only setting of the program: was it carried out, and is the value its own?
        Some(w) => trace_line(view, w.line, &wanted)?.filter(|set| traced.as_ref().is_some_and(|t| t.values == set.values_after)).map(|_| w.line),
        None => None,
    };
    let written = written.and_then(|l| doc.line(l)).map(|l| (l.line, l.text()));
    let pace = view.pace()?;
    view.release();
    let run = traced.map(|t| run_of(view, t, &pace, motion.as_deref(), parameter.is_some()));
    let setup = &view.station.setup;
    let facts = Facts { run: run.as_ref(), tools: Some((&setup.tools, setup.machine_units)), last_write: written, repeats: repeats(doc, line.line) };
    Ok(gcode::hover::hover(doc, offset, facts))
}

/// Whether a line stands in a subroutine or a loop.
fn repeats(doc: gcode::Doc<'_>, line: u32) -> bool {
    let controls = doc.file.chunks.iter().any(|c| !c.scan.controls.is_empty());
    controls && gcode::outline::loops(doc).iter().any(|f| f.contains(&line))
}

fn run_of(view: &View, t: Traced, pace: &Pace, motion: Option<&Motion>, valued: bool) -> Run {
    let value = valued.then(|| (t.values.first().copied().flatten(), t.values_after.first().copied().flatten()));
    let joints = motion.and_then(|m| joints(view, &t, m)).unwrap_or_default();
    let seconds = pace.seconds(&t);
    Run { before: t.before, after: t.after, program: t.program, value, cycle: t.cycle, seconds, joints }
}

/// Joint values of the chosen machine at the end of a block, in words: those that a build would have, or why they are
/// not known.
fn joints(view: &View, t: &Traced, motion: &Motion) -> Option<String> {
    let machine = view.station.machine.as_ref()?;
    let shown = |q: &[f64]| crate::machine::show(machine, q).join(", ");
    if !gr_robot::along::is_planned(machine) {
        let place = t.program.steps().filter(|s| s.op.moves()).last()?.end.xyz();
        let point = PathPoint { place: place.map(|v| v as f32), source: Source::default(), joined: false, rapid: false };
        let found = gr_robot::along::nearest(machine, &[point]).into_iter().next().flatten()?;
        return Some(format!("joints at the end (of several solutions the nearest): {}", shown(&found.joints)));
    }
    if view.text.len() > super::MOST_FOR_A_ROBOT {
        return Some(format!("joints: not known, {}", super::TOO_LARGE));
    }
    if !view.plans_quickly(motion) {
        return Some("joints: still being worked out".into());
    }
    let planning = view.planning(motion)?;
    Some(match &*planning {
        Ok(planned) => format!("joints at the end: {}", shown(&gr_robot::along::at_line(&planned.program, motion.main, t.line)?)),
        Err(found) => format!("joints: not known, {}", crate::machine::reason(found)),
    })
}

/// Remarks inside of the visible text.
pub fn hints(mut view: View, range: lsp::Range) -> Answer<Vec<lsp::InlayHint>> {
    let kinds = view.settings.hints.kinds();
    let span = Span::new(view.offset(range.start), view.offset(range.end));
    let found = match view.kind {
        Kind::Gcode(..) => {
            let Some((session, file, dialect)) = view.session() else { return Ok(Vec::new()) };
            if dialect.family == gr_spec::Family::Ufmg2008 {
                return Ok(Vec::new());
            }
            let tables = (session.file(file)?, dialect);
            let lines = range.start.line..range.end.line.saturating_add(1).min(range.start.line + 2_000);
            let traced = session.trace(file, lines, &[], MOST_BLOCKS_VISIBLE)?;
            let pace = if kinds.time { view.pace()? } else { Pace::Unknown };
            view.release();
            let ran = |t| -> Ran<'_> {
                let t: &Traced = t;
                Ran { line: t.line, before: &t.before, after: &t.after, program: &t.program, seconds: pace.seconds(t) }
            };
            let ran: Vec<Ran<'_>> = traced.iter().map(ran).collect();
            gcode::hints::hints(doc(&tables), &ran, &kinds)
        }
        Kind::Exchange if kinds.attributes => p21::hints::hints(exchange_in_units(&view, &view.exchange()), span),
        _ => Vec::new(),
    };
    Ok(found.into_iter().filter(|h| span.start <= h.at && h.at <= span.end).map(|h| hint(&view, h)).collect())
}

fn hint(view: &View, h: Hint) -> lsp::InlayHint {
    let before = matches!(h.kind, HintKind::Motion | HintKind::Attribute);
    lsp::InlayHint {
        position: view.text.position(h.at, view.columns),
        label: lsp::InlayHintLabel::String(h.text),
        kind: Some(if before { lsp::InlayHintKind::PARAMETER } else { lsp::InlayHintKind::TYPE }),
        text_edits: None,
        tooltip: (!h.tooltip.is_empty()).then(|| lsp::InlayHintTooltip::MarkupContent(markdown(h.tooltip))),
        padding_left: Some(!before),
        padding_right: Some(h.kind == HintKind::Attribute),
        data: None,
    }
}

/// The outline.
pub fn symbols(mut view: View) -> Answer<Vec<lsp::DocumentSymbol>> {
    let items = outline(&mut view)?;
    Ok(items.iter().map(|i| symbol(i, &view.text, view.columns)).collect())
}

fn outline(view: &mut View) -> Answer<Vec<Item>> {
    Ok(match view.kind {
        Kind::Gcode(..) => view.program()?.map(|t| gcode::outline::outline(doc(&t))).unwrap_or_default(),
        Kind::Exchange => p21::outline::outline(exchange_doc(&view.exchange())),
        Kind::Config(_) => config::outline(&view.text.to_string()),
        Kind::Tools => config::tools::outline(&view.text.to_string()),
        Kind::Ini => config::linuxcnc::ini_outline(&view.text.to_string()),
        Kind::Vars | Kind::Other => Vec::new(),
    })
}

/// Symbols of a workspace that are listed.
const MOST_SYMBOLS: usize = 500;

/// Subroutines, tools and operations of all programs whose name has all letters of the query in order.
pub fn workspace_symbols(view: &crate::server::Everything, query: &str) -> Vec<lsp::WorkspaceSymbol> {
    let mut found = Vec::new();
    let query = query.to_lowercase();
    let fits = |name: &str| {
        let mut letters = query.chars().filter(|c| !c.is_whitespace()).peekable();
        name.to_lowercase().chars().for_each(|c| {
            letters.next_if_eq(&c);
        });
        letters.peek().is_none()
    };
    for (uri, text, items) in view.outlines() {
        let mut open: Vec<(&Item, String)> = items.iter().map(|i| (i, String::new())).collect();
        open.reverse();
        // A statement of an exchange file stands in the outline of every plan that it is part of.
        let mut seen = std::collections::BTreeSet::new();
        while let Some((item, container)) = open.pop() {
            if found.len() >= MOST_SYMBOLS {
                return found;
            }
            if fits(&item.name) && seen.insert(item.span) {
                let location = lsp::Location { uri: uri.clone(), range: text.range(item.span, view.columns) };
                found.push(lsp::WorkspaceSymbol {
                    name: item.name.clone(),
                    kind: symbol_kind(item.kind),
                    tags: None,
                    container_name: (!container.is_empty()).then(|| container.clone()),
                    location: lsp::OneOf::Left(location),
                    data: None,
                });
            }
            open.extend(item.children.iter().rev().map(|c| (c, item.name.clone())));
        }
    }
    found
}

/// What can be folded.
pub fn folds(mut view: View) -> Answer<Vec<lsp::FoldingRange>> {
    let found = match view.kind {
        Kind::Gcode(..) => view.program()?.map(|t| gcode::outline::folds(doc(&t))).unwrap_or_default(),
        Kind::Exchange => {
            let exchange = view.exchange();
            p21::outline::folds(exchange_doc(&exchange), &exchange.lines)
        }
        Kind::Config(_) => config::folds(&view.text.to_string()),
        Kind::Ini => config::linuxcnc::ini_folds(&view.text.to_string()),
        _ => Vec::new(),
    };
    let range = |f: gr_ide::Fold| lsp::FoldingRange {
        start_line: f.first,
        end_line: f.last,
        kind: f.comment.then_some(lsp::FoldingRangeKind::Comment),
        ..lsp::FoldingRange::default()
    };
    Ok(found.into_iter().map(range).collect())
}

/// What the selection grows over, for each position.
pub fn selections(mut view: View, at: &[lsp::Position]) -> Answer<Vec<lsp::SelectionRange>> {
    let offsets: Vec<u32> = at.iter().map(|p| view.offset(*p)).collect();
    let spans: Vec<Vec<Span>> = match view.kind {
        Kind::Gcode(..) => match view.program()? {
            Some(t) => offsets.iter().map(|o| gcode::outline::selections(doc(&t), *o)).collect(),
            None => vec![Vec::new(); at.len()],
        },
        Kind::Exchange => {
            let exchange = view.exchange();
            offsets.iter().map(|o| p21::lenses::selections(exchange_doc(&exchange), *o)).collect()
        }
        _ => vec![Vec::new(); at.len()],
    };
    Ok(spans.into_iter().zip(at).map(|(spans, at)| chain(&view, &spans, *at)).collect())
}

fn chain(view: &View, spans: &[Span], at: lsp::Position) -> lsp::SelectionRange {
    let mut parent = None;
    for span in spans.iter().rev() {
        parent = Some(Box::new(lsp::SelectionRange { range: view.range(*span), parent }));
    }
    parent.map_or(lsp::SelectionRange { range: lsp::Range { start: at, end: at }, parent: None }, |p| *p)
}

/// Tokens of a whole document or some of its lines.
pub fn tokens(mut view: View, range: Option<lsp::Range>) -> Answer<(View, Arc<Vec<lsp::SemanticToken>>)> {
    let span = range.map_or(Span::new(0, view.text.len()), |r| Span::new(view.offset(r.start), view.offset(r.end)));
    let found: Vec<Token> = match view.kind {
        Kind::Gcode(..) => match view.program()? {
            Some(t) => {
                let lines = range.map_or(0..u32::MAX, |r| r.start.line..r.end.line.saturating_add(1));
                gcode::tokens::tokens(doc(&t), lines)
            }
            None => Vec::new(),
        },
        Kind::Exchange => p21::outline::tokens(exchange_doc(&view.exchange()), span),
        _ => Vec::new(),
    };
    let encoded = Arc::new(encode(&view, &found));
    Ok((view, encoded))
}

/// Each token relative to the one before; those that span lines are left out.
fn encode(view: &View, tokens: &[Token]) -> Vec<lsp::SemanticToken> {
    let mut out = Vec::with_capacity(tokens.len());
    let (mut line, mut column) = (0, 0);
    let mut cursor = Cursor::new(&view.text, view.columns, tokens.first().map_or(0, |t| t.span.start));
    for t in tokens {
        let start = cursor.position(t.span.start);
        let end = cursor.position(t.span.end);
        if start.line != end.line || start.character >= end.character || (start.line, start.character) < (line, column) {
            continue;
        }
        let delta_line = start.line - line;
        let delta_start = if delta_line == 0 { start.character - column } else { start.character };
        (line, column) = (start.line, start.character);
        out.push(lsp::SemanticToken {
            delta_line,
            delta_start,
            length: end.character - start.character,
            token_type: token_type(t.kind),
            token_modifiers_bitset: u32::from(t.modifiers),
        });
    }
    out
}

/// Positions of rising offsets without a search for each: lines are walked over once.
struct Cursor<'t> {
    text: &'t Text,
    columns: crate::text::Columns,
    pieces: Vec<(u32, &'t str)>,
    /// The piece that the line is in; lines lie in one piece each.
    piece: usize,
    line: u32,
    start: u32,
    next: u32,
    ascii: bool,
}

impl<'t> Cursor<'t> {
    /// Begins at the line of a byte.
    fn new(text: &'t Text, columns: crate::text::Columns, first: u32) -> Cursor<'t> {
        let pieces: Vec<(u32, &'t str)> = text.pieces().collect();
        let line = text.position(first, columns).line;
        let start = text.line_start(line);
        let piece = pieces.partition_point(|p| p.0 <= start).saturating_sub(1);
        let mut cursor = Cursor { text, columns, pieces, piece, line, start, next: 0, ascii: false };
        cursor.measure();
        cursor
    }
    /// The line's text from its first byte to the end of its piece.
    fn rest(&self) -> &'t str {
        self.pieces.get(self.piece).and_then(|(base, text)| text.get((self.start - base) as usize..)).unwrap_or("")
    }
    /// Finds the end of the line that begins at `start`.
    fn measure(&mut self) {
        let bytes = self.rest().as_bytes();
        let end = memchr::memchr2(b'\n', b'\r', bytes).map(|at| if bytes[at] == b'\r' && bytes.get(at + 1) == Some(&b'\n') { at + 2 } else { at + 1 });
        self.next = end.map_or(u32::MAX, |e| self.start + e as u32);
        self.ascii = bytes[..end.unwrap_or(bytes.len())].is_ascii();
    }
    fn position(&mut self, offset: u32) -> lsp::Position {
        if offset < self.start || offset > self.text.len() {
            return self.text.position(offset, self.columns);
        }
        while offset >= self.next {
            (self.line, self.start) = (self.line + 1, self.next);
            while self.pieces.get(self.piece + 1).is_some_and(|(base, _)| *base <= self.start) {
                self.piece += 1;
            }
            self.measure();
        }
        if self.ascii || self.columns == crate::text::Columns::Utf8 {
            return lsp::Position { line: self.line, character: offset - self.start };
        }
        let before = self.rest().get(..(offset - self.start) as usize);
        before.map_or_else(|| self.text.position(offset, self.columns), |b| lsp::Position { line: self.line, character: b.encode_utf16().count() as u32 })
    }
}

/// What the client needs to know about tokens.
pub fn legend() -> lsp::SemanticTokensLegend {
    lsp::SemanticTokensLegend {
        token_types: TOKEN_TYPES.iter().map(|t| lsp::SemanticTokenType::new(t)).collect(),
        token_modifiers: gr_ide::TOKEN_MODIFIERS.iter().map(|t| lsp::SemanticTokenModifier::new(t)).collect(),
    }
}

/// The edits that make new tokens of old ones: what lies between the equal ends.
pub fn delta(old: &[lsp::SemanticToken], new: &[lsp::SemanticToken]) -> Vec<lsp::SemanticTokensEdit> {
    let head = old.iter().zip(new).take_while(|(a, b)| a == b).count();
    let tail = old[head..].iter().rev().zip(new[head..].iter().rev()).take_while(|(a, b)| a == b).count();
    if head == old.len() && head == new.len() {
        return Vec::new();
    }
    // Counted in numbers: a token is five.
    vec![lsp::SemanticTokensEdit {
        start: head as u32 * 5,
        delete_count: (old.len() - head - tail) as u32 * 5,
        data: Some(new[head..new.len() - tail].to_vec()),
    }]
}

/// Remarks above lines.
pub fn lenses(mut view: View) -> Answer<Vec<lsp::CodeLens>> {
    if view.is_overtaken() {
        return Err(super::Failure::Overtaken);
    }
    let found: Vec<Lens> = match view.kind {
        Kind::Gcode(..) => {
            let motion = view.motion()?;
            let report = motion.as_ref().map(|m| view.report(m)).transpose()?;
            let Some(tables) = view.program()? else { return Ok(Vec::new()) };
            let doc = doc(&tables);
            let subs = names::subs(doc);
            let elsewhere = if subs.is_empty() { Vec::new() } else { super::names::calls_elsewhere(&view, &tables) };
            let count = |label: &str| elsewhere.iter().filter(|l| *l == label).count();
            let ran = motion.as_ref().zip(report.as_ref()).map(|(m, r)| (&*m.program, m.main, &**r, &m.rates));
            gcode::lenses::lenses(doc, ran, &count)
        }
        Kind::Exchange => {
            let exchange = view.exchange();
            let report = view.motion()?.map(|m| view.report(&m)).transpose()?;
            p21::lenses::lenses(exchange_doc(&exchange), &exchange.lines, report.as_deref())
        }
        _ => Vec::new(),
    };
    let lens = |l: Lens| {
        let at = lsp::Position { line: l.line, character: 0 };
        lsp::CodeLens {
            range: lsp::Range { start: at, end: at },
            command: Some(lsp::Command { title: l.text, command: String::new(), arguments: None }),
            data: None,
        }
    };
    Ok(found.into_iter().map(lens).collect())
}

/// Subroutine files that are called.
pub fn links(mut view: View) -> Answer<Vec<lsp::DocumentLink>> {
    let Some(tables) = view.program()? else { return Ok(Vec::new()) };
    let doc = doc(&tables);
    let own: Vec<_> = names::subs(doc).into_iter().map(|s| s.label).collect();
    let setup = view.station.setup_for(tables.1);
    let mut found = Vec::new();
    for call in names::calls(doc).into_iter().filter(|c| !own.contains(&c.label)).take(2_000) {
        let name = super::names::file_name(&call.label);
        let path = gr_interp::subroutine_paths(&setup, &name).into_iter().chain(super::names::beside(&view, &name)).find(|p| p.is_file() && !view.workspace.strays(p));
        if let Some(path) = path
            && let Some(target) = lsp::Uri::from_file_path(&path)
        {
            found.push(lsp::DocumentLink { range: view.range(call.span), target: Some(target), tooltip: Some(path.display().to_string()), data: None });
        }
    }
    Ok(found)
}

/// Tokens of the whole document with their name, and the edits since `have` when that is what was sent last.
pub fn all_tokens(view: View, have: Option<String>) -> Answer<(String, Arc<Vec<lsp::SemanticToken>>, Option<Vec<lsp::SemanticTokensEdit>>)> {
    let (view, new) = tokens(view, None)?;
    let id = format!("{}", view.version);
    let old = view.swap_tokens(&id, &new);
    let edits = old.filter(|(old_id, _)| have.as_deref() == Some(old_id)).map(|(_, old)| delta(&old, &new));
    Ok((id, new, edits))
}

/// Diagnostics with a name for what they are: the same name means the same diagnostics.
pub fn pulled(view: View) -> Answer<(String, Vec<lsp::Diagnostic>)> {
    use std::hash::{Hash as _, Hasher as _};
    let own = if let Kind::Gcode(file, _) = view.kind { file } else { gr_text::FileId(0) };
    let (text, columns, uri, most) = (view.text.clone(), view.columns, view.uri.clone(), view.settings.most_problems);
    let (found, elsewhere) = super::diagnose(view)?;
    let place = |(file, span): (gr_text::FileId, Span)| {
        if file == own {
            return Some(lsp::Location { uri: uri.clone(), range: text.range(span, columns) });
        }
        let (path, text) = elsewhere.get(&file)?;
        Some(lsp::Location { uri: lsp::Uri::from_file_path(path)?, range: text.range(span, columns) })
    };
    let shown = found.iter().filter_map(|d| crate::protocol::in_document(d, own)).take(most);
    let items: Vec<lsp::Diagnostic> = shown.map(|d| crate::protocol::diagnostic(&d, &text, columns, &place)).collect();
    let mut h = std::collections::hash_map::DefaultHasher::new();
    serde_json::to_string(&items).unwrap_or_default().hash(&mut h);
    Ok((format!("{:016x}", h.finish()), items))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::Cursor;
    use crate::text::{Columns, Text};

    proptest! {
        #[test]
        fn the_cursor_finds_what_a_search_finds(parts in prop::collection::vec(prop::sample::select(vec!["G1 X1", "\n", "\r\n", "\r", "é", "𝄞", " "]), 0..60), utf8 in any::<bool>(), first in 0usize..80) {
            let (plain, columns) = (parts.concat(), if utf8 { Columns::Utf8 } else { Columns::Utf16 });
            let text = Text::new(&plain);
            let first = plain.char_indices().map(|c| c.0).nth(first).unwrap_or(0);
            let mut cursor = Cursor::new(&text, columns, first as u32);
            for (at, _) in plain.char_indices().filter(|c| c.0 >= first) {
                // Between the two characters of a line end is no place of a token.
                if plain.as_bytes().get(at) != Some(&b'\n') || at == 0 || plain.as_bytes()[at - 1] != b'\r' {
                    prop_assert_eq!(cursor.position(at as u32), text.position(at as u32, columns), "{} of {:?}", at, plain);
                }
            }
        }
    }
}
