use crate::math::{Frame, V3, norm, scale};
use crate::identify::offset_wrist;
use crate::{JointKind, Link, ParallelWrist, Pose, Serial, identify};
use std::fmt::Write as _;
use urdf_rs::JointType;

/// A machine file made from a URDF.
#[derive(Clone, PartialEq, Debug)]
pub struct Import {
    /// The machine file.
    pub toml: String,
    /// The chain of joints it was made from.
    pub chain: Serial,
    /// Why it has no closed form, or what else the user should know.
    pub notes: Vec<String>,
}

/// Makes a machine file of a URDF: the chain of joints from the base to the link `tip`, or without one to the end of the arm. An arm with an ortho-parallel base
/// and a spherical wrist gets OPW lengths, one with an offset wrist as Universal Robots' those of `ur`, every other one its joint
/// frames and the numerical inverse. A link `base` beside `base_link` is the frame the controller counts from.
pub fn import_urdf(id: &str, text: &str, tip: Option<&str>) -> Result<Import, String> {
    let robot = urdf_rs::read_from_string(text).map_err(|e| format!("the file is no URDF: {e}"))?;
    let mut notes = Vec::new();
    let path = to_tool(&robot, tip, &mut notes)?;
    let base = controller_base(&robot, &path)?;
    let stand = standing(&path);
    let stands = path[..stand].iter().fold(Frame::IDENTITY, |f, j| f.then(&placed(j)));
    let mut base = base.map(|b| stands.inverse().then(&b));
    let (links, names, speeds, tip) = chain(&path[stand..], &mut notes)?;
    let chain = Serial::new(links, tip);
    if path.iter().any(|j| j.mimic.is_some()) {
        notes.push("joints that imitate others are taken as joints of their own".to_string());
    }
    let mut toml = format!("# Made from the URDF `{}`. Lengths in mm, angles in degrees, time in seconds.\n", robot.name);
    let title = robot.name.replace(['"', '\\', '\n'], " ");
    let _ = write!(toml, "format = 1\nid = \"{id}\"\ntitle = \"{title}\"\nkind = \"robot\"\nsource = \"URDF {title}\"\norientation = \"abc-euler-xyz\"\n\n[kinematics]\n");
    let closed = |fit: &crate::Fit, before: &str| {
        let list = |v: &[f64]| v.iter().map(|x| tidy(*x)).collect::<Vec<_>>().join(", ");
        let (lengths, offsets, signs) = (list(&fit.arm.lengths()), list(&fit.arm.offsets().map(f64::to_degrees)), list(&fit.arm.signs()));
        format!("{before}kind = \"opw\"\n# a1 a2 b c1 c2 c3 c4\n{before}lengths = [{lengths}]\n{before}offsets = [{offsets}]\n{before}signs = [{signs}]\n")
    };
    match identify(&chain) {
        Ok(fit) if fit.flange == Frame::IDENTITY => {
            toml += &closed(&fit, "");
            joints(&mut toml, &chain, &names, &speeds, false);
        }
        other => match from_controller(&chain, base) {
            Some((arm, from)) => {
                let list = arm.lengths().map(tidy).join(", ");
                let _ = writeln!(toml, "kind = \"ur\"\n# d1 a2 a3 d4 d5 d6\nlengths = [{list}]");
                joints(&mut toml, &chain, &names, &speeds, false);
                if !same(&from, &Frame::IDENTITY) {
                    notes.push(format!("the base of the machine file is the controller's, which lies at [{}] (mm, degrees) in the first link of the URDF: give frames and parts as the robot's panel counts them", place(&from)));
                }
                base = None;
            }
            None => {
                notes.push(match &other {
                    Ok(_) => "its last link is turned against the tool flange of the closed form (Z out of it); its joint frames are kept. Robot languages need the closed form: \
                              import to the link `tool0`, if there is one (`--tip`), or take the lines `# kind = \"opw\"` in the file, if the flange of the robot's panel is turned as theirs"
                        .to_string(),
                    Err(why) => format!("no closed form: {why}; its dimensions are not those of `kind = \"ur\"` either; inverse kinematics will search"),
                });
                toml += &other.as_ref().map_or(String::new(), |fit| closed(fit, "# "));
                let _ = writeln!(toml, "kind = \"origins\"\ntip = [{}]", place(chain.tip()));
                joints(&mut toml, &chain, &names, &speeds, true);
            }
        },
    }
    if !same(&stands, &Frame::IDENTITY) {
        let (pose, link) = (Pose::from_frame(&stands), &path[stand - 1].child.link);
        let list = |v: V3| v.map(tidy).join(", ");
        let _ = write!(toml, "\n# The link `{link}` in the first link of the URDF.\n[frames.base]\nposition = [{}]\nrotation = [{}]\n", list(pose.position), list(pose.rotation.map(f64::to_degrees)));
        notes.push(format!("the arm stands on the link `{link}`, at [{}] (mm, degrees) in the first link of the URDF: the machine file counts from there, give table and frames so; `[frames.base]` only says where that is", place(&stands)));
    }
    if let Some(base) = base.filter(|b| !same(b, &Frame::IDENTITY)) {
        let pose = Pose::from_frame(&base);
        let list = |v: V3| v.map(tidy).join(", ");
        let _ = write!(toml, "\n# The link `base`: where the controller counts from.\n[frames.controller]\n");
        let _ = write!(toml, "position = [{}]\nrotation = [{}]\n", list(pose.position), list(pose.rotation.map(f64::to_degrees)));
        notes.push(format!("its controller counts from the link `base`, at [{}] (mm, degrees): see `[frames.controller]`", place(&base)));
    }
    Ok(Import { toml, chain, notes })
}

