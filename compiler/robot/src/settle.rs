//! Where a machine tool stands when its program has not said it, or has said it as a place of the machine: coordinates that no word
//! has named yet are where the machine stood, and G53, G28, G30 and what a tool change does by itself lead to places that stay where
//! they are, wherever the part is. A program's motion has numbers for both in its own frame; here they become those of the frame that
//! the machine file gives the part. Arms stand nowhere by themselves, and have places of the machine only where their file says where
//! the zero point of G53 is: what they don't have is told.

mod stands;

use gr_backends::from_line::INSERTED;
use gr_backends::sources::{Words as Letters, is_hidden};
use gr_ir::{ArcPlane, Builder, FileId, Marker, Op, Pose, Program, Source, Sources, State, View, plane_axes};
use gr_machine::math::{Frame, V3};
use gr_machine::{Kind, Machine};
use gr_text::{Diagnostic, Severity, code};

use crate::{Setup, Workingstep};
use crate::words::{placed_by, tool};
use stands::Stands;

/// What a coordinate is known by.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum By {
    /// By nothing: the machine stands where it happens to.
    #[default]
    Nothing,
    /// By a word in the work frame.
    Work,
    /// By a place of the machine.
    Machine,
}

/// What X, Y and Z are known by, operation by operation.
#[derive(Clone, Debug)]
pub struct Coordinates {
    by: [By; 3],
    /// Made from features: every move says all.
    planned: bool,
    /// The axis that a canned cycle goes along.
    cycle: Option<usize>,
    increments: Increments,
    last: Brought,
    goal: Goal,
    /// X Y Z A B C U V W that the last move brings somewhere, by a word or because they change.
    to: [bool; 9],
}

/// Whether lines go by increments (G91), looked for from the line on that was asked for last.
#[derive(Clone, Debug, Default)]
pub(crate) struct Increments(Option<(FileId, u32, bool)>);

impl Increments {
    pub fn at(&mut self, sources: &dyn Sources, source: Source) -> bool {
        let (file, line) = (source.file, source.line);
        if line == INSERTED {
            return false;
        }
        let told = match self.0 {
            Some((f, last, told)) if f == file && last <= line => {
                // Between the two lines G90 or G91 may stand.
                let said = (last + 1..=line).rev().find_map(|l| {
                    let words = Letters::at(sources, file, l)?;
                    (words.g(900) || words.g(910)).then(|| words.g(910))
                });
                said.unwrap_or(told)
            }
            _ => Letters::goes_by_increments(sources, file, line),
        };
        self.0 = Some((file, line, told));
        told
    }
}

/// What a move does to X, Y and Z.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Brought {
    /// Those that it brings to a place of the work frame.
    pub work: [bool; 3],
    /// Those that it brings to a place of the machine.
    pub machine: [bool; 3],
    /// The machine makes it of itself, before it changes the tool.
    pub hidden: bool,
}

impl Coordinates {
    /// Before a program.
    pub fn new(program: &Program) -> Coordinates {
        let planned = program.steps().any(|s| matches!(s.op, Op::Begin { marker: Marker::Workingstep, .. }));
        Coordinates {
            by: [By::Nothing; 3],
            planned,
            cycle: None,
            increments: Increments::default(),
            last: Brought::default(),
            goal: Goal::Work,
            to: [true; 9],
        }
    }

    /// What they are known by so far.
    pub fn by(&self) -> [By; 3] {
        self.by
    }

    /// What the last operation did, if it moved.
    pub fn brought(&self) -> Brought {
        self.last
    }

