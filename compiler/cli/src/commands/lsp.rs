//! `gcc-robot lsp`: what the language server asks of the command. Project files, machines, plans and targets are read
//! and made here as `check` and `build` do.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use clap::Parser;
use gr_canon::{At, Call, CallFrame, FrameId, Mark, Printer, Sink};
use gr_lsp::Settings;
use gr_lsp::host::{Host, Made, MadeFile, OutputJob, Plan, Station};
use gr_text::{Diagnostic, Encoding, FileId, Span};

use crate::emit::{Artifact, Built, Goal, TargetOptions, build, stem};
use crate::options::{LintArgs, SetupArgs, UnitArg};
use crate::pipeline::{Unit, motion, run};
use crate::project::Project;
use crate::render::Renderer;
use crate::setup::{assembled, modeline};
use crate::sources::Sources;

/// The command, for the server.
pub struct Editor;

fn setup_args(settings: &Settings) -> SetupArgs {
    SetupArgs {
        dialect: None,
        machine: settings.machine.clone(),
        tools: settings.tools.clone(),
        vars: settings.vars.clone(),
        ini: settings.ini.clone(),
        machine_units: match settings.machine_units.as_deref() {
            Some("inch") => Some(UnitArg::Inch),
            Some("mm") => Some(UnitArg::Mm),
            _ => None,
        },
        block_delete: settings.block_delete,
        subs: settings.subs.clone(),
        step_units: None,
        step_overlap: None,
    }
}

/// Where a project file names what a finding is about: the longest of its strings that the message has.
fn named_in(project: &str, d: &Diagnostic) -> Option<Span> {
    let mut at = 0;
    // Every other piece between quotes is a string.
    let strings = project.split('"').enumerate().filter_map(|(n, piece)| {
        let start = at;
        at += piece.len() + 1;
        (n % 2 == 1 && !piece.is_empty()).then_some((start, piece))
    });
    let (start, named) = strings.filter(|(_, s)| d.message.contains(s)).max_by_key(|(_, s)| s.len())?;
    Some(Span::new(start as u32 - 1, (start + named.len()) as u32 + 1))
}

/// A finding at a place of the project file.
fn placed(mut d: Diagnostic, place: Span) -> Diagnostic {
    d.labels.truncate(1);
    for label in &mut d.labels {
        (label.file, label.span) = (FileId(0), place);
    }
    d
}

/// What programs below a folder are run with, and what is wrong with the files that say so.
fn own_station(path: &Path, settings: &Settings) -> (crate::setup::Station, Sources, Vec<Diagnostic>) {
    let lints = LintArgs {
        strict: settings.lints.strict,
        allow: settings.lints.allow.clone(),
        warn: settings.lints.warn.clone(),
        deny: settings.lints.deny.clone(),
    };
    let mut sources = Sources::default();
    let mut renderer = Renderer::collecting();
    let from = path.parent().unwrap_or(Path::new("."));
    let mut station = assembled(&setup_args(settings), &lints, from, &mut sources, &mut renderer);
    // Where the server was started says nothing about the program, and a call leads to no file that the user did not name.
    station.setup.base = Some(from.to_path_buf());
    station.setup.confined = Some(settings.folders.clone());
    (station, sources, renderer.into_collected())
}

/// The same again, of a station that was made for the server.
fn own(station: &Station) -> Option<&crate::setup::Station> {
    station.own.as_ref()?.downcast_ref()
}

