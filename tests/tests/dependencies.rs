//! The directions that `ARCHITECTURE.md` promises, read from there and from Cargo.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use gr_tests::oracle::root;

fn cargo(args: &[&str]) -> String {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let out = Command::new(cargo).current_dir(root()).args(args).output().expect("cargo runs");
    assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8_lossy(&out.stdout).into_owned()
}

/// Everything each crate of the workspace is built from (tests and build scripts aside).
fn below() -> BTreeMap<String, BTreeSet<String>> {
    let text = cargo(&["tree", "--offline", "--workspace", "-e", "normal", "--prefix", "depth", "--no-dedupe", "--format", " {p}"]);
    let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut open = String::new();
    for row in text.lines() {
        let Some((depth, name)) = row.split_once(' ') else { continue };
        let name = name.split(' ').next().unwrap_or_default().to_string();
        if depth == "0" {
            all.entry(name.clone()).or_default();
            open = name;
        } else if let Some(set) = all.get_mut(&open) {
            set.insert(name);
        }
    }
    all
}

/// The crates of the map, lowest first, and whether it says that they have nothing of salsa.
fn listed() -> Vec<(String, bool)> {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).expect("the map");
    let map = text.split("```").nth(1).expect("the list");
    let ours = |w: &&str| w.starts_with("gr-") || *w == "gcc-robot";
    let row = |l: &str| Some((l.split_whitespace().find(ours)?.to_string(), l.trim_end().ends_with("no salsa")));
    let mut rows: Vec<(String, bool)> = map.lines().filter_map(row).collect();
    // The command uses all of them, whatever its place.
    let command = rows.iter().position(|r| r.0 == "gcc-robot").expect("the command");
    let command = rows.remove(command);
    rows.push(command);
    rows
}

#[test]
fn the_map_has_every_crate() {
    let mut listed: Vec<String> = listed().into_iter().map(|r| r.0).collect();
    listed.sort();
    let ours: Vec<String> = below().into_keys().filter(|n| n != "gr-tests").collect();
    assert_eq!(listed, ours);
}

#[test]
fn no_crate_needs_one_that_comes_later() {
    let (listed, below) = (listed(), below());
    for (i, (name, _)) in listed.iter().enumerate() {
        for (later, _) in &listed[i + 1..] {
            assert!(!below[name].contains(later), "{name} depends on {later}");
        }
        assert!(!below[name].contains("gr-tests"), "{name} depends on the tests");
    }
}

#[test]
fn salsa_and_the_command_line_stay_where_they_belong() {
    let (listed, below) = (listed(), below());
    assert!(listed.iter().filter(|r| r.1).count() >= 3, "the map says who has nothing of salsa");
    let driver = listed.iter().position(|r| r.0 == "gr-driver").expect("the driver");
    for (i, (name, no_salsa)) in listed.iter().enumerate() {
        let has = |what: &str| below[name].contains(what);
        assert!(!(has("salsa") && (*no_salsa || i < driver)), "{name} depends on salsa");
        assert!(name == "gcc-robot" || !(has("clap") || has("ariadne")), "{name} knows the command line");
        assert!(name == "gcc-robot" || name == "gr-lsp" || !has("tower-lsp-server"), "{name} knows the protocol");
    }
    // The names are real.
    for (krate, what) in [("gr-driver", "salsa"), ("gcc-robot", "clap"), ("gcc-robot", "ariadne"), ("gr-lsp", "tower-lsp-server")] {
        assert!(below[krate].contains(what), "{krate} without {what}");
    }
}
