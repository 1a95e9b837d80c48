//! Commands of the UFMG 2008 language become motion IR: mm, rad, mm/s, any plane in space.

use super::language::{Command, Motion};
use gr_ir::{Arc, ArcPlane, Builder, FeedMode, Op, Plane, Pose, Program, Source, State};
use gr_machine::Machine;
use gr_text::{Diagnostic, FileId, code};

/// Lowers a program that begins at the machine's start pose.
pub fn lower(file: FileId, name: &str, commands: &[Command], machine: &Machine) -> (Program, Vec<Diagnostic>) {
    let mut axes = [0.0; 9];
    axes[..6].copy_from_slice(&machine.start.coordinates());
    let mut out = Builder::from_state(Pose::at(axes), State::default());
    out.file(file, name);
    let mut lower = Lower { out, file, feed: None, begun: false, faults: Vec::new() };
    for command in commands {
        lower.command(command);
    }
    (lower.out.finish(), lower.faults)
}

/// How far the two radii of an arc may differ, mm.
const RADIUS_TOLERANCE: f64 = 0.01;

struct Lower {
    out: Builder,
    file: FileId,
    feed: Option<f64>,
    /// A command was there.
    begun: bool,
    faults: Vec<Diagnostic>,
}

impl Lower {
    fn fault(&mut self, code: gr_text::Code, command: &Command, args: &[String]) {
        self.faults.push(Diagnostic::new(code, self.file, command.span, args));
    }

    fn command(&mut self, c: &Command) {
        let source = Source { file: self.file, line: c.line, ..Source::default() };
        if let Some(f) = c.feed {
            self.feed(f, source);
        }
        let end = self.end(c);
        match c.motion {
            Motion::Joint => self.out.push_to(Op::Rapid, &end, source),
            // What the system writes itself begins so: F0 is no speed, the arm stands there ([`super::JointProgram::gcode`]). It comes there first.
            Motion::Line if c.feed == Some(0.0) && (!self.begun || end == *self.out.pose()) => self.out.push_to(Op::Rapid, &end, source),
            Motion::Line => {
                if self.has_feed(c, "G01") {
                    self.out.push_to(Op::Linear, &end, source);
                }
            }
            Motion::Clockwise => self.arc(c, "G02", &end, -1, source),
            Motion::Counterclockwise => self.arc(c, "G03", &end, 1, source),
        }
        self.begun = true;
    }

    /// F is mm/s; where only the orientation changes it is taken as degrees per second.
    fn feed(&mut self, f: f64, source: Source) {
        if self.feed != Some(f) {
            if self.feed.is_none() {
                self.out.push(Op::FeedMode { spindle: 0, mode: FeedMode::PerTime }, source);
            }
            self.out.push(Op::Feed { linear: f, angular: f.to_radians() }, source);
        }
        self.feed = Some(f);
    }

    fn has_feed(&mut self, c: &Command, word: &str) -> bool {
        let good = self.feed.is_some_and(|f| f > 0.0);
        if !good {
            let why = if self.feed.is_some() { "F must be above 0" } else { "none was programmed before" };
            self.fault(code::FEED_MISSING, c, &[format!("{word} needs F, the feed in mm/s, and {why}")]);
        }
        good
    }

    fn end(&self, c: &Command) -> Pose {
        let mut end = *self.out.pose();
        for (i, value) in c.target.iter().enumerate() {
            if let Some(v) = value {
                end.axes[i] = if i < 3 { *v } else { v.to_radians() };
            }
        }
        end
    }

    fn arc(&mut self, c: &Command, word: &str, end: &Pose, turns: i32, source: Source) {
        if !self.has_feed(c, word) {
            return;
        }
        let start = self.out.pose().xyz();
        let spoke = |p: [f64; 3]| [p[0] - c.center[0], p[1] - c.center[1], p[2] - c.center[2]];
        let (from, to) = (spoke(start), spoke(end.xyz()));
        let (r0, r1) = (length(from), length(to));
        if r0 == 0.0 || (r0 - r1).abs() > RADIUS_TOLERANCE {
            self.fault(code::ARC_RADIUS_MISMATCH, c, &[format!("{r0:.4}"), format!("{r1:.4}")]);
            return;
        }
        match plane(start, end.xyz(), c.center, from, to) {
            Some(plane) => {
                let arc = Arc { plane, center: c.center, turns };
                self.out.push_to(Op::Arc(arc), end, source);
            }
            None => {
                let text = "start, end and centre of this arc lie on one line, and not in a main plane: \
                            its plane is not determined";
                self.fault(code::UFMG_COMMAND, c, &[text.into()]);
            }
        }
    }
}

fn length(v: [f64; 3]) -> f64 {
    libm::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
}

/// The plane of an arc. The thesis takes the normal from start × end and so loses the sense of rotation; here
/// clockwise is seen from the side to which the normal's greatest-ranking component (Z, then Y, then X) points,
/// which for the three main planes is the rule of every control.
fn plane(start: [f64; 3], end: [f64; 3], center: [f64; 3], from: [f64; 3], to: [f64; 3]) -> Option<ArcPlane> {
    for (axis, plane) in [(2, Plane::Xy), (1, Plane::Xz), (0, Plane::Yz)] {
        if start[axis] == end[axis] && start[axis] == center[axis] {
            return Some(ArcPlane::Work(plane));
        }
    }
    let n = [from[1] * to[2] - from[2] * to[1], from[2] * to[0] - from[0] * to[2], from[0] * to[1] - from[1] * to[0]];
    let size = length(n);
    if size <= 1e-9 * length(from) * length(to) {
        return None;
    }
    let n = n.map(|v| v / size);
    let leading = [2, 1, 0].into_iter().map(|i| n[i]).find(|v| v.abs() > 1e-9)?;
    Some(ArcPlane::Free(if leading < 0.0 { n.map(|v| -v) } else { n }))
}
