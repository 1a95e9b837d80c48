//! A file put together from its chunks: which state each chunk begins in, and everything that was found.
//!
//! A chunk without control flow is interpreted on its own ([`step`]), and the result is remembered for the
//! chunk, the state it is entered in and, if it touches them, the parameters. From a chunk with control flow on the
//! program is run ([`flow`]) until it is outside of calls and loops at the start of a chunk again; that is remembered
//! for the chunk, the state, the parameters and what control flow has left behind, and depends on the chunks that
//! execution came to, not on where they stand. Parameters that nothing in the file reads are left out. Most edits leave
//! the state after the chunk as it was, and then nothing below is done again.
//!
//! For a check that nobody will ask for again the same run goes through the file and remembers nothing ([`told_once`]).

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use gr_canon::{CallFrame, FileId, FrameId};
use gr_gcode::Parameter;
use gr_interp::Modal;
use gr_spec::{Code, Severity, code};

use crate::carried::{Carried, Moved};
use crate::check::{Key, MOST_OF_A_KIND, Unlisted, key};
use crate::db::{ChunkText, Counted, Db, Document, RunOptions, scanned};
use crate::engine::{self, Boundary, End, Environment, Stretch};
use crate::layout::{Layout, Part, layout, unread};
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
    #[salsa_value(unsafe(prove(Story: 'static)))]
    pub(crate) story: Story,
}

/// What was found in a file.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Story {
    pub(crate) groups: Vec<Group>,
    /// How and on which line the program ended.
    pub(crate) end: Option<End>,
    /// Whether every chunk was looked at.
    pub(crate) complete: bool,
    /// Findings that are in no group, because nobody could list them all.
    pub(crate) unlisted: Unlisted,
}

/// The whole file.
#[salsa::tracked(returns(ref), no_eq)]
pub(crate) fn timeline<'db>(db: &'db dyn Db, document: Document) -> Timeline<'db> {
    db.count(Counted::Timeline);
    remembered(db, document, u32::MAX)
}

/// The file up to the chunk that holds a line.
#[salsa::tracked(returns(ref), no_eq, lru = 8)]
pub(crate) fn timeline_to<'db>(db: &'db dyn Db, document: Document, line: u32) -> Timeline<'db> {
    remembered(db, document, line)
}

fn remembered<'db>(db: &'db dyn Db, document: Document, last_line: u32) -> Timeline<'db> {
    put_together(db, document, last_line, unread(db, document))
}

/// `unread`: parameters that don't matter from chunk to chunk.
fn put_together<'db>(db: &'db dyn Db, document: Document, last_line: u32, unread: &'db [Parameter]) -> Timeline<'db> {
    let file = Whole::new(db, document);
    let known = start(db, document.run(db), file.layout.percent);
    let entries = vec![None; file.layout.parts.len()];
    let mut run = Remembered { file, known, entries, unread, calls_others: false };
    let story = told(&mut run, file, Fold::default(), last_line);
    if run.calls_others && !unread.is_empty() {
        // What the file itself doesn't read, others may.
        return put_together(db, document, last_line, &[]);
    }
    Timeline { entries: run.entries, story }
}

/// Parameters between two chunks without those that nothing reads: setting one of these changes nothing below.
#[salsa::tracked(returns(copy))]
fn that_matters<'db>(db: &'db dyn Db, document: Document, env: Env<'db>) -> Env<'db> {
    Env::new(db, env.environment(db).without(unread(db, document)))
}

/// The whole file, and nothing is remembered but what can be listed.
pub(crate) fn told_once(db: &dyn Db, document: Document) -> Story {
    db.count(Counted::Timeline);
    let file = Whole::new(db, document);
    let (boundary, env) = engine::start(file.options, file.layout.percent);
    let mut run = Passing { file, boundary, env, carried: Carried::default() };
    told(&mut run, file, Fold { listed: Some(Listed::default()), ..Fold::default() }, u32::MAX)
}

