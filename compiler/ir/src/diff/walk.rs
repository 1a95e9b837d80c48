//! Comparison by shape: both paths as chains of short chords, walked side by side. Where one chain has a
//! corner, the other must have a corner or pass within tolerance.

use super::{
    Aspect, Axes, Class, Conditions, Diff, Event, Op, Program, Spot, Told, Tolerance, distance, place, turned,
};
use crate::Cursor;
use crate::geometry::flatten;

/// A chord or an event. One at a time is held, so its size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
enum Piece {
    Chord(Conditions, Axes),
    Event(Event),
    End,
}

/// One program as chords.
struct Chain<'p> {
    cursor: Cursor<'p>,
    ready: std::collections::VecDeque<Axes>,
    conditions: Option<Conditions>,
    here: Axes,
    spot: Spot,
    head: Piece,
}

impl<'p> Chain<'p> {
    fn new(program: &'p Program, tolerance: &Tolerance) -> Chain<'p> {
        let cursor = program.cursor();
        let here = place(cursor.state(), &cursor.pose().axes, tolerance);
        let (ready, conditions) = (std::collections::VecDeque::new(), None);
        let mut chain = Chain { cursor, ready, conditions, here, spot: None, head: Piece::End };
        chain.pull(tolerance);
        chain
    }

    /// Puts the next chord or event at the head.
    fn pull(&mut self, tolerance: &Tolerance) {
        loop {
            if let (Some(to), Some(conditions)) = (self.ready.pop_front(), self.conditions) {
                if to == self.here {
                    continue;
                }
                self.head = Piece::Chord(conditions, to);
                return;
            }
            let Some(view) = self.cursor.next() else {
                (self.head, self.spot) = (Piece::End, None);
                return;
            };
            self.spot = Some((view.index, view.source));
            if let Some(event) = Event::of(&view) {
                self.head = Piece::Event(event);
                return;
            }
            if view.op.moves() || matches!(view.op, Op::RigidTap { .. }) {
                self.conditions = Some(Conditions::of(&view));
                let (state, ready) = (view.state, &mut self.ready);
                let chord = (tolerance.length / 4.0).max(1e-8);
                flatten(&view.op, view.start, view.end, chord, |p| ready.push_back(place(state, p, tolerance)));
            }
        }
    }
}

pub(super) fn by_shape<'p>(a: &'p Program, b: &'p Program, tolerance: &Tolerance) -> Diff {
    let mut out = Diff::default();
    let (mut p, mut q) = (Chain::new(a, tolerance), Chain::new(b, tolerance));
    let mut told = Told::default();
    loop {
        match (p.head, q.head) {
            (Piece::End, Piece::End) => {
                told.end(&mut out, tolerance);
                return out;
            }
            (Piece::Event(x), Piece::Event(y)) => {
                if !x.same(&y, tolerance) {
                    let message = format!("{}, the other {}", x.text(), y.text());
                    out.note(tolerance.limit, x.aspect(), p.spot, q.spot, message);
                }
                p.pull(tolerance);
                q.pull(tolerance);
            }
            (Piece::Chord(c, to), Piece::Chord(d, other)) if c.class == d.class => {
                told.compare(&mut out, (&c, &d), (p.spot, q.spot), tolerance);
                if let Err(gap) = side_by_side(&mut out, &mut p, &mut q, &to, &other, tolerance) {
                    let mut message = format!("goes to {}, the other to {}", point(&to), point(&other));
                    if point(&to) == point(&other) {
                        message += &format!(", {:.2e} mm apart", distance(&to, &other));
                    } else if gap < NEAR.max(100.0 * tolerance.length) {
                        // The two corners need not belong together.
                        message = format!("goes to {}, the other passes {gap:.2e} mm beside its way", point(&to));
                    }
                    out.note(tolerance.limit, Aspect::Path, p.spot, q.spot, message);
                    return out;
                }
            }
            _ if pass_over(&mut p, &mut q, tolerance) => {}
            (x, y) => {
                let aspect = match (x, y) {
                    (Piece::Event(e), _) | (_, Piece::Event(e)) => e.aspect(),
                    _ => Aspect::Path,
                };
                let message = format!("{}, the other {}", piece_text(&x), piece_text(&y));
                out.note(tolerance.limit, aspect, p.spot, q.spot, message);
                if !skip_event(&mut p, &mut q, tolerance) {
                    return out;
                }
            }
        }
    }
}

