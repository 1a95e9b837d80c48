//! Canonical stream → motion IR: program units become mm, degrees rad, minutes seconds. Nothing is
//! simplified; what the controller is told, the IR says.

use crate::op::{Arc, ArcPlane, Pose, Source};
use crate::state::{State, Sync, plane_axes};
use crate::{Axes, Builder, FeedMode, Marker, Note, Op, Override, PathMode, Program, Stop, Turn, Units};
use gr_canon::{At, Call, CallFrame, FrameId, Mark, Sink};

/// Share of a coordinate, and of 1, that is no difference.
const NOISE: f64 = 1e-12;
const RAD: f64 = std::f64::consts::PI / 180.0;

/// Builds a [`Program`] from the canonical stream.
#[derive(Clone, Debug, Default)]
pub struct Lowering {
    out: Builder,
    points: Vec<f64>,
    /// Units of the machine, in which it is told of its tool table.
    machine: Units,
}

impl Lowering {
    /// Starts at the origin, in mm.
    pub fn new() -> Lowering {
        Lowering::default()
    }
    /// Goes on from a pose and a state (for a program lowered in pieces).
    pub fn from_state(pose: Pose, state: State) -> Lowering {
        Lowering { out: Builder::from_state(pose, state), ..Lowering::default() }
    }
    /// On a machine with these length units; without it, mm.
    pub fn on(self, machine: Units) -> Lowering {
        Lowering { machine, ..self }
    }
    /// Of a machine that stands at this place, its own coordinates in its units and degrees; without it, at its zero.
    pub fn standing(self, at: &Axes) -> Lowering {
        let k = if self.machine == Units::Inch { 25.4 } else { 1.0 };
        Lowering { out: Builder::from_state(Pose::at(Self::scaled(at, k)), *self.out.state()), ..self }
    }
    /// The program.
    pub fn finish(self) -> Program {
        self.out.finish()
    }
    /// What has been built so far.
    pub fn builder(&self) -> &Builder {
        &self.out
    }
    /// The builder, to add operations of one's own.
    pub fn builder_mut(&mut self) -> &mut Builder {
        &mut self.out
    }

    #[inline]
    fn scale(&self) -> f64 {
        if self.out.state().units == Units::Inch { 25.4 } else { 1.0 }
    }
    #[inline]
    fn axes(&self, a: &Axes) -> Axes {
        Self::scaled(a, self.scale())
    }
    #[inline]
    fn scaled(a: &Axes, k: f64) -> Axes {
        let r = RAD;
        [a[0] * k, a[1] * k, a[2] * k, a[3] * r, a[4] * r, a[5] * r, a[6] * k, a[7] * k, a[8] * k]
    }
    #[inline]
    fn goto(&mut self, op: Op<'_>, axes: &Axes, source: Source) {
        let mut end = self.axes(axes);
        // Through inches and offsets a place comes back with other last bits: that is no motion.
        for (to, from) in end.iter_mut().zip(&self.out.pose().axes) {
            if *to != *from && (*to - *from).abs() <= NOISE * (1.0 + from.abs()) {
                *to = *from;
            }
        }
        self.out.push_to(op, &Pose::at(end), source);
    }

    fn arc(&mut self, ends: [f64; 3], center: [f64; 2], turns: i32, rest: &[f64; 6], source: Source) {
        let k = self.scale();
        let plane = self.out.state().plane;
        let (first, second, third) = plane_axes(plane);
        let mut end: Axes = [0.0; 9];
        end[first] = ends[0];
        end[second] = ends[1];
        end[third] = ends[2];
        end[3..].copy_from_slice(rest);
        let mut c = self.out.pose().xyz();
        c[first] = center[0] * k;
        c[second] = center[1] * k;
        self.goto(Op::Arc(Arc { plane: ArcPlane::Work(plane), center: c, turns }), &end, source);
    }

