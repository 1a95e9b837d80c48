//! Where a machine stands while its program runs. The program has its motion as a run of it alone has it, with the part at the zero
//! point of a machine that stands there too; here it goes on from where this machine stands.

use gr_backends::sources::{Words as Letters, number_of, sets_here, stores_reference};
use gr_ir::{Arc, ArcPlane, Axes, Builder, Marker, Op, Pose, Program, Source, Sources, State, View, plane_axes};
use gr_machine::math::{Frame, V3, add, dot, product, rot_z, solve, sub};
use gr_machine::{Chain, Kind, Kinematics, Machine};

use super::{By, Coordinates, Goal, INSERTED, Places, ROUNDING, Untold};
use crate::gather::{TURN_STEP, same_turn};
use crate::words::{Asked, Slides, Words, as_far_as_known, placed, started, work_shift};

/// Follows a machine through its program.
pub(super) struct Stands<'a> {
    machine: &'a Machine,
    of: Of,
    /// What places the work frame, in the base.
    place: Frame,
    last: Last,
    shifted: Shifted,
    level: Option<Level>,
    /// Line of the last move, and where its first one begins: as the program's run has it, and where it is.
    line: Option<(Source, Axes, Axes)>,
    /// Whether the program stores a reference point of its own, once that was asked.
    stores: Option<bool>,
    /// Coordinates that a way of the slides has changed without a word, and by what each was known before.
    strayed: [Option<By>; 3],
    /// Those of them that an index has changed.
    indexed: [bool; 3],
    /// How far beside those of the program's run the coordinates are that a control knows which has the part where it is and nothing of
    /// tilted tables, mm: what LinuxCNC's interpreter has with this place as a stored offset.
    beside: V3,
    /// Places that the last move goes through before its end.
    way: Vec<Axes>,
}

/// What the places of the machine are places of.
enum Of {
    /// Its slides, by the words of a program and the tool that its control has.
    Slides { kinematics: Box<dyn Kinematics>, slides: Slides, tool: fn(&Machine, &State) -> Frame },
    /// The tool point of an arm, seen from this place of the base in the directions of the part, mm.
    Place(V3),
}

/// Where the last move ended.
enum Last {
    /// It has not moved yet: its slides, mm.
    Home(V3),
    /// Coordinates in the work frame.
    Moved(Axes, State, Frame),
}

/// By how much offsets differ from those of the program's run, because they were set from where the machine stands.
#[derive(Default)]
struct Shifted {
    local: Axes,
    /// As G92 has stored it, in force or not.
    kept: Axes,
    /// Of each work offset, and what of it is in force.
    work: [Axes; 10],
    current: Axes,
}

/// Where a canned cycle begins along its own axis, as the program's run has it and as it is.
struct Level {
    axis: usize,
    believed: f64,
    real: f64,
}

/// A tool point that goes less far without a word stays, mm.
const LED: f64 = 1e-6;

type Told<'p> = Result<(Op<'p>, Pose), Untold>;

