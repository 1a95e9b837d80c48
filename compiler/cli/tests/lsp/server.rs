//! What a client may do to the server, and what it must survive.

use serde_json::{Value, json};

use crate::client::Client;

#[test]
fn it_says_what_it_can() {
    let c = Client::new(&[], json!({}));
    let cap = &c.capabilities;
    assert_eq!((cap["positionEncoding"].as_str(), cap["textDocumentSync"]["change"].as_u64()), (Some("utf-16"), Some(2)));
    for provider in crate::table::PROVIDERS {
        assert!(!cap[provider].is_null(), "{provider}");
    }
    c.shut_down();
}

#[test]
fn columns_in_bytes_and_utf16() {
    let text = "(größe 𝄞) G1 XO\nM2\n";
    let column = |general: Value| {
        let mut c = Client::with(&[("a.ngc", text)], json!({}), general);
        let uri = c.open("a.ngc", None);
        let found = c.diagnostics(&uri);
        let at = found.iter().find(|d| d["severity"] == 1).expect("an error")["range"]["start"]["character"].as_u64();
        c.shut_down();
        at.expect("a number")
    };
    let utf16 = column(json!({}));
    let utf8 = column(json!({ "positionEncodings": ["utf-8", "utf-16"] }));
    // ö and ß are a byte longer than a unit, the clef two.
    assert_eq!(utf8 - utf16, 4);
}

#[test]
fn edits_beyond_the_text_and_foreign_messages() {
    let mut c = Client::new(&[("a.ngc", "G21\n")], json!({}));
    let uri = c.open("a.ngc", None);
    let far = json!({ "start": { "line": 900, "character": 7 }, "end": { "line": 4_294_967_295u32, "character": 4_294_967_295u32 } });
    c.change(&uri, json!([{ "range": far, "text": "M2\n" }]), "G21\nM2\n".into());
    let back = json!({ "start": { "line": 1, "character": 0 }, "end": { "line": 0, "character": 0 } });
    c.change(&uri, json!([{ "range": back, "text": "" }]), "G21\nM2\n".into());
    let _ = c.diagnostics(&uri);
    let far = json!({ "textDocument": { "uri": uri }, "position": { "line": 88, "character": 99 } });
    for method in ["hover", "completion", "definition", "prepareRename", "signatureHelp", "documentHighlight", "prepareCallHierarchy", "linkedEditingRange"] {
        let id = c.begin(&format!("textDocument/{method}"), far.clone());
        assert!(c.answer(id).get("error").is_none(), "{method}");
    }
    let id = c.begin("textDocument/hover", json!({ "wrong": true }));
    assert!(c.answer(id)["error"].is_object());
    let id = c.begin("no/such", json!({}));
    assert!(c.answer(id)["error"].is_object());
    let id = c.begin("textDocument/hover", json!({ "textDocument": { "uri": "untitled:Untitled-1" }, "position": { "line": 0, "character": 0 } }));
    assert_eq!(c.answer(id)["result"], Value::Null);
    c.raw(b"Content-Length: 9\r\n\r\n{\"a\": [1,");
    c.raw(b"Content-Length: 2\r\n\r\n\xFF\xFE");
    let at = json!({ "textDocument": { "uri": uri }, "position": { "line": 0, "character": 1 } });
    assert!(c.request("textDocument/hover", at)["contents"]["value"].as_str().is_some_and(|t| t.starts_with("**G21**")));
    c.shut_down();
}

