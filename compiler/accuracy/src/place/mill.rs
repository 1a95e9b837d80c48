//! A part on a machine tool. The words of the program are its joints, rotary words too, so that the slides go evenly with the
//! place of the part: where each is within its limits is a space with flat faces, and margins are exact.

use super::{Look, Reach, telling};
use crate::error::{Budget, Errors, Sensitivity};
use crate::map::{Probe, limits};
use crate::report::turns_apart;
use crate::words::{Asked, Words, put_down, slid, started};
use gr_ir::{Axes, Program, Source, State, geometry};
use gr_machine::math::{Frame, V3, add, dot, norm, scale, sub};
use gr_machine::{Kind, Kinematics, Machine};
use std::collections::{BTreeMap, HashMap, HashSet};

/// The path is looked at this often, mm.
const APART: f64 = 5.0;
/// Points nearer to each other than this, mm, with rotary axes nearer than a hundredth of a degree, are one for the error.
const SAME: f64 = 0.5;
/// Chords of a curve are this near to it, mm.
const CHORD: f64 = 0.05;
/// A slide may be beyond its limit by rounding, mm.
const ROUNDING: f64 = 1e-9;

/// Places of the part's origin `p` with `normal · p ≤ far`.
#[derive(Clone, Copy)]
struct Face {
    normal: V3,
    far: f64,
}

/// A place of the tool.
#[derive(Clone, Copy)]
struct Stop {
    tool: usize,
    rotary: [f64; 3],
    /// From the part's origin in the directions of the base, mm.
    point: V3,
    source: Source,
    cuts: bool,
}

/// One tool with the rotary axes at one place: the slides are `rows · (origin + point) + base`.
struct Posed {
    rows: [V3; 3],
    base: V3,
    /// Least and greatest `row · point` of each slide.
    range: [(f64, f64); 3],
}

/// A program on a machine tool.
pub struct Mill<'a> {
    machine: &'a Machine,
    kinematics: Box<dyn Kinematics>,
    sliding: [usize; 3],
    turning: Vec<(usize, usize)>,
    tools: Vec<Frame>,
    /// Of cuts: errors of rapids don't count.
    stops: Vec<Stop>,
    /// Least and greatest coordinates of all points and of the origin.
    span: [(f64, f64); 3],
    few: Vec<usize>,
    faces: Vec<Face>,
    room: Option<[(f64, f64); 3]>,
    /// Rotary axes beyond their limits, wherever the part is: each with the first place and its value.
    pub turned: Vec<(Source, usize, f64)>,
}

