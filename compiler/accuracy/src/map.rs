//! Maps over the work space: a quantity on a grid in a plane of the base; on machines with a turning table, of the part's frame on it.

use crate::clearance::Lattice;
use crate::error::{Budget, Sensitivity, Spread, at_lever, blank, closed_form};
use crate::words::{Asked, Slides, Words, sensitivity};
use gr_machine::math::{Frame, M3, V3, add, dot, eigenvalues, norm, product, rot_x, rot_z, rotate, sub};
use gr_machine::{Chain, Control, JointKind, Kind, Kinematics, KinematicsError, Machine, Opw, TwoLegs, differential};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a map shows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Quantity {
    /// Where the tool can go: 1.
    Workspace,
    /// Condition number: one over the distance from a singularity.
    Condition,
    /// Distance from a singularity: least over greatest singular value of the velocities, 0 to 1, whatever the units.
    Singularity,
    /// Product of the singular values of the velocities of the tool point (Yoshikawa); for three joints the determinant
    /// without its sign.
    Manipulability,
    /// Root of the sum of squares of the velocities of the tool point (Frobenius).
    Norm,
    /// Error by the joints, µm.
    Kinematic(Part),
    /// Error by the geometry, µm.
    Geometric(Part),
    /// Deflection under a force, µm.
    Elastic(Part),
    /// Kinematic + geometric + elastic, the longest of each, µm.
    Total,
    /// Root of the squares of the typical kinematic and geometric errors and the deflection, µm.
    TotalRss,
    /// Stiffness in the softest direction, N/µm.
    Stiffness,
}

/// Which part of an error.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Part {
    /// Along an axis of the base: 0, 1, 2.
    Axis(usize),
    /// Its length.
    Length,
}

impl Quantity {
    /// Its name on the command line, and the other way round.
    pub const NAMES: [(&'static str, Quantity); 20] = [
        ("workspace", Quantity::Workspace),
        ("condition", Quantity::Condition),
        ("singularity", Quantity::Singularity),
        ("manipulability", Quantity::Manipulability),
        ("norm", Quantity::Norm),
        ("kinematic", Quantity::Kinematic(Part::Length)),
        ("kinematic-x", Quantity::Kinematic(Part::Axis(0))),
        ("kinematic-y", Quantity::Kinematic(Part::Axis(1))),
        ("kinematic-z", Quantity::Kinematic(Part::Axis(2))),
        ("geometric", Quantity::Geometric(Part::Length)),
        ("geometric-x", Quantity::Geometric(Part::Axis(0))),
        ("geometric-y", Quantity::Geometric(Part::Axis(1))),
        ("geometric-z", Quantity::Geometric(Part::Axis(2))),
        ("elastic", Quantity::Elastic(Part::Length)),
        ("elastic-x", Quantity::Elastic(Part::Axis(0))),
        ("elastic-y", Quantity::Elastic(Part::Axis(1))),
        ("elastic-z", Quantity::Elastic(Part::Axis(2))),
        ("total", Quantity::Total),
        ("total-rss", Quantity::TotalRss),
        ("stiffness", Quantity::Stiffness),
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        Quantity::NAMES.iter().find(|(_, q)| *q == self).map_or("", |(n, _)| n)
    }

    /// What it is, for people.
    pub fn words(self) -> String {
        let of = |what: &str, part: Part| match part {
            Part::Axis(i) => format!("{what}, along {}", ["X", "Y", "Z"][i.min(2)]),
            Part::Length => what.to_string(),
        };
        match self {
            Quantity::Workspace => "reach".into(),
            Quantity::Condition => "condition number".into(),
            Quantity::Singularity => "distance from a singularity".into(),
            Quantity::Manipulability => "manipulability".into(),
            Quantity::Norm => "norm of the velocities".into(),
            Quantity::Kinematic(part) => of("error by the joints", part),
            Quantity::Geometric(part) => of("error by the geometry", part),
            Quantity::Elastic(part) => of("deflection", part),
            Quantity::Total => "sum of the longest errors".into(),
            Quantity::TotalRss => "root of squares of the typical errors".into(),
            Quantity::Stiffness => "stiffness in the softest direction".into(),
        }
    }

    /// Its unit; empty for a plain number and for what depends on the units of the joints.
    pub fn unit(self) -> &'static str {
        match self {
            Quantity::Kinematic(_) | Quantity::Geometric(_) | Quantity::Elastic(_) | Quantity::Total | Quantity::TotalRss => "µm",
            Quantity::Stiffness => "N/µm",
            _ => "",
        }
    }

    /// What the machine file must say for it.
    pub fn needs(self) -> (bool, bool, bool) {
        match self {
            Quantity::Kinematic(_) => (true, false, false),
            Quantity::Geometric(_) => (false, true, false),
            Quantity::Elastic(_) | Quantity::Stiffness => (false, false, true),
            Quantity::Total | Quantity::TotalRss => (true, true, false),
            _ => (false, false, false),
        }
    }
}

/// A plane of the base: the axis square to it and where it lies, mm.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Plane {
    /// 0 = X, 1 = Y, 2 = Z.
    pub axis: usize,
    /// Its place on that axis, mm.
    pub at: f64,
}

impl Plane {
    /// Indices of the axes drawn to the right and up.
    pub fn axes(self) -> (usize, usize) {
        match self.axis {
            0 => (1, 2),
            1 => (0, 2),
            _ => (0, 1),
        }
    }
}

/// What is wanted.
#[derive(Clone, Debug)]
pub struct Request {
    /// What is drawn.
    pub quantity: Quantity,
    /// Where.
    pub plane: Plane,
    /// Nodes to the right and up.
    pub size: (usize, usize),
    /// Coordinates of the first and the last node to the right and up, mm; none = the whole work space, each node in the
    /// middle of its mesh, so that the area has no bias.
    pub window: Option<[(f64, f64); 2]>,
    /// Force on the tool, N, for deflections.
    pub force: V3,
    /// Signs of the joint errors; none = the worst pattern.
    pub signs: Option<Vec<f64>>,
}

