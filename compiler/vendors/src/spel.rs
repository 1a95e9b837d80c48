//! Epson SPEL+: one function. Arcs in space are `Arc3`. Joint moves go to angles.
//!
//! Facts: the *SPEL+ Language Reference*; not run on a controller.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, any_error, walk};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

pub(crate) struct Spel;

static TRAITS: Traits = Traits {
    title: "Epson SPEL+",
    arms: Arms::Any,
    arcs: true,
    trailing: true,
    unverified: "points written within moves, without flags of the arm",
};

impl Language for Spel {
    fn id(&self) -> &'static str {
        "spel"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 32, reserved: &["FUNCTION", "FEND", "GO", "MOVE", "ARC", "ARC3"], upper: false });
        let name = names.give(&program.name, "p");
        let mut w = Writer { out: Lines::new("  ", "'"), angles: [0.0; 3], set: Default::default() };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = format!("Function {name}\r\n  Motor On\r\n{}Fend\r\n", w.out.text);
            out.files = vec![OutputFile::new(format!("{name}.prg"), text)];
        }
        out
    }
}

struct Writer {
    out: Lines,
    angles: [f64; 3],
    /// Path speed and joint speed in force.
    set: [String; 2],
}

impl Writer {
    fn xy(&mut self, frame: &Frame, decimals: usize) -> String {
        let [w, v, u] = orient::fixed_xyz(&frame.turn, self.angles);
        self.angles = [w, v, u];
        let p = frame.position.map(|v| num(v, decimals));
        let a = [u, v, w].map(|v| num(v.to_degrees(), 5));
        format!("XY({},{},{},{},{},{})", p[0], p[1], p[2], a[0], a[1], a[2])
    }

    fn place(&mut self, cx: &Cx, t: &Target) -> String {
        let local = if cx.frame < cx.program.frames.len() { format!("/{}", cx.frame + 1) } else { String::new() };
        self.xy(&orient::frame(t.position, &t.quaternion), cx.decimals()) + &local
    }

    fn put(&mut self, cx: &mut Cx, slot: usize, text: String) {
        if self.set[slot] != text {
            let remark = cx.remark.take();
            self.out.line(cx, &text);
            cx.remark = remark;
            self.set[slot] = text;
        }
    }

    fn joint(&mut self, cx: &mut Cx, t: &Target, share: f64) {
        self.put(cx, 1, format!("Speed {}", num(libm::floor(share * 100.0 + 1e-6).clamp(1.0, 100.0), 0)));
        let values: Vec<String> = cx.degrees(t).iter().map(|v| num(*v, 5)).collect();
        self.out.line(cx, &format!("Go AglToPls({})", values.join(",")));
    }

    fn frame(&mut self, cx: &mut Cx, word: String, frame: &Frame) {
        self.angles = [0.0; 3];
        let text = self.xy(frame, 4);
        self.angles = [0.0; 3];
        self.out.line(cx, &format!("{word}, {text}"));
    }
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        match op {
            Op::Line(number, text) => self.out.remark(cx, &format!("{number}: {text}")),
            Op::Comment(text) => self.out.remark(cx, text),
            Op::Home(t) => self.joint(cx, t, 0.2),
            Op::Joint { to, share, .. } => self.joint(cx, to, share),
            // `CP` joins moves without a distance that could be said.
            Op::Linear { to, speed, zone } => {
                self.put(cx, 0, format!("SpeedS {}", single(speed)));
                let to = self.place(cx, to);
                self.out.line(cx, &format!("Move {to}{}", if zone.is_some() { " CP" } else { "" }));
            }
            Op::Arc { via, to, speed, zone } => {
                self.put(cx, 0, format!("SpeedS {}", single(speed)));
                let (via, to) = (self.place(cx, via), self.place(cx, to));
                self.out.line(cx, &format!("Arc3 {via}, {to}{}", if zone.is_some() { " CP" } else { "" }));
            }
            Op::Tool(i) => {
                let frame = cx.program.tools[i].frame;
                self.frame(cx, format!("TLSet {}", i + 1), &frame);
                self.out.line(cx, &format!("Tool {}", i + 1));
            }
            Op::Frame(i) => {
                let frame = cx.program.frames[i].frame;
                self.frame(cx, format!("Local {}", i + 1), &frame);
            }
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.out.line(cx, &format!("{} {n}", if on { "On" } else { "Off" })),
                    Value::Analog(_) | Value::Group(_) => cx.cannot("a number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine").to_string();
                self.out.line(cx, &value.map_or(format!("Call {name}"), |v| format!("Call {name}({})", num(v, 6))));
            }
            Op::Wait { name, on, timeout } => {
                let n = cx.number(name, "wait");
                let open = if on { "On" } else { "Off" };
                let most = timeout.map_or(String::new(), |t| format!(", {}", num(t, 3)));
                self.out.line(cx, &format!("Wait Sw({n}) = {open}{most}"));
                if timeout.is_some() {
                    self.out.line(cx, "If TW = True Then Pause");
                }
            }
            Op::Dwell(s) => self.out.line(cx, &format!("Wait {}", num(s, 3))),
            Op::Message(text) => {
                let text = cx.ascii(text).replace('"', "'");
                self.out.line(cx, &format!("Print \"{text}\""));
            }
            Op::Pause => self.out.line(cx, "Pause"),
            Op::End => {}
        }
    }
}
