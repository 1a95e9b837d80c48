//! Requests of our own: tool path, output, state, choices.

use std::sync::Arc;

use gr_ide::gcode::modes::{codes, moves};
use gr_ir::geometry::{Extent, flatten};
use gr_ir::measure::Known;
use gr_ir::timing::Clock;
use gr_ir::{FileId, Op, Pose, Source, State};
use tower_lsp::ls_types as lsp;

use super::Answer;
use crate::documents::{Kind, Motion, View};
use crate::host::{Made, OutputJob};
use crate::protocol::custom::{
    BlockFacts, Choice, Choices, Explanation, JUMP, Modes, Output, OutputFile, OutputParams, Preview, PreviewMachine, PreviewParams,
    PreviewTool, State as StateAnswer, base64, floats, integers,
};

/// Points that are sent unless the client wants more or fewer.
const MOST_POINTS: u32 = 4_000_000;

/// The tool path.
pub fn preview(mut view: View, p: &PreviewParams) -> Answer<Preview> {
    view.release();
    if view.is_overtaken() {
        return Err(super::Failure::Overtaken);
    }
    let mut out = Preview { uri: view.uri.as_str().into(), version: view.version, ..Preview::default() };
    let Some(motion) = view.motion() else { return Ok(out) };
    let tolerance = p.tolerance.filter(|t| *t > 0.0).unwrap_or_else(|| size(&motion) / 4_000.0);
    let most = p.most_points.unwrap_or(MOST_POINTS) as usize;
    let path = Points::of(&motion, tolerance, most);
    out.key = format!("{:016x}", path.hash());
    out.files = motion.files.iter().map(|f| f.to_string()).collect();
    out.count = path.kinds.len() as u32;
    out.bounds = boxed(&path.all);
    out.cut = boxed(&path.cut);
    out.stock = motion.stock.map(|s| s.map(|p| p.map(|v| v as f32)));
    out.seconds = motion.report.totals.seconds();
    out.rapid_seconds = motion.report.totals.rapid_ns as f64 / 1e9;
    out.cut_length = motion.report.totals.feed_nm as f64 / 1e6;
    out.rapid_length = motion.report.totals.rapid_nm as f64 / 1e6;
    out.truncated = path.truncated;
    out.tools = path.tools.clone();
    for t in &mut out.tools {
        let row = view.station.setup.tools.rows.iter().skip(1).find(|r| r.number == t.number && &*r.comment != gr_interp::ASSUMED);
        let scale = if view.station.setup.machine_units == gr_canon::Units::Inch { 25.4 } else { 1.0 };
        t.diameter = row.map(|r| r.diameter * scale);
        t.comment = row.map_or(String::new(), |r| r.comment.to_string());
    }
    if p.have.as_deref() == Some(out.key.as_str()) {
        out.unchanged = true;
        return Ok(out);
    }
    out.machine = view.station.machine.as_ref().map(|m| machine(m, &path));
    out.positions = floats(path.positions.iter().flatten().copied());
    out.kinds = base64(&path.kinds);
    out.lines = integers(path.lines.iter().copied());
    out.times = floats(path.times.iter().copied());
    out.feeds = floats(path.feeds.iter().copied());
    Ok(out)
}

fn boxed(e: &Extent) -> Option<[[f32; 3]; 2]> {
    (!e.is_empty()).then(|| [e.min.map(|v| v as f32), e.max.map(|v| v as f32)])
}

/// Largest side of the box around all moves, mm.
fn size(motion: &Motion) -> f64 {
    let size = motion.report.all.size().into_iter().fold(0.0, f64::max);
    if size.is_finite() { size.max(1.0) } else { 100.0 }
}

/// The path as points.
#[derive(Default)]
struct Points {
    positions: Vec<[f32; 3]>,
    kinds: Vec<u8>,
    lines: Vec<u32>,
    times: Vec<f32>,
    feeds: Vec<f32>,
    tools: Vec<PreviewTool>,
    all: Extent,
    cut: Extent,
    truncated: bool,
}

