//! Robot programs for tests, built with a robot's own kinematics.
#![allow(dead_code)]

use gr_ir::Source;
use gr_machine::math::{Frame, about, add, euler, norm, rotate, scale, sub};
use gr_machine::{JointKind, Machine, Signal, Spindle, ToolData, builtin};
use gr_robot::{Action, MAX_JOINTS, RobotProgram, Step, Target, Tool, WorkFrame, Zone};
use gr_text::FileId;
use gr_vendors::{Options, Output, read};

/// What a test program does next. Lengths in mm, angles in degrees, in the work frame.
#[derive(Clone, Debug)]
pub enum Move {
    /// To a place nearby, turned a little.
    Line { shift: [f64; 3], turn: [f64; 3], speed: f64, zone: Option<f64> },
    /// Round an arc: direction to the center, normal, radius, angle.
    Arc { to_center: [f64; 3], normal: [f64; 3], radius: f64, angle: f64, speed: f64, zone: Option<f64> },
    /// A helix of the same, climbing.
    Helix { radius: f64, angle: f64, rise: f64, speed: f64 },
    /// All joints by these angles, degrees.
    Joint { by: [f64; 6], share: f64 },
    /// A line until an input has a state.
    Probe { shift: [f64; 3], speed: f64, on: bool, must: bool },
    /// Another of the two frames.
    Frame(u16),
    /// Another of the two tools.
    Tool(u16),
    /// Anything else.
    Other(Action),
}

/// Builds a program and keeps where it is.
pub struct Builder {
    pub program: RobotProgram,
    here: Target,
    tool: usize,
    frame: usize,
    line: u32,
}

pub fn signal(name: &str) -> Signal {
    Signal { signal: Some(name.into()), ..Signal::default() }
}

/// A machine with a spindle and signals by number, as most controllers have them.
pub fn machine(id: &str) -> Machine {
    let mut m = builtin(id).unwrap();
    m.cell.spindle = Some(Spindle { frame: Frame::shift([0.0, 0.0, 120.0]), speed: (None, Some(24000.0)), controlled: true });
    let tool = ToolData { name: "mill10".into(), frame: Frame::shift([0.0, 0.0, 85.0]), diameter: Some(10.0), mass: Some(0.4) };
    m.cell.tools.insert(1, tool);
    m
}

impl Builder {
    /// Starts at home, in the first frame with the first tool.
    pub fn new(machine: Machine, home: &[f64]) -> Builder {
        let mut joints = [0.0; MAX_JOINTS];
        for (i, (slot, v)) in joints.iter_mut().zip(home).enumerate() {
            *slot = if machine.joints[i].kind == JointKind::Revolute { v.to_radians() } else { *v };
        }
        let scara = machine.joints.len() == 4;
        let tools = vec![
            Tool { number: 1, name: "mill10".into(), frame: Frame::shift([0.0, 0.0, if scara { 40.0 } else { 205.0 }]), mass: Some(3.5) },
            Tool {
                number: 7,
                name: "ball 6".into(),
                frame: if scara { Frame::shift([3.0, 0.0, 50.0]) } else { Frame::new([12.0, -5.0, 190.0], [0.0, 0.3, 0.0]) },
                mass: None,
            },
        ];
        let tilt = if scara { [0.0, 0.0, 0.4] } else { [0.02, -0.03, 0.4] };
        let n = machine.joints.len();
        let flange = machine.kinematics().forward_frame(&joints[..n]).unwrap();
        let near = add(flange.position, [40.0, -60.0, -150.0]);
        let frames = vec![
            WorkFrame { name: "G54".into(), frame: Frame::new(near, [0.0, 0.0, 0.0]) },
            WorkFrame { name: "G55".into(), frame: Frame::new(add(near, [10.0, 20.0, -5.0]), tilt) },
        ];
        let home = Target { position: [0.0; 3], quaternion: [1.0, 0.0, 0.0, 0.0], joints, branch: branch(&machine, &joints) };
        let program = RobotProgram { name: "part one".into(), machine, tools, frames, targets: Vec::new(), home, steps: Vec::new(), curves: gr_robot::Curves::default() };
        let mut b = Builder { program, here: home, tool: 0, frame: 0, line: 0 };
        b.step(Action::UseTool(0));
        b.step(Action::UseFrame(0));
        b.here = b.seen(&joints);
        b
    }

