//! What can be done to a G-code file at a place.

use gr_canon::Units;
use gr_gcode::{Form, Renumber};
use gr_interp::{Modal, Side};
use gr_ir::geometry::ArcShape;
use gr_ir::{Op, PathMode, Program};
use gr_text::Span;

use super::doc::{Doc, LineOf, code_name, number};
use super::modes::AXES;
use crate::{Action, ActionKind, Edit};

/// What actions need besides the text.
#[derive(Clone, Copy, Default)]
pub struct Context<'a> {
    /// The block under the cursor as it is run: state before and after, and motion.
    pub run: Option<(&'a Modal, &'a Modal, &'a Program)>,
    /// It is run exactly once: what is written in its place then is right every time.
    pub once: bool,
}

/// Moves that one block is expanded into, at most.
const MOST_MOVES: usize = 5_000;

/// Rewritings of what stands at a byte of the file.
pub fn actions(doc: Doc<'_>, at: Span, context: Context<'_>) -> Vec<Action> {
    let mut found = Vec::new();
    if let Some(line) = doc.line_at(at.start) {
        if let Some((before, after, program)) = context.run.filter(|_| context.once) {
            found.extend(other_arc_form(&line, before, after, program));
            found.extend(expand(doc, &line, before, after, program));
        }
    }
    found
}

/// Cutter compensation and diameters: the words of such blocks are not the tool's way.
pub fn is_shifted(m: &Modal) -> bool {
    m.side() != Side::Off || m.lathe_diameter != 0
}

/// I J K ↔ R.
fn other_arc_form(line: &LineOf<'_>, before: &Modal, after: &Modal, program: &Program) -> Option<Action> {
    if is_shifted(before) || is_shifted(after) {
        return None;
    }
    let arc_words = |w: &&gr_gcode::Word| matches!(w.letter, b'i' | b'j' | b'k' | b'r');
    let words: Vec<&gr_gcode::Word> = line.words().iter().filter(arc_words).collect();
    let literal = words.iter().all(|w| w.form == Form::Literal);
    let mut moves = program.steps().filter(|s| s.op.moves());
    let (Some(step), None) = (moves.next(), moves.next()) else { return None };
    let Op::Arc(arc) = step.op else { return None };
    if words.is_empty() || !literal || arc.turns.abs() > 1 || line.word(b'p').is_some() {
        return None;
    }
    // Plane, unit and kind of centre may stand in the block itself: they hold before it moves.
    let scale = if after.units() == Units::Inch { 25.4 } else { 1.0 };
    let places = if after.units() == Units::Inch { 5 } else { 4 };
    let shape = ArcShape::new(&arc, &step.start, &step.end);
    let (first, second, _) = gr_ir::plane_axes(after.plane());
    let (title, text) = if words.iter().any(|w| w.letter == b'r') {
        let start = step.start.xyz();
        let base = |i: usize| if after.ijk_absolute != 0 { 0.0 } else { start[i] };
        let word = |i: usize| format!("{}{}", ['I', 'J', 'K'][i.min(2)], number((shape.center[i] - base(i)) / scale, places));
        ("Write the arc with its centre (I J K)", format!("{} {}", word(first.min(second)), word(first.max(second))))
    } else {
        ("Write the arc with its radius (R)", format!("R{}", radius_word(&shape, [first, second], scale, places)?))
    };
    let span = Span::new(line.tight(words.first()?).start, line.tight(words.last()?).end);
    let between = line.words().iter().any(|w| !arc_words(&w) && { let s = line.tight(w); s.start > span.start && s.end < span.end });
    let mut edits = vec![Edit { span, text: text.clone() }];
    if between {
        edits = words.iter().enumerate().map(|(i, w)| Edit { span: line.tight(w), text: if i == 0 { text.clone() } else { String::new() } }).collect();
    }
    Some(Action { title: title.into(), kind: ActionKind::Rewrite, edits })
}

