//! The thread that owns the database: applies what the client says in the order it was said, hands out views to
//! workers, and has diagnostics found when nothing else is waiting.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::time::Duration;

use gr_driver::Session;
use gr_text::{Diagnostic, Span};
use tower_lsp::ls_types as lsp;

use crate::closed::{Closed, Looked};
use crate::documents::{Document, Kind, OpenFile, View, kind_of};
use crate::host::{Host, Station};
use crate::protocol;
use crate::settings::Settings;
use crate::text::{Columns, Text};
use crate::workspace::Workspace;

/// What the thread is asked to do.
pub enum Message {
    /// A document was opened.
    Open { uri: lsp::Uri, language: String, version: i32, text: gr_text::Text },
    /// … edited.
    Change { uri: lsp::Uri, version: i32, changes: Vec<lsp::TextDocumentContentChangeEvent> },
    /// … closed.
    Close { uri: lsp::Uri },
    /// Files on disk changed.
    Disk { paths: Vec<PathBuf> },
    /// How the client counts columns, and whether it says which files change on disk.
    Client { columns: Columns, watching: bool },
    /// Settings.
    Settings(Box<Settings>),
    /// Settings of folders, where there are several.
    FolderSettings(Vec<(PathBuf, Settings)>),
    /// Folders.
    Folders { added: Vec<PathBuf>, removed: Vec<PathBuf> },
    /// A question about a document; `None` when it is not open.
    Ask { uri: lsp::Uri, work: Box<dyn FnOnce(Option<View>) + Send> },
    /// A question about the server.
    AskAll { work: Box<dyn FnOnce(&Analysis) + Send> },
    /// What was found in programs of the folders that are not open; `known` names what the client has.
    AskClosed { known: BTreeMap<lsp::Uri, String>, work: Box<dyn FnOnce(Vec<lsp::WorkspaceDocumentDiagnosticReport>) + Send> },
    /// A program that is not open was looked at.
    Closed { path: PathBuf, found: Looked },
    /// Diagnostics of the lines around the last edit were found; those of the rest follow.
    Early { uri: lsp::Uri, version: i32, lines: Range<u32>, found: Vec<Diagnostic> },
    /// Diagnostics of a version were found.
    Found { uri: lsp::Uri, version: i32, lane: usize, calls: bool, found: Option<Arc<Vec<Diagnostic>>> },
    /// Looking for diagnostics of a version broke off by a mistake of the server.
    Failed { uri: lsp::Uri, version: i32, lane: usize },
}

/// What goes to the client without being asked for.
pub enum Event {
    /// Diagnostics of a document, which is open or was.
    Diagnostics { uri: lsp::Uri, version: Option<i32>, diagnostics: Vec<lsp::Diagnostic>, open: bool },
    /// Something for the user to read.
    Say(lsp::MessageType, String),
    /// Diagnostics of a version are out.
    Analysed { uri: lsp::Uri, version: i32 },
    /// Looking at a big document takes a while: began (true) or ended.
    Busy { uri: lsp::Uri, begins: bool },
    /// Files or settings changed what hints, lenses and diagnostics show.
    Refresh,
}

/// Of a text, what says its dialect: more than the first 200 lines of any program that people read.
pub const HEAD: u32 = 65_536;

/// Larger files are not read from disk, bytes.
const MOST_ON_DISK: u64 = 1 << 30;

/// Documents of this size are worth a progress report.
const BIG: u32 = 4_000_000;

/// Big exchange files are looked at as a whole, which no edit cuts short: after this time without a key.
const QUIET: Duration = Duration::from_millis(300);

pub(crate) type Job = Box<dyn FnOnce() + Send>;

/// Workers that take one job after the other. A job that fails does not take the worker with it.
fn workers(count: usize) -> Sender<Job> {
    let (send, receive) = channel::<Job>();
    let receive = Arc::new(std::sync::Mutex::new(receive));
    for _ in 0..count {
        let receive = receive.clone();
        std::thread::spawn(move || {
            loop {
                let job = receive.lock().unwrap_or_else(std::sync::PoisonError::into_inner).recv();
                let Ok(job) = job else { return };
                let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(job));
            }
        });
    }
    send
}