    fn step(&mut self, action: Action) {
        let source = Source { file: FileId(0), line: self.line, ..Source::default() };
        self.line += 1;
        self.program.steps.push(Step { action, source: Some(source) });
    }

    fn work(&self) -> (Frame, Frame) {
        (self.program.frames[self.frame].frame, self.program.tools[self.tool].frame)
    }

    /// Where the tool is, in the frame in use, with these joints.
    fn seen(&self, joints: &[f64; MAX_JOINTS]) -> Target {
        let n = self.program.machine.joints.len();
        let (frame, tool) = self.work();
        let flange = self.program.machine.kinematics().forward_frame(&joints[..n]).unwrap();
        let pose = frame.inverse().then(&flange.then(&tool));
        Target { position: pose.position, quaternion: quaternion(&pose.turn), joints: *joints, branch: branch(&self.program.machine, joints) }
    }

    /// Joint values of a pose in the frame in use, in the configuration of the point before.
    fn solve(&self, pose: &Frame) -> Option<Target> {
        let (frame, tool) = self.work();
        let m = &self.program.machine;
        let all = m.kinematics().inverse_frame(&frame.then(pose).then(&tool.inverse())).ok()?;
        let s = all.into_iter().find(|s| s.branch == self.here.branch && !s.singular)?;
        let mut joints = [0.0; MAX_JOINTS];
        for (i, v) in s.joints.iter().enumerate() {
            let turn = std::f64::consts::TAU;
            let turns = if m.joints[i].kind == JointKind::Revolute { ((self.here.joints[i] - v) / turn).round() } else { 0.0 };
            joints[i] = v + turns * turn;
            if (joints[i] - self.here.joints[i]).abs() > 1.0 && m.joints[i].kind == JointKind::Revolute {
                return None;
            }
        }
        // Far enough from where the arm stretches or two wrist axes meet: there joint values say little.
        if s.joints.len() == 6 && joints[4].sin().abs() < 0.1 {
            return None;
        }
        m.outside(&s.joints.iter().zip(&joints).map(|(_, j)| *j).collect::<Vec<_>>()).is_empty().then_some(())?;
        let t = Target { position: pose.position, quaternion: quaternion(&pose.turn), joints, branch: s.branch };
        self.steady(&t).then_some(t)
    }

    /// Far enough from where a hundredth of a millimeter turns a joint by a hundredth of a degree.
    fn steady(&self, t: &Target) -> bool {
        let (frame, tool) = self.work();
        let m = &self.program.machine;
        (0..3).all(|axis| {
            let mut pose = Frame { turn: turn_of(&t.quaternion), position: t.position };
            pose.position[axis] += 0.01;
            let all = m.kinematics().inverse_frame(&frame.then(&pose).then(&tool.inverse())).unwrap_or_default();
            let Some(s) = all.iter().find(|s| s.branch == t.branch) else { return false };
            let off = |(a, b): (&f64, &f64)| (a - b) - std::f64::consts::TAU * ((a - b) / std::f64::consts::TAU).round();
            s.joints.iter().zip(&t.joints).enumerate().all(|(i, p)| m.joints[i].kind == JointKind::Prismatic || off(p).abs() < 1e-4)
        })
    }

    fn push(&mut self, t: Target) -> u32 {
        self.program.targets.push(t);
        self.here = t;
        self.program.targets.len() as u32 - 1
    }

    fn pose(&self) -> Frame {
        Frame { turn: turn_of(&self.here.quaternion), position: self.here.position }
    }