/// The R of an arc, with as many decimals as keep its path within half the last of `places`; none where no R does.
fn radius_word(shape: &ArcShape, axes: [usize; 2], scale: f64, places: usize) -> Option<String> {
    // A whole circle has no radius form, and near half a turn it is vague.
    let degrees = shape.sweep.to_degrees().abs();
    if degrees > 359.0 || (179.0..181.0).contains(&degrees) {
        return None;
    }
    let flat = |p: [f64; 3]| [p[axes[0]], p[axes[1]]];
    let (start, middle, end) = (flat(shape.point(0.0)), flat(shape.point(0.5)), flat(shape.point(1.0)));
    let between = |a: [f64; 2], b: [f64; 2]| ((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1])).sqrt();
    let (chord, tolerance) = (between(start, end), 0.5 * scale / 10f64.powi(places as i32));
    // Through both ends and the middle: written ends differ from the circle around a written centre.
    let rise = between([(start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0], middle);
    let round = (rise * rise + chord * chord / 4.0) / (2.0 * rise);
    let radius = if degrees > 180.0 { -round } else { round } / scale;
    // How far the arc of a radius lies from the one that there is, in the middle between the ends.
    let away = |r: f64| {
        let to_chord = (r * r - chord * chord / 4.0).sqrt();
        (rise - r.abs() - if degrees > 180.0 { to_chord } else { -to_chord }).abs()
    };
    let written = (places..places + 5).map(|n| number(radius, n));
    let mut near = written.filter(|w| w.parse::<f64>().is_ok_and(|r| away(r * scale) <= tolerance));
    near.next()
}

/// The code of a block that says how it moves: those of drilling cycles and G80 too, which are a group of their own on
/// some controls.
fn motion_code(doc: Doc<'_>, line: &LineOf<'_>) -> Option<f64> {
    let mut codes = line.words().iter().filter(|w| w.letter == b'g' && w.form == Form::Literal);
    let moves = |w: &&gr_gcode::Word| {
        matches!(w.value, 73.0 | 74.0 | 76.0) || (80.0..90.0).contains(&w.value)
            || doc.dialect.code(&code_name(w.letter, w.value)).is_some_and(|c| c.group == "motion")
    };
    codes.find(moves).map(|w| w.value)
}

/// Whether blocks are skipped by a switch of the machine: what another block does then hangs on it.
pub fn skips_blocks(doc: Doc<'_>) -> bool {
    doc.file.chunks.iter().any(|c| c.scan.lines.iter().any(|l| l.deleted))
}

/// Whether the next motion is a cycle without a G80 before it: as one in a row it goes to its hole before it goes down to
/// its R, behind plain moves it does not.
fn a_cycle_follows(doc: Doc<'_>, line: u32) -> bool {
    let next = doc.lines(line + 1..doc.count()).find_map(|l| motion_code(doc, &l));
    next.is_some_and(|v| v == 73.0 || v == 74.0 || (81.0..90.0).contains(&v))
}

/// Fanuc: whether the block behind the end of a cycle goes on with the motion of before it, which the moves written in
/// place of the cycle are no longer.
fn back_to_old_motion(doc: Doc<'_>, line: u32) -> bool {
    if doc.dialect.family != gr_spec::Family::Fanuc {
        return false;
    }
    let axis = |l: &LineOf<'_>| l.words().iter().any(|w| matches!(w.letter, b'x' | b'y' | b'z' | b'a' | b'b' | b'c' | b'u' | b'v' | b'w' | b'h'));
    let mut ended = false;
    for l in doc.lines(line + 1..doc.count()) {
        match motion_code(doc, &l) {
            Some(80.0) => ended = true,
            Some(_) => return false,
            None => {}
        }
        if ended && axis(&l) {
            return true;
        }
    }
    false
}

/// Whether a block behind a line goes on with its cycle, or takes over words of it: depth, R, P or Q.
fn is_leant_on(doc: Doc<'_>, line: u32) -> bool {
    let (mut said, mut over) = (std::collections::BTreeSet::new(), false);
    for l in doc.lines(line + 1..doc.count()) {
        let codes = || l.words().iter().filter(|w| w.letter == b'g' && w.form == Form::Literal).map(|w| w.value);
        let is_cycle = |v: &f64| *v == 73.0 || *v == 74.0 || (81.0..90.0).contains(v);
        let Some(cycle) = codes().find(is_cycle) else {
            over |= codes().any(|v| v == 80.0 || (0.0..4.0).contains(&v));
            if !over && l.words().iter().any(|w| matches!(w.letter, b'x' | b'y' | b'z' | b'r')) {
                return true;
            }
            continue;
        };
        over = true;
        said.extend(l.words().iter().map(|w| w.letter));
        let turned = doc.lines(line + 1..l.line + 1).any(|l| [180, 190].iter().any(|c| l.has_code(b'g', *c)));
        let more: &[u8] = match (cycle as i64, turned) {
            (_, true) => b"rxyzpq",
            (73 | 83, _) => b"rzq",
            (82 | 86 | 88 | 89, _) => b"rzp",
            _ => b"rz",
        };
        if !more.iter().all(|w| said.contains(w)) {
            return true;
        }
    }
    false
}

