//! Machine files, the project file, tool tables.

use serde_json::json;

use crate::client::{Client, tree};

const MACHINE: &str = "\
format = 1
id = \"shop/mill\"
title = \"Our mill\"
kind = \"mill\"
source = \"maker's manual, page 3\"

[kinematics]
kind = \"cartesian\"

[[joint]]
name = \"X\"
type = \"prismatic\"
word = \"X\"
min = -400
max = 400
speed = 400
";

#[test]
fn machine_files() {
    let mut c = Client::new(&[("mill.toml", MACHINE)], json!({}));
    let uri = c.open("mill.toml", None);
    let found = c.diagnostics(&uri);
    assert!(found.is_empty(), "{found:?}");
    c.edit(&uri, "min = -400", "minn = -400");
    let found = c.diagnostics(&uri);
    assert_eq!(found[0]["code"], "E0500", "{found:?}");
    assert_eq!(c.place(&uri, &found[0]["range"]), "mill.toml:14 minn");
    c.edit(&uri, "minn = -400", "min = -400");
    let h = c.hover(&uri, "ma|x = 400");
    assert!(h.starts_with("**max** (number)") && h.contains("maker's manual, page 3"), "{h}");
    c.edit(&uri, "speed = 400\n", "speed = 400\n\ntype = \"\n");
    let keys = c.labels(&uri, "speed = 400\n|\n");
    assert!(keys.contains(&"rapid".to_string()) && !keys.contains(&"min".to_string()), "{keys:?}");
    assert_eq!(c.labels(&uri, "type = \"|\n"), ["revolute", "prismatic"]);
    let symbols = c.request("textDocument/documentSymbol", json!({ "textDocument": { "uri": uri } }));
    assert_eq!(tree(&symbols, 0), "kinematics [3] 6-7\njoint (X) [3] 9-17\n");
    let folds = c.request("textDocument/foldingRange", json!({ "textDocument": { "uri": uri } }));
    assert_eq!(folds.as_array().map(Vec::len), Some(2));
    c.shut_down();
}

#[test]
fn project_files() {
    let text = "schema = 1\n[project]\nsorces = []\n";
    let mut c = Client::new(&[("gcc-robot.toml", text)], json!({}));
    let uri = c.open("gcc-robot.toml", None);
    let found = c.diagnostics(&uri);
    assert_eq!(c.place(&uri, &found[0]["range"]), "gcc-robot.toml:3 sorces");
    c.edit(&uri, "sorces = []", "sources = []\nmachine = \"generic/mi\n");
    assert!(c.labels(&uri, "machine = \"generic/mi|").contains(&"generic/mill3".to_string()));
    assert!(c.hover(&uri, "sour|ces").contains("Programs: files"));
    c.shut_down();
}

#[test]
fn a_broken_project_is_told_in_its_file() {
    let mut c = Client::new(&[("gcc-robot.toml", "schema = 1\n[project]\ntools = \"none.tbl\"\nmachine = \"klingon/1\"\n[[dialects]]\nfiles = \"*\"\ndialect = \"elvish\"\n"), ("a.ngc", "G21\nM2\n")], json!({}));
    let uri = c.open("a.ngc", None);
    let _ = c.diagnostics(&uri);
    let project = c.uri("gcc-robot.toml");
    let (_, found) = c.found.get(&project).cloned().unwrap_or_else(|| panic!("nothing is said about {project}: {:?}", c.found));
    let mut said: Vec<String> = found.as_array().expect("a list").iter().map(|d| format!("{} {}", d["severity"], c.place(&project, &d["range"]))).collect();
    said.sort();
    assert_eq!(said, ["1 gcc-robot.toml:3 \"none.tbl\"", "1 gcc-robot.toml:4 \"klingon/1\"", "1 gcc-robot.toml:7 \"elvish\""]);
    // Put right, they are taken back; the program is read all the same.
    c.write("gcc-robot.toml", "schema = 1\n");
    while c.found.get(&project).is_some_and(|f| f.1 != json!([])) {
        c.next_diagnostics(&project);
    }
    assert!(c.hover(&uri, "G|21").contains("G21"));
    c.shut_down();
}

#[test]
fn tool_tables() {
    let text = "T1 P1 D10 Z50 ;end mill\nT2 P2 D\n";
    let mut c = Client::new(&[("tools.tbl", text)], json!({}));
    let uri = c.open("tools.tbl", None);
    let found = c.diagnostics(&uri);
    assert_eq!(c.place(&uri, &found[0]["range"]), "tools.tbl:2 D");
    c.edit(&uri, "T2 P2 D\n", "T2 P2 D6 \n");
    assert!(c.diagnostics(&uri).is_empty());
    assert!(c.hover(&uri, "D1|0 Z50").contains("**T1** pocket 1, diameter 10 mm, offset Z50"));
    assert_eq!(c.labels(&uri, "T2 P2 D6 |")[0], "Z");
    let symbols = c.request("textDocument/documentSymbol", json!({ "textDocument": { "uri": uri } }));
    assert_eq!(tree(&symbols, 0), "T1 (⌀10 end mill) [14] 0-0\nT2 (⌀6 ) [14] 1-1\n");
    c.shut_down();
}

