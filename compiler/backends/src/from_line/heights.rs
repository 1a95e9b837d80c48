//! How high the moves of a program go: along Z, or along a tool that is tilted where the program begins.

use gr_ir::{Axes, Op, Pose, Program, Sources, State, View};

use super::V3;
use crate::sources::{Words, is_hidden};

/// A tool whose direction has a Z no smaller than 1 less this stands upright.
pub(super) const UPRIGHT: f64 = 1e-9;

/// The heights of a program's moves, in the work frame of a state.
pub(super) struct Heights<'a> {
    pub program: &'a Program,
    pub state: &'a State,
    /// Where it begins. A tilted tool has heights only among moves in which it stands so.
    pub begins: &'a Pose,
    /// Direction from the tool point to the spindle, where that isn't Z.
    pub tilt: Option<V3>,
    pub sources: &'a dyn Sources,
}

impl Heights<'_> {
    /// Of a place.
    pub fn of(&self, pose: &Pose, state: &State) -> f64 {
        let mut machine = state.machine(&pose.axes);
        match self.tilt {
            None => machine[2] - self.state.machine(&[0.0; 9])[2],
            Some(up) => {
                // With a length in force it is the place of the tool's tip, else of the spindle's nose, a length along the tool above it.
                let lengths = [state.tool_offset, self.state.tool_offset];
                (0..3).for_each(|i| machine[i] += lengths[1][i] - lengths[0][i]);
                let at = self.state.work_frame(&machine);
                let nose = match lengths.map(|l| l == [0.0; 9]) {
                    [true, false] => -lengths[1][2],
                    [false, true] => lengths[0][2],
                    _ => 0.0,
                };
                nose + (0..3).map(|i| at[i] * up[i]).sum::<f64>()
            }
        }
    }

    /// Of the highest point of the program; none where it has no moves. Where the tool stands otherwise all the time but in cuts, no
    /// rapid tells what is high enough: the points of all moves count.
    pub fn top(&self) -> Option<f64> {
        let any = |view: &View<'_, '_>| view.op.moves().then(|| self.of(view.end, view.state));
        let rapid = |view: &View<'_, '_>| (view.op == Op::Rapid && self.stands_so(view)).then_some(0.0);
        if self.tilt.is_none() || self.fold(f64::max, rapid).is_none() {
            return self.fold(f64::max, any);
        }
        self.fold(f64::max, |view| any(view).filter(|_| self.stands_so(view)))
    }

    /// Of the highest point of a tip whose length was in force, in the part; none where no length ever was.
    pub fn highest_tip(&self) -> Option<f64> {
        let tip = |machine: Axes, state: &State| machine[2] - state.tool_offset[2];
        let zero = tip(self.state.machine(&[0.0; 9]), self.state);
        self.fold(f64::max, |view| {
            let measured = view.state.tool_offset != [0.0; 9] && view.op.moves() && !self.to_the_machine(view);
            measured.then(|| tip(view.state.machine(&view.end.axes), view.state) - zero)
        })
    }

    /// How low its rapids go sideways.
    pub fn lowest_crossing(&self) -> Option<f64> {
        self.fold(f64::min, |view| {
            let [from, to] = [view.start, view.end].map(|p| view.state.machine(&p.axes));
            let sideways = match self.tilt {
                None => from[0] != to[0] || from[1] != to[1],
                Some(up) => {
                    let [from, to] = [from, to].map(|at| self.state.work_frame(&at));
                    let by: V3 = std::array::from_fn(|i| to[i] - from[i]);
                    let along: f64 = (0..3).map(|i| by[i] * up[i]).sum();
                    (0..3).any(|i| (by[i] - along * up[i]).abs() > 1e-6)
                }
            };
            (view.op == Op::Rapid && sideways && self.stands_so(view)).then(|| self.of(view.start, view.state).min(self.of(view.end, view.state)))
        })
    }

    /// As text: `Z 50.000`, or so many millimetres along the tool.
    pub fn show(&self, height: f64) -> String {
        match self.tilt {
            None => format!("Z {height:.3}"),
            Some(_) => format!("{height:.3} mm along the tilted tool"),
        }
    }

    fn fold(&self, pick: fn(f64, f64) -> f64, of: impl Fn(&View<'_, '_>) -> Option<f64>) -> Option<f64> {
        let mut found: Option<f64> = None;
        let mut cursor = self.program.cursor();
        while let Some(view) = cursor.next() {
            if let Some(height) = of(&view).filter(|_| self.counts(&view)) {
                found = Some(found.map_or(height, |f| pick(f, height)));
            }
        }
        found
    }

    /// Beside a tilted tool only moves of the part count.
    fn counts(&self, view: &View<'_, '_>) -> bool {
        self.tilt.is_none() || !self.to_the_machine(view)
    }

    /// Whether a move goes to a place of the machine.
    fn to_the_machine(&self, view: &View<'_, '_>) -> bool {
        let words = Words::at(self.sources, view.source.file, view.source.line);
        words.is_some_and(|w| [280, 300, 530].into_iter().any(|g| w.g(g)) || !w.names_axes() && is_hidden(self.program, view.index))
    }

    /// Whether the tool stands as it does where the program begins, all along a move.
    fn stands_so(&self, view: &View<'_, '_>) -> bool {
        let turned = [view.start, view.end].iter().any(|p| p.axes[3..6] != self.begins.axes[3..6] || p.tool_axis != self.begins.tool_axis);
        self.tilt.is_none() || !turned
    }
}