    /// Adds a move; false = the robot can't do it, and nothing was added.
    pub fn add(&mut self, m: &Move) -> bool {
        match m {
            // A line of no length at the end of an arc is how INFORM parts arcs.
            Move::Line { shift, .. } if norm(*shift) < 0.01 => return false,
            Move::Line { shift, turn, speed, zone } => {
                let here = self.pose();
                let turned = if self.program.machine.joints.len() == 4 { [0.0, 0.0, turn[2]] } else { *turn };
                let tilt = Frame::turned(euler(turned.map(f64::to_radians)));
                let aim = Frame { turn: tilt.then(&Frame::turned(here.turn)).turn, position: add(here.position, *shift) };
                let Some(t) = self.solve(&aim) else { return false };
                let to = self.push(t);
                self.step(Action::Linear { to, speed: *speed, zone: zone_of(*zone), rapid: false });
            }
            Move::Arc { to_center, normal, radius, angle, speed, zone } => {
                let normal = unit(*normal);
                let spoke = unit(sub(*to_center, scale(normal, gr_machine::math::dot(*to_center, normal))));
                let center = add(self.here.position, scale(spoke, *radius));
                let (here, angle) = (self.pose(), angle.to_radians());
                let at = |share: f64| add(center, rotate(&about(normal, angle * share), scale(spoke, -radius)));
                let (Some(via), Some(to)) =
                    (self.solve(&Frame { position: at(0.5), ..here }), self.solve(&Frame { position: at(1.0), ..here }))
                else {
                    return false;
                };
                let (via, to) = (self.push(via), self.push(to));
                self.step(Action::Arc { via, to, center, normal, angle, speed: *speed, zone: zone_of(*zone) });
            }
            Move::Helix { radius, angle, rise, speed } => {
                let (center, normal, here) = (add(self.here.position, [*radius, 0.0, 0.0]), [0.0, 0.0, 1.0], self.pose());
                let angle = angle.to_radians();
                let at = |share: f64| {
                    let around = rotate(&about(normal, angle * share), [-radius, 0.0, 0.0]);
                    add(add(center, around), [0.0, 0.0, rise * share])
                };
                let (Some(via), Some(to)) =
                    (self.solve(&Frame { position: at(0.5), ..here }), self.solve(&Frame { position: at(1.0), ..here }))
                else {
                    return false;
                };
                let (via, to) = (self.push(via), self.push(to));
                self.step(Action::Arc { via, to, center, normal, angle, speed: *speed, zone: Zone::Stop });
            }
            Move::Joint { by, share } => {
                let mut joints = self.here.joints;
                let n = self.program.machine.joints.len();
                for i in 0..n {
                    let sort = self.program.machine.joints[i].kind;
                    joints[i] += if sort == JointKind::Revolute { by[i].to_radians() } else { by[i] };
                }
                let t = self.seen(&joints);
                if !self.program.machine.outside(&joints[..n]).is_empty() || (n == 6 && joints[4].sin().abs() < 0.1) || t.branch == 255 || !self.steady(&t) {
                    return false;
                }
                let to = self.push(t);
                self.step(Action::Joint { to, speed: *share, zone: Zone::Stop });
            }
            Move::Probe { shift, speed, on, must } => {
                let here = self.pose();
                let Some(t) = self.solve(&Frame { position: add(here.position, *shift), ..here }) else { return false };
                let to = self.push(t);
                self.step(Action::Probe { to, speed: *speed, input: "di_3".into(), on: *on, must: *must });
            }
            Move::Frame(i) => {
                self.frame = usize::from(*i);
                self.here = self.seen(&self.here.joints.clone());
                self.step(Action::UseFrame(*i));
            }
            Move::Tool(i) => {
                self.tool = usize::from(*i);
                self.here = self.seen(&self.here.joints.clone());
                self.step(Action::UseTool(*i));
            }
            Move::Other(action) => self.step(action.clone()),
        }
        true
    }
}

fn zone_of(zone: Option<f64>) -> Zone {
    zone.map_or(Zone::Stop, Zone::Blend)
}

pub fn unit(v: [f64; 3]) -> [f64; 3] {
    scale(v, 1.0 / norm(v))
}

