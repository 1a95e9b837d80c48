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
        MachineAction::Import { file, id, tip, output } => import(global, file, (id, tip.as_deref()), output.as_deref()),
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
    super::refuse(global, Path::new(name), code::PROJECT_UNKNOWN_MACHINE, &[name.to_string(), instead_of(name)])
}

/// Ids that resemble an unknown one, and where the others are.
fn instead_of(name: &str) -> String {
    let wanted = name.to_ascii_lowercase();
    let model = wanted.rsplit('/').next().unwrap_or(&wanted);
    let resembles = |id: &str| {
        let own = id.rsplit('/').next().unwrap_or(id);
        !model.is_empty() && (own.contains(model) || model.contains(own) || id.starts_with(&wanted))
    };
    let near: Vec<&str> = list().filter(|id| resembles(id)).take(5).collect();
    let choose = if near.is_empty() { String::new() } else { format!("did you mean {}? ", near.join(", ")) };
    format!("{choose}`gcc-robot machine list` shows all ids; the path of a machine file works too")
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
        Ok(machine) => {
            let doubts = gr_machine::doubts(file, &text);
            if doubts.is_empty() {
                return said(global, path, &machine);
            }
            let mut renderer = global.renderer(false);
            renderer.tally.files = 1;
            doubts.iter().for_each(|d| renderer.show(&sources, d));
            renderer.finish(!global.quiet);
            Exit::Ok
        }
        Err(found) => {
            let mut renderer = global.renderer(false);
            renderer.tally.files = 1;
            found.iter().for_each(|d| renderer.show(&sources, d));
            renderer.finish(!global.quiet);
            Exit::Findings
        }
    }
}

/// A good file says so: silence looks like nothing happened.
fn said(global: &Global, path: &Path, machine: &gr_machine::Machine) -> Exit {
    if global.quiet || global.message_format != crate::render::MessageFormat::Human {
        return Exit::Ok;
    }
    super::print(&format!("{}: {}, no errors\n", path.display(), machine.title))
}

/// Makes a machine file of a URDF.
fn import(global: &Global, path: &Path, (id, tip): (&str, Option<&str>), output: Option<&Path>) -> Exit {
    let text = match read(path) {
        Ok(d) => d.text,
        Err((code, args)) => return super::refuse(global, path, code, &args),
    };
    let made = match gr_machine::import_urdf(id, &text, tip) {
        Ok(made) => made,
        Err(why) => {
            eprintln!("{}: {why}", path.display());
            return Exit::Findings;
        }
    };
    made.notes.iter().for_each(|n| eprintln!("{n}"));
    let Some(output) = output.filter(|o| *o != Path::new("-")) else { return super::print(&made.toml) };
    let mut renderer = global.renderer(false);
    let exit = super::write(&mut renderer, &mut Sources::default(), path, &[(output.to_path_buf(), made.toml.into_bytes())]);
    renderer.finish(false);
    exit
}

/// The machine of an id or of a file, and what is doubtful in the file. What is wrong with it points into `sources`.
pub fn doubted(name: &str, sources: &mut Sources) -> Result<(gr_machine::Machine, Vec<gr_text::Diagnostic>), Vec<gr_text::Diagnostic>> {
    use crate::sources::about_file;
    if let Some(machine) = builtin(name) {
        return Ok((machine, Vec::new()));
    }
    if !gr_machine::is_path(name) && !Path::new(name).exists() {
        let file = sources.add("", "");
        return Err(vec![about_file(code::PROJECT_UNKNOWN_MACHINE, file, &[name.to_string(), instead_of(name)])]);
    }
    match crate::sources::read_setup(Path::new(name)) {
        Ok(d) => {
            let file = sources.add(name, d.text.clone());
            parse(file, &d.text).map(|machine| (machine, gr_machine::doubts(file, &d.text)))
        }
        Err((code, args)) => {
            let file = sources.add(name, "");
            Err(vec![about_file(code, file, &args)])
        }
    }
}