/// Writes the moves that a cycle makes.
fn expand(doc: Doc<'_>, line: &LineOf<'_>, before: &Modal, after: &Modal, program: &Program) -> Option<Action> {
    let cycle = (730..=899).contains(&after.motion) && after.motion != 800;
    let moves = program.steps().filter(|s| s.op.moves()).count();
    // A setting in the block would be lost with its words.
    let sets = line.words().iter().any(|w| matches!(w.form, Form::Setting | Form::Control | Form::Bad));
    if moves == 0 || moves > MOST_MOVES || !cycle || sets || is_shifted(before) || is_shifted(after) || is_leant_on(doc, line.line) || a_cycle_follows(doc, line.line) || back_to_old_motion(doc, line.line) {
        return None;
    }
    // A block that goes on with a cycle takes more from it than its words.
    if !line.words().iter().any(|w| w.letter == b'g' && w.form == Form::Literal && (w.value == 73.0 || w.value == 74.0 || (81.0..90.0).contains(&w.value))) {
        return None;
    }
    let title = format!("Write out this {}", code_name(b'g', f64::from(after.motion) / 10.0));
    let (text, code) = write_moves(doc.dialect, program, before, after, false)?;
    let words = line.words();
    let first = words.iter().find(|w| w.form != Form::Comment && !(w.letter == b'n'))?;
    let last = words.iter().rfind(|w| w.form != Form::Comment)?;
    let span = Span::new(line.tight(first).start, line.tight(last).end);
    let mut edits = vec![Edit { span, text }];
    edits.extend(goes_on(doc, line.line, code, after)?);
    Some(Action { title, kind: ActionKind::Inline, edits })
}

/// What the next block with axis words needs when it goes on with the motion of a line whose words are replaced: the
/// motion's code, and for a cycle the words that it remembers. `code`: the last one written there. `None`: that can't be
/// told from the text.
pub fn goes_on(doc: Doc<'_>, line: u32, code: &str, after: &Modal) -> Option<Option<Edit>> {
    const MOST_LINES: u32 = 2_000;
    let wanted = code_name(b'g', f64::from(after.motion) / 10.0);
    // Behind G80 nothing goes on.
    if after.motion < 0 || after.motion == 800 || wanted == code {
        return Some(None);
    }
    let motion = |l: &LineOf<'_>| motion_code(doc, l).is_some();
    let unclear = |l: &LineOf<'_>| l.words().iter().any(|w| matches!(w.form, Form::Control | Form::Bad) || w.form == Form::Expr && w.letter == b'g') || l.has_code(b'm', 980) || l.has_code(b'm', 990);
    let axis = |w: &&gr_gcode::Word| matches!(w.letter, b'x' | b'y' | b'z' | b'a' | b'b' | b'c' | b'u' | b'v' | b'w' | b'@' | b'^');
    let mut next = None;
    for l in doc.lines(line + 1..line + 1 + MOST_LINES) {
        if motion(&l) || l.has_code(b'm', 20) || l.has_code(b'm', 300) {
            break;
        }
        if unclear(&l) {
            return None;
        }
        // Back to the old level, which a cycle that begins anew does not know.
        if next.is_some() && after.retract_r != 0 && l.has_code(b'g', 980) {
            return None;
        }
        if next.is_none() && l.words().iter().find(axis).is_some() {
            next = Some(l);
        }
    }
    let Some(next) = next else { return Some(None) };
    let at = next.tight(next.words().iter().find(axis)?).start;
    let mut text = format!("{wanted} ");
    if (730..=899).contains(&after.motion) {
        // Levels that count from the last one would count from another.
        if after.incremental != 0 {
            return None;
        }
        let (_, _, normal) = gr_ir::plane_axes(after.plane());
        let deep = [b'x', b'y', b'z', b'a', b'b', b'c', b'u', b'v', b'w'].get(normal).copied()?;
        for letter in [deep, b'r', b'q', b'p'] {
            if next.word(letter).is_some() {
                continue;
            }
            // The block of the cycle that says it last, back to the one with the code.
            for l in (line.saturating_sub(MOST_LINES)..=line).rev().filter_map(|n| doc.line(n)) {
                if unclear(&l) || l.words().iter().any(|w| w.form == Form::Setting) {
                    return None;
                }
                if let Some(w) = l.word(letter) {
                    let w = Some(w).filter(|w| w.form == Form::Literal)?;
                    text.push_str(l.slice(l.tight(w)));
                    text.push(' ');
                    break;
                }
                if motion(&l) {
                    break;
                }
            }
        }
    }
    Some(Some(Edit { span: Span::new(at, at), text }))
}