    /// With the next operation. A coordinate is named by its letter or when it changes, both of a plane by an arc in it.
    pub fn step(&mut self, program: &Program, view: &View<'_, '_>, sources: &dyn Sources) -> [By; 3] {
        match view.op {
            Op::Begin { marker: Marker::Cycle, .. } => self.cycle = Some(plane_axes(view.state.plane).2),
            Op::Close(Marker::Cycle) => self.cycle = None,
            _ => {}
        }
        if !view.op.moves() && !view.op.cuts() {
            return self.by;
        }
        let letters = match view.source.line {
            // The way to a restart begins anywhere: it names what it changes.
            INSERTED => Some(Letters::default()),
            _ if self.planned => None,
            line => Letters::at(sources, view.source.file, line),
        };
        let Some(letters) = letters else {
            self.by = [By::Work; 3];
            self.last = Brought { work: [true; 3], ..Brought::default() };
            (self.goal, self.to) = (Goal::Work, [true; 9]);
            return self.by;
        };
        let goal = goal(program, view, letters);
        // Its letters are those of the cycle that follows.
        let letters = if self.rises_to_cycle(program, view, letters) { Letters::default() } else { letters };
        self.bring(goal, letters, view);
        for i in 0..3 {
            let changed = view.start.axes[i] != view.end.axes[i];
            let named = letters.has(AXES[i]);
            match goal {
                // In a rotated frame it changes others too: along those the machine stays.
                Goal::Hidden | Goal::Fixed | Goal::Home if self.to[i] => self.by[i] = By::Machine,
                // In a cycle the letter of its own axis is the depth, which each move takes when it gets there.
                Goal::Work if changed || named && self.cycle != Some(i) => self.name(i, view, sources),
                _ => {}
            }
        }
        self.curve(&view.op);
        let changed = |i: usize| view.start.axes[i] != view.end.axes[i];
        let named = |i: usize| letters.has(AXES[i]) && self.cycle != Some(i);
        // Without its letter an axis of a plain move changes only because it was elsewhere than the program's run has it.
        let spelled = letters.names_axes() && self.cycle.is_none();
        let work = |i: usize| self.by[i] == By::Work && (named(i) || changed(i) && !spelled);
        self.last = Brought {
            work: std::array::from_fn(work),
            machine: std::array::from_fn(|i| self.by[i] == By::Machine && (named(i) || changed(i))),
            hidden: matches!(goal, Goal::Hidden),
        };
        self.by
    }

    /// The move to R that a canned cycle makes first where it begins below that.
    fn rises_to_cycle(&self, program: &Program, view: &View<'_, '_>, letters: Letters) -> bool {
        let (u, v, w) = plane_axes(view.state.plane);
        let changed = |i: usize| view.start.axes[i] != view.end.axes[i];
        if view.op != Op::Rapid || self.cycle.is_some() || changed(u) || changed(v) || !changed(w) || !letters.has(WORDS[u]) && !letters.has(WORDS[v]) {
            return false;
        }
        let own = (view.index + 1..program.len()).map_while(|i| program.get(i).filter(|s| s.source == view.source && !s.op.moves()));
        own.into_iter().any(|s| matches!(s.op, Op::Begin { marker: Marker::Cycle, .. }))
    }

    /// Where the move leads, and which words it brings there.
    fn bring(&mut self, goal: Goal, letters: Letters, view: &View<'_, '_>) {
        let changes = |i: usize, far: f64| (view.start.axes[i] - view.end.axes[i]).abs() > far;
        let named = |i: usize| letters.has(WORDS[i]);
        self.goal = goal;
        self.to = match goal {
            Goal::Work => std::array::from_fn(|i| changes(i, 0.0) || named(i) && self.cycle != Some(i)),
            Goal::Fixed => std::array::from_fn(named),
            Goal::Home => std::array::from_fn(|i| named(i) || !letters.names_axes()),
            // Up alone, or to the second reference point.
            Goal::Hidden => {
                let all = (0..9).any(|i| i != 2 && changes(i, ROUNDING));
                std::array::from_fn(|i| all || i == 2)
            }
        };
    }

    /// Whether the last move went by increments.
    fn by_increments(&mut self, view: &View<'_, '_>, sources: &dyn Sources) -> bool {
        Letters::at(sources, view.source.file, view.source.line).is_some_and(Letters::incremental) || self.increments.at(sources, view.source)
    }

    /// A word of the work frame; an increment from a place of the machine stays one.
    fn name(&mut self, i: usize, view: &View<'_, '_>, sources: &dyn Sources) {
        let known = self.by[i] == By::Work;
        if !known && !self.by_increments(view, sources) {
            self.by[i] = By::Work;
        }
    }