/// A map: row by row from the bottom; not a number = out of reach.
#[derive(Clone, PartialEq, Debug)]
pub struct Map {
    /// What it shows.
    pub quantity: Quantity,
    /// Where.
    pub plane: Plane,
    /// Nodes to the right and up.
    pub size: (usize, usize),
    /// Coordinates of the first and the last node to the right and up, mm.
    pub window: [(f64, f64); 2],
    /// The nodes are the middles of their meshes.
    pub centred: bool,
    /// There is a deflection in it.
    pub elastic: bool,
    /// Nodes within reach that have no value: a spring has no length left there, or the place is singular.
    pub lost: usize,
    /// Values.
    pub values: Vec<f32>,
}

/// What everybody must know who reads a deflection.
pub const DOUBT: &str = "deflection: springs of the drives only; the model of its source was never confirmed by better than a factor of 2";

/// The range of a map, its extremes and their places.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Summary {
    /// Nodes within reach.
    pub nodes: usize,
    /// Their area, mm².
    pub area: f64,
    /// Least value and its place (right, up), mm.
    pub least: (f64, [f64; 2]),
    /// Greatest value and its place.
    pub greatest: (f64, [f64; 2]),
    /// Mean value.
    pub mean: f64,
    /// Extent of the nodes within reach, to the right and up, mm; of their meshes where the nodes are the middles.
    pub extent: [(f64, f64); 2],
}

impl Map {
    /// Distance of the nodes, mm.
    pub fn step(&self) -> [f64; 2] {
        let n = [self.size.0, self.size.1];
        [0, 1].map(|i| (self.window[i].1 - self.window[i].0) / (n[i].max(2) - 1) as f64)
    }
    /// Place of a node.
    pub fn place(&self, i: usize, j: usize) -> [f64; 2] {
        let step = self.step();
        [self.window[0].0 + i as f64 * step[0], self.window[1].0 + j as f64 * step[1]]
    }
    /// Least and greatest coordinates that are drawn, to the right and up, mm: those of the meshes where they are known.
    pub fn border(&self) -> [(f64, f64); 2] {
        let half = if self.centred { self.step().map(|s| s / 2.0) } else { [0.0; 2] };
        [0, 1].map(|i| (self.window[i].0 - half[i], self.window[i].1 + half[i]))
    }
    /// Extremes; none when nothing is within reach.
    pub fn summary(&self) -> Option<Summary> {
        let mut out: Option<Summary> = None;
        let mut sum = 0.0;
        for (n, v) in self.values.iter().enumerate().filter(|(_, v)| !v.is_nan()) {
            let p = self.place(n % self.size.0, n / self.size.0);
            let v = f64::from(*v);
            let s = out.get_or_insert(Summary {
                nodes: 0,
                area: 0.0,
                least: (v, p),
                greatest: (v, p),
                mean: 0.0,
                extent: [(p[0], p[0]), (p[1], p[1])],
            });
            s.nodes += 1;
            sum += v;
            if v < s.least.0 {
                s.least = (v, p);
            }
            if v > s.greatest.0 {
                s.greatest = (v, p);
            }
            for (e, c) in s.extent.iter_mut().zip(p) {
                *e = (e.0.min(c), e.1.max(c));
            }
        }
        let step = self.step();
        let half = if self.centred { 0.5 } else { 0.0 };
        out.map(|s| Summary {
            area: s.nodes as f64 * step[0] * step[1],
            mean: sum / s.nodes as f64,
            extent: [0, 1].map(|i| (s.extent[i].0 - half * step[i], s.extent[i].1 + half * step[i])),
            ..s
        })
    }
    /// As a table: one row per node within reach; what must be known to read it stands in the head of the last column.
    pub fn csv(&self, notes: &[String]) -> String {
        use std::fmt::Write as _;
        let (a, b) = self.plane.axes();
        let unit = self.quantity.unit();
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let name = |i: usize| ["x", "y", "z"][i];
        let mut notes: Vec<&str> = notes.iter().map(String::as_str).collect();
        if self.elastic {
            notes.push("deflection: to a factor of 2 at best");
        }
        let notes = if notes.is_empty() { String::new() } else { format!(" ({})", notes.join("; ")) };
        let value = format!("{}{unit}{notes}", self.quantity.name());
        let value = if value.contains([',', '"']) { format!("\"{}\"", value.replace('"', "\"\"")) } else { value };
        let mut out = format!("{} mm,{} mm,{value}\n", name(a), name(b));
        for (n, v) in self.values.iter().enumerate().filter(|(_, v)| !v.is_nan()) {
            let [x, y] = self.place(n % self.size.0, n / self.size.0);
            let _ = writeln!(out, "{x:.4},{y:.4},{v}");
        }
        out
    }
}

/// Looks at a machine at places of its work space, with the tool in one direction.
pub struct Probe<'a> {
    machine: &'a Machine,
    kinematics: Box<dyn Kinematics>,
    /// Turn of the tool in the base.
    turn: M3,
    /// Tool point on the flange.
    tool: Frame,
    start: Vec<f64>,
    /// On a machine tool that stands as at a place of a program: its rotary words are what they are there.
    words: Option<(Slides, V3)>,
    /// What moves the tool point where the part was touched: errors by the geometry count from there.
    zero: Option<Sensitivity>,
    /// What one radian of a turning joint counts beside one mm of a sliding one, mm; once it is asked for.
    lever: OnceLock<f64>,
    /// The part of the base the tool can reach; once it is asked for.
    extent: OnceLock<[(f64, f64); 3]>,
}