/// Whether lines set parameters that outlive a subroutine, or give values back.
pub fn sets_globals(doc: Doc<'_>, lines: std::ops::Range<u32>) -> bool {
    use gr_gcode::{Keyword, Target};
    let local = |l: &LineOf<'_>, w: &gr_gcode::Word| {
        let scan = &l.chunk.scan;
        match w.form {
            Form::Setting => scan.settings.get(w.index()).is_some_and(|s| match s.target {
                Target::Named(name) => scan.names.get(name as usize).is_some_and(|n| !n.starts_with('_')),
                Target::Number(n) => matches!(scan.nodes.get(n.0 as usize), Some(gr_gcode::Node::Number(v)) if (1.0..31.0).contains(v)),
            }),
            Form::Control => scan.controls.get(w.index()).is_some_and(|c| c.arg_count == 0 || !matches!(c.keyword, Keyword::Endsub | Keyword::Return)),
            Form::Bad => false,
            _ => true,
        }
    };
    doc.lines(lines).any(|l| l.words().iter().any(|w| !local(&l, w)))
}

/// Whether a jump goes where a value says (`GOTO #1`): line numbers then are more than names. The same of contours that
/// a turning cycle names.
fn jumps_by_value(doc: Doc<'_>) -> bool {
    let dynamic = |c: &gr_gcode::Chunk| {
        let jump = |k| matches!(k, gr_gcode::Keyword::MacroGoto | gr_gcode::Keyword::MacroIfGoto);
        let statements = gr_gcode::symbols(&c.text, &c.scan).statements;
        statements.iter().any(|s| jump(s.what.keyword) && s.what.label == gr_gcode::Label::Dynamic)
    };
    let with_control = || doc.file.chunks.iter().filter(|c| !c.scan.controls.is_empty());
    with_control().any(dynamic) || doc.dialect.id == "fanuc-turn" && doc.lines(0..doc.count()).any(|l| [700, 710, 720, 730].iter().any(|c| l.has_code(b'g', *c)))
}

/// Lines from the G41 or G42 before a line to the G40 behind it; none when the line is not between such.
pub fn compensated_lines(doc: Doc<'_>, line: u32) -> Option<std::ops::Range<u32>> {
    const MOST_LINES: u32 = 2_000;
    let on = |l: &LineOf<'_>| [410, 411, 420, 421].iter().any(|c| l.has_code(b'g', *c));
    let off = |l: &LineOf<'_>| l.has_code(b'g', 400);
    let first = (line.saturating_sub(MOST_LINES)..line + 1).rev().filter_map(|n| doc.line(n)).find(|l| on(l) || (off(l) && l.line != line))?;
    let last = doc.lines(line..line + MOST_LINES).find(|l| off(l) || (on(l) && l.line != line && l.line != first.line))?;
    (on(&first) && off(&last)).then(|| first.line..last.line + 1)
}

/// Writes the tool's own path in place of a contour under cutter compensation: the blocks of
/// [`compensated_lines`] as they are run, each exactly once. Only where they hold nothing but motion.
pub fn write_out_compensation(doc: Doc<'_>, lines: std::ops::Range<u32>, ran: &[(u32, &Modal, &Modal, &Program)]) -> Option<Action> {
    let other = |w: &&gr_gcode::Word| matches!(w.letter, b'm' | b's' | b't' | b'h') || matches!(w.form, Form::Setting | Form::Control | Form::Bad);
    if doc.lines(lines.clone()).any(|l| l.words().iter().find(other).is_some()) {
        return None;
    }
    let (first, last) = (ran.first()?, ran.last()?);
    if is_shifted(first.1) || is_shifted(last.2) || ran.iter().any(|r| r.1.lathe_diameter != 0) {
        return None;
    }
    // Compensation that ends without a move leaves the tool beside its place: the next move also brings it there.
    let scale = if last.2.units() == Units::Inch { 25.4 } else { 1.0 };
    let end = ran.iter().rev().find_map(|r| r.3.steps().filter(|s| s.op.moves()).last().map(|s| s.end.axes));
    let there = end.is_some_and(|e| (0..3).all(|i| (e[i] / scale - last.2.current[i]).abs() < 1e-6));
    if !there && doc.lines(last.0 + 1..doc.count()).any(|l| l.words().iter().any(|w| matches!(w.letter, b'x' | b'y' | b'z' | b'u' | b'v' | b'w' | b'@' | b'^') || w.form == Form::Control)) {
        return None;
    }
    let edits = write_out(doc, lines, ran, true)?;
    Some(Action { title: "Write out this contour without compensation".into(), kind: ActionKind::Inline, edits })
}

