//! Two programs compared as motion: where the tool goes in the machine, with which tool, how fast, and
//! what else happens on the way. Not text, not the way a path is cut into blocks.

use crate::geometry::{ArcShape, Length, length, nurbs_point};
use crate::measure::{Rates, Totals, measure};
use crate::{Axes, Cursor, FeedMode, Op, PathMode, Pose, Program, Source, Spindle, State, Stop, Turn, View};

mod walk;

/// What counts as equal.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Tolerance {
    /// Paths, mm.
    pub length: f64,
    /// Rotary axes, rad.
    pub angle: f64,
    /// Feeds, speeds and times, as a share of the larger one.
    pub rate: f64,
    /// Differences listed at most.
    pub limit: usize,
    /// Compare in the work frame instead of the machine frame (for programs made for other offsets).
    pub work_frame: bool,
}

impl Default for Tolerance {
    fn default() -> Tolerance {
        Tolerance { length: 1e-6, angle: 1e-8, rate: 1e-6, limit: 20, work_frame: false }
    }
}

impl Tolerance {
    /// Paths within a length, mm; rotary axes, whose words have as many decimals, within as many degrees.
    pub fn within(length: f64) -> Tolerance {
        Tolerance { length, angle: length.to_radians(), ..Tolerance::default() }
    }
}

/// What differs.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub enum Aspect {
    /// Where the tool goes.
    Path,
    /// Which tool.
    Tool,
    /// How fast.
    Feed,
    /// Spindle speed or direction.
    Spindle,
    /// Coolant.
    Coolant,
    /// Dwells, stops, inputs, outputs, user M codes.
    Event,
    /// How the control follows the path, and what the operator may override.
    Control,
    /// Total time.
    Time,
}

/// One side of a difference: operation number and its source.
pub type Spot = Option<(usize, Source)>;

/// One difference.
#[derive(Clone, PartialEq, Debug)]
pub struct Difference {
    /// What.
    pub aspect: Aspect,
    /// Where in the first program.
    pub a: Spot,
    /// Where in the second.
    pub b: Spot,
    /// In plain words.
    pub message: String,
}

/// The result.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Diff {
    /// The first differences.
    pub differences: Vec<Difference>,
    /// How many there are in all up to where comparing stopped.
    pub count: usize,
    /// The paths are equal but cut into moves differently.
    pub resegmented: bool,
    /// Largest distance seen between equal paths, mm.
    pub deviation: f64,
    /// Sums of the first program.
    pub totals_a: Totals,
    /// Sums of the second.
    pub totals_b: Totals,
}

impl Diff {
    /// Whether the programs make the same motion.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
    /// Whether this aspect differs.
    pub fn differs(&self, aspect: Aspect) -> bool {
        self.differences.iter().any(|d| d.aspect == aspect)
    }
    fn note(&mut self, limit: usize, aspect: Aspect, a: Spot, b: Spot, message: String) {
        self.count += 1;
        if self.differences.len() < limit {
            self.differences.push(Difference { aspect, a, b, message });
        }
    }
}

/// Compares two programs: operation by operation first, and where the operations do not match, by the
/// shape of the path alone.
pub fn diff(a: &Program, b: &Program, tolerance: &Tolerance) -> Diff {
    let mut out = by_operation(a, b, tolerance);
    if out.differs(Aspect::Path) {
        let mut shape = walk::by_shape(a, b, tolerance);
        shape.resegmented = !shape.differs(Aspect::Path);
        // Two curves between the same ends are told apart best by how far they are from each other.
        let curves = out.differences.iter().find(|d| d.aspect == Aspect::Path && !d.message.is_empty());
        if let Some(d) = shape.differences.iter_mut().find(|d| d.aspect == Aspect::Path)
            && let Some(c) = curves.filter(|c| (c.a, c.b) == (d.a, d.b))
        {
            d.message.clone_from(&c.message);
        }
        out = shape;
    }
    (out.totals_a, out.totals_b) = (totals(a), totals(b));
    let (s, t) = (out.totals_a.seconds(), out.totals_b.seconds());
    // Rounded feeds and lengths add up; a tenth of a percent is not worth a line of its own.
    if out.count == 0 && !close(s, t, tolerance.rate.max(1e-3)) {
        out.note(tolerance.limit, Aspect::Time, None, None, format!("takes {s:.3} s, the other {t:.3} s"));
    }
    out
}

fn totals(program: &Program) -> Totals {
    let mut sum = Totals::default();
    let rates = Rates::default();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        sum.add(&measure(&view, &rates));
    }
    sum
}

