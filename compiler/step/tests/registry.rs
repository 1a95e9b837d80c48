//! Every row of the registry whose examples are exchange files: the bad one raises exactly its code, the good
//! one nothing.

mod examples;

use examples::{codes, file};
use gr_spec::Code;

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
