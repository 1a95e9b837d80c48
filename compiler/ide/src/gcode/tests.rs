use std::sync::Arc;

use gr_gcode::{Chunk, File, Parameter};
use gr_spec::Dialect;
use proptest::prelude::*;

use super::complete::{Around, complete, signature};
use super::hover::{Facts, hover};
use super::names::{definitions, linked, name_at, occurrences};
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
    assert_eq!(occurrences(doc(&f), &name, None).len(), 3);
}

/// A main program is called by nobody, and that is no news; one that is called, or a subprogram that nobody calls, is.
#[test]
fn calls_of_programs_by_number() {
    let fanuc = Dialect::find("fanuc-mill").expect("there");
    let told = |text: &str, elsewhere: usize| {
        let chunk = |t: &str| Chunk { text: t.into(), scan: Arc::new(gr_gcode::scan(t, fanuc)) };
        let f = File::new("a", gr_gcode::split_chunks(text, 2).into_iter().map(chunk).collect());
        let lenses = super::lenses::lenses(Doc { file: &f, dialect: fanuc }, None, &|_| elsewhere);
        lenses.into_iter().map(|l| format!("{} {}", l.line, l.text)).collect::<Vec<_>>()
    };
    let text = "%\nO1000\nM98 P2000\nM30\nO2000\nM99\nO3000\nM99\n%\n";
    assert_eq!(told(text, 0), ["4 1 call", "6 0 calls"]);
    assert_eq!(told("O2000\nM99\n", 2), ["0 2 calls"]);
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
    let first = |text: &str, n: usize| labels(text).into_iter().take(n).collect::<Vec<_>>();
    assert_eq!(first("o1 if [1]\no1 ", 3), ["elseif", "else", "endif"]);
    assert_eq!(first("o1 while [1]\n o2 if [1]\n o2 endif\nO1 ", 1), ["endwhile"]);
    assert_eq!(first("o<a> sub\no<a> endsub\no<a> ", 1), ["call"]);
}

/// A program after a proposal was accepted at the mark.
fn accepted(text: &str, label: &str) -> String {
    let at = text.find('|').expect("a mark");
    let text = text.replace('|', "");
    let f = file(&text);
    let found = complete(doc(&f), at as u32, Around::default());
    let one = found.iter().find(|c| c.label == label).unwrap_or_else(|| panic!("{label} is not proposed"));
    let mut out = text.clone();
    out.replace_range(one.replace.range(), &one.insert);
    out
}

#[test]
fn accepted_proposals_replace_the_name() {
    let sub = "o<hole> sub\no<hole> endsub\n";
    assert_eq!(accepted(&format!("{sub}o<ho|>\n"), "o<hole> call"), format!("{sub}o<hole> call\n"));
    assert_eq!(accepted(&format!("{sub}o<ho|> call [1]\n"), "o<hole> call"), format!("{sub}o<hole> call [1]\n"));
    assert_eq!(accepted(&format!("{sub}o<h|ole> call [1]\n"), "o<hole> call"), format!("{sub}o<hole> call [1]\n"));
    assert_eq!(accepted(&format!("{sub}o<|\n"), "o<hole> call"), format!("{sub}o<hole> call\n"));
    assert_eq!(accepted("o100 sub\no100 endsub\no1|00 call\n", "o100 call"), "o100 sub\no100 endsub\no100 call\n");
    assert_eq!(accepted("#<depth>=5\nG1 X#<de|pth>\n", "#<depth>"), "#<depth>=5\nG1 X#<depth>\n");
    assert_eq!(accepted("#<depth>=5\nG1 X#<d|> Y1\n", "#<depth>"), "#<depth>=5\nG1 X#<depth> Y1\n");
    assert_eq!(accepted("#<depth>=5\nG1 X#<d|Y1\n", "#<depth>"), "#<depth>=5\nG1 X#<depth>Y1\n");
    assert_eq!(accepted("#101=5\nG1 X#1|01\n", "#101"), "#101=5\nG1 X#101\n");
    assert_eq!(accepted("#<depth>=5\n(debug, it is #<|)\n", "#<depth>"), "#<depth>=5\n(debug, it is #<depth>)\n");
    assert_eq!(accepted("G1 X[S|I[30]]\n", "SIN"), "G1 X[SIN[30]]\n");
    assert_eq!(accepted("G|1 X5\n", "G2"), "G2 X5\n");
}

