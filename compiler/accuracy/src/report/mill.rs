//! Errors along a program on a machine tool: its joints are the words of the program, rotary words too, and nothing has to
//! be chosen. Arms are planned first; see `report`.

use super::{Operations, Report, Spot, Walk, pieces};
use crate::error::Budget;
use crate::material::Material;
use crate::words::{Asked, Words, slid, started};
use gr_ir::measure::{Rates, measure};
use gr_ir::{Axes, Program, State, View, geometry};
use gr_machine::math::{Frame, V3, norm, rotate, scale, sub};
use gr_machine::{Kind, Kinematics, Machine};

/// Draws up a report by the words of a program; none on machines whose joints are not its words.
pub fn report_of_words(
    program: &Program,
    machine: &Machine,
    operations: &Operations,
    budget: &Budget,
    material: Option<&Material>,
    progress: &dyn Fn(usize, usize),
) -> Option<Report> {
    if machine.kind == Kind::Robot {
        return None;
    }
    let Ok(Words::Joints { sliding, turning }) = Words::of(machine) else { return None };
    let kinematics = machine.kinematics();
    let mut mill = Mill { walk: Walk::new(machine, &*kinematics, operations, budget, material), sliding, turning };
    let count = program.len();
    let mut cursor = program.cursor();
    let mut n = 0;
    while let Some(view) = cursor.next() {
        if n % 4096 == 0 {
            progress(n, count);
        }
        n += 1;
        if view.op.feeds() {
            mill.cut(&view);
        }
    }
    Some(mill.walk.finish())
}

struct Mill<'a> {
    walk: Walk<'a>,
    sliding: [usize; 3],
    turning: Vec<(usize, usize)>,
}

/// Chords of a curve are this near to it, mm: the places that are looked at lie on them.
const CHORD: f64 = 1e-3;

impl Mill<'_> {
    fn cut(&mut self, view: &View<'_, '_>) {
        let seconds = measure(view, &Rates::default()).feed_ns as f64 * 1e-9;
        let length = match geometry::length(&view.op, view.start, view.end) {
            geometry::Length::Linear(mm) => mm,
            geometry::Length::Angular(_) => 0.0,
        };
        let speed = if seconds > 0.0 { length / seconds } else { 0.0 };
        let mut from = view.start.axes;
        let mut since = f64::INFINITY;
        geometry::flatten(&view.op, view.start, view.end, CHORD, |to| {
            let way: V3 = [0, 1, 2].map(|i| to[i] - from[i]);
            let turned = (3..6).map(|i| (to[i] - from[i]).abs()).fold(0.0, f64::max);
            let count = pieces(norm(way)).max(turns_apart(&from, to));
            self.walk.turning = !(norm(way) > 0.0) && turned > 0.0;
            let feed = if norm(way) > 0.0 { scale(way, 1.0 / norm(way)) } else { [0.0; 3] };
            since += norm(way);
            // Of the many chords of a curve only some are looked at, and always its end.
            if since >= super::APART || count > 1 || *to == view.end.axes {
                since = 0.0;
                for i in 1..=count {
                    let t = i as f64 / count as f64;
                    let axes = std::array::from_fn(|k| from[k] + (to[k] - from[k]) * t);
                    self.look(&axes, view.state, feed, speed, view);
                }
            }
            from = *to;
        });
    }

    fn look(&mut self, axes: &Axes, state: &State, feed: V3, speed: f64, view: &View<'_, '_>) {
        let machine = self.walk.machine;
        let asked = Asked::new(machine, axes, state);
        let Some(place) = self.walk.place(view.source, asked.tip, asked.rotary) else { return };
        let begun = started(machine, &asked, &self.sliding, &self.turning);
        let kinematics: &dyn Kinematics = self.walk.kinematics;
        let Ok(joints) = slid(kinematics, &begun, &self.sliding, &asked) else { return };
        let Ok(real) = kinematics.forward_frame(&joints) else { return };
        for (joint, value) in machine.outside(&joints) {
            if self.walk.outside.iter().all(|(_, known, _)| *known != joint) {
                self.walk.outside.push((view.source, joint, value));
            }
        }
        let lever = sub(real.then(&Frame::shift(asked.tool.position)).position, real.position);
        let feed = rotate(&crate::words::frame(machine, state).turn, feed);
        let axis = real.turn.map(|r| r[2]);
        self.walk.record(&Spot { place, source: view.source, joints, point: asked.tip, lever, feed, axis, speed, turns: self.walk.turning, rotary: asked.rotary });
    }
}

/// Rotary words are looked at in steps of 2°.
const TURN: f64 = std::f64::consts::PI / 90.0;

/// In how many steps rotary words are looked at.
pub(crate) fn turns_apart(from: &Axes, to: &Axes) -> usize {
    let turned = (3..6).map(|i| (to[i] - from[i]).abs()).fold(0.0, f64::max);
    libm::ceil(turned / TURN).clamp(1.0, 1e4) as usize
}
