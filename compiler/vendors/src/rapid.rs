//! ABB RAPID: program modules (IRC5, OmniCore) and the `.pgf` file that lists them.
//!
//! Facts: robtarget, confdata, speeddata and zonedata as in ABB's *RAPID Instructions, Functions and Data types*
//! (3HAC050917); quadrants as in *Basic Characteristics RAPID*. Speeds and zones are data of the program's own: the
//! controller's come in steps.

use crate::name::{Names, Rule};
use crate::number::{down, num, short, single};
use crate::parts::Parts;
use crate::probe::{NOT_READY, NOT_TRIPPED};
use crate::walk::{Arms, Body, Cx, Op, Traits, Value, World, any_error, walk, wrapped};
use crate::{Language, Options, Output, OutputFile};
use gr_ir::Sources;
use gr_machine::math::{Frame, quaternion_of};
use gr_robot::{RobotProgram, Target};
use gr_text::code;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::LazyLock;

pub(crate) struct Rapid;

static TRAITS: Traits = Traits { title: "ABB RAPID", arms: Arms::Spherical, world: World::Foot, external: true, arcs: true, trailing: true, unverified: "" };

/// Names that RAPID has itself: reserved words, instructions, functions, data types and data.
static RESERVED: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let lines = include_str!("../../../spec/targets/rapid-names.txt").lines().filter(|l| !l.starts_with('#'));
    lines.flat_map(str::split_whitespace).collect()
});

/// Lines of a module: what ABB's reference post processors keep to.
const LINES: u64 = 5000;
/// Lines of a module around its statements.
const FRAME: u64 = 8;

impl Language for Rapid {
    fn id(&self) -> &'static str {
        "rapid"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 32, reserved: &RESERVED, upper: false });
        let module = names.give(&program.name, "P");
        let tools: Vec<String> = program.tools.iter().map(|t| names.give(&t.name, "t")).collect();
        let frames: Vec<String> = program.frames.iter().map(|f| names.give(&f.name, "w")).collect();
        let limits = &program.machine.cell.controller;
        let most = limits.lines.unwrap_or(LINES);
        let mut w = Writer {
            most,
            parts: Parts::new(most.saturating_sub(FRAME), limits.points, limits.bytes, "\r\n"),
            names,
            tools,
            frames,
            tail: (None, String::new()),
            speeds: BTreeMap::new(),
            zones: BTreeMap::new(),
            turn: (([0.0; 4]), String::new()),
            probe: String::new(),
        };
        let mut out = walk(program, sources, options, &TRAITS, &mut w);
        if !any_error(&out.findings) {
            w.names.tell(&mut out, TRAITS.title);
            out.files = w.files(&module, program);
        }
        out
    }
}

struct Writer {
    /// Lines of a file at most.
    most: u64,
    parts: Parts,
    names: Names,
    tools: Vec<String>,
    frames: Vec<String>,
    /// `,tool\WObj:=frame;` of the tool and frame in use.
    tail: (Option<(usize, usize)>, String),
    /// Declared speeds and zones: value as text → name.
    speeds: BTreeMap<String, String>,
    zones: BTreeMap<String, String>,
    /// The last quaternion and its text.
    turn: ([f64; 4], String),
    /// Name of the routine that probes; empty = the program doesn't probe.
    probe: String,
}

/// Faster than this a stiff stop bends the path (*RAPID Instructions*, SearchL).
const SEARCH: f64 = 100.0;

/// The routine that probes: `SearchL` with a stiff stop at the first edge of the input. The place found is in a variable.
fn search(name: &str, found: &str) -> String {
    let lines = [
        &format!("  PROC {name}(VAR signaldi input,num before,bool must,robtarget goal,speeddata speed,PERS tooldata tool,PERS wobjdata frame)"),
        "    IF DInput(input)<>before THEN",
        &format!("      TPWrite \"{NOT_READY}\";"),
        "      EXIT;",
        "    ENDIF",
        &format!("    SearchL\\Stop,input\\Flanks,{found},goal,speed,tool\\WObj:=frame;"),
        "  ERROR",
        "    IF ERRNO=ERR_WHLSEARCH THEN",
        "      IF must THEN",
        &format!("        TPWrite \"{NOT_TRIPPED}\";"),
        "        EXIT;",
        "      ENDIF",
        "      TRYNEXT;",
        "    ENDIF",
        "  ENDPROC",
    ];
    lines.map(|l| format!("{l}\r\n")).concat()
}

