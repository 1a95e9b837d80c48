//! Random rooms with arcs and islands, any strategy: nothing outside is cut, everything reachable is, nothing panics.

mod judge;
use gr_toolpath::*;
use judge::Judge;
use proptest::prelude::*;

/// A star-shaped outline: corners at growing angles, some sides bent.
fn star(radius: core::ops::Range<f64>) -> impl Strategy<Value = Vec<Vertex>> {
    use proptest::strategy::Strategy as _;
    proptest::collection::vec((radius, 0.1..1.0f64, -0.35..0.35f64, any::<bool>()), 3..9).prop_map(|corners| {
        let total: f64 = corners.iter().map(|c| c.1).sum();
        let mut turn = 0.0;
        corners
            .into_iter()
            .map(|(r, share, bulge, bent)| {
                turn += share / total * std::f64::consts::TAU;
                let p = P2::polar(turn) * r;
                Vertex { p, bulge: if bent { bulge } else { 0.0 } }
            })
            .collect()
    })
}

use proptest::strategy::Strategy;

fn region() -> impl Strategy<Value = Option<Region>> {
    let island = (star(1.0..4.0), -12.0..12.0f64, -12.0..12.0f64);
    (star(6.0..18.0), proptest::collection::vec(island, 0..3)).prop_map(|(outer, islands)| {
        let outer = Path2::from_vertices(&outer, true).ok()?;
        let holes = islands
            .into_iter()
            .filter_map(|(v, x, y)| Some(Path2::from_vertices(&v, true).ok()?.moved(P2::new(x, y))))
            .collect();
        Region::new(outer, holes).ok()
    })
}

fn way() -> impl Strategy<Value = gr_toolpath::Strategy> {
    use gr_toolpath::Strategy as S;
    (0..7u8, -3.0..3.0f64).prop_map(|(k, angle)| match k {
        0 => S::ContourParallel,
        1 => S::ContourSpiral,
        2 => S::Unidirectional(angle),
        3 => S::Bidirectional(angle),
        4 => S::BidirectionalContour(angle),
        5 => S::ContourBidirectional(angle),
        _ => S::CentreMilling,
    })
}

fn entry() -> impl Strategy<Value = Entry> {
    (0..5u8, 0.05..0.6f64, 0.5..4.0f64).prop_map(|(k, angle, size)| Entry {
        approach: match k {
            0 => Approach::Plunge,
            1 => Approach::Ramp { angle },
            2 => Approach::Helix { radius: size, angle },
            3 => Approach::ZigZag { angle, width: size },
            _ => Approach::AirTangent { radius: size },
        },
        ..Entry::default()
    })
}

/// Few by default, as each draws a height field; `PROPTEST_CASES` asks for more.
fn cases() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(40)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_gouge_full_coverage(
        region in region(),
        r in 0.6..2.5f64,
        share in 0.2..0.95f64,
        allowance in prop_oneof![Just(0.0), 0.05..0.5f64],
        strategy in way(),
        entry in entry(),
        inside_out in any::<bool>(),
        climb in any::<bool>(),
    ) {
        let Some(region) = region else { return Ok(()) };
        let what = Clear {
            allowance,
            order: Some(if inside_out { Order::InsideOut } else { Order::OutsideIn }),
            cut_mode: Some(if climb { CutMode::Climb } else { CutMode::Conventional }),
            ..Clear::new(r, 2.0 * r * share, strategy)
        };
        let plan = match clear(&region, &what) {
            Ok(plan) => plan,
            Err(Error::ToolTooLarge { fits }) => {
                prop_assert!(fits <= r + allowance + 1e-3);
                return Ok(());
            }
            Err(e) => return Err(TestCaseError::fail(format!("{e}"))),
        };
        let moves = motion(&plan.passes, &Depth::new(0.0, -1.0, 0.6), &entry, Some(&region), r + allowance).unwrap();
        let mut judge = Judge::new(&region, r + 1.0, 0.1);
        let v = judge.run(&moves, r, -1.0, allowance, true);
        prop_assert!(v.gouge < 0.005, "gouge {:?}", v);
        prop_assert_eq!(v.crashes, 0, "rapid in material {:?}", v);
        prop_assert_eq!(v.missed, 0, "missed {:?}", v);
    }

    #[test]
    fn what_is_left_is_what_is_told(region in region(), r in 0.6..2.5f64) {
        let Some(region) = region else { return Ok(()) };
        // Only rooms whose islands lie apart have an exact area.
        let apart = region.holes().iter().all(|h| h.segs().iter().all(|s| region.outer().contains(s.a())));
        if !apart || region.holes().len() > 1 || region.holes().iter().any(|h| h.dist(region.outer().start()) < 0.5) {
            return Ok(());
        }
        let Ok(plan) = clear(&region, &Clear::new(r, r, gr_toolpath::Strategy::ContourParallel)) else { return Ok(()) };
        let told: f64 = residuals(&region, &[], r).unwrap().iter().map(|s| s.area).sum();
        let moves = motion(&plan.passes, &Depth::new(0.0, -1.0, 1.0), &Entry::default(), Some(&region), r).unwrap();
        let mut judge = Judge::new(&region, r + 1.0, 0.1);
        judge.run(&moves, r, -1.0, 0.0, false);
        let left = judge.uncut(-1.0);
        let walls: f64 = region.outer().length() + region.holes().iter().map(Path2::length).sum::<f64>();
        prop_assert!((left - told).abs() < 0.1 + 0.012 * walls, "left {} told {}", left, told);
    }

    #[test]
    fn anything_at_all_never_panics(
        corners in proptest::collection::vec((-1e3..1e3f64, -1e3..1e3f64, prop_oneof![Just(0.0), -5.0..5.0f64, Just(f64::NAN), Just(1e300)]), 0..7),
        closed in any::<bool>(),
        r in prop_oneof![Just(0.0), Just(f64::NAN), 1.0..500.0f64, Just(f64::INFINITY), Just(-1.0)],
        step in prop_oneof![Just(0.0), 20.0..300.0f64, Just(f64::NAN)],
        strategy in way(),
    ) {
        let vertices: Vec<_> = corners.iter().map(|&(x, y, bulge)| Vertex::arc(x, y, bulge)).collect();
        let Ok(path) = Path2::from_vertices(&vertices, closed) else { return Ok(()) };
        let _ = contour(&path, Side::Left, &Contour::new(r));
        let _ = slot(&path, r, &Contour::new(step));
        let _ = offset_open(&path, r);
        let _ = face(&path, &[], &Face::new(r, step));
        if let Ok(region) = Region::new(path, vec![]) {
            let _ = residuals(&region, &[], r);
            if let Ok(plan) = clear(&region, &Clear::new(r, step, strategy)) {
                let _ = motion(&plan.passes, &Depth::new(0.0, -r, step), &Entry::default(), Some(&region), r);
            }
        }
    }
}
