//! Motion geometry: each program in `tests/motion` gives the stream beside it. Where LinuxCNC's own `rs274` is
//! installed, it must give the same.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gr_canon::{FileId, Printer, Units, Version};
use gr_gcode::{Chunk, File};
use gr_interp::{Files, Interp, Outcome, Setup, read_tools};
use gr_tests::oracle::{Job, reference};

const TOOLS: &str = "T1 P1 D6.0\nT2 P2 D0.03 Q2\nT3 P3 D0.03 Q6\n";

struct One(File);

impl Files for One {
    fn file(&self, _id: FileId) -> &File {
        &self.0
    }
    fn find_sub(&mut self, _name: &str) -> Option<FileId> {
        None
    }
}

fn run(text: &str) -> (String, Outcome) {
    let setup = Setup {
        machine_units: Units::Inch,
        tools: read_tools(TOOLS, FileId(0)).0,
        user_m_codes: false,
        uvw: false,
        ..Setup::default()
    };
    let chunk = Chunk { text: gr_text::Text::from(text), scan: Arc::new(gr_gcode::scan(text, setup.dialect)) };
    let mut files = One(File::new("test.ngc", vec![chunk]));
    let mut printer = Printer::new(Vec::new(), Version::V2_9);
    let outcome = Interp::new(&mut files, &setup, &mut printer).run(FileId(0));
    let out = printer.finish().expect("a vector takes everything");
    (String::from_utf8(out).expect("the stream is ASCII here"), outcome)
}

fn errors(outcome: &Outcome) -> Vec<String> {
    outcome.findings.iter().filter_map(|f| f.fault.rs_text()).collect()
}

fn programs() -> Vec<PathBuf> {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/motion");
    let mut all: Vec<PathBuf> = std::fs::read_dir(dir)
        .expect("the folder of programs")
        .map(|e| e.expect("readable").path())
        .filter(|p| p.extension().is_some_and(|e| e == "ngc"))
        .collect();
    all.sort();
    assert!(all.len() >= 10);
    all
}

/// What the real `rs274` prints: output, whether it accepts the program, messages.
fn rs274(real: &Path, program: &str) -> (String, bool, String) {
    let out = Job { tools: Some(TOOLS.into()), ..Job::new(program) }.reference(real);
    (out.canon.clone(), out.ok(), out.ended.errors())
}

#[test]
fn streams_are_as_recorded_and_as_rs274_gives_them() {
    let real = reference();
    for path in programs() {
        let name = path.display();
        let text = std::fs::read_to_string(&path).expect("readable");
        let (stream, outcome) = run(&text);
        assert!(outcome.ok(), "{name}: {:?}", errors(&outcome));
        let expected = path.with_extension("canon");
        if std::env::var_os("RECORD").is_some() {
            std::fs::write(&expected, &stream).expect("writable");
        }
        let recorded = std::fs::read_to_string(&expected).unwrap_or_default();
        assert_eq!(stream, recorded, "{name}; record with RECORD=1");
        if let Some(real) = &real {
            let (theirs, ok, _) = rs274(real, &text);
            assert!(ok, "{name}: rs274 refuses it");
            assert_eq!(stream, theirs, "{name}: rs274 differs");
        }
    }
}

