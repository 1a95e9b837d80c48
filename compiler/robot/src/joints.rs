//! A planned program as joint positions: every move cut so that, with all joints moving evenly between two of them, the
//! tool point stays within a tolerance of its path. Forward kinematics between the positions prove it.

use std::fmt::Write as _;

use gr_ir::{Source, Sources};
use gr_machine::JointKind;
use gr_machine::math::{Frame, norm, sub, turn_of};
use gr_text::{Diagnostic, code};

use crate::follow::{Follow, nearer, unwrap};
use crate::gather::{ArcPiece, Findings, Gathered, Move, Way};
use crate::path::{Mount, Path};
use crate::solver::{Branches, Joints, Limits, Solver};
use crate::program::{ON_THE_SPOT, turned_on_the_spot};
use crate::{Action, MAX_JOINTS, RobotProgram, Step, Target, Zone};

/// What can be chosen.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct JointOptions {
    /// Greatest distance of the tool point from its path between two positions, mm.
    pub tolerance: f64,
    /// Greatest time between two positions, s; none = as far as the tolerance allows.
    pub interval: Option<f64>,
    /// Positions at most.
    pub most: usize,
}

impl Default for JointOptions {
    fn default() -> JointOptions {
        JointOptions { tolerance: 0.01, interval: None, most: 4_000_000 }
    }
}

/// A joint position.
#[derive(Clone, PartialEq, Debug)]
pub struct JointPoint {
    /// Joint values, rad or mm.
    pub joints: [f64; MAX_JOINTS],
    /// Tool point and turn in the base.
    pub tool: Frame,
    /// Time of the way here, s.
    pub seconds: f64,
    /// Whether the way here is a rapid.
    pub rapid: bool,
    /// Whether the machine comes to rest here.
    pub stop: bool,
    /// Where it comes from.
    pub source: Option<Source>,
}

/// Positions and, between them, what else is done.
#[derive(Clone, PartialEq, Debug)]
pub enum Event {
    /// Go there.
    Point(JointPoint),
    /// Step of the program that is no move.
    Do(usize),
}

/// A program as joint positions.
#[derive(Clone, PartialEq, Debug)]
pub struct JointPath {
    /// Home first.
    pub events: Vec<Event>,
}

impl JointPath {
    /// The positions.
    pub fn points(&self) -> impl Iterator<Item = &JointPoint> {
        self.events.iter().filter_map(|e| if let Event::Point(p) = e { Some(p) } else { None })
    }
}

/// More positions than allowed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TooMany {
    /// Allowed.
    pub most: usize,
    /// Where.
    pub source: Option<Source>,
}

struct Run<'a> {
    program: &'a RobotProgram,
    options: &'a JointOptions,
    solver: Solver,
    limits: Limits,
    rapid: Joints,
    g: Gathered,
    out: Vec<Event>,
    tool: u16,
    frame: u16,
    here: Target,
    points: usize,
}

/// Cuts the moves of a program.
pub fn joint_path(program: &RobotProgram, options: &JointOptions) -> Result<JointPath, TooMany> {
    let rapid = crate::plan::speeds(&program.machine);
    let g = Gathered {
        items: Vec::new(),
        turns: Vec::new(),
        arcs: Vec::new(),
        tools: program.tools.clone(),
        frames: program.frames.clone(),
        wait_seconds: 0.0,
        curves: crate::Curves::default(),
        by_direction: false,
    };
    let solver = Solver::new(&program.machine);
    let mut run = Run {
        program,
        options,
        limits: Limits::new(&program.machine),
        rapid,
        g,
        out: Vec::new(),
        tool: 0,
        frame: 0,
        here: program.home,
        points: 0,
        solver,
    };
    run.push(program.home.joints, 0.0, true, true, None)?;
    for (i, step) in program.steps.iter().enumerate() {
        run.step(i, &step.action, step.source)?;
    }
    Ok(JointPath { events: run.out })
}

