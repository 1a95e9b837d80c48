//! The one owner of the database: open files, edits, and what can be asked of them.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use gr_gcode::{Parameter, Symbols};
use gr_interp::Setup;
use gr_ir::Program;
use gr_ir::measure::Report;
use gr_text::{Diagnostic, FileId, Text};
use salsa::{Durability, Setter as _};

use crate::check::{self, Check};
use crate::db::{ChunkText, Database, Db as _, Document, Executed, OpenFiles, RunOptions};
use crate::hover::{self, StateAt};
use crate::lints::{Limits, Rules};
use crate::stats;
use crate::store::{Store, Texts, chunk_lines};

/// What a file is run with.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Dialect, tools, parameters, INI file, budgets.
    pub setup: Setup,
    /// Which lints, how severe.
    pub rules: Rules,
    /// Lines in a chunk; none = by the size of the file. Results never depend on it.
    pub chunk_lines: Option<usize>,
}

impl Options {
    /// Options for a setup; `check` wants to find more than one error, so the run goes on after one.
    pub fn new(setup: Setup) -> Options {
        let mut options = Options { setup, ..Options::default() };
        options.setup.keep_going = true;
        options.rules.limits = Limits::of(&options.setup.ini);
        options
    }
}

#[derive(Clone)]
struct Open {
    document: Document,
    run: RunOptions,
    store: Store<ChunkText>,
}

/// Open files and everything that is known about them. Not shared between threads: take a [`Snapshot`].
pub struct Session {
    db: Database,
    files: Vec<Option<Open>>,
}

impl Texts<ChunkText> for Database {
    fn get(&self, input: ChunkText) -> Text {
        input.text(self).clone()
    }
    fn set(&mut self, input: ChunkText, text: Text) {
        // It is being edited, and will be again.
        input.set_text(self).with_durability(Durability::LOW).to(text);
    }
    fn create(&mut self, text: Text) -> ChunkText {
        ChunkText::builder(text).durability(Durability::HIGH).new(self)
    }
}

impl Default for Session {
    fn default() -> Session {
        Session::of(Database::default())
    }
}

/// A program that was looked at once: see [`check_once`].
pub struct Once {
    session: Session,
    file: FileId,
    text: Text,
    /// Everything that is to be said about it.
    pub check: Check,
}

/// Checks a program that nobody is going to edit: the same findings as those of [`Session::check`], in little more
/// memory than the text needs, because what was found out about a part of the program is not kept for another time.
pub fn check_once(path: &str, text: impl Into<Text>, options: Options) -> Once {
    let text = text.into();
    let mut session = Session::of(Database::once());
    let file = session.open(path, &text, options);
    let check = session.document(file).map_or_else(Check::default, |d| check::check_once(&session.db, d));
    Once { session, file, text, check }
}

impl Once {
    /// Path of any file that a diagnostic names.
    pub fn path(&self, file: FileId) -> Option<Box<str>> {
        self.session.path(file)
    }
    /// Text of any file that a diagnostic names.
    pub fn text(&self, file: FileId) -> Option<Text> {
        if file == self.file { Some(self.text.clone()) } else { self.session.any_text(file).map(Text::from) }
    }
}

impl Session {
    /// No files.
    pub fn new() -> Session {
        Session::default()
    }

    fn of(db: Database) -> Session {
        let _ = OpenFiles::builder(Arc::default()).durability(Durability::HIGH).new(&db);
        Session { db, files: Vec::new() }
    }

    /// Programs that call subroutines find open files before those on disk.
    fn list_open_files(&mut self) {
        let named = |document: Document| {
            let path = self.db.disk().path(FileId(document.id(&self.db)))?;
            Some((crate::library::plain_path(Path::new(&*path)), document))
        };
        let files = self.files.iter().flatten().filter_map(|open| named(open.document)).collect();
        OpenFiles::get(&self.db).set_files(&mut self.db).to(Arc::new(files));
    }

