//! What stands under the cursor, explained: the word from the tables, the block from its run.

use gr_canon::Units;
use gr_gcode::{Form, Parameter, Word};
use gr_interp::{Modal, Tool, ToolTable};
use gr_spec::{CodeDef, Dialect};
use gr_text::Span;

use super::doc::{Doc, LineOf, code_name, duration, number};
use super::modes::{AXES, codes, moves, position};
use super::names::{self, Name};
use crate::Hover;

/// What is known of a block from running the program.
#[derive(Clone, Debug)]
pub struct Run {
    /// Before the block.
    pub before: Modal,
    /// After it.
    pub after: Modal,
    /// Its motion.
    pub program: gr_ir::Program,
    /// Value before and after the block of the parameter under the cursor.
    pub value: Option<(Option<f64>, Option<f64>)>,
    /// A canned cycle made the moves.
    pub cycle: bool,
    /// The time it takes in the program, s; none where it is not worked out.
    pub seconds: Option<f64>,
    /// Joint values at the end of the block in words, or why they are not known; may be empty.
    pub joints: String,
}

/// What hover needs besides the text.
#[derive(Clone, Copy, Default)]
pub struct Facts<'a> {
    /// The block; none when execution never comes there.
    pub run: Option<&'a Run>,
    /// Tool table and the unit it is in.
    pub tools: Option<(&'a ToolTable, Units)>,
    /// Line of the assignment that was last before this one, with its text.
    pub last_write: Option<(u32, &'a str)>,
    /// The line stands in a loop or a subroutine: it may be run again with other values.
    pub repeats: bool,
}

/// The parameter under the cursor, whose value a run should report.
pub fn parameter_at(doc: Doc<'_>, offset: u32) -> Option<Parameter> {
    match names::name_at(doc, offset)?.0 {
        Name::Parameter(p) => Some(p),
        _ => None,
    }
}

/// Explains what stands at a byte of the file.
pub fn hover(doc: Doc<'_>, offset: u32, facts: Facts<'_>) -> Option<Hover> {
    let line = doc.line_at(offset)?;
    if offset > line.span().end {
        return None;
    }
    if let Some((Name::Parameter(p), span)) = names::name_at(doc, offset) {
        return Some(Hover { span, text: parameter(&p, &facts) });
    }
    if let Some(found) = wording_at(&line, offset) {
        return Some(found);
    }
    let word = line.word_at(offset)?;
    let mut text = explain(&line, word, doc.dialect, &facts)?;
    if let Some(run) = facts.run.filter(|_| !matches!(word.form, Form::Comment)) {
        let block = block(run);
        if !block.is_empty() {
            text.push_str("\n\n---\n\n");
            text.push_str(&block);
        }
    }
    Some(Hover { span: line.tight(word), text })
}

fn explain(line: &LineOf<'_>, word: &Word, dialect: &'static Dialect, facts: &Facts<'_>) -> Option<String> {
    match word.form {
        Form::Comment => return comment(line.slice(line.tight(word))),
        Form::Setting => return Some("**Assignment**: carried out after the words of the block are read.".into()),
        Form::Control => return control(line, word),
        Form::Bad => return None,
        Form::Literal | Form::Expr => {}
    }
    let letter = word.letter.to_ascii_uppercase() as char;
    if matches!(letter, 'G' | 'M') && word.form == Form::Literal {
        let name = code_name(word.letter, word.value);
        return Some(match dialect.code(&name) {
            Some(def) => code(def, dialect),
            None => format!("**{name}**: {} has no such code.", dialect.title),
        });
    }
    let def = dialect.word(letter)?;
    let unit = if def.unit.is_empty() { String::new() } else { format!(" ({})", unit_text(def.unit, facts)) };
    let mut text = format!("**{}** {}{unit}\n\n{}", def.letter, def.title, def.what);
    if let Some(meaning) = meaning_here(line, letter, dialect) {
        text.push_str(&format!("\n\nHere: {meaning}"));
    }
    if matches!(letter, 'T' | 'H' | 'D') && word.form == Form::Literal {
        // T0101 of a lathe is tool 1 with offset 1.
        let both = dialect.id == "fanuc-turn" && letter == 'T' && word.value >= 100.0;
        text.push_str(&tool(facts, if both { word.value as i32 / 100 } else { word.value as i32 }));
    }
    if letter == 'F'
        && let Some(run) = facts.run
    {
        text.push_str(&format!("\n\n{}", feed(&run.after, word)));
    }
    Some(text)
}

/// The unit of a word in the program's present unit.
fn unit_text(unit: &str, facts: &Facts<'_>) -> String {
    let inch = facts.run.is_some_and(|r| r.after.units() == Units::Inch);
    match unit {
        "length" => if inch { "inch" } else { "mm" }.into(),
        "angle" => "degrees".into(),
        other => other.into(),
    }
}

/// What a word says to the codes of its block.
fn meaning_here(line: &LineOf<'_>, letter: char, dialect: &'static Dialect) -> Option<String> {
    line.words().iter().filter(|w| matches!(w.letter, b'g' | b'm') && w.form == Form::Literal).find_map(|w| {
        let def = dialect.code(&code_name(w.letter, w.value))?;
        let arg = def.args.iter().find(|a| a.letters.contains(letter))?;
        Some(format!("{} of {} ({})", arg.what, def.code, def.title))
    })
}

/// A code of a dialect in Markdown.
pub fn code(def: &CodeDef, dialect: &Dialect) -> String {
    let mut text = format!("**{}** {}\n\n{}\n", def.code, def.title, def.what);
    if !def.args.is_empty() {
        text.push_str("\n| word | |\n|---|---|\n");
        for a in def.args {
            let letters: Vec<String> = a.letters.chars().map(String::from).collect();
            let need = if a.required { " **needed**" } else { "" };
            let unit = if a.unit.is_empty() { String::new() } else { format!(" ({})", a.unit) };
            text.push_str(&format!("| {} | {}{unit}{need} |\n", letters.join(" "), a.what));
        }
    }
    if def.group != "none" && !def.group.is_empty() {
        let title = gr_spec::groups().iter().find(|g| g.slug == def.group).map_or(def.group, |g| g.title);
        text.push_str(&format!("\nModal group: {title}. "));
    }
    text.push_str(&format!("*{}*\n", if def.source.is_empty() { dialect.title } else { def.source }));
    text
}

fn feed(m: &Modal, word: &Word) -> String {
    let inch = m.units() == Units::Inch;
    let unit = if inch { "inch" } else { "mm" };
    let value = number(m.feed, 4);
    match m.feed_mode {
        // F is of its block alone, and not remembered.
        1 if word.form == Form::Literal && word.value > 0.0 => {
            format!("G93: every feed move takes 1/F minutes: this one 1/{} min = {}", number(word.value, 4), duration(60.0 / word.value))
        }
        1 => "G93: every feed move takes 1/F minutes".into(),
        2 => {
            let s = m.active_spindle.clamp(0, 7) as usize;
            format!("G95: {value} {unit} per revolution, at S{} = {} {unit}/min", number(m.speed[s], 1), number(m.feed * m.speed[s], 3))
        }
        _ if inch => format!("G94: {value} inch/min = {} mm/min", number(m.feed * 25.4, 2)),
        _ => format!("G94: {value} mm/min = {} mm/s", number(m.feed / 60.0, 3)),
    }
}

fn tool(facts: &Facts<'_>, wanted: i32) -> String {
    let Some((table, units)) = facts.tools else { return String::new() };
    let row = table.rows.iter().skip(1).find(|t| t.number == wanted);
    match row {
        Some(t) if &*t.comment == gr_interp::ASSUMED => "\n\nNo tool table is named: its size is not known.".into(),
        Some(t) => format!("\n\n{}", tool_row(t, units)),
        None => format!("\n\nThe tool table has no tool {wanted}."),
    }
}

/// A row of the tool table.
pub fn tool_row(t: &Tool, units: Units) -> String {
    let unit = if units == Units::Inch { "inch" } else { "mm" };
    let mut text = format!("**T{}** pocket {}, diameter {} {unit}", t.number, t.pocket, number(t.diameter, 4));
    let offsets: Vec<String> = AXES.iter().zip(t.offset).filter(|(_, v)| *v != 0.0).map(|(a, v)| format!("{a}{}", number(v, 4))).collect();
    if !offsets.is_empty() {
        text.push_str(&format!(", offset {}", offsets.join(" ")));
    }
    if t.orientation != 0 {
        text.push_str(&format!(", orientation {}", t.orientation));
    }
    if !t.comment.is_empty() {
        text.push_str(&format!("\n\n{}", t.comment));
    }
    text
}

fn parameter(p: &Parameter, facts: &Facts<'_>) -> String {
    let (shown, key) = match p {
        Parameter::Number(n) => (format!("#{n}"), n.to_string()),
        Parameter::Named(n) => (format!("#<{n}>"), n.to_string()),
    };
    let def = gr_spec::parameter(&key).filter(|d| matches!(p, Parameter::Number(_)) == d.name.is_empty());
    let unit = def.map_or("", |d| d.unit);
    let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    let mut text = format!("**{shown}**{unit}");
    if let Some(def) = def {
        text.push_str(&format!("\n\n{}", def.what));
    } else if let Parameter::Named(n) = p {
        let bare = n.to_ascii_lowercase();
        let scope = match () {
            () if bare.starts_with("_ini[") => "A value of the machine's INI file, where `[RS274NGC] INI_VARS` allows it.",
            () if bare.starts_with("_hal[") => "A value of the machine's HAL, where `[RS274NGC] HAL_PIN_VARS` allows it: known at run time alone.",
            () if n.starts_with('_') => "Global: the same in all subroutines.",
            () => "Local to its subroutine.",
        };
        text.push_str(&format!("\n\n{scope}"));
    }
    if let Some(run) = facts.run
        && let Some((before, after)) = run.value
    {
        let value = |v: Option<f64>| v.map_or("not set".to_string(), |v| number(v, 6));
        let first = if facts.repeats { " (when it is run for the first time)" } else { "" };
        if before == after {
            text.push_str(&format!("\n\nHere: `{}`{first}", value(before)));
        } else {
            text.push_str(&format!("\n\nBefore this block: `{}`, after it: `{}`{first}", value(before), value(after)));
        }
    }
    if let Some((line, written)) = facts.last_write {
        text.push_str(&format!("\n\nLast set in line {}: `{}`", line + 1, written.trim()));
    }
    text
}

/// What a block does, in Markdown; empty when it changes nothing.
pub fn block(run: &Run) -> String {
    let (b, a) = (&run.before, &run.after);
    let units = b.units();
    let unit = if units == Units::Inch { "inch" } else { "mm" };
    let m = moves(&run.program, units);
    let mut lines: Vec<String> = Vec::new();
    if m.totals.moves > 0 {
        let what = match (run.cycle, m.totals.moves, m.arc) {
            (true, n, _) => format!("{} in {n} moves", code_name(b'g', f64::from(a.motion) / 10.0)),
            (_, 1, Some(arc)) => format!("{} arc", if arc.sweep < 0.0 { "clockwise" } else { "counter-clockwise" }),
            (_, 1, None) if m.totals.feed_nm == 0 && one_move(&run.program) == "straight feed" => "feed of the other axes".into(),
            (_, 1, None) => one_move(&run.program).into(),
            (_, n, _) => format!("{n} moves"),
        };
        let radius = if b.lathe_diameter != 0 || a.lathe_diameter != 0 { ", X as a radius" } else { "" };
        lines.push(format!("**{what}** from {} to {} ({unit}{radius})", position(b, None), position(a, None)));
        if let Some(arc) = m.arc.filter(|_| m.totals.moves == 1) {
            lines.push(arc_text(&arc, unit));
        }
        let way = (m.totals.rapid_nm + m.totals.feed_nm) as f64 / 1e6 / if units == Units::Inch { 25.4 } else { 1.0 };
        let mut facts = vec![format!("length {} {unit}", number(way, 3))];
        if m.feed > 0.0 {
            facts.push(format!("feed {} mm/min", number(m.feed, 1)));
        }
        facts.push(match run.seconds {
            _ if m.totals.untimed > 0 => "time unknown: no feed or spindle speed".into(),
            Some(seconds) => format!("time {}", duration(seconds)),
            None => "time not worked out in a program of this size".into(),
        });
        lines.push(facts.join(", "));
    } else if m.totals.wait_ns > 0 {
        lines.push(format!("waits {}", duration(m.totals.seconds())));
    }
    if !run.joints.is_empty() {
        lines.push(run.joints.clone());
    }
    lines.push(format!("modes: {}", codes(a).join(" ")));
    lines.join("  \n")
}

/// What a single move is called.
fn one_move(program: &gr_ir::Program) -> &'static str {
    use gr_ir::Op;
    match program.steps().find(|s| s.op.moves()).map(|s| s.op) {
        Some(Op::Rapid) => "rapid",
        Some(Op::Nurbs { .. }) => "spline at feed",
        Some(Op::Probe(_)) => "probing move",
        Some(Op::RigidTap { .. }) => "rigid tapping",
        _ => "straight feed",
    }
}