/// Open documents and the database behind them.
pub struct Analysis {
    session: Session,
    documents: HashMap<lsp::Uri, Document>,
    stations: BTreeMap<PathBuf, Arc<Station>>,
    columns: Columns,
    watching: bool,
    /// When files on disk were looked at last, for clients that do not watch them.
    looked: Option<std::time::Instant>,
    settings: Arc<Settings>,
    of_folders: Vec<(PathBuf, Arc<Settings>)>,
    workspace: Arc<Workspace>,
    host: Arc<dyn Host>,
    /// Files of stations whose findings were published.
    told: BTreeMap<PathBuf, Vec<PathBuf>>,
    /// What was said about settings that lead nowhere: once is enough.
    said: BTreeSet<String>,
    closed: Closed,
    /// Files that are asked about and not open, as they were on disk; the last used at the end.
    unopened: Vec<(Option<(std::time::SystemTime, u64)>, Document)>,
    reads: Sender<Job>,
    /// Workers that look for diagnostics, one job each at a time: the second one is for big exchange files.
    checks: [Sender<Job>; 2],
    /// Those that have a job.
    checking: [bool; 2],
    background: Sender<Job>,
    own: Sender<Message>,
}

impl Analysis {
    /// Nothing is open. `own` leads back to this thread.
    pub fn new(host: Arc<dyn Host>, own: Sender<Message>) -> Analysis {
        Analysis {
            session: Session::new(),
            documents: HashMap::new(),
            stations: BTreeMap::new(),
            columns: Columns::default(),
            watching: false,
            looked: None,
            settings: Arc::default(),
            of_folders: Vec::new(),
            workspace: Arc::default(),
            host,
            told: BTreeMap::new(),
            said: BTreeSet::new(),
            closed: Closed::default(),
            unopened: Vec::new(),
            reads: workers(2),
            checks: [workers(1), workers(1)],
            checking: [false; 2],
            background: workers(1),
            own,
        }
    }

