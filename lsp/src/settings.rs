//! What the user can choose: section `gccRobot` of the client's settings. `gcc-robot.toml` says what belongs to the
//! programs; these come first.

use std::path::{Path, PathBuf};

use gr_ide::gcode::hints::{HintKinds, Positions};
use serde::Deserialize;
use serde_json::{Map, Value};

/// Settings.
#[derive(Deserialize, Clone, Debug, PartialEq)]
#[serde(default, rename_all = "camelCase")]
pub struct Settings {
    /// Dialect of files that say nothing else.
    pub dialect: Option<String>,
    /// Machine id or path.
    pub machine: Option<String>,
    /// Tool table.
    pub tools: Option<PathBuf>,
    /// INI file of the machine.
    pub ini: Option<PathBuf>,
    /// Stored parameters.
    pub vars: Option<PathBuf>,
    /// `mm` or `inch`.
    pub machine_units: Option<String>,
    /// Folders with subroutines.
    pub subs: Vec<PathBuf>,
    /// Lines that begin with `/` are skipped.
    pub block_delete: bool,
    /// Lints.
    pub lints: Lints,
    /// Inlay hints.
    pub hints: Hints,
    /// Most diagnostics of a file that are sent.
    pub most_problems: usize,
    /// Folders that are open: beside the paths that are configured, no others are read.
    #[serde(skip)]
    pub folders: Vec<PathBuf>,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            dialect: None,
            machine: None,
            tools: None,
            ini: None,
            vars: None,
            machine_units: None,
            subs: Vec::new(),
            block_delete: false,
            lints: Lints::default(),
            hints: Hints::default(),
            most_problems: 1_000,
            folders: Vec::new(),
        }
    }
}

/// How lints are treated: codes or slugs.
#[derive(Deserialize, Clone, Debug, PartialEq, Eq, Default)]
#[serde(default, rename_all = "camelCase")]
pub struct Lints {
    /// Warnings count as errors.
    pub strict: bool,
    /// Never mentioned.
    pub allow: Vec<String>,
    /// Mentioned although off by default.
    pub warn: Vec<String>,
    /// Errors.
    pub deny: Vec<String>,
}

/// Which inlay hints are shown.
#[derive(Deserialize, Clone, Debug, PartialEq, Eq)]
#[serde(default, rename_all = "camelCase")]
pub struct Hints {
    /// The motion code that a block goes on with.
    pub motion: bool,
    /// `off`, `computed` or `all`.
    pub position: String,
    /// Feed in mm/min where the text has another unit.
    pub feed: bool,
    /// Modes that change without a code in the block.
    pub modes: bool,
    /// Time of a block.
    pub time: bool,
    /// Radius or centre of arcs.
    pub arc: bool,
    /// Values of expressions.
    pub values: bool,
    /// Attribute names in STEP-NC files.
    pub attributes: bool,
}

impl Default for Hints {
    fn default() -> Hints {
        Hints { motion: true, position: "computed".into(), feed: true, modes: true, time: true, arc: true, values: true, attributes: true }
    }
}

impl Hints {
    /// As the features take them.
    pub fn kinds(&self) -> HintKinds {
        HintKinds {
            motion: self.motion,
            position: match self.position.as_str() {
                "off" => Positions::Off,
                "all" => Positions::All,
                _ => Positions::Computed,
            },
            feed: self.feed,
            modes: self.modes,
            time: self.time,
            arc: self.arc,
            values: self.values,
            attributes: self.attributes,
        }
    }
}

/// Keys of the section, and what each takes; those of lists of their own come with a dot.
const KEYS: &[(&str, &str)] = &[
    ("dialect", "the name of a dialect, such as \"linuxcnc\" or \"grbl\""),
    ("machine", "the id or path of a machine, such as \"generic/mill3\""),
    ("tools", "the path of a tool table"),
    ("ini", "the path of an INI file"),
    ("vars", "the path of a parameter file"),
    ("machineUnits", "\"mm\" or \"inch\""),
    ("subs", "a list of folders"),
    ("blockDelete", "true or false"),
    ("lints", "an object with strict, allow, warn, deny"),
    ("lints.strict", "true or false"),
    ("lints.allow", "a list of codes or slugs of lints"),
    ("lints.warn", "a list of codes or slugs of lints"),
    ("lints.deny", "a list of codes or slugs of lints"),
    ("hints", "an object with motion, position, feed, modes, time, arc, values, attributes"),
    ("hints.motion", "true or false"),
    ("hints.position", "\"off\", \"computed\" or \"all\""),
    ("hints.feed", "true or false"),
    ("hints.modes", "true or false"),
    ("hints.time", "true or false"),
    ("hints.arc", "true or false"),
    ("hints.values", "true or false"),
    ("hints.attributes", "true or false"),
    ("mostProblems", "a whole number"),
];

