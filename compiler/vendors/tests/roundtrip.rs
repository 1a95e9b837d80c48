//! Emit, read, and compare with the program: poses through the configuration data and forward kinematics, arcs by
//! their geometry, speeds, zones, signals; for every language, over random programs and robots.

mod common;
use common::*;
use gr_machine::math::{Frame, add, cross, dot, norm, scale, sub};
use gr_machine::{Chain, Machine};
use gr_robot::{Action, RobotProgram, Target, Zone};
use gr_vendors::read::{self, Event, Place};
use proptest::prelude::*;

/// How exactly a language says things: tool position mm, joint degrees, speed mm/s.
struct Budget {
    position: f64,
    joint: f64,
    speed: f64,
    /// Zones come back as a distance.
    zones: bool,
}

fn budget(target: &str) -> Budget {
    let exact = Budget { position: 0.0025, joint: 0.003, speed: 1e-5, zones: true };
    match target {
        // Frames with 0.001 mm and 0.001°, a third of a meter away; half a tenth of an inch per minute.
        "fanuc-ls" => Budget { position: 0.012, joint: 0.05, speed: 0.0213, zones: false },
        "inform" => Budget { speed: 0.0501, zones: false, ..exact },
        "nachi" => Budget { speed: 0.00501, zones: false, ..exact },
        "vplus" | "spel" => Budget { zones: false, ..exact },
        _ => exact,
    }
}

/// Walks the events of a file beside the steps of the program.
struct Compare<'p> {
    target: &'p str,
    program: &'p RobotProgram,
    budget: Budget,
    events: std::iter::Peekable<std::vec::IntoIter<Event>>,
    joints: Vec<f64>,
    tool: Frame,
    frame: Frame,
    /// The tool in the base: as the file has it.
    here: [f64; 3],
}

type Check = Result<(), String>;

