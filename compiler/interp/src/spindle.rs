//! M-codes and the spindle words: outputs, inputs, tool change, spindles, coolant, overrides, saved modes.

use gr_canon::{Call, Sink, Units};
use gr_spec::{Rs274, code, rs274};

use crate::block::Group;
use crate::eval::{nearest_int, to_int};
use crate::exec::not_with_comp;
use crate::remap::step;
use crate::{Fault, Interp, Res};

impl<S: Sink> Interp<'_, S> {
    fn dollar(&self) -> Option<i32> {
        self.block.get(b'$').map(to_int)
    }

    fn no_spindle(number: i32, rs: Rs274) -> Box<Fault> {
        Fault::new(code::SPINDLE_NUMBER, rs).arg(number).at(b'$')
    }

    /// `$` with a spindle or feed mode makes a spindle the active one.
    pub(crate) fn select_spindle(&mut self, rs: Rs274) -> Res {
        self.m.active_spindle = 0;
        if let Some(n) = self.dollar() {
            if n < 0 || n >= self.config.spindles {
                return Err(Self::no_spindle(n, rs));
            }
            self.m.active_spindle = n;
        }
        Ok(())
    }

    /// G96, G97.
    pub(crate) fn convert_spindle_mode(&mut self) {
        let s = self.m.active_spindle;
        let css = self.block.g(Group::SpindleMode) == 960;
        let changed = std::mem::replace(&mut self.m.css[s as usize], u8::from(css)) != u8::from(css);
        let limit = match self.block.get(b'd') {
            _ if !css => 0.0,
            Some(d) => d.abs(),
            None if self.m.spindle_clamp > 0.0 => self.m.spindle_clamp,
            None => 1e30,
        };
        // G96 has an S always.
        let held = (changed && !css && !self.block.has(b's')).then(|| self.speed_held(s as usize)).filter(|n| *n != 0.0);
        self.emit_queued(Call::SetSpindleMode(s, limit, held));
    }

    /// The S that counts after G97 without one: the number as it stands. A Fanuc control goes on at the rpm it has just then.
    fn speed_held(&mut self, s: usize) -> f64 {
        if self.is_fanuc() {
            // m/min or feet/min at the radius of X.
            let around = std::f64::consts::TAU * self.m.current[0].abs();
            let rpm = self.m.speed[s] * if self.m.units() == Units::Inch { 12.0 } else { 1000.0 } / around;
            let rpm = if self.m.spindle_clamp > 0.0 { rpm.min(self.m.spindle_clamp) } else { rpm };
            if rpm.is_finite() {
                self.m.speed[s] = rpm;
            }
        }
        self.m.speed[s]
    }

    /// S.
    pub(crate) fn convert_speed(&mut self) -> Res {
        let speed = self.block.or_zero(b's');
        let n = self.dollar().unwrap_or(0);
        if n < -1 || n >= self.config.spindles {
            return Err(Self::no_spindle(n, rs274::RT_SPINDLE_SPEED));
        }
        for s in self.spindles_of(n) {
            self.emit_queued(Call::SetSpindleSpeed(s, speed));
            self.m.speed[s as usize] = speed;
        }
        Ok(())
    }

    fn spindles_of(&self, n: i32) -> std::ops::Range<i32> {
        if n == -1 { 0..self.config.spindles } else { n..n + 1 }
    }

    /// All M-codes but stops. True: a remap took over.
    pub(crate) fn convert_m(&mut self) -> Res<bool> {
        if self.block.m[5] != -1 && self.block.once(step::M5) {
            if self.remapped(step::M5) {
                return self.call_remap(step::M5, 'M', self.block.m[5].into()).map(|()| true);
            }
            self.convert_io(self.block.m[5])?;
        }
        if self.block.m[6] != -1 && self.block.once(step::M6) {
            if self.remapped(step::M6) {
                return self.call_remap(step::M6, 'M', self.block.m[6].into()).map(|()| true);
            }
            match self.block.m[6] {
                6 => self.convert_tool_change()?,
                61 => self.convert_tool_number()?,
                _ => {}
            }
        }
        if self.config.retain_g43 {
            self.retain_length()?;
        }
        for (group, bit) in [(7, step::M7), (8, step::M8), (9, step::M9), (10, step::M10)] {
            let m = self.block.m[group];
            if m == -1 || !self.block.once(bit) {
                continue;
            }
            if self.remapped(bit) {
                return self.call_remap(bit, 'M', m.into()).map(|()| true);
            }
            match group {
                7 => self.convert_spindle(m)?,
                8 => self.convert_coolant(m),
                9 => self.convert_override(m)?,
                _ => self.convert_user_m(m)?,
            }
        }
        Ok(false)
    }

    fn remapped(&self, bit: u32) -> bool {
        self.block.remapped & (1 << bit) != 0
    }

    fn convert_user_m(&mut self, m: i16) -> Res {
        if !self.setup.user_m_codes {
            let fault = Fault::new(code::CODE_UNKNOWN, rs274::RT_UNKNOWN_M).arg(m);
            return Err(fault.named(format!("M{m}")).at(b'm'));
        }
        let (p, q) = (self.block.or_minus_one(b'p'), self.block.or_minus_one(b'q'));
        self.emit_queued(Call::UserM(m.into(), p, q));
        Ok(())
    }

    /// M62 … M68.
    fn convert_io(&mut self, m: i16) -> Res {
        if m == 66 {
            return self.convert_wait();
        }
        let (rs, what) = match m {
            62 => (rs274::RT_COMP_MOTION_OUTPUT, "an output"),
            63 => (rs274::RT_COMP_MOTION_DIGITAL, "an output"),
            67 => (rs274::RT_COMP_MOTION_ANALOG, "an output"),
            68 => (rs274::RT_COMP_AUX_ANALOG, "an output"),
            _ => (rs274::RT_COMP_AUX_DIGITAL, "an output"),
        };
        not_with_comp(self.m.comp_side, rs, what)?;
        if m < 66 {
            let Some(p) = self.block.get(b'p') else {
                let fault = Fault::new(code::IO_WORDS, rs274::RT_M62_P).arg(m);
                return Err(fault.named(format!("M{m} needs a P word, the number of the output")).at(b'm'));
            };
            let p = nearest_int(p);
            self.emit(match m {
                62 => Call::SetMotionOutputBit(p),
                63 => Call::ClearMotionOutputBit(p),
                64 => Call::SetAuxOutputBit(p),
                _ => Call::ClearAuxOutputBit(p),
            });
            return Ok(());
        }
        let e = self.block.get(b'e').map(nearest_int).filter(|e| *e >= 0);
        let Some(e) = e else {
            let fault = Fault::new(code::IO_WORDS, rs274::RT_M67_E).arg(m);
            return Err(fault.named(format!("M{m} needs an E word, the number of the output")).at(b'm'));
        };
        if !self.block.has(b'q') {
            self.warn(Fault::own(code::WORD_LEFT_OUT).arg(format!("M{m}")).arg("Q").arg(format!("sets output {e} to −1")).at(b'm'));
        }
        let q = self.block.or_minus_one(b'q');
        self.emit(if m == 67 { Call::SetMotionOutputValue(e, q) } else { Call::SetAuxOutputValue(e, q) });
        Ok(())
    }

    fn convert_wait(&mut self) -> Res {
        let b = &self.block;
        let (p, e) = (b.get(b'p').map(nearest_int), b.get(b'e').map(nearest_int));
        let l = b.get(b'l').map(nearest_int);
        let q = b.or_minus_one(b'q');
        let fault = |rs, what: &str| Err(Fault::new(code::IO_WORDS, rs).arg(what).at(b'm'));
        if p.is_some() && e.is_some() {
            return fault(rs274::RT_M66_BOTH, "M66 takes P (digital) or E (analog), not both");
        }
        if q <= 0.0 && l.is_some_and(|l| l > 0) {
            return fault(rs274::RT_M66_TIMEOUT, "M66 needs a time limit Q when it waits (L1 to L4)");
        }
        if e.is_some() && l.is_some_and(|l| l != 0) {
            return fault(rs274::RT_M66_ANALOG_WAIT, "M66 can't wait for an analog input: only L0 is possible with E");
        }
        if p.is_some_and(|p| p < 0) || e.is_some_and(|e| e < 0) || (p.is_none() && e.is_none()) {
            return fault(rs274::RT_M66_NONE, "M66 needs P or E, the number of the input");
        }
        let comp = self.m.comp_side;
        if let Some(p) = p {
            not_with_comp(comp, rs274::RT_COMP_WAIT_DIGITAL, "waiting for an input")?;
            self.emit(Call::WaitInput(p, true, l.unwrap_or(0), q.max(0.0)));
            self.m.input_wanted = 1;
        } else if let Some(e) = e {
            not_with_comp(comp, rs274::RT_COMP_WAIT_ANALOG, "waiting for an input")?;
            self.emit(Call::WaitInput(e, false, 0, 0.0));
            self.m.input_wanted = 2;
        }
        Ok(())
    }

    /// M3, M4, M5, M19, M70 … M73.
    fn convert_spindle(&mut self, m: i16) -> Res {
        match m {
            3..=5 => {
                let n = self.dollar().unwrap_or(0);
                if n >= self.config.spindles || n < -1 {
                    let fault = Fault::new(code::SPINDLE_NUMBER, rs274::RT_SPINDLE_M3).arg(m).arg(self.config.spindles);
                    return Err(fault.arg(n).named(n.to_string()).at(b'$'));
                }
                for s in self.spindles_of(n) {
                    self.emit_queued(match m {
                        3 => Call::StartSpindleClockwise(s),
                        4 => Call::StartSpindleCounterclockwise(s),
                        _ => Call::StopSpindleTurning(s),
                    });
                    self.m.turning[s as usize] = [1, 2, 0][m as usize - 3];
                }
                Ok(())
            }
            19 => self.convert_orient(),
            70 | 73 => {
                self.save_modes(m == 73);
                Ok(())
            }
            71 => {
                self.forget_modes();
                Ok(())
            }
            72 => self.restore_saved_modes(),
            _ => Ok(()),
        }
    }

    fn convert_orient(&mut self) -> Res {
        for s in 0..self.config.spindles {
            self.m.turning[s as usize] = 0;
        }
        let n = self.dollar().unwrap_or(0);
        if n >= self.config.spindles || n < 0 {
            return Err(Self::no_spindle(n, rs274::RT_SPINDLE_M19));
        }
        let b = &self.block;
        // Fanuc's goes to the angle that the machine has for it.
        if b.has(b'r') || b.has(b'p') || self.is_fanuc() {
            let angle = b.get(b'r').map_or(self.config.orient_offset, |r| r + self.config.orient_offset);
            let mode = to_int(b.or_zero(b'p'));
            self.emit_queued(Call::OrientSpindle(n, angle, mode));
        } else {
            self.warn(Fault::own(code::WORD_LEFT_OUT).arg("M19").arg("R").arg("turns the spindle nowhere").at(b'm'));
        }
        if let Some(q) = self.block.get(b'q') {
            if q <= 0.0 {
                return Err(crate::check::bad_value(rs274::RT_M19_Q, "M19", 'Q'));
            }
            self.emit_queued(Call::WaitSpindleOrientComplete(n, q));
        }
        Ok(())
    }

    /// M7, M8, M9.
    fn convert_coolant(&mut self, m: i16) {
        match m {
            7 => {
                self.emit_queued(Call::MistOn);
                self.m.mist = 1;
            }
            8 => {
                self.emit_queued(Call::FloodOn);
                self.m.flood = 1;
            }
            _ => {
                self.emit_queued(Call::MistOff);
                self.m.mist = 0;
                self.emit_queued(Call::FloodOff);
                self.m.flood = 0;
            }
        }
    }

    /// M48 … M53.
    fn convert_override(&mut self, m: i16) -> Res {
        let on = match m {
            48 => true,
            49 => false,
            _ => self.block.or_minus_one(b'p') != 0.0,
        };
        let mut only = -1;
        if m == 51 {
            if let Some(n) = self.dollar() {
                if n <= 0 || n >= self.config.spindles {
                    return Err(Self::no_spindle(n, rs274::RT_SPINDLE_M51));
                }
                only = n;
            }
        }
        let rs = if on { rs274::RT_COMP_ENABLE } else { rs274::RT_COMP_DISABLE };
        not_with_comp(self.m.comp_side, rs, "switching overrides")?;
        let flag = u8::from(on);
        if matches!(m, 48 | 49 | 50) {
            self.emit(if on { Call::EnableFeedOverride } else { Call::DisableFeedOverride });
            self.m.feed_override = flag;
        }
        if matches!(m, 48 | 49 | 51) {
            for s in self.spindles_of(only) {
                self.m.speed_override[s as usize] = flag;
                self.emit(if on { Call::EnableSpeedOverride(s) } else { Call::DisableSpeedOverride(s) });
            }
        }
        if m == 52 {
            self.emit(if on { Call::EnableAdaptiveFeed } else { Call::DisableAdaptiveFeed });
            self.m.adaptive_feed = flag;
        }
        if m == 53 {
            self.emit(if on { Call::EnableFeedHold } else { Call::DisableFeedHold });
            self.m.feed_hold = flag;
        }
        Ok(())
    }
}
