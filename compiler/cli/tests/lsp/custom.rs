//! Requests of our own.

use serde_json::{Value, json};

use crate::client::Client;
use crate::gcode::part;

/// Bytes of base64.
fn bytes(v: &Value) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let text: Vec<u8> = v.as_str().unwrap_or("").bytes().filter(|b| *b != b'=').collect();
    let mut out = Vec::new();
    for four in text.chunks(4) {
        let n = four.iter().fold(0u32, |n, c| n << 6 | u32::from(digit(*c))) << (6 * (4 - four.len()));
        out.extend(&n.to_be_bytes()[1..four.len()]);
    }
    out
}

pub fn floats(v: &Value) -> Vec<f32> {
    bytes(v).chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

pub fn integers(v: &Value) -> Vec<u32> {
    bytes(v).chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

#[test]
fn preview_has_the_path_with_its_lines() {
    let text = "G21 G90 G17 F600\nG0 X0 Y0 Z5\nG1 Z-1\nX10\nG2 X20 Y10 I0 J10\nM2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    let (points, kinds, lines) = (floats(&p["positions"]), bytes(&p["kinds"]), integers(&p["lines"]));
    let count = p["count"].as_u64().expect("a number") as usize;
    assert_eq!((points.len(), kinds.len(), lines.len()), (3 * count, count, count));
    let at = |x: f32, y: f32, z: f32| points.chunks(3).position(|q| q == [x, y, z]).expect("a point");
    assert_eq!((kinds[at(0.0, 0.0, -1.0)], lines[at(0.0, 0.0, -1.0)]), (1, 2));
    assert_eq!((kinds[at(10.0, 0.0, -1.0)], lines[at(10.0, 0.0, -1.0)]), (1, 3));
    let end = at(20.0, 10.0, -1.0);
    assert_eq!((kinds[end], lines[end], end), (2, 4, count - 1));
    assert!(kinds.iter().filter(|k| **k == 2).count() > 5 && kinds[0] == 255, "{kinds:?}");
    let times = floats(&p["times"]);
    // 5 mm rapid at 100 mm/s; 6 + 10 mm and three quarters of a turn of radius 10 at 10 mm/s.
    assert!((times[end] - (0.05 + (6.0 + 10.0 + 47.124) / 10.0)).abs() < 0.01, "{times:?}");
    assert_eq!(floats(&p["feeds"])[end], 600.0);
    assert_eq!(p["bounds"][1], json!([20.0, 20.0, 5.0]));
    let again = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri }, "have": p["key"] }));
    assert_eq!((again["unchanged"].as_bool(), again["positions"].as_str()), (Some(true), Some("")));
    c.edit(&uri, "X10", "X11");
    let after = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri }, "have": p["key"] }));
    assert_eq!((after["unchanged"].as_bool(), after["version"].as_i64()), (Some(false), Some(2)));
    c.shut_down();
}

#[test]
fn preview_knows_tools_subs_and_machine() {
    let (mut c, uri) = part();
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    let tools: Vec<_> = p["tools"].as_array().expect("a list").iter().map(|t| (t["number"].as_i64(), t["diameter"].as_f64(), t["line"].as_u64())).collect();
    assert_eq!(tools, [(Some(1), Some(10.0), Some(4)), (Some(2), Some(5.0), Some(21))]);
    c.shut_down();
    let text = "G21 G90 F600\nG1 X10 Y0\nG1 X9 Y5\nM2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({ "machine": "ufmg/plano-3r" }));
    let uri = c.open("a.ngc", None);
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    assert_eq!(p["machine"]["id"], "ufmg/plano-3r");
    let joints = floats(&p["machine"]["values"]);
    assert_eq!(joints.len(), 3 * p["count"].as_u64().expect("a number") as usize);
    assert!(joints.iter().any(|v| v.is_finite()));
    assert_eq!(p["machine"]["figure"]["lines"], json!([5]), "base, two joints, wrist, tool");
    // The figure ends in the tool: its last point is a point of the path.
    let (path, figure) = (floats(&p["positions"]), floats(&p["machine"]["figure"]["points"]));
    let every = p["machine"]["figure"]["every"].as_u64().expect("a number") as usize;
    assert_eq!((every, figure.len()), (1, path.len() * 5));
    assert!(figure.chunks(15).zip(path.chunks(3)).all(|(f, p)| f[12].is_nan() || (f[12] - p[0]).abs() < 1e-3 && (f[13] - p[1]).abs() < 1e-3));
    assert!(c.hover(&uri, "G1 X|9").contains("joints at the end (of several solutions the nearest): "));
    c.shut_down();
}

