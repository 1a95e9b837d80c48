//! Adept V+: one program. Joint moves go to precision points, straight moves to locations relative to a frame. The
//! language has no arcs.
//!
//! Facts: *V+ Language User's Guide* and *Reference* (Adept Technology). Not confirmed: how the Adept One counts its
//! joints.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, any_error, walk};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

pub(crate) struct VPlus;

static TRAITS: Traits = Traits {
    title: "Adept V+",
    arms: Arms::Any,
    arcs: false,
    trailing: true,
    unverified: "zero and sense of the arm's joints as the controller counts them",
};

impl Language for VPlus {
    fn id(&self) -> &'static str {
        "vplus"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 15, reserved: &["ALWAYS", "MAIN", "FRAME", "TOOL"], upper: false });
        let name = names.give(&program.name.to_lowercase(), "p");
        let frames = program.frames.iter().map(|f| names.give(&f.name.to_lowercase(), "f")).collect();
        let mut w = Writer { out: Lines::new("        ", ";"), frames, angles: [0.0; 3], speed: String::new() };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = format!(".PROGRAM {name}()\r\n{}        BREAK\r\n.END\r\n", w.out.text);
            out.files = vec![OutputFile::new(format!("{name}.v2"), text)];
        }
        out
    }
}

struct Writer {
    out: Lines,
    frames: Vec<String>,
    angles: [f64; 3],
    speed: String,
}

impl Writer {
    fn trans(&mut self, frame: &Frame, decimals: usize) -> String {
        self.angles = orient::zyz(&frame.turn, self.angles);
        let (p, a) = (frame.position.map(|v| num(v, decimals)), self.angles.map(|v| num(v.to_degrees(), 5)));
        format!("TRANS({},{},{},{},{},{})", p[0], p[1], p[2], a[0], a[1], a[2])
    }

    fn joint(&mut self, cx: &mut Cx, t: &Target, share: f64) {
        self.speed(cx, format!("SPEED {} ALWAYS", num((share * 100.0).clamp(0.01, 100.0), 2)));
        let values: Vec<String> = cx.degrees(t).iter().map(|v| num(*v, 5)).collect();
        self.out.line(cx, &format!("MOVE #PPOINT({})", values.join(",")));
        let remark = cx.remark.take();
        self.out.line(cx, "BREAK");
        cx.remark = remark;
    }

    fn speed(&mut self, cx: &mut Cx, text: String) {
        if self.speed != text {
            let remark = cx.remark.take();
            self.out.line(cx, &text);
            cx.remark = remark;
            self.speed = text;
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
                self.speed(cx, format!("SPEED {} MMPS ALWAYS", single(speed)));
                let decimals = cx.decimals();
                let place = self.trans(&orient::frame(to.position, &to.quaternion), decimals);
                let frame = self.frames.get(cx.frame).map_or(String::new(), |f| format!("{f}:"));
                self.out.line(cx, &format!("MOVES {frame}{place}"));
                // Moves run into each other without a distance that could be said.
                if zone.is_none() {
                    cx.remark = None;
                    self.out.line(cx, "BREAK");
                }
            }
            Op::Arc { .. } => {}
            Op::Tool(i) => {
                self.angles = [0.0; 3];
                let text = self.trans(&cx.program.tools[i].frame, 4);
                self.angles = [0.0; 3];
                self.out.line(cx, &format!("TOOL {text}"));
            }
            Op::Frame(i) => {
                self.angles = [0.0; 3];
                let text = self.trans(&cx.program.frames[i].frame, 4);
                self.angles = [0.0; 3];
                let name = self.frames[i].clone();
                self.out.line(cx, &format!("SET {name} = {text}"));
            }
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.out.line(cx, &format!("SIGNAL {}{n}", if on { "" } else { "-" })),
                    Value::Analog(v) => self.out.line(cx, &format!("AIO.OUT {n} = {}", num(v, 6))),
                    Value::Group(_) => cx.cannot("a tool number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine").to_string();
                self.out.line(cx, &format!("CALL {name}({})", value.map_or(String::new(), |v| num(v, 6))));
            }
            Op::Wait { name, on, timeout } => {
                let input = format!("SIG({}{})", if on { "" } else { "-" }, cx.number(name, "wait"));
                match timeout {
                    None => self.out.line(cx, &format!("WAIT {input}")),
                    Some(most) => {
                        self.out.line(cx, "TIMER 1 = 0");
                        self.out.line(cx, &format!("WAIT {input} OR (TIMER(1) > {})", num(most, 3)));
                        self.out.line(cx, &format!("IF NOT {input} THEN"));
                        self.out.line(cx, "  PAUSE");
                        self.out.line(cx, "END");
                    }
                }
            }
            Op::Dwell(s) => self.out.line(cx, &format!("DELAY {}", num(s, 3))),
            Op::Message(text) => {
                let text = cx.ascii(text).replace('"', "'");
                self.out.line(cx, &format!("TYPE \"{text}\""));
            }
            Op::Pause => self.out.line(cx, "PAUSE"),
            Op::End => {}
        }
    }
}