/// The same with all parameters, also those that nothing in the file reads.
#[salsa::tracked(returns(ref), no_eq, lru = 2)]
pub(crate) fn timeline_with_all_to<'db>(db: &'db dyn Db, document: Document, line: u32) -> Timeline<'db> {
    put_together(db, document, line, &[])
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
        self.take_some(summary, base, rules, |_| true);
    }

    /// The same, but only the rapids that are `wanted`.
    fn take_some(
        &mut self,
        summary: &Summary,
        base: Option<(FileId, u32)>,
        rules: &crate::Rules,
        mut wanted: impl FnMut(&Found) -> bool,
    ) {
        let real = |place: Where| match base {
            Some((file, first)) => Where { file, line: place.line.wrapping_add(first), ..place },
            None => place,
        };
        for dive in &summary.dives {
            if let Some(mut found) = dive.judge(&self.cuts, rules) {
                found.place = real(found.place);
                if wanted(&found) {
                    self.found.push(found);
                }
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

/// Where in a list of findings the interpreter gives up, when there were `before` of its findings before them. The
/// interpreter counts within the stretch that it runs; here the whole file counts.
fn gives_up(found: &[Found], before: usize) -> Option<usize> {
    let mut count = before;
    found.iter().position(|f| {
        count += usize::from(f.from != From::Lint);
        count >= GIVE_UP && f.from == From::Fault
    })
}

/// The main file's statements of control flow make faults of these kinds over and over once an error has made the
/// controller forget all labels: the rest of a loop or branch is then without its beginning.
const CONSEQUENCES: [Code; 2] = [code::FLOW_LABEL, code::FLOW_UNCLOSED];

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

/// A file and what it is run with.
#[derive(Clone, Copy)]
struct Whole<'a> {
    db: &'a dyn Db,
    document: Document,
    main: FileId,
    options: &'a crate::Options,
    layout: &'a Layout,
}

impl<'a> Whole<'a> {
    fn new(db: &'a dyn Db, document: Document) -> Whole<'a> {
        let options = document.run(db).options(db);
        Whole { db, document, main: FileId(document.id(db)), options, layout: layout(db, document) }
    }
}

/// A run through a file, chunk after chunk.
trait Run {
    /// Runs a chunk without control flow.
    fn step(&mut self, part: &Part, fold: &mut Fold);
    /// Runs on from a chunk with control flow; returns the first line behind the stretch.
    fn flow(&mut self, part: &Part, fold: &mut Fold) -> Option<u32>;
    /// Execution is at the start of a chunk.
    fn at(&mut self, part: usize);
    /// State at present.
    fn modal(&self) -> &Modal;
}

/// What was found so far.
#[derive(Default)]
struct Fold {
    groups: Vec<Group>,
    /// Findings of the interpreter so far.
    spoken: usize,
    late: Late,
    end: Option<End>,
    /// There were too many mistakes to go on.
    gave_up: bool,
    /// Unclosed statements of the other files that were opened.
    others: Vec<(FileId, Vec<Found>)>,
    /// What is kept of the findings; none = all.
    listed: Option<Listed>,
}

/// The findings that a list of all has room for; the others are counted.
#[derive(Default)]
struct Listed {
    seen: BTreeMap<Code, BTreeSet<Key>>,
    unlisted: Unlisted,
    /// Of lints.
    lints: Unlisted,
}

/// Findings of these kinds may be taken back later, when others are known.
const MAY_BE_DROPPED: [Code; 4] = [CONSEQUENCES[0], CONSEQUENCES[1], code::END_SPINDLE_ON, code::END_COMPENSATION_ON];

impl Listed {
    /// Whether there is room for a finding in the list.
    fn has_room(&mut self, found: &Found, key: Key) -> bool {
        // Faults stop the run before there are many.
        if found.from == From::Fault || MAY_BE_DROPPED.contains(&found.code) {
            return true;
        }
        let seen = self.seen.entry(found.code).or_default();
        if seen.len() < MOST_OF_A_KIND {
            seen.insert(key);
            return true;
        }
        let again = seen.contains(&key);
        if !again {
            let unlisted = if found.from == From::Lint { &mut self.lints } else { &mut self.unlisted };
            *unlisted.entry((found.code, found.severity)).or_default() += 1;
        }
        again
    }
}

impl Fold {
    /// Adds what a chunk without control flow gave.
    fn step(&mut self, file: Whole<'_>, part: &Part, found: &Arc<[Found]>, summary: &Summary, end: Option<End>) {
        self.late(file, summary, Some((file.main, part.first_line)));
        self.end = end.map(|e| e.shifted(part.first_line));
        self.add(file.main, part.first_line, found, None);
    }

    /// Adds what a stretch with control flow gave.
    fn flow(&mut self, file: Whole<'_>, found: &Arc<[Found]>, frames: &Frames, summary: &Summary, end: Option<End>) {
        self.late(file, summary, None);
        self.end = end;
        self.add(file.main, 0, found, Some(frames.clone()));
    }

    fn late(&mut self, file: Whole<'_>, summary: &Summary, base: Option<(FileId, u32)>) {
        let Fold { late, listed, .. } = self;
        late.take_some(summary, base, &file.options.rules, |f| {
            let place = f.place;
            let span = f.span.map(|s| (s.start, s.end));
            listed.as_mut().is_none_or(|l| l.has_room(f, (place.file, place.line, f.code, f.letter, span)))
        });
    }

    fn unclosed(&mut self, unclosed: &[(FileId, Vec<Found>)]) {
        for (file, found) in unclosed {
            if !self.others.iter().any(|(f, _)| f == file) {
                self.others.push((*file, found.clone()));
            }
        }
    }

    fn add(&mut self, main: FileId, first_line: u32, found: &Arc<[Found]>, frames: Option<Frames>) {
        if found.is_empty() {
            return;
        }
        let mut group = Group { first_line, found: found.clone(), frames };
        if let Some(at) = gives_up(found, self.spoken) {
            group.found = found[..=at].into();
            let line = found[at].place.line.wrapping_add(first_line);
            self.end = Some(End { line, stopped: true, program: false });
            self.gave_up = true;
        }
        self.spoken += found.iter().filter(|f| f.from != From::Lint).count();
        if let Some(listed) = &mut self.listed {
            let room: Vec<bool> = group.found.iter().map(|f| listed.has_room(f, key(f, &group, main))).collect();
            if room.contains(&false) {
                group.found = group.found.iter().zip(room).filter(|(_, room)| *room).map(|(f, _)| f.clone()).collect();
            }
        }
        if !group.found.is_empty() {
            self.groups.push(group);
        }
    }
}

/// Runs through a file and says what there is to say.
fn told(run: &mut impl Run, file: Whole<'_>, mut fold: Fold, last_line: u32) -> Story {
    let Whole { main, options, layout, .. } = file;
    let parts = &layout.parts;
    let mut at = 0;
    while at < parts.len() && fold.end.is_none() && parts[at].first_line <= last_line {
        run.at(at);
        if parts[at].control {
            let next = run.flow(&parts[at], &mut fold);
            at = next.map_or(parts.len(), |line| parts.partition_point(|p| p.first_line < line));
        } else {
            run.step(&parts[at], &mut fold);
            at += 1;
        }
    }
    let Fold { mut groups, mut late, mut end, others, listed, gave_up, .. } = fold;
    let Listed { mut unlisted, lints, .. } = listed.unwrap_or_default();
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
        late.found.extend(engine::finish(&engine::Finish { layout, main, options, modal: run.modal(), end }));
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
    if gave_up {
        // Which lints came before the last mistake, a stretch that jumps back doesn't know; among so many nobody misses them.
        late.found.retain(|f| f.from != From::Lint);
        for group in &mut groups {
            group.found = group.found.iter().filter(|f| f.from != From::Lint).cloned().collect();
        }
        groups.retain(|g| !g.found.is_empty());
    } else {
        unlisted.extend(lints);
    }
    if !late.found.is_empty() {
        groups.push(Group { first_line: 0, found: late.found.into(), frames: Some(Arc::default()) });
    }
    Story { groups, end, complete, unlisted }
}

/// A run of which each part is remembered by what it depends on.
struct Remembered<'db> {
    file: Whole<'db>,
    known: Known<'db>,
    entries: Vec<Option<Known<'db>>>,
    /// Parameters that don't matter from chunk to chunk.
    unread: &'db [Parameter],
    /// Other files were opened.
    calls_others: bool,
}

impl<'db> Remembered<'db> {
    fn goes_on(&mut self, from: Env<'db>, known: Known<'db>) {
        self.known = known;
        if !self.unread.is_empty() && known.env != from {
            self.known.env = that_matters(self.file.db, self.file.document, known.env);
        }
    }
}

impl Run for Remembered<'_> {
    fn step(&mut self, part: &Part, fold: &mut Fold) {
        let Whole { db, document, .. } = self.file;
        let run = document.run(db);
        let Known { entry, env, mut labels } = self.known;
        let mut step = step(db, part.chunk, run, entry, part.environment.then_some(env));
        if step.impure {
            step = self::step(db, part.chunk, run, entry, Some(env));
        }
        fold.step(self.file, part, &step.found, &step.summary, step.end);
        if step.found.iter().any(|f| f.from == From::Fault) {
            labels = Labels::new(db, labels.carried(db).without_labels());
        }
        self.goes_on(env, Known { entry: step.exit, env: step.env.unwrap_or(env), labels });
    }

    fn flow(&mut self, part: &Part, fold: &mut Fold) -> Option<u32> {
        let Whole { db, document, main, layout, .. } = self.file;
        let Known { entry, env, labels } = self.known;
        let flow = flow(db, document, part.chunk, entry, env, labels);
        let moved = Moved::new(&flow.came, &layout.starts, main, part.chunk);
        match &moved {
            None => fold.flow(self.file, &flow.found, &flow.frames, &flow.summary, flow.end),
            Some(m) => {
                let (found, frames) = (m.found(&flow.found).into(), m.frames(&flow.frames).into());
                fold.flow(self.file, &found, &frames, &m.summary(&flow.summary), flow.end.map(|e| m.end(e)));
            }
        }
        fold.unclosed(&flow.unclosed);
        self.calls_others |= !flow.unclosed.is_empty();
        self.goes_on(env, flow.exit);
        flow.next.map(|line| moved.map_or(line, |m| m.behind(line)))
    }

    fn at(&mut self, part: usize) {
        self.entries[part] = Some(self.known);
    }

    fn modal(&self) -> &Modal {
        self.known.entry.boundary(self.file.db).modal()
    }
}

/// A run that leaves nothing behind.
struct Passing<'a> {
    file: Whole<'a>,
    boundary: Boundary,
    env: Environment,
    carried: Carried,
}