impl<'a> Probe<'a> {
    /// With the tool turned as at the machine's start.
    pub fn new(machine: &'a Machine) -> Probe<'a> {
        let start = machine.start_joints.clone().unwrap_or_default();
        let kinematics = machine.kinematics();
        let turn = machine.start.frame().turn;
        Probe { machine, kinematics, turn, tool: Frame::IDENTITY, start, words: None, zero: None, lever: OnceLock::new(), extent: OnceLock::new() }
    }

    /// As on a machine tool whose part was touched there; other machines have no such zero.
    pub fn touched(self, at: V3) -> Probe<'a> {
        let zero = match Words::of(self.machine) {
            Ok(Words::Joints(slides)) if self.machine.kind != Kind::Robot => {
                let asked = Asked { tip: at, tool: self.tool, rotary: [0.0; 3] };
                sensitivity(&slides, self.machine, &*self.kinematics, &asked)
            }
            _ => None,
        };
        Probe { zero, ..self }
    }

    /// Whether errors by the geometry count from a zero that was touched.
    pub fn counts_from_zero(&self) -> bool {
        self.zero.is_some()
    }

    /// Whether it is for whoever asks how the tool is turned: neither the machine nor a spindle that can't turn decides it.
    pub fn turns_as_asked(&self) -> bool {
        !matches!(self.machine.chain, Chain::Cartesian) && self.kinematics.control() != Control::Position
    }

    /// The turn of a planar arm's tool about Z, rad.
    pub fn planar_angle(&self) -> Option<f64> {
        matches!(self.machine.chain, Chain::Planar3r(_)).then(|| libm::atan2(self.turn[1][0], self.turn[0][0]))
    }

    /// Whether only the lean of its tool is its own: the spindle turns it about itself anyway.
    pub fn leans(&self) -> bool {
        self.kinematics.control() == Control::Axis
    }

    /// Whether places and directions are those of the part on a table that turns it, not of the base.
    pub fn turns_part(&self) -> bool {
        turns_part(self.machine)
    }

    /// Least and greatest coordinate that is within reach, on a lattice, and how fine that is, mm.
    pub fn span(&self, axis: usize) -> Option<(f64, f64, f64)> {
        let count = if closed_form(self.machine) { 60_000 } else { 4_000 };
        let lattice = Lattice::new(self.extent(), count, &|p| self.reaches(p), &|_, _| {});
        lattice.span(axis).map(|(low, high)| (low, high, lattice.step()))
    }

