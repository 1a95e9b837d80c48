//! The ISO 14649 view of a Part 21 file: which entities there are, what their attributes mean, and whether a
//! file keeps to it. Reading tool paths out of it is not here.
//!
//! The tables are `spec/step/*.tsv`; [`schema`] resolves them once. [`check`] compares a file with them,
//! [`rules`] are the standard's WHERE rules, [`lints`](lint) what a machinist would ask about. [`diagnostics`]
//! does it all. [`Model`] reads instances and attributes by name.

mod check;
mod diagnose;
mod dialect;
mod lint;
mod model;
mod product;
mod rules;
mod schema;

pub use check::check;
pub use diagnose::{diagnostics, diagnostics_of, diagnostics_while};
pub use dialect::{Dialect, dialect};
pub use lint::{THREAD_OVER_CORE, lint, short};
pub use model::{Model, Node, Val};
pub use rules::{Decided, Origin, RULES, Rule, broken, rules_of_entity};
pub use schema::{Attribute, Edition, Entity, EntityId, Name, Schema, Type, schema};
