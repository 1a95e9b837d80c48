//! Prints what Part 21 and the schema say about a file, and how long it took.
fn main() {
    let path = std::env::args().nth(1).expect("a file");
    let text = std::fs::read(&path).expect("readable");
    gr_step::schema();
    let t = std::time::Instant::now();
    let file = gr_p21::parse(&text);
    let faults = gr_step::check(&text, &file);
    let s = t.elapsed().as_secs_f64();
    let lines = gr_text::LineIndex::new(&text);
    for f in file.faults.iter().chain(&faults) {
        let (l, c) = lines.position(f.span.start);
        println!("{}:{}: {} {}", l + 1, c + 1, f.code.def().code, gr_spec::fill(f.code.def().message, &f.args));
    }
    println!("{} instances, {} + {} faults, {s:.3} s, {:.0} MB/s", file.instances.len(), file.faults.len(), faults.len(), text.len() as f64 / 1e6 / s);
}
