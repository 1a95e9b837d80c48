//! From options, project file and the files they name to what a run of the interpreter starts from.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gr_canon::{Units, Version};
use gr_driver::{Level, Rules};
use gr_interp::Setup;
use gr_spec::Dialect;
use gr_text::{Code, Diagnostic, FileId, Severity, Span, code};

use crate::commands::complain;
use crate::options::{LintArgs, SetupArgs, UnitArg};
use crate::project::{Project, Step, lint, place};
use crate::render::{Renderer, Tally};
use crate::sources::{Sources, read_setup};

/// Everything a run needs that does not depend on the program.
pub struct Station {
    /// What the interpreter starts from; the dialect may still depend on the file.
    pub setup: Setup,
    /// How technology of STEP-NC files is read; none: as the standard says.
    pub step_units: Option<gr_planner::Units>,
    /// How their overlaps are read; none: as their units say.
    pub step_overlap: Option<gr_planner::Overlap>,
    /// Raw part of G-code programs: smallest and largest X Y Z, mm, for pictures.
    pub stock: Option<[[f64; 3]; 2]>,
    /// The machine's tool table, if one was named.
    pub tools: Option<PathBuf>,
    /// Asked for by an option.
    pub dialect: Option<&'static Dialect>,
    /// The machine, if one was named.
    pub machine: Option<gr_machine::Machine>,
    /// Job file that `check` was given.
    pub job: Option<PathBuf>,
    /// Files it was made of, for dep-files and `--watch`.
    pub files: Vec<PathBuf>,
    /// Project file, if one was found.
    pub project: Option<Project>,
    /// How severe lints are.
    pub lints: Levels,
}

/// Severity of lints as options and project want it.
#[derive(Clone, Debug, Default)]
pub struct Levels {
    /// Warnings count as errors.
    pub strict: bool,
    /// Never mentioned.
    pub allow: Vec<Code>,
    /// Mentioned although off by default.
    pub warn: Vec<Code>,
    /// Errors.
    pub deny: Vec<Code>,
}

impl Levels {
    /// As rules for the driver.
    pub fn put_into(&self, rules: &mut Rules) {
        self.warn.iter().for_each(|c| rules.set(*c, Level::Warning));
        self.deny.iter().for_each(|c| rules.set(*c, Level::Error));
        self.allow.iter().for_each(|c| rules.set(*c, Level::Off));
    }
    /// The severity that a finding has in the end.
    pub fn harden(&self, d: &mut Diagnostic) {
        d.severity = self.severity(d.severity);
    }
    fn severity(&self, severity: Severity) -> Severity {
        if self.strict && severity == Severity::Warning { Severity::Error } else { severity }
    }
    /// Findings that are only counted.
    pub fn tally(&self, unlisted: &gr_driver::Unlisted) -> Tally {
        let mut tally = Tally::default();
        unlisted.iter().for_each(|((_, severity), n)| tally.add(self.severity(*severity), *n));
        tally
    }
}

/// Reads all files that the options and the project name. Findings go to `renderer`; none when there are errors.
pub fn station(
    args: &SetupArgs,
    lints: &LintArgs,
    from: &Path,
    sources: &mut Sources,
    renderer: &mut Renderer,
) -> Option<Station> {
    let errors = renderer.tally.errors;
    let station = assembled(args, lints, from, sources, renderer);
    (renderer.tally.errors == errors).then_some(station)
}

/// The folder from which upwards the project file of a program is looked for: its own, wherever the command runs.
pub fn beside(program: &Path) -> &Path {
    program.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Programs that were named: what each is run with. Those of one project share one station.
pub struct Stations {
    all: Vec<Station>,
    of: Vec<usize>,
}

impl Stations {
    /// As [`station`], for several programs.
    pub fn of(args: &SetupArgs, lints: &LintArgs, programs: &[PathBuf], sources: &mut Sources, renderer: &mut Renderer) -> Option<Stations> {
        let (mut all, mut of, mut known) = (Vec::new(), Vec::new(), BTreeMap::new());
        let mut projects: BTreeMap<&Path, Option<PathBuf>> = BTreeMap::new();
        for program in programs {
            let from = beside(program);
            let project = projects.entry(from).or_insert_with(|| Project::find(from));
            let at = match known.get(project) {
                Some(at) => *at,
                None => {
                    all.push(station(args, lints, from, sources, renderer)?);
                    known.insert(project.clone(), all.len() - 1);
                    all.len() - 1
                }
            };
            of.push(at);
        }
        Some(Stations { all, of })
    }
    /// One for all: programs that a project names.
    pub fn one(station: Station, programs: usize) -> Stations {
        Stations { all: vec![station], of: vec![0; programs] }
    }
    /// Of the program with this number.
    pub fn get(&self, program: usize) -> Option<&Station> {
        self.all.get(*self.of.get(program)?)
    }
    /// Each once.
    pub fn iter(&self) -> impl Iterator<Item = &Station> {
        self.all.iter()
    }
    /// The same, to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Station> {
        self.all.iter_mut()
    }
}

