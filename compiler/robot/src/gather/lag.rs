//! After a change of the tool offset the tool stands elsewhere than the program believes it, until a move names the coordinate.

use gr_backends::sources::Words as Letters;
use gr_ir::{Op, Pose, State};
use gr_machine::Kind;
use gr_machine::math::{add, sub};
use gr_text::code;

use super::{Gather, NEAR};

impl Gather<'_> {
    /// How far the tool stands from where the program believes it, in the work frame, where the tool offset was changed
    /// while it stood still.
    pub(super) fn lag(&mut self, frame: u16, believed: [f64; 3]) -> [f64; 3] {
        let mut lag = [0.0; 3];
        if let Some(at) = self.at.filter(|_| self.offset && self.probed.is_none()) {
            let here = self.out.frames[usize::from(frame)].frame.inverse().apply(at.position);
            lag = sub(here, believed).map(|v| if v.abs() < NEAR { 0.0 } else { v });
            self.offset = lag != [0.0; 3];
        }
        (0..3).for_each(|i| self.said[i] |= lag[i] == 0.0);
        lag
    }

    /// Directions that a move brings to a coordinate: by its words, also where the program believes the tool there already,
    /// or because they change.
    fn named(&self, start: &Pose, end: &Pose, state: &State) -> [bool; 3] {
        let letters = match self.inserted {
            // The way to a restart begins anywhere: it names what it changes.
            true => Some(Letters::default()),
            false if self.planned => None,
            false => Letters::at(self.findings.sources, self.source.file, self.source.line),
        };
        let Some(letters) = letters else { return [true; 3] };
        let home = (letters.g(280) || letters.g(300)) && !letters.names_axes();
        // In a cycle the letter of its own axis is the depth, which each move takes when it gets there.
        let depth = self.cycle.map(|_| gr_ir::plane_axes(state.plane).2);
        [0, 1, 2].map(|i| start.axes[i] != end.axes[i] || home || letters.has(b"xyz"[i]) && depth != Some(i))
    }

    /// A move from where the tool stands instead of where the program believes it: what it doesn't name stays. None where
    /// a curve would be bent.
    pub(super) fn held<'v>(&mut self, op: Op<'v>, start: &Pose, end: &Pose, state: &State, lag: [f64; 3]) -> Option<(Op<'v>, Pose, Pose)> {
        let mut named = self.named(start, end, state);
        let mut op = op;
        match &mut op {
            Op::Arc(arc) => {
                match arc.plane {
                    gr_ir::ArcPlane::Work(plane) => {
                        let (u, v, _) = gr_ir::plane_axes(plane);
                        (named[u], named[v]) = (true, true);
                    }
                    gr_ir::ArcPlane::Free(_) => named = [true; 3],
                }
                arc.center = [0, 1, 2].map(|i| if named[i] { arc.center[i] } else { arc.center[i] + lag[i] });
            }
            Op::Nurbs { .. } => (named[0], named[1]) = (true, true),
            _ => {}
        }
        // An increment goes on from where the tool stands; the way to a restart has none.
        let increments = !self.inserted && self.increments.at(self.findings.sources, self.source);
        // A tilted tool is aside then of what a mill's program has named before: its control knows of no such way, and brings it there.
        let aside = [0, 1, 2].map(|i| self.machine.kind == Kind::Mill && lag[i] != 0.0 && self.said[i] && !self.shifted[i] && !named[i]);
        let cut_aside = op != Op::Rapid && aside.contains(&true);
        let straight = matches!(op, Op::Linear | Op::Rapid);
        if cut_aside || !straight && (0..3).any(|i| named[i] && lag[i] != 0.0) {
            self.nowhere(add(start.xyz(), lag), start.xyz());
            // Told once: what follows is looked at from where this cut ends.
            self.offset = false;
            (self.at, self.at_change) = (None, None);
            return None;
        }
        let goes = [0, 1, 2].map(|i| named[i] && !increments || aside[i]);
        self.tell_offset(start.xyz(), lag, goes.map(|goes| !goes));
        let (mut from, mut to) = (*start, *end);
        for i in 0..3 {
            from.axes[i] += lag[i];
            to.axes[i] += if goes[i] { 0.0 } else { lag[i] };
            self.said[i] |= goes[i];
        }
        Some((op, from, to))
    }

    /// Tells once that the tool stands elsewhere than the program has said, where a move leaves it so.
    fn tell_offset(&mut self, believed: [f64; 3], lag: [f64; 3], stays: [bool; 3]) {
        let axes = (0..3).filter(|i| lag[*i] != 0.0 && stays[*i] && self.said[*i]);
        let leaves = axes.clone().next().is_some();
        if !leaves || std::mem::replace(&mut self.offset_told, true) {
            return;
        }
        let show = |p: [f64; 3]| axes.clone().map(|i| format!("{} {}", ["X", "Y", "Z"][i], gr_text::figures::number(p[i], 3))).collect::<Vec<_>>().join(" ");
        self.findings.say(code::ROBOT_OFFSET_MOVED, Some(self.source), &[show(believed), show(add(believed, lag))]);
    }

    pub(super) fn nowhere(&mut self, here: [f64; 3], believed: [f64; 3]) {
        self.findings.say(code::ROBOT_NO_RAPID, Some(self.source), &[believed, here].map(crate::plan::show));
    }
}
