//! Every operation of the motion IR, for every robot target: it shows in the output, or there is a finding.

use gr_ir::{FileId, Texts};
use gr_machine::Machine;
use gr_robot::joints::{JointOptions, gcode, joint_path};
use gr_robot::setpoints::{SetpointOptions, setpoints};
use gr_robot::{Options, Planned, plan};
use gr_text::Diagnostic;

/// A cell without rows in `[io]`: the operator does everything.
const BARE: &str = r#"
format = 1
id = "shop/cell"
extends = "abb/irb2400"
[frames.table]
position = [900, -100, 400]
[frames.part]
position = [0, 0, 50]
[spindle]
position = [60, 0, 110]
rotation = [0, 45, 0]
[[tool]]
number = 1
name = "mill10"
position = [0, 0, 85]
[[tool]]
number = 2
name = "drill6"
position = [0, 0, 110]
[home]
joints = [0, -20, 20, 0, 60, 0]
"#;

/// Outputs and inputs with numbers.
const NUMBERED: &str = r#"
[io.M3]
signal = "DO[1]"
wait = "DI[1]"
seconds = 5
[io.M4]
signal = "DO[2]"
[io.M5]
signal = "DO[1]"
value = 0
[io.S]
signal = "AO[1]"
[io.M6]
routine = "TOOLCHG"
[io.M7]
signal = "DO[7]"
[io.M8]
signal = "DO[8]"
[io.M9]
signal = "DO[8]"
value = 0
[io.M19]
signal = "DO[19]"
[io.M60]
signal = "DO[60]"
[io.M62P1]
signal = "DO[21]"
[io.M67P1]
signal = "AO[2]"
[io.M66P2]
signal = "DI[2]"
[io.G38]
wait = "DI[9]"
[io.M101]
routine = "USER101"
"#;

/// Name of the operation, its G-code; empty second = what stands there in the program it is compared with.
const OPERATIONS: &[(&str, &str)] = &[
    ("rapid", "G0 Z40"),
    ("linear", "G1 X30"),
    ("arc", "G2 X40 I10"),
    ("helix", "G2 X40 Z18 I10"),
    ("nurbs", "G5.2 X30 Y10 P1 L3\nX40 Y20\nX50 Y0\nG5.3"),
    ("probe", "G38.3 Z10"),
    ("rigid tap", "M3 S500\nG33.1 Z15 K1"),
    ("dwell", "G4 P1.5"),
    ("spindle-synchronous", "M3 S500\nG33 Z15 K1"),
    ("inverse time", "G93 G1 X30 F5\nG94 F600"),
    ("feed per revolution", "M3 S5000\nG95 F0.1 G1 X30\nG94 F600"),
    ("feed", "F123\nG1 X30\nF600"),
    ("exact stop", "G61.1"),
    ("blend", "G64 P0.3"),
    ("surface speed", "G96 S100 D2000"),
    ("spindle speed and start", "M3 S5000"),
    ("spindle backwards", "M4 S5000"),
    ("orient", "M19 R90"),
    ("orient and wait", "M19 R90 Q2"),
    ("mist", "M7"),
    ("flood", "M8"),
    ("coolant off", "M8\nM9"),
    ("tool change", "T2 M6\nG0 Z15"),
    ("tool length", "G43.1 Z10"),
    ("work offset", "G10 L2 P2 X5\nG55"),
    ("changed work offset", "G10 L2 P1 X5"),
    ("rotated frame", "G10 L2 P1 R10"),
    ("local offset", "G92 X5"),
    ("overrides locked", "M49"),
    ("feed override locked", "M50 P0"),
    ("spindle override locked", "M51 P0"),
    ("adaptive feed", "M52 P1"),
    ("feed hold locked", "M53 P0"),
    ("digital output, synchronous", "M62 P1"),
    ("digital output", "M64 P1"),
    ("digital output off", "M65 P1"),
    ("analog output, synchronous", "M67 E1 Q0.5"),
    ("analog output", "M68 E1 Q0.5"),
    ("input, at once", "M66 P2 L0"),
    ("input, rise", "M66 P2 L1 Q5"),
    ("input, high", "M66 P2 L3 Q5"),
    ("input, low", "M66 P3 L4 Q5"),
    ("analog input", "M66 E2 L0"),
    ("message", "(MSG, look)"),
    ("comment", "(a remark)"),
    ("log", "(LOG, x)"),
    ("user command", "M101"),
    ("user command with P", "M101 P3"),
    ("user command with P and Q", "M101 P3 Q4"),
    ("stop", "M0"),
    ("optional stop", "M1"),
    ("pallet", "M60"),
    ("rotary words", "G1 A10"),
    ("U V W", "G1 U10"),
];

/// Kinds of output that may say nothing of an operation, and why.
const NOTHING: &[(&str, &str, &str)] = &[
    ("setpoints", "comment", "for the reader of a text"),
    ("setpoints", "log", "for the reader of a text"),
    ("joint-gcode", "exact stop", "each position is a corner of its own: it always has G61"),
    ("joint-gcode", "blend", "each position is a corner of its own: it always has G61"),
    ("setpoints", "blend", "they follow the path exactly"),
    ("fanuc-ls", "blend", "CNT0 stays nearer to the corner than any size"),
    ("vplus", "blend", "corners have no size"),
    ("spel", "blend", "corners have no size"),
];

