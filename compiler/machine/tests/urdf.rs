//! Library robots against the joint frames of their public URDF files; import of URDF.

use gr_machine::math::{Frame, norm};
use gr_machine::{Chain, JointKind, Kinematics, Link, Serial, builtin, identify, import_urdf, parse};
use gr_text::FileId;

/// Id, chain and whether the flange's turn is known.
fn rows() -> Vec<(&'static str, Serial, bool)> {
    let numbers = |cell: &str| -> Vec<f64> { cell.split(' ').filter_map(|v| v.parse().ok()).collect() };
    include_str!("data/urdf-origins.tsv")
        .lines()
        .filter(|l| !l.starts_with('#'))
        .map(|line| {
            let cells: Vec<&'static str> = line.split('\t').collect();
            let link = |cell: &&str| {
                let v = numbers(cell);
                let origin = Frame::shift([v[0] * 1000.0, v[1] * 1000.0, v[2] * 1000.0]);
                Link { origin, axis: [v[3], v[4], v[5]], kind: JointKind::Revolute, limits: (-9.0, 9.0) }
            };
            let v = numbers(cells[7]);
            let turn: [f64; 3] = std::array::from_fn(|i| v.get(3 + i).copied().unwrap_or(0.0).to_radians());
            let tip = Frame::new([v[0] * 1000.0, v[1] * 1000.0, v[2] * 1000.0], turn);
            (cells[0], Serial::new(cells[1..7].iter().map(link).collect(), tip), v.len() == 6)
        })
        .collect()
}

fn poses() -> impl Iterator<Item = [f64; 6]> {
    (0..100).map(|n| std::array::from_fn(|i| libm::sin((n * 11 + i * 5 + 1) as f64) * 2.5))
}

#[test]
fn library_robots_equal_their_urdf() {
    for (id, chain, whole) in rows() {
        let k = builtin(id).unwrap().kinematics();
        for q in poses() {
            let (p, r) = k.forward_frame(&q).unwrap().error_to(&chain.forward_frame(&q).unwrap());
            assert!(norm(p) < 1e-9, "{id}: {p:?} at {q:?}");
            assert!(!whole || norm(r) < 1e-12, "{id}: {r:?} at {q:?}");
        }
    }
}

#[test]
fn lengths_are_found_in_the_urdf() {
    for (id, chain, whole) in rows() {
        let Chain::Opw(arm) = builtin(id).unwrap().chain else { panic!("{id}") };
        let fit = identify(&chain).unwrap_or_else(|e| panic!("{id}: {e}"));
        for (a, b) in fit.arm.lengths().iter().zip(arm.lengths()) {
            assert!((a.abs() - b.abs()).abs() < 1e-6, "{id}: {:?}", fit.arm.lengths());
        }
        assert!(!whole || fit.flange == Frame::IDENTITY, "{id}");
    }
}

/// A URDF text of a chain.
fn urdf(chain: &Serial, tip: [f64; 3]) -> String {
    let mut out = String::from("<?xml version=\"1.0\"?>\n<robot name=\"made\">\n<link name=\"base_link\"/>\n");
    for (i, l) in chain.links().iter().enumerate() {
        let p = l.origin.position.map(|v| v / 1000.0);
        let parent = if i == 0 { "base_link".to_string() } else { format!("link_{i}") };
        let n = i + 1;
        out += &format!(
            "<link name=\"link_{n}\"/>\n<joint name=\"joint_{n}\" type=\"revolute\"><origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/><parent link=\"{parent}\"/><child link=\"link_{n}\"/><axis xyz=\"{} {} {}\"/><limit lower=\"-3\" upper=\"3\" effort=\"0\" velocity=\"2\"/></joint>\n",
            p[0], p[1], p[2], l.axis[0], l.axis[1], l.axis[2]
        );
    }
    let p = chain.tip().position.map(|v| v / 1000.0);
    let last = chain.links().len();
    out += &format!(
        "<link name=\"tool0\"/>\n<joint name=\"flange\" type=\"fixed\"><origin xyz=\"{} {} {}\" rpy=\"{} {} {}\"/><parent link=\"link_{last}\"/><child link=\"tool0\"/></joint>\n</robot>\n",
        p[0], p[1], p[2], tip[0], tip[1], tip[2]
    );
    out
}

