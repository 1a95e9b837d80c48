//! `gcc-robot machine list | show | check`

use std::path::Path;

use gr_machine::{builtin, list, parse, source};
use gr_text::code;

use crate::exit::Exit;
use crate::options::{Global, MachineAction, MachineArgs};
use crate::sources::{Sources, read};

pub fn run(global: &Global, args: &MachineArgs) -> Exit {
    match &args.action {
        MachineAction::List => super::print(&catalogue()),
        MachineAction::Show { machine, toml } => show(global, machine, *toml),
        MachineAction::Import { file, id, output } => import(global, file, id, output.as_deref()),
        MachineAction::Check { files } => {
            files.iter().map(|f| check(global, f, false, false)).max().unwrap_or(Exit::Ok)
        }
    }
}

fn catalogue() -> String {
    list().map(|id| format!("{id:<34}{}\n", builtin(id).map_or(String::new(), |m| m.title.to_string()))).collect()
}

fn show(global: &Global, name: &str, toml: bool) -> Exit {
    if let (Some(text), Some(machine)) = (source(name), builtin(name)) {
        return super::print(&if toml { text.to_string() } else { machine.describe() });
    }
    if gr_machine::is_path(name) {
        return check(global, Path::new(name), true, toml);
    }
    let known: Vec<&str> = list().collect();
    super::refuse(global, Path::new(name), code::PROJECT_UNKNOWN_MACHINE, &[name.to_string(), known.join(", ")])
}

/// Reads a machine file and reports what is wrong with it.
fn check(global: &Global, path: &Path, print: bool, toml: bool) -> Exit {
    let text = match read(path) {
        Ok(d) => d.text,
        Err((code, args)) => return super::refuse(global, path, code, &args),
    };
    let mut sources = Sources::default();
    let file = sources.add(path.display().to_string(), text.clone());
    match parse(file, &text) {
        Ok(_) if print && toml => super::print(&text),
        Ok(machine) if print => super::print(&machine.describe()),
        Ok(_) => Exit::Ok,
        Err(found) => {
            let mut renderer = global.renderer(false);
            renderer.tally.files = 1;
            found.iter().for_each(|d| renderer.show(&sources, d));
            renderer.finish(!global.quiet);
            Exit::Findings
        }
    }
}

/// Makes a machine file of a URDF.
fn import(global: &Global, path: &Path, id: &str, output: Option<&Path>) -> Exit {
    let text = match read(path) {
        Ok(d) => d.text,
        Err((code, args)) => return super::refuse(global, path, code, &args),
    };
    let made = match gr_machine::import_urdf(id, &text) {
        Ok(made) => made,
        Err(why) => {
            eprintln!("{}: {why}", path.display());
            return Exit::Findings;
        }
    };
    made.notes.iter().for_each(|n| eprintln!("{n}"));
    let Some(output) = output else { return super::print(&made.toml) };
    match crate::output::write_with(&[(output.to_path_buf(), made.toml.into_bytes())], Vec::new()) {
        Ok(()) => Exit::Ok,
        Err((path, e)) => {
            eprintln!("{}: {e}", path.display());
            Exit::Io
        }
    }
}

/// The machine of an id or of a file. What is wrong with it points into `sources`.
pub fn load(name: &str, sources: &mut Sources) -> Result<gr_machine::Machine, Vec<gr_text::Diagnostic>> {
    use crate::sources::about_file;
    if let Some(machine) = builtin(name) {
        return Ok(machine);
    }
    if !gr_machine::is_path(name) && !Path::new(name).exists() {
        let known: Vec<&str> = list().collect();
        let file = sources.add("", "");
        return Err(vec![about_file(code::PROJECT_UNKNOWN_MACHINE, file, &[name.to_string(), known.join(", ")])]);
    }
    match read(Path::new(name)) {
        Ok(d) => {
            let file = sources.add(name, d.text.clone());
            parse(file, &d.text)
        }
        Err((code, args)) => {
            let file = sources.add(name, "");
            Err(vec![about_file(code, file, &args)])
        }
    }
}
