//! STEP-NC files as users of the command meet them: every target, the published systems, bad files, the filter.

#[path = "stepnc/back.rs"]
mod back;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const MANIFEST: &str = env!("CARGO_MANIFEST_DIR");

fn root() -> PathBuf {
    Path::new(MANIFEST).join("../..")
}

fn golden(name: &str) -> String {
    root().join("tests/golden").join(name).to_string_lossy().into_owned()
}

fn case_study() -> String {
    root().join("docs/examples/stepnc/case-study.p21").to_string_lossy().into_owned()
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }
    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
    fn put(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }
    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }
    fn names(&self) -> Vec<String> {
        let mut all: Vec<String> =
            std::fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        all.sort();
        all
    }
    fn command(&self, args: &[&str]) -> Command {
        let mut c = Command::new(env!("CARGO_BIN_EXE_gcc-robot"));
        c.args(args).current_dir(self.0.path()).env_remove("NO_COLOR").env_remove("INI_FILE_NAME").stdin(Stdio::null());
        c
    }
    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }
    /// Must succeed; standard output.
    fn ok(&self, args: &[&str]) -> String {
        let o = self.run(args);
        assert_eq!(code(&o), 0, "{args:?}: {}", err(&o));
        out(&o)
    }
    /// Errors in the short form, when nothing may be written.
    fn refused(&self, args: &[&str]) -> String {
        let before = self.names();
        let quiet: &[&str] = if args.contains(&"-q") { &[] } else { &["-q"] };
        let o = self.run(&[args, &["--message-format", "short"], quiet].concat());
        // 3: it can't even be read as text.
        let expected = if err(&o).contains("E0841") { 3 } else { 1 };
        assert_eq!((code(&o), out(&o)), (expected, String::new()), "{args:?}: {}", err(&o));
        assert_eq!(self.names(), before, "{args:?} wrote something");
        err(&o).lines().filter(|l| l.contains("error[")).map(|l| format!("{l}\n")).collect()
    }
}

fn out(o: &Output) -> String {
    String::from_utf8(o.stdout.clone()).unwrap()
}
fn err(o: &Output) -> String {
    String::from_utf8(o.stderr.clone()).unwrap()
}
fn code(o: &Output) -> i32 {
    o.status.code().unwrap()
}
fn blocks(text: &str) -> Vec<&str> {
    text.lines().filter(|l| l.starts_with('N')).map(str::trim_end).collect()
}

#[test]
fn every_target() {
    let f = Folder::new();
    for target in [
        "rs274ngc", "canon", "motion", "json", "csv", "svg", "png", "html", "sheet", "sheet-json", "sheet-html", "plan",
        "plan-json", "stepnc",
    ] {
        let o = f.run(&["build", "-q", &case_study(), "--target", target, "-o", target]);
        assert_eq!(code(&o), 0, "{target}: {}", err(&o));
        assert!(std::fs::metadata(f.path(target)).unwrap().len() > 500, "{target}");
    }
    // Only G-code needs the tool table.
    assert_eq!(f.names().iter().filter(|n| n.ends_with(".tbl")).count(), 1);
    let again = f.ok(&["build", "-q", &case_study()]);
    assert_eq!(again, f.read("rs274ngc"), "the same input gives the same bytes");
    insta::assert_snapshot!("case_study_tools", f.read("rs274ngc.tbl"));
    insta::assert_snapshot!("case_study_plan", f.read("plan"));
    let head: Vec<&str> = again.lines().take(40).collect();
    insta::assert_snapshot!("case_study_head", head.join("\n"));
    assert_eq!(f.read("plan").matches(" workingstep #").count(), 22);
    for row in f.ok(&["build", "-q", &case_study(), "--target", "plan-json"]).lines() {
        assert!(!row.contains("NaN"));
    }
}

