//! Code actions: what the diagnostics offer, and what can be rewritten here.

use std::collections::HashMap;

use gr_ide::gcode::actions::{Context, write_moves};
use gr_ide::gcode::names;
use gr_ide::{Action, ActionKind, Edit, gcode, p21};
use gr_ir::{FileId, Program};
use gr_text::{Diagnostic, Span, code};
use tower_lsp::ls_types as lsp;

use super::{Answer, Failure, doc, exchange_doc, text_edits};
use crate::documents::{Kind, Motion, Versions, View};
use crate::protocol::{self, action_kind};

/// Whole files above this are rewritten when the action is chosen, not when it is offered, bytes.
const LATER_ABOVE: u32 = 20_000;

/// Actions for a place, of the kinds that are asked for. `resolves`: the client asks again for what an action that it
/// carries out does.
pub fn actions(mut view: View, range: lsp::Range, only: Option<&[lsp::CodeActionKind]>, resolves: bool) -> Answer<Vec<lsp::CodeAction>> {
    let at = Span::new(view.offset(range.start), view.offset(range.end));
    let asked = |kind: &str| only.is_none_or(|o| o.iter().any(|k| kind == k.as_str() || kind.strip_prefix(k.as_str()).is_some_and(|r| r.starts_with('.'))));
    let (fix, source) = (asked("quickfix"), asked("source"));
    let rewrite = asked("refactor.rewrite") || asked("refactor.inline");
    let (mut found, endings) = if fix { fixes(&view, at)? } else { Default::default() };
    let units = if rewrite { units(&view, at, resolves)? } else { None };
    let whole = if source { of_file(&view, resolves, only.is_some())? } else { Vec::new() };
    let (mut more, ending) = match view.kind {
        Kind::Gcode(..) => gcode_actions(&mut view, at, rewrite, source || !endings.is_empty())?,
        Kind::Exchange if fix => (p21::actions::actions(exchange_doc(&view.exchange()), at), None),
        _ => (Vec::new(), None),
    };
    // What a program leaves out at its end is also the cure of what is said about that.
    if let Some(ending) = ending {
        if !endings.is_empty() {
            let mut cure = action(&view, Action { kind: ActionKind::Fix, ..ending.clone() });
            (cure.diagnostics, cure.is_preferred) = (Some(endings), Some(true));
            found.push(cure);
        }
        more.push(ending);
    }
    // What an exchange file lacks is the cure of what is said about the reference there.
    let cured: Vec<lsp::Diagnostic> = match view.kind {
        Kind::Exchange if !more.is_empty() => {
            let there = |d: &&Diagnostic| d.code == code::P21_DANGLING_REFERENCE && d.primary().1.start <= at.start && at.start <= d.primary().1.end;
            view.found.iter().filter(there).map(|d| protocol::diagnostic(d, &view.text, view.columns, &|_| None)).collect()
        }
        _ => Vec::new(),
    };
    let of_place = |a| lsp::CodeAction { diagnostics: (!cured.is_empty()).then(|| cured.clone()), ..action(&view, a) };
    found.extend(more.into_iter().map(of_place));
    found.extend(units);
    found.extend(whole);
    found.retain(|a| a.kind.as_ref().is_none_or(|k| asked(k.as_str())));
    Ok(found)
}

/// The program in the other unit, offered at the line that says the unit.
fn units(view: &View, at: Span, resolves: bool) -> Answer<Option<lsp::CodeAction>> {
    let Some(t) = tables(view)? else { return Ok(None) };
    let Some(line) = doc(&t).line_at(at.start) else { return Ok(None) };
    let Some(title) = gcode::actions::units_title(&line).filter(|_| t.1.family != gr_spec::Family::Ufmg2008) else { return Ok(None) };
    if view.text.len() <= LATER_ABOVE {
        return Ok(converted(view, line.line)?.map(|a| action(view, a)));
    }
    Ok(resolves.then(|| lsp::CodeAction {
        title: title.into(),
        kind: Some(action_kind(ActionKind::Rewrite)),
        data: Some(serde_json::json!({ "uri": view.uri, "line": line.line })),
        ..lsp::CodeAction::default()
    }))
}

fn converted(view: &View, line: u32) -> Answer<Option<Action>> {
    let Some(t) = tables(view)? else { return Ok(None) };
    let traced = super::look::trace_line(view, line, &[])?;
    let Some(of) = doc(&t).line(line) else { return Ok(None) };
    Ok(gcode::actions::convert_units(doc(&t), &of, traced.as_ref().map(|t| &t.before)))
}