fn close(a: f64, b: f64, share: f64) -> bool {
    a == b || (a - b).abs() <= share * a.abs().max(b.abs())
}

/// What a move is, whatever its shape.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Class {
    Rapid,
    Feed,
    Probe(u8),
    Sync,
    Tap,
}

impl Class {
    fn name(self) -> &'static str {
        match self {
            Class::Rapid => "a rapid",
            Class::Feed => "a feed move",
            Class::Probe(0) => "a probe move (G38.2)",
            Class::Probe(1) => "a probe move (G38.3)",
            Class::Probe(2) => "a probe move (G38.4)",
            Class::Probe(_) => "a probe move (G38.5)",
            Class::Sync => "a move in step with the spindle",
            Class::Tap => "a rigid tap",
        }
    }
}

/// What holds during a move.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Conditions {
    class: Class,
    tool: i32,
    mode: FeedMode,
    feed: f64,
    /// The feed is that of rotary axes, rad/s.
    angular: bool,
    spindles: [Spindle; 8],
    coolant: (bool, bool),
    work: u8,
    control: Control,
}

/// How the control follows the path, and what the operator may override.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Control {
    path: PathMode,
    feed: bool,
    speed: u8,
    adaptive: bool,
    hold: bool,
}

impl Control {
    fn of(state: &State) -> Control {
        let State { path, feed_override: feed, speed_override: speed, adaptive, feed_hold: hold, .. } = *state;
        Control { path, feed, speed, adaptive, hold }
    }
    fn same(&self, other: &Control, tolerance: &Tolerance) -> bool {
        let path = match (self.path, other.path) {
            (PathMode::Blend(p), PathMode::Blend(q)) => (p - q).abs() <= tolerance.length.max(tolerance.rate * p.abs()),
            (p, q) => p == q,
        };
        path && Control { path: other.path, ..*self } == *other
    }
    fn text(&self) -> String {
        let mut text = match self.path {
            PathMode::ExactStop => "with exact stops (G61.1)".to_string(),
            PathMode::ExactPath => "on the exact path (G61, or none named)".into(),
            PathMode::Blend(0.0) => "blending (G64)".into(),
            PathMode::Blend(t) => format!("blending within {t} mm (G64 P)"),
        };
        let locked = [
            (!self.feed, "without feed override"),
            (self.speed != 0xff, "without speed override"),
            (self.adaptive, "with adaptive feed"),
            (!self.hold, "without feed hold"),
        ];
        for (_, word) in locked.into_iter().filter(|(on, _)| *on) {
            text.push_str(&format!(", {word}"));
        }
        text
    }
}

impl Conditions {
    fn of(view: &View<'_, '_>) -> Conditions {
        let state = view.state;
        let sync = state.sync.filter(|s| !s.velocity);
        let class = match view.op {
            Op::Rapid => Class::Rapid,
            Op::Probe(kind) => Class::Probe(kind),
            Op::RigidTap { .. } => Class::Tap,
            _ if sync.is_some() => Class::Sync,
            _ => Class::Feed,
        };
        let angular = rotary_only(view);
        let feed = match sync {
            Some(s) => s.per_rev,
            None if angular => state.feed_angular,
            None => state.feed,
        };
        let coolant = (state.flood, state.mist);
        let (tool, mode, spindles) = (state.tool, state.feed_mode, state.spindles);
        Conditions { class, tool, mode, feed, angular, spindles, coolant, work: state.work, control: Control::of(state) }
    }
}

fn rotary_only(view: &View<'_, '_>) -> bool {
    view.op == Op::Linear && matches!(length(&view.op, view.start, view.end), Length::Angular(_))
}

/// Something that happens at a place.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Event {
    Dwell(f64),
    ToolChange(i32),
    Stop(Stop),
    Digital(i32, bool, bool),
    Analog(i32, f64, bool),
    Input(i32, bool, i32, f64),
    UserM(i32, f64, f64),
    Orient(i32, f64),
    Stored(u8, Axes, f64),
}

