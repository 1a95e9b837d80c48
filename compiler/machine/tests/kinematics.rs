//! Every machine of the library: inverse and forward agree, errors are values, published examples come out.

use gr_machine::math::{Frame, norm};
use gr_machine::{Chain, Control, Kinematics, KinematicsError, Machine, Pose, builtin, differential, list};
use gr_text::FileId;
use proptest::prelude::*;

/// A joint value within the limits for a number in 0 … 1.
fn within(machine: &Machine, unit: &[f64]) -> Vec<f64> {
    let place = |(j, u): (&gr_machine::Joint, &f64)| {
        let wide = if j.kind == gr_machine::JointKind::Revolute { std::f64::consts::PI } else { 500.0 };
        let (min, max) = (j.min.unwrap_or(-wide).max(-wide), j.max.unwrap_or(wide).min(wide));
        min + (max - min) * u
    };
    machine.joints.iter().zip(unit).map(place).collect()
}

/// Shift in mm and turn in rad between where the joints put the tool and where it should be.
fn miss(k: &dyn Kinematics, joints: &[f64], aim: &Frame) -> (f64, f64) {
    let here = k.forward_frame(joints).unwrap();
    let (p, r) = here.error_to(aim);
    let axis = norm(gr_machine::math::cross(here.axis(2), aim.axis(2)));
    let turn = match k.control() {
        Control::Full => norm(r),
        Control::Axis => axis,
        Control::Position => 0.0,
    };
    (norm(p), turn)
}

fn synthetic_tricept() -> Machine {
    let text = "format = 1\nid = \"test/tricept\"\nextends = \"comau/tricept806\"\n[kinematics]\nplatform_radius = 225\nwrist_offset = 350\nflange_offset = 180\n";
    gr_machine::parse(FileId(0), text).unwrap()
}

