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

/// Machine files with data of accuracy and stiffness for every kind of kinematics: id, more of the file, where the part is, and
/// the program's cut, rotary words too where the machine has them.
const KINDS: [(&str, &str, [f64; 3], &str); 9] = [
    ("usp/2ups-prp", "", [800.0, 0.0, 0.0], "X1"),
    ("abb/irb2400", "", [900.0, 50.0, 600.0], "X1"),
    ("adept/one", "", [500.0, 200.0, 700.0], "X1"),
    ("universal-robots/ur5", "", [400.0, 200.0, 100.0], "X1"),
    ("unimation/puma560", "", [400.0, 200.0, 100.0], "X1"),
    (
        "comau/tricept806",
        "[kinematics]\nkind = \"tricept\"\nbase_radius = 400\nplatform_radius = 150\nwrist_offset = 300\nflange_offset = 200\n",
        [120.0, 60.0, -1700.0],
        "X1",
    ),
    ("generic/mill3", "", [0.0, 0.0, 0.0], "X1"),
    ("generic/mill5-ac-table", "", [0.0, 0.0, 0.0], "X60 A-30 C10"),
    ("generic/mill5-cb-head", "", [0.0, 0.0, 0.0], "X60 B20"),
];

/// A mill with the part beyond its travel: the joint and its limit are told where it first goes there.
#[test]
fn limits_of_a_mill() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), with_data("generic/mill3", "", [0.0; 3])).unwrap();
    std::fs::write(folder.path().join("p.ngc"), "G21 G90 G94 F600\nT1 M6\nG43 H1\nG0 X0 Y0\nG1 X50\nG1 X60\nM2\n").unwrap();
    let at = |part: &str| run(folder.path(), &["accuracy", "p.ngc", "--machine=m.toml", "--message-format=short", part]);
    let far = whole(&at("--part=380,0,-100"));
    assert!(far.contains("p.ngc:5:1: error[E0507]: joint X") && far.matches("E0507").count() == 1 && far.starts_with("exit 1"), "{far}");
    assert!(!whole(&at("--part=300,0,-100")).contains("E0507"));
}

/// A file with an error of 5 µm or 0.01° in every joint, IT7, and springs of 10 kN/mm or 1e9 N·mm/rad.
fn with_data(id: &str, more: &str, [x, y, z]: [f64; 3]) -> String {
    let base = gr_machine::builtin(id).unwrap();
    let turns = |j: &gr_machine::Joint| j.kind == gr_machine::JointKind::Revolute;
    let errors: Vec<&str> = base.joints.iter().map(|j| if turns(j) { "0.01" } else { "0.005" }).collect();
    let springs: String = base
        .joints
        .iter()
        .map(|j| {
            let k = if turns(j) { 1e9 } else { 1e4 };
            format!("[[stiffness.member]]\njoint = \"{}\"\nname = \"drive\"\nstiffness = {k:.1}\n", j.name)
        })
        .collect();
    format!(
        "format = 1\nid = \"test/kind\"\nextends = \"{id}\"\n{more}[frames.part]\nposition = [{x}, {y}, {z}]\n\
         [[tool]]\nnumber = 1\nname = \"mill\"\nposition = [0, 0, 80]\n\
         [accuracy]\nsource = \"made up for this test\"\njoints = [{}]\ngrade = 7\n[stiffness]\nsource = \"made up for this test\"\n{springs}",
        errors.join(", ")
    )
}

fn vector(v: &serde_json::Value) -> [f64; 3] {
    std::array::from_fn(|i| v[i].as_f64().unwrap())
}

/// Every kind of machine gets the report, and each number of it is what differences of the forward solution give, without
/// anything of the models: the tool is where it is said to be, the deflection is that of springs under the force of the
/// formula, and no pattern of signs makes more than the longest error.
#[test]
fn reports_of_every_kind_of_machine() {
    use gr_machine::math::{Frame, add, dot, norm, scale, sub};
    for (id, more, at, cut) in KINDS {
        let folder = tempfile::tempdir().unwrap();
        let mut text = with_data(id, more, at);
        if id.starts_with("comau") {
            // The template has no home: straight above the part.
            let k = gr_machine::parse(gr_text::FileId(0), &text).unwrap().kinematics();
            let above = Frame { position: add(at, [0.0, 0.0, 130.0]), turn: gr_machine::math::rot_x(std::f64::consts::PI) };
            let q = k.inverse_frame(&above).unwrap()[0].joints.clone();
            let shown: Vec<String> = q.iter().enumerate().map(|(i, v)| if i < 3 { v.to_string() } else { v.to_degrees().to_string() }).collect();
            text = format!("{text}[home]\njoints = [{}]\n", shown.join(", "));
        }
        std::fs::write(folder.path().join("m.toml"), &text).unwrap();
        let program = format!("G21 G90 G94 G17 G54\nT1 M6\nS1000 M3\nG0 X0 Y0 Z0\nF100\nG1 {cut}\nM2\n");
        std::fs::write(folder.path().join("p.ngc"), program).unwrap();
        let cutting = ["--material=1045", "--teeth=3", "--depth=1", "--width=6", "--diameter=10", "--format=json"];
        let o = run(folder.path(), &[&["accuracy", "p.ngc", "--machine=m.toml", "--message-format=short"], &cutting[..]].concat());
        let v: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap_or_else(|e| panic!("{id}: {e}\n{}", whole(&o)));
        let worst = &v["operations"][0]["worst"];
        let joints: Vec<f64> = worst["joints"].as_array().unwrap().iter().map(|j| j.as_f64().unwrap()).collect();
        let machine = gr_machine::parse(gr_text::FileId(0), &text).unwrap();
        let (k, tool) = (machine.kinematics(), machine.cell.tool_frame(1));
        let tip = |k: &dyn gr_machine::Kinematics, q: &[f64]| k.forward_frame(q).unwrap().then(&tool);
        let point = vector(&worst["point"]);
        assert!(norm(sub(tip(&*k, &joints).position, point)) < 1e-6, "{id}: {point:?}");
        // The force: against the feed along X, the spindle's axis as it stands.
        let spindle = if machine.is_upright() { tip(&*k, &joints).axis(2) } else { scale(tip(&*k, &joints).axis(2), -1.0) };
        let across = sub([1.0, 0.0, 0.0], scale(spindle, spindle[0]));
        let u = scale(across, 1.0 / norm(across));
        let side = gr_machine::math::cross(spindle, u);
        let (per_turn, angle) = (100.0 / 1000.0, 2.0 / 3.0 * std::f64::consts::FRAC_PI_2);
        let cutting = per_turn * 2110.0 * (per_turn / 3.0f64).powf(-0.17);
        let ahead = add(scale(u, angle.sin()), scale(side, angle.cos()));
        let force = scale(add(scale(ahead, cutting), scale(u, 0.2 * cutting)), -1.0);
        let column = |i: usize| {
            let h = 1e-4;
            let moved = |by: f64| {
                let mut q = joints.clone();
                q[i] += by;
                tip(&*k, &q).position
            };
            scale(sub(moved(h), moved(-h)), 1.0 / (2.0 * h))
        };
        let columns: Vec<[f64; 3]> = (0..joints.len()).map(column).collect();
        let springs = machine.cell.stiffness.as_ref().unwrap();
        let stiffness = |i: usize| springs.joint(i, joints[i]).unwrap();
        let mut deflection = [0.0; 3];
        let mut energy = 0.0;
        for (i, c) in columns.iter().enumerate() {
            let yields = dot(*c, force) / stiffness(i);
            deflection = add(deflection, scale(*c, yields));
            energy += stiffness(i) * yields * yields;
        }
        let said = vector(&worst["elastic"]);
        assert!(norm(sub(said, deflection)) < 1e-4 * norm(deflection), "{id}: {said:?}, not {deflection:?}");
        assert!((dot(said, force) - energy).abs() < 1e-3 * energy && energy > 0.0, "{id}: work {} energy {energy}", dot(said, force));
        // Signs: some patterns of joints, and of the geometry with the machine built so.
        let longest = |of: &str| worst[of]["longest"].as_f64().unwrap();
        let budget = gr_accuracy::Budget::new(&machine, gr_accuracy::BudgetOptions::default());
        let (of_joints, of_geometry) = (budget.joints.unwrap(), budget.geometry.unwrap_or_default());
        let sign = |n: usize, i: usize| if (n * 2654435761 >> (i % 24)) & 1 == 1 { 1.0 } else { -1.0 };
        let mut most = 0.0f64;
        for n in 0..64 {
            let off = columns.iter().zip(&of_joints).enumerate().fold([0.0; 3], |s, (i, (c, e))| add(s, scale(*c, e * sign(n, i))));
            assert!(norm(off) <= longest("kinematic") * 1.0001, "{id}");
            most = most.max(norm(off));
            if of_geometry.is_empty() {
                continue;
            }
            let deviations: Vec<f64> = of_geometry.iter().enumerate().map(|(i, e)| e * sign(n, i)).collect();
            let Ok(f) = machine.deviated(&deviations).forward_frame(&joints) else { continue };
            let off = sub(Frame::then(&f, &tool).position, point);
            assert!(norm(off) <= longest("geometric") * 1.001 + 1e-9, "{id}: {off:?}");
        }
        assert!(most > 0.5 * longest("kinematic"), "{id}: {most}");
        let parts = longest("kinematic") + if of_geometry.is_empty() { 0.0 } else { longest("geometric") } + norm(said);
        assert!((worst["sum"].as_f64().unwrap() - parts).abs() < 1e-12, "{id}");
    }
}