    /// With the tool (on the flange) in this turn in the base.
    pub fn held(self, tool: Frame, turn: M3) -> Probe<'a> {
        // A spindle that can't turn its part stands as it stands.
        let turn = if matches!(self.machine.chain, Chain::Cartesian) { self.turn } else { turn };
        Probe { tool, turn, lever: OnceLock::new(), extent: OnceLock::new(), ..self }
    }

    /// With that tool (on the flange), turned as it is without one where the machine can turn it at will; where it can't, as it is
    /// mounted.
    pub fn holding(self, tool: Frame) -> Probe<'a> {
        let free = self.kinematics.control() == Control::Axis || self.machine.joints.len() >= 6;
        let turn = if free { self.turn } else { product(&self.turn, &tool.turn) };
        self.held(tool, turn)
    }

    /// With the tool (on the flange) as it stands at those joint values, at every place: a machine tool with its rotary axes as they
    /// are, an arm with joints as near to them as can be.
    pub fn standing(self, tool: Frame, joints: &[f64]) -> Result<Probe<'a>, KinematicsError> {
        let here = self.kinematics.forward_frame(joints)?;
        let mut out = self.held(tool, here.then(&tool).turn);
        out.start = joints.to_vec();
        if let (true, Ok(Words::Joints(slides))) = (out.machine.kind != Kind::Robot, Words::of(out.machine)) {
            let mut rotary = [0.0; 3];
            for (joint, word) in &slides.turning {
                if let (Some(slot), Some(v)) = (word.checked_sub(3).and_then(|w| rotary.get_mut(w)), joints.get(*joint)) {
                    *slot = *v;
                }
            }
            out.words = Some((slides, rotary));
        }
        Ok(out)
    }

    /// With errors by the geometry counted from what moves the tool point at a zero that was touched.
    pub fn since(self, zero: Option<Sensitivity>) -> Probe<'a> {
        Probe { zero, ..self }
    }

    /// How far the tool's axis is turned away from straight down on arms, whose tools point along Z of their frame, and from
    /// upright elsewhere, rad.
    pub fn lean(&self) -> f64 {
        let up = self.turn[2][2];
        libm::acos((if self.leans() { up } else { -up }).clamp(-1.0, 1.0))
    }

    /// Where the flange is when the tool point is there. A machine that only places its tool point takes it upright.
    pub(crate) fn flange(&self, p: V3) -> Frame {
        match self.kinematics.control() {
            Control::Position => Frame::shift(sub(p, self.tool.position)),
            _ if matches!(self.machine.chain, Chain::Cartesian) => {
                Frame { turn: self.turn, position: sub(p, self.tool.position) }
            }
            _ => Frame { turn: self.turn, position: p }.then(&self.tool.inverse()),
        }
    }

    /// Its machine.
    pub(crate) fn machine(&self) -> &'a Machine {
        self.machine
    }

    /// With the tool's axis pointing straight down (the flange's Z along −Z of the base).
    pub fn downward(machine: &'a Machine) -> Probe<'a> {
        let mut probe = Probe::new(machine);
        if probe.kinematics.control() == Control::Full && machine.joints.len() >= 6 {
            probe.turn = rot_x(std::f64::consts::PI);
        }
        probe
    }

    /// Joint values for a place, within all limits; the nearest to the start.
    pub fn joints(&self, p: V3) -> Option<Vec<f64>> {
        if let Chain::Opw(k) = &self.machine.chain {
            return self.opw(k, p).map(|q| q.to_vec());
        }
        if let Some((slides, rotary)) = &self.words {
            let asked = Asked { tip: p, tool: self.tool, rotary: *rotary };
            let q = slides.stand(self.machine, &*self.kinematics, &asked)?.joints;
            return (self.machine.outside(&q).is_empty() && self.kinematics.violations(&q).is_empty()).then_some(q);
        }
        let all = self.kinematics.inverse_frame(&self.flange(p)).ok()?;
        let good = all.into_iter().map(|s| s.joints).filter(|q| {
            self.machine.outside(q).is_empty() && self.kinematics.violations(q).is_empty()
        });
        good.min_by(|a, b| self.far(a).total_cmp(&self.far(b)))
    }

    fn far(&self, q: &[f64]) -> f64 {
        q.iter().zip(self.start.iter().chain(std::iter::repeat(&0.0))).map(|(a, b)| (a - b) * (a - b)).sum()
    }

    fn opw(&self, k: &Opw, p: V3) -> Option<[f64; 6]> {
        let all = k.solve(&self.flange(p));
        let mut best: Option<(f64, [f64; 6])> = None;
        for (i, q) in all.joints.iter().enumerate().filter(|(i, _)| all.good >> i & 1 == 1) {
            let far = self.far(q);
            let inside = self.machine.joints.iter().zip(q).all(|(j, v)| j.allows(*v));
            // The coupled joint has limits of its own on the controller.
            if inside && best.is_none_or(|(b, _)| far < b) {
                if self.machine.cell.coupling.is_some() && !self.machine.outside(q).is_empty() {
                    continue;
                }
                best = Some((far, *q));
            }
            let _ = i;
        }
        best.map(|(_, q)| q)
    }

    /// Looks whether so many places spread over the reach can be reached: to tell how long that takes.
    pub fn sample_reach(&self, count: usize) {
        let extent = self.extent();
        for n in 1..=u32::try_from(count).unwrap_or(u32::MAX) {
            let at = [(0, 2), (1, 3), (2, 5)].map(|(i, base): (usize, u32)| extent[i].0 + (extent[i].1 - extent[i].0) * halton(n, base));
            self.reaches(at);
        }
    }

    /// Whether the tool can be put there.
    pub fn reaches(&self, p: V3) -> bool {
        match &self.machine.chain {
            Chain::TwoLegs(k) => legs_reach(k, self.platform(k, p)),
            _ => self.joints(p).is_some(),
        }
    }

    /// Arm, yaw and height of the platform when the tool point is there: the tool turns with the yaw, which follows from the place. Not a
    /// number where there is none.
    fn platform(&self, k: &TwoLegs, p: V3) -> V3 {
        let [across, beside, _] = self.tool.position;
        if across == 0.0 && beside == 0.0 {
            return k.place_of(self.flange(p).position);
        }
        // Turned by the yaw, arm and tool together lead to the place.
        let along = libm::sqrt(p[0] * p[0] + p[1] * p[1] - beside * beside);
        [along - across, libm::atan2(p[1], p[0]) - libm::atan2(beside, along), self.flange(p).position[2]]
    }

    /// What moves the tool there; none where it can't be put.
    pub fn sensitivity(&self, p: V3, geometry: bool) -> Option<Sensitivity> {
        let s = self.sensed(p, geometry)?;
        Some(match &self.zero {
            Some(zero) => s.since(zero),
            None => s,
        })
    }

    fn sensed(&self, p: V3, geometry: bool) -> Option<Sensitivity> {
        match &self.machine.chain {
            Chain::TwoLegs(k) => {
                let at = self.platform(k, p);
                if !legs_reach(k, at) {
                    return None;
                }
                // The platform turns by the yaw, and the tool with it.
                let lever = rotate(&rot_z(at[1]), self.tool.position);
                Sensitivity::of_two_legs(self.machine, k, at, lever)
            }
            _ if geometry => {
                let q = self.joints(p)?;
                Sensitivity::new(self.machine, &q, self.lever(&q)?).ok()
            }
            Chain::Opw(k) => {
                let q = self.opw(k, p)?;
                let columns = differential::opw(k, &q);
                self.bare(&q, &columns)
            }
            _ => {
                let q = self.joints(p)?;
                let mut columns = differential::velocity(self.machine, &q).ok()?;
                blank(self.machine, &mut columns);
                self.bare(&q, &columns)
            }
        }
    }

    /// From the flange to the tool point, base directions.
    fn lever(&self, q: &[f64]) -> Option<V3> {
        if self.tool.position == [0.0; 3] || matches!(self.machine.chain, Chain::Cartesian) {
            return Some(self.tool.position);
        }
        Some(rotate(&self.kinematics.forward_frame(q).ok()?.turn, self.tool.position))
    }

    /// Without the geometry's part.
    fn bare(&self, q: &[f64], columns: &[[f64; 6]]) -> Option<Sensitivity> {
        let stiff = self.machine.cell.stiffness.as_ref();
        let lever = self.lever(q)?;
        Some(Sensitivity {
            joints: columns.iter().map(|c| at_lever(c, lever)).collect(),
            geometry: Vec::new(),
            stiffness: q.iter().enumerate().map(|(i, v)| stiff.and_then(|s| s.joint(i, *v))).collect(),
        })
    }

    /// The part of the base the tool can reach, roughly: least and greatest X, Y and Z, mm. Exactly so for the turn of the tool on mills
    /// of five axes.
    pub fn extent(&self) -> [(f64, f64); 3] {
        *self.extent.get_or_init(|| self.corners().unwrap_or_else(|| self.moved(self.searched_extent(), -1.0)))
    }

    /// The same of the flange.
    pub(crate) fn flange_extent(&self) -> [(f64, f64); 3] {
        self.moved(self.extent(), 1.0)
    }

    /// A box moved by the way from the tool point to the flange, or back.
    fn moved(&self, extent: [(f64, f64); 3], by: f64) -> [(f64, f64); 3] {
        if self.tool.position == [0.0; 3] {
            return extent;
        }
        let way = self.flange([0.0; 3]).position;
        if matches!(self.machine.chain, Chain::TwoLegs(_)) {
            // Beside the platform's axis the tool goes round it with the yaw.
            let round = libm::hypot(way[0], way[1]);
            let [x, y, z] = extent;
            return [(x.0 - round, x.1 + round), (y.0 - round, y.1 + round), (z.0 + by * way[2], z.1 + by * way[2])];
        }
        [0, 1, 2].map(|i| (extent[i].0 + by * way[i], extent[i].1 + by * way[i]))
    }

    /// The part of the base the tool can reach in any turn of it, roughly.
    pub(crate) fn extent_of_all_turns(&self) -> [(f64, f64); 3] {
        self.searched_extent()
    }

    /// Slides that go straight reach a box, with the rotary axes where the turn of the tool wants them: its corners say all.
    fn corners(&self) -> Option<[(f64, f64); 3]> {
        if !matches!(self.machine.chain, Chain::FiveAxis(_)) {
            return None;
        }
        let joints = &self.machine.joints;
        let middle: Vec<f64> = joints.iter().map(|j| if j.kind == JointKind::Revolute { 0.0 } else { (limits(j).0 + limits(j).1) / 2.0 }).collect();
        let somewhere = self.kinematics.forward_frame(&middle).ok()?.position;
        let turning = |q: &[f64]| joints.iter().zip(q).all(|(j, v)| j.kind != JointKind::Revolute || j.allows(*v));
        let ways = match &self.words {
            Some((slides, rotary)) => {
                let asked = Asked { tip: somewhere, tool: self.tool, rotary: *rotary };
                vec![slides.stand(self.machine, &*self.kinematics, &asked)?.joints]
            }
            None => self.kinematics.inverse_frame(&self.flange(somewhere)).ok()?.into_iter().map(|s| s.joints).collect(),
        };
        let ways = ways.into_iter().filter(|q| turning(q));
        let mut out: Option<[(f64, f64); 3]> = None;
        for q in ways {
            for corner in 0..1u32 << joints.len().min(16) {
                let end = |(i, (j, v)): (usize, (&gr_machine::Joint, &f64))| {
                    if j.kind == JointKind::Revolute {
                        return *v;
                    }
                    let (low, high) = limits(j);
                    if corner >> i & 1 == 1 { high } else { low }
                };
                let q: Vec<f64> = joints.iter().zip(&q).enumerate().map(end).collect();
                let p = self.kinematics.forward_frame(&q).ok()?.then(&self.tool).position;
                let known = out.unwrap_or(p.map(|v| (v, v)));
                out = Some([0, 1, 2].map(|i| (known[i].0.min(p[i]), known[i].1.max(p[i]))));
            }
        }
        out
    }

    fn searched_extent(&self) -> [(f64, f64); 3] {
        if let Chain::TwoLegs(k) = &self.machine.chain {
            let (s, yaw) = (&k.shape, k.shape.yaw.0.abs().max(k.shape.yaw.1.abs()));
            let side = s.arm.1 * libm::sin(yaw);
            return [(s.arm.0 * libm::cos(yaw), s.arm.1), (-side, side), s.column];
        }
        // The furthest places found so far, X down and up, Y, Z, with the joints there.
        let mut far: [Option<(f64, Vec<f64>)>; 6] = Default::default();
        let place = |q: &[f64], way: usize| {
            let p = self.kinematics.forward_frame(q).ok()?.position[way / 2];
            Some(if way % 2 == 0 { -p } else { p })
        };
        // The forward solution of a Tricept is a search itself.
        let (samples, halvings) = if matches!(self.machine.chain, Chain::Tricept(_)) { (300, 10) } else { (4000, 22) };
        for n in 1..samples {
            let q = spread_joints(self.machine, n);
            let Ok(f) = self.kinematics.forward_frame(&q) else { continue };
            for (way, best) in far.iter_mut().enumerate() {
                let v = if way % 2 == 0 { -f.position[way / 2] } else { f.position[way / 2] };
                if best.as_ref().is_none_or(|(b, _)| v > *b) {
                    *best = Some((v, q.clone()));
                }
            }
        }
        let mut out = [-1000.0, 1000.0, -1000.0, 1000.0, -1000.0, 1000.0];
        for (way, best) in far.into_iter().enumerate() {
            let Some((v, q)) = best else { continue };
            let v = self.climbed(v, q, halvings, |q| place(q, way));
            out[way] = if way % 2 == 0 { -v } else { v };
        }
        [0, 1, 2].map(|i| (out[2 * i], out[2 * i + 1]))
    }

    /// The longest way from an axis of a turning joint to the tool, mm: what a radian counts beside a mm.
    fn longest_lever(&self) -> f64 {
        if let Chain::Tricept(t) = &self.machine.chain
            && t.shape.flange_offset > 0.0
        {
            // The only turning joints are those of the wrist, whose axes meet in its centre.
            return norm(add([0.0, 0.0, t.shape.flange_offset], self.tool.position));
        }
        let lever = |q: &[f64]| {
            let columns = differential::velocity(self.machine, q).ok()?;
            let lever = self.lever(q)?;
            let turning = columns.iter().zip(&self.machine.joints).filter(|(_, j)| j.kind == JointKind::Revolute);
            turning.map(|(c, _)| norm(at_lever(c, lever))).reduce(f64::max)
        };
        let places = (1..LEVERS).map(|n| spread_joints(self.machine, n));
        let mut found: Vec<(f64, Vec<f64>)> = places.filter_map(|q| Some((lever(&q)?, q))).collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.truncate(CLIMBED);
        let longest = found.into_iter().map(|(v, q)| self.climbed(v, q, 40, lever)).fold(0.0, f64::max);
        if longest > 0.0 { longest } else { 1.0 }
    }

    /// The greatest value near those joints: one joint after the other, in steps that are halved.
    fn climbed(&self, mut best: f64, mut q: Vec<f64>, halvings: u32, value: impl Fn(&[f64]) -> Option<f64>) -> f64 {
        for halving in 0..halvings {
            for (i, joint) in self.machine.joints.iter().enumerate() {
                let (low, high) = limits(joint);
                let step = (high - low) / libm::ldexp(4.0, halving as i32);
                for by in [step, -step] {
                    let was = q[i];
                    q[i] = (was + by).clamp(low, high);
                    match value(&q).filter(|v| *v > best) {
                        Some(v) => best = v,
                        None => q[i] = was,
                    }
                }
            }
        }
        best
    }

    /// Distance from a singularity at a place. On machines that place only a point that of the point alone; elsewhere the
    /// turn of the tool counts too, a radian as much as the longest lever, so that neither mm nor rad decide; on a machine
    /// whose spindle turns the tool anyway only the lean of its axis counts.
    fn evenness(&self, p: V3) -> Option<f64> {
        if matches!(self.machine.chain, Chain::TwoLegs(_) | Chain::Cartesian) || self.kinematics.control() == Control::Position {
            return Some(share(&self.sensitivity(p, false)?.joints));
        }
        let size = *self.lever.get_or_init(|| self.longest_lever());
        let (q, mut columns) = match &self.machine.chain {
            Chain::Opw(k) => {
                let q = self.opw(k, p)?;
                (q.to_vec(), differential::opw(k, &q).to_vec())
            }
            _ => {
                let q = self.joints(p)?;
                let columns = differential::velocity(self.machine, &q).ok()?;
                (q, columns)
            }
        };
        let lever = self.lever(&q)?;
        if lever != [0.0; 3] {
            columns.iter_mut().for_each(|c| {
                let v = at_lever(c, lever);
                c[..3].copy_from_slice(&v);
            });
        }
        if self.kinematics.control() == Control::Axis {
            let axis = self.kinematics.forward_frame(&q).ok()?.axis(2);
            for c in &mut columns {
                let along = c[3] * axis[0] + c[4] * axis[1] + c[5] * axis[2];
                (0..3).for_each(|i| c[3 + i] -= along * axis[i]);
            }
        }
        Some(differential::evenness(&self.machine.joints, &columns, size))
    }

    /// Whether every joint has a spring: where there is no deflection then, one of them has no length left.
    fn springs(&self) -> bool {
        let members = self.machine.cell.stiffness.as_ref().map_or(&[][..], |s| &s.members);
        (0..self.machine.joints.len()).all(|i| members.iter().any(|m| m.joint == i))
    }

    /// How much a force moves the tool point, mm; 0 where the file has not all springs, no number where one has no length.
    fn yields(&self, s: &Sensitivity, force: V3) -> f64 {
        match s.deflection(force) {
            Some(d) => norm(d),
            None if force != [0.0; 3] && self.springs() => f64::NAN,
            None => 0.0,
        }
    }

    /// The quantity there; none out of reach, no number where it has no value.
    fn value(&self, p: V3, request: &Request, budget: &Budget) -> Option<f64> {
        if request.quantity == Quantity::Workspace {
            return self.reaches(p).then_some(1.0);
        }
        match request.quantity {
            Quantity::Condition => return self.evenness(p).map(|v| if v < SINGULAR { f64::NAN } else { 1.0 / v }),
            Quantity::Singularity => return self.evenness(p).map(|v| if v < SINGULAR { 0.0 } else { v }),
            _ => {}
        }
        let geometry = matches!(request.quantity, Quantity::Geometric(_) | Quantity::Total | Quantity::TotalRss);
        let s = self.sensitivity(p, geometry)?;
        let um = 1e3;
        Some(match request.quantity {
            Quantity::Workspace | Quantity::Condition | Quantity::Singularity => return None,
            Quantity::Manipulability => libm::sqrt(spectrum(&s.joints).iter().map(|v| v.max(0.0)).product()),
            Quantity::Norm => libm::sqrt(s.joints.iter().map(|c| norm(*c) * norm(*c)).sum()),
            Quantity::Kinematic(part) => match (&request.signs, &budget.joints) {
                (Some(signs), Some(sizes)) => {
                    let signed: Vec<f64> = sizes.iter().zip(signs).map(|(a, b)| a * b).collect();
                    um * fixed(&s.joints, &signed, part)
                }
                (_, sizes) => um * worst(&s.joints, sizes.as_ref()?, part),
            },
            Quantity::Geometric(part) => match &budget.known {
                Some(d) => um * fixed(&s.geometry, d, part),
                None => um * worst(&s.geometry, budget.geometry.as_ref()?, part),
            },
            Quantity::Elastic(part) => {
                let Some(d) = s.deflection(request.force) else { return Some(f64::NAN) };
                um * if let Part::Axis(i) = part { d[i] } else { norm(d) }
            }
            Quantity::Total => {
                let elastic = self.yields(&s, request.force);
                let of = |c: &[V3], b: &Option<Vec<f64>>| b.as_ref().map_or(0.0, |b| worst(c, b, Part::Length));
                let known = budget.known.as_ref().map_or(0.0, |d| fixed(&s.geometry, d, Part::Length));
                um * (of(&s.joints, &budget.joints) + of(&s.geometry, &budget.geometry) + known + elastic)
            }
            Quantity::TotalRss => {
                let elastic = self.yields(&s, request.force);
                let of = |c: &[V3], b: &Option<Vec<f64>>| b.as_ref().map_or(0.0, |b| typical(c, b));
                let known = budget.known.as_ref().map_or(0.0, |d| fixed(&s.geometry, d, Part::Length));
                let geometry = of(&s.geometry, &budget.geometry).max(known);
                um * libm::hypot(libm::hypot(of(&s.joints, &budget.joints), geometry), elastic)
            }
            Quantity::Stiffness => {
                let Some(c) = s.compliance() else { return Some(f64::NAN) };
                let most = eigenvalues(c.iter().map(|r| r.to_vec()).collect()).into_iter().fold(0.0, f64::max);
                1e-3 / most
            }
        })
    }
}

