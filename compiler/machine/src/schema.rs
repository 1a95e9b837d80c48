//! The machine file: what it may hold, and what is wrong with it when it doesn't.

use crate::cell::{Cell, Controller, Coupling, External, MACHINE_ZERO, Rapid, Signal, Spindle, ToolData, Zones};
use crate::five_axis::{Carrier, FiveAxis, Rotary};
use crate::keys::{self, ROOT, suggestion};
use crate::math::{Frame, norm, scale};
use crate::prp::{SphericalAxis, TwoLegs, TwoLegsShape};
use crate::tree::{self, Node};
use crate::{
    Chain, DhRow, Joint, JointKind, Kind, Link, Machine, Opw, Orientation, ParallelWrist, Pose, Scara, Serial, Tricept,
    TriceptShape,
};
use gr_text::{Diagnostic, FileId, Span, code};
use std::ops::Range;

mod quality;

/// Reads a machine file. Every fault found is in the list.
pub fn parse(file: FileId, text: &str) -> Result<Machine, Vec<Diagnostic>> {
    parse_as(file, text, false)
}

/// The same, with the file's `[reference]` laid over it: the model as its publication has it.
pub fn parse_reference(file: FileId, text: &str) -> Result<Machine, Vec<Diagnostic>> {
    parse_as(file, text, true)
}

fn parse_as(file: FileId, text: &str, reference: bool) -> Result<Machine, Vec<Diagnostic>> {
    let mut check = Check { file, found: Vec::new() };
    let mut root = match tree::read(text) {
        Ok(root) => root,
        Err(e) => return Err(vec![syntax(file, &e)]),
    };
    check.own_keys(&root);
    check.extend(&mut root);
    if !check.found.is_empty() {
        return Err(check.found);
    }
    for (place, message) in keys::faults(&root, ROOT, "a machine file") {
        check.found.push(Diagnostic::new(code::MACHINE_BAD_FILE, file, span(place), &[message]));
    }
    if !check.found.is_empty() {
        return Err(check.found);
    }
    let Some(overlay) = root.remove("reference") else {
        let machine = check.machine(&root);
        return if check.found.is_empty() { Ok(machine) } else { Err(check.found) };
    };
    let mut machine = check.machine(&root);
    if !check.found.is_empty() && !reference {
        return Err(check.found);
    }
    check.found.clear();
    root.overlay(overlay);
    let published = check.machine(&root);
    if !check.found.is_empty() {
        return Err(check.found);
    }
    if reference {
        return Ok(published);
    }
    machine.published = Some(Box::new(published));
    Ok(machine)
}

fn span(range: Range<usize>) -> Span {
    let clip = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
    Span::new(clip(range.start), clip(range.end))
}

fn syntax(file: FileId, error: &toml::de::Error) -> Diagnostic {
    let place = error.span().map(span).unwrap_or_default();
    let message = error.message().trim().replace('\n', "; ");
    Diagnostic::new(code::MACHINE_BAD_FILE, file, place, &[message])
}

/// A kind of kinematics: keys it needs, keys it may have, its joints (`R`, `P`; empty = any).
struct KindRow {
    name: &'static str,
    needs: &'static [&'static str],
    may: &'static [&'static str],
    joints: &'static str,
    words: &'static str,
}

const KINDS: &[KindRow] = &[
    KindRow { name: "cartesian", needs: &[], may: &[], joints: "", words: "one to nine joints, X Y Z U V W prismatic, A B C revolute" },
    KindRow { name: "planar-3r", needs: &["links"], may: &[], joints: "RRR", words: "three revolute joints" },
    KindRow { name: "scara", needs: &["links", "height"], may: &[], joints: "RRPR", words: "four joints: revolute, revolute, prismatic, revolute" },
    KindRow { name: "opw", needs: &["lengths"], may: &["offsets", "signs"], joints: "RRRRRR", words: "six revolute joints" },
    KindRow { name: "ur", needs: &["lengths"], may: &[], joints: "RRRRRR", words: "six revolute joints" },
    KindRow { name: "five-axis", needs: &["rotary"], may: &["pivot"], joints: "PPPRR", words: "five joints: three prismatic, two revolute" },
    KindRow {
        name: "parallel-2ups-prp",
        needs: &["base_joints", "platform_joints", "arm", "yaw", "universal", "spherical"],
        may: &["spherical_axis", "reference_pose"],
        joints: "PPP",
        words: "three prismatic joints: two legs and the column",
    },
    KindRow {
        name: "tricept",
        needs: &["base_radius", "platform_radius", "wrist_offset", "flange_offset"],
        may: &["first_leg", "model"],
        joints: "PPPRRR",
        words: "six joints: three prismatic legs, three revolute wrist axes",
    },
    KindRow { name: "dh", needs: &[], may: &["tip"], joints: "", words: "one to twelve joints, each with `dh`" },
    KindRow { name: "mdh", needs: &[], may: &["tip"], joints: "", words: "one to twelve joints, each with `dh`" },
    KindRow { name: "origins", needs: &[], may: &["tip"], joints: "", words: "one to twelve joints, each with `origin` and `axis`" },
];

/// No machine has more joints, external axes included: what is planned has room for so many values in every point.
pub const MOST_JOINTS: usize = 12;

struct Check {
    file: FileId,
    found: Vec<Diagnostic>,
}

impl Check {
    fn fault(&mut self, code: gr_text::Code, place: &Range<usize>, args: &[String]) {
        self.found.push(Diagnostic::new(code, self.file, span(place.clone()), args));
    }

    fn value(&mut self, place: &Range<usize>, message: impl Into<String>) {
        self.fault(code::MACHINE_BAD_VALUE, place, &[message.into()]);
    }

    /// What a file that extends another must say itself: the other's format and name are not its own.
    fn own_keys(&mut self, root: &Node) {
        let Some(extends) = root.get("extends") else { return };
        let said = |name: &str| root.get(name).is_some() || keys::misspelt(root, ROOT, name);
        for key in ROOT.iter().filter(|k| matches!(k.name, "format" | "id") && !said(k.name)) {
            let message = format!("`{}` is missing in a machine file: {}", key.name, key.doc);
            self.fault(code::MACHINE_BAD_FILE, &extends.span, &[message]);
        }
        // Own numbers with the source of another's would be a false witness.
        for key in ["accuracy", "stiffness", "as_built"] {
            let said = |t: &Node| t.get("source").is_some() || keys::misspelt(t, keys::of_table(key), "source");
            if let Some(table) = root.get(key).filter(|t| !said(t)) {
                let message = format!("`source` is missing in `[{key}]`: the numbers are this file's, not those of the machine that it extends");
                self.fault(code::MACHINE_BAD_FILE, &table.span, &[message]);
            }
        }
    }

    /// Lays the file over the built-in machine it extends. Built-in files extend at most one other.
    fn extend(&mut self, root: &mut Node) {
        let Some(word) = root.get("extends").cloned() else { return };
        let Some(id) = word.text() else { return };
        let known: Vec<&str> = crate::list().collect();
        let Some(base) = crate::source(id).and_then(|text| tree::read(text).ok()) else {
            let hint = suggestion(id, &known).map_or("`gcc-robot machine list` shows the ids".into(), |s| format!("did you mean `{s}`?"));
            self.fault(code::MACHINE_EXTENDS, &word.span, &[id.to_string(), hint]);
            root.remove("extends");
            return;
        };
        let mut base = base;
        base.moved_to(&word.span);
        base.remove("template");
        if base.get("extends").is_some() {
            self.extend(&mut base);
        }
        self.joints_of_base(id, &base, root);
        let over = std::mem::replace(root, base);
        root.overlay(over);
    }