/// Gojtan 2009, section 8.4, as recomputed: deflection at (800, 0, 0) in µm, through the command.
#[test]
fn deflections_of_the_publication() {
    let folder = tempfile::tempdir().unwrap();
    let cut = ["--part=800,0,0", "--material=1045", "--teeth=14", "--depth=0.5", "--width=50", "--diameter=100", "--format=json"];
    for (from, want) in [("X-10 Y0", [-0.620, -1.319]), ("X0 Y-10", [0.291, -2.811])] {
        let program = format!("G21 G90 G94 G17 G54\nT1 M6\nS1591.5494309189532 M3\nF50\nG0 {from} Z0\nG1 X0 Y0\nM2\n");
        std::fs::write(folder.path().join("p.ngc"), program).unwrap();
        let o = run(folder.path(), &[&["accuracy", "p.ngc", "--machine=usp/2ups-prp"], &cut[..]].concat());
        let v: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap();
        let worst = &v["operations"][0]["worst"];
        assert!(vector(&worst["point"]).iter().zip([800.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{worst}");
        let said = vector(&worst["elastic"]);
        assert!((0..2).all(|i| (said[i] * 1e3 - want[i]).abs() < 5e-4), "{from}: {said:?}");
    }
}

/// A drill's thrust, a plunge whose force nobody knows, a spindle that stands still.
#[test]
fn forces_along_the_axis() {
    let folder = tempfile::tempdir().unwrap();
    let program = "G21 G90 G94 G17 G54\nT1 M6\nS1000 M3\nG0 X0 Y0 Z20\nG81 X0 Y0 Z-5 R2 F200\nG80\nT2 M6\nM3\nG0 X10 Y0 Z2\nF100\nG1 Z-2\nG1 X20\nG1 Z2\n\
        T3 M6\nG0 X30 Z2\nG1 Y1\nM3\nG85 X30 Y0 Z-4 R2\nG80\nM2\n";
    std::fs::write(folder.path().join("p.ngc"), program).unwrap();
    let cut = ["--part=800,0,0", "--material=C45E", "--teeth=3", "--depth=1", "--width=6", "--diameter=10"];
    let report = |more: &[&str]| run(folder.path(), &[&["accuracy", "p.ngc", "--machine=usp/2ups-prp", "--message-format=short"], &cut[..], more].concat());
    insta::assert_snapshot!("forces_along_the_axis", whole(&report(&["--point=118"])));
    insta::assert_snapshot!("no_point_angle", whole(&report(&["--format=csv"])));
    // 0.5 · 2220 · (0.1 · sin 59°)^−0.14 · 5 · 0.2 · sin 59° = 1342 N up, on the column's spring.
    let v: serde_json::Value = serde_json::from_slice(&report(&["--point=118", "--format=json"]).stdout).unwrap();
    let elastic = vector(&v["operations"][0]["worst"]["elastic"]);
    let column = gr_machine::builtin("usp/2ups-prp").unwrap().cell.stiffness.unwrap().joint(2, 0.0).unwrap();
    assert!(elastic[2] > 0.0 && elastic[2] < 1342.0 / column * 1.01, "{elastic:?} {column}");
}

/// A spindle that turns the other way has the mirrored force.
#[test]
fn force_of_a_spindle_that_turns_back() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), with_data("generic/mill3", "", [0.0; 3])).unwrap();
    let cut = ["--part=0,0,-100", "--material=1045", "--teeth=14", "--depth=0.5", "--width=50", "--diameter=100", "--format=json"];
    let elastic = |turn: &str| {
        let program = format!("G21 G90 G94 G17 G54\nT1 M6\nS1591.5494309189532 {turn}\nF50\nG0 X-10 Y0\nG1 X0 Y0\nM2\n");
        std::fs::write(folder.path().join("p.ngc"), program).unwrap();
        let o = run(folder.path(), &[&["accuracy", "p.ngc", "--machine=m.toml"], &cut[..]].concat());
        let v: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap();
        vector(&v["operations"][0]["worst"]["elastic"])
    };
    let (forth, back) = (elastic("M3"), elastic("M4"));
    // Gojtan 2009, section 8.3: −99.65 and −46.74 N, on 10 kN/mm.
    assert!((forth[0] + 9.965433e-3).abs() < 1e-8 && (forth[1] + 4.674107e-3).abs() < 1e-8, "{forth:?}");
    assert!((back[0] - forth[0]).abs() < 1e-12 && (back[1] + forth[1]).abs() < 1e-12, "{back:?}");
}

/// A cut by rotary words alone: the errors are looked at, and why there is no deflection is told.
#[test]
fn only_rotary_axes() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), with_data("generic/mill5-ac-table", "", [0.0; 3])).unwrap();
    std::fs::write(folder.path().join("p.ngc"), "G21 G90 G94 F600\nT1 M6\nG43 H1\nS1000 M3\nG0 X20 Y0 Z0\nG1 A-30\nG1 A0\nM5\nM2\n").unwrap();
    let o = run(
        folder.path(),
        &["accuracy", "p.ngc", "--machine=m.toml", "--part=0,0,-300", "--material=1045", "--teeth=2", "--depth=1", "--width=5", "--diameter=10", "--message-format=short"],
    );
    insta::assert_snapshot!(whole(&o));
}

/// Fits of STEP-NC: half of a band is what is left each way; the number of a grade is told at its own line, once.
#[test]
fn fits_of_features() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(examples().join("stepnc/case-study.p21")).unwrap();
    let report = |fit: &str, more: &[&str]| {
        std::fs::write(folder.path().join("part.p21"), text.replace("PLUS_MINUS_VALUE(0.05,0.05,3)", fit)).unwrap();
        run(folder.path(), &[&["accuracy", "part.p21", "--machine=usp/2ups-prp", "--part=700,-60,0", "--message-format=short"], more].concat())
    };
    let v: serde_json::Value = serde_json::from_slice(&report("LIMITS_AND_FITS(0.,0.15,.HOLE.)", &["--format=json"]).stdout).unwrap();
    assert!(v["operations"].as_array().unwrap().iter().any(|o| o["tolerance"] == 0.075), "{v}");
    let told = whole(&report("LIMITS_AND_FITS(0.,7.,.HOLE.)", &[]));
    let lines: Vec<&str> = told.lines().filter(|l| l.contains("LIMITS_AND_FITS")).collect();
    insta::assert_snapshot!(lines.join("\n"));
    assert!(!whole(&report("LIMITS_AND_FITS(0.,7.,.HOLE.)", &["--tolerance=0.1"])).contains("LIMITS_AND_FITS"));
}

/// The patterns of table 7.1 along a program: one movement, no worst pattern.
#[test]
fn known_deviations_along_a_program() {
    let pattern = "--deviations=ls1x=0.0077,ls1y=0.0099,ls2x=0.0077,ls2y=-0.0099,lu1x=-0.0083,lu1y=0.013,lu2x=-0.0083,lu2y=-0.013";
    let o = run(examples(), &["accuracy", "flange.ngc", "-ttools.tbl", "--machine=usp/2ups-prp", "--part=820,-10,-60", "--format=json", pattern]);
    let v: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap();
    let machine = gr_machine::builtin("usp/2ups-prp").unwrap();
    let sizes: std::collections::BTreeMap<&str, f64> =
        pattern["--deviations=".len()..].split(',').map(|p| p.split_once('=').unwrap()).map(|(n, v)| (n, v.parse().unwrap())).collect();
    let deviations: Vec<f64> = machine.parameters().iter().map(|p| sizes.get(p.name.as_str()).copied().unwrap_or(0.0)).collect();
    for row in v["operations"].as_array().unwrap() {
        let worst = &row["worst"];
        let joints: Vec<f64> = worst["joints"].as_array().unwrap().iter().map(|j| j.as_f64().unwrap()).collect();
        let real = machine.deviated(&deviations).forward_frame(&joints).unwrap().position;
        let off = gr_machine::math::norm(gr_machine::math::sub(real, machine.kinematics().forward_frame(&joints).unwrap().position));
        let said = worst["geometric"]["longest"].as_f64().unwrap();
        assert!((said - off).abs() < 1e-5 && said > 0.01, "{said} {off}");
    }
}

