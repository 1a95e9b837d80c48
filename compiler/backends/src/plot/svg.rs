//! The SVG canvas. Lines drawn before are not drawn again: two ends in the same pixels count as the same
//! line, which keeps the file small however long the program is.

use super::chart::{Anchor, Canvas, Ink};
use super::path::Class;
use std::collections::HashSet;
use std::fmt::Write as _;
use std::hash::{BuildHasherDefault, Hasher};

pub struct Svg {
    width: u32,
    height: u32,
    body: String,
    seen: HashSet<u64, BuildHasherDefault<Mix>>,
    paths: [String; 4],
    clips: u32,
}

fn color(c: [u8; 3]) -> String {
    format!("#{:02x}{:02x}{:02x}", c[0], c[1], c[2])
}

fn escape(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// One decimal, without a trailing zero.
fn short(out: &mut String, v: f32) {
    let tenths = (v * 10.0).round() as i32;
    if tenths < 0 {
        out.push('-');
    }
    let tenths = tenths.unsigned_abs();
    let mut digits = [0u8; 10];
    let (mut rest, mut at) = (tenths / 10, digits.len());
    loop {
        at -= 1;
        digits[at] = b'0' + (rest % 10) as u8;
        rest /= 10;
        if rest == 0 {
            break;
        }
    }
    out.extend(digits[at..].iter().map(|d| char::from(*d)));
    if !tenths.is_multiple_of(10) {
        out.push('.');
        out.push(char::from(b'0' + (tenths % 10) as u8));
    }
}

/// A quick hash for numbers: only tells pixels apart, so nobody can gain from choosing them.
#[derive(Default)]
struct Mix(u64);

impl Hasher for Mix {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for b in bytes {
            self.write_u64(u64::from(*b));
        }
    }
    fn write_u64(&mut self, v: u64) {
        let mixed = (self.0 ^ v).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 29);
    }
}

impl Svg {
    pub fn new(width: u32, height: u32, title: &str) -> Svg {
        let mut body = String::new();
        if !title.is_empty() {
            let _ = writeln!(body, "<title>{}</title>", escape(title));
        }
        body.push_str("<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n");
        Svg { width, height, body, seen: HashSet::default(), paths: Default::default(), clips: 0 }
    }

    pub fn finish(self) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"sans-serif\">\n{}</svg>\n",
            self.body,
            w = self.width,
            h = self.height,
        )
    }

    fn segment(&mut self, class: Class, q: [f32; 2], p: [f32; 2], joined: bool) -> bool {
        // Pixels of a picture of at most 8192: 14 bits and one to spare each.
        let cell = |v: f32| (v.round() as i32).clamp(0, 0x7fff) as u64;
        let (a, b) = (cell(q[0]) << 15 | cell(q[1]), cell(p[0]) << 15 | cell(p[1]));
        if !self.seen.insert((class as u64) << 60 | a.min(b) << 30 | a.max(b)) {
            return false;
        }
        let out = &mut self.paths[class as usize];
        if !joined {
            out.push('M');
            short(out, q[0]);
            out.push(' ');
            short(out, q[1]);
        }
        out.push('L');
        short(out, p[0]);
        out.push(' ');
        short(out, p[1]);
        true
    }
}

impl Canvas for Svg {
    fn size(&self) -> (f32, f32) {
        (self.width as f32, self.height as f32)
    }
    fn detail(&self) -> f32 {
        0.8
    }
    fn clip(&mut self, left: f32, top: f32, right: f32, bottom: f32) {
        self.clips += 1;
        let _ = writeln!(
            self.body,
            "<clipPath id=\"c{}\"><rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath>",
            self.clips,
            right - left,
            bottom - top
        );
    }
    fn line(&mut self, a: [f32; 2], b: [f32; 2], width: f32, ink: Ink) {
        let _ = writeln!(
            self.body,
            "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"{}\" stroke-width=\"{width}\"/>",
            a[0],
            a[1],
            b[0],
            b[1],
            color(ink.0)
        );
    }
    fn text(&mut self, text: &str, at: [f32; 2], height: f32, anchor: Anchor, ink: Ink) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let _ = writeln!(
            self.body,
            "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"{height}\" text-anchor=\"{anchor}\" fill=\"{}\">{}</text>",
            at[0],
            at[1],
            color(ink.0),
            escape(text)
        );
    }
    fn path(&mut self, class: Class, points: &mut dyn Iterator<Item = [f32; 2]>) {
        let mut last: Option<[f32; 2]> = None;
        let mut joined = false;
        for p in points {
            if let Some(q) = last {
                joined = self.segment(class, q, p, joined);
            }
            last = Some(p);
        }
    }
    fn flush(&mut self) {
        self.seen.clear();
        for class in Class::ALL {
            let d = std::mem::take(&mut self.paths[class as usize]);
            if d.is_empty() {
                continue;
            }
            let rapid = class == Class::Rapid;
            let _ = writeln!(
                self.body,
                "<path class=\"{}\" clip-path=\"url(#c{})\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{} \
                 stroke-linejoin=\"round\" d=\"{d}\"/>",
                class.name().split(',').next().unwrap_or_default(),
                self.clips,
                color(class.color()),
                if rapid { 0.8 } else { 1.2 },
                if rapid { " stroke-opacity=\"0.8\"" } else { "" },
            );
        }
    }
}
