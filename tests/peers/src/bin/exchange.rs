//! Times our Part 21 reader beside public peers, on one generated file, in one run.
//! `exchange [MEGABYTES] [FILE]`: with FILE that one is read, and peers that reject it say so.

use std::fmt::Write;

fn cpu() -> f64 {
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    unsafe { libc::getrusage(libc::RUSAGE_SELF, &mut usage) };
    let seconds = |t: libc::timeval| t.tv_sec as f64 + t.tv_usec as f64 * 1e-6;
    seconds(usage.ru_utime) + seconds(usage.ru_stime)
}

/// Median CPU seconds of `runs` runs; results are kept so that freeing them is not timed.
fn median<T>(runs: usize, mut work: impl FnMut() -> T) -> f64 {
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let from = cpu();
            let kept = work();
            let took = cpu() - from;
            drop(std::hint::black_box(kept));
            took
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[runs / 2]
}

/// Tool paths of pockets, as a CAM program writes them; without the forms that peers reject (`''`, `()`).
fn generate(bytes: usize) -> String {
    let mut out = String::with_capacity(bytes + 4096);
    out += "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('benchmark'),'2;1');\nFILE_NAME('b','2026-01-01T00:00:00',('a'),('b'),'c','d','e');\nFILE_SCHEMA(('MACHINING_SCHEMA'));\nENDSEC;\nDATA;\n";
    let mut seed = 14649u64;
    let mut random = move |scale: f64| {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as f64 / f64::from(u32::MAX >> 1) * scale
    };
    let mut id = 0u64;
    while out.len() < bytes {
        let first = id + 1;
        for _ in 0..45 {
            id += 1;
            let (x, y, z) = (random(80.0), random(80.0) - 40.0, -random(40.0));
            let _ = writeln!(out, "#{id}=CARTESIAN_POINT('p',({x:.6},{y:.6},{z:.6}));");
        }
        let points: Vec<String> = (first..=id).map(|n| format!("#{n}")).collect();
        let _ = writeln!(out, "#{}=POLYLINE('path {id}',({}));", id + 1, points.join(","));
        let _ = writeln!(out, "#{}=CUTTER_LOCATION_TRAJECTORY(.T.,.TRAJECTORY_PATH.,$,$,$,.T.,#{},$,$);", id + 2, id + 1);
        let _ = writeln!(out, "#{}=TOOLPATH_LIST((#{}));", id + 3, id + 2);
        id += 3;
    }
    out + "ENDSEC;\nEND-ISO-10303-21;\n"
}

fn main() {
    let mut args = std::env::args().skip(1);
    let megabytes: usize = args.next().and_then(|a| a.parse().ok()).unwrap_or(8);
    let text = match args.next() {
        Some(path) => std::fs::read_to_string(path).expect("a readable file"),
        None => generate(megabytes << 20),
    };
    let bytes = text.as_bytes();
    let mb = bytes.len() as f64 / 1e6;
    println!("{mb:.1} MB; median CPU seconds, MB/s, times slower than our model");
    gr_step::schema();
    let model = median(5, || gr_p21::parse(bytes));
    let row = |name: &str, s: f64| println!("{name:44} {s:8.3} s {:8.1} MB/s {:8.2}", mb / s, s / model);
    row("gr-p21 index", median(5, || gr_p21::index(bytes)));
    row("gr-p21 check_syntax", median(5, || gr_p21::check_syntax(bytes)));
    row("gr-p21 parse (model)", model);
    row("gr-p21 + gr-step (model and schema)", median(5, || {
        let file = gr_p21::parse(bytes);
        (gr_step::check(bytes, &file), file)
    }));
    row("gr-step diagnostics (everything)", median(3, || gr_step::diagnostics(&text, gr_text::FileId(0))));
    let parsed = gr_p21::parse(bytes);
    let size = parsed.instances.capacity() * size_of::<gr_p21::Instance>() + parsed.values.capacity() * size_of::<gr_p21::Value>();
    println!("our tables take {:.2} times the file", size as f64 / bytes.len() as f64);
    match ruststep::parser::parse(&text) {
        Ok(_) => row("ruststep 0.4.0 parser::parse", median(3, || ruststep::parser::parse(&text).ok())),
        Err(_) => println!("ruststep 0.4.0 rejects this file"),
    }
    match iso_10303::step::parser::exchange_file().parse(bytes) {
        Ok(_) => row("iso-10303 0.5.0 exchange_file", median(1, || iso_10303::step::parser::exchange_file().parse(bytes).ok())),
        Err(_) => println!("iso-10303 0.5.0 rejects this file"),
    }
}
