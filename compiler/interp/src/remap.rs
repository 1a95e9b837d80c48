//! Configuration from the INI file, remapped codes, saved modes (M70 … M73).

use std::path::{Path, PathBuf};

use gr_canon::{Sink, Units};
use gr_spec::{code, rs274};
use rustc_hash::FxHashMap;

use crate::block::{Block, Group};
use crate::params::coord_system;
use crate::state::SavedModes;
use crate::{Fault, Ini, Interp, Res, Setup};

/// Steps of the execution of a block, in their order.
pub(crate) mod step {
    pub const COMMENT: u32 = 1;
    pub const SPINDLE_MODE: u32 = 2;
    pub const FEED_MODE: u32 = 3;
    pub const FEED: u32 = 4;
    pub const SPEED: u32 = 5;
    pub const PREPARE: u32 = 6;
    pub const M5: u32 = 7;
    pub const M6: u32 = 8;
    pub const RETAIN_G43: u32 = 9;
    pub const M7: u32 = 10;
    pub const M8: u32 = 11;
    pub const M9: u32 = 12;
    pub const M10: u32 = 13;
    pub const DWELL: u32 = 14;
    pub const PLANE: u32 = 15;
    pub const UNITS: u32 = 16;
    pub const DIAMETER: u32 = 17;
    pub const COMP: u32 = 18;
    pub const TOOL_LENGTH: u32 = 19;
    pub const COORD_SYSTEM: u32 = 20;
    pub const PATH: u32 = 21;
    pub const DISTANCE: u32 = 22;
    pub const IJK_DISTANCE: u32 = 23;
    pub const RETRACT: u32 = 24;
    pub const NON_MODAL: u32 = 25;
    pub const G92: u32 = 26;
    pub const MOTION: u32 = 27;
    pub const STOP: u32 = 28;
}

/// A code that an INI file gives a subroutine of its own.
#[derive(Clone, Debug, Default)]
pub(crate) struct Remap {
    pub name: String,
    code: Taken,
    pub group: i32,
    pub words: String,
    /// Empty: Python alone.
    pub sub: String,
    /// Its Python parts, `prolog=…` and the like.
    pub python: Vec<String>,
}

/// The code that a remap takes over.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Taken {
    /// Times ten.
    G(i32),
    M(i32),
    /// T, S or F.
    Word(char),
    /// Something that can't be.
    #[default]
    None,
}

impl Remap {
    /// `M400 modalgroup=10 argspec=Pq ngc=foo`, and what the controller only shakes its head at. `Err`: why it refuses to
    /// start.
    fn of(line: &str) -> Result<(Remap, Vec<String>), String> {
        let line = line.split('#').next().unwrap_or("");
        let mut parts = line.split_whitespace();
        let name = parts.next().ok_or("it names no code")?;
        let mut r = Remap { name: name.to_string(), group: -1, ..Remap::default() };
        let mut doubts = Vec::new();
        for part in parts {
            let (key, value) = part.split_once('=').filter(|(_, v)| !v.is_empty()).ok_or_else(|| format!("`{part}` has no value"))?;
            r.option(key, value, &mut doubts)?;
        }
        if r.sub.is_empty() && !r.has("python") {
            return Err(format!("{name} gets no subroutine: add ngc=name"));
        }
        r.take(&mut doubts)?;
        Ok((r, doubts))
    }

    fn has(&self, key: &str) -> bool {
        self.part(key).is_some()
    }

