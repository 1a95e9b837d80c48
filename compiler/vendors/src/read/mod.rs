//! Readers: text of a robot language back to motion. They know nothing of the emitters, only of the languages; what
//! an emitter writes must mean the same motion here. They read the statements that robot programs made from paths
//! hold, not whole languages.

mod simple;
mod xml;

pub mod delmia;
pub mod denso;
pub mod fanuc;
pub mod inform;
pub mod kawasaki;
pub mod krl;
pub mod melfa;
pub mod nachi;
pub mod pdl2;
pub mod rapid;
pub mod spel;
pub mod urscript;
pub mod val3;
pub mod vplus;

use gr_machine::math::{Frame, M3, product, rot_x, rot_y, rot_z};
use gr_machine::{Chain, Machine};

/// A file: its name and its text.
pub type File = (String, String);

/// What a position says about how the arm stands there.
#[derive(Clone, PartialEq, Debug)]
pub enum Configuration {
    /// Nothing: as at the point before.
    Same,
    /// Quarter turns of joints 1, 4 and 6; which of eight ways, where that counts.
    Quadrants([i32; 3], u8),
    /// KUKA's status and turn.
    StatusTurn(u8, u8),
    /// FANUC: flip, up, front; turns of joints 4, 5, 6.
    Letters([bool; 3], [i32; 3]),
    /// Yaskawa: no-flip, lower, rear, R T S beyond half a turn.
    Rconf([u8; 6]),
    /// The solution nearest to these joint values, degrees or mm.
    Near(Vec<f64>),
}

/// A place the robot is sent to.
#[derive(Clone, PartialEq, Debug)]
pub struct Place {
    /// The tool in the work frame, mm.
    pub pose: Option<Frame>,
    /// Joint values as the controller counts them, degrees or mm.
    pub joints: Option<Vec<f64>>,
    /// How the arm stands.
    pub configuration: Configuration,
    /// The tool point on the flange; none = only the controller knows.
    pub tool: Option<Frame>,
    /// The work frame in the base; none = only the controller knows.
    pub frame: Option<Frame>,
}

/// What a statement does. Speeds in mm/s, zones in mm, times in s.
#[derive(Clone, PartialEq, Debug)]
pub enum Event {
    /// Joints move together.
    Joint(Place),
    /// A straight line.
    Linear(Place, f64, Option<f64>),
    /// An arc through the first place to the second.
    Arc(Place, Place, f64, Option<f64>),
    /// A straight line that ends where an input has a state; with the last, the program stops where it never has.
    Probe(Place, f64, String, bool, bool),
    /// An output takes a value.
    Set(String, f64),
    /// A routine is called, with a number.
    Call(String, Option<f64>),
    /// The program waits for an input.
    Wait(String, bool),
    /// The program waits.
    Dwell(f64),
}

/// What can't be read: line and reason.
pub type Fault = String;

/// All numbers of a text, in order.
pub(crate) fn numbers(text: &str) -> Vec<f64> {
    let mut out = Vec::new();
    let bytes = text.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        let name = i > 0 && (bytes[i - 1].is_ascii_alphanumeric() || bytes[i - 1] == b'_');
        let sign = matches!(bytes[i], b'-' | b'+');
        let start = bytes[i].is_ascii_digit() || (matches!(bytes[i], b'.') || sign) && bytes.get(i + 1).is_some_and(|b| b.is_ascii_digit() || *b == b'.');
        if !start || name {
            i += 1;
            continue;
        }
        let from = i;
        i += 1;
        while i < bytes.len() && (bytes[i].is_ascii_digit() || bytes[i] == b'.') {
            i += 1;
        }
        if i + 1 < bytes.len() && matches!(bytes[i], b'E' | b'e') && (bytes[i + 1].is_ascii_digit() || bytes[i + 1] == b'-') {
            i += 2;
            while i < bytes.len() && bytes[i].is_ascii_digit() {
                i += 1;
            }
        }
        out.extend(text[from..i].parse::<f64>());
    }
    out
}

/// The number after a word: `X` in `X 12.5`, `V=` in `V=12.5`.
pub(crate) fn after(text: &str, word: &str) -> Option<f64> {
    let at = text.find(word)? + word.len();
    numbers(text[at..].trim_start_matches([' ', '=', ':', '"'])).first().copied()
}

/// The text between two marks.
pub(crate) fn between<'t>(text: &'t str, open: &str, close: &str) -> Option<&'t str> {
    let from = text.find(open)? + open.len();
    let to = text[from..].find(close)? + from;
    text.get(from..to)
}

