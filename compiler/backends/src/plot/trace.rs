//! The path with everything a viewer asks: where each point comes from, when it is reached, how fast. This is the data
//! of the preview component (`editors/preview`), of the page that holds it, and of the language server's
//! `gccRobot/preview` (`docs/editor-features.md`).

use gr_ir::geometry::{Extent, flatten};
use gr_ir::measure::{Known, Rates, Totals};
use gr_ir::timing::Clock;
use gr_ir::{FileId, Op, Pose, Program, Source, View};
use gr_machine::math::Frame;
use gr_machine::{JointKind, Machine};
use serde_json::{Value, json};

pub use super::path::Class;
use super::path::{Common, moves_frame, rough_size, single};
use crate::sheet::ToolRow;

/// A kind: the point begins a new line.
pub const JUMP: u8 = 255;

/// What a trace is made with.
#[derive(Clone, PartialEq, Debug)]
pub struct TraceOptions {
    /// Greatest distance of the points from curves, mm; none = by the size of the part.
    pub tolerance: Option<f64>,
    /// Most points that are kept.
    pub most_points: usize,
    /// The file whose lines are meant: blocks of others count as the line that called them.
    pub document: FileId,
    /// Diameters and comments of tools.
    pub tools: Vec<ToolRow>,
    /// Rapid rates, and what the machine can do.
    pub rates: Rates,
}

impl Default for TraceOptions {
    fn default() -> TraceOptions {
        TraceOptions { tolerance: None, most_points: 4_000_000, document: FileId(0), tools: Vec::new(), rates: Rates::default() }
    }
}

/// A tool change on the way.
#[derive(Clone, PartialEq, Debug)]
pub struct TraceTool {
    /// First point with this tool.
    pub point: u32,
    /// Number.
    pub number: i32,
    /// mm.
    pub diameter: Option<f64>,
    /// Comment of the tool table.
    pub comment: String,
    /// Line of the change, from 0.
    pub line: u32,
}

/// The path. Point `i` is joined to point `i - 1`, unless its kind is [`JUMP`].
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Trace {
    /// X Y Z, mm, in the work frame that the program moves in first.
    pub positions: Vec<[f32; 3]>,
    /// How each point is reached: a [`Class`] as number, or [`JUMP`].
    pub kinds: Vec<u8>,
    /// Line of each point's block, from 0.
    pub lines: Vec<u32>,
    /// Seconds since the beginning.
    pub times: Vec<f32>,
    /// mm/min; 0 for rapids.
    pub feeds: Vec<f32>,
    /// Tool changes in order.
    pub tools: Vec<TraceTool>,
    /// All points.
    pub bounds: Extent,
    /// Those reached at feed.
    pub cut: Extent,
    /// Sums.
    pub totals: Totals,
    /// There are more points than were kept.
    pub truncated: bool,
    /// The block that each point belongs to.
    pub sources: Vec<Source>,
    /// Lowest and highest corner of the raw part, mm.
    pub stock: Option<[[f64; 3]; 2]>,
    /// The machine along the path.
    pub machine: Option<TraceMachine>,
    /// Rapids go as this machine makes them, not in lines.
    pub bent: bool,
}

/// The machine that was chosen, and how it stands along the path.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct TraceMachine {
    /// Its id.
    pub id: String,
    /// For people.
    pub title: String,
    /// Names of its joints.
    pub joints: Vec<String>,
    /// `deg` or `mm`, per joint.
    pub units: Vec<String>,
    /// Limits per joint, in the same unit.
    pub limits: Vec<[Option<f64>; 2]>,
    /// Joints × points, in the same unit; NaN where they are not known.
    pub values: Vec<f32>,
    /// Base, table and part: name, origin and axes, in the frame of the path.
    pub frames: Vec<(String, Frame)>,
    /// Points of each line of its figure; none: it has no figure.
    pub lines: Vec<u32>,
    /// The figure is known at every so many points of the path.
    pub every: u32,
    /// X Y Z of the figure's points in the frame of the path, one figure after the other; NaN where it isn't known.
    pub figure: Vec<f32>,
    /// What is to be said about the values: why there are none, or where they come from.
    pub note: String,
}

/// Points with joint values; the picture of the machine is coarser in longer paths.
const MOST_VALUES: usize = 200_000;
/// Figures along a path.
const MOST_FIGURES: usize = 2_000;