impl Run for Passing<'_> {
    fn step(&mut self, part: &Part, fold: &mut Fold) {
        let Whole { db, document, options, .. } = self.file;
        let scan = scanned(db, part.chunk, document.run(db));
        let chunk = gr_gcode::Chunk { text: part.chunk.text(db).clone(), scan };
        let mut step = engine::step(&chunk, &self.boundary, part.environment.then_some(&self.env), options);
        if step.impure {
            step = engine::step(&chunk, &self.boundary, Some(&self.env), options);
        }
        if step.found.iter().any(|f| f.from == From::Fault) {
            self.carried = self.carried.without_labels();
        }
        fold.step(self.file, part, &step.found.into(), &step.summary, step.end);
        self.boundary = step.boundary;
        if let Some(env) = step.environment {
            self.env = env;
        }
    }

    fn flow(&mut self, part: &Part, fold: &mut Fold) -> Option<u32> {
        let Whole { db, document, .. } = self.file;
        let stretch = Stretch { db, document, chunk: part.chunk, entry: &self.boundary, env: &self.env, carried: &self.carried };
        let flow = engine::flow(&stretch);
        fold.flow(self.file, &flow.found.into(), &flow.frames.into(), &flow.summary, flow.end);
        fold.unclosed(&flow.unclosed);
        (self.boundary, self.env, self.carried) = (flow.boundary, flow.environment, flow.carried);
        flow.next
    }

    fn at(&mut self, _part: usize) {}

    fn modal(&self) -> &Modal {
        self.boundary.modal()
    }
}
