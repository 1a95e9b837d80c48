//! Everything that does not move: offsets, tools, spindle, coolant, modes, outputs.

use super::emit::Emitter;
use super::{ChangeAt, Language};
use super::write::AXES;
use crate::sources::{Words, number_of, sets_here};
use gr_ir::{Axes, Op, Override, PathMode, Source, Turn, View};
use gr_text::code;

pub(super) const OFFSETS: [&str; 10] = ["", "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];

/// Places that are nearer to each other are one, mm.
const SAME_PLACE: f64 = 1e-3;
/// Height above the place of tool changes in G55, mm.
const ABOVE_CHANGE: f64 = 5.0;

impl Emitter<'_> {
    pub fn setting(&mut self, view: &View<'_, '_>) {
        let source = view.source;
        match view.op {
            Op::WorkOffset(n, offset) => self.work_offset(n, &offset, view),
            Op::StoredOffset { number, offset, rotation } => self.stored_offset(number, &offset, rotation, view),
            Op::Rotation(angle) => self.rotation(angle, view),
            Op::LocalOffset(offset) => self.local_offset(&offset, view),
            Op::ToolOffset { offset, number } => self.tool_offset(&offset, number, view),
            Op::ToolPrepare(n) => self.w.block(&format!("T{n}")),
            Op::ToolChange(_) => self.tool_change(view),
            Op::ToolNumber(n) if self.linuxcnc() => self.w.block(&format!("M61 Q{n}")),
            Op::ToolNumber(_) => self.cannot("naming the tool in the spindle (M61)", source),
            Op::ToolEntry { .. } => self.tool_entry(view),
            Op::SpindleMode { spindle, surface } => self.spindle_mode(spindle, surface, view),
            Op::SpindleSpeed { spindle, speed } => self.spindle_speed(spindle, speed, view),
            Op::SpindleTurn { spindle, turn } => self.spindle_turn(spindle, turn, source),
            Op::SpindleOrient { spindle, angle, direction } => self.orient(spindle, angle, direction, view),
            Op::SpindleWait { .. } => self.cannot("waiting for spindle orientation alone", source),
            Op::Mist(on) => self.coolant(on, "M7", view),
            Op::Flood(on) => self.coolant(on, "M8", view),
            Op::PathMode(mode) => self.path_mode(mode, view),
            Op::MergeTolerance(t) if self.linuxcnc() && t > 0.0 => self.merge_tolerance(t, view),
            Op::Planner(Some(_)) => self.as_comment("smooth planner (G64 R)", source),
            Op::Override(which, on) => self.override_switch(which, on, source),
            Op::DigitalOut { index, on, synced } => {
                let code = match (synced, on) {
                    (true, true) => 62,
                    (true, false) => 63,
                    (false, true) => 64,
                    (false, false) => 65,
                };
                self.machine_io(&format!("M{code} P{index}"), "a digital output", source);
            }
            Op::AnalogOut { index, value, synced } => {
                let value = self.w.number(value, 9);
                let code = if synced { 67 } else { 68 };
                self.machine_io(&format!("M{code} E{index} Q{value}"), "an analog output", source);
            }
            Op::InputWait { index, digital, wait, timeout } => {
                let letter = if digital { 'P' } else { 'E' };
                let limit = if wait == 0 { String::new() } else { format!(" Q{}", self.w.number(timeout, 6)) };
                self.machine_io(&format!("M66 {letter}{index} L{wait}{limit}"), "reading an input", source);
            }
            Op::UserM { code, p, q } => self.user_code(code, p, q, source),
            _ => {}
        }
    }

    fn machine_io(&mut self, block: &str, what: &str, source: Source) {
        if self.linuxcnc() { self.w.block(block) } else { self.cannot(what, source) }
    }

    fn user_code(&mut self, code: i32, p: f64, q: f64, source: Source) {
        let mut block = format!("M{code}");
        // A word that was not there reads as zero or below; the program behind the code gets the same.
        for (letter, value) in [('P', p), ('Q', q)] {
            if value != 0.0 && value != -1.0 {
                block += &format!(" {letter}{}", self.w.number(value, 9));
            }
        }
        self.machine_io(&block, "a user-defined M-code", source);
    }

    /// Words of the axes in which two offsets differ, with all the decimals an offset needs.
    fn changed(&self, new: &Axes, old: &Axes) -> Vec<String> {
        self.changed_or_named(new, old, None)
    }

    /// The same, and the axes that a block of the source names: what it says is said again, also where the simulation has
    /// it already. The control may not.
    fn changed_or_named(&self, new: &Axes, old: &Axes, block: Option<Words>) -> Vec<String> {
        let places = self.w.places.max(9);
        let named = |i: usize| block.is_some_and(|w| w.has(AXES[i].to_ascii_lowercase() as u8));
        // The same value, stored in inches and told in mm, may differ in its last bit.
        let said = (0..9).filter(|i| (new[*i] - old[*i]).abs() > 1e-10 || named(*i));
        said.map(|i| format!("{}{}", AXES[i], self.w.axis_fine(i, new[i], places).0)).collect()
    }

    fn work_offset(&mut self, n: u8, offset: &Axes, view: &View<'_, '_>) {
        let index = usize::from(n.clamp(1, 9));
        let selected = self.frame.work == n;
        if self.options.language != Language::Linuxcnc && index > 6 {
            self.cannot(&format!("work offset {}", OFFSETS[index]), view.source);
            return self.move_frame(view.state);
        }
        let set = self.words(view.source).filter(|w| w.g(100));
        let words = self.changed_or_named(offset, &self.offsets[index], set);
        if let Some(block) = self.set_here(n, offset, view) {
            self.w.block(&block);
            self.offsets[index] = *offset;
            return self.motion_unsure();
        }
        if words.is_empty() || !selected {
            self.w.block(OFFSETS[index]);
        }
        if !words.is_empty() {
            let fanuc = self.options.language == Language::FanucMill;
            // P0 is the one in force, whichever that is; on a Fanuc control it is another one.
            let here = selected && !fanuc && set.is_some() && number_of(self.sources, 'p', view.source) == Some(0);
            self.store(if here { 0 } else { index }, index, &words, view.source);
        }
        self.offsets[index] = *offset;
        self.motion_unsure();
        self.move_frame(view.state);
        if !selected {
            // Where its origin is the machine knows: the same numbers are another place.
            self.anchored = [false; 9];
        }
    }

    /// Whether the machine coordinates are known in which the axes of a block stand.
    fn stands_known(&self, block: Option<Words>) -> bool {
        let mut named = (0..9).filter(|i| block.is_some_and(|w| w.has(AXES[*i].to_ascii_lowercase() as u8)));
        self.options.stored_known && named.all(|i| self.anchored[i] && self.loose[i].is_none())
    }

    /// Writes G10 L2 for a work offset, called by its number or 0.
    fn store(&mut self, number: usize, index: usize, words: &[String], source: Source) {
        if let Some(axis) = self.lacks(|i| words.iter().any(|w| w.starts_with(AXES[i]))) {
            return self.cannot(&format!("a work offset of the {axis} axis"), source);
        }
        let block = format!("G10 L2 P{number} {}", words.join(" "));
        self.say(code::EMIT_OFFSET_NOT_CARRIED, source, &[OFFSETS[index].into(), block.clone()]);
        let fanuc = self.options.language == Language::FanucMill;
        self.w.block(&if fanuc { block.replacen("G10", "G90 G10", 1) } else { block });
    }

    /// A work offset that is not in force gets values for later.
    fn stored_offset(&mut self, number: u8, offset: &Axes, rotation: f64, view: &View<'_, '_>) {
        let index = usize::from(number.clamp(1, 9));
        let (old, turned) = (self.offsets[index], rotation != self.rotations[index]);
        self.offsets[index] = *offset;
        if view.source.line == crate::from_line::INSERTED {
            // The machine has kept it.
            return;
        }
        self.rotations[index] = rotation;
        if !self.linuxcnc() && index > 6 {
            return self.cannot(&format!("work offset {}", OFFSETS[index]), view.source);
        }
        let set = self.words(view.source).filter(|w| w.g(100));
        self.motion_unsure();
        if sets_here(self.sources, view.source) {
            if self.options.language != Language::FanucMill {
                // The numbers that the place has under that offset, wherever rounding has put it.
                let mut there = *view.state;
                let mut nowhere = gr_ir::Pose::default();
                [Op::WorkOffset(number, *offset), Op::Rotation(rotation)].iter().for_each(|op| there.apply(op, &mut nowhere));
                let at = std::array::from_fn(|i| self.loose[i].map_or(self.at[i], |back| view.end.axes[i] + back));
                let place = there.work_frame(&self.frame.machine(&at));
                let words = self.changed_or_named(&place, &place, set);
                return self.w.block(&format!("G10 L20 P{index} {}", words.join(" ")));
            }
            if !self.stands_known(set) {
                return self.cannot("a work offset set from where the tool stands (G10 L20)", view.source);
            }
        }
        let mut words = self.changed_or_named(offset, &old, set);
        if turned || self.linuxcnc() && set.is_some_and(|w| w.has(b'r')) {
            if !self.linuxcnc() {
                return self.cannot("a rotated work offset", view.source);
            }
            words.push(format!("R{}", self.w.number(rotation.to_degrees(), 10)));
        }
        if !words.is_empty() {
            self.store(index, index, &words, view.source);
        }
    }

    /// G10 L20: the work offset is set so that the place where the tool stands has these numbers. Where that is, and so
    /// what the offset becomes, only the machine knows. None: the block is something else.
    fn set_here(&mut self, n: u8, offset: &Axes, view: &View<'_, '_>) -> Option<String> {
        let words = self.words(view.source)?;
        let here = sets_here(self.sources, view.source);
        if here && self.options.language == Language::FanucMill {
            if !self.stands_known(Some(words)) {
                self.cannot("a work offset set from where the tool stands (G10 L20)", view.source);
                return Some(String::new());
            }
            return None;
        }
        // Where P is no plain number (P#1), it is the offset in force that changes.
        let other = number_of(self.sources, 'p', view.source).is_some_and(|p| p != 0 && p != u32::from(n));
        if !here || other || self.frame.work != n || self.frame.work_offset == *offset && !words.names_axes() {
            return None;
        }
        let known = self.anchored;
        self.move_frame(view.state);
        let mut block = format!("G10 L20 P{n}");
        for i in (0..9).filter(|i| words.has(AXES[*i].to_ascii_lowercase() as u8)) {
            let value = self.named_here(i, known[i], view);
            let (text, said) = self.w.axis_fine(i, value, self.w.places.max(9));
            block += &format!(" {}{text}", AXES[i]);
            self.at[i] = said;
            self.anchored[i] = true;
        }
        Some(block)
    }

    /// What a block (G92, G10 L20) calls the place where an axis stands: where it was written to, which rounding has moved, or where a
    /// probe stopped, what the simulation reckons with.
    fn named_here(&self, axis: usize, known: bool, view: &View<'_, '_>) -> f64 {
        if let Some(back) = self.loose[axis] {
            return view.end.axes[axis] + back;
        }
        // Behind another work offset the place is not known any more; what rounding has moved it by still is.
        let unit = self.w.unit * 10f64.powi(-(self.w.places as i32));
        let rounded = (self.at[axis] - view.end.axes[axis]).abs() <= unit;
        let at = if known || rounded { self.at[axis] } else { view.end.axes[axis] };
        // LinuxCNC takes another place for the present one where the frame was turned under a shift: what it is called is
        // what the source says. A lathe's may be a diameter.
        let near = |v: f64| (v - at).abs() <= 2.0 * unit + SAME_PLACE;
        let calls = sets_here(self.sources, view.source) || Words::at(self.sources, view.source.file, view.source.line).is_some_and(|w| w.g(920));
        let literal = self.literal(AXES[axis], view).filter(|v| !near(*v) && !near(v / 2.0));
        literal.filter(|_| calls && view.state.local_offset != [0.0; 9]).unwrap_or(at)
    }

    /// The plain number behind the letter of an axis in a source line, mm or rad.
    pub fn literal(&self, letter: char, view: &View<'_, '_>) -> Option<f64> {
        let line = self.sources.line(view.source.file, view.source.line)?;
        let code = line.split(['(', ';']).next()?.to_ascii_lowercase();
        let rest = code.split_once(letter.to_ascii_lowercase())?.1.trim_start();
        let digits: String = rest.chars().take_while(|c| c.is_ascii_digit() || matches!(c, '.' | '-' | '+')).collect();
        let inch = view.state.units == gr_ir::Units::Inch;
        let scale = if "ABC".contains(letter) { 1f64.to_radians() } else if inch { 25.4 } else { 1.0 };
        Some(digits.parse::<f64>().ok()? * scale)
    }

    fn rotation(&mut self, angle: f64, view: &View<'_, '_>) {
        let index = usize::from(view.state.work.clamp(1, 9));
        // What the source says is said again: the control may have another in store.
        let set = self.words(view.source).is_some_and(|w| w.g(100) && w.has(b'r')) && !sets_here(self.sources, view.source);
        if angle != self.rotations[index] || set && self.linuxcnc() {
            if self.linuxcnc() {
                let degrees = self.w.number(angle.to_degrees(), 10);
                let here = set && number_of(self.sources, 'p', view.source) == Some(0);
                self.w.block(&format!("G10 L2 P{} R{degrees}", if here { 0 } else { index }));
            } else {
                self.cannot("a rotated work offset", view.source);
            }
        }
        self.rotations[index] = angle;
        self.move_frame(view.state);
    }

    /// G92 and G52: what the axes are called from here on.
    fn local_offset(&mut self, offset: &Axes, view: &View<'_, '_>) {
        let (old, known) = (self.frame.local_offset, self.anchored);
        self.move_frame(view.state);
        let names_z = self.words(view.source).is_some_and(|w| w.g(920) && w.has(b'z'));
        if (names_z || offset[2] != old[2]) && self.w.release().is_some() {
            return self.cannot("a shift of Z behind G43 or G49 without a move of Z", view.source);
        }
        // Where the source says so it is said again: the control may know more than the simulation.
        let asked = [920, 921, 922, 923, 520].into_iter();
        let asked = self.words(view.source).is_some_and(|w| asked.clone().any(|g| w.g(g)));
        let inserted = view.source.line == crate::from_line::INSERTED;
        if *offset == old && !asked && !inserted {
            return;
        }
        let shift = match self.options.language {
            // G52 and G92 are two shifts there, which add up: what G92 has shifted, G92 takes back.
            Language::FanucMill => !self.shifted_by_place,
            // G92 refers to where the machine is, which nobody knows before the first move.
            Language::Linuxcnc => inserted || self.words(view.source).is_some_and(|w| w.g(520)),
            Language::Grbl if inserted && *offset != old => {
                return self.cannot("a shifted work frame (G92) at the start", view.source);
            }
            Language::Grbl => false,
        };
        let text = if inserted { None } else { self.words(view.source) };
        let stored = [(922, "G92.2"), (923, "G92.3")].into_iter().find(|(g, _)| text.is_some_and(|w| w.g(*g)));
        if let Some((_, code)) = stored {
            // What is kept for later, only the control knows.
            if self.linuxcnc() { self.w.block(code) } else { self.cannot(code, view.source) }
            return self.motion_unsure();
        }
        // G92 with words names the place where the tool stands; where that is only the machine may know.
        let named = text.filter(|w| w.g(920) && w.names_axes());
        let shift = shift && named.is_none();
        let fanuc = self.options.language == Language::FanucMill;
        if offset.iter().all(|v| *v == 0.0) && !fanuc && (!shift || inserted) && named.is_none() {
            self.w.block("G92.1");
            return self.motion_unsure();
        }
        let places = self.w.places.max(9);
        let mut words = Vec::new();
        // What the source names is written, also where the simulation has it already.
        let spoken = named.or(text.filter(|w| w.g(520)));
        let said_there = |i: usize| spoken.is_some_and(|w| w.has(AXES[i].to_ascii_lowercase() as u8));
        for i in (0..9).filter(|i| offset[*i] != old[*i] || said_there(*i)) {
            // G52 names the shift, G92 what the present place is called; the place has been rounded before.
            let value = if shift { offset[i] } else { self.named_here(i, known[i], view) };
            let (text, said) = self.w.axis_fine(i, value, places);
            words.push(format!("{}{text}", AXES[i]));
            if !shift {
                self.at[i] = said;
                self.anchored[i] |= self.loose[i].is_some();
            }
        }
        let code = if shift { "G52" } else { "G92" };
        if words.is_empty() {
            return;
        }
        if let Some(axis) = self.lacks(|i| words.iter().any(|w| w.starts_with(AXES[i]))) {
            return self.cannot(&format!("a shift of the {axis} axis"), view.source);
        }
        self.shifted_by_place = !shift && offset.iter().any(|v| *v != 0.0);
        self.w.block(&format!("{code} {}", words.join(" ")));
        self.motion_unsure();
    }

    /// Blocks with axis words of another meaning may end the modal motion on some controls.
    fn motion_unsure(&mut self) {
        self.motion = None;
    }

    fn tool_offset(&mut self, offset: &Axes, number: Option<u32>, view: &View<'_, '_>) {
        let words = self.words(view.source);
        let zero = offset.iter().all(|v| *v == 0.0);
        // A tool that has not been measured has a length of 0 too, so for 0 the source decides.
        // A lathe's T names the offset with its last two digits.
        let station = self.sources.increments().then(|| number_of(self.sources, 't', view.source)).flatten().map(|t| t % 100);
        // H alone changes the length in force where it holds.
        let wanted = words.map_or(number.is_some(), |w| w.g(430) || number.is_some() && !w.g(432) && !w.g(490)) && station.is_none();
        let asked = if wanted { number } else { station };
        let named = match words {
            // The length is the program's own.
            Some(w) if w.g(431) => None,
            // No tool is in the spindle, and none is named.
            Some(_) if zero && asked.is_none() && view.state.tool <= 0 => None,
            _ => self.tool_with(offset, asked, view.state.tool),
        };
        let off = match words {
            Some(_) if station.is_some() => station == Some(0),
            // Offset number 0 is none there.
            Some(_) if wanted && self.sources.offset_numbers() && (asked == Some(0) || zero && named.is_none() && !self.tools.is_empty()) => true,
            Some(w) => w.g(490) || zero && !wanted && !w.g(432),
            None => zero && !wanted && (view.state.tool <= 0 || named != Some(view.state.tool)),
        };
        // Nothing is known of the lengths of a machine without a tool table; the program says which it wants.
        let unmeasured = zero && !off && named.is_none();
        let wanted = wanted || station.is_some();
        let added = number.filter(|_| words.is_some_and(|w| w.g(432)));
        let said = match station {
            Some(n) if unmeasured => Some(format!("G43 H{n}")),
            _ if unmeasured => self.length_asked(asked, view),
            _ => None,
        };
        let block = match (named, self.options.language) {
            (None, language) if unmeasured && wanted && language == Language::Grbl => {
                self.cannot("a tool length that no tool table names here (--tools)", view.source);
                return self.move_frame(view.state);
            }
            (None, Language::Linuxcnc | Language::FanucMill) if wanted && said.is_some() => said.unwrap_or_default(),
            (None, Language::Linuxcnc) if zero && added.is_some() => format!("G43.2 H{}", added.unwrap_or_default()),
            _ if off || zero && named.is_none() && !words.is_some_and(|w| w.g(431)) => "G49".to_string(),
            (Some(n), Language::Linuxcnc | Language::FanucMill) => format!("G43 H{n}"),
            (_, Language::Linuxcnc) => format!("G43.1 {}", self.changed_all(offset)),
            (_, Language::Grbl) if (0..9).all(|i| i == 2 || offset[i] == 0.0) => {
                format!("G43.1 Z{}", self.w.axis_fine(2, offset[2], self.w.places.max(9)).0)
            }
            _ => {
                self.cannot("a tool offset that is no tool's length", view.source);
                return self.move_frame(view.state);
            }
        };
        match self.options.language {
            // Without a Z the axis moves by the length there.
            Language::FanucMill => self.w.hold(&block, view.source),
            _ => self.w.block(&block),
        }
        self.motion_unsure();
        let old = self.frame.tool_offset;
        self.move_frame(view.state);
        // Lengths are measured again at the machine: the height that stood before is another one now, whatever the table says.
        for i in (0..9).filter(|i| *i == 2 || offset[*i] != old[*i]) {
            self.anchored[i] = false;
        }
    }

    fn changed_all(&self, offset: &Axes) -> String {
        let words = self.changed(offset, &self.frame.tool_offset);
        // What is not named stays; a block needs a word.
        if words.is_empty() { format!("Z{}", self.w.axis_fine(2, offset[2], self.w.places.max(9)).0) } else { words.join(" ") }
    }

    /// The block that asks for the length of a tool of which the source knows no length.
    fn length_asked(&self, asked: Option<u32>, view: &View<'_, '_>) -> Option<String> {
        let tool = u32::try_from(view.state.tool).ok().filter(|t| *t > 0);
        // Without H it is the length of the tool in the spindle.
        match asked.or(tool.filter(|_| self.options.language == Language::FanucMill)) {
            Some(number) => Some(format!("G43 H{number}")),
            None => (self.options.language == Language::Linuxcnc).then(|| "G43".to_string()),
        }
    }

    /// The tool whose offset this is: the one that the source names first, then the one in the spindle.
    fn tool_with(&self, offset: &Axes, asked: Option<u32>, in_spindle: i32) -> Option<i32> {
        let asked = asked.and_then(|n| i32::try_from(n).ok());
        let same = |(n, o): &&(i32, Axes)| *n > 0 && (0..9).all(|i| (o[i] - offset[i]).abs() < 1e-9);
        let all = || self.tools.iter().filter(same);
        all().find(|(n, _)| Some(*n) == asked).or_else(|| all().find(|(n, _)| *n == in_spindle)).or_else(|| all().next()).map(|(n, _)| *n)
    }

    fn tool_change(&mut self, view: &View<'_, '_>) {
        if self.options.language == Language::Grbl {
            let what = format!("change to tool {}", view.state.tool);
            self.as_comment(&what, view.source);
            return self.w.block("M0");
        }
        let Some(place) = self.options.change_at else {
            self.w.block("M6");
            self.turn_on(view);
            return self.motion_unsure();
        };
        let (high, low) = (self.w.length(ABOVE_CHANGE, self.w.places).0, view.state.work.clamp(1, 9));
        match place {
            ChangeAt::G53 => self.w.block("G53 G0 Z0"),
            ChangeAt::G30 => self.w.block("G30"),
            ChangeAt::G55 => [format!("G55 G0 Z{high}"), "G0 X0 Y0".into(), "G0 Z0".into()].iter().for_each(|b| self.w.block(b)),
        }
        self.w.block("M6");
        if place == ChangeAt::G55 {
            self.w.block(&format!("G0 Z{high}"));
            self.w.block(OFFSETS[usize::from(low)]);
        }
        self.motion_unsure();
        self.anchored = [false; 9];
        self.displaced = true;
    }

    /// M6 stops the spindle. In a program whose turret turns while the spindle does, it is started again.
    fn turn_on(&mut self, view: &View<'_, '_>) {
        for (number, spindle) in (0..).zip(&view.state.spindles) {
            if spindle.turn != Turn::Stop {
                self.spindle_turn(number, spindle.turn, view.source);
            }
        }
    }

    fn tool_entry(&mut self, view: &View<'_, '_>) {
        let Op::ToolEntry { tool, offset, diameter, front, back, orientation, .. } = view.op else {
            return;
        };
        if self.options.language == Language::Grbl {
            return self.cannot("writing the tool table (G10 L1)", view.source);
        }
        let places = self.w.places.max(9);
        let old = self.tools.iter().find(|(n, _)| *n == tool).map_or([0.0; 9], |t| t.1);
        let text = self.words(view.source).filter(|w| w.g(100));
        // R of a Fanuc mill's L10 is the length.
        let length = self.sources.offset_numbers() && number_of(self.sources, 'l', view.source) == Some(10);
        let said = |letter: char| text.is_none_or(|w| if length { letter == 'Z' } else { w.has(letter.to_ascii_lowercase() as u8) });
        // What the block does not name stays as the control has it.
        let axes = (0..9).filter(|i| if text.is_some() { said(AXES[*i]) } else { offset[*i] != old[*i] });
        let mut words: Vec<String> = axes.map(|i| format!("{}{}", AXES[i], self.w.axis_fine(i, offset[i], places).0)).collect();
        if said('r') {
            words.push(format!("R{}", self.w.length(0.5 * diameter, places).0));
        }
        for (letter, angle) in [('I', front), ('J', back)] {
            if said(letter) && (text.is_some() || angle != 0.0) {
                words.push(format!("{letter}{}", self.w.number(angle.to_degrees(), 9)));
            }
        }
        if said('q') && (text.is_some() || orientation != 0) {
            words.push(format!("Q{orientation}"));
        }
        if words.is_empty() {
            return;
        }
        let touched = !self.sources.offset_numbers() && matches!(number_of(self.sources, 'l', view.source), Some(10 | 11));
        if touched && (0..9).any(|i| self.loose[i].is_some() && said(AXES[i])) {
            // The length is the simulation's.
            self.say(code::EMIT_RUNTIME_VALUE, view.source, &["where the probe stopped".into()]);
        }
        if self.linuxcnc() {
            self.w.block(&format!("G10 L1 P{tool} {}", words.join(" ")));
        } else if words.iter().all(|w| w.starts_with(['Z', 'R'])) {
            // A length there is R of L10, a radius R of L12.
            for word in &words {
                let kind = if word.starts_with('Z') { "L10" } else { "L12" };
                self.w.block(&format!("G10 {kind} P{tool} R{}", &word[1..]));
            }
        } else {
            return self.cannot("a tool's offset other than its length and its radius", view.source);
        }
        self.tools.retain(|(n, _)| *n != tool);
        self.tools.push((tool, offset));
    }

    fn spindle_word(&mut self, spindle: i32, source: Source) -> Option<String> {
        if spindle <= 0 {
            return Some(String::new());
        }
        if self.linuxcnc() {
            return Some(format!(" ${spindle}"));
        }
        self.cannot("a second spindle", source);
        None
    }

    fn spindle_mode(&mut self, spindle: i32, surface: Option<f64>, view: &View<'_, '_>) {
        if self.options.language != Language::Linuxcnc && surface.is_some() {
            return self.cannot("constant surface speed", view.source);
        }
        let Some(which) = self.spindle_word(spindle, view.source) else {
            return;
        };
        // G96 and G97 want their S in the same block; the feed of that block comes between the two.
        let block = (view.index + 1..).map_while(|i| self.program.get(i)).take_while(|s| s.source == view.source);
        let mut between = block.skip_while(|s| matches!(s.op, Op::FeedMode { .. } | Op::Feed { .. } | Op::Note(..)));
        let next = between.next().and_then(|s| match s.op {
            Op::SpindleSpeed { spindle: n, speed } if n == spindle => Some((s.index, speed)),
            _ => None,
        });
        // Another limit (G50 S of a Fanuc lathe) leaves the speed in force, which LinuxCNC's G96 wants to hear again.
        let in_force = Some(view.state.spindle(spindle)).filter(|s| surface.is_some() && s.surface.is_some()).map(|s| s.speed);
        let speed = next.map(|(_, speed)| speed).or(in_force);
        let speed = speed.map(|speed| format!(" S{}", self.speed_text(speed, surface.is_some()))).unwrap_or_default();
        match surface {
            Some(limit) => {
                // A limit beyond any spindle stands for none.
                let limit = if limit < 1e9 { format!(" D{}", self.w.number(limit, 6)) } else { String::new() };
                self.w.block(&format!("G96{limit}{speed}{which}"));
            }
            None if self.linuxcnc() => self.w.block(&format!("G97{speed}{which}")),
            None => self.w.block(speed.trim()),
        }
        self.speed_said = next.map(|(index, _)| index);
    }

    /// rpm, or m/min or feet/min of surface speed as the length unit says.
    fn speed_text(&self, speed: f64, surface: bool) -> String {
        let per_minute = if self.w.unit == 1.0 { 1000.0 } else { 304.8 };
        let value = if surface { speed * 60.0 / per_minute } else { speed };
        self.w.number(value, 6)
    }

    fn spindle_speed(&mut self, spindle: i32, speed: f64, view: &View<'_, '_>) {
        if self.speed_said == Some(view.index) {
            return;
        }
        let surface = view.state.spindle(spindle).surface.is_some();
        let Some(which) = self.spindle_word(spindle, view.source) else {
            return;
        };
        let text = self.speed_text(speed, surface);
        let text = if self.linuxcnc() { text } else { text.trim_end_matches('.').to_string() };
        if self.options.language == Language::Grbl && self.goes_on(view) {
            return self.w.speed = Some(text);
        }
        self.w.block(&format!("S{text}{which}"));
    }

    /// Whether the spindle turns and the line of a speed moves as well: a laser goes on with its beam at another power, where a block
    /// without motion stops it and burns.
    fn goes_on(&self, view: &View<'_, '_>) -> bool {
        let block = (view.index + 1..).map_while(|i| self.program.get(i)).take_while(|s| s.source == view.source);
        let mut next = block.skip_while(|s| matches!(s.op, Op::FeedMode { .. } | Op::Feed { .. } | Op::Note(..)));
        view.state.spindle(0).turn != Turn::Stop && next.next().is_some_and(|s| s.op.moves() && s.start.axes != s.end.axes)
    }

    fn spindle_turn(&mut self, spindle: i32, turn: Turn, source: Source) {
        let Some(which) = self.spindle_word(spindle, source) else {
            return;
        };
        let code = match turn {
            Turn::Cw => "M3",
            Turn::Ccw => "M4",
            Turn::Stop => "M5",
        };
        self.w.block(&format!("{code}{which}"));
    }

    fn orient(&mut self, spindle: i32, angle: f64, direction: i32, view: &View<'_, '_>) {
        if !self.linuxcnc() {
            return self.cannot("spindle orientation to an angle", view.source);
        }
        let Some(which) = self.spindle_word(spindle, view.source) else {
            return;
        };
        let mut block = format!("M19 R{}", self.w.number(angle.to_degrees(), 9));
        if direction != 0 {
            block += &format!(" P{direction}");
        }
        if let Some(Op::SpindleWait { timeout, .. }) = self.op_after(view.index) {
            block += &format!(" Q{}", self.w.number(timeout, 6));
            self.done_until = view.index + 2;
        }
        self.w.block(&(block + &which));
    }

    fn coolant(&mut self, on: bool, code: &str, view: &View<'_, '_>) {
        if on {
            return self.w.block(code);
        }
        // M9 ends both; the pair that it makes is written once.
        let pair = match (view.op, self.op_after(view.index)) {
            (Op::Mist(_), Some(Op::Flood(false))) | (Op::Flood(_), Some(Op::Mist(false))) => true,
            _ => false,
        };
        self.w.block("M9");
        if pair {
            self.done_until = view.index + 2;
        } else if view.state.mist {
            self.w.block("M7");
        } else if view.state.flood {
            self.w.block("M8");
        }
    }

    fn path_mode(&mut self, mode: PathMode, view: &View<'_, '_>) {
        let source = view.source;
        let asked = self.words(source).is_none_or(|w| [610, 611, 640].into_iter().any(|g| w.g(g)));
        if !asked && !self.linuxcnc() {
            // LinuxCNC's cycles switch to exact path by themselves; elsewhere that is the cycle's own affair.
            return;
        }
        if !asked && !self.said_path {
            return self.exact_for_a_while(mode, view);
        }
        self.said_path = true;
        match (mode, self.options.language) {
            (PathMode::ExactStop, Language::Linuxcnc) => self.w.block("G61.1"),
            (PathMode::ExactPath, Language::Linuxcnc | Language::Grbl) => self.w.block("G61"),
            (PathMode::ExactStop, Language::FanucMill) => self.w.block("G61"),
            (PathMode::Blend(t), Language::Linuxcnc) => self.blend(t, view),
            (PathMode::Blend(t), Language::FanucMill) => {
                self.w.block("G64");
                if t > 0.0 {
                    self.as_comment("the path tolerance G64 P", source);
                }
            }
            (PathMode::ExactStop, Language::Grbl) => self.as_comment("exact stop G61.1", source),
            (PathMode::ExactPath, Language::FanucMill) => self.as_comment("exact path G61", source),
            (PathMode::Blend(_), Language::Grbl) => self.as_comment("path blending G64", source),
        }
    }

    /// A cycle in a program that leaves the way to follow the path to the machine: what that is, only M70 and M72 can bring
    /// back, with the feed of before.
    fn exact_for_a_while(&mut self, mode: PathMode, view: &View<'_, '_>) {
        if let PathMode::Blend(_) = mode {
            if let Some(Op::MergeTolerance(_)) = self.op_after(view.index) {
                self.done_until = view.index + 2;
            }
            let exact_again = self.exact_again(view.index);
            if let Some(mode) = self.kept_path.take_if(|_| !exact_again) {
                self.w.block("M72");
                // What M70 kept is in force again.
                self.feed_mode = mode;
                self.feed.clear();
                self.motion_unsure();
            }
            return;
        }
        if self.kept_path.is_none() {
            self.kept_path = Some(self.feed_mode);
            self.w.block("M70");
            self.w.block(if mode == PathMode::ExactStop { "G61.1" } else { "G61" });
        }
    }

    /// Whether another cycle follows before anything moves.
    fn exact_again(&self, index: usize) -> bool {
        const NEAR: usize = 16;
        // What else is set between two cycles, M72 behind the second would undo.
        let part = |op: &Op<'_>| match op {
            Op::Begin { marker, .. } | Op::Close(marker) => *marker == gr_ir::Marker::Cycle,
            Op::Feed { .. } | Op::FeedMode { .. } | Op::MergeTolerance(_) | Op::Note(gr_ir::Note::Comment, _) => true,
            _ => false,
        };
        let next = (1..NEAR).map_while(|n| self.program.get(index + n)).find(|s| !part(&s.op));
        next.is_some_and(|s| s.op == Op::PathMode(PathMode::ExactPath) && crate::Words::at(self.sources, s.source.file, s.source.line).is_some_and(|w| !w.g(610)))
    }

    fn blend(&mut self, tolerance: f64, view: &View<'_, '_>) {
        let places = self.w.places.max(9);
        let mut block = "G64".to_string();
        if tolerance > 0.0 {
            block += &format!(" P{}", self.w.length(tolerance, places).0);
        }
        if let Some(Op::MergeTolerance(q)) = self.op_after(view.index) {
            if q != tolerance && tolerance > 0.0 {
                block += &format!(" Q{}", self.w.length(q, places).0);
            }
            self.done_until = view.index + 2;
        }
        self.w.block(&block);
    }

    /// A merge tolerance on its own: only G64 can say it.
    fn merge_tolerance(&mut self, tolerance: f64, view: &View<'_, '_>) {
        if let PathMode::Blend(p) = view.state.path
            && p > 0.0
        {
            let places = self.w.places.max(9);
            let (p, q) = (self.w.length(p, places).0, self.w.length(tolerance, places).0);
            self.w.block(&format!("G64 P{p} Q{q}"));
        }
    }

    fn override_switch(&mut self, which: Override, on: bool, source: Source) {
        let state = i32::from(on);
        let (block, name) = match which {
            Override::Feed => (format!("M50 P{state}"), "the feed override switch"),
            Override::Speed(n) if n > 0 => (format!("M51 P{state} ${n}"), "the speed override switch"),
            Override::Speed(_) => (format!("M51 P{state}"), "the speed override switch"),
            Override::Adaptive => (format!("M52 P{state}"), "adaptive feed"),
            Override::FeedHold => (format!("M53 P{state}"), "the feed hold switch"),
        };
        if self.linuxcnc() { self.w.block(&block) } else { self.as_comment(name, source) }
    }
}
