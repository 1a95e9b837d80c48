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

fn floats(v: &Value) -> Vec<f32> {
    bytes(v).chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

fn integers(v: &Value) -> Vec<u32> {
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
    assert!(c.hover(&uri, "G1 X|9").contains("joints at the end: "));
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
