use crate::kinematics::{Control, Kinematics, KinematicsError, Solution, checked};
use crate::math::{Frame, M3, V3, about, add, cross, dot, norm, product, rotate, scale, sub, transpose};
use crate::opw::turn;

/// Where a rotary axis of a five-axis machine sits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Carrier {
    /// It turns the part.
    Table,
    /// It turns the spindle.
    Head,
}

/// One rotary axis of a five-axis machine.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rotary {
    /// Part or spindle.
    pub on: Carrier,
    /// Unit vector along the axis, at joint value 0.
    pub axis: V3,
    /// A point on the axis of a table, mm; not used on a head.
    pub point: V3,
}

/// Mill with X Y Z and two rotary axes on table, head or one on each; kinematics of the tool point (RTCP).
///
/// Joints X Y Z and the two rotary ones, the one nearer to the machine's bed first. Angles say how the tool turns
/// against the part, as ISO 841 has it: a table turns the other way. The pose is that of the spindle nose (or of the
/// tool, through the machine's tool frame) in the frame of the part, which at rotary values 0 is the machine's.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FiveAxis {
    rotary: [Rotary; 2],
    pivot: f64,
}

impl FiveAxis {
    /// Its rotary axes.
    pub fn rotary(&self) -> [Rotary; 2] {
        self.rotary
    }
    /// Whether an axis turns the part, so that its frame is not that of the machine.
    pub fn turns_part(&self) -> bool {
        self.rotary.iter().any(|r| r.on == Carrier::Table)
    }
    /// From the crossing of the head's axes to the spindle nose, mm.
    pub fn pivot(&self) -> f64 {
        self.pivot
    }
    /// With two rotary axes, the one nearer to the bed first, and the distance from the crossing of the head's axes
    /// to the spindle nose, mm.
    pub fn new(rotary: [Rotary; 2], pivot: f64) -> FiveAxis {
        FiveAxis { rotary, pivot }
    }

    /// How the spindle is turned against the part at rotary values.
    pub fn turn(&self, angles: [f64; 2]) -> M3 {
        self.turned(angles).turn
    }

    /// The turn of tool against part, and the shift that comes with it.
    fn turned(&self, angles: [f64; 2]) -> Frame {
        let table = self.table(angles);
        let heads = self.rotary.iter().zip(angles).filter(|(r, _)| r.on == Carrier::Head);
        let head = heads.fold(Frame::IDENTITY, |all, (r, angle)| all.then(&Frame::turned(about(r.axis, angle))));
        let nose = sub([0.0, 0.0, self.pivot], scale(head.axis(2), self.pivot));
        table.then(&Frame { turn: head.turn, position: nose })
    }

    /// From the machine to the part; the table nearest to the part acts last.
    fn table(&self, angles: [f64; 2]) -> Frame {
        self.rotary.iter().zip(angles).filter(|(r, _)| r.on == Carrier::Table).fold(Frame::IDENTITY, |all, (r, angle)| {
            let turn = about(r.axis, angle);
            Frame { turn, position: sub(r.point, rotate(&turn, r.point)) }.then(&all)
        })
    }

    /// The order in which the two turns act on the tool axis: outermost first, in the frame of the part.
    fn order(&self) -> [usize; 2] {
        match (self.rotary[0].on, self.rotary[1].on) {
            // The table nearest to the part is the second one: it acts last.
            (Carrier::Table, Carrier::Table) => [1, 0],
            (Carrier::Head, Carrier::Table) => [1, 0],
            _ => [0, 1],
        }
    }
}

/// Below this the tool's axis lies in a rotary axis, which may then stand at any angle, rad.
const POLE: f64 = 1e-9;
/// Turns that agree to this are one.
const SAME: f64 = 1e-7;

/// The angle about an axis from one vector to another.
fn between(axis: V3, from: V3, to: V3) -> f64 {
    let (u, v) = (sub(from, scale(axis, dot(axis, from))), sub(to, scale(axis, dot(axis, to))));
    libm::atan2(dot(axis, cross(u, v)), dot(u, v))
}

