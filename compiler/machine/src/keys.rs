//! The keys of a machine file: their names, types and meanings. The reader checks against these tables, and the
//! JSON Schema for editors is made from them, so the two can't differ.

use crate::tree::{Node, Value};
use std::fmt::Write as _;
use std::ops::Range;

/// Type of a value.
#[derive(Clone, Copy)]
pub(crate) enum Type {
    Text,
    /// A list of texts.
    Texts,
    /// A number within these bounds.
    Number(Bounds),
    /// A whole number, from the first to the last.
    Whole(u64, u64),
    Flag,
    /// One of these words.
    Choice(&'static [&'static str]),
    /// One of these words, or something that starts with the last one.
    Open(&'static [&'static str]),
    /// A list of this many numbers; 0 = any.
    Numbers(usize),
    /// A list of this many lists of three numbers.
    Points(usize),
    Table(&'static [Key]),
    /// A table in which no key is required.
    Part(&'static [Key]),
    Tables(&'static [Key]),
    /// Tables by free keys.
    Map(&'static [Key]),
}

/// What a number may be. NaN and infinity are never allowed.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Bounds {
    /// Up to what a length or an angle can be meant to be.
    Any,
    /// Anything but 0.
    NotZero,
    /// Above 0.
    Above,
    /// 0 or more.
    NotBelow,
    /// Above 0, up to this.
    UpTo(f64),
}

/// No length, angle, speed or stiffness is greater; above it numbers have no more room for thousandths.
const GREATEST: f64 = 1e12;

impl Bounds {
    fn admits(self, v: f64) -> bool {
        v.abs() <= GREATEST
            && match self {
                Bounds::Any => true,
                Bounds::NotZero => v != 0.0,
                Bounds::Above => v > 0.0,
                Bounds::NotBelow => v >= 0.0,
                Bounds::UpTo(most) => v > 0.0 && v <= most,
            }
    }
    fn words(self) -> String {
        match self {
            Bounds::Any => "between -1e12 and 1e12".into(),
            Bounds::NotZero => "other than 0".into(),
            Bounds::Above => "above 0".into(),
            Bounds::NotBelow => "0 or more".into(),
            Bounds::UpTo(most) => format!("above 0, at most {most}"),
        }
    }
    /// In words of JSON Schema.
    fn schema(self, pad: &str) -> String {
        match self {
            Bounds::Any | Bounds::NotZero => String::new(),
            Bounds::Above => format!(",\n{pad}\"exclusiveMinimum\": 0"),
            Bounds::NotBelow => format!(",\n{pad}\"minimum\": 0"),
            Bounds::UpTo(most) => format!(",\n{pad}\"exclusiveMinimum\": 0,\n{pad}\"maximum\": {most}"),
        }
    }
}

pub(crate) struct Key {
    pub name: &'static str,
    pub kind: Type,
    pub required: bool,
    pub doc: &'static str,
}

const fn key(name: &'static str, kind: Type, doc: &'static str) -> Key {
    Key { name, kind, required: false, doc }
}
const fn must(name: &'static str, kind: Type, doc: &'static str) -> Key {
    Key { name, kind, required: true, doc }
}

use Type::{Choice, Flag, Map, Numbers, Open, Part, Points, Table, Tables, Text, Texts, Whole};

const ANY: Type = Type::Number(Bounds::Any);
const NOT_ZERO: Type = Type::Number(Bounds::NotZero);
const ABOVE: Type = Type::Number(Bounds::Above);
const NOT_BELOW: Type = Type::Number(Bounds::NotBelow);
const PER_CENT: Type = Type::Number(Bounds::UpTo(100.0));
const HALF_TURN: Type = Type::Number(Bounds::UpTo(180.0));
/// Numbers of tools, lines and the like: no controller counts further.
const MOST_COUNTED: u64 = i32::MAX as u64;

pub(crate) const KINDS: &[&str] = &[
    "cartesian", "planar-3r", "scara", "opw", "ur", "five-axis", "parallel-2ups-prp", "tricept", "dh", "mdh", "origins",
];

pub(crate) static ROOT: &[Key] = &[
    must("format", Whole(0, MOST_COUNTED), "Version of the format: 1."),
    must("id", Text, "`maker/model`, lower case."),
    key("extends", Text, "Id of a built-in machine; what this file says is laid over it."),
    key("template", Flag, "This file is to be extended; keys may be missing."),
    must("title", Text, "Name for people."),
    must("kind", Choice(&["mill", "lathe", "robot"]), "Sort of machine."),
    key("source", Text, "Where the numbers come from."),
    key("orientation", Open(&["fixed", "abc-euler-xyz", "source-machine:"]), "What the words A B C mean on a robot."),
    key("structure", Text, "Structure of the mechanism, `2UPS+PRP`; its degrees of freedom must equal the joints."),
    key("rapid", Choice(&["joint", "linear"]), "How a rapid move is made."),
    must("kinematics", Table(KINEMATICS), "How the joints carry the tool."),
    key("start", Table(START), "Where a program starts."),
    key("home", Table(HOME), "Home position."),
    key("joint", Tables(JOINT), "Joints, from the base to the tool."),
    key("external", Tables(EXTERNAL), "Rails and positioners."),
    key("coupling", Table(COUPLING), "Two joints that the controller counts together."),
    key("frames", Table(FRAMES), "Base, table and part; where the controller counts from."),
    key(
        "frame",
        Tables(FRAME),
        "More frames in the base, by name: `G54` …, and `G53`: what G53, G28 and G30 mean on a robot.",
    ),
    key("spindle", Table(SPINDLE), "Spindle on the flange."),
    key("cutting", Table(CUTTING), "What the machine stands."),
    key("tool", Tables(TOOL), "Tools and their points."),
    key("speed", Table(SPEED), "Speeds where the program says nothing."),
    key("zone", Table(ZONE), "Corner zones, mm."),
    key("controller", Table(CONTROLLER), "Limits of the controller's files."),
    key("io", Map(SIGNAL), "What S, M3 to M9, M19, M50 to M53, M60, M62 to M68 (of one output or input: `M62P3`, `M66P0`) and M100 to M199 do, and the input of the probe (G38)."),
    key("accuracy", Table(ACCURACY), "How exactly joints and geometry are made."),
    key("stiffness", Table(STIFFNESS), "What yields under force."),
    key("as_built", Table(AS_BUILT), "Deviations of the geometry that have been measured or identified."),
    key("reference", Table(REFERENCE), "Laid over the file in the reference mode: the model of the publication."),
];

static KINEMATICS: &[Key] = &[
    must("kind", Choice(KINDS), "Kind of kinematics."),
    key("links", Numbers(0), "`planar-3r`: upper arm, forearm, tool; `scara`: two links, mm."),
    key("height", ANY, "`scara`: height of the tool at stroke 0, mm."),
    key("lengths", Numbers(0), "`opw`: a1 a2 b c1 c2 c3 c4; `ur`: d1 a2 a3 d4 d5 d6, mm."),
    key("offsets", Numbers(6), "`opw`: model angle = sign · joint value − offset, degrees: it is 0 where the joint stands at sign · offset."),
    key("signs", Numbers(6), "`opw`: direction of each joint, 1 or -1."),
    key("rotary", Tables(ROTARY), "`five-axis`: two rotary axes, the one nearer to the bed first."),
    key("pivot", NOT_BELOW, "`five-axis`: from the crossing of the head's axes to the spindle nose, mm."),
    key("base_joints", Points(2), "`parallel-2ups-prp`: centres of the universal joints on the base, mm."),
    key("platform_joints", Points(2), "`parallel-2ups-prp`: centres of the spherical joints on the platform, mm."),
    key("arm", Numbers(2), "`parallel-2ups-prp`: least and greatest length of the arm, mm."),
    key("yaw", Numbers(2), "`parallel-2ups-prp`: least and greatest yaw, degrees."),
    key("universal", HALF_TURN, "`parallel-2ups-prp`: greatest angle of the universal joints, degrees."),
    key("spherical", HALF_TURN, "`parallel-2ups-prp`: greatest angle of the spherical joints, degrees."),
    key("spherical_axis", Choice(&["platform", "base"]), "`parallel-2ups-prp`: what the middle direction of the spherical joints belongs to."),
    key("reference_pose", Numbers(3), "`parallel-2ups-prp`: arm length, yaw, height of the middle direction; mm, degrees."),
    key("base_radius", ABOVE, "`tricept`: radius of the base joints' circle, mm."),
    key("platform_radius", ABOVE, "`tricept`: radius of the platform joints' circle, mm."),
    key("wrist_offset", NOT_BELOW, "`tricept`: from the platform to the centre of the wrist, mm."),
    key("flange_offset", NOT_BELOW, "`tricept`: from the centre of the wrist to the flange, mm."),
    key("first_leg", ANY, "`tricept`: direction of the first leg from X, degrees."),
    key("model", Choice(&["rigid", "reference"]), "`tricept`: rigid platform, or leg points by the source's equations."),
    key("tip", Numbers(6), "`dh`, `mdh`, `origins`: flange in the last joint: x y z mm, turns about X Y Z degrees."),
];

static ROTARY: &[Key] = &[
    must("on", Choice(&["table", "head"]), "Turns the part or the spindle."),
    must("axis", Choice(&["A", "B", "C"]), "Its letter: A about X, B about Y, C about Z."),
    key("direction", Numbers(3), "Vector along the axis, where it is not along X, Y or Z."),
    key("point", Numbers(3), "A point on the axis of a table, mm."),
];

static START: &[Key] = &[
    key("position", Numbers(3), "X Y Z, mm."),
    key("rotation", Numbers(3), "Turns about X, Y, Z, degrees."),
    key("joints", Numbers(0), "The same in joint values, mm or degrees."),
];

static HOME: &[Key] = &[must("joints", Numbers(0), "Joint values, mm or degrees.")];

static JOINT: &[Key] = &[
    must("name", Text, "Name, for people and for `extends`."),
    must("type", Choice(&["revolute", "prismatic"]), "Turns or slides."),
    key("word", Text, "Its word in joint-space G-code: one upper-case letter."),
    key("min", ANY, "Lower limit, mm or degrees."),
    key("max", ANY, "Upper limit, mm or degrees."),
    key("speed", ABOVE, "Greatest speed, mm/s or degrees/s; else 200 mm/s or 90 degrees/s are reckoned with."),
    key("rapid", ABOVE, "Speed of a rapid move; else `speed`."),
    key("acceleration", ABOVE, "Greatest acceleration, mm/s² or degrees/s²."),
    key("dh", Numbers(4), "`dh`, `mdh`: a, d (mm), alpha, theta (degrees); the joint value adds to theta or d."),
    key("origin", Numbers(6), "`origins`: frame in the joint before: x y z mm, turns about X Y Z degrees."),
    key("axis", Numbers(3), "`origins`: vector it turns about or slides along."),
];

static EXTERNAL: &[Key] = &[
    must("name", Text, "Name on the controller: `E1`."),
    must("type", Choice(&["revolute", "prismatic"]), "Turns or slides."),
    must("carries", Choice(&["machine", "part"]), "Rail or positioner."),
    key(
        "coupled",
        Flag,
        "Rail: whether the control counts it in poses (ABB: the base frame is moved by it; KUKA: ROBROOT kinematics; FANUC: integrated rail).",
    ),
    key("axis", Numbers(3), "Vector; else Z."),
    key("point", Numbers(3), "A point on it, mm."),
    key("min", ANY, "Lower limit, mm or degrees."),
    key("max", ANY, "Upper limit, mm or degrees."),
    key("position", ANY, "Where it stands while a program runs, mm or degrees; else 0 or the limit nearest to it."),
    key("speed", ABOVE, "Greatest speed."),
    key("rapid", ABOVE, "Speed of a rapid move."),
    key("acceleration", ABOVE, "Greatest acceleration."),
];

static COUPLING: &[Key] = &[
    must("joint", Text, "Joint whose value differs on the controller."),
    must("with", Text, "The joint it is counted with."),
    must("factor", NOT_ZERO, "controller = joint + factor · with: -1 on FANUC arms, 1 with a parallelogram."),
    key("min", ANY, "Least value on the controller, degrees; else the joint's."),
    key("max", ANY, "Greatest value on the controller, degrees; else the joint's."),
];

static PLACE: &[Key] = &[
    key("position", Numbers(3), "X Y Z, mm."),
    key("rotation", Numbers(3), "Turns about the fixed X, Y, Z, degrees."),
];

static FRAMES: &[Key] = &[
    key("base", Table(PLACE), "Where the machine stands in the cell, for people (`machine show`): the table and all other frames are given in the base, so no program depends on it."),
    key("table", Table(PLACE), "The table in the base."),
    key("part", Table(PLACE), "The part on the table."),
    key(
        "controller",
        Table(PLACE),
        "Where the controller's own coordinates (world, robot base) lie in the base: work frames of robot programs are counted from there. Left out: at the foot of the robot; for fanuc-ls, inform and val3 on axis 1 at the height of axis 2 (c1 of `lengths`).",
    ),
];

static FRAME: &[Key] = &[
    must("name", Text, "Name."),
    key("position", Numbers(3), "X Y Z in the base, mm."),
    key("rotation", Numbers(3), "Turns about the fixed X, Y, Z, degrees."),
];

static SPINDLE: &[Key] = &[
    key("position", Numbers(3), "Nose on the flange, mm."),
    key("rotation", Numbers(3), "Turns of the nose, degrees."),
    key("min_speed", NOT_BELOW, "Turns per minute."),
    key("max_speed", ABOVE, "Turns per minute."),
    key("controlled", Flag, "Whether the program can switch it; else true."),
];

static CUTTING: &[Key] = &[key("axial_depth", ABOVE, "Greatest axial depth of a milling cut, mm.")];

static TOOL: &[Key] = &[
    must("number", Whole(0, MOST_COUNTED), "T number."),
    must("name", Text, "Name on the controller."),
    key("position", Numbers(3), "Tool point on the spindle nose or flange, mm. Z counts out of it on every machine: a tool of 60 mm has `[0, 0, 60]`."),
    key("rotation", Numbers(3), "Turns of the tool, degrees."),
    key("diameter", ABOVE, "mm."),
    key("mass", ABOVE, "kg."),
];

static SPEED: &[Key] = &[
    key("rapid", ABOVE, "Tool point speed of a rapid, mm/s; else 250."),
    key("joint", PER_CENT, "Joint speed of a rapid, per cent of the greatest; else 100."),
];

static ZONE: &[Key] = &[
    key("default", NOT_BELOW, "Where the program doesn't say, mm."),
    key("max", NOT_BELOW, "Never more, mm."),
];

/// What a part of a program needs for its own head and end, with room for a few moves.
pub(crate) const LEAST_LINES: u64 = 60;
pub(crate) const LEAST_POINTS: u64 = 10;
pub(crate) const LEAST_BYTES: u64 = 4000;

static CONTROLLER: &[Key] = &[
    key("name", Text, "`IRC5`, `KRC4` …"),
    key("lines", Whole(LEAST_LINES, MOST_COUNTED), "Most lines per file."),
    key("points", Whole(LEAST_POINTS, MOST_COUNTED), "Most points per file."),
    key("bytes", Whole(LEAST_BYTES, 1 << 53), "Most bytes per file."),
];

static SIGNAL: &[Key] = &[
    key("signal", Text, "Output that is set."),
    key("value", ANY, "To this value; else 1. `G38`: level of the input while the probe touches, 1 or 0."),
    key("routine", Text, "Routine that is called."),
    key("wait", Text, "Input that is waited for. `G38`: the probe's."),
    key("seconds", ABOVE, "Time of the wait, s."),
];

static ACCURACY: &[Key] = &[
    must("source", Text, "Where the numbers come from."),
    key("joints", Numbers(0), "Error of each joint, plus or minus, mm or degrees."),
    key("grade", Whole(1, 18), "Grade of ISO 286-1 of every length of the geometry: 1 to 18."),
    key("parameter", Tables(TOLERANCE), "Tolerances of single parameters; they go before the grade."),
];

static TOLERANCE: &[Key] = &[
    must("name", Text, "Name of the parameter: `gcc-robot machine show` lists them."),
    must("tolerance", NOT_BELOW, "Plus or minus, mm or degrees."),
];

static STIFFNESS: &[Key] = &[
    must("source", Text, "Where the numbers come from."),
    key("modulus", ABOVE, "Modulus of elasticity of bars and screws, N/mm²."),
    must("member", Tables(MEMBER), "Springs between base and tool; those of one joint are in series."),
];

static MEMBER: &[Key] = &[
    must("joint", Text, "Joint along or about which it yields."),
    must("name", Text, "For people: `rod`, `nut`, `gear`."),
    key("stiffness", ABOVE, "N/mm for a sliding joint, N·mm/rad for a turning one."),
    key("outer", ABOVE, "Diameter of a bar or screw, mm."),
    key("inner", NOT_BELOW, "Its bore, mm; else solid."),
    key("length", ABOVE, "Length of a bar, mm."),
    key("shorter_by", ANY, "A screw whose free length is the joint value less this, mm."),
    key("between", Numbers(2), "A screw held at both ends, its nut at the joint value: the ends, mm."),
];

static AS_BUILT: &[Key] = &[
    must("source", Text, "Who measured it, how and when."),
    must("parameter", Tables(DEVIATION), "Parameters that differ from their nominal values."),
];

static DEVIATION: &[Key] = &[
    must("name", Text, "Name of the parameter: `gcc-robot machine show` lists them."),
    must("deviation", ANY, "Actual less nominal, mm or degrees; what each parameter measures and its sign: docs/accuracy.md."),
];

static REFERENCE: &[Key] = &[
    key("kinematics", Part(KINEMATICS), "Kinematics of the publication."),
    key("joint", Tables(JOINT_OVER), "Joints of the publication, by name."),
    key("source", Text, "Where the numbers come from."),
];

static JOINT_OVER: &[Key] = &[
    must("name", Text, "Name of a joint above."),
    key("type", Choice(&["revolute", "prismatic"]), "Turns or slides."),
    key("word", Text, "Its word."),
    key("min", ANY, "Lower limit."),
    key("max", ANY, "Upper limit."),
    key("speed", ABOVE, "Greatest speed."),
    key("rapid", ABOVE, "Speed of a rapid move."),
    key("acceleration", ABOVE, "Greatest acceleration."),
    key("dh", Numbers(4), "Denavit–Hartenberg row."),
    key("origin", Numbers(6), "Frame in the joint before."),
    key("axis", Numbers(3), "Vector."),
];

/// Keys of a job file.
pub(crate) static JOB: &[Key] = &[must("setup", Tables(SETUP), "Clampings of the part, in the order in which they are made.")];

static SETUP: &[Key] = &[
    must("name", Text, "Shown to the operator when the part is to be clamped so."),
    key("from_line", Whole(1, MOST_COUNTED), "Line of the program, from 1, at which the setup begins: a rapid to a height above the work."),
    key("workingsteps", Texts, "Workingsteps of a STEP-NC program that are made in this setup: each by its name or, where several share one, its instance name, as in \"#59\"."),
    key("position", Numbers(3), "Zero point of the part on the table: X Y Z, mm. Left out: as [frames.part] of the machine file has it."),
    key("rotation", Numbers(3), "Turns of the part about the table's fixed X, Y, Z, degrees. Left out: as [frames.part] of the machine file has it."),
];

/// M words that may have a row; M48 and M49 are M50 and M51 together. M62 to M68 may have rows for single numbers too.
const IO_WORDS: [std::ops::RangeInclusive<u16>; 5] = [3..=9, 19..=19, 50..=53, 60..=60, 62..=68];
const USER_WORDS: std::ops::RangeInclusive<u16> = 100..=199;

/// Words that may stand in `[io]`: `S`, `M3`, `M62P3` for one output alone, and `G38` for the probe.
fn io_word(word: &str) -> bool {
    let Some(rest) = word.strip_prefix('M') else { return matches!(word, "S" | "G38") };
    let (code, index) = rest.split_once('P').map_or((rest, None), |(c, i)| (c, Some(i)));
    let number = |n: &str| n.parse::<u16>().ok().filter(|v| v.to_string() == n && *v <= 999);
    match (number(code), index) {
        (Some(62..=68), Some(index)) => number(index).is_some(),
        (Some(code), None) => USER_WORDS.contains(&code) || IO_WORDS.iter().any(|words| words.contains(&code)),
        _ => false,
    }
}

/// Faults of form: place and message.
pub(crate) fn faults(node: &Node, keys: &'static [Key], place: &str) -> Vec<(Range<usize>, String)> {
    let mut out = Vec::new();
    table(node, keys, place, false, &mut out);
    out
}

fn table(node: &Node, keys: &'static [Key], place: &str, partial: bool, out: &mut Vec<(Range<usize>, String)>) {
    let names: Vec<&str> = keys.iter().map(|k| k.name).collect();
    // What `extends` would bring is not missing beside a fault of that word.
    let extends = |k: &Key| k.name == "extends" && (misspelt(node, keys, k.name) || node.get(k.name).is_some_and(|e| e.text().is_none()));
    let partial = partial || keys.iter().any(extends);
    for e in node.entries() {
        match keys.iter().find(|k| k.name == e.key) {
            Some(k) => value(&e.node, k, place, partial, out),
            None => {
                let hint = match meant(&e.key, keys) {
                    Some(s) => format!("; did you mean `{s}`?"),
                    None => format!("; keys here are {}", names.join(", ")),
                };
                out.push((e.key_span.clone(), format!("`{}` is not a key of {place}{hint}", e.key)));
            }
        }
    }
    for k in keys.iter().filter(|k| k.required && !partial && node.get(k.name).is_none()) {
        if misspelt(node, keys, k.name) {
            continue;
        }
        out.push((node.span.clone(), format!("`{}` is missing in {place}: {}", k.name, k.doc)));
    }
}

/// The keys of a table at the root.
pub(crate) fn of_table(name: &str) -> &'static [Key] {
    match ROOT.iter().find(|k| k.name == name).map(|k| k.kind) {
        Some(Table(keys)) => keys,
        _ => &[],
    }
}

/// The key that a word no table has most likely means.
fn meant(word: &str, keys: &'static [Key]) -> Option<&'static str> {
    let names: Vec<&'static str> = keys.iter().map(|k| k.name).collect();
    suggestion(&word.to_lowercase(), &names)
}

/// Whether a table has a word that most likely means a key it doesn't have: that is told of the word.
pub(crate) fn misspelt(node: &Node, keys: &'static [Key], name: &str) -> bool {
    let unknown = |e: &&crate::tree::Entry| !keys.iter().any(|k| k.name == e.key);
    node.get(name).is_none() && node.entries().iter().filter(unknown).any(|e| meant(&e.key, keys) == Some(name))
}

fn value(node: &Node, key: &Key, place: &str, partial: bool, out: &mut Vec<(Range<usize>, String)>) {
    let name = key.name;
    let mut wants = |what: &str| out.push((node.span.clone(), format!("`{name}` of {place} must be {what}")));
    match (key.kind, &node.value) {
        (Text, Value::Text(_)) | (Type::Number(_), Value::Number(_)) | (Flag, Value::Flag(_)) => {}
        (Texts, Value::List(l)) if l.iter().all(|t| t.text().is_some()) => {}
        (Whole(..), Value::Number(n)) if n.fract() == 0.0 || !n.is_finite() => {}
        (Choice(words), Value::Text(t)) | (Open(words), Value::Text(t)) if words.contains(&t.as_str()) => {}
        (Open(words), Value::Text(t)) if words.last().is_some_and(|w| t.len() > w.len() && t.starts_with(w)) => {}
        (Choice(words) | Open(words), Value::Text(t)) => {
            let hint = suggestion(t, words).map_or(String::new(), |s| format!("; did you mean \"{s}\"?"));
            wants(&format!("one of \"{}\"{hint}", words.join("\", \"")));
        }
        (Numbers(n), Value::List(l)) if l.iter().all(|v| v.number().is_some()) => {
            if n > 0 && l.len() != n {
                wants(&format!("a list of {n} numbers, not {}", l.len()));
            }
        }
        (Points(n), Value::List(l)) if l.len() == n && l.iter().all(|p| p.numbers().len() == 3 && p.list().len() == 3) => {}
        (Table(keys), Value::Table(_)) => table(node, keys, &format!("`[{name}]`"), partial, out),
        (Part(keys), Value::Table(_)) => table(node, keys, &format!("`[{name}]`"), true, out),
        (Tables(keys), Value::List(l)) => {
            for item in l {
                if matches!(item.value, Value::Table(_)) {
                    table(item, keys, &format!("`[[{name}]]`"), partial, out);
                } else {
                    out.push((item.span.clone(), format!("`{name}` must be a list of tables")));
                }
            }
        }
        (Map(keys), Value::Table(entries)) => {
            for e in entries {
                if !io_word(&e.key) {
                    out.push((e.key_span.clone(), format!("`{}` is no word of `[{name}]`: no program of a robot has it. Words are S, M3 to M9, M19, M50 to M53, M60, M62 to M68 (one output: M62P3), M100 to M199 and G38", e.key)));
                }
                match e.node.value {
                    Value::Table(_) => table(&e.node, keys, &format!("`[{name}.{}]`", e.key), false, out),
                    _ => out.push((e.node.span.clone(), format!("`[{name}.{}]` must be a table", e.key))),
                }
            }
        }
        (kind, _) => wants(&what(kind)),
    }
}

/// Numbers that are not within the bounds of their key, and texts that are empty: place and message.
pub(crate) fn out_of_bounds(node: &Node, keys: &'static [Key]) -> Vec<(Range<usize>, String)> {
    let mut out = Vec::new();
    bounds_of_table(node, keys, &mut out);
    out
}

/// Takes out what holds a value that no key may have, so that nothing else is told of it: limits and places of single joints, else
/// the whole table or row. Kinematics stay, without which there is no machine to look at.
pub(crate) fn without(node: &mut Node, bad: &[Range<usize>]) {
    let holds = |n: &Node| bad.iter().any(|b| holds(n, b));
    let Value::Table(root) = &mut node.value else { return };
    root.retain(|e| e.key == "kinematics" || matches!(e.node.value, Value::List(_)) || e.key == "io" || !holds(&e.node));
    for e in root.iter_mut() {
        match &mut e.node.value {
            Value::Table(rows) if e.key == "io" => rows.retain(|r| !holds(&r.node)),
            Value::List(items) => {
                for item in items {
                    if let Value::Table(keys) = &mut item.value {
                        keys.retain(|k| matches!(k.key.as_str(), "dh" | "origin" | "axis" | "number") || !holds(&k.node));
                    }
                }
            }
            _ => {}
        }
    }
}

/// Whether a value at this place is part of a node.
pub(crate) fn holds(node: &Node, place: &Range<usize>) -> bool {
    let inside = |n: &Node| holds(n, place);
    match &node.value {
        Value::List(l) => l.iter().any(inside),
        Value::Table(t) => t.iter().any(|e| inside(&e.node)),
        _ => node.span == *place,
    }
}

fn bounds_of_table(node: &Node, keys: &'static [Key], out: &mut Vec<(Range<usize>, String)>) {
    for e in node.entries() {
        if let Some(k) = keys.iter().find(|k| k.name == e.key) {
            bounds(&e.node, k, out);
        }
    }
}

fn bounds(node: &Node, key: &Key, out: &mut Vec<(Range<usize>, String)>) {
    let name = key.name;
    let mut number = |n: &Node, good: bool, words: String| {
        let finite = n.number().is_none_or(f64::is_finite);
        if !finite {
            out.push((n.span.clone(), "a value must be a finite number; leave a limit out when there is none".into()));
        } else if !good {
            let v = n.number().unwrap_or_default();
            let given = if v.abs() >= 1e9 { format!("{v:e}") } else { format!("{v}") };
            out.push((n.span.clone(), format!("`{name}` must be {words}, not {given}")));
        }
    };
    match key.kind {
        Type::Number(b) => number(node, node.number().is_none_or(|v| b.admits(v)), b.words()),
        Whole(least, most) => {
            let good = node.number().is_none_or(|v| v >= least as f64 && v <= most as f64);
            let open = most >= MOST_COUNTED && node.number().is_some_and(|v| v < least as f64);
            let words = if open { format!("a whole number from {least}") } else { format!("a whole number from {least} to {most}") };
            number(node, good, words);
        }
        Numbers(_) => node.list().iter().for_each(|n| number(n, n.number().is_none_or(|v| Bounds::Any.admits(v)), Bounds::Any.words())),
        Points(_) => {
            for n in node.list().iter().flat_map(Node::list) {
                number(n, n.number().is_none_or(|v| Bounds::Any.admits(v)), Bounds::Any.words());
            }
        }
        Table(keys) | Part(keys) => bounds_of_table(node, keys, out),
        Tables(keys) => node.list().iter().for_each(|n| bounds_of_table(n, keys, out)),
        Map(keys) => node.entries().iter().for_each(|e| bounds_of_table(&e.node, keys, out)),
        Text if node.text().is_some_and(|t| t.trim().is_empty()) => out.push((node.span.clone(), format!("`{name}` must not be empty"))),
        Text | Texts | Flag | Choice(_) | Open(_) => {}
    }
}

fn what(kind: Type) -> String {
    match kind {
        Text => "text in quotes".into(),
        Texts => "a list of texts in quotes".into(),
        Type::Number(_) => "a number".into(),
        Whole(..) => "a whole number".into(),
        Flag => "true or false".into(),
        Choice(words) | Open(words) => format!("one of \"{}\"", words.join("\", \"")),
        Numbers(0) => "a list of numbers".into(),
        Numbers(n) => format!("a list of {n} numbers"),
        Points(n) => format!("a list of {n} points of three numbers"),
        Table(_) | Part(_) | Map(_) => "a table".into(),
        Tables(_) => "a list of tables".into(),
    }
}

/// The option a misspelt word most likely means.
pub(crate) fn suggestion<'a>(word: &str, options: &[&'a str]) -> Option<&'a str> {
    let start = |o: &str| o.len() >= 3 && word.len() >= 3 && (word.starts_with(o) || o.starts_with(word));
    let near = |o: &&str| (distance(word, o), usize::from(!start(o)));
    let best = options.iter().copied().min_by_key(near)?;
    if distance(word, best) <= 1 + word.len() / 4 {
        return Some(best);
    }
    options.iter().copied().find(|o| start(o))
}

fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut corner = row[0];
        row[0] = i + 1;
        for (k, cb) in b.iter().enumerate() {
            let here = (corner + usize::from(ca != *cb)).min(row[k] + 1).min(row[k + 1] + 1);
            (corner, row[k + 1]) = (row[k + 1], here);
        }
    }
    row[b.len()]
}

/// The JSON Schema of machine files (draft 2020-12), for editors. `spec/machines/machine.schema.json` holds this text.
pub fn json_schema() -> String {
    document("machine file", ROOT, Level::Root)
}

/// The same of job files; `spec/machines/job.schema.json` holds this text.
pub fn job_schema() -> String {
    document("job file", JOB, Level::Inner)
}

fn document(title: &str, keys: &[Key], level: Level) -> String {
    let mut out = format!("{{\n  \"$schema\": \"https://json-schema.org/draft/2020-12/schema\",\n  \"title\": \"gcc-robot {title}\",\n");
    out += "  \"description\": \"Lengths in mm, angles in degrees, time in seconds.\",\n";
    object(&mut out, keys, 1, level);
    out += "\n}\n";
    out
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Which keys of a table are required.
#[derive(Clone, Copy, PartialEq)]
enum Level {
    Root,
    Inner,
    /// Of a file that may extend another: what that one may have is not missing. Rows are those of their name or number there.
    Over,
    Part,
}

impl Level {
    fn required(self, keys: &[Key]) -> Vec<&'static str> {
        let all = || keys.iter().filter(|k| k.required).map(|k| k.name);
        let known_by: Vec<&str> = all().filter(|n| ["name", "number"].contains(n)).collect();
        match self {
            Level::Inner => all().collect(),
            Level::Over if known_by.len() == 1 => known_by,
            _ => Vec::new(),
        }
    }
}

