//! Writes motion: keeps tool, spindle, feed and coolant, and goes from place to place by the security plane.

use gr_ir::{Arc, ArcPlane, Builder, FeedMode, Marker, Note, Op, Plane, Pose, Source, Turn, Units};
use gr_text::{Code, Diagnostic, FileId, LineIndex, Severity, Span, code};

use crate::frame::{Frame, norm, sub};
use crate::process::{Functions, Origin, Piece, Technology, Tool};
use crate::stock::{Cutter, Stock};

/// Distances below this are none, mm.
pub const TINY: f64 = 1e-9;
/// Rapids end this much over material, mm.
const CLEARANCE: f64 = 1.0;
/// Sweep of an arc whose end says how far it goes.
const BY_ITS_END: f64 = 1e-3;
/// Chords of an arc as it is taken off the block: this far apart at most, rad, and no further from it than this, mm.
const CHORD: f64 = 0.2;
const CHORD_ERROR: f64 = 0.01;

pub(crate) struct Emit<'a> {
    pub b: Builder,
    pub lines: &'a LineIndex,
    /// The file, for the places of attributes.
    model: &'a gr_step::Model<'a>,
    pub file: FileId,
    pub out: Vec<Diagnostic>,
    /// Places and words of what was told, so that it is told once.
    said: std::collections::BTreeSet<(u32, String)>,
    /// Write tool axes: some feature is not upright.
    pub axes: bool,
    pub source: Source,
    /// Where the tool is, once it has moved.
    pub at: Option<[f64; 3]>,
    axis: [f64; 3],
    tool: Option<u32>,
    feed: Option<f64>,
    speed: Option<f64>,
    turn: Turn,
    coolant: Functions,
    locks: (bool, bool),
    plane: Plane,
    /// What is left of the raw part, where it is known.
    pub stock: Option<Stock>,
    cutter: Option<Cutter>,
    /// How far feeds of this workingstep reached: lowest and highest coordinates of their ends.
    pub fed: Option<[[f64; 3]; 2]>,
    /// Cosine and sine of the turn of the setup about Z against the machine.
    turned: [f64; 2],
    per_rev: bool,
    surface: Option<[f64; 2]>,
    /// Features that some workingstep has cut.
    pub cut: std::collections::BTreeSet<u64>,
}

