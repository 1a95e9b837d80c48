//! All passes in order: gather, choose, emit; and what goes wrong in them as findings at source lines.

use gr_ir::{Program, Sources};
use gr_machine::math::{Frame, M3, product, rot_z};
use gr_machine::{Chain as MachineChain, Kind, KinematicsError, Machine};
use gr_text::{Diagnostic, code};

use crate::choose::{Chain, Chooser, Fault, Node, Why, chains};
use crate::emit::Emit;
use crate::gather::{Findings, Gather, Gathered, Item, Move, Way};
use crate::path::Mount;
use crate::settle::{control_tool, settled};
use crate::solver::{Branches, Joints, Limits, Solver};
use crate::{MAX_JOINTS, Options, Planned, Zone};

/// Plans the motion of one machine. With errors there is no result, and the list holds everything that was found.
pub fn plan(program: &Program, machine: &Machine, sources: &dyn Sources, options: &Options) -> Result<Planned, Vec<Diagnostic>> {
    let mut gather = Gather::new(machine, options, sources);
    if let MachineChain::Incomplete { .. } = machine.chain {
        let why = machine.kinematics().forward(&[]).err().map_or(String::new(), |e| e.to_string());
        gather.findings.say(code::ROBOT_HOME, None, &[why]);
        return Err(gather.findings.take());
    }
    let settled = settled(program, machine, sources, &options.setups, control_tool);
    if let Some(untold) = settled.as_ref().and_then(|s| s.finding(sources)) {
        return Err(vec![untold]);
    }
    gather.run(settled.as_ref().map_or(program, |s| &s.program));
    let Gather { out: gathered, findings, .. } = gather;
    let mut solver = Solver::new(machine);
    solver.words = !gathered.by_direction;
    solver.leans = gathered.frames.iter().any(|f| !solver.follows_words(&f.frame.turn));
    let mut planner = Planner {
        machine,
        options,
        g: gathered,
        findings,
        solver,
        limits: Limits::new(machine),
        speeds: speeds(machine),
        told: std::collections::BTreeSet::new(),
    };
    planner.run()
}

/// Joint values of the home position, checked or not.
pub(crate) fn home_joints(machine: &Machine) -> Option<Vec<f64>> {
    let given = machine.cell.home.clone().or_else(|| machine.start_joints.clone());
    given.or_else(|| {
        let frame = machine.start.frame();
        machine.kinematics().inverse_frame(&frame).ok().and_then(|all| all.into_iter().next()).map(|s| s.joints)
    })
}

/// Greatest speed of each joint in a rapid.
pub(crate) fn speeds(machine: &Machine) -> Joints {
    let mut out = [std::f64::consts::FRAC_PI_2; MAX_JOINTS];
    for (slot, j) in out.iter_mut().zip(&machine.joints) {
        *slot = j.top_rapid();
    }
    out
}

struct Planner<'a> {
    machine: &'a Machine,
    options: &'a Options,
    g: Gathered,
    findings: Findings<'a>,
    solver: Solver,
    limits: Limits,
    speeds: Joints,
    told: std::collections::BTreeSet<Option<(u32, u32)>>,
}

