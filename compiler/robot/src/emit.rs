//! Last pass: the chosen configurations become targets, the speed of joints is checked along the real path, and the
//! figures of the summary are gathered.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use gr_ir::Source;
use gr_machine::math::{Frame, M3, quaternion_of};
use gr_machine::Machine;
use gr_text::code;

use crate::choose::{Chain, Node};
use crate::follow::Follow;
use crate::gather::{Findings, Gathered, Item, Move, Way};
use crate::path::{Mount, Path, handed_on};
use crate::plan::spun;
use crate::solver::{Branches, Joints, Limits, Solver, whole_turns_off};
use crate::program::{ON_THE_SPOT, joint_seconds, turned_on_the_spot};
use crate::{Action, MAX_JOINTS, RobotProgram, Step, Summary, Target, Zone};

pub(crate) struct Emit<'a> {
    machine: &'a Machine,
    solver: &'a Solver,
    limits: &'a Limits,
    /// Greatest speeds at feed; infinite where not known.
    speeds: Joints,
    name: &'a str,
    targets: Vec<Target>,
    steps: Vec<Step>,
    summary: Summary,
    /// Values of external axes: they stand still.
    external: Vec<f64>,
    /// The probe's input.
    probe: String,
    /// By file and line: a block may be many pieces, one run often, and the worst of them is told.
    too_fast: BTreeMap<(u32, u32), TooFast>,
}

/// A joint that is faster than it can be.
struct TooFast {
    source: Option<Source>,
    joint: usize,
    /// Its speed over its limit.
    part: f64,
    /// Speed of the tool point that fits, mm/s.
    fits: f64,
}

/// Sag of a joint move that is worth a word, mm.
const SAG: f64 = 1.0;
/// Closer to a singular position than this is worth a word, rad.
const CLOSE: f64 = 3.0 * std::f64::consts::PI / 180.0;

/// From this share of its limit on a joint's speed is looked at closer.
const NEAR_LIMIT: f64 = 0.9;
/// A feed that fits is told so much lower than what was found: between two looks the joint may be a little faster.
const FITS: f64 = 0.999;

/// Where the tool is while the program is walked along.
struct Here {
    at: Frame,
    by: Move,
    joints: Joints,
    branch: u8,
}

/// Where a walk ends: whether anything moved, the last joint values, and the tool and frame in force.
struct Ends {
    moved: bool,
    last: Joints,
    tool: Option<u16>,
    frame: Option<u16>,
}

