//! Helpers that the tests of the whole share.

pub mod generate;
