//! What goes wrong, and what came of a run.

use gr_canon::{FileId, FrameId, Mark, Sink};
use gr_gcode::{Form, Scan};
use gr_spec::{Rs274, code, rs274};
use gr_text::Span;

use crate::block::Group;
use crate::run::Reading;
use crate::{End, Fault, Interp};

/// A fault or doubt, with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// File.
    pub file: FileId,
    /// Line from 0; relative to the chunk when a chunk was run alone.
    pub line: u32,
    /// How execution came there.
    pub frame: FrameId,
    /// What.
    pub fault: Box<Fault>,
    /// The narrowest place known, relative to the start of the line.
    pub span: Option<Span>,
    /// Text of the line that the controller read last, as the real `rs274` shows it.
    pub text: Box<str>,
}

/// What came of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Why it ended.
    pub end: End,
    /// Faults and doubts in the order they were met.
    pub findings: Vec<Finding>,
    /// Damaged lines of the files read that were never executed.
    pub damaged: Vec<(FileId, u32)>,
    /// Blocks executed.
    pub blocks: u64,
    /// Canonical calls.
    pub calls: u64,
    /// Files that were opened, in order.
    pub files: Vec<FileId>,
}

impl Outcome {
    /// Whether the controller would have accepted the program.
    pub fn ok(&self) -> bool {
        self.end != End::Fault && self.findings.iter().all(|f| f.fault.rs.is_none())
    }
}

