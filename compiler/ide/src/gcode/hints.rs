//! Remarks inside of the text: what the line does not say.

use gr_canon::Units;
use gr_gcode::Form;
use gr_interp::Modal;
use gr_ir::Program;

use super::doc::{Doc, LineOf, code_name, duration, number};
use super::modes::{AXES, codes, moves, position};
use crate::{Hint, HintKind};

/// Which hints are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HintKinds {
    /// The motion code that a block goes on with.
    pub motion: bool,
    /// Where a block ends.
    pub position: Positions,
    /// Feed in mm/min where the text has another unit.
    pub feed: bool,
    /// Modes that change without a code in the block.
    pub modes: bool,
    /// Time of a block.
    pub time: bool,
    /// Radius of arcs with a centre, centre of arcs with a radius.
    pub arc: bool,
    /// Values of expressions.
    pub values: bool,
    /// Attribute names (STEP-NC).
    pub attributes: bool,
}

/// For which blocks the end is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Positions {
    /// None.
    Off,
    /// Those whose words are not the end itself: incremental, computed, cycles, machine coordinates.
    Computed,
    /// All that move.
    All,
}

impl Default for HintKinds {
    fn default() -> Self {
        HintKinds { motion: true, position: Positions::Computed, feed: true, modes: true, time: true, arc: true, values: true, attributes: true }
    }
}

/// A block of the program as it is run.
#[derive(Clone, Copy)]
pub struct Ran<'a> {
    /// Its line.
    pub line: u32,
    /// Before it.
    pub before: &'a Modal,
    /// After it.
    pub after: &'a Modal,
    /// Its motion.
    pub program: &'a Program,
    /// The time it takes in the program, s; none where it is not known.
    pub seconds: Option<f64>,
}

/// Times below this are not worth a remark, s.
const SHORT: f64 = 0.05;

/// Hints of some blocks.
pub fn hints(doc: Doc<'_>, ran: &[Ran<'_>], kinds: &HintKinds) -> Vec<Hint> {
    let mut found = Vec::new();
    for run in ran {
        if let Some(line) = doc.line(run.line) {
            of_line(&line, run, kinds, &mut found);
        }
    }
    found
}

fn of_line(line: &LineOf<'_>, run: &Ran<'_>, kinds: &HintKinds, found: &mut Vec<Hint>) {
    let words = line.words();
    let Some(last) = words.iter().rfind(|w| w.form != Form::Comment) else { return };
    let end = line.tight(last).end;
    let units = run.before.units();
    let m = moves(run.program, units);
    let mut push = |at: u32, text: String, kind: HintKind, tooltip: String| found.push(Hint { at, text, kind, tooltip });
    let moved = m.totals.moves > 0;
    if kinds.motion
        && moved
        && let Some(text) = implied_motion(line, run)
        && let Some(first) = words.iter().find(|w| is_axis(w.letter) || matches!(w.letter, b'i' | b'j' | b'k' | b'r'))
    {
        push(line.tight(first).start, format!("{text} "), HintKind::Motion, format!("{text} is still in force"));
    }
    if kinds.values {
        values(line, run, m.totals.moves, &mut push);
    }
    if kinds.feed
        && let Some(f) = line.word(b'f')
        && (run.after.feed_mode != 0 || run.after.units() == Units::Inch)
        && m.feed > 0.0
    {
        push(line.tight(f).end, format!("= {} mm/min", number(m.feed, 1)), HintKind::Feed, String::new());
    }
    let mut tail: Vec<(String, HintKind)> = Vec::new();
    if kinds.arc
        && m.totals.moves == 1
        && let Some(arc) = m.arc
    {
        let text = if line.word(b'r').is_some() {
            let (first, second, _) = gr_ir::plane_axes(arc.plane);
            format!("centre {}{} {}{}", AXES[first], number(arc.center[first], 4), AXES[second], number(arc.center[second], 4))
        } else {
            format!("R{}", number(arc.radius[0], 4))
        };
        tail.push((text, HintKind::Arc));
    }
    let computed = computed(line, run, m.totals.moves);
    if moved && (kinds.position == Positions::All || (kinds.position == Positions::Computed && computed)) {
        let text = position(run.after, Some(run.before));
        if !text.is_empty() {
            tail.push((format!("→ {text}"), HintKind::Position));
        }
    }
    if kinds.modes {
        let changed = changed(line, run);
        if !changed.is_empty() {
            tail.push((changed, HintKind::Modes));
        }
    }
    if kinds.time
        && moved
        && m.totals.untimed == 0
        && let Some(seconds) = run.seconds.filter(|s| *s >= SHORT)
    {
        tail.push((duration(seconds), HintKind::Time));
    }
    for (text, kind) in tail {
        push(end, text, kind, String::new());
    }
}

