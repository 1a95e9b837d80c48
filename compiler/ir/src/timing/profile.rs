//! Speeds along a queue of legs, and the time that each takes.

use super::Dynamics;
use super::piece::End;

/// A piece whose corners are settled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub length: f64,
    /// Speed asked for, as far as axes allow.
    pub target: f64,
    /// Greatest speed with the feed turned up.
    pub most: f64,
    /// Along the path.
    pub acceleration: f64,
    pub end: End,
    /// Speed at its end at most.
    pub kink: f64,
    pub rapid: bool,
    /// Speed below which the next one begins (ends that overlap).
    pub overlap: f64,
    /// Entries that share its time.
    pub shares: (usize, usize),
}

/// The time of every leg, to `to`, in order: leg and seconds.
pub(super) fn times(legs: &[Leg], dynamics: &Dynamics, mut to: impl FnMut(&Leg, f64)) {
    let ends = ends(legs, dynamics);
    let mut speed = 0.0;
    for (i, leg) in legs.iter().enumerate() {
        let after = legs.get(i + 1).map_or(0.0, |n| n.target);
        let end = ends.get(i).copied().unwrap_or(0.0).min(leg.target).min(after);
        let pass = pass(leg, speed, end, dynamics);
        let mut seconds = pass.seconds;
        if leg.end == End::Overlap && i + 1 < legs.len() {
            seconds -= leg.overlap.min(pass.top) / leg.acceleration;
        } else if i + 1 == legs.len() {
            // The last point is reached with the last cycle's rest, and begun and ended with a full cycle.
            seconds += 2.0 * dynamics.cycle;
        } else if leg.end != End::Through {
            // Half a cycle is lost on the way down to a point where the machine stops.
            seconds += 0.5 * dynamics.cycle;
        }
        speed = pass.end;
        to(leg, seconds.max(0.0));
    }
}

/// Speeds at the ends, planned from the back: the machine can always stop within what it has looked ahead.
fn ends(legs: &[Leg], dynamics: &Dynamics) -> Vec<f64> {
    let mut ends = vec![0.0; legs.len()];
    // Sums of 2·a·s from the start, to know what is within the look-ahead.
    let mut sums = Vec::with_capacity(legs.len() + 1);
    let mut sum = 0.0;
    sums.push(0.0);
    for leg in legs {
        sum += 2.0 * leg.acceleration * leg.length;
        sums.push(sum);
    }
    for i in (1..legs.len()).rev() {
        let (before, leg) = (&legs[i - 1], &legs[i]);
        if before.end != End::Through {
            continue;
        }
        let limit = before.most.min(leg.most).min(before.kink);
        // The last one may still be halved by a corner.
        let within = if i + 1 == legs.len() {
            leg.acceleration * leg.length
        } else {
            let ahead = (i + dynamics.look_ahead).min(legs.len());
            (ends[i] * ends[i] + 2.0 * leg.acceleration * leg.length).min(sums[ahead] - sums[i])
        };
        ends[i - 1] = libm::sqrt(within.max(0.0)).min(limit);
    }
    ends
}

struct Pass {
    seconds: f64,
    top: f64,
    end: f64,
}

fn pass(leg: &Leg, start: f64, end: f64, dynamics: &Dynamics) -> Pass {
    let (a, s) = (leg.acceleration, leg.length);
    let square = 2.0 * a * s;
    let reach = libm::sqrt(start * start + square);
    let end = if end >= start { end.min(reach) } else { end.max(libm::sqrt((start * start - square).max(0.0))) };
    // Short legs are passed at an even change of speed.
    let even = leg.end == End::Through && !leg.rapid && end > 1e-8;
    if even && 2.0 * s / (start + end) < dynamics.ramp {
        return Pass { seconds: 2.0 * s / (start + end), top: start.max(end), end };
    }
    // What comes in faster than is asked for here brakes at once.
    let down = (start * start - leg.target * leg.target) / (2.0 * a);
    if down > 0.0 && down < s && end <= leg.target {
        let rest = pass(&Leg { length: s - down, ..*leg }, leg.target, end, dynamics);
        return Pass { seconds: (start - leg.target) / a + rest.seconds, ..rest };
    }
    let top = libm::sqrt((start * start + end * end) / 2.0 + a * s).min(leg.target.max(start).max(end));
    let (up, down) = ((top - start) / a, (top - end) / a);
    let level = s - (2.0 * top * top - start * start - end * end) / (2.0 * a);
    Pass { seconds: up + down + level.max(0.0) / top, top, end }
}
