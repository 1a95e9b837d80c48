//! How exactly the joint values of a program put the tool where it should be: forward kinematics of every point
//! against its target, as table, statistics, CSV and pictures. The evaluation of S. N. Rea Minango, UFSC 2016,
//! chapter 5.

use std::fmt::Write as _;

use gr_ir::Source;
use gr_machine::math::Frame;
use gr_machine::{JointKind, Machine};

use crate::{Action, Planned, RobotProgram};

/// A point of a program, in the base.
#[derive(Clone, PartialEq, Debug)]
pub struct Point {
    /// Where the tool should be, mm.
    pub target: [f64; 3],
    /// Where the joint values put it, mm.
    pub reached: [f64; 3],
    /// Joint values, rad or mm.
    pub joints: Vec<f64>,
    /// Time of the way here, s; none where it isn't known.
    pub seconds: Option<f64>,
    /// Where it comes from.
    pub source: Option<Source>,
}

impl Point {
    /// Target minus reached, mm.
    pub fn error(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.target[i] - self.reached[i])
    }
}

/// All points of a program and the machine they are for.
#[derive(Clone, PartialEq, Debug)]
pub struct Report {
    machine: Machine,
    /// The points.
    pub points: Vec<Point>,
}

/// Mean, greatest and least error of an axis, mm.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Greatest.
    pub upper: f64,
    /// Least.
    pub lower: f64,
}

impl Report {
    /// From points made elsewhere.
    pub fn new(machine: &Machine, points: Vec<Point>) -> Report {
        Report { machine: machine.clone(), points }
    }

    /// Of a planned program: every target of its moves.
    pub fn of(planned: &Planned) -> Report {
        let program = &planned.program;
        let mut walk = Walk { program, tool: Frame::IDENTITY, frame: Frame::IDENTITY, last: None, points: Vec::new() };
        program.steps.iter().for_each(|s| walk.step(&s.action, s.source));
        Report { machine: program.machine.clone(), points: walk.points }
    }

    /// Mean, upper and lower error of X, Y and Z.
    pub fn spread(&self) -> [Spread; 3] {
        [0, 1, 2].map(|axis| {
            let mut s = Spread { mean: 0.0, upper: f64::NEG_INFINITY, lower: f64::INFINITY };
            for p in &self.points {
                let e = p.error()[axis];
                s.mean += e / self.points.len() as f64;
                s.upper = s.upper.max(e);
                s.lower = s.lower.min(e);
            }
            if self.points.is_empty() { Spread::default() } else { s }
        })
    }

    /// Greatest error of any axis, mm.
    pub fn worst(&self) -> f64 {
        self.spread().iter().fold(0.0, |w, s| w.max(s.upper.abs()).max(s.lower.abs()))
    }

    /// The statistics for people, in µm.
    pub fn table(&self) -> String {
        let mut out = format!("{} points on {}; error = target − reached, µm\n", self.points.len(), self.machine.id);
        out += "axis      mean       upper      lower\n";
        for (axis, s) in ["X", "Y", "Z"].iter().zip(self.spread()) {
            let um = |v: f64| {
                let v = v * 1000.0;
                if v.abs() >= 0.0005 || v == 0.0 { format!("{v:>10.3}") } else { format!("{v:>10.1e}") }
            };
            let _ = writeln!(out, "{axis:<4}{} {} {}", um(s.mean), um(s.upper), um(s.lower));
        }
        out
    }

    /// One row per point: number, line, reached, target, error, joints.
    pub fn csv(&self) -> String {
        let mut out = String::from("point,line,reached_x,reached_y,reached_z,target_x,target_y,target_z,error_x,error_y,error_z");
        for j in &self.machine.joints {
            let _ = write!(out, ",{}", j.name.replace([',', '"', '\n'], " "));
        }
        out.push('\n');
        for (i, p) in self.points.iter().enumerate() {
            let line = p.source.map_or(String::new(), |s| (s.line + 1).to_string());
            let _ = write!(out, "{},{line}", i + 1);
            for v in p.reached.iter().chain(&p.target) {
                let _ = write!(out, ",{v:.6}");
            }
            for v in p.error() {
                let _ = write!(out, ",{v:.3e}");
            }
            for v in self.shown(&p.joints) {
                let _ = write!(out, ",{v:.6}");
            }
            out.push('\n');
        }
        out
    }

