//! The directions that `ARCHITECTURE.md` promises, read from Cargo.

use std::collections::BTreeSet;
use std::process::Command;

use gr_tests::oracle::root;

/// Everything a crate is built from, itself included (tests and build scripts aside).
fn below(krate: &str) -> BTreeSet<String> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let out = Command::new(cargo)
        .current_dir(root())
        .args(["tree", "--offline", "-p", krate, "-e", "normal", "--prefix", "none", "--format", "{p}"])
        .output()
        .expect("cargo runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8_lossy(&out.stdout).lines().filter_map(|l| l.split(' ').next()).map(String::from).collect()
}

fn forbids(krate: &str, others: &[&str]) {
    let all = below(krate);
    for other in others {
        assert!(!all.contains(*other), "{krate} depends on {other}");
    }
}

const UP: &[&str] = &["gr-driver", "gcc-robot", "gr-backends", "salsa", "ariadne", "clap", "tower-lsp-server"];

#[test]
fn the_tables_know_nobody() {
    let ours: Vec<_> = below("gr-spec").into_iter().filter(|c| c.starts_with("gr-") && c != "gr-spec").collect();
    assert!(ours.is_empty(), "gr-spec depends on {ours:?}");
}

#[test]
fn syntax_knows_neither_salsa_nor_meaning() {
    forbids("gr-text", &["gr-gcode", "gr-canon", "gr-interp", "gr-ir"]);
    forbids("gr-text", UP);
    forbids("gr-gcode", &["gr-canon", "gr-interp", "gr-ir"]);
    forbids("gr-gcode", UP);
}

#[test]
fn the_interpreter_knows_neither_salsa_nor_back_ends() {
    forbids("gr-canon", &["gr-gcode", "gr-interp", "gr-ir"]);
    forbids("gr-canon", UP);
    forbids("gr-interp", &["gr-ir"]);
    forbids("gr-interp", UP);
}

#[test]
fn motion_ir_and_back_ends_know_neither_salsa_nor_the_command() {
    forbids("gr-ir", &["gr-backends", "gr-driver", "gcc-robot", "salsa"]);
    forbids("gr-backends", &["gr-driver", "gcc-robot", "salsa"]);
}

#[test]
fn the_driver_knows_neither_command_nor_protocol() {
    forbids("gr-driver", &["gcc-robot", "clap", "ariadne", "tower-lsp-server"]);
}
