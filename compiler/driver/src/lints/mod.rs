//! Machinist's lints: what the controller accepts and someone should look at.
//!
//! They read the canonical stream, like every back end. What a lint remembers from block to block is either
//! in the interpreter's modal state already (spindle, coolant, offsets) or one bit of [`Flags`], so that the
//! state between two chunks converges quickly after an edit. Lints that compare distant parts of a program
//! (a rapid against everything cut before it) leave a [`Summary`] of each chunk and are decided when the
//! chunks are put together. One file per lint; each is a row of `spec/diagnostics/e02-lints.toml`.

mod coolant;
mod cut;
mod end;
mod feed;
mod labels;
mod path;
mod rules;
mod spindle;
mod stock;
mod tool;
mod travel;
mod units;

use gr_canon::{At, Axes, Call, FileId, FrameId, Mark, Plane, Sink, Units};
use gr_interp::{Modal, Setup};
use gr_spec::{Code, Severity};

pub(crate) use end::left_on;
pub(crate) use labels::{called_as, has_main, holds_own_sub, labels};
pub use rules::{Level, Rules};
pub(crate) use stock::{Cuts, Dive};
pub(crate) use travel::Limits;

/// What lints remember from chunk to chunk.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub(crate) struct Flags(u32);

impl Flags {
    /// The program has used the spindle.
    pub(crate) const SPINDLE_USED: u32 = 1;
    /// Cutting with a stopped spindle was reported; until it starts.
    pub(crate) const STOPPED_TOLD: u32 = 1 << 1;
    /// The tool was changed and its length not applied yet.
    pub(crate) const LENGTH_OPEN: u32 = 1 << 2;
    /// G20 or G21 was there, or its absence was reported.
    pub(crate) const UNITS_DONE: u32 = 1 << 3;
    /// Dry cutting was reported; until the tool is changed.
    pub(crate) const DRY_TOLD: u32 = 1 << 4;
    /// A cut before the first use of the spindle was seen.
    pub(crate) const BARE_CUT: u32 = 1 << 5;
    /// A feed per revolution too large was reported; until F or the mode changes.
    pub(crate) const REVOLUTION_TOLD: u32 = 1 << 6;
    /// First bit of the eighteen that say: beyond the low/high limit of an axis was reported.
    pub(crate) const BEYOND: u32 = 1 << 8;

    /// Before a program.
    pub(crate) fn at_start(setup: &Setup) -> Flags {
        let mut flags = Flags::default();
        flags.set(Flags::UNITS_DONE, units::said_at_start(setup));
        flags
    }

    pub(crate) fn has(self, bit: u32) -> bool {
        self.0 & bit != 0
    }
    pub(crate) fn set(&mut self, bit: u32, on: bool) {
        if on {
            self.0 |= bit;
        } else {
            self.0 &= !bit;
        }
    }
}

/// A finding of a lint or of the interpreter.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Found {
    pub(crate) code: Code,
    pub(crate) severity: Severity,
    pub(crate) place: Where,
    /// Word to underline, none = the whole block.
    pub(crate) letter: Option<u8>,
    /// Exact place, relative to the chunk.
    pub(crate) span: Option<gr_text::Span>,
    pub(crate) args: Vec<String>,
    /// Who found it.
    pub(crate) from: From,
}

/// Who found something.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum From {
    /// A lint.
    Lint,
    /// The interpreter, and went on.
    Doubt,
    /// The interpreter, and gave the block up.
    Fault,
}

/// Where a call came from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Where {
    pub(crate) file: FileId,
    pub(crate) line: u32,
    pub(crate) frame: FrameId,
}

impl std::convert::From<&At<'_>> for Where {
    fn from(at: &At<'_>) -> Where {
        Where { file: at.file, line: at.line, frame: at.frame }
    }
}

