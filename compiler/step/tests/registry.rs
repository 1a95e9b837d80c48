//! Every row of the registry whose examples are exchange files: the bad one raises exactly its code, the good
//! one nothing.

mod examples;

use examples::{codes, file};
use gr_spec::Code;
use gr_text::FileId;

#[test]
fn bad_examples_raise_exactly_their_code_and_good_ones_nothing() {
    let mut wrong = Vec::new();
    let rows: Vec<Code> = Code::all()
        .filter(|c| c.def().dialect == Some("part21") && (c.def().slug.starts_with("p21/") || c.def().slug.starts_with("step/")))
        .collect();
    assert!(rows.len() > 50, "{}", rows.len());
    for code in rows {
        let def = code.def();
        let (bad, good) = (def.bad.expect("a bad example"), def.good.expect("a good example"));
        let found = codes(&file(bad), def.code);
        if found != [def.code] {
            wrong.push(format!("{} {}: the bad example raises {found:?}", def.code, def.slug));
        }
        let found = codes(&file(good), def.code);
        if !found.is_empty() {
            wrong.push(format!("{} {}: the good example raises {found:?}", def.code, def.slug));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Rows whose finding can be mended by an edit: one of the edits takes the finding away and brings no error. (Of several
/// readings of a number not all need to be sensible.)
#[test]
fn fixes_mend_what_they_are_offered_for() {
    let mut mended = Vec::new();
    for code in Code::all().filter(|c| c.def().dialect == Some("part21")) {
        let text = file(code.def().bad.unwrap_or_default());
        let found = gr_step::diagnostics(&text, FileId(0));
        let tell = |all: &[gr_text::Diagnostic]| {
            let errors = all.iter().filter(|d| d.severity == gr_spec::Severity::Error).count();
            (all.iter().filter(|d| d.code == code).count(), errors)
        };
        let (count, errors) = tell(&found);
        for d in found.iter().filter(|d| d.code == code && !d.fixes.is_empty()) {
            let after = |fix: &gr_text::Fix| {
                let mut new = text.clone();
                for (_, span, with) in fix.edits.iter().rev() {
                    new.replace_range(span.start as usize..span.end as usize, with);
                }
                tell(&gr_step::diagnostics(&new, FileId(0)))
            };
            let told: Vec<(usize, usize)> = d.fixes.iter().map(after).collect();
            assert!(told.iter().any(|t| t.0 < count && t.1 <= errors), "{}: {:#?} leave {told:?} of {count}, {errors}", code.def().code, d.fixes);
            mended.push(code.def().code);
        }
    }
    mended.dedup();
    let all = "E0304 E0307 E0308 E0309 E0311 E0312 E0313 E0317 E0323 E0401 E0402 E0405 E0408 E0411 E0423 E0424 E0425 E0426 E0428 E0429 E0430 E0431 E0439 E0477";
    assert_eq!(mended.join(" "), all);
}