/// Keys that the client keeps in the same section for itself.
const OF_CLIENTS: &[&str] = &["pullDiagnostics", "explainPages", "server", "preview", "trace"];

/// What a client sent, and what could not be understood.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Read {
    /// The settings; what is not understood is as if it was not sent.
    pub settings: Settings,
    /// One sentence for each key that is not understood.
    pub mistakes: Vec<String>,
}

impl Settings {
    /// The same with paths that are relative to this folder.
    pub fn below(&self, folder: &Path) -> Settings {
        let at = |path: &PathBuf| folder.join(path);
        let machine = |name: &String| {
            let path = folder.join(name);
            let file = gr_machine::source(name).is_none() && (gr_machine::is_path(name) || path.is_file());
            if file { path.to_string_lossy().into_owned() } else { name.clone() }
        };
        Settings {
            machine: self.machine.as_ref().map(machine),
            tools: self.tools.as_ref().map(at),
            ini: self.ini.as_ref().map(at),
            vars: self.vars.as_ref().map(at),
            subs: self.subs.iter().map(at).collect(),
            ..self.clone()
        }
    }

    /// As options of `gcc-robot build`. The dialect is the one that the program is read in, where one was chosen: as an
    /// option it would go before what the program says itself.
    pub fn options(&self, dialect: Option<&gr_spec::Dialect>) -> Vec<String> {
        let path = |p: &PathBuf| p.to_string_lossy().into_owned();
        let mut options = Vec::new();
        let mut give = |name: &str, value: Option<String>| {
            options.extend(value.into_iter().flat_map(|v| [format!("--{name}"), v]));
        };
        give("dialect", dialect.filter(|_| self.dialect.is_some()).map(|d| d.id.to_string()));
        give("machine", self.machine.clone());
        give("tools", self.tools.as_ref().map(path));
        give("ini", self.ini.as_ref().map(path));
        give("vars", self.vars.as_ref().map(path));
        give("machine-units", self.machine_units.clone());
        self.subs.iter().for_each(|s| give("subs", Some(path(s))));
        for (name, lints) in [("allow", &self.lints.allow), ("warn", &self.lints.warn), ("deny", &self.lints.deny)] {
            lints.iter().for_each(|l| give(name, Some(l.clone())));
        }
        let switches = [("--block-delete", self.block_delete), ("--strict", self.lints.strict)];
        options.extend(switches.iter().filter(|s| s.1).map(|s| s.0.to_string()));
        options
    }

    /// Reads what a client sent: the section itself or an object that holds it.
    pub fn read(value: &Value) -> Read {
        let section = value.get("gccRobot").or_else(|| value.get("gcc-robot")).unwrap_or(value);
        let mut mistakes = Vec::new();
        let good = match section {
            Value::Null => Map::new(),
            // An empty table of Lua is sent as a list.
            Value::Array(none) if none.is_empty() => Map::new(),
            Value::Object(keys) => understood(keys, "", &mut mistakes),
            other => {
                mistakes.push(format!("the settings `gccRobot` must be an object, not {}", shown(other)));
                Map::new()
            }
        };
        let settings = serde_json::from_value(Value::Object(good)).unwrap_or_default();
        Read { settings, mistakes }
    }
}

/// The keys that can be read; `within` is the name of the list they are in, with a dot.
fn understood(keys: &Map<String, Value>, within: &str, mistakes: &mut Vec<String>) -> Map<String, Value> {
    let mut good = Map::new();
    for (key, value) in keys {
        let name = format!("{within}{key}");
        // An empty string means: not chosen.
        if value.is_null() || value.as_str() == Some("") || within.is_empty() && OF_CLIENTS.contains(&&**key) {
            continue;
        }
        let Some((_, wanted)) = KEYS.iter().find(|k| k.0 == name) else {
            let here: Vec<&str> = KEYS.iter().filter_map(|k| k.0.strip_prefix(within)).filter(|k| !k.contains('.')).collect();
            mistakes.push(format!("there is no setting `gccRobot.{name}`; those here are {}", here.join(", ")));
            continue;
        };
        let value = match value {
            Value::Object(inner) if matches!(&*name, "lints" | "hints") => Value::Object(understood(inner, &format!("{name}."), mistakes)),
            Value::Array(none) if none.is_empty() && matches!(&*name, "lints" | "hints") => Value::Object(Map::new()),
            other => other.clone(),
        };
        if takes(&name, &value) {
            good.insert(key.clone(), value);
        } else {
            mistakes.push(format!("`gccRobot.{name}` must be {wanted}, not {}", shown(&value)));
        }
    }
    good
}

