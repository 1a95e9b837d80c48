//! Where a machine tool stands when its program has not said it, or has said it as a place of the machine: coordinates that no word
//! has named yet are where the machine stood, and G53, G28, G30 and what a tool change does by itself lead to places that stay where
//! they are, wherever the part is. A program's motion has numbers for both in its own frame; here they become those of the frame that
//! the machine file gives the part. Arms have no such places: there both are told.

use gr_backends::sources::{Words as Letters, is_hidden};
use gr_ir::{ArcPlane, Axes, Builder, Marker, Op, Pose, Program, Sources, State, View, plane_axes};
use gr_machine::math::{Frame, V3, solve};
use gr_machine::{Kind, Kinematics, Machine};

use crate::words::{Asked, Slides, Words, tool};

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
        let letters = if self.planned { None } else { Letters::at(sources, view.source.file, view.source.line) };
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
pub fn settled(program: &Program, machine: &Machine, sources: &dyn Sources, tool: fn(&Machine, &State) -> Frame) -> Option<Program> {
    if machine.kind != Kind::Mill {
        return None;
    }
    let Ok(Words::Joints(slides)) = Words::of(machine) else { return None };
    let home = crate::plan::home_joints(machine)?;
    let start = program.start_state().machine(&program.start().axes);
    let stood = [0, 1, 2].map(|i| home.get(slides.sliding[i]).map_or(0.0, |v| v - start[i]));
    let settle = Settle { machine, kinematics: machine.kinematics(), slides, stood, tool };
    let mut coordinates = Coordinates::new(program);
    let axes = settle.axes(&program.start().axes, coordinates.by(), program.start_state());
    let mut out = Builder::from_state(Pose { axes, ..*program.start() }, *program.start_state());
    out.names_of(program);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        let by = coordinates.step(program, &view, sources);
        let axes = if view.op.moves() { settle.axes(&view.end.axes, by, view.state) } else { view.end.axes };
        out.push_to(view.op, &Pose { axes, ..*view.end }, view.source);
    }
    Some(out.finish())
}

struct Settle<'a> {
    machine: &'a Machine,
    kinematics: Box<dyn Kinematics>,
    slides: Slides,
    /// How far the machine stood at the start from where the program believes it, along its slides, mm.
    stood: V3,
    tool: fn(&Machine, &State) -> Frame,
}

impl Settle<'_> {
    /// Coordinates in the work frame that put the slides of those that are not by a word of it where they belong; as they are where
    /// the slides don't go with them.
    fn axes(&self, axes: &Axes, by: [By; 3], state: &State) -> Axes {
        const TIMES: usize = 2;
        const FAR: f64 = 100.0;
        let fixed: Vec<usize> = (0..3).filter(|i| by[*i] != By::Work).collect();
        let mut out = *axes;
        if fixed.is_empty() {
            return out;
        }
        let machine = state.machine(axes);
        let goal = |i: usize| machine[i] + if by[i] == By::Nothing { self.stood[i] } else { 0.0 };
        for _ in 0..TIMES {
            let Some(here) = self.slid(&out, state) else { return *axes };
            let mut slope = vec![vec![0.0; fixed.len()]; fixed.len()];
            for (k, axis) in fixed.iter().enumerate() {
                let mut moved = out;
                moved[*axis] += FAR;
                let Some(there) = self.slid(&moved, state) else { return *axes };
                for (row, slide) in slope.iter_mut().zip(&fixed) {
                    row[k] = (there[*slide] - here[*slide]) / FAR;
                }
            }
            let left = fixed.iter().map(|i| goal(*i) - here[*i]).collect();
            let Some(by) = solve(slope, left).filter(|by| by.iter().all(|v| v.abs() < 1e6)) else { return *axes };
            for (axis, by) in fixed.iter().zip(by) {
                // What is there but for rounding stays as the program has it.
                out[*axis] += if by.abs() < 1e-9 { 0.0 } else { by };
            }
        }
        out
    }

    fn slid(&self, axes: &Axes, state: &State) -> Option<V3> {
        let asked = Asked::with(self.machine, axes, state, (self.tool)(self.machine, state));
        let joints = self.slides.stand(self.machine, &*self.kinematics, &asked)?.joints;
        Some(self.slides.sliding.map(|j| joints[j]))
    }
}
