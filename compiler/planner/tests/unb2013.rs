//! The reference system of Brasília 2013 against what its author printed.

use gr_planner::reference::unb2013::{Config, Section, config, convert, list_text};
use gr_planner::{process, table};
use gr_text::FileId;

const SLOT: &str = include_str!("../../../tests/golden/unb2013/fig4-45_slot-square-u.p21");
const HOLE: &str = include_str!("../../../tests/golden/unb2013/example-a_conical-hole.p21");
const CONFIG: &str = include_str!("../../../tests/golden/unb2013/figG-1_arqConf.txt");
const PROGRAM: &str = include_str!("../../../tests/golden/unb2013/anexo6_ran.ngc");
const COMMENTED: &str = include_str!("../../../tests/golden/unb2013/fig4-49_teste01.ngc");
const TABLE: &str = include_str!("../../../tests/golden/unb2013/figB-13_tool.tbl");
const LIST: &str = include_str!("../../../tests/golden/unb2013/fig4-47_listaDadosTrocaFerra.txt");

fn read(text: &str) -> (gr_planner::Process, Vec<gr_planner::Tool>) {
    let (process, tools, faults) = process(text.as_bytes(), FileId(0), Some(gr_planner::Units::StepModeler));
    let errors: Vec<_> = faults.iter().filter(|d| d.severity == gr_text::Severity::Error).collect();
    assert!(errors.is_empty(), "{errors:#?}");
    (process.expect("a process"), tools)
}

/// The printed configuration with the machine feed of the printed program.
fn golden() -> Config {
    let (c, faults) = config(CONFIG, FileId(1));
    assert!(faults.is_empty(), "{faults:?}");
    Config { machine_feed: 800.0, ..c }
}

fn blocks(text: &str) -> Vec<&str> {
    text.lines().filter(|l| l.starts_with('N')).map(str::trim_end).collect()
}

#[test]
fn the_printed_program() {
    let (process, _) = read(SLOT);
    let out = convert(&process, &golden(), FileId(0), "C:/mod/ran.p21").expect("converted");
    assert_eq!(out.blocks(), blocks(PROGRAM));
    assert_eq!(out.blocks().len(), 167);
    assert_eq!(out.table, TABLE);
    assert_eq!(list_text(&out.tools), LIST.trim_end());
}

#[test]
fn the_printed_program_with_comments() {
    let (process, _) = read(SLOT);
    let config = Config { code_comments: true, ..golden() };
    let out = convert(&process, &config, FileId(0), "C:/mod/teste01.p21").expect("converted");
    assert_eq!(out.program.trim_end(), COMMENTED.trim_end());
    assert_eq!(out.program.lines().filter(|l| l.starts_with('(')).count(), 25);
}

#[test]
fn all_twelve_keys_and_their_bounds() {
    let (c, faults) = config(CONFIG, FileId(1));
    assert!(faults.is_empty());
    let expected = Config {
        repository: "/home/fresa/Temp/".into(),
        copy: "/home/fresa/Temp/".into(),
        read_comments: false,
        code_comments: false,
        safety_plane: 55.0,
        machine_feed: 900.0,
        cutting_feed: 400.0,
        pass_depth: 1.0,
        arc_step: 10.0,
        spiral_percent: 50.0,
        wall_step: 1.0,
        tool_table: "/home/fresa/FresaTG2/".into(),
    };
    assert_eq!(c, expected);
    let bad = "Pla_Seg=56\nVelAvaMaq=901\nVelAvaCorte=0\nAvaProfCorte=2.5\nAvaAngSemiCir=x\nPorFerEspiral=49\nAvaLinhaProf=0.4\nComentariosCod=yes\nOther=1\n";
    let (_, faults) = config(bad, FileId(1));
    let texts: Vec<&str> = faults.iter().map(|d| d.message.as_str()).collect();
    assert_eq!(faults.len(), 9, "{texts:#?}");
    let third = &faults[2].labels[0].span;
    assert_eq!(&bad[third.range()], "VelAvaCorte=0");
}

