//! The motion IR as JSON (everything, with its sources) and as CSV (one row per move, for tables and plots).
//! Both are written as they are read; nothing is held in memory.

use gr_ir::geometry::{Length, flatten, length};
use gr_ir::measure::Rates;
use gr_ir::timing::Clock;
use gr_ir::{Arc, ArcPlane, Axes, FeedMode, Note, Op, Override, PathMode, Program, Source, Stop, Turn, Units, View};
use std::io::{Result, Write};

const NAMES: [&str; 9] = ["x", "y", "z", "a", "b", "c", "u", "v", "w"];

/// Writes one JSON object: header, files, calls and loop passes, then `operations`, one per line.
pub fn json(program: &Program, out: &mut dyn Write) -> Result<()> {
    let mut line = Json::default();
    line.0.push_str("{\"format\":\"gcc-robot motion\",\"version\":1,");
    line.0.push_str("\"units\":{\"length\":\"mm\",\"angle\":\"rad\",\"time\":\"s\"},\n");
    header(program, &mut line);
    line.0.push_str("\"operations\":[");
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        line.0.push_str(if view.index == 0 { "\n" } else { ",\n" });
        operation(&mut line, &view);
        if line.0.len() > 1 << 16 {
            out.write_all(line.0.as_bytes())?;
            line.0.clear();
        }
    }
    line.0.push_str("\n]}\n");
    out.write_all(line.0.as_bytes())
}

fn header(program: &Program, line: &mut Json) {
    line.0.push_str("\"files\":[");
    for (i, (id, name)) in program.files.iter().enumerate() {
        line.0.push_str(if i == 0 { "{" } else { ",{" });
        line.int("id", i64::from(id.0)).text("name", name).close();
    }
    line.0.push_str("],\n\"frames\":[");
    for (i, frame) in program.frames.iter().enumerate() {
        line.0.push_str(if i == 0 { "\n{" } else { ",\n{" });
        line.int("id", i64::from(frame.id.0)).int("parent", i64::from(frame.parent.0));
        line.int("file", i64::from(frame.file.0)).int("line", i64::from(frame.line) + 1);
        line.int("pass", i64::from(frame.pass)).text("name", program.frames.name(frame)).close();
    }
    line.0.push_str("],\n");
}

fn operation(line: &mut Json, view: &View<'_, '_>) {
    line.0.push('{');
    motion(line, &view.op);
    if view.op.moves() {
        line.key("to").0.push('{');
        for (name, (old, new)) in NAMES.iter().zip(view.start.axes.iter().zip(&view.end.axes)) {
            if old.to_bits() != new.to_bits() {
                line.num(name, *new);
            }
        }
        line.close();
        if let Some(axis) = view.end.tool_axis {
            line.nums("tool_axis", &axis);
        }
        if let Some(spin) = view.end.spin {
            line.num("spin", spin);
        }
    }
    source(line, view.source);
    line.close();
}

fn source(line: &mut Json, s: Source) {
    line.key("at").0.push('{');
    line.int("file", i64::from(s.file.0)).int("line", i64::from(s.line) + 1);
    if s.frame.0 != 0 {
        line.int("frame", i64::from(s.frame.0));
    }
    line.close();
}

