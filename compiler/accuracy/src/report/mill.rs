//! Errors along a program on a machine tool: its joints are the words of the program, rotary words too, and nothing has to
//! be chosen. Arms are planned first; see `report`.

use super::{Operations, Report, Spot, Walk, pieces};
use crate::error::{Budget, Sensitivity};
use crate::material::Material;
use crate::words::{Asked, Slides, Words, ZeroKey, key, sensitivity, tool};
use gr_ir::measure::{Rates, measure};
use gr_ir::{Axes, Program, Sources, State, View, geometry};
use gr_machine::math::{V3, dot, norm, rotate, scale};
use gr_machine::{Kind, Machine};
use std::rc::Rc;

/// Draws up a report by the words of a program, whose text says which places are the machine's; none on machines whose joints are not
/// its words.
pub fn report_of_words(
    (program, sources): (&Program, &dyn Sources),
    machine: &Machine,
    operations: &Operations,
    budget: &Budget,
    material: Option<&Material>,
    progress: &dyn Fn(usize, usize),
) -> Option<Report> {
    if machine.kind == Kind::Robot {
        return None;
    }
    let Ok(Words::Joints(slides)) = Words::of(machine) else { return None };
    let settled = gr_robot::settled(program, machine, sources, &[], tool);
    // Planning tells where its coordinates can't be told.
    if settled.as_ref().is_some_and(|s| s.finding(sources).is_some()) {
        return None;
    }
    let program = settled.as_ref().map_or(program, |s| &s.program);
    let kinematics = machine.kinematics();
    let mut mill = Mill { walk: Walk::new(machine, &*kinematics, operations, budget, material), slides, zero: None, first_zero: None };
    let count = program.len();
    let mut cursor = program.cursor();
    let mut n = 0;
    while let Some(view) = cursor.next() {
        if n % 4096 == 0 {
            progress(n, count);
        }
        n += 1;
        if view.op.cuts() {
            mill.cut(&view);
        }
    }
    let touched = mill.first_zero;
    Some(Report { touched, ..mill.walk.finish() })
}

struct Mill<'a> {
    walk: Walk<'a>,
    slides: Slides,
    /// What moves the tool point at the program's zero, which was touched on this machine.
    zero: Option<(ZeroKey, Rc<Sensitivity>)>,
    first_zero: Option<V3>,
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
        let mut last: V3 = [0.0; 3];
        geometry::flatten(&view.op, view.start, view.end, CHORD, |to| {
            let way: V3 = [0, 1, 2].map(|i| to[i] - from[i]);
            let turned = (3..6).map(|i| (to[i] - from[i]).abs()).fold(0.0, f64::max);
            let count = pieces(norm(way)).max(turns_apart(&from, to));
            self.walk.turning = !(norm(way) > 0.0) && turned > 0.0;
            let feed = if norm(way) > 0.0 { scale(way, 1.0 / norm(way)) } else { [0.0; 3] };
            since += norm(way);
            // Of the many chords of a curve only some are looked at, and always its ends.
            let bends = dot(last, feed) < libm::cos(super::BEND);
            if since >= super::APART || bends || count > 1 || *to == view.end.axes {
                since = 0.0;
                last = feed;
                for i in 0..=count {
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
        let feed = rotate(&crate::words::frame(machine, state).turn, feed);
        let Some(place) = self.walk.place(view.source, asked.tip, (feed, speed), asked.rotary) else { return };
        let Some(stand) = self.slides.stand(machine, self.walk.kinematics, &asked) else { return };
        for (joint, value) in machine.outside(&stand.joints) {
            if self.walk.outside.iter().all(|(_, known, _)| *known != joint) {
                self.walk.outside.push((view.source, joint, value));
            }
        }
        let zero = self.at_zero(state);
        let (source, turns, rotary, point) = (view.source, self.walk.turning, asked.rotary, asked.tip);
        let (axis, lever) = (stand.axis, stand.lever);
        self.walk.record(&Spot { place, source, joints: stand.joints, point, tool: asked.tool, lever, feed, zero, axis, speed, turns, rotary });
    }

    /// What moves the tool point at the program's zero: the part was touched there, so errors count from there.
    fn at_zero(&mut self, state: &State) -> Option<Rc<Sensitivity>> {
        let machine = self.walk.machine;
        let asked = Asked::new(machine, &[0.0; 9], state);
        let key = key(&asked);
        self.first_zero.get_or_insert(asked.tip);
        if self.zero.as_ref().is_none_or(|(known, _)| *known != key) {
            let s = sensitivity(&self.slides, machine, self.walk.kinematics, &asked)?;
            self.zero = Some((key, Rc::new(s)));
        }
        self.zero.as_ref().map(|(_, s)| s.clone())
    }
}

/// Rotary words are looked at in steps of 2°.
const TURN: f64 = std::f64::consts::PI / 90.0;

/// In how many steps rotary words are looked at.
pub(crate) fn turns_apart(from: &Axes, to: &Axes) -> usize {
    let turned = (3..6).map(|i| (to[i] - from[i]).abs()).fold(0.0, f64::max);
    libm::ceil(turned / TURN).clamp(1.0, 1e4) as usize
}