/// The arm with an offset wrist that a chain is, and the base it is so seen from: the controller's, and where the file has none,
/// the root or the root turned by half a turn, as in the files of Universal Robots.
fn from_controller(chain: &Serial, base: Option<Frame>) -> Option<(ParallelWrist, Frame)> {
    let turned = Frame::new([0.0; 3], [0.0, 0.0, std::f64::consts::PI]);
    let bases = base.map_or(vec![Frame::IDENTITY, turned], |b| vec![b]);
    bases.into_iter().find_map(|b| Some((offset_wrist(chain, &b)?, b)))
}

/// The link `base` of an arm whose own first link is `base_link` (ROS-Industrial's names, both with the same prefix), seen from
/// the root: where the controller counts from.
fn controller_base(robot: &urdf_rs::Robot, path: &[&urdf_rs::Joint]) -> Result<Option<Frame>, String> {
    let Some(root) = path.first().map(|j| j.parent.link.as_str()) else { return Ok(None) };
    let standing = path.iter().take_while(|j| !moves(j)).map(|j| j.child.link.as_str());
    for link in std::iter::once(root).chain(standing) {
        let Some(name) = link.strip_suffix("_link").filter(|n| n.ends_with("base")) else { continue };
        if !robot.links.iter().any(|l| l.name == name) {
            continue;
        }
        let way = path_to(robot, name)?;
        let from_root = way.first().map_or(name, |j| j.parent.link.as_str()) == root;
        if from_root && !way.iter().any(|j| moves(j)) {
            return Ok(Some(way.iter().fold(Frame::IDENTITY, |f, j| f.then(&placed(j)))));
        }
    }
    Ok(None)
}

/// How many joints lead from the root to the arm's own first link, called `base_link` (ROS-Industrial's name) where the root is something
/// else: the floor, a pedestal or a ceiling.
fn standing(path: &[&urdf_rs::Joint]) -> usize {
    let fixed = path.iter().take_while(|j| !moves(j));
    fixed.enumerate().filter(|(_, j)| j.child.link.ends_with("base_link")).map(|(i, _)| i + 1).last().unwrap_or(0)
}

