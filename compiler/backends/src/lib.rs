//! Back ends: motion IR in, texts and pictures out.

pub mod dump;
pub mod from_line;
pub mod joint;
pub mod plot;
pub mod rs274ngc;
pub mod sheet;
pub mod sources;
mod sweep;
mod target;

pub use gr_ir::{NoSources, Sources, Texts};
pub use sources::Words;
pub use sweep::Sweep;
pub use target::{Target, targets};

/// Index of the first operation that the program asks for itself: those before it tell how its control starts, with its
/// startup code.
pub(crate) fn begins(program: &gr_ir::Program) -> usize {
    let starts = |s: &gr_ir::Step<'_>| s.op != gr_ir::Op::End && !s.op.moves();
    program.steps().take_while(starts).position(|s| s.op == gr_ir::Op::Reset).map_or(0, |at| at + 1)
}
