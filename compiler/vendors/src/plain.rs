//! Languages of one file, one statement per line, that differ in their words more than in their build: what they share
//! of a walk, and of making the file.

use crate::name::Names;
use crate::number::num;
use crate::parts::Lines;
use crate::walk::{Body, Cx, Op, Traits, Value, any_error, walk};
use crate::{Options, Output, OutputFile};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

/// The words of such a language.
pub(crate) trait Plain {
    /// Waits for the operator.
    const PAUSE: &'static str;
    /// Words of the language, in capitals, that no routine can be called by.
    const RESERVED: &'static [&'static str] = &[];

    /// Where lines go.
    fn out(&mut self) -> &mut Lines;
    /// A joint move, at a share of the greatest joint speed.
    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64);
    /// A straight move.
    fn linear(&mut self, cx: &mut Cx, to: &Target, speed: f64, zone: Option<f64>);
    /// An arc through a point.
    fn arc(&mut self, cx: &mut Cx, via: &Target, to: &Target, speed: f64, zone: Option<f64>);
    /// The tool point changes.
    fn tool(&mut self, cx: &mut Cx, number: usize, frame: &Frame);
    /// The work frame changes.
    fn frame(&mut self, cx: &mut Cx, number: usize, frame: &Frame);
    /// A digital output is set.
    fn digital(number: u32, on: bool) -> String;
    /// An analog output is set; none = the language has none.
    fn analog(_number: u32, _value: f64) -> Option<String> {
        None
    }
    /// A routine is called, with a number for it.
    fn call(name: &str, value: Option<String>) -> String;
    /// An input is waited for.
    fn waits(number: u32, on: bool) -> String;
    /// The same for at most so long, s; the lines, none = the language can't.
    fn waits_at_most(_number: u32, _on: bool, _seconds: f64) -> Option<Vec<String>> {
        None
    }
    /// Waits, s.
    fn dwell(seconds: f64) -> String;
    /// Shown to the operator; none = it can only be a remark. The text has no character but ASCII.
    fn message(_text: &str) -> Option<String> {
        None
    }
}

impl<W: Plain> Body for W {
    fn op(&mut self, cx: &mut Cx, op: Op) {
        self.out().points(cx, op.points());
        match op {
            Op::Line(number, text) => self.out().remark(cx, &format!("{number}: {text}")),
            Op::Comment(text) => self.out().remark(cx, text),
            Op::Home(t) => self.joint(cx, t, 0.2),
            Op::Joint { to, share, .. } => self.joint(cx, to, share),
            Op::Linear { to, speed, zone } => self.linear(cx, to, speed, zone),
            Op::Arc { via, to, speed, zone } => self.arc(cx, via, to, speed, zone),
            Op::Probe { .. } => cx.no_probe(),
            Op::Tool(i) => {
                let frame = cx.program.tools[i].frame;
                self.tool(cx, i, &frame);
            }
            Op::Frame(i) => {
                let frame = cx.frame_in_control(i);
                self.frame(cx, i, &frame);
            }
            Op::Set { name, value, word } => set(self, cx, name, value, word),
            Op::Call { name, value } => {
                let name = cx.routine(name, W::RESERVED).to_string();
                self.out().line(cx, &W::call(&name, value.map(|v| num(v, 6))));
            }
            Op::Wait { name, on, timeout } => wait(self, cx, name, on, timeout),
            Op::Dwell(s) => self.out().line(cx, &W::dwell(s)),
            Op::Message(text) => {
                let shown = W::message("").is_some().then(|| cx.ascii(text)).and_then(|t| W::message(&t));
                match shown {
                    Some(line) => self.out().line(cx, &line),
                    None => self.out().remark(cx, text),
                }
            }
            Op::Pause => self.out().line(cx, W::PAUSE),
            Op::End => {}
        }
    }
}

fn set<W: Plain>(w: &mut W, cx: &mut Cx, name: &str, value: Value, word: &str) {
    let n = cx.number(name, word);
    let numbers = W::analog(n, 0.0).is_some();
    let line = match value {
        Value::Digital(on) => Some(W::digital(n, on)),
        Value::Analog(v) => W::analog(n, v),
        Value::Group(_) => None,
    };
    match line {
        Some(line) => w.out().line(cx, &line),
        None => cx.cannot(if numbers { "a tool number on outputs" } else { "a number on outputs" }),
    }
}

fn wait<W: Plain>(w: &mut W, cx: &mut Cx, name: &str, on: bool, timeout: Option<f64>) {
    let n = cx.number(name, "wait");
    if let Some(lines) = timeout.and_then(|t| W::waits_at_most(n, on, t)) {
        lines.iter().for_each(|line| w.out().line(cx, line));
        return;
    }
    if timeout.is_some() {
        cx.cannot("waiting for an input with a time limit");
    }
    w.out().line(cx, &W::waits(n, on));
}

/// Writes a program: one file of this name, whose text is made of the writer when nothing was wrong.
pub(crate) fn one_file<W: Plain>(
    (program, sources, options): (&RobotProgram, &dyn Sources, &Options),
    traits: &'static Traits,
    names: &Names,
    mut writer: W,
    file: String,
    text: impl FnOnce(W) -> String,
) -> Output {
    let mut out = walk(program, sources, options, traits, &mut writer);
    if !any_error(&out.findings) {
        names.tell(&mut out, traits.title);
        out.files = vec![OutputFile::new(file, text(writer))];
    }
    out
}

/// Six numbers of a place: position with so many decimals, angles in degrees with five.
pub(crate) fn six(position: [f64; 3], decimals: usize, angles: [f64; 3]) -> String {
    let (p, a) = (position.map(|v| num(v, decimals)), angles.map(|v| num(v.to_degrees(), 5)));
    format!("{},{},{},{},{},{}", p[0], p[1], p[2], a[0], a[1], a[2])
}

/// Joint values as the controller counts them, with five decimals and commas between.
pub(crate) fn joints(values: &[f64]) -> String {
    values.iter().map(|v| num(*v, 5)).collect::<Vec<_>>().join(",")
}

/// A corner distance, mm, never more than was asked for: thousandths.
pub(crate) fn corner(zone: f64) -> f64 {
    libm::floor(zone * 1000.0 + 1e-6) / 1000.0
}

/// A share as whole per cents, 1 to 100.
pub(crate) fn per_cent(share: f64) -> String {
    num(libm::floor(share * 100.0 + 1e-6).clamp(1.0, 100.0), 0)
}
