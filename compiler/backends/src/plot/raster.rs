//! The pixel canvas: anti-aliased lines by coverage. Each class of path has a layer of its own, so that
//! crossing lines do not darken and feed lies over rapids.

use super::chart::{Anchor, Canvas, Ink};
use super::font;
use super::path::Class;

pub struct Raster {
    width: usize,
    height: usize,
    layers: [Vec<u8>; 4],
    pixels: Vec<u8>,
    clip: [f32; 4],
}

/// Coverage of a line of this half width, given distances in 1/16 pixel.
fn coverage(half: f32, distance: f32) -> u8 {
    ((half + 0.5 - distance).clamp(0.0, 1.0) * 255.0) as u8
}

/// Visits the pixels of a line with their coverage.
fn trace(size: (usize, usize), clip: [f32; 4], a: [f32; 2], b: [f32; 2], width: f32, mut to: impl FnMut(usize, u8)) {
    let Some((a, b)) = clipped(a, b, clip) else {
        return;
    };
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let steep = dy.abs() > dx.abs();
    // u runs along the line, v across.
    let (mut p, mut q) = if steep { ([a[1], a[0]], [b[1], b[0]]) } else { (a, b) };
    if p[0] > q[0] {
        std::mem::swap(&mut p, &mut q);
    }
    let run = q[0] - p[0];
    let slope = if run > 1e-6 { (q[1] - p[1]) / run } else { 0.0 };
    let across = 1.0 / (1.0 + slope * slope).sqrt();
    let half = width / 2.0;
    let reach = (half + 0.5) / across;
    let (end_u, end_v) = if steep { (size.1, size.0) } else { size };
    let first = (p[0] - half).floor().max(0.0) as usize;
    let last = ((q[0] + half).ceil().max(0.0) as usize).min(end_u);
    for u in first..last {
        let center = u as f32 + 0.5;
        // At the ends the line is covered only as far as it reaches into the pixel.
        let inside = ((center + 0.5).min(q[0] + half * 0.5) - (center - 0.5).max(p[0] - half * 0.5)).clamp(0.0, 1.0);
        let v = p[1] + slope * (center.clamp(p[0], q[0]) - p[0]);
        let low = (v - reach).floor().max(0.0) as usize;
        let high = ((v + reach).ceil().max(0.0) as usize).min(end_v);
        for w in low..high {
            let distance = (w as f32 + 0.5 - v).abs() * across;
            let c = (f32::from(coverage(half, distance)) * inside) as u8;
            if c > 0 {
                to(if steep { u * size.0 + w } else { w * size.0 + u }, c);
            }
        }
    }
}

/// The part of a line inside a rectangle (left, top, right, bottom).
fn clipped(a: [f32; 2], b: [f32; 2], clip: [f32; 4]) -> Option<([f32; 2], [f32; 2])> {
    let d = [b[0] - a[0], b[1] - a[1]];
    let (mut from, mut to) = (0.0f32, 1.0f32);
    for (i, (low, high)) in [(clip[0], clip[2]), (clip[1], clip[3])].into_iter().enumerate() {
        if d[i].abs() < 1e-9 {
            if a[i] < low || a[i] > high {
                return None;
            }
            continue;
        }
        let (s, t) = ((low - a[i]) / d[i], (high - a[i]) / d[i]);
        from = from.max(s.min(t));
        to = to.min(s.max(t));
    }
    let finite = d[0].is_finite() && d[1].is_finite();
    (finite && from <= to).then(|| {
        let at = |t: f32| [a[0] + d[0] * t, a[1] + d[1] * t];
        (at(from), at(to))
    })
}

impl Raster {
    pub fn new(width: u32, height: u32) -> Raster {
        let (width, height) = (width as usize, height as usize);
        let layer = || vec![0; width * height];
        let pixels = vec![255; width * height * 4];
        let clip = [0.0, 0.0, width as f32, height as f32];
        Raster { width, height, layers: [layer(), layer(), layer(), layer()], pixels, clip }
    }

    pub fn encode(self) -> Result<Vec<u8>, String> {
        let size = tiny_skia::IntSize::from_wh(self.width as u32, self.height as u32);
        let map = size.and_then(|size| tiny_skia::Pixmap::from_vec(self.pixels, size));
        map.ok_or("picture of no size")?.encode_png().map_err(|e| e.to_string())
    }

    fn blend(pixels: &mut [u8], at: usize, color: [u8; 3], coverage: u8) {
        let Some(pixel) = pixels.get_mut(at * 4..at * 4 + 3) else {
            return;
        };
        let c = u32::from(coverage);
        for (p, ink) in pixel.iter_mut().zip(color) {
            *p = ((u32::from(*p) * (255 - c) + u32::from(ink) * c + 127) / 255) as u8;
        }
    }
}

impl Canvas for Raster {
    fn size(&self) -> (f32, f32) {
        (self.width as f32, self.height as f32)
    }
    fn detail(&self) -> f32 {
        0.4
    }
    fn clip(&mut self, left: f32, top: f32, right: f32, bottom: f32) {
        self.clip = [left.max(0.0), top.max(0.0), right.min(self.width as f32), bottom.min(self.height as f32)];
    }
    fn line(&mut self, a: [f32; 2], b: [f32; 2], width: f32, ink: Ink) {
        let pixels = &mut self.pixels;
        let clip = [0.0, 0.0, self.width as f32, self.height as f32];
        trace((self.width, self.height), clip, a, b, width, |at, c| Self::blend(pixels, at, ink.0, c));
    }
    fn text(&mut self, text: &str, at: [f32; 2], height: f32, anchor: Anchor, ink: Ink) {
        let size = height * 0.72;
        let shift = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => font::width(text, size) / 2.0,
            Anchor::End => font::width(text, size),
        };
        let from = [(at[0] - shift).round() + 0.5, at[1].round() + 0.5];
        font::lines(text, from, size, |a, b| self.line(a, b, (height / 9.0).max(1.1), ink));
    }
    fn path(&mut self, class: Class, points: &mut dyn Iterator<Item = [f32; 2]>) {
        let width = if class == Class::Rapid { 0.9 } else { 1.3 };
        let (size, clip) = ((self.width, self.height), self.clip);
        let layer = &mut self.layers[class as usize];
        let mut last: Option<[f32; 2]> = None;
        for p in points {
            if let Some(q) = last {
                trace(size, clip, q, p, width, |at, c| {
                    if let Some(pixel) = layer.get_mut(at) {
                        *pixel = (*pixel).max(c);
                    }
                });
            }
            last = Some(p);
        }
    }
    fn flush(&mut self) {
        for class in Class::ALL {
            let layer = &mut self.layers[class as usize];
            let strength = if class == Class::Rapid { 200 } else { 255 };
            for (at, c) in layer.iter_mut().enumerate().filter(|(_, c)| **c > 0) {
                Self::blend(&mut self.pixels, at, class.color(), (u32::from(*c) * strength / 255) as u8);
                *c = 0;
            }
        }
    }
}
