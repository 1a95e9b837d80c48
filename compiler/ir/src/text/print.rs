use super::{AXIS_NAMES, HEADER};
use crate::op::{Arc, ArcPlane, Pose, Source};
use crate::{Axes, FeedMode, Marker, Note, Op, Override, PathMode, Plane, Program, Stop, Turn, Units};
use std::fmt::Write as _;

/// The whole program as text; `sources` adds where each operation comes from.
pub fn print(program: &Program, sources: bool) -> String {
    let mut bytes = Vec::new();
    // Writing to memory cannot fail.
    let _ = write(program, sources, &mut bytes);
    String::from_utf8(bytes).unwrap_or_default()
}

/// Writes the program as text.
pub fn write(program: &Program, sources: bool, out: &mut dyn std::io::Write) -> std::io::Result<()> {
    let mut line = Line::default();
    write_header(program, &mut line);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        line.op(&view.op, view.start, view.end);
        if sources {
            line.source(view.source);
        }
        line.end();
        if line.0.len() > 1 << 16 {
            out.write_all(line.0.as_bytes())?;
            line.0.clear();
        }
    }
    out.write_all(line.0.as_bytes())
}

/// One operation as a line without its line feed.
pub fn print_op(op: &Op<'_>, start: &Pose, end: &Pose) -> String {
    let mut line = Line::default();
    line.op(op, start, end);
    line.0
}

fn write_header(program: &Program, line: &mut Line) {
    line.word(HEADER);
    line.end();
    for (id, name) in &program.files {
        line.word("file").bare(id.0);
        line.text(name);
        line.end();
    }
    for frame in program.frames.iter() {
        line.word("frame").bare(frame.id.0);
        let _ = write!(line.0, " parent={} at={}:{}", frame.parent.0, frame.file.0, u64::from(frame.line) + 1);
        line.field("pass", frame.pass);
        line.text(program.frames.name(frame));
        line.end();
    }
    if *program.start() != Pose::default() {
        line.word("start").pose(&Pose::default(), program.start());
        line.end();
    }
}

#[derive(Default)]
struct Line(String);

impl Line {
    fn word(&mut self, word: &str) -> &mut Line {
        self.0.push_str(word);
        self
    }
    fn end(&mut self) {
        self.0.push('\n');
    }
    fn bare(&mut self, v: impl std::fmt::Display) -> &mut Line {
        let _ = write!(self.0, " {v}");
        self
    }
    fn field(&mut self, key: &str, v: impl std::fmt::Display) -> &mut Line {
        let _ = write!(self.0, " {key}={v}");
        self
    }
    fn number(&mut self, v: f64) {
        let _ = write!(self.0, "{v:?}");
        if self.0.ends_with(".0") {
            self.0.truncate(self.0.len() - 2);
        }
    }
    fn bare_number(&mut self, v: f64) -> &mut Line {
        self.0.push(' ');
        self.number(v);
        self
    }
    fn num(&mut self, key: &str, v: f64) -> &mut Line {
        let _ = write!(self.0, " {key}=");
        self.number(v);
        self
    }
    fn nums(&mut self, key: &str, values: &[f64]) -> &mut Line {
        let _ = write!(self.0, " {key}=");
        for (i, v) in values.iter().enumerate() {
            if i > 0 {
                self.0.push(',');
            }
            self.number(*v);
        }
        self
    }
    fn flag(&mut self, on: bool, word: &str) -> &mut Line {
        if on {
            self.bare(word);
        }
        self
    }
    fn text(&mut self, text: &str) -> &mut Line {
        self.0.push_str(" \"");
        for c in text.chars() {
            match c {
                '"' => self.0.push_str("\\\""),
                '\\' => self.0.push_str("\\\\"),
                c if c.is_control() || c == '\u{feff}' => {
                    let _ = write!(self.0, "\\u{{{:x}}}", u32::from(c));
                }
                c => self.0.push(c),
            }
        }
        self.0.push('"');
        self
    }
    fn axes(&mut self, from: &Axes, to: &Axes) -> &mut Line {
        for (name, (old, new)) in AXIS_NAMES.iter().zip(from.iter().zip(to)) {
            if old.to_bits() != new.to_bits() {
                self.num(name, *new);
            }
        }
        self
    }
    fn pose(&mut self, from: &Pose, to: &Pose) -> &mut Line {
        self.axes(&from.axes, &to.axes);
        if from.tool_axis != to.tool_axis {
            match to.tool_axis {
                Some(axis) => self.nums("axis", &axis),
                None => self.field("axis", "none"),
            };
        }
        if from.spin != to.spin {
            match to.spin {
                Some(spin) => self.num("spin", spin),
                None => self.field("spin", "none"),
            };
        }
        self
    }
    fn source(&mut self, s: Source) {
        let _ = write!(self.0, " @{}:{}", s.file.0, u64::from(s.line) + 1);
        if s.frame.0 != 0 {
            let _ = write!(self.0, "/{}", s.frame.0);
        }
    }

