//! Back ends: motion IR in, texts and pictures out.

pub mod joint;
mod sweep;
mod target;

pub use sweep::Sweep;
pub use target::{Target, targets};
