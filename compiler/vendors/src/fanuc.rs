//! FANUC TP as ASCII (LS): `/PROG`, `/ATTR`, `/MN`, `/POS`, for R-J3 and R-30 controllers; long programs in parts
//! that the first calls.
//!
//! Facts: layout as in real backups; configuration letters F (fifth joint ≥ 0) or N, U or D, T or B as in the public
//! sources named in the page of this target; turn numbers of J4 J5 J6. A linear move ignores turn numbers; a joint
//! move that needs one is written in joint values.

use crate::name::{Names, Rule};
use crate::number::{fix, num};
use crate::parts::Parts;
use crate::probe::{NOT_READY, NOT_TRIPPED};
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, World, any_error, walk, wrapped};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::{Frame, turn_of};
use gr_robot::{RobotProgram, Target};
use gr_text::code;
use std::fmt::Write;

pub(crate) struct Fanuc;

static TRAITS: Traits = Traits { title: "FANUC TP", arms: Arms::Spherical, world: World::Shoulder, external: true, arcs: true, trailing: false, unverified: "" };

const LINES: u64 = 9999;
/// The position registers that carry frames to the controller.
const REGISTER: usize = 91;

impl Language for Fanuc {
    fn id(&self) -> &'static str {
        "fanuc-ls"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 8, reserved: &[], upper: true });
        let name = names.program(&program.name, "P");
        let limits = &program.machine.cell.controller;
        let mut w = Writer {
            parts: Parts::new(limits.lines.unwrap_or(LINES), limits.points, limits.bytes, "\r\n"),
            points: String::new(),
            point: 0,
            label: 0,
            closed: Vec::new(),
            angles: [0.0; 3],
        };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            out.files = w.files(&name, &mut names);
        }
        out
    }
}

struct Writer {
    parts: Parts,
    /// `/POS` of the part in work.
    points: String,
    point: u32,
    label: u32,
    /// `/POS` and line counts of the parts closed.
    closed: Vec<(String, u64)>,
    angles: [f64; 3],
}

impl Writer {
    fn files(mut self, name: &str, names: &mut Names) -> Vec<OutputFile> {
        let lines = self.parts.lines();
        self.closed.push((std::mem::take(&mut self.points), lines));
        let parts = self.parts.finish();
        if let ([one], [(points, lines)]) = (parts.as_slice(), self.closed.as_slice()) {
            return vec![OutputFile::new(format!("{name}.LS"), whole(name, one, points, *lines))];
        }
        let mut files = Vec::new();
        let mut main = String::new();
        let mut count = 0;
        for (i, (text, (points, lines))) in parts.iter().zip(&self.closed).enumerate() {
            let inner = names.part(name, i + 1);
            count += 1;
            let _ = write!(main, "{count:4}:  CALL {inner}    ;\r\n");
            files.push(OutputFile::new(format!("{inner}.LS"), whole(&inner, text, points, *lines)));
        }
        files.push(OutputFile::new(format!("{name}.LS"), whole(name, &main, "", count)));
        files
    }

    fn line(&mut self, text: &str) {
        let n = self.parts.lines() + 1;
        let _ = write!(self.parts.text, "{n:4}:{text} ;");
        self.parts.end_line();
    }

    fn room(&mut self, lines: u64) {
        if self.parts.full(lines) {
            self.closed.push((std::mem::take(&mut self.points), self.parts.lines()));
            self.parts.cut();
            self.point = 0;
        }
    }

    fn begin_point(&mut self, cx: &Cx) -> u32 {
        self.point += 1;
        self.parts.points(1);
        let _ = write!(self.points, "P[{}]{{\r\n   GP1:\r\n\tUF : {}, UT : {},\t", self.point, cx.frame + 1, cx.tool + 1);
        self.point
    }

    fn external(&mut self, cx: &Cx, t: &Target) {
        let values = cx.external(t);
        for (i, (v, e)) in values.iter().zip(&cx.machine.cell.external).enumerate() {
            let unit = if e.joint.kind == gr_machine::JointKind::Revolute { "deg" } else { " mm" };
            let _ = write!(self.points, "{}E{}={:>10} {unit}", if i == 0 { ",\r\n\t" } else { ",\t" }, i + 1, fix(*v, 3));
        }
        self.points.push_str("\r\n};\r\n");
    }

