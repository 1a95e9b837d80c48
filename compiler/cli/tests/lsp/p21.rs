//! STEP-NC.

use serde_json::json;

use crate::client::{Client, apply, tree, with_hints};

pub const PLAN: &str = "\
ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('test'),'1');
FILE_NAME('t.p21','2026-01-01',('a'),('b'),'','','');
FILE_SCHEMA(('MACHINING_SCHEMA','MILLING_SCHEMA'));
ENDSEC;
DATA;
#1=PROJECT('PLATE',#2,(#4),$,$,$);
#2=WORKPLAN('MAIN',(#10),$,#8,$);
#4=WORKPIECE('BLOCK',#6,0.01,$,$,#81,());
#6=MATERIAL('ST-50','STEEL',());
#8=SETUP('SETUP1',#71,#62,(#9));
#9=WORKPIECE_SETUP(#4,#74,$,$,());
#10=MACHINING_WORKINGSTEP('WS DRILL',#62,#16,#19,$);
#16=ROUND_HOLE('HOLE1',#4,(#19),#83,#65,#92,$,#26);
#19=DRILLING($,$,'DRILL1',10.,$,#44,#45,#41,$,$,$,$,$,#17);
#17=DRILLING_TYPE_STRATEGY($,$,$,$,$,$);
#26=THROUGH_BOTTOM_CONDITION();
#41=MILLING_MACHINE_FUNCTIONS(.T.,$,$,.F.,$,(),.T.,$,$,());
#44=MILLING_CUTTING_TOOL('SPIRAL_DRILL_8',#46,(#48),80.,$,$);
#45=MILLING_TECHNOLOGY(0.001,.TCP.,$,-20.,$,.F.,.F.,.F.,$);
#46=TWIST_DRILL(#47,2,.RIGHT.,.F.,$);
#47=MILLING_TOOL_DIMENSION(8.,59.,$,30.,0.,$,$);
#48=CUTTING_COMPONENT(80.,$,$,$,$);
#62=PLANE('SECURITY',#63);
#63=AXIS2_PLACEMENT_3D('P',#64,$,$);
#64=CARTESIAN_POINT('',(0.,0.,30.));
#65=PLANE('DEPTH',#66);
#66=AXIS2_PLACEMENT_3D('D',#67,$,$);
#67=CARTESIAN_POINT('',(0.,0.,-20.));
#71=AXIS2_PLACEMENT_3D('SETUP',#72,$,$);
#72=CARTESIAN_POINT('',(0.,0.,0.));
#74=AXIS2_PLACEMENT_3D('WP',#72,$,$);
#81=BLOCK('RAW',#82,100.,80.,20.);
#82=AXIS2_PLACEMENT_3D('B',#84,$,$);
#83=AXIS2_PLACEMENT_3D('H',#85,$,$);
#84=CARTESIAN_POINT('',(0.,0.,-20.));
#85=CARTESIAN_POINT('',(20.,30.,0.));
#92=TOLERANCED_LENGTH_MEASURE(8.,#93);
#93=PLUS_MINUS_VALUE(0.1,0.1,3);
#99=CARTESIAN_POINT('UNUSED',(1.,2.,3.));
ENDSEC;
END-ISO-10303-21;
";

fn plan() -> (Client, String) {
    let mut c = Client::new(&[("plate.p21", PLAN)], json!({}));
    let uri = c.open("plate.p21", None);
    (c, uri)
}

#[test]
fn diagnostics_follow_edits() {
    let (mut c, uri) = plan();
    let errors = |found: &[serde_json::Value]| found.iter().filter(|d| d["severity"] == 1).map(|d| d["code"].as_str().unwrap_or("").to_string()).collect::<Vec<_>>();
    let found = c.diagnostics(&uri);
    assert_eq!(errors(&found), [""; 0], "{found:?}");
    c.edit(&uri, "#46=TWIST_DRILL", "#46=TWIST_DRIL");
    let found = c.diagnostics(&uri);
    let first = found.iter().find(|d| d["severity"] == 1).expect("an error");
    assert!(c.place(&uri, &first["range"]).contains("TWIST_DRIL"), "{first}");
    c.edit(&uri, "#46=TWIST_DRIL(", "#46=TWIST_DRILL(");
    assert_eq!(errors(&c.diagnostics(&uri)), [""; 0]);
    c.shut_down();
}

