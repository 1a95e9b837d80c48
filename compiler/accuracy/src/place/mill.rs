//! A part on a machine tool. The words of the program are its joints, rotary words too, so that the slides go evenly with the
//! place of the part: where each is within its limits is a space with flat faces, and margins are exact.

use super::{Look, Reach, telling};
use crate::error::{Budget, Errors, Sensitivity};
use crate::map::{Probe, limits};
use crate::report::turns_apart;
use crate::words::{Asked, Slides, Words, put_down, sensitivity, started};
use gr_ir::{Axes, Program, Source, Sources, State, geometry};
use gr_machine::math::{Frame, V3, add, dot, norm, scale, sub};
use gr_machine::{Kind, Kinematics, Machine};
use gr_robot::{By, Coordinates};
use std::collections::{BTreeMap, HashMap, HashSet};

/// The path is looked at this often, mm.
const APART: f64 = 5.0;
/// Points nearer to each other than this, mm, with rotary axes nearer than a hundredth of a degree, are one for the error.
const SAME: f64 = 0.5;
/// Chords of a curve are this near to it, mm.
const CHORD: f64 = 0.05;
/// Slides go with a coordinate by less than this: not at all.
const LEVEL: f64 = 1e-9;
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
    /// What its coordinates are known by: those that are not by a word of the work frame don't go with the part.
    by: [By; 3],
    /// Where it is in the coordinates of the machine, mm.
    fixed: V3,
    /// Of [`Mill::zeros`].
    zero: usize,
    source: Source,
    cuts: bool,
}

impl Stop {
    /// All its coordinates go with the part.
    fn whole(&self) -> bool {
        self.by == [By::Work; 3]
    }
    fn tip(&self, at: V3) -> V3 {
        add(self.point, at)
    }
}

/// What the control works with where the part was touched: errors count from there.
#[derive(Clone, Copy, PartialEq)]
struct Zero {
    tool: usize,
    rotary: [f64; 3],
    point: V3,
}

/// One tool with the rotary axes at one place: the slides are `rows · (origin + point) + base`.
struct Posed {
    rows: [V3; 3],
    base: V3,
    /// Slides that depend on no coordinate that doesn't go with the part.
    counts: [bool; 3],
    /// Least and greatest `row · point` of each slide.
    range: [(f64, f64); 3],
}

/// A program on a machine tool.
pub struct Mill<'a> {
    machine: &'a Machine,
    kinematics: Box<dyn Kinematics>,
    slides: Slides,
    tools: Vec<Frame>,
    zeros: Vec<Zero>,
    /// Of cuts: errors of rapids don't count.
    stops: Vec<Stop>,
    /// Least and greatest coordinates of all points and of the origin.
    span: [(f64, f64); 3],
    few: Vec<usize>,
    faces: Vec<Face>,
    room: Option<[(f64, f64); 3]>,
    /// Rotary axes, and slides at places of the machine, beyond their limits, wherever the part is: each with the first place and its
    /// value.
    pub beyond: Vec<(Source, usize, f64)>,
    /// Slides that the program needs more of than there is, wherever the part is: how much it needs and how much there is, mm.
    pub short: Vec<(usize, f64, f64)>,
}

