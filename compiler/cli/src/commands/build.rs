//! `gcc-robot build`

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use clap::Parser as _;
use gr_spec::TargetDef;
use gr_text::{Diagnostic, Severity, code};

use super::check::{Checked, show};
use super::complain;
use crate::emit::{Artifact, Built, Goal, TargetOptions, build, stem};
use crate::exit::Exit;
use crate::options::{BuildArgs, Global};
use crate::output::{Pending, depfile, from_here, same_file, to_stdout, write_with};
use crate::pipeline::load;
use crate::progress::Progress;
use crate::project::Project;
use crate::render::Renderer;
use crate::setup::{Station, Stations, station};
use crate::sources::{Sources, reason};

/// How often `--watch` looks.
const POLL: Duration = Duration::from_millis(250);

pub fn run(global: &Global, args: &BuildArgs) -> Exit {
    let mut begun = SystemTime::now();
    let mut round = Round::new(global, args).run();
    // A wrong command line stays wrong.
    if !args.watch || round.exit == Exit::Usage {
        return round.exit;
    }
    loop {
        if !global.quiet {
            let count = round.files.len();
            eprintln!("watching {count} file{}; Ctrl-C ends", if count == 1 { "" } else { "s" });
        }
        let seen = stamps(&round);
        // What changed during the round may have been read before that.
        let late = begun..=SystemTime::now();
        if !seen.values().flatten().any(|t| late.contains(t)) {
            let mut looks = 0_u32;
            while stamps(&round) == seen {
                std::thread::sleep(POLL);
                looks += 1;
                // Patterns of a project are looked up less often: they walk through folders.
                if looks % 4 == 0 && round.project.as_ref().is_some_and(|p| listed(p, args) != round.listed) {
                    break;
                }
            }
        }
        begun = SystemTime::now();
        round = Round::new(global, args).run();
    }
}

/// What the patterns of a project name now.
fn listed(project: &Project, args: &BuildArgs) -> BTreeSet<PathBuf> {
    rows(project, args).flat_map(|(_, _, patterns)| project.files(patterns).0).collect()
}

/// The results that are asked for, each with the patterns of its sources.
fn rows<'p>(project: &'p Project, args: &'p BuildArgs) -> impl Iterator<Item = (usize, &'p crate::project::Target, &'p [String])> {
    let asked = project.file.targets.iter().enumerate().filter(|(_, t)| args.target.as_ref().is_none_or(|id| *id == t.target));
    asked.map(|(i, t)| (i, t, if t.sources.is_empty() { &project.file.project.sources[..] } else { &t.sources[..] }))
}

/// When files were changed last; a file that is not there has no time.
fn stamps(round: &Ended) -> BTreeMap<&PathBuf, Option<SystemTime>> {
    round.files.iter().chain(&round.sought).map(|f| (f, std::fs::metadata(f).and_then(|m| m.modified()).ok())).collect()
}

/// One thing to make.
struct Job<'s> {
    source: PathBuf,
    /// What it is run with.
    station: &'s Station,
    target: &'static TargetDef,
    options: TargetOptions,
    /// None: standard output.
    goal: Option<PathBuf>,
    /// The row of a project's targets that asks for it.
    row: Option<usize>,
}

/// What a round of building came to.
struct Ended {
    exit: Exit,
    files: Vec<PathBuf>,
    /// Files of subroutines that may be there or not: the result is another when one comes or goes.
    sought: Vec<PathBuf>,
    /// The project that was built as a whole, and the sources that its patterns named.
    project: Option<Project>,
    listed: BTreeSet<PathBuf>,
}

/// One round of building: everything is made, or nothing is written.
struct Round<'a> {
    global: &'a Global,
    args: &'a BuildArgs,
    renderer: Renderer,
    sources: Sources,
    exit: Exit,
    files: Vec<PathBuf>,
    sought: Vec<PathBuf>,
    listed: BTreeSet<PathBuf>,
    results: Vec<(PathBuf, Vec<u8>)>,
    /// Findings that were shown: several targets of one program find the same.
    told: Vec<(PathBuf, Diagnostic)>,
    /// Results that are written beside their goals already.
    written: Vec<(PathBuf, Pending)>,
    rules: String,
    /// Folder and name of robot programs made so far, and what they are made of.
    names: BTreeMap<(PathBuf, String), PathBuf>,
}

