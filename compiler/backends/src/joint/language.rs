//! The language of the UFMG 2008 robot programming system: eleven words, four commands, one command per line.
//!
//! Only the language: [`read`] checks the lines in the order of the thesis's table 4-1 and gives commands. What
//! they mean as motion is decided where the robot is known (its start pose is the program's start). The RS274NGC
//! interpreter has no part in it: there is no state beyond position and feed, and an arc may lie in any plane.

use gr_gcode::{File, Form, Scan, Word};
use gr_text::{Code, Diagnostic, FileId, Span, code};

/// What a command does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Motion {
    /// G00: all joints straight to the end.
    Joint,
    /// G01: straight in space.
    Line,
    /// G02.
    Clockwise,
    /// G03.
    Counterclockwise,
}

/// One command.
#[derive(Clone, PartialEq, Debug)]
pub struct Command {
    /// Line, from 0.
    pub line: u32,
    /// Place in the file.
    pub span: Span,
    /// What it does.
    pub motion: Motion,
    /// X Y Z (mm) A B C (degrees); none = as before.
    pub target: [Option<f64>; 6],
    /// I J K: absolute centre of an arc, mm.
    pub center: [f64; 3],
    /// F, mm/s.
    pub feed: Option<f64>,
}

/// The words of the language.
const WORDS: &[u8] = b"gxyzabcfijk";
const TARGETS: &[u8; 6] = b"xyzabc";
const CENTER: &[u8; 3] = b"ijk";

/// Reads a file. Each line gives one command or one diagnostic; blank lines and comments give nothing.
pub fn read(id: FileId, file: &File) -> (Vec<Command>, Vec<Diagnostic>) {
    let (mut commands, mut faults) = (Vec::new(), Vec::new());
    for (i, chunk) in file.chunks.iter().enumerate() {
        for line in 0..chunk.scan.lines.len() as u32 {
            let reader = Reader { text: &chunk.text, scan: &chunk.scan, line };
            let by = file.starts[i];
            match reader.command(file.first_lines[i] + line) {
                Ok(Some(mut command)) => {
                    command.span = command.span.shifted(by);
                    commands.push(command);
                }
                Ok(None) => {}
                Err((code, span, args)) => faults.push(Diagnostic::new(code, id, span.shifted(by), &args)),
            }
        }
    }
    (commands, faults)
}

type Wrong = (Code, Span, Vec<String>);

/// A word that the language does not have.
fn unknown(span: Span, word: &str) -> Wrong {
    let args = [format!("word `{word}`"), "ufmg2008".into(), "remove it; the words are G X Y Z A B C F I J K".into()];
    (code::SYNTAX_NOT_IN_DIALECT, span, args.into())
}

struct Reader<'a> {
    text: &'a str,
    scan: &'a Scan,
    line: u32,
}

impl Reader<'_> {
    fn words(&self) -> impl Iterator<Item = &Word> {
        self.scan.words(self.line).iter().filter(|w| w.form != Form::Comment)
    }

    fn span(&self, word: &Word) -> Span {
        self.scan.word_span(self.text, self.line, word)
    }

    /// The checks in the order of table 4-1; the first that fails speaks.
    fn command(&self, line: u32) -> Result<Option<Command>, Wrong> {
        let all = trimmed(self.text, self.scan.line_span(self.text, self.line));
        if self.words().next().is_none() && !self.scan.lines[self.line as usize].faulty {
            return Ok(None);
        }
        if self.words().count() == 1 {
            return Err((code::UFMG_COMMAND, all, vec!["a command needs more than one word".into()]));
        }
        self.known()?;
        let motion = self.fits(all)?;
        self.numbers()?;
        self.once()?;
        Ok(Some(self.build(line, all, motion)))
    }

    fn known(&self) -> Result<(), Wrong> {
        let deleted = self.scan.lines[self.line as usize].deleted;
        if deleted {
            let at = trimmed(self.text, self.scan.line_span(self.text, self.line)).start;
            return Err(unknown(Span::new(at, at + 1), "/"));
        }
        match self.words().find(|w| !WORDS.contains(&w.letter)) {
            Some(w) => {
                let span = self.span(w);
                let shown = self.text.get(span.range()).unwrap_or("").trim();
                Err(unknown(span, &shown.chars().take(20).collect::<String>()))
            }
            None => Ok(()),
        }
    }

    fn fits(&self, all: Span) -> Result<Motion, Wrong> {
        let wrong = |span: Span, text: &str| Err((code::UFMG_COMMAND, span, vec![text.to_string()]));
        let Some(g) = self.words().find(|w| w.letter == b'g') else {
            return wrong(all, "a command needs a G word: G00, G01, G02 or G03");
        };
        let motion = match (g.form == Form::Literal).then_some(g.value) {
            Some(0.0) => Motion::Joint,
            Some(1.0) => Motion::Line,
            Some(2.0) => Motion::Clockwise,
            Some(3.0) => Motion::Counterclockwise,
            _ => {
                return wrong(self.span(g), "there is no such G word; the language has G00, G01, G02 and G03");
            }
        };
        if !self.words().any(|w| TARGETS.contains(&w.letter)) {
            return wrong(all, "at least one of X, Y, Z, A, B, C must be given");
        }
        let center = self.words().find(|w| CENTER.contains(&w.letter));
        match motion {
            Motion::Joint | Motion::Line => match center {
                Some(w) => wrong(self.span(w), "G00 and G01 have no centre: remove I, J, K"),
                None => Ok(motion),
            },
            Motion::Clockwise | Motion::Counterclockwise => {
                let missing = CENTER.iter().find(|c| !self.words().any(|w| w.letter == **c));
                match missing {
                    Some(c) => {
                        let c = char::from(c.to_ascii_uppercase());
                        wrong(all, &format!("an arc needs I, J and K, the absolute centre; {c} is missing"))
                    }
                    None => Ok(motion),
                }
            }
        }
    }

    fn numbers(&self) -> Result<(), Wrong> {
        let faults = self.scan.faults_of(self.line);
        // Words given twice have a check of their own.
        if let Some(fault) = faults.iter().find(|f| f.code != code::WORD_REPEATED) {
            return Err((fault.code, fault.span, fault.args.to_vec()));
        }
        match self.words().find(|w| w.form == Form::Literal && !w.value.is_finite()) {
            Some(w) => {
                let shown = self.text.get(self.span(w).range()).unwrap_or("").trim().to_string();
                Err((code::NUMBER_MALFORMED, self.span(w), vec![shown.clone(), shown]))
            }
            None => Ok(()),
        }
    }

    fn repeated(&self) -> Option<&Word> {
        let mut seen = 0u32;
        self.words().find(|w| {
            let bit = 1u32 << (w.letter.wrapping_sub(b'a') & 31);
            let twice = seen & bit != 0;
            seen |= bit;
            twice
        })
    }

    fn once(&self) -> Result<(), Wrong> {
        match self.repeated() {
            Some(w) => {
                let letter = char::from(w.letter.to_ascii_uppercase()).to_string();
                Err((code::WORD_REPEATED, self.span(w), vec![letter.clone(), letter]))
            }
            None => Ok(()),
        }
    }

    fn build(&self, line: u32, span: Span, motion: Motion) -> Command {
        let value = |letter: u8| self.words().find(|w| w.letter == letter).map(|w| w.value);
        Command {
            line,
            span,
            motion,
            target: TARGETS.map(value),
            center: CENTER.map(|c| value(c).unwrap_or(0.0)),
            feed: value(b'f'),
        }
    }
}

