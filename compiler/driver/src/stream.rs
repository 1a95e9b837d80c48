//! One run of a program from top to bottom, into a sink: what a build is made from.
//!
//! The program is scanned as it is read, so that a big file needs little more memory than its text. On request
//! the lints watch the same run; when neither they nor the interpreter have anything to say the program is
//! *clean*, and need not be checked again. Otherwise [`crate::check_once`] says what there is to say: there is
//! one wording of findings, and it is there.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use gr_canon::{At, Call, CallFrame, FileId, FrameId, Mark, Sink};
use gr_gcode::{Chunk, File};
use gr_interp::{End, Files, Interp, Outcome, Setup};
use gr_ir::{Lowering, Program};
use gr_text::Text;

use crate::db::{Shape, shape_of};
use crate::lazy::Lazy;
use crate::lints::{Flags, Lints};
use crate::timeline::Late;
use crate::{Options, Rules};

/// The files of one run: the program, number 0, and the subroutine files it pulls in.
pub struct Loaded {
    main: Lazy,
    subs: Vec<File>,
    known: BTreeMap<PathBuf, FileId>,
    sought: BTreeSet<PathBuf>,
    setup: Setup,
    overlay: Overlay,
}

/// Texts that stand in for files on disk, by their absolute paths without `.` and `..`; none = there is no such file.
pub type Overlay = BTreeMap<PathBuf, Option<std::sync::Arc<str>>>;

impl Loaded {
    /// The program and what it will be run with. Nothing is scanned yet.
    pub fn new(path: &str, text: Text, setup: &Setup) -> Loaded {
        Loaded::over(path, text, setup, Overlay::new())
    }
    /// The same with texts that go before those on disk.
    pub fn over(path: &str, text: Text, setup: &Setup, overlay: Overlay) -> Loaded {
        Loaded { main: Lazy::new(path, text, setup.dialect), subs: Vec::new(), known: BTreeMap::new(), sought: BTreeSet::new(), setup: setup.clone(), overlay }
    }
    fn read(&self, path: &std::path::Path) -> Option<String> {
        if !self.overlay.is_empty()
            && let Some(text) = self.overlay.get(&crate::library::plain_path(path))
        {
            return text.as_deref().map(str::to_string);
        }
        if !path.is_file() {
            return None;
        }
        Some(crate::disk::read_as(std::fs::read(path).ok()?, self.setup.dialect))
    }
    /// Subroutine files that were pulled in, in the order of their names.
    pub fn subs(&self) -> impl Iterator<Item = &PathBuf> {
        self.known.keys()
    }
    /// Subroutine files that were looked for and are not there: should one come, the program may be another.
    pub fn missing(&self) -> impl Iterator<Item = &PathBuf> {
        self.sought.iter()
    }
    /// Names and texts of all files, under the numbers that the stream uses.
    pub fn texts(&self) -> Vec<(Box<str>, Text)> {
        let text = |f: &File| f.chunks.iter().map(|c| &*c.text).collect::<String>().into();
        let main = (self.main.path().into(), self.main.text().clone());
        std::iter::once(main).chain(self.subs.iter().map(|f| (f.path.clone(), text(f)))).collect()
    }
}

impl Files for Loaded {
    fn file(&self, id: FileId) -> &File {
        match (id.0 as usize).checked_sub(1) {
            Some(sub) => &self.subs[sub],
            None => self.main.file(),
        }
    }
    fn find_sub(&mut self, name: &str) -> Option<FileId> {
        for path in gr_interp::subroutine_paths(&self.setup, name) {
            if let Some(id) = self.known.get(&path) {
                return Some(*id);
            }
            let Some(text) = self.read(&path).map(Text::from) else {
                self.sought.insert(path);
                continue;
            };
            self.subs.push(crate::disk::file_of(&path.to_string_lossy(), &text, crate::disk::CHUNK, self.setup.dialect));
            let id = FileId(self.subs.len() as u32);
            self.known.insert(path, id);
            return Some(id);
        }
        None
    }
    fn chunk(&self, id: FileId, line: u32) -> Option<(Chunk, u32, u32)> {
        if id.0 == 0 {
            return self.main.chunk(line);
        }
        let file = self.file(id);
        let (c, l) = file.locate(line)?;
        Some((file.chunks[c].clone(), l, file.first_lines[c]))
    }
    fn is_plain(&self, id: FileId) -> bool {
        id.0 == 0 && self.main.is_plain()
    }
}

/// What came of a run.
pub struct Streamed<S> {
    /// The sink that was given.
    pub sink: S,
    /// The files that were used.
    pub files: Loaded,
    /// How the interpreter ended, and what it found.
    pub outcome: Outcome,
    /// Lints were asked for, and a check of this program would say nothing at all.
    pub clean: bool,
}

/// Runs a program into a sink. With `rules`, the lints watch.
pub fn stream<S: Sink>(path: &str, text: Text, setup: &Setup, rules: Option<&Rules>, sink: S) -> Streamed<S> {
    stream_of(Loaded::new(path, text, setup), setup, rules, sink)
}