/// One fault each, and the text that rs274 gives for it.
const FAULTS: &[(&str, &str)] = &[
    ("G2 X1 Y1", "R i j k words all missing for arc"),
    ("G2 X1 Y1 R1 I1", "Mixed radius ijk format for arc"),
    ("G2 X1 Y1 K1", "K word given for arc in xy plane"),
    ("G18\nG2 X1 Z1 J1", "J word given for arc in xz plane"),
    ("G19\nG2 Y1 Z1 I1", "I word given for arc in yz plane"),
    ("G90.1\nG2 X1 Y1 I1", "J word missing in absolute center arc"),
    ("G18 G90.1\nG2 X1 Z1 K1", "I word missing in absolute center arc"),
    ("G2 R5", "X and y words missing for arc in xy plane"),
    ("G18\nG2 R5 Y1", "X and z words missing for arc in xz plane"),
    ("G19\nG2 R5 X1", "Y and z words missing for arc in yz plane"),
    ("G2 X0 Y0 R5", "Current point same as end point of arc"),
    ("G2 X10 Y0 R4", "Arc radius too small to reach end point"),
    (
        "G2 X5 Y0 I0 J0",
        "Zero-radius arc: start=(X0.0000,Y0.0000) center=(X0.0000,Y0.0000) end=(X5.0000,Y0.0000) r1=0.0000 r2=5.0000",
    ),
    (
        "G3 X5 Y0 I2 J0",
        "Radius to end of arc differs from radius to start: start=(X0.0000,Y0.0000) center=(X2.0000,Y0.0000) end=(X5.0000,Y0.0000) r1=2.0000 r2=3.0000 abs_err=1 rel_err=33.3333%",
    ),
    ("G94\nG2 X5 I2.5", "Cannot make arc with zero feed rate"),
    ("G93\nG2 X5 I2.5", "F word missing with inverse time arc move"),
    ("G95 F1\nG2 X5 I2.5", "Cannot feed with zero spindle speed in feed per rev mode"),
    ("G17.1\nG2 X5 I2.5", "Cannot do an arc in planes G17.1, G18.1, or G19.1"),
    ("G41.1", "G41.1 with no D word"),
    ("G41.1 D2 L1", "G41.1 with L word, but plane is not G18"),
    ("G41 D1.5", "G41 requires D word to be a whole number"),
    ("G42 D-1", "G42 requires D word to be a whole number"),
    ("G42 D9", "Requested tool 9 not found in the tool table"),
    ("G41 D2", "G41 with lathe tool, but plane is not G18"),
    ("G19\nG41.1 D2", "Cutter radius compensation allowed only in XY, XZ planes"),
    ("G41.1 D2\nG42.1 D2", "Cannot turn cutter radius comp on when on"),
    ("G41.1 D2\nG1 X0.9", "Length of cutter compensation entry move is not greater than the tool radius"),
    (
        "G41.1 D2\nG2 X0.5 Y0.5 J0.5",
        "Radius of cutter compensation entry arc is not greater than the tool radius",
    ),
    ("G41.1 D8\nG1 X20\nG3 X23 Y3 J3", "Tool radius not less than arc radius with comp"),
    (
        "G41.1 D10\nG1 X20\nX21 Y3\nX20 Y20\nG40",
        "Straight feed in concave corner cannot be reached by the tool without gouging",
    ),
    (
        "G41.1 D2\nG1 X20\nY10\nG40\nG2 X10 Y10 R5",
        "The move just after exiting cutter compensation mode must be straight, not an arc",
    ),
    ("G41.1 D2\nG1 X9\nG81 X3 Z-1 R1", "Cannot use canned cycles with cutter compensation on"),
    ("G41.1 D2\nG1 X9\nG5.1 X3 I1 J1", "Cannot convert spline with cutter radius compensation"),
    ("G81 X1 Z-1", "R clearance plane unspecified in cycle"),
    ("G81 X1 R1", "Z value unspecified in xy plane canned cycle"),
    ("G18\nG81 X1 R1", "Y value unspecified in xz plane canned cycle"),
    ("G19\nG81 Y1 R1", "X value unspecified in yz plane canned cycle"),
    ("G81 X1 Z-1 R1 L0", "Cannot do zero repeats of cycle"),
    ("G81 X1 Z2 R1", "R less than z in cycle in xy plane"),
    ("G18\nG81 X1 Y2 R1", "R less than y in cycle in xz plane"),
    ("G19\nG81 Y1 X2 R1", "R less than x in cycle in yz plane"),
    ("G93\nG81 X1 Z-1 R1", "Cannot use inverse time feed with canned cycles"),
    ("G94\nG81 X1 Z-1 R1", "Cannot feed with zero feed rate"),
    ("G82 X1 Z-1 R1", "Dwell time p word missing with g82"),
    ("G83 X1 Z-1 R1", "Q word missing with g83"),
    ("G73 X1 Z-1 R1", "Q word missing with g73"),
    ("G83 X1 Z-1 R1 Q0", "Negative or zero q value used"),
    ("G86 X1 Z-1 R1 P1", "Spindle not turning in g86"),
    ("G87 X1 Z-1 R1 I1 J1", "K word missing with g87"),
    ("G88 X1 Z-1 R1 P1", "Spindle not turning in g88"),
    ("G84 X1 Z-1 R1", "Spindle not turning in G84"),
    ("S100 M4\nG84 X1 Z-1 R1", "Spindle turning counterclockwise in G84"),
    ("S100 M3\nG74 X1 Z-1 R1", "Spindle turning clockwise in G74"),
    ("G33 Z-1 K1", "Spindle not turning in G33"),
    ("G33.1 Z-1 K1", "Spindle not turning in G33.1"),
    ("G18\nG76 P1 Z-1 I1 J1 K2", "Chosen spindle (0) not turning in G76"),
    ("G18\nS100 M3\nG76 P1 Z-1 I0 J1 K2", "In G76, I must not be 0"),
    ("G18\nS100 M3\nG76 P1 Z-1 I1 J0 K2", "In G76, J must be greater than 0"),
    ("G18\nS100 M3\nG76 P1 Z-1 I1 J1 K1", "In G76, K must be greater than J"),
    ("G18\nS100 M3\nG76 P1 Z-1 A5 I1 J1 K2", "Cannot move rotary axes with G76"),
    ("G71 X1", "G7x.x  requires a Q word"),
    ("G71 X1 Q1", "G71.0 can only be used in XZ plane (G18)"),
    ("G5 P1 Q1 X1 I1", "Must specify both I and J, or neither"),
    ("G5 X1 I1 J1", "Must specify both P and Q with G5"),
    ("G5.1 X1 I1", "Must specify both I and J with G5.1"),
    ("G18\nG5.1 X1 I1 J1", "Splines must be in the XY plane"),
    ("G5.1 X1 Z1 I1 J1", "Splines may not have motion in Z, A, B, or C"),
    ("G5.3", "Cannot use G5.3 without G5.2 first"),
    ("G5.2 X1 P1", "You must specify both X and Y coordinates for Control Points"),
    ("G5.2 X1 Y1 P1\nX2 Y2", "Must specify positive weight P for every Control Point"),
    ("G5.2 X1 Y1 P1\nG5.3", "You must specify a number of control points at least equal to the order L = 3"),
];

