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
        let chunk = Chunk { text: Arc::from(text), scan: Arc::new(gr_gcode::scan(text, dialect)) };
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
