//! Open documents, and the views of them that requests work on.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use gr_backends::sheet::ToolRow;
use gr_driver::{Cancelled, Snapshot};
use gr_gcode::File;
use gr_ide::config::Schema;
use gr_ir::measure::{Rates, Report, Totals, report};
use gr_ir::timing::Clock;
use gr_ir::{Program, Texts};
use gr_robot::Planned;
use gr_robot::along::is_planned;
use gr_spec::Dialect;
use gr_text::{Diagnostic, FileId, LineIndex, Span};
use tower_lsp::ls_types as lsp;

use crate::host::{Host, Station, StepUnits};
use crate::settings::Settings;
use crate::text::{Columns, Text};
use crate::workspace::Workspace;

/// Larger open documents are not searched for names from other documents, bytes.
const MOST_SEARCHED: u32 = 2_000_000;

/// Of larger exchange files it is not looked into which units fit, bytes.
const MOST_READ: u32 = 8_000_000;

/// What a document is.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// A G-code program.
    Gcode(FileId, &'static Dialect),
    /// A Part 21 file.
    Exchange,
    /// A machine file or the project file.
    Config(Schema),
    /// A tool table.
    Tools,
    /// An INI file of LinuxCNC.
    Ini,
    /// A parameter file.
    Vars,
    /// Nothing of ours.
    Other,
}

/// An exchange file with its tables.
pub struct Exchange {
    /// Its text.
    pub text: String,
    /// Its tables.
    pub tables: gr_p21::Exchange,
    /// Its lines.
    pub lines: LineIndex,
}

/// A program that was run as a whole.
pub struct Motion {
    /// Its motion.
    pub program: Arc<Program>,
    /// The file of the document.
    pub main: FileId,
    /// Names of the files it is made of, the document first.
    pub files: Vec<String>,
    /// Texts of the others.
    subs: Vec<(FileId, String)>,
    /// What times are predicted with.
    pub rates: Rates,
    /// Raw part, mm.
    pub stock: Option<[[f64; 3]; 2]>,
    /// Tools of a process plan.
    pub tools: Vec<ToolRow>,
}

/// Seconds of every line of a document where it is run for the first time; NaN where it takes none or is not run.
pub type LineTimes = Vec<f64>;

/// How long blocks take.
pub enum Pace {
    /// Each by itself.
    Alone(Rates),
    /// As the machine drives through the whole program.
    Through(Arc<LineTimes>),
    /// That is not worked out for a program of this size.
    Unknown,
}

impl Pace {
    /// The time of a block, s.
    pub fn seconds(&self, block: &gr_driver::Traced) -> Option<f64> {
        match self {
            Pace::Unknown => None,
            Pace::Through(lines) => lines.get(block.line as usize).copied().filter(|s| s.is_finite()),
            Pace::Alone(rates) => {
                let clock = Clock::new(&block.program, rates);
                let (mut totals, mut cursor) = (Totals::default(), block.program.cursor());
                while let Some(view) = cursor.next() {
                    totals.add(&clock.measure(&view));
                }
                Some(totals.seconds())
            }
        }
    }
}

/// Times the lines of a document in its program.
fn line_times(motion: &Motion) -> LineTimes {
    let clock = Clock::new(&motion.program, &motion.rates);
    let mut lines: Vec<(Option<gr_ir::FrameId>, f64)> = Vec::new();
    let mut cursor = motion.program.cursor();
    let (mut last, mut done) = (None, BTreeSet::new());
    while let Some(view) = cursor.next() {
        let t = clock.measure(&view);
        if view.source.file != motion.main || (t.ns() == 0 && t.moves == 0) {
            continue;
        }
        // Behind a move of another line it is the next time that a line is run.
        let line = view.source.line as usize;
        if let Some(other) = last.replace(line).filter(|l| *l != line) {
            done.insert(other);
        }
        if lines.len() <= line {
            lines.resize(line + 1, (None, f64::NAN));
        }
        let (frame, seconds) = &mut lines[line];
        if *frame.get_or_insert(view.source.frame) == view.source.frame && !done.contains(&line) {
            *seconds = if seconds.is_nan() { t.seconds() } else { *seconds + t.seconds() };
        }
    }
    lines.into_iter().map(|l| l.1).collect()
}

