//! The salsa database: inputs and the queries about one chunk that need no interpretation.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::sync::atomic::{AtomicU64, Ordering};

use gr_gcode::{Form, Keyword, LineKind, Node, OLabel, Parameter, Scan};

/// Which query ran: for the tests and benchmarks that count re-executed queries.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Counted {
    Scan,
    Step,
    Flow,
    Timeline,
}

/// How often each kind of query was executed (not answered from memory).
#[derive(Debug, Default)]
pub(crate) struct Counters([AtomicU64; 4]);

/// Number of executions of each kind of query since the session began.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Executed {
    /// Chunks scanned.
    pub scans: u64,
    /// Chunks interpreted.
    pub steps: u64,
    /// Stretches with control flow run.
    pub flows: u64,
    /// Files put together.
    pub timelines: u64,
}

impl Counters {
    pub(crate) fn get(&self) -> Executed {
        let [scans, steps, flows, timelines] = [0, 1, 2, 3].map(|i: usize| self.0[i].load(Ordering::Relaxed));
        Executed { scans, steps, flows, timelines }
    }
}

/// What every query may ask of the database.
#[salsa::db]
pub(crate) trait Db: salsa::Database {
    /// Notes that a query is executed.
    fn count(&self, what: Counted);
    /// Files found along the search path.
    fn disk(&self) -> &crate::disk::Disk;
    /// Where chunks begin at present.
    fn present(&self) -> &crate::layout::Present;
    /// The program is looked at once, and what is not needed any more is forgotten.
    fn recent(&self) -> Option<&Recent>;
}

/// The database.
#[salsa::db]
#[derive(Clone, Default)]
pub(crate) struct Database {
    storage: salsa::Storage<Self>,
    counters: Arc<Counters>,
    disk: Arc<crate::disk::Disk>,
    present: Arc<crate::layout::Present>,
    recent: Option<Arc<Recent>>,
}

#[salsa::db]
impl salsa::Database for Database {}

#[salsa::db]
impl Db for Database {
    fn count(&self, what: Counted) {
        self.counters.0[what as usize].fetch_add(1, Ordering::Relaxed);
    }
    fn disk(&self) -> &crate::disk::Disk {
        &self.disk
    }
    fn present(&self) -> &crate::layout::Present {
        &self.present
    }
    fn recent(&self) -> Option<&Recent> {
        self.recent.as_deref()
    }
}

impl Database {
    /// For files that are looked at once and never edited.
    pub(crate) fn once() -> Database {
        Database { recent: Some(Arc::default()), ..Database::default() }
    }
    pub(crate) fn executed(&self) -> Executed {
        self.counters.get()
    }
}

/// A chunk's text. Most chunks are never edited: they begin with high durability, and what depends on such chunks alone
/// is known to hold without a look at each of them.
#[salsa::input(debug)]
pub(crate) struct ChunkText {
    #[returns(ref)]
    pub(crate) text: gr_text::Text,
}

/// An open file.
#[salsa::input]
pub(crate) struct Document {
    /// Its chunks in order.
    #[returns(ref)]
    pub(crate) chunks: Arc<[ChunkText]>,
    /// What it is run with.
    #[returns(copy)]
    pub(crate) run: RunOptions,
    /// Number of the file in the session.
    #[returns(copy)]
    pub(crate) id: u32,
}

/// The files that are open, by [`crate::library::plain_path`].
#[salsa::input(singleton)]
pub(crate) struct OpenFiles {
    #[returns(ref)]
    pub(crate) files: Arc<BTreeMap<PathBuf, Document>>,
}

/// What programs are run with.
#[salsa::input]
pub(crate) struct RunOptions {
    /// Dialect, tools, parameters, INI file, budgets; and lint rules.
    #[returns(ref)]
    pub(crate) options: Arc<crate::Options>,
    /// Raised when files on disk may have changed.
    #[returns(copy)]
    pub(crate) disk_revision: u64,
}