    /// An arm has the joints that it has: one of another name in a file that extends it is a slip of the pen.
    fn joints_of_base(&mut self, id: &str, base: &Node, over: &mut Node) {
        let kind = base.get("kinematics").and_then(|k| k.string("kind"));
        let fixed = KINDS.iter().any(|k| Some(k.name) == kind.as_deref() && !k.joints.is_empty());
        if !fixed || over.get("kinematics").is_some_and(|k| k.get("kind").is_some()) {
            return;
        }
        let list = |n: &Node| n.get("joint").map_or(Vec::new(), |j| j.list().to_vec());
        let all: Vec<String> = list(base).iter().filter_map(|j| j.string("name")).collect();
        let names: Vec<&str> = all.iter().map(String::as_str).collect();
        for name in list(over).iter().filter_map(|j| j.get("name")) {
            let text = name.text().unwrap_or_default();
            if !names.contains(&text) {
                let hint = suggestion(text, &names).map_or(format!("; its joints are {}", names.join(", ")), |s| format!("; did you mean `{s}`?"));
                self.value(&name.span, format!("`{id}` has no joint `{text}`{hint}"));
            }
        }
    }

    fn machine(&mut self, raw: &Node) -> Machine {
        let mut pruned = raw.clone();
        let bad = keys::out_of_bounds(raw, ROOT);
        let geometry = raw.get("kinematics").is_some_and(|k| bad.iter().any(|(place, _)| keys::holds(k, place)));
        if !bad.is_empty() {
            keys::without(&mut pruned, &bad.iter().map(|(place, _)| place.clone()).collect::<Vec<_>>());
        }
        for (place, message) in bad {
            self.value(&place, message);
        }
        let raw = &pruned;
        if let Some(format) = raw.get("format")
            && format.number() != Some(1.0)
        {
            self.value(&format.span, format!("format {} is not known; this program reads 1", format.number().unwrap_or(0.0)));
        }
        let id = raw.get("id");
        if let Some(id) = id.filter(|id| !id.text().is_some_and(good_id)) {
            self.value(&id.span, ID_FORM);
        }
        let list = raw.get("joint").map_or(&[][..], Node::list);
        let joints: Vec<Joint> = list.iter().map(|j| self.joint(j)).collect();
        self.names(list);
        let told = self.found.len();
        let chain = self.chain(raw, list, &joints);
        if geometry {
            // What else is wrong with the geometry follows from the number that was told.
            self.found.truncate(told);
        }
        let machine = self.built(raw, joints, chain);
        self.structure(raw, &machine);
        if self.found.is_empty() {
            self.start_agrees(raw, &machine);
        }
        machine
    }

    /// The machine that rotary words are meant for is a mill of the library that turns.
    fn source_machine(&mut self, raw: &Node) {
        let Some(node) = raw.get("orientation") else { return };
        let Some(id) = node.text().and_then(|o| o.strip_prefix("source-machine:")) else { return };
        match crate::builtin(id).map(|m| matches!(m.chain, Chain::FiveAxis(_))) {
            Some(true) => {}
            Some(false) => self.value(&node.span, format!("`{id}` is no mill with two rotary axes, which A B C could be meant for")),
            None => self.value(&node.span, format!("the library has no machine `{id}`; `gcc-robot machine list` shows the ids")),
        }
    }

    fn built(&mut self, raw: &Node, joints: Vec<Joint>, chain: Chain) -> Machine {
        self.source_machine(raw);
        let orientation = raw.get("orientation").and_then(Node::text).map(|o| match o {
            "fixed" => Orientation::Fixed,
            "abc-euler-xyz" => Orientation::AbcEulerXyz,
            other => Orientation::SourceMachine(other.trim_start_matches("source-machine:").to_string()),
        });
        let start = raw.get("start");
        let place = |key: &str| start.and_then(|s| s.array::<3>(key)).unwrap_or_default();
        let start_joints = start.and_then(|s| s.get("joints")).and_then(|given| self.joint_values(given, &joints, "start"));
        let cell = self.cell(raw, &joints);
        if let Some(external) = raw.get("external").filter(|_| !cell.external.is_empty() && joints.len() + cell.external.len() > MOST_JOINTS) {
            let what = format!("{} joints and {} external axes: together there can be at most {MOST_JOINTS}", joints.len(), cell.external.len());
            self.value(&external.span, what);
        }
        let mut machine = Machine {
            id: raw.string("id").unwrap_or_default(),
            title: raw.string("title").unwrap_or_default(),
            kind: match raw.get("kind").and_then(Node::text) {
                Some("lathe") => Kind::Lathe,
                Some("robot") => Kind::Robot,
                _ => Kind::Mill,
            },
            source: raw.string("source").unwrap_or_default(),
            orientation,
            start: Pose { position: place("position"), rotation: place("rotation").map(f64::to_radians) },
            start_joints,
            structure: raw.string("structure"),
            chain,
            joints,
            cell,
            published: None,
        };
        if start.is_none() {
            default_start(&mut machine);
        }
        self.quality(raw, &mut machine);
        self.tools_hang_down(raw, &mut machine);
        self.cell_fits(raw, &machine);
        machine
    }

    /// In files Z of a tool counts out of the spindle on every machine. Where the spindle's own Z points away from the part it is put
    /// the other way.
    fn tools_hang_down(&mut self, raw: &Node, machine: &mut Machine) {
        if !machine.is_upright() {
            return;
        }
        for t in raw.get("tool").map_or(&[][..], Node::list) {
            if let (Some(place), Some([_, _, z])) = (t.get("position"), t.array::<3>("position"))
                && z < 0.0
            {
                let what = format!("the point of this tool is inside of the spindle: on every machine Z counts from the nose to the tool's point; a tool of {0} mm has {0}", -z);
                self.value(&place.span, what);
            }
        }
        for tool in machine.cell.tools.values_mut() {
            tool.frame.position[2] = -tool.frame.position[2] + 0.0;
        }
    }

    /// What the cell says has a meaning for the kind of machine and its coupled joints.
    fn cell_fits(&mut self, raw: &Node, machine: &Machine) {
        let home = raw.get("home").and_then(|h| h.get("joints"));
        if let (Some(given), Some(home), Some(coupling)) = (home, &machine.cell.home, &machine.cell.coupling)
            && let Some((i, value)) = machine
                .outside(home)
                .into_iter()
                .find(|(i, _)| *i == coupling.joint && machine.joints[*i].allows(home[*i]))
        {
            let joint = &machine.joints[i];
            self.value(&given.span, format!("at home the controller's `{}` is at {}, outside of its limits: it is counted together with another joint", joint.name, joint.show(value)));
        }
        let frames = raw.get("frame").map_or(&[][..], Node::list);
        self.frame_names(frames);
        let named = |n: &&Node| n.string("name").as_deref() == Some(MACHINE_ZERO);
        let Some(frame) = frames.iter().find(named) else { return };
        if machine.kind != Kind::Robot {
            self.value(&frame.span, format!("the frame `{MACHINE_ZERO}` is for robots: on this machine G53, G28 and G30 mean places of its own axes"));
        } else if let Some(rotation) = frame.get("rotation") {
            self.value(&rotation.span, format!("the frame `{MACHINE_ZERO}` has no `rotation`: X, Y and Z of the machine are those of the part, as on the mill the program is for"));
        }
    }

    /// A program calls frames by the codes of its work offsets, letter by letter.
    fn frame_names(&mut self, frames: &[Node]) {
        const CODES: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
        let mut seen = Vec::new();
        for name in frames.iter().filter_map(|f| f.get("name")) {
            let text = name.text().unwrap_or_default();
            let like = text.trim().strip_prefix(['g', 'G']).is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
            if seen.contains(&text) {
                self.value(&name.span, format!("the frame `{text}` is given twice"));
            } else if like && text != MACHINE_ZERO && !CODES.contains(&text) {
                let close = suggestion(&text.trim().to_uppercase(), &CODES).unwrap_or("G54");
                self.value(&name.span, format!("no program calls a frame `{text}`; did you mean `{close}`?"));
            }
            seen.push(text);
        }
    }

    /// The two ways to give the start must mean the same.
    fn start_agrees(&mut self, raw: &Node, machine: &Machine) {
        let given = raw.get("start").and_then(|s| s.get("joints"));
        let (Some(given), Some(joints)) = (given, &machine.start_joints) else { return };
        if raw.get("start").is_none_or(|s| s.get("position").is_none()) {
            return;
        }
        let Ok(pose) = machine.kinematics().forward_frame(joints) else { return };
        let (shift, turn) = pose.error_to(&machine.start.frame());
        if norm(shift) > 1e-6 || norm(turn) > 1e-6 {
            self.value(&given.span, "these joint values put the tool elsewhere than `position` and `rotation` say");
        }
    }