/// The same as [`station`], as far as it goes: what could not be read is left out.
pub fn assembled(args: &SetupArgs, lints: &LintArgs, from: &Path, sources: &mut Sources, renderer: &mut Renderer) -> Station {
    let mut reader = Reader { sources, renderer, files: Vec::new(), project: None, blamed: None, ini: None, hard: Levels::default() };
    let project = reader.project(from);
    let section = project.as_ref().map(|p| &p.file.project);
    let mut lints = reader.levels(lints, project.as_ref());
    reader.hard = lints.clone();
    let named = |option: &Option<PathBuf>, key: Option<&PathBuf>| {
        option.clone().or_else(|| key.map(|k| project.as_ref().map_or(k.clone(), |p| p.path_of(k))))
    };
    let mut setup = Setup { base: own_folder(&from.join("-")), ..Setup::default() };
    reader.named_as(args.ini.is_none(), "ini");
    if let Some(path) = named(&args.ini, section.and_then(|s| s.ini.as_ref())) {
        reader.ini(&path, &mut setup);
    }
    setup.machine_units = units(args, section).or(setup.ini.machine_units()).unwrap_or(Units::Mm);
    reader.named_as(args.tools.is_none(), "tools");
    let tools = named(&args.tools, section.and_then(|s| s.tools.as_ref())).or_else(|| ini_path(&setup, "EMCIO", "TOOL_TABLE"));
    if let Some(path) = &tools {
        reader.tools(path, &mut setup);
    } else {
        reader.no_table(&setup);
        setup.tools = gr_interp::assumed_tools();
    }
    reader.named_as(args.vars.is_none(), "vars");
    if let Some(path) = named(&args.vars, section.and_then(|s| s.vars.as_ref())).or_else(|| ini_path(&setup, "RS274NGC", "PARAMETER_FILE")) {
        reader.vars(&path, &mut setup);
    }
    setup.block_delete = args.block_delete || section.is_some_and(|s| s.block_delete);
    reader.named_as(args.subs.is_empty(), "subs");
    for folder in subs(args, project.as_ref(), &mut setup) {
        reader.no_folder(&folder);
    }
    reader.blamed = None;
    // A reference mode has its own language.
    let reference = section.and_then(|s| s.reference).filter(|r| *r == crate::emit::Reference::Ufmg2008).map(|_| "ufmg2008");
    let dialect = args.dialect.as_deref().or(reference).and_then(|name| reader.dialect(name));
    reader.named_as(args.machine.is_none(), "machine");
    let machine = args.machine.clone().or_else(|| project.as_ref().and_then(Project::machine));
    let machine = machine.and_then(|name| reader.machine(&name));
    reader.blamed = None;
    if let Some(machine) = &machine {
        limits(machine, &mut setup);
        if tools.is_none() {
            machine_tools(machine, &mut setup);
        }
    }
    reader.startup(&setup);
    reader.remaps(&setup);
    if machine.as_ref().is_some_and(|m| m.kind == gr_machine::Kind::Robot) {
        // The tool point of a robot is the machine file's, with G43 and without; a tool it doesn't have is an error there.
        lints.allow.push(code::TOOL_NO_LENGTH_OFFSET);
    }
    let step_units = args.step_units.or(section.and_then(|s| s.step_units)).map(gr_planner::Units::from);
    let step_overlap = args.step_overlap.or(section.and_then(|s| s.step_overlap)).map(gr_planner::Overlap::from);
    let stock = section.and_then(|s| s.stock).map(|[a, b]| [std::array::from_fn(|i| a[i].min(b[i])), std::array::from_fn(|i| a[i].max(b[i]))]);
    let Reader { files, .. } = reader;
    Station { setup, stock, step_units, step_overlap, tools, dialect, machine, job: None, files, project, lints }
}

