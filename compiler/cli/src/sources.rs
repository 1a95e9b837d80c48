//! The files of one run of the command: their names and texts, for reading and for showing diagnostics.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use gr_text::{Decoded, Diagnostic, Encoding, FileId, LineMarks, Span, Text, code, decode};

/// A program has fewer bytes than this.
const MAX_BYTES: u64 = i32::MAX as u64;

/// A file as diagnostics show it.
#[derive(Clone, Debug)]
pub struct SourceFile {
    /// As the user named it.
    pub name: String,
    /// Decoded text; empty when the file could not be read.
    pub text: Text,
}

/// All files that diagnostics of a run may point into.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    files: Vec<SourceFile>,
}

impl Sources {
    /// Adds a file.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<Text>) -> FileId {
        self.files.push(SourceFile { name: name.into(), text: text.into() });
        FileId(self.files.len() as u32 - 1)
    }
    /// A file.
    pub fn get(&self, id: FileId) -> Option<&SourceFile> {
        self.files.get(id.0 as usize)
    }
    /// All files with their numbers.
    pub fn iter(&self) -> impl Iterator<Item = (FileId, &SourceFile)> {
        self.files.iter().enumerate().map(|(i, f)| (FileId(i as u32), f))
    }
    /// Its name.
    pub fn name(&self, id: FileId) -> &str {
        self.get(id).map_or("", |f| f.name.as_str())
    }
}

/// Lines of the file that was asked for last: findings come in order of files.
#[derive(Default)]
pub struct Positions {
    last: Option<(FileId, LineMarks)>,
}

impl Positions {
    /// Line and column (in characters) of an offset, both from 1.
    pub fn of(&mut self, sources: &Sources, file: FileId, offset: u32) -> (u32, u32) {
        let Some(source) = sources.get(file) else { return (1, 1) };
        let at = offset.min(source.text.len() as u32);
        let (line, column) = self.marks(source, file).position(source.text.as_bytes(), at);
        let start = (at - column) as usize;
        let end = floor(&source.text, (offset as usize).min(source.text.len()));
        let column = source.text.get(start..end).map_or(0, |s| s.chars().count());
        (line + 1, column as u32 + 1)
    }
    /// First byte of a line.
    pub fn start(&mut self, source: &SourceFile, file: FileId, line: u32) -> usize {
        self.marks(source, file).start(source.text.as_bytes(), line as usize) as usize
    }
    fn marks(&mut self, source: &SourceFile, file: FileId) -> &LineMarks {
        if self.last.as_ref().is_none_or(|(f, _)| *f != file) {
            self.last = Some((file, LineMarks::new(source.text.as_bytes())));
        }
        &self.last.as_ref().expect("just set").1
    }
}

/// The character boundary at or before `at`.
pub fn floor(text: &str, mut at: usize) -> usize {
    at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// A finding about a file as a whole.
pub fn about_file(code: gr_text::Code, file: FileId, args: &[String]) -> Diagnostic {
    Diagnostic::new(code, file, Span::default(), args)
}

/// Reads a program; `-` is standard input. The finding, if any, points at a file that holds only the name.
pub fn read(path: &Path) -> Result<Decoded, (gr_text::Code, Vec<String>)> {
    let name = path.display().to_string();
    let bytes = read_bytes(path).map_err(|(code, mut args)| {
        args.insert(0, name.clone());
        (code, args)
    })?;
    if let Some(kind) = binary(&bytes) {
        return Err((code::FILE_BINARY, vec![name, kind.to_string()]));
    }
    Ok(decode(bytes))
}

/// Reads a file that a program is set up with: a tool table, a machine file, settings. A pipe or a device is refused: where nobody
/// writes to it, reading would never end, and standard input belongs to the program or to an editor.
pub fn read_setup(path: &Path) -> Result<Decoded, (gr_text::Code, Vec<String>)> {
    if std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        return Err((code::FILE_UNREADABLE, vec![path.display().to_string(), NO_FILE.to_string()]));
    }
    read(path)
}

/// Why pipes and devices aren't read.
pub const NO_FILE: &str = "it is a pipe or a device, and a stored file is needed here";

/// Reads a program; what is plainly something else, a settings file for example, is refused by name.
pub fn read_program(path: &Path) -> Result<Decoded, (gr_text::Code, Vec<String>)> {
    let decoded = read(path)?;
    match foreign(&decoded.text).filter(|_| !crate::exchange::is_exchange(path, &decoded.text)) {
        Some(kind) => Err((code::FILE_NOT_A_PROGRAM, vec![path.display().to_string(), kind.to_string()])),
        None => Ok(decoded),
    }
}

