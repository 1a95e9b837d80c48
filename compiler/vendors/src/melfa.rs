//! Mitsubishi MELFA-BASIC: one program with position variables at its end. Arcs are `Mvr` through start, via and end.
//!
//! Facts: *Detailed explanations of functions and operations* (BFP-A8586); structure flags are bits right, above,
//! non-flip. The turn flag FL2 is written as zero: joint moves are joint variables, which need neither.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::plain::{Plain, corner, joints, one_file, six};
use crate::walk::{Arms, Cx, Traits, World};
use crate::{Language, Options, Output, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};
use std::fmt::Write;

pub(crate) struct Melfa;

static TRAITS: Traits = Traits {
    title: "MELFA-BASIC",
    arms: Arms::Any,
    world: World::Foot,
    external: false,
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
        let writer = Writer { out: Lines::new("", "'"), data: String::new(), counts: [0; 2], angles: [0.0; 3], set: Default::default() };
        let file = format!("{name}.prg");
        one_file((program, sources, options), &TRAITS, &names, writer, file, |w| format!("{}End\r\n{}", w.out.text, w.data))
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
        format!("({})", six(frame.position, decimals, self.angles))
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

    fn path(&mut self, cx: &mut Cx, speed: f64, zone: Option<f64>) {
        self.out.setting(cx, &mut self.set[0], format!("Spd {}", single(speed)));
        let text = zone.map_or("Cnt 0".into(), |r| {
            let r = num(corner(r), 3);
            format!("Cnt 1,{r},{r}")
        });
        self.out.setting(cx, &mut self.set[2], text);
    }

    fn set_frame(&mut self, cx: &mut Cx, word: &str, frame: &Frame) {
        self.angles = [0.0; 3];
        let text = self.place(frame, 4);
        self.angles = [0.0; 3];
        self.out.line(cx, &format!("{word} {text}(0,0)"));
    }
}

impl Plain for Writer {
    const PAUSE: &'static str = "Hlt";

    fn out(&mut self) -> &mut Lines {
        &mut self.out
    }
    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64) {
        self.counts[1] += 1;
        let name = format!("J{}", self.counts[1]);
        let _ = write!(self.data, "{name}=({})\r\n", joints(&cx.degrees(to)));
        self.out.setting(cx, &mut self.set[1], format!("JOvrd {}", num((share * 100.0).clamp(1.0, 100.0), 1)));
        self.out.setting(cx, &mut self.set[2], "Cnt 0".into());
        self.out.line(cx, &format!("Mov {name}"));
    }
    fn linear(&mut self, cx: &mut Cx, to: &Target, speed: f64, zone: Option<f64>) {
        self.path(cx, speed, zone);
        let to = self.point(cx, to);
        self.out.line(cx, &format!("Mvs {to}"));
    }
    fn arc(&mut self, cx: &mut Cx, via: &Target, to: &Target, speed: f64, zone: Option<f64>) {
        self.path(cx, speed, zone);
        let Some(from) = cx.before else { return };
        let (from, via, to) = (self.point(cx, &from), self.point(cx, via), self.point(cx, to));
        self.out.line(cx, &format!("Mvr {from},{via},{to}"));
    }
    fn tool(&mut self, cx: &mut Cx, _: usize, frame: &Frame) {
        self.set_frame(cx, "Tool", frame);
    }
    fn frame(&mut self, cx: &mut Cx, _: usize, frame: &Frame) {
        // The controller's base is the robot seen from the work frame.
        self.set_frame(cx, "Base", &frame.inverse());
    }
    fn digital(number: u32, on: bool) -> String {
        format!("M_Out({number})={}", u8::from(on))
    }
    fn call(name: &str, value: Option<String>) -> String {
        value.map_or(format!("CallP \"{name}\""), |v| format!("CallP \"{name}\",{v}"))
    }
    fn waits(number: u32, on: bool) -> String {
        format!("Wait M_In({number})={}", u8::from(on))
    }
    fn dwell(seconds: f64) -> String {
        format!("Dly {}", num(seconds, 3))
    }
}