/// Tables of a chunk.
pub(crate) fn scanned(db: &dyn Db, chunk: ChunkText, run: RunOptions) -> Arc<Scan> {
    match db.recent() {
        Some(recent) => recent.scan(chunk, || scan(db, chunk, run)),
        None => remembered_scan(db, chunk, run),
    }
}

#[salsa::tracked(returns(clone), no_eq)]
fn remembered_scan(db: &dyn Db, chunk: ChunkText, run: RunOptions) -> Arc<Scan> {
    scan(db, chunk, run)
}

fn scan(db: &dyn Db, chunk: ChunkText, run: RunOptions) -> Arc<Scan> {
    db.count(Counted::Scan);
    Arc::new(gr_gcode::scan(chunk.text(db), run.options(db).setup.dialect))
}

/// Tables that were made last, in a session that looks at a program once: the tables of a whole program need several
/// times as much memory as its text.
#[derive(Default)]
pub(crate) struct Recent(Mutex<VecDeque<(ChunkText, Arc<Scan>)>>);

/// Chunks whose tables are kept in such a session, at any place.
pub(crate) const MOST_RECENT: usize = 64;

impl Recent {
    fn scan(&self, chunk: ChunkText, make: impl FnOnce() -> Arc<Scan>) -> Arc<Scan> {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, scan)) = lock().iter().rev().find(|(c, _)| *c == chunk) {
            return scan.clone();
        }
        let scan = make();
        let mut kept = lock();
        if kept.len() == MOST_RECENT {
            kept.pop_front();
        }
        kept.push_back((chunk, scan.clone()));
        scan
    }
}

/// What a chunk holds that matters to more than itself.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Shape {
    /// Lines.
    pub(crate) lines: u32,
    /// Bytes.
    pub(crate) bytes: u32,
    /// Whether the first line that is not blank is `%`; none = all lines are blank.
    pub(crate) first_text: Option<bool>,
    /// The first line that is `%`.
    pub(crate) first_percent: Option<u32>,
    /// How blocks and subroutine definitions follow each other.
    pub(crate) outline: Box<[Outline]>,
    /// Has a line that could not be read.
    pub(crate) damaged: bool,
    /// Something that may send execution elsewhere: the chunk can't be run alone.
    pub(crate) control: bool,
    /// Reads or writes parameters or the tool table, or may.
    pub(crate) environment: bool,
    /// Labels of subroutines defined and called, and N numbers that jumps could go to.
    pub(crate) labels: Box<[Label]>,
    /// A label that is computed.
    pub(crate) computed: bool,
    /// Has a jump to an N number.
    pub(crate) jumps: bool,
    /// Lines that skipping must look at.
    pub(crate) stops: Box<[u32]>,
    /// Lines with M2 or M30.
    pub(crate) ends: Box<[u32]>,
    /// Lines that may begin or end subroutines, loops and branches.
    pub(crate) statements: Box<[gr_interp::Statement]>,
    /// The first line with a statement of control flow.
    pub(crate) first_control: Option<u32>,
    /// The first line that ends with a carriage return alone.
    pub(crate) lone_return: Option<u32>,
    /// Parameters by their names; none: only a run can tell which are read.
    pub(crate) parameters: Option<Parameters>,
}

/// Parameters of a chunk, ascending, each once.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Parameters {
    pub(crate) reads: Box<[Parameter]>,
    pub(crate) writes: Box<[Parameter]>,
}

impl Parameters {
    fn of(text: &str, scan: &Scan) -> Option<Parameters> {
        let symbols = gr_gcode::symbols(text, scan);
        let mut writes: Vec<Parameter> = symbols.writes.iter().map(|s| s.what.clone()).collect();
        writes.sort();
        writes.dedup();
        (!symbols.reads_dynamic).then(|| Parameters { reads: symbols.parameters_read().into(), writes: writes.into() })
    }
}

