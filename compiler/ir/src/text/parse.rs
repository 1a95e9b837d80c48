use super::{AXIS_NAMES, HEADER, print};
use crate::op::{Arc, ArcPlane, Pose, Source};
use crate::{
    Axes, Builder, FeedMode, FileId, FrameId, Marker, Note, Op, Override, PathMode, Plane, Program, State, Stop, Sync,
    Turn, Units,
};

/// What is wrong with a text, and in which line (from 1).
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ParseError {
    /// Line, from 1.
    pub line: usize,
    /// In plain words.
    pub message: String,
}

impl std::fmt::Display for ParseError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}: {}", self.line, self.message)
    }
}

impl std::error::Error for ParseError {}

type Res<T> = Result<T, String>;

/// Reads the text form. Empty lines and lines that begin with `;` are skipped.
pub fn parse(text: &str) -> Result<Program, ParseError> {
    let mut lines = text.lines().enumerate().filter(|(_, l)| {
        let l = l.trim();
        !l.is_empty() && !l.starts_with(';')
    });
    match lines.next() {
        Some((_, first)) if first.trim() == HEADER => {}
        other => {
            let line = other.map_or(1, |(n, _)| n + 1);
            return Err(ParseError { line, message: format!("the text begins with `{HEADER}`") });
        }
    }
    let mut builder = Builder::new();
    for (number, line) in lines {
        read_line(&mut builder, line).map_err(|message| ParseError { line: number + 1, message })?;
    }
    Ok(builder.finish())
}

fn read_line(builder: &mut Builder, line: &str) -> Res<()> {
    let mut fields = Fields::split(line)?;
    match fields.head {
        "file" => {
            let id = FileId(fields.int()?);
            builder.file(id, &fields.text()?);
        }
        "frame" => read_frame(builder, &mut fields)?,
        "start" => {
            if !builder.is_empty() {
                return Err("`start` comes before the first operation".into());
            }
            let pose = fields.pose(&Pose::default())?;
            builder.restart(pose, State::default());
        }
        _ => read_op(builder, &mut fields)?,
    }
    fields.finish()
}

fn read_frame(builder: &mut Builder, fields: &mut Fields<'_>) -> Res<()> {
    let id = FrameId(fields.int()?);
    let parent = FrameId(fields.int_field("parent")?);
    let (file, line) = place(fields.need("at")?)?;
    let pass = fields.int_field("pass")?;
    let name = fields.text()?.into();
    builder.frame(id, &gr_canon::CallFrame { parent, file, line, name, pass });
    Ok(())
}

fn place(text: &str) -> Res<(FileId, u32)> {
    let (file, line) = text.split_once(':').ok_or("a place is file:line")?;
    let line: u64 = number(line)?;
    let line = line.checked_sub(1).and_then(|l| u32::try_from(l).ok()).ok_or("lines count from 1")?;
    Ok((FileId(number(file)?), line))
}

fn read_op(builder: &mut Builder, f: &mut Fields<'_>) -> Res<()> {
    let source = f.source()?;
    let start = *builder.pose();
    let points;
    let text;
    let op = match f.head {
        "rapid" => Op::Rapid,
        "linear" => Op::Linear,
        "arc" => Op::Arc(f.arc(&start)?),
        "nurbs" => {
            let order = f.int_field("order")?;
            points = f.list("points")?;
            if points.len() % 3 != 0 {
                return Err("points are triples: x, y, weight".into());
            }
            Op::Nurbs { order, points: &points }
        }
        "probe" => Op::Probe(f.int_field("kind")?),
        "comment" | "message" | "log" | "log-open" | "log-append" => {
            let note = note(f.head)?;
            text = f.text()?;
            Op::Note(note, &text)
        }
        "run-time" => {
            text = f.text()?;
            Op::RunTime(&text)
        }
        "begin" => {
            let marker = marker(f.bare()?)?;
            let code = f.int_field("code")?;
            text = f.text()?;
            Op::Begin { marker, code, text: &text }
        }
        _ => plain_op(f)?,
    };
    let end = if op.moves() { f.pose(&start)? } else { start };
    builder.push_to(op, &end, source);
    Ok(())
}

