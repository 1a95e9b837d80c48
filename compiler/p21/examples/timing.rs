//! Times the index and the parse of a file: `cargo run --release --example timing -- FILE`.
fn main() {
    let path = std::env::args().nth(1).expect("a file");
    let text = std::fs::read(&path).expect("readable");
    let mb = text.len() as f64 / 1e6;
    for _ in 0..5 {
        let t = std::time::Instant::now();
        let index = gr_p21::index(&text);
        let a = t.elapsed().as_secs_f64();
        let t = std::time::Instant::now();
        let parsed = gr_p21::parse(&text);
        let b = t.elapsed().as_secs_f64();
        let t = std::time::Instant::now();
        let faults = gr_p21::check_syntax(&text);
        let c = t.elapsed().as_secs_f64();
        println!("syntax check {} faults in {c:.3} s = {:.0} MB/s", faults.len(), mb / c);
        let bytes = parsed.instances.len() * 40 + parsed.values.len() * 8;
        println!("index {} in {a:.3} s = {:.0} MB/s; parse {} faults {} in {b:.3} s = {:.0} MB/s, tables {:.2} x file", index.entries.len(), mb / a, parsed.instances.len(), parsed.faults.len(), mb / b, bytes as f64 / text.len() as f64);
    }
}