    fn joint_point(&mut self, cx: &Cx, t: &Target) -> u32 {
        let n = self.begin_point(cx);
        self.points.push_str("\r\n");
        let values = cx.degrees(t);
        for (i, v) in values.iter().enumerate() {
            let end = if i + 1 == values.len() { "" } else if i % 3 == 2 { ",\r\n" } else { "," };
            let _ = write!(self.points, "\tJ{}={:>10} deg{end}", i + 1, fix(*v, 3));
        }
        self.external(cx, t);
        n
    }

    fn pose_point(&mut self, cx: &mut Cx, t: &Target) -> u32 {
        let n = self.begin_point(cx);
        let (q, p) = (cx.degrees(t), cx.posture(t));
        let turn = |v: f64| libm::floor((v + 180.0) / 360.0) as i32;
        let (f, u, b) = (if q[4] < 0.0 { 'N' } else { 'F' }, if p.up() { 'U' } else { 'D' }, if p.behind { 'B' } else { 'T' });
        let _ = write!(self.points, "\tCONFIG : '{f} {u} {b}, {}, {}, {}',\r\n", turn(q[3]), turn(q[4]), turn(q[5]));
        self.angles = orient::fixed_xyz(&turn_of(t.quaternion), self.angles);
        let (x, w) = (t.position, self.angles.map(f64::to_degrees));
        let row = |out: &mut String, names: [&str; 3], unit: &str, v: [f64; 3], end: &str| {
            for i in 0..3 {
                let stop = if i < 2 { ",\t" } else { end };
                let _ = write!(out, "{}{} ={:>10} {unit}{stop}", if i == 0 { "\t" } else { "" }, names[i], fix(v[i], 3));
            }
        };
        row(&mut self.points, ["X", "Y", "Z"], " mm", x, ",\r\n");
        row(&mut self.points, ["W", "P", "R"], "deg", w, "");
        self.external(cx, t);
        n
    }

    /// Sets a frame of the controller from the program, through a position register.
    fn set_frame(&mut self, variable: &str, register: usize, frame: &Frame) {
        let angles = orient::fixed_xyz(&frame.turn, [0.0; 3]).map(f64::to_degrees);
        self.line(&format!("  PR[{register}]=LPOS-LPOS   "));
        for (i, v) in frame.position.iter().chain(&angles).enumerate() {
            let (v, negative) = (v.abs(), fix(*v, 3).starts_with('-'));
            let v = if negative { format!("(-{})", fix(v, 3)) } else { fix(v, 3) };
            self.line(&format!("  PR[{register},{}]={v}   ", i + 1));
        }
        self.line(&format!("  {variable}=PR[{register}]   "));
    }
}

fn whole(name: &str, text: &str, points: &str, lines: u64) -> String {
    // Dates are those of no day: equal input gives equal files.
    format!(
        "/PROG  {name}\r\n/ATTR\r\nOWNER\t\t= MNEDITOR;\r\nCOMMENT\t\t= \"gcc-robot\";\r\nPROG_SIZE\t= 0;\r\n\
         CREATE\t\t= DATE 00-01-01  TIME 00:00:00;\r\nMODIFIED\t= DATE 00-01-01  TIME 00:00:00;\r\nFILE_NAME\t= ;\r\n\
         VERSION\t\t= 0;\r\nLINE_COUNT\t= {lines};\r\nMEMORY_SIZE\t= 0;\r\nPROTECT\t\t= READ_WRITE;\r\n\
         TCD:  STACK_SIZE\t= 0,\r\n      TASK_PRIORITY\t= 50,\r\n      TIME_SLICE\t= 0,\r\n      BUSY_LAMP_OFF\t= 0,\r\n      \
         ABORT_REQUEST\t= 0,\r\n      PAUSE_REQUEST\t= 0;\r\nDEFAULT_GROUP\t= 1,*,*,*,*;\r\n\
         CONTROL_CODE\t= 00000000 00000000;\r\n/MN\r\n{text}/POS\r\n{points}/END\r\n"
    )
}

