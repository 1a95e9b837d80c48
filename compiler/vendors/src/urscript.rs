//! Universal Robots URScript: one script, meters and radians, poses in the robot's base.
//!
//! Every arm carries its own calibration, so points are poses; joint values only say which way the arm takes to them
//! (`get_inverse_kin` with the joints nearby). Facts: signatures of the *URScript Programming Language* manual.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, any_error, walk, wrapped};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};
use gr_text::code;
use std::fmt::Write;

pub(crate) struct UrScript;

static TRAITS: Traits =
    Traits { title: "URScript", arms: Arms::Six, arcs: true, trailing: true, unverified: "" };

const RESERVED: &[&str] = &[
    "AND", "BREAK", "CONTINUE", "DEF", "ELIF", "ELSE", "END", "FALSE", "FOR", "GLOBAL", "HALT", "IF", "IN", "LOCAL", "NOT", "OR", "PASS",
    "RETURN", "SEC", "THREAD", "TRUE", "WHILE", "XOR", "MOVEJ", "MOVEL", "MOVEP", "MOVEC", "SLEEP", "SYNC", "TEXTMSG", "POPUP", "LATE",
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
        let mut w = Writer { text: String::new(), points: 0, waits: 0 };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = format!("def {name}():\n{}end\n{name}()\n", w.text);
            out.files = vec![OutputFile::new(format!("{name}.script"), text)];
        }
        out
    }
}

struct Writer {
    text: String,
    points: u64,
    waits: u32,
}

impl Writer {
    fn line(&mut self, cx: &Cx, text: &str) {
        self.text.push_str("  ");
        self.text.push_str(text);
        if let Some(line) = cx.remark {
            let _ = write!(self.text, "  # {line}");
        }
        crate::marks::put(&mut self.text, cx.step);
        self.text.push('\n');
    }

    fn count(&mut self, cx: &mut Cx, points: u64) {
        self.points += points;
        let limits = &cx.machine.cell.controller;
        if let Some(most) = limits.points.filter(|m| self.points > *m) {
            let args = ["too many".to_string(), "points".into(), most.to_string(), TRAITS.title.into()];
            cx.say(code::VENDOR_PROGRAM_TOO_LONG, &args);
        } else if limits.points.is_none() && self.points > POINTS {
            let args = [format!("more than {POINTS}"), "points".into(), TRAITS.title.into(), format!("{POINTS} points")];
            cx.say(code::VENDOR_PROGRAM_SIZE, &args);
        }
    }

    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64, pose: bool) {
        let joints: Vec<String> = to.joints[..6].iter().map(|v| num(*v, 6)).collect();
        let near = format!("[{}]", joints.join(","));
        let target = if pose { format!("get_inverse_kin({},{near})", point(cx, to)) } else { near };
        let fastest = cx.machine.joints.iter().filter_map(|j| j.rapid.or(j.speed)).fold(f64::INFINITY, f64::min);
        let fastest = if fastest.is_finite() { fastest } else { 1.05 };
        let a = cx.machine.joints.iter().filter_map(|j| j.acceleration).fold(f64::INFINITY, f64::min);
        let a = if a.is_finite() { a } else { 1.4 };
        self.line(cx, &format!("movej({target},a={},v={},t=0,r=0)", single(a), single(fastest * share)));
    }
}

/// The pose in the base: meters and rotation vector.
fn point(cx: &Cx, t: &Target) -> String {
    let frame = cx.program.frames.get(cx.frame).map(|f| f.frame).unwrap_or_default();
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
        match op {
            Op::Line(number, text) => {
                let text = cx.ascii(text);
                self.line(cx, &format!("# {number}: {text}"));
            }
            Op::Home(t) => self.joint(cx, t, 0.25, false),
            Op::Joint { to, share, .. } => {
                self.count(cx, 1);
                self.joint(cx, to, share, true);
            }
            Op::Linear { to, speed, zone } => {
                self.count(cx, 1);
                let text = format!("movel({},a=1.2,v={},t=0,r={})", point(cx, to), single(speed / 1000.0), blend(cx, zone));
                self.line(cx, &text);
            }
            Op::Arc { via, to, speed, .. } => {
                self.count(cx, 2);
                let (via, to) = (point(cx, via), point(cx, to));
                self.line(cx, &format!("movec({via},{to},a=1.2,v={},r=0,mode=0)", single(speed / 1000.0)));
            }
            Op::Tool(i) => {
                let tool = &cx.program.tools[i];
                self.line(cx, &format!("set_tcp({})", pose(&tool.frame, 7)));
                if let Some(mass) = tool.mass {
                    let c = tool.frame.position.map(|v| num(v / 2000.0, 6)).join(",");
                    self.line(cx, &format!("set_payload({},[{c}])", num(mass, 3)));
                }
            }
            Op::Frame(i) => {
                let name = cx.ascii(&cx.program.frames[i].name);
                self.line(cx, &format!("# frame {name}: {}", pose(&cx.program.frames[i].frame, 7)));
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
