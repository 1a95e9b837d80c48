//! What the outside world answers. The controller asks it for positions after a probe or a tool change, and for
//! feeds and offsets after a change of units; the stand-in answers as the real `rs274` does without a machine.

use gr_canon::{Axes, Call, PROBE_STOPS_SHORT, PathMode, Plane, Units};
use bytemuck::{Pod, Zeroable};

/// The stand-in for the machine.
#[derive(Clone, Copy, Pod, Zeroable, Debug)]
#[repr(C)]
pub struct World {
    /// Position in the work frame.
    pub position: [f64; 6],
    /// Where the probe stopped.
    pub probed: [f64; 6],
    g5x: [f64; 6],
    g92: [f64; 6],
    /// Tool length offset as it was given out.
    pub tool_offset: Axes,
    /// By how much a probe stops before its target, mm. 0: as `rs274`'s stand-in has it, which stops a little before but
    /// reports the target.
    pub short: f64,
    /// Feed as it was given out.
    pub feed: f64,
    /// G64 P as it was given out.
    pub tolerance: f64,
    /// G64 Q as it was given out.
    pub naivecam: f64,
    units: u8,
    plane: u8,
    /// The feed override was switched off last, not on.
    pub feed_held: u8,
    /// The speed override was switched off last, not on (of whichever spindle).
    pub speed_held: u8,
    /// Path control as it was given out: 0 exact path, 1 exact stop, 2 blending.
    pub path: u8,
    pad: [u8; 3],
}

impl World {
    /// At the start.
    pub fn new() -> World {
        World { units: Units::Mm as u8, plane: Plane::Xy as u8, path: 2, ..World::zeroed() }
    }
    fn moved(&mut self, to: &Axes) {
        self.position.copy_from_slice(&to[..6]);
    }
    /// Hears a call.
    #[inline]
    pub fn hear(&mut self, call: &Call) {
        match call {
            Call::StraightFeed(to) | Call::StraightTraverse(to) => self.moved(to),
            other => self.hear_rare(other),
        }
    }
    fn hear_rare(&mut self, call: &Call) {
        match call {
            Call::ArcFeed { first_end, second_end, axis_end, rest, .. } => {
                let (a, b, c) = (*first_end, *second_end, *axis_end);
                let xyz = match self.plane {
                    1 => [a, b, c],
                    2 => [c, a, b],
                    _ => [b, c, a],
                };
                self.position[..3].copy_from_slice(&xyz);
                self.position[3..].copy_from_slice(&rest[..3]);
            }
            Call::NurbsFeed(n) => {
                if let Some(last) = n.points.last() {
                    self.position[..2].copy_from_slice(&last[..2]);
                }
            }
            Call::StraightProbe(to, _) => self.probe(to),
            Call::SetG5xOffset(_, to) => {
                for i in 0..6 {
                    self.position[i] = self.position[i] + self.g5x[i] - to[i];
                    self.g5x[i] = to[i];
                }
            }
            Call::SetG92Offset(to) => {
                for i in 0..6 {
                    self.position[i] = self.position[i] + self.g92[i] - to[i];
                    self.g92[i] = to[i];
                }
            }
            Call::UseLengthUnits(units) => self.change_units(*units),
            Call::SelectPlane(plane) => self.plane = *plane as u8,
            Call::SetFeedRate(feed) => self.feed = *feed,
            Call::SetMotionControlMode(mode) => {
                (self.path, self.tolerance) = match mode {
                    PathMode::ExactPath => (0, 0.0),
                    PathMode::ExactStop => (1, 0.0),
                    PathMode::Continuous(t) => (2, *t),
                };
            }
            Call::EnableFeedOverride => self.feed_held = 0,
            Call::DisableFeedOverride => self.feed_held = 1,
            Call::EnableSpeedOverride(_) => self.speed_held = 0,
            Call::DisableSpeedOverride(_) => self.speed_held = 1,
            Call::SetNaivecamTolerance(t) => self.naivecam = *t,
            Call::UseToolLengthOffset(offset, _) => self.tool_offset = *offset,
            _ => {}
        }
    }
    fn probe(&mut self, to: &Axes) {
        let d = [0, 1, 2].map(|i| self.position[i] - to[i]);
        let distance = libm::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        self.probed.copy_from_slice(&to[..6]);
        if distance != 0.0 {
            let unit = if self.units == Units::Mm as u8 { 1.0 } else { 25.4 };
            let back = if self.short > 0.0 { self.short / unit } else { PROBE_STOPS_SHORT / unit };
            for i in 0..3 {
                self.position[i] = to[i] + back * (d[i] / distance);
            }
            if self.short > 0.0 {
                self.probed[..3].copy_from_slice(&self.position[..3]);
            }
        }
        self.position[3..].copy_from_slice(&to[3..6]);
    }
    fn change_units(&mut self, units: Units) {
        let old = std::mem::replace(&mut self.units, units as u8);
        if old == units as u8 {
            return;
        }
        for i in 0..3 {
            for v in [&mut self.position[i], &mut self.g5x[i], &mut self.g92[i]] {
                *v = if units == Units::Inch { *v / 25.4 } else { *v * 25.4 };
            }
        }
    }
}

impl Default for World {
    fn default() -> Self {
        World::new()
    }
}
