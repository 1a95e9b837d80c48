//! Random valid programs beside the real `rs274`: 10 000 where `CI` is set, some hundreds elsewhere; the same on every
//! machine. A failure is shrunk and written to `target/test-data/random`; mended, it goes to `corpus/regressions`.

use std::sync::atomic::{AtomicUsize, Ordering};

use gr_tests::oracle::{Job, Verdict, compare, differ, kept, message, normalised, reference, score};
use gr_tests::random::{programs, tools, write};
use proptest::test_runner::{Config, RngAlgorithm, TestError, TestRng, TestRunner};

fn wanted() -> u32 {
    let set = std::env::var("GCC_ROBOT_RANDOM_PROGRAMS").ok().and_then(|n| n.parse().ok());
    set.unwrap_or(if std::env::var_os("CI").is_some() { 10_000 } else { 600 })
}

/// A tenth of the programs also goes through with block delete, a third with a tool table of its own.
fn job(text: String) -> Job {
    let mut job = Job::new(text);
    if job.program.len() % 3 == 0 {
        job.tools = Some(tools(u32::try_from(job.program.len()).unwrap_or(0)));
    }
    if job.program.len() % 10 == 0 {
        job.options = vec!["-b".into()];
    }
    job
}

/// Programs come from so many seeds, whatever number of cores runs them.
const SHARDS: usize = 8;

fn runner(cases: u32, seed: u8) -> TestRunner {
    let config = Config { cases, failure_persistence: None, max_shrink_iters: 400, ..Config::default() };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]))
}

#[test]
fn random_programs() {
    let Some(rs274) = reference() else { return };
    let start = std::time::Instant::now();
    let threads = std::thread::available_parallelism().map_or(2, |n| n.get()).min(SHARDS);
    let seed: u8 = std::env::var("GCC_ROBOT_RANDOM_SEED").ok().and_then(|n| n.parse().ok()).unwrap_or(29);
    let (next, run) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let failures = std::sync::Mutex::new(Vec::new());
    gr_tests::oracle::gcc_robot();
    std::thread::scope(|s| {
        for _ in 0..threads {
            s.spawn(|| {
                loop {
                    let shard = next.fetch_add(1, Ordering::Relaxed);
                    if shard >= SHARDS {
                        return;
                    }
                    let mut runner = runner(wanted().div_ceil(SHARDS as u32), seed.wrapping_add(shard as u8));
                    let result = runner.run(&programs(), |steps| {
                        run.fetch_add(1, Ordering::Relaxed);
                        match differ(&job(write(&steps)), &rs274) {
                            Verdict::Same => Ok(()),
                            other => Err(proptest::test_runner::TestCaseError::fail(format!("{other:?}"))),
                        }
                    });
                    let failure = match result {
                        Ok(()) => continue,
                        Err(TestError::Fail(why, steps)) => (shard, why.message().to_string(), write(&steps)),
                        Err(TestError::Abort(why)) => (shard, why.message().to_string(), String::new()),
                    };
                    failures.lock().expect("no panic inside").push(failure);
                }
            });
        }
    });
    let mut failures = failures.into_inner().expect("no panic inside");
    failures.sort();
    let line = format!(
        "random programs: {} run, {} differ, {:.0} s",
        run.load(Ordering::Relaxed),
        failures.len(),
        start.elapsed().as_secs_f64()
    );
    score("random", &line);
    println!("{line}");
    let mut report = String::new();
    for (_, why, text) in &failures {
        let name = format!("random-{:08x}.ngc", text.bytes().fold(0x811c_9dc5_u32, |h, b| (h ^ u32::from(b)).wrapping_mul(0x0100_0193)));
        let path = kept("random").join(name);
        let _ = std::fs::write(&path, text);
        let _ = std::fs::write(path.with_extension("tbl"), job(text.clone()).tools.unwrap_or_default());
        report.push_str(&format!("\n{}: {why}\n{text}\n", path.display()));
    }
    assert!(failures.is_empty(), "{line}\n{report}");
}

/// The generator is worth its time: most of its programs are accepted.
#[test]
fn most_random_programs_are_valid() {
    let Some(rs274) = reference() else { return };
    let mut runner = runner(150, 7);
    let (all, accepted) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let reasons = std::sync::Mutex::new(std::collections::BTreeMap::<String, usize>::new());
    runner
        .run(&programs(), |steps| {
            all.fetch_add(1, Ordering::Relaxed);
            let out = job(write(&steps)).reference(&rs274);
            if out.ok() {
                accepted.fetch_add(1, Ordering::Relaxed);
            } else {
                let key = message(&out.ended.errors());
                *reasons.lock().expect("no panic inside").entry(key).or_default() += 1;
            }
            Ok(())
        })
        .expect("nothing fails here");
    let (all, accepted) = (all.into_inner(), accepted.into_inner());
    println!("{accepted} of {all} accepted; refused: {:#?}", reasons.lock().expect("no panic inside"));
    assert!(accepted * 10 >= all * 6, "{accepted} of {all}");
}

/// The comparison itself finds what it must find.
#[test]
fn the_comparison_sees_differences() {
    let n = |s: &str| normalised(s);
    let line = "    1 N..... STRAIGHT_FEED(1.0000, -0.0000, 0.0000, 0.0000, 0.0000, 0.0000)\n";
    assert_eq!(compare(&n(line), &n(&line.replace("-0.0000", "0.0000").replace("    1", "    7"))), Verdict::Same);
    assert!(matches!(compare(&n(line), &n(&line.replace("1.0000", "1.0001"))), Verdict::Differs(_)));
    assert!(matches!(compare(&n(line), &n("")), Verdict::Differs(_)));
    assert!(matches!(compare(&n(line), &n(&line.replace("FEED", "TRAVERSE"))), Verdict::Differs(_)));
}
