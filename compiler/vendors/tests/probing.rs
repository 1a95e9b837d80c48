//! Probe moves from the program's line to the text of a language, and by a language that has none.

use gr_ir::{FileId, Texts};
use gr_machine::{Machine, Signal};
use gr_robot::{Options, Planned, plan};
use gr_text::{Diagnostic, Severity};
use gr_vendors::read::{Event, read};

const PROGRAM: &str = "G21 G90 G54\nT1 M6\nG0 X10 Y10 Z20\nG38.2 Z-10 F120\nG0 Z5\nG38.3 X40 F90\nG0 X10 Y10\nG1 Z2 F300\nG38.4 Z8 F60\nG0 Z20\n\
G38.5 Z40 F600\nM2\n";

fn cell(robot: &str, part: [f64; 3], touching: Option<f64>) -> Machine {
    let text = format!(
        "format = 1\nid = \"shop/cell\"\nextends = \"{robot}\"\n[frames.part]\nposition = {part:?}\n[spindle]\nposition = [0, 0, 80]\n[[tool]]\nnumber = 1\n\
         name = \"probe\"\nposition = [0, 0, 85]\nmass = 0.5\n[home]\njoints = {}\n",
        if robot.starts_with("universal") { "[0, -80, 90, -100, -90, 0]" } else if robot.starts_with("kuka") { "[0, -90, 90, 0, 60, 0]" } else { "[0, -20, 20, 0, 60, 0]" },
    );
    let mut machine = gr_machine::parse(FileId(0), &text).unwrap_or_else(|e| panic!("{e:?}"));
    machine.cell.io.insert("G38".into(), Signal { wait: Some("di_7".into()), value: touching, ..Signal::default() });
    machine
}

fn planned(text: &str, machine: &Machine) -> Result<Planned, Vec<Diagnostic>> {
    let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    let program = gr_driver::lower("part.ngc", text.into(), &setup, None).program;
    let texts = Texts::new([(FileId(0), text)]);
    plan(&program, machine, &texts, &Options::default())
}

const CELLS: [(&str, &str, [f64; 3]); 4] = [
    ("rapid", "abb/irb2400", [900.0, -100.0, 450.0]),
    ("krl", "kuka/kr16-2", [1000.0, -100.0, 500.0]),
    ("fanuc-ls", "fanuc/m-20ia", [950.0, -100.0, 300.0]),
    ("urscript", "universal-robots/ur5", [350.0, -250.0, 50.0]),
];

/// Everything a language writes, a text per file.
fn written(target: &str, machine: &Machine) -> Vec<(String, String)> {
    let planned = planned(PROGRAM, machine).unwrap_or_else(|e| panic!("{target}: {e:?}"));
    let texts = Texts::new([(FileId(0), PROGRAM)]);
    let out = gr_vendors::language(target).unwrap().emit(&planned.program, &texts, &gr_vendors::Options { allow_unverified: true, decimals: None });
    assert!(!out.files.is_empty(), "{target}: {:?}", out.findings);
    out.files.into_iter().map(|f| (f.name, String::from_utf8(f.bytes).unwrap())).collect()
}

#[test]
fn texts_of_probe_moves() {
    for (target, robot, part) in CELLS {
        let files = written(target, &cell(robot, part, None));
        let shown: String = files.iter().filter(|f| !f.0.ends_with(".pgf")).map(|(n, t)| format!("=== {n}\n{}", t.replace('\r', ""))).collect();
        insta::assert_snapshot!(format!("probe-{target}"), shown);
    }
}

/// Input, state that ends the move, whether it must come, speed, and where it would end.
#[test]
fn readers_understand_probe_moves() {
    for touching in [1.0, 0.0] {
        for (target, robot, part) in CELLS {
            let machine = cell(robot, part, Some(touching));
            let events = read(target, &written(target, &machine)).unwrap_or_else(|e| panic!("{target}: {e}"));
            let got: Vec<_> = events.iter().filter_map(|e| if let Event::Probe(p, v, i, on, must) = e { Some((p, *v, i.clone(), *on, *must)) } else { None }).collect();
            let high = touching == 1.0;
            let wanted = [(2.0, high, true, -10.0), (1.5, high, false, 5.0), (1.0, !high, true, 8.0), (10.0, !high, false, 40.0)];
            assert_eq!(got.len(), 4, "{target}");
            for ((place, speed, input, on, must), (v, o, m, z)) in got.into_iter().zip(wanted) {
                assert!((speed - v).abs() < 0.02 && on == o && must == m, "{target}: {speed} {on} {must} for {v} {o} {m}");
                assert!(input == "7" || input == "di_7", "{input}");
                let height = place.pose.unwrap().position[2] - if target == "urscript" { part[2] } else { 0.0 };
                assert!((height - z).abs() < 0.002, "{target}: {height} for {z}");
            }
        }
    }
}

#[test]
fn other_languages_say_that_they_cannot() {
    for language in gr_vendors::languages().iter().filter(|l| CELLS.iter().all(|c| c.0 != l.id())) {
        let mut machine = cell("abb/irb2400", [900.0, -100.0, 450.0], None);
        machine.cell.io.get_mut("G38").unwrap().wait = Some("7".into());
        let planned = planned(PROGRAM, &machine).unwrap();
        let texts = Texts::new([(FileId(0), PROGRAM)]);
        let out = language.emit(&planned.program, &texts, &gr_vendors::Options { allow_unverified: true, decimals: None });
        let told: Vec<_> = out.findings.iter().filter(|f| f.severity == Severity::Error).map(|f| (f.code.def().code, f.primary().1.start)).collect();
        assert!(out.files.is_empty() && told.contains(&("E0632", 33)), "{}: {:?}", language.id(), out.findings);
    }
}

/// A stiff stop is allowed up to 100 mm/s.
#[test]
fn a_fast_search_is_refused() {
    let machine = cell("abb/irb2400", [900.0, -100.0, 450.0], None);
    let text = PROGRAM.replace("F120", "F6100");
    let planned = planned(&text, &machine).unwrap();
    let out = gr_vendors::language("rapid").unwrap().emit(&planned.program, &Texts::new([(FileId(0), text.as_str())]), &gr_vendors::Options::default());
    assert!(out.findings.iter().any(|f| f.code.def().code == "E0625" && f.message.contains("100 mm/s")), "{:?}", out.findings);
}
