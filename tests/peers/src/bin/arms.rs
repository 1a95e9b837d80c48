//! Times the inverse of a six-axis arm with spherical wrist (ABB IRB 2400, all solutions) and its forward solution beside
//! public crates: the same 20 000 joint sets, the same build, one run, one thread, medians of processor time.

use std::hint::black_box;

use gr_machine::math::Frame;
use gr_machine::{Chain, Opw, builtin};
use nalgebra_032::{Matrix3, Vector3};

const POSES: usize = 20_000;
const RUNS: usize = 7;

/// Processor time of this thread, s.
fn now() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

/// Median time of one call, ns.
fn median(mut work: impl FnMut()) -> f64 {
    work();
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let from = now();
            work();
            now() - from
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2] / POSES as f64 * 1e9
}

fn arm() -> Opw {
    let Chain::Opw(arm) = builtin("abb/irb2400").expect("in the library").chain else { panic!("an arm") };
    arm
}

/// Joint sets inside of the limits, always the same ones.
fn joint_sets() -> Vec<[f64; 6]> {
    let mut state = 1u64;
    let mut next = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let limits: [[f64; 2]; 6] = [[-180.0, 180.0], [-100.0, 110.0], [-60.0, 65.0], [-200.0, 200.0], [-120.0, 120.0], [-180.0, 180.0]];
    (0..POSES).map(|_| limits.map(|[a, b]| (a + (b - a) * next()).to_radians())).collect()
}

/// Whether one of the solutions is the joint set that made the pose, turns apart.
fn holds<'a>(solutions: impl IntoIterator<Item = &'a [f64; 6]>, joints: &[f64; 6]) -> bool {
    let off = |d: f64| turned(d).abs();
    solutions.into_iter().any(|s| s.iter().zip(joints).all(|(a, b)| off(a - b) < 1e-6))
}

fn turned(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}

fn row(name: &str, ns: f64, ours: f64, found: usize) {
    println!("{name:<34} {ns:8.0} ns {:9.2} M/s {:7.2} x {found:>6} of {POSES}", 1e3 / ns, ns / ours);
}

fn main() {
    let (arm, joints) = (arm(), joint_sets());
    let frames: Vec<Frame> = joints.iter().map(|q| arm.flange(q)).collect();
    println!("inverse, all solutions             time a call    calls     to us  joint set found");
    let ours = median(|| frames.iter().for_each(|f| _ = black_box(arm.solve(black_box(f)))));
    let found = joints.iter().zip(&frames).filter(|(q, f)| holds(arm.solve(f).joints.iter(), q)).count();
    row("gr-machine", ours, ours, found);
    opw(&joints, ours);
    geo(&arm, &joints, &frames, ours);
    println!("forward");
    let ours = median(|| joints.iter().for_each(|q| _ = black_box(arm.flange(black_box(q)))));
    row("gr-machine", ours, ours, POSES);
    let peer = rs_opw();
    use rs_opw_kinematics::kinematic_traits::Kinematics;
    row("rs-opw-kinematics 3.0.0", median(|| joints.iter().for_each(|q| _ = black_box(peer.forward(black_box(q))))), ours, POSES);
}

fn rs_opw() -> rs_opw_kinematics::kinematics_impl::OPWKinematics {
    use rs_opw_kinematics::parameters::opw_kinematics::Parameters;
    rs_opw_kinematics::kinematics_impl::OPWKinematics::new(Parameters::irb2400_10())
}

fn opw(joints: &[[f64; 6]], ours: f64) {
    use rs_opw_kinematics::kinematic_traits::Kinematics;
    let peer = rs_opw();
    let poses: Vec<_> = joints.iter().map(|q| peer.forward(q)).collect();
    let ns = median(|| poses.iter().for_each(|p| drop(black_box(peer.inverse(black_box(p))))));
    let found = joints.iter().zip(&poses).filter(|(q, p)| holds(peer.inverse(p).iter(), q)).count();
    row("rs-opw-kinematics 3.0.0", ns, ours, found);
}

/// The arm as axes and lengths of the zero position, m.
fn geo(arm: &Opw, joints: &[[f64; 6]], frames: &[Frame], ours: f64) {
    use ik_geo::inverse_kinematics::auxiliary::Kinematics;
    use ik_geo::robot::{IKSolver, Robot};
    let zero = arm.flange(&[0.0; 6]);
    let axis = |f: &Frame| Vector3::new(f.turn[0][2], f.turn[1][2], f.turn[2][2]);
    let [a1, _, _, c1, c2, _, c4] = arm.lengths().map(|l| l * 1e-3);
    let out = axis(&zero);
    let tip = Vector3::from(zero.position) * 1e-3;
    let elbow = Vector3::new(a1, 0.0, c1 + c2);
    let (y, z) = (Vector3::y(), Vector3::z());
    let mut chain = Kinematics::<6, 7>::new();
    for (n, h) in [z, y, y, out, y, out].into_iter().enumerate() {
        chain.h.set_column(n, &h);
    }
    let p = [Vector3::zeros(), Vector3::new(a1, 0.0, c1), z * c2, tip - out * c4 - elbow, Vector3::zeros(), Vector3::zeros(), out * c4];
    for (n, p) in p.into_iter().enumerate() {
        chain.p.set_column(n, &p);
    }
    let robot = Robot::spherical_two_parallel(chain);
    let turn = |f: &Frame| Matrix3::from_fn(|i, j| f.turn[i][j]);
    let back = turn(&zero).transpose();
    let poses: Vec<_> = frames.iter().map(|f| (turn(f) * back, Vector3::from(f.position) * 1e-3)).collect();
    let ns = median(|| poses.iter().for_each(|(r, t)| drop(black_box(robot.ik(black_box(*r), black_box(*t))))));
    let exact = |r: &Matrix3<f64>, t: &Vector3<f64>| -> Vec<[f64; 6]> { robot.ik(*r, *t).into_iter().map(|(q, _)| q.into()).collect() };
    let found = joints.iter().zip(&poses).filter(|(q, (r, t))| holds(&exact(r, t), q)).count();
    row("ik-geo 0.1.2", ns, ours, found);
}
