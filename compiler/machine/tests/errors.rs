//! Velocities and parameter columns: against differences of the forward solution, for every kind of kinematics.

use gr_machine::math::{Frame, norm, rotation_vector, product, transpose};
use gr_machine::{Chain, Machine, differential, parameter_columns};

fn near(machine: &dyn gr_machine::Kinematics, joints: &[f64], aim: &Frame) -> Frame {
    match machine.forward_frame(joints) {
        Ok(f) => f,
        Err(e) => panic!("{e} at {joints:?} near {aim:?}"),
    }
}

fn difference(a: &Frame, b: &Frame) -> [f64; 6] {
    let w = rotation_vector(&product(&a.turn, &transpose(&b.turn)));
    let p = [0, 1, 2].map(|i| a.position[i] - b.position[i]);
    [p[0], p[1], p[2], w[0], w[1], w[2]]
}

fn machines() -> Vec<(Machine, Vec<f64>)> {
    let some = [0.35, -0.42, 0.51, 0.63, 0.77, -0.3];
    let ids = ["ufmg/plano-3r", "adept/one", "abb/irb2400", "kuka/kr16-2", "fanuc/lr-mate-200id", "universal-robots/ur5",
        "generic/mill3", "generic/mill5-ac-table", "generic/mill5-cb-head", "unimation/puma560"];
    let mut out: Vec<(Machine, Vec<f64>)> = ids
        .into_iter()
        .map(|id| {
            let m = gr_machine::builtin(id).unwrap_or_else(|| panic!("there is no machine {id}"));
            let q = (0..m.joints.len())
                .map(|i| if m.joints[i].kind == gr_machine::JointKind::Prismatic { 40.0 + 10.0 * i as f64 } else { some[i % 6] })
                .collect();
            (m, q)
        })
        .collect();
    let two = gr_machine::builtin("usp/2ups-prp").unwrap();
    let q = two.kinematics().inverse(&gr_machine::Pose { position: [820.0, 90.0, 130.0], rotation: [0.0; 3] }).unwrap();
    out.push((two, q[0].joints.clone()));
    out
}

#[test]
fn velocities_are_differences() {
    for (m, q) in machines() {
        let k = m.kinematics();
        let here = k.forward_frame(&q).unwrap();
        let columns = differential::velocity(&m, &q).unwrap();
        for i in 0..q.len() {
            let h = 1e-5 * q[i].abs().max(1.0);
            let (mut a, mut b) = (q.clone(), q.clone());
            (a[i], b[i]) = (q[i] + h, q[i] - h);
            let d = difference(&near(&*k, &a, &here), &near(&*k, &b, &here)).map(|v| v / (2.0 * h));
            for axis in 0..6 {
                assert!((d[axis] - columns[i][axis]).abs() < 1e-5 * columns[i][axis].abs().max(10.0), "{} joint {i} axis {axis}: {} {}", m.id, d[axis], columns[i][axis]);
            }
        }
    }
}

/// The machine is built with one number changed a little; its tool moves as the column says.
#[test]
fn parameter_columns_are_what_a_changed_machine_does() {
    for (m, q) in machines() {
        let here = m.kinematics().forward_frame(&q).unwrap();
        let columns = parameter_columns(&m, &q).unwrap();
        let names = m.parameters();
        assert_eq!(columns.len(), names.len(), "{}", m.id);
        for (i, p) in names.iter().enumerate() {
            let h = if p.kind == gr_machine::ParameterKind::Length { 1e-3 } else { 1e-6 };
            let mut deviation = vec![0.0; names.len()];
            deviation[i] = h;
            let moved = near(&*m.deviated(&deviation), &q, &here);
            let d = difference(&moved, &here);
            for axis in 0..6 {
                let said = columns[i][axis] * h;
                assert!((d[axis] - said).abs() < 2e-4 * said.abs().max(h * 10.0), "{} {} axis {axis}: {} {said}", m.id, p.name, d[axis]);
            }
        }
    }
}

/// A tricept of made-up size: the columns come from its inverse.
#[test]
fn tricept_by_its_inverse() {
    let file = "format = 1\nid = \"test/tricept\"\nextends = \"comau/tricept806\"\n[kinematics]\nkind = \"tricept\"\nbase_radius = 400\nplatform_radius = 150\nwrist_offset = 300\nflange_offset = 200\n";
    let m = gr_machine::parse(gr_text::FileId(0), file).unwrap_or_else(|e| panic!("{e:#?}"));
    let Chain::Tricept(_) = m.chain else { panic!() };
    let k = m.kinematics();
    let aim = Frame::new([120.0, -80.0, -1500.0], [0.15, -0.1, 0.4]);
    let q = &k.inverse_frame(&aim).expect("within reach")[0].joints;
    let start = k.forward_frame(q).expect("it stands there");
    let (p, r) = start.error_to(&aim);
    assert!(norm(p) < 1e-6 && norm(r) < 1e-8, "{p:?} {r:?}");
    let columns = differential::velocity(&m, q).unwrap();
    assert_eq!(columns.len(), 6);
    for i in 0..6 {
        // Central differences: their own error is of the order of h².
        let h = 1e-3;
        let at = |by: f64| {
            let mut a = q.clone();
            a[i] += by;
            k.forward_frame(&a).expect("close by")
        };
        let (ahead, behind) = (difference(&at(h), &start), difference(&at(-h), &start));
        for axis in 0..6 {
            let (d, said) = ((ahead[axis] - behind[axis]) / (2.0 * h), columns[i][axis]);
            assert!((d - said).abs() < 1e-5 * said.abs().max(1.0), "joint {i} axis {axis}: {d} {said}");
        }
    }
    assert_eq!(parameter_columns(&m, q).unwrap().len(), m.parameters().len());
}
