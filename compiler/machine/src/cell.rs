//! What surrounds the joints of a machine: tools, frames, spindle, signals, external axes, controller.

use crate::math::{Frame, about, rotate, scale, sub};
use crate::{Joint, JointKind, short};
use std::collections::BTreeMap;

/// Everything a machine file says besides joints and kinematics.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Cell {
    /// Base of the machine in the cell.
    pub base: Frame,
    /// Table in the base.
    pub table: Frame,
    /// Part on the table.
    pub part: Frame,
    /// The frame its controller counts from (world, robot base), in the base; none = the one usual for its language.
    pub controller_frame: Option<Frame>,
    /// Named frames in the base, for G54 … G59.3 and robot programs.
    pub frames: BTreeMap<String, Frame>,
    /// Tools, by number.
    pub tools: BTreeMap<u32, ToolData>,
    /// Spindle on the flange.
    pub spindle: Option<Spindle>,
    /// Greatest axial depth of a milling cut, mm.
    pub axial_depth: Option<f64>,
    /// Rails and positioners.
    pub external: Vec<External>,
    /// Joint values of the home position, mm or rad.
    pub home: Option<Vec<f64>>,
    /// Two joints that the controller counts together.
    pub coupling: Option<Coupling>,
    /// Limits of the controller's files.
    pub controller: Controller,
    /// What M words do, by word: `M3`, `S`, `M62` … The probe's input is the `wait` of `G38`.
    pub io: BTreeMap<String, Signal>,
    /// How a rapid is made.
    pub rapid: Option<Rapid>,
    /// Speed of a rapid of the tool point, mm/s.
    pub rapid_speed: Option<f64>,
    /// Joint speed of a rapid, per cent of the greatest.
    pub joint_speed: Option<f64>,
    /// Corner zones.
    pub zones: Zones,
    /// How exactly joints and geometry are made; none = not said.
    pub accuracy: Option<crate::Accuracy>,
    /// What yields under force; none = not said.
    pub stiffness: Option<crate::Stiffness>,
    /// Identified deviations of the geometry; none = only the nominal geometry is known.
    pub as_built: Option<crate::AsBuilt>,
}

/// A tool.
#[derive(Clone, PartialEq, Debug)]
pub struct ToolData {
    /// Its name on the controller.
    pub name: String,
    /// Its point and direction in the spindle, or on the flange where there is no spindle. Z of both points away from the part on
    /// machines that are upright ([`crate::Machine::is_upright`]): there a tool of length 60 has −60.
    pub frame: Frame,
    /// Diameter, mm.
    pub diameter: Option<f64>,
    /// Mass, kg.
    pub mass: Option<f64>,
}

/// A spindle.
#[derive(Clone, PartialEq, Debug)]
pub struct Spindle {
    /// Its nose on the flange.
    pub frame: Frame,
    /// Turns per minute.
    pub speed: (Option<f64>, Option<f64>),
    /// Whether the control can switch it.
    pub controlled: bool,
}

/// An axis outside the arm.
#[derive(Clone, PartialEq, Debug)]
pub struct External {
    /// Name, type, limits and speeds.
    pub joint: Joint,
    /// Carries the machine (rail) rather than the part (positioner).
    pub carries_machine: bool,
    /// Unit vector.
    pub axis: [f64; 3],
    /// A point on it, mm.
    pub point: [f64; 3],
    /// Where it stands while a program runs, mm or rad.
    pub position: f64,
    /// Whether the control moves the machine's base with it, so that poses are in a frame that stays; none = not said.
    pub coupled: Option<bool>,
}

impl External {
    /// For the head of a program that doesn't move it, in letters that every controller has.
    pub fn stands(&self) -> String {
        let (name, carried) = (&self.joint.name, if self.carries_machine { "robot" } else { "part" });
        let place = self.joint.show(self.position).replace('°', " degrees");
        format!("{name} carries the {carried}: it must stand at {place} before the start, the program does not move it")
    }
    /// What it does to what it carries.
    fn motion(&self) -> Frame {
        if self.joint.kind == JointKind::Revolute {
            let turn = about(self.axis, self.position);
            Frame { turn, position: sub(self.point, rotate(&turn, self.point)) }
        } else {
            Frame::shift(scale(self.axis, self.position))
        }
    }
}

/// The controller counts a joint together with another: its value = joint + factor · with.
#[derive(Clone, PartialEq, Debug)]
pub struct Coupling {
    /// Index of the joint whose value differs.
    pub joint: usize,
    /// Index of the other.
    pub with: usize,
    /// −1 on FANUC arms, 1 on arms with a parallelogram.
    pub factor: f64,
    /// Least value on the controller; none = the joint's own.
    pub min: Option<f64>,
    /// Greatest value on the controller; none = the joint's own.
    pub max: Option<f64>,
}