/// On a mill rotary words are joints: the place leaves room for what the table carries away, and its error is the report's.
#[test]
fn places_on_a_mill_with_rotary_words() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), with_data("generic/mill5-ac-table", "", [0.0; 3])).unwrap();
    let program = |tilt: &str, rapid: &str| {
        let text = format!("G21 G90 G94 F600\nT1 M6\nG43 H1\nS1000 M3\nG0 {rapid}\nG0 X0 Y0 Z5\nG1 Z-2\nG1 X60 {tilt} C45\nG1 A0 C0\nG1 X0\nG0 Z50\nM5\nM2\n");
        std::fs::write(folder.path().join("p.ngc"), text).unwrap();
    };
    let place = |more: &[&str]| run(folder.path(), &[&["place", "p.ngc", "--machine=m.toml", "--message-format=short"], more].concat());
    program("A-30", "X0");
    let (free, exact) = (whole(&place(&[])), whole(&place(&["--aim=error"])));
    let v: serde_json::Value = serde_json::from_slice(&place(&["--aim=error", "--format=json"]).stdout).unwrap();
    let at: Vec<String> = v["position"].as_array().unwrap().iter().map(|p| p.to_string()).collect();
    let o = run(folder.path(), &["accuracy", "p.ngc", "--machine=m.toml", "--format=json", &format!("--part={}", at.join(","))]);
    let said: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap();
    let sum = said["operations"][0]["worst"]["sum"].as_f64().unwrap();
    assert!((v["error_um"].as_f64().unwrap() - sum * 1e3).abs() < 1e-9, "{v} {sum}");
    // A rotary word beyond its limit is out of reach everywhere; a rapid that is, where the cuts are not, is told at its line.
    program("A-130", "X0");
    let beyond = whole(&place(&[]));
    program("A-30", "X5000");
    insta::assert_snapshot!([free, exact, beyond, whole(&place(&[]))].join("\n"));
}

/// Where a plan is refused the search goes on: an arm's smallest error lies beside its base, where no program can be made.
#[test]
fn smallest_error_of_an_arm() {
    let folder = tempfile::tempdir().unwrap();
    for id in ["universal-robots/ur5", "abb/irb2400"] {
        let file = format!("format = 1\nid = \"test/arm\"\nextends = \"{id}\"\n[accuracy]\nsource = \"made up\"\njoints = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]\n");
        std::fs::write(folder.path().join("arm.toml"), file).unwrap();
        let machine = format!("--machine={}", folder.path().join("arm.toml").display());
        let o = run(examples(), &["place", "flange.ngc", "-ttools.tbl", &machine, "--aim=error", "--format=json", "-q"]);
        let v: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap_or_else(|e| panic!("{id}: {e}\n{}", whole(&o)));
        let at: Vec<String> = v["position"].as_array().unwrap().iter().map(|p| p.to_string()).collect();
        let o = run(examples(), &["accuracy", "flange.ngc", "-ttools.tbl", &machine, &format!("--part={}", at.join(",")), "--format=json"]);
        let said: serde_json::Value = serde_json::from_slice(&o.stdout).unwrap_or_else(|e| panic!("{id}: {e}\n{}", whole(&o)));
        let worst = said["operations"].as_array().unwrap().iter().map(|r| r["worst"]["sum"].as_f64().unwrap()).fold(0.0, f64::max);
        assert!((v["error_um"].as_f64().unwrap() - worst * 1e3).abs() < 1e-9, "{id}: {v} {worst}");
    }
}

/// Nothing is written and no folder is left where one of the files can't be written.
#[test]
fn nothing_is_left_behind() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("file"), "").unwrap();
    let map = |goals: &[&str]| run(folder.path(), &[&["map", "--machine=usp/2ups-prp", "--resolution=10"], goals].concat());
    assert!(!map(&["-onew/deep/x.png", "-ofile/x.csv"]).status.success() && !folder.path().join("new").exists());
    assert!(!map(&["-onew/deep/x.pdf"]).status.success() && !folder.path().join("new").exists());
    assert!(map(&["-onew/deep/x.csv"]).status.success() && folder.path().join("new/deep/x.csv").exists());
}

/// Numbers that no tool has are refused; so is a publication that is not about the machine.
#[test]
fn senseless_options() {
    let folder = examples();
    let all = [
        vec!["--teeth=0"],
        vec!["--teeth=2.5"],
        vec!["--width=nan"],
        vec!["--width=12", "--diameter=10"],
        vec!["--width=60", "--depth=1"],
        vec!["--deviations=ls1x=1,ls1x=2"],
        vec!["--deviations=ls9x=1"],
        vec!["--deviations=ls1x=1e300"],
        vec!["--deviations=ls1x=1", "--it=5"],
        vec!["--depth=-1"],
        vec!["--diameter=0"],
        vec!["--point=5"],
        vec!["--tolerance=-1"],
        vec!["--reference=usp2009", "--it=6"],
    ];
    let mut text: Vec<String> = all.iter().map(|more| whole(&run(folder, &[&PLACED[..6], more, &["--message-format=short"]].concat()))).collect();
    text.push(whole(&run(folder, &["map", "--machine=abb/irb2400", "--reference=usp2009", "--message-format=short"])));
    insta::assert_snapshot!(text.join("\n"));
}

/// What a map lacks is told beside it, and nothing is drawn as exact without a word.
#[test]
fn maps_say_what_they_lack() {
    let folder = tempfile::tempdir().unwrap();
    let arm = "format = 1\nid = \"test/arm\"\nextends = \"abb/irb2400\"\n[accuracy]\nsource = \"made up\"\njoints = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]\n\
        parameter = [{ name = \"c2\", tolerance = 0.05 }]\n";
    std::fs::write(folder.path().join("arm.toml"), arm).unwrap();
    let slide = "format = 1\nid = \"test/tricept\"\nextends = \"comau/tricept806\"\n[kinematics]\nkind = \"tricept\"\nbase_radius = 400\nplatform_radius = 150\n\
        wrist_offset = 300\nflange_offset = 200\n";
    std::fs::write(folder.path().join("tricept.toml"), slide).unwrap();
    let map = |args: &[&str]| {
        let text = whole(&run(folder.path(), &[&["map", "--resolution=12", "--message-format=short", "-q"], args].concat()));
        text.lines().filter(|l| !l.starts_with("outline") && !l.starts_with("least") && !l.starts_with("greatest")).collect::<Vec<_>>().join("\n")
    };
    let all = [
        map(&["--machine=arm.toml", "--quantity=geometric", "--plane=z=800"]),
        map(&["--machine=arm.toml", "--quantity=total", "--plane=z=800", "--force=-100,0,0"]),
        map(&["--machine=usp/2ups-prp", "--quantity=total"]),
        map(&["--machine=usp/2ups-prp", "--quantity=total-rss", "--force=-100,0,0"]),
        map(&["--machine=generic/mill3", "--quantity=geometric", "--it=7"]),
        map(&["--machine=tricept.toml", "--plane=z=-1700"]).lines().filter(|l| l.contains("E0701")).collect(),
        map(&["--machine=adept/one", "--quantity=condition"]),
    ];
    insta::assert_snapshot!(all.join("\n"));
}

/// A limit altered in a file of one's own, by a copy and by `extends`: the model of the publication follows it. The numbers
/// of nodes are those of the reference model with that limit.
#[test]
fn the_publication_with_other_limits() {
    let folder = tempfile::tempdir().unwrap();
    let limits = "[[joint]]\nname = \"h1\"\ntype = \"prismatic\"\nmin = 850\nmax = 1295\n[[joint]]\nname = \"h2\"\ntype = \"prismatic\"\nmin = 850\nmax = 1295\n";
    std::fs::write(folder.path().join("extends.toml"), format!("format = 1\nid = \"test/extends\"\nextends = \"usp/2ups-prp\"\n{limits}")).unwrap();
    let copy = gr_machine::source("usp/2ups-prp").unwrap().replace("1294.1", "1295");
    std::fs::write(folder.path().join("copy.toml"), copy).unwrap();
    for file in ["extends.toml", "copy.toml"] {
        for (plane, nodes) in [("z=0", 9223), ("z=480", 4438)] {
            let o = run(folder.path(), &["map", "--machine", file, "--reference=usp2009", "--plane", plane]);
            assert!(whole(&o).contains(&format!("({nodes} nodes")), "{file} {plane}: {}", whole(&o));
        }
    }
}

