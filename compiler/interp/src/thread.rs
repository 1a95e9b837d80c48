//! Motion that follows the spindle: G33, G33.1 and the threading cycle G76.

use gr_canon::{Axes, Call, Sink};
use gr_spec::{Rs274, code, rs274};

use crate::state::SPINDLES;
use crate::{Fault, Interp, Res};

/// A thread from its words: distances along X from the drive line, all positive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thread {
    /// Inside thread: X grows with depth.
    boring: bool,
    /// Drive line to crest.
    crest: f64,
    first_cut: f64,
    height: f64,
    pitch: f64,
    /// Tangent of the infeed angle, with the sign of the feed direction.
    slope: f64,
    degression: f64,
    /// Length of the tapered ends, signed against the feed direction; 0 = none.
    taper: f64,
    taper_pitch: f64,
    taper_in: bool,
    taper_out: bool,
    spring_passes: u32,
}

/// What one pass is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Step {
    Rapid { x: f64, z: f64 },
    Feed { x: f64, z: f64 },
    Pitch(f64),
    Free,
    HoldFeed,
    ReleaseFeed,
}

impl Thread {
    /// Depth below the drive line at the end of the thread.
    fn full_depth(&self) -> f64 {
        self.height + self.crest
    }

    /// Depth of cut number `n`, from 1.
    pub(crate) fn depth(&self, n: u32) -> f64 {
        if n == 1 {
            return self.crest + self.first_cut;
        }
        self.crest + self.first_cut * libm::pow(f64::from(n), 1.0 / self.degression)
    }

    fn x(&self, safe: f64, depth: f64, lift: f64) -> f64 {
        if self.boring { safe + depth - lift } else { safe - depth + lift }
    }

    /// One pass at a depth, from `start` to the Z of the end.
    pub(crate) fn pass(&self, start: [f64; 2], end_z: f64, depth: f64, mut step: impl FnMut(Step)) {
        let [safe, start_z] = start;
        let shift = (depth - self.crest) * self.slope;
        let (away, cut) = (self.x(safe, depth, self.full_depth()), self.x(safe, depth, 0.0));
        let end = end_z - shift;
        let begin = start_z - shift;
        step(Step::Rapid { x: away, z: begin });
        if self.taper != 0.0 && self.taper_in {
            step(Step::HoldFeed);
            step(Step::Pitch(self.taper_pitch));
            step(Step::Feed { x: self.x(safe, depth, self.height), z: begin });
            step(Step::Feed { x: cut, z: begin - self.taper });
            step(Step::Pitch(self.pitch));
        } else {
            step(Step::Rapid { x: cut, z: begin });
            step(Step::HoldFeed);
            step(Step::Pitch(self.pitch));
        }
        if self.taper != 0.0 && self.taper_out {
            step(Step::Feed { x: cut, z: end + self.taper });
            step(Step::Pitch(self.taper_pitch));
            step(Step::Feed { x: self.x(safe, depth, self.height), z: end });
        } else {
            step(Step::Feed { x: cut, z: end });
        }
        step(Step::Free);
        step(Step::Rapid { x: away, z: end });
        step(Step::ReleaseFeed);
    }
}