/// What a text is that no control reads: told by its first line that is no remark.
fn foreign(text: &str) -> Option<&'static str> {
    // `# remark` of a settings file; `#1=…` and `#<x>=…` are G-code.
    let remark = |l: &str| l.strip_prefix('#').is_some_and(|r| r.trim_start().starts_with(|c: char| c.is_ascii_alphabetic()));
    let first = text.lines().take(200).map(str::trim).find(|l| !l.is_empty() && !remark(l))?;
    let lower: String = first.chars().take(200).collect::<String>().to_ascii_lowercase();
    let is_key = |k: &str| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "_.-".contains(c);
        k.len() > 1 && k.starts_with(|c: char| c.is_ascii_alphabetic()) && k.chars().all(plain)
    };
    let section = lower.strip_prefix('[').map(|l| l.trim_start_matches('[').trim_end_matches(']'));
    if ["<?xml", "<!doctype", "<html", "<svg"].iter().any(|s| lower.starts_with(s)) {
        return Some("an XML or HTML document");
    }
    if lower.starts_with('{') {
        return Some("JSON");
    }
    let setting = lower.split_once('=').is_some_and(|(key, _)| is_key(key.trim()));
    let section = section.is_some_and(is_key) && lower.ends_with(']');
    (setting || section).then_some("a settings file (TOML or INI)")
}

/// Bytes that are looked at to tell a text from another kind of file.
const HEAD: usize = 8192;

/// First bytes of kinds of files that programs come packed in, or are taken for.
const MAGIC: [(&[u8], &str); 12] = [
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1F\x8B", "compressed by gzip"),
    (b"7z\xBC\xAF\x27\x1C", "a 7z archive"),
    (b"Rar!\x1A", "a RAR archive"),
    (b"BZh9", "compressed by bzip2"),
    (b"\xFD7zXZ", "compressed by xz"),
    (b"%PDF-", "a PDF document"),
    (b"\x89PNG", "a picture"),
    (b"\xFF\xD8\xFF", "a picture"),
    (b"\x7FELF", "an executable program"),
    (b"MZ\x90\x00", "an executable program"),
    (b"\xD0\xCF\x11\xE0", "an office document"),
];

/// What a file is that is no text.
fn binary(bytes: &[u8]) -> Option<&'static str> {
    if let Some((_, kind)) = MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        return Some(kind);
    }
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return None;
    }
    let head = &bytes[..bytes.len().min(HEAD)];
    // Serial lines leave runs of NUL at either end.
    let start = head.iter().position(|b| *b != 0).unwrap_or(head.len());
    let end = head.iter().rposition(|b| *b != 0).map_or(start, |n| n + 1);
    let body = &head[start..end];
    let control = |b: &&u8| matches!(b, 0..=8 | 0x0B | 0x0E..=0x19 | 0x1B..=0x1F | 0x7F);
    let controls = body.iter().filter(control).count();
    (controls >= 16 && controls * 20 > body.len()).then_some("binary data")
}

/// The bytes of a file, or why there are none.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, (gr_text::Code, Vec<String>)> {
    let unreadable = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::NotFound => (code::FILE_MISSING, vec![]),
        std::io::ErrorKind::IsADirectory => (code::FILE_DIRECTORY, vec![]),
        _ => (code::FILE_UNREADABLE, vec![reason(&e)]),
    };
    let too_big = |len: u64| (code::FILE_TOO_BIG, vec![len.to_string()]);
    let mut bytes = Vec::new();
    if path == Path::new("-") {
        std::io::stdin().lock().take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    } else {
        let meta = std::fs::metadata(path).map_err(unreadable)?;
        if meta.is_dir() {
            return Err((code::FILE_DIRECTORY, vec![]));
        }
        if meta.is_file() && meta.len() > MAX_BYTES {
            return Err(too_big(meta.len()));
        }
        let file = std::fs::File::open(path).map_err(unreadable)?;
        bytes.reserve_exact(meta.len() as usize + 1);
        file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    }
    if bytes.len() as u64 > MAX_BYTES { Err(too_big(bytes.len() as u64)) } else { Ok(bytes) }
}

/// What the operating system says, without its error number.
pub fn reason(e: &std::io::Error) -> String {
    let text = e.to_string();
    text.split(" (os error").next().unwrap_or("").to_lowercase()
}

/// Whether a text was spelled in Latin-1.
pub fn is_latin1(d: &Decoded) -> bool {
    d.encoding == Encoding::Latin1
}

/// All programs below `folder`, in order: files that are `wanted`. Hidden ones are left out.
/// Folders that can't be read come back.
pub fn walk(folder: &Path, wanted: &dyn Fn(&Path) -> bool, found: &mut Vec<PathBuf>) -> Vec<(PathBuf, std::io::Error)> {
    let listed = std::fs::read_dir(folder).and_then(|list| list.map(|e| e.map(|e| e.path())).collect::<Result<Vec<_>, _>>());
    let mut entries = match listed {
        Ok(entries) => entries,
        Err(e) => return vec![(folder.to_path_buf(), e)],
    };
    entries.sort();
    let mut closed = Vec::new();
    for path in entries {
        let hidden = path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
        if hidden {
            continue;
        }
        // A link to a folder could lead in circles.
        if path.is_dir() && !path.is_symlink() {
            closed.extend(walk(&path, wanted, found));
        } else if path.is_file() && wanted(&path) {
            found.push(path);
        }
    }
    closed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_and_others() {
        assert_eq!(binary(b"PK\x03\x04rest"), Some("a ZIP archive"));
        let noise: Vec<u8> = (0..4000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        assert_eq!(binary(&noise), Some("binary data"));
        for text in [&b"G0 X1\0\n"[..], b"", b"\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0%\nG0\n", b"(\xFCber)\r\n\x1A", b"\xFF\xFEG\0001\0"] {
            assert_eq!(binary(text), None, "{text:?}");
        }
    }
}