/// Machines with a closed form, and a template filled in.
fn closed() -> Vec<Machine> {
    let mut all: Vec<Machine> = list().map(|id| builtin(id).unwrap()).collect();
    all.retain(|m| !matches!(m.chain, Chain::Serial(_) | Chain::Incomplete { .. }));
    all.push(synthetic_tricept());
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn inverse_leads_back_on_every_machine(unit in prop::collection::vec(0.0f64..1.0, 9)) {
        for machine in closed() {
            let k = machine.kinematics();
            let joints = match &machine.chain {
                // A parallel machine: not every set of leg lengths can be put together, so start from a place.
                Chain::TwoLegs(m) => m.lengths([604.1 + 449.5 * unit[0], 1.1 * (unit[1] - 0.5), 1200.0 * (unit[2] - 0.5)]).to_vec(),
                Chain::Tricept(m) => {
                    let legs = m.legs([unit[0] - 0.5, unit[1] - 0.5, 700.0 + 700.0 * unit[2]]);
                    let mut all = legs.to_vec();
                    all.extend(unit[3..6].iter().map(|u| 6.0 * (u - 0.5)));
                    all
                }
                _ => within(&machine, &unit),
            };
            let aim = match k.forward_frame(&joints) {
                Ok(aim) => aim,
                Err(KinematicsError::Ambiguous { .. }) => continue,
                Err(e) => return Err(TestCaseError::fail(format!("{}: {e}", machine.id))),
            };
            let all = match k.inverse_frame(&aim) {
                Ok(all) => all,
                Err(e) => { prop_assert!(e == KinematicsError::Singular, "{}: {e} at {joints:?}", machine.id); continue }
            };
            for s in &all {
                let (p, r) = miss(k.as_ref(), &s.joints, &aim);
                prop_assert!(p < 1e-8 && r < 1e-9, "{} branch {}: {p} mm, {r} rad at {joints:?}", machine.id, s.branch);
            }
            const TURN: f64 = 2.0 * std::f64::consts::PI;
            let same = |s: &gr_machine::Solution| s.joints.iter().zip(&joints).zip(&machine.joints).all(|((a, b), j)| {
                let d = if j.kind == gr_machine::JointKind::Revolute { (a - b) - TURN * ((a - b) / TURN).round() } else { a - b };
                d.abs() < 1e-5
            });
            prop_assert!(all.iter().any(same) || all.iter().all(|s| s.singular), "{}: {joints:?} is not among {all:?}", machine.id);
        }
    }

    #[test]
    fn numbers_stay_finite(v in prop::collection::vec(any::<f64>(), 9), small in prop::collection::vec(-2000.0f64..2000.0, 9)) {
        for machine in closed() {
            let k = machine.kinematics();
            for p in [&v, &small] {
                let pose = Pose { position: [p[0], p[1], p[2]], rotation: [p[3], p[4], p[5]] };
                if let Ok(all) = k.inverse(&pose) {
                    prop_assert!(all.iter().flat_map(|s| &s.joints).all(|j| j.is_finite()), "{} {pose:?}", machine.id);
                }
                if let Ok(pose) = k.forward(&p[..machine.joints.len()]) {
                    let wild = p.iter().any(|x| x.abs() > 1e150);
                    prop_assert!(wild || pose.coordinates().iter().all(|j| j.is_finite()), "{} {pose:?}", machine.id);
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn search_finds_poses_of_a_chain(unit in prop::collection::vec(0.1f64..0.9, 6)) {
        for machine in [builtin("unimation/puma560").unwrap(), gr_machine::reference("abb/irb140").unwrap()] {
            let k = machine.kinematics();
            let aim = k.forward_frame(&within(&machine, &unit)).unwrap();
            let all = k.inverse_frame(&aim).unwrap();
            for s in all {
                let (p, r) = miss(k.as_ref(), &s.joints, &aim);
                prop_assert!(p < 1e-6 && r < 1e-6, "{p} {r}");
                prop_assert!(machine.outside(&s.joints).is_empty());
            }
        }
    }
}

#[test]
fn search_says_what_is_left_over() {
    let machine = builtin("unimation/puma560").unwrap();
    let far = Frame::shift([9000.0, 0.0, 0.0]);
    assert!(matches!(machine.kinematics().inverse_frame(&far), Err(KinematicsError::NotFound { distance, .. }) if distance > 5000.0));
}

#[test]
fn singular_poses_have_a_stated_solution() {
    let machine = builtin("abb/irb2400").unwrap();
    let k = machine.kinematics();
    // Wrist stretched, elbow stretched, wrist over the first axis, and combinations.
    let elbow = libm::atan2(135.0, 755.0);
    for q in [
        [0.3, 0.2, 0.4, 0.5, 0.0, 0.7],
        [0.3, 0.2, 0.4, 0.5, 1e-13, 0.7],
        [0.3, 0.2, 0.4, 0.5, 1e-9, 0.7],
        [0.3, 0.2, 0.4, 0.5, 1e-6, 0.7],
        [0.3, 0.2, elbow - std::f64::consts::FRAC_PI_2, 0.5, 0.9, 0.7],
        [0.3, 0.2, -elbow - std::f64::consts::FRAC_PI_2, 0.5, 0.9, 0.7],
        [0.0; 6],
    ] {
        let aim = k.forward_frame(&q).unwrap();
        let all = k.inverse_frame(&aim).unwrap();
        assert!(!all.is_empty());
        for s in &all {
            let (p, r) = miss(k.as_ref(), &s.joints, &aim);
            assert!(p < 1e-7 && r < 1e-11, "{q:?} branch {}: {p} {r}", s.branch);
        }
    }
    assert!(k.inverse_frame(&k.forward_frame(&[0.3, 0.2, 0.4, 0.5, 0.0, 0.7]).unwrap()).unwrap().iter().all(|s| s.branch >= 2 || s.singular));
    assert!(matches!(k.inverse_frame(&Frame::shift([9e3, 0.0, 0.0])), Err(KinematicsError::OutOfReach { .. })));
}

#[test]
fn twenty_thousand_poses_of_an_arm() {
    let machine = builtin("abb/irb2400").unwrap();
    let Chain::Opw(arm) = machine.chain.clone() else { panic!("an arm") };
    let (mut state, mut worst) = (1u64, 0.0f64);
    for _ in 0..20_000 {
        let unit: Vec<f64> = (0..6)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1u64 << 53) as f64
            })
            .collect();
        let q: [f64; 6] = within(&machine, &unit).try_into().unwrap();
        let aim = arm.flange(&q);
        let all = arm.solve(&aim);
        let mut found = false;
        for i in (0..8).filter(|i| all.good & (1 << i) != 0) {
            let back = arm.flange(&all.joints[i]);
            let (p, r) = back.error_to(&aim);
            worst = worst.max(norm(p));
            assert!(norm(p) < 1e-9 && norm(r) < 1e-11, "{q:?} {p:?} {r:?}");
            const TURN: f64 = 2.0 * std::f64::consts::PI;
            found |= all.joints[i].iter().zip(&q).all(|(a, b)| ((a - b) - TURN * ((a - b) / TURN).round()).abs() < 1e-6);
        }
        assert!(found, "{q:?} {all:?}");
    }
    assert!(worst < 1e-9, "{worst} mm");
}

#[test]
fn home_poses_of_the_publications() {
    let arm = builtin("abb/irb140").unwrap();
    let home = arm.kinematics().forward_frame(&[0.0; 6]).unwrap();
    assert!(norm(gr_machine::math::sub(home.position, [515.0, 0.0, 712.0])) < 1e-9);
    assert!((home.axis(2)[0] - 1.0).abs() < 1e-12);
    let chain = gr_machine::reference("abb/irb140").unwrap();
    for q in [[0.0; 6], [0.1, -0.4, 0.3, 0.0, 0.0, 0.0]] {
        let (p, _) = arm.kinematics().forward_frame(&q).unwrap().error_to(&chain.kinematics().forward_frame(&q).unwrap());
        // The thesis turns the wrist the other way: the same place with a straight one.
        assert!(norm(p) < 1e-9, "{q:?}: {p:?}");
    }
    let scara = builtin("adept/one").unwrap();
    let zero = scara.kinematics().forward_frame(&[0.0; 4]).unwrap();
    assert!(norm(gr_machine::math::sub(zero.position, [799.846, 0.0, 876.808])) < 1e-9);
    assert!((zero.axis(2)[2] + 1.0).abs() < 1e-12);
}

#[test]
fn first_point_of_the_scara_run() {
    // Part 1, point 1: (0,0,30) in the part, table at 300 300 745, part at 0 10 0.
    let k = builtin("adept/one").unwrap().kinematics();
    let aim = Frame::new([300.0, 310.0, 775.0], [std::f64::consts::PI, 0.0, 0.0]);
    let all = k.inverse_frame(&aim).unwrap();
    let near = |s: &gr_machine::Solution| (s.joints[0].to_degrees() + 5.98).abs() < 0.01 && (s.joints[1].to_degrees() - 115.07).abs() < 0.01 && (s.joints[2] - 101.808).abs() < 1e-6;
    assert!(all.iter().any(near), "{all:?}");
}

#[test]
fn first_point_of_the_six_axis_run() {
    // Part 1, point 1: (0,0,30) in the part, table at 400 −200 500, part at 0 10 0, tool down.
    let machine = builtin("abb/irb140").unwrap();
    let k = machine.kinematics();
    let aim = Frame::new([400.0, -190.0, 530.0], [std::f64::consts::PI, 0.0, 0.0]);
    let want = [(0, -25.41), (1, 1.79), (2, 16.12), (3, 0.0), (4, 72.10)];
    let near = |s: &gr_machine::Solution| want.iter().all(|(i, v)| (s.joints[*i].to_degrees() - v).abs() < 0.01);
    let all = k.inverse_frame(&aim).unwrap();
    assert!(all.iter().any(near), "{all:?}");
    // The publication's own rows put the flange at the same place for the first three joints.
    let rows = gr_machine::reference("abb/irb140").unwrap();
    let q = [0.4, -0.3, 0.2, 0.0, 0.0, 0.0];
    let (p, _) = k.forward_frame(&q).unwrap().error_to(&rows.kinematics().forward_frame(&q).unwrap());
    assert!(norm(p) < 1e-9, "{p:?}");
}

#[test]
fn parallel_machine_as_published() {
    use gr_machine::{SphericalAxis, TwoLegs, TwoLegsShape};
    // Chapter 5's example, in mm: R = 1 m, 30°, ls = 0.5, lu = 1.
    let shape = TwoLegsShape {
        base: [[0.0, 1000.0, 0.0], [0.0, -1000.0, 0.0]],
        platform: [[0.0, 500.0, 0.0], [0.0, -500.0, 0.0]],
        arm: (100.0, 2000.0),
        yaw: (-3.0, 3.0),
        legs: [(0.0, 9999.0); 2],
        column: (-1.0, 1.0),
        universal: 3.0,
        spherical: 3.0,
        spherical_axis: SphericalAxis::Platform,
        reference: [1000.0, 0.0, 0.0],
    };
    let machine = TwoLegs { shape };
    let h = machine.lengths([1000.0, 30f64.to_radians(), 0.0]);
    assert!((h[0] - 620.0).abs() < 0.5 && (h[1] - 1544.0).abs() < 0.5, "{h:?}");
    let all = machine.assemblies(h);
    assert_eq!(all.len(), 2, "{all:?}");
    assert!((all[0][0] - 1000.0).abs() < 1e-9 && (all[0][1] - 30f64.to_radians()).abs() < 1e-12);
    assert!((all[1][0] - 503.618).abs() < 1e-3 && (all[1][1].to_degrees() - 83.13).abs() < 0.01);
    assert_eq!(machine.forward(&h), Err(KinematicsError::Ambiguous { count: 2 }));
    assert_eq!(machine.violations(&h).iter().map(|v| (v.name, v.value)).collect::<Vec<_>>(), [("assembly", 2.0)]);
    let narrow = TwoLegs { shape: TwoLegsShape { arm: (604.1, 2000.0), ..machine.shape.clone() } };
    assert!((narrow.forward(&h).unwrap().rotation[2] - 30f64.to_radians()).abs() < 1e-12);
    assert!(narrow.violations(&h).is_empty());
}

fn nodes(machine: &Machine, height: f64) -> (usize, f64) {
    let Chain::TwoLegs(m) = &machine.chain else { panic!("two legs") };
    let yaw = 34f64.to_radians();
    let (x0, x1, y1) = (604.1 * libm::cos(yaw), 1053.6, 1053.6 * libm::sin(yaw));
    let nx = ((x1 - x0) / 5.0 + 0.5) as usize;
    let ny = (2.0 * y1 / 5.0 + 0.5) as usize;
    let ny = ny + ny % 2;
    let mut count = 0;
    for i in 0..=nx {
        for j in 0..=ny {
            let (x, y) = (x0 + i as f64 * (x1 - x0) / nx as f64, -y1 + j as f64 * 2.0 * y1 / ny as f64);
            count += usize::from(m.broken([libm::hypot(x, y), libm::atan2(y, x), height]).is_empty());
        }
    }
    (count, count as f64 * (x1 - x0) / nx as f64 * 2.0 * y1 / ny as f64 / 1e4)
}

#[test]
fn work_space_of_the_parallel_machine() {
    let published = gr_machine::reference("usp/2ups-prp").unwrap();
    let default = builtin("usp/2ups-prp").unwrap();
    let rows = [(0.0, 9188, 22.930), (120.0, 9191, 23.052), (240.0, 8998, 23.189), (360.0, 7948, 22.890), (480.0, 4416, 14.252), (600.0, 461, 1.325)];
    for (height, count, area) in rows {
        assert_eq!(nodes(&published, height).0, count, "H = {height}");
        assert!((nodes(&default, height).1 - area).abs() < 5e-4, "H = {height}: {}", nodes(&default, height).1);
    }
}

#[test]
fn conditions_have_names() {
    let machine = builtin("usp/2ups-prp").unwrap();
    let Chain::TwoLegs(m) = &machine.chain else { panic!("two legs") };
    let names = |at: [f64; 3]| m.broken(at).into_iter().map(|v| v.name).collect::<Vec<_>>();
    assert!(names([828.85, 0.0, 0.0]).is_empty());
    assert_eq!(names([828.85, 0.0, 700.0]).first(), Some(&"column-high"));
    assert!(names([600.0, 0.0, 0.0]).contains(&"arm-short"));
    assert!(names([828.85, 0.7, 0.0]).contains(&"yaw-high"));
    assert!(names([1050.0, 0.55, 0.0]).contains(&"leg-2-long"));
}

#[test]
fn leg_lengths_as_published() {
    // Table 9.2, simplified machine: ls = 200, lu = 400.
    let Chain::TwoLegs(m) = builtin("usp/2ups-prp").unwrap().chain else { panic!("two legs") };
    let mut plain = (*m).clone();
    plain.shape.base = [[0.0, 400.0, 0.0], [0.0, -400.0, 0.0]];
    plain.shape.platform = [[0.0, 200.0, 0.0], [0.0, -200.0, 0.0]];
    let h = plain.lengths([605.0, 0.0, 0.0]);
    assert!((h[0] - 637.201).abs() < 5e-4 && (h[1] - 637.201).abs() < 5e-4);
    let (reach, turn) = (libm::hypot(505.0, 205.0), libm::atan2(205.0, 505.0));
    assert!((reach - 545.023).abs() < 5e-4 && (turn.to_degrees() - 22.094).abs() < 5e-4);
    let h = plain.lengths([reach, turn, 0.0]);
    assert!((h[0] - 429.883).abs() < 5e-4 && (h[1] - 716.100).abs() < 5e-4);
    // A plunge of 100 mm lengthens both legs.
    let h = m.lengths([800.0, 0.0, 100.0]);
    assert!((h[0] - 1049.1067629178644).abs() < 1e-9 && (h[1] - 1049.1067629178644).abs() < 1e-9);
    // Too far out: the arm is named, whatever the legs say.
    let h = m.lengths([1100.0, 0.0, 0.0]);
    assert!(m.violations(&h).iter().any(|v| v.name == "arm-long"));
}

/// The published example of the forward problem has six roots, R = ±1, ±0.504 and ±0.993i: its equation in x = R², with
/// the lengths that the inverse gives at R = 1 and 30 degrees.
#[test]
fn roots_as_published() {
    let Chain::TwoLegs(m) = builtin("usp/2ups-prp").unwrap().chain else { panic!("two legs") };
    let mut plain = (*m).clone();
    let (a, b) = (0.5, 1.0);
    plain.shape.base = [[0.0, b, 0.0], [0.0, -b, 0.0]];
    plain.shape.platform = [[0.0, a, 0.0], [0.0, -a, 0.0]];
    let h = plain.lengths([1.0, 30f64.to_radians(), 0.0]);
    assert!((h[0] - 0.620).abs() < 5e-4 && (h[1] - 1.544).abs() < 5e-4, "{h:?}");
    let (d, m2) = (h[1] * h[1] - h[0] * h[0], 2.0 * (a * a + b * b) - h[0] * h[0] - h[1] * h[1]);
    let f = |x: f64| (2.0 * x + m2).powi(2) * x * b * b + d * d * a * a * b * b - 16.0 * a * a * b * b * x * b * b;
    let root = |mut low: f64, mut high: f64| {
        assert!(f(low) * f(high) < 0.0);
        for _ in 0..80 {
            let mid = (low + high) / 2.0;
            if f(low) * f(mid) <= 0.0 { high = mid } else { low = mid }
        }
        low
    };
    assert!((root(0.9, 1.5).sqrt() - 1.0).abs() < 1e-9);
    assert!((root(0.1, 0.5).sqrt() - 0.503618).abs() < 5e-7);
    assert!(((-root(-3.0, -0.1)).sqrt() - 0.993).abs() < 5e-4);
}

#[test]
fn tricept_is_a_template() {
    let template = builtin("comau/tricept806").unwrap();
    let k = template.kinematics();
    assert_eq!(k.joint_count(), 6);
    assert!(matches!(k.forward(&[0.0; 6]), Err(KinematicsError::Incomplete(keys)) if keys == ["platform_radius", "wrist_offset", "flange_offset"]));
    let machine = synthetic_tricept();
    let Chain::Tricept(m) = &machine.chain else { panic!("tricept") };
    // Hanging straight: three equal legs.
    let legs = m.legs([0.0, 0.0, 1000.0]);
    let want = libm::hypot(275.0, 1000.0);
    assert!(legs.iter().all(|l| (l - want).abs() < 1e-9), "{legs:?}");
    // Straight down, the publication's equations and the rigid platform agree; tilted, they don't.
    let published = gr_machine::Tricept { reference: true, ..*m };
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-9);
    assert!(near(published.legs([0.0, 0.0, 1000.0]), legs));
    assert!(!near(published.legs([0.3, 0.2, 1000.0]), m.legs([0.3, 0.2, 1000.0])));
}

