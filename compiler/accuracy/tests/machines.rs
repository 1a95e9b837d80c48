//! The same model on other kinds of machines: against the machine file with one number changed, and compensation of a
//! whole program.

use gr_accuracy::compensate;
use gr_accuracy::{Budget, BudgetOptions, Sensitivity};
use gr_machine::math::{Frame, norm, sub};
use gr_machine::{Machine, parse};
use gr_text::FileId;

fn read(text: &str) -> Machine {
    parse(FileId(0), text).unwrap_or_else(|e| panic!("{e:#?}\n{text}"))
}

/// Two machines that differ in one number of their file, at the same joints: the tool moves as the model says.
fn perturbed(text: &str, from: &str, to: &str, parameter: &str, change: f64, joints: &[f64]) {
    assert!(text.contains(from), "{from} is not in the file");
    let (a, b) = (read(text), read(&text.replacen(from, to, 1)));
    let moved = sub(
        b.kinematics().forward_frame(joints).unwrap().position,
        a.kinematics().forward_frame(joints).unwrap().position,
    );
    let s = Sensitivity::new(&a, joints, [0.0; 3]).unwrap();
    let i = a.parameters().iter().position(|p| p.name == parameter).unwrap();
    let said = s.geometry[i].map(|v| v * change);
    assert!(norm(sub(moved, said)) < 1e-4 * norm(moved).max(1e-3), "{parameter}: {moved:?}, not {said:?}");
}

#[test]
fn serial_arm() {
    let text = gr_machine::source("abb/irb2400").unwrap();
    perturbed(text, "705", "705.01", "c2", 0.01, &[0.3, -0.2, 0.4, 0.5, 0.6, 0.1]);
}

#[test]
fn scara() {
    let text = gr_machine::source("adept/one").unwrap();
    let line = text.lines().find(|l| l.starts_with("links")).unwrap();
    let first: f64 = line.split(['[', ',']).nth(1).unwrap().trim().parse().unwrap();
    perturbed(text, line, &line.replacen(&first.to_string(), &(first + 0.01).to_string(), 1), "l1", 0.01, &[0.3, 0.5, 100.0, 0.2]);
}

#[test]
fn five_axis_mill() {
    let id = gr_machine::list().find(|id| id.starts_with("generic/mill5") && gr_machine::source(id).unwrap().contains("pivot")).unwrap();
    let text = gr_machine::source(id).unwrap();
    let line = text.lines().find(|l| l.starts_with("pivot")).unwrap();
    let pivot: f64 = line.split('=').nth(1).unwrap().split('#').next().unwrap().trim().parse().unwrap();
    perturbed(text, line, &format!("pivot = {}", pivot + 0.01), "pivot", 0.01, &[10.0, 20.0, -30.0, 0.4, 0.3]);
}

const TRICEPT: &str = "format = 1\nid = \"test/tricept\"\nextends = \"comau/tricept806\"\n[kinematics]\nkind = \"tricept\"\nbase_radius = 400\nplatform_radius = 150\nwrist_offset = 300\nflange_offset = 200\n";

#[test]
fn tricept() {
    let m = read(TRICEPT);
    let k = m.kinematics();
    let pose = Frame::new([120.0, 60.0, -1700.0], [std::f64::consts::PI, 0.1, 0.2]);
    let mut tried = 0;
    for z in [-1900.0, -1700.0, -1500.0, 1500.0, 1700.0, 1900.0] {
        let pose = Frame { position: [120.0, 60.0, z], ..pose };
        let Ok(all) = k.inverse_frame(&pose) else { continue };
        let q = all[0].joints.clone();
        if k.forward_frame(&q).is_err() {
            continue;
        }
        perturbed(TRICEPT, "flange_offset = 200", "flange_offset = 200.01", "flange_offset", 0.01, &q);
        perturbed(TRICEPT, "platform_radius = 150", "platform_radius = 150.01", "platform_radius", 0.01, &q);
        tried += 1;
    }
    assert!(tried > 0, "no place within reach");
}

#[test]
fn what_is_not_said_is_told() {
    let m = read(gr_machine::source("abb/irb2400").unwrap());
    let b = Budget::new(&m, BudgetOptions::default());
    assert!(b.joints.is_none() && b.geometry.is_none());
    let b = Budget::new(&m, BudgetOptions { grade: Some(7), usp2009: false });
    assert_eq!(b.geometry.as_ref().map(Vec::len), Some(m.parameters().len()));
    assert!(compensate::deviations(&m).is_none());
}

