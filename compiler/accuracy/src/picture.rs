//! Pictures of maps and bar charts, as SVG and PNG, from one list of shapes.

use crate::map::{Map, Quantity};
use gr_backends::plot::font;
use std::fmt::Write as _;

/// A color.
type Color = [u8; 3];

const INK: Color = [40, 40, 40];
const FAINT: Color = [205, 205, 205];
const BAR: Color = [52, 110, 168];
const PAPER: Color = [255, 255, 255];

enum Shape {
    Line([f32; 2], [f32; 2], Color),
    Rect([f32; 4], Color),
    /// Baseline, height of the letters, share of the width left of the place.
    Text(String, [f32; 2], f32, f32),
    /// Left, top, pixels right and down, each so many units wide; colors row by row.
    Image([f32; 2], (usize, usize), f32, Vec<Option<Color>>),
}

/// A picture before it is written.
pub struct Picture {
    size: (u32, u32),
    title: String,
    shapes: Vec<Shape>,
}

/// Blue, green and yellow by lightness, so that it reads in grey too.
fn color(share: f64) -> Color {
    const STOPS: [[f64; 3]; 6] = [
        [48.0, 18.0, 92.0],
        [44.0, 76.0, 142.0],
        [32.0, 126.0, 142.0],
        [46.0, 168.0, 112.0],
        [150.0, 206.0, 62.0],
        [250.0, 228.0, 60.0],
    ];
    let at = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let i = (at as usize).min(STOPS.len() - 2);
    let t = at - i as f64;
    [0, 1, 2].map(|c| (STOPS[i][c] + (STOPS[i + 1][c] - STOPS[i][c]) * t + 0.5) as u8)
}

/// Round numbers from low to high, about so many.
fn ticks(low: f64, high: f64, about: usize) -> Vec<f64> {
    let span = high - low;
    if !(span > 0.0) || !span.is_finite() {
        return vec![low];
    }
    let raw = span / about.max(1) as f64;
    let power = libm::pow(10.0, libm::floor(libm::log10(raw)));
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= raw * 0.999).unwrap_or(raw);
    let first = libm::ceil(low / step - 1e-9);
    (0..200).map(|i| (first + f64::from(i)) * step).take_while(|v| *v <= high + step * 1e-9).collect()
}

