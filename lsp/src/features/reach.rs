//! Which files of a workspace call each other, as the controller finds subroutines: those of the file itself that it
//! has come past, then the file of that name on the search path or beside the program. What a name means, and so what
//! it takes to rename it, follows from that. Files are those of one dialect; nothing is run here but to prove that a
//! new name changes nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gr_driver::{Overlay, plain_path};
use gr_gcode::{File, Label};
use gr_ide::gcode::names::{self, CallSite};
use gr_ide::gcode;
use gr_ide::{Occurrence, Role};
use gr_interp::Setup;
use gr_spec::Dialect;
use tower_lsp::ls_types as lsp;

use super::names::file_name;
use crate::documents::{Kind, View};

/// Where a call leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Home {
    /// To a subroutine of a file: its number.
    File(usize),
    /// The file has such a subroutine further down, and there is a file of that name: which one it is depends on the way
    /// that execution takes.
    Unclear,
    /// No such subroutine is found: the program that calls this file may have it.
    Nowhere,
}

/// A file and its calls.
pub(super) struct Reached {
    pub path: PathBuf,
    pub uri: lsp::Uri,
    pub file: Arc<File>,
    /// Its own subroutines.
    pub subs: Vec<names::Sub>,
    pub calls: Vec<(CallSite, Home)>,
}

/// The document, number 0, and the other programs of the workspace.
pub(super) struct Reach {
    pub files: Vec<Reached>,
    pub dialect: &'static Dialect,
}

/// Programs that are run to prove a new name, bytes altogether.
const MOST_PROVEN: usize = 8_000_000;

/// Files that a subroutine may be in when a program calls it.
fn candidates(setup: &Setup, from: &Path, name: &str) -> Vec<PathBuf> {
    if name.is_empty() || name.contains(['/', '\\']) || name.contains("..") {
        return Vec::new();
    }
    let beside = from.parent().map(|folder| folder.join(format!("{name}.ngc")));
    gr_interp::subroutine_paths(setup, name).into_iter().chain(beside).map(|p| plain_path(&p)).collect()
}

fn is_there(view: &View, path: &Path) -> bool {
    path.is_file() || view.others.iter().any(|o| o.path == path)
}

impl Reach {
    /// Looks at all programs of the workspace.
    pub fn of(view: &mut View) -> super::Answer<Option<Reach>> {
        Ok(view.program()?.map(|tables| Reach::with(view, tables)))
    }

    /// The same when the document's own tables are at hand.
    pub fn with(view: &View, (file, dialect): (Arc<File>, &'static Dialect)) -> Reach {
        let own = (view.path.clone(), view.uri.clone(), file);
        let all = std::iter::once(own).chain(view.other_programs());
        let reached = |(path, uri, file): (PathBuf, lsp::Uri, Arc<File>)| {
            let subs = names::subs(gcode::Doc { file: &file, dialect });
            Reached { path, uri, file, subs, calls: Vec::new() }
        };
        let mut reach = Reach { files: all.map(reached).collect(), dialect };
        let setup = view.station.setup_for(dialect);
        let mut at = 0;
        while at < reach.files.len() {
            reach.find_calls(view, &setup, at);
            at += 1;
        }
        reach
    }

    /// Where the calls of a file lead; files outside of the workspace that they lead to are added.
    fn find_calls(&mut self, view: &View, setup: &Setup, at: usize) {
        let sites = names::calls(self.doc(at));
        let mut known: BTreeMap<Label, Option<usize>> = BTreeMap::new();
        let mut calls = Vec::with_capacity(sites.len());
        for site in sites {
            let outside = match known.get(&site.label) {
                Some(known) => *known,
                None => {
                    let found = self.find_file(view, setup, at, &site.label);
                    known.insert(site.label.clone(), found);
                    found
                }
            };
            let own = self.files[at].subs.iter().find(|s| s.label == site.label);
            let home = match (own, outside) {
                (Some(own), Some(file)) if file != at && own.first > site.line => Home::Unclear,
                (Some(_), _) => Home::File(at),
                (None, Some(file)) => Home::File(file),
                (None, None) => Home::Nowhere,
            };
            calls.push((site, home));
        }
        self.files[at].calls = calls;
    }

    fn find_file(&mut self, view: &View, setup: &Setup, at: usize, label: &Label) -> Option<usize> {
        let path = candidates(setup, &self.files[at].path, &file_name(label)).into_iter().find(|p| is_there(view, p))?;
        if let Some(known) = self.files.iter().position(|f| plain_path(&f.path) == path) {
            return Some(known);
        }
        let (uri, file) = view.file_at(&path)?;
        let subs = names::subs(gcode::Doc { file: &file, dialect: self.dialect });
        self.files.push(Reached { path, uri, file, subs, calls: Vec::new() });
        Some(self.files.len() - 1)
    }

    /// A file as features read it.
    pub fn doc(&self, at: usize) -> gcode::Doc<'_> {
        gcode::Doc { file: &self.files[at].file, dialect: self.dialect }
    }
    /// Its text.
    pub fn text(&self, at: usize) -> String {
        self.doc(at).text()
    }
    /// Its name in messages.
    pub fn name(&self, at: usize) -> String {
        self.files[at].path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
    }
    /// The file with this name.
    pub fn find(&self, uri: &lsp::Uri) -> Option<usize> {
        self.files.iter().position(|f| f.uri == *uri)
    }
    /// A subroutine of a file.
    pub fn sub(&self, at: usize, label: &Label) -> Option<&names::Sub> {
        self.files[at].subs.iter().find(|s| s.label == *label)
    }