/// The speed term that rounds least, and the speed it stands for. Ranges and steps as in FANUC's manuals.
fn speed_term(cx: &mut Cx, speed: f64) -> String {
    let candidates = [
        (libm::round(speed * 6.0), 1.0 / 6.0, 0, (1.0, 12000.0), "cm/min"),
        (libm::round(speed), 1.0, 0, (1.0, 2000.0), "mm/sec"),
        (libm::round(speed * 600.0 / 25.4), 25.4 / 600.0, 1, (1.0, 47242.0), "inch/min"),
    ];
    let mut best: Option<(f64, f64, String)> = None;
    for (count, unit, decimals, (least, most), name) in candidates {
        let off = (count * unit - speed).abs();
        if count >= least && count <= most && best.as_ref().is_none_or(|b| off < b.0 - 1e-9) {
            let value = if decimals == 1 { fix(count / 10.0, 1) } else { fix(count, 0) };
            best = Some((off, count * unit, format!("{value}{name}")));
        }
    }
    match best {
        Some((_, written, text)) => {
            cx.rounded(speed, written, &text);
            text
        }
        None => {
            let range = "0.1 inch/min to 2000 mm/s";
            cx.say(code::VENDOR_FEED_RANGE, &[num(speed, 4), range.into(), TRAITS.title.into()]);
            "1mm/sec".into()
        }
    }
}

fn stop(zone: Option<f64>) -> &'static str {
    // CNT is no distance. CNT0 keeps to the point, and the tool need not stand still.
    if zone.is_some() { "CNT0" } else { "FINE" }
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        self.parts.step = cx.step;
        match op {
            Op::Line(number, text) => {
                self.room(8);
                let text = cx.ascii(text);
                let text: String = format!("{number}: {text}").chars().take(32).collect();
                self.line(&format!("  !{}", text.trim_end().replace(';', ",")));
            }
            Op::Home(t) => self.start(cx, t),
            Op::Joint { to, share, zone } => {
                self.room(4);
                let q = cx.degrees(to);
                let turned = [q[0], q[3], q[4], q[5]].iter().any(|v| v.abs() > 179.0);
                let n = if turned { self.joint_point(cx, to) } else { self.pose_point(cx, to) };
                let percent = libm::floor(share * 100.0 + 1e-6).clamp(1.0, 100.0);
                self.line(&format!("J P[{n}] {percent:.0}% {}   ", stop(zone)));
            }
            Op::Linear { to, speed, zone } => {
                self.room(4);
                let n = self.pose_point(cx, to);
                let speed = speed_term(cx, speed);
                self.line(&format!("L P[{n}] {speed} {}   ", stop(zone)));
            }
            Op::Arc { via, to, speed, zone } => {
                self.room(4);
                let (via, to) = (self.pose_point(cx, via), self.pose_point(cx, to));
                let speed = speed_term(cx, speed);
                self.line(&format!("C P[{via}]    \r\n    :  P[{to}] {speed} {}   ", stop(zone)));
            }
            Op::Probe { to, speed, input, on, must } => self.probe(cx, (to, speed), input, on, must),
            Op::Tool(i) => {
                self.room(4);
                self.line(&format!("  UTOOL_NUM={}", i + 1));
            }
            Op::Frame(i) => {
                self.room(4);
                self.line(&format!("  UFRAME_NUM={}", i + 1));
            }
            Op::Set { name, value, word } => {
                self.room(4);
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.line(&format!("  DO[{n}]={}", if on { "ON" } else { "OFF" })),
                    Value::Analog(v) => self.line(&format!("  AO[{n}]={}", num(v, 3))),
                    Value::Group(v) => self.line(&format!("  GO[{n}]={v}")),
                }
            }
            Op::Call { name, value } => {
                self.room(4);
                let name = cx.known(name, "routine").to_ascii_uppercase();
                let value = value.map_or(String::new(), |v| format!("({})", num(v, 3)));
                self.line(&format!("  CALL {name}{value}   "));
            }
            Op::Wait { name, on, timeout } => self.wait(cx, name, on, timeout),
            Op::Dwell(s) => {
                self.room(4);
                self.line(&format!("  WAIT {:>6}(sec)", fix(s, 2)));
            }
            Op::Message(text) => {
                let text = cx.ascii(text);
                for piece in wrapped(&text, 24) {
                    self.room(4);
                    self.line(&format!("  MESSAGE[{}]", piece.replace([';', ']'], ",")));
                }
            }
            Op::Comment(text) => {
                let text = cx.ascii(text);
                for piece in wrapped(&text, 32) {
                    self.room(4);
                    self.line(&format!("  !{}", piece.replace(';', ",")));
                }
            }
            Op::Pause => {
                self.room(4);
                self.line("  PAUSE");
            }
            Op::End => {}
        }
    }
}

