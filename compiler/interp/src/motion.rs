//! Straight moves, probing, and where the axis words lead.

use gr_canon::{Axes, Call, Plane, Sink};
use gr_spec::{code, rs274};

use crate::block::{AXES, AXIS_LETTERS, Group, letters};
use crate::check::polar_said;
use crate::exec::not_with_comp;
use crate::angle::{atan2, hypot, sin_cos};
use crate::{Fault, Interp, Res};

const POLAR: u32 = letters(b"@^");

/// Turns a point about the origin by an angle in degrees.
pub(crate) fn rotate(x: &mut f64, y: &mut f64, degrees: f64) {
    let (s, c) = sin_cos(to_radians(degrees));
    (*x, *y) = (*x * c - *y * s, *x * s + *y * c);
}

fn to_radians(degrees: f64) -> f64 {
    degrees * (std::f64::consts::PI / 180.0)
}

fn at_angle(radius: f64, angle: f64) -> (f64, f64) {
    let (s, c) = sin_cos(angle);
    (radius * c, radius * s)
}

/// Length of a straight move as feeds see it: XYZ, or else UVW, or else ABC.
pub(crate) fn straight_length(to: &Axes, from: &Axes) -> f64 {
    let moved = |r: std::ops::Range<usize>| r.clone().any(|i| (from[i] - to[i]).abs() > 1e-7);
    let length = |r: std::ops::Range<usize>| libm::sqrt(r.map(|i| (to[i] - from[i]) * (to[i] - from[i])).sum());
    if moved(0..3) {
        length(0..3)
    } else if moved(6..9) {
        length(6..9)
    } else {
        length(3..6)
    }
}

