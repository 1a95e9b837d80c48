//! Calls held back while cutter compensation looks ahead, as plain data that can be stored and compared.
//!
//! A compensated move is only sent when the next one is known, because an inside corner shortens both. Whatever
//! else the blocks in between ask for (feed, spindle, dwell, comments …) waits behind it in order. The queue knows
//! nothing of corners: [`crate::comp`] decides, the queue keeps, corrects and sends.

use std::hash::{Hash, Hasher};

use gr_canon::{Axes, Call, FileId, FrameId, Nurbs, Plane, Sink};
use gr_spec::{code, rs274};

use crate::arc::sweep;
use crate::run::Place;
use crate::{Fault, Interp, Modal, Res};

/// A straight compensated move.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub rapid: bool,
    /// Direction of the programmed move in the plane, not normalised.
    pub dir: [f64; 2],
    /// End of the tool centre.
    pub end: Axes,
}

/// A compensated arc, or the arc around an outside corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArcMove {
    /// Programmed sweep, radians; 0 = an arc around a corner, which may take any.
    pub sweep: f64,
    /// End of the tool centre in the plane.
    pub end: [f64; 2],
    pub centre: [f64; 2],
    pub turn: i32,
    /// End on the third axis.
    pub third: f64,
    /// End of A B C U V W.
    pub rest: [f64; 6],
}

#[derive(Clone, Debug)]
enum Item {
    Line(Line),
    Arc(ArcMove),
    Other(Call),
}

/// What stands first in the queue, as far as the corner calculation cares.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) enum Front {
    #[default]
    NotArc,
    Arc(ArcMove),
}

/// Calls held back, each with the place that asked for it, and the control points of an open G5.2.
#[derive(Clone, Debug, Default)]
pub struct Queue {
    items: Vec<(Item, Place)>,
    /// Where the tool centre is before the first held-back move, when that is known.
    start: Option<[f64; 2]>,
    /// The controller looks at the first entry even when the queue has just been sent (M0 inside a contour):
    /// it then still sees the old one.
    last_front: Front,
    /// Control points since G5.2.
    pub(crate) spline: Nurbs,
}

impl PartialEq for Queue {
    /// By bits.
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Queue {}

impl Hash for Queue {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.key().hash(state);
    }
}

impl Queue {
    /// Everything that tells two queues apart. Printed doubles read back to the same bits.
    fn key(&self) -> Option<String> {
        let plain = self.items.is_empty() && self.spline.points.is_empty() && matches!(self.last_front, Front::NotArc);
        (!plain || self.start.is_some()).then(|| format!("{self:?}"))
    }
    /// Nothing is held back.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }
    /// Holds a call back.
    pub fn push(&mut self, call: Call, place: Place) {
        self.items.push((Item::Other(call), place));
    }
    /// Lines count from `by` lines further down from now on: a line above the new first one wraps around zero.
    pub fn count_lines_from(&mut self, by: u32) {
        for (_, place) in &mut self.items {
            place.line = place.line.wrapping_sub(by);
        }
    }
    /// Blocks of the main program in this file, outside of calls and loops, asked for everything held back.
    pub fn is_of(&self, file: FileId) -> bool {
        self.items.iter().all(|(_, p)| p.file == file && p.frame == FrameId::MAIN)
    }
    /// The blocks that asked for what is held back are in this file from now on.
    pub fn move_to(&mut self, file: FileId) {
        for (_, place) in &mut self.items {
            place.file = file;
        }
    }
    /// Forgets everything (restart).
    pub fn clear(&mut self) {
        self.last_front = self.front();
        self.items.clear();
        self.start = None;
    }
    /// Compensation is off: nothing of it may be seen by the next contour.
    pub(crate) fn forget_front(&mut self) {
        self.last_front = Front::NotArc;
    }
    /// Holds a straight move back.
    pub(crate) fn push_line(&mut self, line: Line, place: Place) {
        self.items.push((Item::Line(line), place));
    }
    /// Holds an arc back.
    pub(crate) fn push_arc(&mut self, arc: ArcMove, place: Place) {
        self.items.push((Item::Arc(arc), place));
    }
    /// The first entry.
    pub(crate) fn front(&self) -> Front {
        match self.items.first() {
            Some((Item::Arc(arc), _)) => Front::Arc(*arc),
            Some(_) => Front::NotArc,
            None => self.last_front,
        }
    }
    /// Where the tool centre stands before the next held-back move.
    pub(crate) fn set_start(&mut self, start: [f64; 2]) {
        self.start = Some(start);
    }
    /// G20/G21 while moves are held back. (The start point is scaled once per entry, as the controller does.)
    fn scale(&mut self, f: f64) {
        for (item, _) in &mut self.items {
            self.start = self.start.map(|p| p.map(|v| v * f));
            match item {
                Item::Line(l) => [0, 1, 2, 6, 7, 8].iter().for_each(|i| l.end[*i] *= f),
                Item::Arc(a) => {
                    a.end = a.end.map(|v| v * f);
                    a.centre = a.centre.map(|v| v * f);
                    a.third *= f;
                    a.rest[3..].iter_mut().for_each(|v| *v *= f);
                }
                Item::Other(_) => {}
            }
        }
    }
    /// Moves the end of every held-back move to `p`: where the tool touches both sides of the corner.
    fn move_ends(&mut self, p: [f64; 2], plane: Plane, tolerance: f64) -> Res {
        let axes = plane_axes(plane);
        for (item, _) in &mut self.items {
            match item {
                Item::Arc(arc) => move_arc_end(arc, p, self.start, tolerance)?,
                Item::Line(line) => {
                    if !matches!(plane, Plane::Xy | Plane::Xz) {
                        return Err(wrong_plane(plane, line.rapid));
                    }
                    // Backwards means that the corner lies before the start of the move.
                    let back = |s: [f64; 2]| line.dir[0] * (p[0] - s[0]) + line.dir[1] * (p[1] - s[1]) < 0.0;
                    if self.start.is_some_and(back) {
                        let rs = if line.rapid { rs274::COMP_CORNER_TRAVERSE } else { rs274::COMP_CORNER_FEED };
                        return Err(Fault::new(code::COMP_GOUGE, rs));
                    }
                    line.end[axes[0]] = p[0];
                    line.end[axes[1]] = p[1];
                }
                Item::Other(_) => {}
            }
        }
        Ok(())
    }
}

