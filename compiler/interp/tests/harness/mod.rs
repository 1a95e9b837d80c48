//! Runs programs of memory with a printer behind the interpreter.

use std::sync::Arc;

use gr_canon::{FileId, Printer, Units, Version};
use gr_gcode::{Chunk, File};
use gr_interp::{Files, Interp, Outcome, Setup, read_tools};
use gr_spec::Dialect;

/// The tool table of every program.
pub const TOOLS: &str = "T1 P1 Z1.5 D0.25\nT2 P2 Z1 D0.5\nT9 P3 X0.1 Z0.2 D0.1 Q9\n";

#[derive(Default)]
pub struct Memory(pub Vec<(String, File)>);

pub fn chunk(text: &str, dialect: &'static Dialect) -> Chunk {
    Chunk { text: gr_text::Text::from(text), scan: Arc::new(gr_gcode::scan(text, dialect)) }
}

impl Memory {
    pub fn add(mut self, name: &str, text: &str, setup: &Setup, lines: usize) -> Self {
        let chunks = gr_gcode::split_chunks(text, lines).into_iter().map(|t| chunk(t, setup.dialect)).collect();
        self.0.push((name.to_string(), File::new(name, chunks)));
        self
    }
}

impl Files for Memory {
    fn file(&self, id: FileId) -> &File {
        &self.0[id.0 as usize].1
    }
    fn find_sub(&mut self, name: &str) -> Option<FileId> {
        let name = format!("{name}.ngc");
        self.0.iter().position(|(n, _)| *n == name).map(|i| FileId(i as u32))
    }
}

pub fn setup() -> Setup {
    Setup {
        machine_units: Units::Inch,
        tools: read_tools(TOOLS, FileId(0)).0,
        user_m_codes: false,
        uvw: false,
        startup_code: false,
        ..Setup::default()
    }
}

pub fn run_with(setup: &Setup, text: &str, lines: usize) -> (String, Outcome) {
    let mut files = Memory::default().add("main.ngc", text, setup, lines);
    let mut printed = Vec::new();
    let mut printer = Printer::new(&mut printed, Version::V2_9);
    let outcome = Interp::new(&mut files, setup, &mut printer).run(FileId(0));
    printer.flush();
    drop(printer);
    (String::from_utf8(printed).expect("the printer writes text"), outcome)
}