/// What a file has to have itself that extends no other, as a schema beside its own.
fn whole(keys: &[Key], required: &[&str]) -> String {
    let list = |words: &[&str]| words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(", ");
    let of = |k: &Key| match k.kind {
        Table(keys) => Some(whole(keys, &Level::Inner.required(keys))),
        Tables(keys) => Some(whole(keys, &Level::Inner.required(keys))).map(|s| if s == "{ }" { s } else { format!("{{ \"items\": {s} }}") }),
        _ => None,
    };
    let below: Vec<String> = keys.iter().filter_map(|k| of(k).filter(|s| s != "{ }").map(|s| format!("{}: {s}", quoted(k.name)))).collect();
    let mut parts = Vec::new();
    if !required.is_empty() {
        parts.push(format!("\"required\": [{}]", list(required)));
    }
    if !below.is_empty() {
        parts.push(format!("\"properties\": {{ {} }}", below.join(", ")));
    }
    if parts.is_empty() { "{ }".into() } else { format!("{{ {} }}", parts.join(", ")) }
}

fn object(out: &mut String, keys: &[Key], depth: usize, level: Level) {
    let pad = "  ".repeat(depth);
    let _ = write!(out, "{pad}\"type\": \"object\",\n{pad}\"additionalProperties\": false,\n");
    if level == Level::Root {
        let _ = write!(
            out,
            "{pad}\"required\": [\"format\", \"id\"],\n{pad}\"anyOf\": [\n{pad}  {{ \"required\": [\"extends\"] }},\n{pad}  {}\n{pad}],\n",
            whole(keys, &["title", "kind", "kinematics"])
        );
    } else if !level.required(keys).is_empty() {
        let required: Vec<String> = level.required(keys).into_iter().map(quoted).collect();
        let _ = writeln!(out, "{pad}\"required\": [{}],", required.join(", "));
    }
    let _ = writeln!(out, "{pad}\"properties\": {{");
    for (i, k) in keys.iter().enumerate() {
        let _ = writeln!(out, "{pad}  {}: {{\n{pad}    \"description\": {},", quoted(k.name), quoted(k.doc));
        property(out, k, depth + 2, if level == Level::Root { Level::Over } else { level });
        let _ = writeln!(out, "\n{pad}  }}{}", if i + 1 < keys.len() { "," } else { "" });
    }
    let _ = write!(out, "{pad}}}");
}

