//! Editor features as plain functions: text, byte offsets and tables in, plain data out. No protocol, no
//! database, so that tests and other editors can call them. Everything that is told comes from `spec/`.

mod complete;
mod hover;
mod outline;

pub use complete::{Completion, complete};
pub use hover::{Hover, hover};
pub use outline::{Fold, Item, ItemKind, folds, outline};
