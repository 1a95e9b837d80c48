//! Helpers that the tests of the whole share.

pub mod controller;
pub mod full;
pub mod generate;
pub mod linuxcnc;
pub mod matrix;
pub mod oracle;
pub mod process;
pub mod programs;
pub mod random;
