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
