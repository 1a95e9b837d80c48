use super::*;
use gr_gcode::{Chunk, File, scan};
use gr_machine::Machine;
use gr_spec::Dialect;
use gr_text::{Diagnostic, FileId, Span};
use std::sync::Arc;

fn arm() -> Machine {
    gr_machine::builtin("ufmg/plano-3r").unwrap()
}

fn file(text: &str) -> File {
    let dialect = Dialect::find("ufmg2008").unwrap();
    File::new("a.g", vec![Chunk { text: text.into(), scan: Arc::new(scan(text, dialect)) }])
}

fn build(text: &str, machine: &Machine, options: &Options) -> Result<JointProgram, Vec<Diagnostic>> {
    let file = file(text);
    let (commands, faults) = language::read(FileId(0), &file);
    if !faults.is_empty() {
        return Err(faults);
    }
    let (program, faults) = ufmg::lower(FileId(0), "a.g", &commands, machine);
    if !faults.is_empty() {
        return Err(faults);
    }
    compile(&program, machine, options, &|s| (s.file, file.line_span(s.line)))
}

fn reference(text: &str) -> JointProgram {
    build(text, &arm(), &Options::ufmg2008()).unwrap()
}

fn slugs(result: Result<JointProgram, Vec<Diagnostic>>) -> Vec<(&'static str, Span)> {
    result.expect_err("faulty").iter().map(|d| (d.code.def().slug, d.primary().1)).collect()
}

fn last_degrees(p: &JointProgram) -> Vec<f64> {
    p.points.last().unwrap().joints.iter().map(|j| j.to_degrees()).collect()
}

const FIG_5_1: &str = include_str!("../../../../tests/golden/ufmg2008/fig5-1.g");
const FIG_5_4: &str = include_str!("../../../../tests/golden/ufmg2008/fig5-4.g");
const FIG_5_7: &str = include_str!("../../../../tests/golden/ufmg2008/fig5-7.g");
const TABLE: &str = include_str!("../../../../tests/golden/ufmg2008/fig5-4_joints.csv");

#[test]
fn figure_5_4() {
    let made = reference(FIG_5_1);
    assert_eq!(made.gcode(), FIG_5_4);
    assert_eq!(made.points.len(), 21);
    let rows: Vec<String> = TABLE.lines().skip(1).map(|l| l.trim().to_string()).collect();
    let ours: Vec<String> = made
        .gcode()
        .lines()
        .map(|l| l.split(' ').skip(1).map(|w| w[1..].replace(',', ".")).collect::<Vec<_>>().join(","))
        .collect();
    assert_eq!(ours, rows);
}

#[test]
fn figure_5_7() {
    assert_eq!(reference(&FIG_5_1.replacen("G01", "G00", 1)).gcode(), FIG_5_7);
}

#[test]
fn joint_move_of_section_4_5_1() {
    let made = reference("G00 X50 Y50 C-60\n");
    assert_eq!(made.gcode().lines().nth(1).unwrap().rsplit_once(" F").unwrap().0, "G01 X136,92 Y-93,84 Z-103,07");
    assert_eq!(made.points.len(), 2);
}

#[test]
fn line_of_section_4_5_2() {
    let made = reference("G01 X50 Y50 C-60 F100\n");
    assert_eq!(made.points.len() - 1, 29);
    let (a, b) = (&made.points[0].pose, &made.points[1].pose);
    let step: Vec<f64> = (0..6)
        .map(|i| if i < 3 { b[i] - a[i] } else { (b[i] - a[i]).to_degrees() })
        .map(|v| (v * 100.0).trunc() / 100.0)
        .collect();
    assert_eq!(step, [-1.72, 1.72, 0.0, 0.0, 0.0, 1.03]);
}

