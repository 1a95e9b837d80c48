//! What LinuxCNC 2.10 does otherwise than 2.9, one test for each difference.

use std::sync::Arc;

use gr_canon::{FileId, Printer, Units, Version};
use gr_gcode::{Chunk, File};
use gr_interp::{Files, Interp, Setup};
use gr_spec::Dialect;

struct Two(File, File);

impl Files for Two {
    fn file(&self, id: FileId) -> &File {
        if id.0 == 0 { &self.0 } else { &self.1 }
    }
    fn find_sub(&mut self, name: &str) -> Option<FileId> {
        (name == "sub").then_some(FileId(1))
    }
}

fn run_two(version: Version, text: &str, sub: &str) -> (Vec<String>, String) {
    let name = if version == Version::V2_10 { "linuxcnc-2.10" } else { "linuxcnc-2.9" };
    let dialect = Dialect::find(name).expect("a dialect of the tables");
    let setup = Setup { version, dialect, machine_units: Units::Inch, ..Setup::default() };
    let file = |name: &str, text: &str| {
        let chunk = Chunk { text: gr_text::Text::from(text), scan: Arc::new(gr_gcode::scan(text, dialect)) };
        File::new(name, vec![chunk])
    };
    let mut files = Two(file("main.ngc", text), file("sub.ngc", sub));
    let mut printer = Printer::new(Vec::new(), version);
    let outcome = Interp::new(&mut files, &setup, &mut printer).run(FileId(0));
    let printed = String::from_utf8(printer.finish().expect("a vector takes everything")).expect("ASCII");
    let calls = printed.lines().skip(6).map(|l| l.split_once("N..... ").map_or(l, |(_, call)| call).to_string()).collect();
    let fault = outcome.findings.iter().find_map(|f| f.fault.rs_text()).unwrap_or_default();
    (calls, fault)
}

fn old(text: &str) -> (Vec<String>, String) {
    run_two(Version::V2_9, text, "")
}
fn new(text: &str) -> (Vec<String>, String) {
    run_two(Version::V2_10, text, "")
}

#[test]
fn r_of_g64_chooses_the_planner() {
    assert_eq!(old("G64 P1 R0.5\nM2\n").1, "R word with no g code that uses it");
    let (calls, fault) = new("G64 P1 R0.5\nG64 P1 R2.5\nG64 P1 R0.05\nG64 P1 R0\nG64\nM2\n");
    assert_eq!(fault, "");
    let planner: Vec<_> = calls.iter().filter(|c| c.contains("PLANNER")).map(String::as_str).collect();
    assert_eq!(
        planner,
        [
            "SET_PLANNER_MODE(type=1, peak_scale=0.500000)",
            "SET_PLANNER_MODE(type=1, peak_scale=1.000000)",
            "SET_PLANNER_MODE(type=1, peak_scale=0.100000)",
            "SET_PLANNER_MODE(type=0, peak_scale=-1.000000)",
        ]
    );
    assert_eq!(calls[0], planner[0]);
    assert_eq!(new("G61 R0.5\nM2\n").1, "R word with no g code that uses it");
    assert!(new("G64 M19 R90 S0\nM2\n").1.starts_with("R word is ambiguous on a line with both G64 and M19"));
}

#[test]
fn machine_position_has_numbers() {
    let text = "G21\nG10 L2 P1 X3 Y7 R45\nG92 X3\nG43.1 Z5\nG53 G0 X1 Y2 Z3\n(debug,#5021 #5022 #5023)\nM2\n";
    let shown = |calls: Vec<String>| calls.into_iter().find(|c| c.starts_with("MESSAGE")).unwrap_or_default();
    assert_eq!(shown(new(text).0), "MESSAGE(\"1.000000 2.000000 3.000000\")");
    assert_eq!(shown(old(text).0), "MESSAGE(\"0.000000 0.000000 0.000000\")");
}

#[test]
fn offset_parameters_follow_g43() {
    let text = "G20\nG43.1 Z5\n(debug,#5403)\nG49\n(debug,#5403)\nM2\n";
    let shown = |calls: Vec<String>| calls.into_iter().filter(|c| c.starts_with("MESSAGE")).collect::<Vec<_>>();
    assert_eq!(shown(new(text).0), ["MESSAGE(\"5.000000\")", "MESSAGE(\"0.000000\")"]);
    assert_eq!(shown(old(text).0), ["MESSAGE(\"0.000000\")", "MESSAGE(\"0.000000\")"]);
}

