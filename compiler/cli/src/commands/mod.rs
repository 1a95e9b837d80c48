//! One module per command.

pub mod accuracy;
pub mod build;
pub mod check;
pub mod completions;
pub mod diff;
pub mod explain;
pub mod filter;
pub mod fmt;
pub mod init;
pub mod lsp;
pub mod machine;
pub mod map;
pub mod place;
pub mod preview;
pub mod preview_serve;
pub mod rs274;
pub mod target;

use std::io::{IsTerminal as _, Read as _};
use std::path::{Path, PathBuf};

use gr_text::{Code, code};

use crate::exit::Exit;
use crate::options::{Global, SetupArgs, When};
use crate::output::same_file;
use crate::render::Renderer;
use crate::sources::{Sources, about_file, reason};

impl Global {
    /// A renderer as the options ask for it.
    pub fn renderer(&self, stdout_is_taken: bool) -> Renderer {
        let color = match self.color {
            When::Always => true,
            When::Never => false,
            When::Auto => std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty()) && std::io::stderr().is_terminal(),
        };
        Renderer::new(self.message_format, color, stdout_is_taken)
    }
}

/// Shows a finding about a file that could not be read or written, or about an option.
pub fn complain(renderer: &mut Renderer, sources: &mut Sources, name: &str, code: Code, args: &[String]) {
    let file = sources.add(name, "");
    renderer.show(sources, &about_file(code, file, args));
}

/// Tells which folders can't be read.
pub fn unreadable(closed: &[(PathBuf, std::io::Error)], sources: &mut Sources, renderer: &mut Renderer) {
    for (at, e) in closed {
        let name = at.display().to_string();
        complain(renderer, sources, &name, code::FILE_UNREADABLE, &[name.clone(), reason(e)]);
    }
}

/// Writes files, all or none, and never over what they were made from; says which one could not be written.
pub fn write(renderer: &mut Renderer, sources: &mut Sources, from: &Path, files: &[(PathBuf, Vec<u8>)]) -> Exit {
    if files.iter().any(|(path, _)| same_file(path, from)) {
        let name = from.display().to_string();
        complain(renderer, sources, &name, code::FILE_OVERWRITES_SOURCE, std::slice::from_ref(&name));
        return Exit::Findings;
    }
    match crate::output::write_all(files) {
        Ok(()) => Exit::Ok,
        Err((path, e)) => {
            let name = path.display().to_string();
            complain(renderer, sources, &name, code::FILE_UNWRITABLE, &[name.clone(), reason(&e)]);
            Exit::Io
        }
    }
}

/// Shows one finding and ends the log.
pub fn refuse(global: &Global, name: &Path, code: Code, args: &[String]) -> Exit {
    let mut renderer = global.renderer(false);
    complain(&mut renderer, &mut Sources::default(), &name.display().to_string(), code, args);
    renderer.finish(false);
    if code.def().slug.starts_with("file/") { Exit::Io } else { Exit::of(code, true) }
}

/// Why an option about STEP-NC files does nothing: all files that are named are G-code.
pub fn idle_for(setup: &SetupArgs, files: &[PathBuf]) -> Option<String> {
    let option = setup.step_units.map(|_| "--step-units").or(setup.step_overlap.map(|_| "--step-overlap"))?;
    // What can't be looked into here, or is not there, is told by the command itself.
    let is_gcode = |path: &PathBuf| {
        let mut head = Vec::new();
        // What a pipe gives it gives once: to the command.
        let mut read = || std::fs::File::open(path).and_then(|f| f.take(4096).read_to_end(&mut head));
        path.is_file() && read().is_ok() && !crate::exchange::is_exchange(path, &String::from_utf8_lossy(&head))
    };
    let first = files.first()?.display();
    files.iter().all(is_gcode).then(|| format!("{option} says how STEP-NC files are meant; {first} is G-code"))
}

/// Prints text; only a broken disk behind standard output makes this fail.
pub fn print(text: &str) -> Exit {
    match crate::output::to_stdout(text.as_bytes()) {
        Ok(()) => Exit::Ok,
        Err(_) => Exit::Io,
    }
}
