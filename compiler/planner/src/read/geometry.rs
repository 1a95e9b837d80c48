//! Points, placements, planes and curves.

use gr_step::{Node, Val};

use gr_text::code;

use super::{Reader, title};
use crate::frame::{Frame, norm, sub, unit};
use crate::process::*;

/// Points that trim a circle lie on it to so many mm.
const OFF_CIRCLE: f64 = 2e-3;
/// Curves inside curves.
const DEEPEST: usize = 32;

impl<'m> Reader<'m> {
    pub fn point(&mut self, node: Node<'m>) -> Option<[f64; 3]> {
        let p = triple(node, "coordinates")?;
        if p.iter().any(|c| !(c.abs() < 1e7)) {
            self.say_at(code::PLAN_BAD_SIZE, node, "coordinates", &[&title(node), "coordinates", &listed(p), "numbers that a machine can have"]);
            return None;
        }
        Some(p)
    }
    pub fn direction(&mut self, node: Node<'m>) -> Option<[f64; 3]> {
        let p = triple(node, "direction_ratios")?;
        let found = unit(p);
        if found.is_none() {
            self.say(code::PLAN_BAD_SIZE, node, &[&title(node), "direction_ratios", &listed(p), "a direction: not all of them zero"]);
        }
        found
    }
    /// An AXIS2_PLACEMENT_3D. Directions that are not given are Z and X.
    pub fn placement(&mut self, node: Node<'m>) -> Option<Frame> {
        let Some(origin) = node.node("location").and_then(|p| self.point(p)) else {
            self.missing(node, "location", "a placement needs a point");
            return None;
        };
        let z = node.node("axis").map_or(Some([0.0, 0.0, 1.0]), |d| self.direction(d))?;
        let usual = if z[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let x = node.node("ref_direction").map_or(Some(usual), |d| self.direction(d))?;
        let frame = Frame::new(origin, z, x);
        if frame.is_none() {
            self.say(code::PLAN_BAD_SIZE, node, &[&title(node), "ref_direction", "parallel to its axis", "another direction than the axis"]);
        }
        frame
    }
    /// A PLANE (or ELEMENTARY_SURFACE) by its placement.
    pub fn plane(&mut self, node: Node<'m>) -> Option<Plane> {
        let frame = node.node("position").and_then(|p| self.placement(p))?;
        Some(Plane { point: frame.origin, normal: frame.z })
    }

    /// A bounded curve in space.
    pub fn curve(&mut self, node: Node<'m>, depth: usize) -> Option<Curve> {
        if depth > DEEPEST {
            self.not_lowered(node, ": curves contain each other");
            return None;
        }
        match node.keyword() {
            "POLYLINE" => {
                let points: Option<Vec<[f64; 3]>> = node.nodes("points").into_iter().map(|p| self.point(p)).collect();
                let points = points.filter(|p| !p.is_empty());
                let Some(points) = points else {
                    self.missing(node, "points", "each needs finite coordinates");
                    return None;
                };
                Some(Curve { start: points[0], pieces: points[1..].iter().map(|p| Piece::Line(*p)).collect() })
            }
            "CIRCLE" => {
                let frame = node.node("position").and_then(|p| self.placement(p))?;
                let r = self.positive(node, "radius", "a circle needs one")?;
                let at = |x: f64| frame.point([x, 0.0, 0.0]);
                let half = |end| Piece::Arc { center: frame.origin, normal: frame.z, end };
                Some(Curve { start: at(r), pieces: vec![half(at(-r)), half(at(r))] })
            }
            "TRIMMED_CURVE" => self.trimmed(node, depth),
            "COMPOSITE_CURVE" => {
                let mut out: Option<Curve> = None;
                for segment in node.nodes("segments") {
                    let parent = segment.node("parent_curve")?;
                    let mut piece = self.curve(parent, depth + 1)?;
                    if segment.attr("same_sense").and_then(|v| v.boolean()) == Some(false) {
                        piece = piece.reversed();
                    }
                    match &mut out {
                        None => out = Some(piece),
                        Some(curve) => {
                            let gap = norm(sub(curve.end(), piece.start));
                            if gap > OFF_CIRCLE {
                                let rule = format!("its segments are {gap:.4} mm apart: joined by a straight cut");
                                self.say(gr_text::code::PLAN_TAKES_TURNS, node, &[&super::title(node), &rule]);
                            }
                            if gap > 1e-6 {
                                curve.pieces.push(Piece::Line(piece.start));
                            }
                            curve.pieces.extend(piece.pieces);
                        }
                    }
                }
                if out.is_none() {
                    self.missing(node, "segments", "a curve needs at least one");
                }
                out
            }
            _ => {
                self.not_lowered(node, "; polylines, circles, trimmed and composite curves are");
                None
            }
        }
    }

    fn trimmed(&mut self, node: Node<'m>, depth: usize) -> Option<Curve> {
        let basis = node.node("basis_curve")?;
        let forward = node.attr("sense_agreement").and_then(|v| v.boolean()) != Some(false);
        let trims = [node.attr("trim_1")?, node.attr("trim_2")?];
        match basis.keyword() {
            "CIRCLE" => {
                let frame = basis.node("position").and_then(|p| self.placement(p))?;
                let r = self.positive(basis, "radius", "a circle needs one")?;
                let ends = trims.map(|t| {
                    self.trim_point(t).or_else(|| {
                        let a = self.angle(trim_parameter(t)?);
                        Some(frame.point([r * libm::cos(a), r * libm::sin(a), 0.0]))
                    })
                });
                let ([Some(start), Some(end)], normal) = (ends, if forward { frame.z } else { frame.z.map(|c| -c) }) else {
                    self.missing(node, "trim_1", "a trimmed circle needs points or parameters");
                    return None;
                };
                for p in [start, end] {
                    let off = norm(sub(p, frame.origin)) - r;
                    if off.abs() > OFF_CIRCLE {
                        self.not_lowered(node, &format!(": a point that trims its circle lies {off:.4} mm off it"));
                        return None;
                    }
                }
                Some(Curve { start, pieces: vec![Piece::Arc { center: frame.origin, normal, end }] })
            }
            "LINE" => {
                let from = basis.node("pnt").and_then(|p| self.point(p))?;
                let vector = basis.node("dir")?;
                let along = vector.node("orientation").and_then(|d| self.direction(d))?;
                let length = vector.real("magnitude").unwrap_or(1.0);
                let ends = trims.map(|t| {
                    self.trim_point(t).or_else(|| {
                        let s = trim_parameter(t)? * length;
                        Some(crate::frame::add(from, crate::frame::scale(along, s)))
                    })
                });
                let [Some(start), Some(end)] = ends else {
                    self.missing(node, "trim_1", "a trimmed line needs points or parameters");
                    return None;
                };
                Some(Curve { start, pieces: vec![Piece::Line(end)] })
            }
            "POLYLINE" if trims.iter().all(|t| trim_parameter(*t).is_none()) => self.curve(basis, depth + 1),
            _ => {
                self.not_lowered(basis, " inside a trimmed curve; lines and circles are");
                None
            }
        }
    }

    fn trim_point(&mut self, t: Val<'m>) -> Option<[f64; 3]> {
        t.items().filter_map(|v| v.node()).find_map(|n| self.point(n))
    }

    /// A curve in the XY plane of `frame` as a contour.
    pub fn contour(&mut self, node: Node<'m>, frame: &Frame) -> Option<Contour> {
        let curve = self.curve(node, 0)?;
        let p = |q: [f64; 3]| frame.point(q);
        let mut points = vec![p(curve.start)];
        let mut bulges = Vec::new();
        let mut at = curve.start;
        for piece in &curve.pieces {
            match *piece {
                Piece::Line(_) => bulges.push(0.0),
                Piece::Arc { center, normal, end } => {
                    if normal[2].abs() < 1.0 - 1e-6 {
                        self.not_lowered(node, ": an arc of a profile does not lie in its plane");
                        return None;
                    }
                    let from = libm::atan2(at[1] - center[1], at[0] - center[0]);
                    let to = libm::atan2(end[1] - center[1], end[0] - center[0]);
                    let tau = 2.0 * std::f64::consts::PI;
                    let mut sweep = if normal[2] > 0.0 { (to - from).rem_euclid(tau) } else { -(from - to).rem_euclid(tau) };
                    if sweep.abs() < 1e-12 {
                        sweep = tau.copysign(normal[2]);
                    }
                    // A bulge says less than a full turn: halves are enough.
                    let turned = frame.z[2].signum();
                    if sweep.abs() > std::f64::consts::PI * 1.5 {
                        let half = from + sweep / 2.0;
                        let r = libm::hypot(at[0] - center[0], at[1] - center[1]);
                        points.push(p([center[0] + r * libm::cos(half), center[1] + r * libm::sin(half), 0.0]));
                        bulges.push(libm::tan(sweep / 8.0) * turned);
                        bulges.push(libm::tan(sweep / 8.0) * turned);
                    } else {
                        bulges.push(libm::tan(sweep / 4.0) * turned);
                    }
                }
            }
            at = piece.end();
            points.push(p(at));
        }
        let mut out: Vec<[f64; 3]> = Vec::with_capacity(points.len());
        for (i, q) in points.iter().enumerate() {
            let bulge = bulges.get(i).copied().unwrap_or(0.0);
            let same = out.last().is_some_and(|l: &[f64; 3]| libm::hypot(l[0] - q[0], l[1] - q[1]) < 1e-9);
            if same {
                if let Some(last) = out.last_mut() {
                    last[2] = bulge;
                }
            } else {
                out.push([q[0], q[1], bulge]);
            }
        }
        let closed = out.len() > 2 && libm::hypot(out[0][0] - out[out.len() - 1][0], out[0][1] - out[out.len() - 1][1]) < 1e-6;
        if closed {
            out.pop();
        }
        Some(Contour { points: out, closed })
    }
}

/// Two or three numbers; what is not written is 0.
fn triple(node: Node<'_>, attribute: &str) -> Option<[f64; 3]> {
    let all: Vec<f64> = node.attr(attribute)?.items().map(|v| v.real()).collect::<Option<_>>()?;
    Some([*all.first()?, all.get(1).copied().unwrap_or(0.0), all.get(2).copied().unwrap_or(0.0)])
}

fn listed(p: [f64; 3]) -> String {
    format!("({})", p.map(gr_step::short).join(", "))
}

fn trim_parameter(t: Val<'_>) -> Option<f64> {
    t.items().find_map(|v| v.real()).or_else(|| t.real())
}