impl<S: Sink> Interp<'_, S> {
    /// Handles a fault; whether the run ends.
    pub(crate) fn fails(&mut self, fault: Box<Fault>) -> bool {
        let own = fault.rs.is_none();
        self.found(fault);
        self.tell_what_was_meant();
        // What the block was about to set is not set.
        self.settings.clear();
        if self.setup.keep_going && !self.stands_in() {
            self.recover();
        }
        self.unwind();
        own || !self.setup.keep_going || self.findings.len() >= 100
    }

    /// One mistake, one message: what the block would have switched is not to be missed further down.
    fn tell_what_was_meant(&mut self) {
        let Reading { scan, line, .. } = &self.reading;
        if *line as usize >= scan.lines.len() {
            return;
        }
        let meant = |w: &gr_gcode::Word| matches!(w.letter, b'g' | b'm') && w.form == Form::Literal && w.value.abs() < 1e6;
        let words: Vec<_> = scan.words(*line).iter().filter(|w| meant(w)).map(|w| (w.letter, (w.value * 10.0).round() as i32)).collect();
        for (letter, number) in words {
            self.mark(&Mark::Meant(letter, number));
        }
    }

    /// One mistake, one message: blocks behind a move that failed count on its code, and on its end point.
    fn recover(&mut self) {
        let written = self.block.g(Group::Motion);
        let motion = if written != -1 { i32::from(written) } else { self.m.motion };
        let moves = matches!(motion, 0 | 10 | 20 | 30 | 50 | 51);
        if crate::check::is_cycle(written) || written == 760 {
            // Blocks behind a cycle that is not there are positions.
            self.m.motion = 0;
        }
        if !(moves || matches!(motion, 52 | 330 | 382..=385)) || !matches!(self.block.g(Group::NonModal), -1 | 40 | 530) {
            return;
        }
        self.m.motion = motion;
        if moves
            && self.m.comp_side == 0
            && let Ok(end) = self.find_ends()
            && end.iter().all(|v| v.is_finite())
        {
            self.m.current = end;
        }
    }

    /// Takes down a finding of the present block.
    pub(crate) fn found(&mut self, fault: Box<Fault>) {
        let reading = &self.reading;
        let start = reading.begin;
        let known = (reading.line as usize) < reading.scan.lines.len();
        let span = match (fault.span, fault.letter) {
            (Some(span), _) => Some(span),
            (None, Some(letter)) if known => reading
                .scan
                .words(reading.line)
                .iter()
                .find(|w| w.letter == letter)
                .map(|w| reading.scan.word_span(&reading.text, reading.line, w)),
            _ => None,
        };
        let span = span.map(|s| Span::new(s.start.saturating_sub(start), s.end.saturating_sub(start)));
        let blamed = self.blamed.take();
        let p = blamed.unwrap_or(self.place);
        let text = self.line_text();
        let text = text.char_indices().nth(254).map_or(text, |(i, _)| &text[..i]);
        let text = text.split('\0').next().unwrap_or(text);
        // Blanks at the end of a line are not read; a call that the controller made up keeps its own, and a line that is
        // too long is not looked at.
        let whole = fault.code == code::REMAP_WORDS || fault.code == code::TEXT_LINE_TOO_LONG;
        let text = if whole { text } else { text.trim_end() }.into();
        self.findings.push(Finding { file: p.file, line: p.line, frame: p.frame, fault, span, text });
    }

    /// The file ends too early. Told to go on, the controller does so behind the call that it was in.
    pub(crate) fn end_of_file(&mut self) -> Option<End> {
        let fault = self.end_fault();
        let called = self.level() > 0;
        self.found(fault);
        self.unwind();
        let goes_on = called && self.setup.keep_going && self.findings.len() < 100;
        (!goes_on).then_some(End::Fault)
    }

    /// What is wrong when a file ends.
    pub(crate) fn end_fault(&mut self) -> Box<Fault> {
        self.show_last_line();
        match &self.skip {
            Some(skip) if skip.to_sub => {
                let name = self.symbols.name(skip.label.name).to_string();
                let path = self.files.file(self.place.file).path.to_string();
                let start = skip.start;
                if let Some(place) = skip.from {
                    self.place = place;
                }
                Fault::new(code::SUB_NOT_FOUND, rs274::RT_O_EOF_SEEKING).arg(path).arg(&name).arg(start).named(name)
            }
            _ if self.m.percent != 0 => Fault::new(code::PROGRAM_ENDS_EARLY, rs274::RT_NO_PERCENT),
            _ => Fault::new(code::PROGRAM_ENDS_EARLY, rs274::RT_NO_PERCENT_OR_END),
        }
    }

    /// The file's last line becomes the line read last.
    fn show_last_line(&mut self) {
        let file = self.files.file(self.place.file);
        let count = file.line_count();
        let Some((c, l)) = file.locate(count.wrapping_sub(1)) else { return };
        let chunk = file.chunks[c].clone();
        self.place.line = count - 1;
        self.read_alone(&chunk, l);
    }

    /// A fault that the controller finds before it looks at any word.
    pub(crate) fn text_fault(&self, scan: &Scan, line: u32) -> Option<Box<Fault>> {
        scan.faults_of(line).iter().find(|f| before_words(f.rs)).map(convert_fault)
    }

    /// The first fault of a line.
    pub(crate) fn first_fault(&self, scan: &Scan, line: u32) -> Option<Box<Fault>> {
        scan.faults_of(line).first().map(convert_fault)
    }

    /// The fault behind a damaged piece of the present line.
    pub(crate) fn parse_fault(&self, scan: &Scan) -> Box<Fault> {
        self.first_fault(scan, self.reading.line)
            .unwrap_or_else(|| Fault::new(code::NUMBER_MALFORMED, rs274::BAD_NUMBER_FORMAT).arg("").arg(""))
    }

    pub(crate) fn outcome(&mut self, end: End) -> Outcome {
        self.unclosed();
        let mut damaged = Vec::new();
        for id in &self.opened.order {
            if self.files.is_plain(*id) {
                continue;
            }
            let file = self.files.file(*id);
            for (c, chunk) in file.chunks.iter().enumerate() {
                let mut last = u32::MAX;
                for fault in &chunk.scan.faults {
                    let line = file.first_lines[c] + fault.line;
                    if line != last && !self.opened.damaged_met.contains(&(*id, line)) {
                        damaged.push((*id, line));
                    }
                    last = line;
                }
            }
        }
        Outcome {
            end,
            findings: std::mem::take(&mut self.findings),
            damaged,
            blocks: self.blocks,
            calls: self.emitted,
            files: self.opened.order.clone(),
        }
    }
}

fn before_words(rs: Rs274) -> bool {
    rs == rs274::UNCLOSED_COMMENT || rs == rs274::NESTED_COMMENT || rs == rs274::COMMAND_TOO_LONG
}

pub(crate) fn convert_fault(f: &gr_gcode::Fault) -> Box<Fault> {
    Box::new(Fault { code: f.code, rs: Some(f.rs), args: f.args.to_vec(), own_args: Vec::new(), letter: None, span: Some(f.span) })
}