    /// The centre of an arc and the points of a curve are the program's: they go with the part.
    fn curve(&mut self, op: &Op<'_>) {
        let mut bent = [false; 3];
        match op {
            Op::Arc(arc) => match arc.plane {
                ArcPlane::Work(plane) => {
                    let (u, v, _) = plane_axes(plane);
                    (bent[u.min(2)], bent[v.min(2)]) = (true, true);
                }
                ArcPlane::Free(_) => bent = [true; 3],
            },
            Op::Nurbs { .. } => (bent[0], bent[1]) = (true, true),
            _ => {}
        }
        for (by, bent) in self.by.iter_mut().zip(bent) {
            if bent {
                *by = By::Work;
            }
        }
    }
}

const AXES: [u8; 3] = *b"xyz";
const WORDS: [u8; 9] = *b"xyzabcuvw";
/// Coordinates that differ by less are the same but for rounding, mm.
const ROUNDING: f64 = 1e-9;

/// Where a move leads.
#[derive(Clone, Copy, Debug)]
enum Goal {
    /// To a place in the work frame.
    Work,
    /// G53: the named axes to places of the machine.
    Fixed,
    /// G28, G30: the named axes, without any all of them.
    Home,
    /// What the machine does by itself before it changes the tool.
    Hidden,
}

fn goal(program: &Program, view: &View<'_, '_>, letters: Letters) -> Goal {
    if letters.g(530) {
        return Goal::Fixed;
    }
    if letters.g(280) || letters.g(300) {
        // Over a point of the work frame, where there are two moves.
        let next = program.get(view.index + 1).filter(|s| s.op == Op::Rapid && s.source == view.source);
        return if next.is_some() { Goal::Work } else { Goal::Home };
    }
    if view.op == Op::Rapid && !letters.names_axes() && is_hidden(program, view.index) {
        return Goal::Hidden;
    }
    Goal::Work
}

/// The tool point as a mill's control has it: the nose of the spindle until G43 says otherwise.
pub(crate) fn control_tool(machine: &Machine, state: &State) -> Frame {
    if state.tool_offset[2] == 0.0 { machine.cell.tool_frame(u32::MAX) } else { tool(machine, state) }
}

/// The word that leads a move to a place of the machine, if one does.
pub(crate) fn place_of_machine(program: &Program, view: &View<'_, '_>, sources: &dyn Sources) -> Option<&'static str> {
    if !view.op.moves() {
        return None;
    }
    let letters = Letters::at(sources, view.source.file, view.source.line)?;
    match goal(program, view, letters) {
        Goal::Work => None,
        Goal::Fixed => Some("G53"),
        Goal::Home => Some(if letters.g(280) { "G28" } else { "G30" }),
        Goal::Hidden => Some("the way to the tool change"),
    }
}

/// The program with the numbers that such coordinates have in the frame of the part, where the setups of a job put it: on mills, and
/// on arms whose file has a place for G53. None where the program is good as it is.
pub fn settled(
    program: &Program,
    machine: &Machine,
    sources: &dyn Sources,
    setups: &[Setup],
    tool: fn(&Machine, &State) -> Frame,
) -> Option<Settled> {
    let mut stands = Stands::new(machine, tool)?;
    let mut coordinates = Coordinates::new(program);
    let mut out = Builder::from_state(stands.begins(program.start(), program.start_state()), *program.start_state());
    out.names_of(program);
    let (mut untold, mut any) = (None, machine.kind == Kind::Mill);
    let mut places = Places::new(program, machine, setups);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        let place = places.at(program, &view);
        any |= coordinates.step(program, &view, sources).contains(&By::Machine);
        let told = match view.op.moves() {
            true => stands.goes(program, &out, &view, sources, &mut coordinates, place),
            false => stands.shifts(program, &out, &view, sources, &places),
        };
        for axes in stands.way() {
            out.push_to(view.op, &Pose { axes, ..*view.end }, view.source);
        }
        let (op, pose) = told.unwrap_or_else(|why| {
            untold.get_or_insert((view.source, why));
            (view.op, *view.end)
        });
        out.push_to(op, &pose, view.source);
    }
    any.then(|| Settled { program: out.finish(), untold })
}

/// Where the setups of a job put the part.
struct Places<'a> {
    setups: &'a [Setup],
    machine: &'a Machine,
    workingstep: Option<Workingstep>,
    /// That of the setup in force.
    part: Option<Frame>,
}

