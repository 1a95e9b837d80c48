//! Which words go together: the motion a block implies, and words that no code of the block uses.

use gr_canon::Sink;
use gr_spec::{Code, Rs274, code, rs274};

use crate::block::{AXES, Group, letters};
use crate::eval::{nearest_int, to_int};
use crate::{Fault, Interp, Res};

const POLAR: u32 = letters(b"@^");
const IJK: u32 = letters(b"ijk");
/// Words that need a code of their own.
const GUESTS: u32 = letters(b"d$ehijklpqr");

/// Whether a motion is a canned cycle.
pub(crate) fn is_cycle(motion: i16) -> bool {
    (motion > 800 && motion < 900) || motion == 730 || motion == 740
}

fn roughing(motion: i16) -> bool {
    matches!(motion, 710 | 711 | 712 | 720 | 721 | 722)
}

fn fault(code: Code, rs: Rs274, arg: &str) -> Box<Fault> {
    Fault::new(code, rs).arg(arg)
}

fn polar(rs: Rs274) -> Box<Fault> {
    fault(code::MOTION_POLAR, rs, "")
}

/// `G38.2` for 382.
pub(crate) fn code_name(code: i16) -> String {
    if code % 10 == 0 { format!("G{}", code / 10) } else { format!("G{}.{}", code / 10, code % 10) }
}

