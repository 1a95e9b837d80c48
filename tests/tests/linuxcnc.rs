//! LinuxCNC 2.9's own interpreter tests through `gcc-robot rs274`.

use gr_tests::linuxcnc::{list, run_test, sources};
use gr_tests::oracle::{missing, reference, score};

fn run_all(ours: bool) -> (usize, Vec<String>) {
    let dir = match sources() {
        Ok(dir) => dir,
        Err(why) => {
            missing(&format!("LinuxCNC's source package ({why})"));
            return (0, Vec::new());
        }
    };
    let tests = list().tests;
    let next = std::sync::atomic::AtomicUsize::new(0);
    let failed = std::sync::Mutex::new(Vec::new());
    std::thread::scope(|s| {
        for _ in 0..2 {
            s.spawn(|| {
                while let Some(name) = tests.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)) {
                    if let Err(why) = run_test(&dir, name, ours) {
                        failed.lock().expect("no panic inside").push(format!("{name}: {why}"));
                    }
                }
            });
        }
    });
    let mut failed = failed.into_inner().expect("no panic inside");
    failed.sort();
    (tests.len(), failed)
}

#[test]
fn ours_passes_them() {
    gr_tests::oracle::gcc_robot();
    let (all, failed) = run_all(true);
    let line = format!("LinuxCNC 2.9's own interpreter tests: {} of {all} pass", all - failed.len());
    println!("{line}");
    score("linuxcnc-tests", &line);
    assert!(failed.is_empty(), "{line}\n{}", failed.join("\n"));
}

/// The list holds tests that the real one passes here, so that a failure of ours is ours.
#[test]
fn the_real_one_passes_them() {
    if reference().is_none() {
        return;
    }
    let (_, failed) = run_all(false);
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// Nothing is left out in silence.
#[test]
fn every_test_that_drives_rs274_is_in_the_list() {
    let Ok(dir) = sources() else {
        missing("LinuxCNC's source package");
        return;
    };
    let list = list();
    let mut found = Vec::new();
    let mut folders = vec![dir.join("tests")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("readable") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                folders.push(path);
            } else if matches!(path.file_name().and_then(|n| n.to_str()), Some("test.sh" | "test"))
                && String::from_utf8_lossy(&std::fs::read(&path).expect("readable")).contains("rs274")
            {
                let name = folder.strip_prefix(dir.join("tests")).expect("below it").display().to_string();
                found.push(name);
            }
        }
    }
    found.sort();
    found.dedup();
    let known: Vec<&str> =
        list.tests.iter().map(|t| t.as_str()).chain(list.excluded.iter().map(|(t, _)| t.as_str())).collect();
    let unknown: Vec<_> = found.iter().filter(|f| !known.contains(&f.as_str())).collect();
    assert!(unknown.is_empty(), "not in the list: {unknown:?}");
    for (name, reason) in &list.excluded {
        assert!(reason.len() > 10, "{name}: why?");
    }
    assert_eq!(found.len(), known.len(), "the list names folders that are not there");
}