fn property(out: &mut String, k: &Key, depth: usize, level: Level) {
    // A list of this name is replaced whole.
    let level = if k.name == "rotary" || level == Level::Part { Level::Inner } else { level };
    let pad = "  ".repeat(depth);
    let list = |words: &[&str]| words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(", ");
    let _ = match k.kind {
        Text => write!(out, "{pad}\"type\": \"string\",\n{pad}\"minLength\": 1"),
        Texts => write!(out, "{pad}\"type\": \"array\",\n{pad}\"items\": {{ \"type\": \"string\" }}"),
        Type::Number(b) => write!(out, "{pad}\"type\": \"number\"{}", b.schema(&pad)),
        Whole(..) if k.name == "format" => write!(out, "{pad}\"const\": 1"),
        Whole(least, most) => {
            let most = if most >= MOST_COUNTED { String::new() } else { format!(",\n{pad}\"maximum\": {most}") };
            write!(out, "{pad}\"type\": \"integer\",\n{pad}\"minimum\": {least}{most}")
        }
        Flag => write!(out, "{pad}\"type\": \"boolean\""),
        Choice(words) => write!(out, "{pad}\"enum\": [{}]", list(words)),
        Open(words) => {
            let (last, rest) = words.split_last().map_or(("", words), |(l, r)| (*l, r));
            write!(out, "{pad}\"anyOf\": [{{ \"enum\": [{}] }}, {{ \"type\": \"string\", \"pattern\": \"^{last}.+\" }}]", list(rest))
        }
        Numbers(0) => write!(out, "{pad}\"type\": \"array\",\n{pad}\"items\": {{ \"type\": \"number\" }}"),
        Numbers(n) => write!(
            out,
            "{pad}\"type\": \"array\",\n{pad}\"items\": {{ \"type\": \"number\" }},\n{pad}\"minItems\": {n},\n{pad}\"maxItems\": {n}"
        ),
        Points(n) => write!(
            out,
            "{pad}\"type\": \"array\",\n{pad}\"items\": {{ \"type\": \"array\", \"items\": {{ \"type\": \"number\" }}, \"minItems\": 3, \"maxItems\": 3 }},\n{pad}\"minItems\": {n},\n{pad}\"maxItems\": {n}"
        ),
        Table(keys) => {
            object(out, keys, depth, level);
            Ok(())
        }
        Part(keys) => {
            object(out, keys, depth, Level::Part);
            Ok(())
        }
        Tables(keys) | Map(keys) => {
            let map = matches!(k.kind, Map(_));
            let _ = if map {
                writeln!(
                    out,
                    "{pad}\"type\": \"object\",\n{pad}\"additionalProperties\": false,\n{pad}\"patternProperties\": {{\n{pad}\"^(S|G38|M([3-9]|19|5[0-3]|60|6[2-8](P(0|[1-9][0-9]{{0,2}}))?|1[0-9]{{2}}))$\": {{"
                )
            } else {
                writeln!(out, "{pad}\"type\": \"array\",\n{pad}\"items\": {{")
            };
            object(out, keys, depth + 1, level);
            write!(out, "\n{pad}{}", if map { "} }" } else { "}" })
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schema_files_are_up_to_date() {
        for (name, text) in [("machine", json_schema()), ("job", job_schema())] {
            let path = format!("{}/../../spec/machines/{name}.schema.json", env!("CARGO_MANIFEST_DIR"));
            if std::env::var_os("UPDATE_SCHEMA").is_some() {
                std::fs::write(&path, &text).unwrap();
            }
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text, "run the test with UPDATE_SCHEMA=1");
        }
    }

    #[test]
    fn braces_of_the_schema_match() {
        for text in [json_schema(), job_schema()] {
            let count = |c: char| text.chars().filter(|x| *x == c).count();
            assert_eq!(count('{'), count('}'));
            assert_eq!(count('['), count(']'));
        }
    }

    #[test]
    fn misspelt_words() {
        assert_eq!(suggestion("maximum", &["min", "max", "speed"]), Some("max"));
        assert_eq!(suggestion("lenghts", &["links", "lengths"]), Some("lengths"));
        assert_eq!(suggestion("opv", &["opw", "ur"]), Some("opw"));
        assert_eq!(suggestion("banana", &["opw", "ur"]), None);
    }
}
