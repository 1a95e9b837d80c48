//! Explicit tool paths: cutter location trajectories one after another.

use gr_ir::Op;
use gr_text::code;

use crate::emit::{Emit, TINY};
use crate::frame::{Frame, norm, sub, unit};
use crate::process::*;

/// Paths further apart than this do not just meet badly, mm.
const JUMP: f64 = 0.01;

/// Follows the tool paths of an operation, in the frame of its feature. `first`: they begin a workingstep and the
/// tool is elsewhere.
pub(crate) fn follow(e: &mut Emit<'_>, paths: &[Toolpath], frame: &Frame, technology: Option<(&Technology, Functions)>, security: f64, first: bool) {
    let mut joined = !first;
    let mut by_plane = false;
    for p in paths {
        e.from(p.origin);
        match &p.path {
            PathKind::Feedstop(seconds) => e.push(Op::Dwell(*seconds)),
            PathKind::BySecurityPlane => by_plane = true,
            PathKind::Direct => by_plane = false,
            PathKind::Axes(rows) => {
                if !by_axes(e, p, rows, technology, security, joined && !by_plane) {
                    e.say(code::PLAN_CANNOT_CUT, p.origin, &["the tool path", "it begins with axes that are not where it is known"]);
                    continue;
                }
                joined = true;
                by_plane = false;
            }
            PathKind::Location { curve, axis } => {
                let axes = match axis.as_ref().map(|a| directions(a, curve, frame)) {
                    Some(Some(axes)) => axes,
                    Some(None) => {
                        e.say(code::PLAN_CANNOT_CUT, p.origin, &["the tool path", "its tool axis does not have one direction for every point"]);
                        continue;
                    }
                    None => vec![frame.z; curve.pieces.len() + 1],
                };
                let start = frame.point(curve.start);
                let here = e.standing();
                let gap = e.at.is_none() || norm(sub(here, start)) > TINY;
                if gap && (!joined || by_plane) {
                    // What says it approaches begins above the material; anything else is reached at feed.
                    let above = p.rapid || matches!(p.role.as_str(), "APPROACH" | "NON_CONTACT" | "NONCONTACT" | "CONNECT" | "LIFT");
                    let over = if above { start } else { [start[0], start[1], security.max(start[2])] };
                    e.travel(over, axes[0], security);
                }
                let far = norm(sub(here, start));
                if joined && !by_plane && far > JUMP && !p.rapid && !matches!(p.role.as_str(), "APPROACH" | "LIFT" | "CONNECT" | "NON_CONTACT") {
                    let rule = format!("it begins {far:.3} mm from where the path before it ends: joined by a straight cut");
                    e.say(code::PLAN_TAKES_TURNS, p.origin, &["the tool path", &rule]);
                }
                conditions(e, p, technology);
                let rapid = p.rapid || technology.is_none();
                let go = |e: &mut Emit<'_>, to| if rapid { as_written(e, p, to) } else { e.line(to) };
                e.set_axis(axes[0]);
                e.at.get_or_insert(here);
                go(e, start);
                for (piece, axis) in curve.pieces.iter().zip(&axes[1..]) {
                    e.set_axis(*axis);
                    match piece {
                        Piece::Line(q) => go(e, frame.point(*q)),
                        Piece::Arc { .. } => e.piece(piece, frame),
                    }
                }
                joined = true;
                by_plane = false;
            }
        }
    }
}

/// A rapid of the file itself: kept, and told where it goes through what is left of the raw part.
fn as_written(e: &mut Emit<'_>, p: &Toolpath, to: [f64; 3]) {
    if let Some(top) = e.at.and_then(|from| e.blocked(from, to)) {
        let end = format!("X{:.3} Y{:.3} Z{:.3}", to[0], to[1], to[2]);
        e.say(code::PLAN_RAPID_THROUGH_STOCK, p.origin, &[&end, &format!("{top:.3}")]);
    }
    e.rapid_as_written(to);
}

/// Technology and functions of a piece, or those of its operation.
fn conditions(e: &mut Emit<'_>, p: &Toolpath, usual: Option<(&Technology, Functions)>) {
    let Some((t, functions)) = usual else { return };
    let own = p.technology.as_ref().unwrap_or(t);
    e.technology(own, p.functions.unwrap_or(functions));
    if let Some(f) = own.feed {
        e.feed(f * p.ratio.filter(|r| *r > 0.0 && r.is_finite()).unwrap_or(1.0));
    }
}

/// Axes to positions of the setup; those that are not named stay. False: the first place is not known.
fn by_axes(e: &mut Emit<'_>, p: &Toolpath, rows: &[[Option<f64>; 3]], technology: Option<(&Technology, Functions)>, security: f64, joined: bool) -> bool {
    let Some(first) = rows.first() else { return true };
    if !joined {
        let [Some(x), Some(y), Some(z)] = *first else { return false };
        e.travel([x, y, security.max(z)], [0.0, 0.0, 1.0], security);
    }
    conditions(e, p, technology);
    for row in rows {
        let here = e.standing();
        e.at = Some(here);
        let to = std::array::from_fn(|i| row[i].unwrap_or(here[i]));
        if p.rapid || technology.is_none() { as_written(e, p, to) } else { e.line(to) }
    }
    true
}

fn directions(axis: &Curve, path: &Curve, frame: &Frame) -> Option<Vec<[f64; 3]>> {
    let all: Vec<[f64; 3]> = std::iter::once(axis.start).chain(axis.pieces.iter().map(Piece::end)).collect();
    (all.len() == path.pieces.len() + 1).then_some(())?;
    all.into_iter().map(|d| unit(frame.vector(d))).collect()
}