/// R = Rz(z)·Ry(y)·Rx(x), degrees.
pub(crate) fn fixed(x: f64, y: f64, z: f64) -> M3 {
    product(&rot_z(z.to_radians()), &product(&rot_y(y.to_radians()), &rot_x(x.to_radians())))
}

/// R = Rz(a)·Ry(b)·Rz(c), degrees.
pub(crate) fn zyz(a: f64, b: f64, c: f64) -> M3 {
    product(&rot_z(a.to_radians()), &product(&rot_y(b.to_radians()), &rot_z(c.to_radians())))
}

/// A frame of six numbers and the meaning of the last three.
pub(crate) fn frame(values: &[f64], turn: impl Fn(f64, f64, f64) -> M3) -> Option<Frame> {
    match *values {
        [x, y, z, a, b, c, ..] => Some(Frame { turn: turn(a, b, c), position: [x, y, z] }),
        _ => None,
    }
}

impl Place {
    pub(crate) fn of_joints(joints: Vec<f64>) -> Place {
        Place { pose: None, joints: Some(joints), configuration: Configuration::Same, tool: None, frame: None }
    }
    pub(crate) fn of_pose(pose: Frame, configuration: Configuration, tool: Option<Frame>, frame: Option<Frame>) -> Place {
        Place { pose: Some(pose), joints: None, configuration, tool, frame }
    }

    /// Joint values (rad, mm, the machine's own) that the place means, from where the arm was before; `tool` and
    /// `frame` where only the controller knows them.
    pub fn resolve(&self, machine: &Machine, before: &[f64], tool: &Frame, frame: &Frame) -> Option<Vec<f64>> {
        if let Some(joints) = &self.joints {
            let inner: Vec<f64> = joints.iter().zip(&machine.joints).map(|(v, j)| inner(*v, j)).collect();
            return Some(machine.joint_values(&inner));
        }
        let (tool, frame) = (self.tool.unwrap_or(*tool), self.frame.unwrap_or(*frame));
        let flange = frame.then(&self.pose?).then(&tool.inverse());
        let all = machine.kinematics().inverse_frame(&flange).ok()?;
        // A straight move keeps the way the arm stands.
        let kept = if self.configuration == Configuration::Same { way_of(machine, before) } else { None };
        let mut best: Option<(f64, Vec<f64>)> = None;
        for s in all {
            let mut joints = s.joints.clone();
            let mut cost = self.posture_cost(machine, s.branch, &joints);
            cost += if kept.is_some_and(|k| k != s.branch) { 1e6 } else { 0.0 };
            for i in 0..joints.len() {
                let (turned, off) = self.best_turn(machine, i, joints[i], before);
                joints[i] = turned;
                cost += off;
            }
            if best.as_ref().is_none_or(|b| cost < b.0) {
                best = Some((cost, joints));
            }
        }
        best.map(|b| b.1)
    }

    /// How badly one of the ways an arm can stand fits what the place says.
    fn posture_cost(&self, machine: &Machine, branch: u8, joints: &[f64]) -> f64 {
        if !matches!(machine.chain, Chain::Opw(_)) {
            return 0.0;
        }
        // Numbers of branches: 4 = the arm reaches over backwards, 2 = the second elbow, 1 = the wrist flipped.
        let (behind, forward) = (branch & 4 != 0, branch & 2 == 0);
        let wrist = joints.get(4).is_some_and(|v| *v < 0.0);
        let wrong = |a: bool, b: bool| if a == b { 0.0 } else { 1e6 };
        match &self.configuration {
            Configuration::Quadrants(_, way) if machine.cell.coupling.is_none() => {
                wrong(way & 4 != 0, behind) + wrong(way & 2 != 0, !forward) + wrong(way & 1 != 0, wrist)
            }
            // A parallelogram keeps the elbow on one side.
            Configuration::Quadrants(..) => wrong(true, forward),
            Configuration::StatusTurn(s, _) => {
                wrong(s & 1 != 0, behind) + wrong(s & 2 != 0, forward) + wrong(s & 4 != 0, wrist)
            }
            Configuration::Letters([flip, up, front], _) => {
                wrong(*flip, !wrist) + wrong(*front, !behind) + wrong(*up, forward != behind)
            }
            Configuration::Rconf(r) => wrong(r[1] == 1, forward == behind) + wrong(r[2] == 1, behind),
            Configuration::Same | Configuration::Near(_) => 0.0,
        }
    }

    /// A joint's value with the whole turns that fit best, and how badly it fits, degrees.
    fn best_turn(&self, machine: &Machine, i: usize, value: f64, before: &[f64]) -> (f64, f64) {
        if machine.joints.get(i).is_none_or(|j| j.kind == gr_machine::JointKind::Prismatic) {
            return (value, 0.0);
        }
        let one = |k: i32| value + f64::from(k) * 2.0 * std::f64::consts::PI;
        let cost = |v: f64| self.joint_cost(i, v.to_degrees(), before.get(i).map_or(0.0, |b| b.to_degrees()));
        let best = (-3..=3).map(one).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(value);
        (best, cost(best))
    }