#[test]
fn hover_entities_attributes_references() {
    let (mut c, uri) = plan();
    let mut all = String::new();
    for at in ["#10=MACHINING_WORK|INGSTEP", "'WS DRILL',#62,#1|6", "(0.001|,.TCP.", ",-2|0.,$,.F.", ".RI|GHT.", "(|0.,0.,30.)", "#92=TOLERANCED_LENGTH_MEASURE(8.,#9|3)"] {
        all += &format!("=== {at}\n{}\n", c.hover(&uri, at));
    }
    insta::assert_snapshot!(all);
    c.shut_down();
}

#[test]
fn attribute_names_as_hints() {
    let (mut c, uri) = plan();
    let range = json!({ "start": { "line": 20, "character": 0 }, "end": { "line": 23, "character": 0 } });
    let hints = c.request("textDocument/inlayHint", json!({ "textDocument": { "uri": uri }, "range": range }));
    let shown = with_hints(PLAN, &hints);
    insta::assert_snapshot!(shown.lines().skip(20).take(3).collect::<Vec<_>>().join("\n"));
    c.shut_down();
}

#[test]
fn names() {
    let (mut c, uri) = plan();
    let at = c.at(&uri, "'WS DRILL',#62,#1|6");
    let found = c.request("textDocument/definition", at.clone());
    assert_eq!(c.places(&found), ["plate.p21:15 #16"]);
    let mut references = c.at(&uri, "#1|9=DRILLING");
    references["context"] = json!({ "includeDeclaration": true });
    let found = c.request("textDocument/references", references);
    assert_eq!(c.places(&found), ["plate.p21:14 #19", "plate.p21:15 #19", "plate.p21:16 #19"]);
    let at = c.at(&uri, "#1|9=DRILLING");
    let lights = c.request("textDocument/documentHighlight", at);
    assert_eq!(lights.as_array().map(Vec::len), Some(3));
    let at = c.at(&uri, "#1|9=DRILLING");
    assert_eq!(c.request("textDocument/prepareRename", at.clone())["placeholder"], "#19");
    let mut rename = at.clone();
    rename["newName"] = "#500".into();
    let edit = c.request("textDocument/rename", rename.clone());
    assert_eq!(c.edited(&uri, &edit), PLAN.replace("#19", "#500"));
    rename["newName"] = "#10".into();
    let id = c.begin("textDocument/rename", rename);
    assert!(c.answer(id)["error"]["message"].as_str().is_some_and(|m| m.contains("taken")));
    let item = c.request("textDocument/prepareCallHierarchy", at)[0].clone();
    assert_eq!((item["name"].as_str(), item["detail"].as_str()), (Some("#19"), Some("drilling 'DRILL1'")));
    let name = |calls: &serde_json::Value, side: &str| -> Vec<String> {
        calls.as_array().expect("a list").iter().map(|f| f[side]["name"].as_str().unwrap_or("").to_string()).collect()
    };
    let calls = c.request("callHierarchy/incomingCalls", json!({ "item": item }));
    assert_eq!(name(&calls, "from"), ["#10", "#16"]);
    let calls = c.request("callHierarchy/outgoingCalls", json!({ "item": item }));
    assert_eq!(name(&calls, "to"), ["#44", "#45", "#41", "#17"]);
    c.shut_down();
}

fn holds(range: &serde_json::Value, at: &serde_json::Value) -> bool {
    let place = |p: &serde_json::Value| (p["line"].as_u64(), p["character"].as_u64());
    place(&range["start"]) <= place(at) && place(at) <= place(&range["end"])
}

