//! The ISO 14649 view of a Part 21 file: which entities there are, what their attributes mean, and whether a
//! file keeps to it. Reading tool paths out of it is not here.
//!
//! The tables are `spec/step/*.tsv`; [`schema`] resolves them once.

mod check;
mod schema;

pub use check::check;
pub use schema::{Attribute, Edition, Entity, EntityId, Schema, Type, schema};