    /// Opens a text under a name, or gives an open file a new text and new options.
    pub fn open(&mut self, path: &str, text: impl Into<Text>, options: Options) -> FileId {
        let text = text.into();
        let id = self.db.disk().register(path);
        let lines = memchr::memchr_iter(b'\n', text.as_bytes()).count();
        let k = options.chunk_lines.unwrap_or_else(|| chunk_lines(lines)).max(1);
        self.close(id);
        let store = Store::new(&text, k, &mut self.db);
        let chunks: Arc<[ChunkText]> = store.pieces.iter().map(|p| p.input).collect();
        let index = id.0 as usize;
        if self.files.len() <= index {
            self.files.resize(index + 1, None);
        }
        let run = RunOptions::builder(Arc::new(options), 0).durability(Durability::HIGH).new(&self.db);
        let document = Document::builder(chunks, run, id.0).durability(Durability::HIGH).new(&self.db);
        self.files[index] = Some(Open { document, run, store });
        self.list_open_files();
        id
    }

    /// Reads a file from disk and opens it.
    pub fn open_path(&mut self, path: &Path, options: Options) -> std::io::Result<FileId> {
        let text = gr_text::decode(std::fs::read(path)?).text;
        Ok(self.open(&path.to_string_lossy(), text, options))
    }

    /// Forgets a file's text.
    pub fn close(&mut self, file: FileId) {
        if let Some(open) = self.files.get_mut(file.0 as usize).and_then(Option::take) {
            for piece in &open.store.pieces {
                self.db.set(piece.input, Text::default());
            }
            open.document.set_chunks(&mut self.db).to(Arc::from([]));
            self.list_open_files();
        }
    }

    /// Replaces the bytes `range` of an open file.
    pub fn edit(&mut self, file: FileId, range: Range<u32>, text: &str) {
        let Some(Some(open)) = self.files.get_mut(file.0 as usize) else { return };
        if open.store.edit(range, text, &mut self.db) {
            let chunks: Arc<[ChunkText]> = open.store.pieces.iter().map(|p| p.input).collect();
            open.document.set_chunks(&mut self.db).to(chunks);
        }
    }

    /// New options for an open file.
    pub fn set_options(&mut self, file: FileId, options: Options) {
        if let Some(Some(open)) = self.files.get(file.0 as usize) {
            // What is interned under inputs of high durability stays in memory for good.
            open.run.set_options(&mut self.db).with_durability(Durability::LOW).to(Arc::new(options));
        }
    }

    /// Files on disk may have changed: subroutine files are read again when they are needed.
    pub fn disk_changed(&mut self) {
        self.db.disk().forget();
        for open in self.files.iter().flatten() {
            let revision = open.run.disk_revision(&self.db) + 1;
            open.run.set_disk_revision(&mut self.db).to(revision);
        }
    }

    /// The text of an open file.
    pub fn text(&self, file: FileId) -> Option<String> {
        Some(self.files.get(file.0 as usize)?.as_ref()?.store.text(&self.db))
    }

    /// Path of any file that a diagnostic names.
    pub fn path(&self, file: FileId) -> Option<Box<str>> {
        self.db.disk().path(file)
    }

    /// Text of any file that a diagnostic names, open or read from disk.
    pub fn any_text(&self, file: FileId) -> Option<String> {
        self.text(file).or_else(|| {
            let contents = self.db.disk().contents(file)?;
            Some(contents.chunks.iter().map(|c| &*c.text).collect())
        })
    }

    /// Everything that is to be said about a file.
    pub fn check(&self, file: FileId) -> Check {
        self.document(file).map_or_else(Check::default, |d| check::check(&self.db, d))
    }

    /// What is to be said about some lines, as far as the blocks up to their end tell it.
    pub fn check_range(&self, file: FileId, lines: Range<u32>) -> Vec<Diagnostic> {
        self.document(file).map_or_else(Vec::new, |d| check::check_range(&self.db, d, lines))
    }

    /// Modes and position around a line, when execution comes there.
    pub fn state_at(&self, file: FileId, line: u32) -> Option<StateAt> {
        hover::state_at(&self.db, self.document(file)?, line)
    }

    /// Time, distance and extents of a file and of each tool, as far as it runs.
    pub fn stats(&self, file: FileId) -> Arc<Report> {
        self.document(file).map_or_else(Arc::default, |d| stats::stats(&self.db, d))
    }

