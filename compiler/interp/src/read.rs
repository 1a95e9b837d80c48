//! Reading a block: words from left to right, each evaluated when it is read; settings wait for the end.

use gr_canon::{Sink, Version};
use gr_gcode::{Form, Scan, Target, Word};
use gr_spec::{code, rs274};

use crate::block::slot;
use crate::check::code_name;
use crate::fanuc::is_lathe;
use crate::eval::{not_whole, to_int, whole};
use crate::io::Comment;
use crate::{Fault, Interp, Res};

/// What a setting sets.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Slot {
    Number(u32),
    /// Index into the names of the chunk.
    Named(u32),
}

/// Modal group of each G-code times ten; −1 = not a code.
static G_GROUPS: [i8; 1000] = g_groups();

const fn g_groups() -> [i8; 1000] {
    let mut t = [-1; 1000];
    let table: &[(i8, &[usize])] = &[
        (0, &[40, 53, 100, 280, 281, 300, 301, 520, 530, 920]),
        (1, &[0, 10, 20, 30, 50, 51, 52, 60, 61, 62, 63, 330, 331, 382, 383, 384, 385, 700, 710, 711, 712, 720, 721, 722, 730, 740]),
        (1, &[760, 800, 810, 820, 830, 840, 850, 860, 870, 880, 890]),
        (2, &[170, 171, 180, 181, 190, 191]),
        (3, &[900, 910]),
        (4, &[901, 911]),
        (5, &[930, 940, 950]),
        (6, &[200, 210]),
        (7, &[400, 410, 411, 420, 421]),
        (8, &[430, 431, 432, 490]),
        (10, &[980, 990]),
        (12, &[540, 550, 560, 570, 580, 590, 591, 592, 593]),
        (13, &[610, 611, 640]),
        (14, &[960, 970]),
        (15, &[70, 80]),
        (16, &[921, 922, 923]),
    ];
    let mut i = 0;
    while i < table.len() {
        let (group, codes) = table[i];
        let mut k = 0;
        while k < codes.len() {
            t[codes[k]] = group;
            k += 1;
        }
        i += 1;
    }
    t
}

/// Modal group of an M-code below 200; −1 = not a code.
pub(crate) fn m_group(code: i32) -> i32 {
    match code {
        0..=2 | 30 | 60 | 99 => 4,
        3..=5 | 19 | 70..=73 => 7,
        6 | 61 => 6,
        7..=9 => 8,
        48..=53 => 9,
        62..=68 => 5,
        100..=199 => 10,
        _ => -1,
    }
}

/// Modal group of a G-code times ten; −1 = not a code.
pub(crate) fn g_group(code: i32) -> i32 {
    if (0..1000).contains(&code) { i32::from(G_GROUPS[code as usize]) } else { -1 }
}

fn upper(letter: u8) -> char {
    char::from(letter.to_ascii_uppercase())
}

