//! DELMIA V5 upload: one XML file of robot activities with joint targets in degrees and meters, for *Import Robot
//! Program*. S. N. Rea Minango (UFSC 2016) loads his simulations so.
//!
//! `JointTarget` is as the V5 online help describes it; the elements around it follow public programs that read such
//! files. The schema itself (`Upload.xsd`) is not public.

use crate::name::{Names, Rule};
use crate::number::{fix, num};
use crate::val3::escape;
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, World, any_error, walk};
use crate::{Language, Options, Output, OutputFile, orient};
use gr_ir::Sources;
use gr_machine::JointKind;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};
use std::collections::BTreeMap;
use std::fmt::Write;

pub(crate) struct Delmia;

static TRAITS: Traits = Traits {
    title: "DELMIA XML",
    arms: Arms::Any,
    world: World::Foot,
    external: true,
    arcs: true,
    trailing: false,
    unverified: "the schema of the upload is not public; joint targets are as the V5 help describes them",
};

impl Language for Delmia {
    fn id(&self) -> &'static str {
        "delmia-xml"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 60, reserved: &[], upper: false });
        let name = names.give(&program.name, "p");
        let mut w = Writer { text: String::new(), count: 0, motions: BTreeMap::new(), accuracies: BTreeMap::new(), angles: [0.0; 3] };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            names.tell(&mut out, TRAITS.title);
            let text = w.whole(&name, program);
            out.files = vec![OutputFile::new(format!("{name}.xml"), text)];
        }
        out
    }
}

struct Writer {
    text: String,
    count: usize,
    /// Motion profiles: speed as text → name.
    motions: BTreeMap<String, String>,
    /// Accuracy profiles: zone as text → name.
    accuracies: BTreeMap<String, String>,
    angles: [f64; 3],
}

impl Writer {
    fn whole(self, name: &str, program: &RobotProgram) -> String {
        let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<OLPData>\n");
        let robot = escape(&program.machine.title);
        let _ = write!(out, "  <Resource ResourceType=\"Robot\" ResourceName=\"{robot}\">\n    <Controller>\n      <ToolProfileList>\n");
        for t in &program.tools {
            let pose = pose(&t.frame, [0.0; 3]).0;
            let _ = write!(out, "        <ToolProfile><Name>{}</Name><ToolType>OnRobot</ToolType><TCPOffset>{pose}</TCPOffset></ToolProfile>\n", escape(&t.name));
        }
        out += "      </ToolProfileList>\n      <MotionProfileList>\n";
        for (text, name) in sorted(&self.motions) {
            let _ = write!(out, "        <MotionProfile><Name>{name}</Name>{text}</MotionProfile>\n");
        }
        out += "      </MotionProfileList>\n      <AccuracyProfileList>\n";
        for (text, name) in sorted(&self.accuracies) {
            let _ = write!(out, "        <AccuracyProfile><Name>{name}</Name>{text}</AccuracyProfile>\n");
        }
        out += "      </AccuracyProfileList>\n      <ObjectFrameProfileList>\n";
        for f in &program.frames {
            let pose = pose(&TRAITS.in_control(&program.machine, &f.frame), [0.0; 3]).0;
            let _ = write!(
                out,
                "        <ObjectFrameProfile><Name>{}</Name><ObjectFrame>{pose}</ObjectFrame></ObjectFrameProfile>\n",
                escape(&f.name)
            );
        }
        let _ = write!(
            out,
            "      </ObjectFrameProfileList>\n    </Controller>\n    <ActivityList Task=\"{name}\">\n{}    </ActivityList>\n  </Resource>\n</OLPData>\n",
            self.text
        );
        out
    }

    fn profile(table: &mut BTreeMap<String, String>, text: String, prefix: &str) -> String {
        let next = format!("{prefix}.{}", table.len() + 1);
        table.entry(text).or_insert(next).clone()
    }

