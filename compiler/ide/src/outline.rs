use gr_gcode::{Form, Keyword, OLabel, Scan};
use gr_text::Span;

/// What an outline entry is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ItemKind {
    /// Subroutine.
    Sub,
    /// Tool change.
    Tool,
    /// A remark of its own line: an operation's name.
    Operation,
}

/// An entry of the outline, in text order.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// What.
    pub kind: ItemKind,
    /// Its name.
    pub name: String,
    /// Its first line.
    pub line: u32,
    /// Its last line.
    pub last_line: u32,
    /// The name's bytes.
    pub span: Span,
}

/// A stretch of lines that can be folded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fold {
    /// First line.
    pub first: u32,
    /// Last line.
    pub last: u32,
}

/// Subroutines, tool changes and operations of a text.
pub fn outline(text: &str, scan: &Scan) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    let count = scan.lines.len() as u32;
    let mut sub: Option<usize> = None;
    let mut tool: Option<usize> = None;
    for line in 0..count {
        let words = scan.words(line);
        for w in words {
            let span = scan.word_span(text, line, w);
            match (w.letter, w.form) {
                (b'o', Form::Control) => {
                    let control = &scan.controls[w.index()];
                    match control.keyword {
                        Keyword::Sub | Keyword::Program => {
                            let name = format!("o{}", text[control.label_span.range()].trim());
                            items.push(Item { kind: ItemKind::Sub, name, line, last_line: line, span: control.span });
                            sub = Some(items.len() - 1);
                        }
                        Keyword::Endsub => {
                            if let Some(s) = sub.take() {
                                items[s].last_line = line;
                            }
                        }
                        _ => {}
                    }
                }
                (b'm', Form::Literal) if w.value == 6.0 => {
                    if let Some(t) = tool {
                        items[t].last_line = line.saturating_sub(1);
                    }
                    let number = words.iter().find(|w| w.letter == b't' && w.form == Form::Literal);
                    let name = number.map_or_else(|| "tool change".to_string(), |t| format!("T{}", t.value));
                    items.push(Item { kind: ItemKind::Tool, name, line, last_line: count.saturating_sub(1), span });
                    tool = Some(items.len() - 1);
                }
                (b'(' | b';', Form::Comment) if words.len() == 1 => {
                    let name = text[span.range()].trim_matches(['(', ')', ';', ' ', '-', '*', '=']).to_string();
                    let command = name.len() > 3 && name.get(..4).is_some_and(|h| ["msg,", "debu", "prin", "log,"].contains(&h.to_ascii_lowercase().as_str()));
                    if !name.is_empty() && !command {
                        items.push(Item { kind: ItemKind::Operation, name, line, last_line: line, span });
                    }
                }
                _ => {}
            }
        }
    }
    items
}

/// Blocks of O-words and macro loops.
pub fn folds(scan: &Scan) -> Vec<Fold> {
    let mut open: Vec<u32> = Vec::new();
    let mut found = Vec::new();
    for line in 0..scan.lines.len() as u32 {
        for w in scan.words(line).iter().filter(|w| w.form == Form::Control) {
            match scan.controls[w.index()].keyword {
                Keyword::Sub | Keyword::If | Keyword::Repeat | Keyword::Do | Keyword::MacroWhile | Keyword::MacroDo => open.push(line),
                // The `while` that ends a `do` carries its label.
                Keyword::While if !ends_do(scan, &open, line) => open.push(line),
                Keyword::Endsub | Keyword::Endif | Keyword::Endrepeat | Keyword::Endwhile | Keyword::While | Keyword::MacroEnd => {
                    if let Some(first) = open.pop().filter(|f| *f < line) {
                        found.push(Fold { first, last: line });
                    }
                }
                _ => {}
            }
        }
    }
    found.sort_by_key(|f| f.first);
    found
}

fn ends_do(scan: &Scan, open: &[u32], line: u32) -> bool {
    let label = |l: u32| {
        let w = scan.words(l).iter().find(|w| w.form == Form::Control)?;
        let c = &scan.controls[w.index()];
        Some((c.keyword, name(scan, c.label)))
    };
    let Some((_, here)) = label(line) else { return false };
    open.last().and_then(|l| label(*l)).is_some_and(|(k, n)| k == Keyword::Do && n == here)
}

fn name(scan: &Scan, label: OLabel) -> String {
    match label {
        OLabel::Number(e) => format!("{:?}", scan.nodes[e.0 as usize]),
        OLabel::Named(n) => scan.names[n as usize].to_string(),
        OLabel::None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::{Fold, folds, outline};
    use gr_spec::Dialect;

    const TEXT: &str = "(--- face)\nT1 M6\no<a> sub\no1 if [1]\nG0 X1\no1 endif\no<a> endsub\nT2 M6\no2 do\nG0 X2\no2 while [0]\nM2\n";

    #[test]
    fn entries_and_folds() {
        let scan = gr_gcode::scan(TEXT, Dialect::linuxcnc());
        let items: Vec<_> = outline(TEXT, &scan).into_iter().map(|i| (i.name, i.line, i.last_line)).collect();
        assert_eq!(items, [("face".into(), 0, 0), ("T1".into(), 1, 6), ("o<a>".into(), 2, 6), ("T2".into(), 7, 11)]);
        assert_eq!(folds(&scan), [Fold { first: 2, last: 6 }, Fold { first: 3, last: 5 }, Fold { first: 8, last: 10 }]);
    }
}
