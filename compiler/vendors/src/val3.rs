//! Stäubli VAL3 (CS8, CS9): a folder with project, data and programs, all XML.
//!
//! Joint moves are joint values; straight moves and arcs keep the configuration they start with (`ssame` …), so no
//! configuration need be said.

use crate::name::{Names, Rule};
use crate::number::{down, num};
use crate::parts::Parts;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, World, any_error, walk, wrapped};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};
use std::collections::BTreeMap;
use std::fmt::Write;

pub(crate) struct Val3;

static TRAITS: Traits = Traits { title: "Stäubli VAL3", arms: Arms::Spherical, world: World::Shoulder, external: true, arcs: true, trailing: true, unverified: "" };

const RESERVED: &[&str] = &[
    "AND", "BEGIN", "BOOL", "BREAK", "CALL", "CASE", "CONFIG", "DEFAULT", "DO", "ELSE", "ELSEIF", "END", "ENDFOR", "ENDIF", "ENDSWITCH",
    "ENDWHILE", "FALSE", "FLANGE", "FOR", "FRAME", "GLOBAL", "IF", "JOINT", "LOCAL", "MDESC", "NOT", "NUM", "OR", "POINT", "RETURN",
    "START", "STEP", "STOP", "STRING", "SWITCH", "THEN", "TO", "TOOL", "TRSF", "TRUE", "UNTIL", "WHILE", "WORLD", "XOR", "POINTS",
    "JOINTS", "SPEEDS", "DOUT", "DIN", "AOUT",
];

const LINES: u64 = 3000;

impl Language for Val3 {
    fn id(&self) -> &'static str {
        "val3"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 13, reserved: RESERVED, upper: false });
        let project = names.give(&program.name, "p");
        let tools: Vec<String> = program.tools.iter().map(|t| names.give(&t.name, "t")).collect();
        let frames: Vec<String> = program.frames.iter().map(|f| names.give(&f.name, "f")).collect();
        let limits = &program.machine.cell.controller;
        let mut w = Writer {
            parts: Parts::new(limits.lines.unwrap_or(LINES), limits.points, limits.bytes, "\n"),
            tools,
            frames,
            points: String::new(),
            joints: String::new(),
            counts: [0; 2],
            speeds: BTreeMap::new(),
            signals: Default::default(),
            angles: [0.0; 3],
            moving: false,
        };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            out.files = w.files(&project, program);
        }
        out
    }
}

struct Writer {
    parts: Parts,
    tools: Vec<String>,
    frames: Vec<String>,
    points: String,
    joints: String,
    counts: [usize; 2],
    /// Motion descriptors, by text.
    speeds: BTreeMap<String, usize>,
    /// Outputs, inputs, analog outputs: by link.
    signals: [Vec<String>; 3],
    angles: [f64; 3],
    /// Moves may still be on their way.
    moving: bool,
}

const XML: &str = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n";

impl Writer {
    fn files(self, project: &str, program: &RobotProgram) -> Vec<OutputFile> {
        let data = self.data(program);
        let parts = self.parts.finish();
        let routines: Vec<String> = (1..=parts.len()).map(|i| format!("part{i}")).collect();
        let mut start = String::from("  resetMotion()\n");
        let mut files = Vec::new();
        if let [one] = parts.as_slice() {
            start += one;
        } else {
            for (name, text) in routines.iter().zip(&parts) {
                start += &format!("  call {name}()\n");
                files.push(OutputFile::new(format!("{project}/{name}.pgx"), code(name, text)));
            }
        }
        start += "  waitEndMove()\n";
        let mut list: String = ["start", "stop"].iter().map(|n| format!("    <Program file=\"{n}.pgx\" />\n")).collect();
        if parts.len() > 1 {
            list.extend(routines.iter().map(|n| format!("    <Program file=\"{n}.pgx\" />\n")));
        }
        files.push(OutputFile::new(format!("{project}/start.pgx"), code("start", &start)));
        files.push(OutputFile::new(format!("{project}/stop.pgx"), code("stop", "  resetMotion()\n")));
        files.push(OutputFile::new(format!("{project}/{project}.dtx"), data));
        let index = format!(
            "{XML}<Project xmlns=\"http://www.staubli.com/robotics/VAL3/Project/3\">\n  \
             <Parameters version=\"s7.10.2\" stackSize=\"5000\" millimeterUnit=\"true\" />\n  <Programs>\n{list}  </Programs>\n  \
             <Database>\n    <Data file=\"{project}.dtx\" />\n  </Database>\n  <Libraries />\n</Project>\n"
        );
        files.push(OutputFile::new(format!("{project}/{project}.pjx"), index));
        files
    }