#[test]
fn imported_arms_equal_their_urdf() {
    for (id, chain, _) in rows().into_iter().filter(|r| r.2) {
        // Turns of flanges as the files round them.
        let turn = match id.split('/').next().unwrap() {
            "abb" | "kuka" => [0.0, 1.5708, 0.0],
            "fanuc" | "yaskawa" => [3.1415926, -1.570796, 0.0],
            _ => [0.0; 3],
        };
        let import = import_urdf("test/arm", &urdf(&chain, turn), None).unwrap();
        let machine = parse(FileId(0), &import.toml).unwrap_or_else(|e| panic!("{e:?}\n{}", import.toml));
        // As the library has the arm: front is front, which configurations of controllers rest on.
        let (Chain::Opw(arm), Chain::Opw(known)) = (&machine.chain, builtin(id).unwrap().chain) else {
            panic!("{id}: {:?}\n{}", import.notes, import.toml)
        };
        let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off(&arm.lengths(), &known.lengths()) < 1e-6, "{id}: {:?} {:?}", arm.lengths(), known.lengths());
        assert!(off(&arm.offsets()[..3], &known.offsets()[..3]) < 1e-9 && arm.signs()[..3] == known.signs()[..3], "{id}\n{}", import.toml);
        for q in poses() {
            let (p, r) = machine.kinematics().forward_frame(&q).unwrap().error_to(&chain.forward_frame(&q).unwrap());
            assert!(norm(p) < 1e-6 && norm(r) < 1e-9, "{id}: {p:?} {r:?}");
        }
    }
}

/// An arm that hangs, or stands beside the root, is the same arm: its base is its own first link, and only where that is differs.
#[test]
fn an_arm_counts_from_its_own_first_link() {
    let (id, chain, _) = rows().into_iter().find(|r| r.0 == "abb/irb2400").unwrap();
    let upright = urdf(&chain, [0.0, 1.5708, 0.0]);
    let plain = import_urdf("test/arm", &upright, None).unwrap();
    for (place, told) in [("xyz=\"0 0 2.5\" rpy=\"3.14159265 0 0\"", "position = [0, 0, 2500]\nrotation = [180, 0, 0]"), ("xyz=\"1 0.5 0.8\" rpy=\"0 0.3 0\"", "position = [1000, 500, 800]")] {
        let mount = format!("<link name=\"world\"/>\n<joint name=\"mount\" type=\"fixed\"><parent link=\"world\"/><child link=\"base_link\"/><origin {place}/></joint>\n</robot>");
        let import = import_urdf("test/arm", &upright.replace("</robot>", &mount), None).unwrap();
        let (own, base) = import.toml.split_once("\n# The link `base_link` in the first link").unwrap();
        assert_eq!(own.trim(), plain.toml.trim(), "{id}");
        assert!(base.contains("[frames.base]") && base.contains(told), "{base}");
        assert!(import.notes.iter().any(|n| n.contains("the arm stands on the link `base_link`")), "{:?}", import.notes);
        let machine = parse(FileId(0), &import.toml).unwrap();
        let q = [0.3, -0.2, 0.4, 0.5, -0.6, 0.7];
        let (p, r) = machine.kinematics().forward_frame(&q).unwrap().error_to(&plain.chain.forward_frame(&q).unwrap());
        assert!(norm(p) < 1e-6 && norm(r) < 1e-9);
    }
}

/// Where only the last link is turned, the closed form stands in the file for whoever knows the robot's flange.
#[test]
fn a_turned_flange_shows_the_way_out() {
    let (_, chain, _) = rows().into_iter().find(|r| r.0 == "abb/irb2400").unwrap();
    let import = import_urdf("test/arm", &urdf(&chain, [0.0; 3]), None).unwrap();
    assert!(import.notes.iter().any(|n| n.contains("`--tip`")), "{:?}", import.notes);
    assert!(import.toml.contains("# kind = \"opw\"\n# a1 a2 b c1 c2 c3 c4\n# lengths = [100, -135, 0, 615, 705, 755, 85]") && import.toml.contains("\nkind = \"origins\""), "{}", import.toml);
    assert!(parse(FileId(0), &import.toml).is_ok());
}

#[test]
fn arms_without_closed_form_keep_their_frames() {
    let (_, chain, _) = rows().into_iter().next().unwrap();
    let mut links = chain.links().to_vec();
    links[4].origin.position[1] = 80.0;
    links[5].origin.position[2] = 40.0;
    let odd = Serial::new(links, *chain.tip());
    let import = import_urdf("test/odd", &urdf(&odd, [0.0; 3]), None).unwrap();
    assert!(import.notes.iter().any(|n| n.contains("no closed form")), "{:?}", import.notes);
    let machine = parse(FileId(0), &import.toml).unwrap_or_else(|e| panic!("{e:?}\n{}", import.toml));
    let q = [0.3, -0.2, 0.4, 0.5, -0.6, 0.7];
    let (p, r) = machine.kinematics().forward_frame(&q).unwrap().error_to(&odd.forward_frame(&q).unwrap());
    assert!(norm(p) < 1e-6 && norm(r) < 1e-9);
}

