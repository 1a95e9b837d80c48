//! What can be written next.

use gr_canon::Units;
use gr_gcode::{Form, Parameter};
use gr_interp::{Modal, Params, Setup, State, ToolTable};
use gr_spec::{CodeDef, Dialect};
use gr_text::Span;

use super::doc::{Doc, LineOf, code_name};
use super::hover;
use super::names::{self, label_text};
use crate::{Completion, CompletionKind, Signature};

/// What completion needs besides the text.
#[derive(Clone, Copy, Default)]
pub struct Around<'a> {
    /// State before the line; none when execution never comes there.
    pub modal: Option<&'a Modal>,
    /// What the program is run with: codes that the controller would refuse in this state are left out.
    pub setup: Option<&'a Setup>,
    /// Tool table and its unit.
    pub tools: Option<(&'a ToolTable, Units)>,
    /// Subroutines of other files: name and where.
    pub subs: &'a [(String, String)],
}

/// Names of parameters that are proposed.
const MOST_NAMES: usize = 500;

/// What can be written at a byte of the file.
pub fn complete(doc: Doc<'_>, offset: u32, around: Around<'_>) -> Vec<Completion> {
    let Some(line) = doc.line_at(offset) else { return codes(doc, None, "", Span::new(offset, offset), &around) };
    let start = line.span().start;
    let before = line.text().get(..(offset.max(start) - start) as usize).unwrap_or(line.text());
    if let Some(inside) = open_comment(before) {
        let prints = ["debug,", "print,", "log,"].iter().any(|word| inside.trim_start().to_ascii_lowercase().starts_with(word));
        return match open_parameter(inside).filter(|_| prints) {
            Some(hash) => parameters(doc, &inside[hash..], Span::new(offset - (inside.len() - hash) as u32, offset), &line),
            None => comments(inside, offset),
        };
    }
    if let Some(hash) = open_parameter(before) {
        return parameters(doc, &before[hash..], Span::new(start + hash as u32, offset), &line);
    }
    if let Some(found) = label(doc, &line, before, offset, &around) {
        return found;
    }
    if let Some(found) = jump(doc, before, offset) {
        return found;
    }
    let outside = |(_, c): &(usize, char)| !c.is_ascii_alphanumeric() && *c != '.';
    let word = before.char_indices().rev().find(outside).map_or(0, |(at, c)| at + c.len_utf8());
    let typed = &before[word..];
    let behind = line.text().get(before.len()..).unwrap_or("");
    let replace = Span::new(start + word as u32, offset);
    if depth(before) > 0 {
        let letters = behind.bytes().take_while(u8::is_ascii_alphabetic).count();
        let open = behind[letters..].trim_start().starts_with('[');
        return functions(typed, Span::new(replace.start, offset + letters as u32), open);
    }
    // Behind `#1 =` comes a value, not a word.
    if before[..word].trim_end().ends_with('=') {
        let mut found = functions(typed, replace, false);
        if typed.is_empty() {
            found.extend(parameters(doc, "#", replace, &line));
        }
        return found;
    }
    // The number of a word that was begun is part of it.
    let digits = if typed.is_empty() { 0 } else { behind.bytes().take_while(|b| b.is_ascii_digit() || *b == b'.').count() };
    let replace = Span::new(replace.start, offset + digits as u32);
    let mut letters = typed.chars();
    match (letters.next().map(|c| c.to_ascii_uppercase()), letters.as_str()) {
        (Some(letter @ ('T' | 'H' | 'D')), digits) if digits.bytes().all(|b| b.is_ascii_digit()) => tools(letter, digits, replace, &around),
        _ => codes(doc, Some(&line), typed, replace, &around),
    }
}

fn depth(before: &str) -> i32 {
    before.bytes().fold(0, |d, b| match b {
        b'[' => d + 1,
        b']' => d - 1,
        _ => d,
    })
}

/// Text of the comment that is still open.
fn open_comment(before: &str) -> Option<&str> {
    if let Some(semicolon) = before.find(';') {
        return Some(&before[semicolon + 1..]);
    }
    let open = before.rfind('(')?;
    (!before[open..].contains(')')).then(|| &before[open + 1..])
}

