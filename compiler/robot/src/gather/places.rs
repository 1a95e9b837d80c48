//! Places that an arm's program can't know: those of a machine tool, and coordinates that no word has named when something
//! rests on them. A mill has both, see [`crate::settle`].

use gr_backends::sources::Words as Letters;
use gr_ir::{Op, Program, View};
use gr_machine::{Kind, Machine};
use gr_text::code;

use super::{Gather, TINY};
use crate::settle::{By, Coordinates, place_of_machine};

/// What has been named so far; none as soon as nothing is left to be told.
pub(super) struct Unnamed(Option<Coordinates>);

impl Unnamed {
    pub fn new(program: &Program, machine: &Machine) -> Unnamed {
        Unnamed((machine.kind == Kind::Robot).then(|| Coordinates::new(program)))
    }
}

impl Gather<'_> {
    /// Whether a move leads to a place of a machine tool; that is told, and where the tool is afterwards nobody knows.
    pub(super) fn leads_to_machine(&mut self, program: &Program, view: &View<'_, '_>) -> bool {
        if self.machine.kind != Kind::Robot {
            return false;
        }
        let Some(word) = place_of_machine(program, view, self.findings.sources) else { return false };
        self.findings.say(code::ROBOT_MACHINE_PLACE, Some(self.source), &[word.to_string()]);
        self.rapids = true;
        (self.at, self.probed) = (None, None);
        true
    }

    /// Tells a cut that begins, a rapid that goes and an offset that is set where nothing has said that the tool is.
    pub(super) fn rests_on_unnamed(&mut self, program: &Program, view: &View<'_, '_>, unnamed: &mut Unnamed) {
        let Some(coordinates) = &mut unnamed.0 else { return };
        let before = coordinates.by();
        let after = coordinates.step(program, view, self.findings.sources);
        if view.op == Op::Rapid {
            // A place that the program names is a place, also where it has the number that nobody had named before.
            (0..3).for_each(|i| self.seen[i] |= after[i] == By::Work);
        }
        let changes = |i: usize| view.start.axes[i] != view.end.axes[i];
        let open = match view.op {
            Op::Rapid if (0..3).all(|i| self.seen[i] || changes(i)) => [0, 1, 2].map(|i| after[i] != By::Work),
            Op::WorkOffset(..) | Op::LocalOffset(_) => {
                let named = self.set_from_here(view);
                [0, 1, 2].map(|i| named[i] && before[i] != By::Work)
            }
            op if op.feeds() || matches!(op, Op::Probe(_)) => before.map(|b| b != By::Work),
            _ => [false; 3],
        };
        if open != [false; 3] {
            self.unnamed(view, open);
        }
        if open != [false; 3] || after == [By::Work; 3] {
            unnamed.0 = None;
        }
    }

    /// Directions in which a word sets coordinates from where the tool stands: G92, G10 L20.
    fn set_from_here(&self, view: &View<'_, '_>) -> [bool; 3] {
        let at = (view.source.file, view.source.line);
        let Some(letters) = Letters::at(self.findings.sources, at.0, at.1) else { return [false; 3] };
        let line = self.findings.sources.line(at.0, at.1).unwrap_or_default();
        let dense: String = line.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_ascii_uppercase()).collect();
        let sets = letters.g(920) || dense.contains("G10") && dense.contains("L20");
        [b'x', b'y', b'z'].map(|l| sets && letters.has(l))
    }

    fn unnamed(&mut self, view: &View<'_, '_>, open: [bool; 3]) {
        let axes = || (0..3).filter(|i| open[*i]);
        let names = axes().map(|i| ["X", "Y", "Z"][i]).collect::<Vec<_>>().join(" ");
        let place = |i: usize| format!("{}{}", ["X", "Y", "Z"][i], gr_text::figures::number(view.start.axes[i] + 0.0, 3));
        let args = [names, axes().map(place).collect::<Vec<_>>().join(" ")];
        // A number that comes from a mill's offsets is no place of a robot.
        match axes().all(|i| view.start.axes[i].abs() <= TINY) {
            true => self.findings.say(code::ROBOT_UNNAMED, Some(self.source), &args),
            false => self.findings.fail(code::ROBOT_UNNAMED, self.source, &args),
        }
    }
}