#[test]
fn programs_follow_their_tool_table() {
    let part = "G21\nT7 M6\nG43 H7\nM2\n";
    let mut c = Client::new(&[("a.ngc", part), ("tools.tbl", "T7 P7 Z10 ;old\n"), ("gcc-robot.toml", "schema = 1\n[project]\ntools = \"tools.tbl\"\n")], json!({}));
    let uri = c.open("a.ngc", None);
    assert!(c.hover(&uri, "T|7 M6").contains("old"));
    std::fs::write(c.path("tools.tbl"), "T7 P7 Z10 ;new\n").expect("written");
    let changed = c.uri("tools.tbl");
    c.notify("workspace/didChangeWatchedFiles", json!({ "changes": [{ "uri": changed, "type": 2 }] }));
    assert!(c.hover(&uri, "T|7 M6").contains("new"));
    c.shut_down();
}

#[test]
fn ini_and_parameter_files() {
    let ini = "[RS274NGC]\nPARAMETER_FILE = mill.var\n[TRAJ]\nLINEAR_UNITS = mm\n[AXIS_X]\nMIN_LIMIT = -1\n";
    let mut c = Client::new(&[("mill.ini", ini), ("mill.var", "5161\t0\n5221\t12.5\n"), ("other.ini", "[core]\nno value\n")], json!({}));
    let uri = c.open("mill.ini", None);
    assert_eq!(c.diagnostics(&uri), Vec::<serde_json::Value>::new());
    assert!(c.hover(&uri, "LINEAR|_UNITS").contains("The machine's unit of length"));
    assert!(c.hover(&uri, "MIN_|LIMIT").contains("Smallest position of the axis"));
    let symbols = c.request("textDocument/documentSymbol", json!({ "textDocument": { "uri": uri } }));
    assert_eq!(tree(&symbols, 0), "RS274NGC [3] 0-1\nTRAJ [3] 2-3\nAXIS_X [3] 4-5\n");
    c.edit(&uri, "MIN_LIMIT = -1\n", "MIN_LIMIT = -1\nMAX_\nwhat is this\n");
    let found = c.diagnostics(&uri);
    assert_eq!(found.iter().map(|d| c.place(&uri, &d["range"])).collect::<Vec<_>>(), ["mill.ini:7 MAX_", "mill.ini:8 what is this"]);
    assert_eq!(c.labels(&uri, "MAX_|\n"), ["MAX_LIMIT", "MAX_VELOCITY", "MAX_ACCELERATION"]);
    let vars = c.open("mill.var", None);
    assert_eq!(c.diagnostics(&vars), Vec::<serde_json::Value>::new());
    let told = c.hover(&vars, "52|21");
    assert!(told.starts_with("**#5221**") && told.contains("`12.5`"), "{told}");
    c.edit(&vars, "5161", "5500");
    let found = c.diagnostics(&vars);
    assert_eq!(c.place(&vars, &found[0]["range"]), "mill.var:2 5221\t12.5", "{found:?}");
    // An INI file of another program is none of ours.
    let other = c.open("other.ini", None);
    assert_eq!(c.diagnostics(&other), Vec::<serde_json::Value>::new());
    c.shut_down();
}

#[test]
fn uses_of_the_tools_of_a_table() {
    let project = "schema = 1\n[project]\ntools = \"mill.tbl\"\n";
    let other = "schema = 1\n[project]\ntools = \"../other.tbl\"\n";
    let files = [
        ("gcc-robot.toml", project),
        ("mill.tbl", "T1 P1 D6\nT2 P2 D8\n"),
        ("a.ngc", "G21\nT2 M6\nG43 H2\nT1\nM2\n"),
        ("b.ngc", "T2 M6\nM2\n"),
        ("elsewhere/gcc-robot.toml", other),
        ("elsewhere/c.ngc", "T2 M6\nM2\n"),
    ];
    let mut c = Client::new(&files, json!({}));
    let uri = c.open("mill.tbl", None);
    let mut at = c.at(&uri, "T|2 P2");
    at["context"] = json!({ "includeDeclaration": true });
    let found = c.request("textDocument/references", at);
    assert_eq!(c.places(&found), ["a.ngc:2 2", "b.ngc:1 2", "mill.tbl:2 T2 P2 D8"]);
    c.shut_down();
}
