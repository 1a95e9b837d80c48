//! A rapid that dives deeper than anything cut so far. See the registry row for the rule.

use gr_backends::Words;
use gr_canon::{At, Plane};
use gr_spec::code;

use super::{Found, Lints, Rules, Where};

/// What was cut in a frame: lowest Z and the range of X and Y. Empty: infinities.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Cuts {
    lowest: f64,
    min: [f64; 2],
    max: [f64; 2],
}

impl Default for Cuts {
    fn default() -> Cuts {
        Cuts { lowest: f64::INFINITY, min: [f64::INFINITY; 2], max: [f64::NEG_INFINITY; 2] }
    }
}

/// A rapid that goes deeper than what its chunk cut before it.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Dive {
    pub(super) place: Where,
    end: [f64; 3],
    sideways: bool,
    /// What this chunk cut before it, since the last change of frame.
    before: Cuts,
    /// The frame changed in this chunk before it.
    new_frame: bool,
}

/// A program that dives more often than this in one chunk is not telling anything by it.
pub(super) const MOST_PER_CHUNK: usize = 16;

impl Cuts {
    #[inline]
    fn add(&mut self, p: [f64; 3]) {
        self.lowest = self.lowest.min(p[2]);
        for i in 0..2 {
            self.min[i] = self.min[i].min(p[i]);
            self.max[i] = self.max[i].max(p[i]);
        }
    }
    /// Both together.
    pub(crate) fn join(self, other: &Cuts) -> Cuts {
        let pick = |f: fn(f64, f64) -> f64, a: [f64; 2], b: [f64; 2]| [f(a[0], b[0]), f(a[1], b[1])];
        Cuts {
            lowest: self.lowest.min(other.lowest),
            min: pick(f64::min, self.min, other.min),
            max: pick(f64::max, self.max, other.max),
        }
    }
    fn strictly_inside(&self, p: [f64; 3]) -> bool {
        (0..2).all(|i| self.min[i] < p[i] && p[i] < self.max[i])
    }
}

/// Remembers a feed move.
#[inline]
pub(super) fn cut(lints: &mut Lints<'_>, from: [f64; 3], end: [f64; 3]) {
    // A feed move up cuts no deeper than where it starts, and the start was reached by rapid or by feed.
    if end[2] <= from[2] {
        lints.summary.cuts.add(end);
        let [x, y, _] = from;
        lints.summary.cuts.add([x, y, end[2]]);
    } else {
        lints.summary.cuts.add(end);
    }
}

/// Remembers a rapid that may be a dive.
#[inline]
pub(super) fn rapid(lints: &mut Lints<'_>, at: &At<'_>, end: [f64; 3]) {
    let from = lints.position;
    let deeper = end[2] < from[2] && end[2] < 0.0 && end[2] < lints.summary.cuts.lowest;
    if deeper && lints.upright() && lints.plane == Plane::Xy && lints.summary.dives.len() < MOST_PER_CHUNK && !to_the_machine(at.now) {
        lints.summary.dives.push(Dive {
            place: at.into(),
            end,
            sideways: end[0] != from[0] || end[1] != from[1],
            before: lints.summary.cuts,
            new_frame: lints.summary.new_frame,
        });
    }
}

/// Whether a block goes to a place of the machine (G28, G30, G53, or what the machine does of itself before a tool
/// change): how high that is in the work frame, only the machine knows.
fn to_the_machine(block: &[u8]) -> bool {
    let words = Words::of(&String::from_utf8_lossy(block));
    [280, 300, 530].into_iter().any(|g| words.g(g)) || !words.names_axes() && words.has(b'm')
}

impl Dive {
    /// Whether it dives, `earlier` being what the chunks before cut in the frame that was active at the
    /// chunk's start.
    pub(crate) fn judge(&self, earlier: &Cuts, rules: &Rules) -> Option<Found> {
        let cuts = if self.new_frame { self.before } else { earlier.join(&self.before) };
        let deeper = cuts.lowest.is_finite() && self.end[2] < cuts.lowest;
        if !deeper || !(self.sideways || cuts.strictly_inside(self.end)) {
            return None;
        }
        let severity = rules.severity(code::RAPID_INTO_STOCK)?;
        let args = vec![millimetres(self.end[2]), millimetres(cuts.lowest)];
        Some(Found { code: code::RAPID_INTO_STOCK, severity, place: self.place, letter: Some(b'z'), span: None, args, from: super::From::Lint })
    }
}

/// A length for people.
fn millimetres(length: f64) -> String {
    let rounded = libm::round(length * 1e4) / 1e4;
    // Never `-0`.
    (rounded + 0.0).to_string()
}

#[cfg(test)]
mod tests {
    use super::millimetres;

    #[test]
    fn lengths_are_rounded() {
        assert_eq!(millimetres(-25.400000000000002), "-25.4");
        assert_eq!(millimetres(-0.00001), "0");
        assert_eq!(millimetres(-3.0), "-3");
    }
}