fn kind(op: &Op<'_>) -> Option<u8> {
    Some(match op {
        Op::Rapid => 0,
        Op::Linear => 1,
        Op::Arc(_) | Op::Nurbs { .. } => 2,
        Op::Probe(_) | Op::RigidTap { .. } => 3,
        _ => return None,
    })
}

impl Points {
    fn of(motion: &Motion, tolerance: f64, most: usize) -> Points {
        let mut out = Points::default();
        let (mut known, mut frame) = (Known::default(), Common::default());
        let (mut ns, mut fresh) = (0u64, true);
        let clock = Clock::new(&motion.program, &motion.rates);
        let lines = Lines { motion };
        let mut cursor = motion.program.cursor();
        while let Some(view) = cursor.next() {
            let t = clock.measure(&view);
            let start = known.start(&view);
            if let Op::ToolChange(_) | Op::ToolNumber(_) = view.op {
                let tool = PreviewTool {
                    point: out.kinds.len() as u32,
                    number: view.state.tool,
                    line: lines.of(view.source),
                    ..PreviewTool::default()
                };
                out.tools.push(tool);
            }
            let Some(kind) = kind(&view.op) else {
                fresh |= matches!(view.op, Op::WorkOffset(..) | Op::LocalOffset(_) | Op::Rotation(_));
                ns = ns.saturating_add(t.ns());
                continue;
            };
            if std::mem::take(&mut fresh) {
                frame.enter(view.state);
            }
            let from = ns;
            ns = ns.saturating_add(t.ns());
            let Some(start) = start else { continue };
            if out.kinds.len() >= most {
                out.truncated = true;
                continue;
            }
            let feed = if t.feed_ns > 0 { t.feed_nm as f64 / t.feed_ns as f64 * 1e3 * 60.0 } else { 0.0 };
            out.add(&view.op, &start, view.end, (kind, lines.of(view.source), feed as f32), (from, ns), &frame, tolerance);
        }
        out
    }

    #[expect(clippy::too_many_arguments, reason = "one place that adds points")]
    fn add(&mut self, op: &Op<'_>, start: &Pose, end: &Pose, (kind, line, feed): (u8, u32, f32), (from, to): (u64, u64), frame: &Common, tolerance: f64) {
        let first = frame.place(&start.axes);
        let joined = self.positions.last() == Some(&first.map(|v| v as f32));
        if !joined {
            self.push(first, JUMP, line, from, 0.0);
        }
        let begin = self.kinds.len();
        flatten(op, start, end, tolerance, |p| self.push(frame.place(p), kind, line, to, feed));
        // Times in between: by share of the way.
        let count = self.kinds.len() - begin;
        for i in 0..count.saturating_sub(1) {
            let share = (i + 1) as f64 / count as f64;
            self.times[begin + i] = ((from as f64 + (to - from) as f64 * share) / 1e9) as f32;
        }
        if matches!(kind, 1 | 2) {
            self.cut.add(first);
            let points = &self.positions[begin..];
            points.iter().for_each(|p| self.cut.add(p.map(f64::from)));
        }
    }

    fn push(&mut self, p: [f64; 3], kind: u8, line: u32, ns: u64, feed: f32) {
        self.all.add(p);
        self.positions.push(p.map(|v| v as f32));
        self.kinds.push(kind);
        self.lines.push(line);
        self.times.push((ns as f64 / 1e9) as f32);
        self.feeds.push(feed);
    }

    /// The same path has the same number, on every machine.
    fn hash(&self) -> u64 {
        let mut h = 0xcbf2_9ce4_8422_2325u64;
        let mut add = |v: u64| h = (h ^ v).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(17);
        add(self.kinds.len() as u64);
        for (i, p) in self.positions.iter().enumerate() {
            add(u64::from(p[0].to_bits()) << 32 | u64::from(p[1].to_bits()));
            add(u64::from(p[2].to_bits()) << 32 | u64::from(self.lines[i]));
            add(u64::from(self.feeds[i].to_bits()) << 8 | u64::from(self.kinds[i]));
        }
        self.tools.iter().for_each(|t| add(u64::from(t.point) << 32 | u64::from(t.number as u32)));
        h
    }
}