impl Planner<'_> {
    fn run(&mut self) -> Result<Planned, Vec<Diagnostic>> {
        let home = self.home();
        self.drop_unreachable();
        // A mill goes on from home; an arm's moves are looked at from any place.
        let Some(start) = home.or((self.machine.kind == Kind::Robot).then_some([0.0; MAX_JOINTS])) else { return Err(self.findings.take()) };
        let (list, nodes): (Vec<Chain>, Vec<Vec<Node>>) = self.nodes(&start).into_iter().unzip();
        let nodes = self.chooser(list.len(), None).cheapest(&nodes, &start);
        let emit = Emit::new(self.machine, &self.solver, &self.limits, &self.options.name);
        if self.findings.bad() {
            // Nothing is made, but what can be done is looked at for joints that are too fast.
            let mut more = self.findings.apart(code::ROBOT_JOINT_SPEED, self.told.iter().copied().flatten());
            emit.look_at_speeds(&mut self.g, &list, &nodes, &start, &mut more);
            self.findings.adopt_errors(more);
            let mut told = self.findings.take();
            told.sort_by_key(|d| (d.primary().0.0, d.primary().1.start));
            return Err(told);
        }
        let (program, summary) = emit.run(&mut self.g, &list, &nodes, &start, &mut self.findings);
        if self.findings.bad() {
            return Err(self.findings.take());
        }
        Ok(Planned { program, warnings: self.findings.take(), summary })
    }

    /// Chooses among the configurations of so many chains.
    fn chooser(&self, chains: usize, stands: Option<Joints>) -> Chooser<'_> {
        let count = chains.max(1);
        Chooser { g: &self.g, solver: &self.solver, limits: &self.limits, speeds: self.speeds, kept: (2_000_000 / count).clamp(8, 48), stands }
    }

    /// Joint values of the home position.
    fn home(&mut self) -> Option<Joints> {
        let Some(given) = home_joints(self.machine) else {
            self.findings.say(code::ROBOT_HOME, None, &["the machine file gives none, and the start can't be reached".into()]);
            return None;
        };
        let mut out = [0.0; MAX_JOINTS];
        for (slot, v) in out.iter_mut().zip(&given) {
            *slot = *v;
        }
        if let Some((i, v)) = self.machine.outside(&given).into_iter().next() {
            let joint = &self.machine.joints[i];
            self.findings.say(code::ROBOT_HOME, None, &[format!("joint {} would be at {}, outside its limits", joint.name, joint.show(v))]);
            return None;
        }
        Some(out)
    }

    /// Approach and retract that can't be had are left out.
    fn drop_unreachable(&mut self) {
        let ours: Vec<usize> = (0..self.g.items.len()).filter(|i| matches!(&self.g.items[*i], Item::Move(m) if m.ours)).collect();
        for i in ours.into_iter().rev() {
            let Item::Move(m) = &self.g.items[i] else { continue };
            if !self.stands(m) {
                self.leave_out(i);
            }
        }
    }

    fn stands(&self, m: &Move) -> bool {
        let spins: Vec<f64> = if m.free { (0..24).map(|k| f64::from(k) * std::f64::consts::TAU / 24.0).collect() } else { vec![0.0] };
        let tool = Frame { turn: self.g.turns[m.turn as usize], position: m.position };
        let mut all = Branches::NONE;
        spins.into_iter().any(|spin| {
            self.solver.all(&Mount::new(&self.g, m, spin).flange(&tool), &mut all).is_ok()
                && (0..8).any(|b| {
                    all.has(b) && {
                        let q = all.joints[usize::from(b)];
                        (0..self.solver.count).all(|j| self.limits.shifts(j, q[j], q[j]).is_some())
                            && self.limits.coupled_outside(&q).is_none()
                            && self.solver.violations(&q).is_empty()
                    }
                })
        })
    }

    /// Leaves out an approach (a joint move) or a retract (a line): of the program, or of a setup in it.
    fn leave_out(&mut self, i: usize) {
        let sourced = |i: &Item| if let Item::Move(Move { source: Some(s), .. }) = i { Some(*s) } else { None };
        let (before, after) = (&self.g.items[..i], &self.g.items[i + 1..]);
        let (from, to) = (before.iter().rev().find_map(sourced), after.iter().find_map(sourced));
        let comes = matches!(&self.g.items[i], Item::Move(m) if m.way == Way::Joint);
        let (which, source) = match (from, to) {
            (_, None) => ("last", from),
            (None, _) => ("first", to),
            (Some(_), Some(_)) if comes => ("setup's first", to),
            (Some(_), Some(_)) => ("setup's last", from),
        };
        let in_work = before.iter().rev().find_map(|i| if let Item::Move(m) = i { Some(!m.rapid) } else { None }) == Some(true);
        if which == "setup's last" && in_work {
            // The operator would take the part from under a tool that stands in it.
            let why = format!("the setup before it ends with a cut, and {} mm above that the arm can't stand", self.options.approach);
            self.findings.say(code::JOB_BEGINS_IN_WORK, to, &["after it".to_string(), why]);
        }
        let args = [format!("{}", self.options.approach), which.to_string()];
        self.findings.say(code::ROBOT_NO_APPROACH, source, &args);
        let Item::Move(m) = self.g.items.remove(i) else { return };
        if m.way == Way::Joint
            && let Some(Item::Move(next)) = self.g.items.get_mut(i..).and_then(|rest| rest.iter_mut().find(|n| matches!(n, Item::Move(_))))
        {
            *next = Move { way: Way::Joint, speed: m.speed, zone: Zone::Stop, rapid: true, ..*next };
        }
    }

    /// All chains with their nodes; a chain without any is a finding instead, or is divided where that was asked for.
    fn nodes(&mut self, home: &Joints) -> Vec<(Chain, Vec<Node>)> {
        let mut out: Vec<(Chain, Vec<Node>)> = Vec::new();
        let mut list = chains(&self.g.items);
        let (mut k, mut count) = (0, list.len());
        while k < list.len() {
            let chain = list[k];
            // A mill goes on from where it stands, whole turns and all.
            let stands = (k == 0 && self.machine.kind == Kind::Mill).then_some(*home);
            let found = self.chooser(count, stands).nodes(chain);
            match found {
                Ok(nodes) => {
                    out.push((chain, nodes));
                    k += 1;
                }
                Err(fault) => {
                    if self.without_ours(chain, &fault) || self.divided(chain, &fault) {
                        // What was looked at stays; of a chain that was begun behind a fault only the rest.
                        let first = (chain.first..self.g.items.len()).find(|i| matches!(self.g.items[*i], Item::Move(_))).unwrap_or(chain.first);
                        list.truncate(k);
                        list.extend(chains(&self.g.items).into_iter().filter(|c| c.last >= first).map(|c| Chain { first: c.first.max(first), ..c }));
                        count = list.len();
                        continue;
                    }
                    self.tell(chain, &fault);
                    k += 1;
                    if fault.item < chain.last && !self.full() {
                        // What comes after is told too, as if the machine stood there.
                        let first = self.next_move(fault.item).unwrap_or(chain.last);
                        list.insert(k, Chain { first, last: chain.last });
                    }
                    if self.full() {
                        break;
                    }
                }
            }
        }
        out
    }

    fn full(&self) -> bool {
        self.findings.errors() >= 100
    }
    fn next_move(&self, after: usize) -> Option<usize> {
        (after + 1..self.g.items.len()).find(|i| matches!(self.g.items[*i], Item::Move(_)))
    }

    /// Tries again without the approach or retract that failed.
    fn without_ours(&mut self, chain: Chain, fault: &Fault) -> bool {
        let is_ours = |i: usize| matches!(&self.g.items[i], Item::Move(m) if m.ours);
        // An approach with no configuration in common with what follows fails in what follows.
        let approach = is_ours(chain.first) && self.next_move(chain.first) == Some(fault.item);
        let i = if approach { chain.first } else { fault.item };
        if !is_ours(i) {
            return false;
        }
        self.leave_out(i);
        true
    }

    /// Puts a retract, a change of configuration and a return before the move that can't be done.
    fn divided(&mut self, chain: Chain, fault: &Fault) -> bool {
        let Some(height) = self.options.reconfigure else { return false };
        let before = (chain.first..fault.item).rev().find(|i| matches!(self.g.items[*i], Item::Move(_)));
        // Nobody can come back to where a probe stopped.
        let before = before.filter(|i| !matches!(&self.g.items[*i], Item::Move(m) if m.probe.is_some()));
        // Without a cut since the last change another one would be the same again.
        let cuts = (chain.first..fault.item).any(|i| matches!(&self.g.items[i], Item::Move(m) if !m.rapid));
        let Some(at) = before.filter(|at| cuts && *at > chain.first) else { return false };
        let Item::Move(m) = &self.g.items[at] else { return false };
        let m = *m;
        let axis: M3 = self.g.turns[m.turn as usize];
        let sign = if self.machine.kind == Kind::Robot { -1.0 } else { 1.0 };
        let up = [0, 1, 2].map(|i| m.position[i] + sign * axis[i][2] * height);
        let speed = self.machine.cell.line_rapid();
        let lift = Move { way: Way::Line, position: up, speed, zone: Zone::Stop, length: height, rapid: true, ..m };
        let change = Move { way: Way::Joint, speed: 0.5, length: 0.0, ..lift };
        let back = Move { position: m.position, ..lift };
        if let Item::Move(m) = &mut self.g.items[at] {
            m.zone = Zone::Stop;
        }
        let more = [lift, change, back].map(Item::Move);
        self.g.items.splice(at + 1..at + 1, more);
        true
    }

    fn tell(&mut self, chain: Chain, fault: &Fault) {
        let Item::Move(m) = &self.g.items[fault.item] else { return };
        let m = *m;
        let at = show(fault.position);
        let source = fault.source.or(m.source);
        // The first point that fails explains those after it.
        if !self.told.insert(source.map(|s| (s.file.0, s.line))) {
            return;
        }
        let sourced = |i: &Item| if let Item::Move(m) = i { m.source } else { None };
        let first = self.g.items[chain.first..=fault.item].iter().find_map(sourced).map_or(0, |s| s.line + 1);
        match &fault.why {
            Why::Reach(KinematicsError::Direction) | Why::Reach(KinematicsError::OutOfPlane { .. }) if self.solver.count < 6 && self.solver.control == gr_machine::Control::Full => {
                self.findings.say(code::ROBOT_SEVERAL_SETUPS, source, &[]);
            }
            Why::Reach(e) if fault.share < 1.0 && m.way != Way::Joint && self.stands(&m) => {
                self.findings.say(code::ROBOT_LEAVES_WORKSPACE, source, &[at, e.to_string()]);
            }
            Why::Reach(KinematicsError::Singular) => self.findings.say(code::ROBOT_SINGULAR, source, &[format!("{at}; {}", KinematicsError::Singular)]),
            Why::Reach(e) => self.findings.say(code::ROBOT_OUT_OF_REACH, source, &[format!("{at}; {e}")]),
            Why::Condition(v) if fault.share < 1.0 && m.way != Way::Joint && self.stands(&m) => {
                let why = format!("`{}`, {} would be at {}", v.name, v.what, amount(v));
                self.findings.say(code::ROBOT_LEAVES_WORKSPACE, source, &[at, why]);
            }
            Why::Condition(v) => {
                let limit = amount(&gr_machine::Violation { value: v.limit, ..v.clone() });
                self.findings.say(code::ROBOT_CONDITION, source, &[v.name.into(), v.what.clone(), amount(v), limit, at]);
            }
            Why::Limit { joint, value, limit, farthest } => self.limit(chain, fault, source, (*joint, [*value, *farthest], *limit), (first, at)),
            Why::Jump => {
                let why = format!("at {at} it is singular: the tool can't go on without a jump of joints");
                if self.stands_at(fault, &m) {
                    self.findings.say(code::ROBOT_CONFIGURATION, source, &[first.to_string(), why]);
                } else {
                    self.findings.say(code::ROBOT_SINGULAR, source, &[at]);
                }
            }
        }
    }

    /// A joint beyond its limit, where that is seen and at the farthest of its move; `first`: the line that the configuration was chosen for.
    fn limit(&mut self, chain: Chain, fault: &Fault, source: Option<gr_ir::Source>, (joint, [value, farthest], limit): (usize, [f64; 2], f64), (first, at): (u32, String)) {
        let j = &self.machine.joints[joint];
        let (value, bound) = (j.show(value), j.show(limit));
        let Item::Move(m) = &self.g.items[fault.item] else { return };
        let why = format!("joint {} would have to go to {value}, its limit is {bound}", j.name);
        let (goes_on, other) = (fault.item > chain.first, self.stands_at(fault, m));
        if goes_on && self.machine.kind != Kind::Mill && other {
            return self.findings.say(code::ROBOT_CONFIGURATION, source, &[first.to_string(), why]);
        }
        if fault.share < 1.0 && m.way != Way::Joint && !other && self.stands(m) {
            return self.findings.say(code::ROBOT_LEAVES_WORKSPACE, source, &[at, why]);
        }
        self.findings.say(code::ROBOT_JOINT_LIMIT, source, &[j.name.clone(), j.show(farthest), bound]);
    }

    /// Whether the arm could stand at the place of a fault in some configuration.
    fn stands_at(&self, fault: &Fault, m: &Move) -> bool {
        self.stands(&Move { position: fault.position, ..*m })
    }
}

pub(crate) fn show(p: [f64; 3]) -> String {
    format!("X {:.3} Y {:.3} Z {:.3}", p[0], p[1], p[2])
}

/// A value of a condition: lengths and determinants as numbers, angles in degrees.
fn amount(v: &gr_machine::Violation) -> String {
    let angle = ["yaw", "universal", "spherical"].iter().any(|n| v.name.starts_with(n));
    match (angle, v.name) {
        (true, _) => format!("{:.3}°", v.value.to_degrees()),
        (_, "singular") => format!("{:.3e}", v.value),
        (_, "assembly") => format!("{}", v.value),
        _ => format!("{:.3} mm", v.value),
    }
}

/// The tool's turn with its own spin.
pub(crate) fn spun(turn: &M3, free: bool, spin: f64) -> M3 {
    if free && spin != 0.0 { product(turn, &rot_z(spin)) } else { *turn }
}