impl Compare<'_> {
    fn machine(&self) -> &Machine {
        &self.program.machine
    }

    fn next(&mut self) -> Result<Event, String> {
        self.events.next().ok_or_else(|| "the file ends too soon".to_string())
    }

    /// Follows a place and says where the tool comes to in the base.
    fn go(&mut self, place: &Place) -> Result<[f64; 3], String> {
        let mut place = place.clone();
        // Their world lies at the height of the second axis.
        let raised = matches!(self.target, "fanuc-ls" | "val3");
        if let (true, Chain::Opw(arm), Some(frame)) = (raised, &self.program.machine.chain, &mut place.frame) {
            frame.position[2] += arm.lengths()[3];
        }
        let joints = place.resolve(self.machine(), &self.joints, &self.tool, &self.frame).ok_or(format!("{place:?} is not reached"))?;
        let flange = self.machine().kinematics().forward_frame(&joints).map_err(|e| e.to_string())?;
        self.joints = joints;
        self.here = flange.then(&place.tool.unwrap_or(self.tool)).position;
        Ok(self.here)
    }

    fn arrives(&mut self, place: &Place, aim: &Target) -> Check {
        let at = self.go(place)?;
        let n = self.machine().joints.len();
        for i in 0..n {
            let revolute = self.machine().joints[i].kind == gr_machine::JointKind::Revolute;
            let off = (self.joints[i] - aim.joints[i]).abs();
            let off = if revolute { off.to_degrees() } else { off };
            if off > self.budget.joint.max(0.0) {
                return Err(format!("joint {}: {} instead of {} ({place:?})", i + 1, self.joints[i].to_degrees(), aim.joints[i].to_degrees()));
            }
        }
        let wanted = self.frame.apply(aim.position);
        let off = norm(sub(at, wanted));
        // Six joints of 0.001° steps on an arm of 3 m.
        let room = if self.target == "fanuc-ls" && place.joints.is_some() { 0.1 } else { self.budget.position };
        if off > room {
            return Err(format!("{off} mm off: {place:?} for {aim:?}"));
        }
        Ok(())
    }

    fn speed(&self, written: f64, wanted: f64) -> Check {
        let room = self.budget.speed.max(wanted * 1e-6);
        if (written - wanted).abs() <= room { Ok(()) } else { Err(format!("speed {written} for {wanted}")) }
    }

    fn zone(&self, written: Option<f64>, wanted: Zone) -> Check {
        let most = if let Zone::Blend(r) = wanted { r } else { 0.0 };
        let written = written.unwrap_or(0.0);
        let full = !self.budget.zones || self.target == "urscript" || most < 0.01 || written >= 0.9 * most;
        if written <= most + 1e-9 && full { Ok(()) } else { Err(format!("zone {written} for {wanted:?}")) }
    }

    fn step(&mut self, action: &Action, from: Option<Target>) -> Check {
        match action {
            Action::Joint { to, .. } => match self.next()? {
                Event::Joint(place) => self.arrives(&place, &self.program.targets[*to as usize]),
                other => Err(format!("{other:?} for a joint move")),
            },
            Action::Linear { to, speed, zone, .. } => match self.next()? {
                Event::Linear(place, v, z) => {
                    self.speed(v, *speed)?;
                    self.zone(z, *zone)?;
                    self.arrives(&place, &self.program.targets[*to as usize])
                }
                other => Err(format!("{other:?} for a line")),
            },
            Action::Probe { to, speed, input, on, must } => match self.next()? {
                Event::Probe(place, v, i, o, m) if (o, m) == (*on, *must) && input.ends_with(&i) => {
                    self.speed(v, *speed)?;
                    self.arrives(&place, &self.program.targets[*to as usize])
                }
                other => Err(format!("{other:?} for a probe move")),
            },
            Action::Arc { via, to, center, normal, angle, speed, zone } => {
                let (via, to) = (self.program.targets[*via as usize], self.program.targets[*to as usize]);
                let from = from.ok_or("an arc from nowhere")?;
                // After a change of frame the reader can't tell that the arc's first point is where the tool is.
                if let ("inform", Some(Event::Linear(place, ..))) = (self.target, self.events.peek()) {
                    let (place, before) = (place.clone(), self.joints.clone());
                    let flange = self.machine().kinematics().forward_frame(&before).map_err(|e| e.to_string())?;
                    let was = flange.then(&self.tool).position;
                    if norm(sub(self.go(&place)?, was)) < self.budget.position {
                        self.events.next();
                    }
                    self.joints = before;
                }
                if matches!(self.events.peek(), Some(Event::Arc(..))) {
                    let Event::Arc(v, t, written, z) = self.next()? else { return Err("no arc".into()) };
                    let flange = self.machine().kinematics().forward_frame(&self.joints).map_err(|e| e.to_string())?;
                    let start = flange.then(&v.tool.unwrap_or(self.tool)).position;
                    self.speed(written, *speed)?;
                    self.zone(z, *zone)?;
                    self.arrives(&v, &via)?;
                    let middle = self.here;
                    self.arrives(&t, &to)?;
                    self.circle(start, middle, self.here, *center, *normal, *angle)
                } else {
                    self.pieces(&from, &to, *center, *normal, *angle, *speed)
                }
            }
            Action::Signal { signal, value, word } => {
                if let Some(name) = &signal.signal {
                    let Event::Set(got, v) = self.next()? else { return Err("no output".into()) };
                    let digits: String = name.chars().filter(char::is_ascii_digit).collect();
                    if got != *name && got != digits {
                        return Err(format!("{got} for {name}"));
                    }
                    let wanted = if word.code == "S" { *value } else { signal.value }.unwrap_or(1.0);
                    let scaled = if word.code == "S" { wanted / 24000.0 } else { wanted };
                    if ![wanted, scaled, 10.0 * scaled].iter().any(|w| (w - v).abs() < 0.006) {
                        return Err(format!("{got} becomes {v}, not {wanted}"));
                    }
                }
                if signal.wait.is_some() && !matches!(self.next()?, Event::Wait(_, true)) {
                    return Err("no wait".into());
                }
                Ok(())
            }
            // The operator is asked.
            Action::ChangeTool { by: None, .. } => Ok(()),
            Action::ChangeTool { .. } => match self.next()? {
                Event::Call(..) | Event::Set(..) => Ok(()),
                other => Err(format!("{other:?} for a tool change")),
            },
            Action::Dwell(s) => match self.next()? {
                Event::Dwell(got) if (got - s).abs() < 0.006 => Ok(()),
                other => Err(format!("{other:?} for a dwell of {s}")),
            },
            Action::UseTool(i) => {
                self.tool = self.program.tools[usize::from(*i)].frame;
                Ok(())
            }
            Action::UseFrame(i) => {
                self.frame = self.program.frames[usize::from(*i)].frame;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The circle through three points is the one of the program.
    fn circle(&self, a: [f64; 3], b: [f64; 3], c: [f64; 3], center: [f64; 3], normal: [f64; 3], angle: f64) -> Check {
        let (center, normal) = (self.frame.apply(center), gr_machine::math::rotate(&self.frame.turn, normal));
        let (u, v) = (sub(b, a), sub(c, a));
        let n = cross(u, v);
        let found = add(a, scale(add(scale(cross(n, u), dot(v, v)), scale(cross(v, n), dot(u, u))), 1.0 / (2.0 * dot(n, n))));
        let radius = norm(sub(a, center));
        let got = norm(sub(a, found));
        let n = unit(n);
        let turned = {
            let (p, q) = (sub(a, found), sub(c, found));
            let t = dot(n, cross(p, q)).atan2(dot(p, q));
            if t <= 0.0 { t + std::f64::consts::TAU } else { t }
        };
        // Rounding of the points is magnified as the arc is flat.
        let sag = radius * (1.0 - (angle / 2.0).cos());
        let room = self.budget.position * (4.0 + 8.0 * radius / sag.max(1e-6)) + 0.001;
        let flat = dot(n, normal) > 1.0 - 0.05_f64.max(self.budget.position / sag);
        if norm(sub(found, center)) > room || (got - radius).abs() > room || !flat || (turned - angle).abs() * radius > room {
            return Err(format!("circle {found:?} {got} {turned} for {center:?} {radius} {angle} (room {room})"));
        }
        Ok(())
    }

    /// Straight pieces stay near the arc (or helix) and end where it ends.
    fn pieces(&mut self, from: &Target, to: &Target, center: [f64; 3], normal: [f64; 3], angle: f64, speed: f64) -> Check {
        let spoke = sub(from.position, center);
        let (radius, rise) = (norm(spoke), dot(sub(to.position, from.position), normal));
        let distance = |p: [f64; 3]| {
            let r = sub(p, center);
            let up = dot(r, normal);
            let flat = sub(r, scale(normal, up));
            let turned = dot(normal, cross(spoke, flat)).atan2(dot(spoke, flat));
            let turned = if turned < -0.2 { turned + std::f64::consts::TAU } else { turned };
            let off = norm(flat) - radius;
            let climb = up - rise * (turned / angle).clamp(0.0, 1.0);
            (off * off + climb * climb).sqrt()
        };
        let mut before = from.position;
        for _ in 0..20_000 {
            let Event::Linear(place, v, _) = self.next()? else { return Err("not a straight piece".into()) };
            self.speed(v, speed)?;
            let at = self.go(&place)?;
            let seen = self.frame.inverse().apply(at);
            for k in 0..=4 {
                let share = f64::from(k) / 4.0;
                let p = add(scale(before, 1.0 - share), scale(seen, share));
                if distance(p) > 0.0105 + self.budget.position {
                    return Err(format!("{} mm from the arc", distance(p)));
                }
            }
            before = seen;
            if norm(sub(seen, to.position)) <= self.budget.position {
                return Ok(());
            }
        }
        Err("too many pieces".into())
    }
}

fn compare(target: &str, program: &RobotProgram) -> Check {
    let output = emit(target, program);
    if output.files.is_empty() {
        return Err(format!("{:?}", output.findings));
    }
    let events = read::read(target, &texts(&output))?;
    let n = program.machine.joints.len();
    let mut c = Compare {
        target,
        program,
        budget: budget(target),
        events: events.into_iter().peekable(),
        joints: program.home.joints[..n].to_vec(),
        tool: program.tools[0].frame,
        frame: program.frames[0].frame,
        here: [0.0; 3],
    };
    let home = c.next()?;
    let Event::Joint(place) = &home else { return Err(format!("{home:?} for home")) };
    c.go(place)?;
    let off = c.joints.iter().zip(&program.home.joints).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    if off.to_degrees() > c.budget.joint.max(0.001) {
        return Err(format!("home is {:?}", c.joints));
    }
    let mut from = Some(program.home);
    for (i, step) in program.steps.iter().enumerate() {
        c.step(&step.action, from).map_err(|e| format!("step {i} {:?}: {e}", step.action))?;
        if let Action::Joint { to, .. } | Action::Linear { to, .. } | Action::Arc { to, .. } | Action::Probe { to, .. } = &step.action {
            from = Some(program.targets[*to as usize]);
        }
        // Targets stand in their frame.
        if let Action::UseFrame(_) | Action::UseTool(_) = &step.action
            && let Some(t) = &mut from
        {
            let flange = program.machine.kinematics().forward_frame(&t.joints[..n]).map_err(|e| e.to_string())?;
            t.position = c.frame.inverse().then(&flange.then(&c.tool)).position;
        }
    }
    match c.events.next() {
        None => Ok(()),
        Some(more) => Err(format!("more than the program: {more:?}")),
    }
}

/// Robots a language is tried on, with a home position each.
fn robots(target: &str) -> Vec<(&'static str, &'static [f64])> {
    let (id, home, _) = robot_of(target);
    let mut all = vec![(id, home)];
    match target {
        "rapid" => all.extend([
            ("abb/irb140", &[-100.0, 10.0, 5.0, 130.0, -50.0, 200.0][..]),
            ("abb/irb4600-40-255", &[95.0, 20.0, 15.0, -100.0, 60.0, -200.0][..]),
        ]),
        "krl" => all.extend([
            ("kuka/kr6-r900", &[-40.0, -100.0, 110.0, -150.0, -60.0, 170.0][..]),
            ("kuka/kr120-r2500", &[30.0, -60.0, 80.0, 200.0, 60.0, -200.0][..]),
        ]),
        "fanuc-ls" => all.extend([
            ("fanuc/lr-mate-200id", &[30.0, 20.0, 10.0, -20.0, 60.0, 100.0][..]),
            ("fanuc/r-2000ic-165f", &[-30.0, 10.0, -20.0, 100.0, -60.0, -200.0][..]),
        ]),
        "inform" => all.extend([("yaskawa/gp8", &[-30.0, 10.0, 20.0, 110.0, 60.0, -150.0][..])]),
        "val3" => all.extend([("staubli/tx60l", &[-30.0, 20.0, 80.0, -100.0, -50.0, 30.0][..])]),
        "urscript" => all.extend([("universal-robots/ur10e", &[-40.0, -70.0, 90.0, -110.0, 80.0, 300.0][..])]),
        _ => {}
    }
    all
}

fn moves() -> impl Strategy<Value = Vec<Move>> {
    let shift = prop::array::uniform3(-40.0f64..40.0);
    let small = prop::array::uniform3(-6.0f64..6.0);
    let none = Just([0.0; 3]);
    let zone = prop_oneof![Just(None), (0.01f64..1.0).prop_map(Some)];
    let speed = prop_oneof![2.0f64..300.0, Just(1000.0 / 60.0), Just(50.0), Just(100.0 / 6.0)];
    let line = (shift, prop_oneof![none, small], speed.clone(), zone.clone())
        .prop_map(|(shift, turn, speed, zone)| Move::Line { shift, turn, speed, zone });
    let arc = (prop::array::uniform3(-1.0f64..1.0), prop::array::uniform3(-1.0f64..1.0), 0.5f64..60.0, 8.0f64..180.0, speed.clone(), zone)
        .prop_filter("a plane", |(a, b, ..)| norm(cross(*a, *b)) > 0.1)
        .prop_map(|(to_center, normal, radius, angle, speed, zone)| Move::Arc { to_center, normal, radius, angle, speed, zone });
    let helix = (2.0f64..10.0, 30.0f64..180.0, 0.5f64..4.0, speed).prop_map(|(radius, angle, rise, speed)| Move::Helix { radius, angle, rise, speed });
    let joint = (prop::array::uniform6(-12.0f64..12.0), 0.05f64..1.0).prop_map(|(by, share)| Move::Joint { by, share });
    let probe = (prop::array::uniform3(-30.0f64..30.0), 2.0f64..50.0, any::<bool>(), any::<bool>())
        .prop_map(|(shift, speed, on, must)| Move::Probe { shift, speed, on, must });
    let other = prop_oneof![
        Just(Move::Other(Action::Signal { word: "M3".into(), value: None, signal: signal("DO[5]") })),
        Just(Move::Other(Action::Signal {
            word: "M5".into(),
            value: None,
            signal: gr_machine::Signal { value: Some(0.0), ..signal("DO[5]") }
        })),
        (1u32..100).prop_map(|n| Move::Other(Action::Dwell(f64::from(n) / 100.0))),
        Just(Move::Other(Action::Comment("a remark; with (marks)".into()))),
        Just(Move::Other(Action::Message("tool \"mill\"".into()))),
    ];
    let one = prop_oneof![
        6 => line, 1 => probe, 4 => arc, 1 => helix, 3 => joint, 1 => (0u16..2).prop_map(Move::Frame), 1 => (0u16..2).prop_map(Move::Tool), 2 => other
    ];
    prop::collection::vec(one, 1..40)
}

fn program(target: &str, robot: usize, moves: &[Move], lines: Option<u64>) -> RobotProgram {
    let all = robots(target);
    let (id, home) = all[robot % all.len()];
    let mut m = machine(id);
    m.cell.controller.lines = lines;
    let mut b = Builder::new(m, home);
    for m in moves {
        // VAL3 signals are links, RAPID's are names.
        let mut m = m.clone();
        if let (Move::Other(Action::Signal { signal, .. }), "rapid") = (&mut m, target) {
            signal.signal = Some("doSpindle".into());
        }
        if let Move::Probe { shift, speed, .. } = m {
            // Two probes after each other, the second of which asks whether the first has found something, read as one that must.
            let moved = |s: &&gr_robot::Step| matches!(s.action, Action::Probe { .. } | Action::Joint { .. } | Action::Linear { .. } | Action::Arc { .. });
            let twice = matches!(b.program.steps.iter().rev().find(moved), Some(s) if matches!(s.action, Action::Probe { .. }));
            if twice || !matches!(target, "rapid" | "krl" | "fanuc-ls" | "urscript") {
                m = Move::Line { shift, turn: [0.0; 3], speed, zone: None };
            }
        }
        b.add(&m);
    }
    b.program
}

#[test]
fn realistic_programs_come_back() {
    for target in TARGETS {
        compare(target, &sample(target)).unwrap_or_else(|e| panic!("{target}: {e}"));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_programs_come_back(moves in moves(), robot in 0usize..3, split in prop_oneof![Just(None), Just(Some(60u64))]) {
        for target in TARGETS {
            let splits = matches!(target, "rapid" | "krl" | "fanuc-ls" | "inform" | "val3" | "urscript");
            let program = program(target, robot, &moves, split.filter(|_| splits));
            let result = compare(target, &program);
            prop_assert!(result.is_ok(), "{target}: {}", result.unwrap_err());
        }
    }
}
