//! Dumps, pictures and the setup sheet of one hand-made program.

mod reader;

use gr_backends::{dump, plot, sheet};
use gr_canon::{At, Call, FileId, FrameId, Plane, Sink};
use gr_ir::{Axes, Lowering, Program};

fn at(x: f64, y: f64, z: f64) -> Axes {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn arc(end: [f64; 2], center: [f64; 2], rotation: i32, z: f64) -> Call {
    let ([first_end, second_end], [first_axis, second_axis]) = (end, center);
    Call::ArcFeed { first_end, second_end, first_axis, second_axis, rotation, axis_end: z, rest: [0.0; 6] }
}

/// Outline with rounded corners, a helix into a pocket, four holes with a second tool.
fn part() -> Program {
    let mut calls = vec![
        Call::SetFeedMode(0, 0),
        Call::SetG5xOffset(1, at(100.0, 50.0, -200.0)),
        Call::SelectPlane(Plane::Xy),
        Call::Comment(" T1 end mill 10 ".into()),
        Call::SelectTool(1),
        Call::ChangeTool(1),
        Call::UseToolLengthOffset(at(0.0, 0.0, 60.0), None),
        Call::SetSpindleSpeed(0, 4000.0),
        Call::StartSpindleClockwise(0),
        Call::FloodOn,
        Call::StraightTraverse(at(10.0, 0.0, 20.0)),
        Call::SetFeedRate(300.0),
    ];
    for z in [-2.0, -4.0, -6.0] {
        calls.extend([
            Call::StraightFeed(at(10.0, 0.0, z)),
            Call::StraightFeed(at(90.0, 0.0, z)),
            arc([100.0, 10.0], [90.0, 10.0], 1, z),
            Call::StraightFeed(at(100.0, 50.0, z)),
            arc([90.0, 60.0], [90.0, 50.0], 1, z),
            Call::StraightFeed(at(10.0, 60.0, z)),
            arc([0.0, 50.0], [10.0, 50.0], 1, z),
            Call::StraightFeed(at(0.0, 10.0, z)),
            arc([10.0, 0.0], [10.0, 10.0], 1, z),
        ]);
    }
    calls.extend([
        Call::StraightTraverse(at(10.0, 0.0, 20.0)),
        Call::StraightTraverse(at(62.0, 30.0, 20.0)),
        Call::StraightTraverse(at(62.0, 30.0, 1.0)),
        arc([62.0, 30.0], [50.0, 30.0], -5, -8.0),
        arc([62.0, 30.0], [50.0, 30.0], -1, -8.0),
        Call::StraightTraverse(at(62.0, 30.0, 20.0)),
        Call::StopSpindleTurning(0),
        Call::SelectTool(2),
        Call::ChangeTool(2),
        Call::UseToolLengthOffset(at(0.0, 0.0, 85.0), None),
        Call::SetSpindleSpeed(0, 1800.0),
        Call::StartSpindleClockwise(0),
        Call::SetFeedRate(120.0),
    ]);
    for (x, y) in [(15.0, 15.0), (85.0, 15.0), (85.0, 45.0), (15.0, 45.0)] {
        calls.extend([
            Call::StraightTraverse(at(x, y, 20.0)),
            Call::StraightTraverse(at(x, y, 2.0)),
            Call::StraightFeed(at(x, y, -12.0)),
            Call::Dwell(0.5),
            Call::StraightTraverse(at(x, y, 20.0)),
        ]);
    }
    calls.push(Call::ProgramEnd);
    let mut out = Lowering::new();
    out.builder_mut().file(FileId(0), "part.ngc");
    for (line, call) in (0..).zip(&calls) {
        out.call(&At { file: FileId(0), line, frame: FrameId::MAIN, now: b"" }, call);
    }
    out.finish()
}

#[test]
fn json_is_json_and_says_where_from() {
    let mut bytes = Vec::new();
    dump::json(&part(), &mut bytes).expect("memory");
    let value: serde_json::Value = serde_json::from_slice(&bytes).expect("valid JSON");
    let operations = value["operations"].as_array().expect("array");
    assert_eq!(operations.len(), part().len());
    let rapid = &operations[10];
    assert_eq!((rapid["op"].as_str(), rapid["to"]["x"].as_f64()), (Some("rapid"), Some(10.0)));
    assert_eq!((rapid["at"]["line"].as_u64(), value["files"][0]["name"].as_str()), (Some(11), Some("part.ngc")));
    assert!(rapid["to"].get("a").is_none(), "what does not change is not there");
}

#[test]
fn csv_rows() {
    let mut bytes = Vec::new();
    dump::csv(&part(), &dump::CsvOptions::default(), &mut bytes).expect("memory");
    let text = String::from_utf8(bytes).expect("text");
    let head: Vec<&str> = text.lines().take(6).collect();
    insta::assert_snapshot!(head.join("\n"));
    let columns = text.lines().next().map(|l| l.split(',').count());
    assert!(text.lines().all(|l| Some(l.split(',').count()) == columns));
    let mut fine = Vec::new();
    let options = dump::CsvOptions { tolerance: Some(0.01), ..Default::default() };
    dump::csv(&part(), &options, &mut fine).expect("memory");
    assert!(fine.len() > text.len() * 2);
}

#[test]
fn sheet_as_text() {
    let rail = sheet::Standing { name: "E1".into(), position: 1500.0, turns: false, carries_machine: true };
    let table = sheet::Standing { name: "E2".into(), position: -90.0, turns: true, carries_machine: false };
    let options = sheet::Options { title: "part.ngc".into(), external: vec![rail, table], ..Default::default() };
    let sheet = sheet::sheet(&part(), &options);
    insta::assert_snapshot!(sheet.text());
    let value: serde_json::Value = serde_json::from_str(&sheet.json()).expect("valid JSON");
    assert_eq!(value["tools"][1]["tool"], 2);
    assert_eq!(value["tools"][0]["note"], "T1 end mill 10");
    assert_eq!(value["external"][1]["position"], -90.0);
    assert!(sheet.html().contains("<td>T2</td>"));
    assert!(sheet.html().contains("<th>E1</th><td>stands at 1500 mm, carries the machine</td>"));
}

/// Colour of a pixel.
fn pixel(map: &tiny_skia::Pixmap, x: u32, y: u32) -> [u8; 3] {
    map.pixel(x, y).map(|p| [p.red(), p.green(), p.blue()]).unwrap_or_default()
}

#[test]
fn feed_is_blue_and_rapid_orange() {
    // One feed move along X, one rapid along Y, seen from the top, in a picture of known size.
    let mut out = Lowering::new();
    let calls = [
        Call::StraightTraverse(at(0.0, 0.0, 0.0)),
        Call::SetFeedRate(100.0),
        Call::StraightFeed(at(100.0, 0.0, 0.0)),
        Call::StraightTraverse(at(100.0, 100.0, 0.0)),
    ];
    for (line, call) in (0..).zip(&calls) {
        out.call(&At { file: FileId(0), line, frame: FrameId::MAIN, now: b"" }, call);
    }
    let options = plot::Options { show: plot::Show::Top, width: 600, height: 600, ..Default::default() };
    let bytes = plot::png(&out.finish(), None, &options).expect("png");
    let map = tiny_skia::Pixmap::decode_png(&bytes).expect("valid png");
    let (mut blue, mut orange) = (Vec::new(), Vec::new());
    for y in 80..550 {
        for x in 70..590 {
            let [r, g, b] = pixel(&map, x, y);
            if b > 150 && r < 90 {
                blue.push((x, y));
            } else if r > 200 && b < 190 && g < 220 && g > b {
                orange.push((x, y));
            }
        }
    }
    let span = |v: &[(u32, u32)]| {
        let (xs, ys) = (v.iter().map(|p| p.0), v.iter().map(|p| p.1));
        (xs.clone().max().unwrap_or(0) - xs.min().unwrap_or(0), ys.clone().max().unwrap_or(0) - ys.min().unwrap_or(0))
    };
    let ((w, h), (v, u)) = (span(&blue), span(&orange));
    assert!(w > 350 && h <= 3, "feed lies along X: {w} × {h}");
    assert!(v <= 3 && u > 350, "rapid lies along Y: {v} × {u}");
    // Its upper end is higher in the picture than the feed move: Y up.
    assert!(orange.iter().map(|p| p.1).min() < blue.iter().map(|p| p.1).min());
}

#[test]
fn svg_and_html_are_whole() {
    let options = plot::Options { title: "a<b>.ngc".into(), ..Default::default() };
    let svg = plot::svg(&part(), None, &options);
    assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
    assert!(svg.contains("<title>a&lt;b&gt;.ngc</title>"));
    assert!(svg.contains("100 mm") || svg.contains("20 mm"), "a scale");
    for class in ["rapid", "feed", "arc"] {
        assert!(svg.contains(&format!("<path class=\"{class}\"")), "{class}");
    }
    let page = plot::html(&plot::Trace::new(&part(), &Default::default()), &options);
    assert!(!page.contains("@@") && page.contains("a&lt;b&gt;.ngc") && page.contains("\"count\":"));
}

#[test]
fn an_empty_program_gives_an_empty_picture() {
    let options = plot::Options::default();
    let empty = Program::default();
    assert!(plot::png(&empty, None, &options).is_ok());
    assert!(plot::svg(&empty, None, &options).contains("no motion"));
    assert!(plot::html(&plot::Trace::new(&empty, &Default::default()), &options).contains("\"count\":0"));
    assert!(sheet::sheet(&empty, &sheet::Options::default()).text().contains("Time     0:00:00"));
}

#[test]
fn a_trace_says_where_each_point_comes_from() {
    let trace = plot::Trace::new(&part(), &plot::trace::TraceOptions::default());
    let n = trace.positions.len();
    assert!(n > 4 && [trace.kinds.len(), trace.lines.len(), trace.times.len(), trace.feeds.len()] == [n; 4]);
    assert_eq!(trace.kinds[0], plot::trace::JUMP);
    assert!(trace.times.windows(2).all(|t| t[0] <= t[1]), "time goes on");
    assert!((f64::from(trace.times[n - 1]) - trace.totals.seconds()).abs() < 1e-3);
    assert!(trace.kinds.iter().zip(&trace.feeds).all(|(k, f)| *k != 0 || *f == 0.0), "rapids have no feed");
}

#[test]
fn data_cannot_end_its_element() {
    let page = plot::html(&plot::Trace::new(&part(), &Default::default()), &plot::Options { text: "(</script>)".into(), ..Default::default() });
    assert!(page.contains("(\\u003c/script>)") && page.matches("</script>").count() == 2);
}

/// A table of moves: the columns feed, feed_unit, spindle, spindle_unit of each feed move.
fn rates(text: &str, dialect: &str) -> Vec<String> {
    let dialect = gr_spec::Dialect::find(dialect).expect("a dialect");
    let program = reader::read(text, &gr_interp::Setup { dialect, tools: gr_interp::assumed_tools(), ..Default::default() }).expect("it runs");
    let mut bytes = Vec::new();
    dump::csv(&program, &dump::CsvOptions::default(), &mut bytes).expect("memory");
    let text = String::from_utf8(bytes).expect("text");
    let rows = text.lines().map(|l| l.split(',').collect::<Vec<_>>()).filter(|l| l[1] == "linear");
    rows.map(|l| format!("{} {} {} {}", l[11], l[12], l[15], l[16])).collect()
}

#[test]
fn rotary_moves_have_their_feed_in_degrees() {
    let text = "G20 G90\nM3 S100\nG1 X1 F20\nA90 F360\nX2 A100 F10\nG95 F2\nA0\nM2\n";
    assert_eq!(rates(text, "linuxcnc"), [
        "508 mm/min 100 rpm",
        "360 deg/min 100 rpm",
        "254 mm/min 100 rpm",
        "2 deg/rev 100 rpm"
    ]);
    let sheet = sheet::sheet(&reader::read(text, &gr_interp::Setup::default()).expect("it runs"), &sheet::Options::default());
    assert!(sheet.text().contains("254 - 508 mm/min, 360 °/min, 2 °/rev"), "{}", sheet.text());
    let value: serde_json::Value = serde_json::from_str(&sheet.json()).expect("valid JSON");
    assert_eq!(value["tools"][0]["feed_deg_min"], serde_json::json!([360.0, 360.0]));
}

/// The controller goes on with the number that S had; a Fanuc control with the rpm that the spindle has just then.
#[test]
fn g97_without_s_is_no_surface_speed() {
    let text = "G21 G90 F100\nM3 S500\nG96 D2000 S100\nG1 X10\nG97\nX20\nG96 S60\nX50\nG97 S7\nX60\nM2\n";
    let expected = ["100 m/min", "100 rpm", "60 m/min", "7 rpm"];
    assert_eq!(rates(text, "linuxcnc"), expected.map(|e| format!("100 mm/min {e}")));
    // 157.0796 m/min at a diameter of 50 mm are 1000 rpm; G50 limits what they are at 10 mm.
    let turned = "G21 G99\nG50 S3000\nG97 S500 M3\nG0 X50. Z5.\nG96 S157.07963267948966\nG1 Z0 F0.2\nG97\nZ-5.\nG96 S150\nX10.\nG97\nZ-7.\nM30\n";
    let expected = ["157.079632679 m/min", "1000 rpm", "150 m/min", "3000 rpm"];
    let found: Vec<String> = rates(turned, "fanuc-turn").iter().map(|r| r.replace("0.2 mm/rev ", "")).collect();
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let (a, b): (f64, f64) = (found.split(' ').next().unwrap().parse().unwrap(), expected.split(' ').next().unwrap().parse().unwrap());
        assert!((a - b).abs() < 1e-6 && found.ends_with(expected.split(' ').next_back().unwrap()), "{found} {expected}");
    }
}
