//! `gcc-robot completions bash`

use clap::CommandFactory as _;

use crate::exit::Exit;
use crate::options::{Cli, CompletionsArgs};

pub fn run(args: &CompletionsArgs) -> Exit {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "gcc-robot", &mut text);
    match crate::output::to_stdout(&text) {
        Ok(()) => Exit::Ok,
        Err(_) => Exit::Io,
    }
}
