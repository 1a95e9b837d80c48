//! Each code under every plane, unit, distance mode and compensation, beside the real `rs274`.

use gr_tests::matrix::programs;
use gr_tests::oracle::{Job, must_agree};

#[test]
fn every_code_in_every_mode() {
    let jobs: Vec<_> = programs().into_iter().map(|(name, text)| (format!("{name}\n{text}"), Job::new(text))).collect();
    must_agree("matrix", &jobs);
}

/// Which programs of the matrix the real one accepts: a combination that is always refused covers nothing.
#[test]
fn each_program_is_accepted_somewhere() {
    let Some(rs274) = gr_tests::oracle::reference() else { return };
    let mut names = std::collections::BTreeMap::new();
    for (name, text) in programs() {
        let body = name.split("-G1").next().unwrap_or_default().to_string();
        if !(name.ends_with("G90-G40") || name.ends_with("G91-G40")) {
            continue;
        }
        let out = Job::new(text).reference(&rs274);
        let row: &mut (u32, String) = names.entry(body).or_default();
        if out.ok() {
            row.0 += 1;
        } else {
            row.1 = gr_tests::oracle::message(&out.ended.errors());
        }
    }
    for (name, (accepted, why)) in &names {
        println!("{name:24} {accepted:3} {why}");
    }
    let never: Vec<_> = names.iter().filter(|(n, r)| r.0 == 0 && n.as_str() != "G74").collect();
    assert!(never.is_empty(), "never accepted: {never:?}");
}