    fn structure(&mut self, raw: &Node, machine: &Machine) {
        let Some(given) = raw.get("structure") else { return };
        match crate::mobility(given.text().unwrap_or_default()) {
            Err(e) => self.value(&given.span, e),
            Ok(m) if m.freedom != machine.joints.len() as i64 => {
                let args = [given.text().unwrap_or_default().to_string(), m.freedom.to_string(), machine.joints.len().to_string()];
                self.fault(code::MACHINE_MOBILITY, &given.span, &args);
            }
            Ok(_) if crate::mobility::of_another(given.text().unwrap_or_default(), machine) => {
                let what = format!("`{}` is another mechanism than that of the kinematics and joints: {}", given.text().unwrap_or_default(), own_structure(machine));
                self.value(&given.span, what);
            }
            Ok(_) => {}
        }
    }

    fn joint(&mut self, j: &Node) -> Joint {
        let inverted = self.inverted(j);
        let letter = j.get("word").and_then(|w| match w.text().unwrap_or_default().as_bytes() {
            [b @ b'A'..=b'Z'] => Some(*b as char),
            _ => {
                self.value(&w.span, "a word is one upper-case letter");
                None
            }
        });
        let revolute = j.get("type").and_then(Node::text) == Some("revolute");
        let unit = |key: &str| j.value_of(key).map(|v| if revolute { v.to_radians() } else { v });
        Joint {
            name: j.string("name").unwrap_or_default(),
            kind: if revolute { JointKind::Revolute } else { JointKind::Prismatic },
            word: letter,
            min: unit("min").filter(|_| !inverted),
            max: unit("max").filter(|_| !inverted),
            speed: unit("speed"),
            rapid: unit("rapid"),
            acceleration: unit("acceleration"),
        }
    }

    /// Whether the limits leave no room: that is told here, and nothing else of them.
    fn inverted(&mut self, t: &Node) -> bool {
        let (Some(low), Some(high)) = (t.get("min"), t.get("max")) else { return false };
        let Some((min, max)) = low.number().zip(high.number()).filter(|(min, max)| min >= max) else { return false };
        // One that comes from the base of `extends` has its place there, before the tables.
        let at = if low.span.start > high.span.start { low } else { high };
        self.value(&at.span, format!("max {max} is not above min {min}"));
        true
    }

    fn names(&mut self, list: &[Node]) {
        for (i, joint) in list.iter().enumerate() {
            let earlier = &list[..i];
            let same = |key: &str| joint.string(key).is_some() && earlier.iter().any(|e| e.string(key) == joint.string(key));
            let name = joint.string("name").unwrap_or_default();
            if same("name") {
                self.value(&joint.span, format!("there is another joint with the name `{name}`"));
            }
            if same("word") {
                self.value(&joint.span, format!("there is another joint with the word of `{name}`"));
            }
        }
    }

    fn chain(&mut self, raw: &Node, list: &[Node], joints: &[Joint]) -> Chain {
        let none = Chain::Incomplete { kind: String::new(), missing: Vec::new(), joints: joints.len() };
        let Some(table) = raw.get("kinematics") else { return none };
        let Some(row) = KINDS.iter().find(|k| table.string("kind").as_deref() == Some(k.name)) else { return none };
        let kinds: String = joints.iter().map(|j| if j.kind == JointKind::Revolute { 'R' } else { 'P' }).collect();
        let fits = match row.name {
            "cartesian" => cartesian(joints),
            _ if row.joints.is_empty() => (1..=MOST_JOINTS).contains(&kinds.len()),
            _ => kinds == row.joints,
        };
        if !fits {
            let has = format!("{} ({} revolute)", kinds.len(), kinds.matches('R').count());
            self.fault(code::MACHINE_JOINTS, &table.span, &[row.name.to_string(), row.words.to_string(), has]);
        }
        for e in table.entries() {
            let own = |k: &&&str| **k == e.key;
            if e.key != "kind" && row.needs.iter().find(own).is_none() && row.may.iter().find(own).is_none() {
                self.value(&e.key_span, format!("`{}` has no `{}`", row.name, e.key));
            }
        }
        let missing: Vec<String> = row.needs.iter().filter(|k| table.get(k).is_none()).map(|k| (*k).to_string()).collect();
        if !missing.is_empty() {
            if raw.get("template").and_then(Node::flag) != Some(true) {
                self.fault(code::MACHINE_MISSING_KEY, &table.span, &[row.name.to_string(), missing.join("`, `")]);
            }
            return Chain::Incomplete { kind: row.name.to_string(), missing, joints: joints.len() };
        }
        if !fits {
            return none;
        }
        self.kinematics(row.name, table, list, joints).unwrap_or(none)
    }

    /// A `cartesian` machine is told its axes by their order: a slide that says it is another one is refused.
    fn slides_in_order(&mut self, list: &[Node], joints: &[Joint]) {
        const ORDER: [char; 3] = ['X', 'Y', 'Z'];
        for (i, (node, joint)) in list.iter().zip(joints).enumerate() {
            let mut name = joint.name.chars();
            let letter = joint.word.or(name.next().filter(|_| name.next().is_none())).map(|c| c.to_ascii_uppercase());
            let Some(wanted) = letter.and_then(|l| ORDER.iter().position(|o| *o == l)).filter(|at| *at != i) else { continue };
            let span = node.get("word").or(node.get("name")).map_or(node.span.clone(), |n| n.span.clone());
            let is = ORDER.get(i).map_or("after Z".to_string(), |c| format!("{c}"));
            let order = "joints of a `cartesian` machine are in the order X Y Z A B C U V W";
            self.value(&span, format!("joint `{}` is number {}, which is {is}, and {} is number {}: {order}; a lathe has a Y too, with `min` and `max` near 0 where it can't move", joint.name, i + 1, ORDER[wanted], wanted + 1));
        }
    }

    fn kinematics(&mut self, kind: &str, table: &Node, list: &[Node], joints: &[Joint]) -> Option<Chain> {
        let number = |key: &str| table.value_of(key).unwrap_or(0.0);
        Some(match kind {
            "cartesian" => {
                self.slides_in_order(list, joints);
                Chain::Cartesian
            }
            "planar-3r" => {
                let l = self.lengths::<3>(table, "links", "three lengths above zero: upper arm, forearm, tool", |l| l[0] > 0.0 && l[1] > 0.0 && l[2] >= 0.0)?;
                Chain::Planar3r(l)
            }
            "scara" => {
                let l = self.lengths::<2>(table, "links", "two lengths above zero", |l| l[0] > 0.0 && l[1] > 0.0)?;
                Chain::Scara(Scara::new(l, number("height")))
            }
            "opw" => self.opw(table)?,
            "ur" => {
                let good = |l: &[f64; 6]| l[1] != 0.0 && l[2] != 0.0;
                Chain::ParallelWrist(ParallelWrist::new(self.lengths::<6>(table, "lengths", "six: d1 a2 a3 d4 d5 d6, a2 and a3 not zero", good)?))
            }
            "five-axis" => self.five_axis(table)?,
            "parallel-2ups-prp" => self.two_legs(table, joints)?,
            "tricept" => {
                let shape = TriceptShape {
                    base_radius: number("base_radius"),
                    platform_radius: number("platform_radius"),
                    wrist_offset: number("wrist_offset"),
                    flange_offset: number("flange_offset"),
                    first: number("first_leg").to_radians(),
                };
                Chain::Tricept(Tricept { shape, reference: table.string("model").as_deref() == Some("reference") })
            }
            _ => Chain::Serial(self.serial(kind, table, list, joints)?),
        })
    }