fn comments(inside: &str, offset: u32) -> Vec<Completion> {
    let typed = inside.trim_start().to_ascii_uppercase();
    let replace = Span::new(offset - typed.len() as u32, offset);
    let fits = gr_spec::comments().iter().filter(|c| c.name.starts_with(&typed));
    fits.map(|c| Completion {
        label: c.name.into(),
        insert: format!("{},", c.name),
        snippet: false,
        detail: c.form.into(),
        documentation: c.what.into(),
        kind: CompletionKind::Keyword,
        rank: 1,
        replace,
    })
    .collect()
}

/// Where the parameter that is being written begins.
fn open_parameter(before: &str) -> Option<usize> {
    let hash = before.rfind('#')?;
    let rest = &before[hash + 1..];
    let named = rest.starts_with('<') && !rest.contains('>');
    (named || rest.bytes().all(|b| b.is_ascii_digit())).then_some(hash)
}

/// Bytes of a name behind the cursor that belong to it, a bracket that the editor closed by itself included.
fn rest_of_name(behind: &str, named: bool) -> usize {
    if !named {
        return behind.bytes().take_while(u8::is_ascii_digit).count();
    }
    let name = behind.bytes().take_while(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-' | b'.')).count();
    if behind[name..].starts_with('>') { name + 1 } else { 0 }
}

/// Line numbers behind `GOTO`.
fn jump(doc: Doc<'_>, before: &str, offset: u32) -> Option<Vec<Completion>> {
    let typed = &before[before.trim_end_matches(|c: char| c.is_ascii_digit()).len()..];
    let goto = before[..before.len() - typed.len()].trim_end().to_ascii_uppercase().ends_with("GOTO");
    if doc.dialect.family != gr_spec::Family::Fanuc || !goto {
        return None;
    }
    let replace = Span::new(offset - typed.len() as u32, offset);
    let numbered = doc.lines(0..doc.count()).filter_map(|l| Some((l, l.literal(b'n')?.value as i64)));
    let item = |(l, n): (LineOf<'_>, i64)| Completion {
        label: n.to_string(),
        insert: n.to_string(),
        snippet: false,
        detail: l.text().trim().to_string(),
        documentation: String::new(),
        kind: CompletionKind::Reference,
        rank: 0,
        replace,
    };
    Some(numbered.map(item).filter(|c| c.label.starts_with(typed)).take(MOST_NAMES).collect())
}

fn parameters(doc: Doc<'_>, typed: &str, replace: Span, line: &LineOf<'_>) -> Vec<Completion> {
    let lower = typed.to_lowercase();
    let behind = line.slice(Span::new(replace.end, line.span().end));
    let replace = Span::new(replace.start, replace.end + rest_of_name(behind, lower.starts_with("#<") || lower == "#" && behind.starts_with('>')) as u32);
    let item = |label: String, detail: &str, documentation: &str, rank: u8| Completion {
        insert: label.clone(),
        label,
        snippet: false,
        detail: detail.into(),
        documentation: documentation.into(),
        kind: CompletionKind::Parameter,
        rank,
        replace,
    };
    let mut found = Vec::new();
    let mut own: Vec<(Parameter, bool)> = names_of(doc);
    own.truncate(MOST_NAMES);
    for (p, local) in own {
        let (label, def) = match &p {
            Parameter::Number(n) => (format!("#{n}"), gr_spec::parameter(&n.to_string())),
            Parameter::Named(n) => (format!("#<{n}>"), gr_spec::parameter(n)),
        };
        if label.starts_with(&lower) && def.is_none_or(|d| d.first > 0) {
            let what = if local { "local to its subroutine" } else { "of this program" };
            found.push(item(label, def.map_or(what, |d| d.title), def.map_or("", |d| d.what), 0));
        }
    }
    let hash_only = lower == "#" || lower.starts_with("#<");
    for def in gr_spec::parameters().iter().filter(|d| if d.name.is_empty() { !hash_only || lower == "#" } else { hash_only }) {
        let label = if def.name.is_empty() { format!("#{}", def.first) } else { format!("#<{}>", def.name) };
        let many = if def.first != def.last { format!("{} (#{} … #{})", def.title, def.first, def.last) } else { def.title.into() };
        if label.starts_with(&lower) && !found.iter().any(|f: &Completion| f.label == label) {
            found.push(item(label, if def.name.is_empty() { &many } else { def.unit }, def.what, 2));
        }
    }
    found
}

/// Parameters that the file sets or reads, each once, in order of names.
fn names_of(doc: Doc<'_>) -> Vec<(Parameter, bool)> {
    let mut all: Vec<Parameter> = Vec::new();
    for chunk in doc.file.chunks.iter().filter(|c| memchr::memchr(b'#', c.text.as_bytes()).is_some()) {
        let s = gr_gcode::symbols(&chunk.text, &chunk.scan);
        all.extend(s.writes.iter().chain(&s.reads).map(|w| w.what.clone()));
        if all.len() > 100_000 {
            break;
        }
    }
    all.sort();
    all.dedup();
    all.into_iter().map(|p| (p.clone(), names::is_local(&p))).collect()
}

/// O-words: labels and keywords.
fn label(doc: Doc<'_>, line: &LineOf<'_>, before: &str, offset: u32, around: &Around<'_>) -> Option<Vec<Completion>> {
    let start = line.span().start;
    let text = before.trim_start().trim_start_matches(|c: char| c == '/' || c.is_whitespace());
    let rest = text.strip_prefix(['o', 'O'])?;
    let from = before.len() - rest.len();
    let complete_label = if let Some(name) = rest.strip_prefix('<') {
        name.find('>').map(|e| e + 2)
    } else {
        let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
        (digits > 0 && rest.len() > digits).then_some(digits)
    };
    let Some(end) = complete_label else {
        let behind = line.text().get(before.len()..).unwrap_or("");
        let more = rest_of_name(behind, rest.starts_with('<'));
        let replace = Span::new(start + from as u32 - 1, offset + more as u32);
        // The word behind a label that is there already.
        let keyword = behind[more..].trim_start().starts_with(|c: char| c.is_ascii_alphabetic());
        let local: Vec<(String, String)> = names::subs(doc)
            .iter()
            .filter(|s| s.first != line.line)
            .map(|s| (label_text(&s.label), "subroutine of this file".into()))
            .collect();
        let typed = format!("o{}", rest.to_lowercase());
        let fits = local.iter().chain(around.subs).filter(|(name, _)| name.starts_with(&typed));
        let items = fits.map(|(name, place)| Completion {
            label: format!("{name} call"),
            insert: if keyword { name.clone() } else { format!("{name} call") },
            snippet: false,
            detail: place.clone(),
            documentation: String::new(),
            kind: CompletionKind::Sub,
            rank: 0,
            replace,
        });
        return Some(items.collect());
    };
    let typed = rest[end..].trim_start();
    if typed.bytes().any(|b| !b.is_ascii_alphabetic()) {
        return None;
    }
    let replace = Span::new(offset - typed.len() as u32, offset);
    let typed = typed.to_lowercase();
    let first = go_on(doc, line.line, &rest[..end], around);
    let fits = gr_spec::controls().iter().filter(|c| c.name.to_lowercase().starts_with(&typed));
    let items = fits.map(|c| Completion {
        label: c.name.into(),
        insert: c.name.to_lowercase(),
        snippet: false,
        detail: c.form.into(),
        documentation: c.what.into(),
        kind: CompletionKind::Keyword,
        rank: u8::from(!first.contains(&c.name.to_lowercase().as_str())),
        replace,
    });
    let mut items: Vec<Completion> = items.collect();
    items.sort_by_key(|c| c.rank);
    Some(items)
}

/// Keywords that go on with what a label has begun above a line, or call what it names.
fn go_on(doc: Doc<'_>, line: u32, label: &str, around: &Around<'_>) -> &'static [&'static str] {
    const MOST_LINES: u32 = 2_000;
    let wanted = format!("o{}", label.to_lowercase());
    let word = |l: LineOf<'_>| {
        let text = l.text().trim_start().to_lowercase();
        let behind = text.strip_prefix(&wanted)?;
        let word: String = behind.trim_start().chars().take_while(char::is_ascii_alphabetic).collect();
        (!word.is_empty()).then_some(word)
    };
    let last = (line.saturating_sub(MOST_LINES)..line).rev().filter_map(|n| word(doc.line(n)?)).next();
    match last.as_deref() {
        Some("sub") => &["endsub", "return"],
        Some("if" | "elseif") => &["elseif", "else", "endif"],
        Some("else") => &["endif"],
        Some("while") => &["endwhile", "break", "continue"],
        Some("do") => &["while", "break", "continue"],
        Some("repeat") => &["endrepeat", "break", "continue"],
        Some("break" | "continue" | "return") => &["endwhile", "while", "endrepeat", "endsub"],
        _ if names::subs(doc).iter().map(|s| label_text(&s.label)).chain(around.subs.iter().map(|s| s.0.clone())).any(|name| name == wanted) => &["call"],
        _ => &["sub", "if", "while", "do", "repeat", "call"],
    }
}