/// The folder of a program, in which its subroutines are looked for first; none = the current one.
fn own_folder(program: &Path) -> Option<PathBuf> {
    Some(beside(program)).filter(|f| *f != Path::new(".")).map(Path::to_path_buf)
}

fn units(args: &SetupArgs, section: Option<&crate::project::Section>) -> Option<Units> {
    args.machine_units.or(section.and_then(|s| s.machine_units)).map(|u| match u {
        UnitArg::Mm => Units::Mm,
        UnitArg::Inch => Units::Inch,
    })
}

/// A file that the INI file names, if it is there: a program can be checked without the machine's own files.
fn ini_path(setup: &Setup, section: &str, key: &str) -> Option<PathBuf> {
    let name = setup.ini.get(section, key)?;
    let path = setup.ini.folder.clone().unwrap_or_default().join(name);
    path.is_file().then_some(path)
}

/// Travel, speeds and accelerations of a machine, where the INI file does not say otherwise.
fn limits(machine: &gr_machine::Machine, setup: &mut Setup) {
    if machine.kind == gr_machine::Kind::Robot {
        // The file then is that of the mill the program was made for: its axes are not the robot's.
        let of_axes = |key: &str| ["min_limit", "max_limit", "max_velocity", "max_acceleration"].contains(&key);
        setup.ini.values.retain(|(section, key), _| !(section.starts_with("axis_") && of_axes(key)));
        return;
    }
    let elsewhere = gr_robot::opinion::is_elsewhere(machine);
    if elsewhere {
        // Its axes are not the coordinates of the program: the plan of its motion knows their limits.
        setup.ini.values.retain(|(section, key), _| !(section.starts_with("axis_") && ["min_limit", "max_limit"].contains(&key.as_str())));
    }
    // Limits of an INI file are in the unit that the file states.
    let scale = if setup.ini.machine_units() == Some(Units::Inch) { 25.4 } else { 1.0 };
    let travel = machine.travel().unwrap_or_default().into_iter().zip(machine.speeds().unwrap_or_default());
    let all: Vec<_> = travel.zip(machine.accelerations().unwrap_or_default()).collect();
    let along = gr_robot::opinion::axes_along(machine);
    for (i, axis) in "xyzabcuvw".chars().enumerate() {
        let own = if i < 3 { along.map(|a| a[i]) } else { Some(i) };
        let Some(own) = own else { continue };
        let (((min, max), (_, speed)), acceleration) = all[own];
        let shown = |v: f64| if (3..6).contains(&i) { v.to_degrees() } else { v / scale };
        let rows = [("min_limit", min), ("max_limit", max), ("max_velocity", speed), ("max_acceleration", acceleration)];
        for (key, value) in rows {
            if let Some(value) = value.filter(|_| !elsewhere || key.starts_with("max_v") || key.starts_with("max_a")) {
                let entry = setup.ini.values.entry((format!("axis_{axis}"), key.into())).or_default();
                if entry.is_empty() {
                    entry.push(shown(value).to_string());
                }
            }
        }
    }
}

/// Without a tool table a mill has the tools of its machine file; of others nothing is known. On a robot the tool's point is no
/// matter of G43.
fn machine_tools(machine: &gr_machine::Machine, setup: &mut Setup) {
    if machine.kind != gr_machine::Kind::Mill {
        return;
    }
    let scale = if setup.machine_units == Units::Inch { 25.4 } else { 1.0 };
    for row in setup.tools.rows.iter_mut().filter(|r| r.number > 0) {
        let Some(tool) = machine.cell.tools.get(&row.number.unsigned_abs()) else { continue };
        row.offset[2] = machine.tool_length(tool) / scale;
        row.diameter = tool.diameter.unwrap_or(0.0) / scale;
        row.comment = tool.name.as_str().into();
    }
}

/// Folders with subroutines come first on the INI file's own search path. Those that there are not are given back.
fn subs(args: &SetupArgs, project: Option<&Project>, setup: &mut Setup) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = args.subs.clone();
    folders.extend(project.iter().flat_map(|p| p.file.project.subs.iter().map(|s| p.path_of(s))));
    let mut path: Vec<String> =
        folders.iter().filter_map(|f| std::path::absolute(f).ok()).map(|f| f.to_string_lossy().into_owned()).collect();
    path.extend(setup.ini.get("RS274NGC", "SUBROUTINE_PATH").map(str::to_string));
    if !path.is_empty() {
        setup.ini.values.insert(("rs274ngc".into(), "subroutine_path".into()), vec![path.join(":")]);
    }
    folders.retain(|f| !f.is_dir());
    folders
}

