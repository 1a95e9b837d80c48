//! The files of a run inside a session: the main one chunk by chunk, as far as execution comes, and subroutine
//! files: the text in the editor before the one on disk.

use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use gr_canon::FileId;
use gr_gcode::{Chunk, File};
use gr_interp::{Files, LabelAt, LabelName};
use rustc_hash::FxHashSet;

use crate::Options;
use crate::carried::{Carried, Home};
use crate::db::{ChunkText, Db, Document, MOST_RECENT, OpenFiles, RunOptions, scanned, shape};
use crate::layout::{Starts, first_line, follows, layout, next_stop};

/// The files a run may need: the main one, and others as they are called.
///
/// Lines are those of the file at present. The results of a run move with their lines, so it may look up where a chunk
/// begins beside salsa; what salsa must know is which chunks the run came to and how it got there.
pub(crate) struct Library<'a> {
    db: &'a dyn Db,
    document: Document,
    run: RunOptions,
    options: &'a Options,
    main: FileId,
    starts: Arc<Starts>,
    /// Chunks that the run came to by themselves, wherever they stand: its first one, those of labels, those that
    /// skipping led to.
    granted: RefCell<FxHashSet<ChunkText>>,
    carried: Option<&'a Carried>,
    /// Remapped codes can tell the program its own line.
    remaps: bool,
    visited: RefCell<BTreeMap<u32, Visited>>,
    /// The main file as a whole, for what can't be told from its chunks.
    whole: OnceCell<Arc<File>>,
    subs: Vec<(FileId, Arc<File>)>,
    empty: File,
}

/// A chunk of the main file that execution came to.
struct Visited {
    input: ChunkText,
    /// None: forgotten, see [`Library::make_room`].
    chunk: Option<Chunk>,
    lines: u32,
    /// What follows the chunk was asked for.
    left: bool,
    /// Lines of the file in it that skipping must look at.
    stops: Vec<u32>,
}

/// A chunk that a run came to, where it was then.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Came {
    pub(crate) chunk: ChunkText,
    /// First line.
    pub(crate) first: u32,
    /// Lines.
    pub(crate) lines: u32,
}

impl<'a> Library<'a> {
    /// Files of a document whose chunks begin at `starts`.
    pub(crate) fn new(db: &'a dyn Db, document: Document, starts: Arc<Starts>) -> Library<'a> {
        let run = document.run(db);
        let options: &Options = run.options(db);
        Library {
            db,
            document,
            run,
            options,
            main: FileId(document.id(db)),
            starts,
            granted: RefCell::default(),
            carried: None,
            remaps: !options.setup.ini.all("rs274ngc", "remap").is_empty(),
            visited: RefCell::default(),
            whole: OnceCell::new(),
            subs: Vec::new(),
            empty: File::default(),
        }
    }

    /// Files of a document for a run from a chunk on, behind other runs that left `carried`.
    pub(crate) fn knowing(
        db: &'a dyn Db,
        document: Document,
        starts: Arc<Starts>,
        chunk: ChunkText,
        carried: &'a Carried,
    ) -> Library<'a> {
        let mut library = Library { carried: Some(carried), ..Library::new(db, document, starts) };
        library.granted.get_mut().insert(chunk);
        let main = library.main;
        for id in carried.files().iter().filter(|id| **id != main) {
            if let Some(file) = sub_file(db, library.run, *id) {
                library.keep(*id, file);
            }
        }
        library
    }

    /// Where the main file's chunks begin.
    pub(crate) fn starts(&self) -> &Arc<Starts> {
        &self.starts
    }

    /// The chunks of the main file that the run came to, in the order of their lines.
    pub(crate) fn came_to(&self) -> Box<[Came]> {
        self.visited.borrow().iter().map(|(first, v)| Came { chunk: v.input, first: *first, lines: v.lines }).collect()
    }

    fn keep(&mut self, id: FileId, file: Arc<File>) {
        if id != self.main && !self.subs.iter().any(|(i, _)| *i == id) {
            self.subs.push((id, file));
        }
    }

    /// Calls `f` with the chunk of the main file that holds a line, and with its first line.
    fn visit<T>(&self, line: u32, f: impl FnOnce(&Visited, u32) -> T) -> Option<T> {
        let mut visited = self.visited.borrow_mut();
        let behind = self.leave(&mut visited, line);
        let known = |visited: &BTreeMap<u32, Visited>| {
            let (first, v) = visited.range(..=line).next_back()?;
            (line - first < v.lines).then_some(*first)
        };
        let first = match known(&visited) {
            Some(first) => first,
            None => {
                let (input, first) = match behind {
                    Some(next) => (next?, line),
                    None => self.holding(line)?,
                };
                self.make_room(&mut visited);
                visited.insert(first, self.read(input, first));
                first
            }
        };
        visited.get(&first).map(|v| f(v, first))
    }

    /// In a session that looks at a program once, not all of its tables are kept.
    fn make_room(&self, visited: &mut BTreeMap<u32, Visited>) {
        if self.db.recent().is_some() && visited.len() % MOST_RECENT == 0 {
            visited.values_mut().for_each(|v| v.chunk = None);
        }
    }