fn functions(typed: &str, replace: Span, open: bool) -> Vec<Completion> {
    let upper = typed.to_ascii_uppercase();
    let fit = |name: &str| name.starts_with(&upper);
    let functions = gr_spec::functions().iter().filter(|f| fit(f.name)).map(|f| (f, true));
    let operators = gr_spec::operators().iter().filter(|f| f.name.chars().all(char::is_alphabetic) && fit(f.name)).map(|f| (f, false));
    let item = |(f, function): (&gr_spec::WordingDef, bool)| Completion {
        label: f.name.into(),
        insert: match (function && !open, f.name) {
            (true, "ATAN") => "ATAN[${1:y}]/[${2:x}]".into(),
            (true, name) => format!("{name}[$1]"),
            (false, name) => name.into(),
        },
        snippet: function && !open,
        detail: f.form.into(),
        documentation: f.what.into(),
        kind: CompletionKind::Function,
        rank: 1,
        replace,
    };
    functions.chain(operators).map(item).collect()
}

fn tools(letter: char, digits: &str, replace: Span, around: &Around<'_>) -> Vec<Completion> {
    let Some((table, units)) = around.tools else { return Vec::new() };
    let rows = table.rows.iter().skip(1).filter(|t| &*t.comment != gr_interp::ASSUMED && t.number.to_string().starts_with(digits));
    rows.map(|t| Completion {
        label: format!("{letter}{}", t.number),
        insert: format!("{letter}{}", t.number),
        snippet: false,
        detail: t.comment.trim().into(),
        documentation: hover::tool_row(t, units),
        kind: CompletionKind::Tool,
        rank: 0,
        replace,
    })
    .collect()
}