/// Points on the 2UPS+PRP machine with identified deviations: every point, as the real machine goes.
#[test]
fn corrected_points_are_where_they_should_be() {
    let text = "format = 1\nid = \"test/as-built\"\nextends = \"usp/2ups-prp\"\n[as_built]\nsource = \"made up for this test\"\n\
        parameter = [{ name = \"ls1x\", deviation = 0.05 }, { name = \"lu2y\", deviation = -0.08 }, { name = \"lu1z\", deviation = 0.03 }]\n\
        [[tool]]\nnumber = 1\nname = \"mill\"\n";
    let m = read(text);
    let deviations = compensate::deviations(&m).unwrap();
    let corrector = compensate::Corrector::new(&m, &deviations);
    let mut largest = 0.0f64;
    for i in 0..=20 {
        let p = [700.0 + 10.0 * f64::from(i), -100.0 + 9.0 * f64::from(i), 5.0 * f64::from(i)];
        let raw = corrector.real_place(&Frame::shift(p), &Frame::IDENTITY, &[]).unwrap();
        largest = largest.max(norm(sub(raw, p)));
        let (command, _) = corrector.command(&Frame::shift(p), &Frame::IDENTITY, &[]).unwrap();
        let got = corrector.real_place(&command, &Frame::IDENTITY, &[]).unwrap();
        assert!(norm(sub(got, p)) < 1e-9);
    }
    assert!(largest > 0.02, "{largest}");
}

/// Moves of the program: where to, and whether it is an arc about a centre.
fn program_of(moves: &[(gr_ir::Axes, Option<[f64; 3]>)]) -> gr_ir::Program {
    use gr_ir::{Arc, ArcPlane, Builder, Op, Plane, Pose, Source};
    let mut out = Builder::new();
    let at = |line| Source { line, ..Source::default() };
    out.push(Op::Feed { linear: 20.0, angular: 1.0 }, at(0));
    for (line, (axes, center)) in (1..).zip(moves) {
        let op = match center {
            Some(center) => Op::Arc(Arc { plane: ArcPlane::Work(Plane::Xy), center: *center, turns: 1 }),
            None => Op::Linear,
        };
        out.push_to(op, &Pose::at(*axes), at(line));
    }
    out.finish()
}

fn with_deviations(id: &str, rows: &[(&str, f64)]) -> Machine {
    let rows: Vec<String> = rows.iter().map(|(n, d)| format!("{{ name = \"{n}\", deviation = {d} }}")).collect();
    read(&format!(
        "format = 1\nid = \"test/as-built\"\nextends = \"{id}\"\n[as_built]\nsource = \"made up for this test\"\nparameter = [{}]\n",
        rows.join(", ")
    ))
}

