//! The project's own programs beside the real `rs274`: accepted ones, one-fault programs, and what once differed.
//!
//! A program's tools are the corpus' table, or `NAME.tbl` beside it; `NAME.ini` is its INI file and `NAME.var` its
//! parameters. Programs in `subs/` can be called by all.

use std::path::{Path, PathBuf};

use gr_tests::oracle::{Job, must_agree, root};

fn files(dir: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(dir)
        .map(|entries| entries.filter_map(|e| Some(e.ok()?.path())).collect())
        .unwrap_or_default();
    files.retain(|f| f.extension().is_some_and(|e| e == "ngc"));
    files.sort();
    files
}

fn jobs(folder: &str) -> Vec<(String, Job)> {
    let corpus = root().join("tests/corpus");
    let subs: Vec<(String, Vec<u8>)> = files(&corpus.join("subs"))
        .into_iter()
        .map(|f| {
            let name = f.file_name().and_then(|n| n.to_str()).expect("plain names").to_string();
            (name, std::fs::read(&f).expect("readable"))
        })
        .collect();
    files(&corpus.join(folder))
        .into_iter()
        .map(|file| {
            let mut job = Job::new(std::fs::read(&file).expect("readable"));
            let beside = |e: &str| std::fs::read_to_string(file.with_extension(e)).ok();
            if let Some(tools) = beside("tbl") {
                job.tools = Some(tools);
            }
            job.params = beside("var");
            job.ini = beside("ini");
            if job.ini.is_some() {
                job.files = subs.clone();
            }
            (file.file_stem().and_then(|n| n.to_str()).unwrap_or_default().to_string(), job)
        })
        .collect()
}

#[test]
fn accepted_programs() {
    let jobs = jobs("accepted");
    assert!(jobs.len() > 40, "the corpus is there");
    must_agree("corpus", &jobs);
}

#[test]
fn one_fault_programs() {
    let mut jobs = jobs("errors");
    for (name, job) in &mut jobs {
        job.endless = name == "endless";
    }
    assert!(jobs.len() > 300, "the corpus is there");
    must_agree("error corpus", &jobs);
}

#[test]
fn regressions() {
    let jobs = jobs("regressions");
    assert!(jobs.len() >= 4, "the corpus is there");
    must_agree("regressions", &jobs);
}

/// With block delete on, lines that begin with `/` are left out.
#[test]
fn accepted_programs_with_block_delete() {
    let mut jobs = jobs("accepted");
    for (_, job) in &mut jobs {
        job.options = vec!["-b".into()];
    }
    must_agree("corpus with block delete", &jobs);
}

/// After an error rs274 goes on with the next line when it is told to.
#[test]
fn one_fault_programs_going_on() {
    // Told to go on, the real one goes round for ever in these (a missing end); ours ends.
    const ENDLESS: [&str; 8] = ["comp-arc-straight", "endless", "no-end", "no-end-percent", "o-eof", "o-sub-eof", "o-while-eof", "percent-only"];
    let mut jobs = jobs("errors");
    // Here the failing line is read again and again; ours goes on behind it, to the end.
    jobs.retain(|(name, _)| name != "name-readonly");
    for (name, job) in &mut jobs {
        job.endless = ENDLESS.contains(&name.as_str());
        job.options = vec!["-n".into(), "0".into()];
    }
    must_agree("error corpus, going on", &jobs);
}

/// The parameter file that a run leaves.
#[test]
fn parameter_files_agree() {
    let Some(rs274) = gr_tests::oracle::reference() else { return };
    let mut wrong = Vec::new();
    for (name, mut job) in jobs("accepted") {
        job.params.get_or_insert_with(|| "5161\t0.0\n".into());
        let (a, b) = (job.reference(&rs274), job.ours());
        if a.params != b.params {
            let line = a.params.lines().zip(b.params.lines()).find(|(a, b)| a != b);
            wrong.push(format!("{name}: {line:?}"));
        }
    }
    assert!(wrong.is_empty(), "{} differ\n{}", wrong.len(), wrong.join("\n"));
}