/// Whether a table turns the part, so that places and directions are those of its frame: the base's at rotary values 0.
pub fn turns_part(machine: &Machine) -> bool {
    matches!(&machine.chain, Chain::FiveAxis(k) if k.turns_part())
}

/// The fast form of `TwoLegs::broken(at).is_empty()`.
fn legs_reach(k: &TwoLegs, at: V3) -> bool {
    let s = &k.shape;
    let within = |v: f64, (low, high): (f64, f64)| v >= low && v <= high;
    if !(within(at[1], s.yaw) && within(at[0], s.arm) && within(at[2], s.column)) {
        return false;
    }
    let h = k.lengths(at);
    within(h[0], s.legs[0]) && within(h[1], s.legs[1]) && k.broken(at).is_empty()
}

/// Below this the least singular value is rounding: the place is singular.
const SINGULAR: f64 = 1e-7;
/// Places of the joints that are looked at for the longest lever, and how many of the best are climbed from.
const LEVERS: u32 = 100;
const CLIMBED: usize = 6;

/// Limits of a joint; half a turn or half a metre where it has none.
pub(crate) fn limits(j: &gr_machine::Joint) -> (f64, f64) {
    let wide = if j.kind == JointKind::Revolute { std::f64::consts::PI } else { 500.0 };
    (j.min.unwrap_or(-wide), j.max.unwrap_or(wide))
}