/// Codes and words.
fn codes(doc: Doc<'_>, line: Option<&LineOf<'_>>, typed: &str, replace: Span, around: &Around<'_>) -> Vec<Completion> {
    let upper = typed.to_ascii_uppercase();
    let dialect = doc.dialect;
    let present: Vec<&CodeDef> = line.map(|l| codes_of(l, dialect, replace)).unwrap_or_default();
    let mut found: Vec<Completion> = Vec::new();
    found.extend(words(line, dialect, &upper, replace, &present, around));
    let trial = around.modal.zip(around.setup).map(|(modal, setup)| Trial::new(modal, setup));
    let groups: Vec<&str> = present.iter().map(|c| c.group).filter(|g| !g.is_empty() && *g != "none").collect();
    for def in dialect.codes.iter().filter(|c| c.code.starts_with(&upper) && !c.code.contains('-')) {
        // Two codes of one group in a block are an error.
        if groups.contains(&def.group) || trial.as_ref().is_some_and(|t| t.refuses(def)) {
            continue;
        }
        let active = around.modal.is_some_and(|m| super::modes::codes(m).iter().any(|c| c == def.code));
        found.push(Completion {
            label: def.code.into(),
            insert: def.code.into(),
            snippet: false,
            detail: if active { format!("{} (active)", def.title) } else { def.title.into() },
            documentation: hover::code(def, dialect),
            kind: CompletionKind::Code,
            rank: if active { 4 } else { 3 },
            replace,
        });
        let needs: Vec<_> = def.args.iter().filter(|a| a.required).collect();
        if def.group == "motion" && def.args.len() >= 3 && !needs.is_empty() {
            found.push(snippet(def, dialect, replace));
        }
    }
    found
}

/// Runs blocks in a state, to learn what the controller refuses in it.
struct Trial<'a> {
    here: State,
    /// The same without what makes codes impossible: compensation, inverse time, other planes, no feed.
    elsewhere: State,
    setup: &'a Setup,
}