/// Rewritings of the whole file: of big ones only their names, when the client asks again for what they do. To a client
/// that does not, they are told where it asks for such.
fn of_file(view: &View, resolves: bool, asked: bool) -> Answer<Vec<lsp::CodeAction>> {
    if view.text.len() <= LATER_ABOVE || (!resolves && asked) {
        return Ok(rewritten(view)?.into_iter().map(|a| action(view, a)).collect());
    }
    let titles: Vec<&str> = match view.kind {
        _ if !resolves => Vec::new(),
        Kind::Gcode(..) => tables(view)?.and_then(|t| gcode::actions::renumber_title(doc(&t))).into_iter().collect(),
        Kind::Exchange => p21::actions::OF_FILE.to_vec(),
        _ => Vec::new(),
    };
    let later = |title: &str| lsp::CodeAction {
        title: title.into(),
        kind: Some(action_kind(ActionKind::Source)),
        data: Some(serde_json::json!({ "uri": view.uri })),
        ..lsp::CodeAction::default()
    };
    Ok(titles.into_iter().map(later).collect())
}

fn rewritten(view: &View) -> Answer<Vec<Action>> {
    Ok(match view.kind {
        Kind::Gcode(_, dialect) if dialect.family == gr_spec::Family::Ufmg2008 => Vec::new(),
        Kind::Gcode(..) => tables(view)?.and_then(|t| gcode::actions::renumber(doc(&t))).into_iter().collect(),
        Kind::Exchange => p21::actions::of_file(exchange_doc(&view.exchange())),
        _ => Vec::new(),
    })
}

/// The program of a view; the database is not released.
fn tables(view: &View) -> Answer<Option<(std::sync::Arc<gr_gcode::File>, &'static gr_spec::Dialect)>> {
    Ok(match view.session() {
        Some((session, file, dialect)) => Some((session.file(file)?, dialect)),
        None => None,
    })
}

/// What an action does that was offered by its name.
pub fn resolve(view: View, mut chosen: lsp::CodeAction) -> Answer<lsp::CodeAction> {
    if let Some(line) = chosen.data.as_ref().and_then(|d| d.get("line")).and_then(serde_json::Value::as_u64) {
        let done = converted(&view, u32::try_from(line).unwrap_or(u32::MAX))?;
        let done = done.ok_or_else(|| Failure::Refused("not every length and feed of this program is a plain number in the one unit".into()))?;
        chosen.edit = action(&view, done).edit;
        return Ok(chosen);
    }
    let found = rewritten(&view)?.into_iter().find(|a| a.title == chosen.title);
    // Nothing to be done is done, too.
    let done = found.unwrap_or(Action { title: String::new(), kind: ActionKind::Source, edits: Vec::new() });
    chosen.edit = action(&view, done).edit;
    Ok(chosen)
}

fn action(view: &View, a: Action) -> lsp::CodeAction {
    let mut changes = HashMap::new();
    changes.insert(view.uri.clone(), text_edits(view, a.edits));
    lsp::CodeAction {
        title: a.title,
        kind: Some(action_kind(a.kind)),
        edit: Some(lsp::WorkspaceEdit { changes: Some(changes), ..lsp::WorkspaceEdit::default() }),
        ..lsp::CodeAction::default()
    }
}

