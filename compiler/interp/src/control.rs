//! Control flow: O-words of branches and loops.
//!
//! The controller has no parser for structure: it executes the words of loops and branches as they come, keeps a
//! table of the labels it met, and *skips* forward until a line with the right label turns up. This is done
//! here just the same, except that skipping goes from one control line to the next through an index.

use gr_canon::{FrameId, Sink};
use gr_gcode::{Control, Form, Keyword, OLabel, Scan, Word};
use gr_spec::{code, rs274};
use gr_text::Span;

use crate::calls::{ARGS, CallKind, structure};
use crate::eval::{not_whole, whole};
use crate::labels::{GLOBAL, Label, LabelAt, MAIN, with_args};
use crate::macros::is_macro;
use crate::run::{Flow, Place};
use crate::statements::op_name;
use crate::{Fault, Interp, Res};

/// Skipping to a label.
#[derive(Clone, Debug)]
pub(crate) struct Skip {
    pub label: Label,
    /// To the start of a subroutine.
    pub to_sub: bool,
    /// Line number where it began.
    pub start: i32,
    /// The block that began it.
    pub from: Option<Place>,
}

/// Whether the damage of an O-word line begins in its label: that is read even on lines that are skipped.
fn label_is_damaged(scan: &Scan, text: &str, line: u32, word: &Word) -> bool {
    let Some(fault) = scan.faults_of(line).first() else { return false };
    let before = text.get(word.start as usize + 1..fault.span.start as usize).unwrap_or("");
    !fault.code.def().slug.starts_with("oword/") && !before.contains(|c: char| c.is_ascii_alphabetic())
}

/// How often a loop that is over may be begun anew by a second end of it: the controller does so for ever.
const RESTARTS: u32 = 1000;

/// A loop that is going on.
#[derive(Clone, Debug)]
pub(crate) struct Loop {
    label: Label,
    level: usize,
    parent: FrameId,
    pass: u64,
}

