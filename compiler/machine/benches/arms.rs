//! Time of one forward and one inverse solution.

use gr_machine::math::Frame;
use gr_machine::{Chain, Opw, builtin};

fn main() {
    divan::main();
}

fn arm() -> Opw {
    let Chain::Opw(arm) = builtin("abb/irb2400").expect("in the library").chain else { panic!("an arm") };
    arm
}

/// Poses inside the limits, always the same ones.
fn poses() -> Vec<([f64; 6], Frame)> {
    let arm = arm();
    let angle = |n: usize, i: usize| libm::sin((n * 13 + i * 7 + 1) as f64) * [3.0, 1.5, 1.0, 3.0, 2.0, 3.0][i];
    (0..1024).map(|n| std::array::from_fn(|i| angle(n, i))).map(|q| (q, arm.flange(&q))).collect()
}

#[divan::bench]
fn opw_inverse_all_solutions(bencher: divan::Bencher<'_, '_>) {
    let (arm, poses) = (arm(), poses());
    bencher.counter(divan::counter::ItemsCount::new(poses.len())).bench(|| poses.iter().fold(0u32, |n, (_, f)| n + u32::from(divan::black_box(arm.solve(f)).good)));
}

#[divan::bench]
fn opw_forward(bencher: divan::Bencher<'_, '_>) {
    let (arm, poses) = (arm(), poses());
    bencher.counter(divan::counter::ItemsCount::new(poses.len())).bench(|| poses.iter().fold(0.0, |n, (q, _)| n + divan::black_box(arm.flange(q)).position[0]));
}

#[divan::bench]
fn offset_wrist_inverse(bencher: divan::Bencher<'_, '_>) {
    let machine = builtin("universal-robots/ur5").expect("in the library").kinematics();
    let aim = machine.forward_frame(&[0.3, -1.1, 0.7, 0.2, 1.4, -0.6]).expect("six joints");
    bencher.bench(|| machine.inverse_frame(divan::black_box(&aim)).map(|all| all.len()));
}

#[divan::bench]
fn two_legs_forward(bencher: divan::Bencher<'_, '_>) {
    let machine = builtin("usp/2ups-prp").expect("in the library").kinematics();
    bencher.bench(|| machine.forward(divan::black_box(&[1000.0, 980.0, 50.0])));
}
