//! One chunk alone: for programs without control flow, of which any part can be run from the state before it.


use gr_canon::Sink;
use gr_gcode::Chunk;
use rustc_hash::FxHashSet;

use crate::run::Flow;
use crate::{End, Finding, Interp, NoFiles, Params, Setup, State};

/// What running one chunk gave.
#[derive(Clone, Debug)]
pub struct ChunkExit {
    /// State after it.
    pub state: State,
    /// Parameters after it.
    pub params: Params,
    /// Numbered parameters that it read, with the values they had.
    pub reads: Vec<(u32, f64)>,
    /// Numbered parameters that it set, in order.
    pub writes: Vec<(u32, f64)>,
    /// It read or set named parameters, or did something else that the state does not hold.
    pub open_ended: bool,
    /// Faults and doubts.
    pub findings: Vec<Finding>,
    /// How it ended.
    pub end: End,
    /// Blocks executed.
    pub blocks: u64,
    /// Canonical calls.
    pub calls: u64,
}

/// Which parameters were read and written.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    reads: Vec<(u32, f64)>,
    read: FxHashSet<u32>,
    written: FxHashSet<u32>,
    writes: Vec<(u32, f64)>,
    pub named: bool,
    before: Params,
}

impl Log {
    pub fn read(&mut self, index: u32) {
        if !self.written.contains(&index) && self.read.insert(index) {
            self.reads.push((index, self.before.get(index)));
        }
    }
    pub fn write(&mut self, index: u32, value: f64) {
        self.written.insert(index);
        self.writes.push((index, value));
    }
}

/// Runs one chunk that holds no control flow from a given state. Lines of calls and findings are relative to
/// the chunk. Budgets count within the chunk.
pub fn run_chunk<S: Sink>(chunk: &Chunk, state: &State, params: &Params, setup: &Setup, sink: S) -> ChunkExit {
    let lines = 0..chunk.scan.lines.len() as u32;
    run_lines(chunk, lines, state, params, setup, sink)
}

/// Runs some lines of such a chunk.
pub fn run_lines<S: Sink>(
    chunk: &Chunk,
    lines: std::ops::Range<u32>,
    state: &State,
    params: &Params,
    setup: &Setup,
    sink: S,
) -> ChunkExit {
    let mut files = NoFiles::default();
    let mut run = Interp::with(&mut files, setup, sink, state.clone(), params.clone());
    run.log = Some(Box::new(Log { before: params.clone(), ..Log::default() }));
    run.reading.text = chunk.text.clone();
    run.reading.scan = chunk.scan.clone();
    let mut end = End::Chunk;
    for line in lines.start..lines.end.min(chunk.scan.lines.len() as u32) {
        run.next = line + 1;
        run.place.line = line;
        if let Err(fault) = run.line(&chunk.scan, &chunk.text, line) {
            if run.fails(fault) {
                end = End::Fault;
                break;
            }
        }
        if let Flow::End(why) = run.flow {
            end = why;
            break;
        }
    }
    let log = run.log.take().unwrap_or_default();
    ChunkExit {
        end,
        reads: log.reads,
        writes: log.writes,
        open_ended: log.named,
        blocks: run.blocks,
        calls: run.emitted,
        findings: std::mem::take(&mut run.findings),
        state: run.state(),
        params: run.params,
    }
}
