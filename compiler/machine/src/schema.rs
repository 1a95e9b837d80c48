//! The machine file: what it may hold, and what is wrong with it when it doesn't.

use crate::{Chain, Joint, JointKind, Kind, Machine, Orientation, Pose};
use gr_text::{Diagnostic, FileId, Span, code};
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: Spanned<i64>,
    id: Spanned<String>,
    title: String,
    kind: KindKey,
    #[serde(default)]
    source: String,
    orientation: Option<OrientationKey>,
    kinematics: Spanned<KinematicsTable>,
    #[serde(default)]
    start: StartTable,
    #[serde(default)]
    joint: Vec<Spanned<JointTable>>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum KindKey {
    Mill,
    Lathe,
    Robot,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum OrientationKey {
    Fixed,
    AbcEulerXyz,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
enum ChainKey {
    #[serde(rename = "cartesian")]
    Cartesian,
    #[serde(rename = "planar-3r")]
    Planar3r,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KinematicsTable {
    kind: ChainKey,
    links: Option<Spanned<Vec<f64>>>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct StartTable {
    position: [f64; 3],
    rotation: [f64; 3],
    joints: Option<Spanned<Vec<f64>>>,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum JointKey {
    Revolute,
    Prismatic,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JointTable {
    name: String,
    #[serde(rename = "type")]
    kind: JointKey,
    word: Option<Spanned<String>>,
    min: Option<Spanned<f64>>,
    max: Option<Spanned<f64>>,
    speed: Option<Spanned<f64>>,
    rapid: Option<Spanned<f64>>,
}

/// Reads a machine file. Every fault found is in the list.
pub fn parse(file: FileId, text: &str) -> Result<Machine, Vec<Diagnostic>> {
    let raw: File = toml::from_str(text).map_err(|e| vec![syntax(file, &e)])?;
    let mut check = Check { file, found: Vec::new() };
    let machine = check.machine(&raw);
    if check.found.is_empty() { Ok(machine) } else { Err(check.found) }
}

fn span(range: std::ops::Range<usize>) -> Span {
    let clip = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
    Span::new(clip(range.start), clip(range.end))
}

fn syntax(file: FileId, error: &toml::de::Error) -> Diagnostic {
    let place = error.span().map(span).unwrap_or_default();
    let message = error.message().trim().replace('\n', "; ");
    Diagnostic::new(code::MACHINE_BAD_FILE, file, place, &[message])
}

struct Check {
    file: FileId,
    found: Vec<Diagnostic>,
}

impl Check {
    fn value(&mut self, range: std::ops::Range<usize>, message: impl Into<String>) {
        self.found.push(Diagnostic::new(code::MACHINE_BAD_VALUE, self.file, span(range), &[message.into()]));
    }

    fn machine(&mut self, raw: &File) -> Machine {
        if *raw.format.get_ref() != 1 {
            self.value(raw.format.span(), format!("format {} is not known; this program reads 1", raw.format.get_ref()));
        }
        if !good_id(raw.id.get_ref()) {
            self.value(raw.id.span(), "an id is `maker/model` in lower-case letters, digits and `-`");
        }
        let joints: Vec<Joint> = raw.joint.iter().map(|j| self.joint(j)).collect();
        self.names(raw);
        let chain = self.chain(raw);
        let machine = self.built(raw, joints, chain);
        if self.found.is_empty() {
            self.start_agrees(raw, &machine);
        }
        machine
    }

    fn built(&mut self, raw: &File, joints: Vec<Joint>, chain: Chain) -> Machine {
        Machine {
            id: raw.id.get_ref().clone(),
            title: raw.title.clone(),
            kind: match raw.kind {
                KindKey::Mill => Kind::Mill,
                KindKey::Lathe => Kind::Lathe,
                KindKey::Robot => Kind::Robot,
            },
            source: raw.source.clone(),
            orientation: raw.orientation.map(|o| match o {
                OrientationKey::Fixed => Orientation::Fixed,
                OrientationKey::AbcEulerXyz => Orientation::AbcEulerXyz,
            }),
            start: Pose { position: raw.start.position, rotation: raw.start.rotation.map(f64::to_radians) },
            start_joints: self.start_joints(raw, &joints),
            chain,
            joints,
        }
    }

    /// The two ways to give the start must mean the same.
    fn start_agrees(&mut self, raw: &File, machine: &Machine) {
        let (Some(given), Some(joints)) = (&raw.start.joints, &machine.start_joints) else { return };
        let Ok(pose) = machine.kinematics().forward(joints) else { return };
        let same = pose.coordinates().iter().zip(machine.start.coordinates()).all(|(p, q)| (p - q).abs() < 1e-6);
        if !same {
            self.value(given.span(), "these joint values put the tool elsewhere than `position` and `rotation` say");
        }
    }

    fn joint(&mut self, raw: &Spanned<JointTable>) -> Joint {
        let j = raw.get_ref();
        for v in [&j.min, &j.max, &j.speed, &j.rapid].into_iter().flatten() {
            if !v.get_ref().is_finite() {
                self.value(v.span(), "a limit must be a finite number; leave the key out when there is no limit");
            }
        }
        for v in [&j.speed, &j.rapid].into_iter().flatten() {
            if *v.get_ref() <= 0.0 {
                self.value(v.span(), "a speed must be above zero");
            }
        }
        if let (Some(min), Some(max)) = (&j.min, &j.max)
            && min.get_ref() >= max.get_ref()
        {
            self.value(max.span(), format!("max {} is not above min {}", max.get_ref(), min.get_ref()));
        }
        let letter = j.word.as_ref().and_then(|w| match w.get_ref().as_bytes() {
            [b @ b'A'..=b'Z'] => Some(*b as char),
            _ => {
                self.value(w.span(), "a word is one upper-case letter");
                None
            }
        });
        let revolute = j.kind == JointKey::Revolute;
        let unit = |v: &Option<Spanned<f64>>| v.as_ref().map(|v| if revolute { v.get_ref().to_radians() } else { *v.get_ref() });
        Joint {
            name: j.name.clone(),
            kind: if revolute { JointKind::Revolute } else { JointKind::Prismatic },
            word: letter,
            min: unit(&j.min),
            max: unit(&j.max),
            speed: unit(&j.speed),
            rapid: unit(&j.rapid),
        }
    }

    fn names(&mut self, raw: &File) {
        for (i, joint) in raw.joint.iter().enumerate() {
            let (earlier, this) = (&raw.joint[..i], joint.get_ref());
            if earlier.iter().any(|e| e.get_ref().name == this.name) {
                self.value(joint.span(), format!("there is another joint with the name `{}`", this.name));
            }
            let word = |j: &JointTable| j.word.as_ref().map(|w| w.get_ref().clone());
            if word(this).is_some() && earlier.iter().any(|e| word(e.get_ref()) == word(this)) {
                self.value(joint.span(), format!("there is another joint with the word of `{}`", this.name));
            }
        }
    }

    fn chain(&mut self, raw: &File) -> Chain {
        let table = raw.kinematics.get_ref();
        let kinds: Vec<JointKey> = raw.joint.iter().map(|j| j.get_ref().kind).collect();
        let (fits, name, needs) = match table.kind {
            ChainKey::Planar3r => {
                (kinds == [JointKey::Revolute; 3], "planar-3r", "three revolute joints")
            }
            ChainKey::Cartesian => (cartesian(&kinds), "cartesian", "one to nine joints, X Y Z U V W prismatic, A B C revolute"),
        };
        if !fits {
            let has = format!("{} ({} revolute)", kinds.len(), kinds.iter().filter(|k| **k == JointKey::Revolute).count());
            let args = [name.to_string(), needs.to_string(), has];
            self.found.push(Diagnostic::new(code::MACHINE_JOINTS, self.file, span(raw.kinematics.span()), &args));
        }
        match table.kind {
            ChainKey::Cartesian => {
                if let Some(links) = &table.links {
                    self.value(links.span(), "`cartesian` has no links");
                }
                Chain::Cartesian
            }
            ChainKey::Planar3r => Chain::Planar3r(self.links(raw, table)),
        }
    }

    fn links(&mut self, raw: &File, table: &KinematicsTable) -> [f64; 3] {
        let Some(links) = &table.links else {
            self.value(raw.kinematics.span(), "`links` is missing: upper arm, forearm, tool in mm");
            return [1.0; 3];
        };
        match links.get_ref()[..] {
            [a, b, c] if [a, b, c].iter().all(|l| l.is_finite()) && a > 0.0 && b > 0.0 && c >= 0.0 => [a, b, c],
            _ => {
                self.value(links.span(), "`links` are three lengths above zero: upper arm, forearm, tool");
                [1.0; 3]
            }
        }
    }

    fn start_joints(&mut self, raw: &File, joints: &[Joint]) -> Option<Vec<f64>> {
        let given = raw.start.joints.as_ref()?;
        if given.get_ref().len() != joints.len() {
            self.value(given.span(), format!("{} start values for {} joints", given.get_ref().len(), joints.len()));
            return None;
        }
        let mut values = Vec::with_capacity(joints.len());
        for (v, j) in given.get_ref().iter().zip(joints) {
            let v = if j.kind == JointKind::Revolute { v.to_radians() } else { *v };
            if !j.allows(v) || !v.is_finite() {
                self.value(given.span(), format!("the start value of joint `{}` is outside its limits", j.name));
            }
            values.push(v);
        }
        Some(values)
    }
}

fn cartesian(kinds: &[JointKey]) -> bool {
    (1..=9).contains(&kinds.len())
        && kinds.iter().enumerate().all(|(i, k)| ((3..6).contains(&i)) == (*k == JointKey::Revolute))
}

fn good_id(id: &str) -> bool {
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
            let found = parse(FileId(0), bad).expect_err(row.code);
            assert_eq!(found.iter().map(|d| d.code.def().code).collect::<Vec<_>>(), [row.code]);
            parse(FileId(0), good).unwrap_or_else(|e| panic!("{}: {e:?}", row.code));
            tried += 1;
        }
        assert_eq!(tried, 3);
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