    fn data(&self, program: &RobotProgram) -> String {
        let mut out = format!(
            "{XML}<Database xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
             xmlns=\"http://www.staubli.com/robotics/VAL3/Data/2\">\n  <Datas>\n"
        );
        for (frame, name) in program.frames.iter().zip(&self.frames) {
            let f = TRAITS.in_control(&program.machine, &frame.frame);
            array(&mut out, name, "frame", 1, &format!("      <Value key=\"0\" {} fatherId=\"world[0]\" />\n", pose(&f, [0.0; 3], 4).0));
        }
        for (tool, name) in program.tools.iter().zip(&self.tools) {
            let value = format!("      <Value key=\"0\" {} fatherId=\"flange[0]\" />\n", pose(&tool.frame, [0.0; 3], 4).0);
            array(&mut out, name, "tool", 1, &value);
        }
        array(&mut out, "points", "pointRx", self.counts[0], &self.points);
        array(&mut out, "joints", "jointRx", self.counts[1], &self.joints);
        let mut speeds: Vec<_> = self.speeds.iter().collect();
        speeds.sort_by_key(|(_, i)| **i);
        let rows: String = speeds.iter().map(|(text, i)| format!("      <Value key=\"{i}\" {text} />\n")).collect();
        array(&mut out, "speeds", "mdesc", speeds.len(), &rows);
        for (links, (name, kind)) in self.signals.iter().zip([("dOut", "dio"), ("dIn", "dio"), ("aOut", "aio")]) {
            let row = |(i, l): (usize, &String)| format!("      <Value key=\"{i}\" link=\"{}\" />\n", escape(l));
            array(&mut out, name, kind, links.len(), &links.iter().enumerate().map(row).collect::<String>());
        }
        out + "  </Datas>\n</Database>\n"
    }

    fn line(&mut self, cx: &Cx, text: &str) {
        if self.parts.full(1) {
            self.parts.cut();
        }
        let remark = cx.remark.map_or(String::new(), |l| format!(" // {l}"));
        self.parts.line(&format!("  {text}{remark}"));
    }

    fn tool(&self, cx: &Cx) -> String {
        self.tools.get(cx.tool).cloned().unwrap_or_else(|| "flange".into())
    }

    fn point(&mut self, cx: &Cx, t: &Target) -> usize {
        let father = self.frames.get(cx.frame).map_or("world", String::as_str);
        let (text, angles) = pose(&orient::frame(t.position, &t.quaternion), self.angles, cx.decimals());
        self.angles = angles;
        let key = self.counts[0];
        let _ = writeln!(
            self.points,
            "      <Value key=\"{key}\" {text} shoulder=\"ssame\" elbow=\"esame\" wrist=\"wsame\" fatherId=\"{father}[0]\" />"
        );
        self.counts[0] += 1;
        self.parts.points(1);
        key
    }

    fn joint(&mut self, cx: &mut Cx, t: &Target, share: f64) {
        let key = self.counts[1];
        let _ = write!(self.joints, "      <Value key=\"{key}\"");
        for (i, v) in cx.degrees(t).iter().enumerate() {
            let _ = write!(self.joints, " j{}=\"{}\"", i + 1, num(*v, 5));
        }
        self.joints.push_str(" />\n");
        self.counts[1] += 1;
        let percent = num((share * 100.0).clamp(0.01, 100.0), 2);
        let speed = self.speed(format!("accel=\"100\" vel=\"{percent}\" decel=\"100\" tmax=\"99999\" rmax=\"99999\" blend=\"off\" leave=\"0\" reach=\"0\""));
        let tool = self.tool(cx);
        self.line(cx, &format!("movej(joints[{key}],{tool},speeds[{speed}])"));
        self.moving = true;
    }

    fn speed(&mut self, text: String) -> usize {
        let next = self.speeds.len();
        *self.speeds.entry(text).or_insert(next)
    }

    fn path(&mut self, speed: f64, zone: Option<f64>) -> usize {
        let blend = match zone.map(down).filter(|r| *r > 0.0) {
            Some(r) => format!("blend=\"Cartesian\" leave=\"{0}\" reach=\"{0}\"", num(r, 6)),
            None => "blend=\"off\" leave=\"0\" reach=\"0\"".into(),
        };
        self.speed(format!("accel=\"100\" vel=\"100\" decel=\"100\" tmax=\"{}\" rmax=\"99999\" {blend}", num(speed, 6)))
    }

    fn signal(&mut self, kind: usize, name: &str) -> usize {
        if let Some(i) = self.signals[kind].iter().position(|n| n == name) {
            return i;
        }
        self.signals[kind].push(name.to_string());
        self.signals[kind].len() - 1
    }

