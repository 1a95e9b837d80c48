//! Job files: which piece of a program is made in which clamping of the part. What a file says and what is wrong with
//! it in itself; whether it fits a program is seen where the program is known.

use crate::keys::{self, JOB};
use crate::math::Frame;
use crate::tree::{self, Node};
use gr_text::{Diagnostic, FileId, Span, code};
use std::ops::Range;

/// A clamping of the part.
#[derive(Clone, PartialEq, Debug)]
pub struct Clamping {
    /// Shown to the operator.
    pub name: String,
    /// Where the name stands.
    pub place: Span,
    /// The line it begins at, from 1, and where that stands.
    pub from_line: Option<(u32, Span)>,
    /// Workingsteps that are made in it, by their names or instance names, and where they stand.
    pub workingsteps: Vec<(String, Span)>,
    /// The part on the table, as far as the setup says it.
    part: Frame,
    /// Whether the setup says position and rotation.
    says: [bool; 2],
}

impl Clamping {
    /// The part on the table; none when the setup says no place, so that all is as the machine file has it. Of a place the
    /// part that the setup leaves out is as the file has it.
    pub fn part(&self, file: &Frame) -> Option<Frame> {
        let [position, rotation] = self.says;
        (position || rotation).then_some(Frame {
            position: if position { self.part.position } else { file.position },
            turn: if rotation { self.part.turn } else { file.turn },
        })
    }
}

/// Reads a job file. Every fault found is in the list.
pub fn parse_job(file: FileId, text: &str) -> Result<Vec<Clamping>, Vec<Diagnostic>> {
    let root = match tree::read(text) {
        Ok(root) => root,
        Err(e) => {
            let place = e.span().map(span).unwrap_or_default();
            return Err(vec![Diagnostic::new(code::JOB_BAD_FILE, file, place, &[e.message().trim().replace('\n', "; ")])]);
        }
    };
    let bad = |code| move |(place, what): (Range<usize>, String)| Diagnostic::new(code, file, span(place), &[what]);
    let form: Vec<Diagnostic> = keys::faults(&root, JOB, "a job file").into_iter().map(bad(code::JOB_BAD_FILE)).collect();
    if !form.is_empty() {
        return Err(form);
    }
    let mut found: Vec<Diagnostic> = keys::out_of_bounds(&root, JOB).into_iter().map(bad(code::JOB_BAD_VALUE)).collect();
    let setups: Vec<Clamping> = root.get("setup").map_or(&[][..], Node::list).iter().map(clamping).collect();
    let told = |(place, what, help): Fault| Diagnostic { help: help.map(str::to_string), ..Diagnostic::new(code::JOB_BAD_VALUE, file, place, &[what]) };
    found.extend(faults(&setups).into_iter().map(told));
    if setups.is_empty() {
        found.push(Diagnostic::new(code::JOB_BAD_VALUE, file, Span::default(), &["there is no setup in the job file".to_string()]));
    }
    if found.is_empty() { Ok(setups) } else { Err(found) }
}

fn span(range: Range<usize>) -> Span {
    let clip = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
    Span::new(clip(range.start), clip(range.end))
}

fn clamping(t: &Node) -> Clamping {
    let line = t.get("from_line").and_then(|n| Some((n.number()? as u32, span(n.span.clone()))));
    let steps = t.get("workingsteps").map_or(&[][..], Node::list);
    Clamping {
        name: t.string("name").unwrap_or_default(),
        place: t.get("name").map_or_else(Span::default, |n| span(n.span.clone())),
        from_line: line,
        workingsteps: steps.iter().filter_map(|n| Some((n.text()?.to_string(), span(n.span.clone())))).collect(),
        part: crate::schema::place(t),
        says: ["position", "rotation"].map(|key| t.get(key).is_some()),
    }
}

/// What helps where workingsteps are named so that one can't be told from another.
pub const WORKINGSTEP_NAMES: &str = "workingsteps that share a name are told apart by their instance names, as in \"#59\"; `--target plan` lists them";