fn motion(text: &str) -> gr_ir::Program {
    let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    gr_driver::lower("part.ngc", text.into(), &setup, None).program
}

fn planned(operation: &str, machine: &Machine, own_words: bool) -> Result<Planned, Vec<Diagnostic>> {
    let text = format!("M61 Q1\nG64 P0.1\nG0 X0 Y0 Z20\nG1 X20 F600\nG1 X25\n{operation}\nG1 X60 Y10 F600\nG1 X70\nG0 Z20\nM30\n");
    let texts = Texts::new([(FileId(0), text.as_str())]);
    let mut planned = plan(&motion(&text), machine, &texts, &Options { own_words, probing: !own_words, ..Options::default() })?;
    // Lines of the source stand in remarks: they would show in any case.
    planned.program.steps.iter_mut().for_each(|s| s.source = None);
    Ok(planned)
}

/// The text that a target makes, and its findings as code and message.
fn made(target: &str, planned: Result<Planned, Vec<Diagnostic>>) -> (String, Vec<String>) {
    let short = |all: Vec<Diagnostic>| all.iter().map(|d| format!("{} {}", d.code.def().code, d.message)).collect::<Vec<_>>();
    let planned = match planned {
        Ok(planned) => planned,
        Err(found) => return (String::new(), short(found)),
    };
    let (program, mut found) = (&planned.program, short(planned.warnings));
    let text = match target {
        "joint-gcode" => {
            let path = joint_path(program, &JointOptions::default()).unwrap();
            let (text, _, more) = gcode(program, &path, 6, &gr_ir::NoSources);
            found.extend(short(more));
            text
        }
        "setpoints" => {
            let options = SetpointOptions { interval: 0.02, ..SetpointOptions::default() };
            let made = setpoints(program, &options).unwrap_or_else(|e| panic!("{e:?}"));
            found.extend(short(made.findings(program, &gr_ir::NoSources)));
            made.csv() + &made.events_csv(program)
        }
        _ => {
            let options = gr_vendors::Options { allow_unverified: true, decimals: None };
            let output = gr_vendors::language(target).unwrap().emit(program, &gr_ir::NoSources, &options);
            found.extend(short(output.findings));
            output.files.iter().map(|f| format!("{}\n{}", f.name, String::from_utf8_lossy(&f.bytes))).collect()
        }
    };
    (text, found)
}

#[test]
fn every_operation_shows_in_every_target() {
    let (mut table, mut dropped) = (String::new(), String::new());
    for (cell, rows) in [("by hand", ""), ("numbered", NUMBERED)] {
        let machine = gr_machine::parse(FileId(0), &format!("{BARE}{rows}")).unwrap_or_else(|e| panic!("{e:?}"));
        let targets: Vec<&str> = gr_vendors::languages().iter().map(|l| l.id()).chain(["joint-gcode", "setpoints"]).collect();
        let own = |target: &str| matches!(target, "joint-gcode" | "setpoints");
        let bases: Vec<_> = targets.iter().map(|t| made(t, planned("", &machine, own(t)))).collect();
        for (name, operation) in OPERATIONS {
            let plans = [planned(operation, &machine, false), planned(operation, &machine, true)];
            let mut told: std::collections::BTreeMap<String, Vec<&str>> = std::collections::BTreeMap::new();
            for (target, base) in targets.iter().zip(&bases) {
                let (text, found) = made(target, plans[usize::from(own(target))].clone());
                let mut codes: Vec<&str> = found.iter().filter(|f| !base.1.contains(f)).map(|f| &f[..5]).collect();
                codes.sort_unstable();
                codes.dedup();
                // The language stops at every point, and says so once.
                let stops = matches!(*name, "exact stop" | "blend") && base.1.iter().any(|f| f.starts_with("E0637"));
                let excused = stops || NOTHING.iter().any(|(t, n, _)| t == target && n == name);
                let what = match (text.is_empty(), text != base.0, codes.is_empty()) {
                    (true, _, false) => format!("error {}", codes.join(" ")),
                    (false, true, true) => "written".to_string(),
                    (false, true, false) => format!("written, {}", codes.join(" ")),
                    (false, false, false) => format!("only {}", codes.join(" ")),
                    _ if excused => "nothing to say".to_string(),
                    _ => {
                        dropped += &format!("{cell}: {name} ({operation}) for {target}\n");
                        "DROPPED".to_string()
                    }
                };
                told.entry(what).or_default().push(target);
            }
            let all = targets.len();
            let row: Vec<String> = told.iter().map(|(what, who)| if who.len() == all { what.clone() } else { format!("{what} ({})", who.join(" ")) }).collect();
            table += &format!("{cell}: {name}: {}\n", row.join("; "));
        }
    }
    assert_eq!(dropped, "");
    insta::assert_snapshot!(table);
}