/// Short, with the decimals a step of that size needs.
fn number(v: f64, span: f64) -> String {
    let decimals = (2.0 - libm::floor(libm::log10(span.abs().max(1e-12)))).clamp(0.0, 6.0) as usize;
    let text = format!("{v:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.to_string() }
}

/// The values that the colors tell apart. Where a few places take nearly all of the range the rest would be one color: then
/// the colours end before them, which is said.
fn told_apart(map: &Map, (low, high): (f64, f64)) -> ((f64, f64), Option<String>) {
    const FEW: f64 = 0.02;
    const LEAST: f64 = 0.4;
    let mut values: Vec<f32> = map.values.iter().copied().filter(|v| !v.is_nan()).collect();
    values.sort_by(f32::total_cmp);
    let count = values.len();
    if count < 50 {
        return ((low, high), None);
    }
    let at = |share: f64| f64::from(values[((count - 1) as f64 * share) as usize]);
    let (a, b) = (at(FEW), at(1.0 - FEW));
    let top = if b - low < LEAST * (high - low) { b } else { high };
    let bottom = if top - a < LEAST * (top - low) { a } else { low };
    if (bottom, top) == (low, high) || !(top > bottom) {
        return ((low, high), None);
    }
    let above = values.iter().filter(|v| f64::from(**v) > top).count();
    let below = values.iter().filter(|v| f64::from(**v) < bottom).count();
    let wide = top - bottom;
    let mut parts = Vec::new();
    if above > 0 {
        parts.push(format!("{above} of {count} nodes are above {}", number(top, wide)));
    }
    if below > 0 {
        parts.push(format!("{below} of {count} nodes are below {}", number(bottom, wide)));
    }
    ((bottom, top), Some(format!("colours end where only a few nodes are: {}", parts.join(", "))))
}

impl Picture {
    fn text(&mut self, text: impl Into<String>, at: [f32; 2], height: f32, anchor: f32) {
        self.shapes.push(Shape::Text(text.into(), at, height, anchor));
    }

    fn frame(&mut self, [x, y, w, h]: [f32; 4], color: Color) {
        let corners = [[x, y], [x + w, y], [x + w, y + h], [x, y + h]];
        for i in 0..4 {
            self.shapes.push(Shape::Line(corners[i], corners[(i + 1) % 4], color));
        }
    }

    /// A map with axes and a bar of colors; below it, what else must be known to read it.
    pub fn map(map: &Map, title: &str, notes: &[String]) -> Picture {
        const WIDE: f32 = 820.0;
        const TALL: f32 = 820.0;
        const LEFT: f32 = 86.0;
        const TOP: f32 = 78.0;
        const NOTE: f32 = 9.0;
        let border = map.border();
        let span = [0, 1].map(|i| (border[i].1 - border[i].0).max(1e-9));
        let scale = (f64::from(WIDE) / span[0]).min(f64::from(TALL) / span[1]);
        let (w, h) = ((span[0] * scale) as f32, (span[1] * scale) as f32);
        let summary = map.summary();
        let whole = summary.map_or((0.0, 1.0), |s| (s.least.0, s.greatest.0));
        let (range, beyond) = told_apart(map, whole);
        let mut notes = notes.to_vec();
        notes.extend(beyond);
        // The machine in the first line, what is shown in the second.
        let (machine, what) = title.split_once(": ").unwrap_or((title, ""));
        let longest = notes.iter().map(|n| font::width(n, NOTE)).fold(font::width(machine, 14.0).max(font::width(what, 11.0)), f32::max);
        let wide = (LEFT + w + 150.0).max(LEFT + 20.0 + longest);
        let size = (wide.ceil() as u32, (TOP + h + 92.0 + 18.0 * notes.len() as f32).ceil() as u32);
        let mut p = Picture { size, title: title.to_string(), shapes: Vec::new() };
        p.text(machine, [LEFT, 26.0], 14.0, 0.0);
        p.text(what, [LEFT, 48.0], 11.0, 0.0);
        let flat = !(range.1 - range.0 > 1e-9 * range.1.abs().max(1e-9));
        let share = |v: f64| if flat { 0.6 } else { (v - range.0) / (range.1 - range.0) };
        let (iw, ih) = (w.max(1.0) as usize, h.max(1.0) as usize);
        let step = map.step();
        // The node whose mesh a place to the right or up is in.
        let node = |share: f64, k: usize, count: usize| {
            let at = (border[k].0 + share * span[k] - map.window[k].0) / step[k].max(1e-12);
            (libm::round(at).max(0.0) as usize).min(count.max(1) - 1)
        };
        let mut pixels = Vec::with_capacity(iw * ih);
        for y in 0..ih {
            for x in 0..iw {
                let i = node((x as f64 + 0.5) / iw as f64, 0, map.size.0);
                let j = node(1.0 - (y as f64 + 0.5) / ih as f64, 1, map.size.1);
                let at = j * map.size.0 + i;
                let v = map.values.get(at).copied().unwrap_or(f32::NAN);
                pixels.push((!v.is_nan()).then(|| color(share(f64::from(v)))));
            }
        }
        p.shapes.push(Shape::Image([LEFT, TOP], (iw, ih), 1.0, pixels));
        p.axes(map, [LEFT, TOP, w, h]);
        if map.quantity != Quantity::Workspace && !flat {
            p.bar([LEFT + w + 28.0, TOP, 22.0, h], range, map.quantity.unit());
        }
        if let Some(s) = summary {
            let unit = map.quantity.unit();
            let text = if map.quantity == Quantity::Workspace {
                format!("area {:.2} dm²", s.area / 1e4)
            } else {
                let wide = whole.1.abs().max(whole.0.abs());
                format!(
                    "least {} {unit}  greatest {} {unit}  mean {} {unit}",
                    number(whole.0, wide),
                    number(whole.1, wide),
                    number(s.mean, wide)
                )
            };
            p.text(text, [LEFT, TOP + h + 76.0], 11.0, 0.0);
            if !flat {
                let spot = |at: [f64; 2]| [LEFT + ((at[0] - border[0].0) * scale) as f32, TOP + h - ((at[1] - border[1].0) * scale) as f32];
                p.mark(spot(s.least.1), "least", LEFT + w);
                p.mark(spot(s.greatest.1), "greatest", LEFT + w);
            }
        }
        for (n, note) in notes.iter().enumerate() {
            p.text(note.as_str(), [LEFT, TOP + h + 98.0 + 18.0 * n as f32], NOTE, 0.0);
        }
        p
    }

    /// A cross with a word beside it, on the side where there is room.
    fn mark(&mut self, [x, y]: [f32; 2], word: &str, right: f32) {
        for (off, color) in [(-1.0, PAPER), (1.0, PAPER), (0.0, INK)] {
            self.shapes.push(Shape::Line([x - 5.0, y + off], [x + 5.0, y + off], color));
            self.shapes.push(Shape::Line([x + off, y - 5.0], [x + off, y + 5.0], color));
        }
        let wide = font::width(word, 9.0);
        let left = if x + wide + 12.0 < right { x + 9.0 } else { x - 9.0 - wide };
        self.shapes.push(Shape::Rect([left - 2.0, y - 17.0, wide + 4.0, 14.0], PAPER));
        self.text(word, [left, y - 6.0], 9.0, 0.0);
    }

    fn axes(&mut self, map: &Map, [x, y, w, h]: [f32; 4]) {
        let (a, b) = map.plane.axes();
        let name = |i: usize| ["X", "Y", "Z"][i];
        let [(x0, x1), (y0, y1)] = map.border();
        for t in ticks(x0, x1, 8) {
            let at = x + ((t - x0) / (x1 - x0)) as f32 * w;
            self.shapes.push(Shape::Line([at, y + h], [at, y + h + 6.0], INK));
            self.shapes.push(Shape::Line([at, y], [at, y + h], FAINT));
            self.text(number(t, x1 - x0), [at, y + h + 24.0], 11.0, 0.5);
        }
        for t in ticks(y0, y1, 8) {
            let at = y + h - ((t - y0) / (y1 - y0)) as f32 * h;
            self.shapes.push(Shape::Line([x - 6.0, at], [x, at], INK));
            self.shapes.push(Shape::Line([x, at], [x + w, at], FAINT));
            self.text(number(t, y1 - y0), [x - 10.0, at + 5.0], 11.0, 1.0);
        }
        self.frame([x, y, w, h], INK);
        self.text(format!("{} mm", name(a)), [x + w / 2.0, y + h + 50.0], 12.0, 0.5);
        self.text(format!("{} mm", name(b)), [x - 10.0, y - 10.0], 12.0, 1.0);
    }

    fn bar(&mut self, [x, y, w, h]: [f32; 4], range: (f64, f64), unit: &str) {
        let steps = h.max(1.0) as usize;
        let colors = (0..steps).map(|i| Some(color(1.0 - (i as f64 + 0.5) / steps as f64))).collect::<Vec<_>>();
        let wide = w as usize;
        let pixels = colors.into_iter().flat_map(|c| std::iter::repeat_n(c, wide)).collect();
        self.shapes.push(Shape::Image([x, y], (wide, steps), 1.0, pixels));
        self.frame([x, y, w, h], INK);
        for t in ticks(range.0, range.1, 7) {
            let at = y + h - ((t - range.0) / (range.1 - range.0)) as f32 * h;
            self.shapes.push(Shape::Line([x + w, at], [x + w + 6.0, at], INK));
            self.text(number(t, range.1 - range.0), [x + w + 10.0, at + 5.0], 11.0, 0.0);
        }
        self.text(unit, [x, y - 10.0], 12.0, 0.0);
    }

    /// Bars with their names below each other; below them, what else must be known to read it.
    pub fn bars(rows: &[(String, f64)], title: &str, unit: &str, notes: &[String]) -> Picture {
        const EDGE: f32 = 20.0;
        const WIDE: f32 = 560.0;
        const ROW: f32 = 22.0;
        const TOP: f32 = 74.0;
        const NOTE: f32 = 9.0;
        let tall = ROW * rows.len() as f32;
        let names = rows.iter().map(|r| font::width(&r.0, 11.0)).fold(0.0, f32::max);
        let left = EDGE + names.max(60.0) + 10.0;
        // The machine in the first line, what is shown in the second.
        let (machine, what) = title.split_once(": ").unwrap_or((title, ""));
        let longest = notes.iter().map(|n| font::width(n, NOTE)).fold(font::width(machine, 14.0).max(font::width(what, 11.0)), f32::max);
        let wide = (left + WIDE + 110.0).max(2.0 * EDGE + longest);
        let size = (wide.ceil() as u32, (TOP + tall + 66.0 + 18.0 * notes.len() as f32).ceil() as u32);
        let mut p = Picture { size, title: title.to_string(), shapes: Vec::new() };
        p.text(machine, [EDGE, 26.0], 14.0, 0.0);
        p.text(what, [EDGE, 48.0], 11.0, 0.0);
        let most = rows.iter().fold(1e-300f64, |m, r| m.max(r.1));
        for t in ticks(0.0, most, 6) {
            let at = left + (t / most) as f32 * WIDE;
            p.shapes.push(Shape::Line([at, TOP], [at, TOP + tall], FAINT));
            p.text(number(t, most), [at, TOP + tall + 20.0], 11.0, 0.5);
        }
        for (i, (name, v)) in rows.iter().enumerate() {
            let top = TOP + ROW * i as f32;
            p.text(name.as_str(), [left - 10.0, top + 16.0], 11.0, 1.0);
            let long = (v / most) as f32 * WIDE;
            p.shapes.push(Shape::Rect([left, top + 4.0, long.max(0.5), ROW - 8.0], BAR));
            p.text(number(*v, most), [left + long + 8.0, top + 16.0], 11.0, 0.0);
        }
        p.text(unit, [left + WIDE / 2.0, TOP + tall + 44.0], 12.0, 0.5);
        for (n, note) in notes.iter().enumerate() {
            p.text(note.as_str(), [EDGE, TOP + tall + 68.0 + 18.0 * n as f32], NOTE, 0.0);
        }
        p
    }

    /// As SVG.
    pub fn svg(&self) -> Result<String, String> {
        let (w, h) = self.size;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" font-family=\"sans-serif\">\n<title>{}</title>\n<rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n",
            escaped(&self.title)
        );
        let hex = |c: &Color| format!("#{:02x}{:02x}{:02x}", c[0], c[1], c[2]);
        for shape in &self.shapes {
            let _ = match shape {
                Shape::Line(a, b, c) => writeln!(
                    out,
                    "<line x1=\"{:.2}\" y1=\"{:.2}\" x2=\"{:.2}\" y2=\"{:.2}\" stroke=\"{}\"/>",
                    a[0],
                    a[1],
                    b[0],
                    b[1],
                    hex(c)
                ),
                Shape::Rect([x, y, w, h], c) => {
                    writeln!(out, "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{w:.2}\" height=\"{h:.2}\" fill=\"{}\"/>", hex(c))
                }
                Shape::Text(text, at, height, anchor) => {
                    let anchor = if *anchor < 0.25 { "start" } else if *anchor < 0.75 { "middle" } else { "end" };
                    writeln!(
                        out,
                        "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{:.1}\" text-anchor=\"{anchor}\" fill=\"{}\">{}</text>",
                        at[0],
                        at[1],
                        height * 1.25,
                        hex(&INK),
                        escaped(text)
                    )
                }
                Shape::Image(at, (w, h), unit, pixels) => {
                    let data = base64(&png(*w, *h, pixels)?);
                    writeln!(
                        out,
                        "<image x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\" style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{data}\"/>",
                        at[0],
                        at[1],
                        *w as f32 * unit,
                        *h as f32 * unit
                    )
                }
            };
        }
        Ok(out + "</svg>\n")
    }

    /// As PNG.
    pub fn png(&self) -> Result<Vec<u8>, String> {
        let mut map = tiny_skia::Pixmap::new(self.size.0, self.size.1).ok_or("picture of no size")?;
        map.fill(skia(&PAPER));
        for shape in &self.shapes {
            match shape {
                Shape::Line(a, b, c) => stroke(&mut map, *a, *b, 1.0, c),
                Shape::Rect([x, y, w, h], c) => {
                    if let Some(r) = tiny_skia::Rect::from_xywh(*x, *y, *w, *h) {
                        map.fill_rect(r, &paint(c), tiny_skia::Transform::identity(), None);
                    }
                }
                Shape::Text(text, at, height, anchor) => {
                    let left = [at[0] - font::width(text, *height) * anchor, at[1]];
                    font::lines(text, left, *height, |a, b| stroke(&mut map, a, b, 1.2, &INK));
                }
                Shape::Image(at, (w, h), _, pixels) => blit(&mut map, *at, (*w, *h), pixels),
            }
        }
        map.encode_png().map_err(|e| e.to_string())
    }
}