impl Event {
    fn of(view: &View<'_, '_>) -> Option<Event> {
        Some(match view.op {
            // No time is no wait: cycles say it where plans do not.
            Op::Dwell(s) if s != 0.0 => Event::Dwell(s),
            Op::ToolChange(_) | Op::ToolNumber(_) => Event::ToolChange(view.state.tool),
            Op::Stop(stop) => Event::Stop(stop),
            Op::DigitalOut { index, on, synced } => Event::Digital(index, on, synced),
            Op::AnalogOut { index, value, synced } => Event::Analog(index, value, synced),
            Op::InputWait { index, digital, wait, timeout } => Event::Input(index, digital, wait, timeout),
            Op::UserM { code, p, q } => Event::UserM(code, p, q),
            Op::SpindleOrient { spindle, angle, .. } => Event::Orient(spindle, angle),
            Op::StoredOffset { number, offset, rotation } => Event::Stored(number, offset, rotation),
            _ => return None,
        })
    }
    fn same(&self, other: &Event, tolerance: &Tolerance) -> bool {
        let rate = tolerance.rate;
        match (self, other) {
            (Event::Dwell(a), Event::Dwell(b)) => close(*a, *b, rate),
            (Event::Analog(i, a, s), Event::Analog(j, b, t)) => i == j && s == t && close(*a, *b, rate),
            (Event::Orient(i, a), Event::Orient(j, b)) => i == j && close(*a, *b, rate),
            (Event::UserM(i, p, q), Event::UserM(j, r, s)) => i == j && close(*p, *r, rate) && close(*q, *s, rate),
            (Event::Stored(i, a, r), Event::Stored(j, b, s)) => {
                let within = |k: usize| if (3..6).contains(&k) { tolerance.angle } else { tolerance.length };
                i == j && (0..9).all(|k| (a[k] - b[k]).abs() <= within(k)) && (r - s).abs() <= tolerance.angle
            }
            (a, b) => a == b,
        }
    }
    fn aspect(&self) -> Aspect {
        if matches!(self, Event::ToolChange(_)) { Aspect::Tool } else { Aspect::Event }
    }
    fn text(&self) -> String {
        match self {
            Event::Dwell(s) => format!("waits {s} s"),
            Event::ToolChange(tool) => format!("changes to tool {tool}"),
            Event::Stop(stop) => format!("stops ({})", format!("{stop:?}").to_lowercase()),
            Event::Digital(index, on, synced) => {
                format!("switches output {index} {} {}", if *on { "on" } else { "off" }, when(*synced))
            }
            Event::Analog(index, value, synced) => format!("sets analog output {index} to {value} {}", when(*synced)),
            Event::Input(index, digital, wait, timeout) => {
                let kind = if *digital { "digital" } else { "analog" };
                format!("waits for {kind} input {index} (M66 L{wait} Q{timeout})")
            }
            Event::UserM(code, p, q) => format!("runs M{code} P{p} Q{q}"),
            Event::Stored(number, offset, _) => {
                let [x, y, z, ..] = offset;
                format!("stores work offset {number} (X{x:.4} Y{y:.4} Z{z:.4} in its first axes, mm)")
            }
            Event::Orient(spindle, angle) => {
                format!("turns spindle {spindle} to {:.4}°", angle.to_degrees())
            }
        }
    }
}

fn when(synced: bool) -> &'static str {
    if synced { "with the next move" } else { "at once" }
}

/// What matters of an operation. One at a time is held, so its size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
enum Item {
    Move { conditions: Conditions, end: Axes, middle: Option<[f64; 3]> },
    Event(Event),
    End,
}

fn place(state: &State, axes: &Axes, tolerance: &Tolerance) -> Axes {
    if tolerance.work_frame { *axes } else { state.machine(axes) }
}

/// A point inside a curve, so that two curves with the same ends can be told apart.
fn middle(op: &Op<'_>, start: &Pose, end: &Pose) -> Option<[f64; 3]> {
    match op {
        Op::Arc(arc) => Some(ArcShape::new(arc, start, end).point(1.0 / 3.0)),
        Op::Nurbs { order, points } => nurbs_point(*order, points, 1.0 / 3.0).map(|[x, y]| [x, y, start.axes[2]]),
        Op::RigidTap { bottom, .. } => Some(*bottom),
        _ => None,
    }
}

fn item(view: &View<'_, '_>, tolerance: &Tolerance) -> Option<Item> {
    if let Some(event) = Event::of(view) {
        return Some(Item::Event(event));
    }
    let tap = matches!(view.op, Op::RigidTap { .. });
    if !view.op.moves() && !tap {
        return None;
    }
    if !tap && !matches!(view.op, Op::Arc(_)) && view.start.axes == view.end.axes {
        return None;
    }
    let inner = middle(&view.op, view.start, view.end).map(|p| {
        let mut axes = view.end.axes;
        axes[..3].copy_from_slice(&p);
        let m = place(view.state, &axes, tolerance);
        [m[0], m[1], m[2]]
    });
    let end = place(view.state, &view.end.axes, tolerance);
    Some(Item::Move { conditions: Conditions::of(view), end, middle: inner })
}

