//! The project file `gcc-robot.toml`, schema 1 (spec/config/gcc-robot.schema.json).

use std::path::{Path, PathBuf};

use gr_text::{Code, Diagnostic, FileId, Span, code};
use serde::Deserialize;

/// Name of the file.
pub const NAME: &str = "gcc-robot.toml";
/// The version of the format that is read.
const SCHEMA: i64 = 1;

/// A project file and where it lies.
#[derive(Debug, Default)]
pub struct Project {
    /// Folder that its names are relative to.
    pub folder: PathBuf,
    /// The file.
    pub path: PathBuf,
    /// What it says.
    pub file: ProjectFile,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProjectFile {
    /// Version of the format; checked before anything else.
    #[serde(rename = "schema")]
    pub _schema: i64,
    #[serde(default)]
    pub project: Section,
    #[serde(default)]
    pub dialects: Vec<DialectRule>,
    #[serde(default)]
    pub lints: Lints,
    #[serde(default)]
    pub targets: Vec<Target>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct Section {
    pub sources: Vec<String>,
    pub dialect: Option<String>,
    pub machine: Option<String>,
    pub tools: Option<PathBuf>,
    pub vars: Option<PathBuf>,
    pub ini: Option<PathBuf>,
    pub machine_units: Option<crate::options::UnitArg>,
    pub block_delete: bool,
    pub stock: Option<[[f64; 3]; 2]>,
    pub subs: Vec<PathBuf>,
    pub step_units: Option<crate::options::StepUnits>,
    pub step_overlap: Option<crate::options::StepOverlap>,
    pub reference: Option<crate::emit::Reference>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DialectRule {
    pub files: String,
    pub dialect: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Lints {
    pub strict: bool,
    pub allow: Vec<String>,
    pub warn: Vec<String>,
    pub deny: Vec<String>,
}

#[derive(Debug, Deserialize)]
pub struct Target {
    pub target: String,
    pub output: Option<String>,
    #[serde(default)]
    pub sources: Vec<String>,
    #[serde(flatten)]
    pub options: toml::Table,
}

impl Project {
    /// The project file of `from` or of the nearest folder above it.
    pub fn find(from: &Path) -> Option<PathBuf> {
        let absolute = std::path::absolute(from).ok()?;
        absolute.ancestors().map(|f| f.join(NAME)).find(|p| p.is_file())
    }

    /// Reads the text of a project file.
    pub fn parse(path: &Path, file: FileId, text: &str) -> Result<Project, Box<Diagnostic>> {
        // The version first: a later one may have keys that this program does not know.
        let schema = text.parse::<toml::Table>().ok().and_then(|t| t.get("schema").and_then(toml::Value::as_integer));
        if let Some(other) = schema.filter(|s| *s != SCHEMA) {
            let at = text.find("schema").unwrap_or(0) as u32;
            return Err(Box::new(Diagnostic::new(code::PROJECT_SCHEMA, file, Span::new(at, at + 6), &[other.to_string()])));
        }
        match toml::from_str::<ProjectFile>(text) {
            Ok(parsed) => {
                let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
                Ok(Project { folder, path: path.to_path_buf(), file: parsed })
            }
            Err(e) => {
                let range = e.span().unwrap_or(0..0);
                let span = Span::new(range.start as u32, range.end as u32);
                let message = e.message().replace('\n', " ");
                Err(Box::new(Diagnostic::new(code::PROJECT_SYNTAX, file, span, &[message])))
            }
        }
    }

    /// Names in the file that stand for nothing: dialects, lints, targets and their options, each at its place.
    pub fn faults(&self, file: FileId, text: &str) -> Vec<Diagnostic> {
        let mut found = Vec::new();
        let mut say = |code, path: &[Step<'_>], args: &[String]| found.push(Diagnostic::new(code, file, place(text, path), args));
        let mut dialect = |name: Option<&String>, path: &[Step<'_>]| {
            if let Some(name) = name.filter(|n| gr_spec::Dialect::find(n).is_none()) {
                say(code::PROJECT_UNKNOWN_DIALECT, path, &[name.clone(), crate::commands::explain::dialects()]);
            }
        };
        dialect(self.file.project.dialect.as_ref(), &[Step::Key("project"), Step::Key("dialect")]);
        for (i, rule) in self.file.dialects.iter().enumerate() {
            dialect(Some(&rule.dialect), &[Step::Key("dialects"), Step::Index(i), Step::Key("dialect")]);
        }
        let lints = &self.file.lints;
        for (key, names, milder) in [("allow", &lints.allow, true), ("warn", &lints.warn, true), ("deny", &lints.deny, false)] {
            for (i, name) in names.iter().enumerate() {
                if let Err(code) = lint(name, milder) {
                    say(code, &[Step::Key("lints"), Step::Key(key), Step::Index(i)], std::slice::from_ref(name));
                }
            }
        }
        for (i, row) in self.file.targets.iter().enumerate() {
            let at = |key| [Step::Key("targets"), Step::Index(i), Step::Key(key)];
            if gr_spec::TargetDef::find(&row.target).is_none() {
                say(code::PROJECT_UNKNOWN_TARGET, &at("target"), std::slice::from_ref(&row.target));
            }
            if let Some(name) = row.output.as_deref().and_then(placeholder) {
                say(code::PROJECT_TARGET_OPTION, &at("output"), &["output".into(), format!("`{name}` stands for nothing; there are `{{name}}` and `{{extension}}`")]);
            }
            for (key, value) in &row.options {
                let alone = toml::Table::from_iter([(key.clone(), value.clone())]);
                if let Err(why) = crate::commands::build::options_of(&alone) {
                    let why = if why.starts_with("unexpected argument") { "no target has it".to_string() } else { why };
                    say(code::PROJECT_TARGET_OPTION, &at(key), &[key.clone(), why]);
                }
            }
        }
        found
    }

    /// A name in the file as a path from here.
    pub fn path_of(&self, name: &Path) -> PathBuf {
        self.folder.join(name)
    }

    /// The machine, an id or a path from here.
    pub fn machine(&self) -> Option<String> {
        let name = self.file.project.machine.clone()?;
        if gr_machine::source(&name).is_some() {
            return Some(name);
        }
        let path = self.path_of(Path::new(&name));
        Some(if gr_machine::is_path(&name) || path.is_file() { path.to_string_lossy().into_owned() } else { name })
    }

    /// Dialect that the rules give a file.
    pub fn dialect_of(&self, path: &Path) -> Option<&str> {
        let absolute = std::path::absolute(path).ok()?;
        let folder = std::path::absolute(&self.folder).ok()?;
        let name = absolute.strip_prefix(folder).ok()?.to_string_lossy().replace('\\', "/");
        let rule = self.file.dialects.iter().find(|r| matches(&r.files, &name));
        rule.map(|r| r.dialect.as_str()).or(self.file.project.dialect.as_deref())
    }

    /// Files that patterns name, in order and each once, and folders below that can't be read.
    pub fn files(&self, patterns: &[String]) -> (Vec<PathBuf>, Vec<(PathBuf, std::io::Error)>) {
        let (mut found, mut closed) = (Vec::new(), Vec::new());
        let base = if self.folder.as_os_str().is_empty() { Path::new(".") } else { &self.folder };
        let below = |path: &Path| path.strip_prefix(base).unwrap_or(path).to_path_buf();
        for pattern in patterns {
            if !pattern.contains(['*', '?']) {
                found.push(self.folder.join(pattern));
                continue;
            }
            let wanted = |path: &Path| matches(pattern, &below(path).to_string_lossy().replace('\\', "/"));
            let mut all = Vec::new();
            closed.extend(crate::sources::walk(base, &wanted, &mut all));
            found.extend(all.iter().map(|path| self.folder.join(below(path))));
        }
        let mut seen = std::collections::BTreeSet::new();
        found.retain(|p| seen.insert(p.clone()));
        let mut told = std::collections::BTreeSet::new();
        closed.retain(|(p, _)| told.insert(p.clone()));
        (found, closed)
    }
}

/// The first `{…}` in the name of a result that stands for nothing.
fn placeholder(output: &str) -> Option<&str> {
    let ends = output.match_indices('{').filter_map(|(i, _)| Some(&output[i..=i + output[i..].find('}')?]));
    ends.into_iter().find(|p| !matches!(*p, "{name}" | "{extension}"))
}

/// A step from a table to what is in it.
#[derive(Clone, Copy)]
pub enum Step<'a> {
    /// Value of a key.
    Key(&'a str),
    /// Element of a list.
    Index(usize),
}

/// Where a value stands in the text of a TOML file; as far as the way leads.
pub fn place(text: &str, path: &[Step<'_>]) -> Span {
    use toml::de::{DeTable, DeValue};
    fn child<'v, 't>(at: &'v DeValue<'t>, step: &Step<'_>) -> Option<&'v toml::Spanned<DeValue<'t>>> {
        match (at, step) {
            (DeValue::Table(table), Step::Key(key)) => table.get(*key),
            (DeValue::Array(list), Step::Index(i)) => list.get(*i),
            _ => None,
        }
    }
    let Ok(root) = DeTable::parse(text) else { return Span::default() };
    let (Some(Step::Key(first)), mut range) = (path.first(), root.span()) else { return Span::default() };
    let mut at = root.get_ref().get(*first);
    for step in path.get(1..).unwrap_or_default() {
        let Some(here) = at else { break };
        range = here.span();
        at = child(here.get_ref(), step);
    }
    let range = at.map_or(range, toml::Spanned::span);
    Span::new(range.start as u32, range.end as u32)
}

/// The diagnostic of a name in `[lints]`, or on the command line; only lints can be made milder.
pub fn lint(name: &str, milder: bool) -> Result<Code, Code> {
    match Code::find(name) {
        Some(c) if milder && c.def().severity == gr_text::Severity::Error => Err(code::PROJECT_LINT_LEVEL),
        Some(c) => Ok(c),
        None => Err(code::PROJECT_UNKNOWN_LINT),
    }
}

/// Whether `name` fits a pattern: `*` and `?` within a folder, `**` across folders.
pub fn matches(pattern: &str, name: &str) -> bool {
    fn go(p: &[u8], n: &[u8]) -> bool {
        match p {
            [] => n.is_empty(),
            [b'*', b'*', b'/', rest @ ..] => {
                go(rest, n) || n.iter().enumerate().any(|(i, b)| *b == b'/' && go(rest, &n[i + 1..]))
            }
            [b'*', b'*', rest @ ..] => (0..=n.len()).any(|i| go(rest, &n[i..])),
            [b'*', rest @ ..] => {
                let segment = n.iter().position(|b| *b == b'/').unwrap_or(n.len());
                (0..=segment).any(|i| go(rest, &n[i..]))
            }
            [b'?', rest @ ..] => n.first().is_some_and(|b| *b != b'/') && go(rest, &n[1..]),
            [b, rest @ ..] => n.first() == Some(b) && go(rest, &n[1..]),
        }
    }
    go(pattern.trim_start_matches("./").as_bytes(), name.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns() {
        for (pattern, name, fits) in [
            ("*.ngc", "a.ngc", true),
            ("*.ngc", "d/a.ngc", false),
            ("./*.ngc", "a.ngc", true),
            ("**/*.ngc", "a.ngc", true),
            ("**/*.ngc", "d/e/a.ngc", true),
            ("d/**", "d/e/a", true),
            ("a?.nc", "ab.nc", true),
            ("a?.nc", "a.nc", false),
        ] {
            assert_eq!(matches(pattern, name), fits, "{pattern} {name}");
        }
    }

    #[test]
    fn the_template_is_read() {
        let text = include_str!("../../../spec/config/template.toml");
        let project = Project::parse(Path::new("p/gcc-robot.toml"), FileId(0), text).unwrap();
        assert_eq!(project.file.targets[0].target, "rs274ngc");
        let everything: String = text
            .lines()
            .map(|l| l.strip_prefix("# ").filter(|r| r.contains(" = ") || r.starts_with('[')).unwrap_or(l).to_string() + "\n")
            .filter(|l| !l.starts_with("for") && !l.contains("Without"))
            .collect();
        let project = Project::parse(Path::new("p/gcc-robot.toml"), FileId(0), &everything).unwrap();
        assert_eq!(project.file.dialects[0].dialect, "fanuc-mill");
        assert_eq!(project.file.targets[0].options["decimals"].as_integer(), Some(4));
        assert!(project.file.lints.strict && !project.file.project.block_delete);
    }

    #[test]
    fn names_that_stand_for_nothing() {
        let text = "schema = 1\n[project]\n# dialect = \"elvish\"\ndialect = \"elvish\"\n[[dialects]]\nfiles = \"*\"\ndialect = \"grbl\"\n\
                    [[dialects]]\nfiles = \"*\"\ndialect = \"dwarvish\"\n[lints]\nallow = [\"spindle/stopped\", \"E0203\"]\ndeny = [\"no/such\"]\n\
                    [[targets]]\ntarget = \"rs274\"\noutput = \"{name}/{nam}.ngc\"\n[[targets]]\ntarget = \"rs274ngc\"\ndecimals = 3\ndecimal = 4\narcs = \"q\"\n";
        let project = Project::parse(Path::new("x"), FileId(0), text).unwrap();
        let found = project.faults(FileId(0), text);
        let told: Vec<_> = found.iter().map(|d| (d.code.def().code, &text[d.primary().1.range()])).collect();
        assert_eq!(
            told,
            [
                ("E0834", "\"elvish\""),
                ("E0834", "\"dwarvish\""),
                ("E0805", "\"E0203\""),
                ("E0804", "\"no/such\""),
                ("E0846", "\"rs274\""),
                ("E0847", "\"{name}/{nam}.ngc\""),
                ("E0847", "\"q\""),
                ("E0847", "4"),
            ]
        );
        assert_eq!(found[0].primary().1.start as usize, text.rfind("\"elvish\"").unwrap(), "not the remark");
    }

    #[test]
    fn faults_have_places() {
        let d = Project::parse(Path::new("x"), FileId(0), "schema = 2\nnew = 1\n").unwrap_err();
        assert_eq!(d.code, code::PROJECT_SCHEMA);
        let text = "schema = 1\n[project]\nsorces = []\n";
        let d = Project::parse(Path::new("x"), FileId(0), text).unwrap_err();
        assert_eq!((d.code, &text[d.primary().1.range()]), (code::PROJECT_SYNTAX, "sorces"));
    }
}
