//! Mitsubishi MELFA-BASIC: one program with position variables at its end. Arcs are `Mvr` through start, via and end.
//!
//! Facts: *Detailed explanations of functions and operations* (BFP-A8586); structure flags are bits right, above,
//! non-flip. The turn flag FL2 is written as zero: joint moves are joint variables, which need neither.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, any_error, walk};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};
use std::fmt::Write;

pub(crate) struct Melfa;

static TRAITS: Traits = Traits {
    title: "MELFA-BASIC",
    arms: Arms::Any,
    arcs: true,
    trailing: true,
    unverified: "the structure flags of positions",
};

impl Language for Melfa {
    fn id(&self) -> &'static str {
        "melfa"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 12, reserved: &["END", "MOV", "MVS"], upper: true });
        let name = names.give(&program.name, "P");
        let mut w = Writer { out: Lines::new("", "'"), data: String::new(), counts: [0; 2], angles: [0.0; 3], set: Default::default() };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = format!("{}End\r\n{}", w.out.text, w.data);
            out.files = vec![OutputFile::new(format!("{name}.prg"), text)];
        }
        out
    }
}

struct Writer {
    out: Lines,
    data: String,
    /// Position and joint variables.
    counts: [usize; 2],
    angles: [f64; 3],
    /// Speed, joint override and continuity in force.
    set: [String; 3],
}

impl Writer {
    fn place(&mut self, frame: &Frame, decimals: usize) -> String {
        self.angles = orient::fixed_xyz(&frame.turn, self.angles);
        let (p, a) = (frame.position.map(|v| num(v, decimals)), self.angles.map(|v| num(v.to_degrees(), 5)));
        format!("({},{},{},{},{},{})", p[0], p[1], p[2], a[0], a[1], a[2])
    }

    fn point(&mut self, cx: &Cx, t: &Target) -> String {
        self.counts[0] += 1;
        let name = format!("P{}", self.counts[0]);
        let p = cx.posture(t);
        let flags = 4 * u8::from(!p.behind) + 2 * u8::from(p.up()) + u8::from(t.joints[4] >= 0.0);
        let place = self.place(&orient::frame(t.position, &t.quaternion), cx.decimals());
        let _ = write!(self.data, "{name}={place}({flags},0)\r\n");
        name
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
        self.put(cx, 0, format!("Spd {}", single(speed)));
        let text = zone.map_or("Cnt 0".into(), |r| {
            let r = num(libm::floor(r * 1000.0 + 1e-6) / 1000.0, 3);
            format!("Cnt 1,{r},{r}")
        });
        self.put(cx, 2, text);
    }

    fn joint(&mut self, cx: &mut Cx, t: &Target, share: f64) {
        self.counts[1] += 1;
        let name = format!("J{}", self.counts[1]);
        let values: Vec<String> = cx.degrees(t).iter().map(|v| num(*v, 5)).collect();
        let _ = write!(self.data, "{name}=({})\r\n", values.join(","));
        self.put(cx, 1, format!("JOvrd {}", num((share * 100.0).clamp(1.0, 100.0), 1)));
        self.put(cx, 2, "Cnt 0".into());
        self.out.line(cx, &format!("Mov {name}"));
    }

    fn frame(&mut self, cx: &mut Cx, word: &str, frame: &Frame) {
        self.angles = [0.0; 3];
        let text = self.place(frame, 4);
        self.angles = [0.0; 3];
        self.out.line(cx, &format!("{word} {text}(0,0)"));
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
                let to = self.point(cx, to);
                self.out.line(cx, &format!("Mvs {to}"));
            }
            Op::Arc { via, to, speed, zone } => {
                self.path(cx, speed, zone);
                let Some(from) = cx.before else { return };
                let (from, via, to) = (self.point(cx, &from), self.point(cx, via), self.point(cx, to));
                self.out.line(cx, &format!("Mvr {from},{via},{to}"));
            }
            Op::Tool(i) => {
                let frame = cx.program.tools[i].frame;
                self.frame(cx, "Tool", &frame);
            }
            Op::Frame(i) => {
                // The controller's base is the robot seen from the work frame.
                let frame = cx.program.frames[i].frame.inverse();
                self.frame(cx, "Base", &frame);
            }
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.out.line(cx, &format!("M_Out({n})={}", u8::from(on))),
                    Value::Analog(_) | Value::Group(_) => cx.cannot("a number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine").to_string();
                self.out.line(cx, &value.map_or(format!("CallP \"{name}\""), |v| format!("CallP \"{name}\",{}", num(v, 6))));
            }
            Op::Wait { name, on, timeout } => {
                let n = cx.number(name, "wait");
                if timeout.is_some() {
                    cx.cannot("waiting for an input with a time limit");
                }
                self.out.line(cx, &format!("Wait M_In({n})={}", u8::from(on)));
            }
            Op::Dwell(s) => self.out.line(cx, &format!("Dly {}", num(s, 3))),
            Op::Message(text) => self.out.remark(cx, text),
            Op::Pause => self.out.line(cx, "Hlt"),
            Op::End => {}
        }
    }
}