    fn lengths<const N: usize>(&mut self, table: &Node, key: &str, what: &str, good: impl Fn(&[f64; N]) -> bool) -> Option<[f64; N]> {
        let given = table.get(key)?;
        match table.array::<N>(key).filter(&good) {
            Some(l) => {
                let most = l.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                if most < 10.0 && kind_is_arm(table) {
                    self.value(&given.span, format!("the longest of `{key}` is {most}: lengths are in mm, these look like metres"));
                }
                Some(l)
            }
            None => {
                self.value(&given.span, format!("`{key}` are {what}"));
                None
            }
        }
    }

    fn opw(&mut self, table: &Node) -> Option<Chain> {
        let good = |l: &[f64; 7]| l[4] > 0.0 && libm::hypot(l[1], l[5]) > 0.0;
        let lengths = self.lengths::<7>(table, "lengths", "seven: a1 a2 b c1 c2 c3 c4, with c2 and the forearm above zero", good)?;
        let signs = table.array::<6>("signs").unwrap_or([1.0; 6]);
        if signs.iter().any(|s| s.abs() != 1.0) {
            self.value(&table.get("signs")?.span, "a sign is 1 or -1");
        }
        let offsets = table.array::<6>("offsets").unwrap_or_default().map(f64::to_radians);
        Some(Chain::Opw(Opw::new(lengths, offsets, signs)))
    }

    fn five_axis(&mut self, table: &Node) -> Option<Chain> {
        let given = table.get("rotary")?;
        let mut all = Vec::new();
        for r in given.list() {
            let unit = match r.string("axis").as_deref() {
                Some("A") => [1.0, 0.0, 0.0],
                Some("B") => [0.0, 1.0, 0.0],
                _ => [0.0, 0.0, 1.0],
            };
            let v = r.array::<3>("direction").unwrap_or(unit);
            if norm(v) < 1e-9 {
                self.value(&r.span, "`direction` has no length");
                return None;
            }
            let on = if r.string("on").as_deref() == Some("head") { Carrier::Head } else { Carrier::Table };
            all.push(Rotary { on, axis: scale(v, 1.0 / norm(v)), point: r.array::<3>("point").unwrap_or_default() });
        }
        let Ok(rotary) = <[Rotary; 2]>::try_from(all) else {
            self.value(&given.span, "`rotary` are two axes, the one nearer to the bed first");
            return None;
        };
        if norm(crate::math::cross(rotary[0].axis, rotary[1].axis)) < 1e-6 {
            self.value(&given.span, "the two rotary axes are parallel");
            return None;
        }
        Some(Chain::FiveAxis(FiveAxis::new(rotary, table.value_of("pivot").unwrap_or(0.0))))
    }

    fn two_legs(&mut self, table: &Node, joints: &[Joint]) -> Option<Chain> {
        let points = |key: &str| -> Option<[[f64; 3]; 2]> {
            let list: Vec<[f64; 3]> = table.get(key)?.list().iter().filter_map(|p| p.numbers().try_into().ok()).collect();
            list.try_into().ok()
        };
        let limits = |j: &Joint| (j.min.unwrap_or(f64::NEG_INFINITY), j.max.unwrap_or(f64::INFINITY));
        for key in ["arm", "yaw"] {
            let node = table.get(key)?;
            if node.numbers().first() >= node.numbers().get(1) {
                self.value(&node.span, format!("`{key}` is the least and the greatest value"));
            }
        }
        let (base, platform) = (points("base_joints")?, points("platform_joints")?);
        if base[0] == base[1] || platform[0] == platform[1] {
            self.value(&table.get("base_joints")?.span, "both legs have the same joint: the machine can't hold its yaw");
            return None;
        }
        let ([a, b], [y, z]) = (table.array::<2>("arm")?, table.array::<2>("yaw")?.map(f64::to_radians));
        let reference = table.array::<3>("reference_pose").map_or([(a + b) / 2.0, 0.0, 0.0], |r| [r[0], r[1].to_radians(), r[2]]);
        let shape = TwoLegsShape {
            base,
            platform,
            arm: (a, b),
            yaw: (y, z),
            legs: [limits(&joints[0]), limits(&joints[1])],
            column: limits(&joints[2]),
            universal: table.value_of("universal")?.to_radians(),
            spherical: table.value_of("spherical")?.to_radians(),
            spherical_axis: match table.string("spherical_axis").as_deref() {
                Some("base") => SphericalAxis::Base,
                _ => SphericalAxis::Platform,
            },
            reference,
        };
        Some(Chain::TwoLegs(Box::new(TwoLegs { shape })))
    }

    fn serial(&mut self, kind: &str, table: &Node, list: &[Node], joints: &[Joint]) -> Option<Serial> {
        let tip = table.array::<6>("tip").map_or(Frame::IDENTITY, six);
        let limits = |j: &Joint| (j.min.unwrap_or(f64::NEG_INFINITY), j.max.unwrap_or(f64::INFINITY));
        let (mut rows, mut links) = (Vec::new(), Vec::new());
        for (node, joint) in list.iter().zip(joints) {
            let wanted = if kind == "origins" { "origin" } else { "dh" };
            if node.get(wanted).is_none() {
                self.fault(code::MACHINE_MISSING_KEY, &node.span, &[kind.to_string(), wanted.to_string()]);
                continue;
            }
            if let Some([a, d, alpha, theta]) = node.array::<4>("dh") {
                rows.push((DhRow { a, d, alpha: alpha.to_radians(), theta: theta.to_radians() }, joint.kind, limits(joint)));
            }
            if let Some(origin) = node.array::<6>("origin") {
                let axis = node.array::<3>("axis").unwrap_or([0.0, 0.0, 1.0]);
                if norm(axis) < 1e-9 {
                    self.value(&node.span, "`axis` has no length");
                    continue;
                }
                links.push(Link { origin: six(origin), axis: scale(axis, 1.0 / norm(axis)), kind: joint.kind, limits: limits(joint) });
            }
        }
        let chain = match kind {
            "dh" => {
                let chain = Serial::dh(&rows);
                let end = chain.tip().then(&tip);
                Serial::new(chain.links().to_vec(), end)
            }
            "mdh" => Serial::mdh(&rows, tip),
            _ => Serial::new(links, tip),
        };
        self.axes_differ(&chain, list);
        Some(chain)
    }

    /// Two joints after each other that do the same move the tool like one: the geometry is singular everywhere.
    fn axes_differ(&mut self, chain: &Serial, list: &[Node]) {
        for (pair, nodes) in chain.links().windows(2).zip(list.windows(2)) {
            if !pair[1].repeats(&pair[0]) {
                continue;
            }
            let name = |n: &Node| n.string("name").unwrap_or_default();
            let what = if pair[0].kind == JointKind::Revolute { "turn about one and the same axis" } else { "slide along one and the same direction" };
            let place = ["dh", "origin"].into_iter().find_map(|k| nodes[1].get(k)).unwrap_or(&nodes[1]);
            self.value(&place.span, format!("`{}` and `{}` {what}: one of them has no effect of its own", name(&nodes[0]), name(&nodes[1])));
        }
    }

    fn joint_values(&mut self, given: &Node, joints: &[Joint], what: &str) -> Option<Vec<f64>> {
        let values = given.numbers();
        if values.len() != joints.len() {
            self.value(&given.span, format!("{} {what} values for {} joints", values.len(), joints.len()));
            return None;
        }
        let mut out = Vec::with_capacity(values.len());
        for (v, j) in values.into_iter().zip(joints) {
            let v = if j.kind == JointKind::Revolute { v.to_radians() } else { v };
            if !j.allows(v) || !v.is_finite() {
                self.value(&given.span, format!("the {what} value of joint `{}` is outside its limits", j.name));
            }
            out.push(v);
        }
        Some(out)
    }