impl<S: Sink> Interp<'_, S> {
    /// Reads all words of a line that is not plain.
    pub(crate) fn read_words(&mut self, scan: &Scan, text: &str, line: u32, words: &[Word]) -> Res {
        if !scan.lines[line as usize].faulty {
            for w in words {
                self.read_word(scan, text, w)?;
            }
            return Ok(());
        }
        // Up to the damage the words count as usual: whatever is wrong there is found first.
        let first = scan.faults_of(line).first();
        let bad = first.map_or(u32::MAX, |f| f.span.start);
        // A NUL byte ends the line for the controller, and it says nothing.
        let cut = first.is_some_and(|f| f.code == gr_spec::code::TEXT_NUL_BYTE);
        for w in words {
            let end = scan.word_span(text, line, w).end;
            let beyond = w.start >= bad || end > bad;
            if cut && beyond {
                self.say_cut(scan);
                return Ok(());
            }
            if w.form == Form::Bad && w.start <= bad && !self.is_letter(w.letter) {
                return self.read_word(scan, text, w);
            }
            if w.form == Form::Bad || beyond {
                return Err(self.parse_fault(scan));
            }
            self.read_word(scan, text, w)?;
        }
        if cut {
            self.say_cut(scan);
            return Ok(());
        }
        Err(self.parse_fault(scan))
    }

    /// The controller reads on in silence; we say that the rest of the line is lost.
    fn say_cut(&mut self, scan: &Scan) {
        let mut fault = self.parse_fault(scan);
        fault.rs = None;
        self.warn(fault);
    }

    /// Reads one word into the block.
    #[inline]
    pub(crate) fn read_word(&mut self, scan: &Scan, text: &str, w: &Word) -> Res {
        let value = match w.form {
            Form::Literal => w.value,
            Form::Comment => {
                if w.letter == b'(' {
                    self.comment = Some(Comment::of(scan, text, self.reading.line, w));
                }
                return Ok(());
            }
            Form::Expr | Form::Bad if !self.is_letter(w.letter) => return self.take_word(w.letter, 0.0),
            _ => match self.read_structured(scan, w)? {
                Some(value) => value,
                None => return Ok(()),
            },
        };
        self.take_word(w.letter, value)
    }

    /// Whether words of this letter exist here; the controller looks at the letter before the value.
    fn is_letter(&self, letter: u8) -> bool {
        !matches!(letter, b'u' | b'v' | b'w') || self.has_uvw()
    }

    fn has_uvw(&self) -> bool {
        self.setup.uvw || self.in_contour || is_lathe(self.setup.dialect)
    }

    fn read_structured(&mut self, scan: &Scan, w: &Word) -> Res<Option<f64>> {
        match w.form {
            Form::Expr => {
                let value = self.eval_or_vacant(scan, gr_gcode::ExprId(w.index() as u32))?;
                Ok(Some(value).filter(|v| !crate::vacant::is_vacant(*v)))
            }
            Form::Setting => {
                self.read_setting(scan, w.index())?;
                Ok(None)
            }
            Form::Control => Err(Fault::new(code::SYNTAX_BAD_CHARACTER, rs274::BAD_CHARACTER).arg("o").arg("o").at(b'o')),
            _ => Err(self.parse_fault(scan)),
        }
    }

    fn read_setting(&mut self, scan: &Scan, index: usize) -> Res {
        let Some(setting) = scan.settings.get(index) else { return Err(self.parse_fault(scan)) };
        let slot = match setting.target {
            Target::Number(id) => Slot::Number(self.target_index(scan, id)? as u32),
            Target::Named(name) => {
                // The name exists from here on, with the value 0 until the block is done.
                let text = scan.names.get(name as usize).map_or("", |n| n);
                if self.find_named(text).is_none() {
                    let level = self.level();
                    self.params.set_named(level, text, 0.0);
                }
                Slot::Named(name)
            }
        };
        let value = self.eval_or_vacant(scan, setting.value)?;
        self.settings.push((slot, value));
        Ok(())
    }

    /// Carries out the settings of the block.
    pub(crate) fn store_settings(&mut self) -> Res {
        let settings = std::mem::take(&mut self.settings);
        for (slot, value) in &settings {
            if let Slot::Number(index) = slot {
                match self.is_fanuc() {
                    true => self.write_variable(*index, *value),
                    false => self.write_param(*index, *value),
                }
            }
        }
        let scan = self.reading.scan.clone();
        let level = self.level();
        for (slot, value) in &settings {
            if let Slot::Named(name) = slot {
                let name = scan.names.get(*name as usize).map_or("", |n| n);
                if self.is_read_only(name) {
                    let fault = Fault::new(code::PARAMETER_READ_ONLY, rs274::RT_NAME_READONLY).arg(name);
                    return Err(fault.named(format!("#<{name}>")).at(b'#'));
                }
                if let Some(log) = &mut self.log {
                    log.named = true;
                }
                self.params.set_named(level, name, *value);
            }
        }
        self.settings = settings;
        self.settings.clear();
        Ok(())
    }

    /// Puts a letter and its value into the block.
    #[inline]
    pub(crate) fn take_word(&mut self, letter: u8, value: f64) -> Res {
        match letter {
            b'g' => self.take_g(value),
            b'x' => {
                let value = if self.m.lathe_diameter != 0 { value / 2.0 } else { value };
                self.put(letter, value)
            }
            b'y' | b'z' => self.put(letter, value),
            b'm' => self.take_m(value),
            b'n' => Ok(()),
            _ => self.take_other(letter, value),
        }
    }

    #[inline]
    fn put(&mut self, letter: u8, value: f64) -> Res {
        let bit = 1 << slot(letter);
        if self.block.present & bit != 0 {
            return Err(repeated(letter));
        }
        self.block.present |= bit;
        self.block.values[slot(letter)] = value;
        Ok(())
    }

    fn take_other(&mut self, letter: u8, value: f64) -> Res {
        self.check_listed_letter(letter)?;
        let negative = |rs| Err(Fault::new(code::WORD_NEGATIVE, rs).arg(upper(letter)).at(letter));
        match letter {
            b'f' | b's' => {
                self.put(letter, value)?;
                if value < 0.0 {
                    self.block.unset(letter);
                    return negative(if letter == b'f' { rs274::RT_NEGATIVE_F } else { rs274::RT_NEGATIVE_S });
                }
            }
            b'h' if is_lathe(self.setup.dialect) => self.put(letter, value)?,
            b't' | b'h' | b'l' => {
                if self.block.has(letter) {
                    return Err(repeated(letter));
                }
                let n = whole(value).ok_or_else(|| not_whole(value).at(letter))?;
                match letter {
                    // Beyond what a number of a tool can be, the controller's own number runs over.
                    b't' | b'h' if n < 0 && value > 0.0 => {
                        let rs = if letter == b't' { rs274::RT_NEGATIVE_T } else { rs274::RT_NEGATIVE_H };
                        return Err(Fault::new(code::TOOL_NOT_FOUND, rs).arg(value).at(letter));
                    }
                    b'l' if n < 0 && value > 0.0 => {
                        return Err(Fault::new(code::WORD_BAD_VALUE, rs274::RT_NEGATIVE_L).arg("L").arg(value).at(letter));
                    }
                    b't' if n < 0 => return negative(rs274::RT_NEGATIVE_T),
                    b'h' if n < -1 => return negative(rs274::RT_NEGATIVE_H),
                    b'l' if n < 0 => return negative(rs274::RT_NEGATIVE_L),
                    _ => {}
                }
                self.block.set(letter, f64::from(n));
            }
            // The controller notices a second P or Q only when the first was above −1.
            b'p' | b'q' => {
                if self.block.or_minus_one(letter) > -1.0 {
                    return Err(repeated(letter));
                }
                self.block.set(letter, value);
            }
            b'@' | b'^' => self.block.set(letter, value),
            b'$' => {
                if self.block.has(letter) {
                    return Err(Fault::new(code::WORD_REPEATED, rs274::RT_MULTIPLE_SPINDLE).arg("$").arg("$").at(letter));
                }
                self.block.set(letter, f64::from(to_int(value)));
            }
            b'a' | b'b' | b'c' | b'd' | b'e' | b'i' | b'j' | b'k' | b'r' => self.put(letter, value)?,
            b'u' | b'v' | b'w' if self.has_uvw() => self.put(letter, value)?,
            _ => {
                let shown = upper(letter).to_string();
                return Err(Fault::new(code::SYNTAX_BAD_CHARACTER, rs274::BAD_CHARACTER)
                    .arg(char::from(letter))
                    .arg(shown)
                    .at(letter));
            }
        }
        Ok(())
    }

    #[inline]
    fn take_g(&mut self, value: f64) -> Res {
        let ten = 10.0 * value;
        let mut n = to_int(libm::floor(ten));
        let rest = ten - f64::from(n);
        if rest > 0.999 {
            n = to_int(libm::ceil(ten));
        } else if rest > 0.001 {
            return Err(self.unknown_g(rs274::RT_G_OUT_OF_RANGE, value));
        }
        if n > 999 {
            return Err(self.unknown_g(rs274::RT_G_OUT_OF_RANGE, value));
        }
        if n < 0 && value > 0.0 {
            return Err(self.unknown_g(rs274::RT_NEGATIVE_G, value));
        }
        if n < 0 {
            return Err(Fault::new(code::WORD_NEGATIVE, rs274::RT_NEGATIVE_G).arg("G").at(b'g'));
        }
        if self.closed.is_some() {
            self.check_listed_g(n)?;
        }
        if is_lathe(self.setup.dialect) {
            // G-code system A: turning and facing cycles, threading, feed per minute and per revolution.
            n = match n {
                900 | 940 => return self.take_turning_cycle(n as i16),
                320 => 330,
                980 => 940,
                990 => 950,
                _ => n,
            };
        }
        if self.is_fanuc() && self.take_fanuc_g(n) {
            return Ok(());
        }
        let remapped = self.config.g_remap(n).map(|r| r.group);
        let group = match remapped {
            Some(group) => group as usize,
            None => match G_GROUPS[n as usize] {
                -1 => return Err(self.unknown_g(rs274::RT_UNKNOWN_G, value)),
                _ if (60..=63).contains(&n) && self.setup.version != Version::V2_10 => {
                    return Err(self.unknown_g(rs274::RT_UNKNOWN_G, value));
                }
                _ if self.is_fanuc() && self.means_otherwise(n) => return Err(self.unknown_g(rs274::RT_UNKNOWN_G, value)),
                group => group as usize,
            },
        };
        let old = self.block.g[group];
        if n == 800 && old != -1 && remapped.is_none() {
            return Ok(());
        }
        if old != -1 && (old != 800 || remapped.is_some()) {
            return Err(self.same_group('G', code_name(old), code_name(n as i16)));
        }
        self.block.set_g(group, n as i16);
        Ok(())
    }

    fn take_m(&mut self, value: f64) -> Res {
        let n = whole(value).ok_or_else(|| not_whole(value).at(b'm'))?;
        if n < 0 && value > 0.0 {
            return Err(Fault::new(code::CODE_UNKNOWN, rs274::RT_NEGATIVE_M).arg(format!("M{value}")).at(b'm'));
        }
        if n < 0 {
            return Err(Fault::new(code::WORD_NEGATIVE, rs274::RT_NEGATIVE_M).arg("M").at(b'm'));
        }
        if self.closed.is_some() {
            self.check_listed_m(n)?;
        }
        let remapped = self.config.m_remap(n).map(|r| r.group);
        let group = match remapped {
            Some(group) => group,
            None if n > 199 => {
                return Err(Fault::new(code::CODE_UNKNOWN, rs274::RT_M_TOO_LARGE).arg(n).at(b'm').named(format!("M{n}")));
            }
            None => m_group(n),
        };
        if group < 0 && self.is_fanuc() && self.setup.dialect.code(&format!("M{n}")).is_some() {
            return Err(self.not_carried_out(rs274::RT_UNKNOWN_M, format!("M{n}")).at(b'm'));
        }
        if group < 0 {
            return Err(Fault::new(code::CODE_UNKNOWN, rs274::RT_UNKNOWN_M).arg(n).at(b'm').named(format!("M{n}")));
        }
        let old = self.block.m[group as usize];
        if old != -1 {
            return Err(self.same_group('M', format!("M{old}"), format!("M{n}")));
        }
        let b = &mut self.block;
        b.m[group as usize] = n as i16;
        b.m_count += 1;
        if (100..200).contains(&n) && remapped.is_none() {
            b.user_m = n as i16;
        }
        Ok(())
    }

    /// Codes that a Fanuc control knows with another meaning than ours: better refused than done wrongly.
    fn means_otherwise(&self, n: i32) -> bool {
        if is_lathe(self.setup.dialect) {
            matches!(n, 100 | 700 | 710 | 720 | 730 | 740 | 750 | 760 | 830..=890 | 920)
        } else {
            matches!(n, 760 | 870)
        }
    }

    /// Two codes that exclude each other, in the order in which they stand.
    pub(crate) fn same_group(&self, letter: char, first: String, second: String) -> Box<Fault> {
        let rs = if letter == 'M' { rs274::RT_TWO_M } else { rs274::RT_TWO_G };
        let fault = Fault::new(code::CODE_SAME_GROUP, rs).arg(letter).at(letter.to_ascii_lowercase() as u8);
        fault.own_args(&[&letter.to_string(), &first, &second])
    }

    pub(crate) fn not_carried_out(&self, rs: gr_spec::Rs274, name: String) -> Box<Fault> {
        let code = name.split(' ').next().unwrap_or_default();
        let what = self.setup.dialect.code(code).map_or("", |c| c.title);
        Fault::new(code::CODE_NOT_CARRIED_OUT, rs).arg(&name).arg(what)
    }

    #[cold]
    fn unknown_g(&self, rs: gr_spec::Rs274, value: f64) -> Box<Fault> {
        let name = format!("G{value}");
        if self.is_fanuc() && self.setup.dialect.code(&name).is_some() {
            return self.not_carried_out(rs, name).at(b'g');
        }
        Fault::new(code::CODE_UNKNOWN, rs).arg(name).at(b'g')
    }
}

fn repeated(letter: u8) -> Box<Fault> {
    // In the controller's own words the axis words U V W are upper case.
    let shown = match letter {
        b'u' | b'v' | b'w' => upper(letter),
        _ => char::from(letter),
    };
    Fault::new(code::WORD_REPEATED, rs274::MULTIPLE_WORDS).arg(shown).arg(upper(letter)).at(letter)
}