#[test]
fn outline_folding_selection_lenses() {
    let (mut c, uri) = plan();
    let document = json!({ "textDocument": { "uri": uri } });
    let symbols = c.request("textDocument/documentSymbol", document.clone());
    insta::assert_snapshot!("outline", tree(&symbols, 0));
    // Editors find the entry around the cursor by its place: from the file's sections down each lies in the one above it.
    let mut found = Vec::new();
    for at in ["#1=PRO|JECT", "#10=MACHINING|", "#19=DRILL|ING", "#44=MILLING_CUTTING|", "#66=|"] {
        let at = c.position(&uri, at);
        let (mut list, mut names) = (symbols.clone(), Vec::new());
        while let Some(around) = list.as_array().and_then(|l| l.iter().find(|s| holds(&s["range"], &at))).cloned() {
            names.push(around["name"].as_str().unwrap_or("").to_string());
            list = around["children"].clone();
        }
        found.push(names.join(" > "));
    }
    assert_eq!(found, ["PLATE", "DATA > WS DRILL", "DATA > DRILL1", "DATA > SPIRAL_DRILL_8", "DATA"]);
    let folds = c.request("textDocument/foldingRange", document.clone());
    let lines: Vec<_> = folds.as_array().expect("a list").iter().map(|f| (f["startLine"].as_u64(), f["endLine"].as_u64())).collect();
    assert!(lines.contains(&(Some(1), Some(5))) && lines.contains(&(Some(6), Some(41))), "{lines:?}");
    let positions = json!({ "textDocument": { "uri": uri }, "positions": [c.position(&uri, "(0.,0.,3|0.)")] });
    let mut chain = c.request("textDocument/selectionRange", positions)[0].clone();
    let mut texts = Vec::new();
    while !chain.is_null() {
        texts.push(c.place(&uri, &chain["range"]));
        chain = chain["parent"].clone();
    }
    assert_eq!(texts[..2], ["plate.p21:27 30.", "plate.p21:27 0.,0.,30."]);
    let lenses = c.request("textDocument/codeLens", document);
    let all: Vec<String> = lenses.as_array().expect("a list").iter().map(|l| format!("{}: {}", l["range"]["start"]["line"], l["command"]["title"].as_str().unwrap_or(""))).collect();
    insta::assert_snapshot!("lenses", all.join("\n"));
    c.shut_down();
}

#[test]
fn completion_and_signature() {
    let (mut c, uri) = plan();
    c.edit(&uri, "#99=", "#200=PLANE_RO\n#99=");
    let entities = c.labels(&uri, "#200=PLANE_RO|");
    assert_eq!(entities, ["PLANE_ROUGH_MILLING"]);
    c.edit(&uri, "#200=PLANE_RO", "#200=MACHINING_WORKINGSTEP('X',#62,#");
    let features = c.labels(&uri, "('X',#62,#|");
    assert_eq!(features, ["#16"]);
    let at = c.at(&uri, "('X',#62,#|");
    let help = c.request("textDocument/signatureHelp", at);
    let label = help["signatures"][0]["label"].as_str().unwrap_or("");
    assert!(label.starts_with("MACHINING_WORKINGSTEP(its_id, its_secplane, its_feature"), "{label}");
    assert_eq!(help["activeParameter"], 2);
    c.edit(&uri, "#200=MACHINING_WORKINGSTEP('X',#62,#", "#200=TWIST_DRILL(#47,2,.");
    let hands = c.labels(&uri, "(#47,2,.|");
    assert!(hands.contains(&".RIGHT.".to_string()), "{hands:?}");
    c.shut_down();
}

#[test]
fn tokens_and_formatting() {
    let (mut c, uri) = plan();
    let types: Vec<String> = c.capabilities["semanticTokensProvider"]["legend"]["tokenTypes"].as_array().expect("a legend").iter().map(|t| t.as_str().unwrap_or("").into()).collect();
    let full = c.request("textDocument/semanticTokens/full", json!({ "textDocument": { "uri": uri } }));
    let kinds: std::collections::BTreeSet<&str> = full["data"].as_array().expect("numbers").chunks(5).map(|t| types[t[3].as_u64().unwrap_or(0) as usize].as_str()).collect();
    assert_eq!(kinds.into_iter().collect::<Vec<_>>(), ["enumMember", "number", "operator", "string", "type", "variable"]);
    c.edit(&uri, "#6=MATERIAL('ST-50',", "#6 = MATERIAL ( 'ST-50' ,");
    let edits = c.request("textDocument/formatting", json!({ "textDocument": { "uri": uri }, "options": { "tabSize": 2, "insertSpaces": true } }));
    let formatted = apply(c.text(&uri), &edits);
    assert!(formatted.contains("#6=MATERIAL('ST-50','STEEL',());"), "{formatted}");
    c.shut_down();
}

