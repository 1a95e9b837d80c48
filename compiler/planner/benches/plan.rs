//! How long a plan takes: the published parts, and plans of many workingsteps, which have to be linear.

#[path = "../tests/judge/part.rs"]
#[allow(dead_code)]
mod part;

use gr_planner::{Options, Overlap, Units, plan};
use gr_text::FileId;
use part::{Mill, Part};

fn main() {
    divan::main();
}

#[divan::bench]
fn example_1() {
    let text = include_bytes!("../../../tests/golden/ufsc2016/example1.p21");
    divan::black_box(plan(text, FileId(0), &Options { overlap: Some(Overlap::Percent), ..Options::default() }));
}

#[divan::bench]
fn example_2_of_26_workingsteps() {
    let text = include_bytes!("../../../tests/golden/ufsc2016/example2_3caras.p21");
    divan::black_box(plan(text, FileId(0), &Options { units: Some(Units::StepModeler), ..Options::default() }));
}

/// Pockets in a row, each with tools and technology of its own.
fn many(count: usize) -> String {
    let mut p = Part::new([40.0 * count as f64, 40.0, 20.0]);
    for k in 0..count {
        let t = p.tool("ENDMILL", 8.0, 0.0, None);
        let op = p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", t, 2.5, 4.0));
        let (w, l) = (p.length(24.0), p.length(30.0));
        let profile = p.add(format!("RECTANGULAR_CLOSED_PROFILE($,#{w},#{l})"));
        let bottom = p.add("PLANAR_POCKET_BOTTOM_CONDITION()".into());
        p.machine("CLOSED_POCKET", &[op], [20.0 + 40.0 * k as f64, 20.0, 20.0], Some(5.0), &format!(",(),$,#{bottom},$,$,#{profile}"));
    }
    p.text()
}

#[divan::bench(args = [100, 1_000, 10_000], sample_count = 3, sample_size = 1)]
fn workingsteps(bencher: divan::Bencher<'_, '_>, count: usize) {
    let text = many(count);
    bencher.bench(|| plan(text.as_bytes(), FileId(0), &Options::default()));
}