/// The plan for the chosen machine, or what keeps it from being made.
pub type Planning = Result<Planned, Vec<Diagnostic>>;

/// What is worked out at most once for a version of a document.
#[derive(Default)]
pub struct Derived {
    exchange: OnceLock<Arc<Exchange>>,
    units: OnceLock<StepUnits>,
    /// Of an exchange file.
    motion: OnceLock<Option<Arc<Motion>>>,
    /// Of the motion that it was made of.
    planning: Mutex<Option<(Arc<Program>, Arc<Planning>)>>,
    /// Of the motion that it was made of.
    times: Mutex<Option<(Arc<Program>, Arc<LineTimes>)>>,
    tokens: Mutex<Option<(String, Arc<Vec<lsp::SemanticToken>>)>>,
}

impl Derived {
    /// Whether it holds tables of a whole file.
    pub fn is_much(&self) -> bool {
        self.exchange.get().is_some()
    }
}

/// Everything a request needs of a document, at one version. Edits wait while `session` is held: take what is
/// needed of it first, then [`View::release`].
pub struct View {
    /// Name.
    pub uri: lsp::Uri,
    /// File name.
    pub path: PathBuf,
    /// Version of the client.
    pub version: i32,
    /// A client has it open.
    pub open: bool,
    /// What it is.
    pub kind: Kind,
    /// Text.
    pub text: Arc<Text>,
    /// Columns.
    pub columns: Columns,
    /// What it is run with.
    pub station: Arc<Station>,
    /// Settings.
    pub settings: Arc<Settings>,
    /// Diagnostics that were found last, and for which version.
    pub found: Arc<Vec<Diagnostic>>,
    /// The line that was edited last.
    pub focus: u32,
    /// Worked out once per version.
    pub derived: Arc<Derived>,
    /// Version of the document now.
    pub latest: Arc<AtomicI32>,
    /// Last tokens that were sent, over versions.
    pub sent_tokens: Arc<Derived>,
    /// The command.
    pub host: Arc<dyn Host>,
    /// Folders.
    pub workspace: Arc<Workspace>,
    /// The other open documents: path, name, text.
    pub others: Arc<Vec<OpenFile>>,
    session: Option<Snapshot>,
}

/// An open document as others see it.
#[derive(Clone)]
pub struct OpenFile {
    /// File name.
    pub path: PathBuf,
    /// Name.
    pub uri: lsp::Uri,
    /// Version of the client.
    pub version: i32,
    /// Text.
    pub text: Arc<Text>,
    /// What it is.
    pub kind: Kind,
}

/// Versions of open documents.
pub type Versions = BTreeMap<lsp::Uri, i32>;