/// A rapid of a robot turns all joints evenly: the tool point goes in a bow, and that is what is drawn.
#[test]
fn preview_bends_joint_rapids() {
    let flat = "G21 G90 F600\nG1 X-80 Y20\nG0 X80 Y20\nG1 X80 Y10\nM2\n";
    let arm = "G21 G90 F600\nG0 X450 Y-200 Z300\nG0 X450 Y200\nG1 X450 Y190\nM2\n";
    for (machine, text, bent) in [("ufmg/plano-3r", flat, true), ("kuka/kr6-r900", arm, true), ("generic/mill3", flat, false)] {
        let mut c = Client::new(&[("a.ngc", text)], json!({ "machine": machine }));
        let uri = c.open("a.ngc", None);
        let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
        assert_eq!(p["machine"]["id"], machine);
        let (path, kinds, times) = (floats(&p["positions"]), bytes(&p["kinds"]), floats(&p["times"]));
        let rapid: Vec<&[f32]> = path.chunks(3).zip(&kinds).filter(|(_, k)| **k == 0).map(|(q, _)| q).collect();
        assert_eq!(rapid.len() > 4, bent, "{machine}: {rapid:?}");
        let off = |q: &&[f32]| if text == arm { q[0] - 450.0 } else { q[1] - 20.0 };
        assert_eq!(rapid.iter().any(|q| off(q).abs() > 1.0), bent, "{machine}: {rapid:?}");
        let end = rapid.last().map(|q| [q[0], q[1]]);
        assert_eq!(end, Some(if text == arm { [450.0, 200.0] } else { [80.0, 20.0] }), "{machine}");
        assert!(times.is_sorted() && kinds.len() == times.len(), "{machine}");
        let joints = floats(&p["machine"]["values"]);
        assert!(machine == "generic/mill3" || joints.len() % kinds.len() == 0 && joints.iter().any(|v| v.is_finite()), "{machine}");
        c.shut_down();
    }
}

#[test]
fn preview_shows_the_raw_part() {
    let mut c = Client::new(&[], json!({}));
    let text = include_str!("../../../../docs/examples/stepnc/case-study.p21");
    let uri = c.open("plate.p21", Some(text));
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    let stock = p["stock"].as_array().unwrap_or_else(|| panic!("no raw part: {}", p["stock"]));
    let corner = |i: usize| stock[i].as_array().expect("a corner").iter().map(|v| v.as_f64().expect("a number")).collect::<Vec<_>>();
    let (low, high, cut) = (corner(0), corner(1), &p["cut"]);
    assert!((0..3).all(|i| low[i] < high[i]), "{stock:?}");
    // The part is cut out of it: in depth the tool does not come below it by more than a drill's point.
    assert!(cut[0][2].as_f64() < Some(high[2]) && cut[0][2].as_f64() > Some(low[2] - 10.0), "{cut} {stock:?}");
    assert_eq!(p["tools"][0]["diameter"].is_number(), true);
    // Every point leads to its workingstep, and every tool to the step that mounts it.
    let source: Vec<&str> = text.lines().collect();
    let lines = integers(&p["lines"]);
    assert!(!lines.is_empty() && lines.iter().all(|l| source[*l as usize].contains("=MACHINING_WORKINGSTEP(")), "{lines:?}");
    for tool in p["tools"].as_array().expect("tools") {
        let line = source[tool["line"].as_u64().expect("a line") as usize];
        assert!(line.contains("=MACHINING_WORKINGSTEP("), "{line}");
    }
    c.shut_down();
}

#[test]
fn preview_shows_the_raw_part_that_the_project_states() {
    let project = "schema = 1\n[project]\nstock = [[100, 0, -20], [0, 60, 0.5]]\n";
    let mut c = Client::new(&[("gcc-robot.toml", project), ("a.ngc", "G21 G0 X5\nM2\n")], json!({}));
    let uri = c.open("a.ngc", None);
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    assert_eq!(p["stock"], json!([[0.0, 0.0, -20.0], [100.0, 60.0, 0.5]]));
    c.shut_down();
}