impl Writer {
    fn files(self, module: &str, program: &RobotProgram) -> Vec<OutputFile> {
        let mut head = format!("%%%\r\n  VERSION:1\r\n  LANGUAGE:ENGLISH\r\n%%%\r\nMODULE {module}\r\n");
        for (tool, name) in program.tools.iter().zip(&self.tools) {
            // A load of no mass or at the flange is refused: the least that is taken stands for "not known".
            let center = tool.frame.position.map(|v| v / 2.0);
            let center = if center.iter().all(|v| v.abs() < 0.001) { [0.0, 0.0, 0.001] } else { center };
            let mass = tool.mass.unwrap_or(0.001).max(0.001);
            if tool.mass.is_none() {
                let _ = write!(head, "  ! {name}: mass and centre of gravity are not known, set them before running\r\n");
            }
            let _ = write!(
                head,
                "  PERS tooldata {name}:=[TRUE,{},[{},{},[1,0,0,0],0,0,0]];\r\n",
                pose(&tool.frame),
                num(mass, 3),
                list(&center, 3)
            );
        }
        for (frame, name) in program.frames.iter().zip(&self.frames) {
            let _ = write!(
                head,
                "  TASK PERS wobjdata {name}:=[FALSE,TRUE,\"\",{},[[0,0,0],[1,0,0,0]]];\r\n",
                pose(&TRAITS.in_control(&program.machine, &frame.frame))
            );
        }
        for (value, name) in by_name(&self.speeds) {
            let _ = write!(head, "  CONST speeddata {name}:={value};\r\n");
        }
        for (value, name) in by_name(&self.zones) {
            let _ = write!(head, "  CONST zonedata {name}:={value};\r\n");
        }
        let mut names = self.names;
        let mut tail = "  ENDPROC\r\n".to_string();
        if !self.probe.is_empty() {
            let found = names.fresh("pFound");
            let _ = write!(head, "  VAR robtarget {found};\r\n");
            tail += &search(&self.probe, &found);
        }
        tail += "ENDMODULE\r\n";
        let parts = self.parts.finish();
        let start = "    ConfJ\\On;\r\n    ConfL\\Off;\r\n    SingArea\\Wrist;\r\n";
        let mut files = Vec::new();
        let mut list = vec![format!("{module}.mod")];
        head += &format!("  PROC main()\r\n{start}");
        let lines = |text: &str| text.matches('\n').count() as u64;
        if let [one] = parts.as_slice()
            && lines(&head) + lines(one) + lines(&tail) <= self.most
        {
            head += one;
        } else {
            for (i, part) in parts.iter().enumerate() {
                let inner = names.fresh(&format!("{module}_{:03}", i + 1));
                let routine = names.fresh(&format!("r{module}_{:03}", i + 1));
                head += &format!("    {routine};\r\n");
                let text = format!("%%%\r\n  VERSION:1\r\n  LANGUAGE:ENGLISH\r\n%%%\r\nMODULE {inner}\r\n  PROC {routine}()\r\n{part}  ENDPROC\r\nENDMODULE\r\n");
                list.push(format!("{inner}.mod"));
                files.push(OutputFile::new(format!("{inner}.mod"), text));
            }
        }
        head += &tail;
        files.push(OutputFile::new(format!("{module}.mod"), head));
        let modules: String = list.iter().map(|m| format!("\t<Module>{m}</Module>\r\n")).collect();
        let index = format!("<?xml version=\"1.0\" encoding=\"ISO-8859-1\" ?>\r\n<Program>\r\n{modules}</Program>\r\n");
        files.push(OutputFile::new(format!("{module}.pgf"), index));
        files
    }

    fn line(&mut self, text: &str) {
        self.parts.text.push_str("    ");
        self.parts.line(text);
    }

    fn target(&mut self, cx: &Cx, t: &Target) {
        if self.turn.1.is_empty() || self.turn.0 != t.quaternion {
            self.turn = (t.quaternion, unit(&t.quaternion));
        }
        let out = &mut self.parts.text;
        out.push('[');
        push_list(out, &t.position, cx.decimals());
        out.push(',');
        out.push_str(&self.turn.1);
        out.push(',');
        let n = cx.machine.joints.len().min(t.joints.len());
        let serial = cx.machine.cell.coupling.is_none();
        let (q1, q4, q5, q6) = (t.joints[0], t.joints[3], t.joints[4], t.joints[5]);
        // The fourth field numbers the eight ways of a serial arm; an arm with a parallelogram can't turn its elbow.
        let way = if serial && n == 6 {
            let p = cx.posture(t);
            4 * u8::from(p.behind) + 2 * u8::from(!p.forward) + u8::from(q5 < 0.0)
        } else {
            0
        };
        let _ = write!(out, "[{},{},{},{way}],", quadrant(q1), quadrant(q4), quadrant(q6));
        external(out, cx, t);
        out.push(']');
    }