#[test]
fn written_programs_move_as_planned() {
    let f = Folder::new();
    let modeler = ["--step-units", "step-modeler"];
    for (file, meant) in [
        (case_study(), &[][..]),
        (golden("unb2013/fig4-45_slot-square-u.p21"), &modeler),
        (golden("unb2013/example-a_conical-hole.p21"), &modeler),
        (golden("ufsc2016/example1.p21"), &["--step-overlap", "percent"]),
    ] {
        for options in [&[][..], &["--cycles"], &["--units", "inch"], &["--arcs", "r"], &["--to", "fanuc-mill"], &["--cycles", "--to", "fanuc-mill"]] {
            let mut args = vec!["verify", &file];
            args.extend(meant);
            args.extend(options);
            let o = f.run(&args);
            assert_eq!(code(&o), 0, "{args:?}: {}{}", out(&o), err(&o));
        }
        f.ok(&[&["build", "-q", &file, "-o", "part.ngc"], meant].concat());
        let same = f.run(&[&["diff", &file, "part.ngc", "--tools", "part.tbl", "--tolerance", "0.001"], meant].concat());
        assert_eq!(code(&same), 0, "{}{}", out(&same), err(&same));
    }
}

#[test]
fn drilling_as_cycles() {
    let f = Folder::new();
    let text = f.ok(&["build", "-q", &case_study(), "--cycles", "--tool-change-at", "g53"]);
    assert_eq!(text.matches("G81").count(), 16, "eight holes, each centered and drilled");
    assert!(text.contains("G53 G0 Z0\nM6\n"), "{}", &text[..1500]);
    assert_eq!(text.matches("G53 G0 Z0\nM6").count(), text.matches("M6\n").count());
    let text = f.ok(&["build", "-q", &case_study(), "--tool-change-at", "g55"]);
    assert!(text.contains("G55 G0 Z5\nG0 X0 Y0\nG0 Z0\nM6\nG0 Z5\nG54\n"));
    assert!(f.ok(&["build", "-q", &case_study(), "--tool-change-at", "g30"]).contains("\nG30\nM6\n"));
    let o = f.run(&["build", "-q", &case_study(), "--tool-change-at", "g30", "--to", "grbl"]);
    assert_eq!(code(&o), 1);
}

#[test]
fn unb2013_block_by_block() {
    let f = Folder::new();
    let config = std::fs::read_to_string(golden("unb2013/figG-1_arqConf.txt")).unwrap();
    f.put("arqConf.txt", config.replace("VelAvaMaq=900", "VelAvaMaq=800"));
    let slot = golden("unb2013/fig4-45_slot-square-u.p21");
    let common = ["build", "-q", &slot, "--reference", "unb2013", "--reference-config", "arqConf.txt"];
    f.ok(&[&common[..], &["-o", "ran.ngc", "--depfile", "ran.d"]].concat());
    let printed = std::fs::read_to_string(golden("unb2013/anexo6_ran.ngc")).unwrap();
    let ours = f.read("ran.ngc");
    assert_eq!(blocks(&ours), blocks(&printed));
    assert_eq!(blocks(&ours).len(), 167);
    assert_eq!(f.read("ran.tbl"), std::fs::read_to_string(golden("unb2013/figB-13_tool.tbl")).unwrap());
    let rule = f.read("ran.d");
    assert!(rule.starts_with("ran.ngc ran.tbl:") && rule.contains("arqConf.txt"), "{rule}");
    // Other targets see the program that the system wrote.
    for target in ["motion", "canon", "csv", "svg", "sheet"] {
        assert!(!f.ok(&[&common[..], &["--target", target]].concat()).is_empty(), "{target}");
    }
    // Predicted changes.
    let at_900 = f.ok(&["build", "-q", &slot, "--reference", "unb2013"]);
    assert!(at_900.contains("F900.0000 X0.0000") && at_900.contains("F450.0"));
    f.put("arqConf.txt", "Pla_Seg=40\n");
    assert!(f.ok(&common).contains("G40 G90 G00 Z40.0000"));
    f.put("arqConf.txt", "Pla_Seg=56\nVelAvaMaq=x\n");
    insta::assert_snapshot!("unb2013_settings", f.refused(&common));
    // What it did not do.
    insta::assert_snapshot!("unb2013_refuses", f.refused(&["build", &case_study(), "--reference", "unb2013", "-o", "no.ngc"]).replace(&case_study(), "case-study.p21"));
}

