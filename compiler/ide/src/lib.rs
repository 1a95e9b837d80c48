//! Editor features as plain functions: text, byte offsets and tables in, plain data out. No protocol, no
//! database, so that tests and other editors can call them. Everything that is told comes from `spec/`, from the
//! interpreter's run of the program, or from the tables of ISO 14649.

mod data;
pub mod config;
pub mod gcode;
pub mod p21;

pub use data::*;
