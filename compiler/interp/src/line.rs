//! One line: its words are read, checked and carried out.

use gr_canon::{Call, Sink};
use gr_gcode::{LineKind, Scan, Word};
use gr_spec::{code, rs274};

use crate::macro_call::is_macro_call;
use crate::run::Flow;
use crate::{End, Fault, Interp, Res};

impl<S: Sink> Interp<'_, S> {
    /// Reads and executes one line.
    #[inline]
    pub(crate) fn line(&mut self, scan: &Scan, text: &str, line: u32) -> Res {
        let at = scan.lines[line as usize];
        let end = scan.lines.get(line as usize + 1).map_or(text.len() as u32, |l| l.start);
        self.reading.line = line;
        self.reading.begin = at.start;
        self.reading.start = at.start;
        self.reading.end = trim_end(text.as_bytes(), at.start, end);
        if self.m.probed | self.m.tool_changed | self.m.input_wanted != 0 {
            self.read_inputs();
        }
        let words = scan.words(line);
        if self.skip.is_some() || at.faulty || at.kind != LineKind::Plain {
            return self.special_line(scan, text, line, words);
        }
        if at.deleted && self.setup.block_delete {
            return Ok(());
        }
        self.block.clear();
        self.comment = None;
        let first = if words.first().is_some_and(|w| w.letter == b'n') { words.get(1) } else { words.first() };
        if let Some(which) = self.subprogram_line(words, first) {
            return self.fanuc_line(scan, text, words, which);
        }
        if self.is_fanuc() && is_macro_call(words) {
            return self.macro_call(scan, text, line, words);
        }
        for w in words {
            self.read_word(scan, text, w)?;
        }
        self.execute_line()
    }

    /// After the words are read: checks, settings, execution.
    #[inline]
    pub(crate) fn execute_line(&mut self) -> Res {
        let fanuc = self.is_fanuc();
        if fanuc {
            self.fanuc_words()?;
        } else if self.setup.dialect.family == gr_spec::Family::Grbl {
            self.grbl_words()?;
        }
        self.enhance()?;
        if fanuc && self.m.turned != 0 && self.block.turning == -1 {
            self.turn_words()?;
        }
        if fanuc && self.block.motion == 330 {
            self.thread_words()?;
        }
        self.check()?;
        self.note_remaps();
        if !self.settings.is_empty() {
            self.store_settings()?;
        }
        self.blocks += 1;
        self.check_budgets()?;
        self.begun = self.emitted;
        self.execute_block()?;
        if fanuc && !self.modal_macros.is_empty() { self.call_modal() } else { Ok(()) }
    }

    /// Budgets end what goes around and around. A program that comes on line by line may be as long as it likes.
    #[inline]
    pub(crate) fn check_budgets(&mut self) -> Res {
        if self.blocks.is_multiple_of(4096) {
            self.sink.give_way();
        }
        let (blocks, calls) = (self.blocks - self.spent.0, self.emitted - self.spent.1);
        if blocks > self.setup.budgets.blocks || calls > self.setup.budgets.calls {
            return self.over_budget(blocks);
        }
        Ok(())
    }

    fn budgets_anew(&mut self) {
        self.spent = (self.blocks, self.emitted);
        self.restarts = 0;
    }

    #[cold]
    fn over_budget(&mut self, blocks: u64) -> Res {
        if self.at_rest() && self.place.line >= self.frontier {
            self.budgets_anew();
            return Ok(());
        }
        let what = if blocks > self.setup.budgets.blocks { "blocks" } else { "motions" };
        Err(self.endless(&format!("the program has run more {what} than the limit allows")))
    }

    /// Counts a line with control flow. Budgets begin anew on each that the main program comes to for the first time
    /// outside of calls and loops, so that it does not matter where a run began.
    pub(crate) fn count_control(&mut self) -> Res {
        if self.level() == 0 && self.place.line >= self.frontier {
            if self.at_rest() {
                self.budgets_anew();
            }
            self.frontier = self.place.line + 1;
        }
        self.blocks += 1;
        self.check_budgets()
    }

    /// Lines with structure, faults, `%`, or while skipping.
    fn special_line(&mut self, scan: &Scan, text: &str, line: u32, words: &[Word]) -> Res {
        let at = scan.lines[line as usize];
        self.block.clear();
        if at.faulty {
            let fault = self.text_fault(scan, line);
            let deleted = at.deleted && self.setup.block_delete;
            if fault.is_some() || (self.skip.is_none() && !deleted) {
                self.opened.damaged_met.insert((self.place.file, self.place.line));
            }
            if let Some(fault) = fault {
                return Err(fault);
            }
        }
        if at.faulty
            && !(at.deleted && self.setup.block_delete)
            && let Some(fault) = scan.faults_of(line).first().filter(|f| f.code == code::BLOCK_BAD_LINE_NUMBER)
            && text.get(at.start as usize..fault.span.start as usize).is_none_or(|t| t.trim_matches([' ', '\t', '/', 'n', 'N']).is_empty())
        {
            // The number of a line is read even where the line is skipped.
            self.opened.damaged_met.insert((self.place.file, self.place.line));
            return Err(crate::findings::convert_fault(fault));
        }
        if at.kind == LineKind::Percent && self.m.percent != 0 && !at.deleted {
            self.emit(Call::Finish);
            if let Some(skip) = &self.skip {
                let name = self.symbols.name(skip.label.name).to_string();
                // The call is what has to be mended. Told to go on, the run does so from here.
                match skip.from {
                    Some(from) if !self.setup.keep_going => self.place = from,
                    from => self.blamed = from,
                }
                return Err(Fault::new(code::SUB_NOT_FOUND, rs274::RT_O_EOF_SUB).arg(self.full_name(skip.label)).named(name));
            }
            self.flow = Flow::End(End::Percent);
            return Ok(());
        }
        if at.deleted && self.setup.block_delete {
            return Ok(());
        }
        self.comment = None;
        self.settings.clear();
        let first = if words.first().is_some_and(|w| w.letter == b'n') { words.get(1) } else { words.first() };
        match first {
            Some(w) if w.letter == b'o' => return self.control_line(scan, text, line, words, w),
            _ => {}
        }
        if let Some(which) = self.subprogram_line(words, first) {
            return self.fanuc_line(scan, text, words, which);
        }
        if self.skip.is_some() {
            return Ok(());
        }
        if at.kind == LineKind::Percent {
            return Err(self.first_fault(scan, line).unwrap_or_else(|| {
                Fault::new(code::SYNTAX_BAD_CHARACTER, rs274::BAD_CHARACTER).arg("%").arg("%")
            }));
        }
        if self.is_fanuc() && is_macro_call(words) {
            return self.macro_call(scan, text, line, words);
        }
        self.read_words(scan, text, line, words)?;
        if words.is_empty() && !at.faulty {
            return Ok(());
        }
        self.execute_line()
    }
}

fn trim_end(text: &[u8], start: u32, end: u32) -> u32 {
    let mut end = end as usize;
    while end > start as usize && matches!(text.get(end - 1), Some(b'\n' | b'\r')) {
        end -= 1;
    }
    end as u32
}
