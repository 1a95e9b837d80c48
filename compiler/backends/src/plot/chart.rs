//! What stands where in the picture: views, axes with numbers, scale bar, legend.

use super::path::{Class, Path};
use super::{Options, Show};

/// A colour.
#[derive(Clone, Copy)]
pub struct Ink(pub [u8; 3]);

/// Which point of a text its place is.
#[derive(Clone, Copy)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

/// Something to draw on; y runs down.
pub trait Canvas {
    fn size(&self) -> (f32, f32);
    /// Points closer together than this, in pixels, need not be drawn.
    fn detail(&self) -> f32;
    /// Paths are drawn in this rectangle only.
    fn clip(&mut self, left: f32, top: f32, right: f32, bottom: f32);
    fn line(&mut self, a: [f32; 2], b: [f32; 2], width: f32, ink: Ink);
    fn text(&mut self, text: &str, at: [f32; 2], height: f32, anchor: Anchor, ink: Ink);
    fn path(&mut self, class: Class, points: &mut dyn Iterator<Item = [f32; 2]>);
    /// Ends a view.
    fn flush(&mut self);
}

const TEXT: Ink = Ink([40, 44, 52]);
const FRAME: Ink = Ink([150, 156, 166]);
const GRID: Ink = Ink([232, 234, 238]);
const AXES: [Ink; 3] = [Ink([200, 40, 40]), Ink([30, 130, 50]), Ink([40, 70, 200])];
const NAMES: [&str; 3] = ["X", "Y", "Z"];

/// A view: how X Y Z become right and up.
struct Projection {
    right: [f64; 3],
    up: [f64; 3],
    name: &'static str,
    /// The axes along right and up, where the view is along an axis.
    axes: Option<(usize, usize)>,
}

impl Projection {
    fn of(show: Show) -> Projection {
        let (s, t) = (std::f64::consts::FRAC_1_SQRT_2, 0.408_248_290_463_863);
        match show {
            Show::Top => Projection::along(0, 1, "top"),
            Show::Front => Projection::along(0, 2, "front"),
            Show::Right => Projection::along(1, 2, "right"),
            _ => Projection { right: [s, s, 0.0], up: [-t, t, 2.0 * t], name: "isometric", axes: None },
        }
    }
    fn along(right: usize, up: usize, name: &'static str) -> Projection {
        let unit = |i: usize| std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 });
        Projection { right: unit(right), up: unit(up), name, axes: Some((right, up)) }
    }
    fn project(&self, p: [f64; 3]) -> [f64; 2] {
        let dot = |a: [f64; 3]| a[0] * p[0] + a[1] * p[1] + a[2] * p[2];
        [dot(self.right), dot(self.up)]
    }
}

/// A rectangle of the picture with the mapping into it.
struct Panel {
    left: f32,
    top: f32,
    right: f32,
    bottom: f32,
    scale: f64,
    /// Projected point at the middle.
    middle: [f64; 2],
}

impl Panel {
    fn fit(rect: [f32; 4], low: [f64; 2], high: [f64; 2]) -> Panel {
        let [left, top, right, bottom] = rect;
        let room = [f64::from(right - left).max(10.0), f64::from(bottom - top).max(10.0)];
        let size = [high[0] - low[0], high[1] - low[1]];
        let largest = size[0].max(size[1]).max(1e-6);
        let scale = (0..2).map(|i| room[i] / size[i].max(largest * 1e-3)).fold(f64::INFINITY, f64::min) * 0.94;
        let middle = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0];
        Panel { left, top, right, bottom, scale, middle }
    }
    fn place(&self, p: [f64; 2]) -> [f32; 2] {
        let x = (p[0] - self.middle[0]) * self.scale;
        let y = (p[1] - self.middle[1]) * self.scale;
        [(self.left + self.right) / 2.0 + x as f32, (self.top + self.bottom) / 2.0 - y as f32]
    }
}