impl Run<'_> {
    fn step(&mut self, i: usize, action: &Action, source: Option<Source>) -> Result<(), TooMany> {
        match action {
            Action::UseTool(t) => self.change_tool(*t),
            Action::UseFrame(f) => self.change_frame(*f),
            Action::Joint { to, speed, zone } => {
                let to = self.program.targets[*to as usize];
                let seconds = self.joint_time(&self.here.joints, &to.joints) / speed;
                self.even(&to.joints, seconds, zone == &Zone::Stop, source)?;
                self.here = to;
            }
            Action::Linear { to, speed, zone, rapid } => self.path(*to, None, *speed, *zone, *rapid, source)?,
            Action::Probe { to, speed, .. } => self.path(*to, None, *speed, Zone::Stop, false, source)?,
            Action::Arc { via, to, center, normal, angle, speed, zone } => {
                let via = self.program.targets[*via as usize].position;
                let arc = ArcPiece { center: *center, normal: *normal, via, angle: *angle };
                self.path(*to, Some(arc), *speed, *zone, false, source)?;
            }
            _ => self.out.push(Event::Do(i)),
        }
        Ok(())
    }

    /// The same place in another frame.
    fn change_frame(&mut self, frame: u16) {
        let (old, new) = (self.g.frames[usize::from(self.frame)].frame, self.g.frames[usize::from(frame)].frame);
        self.here = self.here.reframed(&old, &new);
        self.frame = frame;
    }

    /// The same machine at another tool point.
    fn change_tool(&mut self, tool: u16) {
        if let [Some(old), Some(new)] = [self.tool, tool].map(|t| self.g.tools.get(usize::from(t))) {
            self.here = self.here.retooled(&old.frame, &new.frame);
        }
        self.tool = tool;
    }

    fn push(&mut self, joints: Joints, seconds: f64, rapid: bool, stop: bool, source: Option<Source>) -> Result<(), TooMany> {
        self.points += 1;
        if self.points > self.options.most {
            return Err(TooMany { most: self.options.most, source });
        }
        let tip = self.g.tools.get(usize::from(self.tool)).map_or(Frame::IDENTITY, |t| t.frame);
        let tool = self.solver.forward(&joints).map_or(Frame::IDENTITY, |f| f.then(&tip));
        self.out.push(Event::Point(JointPoint { joints, tool, seconds, rapid, stop, source }));
        Ok(())
    }

    fn joint_time(&self, a: &Joints, b: &Joints) -> f64 {
        (0..self.solver.count).map(|i| (a[i] - b[i]).abs() / self.rapid[i]).fold(0.0, f64::max)
    }

    /// All joints evenly; cut by time only.
    fn even(&mut self, to: &Joints, seconds: f64, stop: bool, source: Option<Source>) -> Result<(), TooMany> {
        if seconds <= 0.0 {
            return Ok(());
        }
        let count = self.options.interval.map_or(1.0, |t| libm::ceil(seconds / t - 1e-9)).clamp(1.0, 1e9) as usize;
        let from = self.here.joints;
        for k in 1..=count {
            let share = k as f64 / count as f64;
            let mut q = *to;
            if k < count {
                (0..self.solver.count).for_each(|i| q[i] = from[i] + (to[i] - from[i]) * share);
            }
            self.push(q, seconds / count as f64, true, stop && k == count, source)?;
        }
        Ok(())
    }

    fn path(&mut self, to: u32, arc: Option<ArcPiece>, speed: f64, zone: Zone, rapid: bool, source: Option<Source>) -> Result<(), TooMany> {
        let to = self.program.targets[to as usize];
        let turns = (turn_of(self.here.quaternion), turn_of(to.quaternion));
        let way = if arc.is_some() { Way::Arc(0) } else { Way::Line };
        self.g.arcs.clear();
        self.g.arcs.extend(arc);
        self.g.turns = vec![turns.0, turns.1];
        let m = Move {
            way,
            position: to.position,
            turn: u32::from(self.here.quaternion != to.quaternion),
            frame: self.frame,
            tool: self.tool,
            speed,
            zone,
            length: 0.0,
            rapid,
            free: false,
            ours: false,
            probe: None,
            source,
        };
        let path = Path::new(&self.g, &self.solver, &Frame { turn: turns.0, position: self.here.position }, &m);
        let mount = Mount::new(&self.g, &m, 0.0);
        let turned = turned_on_the_spot(&self.program.machine, &self.here.joints, &to.joints);
        let mut seconds = match path.length {
            l if l > ON_THE_SPOT => l / speed,
            _ if turned > 0.0 && !rapid => turned / speed,
            _ => self.joint_time(&self.here.joints, &to.joints),
        };
        if rapid {
            seconds = seconds.max(self.joint_time(&self.here.joints, &to.joints));
        }
        // Without a turn a mill's axes go as the tool does, and where only rotary axes turn the tool goes as they do.
        let mill = self.program.machine.kind == gr_machine::Kind::Mill;
        let straight = mill && arc.is_none() && (self.here.quaternion == to.quaternion || path.turns_alone());
        let looks = if straight { 1 } else { path.looks() };
        let looks = looks.max(self.options.interval.map_or(1, |t| libm::ceil(seconds / t - 1e-9).clamp(1.0, 1e9) as usize));
        let room = self.options.most.saturating_sub(self.points);
        // With an interval every look becomes a position: those that can't be kept aren't worked out.
        if self.options.interval.is_some() && looks > room {
            return Err(TooMany { most: self.options.most, source });
        }
        let tip = self.g.tools.get(usize::from(self.tool)).map_or(Frame::IDENTITY, |t| t.frame);
        let base = self.g.frames[usize::from(self.frame)].frame;
        let mut cut = Cut { solver: &self.solver, limits: &self.limits, path: &path, mount: &mount, tip, base, tolerance: self.program.curves.left(self.options.tolerance, source), room, found: Vec::new() };
        let follow = Follow { solver: &self.solver, limits: &self.limits, path: &path, mount: &mount };
        let mut all = Branches::NONE;
        let (mut q, mut branch) = (self.here.joints, self.here.branch);
        for k in 1..=looks {
            let (a, b) = ((k - 1) as f64 / looks as f64, k as f64 / looks as f64);
            if cut.found.len() > room {
                return Err(TooMany { most: self.options.most, source });
            }
            let next = if k == looks {
                (to.joints, to.branch)
            } else if self.solver.five_axis().is_some() {
                // Rotary axes go evenly, also one that the tool's direction leaves free.
                let mut guide = self.here.joints;
                (0..self.solver.count).for_each(|i| guide[i] += (to.joints[i] - guide[i]) * b);
                let mut r = self.solver.near(&mount.flange(&path.at(b)), &guide).unwrap_or(guide);
                unwrap(&mut r, &guide, &self.limits.turns, self.solver.count);
                (r, to.branch)
            } else {
                // Not out of reach: the plan has been here.
                let _ = self.solver.all(&mount.flange(&path.at(b)), &mut all);
                follow.step(&all, (&q, branch), (a, b)).unwrap_or((q, branch))
            };
            cut.between((a, &q, branch), (b, &next.0, next.1), 24);
            cut.found.push((b, next.0));
            (q, branch) = next;
        }
        let found = cut.merged(self.here.joints, self.options.interval.is_some());
        let mut last = 0.0;
        for (share, joints) in found {
            let stop = share >= 1.0 && zone == Zone::Stop;
            let even = seconds * (share - last);
            // A rapid takes its time where a joint would be too fast.
            let slower = if rapid { self.joint_time(&self.here.joints, &joints) } else { 0.0 };
            if slower > even {
                self.even(&joints, slower, stop, source)?;
            } else {
                self.push(joints, even, rapid, stop, source)?;
            }
            self.here.joints = joints;
            last = share;
        }
        self.here = to;
        Ok(())
    }
}