    /// Statements run ahead of the motion: what belongs to a place must wait for it.
    fn arrive(&mut self, cx: &Cx) {
        if self.moving {
            self.line(cx, "waitEndMove()");
            self.moving = false;
        }
    }
}

fn code(name: &str, text: &str) -> String {
    format!(
        "{XML}<Programs xmlns=\"http://www.staubli.com/robotics/VAL3/Program/2\">\n  <Program name=\"{name}\">\n    \
         <Code><![CDATA[begin\n{text}end]]></Code>\n  </Program>\n</Programs>\n"
    )
}

fn array(out: &mut String, name: &str, kind: &str, size: usize, values: &str) {
    if size > 0 {
        let _ = write!(out, "    <Data name=\"{name}\" access=\"private\" xsi:type=\"array\" type=\"{kind}\" size=\"{size}\">\n{values}    </Data>\n");
    }
}

fn pose(frame: &Frame, before: [f64; 3], decimals: usize) -> (String, [f64; 3]) {
    let angles = orient::moving_xyz(&frame.turn, before);
    let (p, r) = (frame.position.map(|v| num(v, decimals)), angles.map(|v| num(v.to_degrees(), 5)));
    let text = format!("x=\"{}\" y=\"{}\" z=\"{}\" rx=\"{}\" ry=\"{}\" rz=\"{}\"", p[0], p[1], p[2], r[0], r[1], r[2]);
    (text, angles)
}

/// Text in XML.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        self.parts.step = cx.step;
        match op {
            Op::Line(number, text) => {
                let text = cx.ascii(text).replace("]]>", "]] >");
                self.line(cx, &format!("// {number}: {text}"));
            }
            Op::Home(t) => self.joint(cx, t, 0.2),
            Op::Joint { to, share, .. } => {
                if !cx.external(to).is_empty() {
                    cx.cannot("external axes");
                }
                self.joint(cx, to, share);
            }
            Op::Linear { to, speed, zone } => {
                let (to, speed, tool) = (self.point(cx, to), self.path(speed, zone), self.tool(cx));
                self.line(cx, &format!("movel(points[{to}],{tool},speeds[{speed}])"));
                self.moving = true;
            }
            Op::Arc { via, to, speed, zone } => {
                let (via, to) = (self.point(cx, via), self.point(cx, to));
                let (speed, tool) = (self.path(speed, zone), self.tool(cx));
                self.line(cx, &format!("movec(points[{via}],points[{to}],{tool},speeds[{speed}])"));
                self.moving = true;
            }
            Op::Probe { .. } => cx.no_probe(),
            Op::Tool(_) | Op::Frame(_) => self.angles = [0.0; 3],
            Op::Set { name, value, .. } => {
                self.arrive(cx);
                match value {
                    Value::Digital(on) => {
                        let i = self.signal(0, name);
                        self.line(cx, &format!("dOut[{i}]={on}"));
                    }
                    Value::Analog(v) => {
                        let i = self.signal(2, name);
                        self.line(cx, &format!("aioSet(aOut[{i}],{})", num(v, 6)));
                    }
                    Value::Group(_) => cx.cannot("a tool number on outputs"),
                }
            }
            Op::Call { name, value } => {
                self.arrive(cx);
                let name = cx.known(name, "routine").to_string();
                self.line(cx, &format!("call {name}({})", value.map_or(String::new(), |v| num(v, 6))));
            }
            Op::Wait { name, on, timeout } => {
                self.arrive(cx);
                let i = self.signal(1, name);
                match timeout {
                    None => self.line(cx, &format!("wait(dIn[{i}]=={on})")),
                    Some(most) => {
                        self.line(cx, &format!("if watch(dIn[{i}]=={on},{})==false", num(most, 3)));
                        let name = cx.ascii(name);
                        self.line(cx, &format!("  popUpMsg(\"{name} did not come\")"));
                        self.line(cx, &format!("  wait(dIn[{i}]=={on})"));
                        self.line(cx, "endIf");
                    }
                }
            }
            Op::Dwell(s) => {
                self.arrive(cx);
                self.line(cx, &format!("delay({})", num(s, 3)));
            }
            Op::Message(text) => {
                self.arrive(cx);
                let text = cx.ascii(text).replace('"', "'").replace("]]>", "]] >");
                for piece in wrapped(&text, 80) {
                    self.line(cx, &format!("popUpMsg(\"{piece}\")"));
                }
            }
            Op::Comment(text) => {
                let text = cx.ascii(text).replace("]]>", "]] >");
                self.line(cx, &format!("// {text}"));
            }
            Op::Pause => cx.cannot("a stop that the operator ends"),
            Op::End => {}
        }
    }
}