    fn nurbs(&mut self, nurbs: &gr_canon::Nurbs, source: Source) {
        if nurbs.plane != gr_canon::Plane::Xy || !nurbs.knots.is_empty() {
            return self.nurbs_as_lines(nurbs, source);
        }
        let k = self.scale();
        let mut points = std::mem::take(&mut self.points);
        points.clear();
        points.extend(nurbs.points.iter().flat_map(|p| [p[0] * k, p[1] * k, p[2]]));
        let mut end = *self.out.pose();
        if let Some(last) = nurbs.points.last() {
            (end.axes[0], end.axes[1]) = (last[0] * k, last[1] * k);
        }
        self.out.push_to(Op::Nurbs { order: nurbs.order, points: &points }, &end, source);
        self.points = points;
    }

    /// The spline operation lies in XY and has uniform knots. Splines of the other planes and those with knots of
    /// their own (LinuxCNC 2.10 has them) become short lines, 200 of a span: they stay nearer than a 20 000th of the
    /// control polygon. With knots of its own a curve does not begin where the tool is, but at its first point.
    fn nurbs_as_lines(&mut self, nurbs: &gr_canon::Nurbs, source: Source) {
        const PIECES: usize = 200;
        let k = self.scale();
        let (first, second) = match nurbs.plane {
            gr_canon::Plane::Yz => (1, 2),
            gr_canon::Plane::Xz => (2, 0),
            _ => (0, 1),
        };
        // The last lines of a G6.2 hold knots only.
        let ends = if nurbs.knots.is_empty() { 0 } else { nurbs.order as usize };
        let real = &nurbs.points[..nurbs.points.len().saturating_sub(ends)];
        let points: Vec<f64> = real.iter().flat_map(|p| [p[0] * k, p[1] * k, p[2]]).collect();
        let spans = (real.len() + 1).saturating_sub(nurbs.order as usize).max(1);
        let count = spans * PIECES;
        for i in usize::from(nurbs.knots.is_empty())..=count {
            let share = i as f64 / count as f64;
            let p = match nurbs.knots[..] {
                [] => crate::geometry::nurbs_point(nurbs.order, &points, share),
                ref knots => crate::geometry::knotted_point(nurbs.order, &points, knots, share),
            };
            let Some(p) = p else { break };
            let mut end = *self.out.pose();
            (end.axes[first], end.axes[second]) = (p[0], p[1]);
            self.out.push_to(Op::Linear, &end, source);
        }
    }

    fn feed(&mut self, rate: f64, source: Source) {
        let per = if self.out.state().feed_mode == FeedMode::PerTime { 60.0 } else { 1.0 };
        let op = Op::Feed { linear: rate * self.scale() / per, angular: rate * RAD / per };
        self.out.push(op, source);
    }

    fn spindle_speed(&mut self, spindle: i32, speed: f64, source: Source) {
        // Under constant surface speed S is in m/min or feet/min.
        let surface = self.out.state().spindle(spindle).surface.is_some();
        let per_minute = if self.scale() == 1.0 { 1000.0 } else { 304.8 };
        let speed = if surface { speed * per_minute / 60.0 } else { speed };
        self.out.push(Op::SpindleSpeed { spindle, speed }, source);
    }

    fn motion(&mut self, call: &Call, s: Source) -> bool {
        match call {
            Call::StraightTraverse(end) => self.goto(Op::Rapid, end, s),
            Call::StraightFeed(end) => self.goto(Op::Linear, end, s),
            Call::ArcFeed { first_end, second_end, first_axis, second_axis, rotation, axis_end, rest } => {
                let ends = [*first_end, *second_end, *axis_end];
                self.arc(ends, [*first_axis, *second_axis], *rotation, rest, s);
            }
            Call::NurbsFeed(nurbs) => self.nurbs(nurbs, s),
            Call::StraightProbe(end, kind) => self.goto(Op::Probe(*kind), end, s),
            Call::RigidTap(p, scale) => {
                let k = self.scale();
                self.out.push(Op::RigidTap { bottom: p.map(|v| v * k), scale: *scale }, s);
            }
            _ => return false,
        }
        true
    }