/// A vector across another.
fn across(v: V3) -> V3 {
    let help = if v[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let w = cross(v, help);
    scale(w, 1.0 / norm(w).max(f64::MIN_POSITIVE))
}

/// An angle by whole turns next to another.
fn next_to(angle: f64, near: f64) -> f64 {
    const TURN: f64 = std::f64::consts::TAU;
    angle + TURN * libm::round((near - angle) / TURN)
}

impl FiveAxis {
    fn placed(&self, frame: &Frame, angles: [f64; 2]) -> [f64; 5] {
        let moved = sub(frame.position, self.turned(angles).position);
        let [x, y, z] = rotate(&transpose(&self.table(angles).turn), moved);
        [x, y, z, angles[0], angles[1]]
    }

    /// The joint values that turn tool against part just as the frame says, about the tool's axis too: those of a program
    /// that names the rotary axes. None where no angles do.
    pub fn exact(&self, frame: &Frame) -> Option<[f64; 5]> {
        let [o, i] = self.order();
        let (outer, inner): (V3, V3) = (self.rotary[o].axis, self.rotary[i].axis);
        let t = between(outer, inner, rotate(&frame.turn, inner));
        let rest: M3 = product(&about(outer, -t), &frame.turn);
        let arm = across(inner);
        let s = between(inner, arm, rotate(&rest, arm));
        let made = product(&about(outer, t), &about(inner, s));
        let off = made.iter().flatten().zip(frame.turn.iter().flatten()).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        if !(off <= SAME) {
            return None;
        }
        let mut angles = [0.0; 2];
        (angles[o], angles[i]) = (t, s);
        Some(self.placed(frame, angles))
    }

    /// Of all joint values that give the direction of the frame's Z, those next to given rotary values. Where the tool's
    /// axis lies in the outer rotary axis, that one stays.
    pub fn next_to(&self, frame: &Frame, near: [f64; 2]) -> Result<[f64; 5], KinematicsError> {
        if !frame.is_finite() {
            return Err(KinematicsError::NotFinite);
        }
        let [o, i] = self.order();
        let (outer, inner, z, aim) = (self.rotary[o].axis, self.rotary[i].axis, [0.0, 0.0, 1.0], frame.axis(2));
        let along = dot(outer, aim) * dot(outer, inner);
        let (q, r, rest) = (dot(inner, aim) - along, -dot(inner, cross(outer, aim)), dot(inner, z) - along);
        let size = libm::hypot(q, r);
        let turns: [f64; 2] = if size <= POLE {
            if rest.abs() > SAME {
                return Err(KinematicsError::Direction);
            }
            [near[o]; 2]
        } else {
            let cos = rest / size;
            if !(cos.abs() <= 1.0 + 1e-12) {
                return Err(KinematicsError::Direction);
            }
            let cos = cos.clamp(-1.0, 1.0);
            let (middle, half) = (libm::atan2(r, q), libm::atan2(libm::sqrt((1.0 - cos) * (1.0 + cos)), cos));
            [middle + half, middle - half]
        };
        let pair = |t: f64| {
            let back = rotate(&about(outer, -t), aim);
            let u = sub(z, scale(inner, dot(inner, z)));
            let s = if norm(u) < POLE { near[i] } else { between(inner, z, back) };
            [next_to(t, near[o]), next_to(s, near[i])]
        };
        let far = |p: &[f64; 2]| (p[0] - near[o]).abs().max((p[1] - near[i]).abs());
        let [a, b] = turns.map(pair);
        let best = if far(&b) < far(&a) { b } else { a };
        let mut angles = [0.0; 2];
        (angles[o], angles[i]) = (best[0], best[1]);
        Ok(self.placed(frame, angles))
    }
}

/// Angles (outer, inner) with R(outer)·R(inner)·z = aim: none, one double or two pairs. `Err` when the outer angle is
/// free.
fn two_turns(outer: V3, inner: V3, z: V3, aim: V3) -> Vec<([f64; 2], bool)> {
    // inner·(aim turned back by outer) = inner·z fixes the outer angle:  p + q cos t + r sin t = inner·z.
    let along = dot(outer, aim) * dot(outer, inner);
    let q = dot(inner, aim) - along;
    let r = -dot(inner, cross(outer, aim));
    let rest = dot(inner, z) - along;
    let size = libm::hypot(q, r);
    let angles: Vec<(f64, bool)> = if size < 1e-12 {
        if rest.abs() > 1e-9 {
            return Vec::new();
        }
        // The outer axis is free: it stays at 0.
        vec![(0.0, true)]
    } else {
        let cos = rest / size;
        if !(cos.abs() <= 1.0 + 1e-12) {
            return Vec::new();
        }
        let cos = cos.clamp(-1.0, 1.0);
        let sin = libm::sqrt((1.0 - cos) * (1.0 + cos));
        let (middle, half) = (libm::atan2(r, q), libm::atan2(sin, cos));
        if half < 1e-12 { vec![(middle, true)] } else { vec![(middle + half, half < 1e-6), (middle - half, half < 1e-6)] }
    };
    angles
        .into_iter()
        .map(|(t, singular)| {
            let back = rotate(&about(outer, -t), aim);
            let (u, v) = (sub(z, scale(inner, dot(inner, z))), sub(back, scale(inner, dot(inner, back))));
            let small = norm(u) < 1e-12;
            let s = if small { 0.0 } else { libm::atan2(dot(inner, cross(u, v)), dot(u, v)) };
            ([turn(t), turn(s)], singular || small)
        })
        .collect()
}

impl Kinematics for FiveAxis {
    fn joint_count(&self) -> usize {
        5
    }
    fn control(&self) -> Control {
        Control::Axis
    }
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        let q = checked(joints, 5)?;
        let angles = [q[3], q[4]];
        let table = self.table(angles);
        let turned = self.turned(angles);
        Ok(Frame { turn: turned.turn, position: add(turned.position, rotate(&table.turn, [q[0], q[1], q[2]])) })
    }
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        if !frame.is_finite() {
            return Err(KinematicsError::NotFinite);
        }
        let [o, i] = self.order();
        let pairs = two_turns(self.rotary[o].axis, self.rotary[i].axis, [0.0, 0.0, 1.0], frame.axis(2));
        if pairs.is_empty() {
            return Err(KinematicsError::Direction);
        }
        let mut out = Vec::new();
        for (branch, (pair, singular)) in pairs.into_iter().enumerate() {
            let mut angles = [0.0; 2];
            (angles[o], angles[i]) = (pair[0], pair[1]);
            out.push(Solution { joints: self.placed(frame, angles).to_vec(), branch: branch as u8, singular });
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Chain, builtin};

    fn mills() -> Vec<FiveAxis> {
        let ids = ["generic/mill5-ac-table", "generic/mill5-bc-table", "generic/mill5-cb-head", "generic/mill5-b-head-c-table"];
        let one = |id: &str| if let Some(Chain::FiveAxis(k)) = builtin(id).map(|m| m.chain) { k } else { panic!("{id}") };
        ids.map(one).to_vec()
    }

    proptest::proptest! {
        #[test]
        fn exact_gives_the_angles_back(x in -300.0..300.0f64, z in -300.0..300.0f64, a in -3.1..3.1f64, b in -3.1..3.1f64) {
            for k in mills() {
                for (a, b) in [(a, b), (0.0, b), (a, 0.0), (0.0, 0.0)] {
                    let q = [x, -x / 2.0, z, a, b];
                    let back = k.exact(&k.forward_frame(&q).unwrap()).unwrap();
                    proptest::prop_assert!((0..5).all(|i| (back[i] - q[i]).abs() < 1e-9 * if i < 3 { 1e3 } else { 1.0 }), "{q:?} {back:?}");
                }
            }
        }
    }

    /// The tool's axis goes through the pole: the joints go on without a jump, and lead back to the direction.
    #[test]
    fn a_direction_through_the_pole() {
        for k in mills() {
            let tilt = usize::from(k.rotary()[0].axis[2].abs() > 0.5);
            let at = |lean: f64| {
                let mut q = [10.0, 20.0, -30.0, 0.5, 0.5];
                q[3 + tilt] = lean;
                k.forward_frame(&q).unwrap()
            };
            let mut q = k.next_to(&at(0.4), if tilt == 0 { [0.4, 0.5] } else { [0.5, 0.4] }).unwrap();
            for n in 1..=80 {
                let frame = at(0.4 - f64::from(n) * 0.01);
                let next = k.next_to(&frame, [q[3], q[4]]).unwrap();
                assert!((3..5).all(|i| (next[i] - q[i]).abs() < 0.011), "{q:?} {next:?}");
                let z = k.forward_frame(&next).unwrap();
                assert!(norm(sub(z.axis(2), frame.axis(2))) < 1e-9 && norm(sub(z.position, frame.position)) < 1e-6);
                q = next;
            }
        }
    }
}