impl<'a> Trial<'a> {
    fn new(modal: &Modal, setup: &'a Setup) -> Trial<'a> {
        let mut here = State::start(setup);
        let mut elsewhere = State::start(setup);
        // Feed and spindle speed can be written in the same block.
        let fed = |m: &Modal| Modal { feed: if m.feed > 0.0 { m.feed } else { 100.0 }, ..*m };
        here.modal = fed(modal);
        elsewhere.modal = Modal { comp_side: 0, comp_radius: 0.0, feed_mode: 0, plane: elsewhere.modal.plane, ..fed(modal) };
        Trial { here, elsewhere, setup }
    }

    /// The code is an error here, with whatever words, and would be none elsewhere.
    fn refuses(&self, def: &CodeDef) -> bool {
        let mut block = def.code.to_string();
        let needed = def.args.iter().filter(|a| a.required).filter_map(|a| a.letters.chars().next());
        let mut letters: Vec<char> = needed.chain(def.args.iter().any(|a| a.letters.contains('X')).then_some('X')).collect();
        letters.sort_unstable();
        letters.dedup();
        for letter in letters {
            // Far enough for any tool radius.
            let value = match letter {
                'X' => 1000,
                'Z' => -1,
                _ => 1,
            };
            block.push_str(&format!(" {letter}{value}"));
        }
        block.push('\n');
        let scan = gr_gcode::scan(&block, self.setup.dialect);
        let chunk = gr_gcode::Chunk { text: block.into(), scan: std::sync::Arc::new(scan) };
        let faults = |state: &State| -> Vec<gr_spec::Code> {
            let ran = gr_interp::run_chunk(&chunk, state, &Params::default(), self.setup, gr_canon::Discard);
            ran.findings.iter().filter(|f| f.fault.rs.is_some()).map(|f| f.fault.code).collect()
        };
        let here = faults(&self.here);
        !here.is_empty() && faults(&self.elsewhere) != here
    }
}

/// Codes that stand in a line, the one being written left out.
fn codes_of(line: &LineOf<'_>, dialect: &'static Dialect, replace: Span) -> Vec<&'static CodeDef> {
    let literal = line.words().iter().filter(|w| matches!(w.letter, b'g' | b'm') && w.form == Form::Literal);
    literal.filter(|w| line.tight(w).start != replace.start).filter_map(|w| dialect.code(&code_name(w.letter, w.value))).collect()
}

/// `G83 Z${1} R${2} Q${3}`
fn snippet(def: &CodeDef, dialect: &Dialect, replace: Span) -> Completion {
    let mut insert = def.code.to_string();
    let mut n = 0;
    let mut label = def.code.to_string();
    for a in def.args.iter().filter(|a| a.required || a.letters.contains(['X', 'Y'])) {
        for letter in a.letters.chars().take(if a.required { 9 } else { 3 }) {
            n += 1;
            insert.push_str(&format!(" {letter}${{{n}:0}}"));
            label.push_str(&format!(" {letter}"));
        }
    }
    Completion {
        label,
        insert,
        snippet: true,
        detail: format!("{}, with its words", def.title),
        documentation: hover::code(def, dialect),
        kind: CompletionKind::Snippet,
        rank: 5,
        replace,
    }
}

/// Whether a motion is at feed.
fn feeds(def: &CodeDef) -> bool {
    let number = def.code.strip_prefix('G').and_then(|n| n.parse::<f64>().ok()).unwrap_or(0.0);
    (1.0..=6.0).contains(&number) && number != 4.0 || (38.0..39.0).contains(&number) || (73.0..=89.9).contains(&number) && number != 80.0
}

