//! A file put together from its chunks: which state each chunk begins in, and everything that was found.
//!
//! A chunk without control flow is interpreted on its own ([`step`]), and the result is remembered for the
//! chunk, the state it is entered in and, if it touches them, the parameters. From a chunk with control flow on the
//! program is run ([`flow`]) until it is outside of calls and loops at the start of a chunk again; that is remembered
//! for the chunk, the state, the parameters and what control flow has left behind, and depends on the chunks that
//! execution came to, not on where they stand. Most edits leave the state after the chunk as it was, and then nothing below is done again.

use std::sync::Arc;

use gr_canon::{CallFrame, FileId, FrameId};
use gr_spec::{Severity, code};

use crate::carried::{Carried, Moved};
use crate::db::{ChunkText, Counted, Db, Document, RunOptions, scanned};
use crate::engine::{self, Boundary, End, Environment, Stretch};
use crate::layout::{Layout, Part, layout};
use crate::library::Came;
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

/// What control flow has left behind between two chunks.
#[salsa::interned(debug)]
pub(crate) struct Labels<'db> {
    #[returns(ref)]
    pub(crate) carried: Carried,
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
        impure: outcome.impure,
    }
}

/// What running a stretch with control flow gives.
#[derive(Clone, PartialEq, Debug, salsa::SalsaValue)]
pub(crate) struct Flow<'db> {
    /// Lines, here and below, are those of the file when it was run: see [`Moved`].
    #[salsa_value(unsafe(prove(Arc<[Found]>: 'static)))]
    pub(crate) found: Arc<[Found]>,
    /// The call tree that the findings point into.
    #[salsa_value(unsafe(prove(Frames: 'static)))]
    pub(crate) frames: Frames,
    #[salsa_value(unsafe(prove(Summary: 'static)))]
    pub(crate) summary: Summary,
    #[salsa_value(unsafe(prove(Option<End>: 'static)))]
    pub(crate) end: Option<End>,
    /// What comes behind it.
    pub(crate) exit: Known<'db>,
    /// First line behind it, which begins a chunk; none = the program ended.
    pub(crate) next: Option<u32>,
    /// The chunks that execution came to.
    #[salsa_value(unsafe(prove(Box<[Came]>: 'static)))]
    pub(crate) came: Box<[Came]>,
    /// What is opened and never closed in the other files that were opened.
    #[salsa_value(unsafe(prove(Box<[(FileId, Vec<Found>)]>: 'static)))]
    pub(crate) unclosed: Box<[(FileId, Vec<Found>)]>,
}

/// A call tree.
pub(crate) type Frames = Arc<[(FrameId, CallFrame)]>;

/// Runs the program from a chunk on until it is at rest at the start of another one. Only for those who have asked for
/// the layout: where the chunks begin at present is not the query's business.
#[salsa::tracked(returns(ref), no_eq)]
fn flow<'db>(
    db: &'db dyn Db,
    document: Document,
    chunk: ChunkText,
    entry: Entry<'db>,
    env: Env<'db>,
    labels: Labels<'db>,
) -> Flow<'db> {
    db.count(Counted::Flow);
    // Subroutine files are read again when they may have changed.
    let _ = document.run(db).disk_revision(db);
    let outcome = engine::flow(&Known { entry, env, labels }.stretch(db, document, chunk));
    Flow {
        found: outcome.found.into(),
        frames: outcome.frames.into(),
        summary: outcome.summary,
        end: outcome.end,
        exit: Known {
            entry: Entry::new(db, outcome.boundary),
            env: Env::new(db, outcome.environment),
            labels: Labels::new(db, outcome.carried),
        },
        next: outcome.next,
        came: outcome.came,
        unclosed: outcome.unclosed.into(),
    }
}

/// All that is known where a chunk begins.
#[derive(Clone, Copy, PartialEq, Eq, Debug, salsa::SalsaValue)]
pub(crate) struct Known<'db> {
    pub(crate) entry: Entry<'db>,
    pub(crate) env: Env<'db>,
    pub(crate) labels: Labels<'db>,
}

impl<'db> Known<'db> {
    /// A run that goes on from here.
    fn stretch(self, db: &'db dyn Db, document: Document, chunk: ChunkText) -> Stretch<'db> {
        let (env, carried) = (self.env.environment(db), self.labels.carried(db));
        Stretch { db, document, chunk, entry: self.entry.boundary(db), env, carried }
    }
}

/// State before the first block.
#[salsa::tracked(returns(copy))]
fn start(db: &dyn Db, run: RunOptions, percent: bool) -> Known<'_> {
    let (boundary, environment) = engine::start(run.options(db), percent);
    Known { entry: Entry::new(db, boundary), env: Env::new(db, environment), labels: Labels::new(db, Carried::default()) }
}

/// A stretch of findings whose lines count from `first_line`.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Group {
    pub(crate) first_line: u32,
    pub(crate) found: Arc<[Found]>,
    /// Call tree, when the stretch was run with control flow.
    pub(crate) frames: Option<Frames>,
}

