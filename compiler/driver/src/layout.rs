//! What the chunks of a file are to each other: where each begins, where control flow may go on, how the file as a
//! whole is built. Made anew when the shape of a chunk changes; what stretches with control flow ask of it
//! ([`chunk_of`], [`next_stop`]) is remembered one by one, so that they are run again only when their own answers
//! change.

use gr_canon::FileId;
use gr_gcode::LineKind;

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
    /// First line of each chunk, and after the last one their number.
    pub(crate) starts: Box<[u32]>,
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
    /// What is opened and never closed.
    pub(crate) unclosed: Box<[Found]>,
    /// What the labels tell about each other.
    pub(crate) labels: Box<[Found]>,
    /// The file begins with a subroutine.
    pub(crate) only_subs: bool,
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
    let (mut percent, mut first_percent, mut first_control) = (None, None, None);
    for (chunk, s) in chunks.iter().zip(&shapes) {
        starts.push(first_line);
        parts.push(Part { chunk: *chunk, first_line, control: s.control, environment: s.environment });
        stops.extend(s.stops.iter().map(|l| l + first_line));
        ends.extend(s.ends.iter().map(|l| l + first_line));
        statements.extend(s.statements.iter().map(|s| s.shifted(first_line)));
        percent = percent.or(s.first_text);
        first_percent = first_percent.or(s.first_percent.map(|l| l + first_line));
        first_control = first_control.or(s.first_control.map(|l| l + first_line));
        first_line += s.lines;
    }
    starts.push(first_line);
    let mut labels = Vec::new();
    crate::lints::labels(&shapes, &starts, options, &mut labels);
    labels.iter_mut().for_each(|f| f.place.file = main);
    Layout {
        parts: parts.into(),
        starts: starts.into(),
        stops: stops.into(),
        ends: ends.into(),
        percent: percent.unwrap_or(false),
        first_percent,
        first_control,
        unclosed: gr_interp::unclosed(statements, main, true).iter().filter_map(|f| engine::of_finding(f, options)).collect(),
        labels: labels.into(),
        only_subs: shapes.iter().flat_map(|s| s.outline.iter()).next() == Some(&Outline::Sub),
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

/// The chunk that holds a line.
#[salsa::tracked(returns(copy))]
pub(crate) fn chunk_of(db: &dyn Db, document: Document, line: u32) -> Option<(ChunkText, u32)> {
    let layout = layout(db, document);
    if line >= *layout.starts.last()? {
        return None;
    }
    let at = layout.parts.partition_point(|p| p.first_line <= line).checked_sub(1)?;
    layout.parts.get(at).map(|p| (p.chunk, p.first_line))
}

/// The first line from `line` on that skipping must look at; `u32::MAX` past the last one.
#[salsa::tracked(returns(copy))]
pub(crate) fn next_stop(db: &dyn Db, document: Document, line: u32) -> u32 {
    let stops = &layout(db, document).stops;
    stops.get(stops.partition_point(|l| *l < line)).copied().unwrap_or(u32::MAX)
}

/// Line of the first `%`.
#[salsa::tracked(returns(copy))]
pub(crate) fn first_percent(db: &dyn Db, document: Document) -> Option<u32> {
    layout(db, document).first_percent
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
    (shape.stops, shape.ends, shape.statements) = (stops.into(), ends.into(), statements.into());
}
