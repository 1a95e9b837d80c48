//! One walk over a robot program for all languages: looks up what steps point to, says what signals do, gives arcs
//! as the language takes them, and reports. A language sees [`Op`]s and writes text.

use crate::number::num;
use crate::orient;
use crate::posture::Posture;
use crate::{Options, Output};
use gr_ir::{Source, Sources};
use gr_machine::math::{Frame, about, add, cross, dot, norm, quaternion_of, rotate, scale, sub};
use gr_machine::{Chain, Kinematics, Machine, Signal};
use gr_robot::{Action, MAX_JOINTS, RobotProgram, Target, Word, Zone};
use gr_text::{Code, Diagnostic, FileId, Findings, Span, code};
use std::collections::BTreeSet;

/// What a language has to write next.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Op<'p> {
    /// A line of the source: number from 1, and its text.
    Line(u32, &'p str),
    /// The joints of the home position, where the program starts.
    Home(&'p Target),
    /// Joints move together, at a share of their greatest speed.
    Joint { to: &'p Target, share: f64, zone: Option<f64> },
    /// A straight line, mm/s; the corner at its end in mm, none = the tool stops there.
    Linear { to: &'p Target, speed: f64, zone: Option<f64> },
    /// An arc through a point.
    Arc { via: &'p Target, to: &'p Target, speed: f64, zone: Option<f64> },
    /// A straight line until an input has a state; `must`: the program stops where it never has.
    Probe { to: &'p Target, speed: f64, input: &'p str, on: bool, must: bool },
    /// The tool point changes.
    Tool(usize),
    /// The work frame changes.
    Frame(usize),
    /// An output.
    Set { name: &'p str, value: Value, word: &'p str },
    /// A routine of the cell, with a number for it.
    Call { name: &'p str, value: Option<f64> },
    /// Wait for an input.
    Wait { name: &'p str, on: bool, timeout: Option<f64> },
    /// Wait, s.
    Dwell(f64),
    /// For the operator.
    Message(&'p str),
    /// For the reader.
    Comment(&'p str),
    /// Wait for the operator.
    Pause,
    /// Nothing more.
    End,
}

impl Op<'_> {
    /// Points of a program that it takes.
    pub(crate) fn points(&self) -> u64 {
        match self {
            Op::Home(_) | Op::Joint { .. } | Op::Linear { .. } | Op::Probe { .. } => 1,
            Op::Arc { .. } => 2,
            _ => 0,
        }
    }
}

/// The value of an output.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Value {
    Digital(bool),
    Analog(f64),
    /// A number on a group of outputs.
    Group(u32),
}

/// Which machines a language is for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Arms {
    /// Six joints and a spherical wrist.
    Spherical,
    /// Six revolute joints.
    Six,
    /// Arms of four to six joints.
    Any,
}

/// Where the controllers of a language count work frames from, when the machine file has no `[frames.controller]`.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum World {
    /// The foot of the robot.
    Foot,
    /// On the first axis, at the height of the second.
    Shoulder,
}

/// What the walk must know of a language.
pub(crate) struct Traits {
    /// `ABB RAPID`
    pub title: &'static str,
    /// Machines.
    pub arms: Arms,
    /// Zero point of work frames.
    pub world: World,
    /// Targets, or joint positions, have the values of external axes; otherwise these are left where they stand.
    pub external: bool,
    /// Arcs through a point.
    pub arcs: bool,
    /// Source lines are remarked behind moves; otherwise in lines of their own.
    pub trailing: bool,
    /// Why it needs `--allow-unverified`; empty = it doesn't.
    pub unverified: &'static str,
}

impl Traits {
    /// A frame in the machine's base as the controller counts it.
    pub(crate) fn in_control(&self, machine: &Machine, frame: &Frame) -> Frame {
        let usual = match (&machine.chain, self.world) {
            (Chain::Opw(arm), World::Shoulder) => Frame::shift([0.0, 0.0, arm.lengths()[3]]),
            _ => Frame::IDENTITY,
        };
        machine.cell.in_control(frame, &usual)
    }
}

/// What writes a language.
pub(crate) trait Body {
    /// Writes what is next.
    fn op(&mut self, cx: &mut Cx, op: Op);
}

/// What is known while writing.
pub(crate) struct Cx<'p> {
    pub program: &'p RobotProgram,
    pub machine: &'p Machine,
    pub options: &'p Options,
    pub traits: &'static Traits,
    /// The tool in use.
    pub tool: usize,
    /// The work frame in use.
    pub frame: usize,
    /// Line of the source (from 1) that the move comes from, where a remark is due.
    pub remark: Option<u32>,
    /// The next motion is an arc.
    pub arc_next: bool,
    /// Length of the next motion, where that is a line or an arc.
    pub next_length: Option<f64>,
    /// Length of this motion.
    pub length: f64,
    /// Where the tool was before this motion.
    pub before: Option<Target>,
    /// The step of the program that is being written, where it comes from the source.
    pub step: Option<u32>,
    /// Something has moved since home.
    moved: bool,
    at: Option<Source>,
    sources: &'p dyn Sources,
    kinematics: Box<dyn Kinematics>,
    said: BTreeSet<(Code, String)>,
    out: Findings,
}

/// Straight pieces of an arc stay this near to it, mm.
const CHORD: f64 = 0.01;
/// An arc whose middle is this near to its chord is a line: less than positions are written with.
const FLAT: f64 = 0.002;
/// Points of an arc nearer than this to each other make controllers refuse it (ABB's manual: 0.1 mm).
const CLOSE: f64 = 0.1;
/// No cell is larger, mm.
const FAR: f64 = 1e6;
const MOST_PIECES: usize = 10_000;
const MOST_FINDINGS: usize = 1000;

/// Walks a program. With an error among the findings nothing may be written.
pub(crate) fn walk<'p>(
    program: &'p RobotProgram,
    sources: &'p dyn Sources,
    options: &'p Options,
    traits: &'static Traits,
    body: &mut dyn Body,
) -> Output {
    let mut cx = Cx {
        program,
        machine: &program.machine,
        options,
        traits,
        tool: 0,
        frame: 0,
        remark: None,
        arc_next: false,
        next_length: None,
        length: 0.0,
        before: None,
        step: None,
        moved: false,
        at: None,
        sources,
        kinematics: program.machine.kinematics(),
        said: BTreeSet::new(),
        out: Findings::new(MOST_FINDINGS),
    };
    if cx.fits() {
        cx.run(body);
    }
    Output { files: Vec::new(), findings: cx.out.into_list() }
}

impl<'p> Cx<'p> {
    /// A work frame of the program as the controller counts it; the controller's own without one.
    pub(crate) fn frame_in_control(&self, index: usize) -> Frame {
        let frame = self.program.frames.get(index).map(|f| f.frame).unwrap_or_default();
        self.traits.in_control(self.machine, &frame)
    }

    fn fits(&mut self) -> bool {
        let joints = &self.machine.joints;
        let ok = match self.traits.arms {
            Arms::Spherical => matches!(self.machine.chain, Chain::Opw(_)),
            Arms::Six => joints.len() == 6,
            Arms::Any => (4..=6).contains(&joints.len()) && self.machine.kind == gr_machine::Kind::Robot,
        };
        let home_known = joints.len() + self.machine.cell.external.len() <= MAX_JOINTS;
        if !ok || !home_known {
            let kind = match self.traits.arms {
                Arms::Spherical => "arms with six joints and a spherical wrist (`kind = \"opw\"`)",
                Arms::Six => "arms with six joints",
                Arms::Any => "robot arms with four to six joints",
            };
            self.say(code::VENDOR_WRONG_MACHINE, &[self.traits.title.into(), kind.into(), self.machine.id.clone()]);
        }
        if !self.traits.unverified.is_empty() {
            self.unverified(self.traits.unverified);
        }
        !self.failed()
    }

    fn run(&mut self, body: &mut dyn Body) {
        let program = self.program;
        self.rails(body);
        self.stand_still(body);
        body.op(self, Op::Home(&program.home));
        self.before = Some(program.home);
        self.before = self.moved_before();
        let mut last = None;
        for (i, step) in program.steps.iter().enumerate() {
            self.at = step.source;
            self.step = step.source.and_then(|_| u32::try_from(i).ok());
            let line = step.source.map(|s| (s.file, s.line));
            let new = line.is_some() && line != last;
            last = line.or(last);
            self.remark = None;
            if new && let Some((file, line)) = line {
                let motion = matches!(step.action, Action::Joint { .. } | Action::Linear { .. } | Action::Arc { .. } | Action::Probe { .. });
                if motion && self.traits.trailing {
                    self.remark = Some(line + 1);
                } else if !matches!(step.action, Action::End | Action::Comment(_)) {
                    let text = self.sources.line(file, line).unwrap_or("").trim();
                    body.op(self, Op::Line(line + 1, text));
                }
            }
            self.step(body, i, &step.action);
            if matches!(step.action, Action::End) || self.out.full() {
                break;
            }
        }
    }

    /// What the frames of a robot on a rail are relative to. Which is right only its control knows.
    fn rails(&mut self, body: &mut dyn Body) {
        for e in self.machine.cell.external.iter().filter(|e| e.carries_machine && e.position != 0.0) {
            let (name, place) = (&e.joint.name, e.joint.show(e.position));
            if e.coupled.is_none() {
                self.say(code::VENDOR_RAIL, &[name.clone(), place.clone()]);
            }
            let text = match e.coupled {
                Some(true) => format!(
                    "{name} carries the robot and is at {place}. Work frames: from the base at 0; the control must count {name} in poses"
                ),
                _ => format!(
                    "{name} carries the robot and is at {place}. Work frames: from the base there; the control must not count {name} in poses"
                ),
            };
            body.op(self, Op::Comment(&text));
        }
    }

    /// Where external axes have to stand that the language has no word for.
    fn stand_still(&mut self, body: &mut dyn Body) {
        for e in self.machine.cell.external.iter().filter(|_| !self.traits.external) {
            self.say(code::VENDOR_EXTERNAL_STANDS, &[e.joint.name.clone(), e.joint.show(e.position), self.traits.title.into()]);
            body.op(self, Op::Comment(&e.stands()));
        }
    }

    /// How far the tool point goes in a joint move from where it is, mm, and how long the joints take at a share of their greatest
    /// speeds, s. None where it isn't known where they are, and where nothing moves.
    pub fn joint_way(&self, to: &Target, share: f64) -> Option<(f64, f64)> {
        // Finer than that the way grows by less than a thousandth.
        const PIECES: i32 = 32;
        let from = &self.before?.joints;
        let seconds = gr_robot::joint_seconds(self.machine, from, &to.joints, share);
        let tool = self.program.tools.get(self.tool).map(|t| t.frame).unwrap_or_default();
        let n = self.machine.joints.len().min(MAX_JOINTS);
        let place = |k: i32| {
            let at = f64::from(k) / f64::from(PIECES);
            let joints: [f64; MAX_JOINTS] = std::array::from_fn(|i| from[i] + (to.joints[i] - from[i]) * at);
            Some(self.kinematics.forward_frame(joints.get(..n)?).ok()?.then(&tool).position)
        };
        let (mut way, mut last) = (0.0, place(0)?);
        for k in 1..=PIECES {
            let next = place(k)?;
            way += norm(sub(next, last));
            last = next;
        }
        (seconds > 0.0).then_some((way, seconds))
    }

    fn step(&mut self, body: &mut dyn Body, index: usize, action: &'p Action) {
        match action {
            Action::Joint { to, speed, zone } => {
                let Some(to) = self.target(*to) else { return };
                let home = !self.moved && to.joints == self.program.home.joints;
                self.look_ahead(index, to);
                self.length = 0.0;
                if !home {
                    body.op(self, Op::Joint { to, share: *speed, zone: radius(*zone) });
                }
                self.before = Some(*to);
                self.moved = true;
            }
            Action::Linear { to, speed, zone, .. } => {
                let Some(to) = self.target(*to) else { return };
                self.look_ahead(index, to);
                self.line(body, to, *speed, radius(*zone));
            }
            Action::Probe { to, speed, input, on, must } => {
                let Some(to) = self.target(*to) else { return };
                self.length = self.before.map_or(0.0, |b| norm(sub(to.position, b.position)));
                if speed.is_finite() && *speed > 0.0 {
                    body.op(self, Op::Probe { to, speed: *speed, input, on: *on, must: *must });
                } else {
                    self.say(code::VENDOR_FEED_RANGE, &[num(*speed, 6), "more than 0".into(), self.traits.title.into()]);
                }
                (self.before, self.moved) = (Some(*to), true);
            }
            Action::Arc { via, to, center, normal, angle, speed, zone } => {
                let (Some(via), Some(to)) = (self.target(*via), self.target(*to)) else { return };
                self.look_ahead(index, to);
                let shape = Shape { center: *center, normal: *normal, angle: *angle };
                self.arc(body, via, to, &shape, *speed, radius(*zone));
            }
            Action::UseTool(i) => {
                self.tool = usize::from(*i);
                self.before = self.moved_before();
                if self.program.tools.get(self.tool).is_some() {
                    body.op(self, Op::Tool(self.tool));
                }
            }
            Action::UseFrame(i) => {
                self.frame = usize::from(*i);
                self.before = self.moved_before();
                if self.program.frames.get(self.frame).is_some() {
                    body.op(self, Op::Frame(self.frame));
                }
            }
            Action::ChangeTool { number, by } => self.change(body, *number, by.as_ref()),
            Action::Signal { word, value, signal } => self.signal(body, word, *value, signal),
            Action::Dwell(s) => body.op(self, Op::Dwell(*s)),
            Action::WaitInput { name, on, timeout } => body.op(self, Op::Wait { name, on: *on, timeout: *timeout }),
            Action::Message(text) => body.op(self, Op::Message(text)),
            Action::Comment(text) => body.op(self, Op::Comment(text)),
            Action::Pause { optional } => {
                if *optional {
                    self.say(code::VENDOR_OPTIONAL_STOP, &[self.traits.title.into()]);
                }
                body.op(self, Op::Pause);
            }
            Action::End => body.op(self, Op::End),
        }
    }

    /// Where the tool is now, seen from the new frame: found from the joints.
    fn moved_before(&self) -> Option<Target> {
        let before = self.before?;
        let mut moved = before;
        let n = self.machine.joints.len().min(MAX_JOINTS);
        let flange = self.kinematics.forward_frame(before.joints.get(..n)?).ok()?;
        let tool = self.program.tools.get(self.tool).map(|t| t.frame).unwrap_or_default();
        let frame = self.program.frames.get(self.frame).map(|f| f.frame).unwrap_or_default();
        let seen = frame.inverse().then(&flange.then(&tool));
        (moved.position, moved.quaternion) = (seen.position, quaternion_of(&seen.turn));
        Some(moved)
    }

    fn target(&mut self, index: u32) -> Option<&'p Target> {
        let target = self.program.targets.get(index as usize);
        let good = target.is_some_and(|t| {
            t.position.iter().all(|v| v.abs() < FAR)
                && t.joints.iter().all(|v| v.abs() < FAR)
                && (t.quaternion.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-6
        });
        if !good {
            let what = target.map_or("it is missing".to_string(), |t| {
                format!("X {} Y {} Z {}", num(t.position[0], 3), num(t.position[1], 3), num(t.position[2], 3))
            });
            self.say(code::VENDOR_NOT_A_POSITION, &[what]);
            return None;
        }
        target
    }

    /// What languages with blends must know of the next motion.
    fn look_ahead(&mut self, index: usize, here: &Target) {
        let (mut arc, mut length) = (false, None);
        for step in self.program.steps.iter().skip(index + 1).take(8) {
            let to = |i: &u32| self.program.targets.get(*i as usize).map(|t| norm(sub(t.position, here.position)));
            match &step.action {
                Action::Linear { to: next, .. } => length = to(next),
                Action::Arc { to: next, .. } => (arc, length) = (true, to(next)),
                Action::Comment(_) => continue,
                _ => {}
            }
            break;
        }
        (self.arc_next, self.next_length) = (arc, length);
    }

    fn line(&mut self, body: &mut dyn Body, to: &Target, speed: f64, zone: Option<f64>) {
        self.length = self.before.map_or(0.0, |b| norm(sub(to.position, b.position)));
        if !(speed > 0.0 && speed < FAR) {
            self.say(code::VENDOR_FEED_RANGE, &[num(speed, 6), "more than 0".into(), self.traits.title.into()]);
            return;
        }
        body.op(self, Op::Linear { to, speed, zone });
        (self.before, self.moved) = (Some(*to), true);
    }

    fn arc(&mut self, body: &mut dyn Body, via: &Target, to: &Target, shape: &Shape, speed: f64, zone: Option<f64>) {
        let Some(from) = self.before else {
            self.say(code::VENDOR_NOT_A_POSITION, &["an arc needs a point before it".into()]);
            return;
        };
        let radius = norm(sub(from.position, shape.center));
        if radius * (1.0 - libm::cos(shape.angle / 2.0)) <= FLAT {
            return self.line(body, to, speed, zone);
        }
        let rise = dot(sub(to.position, from.position), shape.normal);
        let near = norm(sub(via.position, from.position)).min(norm(sub(to.position, via.position)));
        let why = if !self.traits.arcs {
            format!("{} has no arcs", self.traits.title)
        } else if rise.abs() > FLAT {
            "it climbs as it turns".to_string()
        } else if near < CLOSE {
            "its points lie too close together".to_string()
        } else {
            self.length = radius * shape.angle;
            if speed > 0.0 && speed < FAR {
                body.op(self, Op::Arc { via, to, speed, zone });
            } else {
                self.say(code::VENDOR_FEED_RANGE, &[num(speed, 6), "more than 0".into(), self.traits.title.into()]);
            }
            (self.before, self.moved) = (Some(*to), true);
            return;
        };
        self.pieces(body, &from, to, shape, (radius, rise), (speed, zone), &why);
    }

    #[allow(clippy::too_many_arguments)]
    fn pieces(
        &mut self,
        body: &mut dyn Body,
        from: &Target,
        to: &Target,
        shape: &Shape,
        (radius, rise): (f64, f64),
        (speed, zone): (f64, Option<f64>),
        why: &str,
    ) {
        let step = 2.0 * libm::acos((1.0 - CHORD / radius).clamp(-1.0, 1.0));
        let count = (libm::ceil(shape.angle / step.max(1e-6)) as usize).clamp(1, MOST_PIECES);
        self.say(code::VENDOR_ARC_AS_LINES, &[count.to_string(), num(CHORD, 3), why.into()]);
        let spoke = sub(from.position, shape.center);
        let along = if norm(cross(shape.normal, spoke)) > 0.0 { shape.normal } else { [0.0, 0.0, 1.0] };
        let (blend, mut before) = (zone.map(|z| z.min(CHORD)), *from);
        for i in 1..=count {
            let share = i as f64 / count as f64;
            let mut next = *to;
            if i < count {
                let around = rotate(&about(along, shape.angle * share), spoke);
                next.position = add(add(shape.center, around), scale(along, rise * share));
                next.quaternion = orient::between(&from.quaternion, &to.quaternion, share);
                if !self.reach(&mut next, &before) {
                    return;
                }
            }
            self.line(body, &next, speed, if i < count { blend.or(Some(CHORD)) } else { zone });
            self.remark = None;
            before = next;
        }
    }

    /// Joint values of a point, in the configuration and turns nearest to those of the point before.
    fn reach(&mut self, target: &mut Target, near: &Target) -> bool {
        let tool = self.program.tools.get(self.tool).map(|t| t.frame).unwrap_or_default();
        let frame = self.program.frames.get(self.frame).map(|f| f.frame).unwrap_or_default();
        let point = frame.then(&orient::frame(target.position, &target.quaternion));
        let found = self.kinematics.inverse_frame(&point.then(&tool.inverse()));
        let solution = found.ok().and_then(|all| all.into_iter().find(|s| s.branch == near.branch));
        let Some(solution) = solution else {
            let p = target.position;
            self.say(code::VENDOR_NOT_A_POSITION, &[format!("the arm doesn't reach X {} Y {} Z {}", num(p[0], 3), num(p[1], 3), num(p[2], 3))]);
            return false;
        };
        for (i, value) in solution.joints.iter().enumerate().take(MAX_JOINTS) {
            let turn = 2.0 * std::f64::consts::PI;
            let revolute = self.machine.joints.get(i).is_some_and(|j| j.kind == gr_machine::JointKind::Revolute);
            let turns = if revolute { libm::round((near.joints[i] - value) / turn) } else { 0.0 };
            target.joints[i] = value + turns * turn;
        }
        true
    }

    fn change(&mut self, body: &mut dyn Body, number: u32, by: Option<&'p Signal>) {
        match by {
            Some(signal) => self.signal(body, &Word::new("M6"), Some(f64::from(number)), signal),
            None => {
                let name = self.program.tools.iter().find(|t| t.number == number).map(|t| format!(" {}", t.name));
                let text = format!("Tool {number}{}", name.unwrap_or_default());
                body.op(self, Op::Message(&text));
                body.op(self, Op::Pause);
            }
        }
    }

    fn signal(&mut self, body: &mut dyn Body, word: &Word, value: Option<f64>, signal: &Signal) {
        let key = word.key();
        let nothing = signal.routine.is_none() && signal.signal.is_none() && signal.wait.is_none() && signal.seconds.is_none();
        if nothing {
            self.say(code::VENDOR_SIGNAL_MISSING, std::slice::from_ref(&key));
        }
        if let Some(name) = &signal.routine {
            body.op(self, Op::Call { name, value: signal.value.or(value) });
        } else if let Some(name) = &signal.signal {
            // What the program says goes before what the machine file says; a tool's number takes several outputs.
            let value = match (word.code.as_str(), value, signal.value) {
                ("S" | "M67" | "M68", Some(v), _) => Value::Analog(v),
                ("M6", Some(v), _) => Value::Group(v as u32),
                (_, _, Some(v)) if v != 0.0 && v != 1.0 => Value::Analog(v),
                (_, _, v) => Value::Digital(v != Some(0.0)),
            };
            body.op(self, Op::Set { name, value, word: &key });
        }
        match (&signal.wait, signal.seconds) {
            (Some(name), timeout) => body.op(self, Op::Wait { name, on: true, timeout }),
            (None, Some(seconds)) => body.op(self, Op::Dwell(seconds)),
            (None, None) => {}
        }
    }

    /// A finding at the line in work; the same words are said once.
    pub fn say(&mut self, code: Code, args: &[String]) {
        let (file, span) = self.at.map_or((FileId(0), Span::default()), |s| self.sources.place(s));
        let finding = Diagnostic::new(code, file, span, args);
        let key = (code, finding.message.clone());
        if !self.said.contains(&key) && self.out.admits(code) {
            self.said.insert(key);
            self.out.add(finding);
        }
    }

    /// A form whose meaning on the controller is not confirmed.
    pub fn unverified(&mut self, why: &str) {
        if !self.options.allow_unverified {
            self.say(code::VENDOR_UNVERIFIED, &[self.traits.title.into(), why.into()]);
        }
    }

    /// What the language can't say.
    pub fn cannot(&mut self, what: &str) {
        self.say(code::VENDOR_CANNOT, &[what.into(), self.traits.title.into()]);
    }

    /// A routine is called without the number that it needs.
    pub fn no_number(&mut self) {
        self.cannot("a number for a routine");
    }

    /// The language has no probe move whose form is sure.
    pub fn no_probe(&mut self) {
        self.cannot("a probe move (G38)");
    }

    /// The configuration can't be written.
    pub fn configuration(&mut self, why: String) {
        self.say(code::VENDOR_CONFIGURATION, &[self.traits.title.into(), why]);
    }

    /// A rounded feed, warned of when it shows: `exact` and `written` in mm/s.
    pub fn rounded(&mut self, exact: f64, written: f64, text: &str) {
        let off = (written - exact).abs() / exact;
        if off > 1e-4 {
            self.say(code::VENDOR_FEED_ROUNDED, &[num(exact, 4), text.into(), self.traits.title.into(), num(100.0 * off, 2)]);
        }
    }

    /// The number of a signal, for controllers that count them.
    pub fn number(&mut self, name: &str, word: &str) -> u32 {
        crate::name::number(name).unwrap_or_else(|| {
            let why = "its outputs and inputs are numbered, and the name holds no single number";
            self.say(code::VENDOR_SIGNAL_NAME, &[name.into(), word.into(), self.traits.title.into(), why.into()]);
            0
        })
    }

    /// A name that must exist on the controller.
    pub fn known<'n>(&mut self, name: &'n str, word: &str) -> &'n str {
        if !crate::name::plain(name) {
            let why = "it is no name there";
            self.say(code::VENDOR_SIGNAL_NAME, &[name.into(), word.into(), self.traits.title.into(), why.into()]);
        }
        name
    }

    /// The name of a routine on the controller, which can't be one of the language's own words.
    pub fn routine<'n>(&mut self, name: &'n str, reserved: &[&str]) -> &'n str {
        if reserved.contains(&name.to_ascii_uppercase().as_str()) {
            let why = "it is a word of the language, no name of a routine";
            self.say(code::VENDOR_SIGNAL_NAME, &[name.into(), "routine".into(), self.traits.title.into(), why.into()]);
        }
        self.known(name, "routine")
    }

    /// An analog value as a share of the range, 0 to 1.
    pub fn share(&mut self, value: f64, word: &str, name: &str) -> f64 {
        let most = self.machine.cell.spindle.as_ref().and_then(|s| s.speed.1);
        let share = match (word, most) {
            ("S", Some(most)) if most > 0.0 => value / most,
            _ => value,
        };
        if !(0.0..=1.0).contains(&share) {
            let why = if word == "S" && most.is_none() { "the greatest speed of the spindle is not known" } else { "it takes 0 to 1" };
            let what = format!("{word} {}", num(value, 4));
            self.say(code::VENDOR_VALUE_RANGE, &[what, name.into(), self.traits.title.into(), why.into()]);
        }
        share
    }

    /// Text that a controller can show.
    pub fn ascii(&mut self, text: &str) -> String {
        let plain: String = text.chars().map(|c| if (' '..='~').contains(&c) { c } else if c == '\t' { ' ' } else { '?' }).collect();
        if text.chars().any(|c| !c.is_ascii() || (c.is_ascii_control() && c != '\t')) {
            self.say(code::VENDOR_TEXT_CHANGED, &[self.traits.title.into()]);
        }
        plain
    }

    /// Joint values as the controller counts them: degrees and mm, the machine's own joints.
    pub fn degrees(&self, target: &Target) -> Vec<f64> {
        let n = self.machine.joints.len().min(MAX_JOINTS);
        let values = self.machine.controller_values(&target.joints[..n]);
        let unit = |(v, j): (&f64, &gr_machine::Joint)| match j.kind {
            gr_machine::JointKind::Revolute => v.to_degrees(),
            gr_machine::JointKind::Prismatic => *v,
        };
        values.iter().zip(&self.machine.joints).map(unit).collect()
    }

    /// Values of the external axes: degrees and mm.
    pub fn external(&self, target: &Target) -> Vec<f64> {
        let n = self.machine.joints.len();
        let axis = |(i, e): (usize, &gr_machine::External)| {
            let v = target.joints.get(n + i).copied().unwrap_or(0.0);
            if e.joint.kind == gr_machine::JointKind::Revolute { v.to_degrees() } else { v }
        };
        self.machine.cell.external.iter().enumerate().map(axis).collect()
    }

    /// How the arm stands.
    pub fn posture(&self, target: &Target) -> Posture {
        let n = self.machine.joints.len().min(MAX_JOINTS);
        Posture::of(self.machine, &target.joints[..n]).unwrap_or(Posture { behind: false, forward: true })
    }

    /// Whether anything forbids writing.
    pub fn failed(&self) -> bool {
        self.out.failed()
    }

    /// Decimals of positions, mm.
    pub fn decimals(&self) -> usize {
        self.options.decimals.unwrap_or(*crate::DECIMALS.start()).clamp(*crate::DECIMALS.start(), *crate::DECIMALS.end())
    }
}

struct Shape {
    center: [f64; 3],
    normal: [f64; 3],
    angle: f64,
}

fn radius(zone: Zone) -> Option<f64> {
    match zone {
        Zone::Blend(r) if r > 1e-3 => Some(r),
        _ => None,
    }
}

/// Whether findings forbid writing.
pub(crate) fn any_error(findings: &[Diagnostic]) -> bool {
    findings.iter().any(|f| f.severity == gr_text::Severity::Error)
}

/// Pieces of a text no longer than a controller's line, cut at blanks where there are any.
pub(crate) fn wrapped(text: &str, width: usize) -> Vec<String> {
    let (mut out, mut line) = (Vec::new(), String::new());
    for word in text.split(' ') {
        if !line.is_empty() && line.len() + 1 + word.len() > width {
            out.push(std::mem::take(&mut line));
        }
        let mut word = word;
        while word.len() > width {
            let (head, tail) = word.split_at(width);
            out.push(head.to_string());
            word = tail;
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    if !line.is_empty() || out.is_empty() {
        out.push(line);
    }
    out
}
