//! The margin of a place is kept on every machine: wherever the part is put within it, every point is within reach.

use gr_ir::NoSources;
use gr_accuracy::map::Probe;
use gr_accuracy::place::{Aim, Arm, Found, Mill, Part, Reach, place};
use gr_accuracy::{Budget, BudgetOptions};
use gr_machine::math::{Frame, M3, V3, add, norm, scale};
use gr_machine::{Machine, builtin};

/// The tool of an arm points down.
const DOWN: M3 = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];

/// Two levels of a plate with a hole, each 5 mm, and a lift between them.
fn plate(width: f64, height: f64) -> Vec<V3> {
    let side =
        |a: V3, b: V3| (0..20).map(move |i| add(scale(a, 1.0 - f64::from(i) / 20.0), scale(b, f64::from(i) / 20.0)));
    let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
    let level = |z: f64| {
        (0..4).flat_map(move |i| {
            side([corners[i][0], corners[i][1], z], [corners[(i + 1) % 4][0], corners[(i + 1) % 4][1], z])
        })
    };
    level(0.0).chain(level(-8.0)).chain((0..5).map(|i| [width / 2.0, height / 2.0, f64::from(i) * 5.0])).collect()
}

fn parts<'a>(machine: &'a Machine, lengths: &[f64], points: &[V3]) -> Vec<Part<'a>> {
    let tool = |l: &f64| Frame::shift([0.0, 0.0, *l]);
    lengths
        .iter()
        .map(|l| Part { probe: Probe::downward(machine).held(tool(l), DOWN), points: points.to_vec(), cuts: points.len() })
        .collect()
}

fn found(reach: &dyn Reach, machine: &Machine, aim: Aim) -> Option<Found> {
    let budget = Budget::new(machine, BudgetOptions::default());
    place(reach, &budget, aim, 1, &mut |_| true, &|_, _| {}).ok()
}

