//! A motion program as STEP-NC: a workplan of workingsteps with explicit tool paths, tools and technology, in a
//! Part 21 file of ISO 14649. A new workingstep begins where the tool changes or the program stops; feed, speed,
//! coolant and override locks stand with each tool path. What the standard has no counterpart for is an error, or, where losses are allowed, left out and
//! listed.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use gr_ir::geometry::ArcShape;
use gr_ir::{FeedMode, Marker, Note, Op, Program, Source, State, Stop, Turn, View};
use gr_text::{Diagnostic, FileId, Span, code};

/// What can be chosen.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Options {
    /// Name of the project.
    pub name: String,
    /// Leave out what has no counterpart, with a warning.
    pub lossy: bool,
    /// Tools by number: diameter and length, mm; none = a tool of 0.001 mm.
    pub tools: Vec<(i32, f64, f64)>,
    /// Helices, which the standard does not have, become chords no further from them than this, mm; 0 = 1e-6.
    pub tolerance: f64,
}

/// Writes a program.
///
/// # Errors
/// What STEP-NC cannot say, unless losses are allowed.
pub fn write(program: &Program, options: &Options) -> Result<(String, Vec<Diagnostic>), Vec<Diagnostic>> {
    write_at(program, options, &|source| (source.file, Span::default()))
}

/// The same; findings are at the places that `place` gives.
///
/// # Errors
/// As [`write`].
pub fn write_at(
    program: &Program,
    options: &Options,
    place: &dyn Fn(Source) -> (FileId, Span),
) -> Result<(String, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut w = Writer::new(program, options, place);
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        w.op(&view);
    }
    w.finish_step();
    if w.out.iter().any(|d| d.severity == gr_text::Severity::Error) {
        return Err(w.out);
    }
    let notes = std::mem::take(&mut w.out);
    Ok((w.file(), notes))
}

/// What holds for a workingstep.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Technology {
    tool: i32,
    feed: f64,
    speed: f64,
    turn: Turn,
    flood: bool,
    mist: bool,
    locks: (bool, bool),
}

#[derive(Clone, PartialEq, Debug)]
struct Run {
    rapid: bool,
    start: [f64; 3],
    pieces: Vec<Piece>,
    axes: Option<Vec<[f64; 3]>>,
}

#[derive(Clone, PartialEq, Debug)]
enum Piece {
    Line([f64; 3]),
    /// Centre, normal, end.
    Arc([f64; 3], [f64; 3], [f64; 3]),
}

#[derive(Clone, PartialEq, Debug)]
enum Element {
    Path(Run, Technology),
    Dwell(f64, Technology),
}

struct Writer<'a> {
    options: &'a Options,
    place: &'a dyn Fn(Source) -> (FileId, Span),
    out: Vec<Diagnostic>,
    data: Vec<String>,
    plan: Vec<usize>,
    operations: Vec<usize>,
    /// Where the feature's statement was begun; its operations are known at the end.
    feature_head: String,
    /// The first feed of the program: technology needs one even before it is used.
    first_feed: f64,
    elements: Vec<Element>,
    name: String,
    tools: BTreeMap<i32, usize>,
    /// Tools that were told to be unknown.
    unknown: BTreeSet<i32>,
    technologies: Vec<(Technology, usize)>,
    functions: BTreeMap<(bool, bool), usize>,
    workpiece: usize,
    feature: usize,
    highest: f64,
    steps: usize,
    /// Axes that some move has brought to a place: where the machine stands before, nobody knows.
    known: [bool; 3],
}

