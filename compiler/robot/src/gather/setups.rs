//! Setups of a job: where the part is clamped anew, and whether the tool may come to it there. A new clamping begins with
//! a retract, a stop for the operator and a rapid from above, so the program must begin the setup at a rapid to a
//! height above the work.

use gr_ir::Pose;
use gr_machine::Kind;
use gr_machine::math::{dot, norm, rotate, scale, sub, transpose};
use gr_text::code;

use super::{Clamped, Gather, Item, Move};
use crate::Action;
use crate::settle::setup_at;

/// A height counts as another from here on, mm.
const HIGHER: f64 = 1e-6;

impl Gather<'_> {
    /// Which setup of the job holds here.
    pub(super) fn setup(&self) -> Option<usize> {
        setup_at(&self.options.setups, self.workingstep.as_ref(), || self.main_line)
    }

    fn setup_name(&self, setup: Option<usize>) -> String {
        setup.map_or_else(|| "as in the machine file".to_string(), |i| self.options.setups[i].name.clone())
    }

    /// The operator clamps the part anew.
    pub(super) fn clamp(&mut self, setup: Option<usize>) {
        let first = self.clamped.is_none() && !self.out.items.iter().any(|i| matches!(i, Item::Move(_)));
        self.comes_back(setup);
        self.clamped = setup;
        self.begun.extend(setup);
        if first {
            return;
        }
        let begun = Clamped { item: self.out.items.len(), setup, source: self.source, cutting: self.cutting };
        self.clampings.push(begun);
        self.retract();
        // Nobody turns a part under a tool that spins.
        let (off, on) = self.cells.rest();
        self.made(off);
        let name = self.setup_name(setup);
        self.act(Action::Message(format!("setup {name}")));
        self.act(Action::Pause { optional: false });
        self.made(on);
        (self.at, self.at_change) = (None, None);
        self.anew = true;
    }

    /// A rapid of a plan that only turns the tool, or rises meanwhile, where the part was clamped anew: the tool stood there in the setup
    /// before and isn't there any more. It comes to where the next rapid leads, and comes turned.
    pub(super) fn turns_before_coming(&self, start: &Pose, end: &Pose) -> bool {
        self.anew && self.planned && start.tool_axis != end.tool_axis && start.axes[..2] == end.axes[..2]
    }

    /// Setups that begin at lines follow each other; a loop would lead back.
    fn comes_back(&mut self, setup: Option<usize>) {
        let line = |i: Option<usize>| i.and_then(|i| self.options.setups[i].from_line);
        let by_line = |i: Option<usize>| i.is_none_or(|i| self.options.setups[i].workingsteps.is_empty());
        let back = line(setup) < line(self.clamped) && by_line(setup) && by_line(self.clamped);
        if back {
            let why = format!("the program comes back here from setup `{}`, as in a loop", self.setup_name(self.clamped));
            self.findings.say(code::JOB_BEGINS_IN_WORK, Some(self.source), &[self.setup_name(setup), why]);
        }
    }

    /// Which way is up for the tool in the part, and how high the tool point of a move is: the height is measured along the tool.
    fn height(&self, m: &Move) -> ([f64; 3], f64) {
        let part = &self.frame_places[usize::from(m.frame)];
        let frame = part.inverse().then(&self.out.frames[usize::from(m.frame)].frame);
        let axis = rotate(&frame.turn, self.out.turns[m.turn as usize].map(|row| row[2]));
        let up = scale(axis, if self.machine.kind == Kind::Robot { -1.0 } else { 1.0 });
        (up, dot(up, frame.apply(m.position)))
    }

    /// The highest ends of cuts, by the side they are made from. A way straight up is no cut.
    fn tops(&self) -> Vec<([f64; 3], f64)> {
        let mut tops: Vec<([f64; 3], f64)> = Vec::new();
        let mut due = self.clampings.iter().peekable();
        let mut before: Option<[f64; 3]> = None;
        for (i, item) in self.out.items.iter().enumerate() {
            if due.next_if(|c| c.item <= i).is_some() {
                before = None;
            }
            let Item::Move(m) = item else { continue };
            let (up, top) = self.height(m);
            let place = self.base(m.frame, m.position, m.turn).position;
            let part = &self.frame_places[usize::from(m.frame)];
            let way = before.replace(place).map(|b| rotate(&transpose(&part.turn), sub(place, b)));
            let rises = way.is_some_and(|w| norm(w) > 0.0 && dot(w, up) >= norm(w) * (1.0 - 1e-9));
            if m.rapid || rises {
                continue;
            }
            match tops.iter_mut().find(|(u, _)| norm(sub(*u, up)) < 1e-3) {
                Some((_, highest)) => *highest = highest.max(top),
                None => tops.push((up, top)),
            }
        }
        tops
    }

    /// A setup with a place of its own overrules the frames of the machine file. Several of them that were apart then fall together,
    /// and what is done in all but one would be done in the wrong place.
    fn frames_overruled(&mut self) {
        for (setup, names) in std::mem::take(&mut self.overruled) {
            let s = &self.options.setups[setup];
            let mut places = names.iter().filter_map(|n| self.machine.cell.frames.get(*n));
            let first = places.next();
            let list = names.iter().copied().collect::<Vec<_>>().join(", ");
            if places.any(|p| Some(p) != first) {
                self.findings.fail(code::JOB_FRAME_OVERRULED, s.place, &[s.name.clone(), list, ", so they would all be at one place".into()]);
            } else {
                self.findings.say(code::JOB_FRAME_OVERRULED, Some(s.place), &[s.name.clone(), list, String::new()]);
            }
        }
    }

    /// Every setup must be begun, and from a safe place.
    pub(super) fn setups_begin_safely(&mut self) {
        // A restart leaves out the setups that are done.
        let restart = self.begun.iter().filter_map(|i| self.options.setups[*i].from_line).min().filter(|_| self.restarted);
        for (i, s) in self.options.setups.iter().enumerate() {
            let done = self.restarted && !s.workingsteps.is_empty();
            if done || s.from_line.zip(restart).is_some_and(|(begins, restart)| begins < restart) {
                continue;
            }
            if !self.begun.contains(&i) && !self.findings.bad() {
                self.findings.say(code::JOB_BAD_VALUE, Some(s.place), &[s.never_begins()]);
            }
        }
        self.frames_overruled();
        if self.clampings.is_empty() {
            return;
        }
        let tops = self.tops();
        for c in std::mem::take(&mut self.clampings) {
            let own = |i: &Item| if let Item::Move(m) = i { (!m.ours).then_some(*m) } else { None };
            // What comes before the stop is the old setup's.
            let after = self.out.items[c.item..].iter().skip_while(|i| !matches!(i, Item::Do(s) if matches!(s.action, Action::Pause { .. })));
            let Some(m) = after.filter_map(own).next() else { continue };
            let name = self.setup_name(c.setup);
            let (up, height) = self.height(&m);
            let top = tops.iter().filter(|(u, _)| norm(sub(*u, up)) < 1e-3).map(|(_, t)| *t).reduce(f64::max);
            let last = self.out.items[..c.item].iter().rev().filter_map(own).next();
            let why = match top {
                _ if !self.comes_from_above() && last.is_some_and(|m| !m.rapid) => {
                    "the setup before it ends with a cut, and without an approach height the tool is not lifted".to_string()
                }
                _ if c.cutting => "its first move is a cut".to_string(),
                Some(top) if height <= top + HIGHER => {
                    format!("its first rapid ends at a height of {height:.3} mm along the tool, and cuts are made up to {top:.3} mm")
                }
                _ => continue,
            };
            self.findings.say(code::JOB_BEGINS_IN_WORK, Some(c.source), &[name, why]);
        }
    }
}