impl<'a> Round<'a> {
    fn new(global: &'a Global, args: &'a BuildArgs) -> Round<'a> {
        let to_stdout = !args.files.is_empty() && args.output.as_deref().is_none_or(|o| o == Path::new("-"));
        Round {
            global,
            args,
            renderer: global.renderer(to_stdout),
            sources: Sources::default(),
            exit: Exit::Ok,
            files: args.files.clone(),
            sought: Vec::new(),
            listed: BTreeSet::new(),
            results: Vec::new(),
            told: Vec::new(),
            written: Vec::new(),
            rules: String::new(),
            names: BTreeMap::new(),
        }
    }

    fn run(mut self) -> Ended {
        let from = self.args.project.as_deref().unwrap_or(Path::new("."));
        if self.args.project.is_some() && !from.join(crate::project::NAME).is_file() {
            eprintln!("there is no {} in {}", crate::project::NAME, from.display());
            self.fail(Exit::Usage);
            return self.end(false, None);
        }
        let mut setup = self.args.setup.clone();
        if self.args.options.reference == Some(crate::emit::Reference::Ufmg2008) {
            // The reference mode chooses the dialect too.
            setup.dialect.get_or_insert_with(|| "ufmg2008".into());
        }
        let named = !self.args.files.is_empty() && self.args.project.is_none();
        let found = if named {
            Stations::of(&setup, &self.args.lints, &self.args.files, &mut self.sources, &mut self.renderer)
        } else {
            let one = station(&setup, &self.args.lints, from, &mut self.sources, &mut self.renderer);
            one.map(|s| Stations::one(s, self.args.files.len()))
        };
        let Some(mut stations) = found else {
            self.fail(self.renderer.failed());
            return self.end(false, None);
        };
        stations.iter_mut().for_each(|s| s.take_job(self.args.options.robot.job.as_deref()));
        self.files.extend(stations.iter().flat_map(|s| s.files.iter().cloned()));
        match self.jobs(&stations) {
            Ok(jobs) => {
                self.renderer.tally.files = jobs.iter().map(|j| &j.source).collect::<BTreeSet<_>>().len();
                for job in &jobs {
                    self.job(job, job.station);
                }
                if self.exit == Exit::Ok {
                    self.write();
                }
            }
            Err(text) => {
                eprintln!("{text}");
                self.fail(Exit::Usage);
            }
        }
        let whole = self.args.files.is_empty();
        let project = stations.iter_mut().find_map(|s| s.project.take()).filter(|_| whole);
        self.end(true, project)
    }

    fn end(mut self, ran: bool, project: Option<Project>) -> Ended {
        crate::output::drop_all(std::mem::take(&mut self.written));
        let something = self.renderer.tally.errors + self.renderer.tally.warnings > 0;
        self.renderer.finish(ran && something && !self.global.quiet);
        Ended { exit: self.exit, files: self.files, sought: self.sought, project, listed: self.listed }
    }

    fn fail(&mut self, exit: Exit) {
        self.exit = self.exit.max(exit);
    }

    /// What the options can't do together.
    fn misused(&self) -> Option<&'static str> {
        let a = self.args;
        if a.files.is_empty() {
            let target_options = !crate::emit::given(&a.options).is_empty();
            return if a.output.is_some() {
                Some("-o goes with programs named on the command line; in a project the [[targets]] say where results go")
            } else if target_options {
                Some("options of targets go with programs named on the command line; in a project they stand in its [[targets]]")
            } else if a.from_line.is_some() {
                Some("--from-line goes with one program named on the command line")
            } else {
                None
            };
        }
        let to_stdout = a.output.as_deref().is_none_or(|o| o == Path::new("-"));
        if a.depfile.is_some() && to_stdout {
            return Some("--depfile names the file that is made: it goes with -o FILE");
        }
        if a.watch && a.files.iter().any(|f| f == Path::new("-")) {
            return Some("--watch can't watch standard input");
        }
        (a.from_line.is_some() && a.files.len() > 1).then_some("--from-line goes with one program")
    }

    fn jobs<'s>(&mut self, stations: &'s Stations) -> Result<Vec<Job<'s>>, String> {
        if let Some(why) = self.misused() {
            return Err(why.into());
        }
        if self.args.files.is_empty() {
            let of_project = stations.iter().find_map(|s| Some((s, s.project.as_ref()?)));
            let Some((station, project)) = of_project else {
                return Err(format!("name the programs to build, or add them to {}", crate::project::NAME));
            };
            return self.project_jobs(station, project);
        }
        let target = target(self.args.target.as_deref().unwrap_or("rs274ngc"))?;
        let several = self.args.files.len() > 1;
        let out = self.args.output.as_deref().filter(|o| *o != Path::new("-"));
        if several && out.is_none_or(|o| !is_folder(o)) {
            return Err("several programs need a folder: -o FOLDER/".into());
        }
        let job = |(n, source): (usize, &PathBuf)| {
            let station = stations.get(n)?;
            let mut options = self.args.options.clone();
            options.reference = options.reference.or(station.project.as_ref().and_then(|p| p.file.project.reference));
            let goal = out.map(|o| if is_folder(o) { o.join(file_name(source, target, station, &options)) } else { o.to_path_buf() });
            Some(Job { source: source.clone(), station, target, options, goal, row: None })
        };
        Ok(self.args.files.iter().enumerate().filter_map(job).collect())
    }

    fn project_jobs<'s>(&mut self, station: &'s Station, project: &Project) -> Result<Vec<Job<'s>>, String> {
        let mut jobs = Vec::new();
        if project.file.targets.is_empty() {
            self.fault(project, None, "there are none; each row says what to make: `target = \"rs274ngc\"`".into());
            return Ok(jobs);
        }
        if let Some(id) = self.args.target.as_ref().filter(|id| !project.file.targets.iter().any(|t| t.target == **id)) {
            target(id)?;
            return Err(format!("{} has no [[targets]] entry for {id}", project.path.display()));
        }
        for (index, row, patterns) in rows(project, self.args) {
            let target = target(&row.target)?;
            let mut options = options_of(&row.options).map_err(|e| format!("{}: target {}: {e}", project.path.display(), row.target))?;
            options.reference = options.reference.or(project.file.project.reference);
            options.reference_config = options.reference_config.map(|p| project.path_of(&p));
            options.robot.job = options.robot.job.map(|p| project.path_of(&p));
            let (sources, closed) = project.files(patterns);
            if !closed.is_empty() {
                super::unreadable(&closed, &mut self.sources, &mut self.renderer);
                self.fail(Exit::Io);
            } else if sources.is_empty() {
                let name = project.path.display().to_string();
                complain(&mut self.renderer, &mut self.sources, &name, code::PROJECT_NOTHING_TO_DO, std::slice::from_ref(&name));
                self.fail(Exit::Findings);
            }
            for source in sources {
                let output = row.output.as_deref().unwrap_or("{name}.{extension}");
                let name = output.replace("{name}", &stem(&source)).replace("{extension}", target.extension);
                self.files.push(source.clone());
                self.listed.insert(source.clone());
                jobs.push(Job { source, station, target, options: options.clone(), goal: Some(project.path_of(Path::new(&name))), row: Some(index) });
            }
        }
        Ok(jobs)
    }

    /// A fault of the project file's targets: of one row, or of all.
    fn fault(&mut self, project: &Project, row: Option<usize>, why: String) {
        use crate::project::{Step, place};
        let text = std::fs::read_to_string(&project.path).unwrap_or_default();
        let steps = [Step::Key("targets"), Step::Index(row.unwrap_or_default())];
        let span = place(&text, &steps[..1 + usize::from(row.is_some())]);
        let mut sources = Sources::default();
        let file = sources.add(project.path.display().to_string(), text);
        self.renderer.forget();
        self.renderer.show(&sources, &Diagnostic::new(code::PROJECT_TARGET, file, span, &[why]));
        self.fail(Exit::Findings);
    }

    /// What can't be made: by the command line, or by the project's row.
    fn refused(&mut self, job: &Job<'_>, why: String) {
        match (job.row, &job.station.project) {
            (Some(row), Some(project)) => self.fault(project, Some(row), why),
            _ => {
                eprintln!("{why}");
                self.fail(Exit::Usage);
            }
        }
    }

    fn job(&mut self, job: &Job<'_>, station: &Station) {
        let progress = Progress::new(self.global.quiet, format!("building {} ({})", job.source.display(), job.target.id));
        let from_line = self.args.from_line.map(|l| (l, self.args.safe_z));
        let file = job.goal.clone().unwrap_or_else(|| std::env::temp_dir().join("gcc-robot"));
        let goal = Goal { target: job.target.id, options: &job.options, machine: station.machine.as_ref(), from_line, file: Some(&file) };
        let made = load(&job.source, station).and_then(|unit| build(&unit, &goal));
        drop(progress);
        match made {
            Ok(Ok((built, checked))) => {
                self.show_new(job, checked);
                self.keep(job, station, built);
            }
            Ok(Err(text)) => self.refused(job, text),
            Err(checked) => {
                self.sought.extend(checked.sought.iter().cloned());
                self.fail(if checked.unreadable { Exit::Io } else { Exit::Findings });
                self.show_new(job, checked);
            }
        }
    }

    /// Shows findings that no other target of the program had.
    fn show_new(&mut self, job: &Job<'_>, mut checked: Checked) {
        let told = &self.told;
        checked.found.retain(|d| !told.iter().any(|(path, t)| *path == job.source && t == d));
        show(&mut self.renderer, &checked);
        self.told.extend(checked.found.into_iter().map(|d| (job.source.clone(), d)));
    }

    /// Keeps a result for writing.
    fn keep(&mut self, job: &Job<'_>, station: &Station, mut built: Built) {
        built.found.iter_mut().for_each(|d| station.lints.harden(d));
        let bad = built.found.iter().any(|d| d.severity == Severity::Error);
        let checked = Checked { sources: built.sources, found: built.found, ..Checked::nothing() };
        self.show_new(job, checked);
        if bad {
            return self.fail(Exit::Findings);
        }
        if let Some(summary) = built.summary.filter(|_| !self.global.quiet) {
            eprint!("{summary}");
        }
        self.files.extend(built.subs.iter().cloned());
        self.sought.extend(built.missing);
        let Some(goal) = &job.goal else {
            let others: Vec<String> = built.artifacts.iter().skip(1).map(|a| a.name.clone().unwrap_or_else(|| format!("*{}", a.suffix))).collect();
            if !others.is_empty() && !self.global.quiet {
                eprintln!("only the first file is shown; -o FILE writes {} too", others.join(", "));
            }
            if let Some(main) = built.artifacts.into_iter().next() {
                self.results.push((PathBuf::from("-"), main.bytes));
            }
            self.written.extend(built.written.map(|p| (PathBuf::from("-"), p)));
            return;
        };
        let mut read = vec![job.source.clone()];
        read.extend(station.files.iter().chain(&built.subs).cloned());
        let beside = |a: &Artifact| goal.with_file_name(format!("{}{}", stem(goal), a.suffix));
        let path_of = |a: &Artifact| match &a.name {
            Some(name) => goal.with_file_name(name),
            None if a.suffix.is_empty() => goal.clone(),
            None => beside(a),
        };
        let mut goals: Vec<PathBuf> = built.artifacts.iter().map(path_of).collect();
        if built.written.is_some() {
            goals.insert(0, goal.clone());
        }
        if crate::robot::is_language(job.target.id) && !self.names_free(&goals, &job.source) {
            return self.fail(Exit::Findings);
        }
        let taken = |g: &&PathBuf| self.args.depfile.as_ref() == Some(*g) || self.results.iter().map(|(p, _)| p).chain(self.written.iter().map(|(p, _)| p)).any(|p| p == *g);
        if let Some(twice) = goals.iter().find(taken) {
            let why = format!("two results would both be written to {}: give them different names or folders", twice.display());
            return self.refused(job, why);
        }
        let all = goals.iter().chain(&self.args.depfile);
        if let Some(same) = read.iter().find(|r| all.clone().any(|g| same_file(r, g))) {
            let name = same.display().to_string();
            complain(&mut self.renderer, &mut self.sources, &name, code::FILE_OVERWRITES_SOURCE, std::slice::from_ref(&name));
            return self.fail(Exit::Findings);
        }
        // A project names its files itself; those of the command line stay as they are.
        let named = |paths: &[PathBuf]| match self.args.files.is_empty() {
            true => paths.iter().map(|p| from_here(p)).collect(),
            false => paths.to_vec(),
        };
        self.rules.push_str(&depfile(&named(&goals), &named(&read)));
        self.written.extend(built.written.map(|p| (goal.clone(), p)));
        for artifact in built.artifacts {
            self.results.push((path_of(&artifact), artifact.bytes));
        }
    }

    /// Names of programs on a controller: capitals don't tell them apart.
    fn names_free(&mut self, goals: &[PathBuf], source: &Path) -> bool {
        let mut free = true;
        for goal in goals {
            let name = goal.file_name().map(|n| n.to_string_lossy().to_uppercase()).unwrap_or_default();
            let key = (goal.parent().map(Path::to_path_buf).unwrap_or_default(), name);
            match self.names.get(&key) {
                Some(other) if other != source => {
                    let args = [stem(goal), other.display().to_string(), source.display().to_string()];
                    complain(&mut self.renderer, &mut self.sources, &source.display().to_string(), code::VENDOR_NAME_TAKEN, &args);
                    free = false;
                }
                _ => {
                    self.names.insert(key, source.to_path_buf());
                }
            }
        }
        free
    }

    /// Everything is made: writes it.
    fn write(&mut self) {
        if let Some(path) = &self.args.depfile {
            self.results.push((path.clone(), std::mem::take(&mut self.rules).into_bytes()));
        }
        let results = std::mem::take(&mut self.results);
        let (stdout, files): (Vec<_>, Vec<_>) = results.into_iter().partition(|(p, _)| p == Path::new("-"));
        let written = std::mem::take(&mut self.written);
        let (spooled, beside): (Vec<_>, Vec<_>) = written.into_iter().partition(|(p, _)| p == Path::new("-"));
        let names: Vec<PathBuf> = files.iter().map(|(p, _)| p.clone()).chain(beside.iter().map(|(p, _)| p.clone())).collect();
        let beside = beside.into_iter().map(|(_, p)| p).collect();
        let written = write_with(&files, beside)
            .and_then(|()| stdout.iter().try_for_each(|(p, b)| to_stdout(b).map_err(|e| (p.clone(), e))))
            .and_then(|()| spooled.into_iter().try_for_each(|(path, p)| p.to_stdout().map_err(|e| (path, e))));
        match written {
            Ok(()) if !self.global.quiet && self.args.files.is_empty() => {
                names.iter().for_each(|p| eprintln!("built {}", from_here(p).display()));
            }
            Ok(()) => {}
            Err((path, e)) => {
                let name = path.display().to_string();
                complain(&mut self.renderer, &mut self.sources, &name, code::FILE_UNWRITABLE, &[name.clone(), reason(&e)]);
                self.fail(Exit::Io);
            }
        }
    }
}