    /// Joint values in degrees and mm.
    fn shown(&self, joints: &[f64]) -> Vec<f64> {
        let each = |(v, j): (&f64, &gr_machine::Joint)| if j.kind == JointKind::Revolute { v.to_degrees() } else { *v };
        joints.iter().zip(&self.machine.joints).map(each).collect()
    }

    /// Picture of the errors of X, Y and Z by point.
    pub fn error_svg(&self) -> String {
        let rows: Vec<Plot> = ["X", "Y", "Z"]
            .iter()
            .enumerate()
            .map(|(axis, name)| Plot {
                title: format!("error {name}, µm"),
                values: self.points.iter().map(|p| p.error()[axis] * 1000.0).collect(),
                limits: None,
                dots: true,
            })
            .collect();
        draw(&rows)
    }

    /// Picture of the joint values by point, with their limits.
    pub fn joints_svg(&self) -> String {
        let all: Vec<Vec<f64>> = self.points.iter().map(|p| self.shown(&p.joints)).collect();
        let plot = |(i, j): (usize, &gr_machine::Joint)| {
            let unit = if j.kind == JointKind::Revolute { "°" } else { "mm" };
            let limit = |v: Option<f64>| v.map(|v| if j.kind == JointKind::Revolute { v.to_degrees() } else { v });
            let limits = limit(j.min).zip(limit(j.max));
            Plot { title: format!("{}, {unit}", j.name), values: all.iter().filter_map(|q| q.get(i).copied()).collect(), limits, dots: false }
        };
        draw(&self.machine.joints.iter().enumerate().map(plot).collect::<Vec<_>>())
    }

    /// Picture of the joint speeds by point, with their limits.
    pub fn speeds_svg(&self) -> String {
        let all: Vec<Vec<f64>> = self.points.iter().map(|p| self.shown(&p.joints)).collect();
        let plot = |(i, j): (usize, &gr_machine::Joint)| {
            let turns = j.kind == JointKind::Revolute;
            let unit = if turns { "°/s" } else { "mm/s" };
            let speed = |k: usize| {
                let seconds = self.points[k].seconds.filter(|s| *s > 0.0)?;
                Some((all[k].get(i)? - all[k.checked_sub(1)?].get(i)?) / seconds)
            };
            let values = (0..all.len()).map(|k| speed(k).unwrap_or(0.0)).collect();
            let limits = j.speed.map(|v| if turns { v.to_degrees() } else { v }).map(|v| (-v, v));
            Plot { title: format!("{}, {unit}", j.name), values, limits, dots: false }
        };
        draw(&self.machine.joints.iter().enumerate().map(plot).collect::<Vec<_>>())
    }
}

struct Walk<'a> {
    program: &'a RobotProgram,
    tool: Frame,
    frame: Frame,
    last: Option<[f64; 3]>,
    points: Vec<Point>,
}

impl Walk<'_> {
    fn step(&mut self, action: &Action, source: Option<Source>) {
        match action {
            Action::UseTool(t) => self.tool = self.program.tools[usize::from(*t)].frame,
            Action::UseFrame(f) => self.frame = self.program.frames[usize::from(*f)].frame,
            Action::Joint { to, .. } => self.point(*to, None, None, source),
            Action::Linear { to, speed, .. } | Action::Probe { to, speed, .. } => self.point(*to, Some(*speed), None, source),
            Action::Arc { via, to, angle, center, speed, .. } => {
                let radius = gr_machine::math::norm(gr_machine::math::sub(self.program.targets[*to as usize].position, *center));
                let half = radius * angle / 2.0;
                self.point(*via, Some(*speed), Some(half), source);
                self.point(*to, Some(*speed), Some(half), source);
            }
            _ => {}
        }
    }

    fn point(&mut self, target: u32, speed: Option<f64>, length: Option<f64>, source: Option<Source>) {
        let t = &self.program.targets[target as usize];
        let count = self.program.machine.joints.len();
        let joints = t.joints[..count].to_vec();
        let Ok(flange) = self.program.machine.kinematics().forward_frame(&joints) else { return };
        let wanted = self.frame.apply(t.position);
        let length = length.or_else(|| self.last.map(|p| gr_machine::math::norm(gr_machine::math::sub(wanted, p))));
        let seconds = speed.zip(length).map(|(v, l)| l / v);
        self.last = Some(wanted);
        self.points.push(Point { target: wanted, reached: flange.then(&self.tool).position, joints, seconds, source });
    }
}