#[test]
fn ufsc2016_points() {
    let f = Folder::new();
    for (name, count) in [("example1", 842), ("example2_3caras", 3106)] {
        let csv = f.ok(&["build", "-q", &golden(&format!("ufsc2016/{name}.p21")), "--reference", "ufsc2016", "--target", "csv"]);
        assert_eq!(csv.lines().count(), count + 1, "{name}");
    }
    // Targets of the first table, robot at its printed place (table Z 745): printed = traveled + error.
    let csv = f.ok(&["build", "-q", &golden("ufsc2016/example1.p21"), "--reference", "ufsc2016", "--target", "csv"]);
    let points: Vec<Vec<f64>> = csv.lines().skip(1).map(|l| l.split(',').skip(2).take(3).map(|v| v.parse().unwrap()).collect()).collect();
    let table = std::fs::read_to_string(golden("ufsc2016/appC_ex1_adept_one.csv")).unwrap();
    let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let column = |name: String| head.iter().position(|h| *h == name).unwrap();
    for line in table.lines().skip(1) {
        let row: Vec<&str> = line.split(',').collect();
        let n: usize = row[0].parse().unwrap();
        for (i, (axis, shift)) in [("x", 300.0), ("y", 310.0), ("z", 745.0)].into_iter().enumerate() {
            let number = |name: String| row[column(name)].parse::<f64>().unwrap();
            let target = number(format!("traveled_{axis}_mm")) + number(format!("err_{axis}_mm"));
            assert!((points[n - 1][i] + shift - target).abs() <= 1e-5, "row {n} {axis}");
        }
    }
    let o = f.run(&["build", &golden("ufsc2016/example2_3caras.p21"), "--reference", "ufsc2016", "-o", "tilted.ngc"]);
    assert!(code(&o) == 1 && err(&o).contains("does not stand along Z") && f.names().is_empty(), "{}", err(&o));
}

#[test]
fn references_and_targets_want_their_own_input() {
    let f = Folder::new();
    f.put("a.ngc", "G21 G90 G0 X1\nM2\n");
    for args in [
        &["build", "a.ngc", "--target", "plan"][..],
        &["build", "a.ngc", "--reference", "unb2013"],
        &["build", &case_study(), "--reference", "ufmg2008"],
        &["build", &case_study(), "--reference", "ufsc2016", "--reference-config", "x"],
    ] {
        let o = f.run(args);
        assert!(code(&o) == 2 && err(&o).lines().count() == 1, "{args:?} {}", err(&o));
    }
}

#[test]
fn a_project() {
    let f = Folder::new();
    std::fs::copy(golden("unb2013/fig4-45_slot-square-u.p21"), f.path("slot.p21")).unwrap();
    f.put("arqConf.txt", "VelAvaMaq=800\nAvaProfCorte=1\n");
    f.put(
        "gcc-robot.toml",
        "schema = 1\n[project]\nsources = [\"*.p21\"]\nstep-units = \"step-modeler\"\nreference = \"unb2013\"\n[[targets]]\ntarget = \"rs274ngc\"\noutput = \"out/{name}.{extension}\"\nreference-config = \"arqConf.txt\"\n[[targets]]\ntarget = \"plan\"\noutput = \"out/{name}.txt\"\n",
    );
    let o = f.run(&["build"]);
    assert_eq!(code(&o), 0, "{}", err(&o));
    assert!(!err(&o).contains("E0485"), "the units are stated: {}", err(&o));
    let printed = std::fs::read_to_string(golden("unb2013/anexo6_ran.ngc")).unwrap();
    assert_eq!(blocks(&f.read("out/slot.ngc")), blocks(&printed));
    assert!(f.path("out/slot.tbl").is_file() && f.read("out/slot.txt").contains("square U"));
    // Folders are searched for STEP-NC programs too; shapes from CAD are left alone.
    std::fs::create_dir(f.path("more")).unwrap();
    f.put("more/shape.stp", "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n");
    std::fs::copy(case_study(), f.path("more/part.STP")).unwrap();
    let o = f.run(&["check", "more", "--step-units", "iso"]);
    assert!(code(&o) == 0 && err(&o).contains("in 1 file"), "{}", err(&o));
}