pub fn draw(path: &Path, options: &Options, canvas: &mut dyn Canvas) {
    let (w, h) = canvas.size();
    heading(path, options, canvas, w);
    let (top, bottom) = (58.0, h - 44.0);
    if options.show == Show::All {
        let split = (w * 0.54).round();
        let half = ((top + bottom) / 2.0).round();
        view(path, Show::Isometric, [8.0, top, split, bottom], canvas);
        view(path, Show::Top, [split + 10.0, top, w - 10.0, half + (bottom - half) * 0.2], canvas);
        view(path, Show::Front, [split + 10.0, half + (bottom - half) * 0.2 + 8.0, w - 10.0, bottom], canvas);
    } else {
        view(path, options.show, [8.0, top, w - 10.0, bottom], canvas);
    }
    legend(path, canvas, h);
}

fn heading(path: &Path, options: &Options, canvas: &mut dyn Canvas, width: f32) {
    canvas.text(&options.title, [14.0, 26.0], 17.0, Anchor::Start, TEXT);
    let size = path.extent.size();
    let time = crate::sheet::clock(path.totals.ns());
    let text = if path.is_empty() {
        "no motion".to_owned()
    } else {
        format!("{} × {} × {} mm   {} moves   {time} h", mm(size[0]), mm(size[1]), mm(size[2]), path.totals.moves)
    };
    canvas.text(&text, [14.0, 46.0], 12.0, Anchor::Start, TEXT);
    canvas.line([0.0, 55.0], [width, 55.0], 1.0, GRID);
}

fn mm(v: f64) -> String {
    let text = format!("{v:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn legend(path: &Path, canvas: &mut dyn Canvas, height: f32) {
    let mut x = 16.0;
    for class in Class::ALL {
        if !path.runs.iter().any(|r| r.0 == class) {
            continue;
        }
        let y = height - 16.0;
        canvas.line([x, y - 4.0], [x + 28.0, y - 4.0], 3.0, Ink(class.color()));
        canvas.text(class.name(), [x + 36.0, y], 12.0, Anchor::Start, TEXT);
        x += 62.0 + super::font::width(class.name(), 12.0 * 0.72);
    }
}

fn view(path: &Path, show: Show, rect: [f32; 4], canvas: &mut dyn Canvas) {
    let projection = Projection::of(show);
    let [left, top, right, bottom] = rect;
    let indent = if projection.axes.is_some() { 66.0 } else { 6.0 };
    canvas.text(projection.name, [left + indent, top + 14.0], 12.0, Anchor::Start, FRAME);
    if path.is_empty() || path.extent.is_empty() {
        return;
    }
    let (low, high) = bounds(path, &projection);
    // Room for numbers at the left and below; above for the name.
    let inner = match projection.axes {
        Some(_) => [left + 58.0, top + 22.0, right - 8.0, bottom - 34.0],
        None => [left + 34.0, top + 24.0, right - 34.0, bottom - 40.0],
    };
    let panel = Panel::fit(inner, low, high);
    match projection.axes {
        Some(axes) => ruled_frame(&panel, axes, canvas),
        None => {
            box_with_numbers(path, &projection, &panel, canvas);
            triad(&projection, [left + 46.0, bottom - 64.0], canvas);
        }
    }
    // Beside the view's name, or below the path: never where the path is.
    scale_bar(&panel, right - 14.0, if projection.axes.is_some() { top + 17.0 } else { bottom - 5.0 }, canvas);
    canvas.clip(panel.left - 20.0, panel.top - 12.0, panel.right + 20.0, panel.bottom + 20.0);
    for (class, points) in path.runs() {
        thinned(class, points, &projection, &panel, canvas);
    }
    canvas.flush();
    origin(&projection, &panel, canvas);
}

/// The box of the projected path.
fn bounds(path: &Path, projection: &Projection) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in corners(path) {
        let p = projection.project(corner);
        for i in 0..2 {
            low[i] = low[i].min(p[i]);
            high[i] = high[i].max(p[i]);
        }
    }
    (low, high)
}

