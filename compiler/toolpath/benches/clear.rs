//! How long a pocket takes: 100 × 60 with two islands, D10, half a diameter a step.

use gr_toolpath::*;

fn main() {
    divan::main();
}

fn part() -> Region {
    let rect = |l, w, r| profile::rectangle(l, w, r).expect("sizes are positive");
    let holes = vec![
        rect(14.0, 10.0, 2.0).moved(P2::new(-22.0, 4.0)),
        profile::circle(6.0).expect("positive").moved(P2::new(20.0, -6.0)),
    ];
    Region::new(rect(100.0, 60.0, 8.0), holes).expect("curves are simple")
}

#[divan::bench(args = [Strategy::ContourParallel, Strategy::ContourSpiral, Strategy::Bidirectional(0.0), Strategy::BidirectionalContour(0.5)])]
fn pocket(bencher: divan::Bencher<'_, '_>, strategy: &Strategy) {
    let region = part();
    bencher.bench(|| clear(&region, &Clear::new(5.0, 5.0, *strategy)));
}

#[divan::bench]
fn left_over(bencher: divan::Bencher<'_, '_>) {
    let region = part();
    bencher.bench(|| residuals(&region, &[], 5.0));
}
