//! What error a machine will make: by its joints, by its geometry, by cutting force; along a program, over the work
//! space, and what can be done about it. The models are those of E. E. R. Gojtan (EPUSP 2009), for any kinematics.
//!
//! | module | job |
//! |---|---|
//! | `grade` | standard tolerances of lengths |
//! | `material` | materials and cutting force |
//! | `error` | the errors at one place of the machine |
//! | `map` | a quantity over the work space |
//! | `outline` | the border of what is within reach |
//! | `picture` | maps and bar charts as PNG and SVG |
//! | `clearance` | how far places are from what is out of reach |
//! | `place` | where a part is best put |
//! | `report` | errors along a program |
//! | `words` | what moves the tool point of a machine tool, by the words of a program |
//! | `compensate` | correction for known deviations, of a robot's program or of motion |

// `!(x <= limit)` is meant: a value that is not a number must fail the test.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod clearance;
pub mod compensate;
pub mod error;
pub mod grade;
pub mod map;
pub mod material;
pub mod outline;
pub mod picture;
pub mod place;
pub mod report;
mod words;

pub use error::{Budget, BudgetOptions, Errors, Sensitivity, Spread, closed_form};
pub use gr_robot::words::{put_down, unplaced, work_shift};
pub use words::Named;