    /// Works until the queue's other end is gone.
    pub fn serve(mut self, queue: &Receiver<Message>, publish: &(impl Fn(Event) + Clone + Send + 'static)) {
        let mut wait = None;
        loop {
            let next = match wait {
                Some(time) => queue.recv_timeout(time),
                None => queue.recv().map_err(|_| RecvTimeoutError::Disconnected),
            };
            match next {
                Ok(first) => self.take(first, publish),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            loop {
                match queue.try_recv() {
                    Ok(next) => self.take(next, publish),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return,
                }
            }
            wait = self.check(publish);
        }
    }

    fn take(&mut self, message: Message, publish: &(impl Fn(Event) + Clone + Send + 'static)) {
        match message {
            Message::Open { uri, language, version, text } => self.open(uri, language, version, &text, publish),
            Message::Change { uri, version, changes } => self.change(&uri, version, changes),
            Message::Close { uri } => self.close(&uri, publish),
            Message::Disk { paths } => self.disk(&paths, publish),
            Message::Client { columns, watching } => (self.columns, self.watching) = (columns, watching),
            Message::Settings(settings) => {
                if *settings != *self.settings {
                    self.said.clear();
                    self.settings = Arc::new(*settings);
                    self.reload(publish);
                    publish(Event::Refresh);
                }
            }
            Message::FolderSettings(new) => {
                let same = new.len() == self.of_folders.len() && new.iter().zip(&self.of_folders).all(|(a, b)| a.0 == b.0 && a.1 == *b.1);
                if !same {
                    self.of_folders = new.into_iter().map(|(folder, settings)| (folder, Arc::new(settings))).collect();
                    self.said.clear();
                    self.reload(publish);
                    publish(Event::Refresh);
                }
            }
            Message::Folders { added, removed } => {
                let mut folders = self.workspace.folders();
                folders.retain(|f| !removed.contains(f));
                folders.extend(added);
                folders.sort();
                folders.dedup();
                if folders != self.workspace.folders() {
                    self.workspace.set_folders(folders);
                    self.reload(publish);
                }
            }
            Message::Ask { uri, work } => {
                let view = self.view(&uri).or_else(|| self.from_disk(&uri, publish));
                let _ = self.reads.send(Box::new(move || work(view)));
            }
            Message::AskAll { work } => work(self),
            Message::AskClosed { known, work } => {
                let open = self.documents.values().map(|d| d.path.clone()).collect();
                let (new, items) = self.closed.report(&self.workspace, &open, &known);
                for path in new {
                    self.look_at_closed(path, publish);
                }
                work(items);
            }
            Message::Closed { path, found } => self.closed.put(path, found),
            Message::Early { uri, version, lines, found } => self.early(&uri, version, &lines, found, publish),
            Message::Found { uri, version, lane, calls, found } => {
                self.checking[lane] = false;
                self.found(&uri, version, calls, found, publish);
            }
            Message::Failed { uri, version, lane } => {
                self.checking[lane] = false;
                self.failed(&uri, version, publish);
            }
        }
    }

    /// Columns of the client.
    pub fn columns(&self) -> Columns {
        self.columns
    }
    /// Folders.
    pub fn workspace(&self) -> &Arc<Workspace> {
        &self.workspace
    }
    /// All open documents.
    pub fn open_files(&self) -> Vec<OpenFile> {
        let mut all: Vec<OpenFile> = self
            .documents
            .values()
            .map(|d| OpenFile { path: d.path.clone(), uri: d.uri.clone(), version: d.version, text: d.text.clone(), kind: d.kind })
            .collect();
        all.sort_by(|a, b| a.path.cmp(&b.path));
        all
    }

    /// Settings for a file: those of its folder come before the general ones.
    fn settings_of(&self, path: &Path) -> Arc<Settings> {
        let holds = self.of_folders.iter().filter(|(folder, _)| path.starts_with(folder));
        let own = holds.max_by_key(|(folder, _)| folder.as_os_str().len()).map_or(&self.settings, |f| &f.1);
        let folders = self.workspace.folders();
        // Paths in them are relative to the folder that holds the file, and not to where the server was started.
        let open = folders.iter().filter(|f| path.starts_with(f)).max_by_key(|f| f.as_os_str().len()).or(folders.first());
        let from = open.map(PathBuf::as_path).or(path.parent()).unwrap_or(Path::new(""));
        Arc::new(Settings { folders: folders.clone(), ..own.below(from) })
    }

    /// What a request about a document works on.
    fn view(&self, uri: &lsp::Uri) -> Option<View> {
        self.documents.get(uri).map(|d| self.view_of(d))
    }

    /// The same of a file that is not open: editors do not hand over the text of very large ones. The last ones are kept
    /// until they change on disk.
    fn from_disk(&mut self, uri: &lsp::Uri, publish: &(impl Fn(Event) + Clone + Send + 'static)) -> Option<View> {
        const MOST: usize = 2;
        let path = uri.to_file_path().map(|p| p.into_owned()).filter(|p| self.workspace.holds(p))?;
        let stamp = crate::closed::stamp(&path).filter(|s| s.1 <= MOST_ON_DISK);
        if let Some(at) = self.unopened.iter().position(|(s, d)| d.uri == *uri && *s == stamp && stamp.is_some()) {
            let known = self.unopened.remove(at);
            self.unopened.push(known);
        } else {
            self.forget_unopened(|d| d.uri == *uri);
            stamp?;
            let text = crate::workspace::stored(&path)?;
            let document = Document { open: false, ..self.document(uri.clone(), String::new(), 0, &text, publish) };
            if matches!(document.kind, Kind::Other) {
                return None;
            }
            self.unopened.push((stamp, document));
            if self.unopened.len() > MOST {
                let oldest = self.unopened[0].1.uri.clone();
                self.forget_unopened(|d| d.uri == oldest);
            }
        }
        self.unopened.last().map(|(_, d)| self.view_of(d))
    }

    fn forget_unopened(&mut self, which: impl Fn(&Document) -> bool) {
        let session = &mut self.session;
        self.unopened.retain(|(_, d)| {
            let gone = which(d);
            if let (true, Kind::Gcode(file, _)) = (gone, d.kind) {
                session.close(file);
            }
            !gone
        });
    }

    fn view_of(&self, document: &Document) -> View {
        let session = matches!(document.kind, Kind::Gcode(..)).then(|| self.session.snapshot());
        let others = self.open_files().into_iter().filter(|o| o.uri != document.uri).collect();
        let (settings, host, workspace) = (self.settings_of(&document.path), self.host.clone(), self.workspace.clone());
        View::new(document, self.columns, settings, host, workspace, Arc::new(others), session)
    }

    /// What programs below a folder are run with.
    fn station(&mut self, path: &Path, publish: &impl Fn(Event)) -> Arc<Station> {
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        if let Some(known) = self.stations.get(&folder) {
            return known.clone();
        }
        let station = Arc::new(self.host.station(path, &self.settings_of(path)));
        self.stations.insert(folder.clone(), station.clone());
        self.tell_station(&folder, &station, publish);
        station
    }

    /// Findings in project file, tool table, INI file and machine file: of those that are not open themselves.
    fn tell_station(&mut self, folder: &Path, station: &Station, publish: &impl Fn(Event)) {
        let mut by_file: BTreeMap<PathBuf, Vec<lsp::Diagnostic>> = BTreeMap::new();
        for old in self.told.remove(folder).unwrap_or_default() {
            by_file.insert(old, Vec::new());
        }
        for (path, text, d) in &station.found {
            let text = Text::new(text);
            by_file.entry(path.clone()).or_default().push(protocol::diagnostic(d, &text, self.columns, &|_| None));
        }
        self.told.insert(folder.to_path_buf(), station.found.iter().map(|f| f.0.clone()).collect());
        for (path, diagnostics) in by_file {
            if let Some(uri) = lsp::Uri::from_file_path(&path)
                && !self.documents.contains_key(&uri)
            {
                publish(Event::Diagnostics { uri, version: None, diagnostics, open: false });
            }
        }
        for text in &station.said {
            if self.said.insert(text.clone()) {
                publish(Event::Say(lsp::MessageType::WARNING, format!("gcc-robot settings: {text}")));
            }
        }
    }

    /// Has a program that is not open looked at, when nothing else is to be done.
    fn look_at_closed(&mut self, path: PathBuf, publish: &impl Fn(Event)) {
        let station = self.station(&path, publish);
        let (columns, settings, host, workspace) = (self.columns, self.settings_of(&path), self.host.clone(), self.workspace.clone());
        let own = self.own.clone();
        let job = move || {
            let found = crate::closed::look(&path, columns, settings, host, workspace, station);
            let _ = own.send(Message::Closed { path, found });
        };
        let _ = self.background.send(Box::new(job));
    }

    fn open(&mut self, uri: lsp::Uri, language: String, version: i32, text: &gr_text::Text, publish: &(impl Fn(Event) + Clone + Send + 'static)) {
        // A client that opens a document twice means the second text.
        self.forget(&uri);
        self.forget_unopened(|d| d.uri == uri);
        let document = self.document(uri.clone(), language, version, text, publish);
        self.callers_again(&uri);
        self.documents.insert(uri, document);
    }

    fn document(&mut self, uri: lsp::Uri, language: String, version: i32, text: &str, publish: &impl Fn(Event)) -> Document {
        let path = path_of(&uri);
        let station = self.station(&path, publish);
        let kind = kind_of(&path, &language, text).unwrap_or_else(|| {
            let dialect = (station.dialect_of)(&path, text);
            Kind::Gcode(self.session.open(&path.to_string_lossy(), text, station.options(dialect)), dialect)
        });
        Document::new(uri, path, language, version, Arc::new(Text::new(text)), kind, station)
    }

    fn change(&mut self, uri: &lsp::Uri, version: i32, changes: Vec<lsp::TextDocumentContentChangeEvent>) {
        let Some(document) = self.documents.get_mut(uri) else { return };
        for change in changes {
            let range = match change.range {
                Some(range) => {
                    let start = document.text.offset(range.start, self.columns);
                    start..document.text.offset(range.end, self.columns).max(start)
                }
                None => 0..document.text.len(),
            };
            document.focus = change.range.map_or(0, |r| r.start.line);
            move_along(Arc::make_mut(&mut document.found), &range, change.text.len() as u32);
            Arc::make_mut(&mut document.text).edit(range.clone(), &change.text);
            if let Kind::Gcode(file, _) = document.kind {
                self.session.edit(file, range, &change.text);
            }
        }
        document.version = version;
        document.latest.store(version, Ordering::Relaxed);
        document.edited = Some(std::time::Instant::now());
        document.stale = true;
        // Tables of a big file take a while to be put away: not beside the answers that are asked for now, but when it is looked at anew.
        let old = std::mem::take(&mut document.derived);
        let older = if old.is_much() { document.spent.replace(old) } else { Some(old) };
        let _ = self.background.send(Box::new(move || drop(older)));
        self.look_again(uri);
        self.callers_again(uri);
    }

    /// Other programs that call subroutines may call those of this one.
    fn callers_again(&mut self, changed: &lsp::Uri) {
        self.documents.values_mut().filter(|d| d.calls && d.uri != *changed).for_each(|d| d.stale = true);
    }

    /// The dialect may be declared in the first lines, and what the document is by its first characters.
    fn look_again(&mut self, uri: &lsp::Uri) {
        let Some(document) = self.documents.get_mut(uri) else { return };
        let head = document.text.slice(Span::new(0, HEAD));
        let config = matches!(document.kind, Kind::Config(_) | Kind::Ini | Kind::Other);
        let head = if config { document.text.to_string() } else { head };
        let new = kind_of(&document.path, &document.language, &head);
        match (document.kind, new) {
            (Kind::Gcode(file, old), None) => {
                let dialect = (document.station.dialect_of)(&document.path, &head);
                if !std::ptr::eq(dialect, old) {
                    document.kind = Kind::Gcode(file, dialect);
                    self.session.set_options(file, document.station.options(dialect));
                }
            }
            (Kind::Gcode(file, _), Some(kind)) => {
                self.session.close(file);
                document.kind = kind;
            }
            (_, None) => {
                let dialect = (document.station.dialect_of)(&document.path, &head);
                let text = document.text.to_string();
                let file = self.session.open(&document.path.to_string_lossy(), &text, document.station.options(dialect));
                document.kind = Kind::Gcode(file, dialect);
            }
            (_, Some(kind)) => document.kind = kind,
        }
    }

    fn forget(&mut self, uri: &lsp::Uri) {
        if let Some(Document { kind: Kind::Gcode(file, _), .. }) = self.documents.remove(uri) {
            self.session.close(file);
        }
    }

    fn close(&mut self, uri: &lsp::Uri, publish: &impl Fn(Event)) {
        self.forget(uri);
        self.callers_again(uri);
        publish(Event::Diagnostics { uri: uri.clone(), version: None, diagnostics: Vec::new(), open: false });
    }

    fn disk(&mut self, paths: &[PathBuf], publish: &(impl Fn(Event) + Clone + Send + 'static)) {
        self.workspace.forget();
        let known = |p: &PathBuf| {
            let name = p.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            let settles = matches!(p.extension().and_then(|e| e.to_str()), Some("toml" | "tbl" | "var" | "ini" | "inc"));
            name == "gcc-robot.toml" || settles || self.stations.values().any(|s| s.files.contains(p))
        };
        let (settles, programs) = (paths.iter().any(known), paths.iter().any(|p| crate::workspace::is_program(p)));
        if settles {
            self.reload(publish);
        }
        if settles || programs {
            self.closed.forget();
            publish(Event::Refresh);
        }
        if programs {
            self.session.disk_changed();
            self.documents.values_mut().filter(|d| matches!(d.kind, Kind::Gcode(..))).for_each(|d| {
                d.stale = true;
                d.derived = Arc::default();
            });
        }
    }

    /// Everything that programs are run with is read again.
    fn reload(&mut self, publish: &(impl Fn(Event) + Clone + Send + 'static)) {
        self.stations.clear();
        self.closed.forget();
        self.forget_unopened(|_| true);
        let uris: Vec<lsp::Uri> = self.documents.keys().cloned().collect();
        for uri in uris {
            let Some(path) = self.documents.get(&uri).map(|d| d.path.clone()) else { continue };
            let station = self.station(&path, publish);
            let Some(document) = self.documents.get_mut(&uri) else { continue };
            document.station = station;
            document.stale = true;
            document.derived = Arc::default();
            if let Kind::Gcode(file, _) = document.kind {
                let head = document.text.slice(Span::new(0, HEAD));
                let dialect = (document.station.dialect_of)(&document.path, &head);
                document.kind = Kind::Gcode(file, dialect);
                self.session.set_options(file, document.station.options(dialect));
            }
        }
    }

    /// For clients that do not watch files: programs that call others are run with what is on disk now.
    fn look_at_disk(&mut self) {
        const EVERY: std::time::Duration = std::time::Duration::from_secs(1);
        let due = self.looked.is_none_or(|t| t.elapsed() >= EVERY);
        if !self.watching && due && self.documents.values().any(|d| d.stale && d.calls) {
            self.session.disk_changed();
            self.looked = Some(std::time::Instant::now());
        }
    }

    /// Has diagnostics of changed documents found, small ones first. A view is made when a worker is free for it, so that
    /// none of an outdated version waits. Gives the time after which to come again.
    fn check(&mut self, publish: &(impl Fn(Event) + Clone + Send + 'static)) -> Option<Duration> {
        self.look_at_disk();
        let mut stale: Vec<(u32, lsp::Uri)> = self.documents.values().filter(|d| d.stale).map(|d| (d.text.len(), d.uri.clone())).collect();
        stale.sort();
        let mut wait: Option<Duration> = None;
        for (_, uri) in stale {
            let Some(document) = self.documents.get(&uri) else { continue };
            let lane = usize::from(matches!(document.kind, Kind::Exchange) && document.text.len() > BIG);
            if self.checking[lane] {
                continue;
            }
            if let Some(rest) = document.edited.filter(|_| lane == 1).and_then(|t| QUIET.checked_sub(t.elapsed())) {
                wait = Some(wait.map_or(rest, |w| w.min(rest)));
                continue;
            }
            let view = self.view_of(document);
            let mut spent = None;
            if let Some(d) = self.documents.get_mut(&uri) {
                d.stale = false;
                spent = d.spent.take();
            }
            self.checking[lane] = true;
            let (own, publish) = (self.own.clone(), publish.clone());
            let big = view.text.len() > BIG && view.version <= 1;
            let job = move || {
                if big {
                    publish(Event::Busy { uri: view.uri.clone(), begins: true });
                }
                drop(spent);
                let (uri, version) = (view.uri.clone(), view.version);
                let look = || {
                    if let Ok(Some((lines, found))) = crate::features::early(&view) {
                        let _ = own.send(Message::Early { uri: uri.clone(), version, lines, found });
                    }
                    (crate::features::calls(&view), crate::features::diagnostics(view))
                };
                let found = std::panic::catch_unwind(std::panic::AssertUnwindSafe(look));
                if big {
                    publish(Event::Busy { uri: uri.clone(), begins: false });
                }
                let _ = own.send(match found {
                    // Cut short by an edit: the edit has made the document stale again.
                    Ok((calls, found)) => Message::Found { uri, version, lane, calls, found: found.ok().map(Arc::new) },
                    Err(_) => Message::Failed { uri, version, lane },
                });
            };
            let _ = self.checks[lane].send(Box::new(job));
        }
        wait
    }

    fn found(&mut self, uri: &lsp::Uri, version: i32, calls: bool, found: Option<Arc<Vec<Diagnostic>>>, publish: &impl Fn(Event)) {
        let Some(document) = self.documents.get_mut(uri) else { return };
        let Some(found) = found else {
            // Cut short although nothing changed in this document: another one was edited.
            document.stale |= document.version == version;
            return;
        };
        if document.version != version {
            return;
        }
        document.calls = calls;
        // Looked at again for the sake of another document, and nothing is new.
        if document.published == Some(version) && document.found == found {
            return;
        }
        document.found = found;
        document.failed = false;
        document.published = Some(version);
        self.publish(uri, publish);
        publish(Event::Analysed { uri: uri.clone(), version });
    }

    /// What was found before stays, and the user is told that it may be out of date.
    fn failed(&mut self, uri: &lsp::Uri, version: i32, publish: &impl Fn(Event)) {
        let Some(document) = self.documents.get_mut(uri).filter(|d| d.version == version) else { return };
        if !std::mem::replace(&mut document.failed, true) {
            let name = document.path.file_name().unwrap_or_default().to_string_lossy();
            let text = format!("gcc-robot made a mistake of its own and can't check {name} as it is: the marks shown are older than the text. Please report this program.");
            publish(Event::Say(lsp::MessageType::ERROR, text));
        }
        self.publish(uri, publish);
        publish(Event::Analysed { uri: uri.clone(), version });
    }

    /// Takes in what was found in some lines, and tells it when it is something new.
    fn early(&mut self, uri: &lsp::Uri, version: i32, lines: &Range<u32>, found: Vec<Diagnostic>, publish: &impl Fn(Event)) {
        let Some(document) = self.documents.get_mut(uri).filter(|d| d.version == version) else { return };
        let Kind::Gcode(own, _) = document.kind else { return };
        let bytes = document.text.line_start(lines.start)..document.text.line_start(lines.end);
        let inside = |d: &&Diagnostic| d.primary().0 == own && bytes.contains(&d.primary().1.start);
        let says = |d: &Diagnostic| (d.primary().1, d.severity, d.message.clone());
        if document.found.iter().filter(inside).map(says).eq(found.iter().map(says)) {
            return;
        }
        let mut all: Vec<Diagnostic> = document.found.iter().filter(|d| !inside(d)).cloned().chain(found).collect();
        all.sort_by_key(|d| (d.primary().0, d.primary().1.start));
        document.found = Arc::new(all);
        self.publish(uri, publish);
    }

    /// Tells what is known about a document.
    fn publish(&self, uri: &lsp::Uri, publish: &impl Fn(Event)) {
        let (session, Some(document)) = (&self.session, self.documents.get(uri)) else { return };
        let (text, columns) = (&document.text, self.columns);
        let other = |file: gr_text::FileId, span: Span| -> Option<lsp::Location> {
            let path = session.path(file)?;
            let range = Text::new(&session.any_text(file)?).range(span, columns);
            Some(lsp::Location { uri: lsp::Uri::from_file_path(&*path)?, range })
        };
        let own = if let Kind::Gcode(file, _) = document.kind { file } else { gr_text::FileId(0) };
        let place = |(file, span): (gr_text::FileId, Span)| {
            if file == own { Some(lsp::Location { uri: uri.clone(), range: text.range(span, columns) }) } else { other(file, span) }
        };
        let shown = document.found.iter().filter_map(|d| protocol::in_document(d, own)).take(self.settings_of(&document.path).most_problems);
        let diagnostics = shown.map(|d| protocol::diagnostic(&d, text, columns, &place)).collect();
        publish(Event::Diagnostics { uri: uri.clone(), version: Some(document.version), diagnostics, open: true });
    }
}

/// Moves findings as an edit moves their places; those in what was replaced are gone.
fn move_along(found: &mut Vec<Diagnostic>, replaced: &Range<u32>, new: u32) {
    let moved = |s: &mut Span| {
        if s.start >= replaced.end {
            let to = |v: u32| v - replaced.end + replaced.start + new;
            *s = Span::new(to(s.start), to(s.end));
        }
    };
    found.retain(|d| d.primary().1.start >= replaced.end || d.primary().1.end <= replaced.start);
    found.iter_mut().flat_map(|d| d.labels.iter_mut()).for_each(|l| moved(&mut l.span));
}

/// The file name of a document.
pub fn path_of(uri: &lsp::Uri) -> PathBuf {
    uri.to_file_path().map_or_else(|| PathBuf::from(uri.as_str()), |p| p.into_owned())
}