/// The blocks of a drilling cycle and of what goes on with it, when they are more than one.
pub fn cycle_lines(doc: Doc<'_>, line: u32) -> Option<std::ops::Range<u32>> {
    const MOST_LINES: u32 = 1_000;
    let motion = |l: &LineOf<'_>| motion_code(doc, l);
    let first = (line.saturating_sub(MOST_LINES)..line + 1).rev().filter_map(|n| doc.line(n)).find(|l| motion(l).is_some())?;
    motion(&first).filter(|v| *v == 73.0 || *v == 74.0 || (81.0..90.0).contains(v))?;
    let ends = |l: &LineOf<'_>| motion(l).is_some() || l.words().iter().any(|w| matches!(w.form, Form::Control | Form::Setting | Form::Bad) || w.letter == b'm');
    let behind = doc.lines(first.line + 1..first.line + MOST_LINES).take_while(|l| !ends(l));
    let last = behind.filter(|l| l.words().iter().any(|w| matches!(w.letter, b'x' | b'y' | b'z'))).last()?.line;
    (line <= last).then(|| first.line..last + 1)
}

/// Writes the moves of a drilling cycle and of the blocks that go on with it.
pub fn write_out_cycle(doc: Doc<'_>, lines: std::ops::Range<u32>, ran: &[(u32, &Modal, &Modal, &Program)]) -> Option<Action> {
    let moves: usize = ran.iter().map(|r| r.3.steps().filter(|s| s.op.moves()).count()).sum();
    let (first, last) = (ran.first()?, ran.last()?);
    if moves > MOST_MOVES || ran.iter().any(|r| is_shifted(r.1) || is_shifted(r.2)) || is_leant_on(doc, last.0) || a_cycle_follows(doc, last.0) || back_to_old_motion(doc, last.0) {
        return None;
    }
    let edits = write_out(doc, lines, ran, false)?;
    let name = code_name(b'g', f64::from(first.2.motion) / 10.0);
    Some(Action { title: format!("Write out this {name} and the blocks that go on with it"), kind: ActionKind::Inline, edits })
}

/// The moves of each line in place of its words, and what the next block needs then.
fn write_out(doc: Doc<'_>, lines: std::ops::Range<u32>, ran: &[(u32, &Modal, &Modal, &Program)], compensated: bool) -> Option<Vec<Edit>> {
    let end = ran.last()?;
    let (mut edits, mut code) = (Vec::new(), "");
    for line in doc.lines(lines) {
        let words = line.words();
        let Some(first) = words.iter().find(|w| w.form != Form::Comment && w.letter != b'n') else { continue };
        let last = words.iter().rfind(|w| w.form != Form::Comment)?;
        let (_, before, after, program) = ran.iter().find(|r| r.0 == line.line)?;
        let (text, last_code) = write_moves(doc.dialect, program, before, after, compensated)?;
        code = if last_code.is_empty() { code } else { last_code };
        edits.push(Edit { span: Span::new(line.tight(first).start, line.tight(last).end), text });
    }
    // Blocks behind it that say no code go on with the last one.
    edits.extend(goes_on(doc, end.0, code, end.2)?);
    Some(edits)
}

/// Whether two states differ in nothing but place, feed, distance mode, level of return, motion code and the memory
/// of cycles; `compensated`: and in what compensation is about.
fn alike(before: &Modal, after: &Modal, compensated: bool) -> bool {
    let mut m = *after;
    (m.current, m.program, m.feed) = (before.current, before.program, before.feed);
    (m.incremental, m.retract_r, m.motion, m.n_number) = (before.incremental, before.retract_r, before.motion, before.n_number);
    (m.cycle_cc, m.cycle_i, m.cycle_j, m.cycle_k) = (before.cycle_cc, before.cycle_i, before.cycle_j, before.cycle_k);
    (m.cycle_p, m.cycle_q, m.cycle_r, m.cycle_l) = (before.cycle_p, before.cycle_q, before.cycle_r, before.cycle_l);
    (m.cycle_il, m.cycle_il_set, m.before_cycle, m.spline_tail) = (before.cycle_il, before.cycle_il_set, before.before_cycle, before.spline_tail);
    if compensated {
        (m.comp_side, m.comp_first, m.comp_radius) = (before.comp_side, before.comp_first, before.comp_radius);
        (m.comp_orientation, m.arc_not_allowed) = (before.comp_orientation, before.arc_not_allowed);
    }
    m.bytes() == before.bytes()
}