/// Positions in the work frame that the program moves in first, without tool offsets.
#[derive(Default)]
struct Common {
    first: Option<State>,
    here: State,
    same: bool,
}

impl Common {
    fn enter(&mut self, state: &State) {
        let mut state = *state;
        state.tool_offset = [0.0; 9];
        let offsets = |s: &State| (s.work_offset, s.local_offset, s.rotation);
        let first = self.first.get_or_insert(state);
        self.same = offsets(first) == offsets(&state);
        self.here = state;
    }
    fn place(&self, axes: &[f64; 9]) -> [f64; 3] {
        match &self.first {
            Some(first) if !self.same => {
                let p = first.work_frame(&self.here.machine(axes));
                [p[0], p[1], p[2]]
            }
            _ => [axes[0], axes[1], axes[2]],
        }
    }
}

/// Lines of the main file.
struct Lines<'m> {
    motion: &'m Motion,
}

impl Lines<'_> {
    /// The line of a block; of one in another file, the line that called it.
    fn of(&self, source: Source) -> u32 {
        if source.file == FileId(0) {
            return source.line;
        }
        let caller = self.motion.program.call_stack(source).find(|f| f.file == FileId(0));
        caller.map_or(u32::MAX, |f| f.line)
    }
}

/// Joint values along the path.
fn machine(m: &Arc<gr_machine::Machine>, path: &Points) -> PreviewMachine {
    /// Points beyond this have no joint values: the picture of the machine follows coarsely.
    const MOST: usize = 200_000;
    let names = m.joints.iter().map(|j| j.name.clone()).collect();
    let unit = |k| if k == gr_machine::JointKind::Revolute { "deg".to_string() } else { "mm".to_string() };
    let mut last: Option<Vec<f64>> = m.start_joints.clone();
    let mut values: Vec<f32> = Vec::new();
    for p in path.positions.iter().take(MOST) {
        let found = crate::machine::joints(m, p.map(f64::from), last.as_deref());
        match &found {
            Some(joints) => values.extend(m.joints.iter().zip(joints).map(|(j, v)| crate::machine::in_units(j.kind, *v) as f32)),
            None => values.extend(m.joints.iter().map(|_| f32::NAN)),
        }
        last = found.or(last);
    }
    let limit = |j: &gr_machine::Joint| [j.min, j.max].map(|v| v.map(|v| crate::machine::in_units(j.kind, v)));
    PreviewMachine {
        id: m.id.clone(),
        title: m.title.clone(),
        joints: names,
        units: m.joints.iter().map(|j| unit(j.kind)).collect(),
        limits: m.joints.iter().map(limit).collect(),
        values: floats(values),
    }
}

/// What a target makes of the document.
pub fn output(mut view: View, p: &OutputParams) -> Answer<Output> {
    view.release();
    let mut out = Output { uri: view.uri.as_str().into(), version: view.version, target: p.target.clone(), ..Output::default() };
    let options = p.options.iter().filter_map(|(k, v)| Some((k.clone(), shown(v)?))).collect();
    let job = OutputJob {
        path: &view.path,
        text: view.text.to_string().into(),
        settings: &view.settings,
        station: &view.station,
        target: &p.target,
        options,
        machine: p.machine.as_deref(),
    };
    match view.host.output(&job) {
        Err(why) => out.error = Some(why),
        Ok(Made { files, found }) => {
            let own = |at: (FileId, gr_text::Span)| {
                (at.0 == FileId(0)).then(|| lsp::Location { uri: view.uri.clone(), range: view.range(at.1) })
            };
            out.diagnostics = found.iter().map(|d| crate::protocol::diagnostic(d, &view.text, view.columns, &own)).collect();
            out.files = files
                .into_iter()
                .map(|f| match String::from_utf8(f.bytes) {
                    Ok(text) => OutputFile { name: f.name, text, base64: None, lines: integers(f.lines) },
                    Err(e) => OutputFile { name: f.name, text: String::new(), base64: Some(base64(e.as_bytes())), lines: String::new() },
                })
                .collect();
        }
    }
    Ok(out)
}

