//! Macro statements of Fanuc controls: IF, GOTO, WHILE, DO, END.

use gr_canon::Sink;
use gr_gcode::{Control, Form, Keyword, Scan, Word};
use gr_spec::{code, rs274};

use crate::labels::Label;
use crate::run::Flow;
use crate::statements::first_real;
use crate::{Fault, Interp, Res};

impl<S: Sink> Interp<'_, S> {
    pub(crate) fn macro_line(&mut self, scan: &Scan, text: &str, words: &[Word], c: &Control) -> Res {
        if self.skip.is_some() {
            return Ok(());
        }
        match c.keyword {
            Keyword::MacroIfGoto => {
                if self.arg(scan, c, 0)? != 0.0 {
                    let target = self.arg(scan, c, 1)?;
                    return self.go_to_number(target);
                }
                Ok(())
            }
            Keyword::MacroIfThen => {
                if self.arg(scan, c, 0)? == 0.0 {
                    return Ok(());
                }
                for w in words.iter().filter(|w| w.start >= c.span.start && w.letter != b'o') {
                    self.read_word(scan, text, w)?;
                }
                self.execute_line()
            }
            Keyword::MacroGoto => {
                let target = self.arg(scan, c, 0)?;
                self.go_to_number(target)
            }
            Keyword::MacroWhile => {
                let n = self.arg(scan, c, 1)?;
                let yes = self.arg(scan, c, 0)? != 0.0;
                let label = self.macro_label(n);
                if yes {
                    return self.enter_pass(label);
                }
                self.leave_loop(label);
                match self.find_macro(n, true)? {
                    Some(line) => {
                        self.next = line + 1;
                        self.flow = Flow::Jump;
                        Ok(())
                    }
                    None => Err(no_partner(&format!("DO {n}"), "no END with this number")),
                }
            }
            Keyword::MacroDo => {
                let n = self.arg(scan, c, 0)?;
                let label = self.macro_label(n);
                self.enter_pass(label)
            }
            _ => {
                let n = self.arg(scan, c, 0)?;
                match self.find_macro(n, false)? {
                    Some(line) => {
                        self.next = line;
                        self.flow = Flow::Jump;
                        Ok(())
                    }
                    None => Err(no_partner(&format!("END {n}"), "no DO with this number")),
                }
            }
        }
    }

    fn macro_label(&mut self, n: f64) -> Label {
        let name = self.symbols.of(&format!("DO {n}"));
        self.local(name)
    }

    pub(crate) fn go_to_number(&mut self, target: f64) -> Res {
        let index = self.index(self.place.file);
        let Some(line) = index.numbered(target as i64, self.place.line) else {
            return Err(no_partner(&format!("N{target}"), "no block of this program has this number"));
        };
        if line <= self.place.line {
            let name = self.symbols.of(&format!("N{target}"));
            let label = self.local(name);
            self.enter_pass(label)?;
        }
        self.next = line;
        self.flow = Flow::Jump;
        Ok(())
    }

    /// Whether a GOTO stands between two lines.
    pub(crate) fn has_goto(&mut self, from: u32, to: u32) -> bool {
        let index = self.index(self.place.file);
        let lines = index.lines.iter().copied().skip_while(|l| *l < from).take_while(|l| *l <= to);
        let file = self.files.file(self.place.file);
        lines.filter_map(|l| file.locate(l)).any(|(c, l)| {
            let scan = &file.chunks[c].scan;
            let control = first_real(scan.words(l)).filter(|w| w.form == Form::Control).and_then(|w| scan.controls.get(w.index()));
            control.is_some_and(|c| matches!(c.keyword, Keyword::MacroGoto | Keyword::MacroIfGoto))
        })
    }

    /// The END that belongs to a WHILE (forward), or the WHILE or DO that belongs to an END (backward).
    fn find_macro(&mut self, n: f64, forward: bool) -> Res<Option<u32>> {
        let index = self.index(self.place.file);
        let here = self.place.line;
        let at = index.lines.partition_point(|l| *l < here);
        let lines: Box<dyn Iterator<Item = &u32>> = if forward {
            Box::new(index.lines[at..].iter().filter(|l| **l > here))
        } else {
            Box::new(index.lines[..at].iter().rev())
        };
        for line in lines.copied().take_while(|l| index.in_one_program(*l, here)) {
            let file = self.files.file(self.place.file);
            let Some((c, l)) = file.locate(line) else { continue };
            let scan = file.chunks[c].scan.clone();
            let Some(w) = first_real(scan.words(l)).filter(|w| w.form == Form::Control) else { continue };
            let Some(control) = scan.controls.get(w.index()).copied() else { continue };
            let number = match control.keyword {
                Keyword::MacroEnd if forward => 0,
                Keyword::MacroDo if !forward => 0,
                Keyword::MacroWhile if !forward => 1,
                _ => continue,
            };
            if self.arg(&scan, &control, number)? == n {
                return Ok(Some(line));
            }
        }
        Ok(None)
    }
}

/// What a statement names is not there.
fn no_partner(name: &str, what: &str) -> Box<Fault> {
    Fault::new(code::FLOW_LABEL, rs274::SILENT).arg(name).arg(what)
}

pub(crate) fn is_macro(keyword: Keyword) -> bool {
    matches!(
        keyword,
        Keyword::MacroIfGoto
            | Keyword::MacroIfThen
            | Keyword::MacroGoto
            | Keyword::MacroWhile
            | Keyword::MacroDo
            | Keyword::MacroEnd
    )
}