impl<S: Sink> Interp<'_, S> {
    /// Finds out which motion the block makes.
    #[inline]
    pub(crate) fn enhance(&mut self) -> Res {
        let b = &self.block;
        if b.g_mask & 1 == 0 && !b.has_any_of(POLAR) {
            let motion = b.g(Group::Motion);
            if b.has_any_of(AXES) {
                if (0..=30).contains(&motion) {
                    self.block.motion = motion;
                    return Ok(());
                }
                if motion == -1 && (0..=30).contains(&self.m.motion) && b.g(Group::ToolLength) == -1 {
                    self.block.motion = self.m.motion as i16;
                    return Ok(());
                }
            } else if motion == -1 && !b.has_any_of(IJK) {
                return Ok(());
            }
        }
        self.enhance_slow()
    }

    fn check_polar(&self) -> Res {
        let b = &self.block;
        if self.m.plane != 1 {
            return Err(polar_said(rs274::RT_POLAR_PLANE, "only in the XY plane (G17)"));
        }
        if b.has(b'x') {
            return Err(polar_said(rs274::RT_POLAR_AND_X, "not together with X").at(b'x'));
        }
        if b.has(b'y') {
            return Err(polar_said(rs274::RT_POLAR_AND_Y, "not together with Y").at(b'y'));
        }
        Ok(())
    }

    /// G91, in this block or before.
    pub(crate) fn goes_by_increments(&self) -> bool {
        match self.block.g(Group::Distance) {
            910 => true,
            900 => false,
            _ => self.m.incremental != 0,
        }
    }

    /// G4 of a Fanuc control: P in milliseconds, X (or U on a lathe) in seconds.
    fn fanuc_dwell(&mut self) {
        // X has been halved as a diameter; these are seconds.
        let whole = if self.m.lathe_diameter != 0 { 2.0 } else { 1.0 };
        let b = &mut self.block;
        let seconds = b.get(b'p').map(|p| p / 1000.0).or(b.get(b'x').map(|x| x * whole)).or(b.get(b'u'));
        b.unset(b'x');
        b.unset(b'u');
        if let Some(seconds) = seconds {
            b.set(b'p', seconds);
        }
    }

    fn enhance_slow(&mut self) -> Res {
        if self.block.g(Group::NonModal) == 40 && self.is_fanuc() {
            self.fanuc_dwell();
        }
        let b = &self.block;
        let is_polar = b.has_any_of(POLAR);
        if is_polar {
            self.check_polar()?;
        }
        let b = &self.block;
        let axes = b.has_any_of(AXES);
        let special = b.g(Group::NonModal);
        let covets = matches!(special, 100 | 280 | 300 | 520 | 920);
        let motion = b.g(Group::Motion);
        let motion_only = || polar_said(rs274::RT_POLAR_MOTION_ONLY, "only for motion");
        let name = code_name(special.max(0));
        // On a Fanuc control G92 S is the highest speed of the spindle.
        let clamps = special == 920 && self.is_fanuc() && b.has(b's');
        let missing = || fault(code::AXIS_MISSING, rs274::RT_AXIS_MISSING_G92, &name).at(b'g');
        if motion == 800 {
            if (is_polar || axes) && !covets {
                return Err(Fault::new(code::AXIS_NO_CODE, rs274::RT_AXIS_WITH_G80));
            }
            if is_polar && special == 920 {
                return Err(motion_only());
            }
            if !axes && (special == 520 || special == 920) && !clamps {
                return Err(missing());
            }
            self.block.motion = motion;
        } else if motion != -1 {
            if covets {
                return Err(Fault::new(code::AXIS_TWO_USERS, rs274::RT_AXIS_TWO_CODES));
            }
            let without = matches!(motion, 0 | 10 | 20 | 30 | 52 | 62 | 700) || roughing(motion);
            if !axes && !is_polar && !without && !self.is_user_g(motion) {
                return Err(fault(code::AXIS_MISSING, rs274::RT_AXIS_MISSING_MOTION, &code_name(motion)).at(b'g'));
            }
            self.block.motion = motion;
        } else if covets {
            if is_polar && special == 920 {
                return Err(motion_only());
            }
            if !axes && (special == 520 || special == 920) && !clamps {
                return Err(missing());
            }
        } else if axes || is_polar {
            let length = b.g(Group::ToolLength);
            if matches!(self.m.motion, -1 | 800) && length != 431 && length != 432 {
                let letter = crate::block::AXIS_LETTERS.iter().find(|l| b.has(**l));
                let f = Fault::new(code::AXIS_NO_CODE, rs274::RT_AXIS_NO_CODE);
                return Err(match letter {
                    Some(l) => f.at(*l),
                    None => f,
                });
            }
            if length != 431 {
                self.block.motion = self.m.motion as i16;
            }
        } else if b.has_any_of(IJK) && matches!(self.m.motion, 20 | 30) {
            self.block.motion = self.m.motion as i16;
        }
        if is_polar && self.block.motion == -1 {
            return Err(motion_only());
        }
        Ok(())
    }

    /// Checks the whole block.
    #[inline]
    pub(crate) fn check(&mut self) -> Res {
        let b = &self.block;
        let rare_motion = !matches!(b.motion, -1 | 0 | 10 | 20 | 30);
        if b.g_mask & !(1 << 1) == 0 && b.m_count <= 4 && !b.has_any_of(GUESTS) && !rare_motion {
            return Ok(());
        }
        self.check_g()?;
        if self.block.m_count > 4 {
            return Err(Fault::new(code::CODE_TOO_MANY_M, rs274::RT_TOO_MANY_M).at(b'm'));
        }
        self.check_words()
    }

    fn check_g(&self) -> Res {
        let b = &self.block;
        let motion = b.g(Group::Motion);
        match b.g(Group::NonModal) {
            -1 => Ok(()),
            40 => {
                if b.or_minus_one(b'p') == -1.0 {
                    // -1 is how the controller writes "no P".
                    return Err(if b.has(b'p') {
                        bad_value(rs274::RT_G4_P_MISSING, "G4", 'P')
                    } else {
                        fault(code::WORD_MISSING, rs274::RT_G4_P_MISSING, "G4").arg("P").at(b'g')
                    });
                }
                if motion == 20 || motion == 30 {
                    return Err(fault(code::AXIS_TWO_USERS, rs274::RT_G4_WITH_ARC, ""));
                }
                Ok(())
            }
            100 => self.check_g10(),
            280 | 300 | 281 | 301 | 520 | 920 => Ok(()),
            53 if motion != 52 && motion != -1 => {
                Err(fault(code::CODE_SAME_GROUP, rs274::RT_G52_BETWEEN_G53, "G").at(b'g'))
            }
            53 => Ok(()),
            _ if motion == 52 || motion == 62 => Ok(()),
            530 => {
                if b.motion != 0 && b.motion != 10 {
                    return Err(fault(code::MOTION_G53, rs274::RT_G53_MOTION, "needs G0 or G1").at(b'g'));
                }
                // grbl takes machine coordinates as they are under G91 too (1.1, gcode.c).
                if self.goes_by_increments() && self.setup.dialect.family != gr_spec::Family::Grbl {
                    let f = fault(code::MOTION_G53, rs274::RT_G53_INCREMENTAL, "is not possible in incremental mode");
                    return Err(f.at(b'g'));
                }
                Ok(())
            }
            _ => Err(Fault::new(code::CODE_UNKNOWN, rs274::RT_BUG_MODAL_0).named("this".into())),
        }
    }

    fn check_g10(&self) -> Res {
        let b = &self.block;
        let p = b.or_minus_one(b'p');
        let p_int = if p >= 0.0 { to_int(p + 0.5) } else { to_int(p - 0.5) };
        let l = to_int(b.or_minus_one(b'l'));
        let bad = |rs, what: String, letter: u8| {
            Err(Fault::new(code::WORD_BAD_VALUE, rs).arg(l).own_args(&[&what, &char::from(letter).to_string()]).at(letter.to_ascii_lowercase()))
        };
        let absent = |rs, what: &str, letter: &str| {
            Err(Fault::new(code::WORD_MISSING, rs).arg(l).own_args(&[what, letter]).at(b'g'))
        };
        if !b.has(b'l') {
            return absent(rs274::RT_G10_L, "G10", "L");
        }
        if ![0, 1, 2, 10, 11, 20].contains(&l) {
            return bad(rs274::RT_G10_L, "G10".into(), b'L');
        }
        if p + 0.0001 - f64::from(p_int) > 0.0002 {
            return bad(rs274::RT_G10_P_INTEGER, format!("G10 L{l}"), b'P');
        }
        if l != 0 && !b.has(b'p') {
            let system = l == 2 || l == 20;
            let rs = if system { rs274::RT_G10_P_RANGE_SYSTEM } else { rs274::RT_G10_P_RANGE_TOOL };
            return absent(rs, &format!("G10 L{l}"), "P");
        }
        if (l == 2 || l == 20) && !(0..=9).contains(&p_int) {
            return bad(rs274::RT_G10_P_RANGE_SYSTEM, format!("G10 L{l}"), b'P');
        }
        if matches!(l, 1 | 10 | 11) && p_int < 1 {
            return bad(rs274::RT_G10_P_RANGE_TOOL, format!("G10 L{l}"), b'P');
        }
        Ok(())
    }

    fn check_words(&self) -> Res {
        let b = &self.block;
        let motion = b.motion;
        if self.is_user_g(motion) || self.has_user_m() {
            return Ok(());
        }
        let cycle = is_cycle(motion);
        let unused = |rs, letter: u8| {
            Err(Fault::new(code::WORD_UNUSED, rs).arg(char::from(letter.to_ascii_uppercase())).at(letter))
        };
        // A Fanuc control turns them on the way to the hole (0i/30i operator's manual, machining center, canned cycles).
        if cycle && !self.is_fanuc() {
            for (letter, rs) in [(b'a', rs274::RT_A_IN_CYCLE), (b'b', rs274::RT_B_IN_CYCLE), (b'c', rs274::RT_C_IN_CYCLE)] {
                if b.has(letter) {
                    return unused(rs, letter);
                }
            }
        }
        let special = b.g(Group::NonModal);
        let comp = b.g(Group::CutterComp);
        let comp_on = matches!(comp, 410 | 411 | 420 | 421);
        let css = b.g(Group::SpindleMode) == 960;
        let (m5, m6, m7, m9) = (b.m[5], b.m[6], b.m[7], b.m[9]);
        let rough = roughing(motion);
        let length = b.g(Group::ToolLength);
        let path = b.g(Group::PathControl) == 640;
        let user_m = b.user_m >= 0;
        let eighties = (810..=890).contains(&motion);
        let new = self.setup.version == gr_canon::Version::V2_10;
        // 2.10 lets a peck drilling cycle say its clearance.
        let peck = matches!(motion, 730 | 830) && new;
        if b.has(b'd') && !(comp_on || motion == 700 || rough || css || peck) {
            return unused(if new { rs274::RT_D_UNUSED_NEW } else { rs274::RT_D_UNUSED }, b'd');
        }
        if b.has(b'$')
            && !(matches!(motion, 760 | 330 | 331 | 950 | 960 | 970)
                || matches!(m7, 3 | 4 | 5 | 19)
                || m9 == 51
                || b.has(b's'))
        {
            return unused(rs274::RT_DOLLAR_UNUSED, b'$');
        }
        if b.has(b'e') && !(matches!(motion, 760 | 330 | 331 | 700) || matches!(m5, 66..=68)) {
            return unused(rs274::RT_E_UNUSED, b'e');
        }
        if b.has(b'h') && !(length == 430 || motion == 760 || length == 432) {
            return unused(rs274::RT_H_UNUSED, b'h');
        }
        if b.has(b'i') && !(matches!(motion, 20 | 30 | 50 | 51 | 60 | 61 | 760 | 870 | 331) || rough || special == 100) {
            return unused(if new { rs274::RT_I_UNUSED_NEW } else { rs274::RT_I_UNUSED }, b'i');
        }
        if b.has(b'j') && !(matches!(motion, 20 | 30 | 50 | 51 | 60 | 61 | 760 | 870) || special == 100) {
            return unused(if new { rs274::RT_J_UNUSED_NEW } else { rs274::RT_J_UNUSED }, b'j');
        }
        let repeats = cycle && self.is_fanuc();
        if b.has(b'k') && !matches!(motion, 20 | 30 | 62 | 330 | 331 | 760 | 870) && !repeats {
            return unused(if new { rs274::RT_K_UNUSED_NEW } else { rs274::RT_K_UNUSED }, b'k');
        }
        if b.has(b'l') && repeats {
            return Err(self.not_in_dialect("L as the number of repeats of a cycle", "write K").at(b'l'));
        }
        if b.has(b'l')
            && !(eighties || matches!(motion, 760 | 52 | 62 | 730) || special == 100 || comp_on || m5 == 66 || self.m98)
        {
            return unused(rs274::RT_L_UNUSED, b'l');
        }
        if b.has(b'p') {
            let used = matches!(special, 100 | 40)
                || path
                || matches!(motion, 760 | 820 | 860 | 880 | 890 | 50 | 52 | 60 | 62 | 700 | 20 | 30 | 740 | 840)
                || matches!(m9, 50..=53)
                || matches!(m5, 62..=66)
                || m7 == 19
                || user_m
                || self.m98
                || self.is_fanuc() && b.m[4] == 99;
            if !used {
                return unused(if new { rs274::RT_P_UNUSED_NEW } else { rs274::RT_P_UNUSED }, b'p');
            }
            self.check_p_value(motion, m7)?;
        }
        if b.or_minus_one(b'q') != -1.0 {
            let used = matches!(motion, 830 | 730 | 50 | 60 | 62 | 760 | 700)
                || rough
                || user_m
                || matches!(m5, 66..=68)
                || special == 100
                || m6 == 61
                || path
                || m7 == 19;
            if !used {
                return unused(if new { rs274::RT_Q_UNUSED_NEW } else { rs274::RT_Q_UNUSED }, b'q');
            }
        }
        if b.has(b'r') {
            let used = matches!(motion, 20 | 30 | 62 | 760 | 730 | 740)
                || rough
                || eighties
                || crate::turning::is_turning(motion)
                || matches!(comp, 411 | 421)
                || special == 100
                || m7 == 19;
            // 2.10: G64 chooses the planner with R.
            let planner = path && new;
            if !used && !planner {
                return unused(rs274::RT_R_UNUSED, b'r');
            }
            if planner && m7 == 19 {
                return Err(fault(code::AXIS_TWO_USERS, rs274::RT_R_AMBIGUOUS, "").at(b'r'));
            }
            if m7 == 19 && !(0.0..=360.0).contains(&b.or_zero(b'r')) {
                return Err(bad_value(rs274::RT_M19_R, "M19", 'R'));
            }
        }
        if !b.has(b's') && css {
            return Err(missing(rs274::RT_S_MISSING_G96, "G96", 'S'));
        }
        if motion == 330 || motion == 331 {
            if !b.has(b'k') {
                return Err(missing(rs274::RT_K_MISSING_G33, &code_name(motion), 'K'));
            }
            if b.has(b'f') {
                return unused(rs274::RT_F_WITH_G33, b'f');
            }
        }
        if motion == 760 {
            if b.or_minus_one(b'p') == -1.0 {
                return Err(missing(rs274::RT_P_MISSING_G76, "G76", 'P'));
            }
            if !(b.has(b'i') && b.has(b'j') && b.has(b'k')) {
                return Err(Fault::new(code::WORD_MISSING, rs274::RT_IJK_MISSING_G76).arg("G76").arg("I, J and K").at(b'g'));
            }
        }
        Ok(())
    }

    fn check_p_value(&self, motion: i16, m7: i16) -> Res {
        let p = self.block.or_zero(b'p');
        let n = nearest_int(p);
        let arc = motion == 20 || motion == 30;
        let what = if m7 == 19 { "M19".to_string() } else { code_name(motion.max(0)) };
        if (arc || m7 == 19) && (f64::from(n) - p).abs() > 0.001 {
            return Err(bad_value(rs274::RT_P_NOT_INTEGER, &what, 'P'));
        }
        if m7 == 19 && !(0..=2).contains(&n) {
            return Err(bad_value(rs274::RT_M19_P, &what, 'P'));
        }
        if arc && n < 1 {
            return Err(bad_value(rs274::RT_ARC_P, &what, 'P'));
        }
        Ok(())
    }
}

/// A polar fault with our own words.
pub(crate) fn polar_said(rs: Rs274, what: &str) -> Box<Fault> {
    polar(rs).named(what.into())
}

/// A word with a value that a code does not take.
pub(crate) fn bad_value(rs: Rs274, code_name: &str, letter: char) -> Box<Fault> {
    Fault::new(code::WORD_BAD_VALUE, rs).arg(code_name).arg(letter).at(letter.to_ascii_lowercase() as u8)
}

fn missing(rs: Rs274, code_name: &str, letter: char) -> Box<Fault> {
    Fault::new(code::WORD_MISSING, rs).arg(code_name).arg(letter).at(b'g')
}