fn is_axis(letter: u8) -> bool {
    matches!(letter, b'x' | b'y' | b'z' | b'a' | b'b' | b'c' | b'u' | b'v' | b'w')
}

/// The motion code that a block without one goes on with.
fn implied_motion(line: &LineOf<'_>, run: &Ran<'_>) -> Option<String> {
    let code = |w: &gr_gcode::Word| w.letter == b'g' && (w.form != Form::Literal || is_motion(w.value));
    if line.words().iter().any(code) || run.before.motion < 0 || run.before.motion == 800 {
        return None;
    }
    line.words().iter().any(|w| is_axis(w.letter)).then(|| code_name(b'g', f64::from(run.before.motion) / 10.0))
}

/// Motion and the codes that take axis words for themselves.
fn is_motion(value: f64) -> bool {
    let n = (value * 10.0).round() as i64;
    matches!(n, 0..=33 | 50..=53 | 100 | 280..=283 | 300..=303 | 330..=389 | 520..=530 | 700..=899 | 920..=923) || n == 731 || n == 741
}

/// Whether the axis words of a block are not the end position themselves.
fn computed(line: &LineOf<'_>, run: &Ran<'_>, moves: u64) -> bool {
    let axis = |w: &&gr_gcode::Word| is_axis(w.letter) || matches!(w.letter, b'@' | b'^');
    run.before.incremental != 0
        || moves > 1
        || line.words().iter().filter(axis).any(|w| w.form == Form::Expr || !is_axis(w.letter))
        || [280, 281, 300, 301, 530].iter().any(|c| line.has_code(b'g', *c))
}

/// Values of computed words: `X[#1 * 2]` = 10. Only where the state behind the block has them: those of words that are
/// the end of one plain move, and of F, S and T in a block that is good.
fn values(line: &LineOf<'_>, run: &Ran<'_>, moves: u64, push: &mut impl FnMut(u32, String, HintKind, String)) {
    let other = [50, 51, 52, 53, 100, 280, 281, 300, 301, 520, 530, 920, 921, 922, 923];
    let plain = moves == 1
        && matches!(run.after.motion, 0 | 10 | 20 | 30)
        && run.before.incremental == 0
        && run.after.incremental == 0
        && run.before.comp_side == 0
        && run.after.comp_side == 0
        && run.after.lathe_diameter == 0
        && !other.iter().any(|c| line.has_code(b'g', *c));
    let good = moves > 0 || run.before.bytes() != run.after.bytes();
    for w in line.words().iter().filter(|w| w.form == Form::Expr) {
        let value = match w.letter {
            l if is_axis(l) && plain => AXES.iter().position(|a| a.eq_ignore_ascii_case(&(l as char))).map(|i| run.after.current[i]),
            // In inverse time F is of the block alone.
            b'f' if good && run.after.feed_mode != 1 => Some(run.after.feed),
            b's' if good => Some(run.after.speed[run.after.active_spindle.clamp(0, 7) as usize]),
            b't' if good => Some(f64::from(run.after.selected_tool)),
            _ => None,
        };
        if let Some(value) = value {
            push(line.tight(w).end, format!("= {}", number(value, 4)), HintKind::Value, "when the block is run for the first time".into());
        }
    }
}

/// Modes that changed and are not written in the block.
fn changed(line: &LineOf<'_>, run: &Ran<'_>) -> String {
    let (before, after) = (codes(run.before), codes(run.after));
    let written: Vec<String> = line.words().iter().filter(|w| matches!(w.letter, b'g' | b'm') && w.form == Form::Literal).map(|w| code_name(w.letter, w.value)).collect();
    let ends = written.iter().any(|c| c == "M2" || c == "M30");
    let new: Vec<&str> = after.iter().filter(|c| !before.contains(c) && !written.contains(c)).map(String::as_str).collect();
    // What G80 and the compensation codes do is what they say.
    let quiet = ["G80", "G43", "G49", "G40", "G41", "G42"];
    let own = |c: &&str| quiet.contains(c) && written.iter().any(|w| w.starts_with(&c[..2]) || w == "G80");
    let new: Vec<&str> = new.into_iter().filter(|c| !own(c)).collect();
    if new.is_empty() || ends { String::new() } else { format!("now {}", new.join(" ")) }
}