fn next_item(cursor: &mut Cursor<'_>, tolerance: &Tolerance) -> (Item, Spot) {
    while let Some(view) = cursor.next() {
        if let Some(item) = item(&view, tolerance) {
            return (item, Some((view.index, view.source)));
        }
    }
    (Item::End, None)
}

fn by_operation(a: &Program, b: &Program, tolerance: &Tolerance) -> Diff {
    let mut out = Diff::default();
    let (mut ca, mut cb) = (a.cursor(), b.cursor());
    let mut told = Told::default();
    loop {
        let ((x, sa), (y, sb)) = (next_item(&mut ca, tolerance), next_item(&mut cb, tolerance));
        if matches!((&x, &y), (Item::End, Item::End)) {
            told.end(&mut out, tolerance);
            return out;
        }
        if !same_item(&mut out, &x, &y, sa, sb, &mut told, tolerance) {
            out.note(usize::MAX, Aspect::Path, sa, sb, other_curve(&x, &y, tolerance).unwrap_or_default());
            return out;
        }
    }
}

/// False when the two cannot be laid side by side.
fn same_item(
    out: &mut Diff,
    x: &Item,
    y: &Item,
    sa: Spot,
    sb: Spot,
    told: &mut Told,
    tolerance: &Tolerance,
) -> bool {
    match (x, y) {
        (Item::Move { conditions: c, end, middle }, Item::Move { conditions: d, end: e, middle: m }) => {
            let far = distance(end, e).max(match (middle, m) {
                (Some(p), Some(q)) => libm::hypot(libm::hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]),
                (None, None) => 0.0,
                _ => f64::INFINITY,
            });
            if far.is_nan() || far > tolerance.length || turned(end, e) > tolerance.angle || c.class != d.class {
                return false;
            }
            out.deviation = out.deviation.max(far);
            told.compare(out, (c, d), (sa, sb), tolerance);
            true
        }
        (Item::Event(p), Item::Event(q)) => {
            if !p.same(q, tolerance) {
                let message = format!("{}, the other {}", p.text(), q.text());
                out.note(tolerance.limit, p.aspect(), sa, sb, message);
            }
            true
        }
        _ => false,
    }
}