fn trimmed(text: &str, span: Span) -> Span {
    let line = text.get(span.range()).unwrap_or("");
    let before = line.len() - line.trim_start().len();
    Span::new(span.start + before as u32, span.start + (before + line.trim().len()) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gr_gcode::{Chunk, scan};
    use gr_spec::Dialect;
    use std::sync::Arc;

    fn file(text: &str) -> File {
        let dialect = Dialect::find("ufmg2008").unwrap();
        File::new("a.g", vec![Chunk { text: text.into(), scan: Arc::new(scan(text, dialect)) }])
    }

    #[test]
    fn commands_of_the_thesis() {
        let (commands, faults) = read(FileId(0), &file("G01 X20 Y20 C-80 F500\nG02 X120 Y120 C-10 I120 J20 K0\n"));
        assert_eq!(faults, []);
        assert_eq!(commands[0].motion, Motion::Line);
        assert_eq!(commands[0].target, [Some(20.0), Some(20.0), None, None, None, Some(-80.0)]);
        assert_eq!(commands[0].feed, Some(500.0));
        assert_eq!((commands[1].motion, commands[1].center), (Motion::Clockwise, [120.0, 20.0, 0.0]));
        assert_eq!(commands[1].line, 1);
    }

    #[test]
    fn decimal_comma_and_point() {
        let (commands, faults) = read(FileId(0), &file("G01 X97,96 Y-95.78 Z-90,74 F394,85\n\n"));
        assert_eq!(faults, []);
        assert_eq!(commands[0].target[..3], [Some(97.96), Some(-95.78), Some(-90.74)]);
        assert_eq!(commands[0].feed, Some(394.85));
    }

    #[test]
    fn checks_in_their_order() {
        let slug = |text: &str| {
            let (_, faults) = read(FileId(0), &file(text));
            faults.iter().map(|d| d.code.def().slug).collect::<Vec<_>>()
        };
        assert_eq!(slug("F100\n"), ["ufmg/command"]);
        assert_eq!(slug("M8\n"), ["ufmg/command"]);
        assert_eq!(slug("G01 X1 X2 M8 F\n"), ["syntax/not-in-dialect"]);
        assert_eq!(slug("G05 X1 X2 F1\n"), ["ufmg/command"]);
        assert_eq!(slug("X1 Y2\n"), ["ufmg/command"]);
        assert_eq!(slug("G01 F100\n"), ["ufmg/command"]);
        assert_eq!(slug("G01 X1 I2\n"), ["ufmg/command"]);
        assert_eq!(slug("G03 X1 I2 J1\n"), ["ufmg/command"]);
        assert_eq!(slug("G01 X1 X2 F1\n"), ["word/repeated"]);
        assert_eq!(slug("G01 X Y5 F100\n"), ["word/no-value"]);
    }

    #[test]
    fn examples_of_the_registry() {
        let rows = gr_spec::Code::all().map(gr_spec::Code::def);
        for row in rows.filter(|d| d.dialect == Some("ufmg2008") && d.options.is_none()) {
            let found = read(FileId(0), &file(row.bad.unwrap())).1;
            assert_eq!(found.iter().map(|d| d.code.def().code).collect::<Vec<_>>(), [row.code], "{found:?}");
            assert_eq!(read(FileId(0), &file(row.good.unwrap())).1, [], "{}", row.code);
        }
    }
}