/// Where, what, and what helps.
type Fault = (Span, String, Option<&'static str>);

/// What setups can't be together.
fn faults(setups: &[Clamping]) -> Vec<Fault> {
    let mut out = Vec::new();
    let mut last: Option<(u32, &str)> = None;
    for (i, s) in setups.iter().enumerate() {
        if setups[..i].iter().any(|e| e.name == s.name) {
            out.push((s.place, format!("there is another setup with the name `{}`", s.name), None));
        }
        if s.from_line.is_none() && s.workingsteps.is_empty() {
            out.push((s.place, format!("setup `{}` needs `from_line` or `workingsteps`", s.name), None));
        }
        if let Some((line, place)) = s.from_line {
            if let Some((before, name)) = last.filter(|(before, _)| line <= *before) {
                let what = format!("setup `{}` begins at line {line}, but setup `{name}` before it at line {before}: setups stand in the order of their lines", s.name);
                out.push((place, what, None));
            }
            last = Some((line, &s.name));
        }
        for (n, (step, place)) in s.workingsteps.iter().enumerate() {
            let same = |other: &Clamping| other.workingsteps.iter().any(|(o, _)| o == step);
            if s.workingsteps[..n].iter().any(|(o, _)| o == step) {
                out.push((*place, format!("workingstep `{step}` stands here twice"), None));
            } else if let Some(other) = setups[..i].iter().find(|e| same(e)) {
                out.push((*place, format!("workingstep `{step}` stands in setup `{}` too", other.name), Some(WORKINGSTEP_NAMES)));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> String {
        let found = parse_job(FileId(0), text).err().unwrap_or_default();
        found.iter().map(|d| format!("{} `{}`: {}\n", d.code.def().code, &text[d.primary().1.range()], d.message)).collect()
    }

    #[test]
    fn a_good_file() {
        let text = "[[setup]]\nname = \"top\"\nfrom_line = 1\n[[setup]]\nname = \"side\"\nfrom_line = 20\nposition = [0, 50, 0]\nrotation = [90, 0, 0]\n[[setup]]\nname = \"back\"\nworkingsteps = [\"WS 1\", \"WS 2\"]\n";
        let job = parse_job(FileId(0), text).unwrap_or_else(|e| panic!("{e:?}"));
        assert_eq!(job.iter().map(|s| s.from_line.map(|(l, _)| l)).collect::<Vec<_>>(), [Some(1), Some(20), None]);
        assert_eq!(job[1].part.position, [0.0, 50.0, 0.0]);
        // A setup without a place leaves the part where the machine file has it.
        let file = Frame { position: [1.0, 2.0, 3.0], ..Frame::default() };
        assert_eq!((job[0].part(&file), job[1].part(&file).map(|p| p.position)), (None, Some([0.0, 50.0, 0.0])));
        assert_eq!(job[2].workingsteps.len(), 2);
    }

    #[test]
    fn the_example_of_the_documentation() {
        let page = include_str!("../../../docs/robots.md");
        let text = page.split("```toml").nth(1).and_then(|t| t.split("```").next()).unwrap();
        let job = parse_job(FileId(0), text).unwrap_or_else(|e| panic!("{e:?}"));
        assert_eq!(job.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["top", "turned"]);
    }

    #[test]
    fn faults_stand_at_their_place() {
        let one = "[[setup]]\nname = \"a\"\n";
        let cases = [
            "",
            "setup = 3\n",
            "[[setup]\n",
            one,
            &format!("{one}from_line = 1\nfoo = 3\n"),
            &format!("{one}from_line = 0\n"),
            &format!("{one}from_line = 1.5\n"),
            &format!("{one}from_line = 1\nposition = [nan, 0, 0]\n"),
            &format!("{one}from_line = 1\nrotation = [0, 0]\n"),
            &format!("{one}from_line = 40\n[[setup]]\nname = \"b\"\nfrom_line = 14\n"),
            &format!("{one}from_line = 14\n[[setup]]\nname = \"a\"\nfrom_line = 14\n"),
            &format!("{one}workingsteps = []\n"),
            &format!("{one}workingsteps = [\"x\", \"x\"]\n[[setup]]\nname = \" \"\nworkingsteps = [\"x\"]\n"),
        ];
        let all: String = cases.iter().map(|c| format!("---\n{c}>>>\n{}", told(c))).collect();
        insta::assert_snapshot!(all);
    }
}
