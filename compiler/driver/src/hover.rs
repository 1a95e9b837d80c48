//! What editors ask about a place in a file, as plain data: the state around a block, and the names of the file.

use std::sync::Arc;

use gr_canon::{Discard, FileId};
use gr_gcode::Symbols;
use gr_interp::Modal;

use crate::db::{ChunkText, Database, Db, Document, RunOptions, scanned};
use crate::engine;
use crate::layout::layout;
use crate::timeline::{nearest, timeline_to};

/// Modes and position around a block.
#[derive(Clone, Copy, Debug)]
pub struct StateAt {
    /// When execution comes to the block for the first time.
    pub before: Modal,
    /// After the block; the same as before when it is wrong.
    pub after: Modal,
}

/// Blocks that are run to find a line inside of control flow.
const MOST_BLOCKS: u32 = 2_000_000;

/// The state around a line. None: execution never comes there, or not soon enough.
pub(crate) fn state_at(db: &Database, document: Document, line: u32) -> Option<StateAt> {
    let run = document.run(db);
    let options = run.options(db);
    let timeline = timeline_to(db, document, line);
    let starts = &layout(db, document).starts;
    if line >= *starts.last()? {
        return None;
    }
    let at = starts.partition_point(|s| *s <= line).checked_sub(1)?;
    if let Some(known) = timeline.entries.get(at).copied().flatten()
        && !crate::db::shape(db, *document.chunks(db).get(at)?, run).control
    {
        let chunk = *document.chunks(db).get(at)?;
        let chunk = gr_gcode::Chunk { text: chunk.text(db).clone(), scan: scanned(db, chunk, run) };
        let (entry, env) = (known.entry.boundary(db), known.env.environment(db));
        return engine::around(&chunk, line - starts[at], entry, env, options);
    }
    // Inside of control flow: run from where it begins.
    let stretch = nearest(db, document, timeline, at)?;
    let main = FileId(document.id(db));
    let mut library = stretch.library();
    let mut interp = stretch.resume(&mut library, Discard);
    for _ in 0..MOST_BLOCKS {
        let here = interp.comes_to(main, line);
        let before = *interp.modal();
        let end = interp.step_block();
        if here {
            return Some(StateAt { before, after: *interp.modal() });
        }
        if end.is_some() {
            return None;
        }
    }
    None
}

/// Names of a chunk.
#[salsa::tracked(returns(clone), no_eq)]
fn names(db: &dyn Db, chunk: ChunkText, run: RunOptions) -> Arc<Symbols> {
    Arc::new(gr_gcode::symbols(chunk.text(db), &scanned(db, chunk, run)))
}

/// Names of a file: lines and bytes are those of the file.
pub(crate) fn symbols(db: &Database, document: Document) -> Symbols {
    let run = document.run(db);
    let mut all = Symbols::default();
    let (mut line, mut byte) = (0, 0);
    for chunk in document.chunks(db).iter() {
        let shape = crate::db::shape(db, *chunk, run);
        let part = names(db, *chunk, run);
        take(&mut all.line_numbers, &part.line_numbers, line, byte);
        take(&mut all.statements, &part.statements, line, byte);
        take(&mut all.reads, &part.reads, line, byte);
        take(&mut all.writes, &part.writes, line, byte);
        all.reads_dynamic |= part.reads_dynamic;
        all.writes_dynamic |= part.writes_dynamic;
        all.dynamic_codes |= part.dynamic_codes;
        all.g_codes.extend(&part.g_codes);
        all.m_codes.extend(&part.m_codes);
        (line, byte) = (line + shape.lines, byte + shape.bytes);
    }
    for codes in [&mut all.g_codes, &mut all.m_codes] {
        codes.sort_unstable();
        codes.dedup();
    }
    all
}

fn take<T: Clone>(all: &mut Vec<gr_gcode::Symbol<T>>, part: &[gr_gcode::Symbol<T>], line: u32, byte: u32) {
    all.extend(part.iter().map(|s| gr_gcode::Symbol { what: s.what.clone(), line: s.line + line, span: s.span.shifted(byte) }));
}
