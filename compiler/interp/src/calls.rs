//! Calls: `o… call`, M98 and M99, remapped codes, the contours of roughing cycles; and the way back.

use gr_canon::{FileId, Sink, Version};
use gr_gcode::{Form, Keyword, LineKind, Scan, Word};
use gr_spec::{Rs274, code, rs274};

use crate::control::Skip;
use crate::eval::{not_whole, to_int, whole};
use crate::labels::{GLOBAL, Label, with_args};
use crate::run::{Flow, Place};
use crate::state::SavedModes;
use crate::statements::first_real;
use crate::{Fault, Interp, Res};

/// Number of subroutine parameters.
pub(crate) const ARGS: usize = 30;
/// Call levels, the main program counted.
const LEVELS: usize = 10;
/// Levels of a Fanuc control, with the main program (Series 0i/30i operator's manual, B-64484, subprogram).
const FANUC_LEVELS: usize = 11;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum CallKind {
    None,
    Oword,
    M98,
    Remap,
    /// G65: ends like M98, with variables of its own.
    Macro,
}

/// Where a call comes back to.
#[derive(Clone, Debug)]
pub(crate) struct Return {
    pub place: Place,
    pub next: u32,
    pub shift: i32,
    /// Its parameters #1 … #30 come back too.
    pub params: bool,
    pub loops: usize,
}

/// One level of the call stack.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    pub sub: u32,
    pub kind: CallKind,
    /// Set while a call from this level is going on.
    pub ret: Option<Return>,
    /// #1 … #30 before the last call with arguments from this level. They stay: after an error the controller takes
    /// them back even when they are not those of the call that failed.
    pub kept: Option<Box<[f64; ARGS]>>,
    /// Fanuc: the local variables while a macro that this level called has its own.
    pub locals: Option<Box<crate::macro_call::Locals>>,
    /// Fanuc: this level is a macro that a movement called (G66).
    pub modal: Option<crate::macro_call::ModalCall>,
    pub m98_left: i32,
    pub saved: Option<Box<SavedModes>>,
    pub saved_valid: bool,
    pub restore: bool,
}

impl Level {
    pub fn new(sub: u32) -> Level {
        Level { sub, kind: CallKind::None, ret: None, kept: None, locals: None, modal: None, m98_left: -1, saved: None, saved_valid: false, restore: false }
    }
}

/// Which of M98 and M99 a line is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Fanuc {
    M98,
    M99,
}