#[test]
fn m72_restores_feed_speed_and_path_mode_always() {
    let text = "F100 S50\nM70\nM72\nM2\n";
    let count = |calls: &[String], what: &str| calls.iter().filter(|c| c.starts_with(what)).count();
    let (calls, _) = new(text);
    assert_eq!([count(&calls, "SET_FEED_RATE(100"), count(&calls, "SET_SPINDLE_SPEED(0, 50")], [2, 2]);
    assert_eq!([count(&calls, "SET_MOTION_CONTROL"), count(&calls, "SET_NAIVECAM")], [1, 1]);
    let (calls, _) = old(text);
    assert_eq!([count(&calls, "SET_FEED_RATE(100"), count(&calls, "SET_MOTION_CONTROL")], [1, 0]);
}

#[test]
fn a_called_file_holds_one_subroutine() {
    let nested = "o<sub> sub\no100 sub\no100 endsub\no<sub> endsub\nM2\n";
    let main = "o<sub> call\nM2\n";
    assert_eq!(run_two(Version::V2_9, main, nested).1, "");
    assert!(run_two(Version::V2_10, main, nested).1.starts_with("Nested subroutine definition: 'O100 sub' found inside"));
    let behind = "o<sub> sub\no200 call\no<sub> endsub\no200 sub\no200 endsub\nM2\n";
    assert_eq!(run_two(Version::V2_9, main, behind).1, "");
    assert!(run_two(Version::V2_10, main, behind).1.starts_with("Subroutine 'O200' not found"));
}

#[test]
fn splines_lie_in_every_plane() {
    let text = "F100\nG18\nG5.1 X2 Z0 I1 J1\nG0 Y1\nM2\n";
    assert_eq!(old(text).1, "Splines must be in the XY plane");
    let (calls, fault) = new(text);
    assert_eq!(fault, "");
    assert!(calls.contains(&"NURBS_G5_FEED(3, ...)".to_string()), "{calls:#?}");
    assert!(calls.contains(&"STRAIGHT_TRAVERSE(2.0000, 1.0000, 0.0000, 0.0000, 0.0000, 0.0000)".to_string()), "{calls:#?}");
}

/// A contour that ends in the stock: 2.9 goes round for ever, 2.10 leads it out.
#[test]
fn roughing_leaves_the_stock() {
    let text = "G18 G21 G8\nF225\nO200 SUB\nG1 X10 Z0\nG1 X10 Z-14\nG1 X3\nG1 X7 Z-22\nO200 ENDSUB\nG71.1 Q200 X15 Z0 D0.04 I0.5 R1\nM2\n";
    let (calls, fault) = new(text);
    assert_eq!(fault, "");
    let cuts: Vec<_> = calls.iter().filter(|c| c.starts_with("STRAIGHT_FEED")).map(String::as_str).collect();
    assert_eq!(cuts[0], "STRAIGHT_FEED(15.0000, 0.0000, -21.9600, 0.0000, 0.0000, 0.0000)");
    assert_eq!(cuts[cuts.len() - 1], "STRAIGHT_FEED(15.0000, 0.0000, -21.9600, 0.0000, 0.0000, 0.0000)");
    assert_eq!(cuts.len(), 15);
    let text = "G18 G21\nF400\no100 sub\nG1 X50 Z-40\nX100 Z-40\no100 end sub\nG72 Q100 X50 Z0 I3 R0.1\nM2\n";
    let passes = |calls: &[String]| calls.iter().filter(|c| c.starts_with("STRAIGHT_FEED")).count();
    assert_eq!(passes(&new(text).0), 16);
    assert!(passes(&old(text).0) < 5);
}

