//! Universal Robots URScript: meters and radians, poses in the robot's base. One script, or where the machine file limits
//! what one may hold, several to be run one after the other: no script can call another file.
//!
//! Every arm carries its own calibration, so points are poses; joint values only say which way the arm takes to them
//! (`get_inverse_kin` with the joints nearby). Facts: signatures of the *URScript Programming Language* manual.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::probe::{NOT_READY, NOT_TRIPPED};
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, World, any_error, walk, wrapped};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};
use gr_text::code;
use std::fmt::Write;

pub(crate) struct UrScript;

static TRAITS: Traits =
    Traits { title: "URScript", arms: Arms::Six, world: World::Foot, external: false, arcs: true, trailing: true, unverified: "" };

const RESERVED: &[&str] = &[
    "AND", "BREAK", "CONTINUE", "DEF", "ELIF", "ELSE", "END", "FALSE", "FOR", "GLOBAL", "HALT", "IF", "IN", "LOCAL", "NOT", "OR", "PASS",
    "RETURN", "SEC", "THREAD", "TRUE", "WHILE", "XOR", "MOVEJ", "MOVEL", "MOVEP", "MOVEC", "SLEEP", "SYNC", "TEXTMSG", "POPUP", "LATE", "KILL", "RUN", "JOIN",
];

/// Reports of scripts of this size that did not run: visose/Robots #55.
const POINTS: u64 = 2500;

impl Language for UrScript {
    fn id(&self) -> &'static str {
        "urscript"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 60, reserved: RESERVED, upper: false });
        let name = names.give(&program.name.to_lowercase(), "p");
        let mut w = Writer::new(&program.machine.cell.controller);
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            out.files = w.files(&name);
        }
        out
    }
}

struct Writer {
    /// The part in work.
    text: String,
    lines: u64,
    points: u64,
    /// Points of all parts.
    all: u64,
    /// Bytes of marks in `text`.
    marks: usize,
    waits: u32,
    probes: u32,
    /// Lines, points and bytes of one script at most.
    most: (u64, u64, u64),
    /// Scripts before the one in work.
    done: Vec<String>,
    /// The last move ends in a blend: the next must stand in the same script.
    blended: bool,
    /// The last move stops for want of room: the script ends there.
    full: bool,
    /// Tool and payload in force.
    tool: Vec<String>,
    /// Where the last move ends.
    last: String,
}

/// Lines around a part: definition, guard, tool, call.
const AROUND: u64 = 8;
/// Lines of a probe move.
const PROBE: u64 = 26;
/// Lines kept for what may come after a move without stopping it, and for one statement.
const ROOM: u64 = 10;

impl Writer {
    fn new(limits: &gr_machine::Controller) -> Writer {
        let all = u64::MAX;
        // Smaller ones hold no statement.
        let most = (limits.lines.unwrap_or(all).max(AROUND + 2 * ROOM), limits.points.unwrap_or(all).max(4), limits.bytes.unwrap_or(all).max(8000));
        Writer {
            text: String::new(),
            lines: 0,
            points: 0,
            all: 0,
            marks: 0,
            waits: 0,
            probes: 0,
            most,
            done: Vec::new(),
            blended: false,
            full: false,
            tool: Vec::new(),
            last: String::new(),
        }
    }

    fn put(&mut self, text: &str, remark: Option<u32>, step: Option<u32>) {
        self.text.push_str("  ");
        self.text.push_str(text);
        if let Some(line) = remark {
            let _ = write!(self.text, "  # {line}");
        }
        self.marks += crate::marks::put(&mut self.text, step);
        self.text.push('\n');
        self.lines += 1;
    }

    fn line(&mut self, cx: &Cx, text: &str) {
        self.put(text, cx.remark, cx.step);
    }

    /// Whether so many more lines have room, and another move after them.
    fn room(&self, lines: u64) -> bool {
        let bytes = self.text.len().saturating_sub(self.marks) as u64;
        self.lines + lines + AROUND <= self.most.0 && self.points + 2 <= self.most.1 && bytes + 160 * (lines + AROUND) <= self.most.2
    }

    /// Closes a script that has no room for so many more lines. Where the tool must be is looked at before the next goes on.
    fn part(&mut self, lines: u64) {
        if self.blended || self.last.is_empty() || (!self.full && self.room(lines)) {
            return;
        }
        self.done.push(std::mem::take(&mut self.text));
        (self.lines, self.points, self.marks, self.full) = (0, 0, 0, false);
        let guard = format!("if point_dist(get_actual_tcp_pose(),{})>0.001:", self.last);
        let stop = ["  popup(\"this part goes on where the one before ended\",\"wrong place\",False,True,blocking=True)", "  halt", "end"];
        for text in self.tool.clone().iter().map(String::as_str).chain([guard.as_str()]).chain(stop) {
            self.put(text, None, None);
        }
    }

