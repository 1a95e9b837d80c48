//! A map of 2000 × 2000 places of a machine in closed form takes at most 5 s on two cores: 10 s of processor time.
//! Alone in its file, since it measures the processor time of the whole process.

use gr_accuracy::map::{Part, Plane, Probe, Quantity, Request, map};
use gr_accuracy::{Budget, BudgetOptions};
use gr_machine::builtin;

/// Processor time of this process, s; none where the system doesn't say it this way.
fn spent() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = text.rsplit(')').next()?.split_whitespace().collect();
    Some((fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?) / 100.0)
}

/// Machine and height of its plane, mm.
const MACHINES: [(&str, f64); 5] = [
    ("usp/2ups-prp", 0.0),
    ("usp/2ups-prp", 300.0),
    ("abb/irb2400", 800.0),
    ("adept/one", 700.0),
    ("ufmg/plano-3r", 0.0),
];

const QUANTITIES: [Quantity; 6] = [
    Quantity::Workspace,
    Quantity::Singularity,
    Quantity::Manipulability,
    Quantity::Kinematic(Part::Length),
    Quantity::Geometric(Part::Length),
    Quantity::Total,
];

const GOAL: f64 = 10.0;

#[test]
fn maps_of_machines_in_closed_form_are_quick() {
    // Without optimisation only that every map has values.
    let nodes = if cfg!(debug_assertions) { 100 } else { 400 };
    let places = (nodes * nodes) as f64;
    for (id, height) in MACHINES {
        let machine = builtin(id).unwrap();
        let probe = Probe::downward(&machine);
        let by_grade = Budget::new(&machine, BudgetOptions { grade: Some(7), usp2009: false });
        let budget = Budget { joints: Some(vec![1e-3; machine.joints.len()]), ..by_grade };
        probe.extent();
        for quantity in QUANTITIES {
            let plane = Plane { axis: 2, at: height };
            let request = Request {
                quantity,
                plane,
                size: (nodes, nodes),
                window: None,
                force: [0.0; 3],
                signs: None,
            };
            let before = spent();
            let got = map(&probe, &budget, &request, &|_, _| {});
            assert!(got.summary().is_some_and(|s| s.nodes > nodes), "{id} {quantity:?}");
            let Some(took) = spent().zip(before).map(|(after, before)| (after - before) / places * 4e6) else {
                continue;
            };
            println!("{id} z={height} {}: {took:.1} s for 2000 × 2000", quantity.name());
            assert!(
                cfg!(debug_assertions) || took <= GOAL,
                "{id} {}: {took:.1} s of processor time for 2000 × 2000 places",
                quantity.name()
            );
        }
    }
}
