//! Yaskawa INFORM: relative jobs (`.JBI`), positions in user frames; long programs in parts that the first calls.
//!
//! Facts: *NX100 / DX100 Instructions for Communication*, 4.1 "Job data format" and 4.4 "Manipulator type" (RCONF).

use crate::name::{Names, Rule};
use crate::number::{fix, num};
use crate::parts::Parts;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, World, any_error, walk, wrapped};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::{Frame, quaternion_of, turn_of};
use gr_robot::{RobotProgram, Target};
use gr_text::code;
use std::fmt::Write;

pub(crate) struct Inform;

static TRAITS: Traits = Traits { title: "Yaskawa INFORM", arms: Arms::Spherical, world: World::Shoulder, external: false, arcs: true, trailing: false, unverified: "" };

const LINES: u64 = 2000;

impl Language for Inform {
    fn id(&self) -> &'static str {
        "inform"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 8, reserved: &[], upper: true });
        let name = names.program(&program.name, "P");
        let limits = &program.machine.cell.controller;
        let mut w = Writer {
            parts: Parts::new(limits.lines.unwrap_or(LINES).saturating_sub(4), limits.points, limits.bytes, "\r\n"),
            positions: String::new(),
            count: 0,
            group: String::new(),
            user: 0,
            closed: Vec::new(),
            angles: [0.0; 3],
            arc: false,
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
    /// `//POS` of the part in work.
    positions: String,
    count: u32,
    /// Tool, user frame and type that the positions so far stand under.
    group: String,
    user: usize,
    closed: Vec<(String, u32, usize)>,
    angles: [f64; 3],
    /// The last motion was an arc.
    arc: bool,
}

impl Writer {
    fn files(mut self, name: &str, names: &mut Names) -> Vec<OutputFile> {
        self.closed.push((std::mem::take(&mut self.positions), self.count, self.user));
        let parts = self.parts.finish();
        if let ([one], [closed]) = (parts.as_slice(), self.closed.as_slice()) {
            return vec![OutputFile::new(format!("{name}.JBI"), whole(name, one, closed))];
        }
        let (mut files, mut main) = (Vec::new(), String::new());
        for (i, (text, closed)) in parts.iter().zip(&self.closed).enumerate() {
            let inner = names.part(name, i + 1);
            let _ = write!(main, "CALL JOB:{inner}\r\n");
            files.push(OutputFile::new(format!("{inner}.JBI"), whole(&inner, text, closed)));
        }
        files.push(OutputFile::new(format!("{name}.JBI"), whole(name, &main, &(String::new(), 0, 0))));
        files
    }

    fn room(&mut self, lines: u64) {
        // Three points of an arc and its start stand in one part.
        if self.parts.full(lines) {
            self.closed.push((std::mem::take(&mut self.positions), self.count, self.user));
            self.parts.cut();
            self.count = 0;
            self.group.clear();
            self.arc = false;
        }
    }

    fn point(&mut self, cx: &mut Cx, t: &Target) -> String {
        let q = cx.degrees(t);
        let p = cx.posture(t);
        if p.behind {
            cx.unverified("which elbow is called upper arm when the arm reaches over backwards");
        }
        if [q[0], q[3], q[5]].iter().any(|v| v.abs() > 360.0) {
            cx.configuration("an axis stands beyond a whole turn".into());
        }
        let far = |v: f64| u8::from(v > 180.0 || v <= -180.0);
        let flip = u8::from(!((-90.0 < q[3] && q[3] <= 90.0) || q[3] > 270.0 || q[3] <= -270.0));
        let (lower, rear) = (u8::from(!p.up()), u8::from(p.behind));
        let group = format!(
            "///TOOL {}\r\n///USER {}\r\n///POSTYPE USER\r\n///RECTAN\r\n///RCONF {flip},{lower},{rear},{},{},{},0,0\r\n",
            cx.tool + 1,
            cx.frame + 1,
            far(q[3]),
            far(q[5]),
            far(q[0])
        );
        if self.group != group {
            self.positions.push_str(&group);
            self.group = group;
        }
        self.user = cx.frame + 1;
        self.angles = orient::fixed_xyz(&turn_of(t.quaternion), self.angles);
        let (x, r) = (t.position.map(|v| fix(v, 3)), self.angles.map(|v| fix(v.to_degrees(), 4)));
        let name = format!("C{:05}", self.count);
        let _ = write!(self.positions, "{name}={},{},{},{},{},{}\r\n", x[0], x[1], x[2], r[0], r[1], r[2]);
        self.count += 1;
        self.parts.points(1);
        name
    }

    fn speed(cx: &mut Cx, speed: f64) -> String {
        let written = libm::round(speed * 10.0) / 10.0;
        if !(0.1..=1500.0).contains(&written) {
            cx.say(code::VENDOR_FEED_RANGE, &[num(speed, 4), "0.1 to 1500 mm/s".into(), TRAITS.title.into()]);
        }
        cx.rounded(speed, written, &format!("V={}", fix(written, 1)));
        fix(written, 1)
    }

    fn flow(cx: &mut Cx, zone: Option<f64>) {
        if zone.is_some() {
            cx.say(code::VENDOR_STOPS_AT_POINTS, &[TRAITS.title.into()]);
        }
    }

    fn remark(&mut self, cx: &mut Cx, text: &str) {
        let text = cx.ascii(text);
        for piece in wrapped(&text, 32) {
            self.room(4);
            self.parts.line(&format!("'{piece}"));
        }
    }

