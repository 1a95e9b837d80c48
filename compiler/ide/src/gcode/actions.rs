//! What can be done to a G-code file at a place.

use gr_canon::Units;
use gr_gcode::{FormatOptions, Form, Renumber};
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
    /// State at the end of the program, when it ends without M2, M30 or `%`, or leaves something on.
    pub end: Option<&'a Modal>,
}

/// Moves that one block is expanded into, at most.
const MOST_MOVES: usize = 5_000;

/// Actions at a byte of the file.
pub fn actions(doc: Doc<'_>, at: Span, context: Context<'_>) -> Vec<Action> {
    let mut found = Vec::new();
    if let Some(line) = doc.line_at(at.start) {
        if let Some((before, after, program)) = context.run {
            found.extend(other_arc_form(&line, before, program));
            found.extend(expand(&line, before, after, program));
        }
        found.extend(convert_units(doc, &line));
    }
    found.extend(missing_end(doc, context.end));
    if doc.len() < 4_000_000 {
        found.extend(renumber(doc));
    }
    found
}

/// I J K ↔ R.
fn other_arc_form(line: &LineOf<'_>, before: &Modal, program: &Program) -> Option<Action> {
    let arc_words = |w: &&gr_gcode::Word| matches!(w.letter, b'i' | b'j' | b'k' | b'r');
    let words: Vec<&gr_gcode::Word> = line.words().iter().filter(arc_words).collect();
    let literal = words.iter().all(|w| w.form == Form::Literal);
    let mut moves = program.steps().filter(|s| s.op.moves());
    let (Some(step), None) = (moves.next(), moves.next()) else { return None };
    let Op::Arc(arc) = step.op else { return None };
    if words.is_empty() || !literal || arc.turns.abs() > 1 || line.word(b'p').is_some() {
        return None;
    }
    let scale = if before.units() == Units::Inch { 25.4 } else { 1.0 };
    let places = if before.units() == Units::Inch { 5 } else { 4 };
    let shape = ArcShape::new(&arc, &step.start, &step.end);
    let (first, second, _) = gr_ir::plane_axes(before.plane());
    let (title, text) = if words.iter().any(|w| w.letter == b'r') {
        let start = step.start.xyz();
        let base = |i: usize| if before.ijk_absolute != 0 { 0.0 } else { start[i] };
        let word = |i: usize| format!("{}{}", ['I', 'J', 'K'][i.min(2)], number((shape.center[i] - base(i)) / scale, places));
        ("Write the arc with its centre (I J K)", format!("{} {}", word(first), word(second)))
    } else {
        // A whole circle has no radius form, and near half a turn it is vague.
        let degrees = shape.sweep.to_degrees().abs();
        if degrees > 359.0 || (179.0..181.0).contains(&degrees) {
            return None;
        }
        let radius = shape.radius / scale * if degrees > 180.0 { -1.0 } else { 1.0 };
        ("Write the arc with its radius (R)", format!("R{}", number(radius, places)))
    };
    let span = Span::new(line.tight(words.first()?).start, line.tight(words.last()?).end);
    let between = line.words().iter().any(|w| !arc_words(&w) && { let s = line.tight(w); s.start > span.start && s.end < span.end });
    let mut edits = vec![Edit { span, text: text.clone() }];
    if between {
        edits = words.iter().enumerate().map(|(i, w)| Edit { span: line.tight(w), text: if i == 0 { text.clone() } else { String::new() } }).collect();
    }
    Some(Action { title: title.into(), kind: ActionKind::Rewrite, edits })
}