    fn activity(&mut self, kind: &str, name: &str, inner: &str) {
        self.count += 1;
        let _ = write!(
            self.text,
            "      <Activity ActivityType=\"{kind}\" Operation=\"Operation.{0}\">\n        <ActivityName>{name}.{0}</ActivityName>\n{inner}      </Activity>\n",
            self.count
        );
    }

    fn motion(&mut self, cx: &Cx, kind: &str, t: &Target, profile: &str, zone: Option<f64>) {
        let (value, fly) = zone.map_or(("0".to_string(), "Off"), |r| (num(libm::floor(r * 1e5 + 1e-6) / 1e8, 9), "On"));
        let accuracy = format!("<FlyByMode>{fly}</FlyByMode><AccuracyType>Distance</AccuracyType><AccuracyValue Units=\"m\">{value}</AccuracyValue>");
        let accuracy = Self::profile(&mut self.accuracies, accuracy, "Accuracy");
        let name = |n: Option<&String>| n.map_or(String::new(), |n| escape(n));
        let tool = name(cx.program.tools.get(cx.tool).map(|t| &t.name));
        let frame = name(cx.program.frames.get(cx.frame).map(|f| &f.name));
        let mut text = format!(
            "        <MotionAttributes><MotionProfile>{profile}</MotionProfile><AccuracyProfile>{accuracy}</AccuracyProfile>\
             <ToolProfile>{tool}</ToolProfile><ObjectFrameProfile>{frame}</ObjectFrameProfile><MotionType>{kind}</MotionType></MotionAttributes>\n\
             \x20       <Target Default=\"Joint\" ViaPoint=\"false\">\n          <JointTarget>\n"
        );
        let n = cx.machine.joints.len();
        let externals = cx.machine.cell.external.iter().map(|e| &e.joint);
        let values = cx.degrees(t).into_iter().chain(cx.external(t));
        for (i, (joint, value)) in cx.machine.joints.iter().chain(externals).zip(values).enumerate() {
            let (unit, sort, value) = match joint.kind {
                JointKind::Revolute => ("deg", "Rotational", fix(value, 6)),
                JointKind::Prismatic => ("m", "Translational", fix(value / 1000.0, 9)),
            };
            let label = if i < n { format!("Joint {}", i + 1) } else { escape(&joint.name) };
            let _ = write!(
                text,
                "            <Joint Units=\"{unit}\" JointName=\"{label}\" JointType=\"{sort}\" DOFNumber=\"{}\"><JointValue>{value}</JointValue></Joint>\n",
                i + 1
            );
        }
        let (pose, angles) = pose(&orient::frame(t.position, &t.quaternion), self.angles);
        self.angles = angles;
        let _ = write!(text, "          </JointTarget>\n          <CartesianTarget>{pose}</CartesianTarget>\n        </Target>\n");
        self.activity("DNBRobotMotionActivity", "RobotMotion", &text);
    }

    fn speed(&mut self, mm: f64) -> String {
        let text = format!("<MotionBasis>Absolute</MotionBasis><Speed Units=\"m/s\">{}</Speed>", num(mm / 1000.0, 9));
        Self::profile(&mut self.motions, text, "Motion")
    }

    fn percent(&mut self, share: f64) -> String {
        let text = format!("<MotionBasis>Percent</MotionBasis><Speed Units=\"%\">{}</Speed>", num(share * 100.0, 6));
        Self::profile(&mut self.motions, text, "Motion")
    }
}

fn sorted(table: &BTreeMap<String, String>) -> Vec<(&String, &String)> {
    let mut rows: Vec<_> = table.iter().collect();
    rows.sort_by_key(|(_, n)| (n.len(), *n));
    rows
}