    fn speed(&mut self, mm: f64, turn: f64, prefix: &str) -> String {
        let value = format!("[{},{},5000,1000]", single(mm), single(turn));
        if let Some(name) = self.speeds.get(&value) {
            return name.clone();
        }
        let start = format!("v{prefix}");
        let next = self.speeds.values().filter(|n| n.starts_with(&start)).count() + 1;
        let name = self.names.fresh(&format!("{start}{next}"));
        self.speeds.insert(value, name.clone());
        name
    }

    fn zone(&mut self, zone: Option<f64>) -> String {
        let Some(r) = zone.map(down).filter(|r| *r >= 0.001) else { return "fine".into() };
        let (r, tenth) = (num(r, 6), num(r / 10.0, 6));
        let value = format!("[FALSE,{r},{r},{r},{tenth},{r},{tenth}]");
        let next = self.zones.len() + 1;
        if let Some(name) = self.zones.get(&value) {
            return name.clone();
        }
        let name = self.names.fresh(&format!("zP{next}"));
        self.zones.insert(value, name.clone());
        name
    }

    fn finish(&mut self, cx: &Cx, speed: &str, zone: &str) {
        let key = (cx.tool, cx.frame);
        if self.tail.0 != Some(key) {
            let tool = self.tools.get(cx.tool).map_or("tool0", String::as_str);
            let frame = self.frames.get(cx.frame).map_or("wobj0", String::as_str);
            self.tail = (Some(key), format!(",{tool}\\WObj:={frame};"));
        }
        let out = &mut self.parts.text;
        out.push(',');
        out.push_str(speed);
        out.push(',');
        out.push_str(zone);
        out.push_str(&self.tail.1);
        if let Some(line) = cx.remark {
            let _ = write!(out, " ! {line}");
        }
        self.parts.end_line();
    }

    fn motion(&mut self, cx: &Cx, word: &str, targets: &[&Target], speed: &str, zone: &str) {
        self.parts.text.push_str("    ");
        self.parts.text.push_str(word);
        for (i, t) in targets.iter().enumerate() {
            self.parts.text.push(if i == 0 { ' ' } else { ',' });
            self.target(cx, t);
        }
        self.parts.points(targets.len() as u64);
        self.finish(cx, speed, zone);
    }
}

impl Body for Writer {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        self.parts.begin();
        self.parts.step = cx.step;
        match op {
            Op::Line(number, text) => {
                let text = cx.ascii(text);
                self.line(&format!("! {number}: {text}"));
            }
            Op::Home(t) => self.home(cx, t, None),
            // Back to the joints themselves: as a pose they could be reached with other turns.
            Op::Joint { to, share, zone: None } if to.joints == cx.program.home.joints => self.home(cx, to, Some(share)),
            Op::Joint { to, share, zone } => {
                let (speed, zone) = (self.joint_speed(cx, to, share), self.zone(zone));
                self.motion(cx, "MoveJ", &[to], &speed, &zone);
            }
            Op::Linear { to, speed, zone } => {
                let (speed, zone) = (self.speed(speed, 500.0, "F"), self.zone(zone));
                self.motion(cx, "MoveL", &[to], &speed, &zone);
            }
            Op::Arc { via, to, speed, zone } => {
                let (speed, zone) = (self.speed(speed, 500.0, "F"), self.zone(zone));
                self.motion(cx, "MoveC", &[via, to], &speed, &zone);
            }
            Op::Probe { to, speed, input, on, must } => self.probe(cx, (to, speed), input, on, must),
            // Tool and frame are arguments of every move.
            Op::Tool(_) | Op::Frame(_) | Op::End => {}
            Op::Set { name, value, word } => {
                let name = cx.known(name, word);
                match value {
                    Value::Digital(on) => self.line(&format!("SetDO {name},{};", u8::from(on))),
                    Value::Analog(v) => self.line(&format!("SetAO {name},{};", num(v, 6))),
                    Value::Group(v) => self.line(&format!("SetGO {name},{v};")),
                }
            }
            Op::Call { name, value } => {
                let name = cx.known(name, "routine");
                self.line(&value.map_or(format!("{name};"), |v| format!("{name} {};", num(v, 6))));
            }
            Op::Wait { name, on, timeout } => {
                let name = cx.known(name, "wait");
                let most = timeout.map_or(String::new(), |t| format!("\\MaxTime:={}", num(t, 3)));
                self.line(&format!("WaitDI {name},{}{most};", u8::from(on)));
            }
            Op::Dwell(s) => self.line(&format!("WaitTime\\InPos,{};", num(s, 3))),
            Op::Message(text) => {
                let text = cx.ascii(text);
                for piece in wrapped(&text, 80) {
                    self.parts.begin();
                    self.line(&format!("TPWrite \"{}\";", piece.replace('\\', "/").replace('"', "\"\"")));
                }
            }
            Op::Comment(text) => {
                let text = cx.ascii(text);
                self.line(&format!("! {text}"));
            }
            Op::Pause => self.line("Stop;"),
        }
        if cx.failed() {
            self.parts.text.clear();
        }
    }
}

