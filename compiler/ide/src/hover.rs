use gr_gcode::{Form, Scan, Word};
use gr_spec::{CodeDef, Dialect};
use gr_text::Span;

/// What stands under the cursor, explained.
#[derive(Clone, Debug, PartialEq)]
pub struct Hover {
    /// The word, in the line's text.
    pub span: Span,
    /// Markdown.
    pub text: String,
}

/// Explains what stands at byte `at` of one line.
pub fn hover(line: &str, at: u32, dialect: &'static Dialect) -> Option<Hover> {
    if let Some(found) = name_at(line, at as usize) {
        return Some(found);
    }
    let scan = gr_gcode::scan(line, dialect);
    let words = if scan.lines.is_empty() { &[][..] } else { scan.words(0) };
    let word = words.iter().find(|w| scan.word_span(line, 0, w).range().contains(&(at as usize)))?;
    let span = scan.word_span(line, 0, word);
    Some(Hover { span, text: explain(&scan, word, dialect)? })
}

fn explain(_scan: &Scan, word: &Word, dialect: &'static Dialect) -> Option<String> {
    let letter = word.letter.to_ascii_uppercase() as char;
    if matches!(letter, 'G' | 'M') && word.form == Form::Literal {
        let name = code_name(letter, word.value);
        return Some(match dialect.code(&name) {
            Some(def) => code(def, dialect),
            None => format!("**{name}**: {} has no such code.", dialect.title),
        });
    }
    let def = dialect.word(letter)?;
    let unit = if def.unit.is_empty() { String::new() } else { format!(" ({})", def.unit) };
    Some(format!("**{}** {}{unit}\n\n{}", def.letter, def.title, def.what))
}

/// `G`, 5.1 → `G5.1`
fn code_name(letter: char, value: f64) -> String {
    let tenths = (value * 10.0).round();
    if tenths % 10.0 == 0.0 { format!("{letter}{}", tenths / 10.0) } else { format!("{letter}{:.1}", tenths / 10.0) }
}

fn code(def: &CodeDef, dialect: &Dialect) -> String {
    let mut text = format!("**{}** {}\n\n{}\n", def.code, def.title, def.what);
    if !def.args.is_empty() {
        text.push_str("\n| word | |\n|---|---|\n");
        for a in def.args {
            let letters: Vec<String> = a.letters.chars().map(String::from).collect();
            let need = if a.required { " **needed**" } else { "" };
            let unit = if a.unit.is_empty() { String::new() } else { format!(" ({})", a.unit) };
            text.push_str(&format!("| {} | {}{unit}{need} |\n", letters.join(" "), a.what));
        }
    }
    if def.group != "none" && !def.group.is_empty() {
        let title = gr_spec::groups().iter().find(|g| g.slug == def.group).map_or(def.group, |g| g.title);
        text.push_str(&format!("\nModal group: {title}. "));
    }
    text.push_str(&format!("*{}*\n", if def.source.is_empty() { dialect.title } else { def.source }));
    text
}

/// A parameter, function or keyword under the cursor.
fn name_at(line: &str, at: usize) -> Option<Hover> {
    let bytes = line.as_bytes();
    // `#<_name>` or `#5220`
    if let Some(hash) = bytes.get(..=at.min(bytes.len().saturating_sub(1)))?.iter().rposition(|b| *b == b'#') {
        let rest = &line[hash + 1..];
        let (name, end) = if rest.starts_with('<') {
            let close = rest.find('>')?;
            (&rest[1..close], hash + close + 2)
        } else {
            let len = rest.bytes().take_while(u8::is_ascii_digit).count();
            (&rest[..len], hash + 1 + len)
        };
        if at < end && !name.is_empty() {
            let def = gr_spec::parameter(&name.to_ascii_lowercase())?;
            let unit = if def.unit.is_empty() { String::new() } else { format!(" ({})", def.unit) };
            let span = Span::new(hash as u32, end as u32);
            return Some(Hover { span, text: format!("**#{name}**{unit}\n\n{}", def.what) });
        }
    }
    let word = |b: &u8| b.is_ascii_alphabetic();
    if !bytes.get(at).is_some_and(word) {
        return None;
    }
    let start = at - bytes[..at].iter().rev().take_while(|b| word(b)).count();
    let end = at + bytes[at..].iter().take_while(|b| word(b)).count();
    if end - start < 2 {
        return None;
    }
    let name = line.get(start..end)?;
    let tables = [gr_spec::functions(), gr_spec::operators(), gr_spec::controls()];
    let def = tables.iter().flat_map(|t| t.iter()).find(|d| d.name.eq_ignore_ascii_case(name))?;
    Some(Hover { span: Span::new(start as u32, end as u32), text: format!("**{}**\n\n{}", def.name, def.what) })
}

#[cfg(test)]
mod tests {
    use super::hover;
    use gr_spec::Dialect;

    fn at(line: &str) -> Option<(String, String)> {
        let at = line.find('|')? as u32;
        let line = line.replace('|', "");
        let h = hover(&line, at, Dialect::linuxcnc())?;
        Some((line[h.span.range()].to_string(), h.text.lines().next()?.to_string()))
    }

    #[test]
    fn words_parameters_functions() {
        assert_eq!(at("N10 G|83 X1").map(|h| h.0).as_deref(), Some("G83"));
        assert!(at("G5.|1 X1").is_some_and(|h| h.1.starts_with("**G5.1**")));
        assert!(at("G1 F|100").is_some_and(|h| h.1.starts_with("**F**")));
        assert!(at("G1 X[SI|N[30]]").is_some_and(|h| h.1.to_uppercase().contains("SIN")));
        assert!(at("G0 X#52|20").is_some_and(|h| h.0 == "#5220"));
        assert_eq!(at("G1 X1 | "), None);
        assert_eq!(hover("", 0, Dialect::linuxcnc()), None);
    }
}