    fn files(mut self, name: &str) -> Vec<OutputFile> {
        let script = |name: &str, text: &str| OutputFile::new(format!("{name}.script"), format!("def {name}():\n{text}end\n{name}()\n"));
        self.done.push(self.text);
        match self.done.as_slice() {
            [one] => vec![script(name, one)],
            parts => parts.iter().enumerate().map(|(i, part)| script(&format!("{name}_{:03}", i + 1), part)).collect(),
        }
    }

    /// A move of so many points to a pose that stops there where the script has no room for more.
    fn moved(&mut self, cx: &mut Cx, points: u64, to: &Target) {
        (self.points, self.all) = (self.points + points, self.all + points);
        self.last = point(cx, to);
        let limits = &cx.machine.cell.controller;
        if limits.lines.or(limits.points).or(limits.bytes).is_none() && self.all > POINTS {
            let args = [format!("more than {POINTS}"), "points".into(), TRAITS.title.into(), format!("{POINTS} points")];
            cx.say(code::VENDOR_PROGRAM_SIZE, &args);
        }
    }

    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64, pose: bool) {
        let joints: Vec<String> = to.joints[..6].iter().map(|v| num(*v, 6)).collect();
        let near = format!("[{}]", joints.join(","));
        let target = if pose { format!("get_inverse_kin({},{near})", point(cx, to)) } else { near };
        // The speed of the joint that goes furthest.
        let furthest = |before: &Target| (0..6).map(|i| (to.joints[i] - before.joints[i]).abs()).fold(0.0, f64::max);
        let way = cx.before.as_ref().map(furthest).zip(cx.joint_way(to, share));
        let slowest = || cx.machine.joints.iter().map(gr_machine::Joint::top_rapid).fold(f64::INFINITY, f64::min) * share;
        let v = way.map_or_else(slowest, |(furthest, (_, seconds))| furthest / seconds);
        let a = cx.machine.joints.iter().filter_map(|j| j.acceleration).fold(f64::INFINITY, f64::min);
        let a = if a.is_finite() { a } else { 1.4 };
        self.line(cx, &format!("movej({target},a={},v={},t=0,r=0)", single(a), single(v)));
    }
}

/// The pose in the base: meters and rotation vector.
fn point(cx: &Cx, t: &Target) -> String {
    let frame = cx.frame_in_control(cx.frame);
    pose(&frame.then(&orient::frame(t.position, &t.quaternion)), cx.decimals() + 3)
}

fn pose(frame: &Frame, decimals: usize) -> String {
    let p = frame.position.map(|v| num(v / 1000.0, decimals));
    let r = orient::vector(&frame.turn).map(|v| num(v, 7));
    format!("p[{},{},{},{},{},{}]", p[0], p[1], p[2], r[0], r[1], r[2])
}

/// A blend less than half of both neighbors; next to arcs there is none, where it would bend the arc's start.
fn blend(cx: &Cx, zone: Option<f64>) -> String {
    let Some(r) = zone.filter(|_| !cx.arc_next) else { return "0".into() };
    let Some(next) = cx.next_length else { return "0".into() };
    num(libm::floor(r.min(cx.length * 0.49).min(next * 0.49) * 1000.0 + 1e-6) / 1e6, 6)
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        self.part(ROOM);
        match op {
            Op::Line(number, text) => {
                let text = cx.ascii(text);
                self.line(cx, &format!("# {number}: {text}"));
            }
            Op::Home(t) => self.joint(cx, t, 0.25, false),
            Op::Joint { to, share, .. } => {
                self.moved(cx, 1, to);
                self.blended = false;
                self.joint(cx, to, share, true);
            }
            Op::Linear { to, speed, zone } => {
                self.moved(cx, 1, to);
                // Remarks may come before the move that the blend goes over into.
                let (radius, room) = (blend(cx, zone), self.room(2 * ROOM));
                self.full = !room && radius != "0";
                let radius = if room { radius } else { "0".into() };
                self.blended = radius != "0";
                let text = format!("movel({},a=1.2,v={},t=0,r={radius})", self.last, single(speed / 1000.0));
                self.line(cx, &text);
            }
            Op::Arc { via, to, speed, .. } => {
                self.moved(cx, 2, to);
                self.blended = false;
                let (via, to) = (point(cx, via), point(cx, to));
                self.line(cx, &format!("movec({via},{to},a=1.2,v={},r=0,mode=0)", single(speed / 1000.0)));
            }
            Op::Probe { to, speed, input, on, must } => self.probe(cx, (to, speed), input, on, must),
            Op::Tool(i) => {
                let tool = &cx.program.tools[i];
                let mut words = vec![format!("set_tcp({})", pose(&tool.frame, 7))];
                if let Some(mass) = tool.mass {
                    let c = tool.frame.position.map(|v| num(v / 2000.0, 6)).join(",");
                    words.push(format!("set_payload({},[{c}])", num(mass, 3)));
                }
                words.iter().for_each(|w| self.line(cx, w));
                self.tool = words;
                // Where the arm stands is another pose for another point: no script ends here.
                self.last.clear();
            }
            Op::Frame(i) => {
                let name = cx.ascii(&cx.program.frames[i].name);
                self.line(cx, &format!("# frame {name}: {}", pose(&cx.frame_in_control(i), 7)));
            }
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => {
                        let on = if on { "True" } else { "False" };
                        self.line(cx, &format!("set_standard_digital_out({n},{on})"));
                    }
                    Value::Analog(v) => {
                        let share = cx.share(v, word, name);
                        self.line(cx, &format!("set_standard_analog_out({n},{})", num(share, 6)));
                    }
                    Value::Group(_) => cx.cannot("a tool number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine").to_string();
                self.line(cx, &format!("{name}({})", value.map_or(String::new(), |v| num(v, 6))));
            }
            Op::Wait { name, on, timeout } => self.wait(cx, name, on, timeout),
            Op::Dwell(s) => self.line(cx, &format!("sleep({})", num(s, 3))),
            Op::Message(text) => {
                let text = cx.ascii(text).replace('"', "'");
                self.line(cx, &format!("textmsg(\"{text}\")"));
            }
            Op::Comment(text) => {
                let text = cx.ascii(text);
                for piece in wrapped(&text, 120) {
                    self.line(cx, &format!("# {piece}"));
                }
            }
            Op::Pause => self.line(cx, "popup(\"continue?\",\"program stop\",False,False,blocking=True)"),
            Op::End => {}
        }
    }
}

