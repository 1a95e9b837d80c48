//! From the motion IR to the motion of one machine: frames and tools of the cell, a joint configuration for every
//! point, speeds, zones, signals, and the checks that say at the source line why the machine can't do it.
//!
//! The result is a [`RobotProgram`]: moves with pose *and* joint values. Vendor languages, joint-space G-code and
//! set-points are written from it; they decide nothing about motion.
//!
//! | module | job |
//! |---|---|
//! | `program` | what the result is |
//! | `options` | what can be chosen; the summary |
//! | `opinion` | what a machine says about a program of which nothing is made |
//! | `plan` | the passes in order, findings |
//! | `gather` | motion IR → moves in work frames, actions of the cell |
//! | `cell` | M words → signals, or a request to the operator |
//! | `turns` | how rotary words turn the tool |
//! | `path` | the real path of a move |
//! | `solver` | joint values and limits |
//! | `follow` | joint values from look to look, without a jump |
//! | `choose` | one configuration per chain of cuts, chosen over all of them |
//! | `emit` | targets, speed checks, figures |
//! | `reference` | the solver of a publication |
//! | `joints` | moves cut to joint positions by tolerance; joint-space G-code |
//! | `setpoints` | positions, velocities, accelerations at a fixed rate |
//! | `along` | joint values along a path somebody else cut into points |
//! | `settle` | coordinates of machine tools that no word of the work frame has named |
//! | `words` | joints of machine tools from the words of a program |
//! | `verify` | joint values against targets: table, CSV, pictures |

// Joints are walked by index; a value that is not a number must fail the test.
#![allow(clippy::neg_cmp_op_on_partial_ord, clippy::needless_range_loop)]

pub mod along;
mod cell;
mod choose;
mod emit;
mod follow;
mod gather;
pub mod joints;
pub mod opinion;
mod options;
mod path;
mod plan;
mod program;
pub mod reference;
pub mod setpoints;
mod settle;
mod solver;
mod turns;
pub mod verify;
pub mod words;

pub use options::{Options, Planned, Setup, Singularity, Summary, Workingstep};
pub use plan::plan;
pub use program::{Action, Curves, MAX_JOINTS, RobotProgram, Step, Target, Tool, Word, WorkFrame, Zone, joint_seconds};
pub use settle::{Brought, By, Coordinates, Settled, settled};
pub use turns::{Turns, Unread};
