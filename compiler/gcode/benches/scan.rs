//! Lossless scan of a 1 M-line program, one core.

use divan::Bencher;
use divan::counter::BytesCount;

fn main() {
    divan::main();
}

/// Seeded random walk of ±1 mm per axis, four decimals.
fn walk(lines: usize) -> String {
    let mut seed = 274u64;
    let mut unit = move || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut text = String::from("G21 G17 G90 G94\nG0 X0 Y0 Z5\nF1500\n");
    let (mut x, mut y) = (0.0f64, 0.0f64);
    for _ in 0..lines {
        x = (x + 2.0 * unit() - 1.0).abs().min(300.0);
        y = (y + 2.0 * unit() - 1.0).abs().min(300.0);
        text.push_str(&format!("G1 X{x:.4} Y{y:.4} Z{:.4}\n", -5.0 * unit()));
    }
    text.push_str("M2\n");
    text
}

fn linuxcnc() -> &'static gr_spec::Dialect {
    gr_spec::Dialect::linuxcnc()
}

#[divan::bench(sample_count = 10)]
fn plain_whole(bencher: Bencher) {
    let text = walk(1_000_000);
    bencher.counter(BytesCount::of_str(&text)).bench(|| gr_gcode::scan(&text, linuxcnc()));
}

#[divan::bench(sample_count = 10, args = [256, 1024, 4096])]
fn plain_in_chunks(bencher: Bencher, lines: usize) {
    let text = walk(1_000_000);
    let chunks = gr_gcode::split_chunks(&text, lines);
    bencher.counter(BytesCount::of_str(&text)).bench(|| {
        chunks.iter().map(|chunk| gr_gcode::scan(chunk, linuxcnc()).words.len()).sum::<usize>()
    });
}

/// Expressions, O-words, settings: the grammar's way.
#[divan::bench(sample_count = 10)]
fn structured(bencher: Bencher) {
    let block = "#1 = [#<width> * 2 - SIN[30]]\no100 while [#1 GT 0]\nG1 X[10.5 + #101] Y[[#<w> * 2] - SIN[30]] F[#5]\n\
        #1 = [#1 - 1]\no100 endwhile\n";
    let text = block.repeat(20_000);
    bencher.counter(BytesCount::of_str(&text)).bench(|| gr_gcode::scan(&text, linuxcnc()));
}
