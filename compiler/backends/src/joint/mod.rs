//! Joint-space programs: motion in space becomes a list of joint positions at even steps of time, written as
//! G-code in joint angles and as two CSV tables. For machines whose joints are not their axes; the machine is
//! known through its kinematics alone.
//!
//! | module | job |
//! |---|---|
//! | `language` | the UFMG 2008 language: lines → commands |
//! | `ufmg` | commands of the UFMG 2008 language → motion IR |
//! | `plan` | motion IR → points in space and in joints, checked against the machine |
//! | `print` | points → text |

pub mod language;
mod plan;
mod print;
pub mod ufmg;

pub use plan::{JointPoint, JointProgram, Options, Rounding, compile};

#[cfg(test)]
mod tests;