    /// One `key=value`; keys may be shortened.
    fn option(&mut self, key: &str, value: &str, doubts: &mut Vec<String>) -> Result<(), String> {
        const KEYS: [&str; 6] = ["modalgroup", "argspec", "prolog", "epilog", "ngc", "python"];
        let short = key.to_ascii_lowercase();
        match KEYS.into_iter().find(|k| k.starts_with(&short)) {
            Some("modalgroup") => self.group = leading_integer(value),
            Some("argspec") => {
                let known = |c: &char| c.is_ascii_alphabetic() && !matches!(c, 'o' | 'O') || matches!(c, '>' | '^' | '@');
                if let Some(other) = value.chars().find(|c| !known(c)) {
                    return Err(format!("argspec has the letter `{other}`, which is no word"));
                }
                self.words = value.to_string();
            }
            Some("ngc") if self.has("python") => return Err("a code gets a subroutine or Python, not both".into()),
            Some("python") if !self.sub.is_empty() => return Err("a code gets a subroutine or Python, not both".into()),
            Some("ngc") => self.sub = value.to_string(),
            Some(key) => self.python.push(format!("{key}={value}")),
            None => doubts.push(format!("there is no option `{key}`")),
        }
        Ok(())
    }

    /// Finds out which code is meant, and whether the group fits.
    fn take(&mut self, doubts: &mut Vec<String>) -> Result<(), String> {
        let name = self.name.clone();
        let letter = name.chars().next().unwrap_or(' ').to_ascii_lowercase();
        let number = &name[letter.len_utf8().min(name.len())..];
        let given = self.group;
        if given == -1 && matches!(letter, 'm' | 'g') {
            self.group = if letter == 'm' { 10 } else { 1 };
            doubts.push(format!("{name} has no modalgroup; {} is taken", self.group));
        }
        self.code = match letter {
            't' | 's' | 'f' if !number.is_empty() => return Err(format!("{name}: only the letter alone can be remapped")),
            't' | 's' | 'f' if given != -1 => return Err(format!("{name} takes no modalgroup")),
            't' | 's' | 'f' => Taken::Word(letter),
            'm' | 'g' if !number.starts_with(|c: char| c.is_ascii_digit()) => return Err(format!("`{name}` is no code")),
            'm' if !(4..=10).contains(&self.group) => return Err(format!("modal group {} is not possible for an M-code: 4 to 10 are", self.group)),
            'm' => Taken::M(leading_integer(number)),
            'g' if self.group != 1 => return Err(format!("modal group {} is not possible for a G-code: 1 is", self.group)),
            'g' => {
                let tenth = number.split_once('.').filter(|(_, t)| t.starts_with(|c: char| c.is_ascii_digit())).map_or(0, |(_, t)| leading_integer(t));
                Taken::G(leading_integer(number).saturating_mul(10).saturating_add(tenth))
            }
            _ => {
                doubts.push(format!("`{name}` can't be remapped"));
                Taken::None
            }
        };
        Ok(())
    }

    /// The function of a part of this kind.
    fn part(&self, key: &str) -> Option<&str> {
        self.python.iter().find_map(|p| p.strip_prefix(key)?.strip_prefix('='))
    }
}

/// What the INI file says, looked up once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Config {
    pub spindles: i32,
    pub random: bool,
    pub wrapped: [bool; 3],
    any_wrapped: bool,
    /// Joint number of rotary axes that lock (`LOCKING_INDEXER_JOINT`).
    pub indexers: [Option<i32>; 3],
    pub any_indexer: bool,
    pub change_at_g30: bool,
    pub change_quill_up: bool,
    pub change_with_spindle_on: bool,
    pub retain_g43: bool,
    pub n_args: bool,
    pub no_g92_persistence: bool,
    pub no_fanuc_subs: bool,
    pub orient_offset: f64,
    g: FxHashMap<i32, Remap>,
    m: FxHashMap<i32, Remap>,
    words: FxHashMap<char, Remap>,
}

