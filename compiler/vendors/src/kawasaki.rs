//! Kawasaki AS: one program, its positions in the moves. Joint moves are joint values.
//!
//! Facts: public post processors and the *AS Language Reference*; not run on a controller.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, any_error, walk};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

pub(crate) struct Kawasaki;

static TRAITS: Traits = Traits {
    title: "Kawasaki AS",
    arms: Arms::Spherical,
    arcs: true,
    trailing: true,
    unverified: "joint values and transformations within the move instructions",
};

impl Language for Kawasaki {
    fn id(&self) -> &'static str {
        "kawasaki-as"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 15, reserved: &["MAIN", "TOOL", "BASE"], upper: false });
        let name = names.give(&program.name.to_lowercase(), "p");
        let mut w = Writer { out: Lines::new("  ", ";"), angles: [0.0; 3], set: [String::new(), String::new()] };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = format!(".PROGRAM {name}()\r\n{}.END\r\n", w.out.text);
            out.files = vec![OutputFile::new(format!("{name}.as"), text)];
        }
        out
    }
}

struct Writer {
    out: Lines,
    angles: [f64; 3],
    /// Speed and accuracy in force.
    set: [String; 2],
}

impl Writer {
    fn trans(&mut self, frame: &Frame, decimals: usize) -> String {
        self.angles = orient::zyz(&frame.turn, self.angles);
        let (p, a) = (frame.position.map(|v| num(v, decimals)), self.angles.map(|v| num(v.to_degrees(), 5)));
        format!("TRANS({},{},{},{},{},{})", p[0], p[1], p[2], a[0], a[1], a[2])
    }

    fn place(&mut self, cx: &Cx, t: &Target) -> String {
        self.trans(&orient::frame(t.position, &t.quaternion), cx.decimals())
    }

    fn put(&mut self, cx: &mut Cx, slot: usize, text: String) {
        if self.set[slot] != text {
            let remark = cx.remark.take();
            self.out.line(cx, &text);
            cx.remark = remark;
            self.set[slot] = text;
        }
    }

    fn path(&mut self, cx: &mut Cx, speed: f64, zone: Option<f64>) {
        self.put(cx, 0, format!("SPEED {} MM/S ALWAYS", single(speed)));
        // The least accuracy circle that is known to be taken stands for an exact point.
        let r = zone.map_or(0.0, |r| libm::floor(r * 1000.0 + 1e-6) / 1000.0).max(0.001);
        self.put(cx, 1, format!("ACCURACY {} ALWAYS", num(r, 3)));
    }

    fn joint(&mut self, cx: &mut Cx, t: &Target, share: f64) {
        self.put(cx, 0, format!("SPEED {} ALWAYS", num((share * 100.0).clamp(0.01, 100.0), 2)));
        let values: Vec<String> = cx.degrees(t).iter().map(|v| num(*v, 5)).collect();
        self.out.line(cx, &format!("JMOVE #[{}]", values.join(",")));
    }

    fn frame(&mut self, cx: &mut Cx, word: &str, frame: &Frame) {
        self.angles = [0.0; 3];
        let text = self.trans(frame, 4);
        self.angles = [0.0; 3];
        self.out.line(cx, &format!("{word} {text}"));
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
                self.path(cx, speed, zone);
                let to = self.place(cx, to);
                self.out.line(cx, &format!("LMOVE {to}"));
            }
            Op::Arc { via, to, speed, zone } => {
                self.path(cx, speed, zone);
                let (via, to) = (self.place(cx, via), self.place(cx, to));
                self.out.line(cx, &format!("C1MOVE {via}"));
                cx.remark = None;
                self.out.line(cx, &format!("C2MOVE {to}"));
            }
            Op::Tool(i) => {
                let frame = cx.program.tools[i].frame;
                self.frame(cx, "TOOL", &frame);
            }
            Op::Frame(i) => {
                let frame = cx.program.frames[i].frame;
                self.frame(cx, "BASE", &frame);
            }
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.out.line(cx, &format!("SIGNAL {}{n}", if on { "" } else { "-" })),
                    Value::Analog(_) | Value::Group(_) => cx.cannot("a number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine").to_string();
                self.out.line(cx, &format!("CALL {name}({})", value.map_or(String::new(), |v| num(v, 6))));
            }
            Op::Wait { name, on, timeout } => {
                let n = cx.number(name, "wait");
                if timeout.is_some() {
                    cx.cannot("waiting for an input with a time limit");
                }
                self.out.line(cx, &format!("SWAIT {}{n}", if on { "" } else { "-" }));
            }
            Op::Dwell(s) => self.out.line(cx, &format!("TWAIT {}", num(s, 3))),
            Op::Message(text) => {
                let text = cx.ascii(text).replace('"', "'");
                self.out.line(cx, &format!("PRINT \"{text}\""));
            }
            Op::Pause => self.out.line(cx, "PAUSE"),
            Op::End => {}
        }
    }
}