impl TraceMachine {
    /// A machine of which no joint values are known.
    pub fn new(machine: &Machine, note: String) -> TraceMachine {
        let part = machine.cell.part_in_base();
        TraceMachine {
            id: machine.id.clone(),
            title: machine.title.clone(),
            joints: machine.joints.iter().map(|j| j.name.clone()).collect(),
            units: machine.joints.iter().map(|j| if j.kind == JointKind::Revolute { "deg" } else { "mm" }.into()).collect(),
            limits: machine.joints.iter().map(|j| [j.min, j.max].map(|v| v.map(|v| in_units(j.kind, v)))).collect(),
            frames: frames(machine, &part),
            every: 1,
            note,
            ..TraceMachine::default()
        }
    }
    /// With joint values and tool point in the base (mm, rad) for each of some points; `work`: the frame of the path in
    /// the base.
    pub fn along(self, machine: &Machine, work: &Frame, count: usize, stand: &dyn Fn(usize) -> Option<Stand>) -> TraceMachine {
        let back = work.inverse();
        let every = count.div_ceil(MOST_FIGURES).max(1);
        let mut out = TraceMachine { frames: frames(machine, work), every: every as u32, ..self };
        for i in 0..count.min(MOST_VALUES) {
            let stand = stand(i);
            let value = |(n, j): (usize, &gr_machine::Joint)| stand.as_ref().and_then(|s| s.0.get(n)).map_or(f32::NAN, |v| in_units(j.kind, *v) as f32);
            out.values.extend(machine.joints.iter().enumerate().map(value));
        }
        let figure = |i: usize| {
            let (joints, tip) = stand(i)?;
            let mut lines = machine.figure(&joints)?;
            lines.first_mut()?.push(tip);
            Some(lines)
        };
        let figures: Vec<Option<Vec<Vec<[f64; 3]>>>> = (0..count).step_by(every).map(figure).collect();
        let Some(shape) = figures.iter().flatten().next() else { return out };
        out.lines = shape.iter().map(|l| l.len() as u32).collect();
        let nodes = out.lines.iter().sum::<u32>() as usize;
        for f in &figures {
            match f {
                Some(lines) => out.figure.extend(lines.iter().flatten().flat_map(|p| back.apply(*p).map(|v| v as f32))),
                None => out.figure.extend(std::iter::repeat_n(f32::NAN, 3 * nodes)),
            }
        }
        out
    }
}

/// Joint values and tool point.
pub type Stand = (Vec<f64>, [f64; 3]);

fn in_units(kind: JointKind, value: f64) -> f64 {
    if kind == JointKind::Revolute { value.to_degrees() } else { value }
}

/// Base, table and part in the frame of the path; a table that is nowhere else than the base has no name of its own.
fn frames(machine: &Machine, work: &Frame) -> Vec<(String, Frame)> {
    let back = work.inverse();
    let mut out = vec![("base".to_string(), back)];
    if machine.cell.table != Frame::IDENTITY {
        out.push(("table".into(), back.then(&machine.cell.table)));
    }
    out.push(("part".into(), back.then(&machine.cell.part_in_base())));
    out
}

struct Run<'p> {
    program: &'p Program,
    options: &'p TraceOptions,
    trace: Trace,
    tolerance: f64,
    common: Common,
    /// The last point as it is, before it was rounded to f32.
    last: Option<[f64; 3]>,
    line: (Source, u32),
    diameters: Vec<(i32, f64)>,
}

impl Trace {
    /// Takes the points of a program.
    pub fn new(program: &Program, options: &TraceOptions) -> Trace {
        let tolerance = options.tolerance.filter(|t| *t > 0.0).unwrap_or_else(|| rough_size(program) / 4000.0);
        let mut run = Run {
            program,
            options,
            trace: Trace::default(),
            tolerance,
            common: Common::new(),
            last: None,
            line: (Source::default(), 0),
            diameters: Vec::new(),
        };
        run.line.1 = run.find_line(Source::default());
        let (mut fresh, mut known) = (true, Known::default());
        let clock = Clock::new(program, &options.rates);
        let mut cursor = program.cursor();
        while let Some(view) = cursor.next() {
            let before = run.trace.totals.ns();
            let measured = clock.measure(&view);
            run.trace.totals.add(&measured);
            let start = known.start(&view);
            match Class::of(&view.op) {
                Some(class) => {
                    if fresh {
                        run.common.enter(view.state);
                    }
                    fresh = false;
                    if let Some(start) = start {
                        // Along the curve, not along the points that stand for it.
                        let feed = if measured.feed_ns > 0 { measured.feed_nm as f64 / measured.feed_ns as f64 * 60e3 } else { 0.0 };
                        run.moved(&view, &start, class, (before, feed));
                    }
                }
                None => {
                    fresh |= moves_frame(&view.op);
                    run.stood(&view, before);
                }
            }
        }
        run.trace
    }

