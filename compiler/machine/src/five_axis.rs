use crate::kinematics::{Control, Kinematics, KinematicsError, Solution, checked};
use crate::math::{Frame, V3, about, add, cross, dot, norm, rotate, scale, sub};
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
    /// From the crossing of the head's axes to the spindle nose, mm.
    pub fn pivot(&self) -> f64 {
        self.pivot
    }
    /// With two rotary axes, the one nearer to the bed first, and the distance from the crossing of the head's axes
    /// to the spindle nose, mm.
    pub fn new(rotary: [Rotary; 2], pivot: f64) -> FiveAxis {
        FiveAxis { rotary, pivot }
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
            let moved = sub(frame.position, self.turned(angles).position);
            let [x, y, z] = rotate(&crate::math::transpose(&self.table(angles).turn), moved);
            out.push(Solution { joints: vec![x, y, z, angles[0], angles[1]], branch: branch as u8, singular });
        }
        Ok(out)
    }
}