    /// Where a subroutine that a place of the document names is: at a call where that leads, else in the document.
    pub fn home(&self, label: &Label, offset: u32) -> Home {
        let site = |c: &&(CallSite, Home)| c.0.label == *label && c.0.span.start.saturating_sub(2) <= offset && offset <= c.0.span.end;
        match self.files[0].calls.iter().find(site) {
            Some(call) => call.1,
            None if self.sub(0, label).is_some() => Home::File(0),
            None => Home::Nowhere,
        }
    }

    /// Where the subroutine of a file is named: there, and in the calls that lead to it.
    pub fn of_sub(&self, home: usize, label: &Label) -> Vec<(usize, Vec<Occurrence>)> {
        let at = |i: usize| {
            if i == home {
                return names::occurrences(self.doc(i), &names::Name::Sub(label.clone()), None);
            }
            let calls = self.files[i].calls.iter().filter(|c| c.0.label == *label && c.1 == Home::File(home));
            calls.map(|c| Occurrence { span: c.0.span, role: Role::Read }).collect()
        };
        (0..self.files.len()).map(|i| (i, at(i))).filter(|f| !f.1.is_empty()).collect()
    }

    /// A file, those that it calls and those that call it, and so on: they share their global parameters.
    pub fn connected(&self, from: usize) -> BTreeSet<usize> {
        let leads = |i: usize| self.files[i].calls.iter().filter_map(|c| if let Home::File(to) = c.1 { Some(to) } else { None });
        let mut pairs: BTreeSet<(usize, usize)> = BTreeSet::new();
        for i in 0..self.files.len() {
            pairs.extend(leads(i).filter(|to| *to != i).flat_map(|to| [(i, to), (to, i)]));
        }
        let (mut found, mut open) = (BTreeSet::from([from]), vec![from]);
        while let Some(i) = open.pop() {
            for (_, to) in pairs.range((i, 0)..(i + 1, 0)) {
                if found.insert(*to) {
                    open.push(*to);
                }
            }
        }
        found
    }

    /// Why a subroutine can't have this name: there would be two of it.
    pub fn sub_taken(&self, view: &View, at: &[usize], new: &Label) -> Option<String> {
        let setup = view.station.setup_for(self.dialect);
        let found = at.iter().find_map(|i| candidates(&setup, &self.files[*i].path, &file_name(new)).into_iter().find(|p| is_there(view, p)))?;
        Some(format!("there is already a file {}", found.file_name().unwrap_or_default().to_string_lossy()))
    }

    /// Runs all programs that have to do with the edited files, before and after: `Err` says what would change.
    pub fn prove(&self, view: &View, edited: &BTreeMap<usize, String>, moved: Option<(usize, &Path)>) -> Result<(), String> {
        let roots: BTreeSet<usize> = edited.keys().flat_map(|i| self.connected(*i)).collect();
        if roots.iter().map(|i| self.doc(*i).len() as usize).sum::<usize>() > MOST_PROVEN {
            return Err("the programs are too large to make sure that they stay the same".into());
        }
        // What nobody has open is on disk as it was read.
        let mut before: Overlay = roots.iter().map(|i| (plain_path(&self.files[*i].path), Some(Arc::from(self.text(*i))))).collect();
        before.extend(view.others.iter().filter(|o| matches!(o.kind, Kind::Gcode(..))).map(|o| (plain_path(&o.path), Some(Arc::from(o.text.to_string())))));
        let mut after = before.clone();
        for (i, text) in edited {
            after.insert(plain_path(&self.files[*i].path), Some(Arc::from(text.as_str())));
        }
        if let Some((i, to)) = moved {
            let text = after.insert(plain_path(&self.files[i].path), None).flatten();
            after.insert(plain_path(to), text);
        }
        for i in roots {
            let path = &self.files[i].path;
            let own = path.parent() == view.path.parent();
            let station = if own { view.station.clone() } else { Arc::new(view.host.station(path, &view.settings)) };
            let text = self.text(i);
            let dialect = (station.dialect_of)(path, &text);
            if dialect.family == gr_spec::Family::Ufmg2008 {
                continue;
            }
            let setup = beside(station.setup_for(dialect), path);
            let new: Arc<str> = edited.get(&i).map_or_else(|| Arc::from(text.as_str()), |t| Arc::from(t.as_str()));
            let name = path.to_string_lossy();
            let was = gr_driver::deeds(&name, Arc::from(text), &setup, before.clone());
            let (Some(was), Some(is)) = (was, gr_driver::deeds(&name, new, &setup, after.clone())) else {
                return Err(format!("{} runs too long to make sure that it stays the same", self.name(i)));
            };
            if was != is {
                return Err(format!("{} would not do the same any more", self.name(i)));
            }
        }
        Ok(())
    }
}

/// Subroutines are looked for beside the program too, after all other places.
fn beside(mut setup: Setup, path: &Path) -> Setup {
    if let Some(folder) = path.parent() {
        let key = ("rs274ngc".to_string(), "subroutine_path".to_string());
        let known = setup.ini.get("rs274ngc", "subroutine_path").map(|p| format!("{p}:")).unwrap_or_default();
        setup.ini.values.insert(key, vec![format!("{known}{}", folder.display())]);
    }
    setup
}
