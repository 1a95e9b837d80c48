//! Where a machine tool stands when its program has not said it, or has said it as a place of the machine: coordinates that no word
//! has named yet are where the machine stood, and G53, G28, G30 and what a tool change does by itself lead to places that stay where
//! they are, wherever the part is. A program's motion has numbers for both in its own frame; here they become those of the frame that
//! the machine file gives the part. Arms stand nowhere by themselves, and have places of the machine only where their file says where
//! the zero point of G53 is: what they don't have is told.

use gr_backends::from_line::INSERTED;
use gr_backends::sources::{Words as Letters, is_hidden};
use gr_ir::{ArcPlane, Axes, Builder, Marker, Op, Pose, Program, Source, Sources, State, View, plane_axes};
use gr_machine::math::{Frame, V3, add, dot, rot_z, rotate, solve, sub};
use gr_machine::{Kind, Kinematics, Machine};
use gr_text::{Diagnostic, code};

use crate::Setup;
use crate::words::{Asked, Slides, Words, placed, tool, work_shift};

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
    last: Brought,
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
        Coordinates { by: [By::Nothing; 3], planned, cycle: None, last: Brought::default() }
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
            _ if self.planned => None,
            // The way to a restart begins anywhere: it names what it changes.
            INSERTED => Some(Letters::default()),
            line => Letters::at(sources, view.source.file, line),
        };
        let Some(letters) = letters else {
            self.by = [By::Work; 3];
            self.last = Brought { work: [true; 3], ..Brought::default() };
            return self.by;
        };
        let goal = goal(program, view, letters);
        for i in 0..3 {
            let changed = view.start.axes[i] != view.end.axes[i];
            let named = letters.has(AXES[i]);
            match goal {
                Goal::Hidden if changed => self.by[i] = By::Machine,
                Goal::Fixed if changed || named => self.by[i] = By::Machine,
                Goal::Home if changed || named || !letters.names_axes() => self.by[i] = By::Machine,
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

    /// A word of the work frame; an increment from a place of the machine stays one.
    fn name(&mut self, i: usize, view: &View<'_, '_>, sources: &dyn Sources) {
        let known = self.by[i] == By::Work;
        if !known && !Letters::goes_by_increments(sources, view.source.file, view.source.line) {
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

/// Where a move leads.
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

/// The program with the numbers that such coordinates have in the frame of the part. None on machines that have none: the program is
/// good as it is.
pub fn settled(program: &Program, machine: &Machine, sources: &dyn Sources, tool: fn(&Machine, &State) -> Frame) -> Option<Settled> {
    if machine.kind != Kind::Mill {
        return None;
    }
    let Ok(Words::Joints(slides)) = Words::of(machine) else { return None };
    let home = crate::plan::home_joints(machine)?;
    let start = program.start_state().machine(&program.start().axes);
    let home = [0, 1, 2].map(|i| home.get(slides.sliding[i]).copied().unwrap_or(0.0));
    let settle = Settle { machine, of: Of::Slides { kinematics: machine.kinematics(), slides, start: [start[0], start[1], start[2]], home, tool } };
    let mut coordinates = Coordinates::new(program);
    let axes = settle.axes(&program.start().axes, coordinates.by(), program.start_state(), None).unwrap_or(program.start().axes);
    let mut untold = None;
    let mut out = Builder::from_state(Pose { axes, ..*program.start() }, *program.start_state());
    out.names_of(program);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        let by = coordinates.step(program, &view, sources);
        let axes = if view.op.moves() { settle.axes(&view.end.axes, by, view.state, None) } else { Ok(view.end.axes) };
        if let Err(axes) = axes {
            untold.get_or_insert((view.source, axes));
        }
        out.push_to(view.op, &Pose { axes: axes.unwrap_or(view.end.axes), ..*view.end }, view.source);
    }
    Some(Settled { program: out.finish(), untold })
}

/// A program with the numbers that its coordinates have in the frame of the part.
pub struct Settled {
    /// The program.
    pub program: Program,
    /// The first move with coordinates, named in the list, whose numbers can't be told: the part is turned against the machine.
    untold: Option<(Source, [bool; 3])>,
}

impl Settled {
    /// What can't be told.
    pub fn finding(&self, sources: &dyn Sources) -> Option<Diagnostic> {
        let (source, axes) = self.untold?;
        let (file, span) = sources.place(source);
        let names: Vec<&str> = (0..3).filter(|i| axes[*i]).map(|i| ["X", "Y", "Z"][i]).collect();
        Some(Diagnostic::new(code::MACHINE_TURNED_PART, file, span, &[names.join(" ")]))
    }
}

/// The same of an arm whose file has a place for G53, with the part where the setups of a job put it.
pub(crate) fn settled_arm(
    program: &Program,
    machine: &Machine,
    sources: &dyn Sources,
    setups: &[Setup],
) -> Option<Program> {
    if machine.kind != Kind::Robot {
        return None;
    }
    let settle = Settle { machine, of: Of::Place(machine.cell.machine_zero()?) };
    let mut coordinates = Coordinates::new(program);
    let mut out = Builder::from_state(*program.start(), *program.start_state());
    out.names_of(program);
    let (mut workingstep, mut any) = (None, false);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        if let Op::Begin { marker: Marker::Workingstep, text, .. } = view.op {
            workingstep = Some(text);
        }
        let by = coordinates.step(program, &view, sources);
        any |= by.contains(&By::Machine);
        // Also where nothing moves: the tool stays at a place of the machine when the program's coordinates change.
        let part = setup_at(setups, workingstep, || main_line(program, view.source)).and_then(|i| setups[i].part);
        out.push_to(
            view.op,
            &Pose { axes: settle.axes(&view.end.axes, by, view.state, part).unwrap_or(view.end.axes), ..*view.end },
            view.source,
        );
    }
    any.then(|| out.finish())
}

/// Which setup of a job holds for a workingstep, or else at a line of the main program.
pub(crate) fn setup_at(setups: &[Setup], workingstep: Option<&str>, line: impl FnOnce() -> u32) -> Option<usize> {
    if setups.is_empty() {
        return None;
    }
    let named = workingstep.and_then(|w| setups.iter().position(|s| s.workingsteps.iter().any(|n| n == w)));
    named.or_else(|| {
        let line = line();
        setups.iter().rposition(|s| s.from_line.is_some_and(|l| l <= line))
    })
}

/// Where an operation comes from; the way to a restart belongs to what it leads to.
pub(crate) fn leads_to(program: &Program, source: Source) -> Source {
    let begins = || program.steps().map(|s| s.source).find(|s| s.line != INSERTED);
    if source.line == INSERTED { begins().unwrap_or(source) } else { source }
}

/// The line of the main program that asked for an operation, itself or through calls.
pub(crate) fn main_line(program: &Program, source: Source) -> u32 {
    let source = leads_to(program, source);
    let outermost = program.call_stack(source).filter(|f| f.pass == 0).last();
    outermost.map_or(source.line, |f| f.line)
}

struct Settle<'a> {
    machine: &'a Machine,
    of: Of,
}

/// What the coordinates of the machine belong to.
enum Of {
    /// Its slides.
    Slides {
        kinematics: Box<dyn Kinematics>,
        slides: Slides,
        /// Where the program believes the slides at its start, mm.
        start: V3,
        /// Where they stand there.
        home: V3,
        tool: fn(&Machine, &State) -> Frame,
    },
    /// The tool point, seen from this place of the base in the directions of the part, mm.
    Place(V3),
}

impl Settle<'_> {
    /// Coordinates in the work frame of a place whose named ones are places of it. Those that lead to a place of the machine bring its
    /// own coordinate there; along those that nothing has named the machine stays where it stands. Which ones they are, where their
    /// numbers don't follow from that.
    fn axes(&self, axes: &Axes, by: [By; 3], state: &State, part: Option<Frame>) -> Result<Axes, [bool; 3]> {
        const TIMES: usize = 2;
        const FAR: f64 = 100.0;
        // An arm doesn't stand anywhere by itself.
        let stands = matches!(self.of, Of::Slides { .. });
        let wanted = [0, 1, 2].map(|i| by[i] == By::Machine || by[i] == By::Nothing && stands);
        let fixed: Vec<usize> = (0..3).filter(|i| wanted[*i]).collect();
        let mut out = *axes;
        if fixed.is_empty() {
            return Ok(out);
        }
        if self.turns_along(&fixed, state) {
            return Err(wanted);
        }
        let machine = state.machine(axes);
        // Along which direction of the machine, and how far.
        let turn = placed(self.machine, state).then(&Frame { turn: rot_z(state.rotation), ..Frame::IDENTITY }).turn;
        let rows: Vec<(V3, f64)> = fixed
            .iter()
            .map(|i| match (by[*i], &self.of) {
                (By::Nothing, Of::Slides { start, home, .. }) => {
                    let along = turn.map(|row| row[*i]);
                    let gone = sub([machine[0], machine[1], machine[2]], *start);
                    (along, dot(along, add(rotate(&placed(self.machine, state).turn, gone), *home)))
                }
                _ => (std::array::from_fn(|k| f64::from(u8::from(k == *i))), machine[*i]),
            })
            .collect();
        for _ in 0..TIMES {
            let Some(here) = self.slid(&out, state, part) else { return Ok(*axes) };
            let mut slope = vec![vec![0.0; fixed.len()]; fixed.len()];
            for (k, axis) in fixed.iter().enumerate() {
                let mut moved = out;
                moved[*axis] += FAR;
                let Some(there) = self.slid(&moved, state, part) else { return Ok(*axes) };
                for (row, (along, _)) in slope.iter_mut().zip(&rows) {
                    row[k] = dot(*along, sub(there, here)) / FAR;
                }
            }
            let left = rows.iter().map(|(along, goal)| goal - dot(*along, here)).collect();
            let Some(by) = solve(slope, left).filter(|by| by.iter().all(|v| v.abs() < 1e6)) else { return Err(wanted) };
            for (axis, by) in fixed.iter().zip(by) {
                // What is there but for rounding stays as the program has it.
                out[*axis] += if by.abs() < 1e-9 { 0.0 } else { by };
            }
        }
        Ok(out)
    }

    /// Whether a part that is clamped turned would turn rotary axes of the machine, and with them what these coordinates are.
    fn turns_along(&self, fixed: &[usize], state: &State) -> bool {
        let Of::Slides { slides, .. } = &self.of else { return false };
        if slides.turning.is_empty() || !matches!(self.machine.chain, gr_machine::Chain::FiveAxis(_)) {
            return false;
        }
        let turn = placed(self.machine, state).turn;
        let upright = (turn[2][2] - 1.0).abs() < 1e-12;
        let straight = (0..3).all(|i| (turn[i][i] - 1.0).abs() < 1e-12);
        !straight && !(upright && fixed == [2])
    }

    /// Where the words of a program are in the coordinates of the machine.
    fn slid(&self, axes: &Axes, state: &State, part: Option<Frame>) -> Option<V3> {
        match &self.of {
            Of::Slides { kinematics, slides, tool, .. } => {
                let asked = Asked::with(self.machine, axes, state, tool(self.machine, state));
                let joints = slides.stand(self.machine, &**kinematics, &asked)?.joints;
                Some(slides.sliding.map(|j| joints[j]))
            }
            Of::Place(zero) => {
                let part = part.unwrap_or_else(|| placed(self.machine, state));
                let tip = part.then(&work_shift(state)).apply([axes[0], axes[1], axes[2]]);
                Some(Frame { position: *zero, ..part }.inverse().apply(tip))
            }
        }
    }
}
