//! Files of a LinuxCNC machine: its INI file, of which those keys are explained that programs depend on here, and its
//! parameter file (`.var`). Facts: LinuxCNC 2.9 documentation, INI configuration, and G-code overview, parameters.

use gr_spec::{IniKey, IniKind};
use gr_text::Span;

use super::lines;
use crate::gcode::doc::number;
use crate::{Completion, CompletionKind, Fold, Hover, Item, ItemKind};

/// Whether an INI file is one of LinuxCNC: others are none of ours.
pub fn is_machine_ini(text: &str) -> bool {
    text.lines().any(|l| ["[RS274NGC]", "[EMC]", "[EMCIO]", "[TRAJ]", "[KINS]"].iter().any(|s| l.trim_start().starts_with(s)))
}

fn section_of(line: &str) -> Option<&str> {
    line.trim_start().strip_prefix('[')?.split_once(']').map(|s| s.0)
}

/// The section that a byte is in, and its line.
fn place(text: &str, offset: u32) -> (&str, u32, &str) {
    let (mut section, mut here) = ("", (text.len() as u32, ""));
    for (start, line) in lines(text) {
        if start > offset {
            break;
        }
        section = section_of(line).unwrap_or(section);
        here = (start, line);
    }
    // Behind the last line break a line is about to begin.
    if offset as usize >= text.len() && (text.is_empty() || text.ends_with('\n')) {
        here = (text.len() as u32, "");
    }
    (section, here.0, here.1)
}

/// Explains the key of the line at a byte.
pub fn ini_hover(text: &str, offset: u32) -> Option<Hover> {
    let (section, start, line) = place(text, offset);
    let key = line.split_once('=')?.0.split_whitespace().next().filter(|k| !k.starts_with(['#', ';']))?;
    let from = start + line.find(key)? as u32;
    let span = Span::new(from, from + key.len() as u32);
    if offset > start + line.len() as u32 {
        return None;
    }
    let known = IniKey::find(section, key);
    let what = known.map_or("Programs do not depend on it here, unless they read it as `#<_ini[section]key>`.", |k| k.what);
    Some(Hover { span, text: format!("**[{section}] {key}**\n\n{what}\n\n*LinuxCNC 2.9 documentation, INI configuration*") })
}

/// Keys that the section at a byte can have.
pub fn ini_complete(text: &str, offset: u32) -> Vec<Completion> {
    let (section, start, line) = place(text, offset);
    let before = line.get(..(offset.saturating_sub(start)) as usize).unwrap_or(line);
    let typed = before.trim_start();
    let replace = Span::new(offset - typed.len() as u32, offset);
    if let Some(name) = typed.strip_prefix('[').filter(|n| !n.contains(']')) {
        return sections(name, replace, line.get(before.len()..).is_some_and(|rest| rest.starts_with(']')));
    }
    if let Some((key, value)) = typed.split_once('=').filter(|_| !typed.starts_with(['#', ';'])) {
        return values(section, key.trim(), value.trim_start(), offset);
    }
    if typed.contains(['#', ';', '[']) {
        return Vec::new();
    }
    let known = IniKey::all().iter().filter(|k| k.stands_in(section) && k.name.starts_with(&typed.to_uppercase()));
    known
        .map(|k| item(k.name, format!("{} = ", k.name), k.what, replace))
        .collect()
}

fn item(label: &str, insert: String, documentation: &str, replace: Span) -> Completion {
    Completion { label: label.into(), insert, snippet: false, detail: String::new(), documentation: documentation.into(), kind: CompletionKind::Word, rank: 0, replace }
}

/// Sections that have keys of the table; `closed`: the bracket behind them is there.
fn sections(typed: &str, mut replace: Span, closed: bool) -> Vec<Completion> {
    replace.end += u32::from(closed);
    let mut names: Vec<&str> = IniKey::all().iter().map(|k| k.section).collect();
    names.dedup();
    let shown = |name: &str| name.replace('?', "X");
    let fits = names.into_iter().map(shown).filter(|n| n.starts_with(&typed.to_uppercase()));
    fits.map(|n| item(&n, format!("[{n}]"), "", replace)).collect()
}

/// What a switch can be.
fn values(section: &str, key: &str, typed: &str, offset: u32) -> Vec<Completion> {
    let replace = Span::new(offset - typed.len() as u32, offset);
    let known = IniKey::find(section, key).filter(|k| matches!(k.kind, IniKind::Flag | IniKind::Switch));
    let choices = known.into_iter().flat_map(|k| ["1", "0"].map(|v| (v, k.what)));
    choices.filter(|(v, _)| v.starts_with(typed)).map(|(v, what)| item(v, v.into(), what, replace)).collect()
}

