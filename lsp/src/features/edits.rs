//! Code actions: what the diagnostics offer, and what can be rewritten here.

use std::collections::HashMap;

use gr_ide::gcode::actions::{Context, write_moves};
use gr_ide::gcode::names;
use gr_ide::{Action, ActionKind, Edit, gcode, p21};
use gr_ir::{FileId, Program};
use gr_text::{Diagnostic, Span};
use tower_lsp::ls_types as lsp;

use super::{Answer, Failure, doc, exchange_doc, text_edits};
use crate::documents::{Kind, Motion, View};
use crate::protocol::{self, action_kind};

/// Actions for a place, of the kinds that are asked for.
pub fn actions(mut view: View, range: lsp::Range, only: Option<&[lsp::CodeActionKind]>) -> Answer<Vec<lsp::CodeAction>> {
    let at = Span::new(view.offset(range.start), view.offset(range.end));
    let wanted = |kind: &lsp::CodeActionKind| only.is_none_or(|o| o.iter().any(|k| kind.as_str() == k.as_str() || kind.as_str().starts_with(&format!("{}.", k.as_str()))));
    let mut found = fixes(&view, at)?;
    let more = match view.kind {
        Kind::Gcode(..) => gcode_actions(&mut view, at)?,
        Kind::Exchange => p21::actions::actions(exchange_doc(&view.exchange()), at),
        _ => Vec::new(),
    };
    found.extend(more.into_iter().map(|a| action(&view, a)));
    found.retain(|a| a.kind.as_ref().is_none_or(&wanted));
    Ok(found)
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

/// Fixes of the diagnostics around a place.
fn fixes(view: &View, at: Span) -> Answer<Vec<lsp::CodeAction>> {
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
    let mut out = Vec::new();
    for d in found.iter().filter(touches).take(50) {
        for (n, fix) in d.fixes.iter().enumerate() {
            let edits: Vec<Edit> =
                fix.edits.iter().filter(|(file, ..)| *file == own).map(|(_, span, text)| Edit { span: *span, text: text.clone() }).collect();
            if edits.len() != fix.edits.len() {
                continue;
            }
            let mut a = action(view, Action { title: fix.title.clone(), kind: ActionKind::Fix, edits });
            a.diagnostics = Some(vec![protocol::diagnostic(d, &view.text, view.columns, &|_| None)]);
            a.is_preferred = Some(n == 0);
            out.push(a);
        }
        if d.fixes.is_empty() {
            out.extend(d.code.def().lint.then(|| allow(view, d)).flatten());
        }
    }
    Ok(out)
}

/// A lint can be switched off for the project.
fn allow(view: &View, d: &Diagnostic) -> Option<lsp::CodeAction> {
    let path = view.station.files.iter().find(|p| p.file_name().is_some_and(|n| n == "gcc-robot.toml"))?;
    let open = view.others.iter().find(|o| o.path == *path);
    let text = match open {
        Some(o) => o.text.to_string(),
        None => std::fs::read_to_string(path).ok()?,
    };
    let slug = d.code.def().slug;
    let (at, new) = allowed(&text, slug);
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

fn gcode_actions(view: &mut View, at: Span) -> Answer<Vec<Action>> {
    let Some((session, file, dialect)) = view.session() else { return Ok(Vec::new()) };
    if dialect.family == gr_spec::Family::Ufmg2008 {
        return Ok(Vec::new());
    }
    let tables = (session.file(file)?, dialect);
    let doc = doc(&tables);
    let line = doc.line_at(at.start).map_or(0, |l| l.line);
    let traced = super::look::trace_line(view, line, &[])?;
    let contour = gcode::actions::compensated_lines(doc, line);
    let contour = match contour {
        Some(lines) => Some((lines.clone(), session.trace(file, lines, &[], super::MOST_BLOCKS)?)),
        None => None,
    };
    let count = doc.count();
    let last = session.state_at(file, count.saturating_sub(1))?;
    // Before M2 the state is what it leaves on; behind the last block, what it left.
    let ends = doc.line(count.saturating_sub(1)).is_some_and(|l| l.has_code(b'm', 20) || l.has_code(b'm', 300));
    let end = last.map(|s| if ends { s.before } else { s.after });
    let calls = names::calls(doc).into_iter().find(|c| c.line == line);
    let motion = if calls.is_some() && traced.is_some() { view.motion()? } else { None };
    view.release();
    let run = traced.as_ref().map(|t| (&t.before, &t.after, &t.program));
    let mut found = gcode::actions::actions(doc, at, Context { run, end: end.as_ref() });
    if let Some((lines, traced)) = &contour {
        let ran: Vec<(u32, &gr_interp::Modal, &Program)> = traced.iter().map(|t| (t.line, &t.before, &t.program)).collect();
        found.extend(gcode::actions::write_out_compensation(doc, lines.clone(), &ran));
    }
    if let (Some(t), Some(call), Some(motion)) = (&traced, &calls, &motion) {
        found.extend(expand_call(motion, doc, call, &t.before));
    }
    Ok(found)
}

/// Writes the moves that the subroutine called here makes, in place of the call.
fn expand_call(motion: &Motion, doc: gcode::Doc<'_>, call: &names::CallSite, before: &gr_interp::Modal) -> Option<Action> {
    let moves = called_from(&motion.program, motion.main, call.line)?;
    let of = doc.line(call.line)?;
    let words = of.words();
    let first = words.iter().find(|w| w.form != gr_gcode::Form::Comment && w.letter != b'n')?;
    let last = words.iter().rfind(|w| w.form != gr_gcode::Form::Comment)?;
    let span = Span::new(of.tight(first).start, of.tight(last).end);
    let text = write_moves(&moves, before)?;
    let title = format!("Write out this call of {}", names::label_text(&call.label));
    Some(Action { title, kind: ActionKind::Inline, edits: vec![Edit { span, text }] })
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