impl View {
    #[expect(clippy::too_many_arguments, reason = "made in one place")]
    /// A view.
    pub fn new(
        document: &Document,
        columns: Columns,
        settings: Arc<Settings>,
        host: Arc<dyn Host>,
        workspace: Arc<Workspace>,
        others: Arc<Vec<OpenFile>>,
        session: Option<Snapshot>,
    ) -> View {
        View {
            uri: document.uri.clone(),
            path: document.path.clone(),
            version: document.version,
            open: document.open,
            kind: document.kind,
            text: document.text.clone(),
            columns,
            station: document.station.clone(),
            settings,
            found: document.found.clone(),
            focus: document.focus,
            derived: document.derived.clone(),
            latest: document.latest.clone(),
            sent_tokens: document.sent_tokens.clone(),
            host,
            workspace,
            others,
            session,
        }
    }
    /// The database: see the type.
    pub fn session(&self) -> Option<(&Snapshot, FileId, &'static Dialect)> {
        match self.kind {
            Kind::Gcode(file, dialect) => Some((self.session.as_ref()?, file, dialect)),
            _ => None,
        }
    }
    /// Breaks off what is asked of the database, from another thread.
    pub fn canceller(&self) -> Option<gr_driver::Canceller> {
        self.session.as_ref().map(Snapshot::canceller)
    }
    /// The document was edited since: work on this view is of no use to anybody.
    pub fn is_overtaken(&self) -> bool {
        self.latest.load(Ordering::Relaxed) != self.version
    }
    /// What the client calls the texts that an edit is worked out for.
    pub fn versions(&self) -> Versions {
        let others = self.others.iter().map(|o| (o.uri.clone(), o.version));
        others.chain(self.open.then(|| (self.uri.clone(), self.version))).collect()
    }
    /// Lets edits through.
    pub fn release(&mut self) {
        self.session = None;
    }
    /// Tables of the program; releases the database.
    pub fn program(&mut self) -> Result<Option<(Arc<File>, &'static Dialect)>, Cancelled> {
        let found = match self.session() {
            Some((snapshot, file, dialect)) => Some((snapshot.file(file)?, dialect)),
            None => None,
        };
        self.release();
        Ok(found)
    }
    /// Byte of a position.
    pub fn offset(&self, p: lsp::Position) -> u32 {
        self.text.offset(p, self.columns)
    }
    /// Range of some bytes.
    pub fn range(&self, span: Span) -> lsp::Range {
        self.text.range(span, self.columns)
    }
    /// The exchange file, parsed at most once per version.
    pub fn exchange(&self) -> Arc<Exchange> {
        let made = self.derived.exchange.get_or_init(|| {
            let text = self.text.to_string();
            let tables = gr_p21::parse(text.as_bytes());
            let lines = LineIndex::new(text.as_bytes());
            Arc::new(Exchange { text, tables, lines })
        });
        made.clone()
    }
    /// In which units the speeds and angles of an exchange file are: as the project says, or as a build would take them.
    pub fn step_units(&self) -> StepUnits {
        let open = || self.text.len() > MOST_READ || self.host.units_are_open(&self.exchange().text);
        let found = || if open() { StepUnits::Open } else { StepUnits::Iso };
        self.station.step_units.unwrap_or_else(|| *self.derived.units.get_or_init(found))
    }
    /// The program's motion. Of G-code the database remembers it: release it afterwards.
    pub fn motion(&self) -> Result<Option<Arc<Motion>>, Cancelled> {
        if matches!(self.kind, Kind::Exchange) {
            return Ok(self.derived.motion.get_or_init(|| self.of_process().map(Arc::new)).clone());
        }
        let Some((session, main, dialect)) = self.session() else { return Ok(None) };
        let program = session.motion(main)?;
        let name = |id: FileId| session.path(id).map_or(String::new(), |p| p.to_string());
        let others: Vec<FileId> = program.files.iter().map(|f| f.0).filter(|id| *id != main).collect();
        let text = |id: &FileId| Some((*id, session.contents(*id)?.chunks.iter().map(|c| &*c.text).collect()));
        Ok(Some(Arc::new(Motion {
            main,
            files: std::iter::once(main).chain(others.iter().copied()).map(name).collect(),
            subs: others.iter().filter_map(text).collect(),
            rates: gr_driver::rates(&self.station.setup_for(dialect)),
            stock: self.station.stock,
            tools: Vec::new(),
            program,
        })))
    }
    fn of_process(&self) -> Option<Motion> {
        let plan = self.host.plan(&self.path, &self.exchange().text, &self.station)?;
        Some(Motion {
            program: Arc::new(plan.program),
            main: FileId(0),
            files: vec![self.path.to_string_lossy().into()],
            subs: Vec::new(),
            rates: gr_driver::rates(&self.station.setup_for(Dialect::linuxcnc())),
            stock: plan.stock.or(self.station.stock),
            tools: plan.tools,
        })
    }
    /// Sums over the motion of a document.
    pub fn report(&self, motion: &Motion) -> Result<Arc<Report>, Cancelled> {
        match self.session() {
            Some((session, file, _)) => session.stats(file),
            None => Ok(Arc::new(report(&motion.program, &motion.rates))),
        }
    }
    /// How long blocks take: of a machine whose accelerations are known that depends on what comes before and after.
    /// The motion is asked of the database only then.
    pub fn pace(&mut self) -> Result<Pace, Cancelled> {
        /// Larger programs are not timed for a block of them, bytes.
        const MOST_TIMED: u32 = 4_000_000;
        let dialect = if let Kind::Gcode(_, d) = self.kind { d } else { Dialect::linuxcnc() };
        let rates = gr_driver::rates(&self.station.setup_for(dialect));
        if rates.dynamics.is_none_or(|d| !d.known()) {
            return Ok(Pace::Alone(rates));
        }
        if self.text.len() > MOST_TIMED {
            return Ok(Pace::Unknown);
        }
        let motion = self.motion()?;
        self.release();
        let Some(motion) = motion else { return Ok(Pace::Unknown) };
        let mut known = self.derived.times.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, times)) = known.as_ref().filter(|(p, _)| Arc::ptr_eq(p, &motion.program)) {
            return Ok(Pace::Through(times.clone()));
        }
        let times = Arc::new(line_times(&motion));
        *known = Some((motion.program.clone(), times.clone()));
        Ok(Pace::Through(times))
    }
    /// What a build for the chosen machine would make of the motion; none when there is no such machine, or when it
    /// needs no plan. Worked out once for the same motion: release the database first.
    pub fn planning(&self, motion: &Motion) -> Option<Arc<Planning>> {
        let machine = self.station.machine.as_ref().filter(|m| is_planned(m))?;
        let mut known = self.derived.planning.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, planning)) = known.as_ref().filter(|(p, _)| Arc::ptr_eq(p, &motion.program)) {
            return Some(planning.clone());
        }
        let own = self.text.to_string();
        let planning = Arc::new(gr_robot::plan(&motion.program, machine, &self.lines(motion, &own), &self.robot_options()));
        *known = Some((motion.program.clone(), planning.clone()));
        Some(planning)
    }
    fn robot_options(&self) -> gr_robot::Options {
        gr_robot::Options { no_tool_table: gr_interp::assumed(&self.station.setup.tools), ..gr_robot::Options::default() }
    }
    /// The lines that the motion comes from; `own`: the text of the document.
    fn lines<'a>(&self, motion: &'a Motion, own: &'a str) -> Texts<'a> {
        let texts = std::iter::once((motion.main, own)).chain(motion.subs.iter().map(|(id, t)| (*id, t.as_str())));
        match self.kind {
            Kind::Exchange => Texts::new(texts).instances(),
            Kind::Gcode(_, dialect) => Texts::new(texts).with_increments(dialect.id == "fanuc-turn"),
            _ => Texts::new(texts),
        }
    }
    /// What the chosen machine has to say about the motion, in all its files: that is what `check` says.
    pub fn opinion(&self, motion: &Motion) -> Vec<Diagnostic> {
        let Some(machine) = &self.station.machine else { return Vec::new() };
        match self.planning(motion).as_deref() {
            Some(Ok(planned)) => planned.warnings.clone(),
            Some(Err(found)) => found.clone(),
            None => gr_robot::opinion::opinion(&motion.program, machine, &self.lines(motion, &self.text.to_string()), &self.robot_options()),
        }
    }
    /// Whether the plan is there, or soon is: see [`View::planning`].
    pub fn plans_quickly(&self, motion: &Motion) -> bool {
        const QUICK: u32 = 100_000;
        let known = self.derived.planning.try_lock();
        self.text.len() <= QUICK || known.is_ok_and(|k| k.as_ref().is_some_and(|(p, _)| Arc::ptr_eq(p, &motion.program)))
    }
    /// Remembers tokens that are sent; gives the ones sent before.
    pub fn swap_tokens(&self, id: &str, tokens: &Arc<Vec<lsp::SemanticToken>>) -> Option<(String, Arc<Vec<lsp::SemanticToken>>)> {
        let mut last = self.sent_tokens.tokens.lock().unwrap_or_else(PoisonError::into_inner);
        last.replace((id.to_string(), tokens.clone()))
    }
    /// Text and name of any file of the workspace, open or on disk.
    pub fn file_at(&self, path: &Path) -> Option<(lsp::Uri, Arc<File>)> {
        let dialect = if let Kind::Gcode(_, d) = self.kind { d } else { Dialect::linuxcnc() };
        if let Some(open) = self.others.iter().find(|o| o.path == path) {
            if open.text.len() > MOST_SEARCHED {
                return None;
            }
            let file = gr_driver::scan_file(&path.to_string_lossy(), &open.text.to_string(), dialect);
            return Some((open.uri.clone(), Arc::new(file)));
        }
        Some((lsp::Uri::from_file_path(path)?, self.workspace.file(path, dialect)?))
    }
    /// The other G-code programs of the workspace, open or on disk.
    pub fn other_programs(&self) -> Vec<(PathBuf, lsp::Uri, Arc<File>)> {
        let mut paths = self.workspace.programs();
        paths.extend(self.others.iter().filter(|o| matches!(o.kind, Kind::Gcode(..))).map(|o| o.path.clone()));
        paths.sort();
        paths.dedup();
        let other = paths.into_iter().filter(|p| *p != self.path);
        other.filter_map(|p| self.file_at(&p).map(|(uri, file)| (p, uri, file))).collect()
    }
}

