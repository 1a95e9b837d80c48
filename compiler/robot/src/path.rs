//! The real path of a move: the tool frame at any share of the way, and how finely it must be looked at.

use gr_machine::math::{Frame, M3, about, add, norm, product, rot_z, rotate, rotation_vector, scale, sub, transpose};

use gr_machine::{FiveAxis, Kinematics};

use crate::gather::{ArcPiece, Gathered, Move, Way};
use crate::solver::Solver;

/// One move between two tool frames in its work frame.
pub(crate) struct Path {
    from: [f64; 3],
    to: [f64; 3],
    turn: M3,
    /// Rotation vector from the first to the last turn, in the work frame.
    vector: [f64; 3],
    angle: f64,
    arc: Option<ArcPiece>,
    rotary: Option<Rotary>,
    pub length: f64,
}

/// The rotary axes of a five-axis machine, which go evenly from end to end when the program names them.
struct Rotary {
    machine: FiveAxis,
    from: [f64; 2],
    by: [f64; 2],
    /// From the base to the work frame, and from the flange to the tool.
    frame: M3,
    tool: M3,
    /// The slides of a rapid that stay where they are, where it turns rotary axes alone, with the work frame and the tool.
    still: Option<([f64; 3], Frame, Frame)>,
}

/// Further than this the rotary axes don't go in one move: it has been cut before, rad.
pub(crate) const ROTARY: f64 = 0.2;

impl Rotary {
    fn new(g: &Gathered, solver: &Solver, start: &Frame, m: &Move) -> Option<Rotary> {
        let machine = *solver.five_axis()?;
        let mount = Mount::new(g, m, 0.0);
        let end = Frame { turn: g.turns[m.turn as usize], position: m.position };
        let (p, q) = (machine.exact(&mount.flange(start))?, machine.exact(&mount.flange(&end))?);
        let by = [3, 4].map(|i| crate::solver::whole_turns_off(q[i] - p[i]));
        let tip = g.tools[usize::from(m.tool)].frame;
        let (frame, tool) = (transpose(&mount.frame.turn), tip.turn);
        let stays = m.rapid && (0..3).all(|i| (q[i] - p[i]).abs() < STAYS);
        let still = stays.then_some(([p[0], p[1], p[2]], mount.frame.inverse(), tip));
        by.iter().all(|v| v.abs() <= ROTARY).then_some(Rotary { machine, from: [p[3], p[4]], by, frame, tool, still })
    }
    fn angles(&self, share: f64) -> [f64; 2] {
        [0, 1].map(|i| self.from[i] + self.by[i] * share)
    }
    fn turn(&self, share: f64) -> M3 {
        product(&self.frame, &product(&self.machine.turn(self.angles(share)), &self.tool))
    }
    /// The tool point where the slides stay.
    fn position(&self, share: f64) -> Option<[f64; 3]> {
        let ([x, y, z], work, tip) = self.still.as_ref()?;
        let [a, b] = self.angles(share);
        let flange = self.machine.forward_frame(&[*x, *y, *z, a, b]).ok()?;
        Some(work.then(&flange).then(tip).position)
    }
}

/// Slides that go less far stay, mm.
const STAYS: f64 = 1e-6;

/// Longest stretch between two looks, mm and rad.
const STEP: f64 = 10.0;
const ANGLE: f64 = 0.1;

impl Path {
    /// From a tool frame in the move's own work frame.
    pub fn new(g: &Gathered, solver: &Solver, start: &Frame, m: &Move) -> Path {
        let (a, b, from) = (&start.turn, &g.turns[m.turn as usize], start.position);
        let vector = if a == b { [0.0; 3] } else { rotation_vector(&product(b, &transpose(a))) };
        let arc = if let Way::Arc(i) = m.way { Some(g.arcs[i as usize]) } else { None };
        let rotary = if a == b { None } else { Rotary::new(g, solver, start, m) };
        let length = arc.map_or_else(|| norm(sub(m.position, from)), |a| norm(sub(from, a.center)) * a.angle);
        Path { from, to: m.position, turn: *a, vector, angle: norm(vector), arc, rotary, length }
    }

    /// Whether it turns rotary axes alone.
    pub fn turns_alone(&self) -> bool {
        self.rotary.as_ref().is_some_and(|r| r.still.is_some())
    }

    /// Into how many stretches it is cut to be looked at.
    pub fn looks(&self) -> usize {
        let words = self.rotary.as_ref().map_or(0.0, |r| r.by[0].abs().max(r.by[1].abs()));
        let turned = self.angle.max(words).max(self.arc.map_or(0.0, |a| a.angle / 2.0));
        let count = (self.length / STEP).max(turned / ANGLE);
        libm::ceil(count).clamp(1.0, 100_000.0) as usize
    }

    pub fn position(&self, share: f64) -> [f64; 3] {
        match &self.arc {
            _ if share >= 1.0 => self.to,
            Some(a) => {
                let arm = sub(self.from, a.center);
                let turned = rotate(&about(a.normal, a.angle * share), arm);
                add(a.center, turned)
            }
            None => {
                let still = self.rotary.as_ref().and_then(|r| r.position(share));
                still.unwrap_or_else(|| [0, 1, 2].map(|i| self.from[i] + (self.to[i] - self.from[i]) * share))
            }
        }
    }

    pub fn turn(&self, share: f64) -> M3 {
        if let Some(rotary) = &self.rotary {
            return rotary.turn(share);
        }
        if self.angle < 1e-12 {
            return self.turn;
        }
        product(&about(scale(self.vector, 1.0 / self.angle), self.angle * share), &self.turn)
    }

    /// The tool frame in the work frame.
    pub fn at(&self, share: f64) -> Frame {
        Frame { turn: self.turn(share), position: self.position(share) }
    }
}

/// The frame of a tool after a move, seen by the next one: in its work frame, at its tool point.
pub(crate) fn handed_on(g: &Gathered, at: Frame, before: &Move, next: &Move, spin: f64) -> Frame {
    let mut at = at;
    if before.frame != next.frame {
        let [old, new] = [before.frame, next.frame].map(|f| g.frames[usize::from(f)].frame);
        at = new.inverse().then(&old).then(&at);
    }
    if before.tool != next.tool {
        let [old, new] = [before.tool, next.tool].map(|t| g.tools[usize::from(t)].frame);
        let turned = Frame::turned(rot_z(if next.free { spin } else { 0.0 }));
        at = at.then(&turned).then(&old.inverse()).then(&new).then(&turned.inverse());
    }
    at
}

/// From a tool frame in a work frame to the flange in the base.
#[derive(Clone, Copy)]
pub(crate) struct Mount {
    frame: Frame,
    /// Turn about the tool's axis, then from the tool point to the flange.
    tail: Frame,
}

impl Mount {
    pub fn new(g: &Gathered, m: &Move, spin: f64) -> Mount {
        let back = g.tools[usize::from(m.tool)].frame.inverse();
        let tail = if spin == 0.0 || !m.free { back } else { Frame::turned(rot_z(spin)).then(&back) };
        Mount { frame: g.frames[usize::from(m.frame)].frame, tail }
    }
    pub fn flange(&self, tool: &Frame) -> Frame {
        self.frame.then(tool).then(&self.tail)
    }
}
