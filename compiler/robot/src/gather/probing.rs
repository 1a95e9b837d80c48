//! Probe moves, G38.2 to G38.5: the tool goes along a line until the probe's input switches. Where that is nobody knows
//! before the program runs, so the next move must say where it goes in every direction that the probe went.

use gr_ir::{FeedMode, Op, Pose, View};
use gr_machine::math::{norm, product, rotation_vector, sub, transpose};
use gr_text::code;

use super::{Contact, Gather, Item, Move, TINY, Way};
use crate::Zone;

/// The tool stands where a probe stopped.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probed {
    /// Directions that the next move must name.
    pub loose: [bool; 3],
    /// Where the probe's move began, in its work frame; its end when it went away from the part.
    clear: [f64; 3],
}

/// Bits of the kind: no error without contact; away from the part.
const SILENT: u8 = 1;
const AWAY: u8 = 2;

impl Gather<'_> {
    pub(super) fn probe(&mut self, view: &View<'_, '_>, kind: u8) {
        // After one that can't be done nobody knows where the tool is.
        self.rapids = true;
        if !self.options.probing {
            return self.cannot("a probe move in joint positions");
        }
        let Some(row) = self.cells.signal("G38") else {
            self.findings.once(code::ROBOT_NO_PROBE, Some(self.source), &[]);
            return;
        };
        if self.foreign(view) {
            return;
        }
        let state = view.state;
        self.seen = [true; 3];
        self.waiting = false;
        let places = (self.work(state), self.tool(state));
        let turns = (self.turn(view.start, state), self.turn(view.end, state));
        let ((Some(frame), Some(tool)), (Some(from), Some(to))) = (places, turns) else { return };
        if norm(rotation_vector(&product(&transpose(&from), &to))) > 1e-12 {
            return self.cannot("a probe move in which the tool turns");
        }
        if !self.leaves_probed(view.start, view.end) {
            return;
        }
        let lag = self.lag(frame, view.start.xyz());
        let Some((_, start, end)) = self.held(Op::Linear, view.start, view.end, state, lag) else { return };
        let length = norm(sub(end.xyz(), start.xyz()));
        if length <= TINY {
            return;
        }
        if self.probed.is_some() && state.feed_mode == FeedMode::Inverse {
            return self.rests_on_probed();
        }
        let Some(speed) = self.speed(state, length) else { return };
        let turn = self.turn_index(from);
        if self.probed.is_none() {
            self.come_to_cut(frame, tool, start.xyz(), turn);
        }
        let clear = if kind & AWAY != 0 { end.xyz() } else { self.probed.map_or(start.xyz(), |p| p.clear) };
        let touching = row.touches_at();
        self.push(Move {
            way: Way::Line,
            position: end.xyz(),
            turn,
            frame,
            tool,
            speed,
            zone: Zone::Stop,
            length,
            rapid: false,
            free: self.free(tool),
            ours: false,
            probe: Some(Contact { on: touching == (kind & AWAY == 0), must: kind & SILENT == 0 }),
            source: Some(self.source),
        });
        self.probed = Some(Probed { loose: [0, 1, 2].map(|i| start.axes[i] != end.axes[i]), clear });
    }

    /// Whether a move may begin where a probe stopped: it names all directions in which that isn't known.
    pub(super) fn leaves_probed(&mut self, start: &Pose, end: &Pose) -> bool {
        let Some(probed) = self.probed else { return true };
        let open = (0..3).any(|i| probed.loose[i] && start.axes[i] == end.axes[i]);
        if open {
            self.rests_on_probed();
        }
        !open
    }

    pub(super) fn rests_on_probed(&mut self) {
        self.findings.say(code::ROBOT_RUN_TIME, Some(self.source), &["where the probe stopped".to_string()]);
    }

    /// Before the tool is lifted it goes back from where a probe stopped to where it came from.
    pub(super) fn back_from_probed(&mut self, last: Move) -> Move {
        let Some(probed) = self.probed else { return last };
        let speed = self.machine.cell.line_rapid();
        let back = Move { position: probed.clear, speed, rapid: true, length: 0.0, zone: Zone::Stop, probe: None, source: None, ..last };
        self.push(back);
        back
    }
}

/// The input of the probe, where the program has a probe move.
pub(crate) fn input(items: &[Item], machine: &gr_machine::Machine) -> Option<String> {
    let probes = items.iter().any(|i| matches!(i, Item::Move(m) if m.probe.is_some()));
    machine.cell.io.get("G38").filter(|_| probes).and_then(|s| s.wait.clone())
}