impl<'a> Mill<'a> {
    /// None on machines whose joints are not the words of a program. Rapids count with their ends where they count.
    pub fn new(machine: &'a Machine, (program, sources): (&Program, &dyn Sources), rapids: bool) -> Option<Mill<'a>> {
        let mut out = Mill::empty(machine)?;
        let mut posed: Vec<Posed> = Vec::new();
        let (mut poses, mut known) = (HashMap::new(), HashSet::new());
        out.walk((program, sources), rapids, &mut |out, stop| {
            out.at_machine(&stop);
            let key = (stop.tool, stop.rotary.map(f64::to_bits), stop.by.map(|by| by == By::Work));
            let n = *poses.entry(key).or_insert_with(|| {
                posed.push(out.posed(&stop));
                posed.len() - 1
            });
            posed[n].take(stop.point);
            (0..3).for_each(|i| out.span[i] = (out.span[i].0.min(stop.point[i]), out.span[i].1.max(stop.point[i])));
            let near = (
                stop.tool,
                stop.zero,
                stop.point.map(|v| (v / SAME).round() as i64),
                stop.rotary.map(|v| (v / 1.7e-4).round() as i64),
            );
            if stop.cuts && stop.whole() && known.insert(near) {
                out.stops.push(stop);
            }
        });
        if posed.is_empty() {
            // A program without any move: its origin.
            out.tools.push(machine.tool_of_length(0.0));
            let (rotary, point, source) = ([0.0; 3], [0.0; 3], Source::default());
            let stop = Stop { tool: 0, rotary, point, by: [By::Work; 3], fixed: point, zero: 0, source, cuts: false };
            let mut at_origin = out.posed(&stop);
            at_origin.take(stop.point);
            posed.push(at_origin);
        }
        out.few = telling(out.stops.len(), |i| out.stops[i].point);
        // Errors grow away from the zero: those far from it tell most.
        let (stops, zeros) = (&out.stops, &out.zeros);
        let far = |i: &usize| norm(sub(stops[*i].point, zeros[stops[*i].zero].point));
        out.few.sort_by(|a, b| far(b).total_cmp(&far(a)));
        out.faces = out.bounded(&posed);
        out.room = out.box_of_faces();
        Some(out)
    }

    /// Joints that leave their limits when the part's origin is there: each with the first place and its value.
    pub fn outside(&self, (program, sources): (&Program, &dyn Sources), at: V3) -> Vec<(Source, usize, f64)> {
        let mut found: Vec<(Source, usize, f64)> = Vec::new();
        let Some(mut look) = Mill::empty(self.machine) else { return found };
        look.walk((program, sources), true, &mut |out, stop| {
            let Some(joints) = out.joints(&stop, at) else { return };
            for (joint, value) in out.machine.outside(&joints) {
                let unsaid = (0..3).any(|i| out.slides.sliding[i] == joint && stop.by[i] != By::Work);
                if !unsaid && found.iter().all(|f| f.1 != joint) {
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
        let Ok(Words::Joints(slides)) = Words::of(machine) else { return None };
        Some(Mill {
            machine,
            kinematics: machine.kinematics(),
            slides,
            tools: Vec::new(),
            zeros: Vec::new(),
            stops: Vec::new(),
            span: [(0.0, 0.0); 3],
            few: Vec::new(),
            faces: Vec::new(),
            room: None,
            beyond: Vec::new(),
            short: Vec::new(),
        })
    }

    /// Calls with every place of the tool that is looked at.
    fn walk(&mut self, (program, sources): (&Program, &dyn Sources), rapids: bool, take: &mut dyn FnMut(&mut Mill<'a>, Stop)) {
        let put = put_down(self.machine, Frame { position: [0.0; 3], ..self.machine.cell.part_in_base() });
        let mut cursor = program.cursor();
        let mut coordinates = Coordinates::new(program);
        while let Some(view) = cursor.next() {
            let before = coordinates.by();
            let after = coordinates.step(program, &view, sources);
            if !view.op.cuts() && !(rapids && view.op.moves()) {
                continue;
            }
            let mut at = |axes: &Axes, cuts: bool, by: [By; 3]| {
                let stop = Stop { source: view.source, cuts, by, ..self.stop(&put, axes, view.state) };
                take(self, stop);
            };
            if !view.op.cuts() {
                at(&view.end.axes, false, after);
                continue;
            }
            // A cut that leads from a place of the machine into the work goes with the part at its end alone.
            let first = [0, 1, 2].map(|i| if before[i] == By::Machine { By::Machine } else { after[i] });
            let between = [0, 1, 2].map(|i| if first[i] == after[i] { after[i] } else { By::Nothing });
            let mut from = view.start.axes;
            at(&from, true, first);
            geometry::flatten(&view.op, view.start, view.end, CHORD, |to| {
                let way: V3 = [0, 1, 2].map(|i| to[i] - from[i]);
                let count = ((norm(way) / APART).ceil().clamp(1.0, 1e5) as usize).max(turns_apart(&from, to));
                for i in 1..=count {
                    let t = i as f64 / count as f64;
                    at(&std::array::from_fn(|k| from[k] + (to[k] - from[k]) * t), true, between);
                }
                from = *to;
            });
            at(&from, true, after);
        }
    }

    /// A place that the program says.
    fn stop(&mut self, put: &Machine, axes: &Axes, state: &State) -> Stop {
        let asked = Asked::new(put, axes, state);
        let tool = place_of(&mut self.tools, asked.tool);
        let zero = Asked::new(put, &[0.0; 9], state);
        let zero = Zero { tool: place_of(&mut self.tools, zero.tool), rotary: zero.rotary, point: zero.tip };
        let zero = place_of(&mut self.zeros, zero);
        let [x, y, z, ..] = state.machine(axes);
        let (fixed, source) = ([x, y, z], Source::default());
        Stop { tool, rotary: asked.rotary, point: asked.tip, by: [By::Work; 3], fixed, zero, source, cuts: true }
    }

    /// Notes slides that a place of the machine sends beyond their limits.
    fn at_machine(&mut self, stop: &Stop) {
        for i in (0..3).filter(|i| stop.by[*i] == By::Machine) {
            let (joint, value) = (self.slides.sliding[i], stop.fixed[i]);
            if !self.machine.joints[joint].allows(value) && self.beyond.iter().all(|t| t.1 != joint) {
                self.beyond.push((stop.source, joint, value));
            }
        }
    }

    /// How the slides go with the tool point while the rotary axes stand; notes rotary axes beyond their limits.
    fn posed(&mut self, stop: &Stop) -> Posed {
        const FAR: f64 = 100.0;
        let slides =
            |tip: V3| self.slid(&Asked { tip, tool: self.tools[stop.tool], rotary: stop.rotary }).unwrap_or_default();
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
            &self.slides.sliding,
            &self.slides.turning,
        );
        for (joint, _) in &self.slides.turning {
            let value = begun[*joint];
            if !self.machine.joints[*joint].allows(value) && self.beyond.iter().all(|t| t.1 != *joint) {
                self.beyond.push((stop.source, *joint, value));
            }
        }
        let counts = rows.map(|row| (0..3).all(|i| stop.by[i] == By::Work || row[i].abs() < LEVEL));
        let range = [(f64::INFINITY, f64::NEG_INFINITY); 3];
        Posed { rows, base, counts, range }
    }

    fn slid(&self, asked: &Asked) -> Option<V3> {
        let joints = self.slides.stand(self.machine, &*self.kinematics, asked)?.joints;
        Some(self.slides.sliding.map(|j| joints[j]))
    }

    fn asked(&self, stop: &Stop, at: V3) -> Asked {
        Asked { tip: stop.tip(at), tool: self.tools[stop.tool], rotary: stop.rotary }
    }

    fn joints(&self, stop: &Stop, at: V3) -> Option<Vec<f64>> {
        self.slides.stand(self.machine, &*self.kinematics, &self.asked(stop, at)).map(|s| s.joints)
    }

    /// The faces of the space where every slide is within its limits; notes slides that are too short.
    fn bounded(&mut self, posed: &[Posed]) -> Vec<Face> {
        let mut faces: BTreeMap<[i64; 3], Face> = BTreeMap::new();
        let mut add_face = |normal: V3, far: f64| {
            let face = faces.entry(normal.map(|v| (v * 1e9).round() as i64)).or_insert(Face { normal, far });
            face.far = face.far.min(far);
        };
        for p in posed {
            for i in (0..3).filter(|i| p.counts[*i]) {
                let row = p.rows[i];
                let (low, high) = limits(&self.machine.joints[self.slides.sliding[i]]);
                let (least, most) = (p.base[i] + p.range[i].0, p.base[i] + p.range[i].1);
                let size = norm(row);
                if size < LEVEL {
                    continue;
                }
                let normal = scale(row, 1.0 / size);
                add_face(normal, (high - most) / size);
                add_face(scale(normal, -1.0), (least - low) / size);
            }
        }
        self.short = (0..3).filter_map(|i| self.too_short(i, &faces)).collect();
        let mut out: Vec<Face> = faces.into_values().collect();
        out.sort_by(|a, b| a.far.total_cmp(&b.far));
        out
    }

    /// Where a slide alone leaves no room for the part: how much of it is needed and how much there is.
    fn too_short(&self, i: usize, faces: &BTreeMap<[i64; 3], Face>) -> Option<(usize, f64, f64)> {
        let joint = self.slides.sliding[i];
        let (low, high) = limits(&self.machine.joints[joint]);
        let one = 1_000_000_000;
        let far = |sign: i64| {
            let mut normal = [0; 3];
            normal[i] = sign * one;
            faces.get(&normal).map(|f| f.far)
        };
        let room = far(1)? + far(-1)?;
        (room < -ROUNDING).then_some((joint, high - low - room, high - low))
    }

    /// A box about the space within the faces: a face bounds each coordinate by the most that the others can make of it.
    fn box_of_faces(&self) -> Option<[(f64, f64); 3]> {
        const ROUNDS: usize = 12;
        const SOME: usize = 2_000;
        let long = self.tools.iter().map(|t| norm(t.position)).fold(0.0, f64::max);
        let extent = Probe::downward(self.machine).extent_of_all_turns();
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

    fn starts(&self) -> usize {
        8
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
        let zero = |z: &Zero| {
            let tip = add(at, z.point);
            sensitivity(&self.slides, self.machine, &*self.kinematics, &Asked { tip, tool: self.tools[z.tool], rotary: z.rotary })
        };
        let zeros: Vec<Option<Sensitivity>> = self.zeros.iter().map(zero).collect();
        let mut out = 0.0f64;
        for n in 0..count {
            let stop = if look == Look::All { &self.stops[n] } else { &self.stops[self.few[n]] };
            let s = sensitivity(&self.slides, self.machine, &*self.kinematics, &self.asked(stop, at))?;
            let s = match &zeros[stop.zero] {
                Some(zero) => s.since(zero),
                None => s,
            };
            out = out.max(Errors::new(&s, budget, None).sum());
            if out > most {
                return None;
            }
        }
        Some(out)
    }
}

/// Where a value is in a list; put there when it is new.
fn place_of<T: PartialEq>(list: &mut Vec<T>, value: T) -> usize {
    list.iter().position(|v| *v == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}
