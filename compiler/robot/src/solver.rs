//! Joint values for a flange: all configurations at once, without a heap where the machine has a closed form for an
//! arm, and one configuration followed along a path.

use gr_machine::math::{Frame, M3, product};
use gr_machine::{Chain, Control, FiveAxis, Kinematics, KinematicsError, Machine, Opw, Serial, Violation};

use crate::{MAX_JOINTS, Singularity};

pub(crate) type Joints = [f64; MAX_JOINTS];

/// A wrist bent less than this is straight: the error of direction is far below a micrometer at the tool, rad.
const STRAIGHT: f64 = 1e-9;

/// Configurations of one flange, by number.
#[derive(Clone)]
pub(crate) struct Branches {
    pub joints: [Joints; 8],
    pub good: u8,
    pub singular: u8,
}

impl Branches {
    pub const NONE: Branches = Branches { joints: [[0.0; MAX_JOINTS]; 8], good: 0, singular: 0 };
    pub fn has(&self, branch: u8) -> bool {
        self.good & (1 << branch) != 0
    }
}

enum Arm {
    Opw(Opw),
    Serial(Serial),
    Five(FiveAxis),
    Any,
}

pub(crate) struct Solver {
    arm: Arm,
    any: Box<dyn Kinematics>,
    pub count: usize,
    pub control: Control,
    /// The program names the rotary axes of the five-axis machine itself.
    pub words: bool,
    /// A part is clamped so that its rotary axes can't bring the tool to what the words say about the tool's own axis too: there only
    /// the tool's direction counts, as a round cutter has no other.
    pub leans: bool,
    /// Angle of the line elbow–wrist on the forearm, reach of the arm, for closeness.
    fore: (f64, f64, f64),
}

impl Solver {
    pub fn new(machine: &Machine) -> Solver {
        let any = machine.kinematics();
        let arm = match &machine.chain {
            Chain::Opw(k) => Arm::Opw(*k),
            Chain::Serial(k) => Arm::Serial(k.clone()),
            Chain::FiveAxis(k) => Arm::Five(*k),
            _ => Arm::Any,
        };
        let fore = match &arm {
            Arm::Opw(k) => {
                let [_, a2, _, _, c2, c3, _] = k.lengths();
                (libm::atan2(a2, c3), c2, libm::hypot(a2, c3))
            }
            _ => (0.0, 0.0, 0.0),
        };
        Solver { count: any.joint_count(), control: any.control(), arm, any, words: false, leans: false, fore }
    }

    /// All configurations.
    pub fn all(&self, flange: &Frame, out: &mut Branches) -> Result<(), KinematicsError> {
        (out.good, out.singular) = (0, 0);
        if let Arm::Opw(k) = &self.arm {
            if !flange.is_finite() {
                return Err(KinematicsError::NotFinite);
            }
            let all = k.solve(flange);
            if all.good == 0 {
                return self.any.inverse_frame(flange).map(|_| ());
            }
            for (to, from) in out.joints.iter_mut().zip(&all.joints) {
                to[..6].copy_from_slice(from);
            }
            (out.good, out.singular) = (all.good, all.singular);
            return Ok(());
        }
        if let (Arm::Five(k), true) = (&self.arm, self.words) {
            match k.exact(flange) {
                Some(q) => {
                    out.joints[0][..5].copy_from_slice(&q);
                    out.good = 1;
                    return Ok(());
                }
                None if self.leans => {}
                None => return Err(KinematicsError::Direction),
            }
        }
        for s in self.any.inverse_frame(flange)? {
            let bit = 1u8 << (s.branch & 7);
            let slot = &mut out.joints[usize::from(s.branch & 7)];
            for (to, from) in slot.iter_mut().zip(&s.joints) {
                *to = *from;
            }
            out.good |= bit;
            if s.singular {
                out.singular |= bit;
            }
        }
        Ok(())
    }

    /// Whether rotary axes can do all that words say in a part that is turned like this.
    pub fn follows_words(&self, part: &M3) -> bool {
        // Angles of no particular kind: what they can do is no chance.
        self.five_axis().is_none_or(|k| k.exact(&Frame::turned(product(part, &k.turn([0.3, 0.4])))).is_some())
    }

    /// The machine, where it is one with five axes.
    pub fn five_axis(&self) -> Option<&FiveAxis> {
        if let Arm::Five(k) = &self.arm { Some(k) } else { None }
    }

