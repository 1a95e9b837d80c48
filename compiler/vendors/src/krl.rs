//! KUKA KRL (KSS 5 and later): a `.src` with the motion and a `.dat` with the home position; long programs in parts
//! that the first file calls.
//!
//! Facts: status and turn bits as in Beckhoff's TF5200 manual, *Status & Turn*, kinematics 45, and KUKA's *Operating
//! and Programming Instructions for System Integrators*; `$VEL.CP` is in m/s.

use crate::name::{Names, Rule};
use crate::number::{num, real, single};
use crate::parts::Parts;
use crate::probe::{NOT_READY, NOT_TRIPPED};
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, World, any_error, walk, wrapped};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::{Frame, turn_of};
use gr_robot::{RobotProgram, Target};

pub(crate) struct Krl;

static TRAITS: Traits = Traits { title: "KUKA KRL", arms: Arms::Spherical, world: World::Foot, external: true, arcs: true, trailing: true, unverified: "" };

const RESERVED: &[&str] = &[
    "AND", "ANIN", "ANOUT", "B_AND", "B_EXOR", "B_NOT", "B_OR", "BOOL", "BRAKE", "CASE", "CAST_FROM", "CAST_TO", "CHANNEL", "CHAR",
    "CIRC", "CIRC_REL", "CONFIRM", "CONST", "CONTINUE", "DECL", "DEF", "DEFAULT", "DEFDAT", "DEFFCT", "DELAY", "DIGIN", "DISTANCE",
    "DO", "ELSE", "END", "ENDDAT", "ENDFCT", "ENDFOR", "ENDIF", "ENDLOOP", "ENDSWITCH", "ENDWHILE", "ENUM", "EXIT", "EXOR", "EXT",
    "EXTFCT", "FALSE", "FOR", "FRAME", "GLOBAL", "GOTO", "HALT", "IF", "IMPORT", "INT", "INTERRUPT", "IS", "LIN", "LIN_REL", "LOOP",
    "MAXIMUM", "MINIMUM", "NOT", "OFF", "ON", "OR", "POS", "PRIO", "PTP", "PTP_REL", "PUBLIC", "PULSE", "REAL", "REPEAT", "RESUME",
    "RETURN", "SEC", "SIGNAL", "STRUC", "SWITCH", "THEN", "TO", "TRIGGER", "TRUE", "UNTIL", "WAIT", "WHEN", "WHILE", "AXIS", "E6AXIS",
    "E6POS", "BAS", "SPTP", "SLIN", "SCIRC", "SPL", "SPLINE", "ENDSPLINE",
];

/// Characters of a program's name: four less than the control allows, which its parts' names need.
const NAME: usize = 20;

/// Lines of a file: what reference post processors keep to on a KR C4.
const LINES: u64 = 1400;

impl Language for Krl {
    fn id(&self) -> &'static str {
        "krl"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: NAME, reserved: RESERVED, upper: false });
        let name = names.give(&program.name, "p");
        names.longer(NAME + 4);
        let limits = &program.machine.cell.controller;
        let most = limits.lines.unwrap_or(LINES);
        let mut w = Writer {
            most,
            parts: Parts::new(most.saturating_sub(if probes(program) { 5 } else { 4 }), limits.points, limits.bytes, "\r\n"),
            home: String::new(),
            angles: [0.0; 3],
            set: [String::new(), String::new(), String::new()],
            first: String::new(),
            probe: None,
        };
        w.probe = probes(program).then(|| [names.fresh(&format!("{name}_prb")), names.fresh(&format!("{name}_hit"))]);
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            out.files = w.files(&name);
        }
        out
    }
}

struct Writer {
    /// Lines of a file at most.
    most: u64,
    parts: Parts,
    home: String,
    angles: [f64; 3],
    /// What is in force: path speed, corner distance, axis speed.
    set: [String; 3],
    /// Axis speed of the first joint move: the way to the home position before it is no faster.
    first: String,
    /// Names of the programs that probe and that are called when the probe switches, where the program probes.
    probe: Option<[String; 2]>,
}