/// The two patterns of table 7.1 over the work space: their ranges in the middle plane, µm.
#[test]
fn patterns_of_the_publication() {
    let folder = tempfile::tempdir().unwrap();
    let symmetric = "--deviations=ls1x=0.0077,ls1y=0.0099,ls2x=0.0077,ls2y=-0.0099,lu1x=-0.0083,lu1y=0.013,lu2x=-0.0083,lu2y=-0.013";
    let asymmetric = "--deviations=ls1x=0.0077,ls1y=0.0099,ls2x=-0.0077,ls2y=0.0099,lu1x=-0.0083,lu1y=0.013,lu2x=0.0083,lu2y=0.013";
    for (pattern, quantity, least, greatest) in [
        (symmetric, "geometric-x", -16.75, -5.65),
        (symmetric, "geometric-y", -22.43, 22.43),
        (asymmetric, "geometric-x", -12.18, 12.18),
        (asymmetric, "geometric-y", 27.41, 45.45),
    ] {
        let o = run(folder.path(), &["map", "--machine=usp/2ups-prp", "--reference=usp2009", pattern, "--quantity", quantity]);
        let text = whole(&o);
        let of = |word: &str| -> f64 { text.split(word).nth(1).and_then(|t| t.split(' ').next()).unwrap().parse().unwrap() };
        assert!((of("\nleast ") - least).abs() < 0.006 && (of("\ngreatest ") - greatest).abs() < 0.006, "{quantity}: {text}");
    }
}

/// Places for parts: the middle of a router that is not about zero, an arm.
#[test]
fn rectangles_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let place = |more: &[&str]| whole(&run(folder.path(), &[&["place", "--message-format=short", "--machine"], more].concat()));
    std::fs::write(folder.path().join("empty.ngc"), "M2\n").unwrap();
    let all = [
        place(&["unb/router"]),
        place(&["generic/mill3"]),
        place(&["generic/mill3", "--heights=900,950"]),
        place(&["comau/tricept806"]),
        place(&["generic/mill3", "empty.ngc"]),
    ];
    insta::assert_snapshot!(all.join("\n"));
}

/// A report with its map, as the README has it.
#[test]
fn a_report_with_its_map() {
    let folder = tempfile::tempdir().unwrap();
    let goal = folder.path().join("map.png");
    let o = run(examples(), &[&PLACED[..], &["-q", "--map", goal.to_str().unwrap()]].concat());
    assert!(o.status.success(), "{}", whole(&o));
    assert!(std::fs::read(&goal).unwrap().starts_with(b"\x89PNG"));
}

fn json(o: &Output) -> serde_json::Value {
    serde_json::from_slice(&o.stdout).unwrap_or_else(|e| panic!("{e}\n{}", whole(o)))
}

/// Ways about a place, up to so far.
fn ways(far: f64) -> Vec<[f64; 3]> {
    let share = |n: u32, by: f64| (f64::from(n) * by).fract() * 2.0 - 1.0;
    let all = (1..160u32).map(|n| [share(n, 0.754_877_666), share(n, 0.569_840_290), share(n, 0.362_010_4)]);
    let long = |v: &[f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    all.filter(|v| long(v) > 0.3).map(|v| v.map(|c| c * far / long(&v))).take(24).collect()
}

/// Rotary words of a program turn the tool of an arm: everywhere within the margin the program can be made, tilted once for all
/// and tilted along the way.
#[test]
fn margins_with_turned_tools() {
    let folder = tempfile::tempdir().unwrap();
    let head = "G21 G90 G94 F600\nT1 M6\nG43 H1\nS1000 M3\n";
    let programs = ["G0 X0 Y0 Z0 A-60\nG1 X60\nG1 Y40\nM5\nM2\n", "G0 X0 Y0 Z0\nG1 X60 A-30\nG1 Y20 C40\nG1 A-60\nM5\nM2\n"];
    for program in programs {
        std::fs::write(folder.path().join("p.ngc"), format!("{head}{program}")).unwrap();
        let found = json(&run(folder.path(), &["place", "p.ngc", "--machine=abb/irb2400", "--format=json", "-q"]));
        let margin = found["margin"].as_f64().unwrap();
        assert!(margin > 200.0, "{found}");
        for by in ways(margin - 0.01) {
            let at: Vec<String> = (0..3).map(|i| (found["position"][i].as_f64().unwrap() + by[i]).to_string()).collect();
            let o = run(folder.path(), &["accuracy", "p.ngc", "--machine=abb/irb2400", "-q", "--message-format=short", &format!("--part={}", at.join(","))]);
            assert!(o.status.success(), "{found}\n{}", whole(&o));
        }
    }
}

const SQUARE: &str = "format = 1\nextends = \"generic/mill3\"\nid = \"test/square\"\n[accuracy]\nsource = \"made up\"\njoints = [0.005, 0.005, 0.005]\n\
    [[accuracy.parameter]]\nname = \"square-xy\"\ntolerance = 0.05\n[as_built]\nsource = \"made up\"\n[[as_built.parameter]]\nname = \"square-xy\"\ndeviation = 0.05\n";

/// The part is touched on this very machine: errors of a mill count from there, as compensation does, wherever the part is; so the
/// place of the smallest error is the one with the most room.
#[test]
fn errors_count_from_the_touched_zero() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), SQUARE).unwrap();
    std::fs::write(folder.path().join("p.ngc"), "G21 G90 G94 F600\nT1 M6\nS1000 M3\nG0 X-5 Y0 Z0\nG1 X5\nG1 Y10\nM5\nM2\n").unwrap();
    // 10 mm square to X, turned by 0.05°.
    let own = 10.0 * 0.05f64.to_radians();
    for part in ["0,0,0", "300,200,0", "-300,-200,50"] {
        let v = json(&run(folder.path(), &["accuracy", "p.ngc", "--machine=m.toml", "--format=json", "-q", &format!("--part={part}")]));
        let row = &v["operations"][0];
        assert!((row["worst"]["geometric"]["longest"].as_f64().unwrap() - own).abs() < 1e-9, "{part}: {row}");
        assert!((row["measured"].as_f64().unwrap() - own).abs() < 1e-9, "{part}: {row}");
        assert_eq!(v["geometry_from_zero"], true);
    }
    let o = run(folder.path(), &["build", "p.ngc", "--machine=m.toml", "--compensate", "-oq.ngc"]);
    assert!(whole(&o).contains("by up to 8.7 µm"), "{}", whole(&o));
    let place = |aim: &str| json(&run(folder.path(), &["place", "p.ngc", "--machine=m.toml", "--format=json", "-q", aim]));
    let (free, exact) = (place("--aim=margin"), place("--aim=error"));
    assert!((exact["margin"].as_f64().unwrap() - free["margin"].as_f64().unwrap()).abs() < 1.0, "{free} {exact}");
    assert!((exact["error_um"].as_f64().unwrap() - free["error_um"].as_f64().unwrap()).abs() < 1e-3, "{free} {exact}");
}

/// A coordinate that the program has not named yet says nothing of where the part must be.
#[test]
fn coordinates_not_named_yet() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.ngc"), "G21 G90 G94 F600\nT1 M6\nS1000 M3\nG0 Z20\nG0 X500 Y0\nG1 X510\nG0 Z20\nM5\nM2\n").unwrap();
    let v = json(&run(folder.path(), &["place", "p.ngc", "--machine=generic/mill3", "--format=json", "-q"]));
    assert_eq!(v["position"][0], -505.0, "{v}");
}

fn springs() -> String {
    let one = |j: &str| format!("[[stiffness.member]]\njoint = \"{j}\"\nname = \"drive\"\nstiffness = 10000\n");
    format!("format = 1\nextends = \"generic/mill3\"\nid = \"test/springs\"\n[stiffness]\nsource = \"made up\"\n{}{}{}", one("X"), one("Y"), one("Z"))
}

/// The start of a cut is a place of it, and a short cut at another feed is another cut.
#[test]
fn starts_and_short_cuts() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), springs()).unwrap();
    let head = "G21 G90 G94 F600\nT1 M6\nS1000 M3\n";
    let sum = |text: &str, args: &[&str]| {
        std::fs::write(folder.path().join("p.ngc"), format!("{head}{text}M5\nM2\n")).unwrap();
        let v = json(&run(folder.path(), &[&["accuracy", "p.ngc", "--format=json", "-q"], args].concat()));
        (v["operations"][0]["worst"]["sum"].as_f64().unwrap(), v["operations"][0]["worst"]["line"].as_u64().unwrap())
    };
    let legs = ["--machine=usp/2ups-prp", "--part=800,0,0"];
    let there = sum("G0 X0 Y0 Z0\nG1 X240\nG1 X0\n", &legs);
    let back = sum("G0 X240 Y0 Z0\nG1 X231\nG1 X0\n", &legs);
    assert!((there.0 - back.0).abs() < 1e-12 && there.0 > 0.0695, "{there:?} {back:?}");
    let mill = ["--machine=m.toml", "--material=1045", "--teeth=4", "--depth=0.5", "--width=2", "--diameter=10"];
    let slow = sum("G0 X0 Y0 Z0\nG1 X20 F6\n", &mill);
    let fast = sum("G0 X0 Y0 Z0\nG1 X20 F6\nG1 X20.9 F6000\nG1 X20 F6\n", &mill);
    let long = sum("G0 X0 Y0 Z0\nG1 X20 F6\nG1 X26 F6000\nG1 X20 F6\n", &mill);
    assert!((fast.0 - long.0).abs() < 1e-9 && fast.0 > 50.0 * slow.0 && fast.1 == 6, "{slow:?} {fast:?} {long:?}");
    // Round a small hole the force turns with the feed: as on a large one.
    let elastic = |radius: f64| sum(&format!("G0 X{radius} Y0 Z0\nG3 X{radius} Y0 I-{radius}\n"), &mill).0;
    assert!((elastic(3.0) / elastic(300.0) - 1.0).abs() < 2e-3, "{} {}", elastic(3.0), elastic(300.0));
}

