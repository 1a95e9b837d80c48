//! A file put together from its chunks: which state each chunk begins in, and everything that was found.
//!
//! A chunk without control flow is interpreted on its own ([`step`]), and the result is remembered for the
//! chunk, the state it is entered in and, if it touches them, the parameters. Most edits leave the state after
//! the chunk as it was, and then nothing below is done again. From the first chunk with control flow on, the
//! program is run as a whole ([`flow`]).

use std::sync::Arc;

use gr_canon::{CallFrame, FrameId};

use crate::db::{ChunkText, Counted, Db, Document, RunOptions, Shape, scanned, shape};
use crate::engine::{self, Boundary, End, Environment};
use crate::lints::{Cuts, Found, From, Summary, Where};

/// State between two chunks.
#[salsa::interned(debug)]
pub(crate) struct Entry<'db> {
    #[returns(ref)]
    pub(crate) boundary: Boundary,
}

/// Parameters and tool table between two chunks.
#[salsa::interned(debug)]
pub(crate) struct Env<'db> {
    #[returns(ref)]
    pub(crate) environment: Environment,
}

/// What interpreting a chunk gives.
#[derive(Clone, PartialEq, Debug, salsa::SalsaValue)]
pub(crate) struct Step<'db> {
    /// State after it.
    pub(crate) exit: Entry<'db>,
    /// Parameters and tools after it, when it may have changed them.
    pub(crate) env: Option<Env<'db>>,
    /// Lines relative to the chunk.
    #[salsa_value(unsafe(prove(Arc<[Found]>: 'static)))]
    pub(crate) found: Arc<[Found]>,
    #[salsa_value(unsafe(prove(Summary: 'static)))]
    pub(crate) summary: Summary,
    #[salsa_value(unsafe(prove(Option<End>: 'static)))]
    pub(crate) end: Option<End>,
    /// An M2 or M30 that did not end the program because its block has a mistake.
    #[salsa_value(unsafe(prove(Option<End>: 'static)))]
    pub(crate) tried: Option<End>,
    /// Parameters were touched although none were given.
    pub(crate) impure: bool,
}

/// Interprets a chunk that has no control flow.
#[salsa::tracked(returns(ref), no_eq)]
pub(crate) fn step<'db>(
    db: &'db dyn Db,
    chunk: ChunkText,
    run: RunOptions,
    entry: Entry<'db>,
    env: Option<Env<'db>>,
) -> Step<'db> {
    db.count(Counted::Step);
    let text = gr_gcode::Chunk { text: chunk.text(db).clone(), scan: scanned(db, chunk, run) };
    let outcome = engine::step(&text, entry.boundary(db), env.map(|e| e.environment(db)), run.options(db));
    Step {
        exit: Entry::new(db, outcome.boundary),
        env: outcome.environment.map(|e| Env::new(db, e)),
        found: outcome.found.into(),
        summary: outcome.summary,
        end: outcome.end,
        tried: outcome.tried,
        impure: outcome.impure,
    }
}

/// What running a stretch with control flow gives.
#[derive(Clone, PartialEq, Debug, salsa::SalsaValue)]
pub(crate) struct Flow<'db> {
    /// Lines relative to their files.
    #[salsa_value(unsafe(prove(Arc<[Found]>: 'static)))]
    pub(crate) found: Arc<[Found]>,
    /// The call tree that the findings point into.
    #[salsa_value(unsafe(prove(Arc<[(FrameId, CallFrame)]>: 'static)))]
    pub(crate) frames: Arc<[(FrameId, CallFrame)]>,
    #[salsa_value(unsafe(prove(Summary: 'static)))]
    pub(crate) summary: Summary,
    #[salsa_value(unsafe(prove(Option<End>: 'static)))]
    pub(crate) end: Option<End>,
    /// State at the end.
    pub(crate) exit: Entry<'db>,
}

