//! RS274NGC interpreter: parsed blocks in, canonical calls out.
//!
//! | module | job |
//! |---|---|
//! | `setup` | what a run starts from: dialect, tool table, parameters, INI, budgets |
//! | `state` | everything a block can change, as plain data that can be compared and stored |
//! | `params` | numbered and named parameters |
//! | `block` | one block's words after evaluation |
//! | `eval` | expressions |
//! | `check` | which words go together |
//! | `exec` | the order of execution in a block, modal groups |
//! | `control` | O-words: loops, branches, skipping |
//! | `calls` | calls and the way back: `o… call`, M98/M99, remaps |
//! | `labels`, `statements` | labels that were met; lines that control flow can come to |
//! | `macros` | macro statements of Fanuc controls |
//! | `run`, `line`, `chunk` | line after line; one line; one chunk alone |
//! | `findings` | what goes wrong, and what came of a run |
//! | `motion`, `arc`, `comp`, `cycles`, `thread`, `rough`, `spline` | motion of one kind each |
//! | `queue` | calls held back while cutter compensation looks ahead |
//!
//! Lengths are in program units throughout, as in the controller, so that results agree to the last bit
//! that matters; the motion IR converts.

mod angle;
mod arc;
mod block;
mod calls;
mod carry;
mod closed;
mod chunk;
mod comp;
mod cycles;
mod fanuc;
mod fault;
mod files;
mod findings;
mod labels;
mod line;
mod macro_call;
mod macros;
mod params;
mod queue;
mod rough;
mod run;
mod setup;
mod spline;
mod state;
mod statements;
mod thread;
mod world;
mod tools;
mod turning;
mod vacant;
mod spindle;
mod indexer;
mod remap;
mod read;
mod offsets;
mod motion;
mod io;
mod exec;
mod eval;
mod control;
mod check;
mod wide;

pub use arc::wrong_arc_tolerances;
pub use block::{Block, Group};
pub use carry::Carry;
pub use chunk::{ChunkExit, run_chunk, run_lines};
pub use fault::{Fault, Res};
pub use files::*;
pub use findings::{Finding, Outcome};
pub use params::Params;
pub use labels::{LabelAt, LabelName, Met};
pub use remap::{remaps_without_file, subroutine_paths};
pub use run::{End, Files, Interp, NoFiles, Place};
pub use setup::{Budgets, Ini, Setup, Tool, ToolTable, Tools};
pub use statements::{Statement, is_stop, statement, unclosed};
pub use state::{Modal, SavedModes, Side, State};
pub use world::World;
