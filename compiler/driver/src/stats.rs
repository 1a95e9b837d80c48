//! Motion of an open file, and what it adds up to: time, distance, extents, for the file and for each tool. One run
//! of the whole file, remembered until the text changes; for editors, in the background.

use std::sync::Arc;

use gr_canon::{At, Call, CallFrame, FileId, FrameId, Mark, Sink};
use gr_interp::Interp;
use gr_ir::measure::{Report, report};
use gr_ir::{Lowering, Program};

use crate::db::{Db, Document};
use crate::layout::layout;
use crate::library::Library;

/// Blocks and calls that are run for the motion of an open file.
const MOST_BLOCKS: u64 = 6_000_000;

/// What a file adds up to, as far as it runs.
#[salsa::tracked(returns(clone), no_eq)]
pub(crate) fn stats(db: &dyn Db, document: Document) -> Arc<Report> {
    let rates = crate::rates(&document.run(db).options(db).setup);
    Arc::new(report(&motion(db, document), &rates))
}

/// Motion of a file, as far as it runs; sources are numbered as in the session.
#[salsa::tracked(returns(clone), no_eq, lru = 2)]
pub(crate) fn motion(db: &dyn Db, document: Document) -> Arc<Program> {
    let run = document.run(db);
    // Subroutine files are read again when they may have changed.
    let _ = run.disk_revision(db);
    let setup = &run.options(db).setup;
    // A loop that does not end must not fill the memory: the path ends where the budget does.
    let mut setup = setup.clone();
    setup.budgets.blocks = setup.budgets.blocks.min(MOST_BLOCKS);
    setup.budgets.calls = setup.budgets.calls.min(MOST_BLOCKS);
    let setup = &setup;
    if let Some(program) = crate::ufmg::motion(db, document) {
        return Arc::new(program);
    }
    let mut library = Library::new(db, document, layout(db, document).starts.clone());
    let mut interp = Interp::new(&mut library, setup, Watch { lowering: Lowering::new(), db, calls: 0 });
    interp.init();
    let main = FileId(document.id(db));
    if interp.open(main).is_ok() {
        interp.run_open();
    }
    let files = interp.opened_files().to_vec();
    let mut lowering = interp.into_sink().lowering;
    for id in files {
        lowering.builder_mut().file(id, &db.disk().path(id).unwrap_or_default());
    }
    Arc::new(lowering.finish())
}

/// Lowers, and gives way when the work is cancelled.
struct Watch<'a> {
    lowering: Lowering,
    db: &'a dyn Db,
    calls: u32,
}

impl Sink for Watch<'_> {
    #[inline]
    fn call(&mut self, at: &At<'_>, call: &Call) {
        self.calls = self.calls.wrapping_add(1);
        if self.calls % 4096 == 0 {
            self.db.unwind_if_revision_cancelled();
        }
        self.lowering.call(at, call);
    }
    fn give_way(&mut self) {
        self.db.unwind_if_revision_cancelled();
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        self.lowering.frame(id, frame);
    }
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        self.lowering.mark(at, mark);
    }
}