impl<S: Sink> Interp<'_, S> {
    /// End point of the block's axis words in program units and the active frame.
    #[inline]
    pub(crate) fn find_ends(&mut self) -> Res<Axes> {
        let b = &self.block;
        if b.g_mask & 1 == 0 && self.m.incremental == 0 && self.m.comp_side == 0 && !b.has_any_of(POLAR) && !self.config.wrapped() {
            let mut end = self.m.current;
            for (i, letter) in AXIS_LETTERS.iter().enumerate() {
                if b.has(*letter) {
                    end[i] = b.values[crate::block::slot(*letter)];
                }
            }
            return Ok(end);
        }
        if b.g(Group::NonModal) == 530 {
            return self.ends_in_machine_frame();
        }
        self.ends_in_frame()
    }

    /// The programmed point that words count from.
    pub(crate) fn start_point(&self) -> Axes {
        let m = &self.m;
        let mut start = m.current;
        if m.comp_side != 0 && m.comp_first == 0 {
            start[0] = m.program[0];
            match m.plane {
                1 => start[1] = m.program[1],
                3 => start[2] = m.program[2],
                _ => {}
            }
        }
        start
    }

    fn ends_in_frame(&mut self) -> Res<Axes> {
        let mut end = self.start_point();
        let incremental = self.m.incremental != 0;
        let b = &self.block;
        for (i, letter) in AXIS_LETTERS.iter().enumerate() {
            let Some(v) = b.get(*letter) else { continue };
            end[i] = if incremental {
                end[i] + v
            } else if (3..6).contains(&i) && self.config.wrapped[i - 3] {
                unwrap_rotary(v, v, self.m.current[i], char::from(letter.to_ascii_uppercase()))?
            } else {
                v
            };
        }
        if b.has_any_of(POLAR) {
            self.polar_end(&mut end)?;
        }
        Ok(end)
    }

    fn polar_end(&self, end: &mut Axes) -> Res {
        let b = &self.block;
        let (radius, theta) = (b.get(b'@'), b.get(b'^'));
        let (mut x, mut y) = (end[0], end[1]);
        let at_origin = |x: f64, y: f64| x == 0.0 && y == 0.0;
        if self.m.incremental != 0 {
            if let Some(r) = radius {
                if at_origin(x, y) {
                    return Err(polar_said(rs274::RT_POLAR_INCREMENTAL_ORIGIN, "no direction at the origin"));
                }
                let t = atan2(y, x);
                let r = hypot(y, x) + r;
                (x, y) = at_angle(r, t);
            }
            if let Some(t) = theta {
                if at_origin(x, y) {
                    return Err(polar_said(rs274::RT_POLAR_G91_ORIGIN, "no direction at the origin"));
                }
                let t = atan2(y, x) + to_radians(t);
                let r = hypot(y, x);
                (x, y) = at_angle(r, t);
            }
        } else {
            let (r, t) = match (radius, theta) {
                (Some(r), Some(t)) => (r, to_radians(t)),
                (Some(_), None) if at_origin(x, y) => {
                    return Err(polar_said(rs274::RT_POLAR_ANGLE_AT_ORIGIN, "the angle ^ is needed at the origin"));
                }
                (Some(r), None) => (r, atan2(y, x)),
                (None, t) => (hypot(y, x), to_radians(t.unwrap_or(0.0))),
            };
            (x, y) = at_angle(r, t);
        }
        (end[0], end[1]) = (x, y);
        Ok(())
    }

    /// G53: the words are machine coordinates.
    fn ends_in_machine_frame(&mut self) -> Res<Axes> {
        let m = &self.m;
        let b = &self.block;
        if b.has_any_of(POLAR) {
            return Err(Fault::new(code::MOTION_G53, rs274::RT_POLAR_G53).arg("takes no polar words"));
        }
        let mut end = m.current;
        let (mut x, mut y) = (m.current[0] + m.g92[0], m.current[1] + m.g92[1]);
        rotate(&mut x, &mut y, m.rotation);
        if let Some(v) = b.get(b'x') {
            x = v - m.origin[0] - m.tool_offset[0];
        }
        if let Some(v) = b.get(b'y') {
            y = v - m.origin[1] - m.tool_offset[1];
        }
        rotate(&mut x, &mut y, -m.rotation);
        (end[0], end[1]) = (x - m.g92[0], y - m.g92[1]);
        if let Some(v) = b.get(b'z') {
            end[2] = v - m.origin[2] - m.g92[2] - m.tool_offset[2];
        }
        for i in 3..6 {
            let Some(v) = b.get(AXIS_LETTERS[i]) else { continue };
            end[i] = if self.config.wrapped[i - 3] {
                let to = v - m.origin[i] - m.g92[i] - m.tool_offset[i];
                unwrap_rotary(v, to, m.current[i], char::from(AXIS_LETTERS[i].to_ascii_uppercase()))?
            } else {
                v - m.origin[i] - m.g92[i]
            };
        }
        for i in 6..9 {
            if let Some(v) = b.get(AXIS_LETTERS[i]) {
                end[i] = v - m.origin[i] - m.g92[i] - m.tool_offset[i];
            }
        }
        Ok(end)
    }

    /// G0, G1; also the start of G33, G33.1 and G76.
    #[inline]
    pub(crate) fn convert_straight(&mut self, motion: i16) -> Res {
        self.m.arc_not_allowed = 0;
        if motion == 10 && (self.m.feed_mode != 0 || self.m.feed == 0.0) {
            self.check_feed()?;
        }
        self.m.motion = i32::from(motion);
        let end = self.find_ends()?;
        if motion == 10 && self.m.feed_mode == 1 {
            self.inverse_time_straight(&end);
        }
        if self.m.comp_side != 0 && self.m.comp_radius > 0.0 {
            if self.block.g(Group::NonModal) == 530 {
                let what = "is not possible while cutter compensation is on";
                return Err(Fault::new(code::MOTION_G53, rs274::RT_G53_COMP).arg(what));
            }
            if !matches!(self.m.plane(), Plane::Xy | Plane::Xz) {
                // G17.1, G18.1 and G19.1 are let through while compensation is on.
                return Err(Fault::new(code::COMP_NOT_HERE, rs274::COMP_BUG_STRAIGHT).arg("the working plane is neither G17 nor G18"));
            }
            return if self.m.comp_first != 0 {
                self.convert_straight_comp1(motion, end)
            } else {
                self.convert_straight_comp2(motion, end)
            };
        }
        match motion {
            0 => self.emit(Call::StraightTraverse(end)),
            10 => self.emit(Call::StraightFeed(end)),
            330 | 331 => return self.convert_spindle_sync(motion, end),
            _ => return self.convert_thread(end),
        }
        self.m.current = end;
        Ok(())
    }

    pub(crate) fn check_feed(&self) -> Res {
        let fault = |rs, what: &str| Err(Fault::new(code::FEED_MISSING, rs).arg(what));
        match self.m.feed_mode {
            1 if !self.block.has(b'f') => fault(rs274::RT_INVERSE_F_MISSING, "with G93 every feed move needs its own F"),
            1 => Ok(()),
            _ if self.m.feed == 0.0 => fault(rs274::RT_G1_ZERO_FEED, "no feed is programmed"),
            2 if self.m.speed[self.m.active_spindle.clamp(0, 7) as usize] == 0.0 => {
                fault(rs274::RT_REV_ZERO_SPEED, "feed per revolution (G95), but the spindle speed is zero")
            }
            _ => Ok(()),
        }
    }

    fn inverse_time_straight(&mut self, end: &Axes) {
        let mut from = self.m.current;
        if self.m.comp_side != 0 && self.m.comp_radius > 0.0 && self.m.comp_first == 0 {
            from[..3].copy_from_slice(&self.m.program);
        }
        let rate = (straight_length(end, &from) * self.block.or_zero(b'f')).max(0.1);
        self.emit_queued(Call::SetFeedRate(rate));
        self.m.feed = rate;
    }

    /// G38.2 … G38.5.
    pub(crate) fn convert_probe(&mut self, motion: i16) -> Res {
        let kind = (motion - 382) as u8;
        not_with_comp(self.m.comp_side, rs274::RT_PROBE_COMP, "probing")?;
        if self.m.feed == 0.0 {
            return Err(Fault::new(code::FEED_MISSING, rs274::RT_PROBE_ZERO_FEED).arg("probing needs a feed"));
        }
        if self.m.feed_mode == 2 {
            let what = "probing is not possible with feed per revolution (G95)";
            return Err(Fault::new(code::FEED_MISSING, rs274::RT_PROBE_PER_REV).arg(what));
        }
        let end = self.find_ends()?;
        if self.m.current == end {
            if kind & 1 == 0 {
                return Err(Fault::new(code::PROBE_NO_TRAVEL, rs274::RT_PROBE_CLOSE));
            }
            self.warn(Fault::own(code::PROBE_NO_TRAVEL));
        }
        for i in (0..6).filter(|i| self.m.current[*i] != end[*i]) {
            self.m.loose |= 1 << i;
        }
        self.emit(Call::TurnProbeOn);
        self.emit(Call::StraightProbe(end, kind));
        self.emit(Call::TurnProbeOff);
        self.m.motion = i32::from(motion);
        self.m.probed = 1;
        Ok(())
    }

    /// A block moves from where a probe stopped: straight moves to named places leave that behind, all others rest on it.
    #[cold]
    pub(crate) fn leaves_probed(&mut self, straight: bool) {
        let b = &self.block;
        let absolute = self.m.incremental == 0 || b.g(Group::NonModal) == 530;
        if straight && absolute && !b.has_any_of(POLAR) && self.m.comp_side == 0 {
            let named = (0..6).filter(|i| b.has(AXIS_LETTERS[*i])).fold(0, |mask, i| mask | 1u8 << i);
            self.m.loose &= !named;
        }
        self.rests_on_probed();
    }

    /// A block sends axes to places, of the machine or of the work frame.
    #[cold]
    pub(crate) fn park(&mut self, machine: bool) {
        let named = (0..3).filter(|i| self.block.has(AXIS_LETTERS[*i])).fold(0, |mask, i| mask | 1u8 << i);
        if machine {
            self.m.parked |= named;
        } else if self.m.incremental == 0 {
            self.m.parked &= !named;
        }
    }

    /// What follows depends on where a probe stopped, if that still shows.
    pub(crate) fn rests_on_probed(&mut self) {
        if self.m.loose != 0 {
            self.m.loose = 0;
            self.mark_runtime("where the probe stopped");
        }
    }

    /// Takes down a doubt about the present block.
    pub(crate) fn warn(&mut self, fault: Box<Fault>) {
        if self.findings.len() < 10_000 {
            self.found(fault);
        }
    }

    /// Whether the block has any axis word.
    pub(crate) fn has_axes(&self) -> bool {
        self.block.has_any_of(AXES)
    }

    /// Results of probes, tool changes and inputs become readable.
    #[cold]
    pub(crate) fn read_inputs(&mut self) {
        if self.m.probed != 0 {
            self.mark_runtime("probe");
            self.m.stand_ins |= 2;
            self.refresh_position();
            for i in 0..9 {
                let v = if i < 6 { self.world.probed[i] } else { 0.0 };
                let wrapped = (3..6).contains(&i) && self.config.wrapped[i - 3];
                self.write_param(5061 + i as u32, if wrapped { turn_of(v) } else { v });
            }
            self.write_param(5070, 0.0);
            self.m.probed = 0;
        }
        if self.m.tool_changed != 0 {
            // A tool change leaves the axes where they are. `rs274` asks its stand-in, which knows of no tool offset: one
            // set by G43 in the block of the change is forgotten there, and not at a machine.
            if self.is_rs274() {
                self.refresh_position();
            }
            self.load_tool_table();
            self.m.tool_changed = 0;
        }
        if self.m.input_wanted != 0 {
            // Whoever reads it marks what follows: a wait alone changes nothing.
            self.m.stand_ins |= 1;
            let old = self.params.get(5399);
            if self.m.input_wanted == 1 {
                self.write_param(5399, if old != 0.0 { 1.0 } else { 0.0 });
            }
            self.m.input_wanted = 0;
        }
    }

    fn refresh_position(&mut self) {
        self.m.current[..6].copy_from_slice(&self.world.position);
        self.m.current[6..].fill(0.0);
    }
}

/// An angle within one turn.
pub(crate) fn turn_of(v: f64) -> f64 {
    let v = libm::fmod(v, 360.0);
    if v < 0.0 { v + 360.0 } else { v }
}

/// Where a wrapped rotary axis goes: the sign of the word says which way.
pub(crate) fn unwrap_rotary(sign_of: f64, to: f64, current: f64, axis: char) -> Res<f64> {
    if sign_of <= -360.0 || sign_of >= 360.0 {
        return Err(Fault::new(code::AXIS_WRAPPED, rs274::RT_WRAPPED_AXIS).arg(format!("{sign_of:5.2}")).arg(axis));
    }
    let negative = sign_of.is_sign_negative();
    let mut result = to.abs() + libm::floor(current / 360.0) * 360.0;
    if !negative && result < current {
        result += 360.0;
    }
    if negative && result > current {
        result -= 360.0;
    }
    Ok(result)
}