/// One diagram.
struct Plot {
    title: String,
    values: Vec<f64>,
    limits: Option<(f64, f64)>,
    dots: bool,
}

const WIDE: f64 = 900.0;
const HIGH: f64 = 150.0;
/// Values drawn at most; of more, the greatest and the least of each stretch are.
const DRAWN: usize = 4000;

fn draw(plots: &[Plot]) -> String {
    let total = plots.len() as f64 * (HIGH + 50.0) + 10.0;
    let mut out = format!("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {total}\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n", WIDE + 100.0);
    for (i, plot) in plots.iter().enumerate() {
        let _ = writeln!(out, "<g transform=\"translate(70 {})\">", 30.0 + i as f64 * (HIGH + 50.0));
        one(&mut out, plot);
        out += "</g>\n";
    }
    out + "</svg>\n"
}

fn one(out: &mut String, plot: &Plot) {
    let limits = plot.limits.map_or(Vec::new(), |(a, b)| vec![a, b]);
    let all = || plot.values.iter().chain(&limits).copied();
    let (mut low, mut high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    if !(high > low) {
        let size = if low.is_finite() { low.abs().max(1e-9) } else { 1.0 };
        let middle = if low.is_finite() { low } else { 0.0 };
        (low, high) = (middle - size, middle + size);
    }
    let y = |v: f64| HIGH - (v - low) / (high - low) * HIGH;
    let x = |k: usize| k as f64 / plot.values.len().max(2).saturating_sub(1) as f64 * WIDE;
    let _ = writeln!(out, "<text x=\"0\" y=\"-8\">{}</text>", escaped(&plot.title));
    let _ = writeln!(out, "<rect width=\"{WIDE}\" height=\"{HIGH}\" fill=\"none\" stroke=\"#999\"/>");
    for v in [low, (low + high) / 2.0, high] {
        let _ = writeln!(out, "<text x=\"-6\" y=\"{:.1}\" text-anchor=\"end\">{}</text>", y(v) + 4.0, number(v));
    }
    let _ = writeln!(out, "<text x=\"{WIDE}\" y=\"{}\" text-anchor=\"end\">{}</text>", HIGH + 14.0, plot.values.len());
    for v in limits {
        let _ = writeln!(out, "<line x1=\"0\" x2=\"{WIDE}\" y1=\"{0:.1}\" y2=\"{0:.1}\" stroke=\"#c00\" stroke-dasharray=\"4 3\"/>", y(v));
    }
    let step = plot.values.len().div_ceil(DRAWN).max(1);
    if plot.dots {
        out.push_str("<path fill=\"none\" stroke=\"#06c\" stroke-width=\"2\" stroke-linecap=\"round\" d=\"");
    } else {
        out.push_str("<path fill=\"none\" stroke=\"#06c\" d=\"");
    }
    for (k, chunk) in plot.values.chunks(step).enumerate() {
        let (min, max) = chunk.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let at = x(k * step);
        if plot.dots {
            let _ = write!(out, "M{at:.1} {:.2}L{at:.1} {:.2}", y(min), y(max));
        } else {
            let _ = write!(out, "{}{at:.1} {:.2}L{at:.1} {:.2}", if k == 0 { 'M' } else { 'L' }, y(min), y(max));
        }
    }
    out.push_str("\"/>\n");
}

fn number(v: f64) -> String {
    if v == 0.0 || (v.abs() >= 0.001 && v.abs() < 1e5) {
        let text = format!("{v:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        format!("{v:.1e}")
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
