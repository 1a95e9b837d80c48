//! What the chunks of a file are to each other: where each begins, where control flow may go on, how the file as a
//! whole is built. Made anew when the shape of a chunk changes; what stretches with control flow ask of it
//! ([`follows`], [`next_stop`]) is remembered one by one, so that they are run again only when their own answers
//! change.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

use gr_canon::FileId;
use gr_gcode::{LineKind, Parameter};
use gr_spec::Family;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::db::{ChunkText, Db, Document, Outline, Shape, shape};
use crate::engine;
use crate::lints::Found;

/// A chunk in its file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Part {
    pub(crate) chunk: ChunkText,
    pub(crate) first_line: u32,
    /// Something may send execution elsewhere.
    pub(crate) control: bool,
    /// Reads or writes parameters or the tool table, or may.
    pub(crate) environment: bool,
}

/// A file as a row of chunks.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Layout {
    pub(crate) parts: Box<[Part]>,
    /// Where the chunks begin.
    pub(crate) starts: Arc<Starts>,
    /// Lines that skipping must look at.
    stops: Box<[u32]>,
    /// Lines with M2 or M30.
    pub(crate) ends: Box<[u32]>,
    /// The first line that is not blank is `%`.
    pub(crate) percent: bool,
    /// The first line that is `%`.
    first_percent: Option<u32>,
    /// The first line with a statement of control flow.
    pub(crate) first_control: Option<u32>,
    /// The first line that ends with a carriage return alone.
    pub(crate) lone_return: Option<u32>,
    /// What is opened and never closed.
    pub(crate) unclosed: Box<[Found]>,
    /// What the labels tell about each other.
    pub(crate) labels: Box<[Found]>,
    /// There are subroutines and nothing else.
    pub(crate) only_subs: bool,
    /// One of them is the one that other programs look for in a file of this name.
    pub(crate) own_sub: bool,
}

/// First line of each chunk, and after the last one the number of lines.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Starts {
    lines: Box<[u32]>,
    order: Arc<Order>,
}

/// How the chunks follow each other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Order {
    chunks: Arc<[ChunkText]>,
    index: FxHashMap<ChunkText, u32>,
}

impl PartialEq for Order {
    fn eq(&self, other: &Order) -> bool {
        self.chunks == other.chunks
    }
}

/// The order of a file's chunks: most edits leave it as it is.
#[salsa::tracked(returns(ref))]
fn order(db: &dyn Db, document: Document) -> Arc<Order> {
    let chunks = document.chunks(db).clone();
    Arc::new(Order { index: chunks.iter().zip(0..).map(|(c, i)| (*c, i)).collect(), chunks })
}

impl Deref for Starts {
    type Target = [u32];
    fn deref(&self) -> &[u32] {
        &self.lines
    }
}

impl Starts {
    /// Number of a chunk.
    pub(crate) fn index_of(&self, chunk: ChunkText) -> Option<usize> {
        self.order.index.get(&chunk).map(|i| *i as usize)
    }
    /// First line of a chunk.
    pub(crate) fn of(&self, chunk: ChunkText) -> Option<u32> {
        self.lines.get(self.index_of(chunk)?).copied()
    }
    /// The chunk that holds a line, and its first line.
    pub(crate) fn holding(&self, line: u32) -> Option<(ChunkText, u32)> {
        if line >= *self.lines.last()? {
            return None;
        }
        let at = self.lines.partition_point(|s| *s <= line).checked_sub(1)?;
        Some((*self.order.chunks.get(at)?, self.lines[at]))
    }
    /// A chunk begins on this line, or the file ends before it.
    pub(crate) fn begins(&self, line: u32) -> bool {
        self.lines.binary_search(&line).is_ok()
    }
}

/// Where the chunks of each file begin at present, beside salsa: for runs whose results move with their lines, so
/// that a line more above must not make them run again. [`layout`] writes it; who reads it has asked for the layout
/// before, or is asked by someone who has.
#[derive(Default, Debug)]
pub(crate) struct Present(Mutex<BTreeMap<u32, Arc<Starts>>>);

impl Present {
    fn set(&self, document: u32, starts: Arc<Starts>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(document, starts);
    }
    /// Of a file.
    pub(crate) fn get(&self, document: u32) -> Arc<Starts> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(&document).cloned().unwrap_or_default()
    }
}

/// The layout of a file.
#[salsa::tracked(returns(ref))]
pub(crate) fn layout(db: &dyn Db, document: Document) -> Layout {
    let run = document.run(db);
    let options = run.options(db);
    let main = FileId(document.id(db));
    let chunks = document.chunks(db);
    let shapes: Vec<&Shape> = chunks.iter().map(|c| shape(db, *c, run)).collect();
    let mut starts = Vec::with_capacity(chunks.len() + 1);
    let mut parts = Vec::with_capacity(chunks.len());
    let (mut stops, mut ends, mut statements) = (Vec::new(), Vec::new(), Vec::new());
    let mut first_line = 0;
    let (mut percent, mut first_percent, mut first_control, mut lone_return) = (None, None, None, None);
    for (chunk, s) in chunks.iter().zip(&shapes) {
        starts.push(first_line);
        parts.push(Part { chunk: *chunk, first_line, control: s.control, environment: s.environment });
        stops.extend(s.stops.iter().map(|l| l + first_line));
        ends.extend(s.ends.iter().map(|l| l + first_line));
        statements.extend(s.statements.iter().map(|s| s.shifted(first_line)));
        percent = percent.or(s.first_text);
        first_percent = first_percent.or(s.first_percent.map(|l| l + first_line));
        first_control = first_control.or(s.first_control.map(|l| l + first_line));
        lone_return = lone_return.or(s.lone_return.map(|l| l + first_line));
        first_line += s.lines;
    }
    starts.push(first_line);
    let mut labels = Vec::new();
    let path = db.disk().path(main).unwrap_or_default();
    let stem = crate::lints::called_as(&path);
    crate::lints::labels(&shapes, &starts, stem, options, &mut labels);
    labels.iter_mut().for_each(|f| f.place.file = main);
    let starts = Arc::new(Starts { lines: starts.into(), order: order(db, document).clone() });
    db.present().set(main.0, starts.clone());
    Layout {
        parts: parts.into(),
        starts,
        stops: stops.into(),
        ends: ends.into(),
        percent: percent.unwrap_or(false),
        first_percent,
        first_control,
        lone_return,
        unclosed: gr_interp::unclosed(statements, main, true).iter().filter_map(|f| engine::of_finding(f, options)).collect(),
        labels: labels.into(),
        only_subs: shapes.iter().flat_map(|s| s.outline.iter()).next() == Some(&Outline::Sub) && !crate::lints::has_main(&shapes),
        own_sub: crate::lints::holds_own_sub(&shapes, stem),
    }
}