/// Fixes of the diagnostics around a place; and those of them that are about the end of the program.
fn fixes(view: &View, at: Span) -> Answer<(Vec<lsp::CodeAction>, Vec<lsp::Diagnostic>)> {
    let own = if let Kind::Gcode(file, _) = view.kind { file } else { FileId(0) };
    // The diagnostics of the last version are what the client shows, but their places may have moved.
    let found: Vec<Diagnostic> = match view.session() {
        Some((session, file, _)) => session.check(file)?.diagnostics,
        None => view.found.to_vec(),
    };
    let touches = |d: &&Diagnostic| {
        let (file, span) = d.primary();
        let lines = view.range(span);
        let here = view.range(at);
        file == own && lines.start.line <= here.end.line && here.start.line <= lines.end.line
    };
    let (mut out, mut endings) = (Vec::new(), Vec::new());
    for d in found.iter().filter(touches).take(50) {
        if [code::PROGRAM_ENDS_EARLY, code::PROGRAM_END_MISSING, code::END_SPINDLE_ON, code::END_COMPENSATION_ON].contains(&d.code) {
            endings.push(protocol::diagnostic(d, &view.text, view.columns, &|_| None));
        }
        for (n, fix) in d.fixes.iter().enumerate() {
            let edits: Vec<Edit> =
                fix.edits.iter().filter(|(file, ..)| *file == own).map(|(_, span, text)| Edit { span: *span, text: text.clone() }).collect();
            if edits.len() != fix.edits.len() {
                continue;
            }
            let mut a = action(view, Action { title: fix.title.clone(), kind: ActionKind::Fix, edits });
            a.diagnostics = Some(vec![protocol::diagnostic(d, &view.text, view.columns, &|_| None)]);
            // Of several readings none is the one to take unasked.
            a.is_preferred = Some(n == 0 && d.fixes.len() == 1);
            out.push(a);
        }
        if d.fixes.is_empty() {
            out.extend(d.code.def().lint.then(|| allow(view, d)).flatten());
        }
    }
    Ok((out, endings))
}

/// A lint can be switched off for the project.
fn allow(view: &View, d: &Diagnostic) -> Option<lsp::CodeAction> {
    let path = view.station.files.iter().find(|p| p.file_name().is_some_and(|n| n == "gcc-robot.toml"))?;
    let open = view.others.iter().find(|o| o.path == *path);
    let text = match open {
        Some(o) => o.text.to_string(),
        None => crate::workspace::stored(path)?,
    };
    let slug = d.code.def().slug;
    let (at, new) = allowed(&text, slug);
    // `lints = { … }` and `lints.strict = …` can't be followed by a table of that name.
    let after = format!("{}{new}{}", text.get(..at)?, text.get(at..)?);
    if view.host.check_project(path, &after).iter().any(|d| d.code == code::PROJECT_SYNTAX) {
        return None;
    }
    let place = crate::text::Text::new(&text).range(Span::new(at as u32, at as u32), view.columns);
    let mut changes = HashMap::new();
    changes.insert(lsp::Uri::from_file_path(path)?, vec![lsp::TextEdit { range: place, new_text: new }]);
    Some(lsp::CodeAction {
        title: format!("Never mention {slug} in this project"),
        kind: Some(lsp::CodeActionKind::QUICKFIX),
        edit: Some(lsp::WorkspaceEdit { changes: Some(changes), ..lsp::WorkspaceEdit::default() }),
        ..lsp::CodeAction::default()
    })
}

/// Where a project file gets one more lint to allow, and what is written there.
fn allowed(text: &str, slug: &str) -> (usize, String) {
    let (mut at, mut section, mut inside) = (0, None, false);
    for line in text.split_inclusive('\n') {
        let (start, bare) = (at, line.trim());
        at += line.len();
        if bare.starts_with('[') {
            inside = bare.split('#').next().is_some_and(|t| t.trim() == "[lints]");
            if inside {
                section = Some(start + line.trim_end().len());
            }
        } else if let (true, Some(rest)) = (inside, bare.strip_prefix("allow"))
            && let Some(list) = rest.trim_start().strip_prefix('=').and_then(|v| v.trim_start().strip_prefix('['))
        {
            let first = start + line.trim_end().len() - list.len();
            let comma = if list.trim_start().starts_with(']') { "" } else { ", " };
            return (first, format!("\"{slug}\"{comma}"));
        }
    }
    match section {
        Some(end) => (end, format!("\nallow = [\"{slug}\"]")),
        None => (text.len(), format!("\n[lints]\nallow = [\"{slug}\"]\n")),
    }
}