impl Station {
    /// With the setups of a job file, which puts the part where limits of axes alone say nothing: the plan of its motion knows them.
    pub fn take_job(&mut self, job: Option<&Path>) {
        self.job = job.map(Path::to_path_buf);
        if job.is_some() && self.machine.is_some() {
            self.lints.allow.push(code::TRAVEL_BEYOND_LIMIT);
        }
    }
    /// The dialect of a file: option, modeline, project, extension, default. Faults are shown once by the caller.
    pub fn dialect_of(&self, path: &Path, text: &str) -> &'static Dialect {
        self.declared(path, text).unwrap_or_else(Dialect::linuxcnc)
    }
    /// The same without the default.
    fn declared(&self, path: &Path, text: &str) -> Option<&'static Dialect> {
        self.dialect
            .or_else(|| modeline(text))
            .or_else(|| self.project.as_ref().and_then(|p| p.dialect_of(path)).and_then(Dialect::find))
            .or_else(|| by_extension(path))
            .or_else(|| is_printer(path).then(|| recognised(text)).flatten())
    }
    /// A `.gcode` file of which nobody says what control it is for: mostly a printer's.
    pub fn undeclared(&self, path: &Path, text: &str) -> bool {
        is_printer(path) && self.declared(path, text).is_none()
    }
    /// The setup for a file.
    pub fn setup_for(&self, path: &Path, text: &str) -> Setup {
        let mut setup = self.setup.clone();
        setup.dialect = self.dialect_of(path, text);
        setup.version = version_of(setup.dialect);
        setup.base = own_folder(path);
        setup
    }
}

/// The spelling and behaviour that goes with a dialect.
pub fn version_of(dialect: &Dialect) -> Version {
    if dialect.id == "linuxcnc-2.10" { Version::V2_10 } else { Version::V2_9 }
}

/// `; gcc-robot: dialect=grbl` (or in parentheses) in one of the first five lines.
pub fn modeline(text: &str) -> Option<&'static Dialect> {
    text.lines().take(5).find_map(|line| {
        let (_, rest) = line.split_once("gcc-robot:")?;
        let (_, name) = rest.split_once("dialect=")?;
        let name: String = name.trim_start().chars().take_while(|c| c.is_alphanumeric() || "-.".contains(*c)).collect();
        Dialect::find(&name)
    })
}

/// Files of this ending come from slicers for printers, from CAM systems and from hand, for any control.
fn is_printer(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gcode"))
}

/// Lines of a program that tell what wrote it, or what it is for.
const HEAD_LINES: usize = 200;

/// Words of slicers in the first lines, or codes that only printers have.
pub fn is_for_a_printer(text: &str) -> bool {
    let slicers = ["slicer", "cura", "ideamaker", ";layer", "; layer", "simplify3d", "kisslicer"];
    text.lines().take(HEAD_LINES).any(|line| {
        let line = line.trim().to_ascii_lowercase();
        let comment = line.starts_with(';') && slicers.iter().any(|s| line.contains(s));
        let code = line.split([' ', ';']).next().unwrap_or("");
        comment || matches!(code, "m104" | "m109" | "m140" | "m190" | "m106" | "m107")
    })
}

/// The dialect of a program that tells it: a postprocessor's remark, or syntax that one control alone has.
fn recognised(text: &str) -> Option<&'static Dialect> {
    if is_for_a_printer(text) {
        return None;
    }
    for line in text.lines().take(HEAD_LINES) {
        let line = line.trim().to_ascii_lowercase();
        if line.starts_with(['(', ';']) {
            let named = [("linuxcnc", "linuxcnc"), ("emc2", "linuxcnc"), ("grbl", "grbl"), ("fanuc", "fanuc-mill")];
            if let Some((_, dialect)) = named.iter().find(|(word, _)| line.contains(word)) {
                return Dialect::find(dialect);
            }
        } else if line.contains("#<") || is_control(&line) {
            return Some(Dialect::linuxcnc());
        }
    }
    None
}

/// Whether a line begins with an O-word of LinuxCNC: `o100 sub`, `o<name> call`.
fn is_control(line: &str) -> bool {
    let Some(rest) = line.strip_prefix('o') else { return false };
    let word = match rest.strip_prefix('<').and_then(|r| r.split_once('>')) {
        Some((_, after)) => after,
        None => rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.'),
    };
    let keywords = ["sub", "call", "if", "while", "do", "repeat"];
    word.len() < rest.len() && keywords.iter().any(|k| word.trim_start().starts_with(k))
}

