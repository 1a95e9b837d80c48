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