#[test]
fn faults_have_the_texts_of_rs274() {
    let real = reference();
    for (program, text) in FAULTS {
        let program = format!("G21 G17 G90 F100\n{program}\nM2\n");
        let (stream, outcome) = run(&program);
        assert_eq!(errors(&outcome), [*text], "{program}");
        if let Some(real) = &real {
            let (theirs, ok, messages) = rs274(real, &program);
            assert!(!ok && messages.contains(text), "{program}{messages}");
            assert_eq!(stream, theirs, "{program}");
        }
    }
}

/// Programs that the controller takes in silence, and which we doubt.
#[test]
fn doubts() {
    let codes = |program: &str| {
        let (_, outcome) = run(program);
        assert!(outcome.ok(), "{program}");
        outcome.findings.iter().map(|f| f.fault.code.def().slug).collect::<Vec<_>>()
    };
    assert_eq!(codes("G21 F100\nG81 X1 Z-1 R2\nG80\nM2\n"), ["cycle/starts-below-r"]);
    assert_eq!(codes("G21 F100\nG0 Z2\nG81 X1 Z-1 R2\nG80\nM2\n"), [""; 0]);
    assert_eq!(codes("G21 F100\nG5 P1 Q1 X5 Y5\nM2\n"), ["spline/no-first-tangent"]);
    assert_eq!(codes("G21 F100\nG5 I1 J1 P1 Q1 X5 Y5\nG5 P1 Q1 X9 Y9\nM2\n"), [""; 0]);
}