    fn joint_cost(&self, i: usize, v: f64, before: f64) -> f64 {
        let outside = |low: f64, high: f64| (low - v).max(v - high).max(0.0);
        let small = v.abs() * 1e-6;
        match &self.configuration {
            Configuration::Same => (v - before).abs(),
            Configuration::Near(near) => near.get(i).map_or(0.0, |n| (v - n).abs()),
            Configuration::Quadrants(q, _) => match [0, 3, 5].iter().position(|k| *k == i) {
                Some(k) => outside(f64::from(q[k]) * 90.0, f64::from(q[k]) * 90.0 + 90.0) + small,
                None => small,
            },
            Configuration::StatusTurn(_, t) => {
                if t >> i & 1 == 1 { outside(-360.0, 0.0) + small } else { outside(0.0, 360.0) + small }
            }
            Configuration::Letters(_, turns) if i >= 3 => {
                let middle = 360.0 * f64::from(turns[i - 3]);
                outside(middle - 180.0, middle + 180.0) + small
            }
            Configuration::Rconf(r) => rconf_cost(r, i, v) + small,
            Configuration::Letters(..) => small,
        }
    }
}

/// Which of the ways an arm can stand these joint values are.
fn way_of(machine: &Machine, joints: &[f64]) -> Option<u8> {
    let kinematics = machine.kinematics();
    let all = kinematics.inverse_frame(&kinematics.forward_frame(joints).ok()?).ok()?;
    let off = |v: &[f64]| -> f64 {
        let turn = std::f64::consts::TAU;
        v.iter().zip(joints).map(|(a, b)| (a - b) - turn * libm::round((a - b) / turn)).map(f64::abs).sum()
    };
    all.iter().min_by(|a, b| off(&a.joints).total_cmp(&off(&b.joints))).map(|s| s.branch)
}

fn rconf_cost(r: &[u8; 6], i: usize, v: f64) -> f64 {
    let far = v > 180.0 || v <= -180.0;
    let side = |bit: u8| if (bit == 1) == far { 0.0 } else { 400.0 };
    match i {
        0 => side(r[5]),
        5 => side(r[4]),
        3 => {
            let quarter = v.rem_euclid(360.0);
            let flip = !(90.0 < quarter && quarter <= 270.0);
            side(r[3]) + if flip == (r[0] == 0) { 0.0 } else { 400.0 }
        }
        _ => 0.0,
    }
}

fn inner(value: f64, joint: &gr_machine::Joint) -> f64 {
    if joint.kind == gr_machine::JointKind::Revolute { value.to_radians() } else { value }
}

/// The reader of a target.
pub fn read(target: &str, files: &[File]) -> Result<Vec<Event>, Fault> {
    match target {
        "rapid" => rapid::read(files),
        "krl" => krl::read(files),
        "fanuc-ls" => fanuc::read(files),
        "urscript" => urscript::read(files),
        "inform" => inform::read(files),
        "val3" => val3::read(files),
        "delmia-xml" => delmia::read(files),
        "vplus" => vplus::read(files),
        "kawasaki-as" => kawasaki::read(files),
        "pdl2" => pdl2::read(files),
        "denso-pac" => denso::read(files),
        "melfa" => melfa::read(files),
        "spel" => spel::read(files),
        "nachi" => nachi::read(files),
        other => Err(format!("no reader for {other}")),
    }
}

/// The file with this ending that no other file calls: the last one.
pub(crate) fn main_file<'f>(files: &'f [File], ending: &str) -> Result<&'f File, Fault> {
    files.iter().rev().find(|f| f.0.ends_with(ending)).ok_or_else(|| format!("no file *{ending}"))
}

/// The file of this name.
pub(crate) fn named<'f>(files: &'f [File], name: &str) -> Option<&'f File> {
    files.iter().find(|f| f.0 == name)
}

/// What stands in front of a remark.
pub(crate) fn without_remark<'t>(line: &'t str, mark: &str) -> &'t str {
    line.split(mark).next().unwrap_or("").trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_a_text() {
        assert_eq!(numbers("P[3] X=-1.5,Y .25 a12 9E9 +4"), [3.0, -1.5, 0.25, 9e9, 4.0]);
        assert_eq!(after("X =   100.000  mm", "X"), Some(100.0));
        assert_eq!(between("a(b)c", "(", ")"), Some("b"));
    }
}