#[test]
fn five_axis_tool_point() {
    // A/C table about a point at z = −350: at A 90° the part's Y axis points along the spindle.
    let machine = builtin("generic/mill5-ac-table").unwrap();
    let k = machine.kinematics();
    let quarter = std::f64::consts::FRAC_PI_2;
    let pose = k.forward_frame(&[10.0, 20.0, 30.0, quarter, 0.0]).unwrap();
    // The tool at (20, 380) from the axis, turned by A about X.
    assert!(norm(gr_machine::math::sub(pose.position, [10.0, -380.0, -330.0])) < 1e-9, "{pose:?}");
    assert!((pose.axis(2)[1] + 1.0).abs() < 1e-12);
    // Tool point control: with the tool's length on the head, the tip stays where it is while the head turns.
    let head = builtin("generic/mill5-cb-head").unwrap();
    let k = head.kinematics();
    let tool = Frame::shift([0.0, 0.0, -80.0]);
    let tip = Frame::new([100.0, 50.0, -200.0], [0.0, 0.4, 0.3]);
    for s in k.inverse_frame(&tip.then(&tool.inverse())).unwrap() {
        let back = k.forward_frame(&s.joints).unwrap().then(&tool);
        assert!(norm(gr_machine::math::sub(back.position, tip.position)) < 1e-9);
    }
    assert_eq!(k.inverse_frame(&tip.then(&tool.inverse())).unwrap().len(), 2);
}