/// Where a probe is sent.
const GOAL: &str = "DECL FRAME GOAL\r\n";
/// Number, and so priority, of the interrupt of the probe.
const INTERRUPT: u32 = 20;

fn probes(program: &RobotProgram) -> bool {
    program.steps.iter().any(|s| matches!(s.action, gr_robot::Action::Probe { .. }))
}

/// The program that moves while the probe is looked at, and the one that the control calls when it switches. `RESUME` leaves
/// both, and goes on behind the call. `WAIT SEC 0` keeps the advance run from leaving before the move is done.
fn searching([probe, hit]: &[String; 2], head: &str) -> Vec<OutputFile> {
    let n = INTERRUPT;
    let programs = [
        (probe, format!("{head}DEF {probe}(GOAL:IN)\r\n{GOAL}INTERRUPT ON {n}\r\nLIN GOAL\r\nWAIT SEC 0\r\nINTERRUPT OFF {n}\r\nEND\r\n")),
        (hit, format!("{head}DEF {hit}()\r\nINTERRUPT OFF {n}\r\nBRAKE F\r\nRESUME\r\nEND\r\n")),
    ];
    programs.into_iter().map(|(name, text)| OutputFile::new(format!("{name}.src"), text)).collect()
}

impl Writer {
    fn files(self, name: &str) -> Vec<OutputFile> {
        let head = "&ACCESS RVP\r\n&REL 1\r\n";
        let mut files = self.probe.as_ref().map_or(Vec::new(), |names| searching(names, head));
        let goal = if self.probe.is_some() { GOAL } else { "" };
        // INITMOV puts speeds and accelerations of the axes to what the control was set up with, 100 % mostly.
        let speed = if self.first.is_empty() { axis_speed(SLOW) } else { self.first.clone() };
        let start = format!("BAS(#INITMOV,0)\r\n$ADVANCE=3\r\n$ORI_TYPE=#VAR\r\n$CIRC_TYPE=#PATH\r\n{speed}\r\nPTP XHOME\r\n");
        let parts = self.parts.finish();
        let mut main = format!("{head}DEF {name}()\r\n{goal}{start}");
        let lines = |text: &str| text.matches('\n').count() as u64;
        if let [one] = parts.as_slice()
            && lines(&main) + lines(one) < self.most
        {
            main += one;
        } else {
            for (i, part) in parts.iter().enumerate() {
                let inner = format!("{name}_{:03}", i + 1);
                main += &format!("{inner}()\r\n");
                files.push(OutputFile::new(format!("{inner}.src"), format!("{head}DEF {inner}()\r\n{goal}{part}END\r\n")));
            }
        }
        main += "END\r\n";
        let data = format!("&ACCESS RVP\r\nDEFDAT {name} PUBLIC\r\nDECL E6AXIS XHOME={}\r\nENDDAT\r\n", self.home);
        files.push(OutputFile::new(format!("{name}.dat"), data));
        files.push(OutputFile::new(format!("{name}.src"), main));
        files
    }

    fn pose(&mut self, position: &[f64; 3], m: &gr_machine::math::M3, decimals: usize) -> String {
        let [c, b, a] = orient::fixed_xyz(m, [self.angles[2], self.angles[1], self.angles[0]]);
        self.angles = [a, b, c];
        let p = position.map(|v| real(v, decimals));
        let t = self.angles.map(|v| real(v.to_degrees(), 5));
        format!("X {},Y {},Z {},A {},B {},C {}", p[0], p[1], p[2], t[0], t[1], t[2])
    }

    fn point(&mut self, cx: &Cx, t: &Target) -> String {
        let mut text = self.pose(&t.position, &turn_of(t.quaternion), cx.decimals());
        for (i, v) in cx.external(t).iter().enumerate() {
            text += &format!(",E{} {}", i + 1, real(*v, 4));
        }
        text
    }