fn base_name(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

pub(crate) fn structure(rs: Rs274, what: &str) -> Box<Fault> {
    Fault::new(code::SUB_STRUCTURE, rs).arg(what)
}

impl<S: Sink> Interp<'_, S> {
    /// Whether a line is an M98 or M99 that works as an O-word: by its first word, or on a Fanuc control by any.
    #[inline]
    pub(crate) fn subprogram_line(&self, words: &[Word], first: Option<&Word>) -> Option<Fanuc> {
        let by_first = first.and_then(|w| self.subprogram_word(w));
        if by_first.is_none() && self.is_fanuc() { words.iter().find_map(|w| self.subprogram_word(w)) } else { by_first }
    }

    #[inline]
    fn subprogram_word(&self, w: &Word) -> Option<Fanuc> {
        if w.letter != b'm' || w.form != Form::Literal {
            return None;
        }
        match whole(w.value) {
            Some(98) => Some(Fanuc::M98),
            Some(99) if self.level() > 0 => Some(Fanuc::M99),
            _ => None,
        }
    }

    /// A line with M98 or M99.
    pub(crate) fn fanuc_line(&mut self, scan: &Scan, text: &str, words: &[Word], which: Fanuc) -> Res {
        self.count_control()?;
        self.check_listed_m(if which == Fanuc::M98 { 98 } else { 99 })?;
        let mut rest: Vec<Word> = first_real(words).map_or_else(Vec::new, |first| {
            words.iter().filter(|w| w.start > first.start).copied().collect()
        });
        if self.is_fanuc() {
            let own = |w: &Word| matches!(w.letter, b'p' | b'l' if which == Fanuc::M98 || w.letter == b'p');
            let others: Vec<Word> = words.iter().filter(|w| !own(w) && w.letter != b'n' && self.subprogram_word(w) != Some(which)).copied().collect();
            if others.iter().any(|w| w.form != Form::Comment) {
                self.beside_call(scan, text, &others, which)?;
                rest = words.iter().filter(|w| own(w)).copied().collect();
            }
        }
        if which == Fanuc::M99 {
            if self.config.no_fanuc_subs {
                return Err(structure(rs274::RT_M99_DISABLED, "M99 as end of a subroutine is switched off in the INI file"));
            }
            if self.skip.is_none() && !self.is_fanuc() && rest.iter().any(|w| w.form != Form::Comment) {
                return Err(Fault::new(code::OWORD_TRAILING_TEXT, rs274::AFTER_O_WORD));
            }
            if self.defining_sub {
                return Err(structure(rs274::RT_M99_ENDSUB, "`o… endsub` is missing: M99 can't end an `o… sub`"));
            }
            let label = Label { scope: GLOBAL, name: self.levels[self.level()].sub };
            if self.skipping_past(label) {
                return Ok(());
            }
            self.return_value = 0.0;
            self.value_returned = false;
            if self.skip.as_ref().is_some_and(|s| s.to_sub) {
                return Ok(());
            }
            let target = self.return_target(scan, &rest)?;
            self.convert_return(Keyword::MacroEnd, true)?;
            return target.map_or(Ok(()), |n| self.go_to_number(n));
        }
        if self.config.no_fanuc_subs {
            return Err(structure(rs274::RT_M98_DISABLED, "M98 is switched off in the INI file"));
        }
        for w in &rest {
            self.read_word(scan, text, w)?;
        }
        let Some(p) = self.block.get(b'p') else {
            return Err(Fault::new(code::WORD_MISSING, rs274::RT_M98_P).arg("M98").arg("P").at(b'm'));
        };
        let number = whole(p).ok_or_else(|| not_whole(p).at(b'p'))?;
        let (number, in_p) = match self.is_fanuc() {
            true => gr_gcode::fanuc_call(number.into(), self.block.has(b'l')),
            false => (number.into(), None),
        };
        let name = self.symbols.of(&number.to_string());
        let label = Label { scope: GLOBAL, name };
        if self.skip.is_none() {
            self.m98 = true;
            let checked = self.enhance().and_then(|()| self.check());
            self.m98 = false;
            checked?;
        }
        if self.skipping_past(label) || self.skip.as_ref().is_some_and(|s| s.to_sub) || self.defining_sub {
            return Ok(());
        }
        let repeats = self.block.get(b'l').map(to_int).or(in_p.map(|n| n as i32));
        self.call(label, CallKind::M98, [0.0; ARGS], 0, repeats)
    }

    /// Fanuc: the other words of a block with M98 or M99 are carried out, then the subprogram is called or left (Series 0i/30i
    /// operator's manual, common to lathe and machining center, B-64484, subprogram).
    fn beside_call(&mut self, scan: &Scan, text: &str, words: &[Word], which: Fanuc) -> Res {
        let done = which == Fanuc::M98 && self.levels[self.level()].m98_left != -1;
        if self.skip.is_some() || self.defining_sub || done {
            return Ok(());
        }
        let name = if which == Fanuc::M98 { "M98" } else { "M99" };
        let ends = |w: &&Word| w.letter == b'm' && w.form == Form::Literal && matches!(whole(w.value), Some(2 | 30 | 98 | 99));
        if let Some(other) = words.iter().find(ends) {
            return Err(self.not_carried_out(rs274::SILENT, format!("{name} beside M{}", other.value)).at(b'm'));
        }
        // A movement would call two programs, or one that is to be left.
        if self.modal_to_call().is_some() && words.iter().any(|w| b"xyzabcuvwh".contains(&w.letter)) {
            return Err(self.not_carried_out(rs274::SILENT, format!("{name} beside a movement while G66 is in force")).at(b'm'));
        }
        for w in words {
            self.read_word(scan, text, w)?;
        }
        self.execute_line()?;
        self.block.clear();
        Ok(())
    }

    /// Fanuc: M99 P goes back to the block with that number.
    fn return_target(&mut self, scan: &Scan, words: &[Word]) -> Res<Option<f64>> {
        let Some(p) = words.iter().find(|w| w.letter == b'p').filter(|_| self.is_fanuc()) else { return Ok(None) };
        Ok(Some(match p.form {
            Form::Expr => self.eval(scan, gr_gcode::ExprId(p.index() as u32))?,
            _ => p.value,
        }))
    }

    pub(crate) fn convert_sub(&mut self, keyword: Keyword, label: Label) -> Res {
        let kind = self.levels[self.level()].kind;
        if keyword == Keyword::Program && !matches!(kind, CallKind::M98 | CallKind::Macro | CallKind::None) {
            return Err(structure(rs274::RT_O_FANUC_CALL, "a subroutine that begins with O and its number is called with M98"));
        }
        if keyword == Keyword::Sub && kind == CallKind::M98 {
            return Err(structure(rs274::RT_O_CALL_SUB, "a subroutine that begins with `o… sub` is called with `o… call`"));
        }
        if self.skip.is_some() {
            self.note_label(label, keyword)?;
            self.skip = None;
        }
        if keyword == Keyword::Program {
            return Ok(());
        }
        if self.level() != 0 {
            let called = self.levels[self.level()].sub;
            // Only the called subroutine may begin here, says 2.10.
            if self.setup.version == Version::V2_10 && called != label.name {
                let (inner, outer) = (self.full_name(label), self.symbols.name(called).to_string());
                let fault = structure(rs274::RT_O_NESTED_CALLED, "a subroutine is defined inside another one");
                return Err(with_args(fault, &[&inner, &outer]));
            }
            return Ok(());
        }
        self.note_label(label, keyword)?;
        self.skip_to(label);
        self.defining_sub = true;
        self.sub_name = Some(label.name);
        Ok(())
    }

    pub(crate) fn convert_return(&mut self, keyword: Keyword, m99: bool) -> Res {
        if self.level() == 0 && self.sub_name.is_none() && !self.came_back {
            let args = [self.sequence().to_string(), self.line_text().trim_end().to_string()];
            let fault = structure(rs274::RT_O_NOT_IN_SUB_LINE, "").own_args(&["this ends a subroutine, but none has begun"]);
            return Err(with_args(fault, &[&args[0], &args[1]]));
        }
        let kind = self.levels[self.level()].kind;
        if kind == CallKind::M98 && !m99 {
            return Err(structure(rs274::RT_O_FANUC_END, "a subroutine called with M98 ends with M99"));
        }
        if kind == CallKind::Oword && m99 {
            return Err(structure(rs274::RT_O_SUB_END, "a subroutine called with `o… call` ends with `o… endsub`"));
        }
        if self.skip.is_some() && keyword == Keyword::Endsub {
            self.skip = None;
        }
        if self.level() == 0 {
            if keyword == Keyword::Endsub {
                if !self.defining_sub {
                    return Err(structure(rs274::RT_O_NOT_IN_SUB, "this ends a subroutine, but none has begun"));
                }
                self.skip = None;
                self.defining_sub = false;
                (self.sub_name, self.came_back) = (None, false);
            }
            return Ok(());
        }
        self.leave_call()
    }

    /// Back to the caller.
    fn leave_call(&mut self) -> Res {
        let level = self.level();
        let Some(left) = self.levels.pop() else { return Ok(()) };
        let Some(ret) = self.levels[level - 1].ret.take() else { return Ok(()) };
        if ret.params {
            self.take_back_params(level - 1);
        }
        if let Some(call) = left.modal {
            self.leave_modal(call);
        }
        self.take_back_variables(level - 1);
        self.place = ret.place;
        self.next = ret.next;
        self.shift = ret.shift;
        self.loops.truncate(ret.loops);
        self.flow = Flow::Jump;
        self.params.leave_level(level);
        let caller = self.levels[level - 1].sub;
        self.sub_name = (level > 1).then_some(caller);
        // The main program has a name too, an empty one, until an error takes it away.
        self.came_back = level == 1 && !self.main_unnamed;
        if left.restore && left.saved_valid {
            if let Some(saved) = &left.saved {
                self.restore_modes(saved).map(drop)?;
            }
        }
        match left.modal {
            Some(call) => self.repeat_modal(call),
            None if left.kind == CallKind::Remap => self.remap_finished(),
            None => Ok(()),
        }
    }

    /// #1 … #30 as they were before the last call with arguments from this level, zeros if there was none.
    pub(crate) fn take_back_params(&mut self, level: usize) {
        let kept = self.levels.get(level).and_then(|l| l.kept.clone()).unwrap_or_else(|| Box::new([0.0; ARGS]));
        for (i, v) in kept.iter().enumerate() {
            self.write_param(i as u32 + 1, *v);
        }
    }

    /// Calls a subroutine.
    pub(crate) fn call(&mut self, label: Label, kind: CallKind, args: [f64; ARGS], count: u32, repeats: Option<i32>) -> Res {
        let level = self.level();
        if level + 1 >= if self.is_fanuc() { FANUC_LEVELS } else { LEVELS } {
            return Err(Fault::new(code::SUB_LIMIT, rs274::RT_O_LEVELS).arg("subroutines call each other too deeply"));
        }
        if kind == CallKind::M98 && repeats == Some(0) {
            // The controller makes the new level but stays here: what follows runs inside it until M99.
            return self.call_nothing(label);
        }
        let mut next = self.next;
        if let (CallKind::M98 | CallKind::Macro, Some(repeats)) = (kind, repeats) {
            let here = &mut self.levels[level];
            if here.m98_left == -1 {
                here.m98_left = repeats;
            }
            here.m98_left -= 1;
            if here.m98_left > 0 {
                next = self.place.line;
            } else {
                here.m98_left = -1;
            }
        }
        let params = !matches!(kind, CallKind::M98 | CallKind::Macro);
        if params {
            self.levels[level].kept = Some(Box::new(std::array::from_fn(|i| self.params.get(i as u32 + 1))));
            for (i, v) in args.iter().enumerate() {
                self.write_param(i as u32 + 1, *v);
            }
        }
        let ret = Return { place: self.place, next, shift: self.shift, params, loops: self.loops.len() };
        self.levels[level].ret = Some(ret);
        let mut new = Level::new(label.name);
        new.kind = kind;
        self.levels.push(new);
        if self.config.n_args {
            self.params.set_named(level + 1, "n_args", f64::from(count));
        }
        let name = self.symbols.name(label.name).to_string();
        self.enter_frame(&format!("sub {name}"), self.place.frame, 0);
        self.skip = None;
        self.go_to_sub(&name).inspect_err(|_| {
            self.levels.pop();
        })
    }

    fn call_nothing(&mut self, label: Label) -> Res {
        let level = self.level();
        let ret = Return { place: self.place, next: self.next, shift: self.shift, params: false, loops: self.loops.len() };
        self.levels[level].ret = Some(ret);
        let mut new = Level::new(label.name);
        new.kind = CallKind::M98;
        self.levels.push(new);
        Ok(())
    }

    fn go_to_sub(&mut self, name: &str) -> Res {
        let base = self.symbols.of(base_name(name));
        let label = Label { scope: GLOBAL, name: base };
        self.flow = Flow::Jump;
        if let Some(at) = self.known_label(label) {
            self.place.file = at.file;
            self.next = at.line;
            self.shift = at.shift;
            return Ok(());
        }
        // Where the call stands, not inside it.
        let caller = self.level().checked_sub(1).and_then(|l| self.levels[l].ret.as_ref());
        let from = caller.map_or(self.place, |ret| ret.place);
        let mut start = self.sequence();
        if let Some(file) = self.files.find_sub(name) {
            self.note_file(file);
            self.place.file = file;
            self.next = self.behind_percent(file);
            self.shift = 0;
            start = 0;
        } else if self.setup.version == Version::V2_10 && self.outside_main_file() {
            // 2.10 looks ahead in the main program's file only.
            let what = "the subroutine is neither known so far nor a file of its own";
            let fault = structure(rs274::RT_O_NOT_FOUND, what);
            return Err(with_args(fault, &[name, &format!("{name}.ngc")]));
        } else if self.is_fanuc() && let Some((file, line)) = self.subprogram(name) {
            // All programs are in the control's memory, in no order.
            if file != self.place.file {
                self.shift = self.levels[0].ret.as_ref().map_or(0, |ret| ret.shift);
            }
            (self.place.file, self.next) = (file, line);
        }
        self.skip = Some(Skip { label, to_sub: true, start, from: Some(from) });
        Ok(())
    }

    /// Where a program of this file, or of the main program's, begins.
    fn subprogram(&mut self, name: &str) -> Option<(FileId, u32)> {
        let (here, line) = (self.place.file, self.place.line);
        let main = self.levels[0].ret.as_ref().map_or(here, |ret| ret.place.file);
        let mut find = |file: FileId| self.index(file).subprogram(name, line).map(|at| (file, at));
        find(here).or_else(|| if main == here { None } else { find(main) })
    }

    /// Where a file that is called begins: on a Fanuc control every file opens with `%`, which is no end of it.
    fn behind_percent(&self, file: FileId) -> u32 {
        let Some((chunk, _, _)) = self.files.chunk(file, 0).filter(|_| self.is_fanuc()) else { return 0 };
        let blank = |l: &u32| chunk.scan.words(*l).is_empty() && chunk.scan.lines[*l as usize].kind != LineKind::Percent;
        let first = (0..chunk.scan.lines.len() as u32).find(|l| !blank(l));
        first.filter(|l| chunk.scan.lines[*l as usize].kind == LineKind::Percent).map_or(0, |l| l + 1)
    }

    /// The line stands in another file than the main program's first call.
    fn outside_main_file(&self) -> bool {
        self.levels[0].ret.as_ref().is_some_and(|ret| ret.place.file != self.place.file)
    }

    /// Calls a remap's subroutine; its words become named parameters of the new level.
    pub(crate) fn call_named(&mut self, name: &str, args: &[f64], by_name: &[(char, f64)]) -> Res {
        let name = self.symbols.of(name);
        let mut all = [0.0; ARGS];
        for (slot, v) in all.iter_mut().zip(args) {
            *slot = *v;
        }
        self.call(Label { scope: GLOBAL, name }, CallKind::Remap, all, args.len() as u32, None)?;
        let level = self.level();
        for (letter, value) in by_name {
            self.params.set_named(level, &letter.to_string(), *value);
        }
        Ok(())
    }

    /// Calls the subroutine of a contour and hands every block of it to `take`.
    pub(crate) fn read_contour(&mut self, number: f64, reader: &mut crate::rough::Reader) -> Res {
        let n = whole(number).ok_or_else(|| not_whole(number).at(b'q'))?;
        let name = self.symbols.of(&n.to_string());
        let base = self.level();
        self.call(Label { scope: GLOBAL, name }, CallKind::Oword, [0.0; ARGS], 0, None)?;
        let saved = (self.place, self.reading.clone());
        self.in_contour = true;
        let mut done = Ok(());
        while done.is_ok() && self.level() > base {
            done = self.contour_line(reader);
        }
        self.in_contour = false;
        done?;
        self.place = saved.0;
        // Faults belong to the block of the cycle, but the line read last stays the contour's.
        let (text, start, end) = (self.reading.text.clone(), self.reading.start, self.reading.end);
        self.reading = crate::run::Reading { text, start, end, ..saved.1 };
        Ok(())
    }

    fn contour_line(&mut self, reader: &mut crate::rough::Reader) -> Res {
        let from = if self.skip.is_some() { self.next_control(self.next) } else { self.next };
        let file = self.files.file(self.place.file);
        let Some((c, l)) = file.locate(from) else {
            return Err(self.end_fault());
        };
        let chunk = file.chunks[c].clone();
        self.next = from + 1;
        self.place.line = from;
        self.reading.line = l;
        let span = chunk.scan.line_span(&chunk.text, l);
        (self.reading.begin, self.reading.start, self.reading.end) = (span.start, span.start, span.end);
        (self.reading.text, self.reading.scan) = (chunk.text.clone(), chunk.scan.clone());
        let (scan, words) = (&chunk.scan, chunk.scan.words(l));
        if scan.lines[l as usize].deleted && self.setup.block_delete {
            return Ok(());
        }
        self.blocks += 1;
        self.check_budgets()?;
        self.block.clear();
        self.comment = None;
        self.settings.clear();
        let first = first_real(words);
        if let Some(w) = first.filter(|w| w.letter == b'o') {
            return self.control_line(scan, &chunk.text, l, words, w);
        }
        if let Some(which) = self.subprogram_line(words, first) {
            return self.fanuc_line(scan, &chunk.text, words, which);
        }
        if self.skip.is_some() {
            return Ok(());
        }
        self.read_words(scan, &chunk.text, l, words)?;
        self.enhance()?;
        self.check()?;
        self.store_settings()?;
        reader.block(self)
    }
}
