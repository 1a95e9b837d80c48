//! `gcc-robot filter part.p21`: a filter program of LinuxCNC. Standard output gets G-code and nothing else;
//! progress, findings and the tools to load go to standard error.

use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};

use gr_interp::{read_tools, write_tools};
use gr_text::{FileId, Severity, code};

use super::check::{Checked, show};
use crate::emit::{Built, Goal, build};
use crate::exit::Exit;
use crate::options::{FilterArgs, Global, LintArgs};
use crate::output::{same_file, to_stdout, write_all};
use crate::pipeline::load;
use crate::render::{MessageFormat, Renderer};
use crate::setup::{Station, beside, station};
use crate::sources::{Sources, reason};

/// LinuxCNC tells the programs it starts where the machine's settings are.
const INI_VARIABLE: &str = "INI_FILE_NAME";

pub fn run(global: &Global, args: &FilterArgs) -> Exit {
    let format = match global.message_format {
        // Dialogs of LinuxCNC's screens have no drawing characters.
        MessageFormat::Human if !std::io::stderr().is_terminal() => MessageFormat::Short,
        other => other,
    };
    let global = Global { message_format: format, ..global.clone() };
    let mut renderer = global.renderer(true);
    let exit = filter(args, &mut renderer);
    renderer.finish(false);
    exit
}

/// As LinuxCNC's screens read it; a person at a terminal needs none.
fn progress(percent: u32) {
    if !std::io::stderr().is_terminal() {
        let _ = writeln!(std::io::stderr(), "FILTER_PROGRESS={percent}");
    }
}

fn filter(args: &FilterArgs, renderer: &mut Renderer) -> Exit {
    progress(0);
    let mut setup = args.setup.clone();
    if setup.ini.is_none() {
        setup.ini = std::env::var_os(INI_VARIABLE).filter(|v| !v.is_empty()).map(PathBuf::from);
    }
    let mut sources = Sources::default();
    let Some(mut station) = station(&setup, &LintArgs::default(), beside(&args.file), &mut sources, renderer) else { return renderer.failed() };
    if args.write_tools.is_some() {
        station.tools = None;
    }
    let mut options = args.options.clone();
    options.reference = options.reference.or(station.project.as_ref().and_then(|p| p.file.project.reference));
    let goal = Goal { target: "rs274ngc", options: &options, machine: None, from_line: None, file: None };
    let made = load(&args.file, &station).and_then(|unit| {
        progress(10);
        build(&unit, &goal)
    });
    progress(90);
    let built = match made {
        Ok(Ok((built, checked))) => {
            show(renderer, &checked);
            built
        }
        Ok(Err(text)) => {
            eprintln!("{text}");
            return Exit::Usage;
        }
        Err(checked) => {
            show(renderer, &checked);
            return if checked.unreadable { Exit::Io } else { Exit::Findings };
        }
    };
    deliver(args, &station, built, renderer, &mut sources)
}

fn deliver(args: &FilterArgs, station: &Station, built: Built, renderer: &mut Renderer, sources: &mut Sources) -> Exit {
    let bad = built.found.iter().any(|d| d.severity == Severity::Error);
    show(renderer, &Checked { sources: built.sources, found: built.found, ..Checked::nothing() });
    let Some(main) = built.artifacts.into_iter().next().filter(|_| !bad) else { return Exit::Findings };
    if let Some(name) = args.write_tools.as_ref().filter(|path| same_file(path, &args.file)).map(|p| p.display().to_string()) {
        super::complain(renderer, sources, &name, code::FILE_OVERWRITES_SOURCE, std::slice::from_ref(&name));
        return Exit::Findings;
    }
    if let (Some(path), Some(table)) = (&args.write_tools, &built.table)
        && let Err(e) = write_table(path, &in_machine_units(table, station))
    {
        let name = path.display().to_string();
        super::complain(renderer, sources, &name, code::FILE_UNWRITABLE, &[name.clone(), reason(&e)]);
        return Exit::Io;
    }
    for tool in &built.tools {
        eprintln!("load T{}: {} ({})", tool.number, crate::tools::title(tool), tool.name);
    }
    if let Some(path) = &args.write_tools {
        eprintln!("tool table written to {}: reload it before the program is run", path.display());
    }
    progress(100);
    match to_stdout(&main.bytes) {
        Ok(()) => Exit::Ok,
        Err(_) => Exit::Io,
    }
}

/// A tool table in mm, as the machine reads it.
fn in_machine_units(table: &str, station: &Station) -> String {
    if station.setup.machine_units == gr_canon::Units::Mm {
        return table.to_string();
    }
    let (mut rows, _) = read_tools(table, FileId(0));
    for row in &mut rows.rows {
        row.diameter /= 25.4;
        row.offset.iter_mut().enumerate().filter(|(i, _)| !(3..6).contains(i)).for_each(|(_, v)| *v /= 25.4);
    }
    write_tools(&rows)
}

/// Writes the table in one step; what was there before stays as `FILE.bak`. The same table again changes nothing.
fn write_table(path: &Path, table: &str) -> std::io::Result<()> {
    match std::fs::read(path) {
        Ok(old) if old == table.as_bytes() => return Ok(()),
        Ok(old) => {
            let mut backup = path.as_os_str().to_owned();
            backup.push(".bak");
            write_all(&[(PathBuf::from(backup), old)]).map_err(|(_, e)| e)?;
        }
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {}
        Err(e) => return Err(e),
    }
    write_all(&[(path.to_path_buf(), table.as_bytes().to_vec())]).map_err(|(_, e)| e)
}