/// What a stretch of a chunk is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Outline {
    /// Blocks, one or many.
    Blocks,
    /// A subroutine definition begins.
    Sub,
    /// It ends.
    Endsub,
}

/// A label of a chunk.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Label {
    pub(crate) name: Box<str>,
    /// Line of the chunk.
    pub(crate) line: u32,
    pub(crate) kind: LabelKind,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum LabelKind {
    Sub,
    Call,
    /// A program begins (`O1000`).
    Program,
    Number,
}

/// Shape of a chunk. Most edits leave it as it is.
#[salsa::tracked(returns(ref))]
pub(crate) fn shape(db: &dyn Db, chunk: ChunkText, run: RunOptions) -> Shape {
    let scan = scanned(db, chunk, run);
    shape_of(&scan, chunk.text(db), &run.options(db).setup)
}

/// G-codes (times ten) that touch neither parameters nor the tool table.
const PURE_G: &[i64] = &[
    0, 10, 20, 30, 40, 170, 180, 190, 171, 181, 191, 200, 210, 400, 490, 610, 611, 640, 70, 80, 800, 810, 820, 830, 840, 850,
    860, 890, 730, 740, 900, 910, 901, 911, 930, 940, 950, 960, 970, 980, 990, 531, 50, 51,
];
/// M-codes that touch neither.
const PURE_M: &[i64] = &[0, 1, 3, 4, 5, 7, 8, 9, 48, 49, 50, 51, 52, 53];

/// Whether running these words needs parameters or the tool table.
fn word_is_pure(word: &gr_gcode::Word) -> bool {
    if word.form == Form::Bad {
        return true; // never carried out
    }
    match word.letter {
        b'g' => word.form == Form::Literal && PURE_G.contains(&((word.value * 10.0).round() as i64)),
        b'm' => word.form == Form::Literal && PURE_M.contains(&(word.value.round() as i64)),
        b'(' | b';' | b'#' | b'o' => false,
        _ => word.form == Form::Literal,
    }
}

/// Whether a comment does more than comment.
fn comment_acts(text: &str) -> bool {
    let text = text.trim_start_matches(['(', ';', ' ', '\t']);
    let word: String = text.chars().filter(|c| !c.is_whitespace()).take(9).collect::<String>().to_ascii_lowercase();
    ["print", "debug", "log", "abort", "py", "probe"].iter().any(|w| word.starts_with(w))
}

