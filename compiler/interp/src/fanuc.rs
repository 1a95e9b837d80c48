//! What a Fanuc control does otherwise than LinuxCNC: increments U V W H and diameters of a lathe, rotation of
//! coordinates (G68, G69), G80 that goes back to the motion before the cycle. Sources stand with the rows of the
//! dialects.

use gr_canon::{Axes, Call, Plane, Sink};
use gr_gcode::Binary;
use gr_spec::{Dialect, Family, code, rs274};

use crate::block::{AXES, Group, letters};
use crate::motion::rotate;
use crate::queue::plane_axes;
use crate::{Fault, Interp, Res};

/// The lathe: G-code system A.
const TURN: &str = "fanuc-turn";

/// Increments of a lathe, and the axis that each moves.
const INCREMENTS: [(u8, u8); 4] = [(b'u', b'x'), (b'v', b'y'), (b'w', b'z'), (b'h', b'c')];
const INCREMENT_MASK: u32 = letters(b"uvwh");
/// Words of a mill that name offsets.
const OFFSET_NUMBERS: u32 = letters(b"dh");
/// Words of a lathe's G1 that may be a corner.
const CORNER_MASK: u32 = letters(b"ac");
const LETTERS: [u8; 9] = *b"xyzabcuvw";
const CENTRES: [u8; 3] = *b"ijk";

/// A lathe of G-code system A: X is a diameter, U V W H are increments, G98 and G99 choose the feed.
pub(crate) fn is_lathe(dialect: &Dialect) -> bool {
    dialect.id == TURN
}

/// What AND, OR, XOR and MOD make of two numbers: bits of whole numbers, and a rest with the sign of the first one. None: another operation.
pub(crate) fn bitwise(op: Binary, a: f64, b: f64) -> Option<f64> {
    let bits = |v: f64| libm::round(v) as i64;
    Some(match op {
        Binary::And => (bits(a) & bits(b)) as f64,
        Binary::Or => (bits(a) | bits(b)) as f64,
        Binary::Xor => (bits(a) ^ bits(b)) as f64,
        Binary::Modulo => libm::fmod(a, b),
        _ => return None,
    })
}

