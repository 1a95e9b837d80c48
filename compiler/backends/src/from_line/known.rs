//! Which places a restart knows: what the program has said of each axis before, what it does with it from there on, and so where the tool is
//! brought, how far down, and what only the machine knows.

use gr_ir::{Op, Pose, Program, Source, Sources};

use super::heights::UPRIGHT;
use super::{AXIS_LETTERS, ToolDirection, UP, V3, asks};
use crate::sources::{Words, is_hidden, sets_here};

/// An axis that makes a smaller part of the height of a tilted tool has too far to go for it.
const STEEP: f64 = 0.1;

/// Where a restart brings the tool.
pub(super) struct Known {
    /// Axes that it needs, and whose place only the machine knows.
    pub lost: Vec<String>,
    /// Axes that go to where the program has brought them.
    pub goes: [bool; 9],
    /// Axes whose place the program has said, and that nothing else may change.
    pub sure: [bool; 9],
    /// Axes that take the tool to the safe height and stay there until a block names them.
    pub lifted: [bool; 3],
    /// Axes that a block has to name before the tool goes down from there.
    pub late: Vec<usize>,
    /// All axes are known that its height is made of.
    pub height: bool,
    /// Where the program itself first sends each axis by a word.
    pub named: [Option<f64>; 9],
}

impl Known {
    /// Before an operation; `tilt`: the direction of a tilted tool; `unsure`: as in [`super::Options`].
    pub fn of(said: &Said<'_>, index: usize, tilt: Option<V3>, unsure: &[bool; 9]) -> Known {
        let Said { program, sources, used, lathe, .. } = *said;
        let up = tilt.unwrap_or(UP);
        // Axes that its height is made of; the others go beside.
        let along = |i: &usize| up.get(*i).is_some_and(|v| v.abs() > UPRIGHT);
        let places = said.before(index);
        let Ahead { mut needed, named } = ahead(program, index, &places, sources);
        let sinks = (0..3).any(|i| along(&i) && needed[i]);
        // Along a tilted tool there is no way to one of them alone.
        (0..3).filter(along).for_each(|i| needed[i] |= sinks && places[i] == Place::Named);
        let sure = |i: &usize| match places[*i] {
            Place::Named => needed[*i] || !unsure[*i],
            Place::Led => !needed[*i] && !unsure[*i],
            _ => false,
        };
        let blind: Vec<usize> = (0..3).filter(along).filter(|i| !sure(i)).collect();
        // The one that is not known takes the tool to the safe height, if it does so within reach. Between a retract and an index behind it,
        // and where the program comes to the part, it stays with the machine.
        let led = (0..3).any(|i| along(&i) && places[i] == Place::Led);
        let lifts = matches!(*blind, [i] if up[i].abs() > STEEP && !(led && places[i] == Place::Machine));
        // At the height of a cut that is known, a place beside it that isn't: the tool goes down once the program has said that too.
        let aside = |i: &usize| matches!(places[*i], Place::Machine | Place::Probed) && !lathe && *i < 3 && !along(i) && used[*i] && sinks && blind.is_empty();
        let late: Vec<usize> = (0..3).filter(aside).collect();
        let goes_down_late = rapid_says(program, index, &late, sources);
        let lost = |i: &usize| match places[*i] {
            Place::Machine | Place::Probed => used[*i] && (needed[*i] || aside(i) && !goes_down_late),
            Place::Never => tilt.is_some() && along(i) && needed[*i],
            Place::Led => needed[*i],
            Place::Named => along(i) && needed[*i] && !blind.is_empty() && !lifts,
        };
        let lost: Vec<String> = (0..9).filter(lost).map(|i| char::from(AXIS_LETTERS[i].to_ascii_uppercase()).to_string()).collect();
        // The tool does not go down where nobody knows what is below it.
        let doubtful = |i: usize| match places[i] {
            Place::Named | Place::Led => unsure[i],
            Place::Machine | Place::Probed => !lathe,
            Place::Never => false,
        };
        let beside = (0..3).any(|i| !along(&i) && doubtful(i) && !needed[i] && used[i]);
        let stays_up = beside && !sinks;
        // Before an index to come, the slides stay where the machine stands: what the program has named in the part is not there.
        // A retract beside a tilted tool holds until a block names its axis, too: a slide may make the height of another axis there.
        let retracted = (0..3).filter(|i| tilt.is_some() && blind.is_empty() && places[*i] == Place::Machine);
        let unknown: Vec<usize> = blind.iter().copied().chain(retracted).collect();
        let turns = said.tool.is_some() && (stays_up || !blind.is_empty()) && turns_first(program, index, &unknown, sources);
        let goes: [bool; 9] = std::array::from_fn(|i| match i {
            0..3 if (turns || tilt.is_some() && !blind.is_empty() && !lifts) && !needed[i] => false,
            i if along(&i) => sure(&i) && !stays_up && late.is_empty() && (blind.is_empty() || lifts),
            // Its rotary axes turn where the machine stands, and the program goes on from there.
            _ => sure(&i) || places[i] == Place::Named && beside && sinks && i < 3,
        });
        // On a lathe no height is safe, and a cut has none that nobody named: the program begins as it begins itself. Beside a tilted tool it
        // does so too, where nothing of the place is known.
        let lifted: [bool; 3] = std::array::from_fn(|i| {
            let one = blind == [i] && lifts && (tilt.is_none() || (0..3).any(|k| sure(&k)));
            let high = along(&i) && blind.is_empty() && stays_up;
            !lathe && !turns && used[i] && (!needed[i] && (one || high) || along(&i) && !late.is_empty())
        });
        Known { lost, goes, sure: std::array::from_fn(|i| sure(&i)), lifted, height: blind.is_empty(), late, named }
    }
}