/// Threads have their row and no law; a drill has one along its axis only; a rotary word needs an axis; a width that the file does
/// not say is asked for; a tool without a length is told by `place` too; an option that does nothing is refused; what is too long is
/// told.
#[test]
fn what_is_told() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), springs()).unwrap();
    let head = "G21 G90 G94 F600\nT1 M6\nS1000 M3\nG0 X-5 Y0 Z0\n";
    let told = |text: &str, args: &[&str]| {
        std::fs::write(folder.path().join("p.ngc"), format!("{head}{text}M5\nM2\n")).unwrap();
        whole(&run(folder.path(), &[args, &["-q"]].concat()))
    };
    let short = ["accuracy", "p.ngc", "--machine=m.toml", "--material=1045", "--point=118", "--diameter=10", "--message-format=short"];
    let step = std::fs::read_to_string(examples().join("stepnc/case-study.p21")).unwrap();
    let line = step.lines().find(|l| l.starts_with("#39=") || l.starts_with("#39 =")).unwrap();
    let comma = line.match_indices(',').map(|(i, _)| i).collect::<Vec<_>>();
    assert!(line.contains(",2.,3.6,"), "{line} {comma:?}");
    std::fs::write(folder.path().join("part.p21"), step.replace(line, &line.replace(",2.,3.6,", ",2.,$,"))).unwrap();
    let part = ["accuracy", "part.p21", "--machine=usp/2ups-prp", "--part=700,-100,0", "--teeth=2", "--point=118", "--material=1045", "-q"];
    let without = whole(&run(folder.path(), &[&part[..], &["--message-format=short"]].concat()));
    let elastic = |width: &str| {
        let v = json(&run(folder.path(), &[&part[..], &["--format=json", width]].concat()));
        let all = v["operations"].as_array().unwrap().clone();
        all.iter().find(|o| o["operation"].as_str().unwrap().contains("slot A")).unwrap()["most"][2].as_f64().unwrap()
    };
    assert!(elastic("--width=1") != elastic("--width=3"), "{} {}", elastic("--width=1"), elastic("--width=3"));
    let all = [
        told("G33.1 Z-10 K1\nG0 X50\n", &short),
        told("G33 Z-10 K1\nG0 X50\n", &short),
        told("G18\nG81 X5 Z5 Y-10 R2 F250\nG80\nG17\n", &short),
        told("G1 X60 A-30\n", &short),
        told("G1 X60 A-30\n", &["place", "p.ngc", "--machine=generic/mill3"]),
        told("G1 X2000\n", &["place", "p.ngc", "--machine=generic/mill3"]),
        told("G1 X2000\n", &["place", "p.ngc", "--machine=usp/2ups-prp"]),
        without.lines().filter(|l| l.contains("width")).collect(),
        whole(&run(folder.path(), &["place", "--machine=usp/2ups-prp", "--aim=error", "--message-format=short"])),
    ];
    insta::assert_snapshot!(all.join("\n"));
}

/// What is wrong is told down the program.
#[test]
fn warnings_down_the_program() {
    let o = run(examples(), &[&PLACED[..], &["--depth=1", "--width=6", "--tolerance=0.06", "--message-format=short", "--point=118"]].concat());
    let text = String::from_utf8(o.stderr).unwrap();
    let lines: Vec<u32> = text.lines().filter(|l| l.contains("E0700")).map(|l| l.split(':').nth(1).unwrap().parse().unwrap()).collect();
    assert!(lines.len() > 3 && lines.is_sorted(), "{lines:?}");
}

/// How the tool is held in a map is said, and can be chosen: a planar arm's reach at another turn, a mill of five axes that is
/// singular only while its tool is upright. Zeros of mills can be chosen too.
#[test]
fn how_the_tool_is_held() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), SQUARE).unwrap();
    let map = |args: &[&str]| {
        let text = whole(&run(folder.path(), &[&["map", "--resolution=40", "--message-format=short", "-q"], args].concat()));
        text.lines().filter(|l| !l.starts_with("outline")).collect::<Vec<_>>().join("\n")
    };
    let square = ["--machine=m.toml", "--quantity=geometric"];
    let all = [
        map(&["--machine=ufmg/plano-3r", "-or.csv"]),
        map(&["--machine=ufmg/plano-3r", "--tool-turn=0,0,90"]),
        map(&["--machine=universal-robots/ur5", "--plane=z=300", "--tool-turn=0,30,0"]),
        map(&["--machine=generic/mill5-b-head-c-table", "--quantity=condition", "-oc.png"]),
        map(&["--machine=generic/mill5-b-head-c-table", "--quantity=singularity"]),
        map(&["--machine=generic/mill5-b-head-c-table", "--quantity=condition", "--tool-turn=0,30,0"]),
        map(&["--machine=usp/2ups-prp", "--plane=z=670"]),
        map(&["--machine=usp/2ups-prp", "--plane=x=550"]),
        map(&square),
        map(&[&square[..], &["--zero=100,50,0"]].concat()),
        map(&["--machine=usp/2ups-prp", "--zero=1,2,3"]),
        map(&["--machine=generic/mill3", "--tool-turn=0,30,0"]),
        map(&["--machine=abb/irb2400", "--tool-turn=0,30"]),
        whole(&run(folder.path(), &["place", "--machine=abb/irb2400", "--heights=600,700", "--tool-turn=0,30,0"])),
        whole(&run(folder.path(), &["place", "--machine=usp/2ups-prp", "--heights=660", "--message-format=short"])),
    ];
    insta::assert_snapshot!(all.join("\n\n"));
    assert!(std::fs::read_to_string(folder.path().join("r.csv")).unwrap().starts_with("x mm,y mm,\"workspace (the flange turned as at the start"));
}

/// A mill that the file places the part on has an end of its travel.
#[test]
fn travel_of_a_mill() {
    let folder = tempfile::tempdir().unwrap();
    let accuracy = "[accuracy]\nsource = \"x\"\njoints = [0.005, 0.005, 0.005]\n";
    let program = "G21 G90 G94 G17 G54 F600\nT1 M6\nG43 H1\nS1000 M3\nG0 X0 Y0 Z0\nG1 X200\nM5\nM2\n";
    std::fs::write(folder.path().join("p.ngc"), program).unwrap();
    for (frames, refused) in [("", false), ("[frames.part]\nposition = [300, 0, 0]\n", true), ("[frames.part]\nposition = [100, 0, 0]\n", false)] {
        let text = format!("format = 1\nextends = \"generic/mill3\"\nid = \"test/m\"\n{frames}{accuracy}");
        std::fs::write(folder.path().join("m.toml"), text).unwrap();
        let o = run(folder.path(), &["accuracy", "p.ngc", "--machine=m.toml", "--message-format=short"]);
        assert_eq!((!o.status.success(), whole(&o).contains("p.ngc:6:1: error[E0507]")), (refused, refused), "{frames}{}", whole(&o));
    }
}

/// A Tricept's lever is that of its wrist. 18.4 at X -300 Y 200 Z -1500 comes from a Jacobian worked out by hand: legs in
/// closed form, tool point and lean of the tool, 200 mm from the wrist to the flange.
#[test]
fn condition_of_a_tricept() {
    let folder = tempfile::tempdir().unwrap();
    let legs: String = (1..=3).map(|n| format!("[[joint]]\nname = \"leg {n}\"\ntype = \"prismatic\"\nmin = 900\nmax = 1800\n")).collect();
    let shape = "[kinematics]\nkind = \"tricept\"\nbase_radius = 500\nplatform_radius = 225\nwrist_offset = 300\nflange_offset = 200\n";
    let text = format!("format = 1\nid = \"test/tricept\"\nextends = \"comau/tricept806\"\n{shape}{legs}");
    std::fs::write(folder.path().join("t.toml"), text).unwrap();
    let o = run(folder.path(), &["map", "--machine=t.toml", "--quantity=condition", "--plane=z=-1500", "--resolution=200", "-oc.csv", "-q"]);
    assert!(o.status.success(), "{}", whole(&o));
    let csv = std::fs::read_to_string(folder.path().join("c.csv")).unwrap();
    let rows = csv.lines().skip(1).map(|l| l.split(',').map(|v| v.parse().unwrap_or(f64::NAN)).collect::<Vec<f64>>());
    let nearest = rows.min_by(|a, b| {
        let d = |v: &[f64]| (v[0] + 300.0).hypot(v[1] - 200.0);
        d(a).total_cmp(&d(b))
    });
    let value = nearest.expect("places")[2];
    assert!((value / 18.4 - 1.0).abs() < 0.1, "{value}");
}