/// Rewritings of a place, and what the program leaves out at its end; each when it is asked for.
fn gcode_actions(view: &mut View, at: Span, rewrite: bool, ending: bool) -> Answer<(Vec<Action>, Option<Action>)> {
    let Some((session, file, dialect)) = view.session() else { return Ok(Default::default()) };
    if dialect.family == gr_spec::Family::Ufmg2008 || !(rewrite || ending) {
        return Ok(Default::default());
    }
    let tables = (session.file(file)?, dialect);
    let doc = doc(&tables);
    // Before M2 the state is what it leaves on; behind the last block, what it left.
    let (last, ends) = gcode::actions::end_line(doc);
    let end = if ending { session.state_at(file, last)?.map(|s| if ends { s.before } else { s.after }) } else { None };
    let ending = gcode::actions::missing_end(doc, end.as_ref());
    if !rewrite || gcode::actions::skips_blocks(doc) {
        return Ok((Vec::new(), ending));
    }
    let line = doc.line_at(at.start).map_or(0, |l| l.line);
    let traced = super::look::trace_line(view, line, &[])?;
    let traced_lines = |lines: Option<std::ops::Range<u32>>| -> Answer<Option<(std::ops::Range<u32>, Vec<_>)>> {
        let Some(lines) = lines else { return Ok(None) };
        Ok(Some((lines.clone(), session.trace(file, lines, &[], super::MOST_BLOCKS)?)))
    };
    let contour = traced_lines(gcode::actions::compensated_lines(doc, line))?;
    let cycle = traced_lines(gcode::actions::cycle_lines(doc, line))?;
    let may_call = doc.line(line).is_some_and(|l| l.has_code(b'm', 980) || l.words().iter().any(|w| w.form == gr_gcode::Form::Control));
    let call = if may_call { names::calls(doc).into_iter().find(|c| c.line == line) } else { None };
    let behind = if call.is_some() { session.state_at(file, line + 1)?.map(|s| s.before) } else { None };
    let flows = tables.0.chunks.iter().any(|c| !c.scan.controls.is_empty()) || call.is_some();
    let motion = if traced.is_some() && flows { view.motion()? } else { None };
    view.release();
    // A block that is run twice can't be written out once.
    let once = |lines: std::ops::Range<u32>| !flows || motion.as_ref().is_some_and(|m| lines.clone().all(|l| runs_once(m, l)));
    let run = traced.as_ref().map(|t| (&t.before, &t.after, &t.program));
    let mut found = gcode::actions::actions(doc, at, Context { run, once: once(line..line + 1) });
    for (series, compensated) in [(&contour, true), (&cycle, false)] {
        let Some((lines, traced)) = series.as_ref().filter(|(lines, _)| once(lines.clone())) else { continue };
        let ran: Vec<(u32, &gr_interp::Modal, &gr_interp::Modal, &Program)> = traced.iter().map(|t| (t.line, &t.before, &t.after, &t.program)).collect();
        found.extend(match compensated {
            true => gcode::actions::write_out_compensation(doc, lines.clone(), &ran),
            false => gcode::actions::write_out_cycle(doc, lines.clone(), &ran),
        });
    }
    if let (Some(t), Some(call), Some(motion), Some(behind)) = (&traced, &call, &motion, &behind)
        && !leaves_values(doc, call)
    {
        found.extend(expand_call(motion, doc, call, &t.before, behind));
    }
    Ok((found, ending))
}

/// Whether a line is run exactly once: it moves in one stretch of the program, or leads to one call or pass.
fn runs_once(motion: &Motion, line: u32) -> bool {
    let calls = motion.program.frames.iter().filter(|f| f.file == motion.main && f.line == line).count();
    let mut cursor = motion.program.cursor();
    let (mut stretches, mut last) = (0, None);
    while let Some(view) = cursor.next() {
        if !view.op.moves() {
            continue;
        }
        let own = view.source.file == motion.main && view.source.line == line;
        let now = own.then_some(view.source.frame);
        stretches += usize::from(own && last != now);
        last = now;
    }
    calls <= 1 && stretches <= 1
}

/// Whether a subroutine, or one that it calls, sets what lives on after it: global parameters and return values. Also
/// when its text is not in this file.
fn leaves_values(doc: gcode::Doc<'_>, call: &names::CallSite) -> bool {
    let (subs, calls) = (names::subs(doc), names::calls(doc));
    let (mut open, mut seen) = (vec![call.label.clone()], std::collections::BTreeSet::new());
    while let Some(label) = open.pop() {
        if !seen.insert(label.clone()) {
            continue;
        }
        let Some(at) = subs.iter().position(|s| s.label == label) else { return true };
        let lines = subs[at].first..subs[at].last + 1;
        if gcode::actions::sets_globals(doc, lines) {
            return true;
        }
        open.extend(calls.iter().filter(|c| c.from == Some(at)).map(|c| c.label.clone()));
    }
    false
}

