//! Part 21 exchange files (ISO 10303-21, editions 1 to 3), any schema.
//!
//! Two ways in. [`index`] finds where each instance begins and ends, as fast as the text can be scanned, and
//! reads nothing else. [`parse`] reads everything once into flat tables: every parameter with its exact
//! place, every fault with what was expected there. A damaged statement gives one fault and is skipped; the
//! statements around it stay.
//!
//! What the standard says and many readers forget: bytes below 0x20 are not part of the alphabet and are
//! ignored wherever they stand, so a file broken into lines at any column is the same file. Values therefore
//! carry spans, and their text is taken out when someone asks ([`Exchange::string`], [`Exchange::real`] …).
//!
//! Meaning (entities, types, units) is not here.

mod format;
mod header;
mod index;
mod lex;
mod model;
mod parse;
mod text;

pub use format::{format, renumber};
pub use header::check_header;
pub use index::{Entry, Index, index};
pub use model::{Exchange, Fault, Instance, Kind, Section, Value, members};
pub use parse::{check_syntax, parse};