impl<'a> Places<'a> {
    fn new(program: &Program, machine: &'a Machine, setups: &'a [Setup]) -> Self {
        Places { setups, machine, workingstep: led_to(program), part: None }
    }

    /// In the base, at an operation.
    fn at(&mut self, program: &Program, view: &View<'_, '_>) -> Frame {
        if let Some(step) = Workingstep::begun_by(&view.op) {
            self.workingstep = Some(step);
        }
        self.part = setup_at(self.setups, self.workingstep.as_ref(), || main_line(program, view.source)).and_then(|i| self.setups[i].part);
        self.of(view.state.work)
    }

    /// In the base, of a work offset by its number: a setup's place holds for all of them.
    fn of(&self, work: u8) -> Frame {
        self.part.unwrap_or_else(|| placed_by(self.machine, work))
    }
}

/// A program with the numbers that its coordinates have in the frame of the part.
pub struct Settled {
    /// The program.
    pub program: Program,
    /// The first move whose numbers can't be told.
    untold: Option<(Source, Untold)>,
}

/// Why the numbers of a move can't be told.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Untold {
    /// The part is turned against the machine: these coordinates are none of it.
    Turned([bool; 3]),
    /// It goes by these coordinates, which the program has otherwise, mm: nothing has named them.
    Rests([bool; 3], V3),
    /// It leads by this code to a place that the program stores itself, by a run in which the part is elsewhere.
    Stored(&'static str),
}

impl Settled {
    /// What can't be told.
    pub fn finding(&self, sources: &dyn Sources) -> Option<Diagnostic> {
        let (source, why) = self.untold?;
        let (file, span) = sources.place(source);
        let axes = |axes: [bool; 3]| (0..3).filter(move |i| axes[*i]);
        let names = |some: [bool; 3]| axes(some).map(|i| ["X", "Y", "Z"][i]).collect::<Vec<_>>().join(" ");
        Some(match why {
            Untold::Stored(word) => Diagnostic::new(code::MACHINE_STORED_PLACE, file, span, &[word.to_string()]),
            Untold::Turned(some) => Diagnostic::new(code::MACHINE_TURNED_PART, file, span, &[names(some)]),
            Untold::Rests(some, at) => {
                let at = |i: usize| format!("{}{}", ["X", "Y", "Z"][i], gr_text::figures::number(at[i] + 0.0, 3));
                let at = axes(some).map(at).collect::<Vec<_>>().join(" ");
                Diagnostic { severity: Severity::Error, ..Diagnostic::new(code::ROBOT_UNNAMED, file, span, &[names(some), at]) }
            }
        })
    }
}

/// Which setup of a job holds for a workingstep, or else at a line of the main program.
pub(crate) fn setup_at(setups: &[Setup], workingstep: Option<&Workingstep>, line: impl FnOnce() -> u32) -> Option<usize> {
    if setups.is_empty() {
        return None;
    }
    let named = workingstep.and_then(|w| setups.iter().position(|s| s.workingsteps.iter().any(|n| w.is_called(n))));
    named.or_else(|| {
        let line = line();
        setups.iter().rposition(|s| s.from_line.is_some_and(|l| l <= line))
    })
}

/// Where an operation comes from; the way to a restart belongs to what it leads to.
pub(crate) fn leads_to(program: &Program, source: Source) -> Source {
    if source.line != INSERTED {
        return source;
    }
    // Offsets that are restored on the way keep the lines that asked for them.
    let (mut last, mut own) = (source, source);
    for step in program.steps() {
        if last.line == INSERTED && step.source.line != INSERTED {
            own = step.source;
        }
        last = step.source;
        if step.op.moves() && last.line != INSERTED {
            break;
        }
    }
    own
}

/// The workingstep that the way to a restart leads to.
pub(crate) fn led_to(program: &Program) -> Option<Workingstep> {
    program.steps().next().filter(|s| s.source.line == INSERTED)?;
    program.steps().find_map(|s| Workingstep::begun_by(&s.op))
}

/// The line of the main program that asked for an operation, itself or through calls.
pub(crate) fn main_line(program: &Program, source: Source) -> u32 {
    let source = leads_to(program, source);
    let outermost = program.call_stack(source).filter(|f| f.pass == 0).last();
    outermost.map_or(source.line, |f| f.line)
}