fn target(id: &str) -> Result<&'static TargetDef, String> {
    super::target::ready().find(|t| t.id == id).ok_or_else(|| {
        let all: Vec<&str> = super::target::ready().map(|t| t.id).collect();
        format!("there is no target {id}; choose one of {}", all.join(", "))
    })
}

fn is_folder(path: &Path) -> bool {
    path.is_dir() || path.to_string_lossy().ends_with(['/', std::path::MAIN_SEPARATOR])
}

/// What a result is called in a folder. The interface of the planar arm saves the joints of `part.g` as `part - juntas.g` (UFMG 2008).
fn file_name(source: &Path, target: &TargetDef, station: &Station, options: &TargetOptions) -> String {
    let joints = target.id == "joint-gcode" && !crate::robot::planned(options, station.machine.as_ref());
    format!("{}{}.{}", stem(source), if joints { " - juntas" } else { "" }, target.extension)
}

/// Options of a target in the project file, read like those of the command line.
/// Options of a target as a project file has them.
pub fn options_of(table: &toml::Table) -> Result<TargetOptions, String> {
    #[derive(clap::Parser)]
    #[command(no_binary_name = true, disable_help_flag = true)]
    struct Line {
        #[command(flatten)]
        options: TargetOptions,
    }
    let mut line = Vec::new();
    for (key, value) in table {
        match value {
            toml::Value::Boolean(true) => line.push(format!("--{key}")),
            toml::Value::Boolean(false) => {}
            toml::Value::String(s) => line.push(format!("--{key}={s}")),
            other => line.push(format!("--{key}={other}")),
        }
    }
    Line::try_parse_from(line).map(|l| l.options).map_err(|e| {
        let text = e.to_string();
        text.lines().next().unwrap_or("").trim_start_matches("error: ").to_string()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_the_project() {
        let table: toml::Table = "decimals = 3\nrepeat-words = true\nunits = 'inch'\narc-tolerance = 0.01\n".parse().unwrap();
        let o = options_of(&table).unwrap();
        assert_eq!((o.decimals, o.repeat_words, o.arc_tolerance), (Some(3), true, Some(0.01)));
        assert!(options_of(&"decimal = 3\n".parse().unwrap()).is_err());
        assert!(options_of(&"decimals = 'x'\n".parse().unwrap()).is_err());
    }
}
