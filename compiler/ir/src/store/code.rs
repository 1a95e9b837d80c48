//! How each operation lies in the columns. Writer and reader stand side by side here: what `encode`
//! pushes, `decode` takes, in the same order.

use super::{Builder, Cursor};
use crate::{ArcPlane, FeedMode, Marker, Note, Op, Override, PathMode, Plane, Stop, Sync, Turn, Units};

pub(super) const LINEAR: u8 = 1;
/// Kinds up to here carry an end pose.
pub(super) const LAST_MOVE: u8 = 5;

pub(super) fn kind(op: &Op<'_>) -> u8 {
    match op {
        Op::Rapid => 0,
        Op::Linear => LINEAR,
        Op::Arc(arc) => match arc.plane {
            ArcPlane::Work(_) => 2,
            ArcPlane::Free(_) => 3,
        },
        Op::Nurbs { .. } => 4,
        Op::Probe(_) => LAST_MOVE,
        Op::RigidTap { .. } => 6,
        Op::Dwell(_) => 7,
        Op::SyncStart(_) => 8,
        Op::SyncStop => 9,
        Op::ProbeMode(_) => 10,
        Op::Units(_) => 11,
        Op::Plane(_) => 12,
        Op::FeedMode { .. } => 13,
        Op::Feed { .. } => 14,
        Op::FeedReferenceXyz => 15,
        Op::PathMode(_) => 16,
        Op::MergeTolerance(_) => 17,
        Op::Planner(_) => 50,
        Op::SpindleMode { .. } => 18,
        Op::SpindleSpeed { .. } => 19,
        Op::SpindleTurn { .. } => 20,
        Op::SpindleOrient { .. } => 21,
        Op::SpindleWait { .. } => 22,
        Op::Mist(_) => 23,
        Op::Flood(_) => 24,
        Op::ToolPrepare(_) => 25,
        Op::ToolChangeStart => 26,
        Op::ToolChange(_) => 27,
        Op::ToolNumber(_) => 28,
        Op::ToolReload => 29,
        Op::ToolEntry { .. } => 30,
        Op::ToolOffset { .. } => 31,
        Op::WorkOffset(..) => 32,
        Op::StoredOffset { .. } => 51,
        Op::LocalOffset(_) => 33,
        Op::Rotation(_) => 34,
        Op::Override(..) => 35,
        Op::DigitalOut { .. } => 36,
        Op::AnalogOut { .. } => 37,
        Op::InputWait { .. } => 38,
        Op::RunTime(_) => 39,
        Op::Note(..) => 40,
        Op::LogClose => 41,
        Op::UserM { .. } => 42,
        Op::Stop(_) => 43,
        Op::Finish => 44,
        Op::Reset => 45,
        Op::IndexerLock(..) => 46,
        Op::End => 47,
        Op::Begin { .. } => 48,
        Op::Close(_) => 49,
    }
}

pub(super) fn plane(n: i32) -> Plane {
    match n {
        2 => Plane::Yz,
        3 => Plane::Xz,
        4 => Plane::Uv,
        5 => Plane::Vw,
        6 => Plane::Uw,
        _ => Plane::Xy,
    }
}

fn turn(n: i32) -> Turn {
    match n {
        1 => Turn::Cw,
        -1 => Turn::Ccw,
        _ => Turn::Stop,
    }
}

fn marker(n: i32) -> Marker {
    match n {
        0 => Marker::Tool,
        1 => Marker::Cycle,
        2 => Marker::Workingstep,
        3 => Marker::Feature,
        4 => Marker::Tolerance,
        _ => Marker::Contour,
    }
}

impl Builder {
    pub(super) fn encode(&mut self, op: &Op<'_>) {
        match *op {
            Op::Arc(arc) => {
                self.int(arc.turns);
                match arc.plane {
                    ArcPlane::Work(plane) => {
                        self.int(plane as i32);
                        let (first, second, _) = crate::state::plane_axes(plane);
                        self.values(&[arc.center[first], arc.center[second]]);
                    }
                    ArcPlane::Free(normal) => {
                        self.values(&arc.center);
                        self.values(&normal);
                    }
                }
            }
            Op::Nurbs { order, points } => {
                self.int(i32::try_from(order).unwrap_or(i32::MAX));
                // A control point is three values; a rest is dropped.
                let count = points.len() / 3;
                self.int(i32::try_from(count).unwrap_or(0));
                self.values(&points[..count * 3]);
            }
            Op::Probe(n) => self.int(i32::from(n)),
            Op::RigidTap { bottom, scale } => {
                self.values(&bottom);
                self.values(&[scale]);
            }
            Op::SyncStart(s) => {
                self.int(s.spindle);
                self.int(i32::from(s.velocity));
                self.values(&[s.per_rev]);
            }
            Op::FeedMode { spindle, mode } => {
                self.int(spindle);
                self.int(mode as i32);
            }
            Op::Feed { linear, angular } => self.values(&[linear, angular]),
            Op::PathMode(mode) => {
                self.int(match mode {
                    PathMode::ExactStop => 0,
                    PathMode::ExactPath => 1,
                    PathMode::Blend(_) => 2,
                });
                if let PathMode::Blend(t) = mode {
                    self.values(&[t]);
                }
            }
            _ => self.encode_auxiliary(op),
        }
    }