/// The real controller goes round for ever here.
#[test]
fn a_roughing_contour_that_never_ends_is_refused() {
    let text = "G21 G18 F100\no1 sub\nG1 X10 Z0\nX10 Z-14\nX3\nX7 Z-22\no1 endsub\nG71.2 Q1 X15 Z0 D0.04 I0.5 R1\nM2\n";
    let (_, outcome) = run(text);
    assert_eq!(errors(&outcome), ["G7X error: too many passes"]);
}

/// The registry's examples: the bad one raises its code alone, the good one nothing.
#[test]
fn examples_of_the_registry() {
    let mine = |code: &str| matches!(code, "E0193" | "E0203") || ("E0260"..="E0279").contains(&code);
    let mut wrong = Vec::new();
    for code in gr_spec::Code::all().filter(|c| mine(c.def().code)) {
        let def = code.def();
        let found = |program: Option<&str>| {
            let (_, outcome) = run(program.expect("both examples are there"));
            let mut found: Vec<_> = outcome.findings.iter().map(|f| f.fault.code.def().slug).collect();
            found.dedup();
            found
        };
        let (bad, good) = (found(def.bad), found(def.good));
        if bad != [def.slug] || !good.is_empty() {
            wrong.push(format!("{}: bad {bad:?}, good {good:?}", def.code));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// How far a peck cycle stays above the last bottom: fixed in 2.9; INI file or D word in 2.10.
#[test]
fn peck_clearance_by_version() {
    let mm = "G21 G90 F100\nG0 Z5\nG83 X0 Y0 Z-10 R0 Q5\nG80\nM2\n";
    let inch = "G20 G90 F10\nG0 Z5\nG83 X0 Y0 Z-10 R0 Q5\nG80\nM2\n";
    let told = "G21 G90 F100\nG0 Z5\nG83 X0 Y0 Z-10 R0 Q5 D2\nG80\nM2\n";
    let stream = |version, ini: &str, program: &str| {
        let setup = Setup { version, ini: gr_interp::read_ini(ini, FileId(0), None, None).0, ..Setup::default() };
        let chunk = Chunk { text: gr_text::Text::from(program), scan: Arc::new(gr_gcode::scan(program, setup.dialect)) };
        let mut files = One(File::new("test.ngc", vec![chunk]));
        let mut printer = Printer::new(Vec::new(), Version::V2_9);
        let _ = Interp::new(&mut files, &setup, &mut printer).run(FileId(0));
        String::from_utf8(printer.finish().expect("a vector takes everything")).expect("ASCII")
    };
    assert!(stream(Version::V2_9, "", mm).contains("STRAIGHT_TRAVERSE(0.0000, 0.0000, -4.7460,"));
    assert!(stream(Version::V2_9, "", inch).contains("STRAIGHT_TRAVERSE(0.0000, 0.0000, -4.9900,"));
    assert!(stream(Version::V2_10, "", mm).contains("STRAIGHT_TRAVERSE(0.0000, 0.0000, -4.0000,"));
    let ini = "[RS274NGC]\nPARAMETER_G83_PECK_CLEARANCE = 0.5\n";
    assert!(stream(Version::V2_10, ini, mm).contains("STRAIGHT_TRAVERSE(0.0000, 0.0000, -4.5000,"));
    assert!(stream(Version::V2_10, ini, told).contains("STRAIGHT_TRAVERSE(0.0000, 0.0000, -3.0000,"));
}
