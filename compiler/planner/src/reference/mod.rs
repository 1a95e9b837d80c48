//! Two published systems, repeated so that their results can be compared: number by number, with their own
//! rules where those differ from the standard.

pub mod ufsc2016;
pub mod unb2013;