pub(crate) fn shape_of(scan: &Scan, text: &str, setup: &gr_interp::Setup) -> Shape {
    let dialect = setup.dialect;
    let mut shape = Shape { lines: scan.lines.len() as u32, bytes: text.len() as u32, damaged: !scan.faults.is_empty(), ..Shape::default() };
    let mut labels = Vec::new();
    let mut outline = Vec::new();
    // Names that begin with `_` may speak of the run itself: its line, its call depth.
    shape.control = scan.names.iter().any(|n| n.starts_with('_'));
    // A remapped code calls a subroutine, and a remapped motion does so wherever it is still active.
    shape.control |= !setup.ini.all("rs274ngc", "remap").is_empty();
    let macros = dialect.family == gr_spec::Family::Fanuc;
    for (n, line) in scan.lines.iter().enumerate() {
        let n = n as u32;
        if shape.first_text.is_none() && !text.get(scan.line_span(text, n).range()).unwrap_or("").trim().is_empty() {
            shape.first_text = Some(line.kind == LineKind::Percent);
        }
        if line.kind == LineKind::Percent && shape.first_percent.is_none() {
            shape.first_percent = Some(n);
        }
        if line.kind == LineKind::Blank && scan.words(n).is_empty() {
            continue;
        }
        let words = scan.words(n);
        let keyword = words.iter().find(|w| w.form == Form::Control).and_then(|w| scan.controls.get(w.index())).map(|c| c.keyword);
        let kind = match keyword {
            Some(Keyword::Sub) => Outline::Sub,
            Some(Keyword::Endsub) => Outline::Endsub,
            _ => Outline::Blocks,
        };
        if words.iter().any(|w| w.form != Form::Comment) && (kind != Outline::Blocks || outline.last() != Some(&kind)) {
            outline.push(kind);
        }
        for word in words {
            match word.letter {
                b'o' if word.form == Form::Control => {
                    shape.control = true;
                    shape.environment = true;
                    control_label(scan, n, word, &mut shape, &mut labels);
                }
                b'm' if word.form != Form::Literal || matches!(word.value as i64, 98 | 99) => {
                    shape.control = true;
                    if let Some(p) = scan.words(n).iter().find(|w| w.letter == b'p' && w.form == Form::Literal) {
                        let beside_l = scan.words(n).iter().any(|w| w.letter == b'l');
                        let number = match setup.dialect.family == gr_spec::Family::Fanuc && word.value as i64 == 98 {
                            true => gr_gcode::fanuc_call(p.value as i64, beside_l).0,
                            false => p.value as i64,
                        };
                        let name = number.to_string().into();
                        labels.push(Label { name, line: n, kind: LabelKind::Call });
                        shape.jumps |= word.value as i64 == 99;
                    }
                }
                // G70, G71 and G72 name their contour subroutine.
                b'q' if word.form == Form::Literal && words.iter().any(|w| w.letter == b'g' && (70.0..73.0).contains(&w.value)) => {
                    labels.push(Label { name: word.value.to_string().into(), line: n, kind: LabelKind::Call });
                }
                b'g' if macros && word.form == Form::Literal && matches!(word.value, 65.0 | 66.0) => {
                    shape.control = true;
                    if let Some(p) = words.iter().find(|w| w.letter == b'p' && w.form == Form::Literal) {
                        labels.push(Label { name: (p.value as i64).to_string().into(), line: n, kind: LabelKind::Call });
                    }
                }
                b'n' if macros && word.form == Form::Literal => {
                    labels.push(Label { name: word.value.to_string().into(), line: n, kind: LabelKind::Number });
                }
                b'g' if word.form != Form::Bad && (word.form != Form::Literal || (70.0..73.0).contains(&word.value)) => {
                    shape.control = true;
                }
                b'(' | b';' => {
                    let span = scan.word_span(text, n, word);
                    shape.environment |= comment_acts(text.get(span.range()).unwrap_or(""));
                }
                _ => {}
            }
            if !matches!(word.letter, b'(' | b';') && !word_is_pure(word) {
                shape.environment = true;
            }
        }
    }
    let named = shape.environment || shape.control;
    shape.parameters = if named { Parameters::of(text, scan) } else { Some(Parameters::default()) };
    shape.labels = labels.into();
    shape.outline = outline.into();
    crate::layout::line_shapes(&mut shape, scan, text);
    shape
}

fn control_label(scan: &Scan, line: u32, word: &gr_gcode::Word, shape: &mut Shape, labels: &mut Vec<Label>) {
    let Some(control) = scan.controls.get(word.index()) else { return };
    shape.jumps |= matches!(control.keyword, Keyword::MacroGoto | Keyword::MacroIfGoto);
    let name: Box<str> = match control.label {
        OLabel::Named(i) => scan.names.get(i as usize).cloned().unwrap_or_default(),
        OLabel::Number(id) => match scan.nodes.get(id.0 as usize) {
            Some(Node::Number(v)) => v.to_string().into(),
            _ => {
                shape.computed = true;
                return;
            }
        },
        OLabel::None => return,
    };
    let kind = match control.keyword {
        Keyword::Sub => LabelKind::Sub,
        Keyword::Call => LabelKind::Call,
        Keyword::Program => LabelKind::Program,
        _ => return,
    };
    labels.push(Label { name, line, kind });
}
