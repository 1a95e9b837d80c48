use proptest::prelude::*;

use super::Doc;

proptest! {
    #[test]
    fn nothing_fails_on_any_text(body in "[#=();,'$*.A-C0-9 \n/é]{0,80}", at in 0u32..120) {
        let text = format!("ISO-10303-21;\nDATA;\n#1=PROJECT('a',#2);{body}\nENDSEC;");
        let file = gr_p21::parse(text.as_bytes());
        let d = Doc { text: text.as_bytes(), file: &file };
        let lines = gr_text::LineIndex::new(text.as_bytes());
        let span = gr_text::Span::new(at, at + 10);
        let _ = (super::hover::hover(d, at), super::complete::complete(d, at), super::complete::signature(d, at));
        let _ = (super::outline::outline(d), super::outline::folds(d, &lines), super::outline::tokens(d, span));
        let _ = (super::hints::hints(d, span), super::lenses::lenses(d, &lines, None), super::lenses::selections(d, at));
        let _ = super::actions::actions(d, span);
        if let Some((id, _)) = super::names::name_at(d, at) {
            let _ = (super::names::occurrences(d, id), super::names::users(d, id, 10), super::names::rename(d, id, "#7"));
        }
    }
}

#[test]
fn every_meaning_is_of_an_entity() {
    for row in super::MEANINGS.lines().filter(|l| !l.starts_with('#')) {
        let (keyword, text) = row.split_once('\t').expect("two columns");
        assert!(!gr_step::schema().find(keyword).is_empty() && text.ends_with('.'), "{row}");
    }
}
