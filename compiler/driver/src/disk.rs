//! Files that programs pull in by themselves: external subroutines, found along the search path.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use gr_canon::FileId;
use gr_gcode::{Chunk, File};
use gr_spec::Dialect;
use gr_text::Text;

/// Every file of a session by number: open ones and those found on disk.
#[derive(Debug, Default)]
pub(crate) struct Disk {
    files: Mutex<Vec<Known>>,
}

#[derive(Clone, Debug)]
struct Known {
    path: Box<str>,
    /// The contents, when the file was read from disk and is not open.
    contents: Option<Arc<File>>,
}

/// Lines in a chunk of a subroutine file.
pub(crate) const CHUNK: usize = 1024;

impl Disk {
    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Known>> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }
    /// A number for an open file.
    pub(crate) fn register(&self, path: &str) -> FileId {
        let mut files = self.lock();
        if let Some(at) = files.iter().position(|k| &*k.path == path) {
            files[at].contents = None;
            return FileId(at as u32);
        }
        files.push(Known { path: path.into(), contents: None });
        FileId(files.len() as u32 - 1)
    }
    /// Path of a file as given.
    pub(crate) fn path(&self, id: FileId) -> Option<Box<str>> {
        self.lock().get(id.0 as usize).map(|k| k.path.clone())
    }
    /// Contents of a file read from disk.
    pub(crate) fn contents(&self, id: FileId) -> Option<Arc<File>> {
        self.lock().get(id.0 as usize)?.contents.clone()
    }
    /// A file, when it can be read.
    pub(crate) fn load(&self, path: &Path, dialect: &'static Dialect) -> Option<(FileId, Arc<File>)> {
        let name = path.to_string_lossy();
        let known = self.lock().iter().position(|k| *k.path == *name);
        if let Some(at) = known
            && let Some(file) = self.contents(FileId(at as u32))
        {
            return Some((FileId(at as u32), file));
        }
        if !path.is_file() {
            return None;
        }
        let text = read_as(std::fs::read(path).ok()?, dialect).into();
        let file = Arc::new(file_of(&name, &text, CHUNK, dialect));
        // Another query may have read the file meanwhile.
        let mut files = self.lock();
        let at = files.iter().position(|k| *k.path == *name).unwrap_or(files.len());
        let entry = Known { path: (*name).into(), contents: Some(file.clone()) };
        if at == files.len() {
            files.push(entry);
        } else {
            files[at] = entry;
        }
        Some((FileId(at as u32), file))
    }
    /// Forgets what was read from disk; the numbers stay.
    pub(crate) fn forget(&self) {
        self.lock().iter_mut().for_each(|k| k.contents = None);
    }
}

/// The text of a file as its control reads it.
pub(crate) fn read_as(bytes: Vec<u8>, dialect: &Dialect) -> String {
    let linuxcnc = dialect.family == gr_spec::Family::Linuxcnc;
    if linuxcnc { gr_text::decode_as_linuxcnc(bytes).text } else { gr_text::decode(bytes).text }
}

/// Scans a whole text.
pub(crate) fn file_of(path: &str, text: &Text, lines_per_chunk: usize, dialect: &'static Dialect) -> File {
    let chunks = crate::store::split(text, lines_per_chunk)
        .into_iter()
        .map(|part| Chunk { scan: Arc::new(gr_gcode::scan(&part, dialect)), text: part })
        .collect();
    File::new(path, chunks)
}