    fn encode_auxiliary(&mut self, op: &Op<'_>) {
        match *op {
            Op::Dwell(v) | Op::MergeTolerance(v) | Op::Rotation(v) => self.values(&[v]),
            Op::Planner(corner) => {
                self.int(i32::from(corner.is_some()));
                self.program.values.extend(corner);
            }
            Op::ProbeMode(on) | Op::Mist(on) | Op::Flood(on) => self.int(i32::from(on)),
            Op::Units(units) => self.int(units as i32),
            Op::Plane(plane) => self.int(plane as i32),
            Op::SpindleMode { spindle, surface } => {
                self.int(spindle);
                self.int(i32::from(surface.is_some()));
                self.program.values.extend(surface);
            }
            Op::SpindleSpeed { spindle, speed: v } | Op::SpindleWait { spindle, timeout: v } => {
                self.int(spindle);
                self.values(&[v]);
            }
            Op::SpindleTurn { spindle, turn } => {
                self.int(spindle);
                self.int(turn as i32);
            }
            Op::SpindleOrient { spindle, angle, direction } => {
                self.int(spindle);
                self.int(direction);
                self.values(&[angle]);
            }
            Op::ToolPrepare(n) | Op::ToolChange(n) | Op::ToolNumber(n) => self.int(n),
            Op::ToolEntry { pocket, tool, offset, diameter, front, back, orientation } => {
                self.int(pocket);
                self.int(tool);
                self.int(orientation);
                self.values(&offset);
                self.values(&[diameter, front, back]);
            }
            Op::ToolOffset { offset, number } => {
                self.int(number.map_or(-1, |n| i32::try_from(n).unwrap_or(i32::MAX)));
                self.values(&offset);
            }
            Op::LocalOffset(axes) => self.values(&axes),
            Op::WorkOffset(n, axes) => {
                self.int(i32::from(n));
                self.values(&axes);
            }
            Op::StoredOffset { number, offset, rotation } => {
                self.int(i32::from(number));
                self.values(&offset);
                self.values(&[rotation]);
            }
            _ => self.encode_rest(op),
        }
    }

    fn encode_rest(&mut self, op: &Op<'_>) {
        match *op {
            Op::Override(which, on) => {
                self.int(match which {
                    Override::Feed => -3,
                    Override::Adaptive => -2,
                    Override::FeedHold => -1,
                    Override::Speed(n) => n.max(0),
                });
                self.int(i32::from(on));
            }
            Op::DigitalOut { index, on, synced } => {
                self.int(index);
                self.int(i32::from(on) | i32::from(synced) << 1);
            }
            Op::AnalogOut { index, value, synced } => {
                self.int(index);
                self.int(i32::from(synced));
                self.values(&[value]);
            }
            Op::InputWait { index, digital, wait, timeout } => {
                self.int(index);
                self.int(i32::from(digital));
                self.int(wait);
                self.values(&[timeout]);
            }
            Op::RunTime(text) => self.str(text),
            Op::Note(note, text) => {
                self.int(note as i32);
                self.str(text);
            }
            Op::UserM { code, p, q } => {
                self.int(code);
                self.values(&[p, q]);
            }
            Op::Stop(stop) => self.int(stop as i32),
            Op::IndexerLock(axis, on) => {
                self.int(i32::from(axis));
                self.int(i32::from(on));
            }
            Op::Begin { marker, code, text } => {
                self.int(marker as i32);
                self.int(code);
                self.str(text);
            }
            Op::Close(marker) => self.int(marker as i32),
            _ => {}
        }
    }
}