#[test]
fn any_bytes_are_a_document() {
    let mut c = Client::new(&[], json!({}));
    let strange = ["", "\u{0}\u{1}\u{7f}", "((((((((", "#<#<#<[[[[", "o o o o", "G\u{301}1 X\u{1F600}", "%\n%\n%", "\r\r\n\n\r", "ISO-10303-21;#1=(((((", "ISO-10303-21;'"];
    for (n, text) in strange.iter().enumerate() {
        let uri = c.open(&format!("{n}.ngc"), Some(text));
        let _ = c.diagnostics(&uri);
        let document = json!({ "textDocument": { "uri": uri } });
        for method in ["documentSymbol", "foldingRange", "codeLens", "semanticTokens/full", "documentLink"] {
            let _ = c.request(&format!("textDocument/{method}"), document.clone());
        }
        for character in 0..4 {
            let at = json!({ "textDocument": { "uri": uri }, "position": { "line": 0, "character": character } });
            for method in ["hover", "completion", "definition", "signatureHelp"] {
                let _ = c.request(&format!("textDocument/{method}"), at.clone());
            }
        }
    }
    assert!(c.lives());
    c.shut_down();
}

/// Minutes of work within the budgets, which begin anew behind each loop.
fn minutes() -> String {
    let section = |n: usize| format!("o{n} repeat [18]\no{} repeat [900000]\n#3=[#3+1]\no{0} endrepeat\no{n} endrepeat\n", n + 1);
    format!("G21\n#3=0\n{}G0 X1\nM2\n", (1..40).map(|i| section(2 * i)).collect::<String>())
}

#[test]
fn a_runaway_loop_is_cut_short_by_the_next_key() {
    let text = minutes();
    let mut c = Client::new(&[("a.ngc", &text)], json!({}));
    let uri = c.open("a.ngc", None);
    std::thread::sleep(std::time::Duration::from_millis(500));
    // The client's patience ends long before the program would.
    c.edit(&uri, "G21", "G21\nG1 XO\nM2");
    let found = c.diagnostics(&uri);
    assert!(found.iter().any(|d| d["range"]["start"]["line"] == 1 && d["severity"] == 1), "{found:?}");
    c.shut_down();
}

#[test]
fn requests_can_be_cancelled() {
    let text = minutes();
    let mut c = Client::new(&[("a.ngc", &text)], json!({}));
    let uri = c.open("a.ngc", None);
    let at = c.at(&uri, "G0 X|1");
    let id = c.begin("textDocument/hover", at.clone());
    c.notify("$/cancelRequest", json!({ "id": id }));
    let answer = c.answer(id);
    assert_eq!(answer["error"]["code"], -32800, "{answer}");
    // More than there are workers: each is broken off, and everything goes on.
    let ids: Vec<i64> = (0..4).map(|_| c.begin("textDocument/hover", at.clone())).collect();
    std::thread::sleep(std::time::Duration::from_millis(300));
    ids.iter().for_each(|id| c.notify("$/cancelRequest", json!({ "id": id })));
    let begun = std::time::Instant::now();
    let other = c.open("b.ngc", Some("G21\nM2\n"));
    assert!(c.hover(&other, "G2|1").starts_with("**G21**"));
    assert!(begun.elapsed() < std::time::Duration::from_secs(4), "{:?}", begun.elapsed());
    c.shut_down();
}

#[test]
fn big_files_show_progress() {
    let text = format!("G21 G90 F100\n{}M2\n", "G1 X1.25 Y2.5 Z-0.125\n".repeat(200_000));
    let mut c = Client::new(&[], json!({}));
    let uri = c.open("big.ngc", Some(&text));
    let _ = c.diagnostics(&uri);
    c.wait_for("window/workDoneProgress/create");
    let symbols = c.request("textDocument/documentSymbol", json!({ "textDocument": { "uri": uri } }));
    assert_eq!(symbols, json!([]));
    c.shut_down();
}

#[test]
fn several_folders() {
    let other = tempfile::tempdir().expect("a folder");
    std::fs::write(other.path().join("far.ngc"), "o<far> sub\no<far> endsub\n").expect("written");
    let mut c = Client::new(&[("a.ngc", "o<far> call\nM2\n")], json!({}));
    let uri = c.open("a.ngc", None);
    let at = c.at(&uri, "o<f|ar> call");
    assert_eq!(c.request("textDocument/definition", at.clone()), json!([]));
    let folder = format!("file://{}", other.path().display());
    c.notify("workspace/didChangeWorkspaceFolders", json!({ "event": { "added": [{ "uri": folder, "name": "lib" }], "removed": [] } }));
    let found = c.request("textDocument/definition", at.clone());
    assert!(found[0]["uri"].as_str().is_some_and(|u| u.ends_with("far.ngc")), "{found}");
    c.notify("workspace/didChangeWorkspaceFolders", json!({ "event": { "added": [], "removed": [{ "uri": folder, "name": "lib" }] } }));
    assert_eq!(c.request("textDocument/definition", at), json!([]));
    c.shut_down();
}

