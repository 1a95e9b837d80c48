//! The `gcc-robot` command.

fn main() {}
