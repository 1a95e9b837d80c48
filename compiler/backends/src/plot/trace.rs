//! The path with everything a viewer asks: where each point comes from, when it is reached, how fast. This is the data
//! of the preview component (`editors/preview`), of the page that holds it, and of the language server's
//! `gccRobot/preview` (`docs/editor-features.md`).

use gr_ir::geometry::{Extent, flatten};
use gr_ir::measure::{Known, Rates, Totals};
use gr_ir::timing::Clock;
use gr_ir::{FileId, Op, Pose, Program, Source, View};
use serde_json::{Value, json};

use super::path::{Class, Common, moves_frame, rough_size, single};
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
    /// The operation that each point ends or lies in.
    pub operations: Vec<u32>,
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
                        run.moved(&view, &start, class, before);
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

    /// The answer of `gccRobot/preview` about this path. `uri` names the document.
    pub fn json(&self, uri: &str) -> Value {
        let tools: Vec<Value> = self.tools.iter().map(tool).collect();
        let floats = |list: &[f32]| base64(&list.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
        json!({
            "uri": uri,
            "version": 0,
            "key": "",
            "unchanged": false,
            "count": self.positions.len(),
            "positions": floats(self.positions.as_flattened()),
            "kinds": base64(&self.kinds),
            "lines": base64(&self.lines.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>()),
            "times": floats(&self.times),
            "feeds": floats(&self.feeds),
            "files": [uri],
            "tools": tools,
            "bounds": corners(&self.bounds),
            "cut": corners(&self.cut),
            "stock": null,
            "seconds": self.totals.seconds(),
            "rapidSeconds": self.totals.rapid_ns as f64 / 1e9,
            "cutLength": self.totals.feed_nm as f64 / 1e6,
            "rapidLength": self.totals.rapid_nm as f64 / 1e6,
            "truncated": self.truncated,
            "machine": null,
        })
    }
}

fn tool(t: &TraceTool) -> Value {
    json!({ "point": t.point, "number": t.number, "diameter": t.diameter, "comment": t.comment, "line": t.line })
}

/// Corners of a box; none when it is empty.
pub fn corners(extent: &Extent) -> Option<[[f32; 3]; 2]> {
    (!extent.is_empty()).then(|| [single(extent.min), single(extent.max)])
}

impl Run<'_> {
    /// Points of a move.
    fn moved(&mut self, view: &View<'_, '_>, from: &Pose, class: Class, before: u64) {
        let start = self.common.place(&from.axes);
        let line = self.line_of(view.source);
        if self.last.is_none_or(|last| single(last) != single(start)) {
            self.add(start, JUMP, line, before, 0.0, view.index);
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
        let feed = if class == Class::Rapid || ns == 0 { 0.0 } else { whole / (ns as f64 / 1e9) * 60.0 };
        let mut gone = 0.0;
        for (i, (p, step)) in points.iter().zip(&steps).enumerate() {
            gone += step;
            let share = if whole > 0.0 { gone / whole } else { (i + 1) as f64 / points.len() as f64 };
            let at = before.saturating_add((ns as f64 * share) as u64);
            self.add(*p, class as u8, line, at, feed, view.index);
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
            self.add(last, kind, line, now, 0.0, view.index);
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

    fn add(&mut self, p: [f64; 3], kind: u8, line: u32, ns: u64, feed: f64, operation: usize) {
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
        t.operations.push(operation as u32);
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
