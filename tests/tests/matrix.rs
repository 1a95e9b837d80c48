//! Each code under every plane, unit, distance mode and compensation, beside the real `rs274`.

use gr_tests::matrix::programs;
use gr_tests::oracle::{Job, must_agree};

#[test]
fn every_code_in_every_mode() {
    let jobs: Vec<_> = programs().into_iter().map(|(name, text)| (format!("{name}\n{text}"), Job::new(text))).collect();
    must_agree("matrix", &jobs);
}