struct Cut<'a> {
    solver: &'a Solver,
    limits: &'a Limits,
    path: &'a Path,
    mount: &'a Mount,
    tip: Frame,
    base: Frame,
    tolerance: f64,
    /// Positions there is room for.
    room: usize,
    found: Vec<(f64, Joints)>,
}

impl Cut<'_> {
    /// Joint values between two others, in the configuration of one of them.
    fn solve(&self, share: f64, (p, q): (&Joints, &Joints), pair: [u8; 2]) -> (Joints, u8) {
        let flange = self.mount.flange(&self.path.at(share));
        let mut guide = *p;
        (0..self.solver.count).for_each(|i| guide[i] = (p[i] + q[i]) / 2.0);
        if self.solver.searches() {
            let mut r = self.solver.near(&flange, &guide).unwrap_or(guide);
            unwrap(&mut r, &guide, &self.limits.turns, self.solver.count);
            return (r, pair[0]);
        }
        let mut all = Branches::NONE;
        let reached = self.solver.all(&flange, &mut all).is_ok();
        let meets = all.good.trailing_zeros() as u8 & 7;
        let pair = if pair.iter().any(|b| all.has(*b)) { pair } else { [meets; 2] };
        let near = if pair[0] == pair[1] { p } else { &guide };
        let found = if reached { nearer(self.solver, self.limits, &all, pair, near) } else { None };
        found.unwrap_or((guide, pair[0]))
    }

    /// Greatest distance of the tool point from its path between two positions.
    fn off(&self, a: f64, p: &Joints, b: f64, q: &Joints) -> f64 {
        let each = |part: f64| {
            let mut r = *p;
            (0..self.solver.count).for_each(|i| r[i] += (q[i] - p[i]) * part);
            let aim = self.base.apply(self.path.position(a + (b - a) * part));
            self.solver.forward(&r).map_or(f64::INFINITY, |f| norm(sub(f.then(&self.tip).position, aim)))
        };
        [0.25, 0.5, 0.75].into_iter().map(each).fold(0.0, f64::max)
    }

    /// Positions between two, so that the tolerance holds. Nine tenths of it, as it is looked at three places only.
    fn between(&mut self, (a, p, from): (f64, &Joints, u8), (b, q, to): (f64, &Joints, u8), left: u32) {
        if left == 0 || self.found.len() > self.room || self.off(a, p, b, q) <= 0.9 * self.tolerance {
            return;
        }
        let middle = (a + b) / 2.0;
        let (r, branch) = self.solve(middle, (p, q), [from, to]);
        self.between((a, p, from), (middle, &r, branch), left - 1);
        self.found.push((middle, r));
        self.between((middle, &r, branch), (b, q, to), left - 1);
    }

    /// Leaves out positions that the tolerance doesn't need; with an interval all are needed.
    fn merged(&mut self, start: Joints, all: bool) -> Vec<(f64, Joints)> {
        let found = std::mem::take(&mut self.found);
        if all || found.len() < 2 {
            return found;
        }
        let mut out: Vec<(f64, Joints)> = Vec::new();
        let (mut a, mut p) = (0.0, start);
        for pair in found.windows(2) {
            // From the last kept to the one after this: when that is near enough, this one isn't needed.
            let far = pair[1].0 - a > 0.5 + 1e-9;
            if far || self.off(a, &p, pair[1].0, &pair[1].1) > 0.9 * self.tolerance {
                out.push(pair[0]);
                (a, p) = pair[0];
            }
        }
        out.extend(found.last());
        out
    }
}

