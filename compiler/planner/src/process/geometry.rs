//! What contours, curves and profiles of the process model say about themselves: ends, bounds, areas, outlines.

use super::{Closed, Contour, Curve, Piece};

impl Piece {
    /// Where it ends.
    pub fn end(&self) -> [f64; 3] {
        match self {
            Piece::Line(p) => *p,
            Piece::Arc { end, .. } => *end,
        }
    }
}

impl Curve {
    /// Last point.
    pub fn end(&self) -> [f64; 3] {
        self.pieces.last().map_or(self.start, Piece::end)
    }
    /// Direction at its first point.
    pub fn tangent(&self) -> Option<[f64; 3]> {
        use crate::frame::{cross, sub, unit};
        match *self.pieces.first()? {
            Piece::Line(p) => unit(sub(p, self.start)),
            Piece::Arc { center, normal, .. } => unit(cross(normal, sub(self.start, center))),
        }
    }
    /// The same curve the other way round.
    pub fn reversed(&self) -> Curve {
        let mut points = vec![self.start];
        points.extend(self.pieces.iter().map(Piece::end));
        let back = self.pieces.iter().enumerate().rev().map(|(i, piece)| match *piece {
            Piece::Line(_) => Piece::Line(points[i]),
            Piece::Arc { center, normal, .. } => Piece::Arc { center, normal: normal.map(|c| -c), end: points[i] },
        });
        Curve { start: self.end(), pieces: back.collect() }
    }
}

impl Contour {
    /// A polygon.
    pub fn polygon(points: impl IntoIterator<Item = [f64; 2]>) -> Contour {
        Contour { points: points.into_iter().map(|p| [p[0], p[1], 0.0]).collect(), closed: true }
    }
    /// A full circle, counter-clockwise.
    pub fn circle(center: [f64; 2], radius: f64) -> Contour {
        Contour { points: vec![[center[0] + radius, center[1], 1.0], [center[0] - radius, center[1], 1.0]], closed: true }
    }
    /// Smallest and largest x and y, arcs by their vertices' circle.
    pub fn bounds(&self) -> ([f64; 2], [f64; 2]) {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        let n = self.points.len();
        let mut take = |p: [f64; 2]| {
            for i in 0..2 {
                low[i] = low[i].min(p[i]);
                high[i] = high[i].max(p[i]);
            }
        };
        for (i, p) in self.points.iter().enumerate() {
            take([p[0], p[1]]);
            let next = if i + 1 < n { self.points[i + 1] } else { self.points[0] };
            if p[2] != 0.0 && (i + 1 < n || self.closed) {
                for q in arc_extremes(*p, next) {
                    take(q);
                }
            }
        }
        (low, high)
    }
    /// Signed area, counter-clockwise positive.
    pub fn area(&self) -> f64 {
        let n = self.points.len();
        let pairs = (0..n).map(|i| (self.points[i], self.points[(i + 1) % n]));
        pairs
            .map(|(a, b)| {
                let chord = (a[0] * b[1] - b[0] * a[1]) / 2.0;
                chord + segment_area(a, b)
            })
            .sum()
    }
}

fn segment_area(a: [f64; 3], b: [f64; 3]) -> f64 {
    if a[2] == 0.0 {
        return 0.0;
    }
    let angle = 4.0 * libm::atan(a[2]);
    let half = libm::hypot(b[0] - a[0], b[1] - a[1]) / 2.0;
    let radius = half / libm::sin(angle / 2.0).abs();
    radius * radius * (angle - libm::sin(angle)) / 2.0
}

/// Centre of the arc from a vertex to the next.
pub fn arc_center(a: [f64; 3], b: [f64; 3]) -> [f64; 2] {
    let k = (1.0 - a[2] * a[2]) / (4.0 * a[2]);
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    [(a[0] + b[0]) / 2.0 - dy * k, (a[1] + b[1]) / 2.0 + dx * k]
}

fn arc_extremes(a: [f64; 3], b: [f64; 3]) -> Vec<[f64; 2]> {
    let c = arc_center(a, b);
    let r = libm::hypot(a[0] - c[0], a[1] - c[1]);
    let start = libm::atan2(a[1] - c[1], a[0] - c[0]);
    let sweep = 4.0 * libm::atan(a[2]);
    let quarter = std::f64::consts::FRAC_PI_2;
    (0..4)
        .filter(|q| {
            let by = f64::from(*q) * quarter - start;
            let by = if sweep >= 0.0 { by.rem_euclid(4.0 * quarter) } else { (-by).rem_euclid(4.0 * quarter) };
            by <= sweep.abs()
        })
        .map(|q| {
            let t = f64::from(q) * quarter;
            [c[0] + r * libm::cos(t), c[1] + r * libm::sin(t)]
        })
        .collect()
}

impl Closed {
    /// As a contour in the frame of the feature, counter-clockwise where the shape has no sense of its own.
    /// `None` for sizes that are no sizes.
    pub fn contour(&self) -> Option<Contour> {
        let good = |v: f64| v.is_finite() && v > 0.0;
        match self {
            Closed::Rectangle { frame, length, width } if good(*length) && good(*width) => {
                let (l, w) = (length / 2.0, width / 2.0);
                let corners = [[-l, -w], [l, -w], [l, w], [-l, w]];
                Some(Contour::polygon(corners.map(|c| flat(frame.point([c[0], c[1], 0.0])))))
            }
            Closed::Circle { frame, diameter } if good(*diameter) => {
                Some(Contour::circle(flat(frame.origin), diameter / 2.0))
            }
            Closed::Ngon { frame, diameter, sides, across_flats } if good(*diameter) && *sides >= 3 => {
                let n = f64::from((*sides).min(10_000));
                let half = std::f64::consts::PI / n;
                let r = if *across_flats { diameter / 2.0 / libm::cos(half) } else { diameter / 2.0 };
                let corner = |i: u32| {
                    let t = 2.0 * half * f64::from(i);
                    flat(frame.point([r * libm::cos(t), r * libm::sin(t), 0.0]))
                };
                Some(Contour::polygon((0..(*sides).min(10_000)).map(corner)))
            }
            Closed::General(contour) if contour.points.len() >= 2 => Some(contour.clone()),
            _ => None,
        }
    }
}

fn flat(p: [f64; 3]) -> [f64; 2] {
    [p[0], p[1]]
}