/// Moves as plain G0 G1 G2 G3 G4 in absolute distance, with what else the block leaves behind, and the last code of them.
/// None where the program does more than these can say, or where F is not a feed per minute.
pub fn write_moves(dialect: &gr_spec::Dialect, program: &Program, before: &Modal, after: &Modal, compensated: bool) -> Option<(String, &'static str)> {
    if before.feed_mode != 0 || !alike(before, after, compensated) {
        return None;
    }
    let scale = if before.units() == Units::Inch { 25.4 } else { 1.0 };
    let places = if before.units() == Units::Inch { 5 } else { 4 };
    let mut lines: Vec<String> = Vec::new();
    let mut code = "";
    let mut told_feed = before.feed;
    let mut path = before.path_mode;
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        let axes = |from: &[f64; 9], to: &[f64; 9], all: bool| {
            let show = |i: &usize| from[*i] != to[*i] || (all && *i < 3);
            let value = |i: usize| if (3..6).contains(&i) { to[i].to_degrees() } else { to[i] / scale };
            (0..9).filter(show).map(|i| format!(" {}{}", AXES[i], number(value(i), places))).collect::<String>()
        };
        let (new, words) = match view.op {
            Op::Rapid => ("G0", axes(&view.start.axes, &view.end.axes, false)),
            Op::Linear => ("G1", axes(&view.start.axes, &view.end.axes, false)),
            Op::Arc(arc) => {
                if view.state.plane != before.plane() || matches!(arc.plane, gr_ir::ArcPlane::Free(_)) {
                    return None;
                }
                let shape = ArcShape::new(&arc, view.start, view.end);
                let start = view.start.xyz();
                let (first, second, _) = gr_ir::plane_axes(before.plane());
                let base = |i: usize| if before.ijk_absolute != 0 { 0.0 } else { start[i] };
                let word = |i: usize| format!(" {}{}", ['I', 'J', 'K'][i.min(2)], number((shape.center[i] - base(i)) / scale, places));
                let new = if arc.turns > 0 { "G3" } else { "G2" };
                let turns = if arc.turns.abs() > 1 { format!(" P{}", arc.turns.abs()) } else { String::new() };
                (new, format!("{}{}{}{turns}", axes(&view.start.axes, &view.end.axes, false), word(first), word(second)))
            }
            Op::Dwell(s) => {
                // Fanuc counts in milliseconds.
                let (value, places) = if dialect.family == gr_spec::Family::Fanuc { (s * 1e3, 0) } else { (s, 3) };
                lines.push(format!("G4 P{}", number(value, places)));
                continue;
            }
            // Cycles keep to the exact path and give back what was in force.
            Op::PathMode(mode) => {
                let (new, text) = match mode {
                    PathMode::ExactPath => (0, "G61".to_string()),
                    PathMode::ExactStop => (1, "G61.1".into()),
                    PathMode::Blend(_) if before.naivecam != 0.0 => return None,
                    PathMode::Blend(0.0) => (2, "G64".into()),
                    PathMode::Blend(t) => (2, format!("G64 P{}", number(t / scale, places))),
                };
                if new != path {
                    lines.push(text);
                }
                path = new;
                continue;
            }
            Op::MergeTolerance(0.0) => continue,
            Op::Begin { .. } | Op::Close(_) | Op::Finish | Op::Feed { .. } | Op::FeedReferenceXyz => continue,
            Op::Note(gr_ir::Note::Comment, _) => continue,
            Op::Units(units) if units == before.units() => continue,
            Op::Plane(plane) if plane == before.plane() => continue,
            _ => return None,
        };
        if words.is_empty() {
            continue;
        }
        let now = view.state.feed * 60.0 / scale;
        let feed = if view.op.feeds() && (now - told_feed).abs() > 1e-9 * now.abs() {
            told_feed = now;
            format!(" F{}", number(now, 4))
        } else {
            String::new()
        };
        lines.push(format!("{}{feed}", if code == new { words.trim_start().to_string() } else { format!("{new}{words}") }));
        code = new;
    }
    if before.incremental != 0 && !lines.is_empty() {
        lines.insert(0, "G90".into());
    }
    let absolute = before.incremental == 0 || !lines.is_empty();
    if after.incremental != u8::from(!absolute) {
        lines.push(if after.incremental != 0 { "G91" } else { "G90" }.into());
    }
    if after.retract_r != before.retract_r {
        lines.push(if after.retract_r != 0 { "G99" } else { "G98" }.into());
    }
    if (after.feed - told_feed).abs() > 1e-9 * after.feed.abs() {
        lines.push(format!("F{}", number(after.feed, 4)));
    }
    Some((lines.join("\n"), code))
}