    fn cell(&mut self, raw: &Node, joints: &[Joint]) -> Cell {
        let frames = raw.get("frames");
        let frame = |key: &str| frames.and_then(|f| f.get(key)).map_or(Frame::IDENTITY, place);
        let list = |key: &str| raw.get(key).map_or(&[][..], Node::list);
        let home = raw.get("home").and_then(|h| h.get("joints"));
        let home = home.and_then(|given| self.joint_values(given, joints, "home"));
        let whole = |t: &Node, key: &str| t.value_of(key).map(|v| v as u64);
        let controller = raw.get("controller").map_or(Controller::default(), |c| Controller {
            name: c.string("name"),
            lines: whole(c, "lines"),
            points: whole(c, "points"),
            bytes: whole(c, "bytes"),
        });
        for row in raw.get("io").map_or(&[][..], Node::entries) {
            if row.key == "G38" {
                self.probe(&row.node);
            } else if let (Some(_), Some(signal)) = (row.node.get("routine"), row.node.get("signal")) {
                let what = format!(
                    "`[io.{}]` has `routine` and `signal`; a row does one of them. Set the output in the routine",
                    row.key
                );
                self.value(&signal.span, what);
            } else if ["signal", "routine", "wait", "seconds"].iter().all(|k| row.node.get(k).is_none()) {
                let what = format!("`[io.{}]` says nothing: name the output (`signal`), the `routine` or the input to `wait` for, or leave the row out", row.key);
                self.value(&row.node.span, what);
            } else if let (Some(value), None) = (row.node.get("value"), row.node.get("signal")) {
                self.value(&value.span, format!("`value` in `[io.{}]` is the level of an output: name it with `signal`", row.key));
            }
        }
        let number = |table: &str, key: &str| raw.get(table).and_then(|t| t.value_of(key));
        Cell {
            base: frame("base"),
            table: frame("table"),
            part: frame("part"),
            controller_frame: frames.and_then(|f| f.get("controller")).map(place),
            frames: list("frame").iter().map(|f| (f.string("name").unwrap_or_default(), place(f))).collect(),
            tools: self.tools(list("tool")),
            spindle: raw.get("spindle").and_then(|s| self.spindle(s)),
            axial_depth: number("cutting", "axial_depth"),
            external: list("external").iter().filter_map(|e| self.external(e)).collect(),
            home,
            coupling: raw.get("coupling").and_then(|c| self.coupling(c, joints)),
            controller,
            io: raw.get("io").map_or(&[][..], Node::entries).iter().map(|e| (e.key.clone(), signal(&e.node))).collect(),
            rapid: raw.get("rapid").and_then(Node::text).map(|r| if r == "joint" { Rapid::Joint } else { Rapid::Linear }),
            rapid_speed: number("speed", "rapid"),
            joint_speed: number("speed", "joint"),
            zones: self.zones(raw),
            ..Cell::default()
        }
    }

    /// The row of the probe names an input and its level, nothing else.
    fn probe(&mut self, row: &Node) {
        if row.get("wait").is_none() {
            self.value(&row.span, "`[io.G38]` needs `wait`: the input that the probe switches");
        }
        for key in ["signal", "routine", "seconds"] {
            if let Some(node) = row.get(key) {
                self.value(&node.span, format!("`{key}` has no meaning for a probe: `[io.G38]` takes `wait`, its input, and `value`"));
            }
        }
        if let Some(node) = row.get("value")
            && !matches!(row.value_of("value"), Some(v) if v == 0.0 || v == 1.0)
        {
            self.value(&node.span, "`value` of `[io.G38]` is the level of the input while the probe touches: 1 or 0");
        }
    }

    fn zones(&mut self, raw: &Node) -> Zones {
        let number = |key: &str| raw.get("zone").and_then(|t| t.value_of(key));
        let zones = Zones { default: number("default"), max: number("max") };
        if let (Some(default), Some(max)) = (zones.default, zones.max)
            && default > max
            && let Some(node) = raw.get("zone").and_then(|z| z.get("default"))
        {
            self.value(&node.span, format!("default {default} is above max {max}"));
        }
        zones
    }

    fn tools(&mut self, list: &[Node]) -> std::collections::BTreeMap<u32, ToolData> {
        let mut out = std::collections::BTreeMap::new();
        for t in list {
            let number = t.value_of("number").unwrap_or(0.0) as u32;
            let tool = ToolData {
                name: t.string("name").unwrap_or_default(),
                frame: place(t),
                diameter: t.value_of("diameter"),
                mass: t.value_of("mass"),
            };
            if out.insert(number, tool).is_some() {
                self.value(&t.span, format!("there is another tool {number}"));
            }
        }
        out
    }

    fn spindle(&mut self, s: &Node) -> Option<Spindle> {
        let speed = (s.value_of("min_speed"), s.value_of("max_speed"));
        if let (Some(min), Some(max)) = speed
            && min > max
        {
            self.value(&s.get("max_speed")?.span, format!("max_speed {max} is below min_speed {min}"));
        }
        Some(Spindle { frame: place(s), speed, controlled: s.get("controlled").and_then(Node::flag).unwrap_or(true) })
    }

    fn external(&mut self, e: &Node) -> Option<External> {
        let joint = self.joint(e);
        let axis = e.array::<3>("axis").unwrap_or([0.0, 0.0, 1.0]);
        if norm(axis) < 1e-9 {
            self.value(&e.span, "`axis` has no length");
            return None;
        }
        let revolute = joint.kind == JointKind::Revolute;
        let (low, high) = (joint.min.unwrap_or(f64::NEG_INFINITY), joint.max.unwrap_or(f64::INFINITY));
        let mut position = 0f64.max(low).min(high);
        if let Some(node) = e.get("position")
            && let Some(given) = node.number()
        {
            position = if revolute { given.to_radians() } else { given };
            if position < low || position > high {
                self.value(&node.span, format!("position {given} is outside of the limits"));
            }
        }
        let carries_machine = e.string("carries").as_deref() == Some("machine");
        if let Some(node) = e.get("coupled").filter(|_| !carries_machine) {
            self.value(&node.span, "`coupled` is for axes that carry the machine: frames of the part are where a positioner has it, in any control");
        }
        Some(External {
            position,
            coupled: e.get("coupled").and_then(Node::flag),
            joint,
            carries_machine,
            axis: scale(axis, 1.0 / norm(axis)),
            point: e.array::<3>("point").unwrap_or_default(),
        })
    }

    fn coupling(&mut self, c: &Node, joints: &[Joint]) -> Option<Coupling> {
        let names: Vec<&str> = joints.iter().map(|j| j.name.as_str()).collect();
        let mut index = |key: &str| {
            let node = c.get(key)?;
            let name = node.text()?;
            let found = names.iter().position(|n| *n == name);
            if found.is_none() {
                let hint = suggestion(name, &names).map_or(String::new(), |s| format!("; did you mean `{s}`?"));
                self.value(&node.span, format!("there is no joint `{name}`{hint}"));
            }
            found
        };
        let (joint, with) = (index("joint"), index("with"));
        let (joint, with) = (joint?, with?);
        if joint == with {
            self.value(&c.span, "a joint can't be coupled with itself");
        }
        let inverted = self.inverted(c);
        let angle = |key: &str| c.value_of(key).map(f64::to_radians).filter(|_| !inverted);
        Some(Coupling { joint, with, factor: c.value_of("factor")?, min: angle("min"), max: angle("max") })
    }
}

/// An arm of which the file says no start begins at home, or with its joints at 0 or their nearest limit.
fn default_start(machine: &mut Machine) {
    if matches!(machine.chain, Chain::Cartesian | Chain::Planar3r(_) | Chain::Incomplete { .. }) {
        return;
    }
    let nearest = |j: &Joint| 0f64.max(j.min.unwrap_or(f64::NEG_INFINITY)).min(j.max.unwrap_or(f64::INFINITY));
    let joints = machine.cell.home.clone().unwrap_or_else(|| machine.joints.iter().map(nearest).collect());
    if let Ok(pose) = machine.kinematics().forward(&joints) {
        (machine.start, machine.start_joints) = (pose, Some(joints));
    }
}

/// The mechanism that joints and kinematics make up, for messages.
fn own_structure(machine: &Machine) -> String {
    match machine.chain {
        Chain::TwoLegs(_) => "two legs with driven `P` joints and a column, such as `2UPS+PRP`".into(),
        Chain::Tricept(_) => "three driven legs, a passive one and a wrist, such as `3UPS+UP,RRR`".into(),
        _ => format!("a chain `{}`", crate::mobility::letters(&machine.joints)),
    }
}

