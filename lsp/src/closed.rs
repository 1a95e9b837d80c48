//! Programs of the folders that are not open: what is wrong with them, for clients that ask about the whole workspace.
//! A few are looked at for every question, and remembered until something they are made of changes. What the chosen
//! robot says of them is left out: that is worked out for open documents only.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use gr_driver::Session;
use tower_lsp::ls_types as lsp;

use crate::analysis::HEAD;
use crate::documents::{Document, Kind, View, kind_of};
use crate::host::{Host, Station};
use crate::settings::Settings;
use crate::text::{Columns, Text};
use crate::workspace::Workspace;

/// Programs that are begun for one question.
const AT_ONCE: usize = 8;
/// Larger files are not looked at, bytes.
const MOST_BYTES: u64 = 2_000_000;

/// What a file is recognized by.
type Stamp = Option<(SystemTime, u64)>;

/// When a file was changed, and its size; none of what is no stored file: a pipe that nobody writes to would never end.
pub fn stamp(path: &Path) -> Stamp {
    let meta = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
    Some((meta.modified().ok()?, meta.len()))
}

/// What was found in a file, as it was then.
pub struct Looked {
    stamp: Stamp,
    /// Name of the list, and the list.
    found: (String, Vec<lsp::Diagnostic>),
}

/// What is known about programs that are not open.
#[derive(Default)]
pub struct Closed {
    known: BTreeMap<PathBuf, Looked>,
    /// Being looked at.
    begun: BTreeSet<PathBuf>,
}

impl Closed {
    /// Files that they are made of changed.
    pub fn forget(&mut self) {
        self.known.clear();
    }

    /// Takes in what was found.
    pub fn put(&mut self, path: PathBuf, found: Looked) {
        self.begun.remove(&path);
        self.known.insert(path, found);
    }

    /// Programs to be looked at next, and what is known of the others; `have` names what the client knows already.
    pub fn report(
        &mut self,
        workspace: &Workspace,
        open: &BTreeSet<PathBuf>,
        have: &BTreeMap<lsp::Uri, String>,
    ) -> (Vec<PathBuf>, Vec<lsp::WorkspaceDocumentDiagnosticReport>) {
        let (mut new, mut items) = (Vec::new(), Vec::new());
        let paths = workspace.programs_and_plans();
        self.known.retain(|path, _| paths.contains(path) && !open.contains(path));
        for path in paths {
            let Some(uri) = lsp::Uri::from_file_path(&path).filter(|_| !open.contains(&path)) else { continue };
            let now = stamp(&path);
            match self.known.get(&path).filter(|k| k.stamp == now) {
                Some(known) => items.push(item(uri, &known.found, have)),
                None if new.len() < AT_ONCE && now.is_some_and(|n| n.1 <= MOST_BYTES) && self.begun.insert(path.clone()) => new.push(path),
                None => {}
            }
        }
        (new, items)
    }
}

fn item(uri: lsp::Uri, (id, found): &(String, Vec<lsp::Diagnostic>), have: &BTreeMap<lsp::Uri, String>) -> lsp::WorkspaceDocumentDiagnosticReport {
    if have.get(&uri) == Some(id) {
        let same = lsp::UnchangedDocumentDiagnosticReport { result_id: id.clone() };
        return lsp::WorkspaceUnchangedDocumentDiagnosticReport { uri, version: None, unchanged_document_diagnostic_report: same }.into();
    }
    let full = lsp::FullDocumentDiagnosticReport { result_id: Some(id.clone()), items: found.clone() };
    lsp::WorkspaceFullDocumentDiagnosticReport { uri, version: None, full_document_diagnostic_report: full }.into()
}

/// Looks at one of them.
pub fn look(path: &Path, columns: Columns, settings: Arc<Settings>, host: Arc<dyn Host>, workspace: Arc<Workspace>, station: Arc<Station>) -> Looked {
    let stamp = stamp(path);
    let work = || of_file(path, columns, settings, host, workspace, station);
    // A mistake of the server must not take the worker with it; that nothing is said then is said for open documents.
    let found = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)).ok().flatten();
    Looked { stamp, found: found.unwrap_or_default() }
}

fn of_file(
    path: &Path,
    columns: Columns,
    settings: Arc<Settings>,
    host: Arc<dyn Host>,
    workspace: Arc<Workspace>,
    station: Arc<Station>,
) -> Option<(String, Vec<lsp::Diagnostic>)> {
    let text = Text::new(&crate::workspace::stored(path)?);
    let head = text.slice(gr_text::Span::new(0, HEAD));
    let station = Arc::new(Station { machine: None, ..(*station).clone() });
    let mut session = Session::new();
    let kind = kind_of(path, "", &head).unwrap_or_else(|| {
        let dialect = (station.dialect_of)(path, &head);
        Kind::Gcode(session.open(&path.to_string_lossy(), &text.to_string(), station.options(dialect)), dialect)
    });
    let document = Document::new(lsp::Uri::from_file_path(path)?, path.to_path_buf(), String::new(), 0, Arc::new(text), kind, station);
    let view = View::new(&document, columns, settings, host, workspace, Arc::default(), Some(session.snapshot()));
    crate::features::pulled(view).ok()
}
