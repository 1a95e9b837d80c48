//! `accuracy`, `map` and `place` as their users see them.

use std::path::Path;
use std::process::{Command, Output, Stdio};

fn run(folder: &Path, args: &[&str]) -> Output {
    let mut c = Command::new(env!("CARGO_BIN_EXE_gcc-robot"));
    c.args(args).current_dir(folder).env_remove("NO_COLOR").stdin(Stdio::null());
    c.output().unwrap()
}

fn examples() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples"))
}

fn whole(o: &Output) -> String {
    let text = |b: &[u8]| String::from_utf8(b.to_vec()).unwrap();
    format!("exit {}\n--- out\n{}--- err\n{}", o.status.code().unwrap(), text(&o.stdout), text(&o.stderr))
}

const PLACED: [&str; 7] = ["accuracy", "flange.ngc", "-ttools.tbl", "--machine=usp/2ups-prp", "--part=820,-10,-60", "--material=1045", "--teeth=3"];

#[test]
fn report_of_a_part() {
    let more = ["--depth=1", "--width=6", "--tolerance=0.06", "--message-format=short"];
    insta::assert_snapshot!(whole(&run(examples(), &[&PLACED[..], &more].concat())));
    // Without cutting data the deflection is left out, and that is told.
    insta::assert_snapshot!("nothing_of_the_cut", whole(&run(examples(), &[&PLACED[..5], &["--message-format=short"]].concat())));
    insta::assert_snapshot!("unknown_material", whole(&run(examples(), &[&PLACED[..5], &["--material=cheese", "--message-format=short"]].concat())));
    let json = run(examples(), &[&PLACED[..], &["--depth=1", "--width=6", "--format=json"]].concat());
    let v: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(v["operations"].as_array().unwrap().len(), 3);
    assert!(v["operations"][0]["worst"]["sum"].as_f64().unwrap() > 0.05);
    let csv = run(examples(), &[&PLACED[..], &["--format=csv"]].concat());
    assert_eq!(String::from_utf8(csv.stdout).unwrap().lines().count(), 4);
}