    fn op(&mut self, op: &Op<'_>, start: &Pose, end: &Pose) {
        match op {
            Op::Rapid => self.word("rapid").pose(start, end),
            Op::Linear => self.word("linear").pose(start, end),
            Op::Arc(arc) => self.arc(arc).pose(start, end),
            Op::Nurbs { order, points } => {
                self.word("nurbs").field("order", order).nums("points", points).pose(start, end)
            }
            Op::Probe(kind) => self.word("probe").field("kind", kind).pose(start, end),
            Op::RigidTap { bottom, scale } => self.word("rigid-tap").nums("bottom", bottom).num("scale", *scale),
            Op::Dwell(seconds) => self.word("dwell").bare_number(*seconds),
            Op::SyncStart(s) => self
                .word("sync-start")
                .field("spindle", s.spindle)
                .num("per-rev", s.per_rev)
                .flag(s.velocity, "velocity"),
            Op::SyncStop => self.word("sync-stop"),
            Op::ProbeMode(on) => self.word("probe-mode").bare(on_off(*on)),
            Op::Units(units) => self.word("units").bare(if *units == Units::Inch { "inch" } else { "mm" }),
            Op::Plane(plane) => self.word("plane").bare(plane_name(*plane)),
            Op::FeedMode { spindle, mode } => {
                self.word("feed-mode").bare(feed_mode_name(*mode)).field("spindle", spindle)
            }
            Op::Feed { linear, angular } => self.word("feed").bare_number(*linear).num("angular", *angular),
            Op::FeedReferenceXyz => self.word("feed-reference xyz"),
            Op::PathMode(PathMode::ExactStop) => self.word("path exact-stop"),
            Op::PathMode(PathMode::ExactPath) => self.word("path exact-path"),
            Op::PathMode(PathMode::Blend(t)) => self.word("path blend").num("tolerance", *t),
            Op::MergeTolerance(t) => self.word("merge-tolerance").bare_number(*t),
            Op::Planner(None) => self.word("planner trapezoidal"),
            Op::Planner(Some(corner)) => self.word("planner smooth").num("corner", *corner),
            _ => self.auxiliary(op),
        };
    }

    fn arc(&mut self, arc: &Arc) -> &mut Line {
        match arc.plane {
            ArcPlane::Work(plane) => {
                let (first, second, _) = crate::state::plane_axes(plane);
                self.word("arc").bare(plane_name(plane)).field("turns", arc.turns);
                self.nums("center", &[arc.center[first], arc.center[second]])
            }
            ArcPlane::Free(normal) => {
                self.word("arc free").field("turns", arc.turns);
                self.nums("center", &arc.center).nums("normal", &normal)
            }
        }
    }

    fn auxiliary(&mut self, op: &Op<'_>) -> &mut Line {
        match op {
            Op::SpindleMode { spindle, surface } => {
                self.word("spindle-mode").bare(spindle);
                match surface {
                    Some(limit) => self.bare("surface").num("limit", *limit),
                    None => self.bare("rpm"),
                }
            }
            Op::SpindleSpeed { spindle, speed } => self.word("spindle-speed").bare(spindle).num("speed", *speed),
            Op::SpindleTurn { spindle, turn } => self.word("spindle-turn").bare(spindle).bare(turn_name(*turn)),
            Op::SpindleOrient { spindle, angle, direction } => {
                self.word("spindle-orient").bare(spindle).num("angle", *angle).field("direction", direction)
            }
            Op::SpindleWait { spindle, timeout } => self.word("spindle-wait").bare(spindle).num("timeout", *timeout),
            Op::Mist(on) => self.word("mist").bare(on_off(*on)),
            Op::Flood(on) => self.word("flood").bare(on_off(*on)),
            Op::ToolPrepare(n) => self.word("tool-prepare").bare(n),
            Op::ToolChangeStart => self.word("tool-change-start"),
            Op::ToolChange(pocket) => self.word("tool-change").field("pocket", pocket),
            Op::ToolNumber(n) => self.word("tool-number").bare(n),
            Op::ToolReload => self.word("tool-reload"),
            Op::ToolEntry { pocket, tool, offset, diameter, front, back, orientation } => {
                self.word("tool-entry").bare(tool).field("pocket", pocket);
                self.num("diameter", *diameter).num("front", *front).num("back", *back);
                self.field("orientation", orientation).axes(&[0.0; 9], offset)
            }
            Op::ToolOffset { offset, number } => {
                let line = self.word("tool-offset");
                if let Some(number) = number {
                    line.field("number", number);
                }
                line.axes(&[0.0; 9], offset)
            }
            Op::WorkOffset(n, axes) => self.word("work-offset").bare(n).axes(&[0.0; 9], axes),
            Op::StoredOffset { number, offset, rotation } => {
                self.word("store-offset").bare(number).num("rotation", *rotation).axes(&[0.0; 9], offset)
            }
            Op::LocalOffset(axes) => self.word("local-offset").axes(&[0.0; 9], axes),
            Op::Rotation(r) => self.word("rotation").bare_number(*r),
            _ => self.rest(op),
        }
    }