impl<'a> Writer<'a> {
    fn new(program: &'a Program, options: &'a Options, place: &'a dyn Fn(Source) -> (FileId, Span)) -> Writer<'a> {
        let mut highest = 0.0f64;
        for s in program.steps() {
            if s.op.moves() {
                highest = highest.max(s.end.axes[2]);
            }
        }
        let mut w = Writer {
            options,
            place,
            out: Vec::new(),
            data: Vec::new(),
            plan: Vec::new(),
            operations: Vec::new(),
            feature_head: String::new(),
            first_feed: program.steps().find_map(|s| match s.op {
                Op::Feed { linear, .. } if linear > 0.0 => Some(linear),
                _ => None,
            }).unwrap_or_default(),
            elements: Vec::new(),
            name: String::new(),
            tools: BTreeMap::new(),
            unknown: BTreeSet::new(),
            technologies: Vec::new(),
            functions: BTreeMap::new(),
            workpiece: 0,
            feature: 0,
            highest,
            steps: 0,
            known: [false; 3],
        };
        // Instance 1 is the project; it is written last.
        w.data.push(String::new());
        w.workpiece = w.add("WORKPIECE('part',$,$,$,$,$,())".into());
        let zero = w.placement([0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let depth = w.add(format!("PLANE('depth',#{zero})"));
        w.feature = w.add(String::new());
        w.feature_head = format!("#{zero},#{depth}");
        w
    }
    fn add(&mut self, text: String) -> usize {
        self.data.push(text);
        self.data.len()
    }
    fn point(&mut self, p: [f64; 3]) -> usize {
        self.add(format!("CARTESIAN_POINT('',({},{},{}))", real(p[0]), real(p[1]), real(p[2])))
    }
    fn direction(&mut self, d: [f64; 3]) -> usize {
        self.add(format!("DIRECTION('',({},{},{}))", real(d[0]), real(d[1]), real(d[2])))
    }
    fn placement(&mut self, p: [f64; 3], z: [f64; 3], x: [f64; 3]) -> usize {
        let (p, z, x) = (self.point(p), self.direction(z), self.direction(x));
        self.add(format!("AXIS2_PLACEMENT_3D('',#{p},#{z},#{x})"))
    }

    fn cannot(&mut self, what: &str, view: &View<'_, '_>) {
        let code = if self.options.lossy { code::STEPNC_LEFT_OUT } else { code::STEPNC_NO_COUNTERPART };
        let (file, span) = (self.place)(view.source);
        let d = Diagnostic::new(code, file, span, &[what.to_string()]);
        if !self.out.contains(&d) {
            self.out.push(d);
        }
    }

    fn op(&mut self, v: &View<'_, '_>) {
        match v.op {
            Op::Rapid => self.motion(v, true, |_, end| vec![Piece::Line(end)]),
            Op::Linear => self.motion(v, false, |_, end| vec![Piece::Line(end)]),
            Op::Arc(arc) => {
                let shape = ArcShape::new(&arc, v.start, v.end);
                if shape.rise.abs() > 1e-9 {
                    // ISO 14649 has no helix: short chords, no further from it than the tolerance.
                    let tolerance = if self.options.tolerance > 0.0 { self.options.tolerance } else { 1e-6 };
                    let chords = shape.pieces(tolerance);
                    return self.motion(v, false, |_, end| chorded(&shape, chords, end));
                }
                self.motion(v, false, |_, end| circle(&shape, arc.turns, end));
            }
            Op::Nurbs { .. } => self.cannot("a spline", v),
            Op::Probe(_) => self.cannot("probing without a workpiece (G38)", v),
            Op::RigidTap { .. } => self.cannot("rigid tapping without a hole (G33.1)", v),
            Op::SyncStart(_) => self.cannot("motion in step with the spindle (G33, G95)", v),
            Op::Dwell(s) => {
                let t = self.adopt(v.state, v);
                self.elements.push(Element::Dwell(s, t));
            }
            Op::FeedMode { mode, .. } if mode != FeedMode::PerTime => self.cannot("feed per revolution or inverse time", v),
            Op::SpindleMode { surface: Some(_), .. } => self.cannot("constant surface speed (G96)", v),
            Op::SpindleOrient { .. } | Op::SpindleWait { .. } => self.cannot("spindle orientation (M19)", v),
            Op::DigitalOut { .. } | Op::AnalogOut { .. } => self.cannot("an output (M62 to M68)", v),
            Op::InputWait { .. } => self.cannot("waiting for an input (M66)", v),
            Op::UserM { code, .. } => self.cannot(&format!("M{code}"), v),
            Op::RunTime(_) => self.cannot("a value known only at run time", v),
            Op::IndexerLock(..) => self.cannot("an indexing axis", v),
            Op::Rotation(r) if r != 0.0 => self.cannot("a rotated work frame", v),
            Op::LocalOffset(o) if o != [0.0; 9] => self.cannot("a shifted work frame (G92, G52)", v),
            Op::ToolEntry { .. } => self.cannot("writing the tool table (G10 L1)", v),
            Op::WorkOffset(n, _) if n > 1 => self.cannot("more than one work offset", v),
            Op::Override(gr_ir::Override::Adaptive, true) => self.cannot("adaptive feed (M52)", v),
            Op::Stop(stop) => {
                self.finish_step();
                let text = match stop {
                    Stop::Program => "PROGRAM_STOP('stop')",
                    Stop::Optional => "OPTIONAL_STOP('optional stop')",
                    Stop::Pallet => "EXCHANGE_PALLET('pallet')",
                };
                let id = self.add(text.into());
                self.plan.push(id);
            }
            Op::Note(Note::Message, text) => {
                self.finish_step();
                let id = self.add(format!("DISPLAY_MESSAGE('message',{})", string(text)));
                self.plan.push(id);
            }
            Op::Begin { marker: Marker::Workingstep, text, .. } => {
                self.finish_step();
                self.name = text.to_string();
            }
            Op::Close(Marker::Workingstep) => {
                self.finish_step();
                self.name.clear();
            }
            _ => {}
        }
    }

    fn motion(&mut self, v: &View<'_, '_>, rapid: bool, pieces: impl Fn([f64; 3], [f64; 3]) -> Vec<Piece>) {
        if v.start.axes[3..] != v.end.axes[3..] {
            return self.cannot("motion of the axes A B C U V W", v);
        }
        let (mut start, end) = (v.start.xyz(), v.end.xyz());
        let all = if rapid && self.known != [true; 3] {
            // The way there begins anywhere: only where it ends can be written.
            self.known = std::array::from_fn(|i| self.known[i] || start == end || start[i] != end[i]);
            if self.known != [true; 3] {
                return;
            }
            start = end;
            vec![Piece::Line(end)]
        } else {
            self.known = [true; 3];
            pieces(start, end)
        };
        let t = self.adopt(v.state, v);
        let axes = v.end.tool_axis;
        let joins = match self.elements.last() {
            Some(Element::Path(run, before)) => {
                *before == t && run.rapid == rapid && run.axes.is_some() == axes.is_some() && last(run) == start
            }
            _ => false,
        };
        if !joins {
            let axes = v.start.tool_axis.or(axes).filter(|_| axes.is_some()).map(|a| vec![a]);
            self.elements.push(Element::Path(Run { rapid, start, pieces: Vec::new(), axes }, t));
        }
        if let Some(Element::Path(run, _)) = self.elements.last_mut() {
            for p in all {
                run.pieces.push(p);
                if let (Some(list), Some(a)) = (&mut run.axes, axes) {
                    list.push(a);
                }
            }
        }
    }

    fn adopt(&mut self, s: &State, v: &View<'_, '_>) -> Technology {
        let spindle = s.spindles[0];
        if s.spindles[1..].iter().any(|o| o.turn != Turn::Stop) {
            self.cannot("a second spindle", v);
        }
        let new = Technology {
            tool: s.tool,
            feed: if s.feed > 0.0 { s.feed } else { self.first_feed },
            speed: spindle.speed,
            turn: spindle.turn,
            flood: s.flood,
            mist: s.mist,
            locks: (!s.feed_override, s.speed_override & 1 == 0),
        };
        if self.elements.last().is_some_and(|e| e.technology().tool != new.tool) {
            self.finish_step();
        }
        let described = self.options.tools.iter().any(|t| t.0 == new.tool && t.1 > 0.0);
        if !described && self.unknown.insert(new.tool) {
            let name = if new.tool > 0 { format!("tool {}", new.tool) } else { "the tool".to_string() };
            let (file, span) = (self.place)(v.source);
            self.out.push(Diagnostic::new(code::STEPNC_TOOL_UNKNOWN, file, span, &[name]));
        }
        new
    }

    fn tool(&mut self, number: i32) -> usize {
        if let Some(id) = self.tools.get(&number) {
            return *id;
        }
        let known = self.options.tools.iter().find(|t| t.0 == number);
        let (diameter, length) = known.map_or((0.001, 0.0), |t| (t.1.max(0.001), t.2));
        let dimension = self.add(format!("MILLING_TOOL_DIMENSION({},$,$,$,$,$,$)", real(diameter)));
        let body = self.add(format!("ENDMILL(#{dimension},$,$,$,$)"));
        let edge = self.add(format!("CUTTING_COMPONENT({},$,$,$,$)", real(length)));
        let id = self.add(format!("MILLING_CUTTING_TOOL('T{}',#{body},(#{edge}),$,$,$)", number.max(0)));
        self.tools.insert(number, id);
        id
    }

    fn technology(&mut self, t: Technology) -> usize {
        if let Some((_, id)) = self.technologies.iter().find(|(k, _)| k.feed == t.feed && k.speed == t.speed && k.turn == t.turn && k.locks == t.locks) {
            return *id;
        }
        // Positive is counter-clockwise; a spindle that stands has speed 0.
        let speed = match t.turn {
            Turn::Cw => real(-t.speed / 60.0),
            Turn::Ccw => real(t.speed / 60.0),
            Turn::Stop => "0.".into(),
        };
        let feed = if t.feed > 0.0 { real(t.feed / 1000.0) } else { "$".into() };
        let flag = |b: bool| if b { ".T." } else { ".F." };
        let id = self.add(format!(
            "MILLING_TECHNOLOGY({feed},.TCP.,$,{speed},$,.F.,{},{},$)",
            flag(t.locks.0),
            flag(t.locks.1)
        ));
        self.technologies.push((t, id));
        id
    }

    fn functions(&mut self, flood: bool, mist: bool) -> usize {
        if let Some(id) = self.functions.get(&(flood, mist)) {
            return *id;
        }
        let flag = |b: bool| if b { ".T." } else { ".F." };
        let id = self.add(format!("MILLING_MACHINE_FUNCTIONS({},$,{},.F.,$,(),.F.,$,$,())", flag(flood), flag(mist)));
        self.functions.insert((flood, mist), id);
        id
    }

    fn finish_step(&mut self) {
        let elements = std::mem::take(&mut self.elements);
        let Some(t) = elements.first().map(Element::technology) else { return };
        let height = last_of(&elements).map_or(self.highest, |p| p[2]);
        let (tool, technology, functions) = (self.tool(t.tool), self.technology(t), self.functions(t.flood, t.mist));
        let mut list = Vec::new();
        for e in elements {
            let own = e.technology();
            let (t, f) = (self.technology(own), self.functions(own.flood, own.mist));
            let t = if t == technology { "$".into() } else { format!("#{t}") };
            let f = if f == functions { "$".into() } else { format!("#{f}") };
            let text = match e {
                Element::Dwell(s, _) => format!("FEEDSTOP(.T.,.CONNECT.,$,{t},{f},{})", real(s)),
                Element::Path(run, _) => self.trajectory(run, &t, &f),
            };
            list.push(format!("#{}", self.add(text)));
        }
        let list = self.add(format!("TOOLPATH_LIST(({}))", list.join(",")));
        self.steps += 1;
        let name = if self.name.is_empty() { format!("step {}", self.steps) } else { self.name.clone() };
        let operation = self.add(format!(
            "FREEFORM_OPERATION(#{list},$,{},$,$,#{tool},#{technology},#{functions},$,$,$,$)",
            string(&name)
        ));
        self.operations.push(operation);
        // Rapids are safe where the program leaves the tool.
        let plane = self.placement([0.0, 0.0, height], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let security = self.add(format!("PLANE('security plane',#{plane})"));
        let step = self.add(format!("MACHINING_WORKINGSTEP({},#{security},#{},#{operation},$)", string(&name), self.feature));
        self.plan.push(step);
    }

    fn trajectory(&mut self, run: Run, technology: &str, functions: &str) -> String {
        let straight = run.pieces.iter().all(|p| matches!(p, Piece::Line(_)));
        let curve = if straight {
            let mut ids = vec![self.point(run.start)];
            for p in &run.pieces {
                if let Piece::Line(q) = p {
                    ids.push(self.point(*q));
                }
            }
            let ids: Vec<String> = ids.iter().map(|i| format!("#{i}")).collect();
            self.add(format!("POLYLINE('',({}))", ids.join(",")))
        } else {
            self.composite(&run)
        };
        let axis = match &run.axes {
            Some(axes) => {
                let ids: Vec<usize> = axes.iter().map(|a| self.point(*a)).collect();
                let ids: Vec<String> = ids.iter().map(|i| format!("#{i}")).collect();
                format!("#{}", self.add(format!("POLYLINE('tool axis',({}))", ids.join(","))))
            }
            None => "$".into(),
        };
        let (role, speed) = if run.rapid { (".APPROACH.", "SPEED_NAME(.RAPID.)") } else { (".CONTACT.", "$") };
        format!("CUTTER_LOCATION_TRAJECTORY(.T.,{role},{speed},{technology},{functions},.T.,#{curve},{axis},$)")
    }

    fn composite(&mut self, run: &Run) -> usize {
        let mut segments = Vec::new();
        let mut at = run.start;
        let mut i = 0;
        while i < run.pieces.len() {
            let parent = match &run.pieces[i] {
                Piece::Line(_) => {
                    let mut ids = vec![self.point(at)];
                    while let Some(Piece::Line(q)) = run.pieces.get(i) {
                        ids.push(self.point(*q));
                        at = *q;
                        i += 1;
                    }
                    let ids: Vec<String> = ids.iter().map(|i| format!("#{i}")).collect();
                    self.add(format!("POLYLINE('',({}))", ids.join(",")))
                }
                Piece::Arc(center, normal, end) => {
                    let out: [f64; 3] = std::array::from_fn(|k| at[k] - center[k]);
                    let radius = crate::frame::norm(out);
                    let place = self.placement(*center, *normal, out.map(|c| c / radius));
                    let circle = self.add(format!("CIRCLE('',#{place},{})", real(radius)));
                    let (a, b) = (self.point(at), self.point(*end));
                    at = *end;
                    i += 1;
                    self.add(format!("TRIMMED_CURVE('',#{circle},(#{a}),(#{b}),.T.,.CARTESIAN.)"))
                }
            };
            segments.push(self.add(format!("COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#{parent})")));
        }
        let ids: Vec<String> = segments.iter().map(|i| format!("#{i}")).collect();
        self.add(format!("COMPOSITE_CURVE('',({}),.F.)", ids.join(",")))
    }

    fn file(mut self) -> String {
        let plan: Vec<String> = self.plan.iter().map(|i| format!("#{i}")).collect();
        let zero = self.placement([0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let highest = self.placement([0.0, 0.0, self.highest], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let security = self.add(format!("PLANE('security plane',#{highest})"));
        let mounted = self.add(format!("WORKPIECE_SETUP(#{},#{zero},$,$,())", self.workpiece));
        let setup = self.add(format!("SETUP('setup',$,#{security},(#{mounted}))"));
        let main = self.add(format!("WORKPLAN('main workplan',({}),$,#{setup},$)", plan.join(",")));
        let operations: Vec<String> = self.operations.iter().map(|i| format!("#{i}")).collect();
        let (feature, head) = (self.feature - 1, &self.feature_head);
        self.data[feature] = format!("TOOLPATH_FEATURE('path',#{},({}),{head})", self.workpiece, operations.join(","));
        self.data[0] = format!("PROJECT({},#{main},(#{}),$,$,$)", string(&self.options.name), self.workpiece);
        let name = string(&self.options.name);
        let mut out = format!(
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('tool paths of a program'),'2;1');\n\
             FILE_NAME({name},'',(''),(''),'gcc-robot','','');\nFILE_SCHEMA(('MACHINING_SCHEMA','MILLING_SCHEMA'));\nENDSEC;\nDATA;\n"
        );
        for (i, text) in self.data.iter().enumerate() {
            let _ = writeln!(out, "#{}={text};", i + 1);
        }
        out.push_str("ENDSEC;\nEND-ISO-10303-21;\n");
        out
    }
}

fn last(run: &Run) -> [f64; 3] {
    match run.pieces.last() {
        Some(Piece::Line(p) | Piece::Arc(_, _, p)) => *p,
        None => run.start,
    }
}

fn last_of(elements: &[Element]) -> Option<[f64; 3]> {
    elements.iter().rev().find_map(|e| if let Element::Path(r, _) = e { Some(last(r)) } else { None })
}

impl Element {
    fn technology(&self) -> Technology {
        match self {
            Element::Path(_, t) | Element::Dwell(_, t) => *t,
        }
    }
}

/// Arcs of at most a full turn each; a start that is also the end needs two.
fn circle(shape: &ArcShape, turns: i32, end: [f64; 3]) -> Vec<Piece> {
    let normal = if shape.sweep < 0.0 { shape.normal.map(|c| -c) } else { shape.normal };
    let parts = (shape.sweep.abs() / std::f64::consts::PI - 1e-9).ceil().max(1.0) as usize;
    let parts = if turns.abs() <= 1 && parts == 2 && (shape.sweep.abs() - 2.0 * std::f64::consts::PI).abs() > 1e-6 { 1 } else { parts };
    let mut out = Vec::new();
    for k in 1..=parts {
        let to = if k == parts { end } else { shape.point(k as f64 / parts as f64) };
        out.push(Piece::Arc(shape.center, normal, to));
    }
    out
}

fn chorded(shape: &ArcShape, pieces: usize, end: [f64; 3]) -> Vec<Piece> {
    (1..=pieces).map(|k| Piece::Line(if k == pieces { end } else { shape.point(k as f64 / pieces as f64) })).collect()
}

/// Part 21 has a point in every real.
fn real(v: f64) -> String {
    let v = v + 0.0;
    let s = if v != 0.0 && (v.abs() < 1e-5 || v.abs() >= 1e15) { format!("{v:E}") } else { v.to_string() };
    match s.find(['E', '.']) {
        Some(i) if s.as_bytes()[i] == b'E' => format!("{}.{}", &s[..i], &s[i..]),
        Some(_) => s,
        None => s + ".",
    }
}

fn string(s: &str) -> String {
    let mut out = String::from("'");
    for c in s.chars() {
        match c {
            '\'' => out.push_str("''"),
            '\\' => out.push_str("\\\\"),
            ' '..='~' => out.push(c),
            c if (c as u32) < 0x20 || c as u32 == 0x7f => out.push(' '),
            c if (c as u32) <= 0xffff => {
                let _ = write!(out, "\\X2\\{:04X}\\X0\\", c as u32);
            }
            c => {
                let _ = write!(out, "\\X4\\{:08X}\\X0\\", c as u32);
            }
        }
    }
    out + "'"
}