/// STEP-NC: by workingstep, against the tolerance of the feature; a material that is in no table leaves the deflection out.
#[test]
fn report_of_a_step_nc_part() {
    let o = run(&examples().join("stepnc"), &["accuracy", "case-study.p21", "--machine=usp/2ups-prp", "--part=700,-60,0", "--message-format=short"]);
    insta::assert_snapshot!(whole(&o));
    // A feature's own tolerance goes before the workpiece's, the option before both.
    let text = std::fs::read_to_string(examples().join("stepnc/case-study.p21")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.p21"), text.replace("PLUS_MINUS_VALUE(0.05,0.05,3)", "PLUS_MINUS_VALUE(0.056,0.07,3)")).unwrap();
    let report = |more: &[&str]| {
        let o = run(folder.path(), &[&["accuracy", "part.p21", "--machine=usp/2ups-prp", "--part=700,-60,0", "--format=json"], more].concat());
        let v: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap();
        v["operations"].as_array().unwrap().clone()
    };
    let rows = report(&[]);
    assert!(rows.iter().any(|r| r["tolerance"] == 0.056), "{rows:?}");
    assert!(rows.iter().all(|r| (r["worst"]["sum"].as_f64() > r["tolerance"].as_f64()) != r["over"].as_array().unwrap().is_empty()));
    assert!(report(&["--tolerance=0.08"]).iter().all(|r| r["tolerance"] == 0.08 && r["over"].as_array().unwrap().is_empty()));
}

/// A machine without accuracy data: said, and nothing made up.
#[test]
fn no_data() {
    let o = run(examples(), &["accuracy", "flange.ngc", "-ttools.tbl", "--machine=generic/mill3", "--message-format=short"]);
    insta::assert_snapshot!(whole(&o));
}

#[test]
fn maps() {
    let folder = tempfile::tempdir().unwrap();
    let map = |args: &[&str]| run(folder.path(), &[&["map"], args].concat());
    let thesis = map(&["--machine=usp/2ups-prp", "--reference=usp2009", "--quantity=kinematic-y", "--signs=+-+", "-ok.csv", "-ok.png", "-ok.svg"]);
    insta::assert_snapshot!(whole(&thesis));
    let csv = std::fs::read_to_string(folder.path().join("k.csv")).unwrap();
    assert_eq!(csv.lines().count(), 9189);
    assert!(std::fs::read(folder.path().join("k.png")).unwrap().starts_with(b"\x89PNG"));
    assert!(std::fs::read_to_string(folder.path().join("k.svg")).unwrap().starts_with("<svg"));
    for (height, area) in [(0, "22.85"), (120, "22.85"), (240, "22.37"), (360, "19.76"), (480, "10.98"), (600, "1.15")] {
        let o = map(&["--machine=usp/2ups-prp", "--reference=usp2009", &format!("--plane=z={height}")]);
        assert!(whole(&o).contains(&format!("area {area} dm²")), "{}", whole(&o));
    }
    insta::assert_snapshot!("map_refused", whole(&map(&["--machine=abb/irb2400", "--quantity=kinematic", "--message-format=short"])));
    insta::assert_snapshot!("map_unknown", whole(&map(&["--machine=abb/irb2400", "--quantity=beauty", "--message-format=short"])));
    insta::assert_snapshot!("map_template", whole(&map(&["--machine=comau/tricept806", "--message-format=short"])));
    insta::assert_snapshot!("map_of_an_arm", whole(&map(&["--machine=abb/irb2400", "--quantity=condition", "--plane=z=800", "--resolution=40"])));
    insta::assert_snapshot!("map_sensitivity", whole(&map(&["--machine=usp/2ups-prp", "--quantity=sensitivity", "--resolution=60", "-os.svg"])));
}

/// Mean sensitivities as the thesis defines them, and options that fit no such map.
#[test]
fn sensitivities_of_the_publication_and_what_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let map = |args: &[&str]| run(folder.path(), &[&["map", "--machine=usp/2ups-prp", "--message-format=short"], args].concat());
    insta::assert_snapshot!("map_sensitivity_usp2009", whole(&map(&["--quantity=sensitivity", "--reference=usp2009", "--plane=z=240"])));
    let refused = [
        map(&["--quantity=workspace", "--signs=+++"]),
        map(&["--quantity=kinematic", "--force=1,0,0"]),
        map(&["--quantity=condition", "--it=5"]),
        map(&["--quantity=kinematic", "--reference=usp2009", "--resolution=50"]),
        map(&["--quantity=sensitivity", "--signs=+++"]),
        map(&["--quantity=sensitivity", "--resolution=10", "-obars.pdf"]),
    ];
    insta::assert_snapshot!("map_does_not_fit", refused.iter().map(whole).collect::<Vec<_>>().join("\n"));
}

/// A hole moved or a limit altered changes what comes out: no number is a special case.
#[test]
fn other_limits_give_another_area() {
    let folder = tempfile::tempdir().unwrap();
    let file = "format = 1\nid = \"test/other\"\nextends = \"usp/2ups-prp\"\n[kinematics]\nkind = \"parallel-2ups-prp\"\nspherical_axis = \"base\"\n\
        [[joint]]\nname = \"h1\"\ntype = \"prismatic\"\nmin = 850\nmax = 1295\n[[joint]]\nname = \"h2\"\ntype = \"prismatic\"\nmin = 850\nmax = 1295\n";
    std::fs::write(folder.path().join("other.toml"), file).unwrap();
    // Gojtan 2009, table 5.2 rounds the limit of the legs: 22.97 dm² with its arm of 604 to 1053 mm.
    let o = run(folder.path(), &["map", "--machine=other.toml", "--resolution=600"]);
    let text = whole(&o);
    let area: f64 = text.split("area ").nth(1).and_then(|t| t.split(' ').next()).unwrap().parse().unwrap();
    assert!(area > 22.88 && area < 23.05, "{text}");
}

#[test]
fn places() {
    insta::assert_snapshot!(whole(&run(examples(), &["place", "flange.ngc", "-ttools.tbl", "--machine=usp/2ups-prp"])));
    insta::assert_snapshot!("rectangle", whole(&run(examples(), &["place", "--machine=usp/2ups-prp", "--reference=usp2009", "--heights=-240,240"])));
    insta::assert_snapshot!("no_machine", whole(&run(Path::new(env!("CARGO_MANIFEST_DIR")), &["place", "--message-format=short"])));
}

