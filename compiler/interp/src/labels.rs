//! Labels of O-words: names as numbers, where each label was met, and what is wrong with one.
//!
//! A run that goes on where another one stopped does not take its labels over one by one: it asks [`Files`] for those
//! that it needs.
//!
//! [`Files`]: crate::Files

use gr_canon::{FileId, Sink};
use gr_gcode::Keyword;
use gr_spec::{Rs274, code, rs274};
use rustc_hash::FxHashMap;

use crate::statements::op_name;
use crate::{Fault, Interp, Res};

/// Names as numbers.
#[derive(Default)]
pub(crate) struct Symbols {
    map: FxHashMap<Box<str>, u32>,
    names: Vec<Box<str>>,
    numbers: FxHashMap<i32, u32>,
}

impl Symbols {
    pub fn of(&mut self, name: &str) -> u32 {
        if let Some(id) = self.map.get(name) {
            return *id;
        }
        let id = self.names.len() as u32;
        self.names.push(name.into());
        self.map.insert(name.into(), id);
        id
    }
    /// A name that is a number: loops ask for the same ones all the time.
    pub fn of_number(&mut self, number: i32) -> u32 {
        if let Some(id) = self.numbers.get(&number) {
            return *id;
        }
        let id = self.of(&number.to_string());
        self.numbers.insert(number, id);
        id
    }
    pub fn name(&self, id: u32) -> &str {
        self.names.get(id as usize).map_or("", |n| n)
    }
}

/// Labels of subroutines and calls.
pub(crate) const GLOBAL: u32 = u32::MAX;
/// Labels of loops and branches in the main program.
pub(crate) const MAIN: u32 = u32::MAX - 1;

/// A label: the subroutine it belongs to, and its name.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Label {
    pub scope: u32,
    pub name: u32,
}

impl Label {
    /// It belongs to a subroutine, not to the main program or to all.
    pub fn is_subroutine_scope(&self) -> bool {
        self.scope < MAIN
    }
}

/// Where a label was met first.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct LabelAt {
    pub(crate) keyword: Keyword,
    pub(crate) file: FileId,
    pub(crate) line: u32,
    /// The controller's line number of the line before.
    pub(crate) sequence: i32,
    pub(crate) shift: i32,
    pub(crate) repeats: i32,
}

impl LabelAt {
    /// File.
    pub fn file(&self) -> FileId {
        self.file
    }
    /// Line of the file.
    pub fn line(&self) -> u32 {
        self.line
    }
    /// The same on another line: its distance to the opening `%` stays.
    pub fn on_line(self, line: u32) -> LabelAt {
        let by = (line as i32).wrapping_sub(self.line as i32);
        LabelAt { line, sequence: self.sequence.wrapping_add(by), ..self }
    }
}

/// A label by its own name and its subroutine's: what tells labels apart in every run.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct LabelName {
    /// The two scopes that are no subroutine keep their numbers.
    scope: u32,
    scope_name: Box<str>,
    name: Box<str>,
}

/// Labels that a run has met.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Met {
    /// In the order of their names.
    pub labels: Vec<(LabelName, LabelAt)>,
    /// An error made the controller forget the labels of earlier runs.
    pub forgot: bool,
}

/// The labels a run knows.
#[derive(Default)]
pub(crate) struct LabelTable {
    pub met: FxHashMap<Label, LabelAt>,
    /// Labels of earlier runs as far as they were asked for. None: there are no earlier runs, or they are forgotten.
    pub earlier: Option<FxHashMap<Label, LabelAt>>,
}

impl LabelTable {
    pub fn forget(&mut self) {
        self.met.clear();
        self.earlier = None;
    }
}