/// What a chunk leaves for lints that compare distant parts of a program.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Summary {
    /// The first cut while the spindle was not used yet.
    pub(crate) bare_cut: Option<Where>,
    /// The spindle is started in this chunk.
    pub(crate) spindle_starts: bool,
    /// What was cut since the last change of frame in this chunk.
    pub(crate) cuts: Cuts,
    /// The frame changed in this chunk.
    pub(crate) new_frame: bool,
    /// Rapids that go deeper than what this chunk cut before them.
    pub(crate) dives: Vec<Dive>,
}

impl Summary {
    /// More dives may be missing.
    #[inline]
    pub(crate) fn is_full(&self) -> bool {
        self.dives.len() >= stock::MOST_PER_CHUNK
    }
    /// The same with other places.
    pub(crate) fn moved(mut self, place: impl Fn(Where) -> Where) -> Summary {
        self.bare_cut = self.bare_cut.map(&place);
        for dive in &mut self.dives {
            dive.place = place(dive.place);
        }
        self
    }
}

/// The sink that the lints watch the stream through.
pub(crate) struct Lints<'a> {
    pub(crate) rules: &'a Rules,
    pub(crate) flags: Flags,
    pub(crate) found: Vec<Found>,
    pub(crate) summary: Summary,
    /// Position in the active work frame and program units.
    position: [f64; 3],
    /// A B C there.
    rotary: [f64; 3],
    /// G5x, G92 and tool offsets, summed when needed.
    origin: Axes,
    g92: Axes,
    tool_offset: Axes,
    rotation: f64,
    turning: u8,
    /// Line of the last spindle stop, and whether a spindle turned then.
    last_stop: Option<(u32, bool)>,
    compensation: bool,
    mist: bool,
    flood: bool,
    feed_per_revolution: bool,
    /// A thread is cut: motion follows the spindle by a lead of its own.
    thread: bool,
    feed: f64,
    units: Units,
    plane: Plane,
    /// Tool that T named last.
    selected: i32,
    /// Tool that M6 brought last.
    tool: i32,
}

/// What the stream has said so far. The interpreter's state says the same, except while cutter compensation
/// holds calls back (the stream lags behind) and after an error dropped them.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Seen {
    position: [f64; 3],
    rotary: [f64; 3],
    offsets: [Axes; 3],
    rotation: f64,
    feed: f64,
    turning: u8,
    switches: [bool; 5],
    units: Units,
    plane: Plane,
    tools: [i32; 2],
}

fn xyz(axes: &[f64]) -> [f64; 3] {
    [axes[0], axes[1], axes[2]]
}