impl Writer {
    /// Ends the program with a message where this is so.
    fn forbid(&mut self, cx: &Cx, condition: &str, message: &str) {
        self.line(cx, &format!("if {condition}:"));
        self.line(cx, &format!("  popup(\"{message}\",\"program stop\",False,True,blocking=True)"));
        self.line(cx, "  halt");
        self.line(cx, "end");
    }

    /// A thread moves while the program looks at the input, as PolyScope writes a move with *until*.
    fn probe(&mut self, cx: &mut Cx, (to, speed): (&Target, f64), input: &str, on: bool, must: bool) {
        self.part(PROBE);
        let remark = cx.remark.take();
        let input = format!("get_standard_digital_in({})", cx.number(input, "G38"));
        let (ends, open) = if on { (input.clone(), format!("not {input}")) } else { (format!("not {input}"), input) };
        self.probes += 1;
        let n = self.probes;
        self.forbid(cx, &ends, NOT_READY);
        let goal = point(cx, to);
        let lines = [
            format!("global probed_{n} = 0"),
            format!("thread probe_{n}():"),
            "  enter_critical".into(),
            format!("  movel({goal},a=1.2,v={},t=0,r=0){}", single(speed / 1000.0), remark.map_or(String::new(), |l| format!("  # {l}"))),
            format!("  probed_{n} = 1"),
            "  exit_critical".into(),
            "end".into(),
            format!("probing_{n} = run probe_{n}()"),
            format!("while probed_{n} == 0 and {open}:"),
            "  sync()".into(),
            "end".into(),
            format!("if probed_{n} == 0:"),
            format!("  kill probing_{n}"),
            "  stopl(1.2)".into(),
            "else:".into(),
            format!("  join probing_{n}"),
            "end".into(),
        ];
        lines.iter().for_each(|l| self.line(cx, l));
        if must {
            self.forbid(cx, &open, NOT_TRIPPED);
        }
        (self.points, self.all) = (self.points + 1, self.all + 1);
        // Nobody knows where it stands: no script ends here.
        self.last.clear();
        self.blended = false;
    }

    fn wait(&mut self, cx: &mut Cx, name: &str, on: bool, timeout: Option<f64>) {
        let n = cx.number(name, "wait");
        let input = format!("get_standard_digital_in({n})");
        let open = if on { format!("not {input}") } else { input };
        match timeout {
            None => {
                self.line(cx, &format!("while {open}:"));
                self.line(cx, "  sync()");
                self.line(cx, "end");
            }
            Some(most) => {
                self.waits += 1;
                let late = format!("late_{}", self.waits);
                self.line(cx, &format!("{late} = 0"));
                self.line(cx, &format!("while ({open}) and {late} < {}:", num(most, 3)));
                self.line(cx, "  sleep(0.01)");
                self.line(cx, &format!("  {late} = {late} + 0.01"));
                self.line(cx, "end");
                self.line(cx, &format!("if {open}:"));
                self.line(cx, &format!("  popup(\"input {n} did not come\",\"program stop\",False,True,blocking=True)"));
                self.line(cx, "end");
            }
        }
    }
}