#[test]
fn actions() {
    let (mut c, uri) = plan();
    let act = |c: &mut Client, at: &str, wanted: &str| {
        let position = c.position(&uri, at);
        let params = json!({ "textDocument": { "uri": uri }, "range": { "start": position, "end": position }, "context": { "diagnostics": [] } });
        let actions = c.request("textDocument/codeAction", params);
        let list = actions.as_array().expect("a list").clone();
        let titles: Vec<&str> = list.iter().filter_map(|a| a["title"].as_str()).collect();
        let action = list.iter().find(|a| a["title"].as_str().is_some_and(|t| t.starts_with(wanted)));
        let action = action.unwrap_or_else(|| panic!("{wanted} is not among {titles:?}"));
        c.edited(&uri, &action["edit"])
    };
    let less = act(&mut c, "#1|0=", "Remove instances that");
    assert_eq!(less, PLAN.replace("#99=CARTESIAN_POINT('UNUSED',(1.,2.,3.));\n", ""));
    let numbered = act(&mut c, "#1|0=", "Number instances");
    assert!(numbered.contains("#7=MACHINING_WORKINGSTEP('WS DRILL',"), "{numbered}");
    c.edit(&uri, "#19=DRILLING($,$,'DRILL1',10.,$,#44,", "#19=DRILLING($,$,'DRILL1',10.,$,#444,");
    let made = act(&mut c, ",$,#4|44,", "Create #444 as MILLING_CUTTING_TOOL");
    let _ = c.diagnostics(&uri);
    let position = c.position(&uri, ",$,#4|44,");
    let params = json!({ "textDocument": { "uri": uri }, "range": { "start": position, "end": position }, "context": { "diagnostics": [] } });
    let offered = c.request("textDocument/codeAction", params);
    let create = offered.as_array().and_then(|l| l.iter().find(|a| a["title"].as_str().is_some_and(|t| t.starts_with("Create"))));
    assert_eq!(create.map(|a| a["diagnostics"][0]["message"].as_str().unwrap_or("").starts_with("#444 does not exist")), Some(true), "{create:?}");
    assert!(made.contains("\n#444=MILLING_CUTTING_TOOL('',$,(),$,$,$);"), "{made}");
    c.shut_down();
}

#[test]
fn dialect_fixes_are_offered() {
    let text = PLAN.replace("#47=MILLING_TOOL_DIMENSION", "#47=TOOL_DIMENSION");
    let mut c = Client::new(&[("plate.p21", &text)], json!({}));
    let uri = c.open("plate.p21", None);
    let _ = c.diagnostics(&uri);
    let position = c.position(&uri, "#47=TOOL_DI|MENSION");
    let params = json!({ "textDocument": { "uri": uri }, "range": { "start": position, "end": position }, "context": { "diagnostics": [], "only": ["quickfix"] } });
    let actions = c.request("textDocument/codeAction", params);
    let fix = actions.as_array().and_then(|a| a.iter().find(|a| !a["diagnostics"].is_null())).cloned().expect("a fix");
    assert_eq!(c.edited(&uri, &fix["edit"]), PLAN);
    c.shut_down();
}

#[test]
fn choices_are_put_right() {
    for (wrong, titles) in [(".RIGTH.", vec!["write .RIGHT."]), (".UP.", vec!["write .LEFT.", "write .RIGHT.", "write .NEUTRAL."])] {
        let text = PLAN.replace(".RIGHT.", wrong);
        let mut c = Client::new(&[("plate.p21", &text)], json!({}));
        let uri = c.open("plate.p21", None);
        let _ = c.diagnostics(&uri);
        let position = c.position(&uri, "#46=TWIST_DRILL(#47,2,.|");
        let params = json!({ "textDocument": { "uri": uri }, "range": { "start": position, "end": position }, "context": { "diagnostics": [], "only": ["quickfix"] } });
        let actions = c.request("textDocument/codeAction", params);
        let mut offered: Vec<&str> = actions.as_array().into_iter().flatten().filter_map(|a| a["title"].as_str()).collect();
        offered.sort_unstable();
        let mut titles = titles;
        titles.sort_unstable();
        assert_eq!(offered, titles);
        let right = actions.as_array().and_then(|a| a.iter().find(|a| a["title"] == "write .RIGHT.")).expect("the right one");
        assert_eq!(c.edited(&uri, &right["edit"]), PLAN);
        c.shut_down();
    }
}