impl<'a> Lints<'a> {
    /// Starts from the state before a block.
    pub(crate) fn new(rules: &'a Rules, state: &Modal, flags: Flags) -> Lints<'a> {
        Lints {
            rules,
            flags,
            found: Vec::new(),
            summary: Summary::default(),
            position: xyz(&state.current),
            rotary: xyz(&state.current[3..]),
            origin: state.origin,
            g92: state.g92,
            tool_offset: state.tool_offset,
            rotation: state.rotation,
            turning: state.turning.iter().enumerate().fold(0, |a, (i, t)| a | (u8::from(*t != 0) << i)),
            last_stop: None,
            compensation: state.comp_side != 0,
            mist: state.mist != 0,
            flood: state.flood != 0,
            feed_per_revolution: state.feed_mode == 2,
            thread: false,
            feed: state.feed,
            units: state.units(),
            plane: state.plane(),
            selected: state.selected_tool,
            tool: state.selected_tool,
        }
    }

    /// What the stream has said so far.
    pub(crate) fn seen(&self) -> Seen {
        Seen {
            position: self.position,
            rotary: self.rotary,
            offsets: [self.origin, self.g92, self.tool_offset],
            rotation: self.rotation,
            feed: self.feed,
            turning: self.turning,
            switches: [self.compensation, self.mist, self.flood, self.feed_per_revolution, self.thread],
            units: self.units,
            plane: self.plane,
            // Only a tool whose length is missing matters.
            tools: [self.selected, if self.flags.has(Flags::LENGTH_OPEN) { self.tool } else { self.selected }],
        }
    }

    /// Goes on from what the stream had said.
    pub(crate) fn resume(&mut self, seen: &Seen) {
        (self.position, self.rotary) = (seen.position, seen.rotary);
        [self.origin, self.g92, self.tool_offset] = seen.offsets;
        [self.compensation, self.mist, self.flood, self.feed_per_revolution, self.thread] = seen.switches;
        [self.selected, self.tool] = seen.tools;
        (self.rotation, self.feed, self.turning) = (seen.rotation, seen.feed, seen.turning);
        (self.units, self.plane) = (seen.units, seen.plane);
    }

    fn report(&mut self, code: Code, at: &At<'_>, letter: Option<u8>, args: &[String]) {
        if let Some(severity) = self.rules.severity(code) {
            self.found.push(Found { code, severity, place: at.into(), letter, span: None, args: args.to_vec(), from: From::Lint });
        }
    }

    /// Millimetres in one program unit.
    fn unit(&self) -> f64 {
        if self.units == Units::Inch { 25.4 } else { 1.0 }
    }

    /// A feed move to `end`.
    #[inline]
    fn cut(&mut self, at: &At<'_>, end: [f64; 3]) {
        cut::check(self, at, end);
        self.position = end;
    }

    fn arc_end(&self, first: f64, second: f64, axis: f64) -> [f64; 3] {
        match self.plane {
            Plane::Yz | Plane::Vw => [axis, first, second],
            Plane::Xz | Plane::Uw => [second, axis, first],
            Plane::Xy | Plane::Uv => [first, second, axis],
        }
    }

    /// Another side of the part comes before the tool.
    #[inline]
    fn turned(&mut self, end: &Axes) {
        let rotary = xyz(&end[3..]);
        if rotary != self.rotary {
            self.rotary = rotary;
            self.frame_changed();
        }
    }

    /// Whether Z is the depth, as far as the program shows.
    fn upright(&self) -> bool {
        self.rotary[..2] == [0.0; 2]
    }

    fn frame_changed(&mut self) {
        self.summary.new_frame = true;
        self.summary.cuts = Cuts::default();
    }
}

impl Sink for Lints<'_> {
    #[inline]
    fn call(&mut self, at: &At<'_>, call: &Call) {
        match call {
            Call::StraightFeed(end) => {
                travel::check(self, at, end);
                self.turned(end);
                self.cut(at, xyz(end));
            }
            Call::StraightTraverse(end) => {
                units::check(self, at);
                travel::check(self, at, end);
                self.turned(end);
                let end = xyz(end);
                stock::rapid(self, at, end);
                self.position = end;
            }
            other => self.rare(at, other),
        }
    }

    fn mark(&mut self, _at: &At<'_>, mark: &Mark) {
        match mark {
            Mark::LengthInForce => self.flags.set(Flags::LENGTH_OPEN, false),
            Mark::Meant(b'g', 200 | 210) => self.flags.set(Flags::UNITS_DONE, true),
            Mark::Meant(b'g', 430..=432 | 490) => self.flags.set(Flags::LENGTH_OPEN, false),
            Mark::Meant(b'm', 30 | 40) => {
                self.flags.set(Flags::STOPPED_TOLD, true);
                self.flags.set(Flags::BARE_CUT, true);
            }
            _ => {}
        }
    }
}

