//! New block numbers, and jumps that follow them; everything else of a program stays as it is.

use std::collections::HashMap;

use gr_spec::{Dialect, Family};
use gr_text::Span;

use crate::fast::Rules;
use crate::model::*;

/// New N words.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Renumber {
    /// First number.
    pub start: u32,
    /// Distance.
    pub step: u32,
    /// Number every block that has words, not only those that have an N already.
    pub all: bool,
}

/// Places that get another text, in their order. The error is a jump of which nobody can tell where it goes: its target is
/// computed, or several programs of the file have a block of this number.
pub fn renumber(
    text: &str,
    scan: &Scan,
    dialect: &'static Dialect,
    options: Renumber,
) -> Result<Vec<(Span, String)>, Span> {
    let mut edits = Vec::new();
    let programs = numbers(text, scan, Rules::new(dialect).longest, options, &mut edits);
    if dialect.family == Family::Fanuc {
        let jumps = Jumps { text, scan, programs: &programs };
        for (at, program) in programs.iter().enumerate() {
            let end = programs.get(at + 1).map_or(scan.lines.len() as u32, |p| p.first);
            for line in program.first..end {
                jumps.follow(line, at, &mut edits)?;
            }
        }
    }
    edits.sort_by_key(|(span, _)| span.start);
    Ok(edits)
}

/// A text with such places changed.
pub fn edited(text: &str, edits: &[(Span, String)]) -> String {
    let mut out = String::with_capacity(text.len() + 8 * edits.len());
    let mut at = 0;
    for (span, new) in edits {
        out.push_str(&text[at..span.start as usize]);
        out.push_str(new);
        at = span.end as usize;
    }
    out.push_str(&text[at..]);
    out
}

/// One program of a file: its first line, and what becomes of its block numbers.
struct Program {
    first: u32,
    new: HashMap<u64, u32>,
}

fn numbers(
    text: &str,
    scan: &Scan,
    longest: usize,
    options: Renumber,
    edits: &mut Vec<(Span, String)>,
) -> Vec<Program> {
    let mut programs = vec![Program { first: 0, new: HashMap::new() }];
    let mut next = options.start;
    for line in 0..scan.lines.len() as u32 {
        let words = scan.words(line);
        let row = &scan.lines[line as usize];
        let begins = scan.begins_program(line);
        if begins {
            programs.push(Program { first: line, new: HashMap::new() });
        }
        if row.faulty || row.kind == LineKind::Percent {
            continue;
        }
        if let Some(old) = words.iter().find(|w| w.letter == b'n' && w.form == Form::Literal) {
            if let Some(program) = programs.last_mut() {
                program.new.entry(old.value.to_bits()).or_insert(next);
            }
            let span = scan.word_span(text, line, old);
            edits.push((Span::new(span.start + 1, span.end), next.to_string()));
        } else if options.all && !begins && words.iter().any(|w| w.form != Form::Comment) {
            // Behind the mark of a block that can be left out, and its level.
            let span = scan.line_span(text, line);
            let at = words.first().map_or(span.start, |w| w.start);
            let number = format!("N{next} ");
            let end = scan.lines.get(line as usize + 1).map_or(text.len(), |l| l.start as usize);
            if end - span.start as usize + number.len() > longest {
                // Better without a number than too long for the controller.
                continue;
            }
            edits.push((Span::new(at, at), number));
        } else {
            continue;
        }
        next = next.saturating_add(options.step.max(1));
    }
    programs
}

/// What names a block: GOTO, M99 P, and P and Q of the turning cycles G70 to G73.
struct Jumps<'a> {
    text: &'a str,
    scan: &'a Scan,
    programs: &'a [Program],
}

impl Jumps<'_> {
    fn follow(&self, line: u32, program: usize, edits: &mut Vec<(Span, String)>) -> Result<(), Span> {
        let own = &self.programs[program].new;
        let words = self.scan.words(line);
        for word in words.iter().filter(|w| w.form == Form::Control) {
            let control = self.scan.controls[word.index()];
            if !matches!(control.keyword, Keyword::MacroGoto | Keyword::MacroIfGoto) {
                continue;
            }
            let args = &self.scan.args[control.first_arg as usize..(control.first_arg + control.arg_count) as usize];
            let Some(target) = args.last() else { continue };
            let span = self.scan.node_spans[target.0 as usize];
            let Node::Number(value) = self.scan.nodes[target.0 as usize] else { return Err(span) };
            edits.extend(own.get(&value.to_bits()).map(|new| (span, new.to_string())));
        }
        let is = |letter: u8, values: std::ops::RangeInclusive<f64>| {
            words.iter().any(|w| w.letter == letter && w.form == Form::Literal && values.contains(&w.value))
        };
        let (back, contour) = (is(b'm', 99.0..=99.0), is(b'g', 70.0..=73.0));
        for word in words.iter().filter(|w| (back || contour) && matches!(w.letter, b'p' | b'q')) {
            let whole = self.scan.word_span(self.text, line, word);
            let span = Span::new(whole.start + 1, whole.end);
            if word.form != Form::Literal {
                return Err(whole);
            }
            let new =
                if back { self.returned(program, word.value, whole)? } else { own.get(&word.value.to_bits()).copied() };
            edits.extend(new.map(|new| (span, new.to_string())));
        }
        Ok(())
    }

    /// M99 P goes to a block of the program that called; in the main program, to its own.
    fn returned(&self, program: usize, target: f64, span: Span) -> Result<Option<u32>, Span> {
        let target = target.to_bits();
        let of = |p: &Program| p.new.get(&target).copied();
        let main = usize::from(self.programs.len() > 1 && self.programs[0].new.is_empty());
        if program <= main {
            return Ok(of(&self.programs[program]));
        }
        let mut others = self.programs.iter().enumerate().filter(|(at, _)| *at != program).filter_map(|(_, p)| of(p));
        match (others.next(), others.next()) {
            (_, Some(_)) => Err(span),
            (one, None) => Ok(one),
        }
    }
}