#[test]
fn changed_settings_change_the_program() {
    let (process, _) = read(SLOT);
    let c = Config { machine_feed: 900.0, safety_plane: 40.0, ..golden() };
    let out = convert(&process, &c, FileId(0), "").expect("converted");
    assert!(out.program.contains("G01 F900.0000 X0.0000 Y0.0000"));
    assert!(out.program.contains("G91 G01 F450.0 Z-1.0000"));
    assert!(out.program.contains("G40 G90 G00 Z40.0000"));
    let two = Config { wall_step: 2.0, ..golden() };
    let out = convert(&process, &two, FileId(0), "").expect("converted");
    // Depths 2, 4, 6 and the tangency depth instead of 1 … 6 and that.
    assert_eq!(out.program.matches("G91 G01 F400.0 Z-").count(), 4);
    assert!(out.program.contains("Z-0.5000"));
}

#[test]
fn the_section_of_table_4_9() {
    let s = Section { depth: 7.0, top: 20.0, bottom: 10.0, radius: 2.0 };
    assert!((s.tangency() - 6.1625).abs() < 5e-5 && (2.0 * s.half(s.tangency()) - 11.1965).abs() < 5e-5);
    let widths: Vec<f64> = (0..=6).map(|y| 2.0 * s.half(f64::from(y))).collect();
    for (w, printed) in widths.iter().zip([20.0, 18.5714, 17.1429, 15.7143, 14.2857, 12.8571, 11.4286]) {
        assert!((w - printed).abs() < 5e-5);
    }
    let rows = [(11.196, 6.163), (11.005, 6.286), (10.512, 6.532), (9.941, 6.732), (9.309, 6.879), (8.636, 6.970), (7.941, 7.000)];
    let angles = s.arc_angles(10.0);
    assert_eq!(angles.len(), rows.len());
    for (a, (width, depth)) in angles.iter().zip(rows) {
        let (w, d) = s.arc(a.to_radians());
        // The source computed the table with its own rounded angle and width.
        assert!((w - width).abs() < 1.1e-3 && (d - depth).abs() < 6e-4, "{a}: {w} {d}");
    }
}

#[test]
fn a_conical_hole() {
    let (process, tools) = read(HOLE);
    let out = convert(&process, &Config::default(), FileId(0), "").expect("converted");
    assert_eq!(out.blocks().len(), 32);
    for words in ["G01 Z-6.0000", "G01 Z-10.0000", "G01 Z-11.8199", "G40 G90 G00 Z55.0000"] {
        assert!(out.program.contains(words), "{words}\n{}", out.program);
    }
    let text = table::text(&process, &tools);
    assert!(text.contains("depth      10, cut 11.819851171331011"), "{text}");
}

#[test]
fn the_plan_of_the_slot() {
    let (process, tools) = read(SLOT);
    let text = table::text(&process, &tools);
    assert!(text.contains("depth      7\n"), "{text}");
    insta::assert_snapshot!(text);
    insta::assert_snapshot!(table::json(&process, &tools));
    let steps = process.steps();
    let ids: Vec<[u64; 3]> = steps.iter().map(|s| [s.origin.id, s.feature.origin.id, s.operation.origin.id]).collect();
    assert_eq!(ids, [[70, 39, 25], [85, 39, 71]]);
}

#[test]
fn what_it_did_not_do_is_refused_by_name() {
    let vee = SLOT.replace("SQUARE_U_PROFILE(#64,#58,#60,0.6202494859828215,#62,0.6202494859828215)", "VEE_PROFILE(#64,#60,1.2,0.0)");
    let vertical = SLOT.replace("#56=DIRECTION('Linear Path Direction - HORIZONTAL',(1.0,0.0,0.0))", "#56=DIRECTION('',(0.0,1.0,0.0))");
    for text in [vee, vertical] {
        let (process, _) = read(&text);
        let faults = convert(&process, &golden(), FileId(0), "").expect_err("refused");
        assert!(faults[0].message.contains("unb2013"), "{faults:?}");
        assert_eq!(faults[0].code, gr_text::code::REFERENCE_REFUSED);
    }
}
