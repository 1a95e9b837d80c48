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