#[test]
fn planar_arm_of_the_textbook() {
    let arm = gr_machine::Planar3r::new([1000.0; 3]);
    let p = arm.forward(&[30f64.to_radians(), 40f64.to_radians(), 50f64.to_radians()]).unwrap();
    assert!((p.position[0] - 708.045547110).abs() < 1e-6 && (p.position[1] - 2305.718024570).abs() < 1e-6);
    assert!((p.rotation[2].to_degrees() - 120.0).abs() < 1e-12);
}

#[test]
fn closed_form_jacobian_equals_differences() {
    let machine = builtin("unimation/puma560").unwrap();
    let Chain::Serial(chain) = &machine.chain else { panic!("chain") };
    let q = [0.2, -0.5, 0.8, 0.4, 0.6, -0.3];
    let (a, b) = (chain.jacobian(&q).unwrap(), differential::jacobian(chain, &q).unwrap());
    for (p, r) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!((p - r).abs() < 1e-5, "{p} {r}");
    }
    assert!(differential::condition(&a, 400.0).is_finite());
    let stretched = chain.jacobian(&[0.2, -0.5, 0.8, 0.4, 0.0, -0.3]).unwrap();
    assert!(differential::condition(&stretched, 400.0).is_infinite());
    assert!(differential::manipulability(&stretched, 400.0) < 1e-3 * differential::manipulability(&a, 400.0));
}

