//! From the motion IR to the motion of one machine: frames and tools of the cell, a joint configuration for every
//! point, speeds, zones, signals, and the checks that say at the source line why the machine can't do it.
//!
//! The result is a [`RobotProgram`]: moves with pose *and* joint values. Vendor languages, joint-space G-code and
//! set-points are written from it; they decide nothing about motion.

mod program;

pub use program::{Action, MAX_JOINTS, RobotProgram, Step, Target, Tool, WorkFrame, Zone};
