//! Drilling as canned cycles: strokes down and up again that G81, G82, G85 or G89 makes exactly as the motion has
//! them. Pecking stays spelled out: how far a control stays away from the chips is its own affair.

use super::Language;
use super::emit::Emitter;
use gr_ir::{FeedMode, Op, Plane, Step, View};

/// Heights closer than this are the same, mm.
const SAME: f64 = 1e-9;

/// A stroke: to `z` by feed, perhaps a wait, and back to `r`.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Stroke {
    z: f64,
    r: f64,
    dwell: Option<f64>,
    code: &'static str,
    /// The first operation behind it.
    next: usize,
}

/// Words of a cycle that hold until another motion.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Modal(String);

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

    /// A stroke that begins with this operation.
    fn stroke(&self, index: usize) -> Option<Stroke> {
        let down = self.program.get(index).filter(|s| s.op == Op::Linear && upright(s))?;
        let (r, z) = (down.start.axes[2], down.end.axes[2]);
        let mut next = index + 1;
        let mut dwell = None;
        if let Some(Op::Dwell(t)) = self.program.get(next).map(|s| s.op) {
            dwell = Some(t);
            next += 1;
        }
        let up = self.program.get(next).filter(|s| upright(s) && (s.end.axes[2] - r).abs() < SAME)?;
        let code = match (up.op, dwell) {
            (Op::Rapid, None) => "G81",
            (Op::Rapid, Some(_)) => "G82",
            (Op::Linear, None) => "G85",
            (Op::Linear, Some(_)) => "G89",
            _ => return None,
        };
        (z < r).then_some(Stroke { z, r, dwell, code, next: next + 1 })
    }

    /// Writes a stroke that begins where the tool is.
    pub fn cycle_here(&mut self, view: &View<'_, '_>) -> bool {
        if !self.has_cycles(view) {
            return false;
        }
        let Some(stroke) = self.stroke(view.index) else { return false };
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
        let Some(stroke) = self.stroke(view.index + 2) else { return false };
        if approach.end.axes[2] != stroke.r || !(stroke.r < high) {
            return false;
        }
        let lift = self.program.get(stroke.next).filter(|s| s.op == Op::Rapid && upright(s) && (s.end.axes[2] - high).abs() < SAME);
        if lift.is_none() {
            return false;
        }
        let words = self.axis_words(view.start, view.end, view.source, &[0, 1]);
        self.cycle(view, &stroke, "G98", &words[..2], stroke.next + 1);
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