fn same(a: &Frame, b: &Frame) -> bool {
    let (p, r) = a.error_to(b);
    norm(p) < 1e-6 && norm(r) < 1e-9
}

/// Where a joint is on its parent.
fn placed(joint: &urdf_rs::Joint) -> Frame {
    let (xyz, rpy): (V3, V3) = (*joint.origin.xyz, *joint.origin.rpy);
    Frame { turn: square(rpy), position: scale(xyz, 1000.0) }
}

fn joints(toml: &mut String, chain: &Serial, names: &[String], speeds: &[f64], origins: bool) {
    for ((link, name), speed) in chain.links().iter().zip(names).zip(speeds) {
        let turns = link.kind == JointKind::Revolute;
        let unit = |v: f64| tidy(if turns { v.to_degrees() } else { v });
        let kind = if turns { "revolute" } else { "prismatic" };
        let _ = write!(toml, "\n[[joint]]\nname = \"{name}\"\ntype = \"{kind}\"\n");
        if link.limits.0.is_finite() && link.limits.1.is_finite() {
            let _ = write!(toml, "min = {}\nmax = {}\n", unit(link.limits.0), unit(link.limits.1));
        }
        if *speed > 0.0 {
            let _ = writeln!(toml, "speed = {}", unit(*speed));
        }
        if origins {
            let axis = link.axis.map(tidy).join(", ");
            let _ = writeln!(toml, "origin = [{}]\naxis = [{axis}]", place(&link.origin));
        }
    }
}

fn place(f: &Frame) -> String {
    let p = Pose::from_frame(f);
    let all = [p.position, p.rotation.map(f64::to_degrees)].concat();
    all.into_iter().map(tidy).collect::<Vec<_>>().join(", ")
}

/// A number with what rounding left over taken away.
fn tidy(v: f64) -> String {
    let near = libm::round(v * 1e9) / 1e9;
    if near == 0.0 { "0".into() } else { format!("{near}") }
}

/// The joints from the root to the tool: to the link that is named, else as [`longest`] has it. Moving joints that are not
/// among them are told.
fn to_tool<'r>(robot: &'r urdf_rs::Robot, tip: Option<&str>, notes: &mut Vec<String>) -> Result<Vec<&'r urdf_rs::Joint>, String> {
    let path = match tip {
        Some(tip) if !robot.links.iter().any(|l| l.name == tip) => {
            let links: Vec<&str> = robot.links.iter().map(|l| l.name.as_str()).collect();
            return Err(format!("it has no link `{tip}`; its links are {}", links.join(", ")));
        }
        Some(tip) => path_to(robot, tip)?,
        None => longest(robot)?,
    };
    if !path.iter().any(|j| moves(j)) {
        return Err("it has no moving joint".into());
    }
    let within = |joint: &urdf_rs::Joint| path.iter().any(|j| j.name == joint.name);
    let left: Vec<&str> = robot.joints.iter().filter(|j| moves(j) && !within(j)).map(|j| j.name.as_str()).collect();
    if let (Some(last), false) = (path.last(), left.is_empty()) {
        notes.push(format!("the arm ends at the link `{}`; left out: {}; `--tip LINK` names another end", last.child.link, left.join(", ")));
    }
    Ok(path)
}

/// The joints from the root to a link.
fn path_to<'r>(robot: &'r urdf_rs::Robot, link: &str) -> Result<Vec<&'r urdf_rs::Joint>, String> {
    let mut path: Vec<&urdf_rs::Joint> = Vec::new();
    let mut at = link;
    while let Some(joint) = robot.joints.iter().find(|j| j.child.link == at) {
        path.push(joint);
        at = joint.parent.link.as_str();
        if path.len() > robot.joints.len() {
            return Err(format!("the joints around `{at}` go in a circle"));
        }
    }
    path.reverse();
    Ok(path)
}