impl<'a> Stands<'a> {
    /// None for machines that have no places of their own.
    pub fn new(machine: &'a Machine, tool: fn(&Machine, &State) -> Frame) -> Option<Stands<'a>> {
        let (of, home) = match machine.kind {
            Kind::Mill => {
                let Ok(Words::Joints(slides)) = Words::of(machine) else { return None };
                let home = crate::plan::home_joints(machine)?;
                let home = slides.sliding.map(|j| home.get(j).copied().unwrap_or(0.0));
                (Of::Slides { kinematics: machine.kinematics(), slides, tool }, home)
            }
            Kind::Robot => (Of::Place(machine.cell.machine_zero()?), [0.0; 3]),
            _ => return None,
        };
        Some(Stands { machine, of, place: Frame::IDENTITY, last: Last::Home(home), shifted: Shifted::default(), level: None, line: None, stores: None, strayed: [None; 3], indexed: [false; 3], beside: [0.0; 3], way: Vec::new() })
    }

    /// Where it stands before the program. An arm's program says that itself.
    pub fn begins(&mut self, start: &Pose, state: &State) -> Pose {
        self.place = placed(self.machine, state);
        let mut axes = start.axes;
        match (&self.of, &self.last) {
            (Of::Slides { slides, .. }, Last::Home(home)) => {
                self.turn_home(&slides.turning, &mut axes, state);
                if let Some(at) = self.unslid(*home, &axes, state) {
                    axes[..3].copy_from_slice(&at);
                    self.beside = sub(at, start.xyz());
                }
            }
            _ => self.last = Last::Moved(start.axes, *state, self.place),
        }
        Pose { axes, ..*start }
    }

    /// The rotary words of a machine that stands at home.
    fn turn_home(&self, turning: &[(usize, usize)], axes: &mut Axes, state: &State) {
        let Some(home) = crate::plan::home_joints(self.machine) else { return };
        axes[3..6].fill(0.0);
        let words = || turning.iter().filter(|(_, word)| (3..6).contains(word));
        let zero = self.rotary(axes, state, &self.place).unwrap_or_default();
        words().for_each(|(joint, word)| axes[*word] = home[*joint] - zero[*word - 3]);
    }

    /// A move, from where the machine stands.
    pub fn goes<'p>(
        &mut self,
        program: &Program,
        out: &Builder,
        view: &View<'_, 'p>,
        sources: &dyn Sources,
        coordinates: &mut Coordinates,
        place: Frame,
    ) -> Told<'p> {
        let (b0, b1, state) = (&view.start.axes, &view.end.axes, out.state());
        let (goal, to) = (coordinates.goal, coordinates.to);
        let mut from = out.pose().axes;
        if place != self.place {
            if matches!(self.of, Of::Slides { .. }) {
                // The machine stands still, the part is elsewhere.
                let (old, new) = (self.place.then(&work_shift(state)), place.then(&work_shift(state)).inverse());
                let seen = |at: V3| new.apply(old.apply(at));
                self.beside = sub(seen(add(view.start.xyz(), self.beside)), view.start.xyz());
                let at = seen([from[0], from[1], from[2]]);
                from[..3].copy_from_slice(&at);
            }
            self.place = place;
        }
        for (v, b) in from.iter_mut().zip(b0) {
            // What is there but for rounding is there.
            *v = if (*v - b).abs() < ROUNDING { *b } else { *v };
        }
        if self.line.is_none_or(|(source, ..)| source != view.source) {
            self.line = Some((view.source, *b0, from));
        }
        let lags = from != *b0;
        let by = coordinates.by();
        let increments = lags && matches!(goal, Goal::Work) && coordinates.by_increments(view, sources);
        let mut end: Axes = std::array::from_fn(|i| match to[i] {
            true if increments && from[i] != b0[i] => from[i] + (b1[i] - b0[i]),
            true => b1[i],
            false => from[i],
        });
        if let Some(level) = self.level.as_ref().filter(|l| to[l.axis] && b1[l.axis] == l.believed) {
            end[level.axis] = level.real;
        }
        let turns = (3..6).any(|i| from[i] != end[i]);
        let comes = matches!(goal, Goal::Work) && view.op == Op::Rapid && !increments && to[..3].contains(&true);
        // Coming to the part behind an index, the tool goes to where its control believes it, as LinuxCNC sends it: what it has not
        // named is the height of the retract, and not what the turn has made of that.
        let believed: [bool; 3] = std::array::from_fn(|i| comes && !to[i] && self.indexed[i] && self.strayed[i].is_some());
        for i in (0..3).filter(|i| believed[*i]) {
            end[i] = b1[i] + self.beside[i];
            // A cut there has to name it still.
            self.indexed[i] = false;
        }
        let comes_from_afar = to[..3] == [true; 3] && !increments && view.op == Op::Linear;
        if !comes_from_afar {
            self.rests_on_strayed(view, &from, &end, &to)?;
        }
        if view.source.line == INSERTED && view.op == Op::Rapid && !turns {
            let level = self.level_with(&from, &end, state);
            self.way.extend(level.filter(|at| (0..3).all(|i| to[i] || (at[i] - from[i]).abs() < LED)));
        }
        match goal {
            Goal::Work => {
                // An arm stands nowhere by itself.
                let stays = |by: By| by == By::Machine || by == By::Nothing && matches!(self.of, Of::Slides { .. });
                let held: Vec<usize> = (0..3).filter(|i| !to[*i] && !believed[*i] && stays(by[*i])).collect();
                if !held.is_empty() && (turns || self.other_point(state)) {
                    let kept = end;
                    let apart = self.apart(&end, &held, state);
                    let square = || apart && self.apart(&from, &held, state);
                    if turns && view.op == Op::Rapid && !to[..3].contains(&true) && (held.len() == 3 || !square()) {
                        self.index(&from, &mut end, by, state)?;
                    } else if apart {
                        self.hold(&mut end, &held, state)?;
                        // The slides stay and the tool point doesn't: no cut is meant so.
                        let led = [0, 1, 2].map(|i| held.contains(&i) && (end[i] - kept[i]).abs() > LED);
                        if turns && view.op.feeds() && held.len() < 3 && led.contains(&true) {
                            return Err(Untold::Rests(led, [end[0], end[1], end[2]]));
                        }
                    } else {
                        self.stay_on_part(&from, &mut end, &held, state)?;
                        if turns && view.op.feeds() {
                            return Err(Untold::Rests([0, 1, 2].map(|i| held.contains(&i)), [end[0], end[1], end[2]]));
                        }
                    }
                }
            }
            Goal::Home if self.placed() && self.stored(program, sources) => {
                let home = Letters::at(sources, view.source.file, view.source.line).is_some_and(|l| l.g(280));
                return Err(Untold::Stored(if home { "G28" } else { "G30" }));
            }
            _ => {
                self.to_machine(&mut end, view, (to, goal), turns, by, state)?;
                self.believes(view, &to, state);
                // What LinuxCNC leaves where it is: in a frame that is rotated it changes others too.
                (0..3).filter(|i| !to[*i]).for_each(|i| self.strays(i, end[i] - from[i] - (b1[i] - b0[i]), by));
                (0..3).filter(|i| to[*i]).for_each(|i| self.strayed[i] = None);
            }
        }
        if comes && view.source.line != INSERTED {
            self.no_lower(&mut end, view, &to, by, state);
        }
        if matches!(goal, Goal::Work) {
            (0..3).filter(|i| to[*i] && end[*i] == b1[*i]).for_each(|i| self.strayed[i] = None);
            (0..3).filter(|i| to[*i] && !increments).for_each(|i| self.beside[i] = 0.0);
        }
        let op = if lags || end != *b1 { bent(view, &from, &end)? } else { view.op };
        self.last = Last::Moved(end, *state, self.place);
        Ok((op, Pose { axes: end, ..*view.end }))
    }

    /// Coming to a part that is tilted, the tool goes no lower than where the control believes it in what is not named: the slides of a
    /// retract are that high above a part that stands straight.
    fn no_lower(&self, end: &mut Axes, view: &View<'_, '_>, to: &[bool; 9], by: [By; 3], state: &State) {
        let led = |i: &usize| !to[*i] && (by[*i] == By::Machine || self.strayed[*i].is_some());
        let Some(up) = self.up(end, state).filter(|up| up[2] < 1.0 - 1e-9) else { return };
        let mut other = *end;
        (0..3).filter(led).for_each(|i| other[i] = view.end.axes[i] + self.beside[i]);
        if (0..3).map(|i| up[i] * (other[i] - end[i])).sum::<f64>() > LED {
            *end = other;
        }
    }

    /// What the control believes where the axes that a move names have come to places of the machine.
    fn believes(&mut self, view: &View<'_, '_>, to: &[bool; 9], state: &State) {
        let frame = self.place.then(&work_shift(state));
        let machine = view.state.machine(&view.end.axes);
        let mut tip = frame.apply(add(view.start.xyz(), self.beside));
        (0..3).filter(|i| to[*i]).for_each(|i| tip[i] = machine[i] - state.tool_offset[i]);
        self.beside = sub(frame.inverse().apply(tip), view.end.xyz());
    }

    /// Beside a tilted tool, where the way to a restart has turned the rotary axes: along the tool, so far out as the goal is.
    fn level_with(&self, from: &Axes, end: &Axes, state: &State) -> Option<Axes> {
        let up = self.up(end, state)?;
        let far = dot(up, std::array::from_fn(|i| end[i] - from[i]));
        let mut at = *from;
        (0..3).for_each(|i| at[i] += up[i] * far);
        (up[2] < 1.0 - 1e-9 && far.abs() > LED).then_some(at)
    }

    /// The direction from the tool point to the spindle, in the work frame.
    fn up(&self, axes: &Axes, state: &State) -> Option<V3> {
        let Of::Slides { kinematics, slides, .. } = &self.of else { return None };
        let asked = Asked { tip: [0.0; 3], tool: Frame::IDENTITY, rotary: self.rotary(axes, state, &self.place)? };
        let joints = as_far_as_known(self.machine, &started(self.machine, &asked, &slides.sliding, &slides.turning), &slides.turning);
        let turn = kinematics.forward_frame(&joints).ok()?.turn;
        let work = Frame { position: [0.0; 3], ..self.place.then(&work_shift(state)) };
        Some(work.inverse().apply(turn.map(|row| row[2])))
    }

    /// The part isn't where the program's run has it.
    fn placed(&self) -> bool {
        matches!(self.of, Of::Slides { .. }) && self.place != Frame::IDENTITY
    }

    /// The program stores a reference point itself.
    fn stored(&mut self, program: &Program, sources: &dyn Sources) -> bool {
        *self.stores.get_or_insert_with(|| stores_reference(program, sources).is_some())
    }

    /// Whether these coordinates alone go along their own directions of the machine: no table has tilted others into them.
    fn apart(&self, end: &Axes, axes: &[usize], state: &State) -> bool {
        const FAR: f64 = 100.0;
        let way = |k: usize| {
            let mut moved = *end;
            moved[k] += FAR;
            Some(sub(self.slid(&moved, state, &self.place)?, self.slid(end, state, &self.place)?))
        };
        let across = |k: usize| way(k).is_none_or(|way| axes.iter().all(|i| dot(self.along(*i, state), way).abs() < ROUNDING * FAR));
        (0..3).filter(|k| !axes.contains(k)).all(across)
    }

    /// Rotary axes alone, where the slides have come to a place of the machine: these stay, all along the way. What the program has
    /// named in the part is elsewhere then.
    fn index(&mut self, from: &Axes, end: &mut Axes, by: [By; 3], state: &State) -> Result<(), Untold> {
        let kept = *end;
        self.hold(end, &[0, 1, 2], state)?;
        (0..3).for_each(|i| self.strays(i, end[i] - kept[i], by));
        (0..3).for_each(|i| self.indexed[i] |= (end[i] - kept[i]).abs() > LED);
        if matches!(self.machine.chain, Chain::FiveAxis(_)) {
            let turned = libm::sqrt((3..6).map(|i| (end[i] - from[i]) * (end[i] - from[i])).sum());
            let count = libm::ceil(turned / TURN_STEP - 1e-9).clamp(1.0, 10_000.0) as usize;
            for k in 1..count {
                let mut at: Axes = std::array::from_fn(|i| from[i] + (end[i] - from[i]) * k as f64 / count as f64);
                self.hold(&mut at, &[0, 1, 2], state)?;
                self.way.push(at);
            }
        }
        Ok(())
    }

    /// Where a table has tilted, what no word says of the part stays in the part: a slide that stayed would lead along what is named.
    fn stay_on_part(&self, from: &Axes, end: &mut Axes, held: &[usize], state: &State) -> Result<(), Untold> {
        let mut here = *from;
        if self.other_point(state) {
            self.hold(&mut here, &[0, 1, 2], state)?;
        }
        held.iter().for_each(|i| end[*i] = here[*i]);
        Ok(())
    }

    /// A coordinate of the part that the slides have changed by so much without a word, mm.
    fn strays(&mut self, i: usize, by: f64, known: [By; 3]) {
        if matches!(self.of, Of::Slides { .. }) && by.abs() > LED {
            self.strayed[i].get_or_insert(known[i]);
        }
    }

    /// A cut goes by no coordinate that an index or a way to a place of the machine has changed. From a height that was none of the part's
    /// before it may come down along that axis.
    fn rests_on_strayed(&self, view: &View<'_, '_>, from: &Axes, end: &Axes, to: &[bool; 9]) -> Result<(), Untold> {
        if !view.op.feeds() && !matches!(view.op, Op::Probe(_)) {
            return Ok(());
        }
        let straight = matches!(view.op, Op::Linear | Op::Probe(_));
        let comes_down = |i: usize| straight && to[i] && (0..6).all(|k| k == i || from[k] == end[k]);
        let rests = [0, 1, 2].map(|i| self.strayed[i].is_some_and(|known| known == By::Work || !comes_down(i)));
        if rests.contains(&true) { Err(Untold::Rests(rests, [from[0], from[1], from[2]])) } else { Ok(()) }
    }

    /// Places that the last move goes through before its end.
    pub fn way(&mut self) -> Vec<Axes> {
        std::mem::take(&mut self.way)
    }

    /// Keeps the slides where they stand along these coordinates.
    fn hold(&self, end: &mut Axes, held: &[usize], state: &State) -> Result<(), Untold> {
        let why = Untold::Turned([0, 1, 2].map(|i| held.contains(&i)));
        let stands = self.slides().ok_or(why)?;
        let rows: Vec<(V3, f64)> = held.iter().map(|i| self.along(*i, state)).map(|a| (a, dot(a, stands))).collect();
        self.solved(end, held, &rows, state).ok_or(why)
    }

    /// Brings what a move names to places of the machine; its other axes stay. Where rotary axes turn, coordinates that the program has
    /// named in the part stay there instead.
    fn to_machine(&mut self, end: &mut Axes, view: &View<'_, '_>, (to, goal): ([bool; 9], Goal), turns: bool, by: [By; 3], state: &State) -> Result<(), Untold> {
        let machine = view.state.machine(&view.end.axes);
        let machine = [machine[0], machine[1], machine[2]];
        let mut axes: Vec<usize> = (0..3).filter(|i| to[*i] || !turns || by[*i] != By::Work).collect();
        if turns && !self.apart(end, &axes, state) {
            axes = vec![0, 1, 2];
        }
        let apart = [0, 1, 2].map(|i| axes.contains(&i));
        let stands = self.slides().ok_or(Untold::Turned(apart))?;
        let work = self.place.turn;
        let mixes = |turn: &[V3; 3]| (0..3).any(|i| to[i] && (0..3).any(|k| !to[k] && (turn[i][k].abs() > 1e-12 || turn[k][i].abs() > 1e-12)));
        let home = matches!(goal, Goal::Home);
        if home && mixes(&work) && !matches!(self.of, Of::Place(_)) {
            return Err(Untold::Turned([to[0], to[1], to[2]]));
        }
        // LinuxCNC brings coordinates of the frame to those that the reference point has in it.
        let rotated = home && mixes(&rot_z(state.rotation));
        let rows: Vec<(V3, f64)> = axes
            .iter()
            .map(|i| {
                let along = if rotated { rot_z(state.rotation).map(|row| row[*i]) } else { std::array::from_fn(|k| f64::from(u8::from(k == *i))) };
                (along, dot(along, if to[*i] { machine } else { stands }))
            })
            .collect();
        self.solved(end, &axes, &rows, state).ok_or(Untold::Turned(apart))
    }

    /// Changes these coordinates until the slides are so far along each of these directions.
    fn solved(&self, end: &mut Axes, axes: &[usize], rows: &[(V3, f64)], state: &State) -> Option<()> {
        const TIMES: usize = 2;
        const FAR: f64 = 100.0;
        for _ in 0..TIMES {
            let here = self.slid(end, state, &self.place)?;
            let mut slope = vec![vec![0.0; axes.len()]; axes.len()];
            for (k, axis) in axes.iter().enumerate() {
                let mut moved = *end;
                moved[*axis] += FAR;
                let there = self.slid(&moved, state, &self.place)?;
                for (row, (along, _)) in slope.iter_mut().zip(rows) {
                    row[k] = dot(*along, sub(there, here)) / FAR;
                }
            }
            let left = rows.iter().map(|(along, goal)| goal - dot(*along, here)).collect();
            let by = solve(slope, left).filter(|by| by.iter().all(|v| v.abs() < 1e6))?;
            for (axis, by) in axes.iter().zip(by) {
                // What is there but for rounding stays as the program has it.
                end[*axis] += if by.abs() < ROUNDING { 0.0 } else { by };
            }
        }
        Some(())
    }

    /// Which way in the coordinates of the machine a coordinate goes.
    fn along(&self, i: usize, state: &State) -> V3 {
        let turn = Frame { turn: rot_z(state.rotation), ..Frame::IDENTITY };
        match self.of {
            Of::Slides { .. } => Frame { position: [0.0; 3], ..self.place }.then(&turn),
            Of::Place(_) => turn,
        }
        .turn
        .map(|row| row[i])
    }

    /// The tool point is another one than at the end of the last move, along a tool that may be tilted.
    fn other_point(&self, state: &State) -> bool {
        match (&self.of, &self.last) {
            (Of::Slides { tool, .. }, Last::Moved(_, last, _)) => tool(self.machine, state) != tool(self.machine, last),
            _ => true,
        }
    }

    /// Where the rotary axes stand for the words of a program: a part that is clamped turned about Z has them turned too, by which the
    /// tool points in the part as the words say. None where that takes more than one axis.
    fn rotary(&self, axes: &Axes, state: &State, place: &Frame) -> Option<[f64; 3]> {
        let words = crate::words::rotary(axes, state);
        let straight = (0..3).all(|i| (place.turn[i][i] - 1.0).abs() < 1e-12);
        let Of::Slides { kinematics, slides, .. } = &self.of else { return Some(words) };
        if straight || !matches!(self.machine.chain, Chain::FiveAxis(_)) {
            return Some(words);
        }
        let turn = |words: &[f64; 3]| {
            let asked = Asked { tip: [0.0; 3], tool: Frame::IDENTITY, rotary: *words };
            Some(kinematics.forward_frame(&started(self.machine, &asked, &slides.sliding, &slides.turning)).ok()?.turn)
        };
        let goal = product(&place.turn, &turn(&words)?);
        let by = libm::atan2(place.turn[1][0], place.turn[0][0]);
        [by, -by].map(|by| [words[0], words[1], words[2] + by]).into_iter().find(|words| turn(words).is_some_and(|t| same_turn(&t, &goal)))
    }

    /// Where the last move has left the slides.
    fn slides(&self) -> Option<V3> {
        match &self.last {
            Last::Home(at) => Some(*at),
            Last::Moved(axes, state, place) => self.slid(axes, state, place),
        }
    }

    /// Where the words of a program are in the coordinates of the machine.
    fn slid(&self, axes: &Axes, state: &State, place: &Frame) -> Option<V3> {
        let tip = place.then(&work_shift(state)).apply([axes[0], axes[1], axes[2]]);
        match &self.of {
            Of::Slides { kinematics, slides, tool } => {
                let asked = Asked { tip, tool: tool(self.machine, state), rotary: self.rotary(axes, state, place)? };
                let joints = slides.stand(self.machine, &**kinematics, &asked)?.joints;
                Some(slides.sliding.map(|j| joints[j]))
            }
            Of::Place(zero) => Some(Frame { position: *zero, ..*place }.inverse().apply(tip)),
        }
    }

    /// The coordinates in the work frame of slides that stand there, with the rotary words of these.
    fn unslid(&self, at: V3, axes: &Axes, state: &State) -> Option<V3> {
        let Of::Slides { kinematics, slides, tool } = &self.of else { return None };
        let tool = tool(self.machine, state);
        let asked = Asked { tip: at, tool, rotary: self.rotary(axes, state, &self.place)? };
        let joints = as_far_as_known(self.machine, &started(self.machine, &asked, &slides.sliding, &slides.turning), &slides.turning);
        let tip = kinematics.forward_frame(&joints).ok()?.then(&tool).position;
        Some(self.place.then(&work_shift(state)).inverse().apply(tip))
    }

    /// What moves nothing. Offsets that are set from where the machine stands are others than in the program's run.
    pub fn shifts<'p>(&mut self, program: &Program, out: &Builder, view: &View<'_, 'p>, sources: &dyn Sources, places: &Places<'_>) -> Told<'p> {
        let op = match view.op {
            Op::Begin { marker: Marker::Cycle, .. } => {
                // Up to R it goes before; of several passes each begins where the one before has ended.
                let before = (0..view.index).rev().map_while(|i| program.get(i).filter(|s| s.source == view.source));
                let rises = before.take_while(|s| s.op != Op::Close(Marker::Cycle)).any(|s| s.op == Op::Rapid);
                let first = self.line.filter(|(source, ..)| rises && *source == view.source);
                let (believed, real) = first.map_or((view.start.axes, out.pose().axes), |(_, believed, real)| (believed, real));
                self.level = level(program, view, &believed, &real)?;
                view.op
            }
            Op::Close(Marker::Cycle) => {
                self.level = None;
                view.op
            }
            Op::LocalOffset(offset) if self.sets_from_here() => {
                self.local(out, view, sources);
                Op::LocalOffset(plus(&offset, &self.shifted.local))
            }
            Op::StoredOffset { number, offset, rotation } if self.sets_from_here() => {
                self.work(number, out, view, sources, places)?;
                Op::StoredOffset { number, offset: plus(&offset, &self.shifted.work[slot(number)]), rotation }
            }
            Op::WorkOffset(number, offset) if self.sets_from_here() => {
                self.work(number, out, view, sources, places)?;
                self.shifted.current = self.shifted.work[slot(number)];
                Op::WorkOffset(number, plus(&offset, &self.shifted.current))
            }
            op => op,
        };
        Ok((op, *view.end))
    }

    /// On an arm it is told that they can't be.
    fn sets_from_here(&self) -> bool {
        matches!(self.of, Of::Slides { .. })
    }

    /// G92 and its like.
    fn local(&mut self, out: &Builder, view: &View<'_, '_>, sources: &dyn Sources) {
        let Some(letters) = Letters::at(sources, view.source.file, view.source.line) else { return };
        let Shifted { local, kept, .. } = &mut self.shifted;
        if letters.g(920) {
            let lag = lag(out, view);
            named(letters).for_each(|i| local[i] += lag[i]);
            named(letters).filter(|i| *i < 3).for_each(|i| self.beside[i] = 0.0);
            *kept = *local;
        } else if letters.g(921) {
            (*local, *kept) = ([0.0; 9], [0.0; 9]);
        } else if letters.g(922) {
            *local = [0.0; 9];
        } else if letters.g(923) {
            *local = *kept;
        } else if letters.g(520) {
            named(letters).for_each(|i| local[i] = 0.0);
            *kept = *local;
        }
    }

    /// G10.
    fn work(&mut self, number: u8, out: &Builder, view: &View<'_, '_>, sources: &dyn Sources, places: &Places<'_>) -> Result<(), Untold> {
        let Some(letters) = Letters::at(sources, view.source.file, view.source.line).filter(|l| l.g(100)) else { return Ok(()) };
        if !sets_here(sources, view.source) {
            if number_of(sources, 'l', view.source) == Some(2) {
                named(letters).for_each(|i| self.shifted.work[slot(number)][i] = 0.0);
            }
            return Ok(());
        }
        let state = out.state();
        let mut lag = lag(out, view);
        if number != state.work {
            // Seen from where the other one is put.
            let here = work_shift(state).apply(out.pose().xyz());
            let seen = places.of(number).inverse().then(&places.of(state.work)).apply(here);
            (0..3).for_each(|i| lag[i] += seen[i] - here[i]);
        }
        if state.rotation != 0.0 && (lag[0].abs() > ROUNDING || lag[1].abs() > ROUNDING) {
            return Err(Untold::Rests([0, 1, 2].map(|i| lag[i].abs() > ROUNDING), view.start.xyz()));
        }
        named(letters).for_each(|i| self.shifted.work[slot(number)][i] = self.shifted.current[i] + lag[i]);
        Ok(())
    }
}