/// X and Y stand at 90.02°, so Y leans away from X: the corrected words, taken as a machine that leans takes them, are the programmed path.
#[test]
fn a_mill_that_is_not_square() {
    let m = with_deviations("generic/mill3", &[("square-xy", 0.02), ("square-yz", -0.01)]);
    let deviations = compensate::deviations(&m).unwrap();
    let way = |x: f64, y: f64, z: f64| [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let program = program_of(&[(way(100.0, 0.0, -5.0), None), (way(100.0, 200.0, -5.0), None), (way(80.0, 220.0, -5.0), Some([80.0, 200.0, -5.0]))]);
    let made = compensate::motion(&program, &m, &deviations, 0.01, &gr_ir::NoSources).unwrap();
    assert_eq!(made.arcs, 1);
    // A lean takes straight lines to straight lines: they stay whole.
    let moves: Vec<_> = made.program.steps().filter(|s| s.op.moves()).collect();
    assert_eq!(moves.iter().filter(|s| s.source.line < 3).count(), 2);
    let (xy, yz) = (0.02f64.to_radians(), -0.01f64.to_radians());
    let leaning = |[x, y, z]: [f64; 3]| [x - xy * y, y - yz * z, z];
    let corner = leaning(moves[1].end.xyz());
    assert!(norm(sub(corner, [100.0, 200.0, -5.0])) < 1e-9, "{corner:?}");
    for s in moves.iter().skip(2) {
        let [x, y, _] = leaning(s.end.xyz());
        assert!((libm::hypot(x - 80.0, y - 200.0) - 20.0).abs() < 1e-9, "{x} {y}");
    }
    assert!(norm(made.corrections[1].by) > 0.06);
}

/// A head longer than its file says, a table beside its place, an axis that leans: the real machine's tool point is on
/// the path, but for what touching the part at the zero takes away.
#[test]
fn five_axes_as_built() {
    for (id, rows) in [
        ("generic/mill5-ac-table", &[("rotary1.z", 0.05), ("rotary2.x", -0.03), ("rotary1.tilt-a", 0.01)][..]),
        ("generic/mill5-cb-head", &[("pivot", 0.08), ("rotary2.tilt-b", 0.02)][..]),
    ] {
        let m = with_deviations(id, rows);
        let deviations = compensate::deviations(&m).unwrap();
        let (nominal, real) = (m.kinematics(), m.deviated(&deviations));
        let letters: Vec<usize> = m.joints.iter().map(|j| "XYZABC".find(j.word.unwrap()).unwrap()).collect();
        let mut moves = Vec::new();
        for i in 0..8 {
            let t = f64::from(i);
            let mut axes = [20.0 + 5.0 * t, -30.0 + 8.0 * t, -20.0 - t, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            (axes[letters[3]], axes[letters[4]]) = (-0.1 * t, 0.2 * t);
            moves.push((axes, None));
        }
        let made = compensate::motion(&program_of(&moves), &m, &deviations, 0.01, &gr_ir::NoSources).unwrap();
        // Joints for words: of the solutions for the direction, that with these rotary words.
        let joints = |axes: &gr_ir::Axes| {
            let q = [0.0, 0.0, 0.0, axes[letters[3]], axes[letters[4]]];
            let k = nominal.forward_frame(&q).unwrap();
            let table = |v: [f64; 3]| sub(nominal.forward_frame(&[v[0], v[1], v[2], q[3], q[4]]).unwrap().position, k.position);
            let m = [table([1.0, 0.0, 0.0]), table([0.0, 1.0, 0.0]), table([0.0, 0.0, 1.0])];
            let want = sub([axes[0], axes[1], axes[2]], k.position);
            let x = m.map(|c| gr_machine::math::dot(c, want));
            vec![x[0], x[1], x[2], q[3], q[4]]
        };
        let off = |axes: &gr_ir::Axes| {
            let got = real.forward_frame(&joints(axes)).unwrap().position;
            sub(got, [axes[0], axes[1], axes[2]])
        };
        let zero = off(&[0.0; 9]);
        let (mut raw, mut left) = (0.0f64, 0.0f64);
        let ends: Vec<_> = made.program.steps().filter(|s| s.op.moves()).collect();
        for (line, (axes, _)) in (1..).zip(&moves) {
            let end = ends.iter().rfind(|s| s.source.line == line).unwrap();
            let got = real.forward_frame(&joints(&end.end.axes)).unwrap().position;
            raw = raw.max(norm(sub(off(axes), zero)));
            left = left.max(norm(sub(sub(got, [axes[0], axes[1], axes[2]]), zero)));
        }
        // Where it turns, the offset of the zero turns a little differently: far below what was there.
        assert!(raw > 0.01 && left < 1e-4 * raw.max(1.0), "{id}: {raw} {left}");
        assert!(made.corrections.iter().any(|c| c.left > 1e-5), "{id}: the lean is told");
    }
}

/// An arm: place and turn of the real tool are those of the program, at every point of the corrected one.
#[test]
fn an_arm_as_built() {
    let text = "format = 1\nid = \"test/as-built\"\nextends = \"abb/irb2400\"\n[frames.part]\nposition = [900, 0, 600]\n\
        [as_built]\nsource = \"made up for this test\"\nparameter = [{ name = \"a2\", deviation = 0.4 }, { name = \"J2.zero\", deviation = 0.03 }, { name = \"J5.zero\", deviation = -0.05 }]\n\
        [[tool]]\nnumber = 1\nname = \"mill\"\nposition = [0, 0, 120]\n";
    let m = read(text);
    let way = |x: f64, y: f64| [x, y, -5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut out = gr_ir::Builder::new();
    out.push(gr_ir::Op::ToolNumber(1), gr_ir::Source::default());
    for step in program_of(&[(way(100.0, 0.0), None), (way(100.0, 200.0), None), (way(80.0, 220.0), Some([80.0, 200.0, -5.0]))]).steps() {
        out.push_to(step.op, &step.end, step.source);
    }
    let planned = gr_robot::plan(&out.finish(), &m, &gr_ir::NoSources, &gr_robot::Options::default()).unwrap_or_else(|e| panic!("{e:#?}")).program;
    let deviations = compensate::deviations(&m).unwrap();
    let made = compensate::program(&planned, &deviations, 0.01).unwrap();
    let real = m.deviated(&deviations);
    let tool = planned.tools.iter().find(|t| t.number == 1).unwrap().frame;
    let down = gr_machine::math::Frame { turn: gr_machine::math::rot_x(std::f64::consts::PI), position: [0.0; 3] };
    let mut cuts = 0;
    for (target, correction) in made.program.targets.iter().zip(&made.corrections) {
        let got = real.forward_frame(&target.joints[..6]).unwrap().then(&tool);
        assert!(norm(sub(got.position, correction.aim)) < 1e-9);
        assert!(correction.left < 1e-9 && correction.turn > 1e-5);
        if correction.line.is_some() {
            cuts += 1;
            let lean = down.axis(2).iter().zip(got.axis(2)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(lean < 1e-9, "{lean}");
        }
        // What is written says the same as the joints: the control's own solution goes there.
        let written = gr_machine::math::Frame { position: target.position, turn: gr_machine::math::turn_of(target.quaternion) };
        let frame = planned.frames.last().map(|f| f.frame).unwrap();
        let command = m.kinematics().forward_frame(&target.joints[..6]).unwrap().then(&tool);
        let (shift, turn) = frame.then(&written).error_to(&command);
        assert!(norm(shift) < 1e-8 && norm(turn) < 1e-9, "{shift:?} {turn:?}");
    }
    assert!(cuts > 4 && made.arcs == 1);
    // Motion alone doesn't say how an arm stands.
    let e = compensate::motion(&program_of(&[]), &m, &deviations, 0.01, &gr_ir::NoSources).unwrap_err();
    assert!(e.1.contains("configuration"), "{e:?}");
}
