//! Reads a written program again: through the interpreter into motion.

use std::sync::Arc;

use gr_canon::FileId;
use gr_gcode::{Chunk, File, scan};
use gr_interp::{Files, Interp, Setup};
use gr_ir::{Lowering, Program};

struct One(File);

impl Files for One {
    fn file(&self, _: FileId) -> &File {
        &self.0
    }
    fn find_sub(&mut self, _: &str) -> Option<FileId> {
        None
    }
}

/// The motion of a program; what is wrong with it, and its text.
pub fn read(text: &str, setup: &Setup) -> Result<Program, String> {
    let mut files = One(File::new("a.ngc", vec![Chunk { text: text.into(), scan: Arc::new(scan(text, setup.dialect)) }]));
    let mut interp = Interp::new(&mut files, setup, Lowering::new());
    let outcome = interp.run(FileId(0));
    if !outcome.ok() {
        return Err(format!("{:?}\n{text}", outcome.findings));
    }
    Ok(interp.into_sink().finish())
}
