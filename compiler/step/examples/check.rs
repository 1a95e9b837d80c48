//! Prints everything there is to say about a file, and how long the layers took.
fn main() {
    let path = std::env::args().nth(1).expect("a file");
    let text = String::from_utf8_lossy(&std::fs::read(&path).expect("readable")).into_owned();
    gr_step::schema();
    let t = std::time::Instant::now();
    let file = gr_p21::parse(text.as_bytes());
    let faults = gr_step::check(text.as_bytes(), &file);
    let s = t.elapsed().as_secs_f64();
    let found = gr_step::diagnostics_of(text.as_bytes(), &file, gr_text::FileId(0));
    let all = t.elapsed().as_secs_f64();
    let lines = gr_text::LineIndex::new(text.as_bytes());
    for d in &found {
        let (l, c) = lines.position(d.primary().1.start);
        println!("{}:{}: {:?} {} {}", l + 1, c + 1, d.severity, d.code.def().code, d.message);
        for n in &d.notes {
            println!("    {n}");
        }
    }
    let mb = text.len() as f64 / 1e6;
    println!("{} instances, {} + {} faults, {s:.3} s, {:.0} MB/s; everything {:.3} s", file.instances.len(), file.faults.len(), faults.len(), mb / s, all - s);
}