impl<S: Sink> Interp<'_, S> {
    /// Where a label was met.
    pub(crate) fn known_label(&mut self, label: Label) -> Option<LabelAt> {
        if let Some(at) = self.labels.met.get(&label) {
            return Some(*at);
        }
        if let Some(at) = self.labels.earlier.as_ref()?.get(&label) {
            return Some(*at);
        }
        let at = self.files.earlier_label(&self.whole_name(label))?;
        self.labels.earlier.as_mut()?.insert(label, at);
        Some(at)
    }

    fn whole_name(&self, label: Label) -> LabelName {
        let sub = label.is_subroutine_scope();
        let scope_name = if sub { self.symbols.name(label.scope) } else { "" };
        let scope = if scope_name.is_empty() { label.scope } else { 0 };
        LabelName { scope, scope_name: scope_name.into(), name: self.symbols.name(label.name).into() }
    }

    /// Labels that this run has met.
    pub fn met(&self) -> Met {
        let mut labels: Vec<_> = self.labels.met.iter().map(|(label, at)| (self.whole_name(*label), *at)).collect();
        labels.sort_by(|a, b| a.0.cmp(&b.0));
        Met { labels, forgot: self.labels.earlier.is_none() }
    }

    pub(crate) fn full_name(&self, label: Label) -> String {
        let name = self.symbols.name(label.name);
        match label.scope {
            GLOBAL => name.to_string(),
            MAIN => format!("#{name}"),
            sub => format!("{}#{name}", self.symbols.name(sub)),
        }
    }

    pub(crate) fn label_fault(&self, rs: Rs274, label: Label, what: &str) -> Box<Fault> {
        let name = format!("o-word label {}", self.symbols.name(label.name));
        Fault::new(code::FLOW_LABEL, rs).own_args(&[&name, what])
    }

    pub(crate) fn label_message(&self, rs: Rs274, label: Label, what: &str, found: Option<&LabelAt>) -> Box<Fault> {
        let mut args = vec![self.sequence().to_string(), self.line_text().trim_end().to_string()];
        if let Some(at) = found {
            args.push(op_name(at.keyword).to_string());
            args.push((at.sequence + 1).to_string());
        }
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        with_args(self.label_fault(rs, label, what), &args)
    }

    pub(crate) fn expect_label(&mut self, label: Label) -> Res<LabelAt> {
        self.known_label(label).ok_or_else(|| {
            self.label_message(rs274::RT_O_UNDEFINED_LABEL, label, "nothing begins with this label", None)
        })
    }

    pub(crate) fn note_label(&mut self, label: Label, keyword: Keyword) -> Res {
        if let Some(at) = self.known_label(label) {
            let name = self.full_name(label);
            let file = self.files.file(self.place.file).path.to_string();
            let other = self.files.file(at.file).path.to_string();
            let line = self.sequence().to_string();
            let same = self.sequence() - 1 == at.sequence;
            let what = if same { "the subroutine is defined where it can't be" } else { "it is defined twice" };
            let fault = self.label_fault(if same { rs274::RT_O_ILLEGAL_PLACE } else { rs274::RT_O_REDEFINED }, label, what);
            return Err(with_args(fault, &[&file, &line, &name, &other]));
        }
        let at = LabelAt {
            keyword,
            file: self.place.file,
            line: self.place.line,
            sequence: self.sequence() - 1,
            shift: self.shift,
            repeats: -1,
        };
        self.labels.met.insert(label, at);
        Ok(())
    }


    pub(crate) fn check_duplicate(&mut self, label: Label, keyword: Keyword, also: Option<Keyword>) -> Res {
        let Some(at) = self.known_label(label) else { return self.note_label(label, keyword) };
        if Some(at.keyword) == also || self.sequence() == at.sequence + 1 {
            return Ok(());
        }
        let what = "it is used at two places of this subroutine";
        let (sequence, line, first) = (self.sequence().to_string(), self.line_text().trim_end().to_string(), (at.sequence + 1).to_string());
        Err(if keyword == Keyword::If {
            with_args(self.label_fault(rs274::RT_O_DUPLICATE_IF, label, what), &[&sequence, &first, &line])
        } else {
            with_args(self.label_fault(rs274::RT_O_DUPLICATE, label, what), &[&sequence, &line, &first])
        })
    }
}

pub(crate) fn with_args(mut fault: Box<Fault>, args: &[&str]) -> Box<Fault> {
    if fault.own_args.is_empty() {
        fault.own_args = std::mem::take(&mut fault.args);
    }
    fault.args = args.iter().map(|a| (*a).to_string()).collect();
    fault
}