/// A cell and a program that needs its arm to reach over.
const CELL: &str = include_str!("../../../../docs/examples/irb2400-cell.toml");
const CUTS: &str = "G21 G90 G17 F600\nT1 M6\nG0 X0 Y0 Z20\nG1 Z5\nX60\nG3 X60 Y40 J20\nG1 X0\nM2\n";

#[test]
fn preview_and_hover_have_the_joints_of_the_plan() {
    let mut c = Client::new(&[("a.ngc", CUTS), ("cell.toml", CELL)], json!({ "machine": "cell.toml" }));
    let uri = c.open("a.ngc", None);
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    let m = &p["machine"];
    assert_eq!((m["note"].as_str(), m["id"].as_str()), (Some(""), Some("example/irb2400-cell")));
    // The part lies at 900 -100 450 in the base: the base is the other way.
    let frames: Vec<(String, Vec<f64>)> = m["frames"]
        .as_array()
        .expect("frames")
        .iter()
        .map(|f| (f["name"].as_str().unwrap_or("").into(), f["origin"].as_array().expect("a place").iter().filter_map(Value::as_f64).map(f64::round).collect()))
        .collect();
    let expected = [("base", [-900.0, 100.0, -450.0]), ("table", [0.0, 0.0, -50.0]), ("part", [0.0, 0.0, 0.0])];
    assert_eq!(frames, expected.map(|(n, p)| (n.to_string(), p.to_vec())));
    let (path, lines, values) = (floats(&p["positions"]), integers(&p["lines"]), floats(&m["values"]));
    let last = lines.iter().rposition(|l| *l == 4).expect("the cut along X");
    let joints = &values[6 * last..6 * last + 6];
    // The figure's first point is the base, its last the tool on the path.
    let nodes = m["figure"]["lines"][0].as_u64().expect("a number") as usize;
    let figure = floats(&m["figure"]["points"]);
    assert_eq!(figure.len(), 3 * nodes * lines.len());
    let at = &figure[3 * nodes * last..3 * nodes * (last + 1)];
    assert!([-900.0, 100.0, -450.0].iter().zip(&at[..3]).all(|(a, b)| (a - b).abs() < 0.01), "{at:?}");
    assert!(path[3 * last..].iter().zip(&at[3 * nodes - 3..]).all(|(a, b)| (a - b).abs() < 0.1), "{at:?}");
    // Hover has the same joint values as the path, and both those of the program that is built.
    let hover = c.hover(&uri, "X6|0\n");
    let text = hover.split("joints at the end: ").nth(1).and_then(|t| t.lines().next()).map(str::trim).unwrap_or_else(|| panic!("{hover}"));
    let shown: Vec<f32> = text.split(", ").map(|j| j.rsplit(' ').next().and_then(|v| v.trim_end_matches('°').trim().parse().ok()).expect("degrees")).collect();
    assert!(shown.iter().zip(joints).all(|(a, b)| (a - b).abs() < 0.01), "{shown:?} {joints:?}");
    let out = c.request("gccRobot/output", json!({ "textDocument": { "uri": uri }, "target": "joint-gcode", "options": {} }));
    let (text, map) = (out["files"][0]["text"].as_str().expect("text"), integers(&out["files"][0]["lines"]));
    let n = map.iter().rposition(|l| *l == 4).unwrap_or_else(|| panic!("no line of the cut in {map:?}"));
    let line = text.lines().nth(n).expect("the line");
    let word = |v: f32| line.split(' ').any(|w| w[1..].parse::<f32>().is_ok_and(|w| (w - v).abs() < 0.01));
    assert!(shown.iter().all(|v| word(*v)), "{line} {shown:?}");
    c.shut_down();
}

#[test]
fn no_joints_without_a_plan() {
    let far = CUTS.replace("X60\n", "X6000\n");
    let mut c = Client::new(&[("a.ngc", &far), ("cell.toml", CELL)], json!({ "machine": "cell.toml" }));
    let uri = c.open("a.ngc", None);
    let p = c.request("gccRobot/preview", json!({ "textDocument": { "uri": uri } }));
    assert!(p["machine"]["note"].as_str().is_some_and(|n| !n.is_empty()), "{}", p["machine"]["note"]);
    assert_eq!(p["machine"]["values"], "");
    let hover = c.hover(&uri, "X6|000\n");
    assert!(hover.contains("joints: not known, "), "{hover}");
    c.shut_down();
}