/// An open document.
pub struct Document {
    /// Name.
    pub uri: lsp::Uri,
    /// File name.
    pub path: PathBuf,
    /// Language the client says it is in.
    pub language: String,
    /// Version of the client.
    pub version: i32,
    /// Text.
    pub text: Arc<Text>,
    /// What it is.
    pub kind: Kind,
    /// What it is run with.
    pub station: Arc<Station>,
    /// Diagnostics have to be found anew.
    pub stale: bool,
    /// Diagnostics that were found last; edits since have moved them.
    pub found: Arc<Vec<Diagnostic>>,
    /// The version whose diagnostics were sent.
    pub published: Option<i32>,
    /// It has subroutines, calls or jumps: what it does may depend on other documents.
    pub calls: bool,
    /// Looking for them broke off by a mistake of the server, and the user was told.
    pub failed: bool,
    /// The line that was edited last: what is visible is around it.
    pub focus: u32,
    /// When it was edited last.
    pub edited: Option<std::time::Instant>,
    /// Worked out once per version.
    pub derived: Arc<Derived>,
    /// The same of a version that was edited since, where that is much: putting it away takes a while, in which answers would wait.
    pub spent: Option<Arc<Derived>>,
    /// A client has it open: else it is what stands on disk.
    pub open: bool,
    /// `version`, for the views.
    pub latest: Arc<AtomicI32>,
    /// See [`View::sent_tokens`].
    pub sent_tokens: Arc<Derived>,
}