impl<'a> Emit<'a> {
    pub fn new(machine: &'a Machine, solver: &'a Solver, limits: &'a Limits, name: &'a str) -> Emit<'a> {
        let mut speeds = [f64::INFINITY; MAX_JOINTS];
        for (slot, j) in speeds.iter_mut().zip(&machine.joints) {
            *slot = j.speed.unwrap_or(f64::INFINITY);
        }
        let external = machine.cell.external.iter().map(|e| e.position);
        Emit {
            machine,
            solver,
            limits,
            speeds,
            name,
            targets: Vec::new(),
            steps: Vec::new(),
            summary: Summary::default(),
            external: external.collect(),
            probe: String::new(),
            too_fast: BTreeMap::new(),
        }
    }

    /// Only looks at the joints' speeds in the chains that are given; what is between them can't be done.
    pub fn look_at_speeds(mut self, g: &mut Gathered, list: &[Chain], nodes: &[Node], home: &Joints, findings: &mut Findings<'_>) {
        self.moves(g, list, nodes, home, findings);
    }

    pub fn run(mut self, g: &mut Gathered, list: &[Chain], nodes: &[Node], home: &Joints, findings: &mut Findings<'_>) -> (RobotProgram, Summary) {
        self.summary.wait_seconds = g.wait_seconds;
        let Ends { moved, last, tool, frame } = self.moves(g, list, nodes, home, findings);
        let at_home = self.home_target(g, home, frame, tool);
        // A milling program says itself where the machine goes in the end.
        if moved && self.machine.kind != gr_machine::Kind::Mill {
            let to = self.keep(at_home);
            let speed = self.machine.cell.joint_share();
            self.summary.rapid_seconds += self.joint_time(&last, home, speed);
            self.steps.push(Step { action: Action::Joint { to, speed, zone: Zone::Stop }, source: None });
        }
        self.steps.push(Step { action: Action::End, source: None });
        self.near_singular(findings);
        let program = RobotProgram {
            name: self.name.to_string(),
            machine: self.machine.clone(),
            tools: g.tools.clone(),
            frames: g.frames.clone(),
            targets: self.targets,
            home: at_home,
            steps: self.steps,
            curves: std::mem::take(&mut g.curves),
        };
        if let Some([cut, rapid]) = crate::setpoints::paced(&program) {
            (self.summary.cut_seconds, self.summary.rapid_seconds, self.summary.accelerates) = (cut, rapid, true);
        }
        (program, self.summary)
    }

    fn moves(&mut self, g: &mut Gathered, list: &[Chain], nodes: &[Node], home: &Joints, findings: &mut Findings<'_>) -> Ends {
        let items = std::mem::take(&mut g.items);
        self.probe = crate::gather::probing::input(&items, self.machine).unwrap_or_default();
        self.steps.reserve(items.len() + 2);
        self.targets.reserve(items.len() + 2);
        let mut here: Option<Here> = None;
        let mut chain = 0;
        let mut node: Option<(&Node, Chain)> = None;
        let mut last = *home;
        // What is in force at the end: the way home is told in it.
        let (mut tool, mut frame) = (None, None);
        for (i, item) in items.into_iter().enumerate() {
            match item {
                Item::Do(step) => {
                    match step.action {
                        Action::UseTool(t) => tool = Some(t),
                        Action::UseFrame(f) => frame = Some(f),
                        _ => {}
                    }
                    self.steps.push(step);
                }
                Item::Move(m) => {
                    if list.get(chain).is_some_and(|c| c.first == i) {
                        node = nodes.get(chain).map(|n| (n, list[chain]));
                        chain += 1;
                    }
                    // Where a chain can't be done nobody knows where the machine is.
                    let Some((node, _)) = node.filter(|(_, c)| i <= c.last) else {
                        here = None;
                        continue;
                    };
                    self.mv(g, &m, node, &mut here, &mut last, findings);
                }
            }
        }
        self.tell_too_fast(findings);
        Ends { moved: here.is_some(), last, tool, frame }
    }

    fn keep(&mut self, target: Target) -> u32 {
        self.targets.push(target);
        u32::try_from(self.targets.len() - 1).unwrap_or(u32::MAX)
    }

    fn target(&self, position: [f64; 3], turn: &M3, joints: &Joints, branch: u8) -> Target {
        let mut joints = *joints;
        for (slot, v) in joints.iter_mut().skip(self.solver.count).zip(&self.external) {
            *slot = *v;
        }
        Target { position, quaternion: quaternion_of(turn), joints, branch }
    }

    fn home_target(&self, g: &Gathered, home: &Joints, frame: Option<u16>, tool: Option<u16>) -> Target {
        let frame = frame.map_or(Frame::IDENTITY, |f| g.frames[usize::from(f)].frame);
        let tool = tool.map_or(Frame::IDENTITY, |t| g.tools[usize::from(t)].frame);
        let at = self.solver.forward(home).map_or(Frame::IDENTITY, |f| frame.inverse().then(&f).then(&tool));
        let mut all = Branches::NONE;
        let branch = self.solver.forward(home).and_then(|f| self.solver.all(&f, &mut all).ok()).map_or(0, |()| nearest(&all, home, self.solver.count));
        self.target(at.position, &at.turn, home, branch)
    }

    fn mv(&mut self, g: &mut Gathered, m: &Move, node: &Node, here: &mut Option<Here>, last: &mut Joints, findings: &mut Findings<'_>) {
        let turn = spun(&g.turns[m.turn as usize], m.free, node.spin);
        if m.way == Way::Joint {
            let joints = node.start;
            let to = self.keep(self.target(m.position, &turn, &joints, node.branch));
            self.sweep(g, m, here.as_ref(), last, &joints, findings);
            self.summary.rapid_seconds += self.joint_time(last, &joints, m.speed);
            self.summary.rapids += 1;
            self.steps.push(Step { action: Action::Joint { to, speed: m.speed, zone: m.zone }, source: m.source });
            *here = Some(Here { at: Frame { turn: g.turns[m.turn as usize], position: m.position }, by: *m, joints, branch: node.branch });
            *last = joints;
            self.look(&joints, m.source);
            return;
        }
        let Some(h) = here else {
            // The rest of a chain, behind what can't be done: it is looked at from its first place on.
            let at = Frame { turn: g.turns[m.turn as usize], position: m.position };
            (*here, *last) = (Some(Here { at, by: *m, joints: node.start, branch: node.branch }), node.start);
            return;
        };
        h.at = handed_on(g, h.at, &h.by, m, node.spin);
        let ((joints, branch), via) = self.follow(g, m, node, h);
        let to = self.keep(self.target(m.position, &turn, &joints, branch));
        let action = match m.way {
            Way::Arc(i) => {
                let a = g.arcs[i as usize];
                let via = self.keep(self.target(a.via, &turn, &via.0, via.1));
                self.summary.arcs += 1;
                Action::Arc { via, to, center: a.center, normal: a.normal, angle: a.angle, speed: m.speed, zone: m.zone }
            }
            _ => match m.probe {
                Some(c) => Action::Probe { to, speed: m.speed, input: self.probe.clone(), on: c.on, must: c.must },
                None => Action::Linear { to, speed: m.speed, zone: m.zone, rapid: m.rapid },
            },
        };
        self.steps.push(Step { action, source: m.source });
        *h = Here { at: Frame { turn: g.turns[m.turn as usize], position: m.position }, by: *m, joints, branch };
        *last = joints;
    }

    /// Joint values along a move: the end, the middle, and whether any joint is too fast.
    fn follow(&mut self, g: &Gathered, m: &Move, node: &Node, h: &Here) -> ((Joints, u8), (Joints, u8)) {
        let path = Path::new(g, self.solver, &h.at, m);
        let mount = Mount::new(g, m, node.spin);
        let looks = path.looks();
        // An even number of looks has one in the middle.
        let looks = if matches!(m.way, Way::Arc(_)) { looks.next_multiple_of(2) } else { looks };
        let begin = (h.joints, h.branch);
        let ((mut q, mut branch), mut middle) = (begin, begin);
        let follow = Follow { solver: self.solver, limits: self.limits, path: &path, mount: &mount };
        let mut worst = self.fastest(&follow, looks, begin, false, |emit, k, next| {
            (q, branch) = *next;
            if 2 * k == looks {
                middle = *next;
            }
            emit.look(&next.0, m.source);
        });
        let on_the_spot = || turned_on_the_spot(self.machine, &h.joints, &q) / m.speed;
        let seconds = if path.length > ON_THE_SPOT { path.length / m.speed } else { on_the_spot() };
        if !m.rapid && seconds > 0.0 {
            if worst.0 > NEAR_LIMIT * seconds {
                worst = self.fastest(&follow, looks, begin, true, |_, _, _| {});
            }
            self.fast(m, (worst.0 / seconds, worst.1));
        }
        if m.rapid {
            self.summary.rapids += 1;
            self.summary.rapid_seconds += seconds;
        } else {
            self.summary.cuts += 1;
            self.summary.cut_seconds += seconds;
        }
        ((q, branch), middle)
    }

    /// The joint that is fastest along a way, and its change over its limit by the share of the way. Tells every look.
    fn fastest(
        &mut self,
        follow: &Follow<'_>,
        looks: usize,
        begin: (Joints, u8),
        closer: bool,
        mut tell: impl FnMut(&mut Self, usize, &(Joints, u8)),
    ) -> (f64, usize) {
        let (mut q, mut branch) = begin;
        let mut all = Branches::NONE;
        let mut worst = (0.0f64, 0usize);
        for k in 1..=looks {
            let (a, b) = ((k - 1) as f64 / looks as f64, k as f64 / looks as f64);
            // The chooser has been here: nothing is out of reach.
            let _ = self.solver.all(&follow.mount.flange(&follow.path.at(b)), &mut all);
            let next = follow.step(&all, (&q, branch), (a, b)).unwrap_or((q, branch));
            let rates = follow.rates((&q, branch), (&next.0, next.1), (a, b), closer);
            for i in 0..self.solver.count {
                let part = rates[i] / self.speeds[i];
                if part > worst.0 {
                    worst = (part, i);
                }
            }
            (q, branch) = next;
            tell(self, k, &next);
        }
        worst
    }

    fn fast(&mut self, m: &Move, (part, joint): (f64, usize)) {
        if self.summary.joint_speed.is_none_or(|(p, ..)| part > p) && part > 0.0 {
            self.summary.joint_speed = Some((part, joint, m.source));
        }
        if part > 1.0 + 1e-9 {
            let found = TooFast { source: m.source, joint, part, fits: m.speed / part };
            let line = m.source.map_or((0, 0), |s| (s.file.0, s.line));
            match self.too_fast.entry(line) {
                Entry::Occupied(mut known) if found.fits < known.get().fits => *known.get_mut() = found,
                Entry::Occupied(_) => {}
                Entry::Vacant(new) => _ = new.insert(found),
            }
        }
    }

    /// Joints that are too fast, each block with the feed at which all of it fits.
    fn tell_too_fast(&mut self, findings: &mut Findings<'_>) {
        for TooFast { source, joint, part, fits } in std::mem::take(&mut self.too_fast).into_values() {
            let (limit, joint) = (self.speeds[joint], &self.machine.joints[joint]);
            let per_second = |v: f64| format!("{}/s", joint.show(v));
            let fits = libm::floor(fits * FITS * 60.0 * 10.0) / 10.0;
            // The share holds in whatever unit the program has its F (inches, 1/min under G93).
            let share = libm::floor(FITS / part * 1000.0) / 10.0;
            let fits = format!("{fits} mm/min, {share} % of its feed,");
            findings.say(code::ROBOT_JOINT_SPEED, source, &[joint.name.clone(), per_second(limit * part), per_second(limit), fits]);
        }
    }

    /// Margins at a place.
    fn look(&mut self, q: &Joints, source: Option<Source>) {
        let (close, which) = self.solver.closeness_of_all(q);
        if close.is_finite() && self.summary.singularity.is_none_or(|(c, ..)| close < c) {
            self.summary.singularity = Some((close, which, source));
        }
        let (left, joint) = self.limits.margin(q);
        if self.summary.limit_margin.is_none_or(|(l, ..)| left < l) {
            self.summary.limit_margin = Some((left, joint, source));
        }
        if let Some(margin) = self.solver.reach_margin(q)
            && self.summary.reach_margin.is_none_or(|(m, _)| margin < m)
        {
            self.summary.reach_margin = Some((margin, source));
        }
    }

    fn near_singular(&self, findings: &mut Findings<'_>) {
        if let Some((close, which, source)) = self.summary.singularity
            && close < CLOSE
        {
            findings.say(code::ROBOT_NEAR_SINGULAR, source, &[format!("{} but for {:.2}°", which.words(), close.to_degrees())]);
        }
    }

    fn joint_time(&self, a: &Joints, b: &Joints, share: f64) -> f64 {
        joint_seconds(self.machine, a, b, share)
    }

    /// How deep the tool sags below both ends of a joint move.
    fn sweep(&self, g: &Gathered, m: &Move, here: Option<&Here>, from: &Joints, to: &Joints, findings: &mut Findings<'_>) {
        if here.is_none() || m.source.is_none() || self.solver.control != gr_machine::Control::Full {
            return;
        }
        let frame = g.frames[usize::from(m.frame)].frame;
        let tool = g.tools[usize::from(m.tool)].frame;
        let back = frame.inverse();
        // The tool may have been changed since: its point of now, where the arm stood.
        let Some(start) = self.solver.forward(from).map(|f| back.apply(f.then(&tool).position)) else { return };
        let least = start[2].min(m.position[2]);
        let mut lowest = least;
        for k in 1..16 {
            let share = f64::from(k) / 16.0;
            let mut q = *from;
            for i in 0..self.solver.count {
                q[i] += (to[i] - from[i]) * share;
            }
            if let Some(f) = self.solver.forward(&q) {
                lowest = lowest.min(back.apply(f.then(&tool).position)[2]);
            }
        }
        if least - lowest > SAG {
            findings.say(code::ROBOT_RAPID_SWEEP, m.source, &[format!("{:.1}", least - lowest)]);
        }
    }
}

/// The configuration nearest to some joint values.
fn nearest(all: &Branches, q: &Joints, count: usize) -> u8 {
    let far = |b: u8| (0..count).map(|i| whole_turns_off(all.joints[usize::from(b)][i] - q[i]).abs()).fold(0.0, f64::max);
    (0..8).filter(|b| all.has(*b)).min_by(|a, b| far(*a).total_cmp(&far(*b))).unwrap_or(0)
}