fn arc_text(arc: &super::modes::ArcFacts, unit: &str) -> String {
    let (first, second, _) = gr_ir::plane_axes(arc.plane);
    let r = if (arc.radius[0] - arc.radius[1]).abs() < 5e-5 {
        format!("radius {} {unit}", number(arc.radius[0], 4))
    } else {
        format!("radius {} at the start, {} at the end ({unit})", number(arc.radius[0], 4), number(arc.radius[1], 4))
    };
    format!(
        "centre {}{} {}{}, {r}, {}°",
        AXES[first],
        number(arc.center[first], 4),
        AXES[second],
        number(arc.center[second], 4),
        number(arc.sweep.abs(), 3)
    )
}

fn comment(text: &str) -> Option<String> {
    let inside = text.trim_start_matches(['(', ';', ' ']);
    let word = inside.split([',', ')', ' ']).next()?;
    let def = gr_spec::comments().iter().find(|c| c.name.eq_ignore_ascii_case(word))?;
    Some(format!("**{}**\n\n{}", def.form, def.what))
}

fn control(line: &LineOf<'_>, word: &Word) -> Option<String> {
    let control = line.chunk.scan.controls.get(word.index())?;
    let name = names::keyword(control.keyword);
    let def = gr_spec::controls().iter().find(|d| d.name.eq_ignore_ascii_case(name))?;
    Some(format!("**{}**\n\n{}", if def.form.is_empty() { def.name } else { def.form }, def.what))
}

/// A function, operator or keyword under the cursor, outside of comments.
fn wording_at(line: &LineOf<'_>, offset: u32) -> Option<Hover> {
    if line.word_at(offset).is_some_and(|w| w.form == Form::Comment) {
        return None;
    }
    let (text, start) = (line.text(), line.span().start);
    let at = (offset - start) as usize;
    let bytes = text.as_bytes();
    let word = |b: &u8| b.is_ascii_alphabetic();
    if !bytes.get(at).is_some_and(word) {
        return None;
    }
    let from = at - bytes[..at].iter().rev().take_while(|b| word(b)).count();
    let to = at + bytes[at..].iter().take_while(|b| word(b)).count();
    if to - from < 2 {
        return None;
    }
    let name = text.get(from..to)?;
    let tables = [gr_spec::functions(), gr_spec::operators(), gr_spec::controls()];
    let def = tables.iter().flat_map(|t| t.iter()).find(|d| d.name.eq_ignore_ascii_case(name))?;
    let shown = if def.form.is_empty() { def.name } else { def.form };
    Some(Hover { span: Span::new(start + from as u32, start + to as u32), text: format!("**{shown}**\n\n{}", def.what) })
}
