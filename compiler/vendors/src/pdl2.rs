//! Comau PDL2: one program, its positions in the moves. Speeds are m/s.
//!
//! Facts: public post processors; not run on a controller. Joint moves are joint positions, straight moves name the
//! turns T1 T2 T3 as zero, which a straight move does not heed.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::plain::{Plain, corner, joints, one_file, per_cent, six};
use crate::walk::{Arms, Cx, Traits, World};
use crate::{Language, Options, Output, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

pub(crate) struct Pdl2;

static TRAITS: Traits = Traits {
    title: "Comau PDL2",
    arms: Arms::Any,
    world: World::Foot,
    external: true,
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
        let writer = Writer { out: Lines::new("  ", "--"), angles: [0.0; 3], set: [String::new(), String::new(), String::new()] };
        let file = format!("{name}.pdl");
        one_file((program, sources, options), &TRAITS, &names, writer, file, |w| format!("PROGRAM {name}\r\nBEGIN\r\n{}END {name}\r\n", w.out.text))
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
        format!("POS({},'{configuration}')", six(frame.position, decimals, self.angles))
    }

    fn place(&mut self, cx: &Cx, t: &Target) -> String {
        let p = cx.posture(t);
        let letters = [(p.behind, "S "), (!p.forward, "E "), (t.joints[4] < 0.0, "W ")];
        let text: String = letters.iter().filter(|l| l.0).map(|l| l.1).collect();
        self.pos(&orient::frame(t.position, &t.quaternion), cx.decimals(), &format!("{text}T1:0 T2:0 T3:0"))
    }

    /// Speed and fly distance; what the move says before and behind it when it flies by.
    fn path(&mut self, cx: &mut Cx, speed: f64, zone: Option<f64>) -> [&'static str; 2] {
        self.out.setting(cx, &mut self.set[0], format!("$LIN_SPD := {}", single(speed / 1000.0)));
        let Some(r) = zone else { return ["", ""] };
        self.out.setting(cx, &mut self.set[1], format!("$FLY_DIST := {}", num(corner(r), 3)));
        ["FLY", " ADVANCE"]
    }

    fn set_frame(&mut self, cx: &mut Cx, variable: &str, frame: &Frame) {
        self.angles = [0.0; 3];
        let text = self.pos(frame, 4, "");
        self.angles = [0.0; 3];
        self.out.line(cx, &format!("{variable} := {text}"));
    }
}

impl Plain for Writer {
    const PAUSE: &'static str = "PAUSE";

    fn out(&mut self) -> &mut Lines {
        &mut self.out
    }
    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64) {
        self.out.setting(cx, &mut self.set[2], format!("$ARM_OVR := {}", per_cent(share)));
        let mut values = cx.degrees(to);
        values.extend(cx.external(to));
        self.out.line(cx, &format!("MOVE TO {{{}}}", joints(&values)));
        self.out.setting(cx, &mut self.set[2], "$ARM_OVR := 100".into());
    }
    fn linear(&mut self, cx: &mut Cx, to: &Target, speed: f64, zone: Option<f64>) {
        let [fly, advance] = self.path(cx, speed, zone);
        let to = self.place(cx, to);
        self.out.line(cx, &format!("MOVE{fly} LINEAR TO {to}{advance}"));
    }
    fn arc(&mut self, cx: &mut Cx, via: &Target, to: &Target, speed: f64, zone: Option<f64>) {
        let [fly, advance] = self.path(cx, speed, zone);
        let (via, to) = (self.place(cx, via), self.place(cx, to));
        self.out.line(cx, &format!("MOVE{fly} CIRCULAR TO {to} VIA {via}{advance}"));
    }
    fn tool(&mut self, cx: &mut Cx, _: usize, frame: &Frame) {
        self.set_frame(cx, "$TOOL", frame);
    }
    fn frame(&mut self, cx: &mut Cx, _: usize, frame: &Frame) {
        self.set_frame(cx, "$UFRAME", frame);
    }
    fn digital(number: u32, on: bool) -> String {
        format!("$DOUT[{number}] := {}", if on { "ON" } else { "OFF" })
    }
    fn analog(number: u32, value: f64) -> Option<String> {
        Some(format!("$AOUT[{number}] := {}", num(value, 3)))
    }
    fn call(name: &str, value: Option<String>) -> String {
        value.map_or(name.to_string(), |v| format!("{name}({v})"))
    }
    fn waits(number: u32, on: bool) -> String {
        format!("WAIT FOR $DIN[{number}] = {}", if on { "ON" } else { "OFF" })
    }
    fn dwell(seconds: f64) -> String {
        format!("DELAY {}", num(seconds * 1000.0, 0))
    }
    fn message(text: &str) -> Option<String> {
        Some(format!("WRITE ('{}', NL)", text.replace('\'', "\"")))
    }
}