impl<'p> Cursor<'p> {
    pub(super) fn decode(&mut self, kind: u8) -> Option<Op<'p>> {
        Some(match kind {
            0 => Op::Rapid,
            1 => Op::Linear,
            2 | 3 => Op::Arc(self.arc(kind == 3)?),
            4 => {
                let order = u32::try_from(self.int()?).ok()?;
                let count = usize::try_from(self.int()?).ok()?;
                Op::Nurbs { order, points: self.slice(count.checked_mul(3)?)? }
            }
            5 => Op::Probe(u8::try_from(self.int()?).ok()?),
            6 => Op::RigidTap { bottom: self.three()?, scale: self.value()? },
            7 => Op::Dwell(self.value()?),
            8 => {
                let (spindle, velocity) = (self.int()?, self.flag()?);
                Op::SyncStart(Sync { spindle, per_rev: self.value()?, velocity })
            }
            9 => Op::SyncStop,
            10 => Op::ProbeMode(self.flag()?),
            11 => Op::Units(if self.int()? == 1 { Units::Inch } else { Units::Mm }),
            12 => Op::Plane(plane(self.int()?)),
            13 => Op::FeedMode { spindle: self.int()?, mode: self.feed_mode()? },
            14 => Op::Feed { linear: self.value()?, angular: self.value()? },
            15 => Op::FeedReferenceXyz,
            16 => Op::PathMode(match self.int()? {
                0 => PathMode::ExactStop,
                1 => PathMode::ExactPath,
                _ => PathMode::Blend(self.value()?),
            }),
            17 => Op::MergeTolerance(self.value()?),
            _ => return self.decode_auxiliary(kind),
        })
    }

    fn decode_auxiliary(&mut self, kind: u8) -> Option<Op<'p>> {
        Some(match kind {
            18 => {
                let (spindle, limited) = (self.int()?, self.flag()?);
                Op::SpindleMode { spindle, surface: if limited { Some(self.value()?) } else { None } }
            }
            19 => Op::SpindleSpeed { spindle: self.int()?, speed: self.value()? },
            20 => Op::SpindleTurn { spindle: self.int()?, turn: turn(self.int()?) },
            21 => {
                let (spindle, direction) = (self.int()?, self.int()?);
                Op::SpindleOrient { spindle, angle: self.value()?, direction }
            }
            22 => Op::SpindleWait { spindle: self.int()?, timeout: self.value()? },
            23 => Op::Mist(self.flag()?),
            24 => Op::Flood(self.flag()?),
            25 => Op::ToolPrepare(self.int()?),
            26 => Op::ToolChangeStart,
            27 => Op::ToolChange(self.int()?),
            28 => Op::ToolNumber(self.int()?),
            29 => Op::ToolReload,
            30 => {
                let (pocket, tool, orientation) = (self.int()?, self.int()?, self.int()?);
                let offset = self.nine()?;
                let [diameter, front, back] = self.three()?;
                Op::ToolEntry { pocket, tool, offset, diameter, front, back, orientation }
            }
            31 => {
                let number = u32::try_from(self.int()?).ok();
                Op::ToolOffset { offset: self.nine()?, number }
            }
            32 => Op::WorkOffset(u8::try_from(self.int()?).ok()?, self.nine()?),
            51 => Op::StoredOffset { number: u8::try_from(self.int()?).ok()?, offset: self.nine()?, rotation: self.value()? },
            33 => Op::LocalOffset(self.nine()?),
            34 => Op::Rotation(self.value()?),
            _ => return self.decode_rest(kind),
        })
    }

    fn decode_rest(&mut self, kind: u8) -> Option<Op<'p>> {
        Some(match kind {
            35 => {
                let which = match self.int()? {
                    -3 => Override::Feed,
                    -2 => Override::Adaptive,
                    -1 => Override::FeedHold,
                    n => Override::Speed(n),
                };
                Op::Override(which, self.flag()?)
            }
            36 => {
                let (index, bits) = (self.int()?, self.int()?);
                Op::DigitalOut { index, on: bits & 1 != 0, synced: bits & 2 != 0 }
            }
            37 => {
                let (index, synced) = (self.int()?, self.flag()?);
                Op::AnalogOut { index, value: self.value()?, synced }
            }
            38 => {
                let (index, digital, wait) = (self.int()?, self.flag()?, self.int()?);
                Op::InputWait { index, digital, wait, timeout: self.value()? }
            }
            39 => Op::RunTime(self.str()?),
            40 => Op::Note(self.note()?, self.str()?),
            41 => Op::LogClose,
            42 => Op::UserM { code: self.int()?, p: self.value()?, q: self.value()? },
            43 => Op::Stop(match self.int()? {
                0 => Stop::Program,
                1 => Stop::Optional,
                _ => Stop::Pallet,
            }),
            44 => Op::Finish,
            45 => Op::Reset,
            46 => Op::IndexerLock(u8::try_from(self.int()?).ok()?, self.flag()?),
            47 => Op::End,
            48 => {
                let (kind, code) = (self.int()?, self.int()?);
                Op::Begin { marker: marker(kind), code, text: self.str()? }
            }
            49 => Op::Close(marker(self.int()?)),
            50 => Op::Planner(if self.flag()? { Some(self.value()?) } else { None }),
            _ => return None,
        })
    }

    fn flag(&mut self) -> Option<bool> {
        self.int().map(|n| n != 0)
    }
    fn feed_mode(&mut self) -> Option<FeedMode> {
        Some(match self.int()? {
            0 => FeedMode::PerTime,
            1 => FeedMode::PerRev,
            _ => FeedMode::Inverse,
        })
    }
    fn note(&mut self) -> Option<Note> {
        Some(match self.int()? {
            0 => Note::Comment,
            1 => Note::Message,
            2 => Note::Log,
            3 => Note::LogOpen,
            _ => Note::LogAppend,
        })
    }
}