#[test]
fn places_of_parameters() {
    let text = "#<a>=3\no1 if [EXISTS[#<a>]]\nG0 X [ # <a> ] Y[# 101]\n(debug, #<a> and #101)\n(note #<a> #101)\no1 endif\n";
    let f = file(text);
    let of = |p: Parameter| occurrences(doc(&f), &super::names::Name::Parameter(p), None).iter().map(|o| &text[o.span.range()]).collect::<Vec<_>>();
    assert_eq!(of(Parameter::Named("a".into())), ["a"; 4]);
    assert_eq!(of(Parameter::Number(101)), ["101"; 2]);
}

#[test]
fn names_that_stay() {
    use super::names::{Name, check_new_name, objection};
    let number = |n| Name::Parameter(Parameter::Number(n));
    let named = |n: &str| Name::Parameter(Parameter::Named(n.into()));
    for (name, new) in [(number(5221), "101"), (number(101), "5221"), (number(101), "5420"), (number(101), "5"), (number(5), "101"), (named("a"), "_x"), (named("_a"), "a"), (named("_x"), "_b"), (named("a"), "_b"), (named("_ini[a]b"), "_c")] {
        assert!(check_new_name(&name, new).is_err(), "{name:?} {new}");
    }
    assert_eq!(check_new_name(&number(101), "#102").as_deref(), Ok("102"));
    let against = |text: &str, name: Name| objection(doc(&file(text)), &name, Some(0)).is_some();
    assert!(against("#102=7\nG1 X##101\n", number(102)) && !against("#102=7\nG1 X#101\n", number(102)));
    let sub = Name::Sub(gr_gcode::Label::Number(100));
    assert!(against("o100 sub\no100 endsub\no#5 call\n", sub.clone()) && !against("o100 sub\no100 endsub\n", sub));
    assert!(against("o1 sub\nG1 X#1\no1 endsub\n", number(1)) && !against("o1 sub\n#5=1\nG1 X#5\no1 endsub\n", number(5)));
}

#[test]
fn the_last_setting_is_told_when_it_is_known() {
    use super::names::last_write;
    let told = |text: &str, line: u32| last_write(doc(&file(text)), &Parameter::Number(101), line).map(|w| (w.line, w.certain));
    assert_eq!(told("#101=1\n#101=2\nG1 X#101\n", 2), Some((1, true)));
    assert_eq!(told("#101=1\n/#101=2\nG1 X#101\n", 2), None);
    assert_eq!(told("#101=1\no1 if [0]\n#101=5\no1 endif\nG1 X#101\n", 4), None);
    assert_eq!(told("#101=1\no1 if [0]\no1 endif\nG1 X#101\n", 3), Some((0, false)));
    assert_eq!(told("#101=1\no<p> call\nG1 X#101\n", 2), None);
    assert_eq!(told("#101=1\n#[#5]=2\nG1 X#101\n", 2), None);
}

fn proposed(text: &str, modal: impl Fn(&mut gr_interp::Modal)) -> Vec<(String, u8)> {
    let setup = gr_interp::Setup::default();
    let mut state = gr_interp::State::start(&setup).modal;
    modal(&mut state);
    let f = file(text);
    let around = Around { modal: Some(&state), setup: Some(&setup), ..Around::default() };
    complete(doc(&f), text.len() as u32, around).into_iter().map(|c| (c.label, c.rank)).collect()
}

#[test]
fn what_the_controller_would_refuse_is_not_proposed() {
    let has = |list: &[(String, u8)], label: &str| list.iter().any(|l| l.0 == label);
    let compensated = proposed("", |m| (m.comp_side, m.comp_radius, m.feed) = (2, 3.0, 100.0));
    for code in ["G81", "G5.1", "G28", "G18", "G42", "G33"] {
        assert!(!has(&compensated, code), "{code}");
    }
    let free = proposed("", |m| m.feed = 100.0);
    for code in ["G1", "G2", "G40", "G4", "M3", "G53"] {
        assert!(has(&compensated, code) && has(&free, code), "{code}");
    }
    for code in ["G81", "G28", "G18", "G42"] {
        assert!(has(&free, code), "{code}");
    }
    let inverse = proposed("", |m| (m.feed_mode, m.feed) = (1, 2.0));
    assert!(!has(&inverse, "G81") && has(&inverse, "G94"));
}