/// Runs the program from the start of a chunk to its end.
#[salsa::tracked(returns(ref), no_eq)]
pub(crate) fn flow<'db>(db: &'db dyn Db, document: Document, chunk: u32, entry: Entry<'db>, env: Env<'db>) -> Flow<'db> {
    db.count(Counted::Flow);
    let run = document.run(db);
    let _ = run.disk_revision(db);
    let options = run.options(db);
    let chunks = document.chunks(db);
    let file = whole(db, document);
    let (mut line, mut shift) = (0, None);
    for (i, c) in chunks.iter().enumerate() {
        if i == chunk as usize {
            break;
        }
        line += shape(db, *c, run).lines;
    }
    if entry.boundary(db).modal().percent != 0 {
        let mut first = 0;
        for c in chunks.iter() {
            shift = shift.or_else(|| Some(first + shape(db, *c, run).first_percent?));
            first += shape(db, *c, run).lines;
        }
    }
    let stretch = engine::Stretch {
        db,
        main: gr_canon::FileId(document.id(db)),
        file,
        line,
        shift: shift.unwrap_or(0),
        entry: entry.boundary(db),
        env: env.environment(db),
        options,
    };
    let outcome = engine::flow(&stretch);
    Flow {
        found: outcome.found.into(),
        frames: outcome.frames.into(),
        summary: outcome.summary,
        end: outcome.end,
        exit: Entry::new(db, outcome.boundary),
    }
}

/// The whole file with its tables.
pub(crate) fn whole(db: &dyn Db, document: Document) -> Arc<gr_gcode::File> {
    let run = document.run(db);
    let chunks = document.chunks(db).iter().map(|c| gr_gcode::Chunk { text: c.text(db).clone(), scan: scanned(db, *c, run) });
    let path = db.disk().path(gr_canon::FileId(document.id(db))).unwrap_or_default();
    Arc::new(gr_gcode::File::new(&path, chunks.collect()))
}

/// State before the first block.
#[salsa::tracked(returns(copy))]
fn start(db: &dyn Db, run: RunOptions, percent: bool) -> (Entry<'_>, Env<'_>) {
    let (boundary, environment) = engine::start(run.options(db), percent);
    (Entry::new(db, boundary), Env::new(db, environment))
}

/// A stretch of findings whose lines count from `first_line`.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Group {
    pub(crate) first_line: u32,
    pub(crate) found: Arc<[Found]>,
    /// Call tree, when the stretch was run with control flow.
    pub(crate) frames: Option<Arc<[(FrameId, CallFrame)]>>,
}

/// A file put together.
#[derive(Clone, PartialEq, Debug, salsa::SalsaValue)]
pub(crate) struct Timeline<'db> {
    /// First line and first byte of each chunk, and after the last one the totals.
    #[salsa_value(unsafe(prove(Box<[(u32, u32)]>: 'static)))]
    pub(crate) starts: Box<[(u32, u32)]>,
    /// State in which a chunk is entered; none = not known (inside control flow, after the end, not computed).
    #[salsa_value(unsafe(prove(Entry<'db>: salsa::SalsaValue)))]
    pub(crate) entries: Vec<Option<(Entry<'db>, Env<'db>)>>,
    #[salsa_value(unsafe(prove(Vec<Group>: 'static)))]
    pub(crate) groups: Vec<Group>,
    /// How and on which line the program ended.
    #[salsa_value(unsafe(prove(Option<End>: 'static)))]
    pub(crate) end: Option<End>,
    /// Whether every chunk was looked at.
    pub(crate) complete: bool,
}

/// The whole file.
#[salsa::tracked(returns(ref), no_eq)]
pub(crate) fn timeline<'db>(db: &'db dyn Db, document: Document) -> Timeline<'db> {
    db.count(Counted::Timeline);
    fold(db, document, u32::MAX)
}

/// The file up to the chunk that holds a line.
#[salsa::tracked(returns(ref), no_eq, lru = 8)]
pub(crate) fn timeline_to<'db>(db: &'db dyn Db, document: Document, line: u32) -> Timeline<'db> {
    fold(db, document, line)
}

/// What is carried along for lints that compare distant parts.
#[derive(Default)]
pub(crate) struct Late {
    cuts: Cuts,
    bare_cut: Option<Where>,
    pub(crate) found: Vec<Found>,
}

impl Late {
    pub(crate) fn take(&mut self, summary: &Summary, first_line: u32, rules: &crate::Rules) {
        for dive in &summary.dives {
            if let Some(mut found) = dive.judge(&self.cuts, rules) {
                found.place.line = found.place.line.wrapping_add(first_line);
                self.found.push(found);
            }
        }
        self.cuts = if summary.new_frame { summary.cuts } else { self.cuts.join(&summary.cuts) };
        if let Some(mut place) = summary.bare_cut {
            place.line = place.line.wrapping_add(first_line);
            self.bare_cut = Some(place);
        }
        if summary.spindle_starts
            && let Some(place) = self.bare_cut.take()
        {
            self.found.extend(crate::lints::stopped_at(place, rules));
        }
    }
}

/// Findings of the interpreter after which it gives up, as the controller does when it is told to go on.
const GIVE_UP: usize = 100;