/// Joint values spread evenly over their limits, the n-th of as many as wanted.
fn spread_joints(machine: &Machine, n: u32) -> Vec<f64> {
    const BASES: [u32; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
    let one = |(j, base): (&gr_machine::Joint, &u32)| {
        let (low, high) = limits(j);
        low + (high - low) * halton(n, *base)
    };
    machine.joints.iter().zip(BASES.iter().cycle()).map(one).collect()
}

pub(crate) fn halton(mut n: u32, base: u32) -> f64 {
    let (mut share, mut out) = (1.0, 0.0);
    while n > 0 {
        share /= f64::from(base);
        out += share * f64::from(n % base);
        n /= base;
    }
    out
}

/// Squares of the singular values of the velocities of the tool point: three, or two of a planar machine.
fn spectrum(columns: &[V3]) -> Vec<f64> {
    let mut square = [[0.0; 3]; 3];
    for c in columns {
        for i in 0..3 {
            for j in 0..3 {
                square[i][j] += c[i] * c[j];
            }
        }
    }
    // A planar machine has two directions; the third says nothing of it.
    let flat = square[2][2] == 0.0;
    let size = if flat { 2 } else { 3 };
    eigenvalues(square[..size].iter().map(|r| r[..size].to_vec()).collect())
}

/// Least over greatest singular value of the velocities of the tool point.
fn share(columns: &[V3]) -> f64 {
    let values = spectrum(columns);
    let most = values.iter().fold(0.0f64, |m, v| m.max(*v));
    let least = values.iter().fold(f64::INFINITY, |m, v| m.min(*v));
    if most > 0.0 { libm::sqrt((least / most).max(0.0)) } else { 0.0 }
}

fn worst(columns: &[V3], sizes: &[f64], part: Part) -> f64 {
    match part {
        Part::Axis(i) => columns.iter().zip(sizes).map(|(c, s)| (c[i] * s).abs()).sum(),
        Part::Length => Spread::new(columns, sizes).longest,
    }
}

fn typical(columns: &[V3], sizes: &[f64]) -> f64 {
    libm::sqrt(columns.iter().zip(sizes).map(|(c, s)| dot(*c, *c) * s * s).sum())
}

fn fixed(columns: &[V3], sizes: &[f64], part: Part) -> f64 {
    let mut sum = [0.0; 3];
    for (c, s) in columns.iter().zip(sizes) {
        (0..3).for_each(|i| sum[i] += c[i] * s);
    }
    if let Part::Axis(i) = part { sum[i] } else { norm(sum) }
}

/// Draws up a map, on all cores; `progress` hears how many rows of how many are done.
pub fn map(probe: &Probe<'_>, budget: &Budget, request: &Request, progress: &(dyn Fn(usize, usize) + Sync)) -> Map {
    map_of(probe, budget, request, &probe.extent(), progress)
}

fn map_of(
    probe: &Probe<'_>,
    budget: &Budget,
    request: &Request,
    extent: &[(f64, f64); 3],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Map {
    let (a, b) = request.plane.axes();
    let (nx, ny) = request.size;
    let centred = request.window.is_none();
    let window = request.window.unwrap_or_else(|| {
        [(a, nx), (b, ny)].map(|(i, n)| {
            let (low, high) = extent[i];
            let half = (high - low) / (2 * n.max(1)) as f64;
            (low + half, high - half)
        })
    });
    let mut out = Map {
        quantity: request.quantity,
        plane: request.plane,
        size: request.size,
        window,
        centred,
        elastic: match request.quantity {
            Quantity::Elastic(_) | Quantity::Stiffness => true,
            Quantity::Total | Quantity::TotalRss => request.force != [0.0; 3],
            _ => false,
        },
        lost: 0,
        values: Vec::new(),
    };
    out.values = vec![f32::NAN; nx * ny];
    let step = out.step();
    let (next, done, lost) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicUsize::new(0));
    let rows: Vec<std::sync::Mutex<&mut [f32]>> = out.values.chunks_mut(nx.max(1)).map(std::sync::Mutex::new).collect();
    let work = || {
        loop {
            let j = next.fetch_add(1, Ordering::Relaxed);
            let Some(row) = rows.get(j) else { break };
            let Ok(mut row) = row.lock() else { break };
            for (i, cell) in row.iter_mut().enumerate() {
                let mut p = [0.0; 3];
                p[request.plane.axis] = request.plane.at;
                p[a] = window[0].0 + i as f64 * step[0];
                p[b] = window[1].0 + j as f64 * step[1];
                if let Some(v) = probe.value(p, request, budget) {
                    *cell = v as f32;
                    lost.fetch_add(usize::from(v.is_nan()), Ordering::Relaxed);
                }
            }
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, ny);
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(16);
    std::thread::scope(|s| {
        (1..threads).for_each(|_| {
            s.spawn(work);
        });
        work();
    });
    drop(rows);
    out.lost = lost.into_inner();
    out
}

/// Volume of the work space, mm³, by layers of a grid. `progress` hears how many layers of how many are done.
pub fn volume(probe: &Probe<'_>, layers: usize, nodes: usize, progress: &dyn Fn(usize, usize)) -> f64 {
    let extent = probe.extent();
    let height = (extent[2].1 - extent[2].0) / layers.max(1) as f64;
    let budget = Budget::default();
    (0..layers)
        .map(|i| {
            let request = Request {
                quantity: Quantity::Workspace,
                plane: Plane { axis: 2, at: extent[2].0 + (i as f64 + 0.5) * height },
                size: (nodes, nodes),
                window: None,
                force: [0.0; 3],
                signs: None,
            };
            let area = map_of(probe, &budget, &request, &extent, &|_, _| {}).summary().map_or(0.0, |s| s.area);
            progress(i + 1, layers);
            area * height
        })
        .sum()
}

/// Places spread over a plane that are looked at to tell how long a map takes.
pub fn sample(probe: &Probe<'_>, budget: &Budget, request: &Request, count: usize) -> usize {
    let (a, b) = request.plane.axes();
    let extent = probe.extent();
    let window = request.window.unwrap_or([extent[a], extent[b]]);
    let one = |n: &u32| {
        let mut p = [0.0; 3];
        p[request.plane.axis] = request.plane.at;
        p[a] = window[0].0 + (window[0].1 - window[0].0) * halton(*n, 2);
        p[b] = window[1].0 + (window[1].1 - window[1].0) * halton(*n, 3);
        probe.value(p, request, budget).is_some()
    };
    (1..=u32::try_from(count).unwrap_or(u32::MAX)).filter(one).count()
}

/// The same for mean sensitivities.
pub fn sample_sensitivity(probe: &Probe<'_>, plane: Plane, count: usize) {
    let (a, b) = plane.axes();
    let extent = probe.extent();
    for n in 1..=u32::try_from(count).unwrap_or(u32::MAX) {
        let mut p = [0.0; 3];
        p[plane.axis] = plane.at;
        p[a] = extent[a].0 + (extent[a].1 - extent[a].0) * halton(n, 2);
        p[b] = extent[b].0 + (extent[b].1 - extent[b].0) * halton(n, 3);
        probe.sensitivity(p, true);
    }
}

/// Calls with every place of a grid in a plane of the work space, borders included.
fn nodes(probe: &Probe<'_>, plane: Plane, size: (usize, usize), progress: &dyn Fn(usize, usize), mut look: impl FnMut(V3)) {
    let (a, b) = plane.axes();
    let extent = probe.extent();
    let at = |e: (f64, f64), n: usize, of: usize| e.0 + (e.1 - e.0) * n as f64 / (of.max(2) - 1) as f64;
    for j in 0..size.1 {
        for i in 0..size.0 {
            let mut p = [0.0; 3];
            p[plane.axis] = plane.at;
            (p[a], p[b]) = (at(extent[a], i, size.0), at(extent[b], j, size.1));
            look(p);
        }
        progress(j + 1, size.1);
    }
}

/// Mean movement of the tool point per unit of each number of the geometry, over the nodes within reach: by axis and
/// in length, mm per mm or rad; none when nothing is within reach. `progress` hears how many rows of how many are done.
pub fn mean_sensitivity(
    probe: &Probe<'_>,
    plane: Plane,
    size: (usize, usize),
    progress: &dyn Fn(usize, usize),
) -> Option<Vec<(String, [f64; 4])>> {
    let names = probe.machine.parameters();
    let mut sums = vec![[0.0; 4]; names.len()];
    let mut count = 0usize;
    nodes(probe, plane, size, progress, |p| {
        let Some(s) = probe.sensitivity(p, true) else { return };
        count += 1;
        for (sum, c) in sums.iter_mut().zip(&s.geometry) {
            (0..3).for_each(|k| sum[k] += c[k].abs());
            sum[3] += norm(*c);
        }
    });
    let mean = |s: [f64; 4]| s.map(|v| v / count as f64);
    (count > 0).then(|| names.into_iter().zip(sums).map(|(p, s)| (p.name, mean(s))).collect())
}

/// The same as Gojtan 2009, equation 7.5, has it: mean change of the yaw, rad/mm, and of the arm's length, mm/mm. None
/// for other machines.
pub fn mean_sensitivity_usp2009(probe: &Probe<'_>, plane: Plane, size: (usize, usize)) -> Option<Vec<(String, [f64; 2])>> {
    let Chain::TwoLegs(k) = &probe.machine.chain else { return None };
    let names = probe.machine.parameters();
    let mut sums = vec![[0.0; 2]; names.len()];
    let mut count = 0usize;
    nodes(probe, plane, size, &|_, _| {}, |p| {
        let at = k.place_of(p);
        let Some(columns) = k.by_parameters(at).filter(|_| legs_reach(k, at)) else { return };
        count += 1;
        for (sum, c) in sums.iter_mut().zip(columns) {
            (0..2).for_each(|i| sum[i] += c[i].abs());
        }
    });
    let mean = |s: [f64; 2]| s.map(|v| v / count.max(1) as f64);
    Some(names.into_iter().zip(sums).map(|(p, s)| (p.name, mean(s))).collect())
}