fn arm(parts: Vec<Part<'_>>) -> Arm<'_> {
    Arm::new(parts, &|_, _| {})
}

/// Shifts spread over a ball, its axes first.
fn shifts(radius: f64) -> impl Iterator<Item = V3> {
    let share = |n: u32, by: f64| (f64::from(n) * by).fract() * 2.0 - 1.0;
    let axes = (0..6usize).flat_map(move |way| {
        (1..=60).map(move |k| {
            let mut out = [0.0; 3];
            out[way / 2] = radius * f64::from(k) / 60.0 * if way % 2 == 0 { 1.0 } else { -1.0 };
            out
        })
    });
    let inside = (1..1500)
        .map(move |n| scale([share(n, 0.754_877_666), share(n, 0.569_840_290), share(n, 0.362_010_4)], radius));
    axes.chain(inside.filter(move |s| norm(*s) <= radius))
}

/// The part is moved all over the ball of its margin; a little more than the margin is too much somewhere.
fn kept(id: &str, lengths: &[f64], least: f64) -> Found {
    let machine = builtin(id).unwrap();
    let reach = arm(parts(&machine, lengths, &plate(120.0, 80.0)));
    let found = found(&reach, &machine, Aim::Margin).unwrap_or_else(|| panic!("{id}: nowhere"));
    println!("{id}: {found:?}");
    assert!(found.margin > least, "{id}: {found:?}");
    for by in shifts(found.margin) {
        assert!(reach.fits(add(found.position, by)), "{id}: {found:?} moved by {by:?}");
    }
    assert!(found.apart > 0.0 && found.apart < 40.0, "{id}: {found:?}");
    found
}

/// Beside the column of the base there is a hole in the reach of an arm with an offset wrist.
#[test]
fn margin_of_an_arm_with_a_hole_about_its_base() {
    let found = kept("universal-robots/ur5", &[75.0, 102.0], 150.0);
    let [x, y, _] = found.position;
    assert!(libm::hypot(x + 60.0, y + 40.0) > 109.0 + found.margin, "{found:?}");
}

#[test]
fn margin_of_an_arm_with_a_spherical_wrist() {
    kept("abb/irb2400", &[80.0], 150.0);
}

#[test]
fn margin_of_a_scara() {
    kept("adept/one", &[0.0], 30.0);
}

#[test]
fn margin_of_two_legs() {
    kept("usp/2ups-prp", &[0.0, -60.0], 80.0);
}

/// A program of straight cuts through points with rotary words in degrees.
fn program(stops: &[([f64; 3], [f64; 3])]) -> gr_ir::Program {
    let axes = |(p, r): &([f64; 3], [f64; 3])| {
        let mut out = [0.0; 9];
        (0..3).for_each(|i| (out[i], out[3 + i]) = (p[i], r[i].to_radians()));
        out
    };
    let pose = |s| gr_ir::Pose { axes: axes(s), ..gr_ir::Pose::default() };
    let mut builder = gr_ir::Builder::from_state(pose(&stops[0]), gr_ir::State::default());
    for (n, stop) in stops.iter().enumerate().skip(1) {
        let source = gr_ir::Source { line: n as u32, ..gr_ir::Source::default() };
        builder.push_to(gr_ir::Op::Linear, &pose(stop), source);
    }
    builder.finish()
}

fn straight(points: impl Iterator<Item = V3>) -> gr_ir::Program {
    program(&points.map(|p| (p, [0.0; 3])).collect::<Vec<_>>())
}

/// A box: as far as the shortest of its sides allows.
#[test]
fn margin_of_a_mill() {
    let machine = builtin("generic/mill3").unwrap();
    let reach = Mill::new(&machine, (&straight(plate(120.0, 80.0).into_iter()), &NoSources), true).unwrap();
    let found = found(&reach, &machine, Aim::Margin).unwrap();
    let travel = |i: usize| machine.joints[i].max.unwrap() - machine.joints[i].min.unwrap();
    let free = [(travel(0) - 120.0) / 2.0, (travel(1) - 80.0) / 2.0, (travel(2) - 28.0) / 2.0];
    let most = free.into_iter().fold(f64::INFINITY, f64::min);
    assert!(found.margin <= most + 1e-6 && found.margin > most - 0.2, "{found:?} of {most}");
    assert_eq!(found.apart, 0.0);
    // In the middle of the table, too.
    let middle = |i: usize| (machine.joints[i].max.unwrap() + machine.joints[i].min.unwrap()) / 2.0;
    assert!((found.position[0] + 60.0 - middle(0)).abs() < 0.01 && (found.position[1] + 40.0 - middle(1)).abs() < 0.01, "{found:?}");
}

/// A part as wide as the travel fits, without any margin; one that is wider does not.
#[test]
fn a_part_as_large_as_the_travel() {
    let machine = builtin("generic/mill3").unwrap();
    let (low, high) = (machine.joints[0].min.unwrap(), machine.joints[0].max.unwrap());
    let row = |width: f64| straight((0..=40).map(move |i| [width * f64::from(i) / 40.0, 0.0, 0.0]));
    let whole = Mill::new(&machine, (&row(high - low), &NoSources), true).unwrap();
    let got = found(&whole, &machine, Aim::Margin).unwrap();
    assert!(got.margin == 0.0 && whole.fits(got.position), "{got:?}");
    assert!(found(&Mill::new(&machine, (&row(high - low + 1.0), &NoSources), true).unwrap(), &machine, Aim::Margin).is_none());
}

/// Rotary words are joints: with the table tilted the slides carry the part over the head. What the forward solution says of
/// every stop decides, at places all over the margin and just outside of it; a rotary word beyond its limit fits nowhere.
#[test]
fn margin_of_a_mill_with_rotary_words() {
    let machine = builtin("generic/mill5-ac-table").unwrap();
    let stops = [
        ([0.0, 0.0, 0.0], [0.0; 3]),
        ([60.0, 0.0, -2.0], [-30.0, 0.0, 45.0]),
        ([60.0, 40.0, -2.0], [-90.0, 0.0, 300.0]),
        ([0.0, 40.0, 5.0], [-100.0, 0.0, -60.0]),
        ([0.0, 0.0, 0.0], [20.0, 0.0, 0.0]),
    ];
    let made = program(&stops);
    let reach = Mill::new(&machine, (&made, &NoSources), true).unwrap();
    assert!(reach.beyond.is_empty());
    let found = found(&reach, &machine, Aim::Margin).unwrap();
    assert!(found.margin > 30.0, "{found:?}");
    for by in shifts(found.margin) {
        let at = add(found.position, by);
        assert!(reach.fits(at) && reach.outside((&made, &NoSources), at).is_empty(), "{found:?} moved by {by:?}");
    }
    assert!(shifts(found.margin * 1.3).any(|by| !reach.fits(add(found.position, by))));
    // The table's own arithmetic: the part's point turned about C, then A, through (0, 0, -350).
    let inside = |at: V3| {
        stops.iter().all(|(p, [a, _, c])| {
            let ((sc, cc), (sa, ca)) = (libm::sincos(-c.to_radians()), libm::sincos(-a.to_radians()));
            let [x, y, z] = [at[0] + p[0], at[1] + p[1], at[2] + p[2] + 350.0];
            let (x, y) = (cc * x - sc * y, sc * x + cc * y);
            let (y, z) = (ca * y - sa * z, sa * y + ca * z);
            x.abs() <= 400.0 && y.abs() <= 300.0 && z - 350.0 >= -500.0 && z - 350.0 <= 100.0
        })
    };
    assert!(shifts(found.margin).all(|by| inside(add(found.position, by))));
    for by in shifts(400.0) {
        let at = add(found.position, by);
        assert!(!reach.fits(at) || inside(at), "{at:?}");
    }
    let far = program(&[([0.0; 3], [0.0; 3]), ([0.0; 3], [35.0, 0.0, 0.0])]);
    let reach = Mill::new(&machine, (&far, &NoSources), true).unwrap();
    assert_eq!(reach.beyond.iter().map(|t| (t.0.line, t.1)).collect::<Vec<_>>(), [(1, 3)]);
}

/// A place that is refused is not proposed, and the search goes on with the next best.
#[test]
fn refused_places() {
    let machine = builtin("generic/mill3").unwrap();
    let reach = Mill::new(&machine, (&straight(plate(120.0, 80.0).into_iter()), &NoSources), true).unwrap();
    let budget = Budget::new(&machine, BudgetOptions::default());
    let mut asked = Vec::new();
    let mut allowed = |at: V3| {
        asked.push(at);
        at[0] > 40.0
    };
    let got = place(&reach, &budget, Aim::Margin, 60, &mut allowed, &|_, _| {}).unwrap();
    assert!(got.position[0] > 40.0 && got.margin > 150.0 && asked.len() > 1, "{got:?} {asked:?}");
    let never = place(&reach, &budget, Aim::Margin, 5, &mut |_| false, &|_, _| {});
    assert_eq!(never.map_err(|at| at.is_some()), Err(true));
}

/// The smallest error is no greater than at the place of the largest margin, and its place is within reach too.
#[test]
fn smallest_error() {
    let machine = builtin("usp/2ups-prp").unwrap();
    let reach = arm(parts(&machine, &[0.0], &plate(120.0, 80.0)));
    let (free, best) = (found(&reach, &machine, Aim::Margin).unwrap(), found(&reach, &machine, Aim::Error).unwrap());
    assert!(best.error.unwrap() < free.error.unwrap(), "{best:?} {free:?}");
    assert!(best.margin <= free.margin + 1.0 && shifts(best.margin).all(|by| reach.fits(add(best.position, by))));
}

/// A tool that turns along the whole path: the part is moved all over the ball of its margin, and every point is looked at with its
/// own turn.
#[test]
fn margin_of_a_tool_that_turns() {
    let machine = builtin("abb/irb2400").unwrap();
    let turned = |n: u32| {
        let (s, c) = libm::sincos(f64::from(n) * -0.04);
        let tilt: M3 = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]];
        gr_machine::math::product(&tilt, &DOWN)
    };
    let tool = Frame::shift([0.0, 0.0, 80.0]);
    let one = |n: u32| {
        let points = vec![[f64::from(n) * 4.0, 0.0, 0.0]];
        Part { probe: Probe::downward(&machine).held(tool, turned(n)), points, cuts: 1 }
    };
    let reach = arm((0..25).map(one).collect());
    let found = found(&reach, &machine, Aim::Margin).unwrap();
    assert!(found.margin > 100.0 && found.apart > 0.0, "{found:?}");
    for by in shifts(found.margin) {
        assert!(reach.fits(add(found.position, by)), "{found:?} moved by {by:?}");
    }
}