    fn tables(&self, input: ChunkText) -> Chunk {
        Chunk { text: input.text(self.db).clone(), scan: scanned(self.db, input, self.run) }
    }

    /// When a line is the first one behind a chunk that the run came to: what follows that chunk. The outer `None`: it
    /// is not, or was asked before.
    #[expect(clippy::option_option, reason = "nothing follows and not behind a chunk are two things")]
    fn leave(&self, visited: &mut BTreeMap<u32, Visited>, line: u32) -> Option<Option<ChunkText>> {
        let (first, before) = visited.range_mut(..line).next_back()?;
        if before.left || line - first != before.lines {
            return None;
        }
        before.left = true;
        Some(follows(self.db, self.document, before.input))
    }

    /// The chunk that holds a line, and its first line.
    fn holding(&self, line: u32) -> Option<(ChunkText, u32)> {
        let known = self.starts.holding(line).filter(|(chunk, _)| self.granted.borrow().contains(chunk));
        // A jump to a line as such: now it matters where the chunks begin.
        known.or_else(|| layout(self.db, self.document).starts.holding(line))
    }

    fn read(&self, input: ChunkText, first: u32) -> Visited {
        let chunk = self.tables(input);
        let scan = &chunk.scan;
        if self.remaps || scan.names.iter().any(|n| &**n == "_line") {
            // Its lines are more to the program than places.
            let _ = first_line(self.db, self.document, input);
        }
        let stops = (0..scan.lines.len() as u32).filter(|l| gr_interp::is_stop(scan, *l)).map(|l| l + first).collect();
        Visited { input, lines: scan.lines.len() as u32, chunk: Some(chunk), left: false, stops }
    }

    /// The first line behind a chunk that skipping must look at.
    fn next_stop(&self, chunk: ChunkText) -> u32 {
        let Some((chunk, line)) = next_stop(self.db, self.document, chunk) else { return u32::MAX };
        self.granted.borrow_mut().insert(chunk);
        self.starts.of(chunk).map_or(u32::MAX, |first| first + line)
    }
}

impl Files for Library<'_> {
    fn earlier_label(&self, name: &LabelName) -> Option<LabelAt> {
        let (at, home) = self.carried?.label(name)?;
        let (chunk, line) = match home {
            None => return Some(at),
            Some(Home::Line(chunk, line)) => (chunk, line),
            Some(Home::Statement(chunk, n)) => (chunk, shape(self.db, chunk, self.run).statements.get(n as usize)?.line),
        };
        self.granted.borrow_mut().insert(chunk);
        Some(at.on_line(self.starts.of(chunk)? + line))
    }
    fn file(&self, id: FileId) -> &File {
        if id == self.main {
            return self.whole.get_or_init(|| whole(self.db, self.document, self.run));
        }
        self.subs.iter().find(|(i, _)| *i == id).map_or(&self.empty, |(_, f)| f)
    }
    fn find_sub(&mut self, name: &str) -> Option<FileId> {
        let candidates = gr_interp::subroutine_paths(&self.options.setup, name);
        let (id, file) = candidates.iter().find_map(|path| {
            let open = OpenFiles::get(self.db).files(self.db);
            if let Some(document) = open.get(&plain_path(path)) {
                return Some((FileId(document.id(self.db)), whole(self.db, *document, self.run)));
            }
            self.db.disk().load(path, self.options.setup.dialect)
        })?;
        self.keep(id, file);
        Some(id)
    }
    fn chunk(&self, id: FileId, line: u32) -> Option<(Chunk, u32, u32)> {
        if id == self.main {
            return self.visit(line, |v, first| (v.chunk.clone().unwrap_or_else(|| self.tables(v.input)), line - first, first));
        }
        let file = self.file(id);
        let (c, l) = file.locate(line)?;
        Some((file.chunks[c].clone(), l, file.first_lines[c]))
    }
    fn next_control(&self, id: FileId, line: u32) -> Option<u32> {
        if id != self.main {
            return None;
        }
        let here = self.visit(line, |v, _| {
            let at = v.stops.partition_point(|l| *l < line);
            v.stops.get(at).copied().ok_or(v.input)
        });
        Some(match here {
            Some(Ok(stop)) => stop,
            Some(Err(chunk)) => self.next_stop(chunk),
            None => u32::MAX,
        })
    }
}

/// A whole file with its tables, read as `run` says.
pub(crate) fn whole(db: &dyn Db, document: Document, run: RunOptions) -> Arc<File> {
    let chunks = document.chunks(db).iter().map(|c| Chunk { text: c.text(db).clone(), scan: scanned(db, *c, run) });
    let path = db.disk().path(FileId(document.id(db))).unwrap_or_default();
    Arc::new(File::new(&path, chunks.collect()))
}

/// A file that was called: open, or read from disk.
pub(crate) fn sub_file(db: &dyn Db, run: RunOptions, id: FileId) -> Option<Arc<File>> {
    match OpenFiles::get(db).files(db).values().find(|d| d.id(db) == id.0) {
        Some(document) => Some(whole(db, *document, run)),
        None => db.disk().contents(id),
    }
}

/// A path as files are compared by: absolute, without `.` and `..`.
pub fn plain_path(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()).components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => _ = plain.pop(),
            part => plain.push(part),
        }
    }
    plain
}
