//! What a map says of places where its quantity has no value.

use gr_accuracy::Budget;
use gr_accuracy::map::{Map, Part, Plane, Probe, Quantity, Request, map};
use gr_machine::{Machine, Spring, builtin};

fn drawn(machine: &Machine, quantity: Quantity, force: [f64; 3]) -> Map {
    let budget = Budget { joints: Some(vec![1e-3; machine.joints.len()]), ..Budget::default() };
    let plane = Plane { axis: 2, at: 0.0 };
    let request = Request { quantity, plane, size: (40, 40), window: None, force, signs: None };
    map(&Probe::downward(machine), &budget, &request, &|_, _| {})
}

fn nodes(map: &Map) -> usize {
    map.summary().map_or(0, |s| s.nodes)
}

/// A screw without length is not the end of the reach: such places are counted.
#[test]
fn springs_without_length_are_counted() {
    let mut whole = builtin("usp/2ups-prp").unwrap();
    let springs = whole.cell.stiffness.as_mut().unwrap();
    springs.members.iter_mut().filter(|m| m.joint < 2).for_each(|m| m.spring = Spring::Screw(1e8, 1000.0));
    let reach = nodes(&drawn(&whole, Quantity::Workspace, [0.0; 3]));
    let force = [-100.0, 0.0, 0.0];
    for quantity in [Quantity::Stiffness, Quantity::Elastic(Part::Length), Quantity::Total, Quantity::TotalRss] {
        let got = drawn(&whole, quantity, force);
        assert!(got.lost > 100 && nodes(&got) > 100, "{quantity:?}: {}", got.lost);
        assert_eq!(nodes(&got) + got.lost, reach, "{quantity:?}");
    }
    // Without a force there is nothing to yield; without a spring of a joint the total goes without any.
    assert_eq!(drawn(&whole, Quantity::Total, [0.0; 3]).lost, 0);
    let mut soft = whole.clone();
    if let Some(s) = &mut soft.cell.stiffness {
        s.members.retain(|m| m.joint != 2);
    }
    assert_eq!((drawn(&soft, Quantity::Total, force).lost, drawn(&soft, Quantity::Workspace, force).lost), (0, 0));
}