#[test]
fn output_of_targets() {
    let text = "G21 G90 G17 F600\nG0 X0 Y0 Z5\no<a> sub\n  G1 X#1\no<a> endsub\no<a> call [10]\nM2\n";
    let mut c = Client::new(&[("a.ngc", text)], json!({}));
    let uri = c.open("a.ngc", None);
    let ask = |c: &mut Client, target: &str, options: Value| c.request("gccRobot/output", json!({ "textDocument": { "uri": uri }, "target": target, "options": options }));
    let out = ask(&mut c, "rs274ngc", json!({ "decimals": 2 }));
    assert_eq!((out["error"].clone(), out["files"][0]["name"].as_str()), (Value::Null, Some("a.ngc")));
    let written = out["files"][0]["text"].as_str().unwrap_or("");
    assert!(written.contains("X10"), "{written}");
    let lines = integers(&out["files"][0]["lines"]);
    let at = written.lines().position(|l| l.contains("X10")).expect("the move");
    assert_eq!(lines.len(), written.lines().count());
    assert_eq!(lines[at], 3, "{lines:?}");
    let out = ask(&mut c, "canon", json!({}));
    let written = out["files"][0]["text"].as_str().unwrap_or("");
    let at = written.lines().position(|l| l.contains("STRAIGHT_FEED")).expect("the move");
    assert_eq!(integers(&out["files"][0]["lines"])[at], 3);
    assert!(ask(&mut c, "no-such", json!({}))["error"].as_str().is_some_and(|e| e.contains("no-such")));
    assert!(ask(&mut c, "rs274ngc", json!({ "wings": 2 }))["error"].is_string());
    let png = ask(&mut c, "png", json!({}));
    assert!(bytes(&png["files"][0]["base64"]).starts_with(b"\x89PNG"));
    c.edit(&uri, "[10]", "[ten]");
    let bad = ask(&mut c, "rs274ngc", json!({}));
    assert_eq!(bad["files"], json!([]));
    assert!(bad["diagnostics"].as_array().is_some_and(|d| d.iter().any(|d| d["severity"] == 1)), "{bad}");
    c.shut_down();
}

/// Every target that is written line by line says where its lines come from.
#[test]
fn outputs_go_with_their_source_line_by_line() {
    let mut c = Client::new(&[("a.ngc", CUTS), ("cell.toml", CELL)], json!({ "machine": "cell.toml" }));
    let uri = c.open("a.ngc", None);
    // A word of the cut along X (line 5 of the program) in each language.
    let cut = [("rapid", "MoveL"), ("krl", "LIN"), ("fanuc-ls", ":L "), ("urscript", "movel"), ("val3", "movel"), ("motion", "line"), ("rs274ngc", "X60"), ("canon", "STRAIGHT_FEED"), ("joint-gcode", "G1")];
    for (target, word) in cut {
        // The arm needs a maker's language it is not made for: only the text counts here.
        let out = c.request("gccRobot/output", json!({ "textDocument": { "uri": uri }, "target": target, "options": {} }));
        let file = &out["files"][0];
        let (text, map) = (file["text"].as_str().unwrap_or_else(|| panic!("{target}: {out}")), integers(&file["lines"]));
        assert_eq!(map.len(), text.lines().count(), "{target}");
        let of_cut: Vec<&str> = text.lines().zip(&map).filter(|(_, m)| **m == 4).map(|(l, _)| l).collect();
        assert!(of_cut.iter().any(|l| l.contains(word)), "{target}: {of_cut:?} of\n{text}");
        assert!(!text.contains('\u{1}') && map.iter().all(|m| *m == u32::MAX || *m < 8), "{target}");
        // What comes later in the program does not come earlier in its translation.
        let order: Vec<u32> = map.iter().copied().filter(|m| *m != u32::MAX).collect();
        assert!(order.windows(2).all(|w| w[0] <= w[1]), "{target}: {order:?}");
    }
    c.shut_down();
}