impl Lints<'_> {
    fn rare(&mut self, at: &At<'_>, call: &Call) {
        match call {
            Call::ArcFeed { first_end, second_end, first_axis, second_axis, rotation, axis_end, rest } => {
                let end = self.arc_end(*first_end, *second_end, *axis_end);
                travel::check_arc(self, at, end, rest, [*first_axis, *second_axis], *rotation);
                self.cut(at, end);
            }
            Call::NurbsFeed(curve) => {
                if let Some([a, b, _]) = curve.points.last() {
                    let mut end = self.position;
                    match curve.plane {
                        gr_canon::Plane::Yz => (end[1], end[2]) = (*a, *b),
                        gr_canon::Plane::Xz => (end[2], end[0]) = (*a, *b),
                        _ => (end[0], end[1]) = (*a, *b),
                    }
                    self.cut(at, end);
                }
            }
            Call::RigidTap(end, _) => {
                travel::check_xyz(self, at, *end);
                // The tap comes back to where it started.
            }
            Call::StraightProbe(end, _) => self.position = xyz(end),
            Call::UseLengthUnits(units) => {
                let factor = self.unit();
                self.units = *units;
                let factor = factor / self.unit();
                self.position.iter_mut().for_each(|x| *x *= factor);
                for offset in [&mut self.origin, &mut self.g92, &mut self.tool_offset] {
                    let [x, y, z, _, _, _, u, v, w] = offset;
                    [x, y, z, u, v, w].into_iter().for_each(|x| *x *= factor);
                }
                self.flags.set(Flags::UNITS_DONE, true);
                self.frame_changed();
            }
            Call::SelectPlane(plane) => self.plane = *plane,
            Call::SetG5xOffset(_, offset) => {
                let old = std::mem::replace(&mut self.origin, *offset);
                self.moved_frame(old, self.origin);
            }
            Call::SetG92Offset(offset) => {
                let old = std::mem::replace(&mut self.g92, *offset);
                self.moved_frame(old, self.g92);
            }
            Call::UseToolLengthOffset(offset, _) => {
                for (position, (old, new)) in self.position.iter_mut().zip(self.tool_offset.iter().zip(offset)) {
                    *position += old - new;
                }
                self.tool_offset = *offset;
                self.flags.set(Flags::LENGTH_OPEN, false);
            }
            Call::SetXyRotation(angle) => {
                if *angle != self.rotation {
                    self.rotation = *angle;
                    self.frame_changed();
                }
            }
            Call::SetFeedMode(_, mode) => {
                // Where a repeated G95 keeps the feed, it was told of that feed.
                if std::mem::replace(&mut self.feed_per_revolution, *mode == 1) != (*mode == 1) {
                    self.flags.set(Flags::REVOLUTION_TOLD, false);
                }
            }
            Call::SetFeedRate(feed) => {
                self.feed = *feed;
                self.flags.set(Flags::REVOLUTION_TOLD, false);
            }
            Call::SetMotionControlMode(mode) => path::check(self, at, *mode),
            Call::ChangeTool(_) => tool::changed(self),
            Call::SelectTool(tool) => self.selected = *tool,
            Call::StartSpeedFeedSynch(_, _, velocity) => self.thread = !velocity,
            Call::StopSpeedFeedSynch => self.thread = false,
            Call::MistOn => self.mist = true,
            Call::MistOff => self.mist = false,
            Call::FloodOn => self.flood = true,
            Call::FloodOff => self.flood = false,
            Call::ProgramEnd => end::program_end(self, at),
            Call::Comment(text) => self.remark(text),
            _ => spindle::watch(self, at, call),
        }
    }

    /// What the interpreter remarks about compensation.
    fn remark(&mut self, text: &str) {
        if let Some(rest) = text.strip_prefix("interpreter: cutter radius compensation ") {
            self.compensation = !rest.starts_with("off");
        }
    }

    fn moved_frame(&mut self, old: Axes, new: Axes) {
        if old != new {
            for (position, (old, new)) in self.position.iter_mut().zip(old.iter().zip(new)) {
                *position += old - new;
            }
            self.frame_changed();
        }
    }

    /// Whether the stop that belongs to M2 or M30 on this line found the spindle turning.
    fn stopped_by_end(&self, line: u32) -> bool {
        self.last_stop == Some((line, true))
    }
}

/// Cutting before the spindle is started for the first time.
pub(crate) fn stopped_at(place: Where, rules: &Rules) -> Option<Found> {
    let code = gr_spec::code::SPINDLE_STOPPED;
    Some(Found { code, severity: rules.severity(code)?, place, letter: None, span: None, args: Vec::new(), from: From::Lint })
}