fn corners(path: &Path) -> impl Iterator<Item = [f64; 3]> {
    let e = path.extent;
    (0..8).map(move |n| std::array::from_fn(|i| if n >> i & 1 == 0 { e.min[i] } else { e.max[i] }))
}

/// Draws a run without the points that lie in the same spot of the picture.
fn thinned(class: Class, points: &[[f32; 3]], projection: &Projection, panel: &Panel, canvas: &mut dyn Canvas) {
    let mut last: Option<[f32; 2]> = None;
    let least = canvas.detail();
    let end = points.len().saturating_sub(1);
    let mut kept = points.iter().enumerate().filter_map(|(i, p)| {
        let p = panel.place(projection.project([f64::from(p[0]), f64::from(p[1]), f64::from(p[2])]));
        let near = last.is_some_and(|q| (p[0] - q[0]).abs() < least && (p[1] - q[1]).abs() < least);
        if near && i != end {
            return None;
        }
        last = Some(p);
        Some(p)
    });
    canvas.path(class, &mut kept);
}

/// Distance of marks: 1, 2 or 5 times a power of ten, at least `least`.
fn step(least: f64) -> f64 {
    if !(least > 0.0 && least.is_finite()) {
        return 1.0;
    }
    let power = libm::pow(10.0, libm::floor(libm::log10(least)));
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|f| f * power).find(|s| *s >= least * 0.999).unwrap_or(power * 10.0)
}

/// Multiples of `step` in a range, as numbers and texts.
fn marks(low: f64, high: f64, step: f64) -> Vec<(f64, String)> {
    let (first, last) = (libm::ceil(low / step - 1e-9), libm::floor(high / step + 1e-9));
    let count = (last - first).clamp(-1.0, 200.0) as i64;
    let decimals = (-libm::floor(libm::log10(step))).clamp(0.0, 9.0) as usize;
    (0..=count)
        .map(|i| {
            let v = (first + i as f64) * step;
            let v = if v == 0.0 { 0.0 } else { v };
            (v, format!("{v:.decimals$}"))
        })
        .collect()
}

/// A frame with a grid and numbers along the left and the lower side.
fn ruled_frame(panel: &Panel, (across, up): (usize, usize), canvas: &mut dyn Canvas) {
    let Panel { left, top, right, bottom, scale, middle } = *panel;
    let half = [f64::from(right - left) / 2.0 / scale, f64::from(bottom - top) / 2.0 / scale];
    for (v, text) in marks(middle[0] - half[0], middle[0] + half[0], step(64.0 / scale)) {
        let x = panel.place([v, middle[1]])[0];
        canvas.line([x, top], [x, bottom], 1.0, GRID);
        canvas.line([x, bottom], [x, bottom + 5.0], 1.0, FRAME);
        canvas.text(&text, [x, bottom + 18.0], 11.0, Anchor::Middle, TEXT);
    }
    for (v, text) in marks(middle[1] - half[1], middle[1] + half[1], step(40.0 / scale)) {
        let y = panel.place([middle[0], v])[1];
        canvas.line([left, y], [right, y], 1.0, GRID);
        canvas.line([left - 5.0, y], [left, y], 1.0, FRAME);
        canvas.text(&text, [left - 8.0, y + 4.0], 11.0, Anchor::End, TEXT);
    }
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
    for i in 0..4 {
        canvas.line(corners[i], corners[(i + 1) % 4], 1.0, FRAME);
    }
    canvas.text(NAMES[across], [right - 4.0, bottom + 31.0], 13.0, Anchor::End, AXES[across]);
    canvas.text(NAMES[up], [left - 8.0, top - 5.0], 13.0, Anchor::End, AXES[up]);
}