    fn setting(&self, call: &Call) -> Option<Op<'static>> {
        let k = self.scale();
        Some(match *call {
            Call::UseLengthUnits(units) => Op::Units(units),
            Call::SetG5xOffset(n, ref a) => Op::WorkOffset(n, self.axes(a)),
            Call::StoreG5xOffset(number, ref a, angle) => Op::StoredOffset { number, offset: self.axes(a), rotation: angle * RAD },
            Call::SetG92Offset(ref a) => Op::LocalOffset(self.axes(a)),
            Call::SetXyRotation(angle) => Op::Rotation(angle * RAD),
            Call::SetFeedReferenceXyz => Op::FeedReferenceXyz,
            Call::OnReset => Op::Reset,
            Call::SelectPlane(plane) => Op::Plane(plane),
            Call::SetFeedMode(spindle, mode) => {
                let mode = if mode == 0 { FeedMode::PerTime } else { FeedMode::PerRev };
                Op::FeedMode { spindle, mode }
            }
            Call::StartSpeedFeedSynch(spindle, per_rev, velocity) => {
                Op::SyncStart(Sync { spindle, per_rev: per_rev * k, velocity })
            }
            Call::StopSpeedFeedSynch => Op::SyncStop,
            Call::TurnProbeOn => Op::ProbeMode(true),
            Call::TurnProbeOff => Op::ProbeMode(false),
            Call::Dwell(seconds) => Op::Dwell(seconds),
            Call::SetMotionControlMode(mode) => Op::PathMode(match mode {
                gr_canon::PathMode::ExactStop => PathMode::ExactStop,
                gr_canon::PathMode::ExactPath => PathMode::ExactPath,
                gr_canon::PathMode::Continuous(t) => PathMode::Blend(t * k),
            }),
            Call::SetNaivecamTolerance(t) => Op::MergeTolerance(t * k),
            Call::SetPlannerMode(kind, corner) => Op::Planner((kind != 0).then_some(corner)),
            Call::UseToolLengthOffset(ref a, number) => Op::ToolOffset { offset: self.axes(a), number },
            Call::SetToolTableEntry(pocket, tool, ref o, diameter, front, back, orientation) => {
                let k = if self.machine == Units::Inch { 25.4 } else { 1.0 };
                let (offset, diameter) = (Self::scaled(o, k), diameter * k);
                Op::ToolEntry { pocket, tool, offset, diameter, front: front * RAD, back: back * RAD, orientation }
            }
            _ => return None,
        })
    }

    fn switch(call: &Call) -> Option<Op<'static>> {
        Some(match *call {
            Call::StartSpindleClockwise(spindle) => Op::SpindleTurn { spindle, turn: Turn::Cw },
            Call::StartSpindleCounterclockwise(spindle) => Op::SpindleTurn { spindle, turn: Turn::Ccw },
            Call::StopSpindleTurning(spindle) => Op::SpindleTurn { spindle, turn: Turn::Stop },
            Call::OrientSpindle(spindle, angle, direction) => {
                Op::SpindleOrient { spindle, angle: angle * RAD, direction }
            }
            Call::WaitSpindleOrientComplete(spindle, timeout) => Op::SpindleWait { spindle, timeout },
            Call::SelectTool(n) => Op::ToolPrepare(n),
            Call::StartChange => Op::ToolChangeStart,
            Call::ChangeTool(pocket) => Op::ToolChange(pocket),
            Call::ChangeToolNumber(_, tool) => Op::ToolNumber(tool),
            Call::ReloadTooldata => Op::ToolReload,
            Call::MistOn => Op::Mist(true),
            Call::MistOff => Op::Mist(false),
            Call::FloodOn => Op::Flood(true),
            Call::FloodOff => Op::Flood(false),
            Call::EnableFeedOverride => Op::Override(Override::Feed, true),
            Call::DisableFeedOverride => Op::Override(Override::Feed, false),
            Call::EnableSpeedOverride(n) => Op::Override(Override::Speed(n), true),
            Call::DisableSpeedOverride(n) => Op::Override(Override::Speed(n), false),
            Call::EnableAdaptiveFeed => Op::Override(Override::Adaptive, true),
            Call::DisableAdaptiveFeed => Op::Override(Override::Adaptive, false),
            Call::EnableFeedHold => Op::Override(Override::FeedHold, true),
            Call::DisableFeedHold => Op::Override(Override::FeedHold, false),
            Call::SetMotionOutputBit(index) => Op::DigitalOut { index, on: true, synced: true },
            Call::ClearMotionOutputBit(index) => Op::DigitalOut { index, on: false, synced: true },
            Call::SetAuxOutputBit(index) => Op::DigitalOut { index, on: true, synced: false },
            Call::ClearAuxOutputBit(index) => Op::DigitalOut { index, on: false, synced: false },
            Call::SetMotionOutputValue(index, value) => Op::AnalogOut { index, value, synced: true },
            Call::SetAuxOutputValue(index, value) => Op::AnalogOut { index, value, synced: false },
            Call::WaitInput(index, digital, wait, timeout) => Op::InputWait { index, digital, wait, timeout },
            Call::LogClose => Op::LogClose,
            Call::UserM(code, p, q) => Op::UserM { code, p, q },
            Call::ProgramStop => Op::Stop(Stop::Program),
            Call::OptionalProgramStop => Op::Stop(Stop::Optional),
            Call::PalletShuttle => Op::Stop(Stop::Pallet),
            Call::ProgramEnd => Op::End,
            Call::Finish => Op::Finish,
            Call::IndexerLock(axis, on) => Op::IndexerLock(axis, on),
            _ => return None,
        })
    }

    fn note(call: &Call) -> Option<Op<'_>> {
        Some(match call {
            Call::Comment(text) => Op::Note(Note::Comment, text),
            Call::Message(text) => Op::Note(Note::Message, text),
            Call::Log(text) => Op::Note(Note::Log, text),
            Call::LogOpen(text) => Op::Note(Note::LogOpen, text),
            Call::LogAppend(text) => Op::Note(Note::LogAppend, text),
            _ => return None,
        })
    }
}