#[test]
fn bad_files_are_said_to_be_so() {
    for text in ["", "<robot", "<robot name=\"x\"><link name=\"a\"/></robot>", "{}", "<a/>"] {
        assert!(import_urdf("test/x", text, None).is_err(), "{text}");
    }
}

/// Limits that are crossed or no numbers are no reason to make a joint without limits; a joint that has none is told.
#[test]
fn limits_of_joints() {
    let (_, chain, _) = rows().into_iter().next().unwrap();
    let good = urdf(&chain, [0.0; 3]);
    let at = good.find("<limit").unwrap();
    let with = |limit: &str| format!("{}{limit}{}", &good[..at], &good[at + good[at..].find("/>").unwrap() + 2..]);
    for limit in ["lower=\"1\" upper=\"-1\" velocity=\"1\"", "lower=\"nan\" upper=\"1\" velocity=\"1\"", "lower=\"-inf\" upper=\"1\" velocity=\"1\"", "lower=\"-1\" upper=\"1\" velocity=\"-1\""] {
        let why = import_urdf("test/x", &with(&format!("<limit {limit} effort=\"1\"/>")), None).expect_err(limit);
        assert!(why.contains("correct its <limit>"), "{why}");
    }
    let none = import_urdf("test/x", &with("<limit velocity=\"1\" effort=\"1\"/>"), None).unwrap();
    assert!(none.notes.iter().any(|n| n.contains("has no limits")), "{:?}", none.notes);
}

/// Fingers of a gripper are no joints of the arm.
#[test]
fn an_arm_ends_where_its_gripper_begins() {
    let (_, chain, _) = rows().remove(0);
    let finger = |n: u8| {
        format!("<link name=\"f{n}\"/><joint name=\"g{n}\" type=\"prismatic\"><parent link=\"hand\"/><child link=\"f{n}\"/><axis xyz=\"0 1 0\"/><limit lower=\"0\" upper=\"0.04\" velocity=\"1\" effort=\"1\"/></joint>\n")
    };
    let arm = urdf(&chain, [0.0; 3]);
    let hand = format!("<link name=\"hand\"/><joint name=\"mount\" type=\"fixed\"><parent link=\"tool0\"/><child link=\"hand\"/></joint>\n{}{}</robot>", finger(1), finger(2));
    let text = arm.replace("</robot>", &hand);
    let plain = import_urdf("test/arm", &arm, None).unwrap();
    let told = |notes: &[String], end: &str| notes.iter().any(|n| n.contains(&format!("ends at the link `{end}`; left out: ")) && n.contains("g2"));
    for tip in [None, Some("tool0")] {
        let import = import_urdf("test/arm", &text, tip).unwrap();
        assert_eq!((import.chain.links().len(), &import.toml), (6, &plain.toml));
        assert!(told(&import.notes, "tool0"), "{:?}", import.notes);
    }
    let hand = import_urdf("test/arm", &text, Some("hand")).unwrap();
    assert!(hand.chain.links().len() == 6 && told(&hand.notes, "hand"), "{:?}", hand.notes);
    assert_eq!(import_urdf("test/arm", &text, Some("f1")).unwrap().chain.links().len(), 7);
    assert!(import_urdf("test/arm", &text, Some("elbow")).unwrap_err().contains("no link `elbow`; its links are "));
    assert!(plain.notes.iter().all(|n| !n.contains("left out")), "{:?}", plain.notes);
}

/// A fixed link `base` beside `base_link`.
fn with_base(text: &str, prefix: &str, origin: &str) -> String {
    let base = format!("<link name=\"{prefix}base\"/><joint name=\"to_base\" type=\"fixed\"><parent link=\"{prefix}base_link\"/><child link=\"{prefix}base\"/><origin {origin}/></joint>\n</robot>");
    text.replace("base_link", &format!("{prefix}base_link")).replace("</robot>", &base)
}

