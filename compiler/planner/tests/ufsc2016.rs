//! The reference system of Florianópolis 2016 against the points its author printed.

use gr_planner::process;
use gr_planner::reference::ufsc2016::{Kind, Placement, Point, points};
use gr_text::FileId;

const PART1: &str = include_str!("../../../tests/golden/ufsc2016/example1.p21");
const PART2: &str = include_str!("../../../tests/golden/ufsc2016/example2_3caras.p21");

fn run(text: &str) -> (gr_planner::Process, Vec<Point>) {
    let (process, _, faults) = process(text.as_bytes(), FileId(0), text.contains("ST-GENERATOR").then_some(gr_planner::Units::StepModeler));
    let errors: Vec<_> = faults.iter().filter(|d| d.severity == gr_text::Severity::Error).collect();
    assert!(errors.is_empty(), "{errors:#?}");
    let process = process.expect("a process");
    let points = points(&process, FileId(0)).expect("points");
    (process, points)
}

/// Counts per workingstep, in order.
fn counts(points: &[Point]) -> Vec<(u64, usize)> {
    let mut out: Vec<(u64, usize)> = Vec::new();
    for p in points {
        match out.last_mut() {
            Some(l) if l.0 == p.step => l.1 += 1,
            _ => out.push((p.step, 1)),
        }
    }
    out
}

#[test]
fn part_1_has_842_points() {
    let (_, points) = run(PART1);
    let counts: Vec<usize> = counts(&points).iter().map(|c| c.1).collect();
    assert_eq!(counts, [135, 12, 8, 380, 307]);
    assert_eq!(points.len(), 842);
}

#[test]
fn part_2_has_3106_points_on_three_faces() {
    let (process, points) = run(PART2);
    assert_eq!(points.len(), 3106);
    let faces = [1015, 2257, 3106];
    let axes: Vec<[f64; 3]> = points.iter().map(|p| p.axis).collect();
    let ends: Vec<usize> = (1..=axes.len()).filter(|i| axes.get(*i) != Some(&axes[i - 1])).collect();
    assert_eq!(ends, faces);
    let order: Vec<u64> = counts(&points).iter().map(|c| c.0).collect();
    let published = [
        59, 74, 109, 124, 159, 174, 209, 224, 276, 329, 364, 379, 414, 429, 464, 479, 514, 529, 564, 579, 615, 630, 665, 680,
        715, 730,
    ];
    assert_eq!(order, published);
    let sizes: Vec<usize> = counts(&points).iter().map(|c| c.1).collect();
    let expected = [
        8, 21, 8, 21, 8, 21, 8, 21, 899, 347, 8, 261, 8, 261, 8, 261, 8, 36, 8, 36, 8, 753, 8, 36, 8, 36,
    ];
    assert_eq!(sizes, expected);
    let orphans: Vec<u64> = process.orphans.iter().map(|o| o.id).collect();
    assert_eq!(orphans, [48, 98, 148, 198, 261, 314, 353, 403, 453, 503, 553, 604, 654, 704]);
}

fn place(table: [f64; 3], rotation: [f64; 3]) -> Placement {
    Placement { table, part: [0.0, 10.0, 0.0], rotation }
}

/// Distance of the rows of a published table from our points; targets are traveled + error.
fn worst(csv: &str, points: &[Point], placed: &dyn Fn(usize) -> Placement) -> (usize, f64) {
    let mut lines = csv.lines();
    let header: Vec<&str> = lines.next().expect("header").split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).expect(name);
    let (mut count, mut worst) = (0, 0.0f64);
    for line in lines {
        let row: Vec<&str> = line.split(',').collect();
        let number = |name: &str| row[column(name)].parse::<f64>().expect("a number");
        let n: usize = row[0].parse().expect("a number");
        let at = placed(n).point(points[n - 1].at);
        for (i, axis) in ["x", "y", "z"].iter().enumerate() {
            let target = number(&format!("traveled_{axis}_mm")) + number(&format!("err_{axis}_mm"));
            worst = worst.max((at[i] - target).abs());
        }
        count += 1;
    }
    (count, worst)
}