fn source(at: &At<'_>) -> Source {
    Source { file: at.file, line: at.line, frame: at.frame }
}

impl Sink for Lowering {
    fn call(&mut self, at: &At<'_>, call: &Call) {
        let s = source(at);
        if self.motion(call, s) {
            return;
        }
        match *call {
            Call::SetFeedRate(rate) => return self.feed(rate, s),
            Call::SetSpindleSpeed(spindle, speed) => return self.spindle_speed(spindle, speed, s),
            Call::SetSpindleMode(spindle, limit, held) => {
                self.out.push(Op::SpindleMode { spindle, surface: (limit != 0.0).then_some(limit) }, s);
                if let Some(speed) = held {
                    self.spindle_speed(spindle, speed, s);
                }
                return;
            }
            _ => {}
        }
        if let Some(op) = self.setting(call).or_else(|| Self::switch(call)).or_else(|| Self::note(call)) {
            self.out.push(op, s);
        }
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        self.out.frame(id, frame);
    }
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        let op = match mark {
            Mark::CycleBegin(code) => Op::Begin { marker: Marker::Cycle, code: *code, text: "" },
            Mark::CycleEnd => Op::Close(Marker::Cycle),
            Mark::RuntimeValue(what) => Op::RunTime(what),
            // For lints.
            Mark::LengthInForce | Mark::Meant(..) => return,
        };
        self.out.push(op, source(at));
    }
}