fn motion(line: &mut Json, op: &Op<'_>) {
    match op {
        Op::Rapid => line.op("rapid"),
        Op::Linear => line.op("linear"),
        Op::Arc(arc) => arc_fields(line, arc),
        Op::Nurbs { order, points } => line.op("nurbs").int("order", i64::from(*order)).nums("points", points),
        Op::Probe(kind) => line.op("probe").int("kind", i64::from(*kind)).flag("known_only_at_run_time", true),
        Op::RigidTap { bottom, scale } => line.op("rigid_tap").nums("bottom", bottom).num("scale", *scale),
        Op::Dwell(s) => line.op("dwell").num("seconds", *s),
        Op::SyncStart(s) => line
            .op("sync_start")
            .int("spindle", i64::from(s.spindle))
            .num("per_rev", s.per_rev)
            .flag("velocity", s.velocity),
        Op::SyncStop => line.op("sync_stop"),
        Op::ProbeMode(on) => line.op("probe_mode").flag("on", *on),
        Op::Units(u) => line.op("units").text("units", if *u == Units::Inch { "inch" } else { "mm" }),
        Op::Plane(p) => line.op("plane").text("plane", &format!("{p:?}").to_lowercase()),
        Op::FeedMode { spindle, mode } => {
            let name = match mode {
                FeedMode::PerTime => "per_time",
                FeedMode::PerRev => "per_rev",
                FeedMode::Inverse => "inverse",
            };
            line.op("feed_mode").text("mode", name).int("spindle", i64::from(*spindle))
        }
        Op::Feed { linear, angular } => line.op("feed").num("linear", *linear).num("angular", *angular),
        Op::FeedReferenceXyz => line.op("feed_reference").text("reference", "xyz"),
        Op::PathMode(mode) => match mode {
            PathMode::ExactStop => line.op("path").text("mode", "exact_stop"),
            PathMode::ExactPath => line.op("path").text("mode", "exact_path"),
            PathMode::Blend(t) => line.op("path").text("mode", "blend").num("tolerance", *t),
        },
        Op::MergeTolerance(t) => line.op("merge_tolerance").num("tolerance", *t),
        Op::Planner(None) => line.op("planner").text("mode", "trapezoidal"),
        Op::Planner(Some(corner)) => line.op("planner").text("mode", "smooth").num("corner", *corner),
        _ => machine(line, op),
    };
}

fn arc_fields<'j>(line: &'j mut Json, arc: &Arc) -> &'j mut Json {
    line.op("arc");
    match arc.plane {
        ArcPlane::Work(plane) => line.text("plane", &format!("{plane:?}").to_lowercase()),
        ArcPlane::Free(normal) => line.nums("normal", &normal),
    };
    line.nums("center", &arc.center).int("turns", i64::from(arc.turns))
}

fn machine<'j>(line: &'j mut Json, op: &Op<'_>) -> &'j mut Json {
    let n = i64::from;
    match op {
        Op::SpindleMode { spindle, surface } => {
            line.op("spindle_mode").int("spindle", n(*spindle));
            match surface {
                Some(limit) => line.text("mode", "surface").num("limit_rpm", *limit),
                None => line.text("mode", "rpm"),
            }
        }
        Op::SpindleSpeed { spindle, speed } => {
            line.op("spindle_speed").int("spindle", n(*spindle)).num("speed", *speed)
        }
        Op::SpindleTurn { spindle, turn } => {
            let turn = match turn {
                Turn::Cw => "cw",
                Turn::Ccw => "ccw",
                Turn::Stop => "stop",
            };
            line.op("spindle_turn").int("spindle", n(*spindle)).text("turn", turn)
        }
        Op::SpindleOrient { spindle, angle, direction } => {
            line.op("spindle_orient").int("spindle", n(*spindle)).num("angle", *angle).int("direction", n(*direction))
        }
        Op::SpindleWait { spindle, timeout } => {
            line.op("spindle_wait").int("spindle", n(*spindle)).num("timeout", *timeout)
        }
        Op::Mist(on) => line.op("mist").flag("on", *on),
        Op::Flood(on) => line.op("flood").flag("on", *on),
        Op::ToolPrepare(tool) => line.op("tool_prepare").int("tool", n(*tool)),
        Op::ToolChangeStart => line.op("tool_change_start"),
        Op::ToolChange(pocket) => line.op("tool_change").int("pocket", n(*pocket)),
        Op::ToolNumber(tool) => line.op("tool_number").int("tool", n(*tool)),
        Op::ToolReload => line.op("tool_reload"),
        Op::ToolEntry { pocket, tool, offset, diameter, front, back, orientation } => line
            .op("tool_entry")
            .int("pocket", n(*pocket))
            .int("tool", n(*tool))
            .nums("offset", offset)
            .num("diameter", *diameter)
            .num("front", *front)
            .num("back", *back)
            .int("orientation", n(*orientation)),
        Op::ToolOffset { offset, number } => {
            line.op("tool_offset").nums("offset", offset);
            if let Some(number) = number {
                line.int("number", i64::from(*number));
            }
            line
        }
        Op::WorkOffset(number, axes) => {
            line.op("work_offset").int("number", n(i32::from(*number))).nums("offset", axes)
        }
        Op::StoredOffset { number, offset, rotation } => {
            line.op("store_offset").int("number", n(i32::from(*number))).nums("offset", offset).num("rotation", *rotation)
        }
        Op::LocalOffset(axes) => line.op("local_offset").nums("offset", axes),
        Op::Rotation(r) => line.op("rotation").num("angle", *r),
        _ => rest(line, op),
    }
}