    /// Whether values must be found next to those before: configurations have no fixed numbers, or go over into each
    /// other.
    pub fn searches(&self) -> bool {
        matches!(self.arm, Arm::Serial(_) | Arm::Five(_))
    }

    /// Joint values near others.
    pub fn near(&self, flange: &Frame, from: &Joints) -> Result<Joints, KinematicsError> {
        let mut out = [0.0; MAX_JOINTS];
        if let Arm::Five(k) = &self.arm {
            let near = |q: &[f64; 5]| (3..5).all(|i| whole_turns_off(q[i] - from[i]).abs() <= crate::path::ROTARY);
            let q = match self.words.then(|| k.exact(flange)) {
                Some(Some(q)) if !self.leans || near(&q) => q,
                Some(None) if !self.leans => return Err(KinematicsError::Direction),
                _ => k.next_to(flange, [from[3], from[4]])?,
            };
            out[..5].copy_from_slice(&q);
            return Ok(out);
        }
        let Arm::Serial(k) = &self.arm else { return Err(KinematicsError::Singular) };
        for (to, from) in out.iter_mut().zip(k.search(flange, &from[..self.count])?) {
            *to = from;
        }
        Ok(out)
    }

    /// The configuration that a straight wrist leads over to, where the arm has one.
    pub fn over_the_wrist(&self, branch: u8) -> Option<u8> {
        matches!(self.arm, Arm::Opw(_)).then_some(branch ^ 1)
    }

    /// Values of a wrist with the fourth and the sixth axis in line: only their sum counts, so the fourth stays where it
    /// was.
    pub fn at_the_pole(&self, q: &mut Joints, near: &Joints) {
        let Arm::Opw(k) = &self.arm else { return };
        let (o, s) = (k.offsets(), k.signs());
        if whole_turns_off(q[4] * s[4] - o[4]).abs() <= STRAIGHT {
            // Signs are ±1: the model's angles add up.
            let moved = (near[3] - q[3]) * s[3];
            q[3] = near[3];
            q[5] -= moved * s[5];
        }
    }

    /// How far the wrist is bent; none where the arm has no such wrist.
    pub fn bend(&self, q: &Joints) -> Option<f64> {
        let Arm::Opw(k) = &self.arm else { return None };
        Some(whole_turns_off(q[4] * k.signs()[4] - k.offsets()[4]))
    }

    pub fn forward(&self, joints: &Joints) -> Option<Frame> {
        match &self.arm {
            Arm::Opw(k) => {
                let [a, b, c, d, e, f, ..] = *joints;
                Some(k.flange(&[a, b, c, d, e, f]))
            }
            _ => self.any.forward_frame(&joints[..self.count]).ok(),
        }
    }

    pub fn violations(&self, joints: &Joints) -> Vec<Violation> {
        if matches!(self.arm, Arm::Any | Arm::Five(_)) { self.any.violations(&joints[..self.count]) } else { Vec::new() }
    }

    /// Angle left to the next singular position, rad, and which one; infinite when the machine's kind has none that
    /// is known in closed form.
    pub fn closeness(&self, q: &Joints) -> (f64, Singularity) {
        let Arm::Opw(k) = &self.arm else { return (f64::INFINITY, Singularity::Wrist) };
        let (o, s) = (k.offsets(), k.signs());
        let model = |i: usize| q[i] * s[i] - o[i];
        let wrist = to_line(model(4));
        let elbow = to_line(model(2) + self.fore.0);
        if elbow < wrist { (elbow, Singularity::Elbow) } else { (wrist, Singularity::Wrist) }
    }

    /// The same with the shoulder, which takes longer.
    pub fn closeness_of_all(&self, q: &Joints) -> (f64, Singularity) {
        let Arm::Opw(k) = &self.arm else { return (f64::INFINITY, Singularity::Wrist) };
        let near = self.closeness(q);
        let (o, s) = (k.offsets(), k.signs());
        let [a1, a2, _, _, c2, c3, _] = k.lengths();
        let (q2, q3) = (q[1] * s[1] - o[1], q[2] * s[2] - o[2]);
        let (s23, k23) = libm::sincos(q2 + q3);
        let out = a1 + c2 * libm::sin(q2) + a2 * k23 + c3 * s23;
        let shoulder = libm::asin((out.abs() / (self.fore.1 + self.fore.2)).min(1.0));
        if shoulder < near.0 { (shoulder, Singularity::Shoulder) } else { near }
    }