fn plain_op(f: &mut Fields<'_>) -> Res<Op<'static>> {
    Ok(match f.head {
        "rigid-tap" => Op::RigidTap { bottom: f.array("bottom")?, scale: f.num("scale")? },
        "dwell" => Op::Dwell(f.number()?),
        "sync-start" => Op::SyncStart(Sync {
            spindle: f.int_field("spindle")?,
            per_rev: f.num("per-rev")?,
            velocity: f.flag("velocity"),
        }),
        "sync-stop" => Op::SyncStop,
        "probe-mode" => Op::ProbeMode(f.on_off()?),
        "units" => Op::Units(f.choice(&[("inch", Units::Inch), ("mm", Units::Mm)])?),
        "plane" => Op::Plane(plane(f.bare()?)?),
        "feed-mode" => {
            let mode = f.choice(&[
                ("per-time", FeedMode::PerTime),
                ("per-rev", FeedMode::PerRev),
                ("inverse", FeedMode::Inverse),
            ])?;
            Op::FeedMode { spindle: f.int_field("spindle")?, mode }
        }
        "feed" => Op::Feed { linear: f.number()?, angular: f.num("angular")? },
        "feed-reference" => f.choice(&[("xyz", Op::FeedReferenceXyz)])?,
        "path" => match f.bare()? {
            "exact-stop" => Op::PathMode(PathMode::ExactStop),
            "exact-path" => Op::PathMode(PathMode::ExactPath),
            "blend" => Op::PathMode(PathMode::Blend(f.num("tolerance")?)),
            other => return Err(format!("unknown path mode `{other}`")),
        },
        "merge-tolerance" => Op::MergeTolerance(f.number()?),
        "planner" => {
            let smooth = f.choice(&[("trapezoidal", false), ("smooth", true)])?;
            Op::Planner(if smooth { Some(f.num("corner")?) } else { None })
        }
        "mist" => Op::Mist(f.on_off()?),
        "flood" => Op::Flood(f.on_off()?),
        "rotation" => Op::Rotation(f.number()?),
        "log-close" => Op::LogClose,
        "finish" => Op::Finish,
        "reset" => Op::Reset,
        "end" => Op::End,
        "close" => Op::Close(marker(f.bare()?)?),
        "stop" => {
            Op::Stop(f.choice(&[("program", Stop::Program), ("optional", Stop::Optional), ("pallet", Stop::Pallet)])?)
        }
        head if head.starts_with("spindle-") => spindle_op(f)?,
        head if head.starts_with("tool-") => tool_op(f)?,
        _ => rest_op(f)?,
    })
}

fn spindle_op(f: &mut Fields<'_>) -> Res<Op<'static>> {
    let spindle = f.int()?;
    Ok(match f.head {
        "spindle-mode" => {
            let surface = f.choice(&[("rpm", false), ("surface", true)])?;
            Op::SpindleMode { spindle, surface: if surface { Some(f.num("limit")?) } else { None } }
        }
        "spindle-speed" => Op::SpindleSpeed { spindle, speed: f.num("speed")? },
        "spindle-turn" => {
            let turn = f.choice(&[("cw", Turn::Cw), ("ccw", Turn::Ccw), ("stop", Turn::Stop)])?;
            Op::SpindleTurn { spindle, turn }
        }
        "spindle-orient" => Op::SpindleOrient { spindle, angle: f.num("angle")?, direction: f.int_field("direction")? },
        "spindle-wait" => Op::SpindleWait { spindle, timeout: f.num("timeout")? },
        other => return Err(format!("unknown operation `{other}`")),
    })
}

fn tool_op(f: &mut Fields<'_>) -> Res<Op<'static>> {
    Ok(match f.head {
        "tool-prepare" => Op::ToolPrepare(f.int()?),
        "tool-change-start" => Op::ToolChangeStart,
        "tool-change" => Op::ToolChange(f.int_field("pocket")?),
        "tool-number" => Op::ToolNumber(f.int()?),
        "tool-reload" => Op::ToolReload,
        "tool-entry" => Op::ToolEntry {
            tool: f.int()?,
            pocket: f.int_field("pocket")?,
            diameter: f.num("diameter")?,
            front: f.num("front")?,
            back: f.num("back")?,
            orientation: f.int_field("orientation")?,
            offset: f.axes([0.0; 9])?,
        },
        "tool-offset" => Op::ToolOffset { number: f.take("number").map(number).transpose()?, offset: f.axes([0.0; 9])? },
        other => return Err(format!("unknown operation `{other}`")),
    })
}

fn rest_op(f: &mut Fields<'_>) -> Res<Op<'static>> {
    Ok(match f.head {
        "work-offset" => Op::WorkOffset(f.int()?, f.axes([0.0; 9])?),
        "store-offset" => Op::StoredOffset { number: f.int()?, rotation: f.num("rotation")?, offset: f.axes([0.0; 9])? },
        "local-offset" => Op::LocalOffset(f.axes([0.0; 9])?),
        "override" => {
            let which = match f.bare()? {
                "feed" => Override::Feed,
                "adaptive" => Override::Adaptive,
                "feed-hold" => Override::FeedHold,
                "speed" => Override::Speed(f.int_field("spindle")?),
                other => return Err(format!("unknown switch `{other}`")),
            };
            Op::Override(which, f.on_off()?)
        }
        "digital-out" => Op::DigitalOut { index: f.int()?, on: f.on_off()?, synced: f.flag("synced") },
        "analog-out" => Op::AnalogOut { index: f.int()?, value: f.num("value")?, synced: f.flag("synced") },
        "input-wait" => Op::InputWait {
            index: f.int()?,
            digital: f.choice(&[("digital", true), ("analog", false)])?,
            wait: f.int_field("wait")?,
            timeout: f.num("timeout")?,
        },
        "user-m" => Op::UserM { code: f.int()?, p: f.num("p")?, q: f.num("q")? },
        "indexer" => Op::IndexerLock(f.int()?, f.choice(&[("lock", true), ("unlock", false)])?),
        other => return Err(format!("unknown operation `{other}`")),
    })
}

fn plane(name: &str) -> Res<Plane> {
    [Plane::Xy, Plane::Yz, Plane::Xz, Plane::Uv, Plane::Vw, Plane::Uw]
        .into_iter()
        .find(|p| print::plane_name(*p) == name)
        .ok_or_else(|| format!("unknown plane `{name}`"))
}

fn marker(name: &str) -> Res<Marker> {
    [Marker::Tool, Marker::Cycle, Marker::Workingstep, Marker::Feature, Marker::Tolerance, Marker::Contour]
        .into_iter()
        .find(|m| print::marker_name(*m) == name)
        .ok_or_else(|| format!("unknown marker `{name}`"))
}

fn note(name: &str) -> Res<Note> {
    [Note::Comment, Note::Message, Note::Log, Note::LogOpen, Note::LogAppend]
        .into_iter()
        .find(|n| print::note_name(*n) == name)
        .ok_or_else(|| format!("unknown note `{name}`"))
}

fn number<T: std::str::FromStr>(text: &str) -> Res<T> {
    text.parse().map_err(|_| format!("`{text}` is not a number that fits here"))
}

/// One line taken apart: the head, bare words and numbers, `key=value` fields, at most one quoted text.
struct Fields<'a> {
    head: &'a str,
    bare: std::collections::VecDeque<&'a str>,
    keyed: Vec<(&'a str, &'a str)>,
    text: Option<String>,
    source: Option<&'a str>,
}

impl<'a> Fields<'a> {
    fn split(line: &'a str) -> Res<Fields<'a>> {
        let line = line.trim();
        let (head, mut rest) = line.split_once(' ').unwrap_or((line, ""));
        let (bare, keyed) = (std::collections::VecDeque::new(), Vec::new());
        let mut fields = Fields { head, bare, keyed, text: None, source: None };
        loop {
            rest = rest.trim_start();
            if let Some(quoted) = rest.strip_prefix('"') {
                rest = fields.quoted(quoted)?;
                continue;
            }
            let end = rest.find(' ').unwrap_or(rest.len());
            let (word, after) = rest.split_at(end);
            match (word.strip_prefix('@'), word.split_once('=')) {
                _ if word.is_empty() => return Ok(fields),
                (Some(source), _) => fields.source = Some(source),
                (_, Some(pair)) => fields.keyed.push(pair),
                _ => fields.bare.push_back(word),
            }
            rest = after;
        }
    }

    fn quoted(&mut self, rest: &'a str) -> Res<&'a str> {
        let mut text = String::new();
        let mut chars = rest.char_indices();
        while let Some((at, c)) = chars.next() {
            match c {
                '"' => {
                    if self.text.replace(text).is_some() {
                        return Err("one text per line".into());
                    }
                    return Ok(&rest[at + 1..]);
                }
                '\\' => text.push(escape(&mut chars)?),
                c => text.push(c),
            }
        }
        Err("the text has no closing quote".into())
    }

    fn finish(self) -> Res<()> {
        if let Some(word) = self.bare.front() {
            return Err(format!("`{}` has no `{word}`", self.head));
        }
        if let Some((key, _)) = self.keyed.first() {
            return Err(format!("`{}` has no field `{key}`", self.head));
        }
        if self.text.is_some() {
            return Err(format!("`{}` has no text", self.head));
        }
        match self.source {
            Some(_) if matches!(self.head, "file" | "frame" | "start") => Err(format!("`{}` has no place", self.head)),
            _ => Ok(()),
        }
    }

    fn bare(&mut self) -> Res<&'a str> {
        self.bare.pop_front().ok_or_else(|| format!("`{}` is incomplete", self.head))
    }
    fn int<T: std::str::FromStr>(&mut self) -> Res<T> {
        number(self.bare()?)
    }
    fn number(&mut self) -> Res<f64> {
        number(self.bare()?)
    }
    fn choice<T: Copy>(&mut self, of: &[(&str, T)]) -> Res<T> {
        let word = self.bare()?;
        of.iter().find(|(name, _)| *name == word).map(|(_, v)| *v).ok_or_else(|| {
            let names: Vec<&str> = of.iter().map(|(n, _)| *n).collect();
            format!("`{word}` stands where one of {} belongs", names.join(", "))
        })
    }
    fn on_off(&mut self) -> Res<bool> {
        self.choice(&[("on", true), ("off", false)])
    }
    fn flag(&mut self, word: &str) -> bool {
        let found = self.bare.front() == Some(&word);
        if found {
            self.bare.pop_front();
        }
        found
    }
    fn text(&mut self) -> Res<String> {
        self.text.take().ok_or_else(|| format!("`{}` needs a text in quotes", self.head))
    }
    fn take(&mut self, key: &str) -> Option<&'a str> {
        let at = self.keyed.iter().position(|(k, _)| *k == key)?;
        Some(self.keyed.remove(at).1)
    }
    fn need(&mut self, key: &str) -> Res<&'a str> {
        self.take(key).ok_or_else(|| format!("`{}` needs `{key}=`", self.head))
    }
    fn int_field<T: std::str::FromStr>(&mut self, key: &str) -> Res<T> {
        number(self.need(key)?)
    }
    fn num(&mut self, key: &str) -> Res<f64> {
        number(self.need(key)?)
    }
    fn list(&mut self, key: &str) -> Res<Vec<f64>> {
        match self.need(key)? {
            "" => Ok(Vec::new()),
            list => list.split(',').map(number).collect(),
        }
    }
    fn array<const N: usize>(&mut self, key: &str) -> Res<[f64; N]> {
        <[f64; N]>::try_from(self.list(key)?).map_err(|_| format!("`{key}` has {N} numbers"))
    }
    fn axes(&mut self, mut axes: Axes) -> Res<Axes> {
        for (name, value) in AXIS_NAMES.iter().zip(&mut axes) {
            if let Some(text) = self.take(name) {
                *value = number(text)?;
            }
        }
        Ok(axes)
    }
    fn pose(&mut self, from: &Pose) -> Res<Pose> {
        let mut pose = *from;
        pose.axes = self.axes(from.axes)?;
        if self.keyed.iter().any(|(k, v)| *k == "axis" && *v != "none") {
            pose.tool_axis = Some(self.array("axis")?);
        } else if self.take("axis").is_some() {
            pose.tool_axis = None;
        }
        match self.take("spin") {
            Some("none") => pose.spin = None,
            Some(spin) => pose.spin = Some(number(spin)?),
            None => {}
        }
        Ok(pose)
    }
    fn arc(&mut self, start: &Pose) -> Res<Arc> {
        let name = self.bare()?;
        let turns = self.int_field("turns")?;
        if name == "free" {
            let center = self.array("center")?;
            return Ok(Arc { plane: ArcPlane::Free(self.array("normal")?), center, turns });
        }
        let plane = plane(name)?;
        let [first, second] = self.array("center")?;
        let axes = crate::state::plane_axes(plane);
        let mut center = start.xyz();
        (center[axes.0], center[axes.1]) = (first, second);
        Ok(Arc { plane: ArcPlane::Work(plane), center, turns })
    }
    fn source(&mut self) -> Res<Source> {
        let Some(text) = self.source else {
            return Ok(Source::default());
        };
        let (at, frame) = text.split_once('/').unwrap_or((text, "0"));
        let (file, line) = place(at)?;
        Ok(Source { file, line, frame: FrameId(number(frame)?) })
    }
}

fn escape(chars: &mut std::str::CharIndices<'_>) -> Res<char> {
    match chars.next().map(|(_, c)| c) {
        Some(c @ ('"' | '\\')) => Ok(c),
        Some('u') => {
            let digits: String = chars.map(|(_, c)| c).skip_while(|c| *c == '{').take_while(|c| *c != '}').collect();
            let code = u32::from_str_radix(&digits, 16).map_err(|_| "\\u{…} holds a hex number")?;
            char::from_u32(code).ok_or_else(|| "\\u{…} is no character".into())
        }
        _ => Err("unknown escape in a text".into()),
    }
}