#[test]
fn called_files_are_read_again_when_saved() {
    let mut c = Client::new(&[("a.ngc", "G21 F100\no<b> call\nM2\n"), ("b.ngc", "o<b> sub\nG1 XO\no<b> endsub\n"), ("gcc-robot.toml", "schema = 1\n[project]\nsubs = [\".\"]\n")], json!({}));
    let uri = c.open("a.ngc", None);
    let _ = c.diagnostics(&uri);
    let item = c.at(&uri, "o<|b> call");
    let found = c.request("textDocument/definition", item);
    assert_eq!(c.places(&found), ["b.ngc:1 b"]);
    std::fs::write(c.path("b.ngc"), "o<b> sub\nG1 X0\no<b> endsub\n").expect("written");
    let saved = c.uri("b.ngc");
    c.notify("textDocument/didSave", json!({ "textDocument": { "uri": saved } }));
    c.edit(&uri, "F100", "F101");
    let after = c.diagnostics(&uri);
    assert!(after.iter().all(|d| d["severity"] != 1), "{after:?}");
    c.shut_down();
}

#[test]
fn the_dialect_is_what_file_project_and_settings_say() {
    let mut c = Client::new(&[("a.nc", "G21\nM2\n"), ("sub/gcc-robot.toml", "schema = 1\n[project]\ndialect = \"fanuc-mill\"\n"), ("sub/b.nc", "G21\nM2\n")], json!({ "dialect": "grbl" }));
    let a = c.open("a.nc", None);
    assert!(c.hover(&a, "G2|1").to_lowercase().contains("grbl"), "{}", c.hover(&a, "G2|1"));
    let b = c.open("sub/b.nc", None);
    assert!(!c.hover(&b, "G2|1").to_lowercase().contains("grbl"));
    c.shut_down();
}

#[test]
fn lines_around_an_edit_come_first() {
    // Nothing converges: every position depends on the first line. The mistake far below is known before.
    let mut text = String::from("G91 G21 F600\n");
    (0..60_000).for_each(|_| text.push_str("G1 X.1 Y.2\n"));
    text.push_str("G2 X1 Y0 I5 J0\nM2\n");
    let mut c = Client::new(&[("a.ngc", &text)], json!({}));
    let uri = c.open("a.ngc", None);
    let far = c.diagnostics(&uri);
    assert_eq!(far.len(), 1, "{far:?}");
    // A line more at the top moves it down at once, together with what is found up here.
    let range = json!({ "start": { "line": 3, "character": 0 }, "end": { "line": 3, "character": 0 } });
    let new = text.replacen("G1 X.1 Y.2\n", "G1 X.1 Y.2\nG1 X[1\n", 1);
    c.change(&uri, json!([{ "range": range, "text": "G1 X[1\n" }]), new);
    let line = |d: &Value| d["range"]["start"]["line"].as_u64();
    let early = c.next_diagnostics(&uri);
    assert_eq!(early.iter().map(line).collect::<Vec<_>>(), [Some(3), Some(60_002)], "{early:?}");
    let all = c.next_diagnostics(&uri);
    assert_eq!(all.iter().map(line).next(), Some(Some(3)), "{all:?}");
    c.shut_down();
}