fn slot(number: u8) -> usize {
    usize::from(number.min(9))
}

fn plus(a: &Axes, b: &Axes) -> Axes {
    std::array::from_fn(|i| a[i] + b[i])
}

fn named(letters: Letters) -> impl Iterator<Item = usize> {
    (0..9).filter(move |i| letters.has(super::WORDS[*i]))
}

/// How far the machine stands from where the program's run has it, in the work frame.
fn lag(out: &Builder, view: &View<'_, '_>) -> Axes {
    std::array::from_fn(|i| {
        let lag = out.pose().axes[i] - view.start.axes[i];
        if lag.abs() < ROUNDING { 0.0 } else { lag }
    })
}

/// The height a canned cycle comes back to is where it begins, if that is above its R: both where the run has it and where it is.
fn level(program: &Program, view: &View<'_, '_>, believed: &Axes, real: &Axes) -> Result<Option<Level>, Untold> {
    let axis = plane_axes(view.state.plane).2;
    let (believed, real) = (believed[axis], real[axis]);
    if axis > 2 || (believed - real).abs() < ROUNDING {
        return Ok(None);
    }
    let own = program.steps().skip(view.index + 1).take_while(|s| s.op != Op::Close(Marker::Cycle));
    let Some(clear) = own.into_iter().find(|s| s.op.cuts()).map(|s| s.start.axes[axis]) else { return Ok(None) };
    match () {
        _ if believed < clear && real <= clear => Ok(None),
        _ if believed > clear && real >= clear => Ok(Some(Level { axis, believed, real })),
        _ => Err(Untold::Rests([0, 1, 2].map(|i| i == axis), [believed; 3])),
    }
}

