//! The UFMG 2008 language has commands of its own and no interpreter state: a check reads all of it, and its
//! machine is the robot it was made for.

use gr_gcode::{Chunk, File};
use gr_spec::Family;
use gr_text::{Diagnostic, FileId};

use crate::db::{Database, Db, Document, scanned};

/// Whether a file is in that language.
pub(crate) fn speaks(db: &dyn Db, document: Document) -> bool {
    document.run(db).options(db).setup.dialect.family == Family::Ufmg2008
}

/// Findings of a file in that language; none for files in other languages.
pub(crate) fn check(db: &Database, document: Document) -> Option<Vec<Diagnostic>> {
    if !speaks(db, document) {
        return None;
    }
    let run = document.run(db);
    let chunks = document.chunks(db).iter().map(|c| Chunk { text: c.text(db).clone(), scan: scanned(db, *c, run) });
    let file = File::new("", chunks.collect());
    let id = FileId(document.id(db));
    let (commands, mut found) = gr_backends::joint::language::read(id, &file);
    // If any line is wrong, nothing further runs.
    if found.is_empty()
        && let Some(machine) = gr_machine::builtin("ufmg/plano-3r")
    {
        found = gr_backends::joint::ufmg::lower(id, "", &commands, &machine).1;
    }
    Some(found)
}

/// Motion of a file in that language; none for files in other languages.
pub(crate) fn motion(db: &dyn Db, document: Document) -> Option<gr_ir::Program> {
    if !speaks(db, document) {
        return None;
    }
    let run = document.run(db);
    let id = FileId(document.id(db));
    let (commands, _) = gr_backends::joint::language::read(id, &crate::library::whole(db, document, run));
    let machine = gr_machine::builtin("ufmg/plano-3r")?;
    let name = db.disk().path(id).unwrap_or_default();
    Some(gr_backends::joint::ufmg::lower(id, &name, &commands, &machine).0)
}