/// The line of the M2 or M30 that ends the program, or its last line with words: where the state at the end is asked for.
/// True: it is the former.
pub fn end_line(doc: Doc<'_>) -> (u32, bool) {
    let count = doc.count();
    let ends = |l: &LineOf<'_>| l.has_code(b'm', 20) || l.has_code(b'm', 300);
    let tail = || doc.lines(count.saturating_sub(2_000)..count);
    match tail().filter(ends).last() {
        Some(end) => (end.line, true),
        None => (tail().filter(|l| !l.words().is_empty()).last().map_or(count.saturating_sub(1), |l| l.line), false),
    }
}

/// Adds what a program leaves out at its end.
pub fn missing_end(doc: Doc<'_>, end: Option<&Modal>) -> Option<Action> {
    let m = end?;
    let count = doc.count();
    let tail = || doc.lines(count.saturating_sub(2_000)..count);
    let (end, has_end) = end_line(doc);
    let mut lines: Vec<&str> = Vec::new();
    let spindle = m.active_spindle.clamp(0, 7) as usize;
    if m.side() != Side::Off {
        lines.push("G40");
    }
    if m.turning[spindle] != 0 {
        lines.push("M5");
    }
    if m.flood != 0 || m.mist != 0 {
        lines.push("M9");
    }
    let (at, title) = if has_end {
        (doc.line(end)?.span().start, "before the end")
    } else {
        lines.push("M2");
        let percent = tail().filter(|l| l.chunk.scan.lines[l.at as usize].kind == gr_gcode::LineKind::Percent).last();
        (percent.filter(|l| l.line > 0).map_or(doc.len(), |l| l.span().start), "at the end")
    };
    if lines.is_empty() {
        return None;
    }
    let open = at == doc.len() && doc.line(count.saturating_sub(1)).is_some_and(|l| l.span().end == at && l.span().start != at);
    let lead = if open { "\n" } else { "" };
    let text = format!("{lead}{}\n", lines.join("\n"));
    Some(Action { title: format!("Add {} {title}", lines.join(" ")), kind: ActionKind::Source, edits: vec![Edit { span: Span::new(at, at), text }] })
}

