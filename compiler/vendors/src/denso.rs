//! DENSO PAC: one program. Sources differ on what the angles of a position mean, so every point is joint values,
//! straight moves and arcs too.

use crate::name::{Names, Rule};
use crate::number::num;
use crate::parts::Lines;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, any_error, walk};
use crate::{Language, Options, Output, OutputFile};
use gr_ir::Sources;
use gr_machine::math::{Frame, norm};
use gr_robot::{RobotProgram, Target};

pub(crate) struct Denso;

static TRAITS: Traits = Traits {
    title: "DENSO PAC",
    arms: Arms::Any,
    arcs: true,
    trailing: true,
    unverified: "speeds in mm/s by MPS, and joint values in straight moves",
};

impl Language for Denso {
    fn id(&self) -> &'static str {
        "denso-pac"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 32, reserved: &["PROGRAM", "END", "MOVE", "MAIN"], upper: false });
        let name = names.give(&program.name.to_lowercase(), "p");
        let mut w = Writer { out: Lines::new("  ", "'"), speed: String::new() };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = format!("PROGRAM {name}\r\n  TAKEARM\r\n{}  GIVEARM\r\nEND\r\n", w.out.text);
            out.files = vec![OutputFile::new(format!("{name}.pac"), text)];
        }
        out
    }
}

struct Writer {
    out: Lines,
    speed: String,
}

impl Writer {
    fn point(cx: &Cx, t: &Target) -> String {
        let values: Vec<String> = cx.degrees(t).iter().map(|v| num(*v, 5)).collect();
        format!("J({})", values.join(","))
    }

    fn path(&mut self, cx: &mut Cx, speed: f64, zone: Option<f64>) -> String {
        let text = format!("SPEED MPS({})", num(speed, 6));
        if self.speed != text {
            let remark = cx.remark.take();
            self.out.line(cx, &text);
            cx.remark = remark;
            self.speed = text;
        }
        zone.map_or("@0".into(), |r| format!("@{}", num(libm::floor(r * 1000.0 + 1e-6) / 1000.0, 3)))
    }

    fn joint(&mut self, cx: &mut Cx, t: &Target, share: f64) {
        let to = Self::point(cx, t);
        self.out.line(cx, &format!("MOVE P, @0 {to}, S={}", num((share * 100.0).clamp(0.1, 100.0), 1)));
    }

    fn needs(cx: &mut Cx, what: String, frame: &Frame) {
        if norm(frame.position) > 0.0 {
            let p = frame.position.map(|v| num(v, 3));
            cx.say(gr_text::code::VENDOR_SET_BY_HAND, &[what, format!("X {} Y {} Z {}", p[0], p[1], p[2])]);
        }
    }
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        match op {
            Op::Line(number, text) => self.out.remark(cx, &format!("{number}: {text}")),
            Op::Comment(text) => self.out.remark(cx, text),
            Op::Home(t) => self.joint(cx, t, 0.2),
            Op::Joint { to, share, .. } => self.joint(cx, to, share),
            Op::Linear { to, speed, zone } => {
                let pass = self.path(cx, speed, zone);
                let to = Self::point(cx, to);
                self.out.line(cx, &format!("MOVE L, {pass} {to}"));
            }
            Op::Arc { via, to, speed, zone } => {
                let pass = self.path(cx, speed, zone);
                let (via, to) = (Self::point(cx, via), Self::point(cx, to));
                self.out.line(cx, &format!("MOVE C, {via}, {pass} {to}"));
            }
            Op::Tool(i) => {
                // The arc of a straight move is that of the tool point: the controller must know it.
                let frame = cx.program.tools[i].frame;
                Self::needs(cx, format!("tool {}", i + 1), &frame);
                self.out.line(cx, &format!("CHANGETOOL {}", i + 1));
            }
            // Points are joint values: no frame is needed.
            Op::Frame(_) | Op::End => {}
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.out.line(cx, &format!("{} IO[{n}]", if on { "SET" } else { "RESET" })),
                    Value::Analog(_) | Value::Group(_) => cx.cannot("a number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine").to_string();
                self.out.line(cx, &value.map_or(format!("CALL {name}"), |v| format!("CALL {name}({})", num(v, 6))));
            }
            Op::Wait { name, on, timeout } => {
                let n = cx.number(name, "wait");
                if timeout.is_some() {
                    cx.cannot("waiting for an input with a time limit");
                }
                self.out.line(cx, &format!("WAIT IO[{n}] = {}", if on { "ON" } else { "OFF" }));
            }
            Op::Dwell(s) => self.out.line(cx, &format!("DELAY {}", num(s * 1000.0, 0))),
            Op::Message(text) => {
                let text = cx.ascii(text).replace('"', "'");
                self.out.line(cx, &format!("PRINTMSG \"{text}\", 1, \"program\""));
            }
            Op::Pause => self.out.line(cx, "STOP"),
        }
    }
}
