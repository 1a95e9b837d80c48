//! Dumps, pictures and the setup sheet of one hand-made program.

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
        Call::UseToolLengthOffset(at(0.0, 0.0, 60.0)),
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
        Call::UseToolLengthOffset(at(0.0, 0.0, 85.0)),
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
