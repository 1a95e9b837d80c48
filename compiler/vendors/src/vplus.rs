//! Adept V+: one program. Joint moves go to precision points, straight moves to locations relative to a frame. The
//! language has no arcs.
//!
//! Facts: *V+ Language User's Guide* and *Reference* (Adept Technology). Not confirmed: how the Adept One counts its
//! joints.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::plain::{Plain, joints, one_file, six};
use crate::walk::{Arms, Cx, Traits, World};
use crate::{Language, Options, Output, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

pub(crate) struct VPlus;

static TRAITS: Traits = Traits {
    title: "Adept V+",
    arms: Arms::Any,
    world: World::Foot,
    external: false,
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
        let writer = Writer { out: Lines::new("        ", ";"), frames, angles: [0.0; 3], speed: String::new() };
        let file = format!("{name}.v2");
        one_file((program, sources, options), &TRAITS, &names, writer, file, |w| format!(".PROGRAM {name}()\r\n{}        BREAK\r\n.END\r\n", w.out.text))
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
        format!("TRANS({})", six(frame.position, decimals, self.angles))
    }

    fn alone(&mut self, frame: &Frame) -> String {
        self.angles = [0.0; 3];
        let text = self.trans(frame, 4);
        self.angles = [0.0; 3];
        text
    }
}

impl Plain for Writer {
    const PAUSE: &'static str = "PAUSE";

    fn out(&mut self) -> &mut Lines {
        &mut self.out
    }
    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64) {
        let speed = format!("SPEED {} ALWAYS", num((share * 100.0).clamp(0.01, 100.0), 2));
        self.out.setting(cx, &mut self.speed, speed);
        self.out.line(cx, &format!("MOVE #PPOINT({})", joints(&cx.degrees(to))));
        let remark = cx.remark.take();
        self.out.line(cx, "BREAK");
        cx.remark = remark;
    }
    fn linear(&mut self, cx: &mut Cx, to: &Target, speed: f64, zone: Option<f64>) {
        self.out.setting(cx, &mut self.speed, format!("SPEED {} MMPS ALWAYS", single(speed)));
        let place = self.trans(&orient::frame(to.position, &to.quaternion), cx.decimals());
        let frame = self.frames.get(cx.frame).map_or(String::new(), |f| format!("{f}:"));
        self.out.line(cx, &format!("MOVES {frame}{place}"));
        // Moves run into each other without a distance that could be said.
        if zone.is_none() {
            cx.remark = None;
            self.out.line(cx, "BREAK");
        }
    }
    // The walk gives none: the language has no arcs.
    fn arc(&mut self, _: &mut Cx, _: &Target, _: &Target, _: f64, _: Option<f64>) {}
    fn tool(&mut self, cx: &mut Cx, _: usize, frame: &Frame) {
        let text = self.alone(frame);
        self.out.line(cx, &format!("TOOL {text}"));
    }
    fn frame(&mut self, cx: &mut Cx, number: usize, frame: &Frame) {
        let text = self.alone(frame);
        let name = self.frames.get(number).cloned().unwrap_or_default();
        self.out.line(cx, &format!("SET {name} = {text}"));
    }
    fn digital(number: u32, on: bool) -> String {
        format!("SIGNAL {}{number}", if on { "" } else { "-" })
    }
    fn analog(number: u32, value: f64) -> Option<String> {
        Some(format!("AIO.OUT {number} = {}", num(value, 6)))
    }
    fn call(name: &str, value: Option<String>) -> String {
        format!("CALL {name}({})", value.unwrap_or_default())
    }
    fn waits(number: u32, on: bool) -> String {
        format!("WAIT SIG({}{number})", if on { "" } else { "-" })
    }
    fn waits_at_most(number: u32, on: bool, seconds: f64) -> Option<Vec<String>> {
        let input = format!("SIG({}{number})", if on { "" } else { "-" });
        Some(vec![
            "TIMER 1 = 0".into(),
            format!("WAIT {input} OR (TIMER(1) > {})", num(seconds, 3)),
            format!("IF NOT {input} THEN"),
            "  PAUSE".into(),
            "END".into(),
        ])
    }
    fn dwell(seconds: f64) -> String {
        format!("DELAY {}", num(seconds, 3))
    }
    fn message(text: &str) -> Option<String> {
        Some(format!("TYPE \"{}\"", text.replace('"', "'")))
    }
}