fn skia(c: &Color) -> tiny_skia::Color {
    tiny_skia::Color::from_rgba8(c[0], c[1], c[2], 255)
}

fn paint(c: &Color) -> tiny_skia::Paint<'static> {
    let mut paint = tiny_skia::Paint::default();
    paint.set_color(skia(c));
    paint
}

fn stroke(map: &mut tiny_skia::Pixmap, a: [f32; 2], b: [f32; 2], width: f32, c: &Color) {
    let mut path = tiny_skia::PathBuilder::new();
    path.move_to(a[0], a[1]);
    path.line_to(b[0], b[1]);
    let Some(path) = path.finish() else { return };
    let stroke = tiny_skia::Stroke { width, ..tiny_skia::Stroke::default() };
    map.stroke_path(&path, &paint(c), &stroke, tiny_skia::Transform::identity(), None);
}

fn blit(map: &mut tiny_skia::Pixmap, at: [f32; 2], (w, h): (usize, usize), pixels: &[Option<Color>]) {
    let (left, top, wide) = (at[0] as usize, at[1] as usize, map.width() as usize);
    let data = map.data_mut();
    for y in 0..h {
        for x in 0..w {
            let (Some(Some(c)), to) = (pixels.get(y * w + x), ((top + y) * wide + left + x) * 4) else { continue };
            if let Some(pixel) = data.get_mut(to..to + 4) {
                pixel.copy_from_slice(&[c[0], c[1], c[2], 255]);
            }
        }
    }
}

/// The pixels of an image alone.
fn png(w: usize, h: usize, pixels: &[Option<Color>]) -> Result<Vec<u8>, String> {
    let mut data = Vec::with_capacity(w * h * 4);
    for p in pixels {
        data.extend(p.map_or([0, 0, 0, 0], |c| [c[0], c[1], c[2], 255]));
    }
    let size = tiny_skia::IntSize::from_wh(w as u32, h as u32);
    let map = size.and_then(|s| tiny_skia::Pixmap::from_vec(data, s)).ok_or("picture of no size")?;
    map.encode_png().map_err(|e| e.to_string())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let n = chunk.iter().enumerate().fold(0u32, |n, (i, b)| n | u32::from(*b) << (16 - 8 * i));
        for i in 0..4 {
            let letter = LETTERS[(n >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= chunk.len() { char::from(letter) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_rfc_4648() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn round_ticks() {
        assert_eq!(ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(ticks(604.1, 1053.6, 8).first(), Some(&700.0));
        assert_eq!(ticks(1.0, 1.0, 5), [1.0]);
        assert_eq!(number(0.5, 3.0), "0.5");
        assert_eq!(number(-0.0, 3.0), "0");
    }
}