impl Host for Editor {
    fn station(&self, path: &Path, settings: &Settings) -> Station {
        let (station, sources, found) = own_station(path, settings);
        let project = station.project.as_ref().and_then(|p| Some((p.path.clone(), crate::sources::read_setup(&p.path).ok()?.text)));
        let (mut placed_found, mut said) = (Vec::new(), Vec::new());
        for d in found {
            let own = sources.get(d.primary().0).filter(|f| Path::new(&f.name).is_file());
            // A file that is not there, a name that does not exist: told where the project names it, or else it stands
            // in the settings.
            let project = || project.as_ref().and_then(|(path, text)| Some((path, text, named_in(text, &d)?)));
            match (own, project()) {
                (Some(file), _) => placed_found.push((file.name.clone().into(), file.text.to_string(), d)),
                (None, Some((path, text, place))) => placed_found.push((path.clone(), text.clone(), placed(d, place))),
                (None, None) => said.push(d.message),
            }
        }
        let chosen = settings.dialect.as_deref().and_then(gr_spec::Dialect::find);
        let shared = Arc::new(station);
        let of = shared.clone();
        Station {
            setup: shared.setup.clone(),
            strict: shared.lints.strict,
            allow: shared.lints.allow.clone(),
            warn: shared.lints.warn.clone(),
            deny: shared.lints.deny.clone(),
            // What the file or the project says goes before the setting; the ending of its name comes last.
            dialect_of: Arc::new(move |path, text| {
                let said = modeline(text).is_some() || of.project.as_ref().is_some_and(|p| p.dialect_of(path).is_some());
                chosen.filter(|_| !said).unwrap_or_else(|| of.dialect_of(path, text))
            }),
            machine: shared.machine.clone().map(Arc::new),
            step_units: shared.step_units.map(|u| match u {
                gr_planner::Units::Iso => gr_lsp::host::StepUnits::Iso,
                gr_planner::Units::StepModeler => gr_lsp::host::StepUnits::StepModeler,
            }),
            stock: shared.stock,
            files: shared.files.clone(),
            found: placed_found,
            said,
            own: Some(shared),
        }
    }

    fn undeclared(&self, path: &Path, text: &str, settings: &Settings) -> bool {
        settings.dialect.is_none() && own_station(path, settings).0.undeclared(path, text)
    }

    fn check_project(&self, path: &Path, text: &str) -> Vec<Diagnostic> {
        let project = match Project::parse(path, FileId(0), text) {
            Ok(project) => project,
            Err(d) => return vec![*d],
        };
        let mut found = project.faults(FileId(0), text);
        // What its names lead to: machines and files that are not there. As it is on disk.
        let (on_disk, sources, more) = own_station(path, &Settings::default());
        let told = on_disk.project.and_then(|p| Some(p.faults(FileId(0), &crate::sources::read_setup(path).ok()?.text))).unwrap_or_default();
        let own = |d: &Diagnostic| told.iter().any(|t| (t.code, &t.message) == (d.code, &d.message));
        let here = |d: &Diagnostic| sources.get(d.primary().0).is_none_or(|f| Path::new(&f.name) == path || f.text.is_empty());
        found.extend(more.into_iter().filter(|d| here(d) && !own(d)).map(|d| match named_in(text, &d) {
            Some(place) => placed(d, place),
            None => d,
        }));
        found
    }

    fn check_exchange(&self, path: &Path, text: &str, station: &Station) -> Vec<Diagnostic> {
        match own(station) {
            Some(own) => crate::exchange::check(&path.display().to_string(), &text.into(), path, own).found,
            None => gr_step::diagnostics(text, FileId(0)),
        }
    }

    fn plan(&self, path: &Path, text: &str, station: &Station) -> Option<Plan> {
        let unit = Unit::new(path, text.into(), Encoding::Utf8, own(station)?);
        let (made, _) = motion(&unit, None).ok()?;
        let tools = crate::emit::tool_rows(&made, &unit);
        Some(Plan { tools, stock: made.plan.and_then(|p| p.stock), program: made.program })
    }

    fn units_are_open(&self, text: &str) -> bool {
        gr_planner::process(text.as_bytes(), FileId(0), None).2.iter().any(|d| d.code == gr_spec::code::PLAN_UNITS_OPEN)
    }

