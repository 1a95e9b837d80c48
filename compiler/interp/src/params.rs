//! Numbered and named parameters. Copying a set is cheap (pages are shared until written), and its content
//! hash is kept up to date with every write, so that a set can be part of a memo key.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use gr_canon::{Sink, Version};
use gr_spec::{code, rs274};
use rustc_hash::{FxHashMap, FxHasher};

use crate::{Fault, Interp, Res};

/// One more than the highest parameter number.
pub const MAX: i32 = 5602;
const PAGE: usize = 64;

type Names = FxHashMap<Box<str>, f64>;

/// Numbered parameters, global named ones, and the named ones of each call level.
#[derive(Clone, Debug)]
pub struct Params {
    pages: Arc<Vec<Arc<[f64; PAGE]>>>,
    /// Level 0 (the main program) also holds the names that begin with `_`.
    levels: Vec<Arc<Names>>,
    hash: u64,
}

impl Default for Params {
    fn default() -> Self {
        let empty = Arc::new([0.0; PAGE]);
        let pages = (0..(MAX as usize).div_ceil(PAGE)).map(|_| empty.clone()).collect();
        Params { pages: Arc::new(pages), levels: vec![Arc::default()], hash: 0 }
    }
}

impl PartialEq for Params {
    fn eq(&self, other: &Self) -> bool {
        self.hash == other.hash && self.same_numbers(other) && self.same_names(other)
    }
}

fn mix(key: u64, value: f64) -> u64 {
    let bits = (value + 0.0).to_bits();
    if bits == 0 {
        return 0;
    }
    let mut x = key.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ bits;
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

fn name_key(level: usize, name: &str) -> u64 {
    let mut h = FxHasher::default();
    (level, name).hash(&mut h);
    h.finish() | 1 << 63
}

impl Params {
    /// Value of a numbered parameter; 0 outside 1 … 5601.
    #[inline]
    pub fn get(&self, index: u32) -> f64 {
        let index = index as usize;
        self.pages.get(index / PAGE).map_or(0.0, |p| p[index % PAGE])
    }
    /// Sets a numbered parameter; numbers beyond the last one are ignored.
    pub fn set(&mut self, index: u32, value: f64) {
        let old = self.get(index);
        if old.to_bits() == value.to_bits() || index as usize >= MAX as usize {
            return;
        }
        self.hash ^= mix(u64::from(index), old) ^ mix(u64::from(index), value);
        let page = &mut Arc::make_mut(&mut self.pages)[index as usize / PAGE];
        Arc::make_mut(page)[index as usize % PAGE] = value;
    }
    /// A named parameter as seen from a call level.
    pub fn named(&self, level: usize, name: &str) -> Option<f64> {
        let level = if name.starts_with('_') { 0 } else { level };
        self.levels.get(level)?.get(name).copied()
    }
    /// Sets (or makes) a named parameter.
    pub fn set_named(&mut self, level: usize, name: &str, value: f64) {
        let level = if name.starts_with('_') { 0 } else { level };
        while self.levels.len() <= level {
            self.levels.push(Arc::default());
        }
        let key = name_key(level, name);
        let names = Arc::make_mut(&mut self.levels[level]);
        match names.get_mut(name) {
            Some(old) => {
                self.hash ^= mix(key, *old) ^ mix(key, value);
                *old = value;
            }
            None => {
                // The entry itself counts, even while its value is 0.
                self.hash ^= mix(key, 1e300) ^ mix(key, value);
                names.insert(name.into(), value);
            }
        }
    }
    /// Forgets the names of a call level and of the levels inside it.
    pub(crate) fn leave_level(&mut self, level: usize) {
        while self.levels.len() > level.max(1) {
            let at = self.levels.len() - 1;
            for (name, value) in self.levels[at].iter() {
                let key = name_key(at, name);
                self.hash ^= mix(key, 1e300) ^ mix(key, *value);
            }
            self.levels.pop();
        }
    }
    /// Takes a parameter of the main program away, as if it had never been set.
    pub fn forget(&mut self, parameter: &gr_gcode::Parameter) {
        match parameter {
            gr_gcode::Parameter::Number(n) => self.set(*n, 0.0),
            gr_gcode::Parameter::Named(name) => {
                let Some(value) = self.levels.first().and_then(|l| l.get(name)).copied() else { return };
                let key = name_key(0, name);
                self.hash ^= mix(key, 1e300) ^ mix(key, value);
                Arc::make_mut(&mut self.levels[0]).remove(name);
            }
        }
    }
    /// Hash of the whole content.
    pub fn content_hash(&self) -> u64 {
        self.hash
    }
    /// All numbered parameters that are not zero.
    pub fn numbers(&self) -> impl Iterator<Item = (u32, f64)> {
        (0..MAX as u32).map(|i| (i, self.get(i))).filter(|(_, v)| *v != 0.0)
    }
    fn same_numbers(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.pages, &other.pages)
            || self.pages.iter().zip(other.pages.iter()).all(|(a, b)| Arc::ptr_eq(a, b) || a == b)
    }
    fn same_names(&self, other: &Self) -> bool {
        self.levels.len() == other.levels.len()
            && self.levels.iter().zip(&other.levels).all(|(a, b)| Arc::ptr_eq(a, b) || a == b)
    }
}

