//! G-code.

use serde_json::{Value, json};

use crate::client::{Client, apply, tree, with_hints};

pub const PART: &str = "\
(--- part of the tests)
G21 G17 G90 G40 G49
#<depth> = 2
#101 = [#<depth> * 3]
T1 M6 (end mill)
S3000 M3
G43 H1
G0 X0 Y0 Z5
(--- slot)
G1 Z-#<depth> F300
X10
G2 X20 Y10 I0 J10 F600
G3 X10 Y20 R10
G91
G1 X-5
G90
o<hole> sub
  G0 X#1 Y#2
  G81 Z-5 R1 F100
  G80
o<hole> endsub
T2 M6 (drill)
S2000 M3
G43 H2
G0 Z20
o<hole> call [30] [40]
o<hole> call [50] [#101]
o100 if [#101 GT 5]
  G0 Z20
o100 endif
M5 M9
M2
";

pub const TABLE: &str = "T1 P1 D10 Z50 ;end mill ten\nT2 P2 D5 Z60.5 ;drill five\n";
pub const PROJECT: &str = "schema = 1\n\n[project]\nsources = [\"*.ngc\"]\ntools = \"tools.tbl\"\n";

pub fn part() -> (Client, String) {
    let mut c = Client::new(&[("part.ngc", PART), ("tools.tbl", TABLE), ("gcc-robot.toml", PROJECT)], json!({}));
    let uri = c.open("part.ngc", None);
    (c, uri)
}

fn whole(c: &Client, uri: &str) -> Value {
    json!({ "textDocument": { "uri": uri }, "range": { "start": { "line": 0, "character": 0 }, "end": { "line": c.text(uri).lines().count(), "character": 0 } } })
}

#[test]
fn diagnostics_are_pushed_and_follow_edits() {
    let (mut c, uri) = part();
    let errors = |found: &[Value]| found.iter().filter(|d| d["severity"] == 1).map(|d| d["code"].as_str().unwrap_or("").to_string()).collect::<Vec<_>>();
    let found = c.diagnostics(&uri);
    assert_eq!(errors(&found), [""; 0], "{found:?}");
    c.edit(&uri, "I0 J10", "I0 J9");
    let found = c.diagnostics(&uri);
    assert_eq!(errors(&found), ["E0203"]);
    let arc = found.iter().find(|d| d["code"] == "E0203").expect("the arc");
    assert_eq!(c.place(&uri, &arc["range"]), "part.ngc:12 I0 J9");
    assert!(arc["message"].as_str().is_some_and(|m| m.contains("radius")), "{arc}");
    assert_eq!(arc["data"]["slug"], "arc/radius-mismatch");
    c.edit(&uri, "I0 J9", "I0 J10");
    assert_eq!(errors(&c.diagnostics(&uri)), [""; 0]);
    c.notify("textDocument/didClose", json!({ "textDocument": { "uri": uri } }));
    c.shut_down();
}

#[test]
fn diagnostics_are_pulled() {
    let (mut c, uri) = part();
    c.edit(&uri, "R10", "R1");
    let document = json!({ "textDocument": { "uri": uri } });
    let report = c.request("textDocument/diagnostic", document.clone());
    assert_eq!(report["kind"], "full");
    assert!(report["items"].as_array().is_some_and(|i| i.iter().any(|d| d["code"] == "E0263")), "{report}");
    let mut again = document;
    again["previousResultId"] = report["resultId"].clone();
    assert_eq!(c.request("textDocument/diagnostic", again)["kind"], "unchanged");
    c.shut_down();
}

#[test]
fn hover_words_blocks_parameters_tools() {
    let (mut c, uri) = part();
    let mut all = String::new();
    for at in ["G2| X20", "G1 Z-#<de|pth> F300", "#1|01 = [", "T|1 M6", "F6|00", "G8|1 Z-5", "o100 i|f", "#101 G|T 5", "X-|5\n", "M|2\n", "(--- s|lot)"] {
        all += &format!("=== {at}\n{}\n", c.hover(&uri, at));
    }
    insta::assert_snapshot!(all);
    c.shut_down();
}

#[test]
fn inlay_hints_and_their_switches() {
    let (mut c, uri) = part();
    let range = whole(&c, &uri);
    let hints = c.request("textDocument/inlayHint", range.clone());
    insta::assert_snapshot!(with_hints(PART, &hints));
    // Each kind can be switched off.
    c.settings = json!({ "hints": { "motion": false, "position": "off", "feed": false, "modes": false, "time": false, "arc": false, "values": false } });
    c.notify("workspace/didChangeConfiguration", json!({ "settings": {} }));
    c.wait_for("workspace/inlayHint/refresh");
    assert_eq!(c.request("textDocument/inlayHint", range.clone()), json!([]));
    c.settings = json!({ "hints": { "motion": false, "position": "all", "feed": false, "modes": false, "time": false, "arc": false, "values": false } });
    c.asked.clear();
    c.notify("workspace/didChangeConfiguration", json!({ "settings": {} }));
    c.wait_for("workspace/inlayHint/refresh");
    let all = c.request("textDocument/inlayHint", range).to_string();
    assert!(all.contains("→ X20 Y10") && !all.contains("R10"), "{all}");
    c.shut_down();
}

#[test]
fn completion_knows_the_modal_state() {
    let (mut c, uri) = part();
    let has = |list: &[String], label: &str| list.iter().any(|l| l == label);
    c.edit(&uri, "G80\n", "G80\n  \n  G83 Z-5 \n  T\n  G1 X#<\n  G1 X[S\n  o<ho\n  (M\n");
    let codes = c.labels(&uri, "G80\n  |\n");
    assert!(has(&codes, "G1") && has(&codes, "M3") && has(&codes, "G83 X Y Z R Q"), "{codes:?}");
    // What G83 still needs comes first; no second motion code.
    let words = c.labels(&uri, "G83 Z-5 |");
    assert_eq!(words[..2], ["R", "Q"], "{words:?}");
    assert!(!has(&words, "G1") && has(&words, "G90"), "{words:?}");
    assert_eq!(c.labels(&uri, "  T|\n  G1"), ["T1", "T2"]);
    let names = c.labels(&uri, "X#<|");
    assert!(names[0] == "#<depth>" && has(&names, "#<_x>"), "{names:?}");
    assert_eq!(c.labels(&uri, "X[S|"), ["SIN", "SQRT"]);
    assert_eq!(c.labels(&uri, "o<ho|\n"), ["o<hole> call"]);
    assert_eq!(c.labels(&uri, "(M|\n"), ["MSG"]);
    c.shut_down();
}

#[test]
fn signatures_of_cycles_and_calls() {
    let (mut c, uri) = part();
    c.edit(&uri, "M5 M9", "G83 Z-5 R1 Q\no<hole> call [1] [\nM5 M9");
    let at = c.at(&uri, "G83 Z-5 R1 Q|");
    let help = c.request("textDocument/signatureHelp", at);
    let label = help["signatures"][0]["label"].as_str().unwrap_or("").to_string();
    let active = help["activeParameter"].as_u64().expect("a word") as usize;
    let range = &help["signatures"][0]["parameters"][active]["label"];
    let part = &label[range[0].as_u64().unwrap() as usize..range[1].as_u64().unwrap() as usize];
    assert!(label.starts_with("G83") && part.contains('Q'), "{help}");
    let at = c.at(&uri, "call [1] [|");
    let help = c.request("textDocument/signatureHelp", at);
    assert_eq!((help["signatures"][0]["label"].as_str(), help["activeParameter"].as_u64()), (Some("o<hole> call [#1] [#2]"), Some(1)));
    c.shut_down();
}

#[test]
fn definition_and_references() {
    let (mut c, uri) = part();
    let mut go = |at: &str| {
        let at = c.at(&uri, at);
        let found = c.request("textDocument/definition", at);
        c.places(&found)
    };
    assert_eq!(go("o<ho|le> call [30]"), ["part.ngc:17 hole"]);
    assert_eq!(go("G1 Z-#<dep|th>"), ["part.ngc:3 depth"]);
    assert_eq!(go("o100 end|if"), [""; 0]);
    assert_eq!(go("o1|00 endif"), ["part.ngc:28 100"]);
    assert_eq!(go("T|2 M6"), ["tools.tbl:2 T2 P2 D5 Z60.5 ;drill five"]);
    let mut at = c.at(&uri, "#10|1 = ");
    at["context"] = json!({ "includeDeclaration": true });
    let found = c.request("textDocument/references", at);
    assert_eq!(c.places(&found), ["part.ngc:27 101", "part.ngc:28 101", "part.ngc:4 101"]);
    let at = c.at(&uri, "#<dep|th> = 2");
    let lights = c.request("textDocument/documentHighlight", at);
    let kinds: Vec<_> = lights.as_array().expect("a list").iter().map(|h| h["kind"].as_u64()).collect();
    assert_eq!(kinds, [Some(3), Some(2), Some(2)]);
    c.shut_down();
}

#[test]
fn names_over_files() {
    let sub = "o<pocket> sub\n  G1 X#1\no<pocket> endsub\n";
    let main = "G21 G90 F100\no<pocket> call [1]\nM2\n";
    let other = "G21\no<pocket> call [2]\no<pocket> call [3]\nM2\n";
    let mut c = Client::new(&[("main.ngc", main), ("other.ngc", other), ("pocket.ngc", sub)], json!({}));
    let uri = c.open("main.ngc", None);
    let at = c.at(&uri, "o<poc|ket> call");
    let found = c.request("textDocument/definition", at.clone());
    assert_eq!(c.places(&found), ["pocket.ngc:1 pocket"]);
    let mut references = at.clone();
    references["context"] = json!({ "includeDeclaration": false });
    let found = c.request("textDocument/references", references);
    assert_eq!(c.places(&found), ["main.ngc:2 pocket", "other.ngc:2 pocket", "other.ngc:3 pocket", "pocket.ngc:3 pocket"]);
    let mut rename = at.clone();
    rename["newName"] = "slot".into();
    let edit = c.request("textDocument/rename", rename);
    let files = ["main.ngc", "other.ngc", "pocket.ngc"];
    let after = c.carried_out(&files, &edit);
    assert_eq!(after.keys().map(String::as_str).collect::<Vec<_>>(), ["main.ngc", "other.ngc", "slot.ngc"]);
    assert_eq!((&after["main.ngc"], &after["slot.ngc"]), (&main.replace("pocket", "slot"), &sub.replace("pocket", "slot")));
    let before = files.iter().map(|f| (f.to_string(), std::fs::read_to_string(c.path(f)).expect("a file"))).collect();
    for program in ["main.ngc", "other.ngc"] {
        assert_eq!(built(&before, program), built(&after, program));
    }
    let links = c.request("textDocument/documentLink", json!({ "textDocument": { "uri": uri } }));
    assert_eq!(links[0]["target"], c.uri("pocket.ngc"));
    // Call hierarchy over files.
    let item = c.request("textDocument/prepareCallHierarchy", at)[0].clone();
    assert_eq!((item["name"].as_str(), item["detail"].as_str()), (Some("o<pocket>"), Some("pocket.ngc")));
    let sub_uri = c.open("pocket.ngc", None);
    // It is called from elsewhere, and needs no end of its own.
    let found = c.diagnostics(&sub_uri);
    assert!(found.iter().all(|d| !["E0290", "E0292", "E0252"].contains(&d["code"].as_str().unwrap_or(""))), "{found:?}");
    let calls = c.request("callHierarchy/incomingCalls", json!({ "item": item }));
    let mut from: Vec<String> = calls.as_array().expect("a list").iter().map(|f| format!("{} {}", f["from"]["name"].as_str().unwrap_or(""), f["fromRanges"].as_array().map_or(0, Vec::len))).collect();
    from.sort();
    assert_eq!(from, ["main.ngc 1", "other.ngc 2"]);
    let symbols = c.request("workspace/symbol", json!({ "query": "pok" }));
    assert_eq!(symbols[0]["name"], "o<pocket>");
    c.shut_down();
}

/// What a program of some files does: the controller's calls, or that it fails.
fn built(files: &std::collections::BTreeMap<String, String>, program: &str) -> (bool, String) {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let mut run = std::process::Command::new(env!("CARGO_BIN_EXE_gcc-robot"));
    let out = run.args(["build", program, "--target", "canon", "-o", "-"]).current_dir(folder.path()).output().expect("it runs");
    let text = String::from_utf8_lossy(&out.stdout);
    (out.status.success(), text.lines().filter(|l| !l.contains("COMMENT")).map(|l| format!("{l}\n")).collect())
}

/// Renames what stands at a mark, and runs all programs before and after; none = refused, and why.
fn renaming(files: &[(&str, &str)], settings: Value, at: &str, new: &str) -> Result<(), String> {
    let mut c = Client::new(files, settings);
    let uri = c.open(files[0].0, None);
    let mut ask = c.at(&uri, at);
    ask["newName"] = new.into();
    let id = c.begin("textDocument/rename", ask);
    let answer = c.answer(id);
    if let Some(why) = answer["error"]["message"].as_str() {
        return Err(why.to_string());
    }
    let names: Vec<&str> = files.iter().map(|f| f.0).collect();
    let after = c.carried_out(&names, &answer["result"]);
    let before: std::collections::BTreeMap<String, String> = files.iter().map(|f| (f.0.to_string(), f.1.to_string())).collect();
    assert_ne!(before, after, "{at}");
    for program in names.iter().filter(|n| after.contains_key(**n)) {
        assert_eq!(built(&before, program), built(&after, program), "{at} → {new}: {after:?}");
    }
    Ok(())
}

#[test]
fn a_new_name_changes_nothing_or_is_refused() {
    let p = "G21 G90 G17 F100\n";
    let with = |rest: &str| format!("{p}{rest}");
    let pocket = ("pocket.ngc", "o<pocket> sub\nG1 X#1 Z#<_depth> Y#101\no<pocket> endsub\n");
    let calls = with("#<_depth>=3\n#101=4\no<pocket> call [1]\nM2\n");
    let good: [(&[(&str, &str)], &str, &str); 10] = [
        (&[("main.ngc", &calls), pocket], "o<poc|ket>", "slot"),
        (&[("main.ngc", &calls), pocket], "#<_de|pth>", "_deep"),
        (&[("main.ngc", &calls), pocket], "#1|01=", "102"),
        (&[("main.ngc", &with("o1000 call\nM98 P1000 L2\nM2\n")), ("1000.ngc", "o1000 sub\nG91 G1 X5\nG90\nM99\n")], "P1|000", "1001"),
        (&[("main.ngc", &with("#<a>=3\no1 if [EXISTS[#<a>]]\nG1 X-#<a> Y[ # <a> ]\no1 endif\nM2\n"))], "#<a|>=", "zz"),
        (&[("main.ngc", &with("#101 =3\nG1 X# 101 Y #101.0 Z#0101\nM2\n"))], "#1|01 =", "103"),
        (&[("main.ngc", &with("#<a>=3 #<b>=4\no<s> sub\n#<a>=9\nG1 X#<a>\no<s> endsub\no<s> call\nG1 Y#<a>\nM2\n"))], "#<a|>=3", "q"),
        // Each program has its own.
        (&[("a.ngc", &with("o100 sub\nG1 X#1\no100 endsub\no100 call [3]\nM2\n")), ("b.ngc", &with("o100 sub\nG1 Y#1\no100 endsub\no101 sub\nG1 Z#1\no101 endsub\no100 call [3]\no101 call [4]\nM2\n"))], "o1|00 sub", "101"),
        (&[("a.ngc", &with("o<p> sub\nG1 X#1\no<p> endsub\no<p> call [1]\nM2\n")), ("p.ngc", "o<p> sub\nG1 Y#1\no<p> endsub\n"), ("b.ngc", &with("o<p> call [4]\nM2\n"))], "o<|p> sub", "q"),
        (&[("a.ngc", &with("o101 while [#5 LT 2]\no102 if [#5 EQ 1]\no101 break\no102 endif\n#5=[#5+1]\nG1 X#5\no101 continue\no101 endwhile\nM2\n"))], "o1|01 break", "7"),
    ];
    for (files, at, new) in good {
        assert_eq!(renaming(files, json!({}), at, new), Ok(()), "{at}");
    }
    let slot = ("slot.ngc", "o<slot> sub\nG1 Z-#1\no<slot> endsub\n");
    let bad: [(&[(&str, &str)], &str, &str, &str); 13] = [
        (&[("main.ngc", &calls), pocket, slot], "o<poc|ket>", "slot", "already a file slot.ngc"),
        (&[("main.ngc", &with("#101=3\no<p> call\nG1 Y#101\nM2\n")), ("p.ngc", "o<p> sub\n#200=4\nG1 Z#200\no<p> endsub\n")], "#1|01=", "200", "taken"),
        (&[("main.ngc", &with("#101=3\nG1 X#101\nM2\n"))], "#1|01=", "5", "from 31 to 5000"),
        (&[("main.ngc", &with("#101=3\nG1 X#101\nM2\n"))], "#1|01=", "5221", "from 31 to 5000"),
        (&[("main.ngc", &with("#5221=3\nG1 X#5221\nM2\n"))], "#5|221=", "101", "controller's own"),
        (&[("main.ngc", &with("#<a>=3\nG1 X#<a>\nM2\n"))], "#<a|>=", "_x", "controller's own"),
        (&[("main.ngc", &with("#<_deep>=3\no<s> sub\nG1 X#<_deep>\no<s> endsub\no<s> call\nM2\n"))], "#<_|deep>=", "deep", "begins with _"),
        (&[("main.ngc", &with("#101=102\n#102=7\nG1 X##101\nM2\n"))], "#1|02=7", "103", "computed"),
        (&[("main.ngc", &with("o100 sub\nG1 X#1\no100 endsub\n#5=100\no#5 call [2]\nM2\n"))], "o1|00 sub", "101", "computed"),
        (&[("main.ngc", &with("o100 sub\nG1 X#1\no100 endsub\no100 call [2]\nM2\n"))], "X#|1", "2", "called with"),
        (&[("main.ngc", &with("#101=3\nG1 X#101\nM2\n")), ("z.ngc", &with("G1 X#101\nM2\n"))], "#1|01=", "102", "z.ngc reads it too"),
        (&[("main.ngc", &with("o100 sub\no101 if [#1 GT 0]\nG1 X#1\no101 endif\no100 endsub\no100 call [2]\nM2\n"))], "o1|01 if", "100", "taken"),
        (&[("main.ngc", &with("#<a>=3\n#<b>=4\nG1 X#<a>\nM2\n"))], "#<a|>=3", "b", "taken"),
    ];
    for (files, at, new, why) in bad {
        let told = renaming(files, json!({}), at, new).expect_err(at);
        assert!(told.contains(why), "{at}: {told}");
    }
    // Macro B: calls by G65, computed jumps.
    let fanuc = json!({ "dialect": "fanuc-mill" });
    let macros = "O0001\nG21 G90 F100\nG65 P2000 A1.\nM98 P2000\nM30\nO2000\nG1 X5.\nM99\n";
    assert_eq!(renaming(&[("m.nc", macros)], fanuc.clone(), "O2|000", "2001"), Ok(()));
    let packed = "O0001\nG21 G90 F100\nM98 P20002\nM98 P0002 L2\nM30\nO0002\nG1 X5.\nM99\n";
    assert_eq!(renaming(&[("m.nc", packed)], fanuc.clone(), "O0|002", "9"), Ok(()));
    let told = renaming(&[("m.nc", "#101=20\nGOTO #101\nN20 G1 X1 F100\nM30\n")], fanuc, "N2|0", "30").expect_err("a computed jump");
    assert!(told.contains("computed"), "{told}");
    // An editor that renames no files.
    let mut c = Client::with(&[("main.ngc", &calls), pocket], json!({}), json!({ "noFiles": true }));
    let uri = c.open("main.ngc", None);
    let mut ask = c.at(&uri, "o<poc|ket>");
    ask["newName"] = "slot".into();
    let id = c.begin("textDocument/rename", ask);
    assert!(c.answer(id)["error"]["message"].as_str().is_some_and(|m| m.contains("pocket.ngc would have to be renamed too")));
    c.shut_down();
}

#[test]
fn names_mean_what_the_controller_takes_them_for() {
    let own = "G21 G90 F100\no100 sub\nG1 X#1\no100 endsub\no100 call [3]\nM2\n";
    let mut c = Client::new(&[("a.ngc", own), ("b.ngc", &own.replace("X#1", "Y#1"))], json!({}));
    let uri = c.open("a.ngc", None);
    let mut ask = c.at(&uri, "o1|00 sub");
    ask["context"] = json!({ "includeDeclaration": true });
    let found = c.request("textDocument/references", ask.clone());
    assert_eq!(c.places(&found), ["a.ngc:2 100", "a.ngc:4 100", "a.ngc:5 100"]);
    let lenses = c.request("textDocument/codeLens", json!({ "textDocument": { "uri": uri } }));
    assert!(lenses.as_array().is_some_and(|l| l.iter().any(|l| l["command"]["title"] == "1 call")), "{lenses}");
    let item = c.request("textDocument/prepareCallHierarchy", ask)[0].clone();
    let calls = c.request("callHierarchy/incomingCalls", json!({ "item": item }));
    assert_eq!(calls.as_array().map(Vec::len), Some(1));
    // Where a value comes from is told when it is known.
    let text = "G21 G90 F100\n#101=1\no1 if [0]\n#101=5\no1 endif\nG1 X#101\no2 if [1]\n#<k>=2\no2 endif\nY#<k>\nM2\n";
    let uri = c.open("w.ngc", Some(text));
    assert!(!c.hover(&uri, "X#1|01").contains("Last set"));
    assert!(c.hover(&uri, "Y#<|k>").contains("Last set in line 8"), "{}", c.hover(&uri, "Y#<|k>"));
    // Moves of rotary axes and splines are no rapids and no straight lines.
    let uri = c.open("r.ngc", Some("G21 G90 F100\nG0 X0 Y0\nG1 A90\nG5 X10 Y10 I2 J2 P-2 Q-2\nM2\n"));
    assert!(c.hover(&uri, "G1 A|90").contains("**feed of the other axes**"), "{}", c.hover(&uri, "G1 A|90"));
    assert!(c.hover(&uri, "G5 X|10").contains("**spline at feed**"), "{}", c.hover(&uri, "G5 X|10"));
    c.shut_down();
    // Tool and offset of a lathe in one word.
    let mut c = Client::new(&[("t.nc", "G21\nT0101\nG0 X10.\nM30\n"), ("t.tbl", "T1 P1 D6 ;roughing\n")], json!({ "dialect": "fanuc-turn", "tools": "t.tbl" }));
    let uri = c.open("t.nc", None);
    let found = c.diagnostics(&uri);
    assert!(found.iter().all(|d| d["code"] != "E0243"), "{found:?}");
    assert!(c.hover(&uri, "T01|01").contains("roughing"), "{}", c.hover(&uri, "T01|01"));
    c.shut_down();
}

#[test]
fn rename_of_parameters_and_labels() {
    let (mut c, uri) = part();
    let at = c.at(&uri, "#<dep|th> = 2");
    let range = c.request("textDocument/prepareRename", at.clone());
    assert_eq!(range["placeholder"], "depth");
    // At `#` and `o` too, and what is said there is said of a place that the cursor is in.
    for marked in ["|#<depth> = 2", "#|<depth> = 2", "|o100 if"] {
        let at = c.at(&uri, marked);
        let here = at["position"].clone();
        let hover = c.request("textDocument/hover", at.clone());
        let range = c.request("textDocument/prepareRename", at);
        for range in [&range["range"], &hover["range"]].into_iter().filter(|r| r.is_object()) {
            assert!(range["start"]["line"] == here["line"] && range["start"]["character"].as_u64() <= here["character"].as_u64(), "{marked}: {range}");
        }
        assert!(["depth", "100"].contains(&range["placeholder"].as_str().unwrap_or("")), "{range}");
    }
    let mut rename = at;
    rename["newName"] = "#<deep>".into();
    let edit = c.request("textDocument/rename", rename.clone());
    assert_eq!(c.edited(&uri, &edit), PART.replace("<depth>", "<deep>"));
    rename["newName"] = "a b".into();
    let id = c.begin("textDocument/rename", rename);
    assert!(c.answer(id)["error"]["message"].as_str().is_some_and(|m| m.contains("letters")), "bad names are refused");
    let mut rename = c.at(&uri, "o1|00 if");
    rename["newName"] = "7".into();
    let edit = c.request("textDocument/rename", rename);
    assert_eq!(c.edited(&uri, &edit), PART.replace("o100", "o7"));
    let at = c.at(&uri, "o1|00 if");
    let linked = c.request("textDocument/linkedEditingRange", at);
    assert_eq!(linked["ranges"].as_array().map(Vec::len), Some(2));
    c.shut_down();
}

#[test]
fn jumps_to_line_numbers() {
    let text = "O0001\nN10 G21 G90 F100\nN20 G1 X1.\nIF [#100 GT 3] GOTO 40\n#100=#100+1\nGOTO 20\nN40 M30\n";
    let mut c = Client::new(&[("a.ngc", text), ("gcc-robot.toml", "schema = 1\n[project]\ndialect = \"fanuc-mill\"\n")], json!({}));
    let uri = c.open("a.ngc", None);
    let at = c.at(&uri, "GOTO 2|0");
    let found = c.request("textDocument/definition", at);
    assert_eq!(c.places(&found), ["a.ngc:3 20"]);
    let mut rename = c.at(&uri, "N4|0");
    rename["newName"] = "50".into();
    let edit = c.request("textDocument/rename", rename);
    assert_eq!(c.edited(&uri, &edit), text.replace("40", "50"));
    c.shut_down();
}

#[test]
fn outline_folding_selection() {
    let (mut c, uri) = part();
    let document = json!({ "textDocument": { "uri": uri } });
    let symbols = c.request("textDocument/documentSymbol", document.clone());
    insta::assert_snapshot!(tree(&symbols, 0));
    let folds = c.request("textDocument/foldingRange", document);
    let lines: Vec<_> = folds.as_array().expect("a list").iter().map(|f| (f["startLine"].as_u64(), f["endLine"].as_u64())).collect();
    assert_eq!(lines, [(Some(4), Some(20)), (Some(16), Some(20)), (Some(21), Some(31)), (Some(27), Some(29))]);
    let positions = json!({ "textDocument": { "uri": uri }, "positions": [c.position(&uri, "X1|0\nG2")] });
    let mut chain = c.request("textDocument/selectionRange", positions)[0].clone();
    let mut sizes = Vec::new();
    while !chain.is_null() {
        sizes.push(c.place(&uri, &chain["range"]).split_once(' ').map_or(0, |p| p.1.len()));
        chain = chain["parent"].clone();
    }
    assert_eq!(sizes[..2], [2, 3]);
    assert!(sizes.is_sorted() && sizes.last() == Some(&PART.len()), "{sizes:?}");
    c.shut_down();
}

#[test]
fn lenses_of_tools_and_subs() {
    let (mut c, uri) = part();
    let lenses = c.request("textDocument/codeLens", json!({ "textDocument": { "uri": uri } }));
    let all: Vec<String> = lenses.as_array().expect("a list").iter().map(|l| format!("{}: {}", l["range"]["start"]["line"], l["command"]["title"].as_str().unwrap_or(""))).collect();
    insta::assert_snapshot!(all.join("\n"));
    c.shut_down();
}

#[test]
fn tokens_full_range_delta() {
    let (mut c, uri) = part();
    let types: Vec<String> = c.capabilities["semanticTokensProvider"]["legend"]["tokenTypes"].as_array().expect("a legend").iter().map(|t| t.as_str().unwrap_or("").into()).collect();
    let document = json!({ "textDocument": { "uri": uri } });
    let full = c.request("textDocument/semanticTokens/full", document.clone());
    let show = |data: &Value| -> Vec<String> {
        let n: Vec<u64> = data.as_array().expect("numbers").iter().filter_map(Value::as_u64).collect();
        let (mut line, mut column) = (0, 0);
        n.chunks(5)
            .map(|t| {
                (line, column) = (line + t[0], if t[0] == 0 { column + t[1] } else { t[1] });
                let text: String = PART.lines().nth(line as usize).unwrap_or("").chars().skip(column as usize).take(t[2] as usize).collect();
                format!("{text}={}", types[t[3] as usize])
            })
            .collect()
    };
    let all = show(&full["data"]);
    assert_eq!(all[..3], ["(--- part of the tests)=comment", "G21=macro", "G17=macro"]);
    assert!(["#<depth>=variable", "G2=keyword", "10=number", "M6=method", "o=keyword", "sub=keyword", "GT=operator"].iter().all(|t| all.iter().any(|a| a == t)), "{all:?}");
    let mut range = document.clone();
    range["range"] = json!({ "start": { "line": 11, "character": 0 }, "end": { "line": 11, "character": 20 } });
    let some = c.request("textDocument/semanticTokens/range", range);
    assert_eq!(show(&some["data"])[0], "G2=keyword");
    c.edit(&uri, "X20", "X21");
    let mut delta = document.clone();
    delta["previousResultId"] = full["resultId"].clone();
    let none = c.request("textDocument/semanticTokens/full/delta", delta.clone());
    assert_eq!(none["edits"], json!([]));
    c.edit(&uri, "X21", "X[20]");
    delta["previousResultId"] = none["resultId"].clone();
    let some = c.request("textDocument/semanticTokens/full/delta", delta);
    assert_eq!(some["edits"].as_array().map(Vec::len), Some(1), "{some}");
    c.shut_down();
}

#[test]
fn formatting_document_range_and_while_typing() {
    let text = "g21 g90\nn10 g1x1y2f100\no1 if [1]\ng0x5\no1 endif\nm2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    let options = json!({ "tabSize": 2, "insertSpaces": true });
    let edits = c.request("textDocument/formatting", json!({ "textDocument": { "uri": uri }, "options": options }));
    assert_eq!(apply(text, &edits), "G21 G90\nN10 G1 X1 Y2 F100\no1 if [1]\n  G0 X5\no1 endif\nM2\n");
    let range = json!({ "start": { "line": 3, "character": 0 }, "end": { "line": 4, "character": 0 } });
    let edits = c.request("textDocument/rangeFormatting", json!({ "textDocument": { "uri": uri }, "range": range, "options": options }));
    assert_eq!(apply(text, &edits), text.replace("g0x5", "  G0 X5"));
    c.edit(&uri, "f100\n", "f100\n\n");
    let edits = c.request(
        "textDocument/onTypeFormatting",
        json!({ "textDocument": { "uri": uri }, "position": { "line": 2, "character": 0 }, "ch": "\n", "options": options }),
    );
    assert_eq!(apply(c.text(&uri), &edits), "g21 g90\nN10 G1 X1 Y2 F100\nN20 \no1 if [1]\ng0x5\no1 endif\nm2\n");
    c.shut_down();
}

/// Titles of the actions at a place, and the text after one of them.
fn act(c: &mut Client, uri: &str, at: &str, wanted: &str) -> String {
    let position = c.position(uri, at);
    let params = json!({ "textDocument": { "uri": uri }, "range": { "start": position, "end": position }, "context": { "diagnostics": [] } });
    let actions = c.request("textDocument/codeAction", params);
    let list = actions.as_array().expect("a list");
    let titles: Vec<&str> = list.iter().filter_map(|a| a["title"].as_str()).collect();
    let action = list.iter().find(|a| a["title"].as_str().is_some_and(|t| t.starts_with(wanted)));
    let action = action.unwrap_or_else(|| panic!("{wanted} is not among {titles:?}"));
    c.edited(uri, &action["edit"])
}

#[test]
fn actions_rewrite() {
    let (mut c, uri) = part();
    assert_eq!(act(&mut c, &uri, "G|2 X20", "Write the arc with its radius"), PART.replace("I0 J10 F600", "R-10 F600"));
    assert_eq!(act(&mut c, &uri, "G|3 X10", "Write the arc with its centre"), PART.replace("R10", "I-10 J0"));
    let expanded = act(&mut c, &uri, "o<hole> c|all [30]", "Write out this call");
    insta::assert_snapshot!(expanded.lines().skip(24).take(9).collect::<Vec<_>>().join("\n"));
    let numbered = act(&mut c, &uri, "G|2 X20", "Number blocks");
    assert!(numbered.contains("N10 G21") && numbered.contains("N20 #<depth>"), "{numbered}");
    c.shut_down();
}

#[test]
fn actions_for_cycles_compensation_units_and_ends() {
    let text = "G21 G90 G17 F100 S1000 M3\nG0 X0 Y0 Z5\nG83 X5 Y5 Z-2 R1 Q1\nG80\nG41.1 D4\nG1 X10 Y0\nX20\nY20\nG40\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    insta::assert_snapshot!(act(&mut c, &uri, "G8|3", "Write out this G83"));
    insta::assert_snapshot!(act(&mut c, &uri, "X|20\n", "Write out this contour"));
    assert_eq!(act(&mut c, &uri, "G2|1", "Add M5 M2"), format!("{text}M5\nM2\n"));
    let inch = act(&mut c, &uri, "G2|1", "Convert the program to inch");
    // F is read before the unit of its block: the unit comes in a block of its own.
    assert!(inch.starts_with("G20\nG90 G17 F3.93701 S1000 M3\nG0 X0 Y0 Z0.19685\n"), "{inch}");
    c.shut_down();
}

/// A cycle with all blocks that go on with it; arcs whose plane or unit stands in their own block.
#[test]
fn actions_know_the_block_itself() {
    let text = "G21 G90 G17 G98 F100 S1000 M3\nG0 X0 Y0 Z5\nG81 X5 Y5 Z-3 R2\nX15\n\nX25 Y10\nG80\nG1 X0 Y0 Z4\nG18 G3 X5 Z8 R9\nG20 G17 G3 X1 Y0 R2\nG1 A90\nM5\nM2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    for at in ["G8|1", "X1|5", "X2|5"] {
        insta::assert_snapshot!("cycle_series", act(&mut c, &uri, at, "Write out this G81 and the blocks"));
    }
    let arc = act(&mut c, &uri, "G3| X5", "Write the arc with its centre");
    assert!(arc.contains("G18 G3 X5 Z8 I7.7545 K-4.5681\n"), "{arc}");
    let inch = act(&mut c, &uri, "G3| X1 Y0", "Write the arc with its centre");
    assert!(inch.contains("G20 G17 G3 X1 Y0 I"), "{inch}");
    c.shut_down();
}

/// Near half a turn the centre moves 76 times as far as the radius is rounded.
#[test]
fn a_radius_has_the_decimals_that_it_needs() {
    let text = "G21 G90 G17 F100\nG0 X0 Y0\nG3 X2.7793 Y-0.7249 I1.3944 J-0.3442\nG2 X5 Y-0.7249 I2 J-1.2\nM2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    let near_half = act(&mut c, &uri, "G3| X2", "Write the arc with its radius");
    insta::assert_snapshot!(near_half);
    c.shut_down();
}

/// Rewritings that would do something else are not there: Fanuc's dwell in milliseconds, the motion that G80 goes back to,
/// blocks that a switch of the machine skips.
#[test]
fn rewritings_keep_to_the_control() {
    let titles = |text: &str, name: &str, settings: Value, at: &str| {
        let mut c = Client::new(&[(name, text)], settings);
        let uri = c.open(name, None);
        let position = c.position(&uri, at);
        let params = json!({ "textDocument": { "uri": uri }, "range": { "start": position, "end": position }, "context": { "diagnostics": [] } });
        let found = c.request("textDocument/codeAction", params);
        let found: Vec<(String, String)> = found.as_array().into_iter().flatten()
            .filter(|a| a["title"].as_str().is_some_and(|t| t.starts_with("Write")))
            .map(|a| (a["title"].as_str().unwrap_or_default().to_string(), c.edited(&uri, &a["edit"])))
            .collect();
        c.shut_down();
        found
    };
    let fanuc = json!({ "dialect": "fanuc-mill" });
    let head = "O1\nG21 G90 G17 G98 G94 F100.\nS500 M3\nG0 X0 Y0 Z5.\n";
    let dwell = titles(&format!("{head}G82 X1. Z-1. R1. P500\nG80\nG0 X0\nM5\nM30\n"), "a.nc", fanuc.clone(), "G8|2");
    assert!(dwell.len() == 1 && dwell[0].1.contains("G4 P500\n"), "{dwell:?}");
    for text in ["G81 X1. Z-1. R1.\nG80\nX5.\nM5\nM30\n", "/G81 X1. Z-1. R1.\nG80\nG0 X5.\nM5\nM30\n"] {
        let found = titles(&format!("{head}{text}"), "a.nc", fanuc.clone(), "G8|1");
        assert!(found.is_empty(), "{found:?}");
    }
    let twice = titles(&format!("{head}G81 X1. Z-1. R1.\nG80\nG81 X2. Z-1. R1.\nG80\nG0 X0\nM5\nM30\n"), "a.nc", fanuc, "G8|1 X1");
    assert!(twice.len() == 1 && !twice[0].1.contains("G81 G81"), "{twice:?}");
    let arc = "G21 G90 G17 F100\n/G0 X3\nG2 X10 Y0 R9\nM2\n";
    assert_eq!(titles(arc, "a.ngc", json!({}), "G|2 X"), []);
}

/// Subroutines lie beside their program, wherever the server was started and whatever lies in other folders.
#[test]
fn subroutines_lie_beside_their_program() {
    let main = "G21 G90 F100\no<sq> call\nM2\n";
    let (good, bad) = ("o<sq> sub\nG1 X1\no<sq> endsub\n", "o<sq> sub\nG1 X[1/0]\no<sq> endsub\n");
    let files = [("u/main.ngc", main), ("u/sq.ngc", good), ("w/main.ngc", main), ("w/sq.ngc", bad)];
    let mut c = Client::new(&files, json!({}));
    let codes = |found: &[Value]| found.iter().filter(|d| d["severity"] == 1).filter_map(|d| d["code"].as_str().map(str::to_string)).collect::<Vec<_>>();
    let u = c.open("u/main.ngc", None);
    let found = c.diagnostics(&u);
    assert_eq!(codes(&found), Vec::<String>::new(), "{found:?}");
    let w = c.open("w/main.ngc", None);
    let found = c.diagnostics(&w);
    assert_eq!(codes(&found).len(), 1, "{found:?}");
    assert_ne!(codes(&found), ["E0250"], "{found:?}");
    c.shut_down();
}

/// Behind a call the tool is where its subroutine left it.
#[test]
fn a_call_ends_where_its_subroutine_ends() {
    let text = "G21 G90 F100\no<a> sub\nG1 X#1\no<a> endsub\nG0 X0\no<a> call [7]\nG0 Z5\nM2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    let position = c.position(&uri, "o<a> c|all");
    let state = c.request("gccRobot/state", json!({ "textDocument": { "uri": uri }, "position": position }));
    assert_eq!((state["before"]["position"][0].as_f64(), state["after"]["position"][0].as_f64()), (Some(0.0), Some(7.0)), "{state}");
    c.shut_down();
}

/// Where the last line is empty, a new block begins there.
#[test]
fn completion_on_the_line_that_is_not_there_yet() {
    let text = "G21 G90\nG1 F100 X1\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    let params = json!({ "textDocument": { "uri": uri }, "position": { "line": 2, "character": 0 } });
    let found = c.request("textDocument/completion", params);
    let items = found["items"].as_array().expect("a list");
    assert!(items.iter().any(|i| i["label"] == "G2"), "{found}");
    let empty = json!({ "line": 2, "character": 0 });
    assert!(items.iter().all(|i| i["textEdit"]["range"] == json!({ "start": empty, "end": empty })), "{found}");
    c.shut_down();
}

#[test]
fn fixes_of_diagnostics() {
    let text = "G21 G90 F100\nG1 XO\nG1 X1,5\n(a (b (c)) d) (e)\nG1 X1O.5 Y5\nG1 F1OO\n(end\nM2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    let found = c.diagnostics(&uri);
    let mut fixed = Vec::new();
    for d in found.iter().filter(|d| d["data"]["fixes"].as_u64().unwrap_or(0) > 0) {
        let params = json!({ "textDocument": { "uri": uri }, "range": d["range"], "context": { "diagnostics": [d], "only": ["quickfix"] } });
        let actions = c.request("textDocument/codeAction", params);
        let action = actions.as_array().and_then(|a| a.first()).unwrap_or_else(|| panic!("{d} has a fix, and none is offered"));
        assert_eq!((action["kind"].as_str(), action["isPreferred"].as_bool()), (Some("quickfix"), Some(true)));
        assert_eq!(action["diagnostics"][0]["code"], d["code"]);
        let after = c.edited(&uri, &action["edit"]);
        let line = d["range"]["start"]["line"].as_u64().expect("a line") as usize;
        fixed.push(format!("{}: {}", action["title"].as_str().unwrap_or(""), after.lines().nth(line).unwrap_or("")));
    }
    let wanted = [
        "write the digit 0: G1 X0",
        "write a decimal point: G1 X1.5",
        "remove the inner `(` and `)`: (a b c d) (e)",
        "write the digit 0: G1 X10.5 Y5",
        "write the digits 00: G1 F100",
        "close the comment: (end)",
    ];
    assert_eq!(fixed, wanted);
    // With all of them in place nothing is left to say.
    c.edit(&uri, "XO\nG1 X1,5\n(a (b (c)) d) (e)\nG1 X1O.5 Y5\nG1 F1OO\n(end\n", "X0\nG1 X1.5\n(a b c d) (e)\nG1 X10.5 Y5\nG1 F100\n(end)\n");
    assert_eq!(c.diagnostics(&uri), Vec::<Value>::new());
    c.shut_down();
}

#[test]
fn fixes_of_exchange_files() {
    let text = include_str!("../../../../docs/examples/stepnc/mistakes.p21");
    let mut c = Client::new(&[("a.p21", text)], json!({}));
    let uri = c.open("a.p21", None);
    let found = c.diagnostics(&uri);
    let d = found.iter().find(|d| d["code"] == "E0401").expect("the misspelt entity");
    assert_eq!(d["data"]["fixes"], 1, "{d}");
    let params = json!({ "textDocument": { "uri": uri }, "range": d["range"], "context": { "diagnostics": [d], "only": ["quickfix"] } });
    let actions = c.request("textDocument/codeAction", params);
    let fix = actions.as_array().and_then(|a| a.iter().find(|a| a["kind"] == "quickfix" && a["diagnostics"][0]["code"] == "E0401"));
    let fix = fix.unwrap_or_else(|| panic!("{actions}"));
    assert_eq!((fix["title"].as_str(), fix["isPreferred"].as_bool()), (Some("write PLANAR_POCKET_BOTTOM_CONDITION"), Some(true)));
    let edited = c.edited(&uri, &fix["edit"]);
    assert_eq!(edited, text.replacen("PLANAR_POCKET_BOTOM_CONDITION", "PLANAR_POCKET_BOTTOM_CONDITION", 1));
    c.shut_down();
}

#[test]
fn the_chosen_robot_is_asked() {
    let text = "G21 G90 F600\nG1 X5000\nM2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({ "machine": "abb/irb140" }));
    let uri = c.open("a.ngc", None);
    let of_robot = |found: &[Value]| {
        let error = |d: &&Value| d["severity"] == 1 && d["code"].as_str().is_some_and(|c| c.starts_with("E05"));
        found.iter().find(error).cloned()
    };
    let found = c.diagnostics(&uri);
    let far = of_robot(&found).unwrap_or_else(|| panic!("{found:?}"));
    assert_eq!((far["severity"].as_u64(), c.place(&uri, &far["range"]).as_str()), (Some(1), "a.ngc:2 G1 X5000"));
    // Without a machine there is nobody to ask.
    c.settings = json!({});
    c.notify("workspace/didChangeConfiguration", json!({ "settings": {} }));
    c.wait_for("workspace/inlayHint/refresh");
    c.edit(&uri, "X5000", "X5001");
    // The new settings may arrive after the edit.
    let mut found = c.diagnostics(&uri);
    for n in 1..50 {
        if of_robot(&found).is_none() {
            break;
        }
        c.edit(&uri, &format!("X{}", 5000 + n), &format!("X{}", 5001 + n));
        found = c.diagnostics(&uri);
    }
    assert_eq!(of_robot(&found), None);
    c.shut_down();
}

#[test]
fn mistakes_in_called_files_are_told_at_the_call() {
    let files = [("a.ngc", "G21 F100\nG0 X1\no<b> call\nM2\n"), ("b.ngc", "o<b> sub\nG1 XO\no<b> endsub\n"), ("gcc-robot.toml", "schema = 1\n[project]\nsubs = [\".\"]\n")];
    let told = |d: &Value| {
        let there = &d["relatedInformation"][0]["location"];
        let name = there["uri"].as_str().unwrap_or("").rsplit('/').next().unwrap_or("").to_string();
        format!("{}:{} {} -> {name}:{}", d["severity"], d["range"]["start"]["line"], d["message"].as_str().unwrap_or(""), there["range"]["start"]["line"])
    };
    let mut c = Client::new(&files, json!({}));
    let uri = c.open("a.ngc", None);
    let pushed: Vec<String> = c.diagnostics(&uri).iter().map(told).collect();
    c.shut_down();
    let mut c = Client::pulling(&files);
    let uri = c.open("a.ngc", None);
    let pulled = c.request("textDocument/diagnostic", json!({ "textDocument": { "uri": uri } }));
    let pulled: Vec<String> = pulled["items"].as_array().expect("a list").iter().map(told).collect();
    assert_eq!(pushed, pulled);
    insta::assert_snapshot!(pushed.join("\n"));
    c.shut_down();
}

#[test]
fn times_are_those_of_the_machine() {
    // Slow axes: corners, starts and stops cost more than way / feed says.
    let ini = "[TRAJ]\nLINEAR_UNITS = mm\n[AXIS_X]\nMAX_VELOCITY = 50\nMAX_ACCELERATION = 20\n[AXIS_Y]\nMAX_VELOCITY = 50\nMAX_ACCELERATION = 20\n[AXIS_Z]\nMAX_VELOCITY = 10\nMAX_ACCELERATION = 20\n";
    let text = "G21 G90 G61\nF1200\nG0 Z5\nG1 X10\nY10\no1 repeat [2]\n  G2 X20 Y20 R10\n  G1 X10 Y10\no1 endrepeat\nM2\n";
    let mut c = Client::new(&[("a.ngc", text), ("mill.ini", ini)], json!({ "ini": "mill.ini", "hints": { "position": "off", "motion": false, "arc": false, "modes": false } }));
    let uri = c.open("a.ngc", None);
    let _ = c.diagnostics(&uri);
    // The path in the preview has the time of every point.
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    let (lines, times) = (crate::custom::integers(&p["lines"]), crate::custom::floats(&p["times"]));
    let of_line = |line: u32| {
        let first = lines.iter().position(|l| *l == line).expect("the line");
        let end = (first..lines.len()).find(|i| lines[*i] != line).unwrap_or(lines.len());
        times[end - 1] - if first == 0 { 0.0 } else { times[first - 1] }
    };
    let hints = c.request("textDocument/inlayHint", json!({ "textDocument": { "uri": uri }, "range": { "start": { "line": 0, "character": 0 }, "end": { "line": 20, "character": 0 } } }));
    let shown: Vec<(u64, String)> = hints.as_array().expect("hints").iter().map(|h| (h["position"]["line"].as_u64().expect("a line"), h["label"].as_str().unwrap_or("").into())).collect();
    assert_eq!(shown.iter().map(|s| s.0).collect::<Vec<_>>(), [2, 3, 4, 6, 7], "{shown:?}");
    for (line, text) in &shown {
        let said: f32 = text.trim_end_matches(" s").parse().unwrap_or_else(|_| panic!("{text}"));
        let path = of_line(*line as u32);
        assert!((said - path).abs() < 0.011, "line {line}: {said} s, in the preview {path} s");
    }
    // 10 mm at 20 mm/s would take 0.5 s; from rest to rest with 20 mm/s² it is about 1.4 s.
    assert!(shown[1].1.starts_with("1.4"), "{shown:?}");
    let state = c.request("gccRobot/state", json!({ "textDocument": { "uri": uri }, "position": { "line": 3, "character": 0 } }));
    assert!(state["block"]["seconds"].as_f64().is_some_and(|s| (s as f32 - of_line(3)).abs() < 0.011), "{state}");
    assert!(c.hover(&uri, "G1 X|10\nY10").contains("time 1.4"), "{}", c.hover(&uri, "G1 X|10\nY10"));
    c.shut_down();
}

/// What a program does: lengths, box, time, points.
fn doing(c: &mut Client, text: &str) -> (Vec<f64>, Vec<f32>) {
    c.notify("textDocument/didClose", json!({ "textDocument": { "uri": c.uri("doing.ngc") } }));
    let uri = c.open("doing.ngc", Some(text));
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    c.notify("textDocument/didClose", json!({ "textDocument": { "uri": uri } }));
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    let mut sums: Vec<f64> = ["cutLength", "rapidLength", "seconds", "rapidSeconds"].iter().map(|k| number(&p[*k])).collect();
    for corner in p["bounds"].as_array().into_iter().flatten().chain(p["cut"].as_array().into_iter().flatten()) {
        sums.extend(corner.as_array().expect("a corner").iter().map(number));
    }
    (sums, crate::custom::floats(&p["positions"]))
}

/// Programs in which rewriting is hard: what is written in place of a block must do the same.
const HARD: [&str; 18] = [
    // Straight ahead: holes after each other, a whole contour.
    "G21 G90 G17 F100\nS1000 M3\nG0 X0 Y0 Z5\nG98 G83 X5 Y5 Z-2 R1 Q1\nX8\nG99 X9 Y2\nG80\nG0 Z10\nG41.1 D4\nG1 X20 Y0\nX30\nG3 X40 Y10 R10\nG40\nG1 X50\nM5\nM2\n",
    "G21 G90 F200\nG0 X0 Y0 Z5\nG2 X10 Y10 R10\nG3 X20 Y0 I0 J-10\nG91 G2 X5 Y5 R5\nG1 X1\nG90 G1 X0\nM2\n",
    // Loops and subroutines that run twice.
    "G21 G90 F100\n#1=0\no10 while [#1 LT 3]\nG81 X[#1*10] Y0 Z-1 R2\nG80\n#1=[#1+1]\no10 endwhile\nM2\n",
    "G21 G90 F100\no1 repeat [3]\nG91 G81 X5 Z-1 R2\nG80 G90\no1 endrepeat\nM2\n",
    "G21 G90 F100\no<h> sub\nG1 X[#1+1] Y2\nG0 Z3\no<h> endsub\n#1=0\no10 while [#1 LT 3]\no<h> call [#1*10]\n#1=[#1+1]\no10 endwhile\nM2\n",
    "G21 G90 F100\no<a> sub\nG3 X5 Y#1 R10\nG1 X0 Y0\no<a> endsub\no<a> call [5]\no<a> call [8]\nM2\n",
    // What subroutines leave behind.
    "G21 G90 F100\no<a> sub\nG1 X5\n#<_n>=7\no<a> endsub\no<a> call\nG1 X#<_n>\nM2\n",
    "G21 G90 F100\no<a> sub\nG1 X5\nG91\no<a> endsub\no<a> call\nX5\nM2\n",
    "G21 G90 F100\no<a> sub\nG1 X5 F500\nG0 Y1\no<a> endsub\no<a> call\nX7\nG1 X9\nM2\n",
    "G21 G90 F100\no<a> sub\nG1 X5\nG90.1\no<a> endsub\no<a> call\nG2 X10 Y0 I7.5 J0\nM2\n",
    "G21 G90 F100\no<a> sub\nG81 X5 Y1 Z-1 R2\no<a> endsub\no<a> call\nX7\nG80\nM2\n",
    // Modes that the block itself changes.
    "G21 G91 F100\nG90 G81 X1 Y1 Z-1 R2\nX5\nG80\nG1 X9\nM2\n",
    "G21 G90 F100\nG0 Z5\nG91 G81 X1 Y1 Z-3 R-2 L3\nX5\nG80\nG1 X9\nM2\n",
    "G21 G90 F100\nG0 Z5\nG81 X1 Y1 Z-1 R2 #5=3\nG80\nG1 X#5\nM2\n",
    // Diameters, and arcs under compensation.
    "G21 G90 G18 G7 F100\nG0 X20 Z5\nG81 X10 Z5 Y-3 R1\nG80\nG1 X30\nG2 X40 Z0 R5\nM2\n",
    "G21 G90 F100\nG0 X0 Y0\nG41.1 D4\nG1 X10 Y10\nX20\nG2 X30 Y0 R10\nG2 X20 Y-10 I-10 J0\nG91\nG1 X-5\nG90\nG40\nG1 X0\nM2\n",
    "G21 G90 F100\nG0 X0 Y0\nG41.1 D4\nG1 X10 Y10\nX20\nG2 X30 Y0 R10\nG91\nG1 Y-5\nG90\nG40 G0 X50 Y-20\nX60\nM2\n",
    // Units: feed beside the unit, moves before it, surface speed.
    "G0 X3\nG20 G90 F10\nG1 X1\nG64 P0.01\nG2 X2 Y0 I0.5 J0\nG21 F100\nG1 X5\nM2\n",
];

/// Programs of the documentation and of the corpus that are short enough to be rewritten at every line.
fn corpus() -> Vec<(String, String)> {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["docs/examples", "tests/corpus/accepted", "tests/corpus/regressions"];
    let mut found = Vec::new();
    for entry in folders.iter().flat_map(|f| std::fs::read_dir(root.join(f)).expect("a folder")).flatten() {
        let path = entry.path();
        if path.extension().is_some_and(|e| e == "ngc")
            && let Ok(text) = std::fs::read_to_string(&path)
            && text.lines().count() <= 40
        {
            found.push((path.file_name().expect("a name").to_string_lossy().into_owned(), text));
        }
    }
    found.sort();
    found
}

/// Whether two programs do the same, as far as the preview shows it.
fn same(old: &(Vec<f64>, Vec<f32>), new: &(Vec<f64>, Vec<f32>)) -> bool {
    let near = |a: &f64, b: &f64| (a - b).abs() < 0.01 + 1e-3 * b.abs() || a.is_nan() && b.is_nan();
    let points = new.1.len() != old.1.len() || new.1.iter().zip(&old.1).all(|(a, b)| (a - b).abs() < 0.02 || a.is_nan() && b.is_nan());
    new.0.len() == old.0.len() && new.0.iter().zip(&old.0).all(|(a, b)| near(a, b)) && points
}

#[test]
fn rewritings_of_the_corpus_do_the_same() {
    let mut c = Client::new(&[], json!({}));
    let (mut wrong, mut count) = (String::new(), 0);
    for (name, text) in corpus() {
        let uri = c.open("part.ngc", Some(&text));
        let old = doing(&mut c, &text);
        for (line, shown) in text.lines().enumerate() {
            let at = json!({ "line": line, "character": 0 });
            let only = if line == 0 { json!(["refactor", "source"]) } else { json!(["refactor"]) };
            let ask = json!({ "textDocument": { "uri": uri }, "range": { "start": at, "end": at }, "context": { "diagnostics": [], "only": only } });
            for action in c.request("textDocument/codeAction", ask).as_array().expect("a list") {
                let title = action["title"].as_str().unwrap_or("");
                // Lines get the numbers that jumps name: no part of what is done.
                let new = c.edited(&uri, &action["edit"]);
                count += 1;
                if !same(&old, &doing(&mut c, &new)) {
                    wrong += &format!("{name}:{}: {title} at `{shown}`:\n{new}\n", line + 1);
                }
            }
        }
        c.notify("textDocument/didClose", json!({ "textDocument": { "uri": uri } }));
    }
    assert!(count > 100, "{count}");
    assert!(wrong.is_empty(), "{wrong}");
    c.shut_down();
}

#[test]
fn new_names_in_the_corpus_do_the_same() {
    let mut c = Client::new(&[], json!({}));
    let (mut wrong, mut given, mut refused) = (String::new(), 0, 0);
    for (name, text) in corpus() {
        let uri = c.open("part.ngc", Some(&text));
        let old = doing(&mut c, &text);
        let starts = text.match_indices(['#', 'o', 'O', 'N', 'n']).map(|(i, _)| i);
        for at in starts {
            let rest = &text[at + 1..];
            let new = match rest.strip_prefix('<') {
                Some(n) if n.starts_with('_') => "_zz9",
                Some(_) => "zz9",
                None if text[at..].starts_with('#') && rest.bytes().take_while(u8::is_ascii_digit).count() < 3 => "28",
                None => "4711",
            };
            let mut ask = json!({ "textDocument": { "uri": uri }, "position": crate::client::position(&text, at + 1) });
            ask["newName"] = new.into();
            let id = c.begin("textDocument/rename", ask);
            let answer = c.answer(id);
            if answer.get("error").is_some() || answer["result"].is_null() {
                refused += usize::from(answer.get("error").is_some());
                continue;
            }
            given += 1;
            let new_text = c.edited(&uri, &answer["result"]);
            if new_text == text || !same(&old, &doing(&mut c, &new_text)) {
                wrong += &format!("{name}: {new} at `{}`:\n{new_text}\n", rest.lines().next().unwrap_or(""));
            }
        }
        c.notify("textDocument/didClose", json!({ "textDocument": { "uri": uri } }));
    }
    assert!(given > 50 && refused > 10, "{given} {refused}");
    assert!(wrong.is_empty(), "{wrong}");
    c.shut_down();
}

#[test]
fn rewritings_do_the_same() {
    let mut c = Client::new(&[], json!({}));
    let mut told = String::new();
    for (n, text) in HARD.iter().enumerate() {
        let uri = c.open(&format!("{n}.ngc"), Some(text));
        let (sums, points) = doing(&mut c, text);
        for (line, shown) in text.lines().enumerate() {
            let at = json!({ "line": line, "character": 0 });
            let ask = json!({ "textDocument": { "uri": uri }, "range": { "start": at, "end": at }, "context": { "diagnostics": [], "only": ["refactor", "source"] } });
            let actions = c.request("textDocument/codeAction", ask);
            for action in actions.as_array().expect("a list") {
                let title = action["title"].as_str().unwrap_or("");
                let new = c.edited(&uri, &action["edit"]);
                let (new_sums, new_points) = doing(&mut c, &new);
                let near = |a: &f64, b: &f64| (a - b).abs() < 0.01 + 1e-3 * b.abs() || a.is_nan() && b.is_nan();
                assert!(new_sums.len() == sums.len() && new_sums.iter().zip(&sums).all(|(a, b)| near(a, b)), "{title} at `{shown}`: {new_sums:?} instead of {sums:?} in\n{new}");
                if new_points.len() == points.len() {
                    assert!(new_points.iter().zip(&points).all(|(a, b)| (a - b).abs() < 0.02), "{title} at `{shown}`:\n{new}");
                }
                if !title.contains("umber blocks") && !title.starts_with("Add ") {
                    told.push_str(&format!("{n}: {shown}: {title}\n"));
                }
            }
        }
    }
    insta::assert_snapshot!(told);
    c.shut_down();
}

#[test]
fn what_a_program_leaves_out_is_a_fix() {
    for (text, wanted) in [("G21\nS100 M3\nG1 X1 F100\n", "M5\nM2\n"), ("%\nG21\nS100 M3\nG1 X1 F100\n%\n", "M5\nM2\n%\n"), ("G21\nG1 X1 F100", "\nM2\n"), ("G21\r\nS100 M3\r\nG1 X1 F100\r\n", "F100\r\nM5\r\nM2\r\n")] {
        let mut c = Client::new(&[("a.ngc", text)], json!({}));
        let uri = c.open("a.ngc", None);
        let found = c.diagnostics(&uri);
        let d = found.iter().find(|d| ["E0252", "E0283", "E0292"].contains(&d["code"].as_str().unwrap_or(""))).unwrap_or_else(|| panic!("{found:?}"));
        let ask = json!({ "textDocument": { "uri": uri }, "range": d["range"], "context": { "diagnostics": [d], "only": ["quickfix"] } });
        let actions = c.request("textDocument/codeAction", ask);
        let fix = actions.as_array().and_then(|a| a.iter().find(|a| a["title"].as_str().is_some_and(|t| t.starts_with("Add ")))).unwrap_or_else(|| panic!("{actions}"));
        assert_eq!(fix["kind"], "quickfix");
        let new = c.edited(&uri, &fix["edit"]);
        assert!(new.ends_with(wanted), "{new:?}");
        c.shut_down();
    }
    // Behind M2 nothing else counts: blank lines, `%`.
    for tail in ["M30\n%\n", "M2\n\n\n", "M2\n"] {
        let text = format!("G21\nS100 M3 M8\nG1 X1 F100\n{tail}");
        let mut c = Client::new(&[("a.ngc", &text)], json!({}));
        let uri = c.open("a.ngc", None);
        let new = act(&mut c, &uri, "G2|1", "Add M5 M9 before the end");
        assert_eq!(new, text.replace("M2\n", "M5\nM9\nM2\n").replace("M30", "M5\nM9\nM30"));
        c.shut_down();
    }
}

#[test]
fn numbers_of_big_programs_are_worked_out_when_chosen() {
    let text = format!("G21 F100\n{}M2\n", "G1 X1\nG1 X2\n".repeat(3_000));
    let mut c = Client::new(&[], json!({}));
    let uri = c.open("a.ngc", Some(&text));
    let at = c.position(&uri, "G2|1");
    let ask = json!({ "textDocument": { "uri": uri }, "range": { "start": at, "end": at }, "context": { "diagnostics": [] } });
    let actions = c.request("textDocument/codeAction", ask);
    let offered = actions.as_array().and_then(|a| a.iter().find(|a| a["title"] == "Number blocks in steps of 10")).cloned().unwrap_or_else(|| panic!("{actions}"));
    assert!(offered.get("edit").is_none());
    let resolved = c.request("codeAction/resolve", offered);
    assert_eq!(c.edits_of(&uri, &resolved["edit"]).as_array().map(Vec::len), Some(6_002));
    // A computed jump needs the numbers as they are.
    let uri = c.open("b.nc", Some("#101=20\nGOTO #101\nN20 G1 X1 F100\nM30\n"));
    let ask = json!({ "textDocument": { "uri": uri }, "range": { "start": { "line": 0, "character": 0 }, "end": { "line": 0, "character": 0 } }, "context": { "diagnostics": [], "only": ["source"] } });
    c.settings = json!({ "dialect": "fanuc-mill" });
    c.notify("workspace/didChangeConfiguration", json!({ "settings": {} }));
    let mut left = Value::Null;
    for _ in 0..300 {
        left = c.request("textDocument/codeAction", ask.clone());
        if left == json!([]) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert_eq!(left, json!([]));
    c.shut_down();
}

#[test]
fn values_in_hints_are_values() {
    let text = "G21 G90 F100\n#1=2\nG1 X[1+2] Y[#1] Z-[2+1]\nG83 X[1+2] Y[1+1] Z-[2+1] R[1] Q1\nG80\nG10 L2 P[1+1] X[3+4]\nG91 G1 X[1+1]\nG90\nG28 X[1+1]\nG7\nG1 X[#1]\nG8\nG93 G1 X[5] F[2]\nG94\nG1 X[1] Y[1/0]\nM2\n";
    let mut c = Client::new(&[], json!({ "hints": { "position": "off", "motion": false, "arc": false, "modes": false, "time": false, "feed": false } }));
    let uri = c.open("a.ngc", Some(text));
    let all = c.request("textDocument/inlayHint", json!({ "textDocument": { "uri": uri }, "range": { "start": { "line": 0, "character": 0 }, "end": { "line": 40, "character": 0 } } }));
    let shown: Vec<String> = all.as_array().expect("a list").iter().map(|h| format!("{}: {}", h["position"]["line"], h["label"].as_str().unwrap_or(""))).collect();
    assert_eq!(shown, ["2: = 3", "2: = 2", "2: = -3", "12: = 5"]);
    let h = c.hover(&uri, "X[5] F|[2]");
    assert!(h.contains("G93: every feed move takes 1/F minutes") && !h.contains("now "), "{h}");
    c.shut_down();
}

#[test]
fn what_other_machines_cannot_do() {
    let errors = |c: &mut Client, uri: &str| -> Vec<String> {
        let found = c.diagnostics(uri);
        let found: Vec<&Value> = found.iter().filter(|d| d["severity"] == 1).collect();
        found.iter().map(|d| format!("{} {}", d["code"].as_str().unwrap_or(""), c.place(uri, &d["range"]))).collect()
    };
    // Axes of a mill; the planar arm, which has no plan; STEP-NC files.
    let turns = ("a.ngc", "G21 G90 F600\nG1 X10 Y0\nG1 A30\nM2\n");
    let reaches = ("a.ngc", "G21 G90 F600\nG1 X10 Y0\nG1 X9 Y5\nG1 X900\nM2\n");
    let plan = ("a.p21", include_str!("../fixtures/probe.p21"));
    let cases = [(turns, "generic/mill3", "E0553 a.ngc:3 G1 A30"), (reaches, "ufmg/plano-3r", "E0504 a.ngc:4 G1 X900"), (plan, "abb/irb140", "E0521 a.p21:28 ")];
    for ((name, text), machine, wanted) in cases {
        let mut c = Client::new(&[(name, text)], json!({ "machine": machine }));
        let uri = c.open(name, None);
        let found = errors(&mut c, &uri);
        assert!(found.iter().any(|f| f.starts_with(wanted)), "{machine}: {found:?}");
        c.shut_down();
        let mut c = Client::new(&[(name, text)], json!({}));
        let uri = c.open(name, None);
        assert_eq!(errors(&mut c, &uri), [""; 0], "without a machine");
        c.shut_down();
    }
}

#[test]
fn what_the_chosen_robot_cannot_do() {
    let cell = include_str!("../../../../docs/examples/irb2400-cell.toml");
    let mut c = Client::new(&[("cell.toml", cell)], json!({ "machine": "cell.toml" }));
    // Reach, limits of joints, one configuration for a cut, the spindle's speed, tools.
    for (n, (block, wanted)) in [("X60", ""), ("X2500", "E0504"), ("X-900", "E0507"), ("X-800 Y100 Z500", "E0520"), ("S90000 M3", "E0532"), ("T7 M6\nX5", "E0521")].iter().enumerate() {
        let text = format!("G21 G90 G17 F600\nT1 M6\nG43 H1\nS10000 M3\nG0 X0 Y0 Z20\nG1 Z5\n{block}\nG0 Z20\nM5\nM2\n");
        let uri = c.open(&format!("{n}.ngc"), Some(&text));
        let found: Vec<String> = c.diagnostics(&uri).iter().filter(|d| d["severity"] == 1).map(|d| d["code"].as_str().unwrap_or("").to_string()).collect();
        assert!(if wanted.is_empty() { found.is_empty() } else { found.iter().any(|f| f == wanted) }, "{block}: {found:?}");
    }
    c.shut_down();
}