/// Writes the moves that the subroutine called here makes, in place of the call.
fn expand_call(motion: &Motion, doc: gcode::Doc<'_>, call: &names::CallSite, before: &gr_interp::Modal, after: &gr_interp::Modal) -> Option<Action> {
    if gcode::actions::is_shifted(before) || gcode::actions::is_shifted(after) || !runs_once(motion, call.line) {
        return None;
    }
    let moves = called_from(&motion.program, motion.main, call.line)?;
    let of = doc.line(call.line)?;
    let words = of.words();
    let first = words.iter().find(|w| w.form != gr_gcode::Form::Comment && w.letter != b'n')?;
    let last = words.iter().rfind(|w| w.form != gr_gcode::Form::Comment)?;
    let span = Span::new(of.tight(first).start, of.tight(last).end);
    let (text, code) = write_moves(doc.dialect, &moves, before, after, false)?;
    let mut edits = vec![Edit { span, text }];
    edits.extend(gcode::actions::goes_on(doc, call.line, code, after)?);
    let title = format!("Write out this call of {}", names::label_text(&call.label));
    Some(Action { title, kind: ActionKind::Inline, edits })
}

/// The operations of the first call from a line of the main file; none when there are too many.
fn called_from(program: &Program, main: FileId, line: u32) -> Option<Program> {
    const MOST: usize = 5_000;
    let calls = program.frames.iter().find(|f| f.file == main && f.line == line && f.pass == 0)?.id;
    let inside = |frame: gr_ir::FrameId| {
        let mut at = frame;
        for _ in 0..64 {
            if at == calls {
                return true;
            }
            match program.frames.get(at) {
                Some(f) => at = f.parent,
                None => return false,
            }
        }
        false
    };
    let mut cursor = program.cursor();
    let mut out: Option<gr_ir::Builder> = None;
    let mut count = 0;
    while let Some(view) = cursor.next() {
        if !inside(view.source.frame) {
            if out.is_some() {
                break;
            }
            continue;
        }
        let builder = out.get_or_insert_with(|| gr_ir::Builder::from_state(*view.start, *view.state));
        count += 1;
        if count > MOST {
            return None;
        }
        if view.op.moves() {
            builder.push_to(view.op, view.end, view.source);
        } else {
            builder.push(view.op, view.source);
        }
    }
    Some(out?.finish())
}

/// An edit that says which versions of the documents it is for, in the longer form that has room for it. A client then
/// refuses what was overtaken; of a file that is not open, what stands on disk is meant.
pub fn versioned(mut edit: lsp::WorkspaceEdit, versions: &Versions) -> lsp::WorkspaceEdit {
    let version = |uri: &lsp::Uri| versions.get(uri).copied();
    if let Some(changes) = edit.changes.take() {
        let mut changes: Vec<_> = changes.into_iter().collect();
        changes.sort_by(|a, b| a.0.cmp(&b.0));
        let of = |(uri, edits): (lsp::Uri, Vec<lsp::TextEdit>)| lsp::TextDocumentEdit {
            text_document: lsp::OptionalVersionedTextDocumentIdentifier { version: version(&uri), uri },
            edits: edits.into_iter().map(lsp::OneOf::Left).collect(),
        };
        edit.document_changes = Some(lsp::DocumentChanges::Edits(changes.into_iter().map(of).collect()));
    } else if let Some(lsp::DocumentChanges::Operations(operations)) = &mut edit.document_changes {
        for operation in operations {
            if let lsp::DocumentChangeOperation::Edit(of) = operation {
                of.text_document.version = version(&of.text_document.uri);
            }
        }
    }
    edit
}

/// Refusals in the words of the protocol.
pub fn refusal(f: &Failure) -> String {
    match f {
        Failure::Overtaken => "the text changed meanwhile".into(),
        Failure::Refused(why) => why.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::allowed;

    #[test]
    fn a_lint_is_allowed_in_its_list() {
        let written = |text: &str| {
            let (at, new) = allowed(text, "a/b");
            format!("{}{new}{}", &text[..at], &text[at..])
        };
        assert_eq!(written("x = 1\n"), "x = 1\n\n[lints]\nallow = [\"a/b\"]\n");
        assert_eq!(written("[lints] # all\n# allow = [\"x\"]\n"), "[lints] # all\nallow = [\"a/b\"]\n# allow = [\"x\"]\n");
        assert_eq!(written("[lints]\nallow = []\n"), "[lints]\nallow = [\"a/b\"]\n");
        assert_eq!(written("[a]\nallow = [\"q\"]\n[lints]\nallow=[ \"x\" ] # so\n"), "[a]\nallow = [\"q\"]\n[lints]\nallow=[\"a/b\",  \"x\" ] # so\n");
    }
}