#[test]
fn the_two_arcs_of_figure_4_8() {
    // The arm can't reach it all, so only the geometry is looked at.
    let sweep = |word: &str| {
        let text = format!("G00 X0 Y0\n{word} X50 Y50 I50 J0 K0 F100\n");
        let (commands, faults) = language::read(FileId(0), &file(&text));
        assert_eq!(faults, []);
        let (program, faults) = ufmg::lower(FileId(0), "a.g", &commands, &arm());
        assert_eq!(faults, []);
        let arc = program.steps().find_map(|s| match s.op {
            gr_ir::Op::Arc(arc) => Some(crate::Sweep::new(&s.start, &s.end, &arc)),
            _ => None,
        });
        arc.unwrap().angle().to_degrees().round()
    };
    assert_eq!((sweep("G02"), sweep("G03")), (-90.0, 270.0));
}

#[test]
fn changed_input_changes_as_predicted() {
    // 82.46 mm at 500 mm/s take 0.1649 s: 17 intervals of 10 ms; the quarter circle takes 0.3142 s: 32.
    let options = Options { interval: 0.010, ..Options::ufmg2008() };
    let made = build(FIG_5_1, &arm(), &options).unwrap();
    assert_eq!(made.points.len(), 1 + 17 + 32);
    assert_eq!(made.gcode().lines().last().unwrap().rsplit_once(" F").unwrap().0, "G01 X127,05 Y-91,91 Z-45,13");
    // Half the feed: 13.2 and 25.1 intervals.
    let slow = reference(&FIG_5_1.replace("F500", "F250"));
    assert_eq!(slow.points.len(), 1 + 14 + 26);
    // Four decimals keep the two of the figure.
    let fine = build(FIG_5_1, &arm(), &Options { decimals: 4, ..Options::ufmg2008() }).unwrap();
    assert!(fine.gcode().lines().nth(1).unwrap().starts_with("G01 X97,96"));
    assert_eq!(fine.gcode().lines().nth(1).unwrap().split(' ').nth(1).unwrap().len(), "X97,9657".len());
}

#[test]
fn output_reads_back() {
    let text = reference(FIG_5_1).gcode();
    let (commands, faults) = language::read(FileId(0), &file(&text));
    assert_eq!(faults, []);
    assert_eq!(commands.len(), 21);
    assert_eq!(commands[1].target[..3], [Some(97.96), Some(-95.78), Some(-90.74)]);
}

#[test]
fn a_limit_stops_the_build_at_its_line() {
    let text = gr_machine::source("ufmg/plano-3r").unwrap().replace("word = \"X\"", "word = \"X\"\nmax = 140");
    let machine = gr_machine::parse(FileId(0), &text).unwrap();
    // The shoulder passes 140° in the line (142.38° at its end), so line 1 is to blame, and the arc starts above it.
    let found = slugs(build(FIG_5_1, &machine, &Options::default()));
    assert_eq!(found[0], ("robot/joint-limit", Span::new(0, 21)));
    let text = text.replace("max = 140", "max = 143");
    let machine = gr_machine::parse(FileId(0), &text).unwrap();
    assert!(build(FIG_5_1, &machine, &Options::default()).is_ok());
}

#[test]
fn joint_speed_is_checked() {
    let fast = Options { joint_speed: Some(2.0), ..Options::default() };
    let found = build(FIG_5_1, &arm(), &fast).expect_err("too fast");
    assert_eq!(found[0].code.def().slug, "robot/joint-speed");
    assert!(found[0].message.contains("114.5916°/s"), "{}", found[0].message);
    // The feed it proposes is one that works.
    assert!(build(&FIG_5_1.replace("F500", "F90"), &arm(), &fast).is_ok());
}

#[test]
fn our_own_mode_keeps_the_feed() {
    let options = Options { joint_speed: Some(1.0), ..Options::default() };
    let made = build("G00 X50 Y50 C-60\n", &arm(), &options).unwrap();
    // The shoulder turns furthest, 46.92°, at 1 rad/s.
    let p = &made.points[1];
    assert!((p.time - (made.points[1].joints[0] - std::f64::consts::FRAC_PI_2)).abs() < 1e-12);
    let line = build(FIG_5_1, &arm(), &Options::default()).unwrap();
    let total = line.points.last().unwrap().time;
    let way = (80.0f64 * 80.0 + 400.0).sqrt() + 50.0 * std::f64::consts::PI;
    assert!((total - way / 500.0).abs() < 1e-9, "{total}");
    for pair in line.points.windows(2) {
        assert!(pair[1].time - pair[0].time <= 0.025 + 1e-12);
    }
    for (p, q) in last_degrees(&line).iter().zip([127.058, -91.91, -45.13]) {
        assert!((p - q).abs() < 0.02, "{p} {q}");
    }
}