impl<'a> Emit<'a> {
    pub fn new(lines: &'a LineIndex, model: &'a gr_step::Model<'a>, file: FileId, axes: bool) -> Emit<'a> {
        let source = Source { file, ..Source::default() };
        Emit {
            b: Builder::new(),
            lines,
            model,
            file,
            out: Vec::new(),
            said: std::collections::BTreeSet::new(),
            axes,
            source,
            at: None,
            axis: [0.0, 0.0, 1.0],
            tool: None,
            feed: None,
            speed: None,
            turn: Turn::Stop,
            coolant: Functions::default(),
            locks: (false, false),
            plane: Plane::Xy,
            cut: std::collections::BTreeSet::new(),
            stock: None,
            cutter: None,
            fed: None,
            turned: [1.0, 0.0],
            per_rev: false,
            surface: None,
        }
    }
    pub fn begin(&mut self) {
        self.push(Op::Units(Units::Mm));
        self.push(Op::Plane(Plane::Xy));
    }
    pub fn say(&mut self, code: Code, origin: Origin, args: &[&str]) {
        let args: Vec<String> = args.iter().map(|a| (*a).to_string()).collect();
        let d = Diagnostic::new(code, self.file, origin.span, &args);
        if self.said.insert((origin.span.start, d.message.clone())) {
            self.out.push(d);
        }
    }
    /// The first of these attributes of an instance that is given, for a message about it; each a way by its references, as
    /// `its_tool_body.hand_of_cut`. Without one of them the statement.
    pub fn attribute(&self, origin: Origin, ways: &[&str]) -> Origin {
        let find = |way: &&str| {
            let (to, name) = way.rsplit_once('.').unwrap_or(("", way));
            let start = self.model.get(origin.id);
            let node = to.split('.').filter(|s| !s.is_empty()).try_fold(start?, |n, step| n.node(step))?;
            node.attr(name).and(node.written(name)).map(|v| v.span())
        };
        Origin { span: ways.iter().find_map(find).unwrap_or(origin.span), ..origin }
    }
    /// An overlap of more than the whole tool: what only the file's writer knows is no path.
    pub fn overlap(&mut self, span: Span, overlap: f64, diameter: f64) {
        let show = gr_step::short;
        let args = [show(overlap), show(overlap / diameter), show(overlap / 100.0)];
        let mut d = Diagnostic::new(code::STEP_OVERLAP, self.file, span, &args);
        d.severity = Severity::Error;
        if self.said.insert((span.start, d.message.clone())) {
            self.out.push(d);
        }
    }
    pub fn from(&mut self, origin: Origin) {
        self.source.line = self.lines.position(origin.span.start).0;
    }
    pub fn push(&mut self, op: Op<'_>) {
        self.b.push(op, self.source);
    }
    pub fn note(&mut self, text: &str) {
        self.push(Op::Note(Note::Comment, text));
    }
    pub fn mark(&mut self, marker: Marker, code: u64, text: &str) {
        let code = i32::try_from(code).unwrap_or(i32::MAX);
        self.push(Op::Begin { marker, code, text });
    }

    /// Coordinates from here on are written turned by this about Z, as the setup is on the machine.
    pub fn turn_setup(&mut self, x: [f64; 3]) {
        self.turned = [x[0], x[1]];
    }
    /// A point or a vector of the setup along the axes of the machine.
    pub fn placed(&self, p: [f64; 3]) -> [f64; 3] {
        let [c, s] = self.turned;
        [c * p[0] - s * p[1] + 0.0, s * p[0] + c * p[1] + 0.0, p[2] + 0.0]
    }
    /// Where the tool stands as far as it is known, in the setup.
    pub fn standing(&self) -> [f64; 3] {
        let ([c, s], p) = (self.turned, self.b.pose().xyz());
        self.at.unwrap_or([c * p[0] + s * p[1], c * p[1] - s * p[0], p[2]])
    }
    /// The pose at a point of the setup.
    pub fn pose(&self, to: [f64; 3]) -> Pose {
        let mut pose = *self.b.pose();
        pose.axes[..3].copy_from_slice(&self.placed(to));
        pose.tool_axis = self.axes.then_some(self.placed(self.axis));
        pose
    }
    fn reached(&mut self, to: [f64; 3]) {
        let [low, high] = self.fed.unwrap_or([to, to]);
        self.fed = Some([std::array::from_fn(|i| low[i].min(to[i])), std::array::from_fn(|i| high[i].max(to[i]))]);
    }
    fn same(&self, to: [f64; 3]) -> bool {
        self.at.is_some_and(|at| norm(sub(at, to)) < TINY)
    }
    /// The tool stands upright: what is left of the block is known under it.
    fn upright(&self) -> Option<Cutter> {
        self.cutter.filter(|_| self.axis[2] > 1.0 - 1e-9 && self.stock.is_some())
    }
    /// How high the tip has to stay on a straight way for it to pass over what is left of the block.
    pub fn blocked(&self, a: [f64; 3], b: [f64; 3]) -> Option<f64> {
        self.stock.as_ref()?.blocks(self.upright()?, a, b)
    }
    /// Whether material is known to stand higher than the tip, within a radius about its axis.
    pub fn stands_under(&self, tip: [f64; 3], radius: f64) -> bool {
        let top = self.stock.as_ref().filter(|_| self.axis[2] > 1.0 - 1e-9).and_then(|s| s.top([tip[0], tip[1]], radius));
        top.is_some_and(|top| top > tip[2] + 1e-3)
    }
    /// The same with what may stand close beside the way.
    fn may_be_blocked(&self, a: [f64; 3], b: [f64; 3]) -> Option<f64> {
        self.stock.as_ref()?.may_block(self.upright()?, a, b)
    }
    /// The same straight down.
    fn blocked_down(&self, a: [f64; 3], b: [f64; 3]) -> Option<f64> {
        self.stock.as_ref()?.blocks_way_down(self.upright()?, a, b)
    }
    /// Rapid as it is written, whatever is in its way.
    pub fn rapid_as_written(&mut self, to: [f64; 3]) {
        if !self.same(to) {
            let pose = self.pose(to);
            self.b.push_to(Op::Rapid, &pose, self.source);
            self.at = Some(to);
        }
    }
    /// Rapid over what is left of the block; where the end is in it, the last piece is fed.
    pub fn rapid(&mut self, to: [f64; 3]) {
        self.rapid_until_material(to);
        self.line(to);
    }
    /// Rapid to a point, or to a little over the material in which it lies.
    pub fn rapid_until_material(&mut self, to: [f64; 3]) {
        let Some(from) = self.at else { return self.rapid_as_written(to) };
        let sideways = (to[0] - from[0]).abs() + (to[1] - from[1]).abs() > TINY;
        let met = if sideways { self.may_be_blocked(from, to) } else { self.blocked_down(from, to) };
        let Some(highest) = met else { return self.rapid_as_written(to) };
        if sideways {
            let over = (highest + CLEARANCE).max(from[2]);
            self.rapid_as_written([from[0], from[1], over]);
            self.rapid_as_written([to[0], to[1], over]);
            return self.rapid_until_material(to);
        }
        let end = highest + CLEARANCE;
        if end < from[2] && to[2] < end {
            self.rapid_as_written([to[0], to[1], end]);
        } else if to[2] >= from[2] {
            self.rapid_as_written(to);
        }
    }
    /// Takes a straight way off the block.
    fn take_off(&mut self, a: [f64; 3], b: [f64; 3]) {
        if let (Some(tool), Some(stock)) = (self.upright(), &mut self.stock) {
            stock.cut(tool, a, b);
        }
    }
    /// A feed has ended here.
    fn fed_to(&mut self, p: [f64; 3]) {
        if let (Some(tool), Some(stock)) = (self.upright(), &mut self.stock) {
            stock.reached(tool, p);
        }
    }
    /// The tool has been down at a point and is where it was.
    pub fn drilled(&mut self, bottom: [f64; 3]) {
        self.take_off(self.at.unwrap_or(bottom), bottom);
        self.fed_to(bottom);
    }
    pub fn line(&mut self, to: [f64; 3]) {
        if !self.same(to) {
            let pose = self.pose(to);
            self.b.push_to(Op::Linear, &pose, self.source);
            self.take_off(self.at.unwrap_or(to), to);
            self.at.into_iter().chain([to]).for_each(|p| {
                self.reached(p);
                self.fed_to(p);
            });
            self.at = Some(to);
        }
    }
    /// An arc, counter-clockwise seen against the normal, of `sweep` (may exceed a turn; < 0 the other way).
    pub fn arc(&mut self, center: [f64; 3], normal: [f64; 3], to: [f64; 3], sweep: f64) {
        let pose = self.pose(to);
        self.reached(to);
        let (level, middle) = (normal[2], center);
        let (center, normal) = (self.placed(center), self.placed(normal));
        let begun = (sweep.abs() / (2.0 * std::f64::consts::PI) - 1e-9).floor().max(0.0) as i32 + 1;
        let turns = if sweep < 0.0 { -begun } else { begun };
        // Normals of the planes as controls have them: Z, Y, X.
        let planes = [(2, Plane::Xy), (1, Plane::Xz), (0, Plane::Yz)];
        let arc = match planes.into_iter().find(|(i, _)| normal[*i].abs() > 1.0 - 1e-12) {
            Some((i, plane)) => {
                self.plane(plane);
                Arc { plane: ArcPlane::Work(plane), center, turns: if normal[i] > 0.0 { turns } else { -turns } }
            }
            None => Arc { plane: ArcPlane::Free(normal), center, turns },
        };
        self.b.push_to(Op::Arc(arc), &pose, self.source);
        if let Some(from) = self.at.filter(|_| self.upright().is_some() && level.abs() > 1.0 - 1e-12) {
            self.take_off_arc(from, middle, to, if level > 0.0 { sweep } else { -sweep });
            self.fed_to(from);
            self.fed_to(to);
        }
        self.at = Some(to);
    }
    /// Likewise an arc in XY, by chords.
    fn take_off_arc(&mut self, from: [f64; 3], center: [f64; 3], to: [f64; 3], sweep: f64) {
        let radius = libm::hypot(from[0] - center[0], from[1] - center[1]);
        let angle = |p: [f64; 3]| libm::atan2(p[1] - center[1], p[0] - center[0]);
        let (start, full) = (angle(from), 2.0 * std::f64::consts::PI);
        let way = if sweep < 0.0 { start - angle(to) } else { angle(to) - start };
        let mut part = way.rem_euclid(full);
        if part < 1e-9 || part > full - 1e-9 {
            part = if sweep.abs() > 1.0 || sweep.abs() == BY_ITS_END { full } else { 0.0 };
        }
        let turns = ((sweep.abs() - part) / full + 1e-9).floor().clamp(0.0, 1e4);
        let by = (part + turns * full).copysign(sweep);
        let step = (2.0 * libm::acos((1.0 - CHORD_ERROR / radius.max(CHORD_ERROR)).clamp(-1.0, 1.0))).clamp(1e-3, CHORD);
        let count = (by.abs() / step).ceil().clamp(1.0, 1e5) as usize;
        let mut last = from;
        for k in 1..=count {
            let share = k as f64 / count as f64;
            let a = start + by * share;
            let p = if k == count { to } else { [center[0] + radius * libm::cos(a), center[1] + radius * libm::sin(a), from[2] + (to[2] - from[2]) * share] };
            self.take_off(last, p);
            last = p;
        }
    }
    fn plane(&mut self, plane: Plane) {
        if self.plane != plane {
            self.plane = plane;
            self.push(Op::Plane(plane));
        }
    }
    pub fn piece(&mut self, piece: &Piece, frame: &Frame) {
        match *piece {
            Piece::Line(p) => self.line(frame.point(p)),
            Piece::Arc { center, normal, end } => self.arc(frame.point(center), frame.vector(normal), frame.point(end), BY_ITS_END),
        }
    }
    /// By way of the height `security` to a point, the tool standing along `axis` there. The way up goes along Z;
    /// features on the side of a part are left along their own axis before.
    pub fn travel(&mut self, to: [f64; 3], axis: [f64; 3], security: f64) {
        let up = security.max(to[2]);
        let known = self.at.is_some();
        match self.at {
            Some(at) => self.rapid_as_written([at[0], at[1], up.max(at[2])]),
            None => {
                let here = self.standing();
                self.axis = axis;
                let start = [here[0], here[1], up];
                let pose = self.pose(start);
                self.b.push_to(Op::Rapid, &pose, self.source);
                self.at = Some(start);
            }
        }
        let high = self.at.map_or(up, |a| a[2]);
        if axis != self.axis {
            self.axis = axis;
            self.at = None;
        }
        if !known {
            // Nobody knows where the machine stands: the way there is written even if it goes nowhere here.
            self.at = None;
        }
        self.rapid_as_written([to[0], to[1], high]);
        self.rapid_until_material(to);
    }
    pub fn set_axis(&mut self, axis: [f64; 3]) {
        self.axis = axis;
    }
    /// Straight up to a height.
    pub fn lift(&mut self, security: f64) {
        if let Some(at) = self.at.filter(|a| a[2] < security) {
            self.rapid_as_written([at[0], at[1], security]);
        }
    }

    pub fn feed(&mut self, mm_per_s: f64) {
        if self.feed != Some(mm_per_s) {
            self.feed = Some(mm_per_s);
            self.push(Op::Feed { linear: mm_per_s, angular: mm_per_s.to_radians() });
        }
    }
    pub fn speed(&mut self, rpm: f64) {
        if self.speed != Some(rpm) {
            self.speed = Some(rpm);
            self.push(Op::SpindleSpeed { spindle: 0, speed: rpm });
        }
    }
    pub fn turn(&mut self, turn: Turn) {
        if self.turn != turn {
            self.turn = turn;
            self.push(Op::SpindleTurn { spindle: 0, turn });
        }
    }
    pub fn coolant(&mut self, on: Functions) {
        if self.coolant.flood && !on.flood || self.coolant.mist && !on.mist {
            // One word ends both.
            self.push(Op::Mist(false));
            self.push(Op::Flood(false));
            self.coolant = Functions::default();
        }
        if on.mist && !self.coolant.mist {
            self.push(Op::Mist(true));
        }
        if on.flood && !self.coolant.flood {
            self.push(Op::Flood(true));
        }
        self.coolant = on;
    }
    pub fn locks(&mut self, feed: bool, spindle: bool) {
        if self.locks.0 != feed {
            self.push(Op::Override(gr_ir::Override::Feed, !feed));
        }
        if self.locks.1 != spindle {
            self.push(Op::Override(gr_ir::Override::Speed(0), !spindle));
        }
        self.locks = (feed, spindle);
    }
    /// Feeds from here on are per revolution or per time.
    fn feeds_per_rev(&mut self, per_rev: bool) {
        if self.per_rev != per_rev {
            let mode = if per_rev { FeedMode::PerRev } else { FeedMode::PerTime };
            self.push(Op::FeedMode { spindle: 0, mode });
            (self.per_rev, self.feed) = (per_rev, None);
        }
    }
    /// Constant cutting speed, or an end of it.
    fn cutting_speed(&mut self, t: &Technology) {
        if t.surface == self.surface {
            return;
        }
        self.push(Op::SpindleMode { spindle: 0, surface: t.surface.map(|s| s[1]) });
        (self.surface, self.speed) = (t.surface, None);
        if let Some([speed, _]) = t.surface {
            self.push(Op::SpindleSpeed { spindle: 0, speed });
        }
    }
    pub fn technology(&mut self, t: &Technology, functions: Functions) {
        self.cutting_speed(t);
        self.feeds_per_rev(t.per_rev);
        if t.surface.is_some() {
            let way = if t.clockwise { Turn::Cw } else { Turn::Ccw };
            self.turn(way);
        }
        if let Some(speed) = t.speed {
            if speed > 0.0 {
                self.speed(speed);
            }
            let way = match t.clockwise {
                _ if speed == 0.0 => Turn::Stop,
                true => Turn::Cw,
                false => Turn::Ccw,
            };
            if self.turn != Turn::Stop && self.turn != way {
                self.turn(Turn::Stop);
            }
            self.turn(way);
        }
        self.coolant(functions);
        if let Some(f) = t.feed {
            self.feed(f);
        }
        self.locks(t.lock_feed, t.lock_spindle);
    }
    pub fn stop_spindle(&mut self) {
        self.coolant(Functions::default());
        self.turn(Turn::Stop);
    }
    /// Puts a tool into the spindle, at a safe height, spindle and coolant off.
    pub fn tool(&mut self, tool: &Tool, security: f64) {
        if self.tool == Some(tool.number) {
            return;
        }
        self.lift(security);
        self.stop_spindle();
        if self.tool.is_some() {
            self.push(Op::Close(Marker::Tool));
        }
        let number = i32::try_from(tool.number).unwrap_or(i32::MAX);
        self.mark(Marker::Tool, u64::from(tool.number), &tool.name);
        self.push(Op::ToolPrepare(number));
        self.push(Op::ToolChangeStart);
        self.push(Op::ToolChange(number));
        let mut offset = [0.0; 9];
        offset[2] = tool.length.unwrap_or(0.0);
        self.push(Op::ToolOffset { offset, number: None });
        self.tool = Some(tool.number);
        self.cutter = Cutter::of(tool);
        // The operator may have moved the machine.
        self.at = None;
    }
    pub fn unload(&mut self, security: f64) {
        self.lift(security);
        self.stop_spindle();
        if self.tool.take().is_some() {
            self.push(Op::Close(Marker::Tool));
        }
        for op in [Op::ToolPrepare(0), Op::ToolChangeStart, Op::ToolChange(0), Op::ToolOffset { offset: [0.0; 9], number: None }] {
            self.push(op);
        }
        self.at = None;
    }
    /// All that the plan switched on is off again.
    pub fn end(&mut self, security: f64) {
        self.lift(security);
        self.stop_spindle();
        self.cutting_speed(&Technology::default());
        self.feeds_per_rev(false);
        self.locks(false, false);
        self.plane(Plane::Xy);
        if self.tool.take().is_some() {
            self.push(Op::Close(Marker::Tool));
        }
    }
}
