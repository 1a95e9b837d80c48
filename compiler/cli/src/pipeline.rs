//! From a source file to motion: read, check, and when there is no error, interpret and lower.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gr_canon::{CallFrame, FileId, FrameId, Sink};
use gr_driver::{Options, Session};
use gr_gcode::{Chunk, File};
use gr_interp::{Files, Interp, Setup};
use gr_ir::{Lowering, Program};
use gr_spec::{Dialect, Family};
use gr_text::{Diagnostic, Encoding, Severity, decode};

use crate::commands::check::{Checked, session_sources, unreadable};
use crate::setup::Station;
use crate::sources::{Sources, read};

/// Lines in a chunk.
const CHUNK: usize = 4096;

/// A source file, read and found good.
pub struct Unit {
    /// As the user named it.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// How it was spelled.
    pub encoding: Encoding,
    /// What it is run with.
    pub setup: Setup,
}

/// Reads a file and checks it. `Err` holds the findings when there are errors; otherwise they are warnings.
pub fn open(path: &Path, station: &Station) -> Result<(Unit, Checked), Checked> {
    let name = path.display().to_string();
    let decoded = read(path).map_err(|(code, args)| unreadable(&name, code, &args))?;
    let setup = station.setup_for(path, &decoded.text);
    let mut session = Session::new();
    let mut options = Options::new(setup.clone());
    station.lints.put_into(&mut options.rules);
    let file = session.open(&name, &decoded.text, options);
    let check = session.check(file);
    let mut found = check.diagnostics;
    found.iter_mut().for_each(|d| station.lints.harden(d));
    let bad = found.iter().any(|d| d.severity == Severity::Error);
    let checked = Checked { sources: session_sources(&session, &found), found, more: check.more, unreadable: false };
    if bad {
        return Err(checked);
    }
    Ok((Unit { path: path.to_path_buf(), text: decoded.text, encoding: decoded.encoding, setup }, checked))
}

/// The files of one run, the program first.
pub struct Disk {
    files: Vec<File>,
    known: BTreeMap<PathBuf, FileId>,
    setup: Setup,
}

impl Disk {
    /// The program and what it will be run with.
    pub fn new(file: File, setup: Setup) -> Disk {
        Disk { files: vec![file], known: BTreeMap::new(), setup }
    }
    /// Files that were pulled in.
    pub fn subs(&self) -> impl Iterator<Item = &PathBuf> {
        self.known.keys()
    }
    /// All files as texts for messages.
    pub fn sources(&self) -> Sources {
        let mut sources = Sources::default();
        for file in &self.files {
            let text: String = file.chunks.iter().map(|c| &*c.text).collect();
            sources.add(file.path.to_string(), text);
        }
        sources
    }
}

impl Files for Disk {
    fn file(&self, id: FileId) -> &File {
        &self.files[id.0 as usize]
    }
    fn find_sub(&mut self, name: &str) -> Option<FileId> {
        for path in gr_interp::subroutine_paths(&self.setup, name) {
            if let Some(id) = self.known.get(&path) {
                return Some(*id);
            }
            let Ok(bytes) = std::fs::read(&path) else { continue };
            let file = file_of(&path.to_string_lossy(), &decode(bytes).text, self.setup.dialect);
            self.files.push(file);
            let id = FileId(self.files.len() as u32 - 1);
            self.known.insert(path, id);
            return Some(id);
        }
        None
    }
}

/// A text cut into chunks and scanned.
pub fn file_of(name: &str, text: &str, dialect: &'static Dialect) -> File {
    let chunks = gr_gcode::split_chunks(text, CHUNK)
        .into_iter()
        .map(|part| Chunk { text: part.into(), scan: Arc::new(gr_gcode::scan(part, dialect)) })
        .collect();
    File::new(name, chunks)
}

/// Runs a program into a sink. The files it used come back with the sink.
pub fn run<S: Sink>(unit: &Unit, sink: S) -> (S, Disk) {
    let name = unit.path.display().to_string();
    let mut disk = Disk::new(file_of(&name, &unit.text, unit.setup.dialect), unit.setup.clone());
    let mut interp = Interp::new(&mut disk, &unit.setup, sink);
    interp.run(FileId(0));
    let sink = interp.into_sink();
    (sink, disk)
}

/// Motion of a program, and the texts that it comes from.
pub struct Motion {
    /// The motion.
    pub program: Program,
    /// Files under the numbers that the motion uses.
    pub sources: Sources,
    /// Files pulled in.
    pub subs: Vec<PathBuf>,
    /// What else was found.
    pub found: Vec<Diagnostic>,
}

/// Interprets and lowers a checked file.
pub fn motion(unit: &Unit, machine: Option<&gr_machine::Machine>) -> Motion {
    if unit.setup.dialect.family == Family::Ufmg2008 {
        return ufmg(unit, machine);
    }
    let (lowering, disk) = run(unit, Lower(Lowering::new()));
    let mut lowering = lowering.0;
    for (i, file) in disk.files.iter().enumerate() {
        lowering.builder_mut().file(FileId(i as u32), &file.path);
    }
    Motion { program: lowering.finish(), sources: disk.sources(), subs: disk.subs().cloned().collect(), found: Vec::new() }
}

/// The UFMG 2008 language has commands of its own and no interpreter state.
fn ufmg(unit: &Unit, machine: Option<&gr_machine::Machine>) -> Motion {
    let name = unit.path.display().to_string();
    let file = file_of(&name, &unit.text, unit.setup.dialect);
    let (commands, mut found) = gr_backends::joint::language::read(FileId(0), &file);
    let builtin = gr_machine::builtin("ufmg/plano-3r").expect("the library has it");
    let (program, more) = gr_backends::joint::ufmg::lower(FileId(0), &name, &commands, machine.unwrap_or(&builtin));
    found.extend(more);
    let sources = Disk::new(file, unit.setup.clone()).sources();
    Motion { program, sources, subs: Vec::new(), found }
}

/// A lowering that drops texts for standard output.
struct Lower(Lowering);

impl Sink for Lower {
    fn call(&mut self, at: &gr_canon::At<'_>, call: &gr_canon::Call) {
        self.0.call(at, call);
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        self.0.frame(id, frame);
    }
    fn mark(&mut self, at: &gr_canon::At<'_>, mark: &gr_canon::Mark) {
        self.0.mark(at, mark);
    }
}