fn rest<'j>(line: &'j mut Json, op: &Op<'_>) -> &'j mut Json {
    let n = i64::from;
    match op {
        Op::Override(which, on) => {
            line.op("override");
            match which {
                Override::Feed => line.text("switch", "feed"),
                Override::Adaptive => line.text("switch", "adaptive"),
                Override::FeedHold => line.text("switch", "feed_hold"),
                Override::Speed(spindle) => line.text("switch", "speed").int("spindle", n(*spindle)),
            };
            line.flag("on", *on)
        }
        Op::DigitalOut { index, on, synced } => {
            line.op("digital_out").int("index", n(*index)).flag("on", *on).flag("synced", *synced)
        }
        Op::AnalogOut { index, value, synced } => {
            line.op("analog_out").int("index", n(*index)).num("value", *value).flag("synced", *synced)
        }
        Op::InputWait { index, digital, wait, timeout } => line
            .op("input_wait")
            .int("index", n(*index))
            .flag("digital", *digital)
            .int("wait", n(*wait))
            .num("timeout", *timeout)
            .flag("known_only_at_run_time", true),
        Op::RunTime(what) => line.op("run_time").text("depends_on", what),
        Op::Note(note, text) => {
            let name = match note {
                Note::Comment => "comment",
                Note::Message => "message",
                Note::Log => "log",
                Note::LogOpen => "log_open",
                Note::LogAppend => "log_append",
            };
            line.op(name).text("text", text)
        }
        Op::LogClose => line.op("log_close"),
        Op::UserM { code, p, q } => line.op("user_m").int("code", n(*code)).num("p", *p).num("q", *q),
        Op::Stop(stop) => {
            let why = match stop {
                Stop::Program => "program",
                Stop::Optional => "optional",
                Stop::Pallet => "pallet",
            };
            line.op("stop").text("why", why)
        }
        Op::Finish => line.op("finish"),
        Op::Reset => line.op("reset"),
        Op::IndexerLock(axis, on) => line.op("indexer_lock").int("axis", n(i32::from(*axis))).flag("lock", *on),
        Op::Begin { marker, code, text } => line
            .op("begin")
            .text("marker", &format!("{marker:?}").to_lowercase())
            .int("code", n(*code))
            .text("text", text),
        Op::Close(marker) => line.op("close").text("marker", &format!("{marker:?}").to_lowercase()),
        _ => line.op("end"),
    }
}

/// A JSON object in the making.
#[derive(Default)]
struct Json(String);

impl Json {
    fn key(&mut self, key: &str) -> &mut Json {
        if !self.0.ends_with('{') {
            self.0.push(',');
        }
        self.0.push('"');
        self.0.push_str(key);
        self.0.push_str("\":");
        self
    }
    fn close(&mut self) {
        self.0.push('}');
    }
    fn op(&mut self, name: &str) -> &mut Json {
        self.text("op", name)
    }
    fn text(&mut self, key: &str, text: &str) -> &mut Json {
        self.key(key);
        // A string always has a JSON form.
        self.0.push_str(&serde_json::to_string(text).unwrap_or_default());
        self
    }
    fn int(&mut self, key: &str, v: i64) -> &mut Json {
        self.key(key).0.push_str(&v.to_string());
        self
    }
    fn flag(&mut self, key: &str, on: bool) -> &mut Json {
        self.key(key).0.push_str(if on { "true" } else { "false" });
        self
    }
    fn num(&mut self, key: &str, v: f64) -> &mut Json {
        self.key(key);
        push_number(&mut self.0, v);
        self
    }
    fn nums(&mut self, key: &str, values: &[f64]) -> &mut Json {
        self.key(key).0.push('[');
        for (i, v) in values.iter().enumerate() {
            if i > 0 {
                self.0.push(',');
            }
            push_number(&mut self.0, *v);
        }
        self.0.push(']');
        self
    }
}