/// A text; where each of its lines comes from, none for lines of its own; and what can't be said.
pub type Written = (String, Vec<Option<Source>>, Vec<Diagnostic>);

/// LinuxCNC words of a machine driven in joint mode: G93, so that each line takes its time.
pub fn gcode(program: &RobotProgram, path: &JointPath, decimals: usize, sources: &dyn Sources) -> Written {
    let machine = &program.machine;
    let letters = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];
    let words: Vec<char> = machine.joints.iter().zip(letters).map(|(j, l)| j.word.unwrap_or(l)).collect();
    let head = format!("({}: joint positions of {}; degrees and mm, inverse time)\nG21 G90 G40 G49 G80\nG61\nG93\n", plain(&program.name), plain(&machine.id));
    let stands = machine.cell.external.iter().fold(String::new(), |text, e| text + &format!("({})\n", plain(&e.stands())));
    let head = head + &stands;
    let mill = machine.kind == gr_machine::Kind::Mill;
    let head = if mill { head + &begins(program, &words, decimals) } else { head };
    let from = vec![None; head.lines().count()];
    let mut out = Words { text: head, from, findings: Findings::new(sources), labels: 0 };
    let mut first = true;
    for event in &path.events {
        match event {
            Event::Point(p) => {
                let fast = mill && p.rapid;
                let line = String::from(if fast { "G0" } else { "G1" }) + &axis_words(machine, &p.joints, &words, decimals);
                if first && mill {
                } else if fast && p.seconds > 0.0 {
                    out.line(&line, p.source);
                } else if first {
                    // The machine stands at home already, or goes there in a second.
                    out.line(&format!("{line} F60"), p.source);
                } else if p.seconds > 0.0 {
                    out.line(&format!("{line} F{}", significant(60.0 / p.seconds)), p.source);
                }
                first = false;
            }
            Event::Do(i) => out.action(&program.steps[*i]),
        }
    }
    out.line("G94\nM2", None);
    (out.text, out.from, out.findings.take())
}

fn axis_words(machine: &gr_machine::Machine, joints: &Joints, words: &[char], decimals: usize) -> String {
    let mut out = String::new();
    for ((joint, value), word) in machine.joints.iter().zip(joints).zip(words) {
        let shown = if joint.kind == JointKind::Revolute { value.to_degrees() } else { *value };
        let _ = write!(out, " {word}{}", number(shown, decimals));
    }
    out
}

/// A mill is not sent home: its program goes on from there.
fn begins(program: &RobotProgram, words: &[char], decimals: usize) -> String {
    format!("(begins at{}, without offsets)\n", axis_words(&program.machine, &program.home.joints, words, decimals))
}

/// What is no motion, in the words of LinuxCNC.
struct Words<'a> {
    text: String,
    /// Of each line.
    from: Vec<Option<Source>>,
    findings: Findings<'a>,
    labels: u32,
}