/// Cuts everything behind the fault at which the interpreter gives up, and says on which line that is. The
/// interpreter counts within the stretch that it runs; here the whole file counts.
fn too_many(groups: &mut Vec<Group>) -> Option<u32> {
    if groups.iter().map(|g| g.found.len()).sum::<usize>() < GIVE_UP {
        return None;
    }
    let mut count = 0;
    for g in 0..groups.len() {
        for (at, found) in groups[g].found.iter().enumerate() {
            count += usize::from(found.from != From::Lint);
            if count >= GIVE_UP && found.from == From::Fault {
                let line = found.place.line.wrapping_add(groups[g].first_line);
                // Lints of a stretch with control flow come behind its findings.
                let keep = |(i, f): &(usize, &Found)| *i <= at || (f.from == From::Lint && f.place.line <= found.place.line);
                let kept: Vec<Found> = groups[g].found.iter().enumerate().filter(keep).map(|(_, f)| f.clone()).collect();
                groups[g].found = kept.into();
                groups.truncate(g + 1);
                return Some(line);
            }
        }
    }
    None
}

fn fold<'db>(db: &'db dyn Db, document: Document, last_line: u32) -> Timeline<'db> {
    let run = document.run(db);
    let options = run.options(db);
    let chunks = document.chunks(db);
    let shapes: Vec<&Shape> = chunks.iter().map(|c| shape(db, *c, run)).collect();
    let mut starts = Vec::with_capacity(chunks.len() + 1);
    let (mut line, mut byte) = (0u32, 0u32);
    for s in &shapes {
        starts.push((line, byte));
        (line, byte) = (line + s.lines, byte + s.bytes);
    }
    starts.push((line, byte));
    let mut entries = vec![None; chunks.len()];
    let (mut groups, mut late, mut end, mut tried) = (Vec::new(), Late::default(), None, None);
    let percent = shapes.iter().find_map(|s| s.first_text).unwrap_or(false);
    let (mut entry, mut env) = start(db, run, percent);
    let mut at = 0;
    while at < chunks.len() && end.is_none() && starts[at].0 <= last_line {
        entries[at] = Some((entry, env));
        if shapes[at].control {
            let flow = flow(db, document, at as u32, entry, env);
            late.take(&flow.summary, 0, &options.rules);
            if !flow.found.is_empty() {
                groups.push(Group { first_line: 0, found: flow.found.clone(), frames: Some(flow.frames.clone()) });
            }
            end = flow.end;
            entry = flow.exit;
            at = chunks.len();
        } else {
            let touched = shapes[at].environment.then_some(env);
            let mut outcome = step(db, chunks[at], run, entry, touched);
            if outcome.impure {
                outcome = step(db, chunks[at], run, entry, Some(env));
            }
            let step = outcome;
            let first_line = starts[at].0;
            late.take(&step.summary, first_line, &options.rules);
            if !step.found.is_empty() {
                groups.push(Group { first_line, found: step.found.clone(), frames: None });
            }
            end = step.end.map(|e| e.shifted(first_line));
            tried = tried.or(step.tried.map(|e| e.shifted(first_line)));
            entry = step.exit;
            env = step.env.unwrap_or(env);
            at += 1;
        }
    }
    if let Some(line) = too_many(&mut groups) {
        end = Some(End { line, stopped: true, program: false });
    }
    let complete = at >= chunks.len() || end.is_some();
    // The program has its end, even if a mistake keeps the controller from it.
    let end = match end {
        None => tried.filter(|_| complete),
        Some(e) if e.stopped && e.program => tried.or(end),
        _ => end,
    };
    if complete {
        let context = engine::Finish { shapes: &shapes, starts: &starts, options, modal: entry.boundary(db).modal(), end };
        late.found.extend(engine::finish(&context));
    }
    if groups.iter().any(|g: &Group| g.found.iter().any(|f| f.code.def().severity == gr_spec::Severity::Error)) {
        // After an error the rest is not to be trusted: what is still on at the end says nothing.
        let left_on = [gr_spec::code::END_SPINDLE_ON, gr_spec::code::END_COMPENSATION_ON];
        late.found.retain(|f| !left_on.contains(&f.code));
        for group in &mut groups {
            if group.found.iter().any(|f| left_on.contains(&f.code)) {
                group.found = group.found.iter().filter(|f| !left_on.contains(&f.code)).cloned().collect();
            }
        }
    }
    if !late.found.is_empty() {
        groups.push(Group { first_line: 0, found: late.found.into(), frames: None });
    }
    Timeline { starts: starts.into(), entries, groups, end, complete }
}