/// The same of files that were put together before.
pub(crate) fn stream_of<S: Sink>(mut files: Loaded, setup: &Setup, rules: Option<&Rules>, sink: S) -> Streamed<S> {
    let tee = Tee { sink, lints: None, doubt: false };
    let mut run = Interp::new(&mut files, setup, tee);
    run.init();
    let opened = run.open(FileId(0));
    let mut end = End::Fault;
    let mut left = None;
    if opened.is_ok() {
        let start = *run.modal();
        run.sink().lints = rules.map(|rules| Lints::new(rules, &start, Flags::at_start(setup)));
        end = run.run_open();
        let tee = run.sink();
        left = tee.lints.take().map(|lints| (lints, tee.doubt));
        if let (Some((lints, _)), Some(rules)) = (&mut left, rules)
            && end != End::Program
        {
            // The state before the controller is reset.
            lints.found.extend(crate::lints::left_on(run.modal(), crate::lints::Where::default(), rules));
        }
        // Closing the file and leaving both reset the controller; with an INI file the real `rs274` forgets the former.
        if setup.startup_code || setup.ini.values.is_empty() {
            run.reset();
        }
        run.reset();
    }
    let outcome = run.finish(end);
    let sink = run.into_sink().sink;
    let quiet = outcome.findings.is_empty() && outcome.damaged.is_empty() && matches!(end, End::Program | End::Percent);
    let clean = match (left, rules) {
        (Some((lints, false)), Some(rules)) if quiet => says_nothing(lints, &files, setup, rules),
        _ => false,
    };
    Streamed { sink, files, outcome, clean }
}

/// Whether the lints have nothing to say, in the program and about it as a whole.
fn says_nothing(lints: Lints<'_>, files: &Loaded, setup: &Setup, rules: &Rules) -> bool {
    let mut late = Late::default();
    late.take(&lints.summary, None, rules);
    if !lints.found.is_empty() || !late.found.is_empty() {
        return false;
    }
    if crate::layout::lone_return(files.main.text()).is_some() && crate::engine::joins_lines(setup.dialect) {
        return false;
    }
    if files.main.is_plain() && setup.dialect.family != gr_spec::Family::Fanuc {
        return true;
    }
    // Labels tell about each other.
    let file = files.main.file();
    let options = Options { setup: setup.clone(), rules: rules.clone(), chunk_lines: None };
    let shapes: Vec<Shape> = file.chunks.iter().map(|c| shape_of(&c.scan, &c.text, &options.setup)).collect();
    let mut found = Vec::new();
    crate::lints::labels(&shapes.iter().collect::<Vec<_>>(), &file.first_lines, crate::lints::called_as(files.main.path()), &options, &mut found);
    found.is_empty()
}

/// Lets the lints hear what the sink hears.
struct Tee<'a, S> {
    sink: S,
    lints: Option<Lints<'a>>,
    /// There is more than a lint keeps: it can't be told here whether it matters.
    doubt: bool,
}

impl<S: Sink> Sink for Tee<'_, S> {
    #[inline]
    fn call(&mut self, at: &At<'_>, call: &Call) {
        if let Some(lints) = &mut self.lints {
            lints.call(at, call);
            self.doubt |= lints.summary.is_full();
        }
        self.sink.call(at, call);
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        self.sink.frame(id, frame);
    }
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        if let Some(lints) = &mut self.lints {
            lints.mark(at, mark);
        }
        self.sink.mark(at, mark);
    }
    fn print(&mut self, text: &str) {
        self.sink.print(text);
    }
}

/// A text with all its tables.
pub fn scan_file(path: &str, text: impl Into<Text>, dialect: &'static gr_spec::Dialect) -> File {
    crate::disk::file_of(path, &text.into(), crate::disk::CHUNK, dialect)
}

/// Motion of a program, and where it comes from.
pub struct Motion {
    /// The motion.
    pub program: Program,
    /// Names and texts of files under the numbers that the motion uses.
    pub texts: Vec<(Box<str>, Text)>,
    /// Subroutine files that were pulled in.
    pub subs: Vec<PathBuf>,
    /// Subroutine files that were looked for and are not there.
    pub missing: Vec<PathBuf>,
    /// Lints were asked for, and a check of this program would say nothing at all.
    pub clean: bool,
}

/// Runs a program and lowers it to motion.
pub fn lower(path: &str, text: Text, setup: &Setup, rules: Option<&Rules>) -> Motion {
    let lowering = Lowering::new().on(setup.machine_units).standing(&setup.start);
    let Streamed { sink, files, clean, .. } = stream(path, text, setup, rules, Mute(lowering));
    let mut lowering = sink.0;
    let texts = files.texts();
    for (i, (name, _)) in texts.iter().enumerate() {
        lowering.builder_mut().file(FileId(i as u32), name);
    }
    Motion { program: lowering.finish(), texts, subs: files.subs().cloned().collect(), missing: files.missing().cloned().collect(), clean }
}

/// Drops texts for standard output.
struct Mute<S>(S);

impl<S: Sink> Sink for Mute<S> {
    #[inline]
    fn call(&mut self, at: &At<'_>, call: &Call) {
        self.0.call(at, call);
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        self.0.frame(id, frame);
    }
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        self.0.mark(at, mark);
    }
}
