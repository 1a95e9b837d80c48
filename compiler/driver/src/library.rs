//! The files of a run inside a session: the main one chunk by chunk, as far as execution comes, and subroutine
//! files: the text in the editor before the one on disk.

use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use gr_canon::FileId;
use gr_gcode::{Chunk, File};
use gr_interp::Files;

use crate::Options;
use crate::db::{Db, Document, OpenFiles, RunOptions, scanned};
use crate::layout::{chunk_of, next_stop};

/// The files a run may need: the main one, and others as they are called.
pub(crate) struct Library<'a> {
    db: &'a dyn Db,
    document: Document,
    run: RunOptions,
    options: &'a Options,
    main: FileId,
    visited: RefCell<BTreeMap<u32, Visited>>,
    /// The main file as a whole, for what can't be told from its chunks.
    whole: OnceCell<Arc<File>>,
    subs: Vec<(FileId, Arc<File>)>,
    empty: File,
}

/// A chunk of the main file that execution came to.
struct Visited {
    chunk: Chunk,
    /// Lines of the file in it that skipping must look at.
    stops: Vec<u32>,
}

impl<'a> Library<'a> {
    /// Files of a document. `known` were opened before.
    pub(crate) fn new(db: &'a dyn Db, document: Document, known: impl Iterator<Item = FileId>) -> Library<'a> {
        let run = document.run(db);
        let main = FileId(document.id(db));
        let options: &Options = run.options(db);
        let mut library = Library {
            db,
            document,
            run,
            options,
            main,
            visited: RefCell::default(),
            whole: OnceCell::new(),
            subs: Vec::new(),
            empty: File::default(),
        };
        for id in known.filter(|id| *id != main) {
            if let Some(file) = sub_file(db, run, id) {
                library.keep(id, file);
            }
        }
        library
    }

    fn keep(&mut self, id: FileId, file: Arc<File>) {
        if id != self.main && !self.subs.iter().any(|(i, _)| *i == id) {
            self.subs.push((id, file));
        }
    }

    /// Calls `f` with the chunk of the main file that holds a line, and with its first line.
    fn visit<T>(&self, line: u32, f: impl FnOnce(&Visited, u32) -> T) -> Option<T> {
        let mut visited = self.visited.borrow_mut();
        let known = |visited: &BTreeMap<u32, Visited>| {
            let (first, v) = visited.range(..=line).next_back()?;
            (line - first < v.chunk.scan.lines.len() as u32).then_some(*first)
        };
        let first = match known(&visited) {
            Some(first) => first,
            None => {
                let (input, first) = chunk_of(self.db, self.document, line)?;
                let scan = scanned(self.db, input, self.run);
                let stops = (0..scan.lines.len() as u32).filter(|l| gr_interp::is_stop(&scan, *l)).map(|l| l + first).collect();
                let chunk = Chunk { text: input.text(self.db).clone(), scan };
                visited.insert(first, Visited { chunk, stops });
                first
            }
        };
        visited.get(&first).map(|v| f(v, first))
    }
}

impl Files for Library<'_> {
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
            return self.visit(line, |v, first| (v.chunk.clone(), line - first, first));
        }
        let file = self.file(id);
        let (c, l) = file.locate(line)?;
        Some((file.chunks[c].clone(), l, file.first_lines[c]))
    }
    fn next_control(&self, id: FileId, line: u32) -> Option<u32> {
        if id != self.main {
            return None;
        }
        let here = self.visit(line, |v, first| {
            let at = v.stops.partition_point(|l| *l < line);
            v.stops.get(at).copied().ok_or(first + v.chunk.scan.lines.len() as u32)
        });
        Some(match here {
            Some(Ok(stop)) => stop,
            Some(Err(behind)) => next_stop(self.db, self.document, behind),
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
pub(crate) fn plain_path(path: &Path) -> PathBuf {
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