/// A value as an option of the command has it; none: the option is not given.
fn shown(v: &serde_json::Value) -> Option<String> {
    match v {
        serde_json::Value::Null | serde_json::Value::Bool(false) => None,
        serde_json::Value::Bool(true) => Some(String::new()),
        serde_json::Value::String(s) => Some(s.clone()),
        other => Some(other.to_string()),
    }
}

/// Everything about a block.
pub fn state(view: View, at: lsp::Position) -> Answer<StateAnswer> {
    let mut out = StateAnswer { line: at.line, ..StateAnswer::default() };
    let Kind::Gcode(..) = view.kind else { return Ok(out) };
    let Some(t) = super::look::trace_line(&view, at.line, &[])? else { return Ok(out) };
    let m = moves(&t.program, t.before.units());
    out.reached = true;
    out.before = Some(modes(&view, &t.before));
    out.after = Some(modes(&view, &t.after));
    let mm = (m.totals.feed_nm + m.totals.rapid_nm) as f64 / 1e6;
    out.block = Some(BlockFacts {
        moves: m.totals.moves as u32,
        length: mm,
        seconds: (m.totals.untimed == 0).then(|| m.totals.seconds()),
        center: m.arc.map(|a| a.center),
        radius: m.arc.map(|a| a.radius[0]),
        sweep: m.arc.map(|a| a.sweep),
    });
    Ok(out)
}

fn modes(view: &View, m: &gr_interp::Modal) -> Modes {
    let s = m.active_spindle.clamp(0, 7) as usize;
    let in_spindle = view.station.setup.tools.rows.get(usize::try_from(m.pocket).unwrap_or(0)).map_or(0, |t| t.number.max(0));
    Modes {
        position: m.current,
        units: if m.units() == gr_canon::Units::Inch { "inch" } else { "mm" }.into(),
        codes: codes(m),
        feed: m.feed,
        speed: m.speed[s],
        tool: if m.tool_changed != 0 || m.selected_tool > 0 { in_spindle } else { 0 },
        selected_tool: m.selected_tool.max(0),
    }
}

/// Targets, machines and dialects.
pub fn choices() -> Choices {
    let targets = gr_spec::TargetDef::all().iter().map(|t| Choice {
        id: t.id.into(),
        title: t.title.into(),
        detail: t.what.into(),
        extension: t.extension.into(),
        status: t.status.into(),
        options: t.options.iter().map(|o| (*o).to_string()).collect(),
    });
    let machines = gr_machine::list().filter_map(|id| {
        let m = gr_machine::builtin(id)?;
        Some(Choice { id: id.into(), title: m.title.clone(), detail: m.source.clone(), ..Choice::default() })
    });
    let dialects = gr_spec::Dialect::all().iter().map(|d| Choice { id: d.id.into(), title: d.title.into(), ..Choice::default() });
    Choices { targets: targets.collect(), machines: machines.collect(), dialects: dialects.collect() }
}

/// The long text of a diagnostic or a code.
pub fn explain(code: &str, dialect: Option<&str>) -> Explanation {
    if let Some(found) = gr_spec::Code::find(code) {
        let def = found.def();
        let mut text = format!("## {} {}\n\n{}\n", def.code, def.slug, def.explanation);
        for (title, example) in [("Raises it", def.bad), ("Does not", def.good)] {
            if let Some(example) = example {
                text.push_str(&format!("\n**{title}**\n\n```gcode\n{}\n```\n", example.trim_end()));
            }
        }
        return Explanation { markdown: Some(text) };
    }
    let dialect = dialect.and_then(gr_spec::Dialect::find).unwrap_or_else(gr_spec::Dialect::linuxcnc);
    let def = dialect.code(&code.trim().to_uppercase());
    Explanation { markdown: def.map(|d| gr_ide::gcode::hover::code(d, dialect)) }
}

