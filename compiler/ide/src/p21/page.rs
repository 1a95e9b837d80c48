//! The page of an entity of ISO 14649: where names in exchange files lead to, and what `gcc-robot explain` prints.

use gr_step::{Type, schema};

use super::{Units, meaning, unit, words};

/// Markdown about the entities of this name; none when the standard has none.
pub fn page(name: &str) -> Option<String> {
    let keyword = name.trim().to_ascii_uppercase();
    let rows: Vec<_> = schema().find(&keyword).iter().map(|e| schema().entity(*e)).collect();
    let first = rows.first()?;
    let mut text = format!("# {keyword}\n\n{}: ", words(&keyword));
    let what = meaning(&keyword);
    text.push_str(if what.is_empty() { "an entity of the standard.\n" } else { what });
    text.push('\n');
    if first.is_abstract {
        text.push_str("\nAbstract: only entities of its kind have instances.\n");
    }
    for row in &rows {
        let kinds: Vec<String> = row.supertypes().map(str::to_uppercase).collect();
        if !kinds.is_empty() {
            text.push_str(&format!("\nA kind of {}.\n", kinds.join(", ")));
        }
        let part = if row.edition.part == "10303" { "ISO 10303 resources".to_string() } else { format!("ISO 14649-{}", row.edition.part) };
        text.push_str(&format!("\nAttributes in {part} ({}), in the order in which they are written:\n\n", row.edition.text));
        for (n, a) in row.attributes().iter().enumerate() {
            text.push_str(&format!("{}. {}", n + 1, attribute(a)));
        }
        if row.attributes().is_empty() {
            text.push_str("none\n");
        }
    }
    let below: Vec<&str> = schema().entities.iter().filter(|e| e.supertypes().any(|s| s.eq_ignore_ascii_case(&keyword))).map(|e| e.keyword).collect();
    if !below.is_empty() {
        text.push_str(&format!("\nKinds of it: {}.\n", below.join(", ")));
    }
    let rules = gr_step::rules_of_entity(&keyword);
    if !rules.is_empty() {
        text.push_str("\nRules of the standard:\n\n");
        rules.iter().for_each(|r| text.push_str(&format!("- {}.{}: {}\n", r.entity, r.label, r.says)));
    }
    Some(text)
}

fn attribute(a: &gr_step::Attribute) -> String {
    let unit = unit(a, Units::Iso);
    let unit = if unit.is_empty() { String::new() } else { format!(", {unit}") };
    let optional = if a.optional { ", optional" } else { "" };
    let choices = match &a.ty {
        Type::Enumeration(names) => format!(": {}", names.iter().map(|n| format!("`.{}.`", n.to_uppercase())).collect::<Vec<_>>().join(" ")),
        _ => String::new(),
    };
    format!("`{}` {}{unit}{optional}{choices}\n", a.name, a.written)
}

/// The name of an entity that stands around a column of a line.
pub fn name_at(line: &str, column: usize) -> Option<(&'static str, std::ops::Range<usize>)> {
    let bytes = line.as_bytes();
    let part = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
    let from = column - bytes.get(..column)?.iter().rev().take_while(|b| part(b)).count();
    let to = column + bytes.get(column..)?.iter().take_while(|b| part(b)).count();
    // Between apostrophes it is a word of a string.
    if bytes[..from].iter().filter(|b| **b == b'\'').count() % 2 == 1 {
        return None;
    }
    let keyword = line.get(from..to)?.to_ascii_uppercase();
    let row = schema().entity(*schema().find(&keyword).first()?);
    Some((row.keyword, from..to))
}

#[cfg(test)]
mod tests {
    #[test]
    fn pages_and_names() {
        insta::assert_snapshot!(super::page("milling_technology").expect("an entity"));
        assert!(super::page("nothing").is_none() && super::page("").is_none());
        let line = "#31=MILLING_TECHNOLOGY('PLANE_MILLING',$);";
        assert_eq!(super::name_at(line, 10), Some(("MILLING_TECHNOLOGY", 4..22)));
        assert_eq!(super::name_at(line, 26), None);
        assert_eq!(super::name_at(line, 2), None);
        assert_eq!(super::name_at("é", 2), None);
    }
}