impl<S: Sink> Interp<'_, S> {
    #[inline]
    pub(crate) fn is_fanuc(&self) -> bool {
        self.setup.dialect.family == Family::Fanuc
    }

    /// Codes with no place among those of LinuxCNC: true when it is one.
    pub(crate) fn take_fanuc_g(&mut self, n: i32) -> bool {
        if n == 670 && self.setup.dialect.code("G67").is_some() {
            self.block.ends_modal = true;
            return true;
        }
        let row = |name: &str| self.setup.dialect.code(name).is_some();
        match n {
            50 | 51 | 80 if row("G8") => self.block.look_ahead = n as i16,
            // What these end is refused, so nothing is on that they could switch off.
            110 if row("G11") => {}
            150 if row("G15") => {}
            500 if row("G50.1") => {}
            501 if row("G50.1") => self.block.mirror_off = true,
            _ => return self.take_turn(n),
        }
        true
    }

    fn take_turn(&mut self, n: i32) -> bool {
        let turns = matches!(n, 680 | 690) && self.setup.dialect.code(if n == 680 { "G68" } else { "G69" }).is_some();
        let known = turns || n == 500 && is_lathe(self.setup.dialect);
        if known {
            self.block.turning = n as i16;
        }
        known
    }

    /// Before the block is looked at as a whole: words that mean something else here become those that it knows.
    pub(crate) fn fanuc_words(&mut self) -> Res {
        if self.block.ends_modal {
            self.end_modal()?;
        }
        if !is_lathe(self.setup.dialect) {
            self.offset_numbers()?;
        }
        if self.block.mirror_off {
            self.block.present &= !AXES;
        }
        if self.block.look_ahead != -1 {
            self.look_ahead()?;
        }
        match self.block.turning {
            -1 => {}
            500 => return self.clamp_spindle("G50"),
            690 => self.m.turned = 0,
            _ => return self.turn_coordinates(),
        }
        if matches!(self.block.g(Group::NonModal), 100 | 280 | 300 | 520 | 920) {
            self.motion_from_now_on();
        }
        match self.block.g(Group::NonModal) {
            100 => return self.data_input(),
            300 => self.reference_point()?,
            530 => self.machine_rapid()?,
            920 if self.block.has(b's') && !is_lathe(self.setup.dialect) => return self.clamp_spindle("G92"),
            _ => {}
        }
        let arc = matches!(self.block.g(Group::Motion), 20 | 30) || self.block.g(Group::Motion) == -1 && matches!(self.m.motion, 20 | 30);
        let b = &self.block;
        if arc && b.has(b'p') && b.m_count == 0 && b.g(Group::NonModal) == -1 && self.has_axes() {
            return Err(self.not_in_dialect("P with an arc", "write a block for each turn").at(b'p'));
        }
        let dwell = self.block.g(Group::NonModal) == 40;
        if is_lathe(self.setup.dialect) && self.block.has_any_of(CORNER_MASK | INCREMENT_MASK) && !dwell {
            self.corner()?;
            self.increments()?;
        }
        // G80 goes back to the motion of group 01, which a bare axis word then makes.
        if self.block.g(Group::Motion) == 800 && self.has_axes() {
            self.end_cycle();
            self.block.g[Group::Motion as usize] = -1;
            self.block.g_mask &= !(1 << Group::Motion as u32);
        }
        Ok(())
    }

    /// G80: the motion of before the cycle is in force again; without a cycle the one in force stays.
    pub(crate) fn end_cycle(&mut self) {
        if crate::check::is_cycle(self.m.motion as i16) {
            self.m.motion = self.m.before_cycle;
        }
        self.leave_cycle();
    }

    /// A code of group 01 beside one of group 00 that takes the axis words: it is in force from now on.
    fn motion_from_now_on(&mut self) {
        let motion = self.block.g(Group::Motion);
        if matches!(motion, 0 | 10 | 20 | 30) {
            self.m.motion = i32::from(motion);
            self.leave_cycle();
            self.block.g[Group::Motion as usize] = -1;
            self.block.g_mask &= !(1 << Group::Motion as u32);
        }
    }

    /// G5 P, G5.1 Q and G8 P choose how far the control looks ahead; axis words name the axes that they are for.
    fn look_ahead(&mut self) -> Res {
        let own = if self.block.look_ahead == 51 { b'q' } else { b'p' };
        let name = crate::check::code_name(self.block.look_ahead);
        if !self.block.has(own) {
            return Err(Fault::new(code::WORD_MISSING, rs274::SILENT).arg(name).arg(own.to_ascii_uppercase() as char).at(b'g'));
        }
        self.block.present &= !(AXES | letters(b"pqr"));
        self.warn(Fault::own(code::PATH_LOOK_AHEAD).at(b'g').arg(name));
        Ok(())
    }

    /// A lathe without a C axis takes C and A beside one axis of G1 for a chamfer and for the angle of the line. A lathe with one has
    /// positioned it before it cuts.
    fn corner(&mut self) -> Res {
        let b = &self.block;
        let cuts = b.g(Group::Motion) == 10 || b.g(Group::Motion) == -1 && self.m.motion == 10;
        let cuts = cuts && b.g(Group::NonModal) == -1;
        let goes = [b.has_any(b"xu"), b.has_any(b"zw")];
        let letter = if b.has(b'a') { 'A' } else { 'C' };
        if cuts && b.has_any(b"ac") && goes != [false; 2] && (letter == 'A' || self.m.c_axis == 0 && goes != [true; 2]) {
            let what = if letter == 'A' { "angle of the line" } else { "chamfer" };
            return Err(Fault::new(code::CODE_NOT_CARRIED_OUT, rs274::SILENT).arg(format!("{letter} with G1")).arg(what).at(letter.to_ascii_lowercase() as u8));
        }
        self.m.c_axis |= u8::from(b.has_any(b"ch"));
        Ok(())
    }

    /// H and D of a machining center hold until the next one, whatever block names them. H under G43 changes the length in force
    /// (Series 0i/30i operator's manual, machining center system, tool length offset, cutter compensation).
    fn offset_numbers(&mut self) -> Res {
        let (length, side) = (self.block.g(Group::ToolLength), self.block.g(Group::CutterComp));
        if !self.block.has_any_of(OFFSET_NUMBERS) && length == -1 && side == -1 {
            return Ok(());
        }
        let needs = |name: &str, letter: &str| Fault::new(code::WORD_MISSING, rs274::SILENT).arg(name).arg(letter).at(b'g');
        if let Some(d) = self.block.get(b'd') {
            let number = crate::comp::radius_number(d, side.max(410))?;
            if self.m.comp_side != 0 && side != 400 && number != self.m.radius_number {
                let what = format!("D{number} while D{} is in force", self.m.radius_number);
                return Err(Fault::new(code::CODE_NOT_CARRIED_OUT, rs274::RT_D_UNUSED).arg(what).arg("Cutter compensation").at(b'd'));
            }
            self.m.radius_number = number;
            self.block.unset(b'd');
        }
        if matches!(side, 410 | 420) {
            if self.m.radius_number < 0 {
                return Err(needs(&crate::check::code_name(side), "D"));
            }
            self.block.set(b'd', f64::from(self.m.radius_number));
        }
        let mut length = length;
        if let Some(h) = self.block.get(b'h') {
            if h < 0.0 {
                return Err(Fault::new(code::WORD_NEGATIVE, rs274::RT_NEGATIVE_H).arg('H').at(b'h'));
            }
            self.m.length_number = crate::eval::to_int(h);
            self.block.unset(b'h');
            if length == -1 && self.m.length_on != 0 {
                length = 430;
                self.block.set_g(Group::ToolLength as usize, length);
            }
        }
        if length == 430 {
            if self.m.length_number < 0 {
                return Err(needs("G43", "H"));
            }
            self.block.set(b'h', f64::from(self.m.length_number));
        }
        Ok(())
    }

    /// G10 of a machining center: L2 sets a work offset, L10 R the length of an offset number, L12 R its radius. The
    /// other kinds of data (wear, the external offset, what G91 adds to) have no place here.
    fn data_input(&mut self) -> Res {
        let Some(kind) = self.block.get(b'l') else { return Ok(()) };
        let incremental = self.goes_by_increments();
        let b = &self.block;
        let system = b.get(b'p').is_some_and(|p| (1.0..=6.0).contains(&p));
        let refused = match kind {
            2.0 if !system => Some("G10 L2 with a P other than 1 to 6".to_string()),
            2.0 if b.has(b'r') => Some("G10 L2 with R".into()),
            2.0 | 10.0 | 12.0 if incremental => Some("G10 under G91".into()),
            10.0 | 12.0 if !b.has(b'r') || b.has_any_of(crate::block::AXES) => Some("G10 of a tool without R alone".into()),
            2.0 | 10.0 | 12.0 => None,
            _ => Some(format!("G10 L{kind}")),
        };
        if let Some(what) = refused {
            return Err(self.not_carried_out(rs274::RT_G10_L, what).at(b'g'));
        }
        // LinuxCNC's L1 sets the length by Z and the radius by R.
        if kind == 10.0 {
            let length = self.block.or_zero(b'r');
            self.block.unset(b'r');
            self.block.set(b'z', length);
        }
        if kind != 2.0 {
            self.block.set(b'l', 1.0);
        }
        Ok(())
    }

    /// G33, G32 of a lathe: F, which stays in force for later feeds, is the lead. Here it becomes the K of G33.
    pub(crate) fn thread_words(&mut self) -> Res {
        let name = if is_lathe(self.setup.dialect) { "G32" } else { "G33" };
        if self.block.has(b'k') {
            return Err(self.not_in_dialect(&format!("K with {name}"), "write the lead as F").at(b'k'));
        }
        if self.block.get(b'q').is_some_and(|q| q != 0.0) {
            return Err(self.not_carried_out(rs274::SILENT, format!("{name} with a start angle Q")).at(b'q'));
        }
        let lead = self.block.get(b'f').unwrap_or(self.m.feed);
        if lead <= 0.0 {
            return Err(Fault::new(code::WORD_MISSING, rs274::RT_K_MISSING_G33).arg(name).arg('F').at(b'g'));
        }
        self.block.unset(b'f');
        self.block.unset(b'q');
        self.block.set(b'k', lead);
        Ok(())
    }

    /// A Fanuc lead counts along the axis that goes furthest, LinuxCNC's K along the way. F is the feed from now on.
    pub(crate) fn lead_along(&mut self, end: &Axes) -> f64 {
        let lead = self.block.or_zero(b'k');
        if self.m.feed != lead {
            self.m.feed = lead;
            self.emit_queued(Call::SetFeedRate(lead));
        }
        let way: [f64; 3] = std::array::from_fn(|i| (end[i] - self.m.current[i]).abs());
        let longest = way.into_iter().fold(0.0, f64::max);
        let length = libm::sqrt(way.iter().map(|d| d * d).sum());
        // A way along one axis keeps its lead to the last bit.
        if longest > 0.0 && way.iter().filter(|d| **d > 0.0).count() > 1 { lead * length / longest } else { lead }
    }

    /// U V W H of a lathe: distances from where the axis is.
    fn increments(&mut self) -> Res {
        for (letter, axis) in INCREMENTS {
            let Some(by) = self.block.get(letter) else { continue };
            if self.block.has(axis) {
                let both = format!("{} beside {}", upper(letter), upper(axis));
                return Err(Fault::new(code::WORD_REPEATED, rs274::MULTIPLE_WORDS).arg(upper(letter)).arg(both).at(letter));
            }
            // A diameter, like X.
            let by = if letter == b'u' { by / 2.0 } else { by };
            let at = LETTERS.iter().position(|l| *l == axis).unwrap_or(0);
            let from = if self.block.g(Group::NonModal) == 530 { self.machine_position()[at] } else { self.start_point()[at] };
            self.block.unset(letter);
            self.block.set(axis, from + by);
        }
        Ok(())
    }

    /// G30: P2, the second reference point, is what it goes to without P. Where the third and fourth are only the machine knows.
    fn reference_point(&mut self) -> Res {
        match self.block.get(b'p') {
            None => {}
            Some(2.0) => self.block.unset(b'p'),
            Some(p @ (3.0 | 4.0)) => return Err(self.not_carried_out(rs274::SILENT, format!("G30 P{p}")).at(b'p')),
            Some(_) => return Err(Fault::new(code::WORD_BAD_VALUE, rs274::SILENT).arg("G30").arg('P').at(b'p')),
        }
        Ok(())
    }

    /// G53 is a rapid whatever the motion in force is, and leaves that in force.
    fn machine_rapid(&mut self) -> Res {
        if !self.has_axes() && !self.block.has_any_of(INCREMENT_MASK) {
            return Err(Fault::new(code::AXIS_MISSING, rs274::SILENT).arg("G53").at(b'g'));
        }
        match self.block.g(Group::Motion) {
            -1 if crate::check::is_cycle(self.m.motion as i16) => {
                Err(self.not_carried_out(rs274::SILENT, "G53 while a canned cycle is in force".into()).at(b'g'))
            }
            -1 => {
                self.block.g[Group::Motion as usize] = 0;
                self.block.machine_rapid = true;
                Ok(())
            }
            0 => Ok(()),
            other => {
                let what = format!("is a rapid of its own on this control: {} beside it would not be done", crate::check::code_name(other));
                Err(Fault::new(code::MOTION_G53, rs274::SILENT).arg(what).at(b'g'))
            }
        }
    }

    /// G50 S of a lathe, G92 S of a machining center: the highest speed of surface speed control. With axis words they set coordinates.
    fn clamp_spindle(&mut self, name: &str) -> Res {
        self.block.turning = -1;
        if self.has_axes() || self.block.has(b'h') {
            let what = if self.block.has(b's') { "S beside axis words" } else { "axis words" };
            return Err(self.not_carried_out(rs274::RT_UNKNOWN_G, format!("{name} with {what}")).at(b'g'));
        }
        let Some(speed) = self.block.get(b's') else {
            return Err(Fault::new(code::WORD_MISSING, rs274::RT_UNKNOWN_G).arg(name).arg("S").at(b'g'));
        };
        self.block.unset(b's');
        self.block.g[Group::NonModal as usize] = -1;
        self.block.g_mask &= !(1 << Group::NonModal as u32);
        self.m.spindle_clamp = speed;
        let spindle = self.m.active_spindle;
        if self.m.css[spindle.clamp(0, 7) as usize] != 0 {
            self.emit_queued(Call::SetSpindleMode(spindle, if speed > 0.0 { speed } else { 1e30 }, None));
        }
        Ok(())
    }

    /// G68 X Y R.
    fn turn_coordinates(&mut self) -> Res {
        let refuse = |what: &str| {
            Err(Fault::new(code::CODE_NOT_CARRIED_OUT, rs274::RT_UNKNOWN_G).arg(format!("G68 {what}")).arg("Coordinate rotation").at(b'g'))
        };
        if self.goes_by_increments() {
            return refuse("in G91");
        }
        self.motion_from_now_on();
        if self.m.comp_side != 0 {
            return refuse("while cutter compensation is on");
        }
        let b = &self.block;
        if b.g(Group::NonModal) != -1 || b.g(Group::Motion) != -1 || !matches!(b.g(Group::ToolLength), -1 | 490) || !matches!(b.g(Group::CutterComp), -1 | 400) {
            return refuse("together with a code that moves the tool");
        }
        let [one, two, _] = plane_axes(match b.g(Group::Plane) {
            170 => Plane::Xy,
            180 => Plane::Xz,
            190 => Plane::Yz,
            _ => self.m.plane(),
        });
        if b.g(Group::CoordSystem) != -1 && !(b.has(LETTERS[one]) && b.has(LETTERS[two])) {
            return refuse("with a coordinate system and without both coordinates of the centre");
        }
        let Some(angle) = self.block.get(b'r') else {
            return Err(Fault::new(code::WORD_MISSING, rs274::RT_UNKNOWN_G).arg("G68").arg("R").at(b'g'));
        };
        // Without a centre the present position is it.
        let centre = [one, two].map(|i| self.block.get(LETTERS[i]).unwrap_or(self.m.current[i]));
        self.m.turn = [centre[0], centre[1], angle];
        self.m.turned = 1;
        self.block.present &= !(AXES | letters(b"r"));
        Ok(())
    }

    /// While G68 is on, the words of the plane become those of the work frame.
    pub(crate) fn turn_words(&mut self) -> Res {
        let special = self.block.g(Group::NonModal);
        let system = self.block.g(Group::CoordSystem) != -1;
        if self.block.g(Group::Plane) != -1 || system || !matches!(special, -1 | 40) {
            let what = if special > 0 && special != 40 { crate::check::code_name(special) } else { "a change of plane or coordinate system".into() };
            return Err(Fault::new(code::CODE_NOT_CARRIED_OUT, rs274::RT_UNKNOWN_G).arg(format!("{what} while G68 is on")).arg("Coordinate rotation").at(b'g'));
        }
        let [one, two, _] = plane_axes(self.m.plane());
        let [cx, cy, angle] = self.m.turn;
        let (a, b) = (LETTERS[one], LETTERS[two]);
        if matches!(self.block.motion, 20 | 30) && !self.block.has(b'r') {
            let (i, j) = (CENTRES[one], CENTRES[two]);
            if self.block.has(i) || self.block.has(j) {
                let (mut x, mut y) = (self.block.or_zero(i), self.block.or_zero(j));
                rotate(&mut x, &mut y, angle);
                self.block.set(i, x);
                self.block.set(j, y);
            }
        }
        if !self.block.has(a) && !self.block.has(b) || self.block.motion == -1 {
            return Ok(());
        }
        if self.goes_by_increments() {
            let (mut x, mut y) = (self.block.or_zero(a), self.block.or_zero(b));
            rotate(&mut x, &mut y, angle);
            self.block.set(a, x);
            self.block.set(b, y);
            return Ok(());
        }
        let start = self.start_point();
        let (mut x, mut y) = (start[one] - cx, start[two] - cy);
        rotate(&mut x, &mut y, -angle);
        x = self.block.get(a).map_or(x, |v| v - cx);
        y = self.block.get(b).map_or(y, |v| v - cy);
        rotate(&mut x, &mut y, angle);
        self.block.set(a, x + cx);
        self.block.set(b, y + cy);
        Ok(())
    }
}

fn upper(letter: u8) -> char {
    char::from(letter.to_ascii_uppercase())
}