/// What a program has said about the place of an axis.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Place {
    Never,
    Named,
    /// The machine went to a place of its own.
    Machine,
    /// A probe stopped there.
    Probed,
    /// It was named, and an index has led the tool away from there since. With the next rapid it comes back.
    Led,
}

/// What a program has said about the places of its axes before an operation. Of axes that it never named, and of those
/// that G28, G30 and G53 brought to a place of the machine, the numbers are only what a simulation takes them for, but where
/// such places are `stored` in a file; where a probe stopped and how high the tool is after a tool change, only the machine knows.
pub(super) struct Said<'a> {
    pub program: &'a Program,
    pub sources: &'a dyn Sources,
    pub used: &'a [bool; 9],
    pub lathe: bool,
    /// As in [`Options`].
    pub stored: bool,
    /// Of a machine whose slides stay where rotary axes turn alone.
    pub tool: Option<&'a ToolDirection<'a>>,
}

impl Said<'_> {
    fn before(&self, index: usize) -> [Place; 9] {
        let mut places = [Place::Never; 9];
        // Axes X Y Z of which the machine has the place, stored or not.
        let mut apart = [true; 3];
        let mut cursor = self.program.cursor();
        while let Some(s) = cursor.next().filter(|s| s.index < index) {
            if !s.op.moves() {
                if matches!(s.op, Op::ToolChange(_)) && !self.lathe && places[2] != Place::Never {
                    places[2] = Place::Machine;
                    apart[2] = true;
                }
                continue;
            }
            let words = Words::at(self.sources, s.source.file, s.source.line);
            let hidden = words.is_some_and(|w| !w.names_axes()) && is_hidden(self.program, s.index);
            let fixed = hidden || words.is_some_and(|w| [280, 300, 530].into_iter().any(|g| w.g(g)));
            let home = fixed && !hidden && words.is_some_and(|w| !w.g(530) && !w.names_axes());
            for (i, letter) in AXIS_LETTERS.iter().enumerate() {
                // The simulation goes on from where it takes a probe to stop.
                let moves = s.start.axes[i] != s.end.axes[i] && places[i] != Place::Probed;
                if home && (self.used[i] || !self.stored) || moves || words.is_some_and(|w| w.has(*letter)) {
                    places[i] = match s.op {
                        Op::Probe(_) => Place::Probed,
                        _ if hidden || fixed && !self.stored => Place::Machine,
                        _ => Place::Named,
                    };
                    if let Some(apart) = apart.get_mut(i) {
                        *apart = fixed;
                    }
                }
            }
            if apart.contains(&true) && self.leads_away(&s, fixed) {
                (0..3).filter(|i| !apart[*i]).for_each(|i| places[i] = Place::Led);
            }
        }
        places
    }

    /// Whether a move turns rotary axes alone, to or from where the tool is tilted: the place of slides that stay is no place of the part
    /// any more.
    fn leads_away(&self, s: &gr_ir::View<'_, '_>, fixed: bool) -> bool {
        let still = |axes: std::ops::Range<usize>| axes.into_iter().all(|i| s.start.axes[i] == s.end.axes[i]);
        let named = || Words::at(self.sources, s.source.file, s.source.line).is_some_and(|w| !fixed && AXIS_LETTERS[..3].iter().any(|l| w.has(*l)));
        let tilted = |tool: &ToolDirection<'_>| [s.start, s.end].into_iter().any(|p| tool(p, s.state).is_some_and(|up| up[2] < 1.0 - UPRIGHT));
        !still(3..6) && still(0..3) && !named() && self.tool.is_some_and(tilted)
    }
}