/// A file put together.
#[derive(Clone, PartialEq, Debug, salsa::SalsaValue)]
pub(crate) struct Timeline<'db> {
    /// State in which a chunk is entered; none = not known (inside control flow, after the end, not computed).
    pub(crate) entries: Vec<Option<Known<'db>>>,
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

/// The run that goes on from the nearest known state before a chunk.
pub(crate) fn nearest<'db>(db: &'db dyn Db, document: Document, timeline: &Timeline<'db>, chunk: usize) -> Option<Stretch<'db>> {
    let (at, known) = timeline.entries.get(..=chunk)?.iter().enumerate().rev().find_map(|(i, k)| Some((i, (*k)?)))?;
    Some(known.stretch(db, document, layout(db, document).parts.get(at)?.chunk))
}

/// What is carried along for lints that compare distant parts.
#[derive(Default)]
pub(crate) struct Late {
    cuts: Cuts,
    bare_cut: Option<Where>,
    pub(crate) found: Vec<Found>,
}

impl Late {
    /// Takes what a stretch has left. `base`: a chunk was run alone, and these are its file and first line.
    pub(crate) fn take(&mut self, summary: &Summary, base: Option<(FileId, u32)>, rules: &crate::Rules) {
        let real = |place: Where| match base {
            Some((file, first)) => Where { file, line: place.line.wrapping_add(first), ..place },
            None => place,
        };
        for dive in &summary.dives {
            if let Some(mut found) = dive.judge(&self.cuts, rules) {
                found.place = real(found.place);
                self.found.push(found);
            }
        }
        self.cuts = if summary.new_frame { summary.cuts } else { self.cuts.join(&summary.cuts) };
        if let Some(place) = summary.bare_cut {
            self.bare_cut = Some(real(place));
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

/// The main file's statements of control flow make faults of these kinds over and over once an error has made the
/// controller forget all labels: the rest of a loop or branch is then without its beginning.
const CONSEQUENCES: [gr_spec::Code; 2] = [code::FLOW_LABEL, code::FLOW_UNCLOSED];

/// Whether a finding in the main file or another one is an error after which labels are forgotten that were there.
fn forgets(found: &Found, line: u32, own: bool, first_control: u32) -> bool {
    let ended = found.code == code::PROGRAM_ENDS_EARLY;
    found.from == From::Fault && !ended && (!own || line >= first_control)
}

/// Drops what is the same mistake once more; returns whether labels were forgotten.
fn drop_consequences(groups: &mut [Group], main: FileId, first_control: u32) -> bool {
    let mut after_error = false;
    for group in groups {
        let own = |f: &Found| group.frames.is_none() || f.place.file == main;
        let dropped = |f: &Found, after: bool| after && f.from != From::Lint && CONSEQUENCES.contains(&f.code);
        let mut kept = Vec::new();
        for f in group.found.iter() {
            if !dropped(f, after_error) {
                kept.push(f);
            }
            after_error |= forgets(f, f.place.line.wrapping_add(group.first_line), own(f), first_control);
        }
        if kept.len() < group.found.len() {
            group.found = kept.into_iter().cloned().collect();
        }
    }
    after_error
}

/// Line of an M2 or M30 that could not end the program: something before it is not closed, or that block itself
/// has a mistake.
fn unreached_end(layout: &Layout, groups: &[Group], unclosed: &[Found], main: FileId) -> Option<u32> {
    let faulty = |line: u32| {
        groups.iter().any(|g| {
            let own = |f: &Found| g.frames.is_none() || f.place.file == main;
            g.found.iter().any(|f| f.from == From::Fault && own(f) && f.place.line.wrapping_add(g.first_line) == line)
        })
    };
    let open = |line: u32| unclosed.iter().any(|f| f.place.file == main && f.place.line < line);
    layout.ends.iter().copied().find(|line| open(*line) || faulty(*line))
}

/// A file while it is being put together.
struct Fold<'db> {
    groups: Vec<Group>,
    /// Findings in them.
    spoken: usize,
    late: Late,
    end: Option<End>,
    /// Unclosed statements of the other files that were opened.
    others: Vec<(FileId, Vec<Found>)>,
    known: Known<'db>,
    entries: Vec<Option<Known<'db>>>,
}

fn fold<'db>(db: &'db dyn Db, document: Document, last_line: u32) -> Timeline<'db> {
    let run = document.run(db);
    let options = run.options(db);
    let main = FileId(document.id(db));
    let layout = layout(db, document);
    let parts = &layout.parts;
    let mut fold = Fold {
        groups: Vec::new(),
        spoken: 0,
        late: Late::default(),
        end: None,
        others: Vec::new(),
        known: start(db, run, layout.percent),
        entries: vec![None; parts.len()],
    };
    let mut at = 0;
    while at < parts.len() && fold.end.is_none() && parts[at].first_line <= last_line {
        fold.entries[at] = Some(fold.known);
        if parts[at].control {
            let next = fold.flow(db, document, layout, &parts[at]);
            at = next.map_or(parts.len(), |line| parts.partition_point(|p| p.first_line < line));
        } else {
            fold.step(db, document, &parts[at]);
            at += 1;
        }
        if fold.spoken >= GIVE_UP
            && let Some(line) = too_many(&mut fold.groups)
        {
            fold.end = Some(End { line, stopped: true, program: false });
        }
    }
    let Fold { mut groups, mut late, mut end, others, known, entries, .. } = fold;
    let complete = at >= parts.len() || end.is_some();
    let after_error = drop_consequences(&mut groups, main, layout.first_control.unwrap_or(0));
    if complete {
        let others = others.into_iter().flat_map(|(_, found)| found);
        let mut unclosed: Vec<Found> = layout.unclosed.iter().cloned().chain(others).collect();
        // What stands behind the end is not looked at.
        unclosed.retain(|f| !after_error && (f.place.file != main || end.is_none_or(|e| f.place.line <= e.line)));
        if end.is_none() {
            let last = layout.ends.last();
            let before_end = |f: &&mut Found| f.place.file == main && last.is_some_and(|l| f.place.line < *l);
            unclosed.iter_mut().filter(before_end).for_each(|f| f.severity = Severity::Error);
            // The program has its end, even if a mistake keeps the controller from it.
            let unreached = unreached_end(layout, &groups, &unclosed, main);
            end = unreached.map(|line| End { line, stopped: true, program: true });
        }
        if !unclosed.is_empty() {
            groups.push(Group { first_line: 0, found: unclosed.into(), frames: Some(Arc::default()) });
        }
        let modal = known.entry.boundary(db).modal();
        late.found.extend(engine::finish(&engine::Finish { layout, main, options, modal, end }));
    }
    if groups.iter().any(|g: &Group| g.found.iter().any(|f| f.code.def().severity == Severity::Error)) {
        // After an error the rest is not to be trusted: what is still on at the end says nothing.
        let left_on = [code::END_SPINDLE_ON, code::END_COMPENSATION_ON];
        late.found.retain(|f| !left_on.contains(&f.code));
        for group in &mut groups {
            if group.found.iter().any(|f| left_on.contains(&f.code)) {
                group.found = group.found.iter().filter(|f| !left_on.contains(&f.code)).cloned().collect();
            }
        }
    }
    if !late.found.is_empty() {
        groups.push(Group { first_line: 0, found: late.found.into(), frames: Some(Arc::default()) });
    }
    Timeline { entries, groups, end, complete }
}