/// Its sections.
pub fn ini_outline(text: &str) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    for (start, line) in lines(text) {
        let end = start + line.len() as u32;
        if let Some(name) = section_of(line) {
            let span = Span::new(start, end);
            items.push(Item { kind: ItemKind::Section, name: name.into(), detail: String::new(), range: span, span, children: Vec::new() });
        } else if let Some(last) = items.last_mut().filter(|_| !line.trim().is_empty()) {
            last.range.end = end;
        }
    }
    items
}

/// The same to be folded.
pub fn ini_folds(text: &str) -> Vec<Fold> {
    let index = gr_text::LineIndex::new(text.as_bytes());
    let line = |at: u32| index.position(at).0;
    let folds = ini_outline(text).into_iter().map(|i| Fold { first: line(i.range.start), last: line(i.range.end), comment: false });
    folds.filter(|f| f.last > f.first).collect()
}

/// Says what the parameter in the line at a byte is.
pub fn vars_hover(text: &str, offset: u32) -> Option<Hover> {
    let (_, start, line) = place(text, offset);
    let mut words = line.split_whitespace();
    let name = words.next().filter(|n| n.bytes().all(|b| b.is_ascii_digit()))?;
    let def = gr_spec::parameter(name)?;
    let value = words.next().and_then(|v| v.parse::<f64>().ok()).map_or(String::new(), |v| format!("\n\nIts value: `{}`", number(v, 6)));
    let unit = if def.unit.is_empty() { String::new() } else { format!(" ({})", def.unit) };
    let from = start + line.find(name)? as u32;
    let span = Span::new(from, start + line.trim_end().len() as u32);
    Some(Hover { span, text: format!("**#{name}**{unit}\n\n{}{value}\n\n*{}*", def.what, def.source) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_and_parameters() {
        let ini = "# mine\n[TRAJ]\nLINEAR_UNITS = mm\nSPINDLES = 1\n\n[AXIS_X]\nMIN_LIMIT = -1\nHOME = 0\n\n";
        let at = |what: &str| ini.find(what).expect("there") as u32;
        let told = |what: &str| ini_hover(ini, at(what)).map(|h| h.text).unwrap_or_default();
        assert!(told("LINEAR").starts_with("**[TRAJ] LINEAR_UNITS**\n\nThe machine's unit of length"));
        assert!(told("MIN_L").contains("Smallest position") && told("HOME").contains("do not depend") && told("# mine").is_empty());
        assert_eq!(ini_outline(ini).iter().map(|i| i.name.as_str()).collect::<Vec<_>>(), ["TRAJ", "AXIS_X"]);
        assert_eq!(ini_folds(ini), [Fold { first: 1, last: 3, comment: false }, Fold { first: 5, last: 7, comment: false }]);
        let keys: Vec<String> = ini_complete(&ini.replace("HOME = 0", "MAX_"), at("HOME") + 4).into_iter().map(|c| c.label).collect();
        assert_eq!(keys, ["MAX_LIMIT", "MAX_VELOCITY", "MAX_ACCELERATION"]);
        let labels = |text: &str| ini_complete(text, text.len() as u32).into_iter().map(|c| c.label).collect::<Vec<_>>();
        assert_eq!(labels("[EMCIO]\nTOOL_CHANGE_Q"), ["TOOL_CHANGE_QUILL_UP"]);
        assert!(labels("[EMCIO]\n").contains(&"TOOL_TABLE".to_string()) && labels("[EMCIO]\n# T").is_empty());
        assert_eq!(labels("[EMCIO]\nTOOL_CHANGE_AT_G30 = "), ["1", "0"]);
        assert_eq!(labels("[EMCIO]\n[RS"), ["RS274NGC"]);
        assert!(is_machine_ini(ini) && !is_machine_ini("[core]\nx = 1\n"));
        let vars = "5161\t0.0\n5221\t12.5\n";
        let h = vars_hover(vars, 12).expect("a parameter");
        assert!(h.text.starts_with("**#5221**") && h.text.contains("`12.5`"), "{}", h.text);
        assert!(vars_hover("", 0).is_none() && vars_hover("nothing\n", 2).is_none());
    }
}
