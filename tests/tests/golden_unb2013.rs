//! The programs of the Brasília thesis through both interpreters.

use gr_tests::oracle::{Job, Outcome, Verdict, differ, reference, root};

fn program(name: &str) -> Vec<u8> {
    std::fs::read(root().join("tests/golden/unb2013").join(name)).expect("the file is in the repository")
}

/// The thesis' table is in millimeters; `rs274` 2.9 reads inches.
fn tools_in_inches() -> String {
    let text = String::from_utf8(program("figB-13_tool.tbl")).expect("ASCII");
    let mut out = String::new();
    for line in text.lines() {
        let (words, comment) = line.split_once(';').unwrap_or((line, ""));
        for word in words.split_whitespace() {
            let (letter, value) = word.split_at(1);
            match letter {
                "T" | "P" => out.push_str(word),
                _ => out.push_str(&format!("{letter}{:.9}", value.parse::<f64>().expect("a number") / 25.4)),
            }
            out.push(' ');
        }
        out.push_str(&format!(";{comment}\n"));
    }
    out
}

fn job(name: &str) -> Job {
    Job { tools: Some(tools_in_inches()), ..Job::new(program(name)) }
}

#[test]
fn both_interpreters_agree() {
    let Some(rs274) = reference() else { return };
    for name in ["anexo6_ran.ngc", "figF-2_capability-part.ngc"] {
        assert_eq!(differ(&job(name), &rs274), Verdict::Same, "{name}");
    }
}

/// X and Y of the feed moves.
fn feeds(out: &Outcome) -> Vec<(f64, f64)> {
    out.canon
        .lines()
        .filter_map(|l| l.split_once("STRAIGHT_FEED("))
        .map(|(_, args)| {
            let mut n = args.split(", ").map(|n| n.parse::<f64>().expect("a number"));
            (n.next().expect("X"), n.next().expect("Y"))
        })
        .collect()
}

fn first_loop(out: &Outcome) {
    assert!(out.ok(), "{}", out.ended.errors());
    // After the uncompensated contour (Y 48.5 … 51.5) the compensated loop runs along these four sides.
    let path = feeds(out);
    let start = path.windows(4).position(|w| {
        let same = |a: f64, b: f64| (a - b).abs() < 1e-3;
        same(w[0].1, 54.5) && same(w[1].1, 54.5) && same(w[2].1, 45.5) && same(w[3].1, 45.5)
    });
    let start = start.unwrap_or_else(|| panic!("no such loop in {:?}", &path[..30.min(path.len())]));
    let near = |v: f64, to: f64| assert!((v - to).abs() < 1e-3, "{v} instead of {to}: {:?}", &path[start..start + 5]);
    near(path[start].0, 100.0);
    near(path[start + 1].0, 0.0);
    near(path[start + 2].0, 0.0);
    near(path[start + 3].0, 100.0);
}

#[test]
fn first_compensated_loop_of_the_reference() {
    let Some(rs274) = reference() else { return };
    first_loop(&job("anexo6_ran.ngc").reference(&rs274));
}

#[test]
fn first_compensated_loop_of_ours() {
    first_loop(&job("anexo6_ran.ngc").ours());
}