impl Config {
    pub fn new(setup: &Setup) -> Config {
        let ini = &setup.ini;
        let switch = |section: &str, key: &str| ini.switch(section, key, setup.version).unwrap_or(false);
        let mut c = Config {
            spindles: spindles(ini),
            random: switch("emcio", "random_toolchanger"),
            wrapped: ["axis_a", "axis_b", "axis_c"].map(|s| switch(s, "wrapped_rotary")),
            indexers: ["axis_a", "axis_b", "axis_c"].map(|s| ini.get(s, "locking_indexer_joint").map(leading_integer).filter(|n| *n != -1)),
            change_at_g30: switch("emcio", "tool_change_at_g30"),
            change_quill_up: switch("emcio", "tool_change_quill_up"),
            change_with_spindle_on: switch("emcio", "tool_change_with_spindle_on"),
            retain_g43: switch("rs274ngc", "retain_g43"),
            n_args: switch("rs274ngc", "oword_nargs"),
            no_g92_persistence: switch("rs274ngc", "disable_g92_persistence"),
            no_fanuc_subs: switch("rs274ngc", "disable_fanuc_style_sub"),
            orient_offset: ini.number("rs274ngc", "orient_offset").unwrap_or(0.0),
            ..Config::default()
        };
        c.any_indexer = c.indexers.iter().any(Option::is_some);
        c.any_wrapped = c.wrapped.iter().any(|w| *w);
        for line in ini.all("rs274ngc", "remap") {
            c.add_remap(line, setup.without_python);
        }
        c
    }

    fn add_remap(&mut self, line: &str, without_python: bool) {
        let Ok((r, _)) = Remap::of(line) else { return };
        if !without_python && !r.python.is_empty() {
            return;
        }
        match r.code {
            Taken::G(n) => drop(self.g.insert(n, r)),
            Taken::M(n) => drop(self.m.insert(n, r)),
            Taken::Word(letter) => drop(self.words.insert(letter, r)),
            Taken::None => {}
        }
    }

    #[inline]
    pub fn g_remap(&self, code: i32) -> Option<&Remap> {
        if self.g.is_empty() { None } else { self.g.get(&code) }
    }
    #[inline]
    pub fn m_remap(&self, code: i32) -> Option<&Remap> {
        if self.m.is_empty() { None } else { self.m.get(&code) }
    }
    fn any_remap(&self) -> bool {
        !(self.g.is_empty() && self.m.is_empty() && self.words.is_empty())
    }
    #[inline]
    pub fn wrapped(&self) -> bool {
        self.any_wrapped
    }
}

/// The whole number that a text begins with, 0 where it begins with something else.
fn leading_integer(text: &str) -> i32 {
    let text = text.trim_start();
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |rest| (-1, rest));
    let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
    digits[..end].parse::<i32>().map_or(0, |n| sign * n)
}

/// How many spindles the machine has; the controller itself has room for eight.
pub(crate) fn spindles(ini: &Ini) -> i32 {
    ini.integer("traj", "spindles").unwrap_or(1).clamp(0, crate::state::SPINDLES as i32)
}

/// REMAP lines of an INI file: for each of those that go before `line` have been seen. What is wrong (true) or doubtful
/// (false) with one.
pub(crate) fn check_remap(line: &str, earlier: &[String]) -> Vec<(bool, String)> {
    match Remap::of(line) {
        Err(why) => vec![(true, why)],
        Ok((r, doubts)) => {
            let name = |l: &String| l.split_whitespace().next().is_some_and(|n| n.eq_ignore_ascii_case(&r.name));
            let twice = earlier.iter().any(name).then(|| (true, format!("{} is remapped already", r.name)));
            twice.into_iter().chain(doubts.into_iter().map(|d| (false, d))).collect()
        }
    }
}

/// REMAP lines whose subroutine is nowhere, with the name of its file.
pub fn remaps_without_file<'s>(setup: &'s Setup, there: &dyn Fn(&Path) -> bool) -> Vec<(&'s str, String)> {
    let lines = setup.ini.all("rs274ngc", "remap");
    let missing = |line: &'s String| {
        let (r, _) = Remap::of(line).ok().filter(|(r, _)| !r.sub.is_empty())?;
        let found = subroutine_paths(setup, &r.sub).iter().any(|p| there(p));
        (!found).then(|| (line.as_str(), format!("{}.ngc", r.sub)))
    };
    lines.iter().filter_map(missing).collect()
}