impl<'db> Fold<'db> {
    /// Adds a chunk without control flow.
    fn step(&mut self, db: &'db dyn Db, document: Document, part: &Part) {
        let run = document.run(db);
        let Known { entry, env, labels } = self.known;
        let mut step = step(db, part.chunk, run, entry, part.environment.then_some(env));
        if step.impure {
            step = self::step(db, part.chunk, run, entry, Some(env));
        }
        let first_line = part.first_line;
        self.late.take(&step.summary, Some((FileId(document.id(db)), first_line)), &run.options(db).rules);
        let mut labels = labels;
        if !step.found.is_empty() {
            self.spoken += step.found.len();
            self.groups.push(Group { first_line, found: step.found.clone(), frames: None });
            if step.found.iter().any(|f| f.from == From::Fault) {
                labels = Labels::new(db, labels.carried(db).without_labels());
            }
        }
        self.end = step.end.map(|e| e.shifted(first_line));
        self.known = Known { entry: step.exit, env: step.env.unwrap_or(env), labels };
    }

    /// Adds a stretch with control flow; returns the first line behind it.
    fn flow(&mut self, db: &'db dyn Db, document: Document, layout: &Layout, part: &Part) -> Option<u32> {
        let Known { entry, env, labels } = self.known;
        let flow = flow(db, document, part.chunk, entry, env, labels);
        let moved = Moved::new(&flow.came, &layout.starts, FileId(document.id(db)), part.chunk);
        let moved = moved.as_ref();
        let summary = moved.map(|m| m.summary(&flow.summary));
        self.late.take(summary.as_ref().unwrap_or(&flow.summary), None, &document.run(db).options(db).rules);
        if !flow.found.is_empty() {
            self.spoken += flow.found.len();
            let found = moved.map_or_else(|| flow.found.clone(), |m| m.found(&flow.found).into());
            let frames = moved.map_or_else(|| flow.frames.clone(), |m| m.frames(&flow.frames).into());
            self.groups.push(Group { first_line: 0, found, frames: Some(frames) });
        }
        for (file, found) in &flow.unclosed {
            if !self.others.iter().any(|(f, _)| f == file) {
                self.others.push((*file, found.clone()));
            }
        }
        self.end = flow.end.map(|end| moved.map_or(end, |m| m.end(end)));
        self.known = flow.exit;
        flow.next.map(|line| moved.map_or(line, |m| m.behind(line)))
    }
}