/// The condition of an arm by its own Jacobian, lengths in units of the longest lever: all three links in a row, 300 mm.
#[test]
fn condition_in_units_of_the_longest_lever() {
    let folder = tempfile::tempdir().unwrap();
    let o = run(folder.path(), &["map", "--machine=ufmg/plano-3r", "--quantity=condition", "--resolution=20", "-oc.csv", "-q"]);
    assert!(o.status.success(), "{}", whole(&o));
    let csv = std::fs::read_to_string(folder.path().join("c.csv")).unwrap();
    let machine = gr_machine::builtin("ufmg/plano-3r").unwrap();
    let start = machine.start.frame().turn;
    let mut looked = 0;
    for line in csv.lines().skip(1) {
        let v: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let frame = gr_machine::math::Frame { position: [v[0], v[1], 0.0], turn: start };
        let fits = machine.kinematics().inverse_frame(&frame).unwrap().into_iter().filter(|s| machine.outside(&s.joints).is_empty());
        // Both elbows have the same condition up to a mirror: any of them.
        let close = fits.into_iter().any(|s| {
            let mut at = [0.0; 3];
            let mut heading = 0.0;
            let mut joints = [[0.0; 2]; 3];
            for (k, q) in s.joints.iter().enumerate() {
                joints[k] = [at[0], at[1]];
                heading += q;
                at = [at[0] + 100.0 * heading.cos(), at[1] + 100.0 * heading.sin(), 0.0];
            }
            // Columns (−dy, dx) / 300 and 1.
            let columns: Vec<[f64; 3]> = joints.iter().map(|j| [-(at[1] - j[1]) / 300.0, (at[0] - j[0]) / 300.0, 1.0]).collect();
            let square: Vec<Vec<f64>> = (0..3).map(|i| (0..3).map(|k| columns.iter().map(|c| c[i] * c[k]).sum()).collect()).collect();
            let values = gr_machine::math::eigenvalues(square);
            let (least, most) = values.iter().fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(*v), b.max(*v)));
            ((most / least).sqrt() / v[2] - 1.0).abs() < 1e-4
        });
        assert!(close, "{line}");
        looked += 1;
    }
    assert!(looked > 50, "{looked}");
}

/// The validity of the force law is told where the number of the row comes from, with the other lines that leave it; what a STEP-NC
/// file doesn't say, or says of a material that is in no table, is told at the instance that would.
#[test]
fn told_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let head = "G21 G90 G94\nT1 M6\nG43 H1\nS1000 M3\nF6\n";
    let cut = ["--part=700,0,0", "--machine=usp/2ups-prp", "--material=1045", "--teeth=4", "--depth=0.5", "--width=2", "--diameter=10", "-q"];
    let told = |text: &str| {
        std::fs::write(folder.path().join("p.ngc"), format!("{head}{text}M5\nM2\n")).unwrap();
        let text = whole(&run(folder.path(), &[&["accuracy", "p.ngc"], &cut[..]].concat()));
        let err = text.split("--- err\n").nth(1).unwrap();
        let all: Vec<&str> = err.split("\n\n").filter(|d| d.contains("E0703")).collect();
        assert_eq!(all.len(), 1, "{text}");
        all[0].trim().to_string()
    };
    let step = std::fs::read_to_string(examples().join("stepnc/case-study.p21")).unwrap();
    let report = |text: &str, args: &[&str]| {
        std::fs::write(folder.path().join("part.p21"), text).unwrap();
        let o = run(folder.path(), &[&["accuracy", "part.p21", "--machine=usp/2ups-prp", "--part=700,-100,0", "--tolerance=1", "--message-format=short", "-q"], args].concat());
        whole(&o).split("--- err\n").nth(1).unwrap().to_string()
    };
    let line = step.lines().find(|l| l.starts_with("#7=")).unwrap();
    let nameless = step.replace(line, "#7=MATERIAL($,$,());");
    let all = [
        // The row is of the fast line, the slow ones are named; then the row is within the law and a slow line is not.
        told("G0 X0 Y0 Z0\nG1 X20\nG1 X20.9 F60000\nG1 X20 F6\n"),
        told("G0 X0 Y0 Z0\nG1 X20 F600\nG1 X21 F6\n"),
        report(&step, &[]),
        report(&nameless, &[]),
        report(&nameless, &["--material=1045"]),
    ];
    insta::assert_snapshot!(all.join("\n---\n"));
}

/// Places of the machine (G53, G28, G30) stay where they are when the part goes elsewhere, and what no word has named yet stays where
/// the machine stood: `place`, a build for joints and `accuracy` agree.
#[test]
fn places_of_the_machine() {
    let folder = tempfile::tempdir().unwrap();
    let file = "format = 1\nid = \"test/m\"\nextends = \"generic/mill3\"\n[frames.part]\nposition = [300, 200, -100]\n";
    std::fs::write(folder.path().join("m.toml"), file).unwrap();
    std::fs::write(folder.path().join("t.tbl"), "T1 P1 Z50 D10\n").unwrap();
    let program = |text: &str| std::fs::write(folder.path().join("p.ngc"), format!("G21 G90 G94 F600\nS1000 M3\n{text}M5\nM2\n")).unwrap();
    let place = |text: &str| {
        program(text);
        let v = json(&run(folder.path(), &["place", "p.ngc", "--machine=generic/mill3", "--format=json", "-q"]));
        let at: Vec<f64> = v["position"].as_array().unwrap().iter().map(|p| p.as_f64().unwrap()).collect();
        (at, v["margin"].as_f64().unwrap())
    };
    let plain = place("G0 X0 Y0 Z0\nG1 X10\n");
    assert_eq!((&plain.0[..], plain.1), (&[-5.0, 0.0, -75.0][..], 224.9), "{plain:?}");
    for machine in ["G53 G0 Z140\n", "G53 G0 Z-290\n", "G53 G0 X390 Y-240\n", "G28\n", "G91 G28 Z0\nG90\n", "G53 G0 Z140\nG91 G0 Z-5\nG90\n"] {
        assert_eq!(place(&format!("G0 X0 Y0 Z0\nG1 X10\n{machine}")), plain, "{machine}");
        // In front it is the same.
        assert_eq!(place(&format!("{machine}G0 X0 Y0\nZ0\nG1 X10\n")), plain, "{machine}");
    }
    program("G0 X0 Y0 Z0\nG1 X10\nG53 G0 Z200\n");
    let o = whole(&run(folder.path(), &["place", "p.ngc", "--machine=generic/mill3", "-q", "--message-format=short"]));
    assert!(o.contains("p.ngc:5:1: error[E0507]") && o.contains("200 mm"), "{o}");
    let joints = |text: &str| {
        program(text);
        let o = run(folder.path(), &["build", "p.ngc", "--machine=m.toml", "-tt.tbl", "--target=joint-gcode", "-oj.ngc", "--message-format=short"]);
        let text = std::fs::read_to_string(folder.path().join("j.ngc")).unwrap_or_default();
        let moves: Vec<&str> = text.lines().filter(|l| l.starts_with("G0") || l.starts_with("G1")).map(|l| l.split(" F").next().unwrap()).collect();
        format!("{}{}\n", whole(&o).split("--- err\n").nth(1).unwrap().lines().filter(|l| l.contains("p.ngc")).map(|l| format!("{l}\n")).collect::<String>(), moves.join("\n"))
    };
    let all = [
        joints("T1 M6\nG43 H1\nG0 Z5\nG0 X10 Y0\nG1 Z-2\nG1 X20\nG53 G0 Z0\nG53 G0 X0 Y0\n"),
        joints("G0 X0 Y0\nZ5\nG1 Z-2\nG1 X20\nG91 G28 Z0\nG28\n"),
        joints("G53 G0 Z100\nG81 X0 Y0 Z-5 R2\nX10\nG80\nG53 G0 Z100\n"),
        // Nobody names Y: it stays.
        joints("G0 X10\nZ1\nG1 Z-1\nG1 X20\n"),
    ];
    insta::assert_snapshot!(all.join("\n"));
}