/// Whether a value fits a key.
fn takes(name: &str, value: &Value) -> bool {
    let one_of = |names: &[&str]| value.as_str().is_some_and(|v| names.contains(&v));
    let lints = |v: &Value| v.as_str().is_some_and(|v| gr_spec::Code::find(v).is_some());
    match name {
        "dialect" => value.as_str().is_some_and(|v| gr_spec::Dialect::find(v).is_some()),
        "machineUnits" => one_of(&["mm", "inch"]),
        "hints.position" => one_of(&["off", "computed", "all"]),
        "lints.allow" | "lints.warn" | "lints.deny" => value.as_array().is_some_and(|l| l.iter().all(lints)),
        "subs" => value.as_array().is_some_and(|l| l.iter().all(Value::is_string)),
        "machine" | "tools" | "ini" | "vars" => value.is_string(),
        "mostProblems" => value.as_u64().is_some_and(|n| usize::try_from(n).is_ok()),
        "lints" | "hints" => value.is_object(),
        _ => value.is_boolean(),
    }
}

/// A value for a message.
fn shown(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= 60 { text } else { text.chars().take(59).chain(['…']).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn sections() {
        let read = Settings::read(&json!({ "gccRobot": { "dialect": "grbl", "machine": "", "hints": { "time": false, "position": "all" }, "server": { "path": "x" } } }));
        assert_eq!(read.mistakes, [""; 0]);
        let s = read.settings;
        assert_eq!(s.dialect.as_deref(), Some("grbl"));
        assert!(s.machine.is_none() && !s.hints.kinds().time && s.hints.kinds().position == Positions::All);
        assert_eq!(Settings::read(&Value::Null), Read::default());
    }

    #[test]
    fn mistakes_are_told_and_the_rest_is_kept() {
        let sent = json!({ "subs": 3, "blockDelete": true, "hints": { "tme": true, "arc": "no", "position": "sometimes" }, "mostProblem": 5, "dialect": "elvish", "lints": { "allow": ["spindle/stopped", "a/b"] } });
        let mut read = Settings::read(&sent);
        read.mistakes.sort();
        assert_eq!(
            read.mistakes,
            [
                "`gccRobot.dialect` must be the name of a dialect, such as \"linuxcnc\" or \"grbl\", not \"elvish\"",
                "`gccRobot.hints.arc` must be true or false, not \"no\"",
                "`gccRobot.hints.position` must be \"off\", \"computed\" or \"all\", not \"sometimes\"",
                "`gccRobot.lints.allow` must be a list of codes or slugs of lints, not [\"spindle/stopped\",\"a/b\"]",
                "`gccRobot.subs` must be a list of folders, not 3",
                "there is no setting `gccRobot.hints.tme`; those here are motion, position, feed, modes, time, arc, values, attributes",
                "there is no setting `gccRobot.mostProblem`; those here are dialect, machine, tools, ini, vars, machineUnits, subs, blockDelete, lints, hints, mostProblems",
            ]
        );
        assert_eq!(read.settings, Settings { block_delete: true, ..Settings::default() });
        let empty = Settings::read(&json!({ "gccRobot": [] }));
        assert_eq!((empty.settings, empty.mistakes.len()), (Settings::default(), 0));
        assert_eq!(Settings::read(&json!({ "gccRobot": { "hints": [] } })).mistakes.len(), 0);
        assert_eq!(Settings::read(&json!([1])).mistakes, ["the settings `gccRobot` must be an object, not [1]"]);
    }

    /// Every key of the settings has a row, and no row is of another key.
    #[test]
    fn the_table_names_all_keys() {
        let docs = include_str!("../../docs/editor-features.md");
        for (key, _) in KEYS {
            let last = key.rsplit('.').next().unwrap_or(key);
            assert!(docs.contains(&format!("`{last}`")), "{key} is not in docs/editor-features.md");
        }
    }
}