#[test]
fn units_are_put_right() {
    let text = include_str!("../../../../docs/examples/stepnc/mistakes.p21");
    let mut c = Client::new(&[("a.p21", text)], json!({}));
    let uri = c.open("a.p21", None);
    let found = c.diagnostics(&uri);
    let mut fixed = Vec::new();
    for d in found.iter().filter(|d| ["E0423", "E0424", "E0425", "E0426", "E0428"].contains(&d["code"].as_str().unwrap_or(""))) {
        let params = json!({ "textDocument": { "uri": uri }, "range": d["range"], "context": { "diagnostics": [d], "only": ["quickfix"] } });
        let actions = c.request("textDocument/codeAction", params);
        for a in actions.as_array().expect("a list").iter().filter(|a| a["diagnostics"][0]["code"] == d["code"]) {
            let new = c.edited(&uri, &a["edit"]);
            let line = d["range"]["start"]["line"].as_u64().expect("a line") as usize;
            fixed.push(format!("{} {}: {}", d["code"].as_str().unwrap_or(""), a["title"].as_str().unwrap_or(""), new.lines().nth(line).unwrap_or("")));
        }
    }
    insta::assert_snapshot!(fixed.join("\n"));
    c.shut_down();
}

#[test]
fn names_of_entities_lead_to_their_pages() {
    let (mut c, uri) = plan();
    let at = c.at(&uri, "#46=TWIST|_DRILL");
    let found = c.request("textDocument/definition", at);
    assert_eq!(found[0]["uri"], "gcc-robot-explain:/TWIST_DRILL.md");
    let page = c.request("gccRobot/explain", json!({ "code": "TWIST_DRILL" }));
    let text = page["markdown"].as_str().expect("a page");
    assert!(text.starts_with("# TWIST_DRILL") && text.contains("A kind of ") && text.contains("ISO 14649-111"), "{text}");
    // A word in a string is none.
    let at = c.at(&uri, "'WS DR|ILL'");
    assert_eq!(c.request("textDocument/definition", at), json!([]));
    c.shut_down();
}

#[test]
fn units_that_nobody_states_are_told_in_both_readings() {
    // 0.24 and -9000 can't be m/s and 1/s: no machine turns that fast.
    let text = PLAN.replace(",-20.,$,.F.", ",-9000.,$,.F.");
    assert!(text != PLAN);
    let mut c = Client::new(&[("plate.p21", &text), ("said/plate.p21", &text), ("said/gcc-robot.toml", "schema = 1\n[project]\nstep-units = \"step-modeler\"\n")], json!({}));
    let uri = c.open("plate.p21", None);
    let told = c.hover(&uri, ",-9|000.,$,.F.");
    assert!(told.contains("540000 rpm") && told.contains("9000 rpm, clockwise") && told.contains("step-units"), "{told}");
    let line = c.at(&uri, ",-9|000.,$,.F.")["position"]["line"].as_u64().expect("a line");
    let range = json!({ "start": { "line": line, "character": 0 }, "end": { "line": line + 1, "character": 0 } });
    let hints = |c: &mut Client, uri: &str| c.request("textDocument/inlayHint", json!({ "textDocument": { "uri": uri }, "range": range })).to_string();
    assert!(hints(&mut c, &uri).contains(" 1/s or rpm"));
    let said = c.open("said/plate.p21", None);
    let told = c.hover(&said, ",-9|000.,$,.F.");
    assert!(told.contains("9000 rpm, clockwise") && !told.contains("1/s"), "{told}");
    let shown = hints(&mut c, &said);
    assert!(shown.contains("\" rpm\"") && !shown.contains("1/s"), "{shown}");
    c.shut_down();
}
