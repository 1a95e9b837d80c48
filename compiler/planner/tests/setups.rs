//! How a setup lies on the machine, what the machine stands, and workingsteps that meet no material.

mod judge;

use gr_ir::{Op, Step};
use gr_planner::{Options, plan};
use gr_text::{Diagnostic, FileId, Severity};
use judge::cases::{BLOCK, TOP};
use judge::part::{Mill, Part};

fn pocket(p: &mut Part, at: [f64; 3], axial: f64) -> (usize, usize) {
    let tool = p.tool("ENDMILL", 6.0, 0.0, None);
    let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", tool, axial, 3.0));
    let [l, w, c] = [24.0, 16.0, 4.0].map(|v| p.length(v));
    let boundary = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{w},#{l})"));
    let flat = p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into());
    let f = p.feature("CLOSED_POCKET", &[op], at, Some(5.0), &format!(",(),$,#{flat},$,#{c},#{boundary}"));
    p.step(f, op);
    (f, op)
}

/// The plan with a setup whose origin has these axes.
fn in_setup(text: &str, axis: &str, x: &str) -> String {
    let plan = text.find("=WORKPLAN('").expect("a plan");
    let end = plan + text[plan..].find(",$,$,$);").expect("its end");
    let mut out = text.to_string();
    out.replace_range(end..end + 8, ",$,#9001,$);");
    let setup = format!(
        "#9001=SETUP('vise',#9002,#9006,());\n#9002=AXIS2_PLACEMENT_3D('',#9003,#9004,#9005);\n#9003=CARTESIAN_POINT('',(100.,50.,0.));\n\
         #9004=DIRECTION('',({axis}));\n#9005=DIRECTION('',({x}));\n#9006=PLANE('',#9007);\n#9007=AXIS2_PLACEMENT_3D('',#9008,$,$);\n\
         #9008=CARTESIAN_POINT('',(0.,0.,40.));\n"
    );
    let at = out.rfind("ENDSEC;").expect("the end");
    out.insert_str(at, &setup);
    out
}

fn run(text: &str, options: &Options) -> (Option<Vec<(bool, [f64; 3], Option<[f64; 3]>)>>, Vec<Diagnostic>) {
    let (planned, out) = plan(text.as_bytes(), FileId(0), options);
    let row = |s: Step<'_>| {
        let center = if let Op::Arc(a) = s.op { Some(a.center) } else { None };
        (s.op.feeds(), s.end.xyz(), center)
    };
    (planned.map(|p| p.program.steps().filter(|s| s.op.moves()).map(row).collect()), out)
}

fn of<'a>(out: &'a [Diagnostic], code: &str) -> Vec<&'a str> {
    out.iter().filter(|d| d.code.def().code == code).map(|d| d.message.as_str()).collect()
}

#[test]
fn a_setup_turned_about_z_turns_the_coordinates() {
    let mut p = Part::new(BLOCK);
    pocket(&mut p, [30.0, 20.0, TOP], 2.5);
    let (plain, _) = run(&p.text(), &Options::default());
    let plain = plain.expect("a program");
    for (x, [c, s]) in [("0.,1.,0.", [0.0, 1.0]), ("0.8,0.6,0.", [0.8, 0.6]), ("-1.,0.,0.", [-1.0, 0.0])] {
        let (turned, out) = run(&in_setup(&p.text(), "0.,0.,1.", x), &Options::default());
        let turned = turned.unwrap_or_else(|| panic!("{out:#?}"));
        assert_eq!(plain.len(), turned.len());
        let same = |p: [f64; 3], q: [f64; 3]| (c * p[0] - s * p[1] - q[0]).abs() + (s * p[0] + c * p[1] - q[1]).abs() + (p[2] - q[2]).abs() < 1e-9;
        // The first move goes up wherever the machine stands.
        for (a, b) in plain.iter().zip(&turned).skip(1) {
            assert!(a.0 == b.0 && same(a.1, b.1), "{a:?} {b:?}");
            assert!(a.2.zip(b.2).is_none_or(|(a, b)| same([a[0], a[1], 0.0], [b[0], b[1], 0.0])), "{a:?} {b:?}");
        }
        assert!(of(&out, "E0491")[0].contains("turned by"), "{out:#?}");
    }
}

#[test]
fn a_setup_that_leans_is_refused() {
    let mut p = Part::new(BLOCK);
    pocket(&mut p, [30.0, 20.0, TOP], 2.5);
    for axis in ["0.,1.,0.", "0.,0.,-1."] {
        let (none, out) = run(&in_setup(&p.text(), axis, "1.,0.,0."), &Options::default());
        assert!(none.is_none());
        assert_eq!(of(&out, "E0450").len(), 1, "{out:#?}");
    }
}

#[test]
fn what_the_machine_stands() {
    let mut p = Part::new(BLOCK);
    pocket(&mut p, [30.0, 20.0, TOP], 4.0);
    let limited = |most: f64| run(&p.text(), &Options { axial_depth: Some(most), ..Options::default() }).1;
    assert_eq!(of(&limited(3.0), "E0448"), ["#16 BOTTOM_AND_SIDE_ROUGH_MILLING cuts 4 mm deep at once; the machine stands 3 mm"]);
    assert!(of(&limited(4.0), "E0448").is_empty());
}

#[test]
fn air() {
    let mut p = Part::new(BLOCK);
    let (f, op) = pocket(&mut p, [30.0, 20.0, TOP], 2.5);
    assert!(of(&run(&p.text(), &Options::default()).1, "E0449").is_empty());
    p.step(f, op);
    assert!(of(&run(&p.text(), &Options::default()).1, "E0449")[0].contains("has been made on"));
    for (x, why) in [(BLOCK[0], "beyond the raw part"), (BLOCK[0] + 100.0, "lies beside the raw part")] {
        let mut p = Part::new(BLOCK);
        pocket(&mut p, [x, 20.0, TOP], 2.5);
        let (_, out) = run(&p.text(), &Options::default());
        assert!(of(&out, "E0449").iter().any(|m| m.contains(why)), "{out:#?}");
    }
}

#[test]
fn a_floor_that_leans_is_refused() {
    let mut p = Part::new(BLOCK);
    pocket(&mut p, [30.0, 20.0, TOP], 2.5);
    let text = p.text();
    let at = text.find("=PLANE('depth'").expect("a depth");
    let place = text[at..].split('#').nth(1).and_then(|t| t.split(')').next()).expect("its placement").to_string();
    let head = format!("#{place}=AXIS2_PLACEMENT_3D(");
    let from = text.find(&head).expect("it");
    let end = from + text[from..].find(";").expect("its end");
    let point = text[from..end].split('#').nth(2).and_then(|t| t.split(',').next()).expect("its point").to_string();
    let leaning = format!("{}{head}'',#{point},#9001,$);\n#9001=DIRECTION('',(0.3,0.,1.)){}", &text[..from], &text[end..]);
    let (none, out) = run(&leaning, &Options::default());
    assert!(none.is_none());
    let errors: Vec<&str> = out.iter().filter(|d| d.severity == Severity::Error).map(|d| d.message.as_str()).collect();
    assert!(errors.len() == 1 && errors[0].contains("leans"), "{errors:?}");
}