/// The link `base` is where the controller counts from: on a FANUC at the height of its second axis.
#[test]
fn the_controller_counts_from_the_link_base() {
    let (_, chain, _) = rows().into_iter().find(|r| r.0 == "fanuc/m-20ia").unwrap();
    let arm = urdf(&chain, [3.1415926, -1.570796, 0.0]);
    for prefix in ["", "left_"] {
        let import = import_urdf("test/arm", &with_base(&arm, prefix, "xyz=\"0 0 0.525\" rpy=\"0 0 0\""), None).unwrap();
        let machine = parse(FileId(0), &import.toml).unwrap_or_else(|e| panic!("{e:?}\n{}", import.toml));
        assert_eq!(machine.cell.controller_frame, Some(Frame::shift([0.0, 0.0, 525.0])), "{}", import.toml);
        assert!(import.notes.iter().any(|n| n.contains("counts from the link `base`")), "{:?}", import.notes);
    }
    // Where both are one, nothing is to be said.
    let same = import_urdf("test/arm", &with_base(&arm, "", "xyz=\"0 0 0\" rpy=\"0 0 0\""), None).unwrap();
    assert_eq!(same, import_urdf("test/arm", &arm, None).unwrap());
}

/// Joint origins of ros-industrial/universal_robot's ur_description for the UR5, whose root looks backwards.
fn ur5(d5: f64, controller: bool) -> String {
    let rows = [
        ("base_link", "base_link_inertia", "0 0 0", "0 0 3.141592653589793"),
        ("base_link_inertia", "shoulder", "0 0 0.089159", "0 0 0"),
        ("shoulder", "upper_arm", "0 0 0", "1.570796327 0 0"),
        ("upper_arm", "forearm", "-0.425 0 0", "0 0 0"),
        ("forearm", "wrist_1", "-0.39225 0 0.10915", "0 0 0"),
        ("wrist_1", "wrist_2", &format!("0 {} 0", -d5), "1.570796327 0 0"),
        ("wrist_2", "wrist_3", "0 0.0823 0", "1.570796326589793 3.141592653589793 3.141592653589793"),
        ("wrist_3", "flange", "0 0 0", "0 -1.570796326589793 -1.570796326589793"),
        ("flange", "tool0", "0 0 0", "1.570796326589793 0 1.570796326589793"),
    ];
    let mut out = String::from("<robot name=\"ur5\"><link name=\"base_link\"/>");
    for (i, (parent, child, xyz, rpy)) in rows.iter().enumerate() {
        let kind = if (1..7).contains(&i) { "revolute" } else { "fixed" };
        out += &format!("<link name=\"{child}\"/><joint name=\"j{i}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{xyz}\" rpy=\"{rpy}\"/><axis xyz=\"0 0 1\"/><limit lower=\"-6\" upper=\"6\" effort=\"1\" velocity=\"3\"/></joint>");
    }
    out += "</robot>";
    if controller { with_base(&out, "", "xyz=\"0 0 0\" rpy=\"0 0 3.141592653589793\"") } else { out }
}

/// An arm of Universal Robots is the library's, seen from the controller's base, with a link `base` and without.
#[test]
fn arms_with_an_offset_wrist_have_their_closed_form() {
    let known = builtin("universal-robots/ur5").unwrap();
    for controller in [true, false] {
        let import = import_urdf("test/ur", &ur5(0.09465, controller), None).unwrap();
        let machine = parse(FileId(0), &import.toml).unwrap_or_else(|e| panic!("{e:?}\n{}", import.toml));
        assert!(matches!(machine.chain, Chain::ParallelWrist(_)) && machine.cell.controller_frame.is_none(), "{}", import.toml);
        assert!(import.notes.iter().any(|n| n.contains("as the robot's panel counts them")), "{:?}", import.notes);
        for q in poses() {
            let (p, r) = machine.kinematics().forward_frame(&q).unwrap().error_to(&known.kinematics().forward_frame(&q).unwrap());
            assert!(norm(p) < 1e-6 && norm(r) < 1e-9, "{p:?} {r:?}");
        }
    }
    // One whose wrist is askew, as calibrated ones are, keeps its frames and the controller's.
    let askew = ur5(0.09465, true).replace("-0.425 0 0\" rpy=\"0 0 0", "-0.425 0 0\" rpy=\"0.001 0 0");
    let import = import_urdf("test/ur", &askew, None).unwrap();
    let machine = parse(FileId(0), &import.toml).unwrap_or_else(|e| panic!("{e:?}\n{}", import.toml));
    assert!(matches!(machine.chain, Chain::Serial(_)) && import.notes.iter().any(|n| n.contains("`kind = \"ur\"` either")), "{:?}", import.notes);
    let turned = machine.cell.controller_frame.expect("the link base");
    assert!((turned.turn[0][0] + 1.0).abs() < 1e-12 && norm(turned.position) == 0.0, "{}", import.toml);
}