/// The operation with another way: an arc or a curve can only be moved as a whole.
fn bent<'p>(view: &View<'_, 'p>, from: &Axes, end: &Axes) -> Result<Op<'p>, Untold> {
    let lag: V3 = std::array::from_fn(|i| from[i] - view.start.axes[i]);
    let moved = |i: usize| (end[i] - view.end.axes[i] - lag[i]).abs() < ROUNDING;
    let rests = |some: [bool; 3]| {
        let off = [0, 1, 2].map(|i| some[i] && !(moved(i)));
        if off.contains(&true) { Err(Untold::Rests(off, view.start.xyz())) } else { Ok(()) }
    };
    match view.op {
        Op::Arc(arc) => {
            let bent = match arc.plane {
                ArcPlane::Work(plane) => {
                    let (u, v, _) = plane_axes(plane);
                    [0, 1, 2].map(|i| i == u || i == v)
                }
                ArcPlane::Free(_) => [true; 3],
            };
            rests(bent)?;
            Ok(Op::Arc(Arc { center: add(arc.center, lag), ..arc }))
        }
        Op::Nurbs { .. } if lag[0] != 0.0 || lag[1] != 0.0 => Err(Untold::Rests([lag[0] != 0.0, lag[1] != 0.0, false], view.start.xyz())),
        op => Ok(op),
    }
}