/// F, S, T and N: words that any block takes.
fn common(dialect: &'static Dialect, used: &[u8], motion: Option<&CodeDef>, present: &[&'static CodeDef], modal: Option<&Modal>) -> Vec<(char, String, u8)> {
    let has = |code: &str| present.iter().any(|c| c.code == code);
    let inverse = has("G93") || modal.is_some_and(|m| m.feed_mode == 1) && !has("G94") && !has("G95");
    let unfed = inverse || modal.is_some_and(|m| m.feed == 0.0);
    let needs_feed = unfed && motion.is_some_and(feeds);
    let title = |letter: char| dialect.word(letter).map(|d| d.title.to_string());
    let mut found = Vec::new();
    for letter in ['F', 'S', 'T', 'N'].into_iter().filter(|l| !used.contains(&(*l as u8))) {
        let Some(title) = title(letter) else { continue };
        match letter {
            'F' if needs_feed && inverse => found.push((letter, format!("needed: {title}, one over the minutes of this move"), 0)),
            'F' if needs_feed => found.push((letter, format!("needed: {title}, none is set so far"), 0)),
            'N' if !used.is_empty() => {}
            'N' | 'T' => found.push((letter, title, 4)),
            _ => found.push((letter, title, 2)),
        }
    }
    found
}