    fn set_by_hand(&mut self, cx: &mut Cx, what: String, frame: &Frame) {
        let r = orient::fixed_xyz(&frame.turn, [0.0; 3]).map(|v| num(v.to_degrees(), 4));
        let p = frame.position.map(|v| num(v, 3));
        let text = format!("X {} Y {} Z {} Rx {} Ry {} Rz {}", p[0], p[1], p[2], r[0], r[1], r[2]);
        self.remark(cx, &format!("{what}: {text}"));
        cx.say(code::VENDOR_SET_BY_HAND, &[what, text]);
    }
}

fn whole(name: &str, text: &str, (positions, count, user): &(String, u32, usize)) -> String {
    let frame = if *user > 0 { format!("///FRAME USER {user}\r\n") } else { String::new() };
    let attributes = if *count > 0 { "SC,RW,RJ" } else { "SC,RW" };
    format!(
        "/JOB\r\n//NAME {name}\r\n//POS\r\n///NPOS {count},0,0,0,0,0\r\n{positions}//INST\r\n///DATE 2000/01/01 00:00\r\n\
         ///ATTR {attributes}\r\n{frame}///GROUP1 RB1\r\nNOP\r\n{text}END\r\n"
    )
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        self.parts.step = cx.step;
        match op {
            Op::Line(number, text) => {
                self.room(12);
                let text: String = format!("{number}: {text}").chars().take(32).collect();
                self.remark(cx, &text);
            }
            Op::Home(t) => {
                let n = self.point(cx, &at_flange(cx, t));
                self.parts.line(&format!("MOVJ {n} VJ=10.00"));
            }
            Op::Joint { to, share, .. } => {
                self.room(6);
                let n = self.point(cx, to);
                let percent = (libm::floor(share * 10000.0 + 1e-6) / 100.0).clamp(0.01, 100.0);
                self.parts.line(&format!("MOVJ {n} VJ={}", fix(percent, 2)));
                self.arc = false;
            }
            Op::Linear { to, speed, zone } => {
                self.room(6);
                let (n, v) = (self.point(cx, to), Self::speed(cx, speed));
                Self::flow(cx, zone);
                self.parts.line(&format!("MOVL {n} V={v} PL=0"));
                self.arc = false;
            }
            Op::Arc { via, to, speed, zone } => {
                self.room(10);
                let v = Self::speed(cx, speed);
                Self::flow(cx, zone);
                // Three MOVC make an arc; a straight step of no length parts it from an arc before it.
                let Some(from) = cx.before else { return };
                if self.arc {
                    let n = self.point(cx, &from);
                    self.parts.line(&format!("MOVL {n} V={v} PL=0"));
                }
                for t in [&from, via, to] {
                    let n = self.point(cx, t);
                    self.parts.line(&format!("MOVC {n} V={v} PL=0"));
                }
                self.arc = true;
            }
            Op::Probe { .. } => cx.no_probe(),
            Op::Tool(i) => {
                self.room(12);
                let tool = &cx.program.tools[i];
                let frame = tool.frame;
                self.set_by_hand(cx, format!("TOOL {}", i + 1), &frame);
            }
            Op::Frame(i) => {
                self.room(12);
                let frame = cx.frame_in_control(i);
                self.set_by_hand(cx, format!("UF {}", i + 1), &frame);
            }
            Op::Set { name, value, word } => {
                self.room(6);
                let n = cx.number(name, word);
                match value {
                    Value::Digital(on) => self.parts.line(&format!("DOUT OT#({n}) {}", if on { "ON" } else { "OFF" })),
                    Value::Analog(v) => {
                        // Volts: the spindle's greatest speed is taken as 10 V.
                        let volts = if word == "S" { 10.0 * cx.share(v, word, name) } else { v };
                        self.parts.line(&format!("AOUT AO#({n}) {}", fix(volts, 2)));
                    }
                    Value::Group(v) => self.parts.line(&format!("DOUT OG#({n}) {v}")),
                }
            }
            Op::Call { name, value } => {
                self.room(6);
                let name = cx.known(name, "routine").to_ascii_uppercase();
                let value = value.map_or(String::new(), |v| format!(" ARGF{}", num(v, 3)));
                self.parts.line(&format!("CALL JOB:{name}{value}"));
            }
            Op::Wait { name, on, timeout } => {
                self.room(6);
                let n = cx.number(name, "wait");
                let (on, off) = if on { ("ON", "OFF") } else { ("OFF", "ON") };
                match timeout {
                    None => self.parts.line(&format!("WAIT IN#({n})={on}")),
                    Some(most) => {
                        self.parts.line(&format!("WAIT IN#({n})={on} T={}", fix(most, 2)));
                        self.parts.line(&format!("PAUSE IF IN#({n})={off}"));
                    }
                }
            }
            Op::Dwell(s) => {
                self.room(6);
                self.parts.line(&format!("TIMER T={}", fix(s, 2)));
            }
            Op::Message(text) => {
                let text = cx.ascii(text);
                for piece in wrapped(&text, 32) {
                    self.room(4);
                    self.parts.line(&format!("MSG \"{}\"", piece.replace('"', "'")));
                }
            }
            Op::Comment(text) => {
                self.room(12);
                self.remark(cx, text);
            }
            Op::Pause => {
                self.room(6);
                self.parts.line("PAUSE");
            }
            Op::End => {}
        }
    }
}

/// The home position as a pose in the frame in use: relative jobs have no joint values.
fn at_flange(cx: &Cx, t: &Target) -> Target {
    let n = cx.machine.joints.len().min(t.joints.len());
    let Ok(flange) = cx.machine.kinematics().forward_frame(&t.joints[..n]) else { return *t };
    let tool = cx.program.tools.get(cx.tool).map(|t| t.frame).unwrap_or_default();
    let frame = cx.program.frames.get(cx.frame).map(|f| f.frame).unwrap_or_default();
    let seen = frame.inverse().then(&flange.then(&tool));
    Target { position: seen.position, quaternion: quaternion_of(&seen.turn), ..*t }
}
