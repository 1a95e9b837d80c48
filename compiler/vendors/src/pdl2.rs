//! Comau PDL2: one program, its positions in the moves. Speeds are m/s.
//!
//! Facts: public post processors; not run on a controller. Joint moves are joint positions, straight moves name the
//! turns T1 T2 T3 as zero, which a straight move does not heed.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, any_error, walk};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

pub(crate) struct Pdl2;

static TRAITS: Traits = Traits {
    title: "Comau PDL2",
    arms: Arms::Any,
    arcs: true,
    trailing: true,
    unverified: "the configuration text of positions, and that straight moves don't heed it",
};

impl Language for Pdl2 {
    fn id(&self) -> &'static str {
        "pdl2"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 32, reserved: &["PROGRAM", "BEGIN", "END", "VAR", "MOVE", "TO"], upper: false });
        let name = names.give(&program.name.to_lowercase(), "p");
        let mut w = Writer { out: Lines::new("  ", "--"), angles: [0.0; 3], set: [String::new(), String::new(), String::new()] };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = format!("PROGRAM {name}\r\nBEGIN\r\n{}END {name}\r\n", w.out.text);
            out.files = vec![OutputFile::new(format!("{name}.pdl"), text)];
        }
        out
    }
}

struct Writer {
    out: Lines,
    angles: [f64; 3],
    /// Speed, fly distance and joint override in force.
    set: [String; 3],
}

impl Writer {
    fn pos(&mut self, frame: &Frame, decimals: usize, configuration: &str) -> String {
        self.angles = orient::zyz(&frame.turn, self.angles);
        let (p, a) = (frame.position.map(|v| num(v, decimals)), self.angles.map(|v| num(v.to_degrees(), 5)));
        format!("POS({},{},{},{},{},{},'{configuration}')", p[0], p[1], p[2], a[0], a[1], a[2])
    }

    fn place(&mut self, cx: &Cx, t: &Target) -> String {
        let p = cx.posture(t);
        let letters = [(p.behind, "S "), (!p.forward, "E "), (t.joints[4] < 0.0, "W ")];
        let text: String = letters.iter().filter(|l| l.0).map(|l| l.1).collect();
        self.pos(&orient::frame(t.position, &t.quaternion), cx.decimals(), &format!("{text}T1:0 T2:0 T3:0"))
    }

    fn put(&mut self, cx: &mut Cx, slot: usize, text: String) {
        if self.set[slot] != text {
            let remark = cx.remark.take();
            self.out.line(cx, &text);
            cx.remark = remark;
            self.set[slot] = text;
        }
    }

    /// Speed and fly distance; whether the move flies by.
    fn path(&mut self, cx: &mut Cx, speed: f64, zone: Option<f64>) -> bool {
        self.put(cx, 0, format!("$LIN_SPD := {}", single(speed / 1000.0)));
        if let Some(r) = zone {
            self.put(cx, 1, format!("$FLY_DIST := {}", num(libm::floor(r * 1000.0 + 1e-6) / 1000.0, 3)));
        }
        zone.is_some()
    }

    fn joint(&mut self, cx: &mut Cx, t: &Target, share: f64) {
        self.put(cx, 2, format!("$ARM_OVR := {}", num(libm::floor(share * 100.0 + 1e-6).clamp(1.0, 100.0), 0)));
        let values: Vec<String> = cx.degrees(t).iter().chain(&cx.external(t)).map(|v| num(*v, 5)).collect();
        self.out.line(cx, &format!("MOVE TO {{{}}}", values.join(",")));
        let remark = cx.remark.take();
        self.put(cx, 2, "$ARM_OVR := 100".into());
        cx.remark = remark;
    }

    fn frame(&mut self, cx: &mut Cx, variable: &str, frame: &Frame) {
        self.angles = [0.0; 3];
        let text = self.pos(frame, 4, "");
        self.angles = [0.0; 3];
        self.out.line(cx, &format!("{variable} := {text}"));
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
                let fly = if self.path(cx, speed, zone) { ("FLY", " ADVANCE") } else { ("", "") };
                let to = self.place(cx, to);
                self.out.line(cx, &format!("MOVE{} LINEAR TO {to}{}", fly.0, fly.1));
            }
            Op::Arc { via, to, speed, zone } => {
                let fly = if self.path(cx, speed, zone) { ("FLY", " ADVANCE") } else { ("", "") };
                let (via, to) = (self.place(cx, via), self.place(cx, to));
                self.out.line(cx, &format!("MOVE{} CIRCULAR TO {to} VIA {via}{}", fly.0, fly.1));
            }
            Op::Tool(i) => {
                let frame = cx.program.tools[i].frame;
                self.frame(cx, "$TOOL", &frame);
            }
            Op::Frame(i) => {
                let frame = cx.program.frames[i].frame;
                self.frame(cx, "$UFRAME", &frame);
            }
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.out.line(cx, &format!("$DOUT[{n}] := {}", if on { "ON" } else { "OFF" })),
                    Value::Analog(v) => self.out.line(cx, &format!("$AOUT[{n}] := {}", num(v, 3))),
                    Value::Group(_) => cx.cannot("a tool number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine").to_string();
                self.out.line(cx, &value.map_or(name.clone(), |v| format!("{name}({})", num(v, 6))));
            }
            Op::Wait { name, on, timeout } => {
                let n = cx.number(name, "wait");
                if timeout.is_some() {
                    cx.cannot("waiting for an input with a time limit");
                }
                self.out.line(cx, &format!("WAIT FOR $DIN[{n}] = {}", if on { "ON" } else { "OFF" }));
            }
            Op::Dwell(s) => self.out.line(cx, &format!("DELAY {}", num(s * 1000.0, 0))),
            Op::Message(text) => {
                let text = cx.ascii(text).replace('\'', "\"");
                self.out.line(cx, &format!("WRITE ('{text}', NL)"));
            }
            Op::Pause => self.out.line(cx, "PAUSE"),
            Op::End => {}
        }
    }
}
