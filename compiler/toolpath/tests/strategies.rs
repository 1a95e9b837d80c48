//! Every strategy on parts with known answers, judged by the height field.

mod judge;
use gr_toolpath::*;
use judge::Judge;

const ALL: [Strategy; 7] = [
    Strategy::ContourParallel,
    Strategy::ContourSpiral,
    Strategy::Unidirectional(0.3),
    Strategy::Bidirectional(0.0),
    Strategy::BidirectionalContour(0.7),
    Strategy::ContourBidirectional(1.2),
    Strategy::CentreMilling,
];

fn rect(l: f64, w: f64, r: f64) -> Path2 {
    profile::rectangle(l, w, r).unwrap()
}

fn two_islands() -> Region {
    let holes = vec![
        rect(14.0, 10.0, 2.0).moved(P2::new(-12.0, 4.0)),
        profile::circle(5.0).unwrap().moved(P2::new(14.0, -5.0)),
    ];
    Region::new(rect(60.0, 40.0, 6.0), holes).unwrap()
}

fn parts() -> Vec<(&'static str, Region)> {
    let plain = |p: Path2| Region::new(p, vec![]).unwrap();
    let vee = Path2::polyline(&[P2::new(0.0, 0.0), P2::new(40.0, 0.0), P2::new(40.0, 12.0)], true).unwrap();
    let bell = Path2::from_vertices(
        &[
            Vertex::arc(-10.0, -6.0, -0.8),
            Vertex::line(-10.0, 6.0),
            Vertex::line(-4.0, 1.5),
            Vertex::line(14.0, 1.5),
            Vertex::line(20.0, 8.0),
            Vertex::arc(32.0, 8.0, -0.3),
            Vertex::line(32.0, -8.0),
            Vertex::line(20.0, -8.0),
            Vertex::line(14.0, -1.5),
            Vertex::line(-4.0, -1.5),
        ],
        true,
    );
    vec![
        ("rectangle", plain(rect(50.0, 30.0, 0.0))),
        ("hexagon", plain(profile::ngon(40.0, 6, profile::Ngon::Inscribed).unwrap())),
        ("circle", plain(profile::circle(15.0).unwrap())),
        ("islands", two_islands()),
        ("spike", plain(vee)),
        ("dumbbell", plain(bell.unwrap())),
        ("boss in the wall", Region::new(rect(40.0, 30.0, 5.0), vec![profile::circle(6.0).unwrap().moved(P2::new(20.0, 0.0))]).unwrap()),
    ]
}

fn judged(name: &str, region: &Region, what: &Clear, entry: &Entry, depth: &Depth) {
    let plan = clear(region, what).unwrap_or_else(|e| panic!("{name} {what:?}: {e}"));
    let inset = what.radius + what.allowance;
    let moves = motion(&plan.passes, depth, entry, Some(region), inset).unwrap();
    let mut judge = Judge::new(region, what.radius + 1.0, if what.radius > 1.5 { 0.1 } else { 0.08 });
    let v = judge.run(&moves, what.radius, depth.bottom, what.allowance, true);
    assert!(v.gouge < 0.005, "{name} {what:?} {entry:?}: gouge {v:?}");
    assert_eq!(v.crashes, 0, "{name} {what:?} {entry:?}: {v:?}");
    assert_eq!(v.missed, 0, "{name} {what:?}: {v:?}");
}

#[test]
fn every_strategy_cuts_all_it_can_and_nothing_else() {
    for (name, region) in parts() {
        for strategy in ALL {
            for (r, step) in [(2.0, 2.0), (2.0, 3.6), (1.3, 0.7)] {
                let mut what = Clear::new(r, step, strategy);
                if step < 1.0 {
                    what.allowance = 0.4;
                    what.order = Some(Order::OutsideIn);
                }
                judged(name, &region, &what, &Entry::default(), &Depth::new(0.0, -1.0, 1.0));
            }
        }
    }
}

#[test]
fn every_approach_stays_inside() {
    let island = profile::circle(4.0).unwrap().moved(P2::new(8.0, -3.0));
    let region = Region::new(rect(50.0, 30.0, 4.0), vec![island]).unwrap();
    let ways = [
        Approach::Ramp { angle: 0.1 },
        Approach::Helix { radius: 3.0, angle: 0.08 },
        Approach::ZigZag { angle: 0.1, width: 6.0 },
        Approach::AirAngle { angle: 0.5, length: 6.0 },
        Approach::AirTangent { radius: 3.0 },
    ];
    for strategy in [Strategy::ContourParallel, Strategy::Bidirectional(0.0), Strategy::Unidirectional(0.5)] {
        for way in &ways {
            let entry = Entry { approach: way.clone(), retract: way.clone(), by_level: true };
            judged("islands", &region, &Clear::new(2.5, 2.5, strategy), &entry, &Depth::new(0.0, -3.0, 1.5));
            let entry = Entry { by_level: false, ..entry };
            judged("islands", &region, &Clear::new(2.5, 2.5, strategy), &entry, &Depth::new(0.0, -3.0, 1.5));
        }
    }
}

