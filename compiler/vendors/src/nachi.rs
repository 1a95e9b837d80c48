//! Nachi robot language (AX, FD): one program, its positions in the moves.
//!
//! Facts: public post processors; not run on a controller. Straight moves and arcs give poses in the robot's own
//! frame, joint moves joint values.

use crate::name::{Names, Rule};
use crate::number::{fix, num};
use crate::parts::Lines;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, World, any_error, walk};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_robot::{RobotProgram, Target};

pub(crate) struct Nachi;

static TRAITS: Traits = Traits {
    title: "Nachi robot language",
    arms: Arms::Spherical,
    world: World::Foot,
    external: false,
    arcs: true,
    trailing: false,
    unverified: "the move instruction's mechanism and pose fields, and the numbers of functions",
};

impl Language for Nachi {
    fn id(&self) -> &'static str {
        "nachi"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 8, reserved: &[], upper: true });
        let name = names.give(&program.name, "P");
        let mut w = Writer { out: Lines::new("", "REM"), angles: [0.0; 3] };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = format!("{}END\r\n", w.out.text);
            out.files = vec![OutputFile::new(format!("{name}-A.txt"), text)];
        }
        out
    }
}

struct Writer {
    out: Lines,
    angles: [f64; 3],
}

impl Writer {
    fn place(&mut self, cx: &Cx, t: &Target) -> String {
        let frame = cx.frame_in_control(cx.frame);
        let seen = frame.then(&orient::frame(t.position, &t.quaternion));
        let [y, p, r] = orient::fixed_xyz(&seen.turn, self.angles);
        self.angles = [y, p, r];
        let x = seen.position.map(|v| num(v, cx.decimals()));
        let a = [r, p, y].map(|v| num(v.to_degrees(), 5));
        format!("({},{},{},{},{},{})", x[0], x[1], x[2], a[0], a[1], a[2])
    }

    fn motion(&mut self, cx: &mut Cx, kind: &str, place: &str, speed: f64, zone: Option<f64>) {
        let written = libm::round(speed * 100.0) / 100.0;
        if written < 0.01 {
            let args = [num(speed, 4), "0.01 mm/s and more".into(), TRAITS.title.into()];
            cx.say(gr_text::code::VENDOR_FEED_RANGE, &args);
        }
        cx.rounded(speed, written, &format!("S={}", fix(written, 2)));
        if zone.is_some() {
            cx.say(gr_text::code::VENDOR_STOPS_AT_POINTS, &[TRAITS.title.into()]);
        }
        let tool = cx.tool + 1;
        self.out.line(cx, &format!("MOVEX A=1P,M1X,{kind},{place},S={},H={tool},MS", fix(written, 2)));
    }

    fn joint(&mut self, cx: &mut Cx, t: &Target, share: f64) {
        let values: Vec<String> = cx.degrees(t).iter().map(|v| num(*v, 5)).collect();
        let percent = num((share * 100.0).clamp(0.1, 100.0), 1);
        let tool = cx.tool + 1;
        self.out.line(cx, &format!("MOVEX A=1P,M1J,P,({}),R={percent},H={tool},MS", values.join(",")));
    }
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        self.out.points(cx, op.points());
        match op {
            Op::Line(number, text) => self.remark(cx, &format!("{number}: {text}")),
            Op::Comment(text) | Op::Message(text) => self.remark(cx, text),
            Op::Home(t) => self.joint(cx, t, 0.2),
            Op::Joint { to, share, .. } => self.joint(cx, to, share),
            Op::Linear { to, speed, zone } => {
                let to = self.place(cx, to);
                self.motion(cx, "L", &to, speed, zone);
            }
            Op::Arc { via, to, speed, zone } => {
                let (via, to) = (self.place(cx, via), self.place(cx, to));
                self.motion(cx, "C1", &via, speed, zone);
                self.motion(cx, "C2", &to, speed, zone);
            }
            Op::Probe { .. } => cx.no_probe(),
            Op::Tool(i) => {
                let p = cx.program.tools[i].frame.position.map(|v| num(v, 3));
                let args = [format!("tool {}", i + 1), format!("X {} Y {} Z {}", p[0], p[1], p[2])];
                cx.say(gr_text::code::VENDOR_SET_BY_HAND, &args);
            }
            Op::Frame(_) | Op::End => {}
            Op::Set { name, value, word } => {
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.out.line(cx, &format!("{}[O{n}]", if on { "SET" } else { "RESET" })),
                    Value::Analog(_) | Value::Group(_) => cx.cannot("a number on outputs"),
                }
            }
            Op::Call { name, value } => {
                let n = cx.number(name, "routine");
                if value.is_some() {
                    cx.no_number();
                }
                self.out.line(cx, &format!("CALLP[{n}]"));
            }
            Op::Wait { name, on, timeout } => {
                let n = cx.number(name, "wait");
                if timeout.is_some() {
                    cx.cannot("waiting for an input with a time limit");
                }
                self.out.line(cx, &format!("{}[I{n}]", if on { "WAITI" } else { "WAITJ" }));
            }
            Op::Dwell(s) => self.out.line(cx, &format!("DELAY[{}]", num(s, 3))),
            Op::Pause => self.out.line(cx, "STOP"),
        }
    }
}

impl Writer {
    fn remark(&mut self, cx: &mut Cx, text: &str) {
        let text = cx.ascii(text).replace('"', "'");
        self.out.line(cx, &format!("REM \"{text}\""));
    }
}