/// The branch of joint values: the solution that leads back to them.
fn branch(machine: &Machine, joints: &[f64; MAX_JOINTS]) -> u8 {
    let n = machine.joints.len();
    let k = machine.kinematics();
    let near = |v: &[f64]| {
        let off = |(a, b): (&f64, &f64)| {
            let d = (a - b).rem_euclid(std::f64::consts::TAU);
            d.min(std::f64::consts::TAU - d)
        };
        v.iter().zip(joints).map(off).fold(0.0, f64::max) < 1e-6
    };
    let all = k.inverse_frame(&k.forward_frame(&joints[..n]).unwrap()).unwrap_or_default();
    all.iter().find(|s| near(&s.joints)).map_or(255, |s| s.branch)
}

pub fn turn_of(q: &[f64; 4]) -> gr_machine::math::M3 {
    let v = [q[1], q[2], q[3]];
    let l = norm(v);
    if l < 1e-15 { Frame::IDENTITY.turn } else { about(scale(v, 1.0 / l), 2.0 * l.atan2(q[0])) }
}

/// Unit quaternion, scalar first and not negative: the largest part first, the others from it.
pub fn quaternion(m: &gr_machine::math::M3) -> [f64; 4] {
    let d = [m[0][0], m[1][1], m[2][2]];
    let signs = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let size = |k: usize| 1.0 + (0..3).map(|i| signs[k][i] * d[i]).sum::<f64>();
    let k = (0..4).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap();
    let s = 2.0 * size(k).sqrt();
    let (x, y, z) = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
    let (xy, xz, yz) = (m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]);
    let q = [[s * s / 4.0, x, y, z], [x, s * s / 4.0, xy, xz], [y, xy, s * s / 4.0, yz], [z, xz, yz, s * s / 4.0]][k].map(|v| v / s);
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt() * if q[0] < 0.0 { -1.0 } else { 1.0 };
    q.map(|v| v / length)
}

/// Emits with everything allowed.
pub fn emit(target: &str, program: &RobotProgram) -> Output {
    let options = Options { allow_unverified: true, ..Options::default() };
    gr_vendors::language(target).unwrap().emit(program, &gr_ir::NoSources, &options)
}

/// The files as text.
pub fn texts(output: &Output) -> Vec<read::File> {
    output.files.iter().map(|f| (f.name.clone(), String::from_utf8(f.bytes.clone()).unwrap())).collect()
}

/// A realistic program: lines, arcs, dwell, spindle, tool change, two frames.
pub fn realistic(id: &str, home: &[f64], names: [&str; 4]) -> RobotProgram {
    let [spindle, speed, ready, coolant] = names;
    let mut b = Builder::new(machine(id), home);
    let signal = |word: &str, value: Option<f64>, signal: Signal| Move::Other(Action::Signal { word: word.into(), value, signal });
    let line = |shift: [f64; 3], speed: f64, zone: Option<f64>| Move::Line { shift, turn: [0.0; 3], speed, zone };
    let flat = |to_center: [f64; 3], angle: f64, zone: Option<f64>| Move::Arc { to_center, normal: [0.0, 0.0, 1.0], radius: 10.0, angle, speed: 1000.0 / 60.0, zone };
    let f = 1000.0 / 60.0;
    let moves = [
        Move::Other(Action::Comment("pocket".into())),
        Move::Joint { by: [5.0, 4.0, -3.0, 2.0, 4.0, 3.0], share: 0.2 },
        signal("S", Some(12000.0), Signal { signal: Some(speed.into()), ..Signal::default() }),
        signal("M3", None, Signal { signal: Some(spindle.into()), wait: Some(ready.into()), ..Signal::default() }),
        signal("M8", None, Signal { signal: Some(coolant.into()), ..Signal::default() }),
        line([0.0, 0.0, -20.0], 50.0, None),
        line([40.0, 0.0, 0.0], f, Some(0.2)),
        flat([0.0, 10.0, 0.0], 90.0, Some(0.2)),
        flat([-10.0, 0.0, 0.0], 90.0, Some(0.2)),
        line([-40.0, 0.0, 0.0], f, None),
        Move::Other(Action::Dwell(0.5)),
        line([0.0, 0.0, 30.0], 100.0, None),
        signal("M5", None, Signal { signal: Some(spindle.into()), value: Some(0.0), ..Signal::default() }),
        Move::Other(Action::ChangeTool { number: 7, by: Some(Signal { routine: Some("toolchange".into()), ..Signal::default() }) }),
        Move::Tool(1),
        Move::Frame(1),
        line([-5.0, 2.0, -10.0], 12.5, None),
        Move::Arc { to_center: [0.0, -1.0, 0.0], normal: [0.0, 0.0, -1.0], radius: 8.0, angle: 180.0, speed: 12.5, zone: None },
        Move::Other(Action::End),
    ];
    for m in moves {
        assert!(b.add(&m), "{id}: {m:?}");
    }
    b.program
}

