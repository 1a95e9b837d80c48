//! What the user can choose: section `gccRobot` of the client's settings. `gcc-robot.toml` says what belongs to the
//! programs; these come first.

use std::path::PathBuf;

use gr_ide::gcode::hints::{HintKinds, Positions};
use serde::Deserialize;
use serde_json::Value;

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

impl Settings {
    /// Reads what a client sent: the section itself or an object that holds it. What can't be read is left as it
    /// was by default, and said.
    pub fn read(value: &Value) -> Result<Settings, String> {
        let section = value.get("gccRobot").or_else(|| value.get("gcc-robot")).unwrap_or(value);
        if section.is_null() {
            return Ok(Settings::default());
        }
        // An empty string means: not chosen.
        let mut section = section.clone();
        if let Some(object) = section.as_object_mut() {
            object.retain(|_, v| !v.is_null() && v.as_str() != Some(""));
        }
        serde_json::from_value(section).map_err(|e| format!("gccRobot settings: {e}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn sections() {
        let s = Settings::read(&json!({ "gccRobot": { "dialect": "grbl", "machine": "", "hints": { "time": false, "position": "all" } } })).unwrap();
        assert_eq!(s.dialect.as_deref(), Some("grbl"));
        assert!(s.machine.is_none() && !s.hints.kinds().time && s.hints.kinds().position == Positions::All);
        assert_eq!(Settings::read(&Value::Null), Ok(Settings::default()));
        assert!(Settings::read(&json!({ "subs": 3 })).is_err());
    }
}