    fn axes(cx: &Cx, t: &Target) -> String {
        let mut parts: Vec<String> = cx.degrees(t).iter().enumerate().map(|(i, v)| format!("A{} {}", i + 1, real(*v, 5))).collect();
        parts.extend(cx.external(t).iter().enumerate().map(|(i, v)| format!("E{} {}", i + 1, real(*v, 4))));
        format!("{{{}}}", parts.join(","))
    }

    /// Writes a setting where it is not in force.
    fn put(&mut self, slot: usize, text: String) {
        if self.set[slot] != text {
            text.split("\r\n").for_each(|line| self.parts.line(line));
            self.set[slot] = text;
        }
    }

    fn path(&mut self, speed: f64, zone: Option<f64>) -> &'static str {
        self.put(0, format!("$VEL.CP={}", with_point(single(speed / 1000.0))));
        let Some(r) = zone else { return "" };
        self.put(1, format!("$APO.CDIS={}", real(libm::floor(r * 1000.0 + 1e-6) / 1000.0, 3)));
        " C_DIS"
    }

    fn end(&mut self, cx: &Cx, text: String) {
        let remark = cx.remark.map_or(String::new(), |l| format!(" ; {l}"));
        self.parts.line(&(text + &remark));
    }

    fn frame(&mut self, variable: &str, frame: &Frame, note: &str) {
        self.angles = [0.0; 3];
        let pose = self.pose(&frame.position, &frame.turn, 4);
        self.angles = [0.0; 3];
        self.parts.line(&format!("{variable}={{{pose}}} ; {note}"));
    }

    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64) {
        let percent = libm::floor(share * 100.0 + 1e-6).clamp(1.0, 100.0);
        let speed = axis_speed(percent);
        if self.first.is_empty() {
            self.first.clone_from(&speed);
        }
        self.put(2, speed);
        let degrees = cx.degrees(to);
        // Next to zero the turn bit of a joint could be read as a whole turn. Home is joints, at the end as at the start;
        // a part of a long program does not see the start's XHOME.
        let home = to.joints == cx.program.home.joints;
        let text = if home || degrees.iter().any(|v| v.abs() < 0.01) {
            Self::axes(cx, to)
        } else {
            if degrees.iter().any(|v| v.abs() >= 360.0) || degrees[4].abs() >= 180.0 {
                cx.configuration("an axis stands beyond a whole turn".into());
            }
            let p = cx.posture(to);
            let s = u8::from(p.behind) + 2 * u8::from(p.forward) + 4 * u8::from(degrees[4] < 0.0);
            let t: u32 = degrees.iter().enumerate().map(|(i, v)| u32::from(*v < 0.0) << i).sum();
            let text = self.point(cx, to);
            let (pose, external) = text.split_at(text.find(",E").unwrap_or(text.len()));
            format!("{{E6POS: {pose},S {s},T {t}{external}}}")
        };
        self.parts.points(1);
        self.end(cx, format!("PTP {text}"));
    }
}

fn truth(on: bool) -> &'static str {
    if on { "TRUE" } else { "FALSE" }
}

/// Per cent of the axis speed to the home position where no joint move says one.
const SLOW: f64 = 10.0;

fn axis_speed(percent: f64) -> String {
    let all: Vec<String> = (1..=6).map(|i| format!("$VEL_AXIS[{i}]={percent:.0}")).collect();
    all.join("\r\n")
}