/// `build --compensate`: a mill's G-code, the parallel machine's joints, an arm's language; what it refuses.
#[test]
fn compensated() {
    let folder = tempfile::tempdir().unwrap();
    let machine = |name: &str, base: &str, rest: &str| {
        let text = format!("format = 1\nid = \"test/{name}\"\nextends = \"{base}\"\n[as_built]\nsource = \"ball bar\"\n{rest}");
        std::fs::write(folder.path().join(format!("{name}.toml")), text).unwrap();
    };
    machine("mill", "generic/mill3", "parameter = [{ name = \"square-xy\", deviation = 0.02 }]\n");
    machine("table", "generic/mill5-ac-table", "parameter = [{ name = \"rotary1.z\", deviation = 0.05 }, { name = \"rotary1.tilt-b\", deviation = 0.01 }]\n");
    machine("legs", "usp/2ups-prp", "parameter = [{ name = \"ls1x\", deviation = 0.05 }, { name = \"lu2y\", deviation = -0.08 }]\n[frames.part]\nposition = [800, 0, 0]\n");
    machine("arm", "abb/irb2400", "parameter = [{ name = \"a2\", deviation = 0.4 }, { name = \"J5.zero\", deviation = 0.05 }]\n[frames.part]\nposition = [900, 0, 600]\n");
    let program = "G21 G90 G94 F600\nG0 X0 Y0 Z5\nG1 Z-2\nG1 X100\nG1 Y100\nG3 X80 Y120 I-20\nG1 X0 Y0\nG0 Z5\nM2\n";
    std::fs::write(folder.path().join("p.ngc"), program).unwrap();
    std::fs::write(folder.path().join("five.ngc"), "G21 G90 G94 F600\nG0 X0 Y0 Z5\nG1 Z-2\nG1 X60 A-30 C45\nG0 Z50 A0 C0\nM2\n").unwrap();
    let build = |args: &[&str]| run(folder.path(), &[&["build", "--compensate", "--message-format=short"], args].concat());
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    insta::assert_snapshot!("compensated_mill", whole(&build(&["p.ngc", "--machine=mill.toml", "-ors274ngc.ngc"])));
    insta::assert_snapshot!("compensated_mill_program", text("rs274ngc.ngc"));
    insta::assert_snapshot!("compensated_five", whole(&build(&["five.ngc", "--machine=table.toml", "-ofive-out.ngc"])) + &text("five-out.ngc"));
    // Of a plan's figures only what is corrected.
    let told = |o: Output| {
        let of = |l: &&str| l.starts_with("exit") || l.contains("corrected") || l.contains("straight pieces");
        whole(&o).lines().filter(of).collect::<Vec<_>>().join("\n")
    };
    insta::assert_snapshot!("compensated_legs", told(build(&["p.ngc", "--machine=legs.toml", "--target=joint-gcode", "-olegs.ngc"])));
    let corrections = text("legs-corrections.csv");
    assert!(corrections.lines().count() > 5 && corrections.starts_with("line,x mm"), "{corrections}");
    insta::assert_snapshot!("compensated_legs_motion", whole(&build(&["p.ngc", "--machine=legs.toml", "--target=rs274ngc", "-olegs2.ngc"])));
    insta::assert_snapshot!("compensated_arm", told(build(&["p.ngc", "--machine=arm.toml", "--target=rapid", "-oarm.mod"])));
    insta::assert_snapshot!("compensated_arm_table", text("arm-corrections.csv").lines().take(6).collect::<Vec<_>>().join("\n"));
    // Tolerances are no deviations; a machine must be named; canonical calls are none of motion; an arm's configuration
    // is not in G-code.
    let refused = [
        build(&["p.ngc", "--machine=generic/mill3", "-ono.ngc"]),
        build(&["p.ngc", "-ono.ngc"]),
        build(&["p.ngc", "--machine=mill.toml", "--target=canon", "-ono.canon"]),
        build(&["p.ngc", "--machine=arm.toml", "--target=rs274ngc", "-ono.ngc"]),
    ];
    insta::assert_snapshot!("compensated_refused", refused.iter().map(whole).collect::<Vec<_>>().join("\n"));
}