/// A box is as large as it is; frames have names; sensitivities say what must be known to read them; a quantity tells only what it has
/// a part of.
#[test]
fn labels_and_boxes() {
    let folder = tempfile::tempdir().unwrap();
    let map = |args: &[&str]| run(folder.path(), &[&["map"], args, &["-q", "--message-format=short"]].concat());
    for (id, volume) in [("generic/mill5-cb-head", "288.0"), ("generic/mill3", "180.0")] {
        let o = whole(&map(&[&format!("--machine={id}"), "--resolution=8"]));
        assert!(o.contains(&format!("volume {volume} dm³")), "{o}");
    }
    let joints = ["X", "Y", "Z", "B", "C"].map(|j| format!("[[stiffness.member]]\njoint = \"{j}\"\nname = \"drive\"\nstiffness = 100000\n")).concat();
    let file = format!("format = 1\nid = \"test/m5\"\nextends = \"generic/mill5-b-head-c-table\"\n[accuracy]\nsource = \"made up\"\njoints = [0.005, 0.006, 0.007, 0.01, 0.02]\ngrade = 7\n[stiffness]\nsource = \"made up\"\n{joints}");
    std::fs::write(folder.path().join("m5.toml"), file).unwrap();
    std::fs::write(folder.path().join("p.ngc"), "G21 G90 G94 F600\nT1 M6\nS1000 M3\nG0 X0 Y0 Z0\nG1 X60 C138\nM5\nM2\n").unwrap();
    let report = run(folder.path(), &["accuracy", "p.ngc", "--machine=m5.toml", "--format=json", "-q"]);
    assert_eq!(json(&report)["frame"], "in the part's frame on the turned table");
    let all = [
        whole(&map(&["--machine=m5.toml", "--quantity=kinematic", "--resolution=8"])),
        whole(&map(&["--machine=m5.toml", "--quantity=geometric", "--resolution=8"])),
        whole(&map(&["--machine=m5.toml", "--quantity=elastic-x", "--force=100,0,0", "--tool-turn=0,30,90", "--plane=z=-100", "--resolution=20"])),
        whole(&map(&["--machine=m5.toml", "--quantity=sensitivity", "--resolution=8", "-os.csv", "-os.svg", "-os.png"])),
        std::fs::read_to_string(folder.path().join("s.csv")).unwrap(),
        whole(&run(folder.path(), &["accuracy", "p.ngc", "--machine=m5.toml", "-q", "--message-format=short"])),
        whole(&run(folder.path(), &["place", "p.ngc", "--machine=m5.toml", "-q", "--message-format=short"])),
    ];
    insta::assert_snapshot!(all.join("\n"));
    let svg = std::fs::read_to_string(folder.path().join("s.svg")).unwrap();
    assert!(svg.contains("nose upright") && svg.contains("turned table") && svg.contains("rotary1.tilt-a (mrad)"), "{svg}");
}

/// The least error of a path along which an arm's tool turns is next to what can be planned; the text says how fine it
/// was looked at. Of 439 random places the best has 302.8 µm.
#[test]
fn least_error_with_a_turning_tool() {
    let folder = tempfile::tempdir().unwrap();
    let file = "format = 1\nid = \"test/irb\"\nextends = \"abb/irb2400\"\n[accuracy]\nsource = \"made up\"\njoints = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]\ngrade = 7\n";
    std::fs::write(folder.path().join("irb.toml"), file).unwrap();
    std::fs::write(folder.path().join("one.tbl"), "T1 P1 Z60 D10\n").unwrap();
    let program = "G21 G90 G94 F600\nT1 M6\nG43 H1\nS1000 M3\nG0 X0 Y0 Z0\nG1 X30 Y10\nG1 X60 B20 C40\nG1 Y20 Z-5 B-30 C180\nG1 X-30 Y5 C90 B0\nM5\nM2\n";
    std::fs::write(folder.path().join("p.ngc"), program).unwrap();
    let o = whole(&run(folder.path(), &["place", "p.ngc", "--machine=irb.toml", "-tone.tbl", "--aim=error", "-q"]));
    assert!(o.contains("from its 12 best places"), "{o}");
    let error: f64 = o.split("largest error of the path there: ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(error < 310.0, "{o}");
}

/// The row of the largest error, and the value of the map beside the report at the node nearest to its place.
fn row_and_map(folder: &Path, args: &[&str]) -> (f64, f64, String) {
    let o = run(folder, &[&["accuracy"], args, &["--format=json", "-q", "--map=beside.csv"]].concat());
    assert!(o.status.success(), "{}", whole(&o));
    let v = json(&o);
    let rows = v["operations"].as_array().unwrap();
    let sum = |r: &&serde_json::Value| r["worst"]["sum"].as_f64().unwrap();
    let worst = rows.iter().max_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap();
    let at = vector(&worst["worst"]["point"]);
    let csv = std::fs::read_to_string(folder.join("beside.csv")).unwrap();
    let mut nearest = (f64::INFINITY, f64::NAN);
    for line in csv.lines().skip(1) {
        let n: Vec<f64> = line.split(',').map(|t| t.parse().unwrap()).collect();
        let far = (n[0] - at[0]).hypot(n[1] - at[1]);
        if far < nearest.0 {
            nearest = (far, n[2]);
        }
    }
    assert!(nearest.0 < 6.0, "{nearest:?} from {at:?}");
    (sum(&worst) * 1e3, nearest.1, csv.lines().next().unwrap().to_string())
}

/// The map beside a report has the tool of the report, as it stands at the largest error: on arms with a spindle that leans, on
/// mills, on a turned table, on a parallel machine.
#[test]
fn table_and_map_agree() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let cell = std::fs::read_to_string(examples().join("irb2400-cell.toml")).unwrap();
    write("cell.toml", &format!("{cell}\n[accuracy]\nsource = \"made up\"\njoints = [0.01, 0.01, 0.01, 0.02, 0.02, 0.03]\ngrade = 7\n"));
    write("arm.ngc", "G21 G90 G94 F600\nT1 M6\nG43 H1\nS5000 M3\nG0 X0 Y0 Z10\nG1 Z-2\nG1 X100 Y40\nM5\nM2\n");
    let data = "[accuracy]\nsource = \"made up\"\njoints = [0.012, 0.012, 0.012]\n";
    let square = "[[accuracy.parameter]]\nname = \"square-xz\"\ntolerance = 0.02\n";
    write("mill.toml", &format!("format = 1\nextends = \"generic/mill3\"\nid = \"test/mill\"\n{data}{square}"));
    write("long.tbl", "T1 P1 Z80 D10\n");
    write("mill.ngc", "G21 G90 G94 F600\nT1 M6\nG43 H1\nS5000 M3\nG0 X0 Y0 Z10\nG1 Z-2\nG1 X50.8\nM5\nM2\n");
    let data = "[accuracy]\nsource = \"made up\"\njoints = [0.005, 0.005, 0.005, 0.004, 0.004]\ngrade = 6\n";
    write("five.toml", &format!("format = 1\nextends = \"generic/mill5-b-head-c-table\"\nid = \"test/five\"\n{data}"));
    write("five.ngc", "G21 G90 G94 F600\nT1 M6\nG43 H1\nS5000 M3\nG0 X0 Y0 Z50 B0 C40\nG1 X20 Y90\nG1 X60 B20\nM5\nM2\n");
    let flange = std::fs::read_to_string(examples().join("flange.ngc")).unwrap();
    write("flange.ngc", &flange);
    write("600.tbl", "T1 P1 Z600 D10\nT2 P2 Z600 D6.8\nT3 P3 Z600 D8\n");
    let all = [
        row_and_map(folder.path(), &["arm.ngc", "--machine=cell.toml"]),
        row_and_map(folder.path(), &["mill.ngc", "-tlong.tbl", "--machine=mill.toml", "--part=0,0,-350"]),
        row_and_map(folder.path(), &["five.ngc", "-tlong.tbl", "--machine=five.toml", "--part=0,0,-350"]),
        row_and_map(folder.path(), &["flange.ngc", "-t600.tbl", "--machine=usp/2ups-prp", "--part=820,-10,-600"]),
    ];
    for (row, map, head) in &all {
        assert!((row - map).abs() < 0.01 * row, "{row} {map} {head}");
    }
    insta::assert_snapshot!(all.map(|a| a.2).join("\n"));
}