/// Whether rapids name all of these axes, from an operation on, before a cut.
fn rapid_says(program: &Program, index: usize, axes: &[usize], sources: &dyn Sources) -> bool {
    let mut left = axes.to_vec();
    for s in program.steps().skip(index).filter(|s| s.op.moves()).take_while(|s| s.op == Op::Rapid) {
        left.retain(|i| !says(*i, &s.start, &s.end, s.source, sources));
    }
    left.is_empty()
}

/// Whether rotary axes turn from an operation on before a block names these axes.
fn turns_first(program: &Program, index: usize, axes: &[usize], sources: &dyn Sources) -> bool {
    let moves = program.steps().skip(index).filter(|s| s.op.moves());
    let named = |s: &gr_ir::Step<'_>| (0..3).any(|i| (axes.is_empty() || axes.contains(&i)) && says(i, &s.start, &s.end, s.source, sources));
    moves.take_while(|s| !named(s)).any(|s| s.start.axes[3..6] != s.end.axes[3..6])
}

/// What a program does with its axes from an operation on.
struct Ahead {
    /// It cuts before it names them: their place counts.
    needed: [bool; 9],
    /// Where it first sends them by a word.
    named: [Option<f64>; 9],
}

fn ahead(program: &Program, index: usize, places: &[Place; 9], sources: &dyn Sources) -> Ahead {
    let mut ahead = Ahead { needed: [false; 9], named: [None; 9] };
    let mut said = [false; 9];
    for s in program.steps().skip(index) {
        if !s.op.moves() {
            // What names the place where a probe stopped needs it.
            let names = matches!(s.op, Op::LocalOffset(_) | Op::WorkOffset(..) | Op::StoredOffset { .. }) && (asks(&s, &[920], sources) || sets_here(sources, s.source));
            let words = names.then(|| Words::at(sources, s.source.file, s.source.line)).flatten();
            (0..9).filter(|i| places[*i] == Place::Probed && !said[*i]).for_each(|i| ahead.needed[i] |= words.is_some_and(|w| w.has(AXIS_LETTERS[i])));
            continue;
        }
        let words = Words::at(sources, s.source.file, s.source.line);
        for i in 0..9 {
            let drifts = places[i] == Place::Probed && !words.is_some_and(|w| w.has(AXIS_LETTERS[i]));
            if said[i] || drifts || !says(i, &s.start, &s.end, s.source, sources) {
                continue;
            }
            said[i] = true;
            let word = words.is_some_and(|w| w.has(AXIS_LETTERS[i]) && ![280, 300, 530].into_iter().any(|g| w.g(g)));
            ahead.named[i] = word.then_some(s.end.axes[i]);
        }
        (0..9).for_each(|i| ahead.needed[i] |= s.op.feeds() && !said[i]);
        if (0..9).all(|i| said[i] || ahead.needed[i]) {
            break;
        }
    }
    ahead
}

/// Whether a move names an axis.
pub(super) fn says(axis: usize, start: &Pose, end: &Pose, source: Source, sources: &dyn Sources) -> bool {
    let home = |w: &Words| !w.names_axes() && [280, 300].into_iter().any(|g| w.g(g));
    let words = || Words::at(sources, source.file, source.line);
    start.axes[axis] != end.axes[axis] || words().is_some_and(|w| w.has(AXIS_LETTERS[axis]) || home(&w))
}