#[test]
fn words_that_are_needed_come_first() {
    let rank = |list: &[(String, u8)], label: &str| list.iter().find(|l| l.0 == label).map(|l| l.1);
    assert_eq!(rank(&proposed("G1 X5 ", |_| {}), "F"), Some(0));
    assert_eq!(rank(&proposed("G1 X5 ", |m| (m.feed_mode, m.feed) = (1, 3.0)), "F"), Some(0));
    assert_eq!(rank(&proposed("G1 X5 ", |m| m.feed = 100.0), "F"), Some(2));
    assert_eq!(rank(&proposed("G0 X5 ", |_| {}), "F"), Some(2));
    let empty = proposed("", |m| (m.motion, m.feed) = (10, 100.0));
    for word in ["F", "S", "T", "N", "X", "Y", "Z"] {
        assert!(rank(&empty, word).is_some(), "{word}");
    }
    let jumps = |text: &str| {
        let chunk = Chunk { text: text.into(), scan: Arc::new(gr_gcode::scan(text, Dialect::find("fanuc-mill").expect("there"))) };
        let f = File::new("a", vec![chunk]);
        let d = Doc { file: &f, dialect: Dialect::find("fanuc-mill").expect("there") };
        complete(d, text.len() as u32, Around::default()).into_iter().map(|c| c.label).collect::<Vec<_>>()
    };
    assert_eq!(jumps("N10 G21\nN20 M3\nN100 M5\nIF [#1 EQ 2] GOTO 1"), ["10", "100"]);
}

/// Each program of a Fanuc control has block numbers of its own; M99 P goes to those of the program that called.
#[test]
fn block_numbers_stay_in_their_program() {
    let dialect = Dialect::find("fanuc-mill").expect("there");
    let text = "O1\nN10 #1=1\nGOTO 20\nN20 M98 P2\nN30 M30\nO2\nN10 #1=#1+1\nIF [#1 LT 5] GOTO 10\nGOTO 20\nN20 M99 P30\nO3\nGOTO 10\nM99\n";
    let chunks = gr_gcode::split_chunks(text, 2);
    let chunk = |t: &str| Chunk { text: t.into(), scan: Arc::new(gr_gcode::scan(t, dialect)) };
    let f = File::new("a", chunks.into_iter().map(chunk).collect());
    let d = Doc { file: &f, dialect };
    let lines = |spans: Vec<gr_text::Span>| spans.iter().map(|s| d.line_at(s.start).expect("a line").line + 1).collect::<Vec<_>>();
    let at = |what: &str, nth: usize| text.match_indices(what).nth(nth).expect("there").0 as u32 + what.len() as u32;
    let asked = |offset: u32| {
        let (name, _) = name_at(d, offset).expect("a name");
        let line = d.line_at(offset).map(|l| l.line);
        let all = lines(occurrences(d, &name, line).iter().map(|o| o.span).collect());
        (lines(definitions(d, &name, line)), all, super::names::objection(d, &name, line))
    };
    assert_eq!(asked(at("N10", 0)), (vec![2], vec![2], None));
    assert_eq!(asked(at("N10", 1)), (vec![7], vec![7, 8], None));
    assert_eq!(asked(at("GOTO 10", 0)), (vec![7], vec![7, 8], None));
    assert_eq!(asked(at("GOTO 20", 0)), (vec![4], vec![3, 4], None));
    assert_eq!(asked(at("GOTO 20", 1)), (vec![10], vec![9, 10], None));
    assert_eq!(asked(at("GOTO 10", 1)), (vec![], vec![12], None));
    let may = Some("M99 in line 10 may jump to it".to_string());
    assert_eq!(asked(at("N30", 0)), (vec![5], vec![5], may.clone()));
    assert_eq!(asked(at("P30", 0)), (vec![5], vec![5, 10], may));
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

#[test]
fn comments_above_a_tool_change_belong_to_it() {
    let text = "%\n(PART 7)\nG21 G90\n\n(Face1)\nT1 M6\nG0 X0\n(Finish)\nG1 X5 F100\n(Drill1)\n(6 mm)\nM5\nT2 M6\nG0 X9\nM2\n%\n";
    let f = file(text);
    let items = outline::outline(doc(&f));
    let mut shown = String::new();
    for item in &items {
        shown += &format!("{} {:?}\n", item.name, &text[item.range.range()]);
        for child in &item.children {
            assert!(item.range.start <= child.range.start && child.range.end <= item.range.end, "{item:?}");
            shown += &format!("  {} {:?}\n", child.name, &text[child.range.range()]);
        }
    }
    insta::assert_snapshot!(shown);
}

#[test]
fn a_turret_changes_tools_by_t_alone() {
    let text = "O0001\nT0101\nG0 X5\nT0100\n(finish)\nT0303\nG0 X9\nM30\n";
    let turn = Dialect::find("fanuc-turn").expect("a dialect");
    let f = File::new("a", vec![Chunk { text: text.into(), scan: Arc::new(gr_gcode::scan(text, turn)) }]);
    let items = outline::outline(Doc { file: &f, dialect: turn });
    let names: Vec<&str> = items.iter().map(|i| i.name.as_str()).filter(|n| n.starts_with('T')).collect();
    assert_eq!(names, ["T0101", "T0303"]);
}
