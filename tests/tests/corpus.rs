//! The project's own programs beside the real `rs274`: accepted ones, one-fault programs, and what once differed.
//!
//! A program's tools are the corpus' table, or `NAME.tbl` beside it; `NAME.ini` is its INI file and `NAME.var` its
//! parameters. Programs in `subs/` can be called by all.

use std::path::{Path, PathBuf};

use std::process::Command;
use std::time::Duration;

use gr_tests::oracle::{Job, gcc_robot, must_agree, reference, root};
use gr_tests::process::{Ended, run_fed};

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

/// Which values of the INI file the controller takes, and what a switch that is on does.
#[test]
fn values_of_the_ini_file() {
    let programs = [
        ("[EMCIO]\nTOOL_CHANGE_QUILL_UP", "g0 z-3\nt1 m6\nm2\n"),
        ("[EMCIO]\nTOOL_CHANGE_AT_G30", "g0 x1 z-3\nt1 m6\nm2\n"),
        ("[EMCIO]\nTOOL_CHANGE_WITH_SPINDLE_ON", "m3 s100\nt1 m6\nm2\n"),
        ("[EMCIO]\nRANDOM_TOOLCHANGER", "t1 m6\ng43\nt2 m6\nm2\n"),
        ("[RS274NGC]\nRETAIN_G43", "t1 m6 g43 h1\ng0 x1 z1\nt3 m6\ng0 x2\ng49\ng0 z2\ng43.1 z2\ng0 z3\nm3 s5 x2 z4\nm2\n"),
        ("[RS274NGC]\nOWORD_NARGS", "o<a> sub\ng0 x#<n_args>\no<a> endsub\no<a> call [1] [2]\nm2\n"),
        ("[RS274NGC]\nINI_VARS", "g0 x[exists[#<_ini[rs274ngc]ini_vars>]]\nm2\n"),
        ("[RS274NGC]\nDISABLE_FANUC_STYLE_SUB", "m98 p1\nm2\no1\ng0 x1\nm99\n"),
        ("[RS274NGC]\nDISABLE_G92_PERSISTENCE", "g92 x1\ng0 x3\nm2\n"),
        ("[RS274NGC]\nORIENT_OFFSET", "m19 r10\nm2\n"),
        ("[RS274NGC]\nCENTER_ARC_RADIUS_TOLERANCE_INCH", "g20 g0 x0 y0\ng2 x2.001 y0 i1 f10\nm2\n"),
        ("[TRAJ]\nSPINDLES", "m3 s1\nm3 s2 $1\nm5\nm2\n"),
        ("[AXIS_A]\nWRAPPED_ROTARY", "g0 a90\ng91 g0 a300\nm2\n"),
        ("[AXIS_A]\nLOCKING_INDEXER_JOINT", "g0 a90\nm2\n"),
    ];
    let values = ["1", "0", "2", "01", "-1", "+1", "TRUE", "yes", "1 # x", "1.0", "0x1", ".001", "1e-3", "", "7 8"];
    let mut jobs = Vec::new();
    for (key, program) in programs {
        // Without any of eight spindles the controller reads memory that is not its own.
        for value in values.iter().filter(|v| !(key.ends_with("SPINDLES") && matches!(**v, "0" | "-1"))) {
            let mut job = Job::new(program);
            job.ini = Some(format!("{key} = {value}\n"));
            jobs.push((format!("{key} = {value}").replace('\n', " "), job));
        }
    }
    must_agree("values of INI files", &jobs);
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
    jobs.extend(self::jobs("regressions").into_iter().filter(|(name, _)| name.starts_with("o-percent")));
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

/// Lines from standard input, and what both say of each: standard output, standard error and exit status.
#[test]
fn lines_by_hand() {
    const SUB: &str = "o<b> sub\ng0 x1\no<b> endsub\nm2\n";
    const INPUTS: [&str; 16] = [
        "g0 x1\n/ g0 x2\ng0 x3\n",
        "f100\ny2 g5\ng5 x1\ng89 z-1 r2\ng82 z-1 r2\ng1 x5\n",
        // A call is begun, and the lines after it are the subroutine's.
        "o<b> call\ng0 x9\ng77\n",
        "o<b> call\no<b> sub\ng0 x3\no<b> endsub\ng0 x4\n",
        "o<nowhere> call\ng0 x9\n",
        "o1 sub\ng0 x1\no1 endsub\no1 call\ng0 x2\no1 endsub\ng0 x3\n",
        "m98 p1\ng0 x9\no1\ng0 x2\nm99\ng0 x3\n",
        "m98 p1 l3\ng77\n",
        "#1=3\no<b> call [5]\n(print,#1)\n",
        "o1 if [0]\ng0 x1\no1 endif\ng0 x2\n",
        "o1 repeat [2]\ng0 x1\no1 endrepeat\ng0 x2\n",
        "o1 return\no1 break\nm99\no1\ng0 x2\n",
        "s100u\nu\nu[1\nx1 y u\nx1x1 u\nm98 u\nw-\n",
        "g0 x[1\ng0 x1\nn#1 m98\ng0 x2\n",
        "g1 x1\nf10\ng1 x1\nm2\ng0 x2\n",
        "quit\ng0 x1\n",
    ];
    let Some(rs274) = reference() else { return };
    for input in INPUTS {
        for options in [&["-g"][..], &["-g", "-b"]] {
            let by_hand = |command: &mut Command| -> Ended {
                let dir = tempfile::tempdir().expect("a temporary folder");
                std::fs::write(dir.path().join("b.ngc"), SUB).expect("writable");
                std::fs::write(dir.path().join("input"), input).expect("writable");
                let fed = std::fs::File::open(dir.path().join("input")).expect("readable");
                command.current_dir(dir.path()).env("HOME", dir.path()).env("LC_ALL", "C").args(options);
                run_fed(command, fed, Duration::from_secs(20)).expect("the program starts")
            };
            let (theirs, ours) = (by_hand(&mut Command::new(&rs274)), by_hand(Command::new(gcc_robot()).arg("rs274")));
            assert_eq!((ours.output(), ours.errors(), ours.status), (theirs.output(), theirs.errors(), theirs.status), "{input}");
        }
    }
}

/// What `-n` says for other numbers, and remarks on the INI file.
#[test]
fn options_and_remarks() {
    let Some(rs274) = reference() else { return };
    for n in ["0", "2", "3", "-1", "02", "x"] {
        let mut job = Job::new("g0 x1\ng1 x2\ng0 x3\ng77\ng0 x4\nm2\n");
        job.options = vec!["-n".into(), n.into()];
        must_agree("options", &[(n.to_string(), job)]);
    }
    for value in ["0.5", "0.02", "0.0001", "abc", "", "0.01 # mm", "-1"] {
        let mut job = Job::new("g21 g2 x10 i5.0201 f100\nm2\n");
        job.ini = Some(format!("[RS274NGC]\nCENTER_ARC_RADIUS_TOLERANCE_MM = {value}\nCENTER_ARC_RADIUS_TOLERANCE_INCH = {value}\n"));
        let (theirs, ours) = (job.reference(&rs274), job.ours());
        assert_eq!((ours.canon, ours.ended.errors(), ours.ended.status), (theirs.canon, theirs.ended.errors(), theirs.ended.status), "{value}");
    }
}
