//! Writing results: to standard output, or beside the goal and renamed when complete.

use std::io::Write;
use std::path::{Path, PathBuf};

/// A result on its way to a file. Dropped without [`Pending::commit`], it leaves nothing behind.
pub struct Pending {
    goal: PathBuf,
    beside: PathBuf,
    file: Option<std::fs::File>,
    /// The goal is no file and is written to directly.
    device: bool,
    /// Folders that were made for it, the innermost first.
    folders: Vec<PathBuf>,
}

/// Makes the folders of a file that are missing, and tells which.
fn make_folders(goal: &Path) -> std::io::Result<Vec<PathBuf>> {
    let missing = |f: &&Path| !f.as_os_str().is_empty() && !f.exists();
    let made: Vec<PathBuf> = goal.ancestors().skip(1).take_while(missing).map(Path::to_path_buf).collect();
    if let Some(folder) = made.first() {
        // Not half of them.
        std::fs::create_dir_all(folder).inspect_err(|_| made.iter().for_each(|f| _ = std::fs::remove_dir(f)))?;
    }
    Ok(made)
}

impl Pending {
    /// Opens a file beside `goal`.
    pub fn new(goal: &Path) -> std::io::Result<Pending> {
        if goal.is_dir() {
            return Err(std::io::Error::new(std::io::ErrorKind::IsADirectory, "is a folder"));
        }
        let there = std::fs::metadata(goal).ok();
        if there.as_ref().is_some_and(|m| !m.is_file()) {
            // A device or a pipe (/dev/null) is written to, never replaced.
            let file = std::fs::OpenOptions::new().write(true).open(goal)?;
            return Ok(Pending { goal: goal.to_path_buf(), beside: goal.to_path_buf(), file: Some(file), device: true, folders: Vec::new() });
        }
        // What a link names is replaced, not the link.
        let goal = &if there.is_some() { goal.canonicalize()? } else { goal.to_path_buf() };
        let folders = make_folders(goal)?;
        let name = goal.file_name().ok_or_else(|| std::io::Error::other("is not a file name"))?;
        // Never a file that is there already: in a folder of everybody's it could lead elsewhere.
        for n in 0..100 {
            let mut hidden = std::ffi::OsString::from(".");
            hidden.push(name);
            hidden.push(format!(".{}.{n}.part", std::process::id()));
            let beside = goal.with_file_name(hidden);
            let file = match std::fs::File::create_new(&beside) {
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => continue,
                made => made?,
            };
            let pending = Pending { goal: goal.to_path_buf(), beside, file: Some(file), device: false, folders };
            if let (Some(old), Some(file)) = (there, &pending.file) {
                file.set_permissions(old.permissions())?;
            }
            return Ok(pending);
        }
        Err(std::io::Error::other("its folder is full of unfinished files of ours (.part)"))
    }
    /// Copies what was written to standard output. A reader that went away (`| head`) is no error.
    pub fn to_stdout(self) -> std::io::Result<()> {
        let mut file = std::fs::File::open(&self.beside)?;
        match std::io::copy(&mut file, &mut std::io::stdout().lock()) {
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            other => other.map(|_| ()),
        }
    }
    /// The result is complete: puts it in its place.
    pub fn commit(mut self) -> std::io::Result<()> {
        if !self.device {
            std::fs::rename(&self.beside, &self.goal)?;
        }
        self.file.take();
        Ok(())
    }
}

impl Write for Pending {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.as_mut().map_or(Ok(bytes.len()), |f| f.write(bytes))
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.file.as_mut().map_or(Ok(()), Write::flush)
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if self.file.take().is_some() && !self.device {
            // Nothing more can be done about it.
            let _ = std::fs::remove_file(&self.beside);
            self.folders.iter().for_each(|f| _ = std::fs::remove_dir(f));
        }
    }
}