/// A rapid or feed move no longer than the tolerance that only one side has: rounding makes one of what is none, where
/// a program goes to where it is. Its end is compared with what follows.
fn pass_over<'p>(p: &mut Chain<'p>, q: &mut Chain<'p>, tolerance: &Tolerance) -> bool {
    let tiny = |c: &Chain<'_>| match c.head {
        Piece::Chord(Conditions { class: Class::Rapid | Class::Feed, .. }, to)
            if distance(&c.here, &to) <= tolerance.length && turned(&c.here, &to) <= tolerance.angle =>
        {
            Some(to)
        }
        _ => None,
    };
    let chain = match (tiny(p), tiny(q)) {
        (Some(to), None) => Some((p, to)),
        (None, Some(to)) => Some((q, to)),
        (Some(a), Some(b)) if distance(&p.here, &a) <= distance(&q.here, &b) => Some((p, a)),
        (Some(_), Some(b)) => Some((q, b)),
        (None, None) => None,
    };
    let Some((chain, to)) = chain else { return false };
    chain.here = to;
    chain.pull(tolerance);
    true
}

/// An event only one side has is passed over, so that the rest can still be compared.
fn skip_event(p: &mut Chain<'_>, q: &mut Chain<'_>, tolerance: &Tolerance) -> bool {
    match (p.head, q.head) {
        (Piece::Event(_), _) => p.pull(tolerance),
        (_, Piece::Event(_)) => q.pull(tolerance),
        _ => return false,
    }
    true
}

/// Below this distance, mm, two paths are told apart by their distance and not by their corners.
const NEAR: f64 = 0.01;

/// Advances both chains to the nearer of their two corners. `Err`: how far the corner is off the other chord.
fn side_by_side<'p>(
    out: &mut Diff,
    p: &mut Chain<'p>,
    q: &mut Chain<'p>,
    to: &Axes,
    other: &Axes,
    tolerance: &Tolerance,
) -> Result<(), f64> {
    let gap = distance(to, other);
    if gap <= tolerance.length && turned(to, other) <= tolerance.angle {
        out.deviation = out.deviation.max(gap);
        (p.here, q.here) = (*to, *other);
        p.pull(tolerance);
        q.pull(tolerance);
        return Ok(());
    }
    let (left, right) = (reach(&p.here, to), reach(&q.here, other));
    let (short, long, corner, end) = if left <= right { (p, q, to, other) } else { (q, p, other, to) };
    let share = nearest(&long.here, end, corner);
    let there = between(&long.here, end, share);
    let gap = distance(&there, corner);
    if gap.is_nan() || gap > tolerance.length || turned(&there, corner) > tolerance.angle {
        return Err(if gap > tolerance.length { gap } else { f64::INFINITY });
    }
    out.deviation = out.deviation.max(gap);
    (short.here, long.here) = (*corner, there);
    short.pull(tolerance);
    Ok(())
}

fn reach(a: &Axes, b: &Axes) -> f64 {
    let d = distance(a, b);
    if d > 0.0 { d } else { turned(a, b) }
}

fn nearest(from: &Axes, to: &Axes, p: &Axes) -> f64 {
    let (mut along, mut all) = (0.0, 0.0);
    for i in 0..9 {
        let d = to[i] - from[i];
        along += d * (p[i] - from[i]);
        all += d * d;
    }
    if all > 0.0 { (along / all).clamp(0.0, 1.0) } else { 0.0 }
}

fn between(a: &Axes, b: &Axes, share: f64) -> Axes {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
}

pub(super) fn point(p: &Axes) -> String {
    let mut text = format!("X{:.4} Y{:.4} Z{:.4}", p[0], p[1], p[2]);
    for (i, name) in [(3, 'A'), (4, 'B'), (5, 'C')] {
        if p[i] != 0.0 {
            text.push_str(&format!(" {name}{:.4}", p[i].to_degrees()));
        }
    }
    for (i, name) in [(6, 'U'), (7, 'V'), (8, 'W')] {
        if p[i] != 0.0 {
            text.push_str(&format!(" {name}{:.4}", p[i]));
        }
    }
    text
}

fn piece_text(piece: &Piece) -> String {
    match piece {
        Piece::Chord(c, to) => format!("makes {} to {}", c.class.name(), point(to)),
        Piece::Event(e) => e.text(),
        Piece::End => "has ended".into(),
    }
}