    /// Distance of the wrist from the border of what the arm can reach, mm.
    pub fn reach_margin(&self, q: &Joints) -> Option<f64> {
        let Arm::Opw(k) = &self.arm else { return None };
        let bend = q[2] * k.signs()[2] - k.offsets()[2] + self.fore.0;
        let (c2, fore) = (self.fore.1, self.fore.2);
        let distance = libm::sqrt((c2 * c2 + fore * fore + 2.0 * c2 * fore * libm::cos(bend)).max(0.0));
        Some((c2 + fore - distance).min(distance - (c2 - fore).abs()))
    }
}

/// An angle brought into −π … π.
pub(crate) fn whole_turns_off(angle: f64) -> f64 {
    const TURN: f64 = std::f64::consts::TAU;
    angle - TURN * libm::round(angle / TURN)
}

/// Distance of an angle from 0 or half a turn, whichever is nearer.
fn to_line(angle: f64) -> f64 {
    use std::f64::consts::PI;
    (angle - PI * libm::round(angle / PI)).abs()
}

/// Least and greatest values of joints, open ends infinite.
pub(crate) struct Limits {
    pub min: Joints,
    pub max: Joints,
    pub turns: [bool; MAX_JOINTS],
    coupling: Option<(usize, usize, f64, f64, f64)>,
    count: usize,
}

/// Room for rounding at a limit, rad or mm.
const ROOM: f64 = 1e-9;

impl Limits {
    pub fn new(machine: &Machine) -> Limits {
        let mut out = Limits {
            min: [f64::NEG_INFINITY; MAX_JOINTS],
            max: [f64::INFINITY; MAX_JOINTS],
            turns: [false; MAX_JOINTS],
            coupling: None,
            count: machine.joints.len(),
        };
        for (i, joint) in machine.joints.iter().enumerate() {
            out.min[i] = joint.min.map_or(f64::NEG_INFINITY, |v| v - ROOM);
            out.max[i] = joint.max.map_or(f64::INFINITY, |v| v + ROOM);
            out.turns[i] = joint.kind == gr_machine::JointKind::Revolute;
        }
        if let Some(c) = &machine.cell.coupling {
            let joint = &machine.joints[c.joint];
            let min = c.min.or(joint.min).unwrap_or(f64::NEG_INFINITY) - ROOM;
            let max = c.max.or(joint.max).unwrap_or(f64::INFINITY) + ROOM;
            out.coupling = Some((c.joint, c.with, c.factor, min, max));
        }
        out
    }

    /// The first coupled value outside its limits.
    pub fn coupled_outside(&self, q: &Joints) -> Option<(usize, f64, f64)> {
        let (joint, with, factor, min, max) = self.coupling?;
        let value = q[joint] + factor * q[with];
        if value < min {
            Some((joint, value, min))
        } else if value > max {
            Some((joint, value, max))
        } else {
            None
        }
    }

    /// By how much a joint's own or coupled value changes between two positions.
    pub fn change(&self, joint: usize, coupled: bool, p: &Joints, q: &Joints) -> f64 {
        let by = self.coupling.filter(|_| coupled).map_or(0.0, |(_, with, factor, ..)| factor * (q[with] - p[with]));
        q[joint] - p[joint] + by
    }

    /// The whole turns (first and last) that bring a span of values into the limits; none when there are none.
    pub fn shifts(&self, joint: usize, low: f64, high: f64) -> Option<(i32, i32)> {
        const TURN: f64 = std::f64::consts::TAU;
        if !self.turns[joint] {
            return (low >= self.min[joint] && high <= self.max[joint]).then_some((0, 0));
        }
        let (down, up) = ((self.min[joint] - low) / TURN, (self.max[joint] - high) / TURN);
        let (first, last) = (libm::ceil(down - 1e-12).max(-4.0), libm::floor(up + 1e-12).min(4.0));
        // Bounded by four turns either way.
        (first <= last).then_some((first as i32, last as i32))
    }

    /// Share of the range left to the nearer limit, 0 … 0.5; the worst joint.
    pub fn margin(&self, q: &Joints) -> (f64, usize) {
        let mut worst = (0.5, 0);
        for i in 0..self.count {
            let range = self.max[i] - self.min[i];
            if range.is_finite() && range > 0.0 {
                let left = (q[i] - self.min[i]).min(self.max[i] - q[i]) / range;
                if left < worst.0 {
                    worst = (left, i);
                }
            }
        }
        worst
    }
}