/// The box around the path with numbers along three edges.
fn box_with_numbers(path: &Path, projection: &Projection, panel: &Panel, canvas: &mut dyn Canvas) {
    let e = path.extent;
    let place = |p: [f64; 3]| panel.place(projection.project(p));
    let corner = |n: usize| -> [f64; 3] { std::array::from_fn(|i| if n >> i & 1 == 0 { e.min[i] } else { e.max[i] }) };
    for n in 0..8usize {
        for axis in (0..3).filter(|axis| n >> axis & 1 == 0) {
            canvas.line(place(corner(n)), place(corner(n | 1 << axis)), 1.0, Ink([205, 209, 216]));
        }
    }
    // Lower front edge for X, lower right edge for Y, left edge for Z.
    let edges = [(0, [e.min[0], e.min[1], e.min[2]], [0.0, 1.0]), (1, [e.max[0], e.min[1], e.min[2]], [1.0, 1.0])];
    for (axis, from, away) in edges {
        numbers(axis, from, e.max[axis], away, &place, panel, canvas);
    }
    numbers(2, [e.min[0], e.min[1], e.min[2]], e.max[2], [-1.0, 0.0], &place, panel, canvas);
}

fn numbers(
    axis: usize,
    from: [f64; 3],
    to: f64,
    away: [f32; 2],
    place: &dyn Fn([f64; 3]) -> [f32; 2],
    panel: &Panel,
    canvas: &mut dyn Canvas,
) {
    if to - from[axis] < 40.0 / panel.scale {
        return;
    }
    for (v, text) in marks(from[axis], to, step(60.0 / panel.scale)) {
        let mut p = from;
        p[axis] = v;
        let [x, y] = place(p);
        canvas.line([x, y], [x + away[0] * 4.0, y + away[1] * 4.0], 1.0, FRAME);
        let anchor = if away[0] < 0.0 {
            Anchor::End
        } else if away[0] > 0.0 {
            Anchor::Start
        } else {
            Anchor::End
        };
        let at = [x + away[0] * 8.0 - if axis == 0 { 4.0 } else { 0.0 }, y + away[1] * 13.0 + 4.0 * (1.0 - away[1])];
        canvas.text(&text, at, 11.0, anchor, AXES[axis]);
    }
}

/// Three arrows that show where X, Y and Z go.
fn triad(projection: &Projection, at: [f32; 2], canvas: &mut dyn Canvas) {
    for (i, name) in NAMES.into_iter().enumerate() {
        let mut unit = [0.0; 3];
        unit[i] = 1.0;
        let [right, up] = projection.project(unit);
        let tip = |length: f32| [at[0] + right as f32 * length, at[1] - up as f32 * length];
        canvas.line(at, tip(34.0), 2.0, AXES[i]);
        let [x, y] = tip(46.0);
        canvas.text(name, [x, y + 5.0], 13.0, Anchor::Middle, AXES[i]);
    }
}

fn scale_bar(panel: &Panel, right: f32, y: f32, canvas: &mut dyn Canvas) {
    let length = step(60.0 / panel.scale);
    let left = right - (length * panel.scale) as f32;
    canvas.line([left, y], [right, y], 2.0, TEXT);
    for x in [left, right] {
        canvas.line([x, y - 4.0], [x, y + 4.0], 1.5, TEXT);
    }
    let text = format!("{} mm", mm(length));
    canvas.text(&text, [(left + right) / 2.0, y - 7.0], 11.0, Anchor::Middle, TEXT);
}

/// A small cross at the work zero, where it is in view.
fn origin(projection: &Projection, panel: &Panel, canvas: &mut dyn Canvas) {
    let [x, y] = panel.place(projection.project([0.0; 3]));
    if x < panel.left || x > panel.right || y < panel.top || y > panel.bottom {
        return;
    }
    let ink = Ink([0, 0, 0]);
    canvas.line([x - 6.0, y], [x + 6.0, y], 1.2, ink);
    canvas.line([x, y - 6.0], [x, y + 6.0], 1.2, ink);
    canvas.text("0", [x + 4.0, y - 4.0], 9.0, Anchor::Start, ink);
}