/// Shortest exact form; JSON has no infinities.
fn push_number(out: &mut String, v: f64) {
    use std::fmt::Write as _;
    if !v.is_finite() {
        out.push_str("null");
        return;
    }
    let _ = write!(out, "{v:?}");
    if out.ends_with(".0") {
        out.truncate(out.len() - 2);
    }
}

/// How the CSV is written.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct CsvOptions {
    /// Positions in the machine frame instead of the work frame.
    pub machine: bool,
    /// Curves as chords no farther than this from the path, mm; without it one row per move.
    pub tolerance: Option<f64>,
    /// Rates for the time column.
    pub rates: Rates,
}

/// Writes one row per move: number, kind, X … W (mm, degrees), feed, elapsed time, tool, spindle, source.
pub fn csv(program: &Program, options: &CsvOptions, out: &mut dyn Write) -> Result<()> {
    out.write_all(
        b"op,kind,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,u_mm,v_mm,w_mm,feed,feed_unit,time_s,tool,spindle,spindle_unit,file,line\n",
    )?;
    let mut buffer = String::new();
    let mut ns = 0;
    let clock = Clock::new(program, &options.rates);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        ns += clock.measure(&view).ns();
        if !view.op.moves() && !matches!(view.op, Op::Dwell(_) | Op::RigidTap { .. }) {
            continue;
        }
        match options.tolerance {
            Some(tolerance) if view.op.moves() => {
                flatten(&view.op, view.start, view.end, tolerance, |p| row(&mut buffer, &view, p, ns, options));
            }
            _ => row(&mut buffer, &view, &view.end.axes, ns, options),
        }
        if buffer.len() > 1 << 16 {
            out.write_all(buffer.as_bytes())?;
            buffer.clear();
        }
    }
    out.write_all(buffer.as_bytes())
}

fn row(out: &mut String, view: &View<'_, '_>, axes: &Axes, ns: u64, options: &CsvOptions) {
    let p = if options.machine { view.state.machine(axes) } else { *axes };
    out.push_str(&(view.index + 1).to_string());
    out.push(',');
    out.push_str(kind(&view.op));
    for (i, v) in p.iter().enumerate() {
        out.push(',');
        push_number(out, if (3..6).contains(&i) { v.to_degrees() } else { *v });
    }
    let turns = matches!(length(&view.op, view.start, view.end), Length::Angular(_));
    let (feed, unit) = match (view.state.feed_mode, turns) {
        (FeedMode::PerTime, false) => (view.state.feed * 60.0, "mm/min"),
        (FeedMode::PerTime, true) => (view.state.feed_angular.to_degrees() * 60.0, "deg/min"),
        (FeedMode::PerRev, false) => (view.state.feed, "mm/rev"),
        (FeedMode::PerRev, true) => (view.state.feed_angular.to_degrees(), "deg/rev"),
        (FeedMode::Inverse, _) => (view.state.feed * 60.0, "1/min"),
    };
    out.push(',');
    push_number(out, libm::round(feed * 1e9) / 1e9);
    let spindle = view.state.spindle(0);
    // Surface speed in mm/s.
    let (factor, spindle_unit) = if spindle.surface.is_some() { (0.06, "m/min") } else { (1.0, "rpm") };
    let speed = libm::round(spindle.speed * factor * 1e9) / 1e9 * f64::from(spindle.turn as i8);
    let source = view.source;
    out.push_str(&format!(",{unit},{:.6},{},", ns as f64 / 1e9, view.state.tool));
    push_number(out, speed);
    out.push_str(&format!(",{spindle_unit},{},{}\n", source.file.0, u64::from(source.line) + 1));
}

fn kind(op: &Op<'_>) -> &'static str {
    match op {
        Op::Rapid => "rapid",
        Op::Linear => "linear",
        Op::Arc(_) => "arc",
        Op::Nurbs { .. } => "nurbs",
        Op::Probe(_) => "probe",
        Op::RigidTap { .. } => "rigid_tap",
        _ => "dwell",
    }
}