/// G6.2: the order on the first line, a knot on each; the knot that comes as often as the order ends the curve.
#[test]
fn splines_with_knots() {
    let curve = "G6.2 P3 Q1 X0 Y0 R1 K0\nX1 Y2 R1 K0\nX3 Y2 R1 K0\nX4 Y0 R1 K1\nG6.2 K2\nG6.2 K2\nG6.2 K2\n";
    let text = format!("F100\n{curve}G0 X5\nM2\n");
    assert_eq!(old(&text).1, "Unknown g code used");
    let (calls, fault) = new(&text);
    assert_eq!(fault, "");
    assert!(calls.contains(&"NURBS_G6_FEED(7, ...)".to_string()), "{calls:#?}");
    for (line, text) in [
        ("G6.2 Q1 X0 Y0 R1 K0", "Program the nurbs order P in the first block of instruction"),
        ("G6.2 P3 X0 Y0 R1 K0", "Program the nurbs Q value (1,2,3) in the first block of nurbs instruction"),
        ("G6.2 P3 Q4 X0 Y0 R1 K0", "nurbs Q value not in range 1 to 3"),
        ("G6.2 P3.5 Q1 X0 Y0 R1 K0", "nurbs order P number is not an integer"),
        ("G6.2 P3 Q1 X0 R1 K0", "You must specify both X and Y coordinates for Control Points"),
        ("G6.2 P3 Q1 X0 Y0 R1 K0\nX1 Y1 R0 K0", "Must specify positive nurbs weight R for every Control Point"),
        ("G6.2 P3 Q1 X0 Y0 R1 K0\nX1 Y1 R1 K-1", "Must specify nurbs K number for every Control Point"),
        ("G17.1 G6.2 P3 Q1 X0 Y0 R1 K0", "one plane must be selected for nurbs: XY, YZ, ZX"),
    ] {
        assert_eq!(new(&format!("F100\n{line}\nM2\n")).1, text, "{line}");
    }
    assert_eq!(new("G6.2 P3 Q1 X0 Y0 R1 K0\nM2\n").1, "Cannot make a nurbs with 0 feedrate");
    let (calls, _) = new("F100\nG6 X1 Y1 I0 J1 P0 Q-1\nG6.1 X2 Y2 I1 J0\nM2\n");
    assert_eq!(calls.iter().filter(|c| c.starts_with("NURBS_G5_FEED")).count(), 2);
}

#[test]
fn pecks_clear_by_a_millimetre_or_d() {
    let drill = |words: &str| format!("G21 F100\nG83 X0 Y0 Z-2 R1 Q1{words}\nM2\n");
    let level = |(calls, _): (Vec<String>, String)| {
        let cut = calls.iter().position(|c| c.starts_with("STRAIGHT_FEED")).expect("it cuts");
        calls[cut + 2].clone()
    };
    assert_eq!(level(old(&drill(""))), "STRAIGHT_TRAVERSE(0.0000, 0.0000, 0.2540, 0.0000, 0.0000, 0.0000)");
    // An inch machine: 0.050 in.
    assert_eq!(level(new(&drill(""))), "STRAIGHT_TRAVERSE(0.0000, 0.0000, 1.2700, 0.0000, 0.0000, 0.0000)");
    assert_eq!(level(new(&drill(" D0.5"))), "STRAIGHT_TRAVERSE(0.0000, 0.0000, 0.5000, 0.0000, 0.0000, 0.0000)");
    assert_eq!(old(&drill(" D0.5")).1, "D word with no G41, G41.1, G42, G42.1, G71, G71.1, G71.2 or G96 to use it");
    assert_eq!(
        new("G81 X1 Z-1 R1 D1 F1\nM2\n").1,
        "D word with no G41, G41.1, G42, G42.1, G71, G71.1, G71.2 G73, G83 or G96 to use it"
    );
}

#[test]
fn equality_is_finer() {
    let shown = |(calls, _): (Vec<String>, String)| calls.into_iter().find(|c| c.starts_with("MESSAGE")).unwrap_or_default();
    let text = "#1=[1.00001 EQ 1] #2=[1.0000001 EQ 1]\n(debug,#1 #2)\nM2\n";
    assert_eq!(shown(old(text)), "MESSAGE(\"1.000000 1.000000\")");
    assert_eq!(shown(new(text)), "MESSAGE(\"0.000000 1.000000\")");
}

#[test]
fn tool_change_and_version_number() {
    let text = "T0 M6\n(debug,#<_vmajor>)\nM2\n";
    let (calls, _) = old(text);
    assert!(calls.contains(&"START_CHANGE()".to_string()) && calls.iter().any(|c| c.starts_with("CHANGE_TOOL(")), "{calls:#?}");
    assert!(calls.contains(&"MESSAGE(\"2.900000\")".to_string()));
    let (calls, _) = new(text);
    assert!(!calls.contains(&"START_CHANGE()".to_string()) && calls.contains(&"CHANGE_TOOL()".to_string()), "{calls:#?}");
    assert!(calls.contains(&"MESSAGE(\"2.100000\")".to_string()), "{calls:#?}");
}

/// A pass that finds nothing to cut goes on along the contour; 2.9 stays there for ever.
#[test]
fn roughing_goes_on_past_an_empty_level() {
    let text = "G18 G21 G7\nF100\no100 sub\nG1 X18.7259\nZ0\nX19.726 C0.5\nW-5\nU0.5\nZ-25\nX20\no100 endsub\nG71 Q100 Z2.8 X20 D2 I2 R0.3\nM2\n";
    assert_eq!(new(text).1, "");
    assert!(old(text).1.contains("too many passes"), "{}", old(text).1);
}