/// The robot of each language, a home position, and names of spindle, speed, ready and coolant signals.
pub fn robot_of(target: &str) -> (&'static str, &'static [f64], [&'static str; 4]) {
    let numbered = ["DO[5]", "AO[1]", "DI[3]", "DO[8]"];
    match target {
        "rapid" => ("abb/irb2400", &[10.0, 20.0, 15.0, 20.0, 50.0, -30.0], ["doSpindle", "aoSpeed", "diReady", "doCoolant"]),
        "krl" => ("kuka/kr16-2", &[10.0, -80.0, 85.0, 20.0, 60.0, -30.0], numbered),
        "fanuc-ls" => ("fanuc/m-20ia", &[10.0, 10.0, -10.0, 20.0, -60.0, 30.0], numbered),
        "urscript" => ("universal-robots/ur5", &[10.0, -80.0, 100.0, -100.0, -80.0, 20.0], numbered),
        "inform" => ("yaskawa/gp25", &[10.0, 10.0, -10.0, 20.0, -60.0, 30.0], numbered),
        "val3" => ("staubli/tx90", &[10.0, 20.0, 70.0, 20.0, 50.0, 30.0], ["BasicIO-1\\%Q0", "BasicIO-1\\%AO0", "BasicIO-1\\%I0", "BasicIO-1\\%Q1"]),
        "delmia-xml" => ("abb/irb140", &[10.0, 20.0, 5.0, 20.0, 50.0, -30.0], numbered),
        "vplus" => ("adept/one", &[20.0, 60.0, 60.0, 10.0], numbered),
        "kawasaki-as" => ("kawasaki/rs020n", &[10.0, 20.0, -80.0, 20.0, -50.0, 30.0], numbered),
        _ => ("abb/irb140", &[10.0, 20.0, 5.0, 20.0, 50.0, -30.0], numbered),
    }
}

pub const TARGETS: [&str; 14] = [
    "rapid", "krl", "fanuc-ls", "urscript", "inform", "val3", "delmia-xml", "vplus", "kawasaki-as", "pdl2", "denso-pac", "melfa", "spel", "nachi",
];

/// Languages in which the realistic program's analog output has no form: it calls a routine there.
pub const NO_ANALOG: [&str; 5] = ["kawasaki-as", "denso-pac", "melfa", "spel", "nachi"];

/// The realistic program of a language.
pub fn sample(target: &str) -> RobotProgram {
    let (id, home, names) = robot_of(target);
    let mut program = realistic(id, home, names);
    for step in &mut program.steps {
        if NO_ANALOG.contains(&target) && matches!(&step.action, Action::Signal { word, .. } if word.code == "S") {
            step.action = Action::Comment("S12000".into());
        }
        // Their routines take no number.
        if let Action::ChangeTool { by, .. } = &mut step.action {
            match target {
                "nachi" => *by = None,
                "delmia-xml" => *by = Some(signal("GO[1]")),
                _ => {}
            }
        }
    }
    program
}
