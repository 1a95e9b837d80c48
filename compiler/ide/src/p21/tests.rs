use proptest::prelude::*;

use super::Doc;

proptest! {
    #[test]
    fn nothing_fails_on_any_text(body in "[#=();,'$*.A-C0-9 \n/é]{0,80}", at in 0u32..120) {
        let text = format!("ISO-10303-21;\nDATA;\n#1=PROJECT('a',#2);{body}\nENDSEC;");
        let file = gr_p21::parse(text.as_bytes());
        let d = Doc { text: text.as_bytes(), file: &file, units: super::Units::default() };
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

#[test]
fn units_are_those_of_the_file() {
    let text = "ISO-10303-21;\nDATA;\n#31=MILLING_TECHNOLOGY(0.24,.TCP.,$,-9000.,$,.F.,.F.,.F.,$);\nENDSEC;";
    let file = gr_p21::parse(text.as_bytes());
    let at = |what: &str| text.find(what).expect("there") as u32;
    let told = |units, what: &str| super::hover::hover(Doc { text: text.as_bytes(), file: &file, units }, at(what)).map(|h| h.text).unwrap_or_default();
    assert!(told(super::Units::Iso, "0.24").contains("0.24 m/s = 14400 mm/min"));
    assert!(told(super::Units::StepModeler, "0.24").contains("0.24 mm per revolution"));
    assert!(told(super::Units::StepModeler, "-9000").contains("9000 rpm, clockwise"));
    let hints = super::hints::hints(Doc { text: text.as_bytes(), file: &file, units: super::Units::StepModeler }, gr_text::Span::new(0, text.len() as u32));
    assert!(hints.iter().any(|h| h.text == " rpm") && hints.iter().all(|h| h.text != " 1/s"));
    let both = told(super::Units::Open, "-9000");
    assert!(both.contains("-9000 1/s = 540000 rpm") && both.contains("9000 rpm, clockwise") && both.contains("step-units"), "{both}");
    let hints = super::hints::hints(Doc { text: text.as_bytes(), file: &file, units: super::Units::Open }, gr_text::Span::new(0, text.len() as u32));
    assert!(hints.iter().any(|h| h.text == " 1/s or rpm"));
}