impl Writer {
    /// Frames and tools are set before the first move: a position names the numbers it stands under, and they must
    /// be in use.
    fn start(&mut self, cx: &mut Cx, home: &Target) {
        if cx.program.frames.len() > 9 || cx.program.tools.len() > 10 {
            cx.cannot("more than 9 frames or 10 tools");
        }
        for (i, tool) in cx.program.tools.iter().enumerate().take(10) {
            self.set_frame(&format!("UTOOL[{}]", i + 1), REGISTER + 1, &tool.frame);
        }
        for (i, frame) in cx.program.frames.iter().enumerate().take(9) {
            self.set_frame(&format!("UFRAME[{}]", i + 1), REGISTER, &TRAITS.in_control(cx.machine, &frame.frame));
        }
        self.line("  UFRAME_NUM=1");
        self.line("  UTOOL_NUM=1");
        let n = self.joint_point(cx, home);
        self.line(&format!("J P[{n}] 20% FINE   "));
    }

    /// Ends the program with a message unless the input has this state.
    fn demand(&mut self, input: u32, on: bool, message: &str) {
        self.label += 1;
        let go = self.label;
        self.line(&format!("  IF DI[{input}]={},JMP LBL[{go}]   ", if on { "ON" } else { "OFF" }));
        self.line(&format!("  MESSAGE[{message}]"));
        self.line("  ABORT");
        self.line(&format!("  LBL[{go}]   "));
    }

    /// Where the skip leads is the next line in any case: what came of it is read from the input.
    fn probe(&mut self, cx: &mut Cx, (to, speed): (&Target, f64), input: &str, on: bool, must: bool) {
        self.room(16);
        let input = cx.number(input, "G38");
        self.demand(input, !on, NOT_READY);
        self.label += 1;
        let after = self.label;
        self.line(&format!("  SKIP CONDITION DI[{input}]={}   ", if on { "ON" } else { "OFF" }));
        let n = self.pose_point(cx, to);
        let speed = speed_term(cx, speed);
        self.line(&format!("L P[{n}] {speed} FINE Skip,LBL[{after}]   "));
        self.line(&format!("  LBL[{after}]   "));
        if must {
            self.demand(input, on, NOT_TRIPPED);
        }
    }

    fn wait(&mut self, cx: &mut Cx, name: &str, on: bool, timeout: Option<f64>) {
        self.room(16);
        let input = format!("DI[{}]={}", cx.number(name, "wait"), if on { "ON" } else { "OFF" });
        let Some(most) = timeout else { return self.line(&format!("  WAIT {input}   ")) };
        let (late, go) = (self.label + 1, self.label + 2);
        self.label += 2;
        self.line(&format!("  $WAITTMOUT={}   ", num((most * 100.0).max(1.0), 0)));
        self.line(&format!("  WAIT {input} TIMEOUT,LBL[{late}]   "));
        self.line(&format!("  JMP LBL[{go}]   "));
        self.line(&format!("  LBL[{late}]   "));
        self.line("  PAUSE");
        self.line(&format!("  LBL[{go}]   "));
    }
}
