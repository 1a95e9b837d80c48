//! Findings whose rows in the registry have no example, since they need more than a program: files around it, a machine,
//! a target, an option. Each is raised here by the command that people meet it in.

use std::path::Path;
use std::process::Command;

const PART: &str = "G21 G90 F100\nG0 X1 Y1 Z5\nG1 X10\nG1 Y5\nM2\n";
const TOOL: &str = "G21 G90 F1000\nT1 M6 G43 H1\n";

fn root() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn shipped(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// The shipped cell with something replaced.
fn cell(old: &str, new: &str) -> String {
    let text = shipped("docs/examples/irb2400-cell.toml");
    assert!(text.contains(old), "{old}");
    text.replacen(old, new, 1)
}

/// A small STEP-NC part, some statements replaced by others with the same number.
fn plan(statements: &[&str]) -> String {
    let mut text = shipped("tests/linuxcnc/quick.p21");
    for new in statements {
        let head = &new[..=new.find('=').expect("#number=")];
        let at = text.find(&format!("\n{head}")).map(|n| n + 1).unwrap_or_else(|| text.find("ENDSEC;\nEND-ISO").expect("the end"));
        let end = if text[at..].starts_with(head) { at + text[at..].find('\n').expect("a line") + 1 } else { at };
        text.replace_range(at..end, &format!("{new}\n"));
    }
    text
}

/// Runs a command in a folder with some files: what it prints, and its exit status.
fn output(files: &[(&str, String)], command: &str) -> (String, Option<i32>) {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let out = Command::new(env!("CARGO_BIN_EXE_gcc-robot"))
        .args(command.split(' '))
        .args(if command.starts_with("filter") { &[][..] } else { &["--color", "never"] })
        .current_dir(folder.path())
        .output()
        .expect("the command runs");
    (String::from_utf8_lossy(&out.stderr).into_owned() + &String::from_utf8_lossy(&out.stdout), out.status.code())
}

/// Which codes a command tells, and its exit status.
fn codes(files: &[(&str, String)], command: &str) -> (Vec<String>, Option<i32>) {
    let (text, status) = output(files, command);
    let mut found: Vec<String> = text.match_indices("[E").filter_map(|(i, _)| text.get(i + 1..i + 6)).map(str::to_string).collect();
    found.retain(|c| gr_spec::Code::find(c).is_some());
    (found, status)
}

/// Exactly one finding of this code among those told, and the exit status that its severity asks for.
fn told(code: &str, files: &[(&str, String)], command: &str) {
    let (found, status) = codes(files, command);
    assert_eq!(found.iter().filter(|c| *c == code).count(), 1, "{command}: {found:?}, exit {status:?}");
    let error = gr_spec::Code::find(code).expect("a code").def().severity == gr_spec::Severity::Error;
    if error {
        assert!(matches!(status, Some(1..=3)), "{code}: exit {status:?}");
    } else {
        assert_eq!(status, Some(0), "{code}: {found:?}");
    }
}

fn file(name: &str, text: &str) -> (&'static str, String) {
    (Box::leak(name.to_string().into_boxed_str()), text.to_string())
}

#[test]
fn files_that_cannot_be_had() {
    let part = [file("a.ngc", PART)];
    std::fs::metadata("/proc/self/mem").expect("Linux");
    told("E0820", &[], "check nothing.ngc");
    told("E0821", &[], "check /proc/self/mem");
    told("E0822", &[], "build . --target canon");
    told("E0824", &part, "build a.ngc --target canon -o a.ngc/x");
    told("E0839", &part, "build a.ngc --target canon -o a.ngc");
}

#[test]
fn names_that_nothing_has() {
    let part = [file("a.ngc", PART)];
    told("E0834", &part, "check --dialect nothing a.ngc");
    told("E0835", &part, "build a.ngc --machine nobody --target rapid -o o/");
    told("E0804", &part, "check --warn foo/bar a.ngc");
    told("E0805", &part, "check --warn E0203 a.ngc");
}

#[test]
fn tables_and_settings() {
    let part = file("a.ngc", PART);
    let machine = file("m.toml", &shipped("spec/machines/generic/mill3.toml").replace("[start]", "[cutting]\naxial_depth = 1.5\n\n[start]"));
    told("E0448", &[machine, file("a.p21", &plan(&[]))], "check --machine m.toml a.p21");
    told("E0829", &[part.clone(), file("a.ini", "[TRAJ]\nwhat is this\n")], "check -i a.ini a.ngc");
    for line in ["[TRAJ]\nSPINDLES = 9", "[AXIS_X]\nMAX_LIMIT = 400 # mm", "[EMCIO]\nTOOL_CHANGE_AT_G30 = YES", "[EMCIO]\nTOOL_TABLE = none.tbl"] {
        told("E0852", &[part.clone(), file("a.ini", &format!("{line}\n"))], "check -i a.ini a.ngc");
    }
    let (found, status) = codes(&[part.clone(), file("a.ini", "#INCLUDE none.inc\n[TRAJ]\nLINEAR_UNITS = mm\n")], "check -i a.ini a.ngc");
    assert_eq!((found, status), (vec!["E0830".into()], Some(0)), "LinuxCNC starts without it");
    for (code, told) in [("G20 G999", 1), ("G20 G64 P0.01", 0), ("G64 P0.1 M52 P1", 1)] {
        let files = [part.clone(), file("a.ini", &format!("[RS274NGC]\nRS274NGC_STARTUP_CODE = {code}\n"))];
        let (found, _) = codes(&files, "check -i a.ini a.ngc");
        assert_eq!(found.iter().filter(|c| *c == "E0852").count(), told, "{code}: {found:?}");
    }
    // What a strict check does not pass is not passed in set-up files either.
    let ini = file("a.ini", "[EMCIO]\nTOOL_CHANGE_AT_G30 = YES\n");
    let (found, status) = codes(&[part.clone(), ini], "check --strict -i a.ini a.ngc");
    assert_eq!((found.iter().filter(|c| *c == "E0852").count(), status), (1, Some(1)), "{found:?}");
    let many: String = (1..=1100).map(|n| format!("T{n} P{n} Z1\n")).collect();
    told("E0837", &[part.clone(), file("a.tbl", &many)], "check --tools a.tbl a.ngc");
    told("E0853", &[part, file("a.tbl", "T1 P1 Z50\nT2 P2 Z60\nT1 P3 Z70\n")], "check --tools a.tbl a.ngc");
    let ini = file("a.ini", "[EMCIO]\nTOOL_TABLE = a.tbl\n[TRAJ]\nLINEAR_UNITS = mm\n");
    let tools = file("a.tbl", "T1 P1 Z50 D6\nT2 P2 Z60 D6\nT3 P3 Z60 D5\n");
    told("E0844", &[ini.clone(), tools, file("a.p21", &plan(&[]))], "filter -i a.ini a.p21");
    let tools = file("a.tbl", "T1 P1 Z50 D6 ;face mill\nT3 P3 Z60 D5 ;drill\n");
    told("E0850", &[ini, tools, file("a.p21", &plan(&[]))], "filter -i a.ini a.p21");
}

#[test]
fn axes_and_remaps_of_the_ini_file() {
    let ini = file("a.ini", "[AXIS_A]\nWRAPPED_ROTARY = 1\n[TRAJ]\nLINEAR_UNITS = mm\n");
    told("E0258", &[ini, file("a.ngc", "G21 G90 F100\nG0 A400\nM2\n")], "check -i a.ini a.ngc");
    let ini = file("a.ini", "[RS274NGC]\nREMAP = M405 modalgroup=6 argspec=PQ ngc=sub405\nSUBROUTINE_PATH = .\n");
    let sub = file("sub405.ngc", "o<sub405> sub\no<sub405> endsub\n");
    told("E0259", &[ini.clone(), sub, file("a.ngc", "G21\nM405 P1\nM2\n")], "check -i a.ini a.ngc");
    // Its subroutine is not there; the line itself is wrong; the line is odd.
    told("E0848", &[ini, file("a.ngc", "G21\nM2\n")], "check -i a.ini a.ngc");
    for (line, code) in [("M405 modalgroup=99 ngc=b", "E0848"), ("X5 modalgroup=10 ngc=b", "E0849")] {
        let ini = file("a.ini", &format!("[RS274NGC]\nREMAP = {line}\nSUBROUTINE_PATH = .\n"));
        let sub = file("b.ngc", "o<b> sub\no<b> endsub\n");
        told(code, &[ini, sub, file("a.ngc", "G21\nM2\n")], "check -i a.ini a.ngc");
    }
    let ini = file("a.ini", "[AXIS_A]\nLOCKING_INDEXER_JOINT = 3\n[TRAJ]\nLINEAR_UNITS = mm\n");
    told("E0190", &[ini, file("a.ngc", "G21 G90 F100\nG1 A40\nM2\n")], "check -i a.ini a.ngc");
}

#[test]
fn exchange_files_and_plans() {
    let deep = format!("#7=CARTESIAN_POINT('',{}{});", "(".repeat(10_001), ")".repeat(10_001));
    for (code, statements) in [
        ("E0318", vec![deep.as_str()]),
        ("E0440", vec!["#66=MILLING_TOOL_DIMENSION(5.,59.,$,3.,0.,$,$);"]),
        ("E0442", vec!["#26=TOLERANCED_LENGTH_MEASURE(1.,#44);"]),
        ("E0486", vec!["#56=MILLING_TECHNOLOGY(0.04,.TCP.,$,200.,$,.F.,.F.,.F.,$);"]),
        (
            "E0490",
            vec![
                "#2=WORKPLAN('main',(#90,#91),$,$,$);",
                "#90=WORKPLAN('one',(#10,#11),$,#3,$);",
                "#91=WORKPLAN('two',(#12),$,#92,$);",
                "#92=SETUP('turned',$,#9,(#5));",
            ],
        ),
        ("E0449", vec!["#2=WORKPLAN('main workplan',(#10,#11,#12,#12),$,#3,$);"]),
        (
            "E0450",
            vec![
                "#3=SETUP('vise',#90,#9,(#5));",
                "#90=AXIS2_PLACEMENT_3D('origin',#7,#91,#61);",
                "#91=DIRECTION('',(0.,1.,0.));",
            ],
        ),
        (
            "E0491",
            vec![
                "#3=SETUP('vise',#90,#9,(#5));",
                "#90=AXIS2_PLACEMENT_3D('origin',#91,#60,#61);",
                "#91=CARTESIAN_POINT('',(5.,6.,7.));",
            ],
        ),
    ] {
        let files = [file("a.p21", &plan(&statements))];
        let (found, status) = codes(&files, "check a.p21");
        let error = gr_spec::Code::find(code).expect("a code").def().severity == gr_spec::Severity::Error;
        // A plan says some things of each place it holds at.
        assert!(found.iter().any(|c| c == code), "{code}: {found:?}");
        assert_eq!(status == Some(0), !error, "{code}: {found:?}");
    }
}

#[test]
fn what_a_written_program_cannot_carry() {
    let input = file("a.ngc", "G21 G90 F100\nM66 P0 L0\nG0 X#5399\nM2\n");
    told("E0602", &[input], "build a.ngc --target rs274ngc -o a.nc");
    let looped = file("a.ngc", "G21 G90 F100\no1 repeat [5]\nM66 P0 L0\nG0 X#5399\no1 endrepeat\nM2\n");
    told("E0602", &[looped], "build a.ngc --target rs274ngc -o a.nc");
    // R of a Fanuc lathe's taper is no Y.
    let taper = file("a.nc", "O1\nG21 G40 G99\nT0101\nG97 S500 M3\nG0 X50. Z2.\nG90 X46. Z-10. R-2. F.2\nX42. R-2.\nG0 X80.\nM30\n");
    let (text, status) = output(&[taper], "build a.nc --dialect fanuc-turn --target rs274ngc");
    // Another limit of the spindle's speed leaves the cutting speed in force.
    let limit = file("a.nc", "O1\nG21 G40 G99\nG50 S2500\nT0101\nG96 S180 M3\nG0 X52. Z2.\nG1 Z-20. F.25\nG0 X60.\nG50 S2000\nG0 X50. Z2.\nG1 Z-20. F.1\nG0 X60.\nM5\nM30\n");
    for more in ["", " --from-line 10"] {
        let (text, status) = output(std::slice::from_ref(&limit), &format!("build a.nc --dialect fanuc-turn --target rs274ngc{more}"));
        assert!(status == Some(0) && text.contains("G96 D2000 S180\n"), "{more}: {text}");
    }
    assert_eq!((text.contains('Y'), text.contains("G1 X23 Z-10"), status), (false, true, Some(0)), "{text}");
    let arc = file("a.ngc", "G21 G90 G17 F100\nG0 X0.1234 Y0.5678 Z0\nG3 X10.7777 Y3.3333 R7.123\nM2\n");
    told("E0603", std::slice::from_ref(&arc), "build a.ngc --target rs274ngc --decimals 1 -o a.nc");
    // Compensation makes a spiral of an arc: its radii differ by 0.9 µm.
    let spiral = "G21 G90 G17 G54 F200\nG0 X0 Y0 Z5\nG42.1 D2.394\nG1 X107.5 Y45.4\nX205 Z1\nG3 X260 Y67 R90\nG40\nG0 Z30\nM2\n";
    told("E0653", &[file("a.ngc", spiral)], "build a.ngc --target rs274ngc --decimals 7 --arcs r -o a.nc");
    assert!(codes(&[file("a.ngc", spiral)], "build a.ngc --target rs274ngc --decimals 7 -o a.nc").0.is_empty());
    told("E0604", &[arc], "build a.ngc --target rs274ngc --to grbl --arcs ijk-absolute -o a.nc");
    told("E0605", &[file("a.ngc", "G21 G90\nG10 L2 P2 X10\nG55 G0 X1\nM2\n")], "build a.ngc --target rs274ngc -o a.nc");
    let own = [file("a.ngc", "G20 G90\nT1 M6\nG0 X1\nM2\n"), file("a.ini", "[RS274NGC]\nREMAP=M6 modalgroup=6 ngc=change\n[TRAJ]\nLINEAR_UNITS=mm\n"), file("change.ngc", "o<change> sub\nG53 G0 Z1\nM6\no<change> endsub\nM2\n")];
    told("E0609", &own, "build a.ngc -i a.ini --target rs274ngc -o a.nc");
    // The same way, with a wait more.
    let waits = [file("a.ngc", "G21 G90\nT1 M6\nG0 X1\nM2\n"), own[1].clone(), file("change.ngc", "o<change> sub\nM6\nG4 P1\no<change> endsub\nM2\n")];
    told("E0609", &waits, "build a.ngc -i a.ini --target rs274ngc -o a.nc");
    told("E0608", &[file("a.ngc", "G21 G90\nG0 X1 Y1 Z1\nG28.1\nM2\n")], "build a.ngc --target rs274ngc -o a.nc");
    told("E0606", &[file("a.p21", &plan(&[]))], "build a.p21 --cutter-compensation control -o a.nc");
    let shifted = "G21 G90\nG0 X0 Y0 Z5\nG92 X10\nG92.2\nG0 X5\nX6\nG92.3\nG0 X7\nM2\n";
    told("E0650", &[file("a.ngc", shifted)], "build a.ngc --target rs274ngc --from-line 6 -o a.nc");
    let project = |row: &str| [file("a.ngc", PART), file("gcc-robot.toml", &format!("schema = 1\n[project]\nsources = [\"a.ngc\"]\n{row}"))];
    for row in ["[[targets]]\ntarget = \"rs274ngc\"\ninterval = 3\n", "", "[[targets]]\ntarget = \"rs274ngc\"\noutput = \"o\"\n[[targets]]\ntarget = \"svg\"\noutput = \"o\"\n"] {
        told("E0854", &project(row), "build");
        assert_eq!(codes(&project(row), "build").1, Some(1), "{row}");
    }
    let touched = "G21 G90 G54\nG0 X1 Y2 Z3\nG10 L20 P2 X0 Y0 Z0\nG55 G0 X5 Y5 Z5\nG1 X6 F100\nM2\n";
    told("E0651", &[file("a.ngc", touched)], "build a.ngc --target rs274ngc --from-line 5 --safe-z 20 -o a.nc");
    // The height was said in G54, and the cut is in G55.
    let fixture = "G21 G90 G54\nG0 X0 Y0 Z30\nG1 Z1 F100\nG55\nG1 X5\nG1 X10\nM2\n";
    let restart = "build a.ngc --target rs274ngc --from-line 6 --safe-z 60 -o a.nc";
    told("E0652", &[file("a.ngc", fixture)], restart);
    let stored = file("a.var", "5220 1\n5221 10\n5223 -30\n5241 10\n5243 -50\n");
    assert!(codes(&[file("a.ngc", fixture), stored], &format!("{restart} --vars a.var")).0.is_empty());
    // Y was named before the shift was put away, and the cut does not name it; up there it need not be known.
    let shifted = "G21 G90 G17 G54 F100\nG0 X0 Y0 Z5\nG92 Y10\nG0 X20 Y5\nG92.1\nG0 X30\nG1 Z-1\nX40\nG0 Z5\nM2\n";
    told("E0652", &[file("a.ngc", shifted)], &restart.replace('6', "8"));
    for (line, y) in [(7, true), (8, true), (9, true)] {
        let known = [file("a.ngc", shifted), file("a.var", "5220 1\n5221 3\n5222 4\n5223 5\n")];
        let (text, status) = output(&known, &format!("build a.ngc --target rs274ngc --from-line {line} --safe-z 60 --vars a.var"));
        assert_eq!((text.contains(" Y-5"), status), (y, Some(0)), "{line}: {text}");
    }
    // Steps from where nobody knows, though every axis is named before it cuts.
    let steps = "G21 G91 F100\nG0 X5 Y5 Z5\nG1 X5 Y5 Z-2\nG0 Z9\nM2\n";
    told("E0652", &[file("a.ngc", steps)], &restart.replace('6', "3"));
    // A height that the probe has found, and a shift by it; steps from there.
    for (found, code) in [("G92 Z0", "E0619"), ("G92 Z0\nG0 Z5", "E0652"), ("G10 L2 P1 Z[#5063-1]\nG0 Z5", "E0652"), ("G91 G0 Z1\nG90", "E0652")] {
        let probed = format!("G21 G90 G94 G54 F50\nG0 X0 Y0 Z10\nG38.2 Z-10\n{found}\nS1000 M3\nG1 X10\nM5\nM2\n");
        let line = if found.contains('\n') { "7" } else { "6" };
        told(code, &[file("a.ngc", &probed)], &restart.replace("line 6", &format!("line {line}")));
    }
    for naming in ["G92 X-3", "G10 L20 P1 X-3"] {
        let named = format!("G21 G90 G54 F50\nG0 X0 Y0 Z-5\nG38.2 X20\n{naming}\nG0 X-8\nG1 X5\nM2\n");
        told("E0619", &[file("a.ngc", &named)], &restart.replace("line 6", "line 4"));
    }
    let measured = "G21 G90 G54 F50\nT1 M6\nG0 X0 Y0 Z10\nG38.2 Z-80\nG10 L10 P1 Z40.5\nG0 X5 Y5 Z20\nG43 H1\nG0 X1 Y1 Z30\nG1 Z5\nM2\n";
    told("E0652", &[file("a.ngc", measured)], &restart.replace("line 6", "line 9"));
    told("E0602", &[file("a.ngc", measured)], "build a.ngc --target rs274ngc -o a.nc");
    let stopped = "G21 G90 G94 G54 F50\nG0 X0 Y0 Z10\nG38.2 Z-10\nS1000 M3\nG1 X10\nM2\n";
    told("E0619", &[file("a.ngc", stopped)], &restart.replace("line 6", "line 5"));
    // Where G28 goes is known where its place is stored in a file.
    let home = "G21 G90 G17 G54 F100\nG0 X1 Y2 Z5\nG28\nG1 X23\nX30\nM2\n";
    told("E0619", &[file("a.ngc", home)], &restart.replace("line 6", "line 5"));
    let stored = file("a.var", "5161 1\n5162 2\n5163 30\n5220 1\n5221 3\n5222 4\n5223 5\n");
    let (text, status) = output(&[file("a.ngc", home), stored], "build a.ngc --target rs274ngc --from-line 5 --safe-z 60 --vars a.var");
    assert_eq!((text.contains("Z60\nX23 Y-2\n"), text.contains("Z25"), text.contains('A'), status), (true, true, false, Some(0)), "{text}");
    // Nothing cuts before the height is said again.
    let clear = fixture.replace("G1 X5", "G0 X5 Y6 Z30").replace("G1 X10", "G1 Z1");
    assert!(codes(&[file("a.ngc", &clear)], &restart.replace('6', "5")).0.is_empty());
    told("E0614", &[file("a.ngc", PART)], "build a.ngc --target rs274ngc --from-line 4 -o a.nc");
    let deep = "G21 G90 F100\nG0 X0 Y0 Z5\nX9\nG1 Z-3\nX5\nG0 Z5\nX20\nG1 Z-3\nX30\nM2\n";
    let bare = "G21 G90 F100\nT1 M6\nG0 X1 Y1\nG43 H1 Z5\nG1 Z-1\nM2\n";
    told("E0616", &[file("a.ngc", bare)], "build a.ngc --target rs274ngc --from-line 3 --safe-z 50 -o a.nc");
    told("E0615", &[file("a.ngc", deep)], "build a.ngc --target rs274ngc --from-line 5 --safe-z -1 -o a.nc");
}

#[test]
fn what_a_robot_cannot_do() {
    let shipped = file("cell.toml", &shipped("docs/examples/irb2400-cell.toml"));
    let part = file("a.ngc", &format!("{TOOL}G0 X10 Y10 Z25\nG1 Z5\nM2\n"));
    let rapid = "build a.ngc --machine cell.toml --target rapid -o o/";
    let turn = file("a.ngc", &format!("{TOOL}G0 X10 Y10 Z25\nG1 A10\nM2\n"));
    told("E0509", &[turn.clone(), file("cell.toml", &cell("id =", "orientation = \"fixed\"\nid ="))], rapid);
    told("E0539", &[turn, file("cell.toml", &cell("id =", "orientation = \"abc-euler-xyz\"\nid ="))], rapid);
    let frame = "[[frame]]\nname = \"G55\"\nposition = [900, -100, 400]\n\n[home]";
    let (found, _) = codes(&[part.clone(), file("cell.toml", &cell("[home]", frame))], rapid);
    assert!(!found.is_empty() && found.iter().all(|c| c == "E0522"), "{found:?}");
    let table = format!("{rapid} --tools a.tbl");
    told("E0525", &[part.clone(), shipped.clone(), file("a.tbl", "T1 P1 Z50 D10\n")], &table);
    let wide = file("a.ngc", &format!("{TOOL}G0 X-400 Y-500 Z25\nG0 X-400 Y700\nG1 Z20\nM2\n"));
    told("E0526", &[wide, shipped.clone()], rapid);
    let stopped = file("a.ngc", "G21 G90 G95 F0.1 S4000 M3\nT1 M6 G43 H1\nG0 X10 Y10 Z25\nM5\nG1 Z5\nM2\n");
    told("E0528", &[stopped, shipped.clone()], rapid);
    told("E0534", std::slice::from_ref(&part), "build a.ngc --machine comau/tricept806 --target pdl2 -o o/");
    let slow = file("a.ngc", "G21 G90 F0.0001\nT1 M6 G43 H1\nG0 X40 Y10 Z25\nG1 X400\nM2\n");
    told("E0537", &[slow, shipped.clone()], "build a.ngc --machine cell.toml --target setpoints -o o/");
    let round = file("a.ngc", &format!("{TOOL}G64 P0.05\nG0 X40 Y30 Z25\nG1 Z2\nX60\nY40\nM2\n"));
    told("E0638", &[round, shipped.clone()], "build a.ngc --machine cell.toml --target setpoints -o o/");
    told("E0704", &[part, shipped], &format!("{rapid} --compensate"));
    let huge = file("a.ngc", "G21 G90 F100\nG0 X0 Y0 Z0\nG1 X9000\nG1 Y9000\nM2\n");
    told("E0705", &[huge], "place a.ngc --machine abb/irb2400");
}

/// What a translation takes from a machine that nobody described is told; what it leaves to the machine is not.
#[test]
fn a_translation_holds_on_every_machine_or_says_so() {
    let program = |text: &str| [("a.ngc", text.to_string())];
    // On inch machines too: the arc that another start has is no greater there than on others.
    for unit in ["mm", "inch"] {
        let found = codes(&program("G21 G90 F100\nG2 X12 Y-16 R200\nM2\n"), &format!("build a.ngc --machine-units {unit} -o o.ngc"));
        assert_eq!(found, (vec!["E0607".into()], Some(0)), "{unit}");
    }
    for text in [
        "G21 G90\nG10 L2 P2 X[#5221+5]\nG55 G0 X1\nM2\n",
        "G21 G90\nG0 Z4\nG28.1\nG0 Z1\nG28\nM2\n",
        "G21 G90 F100\nT1 M6\nG0 X0 Y0 Z5\nG41 D1 G1 X10\nY10\nX20\nG40 X30\nM2\n",
        // A branch that another machine takes; the return of a cycle that its startup code selects.
        "G21 G90\no1 if [#5422 lt -100]\nG0 Z10\no1 endif\nG0 X1\nM2\n",
        "G21 G90\nT1 M6\no1 if [#5403 gt 100]\nG0 Z10\no1 endif\nG0 X1\nM2\n",
        "G21 G90 F100\nG0 X1 Y1 Z10\nG81 Z-1 R2\nX5\nG80\nM2\n",
        "G21 G91\nG0 X1 Y1\nG1 Z-1 F100\nM2\n",
        // The feed of the first way depends on its length, the wait on what is in store.
        "G21 G90 G93\nG1 X10 Y0 Z0 F2\nX20 F2\nM2\n",
        "G21 G90\nG0 X1\nG4 P[ABS[#5221]]\nG0 X2\nM2\n",
        // A step from where a probe stopped that nobody can tell from a coordinate.
        "G21 G54 F100\no1 sub\nG0 Z[0.5+0.5]\no1 endsub\nG90 G0 X0 Y0 Z10\nG38.2 Z-10\nG91\no1 call\nG90 G0 X9\nG0 Z5\nM2\n",
    ] {
        for command in ["build a.ngc -o o.ngc", "verify a.ngc"] {
            let (found, status) = codes(&program(text), command);
            assert!(found.iter().any(|c| c == "E0607"), "{command}: {found:?}\n{text}");
            assert_eq!(status, Some(0), "{text}");
        }
        let project = [program(text)[0].clone(), ("gcc-robot.toml", "[lints]\nstrict = true\n".into())];
        assert_eq!(codes(&project, "verify a.ngc").1, Some(1), "{text}");
    }
    for text in [
        // A height set by hand, a touch-off, an offset that is selected, a lathe, and a length that only the control has.
        "G21 G90 M3 S100\nG0 X10 Y10\nG1 X20 F100\nG3 X10 Y20 R10\nM5\nM2\n",
        "G21 G90\nG0 X1 Y1 Z1\nG38.2 Z-5 F10\nG92 Z0\nG0 Z5\nM2\n",
        "G21 G90\nG0 X1 Y1 Z1\nG38.2 Z-5 F10\nG10 L20 P1 Z2.5\nG0 Z5\nM2\n",
        "G21 G90\nG0 X10\nG10 L20 P1 X0\nG0 X5\nM2\n",
        "G21 G54 F100\no1 sub\nG0 Z1\no1 endsub\nG90 G0 X0 Y0 Z10\nG38.2 Z-10\nG91\no1 call\nG90 G0 X9\nG0 Z5\nM2\n",
        // A datum set by a subroutine that is told which.
        "G21 G90 G54 F100\no1 sub\nG38.2 Z-30\nG10 L20 P#1 Z#2\no1 endsub\nG0 X0 Y0 Z10\no1 call [1] [12.7]\nG0 Z20\nG1 X3\nM2\n",
        // A probe that touches twice.
        "G21 G90 G54 F100\nG0 X0 Y0 Z10\nG38.2 Z-10\nG91 G0 Z1\nG38.2 Z-2 F10\nG90 G10 L20 P1 Z0\nG0 Z5\nM2\n",
        "G21 G90 G54\nG0 X1 Y2 Z3\nG10 L20 P2 X50 Z[2+3]\nG10 L2 P3 X0 Y[1+1] R20\nG10 L2 P1 X0\nG55 G0 X3 Y4 Z5\nG92 X9\nG10 L20 P3 X1 Y1\nG56 G0 X1 Y1\nG10 L2 P6 Z0\nM2\n",
        "G21 G90 G17 G40 G49 G54\nG0 X1 Y1 Z1\nM2\n",
        // G10 selects nothing: the G54 behind it is said.
        "G21 G90\nG10 L2 P1 X0 Y0 Z0\nG54 G0 X1 Y1 Z5\nM2\n",
        // What the control may have in store is said again: a rotation of 0 too.
        "G21 G90 G17 G54\nG10 L2 P1 X0 Y0 Z0 R0\nG0 X10 Y0 Z5\nG10 L2 P0 R0 Y3\nG0 X20 Y1\nM2\n",
        // A first block that names G0 and no axis.
        "G21\nG0 G17 G40 G49 G80 G90\nT1 M6\nG0 X1 Y1\nG43 H1 Z5\nG1 Z-1 F100\nM2\n",
        // Rotary words that are rounded, along a line and an arc.
        "G21 G90 F100\nG0 A51.428571\nG1 X5 Y0 Z0 A[100/7]\nG2 X15 Y10 I10 A45.123456\nM2\n",
        "G20 G90\nG92 X0 Y0 Z0\nG0 Z1\nX1 Y1\nG92.2\nG0 X2\nG92.3\nG0 X3\nM2\n",
        "G21 G90\nG52 X0 Y0\nG0 X1\nM2\n",
        "G21 G90\nG92.1\nG0 X1 Z5\nM2\n",
        "G21 G90\nT1 M6 G43 H1\nG0 X10 Y10\nG0 Z5\nG43.2 H2\nG0 Z6\nM2\n",
        "G21 G90\nM61 Q5\nG43 H5\nG0 X1 Z5\nM2\n",
        "G21 G90 G18 G7\nM3 S100\nG0 X20 Z5\nG1 X18 F100\nZ0\nM5\nM2\n",
    ] {
        let (found, status) = codes(&program(text), "verify a.ngc");
        assert!(!found.iter().any(|c| c == "E0607") && status == Some(0), "{found:?}, {status:?}\n{text}");
    }
}

/// Cycles of a program that leaves the way to follow the path to the machine follow it exactly in between M70 and M72. M72 brings
/// back more than that: feed mode, spindle, coolant and work offset go on as the program has them.
#[test]
fn nothing_is_undone_behind_cycles() {
    let ini = "[RS274NGC]\nPARAMETER_FILE = m.var\n[EMCIO]\nTOOL_TABLE = m.tbl\n[TRAJ]\nLINEAR_UNITS = mm\n";
    let head = "G21 G90 G17 G54 G98 F100 S500 M3\nG0 X0 Y0 Z5\n";
    for body in [
        "G1 X4\nG95 F0.15\nG81 X-21 Y-2 Z-6 R4\nX-30\nG80\nG0 X0 Y0\nG1 Z-2\n",
        "G95 F0.2\nG1 X-4\nG94 F150\nG81 X5 Y5 Z-2 R1\nG80\nG1 X5\n",
        "G81 X5 Y5 Z-2 R1\nG80\nT2 M6\nG43 H2\nS900 M4 M8\nG81 X6 Y5 Z-2 R1\nG80\nG0 X0 Y0\nG1 Z-2\n",
        "G81 X5 Y5 Z-2 R1\nM8 S700 X9\nG80\nG1 Z-2\n",
        "G81 X10 Z-2 R1\nX20\nG55 X10\nX20\nG80\nG0 X0\nG1 Z-1\n",
    ] {
        let files = [
            file("a.ngc", &format!("{head}{body}M5 M9\nM2\n")),
            file("m.ini", ini),
            file("m.var", "5241 40\n5242 50\n5243 0\n"),
            file("m.tbl", "T1 P1 Z5 D3\nT2 P2 Z7 D3\n"),
        ];
        for command in ["build a.ngc --ini m.ini -o o.ngc", "verify a.ngc --ini m.ini"] {
            let (found, status) = codes(&files, command);
            assert!(!found.iter().any(|c| c == "E0607" || c == "E0609") && status == Some(0), "{found:?}, {status:?}\n{body}");
        }
    }
}

/// Files say what is in store, but not where the machine stands.
#[test]
fn where_a_machine_stands_no_file_says() {
    let told = |text: &str, startup: &str| {
        let ini = format!(
            "[RS274NGC]\nPARAMETER_FILE = m.var\nRS274NGC_STARTUP_CODE = {startup}\n[EMCIO]\nTOOL_TABLE = m.tbl\n[TRAJ]\nLINEAR_UNITS = mm\n"
        );
        let files = [file("a.ngc", text), file("m.ini", &ini), file("m.var", ""), file("m.tbl", "T1 P1 Z5 D3\n")];
        codes(&files, "verify a.ngc --ini m.ini").0
    };
    assert_eq!(told("G21 G91\nG0 X1 Y1\nG1 Z-1 F100\nM2\n", "G21"), ["E0607"]);
    // A startup code is run by the machine itself, and the written program stands it.
    for startup in ["G21", "G7 G18 G21 G90", "G17 G21 G40 G49 G80 G90 G94", "G55 G64 P0.01", "G20 G91 G98"] {
        let none: [&str; 0] = [];
        assert_eq!(told("G21 G90\nG0 X1 Y1 Z5\nG1 Z-1 F100\nM2\n", startup), none, "{startup}");
        assert_eq!(told("G21 G90 G17 F100\nG0 X1 Y1 Z5\nG81 Z-1 R2\nX4\nG80\nM2\n", startup), none, "{startup}");
    }
}

/// What a control may have in store is said again, or told: zeros, shifts put away, numbers of the user's own.
#[test]
fn what_a_control_has_in_store() {
    let part = |before: &str| file("a.ngc", &format!("G21 G90 G17 G54 F100\n{before}\nS1000 M3\nG0 X10 Y0 Z50\nG1 X20 Z-1\nX30\nG0 Z50\nM5\nM2\n"));
    let restart = "build a.ngc --target rs274ngc --from-line 5 --safe-z 60";
    for (before, written) in [
        ("G92.1", "G92.1\n"),
        ("G92.2", "G92.1\n"),
        ("G52 X0 Y0 Z0", "G92.1\n"),
        ("G10 L2 P1 R0", "G10 L2 P1 R0\n"),
        ("G10 L2 P1 X0 Y0 Z0", "G10 L2 P1 X0 Y0 Z0\n"),
        ("G10 L2 P0 X0 R0", "G10 L2 P1 X0 R0\n"),
    ] {
        let (text, status) = output(&[part(before)], restart);
        assert!(text.contains(written) && status == Some(0), "{before}: {text}");
    }
    // Where G92 counts from, nobody knows.
    told("E0652", &[part("G92 X1 Y2 Z3")], restart);
    // The way the path is followed: what the program asks for, and nothing that a cycle left behind it.
    let path = "G21 G90 G17 G54 F100\nS1000 M3\nG0 X0 Y0 Z5\nG61\nG1 Z-1\nX10\nG0 Z5\nM5\nM2\n";
    assert!(output(&[file("a.ngc", path)], "build a.ngc --target rs274ngc --from-line 6 --safe-z 60").0.contains("\nG61\n"));
    let cycle = "G21 G90 G17 G54 F100\nS1000 M3\nG0 X0 Y0 Z5\nG99 G81 X2 Y2 Z-1 R2\nG80\nG0 X3\nG1 Z1\nX5\nM2\n";
    let (text, _) = output(&[file("a.ngc", cycle)], "build a.ngc --target rs274ngc --from-line 7 --safe-z 60");
    assert!(text.contains("restart at line 7") && !text.contains("G64"), "{text}");
    // Another work offset in the middle of increments: a restart as much as the whole.
    let steps = "G21 G90 G17 G54 F100\nS1000 M3\nG0 X0 Y0 Z5\nX1\nG55\nG91 G1 X5 Y1\nG90 G0 Z5\nM5\nM2\n";
    let own = "G21 G90 G17 G54 F100\nS500 M3\nG0 X0 Y0 Z5\nG1 Z-#500\nG0 Z5\nM5\nM2\n";
    let put_away = "G21 G90 G17 G54 F100\nS1000 M3\nG0 X0 Y0 Z5\nG92.3\nG91 G1 X5\nG90 G0 Z5\nM5\nM2\n";
    // Half a minute a move is another feed where the move is another one.
    let inverse = "G21 G90 G17 G54 F100\nS1000 M3\nG0 X0 Y0 Z5\nX1\nG55\nG93 G1 X7 Y0 Z5 F3\nG94 G0 Z9\nM5\nM2\n";
    let blend = "G21 G90 G17 G54 F100\nS1000 M3\nG0 X0 Y0 Z5\nG64 P[#500/100]\nG1 X4\nM5\nM2\n";
    let later = " --from-line 4 --safe-z 60";
    for (text, option) in [(steps, ""), (steps, later), (own, ""), (put_away, ""), (inverse, later), (blend, "")] {
        told("E0607", &[file("a.ngc", text)], &format!("build a.ngc --target rs274ngc -o a.nc{option}"));
    }
    assert!(codes(&[file("a.ngc", &own.replace("G0 X0 Y0", "#500=2\nG0 X0 Y0"))], "build a.ngc --target rs274ngc -o a.nc").0.is_empty());
    for line in [5, 6] {
        let plain = file("a.ngc", path);
        assert!(codes(&[plain], &format!("build a.ngc --target rs274ngc --from-line {line} --safe-z 60 -o a.nc")).0.is_empty());
    }
    // What is told is what makes the difference, also beside one that is the same on every machine.
    let hole = "G21 G90 G17 G54 G40 G49\nM3 S1000\nG0 X0 Y0 Z10\nG81 X10 Y10 Z-3 R2 F100\nX20\nG80\nG1 Z-1\nX30\nG0 Z50\nM5\nM2\n";
    for to in ["grbl", "fanuc-mill", "linuxcnc"] {
        let (text, _) = output(&[file("a.ngc", hole)], &format!("build a.ngc --target rs274ngc --to {to} -o a.nc"));
        assert!(text.contains("E0607") && text.contains("G98 or G99"), "{to}: {text}");
    }
    // LinuxCNC takes another place for the present one where the frame is turned under a shift: the number is the source's.
    let turned = file("a.ngc", "G21 G90 G17 G54 F100\nG0 X0 Y0 Z5\nG10 L2 P1 R0\nG10 L20 P1 X24\nG0 X1 Y2 Z30\nM2\n");
    let stored = file("a.var", "5210 1\n5211 7\n5212 1\n5213 2\n5220 1\n5221 10\n5222 3\n5230 30\n");
    let (text, status) = output(&[turned, stored], "build a.ngc --target rs274ngc --vars a.var --machine-units inch");
    assert!(text.contains("G10 L20 P1 X24\n") && status == Some(0), "{text}");
}