/// The joints from the root to the end of the arm: a link called `tool0` or `flange` behind six moving joints or more, which
/// fingers of a gripper follow in some files; else the leaf with the most moving ones.
fn longest(robot: &urdf_rs::Robot) -> Result<Vec<&urdf_rs::Joint>, String> {
    const ARM: usize = 6;
    let mut best: Vec<&urdf_rs::Joint> = Vec::new();
    let score = |path: &[&urdf_rs::Joint]| {
        let leaf = path.last().map_or("", |j| j.child.link.as_str());
        let named = if leaf.ends_with("tool0") { 2 } else { usize::from(leaf.contains("flange")) };
        let moving = path.iter().filter(|j| moves(j)).count();
        (if moving >= ARM { named } else { 0 }, moving, named, path.len())
    };
    for link in &robot.links {
        let path = path_to(robot, &link.name)?;
        if score(&path) > score(&best) {
            best = path;
        }
    }
    Ok(best)
}

fn moves(joint: &urdf_rs::Joint) -> bool {
    matches!(joint.joint_type, JointType::Revolute | JointType::Continuous | JointType::Prismatic)
}

type Parts = (Vec<Link>, Vec<String>, Vec<f64>, Frame);

fn chain(path: &[&urdf_rs::Joint], notes: &mut Vec<String>) -> Result<Parts, String> {
    let (mut links, mut names, mut speeds) = (Vec::new(), Vec::new(), Vec::new());
    let mut here = Frame::IDENTITY;
    for joint in path {
        here = here.then(&placed(joint));
        if joint.joint_type == JointType::Fixed {
            continue;
        }
        if !moves(joint) {
            return Err(format!("joint `{}` is of a type that no machine has", joint.name));
        }
        let turns = joint.joint_type != JointType::Prismatic;
        let size = if turns { 1.0 } else { 1000.0 };
        let axis: V3 = *joint.axis.xyz;
        if norm(axis) < 1e-9 || !here.is_finite() {
            return Err(format!("joint `{}` has no axis or no place", joint.name));
        }
        let (lower, upper) = (joint.limit.lower, joint.limit.upper);
        let continuous = joint.joint_type == JointType::Continuous;
        if !continuous && !(lower <= upper && lower.is_finite() && upper.is_finite()) {
            return Err(format!("joint `{}` has the lower limit {lower} and the upper limit {upper}: correct its <limit>", joint.name));
        }
        // Without a <limit>, both are 0.
        let free = continuous || lower == upper;
        if free && !continuous {
            notes.push(format!("joint `{}` has no limits; add `min` and `max` to the machine file", joint.name));
        }
        if !joint.limit.velocity.is_finite() || joint.limit.velocity < 0.0 {
            return Err(format!("joint `{}` has the speed limit {}: correct its <limit>", joint.name, joint.limit.velocity));
        }
        let limits = if free { (f64::NEG_INFINITY, f64::INFINITY) } else { (joint.limit.lower * size, joint.limit.upper * size) };
        let kind = if turns { JointKind::Revolute } else { JointKind::Prismatic };
        links.push(Link { origin: here, axis: scale(axis, 1.0 / norm(axis)), kind, limits });
        names.push(joint.name.replace(['"', '\\', '\n'], "_"));
        speeds.push(joint.limit.velocity * size);
        here = Frame::IDENTITY;
    }
    Ok((links, names, speeds, here))
}

/// A turn; URDF files write quarter turns with few digits (1.5708), which are made whole.
fn square(rpy: V3) -> crate::math::M3 {
    const QUARTER: f64 = std::f64::consts::FRAC_PI_2;
    let whole = |v: f64| {
        let n = libm::round(v / QUARTER);
        if (v - n * QUARTER).abs() < 1e-5 { n * QUARTER } else { v }
    };
    let rpy = rpy.map(whole);
    let mut turn = crate::math::euler(rpy);
    if rpy.iter().all(|v| v % QUARTER == 0.0) {
        turn.iter_mut().flatten().for_each(|v| *v = libm::round(*v));
    }
    turn
}