    /// Labels, parameters and codes of a file, under its own lines and bytes.
    pub fn symbols(&self, file: FileId) -> Symbols {
        self.document(file).map_or_else(Symbols::default, |d| hover::symbols(&self.db, d))
    }

    /// A view for another thread. Edits wait until it is dropped, and cancel what it is doing.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot { db: self.db.clone(), documents: self.files.iter().map(|f| f.as_ref().map(|o| o.document)).collect() }
    }

    /// How many queries were executed so far.
    pub fn executed(&self) -> Executed {
        self.db.executed()
    }

    fn document(&self, file: FileId) -> Option<Document> {
        Some(self.files.get(file.0 as usize)?.as_ref()?.document)
    }
}

/// A read-only view of a session, for another thread.
pub struct Snapshot {
    db: Database,
    documents: Vec<Option<Document>>,
}

/// The work was cut short by an edit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cancelled;

/// Breaks off what one [`Snapshot`] is doing, from another thread.
#[derive(Clone)]
pub struct Canceller(salsa::CancellationToken);

impl Canceller {
    /// The query that runs, or else the next one, ends with [`Cancelled`].
    pub fn cancel(&self) {
        self.0.cancel();
    }
}

impl Snapshot {
    /// Breaks off what this view is doing.
    pub fn canceller(&self) -> Canceller {
        Canceller(salsa::Database::cancellation_token(&self.db))
    }
    /// Everything that is to be said about a file.
    pub fn check(&self, file: FileId) -> Result<Check, Cancelled> {
        self.guarded(file, check::check)
    }
    /// What is to be said about some lines, as far as the blocks up to their end tell it.
    pub fn check_range(&self, file: FileId, lines: Range<u32>) -> Result<Vec<Diagnostic>, Cancelled> {
        self.guarded(file, |db, d| check::check_range(db, d, lines.clone()))
    }
    /// Modes and position around a line, when execution comes there.
    pub fn state_at(&self, file: FileId, line: u32) -> Result<Option<StateAt>, Cancelled> {
        self.guarded(file, |db, d| hover::state_at(db, d, line))
    }
    /// Time, distance and extents of a file and of each tool, as far as it runs.
    pub fn stats(&self, file: FileId) -> Result<Arc<Report>, Cancelled> {
        self.guarded(file, |db, d| stats::stats(db, d))
    }
    /// Motion of a file, as far as it runs, with sources under the session's file numbers.
    pub fn motion(&self, file: FileId) -> Result<Arc<Program>, Cancelled> {
        self.guarded(file, |db, d| stats::motion(db, d))
    }
    /// Labels, parameters and codes of a file, under its own lines and bytes.
    pub fn symbols(&self, file: FileId) -> Result<Symbols, Cancelled> {
        self.guarded(file, hover::symbols)
    }
    /// The file with its tables.
    pub fn file(&self, file: FileId) -> Result<Arc<gr_gcode::File>, Cancelled> {
        self.guarded(file, crate::editor::file)
    }
    /// Blocks of some lines as execution comes to them for the first time, with the values of some parameters;
    /// at most `budget` blocks are run.
    pub fn trace(&self, file: FileId, lines: Range<u32>, wanted: &[Parameter], budget: u32) -> Result<Vec<crate::Traced>, Cancelled> {
        self.guarded(file, |db, d| crate::editor::trace(db, d, &lines, wanted, budget))
    }
    /// Path of a file that the session knows.
    pub fn path(&self, file: FileId) -> Option<Box<str>> {
        self.db.disk().path(file)
    }
    /// Text of a file that was read from disk because a program calls it.
    pub fn contents(&self, file: FileId) -> Option<Arc<gr_gcode::File>> {
        self.db.disk().contents(file)
    }
    fn guarded<T: Default>(&self, file: FileId, work: impl Fn(&Database, Document) -> T) -> Result<T, Cancelled> {
        let Some(Some(document)) = self.documents.get(file.0 as usize) else { return Ok(T::default()) };
        let work = std::panic::AssertUnwindSafe(|| work(&self.db, *document));
        salsa::Cancelled::catch(work).map_err(|_| Cancelled)
    }
}