/// Writes the moves that a cycle makes.
fn expand(line: &LineOf<'_>, before: &Modal, after: &Modal, program: &Program) -> Option<Action> {
    let cycle = (730..=899).contains(&after.motion) && after.motion != 800;
    let moves = program.steps().filter(|s| s.op.moves()).count();
    if moves == 0 || moves > MOST_MOVES || !cycle {
        return None;
    }
    let title = format!("Write out this {}", code_name(b'g', f64::from(after.motion) / 10.0));
    // The next block of plain axis words would go on with the last motion, not with the cycle.
    let text = format!("{}\n(the cycle ends here: write G80 or the next motion code)", write_moves(program, before)?);
    let words = line.words();
    let first = words.iter().find(|w| w.form != Form::Comment && !(w.letter == b'n'))?;
    let last = words.iter().rfind(|w| w.form != Form::Comment)?;
    let span = Span::new(line.tight(first).start, line.tight(last).end);
    Some(Action { title, kind: ActionKind::Inline, edits: vec![Edit { span, text }] })
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
/// [`compensated_lines`] as they are run. Only where they hold nothing but motion.
pub fn write_out_compensation(doc: Doc<'_>, lines: std::ops::Range<u32>, ran: &[(u32, &Modal, &Program)]) -> Option<Action> {
    let plain = |w: &&gr_gcode::Word| matches!(w.letter, b'm' | b's' | b't') || matches!(w.form, Form::Setting | Form::Control | Form::Bad);
    if doc.lines(lines.clone()).any(|l| l.words().iter().find(plain).is_some()) {
        return None;
    }
    let mut edits = Vec::new();
    for line in doc.lines(lines) {
        let words = line.words();
        let Some(first) = words.iter().find(|w| w.form != Form::Comment && w.letter != b'n') else { continue };
        let last = words.iter().rfind(|w| w.form != Form::Comment)?;
        let (_, before, program) = ran.iter().find(|r| r.0 == line.line)?;
        let text = write_moves(program, before)?;
        edits.push(Edit { span: Span::new(line.tight(first).start, line.tight(last).end), text });
    }
    Some(Action { title: "Write out this contour without compensation".into(), kind: ActionKind::Inline, edits })
}

/// Moves as plain G0 G1 G2 G3 G4 in absolute distance, the mode before put back. None where the program does more than
/// these can say, or where F is not a feed per minute.
pub fn write_moves(program: &Program, before: &Modal) -> Option<String> {
    if before.feed_mode != 0 {
        return None;
    }
    let scale = if before.units() == Units::Inch { 25.4 } else { 1.0 };
    let places = if before.units() == Units::Inch { 5 } else { 4 };
    let mut lines: Vec<String> = Vec::new();
    let mut code = "";
    let mut told_feed = before.feed;
    let mut path = before.path_mode;
    if before.incremental != 0 {
        lines.push("G90".into());
    }
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
                lines.push(format!("G4 P{}", number(s, 3)));
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
    if before.incremental != 0 {
        lines.push("G91".into());
    }
    Some(lines.join("\n"))
}

/// Adds what a program leaves out at its end.
fn missing_end(doc: Doc<'_>, end: Option<&Modal>) -> Vec<Action> {
    let Some(m) = end else { return Vec::new() };
    let count = doc.count();
    let tail = || doc.lines(count.saturating_sub(2_000)..count);
    let has_end = tail().any(|l| l.has_code(b'm', 20) || l.has_code(b'm', 300));
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
    let mut found = Vec::new();
    let (at, title) = if has_end {
        let Some(last) = tail().filter(|l| l.has_code(b'm', 20) || l.has_code(b'm', 300)).last() else { return found };
        (last.span().start, "before the end")
    } else {
        lines.push("M2");
        let text_end = doc.len();
        let percent = tail().filter(|l| l.chunk.scan.lines[l.at as usize].kind == gr_gcode::LineKind::Percent).last();
        (percent.filter(|l| l.line > 0).map_or(text_end, |l| l.span().start), "at the end")
    };
    if lines.is_empty() {
        return found;
    }
    let open = at == doc.len() && doc.line(count.saturating_sub(1)).is_some_and(|l| l.span().end == at && l.span().start != at);
    let lead = if open { "\n" } else { "" };
    let text = format!("{lead}{}\n", lines.join("\n"));
    found.push(Action { title: format!("Add {} {title}", lines.join(" ")), kind: ActionKind::Source, edits: vec![Edit { span: Span::new(at, at), text }] });
    found
}

/// Numbers all blocks anew; jumps follow.
fn renumber(doc: Doc<'_>) -> Option<Action> {
    let numbered = doc.lines(0..doc.count().min(1_000)).any(|l| l.literal(b'n').is_some());
    let options = FormatOptions {
        case: gr_gcode::Case::Keep,
        o_word_case: gr_gcode::Case::Keep,
        renumber: Some(Renumber { start: 10, step: 10, all: !numbered }),
        ..FormatOptions::default()
    };
    let edits = super::format::edits(doc, &options, 0..doc.count());
    let title = if numbered { "Renumber blocks in steps of 10" } else { "Number blocks in steps of 10" };
    (!edits.is_empty()).then(|| Action { title: title.into(), kind: ActionKind::Source, edits })
}

/// G20 ↔ G21: every length and feed of the file in the other unit. Only offered where each of them is a number.
fn convert_units(doc: Doc<'_>, line: &LineOf<'_>) -> Option<Action> {
    let here = line.words().iter().find(|w| w.letter == b'g' && w.form == Form::Literal && matches!(w.value as i64, 20 | 21))?;
    let to_inch = here.value == 21.0;
    if doc.len() > 4_000_000 {
        return None;
    }
    let (factor, places) = if to_inch { (1.0 / 25.4, 5) } else { (25.4, 4) };
    let mut edits = Vec::new();
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
        for w in l.words() {
            let letter = w.letter.to_ascii_uppercase() as char;
            match w.form {
                Form::Comment | Form::Bad => continue,
                Form::Setting | Form::Control => return None,
                Form::Expr => return None,
                Form::Literal => {}
            }
            if w.letter == b'g' && matches!(w.value as i64, 20 | 21) && w.value.fract() == 0.0 {
                if (w.value == 21.0) != to_inch {
                    return None;
                }
                edits.push(Edit { span: l.tight(w), text: if to_inch { "G20" } else { "G21" }.into() });
                continue;
            }
            let arg = codes.iter().chain(&codes_before).find_map(|c| c.args.iter().find(|a| a.letters.contains(letter)));
            let unit = arg.map(|a| a.unit).or_else(|| doc.dialect.word(letter).map(|w| w.unit)).unwrap_or("");
            let inverse = l.has_code(b'g', 930);
            if matches!(unit, "length" | "feed") && !(unit == "feed" && inverse) {
                let span = l.tight(w);
                edits.push(Edit { span: Span::new(span.start + 1, span.end), text: number(w.value * factor, places) });
            }
        }
    }
    if doc.lines(0..doc.count()).any(|l| l.has_code(b'g', 930) || l.has_code(b'g', 100)) {
        return None;
    }
    let title = if to_inch { "Convert the program to inch (G20)" } else { "Convert the program to millimetres (G21)" };
    Some(Action { title: title.into(), kind: ActionKind::Rewrite, edits })
}
