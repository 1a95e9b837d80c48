//! A motion program as STEP-NC: a workplan of workingsteps with explicit tool paths, tools and technology, in a
//! Part 21 file of ISO 14649. A new workingstep begins where the tool changes or the program stops; feed, speed,
//! coolant and override locks stand with each tool path. What the standard has no counterpart for is an error, or, where losses are allowed, left out and
//! listed.

mod known;

pub use known::{Words, changes};

use known::{Frame, Known, Place, differ};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use gr_ir::geometry::ArcShape;
use gr_ir::{Axes, FeedMode, Marker, Note, Op, PathMode, Program, Source, State, Stop, Turn, View};
use gr_text::{Diagnostic, FileId, Span, code};

/// What can be chosen.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Options {
    /// Name of the project.
    pub name: String,
    /// Leave out what has no counterpart, with a warning.
    pub lossy: bool,
    /// Tools that are described; any other becomes an end mill of 0.001 mm.
    pub tools: Vec<Described>,
    /// Helices, which the standard does not have, become chords no further from them than this, mm; 0 = 1e-6.
    pub tolerance: f64,
    /// The program was planned from a STEP-NC file: its path mode is the planner's own, and nothing that is lost.
    pub planned: bool,
}

/// A tool of the program.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Described {
    /// T number.
    pub number: i32,
    /// Entity of its body as part 111 of 2002 names it; what is none of them becomes an end mill.
    pub kind: String,
    /// Diameter, mm.
    pub diameter: f64,
    /// Length, mm, for a tool that never cuts; any other has the length that the program gives it.
    pub length: f64,
    /// Edge radius, mm.
    pub edge_radius: f64,
}

impl Described {
    /// An end mill.
    pub fn mill(number: i32, diameter: f64, length: f64) -> Described {
        Described { number, kind: "ENDMILL".into(), diameter, length, edge_radius: 0.0 }
    }
}

/// Writes a program.
///
/// # Errors
/// What STEP-NC cannot say, unless losses are allowed.
pub fn write(program: &Program, options: &Options) -> Result<(String, Vec<Diagnostic>), Vec<Diagnostic>> {
    write_at(program, options, &|source| (source.file, Span::default()), &mut changes)
}

/// The same; findings are at the places that `place` gives, and `words` tells of each operation what it does to X, Y
/// and Z.
///
/// # Errors
/// As [`write`].
pub fn write_at(
    program: &Program,
    options: &Options,
    place: &dyn Fn(Source) -> (FileId, Span),
    words: &mut dyn FnMut(&View<'_, '_>) -> Words,
) -> Result<(String, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut w = Writer::new(program, options, place);
    if let Some((mode, source)) = named_path_mode(program).filter(|_| !options.planned) {
        w.path_mode(mode, source);
    }
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        w.op(&view, words(&view));
    }
    w.finish_step();
    w.load();
    w.needs_a_feed();
    w.tell_helices();
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
    at: Place,
    /// The last move was a rapid.
    rapid: bool,
    /// Frame of all coordinates in the file.
    frame: Option<Frame>,
    /// Offset of each tool as it cut first: that is its length.
    offsets: BTreeMap<i32, Axes>,
    /// What keeps moves from being written, told already.
    hindered: Option<String>,
    /// Tool that was put into the spindle, and where.
    loaded: Option<(i32, Source)>,
    /// Tool of the last workingstep or function of the plan.
    spindle: Option<i32>,
    /// Where a technology was first needed.
    begun: Option<Source>,
    /// The first helix, how many there are, and their chords.
    helices: Option<(Source, usize, usize)>,
}