#[test]
fn long_arcs_and_full_circles() {
    let circle = build("G01 X100 Y100 C0 F200\nG03 X100 Y100 I80 J100 K0\n", &arm(), &Options::default()).unwrap();
    let way = (100.0) + 40.0 * std::f64::consts::PI;
    assert!((circle.points.last().unwrap().time - way / 200.0).abs() < 1e-9);
    let left = circle.points.iter().map(|p| p.pose[0]).fold(f64::MAX, f64::min);
    assert!((left - 60.0).abs() < 0.2, "{left}");
}

#[test]
fn rows_of_the_registry() {
    let options =
        |row: &gr_spec::DiagnosticDef| row.options == Some("build --target joint-gcode --machine ufmg/plano-3r");
    let rows = gr_spec::Code::all().map(gr_spec::Code::def);
    let mut tried = 0;
    for row in rows.filter(|r| options(r)) {
        let found = build(row.bad.unwrap(), &arm(), &Options::default());
        let found: Vec<_> = match found {
            Ok(_) => Vec::new(),
            Err(found) => found.iter().map(|d| d.code.def().code).collect(),
        };
        assert_eq!(found, [row.code]);
        assert!(build(row.good.unwrap(), &arm(), &Options::default()).is_ok(), "{}", row.code);
        tried += 1;
    }
    assert_eq!(tried, 3);
}

#[test]
fn tables_of_points() {
    let made = reference("G01 X50 Y50 C-60 F1000\n");
    insta::assert_snapshot!("cartesian", made.cartesian_csv());
    insta::assert_snapshot!("joints", made.joint_csv());
    let ours = build("G01 X50 Y50 C-60 F1000\n", &arm(), &Options::default()).unwrap();
    let feeds = |p: &super::JointProgram| p.gcode().split_whitespace().filter(|w| *w == "F0" || *w == "F0,0").count();
    assert_eq!((feeds(&ours), feeds(&made)), (0, 1), "only the thesis has a feed of nothing");
    let slow = build("G01 X50 Y50 C-60 F0.01\n", &arm(), &Options { interval: 10.0, ..Options::default() }).unwrap();
    assert_eq!(feeds(&slow), 0);
    insta::assert_snapshot!("own", format!("{}{}", ours.gcode(), ours.cartesian_csv()));
}

proptest::proptest! {
    /// What is written in joints is where the tool should be.
    #[test]
    fn forward_gives_the_path(x in 20.0f64..200.0, y in 20.0f64..200.0, c in -120.0f64..60.0, f in 10.0f64..1000.0) {
        let text = format!("G01 X{x} Y{y} C{c} F{f}\n");
        if let Ok(made) = build(&text, &arm(), &Options::default()) {
            let arm = arm().kinematics();
            for p in &made.points {
                let pose = arm.forward(&p.joints).unwrap();
                proptest::prop_assert!((pose.position[0] - p.pose[0]).abs() < 1e-6);
                proptest::prop_assert!((pose.position[1] - p.pose[1]).abs() < 1e-6);
            }
            let end = made.points.last().unwrap().pose;
            proptest::prop_assert!((end[0] - x).abs() < 1e-9 && (end[1] - y).abs() < 1e-9);
        }
    }
}

/// The thesis leaves the plane of an arc open whose three points lie on one line.
#[test]
fn an_arc_without_a_plane_is_refused() {
    let file = file("G01 X60 Y0 Z0 F100\nG02 X-60 Y20 Z40 I0 J10 K20\n");
    let (commands, _) = language::read(FileId(0), &file);
    let faults = ufmg::lower(FileId(0), "", &commands, &arm()).1;
    assert_eq!(faults.iter().map(|d| d.code).collect::<Vec<_>>(), [gr_spec::code::UFMG_COMMAND]);
}