fn kind_is_arm(table: &Node) -> bool {
    matches!(table.string("kind").as_deref(), Some("opw" | "ur" | "scara"))
}

fn signal(t: &Node) -> Signal {
    let signal = t.string("signal");
    Signal {
        value: t.value_of("value").or(signal.as_ref().map(|_| 1.0)),
        signal,
        routine: t.string("routine"),
        wait: t.string("wait"),
        seconds: t.value_of("seconds"),
    }
}

pub(crate) fn place(t: &Node) -> Frame {
    let [x, y, z] = t.array::<3>("position").unwrap_or_default();
    let [a, b, c] = t.array::<3>("rotation").unwrap_or_default();
    six([x, y, z, a, b, c])
}

fn six([x, y, z, a, b, c]: [f64; 6]) -> Frame {
    Frame { turn: square_euler([a, b, c]), position: [x, y, z] }
}

/// Turns in degrees; quarter turns come out without rounding.
fn square_euler(degrees: [f64; 3]) -> crate::math::M3 {
    let mut turn = crate::math::euler(degrees.map(f64::to_radians));
    if degrees.iter().all(|d| d % 90.0 == 0.0) {
        turn.iter_mut().flatten().for_each(|v| *v = libm::round(*v));
    }
    turn
}

fn cartesian(joints: &[Joint]) -> bool {
    (1..=9).contains(&joints.len())
        && joints.iter().enumerate().all(|(i, j)| ((3..6).contains(&i)) == (j.kind == JointKind::Revolute))
}

/// What an id looks like.
pub const ID_FORM: &str = "an id is `maker/model` in lower-case letters, digits and `-`";

