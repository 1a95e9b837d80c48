//! Holes as canned cycles, where the cycle of the control makes exactly what the motion has: a stroke down and up again
//! (G81, G82, G85, G86, G89), tapping with a compensating chuck (G84, G74), and of LinuxCNC 2.9, whose distance
//! from the last peck is known, pecking (G83, G73). On other controls that distance is a parameter of the machine.

use super::Language;
use super::emit::Emitter;
use gr_ir::{FeedMode, Op, Override, Plane, Step, Turn, View};

/// Heights closer than this are the same, mm.
const SAME: f64 = 1e-9;

/// How far above the last peck rapids of LinuxCNC 2.9 end, mm.
const PECK_CLEARANCE: f64 = 0.254;
/// Pecks that are looked at.
const MOST_PECKS: usize = 100_000;

/// What a cycle does at its place: from `r` to `z` and back.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Stroke {
    z: f64,
    r: f64,
    /// Where it ends.
    top: f64,
    dwell: Option<f64>,
    peck: Option<f64>,
    code: &'static str,
    /// The first operation behind it.
    next: usize,
    /// A rapid up behind it is part of the cycle too (G98).
    lifts: bool,
}

/// Words of a cycle that hold until another motion.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Modal(String);

/// Where a way up ends that a cycle makes too.
fn top(end: f64, r: f64, high: Option<f64>) -> Option<f64> {
    [Some(r), high].into_iter().flatten().find(|t| (end - t).abs() < SAME)
}

fn upright(s: &Step<'_>) -> bool {
    let (a, b) = (&s.start.axes, &s.end.axes);
    (0..9).all(|i| i == 2 || a[i] == b[i])
}