impl Document {
    /// A document that was just opened.
    pub fn new(uri: lsp::Uri, path: PathBuf, language: String, version: i32, text: Arc<Text>, kind: Kind, station: Arc<Station>) -> Document {
        Document {
            uri,
            path,
            language,
            version,
            text,
            kind,
            station,
            stale: true,
            found: Arc::default(),
            published: None,
            calls: false,
            failed: false,
            focus: 0,
            edited: None,
            derived: Arc::default(),
            spent: None,
            open: true,
            latest: Arc::new(AtomicI32::new(version)),
            sent_tokens: Arc::default(),
        }
    }
}

/// What a document is, by its language, name and beginning.
pub fn kind_of(path: &Path, language: &str, text: &str) -> Option<Kind> {
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    let ending = path.extension().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    let start: String = text.chars().filter(|c| *c > ' ' && *c != '\u{FEFF}').take(16).collect();
    if start.starts_with("ISO-10303-21") || language == "p21" || matches!(ending.as_str(), "p21" | "stpnc") {
        return Some(Kind::Exchange);
    }
    if matches!(ending.as_str(), "stp" | "step") {
        let ours = start.starts_with("HEADER") || start.starts_with("DATA;") || start.starts_with("/*") || start.is_empty();
        return Some(if ours { Kind::Exchange } else { Kind::Other });
    }
    if ending == "tbl" {
        return Some(Kind::Tools);
    }
    if ending == "toml" || language == "toml" {
        return Some(Schema::of(&name, text).map_or(Kind::Other, Kind::Config));
    }
    if ending == "var" && language != "gcode" {
        return Some(Kind::Vars);
    }
    if ending == "ini" && language != "gcode" {
        return Some(if gr_ide::config::linuxcnc::is_machine_ini(text) { Kind::Ini } else { Kind::Other });
    }
    if matches!(ending.as_str(), "md" | "txt" | "json") && language != "gcode" {
        return Some(Kind::Other);
    }
    None
}