/// Whether this can be the id of a machine: `maker/model` in lower-case letters, digits and `-`.
pub fn good_id(id: &str) -> bool {
    let good = |part: &str| {
        !part.is_empty() && part.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-')
    };
    id.split_once('/').is_some_and(|(maker, model)| good(maker) && good(model))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source;

    fn faults(text: &str) -> Vec<(&'static str, String)> {
        let found = parse(FileId(0), text).expect_err("faulty");
        found.iter().map(|d| (d.code.def().slug, text[d.primary().1.range()].to_string())).collect()
    }

    #[test]
    fn examples_of_the_registry() {
        let mut tried = 0;
        for row in gr_text::Code::all().map(gr_text::Code::def).filter(|d| d.options == Some("machine check")) {
            let (bad, good) = (row.bad.unwrap(), row.good.unwrap());
            let told = |text: &str| parse(FileId(0), text).err().unwrap_or_else(|| crate::doubts(FileId(0), text));
            let found = told(bad);
            assert_eq!(found.iter().map(|d| d.code.def().code).collect::<Vec<_>>(), [row.code]);
            assert_eq!(told(good), [], "{}", row.code);
            tried += 1;
        }
        assert_eq!(tried, 7);
    }

    /// A limit that stands on the wrong side of one of the machine that is extended is told where it stands.
    #[test]
    fn limits_beside_those_of_another_machine() {
        let mill = "format = 1\nid = \"shop/mill\"\nextends = \"generic/mill3\"\n[[joint]]\nname = \"X\"\n";
        for limit in ["min = 500", "max = -500"] {
            assert_eq!(faults(&format!("{mill}{limit}\n")), [("machine/bad-value", limit.split_once("= ").unwrap().1.to_string())]);
        }
    }

    #[test]
    fn the_example_of_the_documentation() {
        let page = include_str!("../../../docs/machines.md");
        let text = page.split("```toml").nth(1).and_then(|t| t.split("```").next()).unwrap();
        let cell = parse(FileId(0), text).unwrap_or_else(|e| panic!("{e:?}"));
        insta::assert_snapshot!(cell.describe());
        let tip = crate::math::Frame::shift([0.0, 0.0, 205.0]);
        assert_eq!(cell.cell.tool_frame(1), tip);
        assert_eq!(cell.joints[5].min, Some(-std::f64::consts::PI));
    }

    #[test]
    fn faults_of_form_have_hints() {
        let all = |text: &str| parse(FileId(0), text).expect_err("faulty").iter().map(|d| d.message.clone()).collect::<Vec<_>>().join("; ");
        let cell = "format = 1\nid = \"shop/cell\"\nextends = \"abb/irb2400\"\n";
        assert!(all(&format!("{cell}[kinematics]\nkind = \"opv\"\n")).contains("did you mean \"opw\"?"));
        assert_eq!(all(&format!("{cell}[[joint]]\nname = \"J9\"\n")), "`abb/irb2400` has no joint `J9`; did you mean `J1`?");
        let mill = "format = 1\nid = \"shop/mill\"\nextends = \"generic/mill3\"\n";
        assert!(all(&format!("{mill}[[joint]]\nname = \"A\"\n")).contains("`type` is missing"));
        // One slip of the pen, one message: not also what it leaves missing or makes of other numbers.
        let rail = "[[external]]\nname = \"E1\"\ntype = \"prismatic\"\ncarries = \"machine\"\nmin = 0\nmax = 10\nposition = 5\n";
        let home = "[home]\njoints = [0, -20, 20, 0, 60, 0]\n[zone]\ndefault = 1\nmax = 2\n[spindle]\nmin_speed = 10\nmax_speed = 20\n";
        let joint = "[[joint]]\nname = \"J1\"\nmin = -180\nmax = 180\n[stiffness]\nsource = \"x\"\nmodulus = 210000\n[[stiffness.member]]\njoint = \"J1\"\nname = \"n\"\nouter = 50\ninner = 20\nlength = 300\n";
        let whole = format!("{cell}{home}{rail}[io.M3]\nsignal = \"do\"\nwait = \"di\"\nseconds = 1\n[io.G38]\nwait = \"di\"\nvalue = 1\n{joint}");
        assert!(parse(FileId(0), &whole).is_ok());
        for (id, good, bad, place) in [("adept/one", "[424.942,", "[nan,", "nan"), ("usp/2ups-prp", "arm = [604.1", "arm = [1e300", "1e300")] {
            let text = crate::source(id).unwrap().replacen(good, bad, 1);
            assert_eq!(faults(&text).iter().map(|f| f.1.as_str()).collect::<Vec<_>>(), [place], "{}", all(&text));
        }
        let slips = [
            ("format = 1", "formatx = 1", "formatx"), ("format = 1", "format = nan", "nan"), ("format = 1", "format = -1", "-1"),
            ("id = ", "ID = ", "ID"), ("extends = ", "extendsx = ", "extendsx"), ("\"abb/irb2400\"", "5", "5"),
            ("joints = [0,", "jointsx = [0,", "jointsx"), ("joints = [0,", "joints = [nan,", "nan"), ("default = 1", "default = inf", "inf"),
            ("max = 2", "max = -2", "-2"), ("min_speed = 10", "min_speed = 1e300", "1e300"), ("max_speed = 20", "max_speed = 0", "0"),
            ("name = \"E1\"", "name = \" \"", "\" \""), ("type = \"pris", "TYPE = \"pris", "TYPE"), ("carries = \"machine\"", "carriesx = \"machine\"", "carriesx"),
            ("min = 0", "min = inf", "inf"), ("max = 10", "max = -10", "-10"), ("position = 5", "position = 1e300", "1e300"),
            ("[io.M3]", "[[io.M3]]", "[[io.M3]]"), ("signal = \"do\"", "signal = \"\"", "\"\""), ("value = 1", "value = nan", "nan"),
            ("wait = \"di\"\nvalue", "wait = \" \"\nvalue", "\" \""), ("\"shop/cell\"", "\"\"", "\"\""),
            ("name = \"J1\"\nmin", "name = \"J11\"\nmin", "\"J11\""), ("min = -180", "min = nan", "nan"), ("max = 180", "max = -180", "-180"),
            ("source = \"x\"", "sourcex = \"x\"", "sourcex"), ("modulus = 210000", "modulus = 0", "0"), ("outer = 50", "outer = nan", "nan"), ("name = \"n\"", "namex = \"n\"", "namex"),
        ];
        for (good, bad, place) in slips {
            let text = whole.replacen(good, bad, 1);
            assert_ne!(text, whole, "{good}");
            let found = faults(&text);
            assert_eq!(found.iter().map(|f| f.1.as_str()).collect::<Vec<_>>(), [place], "{bad}: {}", all(&text));
        }
        assert!(all(&format!("{cell}[coupling]\njoint = \"J33\"\n")).contains("did you mean `J3`?"));
        for word in ["M3x", "M77", "M0", "M48", "M66P", "M62P07", "M101P1", "M200", "G38.2"] {
            assert!(
                all(&format!("{cell}[io.\"{word}\"]\nsignal = \"a\"\n")).contains(&format!("`{word}` is no word")),
                "{word}"
            );
        }
        let empty = faults(&format!("{cell}[io.M7]\n[io.M8]\nsignal = \"a\"\n"));
        assert_eq!(empty.iter().map(|(slug, at)| (*slug, at.as_str())).collect::<Vec<_>>(), [("machine/bad-value", "[io.M7]")]);
        for word in ["S", "M3", "M19", "M53", "M60", "M62", "M62P0", "M66P12", "M68P3", "M100", "M199"] {
            assert!(parse(FileId(0), &format!("{cell}[io.{word}]\nsignal = \"a\"\n")).is_ok(), "{word}");
        }
        assert!(
            all(&format!(
                "{cell}[[external]]\nname = \"E1\"\ntype = \"revolute\"\ncarries = \"part\"\ncoupled = true\n"
            ))
            .contains("`coupled` is for axes that carry the machine")
        );
        let mill = "format = 1\nid = \"shop/cell\"\nextends = \"generic/mill3\"\n[[frame]]\nname = \"G53\"\n";
        assert!(all(mill).contains("the frame `G53` is for robots"));
        // The controller's J3 is J3 less J2 here: at home it is beyond its limit, though J3 itself is not.
        let home = "[home]\njoints = [0, 60, -60, 0, 60, 0]\n";
        let coupling = "[coupling]\njoint = \"J3\"\nwith = \"J2\"\nfactor = -1\nmin = -100\nmax = 100\n";
        assert!(all(&format!("{cell}{home}{coupling}")).contains("at home the controller's `J3` is at -120°"));
        assert!(
            all(&format!("{cell}[kinematics]\nlengths = [0.1, -0.135, 0, 0.615, 0.705, 0.755, 0.085]\n"))
                .contains("metres")
        );
        assert!(all(&format!("{cell}[kinematics]\nlengths = [0, 0, 0, 0, 0, 0, 0]\n")).contains("above zero"));
        assert!(all(&format!("{cell}[frames.table]\nposition = [nan, 0, 0]\n")).contains("finite"));
        // What is extended doesn't say it for the file.
        assert!(all("id = \"shop/x\"\nextends = \"abb/irb2400\"\n").contains("`format` is missing"));
        assert!(all("format = 1\nextends = \"abb/irb2400\"\n").contains("`id` is missing"));
        assert!(all("format = 1\nid = \"shop/x\"\nextends = \"abb/irb240\"\n").contains("did you mean `abb/irb2400`?"));
        assert!(all("format = 1\nid = \"shop/x\"\nextends = \"comau/tricept806\"\n").contains("platform_radius"));
        // Nor does its source speak for numbers that are the file's own.
        let legs = "format = 1\nid = \"shop/legs\"\nextends = \"usp/2ups-prp\"\n[accuracy]\njoints = [0.1, 0.1, 0.1]\n";
        assert!(all(legs).contains("`source` is missing in `[accuracy]`"));
        assert!(parse(FileId(0), &format!("{legs}source = \"own\"\n")).is_ok());
        // A lathe of two slides would be taken for X and Y.
        let slide = |n: &str| format!("[[joint]]\nname = \"{n}\"\ntype = \"prismatic\"\n");
        let lathe = format!("format = 1\nid = \"shop/lathe\"\ntitle = \"x\"\nkind = \"lathe\"\nsource = \"x\"\n[kinematics]\nkind = \"cartesian\"\n{}", slide("X"));
        assert!(all(&format!("{lathe}{}", slide("Z"))).contains("joint `Z` is number 2, which is Y, and Z is number 3"));
        assert!(parse(FileId(0), &format!("{lathe}{}{}", slide("Y"), slide("Z"))).is_ok());
        assert!(faults(&format!("{cell}[[joint]]\nname = \"J1\"\nmin = 200\n"))[0].0 == "machine/bad-value");
        let two = crate::source("usp/2ups-prp").unwrap();
        assert_eq!(faults(&two.replace("2UPS+PRP\"\n\n", "3UPS+PRP\"\n\n").replace("structure = \"3UPS+PRP\"", "structure = \"2UPS+PR\""))[0].0, "machine/mobility");
    }

    /// Numbers that no machine can mean, one by one: each is told at its own place.
    #[test]
    fn values_out_of_bounds() {
        let cell = "format = 1\nid = \"shop/cell\"\nextends = \"abb/irb2400\"\n";
        let tool = "[[tool]]\nnumber = 1\nname = \"t\"\n";
        let rail = "[[external]]\nname = \"E1\"\ntype = \"prismatic\"\ncarries = \"machine\"\n";
        let tricept = "[kinematics]\nbase_radius = 300\nplatform_radius = 150\nwrist_offset = 100\nflange_offset = 50\n";
        let member = "[stiffness]\nsource = \"x\"\nmodulus = 210000\n[[stiffness.member]]\njoint = \"J1\"\nname = \"m\"\n";
        let rows = [
            ("", "orientation = ", &["\"source-machine:generic/mill6\"", "\"source-machine:generic/mill3\""][..]),
            ("[speed]\n", "joint = ", &["-30", "0", "101"][..]),
            ("[speed]\n", "rapid = ", &["-200", "0", "nan"]),
            ("[zone]\n", "default = ", &["-3", "inf"]),
            ("[zone]\nmax = 2\n", "default = ", &["3"]),
            ("[zone]\n", "max = ", &["-1"]),
            ("[io.M3]\nwait = \"di\"\n", "seconds = ", &["-10", "0"]),
            ("[io.M3]\nsignal = \"do\"\n", "value = ", &["nan", "1e300"]),
            ("[io.G38]\nwait = \"di\"\n", "value = ", &["2", "0.5"]),
            ("[io.G38]\nwait = \"di\"\n", "seconds = ", &["1"]),
            ("[io.G38]\nwait = \"di\"\n", "signal = ", &["\"do\""]),
            ("[io.G38]\n", "value = ", &["1"]),
            ("[io.M8]\nroutine = \"Cool\"\n", "signal = ", &["\"do\""]),
            ("[io.M8]\nroutine = \"Cool\"\n", "value = ", &["0"]),
            ("[io.M8]\n", "value = ", &["1"]),
            ("[[frame]]\n", "name = ", &["\"g55\"", "\"G55 \"", "\"G59.4\"", "\"G060\"", "\"G55\"\n[[frame]]\nname = \"G55\""]),
            ("[[frame]]\nname = \"G53\"\nposition = [0, 0, 900]\n", "rotation = ", &["[0, 0, 90]"]),
            (tool, "mass = ", &["-1", "0"]),
            (tool, "diameter = ", &["-10", "0"]),
            (tool, "position = ", &["[0, 0, 1e300]", "[0, -inf, 0]"]),
            ("[[tool]]\nname = \"t\"\n", "number = ", &["-1", "5_000_000_000", "inf"]),
            ("[controller]\n", "lines = ", &["0", "3", "59"]),
            ("[controller]\n", "points = ", &["0", "9"]),
            ("[controller]\n", "bytes = ", &["0", "3999"]),
            ("[spindle]\n", "min_speed = ", &["-1"]),
            ("[spindle]\n", "max_speed = ", &["0"]),
            ("[cutting]\n", "axial_depth = ", &["0"]),
            ("[coupling]\njoint = \"J3\"\nwith = \"J2\"\n", "factor = ", &["0"]),
            ("[coupling]\njoint = \"J3\"\nwith = \"J2\"\nfactor = 1\nmin = 10\n", "max = ", &["-10"]),
            ("[[joint]]\nname = \"J1\"\ntype = \"revolute\"\n", "speed = ", &["0", "-1"]),
            ("[[joint]]\nname = \"J1\"\ntype = \"revolute\"\n", "rapid = ", &["0"]),
            ("[[joint]]\nname = \"J1\"\ntype = \"revolute\"\n", "acceleration = ", &["-5"]),
            ("[[joint]]\nname = \"J1\"\ntype = \"revolute\"\n", "min = ", &["nan"]),
            (rail, "speed = ", &["0"]),
            (rail, "position = ", &["nan"]),
            ("[accuracy]\nsource = \"x\"\n", "grade = ", &["0", "19"]),
            ("[accuracy]\nsource = \"x\"\n[[accuracy.parameter]]\nname = \"a1\"\n", "tolerance = ", &["-0.1"]),
            (member, "stiffness = ", &["0", "-5"]),
            ("[stiffness]\nsource = \"x\"\nmember = []\n", "modulus = ", &["0"]),
        ];
        let mut all = String::new();
        let mut row = |text: &str, line: &str| {
            let found = parse(FileId(0), text).err().unwrap_or_default();
            all += &format!("{line}\n");
            for d in found {
                all += &format!("    {} `{}`: {}\n", d.code.def().code, text[d.primary().1.range()].trim(), d.message);
            }
        };
        for (head, key, values) in rows {
            values.iter().for_each(|v| row(&format!("{cell}{head}{key}{v}\n"), &format!("{}{key}{v}", head.lines().next().unwrap_or_default())));
        }
        let hybrid = "format = 1\nid = \"shop/cell\"\nextends = \"comau/tricept806\"\n";
        for (good, bad) in [("300", "-300"), ("150", "0"), ("100", "-1"), ("50", "nan")] {
            row(&format!("{hybrid}{}", tricept.replace(&format!(" {good}\n"), &format!(" {bad}\n"))), &format!("tricept {good} as {bad}"));
        }
        let two = source("usp/2ups-prp").unwrap();
        row(&two.replace("universal = 45", "universal = 200"), "universal = 200");
        let mill = source("generic/mill5-b-head-c-table").unwrap();
        row(&mill.replace("pivot = 200", "pivot = -200"), "pivot = -200");
        insta::assert_snapshot!(all);
    }

    /// Every key that holds a number is tried with NaN, both infinities and a huge one.
    #[test]
    fn no_key_takes_what_is_no_number() {
        let good = include_str!("../../../docs/examples/irb2400-cell.toml");
        for bad in ["nan", "inf", "-inf", "1e300"] {
            for (i, line) in good.lines().enumerate() {
                let Some((key, value)) = line.split_once(" = ").filter(|(_, v)| v.parse::<f64>().is_ok() || v.starts_with('[')) else { continue };
                let value = if value.starts_with('[') { format!("[{bad}, {}", value.split_once(',').unwrap().1) } else { bad.to_string() };
                let text: String = good.lines().enumerate().map(|(k, l)| if k == i { format!("{key} = {value}\n") } else { format!("{l}\n") }).collect();
                assert!(parse(FileId(0), &text).is_err(), "{key} = {value}");
            }
        }
    }

    #[test]
    fn chains_that_are_none() {
        let head = |structure: &str| format!("format = 1\nid = \"shop/arm\"\ntitle = \"Arm\"\nkind = \"robot\"\n{structure}\n[kinematics]\nkind = \"dh\"\n");
        let row = |n: usize, kind: &str, dh: &str| format!("[[joint]]\nname = \"J{n}\"\ntype = \"{kind}\"\ndh = {dh}\n");
        let told = |text: &str| {
            let found = parse(FileId(0), text).err().unwrap_or_default();
            found.iter().map(|d| format!("{} `{}`: {}\n", d.code.def().code, &text[d.primary().1.range()], d.message)).collect::<String>()
        };
        let zero: String = (1..=3).map(|n| row(n, "revolute", "[0, 0, 0, 0]")).collect();
        let arm: String = (1..=3).map(|n| row(n, "revolute", "[100, 0, 90, 0]")).collect();
        let lift = row(1, "prismatic", "[0, 0, 0, 0]") + &row(2, "prismatic", "[50, 0, 0, 0]");
        let mut all = told(&(head("") + &zero)) + &told(&(head("") + &lift));
        for structure in ["2UPS+PRP", "RRP", "3R", "RR", "S", "UR"] {
            all += &format!("{structure}:\n{}", told(&(head(&format!("structure = \"{structure}\"")) + &arm)));
        }
        let two = source("usp/2ups-prp").unwrap();
        all += &told(&two.replace("structure = \"2UPS+PRP\"", "structure = \"PPP\""));
        insta::assert_snapshot!(all);
        // A column that turns about the line it slides along, and parallel axes beside each other, are good.
        let column = row(1, "prismatic", "[0, 0, 0, 0]") + &row(2, "revolute", "[300, 0, 0, 0]") + &row(3, "revolute", "[200, 0, 0, 0]");
        assert_eq!(told(&(head("") + &column)), "");
    }

    #[test]
    fn more_joints_than_have_room() {
        let head = "format = 1\nid = \"shop/snake\"\ntitle = \"Snake\"\nkind = \"robot\"\n[kinematics]\nkind = \"dh\"\n";
        let arm = |n: usize| (1..=n).fold(head.to_string(), |all, i| all + &format!("[[joint]]\nname = \"J{i}\"\ntype = \"revolute\"\ndh = [100, 0, 90, 0]\n"));
        parse(FileId(0), &arm(12)).unwrap_or_else(|e| panic!("{e:?}"));
        assert_eq!(faults(&arm(13))[0].0, "machine/joints");
        let cell = |n: usize| (1..=n).fold("format = 1\nid = \"shop/cell\"\nextends = \"abb/irb2400\"\n".to_string(), |all, i| all + &format!("[[external]]\nname = \"E{i}\"\ntype = \"revolute\"\ncarries = \"part\"\n"));
        parse(FileId(0), &cell(6)).unwrap_or_else(|e| panic!("{e:?}"));
        let found = parse(FileId(0), &cell(7)).expect_err("too many");
        assert!(found[0].message.contains("6 joints and 7 external axes"), "{found:?}");
    }

    #[test]
    fn faults_point_at_their_place() {
        let text = source("generic/mill3").unwrap();
        assert_eq!(faults(&text.replace("max = 400", "max = -500"))[0], ("machine/bad-value", "-500".to_string()));
        assert_eq!(faults(&text.replace("speed = 250", "speed = -1")), [("machine/bad-value", "-1".to_string())]);
        assert_eq!(faults(&text.replace("format = 1", "format = 7")), [("machine/bad-value", "7".to_string())]);
        assert_eq!(faults(&text.replace("rapid = 333", "rapidd = 333"))[0], ("machine/bad-file", "rapidd".to_string()));
        assert_eq!(faults("id = ")[0].0, "machine/bad-file");
        let arm = source("ufmg/plano-3r").unwrap();
        assert_eq!(faults(&arm.replace("[100, 100, 100]", "[100, 0, 100]"))[0].1, "[100, 0, 100]");
        assert_eq!(faults(&arm.replace("[90, -90, -90]", "[90, -90]"))[0].1, "[90, -90]");
        assert_eq!(faults(&arm.replace("[90, -90, -90]", "[90, -90, 90]"))[0].1, "[90, -90, 90]");
    }

    proptest::proptest! {
        #[test]
        fn never_panics(cut in 0usize..2000, insert in ".{0,8}") {
            let text = source("ufmg/plano-3r").unwrap();
            let mut at = cut.min(text.len());
            while !text.is_char_boundary(at) { at -= 1; }
            let _ = parse(FileId(0), &format!("{}{insert}{}", &text[..at], &text[at..]));
            let _ = parse(FileId(0), &text[..at]);
        }
    }
}
