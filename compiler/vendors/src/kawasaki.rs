//! Kawasaki AS: one program, its positions in the moves. Joint moves are joint values.
//!
//! Facts: public post processors and the *AS Language Reference*; not run on a controller.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::plain::{Plain, corner, joints, one_file, six};
use crate::walk::{Arms, Cx, Traits, World};
use crate::{Language, Options, Output, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

pub(crate) struct Kawasaki;

static TRAITS: Traits = Traits {
    title: "Kawasaki AS",
    arms: Arms::Spherical,
    world: World::Foot,
    external: false,
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
        let writer = Writer { out: Lines::new("  ", ";"), angles: [0.0; 3], set: [String::new(), String::new()] };
        let file = format!("{name}.as");
        one_file((program, sources, options), &TRAITS, &names, writer, file, |w| format!(".PROGRAM {name}()\r\n{}.END\r\n", w.out.text))
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
        format!("TRANS({})", six(frame.position, decimals, self.angles))
    }

    fn place(&mut self, cx: &Cx, t: &Target) -> String {
        self.trans(&orient::frame(t.position, &t.quaternion), cx.decimals())
    }

    fn path(&mut self, cx: &mut Cx, speed: f64, zone: Option<f64>) {
        self.out.setting(cx, &mut self.set[0], format!("SPEED {} MM/S ALWAYS", single(speed)));
        // The least accuracy circle that is known to be taken stands for an exact point.
        let r = zone.map_or(0.0, corner).max(0.001);
        self.out.setting(cx, &mut self.set[1], format!("ACCURACY {} ALWAYS", num(r, 3)));
    }

    fn set_frame(&mut self, cx: &mut Cx, word: &str, frame: &Frame) {
        self.angles = [0.0; 3];
        let text = self.trans(frame, 4);
        self.angles = [0.0; 3];
        self.out.line(cx, &format!("{word} {text}"));
    }
}

impl Plain for Writer {
    const PAUSE: &'static str = "PAUSE";

    fn out(&mut self) -> &mut Lines {
        &mut self.out
    }
    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64) {
        let speed = format!("SPEED {} ALWAYS", num((share * 100.0).clamp(0.01, 100.0), 2));
        self.out.setting(cx, &mut self.set[0], speed);
        self.out.line(cx, &format!("JMOVE #[{}]", joints(&cx.degrees(to))));
    }
    fn linear(&mut self, cx: &mut Cx, to: &Target, speed: f64, zone: Option<f64>) {
        self.path(cx, speed, zone);
        let to = self.place(cx, to);
        self.out.line(cx, &format!("LMOVE {to}"));
    }
    fn arc(&mut self, cx: &mut Cx, via: &Target, to: &Target, speed: f64, zone: Option<f64>) {
        self.path(cx, speed, zone);
        let (via, to) = (self.place(cx, via), self.place(cx, to));
        self.out.line(cx, &format!("C1MOVE {via}"));
        cx.remark = None;
        self.out.line(cx, &format!("C2MOVE {to}"));
    }
    fn tool(&mut self, cx: &mut Cx, _: usize, frame: &Frame) {
        self.set_frame(cx, "TOOL", frame);
    }
    fn frame(&mut self, cx: &mut Cx, _: usize, frame: &Frame) {
        self.set_frame(cx, "BASE", frame);
    }
    fn digital(number: u32, on: bool) -> String {
        format!("SIGNAL {}{number}", if on { "" } else { "-" })
    }
    fn call(name: &str, value: Option<String>) -> String {
        format!("CALL {name}({})", value.unwrap_or_default())
    }
    fn waits(number: u32, on: bool) -> String {
        format!("SWAIT {}{number}", if on { "" } else { "-" })
    }
    fn dwell(seconds: f64) -> String {
        format!("TWAIT {}", num(seconds, 3))
    }
    fn message(text: &str) -> Option<String> {
        Some(format!("PRINT \"{}\"", text.replace('"', "'")))
    }
}