/// Position in m and turns about Z, Y, X in degrees.
fn pose(frame: &Frame, before: [f64; 3]) -> (String, [f64; 3]) {
    let angles = orient::fixed_xyz(&frame.turn, before);
    let (p, [roll, pitch, yaw]) = (frame.position.map(|v| num(v / 1000.0, 9)), angles.map(|v| num(v.to_degrees(), 6)));
    let text = format!(
        "<Position Units=\"m\" X=\"{}\" Y=\"{}\" Z=\"{}\"/><Orientation Units=\"deg\" Yaw=\"{yaw}\" Pitch=\"{pitch}\" Roll=\"{roll}\"/>",
        p[0], p[1], p[2]
    );
    (text, angles)
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        match op {
            Op::Line(number, text) => {
                let _ = write!(self.text, "      <!-- {number}: {} -->\n", comment(cx, text));
            }
            Op::Comment(text) | Op::Message(text) => {
                let _ = write!(self.text, "      <!-- {} -->\n", comment(cx, text));
            }
            Op::Home(t) => {
                let profile = self.percent(0.2);
                // Seen from the robot itself: at home no frame is in use yet.
                let n = cx.machine.joints.len().min(t.joints.len());
                let mut home = *t;
                if let Ok(flange) = cx.machine.kinematics().forward_frame(&t.joints[..n]) {
                    let tool = cx.program.tools.first().map(|t| t.frame).unwrap_or_default();
                    let frame = cx.program.frames.first().map(|f| f.frame).unwrap_or_default();
                    let seen = frame.inverse().then(&flange.then(&tool));
                    (home.position, home.quaternion) = (seen.position, gr_machine::math::quaternion_of(&seen.turn));
                }
                self.motion(cx, "Joint", &home, &profile, None);
            }
            Op::Joint { to, share, zone } => {
                let profile = self.percent(share);
                self.motion(cx, "Joint", to, &profile, zone);
            }
            Op::Linear { to, speed, zone } => {
                let profile = self.speed(speed);
                self.motion(cx, "Linear", to, &profile, zone);
            }
            Op::Arc { via, to, speed, zone } => {
                let profile = self.speed(speed);
                self.motion(cx, "CircularVia", via, &profile, zone);
                self.motion(cx, "Circular", to, &profile, zone);
            }
            Op::Probe { .. } => cx.no_probe(),
            Op::Tool(_) | Op::Frame(_) => self.angles = [0.0; 3],
            Op::Set { name, value, .. } => {
                let value = match value {
                    Value::Digital(on) => if on { "On" } else { "Off" }.to_string(),
                    Value::Analog(v) => num(v, 6),
                    Value::Group(v) => v.to_string(),
                };
                let text = format!("        <SetIOAttributes><IOSetSignal SignalName=\"{}\" SignalValue=\"{value}\"/></SetIOAttributes>\n", escape(name));
                self.activity("DNBSetSignalActivity", "SetSignal", &text);
            }
            Op::Wait { name, on, timeout } => {
                let most = num(timeout.unwrap_or(0.0), 3);
                let value = if on { "On" } else { "Off" };
                let text = format!("        <WaitIOAttributes><IOWaitSignal MaxWaitTime=\"{most}\" SignalName=\"{}\" SignalValue=\"{value}\"/></WaitIOAttributes>\n", escape(name));
                self.activity("DNBWaitSignalActivity", "WaitSignal", &text);
            }
            Op::Call { name, value } => {
                if value.is_some() {
                    cx.no_number();
                }
                let text = format!("        <CallName>{}</CallName>\n", escape(name));
                self.activity("DNBIgpCallRobotTask", "CallTask", &text);
            }
            Op::Dwell(s) => {
                let text = format!("        <ActivityTime><StartTime Units=\"s\">0</StartTime><EndTime Units=\"s\">{}</EndTime></ActivityTime>\n", num(s, 3));
                self.activity("DelayActivity", "Delay", &text);
            }
            Op::Pause => cx.cannot("a stop that the operator ends"),
            Op::End => {}
        }
    }
}

fn comment(cx: &mut Cx, text: &str) -> String {
    // Two hyphens end a comment in XML.
    cx.ascii(text).replace("--", "- -").trim_end_matches('-').to_string()
}