    fn output(&self, job: &OutputJob<'_>) -> Result<Made, String> {
        if gr_spec::TargetDef::find(job.target).is_none() {
            return Err(format!("there is no target {}", job.target));
        }
        let options = options(job)?;
        let other = job.machine.map(|machine| {
            let settings = Settings { machine: Some(machine.to_string()), ..job.settings.clone() };
            own_station(job.path, &settings).0
        });
        let station = other.as_ref().or_else(|| own(job.station)).ok_or("the folder of the program is not known")?;
        if let Some(machine) = job.machine
            && station.machine.is_none()
        {
            return Err(format!("the machine {machine} can't be read"));
        }
        let unit = Unit::new(job.path, job.text.clone(), Encoding::Utf8, station);
        if job.target == "canon" && !unit.exchange {
            return Ok(canon(job, &unit));
        }
        let goal = Goal { target: job.target, options: &options, machine: station.machine.as_ref(), from_line: None, file: None };
        match build(&unit, &goal) {
            Err(checked) => Ok(Made { files: Vec::new(), found: checked.found }),
            Ok(Err(mistake)) => Err(mistake),
            Ok(Ok((built, checked))) => Ok(made(job, built, checked.found)),
        }
    }
}

/// Canonical calls, each with the line it comes from.
fn canon(job: &OutputJob<'_>, unit: &Unit) -> Made {
    let printer = Printer::new(Vec::new(), crate::setup::version_of(unit.setup.dialect));
    match run(unit, Mapped { printer, lines: Vec::new(), callers: BTreeMap::new() }) {
        Err(checked) => Made { files: Vec::new(), found: checked.found },
        Ok((mapped, _, checked)) => {
            let artifact = Artifact { lines: mapped.lines, ..Artifact::new("", mapped.printer.into_inner()) };
            made(job, Built { artifacts: vec![artifact], ..Built::default() }, checked.found)
        }
    }
}

/// Notes for every call that is printed which line of the program asked for it.
struct Mapped {
    printer: Printer<Vec<u8>>,
    lines: Vec<u32>,
    /// Line of the main file that a call leads back to.
    callers: BTreeMap<FrameId, u32>,
}

impl Sink for Mapped {
    fn call(&mut self, at: &At<'_>, call: &Call) {
        self.printer.call(at, call);
        let line = if at.file == FileId(0) { at.line } else { self.callers.get(&at.frame).copied().unwrap_or(u32::MAX) };
        self.lines.resize(usize::try_from(self.printer.count()).unwrap_or(self.lines.len()), line);
    }
    fn frame(&mut self, id: FrameId, frame: &CallFrame) {
        let line = if frame.file == FileId(0) { Some(frame.line) } else { self.callers.get(&frame.parent).copied() };
        if let Some(line) = line {
            self.callers.insert(id, line);
        }
        self.printer.frame(id, frame);
    }
    fn mark(&mut self, at: &At<'_>, mark: &Mark) {
        self.printer.mark(at, mark);
    }
    fn print(&mut self, text: &str) {
        self.printer.print(text);
    }
}

/// Options of targets, read as the command reads them.
fn options(job: &OutputJob<'_>) -> Result<TargetOptions, String> {
    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        target: TargetOptions,
    }
    let words = job.options.iter().map(|(name, value)| if value.is_empty() { format!("--{name}") } else { format!("--{name}={value}") });
    let parsed = Only::try_parse_from(std::iter::once("output".to_string()).chain(words));
    parsed.map(|o| o.target).map_err(|e| e.to_string().lines().next().unwrap_or("").trim_start_matches("error: ").to_string())
}

fn made(job: &OutputJob<'_>, built: Built, mut found: Vec<Diagnostic>) -> Made {
    found.extend(built.found);
    let extension = gr_spec::TargetDef::find(job.target).map_or("txt", |t| t.extension);
    let name = stem(job.path);
    let file = |a: Artifact| MadeFile {
        name: match a.name {
            Some(own) => own,
            None if a.suffix.is_empty() => format!("{name}.{extension}"),
            None => format!("{name}{}", a.suffix),
        },
        bytes: a.bytes,
        lines: a.lines,
    };
    let mut files: Vec<MadeFile> = built.artifacts.into_iter().map(file).collect();
    // Where there are several, the one that holds the program comes first.
    files.sort_by_key(|f| std::cmp::Reverse(f.lines.iter().filter(|l| **l != u32::MAX).count()));
    Made { files, found }
}
