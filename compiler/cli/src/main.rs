//! The `gcc-robot` command: options, rendering of diagnostics, writing of results. What programs mean is
//! decided in the crates below.

mod commands;
mod elsewhere;
mod emit;
mod exchange;
mod exit;
mod options;
mod output;
mod pipeline;
mod progress;
mod project;
mod render;
mod robot;
mod setup;
mod sources;
mod tools;

use std::process::ExitCode;

use clap::Parser as _;

use exit::Exit;
use options::{Cli, Command};

fn main() -> ExitCode {
    let mut args: Vec<std::ffi::OsString> = std::env::args_os().collect();
    // A link of the name rs274 to this program stands in for the real one; its options are not clap's.
    if called_as_rs274(args.first()) {
        return commands::rs274::run(&args[0].clone(), &args.split_off(1));
    }
    match Cli::try_parse_from(args) {
        Ok(cli) => run(cli),
        Err(e) => {
            let code = if e.use_stderr() { Exit::Usage } else { Exit::Ok };
            // Nowhere left to complain to.
            let _ = e.print();
            code.into()
        }
    }
}

/// Whether the program was called under the name of the real command.
pub fn called_as_rs274(name: Option<&std::ffi::OsString>) -> bool {
    name.is_some_and(|n| std::path::Path::new(n).file_stem().is_some_and(|s| s == "rs274"))
}

/// An option that does nothing for the files that are named.
fn idle(command: &Command) -> Option<String> {
    use commands::idle_for;
    match command {
        Command::Check(a) => idle_for(&a.setup, &a.paths),
        Command::Build(a) => idle_for(&a.setup, &a.files),
        Command::Preview(a) => idle_for(&a.setup, std::slice::from_ref(&a.file)),
        Command::Diff(a) => idle_for(&a.setup, &[a.a.clone(), a.b.clone()]),
        Command::Verify(a) => idle_for(&a.setup, std::slice::from_ref(&a.file)),
        Command::Accuracy(a) => idle_for(&a.setup, std::slice::from_ref(&a.file)),
        Command::Place(a) => idle_for(&a.setup, a.file.as_slice()),
        Command::Filter(a) => idle_for(&a.setup, std::slice::from_ref(&a.file)),
        _ => None,
    }
}

fn run(cli: Cli) -> ExitCode {
    let global = &cli.global;
    if let Some(why) = idle(&cli.command) {
        eprintln!("{why}");
        return Exit::Usage.into();
    }
    match cli.command {
        Command::Check(args) => commands::check::run(global, &args).into(),
        Command::Build(args) => commands::build::run(global, &args).into(),
        Command::Fmt(args) => commands::fmt::run(global, &args).into(),
        Command::Renumber(args) => commands::fmt::renumber(global, &args).into(),
        Command::Preview(args) => commands::preview::run(global, &args).into(),
        Command::Diff(args) => commands::diff::run(global, &args).into(),
        Command::Verify(args) => commands::diff::verify(global, &args).into(),
        Command::Explain(args) => commands::explain::run(&args).into(),
        Command::Accuracy(args) => commands::accuracy::run(global, &args).into(),
        Command::Map(args) => commands::map::run(global, &args).into(),
        Command::Place(args) => commands::place::run(global, &args).into(),
        Command::Target(args) => commands::target::run(&args).into(),
        Command::Machine(args) => commands::machine::run(global, &args).into(),
        Command::Filter(args) => commands::filter::run(global, &args).into(),
        Command::Rs274(args) => commands::rs274::run("gcc-robot rs274".as_ref(), &args.arguments),
        Command::Init(args) => commands::init::run(global, &args).into(),
        Command::Lsp(_) => match gr_lsp::run(std::sync::Arc::new(commands::lsp::Editor)) {
            Ok(true) => Exit::Ok.into(),
            // The protocol wants 1 for a client that leaves without `shutdown`.
            Ok(false) => Exit::Findings.into(),
            Err(_) => Exit::Io.into(),
        },
        Command::Completions(args) => commands::completions::run(&args).into(),
    }
}