#[test]
fn state_around_a_block() {
    let (mut c, uri) = part();
    let at = c.at(&uri, "G2| X20");
    let s = c.request("gccRobot/state", at);
    assert_eq!((s["reached"].as_bool(), s["line"].as_u64()), (Some(true), Some(11)));
    assert_eq!(s["before"]["position"], json!([10.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!(s["after"]["position"][0], 20.0);
    assert_eq!((s["before"]["tool"].as_i64(), s["before"]["feed"].as_f64(), s["after"]["feed"].as_f64()), (Some(1), Some(300.0), Some(600.0)));
    assert!(s["after"]["codes"].as_array().is_some_and(|c| c.contains(&json!("G2")) && c.contains(&json!("M3"))));
    assert_eq!((s["block"]["radius"].as_f64(), s["block"]["sweep"].as_f64().map(f64::round)), (Some(10.0), Some(-270.0)));
    c.shut_down();
}

#[test]
fn choices_and_explanations() {
    let (mut c, _) = part();
    let all = c.request("gccRobot/targets", Value::Null);
    let ids = |list: &Value| list.as_array().expect("a list").iter().map(|t| t["id"].as_str().unwrap_or("").to_string()).collect::<Vec<_>>();
    assert!(ids(&all["targets"]).contains(&"rs274ngc".into()) && ids(&all["machines"]).contains(&"generic/mill3".into()) && ids(&all["dialects"]).contains(&"grbl".into()));
    let e = c.request("gccRobot/explain", json!({ "code": "E0203" }));
    assert!(e["markdown"].as_str().is_some_and(|m| m.starts_with("## E0203 arc/radius-mismatch")));
    let e = c.request("gccRobot/explain", json!({ "code": "g83" }));
    assert!(e["markdown"].as_str().is_some_and(|m| m.starts_with("**G83**")));
    c.shut_down();
}

/// What the command is told makes of a saved program what the editor shows of it.
#[test]
fn builds_are_told_the_settings() {
    let settings = json!({ "dialect": "grbl", "machine": "generic/mill3", "tools": "t.tbl", "subs": ["lib"], "machineUnits": "inch", "blockDelete": true, "lints": { "strict": true, "allow": ["E0284"] } });
    let mut c = Client::new(&[("a.nc", "G21\nM2\n"), ("b.nc", "(gcc-robot: dialect=linuxcnc)\nG21\nM2\n"), ("t.tbl", "T1 P1 D10 Z50\n")], settings);
    let at = |c: &Client, name: &str| c.path(name).display().to_string();
    let rest = ["--machine", "generic/mill3", "--tools", &at(&c, "t.tbl"), "--machine-units", "inch", "--subs", &at(&c, "lib"), "--allow", "E0284", "--block-delete", "--strict"].map(str::to_string);
    for (name, dialect) in [("a.nc", "grbl"), ("b.nc", "linuxcnc-2.9")] {
        let uri = c.open(name, None);
        let told = c.request("gccRobot/buildOptions", json!({ "textDocument": { "uri": uri } }));
        let mut wanted = vec!["--dialect".to_string(), dialect.to_string()];
        wanted.extend(rest.iter().cloned());
        assert_eq!(told["options"], json!(wanted), "what the program says itself goes before the setting");
    }
    c.shut_down();
    // A tool table of the settings: what the command writes is what the editor shows.
    let text = "G21 G90 G17 F300\nT1 M6\nG43 H1\nG0 X0 Y0 Z5\nG1 Z-1\nM2\n";
    let mut c = Client::new(&[("shop/a.ngc", text), ("t.tbl", "T1 P1 D10 Z50\n")], json!({ "tools": "t.tbl" }));
    let uri = c.open("shop/a.ngc", None);
    let shown = c.request("gccRobot/output", json!({ "textDocument": { "uri": uri }, "target": "canon" }));
    let told = c.request("gccRobot/buildOptions", json!({ "textDocument": { "uri": uri } }));
    let options: Vec<String> = serde_json::from_value(told["options"].clone()).expect("words");
    let built = std::process::Command::new(env!("CARGO_BIN_EXE_gcc-robot")).arg("build").arg(c.path("shop/a.ngc")).args(["--target", "canon"]).args(&options).output().expect("it runs");
    assert_eq!(String::from_utf8_lossy(&built.stdout), shown["files"][0]["text"].as_str().expect("a text"));
    assert!(shown["files"][0]["text"].as_str().is_some_and(|t| t.contains("50.0000")), "{shown}");
    c.shut_down();
}