#[test]
fn a_slot_as_wide_as_the_tool_is_cut_once() {
    let region = Region::new(rect(50.0, 10.0, 5.0), vec![]).unwrap();
    for strategy in ALL {
        let plan = clear(&region, &Clear::new(5.0, 5.0, strategy)).unwrap();
        let length: f64 = plan.passes.iter().map(|p| p.path.length()).sum();
        assert!((length - 40.0).abs() < 1e-3, "{strategy:?} {length}");
    }
    let tight = Region::new(rect(50.0, 9.9, 0.0), vec![]).unwrap();
    match clear(&tight, &Clear::new(5.0, 5.0, Strategy::ContourParallel)) {
        Err(Error::ToolTooLarge { fits }) => assert!((fits - 4.95).abs() < 1e-3),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_hole_as_wide_as_the_tool_is_a_plunge() {
    let region = Region::new(profile::circle(5.0).unwrap(), vec![]).unwrap();
    let plan = clear(&region, &Clear::new(5.0, 5.0, Strategy::ContourParallel)).unwrap();
    assert!(plan.passes[0].path.dist(P2::default()) < 1e-3);
}

#[test]
fn offsets_are_exact() {
    let region = Region::new(rect(100.0, 60.0, 8.0), vec![]).unwrap();
    let inner = erode(&region, 5.0).unwrap();
    let expected = 90.0 * 50.0 - (4.0 - std::f64::consts::PI) * 9.0;
    assert_eq!(inner.len(), 1);
    assert!((inner[0].area() - expected).abs() < 1e-9);
    assert_eq!(inner[0].outer().segs().len(), 8);
    let outer = grow(&[rect(100.0, 60.0, 0.0)], 5.0).unwrap();
    let expected = 6000.0 + 320.0 * 5.0 + std::f64::consts::PI * 25.0;
    assert!((outer[0].area() - expected).abs() < 1e-9);
}

#[test]
fn sharp_corners_stay_and_are_told() {
    let region = Region::new(rect(50.0, 30.0, 0.0), vec![]).unwrap();
    let left = residuals(&region, &[], 5.0).unwrap();
    assert_eq!(left.len(), 4);
    for spot in &left {
        let expected = 25.0 * (1.0 - std::f64::consts::FRAC_PI_4);
        assert!((spot.area - expected).abs() < 0.01, "{spot:?}");
        assert!((spot.at.x.abs() - 25.0).abs() < 1e-9 && (spot.at.y.abs() - 15.0).abs() < 1e-9);
        assert_eq!(spot.needs_radius, 0.0);
    }
    let region = Region::new(rect(50.0, 30.0, 3.0), vec![]).unwrap();
    let left = residuals(&region, &[], 5.0).unwrap();
    assert_eq!(left.len(), 4);
    assert!((left[0].area - (1.0 - std::f64::consts::FRAC_PI_4) * 16.0).abs() < 0.01, "{left:?}");
    assert!((left[0].needs_radius - 3.0).abs() < 1e-6);
    assert!(residuals(&region, &[], 3.0).unwrap().is_empty());
    assert!(residuals(&two_islands(), &[], 4.0).unwrap().is_empty());
}

#[test]
fn engagement_keeps_to_the_stepover_on_straights() {
    let region = Region::new(rect(60.0, 40.0, 0.0), vec![]).unwrap();
    let (r, step) = (5.0, 4.0);
    for (strategy, from) in [(Strategy::ContourParallel, 3), (Strategy::ContourSpiral, 3)] {
        let plan = clear(&region, &Clear::new(r, step, strategy)).unwrap();
        let moves = motion(&plan.passes, &Depth::new(0.0, -1.0, 1.0), &Entry::default(), Some(&region), r).unwrap();
        let mut judge = Judge::new(&region, r + 1.0, 0.1);
        let seen = judge.engagement(&moves, r);
        let room = plan.room[0].outer().bounds();
        // Away from the corners and the first, full-width turn.
        let steady = seen.iter().filter(|(p, _)| p.x > 5.5 && p.x < 9.0 && p.y.abs() > 5.0 && p.y.abs() <= room.max.y + 0.1);
        let max = steady.map(|s| s.1).fold(0.0, f64::max);
        let all = seen.iter().map(|s| s.1).fold(0.0, f64::max);
        println!("{strategy:?}: steady {max:.2} of {step}, anywhere {all:.2} ({from})");
        assert!(max <= step + 0.35, "{strategy:?} {max}");
    }
}

#[test]
fn facing_covers_the_face_and_overruns() {
    for angle in [0.0, 0.6] {
        for bidirectional in [true, false] {
            let outline = rect(80.0, 50.0, 0.0);
            let what = Face { angle, bidirectional, ..Face::new(10.0, 15.0) };
            let passes = face(&outline, &[], &what).unwrap();
            let moves = motion(&passes, &Depth::new(0.0, -1.0, 1.0), &Entry::default(), None, 10.0).unwrap();
            let region = Region::new(outline, vec![]).unwrap();
            let mut judge = Judge::new(&region, 1.0, 0.2);
            judge.run(&moves, 10.0, -1.0, -50.0, false);
            assert_eq!(judge.uncut(-1.0), 0.0, "{angle} {bidirectional}");
        }
    }
    let boss = profile::circle(8.0).unwrap().moved(P2::new(10.0, 5.0));
    let region = Region::new(rect(200.0, 200.0, 0.0), vec![boss.clone()]).unwrap();
    let passes = face(&rect(80.0, 50.0, 0.0), &[boss], &Face::new(5.0, 7.0)).unwrap();
    let moves = motion(&passes, &Depth::new(0.0, -1.0, 1.0), &Entry::default(), None, 5.0).unwrap();
    let v = Judge::new(&region, 1.0, 0.2).run(&moves, 5.0, -1.0, 0.0, false);
    assert!(v.gouge < 0.005, "{v:?}");
}

#[test]
fn walls_with_leads() {
    let region = two_islands();
    let what = Contour { lead_in: Lead::Arc(3.0), lead_out: Lead::Arc(3.0), stock: 2.0, stepover: 1.0, ..Contour::new(4.0) };
    for mode in [CutMode::Climb, CutMode::Conventional] {
        let what = Contour { cut_mode: mode, ..what.clone() };
        let passes = contour_closed(&region, &what).unwrap();
        let moves = motion(&passes, &Depth::new(0.0, -2.0, 1.0), &Entry::default(), Some(&region), 4.0).unwrap();
        let v = Judge::new(&region, 5.0, 0.1).run(&moves, 4.0, -2.0, 0.0, false);
        assert!(v.gouge < 0.005 && v.crashes == 0, "{v:?}");
        let wall = passes.last().unwrap();
        assert!(!wall.path.is_closed(), "leads fit");
    }
    // From outside: nothing inside the outline is touched.
    let outline = rect(40.0, 30.0, 4.0);
    let passes = contour(&outline, Side::Right, &Contour { lead_in: Lead::Arc(3.0), lead_out: Lead::Line(3.0), ..Contour::new(5.0) }).unwrap();
    let around = Region::new(rect(120.0, 120.0, 0.0), vec![outline]).unwrap();
    let moves = motion(&passes, &Depth::new(0.0, -2.0, 2.0), &Entry::default(), None, 5.0).unwrap();
    let v = Judge::new(&around, 1.0, 0.2).run(&moves, 5.0, -2.0, 0.0, false);
    assert!(v.gouge < 0.005, "{v:?}");
    assert!(!passes[0].path.segs().is_empty());
}

#[test]
fn open_sides_and_slots() {
    let line = Path2::from_vertices(&[Vertex::line(0.0, 0.0), Vertex::arc(30.0, 0.0, 0.4), Vertex::line(50.0, 20.0)], false).unwrap();
    for side in [Side::Left, Side::Right, Side::On] {
        let passes = contour(&line, side, &Contour::new(3.0)).unwrap();
        assert_eq!(passes.len(), 1);
        let near = passes[0].path.sampled(0.1).iter().map(|p| line.dist(*p)).fold(f64::INFINITY, f64::min);
        let expected = if side == Side::On { 0.0 } else { 3.0 };
        assert!((near - expected).abs() < 1e-6, "{side:?} {near}");
    }
    let region = profile::sweep(&line, 6.0, 6.0, profile::End::Round, profile::End::Round).unwrap();
    let passes = slot(&line, 12.0, &Contour { stepover: 2.0, ..Contour::new(3.0) }).unwrap();
    let moves = motion(&passes, &Depth::new(0.0, -1.0, 1.0), &Entry::default(), Some(&region), 3.0).unwrap();
    let v = Judge::new(&region, 4.0, 0.1).run(&moves, 3.0, -1.0, 0.0, true);
    assert!(v.gouge < 0.005 && v.missed == 0, "{v:?}");
    let ring = profile::travel_circular(P2::default(), P2::new(20.0, 0.0), std::f64::consts::TAU).unwrap();
    let region = profile::sweep(&ring, 4.0, 4.0, profile::End::Round, profile::End::Round).unwrap();
    assert_eq!(region.holes().len(), 1);
    let passes = slot(&ring, 8.0, &Contour { stepover: 1.0, ..Contour::new(3.0) }).unwrap();
    let moves = motion(&passes, &Depth::new(0.0, -1.0, 1.0), &Entry::default(), Some(&region), 3.0).unwrap();
    let v = Judge::new(&region, 4.0, 0.1).run(&moves, 3.0, -1.0, 0.0, true);
    assert!(v.gouge < 0.005 && v.missed == 0, "{v:?}");
}

#[test]
fn profiles_have_their_areas() {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};
    let area = |p: Path2| p.area();
    assert!((area(rect(10.0, 4.0, 1.0)) - (40.0 - (4.0 - PI))).abs() < 1e-12);
    assert!((area(profile::circle(3.0).unwrap()) - 9.0 * PI).abs() < 1e-12);
    let inscribed = profile::ngon(20.0, 6, profile::Ngon::Inscribed).unwrap();
    assert!((inscribed.area() - 3.0 * 100.0 * (TAU / 6.0).sin()).abs() < 1e-9);
    let around = profile::ngon(20.0, 6, profile::Ngon::Circumscribed).unwrap();
    assert!((around.area() - 600.0 * (PI / 6.0).tan()).abs() < 1e-9);
    assert!((profile::partial_circle(5.0, PI).unwrap().length() - 5.0 * PI).abs() < 1e-12);
    let sweep = profile::sweep(&profile::linear(30.0).unwrap(), 4.0, 4.0, profile::End::Round, profile::End::Flat).unwrap();
    assert!((sweep.area() - (240.0 + 8.0 * PI)).abs() < 1e-9);
    let vee = profile::Section::Vee { angle: FRAC_PI_2, radius: 0.0, tilt: 0.0 };
    let (l, r) = vee.half_widths(3.0).unwrap();
    assert!((l - 3.0).abs() < 1e-12 && (r - 3.0).abs() < 1e-12);
    let u = profile::Section::RoundedU { width: 10.0 };
    assert!((u.half_widths(5.0).unwrap().0 - 5.0).abs() < 1e-12);
    let square = profile::Section::SquareU { width: 10.0, first_angle: 0.2, second_angle: 0.0, first_radius: 1.0, second_radius: 1.0 };
    let (l, r) = square.half_widths(6.0).unwrap();
    assert!((l - (5.0 + 6.0 * 0.2f64.tan())).abs() < 1e-12 && (r - 5.0).abs() < 1e-12);
    assert!((square.half_widths(0.0).unwrap().1 - 4.0).abs() < 1e-9);
}

#[test]
fn bad_input_is_an_error() {
    assert_eq!(profile::rectangle(0.0, 5.0, 0.0), Err(Error::Parameter("length")));
    assert_eq!(profile::rectangle(f64::NAN, 5.0, 0.0), Err(Error::NotFinite));
    assert!(Path2::polyline(&[], true).is_err());
    assert!(Path2::polyline(&[P2::default()], true).is_err());
    assert!(Path2::polyline(&[P2::default(), P2::new(f64::INFINITY, 0.0)], false).is_err());
    let bow = Path2::polyline(&[P2::new(0.0, 0.0), P2::new(10.0, 10.0), P2::new(10.0, 0.0), P2::new(0.0, 12.0)], true).unwrap();
    assert!(matches!(Region::new(bow, vec![]), Err(Error::SelfIntersecting(_))));
    let region = Region::new(rect(50.0, 30.0, 0.0), vec![]).unwrap();
    for (r, s) in [(0.0, 1.0), (f64::NAN, 1.0), (1.0, 0.0), (1.0, 1e-5), (1.0, 3.0), (1e9, 1.0)] {
        for strategy in ALL {
            assert!(clear(&region, &Clear::new(r, s, strategy)).is_err(), "{r} {s}");
        }
    }
    assert!(levels(&Depth::new(0.0, f64::NAN, 1.0)).is_err());
    assert!(levels(&Depth::new(0.0, -1.0, 0.0)).is_err());
    assert_eq!(levels(&Depth { finish: 0.5, ..Depth::new(0.0, -10.0, 4.0) }).unwrap().len(), 4);
}
