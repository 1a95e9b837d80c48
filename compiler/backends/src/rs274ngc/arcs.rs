//! Arcs whose rounded numbers still make a circle.
//!
//! Rounding moves the start, the end and the centre, and a control refuses an arc whose two radii differ too
//! much. Each arc is therefore written, read back as the control reads it, and compared with the arc that was
//! meant; if it fails, the centre is moved to where both radii agree and written with more decimals, and if that
//! does not help either the arc is divided or becomes straight pieces.

use super::emit::Emitter;
use super::write::AXES;
use super::{Arcs, Language};
use crate::sweep::Sweep;
use gr_ir::{Arc, ArcPlane, Axes, Plane, Pose, State, View};
use gr_text::code;

/// Radius difference that every control takes, mm.
const RADIUS_ROOM: f64 = 0.002;

/// LinuxCNC refuses arcs about a centre nearer than 0.00005 inch to one of their ends, mm; above the noise of its sums.
const LEAST_RADIUS: f64 = 0.000_05 * 25.4 + 1e-9;

/// One way to write an arc.
struct Candidate {
    words: Vec<String>,
    end: Axes,
    center: [f64; 3],
    extra: usize,
}

impl Emitter<'_> {
    pub fn arc(&mut self, view: &View<'_, '_>, arc: &Arc) {
        // Where turns must be written one by one, this many are a mistake rather than a helix.
        const TURNS: i32 = 10_000;
        if arc.turns.unsigned_abs() > TURNS.unsigned_abs() {
            return self.cannot("an arc of more than 10000 turns", view.source);
        }
        if view.state.sync.is_some_and(|s| !s.velocity) {
            return self.cannot("an arc that follows the spindle", view.source);
        }
        let sweep = Sweep::new(view.start, view.end, arc);
        let plane = match arc.plane {
            ArcPlane::Work(p @ (Plane::Xy | Plane::Xz | Plane::Yz)) => p,
            _ => return self.arc_as_lines(view, &sweep, 0.0, 1.0),
        };
        let other = self.options.only_xy_arcs && plane != Plane::Xy;
        if self.options.arcs == Arcs::Lines || other || self.too_small(sweep.shape.radius) {
            return self.arc_as_lines(view, &sweep, 0.0, 1.0);
        }
        let parts = self.parts(&sweep, arc.turns);
        for k in 0..parts {
            let (from, to) = (k as f64 / parts as f64, (k + 1) as f64 / parts as f64);
            let turns = if parts == 1 { arc.turns } else { arc.turns.signum() };
            self.part(view, &sweep, plane, (from, to), turns, 0);
        }
    }

    /// Whether the control refuses an arc of this radius: with R it asks for none.
    fn too_small(&self, radius: f64) -> bool {
        self.linuxcnc() && self.options.arcs != Arcs::R && radius < LEAST_RADIUS
    }

    /// Into how many equal parts the language makes us divide.
    fn parts(&self, sweep: &Sweep, turns: i32) -> usize {
        let turn = 2.0 * std::f64::consts::PI;
        let most = match (self.options.arcs, self.options.language) {
            // Near the half circle a radius says little about the centre.
            (Arcs::R, _) => 0.45 * turn,
            (_, Language::Linuxcnc) => return 1,
            _ => turn * (1.0 + 1e-9),
        };
        if turns.abs() <= 1 && self.options.arcs != Arcs::R {
            return 1;
        }
        libm::ceil(sweep.angle().abs() / most).clamp(1.0, 100_000.0) as usize
    }

    fn arc_as_lines(&mut self, view: &View<'_, '_>, sweep: &Sweep, from: f64, to: f64) {
        let pieces = sweep.shape.pieces(self.options.arc_tolerance) as f64 * (to - from);
        let pieces = libm::ceil(pieces).max(1.0) as usize;
        self.rounding = true;
        self.lines(pieces, view.state, view.source, &|share| sweep.at(from + (to - from) * share));
        self.rounding = false;
    }

    fn part(
        &mut self,
        view: &View<'_, '_>,
        sweep: &Sweep,
        plane: Plane,
        (from, to): (f64, f64),
        turns: i32,
        depth: u32,
    ) {
        let (start, end) = (sweep.at(from), sweep.at(to));
        let meant = Meant { sweep, from, to, turns, plane };
        let found = match self.may_vanish(&meant, &end) {
            true => None,
            false => (0..=4).find_map(|extra| self.candidate(&meant, &end, extra, view.state)),
        };
        if let Some(c) = found {
            if c.extra > 0 {
                let args = [(self.w.places + c.extra).to_string(), self.w.places.to_string()];
                self.say(code::EMIT_ARC_DECIMALS, view.source, &args);
            }
            return self.write(view, &start, &end, plane, turns, &c);
        }
        let angle = sweep.angle().abs() * (to - from);
        if depth < 3 && angle > 1e-3 {
            // Pieces well below a half turn, so that no rounding can turn one into a full circle.
            let parts = libm::ceil(angle / 2.5).clamp(2.0, 100_000.0);
            for k in 0..parts as usize {
                let at = |k: usize| from + (to - from) * (k as f64 / parts);
                self.part(view, sweep, plane, (at(k), at(k + 1)), turns.signum(), depth + 1);
            }
        } else {
            if sweep.shape.pieces(self.options.arc_tolerance) > 1 {
                self.say(code::EMIT_ARC_PIECES, view.source, &[self.options.arc_tolerance.to_string()]);
            }
            self.arc_as_lines(view, sweep, from, to);
        }
    }

    /// Whether the arc comes back so near to its start that the last bits of the start decide whether a control
    /// makes a full turn or none. Only a start that was written as the same number is sure.
    fn may_vanish(&self, meant: &Meant<'_>, end: &Pose) -> bool {
        let (f, s, _) = plane_axes(meant.plane);
        let said = [f, s].map(|i| self.w.axis(i, end.axes[i]).1);
        let same = [f, s].into_iter().zip(said).all(|(i, v)| self.anchored[i] && self.at[i] == v);
        let gap = libm::hypot(said[0] - self.at[f], said[1] - self.at[s]);
        !same && gap < 20.0 * self.w.step() && meant.angle().abs() > 3.0
    }

    /// The arc written with `extra` more decimals in its centre or radius, if it reads back right.
    fn candidate(&self, meant: &Meant<'_>, end: &Pose, extra: usize, state: &State) -> Option<Candidate> {
        let (f, s, t) = plane_axes(meant.plane);
        let mut said_end = end.axes;
        for (i, v) in said_end.iter_mut().enumerate() {
            *v = self.w.axis(i, *v).1;
        }
        let center = meant.sweep.shape.center;
        let ways: [[f64; 2]; 2] = [
            [center[f], center[s]],
            even_center([self.at[f], self.at[s]], [said_end[f], said_end[s]], [center[f], center[s]]),
        ];
        ways.into_iter().find_map(|c| {
            let places = self.w.places + extra;
            let (words, said) = match self.options.arcs {
                Arcs::R => self.radius_word([self.at[f], self.at[s]], [said_end[f], said_end[s]], c, meant, places)?,
                _ => self.center_words((f, s), c, places),
            };
            // A radius that rounding has made nothing: no control takes it.
            if said == [self.at[f], self.at[s]] {
                return None;
            }
            let mut center = [0.0; 3];
            (center[f], center[s], center[t]) = (said[0], said[1], self.at[t]);
            let candidate = Candidate { words, end: said_end, center, extra };
            self.reads_back(meant, &candidate, state).then_some(candidate)
        })
    }

    /// I J K, and the centre they say.
    fn center_words(&self, (f, s): (usize, usize), center: [f64; 2], places: usize) -> (Vec<String>, [f64; 2]) {
        let absolute = self.options.arcs == Arcs::IjkAbsolute;
        let mut said = [0.0; 2];
        let mut words = Vec::with_capacity(2);
        for (k, axis) in [f, s].into_iter().enumerate() {
            let base = if absolute { 0.0 } else { self.at[axis] };
            let (text, value) = self.w.length(center[k] - base, places);
            said[k] = base + value;
            words.push(format!("{}{text}", ['I', 'J', 'K'][axis]));
        }
        // Always in the order I J K.
        words.sort();
        (words, said)
    }

    /// R, and the centre a control makes of it.
    fn radius_word(
        &self,
        from: [f64; 2],
        to: [f64; 2],
        center: [f64; 2],
        meant: &Meant<'_>,
        places: usize,
    ) -> Option<(Vec<String>, [f64; 2])> {
        let radius = libm::hypot(from[0] - center[0], from[1] - center[1]);
        let long = meant.angle().abs() > std::f64::consts::PI;
        let (text, said) = self.w.length(if long { -radius } else { radius }, places);
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let chord = libm::hypot(dx, dy);
        let square = said * said - 0.25 * chord * chord;
        if chord == 0.0 || square < 0.0 {
            return None;
        }
        let height = libm::sqrt(square) / chord;
        // Left of the chord for the short way round counter-clockwise.
        let side = if (meant.turns > 0) != long { 1.0 } else { -1.0 };
        let c = [from[0] + 0.5 * dx - side * height * dy, from[1] + 0.5 * dy + side * height * dx];
        Some((vec![format!("R{text}")], c))
    }

    /// Whether a control that reads the numbers goes where it should.
    fn reads_back(&self, meant: &Meant<'_>, c: &Candidate, _state: &State) -> bool {
        let arc = Arc { plane: ArcPlane::Work(meant.plane), center: c.center, turns: meant.turns };
        let (start, end) = (Pose::at(self.at), Pose::at(c.end));
        let read = Sweep::new(&start, &end, &arc);
        let (f, s, _) = plane_axes(meant.plane);
        if [self.at, c.end].iter().any(|p| self.too_small(libm::hypot(p[f] - c.center[f], p[s] - c.center[s]))) {
            return false;
        }
        let own = meant.sweep.mismatch();
        let off = read.mismatch();
        // A spiral that LinuxCNC took in the source it takes again, by its rule for the unit that is written.
        let (small, radius) = (0.00282 * if self.w.unit == 1.0 { 10.0 } else { 25.4 }, read.shape.radius);
        let accepted = off <= small || (off <= 0.000_99 * radius && off <= 99.0 * small);
        let spiral = self.linuxcnc() && off <= own * 1.0001 + 1e-6 && accepted;
        if off > RADIUS_ROOM && !spiral {
            return false;
        }
        if (read.angle() - meant.angle()).abs() > 0.5 {
            return false;
        }
        // The ends are off by up to √3/2 of the last decimal already.
        let allowed = 1.25 * self.w.step() + 1e-9;
        [0.25, 0.5, 0.75].into_iter().all(|share| {
            let (p, q) = (read.at(share).axes, meant.at(share).axes);
            let square: f64 = (0..3).map(|i| (p[i] - q[i]) * (p[i] - q[i])).sum();
            square <= allowed * allowed
        })
    }

    fn write(&mut self, view: &View<'_, '_>, start: &Pose, end: &Pose, plane: Plane, turns: i32, c: &Candidate) {
        let (f, s, _) = plane_axes(plane);
        if plane != self.plane {
            self.w.block(plane.code());
            self.plane = plane;
        }
        let mut line = vec![if turns > 0 { "G3".to_string() } else { "G2".to_string() }];
        self.rounding = true;
        let forced: Vec<usize> = [f, s].into_iter().filter(|i| self.is_placed(*i, start, end, view.source)).collect();
        let words = self.axis_words(start, end, view.source, &forced);
        self.rounding = false;
        let far = words.iter().find(|w| {
            let axis = AXES.iter().position(|a| w.starts_with(*a)).unwrap_or(0);
            match self.options.language {
                Language::Linuxcnc => false,
                Language::FanucMill => axis >= 6,
                Language::Grbl => axis >= 3,
            }
        });
        if let Some(word) = far {
            let what = format!("an arc that also moves {}", &word[..1]);
            return self.cannot(&what, view.source);
        }
        line.extend(words);
        line.extend(c.words.iter().cloned());
        if turns.abs() > 1 {
            line.push(format!("P{}", turns.abs()));
        }
        line.extend(self.feed_words(view.state, start, end, view.source));
        self.w.block(&line.join(" "));
        self.motion = None;
    }
}

/// The arc that is meant: a stretch of a sweep.
struct Meant<'a> {
    sweep: &'a Sweep,
    from: f64,
    to: f64,
    turns: i32,
    plane: Plane,
}

impl Meant<'_> {
    fn angle(&self) -> f64 {
        self.sweep.angle() * (self.to - self.from)
    }
    fn at(&self, share: f64) -> Pose {
        self.sweep.at(self.from + (self.to - self.from) * share)
    }
}

/// The point nearest to `center` that is equally far from both ends.
fn even_center(from: [f64; 2], to: [f64; 2], center: [f64; 2]) -> [f64; 2] {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let square = dx * dx + dy * dy;
    if square == 0.0 {
        return center;
    }
    let middle = [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])];
    let along = ((center[0] - middle[0]) * dx + (center[1] - middle[1]) * dy) / square;
    [center[0] - along * dx, center[1] - along * dy]
}

pub(super) fn plane_axes(plane: Plane) -> (usize, usize, usize) {
    match plane {
        Plane::Xy | Plane::Uv => (0, 1, 2),
        Plane::Xz | Plane::Uw => (2, 0, 1),
        Plane::Yz | Plane::Vw => (1, 2, 0),
    }
}