    fn rest(&mut self, op: &Op<'_>) -> &mut Line {
        match op {
            Op::Override(which, on) => {
                self.word("override");
                match which {
                    Override::Feed => self.bare("feed"),
                    Override::Adaptive => self.bare("adaptive"),
                    Override::FeedHold => self.bare("feed-hold"),
                    Override::Speed(n) => self.bare("speed").field("spindle", n),
                };
                self.bare(on_off(*on))
            }
            Op::DigitalOut { index, on, synced } => {
                self.word("digital-out").bare(index).bare(on_off(*on)).flag(*synced, "synced")
            }
            Op::AnalogOut { index, value, synced } => {
                self.word("analog-out").bare(index).num("value", *value).flag(*synced, "synced")
            }
            Op::InputWait { index, digital, wait, timeout } => self
                .word("input-wait")
                .bare(index)
                .bare(if *digital { "digital" } else { "analog" })
                .field("wait", wait)
                .num("timeout", *timeout),
            Op::RunTime(text) => self.word("run-time").text(text),
            Op::Note(note, text) => self.word(note_name(*note)).text(text),
            Op::LogClose => self.word("log-close"),
            Op::UserM { code, p, q } => self.word("user-m").bare(code).num("p", *p).num("q", *q),
            Op::Stop(stop) => self.word("stop").bare(stop_name(*stop)),
            Op::Finish => self.word("finish"),
            Op::Reset => self.word("reset"),
            Op::IndexerLock(axis, on) => self.word("indexer").bare(axis).bare(if *on { "lock" } else { "unlock" }),
            Op::Begin { marker, code, text } => {
                self.word("begin").bare(marker_name(*marker)).field("code", code).text(text)
            }
            Op::Close(marker) => self.word("close").bare(marker_name(*marker)),
            _ => self.word("end"),
        }
    }
}

fn on_off(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

pub(super) fn plane_name(plane: Plane) -> &'static str {
    match plane {
        Plane::Xy => "xy",
        Plane::Yz => "yz",
        Plane::Xz => "xz",
        Plane::Uv => "uv",
        Plane::Vw => "vw",
        Plane::Uw => "uw",
    }
}

pub(super) fn feed_mode_name(mode: FeedMode) -> &'static str {
    match mode {
        FeedMode::PerTime => "per-time",
        FeedMode::PerRev => "per-rev",
        FeedMode::Inverse => "inverse",
    }
}

pub(super) fn turn_name(turn: Turn) -> &'static str {
    match turn {
        Turn::Cw => "cw",
        Turn::Ccw => "ccw",
        Turn::Stop => "stop",
    }
}

pub(super) fn note_name(note: Note) -> &'static str {
    match note {
        Note::Comment => "comment",
        Note::Message => "message",
        Note::Log => "log",
        Note::LogOpen => "log-open",
        Note::LogAppend => "log-append",
    }
}

pub(super) fn stop_name(stop: Stop) -> &'static str {
    match stop {
        Stop::Program => "program",
        Stop::Optional => "optional",
        Stop::Pallet => "pallet",
    }
}

pub(super) fn marker_name(marker: Marker) -> &'static str {
    match marker {
        Marker::Tool => "tool",
        Marker::Cycle => "cycle",
        Marker::Workingstep => "workingstep",
        Marker::Feature => "feature",
        Marker::Tolerance => "tolerance",
        Marker::Contour => "contour",
    }
}