    /// Puts places between points and those before them, in ascending order of the points: the way there isn't straight.
    pub fn bend(&mut self, ways: &[(usize, Vec<[f64; 3]>)]) {
        let old = std::mem::take(self);
        let room = old.positions.len() + ways.iter().map(|w| w.1.len()).sum::<usize>();
        let mut out = Trace { positions: Vec::with_capacity(room), bent: old.bent || !ways.is_empty(), ..Trace::default() };
        let mut tools = old.tools.iter().cloned().peekable();
        let mut waiting = ways.iter().peekable();
        for i in 0..old.positions.len() {
            while let Some(tool) = tools.next_if(|t| t.point as usize <= i) {
                out.tools.push(TraceTool { point: out.positions.len() as u32, ..tool });
            }
            if let Some((_, places)) = waiting.next_if(|w| w.0 == i && i > 0) {
                let (from, to) = (old.times[i - 1], old.times[i]);
                for (k, p) in places.iter().enumerate() {
                    out.bounds.add(*p);
                    let share = (k + 1) as f32 / (places.len() + 1) as f32;
                    out.put(&old, i, single(*p), from + (to - from) * share);
                }
            }
            out.put(&old, i, old.positions[i], old.times[i]);
        }
        let count = out.positions.len() as u32;
        out.tools.extend(tools.map(|t| TraceTool { point: count, ..t }));
        let bounds = [old.bounds.min, old.bounds.max];
        if !old.bounds.is_empty() {
            bounds.into_iter().for_each(|p| out.bounds.add(p));
        }
        *self = Trace { cut: old.cut, totals: old.totals, truncated: old.truncated, stock: old.stock, machine: old.machine, ..out };
    }

    fn put(&mut self, like: &Trace, i: usize, place: [f32; 3], time: f32) {
        self.positions.push(place);
        self.times.push(time);
        self.kinds.push(like.kinds[i]);
        self.lines.push(like.lines[i]);
        self.feeds.push(like.feeds[i]);
        self.sources.push(like.sources[i]);
    }

    /// A name for this path: the same path has the same one, on every machine.
    pub fn key(&self) -> String {
        let mut h = 0xcbf2_9ce4_8422_2325u64;
        let mut add = |v: u64| h = (h ^ v).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(17);
        let pair = |a: f32, b: u32| u64::from(a.to_bits()) << 32 | u64::from(b);
        add(self.kinds.len() as u64);
        for (i, p) in self.positions.iter().enumerate() {
            add(pair(p[0], p[1].to_bits()));
            add(pair(p[2], self.lines[i]));
            add(pair(self.feeds[i], u32::from(self.kinds[i])));
        }
        for t in &self.tools {
            add(u64::from(t.point) << 32 | u64::from(t.number as u32));
            add(t.diameter.unwrap_or(0.0).to_bits());
        }
        self.stock.iter().flatten().flatten().for_each(|v| add(v.to_bits()));
        if let Some(m) = &self.machine {
            m.id.bytes().chain(m.note.bytes()).for_each(|b| add(u64::from(b)));
            m.values.chunks(2).for_each(|v| add(pair(v[0], v.get(1).map_or(0, |v| v.to_bits()))));
            m.frames.iter().flat_map(|f| f.1.position).for_each(|v| add(v.to_bits()));
        }
        format!("{h:016x}")
    }

    /// The answer of `gccRobot/preview` about this path, under this key; without the long lists when the asker has
    /// the path already (`docs/editor-features.md`). `uri` names the document.
    pub fn json(&self, uri: &str, key: &str, unchanged: bool) -> Value {
        let tools: Vec<Value> = self.tools.iter().map(tool).collect();
        let floats = |list: &[f32]| if unchanged { String::new() } else { base64(&list.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>()) };
        let bytes = |list: &[u8]| if unchanged { String::new() } else { base64(list) };
        json!({
            "uri": uri,
            "version": 0,
            "key": key,
            "unchanged": unchanged,
            "count": self.positions.len(),
            "positions": floats(self.positions.as_flattened()),
            "kinds": bytes(&self.kinds),
            "lines": if unchanged { String::new() } else { base64(&self.lines.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>()) },
            "times": floats(&self.times),
            "feeds": floats(&self.feeds),
            "files": [uri],
            "tools": tools,
            "bounds": corners(&self.bounds),
            "cut": corners(&self.cut),
            "stock": self.stock,
            "seconds": self.totals.seconds(),
            "rapidSeconds": self.totals.rapid_ns as f64 / 1e9,
            "cutLength": self.totals.feed_nm as f64 / 1e6,
            "rapidLength": self.totals.rapid_nm as f64 / 1e6,
            "truncated": self.truncated,
            "machine": self.machine.as_ref().map(|m| json!({
                "id": m.id,
                "title": m.title,
                "joints": m.joints,
                "units": m.units,
                "limits": m.limits,
                "values": floats(&m.values),
                "frames": m.frames.iter().map(frame).collect::<Vec<Value>>(),
                "figure": { "lines": m.lines, "every": m.every, "points": floats(&m.figure) },
                "note": m.note,
            })),
        })
    }
}

fn tool(t: &TraceTool) -> Value {
    json!({ "point": t.point, "number": t.number, "diameter": t.diameter, "comment": t.comment, "line": t.line })
}