fn m_remappable(m: i32) -> bool {
    (200..1000).contains(&m)
        || (m > 0 && m < 100 && crate::read::m_group(m) == -1)
        || matches!(m, 0 | 1 | 6 | 9 | 60 | 61 | 62..=68)
}

/// A block whose remapped steps are being carried out.
#[derive(Clone, Debug)]
pub(crate) struct Remapped {
    block: Block,
    comment: Option<crate::io::Comment>,
    reading: crate::run::Reading,
    step: u32,
    name: String,
    /// The code's own meaning follows behind the subroutine: an epilog would bring it about.
    own_meaning: bool,
}

/// Files that an external subroutine may be in, in the order the controller tries them.
pub fn subroutine_paths(setup: &Setup, name: &str) -> Vec<PathBuf> {
    let files = file_names(setup.dialect, name);
    let ini = &setup.ini;
    let folder = |dir: &str| -> PathBuf {
        let dir = dir.trim();
        let expanded = match dir.strip_prefix("~/") {
            Some(rest) => std::env::var_os("HOME").map_or_else(|| PathBuf::from(dir), |h| PathBuf::from(h).join(rest)),
            None => PathBuf::from(dir),
        };
        match &ini.folder {
            Some(base) if expanded.is_relative() => base.join(expanded),
            _ => expanded,
        }
    };
    let mut folders = vec![setup.base.clone().unwrap_or_default()];
    folders.extend(ini.get("display", "program_prefix").map(folder));
    if let Some(dirs) = ini.get("rs274ngc", "subroutine_path") {
        folders.extend(dirs.split(':').filter(|d| !d.trim().is_empty()).take(10).map(folder));
    }
    folders.extend(ini.get("wizard", "wizard_root").map(folder));
    let open = setup.confined.as_deref();
    let may = |folder: &Path, path: &Path| open.is_none_or(|open| open.iter().map(PathBuf::as_path).chain([folder]).any(|f| lies_in(path, f)));
    let paths = folders.iter().flat_map(|f| files.iter().map(move |name| (f, f.join(name))));
    paths.filter(|(f, path)| may(f, path)).map(|(_, path)| path).collect()
}

/// Names that the file of a subroutine may have. Programs of a Fanuc control are called O and a number of four digits.
fn file_names(dialect: &gr_spec::Dialect, name: &str) -> Vec<String> {
    let mut names = vec![format!("{name}.ngc")];
    if let (gr_spec::Family::Fanuc, Ok(number)) = (dialect.family, name.parse::<u32>()) {
        let mut stems = vec![format!("O{number:04}"), format!("O{number}"), name.to_string(), format!("o{number:04}"), format!("o{number}")];
        stems.sort();
        stems.dedup();
        names.extend(stems.iter().flat_map(|s| ["nc", "NC", "ngc"].map(|ending| format!("{s}.{ending}")).into_iter().chain([s.clone()])));
    }
    names
}

/// Whether a file lies below a folder, whatever way its name takes. What is not there can't be read: no matter.
fn lies_in(path: &Path, folder: &Path) -> bool {
    let Ok(real) = path.canonicalize() else { return true };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    folder.canonicalize().is_ok_and(|f| real.starts_with(f))
}

