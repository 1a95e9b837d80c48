//! Folders that the client has open, and the programs in them. Nothing outside of them and of the search path for
//! subroutines is read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use gr_gcode::File;
use gr_spec::Dialect;

/// Files of a workspace that are looked at for calls and names.
const MOST_FILES: usize = 2_000;
/// Larger ones are not.
const MOST_BYTES: u64 = 2_000_000;
/// Folders below folders.
const MOST_DEPTH: u32 = 12;

type Cached = BTreeMap<PathBuf, (Option<SystemTime>, Arc<File>)>;

/// Folders and what was read from them.
#[derive(Default)]
pub struct Workspace {
    folders: Mutex<Vec<PathBuf>>,
    files: Mutex<Cached>,
}

impl Workspace {
    /// Folders that are open.
    pub fn set_folders(&self, folders: Vec<PathBuf>) {
        *self.folders.lock().unwrap_or_else(PoisonError::into_inner) = folders;
    }
    /// The same.
    pub fn folders(&self) -> Vec<PathBuf> {
        self.folders.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
    /// Whether a file lies in one of the folders, whatever way its name takes.
    pub fn holds(&self, path: &Path) -> bool {
        let Ok(real) = path.canonicalize() else { return false };
        real.is_file() && self.folders().iter().filter_map(|f| f.canonicalize().ok()).any(|f| real.starts_with(f))
    }
    /// Whether a file that seems to lie in one of the folders lies elsewhere: a link leads out of them.
    pub fn strays(&self, path: &Path) -> bool {
        let seems = std::path::absolute(path).is_ok_and(|p| self.folders().iter().any(|f| p.starts_with(f)));
        seems && !self.holds(path)
    }
    /// Forgets what was read.
    pub fn forget(&self) {
        self.files.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
    /// G-code programs in the folders, in order.
    pub fn programs(&self) -> Vec<PathBuf> {
        self.files_that(is_program)
    }
    /// G-code programs and STEP-NC files in the folders.
    pub fn programs_and_plans(&self) -> Vec<PathBuf> {
        self.files_that(|path| is_program(path) || is_plan(path))
    }
    fn files_that(&self, wanted: fn(&Path) -> bool) -> Vec<PathBuf> {
        let mut found = Vec::new();
        for folder in self.folders() {
            walk(&folder, 0, wanted, &mut found);
        }
        found.sort();
        found.dedup();
        found
    }
    /// Text of a STEP-NC file; none of what is another file.
    pub fn plan(&self, path: &Path) -> Option<String> {
        let wanted = is_plan(path) && std::fs::metadata(path).is_ok_and(|m| m.is_file() && m.len() <= MOST_BYTES);
        wanted.then(|| std::fs::read(path).ok())?.map(|bytes| gr_text::decode(bytes).text)
    }
    /// A file with its tables, read again when it changed.
    pub fn file(&self, path: &Path, dialect: &'static Dialect) -> Option<Arc<File>> {
        let meta = std::fs::metadata(path).ok()?;
        if !meta.is_file() || meta.len() > MOST_BYTES {
            return None;
        }
        let time = meta.modified().ok();
        if let Some((known, file)) = self.files.lock().unwrap_or_else(PoisonError::into_inner).get(path)
            && *known == time
            && time.is_some()
        {
            return Some(file.clone());
        }
        let text = gr_text::decode(std::fs::read(path).ok()?).text;
        let file = Arc::new(gr_driver::scan_file(&path.to_string_lossy(), &text, dialect));
        self.files.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_path_buf(), (time, file.clone()));
        Some(file)
    }
}

/// Text of a stored file. Pipes and devices are none: where nobody writes to them, reading would never end.
pub fn stored(path: &Path) -> Option<String> {
    let is_file = std::fs::metadata(path).is_ok_and(|m| m.is_file());
    is_file.then(|| std::fs::read(path).ok())?.map(|bytes| gr_text::decode(bytes).text)
}

/// Extensions of G-code programs, those that only other programs claim left out.
pub fn is_program(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    matches!(extension.as_str(), "ngc" | "nc" | "tap" | "cnc" | "g" | "ncc" | "gcode")
        || Dialect::all().iter().any(|d| d.extensions.contains(&extension.as_str()))
}

/// Extensions of STEP-NC files. `.stp` and `.step` are mostly models of shapes: those are looked at when they are open.
fn is_plan(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    matches!(extension.as_str(), "p21" | "stpnc")
}

fn walk(folder: &Path, depth: u32, wanted: fn(&Path) -> bool, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    entries.sort();
    for path in entries {
        if found.len() >= MOST_FILES {
            return;
        }
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if name.starts_with('.') || matches!(name.as_str(), "target" | "node_modules") || path.is_symlink() {
            continue;
        }
        if path.is_dir() {
            if depth < MOST_DEPTH {
                walk(&path, depth + 1, wanted, found);
            }
        } else if wanted(&path) && path.is_file() {
            found.push(path);
        }
    }
}