fn with_point(mut text: String) -> String {
    if !text.contains('.') {
        text += ".0";
    }
    text
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        self.parts.begin();
        self.parts.step = cx.step;
        match op {
            Op::Line(number, text) => {
                let text = cx.ascii(text);
                self.parts.line(&format!("; {number}: {text}"));
            }
            Op::Home(t) => self.home = Self::axes(cx, t),
            Op::Joint { to, share, .. } => self.joint(cx, to, share),
            Op::Linear { to, speed, zone } => {
                let blend = self.path(speed, zone);
                let to = self.point(cx, to);
                self.parts.points(1);
                self.end(cx, format!("LIN {{{to}}}{blend}"));
            }
            Op::Arc { via, to, speed, zone } => {
                let blend = self.path(speed, zone);
                let (via, to) = (self.point(cx, via), self.point(cx, to));
                self.parts.points(2);
                self.end(cx, format!("CIRC {{{via}}},{{{to}}}{blend}"));
            }
            Op::Probe { to, speed, input, on, must } => self.probe(cx, (to, speed), input, on, must),
            Op::Tool(i) => {
                let tool = &cx.program.tools[i];
                let note = cx.ascii(&tool.name);
                self.frame("$TOOL", &tool.frame, &note);
                if let Some(mass) = tool.mass {
                    self.parts.line(&format!("$LOAD.M={}", real(mass, 3)));
                }
            }
            Op::Frame(i) => {
                let frame = &cx.program.frames[i];
                let note = cx.ascii(&frame.name);
                self.frame("$BASE", &cx.frame_in_control(i), &note);
            }
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.parts.line(&format!("$OUT[{n}]={}", if on { "TRUE" } else { "FALSE" })),
                    Value::Analog(v) => {
                        let share = cx.share(v, word, name);
                        self.parts.line(&format!("$ANOUT[{n}]={}", real(share, 6)));
                    }
                    Value::Group(_) => cx.cannot("a tool number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine");
                self.parts.line(&format!("{name}({})", value.map_or(String::new(), |v| num(v, 6))));
            }
            Op::Wait { name, on, timeout } => self.wait(cx, name, on, timeout),
            Op::Dwell(s) => self.parts.line(&format!("WAIT SEC {}", real(s, 3))),
            Op::Message(text) | Op::Comment(text) => {
                let text = cx.ascii(text);
                for piece in wrapped(&text, 120) {
                    self.parts.begin();
                    self.parts.line(&format!("; {piece}"));
                }
            }
            Op::Pause => self.parts.line("HALT"),
            Op::End => {}
        }
    }
}

impl Writer {
    /// Goes no further where the input has this state. The line that the program stands at says why.
    fn forbid(&mut self, input: u32, on: bool, message: &str) {
        self.parts.line(&format!("IF $IN[{input}]=={} THEN", truth(on)));
        self.parts.line("LOOP");
        self.parts.line(&format!("HALT ; {message}"));
        self.parts.line("ENDLOOP");
        self.parts.line("ENDIF");
    }

    fn probe(&mut self, cx: &mut Cx, (to, speed): (&Target, f64), input: &str, on: bool, must: bool) {
        let Some([probe, hit]) = self.probe.clone() else { return };
        let input = cx.number(input, "G38");
        self.path(speed, None);
        self.forbid(input, on, NOT_READY);
        self.parts.line(&format!("INTERRUPT DECL {INTERRUPT} WHEN $IN[{input}]=={} DO {hit}()", truth(on)));
        let goal = self.pose(&to.position, &turn_of(to.quaternion), cx.decimals());
        self.parts.points(1);
        self.parts.line(&format!("GOAL={{{goal}}}"));
        self.end(cx, format!("{probe}(GOAL)"));
        if must {
            self.forbid(input, !on, NOT_TRIPPED);
        }
    }

    fn wait(&mut self, cx: &mut Cx, name: &str, on: bool, timeout: Option<f64>) {
        let input = format!("$IN[{}]", cx.number(name, "wait"));
        let (wanted, other) = if on { ("TRUE", "FALSE") } else { ("FALSE", "TRUE") };
        let Some(most) = timeout else {
            return self.parts.line(&format!("WAIT FOR {input}=={wanted}"));
        };
        // A timer that runs up to zero raises its flag there.
        self.parts.line(&format!("$TIMER[1]=-{}", num((most * 1000.0).max(1.0), 0)));
        self.parts.line("$TIMER_STOP[1]=FALSE");
        self.parts.line(&format!("WAIT FOR ({input}=={wanted}) OR $TIMER_FLAG[1]"));
        self.parts.line("$TIMER_STOP[1]=TRUE");
        self.parts.line(&format!("IF {input}=={other} THEN"));
        self.parts.line("HALT");
        self.parts.line("ENDIF");
    }
}
