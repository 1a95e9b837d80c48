//! What the interpreter targets share: files in memory and a setup with small limits.

use std::sync::Arc;

use gr_canon::{FileId, Units, Version};
use gr_gcode::{Chunk, File, LineKind};
use gr_interp::{Budgets, Files, Setup, read_tools};
use gr_spec::Dialect;

const TOOLS: &str = "T1 P1 Z1.5 D0.25\nT2 P2 Z1 D0.5\nT9 P3 X0.1 Z0.2 D0.1 Q9\n";

/// The program under test is file 0; subroutine files do not exist.
pub struct Memory(File);

/// One chunk.
pub fn chunk(text: &str, setup: &Setup) -> Chunk {
    Chunk { text: gr_text::Text::from(text), scan: Arc::new(gr_gcode::scan(text, setup.dialect)) }
}

impl Memory {
    /// The text in chunks of some lines.
    pub fn of(text: &str, setup: &Setup, lines: usize) -> Memory {
        let chunks = gr_gcode::split_chunks(text, lines).into_iter().map(|t| chunk(t, setup)).collect();
        Memory(File::new("main.ngc", chunks))
    }
}

impl Files for Memory {
    fn file(&self, _id: FileId) -> &File {
        &self.0
    }
    fn find_sub(&mut self, _name: &str) -> Option<FileId> {
        None
    }
}

/// Limits that end any program in a moment; the byte chooses dialect, version and options.
pub fn small_setup(byte: u8) -> Setup {
    let dialects = ["linuxcnc-2.9", "linuxcnc-2.10", "fanuc-mill", "fanuc-turn", "grbl", "ufmg2008"];
    let dialect = match byte & 3 {
        0 => "linuxcnc-2.9",
        1 => "linuxcnc-2.10",
        _ => dialects[usize::from(byte >> 4) % dialects.len()],
    };
    Setup {
        dialect: Dialect::find(dialect).expect("a dialect of the tables"),
        version: if byte & 4 == 0 { Version::V2_9 } else { Version::V2_10 },
        machine_units: if byte & 8 == 0 { Units::Mm } else { Units::Inch },
        tools: read_tools(TOOLS, FileId(0)).0,
        block_delete: byte & 16 != 0,
        keep_going: byte & 32 != 0,
        startup_code: false,
        budgets: Budgets { blocks: 5_000, passes: 500, calls: 5_000 },
        ..Setup::default()
    }
}

/// Only such text may be run in chunks: no control flow, damage, `%`, subprogram call or parameter that tells where a
/// block stands.
pub fn is_plain(text: &str, setup: &Setup) -> bool {
    let scan = gr_gcode::scan(text, setup.dialect);
    let structured = |kind: LineKind| kind == LineKind::Percent;
    let control = |letter: u8, value: f64| letter == b'o' || letter == b'?' || letter == b'm' && (98.0..100.0).contains(&value);
    let words = scan.words.iter().all(|w| !control(w.letter, w.value));
    let lower = text.to_ascii_lowercase();
    let place = ["_line", "_call", "_value", "ini["].iter().any(|name| lower.replace([' ', '\t'], "").contains(name));
    scan.faults.is_empty() && !scan.lines.iter().any(|l| structured(l.kind)) && words && !place
}