/// A map of an arm with a spindle is of the spindle's nose or of a tool of its file, never of the bare flange, and says which; the lean
/// is told where the tool can't be put straight.
#[test]
fn maps_with_tools() {
    let folder = tempfile::tempdir().unwrap();
    let cell = std::fs::read_to_string(examples().join("irb2400-cell.toml")).unwrap();
    std::fs::write(folder.path().join("cell.toml"), format!("{cell}\n[accuracy]\nsource = \"made up\"\njoints = [0.01, 0.01, 0.01, 0.02, 0.02, 0.03]\n")).unwrap();
    let scara = "format = 1\nextends = \"adept/one\"\nid = \"test/scara\"\n[spindle]\nposition = [0, 0, 50]\nrotation = [0, 30, 0]\n";
    std::fs::write(folder.path().join("scara.toml"), scara).unwrap();
    let map = |args: &[&str]| {
        let text = whole(&run(folder.path(), &[&["map", "--resolution=40", "--message-format=short", "-q"], args].concat()));
        text.lines().filter(|l| !l.starts_with("outline")).collect::<Vec<_>>().join("\n")
    };
    let arm = ["--machine=cell.toml", "--quantity=kinematic", "--plane=z=442"];
    let all = [
        map(&[&arm[..], &["-oa.csv", "-oa.svg"]].concat()),
        map(&[&arm[..], &["--tool=1"]].concat()),
        map(&[&arm[..], &["--tool=1", "--tool-turn=0,30,0"]].concat()),
        map(&[&arm[..], &["--tool=7"]].concat()),
        map(&[&arm[..], &["--tool-length=20000"]].concat()),
        map(&["--machine=scara.toml", "--plane=z=300"]),
        map(&["--machine=generic/mill3", "--tool-length=80", "--plane=z=-352"]),
        map(&["--machine=generic/mill3", "--plane=z=-352"]),
        whole(&run(folder.path(), &["place", "--machine=cell.toml", "--heights=442", "--tool=2"])),
        whole(&run(folder.path(), &["place", "--machine=generic/mill3", "--heights=-352", "--tool-length=80"])),
    ];
    insta::assert_snapshot!(all.join("\n\n"));
    assert!(std::fs::read_to_string(folder.path().join("a.svg")).unwrap().contains("the spindle's nose straight down"));
}

const LATHE: &str = r#"
format = 1
id = "test/lathe"
title = "Lathe"
kind = "lathe"
source = "made up"

[kinematics]
kind = "cartesian"

[start]
joints = [100, 0, 100]

[[joint]]
name = "X"
type = "prismatic"
min = -5
max = 200

[[joint]]
name = "Y"
type = "prismatic"
min = -1
max = 1

[[joint]]
name = "Z"
type = "prismatic"
min = -400
max = 400

[accuracy]
source = "made up"
joints = [0.03, 0, 0.008]

[stiffness]
source = "made up"
member = [
  { joint = "X", name = "screw", stiffness = 20000 },
  { joint = "Y", name = "guide", stiffness = 30000 },
  { joint = "Z", name = "screw", stiffness = 40000 },
]
"#;

/// There is no law of turning here: no force of milling instead, from G-code and from STEP-NC, and no number of a mill is asked for. Half
/// the tolerance of a turned diameter is what the tool may be off.
#[test]
fn turning_has_no_law() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("lathe.toml", LATHE);
    write("lathe.tbl", "T1 P1 Z10 D0.8 I85 J5 Q2\n");
    write("turn.ngc", "G21 G90 G18 G7 G95\nT1 M6 G43 H1\nS1000 M3\nG0 X50 Z5\nG0 X40\nG1 Z-30 F0.2\nG1 X50\nG0 Z5\nM5\nM2\n");
    write("turn.nc", "G21 G18 G99\nT0101\nG97 S1000 M3\nG0 X50. Z5.\nG0 X40.\nG1 Z-30. F0.2\nX50.\nG0 Z5.\nM5\nM30\n");
    write("shaft.p21", include_str!("fixtures/turned-shaft.p21"));
    let cut = ["--machine=lathe.toml", "--material=1045", "--depth=2", "--width=0.8", "--teeth=1", "--message-format=short", "-q"];
    let short = ["--machine=lathe.toml", "--message-format=short", "-q"];
    let report = |args: &[&str], more: &[&str]| run(folder.path(), &[&["accuracy"], args, more].concat());
    let all = [
        whole(&report(&["turn.ngc", "-tlathe.tbl"], &cut)),
        whole(&report(&["turn.ngc", "-tlathe.tbl"], &short)),
        whole(&report(&["turn.nc", "--dialect=fanuc-turn"], &cut)),
        whole(&report(&["shaft.p21"], &[&cut[..], &["--diameter=3"]].concat())),
    ];
    assert!(all.iter().all(|text| text.contains("not of turning") && !text.contains("--teeth`")), "{}", all.join("\n"));
    let v = json(&report(&["shaft.p21"], &[&cut[..], &["--diameter=3", "--format=json"]].concat()));
    let row = &v["operations"][0];
    assert_eq!(row["tolerance"], 0.025, "{row}");
    assert!(row["worst"]["elastic"].is_null() && !row["over"].as_array().unwrap().is_empty(), "{row}");
    insta::assert_snapshot!(all.join("\n\n"));
}

/// The diameter of a tool is the machine file's where neither program nor tool table has it.
#[test]
fn diameters_of_the_machine_file() {
    let folder = tempfile::tempdir().unwrap();
    let tools = "[[tool]]\nnumber = 1\nname = \"mill\"\nposition = [0, 0, 60]\ndiameter = 10\n[[tool]]\nnumber = 2\nname = \"small\"\nposition = [0, 0, 60]\ndiameter = 6\n";
    std::fs::write(folder.path().join("m.toml"), format!("{}{tools}", springs())).unwrap();
    std::fs::write(folder.path().join("p.ngc"), "G21 G90 G94 F600\nT1 M6\nS3000 M3\nG0 X0 Y0 Z0\nG1 X40\nM5\nT2 M6\nS3000 M3\nG1 X0\nM5\nM2\n").unwrap();
    let cut = ["accuracy", "p.ngc", "--machine=m.toml", "--material=6061", "--teeth=2", "--depth=2", "--width=3", "--format=json", "-q"];
    let v = json(&run(folder.path(), &cut));
    let bend = |v: &serde_json::Value, i: usize| vector(&v["operations"][i]["worst"]["elastic"]);
    assert_ne!(bend(&v, 0), bend(&v, 1), "{v}");
    // What the file says goes before the option.
    let same = json(&run(folder.path(), &[&cut[..], &["--diameter=3"]].concat()));
    assert_eq!(bend(&v, 0), bend(&same, 0));
}

/// Where the rotary axis of a `cartesian` mill is, nobody knows: its error is left out and told, the words of the program are the joints,
/// and the end of the travel is where `check` has it.
#[test]
fn rotary_axes_without_a_place() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let joint = "[start]\njoints = [0, 0, 0, 0]\n[[joint]]\nname = \"A\"\ntype = \"revolute\"\nmin = -360\nmax = 360\n";
    let data = "[accuracy]\nsource = \"made up\"\njoints = [0.01, 0.01, 0.01, 0.02]\n";
    write("m.toml", &format!("format = 1\nextends = \"generic/mill3\"\nid = \"test/fourth\"\n{joint}{data}"));
    write("p.ngc", "G21 G90 G94 G17\nT1 M6 G43 H1\nS2000 M3\nG0 X0 Y30 Z50 A0\nG0 Z-2\nG1 X50 A90 F500\nM5\nM2\n");
    write("high.ngc", "G21 G90 G94 G17\nT1 M6 G43 H1\nS2000 M3\nG0 X0 Y-200 Z50 A90\nG1 X50 F500\nM5\nM2\n");
    for length in [0.0, 80.0, 160.0] {
        write("t.tbl", &format!("T1 P1 Z{length} D10\n"));
        let v = json(&run(folder.path(), &["accuracy", "p.ngc", "-tt.tbl", "--machine=m.toml", "--format=json", "-q"]));
        let worst = &v["operations"][0]["worst"];
        let joints: Vec<f64> = worst["joints"].as_array().unwrap().iter().map(|j| j.as_f64().unwrap()).collect();
        assert_eq!((joints[1], joints[2]), (30.0, length - 2.0), "{worst}");
        // Three slides, ±0.01 each.
        assert!((worst["sum"].as_f64().unwrap() - 0.01 * 3f64.sqrt()).abs() < 1e-9, "{worst}");
    }
    write("t.tbl", "T1 P1 Z180 D10\n");
    let told = |command: &str| whole(&run(folder.path(), &[command, "high.ngc", "-tt.tbl", "--machine=m.toml", "--message-format=short"]));
    let (checked, predicted) = (told("check"), told("accuracy"));
    for text in [&checked, &predicted] {
        assert!(text.contains("E0285") && text.contains("Z to 230 mm, beyond the machine's limit 150 mm"), "{text}");
    }
    assert_eq!(predicted.matches("E0285").count(), 1, "{predicted}");
    insta::assert_snapshot!(predicted);
}

/// A tolerance of nothing allows nothing that can be read: told at its place.
#[test]
fn tolerances_of_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(examples().join("stepnc/case-study.p21")).unwrap();
    std::fs::write(folder.path().join("part.p21"), text.replace("PLUS_MINUS_VALUE(0.05,0.05,3)", "PLUS_MINUS_VALUE(0.,0.,3)")).unwrap();
    let o = whole(&run(folder.path(), &["accuracy", "part.p21", "--machine=usp/2ups-prp", "--part=700,-60,0", "--message-format=short"]));
    assert!(o.contains("PLUS_MINUS_VALUE needs a limit above 0"), "{o}");
}