/// Whether two paths lead to one file.
pub fn same_file(a: &Path, b: &Path) -> bool {
    a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Writes several files so that all of them appear or none: all beside their goals first, then renamed.
pub fn write_all(files: &[(PathBuf, Vec<u8>)]) -> Result<(), (PathBuf, std::io::Error)> {
    write_with(files, Vec::new())
}

/// The same with files that are written beside their goals already.
pub fn write_with(files: &[(PathBuf, Vec<u8>)], written: Vec<Pending>) -> Result<(), (PathBuf, std::io::Error)> {
    let mut pending: Vec<(PathBuf, Pending)> = written.into_iter().map(|p| (p.goal.clone(), p)).collect();
    for (path, bytes) in files {
        let write = || {
            let mut p = Pending::new(path)?;
            p.write_all(bytes)?;
            p.flush()?;
            Ok(p)
        };
        match write() {
            Ok(p) => pending.push((path.clone(), p)),
            Err(e) => {
                drop_all(pending);
                return Err((path.clone(), e));
            }
        }
    }
    for (path, p) in pending {
        p.commit().map_err(|e| (path, e))?;
    }
    Ok(())
}

/// Drops unfinished files, the last first: the first one may have made the folder of all.
pub fn drop_all(mut pending: Vec<(PathBuf, Pending)>) {
    while pending.pop().is_some() {}
}

/// Writes to standard output. A reader that went away (`| head`) is no error.
pub fn to_stdout(bytes: &[u8]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

/// A file as make and ninja name it: from the folder that they and this program run in, where it lies there.
pub fn from_here(path: &Path) -> PathBuf {
    let here = std::env::current_dir().unwrap_or_default();
    path.strip_prefix(&here).unwrap_or(path).to_path_buf()
}

/// Names of the files a result was made from, as a rule for make and ninja.
pub fn depfile(goals: &[PathBuf], sources: &[PathBuf]) -> String {
    let escape = |p: &Path| {
        let text = p.display().to_string();
        let mut out = String::new();
        for c in text.chars() {
            match c {
                ' ' | '#' => out.extend(['\\', c]),
                '$' => out.push_str("$$"),
                c => out.push(c),
            }
        }
        out
    };
    let goals: Vec<String> = goals.iter().map(|g| escape(g)).collect();
    let mut text = format!("{}:", goals.join(" "));
    for source in sources {
        text.push_str(" \\\n  ");
        text.push_str(&escape(source));
    }
    text.push('\n');
    // A source that is gone must not stop make.
    for source in sources {
        text.push_str(&format!("\n{}:\n", escape(source)));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_half_written() {
        let folder = tempfile::tempdir().unwrap();
        let goal = folder.path().join("a.ngc");
        std::fs::write(&goal, "old").unwrap();
        let mut p = Pending::new(&goal).unwrap();
        p.write_all(b"new").unwrap();
        drop(p);
        assert_eq!(std::fs::read_to_string(&goal).unwrap(), "old");
        let mut p = Pending::new(&goal).unwrap();
        p.write_all(b"new").unwrap();
        p.commit().unwrap();
        assert_eq!(std::fs::read_to_string(&goal).unwrap(), "new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(Pending::new(folder.path()).is_err());
    }

    /// The first file made the folder of both: it goes last.
    #[test]
    fn no_folder_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let both = ["a", "b"].map(|n| folder.path().join("out").join(n));
        drop_all(both.into_iter().map(|p| (p.clone(), Pending::new(&p).unwrap())).collect());
        assert!(!folder.path().join("out").exists());
    }

    #[test]
    fn all_or_none() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("no"), "a file").unwrap();
        let files = [(folder.path().join("a"), vec![1]), (folder.path().join("no/b"), vec![2])];
        assert!(write_all(&files).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(write_all(&[(folder.path().join("new/folder/b"), vec![2])]).is_ok());
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_links_stay_what_they_are() {
        use std::os::unix::fs::{FileTypeExt as _, PermissionsExt as _};
        let null = Path::new("/dev/null");
        assert!(write_all(&[(null.to_path_buf(), vec![1])]).is_ok());
        assert!(std::fs::metadata(null).unwrap().file_type().is_char_device());
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        std::fs::write(&file, "old").unwrap();
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o600)).unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_all(&[(link.clone(), b"new".to_vec())]).unwrap();
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "new");
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
    }

    #[test]
    fn rule_for_make() {
        let text = depfile(&["out file.ngc".into()], &["a$.ngc".into(), "b#.tbl".into()]);
        assert_eq!(text, "out\\ file.ngc: \\\n  a$$.ngc \\\n  b\\#.tbl\n\na$$.ngc:\n\nb\\#.tbl:\n");
    }
}