fn by_extension(path: &Path) -> Option<&'static Dialect> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    Dialect::all().iter().find(|d| d.extensions.contains(&extension.as_str()))
}

/// Whether a file in a folder is a program: by the extensions of all dialects, or of the one that was asked for;
/// STEP-NC files only where none was.
pub fn is_program(dialect: Option<&'static Dialect>) -> impl Fn(&Path) -> bool {
    let extensions: Vec<&str> = match dialect {
        Some(d) if !d.extensions.is_empty() => d.extensions.to_vec(),
        _ => Dialect::all().iter().flat_map(|d| d.extensions.iter().copied()).collect(),
    };
    move |path| {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        extensions.iter().any(|x| x.eq_ignore_ascii_case(ending)) || dialect.is_none() && crate::exchange::is_program(path)
    }
}

struct Reader<'a> {
    sources: &'a mut Sources,
    renderer: &'a mut Renderer,
    files: Vec<PathBuf>,
    /// The project file's text.
    project: Option<(FileId, String)>,
    /// The INI file's text.
    ini: Option<(FileId, String)>,
    /// Where the project names the file that is read now.
    blamed: Option<(FileId, Span)>,
    /// Warnings count as errors, here too.
    hard: Levels,
}

impl Reader<'_> {
    /// Reads a file; what is wrong with that is shown.
    fn text(&mut self, path: &Path) -> Option<(gr_text::FileId, String)> {
        let name = path.display().to_string();
        match read_setup(path) {
            Ok(d) => {
                self.files.push(path.to_path_buf());
                Some((self.sources.add(name, d.text.clone()), d.text))
            }
            Err((code, args)) => {
                match self.blamed {
                    Some((file, span)) => self.show(&[Diagnostic::new(code, file, span, &args)]),
                    None => complain(self.renderer, self.sources, &name, code, &args),
                }
                None
            }
        }
    }
    /// What is read next is named by a key of `[project]`, if that is so and the key is there.
    fn named_as(&mut self, by_project: bool, key: &str) {
        let project = self.project.as_ref().filter(|_| by_project);
        let value = |(file, text): &(FileId, String)| (*file, place(text, &[Step::Key("project"), Step::Key(key)]));
        self.blamed = project.map(value);
    }
    fn show(&mut self, found: &[Diagnostic]) {
        for d in found {
            let mut d = d.clone();
            self.hard.harden(&mut d);
            self.renderer.show(self.sources, &d);
        }
    }
    fn project(&mut self, from: &Path) -> Option<Project> {
        let path = Project::find(from)?;
        let (file, text) = self.text(&path)?;
        let project = Project::parse(&path, file, &text).map_err(|d| self.show(&[*d])).ok()?;
        self.show(&project.faults(file, &text));
        self.project = Some((file, text));
        Some(project)
    }
    fn ini(&mut self, path: &Path, setup: &mut Setup) {
        let Some((file, text)) = self.text(path) else { return };
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut included = Vec::new();
        let mut load = |p: &Path| {
            let text = read_setup(p).ok()?.text;
            included.push(p.to_path_buf());
            Some(text)
        };
        let (ini, found) = gr_interp::read_ini(&text, file, Some(folder), Some(&mut load));
        self.files.extend(included);
        self.show(&found);
        setup.ini = ini;
        self.ini = Some((file, text));
    }
    /// A tool table that the INI file names and that is not there: LinuxCNC does not start without it.
    fn no_table(&mut self, setup: &Setup) {
        let (Some((file, text)), Some(name)) = (self.ini.clone(), setup.ini.get("EMCIO", "TOOL_TABLE")) else { return };
        let place = text.find(name).map_or(Span::default(), |at| Span::new(at as u32, (at + name.len()) as u32));
        let args = [name.to_string(), "TOOL_TABLE".into(), "there is no such file".into()];
        let help = Some("correct the name, which counts from the folder of the INI file, or put the tool table there".to_string());
        self.show(&[Diagnostic { help, ..Diagnostic::new(code::INI_VALUE, file, place, &args) }]);
    }
    /// A folder that is named and that is not there.
    fn no_folder(&mut self, path: &Path) {
        let name = path.display().to_string();
        match self.blamed {
            Some((file, span)) => self.show(&[Diagnostic::new(code::FILE_MISSING, file, span, std::slice::from_ref(&name))]),
            None => complain(self.renderer, self.sources, &name, code::FILE_MISSING, std::slice::from_ref(&name)),
        }
    }
    /// A startup code with a mistake: what it should have set is not set.
    fn startup(&mut self, setup: &Setup) {
        let Some((said, (file, text))) = setup.ini.get("RS274NGC", "RS274NGC_STARTUP_CODE").zip(self.ini.clone()) else { return };
        let options = gr_driver::Options::new(Setup { startup_code: false, ..setup.clone() });
        let check = gr_driver::check_once("startup.ngc", format!("{said}\nM2\n"), options).check;
        if let Some(fault) = check.diagnostics.iter().find(|d| d.severity == gr_text::Severity::Error) {
            let place = text.find(said).map_or(Span::default(), |at| Span::new(at as u32, (at + said.len()) as u32));
            let args = [said.to_string(), "RS274NGC_STARTUP_CODE".into(), fault.message.clone()];
            self.show(&[Diagnostic::new(code::INI_VALUE, file, place, &args)]);
        }
    }
    /// Remapped codes whose subroutine is nowhere.
    fn remaps(&mut self, setup: &Setup) {
        let Some((file, text)) = self.ini.take() else { return };
        for (line, name) in gr_interp::remaps_without_file(setup, &|p| p.is_file()) {
            // A line of an included file stands nowhere here.
            let place = text.find(line).map_or(Span::default(), |at| Span::new(at as u32, (at + line.len()) as u32));
            self.show(&[Diagnostic::new(code::INI_REMAP, file, place, &[format!("the subroutine {name} is not there")])]);
        }
    }
    fn tools(&mut self, path: &Path, setup: &mut Setup) {
        let Some((file, text)) = self.text(path) else { return };
        let (tools, found) = gr_interp::read_tools(&text, file);
        self.show(&found);
        setup.tools = tools;
    }
    fn vars(&mut self, path: &Path, setup: &mut Setup) {
        let Some((file, text)) = self.text(path) else { return };
        match gr_interp::read_parameters(&text, file) {
            Ok(mut params) => {
                // A file without a line still says that everything is at its start.
                params.entry(5220).or_insert(1.0);
                setup.params = params;
            }
            Err(d) => self.show(&[*d]),
        }
    }
    fn machine(&mut self, name: &str) -> Option<gr_machine::Machine> {
        match crate::commands::machine::doubted(name, self.sources) {
            Ok((machine, doubts)) => {
                self.show(&doubts);
                if gr_machine::is_path(name) {
                    self.files.push(name.into());
                }
                Some(machine)
            }
            Err(mut found) => {
                if let Some((file, span)) = self.blamed {
                    let nowhere = |d: &Diagnostic| self.sources.get(d.primary().0).is_none_or(|f| f.text.is_empty());
                    found.iter_mut().filter(|d| nowhere(d)).flat_map(|d| &mut d.labels).for_each(|l| (l.file, l.span) = (file, span));
                }
                self.show(&found);
                None
            }
        }
    }
    fn dialect(&mut self, name: &str) -> Option<&'static Dialect> {
        let found = Dialect::find(name);
        if found.is_none() {
            let args = [name.to_string(), crate::commands::explain::dialects()];
            complain(self.renderer, self.sources, "", code::PROJECT_UNKNOWN_DIALECT, &args);
        }
        found
    }
    fn levels(&mut self, args: &LintArgs, project: Option<&Project>) -> Levels {
        let lints = project.map(|p| &p.file.lints);
        // What the project names is told by its own check.
        let known = |names: &[String], milder| -> Vec<Code> { names.iter().filter_map(|n| lint(n, milder).ok()).collect() };
        let (mut allow, mut warn, mut deny) = (self.codes(&args.allow, true), self.codes(&args.warn, true), self.codes(&args.deny, false));
        if let Some(l) = lints {
            allow.extend(known(&l.allow, true));
            warn.extend(known(&l.warn, true));
            deny.extend(known(&l.deny, false));
        }
        Levels { strict: args.strict || lints.is_some_and(|l| l.strict), allow, warn, deny }
    }
    fn codes(&mut self, names: &[String], milder: bool) -> Vec<Code> {
        let mut codes = Vec::new();
        for name in names {
            match lint(name, milder) {
                Ok(c) => codes.push(c),
                Err(code) => complain(self.renderer, self.sources, "", code, std::slice::from_ref(name)),
            }
        }
        codes
    }
}