/// Words that the codes of the line, or the motion in force, still take.
fn words(
    line: Option<&LineOf<'_>>,
    dialect: &'static Dialect,
    upper: &str,
    replace: Span,
    present: &[&'static CodeDef],
    around: &Around<'_>,
) -> Vec<Completion> {
    let modal = around.modal.filter(|m| m.motion >= 0).and_then(|m| dialect.code(&code_name(b'g', f64::from(m.motion) / 10.0)));
    let motion = if present.iter().any(|c| c.group == "motion") { None } else { modal };
    let others = line.into_iter().flat_map(|l| l.words().iter().filter(|w| l.tight(w).start != replace.start));
    let used: Vec<u8> = others.map(|w| w.letter.to_ascii_uppercase()).collect();
    let mut found: Vec<Completion> = Vec::new();
    for (def, implicit) in present.iter().map(|c| (*c, false)).chain(motion.map(|c| (c, true))) {
        for a in def.args {
            for letter in a.letters.chars().filter(|l| l.is_ascii() && !used.contains(&(*l as u8))) {
                let label = letter.to_string();
                if !label.starts_with(upper) || found.iter().any(|f| f.label == label) {
                    continue;
                }
                let missing = a.required && !implicit && !a.letters.bytes().any(|l| used.contains(&l));
                found.push(Completion {
                    insert: label.clone(),
                    label,
                    snippet: false,
                    detail: format!("{}{} of {}", if missing { "needed: " } else { "" }, a.what, def.code),
                    documentation: String::new(),
                    kind: CompletionKind::Word,
                    rank: if missing { 0 } else { 2 },
                    replace,
                });
            }
        }
    }
    let motion = present.iter().find(|c| matches!(c.group, "motion" | "cycle")).copied().or(motion);
    for (letter, detail, rank) in common(dialect, &used, motion, present, around.modal) {
        let label = letter.to_string();
        if !label.starts_with(upper) {
            continue;
        }
        // What is needed goes before a motion that has the word among others.
        found.retain(|f| f.label != label || rank > 0);
        if !found.iter().any(|f| f.label == label) {
            found.push(Completion { insert: label.clone(), label, snippet: false, detail, documentation: String::new(), kind: CompletionKind::Word, rank, replace });
        }
    }
    found
}

/// The form of the code, cycle or call that is being written.
pub fn signature(doc: Doc<'_>, offset: u32, modal: Option<&Modal>) -> Option<Signature> {
    let line = doc.line_at(offset)?;
    let start = line.span().start;
    let before = line.text().get(..(offset - start) as usize)?;
    if open_comment(before).is_some() {
        return None;
    }
    if let Some(found) = call(doc, &line, before) {
        return Some(found);
    }
    let written = |w: &&gr_gcode::Word| line.tight(w).start < offset && w.form == Form::Literal && matches!(w.letter, b'g' | b'm');
    let explicit: Vec<&CodeDef> =
        line.words().iter().filter(written).filter_map(|w| doc.dialect.code(&code_name(w.letter, w.value))).filter(|c| !c.args.is_empty()).collect();
    let last = explicit.iter().rev().find(|c| c.group == "motion").or(explicit.last()).copied();
    let implied = || modal.filter(|m| m.motion >= 730).and_then(|m| doc.dialect.code(&code_name(b'g', f64::from(m.motion) / 10.0)));
    let def = last.or_else(implied)?;
    let letter = line.words().iter().rev().find(|w| line.tight(w).start < offset && w.form != Form::Comment).map(|w| w.letter.to_ascii_uppercase() as char);
    let mut label = def.code.to_string();
    let mut parameters = Vec::new();
    let mut active = None;
    for a in def.args {
        label.push(' ');
        let from = label.len() as u32;
        let letters: Vec<String> = a.letters.chars().map(String::from).collect();
        let words = letters.join(" ");
        label.push_str(&if a.required { words } else { format!("[{words}]") });
        if letter.is_some_and(|l| a.letters.contains(l)) {
            active = Some(parameters.len() as u32);
        }
        let unit = if a.unit.is_empty() { String::new() } else { format!(" ({})", a.unit) };
        parameters.push((from..label.len() as u32, format!("{}{unit}", a.what)));
    }
    Some(Signature { label, documentation: format!("**{}**\n\n{}", def.title, def.what), parameters, active })
}

/// `o<name> call [a] [b]`: the arguments by what the subroutine does with them.
fn call(doc: Doc<'_>, line: &LineOf<'_>, before: &str) -> Option<Signature> {
    let at = before.to_ascii_lowercase().rfind("call")?;
    let typed = &before[at + 4..];
    let label = line.words().iter().find(|w| w.form == Form::Control)?;
    let control = line.chunk.scan.controls.get(label.index())?;
    let name = line.slice(control.label_span.shifted(line.base)).trim().to_string();
    let shown = if name.starts_with(['o', 'O']) { name } else { format!("o{name}") };
    let key = shown.to_lowercase().replace(' ', "");
    let sub = names::subs(doc).into_iter().find(|s| label_text(&s.label) == key);
    let uses = sub.as_ref().map(|s| arguments(doc, s)).unwrap_or_default();
    let count = uses.iter().map(|(n, _)| *n).max().unwrap_or(0).max(typed.matches('[').count() as u32).max(1);
    let mut text = format!("{shown} call");
    let mut parameters = Vec::new();
    for n in 1..=count {
        let name = uses.iter().find(|(i, _)| *i == n).map_or(String::new(), |(_, u)| u.clone());
        text.push(' ');
        let from = text.len() as u32;
        text.push_str(&if name.is_empty() { format!("[#{n}]") } else { format!("[#{n} {name}]") });
        parameters.push((from..text.len() as u32, if name.is_empty() { String::new() } else { format!("#{n}: {name}") }));
    }
    let open = typed.matches('[').count() as u32;
    let documentation = sub.and_then(|s| remark(doc, s.first)).unwrap_or_default();
    Some(Signature { label: text, documentation, parameters, active: open.checked_sub(1).filter(|a| *a < count) })
}

/// Arguments that a subroutine reads: number, and the name it is given (`#<depth> = #1 (=depth)`).
fn arguments(doc: Doc<'_>, sub: &names::Sub) -> Vec<(u32, String)> {
    let mut found: Vec<(u32, String)> = Vec::new();
    for line in doc.lines(sub.first..sub.last + 1) {
        let scan = &line.chunk.scan;
        for w in line.words().iter().filter(|w| w.form == Form::Setting) {
            let Some(setting) = scan.settings.get(w.index()) else { continue };
            if let (gr_gcode::Target::Named(name), Some(gr_gcode::Node::Param(id))) = (setting.target, scan.nodes.get(setting.value.0 as usize).copied())
                && let Some(gr_gcode::Node::Number(n)) = scan.nodes.get(id.0 as usize)
            {
                found.push((*n as u32, scan.names[name as usize].to_string()));
            }
        }
    }
    let name = names::Name::Parameter;
    for n in 1..=30 {
        if !found.iter().any(|f| f.0 == n) && !names::occurrences(doc, &name(Parameter::Number(n)), Some(sub.first)).is_empty() {
            found.push((n, String::new()));
        }
    }
    found.retain(|f| (1..=30).contains(&f.0));
    found
}

/// The comment on or above a line.
fn remark(doc: Doc<'_>, line: u32) -> Option<String> {
    let of = |l: u32| {
        let line = doc.line(l)?;
        let w = line.words().iter().find(|w| w.form == Form::Comment)?;
        Some(line.slice(line.tight(w)).trim_matches(['(', ')', ';', ' ']).to_string())
    };
    of(line).or_else(|| of(line.checked_sub(1)?))
}