impl Words<'_> {
    fn line(&mut self, text: &str, source: Option<Source>) {
        self.text += text;
        self.text.push('\n');
        self.from.extend(text.lines().map(|_| source));
    }

    fn action(&mut self, step: &Step) {
        let from = step.source;
        match &step.action {
            Action::Dwell(s) => self.line(&format!("G4 P{}", significant(*s)), from),
            Action::Pause { optional } => self.line(if *optional { "M1" } else { "M0" }, from),
            Action::ChangeTool { number, .. } => self.line(&format!("T{number} M6"), from),
            Action::Message(text) => self.line(&format!("(MSG, {})", plain(text).trim_start()), from),
            Action::Comment(text) => self.line(&format!("({})", plain(text)), from),
            Action::Signal { word, .. } => self.line(&word.to_string(), from),
            Action::WaitInput { name, on, timeout } => self.wait(name, *on, *timeout, step.source),
            // Points are written as such; tool and frame are in them, and the end stands at the end.
            Action::Joint { .. } | Action::Linear { .. } | Action::Arc { .. } | Action::Probe { .. } => {}
            Action::UseTool(_) | Action::UseFrame(_) | Action::End => {}
        }
    }

    /// M66 goes on after its time in any case: without a limit it is asked again, and too late is a stop.
    fn wait(&mut self, name: &str, on: bool, timeout: Option<f64>, source: Option<Source>) {
        let Some(index) = gr_machine::signal_number(name) else {
            return self.findings.once_each(code::ROBOT_INPUT_NAME, source, &[name.to_string()]);
        };
        self.labels += 1;
        let (n, level) = (self.labels, if on { 3 } else { 4 });
        let ask = |seconds: f64| format!("M66 P{index} L{level} Q{}", significant(seconds));
        match timeout {
            Some(s) => self.line(&format!("{}\no{n} if [#5399 LT 0]\n(MSG, input {index} did not come)\nM0\no{n} endif", ask(s.max(0.001))), source),
            None => self.line(&format!("o{n} do\n{}\no{n} while [#5399 LT 0]", ask(3600.0)), source),
        }
    }
}

fn plain(text: &str) -> String {
    text.replace(['(', ')', '\n', '\r'], " ")
}

/// Fixed decimals without needless zeros.
fn number(v: f64, decimals: usize) -> String {
    let text = format!("{v:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

/// Thirteen significant digits: times add up to a billionth.
fn significant(v: f64) -> String {
    let digits = libm::floor(libm::log10(v.abs().max(1e-300))) as i32;
    let decimals = usize::try_from((13 - digits).clamp(0, 20)).unwrap_or(0);
    number(v, decimals)
}

/// How tables are written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TableOptions {
    /// Decimals.
    pub decimals: usize,
    /// Decimal comma; columns are then parted by semicolons.
    pub comma: bool,
}

/// The tool point by time: s, X Y Z in mm, A B C in degrees, in the base.
pub fn cartesian_csv(path: &JointPath, options: TableOptions) -> String {
    let row = |p: &JointPoint| {
        let pose = gr_machine::Pose::from_frame(&p.tool);
        pose.position.into_iter().chain(pose.rotation.map(f64::to_degrees)).collect()
    };
    table(path, ["t", "X", "Y", "Z", "A", "B", "C"].map(String::from).to_vec(), options, row)
}

/// Joint values by time: s, degrees or mm.
pub fn joint_csv(program: &RobotProgram, path: &JointPath, options: TableOptions) -> String {
    let joints = &program.machine.joints;
    let head = std::iter::once("t".to_string()).chain(joints.iter().map(|j| j.name.replace([',', ';', '"', '\n'], " "))).collect();
    let shown = |(j, v): (&gr_machine::Joint, &f64)| if j.kind == JointKind::Revolute { v.to_degrees() } else { *v };
    table(path, head, options, |p| joints.iter().zip(&p.joints).map(shown).collect())
}

fn table(path: &JointPath, head: Vec<String>, options: TableOptions, row: impl Fn(&JointPoint) -> Vec<f64>) -> String {
    let between = if options.comma { ";" } else { "," };
    let cell = |text: String| if options.comma { text.replace('.', ",") } else { text };
    let mut out = head.join(between) + "\n";
    let mut time = 0.0;
    for event in &path.events {
        let Event::Point(p) = event else { continue };
        time += p.seconds;
        let cells = row(p).into_iter().map(|v| cell(number(v, options.decimals)));
        let all: Vec<String> = std::iter::once(cell(number(time, 9))).chain(cells).collect();
        out += &all.join(between);
        out.push('\n');
    }
    out
}