impl<'a> Writer<'a> {
    fn new(program: &'a Program, options: &'a Options, place: &'a dyn Fn(Source) -> (FileId, Span)) -> Writer<'a> {
        let mut highest = 0.0f64;
        for s in program.steps() {
            // Without a change Z may be what nobody has named.
            if s.op.moves() && s.start.axes[2] != s.end.axes[2] {
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
            at: Place::default(),
            rapid: false,
            frame: None,
            offsets: BTreeMap::new(),
            hindered: None,
            loaded: None,
            spindle: None,
            begun: None,
            helices: None,
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

    fn op(&mut self, v: &View<'_, '_>, words: Words) {
        match v.op {
            Op::Rapid => self.rapid(v, words),
            Op::Linear => self.feed(v, words, |_, end| vec![Piece::Line(end)]),
            Op::Arc(arc) => {
                let shape = ArcShape::new(&arc, v.start, v.end);
                if shape.rise.abs() > 1e-9 {
                    // ISO 14649 has no helix: short chords, no further from it than the tolerance.
                    let chords = shape.pieces(self.tolerance());
                    let all = self.helices.get_or_insert((v.source, 0, 0));
                    (all.1, all.2) = (all.1 + 1, all.2 + chords);
                    return self.feed(v, words, |_, end| chorded(&shape, chords, end));
                }
                self.feed(v, words, |_, end| circle(&shape, arc.turns, end));
            }
            Op::Nurbs { .. } => self.leave_out("a spline", v),
            Op::Probe(_) => self.leave_out("probing without a workpiece (G38)", v),
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
            Op::StoredOffset { .. } => self.cannot("storing a work offset (G10)", v),
            Op::WorkOffset(n, _) if n > 1 => self.cannot("more than one work offset", v),
            Op::Override(gr_ir::Override::Adaptive, true) => self.cannot("adaptive feed (M52)", v),
            Op::ToolChange(_) => self.changed(v.state.prepared, v.source),
            Op::ToolNumber(number) => self.changed(number, v.source),
            Op::ToolOffset { offset, .. } => self.offset(&offset, v),
            Op::Stop(stop) => {
                let text = match stop {
                    Stop::Program => "PROGRAM_STOP('stop')",
                    Stop::Optional => "OPTIONAL_STOP('optional stop')",
                    Stop::Pallet => "EXCHANGE_PALLET('pallet')",
                };
                self.function(text.into());
            }
            Op::Note(Note::Message, text) => self.function(format!("DISPLAY_MESSAGE('message',{})", string(text))),
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

    /// Told once, of the first that the program names.
    fn path_mode(&mut self, mode: PathMode, source: Source) {
        let what = match mode {
            PathMode::ExactStop => "stopping at every corner (G61.1)".to_string(),
            PathMode::ExactPath => "exact corners (G61)".to_string(),
            PathMode::Blend(t) if t > 0.0 => format!("rounding corners by up to {t} mm (G64 P)"),
            PathMode::Blend(_) => "rounding corners (G64)".to_string(),
        };
        let (file, span) = (self.place)(source);
        self.out.push(Diagnostic::new(code::STEPNC_NO_PATH_MODE, file, span, &[what]));
    }

    /// A function of the plan, after all that was before it.
    fn function(&mut self, text: String) {
        self.finish_step();
        self.load();
        let id = self.add(text);
        self.plan.push(id);
    }

    /// Another tool: nothing is known of where its tip is but by the tool table.
    fn changed(&mut self, number: i32, source: Source) {
        self.loaded = Some((number, source));
        self.at.hold([false, false, true]);
    }

    /// The tool that was put into the spindle, where no workingstep says so.
    fn load(&mut self) {
        let Some((number, source)) = self.loaded.take().filter(|(n, _)| self.spindle != Some(*n)) else { return };
        if number <= 0 && self.spindle.is_none() {
            return;
        }
        let text = if number > 0 {
            self.describe(number, source);
            format!("LOAD_TOOL('load',#{})", self.tool(number))
        } else {
            "UNLOAD_TOOL('unload',$)".into()
        };
        let id = self.add(text);
        self.plan.push(id);
        self.spindle = Some(number);
    }

    /// Another offset of the tool. Until the tool cuts it says how long the tool is, and where rapids with the one
    /// before have led the tip is not known.
    fn offset(&mut self, offset: &Axes, v: &View<'_, '_>) {
        let changed = differ(offset, &v.state.tool_offset);
        if changed == [false; 3] {
            return;
        }
        let tool = v.state.tool;
        if !self.offsets.contains_key(&tool) && self.elements.iter().all(|e| e.technology().tool == tool) {
            self.at.waits |= !self.elements.is_empty();
            self.elements.retain(|e| matches!(e, Element::Dwell(..)));
        }
        self.at.hold(changed);
    }

    /// What keeps a move from being written, and whether it keeps the moves after it as well.
    fn hindrance(&self, v: &View<'_, '_>, words: Words) -> Option<(&'static str, bool)> {
        let s = v.state;
        if v.start.axes[3..] != v.end.axes[3..] {
            return Some(("motion of the axes A B C U V W", false));
        }
        if words.machine != [false; 3] {
            return Some(("a move to a place of the machine (G53, G28, G30)", false));
        }
        if self.frame.is_some_and(|f| f != Frame::of(s)) {
            return Some(("motion from here on: the work frame is another than before (G10, G54 to G59.3, G92)", true));
        }
        if self.offsets.get(&s.tool).is_some_and(|o| *o != s.tool_offset) {
            return Some(("motion from here on: the same tool has another offset than before (G43, G43.1, G49, G10 L1)", true));
        }
        (s.tool_offset[0] != 0.0 || s.tool_offset[1] != 0.0).then_some(("a tool offset in X or Y", true))
    }

    /// Whether a move can be written.
    fn can_move(&mut self, v: &View<'_, '_>, words: Words) -> bool {
        if words.hidden {
            // A tool change of the plan makes the machine do the same of itself.
            self.at.forget(differ(&v.start.axes, &v.end.axes));
            return false;
        }
        let Some((what, lasts)) = self.hindrance(v, words) else { return true };
        let told = lasts && self.hindered.as_deref() == Some(what);
        if !told {
            self.cannot(what, v);
        }
        self.hindered = lasts.then(|| what.to_string());
        let moved = differ(&v.start.axes, &v.end.axes);
        self.at.forget(std::array::from_fn(|i| lasts || moved[i] || words.machine[i] || words.work[i]));
        false
    }

    /// Tells of a move that has no counterpart: where it ends the tool never is.
    fn leave_out(&mut self, what: &str, v: &View<'_, '_>) {
        self.cannot(what, v);
        self.at.forget(differ(&v.start.axes, &v.end.axes));
    }

    fn rapid(&mut self, v: &View<'_, '_>, words: Words) {
        if !self.can_move(v, words) {
            return;
        }
        let sure = self.at.all();
        self.at.name(words.work);
        self.rapid = true;
        if sure {
            return self.path(v, true, v.start.xyz(), vec![Piece::Line(v.end.xyz())]);
        }
        // The way there begins anywhere: only where it ends can be written.
        if self.at.all() { self.arrive(v, true, v.end.xyz()) } else { self.at.waits = true }
    }

    fn feed(&mut self, v: &View<'_, '_>, words: Words, pieces: impl Fn([f64; 3], [f64; 3]) -> Vec<Piece>) {
        if !self.can_move(v, words) {
            return;
        }
        let (start, end) = (v.start.xyz(), v.end.xyz());
        if self.at.of.contains(&Known::No) {
            let missing = self.at.missing();
            self.at.name(words.work);
            if v.op == Op::Linear && !self.at.of.contains(&Known::No) {
                return self.arrive(v, false, end);
            }
            self.at.forget(words.work);
            let what = format!("a cut that begins where no block has led the tool ({missing} not named before)");
            if self.hindered.as_ref() != Some(&what) {
                self.cannot(&what, v);
            }
            self.hindered = Some(what);
            return;
        }
        if self.at.waits || self.rapid && !self.at.all() {
            self.arrive(v, true, start);
        }
        self.at.name([true; 3]);
        self.rapid = false;
        self.path(v, false, start, pieces(start, end));
    }

    /// The tool is led to a place from anywhere: down from the height of all that the program names.
    fn arrive(&mut self, v: &View<'_, '_>, rapid: bool, at: [f64; 3]) {
        if self.elements.iter().any(|e| matches!(e, Element::Path(..))) {
            self.finish_step();
        }
        self.at.waits = false;
        self.at.name([true; 3]);
        let over = [at[0], at[1], at[2].max(self.highest)];
        if !rapid {
            self.path(v, true, over, vec![Piece::Line(over)]);
        }
        self.path(v, rapid, over, vec![Piece::Line(at)]);
    }

    fn path(&mut self, v: &View<'_, '_>, rapid: bool, start: [f64; 3], all: Vec<Piece>) {
        self.hindered = None;
        self.frame.get_or_insert(Frame::of(v.state));
        if !rapid {
            self.offsets.entry(v.state.tool).or_insert(v.state.tool_offset);
        }
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

    fn tolerance(&self) -> f64 {
        if self.options.tolerance > 0.0 { self.options.tolerance } else { 1e-6 }
    }

    fn tell_helices(&mut self) {
        let Some((first, count, chords)) = self.helices else { return };
        let (file, span) = (self.place)(first);
        let all = if count == 1 { "this one is".to_string() } else { format!("this one and {} more are", count - 1) };
        let args = [all, chords.to_string(), self.tolerance().to_string()];
        self.out.push(Diagnostic::new(code::STEPNC_HELIX_IN_CHORDS, file, span, &args));
    }

    /// Every technology of ISO 14649 for milling has a feed.
    fn needs_a_feed(&mut self) {
        let Some(begun) = self.begun.filter(|_| !(self.first_feed > 0.0)) else { return };
        if self.out.iter().any(|d| d.severity == gr_text::Severity::Error) {
            return;
        }
        let (file, span) = (self.place)(begun);
        let what = "a program without a feed: the technology of a workingstep needs one".to_string();
        self.out.push(Diagnostic::new(code::STEPNC_NO_COUNTERPART, file, span, &[what]));
    }

    fn adopt(&mut self, s: &State, v: &View<'_, '_>) -> Technology {
        let spindle = s.spindles[0];
        if s.spindles[1..].iter().any(|o| o.turn != Turn::Stop) {
            self.cannot("a second spindle", v);
        }
        self.begun.get_or_insert(v.source);
        // Feed per revolution is told; what is written is what it comes to.
        let feed = if s.feed_mode == FeedMode::PerRev { s.feed * s.spindle(s.feed_spindle).speed / 60.0 } else { s.feed };
        let new = Technology {
            tool: s.tool,
            feed: if feed > 0.0 { feed } else { self.first_feed },
            speed: spindle.speed,
            turn: spindle.turn,
            flood: s.flood,
            mist: s.mist,
            locks: (!s.feed_override, s.speed_override & 1 == 0),
        };
        if self.elements.last().is_some_and(|e| e.technology().tool != new.tool) {
            self.finish_step();
        }
        self.describe(new.tool, v.source);
        new
    }

    fn described(&self, number: i32) -> Option<&'a Described> {
        self.options.tools.iter().find(|t| t.number == number && t.diameter > 0.0)
    }

    /// Tells of a tool that is not described.
    fn describe(&mut self, number: i32, source: Source) {
        if self.described(number).is_none() && self.unknown.insert(number) {
            let name = if number > 0 { format!("tool {number}") } else { "the tool".to_string() };
            let (file, span) = (self.place)(source);
            self.out.push(Diagnostic::new(code::STEPNC_TOOL_UNKNOWN, file, span, &[name]));
        }
    }

    fn tool(&mut self, number: i32) -> usize {
        if let Some(id) = self.tools.get(&number) {
            return *id;
        }
        let (kind, diameter, radius) = self.described(number).map_or(("ENDMILL", 0.001, 0.0), |t| (&*t.kind, t.diameter, t.edge_radius));
        let (body, rest) = body(kind, diameter, radius);
        let edge_radius = if body != "BALL_ENDMILL" && radius > 0.0 { real(radius) } else { "$".into() };
        let dimension = self.add(format!("MILLING_TOOL_DIMENSION({},$,$,$,{edge_radius},$,$)", real(diameter.max(0.001))));
        let body = self.add(format!("{body}(#{dimension},$,$,$,${rest})"));
        // How long it is, is known when it has cut: `lengths` writes it.
        let edge = self.add(String::new());
        let id = self.add(format!("MILLING_CUTTING_TOOL('T{}',#{body},(#{edge}),$,$,$)", number.max(0)));
        self.tools.insert(number, id);
        id
    }

    fn lengths(&mut self) {
        for (number, id) in &self.tools {
            let stated = self.described(*number).map_or(0.0, |t| t.length);
            let length = self.offsets.get(number).map_or(stated, |o| o[2]);
            // The edge is written right before its tool.
            self.data[id - 2] = format!("CUTTING_COMPONENT({},$,$,$,$)", real(length));
        }
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
        self.spindle = Some(t.tool);
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
        self.lengths();
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

/// The first path mode that the program names: cycles go on the exact path and give back what was before.
fn named_path_mode(program: &Program) -> Option<(PathMode, Source)> {
    let mut held = None;
    let mut cycle = false;
    for s in program.steps() {
        let own = held.is_some_and(|(_, at)| at == s.source);
        match s.op {
            Op::PathMode(_) if cycle && own => (held, cycle) = (None, false),
            Op::PathMode(mode) if held.is_none() => held = Some((mode, s.source)),
            Op::Begin { marker: Marker::Cycle, .. } if own => cycle = true,
            _ if cycle && own => {}
            _ if held.is_some() => break,
            _ => {}
        }
    }
    held
}

/// Entity of a body and what it has more than all of them. A ball has no radius of its own, a bull nose must have one.
fn body(kind: &str, diameter: f64, radius: f64) -> (&str, &'static str) {
    match kind {
        "BULLNOSE_ENDMILL" if radius >= diameter / 2.0 => ("BALL_ENDMILL", ""),
        "BULLNOSE_ENDMILL" if radius <= 0.0 => ("ENDMILL", ""),
        "FACEMILL" | "BALL_ENDMILL" | "BULLNOSE_ENDMILL" | "TWIST_DRILL" | "SPADE_DRILL" | "CENTERDRILL" | "REAMER" | "TAP"
        | "COUNTERBORE" | "THREAD_MILL" => (kind, ""),
        "COUNTERSINK" | "TAPERED_ENDMILL" | "T_SLOT_MILL" | "DOVETAIL_MILL" | "SIDE_MILL" | "TAPERED_REAMER" | "TAPERED_TAP" => (kind, ",$"),
        "BORING_TOOL" => (kind, ",.F."),
        _ => ("ENDMILL", ""),
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