fn flag(value: bool) -> f64 {
    if value { 1.0 } else { 0.0 }
}

impl<S: Sink> Interp<'_, S> {
    /// Reads a numbered parameter that is in range.
    pub(crate) fn read_param(&mut self, index: i32) -> Res<f64> {
        if (5420..=5428).contains(&index) {
            if self.m.comp_side != 0 {
                return Err(Fault::new(code::COMPENSATION_NOT_WHILE_ON, rs274::RT_POSITION_WITH_COMP)
                    .arg("reading the current position"));
            }
            return Ok(self.m.current[(index - 5420) as usize]);
        }
        // 2.10: the machine position, however offsets and rotation stand.
        if (5021..=5029).contains(&index) && self.setup.version == Version::V2_10 {
            return Ok(self.machine_position()[(index - 5021) as usize]);
        }
        let index = index as u32;
        if let Some(log) = &mut self.log {
            log.read(index);
        }
        Ok(self.params.get(index))
    }

    /// Sets a numbered parameter.
    pub(crate) fn write_param(&mut self, index: u32, value: f64) {
        if let Some(log) = &mut self.log {
            log.write(index, value);
        }
        self.params.set(index, value);
    }

    /// Reads a named parameter.
    pub(crate) fn read_named(&mut self, name: &str) -> Res<f64> {
        match self.find_named(name) {
            Some(value) => Ok(value),
            None if self.defining_sub => {
                self.unset_read = true;
                Ok(0.0)
            }
            None if name.starts_with("_hal[") => Err(Fault::new(code::PARAMETER_HAL, rs274::RT_NAME_UNDEFINED).arg(name)),
            None => Err(Fault::new(code::PARAMETER_UNDEFINED, rs274::RT_NAME_UNDEFINED).arg(name)),
        }
    }

    /// A named parameter, if it exists.
    pub(crate) fn find_named(&mut self, name: &str) -> Option<f64> {
        if name.starts_with('_') {
            if let Some(value) = self.predefined(name) {
                return Some(value);
            }
        }
        if let Some(log) = &mut self.log {
            log.named = true;
        }
        if let Some(value) = self.params.named(self.level(), name) {
            return Some(value);
        }
        self.ini_value(name)
    }

    /// `_ini[section]key`
    fn ini_value(&self, name: &str) -> Option<f64> {
        let (section, key) = name.strip_prefix("_ini[")?.split_once(']')?;
        let ini = &self.setup.ini;
        let text = ini.get(section, key)?.trim();
        // The whole text has to be the number, and the file may switch such parameters off.
        let plain = text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'.' | b'+' | b'-' | b'e' | b'E'));
        let on = ini.switch("RS274NGC", "INI_VARS", self.setup.version).unwrap_or(true);
        text.parse().ok().filter(|_| plain && on)
    }

    /// Whether a program can't assign to this name.
    pub(crate) fn is_read_only(&self, name: &str) -> bool {
        name.starts_with('_') && (self.predefined(name).is_some() || self.ini_value(name).is_some())
    }

    /// Value of a parameter as the next block would read it: for editors that look into a run.
    pub fn peek(&mut self, parameter: &gr_gcode::Parameter) -> Option<f64> {
        match parameter {
            gr_gcode::Parameter::Number(n) if self.is_fanuc() => {
                let index = self.variable_index(i32::try_from(*n).ok()?).ok()?;
                Some(self.read_variable(index)).filter(|v| !crate::vacant::is_vacant(*v))
            }
            gr_gcode::Parameter::Number(n) => self.read_param(i32::try_from(*n).ok()?).ok(),
            gr_gcode::Parameter::Named(name) => self.find_named(name),
        }
    }

    /// Names that the controller itself keeps.
    fn predefined(&self, name: &str) -> Option<f64> {
        let m = &self.m;
        Some(match name {
            "_vmajor" => if self.setup.version == Version::V2_9 { 2.9 } else { 2.1 },
            "_vminor" | "_task" => 0.0,
            "_metric_machine" => -1.0,
            "_line" => f64::from(self.sequence()),
            "_motion_mode" => f64::from(m.motion),
            "_plane" => [170.0, 190.0, 180.0, 171.0, 191.0, 181.0][m.plane.clamp(1, 6) as usize - 1],
            "_ccomp" => [400.0, 420.0, 410.0][m.comp_side.min(2) as usize],
            "_metric" => flag(m.units == 2),
            "_imperial" => flag(m.units == 1),
            "_absolute" => flag(m.incremental == 0),
            "_incremental" => flag(m.incremental != 0),
            "_inverse_time" => flag(m.feed_mode == 1),
            "_units_per_minute" => flag(m.feed_mode == 0),
            "_units_per_rev" => flag(m.feed_mode == 2),
            "_coord_system" => f64::from(coord_system(m.origin_index)),
            "_tool_offset" => flag(m.tool_offset.iter().any(|v| *v != 0.0)),
            "_retract_r_plane" => flag(m.retract_r != 0),
            "_retract_old_z" => flag(m.retract_r == 0),
            "_spindle_rpm_mode" => flag(m.css[0] == 0),
            "_spindle_css_mode" => flag(m.css[0] != 0),
            "_ijk_absolute_mode" => flag(m.ijk_absolute != 0),
            "_lathe_diameter_mode" => flag(m.lathe_diameter != 0),
            "_lathe_radius_mode" => flag(m.lathe_diameter == 0),
            "_spindle_on" => flag(m.turning[0] != 0),
            "_spindle_cw" => flag(m.turning[0] == 1),
            "_mist" => flag(m.mist != 0),
            "_flood" => flag(m.flood != 0),
            "_speed_override" => flag(m.speed_override[0] != 0),
            "_feed_override" => flag(m.feed_override != 0),
            "_adaptive_feed" => flag(m.adaptive_feed != 0),
            "_feed_hold" => flag(m.feed_hold != 0),
            "_feed" => m.feed,
            "_rpm" => m.speed[0].abs(),
            "_current_tool" => self.params.get(5400),
            "_selected_pocket" if self.config.random => f64::from(m.selected_pocket),
            "_selected_pocket" => match self.tool(m.selected_pocket).pocket {
                0 => -1.0,
                pocket => f64::from(pocket),
            },
            "_current_pocket" if m.pocket == -1 => -1.0,
            "_current_pocket" if self.config.random => f64::from(m.pocket),
            "_current_pocket" => f64::from(self.tool(m.pocket).pocket),
            "_selected_tool" => f64::from(m.selected_tool),
            "_x" => m.current[0],
            "_y" => m.current[1],
            "_z" => m.current[2],
            "_a" => m.current[3],
            "_b" => m.current[4],
            "_c" => m.current[5],
            "_u" => m.current[6],
            "_v" => m.current[7],
            "_w" => m.current[8],
            "_abs_x" => self.machine_position()[0],
            "_abs_y" => self.machine_position()[1],
            "_abs_z" => self.machine_position()[2],
            "_abs_a" => self.machine_position()[3],
            "_abs_b" => self.machine_position()[4],
            "_abs_c" => self.machine_position()[5],
            "_value" => self.return_value,
            "_value_returned" => flag(self.value_returned),
            "_call_level" => self.level() as f64,
            "_remap_level" => self.remaps.len() as f64,
            _ => return None,
        })
    }
}

/// `540` … `593` for 1 … 9.
pub(crate) fn coord_system(index: i32) -> i32 {
    if index < 7 { 530 + 10 * index } else { 584 + index }
}

#[cfg(test)]
mod tests {
    use super::Params;

    #[test]
    fn the_hash_depends_on_the_content_alone() {
        let (mut a, mut b) = (Params::default(), Params::default());
        a.set(100, 1.0);
        a.set(200, 2.0);
        b.set(200, 3.0);
        b.set(100, 1.0);
        assert_ne!(a, b);
        b.set(200, 2.0);
        assert_eq!(a, b);
        assert_eq!(a.content_hash(), b.content_hash());
        a.set_named(2, "x", 0.0);
        assert_ne!(a.content_hash(), b.content_hash());
        a.leave_level(1);
        assert_eq!(a.content_hash(), b.content_hash());
    }

    #[test]
    fn copies_do_not_share_writes() {
        let mut a = Params::default();
        let b = a.clone();
        a.set(5, 1.0);
        assert_eq!((a.get(5), b.get(5)), (1.0, 0.0));
    }
}