#[test]
fn coupled_joints_are_tested_both_ways() {
    let machine = builtin("fanuc/lr-mate-200id").unwrap();
    let q = [0.0, 1.0, 0.5, 0.0, 0.0, 0.0];
    let c = machine.controller_values(&q);
    assert!((c[2] + 0.5).abs() < 1e-12);
    assert_eq!(machine.joint_values(&c), q);
    // J3 itself is inside its limits, what the controller counts is not.
    let q = [0.0, 100f64.to_radians(), -60f64.to_radians(), 0.0, 0.0, 0.0];
    assert_eq!(machine.outside(&q).len(), 1);
}

#[test]
fn arms_are_recognised_from_their_joint_frames() {
    for id in ["abb/irb2400", "kuka/kr16-2", "fanuc/m-10ia", "staubli/tx90", "kawasaki/rs020n"] {
        let machine = builtin(id).unwrap();
        let Chain::Opw(arm) = &machine.chain else { panic!("arm") };
        let chain = chain_of(arm);
        let fit = gr_machine::identify(&chain).unwrap_or_else(|e| panic!("{id}: {e}"));
        assert!(fit.residual < 1e-9, "{id}");
        for (a, b) in fit.arm.lengths().iter().zip(arm.lengths()) {
            assert!((a.abs() - b.abs()).abs() < 1e-9, "{id}: {:?} {:?}", fit.arm.lengths(), arm.lengths());
        }
    }
    let puma = builtin("unimation/puma560").unwrap();
    let Chain::Serial(chain) = &puma.chain else { panic!("chain") };
    assert!(gr_machine::identify(chain).is_ok());
    let rows = [(0.0, 89.0, 90.0), (-425.0, 0.0, 0.0), (-392.0, 0.0, 0.0), (0.0, 109.0, 90.0), (0.0, 95.0, -90.0), (0.0, 82.0, 0.0)];
    let rows = rows.map(|(a, d, alpha): (f64, f64, f64)| {
        (gr_machine::DhRow { a, d, alpha: alpha.to_radians(), theta: 0.0 }, gr_machine::JointKind::Revolute, (-6.3, 6.3))
    });
    let ur = gr_machine::Serial::dh(&rows);
    assert!(gr_machine::identify(&ur).unwrap_err().contains("parallel"));
}

