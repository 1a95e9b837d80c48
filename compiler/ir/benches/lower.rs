//! Lowering, reading and measuring one million feed moves.

use gr_canon::{At, Call, FileId, FrameId, Sink};
use gr_ir::measure::{Rates, report};
use gr_ir::{Lowering, Program};

const COUNT: u32 = 1_000_000;

fn main() {
    divan::main();
}

fn lower() -> Program {
    let mut lowering = Lowering::new();
    for line in 0..COUNT {
        let t = f64::from(line) * 0.01;
        let at = At { file: FileId(0), line, frame: FrameId::MAIN, now: b"" };
        lowering.call(&at, &Call::StraightFeed([t, t * 0.5 + 1.0, (t * 0.1) % 7.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    }
    lowering.finish()
}

#[divan::bench(sample_count = 20)]
fn lower_1m() -> usize {
    lower().len()
}

#[divan::bench(sample_count = 20)]
fn read_1m(bencher: divan::Bencher<'_, '_>) {
    let program = lower();
    bencher.bench(|| {
        let (mut cursor, mut sum) = (program.cursor(), 0.0);
        while let Some(view) = cursor.next() {
            sum += view.end.axes[0];
        }
        sum
    });
}

#[divan::bench(sample_count = 10)]
fn report_1m(bencher: divan::Bencher<'_, '_>) {
    let program = lower();
    bencher.bench(|| report(&program, &Rates::default()).totals.feed_nm);
}

#[divan::bench(sample_count = 5)]
fn print_1m(bencher: divan::Bencher<'_, '_>) {
    let program = lower();
    bencher.bench(|| gr_ir::text::print(&program, true).len());
}

#[divan::bench(sample_count = 5)]
fn diff_1m(bencher: divan::Bencher<'_, '_>) {
    let program = lower();
    bencher.bench(|| gr_ir::diff::diff(&program, &program, &gr_ir::diff::Tolerance::default()).count);
}
