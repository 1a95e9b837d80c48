//! G-code.

pub mod actions;
pub mod complete;
pub mod doc;
pub mod format;
pub mod hints;
pub mod hover;
pub mod lenses;
pub mod modes;
pub mod names;
pub mod outline;
#[cfg(test)]
mod tests;
pub mod tokens;

pub use doc::Doc;