impl<S: Sink> Interp<'_, S> {
    /// Whether a motion is a remapped G-code.
    #[inline]
    pub(crate) fn is_user_g(&self, motion: i16) -> bool {
        motion > 0 && crate::read::g_group(motion.into()) == -1 && self.config.g_remap(motion.into()).is_some()
    }

    /// Whether the block holds a remapped M-code.
    pub(crate) fn has_user_m(&self) -> bool {
        let user = |m: &i16| *m != -1 && m_remappable((*m).into()) && self.config.m_remap((*m).into()).is_some();
        self.block.m_count > 0 && self.block.m.iter().any(user)
    }

    fn in_progress(&self, name: &str) -> bool {
        self.remaps.iter().any(|r| r.name.eq_ignore_ascii_case(name))
    }

    /// Which steps of the block a remap takes over.
    fn find_remappings(&self) -> u32 {
        let b = &self.block;
        let mut out = 0;
        for (letter, bit) in [('f', step::FEED), ('s', step::SPEED), ('t', step::PREPARE)] {
            if b.has(letter as u8) && self.config.words.contains_key(&letter) && !self.in_progress(&letter.to_string()) {
                out |= 1 << bit;
            }
        }
        let groups = [(5, step::M5), (6, step::M6), (7, step::M7), (8, step::M8), (9, step::M9), (10, step::M10), (4, step::STOP)];
        for (group, bit) in groups {
            let m = i32::from(b.m[group]);
            if m != -1 && m_remappable(m) && self.config.m_remap(m).is_some() {
                let built_in = matches!(m, 62..=68 | 6 | 61 | 0 | 1 | 60);
                if !(built_in && self.in_progress(&format!("M{m}"))) {
                    out |= 1 << bit;
                }
            }
        }
        if b.motion != -1 && self.is_user_g(b.motion) {
            out |= 1 << step::MOTION;
        }
        out
    }

    /// Notes which steps are remapped; called when the block is read.
    #[inline]
    pub(crate) fn note_remaps(&mut self) {
        if self.config.any_remap() {
            self.block.remapped = self.find_remappings();
        }
    }

    /// A block with remapped steps begins.
    pub(crate) fn enter_remap(&mut self) -> Res {
        if self.remaps.len() + 1 >= 10 {
            return Err(Fault::new(code::SUB_LIMIT, rs274::RT_REMAP_LEVELS).arg("remapped codes use each other too deeply"));
        }
        self.remaps.push(Remapped {
            block: self.block.clone(),
            comment: self.comment,
            reading: self.reading.clone(),
            step: 0,
            name: String::new(),
            own_meaning: false,
        });
        self.execute_steps()
    }

    /// A remapped step: its subroutine is called, the block waits.
    pub(crate) fn call_remap(&mut self, at: u32, letter: char, number: i32) -> Res {
        let config = self.config.clone();
        let remap = match letter {
            'M' => config.m_remap(number),
            'G' => config.g_remap(number),
            l => config.words.get(&l.to_ascii_lowercase()),
        };
        let Some(remap) = remap else { return Ok(()) };
        let by_position = remap.words.contains('@');
        let words = self.remap_words(remap)?;
        let own_meaning = remap.part("epilog").is_some() && (letter != 'M' || matches!(number, 6 | 61)) && letter != 'G';
        if let Some(r) = self.remaps.last_mut() {
            r.block = self.block.clone();
            r.step = at;
            r.name = remap.name.clone();
            r.own_meaning = own_meaning;
        }
        if !remap.python.is_empty() {
            self.warn(Fault::own(code::REMAP_PYTHON).arg(&remap.name).arg(remap.python.join(", ")));
        }
        if remap.sub.is_empty() {
            return self.remap_finished();
        }
        let given = self.prolog_values(remap);
        self.call_remap_sub(remap, words, by_position)?;
        let level = self.level();
        for (name, value) in given {
            self.params.set_named(level, name, value);
        }
        Ok(())
    }

    /// The named parameters that the prologs of LinuxCNC's own `stdglue.py` hand to the subroutine.
    fn prolog_values(&self, remap: &Remap) -> Vec<(&'static str, f64)> {
        let pocket = |index: i32| f64::from(self.tool(index).pocket);
        let of_tool = |number: f64| {
            let index = self.tools.pockets().iter().position(|t| f64::from(t.number) == number);
            vec![("tool", number), ("pocket", index.map_or(0.0, |i| pocket(i as i32 + 1)))]
        };
        match remap.part("prolog") {
            Some("prepare_prolog") => of_tool(self.block.or_zero(b't')),
            Some("settool_prolog") => of_tool(self.block.or_zero(b'q')),
            Some("setspeed_prolog") => vec![("speed", self.block.or_zero(b's'))],
            Some("setfeed_prolog") => vec![("feed", self.block.or_zero(b'f'))],
            Some("change_prolog") => vec![
                ("tool_in_spindle", self.params.get(5400)),
                ("selected_tool", f64::from(self.m.selected_tool)),
                ("current_pocket", f64::from(self.m.pocket)),
                ("selected_pocket", f64::from(self.m.selected_pocket)),
            ],
            _ => Vec::new(),
        }
    }

    fn call_remap_sub(&mut self, remap: &Remap, words: Vec<(char, f64)>, by_position: bool) -> Res {
        if by_position {
            // Arguments pass through a text with four decimals.
            let args: Vec<f64> = words.iter().map(|(_, v)| format!("{v:.4}").parse().unwrap_or(*v)).collect();
            self.call_named(&remap.sub, &args, &[])
        } else {
            self.call_named(&remap.sub, &[], &words)
        }
    }

    fn remap_words(&mut self, remap: &Remap) -> Res<Vec<(char, f64)>> {
        let b = &self.block;
        let mut out = Vec::new();
        let mut missing = Vec::new();
        for c in remap.words.chars() {
            let letter = c.to_ascii_lowercase();
            if !letter.is_ascii_lowercase() || letter == 'n' {
                continue;
            }
            if out.iter().any(|(l, _)| *l == letter) {
                continue;
            }
            match b.get(letter as u8) {
                Some(v) => out.push((letter, v)),
                None if c.is_ascii_uppercase() && !missing.contains(&c.to_string()) => missing.push(c.to_string()),
                None => {}
            }
        }
        if remap.words.contains(['n', 'N']) {
            out.push(('n', f64::from(self.sequence())));
        }
        let mut tail = String::new();
        if !missing.is_empty() {
            tail = format!(" missing: {}", missing.join(","));
        }
        if remap.words.contains('>') {
            if self.m.feed > 0.0 { out.push(('f', self.m.feed)) } else { tail.push_str("F>0,") }
        }
        if remap.words.contains('^') {
            if self.m.speed[0] > 0.0 { out.push(('s', self.m.speed[0])) } else { tail.push_str("S>0,") }
        }
        if tail.is_empty() {
            return Ok(out);
        }
        let said = format!("{} lacks words it needs:{tail}", remap.name);
        // The controller shows the call that it put in place of the block.
        self.reading.text = format!("O <{}> call ", remap.sub).into();
        (self.reading.begin, self.reading.start, self.reading.end) = (0, 0, self.reading.text.len() as u32);
        Err(Fault::new(code::REMAP_WORDS, rs274::RT_REMAP_MISSING).arg(&remap.name).arg(tail).named(said))
    }

    /// A remap's subroutine has returned: the rest of the block follows.
    pub(crate) fn remap_finished(&mut self) -> Res {
        let Some(r) = self.remaps.last_mut() else { return Ok(()) };
        let mut block = r.block.clone();
        block.remapped &= !(1 << r.step);
        if r.own_meaning {
            block.undo(r.step);
        }
        r.name.clear();
        self.comment = r.comment;
        self.reading = r.reading.clone();
        self.block = block;
        if self.block.remapped == 0 {
            self.remaps.pop();
        }
        self.execute_steps()
    }

    /// All steps of a remapped block are done.
    pub(crate) fn leave_remap(&mut self) -> Res {
        self.remaps.pop();
        Ok(())
    }

    // Saved modes.

    fn modes(&self) -> SavedModes {
        let m = &self.m;
        let g = [
            self.sequence(),
            m.motion,
            -1,
            [170, 190, 180, 171, 191, 181][m.plane.clamp(1, 6) as usize - 1],
            [400, 420, 410][m.comp_side.min(2) as usize],
            if m.units == Units::Inch as u8 { 200 } else { 210 },
            if m.incremental != 0 { 910 } else { 900 },
            [940, 930, 950][m.feed_mode.min(2) as usize],
            coord_system(m.origin_index),
            if m.tool_offset.iter().any(|v| *v != 0.0) { 430 } else { 490 },
            if m.retract_r != 0 { 990 } else { 980 },
            [610, 611, 640][m.path_mode.min(2) as usize],
            -1,
            if m.css[0] != 0 { 960 } else { 970 },
            if m.ijk_absolute != 0 { 901 } else { 911 },
            if m.lathe_diameter != 0 { 70 } else { 80 },
            if self.params.get(5210) != 0.0 { 923 } else { 922 },
        ];
        let flood = m.flood != 0;
        let codes = [
            self.sequence(),
            -1,
            [5, 3, 4][m.turning[0].min(2) as usize],
            -1,
            if m.mist != 0 {
                7
            } else if flood {
                -1
            } else {
                9
            },
            if flood { 8 } else { -1 },
            // The controller looks at the list of spindles, which is always there.
            if m.feed_override != 0 { 48 } else { 51 },
            if m.adaptive_feed != 0 { 52 } else { -1 },
            if m.feed_hold != 0 { 53 } else { -1 },
        ];
        let settings = [f64::from(self.sequence()), m.feed, m.speed[0], m.tolerance, m.naivecam];
        SavedModes { g, m: codes, settings }
    }

    /// Active G-codes in the controller's order (times ten).
    pub fn active_g_codes(&self) -> [i32; 17] {
        self.modes().g
    }
    /// Active M-codes in the controller's order.
    pub fn active_m_codes(&self) -> [i32; 9] {
        self.modes().m
    }
    /// Line, feed, speed, G64 P, G64 Q.
    pub fn active_settings(&self) -> [f64; 5] {
        self.modes().settings
    }

    /// M70, M73.
    pub(crate) fn save_modes(&mut self, restore: bool) {
        let mut saved = Box::new(self.modes());
        // Where it was kept makes no difference.
        (saved.g[0], saved.m[0], saved.settings[0]) = (0, 0, 0.0);
        let level = self.level();
        let here = &mut self.levels[level];
        here.saved = Some(saved);
        here.saved_valid = true;
        if restore && level > 0 {
            here.restore = true;
        }
    }

    /// M71.
    pub(crate) fn forget_modes(&mut self) {
        let level = self.level();
        self.levels[level].saved_valid = false;
    }

    /// M72.
    pub(crate) fn restore_saved_modes(&mut self) -> Res {
        let here = &self.levels[self.level()];
        match (&here.saved, here.saved_valid) {
            (Some(saved), true) => {
                let saved = saved.clone();
                if self.restore_modes(&saved)? {
                    self.lose_rest();
                }
                Ok(())
            }
            _ => Err(Fault::new(code::WORD_MISSING, rs274::RT_M72).arg("M72").arg("M70 or M73 before it").at(b'm')),
        }
    }

    /// The blocks that bring modes back take the place of the one with M72: what is not done yet never will be.
    fn lose_rest(&mut self) {
        let b = &self.block;
        let early = (1 << Group::Feed as u32) | (1 << Group::SpindleMode as u32);
        if b.motion != -1 || b.g_mask & !early != 0 || [4, 8, 9, 10].iter().any(|g| b.m[*g] != -1) {
            self.warn(Fault::own(code::MODES_REST_LOST).at(b'm'));
        }
        self.block.clear();
    }

    /// Brings saved modes back by executing blocks, as the controller does; false: there was nothing to do.
    pub(crate) fn restore_modes(&mut self, saved: &SavedModes) -> Res<bool> {
        let kept = (self.block.clone(), self.comment.take());
        let shown = (self.reading.start, self.reading.end);
        // The command texts are what is "read last" now: no N number.
        self.reading.end = self.reading.start;
        let done = self.restore_by_blocks(saved);
        (self.reading.start, self.reading.end) = shown;
        (self.block, self.comment) = kept;
        done
    }

    fn run_own_block(&mut self) -> Res {
        self.enhance()?;
        self.check()?;
        self.execute_block()
    }

    fn restore_by_blocks(&mut self, saved: &SavedModes) -> Res<bool> {
        let units = self.modes().g[5] != saved.g[5];
        if units {
            self.block.clear();
            self.block.set_g(6, saved.g[5] as i16);
            self.run_own_block()?;
        }
        let now = self.modes();
        self.block.clear();
        let mut any = false;
        // 2.10 restores feed, speed and path mode whether they changed or not.
        let always = self.setup.version == gr_canon::Version::V2_10;
        if always || now.settings[1] != saved.settings[1] {
            self.block.set(b'f', format!("{:.1}", saved.settings[1]).parse().unwrap_or(0.0));
            any = true;
        }
        if always || now.settings[2] != saved.settings[2] {
            self.block.set(b's', format!("{:.0}", saved.settings[2]).parse().unwrap_or(0.0));
            any = true;
        }
        let mut path = always || now.settings[3] != saved.settings[3] || now.settings[4] != saved.settings[4];
        for i in [3, 4, 6, 7, 8, 9, 10, 11, 13, 14, 15, 16] {
            let code = saved.g[i];
            if code == now.g[i] || code == -1 {
                continue;
            }
            if i == 11 && code == 640 {
                path = true;
                continue;
            }
            let group = crate::read::g_group(code);
            if group >= 0 {
                self.block.set_g(group as usize, code as i16);
                any = true;
            }
        }
        if saved.g[11] == 640 && path {
            let six = |v: f64| format!("{v:.6}").parse::<f64>().unwrap_or(v);
            self.block.set_g(13, 640);
            if saved.settings[3] >= 0.0 {
                self.block.set(b'p', six(saved.settings[3]));
                if saved.settings[4] >= 0.0 {
                    self.block.set(b'q', six(saved.settings[4]));
                }
            }
            any = true;
        }
        // The M-codes go on in the same line up to the first line end.
        let wanted: Vec<i32> = [2, 4, 5, 6, 7, 8].iter().filter(|i| saved.m[**i] != now.m[**i] && saved.m[**i] != -1).map(|i| saved.m[*i]).collect();
        let mut codes = wanted.into_iter();
        if let Some(first) = codes.next() {
            self.take_word(b'm', f64::from(first))?;
            any = true;
        }
        if any {
            self.run_own_block()?;
        }
        let done = units || any;
        for m in codes {
            self.block.clear();
            self.take_word(b'm', f64::from(m))?;
            self.run_own_block()?;
        }
        Ok(done)
    }

    /// Sends what cutter compensation holds back, before a stop.
    pub(crate) fn flush_comp(&mut self) -> Res {
        if self.queue.is_empty() {
            self.dequeue_all();
            return Ok(());
        }
        let [a, b, _] = crate::queue::plane_axes(self.m.plane());
        let at = [self.m.current[a], self.m.current[b]];
        self.end_queued_at(at)?;
        self.dequeue_all();
        Ok(())
    }

    /// The state between two blocks.
    pub fn state(&self) -> crate::State {
        let main = &self.levels[0];
        let own = |t: &crate::Tools| (!t.is(&self.setup.tools)).then(|| t.clone());
        crate::State {
            modal: self.m,
            queue: self.queue.clone(),
            world: self.world,
            saved: main.saved.clone().filter(|_| main.saved_valid),
            tools: own(&self.tools),
            world_tools: own(&self.world_tools),
        }
    }
}
