//! A page of its own: the path as numbers, a small script that draws it on a canvas.

use super::path::{Class, Path};
use std::fmt::Write as _;

const PAGE: &str = include_str!("page.html");
/// Steps per largest side: points closer together are left out.
const STEPS: f64 = 8000.0;

pub fn page(path: &Path, title: &str) -> String {
    let mut out = String::new();
    for part in PAGE.split_inclusive("@@") {
        match part.strip_suffix("@@") {
            Some("TITLE") => out.push_str(&escape(title)),
            Some("DATA") => data(path, &mut out),
            Some(text) => out.push_str(text),
            None => out.push_str(part),
        }
    }
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Runs as [class, x, y, z, dx, dy, dz, …] in steps from the lower corner of the path.
fn data(path: &Path, out: &mut String) {
    let size = path.extent.size();
    let largest = size.into_iter().fold(1e-6, f64::max);
    let step = if largest.is_finite() { largest / STEPS } else { 1.0 };
    let low = if path.extent.is_empty() { [0.0; 3] } else { path.extent.min };
    let seconds = path.totals.ns() / 1_000_000_000;
    let _ = write!(out, "{{low:{low:?},size:{size:?},step:{step:?},moves:{},seconds:{seconds},", path.totals.moves);
    let names: Vec<&str> = Class::ALL.iter().map(|c| c.name()).collect();
    let colors: Vec<[u8; 3]> = Class::ALL.iter().map(|c| c.color()).collect();
    let _ = write!(out, "names:{names:?},colors:{colors:?},runs:[");
    for (i, (class, points)) in path.runs().enumerate() {
        let _ = write!(out, "{}[{}", if i == 0 { "" } else { ",\n" }, class as u8);
        let mut last = [0i64; 3];
        for (k, p) in points.iter().enumerate() {
            let here: [i64; 3] = std::array::from_fn(|a| libm::round((f64::from(p[a]) - low[a]) / step) as i64);
            let near = here.iter().zip(&last).all(|(a, b)| (a - b).abs() < 3);
            if k > 0 && near && k + 1 != points.len() {
                continue;
            }
            for (h, l) in here.iter().zip(&last) {
                let _ = write!(out, ",{}", h - l);
            }
            last = here;
        }
        out.push(']');
    }
    out.push_str("]}");
}