/// G17.1, G18.1 and G19.1 are let through while compensation is on; the next corner can't be found then.
fn wrong_plane(plane: Plane, rapid: bool) -> Box<Fault> {
    let rs = if rapid { rs274::COMP_BUG_PLANE } else { rs274::COMP_BUG_PLANE_FEED };
    Fault::new(code::COMP_NOT_HERE, rs).arg(plane as u8).own_args(&["the working plane is one of the U, V, W axes"])
}

fn move_arc_end(arc: &mut ArcMove, p: [f64; 2], start: Option<[f64; 2]>, tolerance: f64) -> Res {
    let r1 = libm::hypot(arc.end[0] - arc.centre[0], arc.end[1] - arc.centre[1]);
    arc.end = p;
    let r2 = libm::hypot(p[0] - arc.centre[0], p[1] - arc.centre[1]);
    if (r1 - r2).abs() > 0.01 {
        return Err(Fault::new(code::COMP_GOUGE, rs274::COMP_ARC_INVALID)
            .arg(format!("{r1:.6}"))
            .arg(format!("{r2:.6}")));
    }
    let longer = |from| sweep(from, arc.centre, arc.turn, p).abs() > arc.sweep.abs() + tolerance;
    if arc.sweep != 0.0 && start.is_some_and(longer) {
        return Err(Fault::new(code::COMP_GOUGE, rs274::COMP_CORNER_ARC));
    }
    Ok(())
}

/// Indices in [`Axes`] of the first, second and third axis of a plane.
pub(crate) fn plane_axes(plane: Plane) -> [usize; 3] {
    match plane {
        Plane::Xy => [0, 1, 2],
        Plane::Yz => [1, 2, 0],
        Plane::Xz => [2, 0, 1],
        Plane::Uv => [6, 7, 8],
        Plane::Vw => [7, 8, 6],
        Plane::Uw => [8, 6, 7],
    }
}

/// A lathe tool is measured at its imaginary tip, compensation works with the centre of its nose: how far the
/// tip is from the centre along Z and X (in this order: the plane's axes).
fn tip(m: &Modal) -> [f64; 2] {
    let r = m.comp_radius;
    if m.plane() != Plane::Xz {
        return [0.0, 0.0];
    }
    let z = match m.comp_orientation {
        2 | 7 | 3 => -r,
        1 | 5 | 4 => r,
        _ => 0.0,
    };
    let x = match m.comp_orientation {
        2 | 6 | 1 => -r,
        3 | 8 | 4 => r,
        _ => 0.0,
    };
    [z, x]
}

/// The call of a held-back entry, from the tool centre to the tool's reference point.
fn released(item: Item, m: &Modal) -> Call {
    let tip = tip(m);
    let shift = |v: f64, d: f64| if d == 0.0 { v } else { v + d };
    match item {
        Item::Other(call) => call,
        Item::Line(line) => {
            let mut end = line.end;
            end[2] = shift(end[2], tip[0]);
            end[0] = shift(end[0], tip[1]);
            if line.rapid { Call::StraightTraverse(end) } else { Call::StraightFeed(end) }
        }
        Item::Arc(a) => Call::ArcFeed {
            first_end: shift(a.end[0], tip[0]),
            second_end: shift(a.end[1], tip[1]),
            first_axis: shift(a.centre[0], tip[0]),
            second_axis: shift(a.centre[1], tip[1]),
            rotation: a.turn,
            axis_end: a.third,
            rest: a.rest,
        },
    }
}

impl<S: Sink> Interp<'_, S> {
    /// Sends everything that is held back.
    pub(crate) fn dequeue_all(&mut self) {
        self.queue.start = None;
        if self.queue.items.is_empty() {
            return;
        }
        self.queue.last_front = self.queue.front();
        for (item, place) in std::mem::take(&mut self.queue.items) {
            let call = released(item, &self.m);
            self.emit_at(place, &call);
        }
    }
    /// Ends the held-back moves at `p` and sends them.
    pub(crate) fn end_queued_at(&mut self, p: [f64; 2]) -> Res {
        if self.queue.items.is_empty() {
            return Ok(());
        }
        let tolerance = match self.m.units() {
            gr_canon::Units::Mm => 0.0254,
            gr_canon::Units::Inch => 0.001,
        };
        self.queue.move_ends(p, self.m.plane(), tolerance)?;
        self.dequeue_all();
        self.queue.set_start(p);
        Ok(())
    }
    /// G20/G21 while compensation holds moves back.
    pub(crate) fn scale_queue(&mut self, factor: f64) {
        self.queue.scale(factor);
    }
}