/// What [`renumber`] is called for a file; none where it can't be done.
pub fn renumber_title(doc: Doc<'_>) -> Option<&'static str> {
    if doc.len() >= 4_000_000 || jumps_by_value(doc) {
        return None;
    }
    Some(if is_numbered(doc) { "Renumber blocks in steps of 10" } else { "Number blocks in steps of 10" })
}

fn is_numbered(doc: Doc<'_>) -> bool {
    doc.lines(0..doc.count().min(1_000)).any(|l| l.literal(b'n').is_some())
}

/// Numbers all blocks anew; jumps follow.
pub fn renumber(doc: Doc<'_>) -> Option<Action> {
    let title = renumber_title(doc)?;
    let options = Renumber { start: 10, step: 10, all: !is_numbered(doc) };
    let text = doc.text();
    let changed = gr_gcode::renumber(&text, &gr_gcode::scan(&text, doc.dialect), doc.dialect, options).ok()?;
    let edits: Vec<Edit> = changed
        .into_iter()
        .filter(|(span, new)| text[span.range()] != *new)
        .map(|(span, text)| Edit { span, text })
        .collect();
    (!edits.is_empty()).then(|| Action { title: title.into(), kind: ActionKind::Source, edits })
}

fn is_unit(w: &&gr_gcode::Word) -> bool {
    w.letter == b'g' && w.form == Form::Literal && matches!((w.value * 10.0).round() as i64, 200 | 210)
}

/// What [`convert_units`] is called at a line; none where there is no unit.
pub fn units_title(line: &LineOf<'_>) -> Option<&'static str> {
    let inch = line.words().iter().find(is_unit)?.value == 21.0;
    Some(if inch { "Convert the program to inch (G20)" } else { "Convert the program to millimetres (G21)" })
}

/// G20 ↔ G21: every length and feed of the file in the other unit. Only offered where each of them is a number, where the
/// unit is said before the first of them, and where nothing else depends on it. `before`: the state before the line.
pub fn convert_units(doc: Doc<'_>, line: &LineOf<'_>, before: Option<&Modal>) -> Option<Action> {
    let title = units_title(line)?;
    let to_inch = line.words().iter().find(is_unit)?.value == 21.0;
    if doc.len() > 4_000_000 || doc.dialect.id == "fanuc-turn" {
        return None;
    }
    // Inverse time, tables, surface speed, diameters: numbers whose unit is another, or of another block. Increments and
    // feeds per revolution: a rounded value adds up, or is too coarse.
    // A thread makes another number of passes; the feed of rotary axes has no length in it.
    let rotary = |l: &LineOf<'_>| {
        let any = |letters: &[u8]| letters.iter().any(|x| l.word(*x).is_some());
        any(b"abc") && !any(b"xyzuvw")
    };
    let strange = |l: LineOf<'_>| rotary(&l) || [930, 100, 960, 70, 760, 910, 911, 950].iter().any(|c| l.has_code(b'g', *c)) || l.has_code(b'm', 980) || l.has_code(b'g', 650) || l.has_code(b'g', 660);
    if doc.lines(0..doc.count()).any(strange) {
        return None;
    }
    let (factor, places) = if to_inch { (1.0 / 25.4, 5) } else { (25.4, 4) };
    let (mut edits, mut said) = (Vec::new(), false);
    let mut codes_before: Vec<&'static gr_spec::CodeDef> = Vec::new();
    for l in doc.lines(0..doc.count()) {
        let codes: Vec<_> = l
            .words()
            .iter()
            .filter(|w| matches!(w.letter, b'g' | b'm') && w.form == Form::Literal)
            .filter_map(|w| doc.dialect.code(&code_name(w.letter, w.value)))
            .collect();
        if let Some(motion) = codes.iter().find(|c| c.group == "motion") {
            codes_before = vec![motion];
        }
        let says = l.words().iter().find(is_unit);
        let feeds = l.word(b'f').is_some();
        if let Some(w) = says {
            if (w.value == 21.0) != to_inch || (!said && l.line != line.line) {
                return None;
            }
            edits.extend(other_unit(&l, w, to_inch, feeds && !said, before)?);
            said = true;
        }
        for w in l.words() {
            let letter = w.letter.to_ascii_uppercase() as char;
            match w.form {
                Form::Comment => continue,
                Form::Setting | Form::Control | Form::Expr | Form::Bad => return None,
                Form::Literal => {}
            }
            let arg = codes.iter().chain(&codes_before).find_map(|c| c.args.iter().find(|a| a.letters.contains(letter)));
            let unit = arg.map(|a| a.unit).or_else(|| doc.dialect.word(letter).map(|w| w.unit)).unwrap_or("");
            if matches!(unit, "length" | "feed") && !matches!(w.letter, b'g' | b'm') {
                if !said {
                    return None;
                }
                let span = l.tight(w);
                edits.push(Edit { span: Span::new(span.start + 1, span.end), text: number(w.value * factor, places) });
            }
        }
    }
    Some(Action { title: title.into(), kind: ActionKind::Rewrite, edits })
}

/// The other unit code in place of one. F is read before the unit of its block: where it stands with the first code, the
/// code comes in a block of its own before it, and the unit of before must be the one that the code says.
fn other_unit(line: &LineOf<'_>, code: &gr_gcode::Word, to_inch: bool, alone: bool, before: Option<&Modal>) -> Option<Vec<Edit>> {
    let new = if to_inch { "G20" } else { "G21" };
    let span = line.tight(code);
    if !alone {
        return Some(vec![Edit { span, text: new.into() }]);
    }
    let same = before?.units() == if to_inch { Units::Mm } else { Units::Inch };
    let start = line.span().start;
    if !same || line.text().trim_start().starts_with('/') {
        return None;
    }
    let blank = line.slice(Span::new(span.end, line.span().end)).len() - line.slice(Span::new(span.end, line.span().end)).trim_start().len();
    let gone = Span::new(span.start, span.end + blank as u32);
    if gone.start == start {
        return Some(vec![Edit { span: gone, text: format!("{new}\n") }]);
    }
    Some(vec![Edit { span: Span::new(start, start), text: format!("{new}\n") }, Edit { span: gone, text: String::new() }])
}