impl Emitter<'_> {
    fn has_cycles(&self, view: &View<'_, '_>) -> bool {
        self.options.cycles
            && self.options.language != Language::Grbl
            && self.plane == Plane::Xy
            && view.state.feed_mode == FeedMode::PerTime
            && view.state.rotation == 0.0
            && view.end.tool_axis.is_none_or(|a| a[2] > 1.0 - SAME)
            && !self.displaced
    }

    /// A stroke that begins with this operation and goes up to where it began, or to `high` at once.
    fn stroke(&self, index: usize, high: Option<f64>) -> Option<Stroke> {
        let down = self.fed(index)?;
        let (r, z) = (down.start.axes[2], down.end.axes[2]);
        if !(z < r) {
            return None;
        }
        if let Some(pecks) = self.pecks(index, r, high) {
            return Some(pecks);
        }
        let mut next = index + 1;
        let mut dwell = None;
        if let Some(Op::Dwell(t)) = self.program.get(next).map(|s| s.op) {
            dwell = Some(t);
            next += 1;
        }
        let stops = self.turns(next) == Some(Turn::Stop);
        next += usize::from(stops);
        let up = self.program.get(next).filter(|s| upright(s))?;
        let top = top(up.end.axes[2], r, high)?;
        // LinuxCNC's G89 feeds all the way up, and G86 turns the spindle on again when it is up.
        let (code, lifts) = match (up.op, dwell) {
            (Op::Rapid, _) if stops => ("G86", false),
            (Op::Rapid, None) => ("G81", true),
            (Op::Rapid, Some(_)) => ("G82", true),
            (Op::Linear, None) if !stops => ("G85", true),
            (Op::Linear, Some(_)) if !stops => ("G89", false),
            _ => return None,
        };
        next += 1;
        if stops {
            let before = self.turning(index)?;
            if !self.linuxcnc() || self.turns(next) != Some(before) {
                return None;
            }
            (dwell, next) = (dwell.or(Some(0.0)), next + 1);
        }
        Some(Stroke { z, r, top, dwell, peck: None, code, next, lifts })
    }

    /// A feed straight up or down.
    fn fed(&self, index: usize) -> Option<Step<'_>> {
        self.program.get(index).filter(|s| s.op == Op::Linear && upright(s))
    }
    /// A turn of the spindle at this place of the program.
    fn turns(&self, index: usize) -> Option<Turn> {
        match self.program.get(index)?.op {
            Op::SpindleTurn { spindle: 0, turn } => Some(turn),
            _ => None,
        }
    }
    /// How the spindle turns before an operation.
    fn turning(&self, index: usize) -> Option<Turn> {
        let cursor = self.program.cursor_at(index);
        cursor.state().spindles.first().map(|s| s.turn).filter(|t| *t != Turn::Stop)
    }

    /// Pecks of one length: out of the hole, or just up, and back to a little above the bottom.
    fn pecks(&self, index: usize, r: f64, high: Option<f64>) -> Option<Stroke> {
        if !self.options.pecks || !self.linuxcnc() {
            return None;
        }
        let height = |k: usize| self.program.get(k).filter(|s| s.op == Op::Rapid && upright(s)).map(|s| s.end.axes[2]);
        let mut z = self.fed(index)?.end.axes[2];
        let peck = r - z;
        let out = (height(index + 1)? - r).abs() < SAME && height(index + 2).is_some();
        let mut next = index + 1;
        let mut count = 0;
        loop {
            let low = next + usize::from(out);
            // The last rapid goes up and stays there.
            let Some(feed) = self.fed(low + 1).filter(|_| height(low).is_some_and(|h| (h - z - PECK_CLEARANCE).abs() < SAME)) else { break };
            if out && (height(next)? - r).abs() > SAME {
                return None;
            }
            let deeper = z - feed.end.axes[2];
            let last = deeper < peck - SAME;
            if !(deeper > SAME) || deeper > peck + SAME {
                return None;
            }
            (z, next, count) = (feed.end.axes[2], low + 2, count + 1);
            if count > MOST_PECKS {
                return None;
            }
            if last {
                break;
            }
        }
        let top = top(height(next)?, r, high)?;
        let code = if out { "G83" } else { "G73" };
        (count > 0 && self.counts(r, z, peck, count)).then_some(Stroke { z, r, top, dwell: None, peck: Some(peck), code, next: next + 1, lifts: true })
    }

    /// Whether the control makes this many pecks of the written numbers: it takes the length off again and again.
    fn counts(&self, r: f64, z: f64, peck: f64, count: usize) -> bool {
        let (r, z, said) = (self.w.axis(2, r).1, self.w.axis(2, z).1, self.w.length(peck, self.w.places).1);
        let whole = libm::fabs(libm::remainder(r - z, said)) < SAME;
        if (said - peck).abs() > SAME || whole && self.w.unit != 1.0 {
            return false;
        }
        let (mut at, mut made) = (r - said, 0);
        while at > z && made <= count {
            (at, made) = (at - said, made + 1);
        }
        made == count
    }

    /// Tapping with a compensating chuck, from the lock of the feed to its release.
    fn tapping(&self, index: usize) -> Option<Stroke> {
        let op = |k: usize| self.program.get(k).map(|s| s.op);
        let lock = |k: usize, free: bool| op(k) == Some(Op::Override(Override::Feed, free)) && op(k + 1) == Some(Op::Override(Override::Speed(0), free));
        let way = self.turning(index)?;
        let (code, other) = if way == Turn::Cw { ("G84", Turn::Ccw) } else { ("G74", Turn::Cw) };
        let down = self.fed(index + 2).filter(|_| lock(index, false))?;
        let (r, z) = (down.start.axes[2], down.end.axes[2]);
        let reversed = |k: usize, to: Turn| self.turns(k) == Some(Turn::Stop) && self.turns(k + 1) == Some(to);
        let mut next = index + 5;
        let mut dwell = 0.0;
        if let Some(Op::Dwell(t)) = op(next) {
            (dwell, next) = (t, next + 1);
        }
        let up = self.fed(next).filter(|s| (s.end.axes[2] - r).abs() < SAME)?;
        let whole = reversed(index + 3, other) && reversed(next + 1, way) && lock(next + 3, true) && z < r && up.start.axes[2] == z;
        let cursor = self.program.cursor_at(index);
        let free = cursor.state().feed_override && cursor.state().speed_override & 1 != 0;
        (whole && free).then_some(Stroke { z, r, top: r, dwell: Some(dwell), peck: None, code, next: next + 5, lifts: false })
    }

    /// Writes a tapped hole at the place where the tool is.
    pub fn tap_here(&mut self, view: &View<'_, '_>) -> bool {
        if !self.has_cycles(view) || !self.linuxcnc() {
            return false;
        }
        let Some(stroke) = self.tapping(view.index) else { return false };
        let words = self.axis_words(view.start, view.end, view.source, &[0, 1]);
        self.cycle(view, &stroke, "G99", &words[..2], stroke.next);
        self.at[2] = self.w.axis(2, stroke.r).1;
        true
    }

    /// Writes a stroke that begins where the tool is.
    pub fn cycle_here(&mut self, view: &View<'_, '_>) -> bool {
        if !self.has_cycles(view) {
            return false;
        }
        let Some(stroke) = self.stroke(view.index, None) else { return false };
        let words = self.axis_words(view.start, view.end, view.source, &[0, 1]);
        self.cycle(view, &stroke, "G99", &words[..2], stroke.next);
        self.at[2] = self.w.axis(2, stroke.r).1;
        true
    }

    /// Writes a hole from the way to it to the way up again: across, down, stroke and up to where it began.
    pub fn cycle_there(&mut self, view: &View<'_, '_>) -> bool {
        let high = view.end.axes[2];
        let level = (view.start.axes[2] - high).abs() < SAME && self.anchored[2];
        if !level || !self.has_cycles(view) || view.start.axes[3..] != view.end.axes[3..] {
            return false;
        }
        let Some(approach) = self.program.get(view.index + 1).filter(|s| s.op == Op::Rapid && upright(s)) else { return false };
        let Some(stroke) = self.stroke(view.index + 2, Some(high)) else { return false };
        if approach.end.axes[2] != stroke.r || !(stroke.r < high) {
            return false;
        }
        let at_once = stroke.top > stroke.r;
        let lift = self.program.get(stroke.next).filter(|s| s.op == Op::Rapid && upright(s) && (s.end.axes[2] - high).abs() < SAME);
        if !at_once && (lift.is_none() || !stroke.lifts) {
            return false;
        }
        let next = stroke.next + usize::from(!at_once);
        let words = self.axis_words(view.start, view.end, view.source, &[0, 1]);
        self.cycle(view, &stroke, "G98", &words[..2], next);
        true
    }

    fn cycle(&mut self, view: &View<'_, '_>, stroke: &Stroke, level: &str, place: &[String], next: usize) {
        let (z, r) = (self.w.axis(2, stroke.z).0, self.w.axis(2, stroke.r).0);
        let mut modal = format!("{level} {} Z{z} R{r}", stroke.code);
        if let Some(t) = stroke.dwell {
            // Fanuc counts a dwell without a point in milliseconds; LinuxCNC takes seconds.
            let word = if self.linuxcnc() { self.w.number(t, 6) } else { format!("{:.0}", t * 1000.0) };
            modal += &format!(" P{word}");
        }
        if let Some(q) = stroke.peck {
            modal += &format!(" Q{}", self.w.length(q, self.w.places).0);
        }
        let feed = self.feed_words(view.state, view.start, view.end, view.source);
        let modal = Modal(modal);
        let mut line = Vec::new();
        if self.cycle.as_ref() != Some(&modal) || self.motion != Some(81) || self.options.repeat_words {
            line.push(modal.0.clone());
        }
        line.extend(place.iter().cloned());
        line.extend(feed);
        self.w.block(&line.join(" "));
        self.cycle = Some(modal);
        self.motion = Some(81);
        self.done_until = next;
    }
}