impl Writer {
    fn probe(&mut self, cx: &mut Cx, (to, speed): (&Target, f64), input: &str, on: bool, must: bool) {
        let input = cx.known(input, "G38");
        if speed > SEARCH {
            cx.say(code::VENDOR_FEED_RANGE, &[num(speed, 4), format!("at most {SEARCH} mm/s for a probe"), TRAITS.title.into()]);
        }
        if self.probe.is_empty() {
            self.probe = self.names.fresh("Probe");
        }
        let speed = self.speed(speed, 500.0, "F");
        let must = if must { "TRUE" } else { "FALSE" };
        let _ = write!(self.parts.text, "    {} {input},{},{must},", self.probe, u8::from(!on));
        self.target(cx, to);
        self.parts.points(1);
        let tool = self.tools.get(cx.tool).map_or("tool0", String::as_str);
        let frame = self.frames.get(cx.frame).map_or("wobj0", String::as_str);
        let _ = write!(self.parts.text, ",{speed},{tool},{frame};");
        if let Some(line) = cx.remark {
            let _ = write!(self.parts.text, " ! {line}");
        }
        self.parts.end_line();
    }

    /// At a share of the joint speeds; none = from nobody knows where.
    fn home(&mut self, cx: &Cx, t: &Target, share: Option<f64>) {
        let speed = match share {
            Some(share) => self.joint_speed(cx, t, share),
            None => self.calm(cx),
        };
        let mut text = format!("    MoveAbsJ [{},", list(&cx.degrees(t), 5));
        external(&mut text, cx, t);
        self.parts.text.push_str(&text);
        self.parts.text.push_str("]\\NoEOffs");
        self.finish(cx, &speed, "fine");
    }

    /// Joint moves, too, are told a speed of the tool point: the one with which it makes its way in the time that the joints take at
    /// their share. The turn of the tool never slows it down.
    fn joint_speed(&mut self, cx: &Cx, to: &Target, share: f64) -> String {
        let calm = self.calm(cx);
        match cx.joint_way(to, share) {
            Some((way, seconds)) => format!("{calm}\\V:={}", single((way / seconds).max(0.1))),
            None => calm,
        }
    }

    /// The speed of a joint move whose way isn't known: that of rapids in a line.
    fn calm(&mut self, cx: &Cx) -> String {
        self.speed(cx.machine.cell.line_rapid(), 1000.0, "J")
    }
}

fn by_name(table: &BTreeMap<String, String>) -> Vec<(&String, &String)> {
    let mut rows: Vec<_> = table.iter().collect();
    rows.sort_by_key(|(_, name)| (name.len(), *name));
    rows
}

fn quadrant(angle: f64) -> i32 {
    // A ten-thousandth of a degree below zero is zero as far as any controller can tell.
    libm::floor((angle.to_degrees() + 1e-4) / 90.0) as i32
}

fn push_list(out: &mut String, values: &[f64], decimals: usize) {
    out.push('[');
    for (i, v) in values.iter().enumerate() {
        if i > 0 {
            out.push(',');
        }
        short(out, *v, decimals);
    }
    out.push(']');
}

fn list(values: &[f64], decimals: usize) -> String {
    let mut out = String::new();
    push_list(&mut out, values, decimals);
    out
}

fn external(out: &mut String, cx: &Cx, t: &Target) {
    if cx.machine.cell.external.is_empty() {
        out.push_str("[9E9,9E9,9E9,9E9,9E9,9E9]");
        return;
    }
    let values = cx.external(t);
    out.push('[');
    for i in 0..6 {
        if i > 0 {
            out.push(',');
        }
        match values.get(i) {
            Some(v) => short(out, *v, 4),
            None => out.push_str("9E9"),
        }
    }
    out.push(']');
}

/// A quaternion of eight decimals whose length is 1 again after rounding: the largest part makes up for the others.
fn unit(q: &[f64; 4]) -> String {
    let largest = (0..4).max_by(|a, b| q[*a].abs().total_cmp(&q[*b].abs())).unwrap_or(0);
    let mut parts = q.map(|v| libm::round(v * 1e8) / 1e8);
    let rest: f64 = (0..4).filter(|i| *i != largest).map(|i| parts[i] * parts[i]).sum();
    parts[largest] = libm::copysign(libm::sqrt((1.0 - rest).max(0.0)), q[largest]);
    list(&parts, 8)
}

fn pose(frame: &Frame) -> String {
    format!("[{},{}]", list(&frame.position, 4), unit(&quaternion_of(&frame.turn)))
}

