use std::sync::Arc;

use gr_gcode::{Chunk, File};
use gr_spec::Dialect;
use proptest::prelude::*;

use super::complete::{Around, complete, signature};
use super::hover::{Facts, hover};
use super::names::{definitions, linked, name_at, occurrences, rename};
use super::{Doc, outline, tokens};

fn file(text: &str) -> File {
    // Two lines per chunk: borders must not be seen.
    let chunks = gr_gcode::split_chunks(text, 2);
    let chunk = |t: &str| Chunk { text: t.into(), scan: Arc::new(gr_gcode::scan(t, Dialect::linuxcnc())) };
    File::new("a", chunks.into_iter().map(chunk).collect())
}

fn doc(file: &File) -> Doc<'_> {
    Doc { file, dialect: Dialect::linuxcnc() }
}

const TEXT: &str = "o<a> sub\n#1 = 2\no1 if [#1]\nG1 X#1\no1 endif\no<a> endsub\n#1 = 3\no<a> call\no1 if [#1]\no1 endif\n(debug,#1)\n";

#[test]
fn local_names_stay_in_their_sub() {
    let f = file(TEXT);
    let places = |at: &str, skip: usize| {
        let offset = TEXT.match_indices(at).nth(skip).expect("there").0 as u32 + 1;
        let (name, _) = name_at(doc(&f), offset).expect("a name");
        let line = doc(&f).line_at(offset).map(|l| l.line);
        occurrences(doc(&f), &name, line).iter().map(|o| doc(&f).line_at(o.span.start).expect("a line").line).collect::<Vec<_>>()
    };
    assert_eq!(places("#1", 0), [1, 2, 3]);
    assert_eq!(places("#1 = 3", 0), [6, 8, 10]);
    assert_eq!(places("o1 if", 0), [2, 4]);
    assert_eq!(places("o1 if", 1), [8, 9]);
    assert_eq!(linked(doc(&f), TEXT.find("o1").expect("there") as u32 + 1).len(), 2);
    let call = TEXT.find("<a> call").expect("there") as u32 + 1;
    let (name, span) = name_at(doc(&f), call).expect("a name");
    assert_eq!(&TEXT[span.range()], "a");
    assert_eq!(definitions(doc(&f), &name, None).len(), 1);
    assert_eq!(rename(doc(&f), &name, None, "b").len(), 3);
}

#[test]
fn words_parameters_functions() {
    let at = |line: &str| {
        let offset = line.find('|').expect("a mark") as u32;
        let text = line.replace('|', "");
        let f = file(&text);
        let h = hover(doc(&f), offset, Facts::default())?;
        Some((text[h.span.range()].to_string(), h.text.lines().next()?.to_string()))
    };
    assert_eq!(at("N10 G|83 X1").map(|h| h.0).as_deref(), Some("G83"));
    assert!(at("G5.|1 X1").is_some_and(|h| h.1.starts_with("**G5.1**")));
    assert!(at("G1 F|100").is_some_and(|h| h.1.starts_with("**F**")));
    assert!(at("G1 X[SI|N[30]]").is_some_and(|h| h.1.to_uppercase().contains("SIN")));
    assert!(at("G0 X#52|20").is_some_and(|h| h.0 == "5220" && h.1.starts_with("**#5220**")));
    assert_eq!(at("G1 X1  | "), None);
    assert!(at("#1|01 = [#<a>]").is_some_and(|h| h.0 == "101"));
    assert_eq!(at("|"), None);
}

fn labels(text: &str) -> Vec<String> {
    let f = file(text);
    complete(doc(&f), text.len() as u32, Around::default()).into_iter().map(|c| c.label).collect()
}

#[test]
fn codes_and_parameters() {
    assert!(labels("G90 g8").contains(&"G83".to_string()));
    assert!(!labels("G90 g8").contains(&"G1".to_string()));
    assert!(!labels("G90 G9").contains(&"G91".to_string()), "a second code of a group is an error");
    assert!(labels("G1 X#<_x").contains(&"#<_x>".to_string()));
    assert!(labels("").len() > 50);
}

proptest! {
    #[test]
    fn nothing_fails_on_any_text(text in "[GMXYoN0-9.#<>\\[\\]a()%; \r\né/]{0,60}", at in 0u32..70) {
        let f = file(&text);
        let d = doc(&f);
        let mut at = (at as usize).min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        let at = at as u32;
        let _ = hover(d, at, Facts::default());
        let _ = complete(d, at, Around::default());
        let _ = signature(d, at, None);
        let _ = name_at(d, at).map(|(n, _)| (occurrences(d, &n, Some(0)), linked(d, at)));
        let _ = (outline::outline(d), outline::folds(d), outline::selections(d, at));
        for t in tokens::tokens(d, 0..100) {
            prop_assert!(text.get(t.span.range()).is_some(), "{t:?}");
        }
        for s in outline::selections(d, at).windows(2) {
            prop_assert!(s[1].start <= s[0].start && s[0].end <= s[1].end);
        }
    }
}

#[test]
fn completions_replace_the_whole_name() {
    let accepted = |marked: &str, label: &str| {
        let offset = marked.find('|').expect("a mark");
        let text = format!("o<hole> sub\no<hole> endsub\n#<depth> = 1\n{}\n", marked.replace('|', ""));
        let f = file(&text);
        let at = (text.len() - marked.len() + offset) as u32;
        let found = complete(doc(&f), at, Around::default());
        let c = found.iter().find(|c| c.label == label).unwrap_or_else(|| panic!("{label} is not offered at {marked}"));
        let mut line = text.clone();
        line.replace_range(c.replace.range(), &c.insert);
        line.lines().nth(3).unwrap_or("").to_string()
    };
    for (marked, label, becomes) in [
        ("o<ho|>", "o<hole> call", "o<hole> call"),
        ("o<ho|", "o<hole> call", "o<hole> call"),
        ("o<ho|> call [1]", "o<hole> call", "o<hole> call [1]"),
        ("o<ho|le> call [1]", "o<hole> call", "o<hole> call [1]"),
        ("G1 X#<de|pth> Y1", "#<depth>", "G1 X#<depth> Y1"),
        ("G1 X#<d|> Y1", "#<depth>", "G1 X#<depth> Y1"),
        ("#1 = |", "#<depth>", "#1 = #<depth>"),
    ] {
        assert_eq!(accepted(marked, label), becomes, "{marked}");
    }
}
