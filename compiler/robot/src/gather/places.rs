//! Places that an arm's program can't know: those of a machine tool, which the machine file may place, and coordinates that no
//! word has named when something rests on them. A mill has both, see [`crate::settle`].

use gr_backends::sources::{Words as Letters, stores_reference};
use gr_ir::{Op, Program, Sources, View};
use gr_machine::{Kind, Machine};
use gr_text::{Diagnostic, code};

use super::{Findings, Gather, TINY};
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
        if self.machine.cell.machine_zero().is_some() {
            if !word.starts_with("G28") && !word.starts_with("G30")
                || !*self.stores.get_or_insert_with(|| stores_reference(program, self.findings.sources).is_some())
            {
                return false;
            }
            // What was stored is a place of the mill that the program was run on.
            self.cannot(&format!("{word} to a place that the program stores itself ({word}.1)"));
        } else {
            self.findings.say(code::ROBOT_MACHINE_PLACE, Some(self.source), &[word.to_string()]);
        }
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
            (0..3).for_each(|i| self.seen[i] |= after[i] != By::Nothing);
        }
        let changes = |i: usize| view.start.axes[i] != view.end.axes[i];
        let mut from_machine = [false; 3];
        let mut open = match view.op {
            Op::Rapid if (0..3).all(|i| self.seen[i] || changes(i)) => [0, 1, 2].map(|i| after[i] == By::Nothing),
            Op::WorkOffset(..) | Op::LocalOffset(_) => {
                let named = set_from_here(view, self.findings.sources);
                from_machine = [0, 1, 2].map(|i| named[i] && before[i] == By::Machine);
                [0, 1, 2].map(|i| named[i] && before[i] != By::Work)
            }
            op if op.feeds() || matches!(op, Op::Probe(_)) => before.map(|b| b == By::Nothing),
            _ => [false; 3],
        };
        if self.planar {
            // It has no Z that could be anywhere.
            open[2] = false;
        }
        if open != [false; 3] {
            self.findings.unnamed(view, open, from_machine != [false; 3]);
        }
        let settled = after == [By::Work; 3] && self.machine.cell.machine_zero().is_none();
        if open != [false; 3] || settled {
            unnamed.0 = None;
        }
    }
}

impl Findings<'_> {
    /// What rests on these directions begins where nothing has said that the tool is.
    fn unnamed(&mut self, view: &View<'_, '_>, open: [bool; 3], from_machine: bool) {
        let axes = || (0..3).filter(|i| open[*i]);
        let names = axes().map(|i| ["X", "Y", "Z"][i]).collect::<Vec<_>>().join(" ");
        let place = |i: usize| format!("{}{}", ["X", "Y", "Z"][i], gr_text::figures::number(view.start.axes[i] + 0.0, 3));
        let args = [names, axes().map(place).collect::<Vec<_>>().join(" ")];
        // A number that comes from a mill's offsets is no place of a robot, nor is one that a place of the machine makes of the part's.
        match !from_machine && axes().all(|i| view.start.axes[i].abs() <= TINY) {
            true => self.say(code::ROBOT_UNNAMED, Some(view.source), &args),
            false => self.fail(code::ROBOT_UNNAMED, view.source, &args),
        }
    }
}

/// Directions in which a word sets coordinates from where the tool stands: G92, G10 L20.
fn set_from_here(view: &View<'_, '_>, sources: &dyn Sources) -> [bool; 3] {
    let at = (view.source.file, view.source.line);
    let Some(letters) = Letters::at(sources, at.0, at.1) else { return [false; 3] };
    let line = sources.line(at.0, at.1).unwrap_or_default();
    let dense: String = line.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_ascii_uppercase()).collect();
    let sets = letters.g(920) || dense.contains("G10") && dense.contains("L20");
    [b'x', b'y', b'z'].map(|l| sets && letters.has(l))
}

/// The first move of a planar arm, or offset set there, that rests on a coordinate which nothing has named and which the program
/// believes elsewhere than the arm stands at its start.
pub(crate) fn unnamed_of_planar(program: &Program, machine: &Machine, sources: &dyn Sources) -> Vec<Diagnostic> {
    let mut findings = Findings::new(sources);
    let mut coordinates = Coordinates::new(program);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        let before = coordinates.by();
        let after = coordinates.step(program, &view, sources);
        let (rests, by, axes) = match view.op {
            Op::WorkOffset(..) | Op::LocalOffset(_) => (set_from_here(&view, sources), before, &view.end.axes),
            Op::Rapid => ([true; 3], after, &view.start.axes),
            op if op.moves() => ([true; 3], before, &view.start.axes),
            _ => continue,
        };
        let believed = view.state.machine(axes);
        let stands = machine.start.position;
        let open = std::array::from_fn(|i| rests[i] && by[i] == By::Nothing && (believed[i] - stands[i]).abs() > TINY);
        if open != [false; 3] {
            findings.unnamed(&view, open, false);
            break;
        }
    }
    findings.take()
}