#[test]
fn clients_that_ask_for_diagnostics_are_told_when_to() {
    let files = [("a.ngc", "T7 M6\nG21 G90 F100\nG1 X1\nM2\n"), ("tools.tbl", "T1 P1 D10 ;mill\n"), ("gcc-robot.toml", "schema = 1\n[project]\ntools = \"tools.tbl\"\n")];
    let mut c = Client::pulling(&files);
    let uri = c.open("a.ngc", None);
    let ask = json!({ "textDocument": { "uri": uri } });
    let before = c.request("textDocument/diagnostic", ask.clone());
    let errors = |r: &Value| r["items"].as_array().expect("a list").iter().filter(|d| d["severity"] == 1).count();
    assert!(errors(&before) > 0, "T7 is not in the table: {before}");
    c.write("tools.tbl", "T1 P1 D10 ;mill\nT7 P7 D3 ;drill\n");
    c.wait_for("workspace/diagnostic/refresh");
    let after = c.request("textDocument/diagnostic", ask);
    assert_eq!(errors(&after), 0, "{after}");
    c.shut_down();
}

#[test]
fn messages_that_are_none_do_no_harm() {
    let mut c = Client::new(&[("a.ngc", "G21\nM2\n")], json!({}));
    let uri = c.open("a.ngc", None);
    let bodies: [&[u8]; 9] = [b"[]", b"null", b"7", b"{}", b"\"\xff\"", br#"{"jsonrpc":"1.0","id":1,"method":"x"}"#, br#"{"jsonrpc":"2.0","id":{},"method":"x"}"#, br#"{"jsonrpc":"2.0","method":[]}"#, br#"{"jsonrpc":"2.0","id":5,"result":1e999}"#];
    for body in bodies {
        c.raw(format!("Content-Length: {}\r\n\r\n", body.len()).as_bytes());
        c.raw(body);
        assert!(c.hover(&uri, "G2|1").starts_with("**G21**"), "{}", String::from_utf8_lossy(body));
    }
    // A length that is too great takes the next message along, not the one after it.
    c.raw(b"Content-Length: 30\r\n\r\n{");
    c.notify("no/such", json!({ "a long": "one, so that it holds what is missing" }));
    assert!(c.hover(&uri, "G2|1").starts_with("**G21**"));
    // Half of a surrogate pair in an edit: a character that is none, and not an edit that is lost.
    let body = format!(r#"{{"jsonrpc":"2.0","method":"textDocument/didChange","params":{{"textDocument":{{"uri":"{uri}","version":2}},"contentChanges":[{{"range":{{"start":{{"line":0,"character":0}},"end":{{"line":0,"character":0}}}},"text":"(\ud83d)\nG1 XO\n"}}]}}}}"#);
    c.raw(format!("Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes());
    let found = c.next_diagnostics(&uri);
    assert!(found.iter().any(|d| d["range"]["start"]["line"] == 1 && d["severity"] == 1), "{found:?}");
    c.shut_down();
}

#[test]
fn a_client_that_is_gone_takes_the_server_with_it() {
    let mut c = Client::new(&[("a.ngc", &minutes())], json!({}));
    let uri = c.open("a.ngc", None);
    let at = c.at(&uri, "G0 X|1");
    c.begin("textDocument/hover", at);
    std::thread::sleep(std::time::Duration::from_millis(200));
    assert!(c.lives());
    let begun = std::time::Instant::now();
    assert!(c.hang_up());
    assert!(begun.elapsed() < std::time::Duration::from_secs(30), "{:?}", begun.elapsed());
}

#[test]
fn mistakes_in_settings_are_told() {
    let settings = json!({ "machine": "klingon/1", "tools": "none.tbl", "hints": { "tme": false, "position": "sometimes" }, "mostProblems": -1 });
    let mut c = Client::new(&[("a.ngc", "G21\nM2\n")], settings);
    let uri = c.open("a.ngc", None);
    let _ = c.diagnostics(&uri);
    assert!(c.hover(&uri, "G2|1").starts_with("**G21**"));
    let mut said = c.said.join("\n").replace("; ", "\n");
    said = said.replace(&c.folder.path().display().to_string(), "…");
    let mut said: Vec<&str> = said.lines().map(|l| l.trim_start_matches("gcc-robot settings: ")).collect();
    said.sort_unstable();
    insta::assert_snapshot!(said.join("\n"));
    // Sent again, they are not told again; put right, the rest is told.
    let count = c.said.len();
    c.settings = json!({ "machine": "generic/mill3", "tools": "none.tbl", "hints": { "tme": false } });
    c.notify("workspace/didChangeConfiguration", json!({ "settings": {} }));
    for _ in 0..500 {
        let _ = c.hover(&uri, "G2|1");
        if c.said.len() > count {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let new = c.said[count..].join("\n");
    assert!(!new.contains("tme") && !new.contains("klingon") && new.contains("none.tbl"), "{new}");
    c.shut_down();
}

#[test]
fn plans_that_are_not_open_are_looked_at() {
    let plan = include_str!("../../../../docs/examples/stepnc/mistakes.p21");
    let mut c = Client::pulling(&[("a.ngc", "G21\nM2\n"), ("p.p21", plan)]);
    let _ = c.open("a.ngc", None);
    let p = c.uri("p.p21");
    let symbols = c.request("workspace/symbol", json!({ "query": "workpl" }));
    let places: Vec<&Value> = symbols.as_array().into_iter().flatten().map(|s| &s["location"]).collect();
    assert!(places.len() == 1 && places[0]["uri"] == p, "{symbols}");
    for _ in 0..600 {
        let all = c.request("workspace/diagnostic", json!({ "previousResultIds": [] }));
        if let Some(of_p) = all["items"].as_array().expect("a list").iter().find(|i| i["uri"] == p) {
            let found = of_p["items"].as_array().expect("a list");
            assert!(found.iter().any(|d| d["code"] == "E0401"), "{of_p}");
            return c.shut_down();
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    panic!("nothing about {p}");
}

#[test]
fn programs_that_are_not_open_are_looked_at() {
    let files = [("a.ngc", "G21\nM2\n"), ("b.ngc", "G21\nG1 XO\nM2\n"), ("gcc-robot.toml", "schema = 1\n[project]\nmachine = \"klingon/1\"\n")];
    let mut c = Client::pulling(&files);
    assert_eq!(c.capabilities["diagnosticProvider"]["workspaceDiagnostics"], true);
    let _ = c.open("a.ngc", None);
    let b = c.uri("b.ngc");
    let report = |c: &mut Client, have: Value| {
        for _ in 0..600 {
            let all = c.request("workspace/diagnostic", json!({ "previousResultIds": have }));
            if let Some(of_b) = all["items"].as_array().expect("a list").iter().find(|i| i["uri"] == b) {
                assert_eq!(all["items"].as_array().map(Vec::len), Some(1), "open documents are asked for themselves: {all}");
                return of_b.clone();
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        panic!("nothing about {b}");
    };
    let first = report(&mut c, json!([]));
    assert_eq!((first["kind"].as_str(), first["items"][0]["range"]["start"]["line"].as_u64()), (Some("full"), Some(1)), "{first}");
    let same = report(&mut c, json!([{ "uri": b, "value": first["resultId"] }]));
    assert_eq!((same["kind"].as_str(), &same["resultId"]), (Some("unchanged"), &first["resultId"]));
    // On disk it is put right.
    c.write("b.ngc", "G21\nG1 X0 F100\nM2\n");
    let mut now = report(&mut c, json!([]));
    for _ in 0..100 {
        if now["items"] == json!([]) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
        now = report(&mut c, json!([]));
    }
    assert_eq!(now["items"], json!([]), "{now}");
    // What is wrong with the project file is pushed: nobody asks about a file that is not open.
    let project = c.uri("gcc-robot.toml");
    assert!(c.found.get(&project).is_some_and(|f| f.1[0]["message"].as_str().is_some_and(|m| m.contains("klingon/1"))), "{:?}", c.found);
    c.shut_down();
}

#[test]
fn files_that_are_not_open_are_read_from_disk() {
    let outside = tempfile::tempdir().expect("a folder");
    std::fs::write(outside.path().join("far.ngc"), "o<far> sub\nG1 X1\no<far> endsub\nG21\nM2\n").expect("written");
    let far = outside.path().display().to_string();
    let up = format!("../{}/far", outside.path().file_name().expect("a name").to_string_lossy());
    let caller = format!("G21\no<{up}> call\no<linked> call\nM2\n");
    let mut c = Client::new(&[("big.ngc", "G21 G90 F100\nT1 M6\nG1 X5\nG1 XO\nM2\n"), ("caller.ngc", &caller), ("note.txt", "none of ours")], json!({}));
    let uri = c.uri("big.ngc");
    let of = |uri: &str| json!({ "textDocument": { "uri": uri } });
    let found = c.request("textDocument/diagnostic", of(&uri));
    assert!(found["items"].as_array().is_some_and(|l| l.iter().any(|d| d["severity"] == 1 && d["range"]["start"]["line"] == 3)), "{found}");
    assert_eq!(c.request("textDocument/documentSymbol", of(&uri))[0]["name"], "T1");
    assert!(c.request("gccRobot/preview", of(&uri))["count"].as_u64() > Some(0));
    assert!(c.request("textDocument/hover", json!({ "textDocument": { "uri": uri }, "position": { "line": 2, "character": 0 } }))["contents"]["value"].as_str().is_some_and(|h| h.starts_with("**G1**")));
    let out = c.request("gccRobot/output", json!({ "textDocument": { "uri": uri }, "target": "rs274ngc", "options": {} }));
    assert_eq!(out["files"], json!([]), "it has an error");
    // It changes on disk.
    std::fs::write(c.path("big.ngc"), "G21 G90 F100\nG1 X5\nM2\n").expect("written");
    assert_eq!(c.request("textDocument/diagnostic", of(&uri))["items"], json!([]));
    // Opened, it is what the client says.
    let uri = c.open("big.ngc", Some("G21\nG1 XO\nM2\n"));
    assert!(c.diagnostics(&uri).iter().any(|d| d["severity"] == 1));
    // Nothing outside of the folders is read, by whatever name; nor what is no program.
    let text = c.uri("note.txt");
    for other in [format!("file://{far}/far.ngc"), c.uri(&format!("{up}.ngc")), text] {
        assert_eq!(c.request("textDocument/documentSymbol", of(&other)), Value::Null, "{other}");
    }
    #[cfg(unix)]
    std::os::unix::fs::symlink(outside.path().join("far.ngc"), c.path("linked.ngc")).expect("a link");
    let caller = c.open("caller.ngc", None);
    assert_eq!(c.request("textDocument/documentLink", of(&caller)), json!([]));
    for at in ["o<|..", "o<|linked"] {
        let at = c.at(&caller, at);
        assert_eq!(c.request("textDocument/definition", at), json!([]));
    }
    c.shut_down();
}

#[test]
fn callers_are_looked_at_again() {
    let mut c = Client::new(&[("m.ngc", "G21 F100\no<p> call\nM2\n"), ("p.ngc", "o<p> sub\nG1 X1\no<p> endsub\nM2\n"), ("gcc-robot.toml", "schema = 1\n[project]\nsubs = [\".\"]\n")], json!({}));
    let m = c.open("m.ngc", None);
    assert_eq!(c.diagnostics(&m), Vec::<Value>::new());
    let p = c.open("p.ngc", None);
    let _ = c.diagnostics(&p);
    c.edit(&p, "G1 X1", "G1 XO");
    let found = c.next_diagnostics(&m);
    assert!(found.iter().any(|d| d["range"]["start"]["line"] == 1 && d["severity"] == 1), "{found:?}");
    c.edit(&p, "G1 XO", "G1 X1");
    assert_eq!(c.next_diagnostics(&m), Vec::<Value>::new());
    c.shut_down();
}

/// A called file is opened with a text that is not on disk, and closed without being saved.
#[test]
fn callers_are_looked_at_again_when_a_called_file_is_opened_and_closed() {
    let mut c = Client::new(&[("m.ngc", "G21 F100\no<p> call\nM2\n"), ("p.ngc", "o<p> sub\nG1 X1\no<p> endsub\nM2\n")], json!({}));
    let m = c.open("m.ngc", None);
    assert_eq!(c.diagnostics(&m), Vec::<Value>::new());
    let p = c.open("p.ngc", Some("o<p> sub\nG1 XO\no<p> endsub\nM2\n"));
    let found = c.next_diagnostics(&m);
    assert!(found.iter().any(|d| d["range"]["start"]["line"] == 1 && d["severity"] == 1), "{found:?}");
    c.notify("textDocument/didClose", json!({ "textDocument": { "uri": p } }));
    assert_eq!(c.next_diagnostics(&m), Vec::<Value>::new());
    c.shut_down();
}

/// A call that leads out of the folders that are open, and out of those that are configured, finds nothing there.
#[test]
fn calls_lead_to_no_other_folders() {
    let outside = tempfile::tempdir().expect("a folder");
    std::fs::write(outside.path().join("out.ngc"), "o<out> sub\nG1 X77\no<out> endsub\nM2\n").expect("written");
    let name = outside.path().join("out").display().to_string();
    let below = outside.path().file_name().expect("a name").to_string_lossy().into_owned();
    let program = |call: &str| format!("G21 F100\no<{call}> call\nM2\n");
    let codes = |found: &[Value]| found.iter().filter(|d| d["severity"] == 1).map(|d| d["code"].clone()).collect::<Vec<_>>();
    let files = [("a.ngc", program(&name)), ("b.ngc", program(&format!("../{below}/out"))), ("s.ngc", "o<in> sub\nG1 X5\no<in> endsub\nM2\n".into()), ("d/c.ngc", program("../in"))];
    let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
    let mut c = Client::new(&files, json!({}));
    std::fs::rename(c.path("s.ngc"), c.path("in.ngc")).expect("renamed");
    for file in ["a.ngc", "b.ngc"] {
        let uri = c.open(file, None);
        let found = c.diagnostics(&uri);
        assert_eq!(codes(&found), ["E0250"], "{file}: {found:?}");
        let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
        assert_eq!(p["files"].as_array().map(Vec::len), Some(1), "{file}");
        let o = c.request("gccRobot/output", json!({ "textDocument": { "uri": uri }, "target": "canon" }));
        assert_eq!(o["files"], json!([]), "{file}");
    }
    // Folders above the program that are open are others' business too.
    let uri = c.open("d/c.ngc", None);
    let found = c.diagnostics(&uri);
    assert_ne!(codes(&found), ["E0250"], "{found:?}");
    c.shut_down();
    // The same program where the folder is configured.
    let mut c = Client::new(&[("e.ngc", &program("out"))], json!({ "subs": [outside.path()] }));
    let uri = c.open("e.ngc", None);
    let found = c.diagnostics(&uri);
    assert_eq!(codes(&found), Vec::<Value>::new(), "{found:?}");
    c.shut_down();
}

const CELL: &str = include_str!("../../../../docs/examples/irb2400-cell.toml");
const FAST: &str = "G21 G90 G17 G54\nT1 M6\nS12000 M3\nG0 X5000 Y0 Z5\nG1 X5100 F600\nM2\n";

/// Names in a project file are relative to it, wherever it lies in the workspace and wherever the server runs.
#[test]
fn a_project_names_its_machine_from_where_it_lies() {
    let project = "schema = 1\n[project]\nsources = [\"*.ngc\"]\nmachine = \"cell.toml\"\n";
    let mut c = Client::new(&[("cell/gcc-robot.toml", project), ("cell/cell.toml", CELL), ("cell/a.ngc", FAST)], json!({}));
    let uri = c.open("cell/a.ngc", None);
    let found = c.diagnostics(&uri);
    assert!(found.iter().any(|d| d["code"].as_str().is_some_and(|c| c.starts_with("E05"))), "the robot has its say: {found:?}");
    let toml = c.open("cell/gcc-robot.toml", None);
    assert_eq!(c.diagnostics(&toml), Vec::<Value>::new());
    c.shut_down();
}

/// Paths in the settings are relative to the folder that holds the program.
#[test]
fn settings_name_files_from_their_folder() {
    let settings = json!({ "machine": "cell.toml", "tools": "shop/t.tbl" });
    let mut c = Client::new(&[("cell.toml", CELL), ("shop/t.tbl", "T1 P1 D10 Z50 ;mill\n"), ("parts/a.ngc", FAST)], settings);
    let uri = c.open("parts/a.ngc", None);
    let found = c.diagnostics(&uri);
    assert!(found.iter().any(|d| d["code"].as_str().is_some_and(|c| c.starts_with("E05"))), "the robot has its say: {found:?}");
    assert_eq!(c.said, [""; 0]);
    c.shut_down();
}

#[test]
fn clients_without_snippets_get_text() {
    let mut c = Client::bare(&[("a.ngc", "G21 F100\nG8\nM2\n")]);
    let uri = c.open("a.ngc", None);
    let at = c.at(&uri, "G8|\n");
    let list = c.request("textDocument/completion", at);
    let items = list["items"].as_array().expect("a list");
    assert!(!items.is_empty() && items.iter().all(|i| i["insertTextFormat"] == 1 && !i["textEdit"]["newText"].as_str().unwrap_or("").contains("${")), "{items:?}");
    // Nor do they ask again for what an action does: it is told at once, when it is small.
    let ask = json!({ "textDocument": { "uri": uri }, "range": { "start": { "line": 0, "character": 0 }, "end": { "line": 0, "character": 0 } }, "context": { "diagnostics": [] } });
    let actions = c.request("textDocument/codeAction", ask);
    assert!(actions.as_array().is_some_and(|a| !a.is_empty() && a.iter().all(|a| a["edit"].is_object())), "{actions}");
    c.shut_down();
}

#[test]
fn clients_that_do_not_watch_files() {
    let mut c = Client::bare(&[("m.ngc", "G21 F100\no<p> call\nM2\n"), ("p.ngc", "o<p> sub\nG1 X1\no<p> endsub\nM2\n"), ("gcc-robot.toml", "schema = 1\n[project]\nsubs = [\".\"]\n")]);
    let m = c.open("m.ngc", None);
    assert_eq!(c.diagnostics(&m), Vec::<Value>::new());
    // Another program writes it, and nobody says so.
    std::fs::write(c.path("p.ngc"), "o<p> sub\nG1 XO\no<p> endsub\nM2\n").expect("written");
    std::thread::sleep(std::time::Duration::from_millis(1_100));
    c.edit(&m, "F100", "F101");
    let found = c.diagnostics(&m);
    assert!(found.iter().any(|d| d["severity"] == 1 && d["range"]["start"]["line"] == 1), "{found:?}");
    c.shut_down();
}

#[test]
fn folders_have_settings_of_their_own() {
    let other = tempfile::tempdir().expect("a folder");
    let mut c = Client::new(&[("a.nc", "G21\nM2\n")], json!({}));
    let folder = format!("file://{}", other.path().display());
    c.scoped.insert(folder.clone(), json!({ "dialect": "grbl" }));
    c.notify("workspace/didChangeWorkspaceFolders", json!({ "event": { "added": [{ "uri": folder, "name": "other" }], "removed": [] } }));
    let a = c.open("a.nc", None);
    let b = format!("{folder}/b.nc");
    c.notify("textDocument/didOpen", json!({ "textDocument": { "uri": b, "languageId": "gcode", "version": 1, "text": "G21\nM2\n" } }));
    let hover = |c: &mut Client, uri: &str| {
        let h = c.request("textDocument/hover", json!({ "textDocument": { "uri": uri }, "position": { "line": 0, "character": 1 } }));
        h["contents"]["value"].as_str().unwrap_or("").to_lowercase()
    };
    for _ in 0..500 {
        if hover(&mut c, &b).contains("grbl") {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert!(hover(&mut c, &b).contains("grbl") && !hover(&mut c, &a).contains("grbl"));
    c.shut_down();
}