impl<S: Sink> Interp<'_, S> {
    pub(crate) fn skipping_past(&self, label: Label) -> bool {
        self.skip.as_ref().is_some_and(|s| s.label != label)
    }

    /// The name of an O-word label.
    fn label_name(&mut self, scan: &Scan, label: OLabel) -> Res<u32> {
        match label {
            OLabel::Named(n) => Ok(self.symbols.of(scan.names.get(n as usize).map_or("", |n| n))),
            OLabel::Number(id) => {
                let value = self.eval(scan, id)?;
                let n = whole(value).ok_or_else(|| not_whole(value))?;
                Ok(self.symbols.of_number(n))
            }
            OLabel::None => Ok(self.symbols.of("")),
        }
    }

    pub(crate) fn local(&self, name: u32) -> Label {
        let scope = match (self.level(), self.sub_name) {
            (0, Some(sub)) if self.defining_sub => sub,
            (0, _) => MAIN,
            (level, _) => self.levels[level].sub,
        };
        Label { scope, name }
    }

    pub(crate) fn arg(&mut self, scan: &Scan, c: &Control, n: u32) -> Res<f64> {
        match scan.args.get((c.first_arg + n) as usize) {
            Some(id) if n < c.arg_count => self.eval(scan, *id),
            _ => Err(self.parse_fault(scan)),
        }
    }

    /// A line that begins with an O-word or a macro statement.
    pub(crate) fn control_line(&mut self, scan: &Scan, text: &str, line: u32, words: &[Word], word: &Word) -> Res {
        self.count_control()?;
        let control = match word.form {
            Form::Control => scan.controls.get(word.index()).copied(),
            _ => None,
        };
        let Some(c) = control else {
            let unread = self.defining_sub && !label_is_damaged(scan, text, line, word);
            return if unread { Ok(()) } else { Err(self.parse_fault(scan)) };
        };
        if c.keyword == Keyword::Program && text.get(c.label_span.range()).is_some_and(|l| l.starts_with('<') && !l.ends_with('>')) {
            let mut doubt = Fault::own(code::OWORD_NAME_OPEN);
            doubt.span = Some(c.label_span);
            self.warn(doubt);
        }
        if is_macro(c.keyword) {
            return self.macro_line(scan, text, words, &c);
        }
        let name = self.label_name(scan, c.label)?;
        let faulty = scan.lines[line as usize].faulty;
        self.control(scan, &c, name, faulty).map_err(|mut f| {
            if f.span.is_none() && f.letter.is_none() {
                f.span = Some(Span::new(c.span.start, c.span.end));
            }
            f
        })
    }

    /// What the words of the line ask, read as the controller reads them, then carried out.
    fn control(&mut self, scan: &Scan, c: &Control, name: u32, faulty: bool) -> Res {
        let global = matches!(c.keyword, Keyword::Sub | Keyword::Program | Keyword::Endsub | Keyword::Call | Keyword::Return);
        let label = if global { Label { scope: GLOBAL, name } } else { self.local(name) };
        if c.keyword == Keyword::Program && self.config.no_fanuc_subs {
            return Err(structure(rs274::RT_O_DISABLED, "bare O-numbers are switched off in the INI file"));
        }
        match c.keyword {
            Keyword::Sub | Keyword::Program if self.defining_sub => {
                return Err(structure(rs274::RT_O_NESTED_SUB, "a subroutine is defined inside another one"));
            }
            Keyword::Sub | Keyword::Program => {}
            Keyword::Endsub | Keyword::Return => {
                if self.skipping_past(label) {
                    return Ok(());
                }
                // The expression may still read the value that the last call gave.
                self.unset_read = false;
                let value = match (c.arg_count > 0).then(|| self.arg(scan, c, 0)) {
                    // Of a subroutine that is only read, what its own names will be nobody knows yet.
                    Some(Err(_)) if self.unset_read => Some(0.0),
                    value => value.transpose()?,
                };
                (self.return_value, self.value_returned) = (value.unwrap_or(0.0), value.is_some());
            }
            _ if self.defining_sub => return Ok(()),
            Keyword::Call => {
                if self.skip.is_some() {
                    return Ok(());
                }
                if faulty {
                    return Err(self.parse_fault(scan));
                }
                let mut args = [0.0; ARGS];
                if c.arg_count as usize > ARGS {
                    return Err(Fault::new(code::SUB_LIMIT, rs274::RT_O_PARAMS).arg("a call takes at most thirty arguments"));
                }
                for (i, slot) in args.iter_mut().enumerate().take(c.arg_count as usize) {
                    *slot = self.arg(scan, c, i as u32)?;
                }
                return self.call(label, CallKind::Oword, args, c.arg_count, None);
            }
            Keyword::While | Keyword::Repeat | Keyword::If | Keyword::Elseif => {
                if self.skipping_past(label) {
                    return Ok(());
                }
                self.test_value = self.arg(scan, c, 0)?;
            }
            _ => {}
        }
        if self.skipping_past(label) {
            return Ok(());
        }
        if faulty && self.skip.is_none() {
            return Err(self.parse_fault(scan));
        }
        if self.skip.as_ref().is_some_and(|s| s.to_sub) && !matches!(c.keyword, Keyword::Sub | Keyword::Program) {
            return Ok(());
        }
        match c.keyword {
            Keyword::Sub | Keyword::Program => self.convert_sub(c.keyword, label),
            Keyword::Endsub | Keyword::Return => self.convert_return(c.keyword, false),
            Keyword::Do => {
                self.skip = None;
                if self.known_label(label).is_none() {
                    self.note_label(label, c.keyword)?;
                }
                self.enter_pass(label)
            }
            Keyword::While => self.convert_while(label),
            Keyword::Repeat => self.convert_repeat(label),
            Keyword::If => self.convert_if(label),
            Keyword::Elseif | Keyword::Else => self.convert_else(label, c.keyword),
            Keyword::Endif => {
                let at = self.expect_label(label)?;
                if at.keyword != Keyword::If {
                    let name = self.full_name(label);
                    let fault = self.label_fault(rs274::RT_O_NO_ENDIF, label, "no `if` with this label");
                    let line = self.line_text().trim_end().to_string();
                    return Err(with_args(fault, &[&self.sequence().to_string(), &name, op_name(at.keyword), &(at.sequence + 1).to_string(), &line]));
                }
                self.skip = None;
                self.executed_if = true;
                Ok(())
            }
            Keyword::Break | Keyword::Continue => self.convert_break(label, c.keyword),
            Keyword::Endwhile | Keyword::Endrepeat => self.convert_loop_end(label, c.keyword),
            _ => Ok(()),
        }
    }

    /// The label as the controller writes it.
    pub(crate) fn skip_to(&mut self, label: Label) {
        self.skip = Some(Skip { label, to_sub: false, start: self.sequence(), from: Some(self.place) });
    }

    fn go_back_to(&mut self, at: &LabelAt) {
        self.place.file = at.file;
        self.next = at.line;
        self.shift = at.shift;
        self.flow = Flow::Jump;
    }

    fn convert_while(&mut self, label: Label) -> Res {
        self.check_duplicate(label, Keyword::While, Some(Keyword::Do))?;
        self.skip = None;
        let at = self.expect_label(label)?;
        let yes = self.test_value != 0.0;
        if at.keyword == Keyword::While {
            if yes {
                return self.enter_pass(label);
            }
            self.leave_loop(label);
            self.skip_to(label);
        } else if yes && !self.doing_break {
            self.go_back_to(&at);
        } else {
            self.doing_break = false;
            self.leave_loop(label);
        }
        Ok(())
    }

    fn convert_repeat(&mut self, label: Label) -> Res {
        self.check_duplicate(label, Keyword::Repeat, None)?;
        self.skip = None;
        let count = crate::eval::nearest_int(self.test_value);
        let Some(at) = self.known_label(label).filter(|at| at.keyword == Keyword::Repeat) else { return Ok(()) };
        let left = if at.repeats == -1 { count } else { at.repeats };
        let more = left > 0;
        self.labels.met.insert(label, LabelAt { repeats: if more { left - 1 } else { -1 }, ..at });
        if more {
            return self.enter_pass(label);
        }
        self.leave_loop(label);
        self.skip_to(label);
        Ok(())
    }

    fn convert_if(&mut self, label: Label) -> Res {
        self.check_duplicate(label, Keyword::If, None)?;
        self.executed_if = self.test_value != 0.0;
        if self.executed_if {
            self.skip = None;
        } else {
            self.skip_to(label);
        }
        Ok(())
    }

    fn convert_else(&mut self, label: Label, keyword: Keyword) -> Res {
        let at = self.expect_label(label)?;
        if at.keyword != Keyword::If {
            return Err(self.label_message(rs274::RT_O_NO_IF, label, "no `if` with this label", Some(&at)));
        }
        if self.executed_if {
            self.skip_to(label);
        } else if keyword == Keyword::Elseif {
            if self.test_value != 0.0 {
                self.skip = None;
                self.executed_if = true;
            }
        } else if self.skip.is_some() {
            self.executed_if = true;
            self.skip = None;
        }
        Ok(())
    }

    fn convert_break(&mut self, label: Label, keyword: Keyword) -> Res {
        let at = self.expect_label(label)?;
        if !matches!(at.keyword, Keyword::While | Keyword::Do) {
            return Err(self.label_message(rs274::RT_O_NO_LOOP, label, "no `while` or `do` with this label", Some(&at)));
        }
        if keyword == Keyword::Continue {
            if self.skip.is_some() {
                return Ok(());
            }
            self.doing_continue = true;
        } else {
            self.doing_break = true;
        }
        self.skip_to(label);
        Ok(())
    }

    fn convert_loop_end(&mut self, label: Label, keyword: Keyword) -> Res {
        let at = self.expect_label(label)?;
        let partner = if keyword == Keyword::Endrepeat { Keyword::Repeat } else { Keyword::While };
        if at.keyword != partner {
            return Err(self.label_message(rs274::RT_O_NO_MATCH, label, "no loop of this kind with this label", Some(&at)));
        }
        if self.skip.is_some() {
            self.skip = None;
            if !self.doing_continue {
                self.leave_loop(label);
                return Ok(());
            }
            self.doing_continue = false;
        }
        let level = self.level();
        if !self.loops.iter().any(|l| l.label == label && l.level == level) {
            self.restarts += 1;
            if self.restarts > RESTARTS {
                return Err(self.endless("the loop is over here, and this line begins it anew every time"));
            }
        }
        self.go_back_to(&at);
        Ok(())
    }

    /// A pass of a loop begins.
    pub(crate) fn enter_pass(&mut self, label: Label) -> Res {
        let level = self.level();
        let known = self.loops.iter().rposition(|l| l.label == label && l.level == level);
        let (parent, pass) = match known {
            Some(i) => {
                self.loops.truncate(i + 1);
                self.loops[i].pass += 1;
                (self.loops[i].parent, self.loops[i].pass)
            }
            None => {
                let parent = self.place.frame;
                self.loops.push(Loop { label, level, parent, pass: 1 });
                (parent, 1)
            }
        };
        if pass > self.setup.budgets.passes {
            return Err(self.endless("this loop has run more passes than the limit allows"));
        }
        let name = self.symbols.name(label.name);
        // A Fanuc control's loops have no O-words: `N10`, `DO 1`.
        let name = if self.is_fanuc() { name.to_string() } else { format!("o{name}") };
        self.enter_frame(&name, parent, pass.min(u64::from(u32::MAX)) as u32);
        Ok(())
    }

    pub(crate) fn leave_loop(&mut self, label: Label) {
        let level = self.level();
        if let Some(i) = self.loops.iter().rposition(|l| l.label == label && l.level == level) {
            self.place.frame = self.loops[i].parent;
            self.loops.truncate(i);
        }
    }

    pub(crate) fn endless(&self, what: &str) -> Box<Fault> {
        Fault::own(code::RUN_ENDLESS).arg(what)
    }

    /// M99 of the main program begins another pass.
    pub(crate) fn count_main_pass(&mut self) -> Res {
        let name = self.symbols.of("main program");
        self.enter_pass(Label { scope: MAIN, name })
    }
}
