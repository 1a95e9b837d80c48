//! G-code syntax: lossless, error-tolerant, knows nothing of meaning.
//!
//! [`scan`] turns the text of a chunk (whole lines) into flat tables: lines, words, and for lines with
//! structure (expressions, O-words, assignments) nodes of an arena. Plain word lines take a byte-level fast
//! path; lines with structure go through a chumsky grammar over logos tokens. Both give the same tables, and
//! a test demands it. Every byte of the text is covered by a word's span or is blank.

mod alien;
mod build;
mod chunks;
mod fast;
mod format;
mod grammar;
mod lex;
mod model;
mod number;
mod print;
mod renumber;
mod scan;
mod symbols;
#[cfg(test)]
mod tests;

pub use chunks::split_chunks;
pub use format::{Case, FormatOptions, LeadingZeros, format};
pub use model::*;
pub use renumber::{Renumber, edited, renumber};
pub use symbols::{Label, Parameter, Statement, Symbol, Symbols, fanuc_call, symbols};
pub use scan::{scan, scan_by_grammar};