/// What to say of two curves of one kind that end at one place.
fn other_curve(x: &Item, y: &Item, tolerance: &Tolerance) -> Option<String> {
    let (Item::Move { conditions: c, end, middle: Some(p) }, Item::Move { conditions: d, end: e, middle: Some(q) }) = (x, y) else {
        return None;
    };
    let same_end = distance(end, e) <= tolerance.length && turned(end, e) <= tolerance.angle && c.class == d.class;
    let far = libm::hypot(libm::hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
    same_end.then(|| format!("goes to {}, the other too on another curve, {far:.3} mm away after a third", walk::point(end)))
}

fn distance(a: &Axes, b: &Axes) -> f64 {
    let sum: f64 = [0, 1, 2, 6, 7, 8].into_iter().map(|i: usize| (a[i] - b[i]) * (a[i] - b[i])).sum();
    libm::sqrt(sum)
}

fn turned(a: &Axes, b: &Axes) -> f64 {
    (3..6).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
}

/// What has been told about the conditions of moves, so that each difference is noted once until it changes.
#[derive(Default)]
struct Told {
    last: Option<(Conditions, Conditions)>,
    tools: Option<(i32, i32)>,
    spindles: Option<([Spindle; 8], [Spindle; 8])>,
    coolant: Option<((bool, bool), (bool, bool))>,
    works: Option<(u8, u8)>,
    control: Option<(Control, Control)>,
    /// A difference of rapids, which is told where nothing but rapids follows.
    rapid: Option<(Conditions, Conditions, Spot, Spot)>,
    cut: bool,
}

impl Told {
    /// Notes differences in what holds during a move. A spindle may be switched before or behind a rapid, and a work offset selected:
    /// what counts is what they do in cuts.
    fn compare(&mut self, out: &mut Diff, (c, d): (&Conditions, &Conditions), at: (Spot, Spot), tolerance: &Tolerance) {
        let cuts = c.class != Class::Rapid;
        self.cut |= cuts;
        if c == d || self.last == Some((*c, *d)) {
            return;
        }
        self.last = Some((*c, *d));
        let mut note = |aspect, message| out.note(tolerance.limit, aspect, at.0, at.1, message);
        if changed(&mut self.tools, (c.tool, d.tool), c.tool != d.tool) {
            note(Aspect::Tool, format!("works with tool {}, the other with tool {}", c.tool, d.tool));
        }
        if cuts && c.class != Class::Tap && (c.class != Class::Sync && (c.mode != d.mode || c.angular != d.angular) || !close(c.feed, d.feed, tolerance.rate)) {
            note(Aspect::Feed, format!("feeds {}, the other {}", feed_text(c), feed_text(d)));
        }
        if c.class == Class::Feed && changed(&mut self.control, (c.control, d.control), !c.control.same(&d.control, tolerance)) {
            note(Aspect::Control, format!("feeds {}, the other {}", c.control.text(), d.control.text()));
        }
        if cuts {
            self.compare_rest(out, (c, d), at, tolerance);
        } else if self.rapid.is_none() {
            self.rapid = Some((*c, *d, at.0, at.1));
        }
    }

    fn compare_rest(&mut self, out: &mut Diff, (c, d): (&Conditions, &Conditions), at: (Spot, Spot), tolerance: &Tolerance) {
        let mut note = |aspect, message| out.note(tolerance.limit, aspect, at.0, at.1, message);
        if changed(&mut self.works, (c.work, d.work), c.work != d.work) {
            note(Aspect::Event, format!("works in {}, the other in {}", system(c.work), system(d.work)));
        }
        if changed(&mut self.spindles, (c.spindles, d.spindles), !same_spindles(c, d, tolerance.rate)) {
            note(Aspect::Spindle, format!("spindle {}, the other {}", spindle_text(c), spindle_text(d)));
        }
        if changed(&mut self.coolant, (c.coolant, d.coolant), c.coolant != d.coolant) {
            note(Aspect::Coolant, format!("coolant {}, the other {}", coolant_text(c), coolant_text(d)));
        }
    }

    /// Behind the last move: programs of rapids alone are compared as they are.
    fn end(&mut self, out: &mut Diff, tolerance: &Tolerance) {
        if let Some((c, d, a, b)) = self.rapid.take().filter(|_| !self.cut) {
            self.compare_rest(out, (&c, &d), (a, b), tolerance);
        }
    }
}

/// Whether a difference is there and is not the one that was told last.
fn changed<T: PartialEq>(told: &mut Option<T>, pair: T, differs: bool) -> bool {
    let new = differs.then_some(pair);
    let fresh = new.is_some() && *told != new;
    *told = new;
    fresh
}

/// `G54` … `G59.3`
fn system(work: u8) -> String {
    match work {
        0..=6 => format!("G{}", 53 + work),
        _ => format!("G59.{}", work - 6),
    }
}

fn same_spindles(c: &Conditions, d: &Conditions, rate: f64) -> bool {
    c.spindles.iter().zip(&d.spindles).all(|(s, t)| {
        let off = s.turn == Turn::Stop && t.turn == Turn::Stop;
        off || (s.turn == t.turn && s.surface.is_some() == t.surface.is_some() && close(s.speed, t.speed, rate))
    })
}

fn feed_text(c: &Conditions) -> String {
    match (c.class, c.mode) {
        (Class::Sync, _) | (_, FeedMode::PerRev) => format!("{} mm/rev", c.feed),
        (_, FeedMode::PerTime) if c.angular => format!("{} °/min", round(c.feed.to_degrees() * 60.0)),
        (_, FeedMode::PerTime) => format!("{} mm/min", round(c.feed * 60.0)),
        (_, FeedMode::Inverse) => format!("{} 1/min", round(c.feed * 60.0)),
    }
}

/// For people: without the last bits of a conversion.
fn round(v: f64) -> f64 {
    libm::round(v * 1e9) / 1e9
}

fn spindle_text(c: &Conditions) -> String {
    let on = c.spindles.iter().find(|s| s.turn != Turn::Stop);
    on.map_or("stopped".into(), |s| {
        let unit = if s.surface.is_some() { "mm/s" } else { "rpm" };
        let turn = if s.turn == Turn::Cw { "clockwise" } else { "counter-clockwise" };
        format!("{turn} at {} {unit}", s.speed)
    })
}

fn coolant_text(c: &Conditions) -> &'static str {
    match c.coolant {
        (false, false) => "off",
        (true, false) => "flood",
        (false, true) => "mist",
        (true, true) => "flood and mist",
    }
}