impl<S: Sink> Interp<'_, S> {
    fn spindle_turns(&self) -> bool {
        self.m.turning[self.m.active_spindle.clamp(0, SPINDLES as i32 - 1) as usize] != 0
    }

    fn spindle_for(&mut self, g: i16, number: Rs274, stopped: Rs274) -> Res {
        if let Some(n) = self.block.get(b'$') {
            self.choose_spindle(n, i32::from(g), number)?;
        }
        if self.spindle_turns() {
            return Ok(());
        }
        Err(Fault::new(code::CYCLE_SPINDLE, stopped)
            .arg(crate::cycles::code_name(i32::from(g)))
            .arg("the spindle is stopped")
            .arg(self.m.active_spindle))
    }

    /// G33, G33.1: to `end`, following the spindle.
    pub(crate) fn convert_spindle_sync(&mut self, g: i16, end: Axes) -> Res {
        let tap = g == 331;
        if tap {
            self.spindle_for(g, rs274::THREAD_SPINDLE_NUMBER_G33_1, rs274::THREAD_SPINDLE_G33_1)?;
        } else {
            self.spindle_for(g, rs274::THREAD_SPINDLE_NUMBER_G33, rs274::THREAD_SPINDLE_G33)?;
        }
        let lead = if self.is_fanuc() { self.lead_along(&end) } else { self.block.or_zero(b'k') };
        self.emit(Call::StartSpeedFeedSynch(self.m.active_spindle, lead, false));
        if tap {
            let scale = self.block.get(b'i').unwrap_or(1.0);
            let scale = if scale < 1.0 { 1.0 } else { scale };
            self.emit(Call::RigidTap([end[0], end[1], end[2]], scale));
        } else {
            self.emit(Call::StraightFeed(end));
        }
        self.emit(Call::StopSpeedFeedSynch);
        // The tool comes back from a rigid tap: only the other axes can have moved.
        let kept = if tap { 3 } else { 0 };
        self.m.current[kept..].copy_from_slice(&end[kept..]);
        Ok(())
    }

    /// G76 to `end`.
    pub(crate) fn convert_thread(&mut self, end: Axes) -> Res {
        self.spindle_for(760, rs274::THREAD_SPINDLE_NUMBER_G76, rs274::THREAD_SPINDLE_G76)?;
        let fault = |text, why: &str| Err(Fault::new(code::THREAD_WORDS, text).arg(why));
        if self.m.current[3..] != end[3..] {
            return fault(rs274::THREAD_ROTARY, "it can't move other axes than X, Y, Z");
        }
        if self.m.comp_side != 0 {
            return fault(rs274::THREAD_COMP, "cutter compensation is on");
        }
        let (i, j, k) = (self.block.or_zero(b'i'), self.block.or_zero(b'j'), self.block.or_zero(b'k'));
        if i == 0.0 {
            return fault(rs274::THREAD_I, "I is zero");
        }
        if j <= 0.0 {
            return fault(rs274::THREAD_J, "J is not greater than zero");
        }
        if k <= j {
            return fault(rs274::THREAD_K, "K is not greater than J");
        }
        let thread = self.thread(end[2]);
        self.cut_thread(&thread, &end)?;
        self.m.current = end;
        Ok(())
    }

    fn thread(&self, end_z: f64) -> Thread {
        let b = &self.block;
        let scale = if self.m.lathe_diameter != 0 { 2.0 } else { 1.0 };
        let [i, j, k] = [b'i', b'j', b'k'].map(|l| b.or_zero(l) / scale);
        let upwards = end_z > self.m.current[2];
        let degrees = b.get(b'q').filter(|q| *q != -1.0).unwrap_or(0.0);
        let angle = degrees * (std::f64::consts::PI / 180.0);
        let height = k.abs();
        let pitch = b.get(b'p').unwrap_or(-1.0);
        let taper = b.get(b'e').filter(|e| *e >= 0.0).unwrap_or(0.0);
        let ends = b.get(b'l').map_or(0, |l| (l as i32).max(0));
        Thread {
            boring: i > 0.0,
            crest: i.abs(),
            first_cut: j.abs(),
            height,
            pitch,
            slope: libm::tan(if upwards { -angle } else { angle }),
            degression: b.get(b'r').filter(|r| *r >= 1.0).unwrap_or(1.0),
            taper: if upwards { -taper } else { taper },
            taper_pitch: if taper > 0.0 { pitch * libm::hypot(taper, height) / taper } else { pitch },
            taper_in: ends & 1 != 0,
            taper_out: ends & 2 != 0,
            spring_passes: b.get(b'h').map_or(0, |h| (h as i32).max(0) as u32),
        }
    }

    fn cut_thread(&mut self, thread: &Thread, end: &Axes) -> Res {
        let target = end[2] + thread.height * thread.slope;
        let mut n = 1;
        let mut depth = thread.depth(n);
        while depth < thread.full_depth() {
            if self.spent() {
                return Err(self.too_many());
            }
            self.thread_pass(thread, target, depth);
            n += 1;
            depth = thread.depth(n);
        }
        for _ in 0..=thread.spring_passes {
            self.thread_pass(thread, target, thread.full_depth());
            if self.spent() {
                return Err(self.too_many());
            }
        }
        let mut to = self.m.current;
        to[..3].copy_from_slice(&end[..3]);
        self.emit(Call::StraightTraverse(to));
        Ok(())
    }

    fn thread_pass(&mut self, thread: &Thread, target: f64, depth: f64) {
        let start = self.m.current;
        let at = |x: f64, z: f64| {
            let mut point = start;
            point[0] = x;
            point[2] = z;
            point
        };
        let mut steps = Vec::with_capacity(12);
        thread.pass([start[0], start[2]], target, depth, |s| steps.push(s));
        for step in steps {
            let call = match step {
                Step::Rapid { x, z } => Call::StraightTraverse(at(x, z)),
                Step::Feed { x, z } => Call::StraightFeed(at(x, z)),
                Step::Pitch(pitch) => Call::StartSpeedFeedSynch(self.m.active_spindle, pitch, false),
                Step::Free => Call::StopSpeedFeedSynch,
                Step::HoldFeed => Call::DisableFeedOverride,
                Step::ReleaseFeed => Call::EnableFeedOverride,
            };
            self.emit(call);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outside() -> Thread {
        Thread {
            boring: false,
            crest: 1.0,
            first_cut: 0.2,
            height: 0.6,
            pitch: 1.0,
            slope: 0.0,
            degression: 2.0,
            taper: 0.0,
            taper_pitch: 1.0,
            taper_in: false,
            taper_out: false,
            spring_passes: 0,
        }
    }

    #[test]
    fn cuts_get_thinner_with_degression() {
        let t = outside();
        assert!((t.depth(1) - 1.2).abs() < 1e-12);
        assert!((t.depth(4) - 1.4).abs() < 1e-12);
    }

    #[test]
    fn a_pass_comes_back_to_the_drive_line() {
        let t = outside();
        let mut steps = Vec::new();
        t.pass([20.0, 5.0], -10.0, t.full_depth(), |s| steps.push(s));
        assert_eq!(steps.first(), Some(&Step::Rapid { x: 20.0, z: 5.0 }));
        assert_eq!(steps[steps.len() - 2], Step::Rapid { x: 20.0, z: -10.0 });
    }
}
