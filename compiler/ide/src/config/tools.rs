//! Tool tables (`.tbl`).

use gr_canon::Units;
use gr_interp::read_tools;
use gr_text::{FileId, Span};

use crate::gcode::hover::tool_row;
use crate::{Completion, CompletionKind, Hover, Item, ItemKind};

/// Words of a line: letter, what it is, its unit.
const WORDS: &[(char, &str, &str)] = &[
    ('T', "tool number", ""),
    ('P', "pocket of the changer", ""),
    ('D', "diameter", "length"),
    ('X', "offset along X", "length"),
    ('Y', "offset along Y", "length"),
    ('Z', "offset along Z: tool length", "length"),
    ('A', "offset of A", "degrees"),
    ('B', "offset of B", "degrees"),
    ('C', "offset of C", "degrees"),
    ('U', "offset along U", "length"),
    ('V', "offset along V", "length"),
    ('W', "offset along W", "length"),
    ('I', "front angle of a lathe tool", "degrees"),
    ('J', "back angle of a lathe tool", "degrees"),
    ('Q', "orientation of a lathe tool, 0 … 9", ""),
];

fn line_at(text: &str, offset: u32) -> (u32, &str) {
    let at = (offset as usize).min(text.len());
    let start = text[..floor(text, at)].rfind('\n').map_or(0, |p| p + 1);
    let end = text[start..].find(['\n', '\r']).map_or(text.len(), |p| start + p);
    (start as u32, &text[start..end])
}

fn floor(text: &str, mut at: usize) -> usize {
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// Explains the word at a byte, and the tool of its line.
pub fn hover(text: &str, offset: u32, units: Units) -> Option<Hover> {
    let (start, line) = line_at(text, offset);
    let column = (offset - start) as usize;
    let body = line.split(';').next()?;
    if column > body.trim_end().len() {
        return None;
    }
    let blank = |(_, c): &(usize, char)| c.is_whitespace();
    let from = body.get(..column)?.char_indices().rev().find(blank).map_or(0, |(at, c)| at + c.len_utf8());
    let word = body.get(from..)?.split_whitespace().next()?;
    let letter = word.chars().next()?.to_ascii_uppercase();
    let (_, what, unit) = WORDS.iter().find(|w| w.0 == letter)?;
    let unit = match *unit {
        "length" => if units == Units::Inch { " (inch)" } else { " (mm)" },
        "degrees" => " (degrees)",
        _ => "",
    };
    let (table, _) = read_tools(line, FileId(0));
    let row = table.rows.get(1).map_or(String::new(), |t| format!("\n\n{}", tool_row(t, units)));
    let span = Span::new(start + from as u32, start + (from + word.len()) as u32);
    Some(Hover { span, text: format!("**{letter}** {what}{unit}{row}\n\n*LinuxCNC 2.9 documentation, tool table format*") })
}

/// Words that a line does not have yet.
pub fn complete(text: &str, offset: u32) -> Vec<Completion> {
    let (start, line) = line_at(text, offset);
    let before = line.get(..(offset - start) as usize).unwrap_or(line);
    if before.contains(';') {
        return Vec::new();
    }
    let typed = before.rsplit(char::is_whitespace).next().unwrap_or("").to_ascii_uppercase();
    let body = line.split(';').next().unwrap_or("");
    let used: Vec<char> = body.split_whitespace().filter_map(|w| w.chars().next()).map(|c| c.to_ascii_uppercase()).collect();
    let next = read_tools(text, FileId(0)).0.rows.iter().map(|t| t.number).max().unwrap_or(0).max(0) + 1;
    WORDS
        .iter()
        .filter(|(l, ..)| typed.is_empty() && !used.contains(l) || typed == l.to_string())
        .map(|(l, what, unit)| Completion {
            label: l.to_string(),
            insert: if matches!(l, 'T' | 'P') { format!("{l}{next}") } else { format!("{l}0") },
            snippet: false,
            detail: (*what).into(),
            documentation: (*unit).into(),
            kind: CompletionKind::Word,
            rank: if matches!(l, 'T' | 'P' | 'D' | 'Z') { 0 } else { 1 },
            replace: Span::new(offset - typed.len() as u32, offset),
        })
        .collect()
}

/// The tools.
pub fn outline(text: &str) -> Vec<Item> {
    let mut items = Vec::new();
    let mut at = 0u32;
    for whole in text.split_inclusive('\n') {
        let line = whole.trim_end_matches(['\n', '\r']);
        let (table, _) = read_tools(line, FileId(0));
        if let Some(t) = table.rows.get(1) {
            let span = Span::new(at, at + line.len() as u32);
            let detail = format!("⌀{} {}", crate::gcode::doc::number(t.diameter, 4), t.comment.trim());
            items.push(Item { kind: ItemKind::CuttingTool, name: format!("T{}", t.number), detail, range: span, span, children: Vec::new() });
        }
        at += whole.len() as u32;
    }
    items
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_rows() {
        let text = "; mine\nT1 P1 D6 Z-10.5 ;end mill\nT2 P2 \n";
        let h = hover(text, text.find("D6").unwrap() as u32, Units::Mm).expect("a word");
        assert!(h.text.starts_with("**D** diameter (mm)\n\n**T1** pocket 1, diameter 6 mm, offset Z-10.5"), "{}", h.text);
        let labels: Vec<String> = complete(text, text.len() as u32 - 1).into_iter().map(|c| c.label).collect();
        assert_eq!(labels[..3], ["D", "X", "Y"]);
        assert_eq!(outline(text).len(), 2);
        assert!(hover(text, 2, Units::Mm).is_none());
    }
}
