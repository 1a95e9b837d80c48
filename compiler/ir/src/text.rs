//! The text form of the motion IR: one operation per line, numbers in their shortest exact form, so that
//! print → parse gives the same program bit for bit. `spec/ir/motion.md` describes it.

mod parse;
mod print;

pub use parse::{ParseError, parse};
pub use print::{print, print_op, write};

/// First line of the form.
pub const HEADER: &str = "motion 1";

const AXIS_NAMES: [&str; 9] = ["x", "y", "z", "a", "b", "c", "u", "v", "w"];