/// The joint frames of an arm, read off its axes at zero as a URDF would give them.
fn chain_of(arm: &gr_machine::Opw) -> gr_machine::Serial {
    use gr_machine::Link;
    let [a1, a2, b, c1, c2, c3, c4] = arm.lengths();
    let place = |x, y, z| [x, y, z];
    let points = [place(0.0, 0.0, 0.0), place(a1, b, c1), place(0.0, 0.0, c2), place(a2, 0.0, c3), place(0.0, 0.0, 0.0), place(0.0, 0.0, 0.0)];
    let (y, z) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let axes = [z, y, y, z, y, z];
    let links = (0..6)
        .map(|i| {
            // The model angle at joint value 0 is −offset: it belongs to the joint's own frame.
            let turn = gr_machine::math::about(axes[i], -arm.offsets()[i]);
            let axis = axes[i].map(|v| v * arm.signs()[i]);
            Link { origin: Frame { turn, position: points[i] }, axis, kind: gr_machine::JointKind::Revolute, limits: (-9.0, 9.0) }
        })
        .collect();
    gr_machine::Serial::new(links, Frame::shift([0.0, 0.0, c4]))
}

#[test]
fn offset_wrist_equals_its_rows() {
    for (id, l) in [("universal-robots/ur5", [89.159, -425.0, -392.25, 109.15, 94.65, 82.3]), ("universal-robots/ur10e", [180.7, -612.7, -571.55, 174.15, 119.85, 116.55])] {
        let machine = builtin(id).unwrap();
        let quarter = std::f64::consts::FRAC_PI_2;
        let row = |a, d, alpha| (gr_machine::DhRow { a, d, alpha, theta: 0.0 }, gr_machine::JointKind::Revolute, (-7.0, 7.0));
        let chain = gr_machine::Serial::dh(&[row(0.0, l[0], quarter), row(l[1], 0.0, 0.0), row(l[2], 0.0, 0.0), row(0.0, l[3], quarter), row(0.0, l[4], -quarter), row(0.0, l[5], 0.0)]);
        let q = [0.3, -1.1, 0.7, 0.2, 1.4, -0.6];
        let (p, r) = machine.kinematics().forward_frame(&q).unwrap().error_to(&chain.forward_frame(&q).unwrap());
        assert!(norm(p) < 1e-9 && norm(r) < 1e-12, "{id} {p:?} {r:?}");
        assert_eq!(machine.kinematics().inverse_frame(&chain.forward_frame(&q).unwrap()).unwrap().len(), 8);
    }
}