/// What a controller's program files may hold.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Controller {
    /// For people: `IRC5`.
    pub name: Option<String>,
    /// Lines per file.
    pub lines: Option<u64>,
    /// Points per file.
    pub points: Option<u64>,
    /// Bytes per file.
    pub bytes: Option<u64>,
}

/// What a word does.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Signal {
    /// Output that is set.
    pub signal: Option<String>,
    /// To this value.
    pub value: Option<f64>,
    /// Routine that is called.
    pub routine: Option<String>,
    /// Input that is waited for.
    pub wait: Option<String>,
    /// For at most or at least this long, s.
    pub seconds: Option<f64>,
}

/// How a rapid is made.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Rapid {
    /// All joints start and stop together.
    Joint,
    /// In a straight line of the tool point.
    Linear,
}

/// Corner zones, mm.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Zones {
    /// Where the program doesn't say.
    pub default: Option<f64>,
    /// Never more.
    pub max: Option<f64>,
}

/// Name of the frame of a robot's machine coordinates.
pub(crate) const MACHINE_ZERO: &str = "G53";

/// The number in a signal's name: `5`, `DO[5]`, `OT#(5)`, `$OUT[5]`, `out_5`.
pub fn signal_number(name: &str) -> Option<u32> {
    let mut groups = name.split(|c: char| !c.is_ascii_digit()).filter(|g| !g.is_empty());
    let (one, more) = (groups.next()?, groups.next());
    if more.is_some() { None } else { one.parse().ok() }
}

impl Cell {
    /// Speed of rapids in a line, mm/s: without one in the file, that of teaching by hand (ISO 10218-1).
    pub fn line_rapid(&self) -> f64 {
        self.rapid_speed.unwrap_or(250.0)
    }
    /// Share of the joints' greatest speed at which joint moves go, above 0 to 1.
    pub fn joint_share(&self) -> f64 {
        (self.joint_speed.unwrap_or(100.0) / 100.0).clamp(0.001, 1.0)
    }
    /// The part's frame in the base.
    pub fn part_in_base(&self) -> Frame {
        self.carried(self.table.then(&self.part))
    }
    /// A frame of the cell as the base sees it while rails and positioners stand where the file says. The file gives
    /// frames for all of them at 0.
    pub fn carried(&self, frame: Frame) -> Frame {
        let part = self.external.iter().rev().filter(|e| !e.carries_machine).fold(frame, |f, e| e.motion().then(&f));
        self.on_rails(|_| true).inverse().then(&part)
    }
    /// The base on some of the rails, where it would be with these at 0.
    fn on_rails(&self, which: impl Fn(&External) -> bool) -> Frame {
        let rails = self.external.iter().filter(|e| e.carries_machine && which(e));
        rails.fold(Frame::IDENTITY, |base, e| base.then(&e.motion()))
    }
    /// A frame in the base as the robot's control counts it: from the controller's frame, `usual` where the file says none, and
    /// where rails are coupled with these at 0.
    pub fn in_control(&self, frame: &Frame, usual: &Frame) -> Frame {
        let mut seen = *frame;
        if self.external.iter().any(|e| e.coupled == Some(true)) {
            seen = self.on_rails(|e| e.coupled == Some(true)).then(&seen);
        }
        let from = self.controller_frame.as_ref().unwrap_or(usual);
        if *from == Frame::IDENTITY { seen } else { from.inverse().then(&seen) }
    }
    /// The zero point of the coordinates that G53, G28 and G30 mean on a robot, in the base, mm: `[[frame]]` `G53`. Rails move the base
    /// away from it, positioners turn the part alone. The directions of these coordinates are the part's.
    pub fn machine_zero(&self) -> Option<[f64; 3]> {
        Some(self.on_rails(|_| true).inverse().apply(self.frames.get(MACHINE_ZERO)?.position))
    }
    /// Tool point on the flange: spindle, then tool. An unknown tool is the spindle's nose.
    pub fn tool_frame(&self, number: u32) -> Frame {
        let nose = self.spindle.as_ref().map_or(Frame::IDENTITY, |s| s.frame);
        self.tools.get(&number).map_or(nose, |t| nose.then(&t.frame))
    }