impl<'a> Mill<'a> {
    /// None on machines whose joints are not the words of a program. Rapids count with their ends where they count.
    pub fn new(machine: &'a Machine, program: &Program, rapids: bool) -> Option<Mill<'a>> {
        let mut out = Mill::empty(machine)?;
        let mut posed: Vec<Posed> = Vec::new();
        let (mut poses, mut known) = (HashMap::new(), HashSet::new());
        out.walk(program, rapids, &mut |out, stop| {
            let key = (stop.tool, stop.rotary.map(f64::to_bits));
            let n = *poses.entry(key).or_insert_with(|| {
                posed.push(out.posed(&stop));
                posed.len() - 1
            });
            posed[n].take(stop.point);
            (0..3).for_each(|i| out.span[i] = (out.span[i].0.min(stop.point[i]), out.span[i].1.max(stop.point[i])));
            let near = (
                stop.tool,
                stop.point.map(|v| (v / SAME).round() as i64),
                stop.rotary.map(|v| (v / 1.7e-4).round() as i64),
            );
            if stop.cuts && known.insert(near) {
                out.stops.push(stop);
            }
        });
        if posed.is_empty() {
            // A program without any move: its origin.
            out.tools.push(machine.tool_of_length(0.0));
            let stop = Stop { tool: 0, rotary: [0.0; 3], point: [0.0; 3], source: Source::default(), cuts: false };
            let mut at_origin = out.posed(&stop);
            at_origin.take(stop.point);
            posed.push(at_origin);
        }
        out.few = telling(out.stops.len(), |i| out.stops[i].point);
        out.faces = out.bounded(&posed);
        out.room = out.box_of_faces();
        Some(out)
    }

    /// Joints that leave their limits when the part's origin is there: each with the first place and its value.
    pub fn outside(&self, program: &Program, at: V3) -> Vec<(Source, usize, f64)> {
        let mut found: Vec<(Source, usize, f64)> = Vec::new();
        let Some(mut look) = Mill::empty(self.machine) else { return found };
        look.walk(program, true, &mut |out, stop| {
            let Some(joints) = out.joints(&stop, at) else { return };
            for (joint, value) in out.machine.outside(&joints) {
                if found.iter().all(|f| f.1 != joint) {
                    found.push((stop.source, joint, value));
                }
            }
        });
        found
    }

    fn empty(machine: &'a Machine) -> Option<Mill<'a>> {
        if machine.kind == Kind::Robot {
            return None;
        }
        let Ok(Words::Joints { sliding, turning }) = Words::of(machine) else { return None };
        Some(Mill {
            machine,
            kinematics: machine.kinematics(),
            sliding,
            turning,
            tools: Vec::new(),
            stops: Vec::new(),
            span: [(0.0, 0.0); 3],
            few: Vec::new(),
            faces: Vec::new(),
            room: None,
            turned: Vec::new(),
        })
    }

    /// Calls with every place of the tool that is looked at.
    fn walk(&mut self, program: &Program, rapids: bool, take: &mut dyn FnMut(&mut Mill<'a>, Stop)) {
        let put = put_down(self.machine, Frame { position: [0.0; 3], ..self.machine.cell.part_in_base() });
        let mut cursor = program.cursor();
        while let Some(view) = cursor.next() {
            if !view.op.feeds() && !(rapids && view.op.moves()) {
                continue;
            }
            let mut at = |axes: &Axes, state: &State, cuts: bool| {
                let asked = Asked::new(&put, axes, state);
                let tool = self.tools.iter().position(|t| *t == asked.tool).unwrap_or_else(|| {
                    self.tools.push(asked.tool);
                    self.tools.len() - 1
                });
                take(self, Stop { tool, rotary: asked.rotary, point: asked.tip, source: view.source, cuts });
            };
            if !view.op.feeds() {
                at(&view.end.axes, view.state, false);
                continue;
            }
            let mut from = view.start.axes;
            at(&from, view.state, true);
            geometry::flatten(&view.op, view.start, view.end, CHORD, |to| {
                let way: V3 = [0, 1, 2].map(|i| to[i] - from[i]);
                let count = ((norm(way) / APART).ceil().clamp(1.0, 1e5) as usize).max(turns_apart(&from, to));
                for i in 1..=count {
                    let t = i as f64 / count as f64;
                    at(&std::array::from_fn(|k| from[k] + (to[k] - from[k]) * t), view.state, true);
                }
                from = *to;
            });
        }
    }

    /// How the slides go with the tool point while the rotary axes stand; notes rotary axes beyond their limits.
    fn posed(&mut self, stop: &Stop) -> Posed {
        const FAR: f64 = 100.0;
        let slides =
            |tip: V3| self.slides(&Asked { tip, tool: self.tools[stop.tool], rotary: stop.rotary }).unwrap_or_default();
        let base = slides([0.0; 3]);
        let columns = [0, 1, 2].map(|i| {
            let mut tip = [0.0; 3];
            tip[i] = FAR;
            scale(sub(slides(tip), base), 1.0 / FAR)
        });
        let rows = [0, 1, 2].map(|i| columns.map(|c| c[i]));
        let begun = started(
            self.machine,
            &Asked { tip: [0.0; 3], tool: Frame::IDENTITY, rotary: stop.rotary },
            &self.sliding,
            &self.turning,
        );
        for (joint, _) in &self.turning {
            let value = begun[*joint];
            if !self.machine.joints[*joint].allows(value) && self.turned.iter().all(|t| t.1 != *joint) {
                self.turned.push((stop.source, *joint, value));
            }
        }
        Posed { rows, base, range: [(f64::INFINITY, f64::NEG_INFINITY); 3] }
    }

    fn slides(&self, asked: &Asked) -> Option<V3> {
        let begun = started(self.machine, asked, &self.sliding, &self.turning);
        let joints = slid(&*self.kinematics, &begun, &self.sliding, asked).ok()?;
        Some(self.sliding.map(|j| joints[j]))
    }

    fn joints(&self, stop: &Stop, at: V3) -> Option<Vec<f64>> {
        let asked = Asked { tip: add(at, stop.point), tool: self.tools[stop.tool], rotary: stop.rotary };
        let begun = started(self.machine, &asked, &self.sliding, &self.turning);
        slid(&*self.kinematics, &begun, &self.sliding, &asked).ok()
    }

    /// The faces of the space where every slide is within its limits.
    fn bounded(&self, posed: &[Posed]) -> Vec<Face> {
        let mut faces: BTreeMap<[i64; 3], Face> = BTreeMap::new();
        let mut add_face = |normal: V3, far: f64| {
            let face = faces.entry(normal.map(|v| (v * 1e9).round() as i64)).or_insert(Face { normal, far });
            face.far = face.far.min(far);
        };
        for p in posed {
            for i in 0..3 {
                let size = norm(p.rows[i]);
                if size < 1e-9 {
                    continue;
                }
                let (low, high) = limits(&self.machine.joints[self.sliding[i]]);
                let normal = scale(p.rows[i], 1.0 / size);
                add_face(normal, (high - p.base[i] - p.range[i].1) / size);
                add_face(scale(normal, -1.0), (p.base[i] + p.range[i].0 - low) / size);
            }
        }
        let mut out: Vec<Face> = faces.into_values().collect();
        out.sort_by(|a, b| a.far.total_cmp(&b.far));
        out
    }

    /// A box about the space within the faces: a face bounds each coordinate by the most that the others can make of it.
    fn box_of_faces(&self) -> Option<[(f64, f64); 3]> {
        const ROUNDS: usize = 12;
        const SOME: usize = 2_000;
        let long = self.tools.iter().map(|t| norm(t.position)).fold(0.0, f64::max);
        let extent = Probe::downward(self.machine).extent();
        let mut room = [0, 1, 2].map(|i| (extent[i].0 - long - self.span[i].1, extent[i].1 + long - self.span[i].0));
        for _ in 0..ROUNDS {
            for face in self.faces.iter().take(SOME) {
                let least = [0, 1, 2].map(|i| (face.normal[i] * room[i].0).min(face.normal[i] * room[i].1));
                for i in 0..3 {
                    let n = face.normal[i];
                    let rest = face.far - (least[0] + least[1] + least[2] - least[i]);
                    if n > 1e-6 {
                        room[i].1 = room[i].1.min(rest / n);
                    } else if n < -1e-6 {
                        room[i].0 = room[i].0.max(rest / n);
                    }
                }
            }
        }
        // What only just fits has no room but for rounding.
        let narrow =
            |(low, high): (f64, f64)| if low > high { ((low + high) / 2.0, (low + high) / 2.0) } else { (low, high) };
        let fits = room.iter().all(|(low, high)| low - high <= 1e-6);
        fits.then(|| room.map(narrow))
    }
}

impl Posed {
    fn take(&mut self, point: V3) {
        for (row, range) in self.rows.iter().zip(&mut self.range) {
            let v = dot(*row, point);
            *range = (range.0.min(v), range.1.max(v));
        }
    }
}

impl Reach for Mill<'_> {
    fn room(&self) -> Option<[(f64, f64); 3]> {
        self.room
    }

    fn free(&self, at: V3, _: Look, least: f64) -> Option<f64> {
        let mut out = f64::INFINITY;
        for face in &self.faces {
            out = out.min(face.far - dot(face.normal, at));
            if out <= least {
                return None;
            }
        }
        Some(out)
    }

    fn fits(&self, at: V3) -> bool {
        self.faces.iter().all(|f| f.far - dot(f.normal, at) >= -ROUNDING)
    }

    fn margin(&self, at: V3, _: f64) -> (f64, f64) {
        (self.free(at, Look::All, f64::NEG_INFINITY).unwrap_or(0.0).max(0.0), 0.0)
    }

    fn exact(&self) -> bool {
        true
    }

    fn error(&self, budget: &Budget, at: V3, look: Look, most: f64) -> Option<f64> {
        if !budget.tells_any() {
            return None;
        }
        let count = match look {
            Look::Glance => self.few.len().min(2),
            Look::Some => self.few.len(),
            Look::All => self.stops.len(),
        };
        let mut out = 0.0f64;
        for n in 0..count {
            let stop = if look == Look::All { &self.stops[n] } else { &self.stops[self.few[n]] };
            let joints = self.joints(stop, at)?;
            let real = self.kinematics.forward_frame(&joints).ok()?;
            let lever = sub(real.then(&Frame::shift(self.tools[stop.tool].position)).position, real.position);
            let s = Sensitivity::new(self.machine, &joints, lever).ok()?;
            out = out.max(Errors::new(&s, budget, None).sum());
            if out > most {
                return None;
            }
        }
        Some(out)
    }
}