/// Files that are no STEP-NC programs, or broken ones: one clear answer, from every command, and nothing is written.
#[test]
fn bad_files() {
    let f = Folder::new();
    let good = std::fs::read_to_string(golden("ufsc2016/example1.p21")).unwrap();
    let files: Vec<(&str, Vec<u8>)> = vec![
        ("empty.p21", Vec::new()),
        ("blank.p21", b" \n\t\n".to_vec()),
        ("gcode.p21", b"G21 G90\nG1 X10 F100\nM2\n".to_vec()),
        ("text.stpnc", b"hello\nworld\n".to_vec()),
        ("xml.stp", b"<?xml version=\"1.0\"?>\n<iso_10303_28/>\n".to_vec()),
        ("binary.p21", (0..4000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()),
        ("zip.p21", b"PK\x03\x04 and so on".to_vec()),
        ("first-line.p21", b"ISO-10303-21;\n".to_vec()),
        ("truncated.p21", good.as_bytes()[..2500].to_vec()),
        ("shape.stp", good.replace("MACHINING_SCHEMA", "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF").replace("MILLING_SCHEMA", "").into_bytes()),
        ("twice.p21", good.replace("#108=WORKPLAN", "#107=WORKPLAN").into_bytes()),
        ("circle.p21", good.replace("(#103,#104,#105,#106,#107)", "(#103,#108)").into_bytes()),
        ("zero-tool.p21", good.replace("MILLING_TOOL_DIMENSION(20.0,0.0", "MILLING_TOOL_DIMENSION(0.0,0.0").into_bytes()),
        ("nan.p21", good.replace("MILLING_TOOL_DIMENSION(20.0,0.0", "MILLING_TOOL_DIMENSION(NaN,0.0").into_bytes()),
        ("infinite.p21", good.replace("MILLING_TOOL_DIMENSION(20.0,0.0", "MILLING_TOOL_DIMENSION(1.0E999,0.0").into_bytes()),
        ("escape.p21", good.replace("#79=CONTOUR", "#79=CONTOUR\u{1b}[31m\u{7f}").into_bytes()),
    ];
    let mut all = String::new();
    for (name, bytes) in &files {
        f.put(name, bytes);
    }
    for (name, _) in &files {
        let checked = f.refused(&["check", name]);
        all.push_str(&checked);
        assert!(checked.lines().count() <= 6, "{name}: {checked}");
        for args in [&["build", name, "-o", "out.ngc"][..], &["preview", name, "-o", "out.svg"], &["build", name, "--target", "stepnc", "-o", "out.p21"]] {
            assert_eq!(f.refused(args), checked, "{args:?}");
        }
        let o = f.run(&["filter", name]);
        assert!(code(&o) != 0 && o.stdout.is_empty() && err(&o).contains("error["), "{name}");
        assert!(!err(&o).contains('\u{1b}'), "{name}");
    }
    insta::assert_snapshot!("bad_files", all);
    for name in ["empty.p21", "gcode.p21", "text.stpnc"] {
        let before = std::fs::read(f.path(name)).unwrap();
        assert_eq!(code(&f.run(&["fmt", name])), 1, "{name}");
        assert_eq!(std::fs::read(f.path(name)).unwrap(), before, "{name}");
    }
}

#[test]
fn g_code_to_stepnc_and_back() {
    let f = Folder::new();
    f.put("part.ngc", include_str!("fixtures/there-and-back.ngc"));
    f.put("part.tbl", "T3 P1 Z40 D6 ;end mill\nT7 P2 Z55 D5 ;drill\n");
    f.ok(&["build", "-q", "part.ngc", "--tools", "part.tbl", "--target", "stepnc", "-o", "part.p21"]);
    insta::assert_snapshot!("there_and_back", f.read("part.p21"));
    assert!(f.ok(&["check", "part.p21", "-q"]).is_empty());
    f.ok(&["build", "-q", "part.p21", "--decimals", "9", "-o", "back.ngc"]);
    let back = f.read("back.ngc");
    for words in ["T3\n", "T7\n", "M3\n", "M8\n", "M9\n", "S2500", "F300", "M0\n", "G43 H3", "G43 H7"] {
        assert!(back.contains(words), "{words}:\n{back}");
    }
    let o = f.run(&["diff", "part.ngc", "back.ngc", "--tools", "part.tbl", "--tolerance", "1e-6"]);
    insta::assert_snapshot!("there_and_back_diff", out(&o));
    // What STEP-NC has no word for.
    f.put("tap.ngc", "G21 G90 T1 M6 S500 M3\nG0 X0 Y0 Z5\nG1 Z4 F100\nG33.1 Z-10 K1\nM62 P1\nM5\nM2\n");
    insta::assert_snapshot!("no_counterpart", f.refused(&["build", "tap.ngc", "--target", "stepnc", "-o", "tap.p21"]));
    let o = f.run(&["build", "tap.ngc", "--target", "stepnc", "--lossy", "-o", "tap.p21", "--message-format", "short"]);
    assert!(code(&o) == 0 && err(&o).matches("E0498").count() >= 2 && f.path("tap.p21").is_file(), "{}", err(&o));
}

#[test]
fn errors_stand_at_their_instance() {
    let f = Folder::new();
    let text = std::fs::read_to_string(case_study()).unwrap();
    f.put("bad.p21", text.replace("FLAT_HOLE_BOTTOM()", "FLAT_HOLE_BOTOM()").replace("'pocket',5.,$,", "'pocket',-5.,$,"));
    let o = f.run(&["build", "bad.p21", "-o", "x.ngc", "-q"]);
    assert_eq!((code(&o), f.names()), (1, vec!["bad.p21".to_string()]));
    insta::assert_snapshot!("errors_at_instances", err(&o));
}

#[test]
fn the_filter() {
    let f = Folder::new();
    std::fs::copy(case_study(), f.path("part.p21")).unwrap();
    // Without a machine: numbers of its own, and what to load is told.
    let o = f.run(&["filter", "part.p21"]);
    assert_eq!(code(&o), 0, "{}", err(&o));
    assert!(out(&o).starts_with("(part)\n") && out(&o).trim_end().ends_with("M2"));
    insta::assert_snapshot!("filter_says", err(&o));
    assert_eq!(f.names(), ["part.p21"], "a filter writes nothing by itself");
    // With the machine's table: its numbers.
    f.put("tool.tbl", "T1 P1 D10 Z50 ;end mill\nT12 P2 D6 Z61.5 ;end mill 6 mm\nT20 P3 D6 Z40 ;spot drill\nT21 P4 D6 Z70 ;drill\nT30 P5 D4 Z55 ;ball nose R2\n");
    f.put("mill.ini", "[EMCIO]\nTOOL_TABLE = tool.tbl\n[TRAJ]\nLINEAR_UNITS = mm\n");
    let o = f.command(&["filter", "part.p21"]).env("INI_FILE_NAME", f.path("mill.ini")).output().unwrap();
    assert_eq!(code(&o), 0, "{}", err(&o));
    for words in ["T12\nM6\nG43 H12", "T30\nM6\nG43 H30", "T20\nM6\nG43 H20", "T21\nM6\nG43 H21"] {
        assert!(out(&o).contains(words), "{words}");
    }
    assert_eq!(f.ok(&["filter", "part.p21", "-i", "mill.ini"]), out(&o));
    // A tool that is not there.
    f.put("tool.tbl", "T12 P2 D6 ;end mill\nT20 P3 D6 ;spot drill\nT21 P4 D6 ;drill\nT31 P6 D4 ;reamer\n");
    let o = f.run(&["filter", "part.p21", "-i", "mill.ini"]);
    assert!(code(&o) == 1 && o.stdout.is_empty() && err(&o).contains("E0843") && err(&o).contains("ball endmill D4 R2"), "{}", err(&o));
    // A table of its own, in one step and with a copy of the old one.
    let old = f.read("tool.tbl");
    f.ok(&["filter", "part.p21", "-i", "mill.ini", "--write-tools", "tool.tbl"]);
    assert_eq!(f.read("tool.tbl.bak"), old);
    let new = f.read("tool.tbl");
    assert!(new.starts_with("T1 P1 Z+70.0000 D+6.0000 ;ENDMILL"), "{new}");
    f.ok(&["filter", "part.p21", "-i", "mill.ini", "--write-tools", "tool.tbl"]);
    assert_eq!((f.read("tool.tbl.bak"), f.read("tool.tbl")), (old, new), "the same table again is no change");
    // An inch machine has inches in its table.
    f.put("mill.ini", "[EMCIO]\nTOOL_TABLE = none.tbl\n[TRAJ]\nLINEAR_UNITS = inch\n");
    f.ok(&["filter", "part.p21", "-i", "mill.ini", "--write-tools", "inch.tbl"]);
    assert!(f.read("inch.tbl").contains("D+0.236220"), "{}", f.read("inch.tbl"));
}

#[test]
fn gcode_files_of_unknown_controls() {
    let f = Folder::new();
    f.put("a.gcode", "G21 G90\nG0 X1\nM2\n");
    f.put("printer.gcode", "; generated by PrusaSlicer\nM104 S210\nG1 X10 E1 F1500\n");
    f.put("cam.gcode", "(post processor: grbl mill)\nG21 G90\nG1 X10 F100\nM2\n");
    f.put("subs.gcode", "o<hole> sub\nG81 Z-1 R1 F100\no<hole> endsub\nG21 G90 S1000 M3\nG0 X1 Y1 Z2\no<hole> call\nM5\nM2\n");
    for args in [&["build", "a.gcode", "-o", "b.ngc"][..], &["preview", "a.gcode", "-o", "b.svg"], &["diff", "a.gcode", "a.gcode"]] {
        assert!(f.refused(args).contains("E0842"), "{args:?}");
    }
    assert!(f.refused(&["build", "printer.gcode", "-o", "b.ngc"]).contains("3D printer"));
    f.ok(&["build", "-q", "a.gcode", "--dialect", "linuxcnc", "-o", "b.ngc"]);
    f.ok(&["build", "-q", "cam.gcode", "-o", "c.ngc"]);
    f.ok(&["build", "-q", "subs.gcode", "-o", "d.ngc"]);
    // grbl has no O-words: the remark is heeded, not just passed over.
    f.put("both.gcode", "(made for grbl)\no<hole> sub\no<hole> endsub\nM2\n");
    assert_eq!(code(&f.run(&["check", "both.gcode"])), 1);
}

/// A direction of no length is one error where it stands; what is placed by it has none.
#[test]
fn one_bad_direction_is_one_message() {
    let f = Folder::new();
    let text = std::fs::read_to_string(golden("unb2013/fig4-45_slot-square-u.p21")).unwrap();
    let broken = text.replace("#13=DIRECTION('',(0.0,0.0,1.0))", "#13=DIRECTION('',(0.0,0.0,0.0))");
    assert_ne!(text, broken);
    f.put("part.p21", broken);
    let said = err(&f.run(&["build", "part.p21", "--step-units", "step-modeler", "--message-format", "short"]));
    let errors: Vec<&str> = said.lines().filter(|l| ["E0413", "E0443", "E0481"].iter().any(|c| l.contains(c))).collect();
    assert!(errors.len() == 1 && errors[0].contains("E0443") && errors[0].contains("direction_ratios of #13"), "{said}");
}