/// First byte of each chunk, and after the last one their number. Edits change them all the time, and only places in
/// the text depend on them.
pub(crate) fn bytes(db: &dyn Db, document: Document) -> Vec<u32> {
    let run = document.run(db);
    let mut starts = vec![0];
    let mut at = 0;
    starts.extend(document.chunks(db).iter().map(|c| {
        at += shape(db, *c, run).bytes;
        at
    }));
    starts
}

/// The chunk behind a chunk.
#[salsa::tracked(returns(copy))]
pub(crate) fn follows(db: &dyn Db, document: Document, chunk: ChunkText) -> Option<ChunkText> {
    let order = order(db, document);
    order.chunks.get(*order.index.get(&chunk)? as usize + 1).copied()
}

/// First line of a chunk.
#[salsa::tracked(returns(copy))]
pub(crate) fn first_line(db: &dyn Db, document: Document, chunk: ChunkText) -> Option<u32> {
    layout(db, document).starts.of(chunk)
}

/// The first line behind a chunk that skipping must look at: its chunk, and its line there.
#[salsa::tracked(returns(copy))]
pub(crate) fn next_stop(db: &dyn Db, document: Document, chunk: ChunkText) -> Option<(ChunkText, u32)> {
    let Layout { starts, stops, .. } = layout(db, document);
    let behind = *starts.get(starts.index_of(chunk)? + 1)?;
    let line = *stops.get(stops.partition_point(|l| *l < behind))?;
    let (chunk, first_line) = starts.holding(line)?;
    Some((chunk, line - first_line))
}

/// Parameters that are set and that nothing in the file reads: the state between chunks may leave them out. Files that
/// it calls may read them.
#[salsa::tracked(returns(ref))]
pub(crate) fn unread(db: &dyn Db, document: Document) -> Box<[Parameter]> {
    let run = document.run(db);
    let setup = &run.options(db).setup;
    // Other controls have variables with a meaning of their own, and a remapped code reads what its words have set.
    if setup.dialect.family != Family::Linuxcnc || !setup.ini.all("rs274ngc", "remap").is_empty() {
        return Box::default();
    }
    let (mut reads, mut writes) = (FxHashSet::default(), BTreeSet::new());
    for chunk in document.chunks(db).iter() {
        let Some(parameters) = &shape(db, *chunk, run).parameters else { return Box::default() };
        reads.extend(&parameters.reads);
        writes.extend(&parameters.writes);
    }
    // A number is rounded when it is used, and may be written with decimals.
    let read = |p: &Parameter| match p {
        Parameter::Number(n) => (n.saturating_sub(1)..=n + 1).any(|n| reads.contains(&Parameter::Number(n))),
        Parameter::Named(_) => reads.contains(p),
    };
    let own = |p: &Parameter| match p {
        Parameter::Number(n) => (31..5000).contains(n),
        Parameter::Named(name) => !name.starts_with("_"),
    };
    writes.into_iter().filter(|p| own(p) && !read(p)).cloned().collect()
}

/// Line of the first `%`.
#[salsa::tracked(returns(copy))]
pub(crate) fn first_percent(db: &dyn Db, document: Document) -> Option<u32> {
    layout(db, document).first_percent
}

/// Byte of the first carriage return that ends a line by itself, with something behind it.
pub(crate) fn lone_return(text: &str) -> Option<u32> {
    let bytes = text.as_bytes();
    memchr::memchr_iter(b'\r', bytes).find(|at| bytes.get(at + 1).is_some_and(|next| *next != b'\n')).map(|at| at as u32)
}

/// Fills in what [`layout`] wants to know of a chunk's lines.
pub(crate) fn line_shapes(shape: &mut Shape, scan: &gr_gcode::Scan, text: &str) {
    let (mut stops, mut ends, mut statements) = (Vec::new(), Vec::new(), Vec::new());
    for (n, line) in scan.lines.iter().enumerate() {
        let n = n as u32;
        // Plain lines are most lines.
        let words = scan.words(n);
        if words.is_empty() && !line.faulty && line.kind != LineKind::Percent {
            continue;
        }
        if engine::ends_program(words) {
            ends.push(n);
        }
        if gr_interp::is_stop(scan, n) {
            stops.push(n);
            statements.extend(gr_interp::statement(scan, text, n));
        }
        if shape.first_control.is_none() && words.iter().any(|w| w.form == gr_gcode::Form::Control) {
            shape.first_control = Some(n);
        }
    }
    shape.lone_return = lone_return(text).map(|at| scan.lines.partition_point(|l| l.start <= at).saturating_sub(1) as u32);
    (shape.stops, shape.ends, shape.statements) = (stops.into(), ends.into(), statements.into());
}