    /// For people, as in a file; on upright machines Z of tools is put the other way, see [`ToolData::frame`].
    pub(crate) fn describe(&self, joints: &[Joint], upright: bool) -> String {
        let mut out = String::new();
        let frame = |f: &Frame| {
            let p = crate::Pose::from_frame(f);
            let turn = p.rotation.map(|r| short(r.to_degrees())).join(", ");
            format!("{} mm, turned {turn}°", p.position.map(short).join(", "))
        };
        for (name, f) in [("base", &self.base), ("table", &self.table), ("part", &self.part)] {
            if *f != Frame::IDENTITY {
                out += &format!("{name} at {}\n", frame(f));
            }
        }
        if let Some(f) = &self.controller_frame {
            out += &format!("its controller counts from {}\n", frame(f));
        }
        for (name, f) in &self.frames {
            out += &format!("frame {name} at {}\n", frame(f));
        }
        if let Some(s) = &self.spindle {
            let turns = |v: Option<f64>| v.map_or("no limit".into(), short);
            let switch = if s.controlled { "" } else { ", switched by hand" };
            out += &format!("spindle at {}, {} to {} rev/min{switch}\n", frame(&s.frame), turns(s.speed.0), turns(s.speed.1));
        }
        for (number, t) in &self.tools {
            let [x, y, z] = t.frame.position;
            let told = Frame { position: [x, y, if upright { -z + 0.0 } else { z }], ..t.frame };
            out += &format!("tool {number} {}: point at {}\n", t.name, frame(&told));
        }
        for e in &self.external {
            let limit = |v: Option<f64>| v.map_or("no limit".into(), |v| e.joint.show(v));
            let what = match (e.carries_machine, e.coupled) {
                (false, _) => "carries the part",
                (true, None) => "carries the machine",
                (true, Some(true)) => "carries the machine, coupled",
                (true, Some(false)) => "carries the machine, not coupled",
            };
            let here = e.joint.show(e.position);
            out += &format!("external axis {}: from {} to {}, {what}, stands at {here}\n", e.joint.name, limit(e.joint.min), limit(e.joint.max));
        }
        if let (Some(c), true) = (&self.coupling, !joints.is_empty()) {
            let name = |i: usize| joints.get(i).map_or("", |j| j.name.as_str());
            let sign = if c.factor < 0.0 { "−" } else { "+" };
            out += &format!("the controller's {0} is {0} {sign} {1}\n", name(c.joint), name(c.with));
        }
        if let Some(home) = &self.home {
            out += &format!("home: {}\n", joints.iter().zip(home).map(|(j, v)| j.show(*v)).collect::<Vec<_>>().join(", "));
        }
        for (word, s) in &self.io {
            out += &format!("{word}: {}\n", s.describe(word));
        }
        for (what, source) in [
            ("accuracy", self.accuracy.as_ref().map(|a| &a.source)),
            ("stiffness", self.stiffness.as_ref().map(|a| &a.source)),
            ("as built", self.as_built.as_ref().map(|a| &a.source)),
        ] {
            if let Some(source) = source {
                out += &format!("{what}: {source}\n");
            }
        }
        out + &self.controller.describe()
    }
}

impl Controller {
    fn describe(&self) -> String {
        let limits = [("lines", self.lines), ("points", self.points), ("bytes", self.bytes)];
        let limits: Vec<String> = limits.iter().filter_map(|(what, n)| n.map(|n| format!("{n} {what}"))).collect();
        match (&self.name, limits.is_empty()) {
            (None, true) => String::new(),
            (name, true) => format!("controller: {}\n", name.as_deref().unwrap_or("")),
            (name, false) => {
                format!("controller: {}, at most {} per file\n", name.as_deref().unwrap_or("not named"), limits.join(", "))
            }
        }
    }
}

impl Signal {
    /// As the row of the probe: the level of its input while it touches.
    pub fn touches_at(&self) -> bool {
        self.value != Some(0.0)
    }

    fn describe(&self, word: &str) -> String {
        let mut parts = Vec::new();
        // These words have a number of their own for the output.
        let value = match word {
            "S" => Some("the speed".to_string()),
            "M6" => Some("the tool's number".to_string()),
            _ if word.starts_with("M67") || word.starts_with("M68") => Some("the programmed value".to_string()),
            _ => self.value.map(short),
        };
        if let Some(r) = &self.routine {
            parts.push(format!("calls {r}"));
        }
        if let Some(s) = &self.signal {
            parts.push(value.map_or(format!("sets {s}"), |v| format!("sets {s} to {v}")));
        }
        if let Some(w) = &self.wait {
            parts.push(format!("waits for {w}"));
        }
        if let Some(s) = self.seconds {
            parts.push(format!("{} s", short(s)));
        }
        parts.join(", ")
    }
}
