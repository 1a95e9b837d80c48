//! The margin of a place is kept on every machine: wherever the part is put within it, every point is within reach.

use gr_accuracy::map::Probe;
use gr_accuracy::place::{Aim, Found, Part, place};
use gr_accuracy::{Budget, BudgetOptions};
use gr_machine::math::{Frame, M3, V3, add, norm, scale};
use gr_machine::{Machine, builtin};

const STRAIGHT: M3 = Frame::IDENTITY.turn;

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
        .map(|l| Part { probe: Probe::downward(machine).with_tool(tool(l), &STRAIGHT), points: points.to_vec() })
        .collect()
}

fn found(parts: &[Part<'_>], machine: &Machine, aim: Aim) -> Option<Found> {
    let budget = Budget::new(machine, BudgetOptions::default());
    place(parts, &budget, aim, &|_, _| {})
}

fn fits(parts: &[Part<'_>], at: V3) -> bool {
    parts.iter().all(|part| part.points.iter().all(|p| part.probe.reaches(add(at, *p))))
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
    let parts = parts(&machine, lengths, &plate(120.0, 80.0));
    let found = found(&parts, &machine, Aim::Margin).unwrap_or_else(|| panic!("{id}: nowhere"));
    println!("{id}: {found:?}");
    assert!(found.margin > least, "{id}: {found:?}");
    for by in shifts(found.margin) {
        assert!(fits(&parts, add(found.position, by)), "{id}: {found:?} moved by {by:?}");
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

/// A box: as far as the shortest of its sides allows.
#[test]
fn margin_of_a_mill() {
    let found = kept("generic/mill3", &[0.0], 150.0);
    let machine = builtin("generic/mill3").unwrap();
    let travel = |i: usize| machine.joints[i].max.unwrap() - machine.joints[i].min.unwrap();
    let free = [(travel(0) - 120.0) / 2.0, (travel(1) - 80.0) / 2.0, (travel(2) - 28.0) / 2.0];
    let most = free.into_iter().fold(f64::INFINITY, f64::min);
    assert!(found.margin <= most + 1e-6 && found.margin > most - 2.0, "{found:?} of {most}");
}

/// A part as wide as the travel fits, without any margin; one that is wider does not.
#[test]
fn a_part_as_large_as_the_travel() {
    let machine = builtin("generic/mill3").unwrap();
    let (low, high) = (machine.joints[0].min.unwrap(), machine.joints[0].max.unwrap());
    let row = |width: f64| -> Vec<V3> { (0..=40).map(|i| [width * f64::from(i) / 40.0, 0.0, 0.0]).collect() };
    let whole = parts(&machine, &[0.0], &row(high - low));
    let got = found(&whole, &machine, Aim::Margin).unwrap();
    assert!(got.margin == 0.0 && fits(&whole, got.position), "{got:?}");
    assert!(found(&parts(&machine, &[0.0], &row(high - low + 1.0)), &machine, Aim::Margin).is_none());
}

/// The smallest error is no greater than at the place of the largest margin, and its place is within reach too.
#[test]
fn smallest_error() {
    let machine = builtin("usp/2ups-prp").unwrap();
    let parts = parts(&machine, &[0.0], &plate(120.0, 80.0));
    let (free, best) = (found(&parts, &machine, Aim::Margin).unwrap(), found(&parts, &machine, Aim::Error).unwrap());
    assert!(best.error.unwrap() < free.error.unwrap(), "{best:?} {free:?}");
    assert!(best.margin <= free.margin + 1.0 && shifts(best.margin).all(|by| fits(&parts, add(best.position, by))));
}