#[test]
fn published_targets() {
    let (_, one) = run(PART1);
    let (_, two) = run(PART2);
    let none = [0.0; 3];
    let face = |n: usize| match n {
        0..=1015 => place([300.0, 300.0, 650.0], none),
        1016..=2257 => place([300.0, 300.0, 745.0], [-90.0, 0.0, 0.0]),
        _ => place([300.0, 300.0, 745.0], [0.0, 90.0, 0.0]),
    };
    let fixed = |table: [f64; 3]| move |_: usize| place(table, none);
    let all: [(&str, &[Point], &dyn Fn(usize) -> Placement); 6] = [
        (include_str!("../../../tests/golden/ufsc2016/appC_ex1_adept_one.csv"), &one, &fixed([300.0, 300.0, 745.0])),
        (include_str!("../../../tests/golden/ufsc2016/appC_ex2_adept_one.csv"), &two, &face),
        // Table 5.1 prints 450 for the height of the table.
        (include_str!("../../../tests/golden/ufsc2016/appC_ex1_irb140.csv"), &one, &fixed([400.0, -200.0, 500.0])),
        (include_str!("../../../tests/golden/ufsc2016/appC_ex2_irb140.csv"), &two, &fixed([450.0, 0.0, 350.0])),
        (include_str!("../../../tests/golden/ufsc2016/appC_ex1_tricept806.csv"), &one, &fixed([50.0, 50.0, -1900.0])),
        (include_str!("../../../tests/golden/ufsc2016/appC_ex2_tricept806.csv"), &two, &fixed([200.0, 300.0, -1900.0])),
    ];
    let mut rows = 0;
    for (i, (csv, points, placed)) in all.into_iter().enumerate() {
        let (count, worst) = worst(csv, points, placed);
        rows += count;
        assert!(worst <= 1e-5, "table {i}: {worst}");
    }
    assert_eq!(rows, 234);
}

#[test]
fn a_moved_hole_moves_its_points() {
    let (_, before) = run(PART2);
    let (_, after) = run(&PART2.replacen("(20.0,20.0,200.0)", "(21.0,20.0,200.0)", 1));
    assert_ne!(before, after);
    let moved = before.iter().zip(&after).filter(|(a, b)| a.at != b.at).count();
    // Everything of the drilling (6 points) and the milling (19) of the first hole but the security plane.
    assert_eq!(moved, 6 + 19);
    assert!(before.iter().zip(&after).all(|(a, b)| a.kind != Kind::Security || a == b));
}

/// All six strategies on a rectangle and on hexagons, inscribed and circumscribed.
#[test]
fn six_strategies() {
    let strategies = [
        "UNIDIRECTIONAL(3.2,.T.,$,$)",
        "BIDIRECTIONAL(3.2,.T.,$,.LEFT.,$)",
        "CONTOUR_PARALLEL(3.2,.T.,.CCW.,.CONVENTIONAL.)",
        "BIDIRECTIONAL_CONTOUR(3.2,.T.,$,.LEFT.,.CCW.,.CONVENTIONAL.)",
        "CONTOUR_BIDIRECTIONAL(3.2,.T.,$,.LEFT.,.CCW.,.CONVENTIONAL.)",
        "CONTOUR_SPIRAL(3.2,.T.,.CCW.,.CONVENTIONAL.)",
    ];
    let profile = PART2.lines().find(|l| l.contains("RECTANGULAR_CLOSED_PROFILE")).expect("a pocket");
    let (id, rest) = profile.split_once('=').expect("an instance");
    let size = rest.split(',').nth(1).expect("a width");
    let strategy = PART2.lines().filter(|l| l.contains("CONTOUR_PARALLEL(3.2")).map(str::to_string).collect::<Vec<_>>();
    for (name, shape) in [
        ("rectangle", profile.to_string()),
        ("inscribed", format!("{id}=NGON_PROFILE($,{size},6,.F.);")),
        ("circumscribed", format!("{id}=NGON_PROFILE($,{size},6,.T.);")),
    ] {
        for with in strategies {
            let mut text = PART2.replace(profile, &shape);
            for s in &strategy {
                let (id, _) = s.split_once('=').expect("an instance");
                text = text.replace(s.as_str(), &format!("{id}={with};"));
            }
            let (_, points) = run(&text);
            let pocket: Vec<&Point> = points.iter().filter(|p| p.step == 276 && p.kind == Kind::Cut).collect();
            assert!(pocket.len() > 50, "{name} {with}: {}", pocket.len());
            // The tool stays inside the profile, here at least in the circle or square around it.
            for p in pocket {
                let (x, y) = (p.at[0] - 100.0, p.at[1] - 100.0);
                let limit = if name == "circumscribed" { 70.0 / 0.866 } else { 70.0 };
                assert!(x.abs() <= limit - 8.0 + 1e-9 && y.abs() <= limit - 8.0 + 1e-9, "{name} {with}: {x} {y}");
            }
        }
    }
}