fn frame((name, f): &(String, Frame)) -> Value {
    json!({ "name": name, "origin": f.position, "axes": [f.axis(0), f.axis(1), f.axis(2)] })
}

/// Corners of a box; none when it is empty.
pub fn corners(extent: &Extent) -> Option<[[f32; 3]; 2]> {
    (!extent.is_empty()).then(|| [single(extent.min), single(extent.max)])
}

impl Run<'_> {
    /// Points of a move.
    fn moved(&mut self, view: &View<'_, '_>, from: &Pose, class: Class, (before, feed): (u64, f64)) {
        let start = self.common.place(&from.axes);
        let line = self.line_of(view.source);
        if self.last.is_none_or(|last| single(last) != single(start)) {
            self.add(start, JUMP, line, before, 0.0, view.source);
        }
        let mut points = Vec::new();
        let (tolerance, common) = (self.tolerance, &self.common);
        flatten(&view.op, from, view.end, tolerance, |p| points.push(common.place(p)));
        let way = |a: &[f64; 3], b: &[f64; 3]| libm::sqrt((0..3).map(|i| (b[i] - a[i]) * (b[i] - a[i])).sum());
        let mut last = start;
        let mut steps: Vec<f64> = Vec::with_capacity(points.len());
        for p in &points {
            steps.push(way(&last, p));
            last = *p;
        }
        let whole: f64 = steps.iter().sum();
        let ns = self.trace.totals.ns().saturating_sub(before);
        let feed = if class == Class::Rapid { 0.0 } else { feed };
        let mut gone = 0.0;
        for (i, (p, step)) in points.iter().zip(&steps).enumerate() {
            gone += step;
            let share = if whole > 0.0 { gone / whole } else { (i + 1) as f64 / points.len() as f64 };
            let at = before.saturating_add((ns as f64 * share) as u64);
            self.add(*p, class as u8, line, at, feed, view.source);
            if class != Class::Rapid {
                self.trace.cut.add(*p);
            }
        }
        if class != Class::Rapid && !points.is_empty() {
            self.trace.cut.add(start);
        }
    }

    /// What is no move: tool changes are noted, waiting makes a point that stays.
    fn stood(&mut self, view: &View<'_, '_>, before: u64) {
        match view.op {
            Op::ToolEntry { tool, diameter, .. } => self.diameters.push((tool, diameter)),
            Op::ToolChange(_) | Op::ToolNumber(_) => self.changed(view),
            _ => {}
        }
        let now = self.trace.totals.ns();
        if let Some(last) = self.last.filter(|_| now > before) {
            let kind = self.trace.kinds.last().copied().unwrap_or(JUMP);
            let line = self.line_of(view.source);
            self.add(last, kind, line, now, 0.0, view.source);
        }
    }

    fn changed(&mut self, view: &View<'_, '_>) {
        let number = view.state.tool;
        let row = self.options.tools.iter().find(|t| t.number == number);
        let own = self.diameters.iter().rev().find(|d| d.0 == number).map(|d| d.1);
        let line = self.line_of(view.source);
        self.trace.tools.push(TraceTool {
            point: self.trace.positions.len() as u32,
            number,
            diameter: row.map(|t| t.diameter).or(own).filter(|d| *d > 0.0),
            comment: row.map_or(String::new(), |t| t.comment.clone()),
            line,
        });
    }

    fn add(&mut self, p: [f64; 3], kind: u8, line: u32, ns: u64, feed: f64, source: Source) {
        let t = &mut self.trace;
        t.bounds.add(p);
        self.last = Some(p);
        if t.positions.len() >= self.options.most_points {
            t.truncated = true;
            return;
        }
        t.positions.push(single(p));
        t.kinds.push(kind);
        t.lines.push(line);
        t.times.push((ns as f64 / 1e9) as f32);
        t.feeds.push(feed as f32);
        t.sources.push(source);
    }

    fn line_of(&mut self, source: Source) -> u32 {
        if self.line.0 != source {
            self.line = (source, self.find_line(source));
        }
        self.line.1
    }

    /// The block's line in the document, else that of the innermost call there.
    fn find_line(&self, source: Source) -> u32 {
        let document = self.options.document;
        if source.file == document {
            return source.line;
        }
        let mut stack = self.program.call_stack(source);
        stack.find(|f| f.file == document).map_or(source.line, |f| f.line)
    }
}

/// Bytes as base64.
pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i)) as usize & 63];
            out.push(if i <= three.len() { char::from(digit) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    #[test]
    fn base64_of_every_length() {
        let all: Vec<String> = [&b""[..], b"f", b"fo", b"foo", b"foob", b"fooba", b"foobar"].iter().map(|b| super::base64(b)).collect();
        assert_eq!(all, ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"]);
    }
}
